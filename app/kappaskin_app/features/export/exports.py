"""Export of files: recordings as tables, pictures of views, films."""

import math
from collections.abc import Mapping
from datetime import datetime
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QImage, QStandardItemModel
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QFileDialog, QLineEdit, QWidget

from kappaskin._text import printable
from kappaskin.errors import Refusal
from kappaskin.pipeline import Setup
from kappaskin.recording import (
    PRESETS,
    TABLES,
    Exported,
    ExportRequest,
    ExportTask,
    Forecast,
    ForecastTask,
    unused,
)
from kappaskin_app.features.export.filming import Filmed, Filming
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import WITHIN, Actions
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.centre import Centre
from kappaskin_app.shell.folders import RECORDINGS, dated, newest, proposed, recordings_folder
from kappaskin_app.shell.pictures import caption_now, chosen_file, save_view, write_png
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.work_dialog import (
    WorkDialog,
    browse_button,
    has_suffix,
    path_in,
    with_suffix,
)
from kappaskin_app.widgets.parts import ELLIPSIS, Label, sentence
from kappaskin_app.widgets.text import duration, file_size

_LONGEST = 1e6  # s
_PAUSE = 400  # ms without a change, after which a forecast is made
_CSV, _PARQUET = ".csv", ".parquet"
_FORMATS = {
    _CSV: "Table for any program",
    _PARQUET: "Table in Parquet",
    ".npz": "Table for NumPy",
    ".h5": "Table in HDF5",
    ".vtp": "Surface for ParaView, PyVista",
    ".pvd": "Series of surfaces for ParaView",
    ".stl": "Surface for CAD",
    ".glb": "Surface or its motion in glTF",
    ".rrd": "All over time, for Rerun",
    ".lerobot": "Data set for LeRobot",
}
_EXTRAS = {
    _PARQUET: ("pyarrow", "parquet"),
    ".h5": ("h5py", "hdf5"),
    ".rrd": ("rerun", "rerun"),
    ".lerobot": ("pyarrow", "parquet"),
}
"""What some formats need: a module, and the extra that installs it."""
_EXPLAINED = {
    "recording": "The recording to export; it is not changed.",
    "preset": "The columns of a table; a surface has none.",
    "format": "The type of the file, which is its suffix too.",
    "to": "The file to write; its suffix determines the format.",
    "settings": "Estimate with the recorded settings, or with the present ones.",
    "begin": "The first frame that is written, in s since the recording began.",
    "until": "The last frame that is written, in s since the recording began.",
    "every": "The time between two surfaces, or rows, in s; 0 writes every frame.",
    "at": "The time of the surface that is written, in s since the recording began.",
}
"""Tooltips of the fields."""


