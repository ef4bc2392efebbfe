"""A against B: the same readings computed with two settings, side by side, with the difference."""

import math

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from kappaskin.bases import edges_of
from kappaskin.live import PipelineStatus, Status
from kappaskin.sensing import Sensor
from kappaskin_app.features.compare.comparing import Comparing, Pair
from kappaskin_app.guard import guarded
from kappaskin_app.shell.colouring import SteadyRange
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.theme import DIVERGING, SEQUENTIAL, follow_look, grown
from kappaskin_app.widgets.layout import fit_rows, scrolled
from kappaskin_app.widgets.parts import button, sentence, with_error
from kappaskin_app.widgets.surface_map import SurfaceMap

_ASKS = (
    "other_x",
    "other_y",
    "other_method",
    "other_edge",
    "other_calibrated",
    "other_tared",
)
_COLUMNS = ("", "A", "B", "B \N{MINUS SIGN} A")
_FIGURES = 408  # px wide, the table
_MICROMETRES, _MILLIMETRES = 1e6, 1e3
_SURFACE = "Displacement of the skin, on the scale of A and B together; the cross is the contact."
_DIFFERENCE = "B less A, in \N{MICRO SIGN}m on a scale of its own."
_TABLE = (
    "Where the contact is, how hard and how deep, and the principal curvatures of the skin there. "
    "Each with its standard deviation. That of the difference is as if A and B had nothing in "
    "common; both are of the same readings, so that it is mostly smaller."
)


class OtherForm(Form):
    """Asks for the settings of B, and says why they were not taken."""

    purpose = "Other settings for the same readings, to hold against those in use (A)."
    guide_page = "accuracy"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("B", _ASKS, parent)
        self.swap = button("Swap A and B", "swap", "Let what is in use and B change places.")
        self.body.addWidget(self.swap)

    def show_told(self, told: PipelineStatus | None, sensor: Sensor | None) -> None:
        if sensor is not None:
            self.offer("other_edge", ("", *edges_of(sensor.layout.patch)))
        if told is None:
            self.show_message("")
        elif told.computing:
            self.show_message("Computing\N{HORIZONTAL ELLIPSIS}", hint=True)
        else:
            self.show_message(sentence(told.refusal))


class ComparePanel(QWidget):
    """The form of B, both surfaces, their difference, and what each says of the contact."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.form, self.table = OtherForm(), self._made_table()
        self.maps = {
            "a": SurfaceMap("A, in use", "mm", _SURFACE),
            "b": SurfaceMap("B", "mm", _SURFACE),
            "difference": SurfaceMap("B \N{MINUS SIGN} A", "\N{MICRO SIGN}m", _DIFFERENCE),
        }
        self._scale, self._apart = SteadyRange(0.01), SteadyRange(0.1)
        self._status = Status()
        around = QHBoxLayout(self)
        around.setContentsMargins(8, 4, 8, 6)
        around.setSpacing(10)
        around.addWidget(scrolled(self.form))
        for view in self.maps.values():
            around.addWidget(view, 3)
        around.addWidget(self.table, 3)
        self._empty()
        follow_look(self, lambda: self.table.setMinimumWidth(grown(_FIGURES)))

    def _made_table(self) -> QTableWidget:
        table = QTableWidget(0, len(_COLUMNS))
        table.setObjectName("compared")
        table.setAccessibleName("What A and B say of the contact")
        table.setToolTip(_TABLE)
        table.setHorizontalHeaderLabels(_COLUMNS)
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        table.setTabKeyNavigation(False)
        table.verticalHeader().hide()
        header = table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
        return table

    def attend(self, comparing: Comparing) -> None:
        """Show what `comparing` brings, and pass on what the user requests."""
        comparing.compared.connect(guarded(self.show_pair))
        self.form.swap.clicked.connect(guarded(lambda *_: comparing.swap()))

    def show_settings(self, settings: Settings) -> None:
        self.form.show_settings(settings)

    def show_status(self, status: Status, old: bool) -> None:
        """Show how B is doing, and whether what is shown is `old`."""
        self._status = status
        if not self.isVisible():
            return
        self.form.show_told(status.compared, status.sensor)
        for view in self.maps.values():
            view.map.show_faded(old)
        if status.slot is None or status.compared is None or status.compared.slot is None:
            self._empty()

    def _empty(self) -> None:
        for view in self.maps.values():
            view.show_surface(None, (0.0, 1.0), SEQUENTIAL, np.full(2, np.nan), self._sides)
            view.words.show_text("")
        self.table.setRowCount(0)

    @property
    def _sides(self) -> tuple[float, float]:
        sensor = self._status.sensor
        return (sensor.layout.patch.a, sensor.layout.patch.b) if sensor else (1.0, 1.0)

    def show_pair(self, pair: Pair) -> None:
        """Show one frame as both have it."""
        if not self.isVisible():
            return
        a, b = _MILLIMETRES * pair.a.surface, _MILLIMETRES * pair.b.surface
        now = pair.a.ready_time
        limit = self._scale.follow(max(_largest(a), _largest(b)), now)
        into = max(float(np.nanmax(a)), 0.0) >= max(-float(np.nanmin(a)), 0.0)
        limits = (0.0, limit) if into else (-limit, 0.0)
        colours = SEQUENTIAL if into else SEQUENTIAL[::-1]
        for name, values, estimate in (("a", a, pair.a), ("b", b, pair.b)):
            self.maps[name].show_surface(
                values, limits, colours, estimate.contact.position, self._sides
            )
        difference = pair.difference
        if difference is not None:
            difference = _MICROMETRES * difference
            apart = self._apart.follow(_largest(difference), now)
            self.maps["difference"].show_surface(
                difference, (-apart, apart), DIVERGING, np.full(2, np.nan), self._sides
            )
        self._show_words(pair)
        self._show_figures(pair)

    def _show_words(self, pair: Pair) -> None:
        beside = self._status.compared
        setups = {"a": self._status.setup, "b": beside.setup if beside else None}
        for name, setup in setups.items():
            if setup is not None:
                method = METHOD_SHORT.get(setup.method, setup.method)
                self.maps[name].words.show_text(f"{setup.Ni} x {setup.Nj}, {method}")
        if (difference := pair.difference) is not None:
            apart = _MICROMETRES * difference[np.isfinite(difference)]
            rms = math.sqrt(float(np.mean(apart**2)))
            self.maps["difference"].words.show_text(f"RMS {rms:.3g} \N{MICRO SIGN}m")

    def _show_figures(self, pair: Pair) -> None:
        figures = pair.figures()
        fit_rows(self.table)
        if self.table.rowCount() != len(figures):
            self.table.setRowCount(len(figures))
            for row in range(len(figures)):
                for column in range(len(_COLUMNS)):
                    item = QTableWidgetItem()
                    if column:
                        item.setTextAlignment(
                            Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
                        )
                    self.table.setItem(row, column, item)
        for row, (a, b) in enumerate(figures):
            texts = (
                f"{a.label}, {a.unit}",
                *(with_error(each.value, each.sd, each.digits) for each in (a, b)),
                with_error(*b.less(a), a.digits, sign="+"),
            )
            for column, text in enumerate(texts):
                item = self.table.item(row, column)
                if item is not None and item.text() != text:
                    item.setText(text)


def _largest(values: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> float:
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))
