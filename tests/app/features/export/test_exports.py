"""What leaves the window as a file is what was seen, and says what it is."""

import sys
from pathlib import Path
from xml.etree import ElementTree

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog

from kappaskin import Refusal
from kappaskin_app.features.export.exports import ExportDialog
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.pictures import save_view
from kappaskin_app.shell.window import MainWindow


@pytest.fixture
def named(monkeypatch):
    """Answers the next question for a file."""

    def answer(path: Path, kind: str = "") -> None:
        monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(path), kind))

    return answer


@pytest.fixture
def recording(window: MainWindow, until, tmp_path) -> Path:
    """What the window showed for a moment."""
    path = tmp_path / "rec.mcap"
    window.session.engine.record(path)
    until(lambda: window.session.status.recording.seconds > 0.3)
    window.session.engine.record(None)
    until(path.exists)
    return path


@pytest.mark.cases("the window")
@pytest.mark.parametrize("name", ["the window", "the skin", "the map of curvature xx"])
def test_a_png_is_what_was_seen_with_what_it_is(
    name: str, window, until, named, tmp_path, colours_of
) -> None:
    named(tmp_path / "at 0.5 N", "Picture (*.png)")
    window.actions_by_name[f"picture-of-{name}"].trigger()
    until(lambda: window.statusBar().currentMessage() == f"Saved {tmp_path / 'at 0.5 N.png'}")
    with Image.open(tmp_path / "at 0.5 N.png") as image:
        assert image.info["Title"] == name
        assert "SIM-0001" in image.info["Description"]
        assert "8 x 8 functions, least-squares" in image.info["Description"]
        assert image.info["Description"].startswith("kappaskin ")
        pixels = np.asarray(image.convert("RGB"))
    seen = window.grab().toImage()
    assert pixels.shape[1] <= seen.width()
    assert colours_of(pixels[:-26]) > 50
    assert colours_of(pixels[-26:]) > 5  # the line below


@pytest.mark.full
def test_a_png_that_cannot_be_written_is_told(window, until, named, tmp_path) -> None:
    named(tmp_path / "nowhere" / "out.png")
    window.actions_by_name["picture-of-the window"].trigger()
    until(lambda: "cannot be written" in window.statusBar().currentMessage())


@pytest.mark.full
def test_the_picture_is_whole_where_the_window_closes_at_once(
    window, tmp_path, monkeypatch, colours_of
):
    monkeypatch.chdir(tmp_path)
    window.actions_by_name["picture"].trigger()
    window.close()
    (path,) = tmp_path.iterdir()
    with Image.open(path) as image:
        assert colours_of(np.asarray(image.convert("RGB"))) > 100


@pytest.mark.full
def test_an_svg_of_a_heatmap_has_its_cells_and_a_title(window, named, tmp_path) -> None:
    named(tmp_path / "out.svg")
    window.actions_by_name["picture-of-the map of curvature xx"].trigger()
    root = ElementTree.parse(tmp_path / "out.svg").getroot()
    told = {child.tag.split("}")[1]: child.text for child in root}
    assert told["title"] == "the map of curvature xx"
    assert "SIM-0001" in told["desc"]
    texts = [text for part in root.iter() if part.tag.endswith("text") for text in part.itertext()]
    assert any("functions" in text for text in texts)


@pytest.mark.full
def test_the_skin_in_three_dimensions_is_no_drawing(window, tmp_path) -> None:
    with pytest.raises(Refusal, match=r"expected a file name that ends in \.png, since"):
        save_view(window.centralWidget(), tmp_path / "out.svg", "skin", "", flat=False)
    with pytest.raises(Refusal, match=r"\.png or \.svg"):
        save_view(window.centralWidget(), tmp_path / "out.jpg", "skin", "")
    for suffix in (".png", ".svg"):
        with pytest.raises(Refusal, match="cannot be written"):
            save_view(window.heatmaps["xx"], tmp_path / f"no/out{suffix}", "map", "")


@pytest.mark.full
def test_what_is_hidden_has_no_picture(window, named, tmp_path) -> None:
    named(tmp_path / "out.png")
    window.actions_by_name["picture-of-cost of accuracy"].trigger()
    assert "first" in window.statusBar().currentMessage()
    assert not list(tmp_path.iterdir())


@pytest.mark.full
def test_a_film_shows_the_skin_for_as_long_as_it_was_filmed(
    window, until, named, tmp_path, colours_of
) -> None:
    named(tmp_path / "out.mp4")
    window.actions_by_name["film"].trigger()
    filming = window.exports.filming
    until(lambda: filming.pictures >= 25)
    window.actions_by_name["film"].trigger()
    assert not filming.running
    assert [path.name for path in tmp_path.iterdir()] == ["out.mp4"]
    frames = imageio_ffmpeg.read_frames(str(tmp_path / "out.mp4"))
    about = next(frames)
    assert about["fps"] == 25
    assert about["duration"] == pytest.approx(filming.pictures / 25, abs=0.1)
    first = np.frombuffer(next(frames), np.uint8)
    assert colours_of(first.reshape(-1, 3)) > 100
    frames.close()


@pytest.mark.full
def test_without_ffmpeg_the_line_that_installs_it_is_told(window, named, monkeypatch, tmp_path):
    named(tmp_path / "out.mp4")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    window.actions_by_name["film"].trigger()
    assert "pip install 'kappaskin[film]'" in window.statusBar().currentMessage()
    assert not list(tmp_path.iterdir())


