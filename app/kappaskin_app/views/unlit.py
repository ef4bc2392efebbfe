"""How what only marks something is put into the picture."""

UNLIT = {"lighting": False, "pickable": False, "reset_camera": False, "render": False}
"""For `add_mesh`: the same colour from every side, nothing drawn and the camera left alone."""
