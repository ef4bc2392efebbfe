"""Looking at one port: each reason why nothing comes, told apart; else how well it does."""

import itertools
import json
import os
import subprocess
import sys
import termios
import threading
from dataclasses import replace

import pytest

from kappaskin import load_scene
from kappaskin.cli import FAILED, main
from kappaskin.sources import Accounting, Diagnosis, identified_ports, information
from kappaskin.sources.wire import encode_information

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from kappaskin.sources import PseudoDevice

fcntl, pty, tty = map(pytest.importorskip, ("fcntl", "pty", "tty"))

SCENE = replace(load_scene("centre"), rate=100.0)
TEXT = information.sensor_to_json(SCENE.sensor())


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    monkeypatch.setattr("kappaskin.sources.diagnosis._LISTEN", 1.0)


@pytest.fixture
def hasty(monkeypatch):
    monkeypatch.setattr("kappaskin.sources.serial_source._PATIENCE", 0.9)
    monkeypatch.setattr("kappaskin.sources.diagnosis._SEARCH", 1.2)


@pytest.fixture
def served():
    """The port of a simulated device, once it serves."""
    device, stop = PseudoDevice(SCENE), threading.Event()
    thread = threading.Thread(target=device.serve, args=(stop.is_set,))
    thread.start()
    yield device.port
    stop.set()
    thread.join()
    device.close()


@pytest.fixture
def saying():
    """A port on which `data` of 0, 1, 2, ... come one after the other."""
    stop, threads, masters = threading.Event(), [], []

    def say(data):
        master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        masters.extend([master, slave])

        def talk():
            for number in itertools.count():
                if stop.wait(0.05):
                    return
                os.write(master, data(number))

        threads.append(threading.Thread(target=talk))
        threads[-1].start()
        return os.ttyname(slave)

    yield say
    stop.set()
    for thread in threads:
        thread.join()
    for descriptor in masters:
        os.close(descriptor)


def test_a_device_that_is_well_is_told_of_whole(served):
    found = Diagnosis.of(served)
    assert found.why == ""
    assert (found.port, found.plug) == (served, served)
    assert found.device == "Simulated skin SIM-0001, firmware kappaskin simulator"
    assert found.rate == pytest.approx(100.0, rel=1e-6)
    assert found.said_rate == 100.0
    assert 0 < found.clock_sd < 0.1
    assert found.accounting.balanced
    assert found.accounting.accepted > 10  # of a hundred, where the machine does nothing else
    assert [event.kind for event in found.events] == ["met"]


@pytest.mark.full
def test_looking_twice_finds_the_same(served):
    first, second = Diagnosis.of(served), Diagnosis.of(served)
    assert (first.device, first.why) == (second.device, second.why)
    assert second.clock_sd < 0.1


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (lambda _: b"", "silent for more than 0.9 s"),
        (lambda _: b"$GPGGA,123519,4807.038,N\r\n", "no message of wire version 1"),
        (
            lambda n: b"\x4b\xa7\x07" + encode_information(n, 0.0, TEXT)[3:],
            "no message of wire version 1",
        ),
    ],
    ids=["silent", "another protocol", "a spoilt header"],
)
def test_what_is_no_device_is_told(saying, data, why, hasty):
    found = Diagnosis.of(saying(data))
    assert why in found.why


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (TEXT, "sends its description but no readings"),
        ('{"name": "Half"}', "the device's information cannot be used: expected serial_number = a"),
    ],
    ids=["no readings", "half an information"],
)
def test_what_is_wrong_with_a_device_is_told(saying, text, why):
    found = Diagnosis.of(saying(lambda n: encode_information(n, n / 20, text)))
    assert why in found.why


def test_an_absent_port_is_told_and_the_command_fails(capsys):
    assert main(["doctor", "/dev/ttyABSENT7"]) == FAILED
    text, errors = capsys.readouterr()
    assert "port                /dev/ttyABSENT7\n" in text
    assert "verdict             /dev/ttyABSENT7: there is no such port" in text
    assert errors == ""


def test_a_busy_port_is_told(served):
    with open(served, "rb+", buffering=0) as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert "busy" in Diagnosis.of(served).why


