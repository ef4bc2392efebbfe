"""Connection panel: selection of the source, and search for serial ports."""

import math
import time

from PySide6.QtCore import QObject, QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QWidget,
)

from kappaskin._text import printable
from kappaskin.calibration import Calibration
from kappaskin.live import Status
from kappaskin.sensing import Sensor
from kappaskin.sources import Port, parts_of
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.form import pass_window_keys
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.settings import calibration_text
from kappaskin_app.widgets.parts import ELLIPSIS, Label, plain_tip
from kappaskin_app.widgets.text import COMMAND, day

_PERIOD = 1000  # ms between two searches


class PortSearch(QObject):
    """Searches for serial ports each second while `combo` is visible; emits them as `found`."""

    found = Signal(list)

    def __init__(self, combo: QWidget, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._combo = combo
        self._search = BackgroundTask(tasks, "", self.found.emit)  # some systems take a second
        self._timer = QTimer(self, interval=_PERIOD)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._refresh_if_visible))
        self._timer.start()

    def _refresh_if_visible(self) -> None:
        if self._combo.isVisible() and QApplication.activeWindow() is not None:
            self.refresh()

    def refresh(self) -> None:
        """Search now, unless a search is running."""
        if not self._search.running:
            self._search.run(Port.found)


_SIMULATED = ("sim:", "Simulated skin")
_NO_PORTS = ("sim:", "replay:", "feed:", "sensor:")
_TIP = (
    "The simulated skin, a serial port found on this machine, or a port or URL typed here, such as "
    "/dev/ttyACM0, COM3 or socket://host:port."
)
_LONGEST, _TAIL = 56, 18  # characters of a port in the list, and how many of them from its end
_MARGIN = 16  # px
_LOSSES_PERIOD = 1.0  # s between two updates of the losses


