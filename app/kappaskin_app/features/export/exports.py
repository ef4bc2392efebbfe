"""What leaves the window as a file: recordings, pictures of its views, films."""

import time
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QFileDialog, QWidget

from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.features.export.exporting import ExportDialog
from kappaskin_app.features.export.filming import Filmed, Filming
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import WITHIN, Actions
from kappaskin_app.shell.centre import Centre
from kappaskin_app.shell.pictures import caption_now, chosen_file, save_view, write_png
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.work_dialog import ended

_MENU = "E&xport"
_FILM = "Film (*.mp4)"


class Exports(QObject):
    """Writes files of what a `session` shows in a `window`; `told` says what came of it."""

    told = Signal(str)

    def __init__(self, session: Session, centre: Centre, window: QWidget) -> None:
        super().__init__(window)
        self._session, self._window = session, window
        self.dialog = ExportDialog(window)
        self.filming: Filming | None = None
        if isinstance(centre.view, Filmed):
            self.filming = Filming(centre.view, self)
            self.filming.told.connect(guarded(self.told.emit))
        self._thread = ThreadPoolExecutor(1, "picture-writer")
        self._written: list[tuple[Path, Future[None]]] = []
        session.reported.connect(guarded(self._follow))

    def register(
        self,
        actions: Actions,
        solid: Mapping[str, QWidget],
        flat: Mapping[str, Mapping[str, QWidget]],
    ) -> None:
        """Add actions for recordings, films, and for pictures of views by their names.

        Those that are `solid` are in three dimensions, the others `flat`, a menu of its own each.
        """
        more = "\N{HORIZONTAL ELLIPSIS}"
        actions.add("export", _MENU, f"&Recording{more}", self.ask, "Ctrl+Shift+E")
        if self.filming is not None:
            film = self.film
            actions.add("film", _MENU, "&Film of the skin, begin or end", film, "Ctrl+Shift+F")
        menus = {_MENU: solid} | {f"{_MENU}{WITHIN}{title}": flat[title] for title in flat}
        for menu, views in menus.items():
            for name, view in views.items():
                act = partial(self.picture, view, name, menu != _MENU)
                actions.add(f"picture-of-{name.lower()}", menu, f"Picture of {name}{more}", act)

    def ask(self) -> None:
        """Ask what of a recording is to be written where."""
        session, replay = self._session, self._session.status.replay
        self.dialog.ask_of(session.source, replay.at if replay else 0.0, session.status.setup)

    def picture(self, view: QWidget, title: str, flat: bool) -> None:
        """Ask for a file, and write a picture of a view to it."""
        if not view.isVisible():
            self.told.emit(f"Show {title} first: what is hidden has no picture")
            return
        caption = caption_now(self._session)  # of now, and not of when the file is chosen
        try:
            path = chosen_file(self._window, title, flat)
            if path is None:
                return
            save_view(view, path, title, caption, flat, self.save)
            if path.suffix.lower() != ".png":  # which is told of once it is there
                self.told.emit(f"Saved {path}")
        except Refusal as refusal:
            self.told.emit(str(refusal))

    def save(self, image: QImage, path: Path) -> None:
        """Write a picture beside the window: to pack it takes longer than to draw all anew."""
        self._written.append((path, self._thread.submit(write_png, image, path)))

    def _follow(self, _: Status) -> None:
        while self._written and self._written[0][1].done():
            path, done = self._written.pop(0)
            try:
                done.result()
                self.told.emit(f"Saved {path}")
            except Refusal as refusal:
                self.told.emit(str(refusal))

    def film(self) -> None:
        """Ask for a file and film into it; or end the film that is made."""
        if self.filming is None:
            return
        if self.filming.running:
            self.filming.end()
            return
        proposed = time.strftime("kappaskin-%Y%m%d-%H%M%S.mp4")
        file, _ = QFileDialog.getSaveFileName(self._window, "Film the skin", proposed, _FILM)
        if file:
            try:
                self.filming.begin(ended(file, ".mp4"), caption_now(self._session))
            except Refusal as refusal:
                self.told.emit(str(refusal))

    def close(self) -> None:
        """End what is being written: films and pictures are whole, an export is not there."""
        if self.filming is not None:
            self.filming.end()
        self.dialog.close()
        self._thread.shutdown(wait=True)
