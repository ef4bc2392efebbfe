"""The deflection of a simply supported plate, against textbook answers and superposition."""

import math
from dataclasses import replace

import numpy as np
import pytest
import skfem
from hypothesis import given
from hypothesis import strategies as st
from skfem.helpers import d, dd, ddot, dot, eye, trace

from kappaskin import (
    DiscLoad,
    Disk,
    GaussianLoad,
    LineLoad,
    Patch,
    Plate,
    PointLoad,
    Polygon,
    RectangleLoad,
    Refusal,
    Scene,
    SensorLayout,
    SineBasis,
    Stimulus,
    basis_for,
)
from kappaskin.mechanics import Compliance

SQUARE = Patch(0.1, 0.1)
inside = st.tuples(st.floats(0.0, 0.1), st.floats(0.0, 0.06))


def deflection_at(plate, loads, x, y, modes=31):
    basis = SineBasis(plate.patch, modes, modes)
    return basis.at(np.array([[x, y]]))[0] @ plate.deflection(loads, basis).ravel()


def timoshenko_central():
    """w D / (P a^2) under a central force on a square plate, by Timoshenko's single series."""
    m = np.arange(1, 9999, 2)
    tanh = np.tanh(m * np.pi / 2)
    return np.sum((tanh - m * np.pi / 2 * (1 - tanh**2)) / m**3) / (2 * np.pi**3)


@pytest.mark.parametrize("side", [1e-3, 0.1, 1.0])
def test_the_central_force_agrees_with_timoshenko_from_1_mm_to_1_m(side):
    plate = Plate(Patch(side, side), 2.0)

    w = deflection_at(plate, [PointLoad(side / 2, side / 2, 3.0)], side / 2, side / 2, 255)

    # The double series with 255 modes is 1e-5 short of the sum.
    assert w * 2.0 / (3.0 * side**2) == pytest.approx(timoshenko_central(), rel=2e-5)
    assert timoshenko_central() == pytest.approx(0.0116008, abs=5e-8)


@pytest.mark.parametrize("side", [1e-3, 0.1, 1.0])
@pytest.mark.parametrize(
    ("ratio", "coefficient"), [(1, 0.00406235), (1.5, 0.00772), (2, 0.01013), (3, 0.01223)]
)
def test_the_uniform_load_agrees_with_timoshenkos_table_from_1_mm_to_1_m(side, ratio, coefficient):
    patch = Patch(ratio * side, side)
    load = RectangleLoad(patch.a / 2, side / 2, patch.a, side, 3.0 * patch.a * side)

    w = deflection_at(Plate(patch, 2.0), [load], patch.a / 2, side / 2, 61)

    digits = 8 if ratio == 1 else 5
    assert w * 2.0 / (3.0 * side**4) == pytest.approx(coefficient, abs=0.51 * 10**-digits)


def test_the_plate_equation_holds_mode_by_mode():
    patch = Patch(0.1, 0.06)
    basis, load = SineBasis(patch, 6, 5), PointLoad(0.03, 0.02, 2.0)

    c = Plate(patch, 0.5).deflection([load], basis)

    # D lap(lap w) = q: the modes of q are the modal force over the functions' mean square, ab/4.
    pressure = load.modal(basis) / (0.1 * 0.06 / 4)
    np.testing.assert_allclose(0.5 * basis.laplacian**2 * c, pressure, rtol=1e-12)


@given(inside, inside)
def test_two_points_answer_each_others_load_alike(here, there):
    plate = Plate(Patch(0.1, 0.06))

    at_there = deflection_at(plate, [PointLoad(*here)], *there)

    # Maxwell and Betti's reciprocity.
    assert at_there == pytest.approx(deflection_at(plate, [PointLoad(*there)], *here), abs=1e-15)


