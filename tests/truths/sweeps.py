"""Gages whose loops are no play operators, on cylinders and on other paths after them."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime

import numpy as np

from kappaskin import Patch, Plate, Scene, SensorLayout, Transduction
from kappaskin.calibration import Sweep, calibrate
from kappaskin.scenes.cylinders import RADII, schedule

DATE = datetime(2026, 3, 1, 12, tzinfo=UTC)
NOISE = 0.23  # 1/m, of one frame
FRAMES = 100  # on each cylinder
DWELL = 6.0  # s
CREEP = ((0.006, 2.0), (0.006, 15.0), (0.006, 120.0))  # shares and time constants in s
REST = 0.02  # 1/m: the way is followed in steps of so much


class BoucWen:
    """Loops of Bouc (1967) and Wen (1976): dz = dx (1 - (b sign(dx z) + c) |z / Z|^n).

    `rng` draws the largest lag Z in 1/m, the power n and the asymmetry of each of C channels.
    """

    def __init__(self, channels: int, rng: np.random.Generator, scale: float = 1.0) -> None:
        self.Z = scale * rng.uniform(1.5, 4.0, channels)
        self.n = rng.uniform(0.7, 1.5, channels)
        self.b = rng.uniform(0.5, 0.9, channels)
        self.wider = rng.uniform(0.0, 0.4, channels)
        self.z, self.x = np.zeros(channels), np.zeros(channels)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        count = int(np.ceil(np.abs(x - self.x).max() / 0.5)) or 1
        for dx in np.repeat((x - self.x)[None] / count, count, axis=0):
            share = np.abs(self.z / self.Z) ** self.n
            rate = 1 - (self.b * np.sign(dx * self.z) + 1 - self.b) * share
            self.z = self.z + 0.35 * dx * rate
        self.x = x.copy()
        z = np.clip(self.z, -3 * self.Z, 3 * self.Z)
        return x - z * (1 + self.wider * np.tanh(x / 20))


class Preisach:
    """Relays of Preisach (1935) with switching levels of a Gaussian density of each channel.

    A relay goes up at `up` and down at `down` < `up`. The density depends on where the middle of
    the two is, so that loops differ from place to place, as those of no play do.
    """

    def __init__(self, channels: int, rng: np.random.Generator, scale: float = 1.0) -> None:
        width = np.linspace(1, 40, 20)  # 1/m
        middle = np.linspace(-70, 70, 57)
        w, m = (grid.ravel()[:, None] for grid in np.meshgrid(width, middle))
        self.up, self.down = m + w / 2, m - w / 2
        spread, at = rng.uniform(25, 60, channels), rng.uniform(-15, 15, channels)
        wide = rng.uniform(4, 12, channels)
        density = np.exp(-(((m - at) / spread) ** 2) / 2 - w / wide)
        self.density = density * scale * rng.uniform(5.0, 9.0, channels) / density.sum(axis=0)
        self.state = np.where(m > 0, -1.0, 1.0) * np.ones(channels)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        self.state = np.where(x >= self.up, 1.0, np.where(x <= self.down, -1.0, self.state))
        # Relays of little width are the curve itself, nearly: the loops are the difference.
        return x * 0.93 + (self.density * self.state).sum(axis=0)


class Gages:
    """C channels with loops, creep, gain, offset and noise, that go on from where they were."""

    def __init__(self, loops: Callable, channels: int, rng: np.random.Generator, scale=1.0) -> None:
        self.loops, self.rng = loops(channels, rng, scale), rng
        self.gain, self.offset = rng.normal(1, 0.05, channels), rng.normal(0, 3, channels)
        self.slow = np.zeros((len(CREEP), channels))

    def held(self, curvature: np.ndarray, seconds: float) -> np.ndarray:
        """The mean reading (C,) of the last half of `seconds` on `curvature` (C,) in 1/m."""
        y = self.loops(curvature)
        read = y.copy()
        for slow, (share, tau) in zip(self.slow, CREEP, strict=True):
            read -= share * (y + (slow - y) * np.exp(-0.75 * seconds / tau))
            slow += (y - slow) * -np.expm1(-seconds / tau)
        noise = self.rng.normal(0, NOISE / np.sqrt(FRAMES), len(read))
        return self.gain * read + self.offset + noise


def paths(rng: np.random.Generator) -> dict[str, list[tuple[float, float]]]:
    """Curvatures in 1/m of a bending along x, and s on each, that no calibration takes."""
    other = (70, 41, 29, 23, 18, 15)  # mm
    order = [1e3 / r * s for s in (1, -1) for r in other]
    partial = [20, 60, 35, 55, 10, 45, 25, 0, -30, -10, -55, -20, -40, 15, 40, -15, 5, 0]
    return {
        "other order": [(float(k), DWELL) for k in rng.permutation([*order, *order])],
        "other radii": [(s * 1e3 / r, DWELL) for s in (1, -1) for r in (*other, *other[-2::-1])],
        "partial loops": [(float(k), DWELL) for k in partial],
        "held": [(float(k), 40.0) for k in rng.uniform(-65, 65, 8)],
    }


def scene(elements: int = 4) -> Scene:
    patch = Patch(0.1, 0.1)
    layout = SensorLayout.regular(patch, elements, elements)
    return Scene("gages", Plate(patch), layout, transduction=Transduction())


def swept(gages: Gages, radii=RADII):
    """The sensor and its sweep over the cylinders of the procedure."""
    sensor, steps = scene().sensor(), schedule(radii)
    x = np.repeat(np.array([step.curvature for step in steps]), sensor.channels // 3, axis=1)
    readings = np.array([gages.held(each, DWELL) for each in x])
    times = DWELL * (np.arange(len(steps)) + 0.75)
    noise = np.full(readings.shape, NOISE)
    empty = np.empty((0, sensor.channels))
    return sensor, Sweep(steps, readings, noise, times, np.empty(0), empty)


class ManyPlays:
    """Sixty plays with smooth densities of each channel's own, on a bent scale."""

    def __init__(self, channels: int, rng: np.random.Generator, scale: float = 1.0) -> None:
        self.r = np.geomspace(0.5, 45.0, 60)[:, None]
        density = np.exp(-(np.log(self.r / rng.uniform(6, 20, channels)) ** 2))
        self.share = scale * rng.uniform(0.1, 0.25, channels)
        self.weights = density / density.sum(axis=0)
        self.bent, self.side = rng.uniform(100, 250, channels), rng.uniform(0, 0.3, channels)
        self.at = np.zeros((60, channels))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        wider = 1 + self.side * (1 + np.tanh(x / 30))
        u = np.sinh(x / self.bent) * self.bent / wider
        self.at = np.clip(self.at, u - self.r, u + self.r)
        lagging = (self.weights * self.at).sum(axis=0)
        return wider * ((1 - self.share) * u + self.share * lagging)


