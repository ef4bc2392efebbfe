"""Connection: selection of the source of readings."""

from kappaskin.live import ResumeInfo
from kappaskin_app.features.connection.panel import ConnectionPanel, PortSearch
from kappaskin_app.guard import guarded
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.parts import SOURCE
from kappaskin_app.shell.window import MainWindow

_SIMULATE = "Connect the simulated skin that the panels define"
_CONNECT = "Connect the source selected under Connection"
_DISCONNECT = "Close the source; the last readings stay visible, marked as lost"
_PORTS = "Search for serial ports; the list is also updated every second"


class ConnectionFeature:
    name = "connection"

    def install(self, shell: MainWindow) -> None:
        self._session = session = shell.session
        add = shell.actions_by_name.add
        self.connection = shell.panels.add(LIVE, ConnectionPanel())
        self.port_search = PortSearch(self.connection.sources, shell.tasks, shell)
        self.connection.connect_requested.connect(guarded(session.request_source))
        self.connection.disconnect_requested.connect(guarded(session.disconnect_from))
        self.connection.refresh_requested.connect(guarded(self.port_search.refresh))
        self.port_search.found.connect(guarded(self.connection.show_ports))
        session.source_changed.connect(guarded(self.connection.show_source))
        add("simulate", SOURCE, "&Simulated skin", session.simulate, "Ctrl+M", _SIMULATE)
        add("connect", SOURCE, "&Connect", self._connect, "Ctrl+Return", _CONNECT)
        add("disconnect", SOURCE, "&Disconnect", session.disconnect_from, "Ctrl+D", _DISCONNECT)
        add("ports", SOURCE, "Re&fresh ports", self.port_search.refresh, "F5", _PORTS)
        shell.menus.welcome.add(
            2,
            "Connec&t a sensor",
            "Select the port of a sensor under Connection, then connect it.",
            lambda: self._show(shell),
        )
        shell.begun.connect(guarded(self._begin))

    def _begin(self, _: ResumeInfo | None, source: str) -> None:
        """Show the requested source, which is not read while a resumed recording uses another."""
        self.connection.show_source(source)
        self.port_search.refresh()

    def _connect(self) -> None:
        self._session.request_source(self.connection.source())

    def _show(self, shell: MainWindow) -> None:
        """Show the panel with the focus on the list of sources."""
        shell.docks.reveal("settings")
        shell.panels.reveal(self.connection)
        self.connection.sources.setFocus()