@given(inside, inside, st.floats(-5, 5))
def test_loads_superpose(here, there, force):
    plate, basis = Plate(Patch(0.1, 0.06)), SineBasis(Patch(0.1, 0.06), 9, 9)
    first, second = PointLoad(*here), LineLoad(*here, *there, force)

    both = plate.deflection([first, second], basis)

    apart = plate.deflection([first], basis) + plate.deflection([second], basis)
    np.testing.assert_allclose(both, apart, rtol=1e-12, atol=1e-18)


def test_no_load_makes_no_deflection():
    assert not Plate(SQUARE).deflection([], SineBasis(SQUARE, 4, 5)).any()


def test_a_push_along_the_normal_lifts_the_whole_skin_and_most_on_its_own_side():
    basis = SineBasis(SQUARE, 31, 31)
    c = Plate(SQUARE).deflection([PointLoad(0.03, 0.06)], basis)

    w = basis.on_grid(*SQUARE.grid(51, 51))(c)[1:-1, 1:-1]

    assert w.min() > 0
    assert (w[:, :24] > w[:, :24:-1]).all()  # x < a/2 against its mirror image
    assert (w[25:] > w[23::-1]).all()  # y > b/2


def test_the_rigidity_of_a_material_has_one_minus_nu_squared():
    plate = Plate.of_material(SQUARE, E=2e9, nu=0.3, h=1e-3)

    # 2e9 * 1e-9 / (12 * 0.91); the paper's misprint, 1.09 for 0.91, gives 0.1529.
    assert plate.rigidity == pytest.approx(0.183150183, rel=1e-8)


@pytest.mark.parametrize("material", [(0, 0.3, 1e-3), (1e9, 0.51, 1e-3), (1e9, -1, 1e-3),
                                      (1e9, 0.3, 0), (math.nan, 0.3, 1e-3)])  # fmt: skip
def test_a_material_that_cannot_be_is_refused(material):
    E, nu, h = material
    with pytest.raises(Refusal, match=f"E > 0 Pa, h > 0 m .*got E={E}, nu={nu}, h={h}"):
        Plate.of_material(SQUARE, E, nu, h)


def test_a_skin_of_known_thickness_has_the_modulus_of_its_rigidity():
    plate = Plate.of_material(SQUARE, E=2e9, nu=0.3, h=1e-3)

    assert plate.thickness == plate.sheet_thickness == 1e-3
    assert plate.modulus(1e-3) == pytest.approx(2e9)
    assert plate.membrane_stiffness == pytest.approx(2e6 / (1 - 0.3**2))


def test_axial_stiffness_tells_the_thickness_of_a_bent_sheet():
    sheet = Plate.of_material(Patch(0.04, 0.03, 0.0129), E=2e9, nu=0.35, h=1e-4)

    by_stiffness = replace(sheet, thickness=None, axial_stiffness=2e9 * 1e-4)

    assert by_stiffness.sheet_thickness == pytest.approx(1e-4)
    assert replace(by_stiffness, thickness=3e-4).sheet_thickness == 3e-4
    assert replace(by_stiffness, axial_stiffness=0.0).sheet_thickness == 0.25e-3
    assert replace(by_stiffness, patch=SQUARE).sheet_thickness is None


def test_how_a_skin_is_held_in_its_plane_unless_told():
    flat, bent = Plate(SQUARE), Plate(Patch(0.04, 0.03, 0.0129))

    assert (flat.sheet_thickness, flat.inplane_edge) == (None, "held")
    assert (bent.sheet_thickness, bent.inplane_edge) == (0.25e-3, "hoop")
    assert flat.membrane_stiffness == 0
    assert Plate(SQUARE, inplane="free").inplane_edge == "free"


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ({"thickness": 0.0}, "expected a thickness above zero"),
        ({"thickness": math.nan}, "expected a thickness above zero"),
        ({"thickness": 0.2}, "at most the skin's shorter side"),
        ({"thickness": 1e-3, "rigidity": 0.0, "tension": 1.0}, "omit the thickness of a drum head"),
        ({"inplane": "hoop"}, "expected inplane among held, diaphragm, free for a flat skin"),
        ({"inplane": "glued"}, "got 'glued'"),
    ],
)
def test_a_sheet_that_cannot_be_is_refused(told, expected):
    with pytest.raises(Refusal, match=expected):
        Plate(SQUARE, **told)


