"""Calibration on cylinders of known radius: what to do next, what came of it, what is in use."""

from pathlib import Path

import numpy as np
from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin import (
    ADVICE,
    COMPONENTS,
    Calibration,
    Procedure,
    Refusal,
    Status,
    Step,
    radii_for,
    schedule,
)
from kappaskin_app.calibrating import Calibrating, Result, parsed_radii
from kappaskin_app.guard import guarded
from kappaskin_app.panels.panel import Panel
from kappaskin_app.settings import Settings
from kappaskin_app.theme import Theme
from kappaskin_app.views.cylinder import CylinderView
from kappaskin_app.views.loop_plot import Loop, LoopPlot
from kappaskin_app.views.pass_map import PassMap

_FILES = "Calibration (*.toml)"
_WORST = 5
_ELLIPSIS = "\N{HORIZONTAL ELLIPSIS}"
_BENT = {"x": "bent along x", "y": "bent along y", "diagonal": "bent along the diagonal"}
_WAYS = {
    "there": "on the way there",
    "back": "on the way back",
    "first": "first of all, to wipe out its past",
}
_EQUATION_8 = (
    "Nominal curvature, as Eq. 8 reads it from the voltage: kappa = 4 V / (V_in GF (t_s + t_g) G). "
)


def said(calibration: Calibration) -> str:
    """A calibration in a few words."""
    passed, all_ = int(np.isfinite(calibration.gain).sum()), len(calibration.gain)
    day = calibration.date.astimezone()
    return f"calibrated {day:%Y-%m-%d}, {passed} of {all_} channels"


def _named(channel: int, elements: int) -> str:
    return f"{COMPONENTS[channel // elements]} of element {channel % elements}"


def _label(text: str = "", tip: str = "") -> QLabel:
    label = QLabel(text, wordWrap=True)  # pyright: ignore[reportCallIssue]
    label.setToolTip(tip)
    return label


class _PushedByEnter(QPushButton):
    """A button that Enter pushes too, as Space does."""

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.click()
        else:
            super().keyPressEvent(event)


def _button(text: str, name: str, tip: str) -> QPushButton:
    button = _PushedByEnter(text)
    button.setObjectName(name)
    button.setToolTip(tip)
    return button


def _row(*widgets: QWidget) -> QHBoxLayout:
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    return row


def _seconds(name: str, least: float, value: float, tip: str) -> QDoubleSpinBox:
    box = QDoubleSpinBox()
    box.setObjectName(name)
    box.setDecimals(1)
    box.setRange(least, 3600.0)
    box.setValue(value)
    box.setSuffix(" s")
    box.setToolTip(tip)
    box.setAlignment(Qt.AlignmentFlag.AlignRight)
    return box


class _Start(QWidget):
    """Asks with which cylinders, and how long on each."""

    def __init__(self) -> None:
        super().__init__()
        self.radii = QLineEdit()
        self.radii.setObjectName("radii")
        self.radii.setToolTip(
            "Radii in mm of the cylinders that you have, in any order; at least three."
        )
        self.seconds = _seconds(
            "seconds", 0.1, 1.0, "How long the readings of a step are averaged."
        )
        self.hold = _seconds(
            "hold",
            0.0,
            0.0,
            "Above zero, the skin first stays so long on the smallest cylinder, which shows how "
            "the glue creeps.",
        )
        self.hold.setSpecialValueText("none")
        self.plan = _label()
        self.begin = _button("Begin", "begin", "Begin with the flat table.")
        form = QFormLayout()
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        form.setVerticalSpacing(5)
        for words, editor in (
            ("Radii, mm", self.radii),
            ("Time on each", self.seconds),
            ("First hold", self.hold),
        ):
            label = QLabel(words)
            label.setBuddy(editor)
            label.setToolTip(editor.toolTip())
            form.addRow(label, editor)
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        around.addLayout(form)
        around.addWidget(self.plan)
        around.addWidget(_label(ADVICE))
        around.addWidget(self.begin)
        self.radii.returnPressed.connect(self.begin.click)

    def show_plan(self, strip: bool) -> None:
        """Say what the cylinders come to."""
        try:
            steps = schedule(parsed_radii(self.radii.text()), self.hold.value(), strip)
        except Refusal as refusal:
            text = str(refusal)
        else:
            total = sum(max(self.seconds.value(), step.hold) for step in steps)
            ways = "along x" if strip else "along x, along y and along the diagonal"
            text = (
                f"{len(steps)} steps: bent {ways}; on each face from large to small radii and "
                f"back, flat between. {_duration(total)} of readings."
            )
        if text != self.plan.text():
            self.plan.setText(text[:1].upper() + text[1:])


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} minutes"


