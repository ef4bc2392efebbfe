"""Estimation: readings to coefficients with error bars; element placement; regions; spectra."""

from inspect import isabstract

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from kappaskin import _plugins
from kappaskin.bases import Basis
from kappaskin.errors import Refusal
from kappaskin.estimation.bayes import Bayes as Bayes
from kappaskin.estimation.estimator import Estimator as Estimator
from kappaskin.estimation.estimator import PatternCache as PatternCache
from kappaskin.estimation.estimator import column_lengths as column_lengths
from kappaskin.estimation.estimator import unobserved_function as unobserved_function
from kappaskin.estimation.fast import Fast as Fast
from kappaskin.estimation.fit import DenseUncertainty as DenseUncertainty
from kappaskin.estimation.fit import Fit as Fit
from kappaskin.estimation.fit import Uncertainty as Uncertainty
from kappaskin.estimation.fit import power_of_two as power_of_two
from kappaskin.estimation.fit import propagated_covariance as propagated_covariance
from kappaskin.estimation.fit import sigma_warning as sigma_warning
from kappaskin.estimation.fit import slope_warning as slope_warning
from kappaskin.estimation.least_squares import AsPrinted, Direct
from kappaskin.estimation.least_squares import FiniteSlopeLeastSquares as FiniteSlopeLeastSquares
from kappaskin.estimation.least_squares import LeastSquares as LeastSquares
from kappaskin.estimation.placement import PLACEMENTS as PLACEMENTS
from kappaskin.estimation.placement import check_placement as check_placement
from kappaskin.estimation.placement import place_elements as place_elements
from kappaskin.estimation.placement import place_for_loads as place_for_loads
from kappaskin.estimation.placement import predicted_sd as predicted_sd
from kappaskin.estimation.placement import singular_values as singular_values
from kappaskin.estimation.region import Region as Region
from kappaskin.estimation.region import Scanner as Scanner
from kappaskin.estimation.region import ScanTradeoff as ScanTradeoff
from kappaskin.estimation.robust import FAULTS as FAULTS
from kappaskin.estimation.robust import Robust as Robust
from kappaskin.estimation.spectrum import amplitude_spectrum as amplitude_spectrum
from kappaskin.estimation.tracking import Tracking as Tracking
from kappaskin.sensing import SensorLayout

_OURS: dict[str, type[Estimator]] = {
    "least-squares": LeastSquares,
    "as-printed": AsPrinted,
    "direct": Direct,
    "fast": Fast,
    "bayes": Bayes,
    "finite-slope": FiniteSlopeLeastSquares,
    "robust": Robust,
    "tracking": Tracking,
}


def _check(name: str, made: object) -> None:
    """Raise a `TypeError` for what is no estimator."""
    if not (isinstance(made, type) and issubclass(made, Estimator)) or isabstract(made):
        raise TypeError(f"expected a class of Estimator with all its methods, got {made!r:.60}")


METHODS: dict[str, type[Estimator]] = {
    **_OURS,
    **_plugins.plug_ins(_plugins.ESTIMATORS, _check, _OURS),
}
"""Estimators by name, the default first, those of plug-ins last."""


def check_method(method: str) -> None:
    """Raise a `Refusal` for an unknown `method`."""
    if method not in METHODS:
        why = _plugins.left_out(_plugins.ESTIMATORS, method)
        raise Refusal(f"expected a method among {', '.join(METHODS)}, got {method!r}{why}")


def estimator_for(
    method: str,
    basis: Basis,
    layout: SensorLayout,
    sigma: ArrayLike | None = None,
    rim_sd: float = Estimator.RIM_SD,
    dtype: DTypeLike = np.float64,
) -> Estimator:
    """The estimator named `method`; raises a `Refusal` for an unknown or impossible one."""
    check_method(method)
    return METHODS[method](basis, layout, sigma, rim_sd, dtype)
