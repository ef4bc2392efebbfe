"""The connection panel: where the readings come from, and the ports there are."""

import time

from PySide6.QtCore import QObject, QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from kappaskin.calibration import Calibration
from kappaskin.live import Status
from kappaskin.sensing import Sensor
from kappaskin.sources import Port
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.form import pass_window_keys
from kappaskin_app.shell.panel import Panel
from kappaskin_app.widgets.parts import said
from kappaskin_app.widgets.text import COMMAND, day

_EVERY = 1000  # ms between two looks


class Plugs(QObject):
    """Looks for ports each second while `watched` can be seen and used; `found` brings them."""

    found = Signal(list)

    def __init__(self, watched: QWidget, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._watched = watched
        self._looking = BackgroundTask(tasks, "", self.found.emit)  # some systems take a second
        self._timer = QTimer(self, interval=_EVERY)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._look_if_seen))
        self._timer.start()

    def _look_if_seen(self) -> None:
        if self._watched.isVisible() and QApplication.activeWindow() is not None:
            self.look()

    def look(self) -> None:
        """Look now, unless that is being done."""
        if not self._looking.running:
            self._looking.run(Port.found)


_SIMULATED = ("sim:", "Simulated skin")
_TIP = (
    "The simulated skin, a serial port found on this machine, or a port or URL typed here, such as "
    "/dev/ttyACM0, COM3 or socket://host:port."
)
_LONGEST, _TAIL = 56, 18  # characters of a port in the list, and of these at the end
_MARGIN = 16  # px
_LOSSES = 1.0  # s between two looks at what was lost


