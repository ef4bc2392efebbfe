from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from PySide6.QtWidgets import QApplication

from kappaskin import Calibration, Estimate, Refusal, Setup, Simulator, Status, Tare, load_scene
from kappaskin.calibration.calibration import fingerprint
from kappaskin.scenes.cylinders import RADII, CylinderStep, Presentation
from kappaskin.scenes.effects import Tolerance
from kappaskin_app.features.calibration.controller import CalibrationController, parsed_radii
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.history import History
from kappaskin_app.shell.settings import Settings

THREE = (0.1, 0.05, 0.02)
SCENE = load_scene("calibration")


@dataclass
class Bench:
    """A calibration of a simulated skin that reads without waiting."""

    controller: CalibrationController
    history: History
    now: float
    status: Status
    laid: list[CylinderStep | None]
    simulator: Simulator
    frame: int = 0

    def tell(self, **changed: object) -> None:
        self.status = replace(self.status, **changed)  # pyright: ignore[reportArgumentType]
        self.controller.follow(self.status)

    def read(self, n: int = 60, blank: bool = False, ago: float = 0.0) -> None:
        """Let the next `n` estimates come, 50 a second."""
        step = next((step for step in reversed(self.laid) if step), None) or CylinderStep(1)
        self.simulator.change(replace(SCENE, laid=Presentation((step,), 1.0)))
        sensor = SCENE.sensor()
        for _ in range(n):
            self.frame, self.now = self.frame + 1, self.now + 0.02
            frame = self.simulator.scanned(sensor.scan(), self.frame, self.now - ago, lambda: 0.0)
            k = sensor.nominal(frame).reshape(3, -1)
            k = np.full_like(k, np.nan) if blank else k
            estimate = SimpleNamespace(
                generation=1, device_time=frame.device_time, host_time=self.now, curvature=k
            )
            self.controller.receive(cast("Estimate", estimate))


@pytest.fixture
def bench(qapp: QApplication) -> Bench:
    history, laid = History(Settings()), []
    made = Bench(cast("Any", None), history, 100.0, Status(), laid, Simulator(SCENE))
    made.controller = CalibrationController(history, Tasks(qapp), clock=lambda: made.now)
    made.controller.step_requested.connect(laid.append)
    made.tell(state="streaming", sensor=SCENE.sensor(), connections=1, generation=1)
    return made


def done(bench: Bench, until: Callable[..., None]) -> None:
    def told() -> bool:
        bench.controller.follow(bench.status)
        return not bench.controller.computing

    until(told)


def test_radii_are_a_list_in_millimetres() -> None:
    assert parsed_radii("100, 50;20.5") == pytest.approx((0.1, 0.05, 0.0205))
    with pytest.raises(Refusal, match="radii in mm"):
        parsed_radii("100, fifty")


@pytest.mark.parametrize(
    ("radii", "seconds", "why"),
    [
        ((0.1, 0.05), 1.0, "at least 3"),
        ((0.1, 0.05, -0.02), 1.0, "above zero"),
        ((0.1, 0.05, float("nan")), 1.0, "above zero"),
        ((0.1, 0.05, 0.01), 1.0, "elastic limit"),
        (THREE, 0.0, "a time above zero"),
    ],
)
def test_invalid_settings_are_refused(
    bench: Bench, radii: tuple[float, ...], seconds: float, why: str
) -> None:
    bench.controller.begin(radii, seconds)
    assert why in bench.controller.message
    assert bench.controller.procedure is None
    assert bench.laid == []


def test_a_start_without_a_sensor_is_refused(bench: Bench) -> None:
    bench.tell(state="off", sensor=None)
    bench.controller.begin(THREE, 1.0)
    assert "no sensor is connected" in bench.controller.message


def test_a_step_averages_the_readings_of_its_time_and_goes_on(bench: Bench) -> None:
    controller = bench.controller
    controller.begin(THREE, 1.0)
    bench.read(20)
    assert not controller.capturing
    controller.capture()
    bench.read(55)
    assert controller.capturing
    assert 0.8 < controller.share < 1
    bench.read(8)
    assert not controller.capturing
    assert controller.step is not None
    assert controller.step.number == 2
    assert controller.procedure is not None
    assert 49 <= controller.procedure.taken[0].frames <= 52
    assert bench.laid[-1] == controller.step


def test_readings_with_a_calibration_or_of_another_setup_do_not_count(bench: Bench) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.1)
    controller.capture()
    bench.tell(setup=Setup(calibration=cast("Calibration", object())))
    bench.read(40)
    assert controller.capturing
    bench.tell(setup=Setup(), generation=2)
    bench.read(40)
    assert controller.capturing
    bench.tell(generation=1)
    bench.read(40)
    assert not controller.capturing


def test_the_last_step_can_be_taken_again(bench: Bench) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.2)
    controller.redo()
    controller.capture()
    bench.read()
    controller.capture()
    controller.redo()
    assert not controller.capturing
    assert controller.step is not None
    assert controller.step.number == 1
    assert bench.laid[-1] == controller.step


def test_a_step_on_the_rails_is_refused_and_asked_for_again(bench: Bench) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.2)
    controller.capture_all()
    bench.read(30, blank=True)
    assert "every channel is dead or saturated" in controller.message
    assert controller.message.endswith("Repeat this step.")
    assert not controller.automatic
    assert controller.step is not None
    assert controller.step.number == 1


