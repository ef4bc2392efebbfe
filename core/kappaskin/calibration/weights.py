"""Known weights: the stiffness of a skin from weights that were laid on it."""

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
import scipy

from kappaskin.bases import basis_for
from kappaskin.calibration.calibration import FEWEST_WEIGHTS, GRAVITY, Calibration, KnownWeights
from kappaskin.calibration.sweep import LONGEST, DeviceReadings, Prompt, Report, recorded
from kappaskin.contact import PointContact
from kappaskin.errors import Refusal
from kappaskin.estimation import LeastSquares
from kappaskin.frames import Array, Contact
from kappaskin.mechanics import DiscLoad, Plate, PointLoad
from kappaskin.scenes import Scene, load_scene
from kappaskin.sensing import Sensor
from kappaskin.sources import SimulatedSource, Source, VirtualClock, open_source

_ABSURD = 100.0  # times: no sensor states a rigidity as wrong as that
_SCATTER = 0.01  # of a weight: what it is off by besides the noise, at least
_LIGHTEST, _HEAVIEST = 1e-4, 1e3  # N
_APART = 0.05  # of the shorter side: weights nearer to each other lie at one place
_FUNCTIONS = 8  # along each side, of the shape that tells the noise
_THIN = np.geomspace(8e-3, 5e-5, 14)  # m: thicknesses that are tried
_GIVES = np.geomspace(1e-1, 1e5, 13)  # stiffnesses of a rim that are tried, in D / a^3
_NEAR = np.array([0.7, 0.85, 1.0, 1.2, 1.4])  # of a number found: those tried next
_FINE = 0.125  # of the steps between them: those searched first
_CHANCE = 0.01  # of fitting another number than D where there is none


def newtons(masses: Sequence[float]) -> tuple[float, ...]:
    """The weights in N of `masses` in g, at least three, of which none is absurd."""
    found = tuple(mass * 1e-3 * GRAVITY for mass in masses)
    if len(found) < FEWEST_WEIGHTS:
        raise Refusal(
            f"expected at least {FEWEST_WEIGHTS} weights, at several places, to tell one that is "
            f"wrong; got {len(found)}"
        )
    for mass, weight in zip(masses, found, strict=True):
        if not _LIGHTEST <= weight <= _HEAVIEST:
            raise Refusal(
                f"expected masses in grams, from {1e3 * _LIGHTEST / GRAVITY:.2g} to "
                f"{1e3 * _HEAVIEST / GRAVITY:.3g} g, got {mass:g}"
            )
    return found


