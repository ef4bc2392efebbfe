"""What is shown where in the window, in words: kept as text, put back, chosen by name."""
