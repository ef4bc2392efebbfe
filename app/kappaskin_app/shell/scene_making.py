"""Scenes that take long to make, made beside the window that waits for them."""

from collections.abc import Generator
from contextlib import suppress
from typing import Any, TypeAlias

from kappaskin._processes import BackgroundProcess
from kappaskin.errors import Refusal
from kappaskin.mechanics import Plate
from kappaskin.scenes import Scene
from kappaskin.skin import Patch
from kappaskin_app.shell.cache import Memo
from kappaskin_app.shell.loads import tried
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import Written
from kappaskin_app.shell.simulation import plate_of, played, scene_or_why

_Slow: TypeAlias = Written | tuple[Plate, str]
_Answer: TypeAlias = tuple[str, tuple[object, ...], Any]

_MEMOS: dict[str, Memo[..., Any]] = {"skin": tried, "scene": scene_or_why, "plan": played}


def _answers(slow: _Slow) -> Generator[_Answer]:
    """What takes long of a scene: which memo is to learn it, the question and the answer."""
    if not isinstance(slow, Written):
        yield "skin", slow, tried(*slow)
        return
    scene = scene_or_why(slow)
    yield "scene", (slow,), scene
    if isinstance(scene, Scene):
        yield "plan", (scene,), played(scene)


class Ahead:
    """Makes scenes once, in a process, so that they can be made at once thereafter.

    Those are the written ones, which are read and planned, and those of unusual skins. In a thread
    of this one they took ten times as long, each step of theirs waiting for a drawing to end.
    """

    def __init__(self) -> None:
        self._work: BackgroundProcess[_Answer] | None = None
        self._slow: _Slow | None = None
        self._begun: set[_Slow] = set()

    def ready(self, settings: Settings) -> bool:
        """Whether the scene of `settings` can be made, or refused, at once; if not, it is begun."""
        slow = _slow(settings)
        if self._work is not None and slow != self._slow:
            self._begun.discard(self._slow)  # nobody waits for it any more
            self.close()
        if self._work is None and slow is not None and slow not in self._begun:
            self._begun.add(slow)
            self._slow, self._work = slow, BackgroundProcess("kappaskin-scene", _answers, slow)
        return self._work is None

    @property
    def busy(self) -> bool:
        return self._work is not None

    def finished(self) -> bool:
        """Whether what was begun is finished; true once."""
        if self._work is None:
            return False
        with suppress(Refusal):  # it died: the scene is made here
            for memo, question, answer in self._work.poll():
                _MEMOS[memo].learn(question, answer)
        if not self._work.done:
            return False
        self.close()
        return True

    def close(self) -> None:
        if self._work is not None:
            self._work.close()
            self._work = None


def _slow(settings: Settings) -> _Slow | None:
    """What of a scene takes long to make, the first time."""
    if settings.written is not None:
        return settings.written
    try:
        skin = plate_of(settings), settings.edge
    except Refusal:
        return None
    # Rectangles and arcs have sines or beams: the others' functions are computed first.
    return skin if type(skin[0].patch) is not Patch else None
