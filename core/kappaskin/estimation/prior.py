"""What shapes to expect before any reading: a basis to the covariance of its coefficients."""

from typing import cast

import numpy as np

from kappaskin.bases import Basis, SineBasis
from kappaskin.frames import Array
from kappaskin.mechanics import Plate


def prior_root(basis: Basis) -> Array:
    """L (N, F), L L' the covariance of the coefficients in m^2 of a plate under a white load.

    White means that the load at one place tells nothing of that at another: with G the Gram matrix
    of the functions its modal forces have the covariance G, and the plate of compliance C answers
    with C G C. L spans what the edges leave `basis.free`, F of N directions: shapes that no reading
    sees are left out. Scaled so that the displacement's RMS over the skin is 1 m.

    For sines on a flat skin it is the diagonal of 1 / (k_i^2 + k_j^2)^2, so scaled.
    """
    if isinstance(basis, SineBasis) and not basis.patch.base_curvature:
        # The squares of sines average 1/2, along x and along y.
        sd: Array = 1 / basis.laplacian.ravel() ** 2
        squares = sd @ sd / (2 if basis.patch.strip else 4)
        return np.diag(sd / np.sqrt(squares))
    points, weights = basis.quadrature()
    f = np.sqrt(weights / weights.sum())[:, None] * basis.at(points)
    # With f = Q R, G = R'R and C R' is a root of C G C; R C R' is one of the displacement's.
    R = _triangle(f)
    root = _on_free(basis, Plate(basis.patch).compliance(basis).after(R).T)
    return root / np.linalg.norm(R @ root)


def _on_free(basis: Basis, root: Array) -> Array:
    """The part of a covariance's `root` (N, N) on the free combinations, as a root (N, F)."""
    W = np.eye(basis.size) if basis.free is None else basis.free
    V = W if basis.unseen is None else np.hstack([W, basis.unseen])
    share = cast("Array", np.linalg.lstsq(V, root)[0])[: W.shape[1]]
    return W @ _triangle(share.T).T


def _triangle(A: Array) -> Array:
    """The triangular R of A = Q R: a root, R'R = A'A."""
    return cast("Array", np.linalg.qr(A, mode="r"))