@pytest.mark.parametrize("rigidity", [0.0, -1.0, math.nan, math.inf])
def test_a_rigidity_that_cannot_be_is_refused(rigidity):
    with pytest.raises(Refusal, match=f"rigidity above zero in N m, got {rigidity}"):
        Plate(SQUARE, rigidity)


def test_a_load_off_the_plate_is_refused():
    with pytest.raises(Refusal, match=r"on the patch of 0\.1 x 0\.1 m"):
        Plate(SQUARE).deflection([PointLoad(0.05, 0.11)], SineBasis(SQUARE, 4, 4))


def test_a_basis_on_another_patch_is_refused():
    with pytest.raises(Refusal, match=r"the plate is on Patch\(a=0\.1.*the basis on Patch\(a=0\.2"):
        Plate(SQUARE).compliance(SineBasis(Patch(0.2, 0.1), 4, 4))


# Clamped edges, round skins


def clamped_at_its_middle(patch, load, modes):
    basis = basis_for(patch, "clamped", modes, modes)
    c = Plate(patch, 2.0).deflection([load], basis)
    return basis.at(np.array([[patch.a / 2, patch.b / 2]]))[0] @ c.ravel()


# At 2 the table prints 0.00254; finite elements give 0.00253296, as the modes do.
@pytest.mark.parametrize(
    ("ratio", "coefficient"), [(1, 0.00126), (1.2, 0.00172), (1.5, 0.00220), (2, 0.00253)]
)
def test_a_clamped_plate_agrees_with_timoshenkos_table_under_a_uniform_load(ratio, coefficient):
    patch = Patch(0.1, 0.1 * ratio)

    w = clamped_at_its_middle(patch, uniform(patch, 3.0), 19)

    assert w * 2.0 / (3.0 * 0.1**4) == pytest.approx(coefficient, abs=0.6e-5)


def test_a_clamped_square_agrees_with_the_textbook_under_a_central_force():
    w = clamped_at_its_middle(SQUARE, PointLoad(0.05, 0.05, 3.0), 21)

    # 21 functions are 0.2 % below their sum, 0.005612.
    assert w * 2.0 / (3.0 * 0.1**2) == pytest.approx(0.00560, abs=0.6e-5)


@pytest.mark.parametrize(("edge", "factor"), [("clamped", 1.0), ("hinged", 5.3 / 1.3)])
def test_a_round_plate_agrees_with_its_closed_form_under_a_disc_that_covers_it(edge, factor):
    skin, basis = Disk(0.05), basis_for(Disk(0.05), edge, 8, 8)
    whole = DiscLoad(0.05, 0.05, 0.05, 3.0 * math.pi * 0.05**2)

    c = Plate(skin, 2.0, poisson=0.3).deflection([whole], basis)

    w = basis.at(np.array([[0.05, 0.05]]))[0] @ c.ravel()
    assert w == pytest.approx(factor * 3.0 * 0.05**4 / (64 * 2.0), rel=1e-3)


# A cantilever: Euler's and Bernoulli's beam, clamped at x = 0

STRIP = Patch(0.3, 0.02, strip=True)
EI = 2.0 * STRIP.b
ALONG = np.linspace(0.05, 1.0, 20) * STRIP.a


def cantilever(load, modes=30):
    """Deflection, slope and curvature (3, 20) along the strip."""
    basis = basis_for(STRIP, "cantilever", modes, 1)
    c = Plate(STRIP, 2.0).deflection([load], basis).ravel()
    points = np.column_stack([ALONG, np.full(20, 0.01)])
    return np.stack([basis.at(points, order) @ c for order in range(3)])


