"""The contact in numbers and words."""
