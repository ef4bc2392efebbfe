"""The truths that estimators are tested against, against published numbers and each other."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.legendre import leggauss
from scipy.optimize import brentq
from scipy.special import j0

from argyris import ArgyrisPlate
from koiter import Panel
from navier import HingedPlate, Load
from rigid import Compliance, ball
from sanders import CylinderShell
from von_karman import INPLANE, StretchingPlate

UNIT = HingedPlate(1.0, 1.0, 1.0)


# Navier's plate; numbers of Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, 1959


@pytest.mark.parametrize(
    ("b", "deflection"),
    [(1.0, 0.01160), (1.2, 0.01353), (1.4, 0.01484), (1.6, 0.01570), (1.8, 0.01620), (2, 0.01651)],
)
def test_a_central_force_moves_a_hinged_plate_as_in_table_23(b, deflection):
    w = HingedPlate(1.0, b, 1.0).displacement(Load(0.5, b / 2), np.array([[0.5, b / 2]]))

    # The table is up to 0.2 % below its own series (Levy's).
    m = np.arange(1, 200, 2)
    t = np.minimum(m * math.pi * b / 2, 300)
    levy = np.sum((np.tanh(t) - t / np.cosh(t) ** 2) / m**3) / (2 * math.pi**3)
    assert w[0] == pytest.approx(levy, rel=2e-5)
    assert levy == pytest.approx(deflection, rel=2.2e-3)


def test_an_even_pressure_moves_a_hinged_plate_as_in_table_8():
    at, weights = leggauss(40)
    grid = np.stack(np.meshgrid(at, at), -1).reshape(-1, 2) / 2 + 0.5

    # By reciprocity the mean displacement under a central force.
    w = UNIT.displacement(Load(0.5, 0.5), grid) @ np.outer(weights, weights).ravel() / 4

    assert w == pytest.approx(0.00406235, rel=1e-5)


@pytest.mark.parametrize("c", [0.03, 0.05])
def test_the_moment_in_a_central_disc_is_that_of_table_24(c):
    xx, yy, _ = UNIT.readings(Load(0.5, 0.5, radius=c), np.array([[0.5, 0.5]]))

    # The factors of a square, -0.565 and 0.135, both leave 0.435 beside the logarithm.
    moment = (1.3 * math.log(2 / (math.pi * c)) + 0.435) / (4 * math.pi)
    assert -(xx + 0.3 * yy)[0] == pytest.approx(moment, rel=2e-3)


@cache
def _disc(count=24):
    """Places (Q, 2) on a disc of radius 1 and weights (Q,) of their mean."""
    (r, weights), turn = leggauss(count), 2 * math.pi * np.arange(count) / count
    r = np.sqrt((r + 1) / 2)
    places = np.stack([np.outer(r, np.cos(turn)), np.outer(r, np.sin(turn))], -1)
    return places.reshape(-1, 2), np.repeat(weights / 2 / count, count)


def test_a_disc_is_the_mean_of_its_points():
    plate, places = HingedPlate(0.1, 0.08), np.array([[0.02, 0.05], [0.055, 0.03], [0.09, 0.01]])
    (steps, weights), middle = _disc(), np.array([0.045, 0.05])

    points = [plate.readings(Load(*p), places) for p in middle + 5e-3 * steps]

    of_disc = plate.readings(Load(*middle, radius=5e-3), places)
    np.testing.assert_allclose(np.tensordot(weights, points, 1), of_disc, rtol=1e-4, atol=1e-6)


def test_a_gaussian_is_the_mean_of_discs():
    # Rayleigh's law: exp(-r^2/2 sd^2) is a mixture of discs whose radius squared has the density
    # t exp(-t) of t = r^2 / (2 sd^2).
    plate, places, sd = HingedPlate(), np.array([[0.04, 0.06], [0.08, 0.02]]), 2e-3
    t = np.linspace(0, 25, 301)
    radii = sd * np.sqrt(2 * (t[1:] + t[:-1]) / 2)
    shares = np.diff(-(1 + t) * np.exp(-t))

    discs = [plate.readings(Load(0.05, 0.045, radius=r), places) for r in radii]

    gaussian = plate.readings(Load(0.05, 0.045, sd=sd), places)
    np.testing.assert_allclose(np.tensordot(shares, discs, 1), gaussian, rtol=1e-4, atol=1e-5)


def _differences(plate, load, place, h=1e-4):
    """Second derivatives (3,) of the displacement by central differences."""
    steps = h * np.array(
        [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)]
    )
    w, e, o, n, s, ne, so, se, no = plate.displacement(load, np.add(place, steps))
    return np.array([e - 2 * w + o, n - 2 * w + s, (ne + so - se - no) / 4]) / h**2


def test_readings_are_the_second_derivatives_of_the_displacement():
    plate, load, place = HingedPlate(0.1, 0.08), Load(0.03, 0.04, 0.7, radius=4e-3), (0.05, 0.06)

    K = plate.readings(load, np.array([place]))[:, 0]

    np.testing.assert_allclose(K, _differences(plate, load, place), rtol=1e-4, atol=1e-5)


def test_a_gage_reads_the_mean_curvature_along_it():
    plate, load, L = HingedPlate(0.1, 0.08), Load(0.03, 0.04, 0.7, radius=4e-3), 7e-3
    middle, (at, weights) = np.array([0.035, 0.045]), leggauss(30)

    def mean(ex, ey):
        K = plate.readings(load, middle + np.outer(at * L / 2, (ex, ey)))
        return weights / 2 @ (ex**2 * K[0] + ey**2 * K[1] + 2 * ex * ey * K[2])

    d = math.sqrt(0.5)
    expected = [mean(1, 0), mean(0, 1), (mean(d, d) - mean(d, -d)) / 2]
    found = plate.readings(load, middle[None], gage_length=L)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


# Sanders' shell; numbers of the shell obstacle course (doi:10.1016/0045-7825(85)90035-0)


def _sheet(E, nu, h):
    return {"rigidity": E * h**3 / (12 * (1 - nu**2)), "thickness": h, "poisson": nu}


def test_the_roof_of_scordelis_and_lo_sinks_as_published():
    R, half = 25.0, math.radians(40)
    sheet = _sheet(4.32e8, 0.0, 0.25)
    roof = CylinderShell(2 * half * R, 50.0, R, **sheet, edge="free", polynomials=24)

    def turn(x):
        return x / R - half

    weight = roof.pressed(lambda x: 90 * np.cos(turn(x)), lambda x: 90 * np.sin(turn(x)))
    f, v, _ = roof.moved(weight, np.array([[roof.arc, 25.0]]))[:, 0]

    # 0.3024 is MacNeal and Harder's; a thin shell that is resolved gives 0.3006 (Kiendl et al.,
    # doi:10.1016/j.cma.2009.08.013).
    assert f * math.cos(half) + v * math.sin(half) == pytest.approx(0.3006, abs=5e-5)


def test_a_pinched_cylinder_gives_as_published():
    R, L, E, h = 300.0, 600.0, 3e6, 3.0
    # A quarter of the round, with half of the force on its edge.
    quarter = CylinderShell(
        math.pi * R / 2, L, R, **_sheet(E, 0.3, h), edge="mirror", polynomials=48, waves=200
    )

    f = quarter.displacement(Load(0.0, L / 2, 0.5), np.array([[0.0, L / 2]]))[0, 0]

    # 164.24 is of a series of 80 x 80 terms.
    assert f * E * h == pytest.approx(164.24, rel=2e-3)


def test_a_line_load_bends_a_long_half_round_as_an_arc():
    arc = CylinderShell(math.pi, 2000.0, 1.0, 1.0, 1e-4, 0.0, polynomials=96, waves=1)
    middle = np.array([[math.pi / 2, 1000.0]])

    # A line load of 1 N/m that goes as the one wave does, whose square is half of its length.
    on_f = arc.functions(middle[:, 0])[0]
    f, v, _ = arc.moved(1000.0 * on_f, middle)[:, 0]

    # Inextensible and pinned, by 40 terms of PHYSICS, section 4.
    assert f == pytest.approx(0.018942, abs=1e-6)
    assert v == pytest.approx(0.0, abs=1e-9)


@pytest.mark.full
def test_a_shell_that_is_hardly_bent_is_a_plate():
    shell, plate = CylinderShell(0.1, 0.08, 1e3), HingedPlate(0.1, 0.08)
    load, x = Load(0.043, 0.052, radius=3e-3), (np.arange(10) + 0.5) / 10
    places = np.stack(np.meshgrid(0.1 * x, 0.08 * x), -1).reshape(-1, 2)

    f, v, _ = shell.displacement(load, places)

    np.testing.assert_allclose(f, plate.displacement(load, places), atol=1e-4 * f.max())
    np.testing.assert_allclose(v, 0, atol=1e-2 * f.max())
    # In the disc, where 60 polynomials are few, the curvature differs by 1 % of its peak.
    for gage, share in ((0.0, 0.015), (5e-3, 2e-3)):
        of_plate = plate.readings(load, places, gage)
        found = shell.reader(places, gage)(load)
        np.testing.assert_allclose(found, of_plate, atol=share * np.abs(of_plate).max())


@pytest.mark.parametrize(("arc", "R"), [(math.pi * 12.9e-3, 12.9e-3), (0.047, 30e-3)])
def test_the_deflection_of_a_shell_has_converged_to_four_digits(arc, R):
    load = Load(0.4 * arc, 0.013, radius=2e-3)
    places = np.array([[0.4 * arc, 0.013], [0.6 * arc, 0.02]])

    f, finer = (
        CylinderShell(arc, 0.03, R, polynomials=N, waves=n).displacement(load, places)[0]
        for N, n in ((60, 96), (90, 144))
    )

    np.testing.assert_allclose(f, finer, rtol=1.5e-4)


def _of_two_faces(middle, size, place):
    """Curvature (3,) from how lengths and angles change on both faces, to first order in a force.

    From places in space alone, with none of the formulas of a shell: `middle` gives those (P, 3) in
    m of places (P, 2) under so many times a load, which moves them by `size` in m at most.
    """
    z, steps = 1e-4, 3e-5 * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])

    def face(place, amount, z):
        east, west, north, south = middle(place + steps, amount)
        normal = np.cross(east - west, north - south)
        return middle(place[None], amount)[0] + z * normal / np.linalg.norm(normal)

    def measures(amount, z):
        east, west, north, south = (face(place + d, amount, z) for d in steps)
        along, across = east - west, north - south
        return np.array(
            [
                *(np.log(np.linalg.norm(length)) for length in (along, across)),
                np.log(np.linalg.norm(along + across) / np.linalg.norm(along - across)) / 2,
            ]
        )

    def strain(z):
        amount = 1e-6 / size
        return (measures(amount, z) - measures(-amount, z)) / (2 * amount)

    return (strain(z) - strain(-z)) / (2 * z)


def test_a_pair_of_gages_reads_what_both_faces_stretch():
    R = 12.9e-3
    shell = CylinderShell(math.pi * R, 0.03, R, polynomials=24, waves=24)
    load, place = Load(0.017, 0.013, radius=3e-3), np.array([0.021, 0.016])

    def middle(places, amount):
        f, v, u = amount * shell.displacement(load, places)
        s, c = np.sin(places[:, 0] / R), np.cos(places[:, 0] / R)
        x, y, up = (R - f) * s + v * c, places[:, 1] + u, (R - f) * c - v * s
        return np.stack([x, y, up], -1)

    K = shell.reader(place[None])(load)[:, 0]

    size = np.abs(shell.displacement(load, place[None])).max()
    np.testing.assert_allclose(K, _of_two_faces(middle, size, place), rtol=2e-3)


# Koiter's shell that is bent both ways

DOME, SADDLE, TROUGH = (0.1, 0.1), (0.1, -0.1), (math.inf, 0.1)
SMALL = Load(0.017, 0.023, radius=2e-3)
NEAR = np.array([[0.017, 0.023], [0.02, 0.02], [0.03, 0.01], [0.018, 0.0245]])


@pytest.mark.parametrize(("b", "deflection"), [(1.0, 0.00560), (2.0, 0.00722)])
def test_a_central_force_moves_a_clamped_panel_as_in_table_37(b, deflection):
    plate = Panel(1.0, b, math.inf, math.inf, 1.0, edge="clamped", polynomials=20)

    w = plate.displacement(Load(0.5, b / 2), np.array([[0.5, b / 2]]))[2]

    assert w[0] == pytest.approx(deflection, rel=2.5e-3)


@pytest.mark.parametrize(("side", "R"), [(0.04, 0.1), (0.1, 0.3)])
def test_a_point_load_moves_a_dome_as_reissners(side, R):
    dome, middle = Panel(side, side, R, R), side / 2

    f = dome.displacement(Load(middle, middle), np.array([[middle, middle]]))[2]

    # Reissner (1946): sqrt(12 (1 - nu^2)) P R / (8 E h^2), of a shallow sphere without a rim.
    root = math.sqrt(12 * (1 - dome.poisson**2))
    E = root**2 * dome.rigidity / dome.thickness**3
    assert f[0] == pytest.approx(root * R / (8 * E * dome.thickness**2), rel=5e-3)


def test_a_panel_that_is_bent_one_way_is_sanders_cylinder():
    panel = Panel(0.04, 0.03, 0.1, math.inf)
    cylinder = CylinderShell(0.04, 0.03, 0.1, edge="diaphragm")
    load, elements = Load(0.017, 0.02, radius=2e-3), np.array([[0.01, 0.02], [0.03, 0.01]])

    u, v, f = panel.displacement(load, NEAR)

    of_cylinder = cylinder.displacement(load, NEAR)
    np.testing.assert_allclose([f, u, v], of_cylinder, atol=1e-4 * np.abs(f).max())
    np.testing.assert_allclose(
        panel.reader(elements)(load), cylinder.reader(elements)(load), rtol=0, atol=2e-2
    )


@pytest.mark.parametrize("radii", [DOME, SADDLE, TROUGH, (0.12, -0.2)])
def test_gages_of_a_panel_read_what_both_faces_stretch(radii):
    panel, place = Panel(0.04, 0.03, *radii, polynomials=16), np.array([0.03, 0.009])
    load, middle, H = Load(0.026, 0.012, radius=3e-3), np.array([0.02, 0.015]), 1 / np.array(radii)

    def space(places, amount):
        turn, nil = (places - middle) * H, 0 * places[:, 0]
        (sx, sy), (cx, cy), bent = np.sin(turn).T, np.cos(turn).T, (H != 0)
        flat = np.where(bent, np.sin(turn) / np.where(bent, H, 1), places - middle)
        down = np.where(bent, 2 * np.sin(turn / 2) ** 2 / np.where(bent, H, 1), 0).sum(-1)
        along, across = np.stack([cx, nil, -sx], -1), np.stack([nil, cy, -sy], -1)
        inward = np.cross(across, along)
        inward /= np.linalg.norm(inward, axis=-1, keepdims=True)
        u, v, f = (amount * panel.displacement(load, places))[..., None]
        return np.column_stack([flat, -down]) + u * along + v * across + f * inward

    K = panel.reader(place[None])(load)[:, 0]

    size = np.abs(panel.displacement(load, place[None])).max()
    np.testing.assert_allclose(K, _of_two_faces(space, size, place), rtol=2e-3)


@pytest.mark.cases("hinged-held-dome", "clamped-diaphragm-saddle")
@pytest.mark.parametrize("radii", [DOME, SADDLE, TROUGH], ids=["dome", "saddle", "trough"])
@pytest.mark.parametrize("inplane", ["diaphragm", "held", "free"])
@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_what_a_panel_reads_has_converged(radii, inplane, edge):
    x = 0.04 * (np.arange(6) + 0.5) / 6
    elements = np.stack(np.meshgrid(x, x), -1).reshape(-1, 2)

    (f, K), (finer, finer_K) = (
        (panel.displacement(SMALL, NEAR)[2], panel.reader(elements)(SMALL))
        for panel in (
            Panel(0.04, 0.04, *radii, inplane=inplane, edge=edge, polynomials=N, modes=modes)
            for N, modes in ((24, 240), (32, 360))
        )
    )

    np.testing.assert_allclose(f, finer, atol=2e-4 * finer.max())
    np.testing.assert_allclose(K, finer_K, atol=2e-3 * np.abs(finer_K).max())


def test_work_on_a_saddle_is_reciprocal():
    saddle, there = Panel(0.04, 0.03, *SADDLE, inplane="held"), Load(0.026, 0.011)

    one = saddle.displacement(there, np.array([[0.017, 0.02]]))[2]
    other = saddle.displacement(Load(0.017, 0.02), np.array([[0.026, 0.011]]))[2]

    assert one[0] == pytest.approx(other[0], rel=2e-4)


# Argyris' elements


def test_elements_agree_with_navier():
    plate, load = ArgyrisPlate(edge="hinged"), Load(0.043, 0.061, sd=2e-3)
    places = np.random.default_rng(0).uniform(0.005, 0.095, (60, 2))

    found, told = plate.readings(load, places), HingedPlate().readings(load, places)

    np.testing.assert_allclose(found, told, atol=5e-4 * np.abs(told).max())
    moved = HingedPlate().displacement(load, places)
    np.testing.assert_allclose(plate.displacement(load, places), moved, atol=1e-4 * moved.max())


def test_a_central_force_moves_a_clamped_square_as_in_table_37():
    plate = ArgyrisPlate(1.0, 1.0, cells=24)

    w = plate.displacement(Load(0.5, 0.5, sd=0.01), np.array([[0.5, 0.5]]))

    assert w[0] == pytest.approx(0.00560, rel=5e-3)


# Von Karman's plate


def _uniform(plate, q):
    """The work of a pressure in N/m^2 on each sine per m."""
    i = np.arange(1, plate.sines + 1)
    mean = (1 - np.cos(np.pi * i)) / (np.pi * i)
    return q * plate.a * plate.b * np.outer(mean, mean)


@pytest.mark.parametrize(("inplane", "w"), [("held", 0.422), ("straight", 0.422)])
def test_a_plate_under_pressure_stretches_as_levys(inplane, w):
    E, h, nu = 1.0, 0.01, 0.316
    plate = StretchingPlate(1.0, 1.0, **_sheet(E, nu, h), inplane=inplane)

    c = plate.equilibrium(_uniform(plate, 12.1 * E * h**4))

    middle = np.outer(*(np.sin(np.arange(1, plate.sines + 1) * np.pi / 2),) * 2)
    assert np.sum(c * middle) / h == pytest.approx(w, abs=5e-4)


@pytest.mark.parametrize(("share", "told"), [(0.334, 0.90), (0.871, 0.59), (1.593, 0.33)])
def test_a_held_plate_gives_way_to_a_central_force_by_less_the_further_it_goes(share, told):
    plate, load, middle = StretchingPlate(), Load(0.05, 0.05), np.array([[0.05, 0.05]])

    def reached(force):
        return plate.displacement(replace(load, force=force), middle)[0] / plate.thickness

    force = brentq(lambda force: reached(force) - share, 1e-3, 0.1, rtol=1e-5)
    linear = HingedPlate().displacement(replace(load, force=force), middle)[0] / plate.thickness
    assert share / linear == pytest.approx(told, abs=0.005)


@pytest.mark.parametrize("inplane", INPLANE)
def test_a_small_force_does_not_stretch_a_plate(inplane):
    load, places = Load(0.03, 0.06, 1e-5, radius=3e-3), np.array([[0.04, 0.05], [0.085, 0.015]])
    plate = StretchingPlate(inplane=inplane, sines=12, polynomials=16)

    for of_plate, of_hinged in zip(
        (plate.displacement(load, places), plate.readings(load, places, 5e-3)),
        (HingedPlate().displacement(load, places), HingedPlate().readings(load, places, 5e-3)),
        strict=True,
    ):
        np.testing.assert_allclose(of_plate, of_hinged, rtol=1e-4)


def _membrane_energy(plate, c):
    return plate.energy(c, np.zeros_like(c)) - np.sum(_bending(plate) * c**2) / 2


def _bending(plate):
    return HingedPlate(plate.a, plate.b, plate.rigidity, plate.sines).stiffness


# The other way to the membrane's energy, by Airy's stress function p of N_xx = p_yy, N_yy = p_xx:
# it solves (p_xxxx + 2 p_xxyy + p_yyyy) / (E h) = w_xy^2 - w_xx w_yy, and the energy is half the
# integral of (p_xx + p_yy)^2 / (E h). On edges that a diaphragm holds p is a sum of sines, beside
# an even shear; where they are free, p and its slope vanish there.


def _bumpy(sines=6):
    scale = 0.01 * 0.5 ** np.arange(sines)
    return np.random.default_rng(0).normal(size=(sines, sines)) * np.outer(scale, scale)


def _at_points(count=200):
    t, weights = leggauss(count)
    k = np.pi * np.arange(1, 7)
    turns = np.outer((t + 1) / 2, k)
    return t, weights / 2, np.sin(turns), k * np.cos(turns), -(k**2) * np.sin(turns)


def _gauss_curvature(c):
    _, _, S, C, S2 = _at_points()
    return (C @ c @ C.T) ** 2 - (S2 @ c @ S.T) * (S @ c @ S2.T)


def test_diaphragm_edges_agree_with_a_stress_function():
    plate, c = StretchingPlate(1.0, 1.0, 1.0, 0.01, 0.3, "diaphragm", 6, 24), _bumpy()
    (t, weights, S, C, _), Eh = _at_points(), 12 * 0.91 / 0.01**2

    n = np.pi * np.arange(1, 101)
    waves = np.sin(np.outer((t + 1) / 2, n)) * weights[:, None]
    p = 4 * waves.T @ _gauss_curvature(c) @ waves / np.add.outer(n**2, n**2)
    shear = weights @ ((C @ c @ S.T) * (S @ c @ C.T)) @ weights
    expected = Eh * np.sum(p**2) / 8 + Eh / (4 * 1.3) * shear**2
    assert _membrane_energy(plate, c) == pytest.approx(expected, rel=1e-6)


def test_free_edges_agree_with_a_stress_function():
    plate, c = StretchingPlate(1.0, 1.0, 1.0, 0.01, 0.3, "free", 6, 24), _bumpy()
    (t, weights, *_), Eh = _at_points(), 12 * 0.91 / 0.01**2

    clamped = Polynomial([1, 0, -1]) ** 2
    made = [clamped * Legendre.basis(k).convert(kind=Polynomial) for k in range(18)]
    F, F2 = (np.stack([p.deriv(m)(t) for p in made], -1) * 2**m for m in (0, 2))
    laplacian = np.einsum("xi,yj->xyij", F2, F) + np.einsum("xi,yj->xyij", F, F2)
    W = np.sqrt(np.outer(weights, weights))[..., None, None]
    A = (W * laplacian).reshape(len(t) ** 2, -1)
    b = F.T @ (np.outer(weights, weights) * _gauss_curvature(c)) @ F
    expected = Eh / 2 * b.ravel() @ np.linalg.solve(A.T @ A, b.ravel())
    assert _membrane_energy(plate, c) == pytest.approx(expected, rel=1e-6)


# A ball on a plate

MIDDLE = np.array([[0.05, 0.05]])


@cache
def _tiles(pitch=1e-3, count=31):
    return Compliance(HingedPlate(), 0.05, 0.05, pitch, count)


@pytest.mark.parametrize(("radius", "depth"), [(0.02, 4e-3), (0.1, 2e-3), (0.3, 3e-3)])
def test_an_object_pushes_where_it_touches_and_nowhere_enters(radius, depth):
    pressed = _tiles().press(ball(radius), depth)

    assert pressed.forces.min() == 0
    assert pressed.gap.min() > -1e-12
    assert np.abs(pressed.gap[pressed.forces > 0]).max() < 1e-12


def test_the_force_is_what_the_work_of_sinking_takes():
    step, (less, here, more) = (
        1e-6,
        (_tiles().press(ball(0.3), 3e-3 + d) for d in (-1e-6, 0.0, 1e-6)),
    )

    assert (more.energy - less.energy) / (2 * step) == pytest.approx(here.force, rel=1e-6)


@pytest.mark.parametrize(("radius", "depth"), [(0.02, 5e-3), (0.04, 2e-3), (0.04, 5e-3)])
def test_a_small_ball_touches_a_thin_plate_in_a_single_node(radius, depth):
    tiles = _tiles(0.7e-3, 15)

    pressed = tiles.press(ball(radius), depth)

    assert np.flatnonzero(pressed.forces).tolist() == [7 * 15 + 7]
    assert pressed.force == pytest.approx(
        depth / HingedPlate().displacement(Load(0.05, 0.05, radius=tiles.radius), MIDDLE)[0],
        rel=1e-3,
    )


@pytest.mark.parametrize("radius", [0.15, 0.2, 0.3])
def test_a_large_ball_bears_on_a_ring(radius):
    depth = 3e-3
    # A plate that lies on a ball has its curvature and no load, so that it bears on a rim: a ring
    # of radius c under which it is as deep and curved as the ball. The mean over a ring is J_0.
    plate = HingedPlate()
    k, l = plate.waves()
    waves = np.sqrt(np.add.outer(k**2, l**2))

    def under_ring(c):
        made = plate.coefficients(Load(0.05, 0.05)) * j0(waves * c)
        return plate.surface(made, MIDDLE)[0], -plate.curvature(made, MIDDLE)[0, 0]

    def too_curved(c):
        deep, curved = under_ring(c)
        return curved / deep - 1 / (radius * depth)

    c = brentq(too_curved, 1e-3, 30e-3)

    pressed = _tiles().press(ball(radius), depth)
    assert pressed.force == pytest.approx(depth / under_ring(c)[0], rel=2e-3)
    away = np.hypot(*(pressed.places - 0.05).T)
    assert away @ pressed.forces / pressed.force == pytest.approx(c, rel=1e-2)


def test_readings_under_an_object_are_those_of_its_forces():
    elements = np.array([[0.03, 0.06], [0.08, 0.02]])
    tiles = _tiles(0.7e-3, 15)

    K = tiles.press(ball(0.02), 4e-3).readings(elements)

    one = HingedPlate().readings(Load(0.05, 0.05, radius=tiles.radius), elements)
    np.testing.assert_allclose(K, 4e-3 / tiles.G[7 * 16, 7 * 16] * one, rtol=1e-9)
