"""Calibration on cylinders, and tare."""
