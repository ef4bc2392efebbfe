"""Connection: which source is read."""

from kappaskin.live import ResumeInfo
from kappaskin_app.features.connection.panel import ConnectionPanel, Plugs
from kappaskin_app.guard import guarded
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.parts import SOURCE
from kappaskin_app.shell.window import MainWindow

_SIMULATE = "Read the skin that the panels describe, in place of a sensor or a recording"
_CONNECT = "Take readings from the source that is named under Connection"
_DISCONNECT = "Take no more readings; the last ones stay, marked as old"
_PORTS = "Look again which serial ports there are; they come and go by themselves too"


class ConnectionFeature:
    name = "connection"

    def install(self, shell: MainWindow) -> None:
        self._session = session = shell.session
        add = shell.actions_by_name.add
        self.connection = shell.panels.add(LIVE, ConnectionPanel())
        self.plugs = Plugs(self.connection.sources, shell.tasks, shell)
        self.connection.connect_wanted.connect(guarded(session.request_source))
        self.connection.disconnect_wanted.connect(guarded(session.disconnect_from))
        self.connection.ports_wanted.connect(guarded(self.plugs.look))
        self.plugs.found.connect(guarded(self.connection.show_ports))
        session.source_changed.connect(guarded(self.connection.show_source))
        add("simulate", SOURCE, "&Simulated skin", session.simulate, "Ctrl+M", _SIMULATE)
        add("connect", SOURCE, "&Connect", self._connect, "Ctrl+Return", _CONNECT)
        add("disconnect", SOURCE, "&Disconnect", session.disconnect_from, "Ctrl+D", _DISCONNECT)
        add("ports", SOURCE, "Re&fresh ports", self.plugs.look, "F5", _PORTS)
        shell.menus.welcome.add(
            2,
            "Connec&t a sensor",
            "Choose the port of a real sensor under Connection, and connect it.",
            lambda: self._show(shell),
        )
        shell.begun.connect(guarded(self._begin))

    def _begin(self, _: ResumeInfo | None, source: str) -> None:
        """Show the source that was asked for, which is not read where another one goes on."""
        self.connection.show_source(source)
        self.plugs.look()

    def _connect(self) -> None:
        self._session.request_source(self.connection.source())

    def _show(self, shell: MainWindow) -> None:
        """Show the panel, ready to choose a source."""
        shell.docks.reveal("settings")
        shell.panels.reveal(self.connection)
        self.connection.sources.setFocus()
