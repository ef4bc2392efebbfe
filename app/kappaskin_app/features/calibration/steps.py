"""Says which step of a calibration is next, and what the last one read."""

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QProgressBar, QVBoxLayout, QWidget

from kappaskin.calibration import Procedure
from kappaskin.frames import COMPONENTS
from kappaskin.scenes import CylinderStep
from kappaskin_app.features.calibration.calibrating import Calibrating
from kappaskin_app.features.calibration.cylinder import CylinderView
from kappaskin_app.widgets.parts import (
    ELLIPSIS,
    EQUATION_8,
    Heading,
    button,
    in_a_row,
    number,
    text_label,
)

_BENT = {"x": "bent along x", "y": "bent along y", "diagonal": "bent along the diagonal"}
_WAYS = {
    "there": "on the way there",
    "back": "on the way back",
    "first": "first of all, to wipe out its past",
}


class Steps(QWidget):
    """Says which step is next, and what the last one read."""

    def __init__(self) -> None:
        super().__init__()
        self.number = QLabel()
        self.bar = QProgressBar(textVisible=False)  # pyright: ignore[reportCallIssue]
        self.bar.setFixedHeight(8)
        self.bar.setToolTip("Steps that are done, and how far this one is.")
        self.what = Heading(1.5)
        self.how = text_label()
        self.drawing = CylinderView()
        self.take = button(
            "Take", "take", "Take what the skin reads now, and go on (Enter, Space, Ctrl+Shift+K)."
        )
        self.redo = button("Take the last one again", "redo", "Go back by one step.")
        self.cancel = button("Cancel", "cancel", "End here, and forget what was taken.")
        self.all = button(
            "Take all",
            "take-all",
            "Go through all steps unattended: the simulated skin lays itself on each cylinder.",
        )
        self.read = QGridLayout()
        self.read.setVerticalSpacing(2)
        self.heading = text_label()
        self.cells = [[QLabel() for _ in range(3)] for _ in COMPONENTS]
        self._lay_out()

    def _lay_out(self) -> None:
        heads = (
            ("", ""),
            ("read", EQUATION_8 + "The median of the elements."),
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
        around.addLayout(in_a_row(self.redo, self.cancel))
        around.addWidget(self.heading)
        around.addLayout(self.read)

    def show_step(self, now: Calibrating, procedure: Procedure, step: CylinderStep | None) -> None:
        done, total = len(procedure.taken), len(procedure.steps)
        self.bar.setRange(0, 100 * total)
        self.bar.setValue(round(100 * (done + now.share)))
        self.redo.setEnabled(bool(done) and not now.computing)
        self.take.setEnabled(not now.computing)
        self.all.setEnabled(not now.computing)
        self.all.setText("Go on step by step" if now.unattended else "Take all")
        self.take.setText(f"Taking{ELLIPSIS}" if now.taking else "Take")
        if step is None:
            self.number.setText(f"{total} of {total} taken")
            self.what.setText(f"Computing the calibration{ELLIPSIS}")
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
            texts = [number(value, "+.1f") for value in values] + [number(_median(noise), ".2f")]
            for cell, text in zip(self.cells[row], texts, strict=True):
                cell.setText(text)


def _what(step: CylinderStep) -> str:
    return "Flat table" if step.flat else f"Cylinder of {1e3 * step.radius:g} mm"


def _how(step: CylinderStep) -> str:
    if step.flat:
        return "Nothing pressing on the skin.\n"
    face = "inner face on it" if step.face > 0 else "outer face on it"
    if step.hold:
        return f"{_BENT[step.along]}, {face}: press Take, then lay it on; it stays {step.hold:g} s"
    return f"{_BENT[step.along]}, {face},\n{_WAYS[step.way]}"


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")
