"""Object hypotheses: the best sphere, edge and cylinder for a contact, and their likelihoods."""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np

from kappaskin.contact.elastic_skin import (
    EVEN,
    ROUND,
    ElasticSkin,
    ForceModel,
    Optimum,
    PointForces,
    Prior,
    arcs,
    ends,
    optimise,
    ring,
)
from kappaskin.contact.interior import (
    Hypothesis,
    Width,
    arc_widths,
    fitted_cylinder,
    fitted_sphere,
    least_width,
    middle,
    ring_pattern,
)
from kappaskin.frames import Array, Contact, Mask

SHARE = 0.2
"""Prior standard deviation of the inequality of the forces on two ends."""
_ANGLE = 0.9  # rad, of an axis that is not known

_INEXACT = 0.02  # of a reading: that closely does a skin behave like a plate at best
_START = 0.025  # of a side: as wide as it is at first
_SHORT = 0.25  # of a side: an object as long may lie across what looks like its axis
_WORSE = 1.25  # times the cost of a ring, that one a little further on never has
_BETTER = 6.0  # chi-squared that another axis must gain


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """The best object of each kind for a contact; `noise` in 1/m is what the best one leaves."""

    sphere: Hypothesis
    edge: Hypothesis
    cylinder: Hypothesis
    noise: float
    readings: int


def fit_hypotheses(
    coarse: ElasticSkin,
    skin: ElasticSkin,
    readings: Array,
    used: Mask,
    noise: float,
    contact: Contact,
) -> Hypotheses:
    """The best objects for `readings` (R,) in 1/m, zero where not `used`, at the contact `contact`.

    First on the `coarse` skin: a reading grows without bound as a force comes close, and with many
    functions a force would stay on the side of an element where it started.
    """
    frame = _WeightedReadings(coarse, readings, used)
    pair, forces = coarse.best_pair(contact.position, readings, used)
    frame.trust(noise, _at(contact.position[None], np.array([contact.force])), _at(pair, forces))
    sphere, edge = frame.sphere(contact), frame.edge(pair, forces)
    cylinder = frame.cylinder(edge)
    tried = (sphere, edge, cylinder)
    noise *= frame.spread(tried)
    frame = _WeightedReadings(skin, readings, used)
    frame.trust(noise, *(o.contact(o.parameters) for o in tried))
    sphere = frame.shaped(sphere)
    edge = min((frame.edged(edge), frame.edged(cylinder)), key=_cost)
    cylinder = frame.rounded(cylinder, edge)
    if cylinder.cost > edge.cost:  # of which an edge is the narrowest
        cylinder = min(cylinder, frame.rounded(frame.beside(edge), edge), key=_cost)
    noise *= frame.spread((sphere, edge, cylinder))
    return Hypotheses(
        fitted_sphere(skin, sphere),
        Hypothesis(edge),
        fitted_cylinder(skin, cylinder),
        noise,
        int(used.sum()),
    )


def _cost(optimum: Optimum) -> float:
    return optimum.cost


def _at(points: Array, forces: Array) -> PointForces:
    return PointForces(points, forces, np.zeros((0, len(forces), 2)), np.zeros((0, len(forces))))