@pytest.mark.full
def test_the_command_says_in_words_and_in_json_that_a_port_is_well(served, capsys):
    assert main(["doctor", served]) == 0
    words = capsys.readouterr().out
    assert "device              Simulated skin SIM-0001, firmware kappaskin simulator\n" in words
    assert "rate                100.0 frames/s of 100 nominal\n" in words
    assert "clock               known to " in words
    assert "losses              0 of " in words
    assert words.endswith("verdict             well\n")
    assert main(["doctor", served, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["well"], found["why"], found["said_rate"]) == (True, "", 100.0)
    assert found["temperature"] is None
    assert found["accounting"]["lost"] == 0


def test_losses_are_told_in_words():
    assert Accounting().words == "0 of 0 messages lost"
    many = Accounting(
        bytes_in=40_000, discarded=(("checksum", 120), ("overrun", 0)), lost=12, span=30_210
    )
    told = "12 of 30,210 messages lost; 0.3 % of bytes discarded: checksum 120"
    assert many.words == told
    assert replace(many, restarts=1).words == f"{told}; the device restarted once"
    assert replace(many, restarts=2).words == f"{told}; the device restarted 2 times"
    assert "100 % of bytes" in replace(many, bytes_in=120).words
    assert "under 0.001 % of bytes" in replace(many, bytes_in=10**9).words


@pytest.fixture
def brief(monkeypatch):
    monkeypatch.setattr("kappaskin.sources.diagnosis._SILENCE", 2.0)
    monkeypatch.setattr("kappaskin.sources.diagnosis._SEARCH", 4.0)


def numbers(number):
    return f"{number}, 2.5, -3\n".encode()


def test_each_port_is_identified_by_what_it_sends(brief, served, saying):
    sent = {
        saying(numbers): "sends numbers: 3 columns, ",
        saying(lambda n: b'{"a": [1, %d], "b": 3}\n' % n): "sends JSON: 3 numbers, ",
        saying(lambda _: b""): "silent",
        saying(lambda _: b"ready\n"): "sends text, no rows of numbers",
        saying(lambda _: bytes(range(128, 256))): "sends binary data",
        saying(lambda n: b"7\n" * (n % 40 == 39)): "sends too little to identify",
        saying(lambda _: encode_information(0, 0.0, "{}")): "Kappaskin device, with an invalid",
        served: "Kappaskin device: Simulated skin (SIM-0001), 300 channels",
        "/dev/ttyABSENT7": "there is no such port",
    }
    found = dict(identified_ports(list(sent)))
    assert {url: text[: len(sent[url])] for url, text in found.items()} == sent


@pytest.fixture
def ends():
    """Descriptors that are closed after the threads of `saying`, set up later, have ended."""
    opened = []
    yield opened
    for descriptor in opened:
        os.close(descriptor)


def test_a_board_is_identified_at_its_baud_rate(ends, saying):
    def at_9600(number):
        here = termios.tcgetattr(ends[0])[5] == termios.B9600 if ends else False
        return numbers(number) if here else bytes(range(128, 256))

    url = saying(at_9600)
    ends.append(os.open(url, os.O_RDWR | os.O_NOCTTY))
    text = dict(identified_ports([url]))[url]
    assert text.startswith("sends numbers: 3 columns")


def test_nothing_is_sent_to_a_port_that_is_identified(brief):
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    assert dict(identified_ports([os.ttyname(slave)])) == {os.ttyname(slave): "silent"}
    with pytest.raises(BlockingIOError):
        os.read(master, 1)
    os.close(master)
    os.close(slave)


@pytest.mark.slow
def test_a_port_of_another_program_is_not_opened(saying, monkeypatch):
    url, opened = saying(numbers), []
    monkeypatch.setattr("kappaskin.sources.diagnosis.SerialConnection", opened.append)
    held = "import sys; port = open(sys.argv[1], 'rb'); print(flush=True); input()"
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", held, url], stdin=pipe, stdout=pipe) as other:
        assert other.stdout is not None
        other.stdout.readline()
        text = dict(identified_ports([url]))[url]
        other.communicate(b"\n")
    assert (opened, text) == ([], f"in use by python (process {other.pid})")


def test_identification_that_is_stopped_closes_the_ports(served):
    stopped = threading.Event()
    found = identified_ports(["/dev/ttyABSENT7", served], stopped.is_set)
    assert [url for url, _ in (next(found), next(found))] == ["/dev/ttyABSENT7", served]
    stopped.set()
    assert list(found) == [(served, "")]
    assert Diagnosis.of(served).why == ""
