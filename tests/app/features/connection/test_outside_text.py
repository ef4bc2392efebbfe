"""Names from outside are text in the window: no markup, and nothing unseen."""

import logging
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import Qt as RichText

from kappaskin_app.guard import PrintableFormatter
from kappaskin_app.widgets.parts import plain_tip

NAME = "N\x1b[31m<img src=x>\u202e"
SHOWN = r"N\x1b[31m<img src=x>\u202e"


def test_messages_show_markup_as_it_is(panels) -> None:
    panels.connection.show_message(NAME)
    assert panels.connection.message.text() == SHOWN
    for label in (panels.connection.message, panels.connection.device):
        assert label.textFormat() == Qt.TextFormat.PlainText


def test_a_tooltip_shows_markup_as_it_is() -> None:
    assert not RichText.mightBeRichText(plain_tip("a < b\nc"))
    assert "&lt;img src=x&gt;" in plain_tip(NAME)
    assert "\x1b" not in plain_tip(NAME)


@pytest.mark.full
def test_a_passing_message_and_a_recent_file_are_text(window) -> None:
    window.notify(NAME)
    assert window.statusBar().currentMessage() == SHOWN
    window.opening.note(Path(f"/{NAME}&.mcap"))
    window.opening.menu.aboutToShow.emit()
    action = window.opening.menu.actions()[0]
    assert action.text() == f"{SHOWN}&&.mcap  (missing)"
    assert "<img" not in action.toolTip()


def test_a_log_line_is_text() -> None:
    record = logging.LogRecord("a", logging.INFO, "", 0, "%s", (NAME,), None)
    assert PrintableFormatter("%(message)s").format(record) == SHOWN
