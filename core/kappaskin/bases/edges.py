"""Boundary conditions: how the edges of a skin are held, and the basis for each."""

from collections.abc import Callable
from functools import partial

from kappaskin.bases.basis import Basis
from kappaskin.bases.modes import DiskBasis, PolygonBasis
from kappaskin.bases.product import ClampedBasis, ElasticBasis, SineBasis
from kappaskin.errors import Refusal
from kappaskin.skin import Disk, Patch, Polygon

_Maker = Callable[[Patch, int, int], Basis]
_MAKERS: dict[type[Patch], dict[str, _Maker]] = {
    Patch: {
        "hinged": SineBasis,
        "sliding": partial(SineBasis, sliding=True),
        "clamped": ClampedBasis,
        "elastic": ElasticBasis,
    },
    Disk: {"hinged": DiskBasis, "clamped": partial(DiskBasis, clamped=True)},
    Polygon: {"hinged": PolygonBasis, "clamped": partial(PolygonBasis, clamped=True)},
}

EDGES = tuple(_MAKERS[Patch])
"""Ways to hold a skin, by name.

Hinged, with the ends of an arc pinned, or free to slide; clamped, which holds the slope too; or
elastic, a flat rectangle's rim that gives.
"""


def edges_of(patch: Patch) -> tuple[str, ...]:
    """The ways to hold `patch`, the usual one first."""
    return tuple(e for e in _MAKERS[type(patch)] if not (patch.base_curvature and e == "elastic"))


def check_edge(patch: Patch, edge: str) -> None:
    """Refuse an edge that `patch` cannot have."""
    if edge not in (edges := edges_of(patch)):
        raise Refusal(f"expected an edge of a {patch.name} among {', '.join(edges)}; got {edge!r}")


def basis_for(patch: Patch, edge: str, Ni: int, Nj: int) -> Basis:
    """Ni x Nj functions for a skin that is held as `edge` says."""
    check_edge(patch, edge)
    return _MAKERS[type(patch)][edge](patch, Ni, Nj)
