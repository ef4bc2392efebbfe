"""How many frames are computed when more come than there is time for."""

import math

import pytest

from kappaskin.live.timing import ComputingTimes, RateLimit


class Played:
    """A loop that is given frames at a `rate` in frames/s, each estimate taking `cost` s."""

    def __init__(self, rate: float, cost: float, reads: float = 1e-3, wanted: bool = False) -> None:
        self.wanted = wanted
        self.now, self.rate, self.cost, self.reads = 0.0, rate, cost, reads
        self.pace = RateLimit(lambda: self.now)
        self.came = self.computed = 0
        self.busy, self.longest, self._last = 0.0, 0.0, 0.0

    def go(self, seconds: float) -> "Played":
        end = self.now + seconds
        while self.now < end:
            self.now += self.reads
            waiting = int(self.now * self.rate) - self.came
            count = self.pace.affordable(waiting, self.wanted)
            assert 0 <= count <= waiting
            if count:
                self.longest, self._last = max(self.longest, self.now - self._last), self.now
            self.now += count * self.cost
            self.busy += count * self.cost
            self.pace.spend(count, count * self.cost)
            self.came, self.computed = self.came + waiting, self.computed + count
        return self


@pytest.mark.parametrize(
    ("rate", "cost"), [(500, 0.5e-3), (500, 1e-3), (2000, 0.25e-3), (900, 0.8e-3)]
)
def test_every_frame_is_computed_where_there_is_time(rate, cost) -> None:
    played = Played(rate, cost).go(10.0)
    assert played.came - played.computed <= 10  # until it is known what one costs


@pytest.mark.parametrize(("wanted", "share"), [(False, 0.4), (True, 0.85)])
@pytest.mark.parametrize(("rate", "cost"), [(2000, 0.5e-3), (2000, 2e-3), (20_000, 0.3e-3)])
def test_where_there_is_not_a_share_of_the_time_is_spent(rate, cost, wanted, share) -> None:
    played = Played(rate, cost, 1e-4, wanted).go(2.0)  # until it knows rate and cost
    begun, busy = played.now, played.busy
    played.go(10.0)
    assert played.computed < played.came
    assert (played.busy - busy) / (played.now - begun) == pytest.approx(share, abs=0.03)


def test_someone_who_looks_on_is_always_shown_something() -> None:
    played = Played(500, 0.2).go(20.0)
    assert played.longest < 0.25
    assert played.computed > 80


def test_a_burst_after_a_pause_is_not_computed_whole() -> None:
    played = Played(2000, 0.5e-3).go(1.0)
    played.now += 5.0
    assert 1 <= played.pace.affordable(10_000) <= 100


def test_frames_that_come_in_heaps_are_computed_too_where_there_is_time() -> None:
    played = Played(500, 0.5e-3, reads=0.03).go(10.0)
    assert played.came - played.computed <= 20


def test_a_device_that_becomes_faster_than_can_be_computed_is_noticed_within_a_second() -> None:
    played = Played(500, 1e-3).go(5.0)
    played.rate = 3000
    played.came = int(played.now * played.rate)
    before = played.busy
    assert played.go(1.0).busy - before < 0.7


def test_nothing_waiting_costs_nothing() -> None:
    pace = RateLimit(lambda: 0.0)
    assert pace.affordable(0) == 0
    pace.spend(0, 0.0)
    assert pace.affordable(5) == 1


def test_of_frames_that_came_together_only_so_many_are_computed_as_are_not_late() -> None:
    pace = Played(500, 0.5e-3).go(2.0).pace
    assert pace.affordable(20) > 3
    assert pace.affordable(20, wanted=True) == 3
    slow = Played(100, 3e-3).go(2.0).pace
    assert slow.affordable(20, wanted=True) == 1  # the newest, however long it takes
    assert pace.affordable(0, wanted=True) == 0


def test_what_computed_frames_take_is_the_mean_of_half_a_second() -> None:
    now = [0.0]
    times = ComputingTimes(lambda: now[0])
    for _ in range(100):
        times.add(3e-4, 1e-4, 0.0)
        times.add(5e-4, 1e-4, 2e-5)
    assert math.isnan(times.means().each)

    now[0] = 0.5
    found = times.means()
    assert found.rate == pytest.approx(400)
    assert (found.estimate, found.publishing, found.keeping) == pytest.approx((4e-4, 1e-4, 1e-5))
    assert found.each == pytest.approx(5.1e-4)

    now[0] = 1.0  # none came since
    assert times.means().rate == 0
    assert math.isnan(times.means().each)
