"""The scene: chosen, edited, planned, played, pressed."""
