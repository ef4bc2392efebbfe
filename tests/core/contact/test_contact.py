"""Where the contact is and how hard, against the load that made the readings.

What elements read is Navier's plate of 240 waves each way, which shares nothing with the estimator.
"""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from kappaskin import LeastSquares, Patch, Plate, PointContact, PointLoad, SensorLayout, SineBasis
from navier import HingedPlate, Load
from studies import cramer_rao

SQUARE = Patch(0.1, 0.1)
NOISE = 0.231
away_from_the_rim = st.floats(0.02, 0.08)


class Skin:
    """An 8 x 8 fit on 10 x 10 elements of a hinged plate."""

    def __init__(self, patch=SQUARE, dead=(), gage_length=0.0):
        layout = SensorLayout.regular(patch, 10, 10).without(dead)
        self.layout, plate = replace(layout, gage_length=gage_length), Plate(patch)
        self.truth = HingedPlate(patch.a, patch.b, plate.rigidity)
        self.fit = LeastSquares(SineBasis(patch, 8, 8), self.layout)
        self.contact = PointContact(plate, self.layout)

    def curvature(self, *loads):
        return sum(self.read(load) for load in loads)

    def read(self, load):
        return self.truth.readings(load, self.layout.positions, self.layout.gage_length)

    def touches(self, curvature):
        """The contact of each frame of `curvature` (T, 3, P), or of the one frame (3, P)."""
        if curvature.ndim == 2:
            return self.contact(curvature, self.fit(curvature))
        return [self.contact(frame, self.fit(frame)) for frame in curvature]

    def noisy(self, load, frames, seed=0):
        draws = np.random.default_rng(seed).normal(0, NOISE, (frames, 3, len(self.layout)))
        return self.touches(self.curvature(load) + draws)


PAPER = Skin()


def as_hard_as_table_1(x, y, **width):
    """The force that moves the skin by 4.70 mm at (x, y)."""
    gives = PAPER.truth.displacement(Load(x, y, **width), np.array([[x, y]]))[0]
    return Load(x, y, 4.70e-3 / gives, **width)


def bound(load, skin=PAPER, read=True):
    """Least standard deviations of x, y and force, where the load's size is not known."""
    return cramer_rao(lambda load: skin.read(load)[:, read], load, sqrt(3) * NOISE)[:3]


def distance(touch, load):
    return np.hypot(*(touch.position - (load.x, load.y)))


# Waves of 0.4 mm are the shortest of the truth, and readings around a load change with 1/distance:
# the larger the disc, the less is left out, measured here by 240 waves against 480. What remains is
# the interpolation of the estimator's table, 1e-6 of a reading.
@pytest.mark.parametrize(
    ("radius", "away", "share"), [(0, 1e-4, 3e-3), (1e-3, 1e-5, 1e-4), (3e-3, 1e-6, 2e-5)]
)
@given(x=away_from_the_rim, y=away_from_the_rim)
@example(x=0.076, y=0.072)
@example(x=0.045, y=0.055)  # an element
def test_the_contact_is_found_where_the_load_is(radius, away, share, x, y):
    load = Load(x, y, 0.2, radius)

    touch = PAPER.touches(PAPER.curvature(load))

    assert distance(touch, load) < away
    assert touch.force == pytest.approx(0.2, rel=share)


@pytest.mark.parametrize("width", [{"radius": 5e-3}, {"sd": 2e-3}, {"sd": 4e-3}], ids=str)
@pytest.mark.parametrize("gage_length", [0.0, 6e-3])
def test_how_a_load_is_spread_and_how_long_the_gages_are_moves_it_little(width, gage_length):
    skin, rng = Skin(gage_length=gage_length), np.random.default_rng(0)
    loads = [Load(*place, 0.2, **width) for place in rng.uniform(0.02, 0.08, (20, 2))]

    touches = [skin.touches(skin.curvature(load)) for load in loads]

    assert max(map(distance, touches, loads)) < 2e-5
    np.testing.assert_allclose([touch.force for touch in touches], 0.2, rtol=1e-3)