class ExportDialog(WorkDialog):
    """Asks which part of a recording is to be exported to which file."""

    def __init__(self, tasks: Tasks, parent: QWidget | None = None) -> None:
        how = "&Export", "Writing the export", self._start_work, self._result_text
        super().__init__(tasks, "Export a recording", *how, parent)
        self.setObjectName("export")
        self.recording, self.settings = QLineEdit(), QComboBox()
        self.settings.addItems(["As they were recorded", "As they are now"])
        self.preset, self.format, self.expected = QComboBox(), QComboBox(), Label()
        self.expected.setWordWrap(True)
        self.expected.setMinimumHeight(2 * self.fontMetrics().lineSpacing())
        for name, preset in PRESETS.items():
            self.preset.addItem(preset.title, name)
        for suffix, words in _FORMATS.items():
            self._add_format(suffix, f"{words} ({suffix})")
        self.begin, self.until = _seconds("the beginning"), _seconds("the end")
        self.every, self.at = _seconds("every frame"), _seconds("")
        self.export_button = self.begin_button
        self.choose_recording = browse_button(self._choose_recording)
        self.needed.append(self.recording)
        self.inputs += (self.recording, self.choose_recording, self.settings, self.format)
        self._forecast = BackgroundTask(tasks, "", self._show_forecast, self._show_refusal)
        self._changed = QTimer(self, singleShot=True, interval=_PAUSE)  # pyright: ignore[reportCallIssue]
        self._changed.timeout.connect(guarded(self._ask_forecast))
        self._setup = Setup()
        self._files: tuple[Path, ...] = ()
        self._lay_out()
        self.format.activated.connect(guarded(lambda *_: self._change_suffix()))
        for changed in (
            self.recording.textChanged,
            self.preset.currentIndexChanged,
            self.settings.currentIndexChanged,
            *(box.valueChanged for box in (self.begin, self.until, self.every, self.at)),
        ):
            changed.connect(guarded(lambda *_: self._allow()))

    def _add_format(self, suffix: str, words: str) -> None:
        """Add a format, disabled where what it needs is not installed."""
        self.format.addItem(words, suffix)
        module, extra = _EXTRAS.get(suffix, ("", ""))
        model, at = self.format.model(), self.format.count() - 1
        if module and find_spec(module) is None and isinstance(model, QStandardItemModel):
            self.format.setItemText(at, f"{words}: pip install 'kappaskin[{extra}]'")
            model.item(at).setEnabled(False)

    def _lay_out(self) -> None:
        form = self.form
        self._add_file("&Recording", self.recording, self.choose_recording)
        form.addRow("&Columns", self.preset)
        form.addRow("Forma&t", self.format)
        self._add_file("&File", self.to, self.choose_file)
        form.addRow("&Settings", self.settings)
        form.addRow("Fr&om", self.begin)
        form.addRow("&Until", self.until)
        form.addRow("E&very", self.every)
        form.addRow("&At", self.at)
        form.addRow("Size, time", self.expected)
        for name, tip in _EXPLAINED.items():
            getattr(self, name).setToolTip(tip)
        self._add_buttons()

    def ask_of(self, source: str, at: float, setup: Setup) -> None:
        """Ask for an export of the recording that is played, if any, `at` s of it."""
        if not self.busy:
            self._setup = setup
            last = [str(path) for path in newest(recordings_folder())[:1]]
            played = [source.removeprefix("replay:")] if source.startswith("replay:") else []
            self._propose(*[*played, *last][:1])
            self.at.setValue(at if played else 0.0)
        self.ask()
        (self.to if self.recording.text() else self.recording).setFocus()
        self._allow()

    def _propose(self, recording: str = "") -> None:
        """Propose a new file for a recording."""
        if recording:
            self.recording.setText(recording)
            name = Path(recording.removesuffix(".part")).stem
            self.to.setText(str(proposed(f"{name}{self.format.currentData()}")))

    def _choose_recording(self) -> None:
        folder = self.recording.text() or str(recordings_folder())
        name, _ = QFileDialog.getOpenFileName(self, "Export a recording", folder, RECORDINGS)
        self._propose(name)

    def _change_suffix(self) -> None:
        """Let the file have the suffix of the selected format."""
        path, suffix = path_in(self.to), self.format.currentData()
        if path.name:
            other = path.with_suffix(suffix) if has_suffix(path) else with_suffix(str(path), suffix)
            self.to.setText(str(unused(other)))
        self._allow()

    def _choose_file(self) -> None:
        kinds = {suffix: f"{words} (*{suffix})" for suffix, words in _FORMATS.items()}
        name, kind = QFileDialog.getSaveFileName(
            self,
            "Export to",
            self.to.text() or str(recordings_folder()),
            ";;".join(kinds.values()),
            kinds[self.format.currentData()],
            QFileDialog.Option.DontConfirmOverwrite,  # existing files are refused
        )
        if name:
            path, ending = Path(name), kind.rpartition("*")[2].rstrip(")")
            self.to.setText(str(path if has_suffix(path) else with_suffix(name, ending)))

    @property
    def _at_once(self) -> bool:
        """Whether one time is exported, not a span."""
        suffix = Path(self.to.text()).suffix.lower()
        return suffix == ".vtp" or (suffix in (".stl", ".glb") and not self.every.value())

    def _allow(self) -> None:
        super()._allow()
        busy = self.busy
        one, suffix = self._at_once, Path(self.to.text()).suffix.lower()
        if (at := self.format.findData(suffix)) >= 0:
            self.format.setCurrentIndex(at)
        self.preset.setEnabled(not busy and suffix in TABLES)
        self._changed.stop()
        if self._forecast.running:
            self._forecast.stop()
            self.expected.clear()
        if not busy:
            self._check()
        for widget in (self.begin, self.until):
            widget.setEnabled(not busy and not one)
        self.every.setEnabled(not busy and suffix != ".vtp")
        self.at.setEnabled(not busy and one)

    def _check(self) -> None:
        """Refuse what cannot be exported, or make a forecast of it soon."""
        self.expected.clear()
        if not all(line.text().strip() for line in self.needed):
            return
        try:
            _ = self.wanted
        except Refusal as refusal:
            self._show_refusal(refusal)
            self.begin_button.setEnabled(False)
        else:
            self._changed.start()

    def _ask_forecast(self) -> None:
        if self.isVisible():
            self.expected.setText(f"Estimating{ELLIPSIS}")
            self._forecast.begin(lambda: ForecastTask(self.wanted))

    def _show_forecast(self, item: float | Forecast) -> None:
        if isinstance(item, Forecast):
            frames = f"{item.frames:,} frame{'s' * (item.frames != 1)}"
            self.expected.setText(
                f"About {file_size(item.size)} for {frames}, in {duration(item.seconds)}"
            )

    def _show_refusal(self, refusal: Exception) -> None:
        why = str(refusal).removeprefix(f"{path_in(self.to)}: ")  # which stands above
        self.expected.setText(printable(sentence(why)))
        self._grow()

    @property
    def wanted(self) -> ExportRequest:
        """The request; a `Refusal` where it is not valid."""
        setup = self._setup if self.settings.currentIndex() else None
        files = path_in(self.recording), path_in(self.to)
        if self._at_once:
            return ExportRequest(*files, at=self.at.value(), setup=setup)
        until = self.until.value() or math.inf
        span = self.begin.value(), until, self.every.value()
        preset = self.preset.currentData()
        return ExportRequest(*files, *span, setup=setup, preset=preset)

    def _start_work(self) -> ExportTask:
        exporting = ExportTask(self.wanted)
        self._files = exporting.files
        return exporting

    def _result_text(self, result: object) -> str:
        words = result.words if isinstance(result, Exported) else ""
        return f"Written: {', '.join(map(str, self._files))} ({words})"


