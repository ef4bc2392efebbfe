"""Bases: sets of functions on a skin that satisfy its boundary conditions."""

from collections.abc import Callable
from functools import partial

from kappaskin.bases.basis import ORDERS as ORDERS
from kappaskin.bases.basis import Basis as Basis
from kappaskin.bases.basis import CurvatureMap as CurvatureMap
from kappaskin.bases.basis import ValueMap as ValueMap
from kappaskin.bases.basis import covariant_at as covariant_at
from kappaskin.bases.basis import covariant_maps as covariant_maps
from kappaskin.bases.basis import curvature_at as curvature_at
from kappaskin.bases.basis import hoop_at as hoop_at
from kappaskin.bases.modes import CapBasis as CapBasis
from kappaskin.bases.modes import DiskBasis, PolygonBasis
from kappaskin.bases.modes import MeshBasis as MeshBasis
from kappaskin.bases.modes import ModeBasis as ModeBasis
from kappaskin.bases.modes import most_functions as most_functions
from kappaskin.bases.modes import radial as radial
from kappaskin.bases.product import ClampedBasis
from kappaskin.bases.product import ElasticBasis as ElasticBasis
from kappaskin.bases.product import ProductBasis as ProductBasis
from kappaskin.bases.product import SineBasis as SineBasis
from kappaskin.bases.product import gauss as gauss
from kappaskin.bases.product import overlaps as overlaps
from kappaskin.errors import Refusal
from kappaskin.skin import Cap, Disk, MeshSkin, Patch, Polygon

_Maker = Callable[[Patch, int, int], Basis]
_MAKERS: dict[type[Patch], dict[str, _Maker]] = {
    Patch: {
        "hinged": SineBasis,
        "sliding": partial(SineBasis, sliding=True),
        "clamped": ClampedBasis,
        "elastic": ElasticBasis,
        "cantilever": partial(ClampedBasis, tip=True),
    },
    Disk: {"hinged": DiskBasis, "clamped": partial(DiskBasis, clamped=True)},
    Cap: {"hinged": CapBasis, "clamped": partial(CapBasis, clamped=True)},
    MeshSkin: {"hinged": MeshBasis, "clamped": partial(MeshBasis, clamped=True)},
    Polygon: {"hinged": PolygonBasis, "clamped": partial(PolygonBasis, clamped=True)},
}

EDGES = tuple(_MAKERS[Patch])
"""Boundary conditions by name.

`hinged`, with the ends of an arc pinned; `sliding`, with these free to slide, and not of a shallow
skin; `clamped`, which fixes the slope too; `elastic`, a flat rectangle on an elastic rim;
`cantilever`, a flat strip clamped at x = 0 whose other end is free.
"""


def edges_of(patch: Patch) -> tuple[str, ...]:
    """The boundary conditions that `patch` can have, the default first."""
    barred = {"elastic"} if any(patch.curvatures) else set[str]()
    barred |= {"sliding"} if patch.is_shallow else set()
    barred |= set() if patch.strip and not patch.arc_curvature else {"cantilever"}
    return tuple(edge for edge in _MAKERS[type(patch)] if edge not in barred)


def check_edge(patch: Patch, edge: str) -> None:
    """Raise a `Refusal` for a boundary condition that `patch` cannot have."""
    if edge not in (edges := edges_of(patch)):
        raise Refusal(f"expected an edge of a {patch.name} among {', '.join(edges)}; got {edge!r}")


def has_free_tip(basis: Basis) -> bool:
    """Whether it is of a cantilever, which nothing holds at x = a."""
    return isinstance(basis, ClampedBasis) and basis.tip


def held_near(basis: Basis, x: float, y: float, within: float) -> list[tuple[float, float, float]]:
    """`Patch.near_rim` without the free tip of a cantilever."""
    places = basis.patch.near_rim(x, y, within)
    return [at for at in places if not (has_free_tip(basis) and at[0] > basis.patch.a / 2)]


def basis_for(patch: Patch, edge: str, Ni: int, Nj: int) -> Basis:
    """The basis of Ni x Nj functions for a patch with the boundary condition `edge`."""
    check_edge(patch, edge)
    return _MAKERS[type(patch)][edge](patch, Ni, Nj)
