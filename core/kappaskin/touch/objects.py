"""From the readings of a contact to what kind of object presses on the skin, and how it curves."""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
import scipy

from kappaskin.frames import Array, Touch
from kappaskin.layout import SensorLayout
from kappaskin.mechanics import Plate
from kappaskin.patch import Patch
from kappaskin.touch.climb import Optimum
from kappaskin.touch.hypotheses import SHARE, Hypotheses, hypotheses
from kappaskin.touch.inside import Hypothesis, Width
from kappaskin.touch.skin import ElasticSkin

KINDS = ("plane", "cylinder", "sphere", "edge")
"""What an object may be; each as likely beforehand as the others."""

# What is held likely beforehand, in sides of the skin: a radius between these two, every factor
# alike; a length of up to one side, every length alike; any angle; and `SHARE`.
_RADII = (0.02, 5.0)

_COARSE = 15  # functions along each side, at first; of a disk or a polygon to the end
_FINE, _FINE_MIXED = 40, 30  # and then: of waves that do not mix, and of those that do
_WELL = 1.2  # times the residual of the fitted shape that an object may leave
_ENOUGH = 20  # readings at least
_INEXACT = 0.02  # of a curvature: what a ring or arcs leave out of a real contact
_QUIET = 1e-4  # of the largest reading: no skin is quieter
_SEEN = 2.6  # standard deviations: a width below is only an upper bound, or noise passes for one
_ALIGNED = 0.1  # rad between a plane's contact and the axis of a bent skin
_SURE = 0.4  # probability below which no kind is named


@dataclass(frozen=True, slots=True, eq=False)
class ContactObject:
    """What touches the skin, as far as the readings of one frame tell.

    `kind` is one of `KINDS`, or empty when they do not tell; `probability` has all of them, and is
    empty without a contact. `position` (2,) in m and `force` in N have 95 % half widths. `radius`
    in m with its 95 % interval `radius_95`: from 0 when only an upper bound is known, up to
    infinity when it may be flat. `axis` is the angle in rad from x of a cylinder's axis or of an
    edge, `length` its length in m, both with 95 % half widths. What does not apply is NaN. A flat
    face on a flat skin touches at its rim alone and looks like the sphere or cylinder that touches
    there; two points look like the edge that joins them.
    """

    kind: str
    probability: dict[str, float]
    position: Array
    position_95: Array
    force: float
    force_95: float
    radius: float
    radius_95: tuple[float, float]
    axis: float
    axis_95: float
    length: float
    length_95: float

    @property
    def ranked(self) -> list[tuple[str, float]]:
        """Kinds and their probabilities, the likeliest first."""
        return sorted(self.probability.items(), key=lambda item: -item[1])

    def describe(self) -> str:
        """One line in millimetres and degrees, with the runner-up."""
        if not self.probability:
            return "nothing touches"
        (likeliest, first), (second, chance) = self.ranked[:2]
        if not self.kind and first >= _SURE:
            return f"cannot tell: fits none of these objects, {likeliest} the least badly"
        if not self.kind:
            odds = f"{100 * first:.0f} % to {100 * chance:.0f} %"
            return f"{likeliest} or {second}: cannot tell ({odds})"
        parts = [self.kind]
        if self.kind in ("cylinder", "sphere"):
            parts.append(self._radius())
        if self.kind in ("cylinder", "edge"):
            parts.append(f"{1e3 * self.length:.0f} mm long, axis {math.degrees(self.axis):.0f} deg")
        return f"{', '.join(parts)}; runner-up {second} {100 * chance:.0f} %"

    def _radius(self) -> str:
        low, high = (1e3 * radius for radius in self.radius_95)
        if low == math.inf:
            return "flat or hollow"
        if high == math.inf:
            return f"radius above {_digits(low)} mm" if low else "radius unknown"
        if not low:
            return f"radius below {_digits(high)} mm"
        return f"radius {_digits(1e3 * self.radius)} mm ({_digits(low)} to {_digits(high)})"


def _digits(value: float) -> str:
    """Three digits, and whatever more a number from 1000 on has before the point."""
    return f"{value:.3g}" if value < 999.5 else f"{value:.0f}"


NO_OBJECT = ContactObject(
    "",
    {},
    np.full(2, np.nan),
    np.full(2, np.nan),
    math.nan,
    math.nan,
    math.nan,
    (math.nan, math.nan),
    math.nan,
    math.nan,
    math.nan,
    math.nan,
)


