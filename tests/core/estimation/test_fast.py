"""Fast transforms on a regular grid: the least-squares shape and its error bars, without a matrix.

Coefficients are compared in the scaled unknowns, each times the length of its column of M, in
which every function bends the skin alike.
"""

import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin import (
    Disk,
    Fast,
    LeastSquares,
    Patch,
    Pipeline,
    RankDeficient,
    Refusal,
    SensorLayout,
    Setup,
    Simulator,
    SineBasis,
    basis_for,
    estimator_for,
    load_scene,
)
from kappaskin.estimation import METHODS

EPS, EPS32 = np.finfo(float).eps, np.finfo(np.float32).eps
LONG = Patch(0.12, 0.07)
STRIP = Patch(0.1, 0.02, strip=True)


def of(m, n, Ni, Nj, patch=LONG):
    return SineBasis(patch, Ni, Nj), SensorLayout.regular(patch, m, n)


SETUPS = {
    "10 x 10": of(10, 10, 8, 8),
    "odd": of(9, 7, 8, 5),
    "prime": of(13, 11, 12, 10),
    "many by few": of(32, 3, 31, 2),
    "one element": of(1, 1, 1, 1),
    "one row": of(7, 1, 6, 1),
    "one column": of(1, 6, 1, 6),
    "as many functions as elements along x": of(8, 7, 8, 5),
    "as many functions as elements": of(6, 5, 6, 5),
    "1:100": of(4, 40, 3, 30, Patch(0.01, 1.0)),
    "dome": of(8, 7, 6, 5, Patch(0.12, 0.07, (0.3, 0.25))),
    "strip": of(9, 1, 7, 1, STRIP),
    "strip with rows": of(9, 4, 9, 1, STRIP),
}
every_setup = pytest.mark.parametrize("setup", SETUPS.values(), ids=SETUPS)


def lengths(basis, layout, K=None):
    """Lengths of the columns of M, of the rows whose readings in `K` are there."""
    there = layout.live if K is None else layout.live & np.isfinite(K)
    M = layout.operator(basis)
    return np.linalg.norm(M[there.ravel()], axis=0).reshape(basis.shape)


def readings(basis, layout, frames=(), noise=0.3, seed=0):
    """Curvature (..., 3, P) of a shape whose every function bends alike, with noise."""
    rng, P = np.random.default_rng(seed), len(layout)
    c = rng.normal(size=basis.shape) / lengths(basis, layout) * np.sqrt(3 * P)
    K = (layout.operator(basis) @ c.ravel()).reshape(3, P)
    return K + rng.normal(0, noise, (*frames, 3, P))


def least_squares(basis, layout, K, sigma=1.0):
    """Factored for the readings that are there."""
    return LeastSquares(basis, layout, np.where(np.isfinite(K), sigma, np.inf))(np.nan_to_num(K))


def share_seen(basis, layout, K):
    """The least of the scaled functions' combinations that the readings there are see."""
    A = layout.operator(basis)[np.isfinite(K).ravel() & layout.live.ravel()]
    length = lengths(basis, layout, K)
    if len(A) < basis.size or (length < 1e-14 * lengths(basis, layout)).any():
        return 0.0
    return np.linalg.svd(A / length.ravel(), compute_uv=False)[-1] ** 2


def assert_same_shape(setup, c, expected, tolerance=100 * EPS, K=None):
    length = lengths(*setup, K)
    scale = np.abs(expected * length).max()
    np.testing.assert_allclose((c - expected) * length / scale, 0, atol=tolerance)


def missing(layout, which):
    """Readings to lose (3, P), all three of the elements in columns p and rows q that `which`."""
    m, n = layout.shape
    q, p = np.divmod(np.arange(m * n), m)
    return np.broadcast_to(which(p, q), (3, m * n))


def random(share, seed=1):
    return lambda p, q: np.random.default_rng(seed).random(len(p)) < share


# The answer


@every_setup
def test_the_shape_is_that_of_least_squares_and_takes_no_step(setup):
    K = readings(*setup)

    answer, expected = Fast(*setup)(K), LeastSquares(*setup)(K)

    assert_same_shape(setup, answer.coefficients, expected.coefficients)
    assert answer.steps == 0


