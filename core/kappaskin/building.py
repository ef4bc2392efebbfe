"""A setup that was asked for to a pipeline, or to why there is none."""

from dataclasses import dataclass, replace

from kappaskin.errors import Refusal
from kappaskin.pipeline import Pipeline, Setup
from kappaskin.sensor import Sensor


@dataclass(frozen=True, eq=False)
class Built:
    """What came of building a pipeline: `asked` or a smaller one, or none and why."""

    sensor: Sensor
    asked: Setup
    pipeline: Pipeline | None
    refusal: str = ""


def built(sensor: Sensor, asked: Setup, generation: int, smaller: bool) -> Built:
    """A pipeline as asked, or if it may be `smaller` with the most functions that it can have."""
    refusal = ""
    most = max(asked.Ni, asked.Nj)
    for limit in range(most, 0 if smaller else most - 1, -1):
        setup = replace(asked, Ni=min(asked.Ni, limit), Nj=min(asked.Nj, limit))
        try:
            return Built(sensor, asked, Pipeline(sensor, setup, generation), refusal)
        except Refusal as reason:
            refusal = refusal or str(reason)
        except MemoryError:
            refusal = refusal or (
                f"{asked.Ni} x {asked.Nj} functions for {sensor.layout} do not fit in memory; "
                "use fewer"
            )
    return Built(sensor, asked, None, refusal)
