"""Products of clamped beams' modes: the shapes of a skin whose edges hold its slope too."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from kappaskin.bases.product import JetProductBasis
from kappaskin.errors import Refusal
from kappaskin.frames import Array


@dataclass(frozen=True)
class ClampedBasis(JetProductBasis):
    """The Ni x Nj products of the modes of clamped beams: zero along the edges, with their slope.

    Between the edges they are nearly sines, so that elements at cell centres tell them apart as
    well; a smooth shape's coefficients fall as 1/k^5, its curvature converges as N^(-5/2). Their
    mean square is a sine's, 1/2 along each side. A bent skin is inextensible: f has no mean along
    the arc.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.patch.base_curvature and self.Ni < 2:
            raise Refusal(
                "a clamped inextensible arc cannot bend in its first function alone: expected at "
                "least 2 functions along x, got 1"
            )

    @property
    def free(self) -> Array | None:
        """On an arc, that the mean along x vanishes leaves Ni - 1 of Ni."""
        return self._inextensible if self.patch.base_curvature else None

    @cached_property
    def _inextensible(self) -> Array:
        ends = self._along_x(np.array([0.0, self.patch.a]), -1)
        return self._without_mean(ends[1] - ends[0])

    def _along(self, x: Array, length: float, count: int, derivative: int) -> Array:
        s, ends = x / length - 0.5, np.array([-0.5, 0.5])
        values = _beam(s, count, derivative)[0]
        if derivative < 0:
            middle = _beam(ends, count, -1)[0].mean(axis=0)
            if derivative == -1:
                values -= middle
            else:
                third = _beam(ends, count, -3)[0]
                values -= np.multiply.outer(s, middle) + third[1] - third[0]
        return values * length**-derivative

    def _jet(self, x: float, length: float, count: int) -> Array:
        jet = _beam(np.array([x / length - 0.5]), count, 0, 1, 2)[:, 0]
        jet[1] /= length
        jet[2] /= length**2
        return jet


def _beam(s: Array, count: int, *orders: int) -> Array:
    """The derivatives (O, S, N) of the first `count` modes of a clamped beam of length 1.

    With `s` (S,) from -1/2 to 1/2, even ones are cos(k s)/cos(k/2) - cosh(k s)/cosh(k/2), odd ones
    the same with sin and sinh, over sqrt(2); cosh and sinh as decaying exponentials from either
    end, so that nothing overflows or cancels.
    """
    modes = _modes(count, orders)
    ks, half = np.multiply.outer(s, modes.k), modes.k / 2
    wave = modes.waves * np.sin(ks + modes.phases)
    return wave - modes.decays * (np.exp(ks - half) + modes.far * np.exp(-ks - half))


@dataclass(frozen=True, eq=False)
class _Modes:
    """Wave numbers k (N,); phases and factors (O, 1, N) of the waves, the decays and far ends."""

    k: Array
    phases: Array
    waves: Array
    decays: Array
    far: Array


@lru_cache(64)
def _modes(count: int, orders: tuple[int, ...]) -> _Modes:
    """What the derivatives of `orders` share; k are the roots of cos k cosh k = 1 above zero."""
    k = (np.arange(1.0, count + 1) + 0.5) * np.pi  # nearly: Newton's method does the rest
    for _ in range(4):
        sech = 2 * np.exp(-k) / (1 + np.exp(-2 * k))
        k -= (np.cos(k) - sech) / (sech * np.tanh(k) - np.sin(k))
    d = np.array(orders, float)[:, None, None]
    sign = np.where(np.arange(count) % 2, -1.0, 1.0)
    phase, scale = (1 + sign) * np.pi / 4, k**d / np.sqrt(2)
    return _Modes(
        k,
        phase + d * np.pi / 2,
        scale / np.sin(k / 2 + phase),
        scale / (1 + sign * np.exp(-k)),
        sign * (-1.0) ** d,
    )
