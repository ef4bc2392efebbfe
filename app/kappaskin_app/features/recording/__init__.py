"""Recordings: made, played, repaired."""
