"""The live process: what it shows, what it survives, and that nothing outlives it."""

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace
from typing import TypeVar

import numpy as np
import psutil
import pytest

from kappaskin import (
    Estimate,
    Patch,
    Plate,
    PointLoad,
    Refusal,
    Region,
    Scene,
    SensorLayout,
    Setup,
    Stimulus,
    load_scene,
)
from kappaskin.live import LOST, STREAMING, Engine, Status
from kappaskin.live.ring import Ring
from kappaskin.live.status import OFF
from kappaskin.live.tare_taking import TareStatus
from kappaskin.recording import RecordingStatus

pytestmark = pytest.mark.slow

Answer = TypeVar("Answer")


def wait_for(ask: Callable[[], Answer], within: float = 30.0) -> Answer:
    """The first answer that is true, or the last one."""
    end = time.monotonic() + within
    while not (answer := ask()) and time.monotonic() < end:
        time.sleep(0.01)
    return answer


def state(engine: Engine, expected: str, within: float = 30.0) -> Status:
    wait_for(lambda: engine.status().state == expected, within)
    status = engine.status()
    assert status.state == expected, status.message
    return status


def next_estimate(engine: Engine, after: int = 0) -> Estimate:
    """The first estimate of a generation above `after`."""

    def ask() -> Estimate | None:
        status = engine.status()
        return engine.latest(status) if status.generation > after else None

    estimate = wait_for(ask)
    assert estimate is not None, engine.status()
    return estimate


@pytest.fixture(scope="module")
def running() -> Iterator[Engine]:
    with Engine() as made:
        yield made


@pytest.fixture
def engine(running: Engine) -> Iterator[Engine]:
    """One engine for all tests that leave it alive, disconnected after each."""
    yield running
    running.set_up(Setup())
    running.disconnect()
    state(running, OFF)


@pytest.fixture
def own_engine() -> Iterator[Engine]:
    with Engine() as made:
        yield made


# What it shows


def test_a_simulated_scene_gives_estimates_with_the_truth_beside_them(engine) -> None:
    engine.connect("sim:centre")
    estimate, status = next_estimate(engine), state(engine, STREAMING)
    assert estimate.surface.shape == (65, 65)
    assert estimate.contact.position == pytest.approx([0.05, 0.05], abs=1e-3)
    assert estimate.true_contact.tolist() == [0.05, 0.05]
    assert abs(estimate.error_at_load) < 0.5e-3
    assert 0 <= estimate.ready_time - estimate.host_time < 5
    assert status.sensor is not None
    assert status.sensor.simulated
    assert (status.source, status.message, status.refusal) == ("sim:centre", "", "")


def test_a_steep_shape_is_warned_of_until_the_method_knows_slopes(engine) -> None:
    engine.connect("sim:steep")
    assert wait_for(lambda: engine.status().slope > 0.3)
    engine.set_up(Setup(method="finite-slope"))
    assert next_estimate(engine, engine.status().generation).converged
    assert wait_for(lambda: engine.status().slope == 0)


@pytest.mark.full
def test_failing_channels_are_told_with_what_leaving_them_out_costs(engine) -> None:
    engine.connect("sim:failing-elements")
    assert wait_for(lambda: {f.element for f in engine.status().health.findings} >= {44, 45, 63})
    status = engine.status()

    def told() -> bool:
        estimate = engine.latest(engine.status())
        return estimate is not None and bool((estimate.suspect[[44, 45, 63]] > 0).all())

    assert wait_for(told)  # a frame after they were found
    assert 1.03 < status.health.cost < 1.2
    assert status.health.contact_cost > 1.0
    assert status.health.retained == 0
    assert "channels excluded, error bars +" in str(status.health)
    engine.connect("sim:circle")
    state(engine, STREAMING)
    assert wait_for(lambda: engine.status().health.count == 0)
    assert engine.status().health.cost == 1.0


