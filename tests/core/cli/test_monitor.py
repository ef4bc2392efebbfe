"""What the monitor says of what comes over a line."""

import os
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from kappaskin import SourceError, load_scene
from kappaskin.cli import main
from kappaskin.sources import WireMonitor, information
from kappaskin.sources.wire import Command, Fault, encode_information, encode_reply, encode_samples

tty = pytest.importorskip("tty", reason="no pseudo-terminals on this system")

SENSOR = load_scene("centre").sensor()
INFORMATION = encode_information(0, 0.5, information.sensor_to_json(SENSOR))


def scan(sequence: int) -> bytes:
    counts = np.arange(300, dtype=np.int32) - 20
    return encode_samples(sequence, sequence / 100, np.arange(300), counts, 2)


class Device:
    """The other end of a pseudo-terminal; time passes for the monitor when it is told to."""

    def __init__(self) -> None:
        self._now, self._sent = 100.0, 0
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self.monitor = WireMonitor(self.port, lambda: self._now)
        os.close(slave)

    def says(self, data: bytes) -> str:
        """What is told of `data`."""
        self._write(data)
        self._sent += len(data)
        return self._text(lambda: self.monitor.accounting().bytes_in == self._sent)

    def _write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._master, data[:2048]) :]

    def _text(self, holds: Callable[[], bool]) -> str:
        end, said = time.monotonic() + 30.0, list[str]()
        while not holds():
            assert time.monotonic() < end, said
            said += self.monitor.read(0.02)
        return "\n".join(said)

    def later(self, seconds: float) -> str:
        """What is told when nothing came for so long."""
        self._now += seconds
        return "\n".join(self.monitor.read(0.0))

    def unplugged(self) -> str:
        """What is told when it is gone."""
        self.unplug()
        return self._text(lambda: self.monitor.lost)

    def unplug(self) -> None:
        if self._master >= 0:
            os.close(self._master)
        self._master = -1


@pytest.fixture
def device() -> Iterator[Device]:
    made = Device()
    yield made
    made.monitor.close()
    made.unplug()


def test_a_device_is_told_with_its_name_and_number(device) -> None:
    text = device.says(INFORMATION)
    assert "information  #0  at 0.500000 s" in text
    assert SENSOR.name in text
    assert f"serial number {SENSOR.serial_number}" in text
    assert "300 channels" in text


def test_information_that_cannot_be_used_is_told_with_the_reason(device) -> None:
    text = device.says(encode_information(0, 0.0, '{"name": "new"}'))
    assert "an invalid description of 15 characters" in text
    assert "serial_number" in text or "lacks" in text


def test_a_scan_is_told_by_its_first_counts_and_its_extremes(device) -> None:
    text = device.says(scan(7))
    assert "samples      #7  at 0.070000 s  300 channels from 0 to 299: -20 -19 -18" in text
    assert "min -20, max 279" in text


def test_of_many_scans_a_few_are_shown_and_the_rest_counted(device) -> None:
    text = device.says(b"".join(scan(q) for q in range(100)))
    assert (text.count("samples"), text.count("more before it")) == (1, 0)
    device.later(0.11)
    assert "; 99 more before it" in device.says(scan(100))
    assert "101 messages accepted, 0 lost" in device.monitor.summary()


def test_gaps_are_told_as_they_happen(device) -> None:
    text = device.says(scan(3) + scan(9) + scan(8))
    assert "gap          #3  to #9: 5 messages lost" in text
    assert "back         #9  to #8" in text


def test_bytes_thrown_away_are_told_by_their_reason(device) -> None:
    spoilt = bytearray(scan(1))
    spoilt[100] ^= 1
    text = device.says(b"boot: ok\r\n" + scan(0) + bytes(spoilt) + scan(2))
    assert "discarded    10 bytes: garbage" in text
    assert f"discarded    {len(spoilt)} bytes: checksum" in text
    seen = device.monitor.accounting()
    assert seen.balanced


def test_a_refusal_is_told_in_the_devices_words_without_what_steers_a_terminal(device) -> None:
    refused = encode_reply(0, 1.0, Command(4, 5, b""), Fault.OUT_OF_RANGE, b"too \x1b[2Jfast\n")
    assert "to #4 rate: refused (3): too \\x1b[2Jfast\\n" in device.says(refused)


def test_after_silence_the_usual_causes_are_named(device) -> None:
    assert device.later(2.9) == ""
    for text in (device.later(0.2), device.later(3.0)):
        assert text.count("no bytes for 3 s") == 1
        assert "--reset" in text
        assert device.later(0.1) == ""


def test_bytes_that_mean_nothing_make_it_try_another_rate(device) -> None:
    device.later(0.1)
    assert "trying" not in device.says(b"hello, world\r\n")
    assert "trying 1000000 baud" in device.later(0.9)


def test_a_line_that_is_gone_is_said_and_cut_messages_counted(device) -> None:
    device.says(scan(0)[:100])
    text = device.unplugged()
    assert "discarded    100 bytes: cut off" in text
    assert text.count("connection lost") == 1
    assert device.monitor.lost


def test_a_port_that_cannot_be_opened_says_why() -> None:
    with pytest.raises(SourceError, match="no such port"):
        WireMonitor("/dev/there-is-none")
    assert main(["monitor", "/dev/there-is-none"]) == 2


def test_a_time_to_listen_must_be_above_zero(capsys) -> None:
    for seconds in ("0", "-1", "nan"):
        assert main(["monitor", "/dev/ttyX", f"--seconds={seconds}"]) == 2
        assert "above 0 s" in capsys.readouterr().err


def test_silence_makes_the_command_fail(device, capsys) -> None:
    device.monitor.close()
    assert main(["monitor", device.port, "--seconds", "0.2"]) == 1
    assert "0 bytes in, 0 good" in capsys.readouterr().out
