"""The closed loop: each contact moves what the next frame scans, by any clock."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from kappaskin import Pipeline, PointLoad, Refusal, Region, Setup, load_scene
from kappaskin.live import track_region
from kappaskin.scenes import Orbit
from kappaskin.sensing import SECOND_GENERATION
from kappaskin.sources import SimulatedSource, VirtualClock

pytestmark = pytest.mark.slow

RATE = 1e6  # frames/s asked for: as many as the scan allows
_ROUND = load_scene("circle")
CIRCLE = replace(
    _ROUND.touched_by(*_ROUND.loads, motion=Orbit(0.022, 1.0)),
    transduction=SECOND_GENERATION,
    rate=1 / SECOND_GENERATION.scan_time(300),
)


class Loop:
    """A source, a pipeline and what steers, in time that only the source spends."""

    def __init__(self, region, scene=CIRCLE):
        self.clock = VirtualClock()
        self.source = SimulatedSource(scene, self.clock, self.clock.sleep)
        self.pipeline = Pipeline(self.source.sensor, Setup(nx=9, ny=9), clock=self.clock)
        self.steering = track_region(self.source, region)

    def run(self, seconds):
        """Frames and their estimates."""
        end, seen = self.clock.now + seconds, []
        while self.clock.now < end:
            for frame in self.source.read(seconds):
                seen.append((frame, self.pipeline(frame)))
                if self.steering is not None:
                    self.steering(seen[-1][1].contact, self.pipeline.fit)
        return seen


def elements(frame):
    return np.unique(frame.channels % 100)


@pytest.mark.cases("skin")
@pytest.mark.parametrize("around", ["skin", "intrinsic"])
def test_the_region_follows_the_contact_all_the_way_round(around):
    loop = Loop(Region(around, radius=0.02, share=0.1, rate=RATE))

    seen = loop.run(1.0)[1:]

    positions = loop.source.sensor.layout.positions
    for frame, estimate in seen:
        assert len(frame.channels) < 90
        assert estimate.contact.present
        off = np.hypot(*(positions - frame.truth.contact).T)
        missed = set(np.flatnonzero(off <= 0.015)) - set(elements(frame).tolist())
        assert not missed  # what lies well within 20 mm of the true contact is scanned
        assert np.isfinite(estimate.curvature).all()
        assert estimate.fresh.sum() == len(frame.channels)
    assert len(seen) > 4 * 167


def test_the_rate_is_the_least_of_what_is_asked_for_and_what_the_scan_allows():
    fast, slow = (Loop(Region("skin", radius=0.02, rate=rate)) for rate in (RATE, 200.0))

    for loop, expected in ((fast, None), (slow, 200.0)):
        seen = loop.run(0.2)[1:]
        for (frame, _), (after, _) in pairwise(seen):
            rate = expected or 1 / (20e-6 * len(frame.channels))
            assert 1 / (after.device_time - frame.device_time) == pytest.approx(rate, rel=1e-6)


def test_frames_come_no_sooner_than_the_scan_before_them_ends():
    seen = Loop(Region("skin", rate=RATE)).run(0.3)

    for (frame, _), (after, _) in pairwise(seen):
        taken = 20e-6 * len(frame.channels)
        assert after.device_time - frame.device_time >= taken * (1 - 1e-6)
    assert [frame.sequence for frame, _ in seen] == list(range(len(seen)))


@pytest.mark.parametrize("around", ["skin", "intrinsic"])
def test_when_the_contact_is_lost_everything_is_scanned_again(around):
    loop = Loop(Region(around, radius=0.02, rate=RATE))
    touched = loop.run(0.1)

    loop.source.play(CIRCLE.touched_by())
    lifted = loop.run(0.1)
    loop.source.play(CIRCLE.touched_by(PointLoad(0.03, 0.07, 0.3)))
    again = loop.run(0.1)

    assert len(touched[-1][0].channels) < 90
    assert [len(frame.channels) for frame, _ in lifted[-5:]] == [300] * 5
    assert not lifted[-1][1].contact.present
    assert len(again[-1][0].channels) < 90
    assert again[-1][1].contact.position == pytest.approx([0.03, 0.07], abs=1e-3)


def test_a_load_elsewhere_is_seen_through_the_elements_in_turn():
    still = CIRCLE.touched_by(PointLoad(0.02, 0.02, 0.2))
    loop = Loop(Region("skin", radius=0.02, share=0.1, rate=RATE), still)
    loop.run(0.05)

    loop.source.play(still.touched_by(PointLoad(0.08, 0.075, 0.2)))
    seen = loop.run(0.05)

    assert seen[-1][1].contact.position == pytest.approx([0.08, 0.075], abs=1e-3)


@pytest.mark.full
def test_without_a_share_of_the_others_a_contact_is_off_by_no_more_than_it_moved_meanwhile():
    loop = Loop(Region("skin", radius=0.015, share=0.0, rate=RATE))

    seen = loop.run(0.6)

    channels = np.array([len(frame.channels) for frame, _ in seen])
    undecided = np.array([np.isnan(estimate.noise) for _, estimate in seen])
    # When what is held expires, too few readings decide the shape; the next frame reads them all.
    assert undecided.sum() >= 3
    assert (channels[1:][undecided[:-1]] == 300).all()
    off = [np.hypot(*(e.contact.position - f.truth.contact)) for f, e in seen if e.contact.present]
    # By what it moved while the oldest reading was held; readings of a point where it was, and of
    # where it is, are together as one a little farther.
    assert max(off) < 1.2 * 2 * np.pi * 0.022 * 0.1


def test_elements_by_hand_are_scanned_and_off_scans_everything_again():
    loop = Loop(Region("elements", elements=(44, 45, 54, 55), share=0.0, rate=RATE))
    by_hand = loop.run(0.05)

    loop.steering = track_region(loop.source, Region())
    off = loop.run(0.05)

    assert {tuple(elements(frame)) for frame, _ in by_hand} == {(44, 45, 54, 55)}
    assert {len(frame.channels) for frame, _ in off} == {300}
    steps = np.diff([frame.device_time for frame, _ in off])
    np.testing.assert_allclose(steps, 6e-3, rtol=1e-6)


def test_a_region_that_is_not_on_the_skin_is_refused_and_everything_scanned():
    loop = Loop(Region("skin", rate=RATE))
    loop.run(0.05)

    with pytest.raises(Refusal, match="elements from 0 to 99"):
        track_region(loop.source, Region("elements", elements=(500,)))

    assert {len(frame.channels) for frame, _ in loop.run(0.05)} == {300}


def test_the_base_reads_the_load_where_it_is_when_the_frame_is_taken():
    loop = Loop(Region())
    loop.run(0.3)
    frame, _ = loop.run(0.01)[-1]

    expected = loop.source.base.read(
        CIRCLE.plate.patch, CIRCLE.loads_at(frame.device_time), np.random.default_rng(0)
    )

    np.testing.assert_allclose(loop.source.wrench().force, expected.force, atol=1e-12)