@pytest.mark.parametrize("at", [0.3, 0.5, 1.0])
def test_a_cantilever_agrees_with_the_beam_under_a_point_load(at):
    s, x = at * STRIP.a, ALONG

    found = cantilever(PointLoad(s, 0.01, 3.0))

    near, far = np.minimum(x, s), np.maximum(x, s)
    exact = [near**2 * (3 * far - near) / 6, near * (2 * s - near) / 2, s - near]
    for order, (one, true) in enumerate(zip(found, exact, strict=True)):
        # The functions beyond k = 30 add less than the sum of 4 (k pi)^(order - 4).
        left = 4 / (3 - order) / math.pi ** (4 - order) / 30 ** (3 - order)
        unit = 3.0 * STRIP.a ** (3 - order) / EI
        np.testing.assert_allclose(one / unit, 3.0 * true / EI / unit, rtol=0, atol=left)


def test_a_cantilever_agrees_with_the_beam_under_a_uniform_load():
    x, a, q = ALONG, STRIP.a, 3.0 * STRIP.b

    w, slope, curvature = cantilever(uniform(STRIP, 3.0))

    np.testing.assert_allclose(w, q * x**2 * (x**2 - 4 * a * x + 6 * a**2) / (24 * EI), rtol=5e-6)
    np.testing.assert_allclose(slope, q * x * (x**2 - 3 * a * x + 3 * a**2) / (6 * EI), rtol=1e-4)
    exact = q * (a - x) ** 2 / (2 * EI)
    np.testing.assert_allclose(curvature, exact, rtol=0, atol=2e-3 * exact.max())


# What else holds it: tension, foam, a fluid


def membrane(patch, x, y):
    """w T / q of a membrane under a uniform pressure, by Poisson's single series."""
    n = np.arange(1, 4000, 2)
    a, b = patch.a, patch.b
    # cosh(u) / cosh(v) for |u| <= v without overflow.
    u, v = np.abs(n * math.pi * (y - b / 2) / a), n * math.pi * b / (2 * a)
    ratio = np.exp(u - v) * (1 + np.exp(-2 * u)) / (1 + np.exp(-2 * v))
    return 4 * a**2 / math.pi**3 * np.sum((1 - ratio) * np.sin(n * math.pi * x / a) / n**3)


def uniform(patch, pressure):
    force = pressure * patch.a * patch.b
    return RectangleLoad(patch.a / 2, patch.b / 2, patch.a, patch.b, force)


@pytest.mark.parametrize("patch", [SQUARE, Patch(0.1, 0.03)])
def test_a_drum_head_agrees_with_poissons_series(patch):
    drum, (x, y) = Plate(patch, 0.0, tension=20.0), (0.3 * patch.a, 0.6 * patch.b)

    w = deflection_at(drum, [uniform(patch, 5.0)], x, y, 151)

    assert w * 20.0 / 5.0 == pytest.approx(membrane(patch, x, y), rel=2e-6)
    assert membrane(SQUARE, 0.05, 0.05) / 0.1**2 == pytest.approx(0.07367135, abs=1e-8)


def test_a_plate_in_tension_tends_to_the_membrane_as_its_rigidity_goes():
    def off(rigidity):
        plate = Plate(SQUARE, rigidity, tension=20.0)
        w = deflection_at(plate, [uniform(SQUARE, 5.0)], 0.05, 0.05, 151)
        return membrane(SQUARE, 0.05, 0.05) * 5.0 / 20.0 - w

    # Far from its edges a membrane lacks the deflection D q / T^2 of its plate.
    assert off(1e-4) == pytest.approx(1e-4 * 5.0 / 20.0**2, rel=0.01)
    assert off(1e-3) == pytest.approx(10 * off(1e-4), rel=0.01)


