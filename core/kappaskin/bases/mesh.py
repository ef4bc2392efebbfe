"""Functions on meshes: the softest shapes that loads all over the skin make, by finite elements."""

from functools import lru_cache, partial
from typing import Any, cast

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin._files import cached
from kappaskin._processes import progress
from kappaskin.bases.facets import Facets, Factored, held_freedoms
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.skin import MeshSkin

_LOADS = 2  # for each function
_WIDTH = 0.7  # of the distance between two loads: the standard deviation of one
_REPORTED = 48  # loads solved between two reports of progress
_SOLVED = 0.6  # of the time that functions take: solving
_USUAL = 225  # functions made at once, of which fewer are the first
_POISSON = 0.3  # of the skin whose shapes these are


def factored(
    mesh: MeshSkin, edge: str, rigidity: float, poisson: float, foundation: float = 0.0
) -> Factored:
    """The stiffness of a mesh on an `edge`, factored; `rigidity` and `foundation` over C in N/m."""
    of_sheet = (float(f"{value:.12g}") for value in (rigidity, poisson, foundation))
    return _factored(mesh, edge, *of_sheet)


@lru_cache(2)
def _factored(
    mesh: MeshSkin, edge: str, rigidity: float, poisson: float, foundation: float
) -> Factored:
    held = held_freedoms(mesh.held, edge, len(mesh.points))
    return Factored(stiffness(mesh, edge, rigidity, 1.0, poisson, foundation), held)


def stiffness(mesh: MeshSkin, edge: str, D: float, C: float, nu: float, k_f: float) -> Any:
    """Stiffness (6 n, 6 n) of a shell of D in N m, C in N/m, nu and a foam of k_f in N/m^3."""
    points = _with_ends_moved(mesh) if edge == "clamped" else mesh.points
    facets = Facets(points, mesh.triangles)
    K = facets.stiffness(D, C, nu)
    return K + facets.foundation(k_f) if k_f else K


# Where the clamped part of a rim ends, curvature grows without bound. Triangles there hold the skin
# as if that part went on by a quarter of its last side: its end is moved back as far.
_BEYOND = 0.25


def _with_ends_moved(mesh: MeshSkin) -> Array:
    """The nodes (n, 3) in m, the ends of held parts of the rim moved along it."""
    held = np.isin(mesh.rim, mesh.held)
    points = mesh.points.copy()
    for way in (1, -1):
        end = held & ~np.roll(held, way) & np.roll(held, -way)
        ends, inner = mesh.rim[end], np.roll(mesh.rim, -way)[end]
        points[ends] += _BEYOND * (mesh.points[inner] - mesh.points[ends])
    return points


def inward(mesh: MeshSkin) -> Array:
    """Unit vectors (n, 3) along which loads press at the nodes."""
    return -np.stack(np.broadcast_arrays(*mesh.base(*mesh.places.T).normal), axis=-1)


def pressed(mesh: MeshSkin, forces: Array) -> Array:
    """The forces (6 n, k) on all freedoms, of `forces` (n, k) along the normals, inward."""
    found = np.zeros((len(forces), 6, forces.shape[1]))
    found[:, :3] = inward(mesh)[:, :, None] * forces[:, None]
    return found.reshape(-1, forces.shape[1])


def along_normals(mesh: MeshSkin, moved: Array) -> Array:
    """The displacement inward (n, k) in m of displacements and rotations (6 n, k)."""
    fields = moved.reshape(len(mesh.points), 6, -1)
    return np.einsum("ni,nik->nk", inward(mesh), fields[:, :3])


class MeshFunctions:
    """The softest `count` combinations of what loads all over a mesh make, their mean square 1/4.

    Raises a `Refusal` for more functions than the mesh has nodes for.
    """

    def __init__(self, mesh: MeshSkin, edge: str, count: int) -> None:
        most = mesh.most_functions
        if count > most:
            raise Refusal(
                f"expected at most {most} functions on a mesh of {len(mesh.points)} nodes, got "
                f"{count}; use fewer, or smaller triangles"
            )
        total = max(count, min(_USUAL, most))
        made = cached(f"mesh {mesh.content} {edge} {total}", partial(_made, mesh, edge, total))
        self._mesh, self._edge = mesh, edge
        self._own = made["stiffness"][:count]
        self.values: Array = made["values"][:, :count].astype(float)
        """Spline coefficients (G, N) of the displacement inward."""
        fields = made["fields"].reshape(len(self.values), 6, -1)[:, :, :count]
        self._fields: Array = fields.reshape(len(fields), -1).astype(float)

    def stiffness(self, D: float, C: float, nu: float, k_f: float) -> Array:
        """Stiffness (N, N) in N/m of a shell of D in N m, C in N/m, Poisson's ratio and foam."""
        own = C * np.diag(self._own)
        if nu == _POISSON and not k_f and np.isclose(D / C, _rigidity(self._mesh), rtol=1e-9):
            return own
        K = stiffness(self._mesh, self._edge, D, C, nu, k_f)
        moved = _moved(self._mesh, self._edge, len(self._own))
        found = moved.T @ (K @ moved)
        return (found + found.T) / 2

    def curvature_at(self, positions: Array) -> Array:
        """Curvature xx, yy, xy (3, P, N) in 1/m per m of each function at `positions` (P, 2)."""
        designs = [self._mesh.splines.design(positions, *order) for order in ((1, 0), (0, 1))]
        shape = len(positions), 2, 3, len(self._own)
        derived = np.stack([(design @ self._fields).reshape(shape) for design in designs])
        return _read_of(self._mesh, positions, derived)

    def nodal_curvature(self, positions: Array) -> Array:
        """Curvature xx, yy, xy (3, P, 6 n) in 1/m at `positions` (P, 2), per m or rad at a node."""
        return _read_at_nodes(self._mesh, positions)

    def read_of_forces(self, rows: Array, rigidity: float, nu: float, k_f: float) -> Array:
        """What `rows` (R, 6 n) of freedoms give, (n, R), of a force of C in N inward at each node.

        On a shell of so much `rigidity` and foundation `k_f` over C, and Poisson's ratio nu.
        """
        # By Betti's theorem: the displacement under what the rows are.
        solve = factored(self._mesh, self._edge, rigidity, nu, k_f)
        return along_normals(self._mesh, solve(rows.T))


