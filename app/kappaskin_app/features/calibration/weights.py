"""Known weights: the panel that asks for one after the other, and shows what they found."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import (
    QFileDialog,
    QFormLayout,
    QLineEdit,
    QProgressBar,
    QVBoxLayout,
    QWidget,
)

from kappaskin._text import with_error
from kappaskin.calibration import GRAVITY, WEIGHT_ADVICE, KnownWeights, Weighing
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.features.calibration.controller import WeightController, parsed
from kappaskin_app.guard import guarded
from kappaskin_app.shell.folders import proposed
from kappaskin_app.shell.panel import Panel
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

FILES = "Calibration (*.toml)"
_USUAL = "5, 10, 20, 10, 5"


class WeightsPanel(Panel):
    """Procedure of known weights, and its result."""

    purpose = (
        "Weights of known mass are laid on the skin one by one, which determines its rigidity, and "
        "with it the force; no Young's modulus is needed then."
    )
    guide_page = "calibrate"

    def __init__(self) -> None:
        super().__init__("Known weights")
        self.start, self.steps, self.result = _StartPage(), _StepPage(), _ResultPage()
        for page in (self.start, self.steps, self.result):
            self.body.addWidget(page)
        self._controller: WeightController | None = None
        self._show_page(self.start)

    def connect_to(self, controller: WeightController) -> None:
        """Show the progress of `controller`, and pass the user's requests to it."""
        self._controller = controller
        controller.changed.connect(guarded(self._show))
        requests: tuple[tuple[QWidget, Callable[[], object]], ...] = (
            (self.start.begin, lambda: self._begin(controller)),
            (self.steps.capture, controller.capture),
            (self.steps.all, controller.capture_all),
            (self.steps.redo, controller.redo),
            (self.steps.cancel, controller.cancel),
            (self.result.use, controller.use),
            (self.result.leave, controller.discard),
            (self.result.save, lambda: self._save(controller)),
        )
        for pressed, request in requests:
            pressed.clicked.connect(guarded(lambda *_, request=request: request()))

    def show_status(self, status: Status, simulating: bool) -> None:
        self.steps.all.setVisible(simulating)
        self.start.begin.setEnabled(status.sensor is not None and status.state == "streaming")

    def _begin(self, controller: WeightController) -> None:
        try:
            masses = parsed(self.start.masses.text(), f"masses in g, such as {_USUAL}")
        except Refusal as refusal:
            self.show_message(sentence(str(refusal)))
            return
        controller.begin(masses, self.start.seconds.value())

    def _save(self, controller: WeightController) -> None:
        found = controller.calibration
        if found is None:
            return
        name = f"{found.serial_number}-{found.date.astimezone():%Y%m%d}.calibration.toml"
        path, _ = QFileDialog.getSaveFileName(
            self, "Save the calibration", str(proposed(name)), FILES
        )
        if path:
            controller.save(Path(path))

    def _show(self) -> None:
        now = self._controller
        if now is None:
            return
        if now.procedure:
            self.steps.show_step(now, now.procedure)
        elif now.result:
            self.result.show_result(now.result)
        self.show_message(sentence(now.message or now.done), hint=not now.message)
        page = self.steps if now.procedure else self.result if now.result else self.start
        if page.isHidden():
            self._show_page(page)
            if self.isVisible():
                page.first.setFocus()

    def _show_page(self, shown: QWidget) -> None:
        for page in (self.start, self.steps, self.result):
            page.setVisible(page is shown)


class _StartPage(QWidget):
    """Page with the masses and the duration of each step."""

    def __init__(self) -> None:
        super().__init__()
        self.masses = QLineEdit(_USUAL)
        self.masses.setObjectName("masses")
        self.masses.setToolTip(
            "Masses in g of your weights, in the order in which you lay them on; at least three. "
            "One weight may be laid on several times."
        )
        self.seconds = seconds_box(
            "weight-seconds", 0.1, 1.0, "Time over which the readings of a weight are averaged."
        )
        self.begin = self.first = button(
            "Start", "begin-weights", "Start with nothing on the skin."
        )
        form = QFormLayout()
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        form.setVerticalSpacing(5)
        for words, editor in (("Masses, g", self.masses), ("Time per weight", self.seconds)):
            label = Label(words)
            label.setBuddy(editor)
            label.setToolTip(editor.toolTip())
            form.addRow(label, editor)
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        around.addLayout(form)
        around.addWidget(text_label(WEIGHT_ADVICE))
        around.addWidget(self.begin)
        self.masses.returnPressed.connect(self.begin.click)


