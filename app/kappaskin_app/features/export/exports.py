"""Export of files: recordings as tables, pictures of views, films."""

import math
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QFileDialog, QLineEdit, QWidget

from kappaskin.errors import Refusal
from kappaskin.pipeline import Setup
from kappaskin.recording import Exported, ExportRequest, ExportTask
from kappaskin_app.features.export.filming import Filmed, Filming
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import WITHIN, Actions
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.centre import Centre
from kappaskin_app.shell.folders import RECORDINGS
from kappaskin_app.shell.pictures import caption_now, chosen_file, save_view, write_png
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.work_dialog import (
    WorkDialog,
    browse_button,
    has_suffix,
    path_in,
    with_suffix,
)
from kappaskin_app.widgets.parts import ELLIPSIS

_LONGEST = 1e6  # s
_FORMATS = (
    "Table for any program (*.csv);;Table for NumPy (*.npz);;Table in HDF5 (*.h5);;"
    "Surface for ParaView, PyVista (*.vtp);;Series of surfaces for ParaView (*.pvd);;"
    "Surface for CAD (*.stl)"
)
_EXPLAINED = {
    "recording": "The recording to export; it is not changed.",
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
        self.begin, self.until = _seconds("the beginning"), _seconds("the end")
        self.every, self.at = _seconds("every frame"), _seconds("")
        self.export_button = self.begin_button
        self.choose_recording = browse_button(self._choose_recording)
        self.needed.append(self.recording)
        self.inputs += (self.recording, self.choose_recording, self.settings)
        self._setup = Setup()
        self._files: tuple[Path, ...] = ()
        self._lay_out()
        self.recording.textChanged.connect(guarded(lambda *_: self._allow()))
        self.every.valueChanged.connect(guarded(lambda *_: self._allow()))

    def _lay_out(self) -> None:
        form = self.form
        self._add_file("&Recording", self.recording, self.choose_recording)
        self._add_file("&File", self.to, self.choose_file)
        form.addRow("&Settings", self.settings)
        form.addRow("Fr&om", self.begin)
        form.addRow("&Until", self.until)
        form.addRow("E&very", self.every)
        form.addRow("&At", self.at)
        for name, tip in _EXPLAINED.items():
            getattr(self, name).setToolTip(tip)
        self._add_buttons()

    def ask_of(self, source: str, at: float, setup: Setup) -> None:
        """Ask for an export of the recording that is played, if any, `at` s of it."""
        if not self.busy:
            self._setup = setup
            if source.startswith("replay:"):
                self.recording.setText(source.removeprefix("replay:"))
                self.at.setValue(at)
        self.ask()
        (self.to if self.recording.text() else self.recording).setFocus()

    def _choose_recording(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Export a recording", "", RECORDINGS)
        if name:
            self.recording.setText(name)

    def _choose_file(self) -> None:
        name, kind = QFileDialog.getSaveFileName(self, "Export to", "", _FORMATS)
        if name:
            path, ending = Path(name), kind.rpartition("*")[2].rstrip(")")
            self.to.setText(str(path if has_suffix(path) else with_suffix(name, ending)))

    @property
    def _at_once(self) -> bool:
        """Whether one time is exported, not a span."""
        suffix = Path(self.to.text()).suffix.lower()
        return suffix == ".vtp" or (suffix == ".stl" and not self.every.value())

    def _allow(self) -> None:
        super()._allow()
        busy = self.busy
        one, suffix = self._at_once, Path(self.to.text()).suffix.lower()
        for widget in (self.begin, self.until):
            widget.setEnabled(not busy and not one)
        self.every.setEnabled(not busy and suffix != ".vtp")
        self.at.setEnabled(not busy and one)

    @property
    def wanted(self) -> ExportRequest:
        """The request; a `Refusal` where it is not valid."""
        setup = self._setup if self.settings.currentIndex() else None
        files = path_in(self.recording), path_in(self.to)
        if self._at_once:
            return ExportRequest(*files, at=self.at.value(), setup=setup)
        until = self.until.value() or math.inf
        return ExportRequest(*files, self.begin.value(), until, self.every.value(), setup=setup)

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
        proposed = time.strftime("kappaskin-%Y%m%d-%H%M%S.mp4")
        file, _ = QFileDialog.getSaveFileName(self._window, "Film the skin", proposed, _FILM)
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
