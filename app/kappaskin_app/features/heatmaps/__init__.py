"""Heatmaps: a quantity of every element, not interpolated."""
