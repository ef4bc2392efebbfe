"""Coverage studies: how often the error bars of a contact cover a truth of its own.

`python tests/truths/studies.py` prints all figures as the guide's table; a number of frames and the
beginning of a case's name, both optional, say of how many and which; the name `told` prints what
is told of one load and of two, `drift` what of drifts, `weights` what known weights find,
`beforehand` what is said of errors before there are frames, and of a sigma that is given, `objects`
how objects are named, `effects` what the planner says of effects, `sweeps` how well a calibration
knows its own error.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf, pi, sqrt

import numpy as np

from argyris import ArgyrisPlate
from kappaskin import (
    Cap,
    LeastSquares,
    Patch,
    Plate,
    PointContact,
    PointLoad,
    Robust,
    SensorLayout,
    Simulator,
    SineBasis,
    basis_for,
    estimator_for,
    load_scene,
    predicted_sd,
)
from kappaskin.calibration import WeightFit
from kappaskin.calibration.weights import newtons
from kappaskin.contact import Contacts
from kappaskin.health import HealthMonitor
from kappaskin.mechanics import DiscLoad
from kappaskin.scenes.effects import UniformNoise
from kappaskin.studies import Setting, costs
from koiter import Panel
from navier import HingedPlate, Load
from objects import objects_table
from planned import effects_table
from revolution import RevolvedShell, Spheroid
from sanders import CylinderShell
from sweeps import sweeps_table
from von_karman import StretchingPlate

NOISE = 0.4  # 1/m, uniform to either side as Table 1's: 0.231 rms
REACH = 1.96  # standard deviations to either side in a 95 % interval


@dataclass(frozen=True)
class Figures:
    """Shares of `frames` found, and covered by the intervals of x, y and force.

    `bias` is the mean error of the force as a share of it, `place` the rms error of the position
    over the Cramer-Rao bound, where that was computed.
    """

    frames: int
    found: float
    x: float
    y: float
    force: float
    bias: float
    place: float


@dataclass(frozen=True, eq=False)
class Case:
    """A skin, the truth of what its elements read of a load, and a maker of loads.

    `load` gives the load of a random place (2,) in shares of the sides; `bound` is False where the
    Cramer-Rao bound would take long.
    """

    name: str
    skin: Plate
    truth: Callable[[SensorLayout], Callable[[Load], np.ndarray]]
    load: Callable[[np.ndarray], Load]
    gage_length: float = 0.0
    edge: str = "hinged"
    low: float = 0.2
    high: float = 0.8
    noise: float = NOISE
    bound: bool = True
    elements: tuple[int, int] = (10, 10)

    @property
    def layout(self):
        regular = SensorLayout.regular(self.skin.patch, *self.elements)
        return replace(regular, gage_length=self.gage_length)


def coverage(case, frames, seed=0) -> Figures:
    """The figures of `frames` presses at random places, each with its own noise."""
    rng, layout = np.random.default_rng(seed), case.layout
    read, contact = case.truth(layout), PointContact(case.skin, layout, case.edge)
    fit = LeastSquares(basis_for(case.skin.patch, case.edge, 8, 8), layout)
    loads = [case.load(share) for share in rng.uniform(case.low, case.high, (frames, 2))]
    rows, limits = [], []
    for load in loads:
        curvature = read(load)
        curvature = curvature + rng.uniform(-case.noise, case.noise, curvature.shape)
        found = contact(curvature, fit(curvature))
        error = *(found.position - (load.x, load.y)), found.force - load.force
        rows.append([error, (*found.position_sd, found.force_sd)])
        limits.append(cramer_rao(read, load, case.noise)[:2] if case.bound else (np.nan,) * 2)
    error, sd = np.array(rows).swapaxes(0, 1)
    covered = np.mean(np.abs(error) <= REACH * sd, axis=0)
    there = np.isfinite(error[:, 2])
    bias = np.mean(error[there, 2] / np.array([load.force for load in loads])[there])
    place = sqrt(np.sum(error[there, :2] ** 2) / np.sum(np.array(limits)[there] ** 2))
    return Figures(frames, there.mean(), *covered, bias, place)


def cramer_rao(read, load, noise) -> np.ndarray:
    """Least standard deviations of x, y, force and the load's mean square width, all unknown.

    For Gaussian noise of the variance of a uniform one to `noise` in 1/m either side.
    """
    step = 2e-5
    columns = [
        (read(replace(load, x=load.x + step)) - read(replace(load, x=load.x - step))) / (2 * step),
        (read(replace(load, y=load.y + step)) - read(replace(load, y=load.y - step))) / (2 * step),
        read(load) / load.force,
        _by_width(read, load),
    ]
    J = np.stack([column.ravel() for column in columns], -1)
    scale = np.linalg.norm(J, axis=0)
    covariance = np.linalg.inv((J / scale).T @ (J / scale))
    return noise / sqrt(3) * np.sqrt(np.diag(covariance)) / scale


def _by_width(read, load):
    """The derivative by the square of the radius or of the standard deviation."""
    if load.sd:
        low, high = replace(load, sd=0.98 * load.sd), replace(load, sd=1.02 * load.sd)
        return (read(high) - read(low)) / (high.sd**2 - low.sd**2)
    low, high = replace(load, radius=0.98 * load.radius), replace(load, radius=1.02 * load.radius)
    if not load.radius:
        high = replace(load, radius=2e-4)
    return (read(high) - read(low)) / (high.radius**2 - low.radius**2)


# The flat skin of the paper: 0.1 x 0.1 m, 0.15 N, which press it in by 4.7 mm in the middle


def _flat(gage_length):
    return lambda layout: lambda load: HingedPlate().readings(load, layout.positions, gage_length)


def _flat_case(name, gage_length=0.0, **width):
    def load(share):
        return Load(*(0.1 * share), 0.15, **width)

    return Case(name, Plate(Patch(0.1, 0.1)), _flat(gage_length), load, gage_length)


FLAT = [
    _flat_case("flat, point"),
    _flat_case("flat, disc of 3 mm", radius=3e-3),
    _flat_case("flat, disc of 5 mm", radius=5e-3),
    _flat_case("flat, Gaussian of 2 mm", sd=2e-3),
    _flat_case("flat, Gaussian of 4 mm", sd=4e-3),
    _flat_case("flat, disc of 3 mm, gages of 6 mm", 6e-3, radius=3e-3),
]


@cache
def _shell(arc, length, radius, gage_length):
    shell = CylinderShell(arc, length, radius, polynomials=96, waves=160)
    return cache(lambda elements: shell.reader(np.frombuffer(elements).reshape(-1, 2), gage_length))


def _bent_case(name, arc, length, radius, force):
    skin = Plate(Patch(arc, length, radius))

    def truth(layout):
        return _shell(arc, length, radius, 0.0)(layout.positions.tobytes())

    def load(share):
        return Load(*(share * (arc, length)), force, radius=2e-3)

    return Case(name, skin, truth, load)


BENT = [
    _bent_case("half round, disc of 2 mm", pi * 12.9e-3, 40e-3, 12.9e-3, 2.0),
    _bent_case("bent to 30 mm, disc of 2 mm", 47e-3, 40e-3, 30e-3, 1.0),
]

# Skins that are bent both ways, on their true surface. A dome and a trough go in by less than a
# thickness or two; a saddle, which bends without stretching, by two.


@cache
def _panel(sides, radii, inplane):
    return Panel(*sides, *radii, inplane=inplane, polynomials=36, modes=300)


def _shallow_case(name, sides, radii, force, mm, elements=(10, 10), inplane="diaphragm"):
    def truth(layout):
        return _panel(sides, radii, inplane).reader(layout.positions)

    def load(share):
        return Load(*(share * sides), force, radius=1e-3 * mm)

    skin, name = Plate(Patch(*sides, radii), inplane=inplane), f"{name}, disc of {mm} mm"
    return Case(name, skin, truth, load, bound=False, elements=elements)


_FINGER, _PALM = (0.04, 0.04), (0.1, 0.1)  # sides in m
SHALLOW = [
    *(_shallow_case("dome of 40 mm", _FINGER, (0.1, 0.1), 1.0, mm) for mm in (1, 2, 3)),
    *(_shallow_case("saddle of 40 mm", _FINGER, (0.1, -0.1), 0.12, mm) for mm in (1, 2, 3)),
    _shallow_case("trough of 40 mm", _FINGER, (inf, 0.1), 0.4, 2),
    _shallow_case("dome of 60 x 32 mm", (0.06, 0.032), (0.1, 0.1), 1.0, 2, (15, 8)),
    _shallow_case("dome of 100 mm", _PALM, (0.3, 0.3), 0.5, 2),
    _shallow_case("dome of 100 mm, held", _PALM, (0.3, 0.3), 0.5, 2, inplane="held"),
    _shallow_case("saddle of 100 mm", _PALM, (0.3, -0.3), 0.1, 2),
]


def read_as_flat(case, frames=60, seed=0) -> float:
    """The median share of the force that a contact has on a skin that is taken for a flat one."""
    read, patch = case.truth(case.layout), Patch(case.skin.patch.a, case.skin.patch.b)
    layout = SensorLayout.regular(patch, *case.elements)
    contact, fit = PointContact(Plate(patch), layout), LeastSquares(SineBasis(patch, 8, 8), layout)
    shares = []
    for place in np.random.default_rng(seed).uniform(case.low, case.high, (frames, 2)):
        load = case.load(place)
        shares.append(contact(read(load), fit(read(load))).force / load.force)
    return np.nanmedian(shares)


# A flat skin 0.25 mm thick, which goes in by 0.9 and 1.7 of that in the middle, where it is held


def _stretched_case(name, inplane, force, noise=NOISE):
    plate = StretchingPlate(inplane=inplane, polynomials=30)
    skin = Plate(Patch(0.1, 0.1), thickness=plate.thickness, inplane=inplane)

    def load(share):
        return Load(*(0.1 * share), force, radius=3e-3)

    def truth(layout):
        return lambda load: plate.readings(load, layout.positions)

    return Case(name, skin, truth, load, noise=noise, bound=False)


STRETCHED = [
    _stretched_case("held, 0.9 thicknesses, a quarter of the noise", "held", 0.012, NOISE / 4),
    _stretched_case("held, 1.7 thicknesses", "held", 0.042),
    _stretched_case("diaphragm, 2.1 thicknesses", "diaphragm", 0.042),
    _stretched_case("free, 2.5 thicknesses", "free", 0.042),
]

# Caps of 60 elements, even by area, pressed anywhere from the pole to three quarters of the arc by
# about 100 noises of all readings: by less than a tenth of their thickness


@dataclass(frozen=True, eq=False)
class CapCase(Case):
    """A case on a cap."""

    @property
    def layout(self):
        cap, k = self.skin.patch, np.arange(60)
        s = cap.rim_radius * _even((k + 0.5) / 60, cap.angle) / cap.angle
        azimuth = k * pi * (3 - sqrt(5))
        return SensorLayout.scattered(cap, _on_cap(cap, s, azimuth))


def _even(share, angle):
    """The angle from the pole within which a `share` of a sphere's cap of an `angle` lies."""
    return np.arccos(1 - share * (1 - np.cos(angle)))