class ConnectionPanel(Panel):
    """Asks for a source: the simulation, a serial port found, or a typed port or URL."""

    purpose = (
        "Where readings come from: the simulated skin, a serial port, any address that pyserial "
        "opens, or a recording. A line that breaks is taken up again by itself; what was missed "
        "meanwhile is counted."
    )
    guide_page = "connect"

    connect_wanted = Signal(str)
    disconnect_wanted = Signal()
    ports_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Connection", parent)
        self._ports: list[Port] = []
        self._plug: Port | None = None  # what was chosen, be it there or not
        self._next_losses = 0.0
        self.sources = QComboBox(editable=True, insertPolicy=QComboBox.InsertPolicy.NoInsert)  # pyright: ignore[reportCallIssue]
        self.sources.setObjectName("source")
        self.sources.setAccessibleName("Source of readings")
        self.sources.setMinimumContentsLength(12)
        self.sources.currentTextChanged.connect(self._note_choice)
        # A port's name is at its beginning.
        self.sources.currentIndexChanged.connect(lambda: self._line.setCursorPosition(0))
        self.look_button = QPushButton("Look again")
        self.look_button.setToolTip("Look for serial ports again.")
        self.connect_button = QPushButton("Connect")
        self.connect_button.setObjectName("connect")
        self.connect_button.setToolTip("Take readings from the source above (Ctrl+Return).")
        self.disconnect_button = QPushButton("Disconnect")
        self.disconnect_button.setObjectName("disconnect")
        self.disconnect_button.setToolTip("Take no more readings (Ctrl+D).")
        self.device, self.losses = QLabel(wordWrap=True), QLabel(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.losses.setToolTip("What was lost on the line since it was connected.")
        self.copy_button = QPushButton("Copy the command")
        self.copy_button.setToolTip("Copy what the message above says to type into a terminal.")
        self.copy_button.clicked.connect(self._copy)
        self.connect_button.clicked.connect(lambda: self.connect_wanted.emit(self.source()))
        self._line = QLineEdit()
        self._line.returnPressed.connect(self.connect_button.click)
        self.sources.setLineEdit(self._line)
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
        self.body.addWidget(self.losses)
        self._around.addWidget(self.copy_button, alignment=Qt.AlignmentFlag.AlignRight)
        pass_window_keys(self.sources)
        self._list()

    def source(self) -> str:
        """The name of the source chosen or typed."""
        text = self.sources.currentText().strip()
        index = self.sources.findText(text)
        return str(self.sources.itemData(index)) if index >= 0 else text

    def _note_choice(self) -> None:
        """Remember the plug chosen, to know it again under another name."""
        chosen = self.source()
        known = (port for port in self._ports if port.port == chosen)
        gone = self._plug if self._plug and self._plug.port == chosen else None
        self._plug = next(known, gone)
        words = _SIMULATED[1] if chosen == _SIMULATED[0] else self._plug and _words(self._plug)
        self.sources.setToolTip(f"{words or chosen}\n\n{_TIP}")

    def show_ports(self, ports: list[Port]) -> None:
        """Offer these beside the simulation; the choice stays, by plug if its name is another."""
        if ports == self._ports or self.sources.view().isVisible():
            return  # one who chooses is left alone until the next look
        chosen, plug, self._ports = self.source(), self._plug, ports
        if plug is not None and chosen == plug.port:
            chosen = next((port.port for port in ports if port.same_plug(plug)), chosen)
        line = self._line
        at, text = line.cursorPosition(), line.text()
        self._list()
        self.show_source(chosen)
        if line.text() == text:
            line.setCursorPosition(at)  # where someone types

    def _list(self) -> None:
        with QSignalBlocker(self.sources):
            self.sources.clear()
            self.sources.addItem(_SIMULATED[1], _SIMULATED[0])
            for place, port in enumerate(self._ports, 1):
                self.sources.addItem(_short(_words(port)), port.port)
                self.sources.setItemData(place, _words(port), Qt.ItemDataRole.ToolTipRole)
        # Wider than the panel, or the list would cut off what tells two of a kind apart.
        self.sources.view().setMinimumWidth(self.sources.view().sizeHintForColumn(0) + _MARGIN)

    def show_source(self, source: str) -> None:
        index = self.sources.findData(source)
        with QSignalBlocker(self.sources):
            if index >= 0:
                self.sources.setCurrentIndex(index)
            else:
                self.sources.setCurrentText(source)
        self._line.setCursorPosition(0)
        self._note_choice()

    def show_status(self, status: Status, simulating: bool) -> None:
        text = ""
        if status.sensor is not None and status.state == "streaming":
            text = _said(status.sensor, status.setup.calibration) + _recorded(status)
        elif status.state == "waiting":
            text = "Waiting for the device to say what it is\N{HORIZONTAL ELLIPSIS}"
        if text != self.device.text():
            self.device.setText(text)
        self.device.setVisible(bool(text))
        self.show_message(status.message)
        self._show_losses(status)
        self.disconnect_button.setEnabled(status.state != "off")

    def _show_losses(self, status: Status) -> None:
        """What was lost, as often as it can be read; of a simulation nothing is."""
        now, sensor = time.monotonic(), status.sensor
        there = status.accounting.bytes_in > 0
        if there and sensor is not None and now >= self._next_losses:
            self._next_losses = now + _LOSSES
            self.losses.setText(f"{status.accounting.words}.")
        self.losses.setVisible(there and sensor is not None)

    def show_message(self, text: str, hint: bool = False) -> None:
        super().show_message(text, hint)
        self.copy_button.setVisible(bool(COMMAND.search(text)))

    def _copy(self) -> None:
        if command := COMMAND.search(self.message.text()):
            QGuiApplication.clipboard().setText(command[1])


def _words(port: Port) -> str:
    """What a port is, and whether it may be opened."""
    return port.words if port.opened else f"{port.words}  (no permission)"


def _short(words: str) -> str:
    """The `words` as far as a list shows them, the end too: it tells two of a kind apart."""
    if len(words) <= _LONGEST:
        return words
    return f"{words[: _LONGEST - _TAIL - 1]}\N{HORIZONTAL ELLIPSIS}{words[-_TAIL:]}"


def _recorded(status: Status) -> str:
    """When what is played was recorded, and how much it is."""
    replay = status.replay
    if replay is None:
        return ""
    whole = "" if replay.whole else ", never ended"
    return f"\nRecorded {day(replay.begun)}, {replay.length:.1f} s{whole}"


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