def test_under_a_point_a_drum_head_gives_way_without_limit_and_that_is_refused():
    drum, basis = Plate(SQUARE, 0.0, tension=20.0), SineBasis(SQUARE, 15, 15)
    disc = DiscLoad(0.05, 0.05, 0.01)

    for point in (PointLoad(0.05, 0.05), LineLoad(0.05, 0.05, 0.05, 0.05)):
        with pytest.raises(
            Refusal, match="without limit under a point load: expected a distributed"
        ):
            drum.deflection([disc, point], basis)
    with pytest.raises(Refusal, match="expected a distributed load"):
        Scene("drum", drum, SensorLayout.regular(SQUARE, 4, 4), (Stimulus(PointLoad(0.05, 0.05)),))
    # The sum over modes grows as their logarithm, by P / (2 pi T) for every factor e.
    centre = PointLoad(0.05, 0.05)
    few, many = (
        float(b.at(centre.centre()[None])[0] @ drum.compliance(b)(centre.modal(b)).ravel())
        for b in (SineBasis(SQUARE, 51, 51), SineBasis(SQUARE, 511, 511))
    )
    assert many - few == pytest.approx(math.log(10) / (2 * math.pi * 20.0), rel=0.01)


@pytest.mark.parametrize(
    "load", [LineLoad(0.02, 0.03, 0.08, 0.07), DiscLoad(0.05, 0.05, 0.01),
             RectangleLoad(0.05, 0.05, 0.02, 0.01), GaussianLoad(0.05, 0.05, 0.005)],
    ids=lambda load: type(load).__name__,
)  # fmt: skip
def test_under_every_other_load_a_drum_head_converges(load):
    drum = Plate(SQUARE, 0.0, tension=20.0)

    w = [deflection_at(drum, [load], 0.05, 0.05, modes) for modes in (63, 127, 255)]

    assert abs(w[2] - w[1]) < 0.6 * abs(w[1] - w[0]) + 1e-6 * w[2]
    assert w[2] == pytest.approx(w[1], rel=0.01)


def test_a_string_holds_a_point_that_a_drum_head_cannot():
    strip = Patch(0.1, 0.02, strip=True)
    string = Plate(strip, 0.0, tension=20.0)
    basis = SineBasis(strip, 2000, 1)

    c = string.deflection([PointLoad(0.03, 0.01, 2.0)], basis)

    # P x (a - x) / (a T) under the force per width P.
    w = basis.at(np.array([[0.03, 0.01]]))[0] @ c.ravel()
    exact = 2.0 / 0.02 * 0.03 * 0.07 / (0.1 * 20.0)
    # The sines beyond 2000 would add P a / (2000 pi^2 T).
    missing = 2.0 / 0.02 * 0.1 / (2000 * math.pi**2 * 20.0)
    assert exact - w == pytest.approx(missing, rel=0.01)


def test_on_stiff_foam_the_middle_sinks_by_the_pressure_over_its_modulus():
    def sunk(foundation):
        plate = Plate(SQUARE, 1e-3, foundation=foundation)
        return deflection_at(plate, [uniform(SQUARE, 500.0)], 0.05, 0.05, 301) * foundation / 500.0

    assert abs(sunk(1e3) - 1) > 0.2
    assert sunk(1e7) == pytest.approx(1, abs=2e-5)  # what 301 modes lack of the sum


def test_a_long_strip_on_foam_sinks_under_a_line_as_winklers_beam():
    strip, D, k = Patch(2.0, 0.02, strip=True), 0.05, 2e5
    beam, basis = Plate(strip, D, foundation=k), SineBasis(strip, 3200, 1)

    c = beam.deflection([PointLoad(1.0, 0.01, 2.0)], basis)

    # P beta / (2 k) with beta^4 = k / (4 D), damped out long before the ends.
    beta = (k / (4 * D)) ** 0.25
    w = basis.at(np.array([[1.0, 0.01]]))[0] @ c.ravel()
    assert w == pytest.approx(2.0 / 0.02 * beta / (2 * k), rel=1e-6)


