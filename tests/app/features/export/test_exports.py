"""What leaves the window as a file is what was seen, and says what it is."""

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image
from PySide6.QtCore import Qt
from PySide6.QtGui import QStandardItemModel
from PySide6.QtWidgets import QComboBox, QFileDialog

from kappaskin import Refusal
from kappaskin_app.features.export.exports import ExportDialog
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.pictures import save_view
from kappaskin_app.shell.window import MainWindow

LEFT = Qt.MouseButton.LeftButton
CTRL = Qt.KeyboardModifier.ControlModifier


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
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path))
    window.actions_by_name["picture"].trigger()
    window.close()
    (path,) = (tmp_path / "Kappaskin").iterdir()
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


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where dialogs open: a folder of nobody's own."""
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path / "documents"))
    (tmp_path / "documents" / "Kappaskin").mkdir(parents=True)
    return tmp_path / "documents" / "Kappaskin"


@pytest.mark.full
def test_contact_and_force_of_the_last_recording_are_exported_with_two_keys(
    window, until, recording, folder, qtbot
) -> None:
    last = recording.rename(folder / "last.mcap")
    qtbot.keyClick(window, Qt.Key.Key_E, CTRL | Qt.KeyboardModifier.ShiftModifier)
    dialog = window.exports.dialog
    assert dialog.recording.text() == str(last)
    assert dialog.to.text() == str(folder / "last.csv")
    assert dialog.preset.currentText() == "Contact and force"
    until(lambda: dialog.expected.text().startswith("About "))
    told = re.fullmatch(r"About ([\d.]+) kB for (\d+) frames, in .+ m?s", dialog.expected.text())
    assert told, dialog.expected.text()
    qtbot.keyClick(dialog.to, Qt.Key.Key_Return)
    assert not dialog.to.isEnabled()
    until(lambda: dialog.to.isEnabled())
    assert dialog.words.text().startswith(f"Written: {folder / 'last.csv'}")
    head, *rows = (
        line for line in (folder / "last.csv").read_text().splitlines() if line[0] != "#"
    )
    assert head.count(",") == 11
    assert len(rows) == pytest.approx(int(told[2]), rel=0.2)
    size = (folder / "last.csv").stat().st_size
    assert size == pytest.approx(1e3 * float(told[1]), rel=0.2)
    assert dialog.expected.text() == "Already exists; choose another name."
    assert not dialog.export_button.isEnabled()
    assert sorted(path.name for path in folder.iterdir()) == ["last.csv", "last.mcap"]


def clicked_entry(window, qtbot, menu: str, entry: str) -> None:
    """Click an entry of the window's menu bar."""
    bar = window.menuBar()
    action = next(a for a in bar.actions() if a.text().replace("&", "") == menu)
    qtbot.mouseClick(bar, LEFT, pos=bar.actionGeometry(action).center())
    popup = action.menu()
    qtbot.waitUntil(popup.isVisible)
    found = next(a for a in popup.actions() if a.text().replace("&", "").startswith(entry))
    qtbot.mouseMove(popup, popup.actionGeometry(found).center())
    qtbot.mouseClick(popup, LEFT, pos=popup.actionGeometry(found).center())


def clicked_item(box: QComboBox, qtbot, row: int) -> None:
    """Click an item of a list, once it is open."""
    qtbot.mouseClick(box, LEFT)
    view = box.view()
    qtbot.waitUntil(view.isVisible)
    qtbot.wait(300)  # after which a release is no longer that of the click which opened it
    where = view.visualRect(view.model().index(row, 0)).center()
    qtbot.mouseMove(view.viewport(), where)
    qtbot.mouseClick(view.viewport(), LEFT, pos=where)


def test_it_is_recorded_and_exported_by_mouse_alone(window, until, folder, qtbot) -> None:
    window.panels.reveal(window.recording)
    qtbot.mouseClick(window.recording.record, LEFT)
    until(lambda: window.recorder.written.messages > 0)
    qtbot.mouseClick(window.recording.record, LEFT)
    until(lambda: window.display.banner.isVisible())
    [last] = folder.iterdir()

    clicked_entry(window, qtbot, "Export", "Recording")
    dialog = window.exports.dialog
    until(dialog.isVisible)
    assert dialog.recording.text() == str(last)
    clicked_item(dialog.preset, qtbot, 2)
    clicked_item(dialog.format, qtbot, dialog.format.findData(".npz"))
    assert dialog.preset.currentText() == "Everything"
    assert dialog.to.text() == str(last.with_suffix(".npz"))
    until(lambda: dialog.expected.text().startswith("About "))
    qtbot.mouseClick(dialog.export_button, LEFT)
    until(lambda: dialog.words.text().startswith(f"Written: {last.with_suffix('.npz')}"))
    with np.load(last.with_suffix(".npz")) as written:
        assert {"counts", "force"} <= set(written.files)
    assert window.display.badge.state == "SIM"


@pytest.mark.full
def test_presets_and_formats_are_selected_by_keyboard(
    window, until, recording, folder, qtbot
) -> None:
    last = recording.rename(folder / "last.mcap")
    window.actions_by_name["export"].trigger()
    dialog = window.exports.dialog
    qtbot.keyClick(dialog.preset, Qt.Key.Key_Down)
    assert dialog.preset.currentText() == "Readings"
    qtbot.keyClick(dialog.format, Qt.Key.Key_Down)
    assert dialog.format.currentData() == ".parquet"
    assert dialog.to.text() == str(last.with_suffix(".parquet"))
    qtbot.mouseClick(dialog.export_button, Qt.MouseButton.LeftButton)
    until(lambda: dialog.to.isEnabled())
    table = pytest.importorskip("pyarrow.parquet").read_table(last.with_suffix(".parquet"))
    assert table.column_names[:3] == ["time [s]", "sequence", "device_time [s]"]
    assert "counts_xx_0" in table.column_names
    assert "force [N]" not in table.column_names


