"""Widgets that know nothing of skins."""
