"""The estimators by name."""

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.estimation.bayes import Bayes
from kappaskin.estimation.estimator import RIM_SD, Estimator
from kappaskin.estimation.fast import Fast
from kappaskin.estimation.least_squares import (
    AsPrinted,
    Direct,
    FiniteSlopeLeastSquares,
    LeastSquares,
)
from kappaskin.estimation.robust import Robust
from kappaskin.estimation.tracking import Tracking
from kappaskin.sensing import SensorLayout

METHODS: dict[str, type[Estimator]] = {
    "least-squares": LeastSquares,
    "as-printed": AsPrinted,
    "direct": Direct,
    "fast": Fast,
    "bayes": Bayes,
    "finite-slope": FiniteSlopeLeastSquares,
    "robust": Robust,
    "tracking": Tracking,
}
"""Estimators by name, the default first."""


def check_method(method: str) -> None:
    """Raise a `Refusal` for an unknown `method`."""
    if method not in METHODS:
        raise Refusal(f"expected a method among {', '.join(METHODS)}; got {method!r}")


def estimator_for(
    method: str,
    basis: Basis,
    layout: SensorLayout,
    sigma: ArrayLike | None = None,
    rim_sd: float = RIM_SD,
    dtype: DTypeLike = np.float64,
) -> Estimator:
    """The estimator named `method`; raises a `Refusal` for an unknown or impossible one."""
    check_method(method)
    return METHODS[method](basis, layout, sigma, rim_sd, dtype)
