"""A skin bent along x as a shell: against its full energy, the arc, the flat plate, geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import legendre

from kappaskin import (
    GaussianLoad,
    LeastSquares,
    LineLoad,
    Patch,
    Plate,
    PointLoad,
    Refusal,
    SensorLayout,
    SineBasis,
    basis_for,
)
from kappaskin.bases import hoop_at
from kappaskin.mechanics import Shell

R = 12.9e-3
ARC = math.pi * R
THIN = {"E": 3e9, "nu": 0.3, "h": 1e-4}


class Full:
    """Sanders' and Koiter's shell with u, v and w unknown, by Legendre polynomials; no library.

    All of its fields go as sin(q y) or cos(q y), q = j pi/b: one problem in x for every j. The
    edges along x = 0 and a are hinged, hold v and let u go.
    """

    def __init__(self, patch, E, nu, h, degree=26):
        self.patch, self.degree, self.nu = patch, degree, nu
        self.D = E * h**3 / (12 * (1 - nu**2))
        C = E * h / (1 - nu**2)
        self.C_x, self.C_y, self.C_xy, self.C_s = C, C, nu * C, C * (1 - nu) / 2
        t, weights = np.polynomial.legendre.leggauss(2 * degree + 20)
        self.x, self.weights = (t + 1) * patch.a / 2, weights * patch.a / 2
        self.f = [self.polynomials(self.x, order, held=True) for order in range(3)]
        self.u = [self.polynomials(self.x, order, held=False) for order in range(2)]

    def polynomials(self, x, derivative, held):
        t, n = 2 * x / self.patch.a - 1, self.degree + 2 * held
        P = [legendre.legval(t, legendre.legder(np.eye(n)[i], derivative)) for i in range(n)]
        P = np.column_stack(P) * (2 / self.patch.a) ** derivative
        return P[:, 2:] - P[:, :-2] if held else P  # those that vanish at both ends

    def deflection(self, j, load, x):
        """w at `x` (P,), over sin(q y), under the load's part `load` (X,) per metre in x."""
        H, q, nu = 1 / self.patch.radius, j * math.pi / self.patch.b, self.nu
        (f, fx, fxx), (v, vx, _), (u, ux) = self.f, self.f, self.u
        n, no = f.shape[1], np.zeros_like

        def product(left, right):
            return (np.hstack(left).T * self.weights) @ np.hstack(right)

        # f is inward; f, v go as sin(q y), u as cos(q y).
        eps_x, eps_y = (-H * f, vx, no(u)), (no(f), no(v), -q * u)
        gamma = no(f), q * v, ux
        xx, yy = (fxx, H * vx, no(u)), (-(q**2) * f, no(v), no(u))
        xy = q * fx, 3 / 4 * H * q * v, -H / 4 * ux
        K = self.C_x * product(eps_x, eps_x) + self.C_y * product(eps_y, eps_y)
        K += self.C_xy * (product(eps_x, eps_y) + product(eps_y, eps_x))
        K += self.C_s * product(gamma, gamma)
        bending = product(xx, xx) + product(yy, yy) + nu * (product(xx, yy) + product(yy, xx))
        K += self.D * (bending + 2 * (1 - nu) * product(xy, xy))
        work = np.append(f.T @ (self.weights * load), np.zeros(len(K) - n))
        scale = 1 / np.sqrt(np.diag(K) + 1e-30)
        A = K * np.outer(scale, scale) * self.patch.b / 2
        # u = const. costs nothing: least squares leaves it out.
        answer = scale * np.linalg.lstsq(A, scale * work, rcond=1e-15)[0]
        return self.polynomials(x, 0, held=True) @ answer[:n]

    def under(self, load, at, highest):
        """Deflection at the point `at` under a Gaussian load, summed over j up to `highest`."""
        along = np.exp(-((self.x - load.x) ** 2) / (2 * load.sd**2))
        along *= load.force / (self.weights @ along)
        total = 0.0
        for j in range(1, highest + 1):
            q = j * math.pi / self.patch.b
            felt = math.sin(q * load.y) * math.exp(-((q * load.sd) ** 2) / 2)
            total += self.deflection(j, felt * along, at[:1])[0] * math.sin(q * at[1])
        return total


def deflection_at(plate, load, at, functions, sliding=False):
    basis = SineBasis(plate.patch, *functions, sliding=sliding)
    return basis.at(np.asarray(at)[None])[0] @ plate.deflection([load], basis).ravel()


# The full energy


FINGERTIP = Patch(ARC, 0.03, R)


