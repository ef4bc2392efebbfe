"""Region tracking: each contact moves the region that the source scans next."""

from kappaskin.contact import IntrinsicContact
from kappaskin.errors import Refusal
from kappaskin.estimation import Estimator, Region, Scanner, Tracking
from kappaskin.frames import Contact
from kappaskin.sensing import Sensor
from kappaskin.sources import SerialSource, SimulatedSource, Source

_NOT_ON_A_LINE = {
    Region.INTRINSIC: "a serial device does not report a force/torque sensor at its base",
    Region.TURNS: "turns need a new scan list for every frame; a device accepts 20 per second",
    Region.ADAPTIVE: "it needs a new scan list for every frame; a device accepts 20 per second",
}


class SimulatedTracking:
    """Lets `source` scan `region`.

    Called with each estimated contact and its estimator.
    """

    refusal = ""

    def __init__(self, source: SimulatedSource, region: Region) -> None:
        self._source, self._around = source, region.around
        self._scanner = Scanner(source.sensor, region)
        self._intrinsic = IntrinsicContact(source.sensor.layout.patch, source.base)
        self._ahead = source.sensor.scan().interval * max(self._scanner.count, 1)
        source.scan(self._scanner)

    def __call__(self, contact: Contact, estimator: Estimator) -> None:
        if self._around == Region.SKIN:
            self._scanner.follow(contact.position)
        elif self._around == Region.INTRINSIC:
            self._scanner.follow(self._intrinsic(self._source.wrench()).position)
        elif self._around == Region.ADAPTIVE and isinstance(estimator, Tracking):
            count = self._scanner.count
            self._scanner.choose(estimator.choose(count, contact.position, self._ahead / 2))


class SerialTracking:
    """Lets a serial device scan `region`, and requests another list as the contact moves.

    Called like `SimulatedTracking`; `refusal` says why the device does not, once that is known.
    """

    def __init__(self, source: SerialSource, sensor: Sensor, region: Region) -> None:
        self._source, self._follows = source, region.around == Region.SKIN
        self._scanner = Scanner(sensor, region)
        source.scan(self._scanner)

    @property
    def refusal(self) -> str:
        return self._source.scan_refusal

    def __call__(self, contact: Contact, estimator: Estimator) -> None:
        if self._follows:
            self._scanner.follow(contact.position)


def track_region(source: Source, region: Region) -> SimulatedTracking | SerialTracking | None:
    """The tracking that lets `source` scan `region`; None where that is off.

    Raises a `Refusal` when the source cannot or the region is not on its skin; it then scans
    all channels.
    """
    if isinstance(source, SimulatedSource):
        source.scan(None)
        return None if region.around == Region.OFF else SimulatedTracking(source, region)
    if not isinstance(source, SerialSource) or source.sensor is None:
        return None
    source.scan(None)
    if region.around == Region.OFF:
        return None
    if region.around in _NOT_ON_A_LINE:
        raise Refusal(
            f"expected a region around elements or skin, got {region.around}: "
            f"{_NOT_ON_A_LINE[region.around]}; choose another, or a simulated skin"
        )
    return SerialTracking(source, source.sensor, region)
