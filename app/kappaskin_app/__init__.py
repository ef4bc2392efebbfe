"""The desktop app: a live view of a curvature-sensing skin."""
