"""The simulated sensor: skin, elements, electronics, scanned region."""
