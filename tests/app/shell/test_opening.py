from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication

from kappaskin.scenes import scene_file
from kappaskin_app.features.calibration import is_calibration
from kappaskin_app.shell.loads import object_replaceable
from kappaskin_app.shell.window import MainWindow

TETRAHEDRON = np.array([[0, 0, 0], [20, 0, 10], [-10, 17, 10], [-10, -17, 10]])


def _data(*files: Path) -> QMimeData:
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(file)) for file in files])
    return data


def _drop(window: MainWindow, file: Path) -> None:
    some, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    data, copy = _data(file), Qt.DropAction.CopyAction
    QApplication.sendEvent(window, QDragEnterEvent(QPoint(9, 9), copy, data, some, none))
    QApplication.sendEvent(window, QDropEvent(QPointF(9, 9), copy, data, some, none))


@pytest.mark.full
def test_each_kind_of_file_is_taken_and_others_are_passed_over(window: MainWindow) -> None:
    dropped_on = window.opening.drops.dropped_on
    for name in ("a.mcap", "a.mcap.part", "a.toml", "A.STL", "a.ply", "a.obj"):
        assert dropped_on(_data(Path("notes.txt"), Path(name))).name == name
    assert dropped_on(_data(Path("notes.txt"))) is None


def test_a_calibration_is_told_from_a_scene(tmp_path: Path) -> None:
    file = tmp_path / "skin.toml"
    file.write_text('format = 1\nsha256 = "0"\n')
    assert is_calibration(file)
    assert not is_calibration(scene_file("sphere"))


def _write_obj(file: Path) -> Path:
    lines = [f"v {x} {y} {z}" for x, y, z in TETRAHEDRON]
    file.write_text("\n".join([*lines, "f 1 3 2", "f 1 4 3", "f 1 2 4", "f 2 3 4"]))
    return file


@pytest.mark.full
def test_scenes_and_meshes_dropped_are_played_and_listed_until_cleared(
    window: MainWindow, tmp_path: Path, until
) -> None:
    pytest.importorskip("trimesh")
    own = tmp_path / "own.toml"
    own.write_text(scene_file("demo").read_text())
    _drop(window, own)
    until(lambda: getattr(window.history.settings.written, "file", None) == own)
    until(lambda: window.session.inside and object_replaceable(window.session.scene))
    mesh = _write_obj(tmp_path / "tip & edge.obj")
    _drop(window, mesh)
    assert "tip & edge.obj" in window.history.settings.written.text
    until(lambda: "Mesh" in type(window.session.scene.stimuli[0].what.rigid).__name__)
    window.scene_control.play(scene_file("coin"))
    assert window.opening.recent == [mesh, own]
    own.unlink()
    menu = window.actions_by_name["recent"].menu()
    menu.aboutToShow.emit()
    first, second = menu.actions()[:2]
    assert (first.text(), first.isEnabled()) == ("tip && edge.obj", True)
    assert (second.text(), second.isEnabled()) == ("own.toml  (missing)", False)
    assert "moved or deleted" in second.toolTip()
    menu.actions()[-1].trigger()
    assert window.opening.recent == []


@pytest.mark.full
def test_what_cannot_be_opened_says_why_and_is_not_listed(
    window: MainWindow, tmp_path: Path
) -> None:
    calibration = tmp_path / "skin.toml"
    calibration.write_text('format = 1\nsha256 = "0"\n')
    for file, why in (
        (tmp_path / "gone.toml", "cannot be read"),
        (calibration, "skin.toml"),
        (
            tmp_path / "notes.txt",
            "expected a sensor description (.toml), a table of readings (.csv .npz .parquet), a",
        ),
    ):
        window.opening.open(file)
        assert why in window.statusBar().currentMessage()
    window.actions_by_name["disconnect"].trigger()
    assert window.opening.recent == []


def test_a_calibration_given_at_the_start_waits_for_the_sensor_it_is_of(
    opened: Callable[..., MainWindow], tmp_path: Path, until
) -> None:
    calibration = tmp_path / "skin.toml"
    calibration.write_text('format = 1\nsha256 = "0"\n')
    window = opened("sim:")
    assert window.session.status.sensor is None
    window.opening.begin_with(calibration)
    assert "skin.toml" not in window.statusBar().currentMessage()
    until(lambda: "skin.toml" in window.statusBar().currentMessage())
    assert "no sensor" not in window.statusBar().currentMessage()


@pytest.mark.full
def test_a_scene_given_at_the_start_is_played_at_once(
    opened: Callable[..., MainWindow], tmp_path: Path
) -> None:
    own = tmp_path / "own.toml"
    own.write_text(scene_file("demo").read_text())
    window = opened("sim:")
    window.opening.begin_with(own)
    assert window.history.settings.written.file == own
