"""Commands on live estimates: publish, listen."""

import math
import time
from contextlib import closing
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from kappaskin.cli.common import (
    FAILED,
    Described,
    SourceName,
    Switch,
    UsedTare,
    Whole,
    check_time,
    of_sensor,
    print_json,
    show,
    stops,
)
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from kappaskin.live import Engine, Status
    from kappaskin.publish import TargetStatus

_EVERY = 1.0  # s between two lines
_POLL = 0.05  # s
_STEEPER = 1.25  # times the slope of the last warning: warned again
_PATIENCE = 10.0  # s that the engine may not respond

Many = Annotated[list[str] | None, Parameter(negative="")]
Perhaps = Annotated[list[str] | None, Parameter(negative="", consume_multiple=True)]


def publish(
    source: SourceName,
    *,
    udp: Many = None,
    foxglove: Perhaps = None,
    allow_origin: Many = None,
    seconds: float = math.inf,
    sensor: Described = None,
    trust: Switch = False,
) -> int:
    """Publish contact, shape and error bars of every estimate, until stopped (Ctrl+C).

    Prints a line a second: frames/s, how many of them are computed, what of them (not the surface,
    which is not published) and the time that each takes, those skipped since they came faster than
    that, messages sent and dropped, and the 99th percentile of the time from the arrival of a frame
    until it was sent. The messages are explained in `publishing/messages.md` among the resources.
    Exit code 1 if there was nothing to send, or if the connection was lost in the end.

    Example: `kappaskin publish /dev/ttyACM0 --udp 192.168.1.20:9870 --foxglove`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, `feed:NAME`, or a port or URL for pyserial.
    udp
        HOST:PORT to send JSON datagrams to; may be given several times.
    foxglove
        Serve Foxglove at HOST:PORT, or without one at 127.0.0.1:8765; give it after the source. At
        an address that other machines reach, such as 0.0.0.0, it asks for a token: the URL with it
        is printed, and KAPPASKIN_TOKEN in the environment sets it.
    allow_origin
        Origin of web pages that may connect, besides those of this machine:
        https://app.foxglove.dev is Foxglove in the browser, file:// its desktop app; may be given
        several times.
    seconds
        How long to publish; until stopped when left out.
    trust
        Let the scene name files outside its folder.
    """
    from kappaskin.live import LOST, Engine
    from kappaskin.pipeline import Setup
    from kappaskin.publish import targets_of
    from kappaskin.scenes import load_scene
    from kappaskin.sources import SimulatedSource

    check_time(seconds, "publish")
    source = of_sensor(source, sensor)
    places = foxglove if foxglove != [] else [""]
    targets = [f"udp://{place}" for place in udp or ()]
    targets += [f"foxglove://{place}" for place in places or ()]
    if not targets:
        raise Refusal("expected a receiver: give --udp HOST:PORT, or --foxglove")
    if allow_origin and not places:
        raise Refusal("--allow-origin is for pages that connect to a server: give --foxglove")
    targets_of(targets)  # or refused here
    if source.startswith(SimulatedSource.SCHEME):
        load_scene(source.removeprefix(SimulatedSource.SCHEME), trust)  # or refused here
    stopped = stops()
    with Engine(Setup(quantities=())) as engine:
        engine.publish(targets, allow_origin or ())
        engine.connect(source, trust)
        status = _watched(engine, time.monotonic() + seconds, stopped)
    if status.state == LOST and not status.ended:
        show(f"kappaskin: {status.message}", error=True)
        return FAILED
    return FAILED if math.isnan(status.publishing.latency.whole) else 0


def _watched(engine: "Engine", end: float, stopped: list[int]) -> "Status":
    """Print a line a second until the `end`; the last status."""
    from kappaskin.estimation import slope_warning

    printed, line, slope = time.monotonic(), "", 0.0
    noticed, tared = set[str](), UsedTare(engine)
    status = engine.status()
    while not (stopped or status.ended) and time.monotonic() < end:
        time.sleep(_POLL)
        engine.revive()
        status = engine.status()
        if engine.given_up or engine.silent > _PATIENCE:
            raise Refusal(status.message)
        tared(status)
        for target in status.publishing.targets:
            if target.refusal:
                raise Refusal(target.refusal)
        notices = [
            (one.target, notice) for one in status.publishing.targets for notice in one.notices
        ]
        notices += [("noise", event.text) for event in status.events if event.kind == "noise"]
        _print_notices(notices, noticed)
        if status.slope > _STEEPER * slope:
            slope = status.slope
            show(f"kappaskin: {slope_warning(slope)}", error=True)
        if time.monotonic() - printed >= _EVERY:
            printed, line = time.monotonic(), _line(status)
            show(line)
    if (last := _line(status)) != line:
        show(last)
    return status


def _print_notices(notices: list[tuple[str, str]], printed: set[str]) -> None:
    """Print (name, text) of each notice on standard error, unless it is already in `printed`."""
    for name, notice in notices:
        text = f"kappaskin: {name}: {notice}"
        if text not in printed:
            printed.add(text)
            show(text, error=True)


def _line(status: "Status") -> str:
    publishing = status.publishing
    parts = [f"{status.state:9}", f"{status.rate:6.0f} frames/s"]
    if math.isfinite(each := status.computed.each):
        skipped = f", {status.skipped} skipped" if status.skipped else ""
        what = ", ".join(("shape", *status.quantities))
        rate = f"{status.computed.rate:.0f} computed ({what})"
        parts.append(f"{rate} in {1e3 * each:.2f} ms each{skipped}")
    parts += map(_words, publishing.targets)
    if math.isfinite(publishing.latency.whole):
        parts.append(f"99 % within {1e3 * publishing.latency.whole:.1f} ms")
    return "  ".join([*parts, *filter(None, (status.message, status.refusal))])


def _words(target: "TargetStatus") -> str:
    text = f"{target.target}: {target.sent} sent, {target.dropped} dropped"
    if target.target.startswith("foxglove"):
        return f"{text}, {len(target.receivers)} connected"
    trouble = target.receivers[0].trouble if target.receivers else "opening"
    return f"{text} ({trouble})" if trouble else text


_READ = 0.1  # s


def listen(*, udp: Whole = 9870, seconds: float = math.inf, json: Switch = False) -> int:
    """Print the messages received on a UDP port of this machine, until stopped (Ctrl+C).

    Contacts (ten a second) with their standard deviations and their age when sent, every loss on
    the network, the state of the source, and a summary. Exit code 1 if no contact came.

    Example: `kappaskin listen --udp 9870`

    Parameters
    ----------
    udp
        The port.
    seconds
        How long to listen; until stopped when left out.
    json
        Print every message as received, one per line.
    """
    from kappaskin.publish import UdpListener

    check_time(seconds, "listen")
    stopped = stops()
    end = time.monotonic() + seconds
    with closing(UdpListener(udp)) as listener:
        while not stopped and time.monotonic() < end:
            for message in listener.read(_READ):
                lines = listener.lines(message)
                if json:
                    print_json(message)
                else:
                    show(*lines)
    if not json:
        show(listener.summary)
    return 0 if listener.contacts else FAILED
