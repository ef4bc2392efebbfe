"""Log, errors and reports."""
