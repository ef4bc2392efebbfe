"""Where the readings come from."""

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from kappaskin import Calibration, Sensor, Status
from kappaskin_app.panels.calibration.parts import said
from kappaskin_app.panels.panel import Panel

_SIMULATED = ("sim:", "Simulated skin")


class ConnectionPanel(Panel):
    """Asks for a source: the simulation, a serial port found, or a typed port or URL."""

    connect_wanted = Signal(str)
    disconnect_wanted = Signal()
    ports_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Connection", parent)
        self.sources = QComboBox(editable=True, insertPolicy=QComboBox.InsertPolicy.NoInsert)  # pyright: ignore[reportCallIssue]
        self.sources.setObjectName("source")
        self.sources.setToolTip(
            "The simulated skin, a serial port found on this machine, or a port or URL typed here, "
            "such as /dev/ttyACM0, COM3 or socket://host:port."
        )
        self.sources.setMinimumContentsLength(12)
        self.look_button = QPushButton("Look again")
        self.look_button.setToolTip("Look for serial ports again.")
        self.connect_button = QPushButton("Connect")
        self.connect_button.setObjectName("connect")
        self.connect_button.setToolTip("Take readings from the source above (Ctrl+Return).")
        self.disconnect_button = QPushButton("Disconnect")
        self.disconnect_button.setObjectName("disconnect")
        self.disconnect_button.setToolTip("Take no more readings (Ctrl+D).")
        self.device = QLabel(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.connect_button.clicked.connect(lambda: self.connect_wanted.emit(self.source()))
        line = QLineEdit()
        line.returnPressed.connect(self.connect_button.click)
        self.sources.setLineEdit(line)
        # A completer would turn a typed ttyACM1 into a listed ttyACM10.
        self.sources.setCompleter(None)  # pyright: ignore[reportArgumentType]
        self.disconnect_button.clicked.connect(self.disconnect_wanted)
        self.look_button.clicked.connect(self.ports_wanted)
        buttons = QHBoxLayout()
        for button in (self.connect_button, self.disconnect_button, self.look_button):
            buttons.addWidget(button)
        self.body.addWidget(self.sources)
        self.body.addLayout(buttons)
        self.body.addWidget(self.device)
        self.show_ports([])

    def source(self) -> str:
        """The name of the source chosen or typed."""
        text = self.sources.currentText().strip()
        index = self.sources.findText(text)
        return str(self.sources.itemData(index)) if index >= 0 else text

    def show_ports(self, ports: list[tuple[str, str]]) -> None:
        """Offer these (port, description) beside the simulation."""
        chosen = self.sources.currentText()
        with QSignalBlocker(self.sources):
            self.sources.clear()
            for value, words in (_SIMULATED, *ports):
                self.sources.addItem(words, value)
            if chosen:
                self.sources.setCurrentText(chosen)

    def show_source(self, source: str) -> None:
        index = self.sources.findData(source)
        with QSignalBlocker(self.sources):
            if index >= 0:
                self.sources.setCurrentIndex(index)
            else:
                self.sources.setCurrentText(source)

    def show_status(self, status: Status, simulating: bool) -> None:
        text = ""
        if status.sensor is not None and status.state == "streaming":
            text = _said(status.sensor, status.setup.calibration)
        elif status.state == "waiting":
            text = "Waiting for the device to say what it is\N{HORIZONTAL ELLIPSIS}"
        if text != self.device.text():
            self.device.setText(text)
        self.device.setVisible(bool(text))
        self.show_message(status.message)
        self.disconnect_button.setEnabled(status.state != "off")


def _said(sensor: Sensor, calibration: Calibration | None) -> str:
    """What a sensor is, in words."""
    patch, live = sensor.layout.patch, sensor.layout.live
    sensing = live[:1] if patch.strip else live  # a strip bends along x alone
    dead = int((~sensing).sum())
    a, b, radius = (round(1e3 * length, 1) for length in (patch.a, patch.b, patch.radius))
    bent = f", radius {radius:g} mm" if patch.base_curvature else ""
    health = f"\n{dead} of {sensing.size} channels dead" if dead else ""
    calibrated = f"\n{said(calibration)}" if calibration else ""
    return (
        f"{sensor.name} ({sensor.serial_number})\n{sensor.layout}, {sensor.edge}{health}\n"
        f"{a:g} x {b:g} mm{bent}, up to {sensor.rate:g} frames/s{calibrated}"
    )
