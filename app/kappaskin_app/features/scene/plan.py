"""Plan of a scene's effects, measured as a background task."""

from typing import Any

from PySide6.QtCore import QObject, QSignalBlocker, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QComboBox, QVBoxLayout, QWidget

from kappaskin.live import Status
from kappaskin.scenes import EffectSelection, Scene
from kappaskin.scenes.effects import EFFECTS
from kappaskin.studies import plan_updates
from kappaskin_app.features.scene.scene_text import OFF, ON, PLANNED
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.effects import effect_description, effect_name
from kappaskin_app.shell.session import Session
from kappaskin_app.theme import current, follow_look
from kappaskin_app.widgets.lettering import LEFT
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.table import Table
from kappaskin_app.widgets.text import duration


class EffectPlanner(QObject):
    """Measures size and time of every effect of the scene; `changed` reports new results.

    `rows` are the last of `plan_updates`, of `scene` or, while `waiting`, of the previous one;
    `refusal` is the reason where there are none.
    """

    changed = Signal()

    def __init__(self, session: Session, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.scene: Scene | None = None
        self.rows: list[dict[str, Any]] = []
        self.refusal = ""
        self.task = BackgroundTask(
            tasks,
            "Measuring the effects of the scene",
            self._take,
            self._refuse,
            ended=self.changed.emit,
            cancelled="Cancelled; planned when this panel is shown again.",
        )
        self._active = False

    @property
    def waiting(self) -> bool:
        """Whether the plan of the present scene is incomplete."""
        return self.task.running

    def set_active(self, active: bool) -> None:
        """Plan while the panel is visible, and only then."""
        self._active = active
        if active:
            if self.refusal:
                self.scene = None  # it may have been cancelled: plan again
            self.follow(self._session.status)
        elif self.waiting:
            self.task.stop()
            self.scene = None  # to be planned again
            self.changed.emit()

    def follow(self, _: Status) -> None:
        """Plan again when another scene is simulated."""
        idle = self._active and not self.waiting
        if idle and self._session.inside and self._session.scene is not self.scene:
            self.scene, self.refusal = self._session.scene, ""
            self.task.compute(plan_updates, self.scene)
            self.changed.emit()

    def _take(self, rows: list[dict[str, Any]]) -> None:
        self.rows = rows
        self.changed.emit()

    def _refuse(self, error: Exception) -> None:
        self.rows, self.refusal = [], str(error)


_COLUMNS = ("Effect", "Selection", "Simulated", "Size", "Error if omitted", "Time", "Reason")
_TIPS = (
    "An effect on the readings.",
    "Selected by the plan, or always on or off.",
    "Whether the effect is simulated.",
    "Dimensionless size of the effect in this scene; the tooltip shows the formula.",
    "Largest change of a reading if the effect is omitted, relative to the scene's peak reading.",
    "Computing time per frame, measured on this machine.",
    "Why the effect is simulated or omitted.",
)
_SELECTIONS = ((PLANNED, "By plan"), (ON, "On"), (OFF, "Off"))
_EFFECT, _FORCE, _SIMULATED, _SIZE, _ERROR, _TIME, _WHY = range(len(_COLUMNS))


class EffectsPanel(QWidget):
    """A table of the effects; `forced` requests one on, off or by plan."""

    forced = Signal(str, str)

    def __init__(self) -> None:
        super().__init__()
        self.summary = Label(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.table = Table(
            "effects", "Effects of the scene", _COLUMNS, _TIPS, (_SIZE, _ERROR, _TIME), (_WHY,)
        )
        self.table.setSelectionMode(Table.SelectionMode.NoSelection)
        self.table.setShowGrid(False)
        self.table.horizontalHeader().setDefaultAlignment(LEFT)
        self.forces: dict[str, QComboBox] = {}
        self._rows: list[dict[str, Any]] = []
        self._choice = EffectSelection()
        stack = QVBoxLayout(self)
        stack.addWidget(self.summary)
        stack.addWidget(self.table, 1)
        follow_look(self, self._fill)

    def show_plan(self, rows: list[dict[str, Any]], choice: EffectSelection) -> None:
        """Show the rows of a plan and the `choice` of the effects that are simulated."""
        there = [row for row in rows if row["microseconds"] is not None]
        absent = [row for row in rows if row["microseconds"] is None]
        names = [row["effect"] for row in (*there, *absent)]
        if names != list(self.forces):
            self._lay_out(names)
        self._rows, self._choice = [*there, *absent], choice
        self._fill()
        self._summarise(there)

    def show_waiting(self, words: str) -> None:
        """Show why the table is not that of the present scene."""
        self.summary.setText(words)

    def _fill(self) -> None:
        for number, row in enumerate(self._rows):
            self._fill_row(number, row)

    def _lay_out(self, names: list[str]) -> None:
        """A row for each effect, in this order."""
        self.table.setRowCount(0)
        self.table.setRowCount(len(names))
        self.forces = {}
        for number, name in enumerate(names):
            box = QComboBox()
            box.setObjectName(f"force-{name}")
            box.setAccessibleName(f"{effect_name(name)}, selection")
            for value, words in _SELECTIONS:
                box.addItem(words, value)
            box.activated.connect(lambda _, name=name: self._force(name))
            self.table.setCellWidget(number, _FORCE, box)
            self.forces[name] = box

    def _force(self, name: str) -> None:
        self.forced.emit(name, self.forces[name].currentData())

    def _fill_row(self, number: int, row: dict[str, Any]) -> None:
        name, there = row["effect"], row["microseconds"] is not None
        self._show_force(name, there)
        size = f"Size: {row['formula']}."
        cells = {
            _EFFECT: (effect_name(name), effect_description(name)),
            _SIMULATED: ("yes" if row["kept"] else "no" if there else "", ""),
            _SIZE: (f"{row['size']:.2g}" if there else "", size),
            _ERROR: (_share(row["error"]) if there else "", _TIPS[_ERROR]),
            _TIME: (duration(row["microseconds"] * 1e-6) if there else "", _TIPS[_TIME]),
            _WHY: (row["why"], row["why"]),
        }
        colour = QColor(current().text if row["kept"] else current().faint)
        for column, (text, tip) in cells.items():
            self.table.write(number, column, text, tip).setForeground(colour)

    def _show_force(self, name: str, there: bool) -> None:
        box, choice = self.forces[name], self._choice
        how = ON if name in choice.on else OFF if name in choice.off else PLANNED
        with QSignalBlocker(box):
            box.setCurrentIndex(box.findData(how))
        free = there and not EFFECTS[name].authored
        box.setEnabled(free)
        box.setToolTip(
            _TIPS[_FORCE]
            if free
            else "A failure is defined by the scene: remove it in the editor."
            if there
            else "The scene does not have this effect: add it in the editor."
        )

    def _summarise(self, there: list[dict[str, Any]]) -> None:
        chosen = [row for row in there if row["kept"]]
        error = sum(row["error"] for row in there if not row["kept"])
        taken, all_ = (1e-6 * sum(row["microseconds"] for row in rows) for rows in (chosen, there))
        self.summary.setText(
            f"{len(chosen)} of {len(there)} effects are simulated, in {duration(taken)} per frame "
            f"({duration(all_)} for all). The omitted effects change readings by at most "
            f"{_share(error)} of the peak reading; {_share(self._choice.accuracy)} is permitted."
        )


def _share(value: float) -> str:
    return f"{100 * value:.2g}\N{NO-BREAK SPACE}%"
