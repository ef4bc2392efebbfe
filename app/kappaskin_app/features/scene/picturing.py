"""The ready scenes to pictures of them, read and painted in a thread while somebody looks."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, QSize, QTimer, Signal
from PySide6.QtGui import QImage

from kappaskin.errors import Refusal
from kappaskin.scenes import Scene, load_scene
from kappaskin_app.features.scene.relief import Relief, relief
from kappaskin_app.features.scene.scene_picture import picture
from kappaskin_app.guard import guarded
from kappaskin_app.theme import Theme

_POLL = 30  # ms


@dataclass(frozen=True)
class Look:
    """How pictures look: in a `theme`, `width` by `height` in px of which each is `ratio` dots."""

    theme: Theme
    width: int
    height: int
    ratio: float


class Picturing(QObject):
    """Reads the scenes with these `names` once, then paints each anew for every other look.

    `read` brings each scene by its name, or in words why it cannot be; `painted` a name and the
    image for it.
    """

    read = Signal(dict)
    painted = Signal(str, QImage)

    def __init__(self, names: list[str], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._names = names
        self._scenes: dict[str, Scene] | None = None
        self._reliefs: dict[str, Relief] = {}
        self._looks: dict[str, Look] = {}
        self._look: Look | None = None
        self._closed = False
        self._thread = ThreadPoolExecutor(1, "gallery")
        self._busy: tuple[Future[Any], Callable[[Any], None]] | None = None
        self._timer = QTimer(self)
        self._timer.timeout.connect(guarded(self._work))

    def paint(self, look: Look, after: int) -> None:
        """Have what does not look so painted, beginning `after` so many ms."""
        self._look = look
        if not self._closed:
            self._timer.start(after)

    @property
    def busy(self) -> bool:
        return self._timer.isActive()

    def rest(self) -> None:
        """Begin nothing more until something is to be painted."""
        self._timer.stop()

    def close(self) -> None:
        """End the thread, at most a picture later."""
        self._closed = True
        self.rest()
        self._thread.shutdown(wait=True, cancel_futures=True)

    def _work(self) -> None:
        """Take what was made, and have the next thing made."""
        self._timer.setInterval(_POLL)
        if self._busy is not None:
            future, take = self._busy
            if not future.done():
                return
            self._busy = None
            take(future.result())
        if self._scenes is None:
            self._scenes = {}  # asked for, whatever comes of it
            self._busy = self._thread.submit(_loaded, self._names), self._take_scenes
            return
        look = self._look
        for name, scene in self._scenes.items():
            if look is not None and self._looks.get(name) != look:
                self._looks[name] = look
                made = self._thread.submit(self._paint, name, scene, look)
                self._busy = made, lambda made: self.painted.emit(*made)
                return
        self._timer.stop()

    def _take_scenes(self, found: dict[str, Scene | str]) -> None:
        self._scenes = {name: scene for name, scene in found.items() if isinstance(scene, Scene)}
        self.read.emit(found)

    def _paint(self, name: str, scene: Scene, look: Look) -> tuple[str, QImage]:
        if name not in self._reliefs:
            self._reliefs[name] = relief(scene)
        size = QSize(look.width, look.height)
        return name, picture(self._reliefs[name], look.theme, size, look.ratio)


def _loaded(names: list[str]) -> dict[str, Scene | str]:
    """The ready scenes, or in words why one cannot be."""

    def loaded(name: str) -> Scene | str:
        try:
            return load_scene(name)
        except Refusal as refusal:
            return str(refusal)

    return {name: loaded(name) for name in names}