def test_frames_are_counted_and_timed(engine) -> None:
    engine.connect("sim:")

    def counted() -> Status | None:
        status = engine.status()
        as_asked = status.rate == pytest.approx(500, rel=0.4)  # the machine may be busy
        fresh = min(status.last_frame, status.reported) > time.monotonic() - 0.5
        return status if as_asked and fresh and status.accounting.span > 500 else None

    status = wait_for(counted)

    assert status, engine.status().rate
    seen = status.accounting
    assert seen.span == seen.accepted + seen.lost
    assert 0.001 < status.reader_gap < 1.0


def test_another_setup_is_swapped_in_whole(engine) -> None:
    engine.connect("sim:")
    before = next_estimate(engine)

    engine.set_up(Setup(6, 7, 33, 17))
    after = next_estimate(engine, before.generation)

    assert after.generation > before.generation
    assert after.coefficients.shape == (6, 7)
    assert after.surface.shape == after.true_surface.shape == (17, 33)
    assert after.sequence > before.sequence
    assert engine.status().setup == Setup(6, 7, 33, 17)


def test_estimates_of_an_older_setup_are_never_shown_for_a_newer_one(engine) -> None:
    engine.connect("sim:")
    next_estimate(engine)
    for n in range(4, 9):
        engine.set_up(Setup(n, n, 5 + n, 6 + n))
        for _ in range(30):
            status = engine.status()
            estimate = engine.latest(status)
            if estimate is not None:
                assert estimate.generation == status.generation
                assert estimate.surface.shape == (status.setup.ny, status.setup.nx)
            time.sleep(0.002)


def test_a_basis_that_the_readings_do_not_decide_leaves_the_old_one_and_says_why(engine) -> None:
    engine.connect("sim:")
    before = next_estimate(engine)

    engine.set_up(Setup(12, 12))
    wait_for(lambda: engine.status().refusal)
    status = engine.status()

    assert "10 x 10 elements" in status.refusal
    assert "12 x 12 basis" in status.refusal
    assert "use at most 10 x 10 functions" in status.refusal
    assert (status.state, status.setup, status.generation) == (
        STREAMING,
        Setup(),
        before.generation,
    )
    assert wait_for(lambda: engine.latest(status).sequence > before.sequence + 50)
    engine.set_up(Setup(9, 9))
    assert next_estimate(engine, before.generation).coefficients.shape == (9, 9)
    assert engine.status().refusal == ""


def test_a_setup_chosen_before_there_is_a_source_is_used(engine) -> None:
    engine.set_up(Setup(5, 4))
    engine.connect("sim:")
    assert wait_for(lambda: next_estimate(engine).coefficients.shape == (5, 4))


def test_another_scene_plays_on_the_same_line(engine) -> None:
    engine.connect("sim:centre")
    before = next_estimate(engine)
    here = np.array([0.03, 0.06])

    engine.play(load_scene("centre").touched_by(PointLoad(*here, 0.5)))

    assert wait_for(lambda: np.array_equal(next_estimate(engine).true_contact, here))
    after = wait_for(lambda: next_estimate(engine))
    assert after.generation == before.generation
    assert np.abs(after.contact.position - here).max() < 2e-3


def test_a_scene_stands_still_where_it_is_sought_and_the_status_says_so(engine) -> None:
    engine.connect("sim:circle")
    next_estimate(engine)
    (load,) = load_scene("circle").loads_at(1.5)
    there = pytest.approx(load.centre(), abs=1e-9)
    engine.seek(1.5, 0.0)
    assert wait_for(lambda: next_estimate(engine).true_contact == there)
    assert wait_for(lambda: engine.status().playing.speed == 0)
    assert engine.status().playing.time(123.0) == 1.5
    with pytest.raises(Refusal, match="speed of 0 to 10"):
        engine.seek(0.0, math.inf)
    engine.seek()
    assert wait_for(lambda: np.abs(next_estimate(engine).true_contact - load.centre()).max() > 1e-3)


