"""Commands on live estimates: publish, serve, listen."""

import math
import time
from contextlib import closing
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from kappaskin.cli.common import (
    FAILED,
    DescribedFingers,
    FingerMonitor,
    SourceName,
    Sources,
    Switch,
    UsedTare,
    Whole,
    check_time,
    fingers_of,
    print_json,
    show,
    stops,
)
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from kappaskin.live import Engine, Fingers, Status
    from kappaskin.publish import TargetStatus

_EVERY = 1.0  # s between two lines
_POLL = 0.05  # s
_STEEPER = 1.25  # times the slope of the last warning: warned again
_PATIENCE = 10.0  # s that the engine may not respond

Many = Annotated[list[str] | None, Parameter(negative="")]
Perhaps = Annotated[list[str] | None, Parameter(negative="", consume_multiple=True)]


def publish(
    source: SourceName | None = None,
    /,
    *,
    sources: Sources = None,
    udp: Many = None,
    cue: Many = None,
    foxglove: Perhaps = None,
    rerun: Perhaps = None,
    allow_origin: Many = None,
    seconds: float = math.inf,
    sensor: DescribedFingers = None,
    trust: Switch = False,
) -> int:
    """Publish contact, shape and error bars of every estimate, until stopped (Ctrl+C).

    Prints a line a second: frames/s, how many of them are computed, what of them (not the surface,
    which is not published) and the time that each takes, those skipped since they came faster than
    that, messages sent and dropped, and the 99th percentile of the time from the arrival of a frame
    until it was sent. The messages are explained in `publishing/messages.md` among the resources.
    Exit code 1 if there was nothing to send, or if the connection was lost in the end.

    Of a hand each finger has a source, a sensor and a tare of its own. Messages and topics name the
    finger; one that is lost, stalls or dies leaves the others alone. Of a recording of a hand all
    fingers are published.

    Example: `kappaskin publish /dev/ttyACM0 --udp 192.168.1.20:9870 --foxglove`

    Example: `kappaskin publish --source thumb=/dev/ttyACM0 --source index=/dev/ttyACM1 --udp :9870`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, `feed:NAME`, or a port or URL for pyserial; of a hand `hand:NAME`, or
        the file of its description.
    sources
        The source of one finger of a hand, as NAME=SOURCE; may be given several times.
    udp
        HOST:PORT to send JSON datagrams to; may be given several times.
    cue
        HOST:PORT of a haptic device that gets what is to be felt, a thousand times a second, with
        limits such as 127.0.0.1:9871?force=2&rate=100 in N and N/s; may be given several times.
    foxglove
        Serve Foxglove at HOST:PORT, or without one at 127.0.0.1:8765; give it after the source. Of
        a hand each finger has a server of its own, at ports that follow each other. At
        an address that other machines reach, such as 0.0.0.0, it asks for a token: the URL with it
        is printed, and KAPPASKIN_TOKEN in the environment sets it.
    rerun
        Send to the viewer of Rerun at HOST:PORT, or without one at 127.0.0.1:9876; start it first
        with `rerun`.
    allow_origin
        Origin of web pages that may connect, besides those of this machine:
        https://app.foxglove.dev is Foxglove in the browser, file:// its desktop app; may be given
        several times.
    seconds
        How long to publish; until stopped when left out.
    trust
        Let the scene name files outside its folder.
    """
    from kappaskin.live import LOST, Fingers
    from kappaskin.pipeline import Setup
    from kappaskin.publish import targets_of

    check_time(seconds, "publish")
    fingers = fingers_of(source, sources, sensor)
    places = foxglove if foxglove != [] else [""]
    targets = [f"udp://{place}" for place in udp or ()]
    targets += [f"cue://{place}" for place in cue or ()]
    targets += [f"foxglove://{place}" for place in places or ()]
    targets += [f"rerun://{place}" for place in (rerun if rerun != [] else [""]) or ()]
    if not targets:
        raise Refusal(
            "expected a receiver: give --udp HOST:PORT, --cue HOST:PORT, --foxglove or --rerun"
        )
    if allow_origin and not places:
        raise Refusal("--allow-origin is for pages that connect to a server: give --foxglove")
    targets_of(targets)  # or refused here
    _check_scenes(fingers, trust)
    stopped = stops()
    with Fingers(fingers, Setup(quantities=())) as hand:
        hand.publish(targets, allow_origin or ())
        hand.connect(fingers, trust)
        statuses = _watched(hand, time.monotonic() + seconds, stopped)
    failed = False
    for finger, status in statuses.items():
        lost = status.state == LOST and not status.ended
        if lost and len(fingers) == 1:
            show(f"kappaskin: {_named(finger, status.message)}", error=True)
        cues = (target.cue.most for target in status.publishing.targets if target.cue)
        failed |= lost or all(map(math.isnan, (status.publishing.latency.whole, *cues)))
    return FAILED if failed else 0


