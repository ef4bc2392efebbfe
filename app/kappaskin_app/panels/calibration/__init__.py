"""The pages of a calibration on cylinders: what to ask, to do next, and what came of it."""
