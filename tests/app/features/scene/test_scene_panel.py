"""The scene panel of a window: a scene chosen, opened, written, and what it calls for."""

from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QComboBox, QFileDialog

from kappaskin import read_scene
from kappaskin.scenes import scene_file
from kappaskin.scenes.effects import EFFECTS
from kappaskin_app.features.scene.gallery import PLAYING
from kappaskin_app.shell.settings import Settings

from .conftest import EDIT, EFFECTS_PAGE, GALLERY, plays


@pytest.mark.full
def test_a_scene_of_the_gallery_plays_from_its_beginning_until_it_is_undone(
    window, panel, until, qtbot
) -> None:
    qtbot.keyClick(window, Qt.Key.Key_F2)
    assert not panel.isVisible()
    qtbot.keyClick(window, Qt.Key.Key_F2)
    assert panel.isVisible()
    panel.gallery.chosen.emit("fingertip")
    until(lambda: plays(window, "fingertip"))
    until(lambda: window.session.status.sensor.layout.patch.strip)
    until(lambda: window.load.isHidden())
    until(lambda: window.display.badge.text() == "SIM")
    window.history.stack.undo()
    until(lambda: plays(window, "circle"))
    until(lambda: not window.session.status.sensor.layout.patch.strip)
    until(lambda: not window.load.isHidden())


@pytest.mark.full
def test_the_simulated_skin_comes_back_to_the_panels(window, panel, until, qtbot) -> None:
    panel.gallery.chosen.emit("hum")
    until(lambda: plays(window, "hum"))
    qtbot.keyClick(window, Qt.Key.Key_M, Qt.KeyboardModifier.ControlModifier)
    until(lambda: plays(window, "circle"))
    assert window.history.settings.written is None


@pytest.mark.cases("fingertip")
@pytest.mark.parametrize("name", ["sphere", "fingertip", "calibration"])
def test_a_scene_named_as_the_source_is_played_as_it_is_written(opened, until, name) -> None:
    window = opened(f"sim:{name}")
    until(lambda: plays(window, name))
    assert window.history.settings.written.text == scene_file(name).read_text()


def test_a_scene_that_there_is_not_is_said(opened, until) -> None:
    window = opened("sim:sphear")
    until(lambda: "sphear" in window.connection.message.text())
    assert window.history.settings == Settings()


@pytest.mark.full
def test_text_and_forms_change_the_scene_and_each_other_while_it_plays(
    window, panel, until, qtbot
) -> None:
    panel.gallery.chosen.emit("tapping")
    until(lambda: plays(window, "tapping"))
    panel.setCurrentIndex(EDIT)
    text = panel.editor.text
    assert text.toPlainText() == scene_file("tapping").read_text()
    connections = window.session.status.connections
    text.setPlainText(text.toPlainText().replace("force = 0.15", "force = 0.3"))
    until(lambda: window.session.scene.stimuli[0].what.force == 0.3)
    assert window.session.status.connections == connections  # the same skin goes on
    panel.editor.form.edited.emit(text.toPlainText().replace("x = 0.06", "x = 0.04"))
    until(lambda: window.session.scene.stimuli[0].what.x == 0.04)
    assert "x = 0.04" in text.toPlainText()
    while window.history.settings.written.text != scene_file("tapping").read_text():
        window.history.stack.undo()
    until(lambda: window.session.scene.stimuli[0].what.force == 0.15)
    assert text.toPlainText() == scene_file("tapping").read_text()


