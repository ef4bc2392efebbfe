"""Calibrating from a source: simulated, on a pseudo-terminal, and with a person at the rig."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kappaskin import Frame, Refusal, SensorLayout, Simulator, load_scene
from kappaskin.calibration import Calibration, calibrate, take_sweep, take_weights
from kappaskin.calibration.calibration import GRAVITY
from kappaskin.errors import SourceError
from kappaskin.mechanics import DiscLoad
from kappaskin.scenes.cylinders import ADVICE, Presentation, schedule
from kappaskin.scenes.effects import Creep, GaussianNoise, ReadingEffect, Size, Survey, Tolerance

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from kappaskin.sources import PseudoDevice

pytestmark = pytest.mark.slow

RADII = (0.1, 0.05, 0.025, 0.015)
STEPS = schedule(RADII)
SCENE = load_scene("calibration")
TOLERANCE = next(effect for effect in SCENE.effects if isinstance(effect, Tolerance))
FAST = ("--radii", "100,50,25,15", "--seconds", "0.05")


def refused(found: tuple[int, str, str], reason: str, folder: Path) -> None:
    code, printed, told = found
    assert (code, printed) == (2, "")
    assert re.search(f"(?m)^kappaskin: .*{reason}", told), told
    assert "Traceback" not in told
    assert list(folder.iterdir()) == []


# A simulated source


def test_a_simulation_lays_itself_on_every_cylinder(run, tmp_path) -> None:
    code, printed, told = run("calibrate", "sim:calibration", "--out", tmp_path / "s.toml", *FAST)

    assert code == 0
    assert "Simulated skin SIM-0001: 300 of 300 channels passed" in printed
    assert told.count("\n    xx ") == len(STEPS) == 55
    assert "4/55  Cylinder of radius 100 mm, bent along x, inner face on it" in told
    gain, offset = TOLERANCE.errors((300,))
    found = Calibration.read(tmp_path / "s.toml")
    # Each mean is of 11 frames: 0.07 1/m, over curvatures of up to 67 1/m, half of it for twist.
    np.testing.assert_allclose(found.gain[:200], gain[:200], atol=0.01)
    np.testing.assert_allclose(found.offset, offset, atol=0.4)
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


def test_json_tells_every_channel_and_nothing_else(run, tmp_path) -> None:
    out = tmp_path / "s.toml"
    code, printed, _ = run("calibrate", "sim:calibration", "--out", out, "--json", *FAST)
    found = json.loads(printed)
    assert code == 0
    assert (found["passed"], found["failed"], len(found["channels"])) == (300, 0, 300)
    assert found["channels"][0]["gain"] == Calibration.read(out).gain[0]


def test_a_hold_tells_the_creep_that_a_scene_has(run, tmp_path, monkeypatch) -> None:
    creeping = replace(SCENE, effects=(Creep(0.05, 2.0), *SCENE.effects[1:]))
    monkeypatch.setattr("kappaskin.calibration.sweep.load_scene", lambda *_: creeping)
    out = tmp_path / "s.toml"
    _, printed, told = run("calibrate", "sim:creeping", "--out", out, "--hold", "10", *FAST)
    assert "held for 10 s" in told
    assert "creep      5.0 % in 2" in printed
    assert Calibration.read(out).creep.time_constant == pytest.approx(2.0, rel=0.03)


def test_a_channel_that_fails_gives_1_and_a_file_without_it(run, tmp_path, monkeypatch) -> None:
    class Broken(ReadingEffect):
        name, formula = "broken", "none"

        def size(self, survey: Survey) -> Size:
            return Size(1.0, 1.0)

        def start(self, shape: tuple[int, ...], _: object) -> Any:
            alive = np.arange(np.prod(shape)).reshape(shape) != 217
            return lambda curvature, _: curvature * alive

    broken = replace(SCENE, effects=(Broken(), GaussianNoise(0.2)))
    monkeypatch.setattr("kappaskin.calibration.sweep.load_scene", lambda *_: broken)
    out = tmp_path / "s.toml"

    code, printed, _ = run("calibrate", "sim:broken", "--out", out, *FAST)

    assert code == 1
    assert "299 of 300 channels passed" in printed
    assert "failed     xy of element 17: gain" in printed
    assert np.flatnonzero(np.isnan(Calibration.read(out).gain)).tolist() == [217]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("--radii", "100,50"), "at least 3 different radii, got 2"),
        (("--radii", "100,fifty,25"), "radii in millimetres such as 100,50,25"),
        (("--radii", ""), "radii in millimetres such as 100,50,25"),
        (("--radii", "100,50,10"), "radius 10 mm strains the gages"),
        (("--radii", "100,50,0"), "radii above zero"),
        (("--seconds", "0"), "seconds above zero"),
        (("--seconds", "nan"), "seconds above zero"),
        (("--seconds", "0.004"), "at least 2 frames|was missed"),
        (("--seconds", "1e9"), "seconds above zero and at most 3600 s"),
        (("--dwell", "-1"), "dwell above zero"),
        (("--hold", "-1"), "hold above zero"),
        (("--hold", "inf"), "hold above zero and at most 3600 s"),
    ],
)
def test_what_cannot_be_done_is_refused_and_leaves_no_file(run, tmp_path, arguments, reason):
    found = run("calibrate", "sim:calibration", "--out", tmp_path / "s.toml", *arguments)
    refused(found, reason, tmp_path)


def test_a_place_that_cannot_be_written_to_is_refused_before_any_work(run, tmp_path) -> None:
    found = run("calibrate", "sim:calibration", "--out", tmp_path / "no" / "s.toml")
    refused(found, "expected a file in a folder that exists", tmp_path)
    assert "Cylinder" not in found[2]


def test_an_amplifier_that_is_too_strong_is_refused_with_the_remedy(run, tmp_path) -> None:
    file, radii = tmp_path / "s.toml", ("--radii", "100,50,33,25")
    found = run("calibrate", "sim:circle", "--out", file, "--seconds", "0.05", *radii)
    refused(found, "onto their rails; use radii of at least .* or lower the amplifier", tmp_path)
    assert "Cylinder" not in found[2]


def test_left_out_the_radii_are_those_that_the_sensor_reads(run, tmp_path) -> None:
    code, printed, told = run("calibrate", "sim:", "--out", tmp_path / "s.toml", "--seconds", "0.1")
    assert code == 0
    assert "300 of 300 channels passed" in printed
    assert "2/67  Cylinder of radius 35 mm" in told


def test_dwell_is_refused_for_a_scene_without_cylinders(run, tmp_path) -> None:
    found = run("device", "circle", "--dwell", "1")
    refused(found, "the scene circle has no cylinders to dwell on", tmp_path)


# A person at the rig


class Rig:
    """A skin that lies where a person put it last; knows what is asked and answers as scripted."""

    def __init__(self, steps=STEPS, answers: dict[int, list[str]] | None = None) -> None:
        scene = replace(SCENE, layout=SensorLayout.regular(SCENE.plate.patch, 4, 4))
        self.scene = replace(scene, rate=2000.0, effects=(GaussianNoise(0.05),))
        self.steps, self.answers = steps, answers or {}
        self.sensor, self.trouble = self.scene.sensor(), ""
        self.lies, self.n, self.closed = 0, 0, False
        self.asked: list[str] = []
        self.told: list[str] = []
        self._laid(0)

    def _laid(self, index: int) -> None:
        laid = Presentation((self.steps[index],), 1.0)
        scene = replace(self.scene, laid=laid)
        if self.n:
            self._simulator.change(scene)
        else:
            self._simulator = Simulator(scene)

    def ask(self, question: str) -> str:
        self.asked.append(question)
        number = int(question.split("/")[0])
        answers = self.answers.get(number, [])
        answer = answers.pop(0) if answers else "\n"
        if answer.strip() != "r":
            self._laid(number - 1)
        return answer

    def read(self, timeout: float) -> list[Frame]:
        frames = [self._simulator.frame(self.n + k, time.monotonic) for k in range(8)]
        self.n += 8
        return frames

    def close(self) -> None:
        self.closed = True


def guided(rig: Rig, monkeypatch, **options):
    monkeypatch.setattr("kappaskin.calibration.sweep.open_source", lambda _: rig)
    options = {"seconds": 0.004} | options
    return take_sweep("a port", RADII, rig.ask, rig.told.append, **options)


def test_a_person_is_asked_for_each_cylinder_and_shown_what_was_read(monkeypatch) -> None:
    rig = Rig()
    sensor, sweep = guided(rig, monkeypatch)

    assert rig.closed
    assert len(rig.asked) == 55
    assert rig.asked[0] == (
        "1/55  Flat table, nothing pressing on the skin: press Enter when at rest: "
    )
    assert rig.asked[1].endswith("or r and Enter to repeat the last step: ")
    assert rig.told[0] == ADVICE
    assert re.match(r" +xx \+\d+\.\d \(cylinder \+10\.0\), .* noise 0\.0\d", rig.told[4])
    expected = np.repeat(sweep.curvature, 16, axis=1)
    assert np.abs(sweep.readings - expected).max() < 0.3
    report = calibrate(sweep, sensor, datetime.now(UTC))
    assert report.passed.all()
    assert "48 of 48 channels passed" in report.summary()[0]


def test_a_frame_that_another_overtook_spoils_no_step(monkeypatch) -> None:
    class Overtaken(Rig):
        def read(self, timeout: float) -> list[Frame]:
            frames = super().read(timeout)
            if self.n < 100:
                frames[3], frames[4] = frames[4], frames[3]
            return frames

    rig = Overtaken()

    guided(rig, monkeypatch)

    assert not any("clock went back" in told for told in rig.told)


def test_redo_takes_the_last_step_again(monkeypatch) -> None:
    rig = Rig(answers={3: ["r\n"], 4: ["R\n"]})
    _, sweep = guided(rig, monkeypatch)
    asked = [int(question.split("/")[0]) for question in rig.asked]
    assert asked[:8] == [1, 2, 3, 2, 3, 4, 3, 4]
    assert np.abs(sweep.readings - np.repeat(sweep.curvature, 16, axis=1)).max() < 0.3


def test_a_reading_that_cannot_be_used_is_asked_for_again(monkeypatch) -> None:
    rig = Rig()
    take, refusals = rig.read, []

    def once_on_the_rails(timeout: float) -> list[Frame]:
        frames = take(timeout)
        if len(rig.asked) == 2:
            refusals.append(1)
            frames = [replace(frame, counts=frame.counts * 0 + 32767) for frame in frames]
        return frames

    rig.read = once_on_the_rails
    guided(rig, monkeypatch)
    asked = [int(question.split("/")[0]) for question in rig.asked]
    assert asked[:4] == [1, 2, 2, 3]
    assert any("every channel is dead or saturated" in line for line in rig.told)
    assert refusals


def test_what_was_read_before_enter_does_not_count(monkeypatch) -> None:
    rig = Rig()
    take = rig.read

    def with_old_ones(timeout: float) -> list[Frame]:
        fresh = take(timeout)
        stale = replace(fresh[0], host_time=fresh[0].host_time - 60, counts=fresh[0].counts + 9999)
        return [stale, *fresh]

    rig.read = with_old_ones
    _, sweep = guided(rig, monkeypatch)
    assert np.abs(sweep.readings - np.repeat(sweep.curvature, 16, axis=1)).max() < 0.3


def test_a_device_that_falls_silent_is_refused(monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.calibration.sweep._SILENCE", 0.05)
    rig = Rig()
    take = rig.read
    rig.read = lambda timeout: take(timeout) if len(rig.asked) < 5 else time.sleep(0.01) or []
    with pytest.raises(Refusal, match=r"no frame for .* is sending"):
        guided(rig, monkeypatch)
    assert rig.closed


def test_a_frame_that_came_while_this_process_stood_still_is_no_silence(monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.calibration.sweep._SILENCE", 0.05)
    rig = Rig()
    take, naps = rig.read, [0.1]
    rig.read = lambda timeout: time.sleep(naps.pop() if naps else 0.0) or take(timeout)
    guided(rig, monkeypatch)
    assert len(rig.asked) == 55


def test_another_device_in_the_middle_is_refused(monkeypatch) -> None:
    rig = Rig()
    ask = rig.ask

    def swapped(question: str) -> str:
        if question.startswith("4/"):
            rig.sensor = rig.scene.sensor()
        return ask(question)

    rig.ask = swapped
    with pytest.raises(Refusal, match="another device was connected meanwhile"):
        guided(rig, monkeypatch)


def test_a_line_that_is_lost_in_the_middle_is_refused(monkeypatch) -> None:
    rig = Rig()
    take = rig.read

    def lost(timeout: float) -> list[Frame]:
        if len(rig.asked) == 7:
            rig.trouble = "a port: the line is gone"
        return take(timeout)

    rig.read = lost
    with pytest.raises(SourceError, match="the line is gone"):
        guided(rig, monkeypatch)
    assert rig.closed


# A device that goes through the steps by itself, on a pseudo-terminal


@contextmanager
def serving(dwell: float, steps=STEPS) -> Iterator[PseudoDevice]:
    device = PseudoDevice(replace(SCENE, laid=Presentation(steps, dwell)))
    stop = threading.Event()
    thread = threading.Thread(target=device.serve, args=(stop.is_set,))
    thread.start()
    try:
        yield device
    finally:
        stop.set()
        thread.join(30.0)
        device.close()


@pytest.mark.full
def test_a_device_on_the_line_is_calibrated_within_the_standard_errors(run, tmp_path) -> None:
    out = tmp_path / "s.toml"
    with serving(dwell=0.05, steps=schedule()) as device:
        code, printed, told = run("calibrate", device.port, "--out", out, "--dwell", 0.05)
    assert code == 0, told
    assert "300 of 300 channels passed" in printed
    found = Calibration.read(out)
    gain, offset = TOLERANCE.errors((300,))
    for read, sd, true in (
        (found.gain, found.gain_sd, gain),
        (found.offset, found.offset_sd, offset),
    ):
        within = np.mean(np.abs(read - true) < 1.96 * sd)
        assert within > 0.95 - 4 * np.sqrt(0.95 * 0.05 / 300)


WEIGHTS = ("--weights", "5,10,20,10,5")


@pytest.mark.full
def test_known_weights_extend_a_calibration_and_their_figures_are_printed(run, tmp_path) -> None:
    first, out = tmp_path / "first.toml", tmp_path / "s.toml"
    assert run("calibrate", "sim:calibration", "--out", first, *FAST)[0] == 0
    more = ("--calibration", first, "--json")
    code, printed, told = run("calibrate", "sim:calibration", "--out", out, *WEIGHTS, *more)
    assert code == 0, told
    assert told.count("a contact at (") == 5
    found, before = Calibration.read(out), Calibration.read(first)
    assert np.array_equal(found.gain, before.gain, equal_nan=True)
    assert json.loads(printed)["rigidity"] == found.weights.rigidity
    assert found.weights.rigidity == pytest.approx(SCENE.plate.rigidity, rel=0.03)


@pytest.mark.full
def test_without_a_calibration_known_weights_take_the_readings_as_they_are(run, tmp_path) -> None:
    out = tmp_path / "s.toml"
    code, printed, told = run("calibrate", "sim:centre", "--out", out, *WEIGHTS)
    assert code == 0, told
    assert "passed: the fit to the others estimates every weight within 5 %" in printed
    assert (Calibration.read(out).gain == 1.0).all()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("--weights", "5,10"), "expected at least 3 weights"),
        (("--weights", "5,ten,20"), "expected masses in grams such as"),
        (("--weights", "5000,1,1"), "missing|no contact"),
        (("--weights", "5,10,20", "--radii", "100,50,25"), "expected weights alone"),
        (("--weights", "5,10,20", "--hold", "5"), "expected weights alone"),
        (("--weights", "5,10,20", "--seconds", "0"), "expected seconds above zero"),
        (("--weights", "5,10,20", "--calibration", "none.toml"), "none.toml"),
        (("--calibration", "none.toml"), "expected --calibration together with --weights"),
    ],
)
def test_weights_that_make_no_sense_are_refused(run, tmp_path, arguments, reason) -> None:
    found = run("calibrate", "sim:centre", "--out", tmp_path / "s.toml", *arguments)
    refused(found, reason, tmp_path)


class Scales(Rig):
    """A rig whose person lays a weight on another place at each step."""

    def _laid(self, index: int) -> None:
        places = ((0.05, 0.05), (0.03, 0.04), (0.07, 0.06))
        loads = [DiscLoad(*places[index - 1], radius=3e-3, force=0.05)] if index else []
        scene = replace(self.scene, laid=None).touched_by(*loads)
        if self.n:
            self._simulator.change(scene)
        else:
            self._simulator = Simulator(scene)

    def ask(self, question: str) -> str:
        self.asked.append(question)
        number = int(question.split("/")[0])
        answers = self.answers.get(number, [])
        answer = answers.pop(0) if answers else "\n"
        if answer.strip() != "r":
            self._laid(0 if answer == "forgot\n" else number)
        return answer


def test_a_person_lays_weights_on_forgets_one_and_repeats_another(monkeypatch) -> None:
    rig = Scales(answers={1: ["forgot\n"], 3: ["r\n"]})
    monkeypatch.setattr("kappaskin.calibration.weights.open_source", lambda _: rig)
    masses = (0.05e3 / GRAVITY,) * 3
    _, known = take_weights("a port", masses, rig.ask, rig.told.append, seconds=0.02)
    assert rig.closed
    assert [int(question.split("/")[0]) for question in rig.asked] == [0, 1, 1, 2, 3, 2, 3]
    assert any("no contact was found" in line and "repeat" in line for line in rig.told)
    assert known.rigidity == pytest.approx(SCENE.plate.rigidity, rel=0.03)


def test_a_device_whose_line_is_lost_in_the_middle_leaves_no_file(run, tmp_path) -> None:
    device = PseudoDevice(replace(SCENE, laid=Presentation(STEPS, 0.05)))
    thread = threading.Thread(target=device.serve, args=(lambda: device.samples > 200,))
    thread.start()
    closer = threading.Thread(target=lambda: (thread.join(), device.close()))
    closer.start()
    found = run("calibrate", device.port, "--out", tmp_path / "s.toml", "--dwell", 0.05, *FAST[:2])
    closer.join()
    refused(found, "connection lost", tmp_path)
    assert "3/55" in found[2]


def test_a_device_that_is_already_on_its_way_is_refused(run, tmp_path) -> None:
    with serving(dwell=0.05) as device:
        line, end = os.open(device.port, os.O_RDWR | os.O_NOCTTY), time.monotonic() + 30.0
        while device.samples < 0.2 * SCENE.rate and time.monotonic() < end:
            time.sleep(0.01)
        os.close(line)
        out = tmp_path / "s.toml"
        found = run("calibrate", device.port, "--out", out, "--dwell", 0.05, *FAST[:2])
    refused(found, "step 1 was missed: the device is at step.*restart it", tmp_path)


def started(port: str, out: Path, **streams: Any) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "kappaskin", "calibrate", port, "--out", str(out)]
    return subprocess.Popen(
        command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **streams
    )


def test_closed_standard_input_is_refused_with_what_to_do(tmp_path) -> None:
    with serving(dwell=1.0) as device:
        process = started(device.port, tmp_path / "s.toml", stdin=subprocess.DEVNULL)
        printed, told = process.communicate(timeout=60)
    assert "1/103  Flat table" in told
    code = process.returncode
    refused(
        (code, printed, told),
        "standard input ended before the last step",
        tmp_path,
    )


def test_ctrl_c_stops_it_and_leaves_no_file(tmp_path) -> None:
    with serving(dwell=1.0) as device:
        process = started(device.port, tmp_path / "s.toml", stdin=subprocess.PIPE)
        assert process.stderr is not None
        assert ADVICE in process.stderr.readline()
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        printed, told = process.communicate(timeout=30)
    found = (process.returncode, printed, told)
    refused(found, "stopped before the last step; nothing was written", tmp_path)
