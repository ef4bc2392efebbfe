"""The deflection of a simply supported plate, against textbook answers and superposition."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import LineLoad, Patch, Plate, PointLoad, Refusal, SineBasis

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
def test_the_uniform_load_agrees_with_the_textbook_from_1_mm_to_1_m(side):
    nodes, weights = np.polynomial.legendre.leggauss(40)
    lines = [
        LineLoad(side * (1 + s) / 2, 0, side * (1 + s) / 2, side, g / 2 * side**2)
        for s, g in zip(nodes, weights, strict=True)
    ]

    w = deflection_at(Plate(Patch(side, side), 2.0), lines, side / 2, side / 2)

    assert w * 2.0 / side**4 == pytest.approx(0.0040624, abs=5e-8)


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


@pytest.mark.parametrize("rigidity", [0.0, -1.0, math.nan, math.inf])
def test_a_rigidity_that_cannot_be_is_refused(rigidity):
    with pytest.raises(Refusal, match=f"rigidity above zero in N m, got {rigidity}"):
        Plate(SQUARE, rigidity)


def test_a_load_off_the_plate_is_refused():
    with pytest.raises(Refusal, match=r"on the patch of 0\.1 x 0\.1 m"):
        Plate(SQUARE).deflection([PointLoad(0.05, 0.11)], SineBasis(SQUARE, 4, 4))
