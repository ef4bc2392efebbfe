"""Calibration page: a calibration captured and used in the window."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Calibration, Patch, SensorLayout
from kappaskin.calibration.calibration import fingerprint
from kappaskin_app.features.calibration.pages import StartPage
from kappaskin_app.shell.window import MainWindow


@pytest.mark.full
def test_a_refused_file_is_told_where_files_are_loaded(window, tmp_path: Path) -> None:
    window.calibration.load(tmp_path / "none.toml")
    assert "none.toml" in window.in_use.message.text()
    assert not window.calibrate.message.text()


def test_cylinders_are_refused_for_a_sensor_of_heights_in_one_sentence(qapp) -> None:
    page = StartPage()
    page.show_plan(SensorLayout.regular(Patch(0.06, 0.06), 4, 4).reading_each(["height"]))
    assert page.plan.text() == (
        "Expected a curvature sensor for a calibration with cylinders: xx, yy and xy of every "
        "element; got readings of height."
    )
    page.deleteLater()


def _error(window: MainWindow, until: Callable[..., None]) -> float:
    """RMS error of the shape in m, over the next estimates."""
    found: list[float] = []
    window.session.estimated.connect(lambda estimate: found.append(estimate.error_rms))
    until(lambda: len(found) > 40)
    return float(np.median(found))


@pytest.mark.full
def test_a_calibration_taken_in_the_window_mends_the_shape(
    opened: Callable[[str], MainWindow],
    until: Callable[..., None],
    colours_in: Callable[..., int],
) -> None:
    window = opened("sim:centre")
    until(lambda: len(window.membrane.ages) > 3 and window.session.estimate is not None)
    window.history.change("Spoil", loops="second", tolerance=0.1)
    until(lambda: window.session.estimate.error_rms > 1e-4)  # of 16 um before
    nominal = _error(window, until)
    panel = window.calibrate
    window.panels.reveal(panel)
    panel.start.radii.setText("150, 80, 45")
    panel.start.seconds.setValue(0.1)
    panel.start.begin.click()
    assert panel.steps.capture.isVisible()
    panel.steps.all.click()
    until(lambda: panel.result_page.use.isVisible(), 240.0)
    assert "of 300 channels pass" in panel.result_page.passed.text()
    for view in (panel.result_page.map, panel.result_page.plot):
        assert colours_in(window, view) > 3
    panel.result_page.use.click()
    until(lambda: window.session.status.setup.calibration is not None)
    calibrated = _error(window, until)
    assert calibrated < 0.2 * nominal
    assert "channels" in window.connection.device.text()
    window.history.stack.undo()
    until(lambda: window.session.status.setup.calibration is None)
    assert _error(window, until) > 0.8 * nominal


@pytest.mark.full
def test_a_calibration_rests_while_another_skin_is_connected(
    window: MainWindow, until: Callable[..., None]
) -> None:
    sensor, ones = window.session.scene.sensor(), np.ones(300)
    window.history.change(
        "Use",
        calibration=Calibration(
            sensor.name,
            sensor.serial_number,
            "",
            fingerprint(sensor.layout),
            datetime.now(UTC),
            *(ones, 0 * ones, ones, ones),
        ),
    )
    until(lambda: window.session.status.setup.calibration is not None)
    window.history.change("Fewer", elements_x=8)
    until(lambda: window.session.status.setup.calibration is None)
    until(lambda: window.session.estimate is not None)
    until(lambda: "Not in use" in window.in_use.message.text())
    window.history.stack.undo()
    until(lambda: window.session.status.setup.calibration is not None)
