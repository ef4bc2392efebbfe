"""Films of the 3-D view."""

import time
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal

from kappaskin._files import part_for, replace_whole
from kappaskin.errors import Refusal, lacking
from kappaskin_app.guard import guarded

_RATE = 25  # pictures a second
_EVEN = 2  # px: what the film's colours need sides to be a multiple of


@runtime_checkable
class Filmed(Protocol):
    """A view that is drawn by a plotter."""

    plotter: Any


class Filming(QObject):
    """Films `view`; `notified` brings the duration and the result."""

    notified = Signal(str)

    def __init__(self, view: Filmed, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._view = view
        self._film: Generator[None, Any, None] | None = None
        self._path, self._part = Path(), Path()
        self.pictures = 0
        """The number of pictures of the present or last film."""
        self._size, self._began = (0, 0), 0.0
        self._timer = QTimer(self)
        self._timer.setInterval(1000 // _RATE)
        self._timer.timeout.connect(guarded(self._take))

    @property
    def running(self) -> bool:
        return self._film is not None

    def begin(self, path: Path, caption: str) -> None:
        """Start a film in `path`; a `Refusal` where that fails."""
        try:
            from imageio_ffmpeg import write_frames
        except ImportError as error:
            raise lacking("film", "a film", error) from error
        if path.suffix.lower() != ".mp4":
            raise Refusal(f"{path.name}: expected a file that ends in .mp4")
        if path.exists():
            raise Refusal(f"{path}: exists already; choose another name")
        self._path, self._part = path, part_for(path)
        try:
            self._part.open("wb").close()
        except OSError as error:
            raise Refusal(
                f"{path}: cannot be written ({error.strerror or error}); choose another place"
            ) from error
        picture = self._picture()
        self._size = picture.shape[1], picture.shape[0]
        metadata = ["-metadata", "title=Kappaskin", "-metadata", f"comment={caption}"]
        film = write_frames(
            str(self._part),
            self._size,
            fps=_RATE,
            macro_block_size=_EVEN,
            ffmpeg_log_level="error",
            output_params=metadata,
        )
        try:
            film.send(None)  # until it waits for the first
        except (OSError, RuntimeError) as error:
            self._part.unlink(missing_ok=True)
            raise Refusal(f"expected FFmpeg to make a film, got: {error!s:.200}") from error
        self._film = film
        self.pictures, self._began = 0, time.monotonic()
        self._timer.start()

    def _picture(self) -> "np.ndarray[tuple[int, int, int], np.dtype[np.uint8]]":
        seen = np.asarray(self._view.plotter.screenshot(return_img=True))[..., :3]
        height, width = (side - side % _EVEN for side in seen.shape[:2])
        return np.ascontiguousarray(seen[:height, :width], np.uint8)

    def _take(self) -> None:
        """Add the pictures that are due by now."""
        if self._film is None:
            return
        picture = self._picture()
        if (picture.shape[1], picture.shape[0]) != self._size:
            self.end()
            self.notified.emit(f"The size of the view changed: the film {self._path} ends here")
            return
        due = int((time.monotonic() - self._began) * _RATE) + 1 - self.pictures
        try:
            for _ in range(due):  # repeated for those that there was no time for
                self._film.send(picture)
        except OSError as error:
            self._give_up()
            self.notified.emit(
                f"{self._path}: cannot be written ({error!s:.80}); choose another place"
            )
            return
        self.pictures += max(due, 0)
        self.notified.emit(
            f"Filming: {time.monotonic() - self._began:.0f} s; the same command stops it"
        )

    def end(self) -> None:
        """Stop the film, and give the file its name."""
        film, self._film = self._film, None
        self._timer.stop()
        if film is None:
            return
        film.close()
        try:
            replace_whole(self._path, self._part)
        except Refusal as reason:
            self.notified.emit(str(reason))
            return
        self.notified.emit(f"Filmed {self._path}")

    def _give_up(self) -> None:
        film, self._film = self._film, None
        self._timer.stop()
        if film is not None:
            with suppress(OSError):
                film.close()
        self._part.unlink(missing_ok=True)
