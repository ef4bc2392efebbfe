"""Full scans against regions around a moving contact: what is bought, what it costs."""

import math

import pytest

from kappaskin import Refusal, Region
from kappaskin.studies.regions import PERIODS, ROWS, TRACKED, measured

pytestmark = pytest.mark.slow

FAST = 0.25  # s per turn: 553 mm/s
FULL, PART = Region(), Region("skin", radius=0.025, rate=1e6)


@pytest.fixture(scope="module")
def fast():
    return measured(FAST, FULL, 0.6), measured(FAST, PART, 0.35)


def test_a_full_scan_runs_at_the_papers_rate_and_a_region_faster(fast):
    full, part = fast

    assert full["rate"] == pytest.approx(1 / 6e-3, rel=1e-3)
    assert full["channels"] == 300
    assert part["rate"] > 3 * full["rate"]
    assert part["rate"] == pytest.approx(1 / (20e-6 * part["channels"]), rel=0.02)


def test_while_the_contact_moves_fast_the_newest_answer_of_a_region_is_nearer(fast):
    full, part = fast

    # A full scan is 6 ms old on average when it is the newest: 3.3 mm behind.
    assert full["newest_contact_mm"] == pytest.approx(553 * 6e-3, rel=0.15)
    assert part["newest_contact_mm"] < 0.5 * full["newest_contact_mm"]
    assert part["newest_shape_mm"] < full["newest_shape_mm"]


def test_while_it_rests_a_region_loses_little():
    full, part = (measured(1e6, region, 0.4) for region in (FULL, PART))

    assert full["found"] == part["found"] == 1
    assert part["bound_mm"] == pytest.approx(full["bound_mm"], rel=0.1)
    # Over 50 and 180 frames; held readings make up for what the region leaves out.
    assert part["contact_mm"] < 1.3 * full["contact_mm"]


def test_a_row_has_what_a_table_prints(fast):
    full, part = fast

    assert full.keys() == part.keys()
    assert (full["radius_mm"], full["share"]) == (None, None)
    assert (part["radius_mm"], part["share"]) == (25.0, 0.1)
    numbers = [value for value in part.values() if not isinstance(value, str)]
    assert all(math.isfinite(value) for value in numbers)
    assert (full["method"], full["around"]) == ("least-squares", "off")
    assert len(PERIODS) * len(ROWS) == 30


@pytest.fixture(scope="module")
def tracked():
    return [measured(FAST, region, 0.3, "tracking") for region in TRACKED]


@pytest.mark.full
def test_tracked_regions_at_a_fifth_of_the_channels_are_no_worse_than_tracked_full_scans(tracked):
    full, skin, _, _ = tracked

    assert 60 <= skin["channels"] < 66
    for error in ("contact_mm", "newest_contact_mm", "newest_shape_mm"):
        assert skin[error] < full[error]
    assert skin["shape_mm"] < 1.3 * full["shape_mm"]


def test_choosing_channels_beats_taking_turns(tracked):
    _, _, turns, adaptive = tracked

    assert turns["channels"] == adaptive["channels"] == 60
    assert adaptive["contact_mm"] < 0.7 * turns["contact_mm"]
    assert adaptive["newest_contact_mm"] < 0.8 * turns["newest_contact_mm"]


def test_tracking_is_nearer_than_least_squares(fast, tracked):
    for plain, followed in zip(fast, tracked[:2], strict=True):
        assert followed["newest_contact_mm"] < plain["newest_contact_mm"]
        assert followed["newest_shape_mm"] < plain["newest_shape_mm"]


@pytest.mark.parametrize("seconds", [0.0, 0.1, -1.0, math.nan, math.inf])
def test_too_short_a_measurement_is_refused(seconds):
    with pytest.raises(Refusal, match=r"at least 0\.2 s"):
        measured(1.0, FULL, seconds)