def _seconds(nothing: str) -> QDoubleSpinBox:
    """A field for a time in s, whose value 0 is shown as `nothing`."""
    field = QDoubleSpinBox()
    field.setRange(0.0, _LONGEST)
    field.setDecimals(3)
    field.setSuffix(" s")
    field.setSpecialValueText(nothing)
    return field


_MENU = "E&xport"
_EXPORT = "Write readings, estimates or surfaces of a recording as files for other programs"
_FILMING = "Start or stop a film of the skin, as MP4"
_PICTURE = "Save a picture of {what} with time and settings; it must be visible"
_OF = "picture-of-"  # begins the name of an action
_FILM = "Film (*.mp4)"


class Exports(QObject):
    """Writes files of what a `window` shows; `notified` brings the results."""

    notified = Signal(str)

    def __init__(self, session: Session, centre: Centre, tasks: Tasks, window: QWidget) -> None:
        super().__init__(window)
        self._session, self._tasks, self._window = session, tasks, window
        self.dialog = ExportDialog(tasks, window)
        self.filming: Filming | None = None
        if isinstance(centre.view, Filmed):
            self.filming = Filming(centre.view, self)
            self.filming.notified.connect(guarded(self.notified.emit))

    def register(
        self,
        actions: Actions,
        solid: Mapping[str, QWidget],
        flat: Mapping[str, Mapping[str, QWidget]],
    ) -> None:
        """Add actions for recordings, films, and for pictures of views by their names.

        Those that are `solid` are in three dimensions, the others `flat`, a menu of its own each.
        """
        actions.add("export", _MENU, f"&Recording{ELLIPSIS}", self.ask, "Ctrl+Shift+E", _EXPORT)
        if self.filming is not None:
            words = "&Film of the skin, start or stop"
            actions.add("film", _MENU, words, self.film, "Ctrl+Shift+F", _FILMING)
        self._add_pictures(actions, _MENU, solid)
        self.offer(actions, flat)

    def offer(self, actions: Actions, flat: Mapping[str, Mapping[str, QWidget]]) -> None:
        """Allow pictures of these flat views only, by the titles of their menus."""
        for title, views in flat.items():
            menu = f"{_MENU}{WITHIN}{title}"
            self._add_pictures(actions, menu, views)
            there = {f"{_OF}{name.lower()}" for name in views}
            for name, entry in actions.entries.items():
                if entry.menu == menu:
                    actions.allow(name, "" if name in there else "this sensor does not read it")

    def _add_pictures(self, actions: Actions, menu: str, views: Mapping[str, QWidget]) -> None:
        for name, view in views.items():
            if f"{_OF}{name.lower()}" not in actions.entries:
                act = partial(self.picture, view, name, menu != _MENU)
                words, tip = f"Picture of {name}{ELLIPSIS}", _PICTURE.format(what=name.lower())
                actions.add(f"{_OF}{name.lower()}", menu, words, act, "", tip)

    def ask(self) -> None:
        """Show the export dialog."""
        session, replay = self._session, self._session.status.replay
        self.dialog.ask_of(session.source, replay.at if replay else 0.0, session.status.setup)

    def picture(self, view: QWidget, title: str, flat: bool) -> None:
        """Ask for a file, and write a picture of a view to it."""
        if not view.isVisible():
            self.notified.emit(f"Show {title} first: a hidden view has no picture")
            return
        caption = caption_now(self._session)  # of now, not of when the file is selected
        try:
            path = chosen_file(self._window, title, flat)
            if path is None:
                return
            save_view(view, path, title, caption, flat, self.save)
            if path.suffix.lower() != ".png":  # which is reported once it is written
                self.notified.emit(f"Saved {path}")
        except Refusal as refusal:
            self.notified.emit(str(refusal))

    def save(self, image: QImage, path: Path) -> None:
        """Write a picture in the background: compressing takes longer than drawing."""
        task = BackgroundTask(self._tasks, "", lambda _: self.notified.emit(f"Saved {path}"))
        task.run(write_png, image, path)

    def film(self) -> None:
        """Ask for a file and start a film, or stop it."""
        if self.filming is None:
            return
        if self.filming.running:
            self.filming.end()
            return
        proposal = str(dated(datetime.now(), ".mp4"))
        file, _ = QFileDialog.getSaveFileName(self._window, "Film the skin", proposal, _FILM)
        if file:
            try:
                self.filming.begin(with_suffix(file, ".mp4"), caption_now(self._session))
            except Refusal as refusal:
                self.notified.emit(str(refusal))

    def close(self) -> None:
        """Stop a film, which is complete, and cancel an export."""
        if self.filming is not None:
            self.filming.end()
        self.dialog.close()
