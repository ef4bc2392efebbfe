"""Estimates through shared memory: whole or not at all, whatever the writer does meanwhile."""

import multiprocessing
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kappaskin import Estimate, Pipeline, Refusal, Setup, Simulator, load_scene
from kappaskin.frames import Array, Contact, LocalGeometry
from kappaskin.live.ring import Ring, slot_type
from kappaskin.recording import Recording


def pipeline_of(setup: Setup | None = None) -> Pipeline:
    return Pipeline(load_scene("centre").sensor(), setup or Setup(4, 3, 9, 7), 1)


PIPELINE = pipeline_of()
PATHS = ["curvature", "contact.force"]
SLOT = slot_type(PIPELINE)


def estimate_of(pipeline: Pipeline = PIPELINE) -> Estimate:
    return pipeline(Simulator(load_scene("centre")).frame(0, time.monotonic))


def numbers(value: Any) -> Array:
    """Every number in an estimate, in a row; what is true or false is none."""
    parts = [getattr(value, field.name) for field in fields(value)]
    parts = [p for p in parts if not isinstance(p, bool) and getattr(p, "dtype", None) != "?"]
    return np.concatenate([numbers(p) if is_dataclass(p) else np.ravel(p) for p in parts])


@pytest.fixture
def ring() -> Iterator[Ring]:
    made = Ring.create()
    yield made
    made.destroy()


@pytest.fixture
def writer(ring) -> Iterator[Ring]:
    made = Ring.attach(ring.name)
    yield made
    made.close()


SMALL = pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0, reason="mounts a small memory: needs root"
)


def with_memory(size: str, *command: str) -> subprocess.CompletedProcess[str]:
    """Run `kappaskin` with the arguments where there is so much shared memory."""
    mount = f'mount -t tmpfs -o size={size} tmpfs /dev/shm && exec "$@"'
    run = ["unshare", "-m", "sh", "-c", mount, "sh", sys.executable, "-m", "kappaskin", *command]
    return subprocess.run(run, capture_output=True, text=True, timeout=60)


# Estimates


def test_an_estimate_comes_back_as_written(ring, writer) -> None:
    estimate = estimate_of()
    writer.lay_out(1, SLOT)
    writer.write(estimate)

    got = ring.read(1, SLOT)

    assert got is not None
    assert np.array_equal(numbers(got), numbers(estimate), equal_nan=True)
    assert np.array_equal(got.fresh, estimate.fresh)
    assert [np.shape(getattr(got, f.name)) for f in fields(got) if f.name != "contact"] == [
        np.shape(getattr(estimate, f.name)) for f in fields(got) if f.name != "contact"
    ]
    assert type(got.sequence) is int
    assert type(got.noise) is float


def test_nothing_is_read_before_the_first_estimate(ring, writer) -> None:
    assert ring.read(1, SLOT) is None
    writer.lay_out(1, SLOT)
    assert ring.read(1, SLOT) is None


def test_the_latest_of_many_estimates_is_read(ring, writer) -> None:
    estimate = estimate_of()
    writer.lay_out(1, SLOT)
    for n in range(200):
        writer.write(replace(estimate, sequence=n))
        got = ring.read(1, SLOT)
        assert got is not None
        assert got.sequence == n


def test_an_estimate_is_found_by_its_frame_while_it_is_there(ring, writer) -> None:
    writer.lay_out(1, SLOT)
    estimate, kept = estimate_of(), 64
    assert ring.read(1, SLOT, 0) is None
    for sequence in range(100):
        writer.write(replace(estimate, sequence=sequence, noise=float(sequence)))
    for sequence in (99, 50, 100 - kept):
        assert ring.read(1, SLOT, sequence).noise == sequence
    for sequence in (100 - kept - 1, 100):
        assert ring.read(1, SLOT, sequence) is None
    writer.write(replace(estimate, sequence=50, noise=-1.0))  # of a replay that went back
    assert ring.read(1, SLOT, 50).noise == -1.0


def test_readings_since_the_last_look_are_all_there_once_and_in_order(ring, writer) -> None:
    estimate = estimate_of()
    writer.lay_out(1, SLOT)

    def write(times: range) -> None:
        for t in times:
            read = np.full(estimate.curvature.shape, float(t))
            contact = replace(estimate.contact, force=10.0 * t)
            got = replace(estimate, device_time=float(t), curvature=read, contact=contact)
            writer.write(got)

    write(range(5))
    times, (curvature, force), last = ring.recent(1, SLOT, 0, PATHS)
    np.testing.assert_array_equal(times, np.arange(5))
    np.testing.assert_array_equal(curvature[:, 1, 7], np.arange(5))
    np.testing.assert_array_equal(force, 10 * np.arange(5))
    write(range(5, 7))
    times, (curvature, force), last = ring.recent(1, SLOT, last, PATHS)
    assert (times.tolist(), curvature.shape) == ([5, 6], (2, *estimate.curvature.shape))
    assert not len(ring.recent(1, SLOT, last, PATHS)[0])
    write(range(7, 200))
    the_last_64 = ring.recent(1, SLOT, last, PATHS)[0]
    np.testing.assert_array_equal(the_last_64, np.arange(136, 200))
    assert not len(ring.recent(2, SLOT, 0, PATHS)[0])  # of another generation


