"""Rigid objects on the skin: beam and ring in closed form, laws of contact, other solvers."""

import math
from functools import cache, partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg
from scipy.optimize import brentq, lsq_linear, nnls

from kappaskin import Cap, Disk, Patch, Plate, PointLoad, Polygon, Refusal, basis_for
from kappaskin.mechanics import (
    Block,
    Cylinder,
    HeightMap,
    IndentationSolver,
    PlacedObject,
    Punch,
    Sphere,
    Wedge,
)

pytestmark = pytest.mark.slow

SQUARE, D = Patch(0.1, 0.1), 3.7e-3
ROUGH = HeightMap(np.random.default_rng(0).uniform(0, 2e-4, (23, 31)), 0.04, 0.03)
# What presses a skin whose shorter side is 1; scaled to it.
OBJECTS = {
    "small sphere": lambda s: Sphere(0.1 * s),
    "large sphere": lambda s: Sphere(2 * s),
    "cylinder": lambda s: Cylinder(s, 0.6 * s),
    "wedge": lambda s: Wedge(2.5, 0.5 * s, 0.3 * s),
    "punch": lambda s: Punch(0.15 * s),
    "block": lambda s: Block(0.5 * s, 0.2 * s),
    "rough": lambda s: HeightMap(ROUGH.heights * s * 10, 0.4 * s, 0.3 * s),
}
each_object = pytest.mark.parametrize("make", OBJECTS.values(), ids=OBJECTS.keys())


@cache
def pressing(held, nodes=(32, 24)):
    return IndentationSolver(Plate(held.patch), held.basis(8, 7), nodes)


@cache
def on_square(edge="hinged", modes=15, nodes=64):
    return IndentationSolver(Plate(SQUARE), basis_for(SQUARE, edge, modes, modes), (nodes, nodes))


def deflection(press_on, answer):
    """The skin's deflection (n,) in m at the points of an answer, from its coefficients alone."""
    return press_on.at(answer.points) @ answer.coefficients.ravel()


# A beam on a parabola, in closed form
#
# Half a span H from the middle a beam of stiffness EI is hinged. Where it lies on a parabola of
# radius R, out to c, it has the bending moment EI/R, and no load but at the two ends of contact.
# From there to the hinge the moment falls evenly to nil: each end bears EI/(R (H - c)). The
# tangent at the end, and the deflection (H - c)^2/(3 R) of the hinge from it, give the depth.


def beam(R, depth, H, EI):
    c = brentq(lambda c: (H**2 / 3 + c * H / 3 - c**2 / 6) / R - depth, 0, 0.999 * H)
    return c, EI / (R * (H - c))


@pytest.mark.parametrize("R", [1.0, 4.0])
def test_a_strip_bears_on_a_cylinder_at_the_two_ends_of_contact_alone(R):
    strip, n = Patch(0.1, 0.02, strip=True), 801
    press = IndentationSolver(Plate(strip), basis_for(strip, "hinged", 200, 1), (n, 1))
    c, end = beam(R, 1e-3 / R, 0.05, D * 0.02)

    answer = press(Cylinder(R, 0.3), 0.05, 0.01, math.pi / 2, depth=1e-3 / R)

    x = answer.points[:, 0] - 0.05
    for side in (-1, 1):
        F = answer.forces * (x * side > 0)
        # The circle rises faster than the parabola, by (c/R)^2 or so.
        assert F.sum() == pytest.approx(end, rel=2e-4)
        assert F @ x / F.sum() == pytest.approx(side * c, abs=0.1 * 0.1 / n)
        assert np.abs(np.abs(x[F > 0]) - c).max() < 1.5 * 0.1 / n


def test_a_strip_that_hardly_bends_touches_a_cylinder_along_one_line():
    strip = Patch(0.1, 0.02, strip=True)
    press = IndentationSolver(Plate(strip), basis_for(strip, "hinged", 200, 1), (801, 1))
    R, H = 1.0, 0.05
    deepest = H**2 / (3 * R)

    answer = press(Cylinder(R, 0.3), H, 0.01, math.pi / 2, depth=0.9 * deepest)

    # 2 H long, hinged, pressed in the middle: P = 6 EI d / H^3.
    assert answer.force == pytest.approx(6 * D * 0.02 * 0.9 * deepest / H**3, rel=1e-5)
    assert np.ptp(answer.points[answer.forces > 0, 0]) < 1e-12


