"""The sketch on a board of numbers, which stops it where a pin, an order or a wait is wrong."""

import json
import runpy
import shutil
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "resources" / "kappaskin_resources" / "firmware"
READ = runpy.run_path(str(HERE / "reader.py"))["read"]
MESSAGE = runpy.run_path(str(HERE / "make_vectors.py"))["message"]
INFORMATION, SAMPLES, COMMAND, REPLY = 1, 2, 3, 4
PARTS = ("wire", "text", "scan", "commands", "device")
STRICT = ("-std=c++17", "-Wall", "-Wextra", "-Werror", "-pedantic", "-g", "-O1")
WATCHED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module")
def sketch(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sketch as an IDE makes it: C files and the .ino beside each other."""
    folder = tmp_path_factory.mktemp("sketch")
    for name in ("device_json.h", *(f"kappaskin_{part}.{end}" for part in PARTS for end in "ch")):
        shutil.copy(FIRMWARE / name, folder)
    shutil.copy(FIRMWARE / "kappaskin_sketch" / "kappaskin_sketch.ino", folder / "sketch.cpp")
    for name in PARTS:
        command = [compiler, *WATCHED, "-std=c99", "-c", f"kappaskin_{name}.c"]
        subprocess.run(command, cwd=folder, check=True)
    command = ["g++", *STRICT, *WATCHED, f"-I{HERE / 'arduino'}", "sketch.cpp"]
    command += [str(HERE / "arduino" / "board.cpp"), *(f"kappaskin_{part}.o" for part in PARTS)]
    told = subprocess.run([*command, "-o", "sketch"], cwd=folder, capture_output=True, check=False)
    assert told.returncode == 0, told.stderr.decode()
    return folder / "sketch"


@pytest.fixture
def run(sketch: Path) -> Callable[..., tuple[dict[int, list[bytes]], list[str]]]:
    """What it sends in 0.3 s of its own, by kind, and how the gain's and the light's pins stand."""

    def messages(*commands: bytes) -> tuple[dict[int, list[bytes]], list[str]]:
        asked = b"".join(MESSAGE(COMMAND, command, n, 0) for n, command in enumerate(commands))
        told = subprocess.run([sketch], input=asked, capture_output=True, check=False)
        assert told.returncode == 0, told.stderr.decode()
        found, _ = READ(told.stdout)
        return {
            kind: [message[22:-4] for message in found if message[3] == kind] for kind in range(5)
        }, told.stderr.decode().split()

    return messages


def test_each_channel_is_read_from_its_own_address(run) -> None:
    said, pins = run()

    expected = b"\2\1" + struct.pack("<HH300h", 0, 300, *range(-300, 300, 2))
    assert set(said[SAMPLES]) == {expected}
    assert len(said[SAMPLES]) > 95
    assert pins == ["0", "1", "0"]  # a gain of 100, and no light


def test_it_says_what_it_is_by_the_number_of_its_chip(run) -> None:
    said, _ = run()

    expected = json.loads((FIRMWARE / "device.json").read_text("utf-8"))
    assert json.loads(said[INFORMATION][0]) == expected | {"serial_number": "745650"}


def test_it_does_what_it_is_asked_for(run) -> None:
    said, pins = run(b"\6" + struct.pack("<I", 10_000), b"\7", b"\10")

    gain, light, ping = (reply[4:] for reply in said[REPLY])
    assert gain == b"\6\0" + struct.pack("<I", 10_000)
    assert light == b"\7\0"
    assert struct.unpack("<h", ping[-2:]) == (2390,)  # 739 mV of a TMP36
    assert pins == ["1", "0", "1"]
    assert json.loads(said[INFORMATION][-1])["amplifier"]["gain"] == 10


def test_a_gain_that_it_lacks_leaves_the_pins_alone(run) -> None:
    said, pins = run(b"\6" + struct.pack("<I", 1_000_000))

    assert said[REPLY][0][5] == 3
    assert pins == ["0", "1", "0"]


def test_the_times_of_the_sketch_are_those_of_the_board() -> None:
    text = (FIRMWARE / "kappaskin_sketch" / "kappaskin_sketch.ino").read_text("utf-8")
    said = json.loads((FIRMWARE / "device.json").read_text("utf-8"))
    settling = said["multiplexer"]["settling_time"]

    assert (
        f"CHANNEL_TIME = {round(1e9 * (settling + said['converter']['conversion_time']))};" in text
    )
    assert f"SETTLING = {round(1e9 * settling)};" in text