def _on_cap(cap, s, azimuth):
    return cap.rim_radius + np.stack([s * np.cos(azimuth), s * np.sin(azimuth)], -1)


def along_x(read, azimuth):
    """Readings (3, P) along the meridian and the parallel as they are along the axes of a cap."""
    (xx, yy, xy), c, s = read, np.cos(azimuth), np.sin(azimuth)
    return np.stack(
        [
            c**2 * xx - 2 * c * s * xy + s**2 * yy,
            s**2 * xx + 2 * c * s * xy + c**2 * yy,
            c * s * (xx - yy) + (c**2 - s**2) * xy,
        ]
    )


def _from_pole(cap, positions):
    """Distances (P,) in m from the pole and azimuths (P,) of `positions` (P, 2)."""
    x, y = (positions - cap.rim_radius).T
    return np.hypot(x, y), np.arctan2(y, x)


def _beside_pole(cap, load):
    return replace(load, x=load.x - cap.rim_radius, y=load.y - cap.rim_radius)


def _revolved(plate, edge):
    cap, thickness = plate.patch, plate.sheet_thickness
    surface = Spheroid(cap.radius, cap.stretch * cap.radius)
    return RevolvedShell(surface, cap.rim_radius, edge=edge, thickness=thickness)


@cache
def _reader(plate, edge):
    shell = _revolved(plate, edge)
    return cache(lambda elements: shell.reader(np.frombuffer(elements).reshape(-1, 2)))


