"""Haptic cues: they fade with the age of their data, stay within limits, and tell how it slips."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from kappaskin import Refusal
from kappaskin.contact import NO_CONTACT, NO_GEOMETRY
from kappaskin.publish import Cue, CueGenerator, CueLimits
from kappaskin.publish.haptic_cue import FADE, FULL, RISE, SlipEstimator, limits_of

GONE = FULL + FADE
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
LIMITS = CueLimits()


class Bench:
    """A generator whose clocks are set by hand, and every cue that it made."""

    def __init__(self, limits: CueLimits | None = None) -> None:
        self.now, self.slept, self.sequence = 100.0, 0.0, 0
        self.cues: list[tuple[float, Cue]] = []
        self.made = CueGenerator(limits, lambda: self.now, lambda: self.slept)

    def feel(self, force: float = 1.0, late: float = 0.0, **changes: object) -> None:
        self.sequence += 1
        taken = self.now - late
        self.made.take(estimate(force, taken, self.now, self.sequence, **changes))

    def cue(self, after: float = 0.0) -> Cue:
        self.now += after
        self.cues.append((self.now + self.slept, self.made()))
        return self.cues[-1][1]

    def run(self, seconds: float, feels: bool = True, step: float = 1e-3) -> Cue:
        for _ in range(round(seconds / step)):
            self.now += step
            if feels:
                self.feel()
            self.cue()
        return self.cues[-1][1]


def estimate(force: float, taken: float, read: float, sequence: int = 0, **changes: object):
    """What a cue needs of an estimate."""
    given = {"place": (0.02, 0.03), "sd": 1e-5, "near_rim": False, "k": (-30.0, -50.0)}
    given = given | {"k_sd": (3.0, 5.0)} | changes
    contact = replace(
        NO_CONTACT,
        position=np.array(given["place"]),
        position_sd=np.full(2, given["sd"]),
        force=force,
        near_rim=given["near_rim"],
    )
    k, frame = np.array(given["k"]), np.eye(3)
    frame[2] = 0.0, 0.6, 0.8
    geometry = replace(NO_GEOMETRY, curvature_form=np.diag(k), frame=frame)
    return SimpleNamespace(
        contact=contact,
        second=NO_CONTACT,
        geometry=replace(geometry, covariance=np.diag([*given["k_sd"], 0.0]) ** 2),
        host_time=read,
        taken=taken,
        device_time=given.get("time", taken),
        sequence=sequence,
        generation=given.get("generation", 1),
    )


def numbers(cue: Cue) -> list[float]:
    """Every number that is felt."""
    return [cue.scale, cue.force, *cue.direction, *cue.curvature, *cue.slip]


def test_a_cue_says_what_the_estimate_says() -> None:
    bench = Bench()
    cue = bench.run(0.2)
    assert (cue.state, cue.scale, cue.age, cue.sequence) == ("live", 1.0, 0.0, bench.sequence)
    assert cue.force == 1.0
    assert cue.direction == (0.0, -0.6, -0.8)
    assert (cue.place, cue.curvature, cue.curvature_sd) == ((0.02, 0.03), (-30, -50), (3, 5))


def test_it_fades_to_nothing_and_stays_there_until_there_is_another_estimate() -> None:
    bench = Bench()
    bench.run(0.2)
    assert bench.cue(FULL - 1e-6).scale == 1
    assert bench.cue(FADE / 2).scale == pytest.approx(0.5, abs=1e-4)
    gone = bench.cue(FADE / 2 + 1e-5)
    assert (gone.state, gone.scale, gone.force, gone.curvature) == ("stale", 0, 0, (0, 0))
    assert bench.run(5.0, feels=False).scale == 0
    back = bench.run(RISE - 0.002)
    assert 0.9 < back.scale < 1
    assert bench.run(0.01).scale == 1


def test_late_data_are_felt_less_though_they_come() -> None:
    bench = Bench()
    bench.run(0.2)
    for _ in range(200):
        bench.now += 1e-3
        bench.feel(late=0.07)
        cue = bench.cue()
    assert (cue.state, cue.scale) == ("late", pytest.approx((GONE - 0.07) / FADE))
    for _ in range(200):
        bench.now += 1e-3
        bench.feel(late=0.2)
        cue = bench.cue()
    assert (cue.state, cue.force) == ("late", 0)


def test_a_source_that_is_lost_fades_at_once_and_returns_smoothly() -> None:
    bench = Bench()
    bench.run(0.2)
    bench.made.streams = False
    assert bench.run(FADE + 0.002).force == 0
    assert bench.cue().state == "lost"
    bench.made.streams = True
    assert 0 < bench.run(0.01).scale < 0.2


@pytest.mark.parametrize(
    "changes", [{"force": math.nan}, {"force": -1.0}, {"near_rim": True}], ids=str
)
def test_a_force_that_is_unknown_or_pulls_is_none(changes: dict[str, object]) -> None:
    bench = Bench()
    bench.feel(**changes)
    assert bench.cue(0.02).force == 0


def test_what_is_unknown_is_felt_as_none() -> None:
    bench = Bench()
    nothing = estimate(1.0, bench.now, bench.now)
    nothing.contact, nothing.geometry = NO_CONTACT, NO_GEOMETRY
    bench.run(0.1)
    bench.made.take(nothing)
    cue = bench.cue(0.02)
    assert (cue.force, cue.curvature, cue.slip) == (0, (0, 0), (0, 0))
    assert cue.direction == (0.0, -0.6, -0.8)  # as it was: a unit vector at any time
    assert np.isnan(cue.place).all()


def test_nothing_is_felt_after_a_suspension_nor_of_a_clock_that_went_back() -> None:
    bench = Bench()
    bench.run(0.2)
    bench.slept += 3600  # the monotonic clock does not count it
    cue = bench.cue(1e-3)
    assert (cue.state, cue.scale, cue.force) == ("stale", 0, 0)
    bench.run(0.2)
    bench.slept -= 0.1  # a pause between reading two clocks is no suspension
    bench.cue()
    bench.slept += 0.1
    bench.feel()
    assert bench.cue().scale == 1
    bench.now -= 50
    bench.cue()
    assert bench.run(FADE + 0.002, feels=False).force == 0
    assert bench.run(0.2).scale == 1


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["tick", "tick", "feel", "feel", "source", "sleep", "back"]),
        st.floats(0, 0.08),
        NUMBERS,
        NUMBERS,
        st.booleans(),
    ),
    max_size=80,
)


@given(STEPS, st.floats(0.1, 20))
@example([("feel", 0.0, 0.0, 3e-241, False)], 1.0)  # whose square is zero
@settings(deadline=None)
def test_no_cue_exceeds_the_limits_or_is_of_old_data(steps, most: float) -> None:
    bench = Bench(CueLimits(force=most, rate=max(most / FADE * 1.001, 100)))
    limits, newest = bench.made.limits, -math.inf
    for what, seconds, force, k, flag in steps:
        bench.now += seconds
        if what == "feel":
            place = (seconds, k if not abs(k) > 1 else 1.0)  # m, or not known
            changes = {"k": (k, -k), "near_rim": flag, "place": place}
            bench.feel(force, late=seconds if flag else math.nan, **changes)
            newest = bench.now + bench.slept - (seconds if flag else 0)
        elif what == "source":
            bench.made.streams = flag
        elif what == "sleep":
            bench.slept += 10 * seconds
        elif what == "back" and flag:
            bench.now -= 2 * seconds
        cue = bench.cue()
        assert np.isfinite(numbers(cue)).all()
        assert 0 <= cue.scale <= 1
        assert 0 <= cue.force <= limits.force
        assert np.linalg.norm(cue.direction) == pytest.approx(1)
        assert np.abs(cue.curvature).max() <= limits.curvature
        assert math.hypot(*cue.slip) <= limits.slip * (1 + 1e-12)
        if bench.now + bench.slept - newest >= GONE + 1e-9 and what != "back":
            assert (cue.scale, cue.force) == pytest.approx((0, 0), abs=1e-12)
    for (before, a), (after, b) in zip(bench.cues, bench.cues[1:], strict=False):
        passed = max(after - before, 0) + 1e-9
        assert abs(b.force - a.force) <= limits.rate * passed
        assert b.scale - a.scale <= passed / RISE
        assert a.scale - b.scale <= passed / FADE


# Limits


@pytest.mark.parametrize(
    ("query", "limits"),
    [
        ("", CueLimits()),
        ("force=5", CueLimits(force=5)),
        ("rate=400&force=20", CueLimits(force=20, rate=400)),
        ("curvature=1e3&slip=.25", CueLimits(curvature=1000, slip=0.25)),
    ],
)
def test_limits_are_known_by_their_query(query: str, limits: CueLimits) -> None:
    assert limits_of(query) == limits
    assert limits_of(limits.query) == limits


@pytest.mark.parametrize(
    "query",
    ["force", "force=", "force=x", "force=0", "force=-1", "force=inf", "force=nan", "mass=1", "&"],
)
def test_what_is_no_limit_is_refused(query: str) -> None:
    with pytest.raises(Refusal, match="expected"):
        limits_of(query)


def test_a_rate_at_which_the_force_would_not_fade_in_time_is_refused() -> None:
    with pytest.raises(Refusal, match="expected a rate of at least 400 N/s, at which 20 N fade"):
        limits_of("force=20")


# Slip


def slips(rng, count: int, v: np.ndarray, sd: float, rate: float = 400.0):
    """The last velocity of a contact that moves at `v`, and its error bar."""
    made = SlipEstimator()
    for n in range(count):
        place = v * n / rate + sd * rng.standard_normal(2)
        told = made(estimate(1.0, n / rate, 0.0, place=place, sd=sd))
    return told


def test_slip_is_exact_of_a_steady_contact_and_covered_by_its_error_bar() -> None:
    rng, v, count = np.random.default_rng(3), np.array([0.03, -0.01]), 21  # places in 50 ms
    assert slips(rng, 30, v, 0.0)[0] == pytest.approx(v, rel=1e-6)
    found, sd = np.moveaxis([slips(rng, 40, v, 2e-5) for _ in range(400)], 1, 0)
    assert 0.92 < np.mean(np.abs(found - v) < 1.96 * sd) < 0.98
    spread = np.sqrt(np.sum((np.arange(count) - 10) ** 2)) / 400
    assert np.median(sd) == pytest.approx(2e-5 / spread, rel=0.1)


def test_slip_of_a_contact_that_turns_has_a_larger_error_bar() -> None:
    made = SlipEstimator()
    for n in range(40):
        there = 1e-3 * abs(n - 29)  # turns in the middle of the window
        _, sd = made(estimate(1.0, n / 400, 0.0, place=(there, 0.0), sd=1e-6))
    assert sd[0] > 100 * sd[1]


@pytest.mark.parametrize("changes", [{"time": 9.0}, {"time": 0.0}, {"generation": 2}], ids=str)
def test_slip_begins_again_after_a_gap_and_with_other_settings(changes: dict[str, float]) -> None:
    made = SlipEstimator()
    for n in range(5):
        told = made(estimate(1.0, n / 400, 0.0, place=(1e-3 * n, 0.0)))
    assert told[0] == pytest.approx([0.4, 0.0])
    assert np.isnan(made(estimate(1.0, 5 / 400, 0.0, **changes))).all()