def test_another_skin_is_met_as_another_device_is(engine) -> None:
    engine.connect("sim:centre")
    before, connections = next_estimate(engine), engine.status().connections
    patch = Patch(0.04, 0.03, 0.0129)
    layout = SensorLayout.regular(patch, 7, 9)

    engine.play(Scene("arc", Plate(patch), layout, (Stimulus(PointLoad(0.02, 0.015, 0.2)),)))
    after = next_estimate(engine, before.generation)

    status = engine.status()
    assert (status.state, status.connections) == (STREAMING, connections + 1)
    assert status.sensor is not None
    assert status.sensor.layout.patch == patch
    assert after.curvature.shape == (3, 63)
    assert after.true_contact.tolist() == [0.02, 0.015]


@pytest.mark.full
def test_between_two_skins_there_is_nothing_to_show(engine) -> None:
    engine.connect("sim:centre")
    next_estimate(engine)
    engine.set_up(Setup(18, 18))
    patch, waited, end = Patch(0.04, 0.03, 0.0129), 0, time.monotonic() + 30.0
    for m in cycle((20, 21)):  # so many that making the pipeline takes a while
        layout = SensorLayout.regular(patch, m, 20)
        engine.play(Scene("arc", Plate(patch), layout, rate=100.0))
        for _ in range(300):
            status = engine.status()
            estimate = engine.latest(status)
            waited += status.slot is None
            if estimate is not None:
                assert estimate.curvature.shape == (3, len(status.sensor.layout))
            time.sleep(0.002)
        if m == 21 and waited:  # this process may have slept meanwhile
            break
        assert time.monotonic() < end, "there was always something to show"


def test_a_scene_that_is_refused_is_said_and_the_last_one_plays_on(engine) -> None:
    engine.connect("sim:centre")
    before = next_estimate(engine)
    half = Patch(np.pi * 0.01, 0.02, 0.01, strip=True)
    layout = SensorLayout.regular(half, 8, 1)

    engine.play(Scene("loose", Plate(half), layout, reference=(15, 1), edge="sliding"))

    assert wait_for(lambda: "moves as a whole" in engine.status().message)
    assert wait_for(lambda: engine.latest(engine.status()).sequence > before.sequence + 20)
    assert engine.status().generation == before.generation
    engine.play(load_scene("line"))
    assert wait_for(lambda: not engine.status().message)


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("/dev/ttyABSENT7", "there is no such port"),
        ("sim:nowhere", "expected a scene among"),
        ("", "got no name"),
        ("hwgrep://(", "cannot be opened"),
    ],
)
def test_a_source_that_cannot_be_opened_is_lost_with_the_reason(engine, source, reason) -> None:
    engine.connect(source)
    status = state(engine, LOST)
    assert reason in status.message
    assert status.source == source
    assert engine.alive
    engine.connect("sim:")
    assert state(engine, STREAMING).message == ""


def test_disconnected_it_shows_nothing_new(engine) -> None:
    engine.connect("sim:")
    next_estimate(engine)

    engine.disconnect()
    status = state(engine, OFF)

    assert (status.source, status.sensor, status.last_frame) == ("", None, -np.inf)
    last = engine.latest(status)
    time.sleep(0.2)
    now = engine.latest(engine.status())
    assert (now and now.sequence) == (last and last.sequence)


# Regions of interest


def scanned_of(engine: Engine) -> int | None:
    """How many readings the newest estimate brought."""
    estimate = engine.latest(engine.status())
    return None if estimate is None else int(estimate.fresh.sum())


@pytest.mark.parametrize("around", ["skin", "intrinsic"])
def test_a_region_is_scanned_around_the_contact_until_it_is_off(engine, around) -> None:
    engine.connect("sim:off-centre")  # at rest: a busy machine may be late
    next_estimate(engine)
    region = Region(around, radius=0.02, share=0.1)

    engine.scan(region)
    assert wait_for(lambda: 0 < (scanned_of(engine) or 0) < 90)
    estimate, status = next_estimate(engine), engine.status()

    off = np.hypot(*(status.sensor.layout.positions - estimate.true_contact).T)
    assert estimate.fresh[:, off < 0.015].all()
    assert np.isfinite(estimate.curvature).all()
    assert (status.region, status.region_refusal) == (region, "")
    engine.scan(Region())
    assert wait_for(lambda: scanned_of(engine) == 300)