@every_setup
def test_the_residual_and_the_noise_are_those_of_least_squares(setup):
    K = readings(*setup)

    answer, expected = Fast(*setup)(K), LeastSquares(*setup)(K)

    np.testing.assert_array_equal(np.isnan(answer.residual), ~setup[1].live)
    np.testing.assert_allclose(answer.residual, expected.residual, atol=1e-11)
    np.testing.assert_allclose(answer.noise, expected.noise, rtol=1e-10)


@every_setup
def test_what_is_predicted_is_the_operator_times_the_coefficients(setup):
    c = np.random.default_rng(0).normal(size=(3, *setup[0].shape)) / lengths(*setup)

    predicted = Fast(*setup).predicted(c)

    M = setup[1].operator(setup[0])
    np.testing.assert_allclose(predicted.reshape(3, -1), c.reshape(3, -1) @ M.T, atol=1e-13)


@every_setup
def test_error_bars_are_those_of_least_squares(setup):
    K, rows = readings(*setup), np.random.default_rng(1).normal(size=(4, setup[0].size))

    answer, expected = Fast(*setup, sigma=0.3)(K), LeastSquares(*setup, sigma=0.3)(K)

    assert_same_spread(setup, answer, expected, rows)


def assert_same_spread(setup, answer, expected, rows, tolerance=1e-12):
    length = lengths(*setup).ravel()
    scale = np.outer(length, length) / np.abs(expected.covariance * np.outer(length, length)).max()
    np.testing.assert_allclose(
        answer.covariance * scale, expected.covariance * scale, rtol=0, atol=tolerance
    )
    np.testing.assert_allclose(answer.sd, expected.sd, rtol=tolerance)
    np.testing.assert_allclose(answer.sd_of(rows), expected.sd_of(rows), rtol=tolerance)
    np.testing.assert_allclose(
        np.sqrt(np.diag(answer.covariance_of(rows))), expected.sd_of(rows), rtol=tolerance
    )


def test_a_batch_is_answered_frame_by_frame(monkeypatch):
    setup = of(10, 9, 8, 7)
    K = readings(*setup, frames=(30,))
    K[::3, 0, 5] = np.nan
    fit = Fast(*setup)
    monkeypatch.setattr("kappaskin.estimation.fast._AT_ONCE", 7 * 3 * 90)

    batch = fit(K)

    for t in range(30):
        one = fit(K[t])
        assert_same_shape(setup, batch.coefficients[t], one.coefficients, 10 * EPS)
        np.testing.assert_allclose(batch.residual[t], one.residual, atol=1e-11)
        assert batch.steps[t] == one.steps
    assert batch.sd.shape == (30, 8, 7)


def test_a_batch_of_no_frames_has_no_answers():
    answer = Fast(*SETUPS["odd"])(np.empty((0, 3, 63)))

    assert answer.coefficients.shape == (0, 8, 5)
    assert answer.residual.shape == (0, 3, 63)


@every_setup
def test_float32_tells_what_float32_can(setup):
    K = readings(*setup).astype(np.float32)

    answer = Fast(*setup, dtype=np.float32)(K)

    assert answer.coefficients.dtype == np.float32
    expected = LeastSquares(*setup)(K.astype(float))
    assert_same_shape(setup, answer.coefficients, expected.coefficients, 10 * EPS32)


# What is missing


MASKS = {
    "one element": (of(12, 10, 11, 9), lambda p, q: (p == 3) & (q == 4)),
    "1 of 20 elements": (of(20, 20, 16, 16), random(0.05)),
    "half of the elements": (of(20, 20, 10, 10), random(0.5)),
    "a row": (of(12, 10, 11, 9), lambda p, q: q == 4),
    "the first row, as many functions as elements": (of(9, 8, 9, 8), lambda p, q: q == 0),
    "a quarter": (of(10, 10, 5, 5), lambda p, q: (p < 5) & (q < 5)),
    "half": (of(10, 10, 4, 4), lambda p, q: p < 5),
    "strip": (of(16, 1, 12, 1, STRIP), lambda p, q: (p % 5) == 4),
}
every_mask = pytest.mark.parametrize(("setup", "which"), MASKS.values(), ids=MASKS)


