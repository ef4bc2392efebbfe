"""Connection: which source is read, and the events on its line."""
