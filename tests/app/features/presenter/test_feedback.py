"""Feedback of an estimate, compared with the object that presses in a simulation."""

import math
import time
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from kappaskin import ObjectFinder, Pipeline, PointLoad, Setup, Simulator, load_scene
from kappaskin.mechanics import Sphere
from kappaskin_app.features.presenter.feedback import RadiusEstimate, Recognised, feedback_of
from kappaskin_app.features.presenter.view import radius_in_words
from kappaskin_app.widgets.text import ERROR_BARS, Coverage

_LARGE = Sphere(0.12)  # lies against the skin over more than any disc that a contact may be


@lru_cache(1)
def _finder() -> ObjectFinder:
    scene = load_scene("demo")
    return ObjectFinder(scene.plate, scene.layout)


def _estimate(force=0.5, x=0.05, rigid=None, functions=8):
    scene = load_scene("demo")
    stimulus = scene.stimuli[0]
    what = replace(stimulus.what, force=force, x=x, rigid=rigid or stimulus.what.rigid)
    scene = replace(scene, stimuli=(replace(stimulus, what=what),))
    pipeline = Pipeline(scene.sensor(), Setup(functions, functions))
    return pipeline(Simulator(scene).frame(0, time.monotonic))


def _recognised(estimate) -> Recognised:
    what = _finder()(estimate.curvature, estimate.noise, estimate.contact)
    return Recognised(what, estimate.contact)


def _of_nothing():
    scene = load_scene("demo").touched_by()
    return Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, time.monotonic))


def test_nothing_is_felt_of_a_skin_that_nothing_touches() -> None:
    assert feedback_of(_of_nothing()) is None


@pytest.mark.parametrize("force", [0.5, 0.6])
def test_the_force_of_a_ball_that_lies_against_the_skin_is_the_hands(force) -> None:
    estimate = _estimate(force, rigid=_LARGE)

    feedback = feedback_of(estimate, _recognised(estimate))

    assert feedback.force == pytest.approx(force, abs=2 * feedback.force_off)
    assert feedback.force_off < 0.03 * force
    assert abs(estimate.contact.force - force) > 2 * feedback.force_off  # what a disc would tell


def test_what_was_found_a_moment_ago_corrects_the_force_of_now() -> None:
    recognised = _recognised(_estimate(0.50))

    feedback = feedback_of(_estimate(0.52), recognised)

    assert feedback.force == pytest.approx(0.52, abs=0.006)


def test_a_contact_that_no_disc_explains_has_no_error_bar_until_an_object_does() -> None:
    feedback = feedback_of(_estimate(0.6, rigid=_LARGE))

    assert math.isnan(feedback.force_off)
    assert math.isnan(feedback.position_off)


def test_the_radius_felt_is_the_balls_within_its_interval() -> None:
    estimate = _estimate(0.55)
    feedback = feedback_of(estimate, _recognised(estimate))
    low, high = feedback.radius.interval
    assert feedback.radius.what == "sphere"
    assert low - 0.002 < 0.04 < high + 0.002
    assert high - low < 0.01


def test_rolling_moves_the_contact_and_leaves_the_radius() -> None:
    left, right = (_estimate(0.55, x) for x in (0.045, 0.055))
    was, now = (feedback_of(estimate, _recognised(estimate)) for estimate in (left, right))
    assert now.position[0] - was.position[0] > 0.005
    assert now.radius.value == pytest.approx(was.radius.value, rel=0.05)


def test_without_an_object_the_skin_is_what_is_round() -> None:
    estimate = _estimate(0.3)

    feedback = feedback_of(estimate)

    assert feedback.radius.what == "skin"
    sharpest = np.abs(estimate.geometry.principal).max()
    assert feedback.radius.value == pytest.approx(1 / sharpest)
    low, high = feedback.radius.interval
    assert low < feedback.radius.value < high


def test_a_small_contact_is_told_with_all_its_error_bars() -> None:
    scene = load_scene("centre").touched_by(PointLoad(0.04, 0.06, 0.2))
    estimate = Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, time.monotonic))

    feedback = feedback_of(estimate)

    assert feedback.position == pytest.approx((0.04, 0.06), abs=2 * feedback.position_off)
    assert feedback.force == pytest.approx(0.2, abs=2 * feedback.force_off)
    assert feedback.displacement_off > 0