class WeightFit:
    """Finds the skin that tells known weights right, from what the elements read under each."""

    def __init__(self, sensor: Sensor, edge: str = "") -> None:
        self.sensor, self.edge = sensor, edge or sensor.edge
        if not sensor.plate.rigidity:
            raise Refusal(
                "expected a skin with some rigidity; known weights do not determine a drum head: "
                "measure its tension"
            )
        patch = sensor.layout.patch
        spare = int(np.sum(sensor.layout.live)) // 2  # readings for as many functions
        along = min(_FUNCTIONS, spare if patch.strip else math.isqrt(spare))
        basis = basis_for(patch, self.edge, along, 1 if patch.strip else along)
        self._shape = LeastSquares(basis, sensor.layout, sensor.sigma)
        self._side = patch.a if patch.strip else min(patch.a, patch.b)
        self._usual = self._contact_of(sensor.plate)

    def _contact_of(self, plate: Plate) -> PointContact:
        return PointContact(plate, self.sensor.layout, self.edge, self.sensor.sigma)

    def contact(self, readings: Array) -> Contact:
        """The contact of a weight's `readings`, by the frame's shape; a `Refusal` without one.

        They are means over some time, less those of the skin without it.
        """
        if np.isfinite(readings).sum() < self.sensor.layout.live.sum() / 2:
            raise Refusal("over half of the readings are missing: take a lighter weight")
        contact = self._usual(readings, self._shape(readings))
        if not contact.present:
            raise Refusal("no contact was found: lay the weight on the skin, or take a heavier one")
        if contact.near_rim:
            raise Refusal("the weight is too near the edge; lay it further inside")
        if not contact.force > 0:
            raise Refusal(
                "the skin seems to bend outward: take the first reading without any weight; on an "
                "arc, lay the weight nearer to the middle"
            )
        return contact

    def __call__(self, weights: Sequence[float], readings: Sequence[Array]) -> KnownWeights:
        """The fit to `weights` (n,) in N, n >= 3, by their `readings` in the shape of frames."""
        W = np.array(weights, float)
        if len(W) < FEWEST_WEIGHTS or len(readings) != len(W):
            raise Refusal(
                f"expected at least {FEWEST_WEIGHTS} weights with their readings, got {len(W)} and "
                f"{len(readings)}"
            )
        contacts = [self.contact(each) for each in readings]
        self.check_places(contacts)
        told = np.array([one.force for one in contacts])
        sd = np.hypot(_SCATTER, np.array([one.force_sd for one in contacts]) / told)
        curve, second = self._choice(W, sd, readings, told)
        best = curve.fitted(W, sd)
        left_out = [
            curve.fitted(np.delete(W, n), np.delete(sd, n), skip=n).told(n) / W[n] - 1
            for n in range(len(W))
        ]
        plate = self.sensor.plate
        found = plate if second is None else second(best.u)
        spare = len(W) - (1 if second is None else 2)
        elastic = second is not None and self.edge == "elastic"
        return KnownWeights(
            rigidity=best.ratio * plate.rigidity,
            rigidity_sd=best.ratio_sd * math.sqrt(max(best.chi2 / spare, 1.0)) * plate.rigidity,
            thickness=found.thickness or 0.0,
            rim_stiffness=best.ratio * found.rim_stiffness if elastic else 0.0,
            weights=tuple(W.tolist()),
            told=tuple(best.told(n) for n in range(len(W))),
            left_out=tuple(float(each) for each in left_out),
            deepest=max(one.displacement for one in contacts),
        )

    def _choice(
        self, weights: Array, sd: Array, readings: Sequence[Array], told: Array
    ) -> tuple["_Curve", Callable[[float], Plate] | None]:
        """The forces told by D alone, or by D and a second number.

        How far an elastic edge gives is never known; stiffening must show itself in an F test.
        """
        usual, spare = _Curve.constant(told), len(weights) - 2
        curve, second = self._second(readings) if spare > 1 else (None, None)
        if curve is None or second is None:
            return usual, None
        near = np.clip(curve.fitted(weights, sd).u * _NEAR, curve.least, curve.u[-1])
        curve = curve.with_more(self._curve(readings, near, second))
        if self.edge == "elastic":
            return curve, second
        chi2, better = (each.fitted(weights, sd).chi2 for each in (usual, curve))
        by_chance = scipy.special.fdtri(1, spare, 1 - _CHANCE) * better / spare
        if chi2 - better <= max(by_chance, scipy.special.chdtri(1, _CHANCE)):
            return usual, None
        return curve, second

    def check_places(self, contacts: Sequence[Contact]) -> None:
        """Refuse contacts that all lie at one place."""
        places = np.array([one.position for one in contacts])
        if np.hypot(*np.ptp(places, axis=0)) < _APART * self._side:
            raise Refusal(
                "all weights lay at one place: lay this one elsewhere, nearer to the edge, so that "
                "a boundary condition that is wrong shows"
            )

    def _second(
        self, readings: Sequence[Array]
    ) -> tuple["_Curve | None", Callable[[float], Plate] | None]:
        """The forces told for a second number besides D, and the skin that has it.

        The membrane's stiffness, as 1 / h^2, of a flat rectangle; or the give of an elastic edge.
        """
        plate = self.sensor.plate
        if self.edge == "elastic":

            def springs(u: float) -> Plate:
                return replace(plate, rim_stiffness=u)

            return self._curve(readings, _GIVES * plate.rigidity / self._side**3, springs), springs
        if not replace(plate, thickness=1e-3).stretches:
            return None, None

        def sheet(u: float) -> Plate:
            return replace(plate, thickness=1 / math.sqrt(u) if u else None)

        return self._curve(readings, np.append(0.0, 1 / _THIN**2), sheet), sheet

    def _curve(
        self, readings: Sequence[Array], us: Array, skin: Callable[[float], Plate]
    ) -> "_Curve":
        fits = [self._shape(each) for each in readings]
        force = [
            [contact(each, fit).force for each, fit in zip(readings, fits, strict=True)]
            for contact in (self._contact_of(skin(u)) for u in us.tolist())
        ]
        return _Curve(us, np.array(force))


@dataclass(frozen=True, slots=True, eq=False)
class _Fitted:
    """The best `ratio` of forces told and second number `u`, and chi-squared."""

    curve: "_Curve"
    ratio: float
    ratio_sd: float
    u: float
    chi2: float

    def told(self, n: int) -> float:
        """What weight `n` is told as, in N."""
        return self.ratio * float(self.curve.at(self.u)[n])