# A plate under a ring of force, in closed form
#
# Inside the ring of contact w = d - r^2/(2 R), outside it is A + B ln r + C r^2 + E r^2 ln r with
# the force 8 pi D E. Across it w, its slope and the bending moment go on, and so w''.


def ring(R, depth, rim, clamped, nu=0.3):
    def outside(c):
        def first(r):
            return np.array([0, 1 / r, 2 * r, 2 * r * math.log(r) + r])

        def second(r):
            return np.array([0, -1 / r**2, 2, 2 * math.log(r) + 3])

        def value(r):
            return np.array([1, math.log(r), r**2, r**2 * math.log(r)])

        held = first(rim) if clamped else second(rim) + nu / rim * first(rim)
        rows = np.array([value(rim), held, first(c), second(c)])
        found = np.linalg.solve(rows, [0, 0, -c / R, -1 / R])
        return found @ value(c) + c**2 / (2 * R), 8 * math.pi * D * found[3]

    c = brentq(lambda c: outside(c)[0] - depth, 1e-3 * rim, 0.9 * rim)
    return c, outside(c)[1]


@pytest.mark.cases("clamped")
@pytest.mark.parametrize(("edge", "R", "depth"), [("clamped", 0.5, 1e-3), ("hinged", 1.0, 1e-3)])
def test_a_sphere_bears_on_a_disk_along_the_ring_that_holds_it(edge, R, depth):
    disk = Disk(0.05)
    press = IndentationSolver(Plate(disk), basis_for(disk, edge, 20, 20), (80, 80))
    c, force = ring(R, depth, 0.05, edge == "clamped")

    answer = press(Sphere(R), 0.05, 0.05, depth=depth)

    out = np.hypot(*(answer.points - 0.05).T)
    assert answer.force == pytest.approx(force, rel=5e-4)
    assert answer.forces @ out / answer.force == pytest.approx(c, rel=5e-3)
    np.testing.assert_allclose(answer.centre, 0.05, atol=1e-6)


# What an object tends to, and what it is like


def test_a_smaller_sphere_is_more_like_a_point_load():
    press, basis = on_square("clamped"), basis_for(SQUARE, "clamped", 15, 15)
    point = Plate(SQUARE).deflection([PointLoad(0.043, 0.057, 0.5)], basis)
    scale = np.abs(point).max()

    apart = [
        np.abs(press(Sphere(R), 0.043, 0.057, force=0.5).coefficients - point).max() / scale
        for R in (0.4, 0.2, 0.1, 0.05, 1e-2, 1e-4)
    ]

    assert apart[0] > 0.05
    assert apart == sorted(apart, reverse=True)
    assert apart[-1] < 1e-12


def test_a_sphere_between_the_nodes_presses_where_it_is():
    press, basis = on_square(nodes=8), basis_for(SQUARE, "hinged", 15, 15)

    answer = press(Sphere(1e-3), 0.043, 0.057, depth=1e-3)

    assert answer.force
    np.testing.assert_allclose(answer.centre, [0.043, 0.057], rtol=1e-12)
    assert (basis.at(np.array([[0.043, 0.057]])) @ answer.coefficients.ravel())[0] == pytest.approx(
        1e-3 - answer.compression.max(), rel=1e-12
    )


def test_a_large_punch_presses_with_its_rim():
    answer = on_square()(Punch(0.02), 0.05, 0.05, depth=1e-3)

    out = np.hypot(*(answer.points - 0.05).T)
    assert out[answer.forces > 0].min() > 0.0185


@pytest.mark.parametrize("kind", [kind for kind in OBJECTS if kind != "rough"])
def test_a_mirror_image_presses_a_mirror_image(kind):
    press, object_ = on_square("clamped"), OBJECTS[kind](0.1)

    here = press(object_, 0.03, 0.06, 0.4, depth=2e-3)
    there = press(object_, 0.07, 0.06, -0.4, depth=2e-3)

    # Sines of even numbers, and clamped functions, are odd about the middle.
    mirrored = there.coefficients * (-1.0) ** np.arange(15)[:, None]
    scale = np.abs(mirrored).max()
    np.testing.assert_allclose(here.coefficients / scale, mirrored / scale, atol=1e-7)
    np.testing.assert_allclose(here.force, there.force, rtol=1e-7)


