"""All numbers written on one screen are of one frame, while it plays and while it stands."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from kappaskin.frames import Estimate
from kappaskin_app.shell.window import MainWindow

_TIMES, _ELEMENT = 12, 55

Texts = dict[str, tuple[str, float]]
"""A text and the value in it, as it should be, by name."""


def _stray(texts: Texts) -> list[str]:
    """The texts whose first number is not the value, to the digits that are written."""
    wrong = []
    for name, (text, value) in texts.items():
        number = re.search(r"\d+(?:\.(\d+))?", text)
        if number is None:
            continue
        if abs(float(number[0]) - abs(value)) > 0.51 * 10.0 ** -len(number[1] or ""):
            wrong.append(f"{name}: {text}, of {value}")
    return wrong


def _in_window(window: MainWindow, of: Estimate) -> Texts:
    """Header, tables, and the card of an element."""
    table, contact = window.numbers, of.contact
    facts = {table.facts.item(n, 0).text(): n for n in range(table.facts.rowCount())}

    def listed(name: str) -> str:
        row = next((n for fact, n in facts.items() if fact.startswith(name)), -1)
        return table.facts.item(row, 1).text() if row >= 0 else ""

    xx = float(of.curvature[0, _ELEMENT])
    card = re.findall(r"<td>(.*?)&nbsp;", window.selected_element.panel.facts.text())
    x = 1e3 * float(contact.position[0])
    shown = {
        "table xx": (table.elements.item(_ELEMENT, 3).text(), xx),
        "card xx": (card[1] if len(card) > 1 else "", xx),
    }
    assert all(re.search(r"\d", text) for text, _ in shown.values())
    return (
        shown
        if not _one(of)
        else shown
        | {
            "header depth": (window.readouts.text("depth"), 1e3 * contact.displacement),
            "table depth": (listed("Depth"), 1e3 * contact.displacement),
            "header force": (window.readouts.text("force"), contact.force),
            "table force": (listed("Force"), contact.force),
            "header place": (window.readouts.text("contact"), x),
        }
    )


def _one(of: Estimate) -> bool:
    """Whether it has one contact, whose place, force and depth are known."""
    contact = of.contact
    return contact.present and contact.single and not (contact.near_rim or of.second.present)


def _in_presenter(window: MainWindow, of: Estimate) -> Texts:
    """The figures of the presenter, and the header, which it hides."""
    view, contact = window.presenter_view, of.contact
    return (
        {}
        if not _one(of)
        else {
            "depth": (view.displacement.value, 1e3 * contact.displacement),
            "place": (view.place.value, 1e3 * float(contact.position[0])),
            "header depth": (window.readouts.text("depth"), 1e3 * contact.displacement),
        }
    )


@pytest.fixture(params=["simulation", "replay"])
def playing(
    request: pytest.FixtureRequest,
    opened: Callable[[str], MainWindow],
    recording: Path,
    until: Callable[..., None],
) -> MainWindow:
    window = opened(f"replay:{recording}" if request.param == "replay" else "sim:circle")
    until(lambda: window.session.estimate is not None)
    window.selected_element.select(_ELEMENT)
    window.docks.reveal("numbers")
    until(lambda: window.numbers.elements.rowCount() > _ELEMENT)
    return window


@pytest.mark.parametrize("presenting", [False, True])
def test_numbers_of_one_screen_are_of_one_frame(
    playing: MainWindow, until: Callable[..., None], presenting: bool
) -> None:
    window, seen, wrong = playing, list[int](), list[str]()
    if presenting:
        QTest.keyClick(window, Qt.Key.Key_F11)
        until(lambda: window.presenter.on)
    else:
        window.docks["element"].setFloating(True)  # beside the tables, which it shares tabs with
        window.docks.reveal("element")
        until(lambda: window.selected_element.panel.isVisible() and window.numbers.isVisible())
    shown = _in_presenter if presenting else _in_window

    def compare(estimate: Estimate | None) -> None:
        if estimate is not None:
            seen.append(estimate.sequence)
            wrong.extend(_stray(shown(window, estimate)))

    window.display.show_numbers_soon()
    window.display.numbers.connect(compare)
    until(lambda: len(seen) >= _TIMES)
    window.display.numbers.disconnect(compare)
    assert wrong == []
    if presenting:
        QTest.keyClick(window, Qt.Key.Key_Escape)
    else:
        window.docks["element"].setFloating(False)
