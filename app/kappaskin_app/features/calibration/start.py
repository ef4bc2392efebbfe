"""Asks with which cylinders to calibrate, and how long on each."""

from PySide6.QtWidgets import QFormLayout, QLabel, QLineEdit, QVBoxLayout, QWidget

from kappaskin.errors import Refusal
from kappaskin.scenes import ADVICE, schedule
from kappaskin_app.features.calibration.calibrating import parsed_radii
from kappaskin_app.widgets.parts import button, seconds_box, text_label


class Start(QWidget):
    """Asks with which cylinders, and how long on each."""

    def __init__(self) -> None:
        super().__init__()
        self.radii = QLineEdit()
        self.radii.setObjectName("radii")
        self.radii.setToolTip(
            "Radii in mm of the cylinders that you have, in any order; at least three."
        )
        self.seconds = seconds_box(
            "seconds", 0.1, 1.0, "How long the readings of a step are averaged."
        )
        self.hold = seconds_box(
            "hold",
            0.0,
            0.0,
            "Above zero, the skin first stays so long on the smallest cylinder, which shows how "
            "the glue creeps.",
        )
        self.hold.setSpecialValueText("none")
        self.plan = text_label()
        self.begin = button("Begin", "begin", "Begin with the flat table.")
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
        around.addWidget(text_label(ADVICE))
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