def test_a_quarter_turn_turns_the_skin_with_it():
    press = on_square()

    along = press(Block(0.04, 0.01), 0.05, 0.05, depth=2e-3)
    across = press(Block(0.04, 0.01), 0.05, 0.05, math.pi / 2, depth=2e-3)

    np.testing.assert_allclose(along.coefficients, across.coefficients.T, atol=1e-12)
    assert np.ptp(along.points[along.forces > 0], axis=0) == pytest.approx([0.04, 0.01])


def test_a_turned_wedge_presses_with_its_edge_alone():
    answer = on_square()(Wedge(1.0, 0.04, 0.02), 0.043, 0.057, 0.5, depth=2e-3)

    x, y = (answer.points[answer.forces > 0] - (0.043, 0.057)).T
    np.testing.assert_allclose(y * math.cos(0.5), x * math.sin(0.5), atol=1e-12)
    assert np.hypot(x, y).max() == pytest.approx(0.02)


@each_object
@pytest.mark.parametrize("edge", ["hinged", "clamped", "elastic"])
def test_deeper_is_harder(make, edge):
    press, object_ = on_square(edge, 8, 32), make(0.1)

    forces = [press(object_, 0.04, 0.06, 0.4, depth=d).force for d in np.linspace(0, 8e-3, 17)]

    assert forces[0] == 0
    assert (np.diff(forces) > 0).all()


# Laws of contact, for every object on every skin

_place = st.tuples(st.floats(0.1, 0.9), st.floats(0.1, 0.9), st.floats(-4, 4))
_make = st.sampled_from(list(OBJECTS.values()))
_few = partial(settings, max_examples=6, deadline=None, derandomize=True)


def where(held, place):
    """The place on the skin, or the middle where that is off it."""
    u, v, turn = place
    x, y = u * held.patch.a, v * held.patch.b
    if not held.patch.moves(np.array([[x, y]]))[0]:
        x, y = 0.45 * held.patch.a, 0.4 * held.patch.b
    return x, y, turn


@given(_make, _place, st.floats(0, 0.1))
@_few()
def test_no_object_is_pulled_or_enters_any_skin(held_skin, make, place, depth):
    s = min(held_skin.patch.a, held_skin.patch.b)
    x, y, turn = where(held_skin, place)
    object_ = make(s)

    answer = pressing(held_skin)(object_, x, y, turn, depth=depth * s)

    assert (answer.forces >= 0).all()
    assert answer.residual < 1e-6
    w = deflection(held_skin.basis(8, 7), answer)
    scale = np.abs(answer.coefficients).max() + 1e-12
    # What bears, bears everywhere on the skin; what does not, clears it.
    assert (answer.gap > -1e-9 * scale).all()
    assert np.abs(answer.gap[answer.forces > 0]).max(initial=0) < 1e-9 * scale
    if not any(held_skin.patch.curvatures):
        c, sin = math.cos(turn), math.sin(turn)
        height = object_.height((answer.points - (x, y)) @ np.array([[c, -sin], [sin, c]]))
        gap = w + answer.compression - (depth * s - height)
        np.testing.assert_allclose(gap, answer.gap, atol=1e-9 * scale)


@given(_make, _place, st.floats(0.01, 0.1))
@_few()
def test_depth_and_force_agree_on_every_skin(held_skin, make, place, depth):
    s = min(held_skin.patch.a, held_skin.patch.b)
    x, y, turn = where(held_skin, place)
    press, object_ = pressing(held_skin), make(s)

    by_depth = press(object_, x, y, turn, depth=depth * s)
    by_force = press(object_, x, y, turn, force=by_depth.force)

    scale = np.abs(by_depth.coefficients).max() + 1e-12
    if by_depth.force:
        assert by_force.depth == pytest.approx(by_depth.depth, rel=1e-7)
        np.testing.assert_allclose(by_force.coefficients, by_depth.coefficients, atol=1e-7 * scale)
    assert by_force.force == pytest.approx(by_depth.force, rel=1e-9)


