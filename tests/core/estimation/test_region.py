"""Regions of interest: what is scanned when, what it buys, and what it costs at best."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import (
    LeastSquares,
    Patch,
    Plate,
    PointContact,
    PointLoad,
    Refusal,
    Region,
    SensorLayout,
    SineBasis,
    load_scene,
)
from kappaskin.estimation import Scanner, ScanTradeoff
from kappaskin.estimation.region import contact_bound
from kappaskin.sensing import SECOND_GENERATION
from navier import HingedPlate, Load
from studies import cramer_rao

NOISE = 0.231
SENSOR = replace(load_scene("centre"), transduction=SECOND_GENERATION, rate=160.0).sensor()
POSITIONS = SENSOR.layout.positions
ANYWHERE = st.tuples(st.floats(0, 0.1), st.floats(0, 0.1)).map(np.array)
CENTRE = PointLoad(0.05, 0.05, 4.70e-3 * 3.7e-3 / (0.011600 * 0.1**2))  # of Table 1


def scanned(scanner):
    """The elements of the next frame; all three channels of each."""
    channels = scanner().channels
    elements = np.unique(channels % 100)
    np.testing.assert_array_equal(
        channels, (np.arange(3)[:, None] * 100 + elements).ravel()
    )  # upwards: few runs on the wire
    return set(elements.tolist())


# What is scanned


@given(ANYWHERE, st.floats(1e-6, 0.15), st.floats(0, 1))
def test_every_frame_scans_all_elements_within_the_radius(centre, radius, share):
    scanner = Scanner(SENSOR, Region("skin", radius=radius, share=share))
    scanner.follow(centre)

    near = np.flatnonzero(np.hypot(*(POSITIONS - centre).T) <= radius)

    for _ in range(3):
        assert set(near.tolist()) <= scanned(scanner)


@pytest.mark.slow
@given(ANYWHERE, st.floats(1e-6, 0.09), st.floats(0.01, 1))
def test_the_others_come_up_within_one_over_the_share_frames(centre, radius, share):
    scanner = Scanner(SENSOR, Region("skin", radius=radius, share=share))
    scanner.follow(centre)
    last = np.zeros(100, int)

    for n in range(1, 3 * math.ceil(1 / share) + 1):
        last[sorted(scanned(scanner))] = n
        assert n - last.min() <= math.ceil(1 / share)


@pytest.mark.parametrize("seed", range(20))
def test_the_others_come_up_within_bounds_while_the_region_moves(seed):
    centres = np.random.default_rng(seed).uniform(0, 0.1, (250, 2))
    scanner = Scanner(SENSOR, Region("skin", radius=0.02, share=0.1))
    last = np.zeros(100, int)
    for n, centre in enumerate(centres, 1):
        scanner.follow(centre)
        last[sorted(scanned(scanner))] = n
        # At most 16 elements lie within 20 mm: nine others take their turn, and once round the
        # skin they meet each of its 100 elements.
        assert n - last.min() <= math.ceil(100 / 9)


def test_a_share_of_zero_leaves_the_others_unread():
    scanner = Scanner(SENSOR, Region("skin", radius=0.02, share=0.0))
    scanner.follow(np.array([0.05, 0.05]))

    assert all(len(scanned(scanner)) == 12 for _ in range(20))


def test_a_share_of_one_reads_everything():
    scanner = Scanner(SENSOR, Region("skin", radius=0.02, share=1.0))
    scanner.follow(np.array([0.05, 0.05]))

    assert len(scanned(scanner)) == 100


def test_a_steady_region_takes_equally_long_in_every_frame():
    scanner = Scanner(SENSOR, Region("skin", radius=0.02, share=0.13))
    scanner.follow(np.array([0.03, 0.06]))

    assert len({scanner().duration for _ in range(50)}) == 1


@given(ANYWHERE)
def test_a_region_smaller_than_the_pitch_scans_the_nearest_element(centre):
    scanner = Scanner(SENSOR, Region("skin", radius=1e-6, share=0.0))
    scanner.follow(centre)

    nearest = sorted(scanned(scanner))

    distance = np.hypot(*(POSITIONS - centre).T)
    assert len(nearest) <= 4  # in the middle between four
    np.testing.assert_array_equal(distance[nearest], distance.min())


@pytest.mark.parametrize("corner", [(0.0, 0.0), (0.1, 0.1), (0.0, 0.07)])
def test_a_region_at_the_rim_is_what_lies_on_the_skin(corner):
    scanner = Scanner(SENSOR, Region("skin", radius=0.02, share=0.0))
    scanner.follow(np.array(corner))

    assert 3 <= len(scanned(scanner)) <= 8


@pytest.mark.parametrize("gone", [np.full(2, np.nan), np.array([0.05, np.inf])])
def test_without_a_contact_everything_is_scanned(gone):
    scanner = Scanner(SENSOR, Region("skin", radius=0.02))
    assert len(scanned(scanner)) == 100
    scanner.follow(np.array([0.05, 0.05]))
    assert len(scanned(scanner)) < 100

    scanner.follow(gone)

    assert len(scanned(scanner)) == 100


def test_elements_chosen_by_hand_are_scanned_whatever_touches():
    scanner = Scanner(SENSOR, Region("elements", elements=(3, 99, 40), share=0.0))

    assert scanned(scanner) == {3, 40, 99}


def test_all_elements_by_hand_is_a_full_scan():
    scanner = Scanner(SENSOR, Region("elements", elements=tuple(range(100)), share=0.1))

    assert len(scanned(scanner)) == 100


@pytest.mark.parametrize("around", ["turns", "adaptive"])
def test_every_channel_comes_up_once_in_one_over_the_share_frames(around):
    scanner = Scanner(SENSOR, Region(around, share=0.2))

    frames = [scanner().channels for _ in range(10)]

    for round_ in (frames[:5], frames[5:]):
        assert all((np.diff(channels) > 0).all() for channels in round_)
        assert sorted(np.concatenate(round_).tolist()) == list(range(300))


def test_channels_that_were_chosen_are_scanned_once_and_dead_ones_take_no_turn():
    dead = replace(SENSOR, layout=SENSOR.layout.without([0, 1]))
    scanner = Scanner(dead, Region("adaptive", share=0.5))
    scanner.choose(np.array([7, 50, 299]))

    first, second, third = (scanner().channels for _ in range(3))

    assert first.tolist() == [7, 50, 299]
    assert scanner.count == 147
    turns = np.concatenate([second, third])
    assert sorted(turns.tolist()) == np.flatnonzero(dead.layout.live.ravel()).tolist()


# Refusals


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"around": "everything"}, "turns or adaptive, or off, got 'everything'"),
        ({"around": "elements"}, "at least one element in the region, got none"),
        ({"radius": 0.0}, r"Region\.radius above zero, got 0\.0"),
        ({"radius": -0.01}, r"Region\.radius above zero, got -0\.01"),
        ({"radius": math.nan}, r"Region\.radius above zero, got nan"),
        ({"radius": math.inf}, r"Region\.radius above zero, got inf"),
        ({"rate": 0.0}, r"Region\.rate above zero, got 0\.0"),
        ({"rate": math.nan}, r"Region\.rate above zero, got nan"),
        ({"share": -0.1}, r"Region\.share between 0 and 1, got -0\.1"),
        ({"share": 1.1}, r"Region\.share between 0 and 1, got 1\.1"),
        ({"around": "turns", "share": 0.0}, r"Region\.share above zero for turns, got 0"),
        ({"around": "adaptive", "share": 0}, r"Region\.share above zero for adaptive, got 0"),
        ({"share": math.nan}, r"Region\.share between 0 and 1, got nan"),
    ],
)
def test_an_impossible_region_is_refused(changes, match):
    with pytest.raises(Refusal, match=match):
        Region(**changes)


@pytest.mark.parametrize("elements", [(100,), (-1,), (3, 4, 3), (10**400,)])
def test_elements_that_the_skin_has_not_are_refused(elements):
    with pytest.raises(Refusal, match="elements from 0 to 99, each once, got"):
        Scanner(SENSOR, Region("elements", elements=elements))


@pytest.mark.parametrize("around", ["turns", "adaptive"])
def test_a_share_of_no_live_channel_is_refused(around):
    dead = replace(SENSOR, layout=SENSOR.layout.without(range(100)))
    with pytest.raises(Refusal, match="all of them dead; scan everything"):
        Scanner(dead, Region(around))


@pytest.mark.parametrize("elements", [(1.5,), ("a",), (None,), ((1, 2),)])
def test_elements_that_are_no_whole_numbers_are_refused(elements):
    with pytest.raises(Refusal, match="whole numbers"):
        Scanner(SENSOR, Region("elements", elements=elements))


# What it buys and costs


@pytest.mark.parametrize(
    ("place", "position_mm", "force_percent"),
    [((0.05, 0.05), 0.131, 0.61), ((0.02, 0.08), 0.046, 0.36)],
)
def test_the_bound_of_all_channels_is_the_known_one(place, position_mm, force_percent):
    plate, basis = Plate(Patch(0.1, 0.1)), SineBasis(Patch(0.1, 0.1), 15, 15)
    at = basis.at(np.array([place]))[0]
    moved = 4.70e-3 if place == (0.05, 0.05) else 4.89e-3
    force = moved / (at @ plate.deflection([PointLoad(*place)], basis).ravel())

    x, y, sd = contact_bound(SENSOR, PointLoad(*place, float(force)), NOISE)

    assert (1e3 * x, 1e3 * y) == pytest.approx((position_mm, position_mm), abs=5e-4)
    assert 100 * sd / force == pytest.approx(force_percent, abs=5e-3)


@given(ANYWHERE, st.floats(0.012, 0.1), st.floats(0, 1))
def test_a_region_never_tells_more_than_everything_does(centre, radius, share):
    contact = PointLoad(*(0.8 * centre + 0.01), 0.15)

    told = ScanTradeoff.of(SENSOR, Region("skin", radius=radius, share=share), contact, NOISE)

    assert (told.bound >= told.full_bound * (1 - 1e-9)).all()
    assert told.gain == pytest.approx(300 / told.channels)
    assert told.scan_time == pytest.approx(20e-6 * told.channels)


def test_the_bound_of_a_region_is_reached_by_a_fit_to_its_readings_alone():
    region = Region("skin", radius=0.03, share=0.0)
    scanner = Scanner(SENSOR, region)
    scanner.follow(CENTRE.centre())
    chosen = scanner().channels
    load = Load(*CENTRE.centre(), CENTRE.force, 3e-3)

    def read(load):
        return HingedPlate().readings(load, POSITIONS).ravel()[chosen]

    rng = np.random.default_rng(0)
    K = np.full((800, 300), np.nan)
    K[:, chosen] = read(load) + rng.normal(0, NOISE, (800, len(chosen)))
    K = K.reshape(-1, 3, 100)
    fit, find = (
        LeastSquares(SineBasis(Patch(0.1, 0.1), 5, 5), SENSOR.layout),
        PointContact(Plate(Patch(0.1, 0.1)), SENSOR.layout),
    )

    found = [find(frame, fit(frame)) for frame in K]

    error = [[*(t.position - CENTRE.centre()), t.force - CENTRE.force] for t in found]
    # The standard error of a variance over 800 draws is 5 %.
    least = cramer_rao(read, load, math.sqrt(3) * NOISE)[:3]
    efficiency = least**2 / np.mean(np.square(error), axis=0)
    assert (efficiency > 0.85).all()
    assert (efficiency < 1.2).all()
    # The bound that is told is that of 15 functions, and of a load whose size is known.
    told = ScanTradeoff.of(SENSOR, region, CENTRE, NOISE).bound
    assert (told < least).all()
    assert (told > 0.9 * least).all()


def test_a_quarter_of_the_channels_lose_a_tenth_of_the_accuracy():
    told = ScanTradeoff.of(SENSOR, Region("skin", radius=0.025, share=0.1), CENTRE, NOISE)

    assert told.channels == 75
    assert told.gain == pytest.approx(4.0)
    np.testing.assert_allclose((told.bound / told.full_bound)[:2], 1.08, atol=0.01)


def test_an_element_counts_by_how_often_it_is_read():
    half = np.full(100, 0.5)

    np.testing.assert_allclose(
        contact_bound(SENSOR, CENTRE, NOISE, half),
        contact_bound(SENSOR, CENTRE, NOISE) * math.sqrt(2),
        rtol=1e-9,
    )


def test_dead_channels_tell_nothing():
    dead = range(50, 100)
    blind = replace(SENSOR, layout=SENSOR.layout.without(dead))
    weight = np.where(np.arange(100) < 50, 1.0, 0.0)

    np.testing.assert_allclose(
        contact_bound(blind, CENTRE, NOISE), contact_bound(SENSOR, CENTRE, NOISE, weight)
    )


def test_readings_that_do_not_decide_bound_nothing():
    nothing = contact_bound(SENSOR, CENTRE, NOISE, np.zeros(100))
    no_force = contact_bound(SENSOR, replace(CENTRE, force=0.0), NOISE)
    strip = Patch(0.1, 0.01, strip=True)
    layout = SensorLayout.regular(strip, 10, 1)
    planar = replace(SENSOR, layout=layout, plate=Plate(strip))
    along = contact_bound(planar, PointLoad(0.03, 0.005, 0.1), NOISE)

    assert np.isinf(nothing).all()
    assert np.isinf(no_force).tolist() == [True, True, False]
    assert np.isinf(along).tolist() == [False, True, False]


def test_what_takes_turns_counts_by_its_share():
    told = ScanTradeoff.of(SENSOR, Region("turns", share=0.25), CENTRE, NOISE)

    assert (told.channels, told.gain) == (75, pytest.approx(4.0))
    np.testing.assert_allclose(told.bound, 2 * told.full_bound, rtol=1e-9)


def test_a_bargain_that_is_off_is_none():
    told = ScanTradeoff.of(SENSOR, Region(), CENTRE, NOISE)

    assert (told.channels, told.gain) == (300, 1.0)
    np.testing.assert_array_equal(told.bound, told.full_bound)