def test_another_setup_goes_on_with_the_readings_that_are_held(engine) -> None:
    engine.set_up(Setup(hold=60))
    engine.connect("sim:off-centre")
    before = next_estimate(engine)
    engine.scan(Region("elements", (44,), share=0))
    assert wait_for(lambda: scanned_of(engine) == 3)

    engine.set_up(Setup(6, 6, hold=60))
    after = next_estimate(engine, before.generation)

    assert after.coefficients.shape == (6, 6)
    assert np.isfinite(after.curvature).all()
    engine.scan(Region())


def test_a_region_that_is_not_on_the_skin_is_refused_and_everything_goes_on(engine) -> None:
    engine.connect("sim:")
    next_estimate(engine)

    engine.scan(Region("elements", elements=(4000,)))
    reason = wait_for(lambda: engine.status().region_refusal)
    before = next_estimate(engine).sequence

    assert "elements from 0 to 99" in reason
    assert wait_for(lambda: next_estimate(engine).sequence > before + 50)
    assert scanned_of(engine) == 300
    engine.scan(Region())
    assert wait_for(lambda: not engine.status().region_refusal)


def test_a_region_asked_for_before_there_is_a_source_is_scanned(engine) -> None:
    engine.scan(Region("elements", elements=(3, 4), share=0.2))
    engine.connect("sim:")

    assert wait_for(lambda: 0 < (scanned_of(engine) or 0) < 90)
    engine.scan(Region())


def test_an_engine_started_anew_scans_the_region_of_the_last_one(own_engine) -> None:
    own_engine.scan(Region("elements", elements=(3, 4), share=0.2))
    assert own_engine.pid is not None
    os.kill(own_engine.pid, signal.SIGKILL)
    state(own_engine, LOST)

    own_engine.connect("sim:")

    assert wait_for(lambda: 0 < (scanned_of(own_engine) or 0) < 90)


# What it survives


@pytest.fixture
def told(monkeypatch) -> list[Status]:
    """What this process says in the place of one that died; another may have gone on since."""
    said, write = list[Status](), Ring.write_status

    def written(ring: Ring, status: Status) -> None:
        said.append(status)
        write(ring, status)

    monkeypatch.setattr(Ring, "write_status", written)
    return said


def test_killed_it_is_lost_and_connecting_starts_another(own_engine, told) -> None:
    engine = own_engine
    engine.connect("sim:")
    before = next_estimate(engine)
    pid = engine.pid
    assert pid is not None

    os.kill(pid, signal.SIGKILL)
    status = state(engine, LOST, within=1.0)
    assert "ended unexpectedly; connect again to restart it" in status.message
    assert status.rate == 0.0

    engine.set_up(Setup(6, 5, 20, 21))  # there is no process to hear it
    engine.connect("sim:line")
    assert told[-1].state == OFF  # not yet what the dead one said of itself
    after = next_estimate(engine, before.generation)
    assert engine.pid != pid
    assert after.coefficients.shape == (6, 5)
    assert after.surface.shape == (21, 20)
    assert state(engine, STREAMING).source == "sim:line"


def killed(engine: Engine) -> None:
    """Kill the engine's process, and start another as the app does."""
    pid = engine.pid
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    assert wait_for(lambda: not engine.alive)
    engine.revive()


def test_revived_it_goes_on_with_what_was_asked_for_last_and_says_so(own_engine, told) -> None:
    engine = own_engine
    engine.connect("sim:circle")
    engine.play(load_scene("centre").touched_by(PointLoad(0.03, 0.06, 0.5)))
    engine.set_up(Setup(6, 5, 20, 21))
    engine.scan(Region("elements", elements=(3, 4), share=0.2))
    engine.seek(0.5, 0.0)
    assert wait_for(lambda: next_estimate(engine).coefficients.shape == (6, 5))
    engine.revive()  # one that lives is left alone
    before, pid = engine.status(), engine.pid
    assert before.event_count == 0

    died = time.monotonic()
    killed(engine)
    start = time.monotonic()

    assert (told[-1].state, told[-1].source) == (LOST, "sim:circle")
    assert "was started again" in told[-1].message
    after = next_estimate(engine, before.generation)
    print(f"back after {time.monotonic() - start:.2f} s")
    assert engine.pid != pid
    status = state(engine, STREAMING)
    assert [(event.kind, event.text) for event in status.events] == [
        ("engine", "the engine process ended unexpectedly and was started again")
    ]
    assert (status.event_count, status.message) == (1, "")
    assert died < status.events[0].time < start
    assert after.coefficients.shape == (6, 5)
    assert wait_for(lambda: next_estimate(engine).true_contact.tolist() == [0.03, 0.06])
    assert wait_for(lambda: 0 < (scanned_of(engine) or 0) < 90)
    assert wait_for(lambda: engine.status().playing.speed == 0.0)


