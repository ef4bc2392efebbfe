"""What a device says it is: its skin, its elements and its electronics."""

from dataclasses import dataclass

from kappaskin.errors import Refusal
from kappaskin.layout import SensorLayout
from kappaskin.mechanics import Plate
from kappaskin.transduction import Transduction


@dataclass(frozen=True, eq=False)
class Sensor:
    """A sensor, real or simulated: a skin held as `edge` says, its elements, its electronics.

    `rate` in frames/s.
    """

    layout: SensorLayout
    transduction: Transduction
    plate: Plate
    edge: str
    rate: float
    name: str
    serial_number: str
    firmware: str
    simulated: bool

    def __post_init__(self) -> None:
        if self.plate.patch != self.layout.patch:
            raise Refusal(
                f"the elements are on {self.layout.patch}, the plate on {self.plate.patch}; use one"
            )
        scan_time = self.transduction.scan_time(self.channels)
        if not 0 < self.rate <= 1 / scan_time * (1 + 1e-9):
            raise Refusal(
                f"{self.channels} channels at {self.transduction.channel_time * 1e6:g} us take "
                f"{scan_time * 1e3:.3g} ms: expected a rate of at most {1 / scan_time:.1f} "
                f"frames/s, got {self.rate:g}; lower the rate or the conversion time"
            )

    @property
    def channels(self) -> int:
        return 3 * len(self.layout)
