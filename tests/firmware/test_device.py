"""The device's loop on a board of numbers, in its own time: exact, and open to any input."""

import json
import random
import runpy
import struct
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from kappaskin.sources import sensor_from_json

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "resources" / "kappaskin_resources" / "firmware"
VECTORS = json.loads((FIRMWARE.parent / "wire" / "vectors.json").read_text("utf-8"))
READ = runpy.run_path(str(HERE / "reader.py"))["read"]
MESSAGE = runpy.run_path(str(HERE / "make_vectors.py"))["message"]
INFORMATION, SAMPLES, COMMAND, REPLY = 1, 2, 3, 4
COMMAND_ROOM = 1048
PLENTY = 10**9


@dataclass(frozen=True)
class Outcome:
    """What a device sent, and what it counted."""

    messages: list[bytes]
    spent: int
    sent: int
    scans: int
    rate: int
    lights: int
    ns: int
    waiting: int
    scanning: int

    def of(self, kind: int) -> list[bytes]:
        return [message for message in self.messages if message[3] == kind]

    def times(self, kind: int) -> list[int]:
        return [struct.unpack_from("<Q", message, 12)[0] for message in self.of(kind)]

    @property
    def sequences(self) -> list[int]:
        return [struct.unpack_from("<I", message, 8)[0] for message in self.messages]

    @property
    def replies(self) -> list[tuple[int, int, int, bytes]]:
        """Of each the command's number, its operation, the status and the data."""
        return [(*struct.unpack_from("<IBB", m, 22), m[28:-4]) for m in self.of(REPLY)]


Run = Callable[..., Outcome]


@pytest.fixture(scope="module")
def driver(compiled) -> Path:
    files = (HERE / "device_driver.c", *FIRMWARE.glob("kappaskin_*.c"))
    return compiled("device_driver", *files, watched=True)


@pytest.fixture
def run(driver: Path) -> Run:
    """Lets a device run for some polls, hearing `commands`."""

    def outcome(
        commands: bytes = b"",
        polls: int = 100,
        channels: int = 8,
        count_bytes: int = 2,
        channel_time: int = 10_000,
        outbox: int = 2**22,
        taken: int = PLENTY,
        ticks: int = 0,
    ) -> Outcome:
        numbers = (channels, count_bytes, channel_time, outbox, taken, ticks, polls)
        command = [str(driver), "run", *map(str, numbers)]
        told = subprocess.run(command, input=commands, capture_output=True, check=False)
        assert told.returncode == 0, told.stderr.decode()
        messages, waiting = READ(told.stdout)
        counted = json.loads(told.stderr)
        assert sum(map(len, messages)) + waiting == len(told.stdout), "it sent something else"
        assert len(messages) == counted["sent"]
        return Outcome(messages, **counted)

    return outcome


def asked(*commands: bytes) -> bytes:
    return b"".join(MESSAGE(COMMAND, command, n, 0) for n, command in enumerate(commands))


def listed(*runs: tuple[int, int]) -> bytes:
    return b"\4" + bytes([len(runs)]) + b"".join(struct.pack("<HH", *run) for run in runs)


def rated(rate: int) -> bytes:
    return b"\5" + struct.pack("<I", rate)


# Frames


def test_frames_hold_what_the_channels_read(run: Run) -> None:
    frame = run(channels=5).of(SAMPLES)[0]
    wide = run(channels=5, count_bytes=4).of(SAMPLES)[0]

    assert frame[22:-4] == struct.pack("<BBHH5h", 2, 1, 0, 5, 1, -1, -3, -5, -7)
    assert wide[22:-4] == struct.pack("<BBHH5i", 4, 1, 0, 5, 1, -1, -3, -5, -7)


@pytest.mark.parametrize("asked_for", [1_000_000, 333_333, 7_000_000, 7000])
def test_frames_come_at_the_rate_to_a_part_of_ten_thousand(run: Run, asked_for: int) -> None:
    told = run(asked(rated(asked_for)), polls=100_000)

    times = told.times(SAMPLES)[1:]
    rate = (len(times) - 1) / (times[-1] - times[0]) * 1e9

    assert told.rate == asked_for
    assert rate == pytest.approx(asked_for, rel=max(1e-4, 30 / (times[-1] - times[0])))


def test_the_counter_of_the_board_may_begin_again(run: Run) -> None:
    slow = asked(rated(100_000))

    plain, wrapped = (run(slow, polls=20_000, ticks=ticks) for ticks in (0, 2**32 - 50_000))

    assert wrapped.times(SAMPLES) == plain.times(SAMPLES)
    assert max(plain.times(SAMPLES)) > 150_000


