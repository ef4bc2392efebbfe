"""A region of interest to a source that scans it: each contact moves what is scanned next."""

from kappaskin.errors import Refusal
from kappaskin.fit import Estimator, Tracking
from kappaskin.frames import Touch
from kappaskin.intrinsic import IntrinsicContact
from kappaskin.region import ADAPTIVE, INTRINSIC, OFF, SKIN, Region, Scanner
from kappaskin.sources import SimulatedSource, Source


class Steering:
    """Lets `source` scan `region`.

    Called with each contact that the skin reports, and the estimator that told its shape.
    """

    def __init__(self, source: SimulatedSource, region: Region) -> None:
        self._source, self._around = source, region.around
        self._scanner = Scanner(source.sensor, region)
        self._intrinsic = IntrinsicContact(source.sensor.layout.patch, source.base)
        self._ahead = source.sensor.scan().interval * max(self._scanner.count, 1)
        source.scan(self._scanner)

    def __call__(self, touch: Touch, estimator: Estimator) -> None:
        if self._around == SKIN:
            self._scanner.follow(touch.position)
        elif self._around == INTRINSIC:
            self._scanner.follow(self._intrinsic(self._source.wrench()).position)
        elif self._around == ADAPTIVE and isinstance(estimator, Tracking):
            count = self._scanner.count
            self._scanner.choose(estimator.choose(count, touch.position, self._ahead / 2))


def steered(source: Source, region: Region) -> Steering | None:
    """What makes `source` scan `region`; None when that is off and everything is scanned.

    Raises a `Refusal` when the source takes no commands or the region is not on its skin; it then
    goes on with everything, or what it chooses itself.
    """
    if isinstance(source, SimulatedSource):
        source.scan(None)
        return None if region.around == OFF else Steering(source, region)
    if region.around != OFF:
        raise Refusal(
            "expected a source that takes commands, got a device of wire version 1, which scans "
            "what it chooses; scan regions on a simulated skin"
        )
    return None
