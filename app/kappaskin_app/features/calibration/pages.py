"""Pages of the calibration: start, steps and result."""

from html import escape

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QFormLayout,
    QGridLayout,
    QLineEdit,
    QProgressBar,
    QVBoxLayout,
    QWidget,
)

from kappaskin._text import with_error
from kappaskin.calibration import Procedure
from kappaskin.errors import Refusal
from kappaskin.frames import COMPONENTS
from kappaskin.scenes.cylinders import ADVICE, CylinderStep, schedule
from kappaskin.sensing import SensorLayout
from kappaskin_app.features.calibration.controller import (
    CalibrationController,
    Result,
    parsed_radii,
)
from kappaskin_app.features.calibration.plots import (
    LOOP_AXES,
    LOOP_TIP,
    CylinderView,
    PassMap,
    loop_series,
)
from kappaskin_app.guard import guarded
from kappaskin_app.theme import current, follow_look, grown
from kappaskin_app.widgets.chart import Chart, Series
from kappaskin_app.widgets.parts import (
    ELLIPSIS,
    Heading,
    Label,
    button,
    in_a_row,
    seconds_box,
    sentence,
    text_label,
)

_LOOP_HIGH = 230  # px
EQUATION_8 = "Nominal curvature, by Eq. 8 from the voltage: kappa = 4 V / (V_in GF (t_s + t_g) G). "


class StartPage(QWidget):
    """Page with the cylinders and the duration of each step."""

    def __init__(self) -> None:
        super().__init__()
        self.radii = QLineEdit()
        self.radii.setObjectName("radii")
        self.radii.setToolTip("Radii in mm of your cylinders, in any order; at least three.")
        self.seconds = seconds_box(
            "seconds", 0.1, 1.0, "Time over which the readings of a step are averaged."
        )
        self.hold = seconds_box(
            "hold",
            0.0,
            0.0,
            "Time on the smallest cylinder at the start, to measure the creep of the glue; zero "
            "for none.",
        )
        self.hold.setSpecialValueText("none")
        self.plan = text_label()
        self.begin = button("Start", "begin", "Start with the flat table.")
        form = QFormLayout()
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        form.setVerticalSpacing(5)
        for words, editor in (
            ("Radii, mm", self.radii),
            ("Time per step", self.seconds),
            ("Initial hold", self.hold),
        ):
            label = Label(words)
            label.setBuddy(editor)
            label.setToolTip(editor.toolTip())
            form.addRow(label, editor)
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        around.addLayout(form)
        around.addWidget(self.plan)
        around.addWidget(text_label(ADVICE))
        around.addWidget(self.begin)
        self.radii.returnPressed.connect(self.begin.click)

    def show_plan(self, layout: SensorLayout | None) -> None:
        """Show the number of steps and their duration, or why there are none."""
        strip = layout is not None and layout.patch.strip
        try:
            if layout is not None:
                layout.check_curvature_sensor("a calibration with cylinders")
            steps = schedule(parsed_radii(self.radii.text()), self.hold.value(), strip)
        except Refusal as refusal:
            text = sentence(str(refusal))
        else:
            total = sum(max(self.seconds.value(), step.hold) for step in steps)
            bent = "along x" if strip else "along x, along y and along the diagonal"
            text = (
                f"{len(steps)} steps: bent {bent}; on each face with falling and rising radii, "
                f"flat between. {_duration(total)} of readings."
            )
        if text != self.plan.text():
            self.plan.setText(text)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} minutes"


_BENT = {"x": "bent along x", "y": "bent along y", "diagonal": "bent along the diagonal"}
_PHASES = {
    "there": "falling radius",
    "back": "rising radius",
    "first": "preconditioning",
}


