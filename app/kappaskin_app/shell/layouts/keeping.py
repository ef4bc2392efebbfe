"""Keeps in a file what the window is like, and has it so at the next start."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QObject, QRect
from PySide6.QtGui import QGuiApplication

from kappaskin_app.guard import guarded
from kappaskin_app.shell.layouts.kept import Kept, KeptFile
from kappaskin_app.shell.menus import Menus
from kappaskin_app.shell.parts import Parts


class Keeping(QObject):
    """Of a `window`; until it has begun, nothing is read and nothing is written."""

    def __init__(self, window: Parts, menus: Menus) -> None:
        super().__init__(window)
        self._window, self._menus = window, menus
        self._file: KeptFile | None = None
        self._kept = Kept()

    def begin(self, path: Path) -> None:
        """Have the window as it is kept at `path`, and keep it there from now on."""
        file, window = KeptFile(path), self._window
        kept, wrong = file.read()
        refused = self._restore(kept)
        self._file, self._kept = file, self._now()
        for changed in (self._menus.sheet.changed, window.layouts.changed, window.opening.changed):
            changed.connect(guarded(self.write))
        if wrong or refused:
            window.tell("; ".join([*([wrong] if wrong else []), *refused]))

    def write(self) -> None:
        """Keep the window as it is."""
        if self._file is None:
            return
        before, self._kept = self._kept, self._now()
        if wrong := self._file.merge(self._kept, before):
            self._window.tell(wrong)

    def _restore(self, kept: Kept) -> list[str]:
        """Have the window so; what could not be."""
        window = self._window
        if kept.place is not None:
            screens = [screen.availableGeometry() for screen in QGuiApplication.screens()]
            window.setGeometry(clamped(QRect(*kept.place), screens))
        if kept.full:
            window.showMaximized()
        chosen = {"show_start": kept.start, "letters": kept.letters}
        chosen |= {"theme": kept.theme} if kept.theme else {}
        window.history.apply(replace(window.history.settings, **chosen))
        window.opening.recent = [Path(file) for file in kept.files]
        self._menus.finder.recent = list(kept.done)
        window.layouts.own = dict(kept.own)
        window.layouts.apply(kept.now or window.layouts.ready())
        return window.actions_by_name.take_keys(dict(kept.keys))

    def _now(self) -> Kept:
        window = self._window
        layout, place = window.layouts.now, window.normalGeometry()
        return Kept(
            theme=window.history.settings.theme,
            start=window.history.settings.show_start,
            letters=window.history.settings.letters,
            place=(place.x(), place.y(), place.width(), place.height()),
            full=window.isMaximized(),
            keys=window.actions_by_name.changed_keys(),
            done=tuple(self._menus.finder.recent),
            files=tuple(str(file) for file in window.opening.recent),
            now=layout,
            own=dict(window.layouts.own),
        )


def clamped(place: QRect, screens: Sequence[QRect]) -> QRect:
    """A place as near to `place` as the screen that shows most of it allows."""
    if not screens:
        return place

    def seen(screen: QRect) -> int:
        both = screen.intersected(place)
        return both.width() * both.height()

    screen = max(screens, key=seen)
    wide, high = min(place.width(), screen.width()), min(place.height(), screen.height())
    x = min(max(place.x(), screen.x()), screen.x() + screen.width() - wide)
    y = min(max(place.y(), screen.y()), screen.y() + screen.height() - high)
    return QRect(x, y, wide, high)
