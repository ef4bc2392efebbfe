"""Costs measured in a process of their own, so that nobody waits and nothing else is timed."""

from collections.abc import Generator, Iterable, Sequence
from itertools import islice

from kappaskin._processes import BackgroundProcess
from kappaskin.errors import Refusal
from kappaskin.scenes import Scene
from kappaskin.studies.cost.bench import Bench, costs
from kappaskin.studies.cost.effects import EffectCost, effect_costs
from kappaskin.studies.cost.setting import Cost, Refused, Setting

Effects = tuple[EffectCost, ...] | Refused
"""What a scene's effects cost with a setting, or why that setting cannot tell."""

_Told = Cost | Refused | tuple[Setting, Effects]


def _effects(scene: Scene, setting: Setting) -> Effects:
    try:
        return effect_costs(scene, setting)
    except Refusal as refusal:
        return Refused(setting, str(refusal))


def _told(
    scene: Scene, settings: Sequence[Setting], effects_with: Setting | None
) -> Generator[_Told]:
    found = costs(scene, settings)
    yield from islice(found, 1)  # the setting that is most waited for
    if effects_with is not None:
        yield effects_with, _effects(scene, effects_with)
    yield from found


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
        self.effects: dict[Setting, Effects] = {}
        self._beside = BackgroundProcess("kappaskin-cost", _told, scene, settings, effects_with)

    @property
    def done(self) -> bool:
        return self._beside.done

    def poll(self) -> list[Cost | Refused]:
        """What has been measured since the last call.

        Raises a `Refusal` when the process has died, once all that it measured is told.
        """
        return list(self._costs(self._beside.poll()))

    def wait(self) -> Generator[Cost | Refused]:
        """Each cost as soon as it is measured, to the end."""
        yield from self._costs(self._beside.wait())

    def _costs(self, told: Iterable[_Told]) -> Generator[Cost | Refused]:
        """The costs among what was told; what it was told of effects is kept."""
        for one in told:
            if isinstance(one, tuple):
                self.effects |= [one]
            else:
                yield one

    def close(self) -> None:
        """Stop measuring and end the process."""
        self._beside.close()

    def __enter__(self) -> "Measuring":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
