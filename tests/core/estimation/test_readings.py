"""The laws of the estimators for other readings than curvature: heights, slopes, mixtures."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from kappaskin import (
    Patch,
    Plate,
    PointLoad,
    RankDeficient,
    Refusal,
    SensorLayout,
    SineBasis,
    basis_for,
    estimator_for,
)
from kappaskin.contact import ObjectFinder
from kappaskin.estimation import METHODS

SKIN = Patch(0.1, 0.08)
BASIS = SineBasis(SKIN, 6, 5)
GRID = SensorLayout.regular(SKIN, 10, 9)
P = len(GRID)
EVERY, X, Y = np.arange(P), 0.0, math.pi / 2
PLACES = np.random.default_rng(2).uniform((0.005, 0.005), (0.095, 0.075), (60, 2))
SD = {"height": 1e-5, "slope": 1e-3, "curvature": 0.2, "twist": 0.2}

LAYOUTS = {
    "curvature": GRID.reading(
        np.tile(EVERY, 3),
        np.repeat(["curvature", "curvature", "twist"], P),
        np.repeat([X, Y, 0.0], P),
    ),
    "height": GRID.reading(EVERY, "height"),
    "slope": GRID.reading(np.tile(EVERY, 2), "slope", np.repeat([X, Y], P)),
    "mixed": GRID.reading(
        np.tile(EVERY, 3), np.repeat(["height", "slope", "slope"], P), np.repeat([X, X, Y], P)
    ),
    "scattered": SensorLayout.scattered(SKIN, PLACES).reading(
        np.random.default_rng(3).integers(0, 60, 150),
        np.random.default_rng(4).choice(["height", "slope", "curvature", "twist"], 150),
        np.random.default_rng(5).uniform(-4, 9, 150),
    ),
}
every_layout = pytest.mark.parametrize("name", LAYOUTS)
LINEAR = [method for method in METHODS if method != "finite-slope"]
every_linear = pytest.mark.parametrize("method", LINEAR)


@cache
def truth():
    """Coefficients of a plate under three loads, some mm deep."""
    loads = [PointLoad(0.03, 0.03, 0.2), PointLoad(0.07, 0.05, 0.1), PointLoad(0.05, 0.04, 0.1)]
    return Plate(SKIN, rigidity=5e-3).deflection(loads, BASIS).ravel()


def read(layout, seed=None, frames=None):
    """Readings of the truth, by central differences of its sines written out here; sigma."""
    reads, h = layout.reads, 1e-4
    x, y = layout.positions[reads.element].T
    i, j = (index.ravel() for index in np.indices(BASIS.shape) + 1)

    def w(x, y):
        sines = np.sin(np.outer(x, i * np.pi / SKIN.a)) * np.sin(np.outer(y, j * np.pi / SKIN.b))
        return sines @ truth()

    c, s = h * np.cos(reads.direction), h * np.sin(reads.direction)
    found = {
        "height": w(x, y),
        "slope": (w(x + c, y + s) - w(x - c, y - s)) / (2 * h),
        "curvature": (w(x + c, y + s) - 2 * w(x, y) + w(x - c, y - s)) / h**2,
        "twist": (w(x + h, y + h) - w(x + h, y - h) - w(x - h, y + h) + w(x - h, y - h))
        / (4 * h**2),
    }
    exact = np.choose([list(found).index(q) for q in reads.quantity], list(found.values()))
    sigma = np.array([SD[q] for q in reads.quantity])
    if seed is None:
        return exact, sigma
    shape = (layout.channels,) if frames is None else (frames, layout.channels)
    return exact + np.random.default_rng(seed).normal(size=shape) * sigma, sigma


def possible(method, name):
    """Whether this method takes these readings: fast ones are along x or y, on a grid."""
    return not (method == "fast" and name == "scattered")


@every_linear
@every_layout
def test_a_shape_of_the_functions_comes_back_from_any_readings(method, name):
    if not possible(method, name):
        pytest.skip("refused, below")
    K, sigma = read(LAYOUTS[name])

    answer = estimator_for(method, BASIS, LAYOUTS[name], sigma)(K)

    # Central differences of the truth are off by (k h)^2 / 12; priors draw to zero by less.
    scale = np.abs(truth()).max()
    np.testing.assert_allclose(answer.coefficients.ravel(), truth(), rtol=0, atol=1e-3 * scale)


@every_linear
@every_layout
def test_intervals_hold_95_percent_of_any_readings(method, name):
    if not possible(method, name) or method in ("tracking", "robust"):
        pytest.skip("a memory averages frames; robust is least squares of what it trusts")
    K, sigma = read(LAYOUTS[name], seed=0, frames=300)

    answer = estimator_for(method, BASIS, LAYOUTS[name], sigma)(K)

    off = (answer.coefficients.reshape(300, -1) - truth()) / answer.sd.reshape(300, -1)
    assert 0.93 <= np.mean(np.abs(off) < 1.96) <= 0.97


@every_linear
@every_layout
def test_the_methods_agree_where_readings_are_missing(method, name):
    if not possible(method, name):
        pytest.skip("refused, below")
    K, sigma = read(LAYOUTS[name], seed=1)
    K[[3, 40, 41]] = np.nan

    answer = estimator_for(method, BASIS, LAYOUTS[name], sigma)(K)
    reference = estimator_for("least-squares", BASIS, LAYOUTS[name], sigma)(K)

    exact = method in ("as-printed", "direct", "fast", "robust")
    scale = np.abs(truth()).max()
    atol = (1e-9 if exact else 0.02) * scale
    np.testing.assert_allclose(answer.coefficients, reference.coefficients, rtol=0, atol=atol)
    assert np.array_equal(np.isnan(answer.residual), np.isnan(K))
    assert answer.residual.shape == (LAYOUTS[name].channels,)


@every_linear
def test_readings_of_a_curvature_sensor_by_number_are_its_view(method):
    K, _ = read(LAYOUTS["curvature"], seed=2)

    listed = estimator_for(method, BASIS, LAYOUTS["curvature"], 0.2)(K)
    view = estimator_for(method, BASIS, GRID, 0.2)(K.reshape(3, P))

    scale = np.abs(view.coefficients).max()
    np.testing.assert_allclose(listed.coefficients, view.coefficients, rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(listed.residual, view.residual.ravel(), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["height", "slope", "mixed", "scattered"])
def test_robust_leaves_out_an_element_that_contradicts_the_rest(name):
    layout = LAYOUTS[name]
    K, sigma = read(layout, seed=3)
    own = layout.element == 25
    K[own] += 60 * sigma[own]

    robust = estimator_for("robust", BASIS, layout, sigma)(K)

    assert np.flatnonzero(robust.suspect).tolist() == [25]
    K[own] = np.nan
    without = estimator_for("least-squares", BASIS, layout, sigma)(K)
    np.testing.assert_allclose(robust.coefficients, without.coefficients, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["height", "slope"])
def test_without_a_sigma_the_noise_is_estimated(name):
    K, sigma = read(LAYOUTS[name], seed=4, frames=40)

    answer = estimator_for("least-squares", BASIS, LAYOUTS[name])(K)

    assert np.mean(answer.noise) == pytest.approx(sigma[0], rel=0.05)


@pytest.mark.parametrize("name", ["height", "slope", "curvature"])
def test_only_readings_of_curvature_come_out_too_flat_on_slopes(name):
    layout = LAYOUTS[name]

    answer = estimator_for("least-squares", BASIS, layout)(layout.operator(BASIS) @ (20 * truth()))

    assert answer.estimator.slope(answer.coefficients) > 0.3
    assert bool(answer.warnings) == (name == "curvature")


# A zero that is unknown


def free(name, *quantities):
    layout = LAYOUTS[name]
    return replace(layout, reads=replace(layout.reads, free=quantities))


@pytest.mark.parametrize("sigma_known", [True, False])
@pytest.mark.parametrize("method", ["least-squares", "bayes"])
@pytest.mark.parametrize("name", ["height", "slope"])
def test_an_offset_of_a_free_datum_changes_no_shape_and_costs_what_it_must(
    method, name, sigma_known
):
    layout = free(name, name)
    K, sigma = read(layout, seed=5, frames=300)
    offset = 7e-3 * np.repeat([1.0, -2.0], P)[: layout.channels]
    fit = estimator_for(method, BASIS, layout, sigma if sigma_known else None)
    K[:, [7, 8]] = np.nan

    moved, still = fit(K + offset), fit(K)

    scale = np.abs(truth()).max()
    np.testing.assert_allclose(moved.coefficients, still.coefficients, rtol=0, atol=1e-6 * scale)
    np.testing.assert_allclose(moved.residual, still.residual, rtol=0, atol=1e-5 * sigma[0])
    off = (moved.coefficients.reshape(300, -1) - truth()) / moved.sd.reshape(300, -1)
    assert 0.93 <= np.mean(np.abs(off) < 1.96) <= 0.97
    left = np.nansum((moved.residual / sigma) ** 2, axis=1) / moved.spare
    assert np.mean(left) == pytest.approx(1, abs=0.03)


def test_a_free_datum_is_one_more_column_of_dense_least_squares():
    layout = free("mixed", "height", "slope")
    K, sigma = read(layout, seed=6)
    K[[2, 100, 200]] = np.nan

    answer = estimator_for("least-squares", BASIS, layout, sigma)(K)

    offsets = np.kron(np.eye(3), np.ones((P, 1)))
    A = np.hstack([layout.operator(BASIS), offsets]) / sigma[:, None]
    there = np.isfinite(K)
    g = np.linalg.lstsq(A[there], (K / sigma)[there])[0]
    covariance = np.linalg.inv(A[there].T @ A[there])[:30, :30]
    scale = np.abs(truth()).max()
    np.testing.assert_allclose(answer.coefficients.ravel(), g[:30], rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(answer.sd.ravel(), np.sqrt(np.diag(covariance)), rtol=1e-9)
    assert answer.spare == np.sum(there) - 33


@pytest.mark.parametrize("name", ["height", "mixed"])
def test_bayes_scatters_as_predicted_whatever_the_offset(name):
    layout = free(name, "height")
    K, sigma = read(layout, seed=7, frames=400)
    fit = estimator_for("bayes", BASIS, layout, sigma)

    predicted = fit.scatter(1.0, read(layout)[0] + 7e-3 * layout.offsets[:, 0]).sd

    measured = fit(K).coefficients.reshape(400, -1).std(axis=0, ddof=1)
    assert np.linalg.norm(predicted) == pytest.approx(np.linalg.norm(measured), rel=0.05)


@pytest.mark.parametrize("frames", [None, 5])
@pytest.mark.parametrize("method", ["least-squares", "bayes"])
@pytest.mark.parametrize("name", ["height", "mixed", "scattered"])
def test_a_wrong_sigma_is_told_of_any_readings(name, method, frames):
    layout = LAYOUTS[name]
    K, sigma = read(layout, seed=8, frames=frames)
    K[..., 3] = np.nan

    small, right, large = (
        estimator_for(method, BASIS, layout, factor * sigma)(K).sigma_ratio
        for factor in (0.3, 1.0, 3.0)
    )

    assert right == 1
    assert small == pytest.approx(1 / 0.3, rel=0.2)
    assert 0.8 / 3 < large < 0.5  # a prior takes some of the noise for the shape's


def test_offsets_without_readings_cost_nothing():
    layout = free("mixed", "height", "slope")
    K, sigma = read(layout, seed=7)
    K[:P] = np.nan

    answer = estimator_for("least-squares", BASIS, layout, sigma)(K)

    slopes, own = free("slope", "slope"), slice(P, None)
    alone = estimator_for("least-squares", BASIS, slopes, sigma[own])(K[own])
    np.testing.assert_allclose(answer.coefficients, alone.coefficients, rtol=0, atol=1e-12)
    assert answer.spare == alone.spare == 2 * P - 32


@pytest.mark.parametrize("method", sorted(set(LINEAR) - {"least-squares", "bayes"}))
def test_a_method_without_offsets_refuses_a_free_datum(method):
    with pytest.raises(Refusal, match=r"known zero for .*free datum of height; use least-squares"):
        estimator_for(method, BASIS, free("height", "height"))


# What nobody sees


def test_a_mode_that_nobody_sees_is_named():
    with pytest.raises(RankDeficient, match="no reading determines function 6 x 10"):
        estimator_for("least-squares", SineBasis(SKIN, 6, 10), LAYOUTS["height"])
    # Slopes along x at the middle of a side miss every function that is even about it.
    middle = SensorLayout.scattered(SKIN, [(0.05, y) for y in np.linspace(0.01, 0.07, 9)])
    with pytest.raises(RankDeficient, match=r"no reading determines function [135] x"):
        estimator_for("direct", SineBasis(SKIN, 3, 3), middle.reading(np.arange(9), "slope"))(
            np.zeros(9)
        )


def test_slopes_do_not_tell_how_far_a_free_edge_has_sunk_and_heights_do():
    basis = basis_for(SKIN, "elastic", 5, 5)
    with pytest.raises(RankDeficient, match=r"24 of the 25 .*no reading determines function"):
        estimator_for("least-squares", basis, LAYOUTS["slope"])
    c = np.random.default_rng(0).normal(size=25) * 1e-3

    answer = estimator_for("least-squares", basis, LAYOUTS["height"])(
        LAYOUTS["height"].operator(basis) @ c
    )

    shape = basis.at(GRID.positions)
    np.testing.assert_allclose(shape @ answer.coefficients.ravel(), shape @ c, atol=1e-12)


@pytest.mark.parametrize("method", ["bayes", "robust", "tracking"])
def test_priors_do_not_know_how_far_an_elastic_rim_sinks(method):
    with pytest.raises(Refusal, match=r"readings of curvature alone for .*; use least-squares"):
        estimator_for(method, basis_for(SKIN, "elastic", 5, 5), LAYOUTS["height"])


# What cannot be taken


def test_readings_of_different_units_need_a_sigma():
    with pytest.raises(Refusal, match="sigma of readings that differ in unit, m or m/m, got none"):
        estimator_for("least-squares", BASIS, LAYOUTS["mixed"])


def test_fast_refuses_what_is_not_orthogonal():
    oblique = GRID.reading(EVERY, "slope", 0.3)
    with pytest.raises(Refusal, match=r"along x or y .*got slope at 17\.\d+ degrees"):
        estimator_for("fast", BASIS, oblique)
    twice = GRID.reading(np.tile(EVERY, 2), "height")
    with pytest.raises(Refusal, match="read a quantity once"):
        estimator_for("fast", BASIS, twice)


def test_what_takes_a_curvature_sensor_refuses_others_at_the_door():
    layout = LAYOUTS["height"]
    for made in (lambda: ObjectFinder(Plate(SKIN), layout),):
        with pytest.raises(Refusal, match=r"expected a curvature sensor .* got readings of height"):
            made()
