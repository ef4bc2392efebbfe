"""The course of readings while the skin is held to the creep that explains it."""

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.sensing import StandardLinearSolid

_MOST_SHARE = 0.9
_SETTLING = 0.01  # share of a hold, after the skin was bent, that is left out


def _bent_at(course: Array) -> int:
    """The first moment at which the channels are together more than half as far as at the end."""
    far = course @ np.sign(course[-1])
    return int(np.argmax(far > far[-1] / 2))


def identify_creep(moments: Array, course: Array, least: float) -> StandardLinearSolid | None:
    """The creep in `course` (T, C) in 1/m, read at `moments` (T,) in s; None where there is none.

    The skin was at rest, reading zero, until it was bent, early in the course, and then held. What
    is read from then on is A + B e^(-t/tau), of which the share phi = B / (A + B) goes. The
    channels share tau, a property of the one glue between them that a channel which hardly creeps
    cannot tell; each has its own phi. Channels of NaN creep not at all. No reading is known better
    than `least` in 1/m.
    """
    from scipy.optimize import minimize_scalar  # slow to import, and seldom needed

    known = np.isfinite(course).all(axis=0)
    if not known.any():
        raise Refusal("every channel was on a rail during the hold; lower the amplifier's gain")
    bent = _bent_at(course[:, known])
    t = moments - moments[bent]
    length = float(t[-1])
    held = t > _SETTLING * length
    t, y = t[held], course[held][:, known]
    n, C = y.shape
    if n < 10:
        raise Refusal(
            f"expected a hold spent mostly on the cylinder, got {n} readings after the skin was "
            "bent; begin the hold, then bend it at once"
        )

    def solved(log_tau: float) -> tuple[Array, Array]:
        """A and B (2, C), and the squares (C,) that they leave."""
        gone = np.column_stack([np.ones(n), np.exp(-t / np.exp(log_tau))])
        found: Array = np.linalg.lstsq(gone, y)[0].astype(float)
        return found, ((y - gone @ found) ** 2).sum(axis=0)

    bounds = float(np.log(length / 100)), float(np.log(length))
    best = minimize_scalar(lambda v: solved(v)[1].sum(), bounds=bounds, method="bounded")
    (A, B), squares = solved(float(best.x))
    still = float(((y - y.mean(axis=0)) ** 2).sum())
    floor = n * C * least**2
    gained = n * C * np.log(max(still, floor) / max(float(squares.sum()), floor))
    if gained < (C + 1) * np.log(n * C):
        return None  # by the Bayesian information criterion no reading moved
    tau = float(np.exp(best.x))
    if tau > 0.95 * length:
        raise Refusal(
            f"the hold of {length:.3g} s is too short to tell the creep: its time constant is no "
            "shorter; hold longer, or not at all"
        )
    share = np.zeros(course.shape[1])
    at_once = np.where(A + B == 0, 1.0, A + B)
    share[known] = np.clip(B / at_once, 0.0, _MOST_SHARE)
    return StandardLinearSolid(share, tau)
