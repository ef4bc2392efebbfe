"""Panels ask a person for settings and show what became of them; they never compute."""
