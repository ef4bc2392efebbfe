"""Effects at work: imported one by one, when a scene calls for them."""