@dataclass(frozen=True, slots=True, eq=False)
class _Curve:
    """Forces told (U, n) in N for the numbers `u` (U,), smooth between them."""

    u: Array
    force: Array

    def with_more(self, other: "_Curve") -> "_Curve":
        """The forces of both, each number once."""
        u, first = np.unique(np.concatenate([self.u, other.u]), return_index=True)
        return _Curve(u, np.vstack([self.force, other.force])[first])

    @property
    def least(self) -> float:
        """The least number above zero."""
        return float(self.u[self.u > 0][0])

    @staticmethod
    def constant(force: Array) -> "_Curve":
        return _Curve(np.zeros(1), force[None])

    def at(self, u: float) -> Array:
        """Forces (n,) for `u`."""
        if len(self.u) == 1:
            return self.force[0]
        return np.asarray(scipy.interpolate.PchipInterpolator(self.u, self.force)(u), float)

    def fitted(self, weights: Array, sd: Array, skip: int | None = None) -> _Fitted:
        """The fit to `weights` (n,) in N with relative errors `sd` (n,), without weight `skip`."""

        def solved(u: float) -> tuple[float, float]:
            force = self.at(u) if skip is None else np.delete(self.at(u), skip)
            if not np.isfinite(force).all():
                return math.nan, math.inf
            row = force / (weights * sd)
            ratio = float(row @ (1 / sd)) / float(row @ row)
            return ratio, float(np.sum((ratio * row - 1 / sd) ** 2))

        u = float(self.u[0])
        if len(self.u) > 1:
            tried = np.interp(
                np.arange(0, len(self.u) - 1 + _FINE, _FINE), range(len(self.u)), self.u
            )
            near = int(np.argmin([solved(each)[1] for each in tried.tolist()]))
            low, high = float(tried[max(near - 1, 0)]), float(tried[min(near + 1, len(tried) - 1)])
            u = float(scipy.optimize.minimize_scalar(
                lambda each: solved(each)[1], bounds=(low, high), method="bounded"
            ).x)  # fmt: skip
        ratio, chi2 = solved(u)
        rows = [self.at(u)]
        if len(self.u) > 1:
            step = 1e-3 * u or float(self.u[1]) * 1e-3
            rows.append(ratio * (self.at(u + step) - self.at(u)))
        kept = [row if skip is None else np.delete(row, skip) for row in rows]
        slopes = np.array(kept) / (weights * sd)
        variance = float(np.linalg.pinv(slopes @ slopes.T)[0, 0])
        return _Fitted(self, ratio, math.sqrt(variance), u, chi2)


WEIGHT_ADVICE = (
    "Lay the weights on one after the other, each on a small foot (a few millimetres) at another "
    "place, some nearer to the edge; take all off first."
)
_PLACES = ((0.5, 0.5), (0.32, 0.4), (0.66, 0.6), (0.4, 0.68), (0.6, 0.3))  # of a simulation's sides
_FOOT = 0.03  # of the shorter side: radius of a simulated weight's foot


class Weighing:
    """The steps of known weights: the skin without one, then with each of `masses` in g.

    `taken` are the readings so far, by the frame's shape, and `contacts` those of the weights.
    """

    def __init__(self, sensor: Sensor, masses: Sequence[float], edge: str = "") -> None:
        self.masses, self.weights = tuple(masses), newtons(masses)
        self.fit = WeightFit(sensor, edge)
        self.contacts: list[Contact] = []
        self.taken: list[Array] = []

    @property
    def step(self) -> int:
        """The number of the present step: 0 is the skin without a weight."""
        return len(self.taken)

    @property
    def done(self) -> bool:
        return self.step > len(self.weights)

    @property
    def what(self) -> str:
        """What to do in the present step."""
        if self.step:
            return f"lay {self.masses[self.step - 1]:g} g on the skin"
        return "take everything off the skin"

    def take(self, readings: Array) -> str:
        """Take the `readings` (n, C) in 1/m of the present step's frames; says what they show.

        Raises a `Refusal` where the step must be repeated.
        """
        found, mean = "the skin without a weight", _mean(readings)
        mean = mean.reshape(self.fit.sensor.layout.frame_shape)
        if self.taken:
            contact = self.fit.contact(mean - self.taken[0])
            self._check_unit(contact.force)
            if self.step == len(self.weights):
                self.fit.check_places([*self.contacts, contact])
            x, y = (1e3 * contact.position).tolist()
            found = f"a contact at ({x:.1f}, {y:.1f}) mm"
            self.contacts.append(contact)
        self.taken.append(mean)
        return found

    def _check_unit(self, force: float) -> None:
        """Refuse a weight that is told as another one by far, as one given in kg is."""
        mass, told = self.masses[self.step - 1], 1e3 * force / GRAVITY
        if not 1 / _ABSURD < told / mass < _ABSURD:
            raise Refusal(
                f"the readings correspond to about {told:.3g} g, where {mass:g} g were expected: "
                "give all masses in grams, and check the rigidity in the sensor's description"
            )

    def redo(self) -> None:
        """Go back by one step."""
        if self.taken:
            self.taken.pop()
            del self.contacts[len(self.taken[1:]) :]

    @property
    def bent(self) -> list[Array]:
        """What each weight so far changed in the readings, by the frame's shape."""
        return [readings - self.taken[0] for readings in self.taken[1:]]

    def laid(self, scene: Scene) -> Scene:
        """The simulated `scene` as the present step wants it."""
        scene = replace(scene, laid=None)
        if not self.step or self.done:
            return scene.touched_by()
        weight, patch = self.weights[self.step - 1], scene.plate.patch
        x, y = np.multiply(_PLACES[(self.step - 1) % len(_PLACES)], (patch.a, patch.b)).tolist()
        if patch.strip:
            return scene.touched_by(PointLoad(x, patch.b / 2, weight))
        radius = _FOOT * min(patch.a, patch.b)
        return scene.touched_by(DiscLoad(x, y, force=weight, radius=radius))


