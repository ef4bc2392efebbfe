"""Connection: selection of the source of readings."""

import math
from pathlib import Path
from threading import Event

from PySide6.QtWidgets import QFileDialog

from kappaskin._text import printable
from kappaskin.live import SCHEME, ResumeInfo, Status
from kappaskin.recording import Imported, ImportRequest, ImportTask, is_foreign
from kappaskin.sources import (
    described_source,
    identified_ports,
    is_description,
    load_description,
    parts_of,
)
from kappaskin_app.features.connection.panel import ConnectionPanel, PortSearch
from kappaskin_app.features.connection.wizard import NewSensorDialog
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask
from kappaskin_app.shell.folders import proposed, recordings_folder
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.parts import FILE, SOURCE
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.parts import ELLIPSIS, Label

_SIMULATE = "Connect the simulated skin that the panels define"
_CONNECT = "Connect the source selected under Connection"
_DISCONNECT = "Close the source; the last readings stay visible, marked as lost"
_OPEN = "Connect a sensor with a line format of its own, described in a file (.toml)"
_NEW = "Describe a board that prints numbers, from the lines that it sends"
_FILES = "Sensor description (*.toml)"
_PORTS = "Search for serial ports; the list is also updated every second"


class ConnectionFeature:
    name = "connection"

    def install(self, shell: MainWindow) -> None:
        self._shell, self._session = shell, shell.session
        session = self._session
        add = shell.actions_by_name.add
        self.connection = shell.panels.add(LIVE, ConnectionPanel())
        self.port_search = PortSearch(self.connection.sources, shell.tasks, shell)
        self.connection.connect_requested.connect(guarded(session.request_source))
        self.connection.disconnect_requested.connect(guarded(session.disconnect_from))
        self.connection.cancel_requested.connect(guarded(self._cancel))
        self.connection.refresh_requested.connect(guarded(self.port_search.refresh))
        self.port_search.found.connect(guarded(self.connection.show_ports))
        self._identifying = BackgroundTask[tuple[str, str]](
            shell.tasks, "Identifying devices", self.connection.show_speaker, ended=self._go_on
        )
        self._stopped, self._waiting = Event(), ""  # source that waits until the ports are closed
        self.connection.sources.identify_requested.connect(guarded(self._identify))
        session.source_handlers += [self._refuse_engine, self._wait_for_ports]
        session.reported.connect(guarded(self._show_link))
        self.link = Label()
        self.link.setToolTip("The connection to the engine in another room.")
        self.link.hide()
        shell.display.status_bar.add(self.link)
        session.source_changed.connect(guarded(self.connection.show_source))
        session.source_refused.connect(guarded(self.connection.show_refusal))
        session.reasons.append(self.connection.message)
        add("simulate", SOURCE, "&Simulate a device", session.simulate, "Ctrl+M", _SIMULATE)
        add("connect", SOURCE, "&Connect", self._connect, "Ctrl+Return", _CONNECT)
        add("disconnect", SOURCE, "&Disconnect", session.disconnect_from, "Ctrl+D", _DISCONNECT)
        add("ports", SOURCE, "Re&fresh ports", self.port_search.refresh, "F5", _PORTS)
        self.new_sensor = NewSensorDialog(shell.tasks, shell)
        self.new_sensor.opening.connect(guarded(self._free))
        self.new_sensor.made.connect(guarded(self._connect_new))
        self.new_sensor.rejected.connect(guarded(self._connect_again))
        self._freed = ""  # source whose port the dialog reads
        self.connection.new_requested.connect(guarded(self.new_sensor.begin))
        shell.closing.connect(guarded(self._close))
        add("new-sensor", SOURCE, f"&New sensor{ELLIPSIS}", self.new_sensor.begin, "", _NEW)
        add("open-sensor", FILE, f"Open &sensor{ELLIPSIS}", self._open, "", _OPEN)
        self._imported = Path()
        self._importing = BackgroundTask[float | Imported](
            shell.tasks,
            "Importing",
            self._take_import,
            cancelled="Cancelled; nothing was imported.",
        )
        shell.closing.connect(guarded(self._importing.stop))
        begin, folder = self.new_sensor.begin, ""
        for kind in (
            Kind("sensor description", (".toml",), self._connect_described, is_description),
            Kind("table of readings", (".csv", ".npz", ".parquet"), begin),
            Kind("ROS 2 bag", (".db3", ".mcap", folder), begin, is_foreign),
        ):
            shell.opening.add(kind)
        shell.menus.welcome.add(
            2,
            "Connec&t a sensor",
            "Select the port of a sensor under Connection, then connect it.",
            self._show,
        )
        shell.begun.connect(guarded(self._begin))

    def _begin(self, _: ResumeInfo | None, source: str) -> None:
        """Show the requested source, which is not read while a resumed recording uses another."""
        self.connection.show_source(source)
        self.port_search.refresh()

    def _refuse_engine(self, source: str) -> bool:
        """Say how an engine in another room is opened: a window is of one engine."""
        if source.startswith(SCHEME):
            command = f"`kappaskin app --source {source}`"
            self.connection.show_refusal(f"An engine has a window of its own: {command}.")
        return source.startswith(SCHEME)

    def _show_link(self, status: Status) -> None:
        """Show the delay of the connection in the status bar."""
        if (link := status.link) is not None and math.isfinite(link.round_trip):
            self.link.setText(f"{printable(link.place)}: {1e3 * link.round_trip:.0f} ms")
        self.link.setVisible(link is not None)

    def _identify(self) -> None:
        """Find out what speaks at each port that is not in use here."""
        if self._identifying.running:
            return
        session = self._session
        used = (session.engine.source, session.connecting, session.status.source)
        at = {parts_of(source)[1] or source for source in used if source}
        ports = [port for port in self.connection.unidentified() if port not in at]
        self._stopped = Event()
        self._identifying.run(identified_ports, ports, self._stopped.is_set)

    def _wait_for_ports(self, source: str) -> bool:
        """Close the ports that are being identified before a `source` is connected."""
        self._stopped.set()
        self._waiting = source if self._identifying.running else ""
        return self._identifying.running

    def _go_on(self) -> None:
        """Connect the source that waits."""
        source, self._waiting = self._waiting, ""
        if source:
            self._session.request_source(source)

    def _connect(self) -> None:
        self._session.request_source(self.connection.source())

    def _cancel(self) -> None:
        self._session.withdraw()
        self.connection.show_source(self._session.source)

    def _open(self) -> None:
        file, _ = QFileDialog.getOpenFileName(
            self._shell, "Open a sensor description", str(recordings_folder()), _FILES
        )
        if file:
            self._shell.opening.open(Path(file))

    def _connect_described(self, file: Path) -> None:
        """Connect the sensor described in a file, at the selected port or the only one there."""
        load_description(file)  # or refused here
        self._shell.opening.note(file)
        port = self.connection.port()
        self.connection.show_source(described_source(file.absolute(), port))
        if port:
            self._connect()
        else:
            self._show()
            self._shell.notify("Type the port of this sensor behind its description, then connect")

    def _free(self, port: str) -> None:
        """Let go of a port that the dialog is to read."""
        self._stopped.set()
        source = self._session.engine.source or ""
        if port in (source, parts_of(source)[1]):
            self._freed = source
            self._session.disconnect_from()
            self._shell.notify("Disconnected, as the new sensor is read from the same port")

    def _connect_again(self) -> None:
        """Connect the source whose port the dialog has read, as it makes nothing of it."""
        source, self._freed = self._freed, ""
        if source:
            self._session.request_source(source)

    def _close(self) -> None:
        self._freed = self._waiting = ""
        self._stopped.set()
        self.new_sensor.reject()

    def _connect_new(self, file: Path, port: str, topic: str) -> None:
        """Connect the sensor that a new file describes at a port, or import its lines."""
        self._shell.opening.note(file)
        self._freed = ""
        if (lines := Path(port)).is_file() or is_foreign(lines):
            self._imported = proposed(f"{lines.stem}.mcap")
            request = ImportRequest(lines, self._imported, file, topic)
            self._importing.begin(lambda: ImportTask(request))
            return
        self._session.request_source(described_source(file.absolute(), port))

    def _take_import(self, came: float | Imported) -> None:
        """Play what was imported."""
        if isinstance(came, Imported):
            self._shell.opening.open(self._imported)
            bad = "; ".join(each.words for each in came.bad)
            self._shell.notify(f"Imported {came.words}{bad and f'; left out {bad}'}")

    def _show(self) -> None:
        """Show the panel with the focus on the list of sources."""
        self._shell.docks.reveal("settings")
        self._shell.panels.reveal(self.connection)
        self.connection.sources.setFocus()
