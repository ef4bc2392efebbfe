"""Indicators of the presenter: numbers, bars and texts that are legible from afar."""

import math
from dataclasses import replace

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from kappaskin_app.features.presenter.feedback import RadiusEstimate
from kappaskin_app.shell.badge import GAP, LATE, LOST, OFF, STALE, WAITING, colour_of
from kappaskin_app.shell.colouring import SteadyRange
from kappaskin_app.theme import current
from kappaskin_app.widgets.lettering import (
    CAPTION,
    CENTRE,
    LEFT,
    PRIMARY,
    RIGHT,
    SECONDARY,
    Words,
    letters,
    shrunk,
    width_of,
)
from kappaskin_app.widgets.text import NONE, Coverage


class Indicator(QWidget):
    """Widget that paints its `words`; `unit` is the px of this view per px of a 1080 px screen.

    Letters scale with the view, so that they are as large on any screen of the same size.
    """

    def __init__(self) -> None:
        super().__init__()
        self.unit = 1.0
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)

    def words(self) -> list[Words]:
        """Texts and their places."""
        return []

    def draw(self, painter: QPainter) -> None:
        """Paint the background below the words."""

    def show_unit(self, unit: float) -> None:
        self.unit = unit
        self.update()

    def fix_height(self, units: float) -> None:
        """Fix the height at so many units."""
        # With an ignored size policy a layout would give it no height.
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(round(units * self.unit))

    def letters(self, capital: float, bold: bool = False) -> QFont:
        """Font with capitals of so many units."""
        return letters(self.font(), capital * self.unit, bold)

    def line(self, text: str, font: QFont, x: float, baseline: float, width: float) -> Words:
        """One line from `x` on `baseline`, made smaller to fit in `width`."""
        metrics = QFontMetricsF(font)
        top, height = baseline - metrics.ascent(), metrics.height()
        align = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignBottom
        return shrunk(Words(text, font, QRectF(x, top, width, height), align=align))

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            self.draw(painter)
            for words in self.words():
                painter.setPen(QColor(self.ink(words)))
                words.paint(painter)

    def ink(self, words: Words) -> str:
        """Colour of the words."""
        return current().faint if words.faint else current().text

    def fill(self, painter: QPainter, place: QRectF, colour: str, radius: float = 0.0) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colour))
        painter.drawRoundedRect(place, radius, radius)

    def clear(self, colour: str, strength: float) -> QColor:
        """A translucent `colour`, with an opacity from 0 to 1."""
        made = QColor(colour)
        made.setAlphaF(strength)
        return made

    @property
    def middle(self) -> QPointF:
        return QRectF(self.rect()).center()


STRIP_HEIGHT = 112.0  # units
_PAD = 28.0  # units beside the word


class StatusStrip(Indicator):
    """State in its colour, name of the source, latency of the haptic cue, and age of the data."""

    def __init__(self) -> None:
        super().__init__()
        self.state, self.source, self.age, self.latency = OFF, "", "", ""
        self.edge = 0.0  # px, margin on both sides

    def show_unit(self, unit: float) -> None:
        super().show_unit(unit)
        self.fix_height(STRIP_HEIGHT)

    def show_state(self, state: str, source: str, age: str, latency: str = "") -> None:
        if (state, source, age, latency) != (self.state, self.source, self.age, self.latency):
            self.state, self.source, self.age, self.latency = state, source, age, latency
            self.setAccessibleName(", ".join(filter(None, (state, source, age, latency))))
            self.update()

    @property
    def badge(self) -> QRectF:
        """Place of the state."""
        wide = width_of(self.letters(PRIMARY, bold=True), self.state)
        gap = 8 * self.unit
        return QRectF(self.edge, gap, wide + 2 * _PAD * self.unit, self.height() - 2 * gap)

    def draw(self, painter: QPainter) -> None:
        self.fill(painter, self.badge, colour_of(self.state, current()), 10 * self.unit)

    def ink(self, words: Words) -> str:
        return "#ffffff" if words.text == self.state else super().ink(words)

    def words(self) -> list[Words]:
        badge, large = self.badge, self.letters(PRIMARY, bold=True)
        shown = [Words(self.state, large, badge, align=CENTRE)]
        wide = width_of(large, self.age) + 2
        age = QRectF(self.width() - wide - self.edge, 0, wide, self.height())
        shown.append(Words(self.age, large, age, align=RIGHT))
        left = badge.right() + _PAD * self.unit
        place = QRectF(left, 0, max(age.left() - left - _PAD * self.unit, 1.0), self.height())
        lines = [line for line in (self.source, self.latency) if line]
        high = place.height() / max(len(lines), 1)
        for number, line in enumerate(lines):
            part = QRectF(place.left(), number * high, place.width(), high)
            shown.append(shrunk(Words(line, self.letters(SECONDARY), part, align=LEFT)))
        return shown