class CylinderStepPage(QWidget):
    """Page with the present step, and the readings of the last one."""

    def __init__(self) -> None:
        super().__init__()
        self.number = Label()
        self.bar = QProgressBar(textVisible=False)  # pyright: ignore[reportCallIssue]
        self.bar.setFixedHeight(8)
        self.bar.setToolTip("Progress of the steps.")
        self.what = Heading(1.5)
        self.how = text_label()
        self.drawing = CylinderView()
        self.capture = button(
            "Capture", "take", "Capture the readings of this step (Enter, Space, Ctrl+Shift+K)."
        )
        self.redo = button("Repeat last step", "redo", "Go back by one step.")
        self.cancel = button("Cancel", "cancel", "End, and discard the captured steps.")
        self.all = button(
            "Capture all",
            "take-all",
            "Capture all steps automatically, for the simulated skin.",
        )
        self.read = QGridLayout()
        self.read.setVerticalSpacing(2)
        self.heading = text_label()
        self.cells = [[Label() for _ in range(3)] for _ in COMPONENTS]
        self._arrange()

    def _arrange(self) -> None:
        heads = (
            ("", ""),
            ("reading", EQUATION_8 + "The median of the elements."),
            ("cylinder", "This component of the curvature 1/R of the cylinder."),
            ("noise", "Standard deviation of one frame, the median of the elements."),
        )
        for column, (words, tip) in enumerate(heads):
            head = Label(f"<i>{words}</i>", rich=True)
            head.setToolTip(tip)
            self.read.addWidget(head, 0, column, Qt.AlignmentFlag.AlignRight)
        for row, name in enumerate(COMPONENTS, 1):
            self.read.addWidget(Label(name), row, 0)
            for column, cell in enumerate(self.cells[row - 1], 1):
                self.read.addWidget(cell, row, column, Qt.AlignmentFlag.AlignRight)
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        for widget in (self.number, self.bar, self.what, self.how, self.drawing, self.capture):
            around.addWidget(widget)
        around.addWidget(self.all)
        around.addLayout(in_a_row(self.redo, self.cancel))
        around.addWidget(self.heading)
        around.addLayout(self.read)

    def show_step(
        self, now: CalibrationController, procedure: Procedure, step: CylinderStep | None
    ) -> None:
        done, total = len(procedure.taken), len(procedure.steps)
        self.bar.setRange(0, 100 * total)
        self.bar.setValue(round(100 * (done + now.share)))
        self.redo.setEnabled(bool(done) and not now.computing)
        self.capture.setEnabled(not now.computing)
        self.all.setEnabled(not now.computing)
        self.all.setText("Step by step" if now.automatic else "Capture all")
        self.capture.setText(f"Capturing{ELLIPSIS}" if now.capturing else "Capture")
        if step is None:
            self.number.setText(f"{total} of {total} captured")
            self.what.setText(f"Computing the calibration{ELLIPSIS}")
            self.how.setText("")
        else:
            self.number.setText(f"Step {step.number} of {total}")
            self.what.setText(_title(step))
            self.how.setText(_instruction(step))
            self.drawing.show_step(step, procedure.sensor.layout.patch)
        self._show_read(procedure)

    def _show_read(self, procedure: Procedure) -> None:
        if not procedure.taken:
            self.heading.setText("")
            for cell in (cell for row in self.cells for cell in row):
                cell.setText("\N{EN DASH}")
            return
        taken = procedure.taken[-1]
        missing = int(np.isnan(taken.mean).sum())
        lost = f"; {missing} channels dead or saturated" if missing else ""
        self.heading.setText(
            f"Step {taken.step.number}: mean of {taken.frames} frames{lost} (1/m):"
        )
        parts = zip(taken.mean.reshape(3, -1), taken.noise.reshape(3, -1), strict=True)
        for row, (mean, noise) in enumerate(parts):
            values = (_median(mean), float(taken.step.curvature[row]))
            texts = [with_error(value, digits=1, sign="+") for value in values]
            texts.append(with_error(_median(noise), digits=2))
            for cell, text in zip(self.cells[row], texts, strict=True):
                cell.setText(text)


def _title(step: CylinderStep) -> str:
    return "Flat table" if step.flat else f"Cylinder of {1e3 * step.radius:g} mm"


def _instruction(step: CylinderStep) -> str:
    if step.flat:
        return "Nothing pressing on the skin.\n"
    face = "inner face on it" if step.face > 0 else "outer face on it"
    if step.hold:
        return (
            f"{_BENT[step.along]}, {face}: press Capture, then lay the skin on it for "
            f"{step.hold:g} s"
        )
    return f"{_BENT[step.along]}, {face},\n{_PHASES[step.way]}"


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")


_WORST = 5


