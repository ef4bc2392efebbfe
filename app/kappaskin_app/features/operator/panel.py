"""Panel of the operator: the pad, the target, what is sent, and the settings."""

import math
from collections import deque

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QCheckBox, QFormLayout, QHBoxLayout, QSlider, QVBoxLayout, QWidget

from kappaskin._text import NONE
from kappaskin.hand import HandTarget, OperatorStatus
from kappaskin_app.features.operator.control import limits_of
from kappaskin_app.features.operator.pad import Pad
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.operation import GAMEPAD, PAD, UDP
from kappaskin_app.theme import ALERT, follow_look, grown, slider_style
from kappaskin_app.widgets.layout import scrolled
from kappaskin_app.widgets.parts import Heading, sentence, text_label

_NAMES = (
    "operator_input",
    "operator_listens",
    "operator_speed",
    "operator_turn_rate",
    "operator_grip",
    "operator_reach_x",
    "operator_reach_y",
    "operator_reach_z",
    "send_to_robot",
    "robot_at",
    "operator_tones",
    "operator_rumble",
    "felt_at_most",
)
_LETTERS = 1.5  # times as large is the state
_WORDS = {
    "off": "OFF",
    "waiting": "NO TARGET YET",
    "stale": "STALE: HOLDS STILL",
    "released": "HOLDS STILL",
    "following": "MOVES",
}
_HOW = {
    PAD: "Hold a key or drag in the pad.",
    GAMEPAD: "Hold the right shoulder button and move a stick.",
    UDP: "Waits for targets that are enabled.",
}
_ENABLE = "Let the input move the hand. It holds still, with its grip, while this is off."
_RATES = 25  # reports over which rates are taken: about a second
_WIDE = 230  # px of the column of the target
_WIDEST = 360  # px of the pad
_PERCENT, _MINUS = 100, "\N{MINUS SIGN}"


class OperatorForm(Form):
    """The settings of the input, its limits, the robot and what is felt."""

    purpose = (
        "Moves the simulated hand, or a robot by UDP, with the pad, a gamepad or a glove. Limits "
        "hold for all of them; what exceeds them is slowed down, or as a message refused."
    )
    guide_page = "telemanipulation"

    def __init__(self) -> None:
        super().__init__("Input, limits, feedback", _NAMES)

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        self.form.setRowVisible(self.editor("operator_listens"), settings.operator_input == UDP)
        self.form.setRowVisible(self.editor("robot_at"), settings.send_to_robot)
        rumbles = settings.operator_input == GAMEPAD
        self.form.setRowVisible(self.editor("operator_rumble"), rumbles)


