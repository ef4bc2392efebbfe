"""What is held for long: frames of a fast device with the window drawing, and bytes to messages."""

import json
import math
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from kappaskin.sources import Decoder
from kappaskin.sources.description import description_of
from kappaskin.sources.wire import encode_samples

_LOADING = Path(__file__).with_name("loading.py")
_MEMORY = 20.0  # MB that may be added


@pytest.fixture
def quickest() -> Callable[..., list[float]]:
    """Least seconds of several functions, called turn by turn: what else runs can only add."""

    def measure(*functions: Callable[[], object], turns: int = 200) -> list[float]:
        least = [math.inf] * len(functions)
        for _ in range(turns):
            for place, function in enumerate(functions):
                start = time.perf_counter()
                function()
                least[place] = min(least[place], time.perf_counter() - start)
        return least

    return measure


def _held(port: str, seconds: float) -> dict[str, float]:
    command = [sys.executable, str(_LOADING), port, str(seconds)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def _grown(held: dict[str, float]) -> float:
    return max(held["window_grown_mb"], held["engine_grown_mb"])


def _words(held: dict[str, float], seconds: float) -> str:
    return (
        f"{held['frames']:.0f} frames/s over {seconds:g} s, {held['lost']:.0f} lost, "
        f"{held['computed']:.0%} computed, {held['drawn']:.1f} drawings/s, reader gap "
        f"{held['reader_gap_p99_ms']:.1f} ms (99th percentile), memory of the window "
        f"{held['window_grown_mb']:+.1f} MB, of the engine {held['engine_grown_mb']:+.1f} MB"
    )


def test_2000_frames_a_second_are_held_with_the_window_drawing(
    play, figure, ratio, lasting
) -> None:
    held = _held(play("--rate", 2000), lasting)
    figure(f"300 channels: {_words(held, lasting)}")
    assert held["lost"] == held["discarded"] == 0
    assert held["frames"] == pytest.approx(2000, rel=0.02)
    ratio("drawings at 2,000 frames/s, of the 20 a second asked", held["drawn"] / 20, at_least=1)
    gap = held["reader_gap_p99_ms"]
    ratio("gap of a reader at 2,000 frames/s, of the 10 ms allowed", gap / 10, at_most=1)
    ratio(
        "memory at 2,000 frames/s, of 20 MB allowed to be added", _grown(held) / _MEMORY, at_most=1
    )


def test_64_by_64_elements_are_held_at_200_frames_a_second(play, figure, ratio, lasting) -> None:
    held = _held(play("--grid", "64x64", "--rate", 200), lasting)
    figure(f"64 x 64 elements: {_words(held, lasting)}")
    assert held["lost"] == held["discarded"] == 0
    assert held["frames"] == pytest.approx(200, rel=0.02)
    ratio("drawings of 64 x 64 elements, of the 20 a second asked", held["drawn"] / 20, at_least=1)
    ratio(
        "memory of 64 x 64 elements, of 20 MB allowed to be added",
        _grown(held) / _MEMORY,
        at_most=1,
    )


@pytest.mark.parametrize("channels", [300, 3 * 64 * 64])
def test_a_message_is_decoded_in_three_times_its_checksum_and_copy(
    quickest, figure, ratio, channels: int
) -> None:
    rng, every = np.random.default_rng(0), np.arange(channels)
    scans = rng.integers(-6000, 6000, (max(10, 60_000 // channels), channels)).astype(np.int32)
    messages = [encode_samples(q, q / 2e3, every, counts, 2) for q, counts in enumerate(scans)]
    data, start = b"".join(messages), len(messages[0]) - 4 - 2 * channels
    blocks = [data[at : at + 65536] for at in range(0, len(data), 65536)]

    def decoded() -> None:
        decoder = Decoder()
        assert sum(len(decoder.feed(block)) for block in blocks) == len(messages)

    def copied() -> None:
        for message in messages:
            zlib.crc32(message)
            np.frombuffer(message, "<i2", channels, start).astype(np.int32)

    ours, theirs = quickest(decoded, copied)
    rate = len(data) / ours / 1e6
    figure(
        f"decoder, {channels} channels: {rate:.0f} MB/s, {ours / theirs:.2f} times zlib.crc32 and "
        "NumPy on each message's bytes"
    )
    ratio(f"decoder of {channels} channels, of the 20 MB/s asked", rate / 20, at_least=1)
    ratio(f"decoder of {channels} channels, against zlib and NumPy", ours / theirs, at_most=3)


_BOARD = """
format = 1
[skin]
size = [0.06, 0.06]
[elements]
grid = [6, 6]
[line]
kind = "text"
columns = ["time_ms", "xx:0..35", "yy:0..35", "xy:0..35"]
"""


def test_1000_lines_a_second_of_108_numbers_take_a_part_of_a_core(quickest, figure, ratio) -> None:
    described, rng = description_of(_BOARD, "board.toml"), np.random.default_rng(0)
    writer = described.decoder()
    lines = [writer.encoded(n, n / 1e3, rng.normal(0, 1, 108).round(2)) for n in range(1000)]

    def read() -> None:
        decoder = described.decoder(whole=True)
        assert sum(len(decoder.feed(line)) for line in lines) == 1000

    (taken,) = quickest(read, turns=10)
    figure(f"text, 108 numbers in a line: 1,000 lines/s take {taken:.3f} of a core")
    ratio("share of a core for 1,000 lines/s of 108 numbers as text", taken, at_most=0.3)