@pytest.mark.cases("0.0001-1.0", "0.00025-0.5")
@pytest.mark.parametrize("width", [1.0, 0.5])
@pytest.mark.parametrize("h", [1e-4, 2.5e-4])
def test_sines_converge_to_the_full_shell(width, h):
    patch = Patch(ARC, width * ARC, R)
    load, at = (
        GaussianLoad(0.45 * ARC, 0.5 * patch.b, ARC / 18),
        np.array([0.5 * ARC, 0.4 * patch.b]),
    )
    plate = Plate.of_material(patch, 3e9, 0.3, h)

    full = Full(patch, 3e9, 0.3, h, degree=40).under(load, at, 21)

    off = [deflection_at(plate, load, at, (n, 21)) / full - 1 for n in (12, 24, 36)]
    assert abs(off[0]) < 0.02
    assert abs(off[1]) < 1e-4
    assert abs(off[2]) < 4e-6


def test_the_full_shell_gives_back_naviers_flat_plate():
    """The oracle itself, where it has a closed form."""
    flat = Patch(0.1, 0.06, 1e5)
    load, at = GaussianLoad(0.05, 0.03, 0.006), np.array([0.04, 0.03])

    full = Full(flat, **THIN).under(load, at, 11)

    plate = Plate.of_material(Patch(0.1, 0.06), **THIN)
    assert full == pytest.approx(deflection_at(plate, load, at, (40, 11)), rel=3e-6)


# Closed forms of one function


@pytest.mark.parametrize("h", [1e-4, 1e-3])
@pytest.mark.parametrize("i", [1, 3])
def test_one_function_costs_what_its_strains_cost_by_hand(i, h):
    """Between diaphragms f = sin sin goes with v = V cos sin and u = U sin cos of least energy."""
    patch, D, nu = Patch(0.8 * ARC, 0.03, R), 3e-4, 0.3
    a, b, H, C = patch.a, patch.b, 1 / R, 12 * D / h**2
    k, q = i * math.pi / a, math.pi / b

    def energy(f, v, u):  # twice it, per quarter of the area
        e_x, e_y, g = -H * f - k * v, -q * u, q * v + k * u
        xx, yy, xy = -(k**2) * f - H * k * v, -(q**2) * f, k * q * f + H * (3 * q * v - k * u) / 4
        stretched = e_x**2 + e_y**2 + 2 * nu * e_x * e_y + (1 - nu) / 2 * g**2
        return C * stretched + D * (xx**2 + yy**2 + 2 * nu * xx * yy + 2 * (1 - nu) * xy**2)

    axes = np.eye(3)
    K = [[(energy(*(m + n)) - energy(*(m - n))) / 4 for m in axes] for n in axes]
    expected = a * b / 4 / np.linalg.inv(K)[0, 0]

    # Alone: what lies between does not mix with it.
    plate = Plate(patch, D, poisson=nu, thickness=h, inplane="diaphragm")
    values = plate.compliance(SineBasis(patch, i, 1, sliding=True)).values

    assert 1 / values[i - 1, i - 1] == pytest.approx(expected, rel=1e-9)


# The arc and the flat plate


@pytest.mark.parametrize("sliding", [False, True])
def test_as_it_grows_long_a_thin_skin_under_a_load_along_it_bends_as_the_planar_arc(sliding):
    """As fast as the axial strain fades."""
    a = 0.8 * ARC
    strip = Patch(a, 1.0, R, strip=True)
    line = LineLoad(0.4 * a, 0.0, 0.4 * a, 1.0, 3.0)
    planar = Plate(strip, 3e-4).deflection([line], SineBasis(strip, 12, 1, sliding=sliding))

    def off(b):
        patch = Patch(a, b, R)
        load = LineLoad(0.4 * a, 0.0, 0.4 * a, b, 3.0 * b)
        c = Plate(patch, 3e-4, thickness=1e-5).deflection(
            [load], SineBasis(patch, 12, 1, sliding=sliding)
        )
        # Of an even load the first sine along y takes 4 / pi.
        return np.abs(c * math.pi / 4 - planar).max() / np.abs(planar).max()

    assert off(4.0) < 0.05
    assert off(4.0) / off(8.0) == pytest.approx(2**4, rel=0.1)


def test_in_the_middle_of_a_long_skin_the_planar_arc_is_found():
    strip, patch = Patch(ARC, 2.0, R, strip=True), Patch(ARC, 2.0, R)
    line, middle = LineLoad(0.4 * ARC, 0.0, 0.4 * ARC, 2.0), (0.6 * ARC, 1.0)

    planar = deflection_at(Plate(strip, 3e-4), line, middle, (10, 1))
    skin = deflection_at(Plate(patch, 3e-4, thickness=1e-4), line, middle, (10, 31))

    # 31 sines make an even load up to 2 / (32 pi) in the middle.
    assert skin == pytest.approx(planar, rel=0.02)