def _cap_case(name, cap, edge, force, thickness=None, **width):
    plate = Plate(cap, thickness=thickness)

    def truth(layout):
        polar = _from_pole(cap, layout.positions)
        read = _reader(plate, edge)(np.stack(polar, -1).tobytes())
        return lambda load: along_x(read(_beside_pole(cap, load)), polar[1])

    def load(share):
        far = cap.rim_radius * _even(share[0], 0.75 * cap.angle) / cap.angle
        return Load(*_on_cap(cap, far, 2 * pi * share[1]), force, **width)

    return CapCase(name, plate, truth, load, edge=edge, low=0, high=1, bound=False)


FINGERTIP, PAD, LONG_FINGER = Cap(8e-3), Cap(20e-3, 0.6), Cap(8e-3, stretch=1.4)
CAPS = [
    _cap_case("fingertip, disc of 1 mm", FINGERTIP, "clamped", 2.1, radius=1e-3),
    _cap_case("fingertip, disc of 2 mm", FINGERTIP, "clamped", 4.4, radius=2e-3),
    _cap_case("fingertip, disc of 3 mm", FINGERTIP, "clamped", 8.7, radius=3e-3),
    _cap_case("fingertip, Gaussian of 1 mm", FINGERTIP, "clamped", 4.4, sd=1e-3),
    _cap_case("shallow cap, disc of 1 mm", PAD, "hinged", 1.0, radius=1e-3),
    _cap_case("shallow cap, disc of 3 mm", PAD, "hinged", 2.6, radius=3e-3),
    _cap_case("spheroid, disc of 2 mm", LONG_FINGER, "clamped", 4.4, radius=2e-3),
]

# Shapes: the bands of the surface, of estimators with functions that end where the truth does not


def shape_coverage(case, method, functions, frames, seed=0) -> tuple[float, float]:
    """Share of 21 x 21 places within the bands of the surface, and its rms error in m.

    By `method` with `functions` each way on the flat skin of `case`.
    """
    rng, layout, patch = np.random.default_rng(seed), case.layout, case.skin.patch
    read = case.truth(layout)
    fit = estimator_for(method, basis_for(patch, "hinged", functions, functions), layout)
    places = np.stack(np.meshgrid(*patch.grid(23, 23)), -1)[1:-1, 1:-1].reshape(-1, 2)
    at, covered, squares = fit.basis.at(places), [], []
    for share in rng.uniform(case.low, case.high, (frames, 2)):
        load = case.load(share)
        found = fit(read(load) + rng.uniform(-case.noise, case.noise, (3, 100)))
        off = at @ found.coefficients.ravel() - HingedPlate().displacement(load, places)
        covered.append(np.mean(np.abs(off) < REACH * found.surface_sd(places)))
        squares.append(np.mean(off**2))
    return np.mean(covered), sqrt(np.mean(squares))


def shapes_on_cap(case, frames, seed=0) -> dict[str, tuple[float, float]]:
    """The same of 150 places on the cap of `case`, by method, in the order of `ON_CAPS`."""
    rng, layout, cap = np.random.default_rng(seed), case.layout, case.skin.patch
    share, azimuth = rng.uniform((0, 0), (0.95, 2 * pi), (150, 2)).T
    polar = np.stack([cap.rim_radius * np.sqrt(share), azimuth], -1)
    read, moved = case.truth(layout), _revolved(case.skin, case.edge).mover(polar)
    loads = [case.load(place) for place in rng.uniform(0, 1, (frames, 2))]
    moves = np.array([moved(_beside_pole(cap, load)) for load in loads])
    noise = rng.uniform(-case.noise, case.noise, (frames, *layout.frame_shape))
    frames_read = np.array([read(load) for load in loads]) + noise
    found = {}
    for method, functions in ON_CAPS.items():
        fit = estimator_for(method, basis_for(cap, case.edge, *functions), layout)
        at, covered, squares = fit.basis.at(_on_cap(cap, *polar.T)), [], []
        for frame, true in zip(frames_read, moves, strict=True):
            fit.restart()
            one = fit(frame)
            off = at @ one.coefficients.ravel() - true
            covered.append(np.mean(np.abs(off) < REACH * one.surface_sd(_on_cap(cap, *polar.T))))
            squares.append(np.mean(off**2))
        found[method] = np.mean(covered), sqrt(np.mean(squares))
    return found


