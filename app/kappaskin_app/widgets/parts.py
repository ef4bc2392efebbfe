"""Small widgets and texts: labels, headings, buttons."""

from html import escape

from PySide6.QtCore import QEvent
from PySide6.QtGui import QKeyEvent, Qt
from PySide6.QtWidgets import (
    QApplication,
    QDoubleSpinBox,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QWidget,
)

from kappaskin._text import printable
from kappaskin_app.theme import follow_look

ELLIPSIS = "\N{HORIZONTAL ELLIPSIS}"


def capital(text: str) -> str:
    """The text with a capital, unless it begins with a name such as that of a file."""
    word = text.partition(" ")[0].rstrip(",;:")
    return text[:1].upper() + text[1:] if word.isalpha() else text


def sentence(text: str) -> str:
    """The text with a capital, as `capital` sets it, and a stop."""
    text = capital(text)
    return text if not text or text.endswith((".", "?", "!", ELLIPSIS)) else f"{text}."


def plain_tip(text: str) -> str:
    """A tooltip that Qt shows as it is: it takes what looks like markup for such."""
    text = printable(text, keep="\n")
    rich = f"<p style='white-space: pre-wrap'>{escape(text)}</p>"
    return rich if Qt.mightBeRichText(text) else text


class Label(QLabel):
    """A label that shows markup as it is, unless its own text is `rich`."""

    def __init__(self, text: str = "", *, rich: bool = False, **properties: object) -> None:
        super().__init__(text, **properties)  # pyright: ignore[reportArgumentType, reportCallIssue]
        kind = Qt.TextFormat.RichText if rich else Qt.TextFormat.PlainText
        self.setTextFormat(kind)


def text_label(text: str = "", tip: str = "", *, rich: bool = False) -> Label:
    label = Label(text, rich=rich, wordWrap=True)  # pyright: ignore[reportCallIssue]
    label.setToolTip(tip)
    return label


class Heading(Label):
    """A label in bold letters, so many `times` as large as those of now."""

    def __init__(self, times: float) -> None:
        super().__init__(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self._times = times
        self._enlarge()

    def _enlarge(self) -> None:
        font = QApplication.font()
        font.setPointSizeF(self._times * font.pointSizeF())
        font.setBold(True)
        self.setFont(font)

    def event(self, event: QEvent) -> bool:
        parent = self.parentWidget()
        if event.type() == QEvent.Type.ApplicationFontChange:  # comes to windows alone
            self._enlarge()
        elif event.type() == QEvent.Type.Polish and parent is not None:
            follow_look(parent, self._enlarge)
        return super().event(event)


class _PushedByEnter(QPushButton):
    """A button that Enter pushes too, as Space does; once while it is held."""

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            if not event.isAutoRepeat():
                self.click()
        else:
            super().keyPressEvent(event)


def button(text: str, name: str, tip: str) -> QPushButton:
    button = _PushedByEnter(text)
    button.setObjectName(name)
    button.setToolTip(tip)
    return button


def in_a_row(*widgets: QWidget) -> QHBoxLayout:
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    return row


def seconds_box(name: str, least: float, value: float, tip: str) -> QDoubleSpinBox:
    box = QDoubleSpinBox()
    box.setObjectName(name)
    box.setDecimals(1)
    box.setRange(least, 3600.0)
    box.setValue(value)
    box.setSuffix(" s")
    box.setToolTip(tip)
    box.setAlignment(Qt.AlignmentFlag.AlignRight)
    return box
