"""Names and descriptions of effects, and the table of their costs."""

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


def effect_name(effect: str) -> str:
    """The name of an effect, also of one that is unknown."""
    kind = EFFECTS.get(effect)
    return kind.called() if kind else effect.replace("-", " ").capitalize()


def effect_description(effect: str) -> str:
    """The description of an effect; empty for one that is unknown."""
    kind = EFFECTS.get(effect)
    return " ".join(inspect.cleandoc(kind.__doc__ or "").split()).replace("`", "") if kind else ""


_COLUMNS = {
    "Effect": "An effect on the readings of the measured scene.",
    "On": "Whether the effect is simulated; negligible effects are omitted.",
    "Frame": "Computing time that the effect adds to a simulated frame.",
    "With": "RMS error of the shape with the effect; bold where the effect is simulated.",
    "Without": "RMS error of the shape without the effect; bold where the effect is omitted.",
}


class EffectsTable(QTableWidget):
    """One row per effect; the present error is bold, an omitted effect faint."""

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
        # As high as the space allows: the table scrolls.
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self.setShowGrid(False)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setAccessibleName("Cost of each effect")
        follow_look(self, self._fill)

    def show_effects(self, effects: tuple[EffectCost, ...]) -> None:
        """Show the measured costs of `effects`."""
        if effects == self._shown:
            return
        self._shown = effects
        self._fill()

    def _fill(self) -> None:
        fit_rows(self)
        self.setRowCount(len(self._shown))
        for row, cost in enumerate(self._shown):
            errors = ((cost.rms_with, cost.kept), (cost.rms_without, not cost.kept))
            texts = [
                effect_name(cost.name),
                "yes" if cost.kept else "no",
                duration(cost.time_per_frame),
            ]
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
    """The tooltip of a row."""
    if cost.bound is None:
        return "A failure defined by the scene; it is never omitted."
    omitted = "" if cost.kept else " It is omitted."
    share = f"{100 * cost.bound:.2g} % of the peak"
    return f"Omitting it changes a reading by at most {share}.{omitted}"