def _rigidity(mesh: MeshSkin) -> float:
    """D / C in m^2 of the skin whose shapes the functions are."""
    return mesh.thickness**2 / 12


def _shapes(mesh: MeshSkin, edge: str, count: int) -> tuple[Array, Array]:
    """Displacements and rotations (6 n, N) of each function, and its stiffness (N,) over C."""
    loads, area = _LOADS * count, mesh.areas.sum()
    middles = mesh.points[mesh.spread(loads)]
    squares = scipy.spatial.distance.cdist(mesh.points, middles, "sqeuclidean")
    forces = np.exp(-squares / (2 * _WIDTH**2 * area / loads)) * mesh.areas[:, None]
    felt = pressed(mesh, forces / forces.sum(axis=0))
    solve = factored(mesh, edge, _rigidity(mesh), _POISSON)
    moved = np.empty_like(felt)
    for k in range(0, loads, _REPORTED):
        progress.get()(_SOLVED * k / loads)
        moved[:, k : k + _REPORTED] = solve(felt[:, k : k + _REPORTED])
    progress.get()(_SOLVED)
    f = along_normals(mesh, moved)
    mass = 4 / area * (f.T * mesh.areas) @ f
    softest = cast("Any", scipy.linalg.eigh)(felt.T @ moved, mass, subset_by_index=(0, count - 1))
    return moved @ softest[1], softest[0]


@lru_cache(1)
def _moved(mesh: MeshSkin, edge: str, count: int) -> Array:
    total = max(count, min(_USUAL, mesh.most_functions))
    return _shapes(mesh, edge, total)[0][:, :count]


def _made(mesh: MeshSkin, edge: str, count: int) -> dict[str, NDArray[Any]]:
    moved, own = _shapes(mesh, edge, count)
    n = len(mesh.points)
    fields = moved.reshape(n, 2, 3, -1)
    turned = np.cross(fields[:, 1], -inward(mesh)[:, :, None], axis=1)
    both = np.stack([fields[:, 0], turned], axis=1).reshape(n, -1)
    values, splines = mesh.splines.fit(along_normals(mesh, moved)), mesh.splines.fit(both)
    found = {"stiffness": own, "values": values, "fields": splines}
    return {name: array.astype(np.float32) for name, array in found.items()}


# Gages back to back read half of what the strains at z and -z differ by, over z. With the outward
# normal n, tangents e_a and K_ab = e_a . D_b n, a displacement U that turns n by dn changes the
# strain at z to (1 + z K)^-1 (strain + z dK) (1 + z K)^-1, and that is
#     sym(e_a . D_b dn) - sym(K_ac D_c U . e_b).
def _read_of(mesh: MeshSkin, positions: Array, derived: Array) -> Array:
    """Curvature (3, P, N) of fields, by their derivatives along x and y (2, P, 2, 3, N).

    The fields are the displacement and how it turns the normal.
    """
    base = mesh.base(*positions.T)
    slopes = np.moveaxis(np.array(np.broadcast_arrays(*sum(base.slopes, ()))), 0, 1)
    along = np.einsum("pai,ipfcn->pafcn", slopes.reshape(-1, 2, 2), derived)
    inside = np.einsum("pbc,pafcn->pafbn", base.frame, along)
    xx, yy, xy = base.form
    K = np.moveaxis(np.array([[xx, xy], [xy, yy]]), 2, 0)
    found = inside[:, :, 1] - np.einsum("pac,pcbn->pabn", K, inside[:, :, 0])
    return np.stack([found[:, 0, 0], found[:, 1, 1], (found[:, 0, 1] + found[:, 1, 0]) / 2])


def _read_at_nodes(mesh: MeshSkin, positions: Array) -> Array:
    base, n = mesh.base(*positions.T), len(mesh.points)
    ways = [mesh.splines.at_places(mesh.splines.design(positions, *o)) for o in ((1, 0), (0, 1))]
    slopes = np.moveaxis(np.array(np.broadcast_arrays(*sum(base.slopes, ()))), 0, 1)
    along = np.einsum("pai,ipn->apn", slopes.reshape(-1, 2, 2), np.stack(ways))
    xx, yy, xy = base.form
    bent = np.einsum("acp,cpn->apn", np.array([[xx, xy], [xy, yy]]), along)
    tangents = np.moveaxis(base.frame, 1, 0)
    turned = np.swapaxes(np.cross(-inward(mesh)[None, :, None], tangents[:, None]), 1, 2)
    found = np.zeros((3, len(positions), n, 6))
    for row, pairs in zip(found, (((0, 0),), ((1, 1),), ((0, 1), (1, 0))), strict=True):
        for a, b in pairs:
            row[..., :3] -= bent[a][..., None] * tangents[b][:, None] / len(pairs)
            row[..., 3:] += along[a][..., None] * turned[b] / len(pairs)
    return found.reshape(3, len(positions), -1)


mesh_functions = lru_cache(4)(MeshFunctions)
"""The functions of a mesh, kept for those who ask again."""