@pytest.mark.parametrize("h", [2.5e-4, 1e-3])
def test_coefficients_tend_to_the_flat_plates_as_the_square_of_the_curvature(h):
    load, shape = GaussianLoad(0.04, 0.03, 0.006, 2.0), (12, 12)
    flat = Plate(Patch(0.1, 0.06), 3e-4).deflection([load], SineBasis(Patch(0.1, 0.06), *shape))

    def off(radius):
        patch = Patch(0.1, 0.06, radius)
        c = Plate(patch, 3e-4, thickness=h).deflection(
            [load], SineBasis(patch, *shape, sliding=True)
        )
        return np.abs(c - flat).max() / np.abs(flat).max()

    assert off(100.0) < 1e-3
    assert off(100.0) == pytest.approx(off(10.0) / 100, rel=0.1)


@pytest.mark.parametrize("held", [{"tension": 30.0}, {"foundation": 2e4}, {"fluid": True}])
def test_what_else_holds_it_counts_on_a_slightly_bent_skin_as_on_the_flat_one(held):
    load, shape = GaussianLoad(0.04, 0.03, 0.006, 2.0), (9, 9)
    flat, bent = Patch(0.1, 0.06), Patch(0.1, 0.06, 1e3)

    exact = Plate(flat, 3e-4, **held).deflection([load], SineBasis(flat, *shape))
    bent_plate = Plate(bent, 3e-4, **held)
    by_ritz = bent_plate.deflection([load], SineBasis(bent, *shape, sliding=True))

    np.testing.assert_allclose(by_ritz, exact, rtol=0, atol=1e-6 * np.abs(exact).max())


def test_pinning_the_ends_never_lets_the_skin_deflect_further():
    load = PointLoad(0.3 * ARC, 0.01)
    patch = Patch(0.9 * ARC, 0.03, R)
    plate = Plate(patch, 3e-4)

    slid, pinned = (
        deflection_at(plate, load, load.centre(), (14, 11), sliding) for sliding in (True, False)
    )

    assert 0 < pinned < slid


# Tension and fluid


def test_tension_costs_area_less_the_volume_that_pressure_gains():
    """Exactly, of the surface at radius R - e f, by its second difference in e."""
    patch, T = Patch(ARC, 0.03, R), 40.0
    basis = SineBasis(patch, 6, 3)
    plate = Plate(patch, 0.0, tension=T)
    load = GaussianLoad(0.4 * ARC, 0.013, ARC / 20)
    c = plate.deflection([load], basis)
    points, weights = basis.quadrature()
    f, fx, fy = (basis.at(points, *o) @ c.ravel() for o in ((0, 0), (1, 0), (0, 1)))

    def energy(e):
        shrunk = 1 - e * f / R
        area = np.sqrt((1 + (e * fy) ** 2) * shrunk**2 + (e * fx) ** 2)
        return T * weights @ area - T / R * weights @ (shrunk**2 * R / 2)

    e = 1e-3 * R / np.abs(f).max()
    curvature = (energy(e) - 2 * energy(0) + energy(-e)) / e**2

    work = float(np.sum(load.modal(basis) * c))  # twice the energy stored, c K c
    assert curvature == pytest.approx(work, rel=1e-5)


def test_tension_alone_does_not_hold_half_a_circle_whose_ends_slide():
    with pytest.raises(Refusal, match="moves as a whole without bending"):
        Plate(FINGERTIP_STRIP, 0.0, tension=5.0).compliance(
            SineBasis(FINGERTIP_STRIP, 5, 1, sliding=True)
        )


FINGERTIP_STRIP = Patch(ARC, 0.02, R, strip=True)


def test_pinned_ends_keep_the_volume_of_a_strip_so_that_a_fluid_changes_nothing():
    plate, load = Plate(FINGERTIP_STRIP, 3e-4), PointLoad(0.3 * ARC, 0.01)

    dry, wet = (deflection_at(p, load, load.centre(), (8, 1))
                for p in (plate, replace(plate, fluid=True)))  # fmt: skip

    assert wet == dry > 0


