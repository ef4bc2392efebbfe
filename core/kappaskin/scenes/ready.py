"""Scenes by name: those that are ready, one file each, and files of one's own."""

import math
from importlib.resources import files
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.scenes.read import read_scene, read_scene_text
from kappaskin.scenes.scene import Scene

TABLE_1_NOISE = 0.40 / math.sqrt(3)
"""RMS of the noise of Table 1 in 1/m: uniform between -0.40 and 0.40."""

DEFAULT_SCENE = "circle"

_FOLDER = Path(str(files("kappaskin_resources"))) / "scenes"
_ENDING = ".toml"

SCENES = tuple(sorted(file.stem for file in _FOLDER.iterdir() if file.suffix == _ENDING))
"""Names of the ready scenes."""


def scene_file(name: str = "") -> Path:
    """The file of the ready scene `name`, of the default one when empty; or the TOML file named."""
    if name.endswith(_ENDING):
        return Path(name)
    name = name or DEFAULT_SCENE
    if name not in SCENES:
        raise Refusal(
            f"expected a scene among {', '.join(SCENES)}, or a file that ends in {_ENDING}; got "
            f"{name!r}"
        )
    return _FOLDER / f"{name}{_ENDING}"


def load_scene(name: str = "") -> Scene:
    """The ready scene `name`, the default one when empty; or that in the TOML file of that name."""
    file = scene_file(name)
    return read_scene(read_scene_text(file), file)