def depths_on_cap(case, frames, seed=0) -> tuple[float, float, float]:
    """Share of the intervals of the depth that hold it, and its mean and rms error as shares.

    Of presses on the cap of `case`, 12 distances from the pole in turn.
    """
    rng, layout, cap = np.random.default_rng(seed), case.layout, case.skin.patch
    read, contact = case.truth(layout), PointContact(case.skin, layout, case.edge)
    fit = LeastSquares(basis_for(cap, case.edge, 8, 8), layout)
    far = cap.rim_radius * _even(rng.uniform(0, 1, 12), 0.75 * cap.angle) / cap.angle
    moved = _revolved(case.skin, case.edge).mover(np.stack([far, np.zeros(12)], -1))
    any_load, off, covered = case.load(np.zeros(2)), [], []
    true = [moved(replace(any_load, x=s, y=0.0))[ring] for ring, s in enumerate(far)]
    for frame in range(frames):
        ring = frame % 12
        x, y = _on_cap(cap, far[ring], 2 * pi * rng.uniform()).tolist()
        curvature = read(replace(any_load, x=x, y=y))
        curvature = curvature + rng.uniform(-case.noise, case.noise, curvature.shape)
        found = contact(curvature, fit(curvature))
        error = found.displacement - true[ring]
        covered.append(abs(error) <= REACH * found.displacement_sd)
        off.append(error / true[ring])
    return np.mean(covered), np.mean(off), sqrt(np.mean(np.square(off)))


ON_CAPS = {"least-squares": (6, 9), "bayes": (8, 15), "tracking": (8, 15)}
# Of the fingertip in the scene, too.
THICK = [
    _cap_case(
        "fingertip of 1 mm, disc of 2.5 mm", Cap(8e-3, 1.309), "clamped", 4.0, 1e-3, radius=2.5e-3
    ),
    _cap_case("shallow cap of 1 mm, disc of 1 mm", PAD, "hinged", 1.0, 1e-3, radius=1e-3),
]
CAP_SHAPES = [*CAPS, *THICK]
SHAPES = [("least-squares", 8), ("robust", 8), ("tracking", 8), ("bayes", 15)]

# So weak that not every press is found, and those that are found are told too hard.
WEAK = _stretched_case("held, 0.9 thicknesses, hardly found", "held", 0.012)

# Bad elements: the error of a shape by `robust`, and of least squares that knows which are bad

GRIDS = [(6, 4), (6, 5), (8, 4), (8, 6), (10, 6), (10, 8), (12, 8)]  # elements and functions a side
SHARES = [0.1, 0.15, 0.2, 0.25]


@dataclass(frozen=True)
class Robustness:
    """Of `frames` the rms errors (T,) in m by `robust`, and by least squares that `knew`.

    `converged` (T,) as the fit has it.
    """

    error: np.ndarray
    knew: np.ndarray
    converged: np.ndarray

    @property
    def broken(self):
        """Frames (T,) that are four times worse than the worst of those that knew."""
        return self.error > 4 * self.knew.max()


def robustness(elements, functions, share, frames, seed=0, equal=True) -> Robustness:
    """Frames of none, one and two loads in turn, with a `share` of bad elements.

    Each is off by 20 to 40 noises, by the same in its three channels where `equal`, and every
    fourth frame all of them the same way then.
    """
    patch, plate, rows = Patch(0.1, 0.1), HingedPlate(), []
    layout = SensorLayout.regular(patch, elements, elements)
    basis = basis_for(patch, "hinged", functions, functions)
    places = np.stack(np.meshgrid(*patch.grid(21, 21)), -1)[1:-1, 1:-1].reshape(-1, 2)
    at, known, robust = basis.at(places), LeastSquares(basis, layout), Robust(basis, layout)
    for frame in range(frames):
        rng = np.random.default_rng([seed, frame, elements, functions, round(100 * share), equal])
        c = sum(plate.coefficients(_anywhere(rng)) for _ in range(frame % 3)) + np.zeros((240, 240))
        K = plate.curvature(c, layout.positions)
        K = K + rng.normal(0, NOISE / sqrt(3), K.shape)
        bad = rng.permutation(elements**2)[: round(share * elements**2)]
        off = rng.uniform(20, 40, (3, len(bad))) * rng.choice([-1, 1], (3, len(bad)))
        if equal:
            off[:] = np.abs(off[0]) if frame % 4 == 3 else off[0]
        without = K.copy()
        without[:, bad] = np.nan
        K[:, bad] += NOISE / sqrt(3) * off
        found, true = robust(K), plate.surface(c, places)
        error, knew = (
            sqrt(np.mean((at @ fit.coefficients.ravel() - true) ** 2))
            for fit in (found, known(without))
        )
        rows.append((error, knew, found.converged))
    error, knew, converged = np.array(rows).T
    return Robustness(error, knew, converged > 0)


def _anywhere(rng):
    return Load(*rng.uniform(0.01, 0.09, 2), rng.uniform(0.03, 0.3), rng.choice([0.0, 3e-3]))


# Healthy elements under small contacts, which the health monitor is not to accuse

MONITORED = 64.0  # frames/s