def serve(
    source: SourceName | None = None,
    /,
    *,
    sources: Sources = None,
    listen: str = "127.0.0.1",
    recordings: Path = Path(),
    seconds: float = math.inf,
    sensor: DescribedFingers = None,
    trust: Switch = False,
) -> int:
    """Run the engine beside the hand, for a window in another room, until stopped (Ctrl+C).

    There `kappaskin app --source engine:HOST` opens the window on it: one at a time, with the
    settings in use here. What it changes is changed here; it sees the newest estimates as fast as
    the connection takes them. It records to a file here, which has no hole when the connection is
    cut. When the window is gone, the engine goes on as it is: it records, publishes and waits for
    the next one.

    Both ends need the same version and the same token: KAPPASKIN_TOKEN in the environment, or the
    one that is made and printed. The token is never sent, but what follows is not encrypted: from
    outside of a network that you trust, connect through a VPN, or by
    `ssh -L 9871:localhost:9871 HOST` and `engine:localhost`.

    Example: `kappaskin serve /dev/ttyACM0 --listen 0.0.0.0`

    Example: `kappaskin serve --source thumb=/dev/ttyACM0 --source index=/dev/ttyACM1 --listen ::`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, `feed:NAME`, or a port or URL for pyserial.
    sources
        The source of one finger of a hand, as NAME=SOURCE; may be given several times.
    listen
        HOST or HOST:PORT of this machine to listen at, 9871 when there is no port: 127.0.0.1 for
        this machine and ssh alone, 0.0.0.0 or :: for all that reach it.
    recordings
        Folder of what the window records; the current one when left out.
    seconds
        How long to serve; until stopped when left out.
    trust
        Let the scene name files outside its folder.
    """
    from kappaskin.live import EngineServer, Fingers, place_of
    from kappaskin.publish import TOKEN, token_of

    check_time(seconds, "serve")
    fingers = fingers_of(source, sources, sensor)
    if not recordings.is_dir():
        raise Refusal(f"{recordings}: expected a folder for recordings; make it first")
    _check_scenes(fingers, trust)
    (host, port), (token, made) = place_of(listen), token_of()
    stopped = stops()
    with (
        Fingers(fingers) as hand,
        EngineServer(hand, fingers, host, port, token, recordings, trust) as server,
    ):
        hand.connect(fingers, trust)
        begin = f"{TOKEN}={token} " if made else ""
        show(f"in the other room: {begin}kappaskin app --source {server.invitation}")
        end = time.monotonic() + seconds
        monitors = [FingerMonitor(name, each) for name, each in hand.engines.items()]
        while not stopped and time.monotonic() < end:
            server.poll(_POLL)
            hand.revive()
            for monitor in monitors:
                monitor(tares=not server.taken_over)
            while server.notices:
                show(f"kappaskin: {server.notices.pop(0)}", error=True)
    return 0


def _check_scenes(fingers: "dict[str, str]", trust: bool) -> None:
    """Raise a `Refusal` for a scene that cannot be read."""
    from kappaskin.scenes import load_scene
    from kappaskin.sources import SimulatedSource

    for source in fingers.values():
        if source.startswith(SimulatedSource.SCHEME):
            load_scene(source.removeprefix(SimulatedSource.SCHEME), trust)


