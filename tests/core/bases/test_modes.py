"""Frequencies of plate modes, against closed forms, tables and another finite-element library.

A plate's frequency is the square root of a mode's bending energy per mean square, in 1/m^2; the
tables have it times the square of a length.
"""

import math
from functools import cache

import numpy as np
import pytest
import skfem
from scipy import linalg
from scipy.sparse.linalg import eigsh
from skfem.helpers import dd, ddot, dot, grad

from kappaskin import Disk, Patch, Plate, Polygon, basis_for

pytestmark = pytest.mark.slow

SIDE = 0.1
SQUARE = Polygon([(0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE)])
TRIANGLE = Polygon([(0, 0), (SIDE, 0), (SIDE / 2, SIDE * math.sqrt(3) / 2)])
HALF_SQUARE = Polygon([(0, 0), (SIDE, 0), (0, SIDE)])
HALF = SIDE / 2
L = Polygon([(0, 0), (SIDE, 0), (SIDE, HALF), (HALF, HALF), (HALF, SIDE), (0, SIDE)])


def regular(corners, radius):
    angle = 2 * np.pi * np.arange(corners) / corners
    points = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return Polygon(points - points.min(axis=0))


@cache
def energies(patch, edge, N=8):
    """The matrices (N^2, N^2) of the bending energy and of the mean square, times the area."""
    basis = basis_for(patch, edge, N, N)
    points, weights = basis.quadrature()
    xx, xy, yy, f = (basis.at(points, *order) for order in [(2, 0), (1, 1), (0, 2), (0, 0)])
    nu = 0.3 if isinstance(patch, Disk) else 0.0  # along straight edges it changes nothing

    def inner(u, v):
        return (u.T * weights) @ v

    mixed = inner(xx, yy)
    bending = inner(xx, xx) + inner(yy, yy) + nu * (mixed + mixed.T) + 2 * (1 - nu) * inner(xy, xy)
    return bending, inner(f, f)


def frequencies(patch, edge, N=8):
    """In 1/m^2, of each function by itself."""
    bending, squares = energies(patch, edge, N)
    return np.sqrt(np.diag(bending) / np.diag(squares))


MODES = [
    (patch, edge)
    for patch in (Disk(0.05), SQUARE, TRIANGLE, HALF_SQUARE, regular(6, 0.05), L)
    for edge in ("hinged", "clamped")
]


@pytest.mark.cases("patch0", "patch5", "patch8", "patch11")
@pytest.mark.parametrize(("patch", "edge"), MODES)
def test_modes_share_no_energy_and_come_in_the_order_of_their_frequencies(patch, edge):
    bending, _ = energies(patch, edge)
    scale = np.sqrt(np.diag(bending))

    shared = bending / np.multiply.outer(scale, scale)

    np.testing.assert_allclose(shared, np.eye(64), atol=1e-9)
    found = frequencies(patch, edge)
    assert np.all(np.diff(found) > -1e-9 * found[-1])


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_fewer_modes_of_a_disk_are_the_first_ones(edge):
    points = 0.05 + 0.03 * np.random.default_rng(0).uniform(-1, 1, (20, 2))

    few, many = (basis_for(Disk(0.05), edge, N, N).at(points) for N in (3, 8))

    np.testing.assert_allclose(few, many[:, :9], atol=1e-12)


# Closed forms: a convex polygon's hinged modes are a membrane's, of squared frequency.


def lowest(values, count=64):
    return np.sort(np.ravel(values))[:count]


i, j = np.indices((60, 60)) + 1
CLOSED = {
    "square": (SQUARE, np.pi**2 * lowest(i**2 + j**2)),
    "right isosceles": (HALF_SQUARE, np.pi**2 * lowest((i**2 + j**2)[i > j])),
    "equilateral": (TRIANGLE, 16 * np.pi**2 / 9 * lowest(i**2 + i * j + j**2)),
}


@pytest.mark.parametrize("name", CLOSED)
def test_hinged_polygons_have_a_membranes_frequencies_squared(name):
    patch, expected = CLOSED[name]

    found = frequencies(patch, "hinged") * SIDE**2

    error = found / expected - 1
    assert error.min() > -1e-9  # within the energy's space nothing is lower
    assert error[0] < 2e-6
    assert error[:16].max() < 2e-4
    assert error.max() < 0.006


def test_sine_products_are_sums_of_the_hinged_squares_modes():
    basis = basis_for(SQUARE, "hinged", 8, 8)
    points, weights = basis.quadrature()
    root = np.sqrt(weights)[:, None]
    sines = basis_for(Patch(SIDE, SIDE), "hinged", 3, 3).at(points)

    c = np.linalg.lstsq(root * basis.at(points), root * sines)[0]

    left = np.linalg.norm(root * (sines - basis.at(points) @ c), axis=0)
    assert left.max() < 5e-4 * np.linalg.norm(root * sines, axis=0).min()