def accused(frames, seed=0) -> int:
    """In how many of so many `frames` the health monitor accuses any channel of a healthy sensor.

    Discs of 1 to 10 mm are pressed for 3 s each, anywhere farther than 5 mm from the edge.
    """
    scene, plate = load_scene("centre"), HingedPlate()
    sensor = scene.sensor()
    chain, monitor, rng = sensor.transduction, HealthMonitor(sensor), np.random.default_rng(seed)
    scan, rest = sensor.scan(), float(chain.curvature(np.zeros(1, np.int32))[0])
    blank = Simulator(replace(scene, stimuli=())).scanned(scan, 0, 0.0, lambda: 0.0)
    count, per = 0, round(3 * MONITORED)
    for n in range(frames):
        if n % per == 0:
            load = Load(*rng.uniform(5e-3, 95e-3, 2), rng.uniform(0.02, 0.3))
            load = replace(load, radius=rng.uniform(0.5e-3, 5e-3))
            pressed = plate.readings(load, sensor.layout.positions)
        share = np.clip(min(n % per, per - 20 - n % per) / 20, 0, 1)
        K = share * pressed + rng.normal(0, NOISE / sqrt(3), pressed.shape)
        counts = np.clip(np.rint((K.ravel() - rest) / chain.resolution), *chain.limits)
        counts = counts.astype(blank.counts.dtype)
        time = n / MONITORED
        monitor(replace(blank, sequence=n, counts=counts, device_time=time, host_time=time))
        count += bool(monitor.kinds.any())
    return count


CASES: Sequence[Case] = (*FLAT, *BENT, *SHALLOW, *CAPS, *STRETCHED, WEAK)


def table(frames=1000, name=""):
    """The figures of the cases whose names begin as `name`, as a table in Markdown."""
    yield "| skin and load | frames | found | x | y | force | bias of force | place / bound |"
    yield "|---|---|---|---|---|---|---|---|"
    for case in (case for case in CASES if case.name.startswith(name)):
        f = coverage(case, frames)
        shares = " | ".join(f"{100 * share:.1f} %" for share in (f.found, f.x, f.y, f.force))
        place = f"{f.place:.2f}" if case.bound else ""
        yield f"| {case.name} | {frames} | {shares} | {100 * f.bias:+.2f} % | {place} |"


def shape_table(frames=200):
    """What the bands of the surface cover of the flat cases, as a table in Markdown."""
    yield "| load | method | frames | surface | rms error |"
    yield "|---|---|---|---|---|"
    for case in FLAT[:3]:
        for method, functions in SHAPES:
            covered, rms = shape_coverage(case, method, functions, frames)
            name = f"{case.name} | {method}, {functions} x {functions} | {frames}"
            yield f"| {name} | {100 * covered:.1f} % | {1e3 * rms:.4f} mm |"


def robust_table(frames=72):
    """Errors by `robust` over those that knew the bad elements, as a table in Markdown."""
    yield "| bad elements | frames | median | worst | broken down | of these converged | flagged |"
    yield "|---|---|---|---|---|---|---|"
    for share in SHARES:
        for equal in (True, False):
            found = [robustness(*grid, share, frames, equal=equal) for grid in GRIDS]
            broken = np.concatenate([of.broken for of in found])
            converged = np.concatenate([of.converged for of in found])
            median = max(np.median(of.error) / np.median(of.knew) for of in found)
            worst = max(of.error.max() / of.knew.max() for of in found)
            kind = "equal in the channels" if equal else "independent"
            row = f"| {100 * share:.0f} %, {kind} | {broken.size} | {median:.2f} | {worst:.2f} | "
            lost = broken.sum(), (broken & converged).sum(), (~converged).sum()
            yield row + " | ".join(map(str, lost)) + " |"


# What is told of one load, of two, and of lines, on the flat skin, of 0.15 N in all


@dataclass(frozen=True)
class Told:
    """Shares of frames in which two contacts were told, and one was called single.

    `covered` (3,) are those of the intervals of x, y and force of both, where two were told of two.
    """

    two: float
    single: float
    covered: np.ndarray


@dataclass(frozen=True, eq=False)
class Press:
    """Loads that `made` draws at random, by their name."""

    name: str
    made: Callable[[np.random.Generator], Sequence[Load]]


def told(press, frames, seed=0) -> Told:
    """What is told of `frames` presses at random places, each with its own noise."""
    case, plate = FLAT[0], HingedPlate()
    rng, layout = np.random.default_rng(seed), case.layout
    contacts = Contacts(case.skin, layout)
    fit = LeastSquares(basis_for(case.skin.patch, "hinged", 8, 8), layout)
    two, single, covered = 0, 0, [np.empty((0, 3), bool)]
    for _ in range(frames):
        loads = press.made(rng)
        exact = plate.curvature(sum(map(plate.coefficients, loads)), layout.positions)
        curvature = exact + rng.uniform(-case.noise, case.noise, (3, 100))
        both = contacts(curvature, fit(curvature))
        single += both[0].single
        two += both[1].present
        if both[1].present and len(loads) == 2:
            covered.append(_covered(both, loads))
    of_both = np.concatenate(covered)
    shares = of_both.mean(axis=0) if len(of_both) else np.full(3, np.nan)
    return Told(two / frames, single / frames, shares)


def _covered(contacts, loads):
    """Whether the intervals (2, 3) of x, y and force cover those of the nearer order of loads."""
    found = np.array([(*one.position, one.force) for one in contacts])
    sd = np.array([(*one.position_sd, one.force_sd) for one in contacts])
    true = np.array([(load.x, load.y, load.force) for load in loads])
    off = min(found - true, found - true[::-1], key=lambda off: np.hypot(*off[:, :2].T).sum())
    return np.abs(off) <= REACH * sd


def _single(**widths):
    def made(rng):
        wide = {name: rng.uniform(*within) for name, within in widths.items()}
        return [Load(*rng.uniform(0.02, 0.08, 2), 0.15, **wide)]

    return made


def _along(length, points=40):
    """Points along a line, which press as one."""

    def made(rng):
        middle, turn = rng.uniform(0.03, 0.07, 2), rng.uniform(0, pi)
        half = length / 2 * np.array([np.cos(turn), np.sin(turn)])
        shares = (np.arange(points) + 0.5) / points * 2 - 1
        return [Load(*(middle + share * half), 0.15 / points) for share in shares]

    return made


