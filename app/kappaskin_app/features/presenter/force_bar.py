"""A force as a bar along a scale with its unit, the error bar as a band around its end."""

import math

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QColor, QPainter, QPen

from kappaskin_app.features.presenter.board import Board
from kappaskin_app.shell.scale import SteadyRange
from kappaskin_app.widgets.lettering import CAPTION, CENTRE, Words, width_of

HEIGHT = 104.0  # units
_BAR = 46.0  # units that the bar is high
_LEAST = 0.2  # N at the end of the scale at least
_THIN = 3.0  # px of the band at least: an error bar too small to be seen is still there


class ForceBar(Board):
    """Shows how large a force is, to the left the sign does not matter: a pull is as long."""

    def __init__(self) -> None:
        super().__init__()
        self._range = SteadyRange(_LEAST)
        self.force = self.force_95 = math.nan

    def show_unit(self, unit: float) -> None:
        super().show_unit(unit)
        self.fix_height(HEIGHT)

    def show_force(self, force: float, force_95: float, now: float) -> None:
        """A force in N with its 95 % half width, at `now` in s; NaN of none."""
        self.force, self.force_95 = abs(force), force_95
        self._range.follow(self.force + (force_95 if math.isfinite(force_95) else 0.0), now)
        self.update()

    @property
    def scale(self) -> QRectF:
        """Where the whole scale is, the last number with its half beside its end."""
        side = width_of(self.letters(CAPTION), "0.00 N") / 2
        return QRectF(0, 0, max(self.width() - side, 1.0), _BAR * self.unit)

    @property
    def share(self) -> float:
        """How much of the scale the force is; NaN of none."""
        return self.force / self._range.limit

    def at(self, force: float) -> float:
        """Where in px a force in N is on the scale, its end for more."""
        return self.scale.width() * min(max(force / self._range.limit, 0.0), 1.0)

    def band(self) -> tuple[float, float]:
        """Where in px the error bar begins and ends."""
        off = self.force_95 if math.isfinite(self.force_95) else 0.0
        low, high = self.at(self.force - off), self.at(self.force + off)
        short = max(_THIN - (high - low), 0.0) / 2
        return low - short, high + short

    def draw(self, painter: QPainter) -> None:
        scale, theme = self.scale, self.theme
        self.fill(painter, scale, theme.base, 4)
        if math.isfinite(self.force):
            self.fill(painter, QRectF(0, 0, self.at(self.force), scale.height()), theme.accent)
            low, high = self.band()
            band = QRectF(low, 0, high - low, scale.height())
            painter.fillRect(band, self.clear(theme.text, 0.55))
        painter.setBrush(QColor(0, 0, 0, 0))
        painter.setPen(QPen(QColor(theme.faint), max(1.0, 2 * self.unit)))
        painter.drawRect(scale)
        for share in (0.0, 0.5, 1.0):
            x = share * scale.width()
            painter.drawLine(QPointF(x, scale.bottom()), QPointF(x, scale.bottom() + 8 * self.unit))

    def words(self) -> list[Words]:
        font, scale = self.letters(CAPTION), self.scale
        top, shown = scale.bottom() + 8 * self.unit, list[Words]()
        for share in (0.0, 0.5, 1.0):
            text = f"{share * self._range.limit:g}{' N' if share == 1 else ''}"
            wide = width_of(font, text) + 2
            x = min(max(share * scale.width() - wide / 2, 0.0), self.width() - wide)
            place = QRectF(x, top, wide, self.height() - top)
            shown.append(Words(text, font, place, align=CENTRE))
        return shown