@every_mask
def test_missing_elements_are_left_out_exactly_in_a_few_steps(setup, which):
    K = readings(*setup)
    K[missing(setup[1], which)] = np.nan
    share = share_seen(*setup, K)

    answer = Fast(*setup)(K)

    expected = least_squares(*setup, K)
    assert_same_shape(setup, answer.coefficients, expected.coefficients, 30 * EPS / share)
    np.testing.assert_array_equal(np.isnan(answer.residual), np.isnan(K) | ~setup[1].live)
    # Conjugate gradients to rounding: ln(2 / eps) / 2 steps for each unit of the condition.
    assert 0 < answer.steps < 20 / np.sqrt(share)


@every_mask
def test_error_bars_without_the_missing_elements_are_those_of_least_squares(setup, which):
    K, rows = readings(*setup), np.random.default_rng(1).normal(size=(4, setup[0].size))
    K[missing(setup[1], which)] = np.nan
    share = share_seen(*setup, K)

    answer, expected = Fast(*setup, sigma=0.3)(K), least_squares(*setup, K, sigma=0.3)

    assert_same_spread(setup, answer, expected, rows, 1e-12 / share)


@every_mask
def test_dead_elements_are_missing_ones(setup, which):
    basis, layout = setup
    K, gone = readings(*setup), missing(layout, which)
    expected = Fast(*setup)(np.where(gone, np.nan, K))

    answer = Fast(basis, layout.without(np.flatnonzero(gone[0])))(K)

    np.testing.assert_array_equal(answer.coefficients, expected.coefficients)
    np.testing.assert_array_equal(answer.residual, expected.residual)


@pytest.mark.parametrize("gone", [[0], [1], [2], [0, 1], [0, 2], [1, 2]])
def test_whole_channels_may_be_dead_at_no_step(gone):
    setup = of(11, 10, 9, 8)
    K = readings(*setup)
    K[gone] = np.nan

    answer, expected = Fast(*setup)(K), least_squares(*setup, K)

    assert_same_shape(setup, answer.coefficients, expected.coefficients, K=K)
    np.testing.assert_allclose(answer.unit_sd, expected.unit_sd, rtol=1e-12)
    assert answer.steps == 0


def test_float32_leaves_out_what_is_missing_as_well_as_float32_can():
    setup = of(20, 20, 16, 16)
    K = readings(*setup).astype(np.float32)
    K[missing(setup[1], random(0.05))] = np.nan

    answer = Fast(*setup, dtype=np.float32)(K)

    expected = least_squares(*setup, K.astype(float))
    assert_same_shape(setup, answer.coefficients, expected.coefficients, 50 * EPS32)
    assert 0 < answer.steps < 20


@pytest.mark.parametrize("size", [1e-200, 1e-30, 1e30, 1e70])
def test_tiny_and_huge_readings_are_fitted_alike(size):
    setup = of(12, 10, 11, 9)
    K = readings(*setup)
    K[missing(setup[1], random(0.05))] = np.nan
    fit = Fast(*setup)

    assert_same_shape(setup, fit(size * K).coefficients / size, fit(K).coefficients)


def test_a_frame_of_zeros_with_one_missing_has_no_shape():
    K = np.zeros((3, 63))
    K[1, 4] = np.nan

    assert not Fast(*SETUPS["odd"])(K).coefficients.any()


def test_readings_weigh_by_their_own_sigma():
    setup = of(12, 10, 9, 9)
    sigma = np.random.default_rng(3).uniform(0.1, 1, (3, 120))
    K = readings(*setup)

    answer, expected = Fast(*setup, sigma)(K), LeastSquares(*setup, sigma)(K)

    assert_same_shape(setup, answer.coefficients, expected.coefficients, 1e4 * EPS)
    rows = np.random.default_rng(1).normal(size=(4, setup[0].size))
    assert_same_spread(setup, answer, expected, rows, 1e-11)


def test_channels_weigh_by_their_own_sigma_at_no_step():
    setup = of(12, 10, 9, 9)
    sigma = np.repeat([[0.1], [1.0], [3.0]], 120, axis=1)
    K = readings(*setup)

    answer, expected = Fast(*setup, sigma)(K), LeastSquares(*setup, sigma)(K)

    assert_same_shape(setup, answer.coefficients, expected.coefficients, 1e3 * EPS)
    np.testing.assert_allclose(answer.sd, expected.sd, rtol=1e-12)
    assert answer.steps == 0


