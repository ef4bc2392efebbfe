"""Connection panel: selection of the source, and search for serial ports."""

import math
import time

from PySide6.QtCore import (
    QEvent,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QSignalBlocker,
    QSize,
    Qt,
    QTimer,
    Signal,
)
from PySide6.QtGui import QKeyEvent, QKeySequence, QMouseEvent, QWheelEvent
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QWidget,
)

from kappaskin._text import printable
from kappaskin.calibration import Calibration
from kappaskin.live import Status
from kappaskin.sensing import Sensor
from kappaskin.skin import Cap, MeshSkin
from kappaskin.sources import Port, feeds_found, parts_of
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.form import pass_window_keys
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.settings import calibration_text
from kappaskin_app.widgets.parts import ELLIPSIS, Label, plain_tip
from kappaskin_app.widgets.text import COMMAND, day

_PERIOD = 1000  # ms between two searches


class PortSearch(QObject):
    """Searches for ports and feeds each second while `combo` is visible; emits them as `found`."""

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
            self._search.run(lambda: [*Port.found(), *feeds_found()])


_SIMULATED = ("sim:", "Simulate a device")
_IDENTIFY = "Identify devices"
_IDENTIFY_HELP = "Opens each free port for up to 10 s; some boards restart."
_UNKNOWN = "not identified"
_NO_PORTS = ("sim:", "replay:", "feed:", "sensor:")
_TIP = (
    "Click for the list of devices, or type a port or URL, such as /dev/ttyACM0, COM3 or "
    "socket://host:port."
)
_LONGEST, _TAIL = 64, 18  # characters of a line of the list, and how many of them from its end
_MARGIN, _SPACE = 16, 6  # px
_LOSSES_PERIOD = 1.0  # s between two updates of the losses
_EDITING = Qt.Key.Key_Backspace, Qt.Key.Key_Delete, Qt.Key.Key_Left, Qt.Key.Key_Right
_CHOOSING = Qt.Key.Key_Return, Qt.Key.Key_Enter
_CLICKING = (
    QEvent.Type.MouseButtonPress,
    QEvent.Type.MouseButtonRelease,
    QEvent.Type.MouseButtonDblClick,
)
_BREAK = "\N{LINE SEPARATOR}    "  # at which an item of a list is broken, and an indent
_DETAILS = Qt.ItemDataRole.UserRole + 1


