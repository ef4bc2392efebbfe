"""Stretching: von Karman's plate against published numbers, displacements, and its own laws."""

import numpy as np
import pytest

from kappaskin import DiscLoad, Patch, Plate, PointLoad, Refusal, SineBasis
from kappaskin.bases import basis_for
from kappaskin.mechanics import RectangleLoad, Stretching
from kappaskin.skin import Disk

H = 0.25e-3
INPLANE = ("held", "diaphragm", "free")
SQUARE = Patch(0.1, 0.1)


def sheet(inplane="held", patch=SQUARE, **more):
    return Plate(patch, thickness=H, inplane=inplane, **more)


def some_deflection(basis, seed=0):
    i, j = np.arange(1, basis.Ni + 1), np.arange(1, basis.Nj + 1)
    random = np.random.default_rng(seed).standard_normal(basis.shape)
    return 4 * H * random / np.add.outer(i**2, j**2)


# Against what others found


def test_a_held_plate_under_uniform_pressure_deflects_as_levy_found():
    nu, E, a = 0.316, 2e9, SQUARE.a
    plate = Plate.of_material(SQUARE, E, nu, H)
    pressure = 12.1 * E * H**4 / a**4
    basis = SineBasis(SQUARE, 9, 9)

    c = Stretching(plate, basis).deflection([RectangleLoad(a / 2, a / 2, a, a, pressure * a**2)])

    assert basis.value(a / 2, a / 2, c) / H == pytest.approx(0.422, abs=5e-4)


def displaced_energy(basis, q, plate, count):
    """The membrane energy by displacements u, v in `count` x `count` polynomials: from above."""
    E, nu, (a, b) = plate.modulus(H), plate.poisson, (plate.patch.a, plate.patch.b)
    t, w = np.polynomial.legendre.leggauss(60)
    x, y = (t + 1) * a / 2, (t + 1) * b / 2
    wx, wy = (basis.on_grid(x, y, *o)(q).T.ravel() for o in ((1, 0), (0, 1)))
    area = np.sqrt(np.multiply.outer(w * a / 2, w * b / 2)).ravel()
    P = np.polynomial.Legendre.basis
    full = [P(k) for k in range(count)]
    zero = [P(k) * (1 - P(1) ** 2) for k in range(count)]
    u, v = {
        "held": ((zero, zero), (zero, zero)),
        "diaphragm": ((full, zero), (zero, full)),
        "free": ((full, full), (full, full)),
    }[plate.inplane]

    def derivatives(functions, dx, dy):
        in_x = np.stack([f.deriv(dx)(t) * (2 / a) ** dx for f in functions[0]])
        in_y = np.stack([f.deriv(dy)(t) * (2 / b) ** dy for f in functions[1]])
        return np.einsum("kx,ly->xykl", in_x, in_y).reshape(60 * 60, -1)

    ux, uy, vx, vy = (derivatives(f, *o) for f in (u, v) for o in ((1, 0), (0, 1)))
    C = E * H / (1 - nu**2)
    whole, part = np.sqrt(C * (1 + nu) / 2) * area, np.sqrt(C * (1 - nu) / 2) * area
    ex, ey, shear = wx**2 / 2, wy**2 / 2, wx * wy
    # The energy is half a sum of squares.
    M = np.vstack([
        whole[:, None] * np.hstack([ux, vy]),
        part[:, None] * np.hstack([ux, -vy]),
        part[:, None] * np.hstack([uy, vx]),
    ])  # fmt: skip
    r = np.concatenate([whole * (ex + ey), part * (ex - ey), part * shear])
    return np.sum((r - M @ np.linalg.lstsq(M, r, rcond=1e-13)[0]) ** 2) / 2


@pytest.mark.cases("hinged-held", "clamped-free", "hinged-diaphragm")
@pytest.mark.parametrize("inplane", INPLANE)
@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_displacements_in_the_plane_give_the_same_energy(inplane, edge):
    plate = sheet(inplane, Patch(0.1, 0.07))
    basis = basis_for(plate.patch, edge, 3, 3)
    q = some_deflection(basis)

    energy = np.vdot(q, Stretching(plate, basis).force(q)) / 4

    above = displaced_energy(basis, q, plate, 17)
    assert energy == pytest.approx(above, rel=2e-3)
    assert energy < above * (1 + 1e-6)  # Airy's function comes from below


