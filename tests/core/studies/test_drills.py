"""Every fault drill in its short version, and what inflicts and judges the faults."""

import json
import math
import os
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pty", reason="no pseudo-terminals on this system")

from kappaskin import Frame, SourceError, load_scene
from kappaskin.cli import main
from kappaskin.sources import BAUD_RATES, information
from kappaskin.sources.wire import Fault, Information, Operation, Reply, Samples
from kappaskin.studies import drills_text, run_drills
from kappaskin.studies.drills import DRILLS, row_of
from kappaskin.studies.drills.line import DEVICE_DRILLS as OF_DEVICES
from kappaskin.studies.drills.line import (
    ClockShift,
    CutScans,
    FlippedBits,
    Garbage,
    InformationChange,
    received_at,
    without_information,
)
from kappaskin.studies.drills.stand import (
    Device,
    Drill,
    DrillOutcome,
    ProcessResources,
    Stand,
    judged,
    opened,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def device() -> Iterator[Device]:
    with opened(None, 1) as simulated:
        yield simulated


@pytest.fixture
def stand(device) -> Iterator[Stand]:
    made = Stand(device, long=False)
    yield made
    made.close()


@pytest.fixture(scope="module")
def table() -> Iterator[list[dict]]:
    """What the drills came to; printed at the end."""
    rows: list[dict] = []
    yield rows
    print("\n" + drills_text(rows))


@pytest.mark.cases(
    "garbage-5-%",
    "bits",
    "cuts",
    "baud-rate-too-low",
    "stall",
    "not-read",
    "deaf",
    "twice",
    "restart",
    "other-device",
    "unplug",
    "device-clock",
    "engine-killed",
    "disk-full",
    "recording,-slow-disk",
)
@pytest.mark.parametrize("drill", DRILLS, ids=lambda drill: drill.name.replace(" ", "-"))
def test_the_drill_is_held(drill, device, table) -> None:
    row = row_of(drill, device)
    table.append(row)
    assert (row["verdict"], row["reasons"]) == ("held", [])
    assert row["wrong"] == 0
    if drill.within < math.inf:
        assert row["recovered_s"] <= drill.within


def test_no_two_drills_have_one_name() -> None:
    assert len({drill.name for drill in DRILLS}) == len(DRILLS) > 20


# That the judge can find something


def test_a_frame_that_was_never_sent_so_is_found(stand) -> None:
    stand.settle()

    def other(data: bytes) -> bytes:
        stand.relay.sent[stand.relay.sequence - 1] = np.zeros(300, np.int32)
        return data

    stand.relay.spoil = other
    stand.until(lambda: stand.wrong > 10, 30.0)
    outcome = stand.outcome()
    assert outcome.wrong > 10
    assert f"{outcome.wrong} wrong frames were accepted" in judged(outcome, math.inf)


@pytest.mark.full
def test_a_byte_that_is_nowhere_counted_is_found(stand) -> None:
    stand.settle()
    stand.relay.written += 1
    stand.relay.sequence += 1
    failures = stand.outcome().failures
    assert [failure.split(" were sent")[0].split()[1] for failure in failures] == [
        "bytes",
        "messages",
    ]


def test_a_line_that_does_not_recover_is_found(stand) -> None:
    stand.settle()
    stand.relay.spoil = lambda data: b""
    stand.recover(0.1)
    assert judged(DrillOutcome(recovered=stand.recovered), 0.1) == [
        "did not recover within 0.1 s; not at all"
    ]
    assert judged(DrillOutcome(recovered=2.0), 1.0) == [
        "did not recover within 1 s; not for 2.00 s"
    ]


@pytest.mark.full
def test_reads_that_take_long_again_and_again_are_found_and_one_is_not(stand, monkeypatch) -> None:
    stand.settle()
    read, naps = stand.source.read, [0.5]

    def slow(timeout: float) -> list[Frame]:
        if naps:
            time.sleep(naps.pop())
        return read(timeout)

    monkeypatch.setattr(stand.source, "read", slow)
    assert stand.longest_read(0.6) < 0.5
    naps.extend(3 * [0.5])
    assert stand.longest_read(0.6) >= 0.5


def test_what_leaks_is_found() -> None:
    before = ProcessResources.now()
    ends = os.pipe()
    grown = replace(ProcessResources.now(), memory=before.memory + 2**21)
    failures = [text for holds, text in grown.leaked(before, 2**20) if not holds]
    for end in ends:
        os.close(end)
    assert failures == ["2 descriptors leaked", "memory grew by 2.0 MiB"]


def test_a_users_own_device_is_drilled_but_not_stopped(device) -> None:
    own = replace(device, process=None)
    suspend = next(drill for drill in OF_DEVICES if drill.name == "suspend")
    row = row_of(suspend, own)
    assert (row["verdict"], row["reasons"]) == ("skipped", ["needs the simulated device"])


def test_a_drill_that_cannot_be_done_fails_with_the_reason(device) -> None:
    def refused(stand: Stand) -> DrillOutcome:
        raise SourceError("no frames come")

    row = row_of(Drill("none", "nothing", refused), device)
    assert (row["verdict"], row["reasons"]) == ("failed", ["no frames come"])
    assert "no frames come" in drills_text([row])
    assert "1 drills, 1 failed" in drills_text([row])


# The command


@pytest.mark.full
def test_the_command_prints_rows_and_fails_with_them(monkeypatch, capsys) -> None:
    rows = [row | {"verdict": "failed"} for row in run_drills(chosen=())] or [
        {
            "drill": "bits", "sent": 5, "accepted": 4, "lost": 1, "discarded": 9, "wrong": 0,
            "recovered_s": None, "verdict": "failed", "reasons": ["why"],
        }
    ]  # fmt: skip
    monkeypatch.setattr("kappaskin.studies.run_drills", lambda *_: rows)
    assert main(["drill"]) == 1
    assert "1 drills, 1 failed" in capsys.readouterr().out
    assert main(["drill", "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == rows


def test_a_port_that_is_not_there_is_refused(capsys) -> None:
    assert main(["drill", "/dev/there-is-none"]) == 2
    assert "no such port" in capsys.readouterr().err


# What inflicts the faults

MESSAGE = bytes(range(256)) * 4


@pytest.mark.parametrize("rate", BAUD_RATES)
def test_a_uart_at_the_senders_rate_hears_what_was_sent(rate) -> None:
    assert received_at(MESSAGE, rate, rate) == MESSAGE


def test_a_uart_bears_a_rate_that_is_three_percent_off_and_no_more() -> None:
    # Nine and a half bits drift by half of one: at 5.3 %.
    assert received_at(MESSAGE, 1e6, 1.03e6) == received_at(MESSAGE, 1e6, 0.97e6) == MESSAGE
    assert received_at(MESSAGE, 1e6, 1.08e6) != MESSAGE
    assert received_at(MESSAGE, 1e6, 0.92e6) != MESSAGE


def test_half_the_rate_hears_every_other_bit() -> None:
    # On the line 0xAA is 0 0101 0101 1, the start bit first. A receiver of half the rate samples
    # levels 3, 5, 7 and 9 of these, counted from 0, and then the silence.
    assert received_at(b"\xaa", 2.0, 1.0) == bytes([0b11111000])
    # Read twice as fast, it is heard as 0 0 1 1 0 0 1 1 0 0 and so on, the first 0 as a start bit.
    assert received_at(b"\x55", 1.0, 2.0)[0] == 0b01100110


def test_garbage_takes_about_its_share() -> None:
    spoil, sent = Garbage(0.05, np.random.default_rng(0)), bytes(626)
    noise = sum(len(data) - data.count(0) for data in (spoil(sent) for _ in range(2000)))
    assert noise / (2000 * 626) == pytest.approx(0.05, rel=0.1)


def test_as_many_bits_turn_over_as_are_said_to() -> None:
    spoil = FlippedBits(1000, np.random.default_rng(0))
    flips = sum(int.from_bytes(spoil(bytes(500))).bit_count() for _ in range(500))
    assert flips == pytest.approx(500 * 500 * 8 / 1000, rel=0.1)


def test_scans_are_cut_at_every_byte() -> None:
    cut, scan = CutScans(), b"\x4b\xa7\x01\x02" + bytes(20)
    assert [len(cut(scan)) for _ in range(2 * 24)] == [n for k in range(24) for n in (k, 24)]
    assert cut(b"\x4b\xa7\x01\x01") == b"\x4b\xa7\x01\x01"


def test_a_clock_that_is_ahead_is_so_in_pings_too() -> None:
    pong = Reply(1, 2.0, 7, Operation.PING, Fault.NONE, (2_000_000).to_bytes(8, "little") + b"\0\0")
    [later] = ClockShift(3.0)(pong)
    assert later.time == 5.0
    assert int.from_bytes(later.data[:8], "little") == 5_000_000
    assert ClockShift(-3.0)(pong)[0].time == 0.0


def test_another_number_is_said_in_information_only() -> None:
    text = information.sensor_to_json(load_scene("centre").sensor())
    [said] = InformationChange("serial_number", "other")(Information(0, 0.0, text))
    assert information.sensor_from_json(said.text).serial_number == "other"
    scan = Samples(1, 0.0, np.arange(3), np.zeros(3, np.int32))
    assert InformationChange("serial_number", "other")(scan) == without_information(scan) == [scan]
    assert without_information(said) == []
