"""Cues by UDP: a thousand a second, of the newest estimate, and nothing once they are closed."""

import json
import math
import re
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from kappaskin import load_scene
from kappaskin.publish import CueGenerator, CueLimits, SourceState, UdpListener
from kappaskin.publish import cue as transport
from kappaskin.publish.cue import CUE, CueSender
from kappaskin.publish.message import LARGEST, EstimateMessage
from kappaskin.publish.publishing import target_of
from kappaskin.publish.udp import Udp

GUIDE = (files("kappaskin_resources") / "guide" / "telemanipulation.md").read_text("utf-8")
PRESSED = load_scene("off-centre")
STREAMING = SourceState("streaming", "sim", "", None, 0.0, 0.0)


def refuse(constant: str) -> float:
    raise AssertionError(f"{constant} is no JSON")


def cues(receiver: socket.socket, seconds: float) -> list[tuple[float, dict[str, object]]]:
    """The cues of a while, each with when it came."""
    found, end = [], time.monotonic() + seconds
    while (now := time.monotonic()) < end:
        receiver.settimeout(end - now + 1e-3)
        with suppress(TimeoutError):
            data = receiver.recv(9999)
            found.append((time.monotonic(), json.loads(data, parse_constant=refuse)))
    return found


@pytest.fixture
def message(messages_of) -> EstimateMessage:
    (made,) = messages_of(PRESSED)
    return made


@pytest.fixture
def sender(receiver) -> Iterator[CueSender]:
    with closing(sends_to(receiver)) as made:
        yield made
    until_ended()


def sends_to(receiver: socket.socket, query: str = "") -> CueSender:
    port = receiver.getsockname()[1]
    made = transport.opened(replace(target_of(f"cue://127.0.0.1:{port}{query}"), finger="thumb"))
    made.report(STREAMING)
    return made


def until_ended() -> None:
    for thread in threading.enumerate():
        if thread.name == "cue-sender":
            thread.join(10)


def feel(sender: CueSender, message: EstimateMessage, seconds: float) -> None:
    """Give it the estimate again and again as a new one."""
    end = time.monotonic() + seconds
    while (now := time.monotonic()) < end:
        message.estimate = replace(message.estimate, host_time=now, taken=math.nan)
        sender.send(message)
        time.sleep(5e-3)


def test_a_cue_is_what_its_table_says(sender, message: EstimateMessage) -> None:
    made = CueGenerator()
    for felt in (False, True):
        if felt:
            made.take(message.estimate)
            time.sleep(0.02)
        told = json.loads(sender.encoded(made()), parse_constant=refuse)
        head = ["kind", "version", "finger", "source", "state"]
        assert list(told) == [*head, *(number.key for number in CUE)]
        unknown = {key for key, value in told.items() if value is None}
        sds = {key for key in told if "_sd_" in key}
        assert unknown == (set() if felt else {"sequence", "age_s", "x_m", "y_m"} | sds) | {
            key for key in unknown if key.startswith("slip_") and "_sd_" in key
        }


def test_the_guide_lists_every_number_of_a_cue() -> None:
    for number in CUE:
        assert f"| `{number.key}` | {number.text} |" in GUIDE


def test_it_sends_the_newest_estimate_a_thousand_times_a_second(receiver, sender, message) -> None:
    thread = threading.Thread(target=feel, args=(sender, message, 1.2))
    thread.start()
    told = cues(receiver, 1.0)
    thread.join()
    numbers = [cue["number"] for _, cue in told]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    status = sender.cue
    assert len(told) + status.missed == pytest.approx(1000, rel=0.3)
    last = told[-1][1]
    contact, geometry = message.estimate.contact, message.estimate.geometry
    assert (last["kind"], last["version"], last["finger"]) == ("cue", 1, "thumb")
    assert (last["source"], last["state"], last["scale"]) == ("sim", "live", 1)
    assert last["force_N"] == pytest.approx(contact.force, rel=1e-4)
    assert last["x_m"] == pytest.approx(contact.position[0], rel=1e-5)
    assert [last[f"direction_{axis}"] for axis in "xyz"] == pytest.approx(
        -geometry.normal, abs=1e-6
    )
    assert last["curvature_1_per_m"] == pytest.approx(geometry.principal[0], rel=1e-4)
    assert last["timestamp"] == pytest.approx(time.time(), abs=5)
    assert 0 < status.half <= status.most < 1
    assert len(sender.encoded(CueGenerator()())) < LARGEST