def deaths_apart(monkeypatch, seconds: float) -> None:
    """Let an engine be started anew each time so long after the last, by its own clock."""
    now, revive = [0.0], Engine.revive

    def revive_later(engine: Engine) -> None:
        now[0] += seconds
        revive(engine)

    monkeypatch.setattr(Engine, "revive", revive_later)
    clock = SimpleNamespace(monotonic=lambda: now[0])
    monkeypatch.setattr("kappaskin.live.engine.time", clock)


def test_the_third_death_within_ten_seconds_is_the_last_until_it_is_connected(
    own_engine, monkeypatch
) -> None:
    deaths_apart(monkeypatch, 4.9)
    engine = own_engine
    for deaths in (1, 2):
        killed(engine)
        assert engine.alive
        assert engine.status().event_count == deaths
    killed(engine)
    engine.revive()
    assert not engine.alive
    status = engine.status()
    assert (status.state, status.event_count) == (LOST, 3)
    assert status.message == status.events[-1].text
    assert "ended 3 times within 10 s" in status.message
    assert "fewer functions, then connect again" in status.message

    engine.connect("sim:")

    assert state(engine, STREAMING).event_count == 3
    killed(engine)
    assert engine.alive  # it is forgiven


def test_deaths_far_apart_are_survived_each_time(own_engine, monkeypatch) -> None:
    deaths_apart(monkeypatch, 5.1)
    for _ in range(4):
        killed(own_engine)
        assert own_engine.alive


def test_interrupted_from_the_keyboard_it_goes_on(own_engine) -> None:
    own_engine.connect("sim:")
    before = next_estimate(own_engine)
    assert own_engine.pid is not None
    os.kill(own_engine.pid, signal.SIGINT)
    assert wait_for(lambda: next_estimate(own_engine).sequence > before.sequence + 50)


# What is left

PARENT = """
import sys, time
from kappaskin import Region
from kappaskin.live import Engine

class Slow(Region):
    def __setstate__(self, state):
        time.sleep(60)

if __name__ == "__main__":
    engine = Engine()
    engine.connect(sys.argv[1])
    while engine.status().state != "streaming":
        time.sleep(0.01)
    if len(sys.argv) > 2:
        engine.scan(Slow())
        time.sleep(0.2)
    print(engine.pid, engine._ring.name, flush=True)
    sys.stdin.read()
    engine.close()
"""


