"""Costs measured in a process of their own, so that nobody waits and nothing else is timed."""

import multiprocessing
import signal
from collections.abc import Generator, Sequence
from contextlib import suppress
from itertools import islice
from multiprocessing.connection import Connection
from typing import cast

from kappaskin.engine import one_thread_per_process
from kappaskin.errors import Refusal
from kappaskin.scene import Scene
from kappaskin.studies.cost.bench import Bench, costs
from kappaskin.studies.cost.effects import EffectCost, effect_costs
from kappaskin.studies.cost.setting import Cost, Refused, Setting

Effects = tuple[EffectCost, ...] | Refused
"""What a scene's effects cost with a setting, or why that setting cannot tell."""

_Told = Cost | Refused | tuple[Setting, Effects] | None  # None at the end


def _effects(scene: Scene, setting: Setting) -> Effects:
    try:
        return effect_costs(scene, setting)
    except Refusal as refusal:
        return Refused(setting, str(refusal))


def _measure(
    pipe: "Connection[_Told, None]",
    scene: Scene,
    settings: Sequence[Setting],
    effects_with: Setting | None,
) -> None:
    """What the child process does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is the parent's; it closes the pipe
    with suppress(OSError):  # who asked has gone
        found = costs(scene, settings)
        for cost in islice(found, 1):  # the setting that is most waited for
            pipe.send(cost)
        if effects_with is not None:
            pipe.send((effects_with, _effects(scene, effects_with)))
        for cost in found:
            pipe.send(cost)
        pipe.send(None)


class Measuring:
    """Measures `settings` on a `scene` in a process of one thread; no call here but `wait` waits.

    What the scene's effects cost with the setting `effects_with` comes after the first cost, and is
    in `effects`, by setting, once it is known. Refuses a scene that `Bench` refuses. It ends when
    it is done, when `close` is called, or when the process that started it is gone.
    """

    def __init__(
        self, scene: Scene, settings: Sequence[Setting], effects_with: Setting | None = None
    ) -> None:
        Bench(scene)  # or refused here
        self.done = False
        self.effects: dict[Setting, Effects] = {}
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe(duplex=False)
        self._pipe = cast("Connection[None, _Told]", ours)
        with one_thread_per_process():
            self._process = context.Process(
                target=_measure,
                args=(theirs, scene, settings, effects_with),
                name="kappaskin-cost",
                daemon=True,
            )
            self._process.start()
        theirs.close()

    def poll(self) -> list[Cost | Refused]:
        """What has been measured since the last call.

        Raises a `Refusal` when the process has died, once all that it measured is told.
        """
        found: list[Cost | Refused] = []
        while not self.done and self._pipe.poll():
            try:
                found += self._next()
            except Refusal:
                if not found:
                    raise
                self.done = False  # the next call tells
                break
        return found

    def wait(self) -> Generator[Cost | Refused]:
        """Each cost as soon as it is measured, to the end."""
        while not self.done:
            yield from self._next()

    def _next(self) -> list[Cost | Refused]:
        """The next cost, none at the end or where it was told of effects."""
        try:
            told = self._pipe.recv()
        except (EOFError, OSError):
            self.done = True
            raise Refusal("the process that measures ended unexpectedly; measure again") from None
        self.done = told is None
        if isinstance(told, tuple):
            self.effects |= [told]
            return []
        return [] if told is None else [told]

    def close(self) -> None:
        """Stop measuring and end the process."""
        self.done = True
        self._pipe.close()
        self._process.kill()
        self._process.join()
        self._process.close()

    def __enter__(self) -> "Measuring":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
