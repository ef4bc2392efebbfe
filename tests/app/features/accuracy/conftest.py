"""What tests of costs share: few settings, and a window in which all of them are measured."""

from collections.abc import Iterator

import pytest
from PySide6.QtWidgets import QApplication

from kappaskin.studies import Cost, Setting
from kappaskin_app.features.accuracy import measurement
from kappaskin_app.features.accuracy.measurement import setting_text
from kappaskin_app.shell.window import MainWindow


@pytest.fixture(scope="module")
def few() -> Iterator[None]:
    """So few settings that measuring them takes no time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measurement, "METHODS", ("least-squares", "bayes"))
        patch.setattr(measurement, "FUNCTIONS", (4, 8, 12))
        patch.setattr(measurement, "ELEMENTS", (6,))
        yield


@pytest.fixture(scope="module")
def shared(qapp: QApplication, few: None, until, window_class) -> Iterator[MainWindow]:
    """One window for all that only look at it, once everything is measured."""
    qapp.setStyle("Fusion")
    window = window_class("sim:")
    window.show()
    until(lambda: window.session.estimate is not None)
    window.actions_by_name["dock-cost"].trigger()
    until(lambda: all_measured(window), 60.0)
    window.history.stack.clear()  # the dock stays, whatever is undone
    window.hide()
    yield window
    window.close()
    window.deleteLater()
    qapp.processEvents()


@pytest.fixture
def measured(shared: MainWindow, until) -> Iterator[MainWindow]:
    """The window as it was when everything was measured, shown."""
    shared.show()
    shared.activateWindow()
    stack = shared.history.stack
    while stack.canUndo():
        stack.undo()
    until(lambda: shared.measurement.scene is not None)
    if shared.measurement.difference():
        shared.cost.again.click()
    until(lambda: all_measured(shared), 60.0)
    until(lambda: shared.cost.plot.frontier == shared.measurement.frontier())
    setting = Setting("least-squares", (8, 8), (10, 10))
    until(lambda: shared.measurement.present == setting)  # the engine takes it up in its own time
    until(lambda: isinstance(shared.measurement.predicted(), Cost))
    until(lambda: shared.cost.setting.text() == setting_text(setting))
    yield shared
    shared.hide()


def all_measured(window: MainWindow) -> bool:
    done, asked = window.measurement.progress
    return asked > 0 and done == asked and not window.measurement.running
