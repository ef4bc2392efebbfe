"""Skins that are bent both ways, against Koiter's shell on their true surface."""

import math
from functools import cache

import numpy as np
import pytest

from kappaskin import (
    Cap,
    LeastSquares,
    Patch,
    Plate,
    PointContact,
    Refusal,
    SensorLayout,
    basis_for,
)
from kappaskin.contact.influence import influence_of
from kappaskin.mechanics import DiscLoad
from koiter import Panel
from navier import HingedPlate, Load

INF = math.inf
DOME, SADDLE, TROUGH, ACROSS = (0.1, 0.1), (0.1, -0.1), (INF, 0.1), (0.1, INF)
# What shallow theory neglects, 1 / (R k)^2 being 0.6 % here, as shares of the largest displacement
# and reading. A saddle bends without stretching and feels it most; across is Sanders' cylinder.
OFF = {
    DOME: (6e-3, 4e-3),
    SADDLE: (2e-2, 6e-3),
    TROUGH: (3e-3, 3e-3),
    ACROSS: (3e-3, 4e-4),
    (0.12, -0.3): (3e-3, 3e-3),
    (-0.1, INF): (3e-3, 3e-3),
}
SIDES = 0.04, 0.03
LOAD = Load(0.017, 0.019, radius=2e-3)
PLACES = np.array([[0.017, 0.019], [0.02, 0.015], [0.03, 0.01], [0.018, 0.0205]])
skins = pytest.mark.parametrize("radii", OFF, ids=str)


@cache
def panel(radii, inplane="diaphragm", edge="hinged"):
    return Panel(*SIDES, *radii, inplane=inplane, edge=edge, polynomials=24)


def skin(radius, inplane="", sides=SIDES):
    return Plate(Patch(*sides, radius=radius), inplane=inplane)


def moved(plate, edge="hinged", functions=16):
    """Displacement in m at `PLACES`."""
    basis = basis_for(plate.patch, edge, functions, functions)
    c = plate.deflection([DiscLoad(LOAD.x, LOAD.y, radius=LOAD.radius)], basis)
    return basis.at(PLACES) @ c.ravel()


def read(plate, layout, edge="hinged", load=LOAD):
    """What the elements read (3, P) in 1/m, as a contact has it."""
    rows = np.zeros((4, 3 * len(layout)))
    influence = influence_of(plate, layout, edge, 15, rows)
    influence.at(load.x, load.y, load.radius**2)
    return (rows[0] / influence.unit).reshape(3, -1)


@skins
def test_a_skin_moves_as_koiters_shell(radii):
    f = panel(radii).displacement(LOAD, PLACES)[2]

    found = moved(skin(radii), functions=20 if radii == ACROSS else 96)

    np.testing.assert_allclose(found, f, rtol=0, atol=OFF[radii][0] * f.max())


@skins
def test_elements_read_what_koiters_shell_has(radii):
    plate = skin(radii)
    layout = SensorLayout.regular(plate.patch, 10, 8)
    K = panel(radii).reader(layout.positions)(LOAD)

    found = read(plate, layout)

    np.testing.assert_allclose(found, K, rtol=0, atol=OFF[radii][1] * np.abs(K).max())


@pytest.mark.parametrize("radii", [radii for radii in OFF if radii != ACROSS], ids=str)
def test_readings_of_a_shape_are_its_curvature_and_that_of_its_rest(radii):
    plate, flat = skin(radii), skin(INF)
    Hx, Hy = 1 / np.array(radii)

    bent, straight = (
        SensorLayout.regular(each.patch, 3, 4).operator(basis_for(each.patch, "hinged", 3, 2), each)
        for each in (plate, flat)
    )

    f = basis_for(flat.patch, "hinged", 3, 2).at(SensorLayout.regular(flat.patch, 3, 4).positions)
    np.testing.assert_allclose(bent - straight, np.vstack([Hx**2 * f, Hy**2 * f, 0 * f]), atol=1e-9)


@pytest.mark.cases("held-hinged-(0.1, 0.1)", "free-clamped-(inf, 0.1)")
@pytest.mark.parametrize("radii", [radii for radii in OFF if radii != ACROSS], ids=str)
@pytest.mark.parametrize("edge", ["hinged", "clamped"])
@pytest.mark.parametrize("inplane", ["held", "free", "diaphragm"])
def test_other_edges_are_as_koiters(inplane, edge, radii):
    plate, truth = skin(radii, inplane), panel(radii, inplane, edge)
    layout, f = SensorLayout.regular(plate.patch, 10, 8), truth.displacement(LOAD, PLACES)[2]
    K = truth.reader(layout.positions)(LOAD)
    # Free ones let more of a dome and a saddle bend without stretching.
    more = 3 if inplane == "free" and INF not in radii else 1.5

    found = moved(plate, edge), read(plate, layout, edge)

    for one, true, off in zip(found, (f, K), OFF[radii], strict=True):
        np.testing.assert_allclose(one, true, rtol=0, atol=more * off * np.abs(true).max())


@pytest.mark.parametrize("inplane", ["diaphragm", "held"])
def test_a_load_is_followed_where_it_fades_over_a_thirtieth_of_a_side(inplane):
    thin = {"inplane": inplane, "thickness": 1e-4}
    plate = Plate(Patch(0.1, 0.1, (0.3, 0.3)), **thin)
    layout = SensorLayout.regular(plate.patch, 20, 20)
    load = Load(0.0413, 0.0537, radius=2e-3)
    K = Panel(0.1, 0.1, 0.3, 0.3, **thin, polynomials=40).reader(layout.positions)(load)

    found = read(plate, layout, load=load)

    np.testing.assert_allclose(found, K, rtol=0, atol=5e-3 * np.abs(K).max())