@pytest.mark.parametrize(
    ("interval", "radius", "words"),
    [
        ((0.038, 0.042), 0.04, ("40.0 mm", "95 %: 38.0 to 42.0 mm")),
        ((0.0, 0.0265), math.nan, ("\N{EN DASH}", "unknown, under 26.5 mm: press harder")),
        ((0.12, math.inf), math.inf, ("\N{EN DASH}", "unknown, over 120 mm")),
        ((0.0, math.inf), math.nan, ("\N{EN DASH}", "unknown")),
        ((math.inf, math.inf), math.inf, ("flat", "")),
        ((0.0, 3.8), math.nan, ("\N{EN DASH}", "unknown")),
        ((0.01425, 0.01429), 0.01427, ("14.270 mm", "95 %: 14.250 to 14.290 mm")),
        ((0.0081, 0.0093), 0.00866, ("8.66 mm", "95 %: 8.10 to 9.30 mm")),
        ((1.1, 1.4), 1.234, ("1230 mm", "95 %: 1100 to 1400 mm")),
    ],
)
def test_a_radius_is_written_as_far_as_it_is_known(interval, radius, words, monkeypatch) -> None:
    monkeypatch.setattr(Coverage, "now", ERROR_BARS["95"])
    feedback = replace(feedback_of(_estimate(0.3)), kind="sphere")
    told = radius_in_words(replace(feedback, radius=RadiusEstimate("sphere", radius, interval)))
    assert told == (*words, "Radius of the ball")


def test_a_radius_has_the_error_bar_of_all_views() -> None:
    low, high = RadiusEstimate("sphere", 0.04, (0.038, 0.042)).bar
    assert (1 / low - 25, 25 - 1 / high) == pytest.approx((1.3158 / 1.96, 1.1905 / 1.96), rel=1e-3)
    feedback = replace(feedback_of(_estimate(0.3)), kind="sphere")
    known = replace(feedback, radius=RadiusEstimate("sphere", 0.04, (0.038, 0.042)))
    assert (
        radius_in_words(known)[1]
        == "\N{PLUS-MINUS SIGN}1 \N{GREEK SMALL LETTER SIGMA}: 39.0 to 41.0 mm"
    )
    assert RadiusEstimate("sphere", 0.2, (0.12, math.inf)).bar == (0.12, math.inf)


def test_a_recording_has_no_hint_to_press_harder() -> None:
    feedback = replace(feedback_of(_estimate(0.3)), kind="sphere")
    light = replace(feedback, radius=RadiusEstimate("sphere", math.nan, (0.0, 0.0265)))
    assert radius_in_words(light)[1] == "unknown, under 26.5 mm: press harder"
    assert radius_in_words(light, recorded=True)[1] == "unknown, under 26.5 mm: pressed too lightly"


def test_an_edge_has_a_length_and_no_radius() -> None:
    feedback = replace(feedback_of(_estimate(0.3)), kind="edge", length=0.04, radius=None)
    assert radius_in_words(feedback) == ("edge", "40 mm long", "Object")


def test_a_contact_near_the_rim_has_no_force_and_no_radius() -> None:
    estimate = _estimate()
    recognised = _recognised(estimate)
    rim = replace(estimate, contact=replace(estimate.contact, near_rim=True))

    feedback = feedback_of(rim)

    assert math.isnan(feedback.force)
    assert math.isnan(feedback.force_off)
    assert feedback.radius is None
    assert feedback.displacement == pytest.approx(np.nanmax(np.abs(estimate.surface)))
    assert math.isnan(feedback_of(rim, recognised).force)
    assert feedback.no_force == "edge: no force"


def test_a_skin_that_snaps_through_has_no_force_and_one_that_softens_a_bound() -> None:
    estimate = _estimate()
    soft = replace(estimate, contact=replace(estimate.contact, force_is_upper_bound=True))
    snaps = replace(estimate, contact=replace(estimate.contact, snaps_through=True, force=math.nan))

    assert feedback_of(soft).bound == "\N{LESS-THAN OR EQUAL TO} "
    assert feedback_of(snaps).no_force == "snaps through: no force"
    assert math.isnan(feedback_of(snaps, _recognised(estimate)).force)


def test_an_object_of_a_doubtful_kind_has_a_radius_without_a_name() -> None:
    estimate = _estimate(0.55)
    recognised = _recognised(estimate)
    doubtful = replace(recognised, what=replace(recognised.what, kind=""))

    feedback = feedback_of(estimate, doubtful)

    assert feedback.radius.value == recognised.what.radius
    assert radius_in_words(feedback)[2] == "Radius of the object"


def test_feedback_of_an_unknown_force_has_the_rest() -> None:
    estimate = _estimate()
    contact = replace(estimate.contact, force=math.nan, force_sd=math.nan)

    feedback = feedback_of(replace(estimate, contact=contact), _recognised(estimate))

    assert math.isnan(feedback.force)
    assert feedback.position == tuple(contact.position)
    assert math.isfinite(feedback.displacement)