def age_in_words(seconds: float, least: bool = False) -> str:
    """An age in one number; `least` marks a lower bound."""
    if not math.isfinite(seconds):
        return ""
    more = "\N{GREATER-THAN OR EQUAL TO}\N{THIN SPACE}" if least else ""
    if seconds < 1:
        return f"{more}{1e3 * seconds:.0f} ms old"
    if seconds < 120:
        return f"{seconds:.0f} s old"
    return f"{seconds / 60:.0f} min old" if seconds < 7200 else f"{seconds / 3600:.0f} h old"


REMEDIES = {
    LOST: "Check the cable and the power; retrying. Ctrl+Return connects again, Ctrl+M simulates "
    "instead.",
    STALE: "Wait. If this state lasts, check the cable, then press Ctrl+Return to connect again.",
    LATE: "Data come, but are too old to be felt. If this state lasts, close other programs, or "
    "press Esc and choose fewer functions.",
    WAITING: "Waiting for the first reading. If this state lasts, press Esc and see Connection.",
    OFF: "Ctrl+Return connects the selected source, Ctrl+M simulates. To select another source, "
    "press Esc.",
    GAP: "No data in the recording here. Wait, or press Ctrl+P if playback is paused. Ctrl+] goes "
    "to the next event.",
}
"""What to do in each state in which no new data is shown."""

STATE = 135.0
"""Units that a capital of a state without data is high: an eighth of the view."""

_BANNER_MARGIN = 36.0  # units
_LINE = 1.7  # height of a line by that of its capitals
_REASON_SHARE = 0.45  # of the height below the state: most that the reason takes
_TOP = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop


class Banner(Indicator):
    """State without data: its duration, reason and remedy."""

    def __init__(self) -> None:
        super().__init__()
        self.state, self.since, self.why = OFF, "", ""

    def show_trouble(self, state: str, since: str, why: str) -> None:
        if (state, since, why) != (self.state, self.since, self.why):
            self.state, self.since, self.why = state, since, why
            self.setAccessibleName(f"{state} {since}: {why} {self.remedy}")
            self.update()

    @property
    def remedy(self) -> str:
        return REMEDIES.get(self.state, "")

    def draw(self, painter: QPainter) -> None:
        self.fill(painter, QRectF(self.rect()), colour_of(self.state, current()), 10 * self.unit)

    def ink(self, words: Words) -> str:
        return "#ffffff"

    def words(self) -> list[Words]:
        """The state, since when, the reason in at most its share of the height, and the remedy."""
        edge, head, shown = _BANNER_MARGIN * self.unit, 0.0, list[Words]()
        inside = QRectF(self.rect()).adjusted(edge, edge, -edge, -edge)
        for text, capital in ((self.state, STATE), (self.since, PRIMARY)):
            if text:
                high = _LINE * capital * self.unit
                place = QRectF(inside.left(), inside.top() + head, inside.width(), high)
                shown.append(
                    shrunk(Words(text, self.letters(capital, bold=True), place, align=_TOP))
                )
                head += high
        rest, share = inside.height() - head, 0.0
        if self.why:
            share = _REASON_SHARE * rest
            why = self._paragraph(self.why, SECONDARY, inside.adjusted(0, head, 0, share - rest))
            shown.append(why)
            share = min(why.needed.height() + SECONDARY * self.unit, share)
        below = inside.adjusted(0, head + share, 0, 0)
        shown.append(self._paragraph(self.remedy, 1.2 * SECONDARY, below))
        return shown

    def _paragraph(self, text: str, capital: float, place: QRectF) -> Words:
        font = self.letters(capital, bold=capital != SECONDARY)
        return shrunk(Words(text, font, place, align=_TOP, lines=True))