@st.composite
def grids(draw):
    m, n = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    Ni, Nj = draw(st.integers(1, m)), draw(st.integers(1, n))
    return of(m, n, Ni, Nj), draw(st.integers(0, 2**32)), draw(st.sampled_from([0, 0.1, 0.5, 0.9]))


@settings(max_examples=60)
@given(grids())
def test_any_set_of_missing_readings_in_any_order_gives_the_shape_of_the_rest_or_is_refused(drawn):
    (basis, layout), seed, share_missing = drawn
    rng = np.random.default_rng(seed)
    K = readings(basis, layout, seed=seed)
    K[rng.random(K.shape) < share_missing] = np.nan
    order = rng.permutation(len(layout))
    shuffled = SensorLayout.scattered(LONG, layout.positions[order])
    share = share_seen(basis, layout, K)

    try:
        answer = Fast(basis, shuffled)(K[:, order])
    except RankDeficient:
        assert share < 1e-7
    else:
        expected = least_squares(basis, layout, K)
        tolerance = 100 * EPS / share
        assert_same_shape((basis, layout), answer.coefficients, expected.coefficients, tolerance)


# Large grids


def waves(patch, m, n, modes):
    """Curvature (3, m n) of `modes`, each i, j and an amplitude, from Eqs. 3-5 term by term."""
    x, y = (length[:, None] for length in patch.cell_centres(m, n))
    K = np.zeros((3, n, m))
    for i, j, c in modes:
        kx, ky = i * np.pi / patch.a, j * np.pi / patch.b
        K[0] -= c * kx**2 * np.sin(ky * y) @ np.sin(kx * x).T
        K[1] -= c * ky**2 * np.sin(ky * y) @ np.sin(kx * x).T
        K[2] += c * kx * ky * np.cos(ky * y) @ np.cos(kx * x).T
    return K.reshape(3, -1)


@pytest.mark.slow
def test_a_grid_of_1024_by_1024_returns_its_waves():
    modes = [(1, 1, 1e-3), (3, 700, 1e-6), (1023, 2, 2e-6), (1022, 1023, -3e-6)]
    fit = Fast(*of(1024, 1024, 1023, 1023))

    c = fit(waves(LONG, 1024, 1024, modes)).coefficients

    for i, j, expected in modes:
        # The arguments of the sines above, up to 3000, are themselves rounded.
        assert c[i - 1, j - 1] == pytest.approx(expected, rel=1e-11)
        c[i - 1, j - 1] = 0
    assert np.abs(c).max() < 1e-16


@pytest.mark.cases("float64-0.001", "float32-1.0")
@pytest.mark.slow
@pytest.mark.parametrize("side", [1e-3, 1.0])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_512_by_512_readings_leave_no_shape_in_the_residual(side, dtype):
    eps = np.finfo(dtype).eps
    basis, layout = of(512, 512, 511, 511, Patch(side, side))
    K = np.random.default_rng(0).normal(size=(3, 512**2))
    i = np.arange(1, 512)
    scale = np.add.outer(i**2, i**2) * (np.pi / side) ** 2 * 512 / 2  # within 13 % of the lengths
    fit = Fast(basis, layout, dtype=dtype)

    answer = fit(K)

    left = fit(answer.residual).coefficients.astype(float) * scale
    assert np.linalg.norm(left) < 5 * eps * np.linalg.norm(K)
    seen = np.linalg.norm(answer.coefficients * scale)
    assert seen == pytest.approx(np.sqrt(511**2), rel=0.1)


def test_a_skin_of_1_mm_bends_as_one_of_1_m():
    K = np.random.default_rng(0).normal(size=(3, 128**2))

    small, large = (
        Fast(*of(128, 128, 127, 127, Patch(side, side)))(K).coefficients for side in (1e-3, 1.0)
    )

    np.testing.assert_allclose(1e6 * small, large, rtol=1e-11, atol=1e-14 * np.abs(large).max())


def test_the_memory_is_less_than_six_times_the_readings():
    setup = of(128, 128, 127, 127)
    K = np.random.default_rng(0).normal(size=(3, 128**2))
    Fast(*setup)(K)
    tracemalloc.start()

    answer = Fast(*setup)(K)

    held = [answer.coefficients, answer.residual, answer.sd]
    peak = tracemalloc.get_traced_memory()[1] / K.nbytes
    tracemalloc.stop()
    assert len(held) == 3
    assert peak < 6


# The grid