class _Rows(QStyledItemDelegate):
    """Draws each source with its details in further lines."""

    def initStyleOption(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        super().initStyleOption(option, index)
        option.text = index.data(_DETAILS) or index.data()  # pyright: ignore[reportAttributeAccessIssue]

    def sizeHint(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> QSize:
        return super().sizeHint(option, index) + QSize(0, _SPACE)


class SourceBox(QComboBox):
    """A list that opens on a click, with a line in which typed text replaces the selected text.

    `chosen` is emitted for what is chosen from the list alone: `activated` is for a typed name that
    is listed, too, once the line loses the focus. `identify_requested` is for the entry without
    data, at which the list stays open.
    """

    chosen = Signal()
    identify_requested = Signal()

    def __init__(self) -> None:
        # Without looking for duplicates, or Return would choose from the list.
        super().__init__(
            editable=True, insertPolicy=self.InsertPolicy.NoInsert, duplicatesEnabled=True
        )  # pyright: ignore[reportCallIssue]
        self.line, self._opens, self._listed = QLineEdit(), False, False
        self.setLineEdit(self.line)
        # A completer would turn a typed ttyACM1 into a listed ttyACM10.
        self.setCompleter(None)  # pyright: ignore[reportArgumentType]
        self.activated.connect(self._choose)
        self.line.textEdited.connect(self._leave_list)
        self.setItemDelegate(_Rows(self))
        self.view().setTextElideMode(Qt.TextElideMode.ElideNone)
        for watched in (self.line, self.view(), self.view().viewport()):
            watched.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if isinstance(event, QKeyEvent) and watched is self.view():
            if event.key() in _CHOOSING and self._identifies(self.view().currentIndex()):
                return self._identify(event.type() == QEvent.Type.KeyPress)
            return event.type() == QEvent.Type.KeyPress and self._typed(event)
        if isinstance(event, QMouseEvent) and watched is self.view().viewport():
            if event.type() not in _CLICKING or not self._identifies(
                self.view().indexAt(event.position().toPoint())
            ):
                return False
            return self._identify(event.type() == QEvent.Type.MouseButtonPress)
        if isinstance(event, QMouseEvent) and watched is self.line:
            if event.type() == QEvent.Type.MouseButtonPress:
                self._opens = not self.line.isModified()  # while typing it places the cursor
                if self._opens:
                    self.line.selectAll()
            elif event.type() == QEvent.Type.MouseButtonRelease and self._opens:
                self._opens = False
                self.showPopup()
                self.line.selectAll()
                return True
            return self._opens
        return super().eventFilter(watched, event)

    def _identifies(self, index: QModelIndex) -> bool:
        return index.isValid() and not index.data(Qt.ItemDataRole.UserRole)

    def _identify(self, requested: bool) -> bool:
        """Keep the list open for what will be identified."""
        if requested:
            self.identify_requested.emit()
        return True

    def _typed(self, event: QKeyEvent) -> bool:
        """Type into the line what is typed while the list is open; whether it was text."""
        edits = event.key() in _EDITING or event.matches(QKeySequence.StandardKey.Paste)
        if not edits and not (event.text() and event.text().isprintable()):
            return False
        self.hidePopup()
        if not self.line.isModified():
            self.line.selectAll()  # some window managers have ended the selection
        QApplication.sendEvent(self.line, event)
        return True

    def showPopup(self) -> None:
        self._listed = True
        super().showPopup()

    def _leave_list(self) -> None:
        self._listed = False

    def _choose(self) -> None:
        if self._listed:
            self._listed = False
            self.chosen.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Up, Qt.Key.Key_Down):
            self.showPopup()  # to choose without connecting what lies between
        else:
            super().keyPressEvent(event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()


class ConnectionPanel(Panel):
    """Selection of a source: the simulation, a device found, or a typed port or URL."""

    purpose = (
        "The source of readings: a simulated device, a serial port, any URL that pyserial opens, "
        "or a recording. It streams until another one answers. A lost connection is reopened "
        "automatically, and lost messages are counted."
    )
    guide_page = "connect"

    connect_requested = Signal(str)
    disconnect_requested = Signal()
    cancel_requested = Signal()
    refresh_requested = Signal()
    new_requested = Signal()

    def __init__(self) -> None:
        super().__init__("Connection")
        self._ports: list[Port] = []
        self._selected: Port | None = None  # the selected port, listed or not
        self._next_losses = self._next_link = 0.0
        self._speakers: list[tuple[Port, str]] = []  # ports, and the devices last connected there
        self._refusal, self._connecting = "", ""
        self.sources = SourceBox()
        self.sources.setObjectName("source")
        self.sources.setAccessibleName("Source of readings")
        self.sources.setMinimumContentsLength(12)
        self.sources.currentTextChanged.connect(self._note_selection)
        self.sources.chosen.connect(self._request)
        self.refresh_button = QPushButton("Refresh")
        self.refresh_button.setToolTip("Search for serial ports again.")
        self.connect_button = QPushButton("Connect")
        self.connect_button.setObjectName("connect")
        self.connect_button.setToolTip("Connect the source above (Ctrl+Return).")
        self.disconnect_button = QPushButton("Disconnect")
        self.disconnect_button.setObjectName("disconnect")
        self.device, self.losses = Label(wordWrap=True), Label(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.losses.setToolTip("Messages lost and bytes discarded since the source was connected.")
        self.link = Label(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.link.setToolTip(
            "The connection to the engine in another room: how long a message and its answer take, "
            "how old estimates are when they come, and how many the connection did not take. A "
            "recording at the engine has all."
        )
        self.copy_button = QPushButton("Copy the command")
        self.copy_button.setToolTip("Copy the command in the message above, for a terminal.")
        self.copy_button.clicked.connect(self._copy_command)
        self.connect_button.clicked.connect(self._request)
        self._line = self.sources.line
        self._line.returnPressed.connect(self.connect_button.click)
        self.disconnect_button.clicked.connect(self._disconnect)
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
        self.body.addWidget(self.link)
        self._around.addWidget(self.copy_button, alignment=Qt.AlignmentFlag.AlignRight)
        pass_window_keys(self.sources)
        self._list()

    def source(self) -> str:
        """The name of the source that is selected or typed."""
        text = self.sources.currentText().strip()
        index = self.sources.findText(text)
        return str(self.sources.itemData(index) or text) if index >= 0 else text

    def _request(self) -> None:
        self._refusal = ""
        self._line.setModified(False)
        self.connect_requested.emit(self.source())

    def _disconnect(self) -> None:
        (self.cancel_requested if self._connecting else self.disconnect_requested).emit()

    def port(self) -> str:
        """The port or URL that is selected or typed, else the only one found; empty without."""
        chosen = parts_of(self.source())[1] or self.source()
        if not chosen.startswith(_NO_PORTS):
            return chosen
        ports = [port.port for port in self._ports if not port.port.startswith(_NO_PORTS)]
        return ports[0] if len(ports) == 1 else ""

    def _note_selection(self) -> None:
        """Store the selected port, to recognise its device under another name."""
        chosen = self.source()
        known = (port for port in self._ports if port.port == chosen)
        absent = self._selected if self._selected and self._selected.port == chosen else None
        self._selected = next(known, absent)
        words = "" if chosen == _SIMULATED[0] else chosen
        if self._selected is not None:
            words = "\n".join(self._lines_on(self._selected))
        self.sources.setToolTip(plain_tip(f"{words}\n\n{_TIP}" if words else _TIP))

    def show_ports(self, ports: list[Port]) -> None:
        """List these and the simulation; the selected device stays selected under a new name."""
        if ports == self._ports or self.sources.view().isVisible():
            return  # an open list is not changed under the mouse
        chosen, selected, self._ports = self.source(), self._selected, ports
        here = [known for known in self._speakers if any(map(known[0].same_plug, ports))]
        self._speakers = here
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
            for port in self._ports:
                self.sources.addItem(printable(port.port), port.port)
            if self.unidentified():
                self.sources.addItem(_IDENTIFY)
                row = self.sources.count() - 1
                self.sources.setItemData(row, f"{_IDENTIFY}{_BREAK}{_IDENTIFY_HELP}", _DETAILS)
            self._show_details()

    def _show_details(self) -> None:
        for row, port in enumerate(self._ports, 1):
            lines = self._lines_on(port)
            self.sources.setItemData(row, _BREAK.join(map(_abbreviated, lines)), _DETAILS)
            tip = plain_tip("\n".join(lines))
            self.sources.setItemData(row, tip, Qt.ItemDataRole.ToolTipRole)
        # Wider than the panel, or the list would cut off the serial numbers of two of a kind.
        self.sources.view().setMinimumWidth(self.sources.view().sizeHintForColumn(0) + _MARGIN)

    def _lines_on(self, port: Port) -> list[str]:
        """Its name and number, its description and maker, and what speaks there."""
        known = (text for other, text in self._speakers if other.same_plug(port))
        speaks = next(known, "" if port.port.startswith(_NO_PORTS) else _UNKNOWN)
        if not port.opened:
            speaks = f"no permission: add yourself to the group {port.group}"
        number = port.serial_number and f"serial number {port.serial_number}"
        maker = "" if port.maker in port.description else port.maker
        named = ", ".join(filter(None, (port.port, number)))
        described = ", ".join(filter(None, (port.description, maker)))
        return [printable(line) for line in (named, described, speaks) if line]

    def unidentified(self) -> list[str]:
        """The listed ports that may be opened to identify what speaks there."""
        return [
            each.port for each in self._ports if each.opened and not each.port.startswith(_NO_PORTS)
        ]

    def show_speaker(self, found: tuple[str, str]) -> None:
        """Show in the list what speaks at a listed port, the first of `found`; empty if unknown."""
        at, text = found
        for port in self._ports:
            if port.port == at and (port, text) not in self._speakers:
                others = [known for known in self._speakers if not known[0].same_plug(port)]
                self._speakers = [*others, *([(port, text)] if text else [])]
                self._show_details()

    def show_source(self, source: str) -> None:
        self._refusal = ""
        index = self.sources.findData(source)
        with QSignalBlocker(self.sources):
            self.sources.setCurrentIndex(index)
            if index < 0:
                self.sources.setEditText(source)
        self._line.setModified(False)
        self._line.setCursorPosition(0)
        self._note_selection()

    def show_refusal(self, why: str) -> None:
        """Show why the requested source is not used."""
        self._refusal = why

    def show_status(self, status: Status, simulating: bool) -> None:
        text = ""
        if status.sensor is not None and status.state == "streaming":
            text = _sensor_text(status.sensor, status.setup.calibration) + _recording_text(status)
            sensor, at = status.sensor, parts_of(status.source)[1] or status.source
            self.show_speaker((at, f"{sensor.name} ({sensor.serial_number}), {sensor.layout}"))
        elif status.state == "waiting":
            text = "Waiting for the device's description\N{HORIZONTAL ELLIPSIS}"
        if text != self.device.text():
            self.device.setText(text)
        self.device.setVisible(bool(text))
        self._connecting = status.connecting
        self._show_message(status)
        self._show_losses(status)
        self._show_link(status)
        self.disconnect_button.setEnabled(status.state != "off")
        self.disconnect_button.setText("Cancel" if status.connecting else "Disconnect")
        self.disconnect_button.setToolTip(
            "Keep the source in use." if status.connecting else "Close the source (Ctrl+D)."
        )

    def _show_message(self, status: Status) -> None:
        """Show the progress or the failure of a connection, with what stays connected."""
        stays = "The simulation" if status.source.startswith("sim:") else status.source
        if status.connecting:
            why = status.source_refusal and f"\n{status.source_refusal}"
            begun = f"Connecting to {status.connecting}{ELLIPSIS} {stays} runs until it answers."
            self.show_message(f"{begun}{why}", hint=not why)
        elif self._refusal:
            self.show_message(f"{self._refusal}\n{stays} stays connected.")
        elif status.replay is None and not status.source.startswith("replay:"):
            self.show_message(status.message)
        else:
            self.show_message("")  # under Recording

    def _show_losses(self, status: Status) -> None:
        """Update the losses at a legible rate; a simulation has none."""
        now, sensor = time.monotonic(), status.sensor
        counted = status.accounting.bytes_in > 0
        if counted and sensor is not None and now >= self._next_losses:
            self._next_losses = now + _LOSSES_PERIOD
            self.losses.setText(f"{status.accounting.words}.")
        self.losses.setVisible(counted and sensor is not None)

    def _show_link(self, status: Status) -> None:
        """Update the state of a connection to another room as often as the losses."""
        now, link = time.monotonic(), status.link
        if link is not None and now >= self._next_link:
            self._next_link = now + _LOSSES_PERIOD
            words = link.words or "connecting"
            self.link.setText(f"Engine at {printable(link.place)}: {words}.")
        self.link.setVisible(link is not None)

    def show_message(self, text: str, hint: bool = False) -> None:
        super().show_message(text, hint)
        self.copy_button.setVisible(bool(COMMAND.search(text)))


def _abbreviated(words: str) -> str:
    """The `words` shortened in the middle."""
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
    a, b, along_x, along_y = (round(1e3 * one, 1) for one in (patch.a, patch.b, *patch.radii))
    size = f"{a:g} x {b:g} mm"
    bent = f", radius {along_x:g} mm" if patch.arc_curvature else ""
    if patch.is_shallow:
        bent = (
            f", radii {along_x:g} and {along_y:g} mm\nrises {1e3 * patch.rise:.2g} mm; shallow "
            f"shell theory is accurate to {100 * patch.steepness:.2g} %"
        )
    if isinstance(patch, Cap):
        angle = f"{math.degrees(patch.angle):.3g}\N{DEGREE SIGN}"
        bent = f" along the skin\ncap of radius {1e3 * patch.equator:g} mm, {angle} to the rim"
        bent += f", stretched {patch.stretch:g} times" if patch.stretch != 1 else ""
    if isinstance(patch, MeshSkin):
        held, rim = len(patch.held), len(patch.rim)
        on = "its whole rim" if held == rim else f"{held} of {rim} nodes of its rim"
        size = f"{a:g} x {b:g} x {round(1e3 * patch.rise, 1):g} mm"
        bent = f"\nmesh of {len(patch.triangles):,} triangles, {len(patch.points):,} nodes"
        bent += f"\nheld at {on}"
    health = f"\n{dead} of {sensing.size} channels dead" if dead else ""
    name = printable(f"{sensor.name} ({sensor.serial_number})")
    calibrated = f"\n{calibration_text(calibration)}" if calibration else ""
    rate = f", up to {sensor.rate:g} frames/s" if math.isfinite(sensor.rate) else ""
    return f"{name}\n{sensor.layout}, {sensor.edge}{rate}{health}\n{size}{bent}{calibrated}"