class _Steps(QWidget):
    """Says which step is next, and what the last one read."""

    def __init__(self) -> None:
        super().__init__()
        self.number = QLabel()
        self.bar = QProgressBar(textVisible=False)  # pyright: ignore[reportCallIssue]
        self.bar.setFixedHeight(8)
        self.bar.setToolTip("Steps that are done, and how far this one is.")
        self.what = _label()
        font = self.what.font()
        font.setPointSizeF(1.5 * font.pointSizeF())
        font.setBold(True)
        self.what.setFont(font)
        self.how = _label()
        self.drawing = CylinderView()
        self.take = _button(
            "Take", "take", "Take what the skin reads now, and go on (Enter, Space, Ctrl+K)."
        )
        self.redo = _button("Take the last one again", "redo", "Go back by one step.")
        self.cancel = _button("Cancel", "cancel", "End here, and forget what was taken.")
        self.all = _button(
            "Take all",
            "take-all",
            "Go through all steps unattended: the simulated skin lays itself on each cylinder.",
        )
        self.read = QGridLayout()
        self.read.setVerticalSpacing(2)
        self.heading = _label()
        self.cells = [[QLabel() for _ in range(3)] for _ in COMPONENTS]
        self._lay_out()

    def _lay_out(self) -> None:
        heads = (
            ("", ""),
            ("read", _EQUATION_8 + "The median of the elements."),
            ("cylinder", "The curvature 1/R of the cylinder, as this component has it."),
            ("noise", "Standard deviation of one frame, the median of the elements."),
        )
        for column, (words, tip) in enumerate(heads):
            head = QLabel(f"<i>{words}</i>")
            head.setToolTip(tip)
            self.read.addWidget(head, 0, column, Qt.AlignmentFlag.AlignRight)
        for row, name in enumerate(COMPONENTS, 1):
            self.read.addWidget(QLabel(name), row, 0)
            for column, cell in enumerate(self.cells[row - 1], 1):
                self.read.addWidget(cell, row, column, Qt.AlignmentFlag.AlignRight)
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        for widget in (self.number, self.bar, self.what, self.how, self.drawing, self.take):
            around.addWidget(widget)
        around.addWidget(self.all)
        around.addLayout(_row(self.redo, self.cancel))
        around.addWidget(self.heading)
        around.addLayout(self.read)

    def show_step(self, now: Calibrating, procedure: Procedure, step: Step | None) -> None:
        done, total = len(procedure.taken), len(procedure.steps)
        self.bar.setRange(0, 100 * total)
        self.bar.setValue(round(100 * (done + now.share)))
        self.redo.setEnabled(bool(done) and not now.computing)
        self.take.setEnabled(not now.computing)
        self.all.setEnabled(not now.computing)
        self.all.setText("Go on step by step" if now.unattended else "Take all")
        self.take.setText(f"Taking{_ELLIPSIS}" if now.taking else "Take")
        if step is None:
            self.number.setText(f"{total} of {total} taken")
            self.what.setText(f"Computing the calibration{_ELLIPSIS}")
            self.how.setText("")
        else:
            self.number.setText(f"Step {step.number} of {total}")
            self.what.setText(_what(step))
            self.how.setText(_how(step))
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
        lost = f"; {missing} channels dead or on a rail" if missing else ""
        self.heading.setText(
            f"Step {taken.step.number} read, in {taken.frames} frames{lost} (1/m):"
        )
        parts = zip(taken.mean.reshape(3, -1), taken.noise.reshape(3, -1), strict=True)
        for row, (mean, noise) in enumerate(parts):
            values = (_median(mean), float(taken.step.curvature[row]))
            texts = [_number(value, "+.1f") for value in values] + [_number(_median(noise), ".2f")]
            for cell, text in zip(self.cells[row], texts, strict=True):
                cell.setText(text)


def _what(step: Step) -> str:
    return "Flat table" if step.flat else f"Cylinder of {1e3 * step.radius:g} mm"


