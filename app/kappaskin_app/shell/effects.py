"""Effects of a scene in words, and a table of what they cost."""

import inspect

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QSizePolicy,
    QTableWidget,
    QTableWidgetItem,
)

from kappaskin.scenes.effects import EFFECTS
from kappaskin.studies import EffectCost
from kappaskin_app.theme import current, follow_look
from kappaskin_app.widgets.layout import fit_rows
from kappaskin_app.widgets.text import NONE, duration, length


def called(effect: str) -> str:
    """What people call an effect, also one that is not known."""
    kind = EFFECTS.get(effect)
    return kind.called() if kind else effect.replace("-", " ").capitalize()


def explained(effect: str) -> str:
    """What an effect does, in sentences; nothing of one that is not known."""
    kind = EFFECTS.get(effect)
    return " ".join(inspect.cleandoc(kind.__doc__ or "").split()).replace("`", "") if kind else ""


_COLUMNS = {
    "Effect": "What spoils the readings of the scene that was measured.",
    "Kept": "Whether it is simulated; what changes readings too little is left out.",
    "Frame": "What it adds to simulating a frame.",
    "With": "RMS error of the shape with the effect, everything else as it is; bold where that is "
    "what is simulated.",
    "Without": "RMS error of the shape without the effect, everything else as it is; bold where "
    "that is what is simulated.",
}


class EffectsTable(QTableWidget):
    """One row for each effect; the error that is had now is bold, what is left out faint."""

    def __init__(self) -> None:
        super().__init__(0, len(_COLUMNS))
        self._shown: tuple[EffectCost, ...] = ()
        for column, (name, tip) in enumerate(_COLUMNS.items()):
            item = _cell(name, column)
            item.setToolTip(tip)
            self.setHorizontalHeaderItem(column, item)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        header.setHighlightSections(False)
        header.setMinimumSectionSize(20)
        self.verticalHeader().hide()
        # As high as there is room: it scrolls by itself.
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self.setShowGrid(False)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setAccessibleName("What each effect costs")
        follow_look(self, self._fill)

    def show_effects(self, effects: tuple[EffectCost, ...]) -> None:
        """Show what was measured of `effects`."""
        if effects == self._shown:
            return
        self._shown = effects
        self._fill()

    def _fill(self) -> None:
        fit_rows(self)
        self.setRowCount(len(self._shown))
        for row, cost in enumerate(self._shown):
            errors = ((cost.rms_with, cost.kept), (cost.rms_without, not cost.kept))
            texts = [called(cost.name), "yes" if cost.kept else "no", duration(cost.time_per_frame)]
            texts += [NONE if rms is None else length(rms) for rms, _ in errors]
            for column, text in enumerate(texts):
                item = _cell(text, column)
                item.setToolTip(_tip(cost))
                if not cost.kept:
                    item.setForeground(QColor(current().faint))
                if column >= len(texts) - len(errors) and errors[column - len(texts)][1]:
                    font = item.font()
                    font.setBold(True)
                    item.setFont(font)
                self.setItem(row, column, item)


def _cell(text: str, column: int) -> QTableWidgetItem:
    item = QTableWidgetItem(text)
    side = Qt.AlignmentFlag.AlignLeft if column < 2 else Qt.AlignmentFlag.AlignRight
    item.setTextAlignment(side | Qt.AlignmentFlag.AlignVCenter)
    return item


def _tip(cost: EffectCost) -> str:
    """What a row says, in a sentence."""
    if cost.bound is None:
        return "A failure that the scene asks for; never left out."
    kept = "" if cost.kept else " It is left out."
    share = f"{100 * cost.bound:.2g} % of the peak"
    return f"Leaving it out changes a reading by at most {share}.{kept}"