@given(st.floats(0.003, 0.097), st.floats(0.003, 0.097))
def test_close_to_the_rim_a_contact_is_found_where_the_load_is(x, y):
    load = Load(x, y, 0.2, 3e-3)

    assert distance(PAPER.touches(PAPER.curvature(load)), load) < 0.5e-3


@given(st.floats(0.007, 0.093), st.floats(0.007, 0.093), st.sampled_from([0, 1e-3, 3e-3, 5e-3]))
def test_a_firm_contact_a_half_wave_from_the_rim_is_not_near_it(x, y, radius):
    assert not PAPER.touches(PAPER.curvature(Load(x, y, 0.2, radius))).near_rim


@pytest.mark.cases("0.08-0.5", "0.08-3", "0.2-1.5")
@pytest.mark.parametrize("mm", [0.5, 1, 1.5, 2, 3])
@pytest.mark.parametrize("force", [0.2, 0.08])
def test_a_contact_that_may_be_on_the_rim_says_so(mm, force):
    d = mm * 1e-3
    places = [(d, 0.041), (0.1 - d, 0.07), (0.036, d), (0.055, 0.1 - d)]

    touches = [t for p in places for t in PAPER.noisy(Load(*p, force), 100) if t.present]

    share = np.mean([touch.near_rim for touch in touches])
    assert share > 0.92 - 2 * sqrt(0.92 * 0.08 / len(touches))  # two standard errors


def test_a_feeble_contact_warns_of_the_rim_from_further_off():
    # 8 mm in, where a firm one does not; a feeble one may as well be a strong one on the rim.
    weak = PAPER.noisy(Load(0.008, 0.043, 0.018), 100)

    assert not any(t.near_rim for t in PAPER.noisy(Load(0.008, 0.043, 0.2), 100))
    assert sum(t.near_rim for t in weak if t.present) > 10


@given(away_from_the_rim, away_from_the_rim)
def test_a_mirrored_load_makes_the_mirrored_contact(x, y):
    here = PAPER.touches(PAPER.curvature(Load(x, y, 0.2, 3e-3)))
    there = PAPER.touches(PAPER.curvature(Load(0.1 - x, y, 0.2, 3e-3)))

    np.testing.assert_allclose(there.position, [0.1, 0] + here.position * [-1, 1], atol=1e-6)
    assert there.force == pytest.approx(here.force, rel=1e-4)


@pytest.mark.parametrize("patch", [Patch(1e-3, 1e-3), Patch(1.0, 1.0), Patch(0.1, 0.04)])
def test_the_contact_is_found_on_skins_of_any_size(patch):
    least = min(patch.a, patch.b)
    skin, load = Skin(patch), Load(0.37 * patch.a, 0.66 * patch.b, 0.2, 0.03 * least)

    touch = skin.touches(skin.curvature(load))

    assert distance(touch, load) < 5e-5 * least
    assert touch.force == pytest.approx(0.2, rel=1e-4)
    assert touch.load_radius == pytest.approx(load.radius, rel=1e-2)


def test_the_contact_is_found_without_the_elements_under_it():
    skin, load = Skin(dead=[34, 35, 44, 45]), Load(0.05, 0.04, 0.2, 3e-3)

    assert distance(skin.touches(skin.curvature(load)), load) < 1e-6


def test_a_pull_is_a_force_below_zero():
    touch = PAPER.touches(PAPER.curvature(Load(0.03, 0.06, -0.2, 3e-3)))

    assert touch.force == pytest.approx(-0.2, rel=2e-5)
    assert touch.displacement < 0
    assert touch.force_sd > 0


def test_the_displacement_is_that_of_the_shape_at_the_contact():
    curvature = PAPER.curvature(Load(0.03, 0.06, 0.2))

    touch = PAPER.touches(curvature)

    fit = PAPER.fit(curvature)
    b = PAPER.fit.basis.at(touch.position[None])[0]
    assert touch.displacement == pytest.approx(b @ fit.coefficients.ravel(), rel=1e-12)
    assert touch.displacement_sd > np.sqrt(b @ fit.covariance @ b)