@pytest.mark.parametrize("which", [random(0.1), lambda p, q: q == 2], ids=["some", "a row"])
def test_elements_that_were_left_out_are_missing_ones(which):
    basis, layout = of(12, 10, 8, 7)
    gone = missing(layout, which)
    K = readings(basis, layout)
    left = SensorLayout.scattered(LONG, layout.positions[~gone[0]])

    answer = Fast(basis, left)(K[:, ~gone[0]])

    expected = LeastSquares(basis, left)(K[:, ~gone[0]])
    assert_same_shape((basis, left), answer.coefficients, expected.coefficients, 1e3 * EPS)
    np.testing.assert_allclose(answer.residual, expected.residual, atol=1e-11)
    np.testing.assert_allclose(answer.sd, expected.sd, rtol=1e-11)


def test_positions_that_were_computed_otherwise_are_the_same_grid():
    basis, layout = of(30, 20, 8, 7)
    x, y = (np.linspace(0, side, 2 * k + 1)[1::2] for side, k in ((0.12, 30), (0.07, 20)))
    other = SensorLayout.scattered(LONG, np.stack(np.meshgrid(x, y), -1).reshape(-1, 2))
    K = readings(basis, layout)

    np.testing.assert_array_equal(
        Fast(basis, other)(K).coefficients, Fast(basis, layout)(K).coefficients
    )


def moved(layout, which, by):
    positions = layout.positions.copy()
    positions[which] += by
    return positions


REGULAR = of(10, 8, 6, 6)[1]


@pytest.mark.parametrize(
    "positions",
    [
        moved(REGULAR, 17, (1e-8, 0)),
        moved(REGULAR, slice(None), (0, 1e-8)),
        moved(REGULAR, 17, -REGULAR.positions[17]),
        np.vstack([REGULAR.positions, REGULAR.positions[:1]]),
        REGULAR.positions[::3],
        np.random.default_rng(0).uniform(0, 0.07, (80, 2)),
        [(1e-9, 1e-9), (0.05, 0.05)],
    ],
    ids=["one off", "all off", "one at the corner", "twice", "too few", "random", "far too fine"],
)
def test_elements_that_stand_on_no_grid_are_refused(positions):
    layout = SensorLayout.scattered(LONG, positions)

    with pytest.raises(
        Refusal, match=r"regular grid.* elements at other positions.*use least-squares"
    ):
        Fast(SineBasis(LONG, 1, 1), layout)


def test_half_of_a_grid_s_elements_are_enough_to_stand_on_it():
    half = REGULAR.positions[np.r_[0:30, 30:80:5]]  # three rows, and the first column

    Fast(SineBasis(LONG, 1, 1), SensorLayout.scattered(LONG, half))

    with pytest.raises(Refusal, match="regular grid"):
        Fast(SineBasis(LONG, 1, 1), SensorLayout.scattered(LONG, half[:-1]))


def test_a_layout_is_not_taken_at_its_word():
    untrue = replace(REGULAR, positions=REGULAR.positions * 0.9)

    with pytest.raises(Refusal, match="regular grid"):
        Fast(SineBasis(LONG, 6, 6), untrue)


# What is refused


@pytest.mark.parametrize(
    ("basis", "layout", "match"),
    [
        (basis_for(LONG, "clamped", 4, 4), REGULAR, "expected sines.*got ClampedBasis; use least"),
        (
            SineBasis(Patch(0.04, 0.03, 0.02), 4, 4),
            SensorLayout.regular(Patch(0.04, 0.03, 0.02), 9, 9),
            "expected a flat skin.* use least-squares",
        ),
        (
            basis_for(Disk(0.05), "hinged", 3, 3),
            SensorLayout.regular(Disk(0.05), 9, 9),
            "expected sines.*got DiskBasis",
        ),
        (SineBasis(LONG, 11, 8), REGULAR, "at most 10 x 8 functions.*got 11 x 8.*least-squares"),
        (SineBasis(LONG, 4, 9), REGULAR, "at most 10 x 8 functions.*got 4 x 9"),
        (SineBasis(Patch(0.1, 0.1), 4, 4), REGULAR, "use one"),
    ],
)
def test_what_transforms_cannot_do_is_refused_with_the_remedy(basis, layout, match):
    with pytest.raises(Refusal, match=match):
        Fast(basis, layout)