def test_readings_that_are_being_written_are_not_read(ring, writer) -> None:
    writer.lay_out(1, SLOT)
    for _ in range(3):
        writer.write(estimate_of())
    slots = writer._slots  # noqa: SLF001
    slots["opened"][1] += 64  # the writer came round and began anew
    assert len(ring.recent(1, SLOT, 0, PATHS)[0]) == 2


def test_an_estimate_read_stays_as_it_was_while_others_are_written(ring, writer) -> None:
    estimate = estimate_of()
    writer.lay_out(1, SLOT)
    writer.write(estimate)
    got = ring.read(1, SLOT)
    assert got is not None
    for n in range(100):
        writer.write(replace(estimate, sequence=n, surface=np.full((7, 9), float(n))))
    assert np.array_equal(numbers(got), numbers(estimate), equal_nan=True)


def test_generations_of_other_shapes_do_not_mix(ring, writer) -> None:
    other = pipeline_of(Setup(8, 8, 65, 65))
    writer.lay_out(1, SLOT)
    writer.write(estimate_of())
    writer.lay_out(2, slot_type(other))

    assert ring.read(1, SLOT) is None  # gone
    assert ring.read(2, slot_type(other)) is None  # none yet
    writer.write(replace(estimate_of(other), generation=2))
    got = ring.read(2, slot_type(other))

    assert got is not None
    assert got.surface.shape == (65, 65)
    assert ring.read(1, SLOT) is None


def test_a_generation_laid_out_anew_in_another_shape_is_read_in_that_shape(ring, writer) -> None:
    other = pipeline_of(Setup(6, 6, 11, 12))
    writer.lay_out(1, SLOT)
    writer.write(estimate_of())
    ring.read(1, SLOT)

    writer.lay_out(1, slot_type(other))
    writer.write(estimate_of(other))

    got = ring.read(1, slot_type(other))
    assert got is not None
    assert got.coefficients.shape == (6, 6)


def test_an_estimate_too_large_for_two_slots_is_refused(writer) -> None:
    slot = np.dtype([("opened", "u8"), ("surface", "f8", (3000, 3000)), ("closed", "u8")])
    with pytest.raises(Refusal, match="72000016 bytes is too large; use a smaller"):
        writer.lay_out(1, slot)


# Two processes

WRITING = """
import kappaskin.live.ring
from kappaskin.live.ring import Ring

kappaskin.live.ring._MOST_SLOTS = 2  # so that the writer overtakes the reader all the time
ring = Ring.attach(name)
ring.lay_out(1, slot)
ring.write_status(statuses[0])
while not done.is_set():
    for estimate in estimates:
        ring.write(estimate)
    for status in statuses:
        ring.write_status(status)
ring.close()
"""


def all_of(number: float) -> Estimate:
    """An estimate that holds nothing but `number`."""
    estimate = estimate_of(pipeline_of(Setup(8, 8, 129, 129)))
    parts = {f.name: np.full(np.shape(getattr(estimate, f.name)), number) for f in fields(estimate)}
    pair, matrix = np.full(2, number), np.full((2, 2), number)
    forces = number, number, number, number, int(number)
    contact = Contact(pair, pair, *forces, True, False, size=number, size_sd=number)
    square = np.full((3, 3), number)
    geometry = LocalGeometry(square[0], square, matrix, matrix, pair, square)
    return Estimate(**parts | {"contact": contact, "second": contact, "geometry": geometry})