def test_a_strip_between_held_ends_is_a_cable_in_its_first_mode():
    patch = Patch(0.1, 0.02, strip=True)
    plate, basis, w = sheet(patch=patch), SineBasis(patch, 5, 1), 2e-3
    q = np.zeros(basis.shape)
    q[0] = w
    k = np.pi / patch.a
    tension = plate.modulus(H) * H / (1 - plate.poisson**2) * (k * w) ** 2 / 4

    force = Stretching(plate, basis).force(q)

    np.testing.assert_allclose(force[0, 0], tension * k**2 * w * patch.a * patch.b / 2, rtol=1e-12)
    np.testing.assert_allclose(force[1:], 0, atol=1e-12 * force[0, 0])
    assert not Stretching(sheet("diaphragm", patch), basis).force(q).any()


def test_how_the_edge_is_held_matters_as_published():
    basis = SineBasis(SQUARE, 13, 13)
    force = 32.1 * 3.7e-3 * H / SQUARE.a**2

    def pressed(inplane, times):
        load = [PointLoad(0.05, 0.05, force * times)]
        c = Stretching(sheet(inplane), basis).deflection(load)
        return basis.value(0.05, 0.05, c) / H

    assert pressed("held", 1) == pytest.approx(0.334, rel=2e-3)
    assert pressed("diaphragm", 1) == pytest.approx(0.353, rel=4e-3)
    assert pressed("held", 3.99) == pytest.approx(0.871, rel=2e-3)
    assert pressed("held", 13.23) == pytest.approx(1.593, rel=2e-3)
    assert pressed("free", 13.23) > pressed("diaphragm", 13.23) > 1.98


# Laws


