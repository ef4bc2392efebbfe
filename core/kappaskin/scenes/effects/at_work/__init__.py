"""Computation of the effects on readings, imported when a scene needs them."""