def gone(pid: int) -> bool:
    """Whether a process ended, be it still a zombie because nobody asked for its exit code."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


@pytest.fixture
def parent(tmp_path, request) -> Iterator[tuple[subprocess.Popen[str], int, Path]]:
    """Another process with an engine, the pid of that engine and where its memory is listed."""
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    call = [sys.executable, str(script), "sim:", *getattr(request, "param", ())]
    with subprocess.Popen(call, text=True, **pipes) as process:
        assert process.stdout is not None
        pid, block = process.stdout.readline().split()
        yield process, int(pid), Path("/dev/shm", block)
        process.kill()


@pytest.mark.cases("parent0")
@pytest.mark.parametrize("parent", [[], ["computing"]], indirect=True)
def test_an_engine_whose_parent_was_killed_ends_within_a_second(parent) -> None:
    process, pid, block = parent
    assert not gone(pid)
    process.kill()
    start = time.monotonic()
    assert wait_for(lambda: gone(pid), within=3.0)
    print(f"the engine ended {time.monotonic() - start:.3f} s after its parent was killed")
    assert time.monotonic() - start < 1.0
    assert wait_for(lambda: not block.exists())


@pytest.mark.full
def test_a_parent_that_ends_as_it_should_leaves_nothing_and_says_nothing(parent) -> None:
    process, pid, block = parent
    _, errors = process.communicate("", timeout=30)
    assert process.returncode == 0
    assert errors == ""
    assert gone(pid)
    assert not block.exists()


def test_a_sensor_too_small_for_the_basis_gets_the_largest_that_fits_and_says_why(
    own_engine,
) -> None:
    own_engine.set_up(Setup(12, 11))
    own_engine.connect("sim:")

    estimate = next_estimate(own_engine)
    status = own_engine.status()

    # Eleven either way is two more than ten elements tell apart; the largest that fits is used.
    assert estimate.coefficients.shape == (status.setup.Ni, status.setup.Nj)
    assert max(estimate.coefficients.shape) == 10
    assert "use at most 10 x 10 functions" in status.refusal


def test_a_basis_refused_is_asked_for_again_when_another_device_comes(own_engine) -> None:
    own_engine.connect("sim:")
    next_estimate(own_engine)
    own_engine.set_up(Setup(12, 12))
    wait_for(lambda: own_engine.status().refusal)

    own_engine.connect("sim:line")
    status = wait_for(lambda: (s := own_engine.status()).source == "sim:line" and s.slot and s)

    assert "12 x 12" in status.refusal
    assert status.setup == Setup(10, 10)


def test_nothing_of_the_last_device_is_shown_as_the_next_ones(own_engine) -> None:
    own_engine.connect("sim:")
    next_estimate(own_engine)

    before = own_engine.status().generation
    own_engine.connect("sim:line")
    status = wait_for(lambda: (s := own_engine.status()).source == "sim:line" and s)

    estimate = own_engine.latest(status)
    assert estimate is None or estimate.generation > before


# A tare


AT_REST = replace(load_scene("centre"), stimuli=())
SLOW = replace(AT_REST, rate=4.0)
"""The twenty frames of a tare take five seconds."""


def tared(engine: Engine) -> TareStatus:
    """How the tare that is asked for now ends."""
    before = engine.status().tare.ended
    engine.tare()
    wait_for(lambda: engine.status().tare.ended > before)
    news = engine.status().tare
    assert news.ended == before + 1
    assert not news.taking
    return news


@pytest.mark.full
def test_a_tare_is_taken_used_and_its_drift_told(engine: Engine) -> None:
    engine.connect("sim:centre")
    engine.play(AT_REST)
    next_estimate(engine)
    time.sleep(0.1)  # until the load is gone

    news = tared(engine)
    assert news.tare is not None, news.refusal
    generation = engine.status().generation
    engine.set_up(Setup(tare=news.tare))
    next_estimate(engine, generation)
    drift = wait_for(lambda: (d := engine.status().drift) and math.isfinite(d.curvature) and d)

    assert drift
    assert drift.curvature < 0.05
    assert engine.status().setup.tare == news.tare


def test_a_loaded_skin_is_not_tared(engine: Engine) -> None:
    engine.connect("sim:centre")
    next_estimate(engine)

    news = tared(engine)

    assert news.tare is None
    assert news.refusal.startswith("the skin is loaded: ")
    assert news.refusal.endswith("without a load, or set its force to 0, then tare again")


def test_nothing_is_not_tared(engine: Engine) -> None:
    engine.disconnect()
    state(engine, OFF)

    assert tared(engine).refusal == "no readings arrive: connect a sensor, then tare"


def test_a_tare_ends_with_the_connection(engine: Engine) -> None:
    engine.connect("sim:centre")
    generation = next_estimate(engine).generation
    engine.play(SLOW)
    next_estimate(engine, generation)
    before = engine.status().tare.ended

    engine.tare()
    engine.disconnect()
    wait_for(lambda: engine.status().tare.ended > before)

    assert engine.status().tare.refusal == "the connection ended; connect again, then tare"


def test_a_recording_that_dies_with_its_engine_is_said_to_and_how_it_is_completed(
    own_engine, tmp_path
) -> None:
    engine, path = own_engine, tmp_path / "a b.mcap"
    engine.record(path)
    engine.connect("sim:centre")
    assert wait_for(lambda: engine.status().recording.messages)
    assert engine.pid is not None
    os.kill(engine.pid, signal.SIGKILL)
    broken_off = state(engine, LOST).recording
    assert not broken_off.active
    assert broken_off.trouble == (
        "the recording a b.mcap broke off: the engine process ended unexpectedly; "
        f"`kappaskin repair '{path}.part' --out '{path}'` completes the file"
    )

    engine.revive()

    assert engine.status().recording == broken_off
    assert wait_for(lambda: engine.status().recording.path.endswith("a b-2.mcap"))
    assert engine.status().recording.trouble == ""
    engine.record(None)
    assert wait_for((tmp_path / "a b-2.mcap").exists)


def test_one_whose_file_was_complete_when_its_engine_died_is_not_said_to_be_broken(
    tmp_path,
) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"complete")
    assert RecordingStatus(str(path), active=True).broken_off() == RecordingStatus(str(path))


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no process can be stopped")
def test_one_that_hangs_is_said_to_and_connecting_replaces_it(own_engine, monkeypatch) -> None:
    engine = own_engine
    engine.connect("sim:centre")
    next_estimate(engine)
    pid = engine.pid
    assert pid is not None
    monkeypatch.setattr("kappaskin.live.engine._SILENT", 0.3)
    os.kill(pid, signal.SIGSTOP)
    try:
        assert wait_for(lambda: engine.status().message)
        status = engine.status()
        assert "the engine process has not reported for 0 s; connect again" in status.message
        assert (status.state, status.rate) == (STREAMING, 0.0)
    finally:
        os.kill(pid, signal.SIGCONT)
    assert wait_for(lambda: not engine.status().message)
    assert engine.status().rate > 0

    os.kill(pid, signal.SIGSTOP)
    assert wait_for(lambda: engine.status().message)
    engine.connect("sim:line")
    assert engine.pid != pid
    assert wait_for(lambda: engine.status().source == "sim:line")
    assert state(engine, STREAMING).message == ""


@pytest.mark.full
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no process can be stopped")
def test_one_that_hangs_while_it_prepares_a_setup_is_said_to(own_engine, monkeypatch) -> None:
    engine = own_engine
    engine.connect("sim:centre")
    next_estimate(engine)
    engine.set_up(Setup(Ni=36, Nj=36, method="tracking"))
    assert wait_for(lambda: engine.status().computing)
    monkeypatch.setattr("kappaskin.live.engine._SILENT", 0.3)
    assert engine.pid is not None
    os.kill(engine.pid, signal.SIGSTOP)
    try:
        assert wait_for(lambda: "has not reported" in engine.status().message)
    finally:
        os.kill(engine.pid, signal.SIGCONT)


def test_a_tare_that_dies_with_its_engine_is_said_to(own_engine) -> None:
    engine = own_engine
    engine.connect("sim:centre")
    generation = next_estimate(engine).generation
    engine.play(SLOW)
    next_estimate(engine, generation)
    engine.tare()
    assert wait_for(lambda: engine.status().tare.taking)
    assert engine.pid is not None
    os.kill(engine.pid, signal.SIGKILL)
    state(engine, LOST)

    engine.revive()

    assert wait_for(lambda: engine.status().tare.ended == 1)
    assert engine.status().tare.refusal == "the engine ended during the tare; tare again"


def test_a_scene_that_warms_tells_its_temperature(engine: Engine) -> None:
    engine.connect("sim:hot-room")
    next_estimate(engine)
    wait_for(lambda: math.isfinite(engine.status().temperature))
    assert engine.status().temperature >= 20.0

    engine.connect("sim:centre")
    next_estimate(engine)
    wait_for(lambda: math.isnan(engine.status().temperature))
    assert math.isnan(engine.status().temperature)
