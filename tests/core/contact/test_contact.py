"""Where the contact is and how hard, against the load that made the readings."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from kappaskin import LeastSquares, Patch, Plate, PointContact, PointLoad, SensorLayout, SineBasis

SQUARE = Patch(0.1, 0.1)
NOISE = 0.231
TABLE_1 = 15  # functions along each side of Table 1's skin
away_from_the_rim = st.floats(0.02, 0.08)


class Skin:
    """An 8 x 8 fit on 10 x 10 elements of a skin that bends in `modes` x `modes` functions."""

    def __init__(self, modes=TABLE_1, patch=SQUARE, dead=()):
        self.layout = SensorLayout.regular(patch, 10, 10).without(dead)
        self.plate, self.basis = Plate(patch), SineBasis(patch, modes, modes)
        self.fit = LeastSquares(SineBasis(patch, 8, 8), self.layout)
        self.contact = PointContact(self.plate, self.layout)
        self.M = self.layout.curvature_operator(self.basis)

    def curvature(self, *loads):
        return (self.M @ self.plate.deflection(loads, self.basis).ravel()).reshape(3, -1)

    def touches(self, curvature):
        """The contact of each frame of `curvature` (T, 3, P), or of the one frame (3, P)."""
        if curvature.ndim == 2:
            return self.contact(curvature, self.fit(curvature))
        return [self.contact(frame, self.fit(frame)) for frame in curvature]

    def noisy(self, load, frames, seed=0):
        draws = np.random.default_rng(seed).normal(0, NOISE, (frames, 3, len(self.layout)))
        return self.touches(self.curvature(load) + draws)

    def position_bound(self, load, step=1e-6, read=True):
        """The Cramer-Rao bound on the standard deviations of x, y and of the force."""

        def moved(dx, dy):
            return self.curvature(load.shifted(dx * step, dy * step)).ravel() / (2 * step)

        by_x, by_y = moved(1, 0) - moved(-1, 0), moved(0, 1) - moved(0, -1)
        J = np.column_stack([by_x, by_y, self.curvature(load.scaled(1 / load.force)).ravel()])
        J = J[np.broadcast_to(read, (3, len(self.layout))).ravel()]
        return NOISE * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))


PAPER = Skin()


def as_hard_as_table_1(x, y, skin=PAPER):
    """The force that moves the skin by 4.70 mm at (x, y)."""
    c = skin.plate.deflection([PointLoad(x, y)], skin.basis)
    return PointLoad(x, y, 4.70e-3 / float(skin.basis.at(np.array([[x, y]]))[0] @ c.ravel()))


def distance(touch, load):
    return np.hypot(*(touch.position - load.centre()))


@given(away_from_the_rim, away_from_the_rim)
@example(0.076, 0.072)
def test_the_contact_is_found_where_the_load_is(x, y):
    load = PointLoad(x, y, 0.2)

    touch = PAPER.touches(PAPER.curvature(load))

    assert distance(touch, load) < 1e-6
    assert touch.force == pytest.approx(0.2, rel=1e-4)


@given(st.floats(0.0005, 0.0995), st.floats(0.0005, 0.0995))
def test_close_to_the_rim_too_the_contact_is_found_where_the_load_is(x, y):
    load = PointLoad(x, y, 0.2)

    assert distance(PAPER.touches(PAPER.curvature(load)), load) < 20e-6


@given(st.floats(0.007, 0.093), st.floats(0.007, 0.093))
def test_a_firm_contact_a_half_wave_from_the_rim_is_not_near_it(x, y):
    assert not PAPER.touches(PAPER.curvature(PointLoad(x, y, 0.2))).near_rim


@pytest.mark.parametrize("mm", [0.5, 1, 1.5, 2, 3])
@pytest.mark.parametrize("force", [0.2, 0.08])
def test_a_contact_that_may_be_on_the_rim_says_so(mm, force):
    d = mm * 1e-3
    places = [(d, 0.041), (0.1 - d, 0.07), (0.036, d), (0.055, 0.1 - d)]

    touches = [t for p in places for t in PAPER.noisy(PointLoad(*p, force), 50) if t.present]

    assert np.mean([touch.near_rim for touch in touches]) > 0.92


def test_a_feeble_contact_warns_of_the_rim_from_further_off():
    # 8 mm in, where a firm one does not; a feeble one may as well be a strong one on the rim.
    weak = PAPER.noisy(PointLoad(0.008, 0.043, 0.018), 100)

    assert not any(t.near_rim for t in PAPER.noisy(PointLoad(0.008, 0.043, 0.2), 100))
    assert sum(t.near_rim for t in weak if t.present) > 10


@given(away_from_the_rim, away_from_the_rim)
def test_a_mirrored_load_makes_the_mirrored_contact(x, y):
    here = PAPER.touches(PAPER.curvature(PointLoad(x, y, 0.2)))
    there = PAPER.touches(PAPER.curvature(PointLoad(0.1 - x, y, 0.2)))

    np.testing.assert_allclose(there.position, [0.1, 0] + here.position * [-1, 1], atol=1e-6)
    assert there.force == pytest.approx(here.force, rel=1e-4)


@pytest.mark.parametrize("patch", [Patch(1e-3, 1e-3), Patch(1.0, 1.0), Patch(0.1, 0.04)])
def test_the_contact_is_found_on_skins_of_any_size(patch):
    skin, load = Skin(patch=patch), PointLoad(0.37 * patch.a, 0.66 * patch.b, 0.2)

    touch = skin.touches(skin.curvature(load))

    np.testing.assert_allclose(touch.position, load.centre(), rtol=0, atol=1e-3 * patch.a)
    assert touch.force == pytest.approx(0.2, rel=5e-3)


def test_the_contact_is_found_without_the_elements_under_it():
    skin, load = Skin(dead=[34, 35, 44, 45]), PointLoad(0.05, 0.04, 0.2)

    assert distance(skin.touches(skin.curvature(load)), load) < 0.06e-3


def test_a_pull_is_a_force_below_zero():
    touch = PAPER.touches(PAPER.curvature(PointLoad(0.03, 0.06, -0.2)))

    assert touch.force == pytest.approx(-0.2, rel=2e-3)
    assert touch.displacement < 0
    assert touch.force_sd > 0


def test_the_displacement_is_that_of_the_shape_at_the_contact():
    curvature = PAPER.curvature(PointLoad(0.03, 0.06, 0.2))

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


@pytest.mark.parametrize(
    ("place", "position_mm", "force_percent"),
    [((0.05, 0.05), 0.131, 0.61), ((0.02, 0.08), 0.046, 0.36)],
)
def test_the_cramer_rao_bound_of_table_1s_skin_is_the_known_one(place, position_mm, force_percent):
    load = as_hard_as_table_1(*place)
    if place == (0.02, 0.08):
        load = load.scaled(4.89 / 4.70)

    x, y, force = PAPER.position_bound(load)

    assert (1e3 * x, 1e3 * y) == pytest.approx((position_mm, position_mm), abs=5e-4)
    assert 100 * force / load.force == pytest.approx(force_percent, abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("place", [(0.05, 0.05), (0.02, 0.08)])
def test_over_4000_draws_the_contact_is_efficient_unbiased_and_covered(place):
    load = as_hard_as_table_1(*place)
    load = load.scaled(4.89 / 4.70) if place == (0.02, 0.08) else load
    touches = PAPER.noisy(load, 4000)

    error = np.array([[*(t.position - load.centre()), t.force - load.force] for t in touches])
    reach = np.array([[*t.position_95, t.force_95] for t in touches])

    sd = error.std(axis=0)
    efficiency = PAPER.position_bound(load) ** 2 / np.mean(error**2, axis=0)
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
        [*((t.position - load.centre()) / t.position_sd), (t.force - load.force) / t.force_sd]
        for t in touches
    ])  # fmt: skip

    # 68 % with a standard error of 1.6 %.
    np.testing.assert_allclose(np.mean(np.abs(z) < 1, axis=0), 0.68, atol=0.06)


@pytest.mark.parametrize("sign", [1, -1])
def test_error_bars_are_those_of_place_and_force_together(sign):
    load, noise = PointLoad(0.048, 0.045, 0.2), np.random.default_rng(0).normal(0, 1e-3, (3, 100))
    p, q = np.arange(100) % 10, np.arange(100) // 10
    read = sign * (p - q) > 1  # on one side of a diagonal: x and y are not told apart alike
    K = PAPER.curvature(load) + noise

    touch = PAPER.touches(np.where(read, K, np.nan))

    bound = PAPER.position_bound(load, read=read)
    told = np.array([*touch.position_sd, touch.force_sd])
    np.testing.assert_allclose(told / told[0], bound / bound[0], rtol=5e-3)


def test_with_few_readings_the_intervals_are_wider_as_student_says():
    layout = SensorLayout.regular(SQUARE, 3, 2)
    fit = LeastSquares(SineBasis(SQUARE, 3, 2), layout)
    contact, load = PointContact(Plate(SQUARE), layout), PointLoad(0.055, 0.042, 1.0)
    M = layout.curvature_operator(PAPER.basis)
    K = (M @ PAPER.plate.deflection([load], PAPER.basis).ravel()).reshape(3, -1)
    draws = K + np.random.default_rng(0).normal(0, NOISE / 4, (4000, 3, 6))

    touches = [t for t in (contact(frame, fit(frame)) for frame in draws) if t.present]

    error = np.array([[*(t.position - load.centre()), t.force - load.force] for t in touches])
    reach = np.array([[*t.position_95, t.force_95] for t in touches])
    sd = np.array([[*t.position_sd, t.force_sd] for t in touches])
    assert touches[0].spare == 15
    np.testing.assert_allclose(np.mean(np.abs(error) < reach, axis=0), 0.95, atol=0.015)
    assert (np.mean(np.abs(error) < 1.96 * sd, axis=0) < 0.942).all()


def test_a_contact_that_jumps_is_found_in_the_very_next_frame():
    rng = np.random.default_rng(0)
    loads = [as_hard_as_table_1(*rng.uniform(0.015, 0.085, 2)) for _ in range(300)]
    noise = rng.normal(0, NOISE, (300, 3, 100))

    touches = [PAPER.touches(PAPER.curvature(p) + n) for p, n in zip(loads, noise, strict=True)]

    off = [np.abs(t.position - p.centre()) / t.position_sd for t, p in zip(touches, loads)]  # noqa: B905
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


def test_on_a_strip_the_contact_is_a_place_along_it():
    strip = Patch(0.04, 0.01, strip=True)
    layout, plate = SensorLayout.regular(strip, 20, 1), Plate(strip)
    basis = SineBasis(strip, TABLE_1, 1)
    load = PointLoad(0.013, 0.002, 0.5)
    K = layout.curvature_operator(basis) @ plate.deflection([load], basis).ravel()
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
