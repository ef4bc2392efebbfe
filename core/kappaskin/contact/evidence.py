"""From the best objects of each kind to how likely the kinds are: marginal likelihoods."""

import math
from typing import cast

import numpy as np

from kappaskin.contact.elastic_skin import ElasticSkin
from kappaskin.contact.hypotheses import SHARE, Hypotheses
from kappaskin.contact.interior import Width
from kappaskin.contact.optimise import Optimum
from kappaskin.frames import Array

# What is held likely beforehand, in sides of the skin: a radius between these two, every factor
# alike; a length of up to one side, every length alike; any angle; and `SHARE`.
_RADII = (0.02, 5.0)

_ALIGNED = 0.1  # rad between a plane's contact and the axis of a bent skin


def log_evidence(skin: ElasticSkin, all_of: Hypotheses) -> dict[str, float]:
    """Logarithms of the marginal likelihoods of all kinds, up to what they have in common."""
    sphere, cylinder = cast("Width", all_of.sphere.width), cast("Width", all_of.cylinder.width)
    of_cylinder = peak(all_of.cylinder.best, all_of) + of_length(skin, all_of.cylinder.best)
    of_cylinder += _beyond_bound(all_of.cylinder.best, cylinder) - _unexplained(all_of, cylinder)
    return {
        "sphere": peak(all_of.sphere.best, all_of)
        + _beyond_bound(all_of.sphere.best, sphere)
        + of_radius(skin, sphere),
        "edge": peak(all_of.edge.best, all_of) + of_length(skin, all_of.edge.best),
        "cylinder": of_cylinder + of_radius(skin, cylinder),
        "plane": of_cylinder + of_plane(skin, all_of.cylinder.best, cylinder),
    }


def peak(best: Optimum, all_of: Hypotheses) -> float:
    """Laplace's integral over all parameters, their priors flat, the noise's size unknown."""
    scale = np.sqrt(np.diag(best.covariance))
    correlation = best.covariance / np.multiply.outer(scale, scale)
    volume = np.linalg.slogdet(2 * np.pi * correlation)[1] / 2 + np.log(scale).sum()
    return float(volume) - (all_of.readings - 3) / 2 * math.log(best.squares)


def _line(sd: float, likely: Array) -> float:
    """The log of a prior's mean of the likelihood `likely`, in place of its integral."""
    return math.log(max(float(np.mean(likely)), 1e-300)) - math.log(sd * math.sqrt(2 * math.pi))


def of_length(skin: ElasticSkin, best: Optimum) -> float:
    """Priors of angle, length and share."""
    square, sd = best.parameters[4], math.sqrt(best.covariance[4, 4])
    lengths = np.linspace(0, skin.side, 400)
    likely = np.exp(-0.5 * ((lengths**2 - square) / sd) ** 2)
    share = -0.5 * (best.parameters[5] / SHARE) ** 2 - math.log(SHARE * math.sqrt(2 * math.pi))
    return share - math.log(math.pi) + _line(sd, likely)


def _beyond_bound(best: Optimum, width: Width) -> float:
    """What the likelihood rises from a width on its bound to where the readings would have it."""
    return 0.5 * ((float(best.parameters[-1]) - width.q) / width.sd) ** 2


def _unexplained(all_of: Hypotheses, width: Width) -> float:
    """What the likelihood of a cylinder gains over an edge's beyond what its width accounts for."""
    gain = all_of.edge.best.cost - all_of.cylinder.best.cost
    sd = math.sqrt(all_of.cylinder.best.covariance[-1, -1])  # of the readings alone
    return max(gain - max(width.q / sd, 0.0) ** 2, 0.0) / 2


def of_radius(skin: ElasticSkin, width: Width) -> float:
    low, high = (math.log(share * skin.side) for share in _RADII)
    curvatures = np.exp(-np.linspace(low, high, 400))
    return _line(width.sd, width.likelihood(width.of_curvature(curvatures)))


def of_plane(skin: ElasticSkin, best: Optimum, width: Width) -> float:
    """Of a cylinder without curvature along the base's axis; of nothing on a flat skin.

    There a plane of more than its size touches nothing but the edges.
    """
    if not skin.patch.base_curvature:
        return -math.inf
    turn = math.remainder(best.parameters[3] - math.pi / 2, math.pi)
    aligned = -0.5 * turn**2 / (best.covariance[3, 3] + _ALIGNED**2)
    return aligned + _line(width.sd, width.likelihood(width.of_curvature(np.zeros(1))))