def test_it_sends_nothing_to_be_felt_100_ms_after_the_last_estimate(
    receiver, sender, message
) -> None:
    thread = threading.Thread(target=feel, args=(sender, message, 0.4))
    thread.start()
    told = cues(receiver, 1.0)
    thread.join()
    last = message.estimate.host_time
    felt = [when for when, cue in told if cue["force_N"] or cue["scale"]]
    silent = [cue["age_s"] for _, cue in told if not cue["force_N"] and cue["sequence"] is not None]
    assert felt
    assert max(felt) - last < 0.1 + 0.05  # of a busy machine
    assert [cue["state"] for _, cue in told][-1] == "stale"
    assert all(cue["scale"] == 0 for when, cue in told if (cue["age_s"] or 0) > 0.09)
    assert silent


def test_a_closed_one_fades_and_says_nothing_more(receiver, message) -> None:
    sender = sends_to(receiver)
    feel(sender, message, 0.3)
    sender.close()
    told = [cue for _, cue in cues(receiver, 0.6)]
    until_ended()
    zeros = [cue["force_N"] == 0 and cue["scale"] == 0 for cue in told[-20:]]
    assert all(zeros)
    assert told[-1]["state"] == "lost"
    forces = np.array([cue["force_N"] for cue in told])
    assert np.all(np.diff(forces[np.argmax(forces) :]) <= 1e-9)  # no jump up
    receiver.settimeout(0.2)
    with pytest.raises(TimeoutError):
        receiver.recv(9999)


def test_a_force_above_the_limit_is_never_sent(receiver, message) -> None:
    with closing(sends_to(receiver, "?force=0.05")) as sender:
        thread = threading.Thread(target=feel, args=(sender, message, 0.3))
        thread.start()
        told = cues(receiver, 0.3)
        thread.join()
    until_ended()
    assert message.estimate.contact.force > 0.1
    assert max(cue["force_N"] for _, cue in told) == pytest.approx(0.05)


def test_a_busy_thread_leaves_cues_out_and_counts_them(receiver, sender, monkeypatch) -> None:
    cues(receiver, 0.05)
    was, put = sender.cue.missed, Udp.put
    monkeypatch.setattr(Udp, "put", lambda *sent: (time.sleep(0.03), put(*sent)))
    told = cues(receiver, 0.3)
    assert len(told) < 20
    assert sender.cue.missed - was > 100


def test_its_status_tells_of_the_faintest_cue_since_the_last_one(receiver, sender, message) -> None:
    feel(sender, message, 0.3)
    assert sender.cue.state  # of the beginning
    feel(sender, message, 0.05)
    assert sender.cue.state == "live"
    time.sleep(0.12)
    feel(sender, message, 0.02)
    told = sender.cue
    assert (told.state, told.scale) == ("stale", 0)


def test_listen_shows_a_cue_and_its_losses(receiver, sender, message: EstimateMessage) -> None:
    with closing(UdpListener(_free_port())) as listener:
        made = CueGenerator()
        made.take(message.estimate)
        said = dict(json.loads(sender.encoded(made())), number=7)
        (shown,) = listener.lines(said)
        assert re.search(r"s  thumb  cue       (live|late)  force 0\.\d{4} N  slip 0\.0, 0", shown)
        assert "gap       2 messages lost" in listener.lines(said | {"number": 10})[0]


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("", 0))
        return found.getsockname()[1]


@pytest.mark.parametrize(
    ("text", "limits"),
    [
        ("cue://glove:1", CueLimits()),
        ("cue://glove:1?force=0.5&rate=20", CueLimits(force=0.5, rate=20)),
        ("CUE://[::1]/?slip=0.1", CueLimits(slip=0.1)),
    ],
)
def test_a_target_names_its_limits(text: str, limits: CueLimits) -> None:
    target = target_of(text)
    assert target.limits == limits
    assert target_of(str(target)) == target
    assert target.port == (1 if ":1" in text and "::" not in text else 9871)
