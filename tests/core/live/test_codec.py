"""Values as bytes: whole again at the other end, and nothing made of what is none of ours."""

import json
import struct
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import lz4.block
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin import Pipeline, Setup, load_scene
from kappaskin.calibration import Tare
from kappaskin.frames import Event
from kappaskin.live import Status
from kappaskin.live.codec import BadMessageError, decoded, encoded
from kappaskin.live.requests import Note, Requested, Seek, TakeTare
from kappaskin.live.ring import slot_type
from kappaskin.pipeline import usual_setup
from kappaskin.scenes import SCENES, Scene

SENSOR = load_scene("centre").sensor()


def again(value: Any, kind: Any) -> Any:
    """The value at the other end, which the same bytes are made of as of the first one."""
    found = decoded(encoded(value), kind)
    assert encoded(found) == encoded(value)
    return found


@pytest.mark.cases("centre", "thumb-pad", "fingertip-cap", "tilts", "failing", "bolt")
@pytest.mark.parametrize("name", SCENES)
def test_a_scene_and_its_sensor_are_the_same_at_the_other_end(name: str) -> None:
    scene = load_scene(name)
    found = again(scene, Scene)
    assert found.effects == scene.effects
    assert found.choice == scene.choice
    sensor = scene.sensor()
    status = again(Status(sensor=sensor, setup=usual_setup(sensor)), Status)
    there, here = status.sensor.layout, sensor.layout
    np.testing.assert_array_equal(there.positions, here.positions)
    assert there.patch == here.patch


def test_what_is_requested_is_the_same_at_the_other_end() -> None:
    shape = SENSOR.layout.frame_shape
    offset = np.linspace(-1, 1, int(np.prod(shape)))
    tare = Tare("board", "1", "layout", datetime.now(UTC), None, 9, 1.0, offset, offset**2)
    setup = Setup(tare=tare)
    wanted = Requested().changing(setup=setup, recording=Path("press.mcap"), window_state=b"\0a")
    wanted = wanted.doing(Seek(1.5, 2.0)).doing(Note("pressed \N{MICRO SIGN}")).doing(TakeTare())
    found = again(wanted, Requested)
    np.testing.assert_array_equal(found.setup.tare.offset, tare.offset)
    assert replace(found, setup=setup) == wanted


def test_the_type_of_estimates_is_the_same_at_the_other_end() -> None:
    slot = slot_type(Pipeline(SENSOR, Setup()))
    event = Event(1.0, "met", "a device")
    found = again(Status(slot=slot, events=(event,), reader_gap=float("inf")), Status)
    assert found.slot == slot
    assert found.events == (event,)


def message(plain: object, rest: bytes = b"", size: int | None = None) -> bytes:
    data = json.dumps(plain).encode()
    whole = lz4.block.compress(data + rest)
    return struct.pack("<II", len(data + rest) if size is None else size, len(data)) + whole


@pytest.mark.parametrize(
    ("plain", "expected"),
    [
        ({"class": "Popen", "fields": {"args": "id"}}, Event),
        ({"class": "Note", "fields": {}}, Note),
        ({"class": "Note", "fields": {"text": 3}}, Note),
        ({"class": "Note", "fields": {"text": "a", "more": 1}}, Note),
        ({"class": "Seek", "fields": {"text": "a"}}, Note | TakeTare),
        ([1, 2], Note),
        ("3", int),
        (True, int),
        ([["|O", [1], "C", 8, 0]], tuple[np.ndarray[Any, np.dtype[Any]], ...]),
        (["<f8", [9], "C", 72, 0], np.ndarray[Any, np.dtype[np.float64]]),
        (["<f8", [1], "C", 8, -8], np.ndarray[Any, np.dtype[np.float64]]),
        (["<i8", [1], "C", 8, 0], np.ndarray[Any, np.dtype[np.float64]]),
        ([["a", "|O"]], np.dtype[np.void]),
        ([["a", "<f8", [100_000, 100_000]]], np.dtype[np.void]),
        ({"class": "Path", "fields": {}}, type),
    ],
)
def test_what_is_not_expected_is_refused(plain: object, expected: Any) -> None:
    with pytest.raises(BadMessageError):
        decoded(message(plain, bytes(8)), expected)


def test_checks_of_a_class_are_made_of_what_comes() -> None:
    scene = load_scene("centre")
    data = encoded(scene)
    whole, length = lz4.block.decompress(data[8:]), int.from_bytes(data[4:8], "little")
    found = json.loads(whole[:length])
    found["fields"]["seed"] = -1
    with pytest.raises(BadMessageError, match="seed"):
        decoded(message(found, whole[length:]), Scene)


def test_a_message_says_no_more_bytes_than_are_allowed() -> None:
    with pytest.raises(BadMessageError, match="at most 1000 bytes"):
        decoded(message("a" * 2000), str, most=1000)
    with pytest.raises(BadMessageError):  # it says few, and would be many
        decoded(message("a" * 2000, size=10), str, most=1000)


def test_levels_are_limited() -> None:
    deep = "[" * 100_000 + "]" * 100_000
    data = deep.encode()
    whole = struct.pack("<II", len(data), len(data)) + lz4.block.compress(data)
    with pytest.raises(BadMessageError):
        decoded(whole, tuple[Any, ...])


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=4), st.booleans())
def test_changed_bytes_are_refused_or_read(at: int, change: bytes, cut: bool) -> None:
    data = encoded(Requested(source="sim:", recording=Path("a")).doing(Seek(1.0, 1.0)))
    at %= len(data)
    data = data[:at] + change + (b"" if cut else data[at + len(change) :])
    with suppress(BadMessageError):
        decoded(data, Requested)
