"""What a sweep showed of every channel, against limits, to who failed and why."""

from dataclasses import dataclass

import numpy as np

from kappaskin.calibration.lines import Lines
from kappaskin.calibration.procedure import Sweep
from kappaskin.frames import Array
from kappaskin.sensing import Sensor

DEAD = "dead, as the device itself says"


@dataclass(frozen=True)
class Limits:
    """What a channel must keep within to pass.

    The gain relative to nominal; the offset, the error of a reading left out of the fit and the
    noise of one frame as shares of the largest curvature applied; and how much of a small change
    must show at once, the rest being hidden in the loops.
    """

    least_gain: float = 0.5
    most_gain: float = 2.0
    offset: float = 0.5
    error: float = 0.05
    noise: float = 0.1
    linear: float = 0.25

    def reason(
        self, most: float, gain: float, offset: float, error: float, noise: float, linear: float
    ) -> str | None:
        """Why a channel fails that was bent up to `most` in 1/m; None when it passes."""
        offset_limit, error_limit, noise_limit = (
            share * most for share in (self.offset, self.error, self.noise)
        )
        # Not >, or NaN would pass.
        judged = (
            (
                self.least_gain <= gain <= self.most_gain,
                f"gain {gain:.3g}, expected {self.least_gain:g} to {self.most_gain:g}; is the gage "
                "broken, wired in reverse, or were the faces swapped?",
            ),
            (
                abs(offset) <= offset_limit,
                f"offset {offset:.3g} 1/m, expected at most {offset_limit:.3g}; balance the bridge",
            ),
            (
                error <= error_limit,
                f"error {error:.3g} 1/m, expected at most {error_limit:.3g}; is the gage bonded, "
                "and did the skin follow the cylinders?",
            ),
            (
                noise <= noise_limit,
                f"noise {noise:.3g} 1/m, expected at most {noise_limit:.3g}; look for a loose wire",
            ),
            (
                linear >= self.linear,
                f"shows {100 * linear:.0f} % of a small change, expected at least "
                f"{100 * self.linear:.0f} %; the rest hides in its loops",
            ),
        )
        return next((why for fine, why in judged if not fine), None)


def failures_of(
    sweep: Sweep, sensor: Sensor, limits: Limits, fitted: Lines, noise: Array, linear: Array
) -> dict[int, str]:
    """Why each channel failed that did; `noise` in 1/m and `linear` are (C,)."""
    most = np.repeat(np.abs(sweep.curvature).max(axis=0), sensor.channels // 3)
    dead = ~sensor.layout.live.ravel()
    found: dict[int, str] = {}
    for c in range(sensor.channels):
        missing = np.flatnonzero(np.isnan(sweep.readings[:, c]))
        numbers = (most, fitted.gain, fitted.offset, fitted.left_out, noise, linear)
        if dead[c]:
            found[c] = DEAD
        elif len(missing):
            found[c] = (
                f"on a rail or not read on {len(missing)} of {len(sweep.steps)} steps, first on "
                f"step {missing[0] + 1}; lower the amplifier's gain"
            )
        elif why := limits.reason(*(float(values[c]) for values in numbers)):
            found[c] = why
    return found
