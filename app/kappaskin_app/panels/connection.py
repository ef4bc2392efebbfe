"""Where the readings come from."""

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin import Status
from kappaskin_app.theme import Theme

_SIMULATED = ("sim:", "Simulated skin")


class ConnectionPanel(QGroupBox):
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
        self.disconnect_button = QPushButton("Disconnect")
        self.disconnect_button.setObjectName("disconnect")
        self.device = QLabel(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.message = QLabel(wordWrap=True, visible=False)  # pyright: ignore[reportCallIssue]
        self.message.setObjectName("connection-message")
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
        around = QVBoxLayout(self)
        around.setContentsMargins(8, 6, 8, 8)
        around.addWidget(self.sources)
        around.addLayout(buttons)
        around.addWidget(self.device)
        around.addWidget(self.message)
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

    def show_status(self, status: Status) -> None:
        sensor = status.sensor
        text = ""
        if sensor is not None and status.state == "streaming":
            a, b = sensor.layout.patch.a * 1e3, sensor.layout.patch.b * 1e3
            dead = int((~sensor.layout.live).sum())
            health = f", {dead} of {sensor.channels} channels dead" if dead else ""
            text = (
                f"{sensor.name} ({sensor.serial_number})\n{sensor.layout}, {a:g} x {b:g} mm"
                f"{health}\nup to {sensor.rate:g} frames/s"
            )
        elif status.state == "waiting":
            text = "Waiting for the device to say what it is\N{HORIZONTAL ELLIPSIS}"
        if text != self.device.text():
            self.device.setText(text)
        self.device.setVisible(bool(text))
        if status.message != self.message.text():
            self.message.setText(status.message)
        self.message.setVisible(bool(status.message))
        self.disconnect_button.setEnabled(status.state != "off")

    def show_theme(self, theme: Theme) -> None:
        self.message.setStyleSheet(f"color: {theme.alert};")
