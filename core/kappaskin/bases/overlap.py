"""Integrals over the skin of the functions of a basis: what energies and masses are made of."""

from collections.abc import Callable
from functools import cache

from kappaskin.bases.basis import Basis, Order
from kappaskin.bases.product import ProductBasis
from kappaskin.frames import Array

Overlaps = Callable[[Order, Order], Array]


def overlaps(basis: Basis) -> Overlaps:
    """Tells the integrals (N, N) of one derivative of each function times another of each."""
    if isinstance(basis, ProductBasis):
        return basis.overlap
    points, weights = basis.quadrature()

    @cache
    def at(order: Order) -> Array:
        return basis.at(points, *order)

    return lambda one, other: (at(one).T * weights) @ at(other)
