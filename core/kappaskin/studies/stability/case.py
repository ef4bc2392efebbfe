"""What a hard case is: a value that says what is hard, what is read and what is true.

Where a case does not say otherwise, 40 frames are read of a shape whose every function bends the
skin alike, by about 0.3 1/m, with Gaussian noise of the paper's 0.231 1/m; all seeded.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from kappaskin.bases import Basis, SineBasis
from kappaskin.frames import Array
from kappaskin.scenes import TABLE_1_NOISE
from kappaskin.sensing import SensorLayout

FRAMES = 40
"""Frames of a case, each with its own noise: an error bar is judged by all of them."""

SEED = 8
_BENDS = 0.3  # 1/m by each function: slopes are then too slight to matter


class Kind(Enum):
    """What a case asks of a method; which methods claim it follows."""

    ANY = "any method that takes the skin"
    LINEAR = "readings as a skin of slight slope gives them, to more digits than slopes allow"
    SLOPES = "readings of a skin with slopes near one"
    SEQUENCE = "more frames than a method that solves each anew is asked for"
    DENSE = "as many functions as dense algebra does quickly, but nothing slower"
    LARGE = "more functions than a dense matrix is made for"


@dataclass(frozen=True, eq=False)
class Case:
    """`curvature` (T, 3, P) in 1/m, read of the shape with coefficients `truth` in m.

    `truth` is (Ri, Rj), or (T, Ri, Rj) of a shape that moves, of the functions of `true_basis`.
    `hard` says in one sentence what is hard; `announced` why an answer may be less than exact, or
    none; empty where nothing excuses it.
    """

    name: str
    hard: str
    basis: Basis
    layout: SensorLayout
    true_basis: Basis
    truth: Array
    curvature: Array
    announced: str = ""
    kind: Kind = Kind.ANY

    @property
    def in_reach(self) -> bool:
        """Whether the functions that are fitted can be the truth."""
        return self.true_basis == self.basis


def case_of(
    name: str,
    hard: str,
    layout: SensorLayout,
    functions: tuple[int, int],
    *,
    announced: str = "",
    noise: float = TABLE_1_NOISE,
    kind: Kind = Kind.ANY,
    basis: Basis | None = None,
    true_basis: Basis | None = None,
    truth: Array | None = None,
    spoilt: Callable[[Array], Array] = lambda K: K,
) -> Case:
    """A case of `functions` on a `layout`; `spoilt` makes of clean, noisy readings what comes."""
    rng = np.random.default_rng(SEED)
    basis = SineBasis(layout.patch, *functions) if basis is None else basis
    true_basis = basis if true_basis is None else true_basis
    M = layout.curvature_operator(true_basis)
    c = _even(true_basis, M, rng) if truth is None else truth
    clean = np.dot(c.reshape(-1, true_basis.size), M.T).reshape(-1, 3, len(layout))
    frames = (FRAMES if len(clean) == 1 else len(clean)) if noise else 1
    K = clean + rng.normal(0.0, noise, (frames, 3, len(layout)))
    return Case(name, hard, basis, layout, true_basis, c, spoilt(K), announced, kind)


def _even(basis: Basis, M: Array, rng: np.random.Generator) -> Array:
    """Coefficients (Ni, Nj) of which each function that is free bends the skin alike."""
    W = np.eye(basis.size) if basis.free is None else basis.free
    A = M @ W
    length = np.linalg.norm(A, axis=0) / math.sqrt(len(A))
    length[length <= 1e-9 * length.max(initial=1.0)] = np.inf  # it would move without bending
    return (W @ (_BENDS * rng.normal(size=len(length)) / length)).reshape(basis.shape)
