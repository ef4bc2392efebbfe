"""The desktop app: a live view of a curvature-sensing skin."""

DEFAULT_SOURCE = "sim:fingertip-cap"
"""What the app opens on."""
