"""Cue transport: haptic cues as JSON datagrams, a thousand a second."""

import math
import threading
import time
from collections import deque

import numpy as np

from kappaskin.pipeline import Number
from kappaskin.publish import udp
from kappaskin.publish.haptic_cue import Cue, CueGenerator
from kappaskin.publish.message import VERSION, EstimateMessage, SourceState, numbers_text, template
from kappaskin.publish.publishing import CueStatus, Receiver, Target

PERIOD = 1e-3
"""Seconds between two cues."""

CUE = (
    Number("timestamp", "%.6f", "when this cue was sent; s since 1970 by the sender's clock"),
    Number("number", "%d", "count of the cues; a gap is a loss on the network"),
    Number("sequence", "%d", "scan number of the estimate that is felt; null without one"),
    Number("age_s", "%.6f", "age of its data when this cue was sent; null without one"),
    Number("scale", "%.4f", "from 1 for new data to 0 for old or none"),
    Number("force_N", "%.12g", "to be felt: 0 without a contact, and where it is not known"),
    Number("direction_x", "%.6f", "unit vector of the force: the inward normal of the skin"),
    Number("direction_y", "%.6f", "see direction_x"),
    Number("direction_z", "%.6f", "see direction_x"),
    Number("x_m", "%.6g", "position of the contact along the skin; null without one"),
    Number("y_m", "%.6g", "position of the contact across the skin"),
    Number("curvature_1_per_m", "%.12g", "larger principal curvature of the skin at the contact"),
    Number("curvature_2_per_m", "%.12g", "smaller principal curvature"),
    Number("curvature_1_sd_per_m", "%.3g", "standard deviation of curvature_1_per_m"),
    Number("curvature_2_sd_per_m", "%.3g", "standard deviation of curvature_2_per_m"),
    Number("slip_x_m_per_s", "%.12g", "velocity of the contact along the skin"),
    Number("slip_y_m_per_s", "%.12g", "velocity of the contact across the skin"),
    Number("slip_x_sd_m_per_s", "%.3g", "standard deviation of slip_x_m_per_s"),
    Number("slip_y_sd_m_per_s", "%.3g", "standard deviation of slip_y_m_per_s"),
)
"""The numbers of a cue, in order; with so many digits none is rounded to above a limit."""

_TEMPLATE = template(CUE)
_QUIET = 0.1  # s in which one with other limits fades, which sent to the same device
_ZEROS = 20  # cues of nothing at the end: some may be lost
_KEPT = 1024  # latencies that the percentiles are of
_EVERY = 1.0  # s between two computations of them


def opened(target: Target) -> "CueSender":
    """A sender of cues to the first reachable address of `target`."""
    time.sleep(_QUIET)
    return CueSender(udp.opened(target), CueGenerator(target.limits), target.finger)


class CueSender:
    """Sends the cue of the newest estimate each `PERIOD`, in a thread of its own.

    A cue whose time has passed is left out and counted. When it is closed the cue fades first.
    """

    notices = ()

    def __init__(self, to: udp.Udp, cues: CueGenerator, finger: str = "") -> None:
        self._udp, self._cues, self._source = to, cues, ""
        named = f'"finger":"{finger}",' if finger else ""
        self._head = f'{{"kind":"cue","version":{VERSION},{named}"source":"'
        self._number = self._missed = 0
        self._latencies: deque[float] = deque(maxlen=_KEPT)
        self._percentiles, self._next = (math.nan, math.nan), -math.inf
        self._worst = 1.0, ""
        self._closed = False
        # No daemon: a process that ends lets the cue fade. The thread ends with the main one.
        threading.Thread(target=self._run, name="cue-sender", daemon=False).start()

    @property
    def receivers(self) -> tuple[Receiver, ...]:
        return self._udp.receivers

    @property
    def counts(self) -> tuple[int, int]:
        return self._udp.counts

    @property
    def cue(self) -> CueStatus:
        """The state of the faintest cue since the last call, and how late cues are."""
        now = time.monotonic()
        if self._latencies and now >= self._next:
            self._next = now + _EVERY
            half, most = np.percentile(list(self._latencies), (50, 99)).tolist()
            self._percentiles = half, most
        (scale, state), self._worst = self._worst, (math.inf, "")
        return CueStatus(state, min(scale, 1.0), *self._percentiles, self._missed)

    def send(self, message: EstimateMessage) -> None:
        self._cues.take(message.estimate)

    def report(self, state: SourceState) -> None:
        self._source, self._cues.streams = state.source, state.state == "streaming"

    def close(self) -> None:
        self._closed = True
        self._cues.streams = False

    def _run(self) -> None:
        due, zeros, main = time.monotonic(), 0, threading.main_thread()
        while zeros < _ZEROS:
            if not main.is_alive():
                self.close()
            cue = self._cues()
            self._put(cue)
            zeros = zeros + 1 if self._closed and not (cue.scale or cue.force) else 0
            due += PERIOD
            late = time.monotonic() - due
            if late > 0:
                missed = math.ceil(late / PERIOD)
                self._missed += missed
                due += missed * PERIOD
            time.sleep(max(due - time.monotonic(), 0.0))
        self._udp.close()

    def _put(self, cue: Cue) -> None:
        self._udp.put(self.encoded(cue))
        self._number += 1
        self._worst = min(self._worst, (cue.scale, cue.state))
        if cue.fresh:
            self._latencies.append(time.monotonic() - cue.read)

    def encoded(self, cue: Cue) -> bytes:
        """The message of a cue, as JSON."""
        known = cue.sequence if cue.sequence >= 0 else math.nan
        values = [
            *(time.time(), self._number, known, cue.age, cue.scale, cue.force, *cue.direction),
            *(*cue.place, *cue.curvature, *cue.curvature_sd, *cue.slip, *cue.slip_sd),
        ]
        numbers = numbers_text(values, CUE, _TEMPLATE)
        return f'{self._head}{self._source}","state":"{cue.state}",{numbers}}}'.encode()
