"""The engine's status to the state that the badge shows: what is true now, the gravest first."""

import math

from kappaskin.live import Status
from kappaskin.recording import Replay
from kappaskin_app.shell.badge import LIVE, LOST, OFF, REPLAY, SIM, STALE, WAITING, is_now
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.widgets.parts import sentence

_STALE_AFTER = 0.5  # s without a frame


def state_of(status: Status, computed: float | None, now: float, paused: bool) -> str:
    """The badge's state.

    `computed` is the host time in s of the frame that the newest estimate is of, None without one;
    `paused` says that a simulation stands still.

    No line wins over no reading yet, that over old readings, and these over where they come from.
    """
    if status.state == "off":
        return OFF
    if status.state == "lost":
        return LOST
    waits = status.state == "waiting" and status.replay is None
    if waits or (status.computing and computed is None):
        return WAITING
    saturated = any(finding.kind == "saturated" for finding in status.health.findings)
    if status.replay is not None:
        return _replayed(status.replay, saturated)
    last = max(status.last_frame, -math.inf if computed is None else computed)
    if status.sensor is None or now - last > _STALE_AFTER:
        return WAITING if status.computing or last == -math.inf else STALE
    word = SIM if status.sensor.simulated else LIVE
    return is_now(word, saturated=saturated, paused=paused)


def _replayed(replay: Replay, saturated: bool) -> str:
    gap = any(begin < replay.at < end for begin, end in replay.gaps)
    over = replay.at >= replay.length and not replay.looped
    return is_now(REPLAY, gap=gap, saturated=saturated, paused=over or not replay.speed)


def in_use(status: Status) -> str:
    """Why the fit is not the one asked for, and which it is; nothing when it is."""
    if not status.refusal:
        return ""
    if status.slot is None:
        return f"Nothing is in use. {sentence(status.refusal)}"
    setup, sensor = status.setup, status.sensor
    across = 1 if sensor is not None and sensor.layout.patch.strip else setup.Nj
    method = METHOD_SHORT.get(setup.method, setup.method)
    return f"In use: {method}, {setup.Ni} x {across} functions. {sentence(status.refusal)}"