def test_a_hinged_equilateral_triangle_sags_by_the_closed_form_under_pressure():
    """By q h^4 / (972 D) at its centre, h its height (Woinowsky-Krieger)."""
    basis, plate, q = basis_for(TRIANGLE, "hinged", 10, 10), Plate(TRIANGLE), 40.0
    points, weights = basis.quadrature()

    c = plate.compliance(basis)(q * (weights @ basis.at(points)).reshape(basis.shape))

    sag = float(basis.jet(SIDE / 2, TRIANGLE.b / 3)[0] @ c.ravel())
    assert sag == pytest.approx(q * TRIANGLE.b**4 / (972 * plate.rigidity), rel=1e-4)


# Tables: Leissa's Vibration of plates, NASA SP-160, with one digit more for the square.

TABLES = {
    "clamped disk": (
        Disk(SIDE),
        "clamped",
        [10.2158, 21.26, 21.26, 34.88, 34.88, 39.771],
        1e-4,
    ),
    "hinged disk": (
        Disk(SIDE),
        "hinged",
        [4.935, 13.898, 13.898, 25.613, 25.613, 29.720],
        5e-5,
    ),
    "clamped square": (SQUARE, "clamped", [35.985, 73.394, 73.394, 108.22, 131.58, 132.21], 5e-5),
}


@pytest.mark.parametrize("name", TABLES)
def test_frequencies_are_those_of_the_tables(name):
    patch, edge, expected, digits = TABLES[name]

    found = frequencies(patch, edge)[:6] * SIDE**2

    np.testing.assert_allclose(found, expected, rtol=digits)


def test_clamped_beams_products_make_the_clamped_squares_modes():
    found = linalg.eigh(*energies(Patch(SIDE, SIDE), "clamped", 12), eigvals_only=True)[:6]

    np.testing.assert_allclose(np.sqrt(found), frequencies(SQUARE, "clamped")[:6], rtol=2e-4)


def test_a_clamped_polygon_of_many_corners_is_nearly_a_clamped_disk():
    disk, polygon = (frequencies(p, "clamped")[:6] for p in (Disk(0.05), regular(48, 0.05)))

    np.testing.assert_allclose(polygon, disk, rtol=0.01)


# Another library


@skfem.BilinearForm
def bending(u, v, _):
    return ddot(dd(u), dd(v))


@skfem.BilinearForm
def stretching(u, v, _):
    return dot(grad(u), grad(v))


@skfem.BilinearForm
def squares(u, v, _):
    return u * v


def eigenvalues(basis, form, held, count):
    free = np.setdiff1d(np.arange(basis.N), held)
    K, M = (f.assemble(basis)[free][:, free].tocsc() for f in (form, squares))
    found = eigsh(K, count, M, sigma=0, v0=np.ones(len(free)), return_eigenvectors=False)
    return np.sort(found)


def test_a_hinged_hexagon_has_the_membranes_frequencies_squared():
    """Its curvature at the corners has no bound: the mesh must be fine there."""
    radius = 0.05
    angle = np.pi / 3 * np.arange(6)
    points = radius * np.vstack([[0, 0], np.column_stack([np.cos(angle), np.sin(angle)])])
    fan = [(0, k, k % 6 + 1) for k in range(1, 7)]
    mesh = skfem.MeshTri(points.T, np.array(fan).T).refined(4)
    basis = skfem.Basis(mesh, skfem.ElementTriP2())
    expected = eigenvalues(basis, stretching, basis.get_dofs().flatten(), 6)

    found = frequencies(regular(6, radius), "hinged")[:6]

    np.testing.assert_allclose(found, expected, rtol=5e-4)


@cache
def l_by_skfem(edge):
    """Frequencies of the L by another library, its mesh halved ten times towards the corner."""
    mesh = skfem.MeshTri.init_lshaped().refined(2)
    for _ in range(10):
        mesh = mesh.refined(np.flatnonzero(np.abs(mesh.p[:, mesh.t]).max(axis=0).min(axis=0) == 0))
    basis = skfem.Basis(mesh, skfem.ElementTriArgyris(), intorder=10)
    held = list[int]()
    for facet in mesh.boundary_facets():
        ends = mesh.facets[:, facet]
        level = np.ptp(mesh.p[1, ends]) == 0
        for w, wx, wy, wxx, wxy, wyy in basis.nodal_dofs[:, ends].T:
            held += [w, wx, wxx] if level else [w, wy, wyy]
            held += [wx, wy, wxy] if edge == "clamped" else []
        held += [basis.facet_dofs[0, facet]] if edge == "clamped" else []
    return np.sqrt(eigenvalues(basis, bending, held, 6)) * (2 / SIDE) ** 2


@pytest.mark.cases("hinged")
@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_an_l_has_another_librarys_frequencies(edge):
    found = frequencies(L, edge)[:6]

    np.testing.assert_allclose(found, l_by_skfem(edge), rtol=5e-3)