def _how(step: Step) -> str:
    if step.flat:
        return "Nothing pressing on the skin.\n"
    face = "inner face on it" if step.face > 0 else "outer face on it"
    if step.hold:
        return f"{_BENT[step.along]}, {face}: press Take, then lay it on; it stays {step.hold:g} s"
    return f"{_BENT[step.along]}, {face},\n{_WAYS[step.way]}"


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")


def _number(value: float, how: str) -> str:
    if not np.isfinite(value):
        return "\N{EN DASH}"
    rounded = round(value, int(how[-2])) + 0.0  # no minus before a zero
    return f"{rounded:{how}}".replace("-", "\N{MINUS SIGN}")


class _Outcome(QWidget):
    """Says how good the calibration is, channel by channel."""

    def __init__(self) -> None:
        super().__init__()
        self.passed = _label()
        font = self.passed.font()
        font.setPointSizeF(1.3 * font.pointSizeF())
        font.setBold(True)
        self.passed.setFont(font)
        self.errors = _label(
            tip="Root mean square of what is left of the cylinders' curvature; widest difference "
            "between the way there and the way back. Both first with the line of each gage pair "
            "alone (section 5 of the paper), then with the loops undone too."
        )
        self.map, self.plot, self.channel = PassMap(), LoopPlot(), _label()
        self.worst = _label(tip="Click one to see its readings.")
        self.worst.setTextInteractionFlags(
            Qt.TextInteractionFlag.LinksAccessibleByMouse
            | Qt.TextInteractionFlag.LinksAccessibleByKeyboard
        )
        self.use = _button(
            "Use",
            "use",
            "Correct the readings by it from now on (Ctrl+Z undoes). Loops are followed from a "
            "skin at rest: bend a real one back and forth first, less and less.",
        )
        self.save = _button(f"Save{_ELLIPSIS}", "save", "Write it to a file.")
        self.leave = _button("New", "leave", "Begin another one; what is not saved is forgotten.")
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        around.addWidget(self.passed)
        around.addWidget(self.errors)
        around.addLayout(_row(self.use, self.save, self.leave))
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
            f'<a href="{c}" style="color: {self._link}">{_named(c, elements)}</a>: '
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
        name = _named(channel, len(report.passed) // 3)
        if why:
            return f"{name} fails: {why}"
        return (
            f"{name}: gain {fit.gain[channel]:.3f}, offset "
            f"{_number(float(fit.offset[channel]), '+.2f')} 1/m, error "
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


class CalibratePanel(Panel):
    """Guides through a calibration on cylinders, and shows what came of it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Cylinders of known radius", parent)
        self.start, self.steps, self.outcome = _Start(), _Steps(), _Outcome()
        for page in (self.start, self.steps, self.outcome):
            self.body.addWidget(page)
        self._calibrating: Calibrating | None = None
        self._status = Status()
        self._meeting = 0
        self._phase: QWidget = self.start
        self._show_page()
        for editor in (self.start.seconds, self.start.hold):
            editor.valueChanged.connect(self._plan)
        self.start.radii.textChanged.connect(self._plan)

    def attend(self, calibrating: Calibrating) -> None:
        """Show how `calibrating` goes, and tell it what a person wishes."""
        self._calibrating = calibrating
        start, steps, outcome = self.start, self.steps, self.outcome
        calibrating.changed.connect(guarded(self._show))
        for button, wish in (
            (start.begin, self._begin),
            (steps.take, calibrating.take),
            (steps.redo, calibrating.redo),
            (steps.cancel, calibrating.cancel),
            (steps.all, self._take_all),
            (outcome.use, calibrating.use),
            (outcome.leave, calibrating.leave),
            (outcome.save, self._save),
        ):
            button.clicked.connect(guarded(lambda *_, wish=wish: wish()))

    def show_status(self, status: Status, simulating: bool) -> None:
        self._status = status
        self.steps.all.setVisible(simulating)
        self.start.begin.setEnabled(status.sensor is not None and status.state == "streaming")
        if status.sensor is not None and status.meetings != self._meeting:
            self._meeting = status.meetings
            radii = ", ".join(f"{1e3 * radius:g}" for radius in radii_for(status.sensor))
            with QSignalBlocker(self.start.radii):
                self.start.radii.setText(radii)
                self.start.radii.setCursorPosition(0)
            self._plan()

    def show_theme(self, theme: Theme) -> None:
        super().show_theme(theme)
        for view in (self.steps.drawing, self.outcome.map, self.outcome.plot):
            view.show_theme(theme)
        self.outcome.show_colour(theme.accent)

    def _plan(self, *_: object) -> None:
        sensor = self._status.sensor
        self.start.show_plan(sensor is not None and sensor.layout.patch.strip)

    def _begin(self) -> None:
        if self._calibrating is None:
            return
        try:
            radii = parsed_radii(self.start.radii.text())
        except Refusal as refusal:
            self.show_message(_sentence(str(refusal)))
            return
        self._calibrating.begin(radii, self.start.seconds.value(), self.start.hold.value())

    def _take_all(self) -> None:
        if self._calibrating is not None:
            now = self._calibrating
            (now.pause if now.unattended else now.take_all)()

    def _save(self) -> None:
        if self._calibrating is None or self._calibrating.result is None:
            return
        found = self._calibrating.result.report.calibration
        name = f"calibration-{found.serial_number}-{found.date.astimezone():%Y%m%d}.toml"
        path, _ = QFileDialog.getSaveFileName(self, "Save the calibration", name, _FILES)
        if path:
            self._calibrating.save(Path(path))

    def _show(self) -> None:
        now = self._calibrating
        if now is None:
            return
        phase = self.steps if now.procedure else self.outcome if now.result else self.start
        if now.procedure:
            self.steps.show_step(now, now.procedure, now.step)
        elif now.result:
            self.outcome.show_result(now.result)
        self.show_message(_sentence(now.message or now.done), hint=not now.message)
        if phase is not self._phase:
            self._phase = phase
            self._show_page()
            if self.isVisible():
                self._first_button().setFocus()

    def _first_button(self) -> QPushButton:
        return {
            self.start: self.start.begin,
            self.steps: self.steps.take,
            self.outcome: self.outcome.use,
        }[self._phase]

    def _show_page(self) -> None:
        for page in (self.start, self.steps, self.outcome):
            page.setVisible(page is self._phase)


def _sentence(text: str) -> str:
    text = text[:1].upper() + text[1:]
    return text if not text or text.endswith((".", "?", "!")) else f"{text}."


class InUsePanel(Panel):
    """Says which calibration the readings are corrected by."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("In use", parent)
        self.what = _label()
        self.load = _button(f"Load{_ELLIPSIS}", "load", "Use a calibration from a file.")
        self.stop = _button(
            "Stop using", "stop", "Show nominal curvature again (Ctrl+Z takes it back)."
        )
        self.body.addWidget(self.what)
        self.body.addLayout(_row(self.load, self.stop))
        self._calibration: Calibration | None = None
        self._status, self._calibrating, self._file_refused = Status(), False, ""

    def attend(self, calibrating: Calibrating) -> None:
        def load() -> None:
            path, _ = QFileDialog.getOpenFileName(self, "Load a calibration", "", _FILES)
            if path:
                calibrating.load(Path(path))

        self.load.clicked.connect(guarded(lambda *_: load()))
        self.stop.clicked.connect(guarded(lambda *_: calibrating.stop_using()))
        calibrating.changed.connect(guarded(lambda: self._note(calibrating)))

    def _note(self, calibrating: Calibrating) -> None:
        self._calibrating = calibrating.procedure is not None
        self._file_refused = calibrating.file_refused
        self._tell()

    def show_settings(self, settings: Settings) -> None:
        self._calibration = settings.calibration
        self.stop.setEnabled(self._calibration is not None)
        self._tell()

    def show_status(self, status: Status, simulating: bool) -> None:
        self._status = status
        self._tell()

    def _tell(self) -> None:
        found, sensor = self._calibration, self._status.sensor
        alarm = ""
        if found is None:
            text = "Nothing: readings are nominal curvature (Eq. 8)."
        else:
            text = f"{found.name} {found.serial_number},\n{said(found)}"
            if self._calibrating:
                alarm = "Not while calibrating."
            elif sensor is not None:
                alarm = _unfit(found, self._status)
        if text != self.what.text():
            self.what.setText(text)
            self.what.setToolTip(_EQUATION_8 if found is None else "")
        if self._file_refused:
            self.show_message(_sentence(self._file_refused))
        else:
            self.show_message(alarm, hint=self._calibrating)


def _unfit(calibration: Calibration, status: Status) -> str:
    """Why a calibration is not in use with the sensor that is connected, or nothing."""
    if status.sensor is None:
        return ""
    try:
        calibration.check(status.sensor)
    except Refusal as refusal:
        return f"Not in use: {refusal}."
    return ""
