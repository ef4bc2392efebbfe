"""A skin that is touched for as long as one likes to whether tracking it stays sound."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from kappaskin.bases import SineBasis
from kappaskin.errors import Refusal
from kappaskin.fit import Fit, Tracking
from kappaskin.frames import Array
from kappaskin.layout import SensorLayout
from kappaskin.mechanics import Plate, PointLoad
from kappaskin.patch import Patch

_PATCH = Patch(0.1, 0.1)
_ELEMENTS, _FUNCTIONS = 5, 4  # along each side
_PER_FRAME = 25  # of the 75 channels, in turn
_INTERVAL = 20e-6  # s from one channel to the next
_NOISE = 0.3  # 1/m
_FORCE = 0.15  # N, about 5 mm
_TURN, _TOUCHED = 0.7, 0.5  # s for one turn of the contact, and how long of it it presses
_BLOCKS = 10


class _Touched:
    """The skin under a contact that goes round, presses and lifts."""

    def __init__(self) -> None:
        self.basis = SineBasis(_PATCH, _FUNCTIONS, _FUNCTIONS)
        self.layout = SensorLayout.regular(_PATCH, _ELEMENTS, _ELEMENTS)
        self.operator = self.layout.curvature_operator(self.basis)
        self._compliance = Plate(_PATCH).compliance(self.basis)

    def at(self, time: float) -> Array:
        """Coefficients (N,) at `time` in s."""
        if time % _TURN > _TOUCHED:
            return np.zeros(self.basis.size)
        angle = 2 * math.pi * time / _TURN
        x, y = 0.05 + 0.02 * math.cos(angle), 0.05 + 0.02 * math.sin(angle)
        return self._compliance(PointLoad(x, y, _FORCE).modal(self.basis)).ravel()


def _scans(skin: _Touched, frames: int, seed: int) -> Iterator[tuple[Array, Array, Array]]:
    """Readings (3, P), their times, and the shape at the last of them."""
    rng, channels = np.random.default_rng(seed), 3 * len(skin.layout)
    steps = np.arange(1, _PER_FRAME + 1)
    before = skin.at(0.0)
    for n in range(frames):
        scanned = (n * _PER_FRAME + np.arange(_PER_FRAME)) % channels
        K, t = np.full(channels, np.nan), np.full(channels, np.nan)
        t[scanned] = (n * _PER_FRAME + steps) * _INTERVAL
        now = skin.at(float(t[scanned[-1]]))
        moved = np.multiply.outer(steps / _PER_FRAME, now - before)
        K[scanned] = np.vecdot(skin.operator[scanned], before + moved)
        K[scanned] += rng.normal(0.0, _NOISE, _PER_FRAME)
        yield K.reshape(3, -1), t.reshape(3, -1), now
        before = now


@dataclass(slots=True)
class _Block:
    """Sums over frames."""

    frames: int = 0
    squares: float = 0.0
    covered: float = 0.0
    noise: float = 0.0
    least: float = math.inf
    most: float = 0.0

    def take(self, fit: Fit, truth: Array, rows: Array) -> None:
        error, sd = rows @ (fit.coefficients.ravel() - truth), fit.sd_of(rows)
        self.frames += 1
        self.squares += float(np.mean(error**2))
        self.covered += float(np.mean(np.abs(error) < 1.96 * sd))
        self.noise += float(fit.noise)
        self.least, self.most = min(self.least, float(sd.min())), max(self.most, float(sd.max()))

    def told(self) -> dict[str, Any]:
        return {
            "frames": self.frames,
            "rms_mm": 1e3 * math.sqrt(self.squares / self.frames),
            "covered": self.covered / self.frames,
            "noise": self.noise / self.frames,
            "least_sd_mm": 1e3 * self.least,
            "most_sd_mm": 1e3 * self.most,
        }


def long_run(
    frames: int = 1_000_000, dtype: DTypeLike = np.float64, seed: int = 0
) -> list[dict[str, Any]]:
    """How a tracked skin does, over ten blocks of `frames` partial scans in a row.

    A third of 75 channels is read in each frame, in turn and with Gaussian noise of 0.3 1/m, while
    a contact goes round, presses and lifts. Each row has the RMS error of the displacement at nine
    points in mm, the share of errors within 1.96 standard deviations, the mean of the noise found
    in 1/m, and the least and the greatest standard deviation in mm: NaN or zero would be a
    covariance that is no longer definite.
    """
    if frames < _BLOCKS:
        raise Refusal(f"expected at least {_BLOCKS} frames, got {frames}")
    skin = _Touched()
    fit = Tracking(skin.basis, skin.layout, dtype=dtype)
    places = np.array([0.02, 0.05, 0.08])
    rows = skin.basis.at(np.stack(np.meshgrid(places, places), -1).reshape(-1, 2))
    blocks = [_Block() for _ in range(_BLOCKS)]
    for n, (K, t, truth) in enumerate(_scans(skin, frames, seed)):
        blocks[n * _BLOCKS // frames].take(fit.follow(K, t), truth, rows)
    return [block.told() for block in blocks]