@pytest.mark.full
@pytest.mark.slow
def test_another_process_never_shows_half_an_estimate_or_half_a_status(ring, monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.live.ring._MOST_SLOTS", 2)
    slot = slot_type(pipeline_of(Setup(8, 8, 129, 129)))
    context = multiprocessing.get_context("spawn")
    given = {
        "name": ring.name,
        "slot": slot,
        "estimates": [all_of(number) for number in range(1, 8)],
        "statuses": [[number] * 5000 for number in range(1, 8)],
        "done": context.Event(),
    }
    writing = context.Process(target=exec, args=(WRITING, given))
    writing.start()
    whole, torn, begun = [0, 0], [0, 0], time.monotonic()
    # Both are read while they are written, however busy the machine.
    while (took := time.monotonic() - begun) < 2.0 or (min(whole) <= 100 and took < 30.0):
        estimate, status = ring.read(1, slot), ring.read_status()
        if estimate is not None:
            found = numbers(estimate)
            whole[0] += int(found.min() == found.max())
            torn[0] += int(found.min() != found.max())
        if status is not None:
            whole[1] += int(len(set(status)) == 1)
            torn[1] += int(len(set(status)) != 1)
    given["done"].set()
    writing.join()

    assert writing.exitcode == 0
    assert torn == [0, 0]
    assert min(whole) > 100


# Status


def test_a_status_comes_back_as_written(ring, writer) -> None:
    assert ring.read_status() is None
    for status in ({"a": [1, 2.5, "x"]}, "longer " * 5000, "short", None, Setup()):
        writer.write_status(status)
        assert ring.read_status() == status


def test_too_large_a_status_is_refused_and_the_last_one_stays(ring, writer) -> None:
    writer.write_status("fits")
    with pytest.raises(Refusal, match="at most 8388608 bytes"):
        writer.write_status(bytes(2**23))
    assert ring.read_status() == "fits"


def test_a_writer_killed_in_the_middle_does_not_spoil_the_next_ones_status(ring, writer) -> None:
    writer.write_status("before")
    memory = SharedMemory(ring.name)
    count = np.frombuffer(memory.buf, np.uint64, 1)
    count += np.uint64(1)  # the header's first number is odd while a status is written
    del count
    memory.close()
    assert ring.read_status() is None

    for n in range(3):
        writer.write_status(n)
        assert ring.read_status() == n


def test_a_block_given_back_is_gone() -> None:
    ring = Ring.create()
    name = ring.name
    ring.destroy()
    with pytest.raises(FileNotFoundError):
        Ring.attach(name)


# Little memory


@SMALL
@pytest.mark.slow
@pytest.mark.cases("512k")
@pytest.mark.parametrize("size", ["4m", "512k"])
def test_little_memory_is_made_do_with(tmp_path, size: str) -> None:
    file = tmp_path / "a.mcap"
    done = with_memory(size, "record", "sim:", str(file), "--seconds", "3")
    assert done.returncode == 0
    assert all("use finite-slope" in line for line in done.stderr.splitlines())
    with Recording(file) as recording:
        assert recording.counts["/kappaskin/contact"] > 50


@SMALL
@pytest.mark.slow
@pytest.mark.cases("4k")
@pytest.mark.parametrize("size", ["4k", "16k"])
def test_too_little_memory_is_refused(tmp_path, size: str) -> None:
    file = tmp_path / "a.mcap"
    done = with_memory(size, "record", "sim:", str(file), "--seconds", "1")
    assert done.returncode in (1, 2)
    assert re.search(r"expected [\d,]+ bytes of shared memory, got none", done.stderr)
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="has no limits of a process")
def test_a_limit_of_file_sizes_is_told(tmp_path) -> None:
    command = 'ulimit -f 2048; exec "$@"'
    record = [sys.executable, "-m", "kappaskin", "record", "sim:", str(tmp_path / "a.mcap")]
    done = subprocess.run(["sh", "-c", command, "sh", *record], capture_output=True, text=True)
    assert done.returncode == 2
    assert re.fullmatch(
        r"kappaskin: expected .* bytes of shared memory.*ulimit -f.*\n", done.stderr
    )


# What is left of processes that were ended by force


LINUX = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the system does not list shared memory"
)
LEAVES = """
import os
from multiprocessing import resource_tracker
from kappaskin.live.ring import Ring
print(*(ring.name for ring in Ring.pair()), flush=True)
os.kill(resource_tracker._resource_tracker._pid, 9)
os.kill(os.getpid(), 9)
"""


@LINUX
@pytest.mark.slow
def test_blocks_of_a_killed_process_are_removed_and_no_others(ring) -> None:
    done = subprocess.run([sys.executable, "-c", LEAVES], capture_output=True, text=True)
    dead = done.stdout.split()
    foreign = SharedMemory(f"kappaskin-{os.getpid()}-foreign", create=True, size=4096)
    try:
        assert all(Path("/dev/shm", name).exists() for name in dead)
        for made in Ring.pair():
            made.destroy()
        assert len(dead) == 2
        assert not any(Path("/dev/shm", name).exists() for name in dead)
        assert Path("/dev/shm", ring.name).exists()
        assert Path("/dev/shm", foreign.name).exists()
    finally:
        foreign.close()
        foreign.unlink()


USES = """
import sys, time
from kappaskin.live.ring import Ring
rings = [Ring.borrow(name) for name in sys.argv[1:]]
print("used", flush=True)
time.sleep(60)
"""


@pytest.mark.full
@LINUX
@pytest.mark.slow
def test_blocks_that_another_process_uses_stay_until_it_ended() -> None:
    waits = LEAVES.replace("import os", "import os, sys").replace(
        "os.kill(os.getpid(), 9)", "sys.stdin.read(); os.kill(os.getpid(), 9)"
    )
    piped = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", waits], **piped) as owner:
        names = owner.stdout.readline().split()
        with subprocess.Popen([sys.executable, "-c", USES, *names], **piped) as user:
            assert user.stdout.readline() == "used\n"
            owner.communicate()
            for made in Ring.pair():
                made.destroy()
            assert all(Path("/dev/shm", name).exists() for name in names)
            user.kill()
    for made in Ring.pair():
        made.destroy()
    assert not any(Path("/dev/shm", name).exists() for name in names)