@pytest.mark.parametrize("inplane", INPLANE)
@pytest.mark.parametrize(
    ("edge", "radius"),
    [
        *(("hinged", np.inf), ("clamped", np.inf), ("elastic", np.inf)),
        *(("hinged", (3, 4)), ("clamped", (1, -2))),
    ],
)
def test_the_tangent_is_the_derivative_of_the_force(inplane, edge, radius):
    plate = sheet(inplane, Patch(0.1, 0.08, radius))
    basis = basis_for(plate.patch, edge, 6, 5)
    stretching, q, dq = Stretching(plate, basis), *(some_deflection(basis, s) for s in (0, 1))

    step = 1e-4
    difference = (stretching.force(q + step * dq) - stretching.force(q - step * dq)) / (2 * step)

    K = stretching.tangent(q)
    expected = (K @ dq.ravel()).reshape(basis.shape)
    np.testing.assert_allclose(difference, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(K, K.T, rtol=0, atol=1e-10 * np.abs(K).max())


def test_the_force_is_of_the_third_degree_and_odd():
    stretching = Stretching(sheet(), SineBasis(SQUARE, 6, 5))
    q = some_deflection(stretching.basis)

    np.testing.assert_allclose(stretching.force(-2 * q), -8 * stretching.force(q), rtol=1e-10)


@pytest.mark.parametrize("edge", ["hinged", "clamped", "elastic"])
@pytest.mark.parametrize("inplane", INPLANE)
@pytest.mark.parametrize("force", [0.0, 1e-6, 0.1, 10.0])
def test_bending_and_stretching_together_carry_the_load(edge, inplane, force):
    plate = sheet(inplane, fluid=True, tension=1.0)
    basis, load = basis_for(SQUARE, edge, 7, 7), DiscLoad(0.04, 0.05, 0.005, force)
    stretching = Stretching(plate, basis)

    c = stretching.deflection([load])

    left = plate.compliance(basis)(load.modal(basis) - stretching.force(c))
    np.testing.assert_allclose(left, c, rtol=0, atol=1e-6 * np.abs(c).max())


def test_a_light_touch_stretches_nothing():
    basis, load = SineBasis(SQUARE, 8, 8), [PointLoad(0.03, 0.06, 1e-5)]

    c = Stretching(sheet(), basis).deflection(load)

    linear = sheet().deflection(load, basis)
    np.testing.assert_allclose(c, linear, rtol=0, atol=1e-4 * np.abs(linear).max())


@pytest.mark.parametrize("inplane", INPLANE)
def test_the_search_may_start_anywhere(inplane):
    basis = SineBasis(SQUARE, 8, 8)
    walked, modal = Stretching(sheet(inplane), basis), PointLoad(0.03, 0.06, 0.5).modal(basis)

    for share in (0.01, 1.0, 0.0, -1.0, 0.99, 1.0):
        found = walked(share * modal)

    at_once = Stretching(sheet(inplane), basis)(modal)
    np.testing.assert_allclose(found, at_once, rtol=0, atol=1e-6 * np.abs(at_once).max())


@pytest.mark.parametrize(
    ("plate", "edge"),
    [
        (Plate(SQUARE), "hinged"),
        (sheet(patch=Patch(0.04, 0.03, 0.0129), inplane="hoop"), "hinged"),
        (sheet(patch=Disk(0.05)), "hinged"),
    ],
    ids=["no thickness", "bent", "disk"],
)
def test_only_flat_rectangles_of_known_thickness_stretch(plate, edge):
    with pytest.raises(Refusal, match="flat rectangular plate or strip whose thickness is given"):
        Stretching(plate, basis_for(plate.patch, edge, 4, 4))


def test_a_plate_of_another_patch_is_refused():
    with pytest.raises(Refusal, match="use one"):
        Stretching(sheet(), SineBasis(Patch(0.1, 0.08), 4, 4))


def test_a_cantilever_is_not_stretched_as_it_bends():
    strip = Plate(Patch(0.1, 0.02, strip=True), thickness=0.25e-3)
    for edge, stretched in (("cantilever", False), ("clamped", True)):
        basis = basis_for(strip.patch, edge, 6, 1)

        force = Stretching(strip, basis).force(np.full((6, 1), 1e-3))

        assert bool(np.abs(force).max() > 1.0) == stretched
        assert stretched or not force.any()


# Shallow skins


DOME = Patch(0.1, 0.08, (3, 4))


def test_a_light_touch_finds_a_shallow_skin_linear():
    basis, load = SineBasis(DOME, 8, 8), [PointLoad(0.03, 0.06, 1e-5)]

    c = Stretching(Plate(DOME), basis).deflection(load)

    linear = Plate(DOME).deflection(load, basis)
    np.testing.assert_allclose(c, linear, rtol=0, atol=1e-3 * np.abs(linear).max())


@pytest.mark.parametrize("sign", [-1, 1])
def test_on_its_path_a_shallow_skin_carries_the_load_that_finds_it_there(sign):
    basis, depths = SineBasis(DOME, 7, 7), sign * H * np.array([0.5, 1])
    modal = PointLoad(0.04, 0.04).modal(basis)
    stretching = Stretching(Plate(DOME), basis)

    path = list(stretching.path(modal, depths))

    assert np.vdot(modal, path[-1][1]) == pytest.approx(depths[-1])
    for force, c in path:
        found = stretching(force * modal)
        np.testing.assert_allclose(found, c, rtol=0, atol=1e-4 * np.abs(c).max())


def test_pressed_in_a_dome_softens_and_pulled_out_it_stiffens():
    basis = SineBasis(DOME, 7, 7)
    modal, stretching = PointLoad(0.05, 0.04).modal(basis), Stretching(Plate(DOME), basis)

    (out, _), (slightly_out, _) = (next(stretching.path(modal, [d * H])) for d in (-1, -0.01))
    (slightly_in, _), (far_in, _) = (next(stretching.path(modal, [d * H])) for d in (0.01, 1))

    assert out / slightly_out > 150
    assert far_in / slightly_in < 65


def test_the_path_of_a_saddle_ends_where_it_snaps_through_that_of_a_flat_skin_does_not():
    depths = H * np.arange(0.5, 5, 0.5)
    for plate, ends in ((Plate(Patch(0.1, 0.1, (1, -3))), True), (sheet(), False)):
        basis = SineBasis(plate.patch, 9, 9)
        path = list(Stretching(plate, basis).path(PointLoad(0.05, 0.05).modal(basis), depths))
        assert (len(path) < len(depths)) == ends
        assert len(path) > 2
