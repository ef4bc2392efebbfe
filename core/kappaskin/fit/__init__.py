"""From curvature to coefficients."""

from kappaskin.fit.least_squares import Fit as Fit
from kappaskin.fit.least_squares import LeastSquares as LeastSquares
