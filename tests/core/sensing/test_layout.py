"""Where the elements are, and the operator from coefficients to their curvature."""

import numpy as np
import pytest

from kappaskin import Patch, Refusal, SensorLayout, SineBasis

PATCH = Patch(0.1, 0.05)


def test_regular_elements_sit_at_cell_centres_with_x_running_fastest():
    layout = SensorLayout.regular(PATCH, 4, 2)

    assert layout.shape == (4, 2)
    np.testing.assert_allclose(layout.positions[3 + 4 * 1], [0.0875, 0.0375])
    np.testing.assert_allclose(layout.positions[:4, 0], [0.0125, 0.0375, 0.0625, 0.0875])
    np.testing.assert_allclose(layout.positions[:4, 1], 0.0125)


def test_all_three_channels_of_a_dead_element_are_dead():
    layout = SensorLayout.regular(PATCH, 4, 2).without([1, 6])

    assert np.flatnonzero(~layout.live.any(axis=0)).tolist() == [1, 6]
    assert layout.live.sum() == 3 * 6


def test_dead_elements_add_up_and_leave_the_first_layout_alone():
    whole = SensorLayout.regular(PATCH, 4, 2)

    layout = whole.without([1]).without([6])

    assert np.flatnonzero(~layout.live[0]).tolist() == [1, 6]
    assert whole.live.all()


@pytest.mark.parametrize("element", [-1, 8])
def test_a_dead_element_that_is_not_there_is_refused(element):
    with pytest.raises(Refusal, match=rf"between 0 and 7, got \[{element}\]"):
        SensorLayout.regular(PATCH, 4, 2).without([element])


@pytest.mark.parametrize("outside", [(0.11, 0.02), (0.05, -0.001), (np.nan, 0.02), (0.02, np.inf)])
def test_elements_outside_the_patch_are_refused_by_number_and_position(outside):
    with pytest.raises(Refusal, match=r"1 of 3 elements lie outside .*0\.1 x 0\.05 m: element 1"):
        SensorLayout.scattered(PATCH, [(0.01, 0.01), outside, (0.02, 0.01)])


@pytest.mark.parametrize("positions", [[], [0.01, 0.02], [[0.01, 0.02, 0.0]], [[[0.01, 0.02]]]])
def test_positions_of_another_shape_are_refused(positions):
    got = str(np.shape(positions)).replace("(", r"\(").replace(")", r"\)")
    with pytest.raises(Refusal, match=rf"expected positions of shape \(P, 2\).*got {got}"):
        SensorLayout.scattered(PATCH, positions)


def test_live_channels_of_another_shape_are_refused():
    with pytest.raises(Refusal, match=r"expected live of shape \(3, 2\), got \(2, 3\)"):
        SensorLayout(PATCH, np.full((2, 2), 0.01), np.ones((2, 3), bool))


def test_a_basis_on_another_patch_is_refused():
    with pytest.raises(Refusal, match=r"a=0\.1, b=0\.05.*a=0\.2, b=0\.05"):
        SensorLayout.regular(PATCH, 4, 2).operator(SineBasis(Patch(0.2, 0.05), 2, 2))


def test_the_operator_gives_the_second_differences_of_the_surface():
    basis, layout = SineBasis(PATCH, 3, 2), SensorLayout.regular(PATCH, 4, 3)
    c, h = np.random.default_rng(0).normal(size=basis.size), 1e-5

    xx, yy, xy = (layout.operator(basis) @ c).reshape(3, -1)

    def w(dx, dy):
        return basis.at(layout.positions + np.array([dx, dy]) * h) @ c

    for measured, differences in (
        (xx, w(1, 0) - 2 * w(0, 0) + w(-1, 0)),
        (yy, w(0, 1) - 2 * w(0, 0) + w(0, -1)),
        (xy, (w(1, 1) - w(1, -1) - w(-1, 1) + w(-1, -1)) / 4),
    ):
        np.testing.assert_allclose(measured, differences / h**2, rtol=0, atol=0.1)
        assert np.abs(measured).max() > 500


def squared_norms(m, n, Ni, Nj):
    """d_ij of PHYSICS section 1, the other norms of Ni = m and Nj = n among them."""
    ki, kj = np.meshgrid(*SineBasis(PATCH, Ni, Nj).wavenumbers, indexing="ij")
    i, j = np.meshgrid(np.arange(1, Ni + 1), np.arange(1, Nj + 1), indexing="ij")
    d = m * n / 4 * (ki**4 + kj**4 + ki**2 * kj**2)
    rim = (i == m) | (j == n)
    d[rim] = (m * n / 2 * (ki**4 + kj**4))[rim]
    corner = (i == m) & (j == n)
    d[corner] = (m * n * (ki**4 + kj**4))[corner]
    return d.ravel()


@pytest.mark.parametrize(
    ("m", "n", "Ni", "Nj"),
    [(10, 10, 8, 8), (10, 10, 9, 9), (7, 12, 6, 11), (10, 10, 10, 9), (6, 9, 6, 9), (1, 3, 1, 2)],
)
def test_the_operators_columns_are_orthogonal_with_the_known_norms(m, n, Ni, Nj):
    M = SensorLayout.regular(PATCH, m, n).operator(SineBasis(PATCH, Ni, Nj))

    length = np.sqrt(squared_norms(m, n, Ni, Nj))

    np.testing.assert_allclose(M.T @ M / np.outer(length, length), np.eye(Ni * Nj), atol=1e-12)


def test_functions_beyond_the_elements_are_not_orthogonal():
    M = SensorLayout.regular(PATCH, 10, 10).operator(SineBasis(PATCH, 12, 8))
    scaled = M / np.linalg.norm(M, axis=0)

    assert np.abs(scaled.T @ scaled - np.eye(96)).max() > 0.1
