"""Names and descriptions of effects, and the table of their costs."""

import inspect

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QFont
from PySide6.QtWidgets import QSizePolicy

from kappaskin.scenes.effects import EFFECTS
from kappaskin.studies import EffectCost
from kappaskin_app.theme import current, follow_look
from kappaskin_app.widgets.lettering import LEFT, RIGHT
from kappaskin_app.widgets.table import Table
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
_NUMBERS = (2, 3, 4)


class EffectsTable(Table):
    """One row per effect; the present error is bold, an omitted effect faint."""

    def __init__(self) -> None:
        tips = tuple(_COLUMNS.values())
        super().__init__("costs", "Cost of each effect", tuple(_COLUMNS), tips, _NUMBERS, (0,))
        self._shown: tuple[EffectCost, ...] = ()
        header = self.horizontalHeader()
        header.setDefaultAlignment(LEFT)
        for column in _NUMBERS:
            header.model().setHeaderData(
                column, Qt.Orientation.Horizontal, RIGHT, Qt.ItemDataRole.TextAlignmentRole
            )
        header.setMinimumSectionSize(20)
        # As high as the space allows: the table scrolls.
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self.setShowGrid(False)
        self.setSelectionMode(Table.SelectionMode.NoSelection)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        follow_look(self, self._fill)

    def show_effects(self, effects: tuple[EffectCost, ...]) -> None:
        """Show the measured costs of `effects`."""
        if effects == self._shown:
            return
        self._shown = effects
        self._fill()

    def _fill(self) -> None:
        self.fit_rows(len(self._shown))
        for row, cost in enumerate(self._shown):
            errors = ((cost.rms_with, cost.kept), (cost.rms_without, not cost.kept))
            texts = [
                effect_name(cost.name),
                "yes" if cost.kept else "no",
                duration(cost.time_per_frame),
            ]
            texts += [NONE if rms is None else length(rms) for rms, _ in errors]
            bold = [False] * (len(texts) - len(errors)) + [now for _, now in errors]
            for column, text in enumerate(texts):
                item = self.write(row, column, text, _tip(cost))
                item.setForeground(QColor(current().text if cost.kept else current().faint))
                font = QFont()
                font.setBold(bold[column])
                item.setFont(font)


def _tip(cost: EffectCost) -> str:
    """The tooltip of a row."""
    if cost.bound is None:
        return "A failure defined by the scene; it is never omitted."
    omitted = "" if cost.kept else " It is omitted."
    share = f"{100 * cost.bound:.2g} % of the peak"
    return f"Omitting it changes a reading by at most {share}.{omitted}"
