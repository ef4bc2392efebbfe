"""Base curvature and hysteresis, against loops followed by hand."""

import math
from itertools import pairwise

import numpy as np
import pytest

from kappaskin.scenes.effects import FIRST_GENERATION_LOOPS, Creep, Hysteresis
from kappaskin.studies.figures.hysteresis import SHARES, initial_curvature

R0 = 12.9e-3
THETA = math.pi * (np.arange(10) + 0.5) / 10
ONE_PLAY = Hysteresis((6.0,), (0.3,))


class Faithful:
    """An effect that spoils nothing."""

    def start(self, shape, rng):
        return lambda curvature, time: curvature


@pytest.fixture(scope="module")
def rows():
    return {
        (round(row["base_curvature"] * R0, 9), row["cycle"]): row for row in initial_curvature()
    }


def readings_by_hand(share, applied, cycles):
    """Three cycles of one play of +-6 1/m that carries 0.3 of the reading, step by step."""
    base, a0 = share / R0, -applied / 4e3
    # u'' in arc length, and the base's own part u / R^2.
    u = a0 * (3 * np.sin(3 * THETA) - np.sin(THETA))
    change = a0 * (-27 * np.sin(3 * THETA) + np.sin(THETA)) / R0**2 + u * base**2
    steps = np.r_[np.linspace(0, 1, 51), np.linspace(1, 0, 51)[1:]]
    every = []
    for d in change:
        w, read = 0.0, []
        for x in [*np.linspace(0, base, 101), *(base + d * np.tile(steps, cycles))]:
            w = min(max(w, x - 6.0), x + 6.0)
            read.append(0.7 * x + 0.3 * w)
        every.append(np.array(read[101:]) - read[100])
    return change, steps, np.array(every).T.reshape(cycles, len(steps), 10)


@pytest.mark.parametrize("share", SHARES)
def test_readings_are_those_of_a_play_followed_by_hand(share):
    rows = {(round(row["base_curvature"] * R0, 9), row["cycle"]): row
            for row in initial_curvature(ONE_PLAY, applied=0.9)}  # fmt: skip

    change, steps, readings = readings_by_hand(share, 0.9, 3)

    for name, cycle in (("first", readings[0]), ("settled", readings[2])):
        row = rows[share, name]
        assert row["swing"] == pytest.approx(np.abs(change).max())
        off = cycle - np.outer(steps, change)
        assert row["reading_rms"] == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-9)
        width = np.abs(cycle[:51] - cycle[:49:-1]).max()
        assert row["loop_width"] == pytest.approx(width, rel=1e-9)


def test_after_release_a_bent_skin_is_off_by_twice_as_much_as_a_flat_one():
    """A play that bending dragged along has its whole width to go back, one at rest has half."""
    for share, ways in ((1.0, 2), (0.0, 1)):
        change, _, readings = readings_by_hand(share, 1.9, 1)
        far = change > 13.0
        assert far.any()
        np.testing.assert_allclose(readings[0, -1, far], 0.3 * 6.0 * ways, rtol=1e-9)


def test_a_skin_without_hysteresis_is_right_at_every_base_curvature():
    for row in initial_curvature(Faithful()):
        for name in ("reading_rms", "loop_width", "e_max_mm", "rms_mm", "rest_rms_mm"):
            assert abs(row[name]) < 1e-11


def test_less_base_curvature_leaves_less_hysteresis_in_settled_readings(rows):
    shares = [rows[share, "settled"]["reading_rms"] / rows[share, "settled"]["swing"]
              for share in SHARES]  # fmt: skip

    # A base curvature below the loops' width, as the last but one, counts for nothing any more.
    assert all(flatter < bent for bent, flatter in pairwise(shares[:-1]))
    assert shares[-1] == pytest.approx(shares[-2], rel=0.03)
    assert shares[-1] < 0.6 * shares[0]


def test_less_base_curvature_leaves_less_of_a_dent_behind_while_the_ends_are_pinned(rows):
    dents = [rows[share, "settled"]["rest_rms_mm"] for share in SHARES if share]

    assert dents == sorted(dents, reverse=True)
    assert dents[-1] < 0.7 * dents[0]


def test_rows_are_ready_for_a_figure(rows):
    assert [share for share, cycle in rows if cycle == "first"] == pytest.approx(list(SHARES))
    assert len(rows) == 2 * len(SHARES)
    flat, bent = rows[0.0, "first"], rows[1.0, "first"]
    assert (flat["base_radius_mm"], flat["ends"]) == (None, "hinged")
    assert (bent["base_radius_mm"], bent["ends"]) == (pytest.approx(12.9), "pinned")
    numbers = (value for row in rows.values() for value in row.values() if isinstance(value, float))
    assert all(map(math.isfinite, numbers))
    assert initial_curvature() == list(rows.values())


def test_the_first_prototype_is_worse_and_creep_counts_the_time(rows):
    first = initial_curvature(FIRST_GENERATION_LOOPS)[0]
    creeping = initial_curvature(Creep(0.1, 1.0))[0]

    assert first["rms_mm"] > 2 * rows[1.0, "first"]["rms_mm"]
    assert creeping["loop_width"] > 0.1
