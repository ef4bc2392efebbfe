"""Panel of the comparison of setups A and B: surfaces, difference, contact."""

import math

import numpy as np
from PySide6.QtWidgets import QHBoxLayout, QWidget

from kappaskin._text import NONE, rounded, with_error
from kappaskin.bases import edges_of
from kappaskin.live import PipelineStatus, Status
from kappaskin.pipeline import Readout
from kappaskin.sensing import Sensor
from kappaskin.skin import MeshSkin
from kappaskin_app.features.compare.comparison import Pair, SetupComparison
from kappaskin_app.guard import guarded
from kappaskin_app.shell.badge import functions_of
from kappaskin_app.shell.colouring import Colouring, SteadyRange, largest
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.theme import follow_look, grown
from kappaskin_app.widgets.layout import BesideOrBelow, scrolled
from kappaskin_app.widgets.parts import button, sentence
from kappaskin_app.widgets.surface_map import SurfaceMap
from kappaskin_app.widgets.table import Table
from kappaskin_app.widgets.text import Coverage, length

_SETTINGS = (
    "other_x",
    "other_y",
    "other_method",
    "other_edge",
    "other_calibrated",
    "other_tared",
)
_COLUMNS = ("", "A", "B", "B \N{MINUS SIGN} A")
_TABLE_WIDTH, _TABLE_HEIGHT = 560, 160  # px
_MILLIMETRES = 1e3
_SURFACE = "Displacement of the skin, on a common scale of A and B; the cross is the contact."
_DIFFERENCE = (
    "B minus A, on its own scale: five standard deviations of the displacement, or more where they "
    "differ more."
)
_TABLE = (
    "Position, force and depth of the contact, and the principal curvatures of the skin there, "
    "each with its error bar. Position and force are the same where the settings do not "
    "change them: they follow from the readings without the functions. A and B share the noise of "
    "the readings, so that a difference is mostly known better than both. Its error bar is "
    "computed about once a second, by noise added to the readings."
)
_SAME = "same"


class OtherForm(Form):
    """The form of B, with the message of a refusal."""

    purpose = "A second setup for the same readings, to compare with the one in use (A)."
    guide_page = "accuracy"

    def __init__(self) -> None:
        super().__init__("B", _SETTINGS)
        self.swap = button("Swap A and B", "swap", "Exchange the setup in use and B.")
        self.body.addWidget(self.swap)

    def show_pipeline(self, status: PipelineStatus | None, sensor: Sensor | None) -> None:
        if sensor is not None:
            patch = sensor.layout.patch
            self.offer("other_edge", ("", *edges_of(patch)))
            self.show_functions("other_x", "other_y", isinstance(patch, MeshSkin))
        if status is None:
            self.show_message("")
        elif status.computing:
            self.show_message("Computing\N{HORIZONTAL ELLIPSIS}", hint=True)
        else:
            self.show_message(sentence(status.refusal))