@pytest.mark.parametrize(
    ("setup", "which"),
    [
        (of(40, 40, 20, 20), lambda p, q: (p < 20) & (q < 20)),
        (of(24, 24, 23, 23), lambda p, q: p < 12),
        (of(20, 20, 16, 16), lambda p, q: (p < 10) & (q < 10)),
        (of(24, 24, 23, 23), lambda p, q: (p % 12 < 9) & (q % 12 < 9)),
    ],
    ids=["a quarter", "half", "a quarter of fewer", "blocks"],
)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_elements_missing_that_leave_shapes_unseen_are_refused(setup, which, dtype):
    K = readings(*setup)
    K[missing(setup[1], which)] = np.nan

    with pytest.raises(RankDeficient, match=r"readings (barely )?determine.* readings are missing"):
        Fast(*setup, dtype=dtype)(K)


def test_functions_that_no_reading_sees_are_refused_with_their_number():
    # Of the highest functions, xy is zero at every element.
    setup = of(8, 8, 8, 8)
    K = readings(*setup)
    K[:2] = np.nan

    with pytest.raises(RankDeficient, match="with 64 readings determine 49 of the 64"):
        Fast(*setup)(K)


def test_one_shape_that_no_reading_sees_is_refused():
    # At the far ends and the middle of three elements, the third sine is as the first.
    basis, layout = of(3, 1, 3, 1)
    K = readings(basis, layout)
    K[:, 1] = np.nan
    K[1:] = np.nan
    K[2, 0] = 0.1

    with pytest.raises(RankDeficient, match="barely determine some of the 3"):
        Fast(basis, layout)(K)


def test_too_few_readings_and_none_are_refused():
    setup = of(10, 10, 8, 8)
    K = readings(*setup)
    K.ravel()[63:] = np.nan

    with pytest.raises(RankDeficient, match=r"with 63 readings determine at most 63 of the 64"):
        Fast(*setup)(K)
    with pytest.raises(RankDeficient, match="no readings are left; check the connection"):
        Fast(*setup)(np.full((3, 100), np.nan))
    with pytest.raises(RankDeficient, match="no readings are left"):
        Fast(setup[0], setup[1].without(range(100)))


def test_float32_refuses_what_it_cannot_tell_and_float64_can():
    setup = of(10, 10, 6, 6)
    K = readings(*setup)
    K[missing(setup[1], lambda p, q: p < 5)] = np.nan
    assert 1e-7 < share_seen(*setup, K) < 1e-4

    assert_same_shape(
        setup, Fast(*setup)(K).coefficients, least_squares(*setup, K).coefficients, 1e-8
    )
    with pytest.raises(RankDeficient, match=r"sensitivity is below 0\.0003"):
        Fast(*setup, dtype=np.float32)(K)


def test_error_bars_are_refused_where_too_many_readings_weigh_otherwise():
    setup = of(48, 40, 8, 8)
    sigma = np.random.default_rng(0).uniform(0.9, 1.1, (3, 48 * 40))

    answer = Fast(*setup, sigma)(np.ones((3, 48 * 40)))

    assert np.isfinite(answer.coefficients).all()
    with pytest.raises(Refusal, match=r"at most 4096 of 5760 readings.*coefficients alone"):
        _ = answer.sd


def test_a_covariance_that_no_memory_holds_is_refused():
    answer = Fast(*of(128, 128, 127, 127))(np.zeros((3, 128**2)))

    with pytest.raises(Refusal, match=r"16129 x 16129.*covariance_of"):
        _ = answer.covariance


# In the house


def test_it_goes_by_its_name():
    assert isinstance(estimator_for("fast", *SETUPS["10 x 10"]), Fast)
    assert list(METHODS).index("fast") == list(METHODS).index("direct") + 1


def test_a_pipeline_runs_on_it():
    scene = load_scene("centre")
    frame = Simulator(scene).frame(0, time.monotonic)

    fast, plain = (
        Pipeline(scene.sensor(), Setup(method=method))(frame)
        for method in ("fast", "least-squares")
    )

    np.testing.assert_allclose(fast.surface, plain.surface, atol=1e-15)
    np.testing.assert_allclose(fast.contact.position, plain.contact.position, rtol=1e-9)
    np.testing.assert_allclose(fast.contact.position_sd, plain.contact.position_sd, rtol=1e-9)