def finite_elements(plate, pressure, cells):
    """Deflection by Argyris elements of a hinged plate: a function of points (P, 2)."""
    a, b, nu = plate.patch.a, plate.patch.b, plate.poisson
    mesh = skfem.MeshTri.init_tensor(*(np.linspace(0, side, cells + 1) for side in (a, b)))
    basis = skfem.Basis(mesh, skfem.ElementTriArgyris(), intorder=12)

    @skfem.BilinearForm
    def energy(u, v, _):
        M = plate.rigidity * ((1 - nu) * dd(u) + nu * eye(trace(dd(u)), 2))
        return ddot(M, dd(v)) + plate.tension * dot(d(u), d(v)) + plate.foundation * u * v

    @skfem.LinearForm
    def work(v, w):
        return pressure(*w.x) * v

    at_x = mesh.facets_satisfying(lambda p: np.isclose(p[0] * (a - p[0]), 0))
    at_y = mesh.facets_satisfying(lambda p: np.isclose(p[1] * (b - p[1]), 0))
    held = [basis.get_dofs(at_x).all(["u", "u_y", "u_yy"]),
            basis.get_dofs(at_y).all(["u", "u_x", "u_xx"])]  # fmt: skip
    system = energy.assemble(basis), work.assemble(basis)
    u = skfem.solve(*skfem.condense(*system, D=np.unique(np.concatenate(held))))
    return lambda points: basis.probes(points.T) @ u


@pytest.mark.parametrize("tension", [0.0, 300.0])
@pytest.mark.parametrize("foundation", [0.0, 1e5])
def test_finite_elements_agree_whatever_holds_the_plate(tension, foundation):
    patch = Patch(0.1, 0.07)
    plate = Plate(patch, 0.5, tension, foundation)
    load = GaussianLoad(0.04, 0.036, 0.0075, 3.0)
    points = np.array([[0.04, 0.036], [0.07, 0.02], [0.02, 0.06]])

    def pressure(x, y):
        square = (x - load.x) ** 2 + (y - load.y) ** 2
        return 3.0 * np.exp(-square / (2 * load.sd**2)) / (2 * math.pi * load.sd**2)

    w = finite_elements(plate, pressure, 8)(points)

    basis = SineBasis(patch, 40, 40)
    mine = basis.at(points) @ plate.deflection([load], basis).ravel()
    np.testing.assert_allclose(mine, w, rtol=2e-5)


# A fluid keeps the volume; compliance against direct solves


def minimised(K, force, volume=None):
    """The least of c K c / 2 - force c, where volume c = 0 when there is one, and its pressure."""
    if volume is None:
        return np.linalg.solve(K, force), 0.0
    N = len(K)
    bordered = np.block([[K, volume[:, None]], [volume[None], np.zeros((1, 1))]])
    # Scaled: stiffness and volume differ by many powers of ten.
    scale = 1 / np.sqrt(np.append(np.diag(K), volume @ (volume / np.diag(K))))
    x = scale * np.linalg.solve(bordered * np.outer(scale, scale), scale * np.append(force, 0.0))
    return x[:N], x[N]


def a_stiffness(size):
    A = np.random.default_rng(3).normal(size=(size, size))
    return A @ A.T + size * np.eye(size)


