"""From curvature to coefficients."""

from kappaskin.fit.least_squares import RIM_SD as RIM_SD
from kappaskin.fit.least_squares import Fit as Fit
from kappaskin.fit.least_squares import LeastSquares as LeastSquares