def test_a_step_without_readings_is_given_up(bench: Bench) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.2)
    controller.capture()
    bench.now += 6.0
    bench.tell()
    assert "no reading for" in controller.message.lower()
    assert not controller.capturing
    assert controller.procedure is not None


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"connections": 2}, "another device"),
        ({"state": "lost", "message": "unplugged"}, "unplugged"),
        ({"state": "off"}, "connection ended"),
    ],
)
def test_another_device_or_none_ends_the_procedure(
    bench: Bench, changed: dict[str, object], why: str
) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.2)
    controller.capture()
    bench.read(5)
    bench.tell(**changed)
    assert why in controller.message.lower()
    assert controller.procedure is None
    assert not controller.capturing
    assert bench.laid[-1] is None


def test_a_reading_that_was_overtaken_is_left_out_and_costs_no_step(bench: Bench) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.2)
    controller.capture()
    bench.read(20)
    bench.read(1, ago=0.05)
    bench.read(40)
    assert controller.procedure is not None
    assert [taken.step.number for taken in controller.procedure.taken] == [1]


@pytest.mark.parametrize("before", [0, 5])
def test_a_device_that_restarts_ends_the_procedure(bench: Bench, before: int) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.2)
    controller.capture()
    bench.read()
    controller.capture()
    bench.read(10 + before)
    bench.read(40, ago=90.0)
    assert "restarted" in controller.message
    assert controller.procedure is None


def test_a_hold_is_requested_only_with_its_capture(bench: Bench) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.2, hold=2.0)
    controller.capture()
    bench.read()
    assert controller.step is not None
    assert controller.step.hold == 2.0
    assert bench.laid[-1] != controller.step
    hold = controller.step
    controller.capture()
    assert bench.laid[-1] == hold
    bench.read(90)
    assert controller.capturing
    bench.read(15)
    assert not controller.capturing


@pytest.mark.full
def test_unattended_steps_make_a_calibration_that_can_be_used_undone_saved_and_loaded(
    bench: Bench, until: Callable[..., None], tmp_path: Path
) -> None:
    controller, history = bench.controller, bench.history
    controller.begin(RADII[::2], 0.2)
    controller.capture_all()
    while controller.step is not None:
        bench.read(5)
    done(bench, until)
    assert controller.procedure is None
    assert bench.laid[-1] is None
    result = controller.result
    assert result is not None
    assert result.report.passed.all()
    tolerance = next(e for e in SCENE.effects if isinstance(e, Tolerance))
    gain, _ = tolerance.errors((300,))
    np.testing.assert_allclose(result.report.calibration.gain / gain, 1.0, atol=0.1)
    controller.use()
    used = history.settings.calibration
    assert used == result.report.calibration
    history.stack.undo()
    assert history.settings.calibration is None
    controller.save(tmp_path / "it.toml")
    assert controller.message == ""
    assert controller.done == f"saved as {tmp_path / 'it.toml'}"
    controller.load(tmp_path / "it.toml")
    assert history.settings.calibration == used
    assert not controller.done
    controller.stop_using()
    assert history.settings.calibration is None
    history.stack.undo()
    assert history.settings.calibration == used


@pytest.mark.fails_inside
def test_a_computation_that_fails_ends_the_procedure_and_is_told(
    bench: Bench, until: Callable[..., None], monkeypatch: pytest.MonkeyPatch, caplog
) -> None:
    def fails(*_: object) -> None:
        raise ValueError("no such gain")

    monkeypatch.setattr("kappaskin_app.features.calibration.controller.calibrate", fails)
    controller = bench.controller
    controller.begin(RADII[::2], 0.2)
    controller.capture_all()
    while controller.step is not None:
        bench.read(5)
    done(bench, until)
    assert caplog.text.count("ValueError: no such gain") == 1
    assert controller.procedure is None
    assert bench.laid[-1] is None
    assert controller.message == "No calibration: no such gain."


def test_a_file_that_is_no_calibration_of_this_sensor_is_refused(
    bench: Bench, tmp_path: Path
) -> None:
    path = tmp_path / "it.toml"
    path.write_text("damaged")
    bench.controller.load(path)
    assert "it.toml" in bench.controller.file_refused
    assert bench.history.settings.calibration is None
    bench.tell(sensor=None)
    bench.controller.load(path)
    assert "no sensor is connected" in bench.controller.file_refused
    bench.tell(sensor=SCENE.sensor())
    bench.controller.begin(THREE, 0.2)
    assert not bench.controller.file_refused


def test_cancelling_discards_the_captured_steps(bench: Bench) -> None:
    controller = bench.controller
    controller.begin(THREE, 0.2)
    controller.capture()
    bench.read()
    controller.cancel()
    assert controller.procedure is None
    assert controller.result is None
    assert bench.laid[-1] is None


def test_readings_of_a_tared_sensor_do_not_count(bench: Bench) -> None:
    offset = np.zeros(SCENE.sensor().channels)
    name, number = SCENE.sensor().name, SCENE.sensor().serial_number
    layout, now = fingerprint(SCENE.sensor().layout), datetime.now(UTC)
    tare = Tare(name, number, layout, now, None, 500, 1.0, offset, offset)
    bench.controller.begin(THREE, 1.0)
    bench.controller.capture()
    bench.tell(setup=Setup(tare=tare))

    bench.read()

    assert bench.controller.capturing
