"""A study's file to its points, and what is refused of it."""

import json
import re
from dataclasses import fields
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Refusal
from kappaskin.studies import load_study
from kappaskin.studies.design.measures import MEASURES, PLACED_BY
from kappaskin.studies.design.study import (
    KINDS,
    STUDIES,
    FitSettings,
    LogUniform,
    MeasureSettings,
    Normal,
    PlacementSettings,
    Some,
    Stop,
    Uniform,
    Whole,
)

TWO = """
[[vary]]
"elements.grid" = [[6, 6], [8, 8]]

[[vary]]
"effects.uniform-noise.rms" = { first = 0.1, last = 0.4, count = 3, spacing = "log" }
"""


def refused(study_of, more="", *changes):
    with pytest.raises(Refusal) as refusal:
        study_of(more, *changes)
    return str(refusal.value)


def test_points_are_every_combination_in_order(study_of):
    points = list(study_of(TWO).points())

    grids = [point.values["elements.grid"] for point in points]
    noises = [point.values["effects.uniform-noise.rms"] for point in points]
    assert grids == [[6, 6]] * 3 + [[8, 8]] * 3
    np.testing.assert_allclose(noises, [0.1, 0.2, 0.4] * 2)


def test_a_point_says_what_the_scene_says_but_for_what_varies(study_of):
    study = study_of(TWO)

    said = json.loads(list(study.points())[-1].document)

    assert said["elements"] == {"grid": [8, 8]}
    assert said["touch"] == study.content["touch"]
    assert "vary" not in said


def test_values_of_one_table_go_together(study_of):
    points = list(
        study_of(
            '[[vary]]\n"elements.grid" = [[6, 6], [9, 9]]\n"touch[1].x" = [0.04, 0.05]'
        ).points()
    )

    assert [tuple(point.values.values()) for point in points] == [([6, 6], 0.04), ([9, 9], 0.05)]


@pytest.mark.parametrize(("place", "values"), [("seed", [1, 2]), ("rate", [10.0, 20.0])])
def test_what_stands_in_no_table_is_varied_too(study_of, place, values):
    points = list(study_of(f"[[vary]]\n{place} = {values}").points())

    assert [json.loads(point.document)[place] for point in points] == values


DRAW = '[[draw]]\nwhat = "{}"\nkind = "whole"\nlow = 1\nhigh = 7\n'


@pytest.mark.parametrize(
    "more",
    [
        '[[vary]]\n"touch[1].x" = [0.04]\n' + DRAW.format("touch[1].x"),
        DRAW.format("reference") + DRAW.format("reference"),
        '[[vary]]\n"effects.uniform-noise" = [{ rms = 0.1 }]\n"effects.uniform-noise.rms" = [0.2]',
    ],
)
def test_what_would_be_said_twice_is_refused(study_of, more):
    assert "expected to vary or draw each thing once, got" in refused(study_of, more)


@pytest.mark.parametrize("what", ["seed", "measure.frames", "draw[1].low", "title", "stop.most"])
def test_a_draw_that_would_change_nothing_is_refused(study_of, what):
    said = refused(study_of, DRAW.format(what))

    assert said.startswith(
        "small.toml, line 34: draw[1].what: expected a parameter of the scene, fit or placement"
    )


def test_a_study_that_varies_nothing_is_one_point(study_of):
    assert len(list(study_of().points())) == 1


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ('[[vary]]\n"elements.gird" = [1]', ["line 34", "did you mean grid?"]),
        ('[[vary]]\n"elemants.grid" = [[6, 6]]', ["line 34", "did you mean elements?"]),
        ('[[vary]]\n"touch[2].x" = [0.04]', ["line 34", "one of 1 tables", "number 2"]),
        ('[[vary]]\n"touch.x" = [0.04]', ["line 34", "touch[1]"]),
        ('[[vary]]\n"touch[00].x" = [0.04]', ["line 34", "expected a key in this file"]),
        ('[[vary]]\n"elements.grid" = []', ["vary[1]", "got none"]),
        ("[[vary]]\n", ["vary[1]", "got none"]),
        ('[[vary]]\n"elements.grid" = 3', ["line 34", "expected a list, got 3"]),
        ("[[vary]]\nelements.grid = [[6, 6]]", ["in quotes"]),
        ('[[vary]]\n"measure.frames" = [5, 6]', ["not of the study itself"]),
        ('[[vary]]\n"touch[1].x" = [0.04, 0.05]\n"touch[1].y" = [0.04]', ["2 of touch[1].x, 1 of"]),
        ('[[vary]]\n"touch[1].x" = [0.04, 0.5]', ["with touch[1].x = 0.5", "expected a load on"]),
        ('[[vary]]\n"touch[1].x" = { first = 0.0, last = 1.0, count = 0 }', ["at least one value"]),
        ('[[vary]]\n"touch[1].x" = { first = 0, last = 1, count = 3, spacing = "log" }', ["above"]),
        ('[[vary]]\n"fit.method" = ["lest-squares"]', ["expected a method among", "lest-squares"]),
        ('[[vary]]\n"place.by" = ["E"]', ["expected by among scene, clustered, D, A"]),
        ('[[draw]]\nwhat = "touch[1].x"\nkind = "normal"\nmean = 0.05\nsd = 0.1', ["expected low"]),
        ('[[draw]]\nwhat = "touch[1].x"\nkind = "unform"', ["did you mean 'uniform'?"]),
        (
            '[[draw]]\nwhat = "touch[1].x"\nkind = "uniform"\nlow = 0.0\nhigh = inf',
            ["expected finite bounds", "inf"],
        ),
        (
            '[[draw]]\nwhat = "touch[1].z"\nkind = "uniform"\nlow = 0.0\nhigh = 1.0',
            ["line 34", "touch[1].z", "valid keys are"],
        ),
    ],
)
def test_what_cannot_be_varied_or_drawn_is_refused_with_its_line_and_the_remedy(
    study_of, more, told
):
    said = refused(study_of, more)

    assert said.startswith("small.toml, line 3")
    for part in told:
        assert part in said


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"rms"', '"rsm"', "did you mean 'rms'?"),
        ('["rms"]', "[]", "expected at least one thing to measure"),
        ("frames = 5", "frames = 0", "expected at least one frame"),
        ("frames = 5", "frames = 100000", "got 100000 frames of 108 = 10800000; take fewer frames"),
        ("[measure]", "[messure]", "did you mean measure?"),
        ("least = 2", "least = 9", "expected 2 <= least <= most"),
        ("least = 2", 'least = 2\nof = ["contact"]', "expected one of rms, got 'contact'"),
        ("least = 2", "least = 2\nwihtin = 0.1", "did you mean within?"),
        ("[4, 4]", "[0, 4]", "at least 1 x 1"),
        ("[fit]", "[fit]\ncompansate = true", "did you mean compensate?"),
        ('what = "point"', 'what = "heights"\nfile = "x.png"', "in a separate file"),
    ],
)
def test_what_no_study_can_be_made_of_is_refused(study_of, old, new, told):
    assert told in refused(study_of, "", (old, new))


