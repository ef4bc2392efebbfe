"""What accuracy costs: asks which accuracy is wanted, shows what it takes and what is had."""

import math

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import (
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QSlider,
    QVBoxLayout,
    QWidget,
)

from kappaskin.studies import Cost, Refused
from kappaskin_app.features.accuracy.cost_plot import CostPlot
from kappaskin_app.features.accuracy.costing import Costing, Frontier, gives, in_words
from kappaskin_app.guard import guarded
from kappaskin_app.shell.effects import EffectsTable
from kappaskin_app.theme import ALERT, FAINT, follow_look, grown, slider_style
from kappaskin_app.widgets.line import Line
from kappaskin_app.widgets.parts import ELLIPSIS, button, sentence, text_label
from kappaskin_app.widgets.plots import LogAxis
from kappaskin_app.widgets.text import NONE, duration, length

_STEPS = 200  # of the slider
_WORDS, _EFFECTS = 350, 376  # px wide


class CostPanel(QWidget):
    """The plot, the setting in use in figures, and a slider that chooses the cheapest one.

    Beside them is what each effect of the scene costs with the setting in use.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.plot = CostPlot()
        self._make_figures()
        self.wanted = QSlider(Qt.Orientation.Horizontal)
        self.wanted.setObjectName("wanted")
        self.wanted.setRange(0, _STEPS)
        self.wanted.setPageStep(_STEPS // 10)
        self.wanted.setToolTip(
            "How large the RMS error of the shape may be. Letting go switches to the setting that "
            "reaches it with the least arithmetic (Ctrl+Z undoes)."
        )
        self.wanted_words = QLabel()
        self.cheapest = text_label()
        self.cheapest.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.again = button(
            "Measure",
            "measure",
            "Measure every setting anew, on the skin, the load and the noise as they are now. It "
            "runs beside the window, one setting after the other, while this panel is seen.",
        )
        self.bar = QProgressBar(textVisible=False)  # pyright: ignore[reportCallIssue]
        self.bar.setFixedHeight(8)
        self.bar.setToolTip("Settings that are measured.")
        self.count, self.message = QLabel(), text_label()
        self.effects, self.no_effects = EffectsTable(), text_label()
        self.no_effects.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.no_effects.setForegroundRole(FAINT)
        self.no_effects.hide()
        self._lay_out()
        self._costing: Costing | None = None
        self._accuracy = math.nan
        self._axis, self._frontier = LogAxis(1e-5, 1e-4), Frontier()
        self._hint = None
        self.wanted.valueChanged.connect(guarded(self._slid))
        self.wanted.sliderReleased.connect(guarded(self._take))
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

    def _lay_out(self) -> None:
        right = QVBoxLayout()
        right.setSpacing(4)
        right.addWidget(self.setting)
        grid = QGridLayout()
        grid.setVerticalSpacing(0)
        tips = {
            "Predicted": "What this setting gave and took when it was measured beside the window.",
            "Measured": "What the present frames give and take, over half a second; the error is "
            "known only where a simulation knows the true shape.",
        }
        for row, (name, tip) in enumerate(tips.items()):
            label = QLabel(name)
            label.setToolTip(tip)
            grid.addWidget(label, row, 0)
            for column, what in enumerate(("RMS error", "time"), 1):
                self.figures[name, what].setToolTip(tip)
                grid.addWidget(self.figures[name, what], row, column)
        grid.setColumnStretch(1, 2)
        grid.setColumnStretch(2, 3)
        right.addLayout(grid)
        ask = QHBoxLayout()
        label = QLabel("Accuracy &wanted")
        label.setBuddy(self.wanted)
        label.setToolTip(self.wanted.toolTip())
        ask.addWidget(label)
        ask.addWidget(self.wanted, 1)
        ask.addWidget(self.wanted_words)
        right.addLayout(ask)
        right.addWidget(self.cheapest)
        right.addStretch(1)
        right.addWidget(self.message)
        foot = QHBoxLayout()
        foot.addWidget(self.again)
        foot.addWidget(self.bar, 1)
        foot.addWidget(self.count)
        right.addLayout(foot)
        words = QWidget()
        words.setLayout(right)
        right.setContentsMargins(0, 0, 0, 0)
        self._words = words
        around = QHBoxLayout(self)
        around.setContentsMargins(8, 4, 8, 6)
        around.setSpacing(12)
        around.addWidget(self.plot, 1)
        around.addWidget(words)
        self._side = self._beside()
        around.addWidget(self._side)

    def _beside(self) -> QWidget:
        """The table of effects, with its title."""
        title = QLabel("What each effect costs")
        bold = title.font()
        bold.setBold(True)
        title.setFont(bold)
        title.setToolTip(
            "What spoils the readings of the scene: what it takes to simulate, and the RMS error "
            "of the shape with it and without it, with the setting in use, all over the scene."
        )
        beside = QWidget()
        inside = QVBoxLayout(beside)
        inside.setContentsMargins(0, 0, 0, 0)
        inside.setSpacing(4)
        inside.addWidget(title)
        inside.addWidget(self.effects, 1)
        inside.addWidget(self.no_effects, 1)
        return beside

    def attend(self, costing: Costing) -> None:
        """Show what `costing` measures, and pass on what the user requests."""
        self._costing = costing
        costing.changed.connect(guarded(self._show))
        self.plot.chosen.connect(guarded(costing.choose))

    def _dress(self) -> None:
        self._words.setFixedWidth(grown(_WORDS))
        self._side.setFixedWidth(grown(_EFFECTS))
        wide = self.wanted_words.fontMetrics().horizontalAdvance("0.000 mm")
        self.wanted_words.setMinimumWidth(wide)
        self.wanted.setStyleSheet(slider_style())

    # What a person asks.

    def _measure(self, *_: object) -> None:
        if self._costing is not None:
            self._costing.measure()

    def _slid(self, step: int) -> None:
        self._accuracy = self._axis.at(step / _STEPS)
        self._show_wanted()
        if not self.wanted.isSliderDown():
            self._take()

    def _take(self) -> None:
        cost = self._frontier.cheapest(self._accuracy)
        now = self._costing
        if now is not None and cost is not None:
            now.choose(cost)

    # What is so.

    def _show(self) -> None:
        now = self._costing
        if now is None:
            return
        self._frontier, predicted = now.frontier(), now.predicted()
        present = predicted if isinstance(predicted, Cost) else None
        live = now.measured()
        empty = now.refusal or f"Measuring{ELLIPSIS}" if now.running else ""
        self.plot.show_costs(self._frontier, present, live, empty or self._why(now))
        self._show_figures(now, predicted, live)
        self._show_slider(present)
        done, asked = now.progress
        self.bar.setMaximum(max(asked, 1))
        self.bar.setValue(done)
        self.bar.setVisible(now.running)
        self.count.setText(f"{done} of {asked}" if asked else "")
        self._show_message(now, self._why(now))
        self._show_effects(now)

    def _show_effects(self, now: Costing) -> None:
        found, why = now.spoiling(), sentence(now.why_none())
        known = isinstance(found, tuple)
        self.effects.show_effects(found if known else ())
        self.effects.setVisible(not why)
        if self.no_effects.text() != why:
            self.no_effects.setText(why)
        self.no_effects.setVisible(bool(why))

    def _why(self, now: Costing) -> str:
        """What must be known of the points, or why there are none."""
        if now.refusal:
            return sentence(now.refusal)
        unlike = now.unlike()
        return f"Measured {unlike}: measure again." if unlike else ""

    def _show_message(self, now: Costing, text: str) -> None:
        hint = not text
        text = now.note() if hint else text
        if (text, hint) != (self.message.text(), self._hint):
            self._hint = hint
            self.message.setText(text)
            self.message.setForegroundRole(FAINT if hint else ALERT)
        self.message.setVisible(bool(text))

    def _show_figures(
        self, now: Costing, predicted: Cost | Refused | None, live: tuple[float, float]
    ) -> None:
        setting = now.present
        count = predicted.count if isinstance(predicted, Cost) else 0
        self.setting.show_text(NONE if setting is None else in_words(setting, count))
        known = isinstance(predicted, Cost)
        error, time = (predicted.rms, predicted.time_per_frame) if known else (math.nan, math.nan)
        for name, (e, t) in (("Predicted", (error, time)), ("Measured", live)):
            self.figures[name, "RMS error"].show_text(length(e))
            said = f"in {duration(t)}" if math.isfinite(t) else NONE
            self.figures[name, "time"].show_text(said)

    def _show_slider(self, present: Cost | None) -> None:
        best = self._frontier.best
        self.wanted.setEnabled(len(best) > 0)
        if not best:
            self._accuracy = math.nan  # what was wanted of another skin says nothing of this one
            self._show_wanted()
        if not best or self.wanted.isSliderDown():
            return
        errors = [cost.rms for cost in best]
        if not math.isfinite(self._accuracy) and present is not None:
            self._accuracy = present.rms
        # A little more than the best one, or rounding would put it out of reach.
        self._axis = LogAxis(1.002 * min(errors), 1.01 * max(*errors, 1.01 * min(errors)))
        with QSignalBlocker(self.wanted):
            self.wanted.setValue(round(_STEPS * self._axis.share(self._accuracy)))
        self._show_wanted()

    def _show_wanted(self) -> None:
        cost = self._frontier.cheapest(self._accuracy)
        known = math.isfinite(self._accuracy)
        self.wanted_words.setText(length(self._accuracy) if known else "")
        if cost is None:
            self.cheapest.setText("Nothing that was measured reaches it." if known else "")
            return
        self.cheapest.setText(f"Cheapest: {in_words(cost.setting, cost.count)}: {gives(cost)}")