@pytest.mark.full
def test_where_ffmpeg_cannot_be_started_nothing_is_left(window, named, monkeypatch, tmp_path):
    named(tmp_path / "films" / "out.mp4")
    (tmp_path / "films").mkdir()
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nowhere"))
    window.actions_by_name["film"].trigger()
    assert "expected FFmpeg" in window.statusBar().currentMessage()
    assert not list((tmp_path / "films").iterdir())
    assert not window.exports.filming.running


def test_a_film_ends_whole_with_the_window(window, until, named, tmp_path) -> None:
    named(tmp_path / "out.mp4")
    window.actions_by_name["film"].trigger()
    until(lambda: window.exports.filming.pictures >= 3)
    window.close()
    assert [path.name for path in tmp_path.iterdir()] == ["out.mp4"]


@pytest.mark.full
def test_a_recording_is_exported_from_the_dialog(window, until, recording) -> None:
    window.actions_by_name["export"].trigger()
    dialog = window.exports.dialog
    assert not dialog.export_button.isEnabled()
    dialog.recording.setText(str(recording))
    dialog.to.setText(str(recording.with_name("out.npz")))
    assert dialog.every.isEnabled()
    assert not dialog.at.isEnabled()
    dialog.export_button.click()
    assert not dialog.to.isEnabled()
    until(lambda: dialog.to.isEnabled(), 30.0)
    assert dialog.words.text().startswith("Written: ")
    with np.load(recording.with_name("out.npz")) as found:
        assert found["curvature"].shape[1] == 3
    assert sorted(path.name for path in recording.parent.iterdir()) == ["out.npz", "rec.mcap"]


@pytest.mark.full
def test_enter_exports_and_leaves_the_questions_for_files_alone(
    window, until, recording, qtbot
) -> None:
    window.actions_by_name["export"].trigger()
    dialog = window.exports.dialog
    dialog.recording.setText(str(recording))
    dialog.to.setText(str(recording.with_name("out.doc")))
    was = dialog.every.height()
    qtbot.keyClick(dialog.to, Qt.Key.Key_Return)
    assert ".csv, .npz, .h5" in dialog.words.text()
    qtbot.wait(50)
    assert dialog.every.height() == was  # no field is pressed flat by what is said
    dialog.to.setText(str(recording.with_name("out.npz")))
    qtbot.keyClick(dialog.to, Qt.Key.Key_Return)
    assert not dialog.choose_file.isEnabled()
    dialog.cancel_button.click()
    assert dialog.choose_file.isEnabled()
    assert not dialog.bar.isVisible()  # no share of what is not there
    dialog.bar.show()  # as it stands when one is written
    dialog.to.setText(str(recording.with_name("out.doc")))
    qtbot.keyClick(dialog.to, Qt.Key.Key_Return)
    assert not dialog.bar.isVisible()


@pytest.mark.full
def test_an_export_is_cancelled_with_nothing_left(window, recording) -> None:
    window.actions_by_name["export"].trigger()
    dialog = window.exports.dialog
    dialog.recording.setText(str(recording))
    dialog.to.setText(str(recording.with_name("out.csv")))
    dialog.export_button.click()
    dialog.cancel_button.click()
    assert "nothing was written" in dialog.words.text()
    assert dialog.export_button.isEnabled()
    assert [path.name for path in recording.parent.iterdir()] == ["rec.mcap"]


@pytest.mark.cases("a.stl", "a.pvd")
@pytest.mark.parametrize(
    ("name", "span", "at"), [("a.vtp", False, True), ("a.stl", False, True), ("a.pvd", True, False)]
)
def test_only_what_makes_sense_is_asked(name: str, span: bool, at: bool, window) -> None:
    dialog = window.exports.dialog
    dialog.to.setText(name)
    assert dialog.begin.isEnabled() == dialog.until.isEnabled() == span
    assert dialog.at.isEnabled() == at
    if name.endswith(".stl"):
        dialog.every.setValue(0.1)
        assert dialog.begin.isEnabled()
        assert not dialog.at.isEnabled()


def test_a_name_without_an_ending_gets_that_of_the_format_chosen(
    qapp, qtbot, named, monkeypatch, tmp_path
) -> None:
    dialog, asked, names = ExportDialog(Tasks(qapp)), list[str](), list[str]()
    qtbot.addWidget(dialog)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *a: asked.append(a[-1]) or ("", ""))
    dialog.choose_file.click()
    for kind in asked[0].split(";;"):
        named(tmp_path / "force 0.5 N", kind)
        dialog.choose_file.click()
        names.append(Path(dialog.to.text()).name)
    endings = [".csv", ".npz", ".h5", ".vtp", ".pvd", ".stl"]
    assert names == [f"force 0.5 N{ending}" for ending in endings]
    named(tmp_path / "out.npz", "CSV (*.csv)")
    dialog.choose_file.click()
    assert dialog.to.text() == str(tmp_path / "out.npz")


@pytest.mark.full
def test_what_is_refused_is_said_in_the_dialog(window, tmp_path) -> None:
    dialog = window.exports.dialog
    dialog.recording.setText(str(tmp_path / "none.mcap"))
    dialog.to.setText(str(tmp_path / "out.txt"))
    dialog.export_button.click()
    assert "ends in one of" in dialog.words.text()
    assert dialog.export_button.isEnabled()