class OperatorPanel(QWidget):
    """Pad, grip, switch and state of the operator, with the form of settings.

    `enabled` brings the switch, `gripped` the grip as a share of the largest, `shown` whether the
    panel is visible.
    """

    enabled = Signal(bool)
    gripped = Signal(float)
    shown = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self.form, self.pad = OperatorForm(), Pad()
        self.grip = QSlider(Qt.Orientation.Vertical)
        self.grip.setObjectName("grip")
        self.grip.setAccessibleName("Grip")
        self.grip.setRange(0, _PERCENT)
        self.grip.setToolTip("Force with which each finger grips, up to the largest.")
        self.grip.valueChanged.connect(guarded(lambda at: self.gripped.emit(at / _PERCENT)))
        self.enable = QCheckBox("&Enable")
        self.enable.setObjectName("enable")
        self.enable.setToolTip(_ENABLE)
        self.enable.toggled.connect(self.enabled)
        self.state, self.hint, self.message = Heading(_LETTERS), text_label(), text_label()
        self.message.setForegroundRole(ALERT)
        self._settings = Settings()
        self._hand = ""
        self._reports = deque[OperatorStatus](maxlen=_RATES)
        self.numbers = {
            name: text_label(tip=tip)
            for name, tip in (
                ("Position", "Target of the hand from its home, along x, y and z."),
                ("Rotation", "Target of the hand: roll, pitch and yaw."),
                ("Grip", "Force with which each finger is to grip."),
                ("UDP", "Messages that came by UDP, those that were late, and others refused."),
                ("Robot", "Messages sent to the robot, and those that could not be sent."),
                ("Latency", "From the arrival of a target until it was sent, 99th percentile."),
            )
        }
        self._lay_out()
        follow_look(self, self._dress)
        self.show_status(OperatorStatus(HandTarget()))

    def _lay_out(self) -> None:
        around, numbers, column = QHBoxLayout(self), QFormLayout(), QVBoxLayout()
        around.setContentsMargins(8, 4, 8, 6)
        around.setSpacing(10)
        numbers.setVerticalSpacing(3)
        for name, label in self.numbers.items():
            label.setWordWrap(False)
            label.setMinimumWidth(_WIDE)
            numbers.addRow(name, label)
        for widget in (self.enable, self.state, self.hint):
            column.addWidget(widget)
        column.addLayout(numbers)
        column.addWidget(self.message)
        column.addStretch(1)
        around.addWidget(self.pad, 1)
        around.addWidget(self.grip)
        around.addLayout(column, 1)
        around.addWidget(scrolled(self.form))

    def _dress(self) -> None:
        self.grip.setStyleSheet(slider_style())
        self.pad.setMaximumWidth(grown(_WIDEST))

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.shown.emit(True)

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self.shown.emit(False)

    def show_settings(self, settings: Settings) -> None:
        self._settings = settings
        self.form.show_settings(settings)
        for widget in (self.pad, self.grip):
            widget.setEnabled(settings.operator_input == PAD)

    def show_enabled(self, on: bool) -> None:
        with QSignalBlocker(self.enable):
            self.enable.setChecked(on)

    def show_hand(self, trouble: str) -> None:
        """Show what is wrong with the simulated hand; empty if nothing is."""
        self._hand = trouble

    def show_status(self, status: OperatorStatus) -> None:
        """Show the target, the counts, and what is wrong."""
        if status.target.time:
            self._reports.append(status)
        target, limits, moves = (
            status.target,
            limits_of(self._settings),
            status.state == "following",
        )
        self.pad.show_target(target, limits, moves)
        if not self.grip.isSliderDown() and not self.grip.hasFocus():
            with QSignalBlocker(self.grip):
                self.grip.setValue(round(_PERCENT * target.grip / limits.grip))
        self.state.setText(_WORDS[status.state])
        stale = status.state == "stale"
        self.state.setForegroundRole(ALERT if stale else self.foregroundRole())
        resting = status.state in ("released", "waiting")
        self.hint.setText(_HOW[self._settings.operator_input] if resting else "")
        for name, text in self._texts(status).items():
            if text != self.numbers[name].text():
                self.numbers[name].setText(text)
        refusal = f"Last refused: {status.refusal}" if status.refusal else ""
        self.message.setText(
            "\n".join(map(sentence, filter(None, (status.trouble, self._hand, refusal))))
        )

    def _texts(self, status: OperatorStatus) -> dict[str, str]:
        """Each number as text."""
        target, first = status.target, self._reports[0] if self._reports else status
        seconds = max(target.time - first.target.time, 1e-9)
        rate_in, rate_out = (
            round((now - before) / seconds) if before <= now else 0
            for now, before in ((status.received, first.received), (status.sent, first.sent))
        )
        x, y, z = (1e3 * at + 0.0 for at in target.position)
        roll, pitch, yaw = (math.degrees(at) + 0.0 for at in target.rotation)
        late = status.latency
        return {
            "Position": f"{x:.1f}, {y:.1f}, {z:.1f} mm".replace("-", _MINUS),
            "Rotation": f"{roll:.1f}, {pitch:.1f}, {yaw:.1f}\N{DEGREE SIGN}".replace("-", _MINUS),
            "Grip": f"{target.grip:.2f} N",
            "UDP": f"{rate_in}/s; {status.received:,} followed, {status.late:,} late, "
            f"{status.refused:,} refused",
            "Robot": f"{rate_out}/s; {status.sent:,} sent, {status.dropped:,} dropped",
            "Latency": f"{1e3 * late:.2f} ms" if math.isfinite(late) else NONE,
        }