class _StepPage(QWidget):
    """Page with the present step, and the places of the weights so far."""

    def __init__(self) -> None:
        super().__init__()
        self.bar = QProgressBar(textVisible=False)  # pyright: ignore[reportCallIssue]
        self.bar.setFixedHeight(8)
        self.bar.setToolTip("Progress of the steps.")
        self.what = Heading(1.5)
        tip = "Capture the readings of this step (Enter, Space, Ctrl+Shift+K)."
        self.capture = self.first = button("Capture", "take-weight", tip)
        tip = "Lay all weights on automatically, for the simulated skin."
        self.all = button("Capture all", "take-all-weights", tip)
        self.redo = button("Repeat last step", "redo-weight", "Go back by one step.")
        tip = "End, and discard the captured steps."
        self.cancel = button("Cancel", "cancel-weights", tip)
        self.places = text_label(tip="Where each weight was found, from the corner x = y = 0.")
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        for widget in (self.bar, self.what, self.capture, self.all):
            around.addWidget(widget)
        around.addLayout(in_a_row(self.redo, self.cancel))
        around.addWidget(self.places)

    def show_step(self, now: WeightController, weighing: Weighing) -> None:
        total = len(weighing.weights) + 1
        self.bar.setRange(0, 100 * total)
        self.bar.setValue(round(100 * (weighing.step + now.share)))
        self.redo.setEnabled(bool(weighing.step) and not now.computing)
        for pressed in (self.capture, self.all):
            pressed.setEnabled(not (now.computing or now.capturing))
        self.capture.setText(f"Capturing{ELLIPSIS}" if now.capturing else "Capture")
        words = f"Computing the stiffness{ELLIPSIS}" if weighing.done else sentence(weighing.what)
        self.what.setText(words)
        places = (1e3 * contact.position for contact in weighing.contacts)
        self.places.setText(
            "\n".join(
                f"{mass:g} g at ({x:.1f}, {y:.1f}) mm"
                for mass, (x, y) in zip(weighing.masses, places, strict=False)
            )
        )


class _ResultPage(QWidget):
    """Page with the result: the stiffness, and how well each weight is told."""

    def __init__(self) -> None:
        super().__init__()
        self.verdict, self.found = Heading(1.3), text_label()
        self.why = text_label()
        tip = (
            "Each weight, its mass as estimated by the fit to all weights, and the error of its "
            "estimate by the fit to the others."
        )
        self.table = text_label(tip=tip, rich=True)
        self.use = self.first = button(
            "Use", "use-weights", "Estimate forces with this stiffness (Ctrl+Z undoes)."
        )
        self.save = button(f"Save{ELLIPSIS}", "save-weights", "Write the calibration to a file.")
        tip = "Start again; discard an unsaved result."
        self.leave = button("New", "leave-weights", tip)
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        for widget in (self.verdict, self.why, self.found):
            around.addWidget(widget)
        around.addLayout(in_a_row(self.use, self.save, self.leave))
        around.addWidget(self.table)
        self._shown: KnownWeights | None = None

    def show_result(self, known: KnownWeights) -> None:
        if known is self._shown:
            return
        self._shown = known
        self.verdict.setText("Passed" if known.passed else "Failed")
        head, *_, why = known.lines()
        self.found.setText(sentence(head))
        self.why.setText(sentence(why.partition(": ")[2]))
        rows = [("<i>weight</i>", "<i>estimated</i>", "<i>error by the others</i>")]
        rows += [
            (
                f"{1e3 * laid / GRAVITY:.4g} g",
                f"{1e3 * told / GRAVITY:.4g} g",
                with_error(100 * left, unit="%", digits=1, sign="+"),
            )
            for laid, told, left in zip(known.weights, known.told, known.left_out, strict=True)
        ]
        cells = ("".join(f"<td align=right>{cell}</td>" for cell in row) for row in rows)
        lines = "".join(f"<tr>{row}</tr>" for row in cells)
        self.table.setText(f"<table cellspacing=0 cellpadding=3>{lines}</table>")