def off(loops: Callable, seed: int, scale: float = 1.0) -> dict[str, np.ndarray]:
    """Errors of corrected curvature over the standard error told, by path; the told in 1/m."""
    rng = np.random.default_rng(seed)
    gages = Gages(loops, 48, rng, scale)
    sensor, sweep = swept(gages)
    report = calibrate(sweep, sensor, DATE)
    correct, time = report.calibration.start(), 0.0
    for reading, at in zip(sweep.readings, sweep.times, strict=True):
        correct(reading, at)
        time = at + DWELL / 4
    found = {"told": report.error[report.passed]}
    for name, path in paths(rng).items():
        errors = []
        for bent, seconds in path:
            curvature = bent * np.repeat([1.0, 1.0, 0.5], 16)  # a twist gage is bent half as far
            time += seconds
            corrected = correct(gages.held(curvature, seconds), time - seconds / 4)
            errors.append(((corrected - curvature) / report.error)[report.passed])
        found[name] = np.array(errors)
    return found


def sweeps_table(devices: int = 10) -> Iterator[str]:
    """How well calibrations know their own error on other paths, as a table in Markdown."""
    yield "| loops | told, 1/m | path | error / told | within 1 | within 1.96 |"
    yield "|---|---|---|---|---|---|"
    for loops, name in (
        (BoucWen, "Bouc and Wen's"),
        (Preisach, "Preisach's"),
        (ManyPlays, "60 plays"),
    ):
        for scale in (0.3, 1.0):
            found = [off(loops, seed, scale) for seed in range(devices)]
            told = float(np.sqrt(np.mean([np.mean(one["told"] ** 2) for one in found])))
            for path in list(found[0])[1:]:
                errors = np.concatenate([one[path].ravel() for one in found])
                shares = [100 * np.mean(np.abs(errors) < limit) for limit in (1, 1.96)]
                row = (
                    f"| {name}, {scale:g} | {told:.2f} | {path} | {np.sqrt(np.mean(errors**2)):.2f}"
                )
                yield f"{row} | {shares[0]:.0f} % | {shares[1]:.0f} % |"
