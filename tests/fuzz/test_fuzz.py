"""Readers given arbitrary and mutated bytes: a `Refusal` is all that may come of it."""

import random
import runpy
import signal
import tempfile
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin import Refusal

FUZZ = runpy.run_path(str(Path(__file__).with_name("fuzz.py")))
TARGETS, tried, mutated = FUZZ["TARGETS"], FUZZ["tried"], FUZZ["mutated"]
MEMORY = 500e6  # bytes that reading may take
SECONDS = 5.0  # s of work that it may take

each = pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers here")


@pytest.fixture(scope="module", autouse=True)
def timed() -> Iterator[None]:
    was = signal.signal(signal.SIGPROF, FUZZ["late"])
    with pytest.MonkeyPatch.context() as changed:
        changed.setitem(tried.__globals__, "LONGEST", SECONDS)
        yield
    signal.signal(signal.SIGPROF, was)


def check(target, data: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        wrong = tried(target, data, Path(folder))
    assert not wrong, wrong


@each
def test_what_it_is_made_for_is_read(target) -> None:
    for seed in target.seeds:
        with tempfile.TemporaryDirectory() as folder:
            read = []
            try:
                target.read(seed, Path(folder))
                read.append(True)
            except Refusal as refusal:
                read.append(str(refusal))
        # Of a mesh cut short, and a calibration of another skin, that is said.
        assert read[0] is True or target.name in ("ply", "stl", "calibration"), read


@each
@given(st.binary(max_size=300))
@settings(max_examples=25)
def test_arbitrary_bytes_are_read_or_refused(target, data: bytes) -> None:
    check(target, data)


@each
@given(st.integers(0, 2**32))
@settings(max_examples=60)
def test_spoilt_files_are_read_or_refused(target, seed: int) -> None:
    rng = random.Random(seed)
    data = mutated(rng, list(target.seeds), target.words)
    check(target, mutated(rng, [data], target.words))


@each
@given(st.integers(0, 2**32))
@settings(max_examples=8)
def test_memory_is_bounded_whatever_a_header_says(target, seed: int) -> None:
    data = mutated(random.Random(seed), list(target.seeds), target.words)
    tracemalloc.start()
    try:
        check(target, data)
        assert tracemalloc.get_traced_memory()[1] < MEMORY
    finally:
        tracemalloc.stop()


# The fuzzer itself


def test_an_error_that_is_no_refusal_and_a_reader_that_hangs_are_found(monkeypatch, tmp_path):
    target = FUZZ["Target"]("broken", lambda data, _: data[0], (b"a",))
    found = FUZZ["fuzzed"](target, 0.3, random.Random(0), tmp_path)
    assert ["IndexError" in wrong for wrong, _ in found] == [True]
    assert found[0][1] == b""

    def hang(data: bytes, _: Path) -> None:
        while True:
            pass

    monkeypatch.setitem(tried.__globals__, "LONGEST", 0.05)
    assert "takes longer" in tried(FUZZ["Target"]("slow", hang, (b"",)), b"", tmp_path)
