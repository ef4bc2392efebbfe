"""Legend of the 3-D view: what is drawn in which colour, and switches that hide it."""

from typing import NamedTuple

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QImage, QPainter, QPen, QPixmap
from PySide6.QtWidgets import QToolButton, QWidget

from kappaskin_app.features.membrane.loads import LOAD
from kappaskin_app.guard import guarded
from kappaskin_app.shell.settings import Settings, form_field
from kappaskin_app.theme import CONTACT, Colours, current, follow_look
from kappaskin_app.widgets.layout import Flow
from kappaskin_app.widgets.lettering import read_from_afar


class _Entry(NamedTuple):
    """Words of an entry, its colour (empty: that of texts) and the sort of its sign."""

    words: str
    colour: str = ""
    sign: str = "area"


# By the name of the setting. Those that not every source has come last.
_ENTRIES = {
    "show_fit": _Entry("Fit"),
    "show_elements": _Entry("Elements", sign="dot"),
    "show_contact": _Entry("Contact", CONTACT, "dot"),
    "show_frame": _Entry("Frame", CONTACT, "cross"),
    "show_object": _Entry("Object", CONTACT),
    "show_truth": _Entry("Truth", LOAD, "cross"),
    "show_pressed": _Entry("True object", LOAD),
    "show_load": _Entry("Load", LOAD, "dot"),
}


_SPARE, _GAP = 10, 2  # px that Qt leaves right of the words of a button; between two buttons
_LETTERS = 0.75  # size of the letters in the presenter, of those of its captions


class _Switch(QToolButton):
    """A button without spare room: all of them fit in one line of a small window."""

    def sizeHint(self) -> QSize:
        return super().sizeHint() - QSize(_SPARE, 0)


class Legend(QWidget):
    """A button for each thing that is drawn; `toggled` emits the name of its setting."""

    toggled = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName("Legend")
        self._colours: Colours | None = None
        self._ink = ""
        self.buttons: dict[str, QToolButton] = {}
        flow = Flow(_GAP)
        flow.setContentsMargins(2, 2, 2, 2)
        self.setLayout(flow)
        for name, entry in _ENTRIES.items():
            button = self.buttons[name] = _Switch(checkable=True, autoRaise=True)  # pyright: ignore[reportCallIssue]
            button.setText(entry.words)
            button.setToolTip(f"{form_field(name).label}: click to show or hide it.")
            button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
            button.clicked.connect(guarded(lambda *_, name=name: self.toggled.emit(name)))
            flow.addWidget(button)
        follow_look(self, self._draw_signs)
        self._draw_signs()

    def show_settings(self, settings: Settings) -> None:
        """Strike out what is hidden."""
        for name, button in self.buttons.items():
            button.setChecked(getattr(settings, name))
        self._write()

    def show_available(self, **there: bool) -> None:
        """Show or hide the entries of settings, by whether they can be drawn."""
        for name, shown in there.items():
            self.buttons[name].setVisible(shown)

    def show_colours(self, colours: Colours, ink: str) -> None:
        """Show the colour map (256, 3) of the fit, and the colour `ink` of the elements on it."""
        self._colours, self._ink = colours, ink
        self._draw_signs()

    def show_unit(self, unit: float) -> None:
        """Use larger letters where a unit is so many px, so large that all entries fit in a line.

        0: the usual ones.
        """
        self.setFont(read_from_afar(_LETTERS * unit))
        self._write()

    def _write(self) -> None:
        for button in self.buttons.values():
            font = self.font()
            font.setStrikeOut(not button.isChecked())
            button.setFont(font)

    def _draw_signs(self) -> None:
        side = self.fontMetrics().ascent()
        for name, button in self.buttons.items():
            button.setIconSize(QSize(side, side))
            button.setIcon(QIcon(self._sign(_ENTRIES[name], side)))

    def _sign(self, entry: _Entry, side: int) -> QPixmap:
        """The sign of an entry, `side` px wide."""
        ratio = self.devicePixelRatioF()
        picture = QPixmap(round(side * ratio), round(side * ratio))
        picture.setDevicePixelRatio(ratio)
        picture.fill(Qt.GlobalColor.transparent)
        with QPainter(picture) as painter:
            self._draw(painter, entry, side)
        return picture

    def _draw(self, painter: QPainter, entry: _Entry, side: int) -> None:
        colour = QColor(entry.colour or self._ink or current().text)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        middle, place = side / 2, QRectF(0, 0, side, side)
        if entry.sign == "cross":
            painter.setPen(QPen(colour, max(1.5, side / 8)))
            painter.drawLine(QPointF(middle, 0), QPointF(middle, side))
            painter.drawLine(QPointF(0, middle), QPointF(side, middle))
        elif entry.sign == "dot":
            # The ink may be the colour of the ground.
            painter.setPen(colour if entry.colour else QColor(current().text))
            painter.setBrush(colour)
            painter.drawEllipse(place.center(), side / 4, side / 4)
        elif entry.colour:
            colour.setAlphaF(0.6)
            painter.fillRect(place, colour)
        elif self._colours is not None:
            image = QImage(self._colours.tobytes(), 256, 1, 768, QImage.Format.Format_RGB888)
            painter.drawImage(place, image)