@pytest.mark.full
def test_a_wrong_suffix_is_refused_while_it_is_typed(window, recording, qtbot) -> None:
    window.actions_by_name["export"].trigger()
    dialog = window.exports.dialog
    dialog.recording.setText(str(recording))
    dialog.to.setText("")
    high = dialog.every.height()
    for letter in str(recording.with_name("out.xls")):
        qtbot.keyClicks(dialog.to, letter)
        assert not dialog.export_button.isEnabled()
    assert "ends in one of .parquet, .csv, .npz" in dialog.expected.text()
    qtbot.keyClick(dialog.to, Qt.Key.Key_Return)
    assert not dialog.busy
    qtbot.wait(50)
    assert dialog.every.height() == high  # no field is pressed flat by what is said
    for _ in "xls":
        qtbot.keyClick(dialog.to, Qt.Key.Key_Backspace)
    qtbot.keyClicks(dialog.to, "vtp")
    assert dialog.export_button.isEnabled()
    assert dialog.format.currentData() == ".vtp"
    assert not dialog.preset.isEnabled()  # a surface has no columns


def test_a_format_that_is_not_installed_says_what_installs_it(qapp, qtbot, monkeypatch) -> None:
    monkeypatch.setattr("kappaskin_app.features.export.exports.find_spec", lambda _: None)
    dialog = ExportDialog(Tasks(qapp))
    qtbot.addWidget(dialog)
    model = dialog.format.model()
    assert isinstance(model, QStandardItemModel)
    told = {dialog.format.itemText(n): model.item(n).isEnabled() for n in range(model.rowCount())}
    off = [text for text, enabled in told.items() if not enabled]
    assert off == [
        "Table in Parquet (.parquet): pip install 'kappaskin[parquet]'",
        "Table in HDF5 (.h5): pip install 'kappaskin[hdf5]'",
        "All over time, for Rerun (.rrd): pip install 'kappaskin[rerun]'",
        "Data set for LeRobot (.lerobot): pip install 'kappaskin[parquet]'",
    ]
    assert dialog.format.currentData() == ".csv"


@pytest.mark.full
def test_what_is_still_recorded_says_what_to_do(window, until, folder, qtbot) -> None:
    window.recorder.begin(folder / "now.mcap")
    until(lambda: window.recorder.written.messages > 0)
    window.actions_by_name["export"].trigger()
    dialog = window.exports.dialog
    dialog.recording.setText(str(folder / "now.mcap"))
    dialog.to.setText(str(folder / "out.csv"))
    until(lambda: "end the recording" in dialog.expected.text())


@pytest.mark.full
def test_dialogs_open_in_the_folder_with_a_name_filled_in(window, folder, monkeypatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *a: asked.append(a[2]) or ("", ""))
    for action in ("picture-of-the window", "film", "save-scene"):
        window.actions_by_name[action].trigger()
    assert {Path(name).parent for name in asked} == {folder}
    names = [Path(name).name for name in asked]
    assert names[0] == "the window.png"
    assert re.fullmatch(r"kappaskin-\d{8}-\d{6}\.mp4", names[1])
    assert names[2].endswith(".toml")


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


@pytest.mark.cases("a.pvd")
@pytest.mark.parametrize(
    ("name", "span", "at"),
    [
        ("a.vtp", False, True),
        ("a.stl", False, True),
        ("a.glb", False, True),
        ("a.pvd", True, False),
    ],
)
def test_only_what_makes_sense_is_asked(name: str, span: bool, at: bool, window) -> None:
    dialog = window.exports.dialog
    dialog.to.setText(name)
    assert dialog.begin.isEnabled() == dialog.until.isEnabled() == span
    assert dialog.at.isEnabled() == at
    if name.endswith((".stl", ".glb")):
        dialog.every.setValue(0.1)
        assert dialog.begin.isEnabled()
        assert not dialog.at.isEnabled()


def test_a_name_without_an_ending_gets_that_of_the_format_chosen(
    qapp, qtbot, named, monkeypatch, tmp_path
) -> None:
    dialog, asked, names = ExportDialog(Tasks(qapp)), list[str](), list[str]()
    qtbot.addWidget(dialog)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *a: asked.append(a[3]) or ("", ""))
    dialog.choose_file.click()
    for kind in asked[0].split(";;"):
        named(tmp_path / "force 0.5 N", kind)
        dialog.choose_file.click()
        names.append(Path(dialog.to.text()).name)
    endings = [".csv", ".parquet", ".npz", ".h5", ".vtp", ".pvd", ".stl", ".glb", ".rrd"]
    endings += [".lerobot"]
    assert names == [f"force 0.5 N{ending}" for ending in endings]
    named(tmp_path / "out.npz", "CSV (*.csv)")
    dialog.choose_file.click()
    assert dialog.to.text() == str(tmp_path / "out.npz")


@pytest.mark.full
def test_what_is_refused_is_said_in_the_dialog(window, until, tmp_path) -> None:
    window.actions_by_name["export"].trigger()
    dialog = window.exports.dialog
    dialog.recording.setText(str(tmp_path / "none.mcap"))
    dialog.to.setText(str(tmp_path / "out.csv"))
    dialog.export_button.click()
    until(lambda: "expected a recording" in dialog.words.text())
    assert dialog.export_button.isEnabled()