class ConnectionPanel(Panel):
    """Selection of a source: the simulation, a serial port found, or a typed port or URL."""

    purpose = (
        "The source of readings: the simulated skin, a serial port, any URL that pyserial opens, "
        "or a recording. A lost connection is reopened automatically, and lost messages are "
        "counted."
    )
    guide_page = "connect"

    connect_requested = Signal(str)
    disconnect_requested = Signal()
    refresh_requested = Signal()
    new_requested = Signal()

    def __init__(self) -> None:
        super().__init__("Connection")
        self._ports: list[Port] = []
        self._selected: Port | None = None  # the selected port, listed or not
        self._next_losses = 0.0
        self.sources = QComboBox(editable=True, insertPolicy=QComboBox.InsertPolicy.NoInsert)  # pyright: ignore[reportCallIssue]
        self.sources.setObjectName("source")
        self.sources.setAccessibleName("Source of readings")
        self.sources.setMinimumContentsLength(12)
        self.sources.currentTextChanged.connect(self._note_selection)
        # Show the beginning, where the port's name is.
        self.sources.currentIndexChanged.connect(lambda: self._line.setCursorPosition(0))
        self.refresh_button = QPushButton("Refresh")
        self.refresh_button.setToolTip("Search for serial ports again.")
        self.connect_button = QPushButton("Connect")
        self.connect_button.setObjectName("connect")
        self.connect_button.setToolTip("Connect the source above (Ctrl+Return).")
        self.disconnect_button = QPushButton("Disconnect")
        self.disconnect_button.setObjectName("disconnect")
        self.disconnect_button.setToolTip("Close the source (Ctrl+D).")
        self.device, self.losses = Label(wordWrap=True), Label(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.losses.setToolTip("Messages lost and bytes discarded since the source was connected.")
        self.copy_button = QPushButton("Copy the command")
        self.copy_button.setToolTip("Copy the command in the message above, for a terminal.")
        self.copy_button.clicked.connect(self._copy_command)
        self.connect_button.clicked.connect(lambda: self.connect_requested.emit(self.source()))
        self._line = QLineEdit()
        self._line.returnPressed.connect(self.connect_button.click)
        self.sources.setLineEdit(self._line)
        # A completer would turn a typed ttyACM1 into a listed ttyACM10.
        self.sources.setCompleter(None)  # pyright: ignore[reportArgumentType]
        self.disconnect_button.clicked.connect(self.disconnect_requested)
        self.refresh_button.clicked.connect(self.refresh_requested)
        self.new_button = QPushButton(f"New sensor{ELLIPSIS}")
        self.new_button.setObjectName("new_sensor_button")
        self.new_button.setToolTip("Describe a board that prints numbers, from its lines.")
        self.new_button.clicked.connect(lambda *_: self.new_requested.emit())
        buttons = QHBoxLayout()
        for button in (self.connect_button, self.disconnect_button, self.refresh_button):
            buttons.addWidget(button)
        self.body.addWidget(self.sources)
        self.body.addLayout(buttons)
        self.body.addWidget(self.new_button)
        self.body.addWidget(self.device)
        self.body.addWidget(self.losses)
        self._around.addWidget(self.copy_button, alignment=Qt.AlignmentFlag.AlignRight)
        pass_window_keys(self.sources)
        self._list()

    def source(self) -> str:
        """The name of the source that is selected or typed."""
        text = self.sources.currentText().strip()
        index = self.sources.findText(text)
        return str(self.sources.itemData(index)) if index >= 0 else text

    def port(self) -> str:
        """The port or URL that is selected or typed, else the only one found; empty without."""
        chosen = parts_of(self.source())[1] or self.source()
        if not chosen.startswith(_NO_PORTS):
            return chosen
        return self._ports[0].port if len(self._ports) == 1 else ""

    def _note_selection(self) -> None:
        """Store the selected port, to recognise its device under another name."""
        chosen = self.source()
        known = (port for port in self._ports if port.port == chosen)
        absent = self._selected if self._selected and self._selected.port == chosen else None
        self._selected = next(known, absent)
        listed = self._selected and _port_text(self._selected)
        words = _SIMULATED[1] if chosen == _SIMULATED[0] else listed
        self.sources.setToolTip(plain_tip(f"{words or chosen}\n\n{_TIP}"))

    def show_ports(self, ports: list[Port]) -> None:
        """List these and the simulation; the selected device stays selected under a new name."""
        if ports == self._ports or self.sources.view().isVisible():
            return  # an open list is not changed under the mouse
        chosen, selected, self._ports = self.source(), self._selected, ports
        if selected is not None and chosen == selected.port:
            chosen = next((port.port for port in ports if port.same_plug(selected)), chosen)
        line = self._line
        at, text = line.cursorPosition(), line.text()
        self._list()
        self.show_source(chosen)
        if line.text() == text:
            line.setCursorPosition(at)  # where the user types

    def _list(self) -> None:
        with QSignalBlocker(self.sources):
            self.sources.clear()
            self.sources.addItem(_SIMULATED[1], _SIMULATED[0])
            for place, port in enumerate(self._ports, 1):
                self.sources.addItem(_abbreviated(_port_text(port)), port.port)
                self.sources.setItemData(
                    place, plain_tip(_port_text(port)), Qt.ItemDataRole.ToolTipRole
                )
        # Wider than the panel, or the list would cut off the serial numbers of two of a kind.
        self.sources.view().setMinimumWidth(self.sources.view().sizeHintForColumn(0) + _MARGIN)

    def show_source(self, source: str) -> None:
        index = self.sources.findData(source)
        with QSignalBlocker(self.sources):
            if index >= 0:
                self.sources.setCurrentIndex(index)
            else:
                self.sources.setCurrentText(source)
        self._line.setCursorPosition(0)
        self._note_selection()

    def show_status(self, status: Status, simulating: bool) -> None:
        text = ""
        if status.sensor is not None and status.state == "streaming":
            text = _sensor_text(status.sensor, status.setup.calibration) + _recording_text(status)
        elif status.state == "waiting":
            text = "Waiting for the device's description\N{HORIZONTAL ELLIPSIS}"
        if text != self.device.text():
            self.device.setText(text)
        self.device.setVisible(bool(text))
        self.show_message(status.message)
        self._show_losses(status)
        self.disconnect_button.setEnabled(status.state != "off")

    def _show_losses(self, status: Status) -> None:
        """Update the losses at a legible rate; a simulation has none."""
        now, sensor = time.monotonic(), status.sensor
        counted = status.accounting.bytes_in > 0
        if counted and sensor is not None and now >= self._next_losses:
            self._next_losses = now + _LOSSES_PERIOD
            self.losses.setText(f"{status.accounting.words}.")
        self.losses.setVisible(counted and sensor is not None)

    def show_message(self, text: str, hint: bool = False) -> None:
        super().show_message(text, hint)
        self.copy_button.setVisible(bool(COMMAND.search(text)))


def _port_text(port: Port) -> str:
    """Description of a port, and whether this user may open it."""
    words = printable(port.words)
    return words if port.opened else f"{words}  (no permission)"


def _abbreviated(words: str) -> str:
    """The `words` shortened in the middle: the end has the serial number."""
    if len(words) <= _LONGEST:
        return words
    return f"{words[: _LONGEST - _TAIL - 1]}\N{HORIZONTAL ELLIPSIS}{words[-_TAIL:]}"


def _recording_text(status: Status) -> str:
    """Date and length of the recording that is played."""
    replay = status.replay
    if replay is None:
        return ""
    whole = "" if replay.whole else ", unfinished"
    return f"\nRecorded {day(replay.begun)}, {replay.length:.1f} s{whole}"


def _sensor_text(sensor: Sensor, calibration: Calibration | None) -> str:
    """Description of a sensor."""
    patch, live = sensor.layout.patch, sensor.layout.live
    bends = patch.strip and not sensor.layout.reads  # along x alone
    sensing = live[:1] if bends else live
    dead = int((~sensing).sum())
    a, b, radius = (round(1e3 * length, 1) for length in (patch.a, patch.b, patch.radius))
    bent = f", radius {radius:g} mm" if patch.base_curvature else ""
    health = f"\n{dead} of {sensing.size} channels dead" if dead else ""
    name = printable(f"{sensor.name} ({sensor.serial_number})")
    calibrated = f"\n{calibration_text(calibration)}" if calibration else ""
    rate = f", up to {sensor.rate:g} frames/s" if math.isfinite(sensor.rate) else ""
    return (
        f"{name}\n{sensor.layout}, {sensor.edge}{health}\n{a:g} x {b:g} mm{bent}{rate}{calibrated}"
    )