class ObjectFinder:
    """What touches a skin: a plane, a cylinder, a sphere or an edge, by marginal likelihood.

    To each kind belongs a small family of forces on the skin (`kappaskin.touch.contacts`), fitted
    to the readings by maximum likelihood. The kinds are weighed by Laplace's approximation of
    their marginal likelihoods, the noise's size unknown. The object's curvature is that of the
    skin between the forces. A few tens of milliseconds: for display, not for every frame. On a
    skin bent to a radius of a few elements its probabilities promise too much: a dent there is
    not much wider than what the functions resolve.
    """

    def __init__(self, plate: Plate, layout: SensorLayout, edge: str = "hinged") -> None:
        patch = plate.patch
        if type(patch) is not Patch:
            fine = _COARSE
        else:
            fine = _FINE if edge == "hinged" and not patch.base_curvature else _FINE_MIXED
        self._coarse = ElasticSkin(plate, layout, edge, _COARSE)
        self._skin = self._coarse
        if fine != _COARSE:
            self._skin = ElasticSkin(plate, layout, edge, fine)
        self._live = layout.live.ravel()

    def __call__(self, curvature: Array, noise: float, touch: Touch) -> ContactObject:
        """The object for `curvature` (3, P) in 1/m, NaN where missing, and the `touch` in it.

        `noise` in 1/m is the standard deviation of a reading, as the fitted shape leaves it.
        """
        used = self._live & np.isfinite(curvature).ravel()
        if not touch.present or used.sum() < _ENOUGH:
            return NO_OBJECT
        K = np.where(used, curvature.ravel(), 0.0)
        noise = max(noise, _QUIET * float(np.abs(K).max()))
        return _judged(
            self._skin, hypotheses(self._coarse, self._skin, K, used, noise, touch), noise
        )


def _judged(skin: ElasticSkin, all_of: Hypotheses, noise: float) -> ContactObject:
    weights = _log_evidence(skin, all_of)
    most = max(weights.values())
    total = sum(math.exp(weight - most) for weight in weights.values())
    probability = {kind: math.exp(weights[kind] - most) / total for kind in KINDS}
    kind = max(KINDS, key=probability.__getitem__)
    found = {"sphere": all_of.sphere, "edge": all_of.edge}.get(kind, all_of.cylinder)
    reach = float(scipy.special.stdtrit(all_of.readings - len(found.best.parameters), 0.975))
    radius, radius_95 = _radius(cast("Width", found.width or all_of.cylinder.width), reach)
    known = probability[kind] >= _SURE and all_of.noise <= _WELL * noise
    known = known and not (kind == "plane" and math.isnan(radius))  # flattened, not just touched
    return ContactObject(
        kind if known else "",
        probability,
        found.best.parameters[:2],
        reach * np.sqrt(np.diag(found.best.covariance)[:2]),
        float(found.best.parameters[2]),
        reach * math.sqrt(found.best.covariance[2, 2]),
        radius,
        radius_95,
        *_axis(found, radius_95, reach),
        *_length(found, reach),
    )


def _axis(found: Hypothesis, radius_95: tuple[float, float], reach: float) -> tuple[float, float]:
    """Angle in rad and half width, as far as the noise and the radius leave it open."""
    if len(found.best.parameters) < 6:
        return math.nan, math.nan
    off = reach * math.sqrt(found.best.covariance[3, 3])
    if found.width is None:
        return float(found.best.parameters[3]) % math.pi, off
    low, high = (found.axis(min(radius, 1e3)) for radius in radius_95)
    spread = abs(math.remainder(high - low, math.pi)) / 2
    return (low + math.remainder(high - low, math.pi) / 2) % math.pi, math.hypot(off, spread)


def _length(found: Hypothesis, reach: float) -> tuple[float, float]:
    """Length in m and half width."""
    if len(found.best.parameters) < 6:
        return math.nan, math.nan
    length = math.sqrt(found.best.parameters[4])
    return length, reach * math.sqrt(found.best.covariance[4, 4]) / (2 * length)


