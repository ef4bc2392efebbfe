"""Readings to coefficients, by our estimators and by what NumPy and SciPy have for it."""

from typing import cast

import numpy as np
from scipy.sparse.linalg import lsqr

from kappaskin.bases import basis_for
from kappaskin.estimation import column_lengths, estimator_for
from kappaskin.frames import Array, Mask
from kappaskin.studies.compare.way import Way
from kappaskin.studies.tables import Case


def ours(
    case: Case, method: str, functions: tuple[int, int] | None = None, error_bars: bool = False
) -> Way:
    """One of our methods, with the case's functions or so many others."""
    scene = case.scene
    basis = basis_for(scene.plate.patch, scene.edge, *(functions or case.fit.basis.shape))
    fit = estimator_for(method, basis, scene.layout)

    def solve(curvature: Array) -> Array:
        found = fit(curvature)
        if error_bars:
            _ = found.sd  # made when asked for
        return found.coefficients.reshape(*curvature.shape[:-2], -1)

    return Way(solve, basis.at, basis.size, error_bars)


# The others are given our operator and functions, which their user would have to write first.


def _operator(case: Case) -> tuple[Array, Mask]:
    """M (R, N), and which readings (3, P) are its rows."""
    layout = case.scene.layout
    return layout.curvature_operator(case.fit.basis)[layout.live.ravel()], layout.live


def lstsq(case: Case) -> Way:
    """LAPACK's least squares, anew in each frame."""
    M, live = _operator(case)

    def solve(curvature: Array) -> Array:
        return cast("Array", np.linalg.lstsq(M, curvature[..., live].T)[0]).T

    return Way(solve, case.fit.basis.at, M.shape[1])


def pinv(case: Case) -> Way:
    """The pseudo-inverse, made once, and a product per frame."""
    M, live = _operator(case)
    inverse = np.linalg.pinv(M, rcond=max(M.shape) * np.finfo(float).eps).T  # as lstsq has it

    def solve(curvature: Array) -> Array:
        return curvature[..., live] @ inverse

    return Way(solve, case.fit.basis.at, M.shape[1])


def iterated(case: Case) -> Way:
    """LSQR with its usual tolerances, on columns of unit length."""
    M, live = _operator(case)
    length = column_lengths(M)
    A = M / length

    def solve(curvature: Array) -> Array:
        if curvature.ndim > 2:
            return np.stack([solve(frame) for frame in curvature])
        return cast("Array", lsqr(A, curvature[live])[0]) / length

    return Way(solve, case.fit.basis.at, M.shape[1])