def _apart(distance, ratio):
    """Two discs of up to 4 mm radius, the weaker of `ratio` times the force of the other."""

    def made(rng):
        while True:
            first, turn = rng.uniform(0.02, 0.08, 2), rng.uniform(0, 2 * pi)
            second = first + distance * np.array([np.cos(turn), np.sin(turn)])
            if ((second > 0.02) & (second < 0.08)).all():
                break
        force, widths = 0.15 / (1 + ratio), rng.uniform(0, 4e-3, 2)
        return [
            Load(*first, force, radius=widths[0]),
            Load(*second, ratio * force, radius=widths[1]),
        ]

    return made


SINGLE = [
    Press("one point", _single()),
    Press("one disc of 1 to 10 mm", _single(radius=(1e-3, 10e-3))),
    Press("one Gaussian of 1 to 5 mm", _single(sd=(1e-3, 5e-3))),
]
LINES = [Press(f"a line of {1e3 * n:.0f} mm", _along(n)) for n in (0.01, 0.02, 0.03, 0.04)]
TWO = [
    Press(f"two, {1e3 * d:.0f} mm apart, forces as 1 to {q:g}", _apart(d, q))
    for d in (0.01, 0.015, 0.02, 0.03, 0.04)
    for q in (1, 0.3, 0.1)
]


def told_table(frames=1000):
    """What is told of one load, of lines and of two, as a table in Markdown."""
    yield "| load | frames | told as two | single | x | y | force |"
    yield "|---|---|---|---|---|---|---|"
    for press in (*SINGLE, *LINES, *TWO):
        of = told(press, frames)
        shares = [of.two, of.single, *of.covered]
        words = " | ".join(f"{100 * share:.1f} %" if share == share else "" for share in shares)
        yield f"| {press.name} | {frames} | {words} |"


# Drifts of all readings, beside a load of 0.06 N and alone


@dataclass(frozen=True)
class Drifted:
    """Shares of frames in which a drift was told, and a contact: of no load, and of one.

    `size` is the mean size told over the true one; `covered` (3,) the shares of intervals of x, y
    and force that hold the truth, in frames with a load, and `surface` the share of the surface
    that its 95 % bands hold, in frames without one (False) and with one (True).
    """

    told: tuple[float, float]
    present: tuple[float, float]
    size: float
    covered: np.ndarray
    surface: tuple[float, float]


def drifted(noises, frames, seed=0) -> Drifted:
    """Drifts of so many noises by RMS, level and slopes drawn for each frame, on the flat skin."""
    case = FLAT[0]
    rng, layout = np.random.default_rng(seed), case.layout
    read, contacts = case.truth(layout), Contacts(case.skin, layout)
    plate = HingedPlate()
    fit = LeastSquares(basis_for(case.skin.patch, "hinged", 8, 8), layout)
    x, y = (layout.positions - 0.05).T / 0.05
    size = noises * case.noise / sqrt(3)
    told, present, sizes, covered, surface = [0, 0], [0, 0], [], [], ([], [])
    places = np.stack(np.meshgrid(*case.skin.patch.grid(11, 11)), -1)[1:-1, 1:-1].reshape(-1, 2)
    for frame in range(2 * frames):
        level, along, across = rng.normal(size=(3, 3, 1))
        field = level + along * x + across * y
        curvature = size * field / np.sqrt(np.mean(field**2))
        curvature = curvature + rng.uniform(-case.noise, case.noise, (3, 100))
        load = Load(*rng.uniform(0.02, 0.08, 2), 0.06, radius=rng.uniform(0, 5e-3))
        loaded = frame % 2
        curvature = curvature + loaded * read(load)
        shape = fit(curvature)
        contact, drift = contacts(curvature, shape)[0], contacts.drift
        shape = drift.fit if drift else shape
        told[loaded] += drift is not None
        present[loaded] += contact.present
        sizes.append(drift.size / size if drift and size else 0.0)
        true = loaded * plate.displacement(load, places)
        off = shape.estimator.basis.at(places) @ shape.coefficients.ravel() - true
        surface[loaded].append(np.mean(np.abs(off) <= REACH * shape.surface_sd(places)))
        if loaded and contact.present:
            off = np.array([*(contact.position - (load.x, load.y)), contact.force - load.force])
            covered.append(np.abs(off) <= (*contact.position_95, contact.force_95))
    shares = (tuple(count / frames for count in counts) for counts in (told, present))
    held = tuple(float(np.mean(shares)) for shares in surface)
    return Drifted(*shares, float(np.mean(sizes)), np.mean(covered, axis=0), held)


DRIFTS = (0, 1, 2, 3, 4, 6)


def drift_table(frames=1000):
    """What is told of drifts, as a table in Markdown."""
    heads = "told as drift, no load | false contacts | told as drift, 0.06 N | contact found"
    heads += " | size told | x | y | force | surface, no load | surface, 0.06 N"
    yield f"| drift, in noises | {heads} |"
    yield "|---|---|---|---|---|---|---|---|---|---|---|"
    for noises in DRIFTS:
        of = drifted(noises, frames)
        shares = (
            of.told[0],
            of.present[0],
            of.told[1],
            of.present[1],
            of.size,
            *of.covered,
            *of.surface,
        )
        yield f"| {noises} | " + " | ".join(f"{100 * share:.1f} %" for share in shares) + " |"


WEIGHED = 1.37 * 3.7e-3  # N m, of skins whose sensor tells 3.7e-3
SCATTER = 0.01  # of each weight
_PLACES = ((0.05, 0.05), (0.03, 0.04), (0.07, 0.06), (0.035, 0.07), (0.06, 0.03), (0.05, 0.065))


