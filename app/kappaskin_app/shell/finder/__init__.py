"""Whatever the window can do, found by a few letters of its name."""
