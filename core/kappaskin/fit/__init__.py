"""From curvature to coefficients: several estimators that answer alike."""

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.fit.baselines import AsPrinted as AsPrinted
from kappaskin.fit.baselines import Direct as Direct
from kappaskin.fit.bayes import Bayes as Bayes
from kappaskin.fit.estimator import RIM_SD as RIM_SD
from kappaskin.fit.estimator import Estimator as Estimator
from kappaskin.fit.fast import Fast as Fast
from kappaskin.fit.finite_slope import FiniteSlope as FiniteSlope
from kappaskin.fit.fit import Fit as Fit
from kappaskin.fit.least_squares import LeastSquares as LeastSquares
from kappaskin.fit.robust import WHY as WHY
from kappaskin.fit.robust import Robust as Robust
from kappaskin.fit.tracking import Tracking as Tracking
from kappaskin.fit.unseen import singular_values as singular_values
from kappaskin.layout import SensorLayout

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
