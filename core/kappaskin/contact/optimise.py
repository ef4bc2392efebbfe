"""Up the likelihood of a contact's parameters, by damped Gauss-Newton steps."""

from dataclasses import dataclass

import numpy as np

from kappaskin.contact.elastic_skin import ElasticSkin
from kappaskin.contact.rigid_contacts import Contact
from kappaskin.frames import Array

_GAIN = 0.05  # of chi-squared: less is not worth a step
_DAMPING = 1e-3  # of the diagonal, at first
_RIDGE = 1e-12  # of the diagonal, always


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """What is known of n parameters beforehand: normal around `mean`, within `low` and `high`."""

    mean: Array
    sd: Array
    low: Array
    high: Array


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """The best parameters (n,), their covariance (n, n) and cost, with the readings' part of it.

    `ahead` (n,) is the step that a bound forbade.
    """

    contact: Contact
    parameters: Array
    covariance: Array
    cost: float
    squares: float
    ahead: Array


def climb(
    skin: ElasticSkin,
    contact: Contact,
    start: Array,
    prior: Prior,
    readings: Array,
    weight: Array,
    steps: int,
) -> Optimum:
    """The optimum near `start` for `readings` (R,) with weights (R,), 1 / sd or 0 where missing."""
    p, damping = start, _DAMPING
    here = _answer(skin, contact, p, prior, readings, weight)
    for _ in range(steps):
        q = np.clip(p + here.step(damping), prior.low, prior.high)
        there = _answer(skin, contact, q, prior, readings, weight)
        if not there.cost < here.cost:
            damping = max(10 * damping, 0.01)
            continue
        gain, p, here, damping = here.cost - there.cost, q, there, damping / 10
        if gain < _GAIN:
            break
    return Optimum(contact, p, here.covariance, here.cost, here.squares, here.step(0.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Here:
    """The cost at some parameters, and its normal equations scaled to a diagonal of ones."""

    cost: float
    squares: float
    normal: Array
    gradient: Array
    scale: Array

    def step(self, damping: float) -> Array:
        held = self.normal + (damping + _RIDGE) * np.eye(len(self.scale))
        return np.linalg.solve(held, self.gradient) / self.scale

    @property
    def covariance(self) -> Array:
        inverse = np.linalg.inv(self.normal + _RIDGE * np.eye(len(self.scale)))
        return inverse / np.multiply.outer(self.scale, self.scale)


def _answer(
    skin: ElasticSkin, contact: Contact, p: Array, prior: Prior, readings: Array, weight: Array
) -> _Here:
    K, slopes = skin.readings(contact(p))
    left, J, off = weight * (readings - K), weight[:, None] * slopes, (p - prior.mean) / prior.sd
    squares = float(left @ left)
    normal = J.T @ J + np.diag(prior.sd**-2)
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0] = 1.0  # a parameter that nothing feels, as on the rim
    gradient = (J.T @ left - off / prior.sd) / scale
    return _Here(
        squares + float(off @ off),
        squares,
        normal / np.multiply.outer(scale, scale),
        gradient,
        scale,
    )