class _WeightedReadings:
    """The readings of one frame, weighted by their noise and by what the models leave out."""

    def __init__(self, skin: ElasticSkin, readings: Array, used: Mask) -> None:
        self.skin, self._readings, self._used = skin, readings, used
        self._least, self._start = least_width(skin), (_START * skin.side) ** 2

    def trust(self, noise: float, *forces: PointForces) -> None:
        """Set the weights from `noise` in 1/m and from unresolved detail close to `forces`."""
        left_out = np.max([self.skin.unresolved(f) for f in forces], axis=0)
        inexact = (_INEXACT * self._readings) ** 2
        self._weight = self._used / np.sqrt(noise**2 + left_out + inexact)

    def spread(self, tried: tuple[Optimum, ...]) -> float:
        """Residual of the best of the optima, in units of the noise of the weights."""
        squares = min(optimum.squares for optimum in tried)
        return math.sqrt(squares / (int(self._used.sum()) - 6))

    def _climb(self, contact: ForceModel, start: Array, steps: int) -> Optimum:
        """Optimise x, y, F; then angle, squared length and share, if there are ends; then q."""
        n = len(start)
        mean, sd = start.copy(), np.full(n, np.inf)
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        if n >= 6:
            sd[3], sd[5], mean[5] = _ANGLE, SHARE, 0.0
            low[4], low[5], high[5] = self._least, -0.49, 0.49
        if n != 6:
            low[-1] = self._least
        prior = Prior(mean, sd, low, high)
        return optimise(self.skin, contact, start, prior, self._readings, self._weight, steps)

    def again(self, optimum: Optimum, contact: ForceModel, parameters: int) -> Optimum:
        """The optimum of `contact` near another's, as many of its `parameters` as it has."""
        return self._climb(contact, optimum.parameters[:parameters], 4)

    def sphere(self, contact: Contact) -> Optimum:
        return self._climb(
            ring(ROUND), np.array([*contact.position, contact.force, self._start]), 4
        )

    def edge(self, pair: Array, forces: Array) -> Optimum:
        force, apart = float(forces.sum()), pair[0] - pair[1]
        share = float(np.clip(forces[0] / force - 0.5, -0.4, 0.4))
        angle = math.atan2(apart[1], apart[0])
        start = [*(forces @ pair / force), force, angle, max(apart @ apart, self._least), share]
        return self._climb(ends(0.0), np.array(start), 6)

    def cylinder(self, edge: Optimum) -> Optimum:
        """From the edge, or across it: a short cylinder's arcs may be longer than itself."""
        along = self._climb(arcs(EVEN, 0.0), np.append(edge.parameters, self._start), 5)
        length2 = edge.parameters[4]
        if length2 > (_SHORT * self.skin.side) ** 2:
            return along
        turned = edge.parameters.copy()
        turned[3:6] = turned[3] + math.pi / 2, max(0.3 * length2, self._start), 0.0
        across = self._climb(arcs(EVEN, 0.0), np.append(turned, max(length2 / 4, self._start)), 5)
        return across if across.cost < along.cost - _BETTER else along

    def shaped(self, sphere: Optimum) -> Optimum:
        """The sphere, its ring of forces as the bending of the skin shapes it."""
        sphere = self.again(sphere, ring(ring_pattern(self.skin, sphere)), 4)
        for _ in range(2 if self.skin.patch.base_curvature else 1):  # further from a circle
            again = self.again(sphere, ring(ring_pattern(self.skin, sphere)), 4)
            if again.cost > _WORSE * sphere.cost:  # the pattern has tipped over to another
                break
            sphere = again
        return sphere

    def edged(self, near: Optimum) -> Optimum:
        """The edge near another optimum, with the force between its ends that contact demands."""
        share = middle(self.skin, near)
        edge = self.again(near, ends(share), 6)
        return self.again(edge, ends(middle(self.skin, edge)), 6) if share else edge

    def beside(self, edge: Optimum) -> Optimum:
        """The cylinder next to an edge."""
        return self._climb(arcs(EVEN, 0.0), np.append(edge.parameters, self._start / 10), 4)

    def rounded(self, cylinder: Optimum, edge: Optimum) -> Optimum:
        """The cylinder with one curvature at both ends and the force between them of an edge."""
        share = middle(self.skin, edge)
        return self.again(cylinder, arcs(arc_widths(self.skin, cylinder, share), share), 7)


# Priors, in sides of the skin: a radius between these two, uniform in its logarithm; a uniform
# length of up to one side; any angle; and `SHARE`.
_RADII = (0.02, 5.0)

_ALIGNED = 0.1  # rad between a plane's contact and the axis of a bent skin


