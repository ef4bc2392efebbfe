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

_SIMULATED = ("sim:", "Simulated skin")


class ConnectionPanel(QGroupBox):
    """Asks for a source: the simulation, a serial port found, or a typed port or URL."""

    connect_wanted = Signal(str)
    disconnect_wanted = Signal()
    ports_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Connection", parent)
        self._sources = QComboBox(editable=True, insertPolicy=QComboBox.InsertPolicy.NoInsert)  # pyright: ignore[reportCallIssue]
        self._sources.setObjectName("source")
        self._sources.setToolTip(
            "The simulated skin, a serial port found on this machine, or a port or URL typed here, "
            "such as /dev/ttyACM0, COM3 or socket://host:port."
        )
        self._sources.setMinimumContentsLength(12)
        self._look = QPushButton("Look again")
        self._look.setToolTip("Look for serial ports again.")
        self._connect = QPushButton("Connect")
        self._connect.setObjectName("connect")
        self._disconnect = QPushButton("Disconnect")
        self._disconnect.setObjectName("disconnect")
        self._device = QLabel(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self._message = QLabel(wordWrap=True, visible=False)  # pyright: ignore[reportCallIssue]
        self._message.setObjectName("connection-message")
        self._connect.clicked.connect(lambda: self.connect_wanted.emit(self.source()))
        line = QLineEdit()
        line.returnPressed.connect(self._connect.click)
        self._sources.setLineEdit(line)
        self._disconnect.clicked.connect(self.disconnect_wanted)
        self._look.clicked.connect(self.ports_wanted)
        buttons = QHBoxLayout()
        for button in (self._connect, self._disconnect, self._look):
            buttons.addWidget(button)
        around = QVBoxLayout(self)
        around.setContentsMargins(8, 6, 8, 8)
        around.addWidget(self._sources)
        around.addLayout(buttons)
        around.addWidget(self._device)
        around.addWidget(self._message)
        self.show_ports([])

    def source(self) -> str:
        """The name of the source chosen or typed."""
        text = self._sources.currentText().strip()
        index = self._sources.findText(text)
        return str(self._sources.itemData(index)) if index >= 0 else text

    def show_ports(self, ports: list[tuple[str, str]]) -> None:
        """Offer these (port, description) beside the simulation."""
        chosen = self._sources.currentText()
        with QSignalBlocker(self._sources):
            self._sources.clear()
            for value, words in (_SIMULATED, *ports):
                self._sources.addItem(words, value)
            if chosen:
                self._sources.setCurrentText(chosen)

    def show_source(self, source: str) -> None:
        index = self._sources.findData(source)
        with QSignalBlocker(self._sources):
            if index >= 0:
                self._sources.setCurrentIndex(index)
            else:
                self._sources.setCurrentText(source)

    def show_status(self, status: Status) -> None:
        sensor = status.sensor
        text = ""
        if sensor is not None and status.state == "streaming":
            a, b = sensor.layout.patch.a * 1e3, sensor.layout.patch.b * 1e3
            text = (
                f"{sensor.name}\n{sensor.layout}, {a:g} x {b:g} mm\n"
                f"up to {sensor.rate:g} frames/s, serial number {sensor.serial_number}"
            )
        elif status.state == "waiting":
            text = "Waiting for the device to say what it is\N{HORIZONTAL ELLIPSIS}"
        if text != self._device.text():
            self._device.setText(text)
        self._device.setVisible(bool(text))
        if status.message != self._message.text():
            self._message.setText(status.message)
        self._message.setVisible(bool(status.message))
        self._disconnect.setEnabled(status.state != "off")