def test_information_comes_first_and_every_half_second(run: Run) -> None:
    told = run(asked(rated(100_000)), polls=150_000)

    times = told.times(INFORMATION)
    assert [message[3] for message in told.messages[:3]] == [REPLY, INFORMATION, SAMPLES]
    assert all(later - earlier <= 500_100 for earlier, later in pairwise(times))
    assert told.times(SAMPLES)[-1] - times[-1] < 500_100


def test_a_long_scan_lets_commands_through(run: Run) -> None:
    # A scan of 3000 channels takes 30 ms: the answer must not wait for its end.
    told = run(asked(b"\10"), polls=200, channels=3000)

    assert told.times(REPLY)[0] < 400
    assert told.messages[0][3] == REPLY


# What does not fit


@pytest.mark.parametrize("taken", [1, 7, 200])
def test_a_slow_line_loses_whole_messages_and_says_so(run: Run, taken: int) -> None:
    told = run(polls=30_000, outbox=3000, taken=taken, channels=40, channel_time=1000)

    sequences = told.sequences
    assert sequences == sorted(set(sequences))
    lost = sequences[-1] + 1 - len(sequences)
    assert (lost > 0) == (taken < 200)
    assert told.spent - told.sent >= lost
    assert len(told.messages) > 20


def test_nobody_who_reads_costs_nothing_but_numbers(run: Run) -> None:
    told = run(polls=20_000, outbox=2000, taken=0)

    assert told.messages == []
    assert told.spent > 1000
    assert told.waiting <= 2000


# Commands


def test_every_command_of_the_vectors_is_answered(run: Run) -> None:
    commands = [vector for vector in VECTORS["good"] if vector["kind"] == "command"]

    told = run(bytes.fromhex("".join(vector["hex"] for vector in commands)), channels=300)

    statuses = {operation: status for _, operation, status, _ in told.replies}
    assert [sequence for sequence, *_ in told.replies] == [v["sequence"] for v in commands]
    assert statuses == dict.fromkeys(range(1, 9), 0) | {200: 1}


def replied(run: Run, *commands: bytes, **setup: int) -> list[tuple[int, bytes]]:
    told = run(asked(*commands), **setup)
    assert [number for number, *_ in told.replies] == list(range(len(commands)))
    return [(status, data) for _, _, status, data in told.replies]


def test_versions_are_agreed_on(run: Run) -> None:
    one, many, newer, none, crossed = replied(
        run, b"\1\1\1", b"\1\0\377", b"\1\2\5", b"\1\0\0", b"\1\5\2"
    )

    assert one == many == (0, b"\1")
    assert newer == none == crossed == (4, b"this device speaks version 1")


@pytest.mark.parametrize("operation", range(1, 9))
def test_arguments_of_a_wrong_length_are_refused_with_what_was_expected(run, operation) -> None:
    right = {1: 2, 2: 0, 3: 0, 4: 1, 5: 4, 6: 4, 7: 0, 8: 0}[operation]
    wrong = [
        n for n in (0, 1, 2, 3, 4, 5, 9, 1000) if n != right and not (operation == 4 and n == 1)
    ]

    for status, reason in replied(run, *(bytes([operation]) + bytes(n) for n in wrong)):
        assert status == 2
        assert reason.startswith(b"expected")


@pytest.mark.parametrize("operation", [0, 9, 10, 128, 255])
def test_an_operation_that_it_does_not_have_is_refused(run: Run, operation: int) -> None:
    ((status, reason),) = replied(run, bytes([operation]))

    assert (status, reason) == (1, b"expected an operation from 1 to 8")


def test_it_scans_what_is_listed_in_that_order(run: Run) -> None:
    frames = run(asked(listed((6, 2), (0, 1)))).of(SAMPLES)

    assert {frame[22:-4] for frame in frames} == {
        struct.pack("<BBHHHH3h", 2, 2, 6, 2, 0, 1, -11, -13, 1)
    }


def test_no_runs_are_all_channels(run: Run) -> None:
    frames = run(asked(listed((6, 2)), listed())).of(SAMPLES)

    assert {len(frame) for frame in frames} == {26 + 6 + 16}


@pytest.mark.parametrize(
    "runs",
    [
        [(0, 0)],
        [(8, 1)],
        [(7, 2)],
        [(65535, 65535)],
        [(0, 2), (1, 1)],
        [(3, 1), (0, 8)],
        [(5, 1), (5, 1)],
    ],
)
def test_a_list_that_makes_no_sense_is_refused_and_changes_nothing(run: Run, runs) -> None:
    told = run(asked(listed((2, 3)), listed(*runs)))

    assert told.replies[1][2] == 3
    assert {frame[22:-4][:6] for frame in told.of(SAMPLES)} == {struct.pack("<BBHH", 2, 1, 2, 3)}