class ResultPage(QWidget):
    """Page with the result: accuracy of every channel."""

    def __init__(self) -> None:
        super().__init__()
        self.passed = Heading(1.3)
        self.errors = text_label(
            rich=True,
            tip="RMS of the residuals from the cylinders' curvature, and the largest difference of "
            "readings at falling and rising radius. Both with a straight line for each gage pair "
            "(section 5 of the paper), and with hysteresis compensated. The standard error in use "
            "is that of corrected curvature on other cylinders and in another order.",
        )
        self.map, self.plot, self.channel = PassMap(), Chart(*LOOP_AXES, LOOP_TIP), text_label()
        self.worst = text_label(tip="Click a channel to see its readings.", rich=True)
        self.worst.setTextInteractionFlags(
            Qt.TextInteractionFlag.LinksAccessibleByMouse
            | Qt.TextInteractionFlag.LinksAccessibleByKeyboard
        )
        self.use = button(
            "Use",
            "use",
            "Correct the readings with this calibration (Ctrl+Z undoes). The hysteresis model "
            "starts at rest: bend a real skin back and forth first, with decreasing amplitude.",
        )
        self.save = button(f"Save{ELLIPSIS}", "save", "Write it to a file.")
        self.leave = button("New", "leave", "Start another calibration; discard an unsaved result.")
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
        self._worst = list[int]()
        follow_look(self, self._show_worst)
        follow_look(self.plot, lambda: self.plot.setMinimumHeight(grown(_LOOP_HIGH)))

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
        expected = float(np.sqrt(np.mean(report.error[good] ** 2)))
        wide, left = (float(gaps[:, good].max()) for gaps in (report.gaps, report.gaps_left))
        self.errors.setText(
            "<table cellspacing=0 cellpadding=1>"
            "<tr><td></td><td align=right><i>&nbsp;straight line</i></td>"
            "<td align=right><i>&nbsp;&nbsp;hysteresis compensated</i></td></tr>"
            f"<tr><td>Residual, RMS</td><td align=right>{before:.2f}</td>"
            f"<td align=right>{after:.2f} 1/m</td></tr>"
            f"<tr><td>Widest hysteresis loop</td><td align=right>{wide:.2f}</td>"
            f"<td align=right>{left:.2f} 1/m</td></tr>"
            "<tr><td>Standard error in use</td><td></td>"
            f"<td align=right>{expected:.2f} 1/m</td></tr></table>"
        )
        failures = dict(report.calibration.failures)
        order = np.argsort(np.where(good, -report.error, -np.inf), kind="stable")
        worst = [int(channel) for channel in order[:_WORST]]
        self._worst = worst
        self._show_worst()
        self.map.show_channels(layout, failures, [self._channel_text(c) for c in range(total)])
        self.show_channel(worst[0])

    def _show_worst(self) -> None:
        if self._result is None:
            return
        report = self._result.report
        elements, failures = len(report.passed) // 3, dict(report.calibration.failures)
        lines = [
            f'<a href="{c}" style="color: {current().accent}">{_name(c, elements)}</a>: '
            + escape(failures.get(c, f"error {report.error[c]:.2f} 1/m"))
            for c in self._worst
        ]
        self.worst.setText("<br>".join(["Worst:", *lines]))

    def _channel_text(self, channel: int) -> str:
        """Text of a channel: gain, offset and error, or its fault."""
        if self._result is None:
            return ""
        report = self._result.report
        fit, why = report.fitted, dict(report.calibration.failures).get(channel)
        name = _name(channel, len(report.passed) // 3)
        if why:
            return f"{name} fails: {why}"
        return (
            f"{name}: gain {fit.gain[channel]:.3f}, offset "
            f"{with_error(float(fit.offset[channel]), unit='1/m', digits=2, sign='+')}, error "
            f"{report.error[channel]:.2f} 1/m"
        )

    def show_channel(self, channel: int) -> None:
        if self._result is None:
            return
        self.map.show_channel(channel)
        self.channel.setText(self._channel_text(channel))
        self.plot.show_series(_loop(self._result, channel), "No readings.")


def _loop(result: Result, channel: int) -> list[Series]:
    """Readings of `channel` at the flat steps and those that bend its component.

    Without preconditioning.
    """
    sweep, report = result.sweep, result.report
    applied = sweep.curvature[:, channel // (len(report.passed) // 3)]
    flat = np.array([step.flat for step in sweep.steps])
    counts = np.array([step.way != "first" for step in sweep.steps])
    used = np.flatnonzero(counts & (flat | (applied != 0)))
    steps = [sweep.steps[k] for k in used]
    return loop_series(
        applied[used],
        sweep.readings[used, channel],
        np.array([step.back for step in steps]),
        np.diff(used, prepend=-2) > 1,
        float(report.fitted.gain[channel]),
        float(report.fitted.offset[channel]),
    )


def _name(channel: int, elements: int) -> str:
    return f"{COMPONENTS[channel // elements]} of element {channel % elements}"
