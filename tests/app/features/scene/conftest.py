"""What tests of scenes share: texts shown in forms, and the scene panel of a window."""

from collections.abc import Callable, Iterator
from importlib.resources import files
from typing import Any

import pytest
from PySide6.QtWidgets import QApplication, QDoubleSpinBox

from kappaskin.scenes import SCENES
from kappaskin.sources import information
from kappaskin_app.features.scene.scene_form import SceneForm
from kappaskin_app.shell.window import MainWindow

GALLERY, EDIT, EFFECTS_PAGE = range(3)
FOLDER = files("kappaskin_resources") / "scenes"
TEXTS = {name: (FOLDER / f"{name}.toml").read_text(encoding="utf-8") for name in SCENES}
TOUCHED = """format = 1
# Of a cork.
[[touch]]
what = "sphere"  # a ball
radius = 0.02  # m
x = 0.03
y = 0.04
force = 0.2
path = [
    { step = "press", seconds = 1.0, to = 0.5 },  # slowly
    { step = "release", seconds = 1.0 },
]
[skin]
size = [0.1, 0.1]
"""


@pytest.fixture
def shown(qapp: QApplication, until: Any) -> Iterator[Callable[[str], SceneForm]]:
    """Shows a text in forms on the screen."""
    made: list[SceneForm] = []

    def shown(text: str) -> SceneForm:
        form = SceneForm()
        made.append(form)
        form.resize(420, 600)
        form.show_text(text)
        form.show()
        form.activateWindow()
        until(form.isActiveWindow)
        return form

    yield shown
    for form in made:
        form.close()
        form.deleteLater()
    qapp.processEvents()


def said_by(form: SceneForm) -> list[str]:
    """What it will say from now on."""
    said: list[str] = []
    form.edited.connect(said.append)
    return said


def box_at(form: SceneForm, *place: str | int) -> QDoubleSpinBox:
    box = form.editor(*place)
    assert isinstance(box, QDoubleSpinBox)
    return box


@pytest.fixture
def panel(window: MainWindow, until):
    """The scene panel of a window, seen."""
    window.actions_by_name["dock-scene"].trigger()
    until(lambda: not window.scene.visibleRegion().isEmpty())
    return window.scene


def plays(window: MainWindow, name: str) -> bool:
    scene, sensor = window.session.scene, window.session.status.sensor
    there = sensor is not None and information.sensor_to_json(sensor) == information.sensor_to_json(
        scene.sensor()
    )
    return scene.name == name and there and window.session.estimate is not None
