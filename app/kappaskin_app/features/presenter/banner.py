"""What to do while nothing comes in, in letters that are read from across a room."""

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QPainter

from kappaskin_app.features.presenter.board import Board
from kappaskin_app.shell.badge import GAP, LOST, OFF, STALE, WAITING, colour_of
from kappaskin_app.widgets.lettering import PRIMARY, SECONDARY, Words, shrunk

REMEDIES = {
    LOST: "Check the cable and the power. It goes on by itself when the device is back; "
    "Ctrl+Return connects anew, Ctrl+M simulates instead.",
    STALE: "Wait a moment. If it lasts: check the cable, then press Ctrl+Return to connect anew.",
    WAITING: "Wait: the first reading is on its way. If it lasts, press Esc and look under "
    "Connection.",
    OFF: "Ctrl+Return connects the source that is chosen, Ctrl+M simulates. To choose another, "
    "press Esc.",
    GAP: "Nothing came here when it was recorded. Wait, or press Ctrl+P if it is paused: it plays "
    "past this. Ctrl+] goes to the next event.",
}
"""What to do in each state in which nothing new is shown."""

_MARGIN = 36.0  # units
_WHY = 0.45  # of the height below the word that the reason has at most
_TOP = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop


class Banner(Board):
    """Says since when nothing comes, why, and what to do about it."""

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
        self.fill(painter, QRectF(self.rect()), colour_of(self.state, self.theme), 10 * self.unit)

    def ink(self, words: Words) -> str:
        return "#ffffff"

    def words(self) -> list[Words]:
        """The word, the reason in at most its share of the height, and the remedy below it."""
        edge = _MARGIN * self.unit
        inside = QRectF(self.rect()).adjusted(edge, edge, -edge, -edge)
        head, rest = 2 * PRIMARY * self.unit, inside.height() - 2 * PRIMARY * self.unit
        title = f"{self.state} {self.since}".strip()
        shown, share = [self._lines(title, PRIMARY, inside.adjusted(0, 0, 0, -rest))], 0.0
        if self.why:
            share = _WHY * rest
            why = self._lines(self.why, SECONDARY, inside.adjusted(0, head, 0, share - rest))
            shown.append(why)
            share = min(why.needed.height() + SECONDARY * self.unit, share)
        below = inside.adjusted(0, head + share, 0, 0)
        shown.append(self._lines(self.remedy, 1.2 * SECONDARY, below))
        return shown

    def _lines(self, text: str, capital: float, place: QRectF) -> Words:
        font = self.letters(capital, bold=capital != SECONDARY)
        return shrunk(Words(text, font, place, align=_TOP, lines=True))