@given(_make, _place, st.floats(0.01, 0.1))
@_few()
def test_a_dragged_object_presses_as_one_put_there(held_skin, make, place, depth):
    s = min(held_skin.patch.a, held_skin.patch.b)
    x, y, turn = where(held_skin, place)
    press, object_ = pressing(held_skin), make(s)
    dragged = press(object_, x, y, turn, depth=depth * s)
    order = np.abs(dragged.coefficients).max() + 1e-12

    for step in (0.002, 0.03, 0.2):
        x, turn = x + step * (0.5 * held_skin.patch.a - x), turn + step
        if not held_skin.patch.moves(np.array([[x, y]]))[0]:
            break
        dragged = press(object_, x, y, turn, depth=depth * s, after=dragged)
        put = press(object_, x, y, turn, depth=depth * s)
        np.testing.assert_allclose(dragged.coefficients, put.coefficients, atol=1e-6 * order)
        held_to = press(object_, x, y, turn, force=1e-3, after=dragged)
        assert held_to.force == pytest.approx(1e-3, rel=1e-9)


def test_a_dragged_object_takes_fewer_steps():
    press, dragged, put = on_square(), 0, 0
    answer = press(Punch(0.02), 0.05, 0.05, depth=2e-3)

    for x in np.arange(0.0501, 0.06, 0.1 / 64):
        answer = press(Punch(0.02), x, 0.05, depth=2e-3, after=answer)
        dragged += answer.steps
        put += press(Punch(0.02), x, 0.05, depth=2e-3).steps

    assert dragged < 0.7 * put


def test_the_answer_is_of_one_piece():
    basis = basis_for(SQUARE, "clamped", 15, 15)

    answer = on_square("clamped")(Cylinder(0.05, 0.05), 0.04, 0.06, 0.5, depth=4e-3)

    modal = basis.at(answer.points).T @ answer.forces
    np.testing.assert_allclose(answer.modal.ravel(), modal, rtol=1e-10, atol=1e-15)
    answered = Plate(SQUARE).compliance(basis)(answer.modal)
    np.testing.assert_allclose(answer.coefficients, answered, rtol=1e-8, atol=1e-15)
    assert answer.force == pytest.approx(answer.forces.sum(), rel=1e-12)
    assert answer.nodal.sum() == pytest.approx(answer.force, rel=1e-12)
    assert answer.nodal.shape == (64, 64)
    np.testing.assert_array_equal(answer.patch, answer.pressure > 0)
    assert answer.area == pytest.approx(answer.patch.sum() * (0.1 / 64) ** 2)
    # Every force is at the node of its cell: none further than half a cell.
    x, y = SQUARE.cell_centres(64, 64)
    moments = answer.nodal.sum(axis=0) @ x, answer.nodal.sum(axis=1) @ y
    np.testing.assert_allclose(np.array(moments) / answer.force, answer.centre, atol=0.05 / 64)


# Other solvers


@pytest.mark.parametrize("held", [("hinged", SQUARE), ("clamped", Disk(0.05))], ids=str)
@each_object
def test_two_other_solvers_agree(held, make):
    edge, patch = held
    plate, basis = Plate(patch), basis_for(patch, edge, 8, 8)
    answer = IndentationSolver(plate, basis, (24, 24))(make(0.1), 0.045, 0.055, 0.3, depth=3e-3)
    E, nu, h = 12 * (1 - 0.3**2) * D / 0.25e-3**3, 0.3, 0.25e-3
    assert Plate.of_material(patch, E, nu, h).rigidity == pytest.approx(D)

    felt = basis.at(answer.points)
    soft = h / E / (0.1 / 24) ** 2
    M = plate.compliance(basis).after(felt) @ felt.T + soft * np.eye(len(felt))
    L = linalg.cholesky((M + M.T) / 2, lower=True)
    w = felt @ answer.coefficients.ravel() + soft * answer.forces
    side = linalg.solve_triangular(L, w - answer.gap, lower=True)  # w - gap is the object

    by_nnls = nnls(L.T, side)[0]
    by_bounds = lsq_linear(L.T, side, (0, np.inf), method="bvls", tol=1e-20).x
    for other in (by_nnls, by_bounds):
        c = plate.compliance(basis).after((other @ felt)[None])[0]
        scale = np.abs(c).max()
        np.testing.assert_allclose(answer.coefficients.ravel() / scale, c / scale, atol=1e-6)
        assert other.sum() == pytest.approx(answer.force, rel=1e-6)


# Bent skins, fluids, rims