def _asked(weighing: Weighing) -> str:
    """The question before the present step."""
    redo = ", or r and Enter to repeat the last step" if weighing.step else ""
    number = f"{weighing.step}/{len(weighing.weights)}"
    return f"{number}  {weighing.what}: press Enter when at rest{redo}: "


def take_weights(
    name: str,
    masses: Sequence[float],
    prompt: Prompt,
    report: Report,
    *,
    seconds: float = 1.0,
    trust: bool = False,
    before: Calibration | None = None,
) -> tuple[Sensor, KnownWeights]:
    """The sensor of the source called `name`, and what weights of `masses` in g say of its skin.

    Prompts for the skin without a weight and for each weight, and averages `seconds` of frames;
    a simulation lays them on itself. Readings are corrected by the calibration `before`.
    """
    if not 0 < seconds <= LONGEST:
        raise Refusal(f"expected seconds above zero and at most {LONGEST:g} s, got {seconds}")
    newtons(masses)
    simulated = name.startswith(SimulatedSource.SCHEME)
    if simulated:
        clock = VirtualClock()
        scene = replace(load_scene(name.removeprefix(SimulatedSource.SCHEME), trust), laid=None)
        source: Source = SimulatedSource(scene, clock, clock.sleep)
    else:
        source = open_source(name)
    with closing(source):
        listener = DeviceReadings(source)
        weighing, correct = Weighing(listener.sensor, masses), _Correction(before)
        if before is not None:
            before.check(listener.sensor)
        report(WEIGHT_ADVICE)
        while not weighing.done:
            if isinstance(source, SimulatedSource):
                source.play(source.scene.touched_by())
                recorded(listener, 0.0, virtual=True)
                source.play(weighing.laid(source.scene))
            elif prompt(_asked(weighing)).strip().lower() == "r":
                weighing.redo()
                continue
            times, readings = listener.read(recorded(listener, seconds, virtual=simulated))
            try:
                report(f"    {weighing.take(correct(times, readings))}")
            except Refusal as refusal:
                if simulated:
                    raise
                report(f"    {refusal}; repeat this step")
        return listener.sensor, weighing.fit(weighing.weights, weighing.bent)


def _mean(readings: Array) -> Array:
    """The mean (C,) of the finite `readings` (n, C)."""
    read = np.isfinite(readings)
    frames = np.where(read.any(axis=0), read.sum(axis=0), np.nan)
    mean: Array = np.where(read, readings, 0.0).sum(axis=0) / frames
    return mean


class _Correction:
    """Readings (n, C) in 1/m of each step, corrected by an earlier calibration: one, their mean.

    Its loops are followed as if the skin was bare between two weights.
    """

    def __init__(self, before: Calibration | None) -> None:
        self._corrector = before and before.start()
        self._bare: Array | None = None

    def __call__(self, times: Array, readings: Array) -> Array:
        if self._corrector is None:
            return readings
        mean, time = _mean(readings), float(times.mean())
        if self._bare is None:
            self._bare = mean
        self._corrector(self._bare, time)
        return self._corrector(mean, time)[None]