@pytest.mark.full
def test_text_that_is_no_scene_leaves_the_last_one_and_says_where(window, panel, until) -> None:
    panel.gallery.chosen.emit("tapping")
    until(lambda: plays(window, "tapping"))
    panel.setCurrentIndex(EDIT)
    scene, text = window.session.scene, panel.editor.text
    good = text.toPlainText()
    for bad, said in (
        (good.replace("sd =", "sds ="), "expected sd = a number"),
        (good.replace("sd = 0.006", "sd = 0.006 0.1"), "an error in it"),
    ):
        text.setPlainText(bad)
        until(lambda said=said: said in panel.editor.message.text())
        assert window.session.scene is scene
        (mark,) = panel.editor.text.extraSelections()
        marked = mark.cursor.blockNumber() + 1
        assert f"line {marked}" in panel.editor.message.text()
        assert str(scene_file("tapping").parent) not in panel.editor.message.text()
        assert panel.editor.message.isVisible()
    text.setPlainText(good)
    until(lambda: not panel.editor.message.isVisible())
    assert not panel.editor.text.extraSelections()


@pytest.mark.full
def test_a_text_that_was_emptied_is_written_anew(window, panel, until, qtbot) -> None:
    panel.setCurrentIndex(EDIT)
    text = panel.editor.text
    text.setPlainText("")
    until(lambda: "expected format" in panel.editor.message.text())
    text.setFocus()
    qtbot.keyClicks(text, "format = 1")
    until(lambda: "expected format" not in panel.editor.message.text())
    assert window.history.settings.written.text == "format = 1"


@pytest.mark.full
def test_the_keys_of_undo_in_the_text_undo_what_the_window_did(window, panel, until, qtbot) -> None:
    panel.gallery.chosen.emit("hum")
    until(lambda: plays(window, "hum"))
    panel.setCurrentIndex(EDIT)
    text = panel.editor.text
    text.setFocus()
    before = text.toPlainText()
    qtbot.keyClicks(text, "# words")
    qtbot.keyClick(text, Qt.Key.Key_Return)
    assert text.toPlainText() != before
    qtbot.keyClick(text, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(lambda: text.toPlainText() == before)
    assert window.history.settings.written.text == before


def test_the_first_change_of_the_panels_own_scene_makes_it_a_written_one(
    window, panel, until
) -> None:
    panel.setCurrentIndex(EDIT)
    text = panel.editor.text.toPlainText()
    assert "orbit" in text
    own = read_scene(text, Path("own.toml"))
    assert own.stimuli == window.session.scene.stimuli
    panel.editor.text.setPlainText(text.replace("period = 4.0", "period = 2.0"))
    until(lambda: window.session.scene.duration == 2.0)
    assert window.session.scene.name == "own"
    assert window.session.status.sensor.layout.shape == (10, 10)


def force(panel, name: str, how: str) -> None:
    box: QComboBox = panel.effects.forces[name]
    box.setCurrentIndex(box.findData(how))
    box.activated.emit(box.currentIndex())


def row_of(panel, name: str) -> list[str]:
    number = list(panel.effects.forces).index(name)
    return [panel.effects.table.item(number, column).text() for column in (2, 3, 4, 5, 6)]


@pytest.mark.full
def test_effects_are_planned_and_forced_while_the_scene_plays(window, panel, until) -> None:
    panel.gallery.chosen.emit("tapping")
    until(lambda: plays(window, "tapping"))
    assert not window.planner.waiting  # nobody looks
    panel.setCurrentIndex(EFFECTS_PAGE)
    until(lambda: bool(window.planner.rows) and not window.planner.waiting, 60.0)
    assert sorted(panel.effects.forces) == sorted(EFFECTS)
    kept, size, error, took, why = row_of(panel, "gaussian-noise")
    assert kept == "yes"
    assert error.endswith("%")
    assert took.endswith("s")
    assert size
    assert why
    assert row_of(panel, "creep")[0] == ""
    assert not panel.effects.forces["creep"].isEnabled()
    connections = window.session.status.connections
    force(panel, "gaussian-noise", "off")
    until(lambda: window.session.scene.choice.off == {"gaussian-noise"})
    until(lambda: row_of(panel, "gaussian-noise")[0] == "no", 60.0)
    assert 'off = ["gaussian-noise"]' in panel.editor.text.toPlainText()
    assert window.session.status.connections == connections
    force(panel, "quantisation", "on")
    assert window.history.stack.undoText() == "selection of quantisation"
    window.history.stack.undo()
    force(panel, "gaussian-noise", "planned")
    until(lambda: not window.session.scene.choice.off)
    until(lambda: row_of(panel, "gaussian-noise")[0] == "yes", 60.0)


@pytest.mark.full
def test_scenes_are_opened_from_files_and_saved_into_them(
    window, panel, until, tmp_path, monkeypatch
) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(scene_file("hum").read_text())
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(mine), ""))
    window.actions_by_name["open-scene"].trigger()
    until(lambda: plays(window, "mine"))
    out = tmp_path / "out"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(out), ""))
    window.actions_by_name["save-scene"].trigger()
    assert (tmp_path / "out.toml").read_text() == mine.read_text()
    until(lambda: plays(window, "out"))  # it is that file's from now on
    (tmp_path / "out.toml").write_text("another's")
    window.actions_by_name["save-scene"].trigger()  # nobody asked whether to write over it
    assert (tmp_path / "out.toml").read_text() == "another's"
    assert "exists already" in window.statusBar().currentMessage()
    nothing = tmp_path / "nothing.toml"
    nothing.write_bytes(b"\xff\xfe\x00")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(nothing), ""))
    said = []
    window.statusBar().messageChanged.connect(said.append)
    window.actions_by_name["open-scene"].trigger()
    until(lambda: any("cannot be read" in words for words in said))
    nothing.write_text("#" * 1_000_001)
    window.actions_by_name["open-scene"].trigger()
    until(lambda: any("at most 1000000 bytes" in words for words in said))
    assert plays(window, "out")