class ComparePanel(QWidget):
    """The form of B, both surfaces, their difference, and the contact readouts of both."""

    def __init__(self, colouring: Colouring) -> None:
        super().__init__()
        self.form, self._colouring = OtherForm(), colouring
        numbers = range(1, len(_COLUMNS))
        title = "Contact readouts of A and B"
        self.table = Table("compared", title, _COLUMNS, right=numbers, stretched=numbers)
        self.table.setToolTip(_TABLE)
        self.table.setSelectionMode(Table.SelectionMode.NoSelection)
        self.maps = {
            "a": SurfaceMap("A, in use", "mm", _SURFACE),
            "b": SurfaceMap("B", "mm", _SURFACE),
            "difference": SurfaceMap("B \N{MINUS SIGN} A", "mm", _DIFFERENCE),
        }
        self._scale, self._difference = SteadyRange(0.01), SteadyRange(1e-4)
        self._status = Status()
        around = QHBoxLayout(self)
        around.setContentsMargins(8, 4, 8, 6)
        around.setSpacing(10)
        around.addWidget(scrolled(self.form))
        beside, maps = BesideOrBelow(), QHBoxLayout()
        for view in self.maps.values():
            maps.addWidget(view)
        beside.addLayout(maps, 3)
        beside.addWidget(self.table, 1)
        around.addLayout(beside, 1)
        self._empty()
        follow_look(self, self._dress)

    def _dress(self) -> None:
        self.table.setMinimumSize(grown(_TABLE_WIDTH), grown(_TABLE_HEIGHT))

    def connect_to(self, comparison: SetupComparison) -> None:
        """Show the pairs of `comparison`, and pass on the requests of the user."""
        comparison.compared.connect(guarded(self.show_pair))
        self.form.swap.clicked.connect(guarded(lambda *_: comparison.swap()))

    def show_settings(self, settings: Settings) -> None:
        self.form.show_settings(settings)
        heads = f"Error bars: {Coverage.now.label}", *_COLUMNS[1:]
        self.table.setHorizontalHeaderLabels(heads)

    def show_status(self, status: Status, old: bool) -> None:
        """Show the status of B, and whether the values shown are `old`."""
        self._status = status
        if not self.isVisible():
            return
        self.form.show_pipeline(status.compared, status.sensor)
        for view in self.maps.values():
            view.map.show_faded(old)
        if status.slot is None or status.compared is None or status.compared.slot is None:
            self._empty()

    def _empty(self) -> None:
        for view in self.maps.values():
            view.show_surface(None, (0.0, 1.0), "sequential", np.full(2, np.nan), self._sides)
            view.words.show_text("")
        self.table.setRowCount(0)

    @property
    def _sides(self) -> tuple[float, float]:
        sensor = self._status.sensor
        return (sensor.layout.patch.a, sensor.layout.patch.b) if sensor else (1.0, 1.0)

    def show_pair(self, pair: Pair) -> None:
        """Show one frame, computed with both setups."""
        if not self.isVisible():
            return
        a, b = _MILLIMETRES * pair.a.surface, _MILLIMETRES * pair.b.surface
        now = pair.a.ready_time
        noise = self._colouring.noise("displacement", pair.a)
        self._scale.most = self._difference.most = _MILLIMETRES * max(self._sides)
        limit = self._scale.follow(max(largest(a), largest(b)), now, noise)
        into = max(float(np.nanmax(a)), 0.0) >= max(-float(np.nanmin(a)), 0.0)
        limits = (0.0, limit) if into else (-limit, 0.0)
        part = "sequential" if into else "pulled"
        for name, values, estimate in (("a", a, pair.a), ("b", b, pair.b)):
            self.maps[name].show_surface(
                values, limits, part, estimate.contact.position, self._sides, noise
            )
        difference = pair.difference
        if difference is not None:
            difference = _MILLIMETRES * difference
            limit = self._difference.follow(largest(difference), now, noise)
            self.maps["difference"].show_surface(
                difference, (-limit, limit), "diverging", np.full(2, np.nan), self._sides, noise
            )
        self._show_words(pair)
        self._show_figures(pair)

    def _show_words(self, pair: Pair) -> None:
        other = self._status.compared
        setups = {"a": self._status.setup, "b": other.setup if other else None}
        for name, setup in setups.items():
            if setup is not None:
                method = METHOD_SHORT.get(setup.method, setup.method)
                functions = functions_of(setup, self._status.sensor)
                self.maps[name].words.show_text(f"{functions} functions, {method}")
        if (difference := pair.difference) is not None:
            rms = math.sqrt(float(np.nanmean(difference**2)))
            self.maps["difference"].words.show_text(f"RMS {length(rms)}")

    def _show_figures(self, pair: Pair) -> None:
        figures = pair.figures()
        self.table.fit_rows(len(figures))
        for row, (a, b, sd) in enumerate(figures):
            texts = (
                f"{a.label}, {a.unit}",
                *(e.words or with_error(e.value, _off(e), digits=e.digits) for e in (a, b)),
                difference_text(a, b, Coverage.now.of(sd)),
            )
            for column, text in enumerate(texts):
                self.table.write(row, column, text)


def difference_text(a: Readout, b: Readout, off: float) -> str:
    """B minus A with its error bar `off`; without one, in as many digits as the smaller error.

    A dash where one is not determined.
    """
    if a.words or b.words:
        return NONE
    if (a.value, a.sd) == (b.value, b.sd):
        return _SAME
    if math.isnan(off):
        return rounded(b.value - a.value, min(_off(a), _off(b)), a.digits, "+")[0]
    return with_error(b.value - a.value, off, digits=a.digits, sign="+")


def _off(of: Readout) -> float:
    return Coverage.now.of(of.sd, of.half_width)
