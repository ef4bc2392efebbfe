"""Effects at work: what each does to readings, imported when a scene calls for it."""