def test_an_astronomical_product_is_refused_with_its_size(study_of):
    many = "{ first = 0.01, last = 0.09, count = 9000 }"

    said = refused(study_of, f'[[vary]]\n"touch[1].x" = {many}\n[[vary]]\n"touch[1].y" = {many}')

    assert "9000 x 9000 = 8.1e+07" in said
    assert "points = ... in [stop]" in said
    assert "at most 10000 values, got 1000000000" in refused(
        study_of, '[[vary]]\n"touch[1].x" = { first = 0.01, last = 0.09, count = 1000000000 }'
    )


def test_a_skin_that_nothing_presses_is_refused(study_of):
    touch = '[[touch]]\nwhat = "point"\nx = 0.05\ny = 0.03\nforce = 0.1'

    assert "expected a scene with a load" in refused(study_of, "", (touch, ""))


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("[6, 6]", "[6, 6]\ndead = [3]", "expected only live elements"),
        ("size = [0.1, 0.1]", 'shape = "strip"\nsize = [0.1, 0.1]', "got a strip"),
    ],
)
def test_what_cannot_be_placed_anew_is_refused(study_of, old, new, told):
    with pytest.raises(Refusal, match=told):
        study_of('[place]\nby = "D"', (old, new))


def test_an_unknown_study_is_refused_with_those_there_are():
    with pytest.raises(Refusal, match=r"expected a study among .*placement.*; got 'placemnt'"):
        load_study("placemnt")


@pytest.mark.parametrize("name", STUDIES)
def test_every_ready_study_is_read_and_varies_something(name):
    study = load_study(name)

    assert study.axes
    assert study.title
    assert set(study.measures) <= set(MEASURES)


@pytest.mark.parametrize(
    ("draw", "low", "high", "mean"),
    [
        (Uniform(2.0, 4.0), 2.0, 4.0, 3.0),
        (LogUniform(1.0, np.e**2), 1.0, np.e**2, (np.e**2 - 1) / 2),
        (Normal(1.0, 1.0, 0.0, 2.0), 0.0, 2.0, 1.0),
        (Whole(3, 5), 3, 5, 4.0),
    ],
)
def test_draws_stay_within_their_bounds_and_have_their_mean(draw, low, high, mean):
    rng = np.random.default_rng(0)

    drawn = np.array([draw(rng) for _ in range(4000)])

    assert low <= drawn.min() < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < drawn.max() <= high
    assert abs(drawn.mean() - mean) < 4 * drawn.std() / np.sqrt(4000)


def test_some_are_different_ones_each_as_often_as_the_others():
    rng = np.random.default_rng(0)

    drawn = [Some(10, 4)(rng) for _ in range(2000)]

    assert all(len(set(one)) == 4 for one in drawn)
    counts = np.bincount(np.concatenate(drawn), minlength=10)
    assert np.abs(counts - 800).max() < 4 * np.sqrt(2000 * 0.4 * 0.6)


def test_the_guide_names_all_that_a_study_may_say():
    guide = (Path(str(files("kappaskin_resources"))) / "studies" / "README.md").read_text("utf-8")

    for name in (*MEASURES, *KINDS, *PLACED_BY):
        assert f"`{name}`" in guide or name == "scene"
    for kind in (FitSettings, PlacementSettings, MeasureSettings, Stop):
        for field in fields(kind):
            assert re.search(rf"\n    {field.name} = ", guide)
