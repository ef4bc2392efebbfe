"""Clock map: times on a device's clock to times on this machine's, with error bounds."""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from kappaskin.frames import OVERTAKEN

_FASTEST = 1e-2  # s/s that a clock may go wrong before its drift is known: a resonator's worst
_WANDER = 5e-6  # s/s by which the drift itself may change within the window: a clock warming up
_GRAIN = 1e-6  # s, the step of a device's clock
_WINDOW = 100.0  # s of exchanges that tell the drift
_BUCKET = 1.0  # s of which only the quickest exchange is kept, and the quickest message
_SOON = 0.05  # s after which one that shows the map wrong is taken in
_MESSAGES = 30  # quickest ones that are kept
_DELAY = 0.5  # s, longer than a message is under way where no exchange tells how long
_DOUBTS = 2  # messages in a row that contradict the map before it is given up
_WRAP = 2**32 * 1e-6  # s after which a counter of 32 bits in us begins again at 0
_LONGEST = 2**64 * 1e-6  # s, what the wire can say


class ClockState(NamedTuple):
    """State of a clock map: the `map` itself, and how often the device's counter has wrapped.

    `map` is at, offset, half, drift, spread (see `ClockMap.bound`) and whether they are in doubt.
    """

    map: tuple[float, float, float, float, float, bool]
    wraps: int
    last: float


