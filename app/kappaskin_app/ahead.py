"""What takes long to compute of a skin, computed beside the window that waits for it."""

from concurrent.futures import Future, ThreadPoolExecutor

from kappaskin import Patch, Plate, Refusal, Scene
from kappaskin_app.settings import Settings
from kappaskin_app.simulation import plate_of, scene_of


class Ahead:
    """Makes the scenes of unusual skins once, in a thread, so that they can be made at once."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, "scene-maker")
        self._job: Future[Scene] | None = None
        self._begun: set[tuple[Plate, str]] = set()

    def ready(self, settings: Settings) -> bool:
        """Whether the scene of `settings` can be made, or refused, at once; if not, it is begun."""
        try:
            skin = plate_of(settings), settings.edge
        except Refusal:
            return True
        # Rectangles and arcs have sines or beams: the others' functions are computed first.
        if self._job is None and type(skin[0].patch) is not Patch and skin not in self._begun:
            self._begun.add(skin)
            self._job = self._pool.submit(scene_of, settings)
        return self._job is None

    def finished(self) -> bool:
        """Whether what was begun is finished; true once."""
        if self._job is None or not self._job.done():
            return False
        self._job = None
        return True

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)