def test_a_fluid_stiffens_a_skin_most_where_its_ends_slide():
    plate, load = Plate(Patch(0.8 * ARC, 0.03, R), 3e-4), GaussianLoad(0.4 * ARC, 0.015, 0.0037)

    def share(sliding):
        dry, wet = (deflection_at(p, load, load.centre(), (8, 6), sliding)
                    for p in (plate, replace(plate, fluid=True)))  # fmt: skip
        return wet / dry

    assert 0 < share(sliding=True) < 0.9
    assert 0.99 < share(sliding=False) < 1


# The readings of a loaded cylinder skin


@pytest.mark.parametrize(("functions", "off"), [(10, 0.2), (20, 6e-3), (30, 9e-4)])
def test_its_readings_in_sines_converge_to_the_shells(functions, off):
    plate, layout = Plate.of_material(FINGERTIP, **THIN), SensorLayout.regular(FINGERTIP, 10, 10)
    load, basis = GaussianLoad(0.4 * ARC, 0.016, 2e-3), SineBasis(FINGERTIP, functions, functions)

    c = plate.deflection([load], basis).ravel()
    K = layout.operator(basis, plate) @ c

    expected, _ = Shell(plate.sheet(), 2e-3).readings_under(
        layout, np.array([load.x]), np.array([load.y])
    )
    np.testing.assert_allclose(K, expected[0, 0], rtol=0, atol=off * np.abs(expected).max())


def test_clamped_skins_read_alike_with_more_waves_than_functions():
    """Clamped functions mix the waves of the tangential displacements: finer ones say the same."""
    plate, layout = Plate.of_material(FINGERTIP, **THIN), SensorLayout.regular(FINGERTIP, 5, 4)
    load = GaussianLoad(0.4 * ARC, 0.016, 3e-3)

    def read(functions):
        basis = basis_for(FINGERTIP, "clamped", functions, functions)
        return layout.operator(basis, plate) @ plate.deflection([load], basis).ravel()

    finest = read(30)
    off = [np.abs(read(n) - finest).max() / np.abs(finest).max() for n in (8, 12, 18)]
    assert off[0] < 0.3
    assert off[1] < off[0] / 2
    assert off[2] < off[1] / 2


@pytest.mark.parametrize("gage_length", [0.0, 2e-3])
def test_the_shape_is_told_as_if_inextensible_within_the_strain(gage_length):
    """The fit knows no stiffness: it errs by a few per cent of the peak."""
    plate, basis = Plate.of_material(FINGERTIP, **THIN), SineBasis(FINGERTIP, 8, 8)
    layout = replace(SensorLayout.regular(FINGERTIP, 10, 10), gage_length=gage_length)
    c = plate.deflection([GaussianLoad(0.4 * ARC, 0.016, ARC / 18, 0.5)], basis)
    K = (layout.operator(basis, plate) @ c.ravel()).reshape(3, -1)

    fit = LeastSquares(basis, layout)(K)

    w = basis.on_grid(*FINGERTIP.grid(41, 41))
    assert 1e-3 < np.abs(w(fit.coefficients - c)).max() / np.abs(w(c)).max() < 0.02


def test_unless_said_otherwise_a_bent_skin_is_an_even_sheet():
    sheet = Plate.of_material(FINGERTIP, E=2.8e9, nu=0.3, h=0.25e-3)

    unsaid = Plate(FINGERTIP, sheet.rigidity)

    basis, load = SineBasis(FINGERTIP, 8, 8), [PointLoad(0.4 * ARC, 0.016)]
    np.testing.assert_allclose(
        unsaid.deflection(load, basis), sheet.deflection(load, basis), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("edge", ["hinged", "sliding", "clamped"])
def test_the_hoop_displacement_has_its_derivatives_and_its_edges(edge):
    patch = Patch(0.04, 0.03, R)
    plate, basis, step = Plate(patch), basis_for(patch, edge, 6, 5), 1e-6
    places = np.array([[0.013, 0.011], [0.02, 0.02], [0.031, 0.004]])

    v, *rates = plate.hoop(basis, places)

    above, below = (plate.hoop(basis, places + np.array([0.0, side])) for side in (step, -step))
    for found, expected in zip(rates, (above - below)[:2] / (2 * step), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    held = np.abs(plate.hoop(basis, np.array([[0.0, 0.01], [patch.a, 0.02]]))[0]).max()
    assert (held < 1e-9 * np.abs(v).max()) == (edge != "sliding")
    inextensible = hoop_at(basis, places)[0]
    assert np.abs(v).max() < 0.9 * np.abs(inextensible).max()  # the arc stretches too
    bend = np.arange(basis.size) == 5  # the first that one half of the arc gives to the other
    assert np.sum(v[:, bend] * inextensible[:, bend]) > 0