class ClockMap:
    """Maps device times to host times, each within a bound.

    Nothing arrives before it was sent: an exchange bounds host time minus device time from both
    sides, any other message from one. The clocks drift apart evenly, but for a few parts per
    million; the bounds of a hundred seconds then enclose offset and drift, whatever the delays and
    however unequal they are, and one that was delayed only bounds less.

    `steps` counts how often the bounds contradicted each other twice running: the device restarted,
    or one of the clocks was set or stood still. The map then starts over. All times are in s.
    """

    def __init__(self) -> None:
        self.steps = 0
        self._exchanges: deque[tuple[float, float, float]] = deque()  # time, low, high
        self._messages: deque[tuple[float, float]] = deque(maxlen=_MESSAGES)  # time, high
        self._latest = -math.inf  # device time of the newest message
        self._wraps, self._last = 0, math.nan
        self._forget()

    def _forget(self) -> None:
        self._exchanges.clear()
        self._messages.clear()
        self._doubted = self._unanswered = self._delayed = 0
        self._know(0.0, math.nan, math.inf, 0.0, _FASTEST)
        self._least, self._quickest = math.inf, (math.nan, math.nan)

    def _know(self, at: float, offset: float, half: float, drift: float, spread: float) -> None:
        """Take it that host - device is `offset` +- `half` at `at`, and drifts so per second."""
        self._at, self._offset, self._half = at, offset, half
        self._drift, self._spread = drift, spread
        self._early = half if half < math.inf else _DELAY

    # What is known.

    def taken(self, device_time: float) -> float:
        """The host time of `device_time`; NaN before anything came, or while that is in doubt.

        Without exchanges it is as if the quickest messages had taken no time.
        """
        if self._doubted:
            return math.nan
        return device_time + self._offset + self._drift * (device_time - self._at)

    def bound(self, device_time: float) -> float:
        """How far `taken` may be out at most; infinite without exchanges.

        It is half of a round trip, and what the drift may have added since.
        """
        return self._half + self._spread * abs(device_time - self._at)

    def sd(self, device_time: float) -> float:
        """The standard deviation of `taken`, which may be anywhere within its bound."""
        return self.bound(device_time) / math.sqrt(3)

    @property
    def drift(self) -> float:
        """How much slower the device's clock goes, in parts per million; NaN if not known."""
        return self._drift * 1e6 if len(self._exchanges) > 1 else math.nan

    @property
    def drift_bound(self) -> float:
        """How far `drift` may be out at most, in parts per million."""
        return self._spread * 1e6 if len(self._exchanges) > 1 else math.inf

    @property
    def state(self) -> ClockState:
        """All that `taken`, `sd` and `unwrap` depend on."""
        map_ = self._at, self._offset, self._half, self._drift, self._spread, self._doubted > 0
        return ClockState(map_, self._wraps, self._last)

    # What comes.

    def unwrap(self, device_time: float) -> float:
        """Device time that goes on where a counter of 32 bits in us begins again.

        To be given every message's, in order. Only a step from within ten seconds of the end to
        within ten of the beginning is such a wrap; any other back to the beginning is a restart.
        """
        if not 0 <= device_time < _WRAP:
            return device_time  # of a longer counter, or garbage
        step = device_time - self._last
        if step > _WRAP - 10.0 and self._wraps:
            return device_time + (self._wraps - 1) * _WRAP  # a late one, of before the wrap
        if step < 10.0 - _WRAP:
            self._wraps += 1
        elif step < -OVERTAKEN:
            self._wraps = 0
        self._last = device_time
        return device_time + self._wraps * _WRAP

    def heard(self, device_time: float, host_time: float) -> None:
        """Take note of a message made at `device_time` that came at `host_time`."""
        away = device_time - self._at
        late = host_time - device_time - self._offset - self._drift * away
        early = -self._early - self._spread * abs(away)
        # Not the opposites, or NaN, of the first message too, would pass.
        if not (early < late < math.inf and device_time > self._latest - OVERTAKEN):
            self._contradicted(device_time, host_time)
            return
        self._doubted = 0
        if device_time > self._latest:
            self._latest = device_time
        if late < self._least:
            self._least, self._quickest = late, (device_time, host_time)
        # One that would have been made after it came shows a drift wrongly guessed.
        if away > (_SOON if late < 0 else _BUCKET):
            self._take_in()

    def exchange(self, sent: float, received: float, answered: float, arrived: float) -> None:
        """Take note of a ping and its answer.

        Host time when it was `sent`, device time when it was `received` and when it was `answered`,
        host time when the answer `arrived`.
        """
        if not (_possible(received, sent) and _possible(answered, arrived)):
            return
        low = sent - received - _GRAIN - _FASTEST * (answered - received)
        high = arrived - answered + _GRAIN
        if not (sent <= arrived and received <= answered and low <= high):
            return
        middle = self._offset + self._drift * (answered - self._at)
        reach = self.bound(answered)
        fits = middle - reach <= high and low <= middle + reach
        first = math.isnan(self._offset)
        if not first and not (fits and answered > self._latest - OVERTAKEN):
            self._unanswered += 1
            if self._unanswered < _DOUBTS:
                return
            self._start_over()
        self._unanswered = 0
        self._latest = max(self._latest, answered) if not first else answered
        self._add_exchange(answered, low, high)
        self._fit()

    def _contradicted(self, device_time: float, host_time: float) -> None:
        if not _possible(device_time, host_time):
            return
        if not math.isnan(self._offset):
            self._doubted += 1
            if self._doubted < _DOUBTS:
                return
            self._start_over()
        self._latest = device_time
        self._messages.append((device_time, host_time - device_time))
        self._fit()

    def _start_over(self) -> None:
        self.steps += 1
        self._latest = -math.inf
        self._forget()

    def _add_exchange(self, time: float, low: float, high: float) -> None:
        """Keep an exchange among those of the window, the quickest in each bucket."""
        exchanges = self._exchanges
        # Not the first, or a drift would be known no sooner than a bucket is over.
        if len(exchanges) > 1 and time - exchanges[-1][0] < _BUCKET:
            if high - low > exchanges[-1][2] - exchanges[-1][1]:
                return
            exchanges.pop()
        exchanges.append((time, low, high))
        while exchanges[0][0] < time - _WINDOW:
            exchanges.popleft()

    def _take_in(self) -> None:
        """Take in the quickest message since the last time."""
        time, host_time = self._quickest
        one_sided = math.isinf(self._half)
        self._delayed = self._delayed + 1 if one_sided and self._least > _DELAY else 0
        if self._delayed >= _DOUBTS:
            self._start_over()
            self._latest = time
        self._messages.append((time, host_time - time))
        self._fit()

    def _fit(self) -> None:
        """Find the offset now and the drift that all bounds allow, and forget what came since."""
        self._least, self._quickest = math.inf, (math.nan, math.nan)
        one_sided = [(time, -math.inf, high) for time, high in self._messages]
        t, low, high = np.array([*self._exchanges, *one_sided]).T
        ago = self._latest - t
        low, high = low - _WANDER * np.abs(ago), high + _WANDER * np.abs(ago)
        # Any two times t_i < t_j: low_j - high_i <= drift (t_j - t_i) <= high_j - low_i.
        i, j = np.nonzero(t[:, None] < t)
        slowest = max(-_FASTEST, float(np.max((low[j] - high[i]) / (t[j] - t[i]), initial=-1.0)))
        fastest = min(_FASTEST, float(np.min((high[j] - low[i]) / (t[j] - t[i]), initial=1.0)))
        if not self._exchanges:
            drift = float(np.median((high[j] - high[i]) / (t[j] - t[i]))) if i.size else 0.0
            self._know(self._latest, float(np.min(high + drift * ago)), math.inf, drift, _FASTEST)
            return
        drift, spread = (slowest + fastest) / 2, (fastest - slowest) / 2
        least = float(np.max(low + drift * ago - spread * np.abs(ago)))
        most = float(np.min(high + drift * ago + spread * np.abs(ago)))
        if spread < 0 or least > most:
            # Together they contradict each other, though no two in a row did: the drift changed.
            self._start_over()
            return
        half = (most - least) / 2
        self._know(self._latest, least + half, half, drift, spread + _WANDER)


def _possible(device_time: float, host_time: float) -> bool:
    return 0 <= device_time < _LONGEST and math.isfinite(host_time)


class RecordedClock(ClockMap):
    """A clock map with the states that a recorded one had, each from one scan on.

    `changes` are those to come: the device time, as `unwrap` gives it, of the first scan, and the
    state from then on.
    """

    def __init__(self) -> None:
        super().__init__()
        self.changes: deque[tuple[float, ClockState]] = deque(maxlen=_MESSAGES)

    def restore(self, state: ClockState) -> None:
        """Continue from a recorded state."""
        self._wraps, self._last = state.wraps, state.last
        self._set_map(state)

    def _set_map(self, state: ClockState) -> None:
        self._know(*state.map[:5])
        self._doubted = int(state.map[5])

    def heard(self, device_time: float, host_time: float) -> None:
        if any(since == device_time for since, _ in self.changes):
            since = math.nan
            while since != device_time:
                since, state = self.changes.popleft()
                self._set_map(state)