def test_the_pages_have_their_keys_and_nothing_is_clipped(window, panel, until) -> None:
    window.resize(1280, 800)
    for index in range(panel.count()):
        panel.setCurrentIndex(index)
        until(lambda: panel.currentWidget().isVisible())
        page = panel.currentWidget()
        until(lambda page=page: page.minimumSizeHint().width() <= panel.width())
        assert panel.mapTo(window, QPoint(0, 0)).x() + panel.width() <= window.width()


@pytest.mark.full
def test_a_scene_that_is_chosen_while_one_types_is_played_as_it_is_written(
    window, panel, until
) -> None:
    panel.gallery.chosen.emit("tapping")
    until(lambda: plays(window, "tapping"))
    panel.setCurrentIndex(EDIT)
    panel.editor.text.setPlainText(panel.editor.text.toPlainText() + "# typed\n")
    panel.gallery.chosen.emit("hum")
    until(lambda: plays(window, "hum"))
    assert panel.editor.text.toPlainText() == scene_file("hum").read_text()
    panel.editor.text.setFocus()
    panel.editor.text.setPlainText(panel.editor.text.toPlainText() + "# typed\n")
    panel.setCurrentIndex(GALLERY)  # which takes the focus: what was typed counts at once
    assert window.history.settings.written.text.endswith("# typed\n")
    assert window.history.settings.written.file == scene_file("hum")


@pytest.mark.full
def test_on_another_source_only_the_gallery_leads_back(
    window, panel, until, recording: Path
) -> None:
    panel.gallery.chosen.emit("tapping")
    until(lambda: plays(window, "tapping"))
    until(lambda: panel.gallery.items["tapping"].data(PLAYING))
    panel.setCurrentIndex(EFFECTS_PAGE)
    window.session.request_source(f"replay:{recording}")
    until(lambda: panel.currentIndex() == GALLERY)
    assert not panel.isTabEnabled(EDIT)
    assert not panel.isTabEnabled(EFFECTS_PAGE)
    assert not panel.gallery.items["tapping"].data(PLAYING)
    panel.gallery.chosen.emit("hum")
    until(lambda: plays(window, "hum"))
    assert window.connection.source() == "sim:"
    until(lambda: panel.isTabEnabled(EDIT) and panel.isTabEnabled(EFFECTS_PAGE))
    window.history.stack.undo()
    until(lambda: plays(window, "tapping"))