def test_the_longest_list_is_taken(run: Run) -> None:
    runs = [(2 * n, 1) for n in range(255)]
    told = run(asked(listed(*runs)), channels=600, polls=1000)

    assert told.replies[0][2] == 0
    assert told.of(SAMPLES)[-1][22:-4] == (
        b"\2" + listed(*runs)[1:] + b"".join(struct.pack("<h", 1 - 4 * n) for n in range(255))
    )


def test_a_rate_is_bounded_by_the_channels_listed(run: Run) -> None:
    # 8 channels of 10 us are 12,500 frames/s, 2 are 50,000.
    highest, more, none, fewer, faster, all_again = replied(
        run, rated(12_500_000), rated(12_500_001), rated(0),
        listed((0, 2)), rated(50_000_000), listed(),
    )  # fmt: skip

    assert highest == (0, struct.pack("<I", 12_500_000))
    assert more[0] == none[0] == 3
    assert b"12500 frames/s" in more[1]
    assert fewer[0] == all_again[0] == 0
    assert faster == (0, struct.pack("<I", 50_000_000))
    assert run(asked(listed((0, 2)), rated(50_000_000), listed())).rate == 12_500_000


def test_a_gain_is_told_before_the_first_frame_that_has_it(run: Run) -> None:
    told = run(asked(b"\6" + struct.pack("<I", 10_000)))

    kinds = [message[3] for message in told.messages]
    assert kinds[:2] == [REPLY, INFORMATION]
    assert told.replies[0][2:] == (0, struct.pack("<I", 10_000))
    assert json.loads(told.of(INFORMATION)[0][22:-4])["amplifier"]["gain"] == 10


@pytest.mark.parametrize(
    "command", [b"\6" + struct.pack("<I", 10_000), listed((0, 5)), rated(20_000), b"\3"]
)
def test_a_frame_that_a_command_overtakes_is_not_sent(run: Run, command: bytes) -> None:
    # A scan of 3000 channels takes 30 ms; this much garbage is read in the first 6 of them.
    told = run(bytes(20 * 256) + asked(command), polls=400, channels=3000)

    (answered,) = told.times(REPLY)
    assert 5000 < answered < 30_000
    assert all(began >= answered for began in told.times(SAMPLES))
    assert (told.of(SAMPLES) == []) == (command == b"\3")
    assert not (command == b"\3" and told.scanning)


def test_a_gain_that_the_amplifier_lacks_is_refused(run: Run) -> None:
    told = run(asked(b"\6" + struct.pack("<I", 10_001)))

    assert told.replies[0][2] == 3
    assert json.loads(told.of(INFORMATION)[0][22:-4])["amplifier"]["gain"] == 100


def test_a_stopped_device_sends_no_frames_until_started(run: Run) -> None:
    stopped = run(asked(b"\3"), polls=100_000)
    started = run(asked(b"\3", b"\2"), polls=1000)

    assert stopped.of(SAMPLES) == []
    assert len(stopped.of(INFORMATION)) == 2
    assert len(started.of(SAMPLES)) > 100


def test_a_light_shows_it_for_two_seconds(run: Run) -> None:
    short = run(asked(b"\3", b"\7"), polls=199_000)
    long = run(asked(b"\3", b"\7"), polls=201_000)

    assert short.lights == 0b1
    assert long.lights == 0b10
    assert [message[3] for message in short.messages[:3]] == [REPLY, REPLY, INFORMATION]


def test_a_ping_brings_the_time_it_came_and_no_temperature_where_there_is_none(run: Run) -> None:
    ((status, data),) = replied(run, b"\10")

    assert status == 0
    assert struct.unpack("<Qh", data) == (10, -(2**15))


def test_what_is_no_command_is_not_answered(run: Run) -> None:
    broken = bytearray(asked(b"\10"))
    broken[-1] ^= 1
    others = [MESSAGE(kind, b"\10", 1, 2) for kind in (1, 2, 4, 9)]

    told = run(bytes(broken) + b"".join(others) + MESSAGE(COMMAND, b"", 1, 2) + bytes(20))

    assert told.of(REPLY) == []