def _named(finger: str, text: str) -> str:
    return f"{finger}: {text}" if finger else text


class _Watch:
    """Follows a finger: uses its saved tare, and prints what it says, each thing once."""

    def __init__(self, finger: str, engine: "Engine", alone: bool) -> None:
        self._finger, self._engine, self._alone = finger, engine, alone
        self._slope, self._noticed, self._tared = 0.0, set[str](), UsedTare(engine)
        self.status, self.given_up = engine.status(), False

    def __call__(self) -> None:
        """Read the status; a `Refusal` where there is nothing to wait for."""
        from kappaskin.estimation import slope_warning
        from kappaskin.live import LOST

        self._engine.revive()
        self.status = status = self._engine.status()
        self.given_up = self._engine.given_up or self._engine.silent > _PATIENCE
        if self.given_up and self._alone:
            raise Refusal(status.message)
        self._tared(status)
        for target in status.publishing.targets:
            if target.refusal:
                raise Refusal(target.refusal)
        notices = [
            f"{one.target}: {notice}" for one in status.publishing.targets for notice in one.notices
        ]
        notices += [f"noise: {event.text}" for event in status.events if event.kind == "noise"]
        if not self._alone and status.state == LOST:
            notices.append(status.message)
        if status.slope > _STEEPER * self._slope:
            self._slope = status.slope
            notices.append(slope_warning(self._slope))
        for text in notices:
            if text not in self._noticed:
                self._noticed.add(text)
                show(f"kappaskin: {_named(self._finger, text)}", error=True)

    @property
    def line(self) -> str:
        return _named(self._finger, _line(self.status))


def _watched(hand: "Fingers", end: float, stopped: list[int]) -> "dict[str, Status]":
    """Print a line a second of each finger until the `end`; the last statuses."""
    printed, lines, alone = time.monotonic(), list[str](), len(hand.engines) == 1
    watches = {finger: _Watch(finger, each, alone) for finger, each in hand.engines.items()}
    each = watches.values()
    while not (stopped or all(one.status.ended for one in each)) and time.monotonic() < end:
        time.sleep(_POLL)
        for one in each:
            one()
        if all(one.given_up for one in each):
            raise Refusal("; ".join(one.status.message for one in each))
        if time.monotonic() - printed >= _EVERY:
            printed, lines = time.monotonic(), [one.line for one in each]
            show(*lines, *_apart(hand))
    if (last := [one.line for one in each]) != lines:
        show(*last)
    return {finger: one.status for finger, one in watches.items()}


def _apart(hand: "Fingers") -> list[str]:
    """How far apart in time fingers can be compared, as a line; none of one finger."""
    found = hand.aligned(hand.status()) if len(hand.engines) > 1 else {}
    if len(found) < 2:
        return []
    taken = [estimate.taken for estimate in found.values()]
    sd = max(math.hypot(a.taken_sd, b.taken_sd) for a, b in combinations(found.values(), 2))
    apart = f"{1e3 * (max(taken) - min(taken)):.1f} \N{PLUS-MINUS SIGN} {1e3 * sd:.2f} ms apart"
    return [f"{len(found)} fingers on one clock: nearest scans {apart}"]


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
    text += f" ({trouble})" if trouble else ""
    if target.cue is None or math.isnan(target.cue.most):
        return text
    half, most = 1e3 * target.cue.half, 1e3 * target.cue.most
    missed = f"{target.cue.missed} not in time"
    return f"{text}, {missed}; {target.cue.state} within {half:.1f} ms, 99 % within {most:.1f} ms"


_READ = 0.1  # s


def listen(*, udp: Whole = 9870, seconds: float = math.inf, json: Switch = False) -> int:
    """Print the messages received on a UDP port of this machine, until stopped (Ctrl+C).

    Contacts (ten a second) with their standard deviations and their age when sent, haptic cues,
    every loss on the network, the state of the source, and a summary. Exit code 1 if none came.

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
