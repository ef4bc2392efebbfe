"""One element in detail, and traces over time."""
