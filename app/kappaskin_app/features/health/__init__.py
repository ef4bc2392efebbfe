"""Health of the channels, and a test of their map."""