FIGURE_HEIGHT = 142.0  # units
_GAP = 26.0


class NumberIndicator(Indicator):
    """A name above a large value with a note in smaller letters."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name, self.value, self.note, self.faint = name, NONE, "", False

    def show_figure(self, value: str, note: str = "", name: str = "", faint: bool = False) -> None:
        """Show a value, in grey if `faint`."""
        now = name or self.name, value, note, faint
        if now != (self.name, self.value, self.note, self.faint):
            self.name, self.value, self.note, self.faint = now
            self.setAccessibleName(f"{self.name}: {value} {note}".strip())
            self.update()

    def show_unit(self, unit: float) -> None:
        super().show_unit(unit)
        self.fix_height(FIGURE_HEIGHT)

    def words(self) -> list[Words]:
        """The note shrinks to fit; the value does not."""
        caption, large = self.letters(CAPTION), self.letters(PRIMARY, bold=True)
        wide, base = float(self.width()), self.height() - QFontMetricsF(large).descent()
        value = self.line(self.value, large, 0.0, base, wide)
        name = self.line(self.name, caption, 0.0, CAPTION * self.unit * 1.3, wide)
        shown = [replace(name, faint=True), replace(value, faint=self.faint)]
        at = width_of(value.font, self.value) + _GAP * self.unit
        if self.note and at < wide:
            shown.append(self.line(self.note, self.letters(SECONDARY), at, base, wide - at))
        return shown


HEIGHT = 104.0  # units
_BAR = 46.0  # units that the bar is high
_LEAST, _LARGEST = 0.2, 100.0  # N, shortest and longest scale: no load on a skin is larger
_SIGMAS = 5.0  # standard deviations that the scale shows at least
_LEAST_BAND = 3.0  # px, so that a small error bar stays visible


class ForceBar(Indicator):
    """Bar of the absolute force with its error bar."""

    def __init__(self) -> None:
        super().__init__()
        self._range = SteadyRange(_LEAST, _LARGEST)
        self.force = self.force_off = math.nan

    def show_unit(self, unit: float) -> None:
        super().show_unit(unit)
        self.fix_height(HEIGHT)

    def show_force(self, force: float, force_off: float, now: float) -> None:
        """Show a force in N with its error bar, at `now` in s; NaN for none."""
        self.force, self.force_off = abs(force), force_off
        off = force_off if math.isfinite(force_off) else 0.0
        most = max(self.force + min(off, self.force), _SIGMAS / Coverage.now.times * off)
        self._range.follow(most, now)
        self.update()

    @property
    def scale(self) -> QRectF:
        """Place of the scale; half of the last number extends beyond its end."""
        side = width_of(self.letters(CAPTION), "0.00 N") / 2
        return QRectF(0, 0, max(self.width() - side, 1.0), _BAR * self.unit)

    @property
    def share(self) -> float:
        """The force as a share of the scale; NaN for none."""
        return self.force / self._range.limit

    def at(self, force: float) -> float:
        """Position in px of a force in N, limited to the scale."""
        return self.scale.width() * min(max(force / self._range.limit, 0.0), 1.0)

    def band(self) -> tuple[float, float]:
        """Ends of the error bar in px."""
        off = self.force_off if math.isfinite(self.force_off) else 0.0
        low, high = self.at(self.force - off), self.at(self.force + off)
        short = max(_LEAST_BAND - (high - low), 0.0) / 2
        return low - short, high + short

    def draw(self, painter: QPainter) -> None:
        scale, theme = self.scale, current()
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


_LEAST_RADIUS, _MOST = 0.02, 0.2  # m, range of the radius that fills the view
_MARGIN = 0.04  # of the view's height
_SCALE_BAR = 0.3  # of the view's width at most
_STRAIGHT = 1e6  # px: the outline of a larger circle is not painted as one
_EDGE_HEIGHT = 0.6  # of the view's height


class RadiusView(Indicator):
    """Circle of the radius at the contact, in the band between both ends of its error bar."""

    def __init__(self) -> None:
        super().__init__()
        self._range = SteadyRange(_LEAST_RADIUS, _MOST)
        self.radius: RadiusEstimate | None = None
        self.edge = False
        self.setMinimumHeight(60)

    def show_radius(self, radius: RadiusEstimate | None, edge: bool, now: float) -> None:
        """Show a radius at `now` in s, or an edge, or nothing."""
        self.radius, self.edge = radius, edge
        if radius is not None:
            known = [r for r in (radius.value, *radius.interval) if 0 < r < math.inf]
            self._range.follow(max(known, default=_LEAST_RADIUS), now)
        self.update()

    @property
    def per_metre(self) -> float:
        """Pixels per metre: the largest recent circle fills the height."""
        return self.height() * (1 - 2 * _MARGIN) / (2 * self._range.limit)

    @property
    def bar(self) -> float:
        """Length of the scale bar in m, a round number."""
        most = _SCALE_BAR * self.width() / self.per_metre
        return next(
            b for b in (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0) if b <= most
        )

    @property
    def contact_point(self) -> QPointF:
        """Place of the contact in the view."""
        return QPointF(self.width() / 2, self.height() * (1 - _MARGIN))

    def circle(self, radius: float) -> QRectF:
        """Place of a circle of `radius` in m; one far larger than the view is straight in it."""
        r, contact_point = min(radius * self.per_metre, _STRAIGHT), self.contact_point
        return QRectF(contact_point.x() - r, contact_point.y() - 2 * r, 2 * r, 2 * r)

    def draw(self, painter: QPainter) -> None:
        theme, contact_point = current(), self.contact_point
        painter.setClipRect(self.rect())
        if self.radius is not None:
            self._draw_round(painter, self.radius)
        elif self.edge:
            self._draw_edge(painter)
        pen = QPen(QColor(theme.text), max(2.0, 4 * self.unit))
        painter.setPen(pen)
        painter.drawLine(
            QPointF(0.16 * self.width(), contact_point.y()),
            QPointF(0.84 * self.width(), contact_point.y()),
        )
        bar = self._bar_place
        painter.drawLine(bar.bottomLeft(), bar.bottomRight())
        for x in (bar.left(), bar.right()):
            painter.drawLine(QPointF(x, bar.bottom() - 8 * self.unit), QPointF(x, bar.bottom()))

    def _draw_round(self, painter: QPainter, estimate: RadiusEstimate) -> None:
        theme, (low, high) = current(), estimate.bar
        band = QPainterPath()  # filled between both: the inner one lies in the outer one
        band.addEllipse(self.circle(high))
        band.addEllipse(self.circle(low))
        painter.fillPath(band, self.clear(theme.accent, 0.45))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        width = max(2.0, 4 * self.unit)
        if math.isfinite(estimate.value):
            painter.setPen(QPen(QColor(theme.accent), width))
            painter.drawEllipse(self.circle(estimate.value))
        elif high < math.inf:
            painter.setPen(QPen(QColor(theme.accent), width, Qt.PenStyle.DashLine))
            painter.drawEllipse(self.circle(high))

    def _draw_edge(self, painter: QPainter) -> None:
        at, high = self.contact_point, _EDGE_HEIGHT * self.height()
        painter.setPen(QPen(QColor(current().accent), max(2.0, 4 * self.unit)))
        for side in (-1, 1):
            painter.drawLine(at, QPointF(at.x() + side * high, at.y() - high))

    @property
    def _bar_place(self) -> QRectF:
        high = 2 * CAPTION * self.unit
        return QRectF(2, 0, self.bar * self.per_metre, high)

    def words(self) -> list[Words]:
        place = self._bar_place
        place.setWidth(0.5 * self.width())
        place.setHeight(place.height() - 6 * self.unit)
        text = f"{1e3 * self.bar:g} mm"
        return [Words(text, self.letters(CAPTION), place, align=LEFT)]