def test_a_bent_skin_falls_away_below_a_flat_block():
    bent = Patch(0.04, 0.03, 12.9e-3)
    press = IndentationSolver(Plate(bent), basis_for(bent, "clamped", 8, 8), (32, 24))

    answer = press(Block(0.1, 0.1), 0.02, 0.015, depth=0.0)

    angle = (answer.points[:, 0] - 0.02) / 12.9e-3
    assert answer.force == 0
    gap = 12.9e-3 * (1 - np.cos(angle)) * np.cos(angle)
    np.testing.assert_allclose(answer.gap, gap, atol=1e-15)
    assert np.abs(angle).max() < math.pi / 2


def test_a_bent_skin_bears_along_the_push_what_the_object_bears():
    bent = Patch(0.04, 0.03, 12.9e-3)
    press = IndentationSolver(Plate(bent), basis_for(bent, "clamped", 8, 8), (64, 48))

    answer = press(Block(0.03, 0.01), 0.02, 0.015, force=3.0)

    angle = (answer.points[:, 0] - 0.02) / 12.9e-3
    assert np.cos(angle) @ answer.forces == pytest.approx(3.0)
    np.testing.assert_allclose(answer.centre, [0.02, 0.015], rtol=1e-9)


@pytest.mark.parametrize("place", [(0.5, 0.5), (0.62, 0.35)])
def test_a_ball_stands_above_a_spherical_cap_by_what_both_fall_away(place):
    cap = Cap(0.01, 1.3)
    at = np.array(place) * cap.a
    object_ = PlacedObject(Sphere(0.006), at, 0.4)
    points = cap.around(*at, 0.003 * np.random.default_rng(0).uniform(-1, 1, (50, 2)))

    height, slant = object_.over(cap, points)

    normals = cap.at_rest(np.vstack([at, points]))[1]
    cos = normals[1:] @ normals[0]
    far2 = 0.01**2 * (1 - cos**2)
    falls = 0.01 * (1 - cos) + 0.006 - np.sqrt(0.006**2 - far2)
    np.testing.assert_allclose(height, falls, atol=1e-15)
    np.testing.assert_allclose(slant, cos, rtol=1e-12)


@pytest.mark.parametrize("patch", [Patch(0.04, 0.03, (0.1, 0.08)), Cap(0.02, 1.2)])
def test_a_plate_on_a_dome_presses_around_where_it_stands(patch):
    functions = (12, 13) if isinstance(patch, Cap) else (32, 32)
    press = IndentationSolver(Plate(patch), basis_for(patch, "hinged", *functions))
    at = np.array([0.5 * patch.a, 0.5 * patch.b])

    middle, beside = (press(Block(0.02, 0.02), *where, force=1.0) for where in (at, 1.1 * at))

    for pressed, where in ((middle, at), (beside, 1.1 * at)):
        assert pressed.residual < 1e-9
        assert pressed.forces.min() >= 0
        np.testing.assert_allclose(pressed.centre, where, atol=4e-4)  # half a node
    reach = np.linalg.norm(middle.points[middle.forces > 0] - at, axis=1)
    assert 0 < reach.max() < 0.006  # of a plate of 20 mm
    np.testing.assert_allclose(middle.nodal, middle.nodal[::-1, ::-1], atol=1e-9)


def test_a_skin_over_a_fluid_keeps_its_volume_under_an_object():
    basis = basis_for(SQUARE, "hinged", 9, 9)
    press = IndentationSolver(Plate(SQUARE, fluid=True), basis, (32, 32))

    answer = press(Sphere(0.05), 0.04, 0.05, depth=3e-3)

    points, weights = basis.quadrature()
    w = basis.at(points) @ answer.coefficients.ravel()
    assert abs(weights @ w) < 1e-9 * weights @ np.abs(w)
    assert answer.residual < 1e-6


def test_a_drum_bears_a_sphere_once_its_thickness_is_known():
    basis, drum = basis_for(SQUARE, "hinged", 15, 15), Plate(SQUARE, rigidity=0.0, tension=20.0)

    with pytest.raises(Refusal, match="give the layer"):
        IndentationSolver(drum, basis)
    answer = IndentationSolver(drum, basis, layer=1e-13)(Sphere(0.05), 0.05, 0.05, force=1.0)

    assert answer.residual < 1e-6
    assert (answer.forces > 0).sum() > 4


