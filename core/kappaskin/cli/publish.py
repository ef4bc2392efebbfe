"""Estimates sent to who wants them, without a window."""

import math
import time
from typing import Annotated

from cyclopts import Parameter

from kappaskin.cli.common import FAILED, check_time, stops
from kappaskin.errors import Refusal
from kappaskin.live import Engine, Status
from kappaskin.publish import Latency, TargetStatus, targets_of
from kappaskin.scenes import load_scene
from kappaskin.sources import SIMULATION

_EVERY = 1.0  # s between two lines
_LOOK = 0.05  # s

Many = Annotated[list[str] | None, Parameter(negative="")]
Perhaps = Annotated[list[str] | None, Parameter(negative="", consume_multiple=True)]


def publish(
    source: str, *, udp: Many = None, foxglove: Perhaps = None, seconds: float = math.inf
) -> int:
    """Send contact, shape and error bars of every estimate to others, until stopped (Ctrl+C).

    Prints a line a second: frames/s, messages sent and dropped, and the 99th percentile of the
    time from the arrival of a frame until it was sent. The messages are explained in
    `publishing/messages.md` among the resources. Exit code 1 if there was nothing to send.

    Example: `kappaskin publish /dev/ttyACM0 --udp 192.168.1.20:9870 --foxglove`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, or a port or URL for pyserial.
    udp
        HOST:PORT that gets a datagram of JSON each; may be given several times.
    foxglove
        Serve Foxglove, at HOST:PORT if given, otherwise at 127.0.0.1:8765; after the source.
    seconds
        How long to publish; until stopped when left out.
    """
    check_time(seconds, "publish")
    places = foxglove if foxglove != [] else [""]
    targets = [f"udp://{place}" for place in udp or ()]
    targets += [f"foxglove://{place}" for place in places or ()]
    if not targets:
        raise Refusal("expected somebody to send to: give --udp HOST:PORT, or --foxglove")
    targets_of(targets)  # or refused here
    if source.startswith(SIMULATION):
        load_scene(source.removeprefix(SIMULATION))  # or refused here
    stopped = stops()
    with Engine() as engine:
        engine.publish(targets)
        engine.connect(source)
        told = _watched(engine, time.monotonic() + seconds, stopped)
    return FAILED if math.isnan(told.publishing.latency.whole) else 0


def _watched(engine: Engine, end: float, stopped: list[int]) -> Status:
    """Tell how it goes until the `end`; how it went."""
    said, line = time.monotonic(), ""
    status = engine.status()
    while not stopped and time.monotonic() < end:
        time.sleep(_LOOK)
        engine.revive()
        status = engine.status()
        for target in status.publishing.targets:
            if target.refusal:
                raise Refusal(target.refusal)
        if time.monotonic() - said >= _EVERY:
            said, line = time.monotonic(), _line(status)
            print(line, flush=True)
    if (last := _line(status)) != line:
        print(last)
    return status


def _line(status: Status) -> str:
    news = status.publishing
    told = [f"{status.state:9}", f"{status.rate:6.0f} frames/s", *map(_words, news.targets)]
    if math.isfinite(news.latency.whole):
        told.append(_late(news.latency))
    return "  ".join([*told, status.message])


def _words(target: TargetStatus) -> str:
    told = f"{target.target}: {target.sent} sent, {target.dropped} dropped"
    if target.target.startswith("foxglove"):
        return f"{told}, {len(target.receivers)} connected"
    trouble = target.receivers[0].trouble if target.receivers else "opening"
    return f"{told} ({trouble})" if trouble else told


def _late(latency: Latency) -> str:
    return f"99 % within {1e3 * latency.whole:.1f} ms"
