"""Panel of the cost of accuracy: plot, setting in use, required accuracy."""

import math

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import (
    QGridLayout,
    QHBoxLayout,
    QProgressBar,
    QSlider,
    QVBoxLayout,
    QWidget,
)

from kappaskin.live import ComputedFrames
from kappaskin.studies import Cost, Refused
from kappaskin_app.features.accuracy.cost_plot import CostPlot
from kappaskin_app.features.accuracy.measurement import (
    CostMeasurement,
    Frontier,
    performance,
    setting_text,
)
from kappaskin_app.guard import guarded
from kappaskin_app.shell.effects import EffectsTable
from kappaskin_app.theme import ALERT, FAINT, follow_look, grown, slider_style
from kappaskin_app.widgets.layout import BesideOrBelow
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import ELLIPSIS, Label, button, sentence, text_label
from kappaskin_app.widgets.text import NONE, duration, length

_STEPS = 200  # of the slider
_WORDS, _EFFECTS = 350, 376  # px wide
_ROWS = 90  # px of the table of effects


class CostPanel(QWidget):
    """The plot, the figures of the setting in use, and a slider that selects the fastest setting.

    The table shows the cost of each effect of the scene with the setting in use.
    """

    def __init__(self) -> None:
        super().__init__()
        self.plot = CostPlot()
        self._make_figures()
        self.required = QSlider(Qt.Orientation.Horizontal)
        self.required.setObjectName("required-accuracy")
        self.required.setRange(0, _STEPS)
        self.required.setPageStep(_STEPS // 10)
        self.required.setToolTip(
            "Largest permissible RMS error of the shape. Releasing the slider selects the setting "
            "that reaches it with the least computing time (Ctrl+Z undoes)."
        )
        self.required_text = Label()
        self.cheapest = text_label()
        self.cheapest.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.again = button(
            "Measure",
            "measure",
            "Measure all settings again, with the present skin, load and noise. The background "
            "task measures one setting after the other while this panel is visible.",
        )
        self.bar = QProgressBar(textVisible=False)  # pyright: ignore[reportCallIssue]
        self.bar.setFixedHeight(8)
        self.bar.setToolTip("Measured settings.")
        self.count, self.message = Label(), text_label()
        self.effects, self.no_effects = EffectsTable(), text_label()
        self.no_effects.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.no_effects.setForegroundRole(FAINT)
        self.no_effects.hide()
        self._lay_out()
        self._measurement: CostMeasurement | None = None
        self._accuracy = math.nan
        self._ends, self._frontier = (1e-5, 1e-4), Frontier()  # m, of the slider
        self._hint = None
        self.required.valueChanged.connect(guarded(self._slid))
        self.required.sliderReleased.connect(guarded(self._take))
        self.again.clicked.connect(guarded(self._measure))
        follow_look(self, self._dress)

    def _make_figures(self) -> None:
        self.setting = Line(NONE)
        bold = self.setting.font()
        bold.setBold(True)
        self.setting.setFont(bold)
        self.figures = {
            (row, column): Line(NONE)
            for row in ("Predicted", "Measured")
            for column in ("RMS error", "time")
        }
        self.computed, self.each = Line(NONE), Line(NONE)

    def _lay_out(self) -> None:
        right = QVBoxLayout()
        right.setSpacing(4)
        right.addWidget(self.setting)
        grid = QGridLayout()
        grid.setVerticalSpacing(0)
        tips = {
            "Predicted": "RMS error and computing time from the measurement of this setting.",
            "Measured": "Mean RMS error and median computing time of the frames of the last half "
            "second; the error is known in simulations only.",
        }
        for row, (name, tip) in enumerate(tips.items()):
            label = Label(name)
            label.setToolTip(tip)
            grid.addWidget(label, row, 0)
            for column, what in enumerate(("RMS error", "time"), 1):
                self.figures[name, what].setToolTip(tip)
                grid.addWidget(self.figures[name, what], row, column)
        for column, widget in enumerate((Label("Whole frame"), self.computed, self.each)):
            widget.setToolTip("Frames computed per second, and the total computing time of each.")
            grid.addWidget(widget, len(tips), column)
        grid.setColumnStretch(1, 2)
        grid.setColumnStretch(2, 3)
        right.addLayout(grid)
        accuracy = QHBoxLayout()
        label = Label("Re&quired accuracy")
        label.setBuddy(self.required)
        label.setToolTip(self.required.toolTip())
        accuracy.addWidget(label)
        accuracy.addWidget(self.required, 1)
        accuracy.addWidget(self.required_text)
        right.addLayout(accuracy)
        right.addWidget(self.cheapest)
        right.addStretch(1)
        right.addWidget(self.message)
        bottom = QHBoxLayout()
        bottom.addWidget(self.again)
        bottom.addWidget(self.bar, 1)
        bottom.addWidget(self.count)
        right.addLayout(bottom)
        words = QWidget()
        words.setLayout(right)
        right.setContentsMargins(0, 0, 0, 0)
        self._words = words
        around, beside = QHBoxLayout(self), BesideOrBelow()
        around.setContentsMargins(8, 4, 8, 6)
        around.setSpacing(12)
        beside.setSpacing(12)
        around.addWidget(self.plot, 1)
        self._effects_box = self._make_effects()
        for widget in (words, self._effects_box):
            beside.addWidget(widget)
        around.addLayout(beside)

    def _make_effects(self) -> QWidget:
        """The table of effects, with its title."""
        title = Label("Cost of each effect")
        bold = title.font()
        bold.setBold(True)
        title.setFont(bold)
        title.setToolTip(
            "Computing time of each effect on the readings, and the RMS error of the shape with "
            "and without it, over the whole scene with the setting in use."
        )
        box = QWidget()
        inside = QVBoxLayout(box)
        inside.setContentsMargins(0, 0, 0, 0)
        inside.setSpacing(4)
        inside.addWidget(title)
        inside.addWidget(self.effects, 1)
        inside.addWidget(self.no_effects, 1)
        return box

    def connect_to(self, measurement: CostMeasurement) -> None:
        """Show the results of `measurement`, and pass on the requests of the user."""
        self._measurement = measurement
        measurement.changed.connect(guarded(self._show))
        self.plot.chosen.connect(guarded(measurement.choose))

    def _dress(self) -> None:
        self._words.setFixedWidth(grown(_WORDS))
        self._effects_box.setFixedWidth(grown(_EFFECTS))
        self.effects.setMinimumHeight(grown(_ROWS))
        wide = self.required_text.fontMetrics().horizontalAdvance("0.000 mm")
        self.required_text.setMinimumWidth(wide)
        self.required.setStyleSheet(slider_style())

    # Requests

    def _measure(self, *_: object) -> None:
        if self._measurement is not None:
            self._measurement.measure()

    def _slid(self, step: int) -> None:
        least, most = self._ends
        self._accuracy = least * (most / least) ** (step / _STEPS)
        self._show_required()
        if not self.required.isSliderDown():
            self._take()

    def _take(self) -> None:
        cost = self._frontier.cheapest(self._accuracy)
        now = self._measurement
        if now is not None and cost is not None:
            now.choose(cost)

    # State

    def _show(self) -> None:
        now = self._measurement
        if now is None:
            return
        self._frontier, predicted = now.frontier(), now.predicted()
        present = predicted if isinstance(predicted, Cost) else None
        live = now.measured()
        empty = now.refusal or f"Measuring{ELLIPSIS}" if now.running else ""
        self.plot.show_costs(self._frontier, present, live, empty or self._why(now))
        self._show_figures(now, predicted, live)
        self._show_slider(present)
        done, requested = now.progress
        self.bar.setMaximum(max(requested, 1))
        self.bar.setValue(done)
        self.bar.setVisible(now.running)
        left = f", {duration(now.left)} left" if math.isfinite(now.left) else ""
        self.count.setText(f"{done} of {requested}{left}" if requested else "")
        self._show_message(now, self._why(now))
        self._show_effects(now)

    def _show_effects(self, now: CostMeasurement) -> None:
        found, why = now.effect_costs(), sentence(now.why_none())
        known = isinstance(found, tuple)
        self.effects.show_effects(found if known else ())
        self.effects.setVisible(not why)
        if self.no_effects.text() != why:
            self.no_effects.setText(why)
        self.no_effects.setVisible(bool(why))

    def _why(self, now: CostMeasurement) -> str:
        """A warning about the points, or why there are none."""
        if now.refusal:
            return sentence(now.refusal)
        difference = now.difference()
        stale = difference and not now.running
        return f"Measured {difference}: measure again." if stale else ""

    def _show_message(self, now: CostMeasurement, text: str) -> None:
        hint = not text
        text = now.note() if hint else text
        if (text, hint) != (self.message.text(), self._hint):
            self._hint = hint
            self.message.setText(text)
            self.message.setForegroundRole(FAINT if hint else ALERT)
        self.message.setVisible(bool(text))

    def _show_figures(
        self, now: CostMeasurement, predicted: Cost | Refused | None, live: tuple[float, float]
    ) -> None:
        setting = now.present
        count = predicted.count if isinstance(predicted, Cost) else 0
        self.setting.show_text(NONE if setting is None else setting_text(setting, count))
        known = isinstance(predicted, Cost)
        error, time = (predicted.rms, predicted.time_per_frame) if known else (math.nan, math.nan)
        for name, (e, t) in (("Predicted", (error, time)), ("Measured", live)):
            self.figures[name, "RMS error"].show_text(length(e))
            text = f"in {duration(t)}" if math.isfinite(t) else NONE
            self.figures[name, "time"].show_text(text)
        self._show_computed(now.computed)

    def _show_computed(self, computed: ComputedFrames) -> None:
        known = math.isfinite(computed.each)
        self.computed.show_text(f"{computed.rate:.0f} frames/s" if known else NONE)
        self.each.show_text(f"in {duration(computed.each)} each" if known else NONE)
        self.each.setToolTip(
            f"Fit, contact, geometry, error bars, surface: {duration(computed.estimate)}\n"
            f"Publishing: {duration(computed.publishing)}\n"
            f"Recording, and transfer to the window: {duration(computed.keeping)}"
        )

    def _show_slider(self, present: Cost | None) -> None:
        best = self._frontier.best
        self.required.setEnabled(len(best) > 0)
        if not best:
            self._accuracy = math.nan  # a requirement for another skin does not apply
            self._show_required()
        if not best or self.required.isSliderDown():
            return
        errors = [cost.rms for cost in best]
        if not math.isfinite(self._accuracy) and present is not None:
            self._accuracy = present.rms
        # A little more than the least error, which rounding could put out of reach.
        least, most = 1.002 * min(errors), 1.01 * max(*errors, 1.01 * min(errors))
        self._ends = least, most
        asked = min(max(self._accuracy, least), most) if self._accuracy > 0 else least
        with QSignalBlocker(self.required):
            self.required.setValue(round(_STEPS * math.log(asked / least, most / least)))
        self._show_required()

    def _show_required(self) -> None:
        cost = self._frontier.cheapest(self._accuracy)
        known = math.isfinite(self._accuracy)
        self.required_text.setText(length(self._accuracy) if known else "")
        if cost is None:
            self.cheapest.setText("No measured setting reaches this accuracy." if known else "")
            return
        self.cheapest.setText(
            f"Fastest: {setting_text(cost.setting, cost.count)}: {performance(cost)}"
        )
