"""Channels left out of a fit: which shape is left, what it costs, and what cannot be spared."""

from dataclasses import replace

import numpy as np
import pytest

from kappaskin import LeastSquares, Pipeline, Setup, Simulator, SineBasis, load_scene
from kappaskin.estimation import FAULTS, METHODS

SCENE = replace(load_scene("centre"), effects=())
SENSOR = SCENE.sensor()
FRAME = Simulator(SCENE).frame(0, lambda: 0.0)
STUCK, DEAD = FAULTS.index("stuck"), FAULTS.index("dead")
OUT = [27, 63, 144, 45, 244]


def kinds_of(channels, kind=STUCK):
    kinds = np.zeros(300, np.uint8)
    kinds[channels] = kind
    return kinds


def spoilt(channels):
    counts = FRAME.counts.copy()
    counts[channels] = 3000
    return replace(FRAME, counts=counts)


@pytest.mark.parametrize("method", [m for m in METHODS if m != "as-printed"])
def test_what_is_left_out_changes_no_shape_whatever_it_reads(method) -> None:
    bad, good = (Pipeline(SENSOR, Setup(method=method)) for _ in range(2))
    for pipeline in (bad, good):
        pipeline.leave_out(kinds_of(OUT), np.arange(300.0))

    shape, expected = bad(spoilt(OUT)), good(FRAME)

    np.testing.assert_allclose(shape.surface, expected.surface, atol=1e-12)
    assert shape.error_rms < 0.05e-3
    assert [FAULTS[k] for k in shape.suspect[[27, 63, 44, 45]]] == ["stuck"] * 4
    assert shape.curvature.ravel()[OUT] == pytest.approx(3000 * SCENE.transduction.resolution)
    assert np.isnan(shape.residual.ravel()[OUT]).all()


def test_the_cost_is_that_of_the_estimators_own_error_bars() -> None:
    pipeline = Pipeline(SENSOR, Setup())
    pipeline.leave_out(kinds_of(OUT), np.zeros(300))
    place = np.array([0.03, 0.06])

    fit = LeastSquares(SineBasis(SCENE.plate.patch, 8, 8), SCENE.layout)
    K = np.zeros((3, 100))
    whole, K.ravel()[OUT] = fit(K), np.nan
    without = fit(K)

    ratio = np.linalg.norm(without.unit_sd) / np.linalg.norm(whole.unit_sd)
    assert pipeline.left_out.cost == pytest.approx(ratio, rel=1e-12)
    row = fit.basis.at(place[None])
    at = np.sqrt(
        (without.uncertainty.covariance_of(row) / whole.uncertainty.covariance_of(row)).item()
    )
    assert pipeline.left_out.cost_at(place) == pytest.approx(at, rel=1e-12)
    assert at > 1
    assert np.isnan(pipeline.left_out.cost_at(np.full(2, np.nan)))


def test_what_the_device_calls_dead_costs_as_much_as_what_is_found_dead() -> None:
    lacking = replace(SCENE, layout=SCENE.layout.without([44, 45]))
    found, known = Pipeline(SENSOR, Setup()), Pipeline(lacking.sensor(), Setup())
    dead = [44, 45, 144, 145, 244, 245]

    found.leave_out(kinds_of(dead, DEAD), np.zeros(300))
    known.leave_out(kinds_of(dead, DEAD), np.zeros(300))

    assert known.left_out.cost == pytest.approx(found.left_out.cost)
    assert known.left_out.cost > 1.01


def test_of_too_many_the_worst_are_left_out_and_a_shape_is_still_told() -> None:
    pipeline, badness = Pipeline(SENSOR, Setup()), np.random.default_rng(0).random(300)
    bad = np.arange(20, 300)  # leaves 20 readings for 64 unknowns

    pipeline.leave_out(kinds_of(bad), badness)

    kept = pipeline.left_out.retained.ravel()
    assert 44 <= kept.sum() < 240
    assert badness[bad][kept[bad]].max() <= badness[bad][~kept[bad]].min()
    assert np.isfinite(pipeline(FRAME).surface).all()


def test_nothing_left_out_is_the_same_pipeline() -> None:
    pipeline = Pipeline(SENSOR, Setup())
    before = pipeline(FRAME)
    pipeline.leave_out(kinds_of(OUT), np.zeros(300))
    pipeline.leave_out(kinds_of([]), np.zeros(300))

    after = pipeline(FRAME)

    np.testing.assert_array_equal(after.surface, before.surface)
    assert not after.suspect.any()
    assert pipeline.left_out.cost == 1.0


def test_the_robust_estimator_goes_on_beside_the_monitor() -> None:
    pipeline = Pipeline(SENSOR, Setup(method="robust"))
    pipeline.leave_out(kinds_of([27, 127, 227]), np.zeros(300))
    counts = spoilt([27, 127, 227]).counts
    counts[[66, 166]] = -9000

    suspect = pipeline(replace(FRAME, counts=counts)).suspect

    assert {p: FAULTS[suspect[p]] for p in np.flatnonzero(suspect)} == {27: "stuck", 66: "spike"}