def _radius(width: Width, reach: float) -> tuple[float, tuple[float, float]]:
    """The radius in m and its interval of `reach` standard deviations."""
    low, high = width.q - reach * width.sd, max(width.q, 0.0) + reach * width.sd
    flattest = width.curvature(high)
    if width.q < _SEEN * width.sd or low <= 0:
        return math.nan, (0.0, _inverse((1 - _INEXACT) * flattest))
    best = width.curvature(width.q)
    off = _INEXACT * best
    up, down = math.hypot(width.curvature(low) - best, off), math.hypot(best - flattest, off)
    return _inverse(best), (_inverse(best + up), _inverse(best - down))


def _inverse(curvature: float) -> float:
    return 1 / curvature if curvature > 0 else math.inf


def _log_evidence(skin: ElasticSkin, all_of: Hypotheses) -> dict[str, float]:
    """Logarithms of the marginal likelihoods of all kinds, up to what they have in common."""
    sphere, cylinder = cast("Width", all_of.sphere.width), cast("Width", all_of.cylinder.width)
    of_cylinder = _peak(all_of.cylinder.best, all_of) + _of_length(skin, all_of.cylinder.best)
    of_cylinder += _beyond_bound(all_of.cylinder.best, cylinder) - _unexplained(all_of, cylinder)
    return {
        "sphere": _peak(all_of.sphere.best, all_of)
        + _beyond_bound(all_of.sphere.best, sphere)
        + _of_radius(skin, sphere),
        "edge": _peak(all_of.edge.best, all_of) + _of_length(skin, all_of.edge.best),
        "cylinder": of_cylinder + _of_radius(skin, cylinder),
        "plane": of_cylinder + _of_plane(skin, all_of.cylinder.best, cylinder),
    }


def _peak(best: Optimum, all_of: Hypotheses) -> float:
    """Laplace's integral over all parameters, their priors flat, the noise's size unknown."""
    scale = np.sqrt(np.diag(best.covariance))
    correlation = best.covariance / np.multiply.outer(scale, scale)
    volume = np.linalg.slogdet(2 * np.pi * correlation)[1] / 2 + np.log(scale).sum()
    return float(volume) - (all_of.readings - 3) / 2 * math.log(best.squares)


def _line(q: float, sd: float, likely: Array) -> float:
    """The log of a prior's mean of the likelihood `likely`, in place of its integral over q."""
    return math.log(max(float(np.mean(likely)), 1e-300)) - math.log(sd * math.sqrt(2 * math.pi))


def _of_length(skin: ElasticSkin, best: Optimum) -> float:
    """Priors of angle, length and share."""
    square, sd = best.parameters[4], math.sqrt(best.covariance[4, 4])
    lengths = np.linspace(0, skin.side, 400)
    likely = np.exp(-0.5 * ((lengths**2 - square) / sd) ** 2)
    share = -0.5 * (best.parameters[5] / SHARE) ** 2 - math.log(SHARE * math.sqrt(2 * math.pi))
    return share - math.log(math.pi) + _line(square, sd, likely)


def _beyond_bound(best: Optimum, width: Width) -> float:
    """What the likelihood rises from a width on its bound to where the readings would have it."""
    return 0.5 * ((float(best.parameters[-1]) - width.q) / width.sd) ** 2


def _unexplained(all_of: Hypotheses, width: Width) -> float:
    """What the likelihood of a cylinder gains over an edge's beyond what its width accounts for."""
    gain = all_of.edge.best.cost - all_of.cylinder.best.cost
    sd = math.sqrt(all_of.cylinder.best.covariance[-1, -1])  # of the readings alone
    return max(gain - max(width.q / sd, 0.0) ** 2, 0.0) / 2


def _of_radius(skin: ElasticSkin, width: Width) -> float:
    low, high = (math.log(share * skin.side) for share in _RADII)
    curvatures = np.exp(-np.linspace(low, high, 400))
    return _line(width.q, width.sd, width.likelihood(width.of_curvature(curvatures)))


def _of_plane(skin: ElasticSkin, best: Optimum, width: Width) -> float:
    """Of a cylinder without curvature along the base's axis; of nothing on a flat skin.

    There a plane of more than its size touches nothing but the edges.
    """
    if not skin.patch.base_curvature:
        return -math.inf
    turn = math.remainder(best.parameters[3] - math.pi / 2, math.pi)
    aligned = -0.5 * turn**2 / (best.covariance[3, 3] + _ALIGNED**2)
    return aligned + _line(width.q, width.sd, width.likelihood(width.of_curvature(np.zeros(1))))
