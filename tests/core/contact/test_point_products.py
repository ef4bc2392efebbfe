"""Products of point loads' readings, as few waves and small matrices, against whole matrices."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Patch, Plate, SensorLayout, SineBasis
from kappaskin.contact.element_grid import element_grid, modal_projection
from kappaskin.contact.point import _squares_on_grid

OBLONG = Patch(0.1, 0.07)
BASIS = SineBasis(OBLONG, 7, 5)
LAYOUT = SensorLayout.regular(OBLONG, 6, 4).without([3, 14])
inside = st.floats(1e-4, 1 - 1e-4)


BENT = Patch(0.03, 0.02, 12.9e-3)
SKINS = {
    "flat": (Plate(OBLONG), LAYOUT, BASIS),
    "fluid": (Plate(OBLONG, fluid=True), LAYOUT, BASIS),
    "bent": (Plate(BENT), SensorLayout.regular(BENT, 8, 8), SineBasis(BENT, 6, 5)),
}


@pytest.mark.parametrize(("plate", "layout", "basis"), SKINS.values(), ids=SKINS)
@given(inside, inside)
def test_squares_of_readings_on_a_grid_are_those_at_each_place(plate, layout, basis, x, y):
    M = plate.compliance(basis).after(layout.operator(basis))
    x, y = np.array([1e-4, x]) * basis.patch.a, np.array([y, 0.9, 1 - 1e-4]) * basis.patch.b

    squares = _squares_on_grid(basis, M.T @ M, x, y)

    # Of loads near the rim every product is small: it is told to rounding of itself.
    T = basis.at(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)) @ M.T
    np.testing.assert_allclose(squares.ravel(), np.vecdot(T, T), rtol=1e-10)


@pytest.mark.parametrize("gage_length", [0.0, 0.009])
@pytest.mark.parametrize(
    "patch",
    [OBLONG, Patch(0.1, 0.02, strip=True), Patch(0.1, 0.07, (0.3, -0.25))],
    ids=["plate", "strip", "saddle"],
)
def test_readings_on_a_grid_meet_the_functions_as_by_the_whole_matrix(patch, gage_length):
    across = (1, 1) if patch.strip else (4, 5)
    layout = replace(SensorLayout.regular(patch, 6, across[0]), gage_length=gage_length)
    plate, basis = Plate(patch, tension=3.0, foundation=1e4), SineBasis(patch, 9, across[1])
    compliance = plate.compliance(basis)
    M = compliance.after(layout.operator(basis))
    K = np.random.default_rng(0).normal(size=len(M))
    small = modal_projection(
        layout, basis, compliance, np.full_like(M, np.nan)
    )  # which need not be read

    np.testing.assert_allclose(small(K), K @ M, rtol=0, atol=1e-13 * np.abs(K @ M).max())


@pytest.mark.parametrize("gage_length", [0.0, 0.009])
@given(inside, inside)
def test_a_grid_reads_forces_and_their_moves_as_the_whole_matrix_does(gage_length, x, y):
    layout = replace(SensorLayout.regular(OBLONG, 6, 4), gage_length=gage_length)
    compliance = Plate(OBLONG, tension=3.0).compliance(BASIS)
    M = compliance.after(layout.operator(BASIS))
    places = np.array([[x, y], [0.5, 0.4]]) * [OBLONG.a, OBLONG.b]
    f, fx, fy = (BASIS.at(places, *order) for order in ((0, 0), (1, 0), (0, 1)))
    force, along_x, along_y = np.random.default_rng(0).normal(size=(3, 2, 5))
    grid = element_grid(layout, BASIS, compliance)
    assert grid is not None

    read = grid.under(
        places, np.stack([np.stack([force, along_y], -1), np.stack([along_x, 0 * force], -1)])
    )

    modal = force.T @ f + along_x.T @ fx + along_y.T @ fy
    scale = 1e-13 * np.abs(modal) @ np.abs(M).T
    assert (np.abs(read - modal @ M.T) <= scale).all()
    assert (np.abs(grid.read(modal) - modal @ M.T) <= scale).all()


def scattered():
    """Elements in the order of a grid that do not stand on it."""
    moved = LAYOUT.positions + np.random.default_rng(0).normal(0, 1e-4, LAYOUT.positions.shape)
    return replace(LAYOUT, positions=moved)


@pytest.mark.parametrize(
    ("plate", "layout", "basis"),
    [
        (Plate(OBLONG), scattered(), BASIS),
        (Plate(OBLONG), replace(LAYOUT, shape=None), BASIS),
        (Plate(OBLONG, fluid=True), LAYOUT, BASIS),
        (Plate(BENT), SensorLayout.regular(BENT, 8, 8), SineBasis(BENT, 6, 5)),
    ],
    ids=["moved", "no grid", "fluid", "bent"],
)
def test_what_is_no_product_of_small_matrices_is_met_by_the_whole_one(plate, layout, basis):
    compliance = plate.compliance(basis)
    M = compliance.after(layout.operator(basis))
    K = np.random.default_rng(0).normal(size=len(M))

    np.testing.assert_array_equal(modal_projection(layout, basis, compliance, M)(K), K @ M)
