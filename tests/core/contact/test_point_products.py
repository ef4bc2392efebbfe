"""Products of point loads' readings, as few waves and small matrices, against whole matrices."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Patch, Plate, SensorLayout, SineBasis
from kappaskin.contact.point import load_responses, modal_projection

OBLONG = Patch(0.1, 0.07)
BASIS = SineBasis(OBLONG, 7, 5)
LAYOUT = SensorLayout.regular(OBLONG, 6, 4).without([3, 14])
inside = st.floats(1e-4, 1 - 1e-4)


class Whole:
    """Matrices of a skin: T = M t, and how it gives."""

    def __init__(self, plate, layout, basis):
        self.basis, compliance = basis, plate.compliance(basis)
        self.M = compliance.after(layout.curvature_operator(basis))
        self.C = compliance.after(np.eye(basis.size))
        self.loads = load_responses(basis, self.M.T @ self.M, self.C)

    def products(self, x, y, K):
        place = np.array([[x, y]])
        F = np.vstack([self.basis.at(place, *order) for order in ((0, 0), (1, 0), (0, 1))])
        T, tx, ty = F @ self.M.T
        give = F[0] @ self.C @ F[0]
        return [T @ T, T @ tx, T @ ty, tx @ tx, tx @ ty, ty @ ty, T @ K, tx @ K, ty @ K, give]

    def sizes(self, x, y, K):
        """What each product would be at most, of vectors as long."""
        tt, _, _, xx, _, yy, *_, give = self.products(x, y, K)
        t, x_, y_, k = np.sqrt([tt, xx, yy, K @ K])
        return np.array([tt, t * x_, t * y_, xx, x_ * y_, yy, t * k, x_ * k, y_ * k, give])


BENT = Patch(0.03, 0.02, 12.9e-3)
SKINS = {
    "flat": Whole(Plate(OBLONG), LAYOUT, BASIS),
    "fluid": Whole(Plate(OBLONG, fluid=True), LAYOUT, BASIS),
    "bent": Whole(Plate(BENT), SensorLayout.regular(BENT, 8, 8), SineBasis(BENT, 6, 5)),
}


@pytest.mark.parametrize("skin", SKINS.values(), ids=SKINS)
@given(inside, inside)
def test_products_of_sines_are_those_of_whole_readings_up_to_the_rim(skin, x, y):
    K = np.random.default_rng(0).normal(size=len(skin.M))
    x, y = x * skin.basis.patch.a, y * skin.basis.patch.b

    told = skin.loads.at(x, y, K @ skin.M)

    # Of loads near the rim every product is small: it is told to rounding of itself.
    assert (np.abs(np.subtract(told, skin.products(x, y, K))) < 1e-10 * skin.sizes(x, y, K)).all()


@pytest.mark.parametrize("skin", SKINS.values(), ids=SKINS)
def test_squares_on_a_grid_are_those_at_each_place(skin):
    patch, h = skin.basis.patch, np.zeros(skin.basis.size)
    x, y = np.array([1e-4, 0.3, 0.8]) * patch.a, np.array([0.1, 0.9]) * patch.b

    squares = skin.loads.on_grid(x, y)

    at_each = [[skin.loads.at(u, v, h).tt for u in x] for v in y]
    np.testing.assert_allclose(squares, at_each, rtol=1e-12)


@pytest.mark.parametrize("gage_length", [0.0, 0.009])
@pytest.mark.parametrize("patch", [OBLONG, Patch(0.1, 0.02, strip=True)], ids=["plate", "strip"])
def test_readings_on_a_grid_meet_the_functions_as_by_the_whole_matrix(patch, gage_length):
    across = (1, 1) if patch.strip else (4, 5)
    layout = replace(SensorLayout.regular(patch, 6, across[0]), gage_length=gage_length)
    plate, basis = Plate(patch, tension=3.0, foundation=1e4), SineBasis(patch, 9, across[1])
    compliance = plate.compliance(basis)
    M = compliance.after(layout.curvature_operator(basis))
    K = np.random.default_rng(0).normal(size=len(M))
    small = modal_projection(
        layout, basis, compliance, np.full_like(M, np.nan)
    )  # which need not be read

    np.testing.assert_allclose(small(K), K @ M, rtol=0, atol=1e-13 * np.abs(K @ M).max())


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
    M = compliance.after(layout.curvature_operator(basis))
    K = np.random.default_rng(0).normal(size=len(M))

    np.testing.assert_array_equal(modal_projection(layout, basis, compliance, M)(K), K @ M)
