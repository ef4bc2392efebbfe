"""What accuracy costs: the error, time and memory of settings, and which of them to choose."""
