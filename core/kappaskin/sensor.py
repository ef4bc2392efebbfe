"""What a device says it is: its skin, its elements and its electronics."""

import math
from dataclasses import dataclass

from kappaskin.errors import Refusal
from kappaskin.layout import SensorLayout
from kappaskin.transduction import Transduction


@dataclass(frozen=True, eq=False)
class Sensor:
    """A sensor, real or simulated; `rate` in frames/s, `rigidity` of the skin in N m."""

    layout: SensorLayout
    transduction: Transduction
    rigidity: float
    rate: float
    name: str
    serial_number: str
    firmware: str
    simulated: bool

    def __post_init__(self) -> None:
        if not 0 < self.rigidity < math.inf:
            raise Refusal(f"expected a rigidity above zero in N m, got {self.rigidity}")
        scan_time = self.transduction.scan_time(self.channels)
        if not 0 < self.rate <= 1 / scan_time * (1 + 1e-9):
            raise Refusal(
                f"{self.channels} channels at {self.transduction.converter.conversion_time * 1e6:g}"
                f" us take {scan_time * 1e3:.3g} ms: expected a rate of at most {1 / scan_time:.1f}"
                f" frames/s, got {self.rate:g}; lower the rate or the conversion time"
            )

    @property
    def channels(self) -> int:
        return 3 * len(self.layout)