# Hardly bent, and bent one way


@pytest.mark.parametrize("radius", [(1e6, 1e6), (1e6, -1e6), (INF, 1e6), (1e6, INF), 1e6], ids=str)
@pytest.mark.parametrize("inplane", ["diaphragm", "held", "free"])
def test_a_skin_that_is_hardly_bent_is_flat(radius, inplane):
    flat, bent = (skin(R, inplane) for R in (INF, radius))

    (f, K, contact), (bent_f, bent_K, bent_contact) = (
        (moved(plate), read(plate, layout), pressed(plate, layout))
        for plate in (flat, bent)
        for layout in [SensorLayout.regular(plate.patch, 10, 8)]
    )

    np.testing.assert_allclose(bent_f, f, rtol=1e-6)
    # An arc's readings come of another sum than a flat skin's.
    off = 5e-6 if bent.patch.arc_curvature else 1e-6
    np.testing.assert_allclose(bent_K, K, rtol=0, atol=off * np.abs(K).max())
    np.testing.assert_allclose(bent_contact, contact, rtol=1e-6)


def pressed(plate, layout, edge="hinged"):
    """Place in m and force in N of a contact whose readings are those of a hinged plate."""
    curvature = HingedPlate(*SIDES).readings(LOAD, layout.positions)
    fit = LeastSquares(basis_for(plate.patch, edge, 6, 6), layout)
    found = PointContact(plate, layout, edge)(curvature, fit(curvature))
    return *found.position, found.force


@pytest.mark.parametrize("inplane", ["diaphragm", "held", "free"])
def test_an_arc_is_the_same_skin_by_one_radius_and_by_two(inplane):
    one, two = skin(0.1, inplane), skin((0.1, INF), inplane)

    assert skin((0.1, INF)).inplane_edge == "diaphragm"
    np.testing.assert_array_equal(moved(one), moved(two))
    layouts = [SensorLayout.regular(plate.patch, 10, 8) for plate in (one, two)]
    np.testing.assert_array_equal(read(one, layouts[0]), read(two, layouts[1]))
    assert pressed(one, layouts[0]) == pressed(two, layouts[1])


def test_an_arc_along_x_is_one_along_y_turned():
    along, across = skin((0.1, INF)), skin((INF, 0.1), sides=SIDES[::-1])
    layout = SensorLayout.regular(along.patch, 10, 8)
    turned = SensorLayout.scattered(across.patch, layout.positions[:, ::-1])
    rows = np.zeros((4, 3 * len(layout)))
    influence = influence_of(across, turned, "hinged", 15, rows)
    influence.at(LOAD.y, LOAD.x, LOAD.radius**2)
    yy, xx, xy = (rows[0] / influence.unit).reshape(3, -1)

    K = read(along, layout)  # by Sanders' theory, the other by that of shallow shells

    np.testing.assert_allclose([xx, yy, xy], K, rtol=0, atol=3e-3 * np.abs(K).max())


# What the theory of shallow skins may be wrong by


@pytest.mark.parametrize(
    ("radii", "inplane", "share"),
    [(SADDLE, "", 0.016), (SADDLE, "held", 0), (DOME, "", 0), (TROUGH, "", 0), (0.1, "", 0)],
)
def test_the_error_bar_of_a_force_on_a_saddle_includes_its_theory(radii, inplane, share):
    plate = skin(radii, inplane, (0.04, 0.04))

    assert plate.theory_error == pytest.approx(share, abs=1e-3)
    strong, weak = (contact_under(plate, noise) for noise in (1e-6, 0.2))
    assert strong.force_sd == pytest.approx(plate.theory_error, rel=0.01, abs=1e-6)
    assert weak.force_sd > strong.force_sd
    off = np.abs(strong.position - 0.02)  # from the middle
    np.testing.assert_allclose(strong.position_sd, plate.theory_error * off, rtol=0.02, atol=1e-7)


def contact_under(plate, noise):
    """The contact of a force of 1 N, under so much noise in 1/m."""
    layout = SensorLayout.regular(plate.patch, 10, 8)
    curvature = read(plate, layout)
    curvature = curvature + np.random.default_rng(0).normal(0, noise, curvature.shape)
    fit = LeastSquares(basis_for(plate.patch, "hinged", 6, 6), layout)
    return PointContact(plate, layout)(curvature, fit(curvature))


def test_a_saddle_with_free_edges_that_is_too_steep_is_refused():
    with pytest.raises(Refusal, match=r"err by 3\.2% in a force .* hold the edges in plane"):
        skin(SADDLE, "free", sides=(0.04, 0.04))
    assert skin(DOME, "free", sides=(0.04, 0.04)).theory_error < 1e-3


@pytest.mark.parametrize(
    ("patch", "thickness", "text"),
    [
        (Patch(0.04, 0.04, (0.1, 0.1)), 12e-6, r"felt over 0\.85 mm at least, got 0\.6 mm"),
        (Patch(0.04, 0.04, (0.1, -0.1)), 1e-6, r"felt over 0\.85 mm at least, got 0\.21 mm"),
        (Cap(8e-3, 1.309), 25e-6, r"felt over 0\.3 mm at least, got 0\.25 mm"),
    ],
)
def test_a_skin_too_thin_for_its_loads_to_be_found_is_refused(patch, thickness, text):
    layout = SensorLayout.scattered(patch, [[patch.a / 2, patch.b / 2], [patch.a / 3, patch.b / 2]])
    with pytest.raises(Refusal, match=text):
        PointContact(Plate(patch, thickness=thickness), layout)