def test_without_load_and_noise_there_is_no_contact():
    touch = PAPER.touches(np.zeros((3, 100)))

    assert not touch.present
    assert np.isnan([*touch.position, touch.force, touch.displacement]).all()


def test_where_no_reading_is_left_there_is_no_contact():
    nothing = np.full((3, 100), np.nan)

    assert not PAPER.contact(nothing, PAPER.fit(np.zeros((3, 100)))).present


def test_noise_alone_is_no_contact_in_5000_frames():
    draws = np.random.default_rng(0).normal(0, NOISE, (5000, 3, 100))

    assert sum(touch.present for touch in PAPER.touches(draws)) == 0


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_noise_alone_is_no_contact_when_readings_are_missing(share):
    rng = np.random.default_rng(0)
    draws = rng.normal(0, NOISE, (200, 3, 100))
    draws[:, rng.random((3, 100)) < share] = np.nan

    assert sum(touch.present for touch in PAPER.touches(draws)) <= 2


def test_a_touch_as_in_table_1_is_always_seen():
    load = as_hard_as_table_1(0.043, 0.031)

    assert all(touch.present for touch in PAPER.noisy(load, 500))


@pytest.mark.cases("place1")
@pytest.mark.slow
@pytest.mark.parametrize("place", [(0.05, 0.05), (0.02, 0.08), (0.043, 0.031)])
def test_over_4000_draws_the_contact_is_efficient_unbiased_and_covered(place):
    load = as_hard_as_table_1(*place, radius=3e-3)
    touches = PAPER.noisy(load, 4000)

    error = np.array([[*(t.position - place), t.force - load.force] for t in touches])
    reach = np.array([[*t.position_95, t.force_95] for t in touches])

    sd = error.std(axis=0)
    efficiency = bound(load) ** 2 / np.mean(error**2, axis=0)
    covered = np.mean(np.abs(error) < reach, axis=0)
    assert (efficiency > 0.9).all()
    assert (efficiency < 1.1).all()  # the standard error of a variance over 4000 draws is 2.2 %
    assert (np.abs(error.mean(axis=0)) < sd / 10).all()
    assert (covered > 0.93).all()
    assert (covered < 0.97).all()


@pytest.mark.parametrize("place", [(0.05, 0.05), (0.043, 0.031), (0.033, 0.07)])
def test_the_error_bars_of_the_contact_cover_the_load(place):
    load = as_hard_as_table_1(*place)
    touches = PAPER.noisy(load, 800)

    z = np.array([
        [*((t.position - place) / t.position_sd), (t.force - load.force) / t.force_sd]
        for t in touches
    ])  # fmt: skip

    # 68 % with a standard error of 1.6 %.
    np.testing.assert_allclose(np.mean(np.abs(z) < 1, axis=0), 0.68, atol=0.06)


@pytest.mark.parametrize("sign", [1, -1])
def test_error_bars_are_those_of_place_and_force_together(sign):
    load, noise = Load(0.048, 0.045, 0.2, 3e-3), np.random.default_rng(0).normal(0, 1e-3, (3, 100))
    p, q = np.arange(100) % 10, np.arange(100) // 10
    read = sign * (p - q) > 1  # on one side of a diagonal: x and y are not told apart alike
    K = PAPER.curvature(load) + noise

    touch = PAPER.touches(np.where(read, K, np.nan))

    least = bound(load, read=read)
    told = np.array([*touch.position_sd, touch.force_sd])
    np.testing.assert_allclose(told / told[0], least / least[0], rtol=5e-3)


