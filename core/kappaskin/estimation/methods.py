"""From curvature to coefficients: several estimators that answer alike."""

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.estimation.baselines import AsPrinted as AsPrinted
from kappaskin.estimation.baselines import Direct as Direct
from kappaskin.estimation.bayes import Bayes as Bayes
from kappaskin.estimation.estimator import RIM_SD as RIM_SD
from kappaskin.estimation.estimator import Estimator as Estimator
from kappaskin.estimation.fast import Fast as Fast
from kappaskin.estimation.finite_slope import FiniteSlope as FiniteSlope
from kappaskin.estimation.fit import Fit as Fit
from kappaskin.estimation.least_squares import LeastSquares as LeastSquares
from kappaskin.estimation.robust import WHY as WHY
from kappaskin.estimation.robust import Robust as Robust
from kappaskin.estimation.tracking import Tracking as Tracking
from kappaskin.estimation.unseen import singular_values as singular_values
from kappaskin.sensing import SensorLayout

METHODS: dict[str, type[Estimator]] = {
    "least-squares": LeastSquares,
    "as-printed": AsPrinted,
    "direct": Direct,
    "fast": Fast,
    "bayes": Bayes,
    "finite-slope": FiniteSlope,
    "robust": Robust,
    "tracking": Tracking,
}
"""Ways from readings to coefficients, the default first."""


def check_method(method: str) -> None:
    """Refuse a method that there is not."""
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
    """The estimator of this name; raises a `Refusal` when there is none or it cannot be made."""
    check_method(method)
    return METHODS[method](basis, layout, sigma, rim_sd, dtype)