def log_likelihoods(skin: ElasticSkin, all_of: Hypotheses) -> dict[str, float]:
    """Logarithms of the marginal likelihoods of all kinds, up to a common constant."""
    sphere, cylinder = cast("Width", all_of.sphere.width), cast("Width", all_of.cylinder.width)
    of_cylinder = laplace_integral(all_of.cylinder.best, all_of) + length_prior(
        skin, all_of.cylinder.best
    )
    of_cylinder += _beyond_bound(all_of.cylinder.best, cylinder) - _unexplained(all_of, cylinder)
    return {
        "sphere": laplace_integral(all_of.sphere.best, all_of)
        + _beyond_bound(all_of.sphere.best, sphere)
        + radius_prior(skin, sphere),
        "edge": laplace_integral(all_of.edge.best, all_of) + length_prior(skin, all_of.edge.best),
        "cylinder": of_cylinder + radius_prior(skin, cylinder),
        "plane": of_cylinder + plane_prior(skin, all_of.cylinder.best, cylinder),
    }


def laplace_integral(best: Optimum, all_of: Hypotheses) -> float:
    """Log of Laplace's integral over all parameters: flat priors, unknown noise."""
    scale = np.sqrt(np.diag(best.covariance))
    correlation = best.covariance / np.multiply.outer(scale, scale)
    volume = np.linalg.slogdet(2 * np.pi * correlation)[1] / 2 + np.log(scale).sum()
    return float(volume) - (all_of.readings - 3) / 2 * math.log(best.squares)


def _line(sd: float, likely: Array) -> float:
    """Log of the mean of the likelihood `likely` over a prior, less that of its integral."""
    return math.log(max(float(np.mean(likely)), 1e-300)) - math.log(sd * math.sqrt(2 * math.pi))


def length_prior(skin: ElasticSkin, best: Optimum) -> float:
    """Log correction for the priors of angle, length and share."""
    square, sd = best.parameters[4], math.sqrt(best.covariance[4, 4])
    lengths = np.linspace(0, skin.side, 400)
    likely = np.exp(-0.5 * ((lengths**2 - square) / sd) ** 2)
    share = -0.5 * (best.parameters[5] / SHARE) ** 2 - math.log(SHARE * math.sqrt(2 * math.pi))
    return share - math.log(math.pi) + _line(sd, likely)


def _beyond_bound(best: Optimum, width: Width) -> float:
    """Rise of the log likelihood from a width on its bound to the unconstrained one."""
    return 0.5 * ((float(best.parameters[-1]) - width.q) / width.sd) ** 2


def _unexplained(all_of: Hypotheses, width: Width) -> float:
    """Gain of a cylinder over an edge in log likelihood that its width does not explain."""
    gain = all_of.edge.best.cost - all_of.cylinder.best.cost
    sd = math.sqrt(all_of.cylinder.best.covariance[-1, -1])  # of the readings alone
    return max(gain - max(width.q / sd, 0.0) ** 2, 0.0) / 2


def radius_prior(skin: ElasticSkin, width: Width) -> float:
    """Log correction for the prior of the radius."""
    low, high = (math.log(share * skin.side) for share in _RADII)
    curvatures = np.exp(-np.linspace(low, high, 400))
    return _line(width.sd, width.likelihood(width.of_curvature(curvatures)))


def plane_prior(skin: ElasticSkin, best: Optimum, width: Width) -> float:
    """Log correction for a plane: a cylinder without curvature along the axis of a bent skin.

    Minus infinity on a flat skin, where a large plane touches only the edges.
    """
    if not skin.patch.base_curvature:
        return -math.inf
    turn = math.remainder(best.parameters[3] - math.pi / 2, math.pi)
    aligned = -0.5 * turn**2 / (best.covariance[3, 3] + _ALIGNED**2)
    return aligned + _line(width.sd, width.likelihood(width.of_curvature(np.zeros(1))))
