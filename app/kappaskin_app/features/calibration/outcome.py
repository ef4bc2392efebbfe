"""Says how good a calibration is, channel by channel."""

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from kappaskin_app.features.calibration.calibrating import Result
from kappaskin_app.features.calibration.loop_plot import Loop, LoopPlot
from kappaskin_app.features.calibration.pass_map import PassMap
from kappaskin_app.guard import guarded
from kappaskin_app.widgets.parts import (
    ELLIPSIS,
    Heading,
    button,
    in_a_row,
    named,
    number,
    text_label,
)

_WORST = 5


class Outcome(QWidget):
    """Says how good the calibration is, channel by channel."""

    def __init__(self) -> None:
        super().__init__()
        self.passed = Heading(1.3)
        self.errors = text_label(
            tip="Root mean square of what is left of the cylinders' curvature; widest difference "
            "between the way there and the way back. Both first with the line of each gage pair "
            "alone (section 5 of the paper), then with the loops undone too."
        )
        self.map, self.plot, self.channel = PassMap(), LoopPlot(), text_label()
        self.worst = text_label(tip="Click one to see its readings.")
        self.worst.setTextInteractionFlags(
            Qt.TextInteractionFlag.LinksAccessibleByMouse
            | Qt.TextInteractionFlag.LinksAccessibleByKeyboard
        )
        self.use = button(
            "Use",
            "use",
            "Correct the readings by it from now on (Ctrl+Z undoes). Loops are followed from a "
            "skin at rest: bend a real one back and forth first, less and less.",
        )
        self.save = button(f"Save{ELLIPSIS}", "save", "Write it to a file.")
        self.leave = button("New", "leave", "Begin another one; what is not saved is forgotten.")
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        around.addWidget(self.passed)
        around.addWidget(self.errors)
        around.addLayout(in_a_row(self.use, self.save, self.leave))
        for widget in (self.map, self.channel, self.plot, self.worst):
            around.addWidget(widget)
        self.map.chosen.connect(guarded(self.show_channel))
        self.worst.linkActivated.connect(guarded(lambda link: self.show_channel(int(link))))
        self._result: Result | None = None
        self._link, self._worst = "", []

    def show_result(self, result: Result) -> None:
        if result is self._result:
            return
        self._result = result
        report, layout = result.report, result.sensor.layout
        passed, total = int(report.passed.sum()), len(report.passed)
        self.passed.setText(f"{passed} of {total} channels pass")
        good = report.passed
        before, after = (
            float(np.sqrt(np.mean(lines.rms[good] ** 2))) for lines in (report.line, report.fitted)
        )
        wide, left = (float(gaps[:, good].max()) for gaps in (report.gaps, report.gaps_left))
        self.errors.setText(
            "<table cellspacing=0 cellpadding=1>"
            "<tr><td></td><td align=right><i>&nbsp;line alone</i></td>"
            "<td align=right><i>&nbsp;&nbsp;loops undone</i></td></tr>"
            f"<tr><td>Residual, RMS</td><td align=right>{before:.2f}</td>"
            f"<td align=right>{after:.2f} 1/m</td></tr>"
            f"<tr><td>Widest loop</td><td align=right>{wide:.2f}</td>"
            f"<td align=right>{left:.2f} 1/m</td></tr></table>"
        )
        failures = dict(report.calibration.failures)
        order = np.argsort(np.where(good, -report.fitted.left_out, -np.inf), kind="stable")
        worst = [int(channel) for channel in order[:_WORST]]
        self._worst = worst
        self._show_worst()
        self.map.show_channels(layout, failures, [self._told(c) for c in range(total)])
        self.show_channel(worst[0])

    def _show_worst(self) -> None:
        if self._result is None:
            return
        report = self._result.report
        elements, failures = len(report.passed) // 3, dict(report.calibration.failures)
        lines = [
            f'<a href="{c}" style="color: {self._link}">{named(c, elements)}</a>: '
            + failures.get(c, f"error {report.fitted.left_out[c]:.2f} 1/m")
            for c in self._worst
        ]
        self.worst.setText("<br>".join(["Worst:", *lines]))

    def show_colour(self, link: str) -> None:
        """The colour of what can be clicked."""
        self._link = link
        self._show_worst()

    def _told(self, channel: int) -> str:
        """A channel in words."""
        if self._result is None:
            return ""
        report = self._result.report
        fit, why = report.fitted, dict(report.calibration.failures).get(channel)
        name = named(channel, len(report.passed) // 3)
        if why:
            return f"{name} fails: {why}"
        return (
            f"{name}: gain {fit.gain[channel]:.3f}, offset "
            f"{number(float(fit.offset[channel]), '+.2f')} 1/m, error "
            f"{fit.left_out[channel]:.2f} 1/m"
        )

    def show_channel(self, channel: int) -> None:
        if self._result is None:
            return
        self.map.show_channel(channel)
        self.channel.setText(self._told(channel))
        self.plot.show_loop(_loop(self._result, channel))


def _loop(result: Result, channel: int) -> Loop:
    """What `channel` read wherever its component was bent, or all was flat.

    Without the steps that only wipe out the past.
    """
    sweep, report = result.sweep, result.report
    applied = sweep.curvature[:, channel // (len(report.passed) // 3)]
    flat = np.array([step.flat for step in sweep.steps])
    counts = np.array([step.way != "first" for step in sweep.steps])
    used = np.flatnonzero(counts & (flat | (applied != 0)))
    steps = [sweep.steps[k] for k in used]
    return Loop(
        applied[used],
        sweep.readings[used, channel],
        np.array([step.back for step in steps]),
        np.diff(used, prepend=-2) > 1,
        float(report.fitted.gain[channel]),
        float(report.fitted.offset[channel]),
    )