@pytest.mark.parametrize("diagonal", [True, False])
@pytest.mark.parametrize("fluid", [True, False])
def test_compliance_is_the_direct_solution(diagonal, fluid):
    K = np.diag(np.arange(1.0, 13)) if diagonal else a_stiffness(12)
    force, volume = np.random.default_rng(4).normal(size=(2, 12))
    values = 1 / np.diag(K) if diagonal else np.linalg.inv(K)

    c = Compliance(values, volume if fluid else None)(force.reshape(4, 3))

    expected, _ = minimised(K, force, volume if fluid else None)
    np.testing.assert_allclose(c.ravel(), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("fluid", [True, False])
def test_an_operator_after_compliance_is_the_product(fluid):
    K, M = a_stiffness(12), np.random.default_rng(5).normal(size=(7, 12))
    compliance = Compliance(np.linalg.inv(K), np.arange(12.0) if fluid else None)

    whole = np.column_stack([compliance(e[:, None]).ravel() for e in np.eye(12)])

    np.testing.assert_allclose(compliance.after(M), M @ whole, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
@pytest.mark.parametrize("skin", [Disk(0.05), Polygon([(0, 0), (0.1, 0), (0.1, 0.05), (0, 0.1)])])
def test_a_plate_mixes_its_own_modes_only_in_tension(skin, edge):
    plate, basis = Plate(skin, foundation=1e4), basis_for(skin, edge, 4, 4)

    own, mixed = (one.compliance(basis).values for one in (plate, replace(plate, tension=1e-3)))

    assert own.shape == (16,)
    np.testing.assert_allclose(mixed, np.diag(own), rtol=0, atol=1e-4 * own.max())


FLUID = {"flat": Patch(0.1, 0.06), "bent": Patch(0.1, 0.06, 0.05)}


@pytest.mark.parametrize("patch", FLUID.values(), ids=FLUID)
def test_over_a_fluid_the_volume_stays_and_the_pressure_is_its_multiplier(patch):
    plate = Plate(patch, 0.5, tension=30.0, foundation=1e4, thickness=2e-3)
    basis, load = SineBasis(patch, 9, 9, sliding=True), DiscLoad(0.03, 0.02, 0.01, 2.0)
    points, weights = basis.quadrature()
    volume = weights @ basis.at(points)
    values = plate.compliance(basis).values
    K = np.diag(1 / values) if values.ndim == 1 else np.linalg.inv(values)

    c = replace(plate, fluid=True).deflection([load], basis).ravel()

    expected, pressure = minimised(K, load.modal(basis).ravel(), volume)
    np.testing.assert_allclose(c, expected, rtol=1e-9, atol=1e-9 * np.abs(c).max())
    assert abs(volume @ c) < 1e-12 * np.abs(volume) @ np.abs(c)
    # What the skin needs besides the load is that one pressure, alike everywhere.
    np.testing.assert_allclose(
        load.modal(basis).ravel() - K @ c,
        pressure * volume,
        rtol=0,
        atol=1e-8 * abs(pressure) * volume.max(),
    )
    assert pressure != 0


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
@pytest.mark.parametrize("inplane", ["held", "free", "diaphragm"])
@pytest.mark.parametrize(
    ("sides", "radii", "thickness"),
    [
        ((4e-3, 4e-3), (1e6, 0.01), 1e-6),
        ((4e-3, 4e-3), (0.01, 1e6), 0.25e-3),
        ((0.04, 0.03), (0.1, 0.1), 5e-3),
        ((0.02, 0.02), (0.1, -0.1), 1e-6),
        ((0.4, 4e-3), (0.1, 1.0), 1e-6),
    ],
    ids=["uneven, thin", "uneven", "thick", "saddle, thin", "long, thin"],
)
def test_a_shallow_skin_of_any_proportions_has_a_compliance(sides, radii, thickness, inplane, edge):
    for nu in (0.0, 0.49):
        plate = Plate(Patch(*sides, radii), thickness=thickness, poisson=nu, inplane=inplane)
        basis = basis_for(plate.patch, edge, 8, 25)  # 200 functions

        C = plate.compliance(basis).after(np.eye(basis.size))

        np.testing.assert_allclose(C, C.T, atol=1e-14 * np.abs(C).max())
        scale = np.sqrt(C.diagonal())
        assert np.linalg.eigvalsh(C / np.multiply.outer(scale, scale))[0] > 1e-9