def test_with_few_readings_the_intervals_are_wider_as_student_says():
    layout = SensorLayout.regular(SQUARE, 3, 2)
    fit = LeastSquares(SineBasis(SQUARE, 3, 2), layout)
    contact, load = PointContact(Plate(SQUARE), layout), Load(0.055, 0.042, 1.0, 3e-3)
    K = PAPER.truth.readings(load, layout.positions)
    draws = K + np.random.default_rng(0).normal(0, NOISE / 4, (4000, 3, 6))

    touches = [t for t in (contact(frame, fit(frame)) for frame in draws) if t.present]

    place = load.x, load.y
    error = np.array([[*(t.position - place), t.force - load.force] for t in touches])
    reach = np.array([[*t.position_95, t.force_95] for t in touches])
    sd = np.array([[*t.position_sd, t.force_sd] for t in touches])
    assert touches[0].spare == 14
    np.testing.assert_allclose(np.mean(np.abs(error) < reach, axis=0), 0.95, atol=0.015)
    assert (np.mean(np.abs(error) < 1.96 * sd, axis=0) < 0.942).all()


def test_a_contact_that_jumps_is_found_in_the_very_next_frame():
    rng = np.random.default_rng(0)
    loads = [as_hard_as_table_1(*rng.uniform(0.015, 0.085, 2)) for _ in range(300)]
    noise = rng.normal(0, NOISE, (300, 3, 100))

    touches = [PAPER.touches(PAPER.curvature(p) + n) for p, n in zip(loads, noise, strict=True)]

    off = [
        np.abs(t.position - (p.x, p.y)) / t.position_sd for t, p in zip(touches, loads, strict=True)
    ]
    assert np.max(off) < 5


def test_a_contact_that_leaves_is_gone_in_the_very_next_frame_and_back_in_the_one_after():
    draws = np.random.default_rng(0).normal(0, NOISE, (300, 3, 100))
    load = PAPER.curvature(as_hard_as_table_1(0.043, 0.031))

    present = [PAPER.touches(n + load * (i % 2)).present for i, n in enumerate(draws)]

    assert present == [bool(i % 2) for i in range(300)]


def test_two_contacts_are_not_taken_for_one():
    both = [as_hard_as_table_1(0.03, 0.03), as_hard_as_table_1(0.07, 0.06)]
    draws = np.random.default_rng(0).normal(0, NOISE, (50, 3, 100))

    assert not any(touch.single for touch in PAPER.touches(PAPER.curvature(*both) + draws))
    assert all(touch.single for touch in PAPER.touches(PAPER.curvature(both[0]) + draws))


def test_with_the_same_functions_the_contact_on_a_strip_is_the_place_along_it():
    strip = Patch(0.04, 0.01, strip=True)
    layout, plate = SensorLayout.regular(strip, 20, 1), Plate(strip)
    basis = SineBasis(strip, 15, 1)  # those of the estimator: this checks its algebra
    load = PointLoad(0.013, 0.002, 0.5)
    K = layout.operator(basis) @ plate.deflection([load], basis).ravel()
    fit = LeastSquares(SineBasis(strip, 12, 1), layout)

    touch = PointContact(plate, layout)(K.reshape(3, -1), fit(K.reshape(3, -1)))

    np.testing.assert_allclose(touch.position, [0.013, 0.005], atol=1e-8)
    assert touch.force == pytest.approx(0.5, rel=1e-6)
    assert touch.position_sd[1] == 0


@pytest.mark.parametrize("place", [(0.05, 0.05), (0.02, 0.08), (0.043, 0.031)])
def test_the_error_bar_of_the_displacement_covers_what_the_basis_cannot_follow(place):
    load = as_hard_as_table_1(*place)

    touches = PAPER.noisy(load, 300)

    z = np.array([(touch.displacement - 4.70e-3) / touch.displacement_sd for touch in touches])
    assert np.mean(np.abs(z) < 2) > 0.93


def test_few_spare_readings_need_a_stronger_contact():
    layout = SensorLayout.regular(SQUARE, 2, 2)
    fit, contact = (
        LeastSquares(SineBasis(SQUARE, 3, 2), layout),
        PointContact(Plate(SQUARE), layout),
    )
    draws = np.random.default_rng(0).normal(0, NOISE, (3000, 3, 4))

    assert sum(contact(frame, fit(frame)).present for frame in draws) <= 3
