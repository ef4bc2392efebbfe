"""Functions that a shape is made of, by how the skin is held."""

from collections.abc import Callable

from kappaskin.bases.basis import Basis as Basis
from kappaskin.bases.basis import CurvatureMap as CurvatureMap
from kappaskin.bases.basis import ValueMap as ValueMap
from kappaskin.bases.product import SineBasis as SineBasis
from kappaskin.errors import Refusal
from kappaskin.patch import Patch

EDGES: dict[str, Callable[[Patch, int, int], Basis]] = {
    "hinged": SineBasis,
    "sliding": lambda patch, Ni, Nj: SineBasis(patch, Ni, Nj, sliding=True),
}
"""Ways to hold a skin, by name: hinged, with the ends of an arc pinned, or free to slide."""


def basis_for(patch: Patch, edge: str, Ni: int, Nj: int) -> Basis:
    """Ni x Nj functions for a skin that is held as `edge` says."""
    if edge not in EDGES:
        raise Refusal(f"expected an edge among {', '.join(EDGES)}; got {edge!r}")
    return EDGES[edge](patch, Ni, Nj)