def weighed(skin, masses, rng, **size):
    """Readings (n, 3, P) in 1/m under weights of `masses` in g, each the mean of a second."""
    at = load_scene("centre").sensor().layout.positions
    loads = zip(_PLACES, newtons(masses), strict=True)
    truth = [skin.readings(Load(*place, force, **size), at) for place, force in loads]
    return np.array(truth) + rng.normal(0, 0.0231, (len(masses), 3, len(at)))


def weights_table(frames=1000):
    """What known weights find, as a table in Markdown; `frames` / 25 draws of a skin."""
    hinged = HingedPlate(rigidity=WEIGHED)
    held = StretchingPlate(rigidity=WEIGHED, thickness=0.6e-3)
    springs = (ArgyrisPlate(rigidity=WEIGHED, edge="springs", springs=k) for k in (500.0, 20e3))
    flat, light, heavy = (5, 10, 20, 10, 20, 5), (2, 5, 10, 4, 8, 12), (2, 5, 20, 4, 15, 30)
    skins = (
        ("Navier's, hinged", "hinged", hinged, flat),
        ("von Kármán's, 0.6 mm, to 12 g", "hinged", held, light),
        ("the same, to 30 g", "hinged", held, heavy),
        *(
            (f"Argyris', on springs of {skin.springs:g} N/m²", "elastic", skin, flat)
            for skin in springs
        ),
    )
    yield "| skin | rigidity, mean | scatter | covered | wrong weight named | right one refused |"
    yield "|---|---|---|---|---|---|"
    for name, edge, skin, masses in skins:
        rng = np.random.default_rng(27)
        fit = WeightFit(replace(load_scene("centre").sensor(), edge=edge))
        size = {"sd": 3e-3} if edge == "elastic" else {"radius": 4e-3}
        share, within, named, refused = [], [], [], []
        for draw in range(frames // 25):
            read, wrong = weighed(skin, masses, rng, **size), draw % len(masses)
            weights = np.array(newtons(masses)) * rng.normal(1, SCATTER, len(masses))
            known = fit(weights.tolist(), list(read))
            share.append(known.rigidity / WEIGHED)
            within.append(abs(known.rigidity - WEIGHED) < REACH * known.rigidity_sd)
            refused.append(not known.passed)
            weights[wrong] *= 1.2
            known = fit(weights.tolist(), list(read))
            named.append(not known.passed and np.argmax(np.abs(known.left_out)) == wrong)
        shares = " | ".join(f"{100 * np.mean(each):.0f} %" for each in (within, named, refused))
        yield f"| {name} | {np.mean(share):.3f} | {np.std(share):.3f} | {shares} |"


# What is said beforehand: how estimates scatter, what error a setting has, and a given sigma

PATCH = Patch(0.1, 0.1)
_NAVIER = HingedPlate()
_SEEN = np.stack(np.meshgrid(*2 * [np.linspace(0.005, 0.095, 19)]), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class Planned:
    """A skin of m x m `elements`, `dead` of them, that `bayes` fits functions x functions to.

    `noise` in 1/m RMS, `force` in N.
    """

    functions: int = 15
    elements: int = 10
    dead: int = 0
    noise: float = NOISE / sqrt(3)
    force: float = 0.15

    def __str__(self):
        dead = f", {self.dead} dead" if self.dead else ""
        return (
            f"{self.functions} x {self.functions} functions, {self.elements} x {self.elements} "
            f"elements{dead}, noise {self.noise:.3g} 1/m, {self.force:g} N"
        )


PLANNED = [
    Planned(),
    Planned(functions=8),
    Planned(noise=0.02),
    Planned(noise=0.6),
    Planned(dead=15),
    Planned(elements=6),
    Planned(force=0.02),
    Planned(force=0.005),
]
_WIDTHS = ({}, {"radius": (1e-3, 5e-3)}, {"sd": (1e-3, 4e-3)})


def _somewhere(rng, number, force):
    """A point, a disc or a Gaussian in turn, from 0.2 to 0.8 of each side."""
    width = {name: rng.uniform(*within) for name, within in _WIDTHS[number % 3].items()}
    return Load(*rng.uniform(0.02, 0.08, 2), force, **width)


def scatter(planned, frames, presses=9, seed=0) -> tuple[np.ndarray, float]:
    """Scatter predicted of `bayes` over that of `frames` frames, over the skin, of each press.

    And its error bars over its errors, by RMS over the skin and all presses.
    """
    rng, m = np.random.default_rng(seed), planned.elements
    live = np.ones((3, m * m), bool)
    live[:, rng.permutation(m * m)[: planned.dead]] = False
    layout = replace(SensorLayout.regular(PATCH, m, m), live=live)
    basis = basis_for(PATCH, "hinged", planned.functions, planned.functions)
    fit, rows = estimator_for("bayes", basis, layout), basis.at(_SEEN)
    ratios, bars, errors = [], [], []
    for number in range(presses):
        c = _NAVIER.coefficients(_somewhere(rng, number, planned.force))
        exact = _NAVIER.curvature(c, layout.positions)
        noise = sqrt(3) * planned.noise * rng.uniform(-1, 1, (frames, *exact.shape))
        found = fit(np.where(live, exact + noise, np.nan))
        w = found.coefficients.reshape(frames, -1) @ rows.T
        predicted = predicted_sd(fit, planned.noise, _SEEN, np.where(live, exact, np.nan))
        ratios.append(np.linalg.norm(predicted) / np.linalg.norm(w.std(axis=0, ddof=1)))
        bars.append(np.mean(found.surface_sd(_SEEN) ** 2))
        errors.append(np.mean((w - _NAVIER.surface(c, _SEEN)) ** 2))
    return np.array(ratios), sqrt(np.mean(bars) / np.mean(errors))


SMALL = [  # radius of a disc in m, force in N, noise in 1/m RMS
    (0.0, 0.15, NOISE / sqrt(3)),
    (1e-3, 0.15, NOISE / sqrt(3)),
    (3e-3, 0.15, NOISE / sqrt(3)),
    (1e-3, 0.005, NOISE / sqrt(3)),
    (1e-3, 0.15, 0.03),
    (3e-3, 0.15, 0.03),
]
SETTINGS = [
    Setting("least-squares", (8, 8), (10, 10)),
    Setting("bayes", (12, 12), (10, 10)),
    Setting("least-squares", (12, 12), (16, 16)),
]


def promised(setting, radius, force, noise, frames, places=8, seed=0) -> np.ndarray:
    """RMS errors that `cost` gives over those of the truth, (2,): without noise, and with it.

    Means over presses at random places, by `frames` frames in all.
    """
    rng, scene = np.random.default_rng(seed), load_scene("centre")
    (m, n), functions = setting.elements, setting.functions
    layout = SensorLayout.regular(PATCH, m, n)
    basis = basis_for(PATCH, "hinged", *functions)
    fit = estimator_for(setting.method, basis, layout)
    grid = np.stack(np.meshgrid(*2 * [np.linspace(0, 0.1, 41)]), axis=-1).reshape(-1, 2)
    on_grid, said, true = basis.at(grid), [], []
    for number, (x, y) in enumerate(rng.uniform(0.02, 0.08, (places, 2))):
        disc = DiscLoad(x, y, radius, force) if radius else PointLoad(x, y, force)
        pressed = replace(
            scene.touched_by(disc), effects=(UniformNoise(noise),), seed=seed + number
        )
        (cost,) = costs(pressed, [setting])
        said.append((cost.errors.rms_exact, cost.errors.rms))
        c = _NAVIER.coefficients(Load(x, y, force, radius=radius))
        exact, w = _NAVIER.curvature(c, layout.positions), _NAVIER.surface(c, grid)
        spread = sqrt(3) * noise * rng.uniform(-1, 1, (frames // places, *exact.shape))
        read = np.concatenate([exact[None], exact + spread])
        off = fit(read).coefficients.reshape(len(read), -1) @ on_grid.T - w
        rms = np.sqrt(np.mean(off**2, axis=1))
        true.append((rms[0], rms[1:].mean()))
    return np.mean(said, axis=0) / np.mean(true, axis=0)


SIGMA_FITS = [("least-squares", 8), ("bayes", 15), ("least-squares", 6), ("robust", 8)]


def sigma_said(method, functions, told, frames, seed=0) -> tuple[float, float]:
    """Shares of frames, and of recordings of 50, that say a sigma of `told` times the noise is off.

    Each frame of its own press; the recordings are of one press each.
    """
    rng, layout = np.random.default_rng(seed), SensorLayout.regular(PATCH, 10, 10)
    basis = basis_for(PATCH, "hinged", functions, functions)
    fit = estimator_for(method, basis, layout, told * NOISE / sqrt(3))

    def said(count, number):
        exact = _NAVIER.readings(_somewhere(rng, number, 0.15), layout.positions)
        noise = rng.uniform(-NOISE, NOISE, (count, 3, 100))
        return fit((exact + noise)[0] if count == 1 else exact + noise).sigma_ratio != 1

    recordings = max(frames // 50, 3)
    return (
        float(np.mean([said(1, number) for number in range(frames)])),
        float(np.mean([said(50, number) for number in range(recordings)])),
    )


def beforehand_table(frames=1000):
    """What is said beforehand over what comes, as three tables in Markdown."""
    yield "| bayes | scatter predicted / that of frames | from | to | error bars / errors |"
    yield "|---|---|---|---|---|"
    for planned in PLANNED:
        ratios, bars = scatter(planned, frames)
        share = f"{ratios.mean():.2f} | {ratios.min():.2f} | {ratios.max():.2f} | {bars:.2f}"
        yield f"| {planned} | {share} |"
    yield ""
    yield "| load | setting | RMS promised / true, without noise | with noise |"
    yield "|---|---|---|---|"
    for radius, force, noise in SMALL:
        for one in SETTINGS:
            exact, noisy = promised(one, radius, force, noise, frames)
            what = f"disc of {1e3 * radius:g} mm" if radius else "point"
            (N, _), (m, _) = one.functions, one.elements
            how = f"{one.method}, {N} x {N} functions, {m} x {m} elements"
            yield f"| {what}, {force:g} N, {noise:.3g} 1/m | {how} | {exact:.2f} | {noisy:.2f} |"
    yield ""
    yield "| estimator | sigma given / noise | frames that say so | recordings that say so |"
    yield "|---|---|---|---|"
    for method, functions in SIGMA_FITS:
        for off in (0.5, 1.0, 2.0):
            each, all_of = sigma_said(method, functions, off, frames)
            name = f"{method}, {functions} x {functions}"
            yield f"| {name} | {off:g} | {100 * each:.1f} % | {100 * all_of:.1f} % |"


def main(frames="1000", *name):
    tables = {
        ("told",): told_table,
        ("drift",): drift_table,
        ("weights",): weights_table,
        ("beforehand",): beforehand_table,
        ("objects",): objects_table,
        ("effects",): effects_table,
        ("sweeps",): sweeps_table,
    }
    if name in tables:
        for row in tables[name](int(frames)):
            print(row, flush=True)
        return
    for row in table(int(frames), " ".join(name)):
        print(row, flush=True)
    if not name:
        print()
        for row in shape_table(int(frames)):
            print(row, flush=True)
        print()
        for row in robust_table(int(frames) * 72 // 1000):
            print(row, flush=True)
        print(f"accused under a small contact: {accused(10 * int(frames))} of {10 * int(frames)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
