"""A skin bent along x: its rest shape, the null mode, what its ends decide, its loads."""

import math

import numpy as np
import pytest

from kappaskin import (
    LeastSquares,
    Patch,
    Plate,
    PointLoad,
    RankDeficient,
    Refusal,
    SensorLayout,
    SineBasis,
    basis_for,
)

R = 12.9e-3
FINGERTIP = Patch(math.pi * R, 0.02, R, strip=True)


def test_the_skin_at_rest_lies_on_its_circle():
    x = np.linspace(0, FINGERTIP.a, 9)

    points, normals = FINGERTIP.at_rest(np.column_stack([x, np.full(9, 0.01)]))

    centre = np.array([FINGERTIP.a / 2, 0.01, -R])
    np.testing.assert_allclose(points - centre, R * normals, atol=1e-15)
    np.testing.assert_allclose(points[4], [FINGERTIP.a / 2, 0.01, 0.0], atol=1e-17)


def test_the_flat_skin_is_the_limit_of_a_large_radius():
    p = np.random.default_rng(0).uniform(0, 0.1, (20, 2))

    bent, flat = Patch(0.1, 0.1, 1e6).at_rest(p), Patch(0.1, 0.1).at_rest(p)

    np.testing.assert_allclose(bent[0], flat[0], atol=2e-9)
    np.testing.assert_allclose(bent[1], flat[1], atol=1e-7)


@pytest.mark.parametrize("radius", [0.0, -0.02, math.nan, 0.0159])
def test_a_radius_smaller_than_the_arc_allows_is_refused(radius):
    with pytest.raises(Refusal, match=r"is a full circle at radius 0\.01592 m"):
        Patch(0.1, 0.1, radius)


def test_the_first_function_of_half_a_circle_bends_nothing():
    layout = SensorLayout.regular(FINGERTIP, 10, 1)

    M = layout.operator(SineBasis(FINGERTIP, 8, 1))

    assert np.abs(M[:10, 0]).max() < 1e-10 * np.abs(M[:10, 1]).min()


def test_pinned_ends_decide_what_curvature_cannot_see():
    layout, basis = SensorLayout.regular(FINGERTIP, 10, 1), SineBasis(FINGERTIP, 8, 1)
    c = 1e-4 * np.random.default_rng(1).normal(size=(8, 1))
    c[0] = -np.sum(c[2::2, 0] / np.arange(3, 8, 2))
    K = (layout.operator(basis) @ c.ravel()).reshape(3, -1)

    np.testing.assert_allclose(LeastSquares(basis, layout)(K).coefficients, c, atol=1e-17)


def test_sliding_ends_of_half_a_circle_leave_it_undecided_and_that_is_refused():
    layout = SensorLayout.regular(FINGERTIP, 10, 1)

    with pytest.raises(RankDeficient, match="determine 7 of the 8"):
        LeastSquares(SineBasis(FINGERTIP, 8, 1, sliding=True), layout)
    with pytest.raises(Refusal, match="moves as a whole without bending"):
        Plate(FINGERTIP).compliance(SineBasis(FINGERTIP, 8, 1, sliding=True))


def test_sliding_ends_of_a_shorter_arc_are_decided():
    patch = Patch(2.0 * R, 0.02, R, strip=True)
    layout, basis = SensorLayout.regular(patch, 10, 1), SineBasis(patch, 6, 1, sliding=True)
    c = 1e-4 * np.random.default_rng(2).normal(size=(6, 1))
    K = (layout.operator(basis) @ c.ravel()).reshape(3, -1)

    np.testing.assert_allclose(LeastSquares(basis, layout)(K).coefficients, c, atol=1e-16)


def test_one_ritz_term_is_equation_10_as_corrected():
    load, EI = PointLoad(FINGERTIP.a / 2, 0.01, 0.02), 1.0  # 1 N per metre of width

    c = Plate(FINGERTIP, EI).deflection([load], SineBasis(FINGERTIP, 3, 1)).ravel()

    a0 = -(R**3) / (72 * math.pi * EI)
    np.testing.assert_allclose(c, [-a0, 0, 3 * a0], atol=1e-14 * R**3)


def test_the_ritz_series_converges_to_the_pinned_arc():
    basis, load = SineBasis(FINGERTIP, 160, 1), PointLoad(FINGERTIP.a / 2, 0.01, 0.02)

    c = Plate(FINGERTIP, 1.0).deflection([load], basis).ravel()

    u = float(basis.at(load.centre()[None])[0] @ c)
    assert u / R**3 == pytest.approx(0.018942, abs=1e-6)


def test_a_cylinder_skins_first_function_is_seen_along_its_axis():
    patch = Patch(math.pi * R, 0.03, R)
    layout = SensorLayout.regular(patch, 10, 10)
    c = 1e-4 * np.random.default_rng(3).normal(size=(8, 8))
    for edge in ("sliding", "hinged"):
        basis = basis_for(patch, edge, 8, 8)
        if basis.free is not None:
            c[0] = basis.free[:8] @ c[1:].ravel()
        K = (layout.operator(basis) @ c.ravel()).reshape(3, -1)

        fit = LeastSquares(basis, layout)

        np.testing.assert_allclose(fit(K).coefficients, c, atol=1e-15)
        assert fit.condition < 50


def test_the_twist_turns_with_the_tangential_displacement():
    """On half a circle it goes as k - 1/k, not k (PHYSICS section 4)."""
    patch = Patch(math.pi * R, 0.03, R)
    p = np.array([[0.3 * patch.a, 0.2 * patch.b]])
    basis = SineBasis(patch, 3, 1, sliding=True)

    twist = SensorLayout.scattered(patch, p).operator(basis)[2]
    plain = basis.at(p, 1, 1)[0]

    # The constant of the even function keeps its two ends at rest.
    theta, Z = 0.3 * math.pi, math.pi / 0.03 * math.cos(0.2 * math.pi)
    k = np.array([1, 2, 3])
    rest = np.where(k % 2, 0, 1 / k) * Z / R
    np.testing.assert_allclose(twist - rest, (k - 1 / k) * np.cos(k * theta) * Z / R, atol=1e-9)
    np.testing.assert_allclose(plain, k * np.cos(k * theta) * Z / R, rtol=1e-12)


def test_a_strip_has_one_function_along_y_and_reads_xx_alone():
    with pytest.raises(Refusal, match="expected 8 x 1 functions, got 8 x 8"):
        SineBasis(FINGERTIP, 8, 8)

    assert SensorLayout.regular(FINGERTIP, 10, 1).live.sum() == 10


def test_missing_readings_of_a_pinned_skin_are_left_out_exactly():
    patch = Patch(math.pi * R, 0.03, R)
    layout, basis = SensorLayout.regular(patch, 10, 10), SineBasis(patch, 8, 8)
    rng = np.random.default_rng(4)
    K = rng.normal(size=(3, 100))
    K[:, rng.choice(100, 9, replace=False)] = np.nan
    fit, there = LeastSquares(basis, layout), np.isfinite(K).ravel()

    answer = fit(K)

    W = basis.free
    A = (layout.operator(basis) @ W)[there]
    g = np.linalg.lstsq(A, K.ravel()[there])[0]
    covariance = W @ np.linalg.inv(A.T @ A) @ W.T * answer.noise**2
    np.testing.assert_allclose(answer.coefficients.ravel(), W @ g, rtol=0, atol=1e-16)
    np.testing.assert_allclose(answer.covariance, covariance, rtol=1e-9, atol=1e-20)
    left = K.ravel()[there] - A @ g
    assert answer.noise == pytest.approx(math.sqrt(left @ left / (there.sum() - W.shape[1])))