def test_any_input_gets_an_answer_to_each_command_in_it_and_to_nothing_else(run: Run) -> None:
    source = random.Random(4)
    commands = [bytes.fromhex(v["hex"]) for v in VECTORS["good"] if v["kind"] == "command"]
    made = bytearray()
    while len(made) < 1_000_000:
        command = bytearray(source.choice(commands))
        match source.randrange(5):
            case 0:
                command[source.randrange(len(command))] ^= 1 << source.randrange(8)
            case 1:
                del command[source.randrange(len(command)) :]
            case 2:
                made += source.randbytes(source.randrange(200))
            case 3:
                operation, arguments = source.randrange(256), source.randbytes(source.randrange(40))
                command[:] = MESSAGE(COMMAND, bytes([operation]) + arguments, len(made), 5)
            case _:
                pass
        made += command

    told = run(bytes(made), polls=len(made) // 256 + 100, channels=300)

    valid = [m for m in READ(bytes(made), COMMAND_ROOM)[0] if m[3] == COMMAND and len(m) > 26]
    assert len(valid) > 10_000
    assert [(number, operation) for number, operation, *_ in told.replies] == [
        (struct.unpack_from("<I", message, 8)[0], message[22]) for message in valid
    ]
    assert told.spent == told.sent


def test_the_longest_reason_fits_a_reply(run: Run) -> None:
    reasons = [
        data for status, data in replied(run, *(bytes([n]) * 9 for n in range(256))) if status
    ]

    assert max(map(len, reasons)) <= 200


# The setup


@pytest.mark.parametrize(
    ("setup", "expected"),
    [
        ({"channels": 0}, "a channel at least"),
        ({"channel_time": 0}, "a channel at least"),
        ({"count_bytes": 3}, "2 or 4 bytes"),
        ({"outbox": 1000}, "an outbox that holds"),
        ({"channels": 65535, "count_bytes": 4}, "no more than a message may have"),
    ],
)
def test_a_setup_that_cannot_work_is_refused(driver: Path, setup, expected) -> None:
    numbers = {"channels": 8, "count_bytes": 2, "channel_time": 10_000, "outbox": 9999} | setup
    command = [str(driver), "run", *map(str, numbers.values()), "1", "0", "1"]
    told = subprocess.run(command, input=b"", capture_output=True, text=False, check=False)

    assert told.returncode == 2
    assert expected in told.stderr.decode()


def test_the_reference_board_is_one_that_the_library_understands() -> None:
    sensor = sensor_from_json((FIRMWARE / "device.json").read_text("utf-8"))

    assert sensor.channels == 300
    assert sensor.layout.shape == (10, 10)
    assert sensor.transduction.scan_time(300) == pytest.approx(3e-3)
    assert sensor.rate == pytest.approx(1000 / 3, abs=1e-3)


def test_the_header_is_made_from_the_json() -> None:
    header = runpy.run_path(str(FIRMWARE / "embed.py"))["header"]

    made = header((FIRMWARE / "device.json").read_text("utf-8"))

    assert (FIRMWARE / "device_json.h").read_text("utf-8") == made


# Numbers and text


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0, "0"), (1, "0.001"), (10, "0.01"), (123, "0.123"), (1000, "1"), (1001, "1.001"),
        (10_000, "10"), (166_666, "166.666"), (123_450, "123.45"), (2**32 - 1, "4294967.295"),
    ],
)  # fmt: skip
def test_thousandths_are_written_as_json_has_numbers(driver: Path, value, expected) -> None:
    told = subprocess.run([driver, "thousandths", str(value)], capture_output=True, check=True)

    assert told.stdout.decode().strip() == expected


@pytest.mark.parametrize(
    ("text", "key", "value", "expected"),
    [
        ('{"rate":1,"a":2}', "rate", "33.5", '{"rate":33.5,"a":2}'),
        ('{"a":2,"rate" : 100.25 }', "rate", "1", '{"a":2,"rate" : 1 }'),
        ('{"gain":{"rate":7}}', "rate", "8", '{"gain":{"rate":8}}'),
        ('{"a":"rate","rate":7}', "rate", "8", '{"a":"rate","rate":8}'),
        (r'{"a":"\"rate\":5","rate":7}', "rate", "8", r'{"a":"\"rate\":5","rate":8}'),
        (r'{"rate":"say \"x\", so","b":1}', "rate", '"y"', '{"rate":"y","b":1}'),
        ('{"grid":[10, 10],"b":1}', "grid", "[2,3]", '{"grid":[2,3],"b":1}'),
        ('{"rate":null}', "rate", "8", '{"rate":8}'),
    ],
)
def test_a_value_is_put_in_the_place_of_another(driver: Path, text, key, value, expected) -> None:
    command = [driver, "set", key, value, "40"]
    told = subprocess.run(command, input=text.encode(), capture_output=True, check=False)

    assert told.returncode == 0
    assert told.stdout.decode() == expected
    json.loads(expected)


@pytest.mark.parametrize(
    ("text", "room"),
    [
        ('{"rates":1}', 40), ('{"a":"rate"}', 40), ("", 40), ("{", 40), ('{"rate', 40),
        ('"rate"', 40), ('{"rate":1}', 14), ('{"rate":"1', 14), ('"rate":"\\', 13),
    ],
)  # fmt: skip
def test_a_text_without_the_key_or_the_room_stays_as_it_is(driver: Path, text, room) -> None:
    command = [driver, "set", "rate", "12345.6", str(room)]
    told = subprocess.run(command, input=text.encode(), capture_output=True, check=False)

    assert told.returncode == 2
    assert told.stdout.decode() == text
