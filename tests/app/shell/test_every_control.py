"""Every action and every control, used once: nothing fails, and nothing is left behind."""

import runpy
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QDialog,
    QFileDialog,
    QScrollBar,
    QTabWidget,
    QToolButton,
    QWidget,
)

from kappaskin_app.shell.arrangement import layout_of, words_of
from kappaskin_app.shell.settings import Look
from kappaskin_app.shell.window import MainWindow

_SPARED = ("quit", "undo", "redo")  # the window would be gone; and what the others are tried with


def _vtk() -> set[str]:
    """The parts of VTK that are loaded, for whatever."""
    return {name.split(".")[1] for name in sys.modules if name.startswith("vtkmodules.vtk")}


@pytest.fixture(scope="module", autouse=True)
def others_vtk() -> set[str]:
    """Those that other tests had loaded before, which may read what the app only writes."""
    return _vtk()


@pytest.fixture
def nothing_chosen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Let whoever is asked for a file choose none; what asks nobody writes elsewhere."""
    monkeypatch.chdir(tmp_path)
    for ask in ("getOpenFileName", "getSaveFileName"):
        monkeypatch.setattr(QFileDialog, ask, lambda *_: ("", ""))


def _timers(window: MainWindow) -> list[QTimer]:
    return window.findChildren(QTimer)


def _after(window: MainWindow, act: Callable[[], object]) -> None:
    """Do something, let the window live on, and close what it opened."""
    act()
    index = None
    while index != window.history.stack.index():  # a tare, say, may have come in the last turn
        index = window.history.stack.index()
        for _ in range(3):
            QApplication.processEvents()
        while any(timer.isActive() and not timer.interval() for timer in _timers(window)):
            QApplication.processEvents()  # a turn with much to draw leaves those of no time waiting
    for dialog in window.findChildren(QDialog):
        dialog.reject()


def _seen(window: MainWindow) -> dict[str, object]:
    """What a person chose that is no setting, which undo leaves."""
    layout = layout_of(window, window.docks.by_name(), window.panels)
    return {
        "docks": words_of(layout),
        "pages": (layout.page, window.scene.currentIndex()),
        "keys": window.actions_by_name.changed_keys(),
        "layouts": dict(window.layouts.own),
        "files": list(window.opening.recent),
    }


@pytest.mark.full
def test_every_action_can_be_taken_and_its_settings_undone_and_redone(
    window: MainWindow, nothing_chosen, until
) -> None:
    actions, stack, history = window.actions_by_name, window.history.stack, window.history
    window.opening.note(Path("own.toml"))  # something to clear
    changed = set()
    for name in [name for name in actions.entries if name not in _SPARED]:
        before, index = history.settings, stack.index()
        _after(window, actions[name].trigger)
        window.presenter.leave()
        after, steps = history.settings, stack.index() - index
        look = {field.name: getattr(after, field.name) for field in fields(Look)}
        before = replace(before, **look)
        assert steps or after == before, name
        for way, wanted in (("undo", before), ("redo", after)):
            seen = _seen(window)
            for _ in range(steps):
                _after(window, actions[way].trigger)
            assert history.settings == wanted, (name, way)
            assert _seen(window) == seen, (name, way)
        changed |= {name} if after != before else set()
    assert {"look-from-above", "band"} < changed
    window.session.request_source("sim:")
    until(lambda: window.display.badge.state == "SIM")


def _use(control: QWidget) -> None:
    """Do what a person can do with a control."""
    if isinstance(control, QToolButton) and control.menu() is not None:
        for action in control.menu().actions():
            action.trigger()
    elif isinstance(control, QAbstractButton):
        control.click()
    elif isinstance(control, QAbstractSpinBox):
        control.stepUp()
        control.stepDown()
    elif isinstance(control, QComboBox):
        control.setCurrentIndex((control.currentIndex() + 1) % max(control.count(), 1))
    elif isinstance(control, QAbstractSlider):
        control.setValue(control.maximum())


@pytest.mark.full
def test_every_control_can_be_used(window: MainWindow, nothing_chosen, until) -> None:
    kinds = QAbstractButton, QAbstractSpinBox, QComboBox, QAbstractSlider
    pages = [window.panels.widget(number) for number in range(window.panels.count())]
    pages += [window.docks.widget(name) for name in window.docks.by_name()]
    used, form = set[QWidget](), window.scene.editor
    for page in pages:
        for tabs in [page] if isinstance(page, QTabWidget) else [None]:
            for number in range(tabs.count() if tabs else 1):
                if tabs:
                    tabs.setCurrentIndex(number)
                found = [w for w in page.findChildren(QWidget) if isinstance(w, kinds)]
                for control in found:
                    # The form of a scene is driven by tests of its own, part by part.
                    spared = isinstance(control, QScrollBar) or form.isAncestorOf(control)
                    if not spared and control.isEnabled():
                        used.add(control)
                        _after(window, lambda control=control: _use(control))
    assert len(used) > 60
    window.history.stack.setIndex(0)
    window.session.request_source("sim:")
    until(lambda: window.display.badge.state == "SIM")


def test_all_of_vtk_that_was_loaded_meanwhile_is_in_the_bundle(others_vtk: set[str]) -> None:
    contents = Path(__file__).parents[3] / "packaging" / "bundle" / "contents.py"
    bundled = {f"vtk{part}" for part in runpy.run_path(str(contents))["VTK"]}

    assert "vtkRenderingCore" in bundled
    assert _vtk() - others_vtk <= bundled
