"""Costs measured in a background process of one thread."""

from collections.abc import Generator, Iterable, Sequence
from itertools import islice

from kappaskin._processes import BackgroundProcess
from kappaskin.errors import Refusal
from kappaskin.scenes import Scene
from kappaskin.studies.cost.bench import Bench, costs
from kappaskin.studies.cost.effects import EffectCost, effect_costs
from kappaskin.studies.cost.settings import Cost, Refused, Setting

EffectCosts = tuple[EffectCost, ...] | Refused
"""What a scene's effects cost with a setting, or why that setting is refused."""

_Item = Cost | Refused | tuple[Setting, EffectCosts]


def _effects(scene: Scene, setting: Setting) -> EffectCosts:
    try:
        return effect_costs(scene, setting)
    except Refusal as refusal:
        return Refused(setting, str(refusal))


def _measured(
    scene: Scene, settings: Sequence[Setting], effects_with: Setting | None
) -> Generator[_Item]:
    found = costs(scene, settings)
    yield from islice(found, 1)  # the setting that is most waited for
    if effects_with is not None:
        yield effects_with, _effects(scene, effects_with)
    yield from found


class CostMeasurement:
    """Measures `settings` on a `scene` in a process of one thread; no call here but `wait` waits.

    What the scene's effects cost with the setting `effects_with` comes after the first cost, and is
    in `effects`, by setting, once it is known. Refuses a scene that `Bench` refuses. It ends when
    it is done, when `close` is called, or when the process that started it is gone.
    """

    def __init__(
        self, scene: Scene, settings: Sequence[Setting], effects_with: Setting | None = None
    ) -> None:
        Bench(scene)  # or refused here
        self.effects: dict[Setting, EffectCosts] = {}
        self._process = BackgroundProcess(
            "kappaskin-cost", _measured, scene, settings, effects_with
        )

    @property
    def done(self) -> bool:
        return self._process.done

    def poll(self) -> list[Cost | Refused]:
        """What has been measured since the last call.

        Raises a `Refusal` when the process has died, once all that it measured is returned.
        """
        return list(self._costs(self._process.poll()))

    def wait(self) -> Generator[Cost | Refused]:
        """Each cost as soon as it is measured, to the end."""
        yield from self._costs(self._process.wait())

    def _costs(self, items: Iterable[_Item]) -> Generator[Cost | Refused]:
        """The costs among `items`; those of effects go to `effects`."""
        for one in items:
            if isinstance(one, tuple):
                self.effects |= [one]
            else:
                yield one

    def close(self) -> None:
        """Stop measuring and end the process."""
        self._process.close()

    def __enter__(self) -> "CostMeasurement":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
