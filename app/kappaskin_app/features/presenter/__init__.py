"""The presenter's view, and force feedback by hand and sound."""
