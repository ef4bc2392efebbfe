"""Layouts: no text is clipped, no widgets overlap, and all text stands out from its ground."""

import runpy
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QLabel,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import DARK, LIGHT, THEMES, apply_look
from kappaskin_app.widgets.line import Line

WALK = runpy.run_path(str(Path(__file__).with_name("walk.py")))
LONG = "A text that is longer than the widget which shows it"


@pytest.fixture
def bench(qapp) -> Iterator[QWidget]:
    bench = QWidget()
    bench.resize(600, 300)
    yield bench
    bench.close()


def _put(bench: QWidget, widget: QWidget, *place: int) -> None:
    widget.setParent(bench)
    widget.setGeometry(*place)


def _faults(bench: QWidget) -> list[str]:
    bench.show()
    return WALK["faults"](bench)


@pytest.mark.parametrize("kind", [QLabel, QCheckBox, QPushButton, QComboBox])
@pytest.mark.parametrize(("place", "fault"), [((0, 0, 90, 30), "wide"), ((0, 0, 500, 6), "high")])
def test_a_text_without_room_is_found(bench: QWidget, kind: type, place, fault: str) -> None:
    widget = kind()
    widget.addItem(LONG) if kind is QComboBox else widget.setText(LONG)
    _put(bench, widget, *place)
    assert any(found.startswith("clipped") and fault in found for found in _faults(bench))
    widget.setGeometry(0, 0, 500, 60)
    assert _faults(bench) == []


def test_lines_of_a_wrapped_text_below_its_label_are_found(bench: QWidget) -> None:
    label = QLabel(LONG, wordWrap=True)
    _put(bench, label, 0, 0, 120, 20)
    assert [fault for fault in _faults(bench) if "high" in fault]
    label.resize(120, 100)
    assert _faults(bench) == []


def test_a_line_that_elides_has_a_tooltip_and_is_no_fault(bench: QWidget) -> None:
    line = Line(LONG)
    _put(bench, line, 0, 0, 90, 20)
    assert _faults(bench) == []


def test_a_widget_beyond_the_edge_of_another_is_found(bench: QWidget) -> None:
    _put(bench, QLabel("Force"), 580, 0, 60, 20)
    assert [fault for fault in _faults(bench) if fault.startswith("outside")]


def test_neighbours_that_overlap_are_found(bench: QWidget) -> None:
    _put(bench, QPushButton("One"), 0, 0, 120, 30)
    other = QPushButton("Other")
    _put(bench, other, 100, 10, 120, 30)
    (fault,) = _faults(bench)
    assert fault.startswith("overlap of 20 x 20 px")
    other.move(200, 10)
    assert _faults(bench) == []


@pytest.mark.parametrize("theme", [LIGHT, DARK])
@pytest.mark.parametrize("kind", [QLabel, QLineEdit, QPushButton])
def test_a_text_like_its_ground_is_found(bench: QWidget, theme, kind: type) -> None:
    apply_look(theme)
    widget = kind("Force")
    QVBoxLayout(bench).addWidget(widget)
    bench.show()
    WALK["wait"](0.05)
    assert _faults(bench) == []
    widget.setStyleSheet(f"color: {theme.missing if theme is LIGHT else theme.off};")
    assert [fault for fault in _faults(bench) if fault.startswith("contrast")]


def _found(window: MainWindow, theme: str, size: tuple[int, int], screens) -> dict[str, list[str]]:
    window.requests.set("theme", theme)
    window.resize(*size)
    found = {}
    for name, screen in screens:
        faults = WALK["faults"](screen)
        if screen.width() > size[0] or screen.height() > size[1]:
            faults.append(f"{screen.width()} x {screen.height()} px large")
        if faults:
            found[name] = faults
    return found


@pytest.mark.cases("dark")
@pytest.mark.parametrize("theme", THEMES)
def test_a_small_window_shows_its_settings_and_dialogs_whole(
    window: MainWindow, theme: str
) -> None:
    screens = chain(WALK["pages"](window, 0.05), WALK["dialogs"](window, 0.05))
    assert _found(window, theme, WALK["SIZES"][0], screens) == {}


@pytest.mark.full
@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("size", WALK["SIZES"], ids=str)
def test_every_screen_shows_its_texts_whole(
    window: MainWindow, recording: Path, theme: str, size: tuple[int, int], pytestconfig
) -> None:
    if pytestconfig.getoption("--without"):
        pytest.skip("screens of one feature are left out")
    screens = WALK["screens"](window, recording, 0.2)
    assert _found(window, theme, size, screens) == {}
