"""Drills: faults inflicted on a line and on processes, and what became of each."""
