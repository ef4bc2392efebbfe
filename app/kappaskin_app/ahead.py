"""Scenes that take long to make, made beside the window that waits for them."""

from concurrent.futures import Future, ThreadPoolExecutor

from kappaskin import Patch, Plate, Refusal, Scene
from kappaskin_app.settings import Settings, Written
from kappaskin_app.simulation import plate_of, scene_of


class Ahead:
    """Makes scenes once, in a thread, so that they can be made at once thereafter.

    Those are the written ones, which are read and planned, and those of unusual skins.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, "scene-maker")
        self._job: Future[Scene] | None = None
        self._begun: set[object] = set()

    def ready(self, settings: Settings) -> bool:
        """Whether the scene of `settings` can be made, or refused, at once; if not, it is begun."""
        slow = _slow(settings)
        if self._job is None and slow is not None and slow not in self._begun:
            self._begun.add(slow)
            self._job = self._pool.submit(scene_of, settings)
        return self._job is None

    @property
    def busy(self) -> bool:
        return self._job is not None

    def finished(self) -> bool:
        """Whether what was begun is finished; true once."""
        if self._job is None or not self._job.done():
            return False
        self._job = None
        return True

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)


def _slow(settings: Settings) -> Written | tuple[Plate, str] | None:
    """What of a scene takes long to make, the first time."""
    if settings.written is not None:
        return settings.written
    try:
        skin = plate_of(settings), settings.edge
    except Refusal:
        return None
    # Rectangles and arcs have sines or beams: the others' functions are computed first.
    return skin if type(skin[0].patch) is not Patch else None
