"""Known weights laid on and used in the window."""

from collections.abc import Callable
from pathlib import Path

import pytest

from kappaskin import Calibration
from kappaskin_app.shell.window import MainWindow


@pytest.fixture
def weighing(window: MainWindow, until: Callable[..., None]) -> MainWindow:
    """A window with the panel shown, and an estimate."""
    until(lambda: window.session.estimate is not None)
    window.panels.reveal(window.weights)
    window.weights.start.seconds.setValue(0.1)
    return window


@pytest.mark.full
def test_weights_laid_on_in_the_window_give_the_rigidity_and_what_lay_there_returns(
    weighing: MainWindow, until: Callable[..., None], tmp_path: Path
) -> None:
    panel, session, controller = weighing.weights, weighing.session, weighing.weighing
    before = session.scene
    panel.start.masses.setText("5, 10; 20")
    panel.start.begin.click()
    assert panel.steps.what.text() == "Take everything off the skin."
    assert not session.scene.stimuli
    panel.steps.capture.click()
    until(lambda: panel.steps.what.text() == "Lay 5 g on the skin.")
    panel.steps.capture.click()
    until(lambda: "5 g at (" in panel.steps.places.text())
    panel.steps.redo.click()
    assert panel.steps.what.text() == "Lay 5 g on the skin."
    assert not panel.steps.places.text()
    panel.steps.all.click()
    until(lambda: panel.result.use.isVisible(), 120.0)
    assert session.scene == before
    assert panel.result.verdict.text() == "Passed"
    assert controller.result is not None
    assert controller.result.rigidity == pytest.approx(before.plate.rigidity, rel=0.05)
    panel.result.use.click()
    until(lambda: session.status.setup.calibration is not None)
    assert "by 3 weights" in weighing.in_use.what.text()
    assert "nominal readings" in weighing.in_use.what.text()
    controller.save(tmp_path / "skin.toml")
    assert Calibration.read(tmp_path / "skin.toml").weights == controller.result
    weighing.history.stack.undo()
    until(lambda: session.status.setup.calibration is None)
    panel.result.leave.click()
    assert panel.start.begin.isVisible()


@pytest.mark.cases("5, ten")
@pytest.mark.parametrize(
    ("masses", "reason"),
    [("5, ten", "Expected masses in g"), ("5, 10", "Expected at least 3 weights"), ("", "least 3")],
)
def test_masses_that_cannot_be_are_refused_in_the_panel(
    weighing: MainWindow, masses: str, reason: str
) -> None:
    weighing.weights.start.masses.setText(masses)
    weighing.weights.start.begin.click()
    assert reason in weighing.weights.message.text()
    assert weighing.weights.start.begin.isVisible()


@pytest.mark.full
def test_a_step_without_a_weight_is_repeated(
    weighing: MainWindow, until: Callable[..., None]
) -> None:
    panel, session = weighing.weights, weighing.session
    panel.start.begin.click()
    panel.steps.capture.click()
    until(lambda: weighing.weighing.procedure.step == 1)
    session.move(session.scene.touched_by())  # somebody takes it off
    panel.steps.capture.click()
    until(lambda: "No contact was found" in panel.message.text())
    assert "Repeat this step." in panel.message.text()
    assert weighing.weighing.procedure.step == 1


@pytest.mark.full
def test_what_is_changed_meanwhile_ends_the_procedure(
    weighing: MainWindow, until: Callable[..., None]
) -> None:
    panel, session = weighing.weights, weighing.session
    panel.start.begin.click()
    weighing.history.change("Another load", load_case="off-centre")
    until(lambda: "scene was changed: start again" in panel.message.text())
    assert panel.start.begin.isVisible()
    assert len(session.scene.stimuli) == 1
    assert weighing.tare_controller.why_not == ""
    panel.start.begin.click()
    assert "Not during a calibration" in weighing.tare_controller.why_not
    panel.steps.cancel.click()
    assert panel.start.begin.isVisible()