@pytest.mark.parametrize("side", [1e-3, 1.0, 10.0])
def test_skins_of_any_size_answer(side):
    patch = Patch(side, side)
    press = IndentationSolver(Plate(patch), basis_for(patch, "hinged", 15, 15))

    answer = press(Sphere(side), 0.4 * side, 0.5 * side, depth=0.06 * side)

    assert answer.residual < 1e-6
    assert answer.force > 0


@each_object
def test_what_overhangs_the_rim_meets_nothing_there(make):
    press, patch = on_square(), SQUARE

    answer = press(make(0.1), 0.005, 0.1, 0.3, depth=1e-3)

    assert patch.contains(answer.points).all()
    assert answer.force > 0


def test_an_object_in_the_notch_of_a_polygon_touches_its_arms_only():
    notched = Polygon([(0, 0), (0.1, 0), (0.1, 0.05), (0.05, 0.05), (0.05, 0.1), (0, 0.1)])
    press = IndentationSolver(Plate(notched), basis_for(notched, "hinged", 6, 6), (32, 32))

    answer = press(Block(0.06, 0.06), 0.065, 0.065, depth=1e-4)

    assert notched.contains(answer.points[answer.forces > 0]).all()
    with pytest.raises(Refusal, match="misses"):
        press(Sphere(0.01), 0.08, 0.08, depth=1e-3)


def test_an_object_held_above_the_skin_leaves_it_alone():
    answer = on_square()(Sphere(0.02), 0.05, 0.05, depth=-2e-3)

    assert answer.force == 0
    assert not answer.coefficients.any()
    assert np.isnan(answer.centre).all()
    assert answer.gap.min() == pytest.approx(2e-3)
    assert answer.residual == 0
    assert answer.area == 0


def test_a_force_of_zero_just_touches():
    answer = on_square()(Sphere(0.02), 0.05, 0.05, force=0.0)

    assert answer.force == 0
    assert answer.depth == pytest.approx(0, abs=1e-12)


# What is refused


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"x": math.nan, "depth": 1e-3}, "a position in m and angle in rad"),
        ({"turn": math.inf, "depth": 1e-3}, "a position in m and angle in rad"),
        ({}, "either a depth or a force, got None and None"),
        ({"depth": 1e-3, "force": 1.0}, "either a depth or a force"),
        ({"force": -1.0}, "force of at least zero in N, got -1"),
        ({"force": math.nan}, "force of at least zero"),
        ({"force": math.inf}, "force of at least zero"),
        ({"depth": math.nan}, "depth of at most 0.1 m.*got nan"),
        ({"depth": 5.0}, "depth of at most 0.1 m.*got 5.0; depths are in metres"),
        ({"x": 0.2, "depth": 1e-3}, r"over the patch of 0.1 x 0.1 m, got Sphere.*at \(0.2, 0.05\)"),
        ({"force": 1e3}, "this force would press the object .* m deep"),
    ],
)
def test_a_push_that_cannot_be_is_refused(asked, said):
    place = {"x": 0.05, "y": 0.05} | asked

    with pytest.raises(Refusal, match=said):
        on_square()(Sphere(0.01), **place)


@pytest.mark.parametrize("nodes", [(0, 4), (4, -1), (10**5, 10**5)])
def test_nodes_that_cannot_be_are_refused(nodes):
    with pytest.raises(Refusal, match=f"nodes for 16 functions, got {nodes[0]} x {nodes[1]}"):
        IndentationSolver(Plate(SQUARE), basis_for(SQUARE, "hinged", 4, 4), nodes)


@pytest.mark.parametrize("layer", [0.0, -1e-13, math.nan, math.inf])
def test_a_layer_that_cannot_be_is_refused(layer):
    with pytest.raises(Refusal, match="layer above zero"):
        IndentationSolver(Plate(SQUARE), basis_for(SQUARE, "hinged", 4, 4), layer=layer)


def test_what_would_take_minutes_is_refused():
    press = IndentationSolver(Plate(SQUARE, fluid=True), basis_for(SQUARE, "hinged", 9, 9))

    with pytest.raises(Refusal, match="more than 1024 nodes"):
        press(Block(0.2, 0.2), 0.05, 0.05, depth=5e-3)
