"""How well the elements see each shape: singular values, and the shapes that belong to them."""

from typing import cast

import numpy as np
from scipy import linalg

from kappaskin.bases import Basis
from kappaskin.estimation.estimator import column_lengths
from kappaskin.frames import Array
from kappaskin.sensing import SensorLayout


def singular_values(basis: Basis, layout: SensorLayout) -> tuple[Array, Array]:
    """How much is read of each of F shapes, (F,), the best seen first; the shapes (F, Ni, Nj) in m.

    The singular values are those of M W of the live readings, its columns scaled to unit length:
    the first over the last is `LeastSquares.condition`. Where the readings do not decide all
    coefficients the last values are zero, or rounding, and any mixture of the last shapes leaves
    the readings as they are; the rigid motions of a rim that gives are among them. Each shape is
    scaled so that the squares of its coefficients add up to 1 m^2.
    """
    W = np.eye(basis.size) if basis.free is None else basis.free
    M_W = layout.curvature_operator(basis)[layout.live.ravel()] @ W
    length = column_lengths(M_W)
    A, back = M_W / length, W / np.where(np.isfinite(length), length, 1.0)
    R = cast("tuple[Array]", linalg.qr(A, mode="r"))[0][: A.shape[1]] if len(A) else A
    _, s, Vt = linalg.svd(R) if len(A) else (None, np.empty(0), np.eye(A.shape[1]))
    values = np.concatenate([s, np.zeros(A.shape[1] - len(s))])
    shapes = (back @ Vt.T).T
    if basis.unseen is not None:
        values = np.concatenate([values, np.zeros(basis.unseen.shape[1])])
        shapes = np.vstack([shapes, basis.unseen.T])
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    return values, shapes.reshape(len(shapes), *basis.shape)
