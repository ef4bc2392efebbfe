from collections.abc import Iterator
from itertools import pairwise

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QComboBox,
    QHeaderView,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QScrollBar,
    QWidget,
)

from kappaskin_app.shell.window import MainWindow

_CONTROLS = (
    *(QAbstractButton, QAbstractSpinBox, QComboBox, QLineEdit, QAbstractSlider),
    *(QAbstractItemView, QPlainTextEdit),
)


def controls_of(window: MainWindow) -> Iterator[QWidget]:
    """All that a person can use, seen or not, without the parts that Qt makes of them."""
    for widget in window.findChildren(QWidget):
        parts = widget.parent(), widget.window()
        of_qt = widget.objectName().startswith("qt_") or isinstance(
            parts[0], QAbstractSpinBox | QComboBox | QAbstractItemView
        )
        popup = parts[1].windowType() == Qt.WindowType.Popup
        skipped = of_qt or popup or isinstance(widget, QScrollBar | QHeaderView)
        if isinstance(widget, _CONTROLS) and not skipped:
            yield widget


def name_of(control: QWidget, labels: list[QLabel]) -> str:
    """What a screen reader says: the name, or the text, or the label beside."""
    text = control.text() if isinstance(control, QAbstractButton) else ""
    beside = next((label.text() for label in labels if label.buddy() is control), "")
    return control.accessibleName() or text or beside


def above(one: QWidget, other: QWidget) -> bool:
    """Whether one widget ends before another begins, downwards."""
    at, next_at = (w.mapToGlobal(QPoint(0, 0)).y() for w in (one, other))
    return at + one.height() <= next_at + 2


def left_of(one: QWidget, other: QWidget) -> bool:
    at, next_at = (w.mapToGlobal(QPoint(0, 0)).x() for w in (one, other))
    return at + one.width() <= next_at + 2


def stops_in(page: QWidget) -> list[QWidget]:
    """Where Tab stops on a page, in its order."""
    stops, widget = [], page.nextInFocusChain()
    while widget is not page:
        takes = bool(widget.focusPolicy() & Qt.FocusPolicy.TabFocus) and widget.isEnabled()
        if takes and widget.isVisible() and page.isAncestorOf(widget):
            stops.append(widget)
        widget = widget.nextInFocusChain()
    return stops


def test_every_control_has_a_name(window: MainWindow) -> None:
    labels = window.findChildren(QLabel)
    nameless = [
        f"{type(control).__name__} {control.objectName()!r} {control.toolTip()[:30]!r}"
        for control in controls_of(window)
        if not name_of(control, labels)
    ]
    assert nameless == []


@pytest.mark.full
def test_tab_goes_through_every_panel_as_it_is_read(window: MainWindow) -> None:
    wrong, seen = [], 0
    for number in range(window.panels.count()):
        window.panels.setCurrentIndex(number)
        for panel in _panels_on(window.panels.currentWidget()):
            seen += len(stops_in(panel))
            wrong += turned_back(panel)
    for name in ("scene", "cost", "stability", "health", "compare"):
        window.actions_by_name[f"dock-{name}"].trigger()
        # Beside each other stand columns, of which each is gone through.
        seen += len(stops_in(window.docks.widget(name)))
        wrong += turned_back(window.docks.widget(name), columns=True)
    assert wrong == []
    assert seen > 60


def turned_back(page: QWidget, columns: bool = False) -> list[str]:
    """Where Tab goes up again, or to the left in a line."""
    stops, wrong = stops_in(page), []
    for one, other in pairwise(stops):
        up, back = above(other, one), left_of(other, one) and not above(one, other)
        if (up and back) if columns else (up or back):
            wrong.append(f"{one.objectName()} before {other.objectName()} in {type(page).__name__}")
    return wrong


def _panels_on(page: QWidget) -> list[QWidget]:
    return [w for w in page.findChildren(QWidget) if type(w).__name__.endswith("Panel")]
