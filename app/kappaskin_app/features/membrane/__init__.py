"""The skin in three dimensions: its shape, its colours, what bends it and where it is touched."""

from PySide6.QtCore import Qt

from kappaskin_app.features.membrane.skin_view import SkinView
from kappaskin_app.features.membrane.view_actions import Looking, ViewPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.window import MainWindow


class MembraneFeature:
    name = "membrane"

    def install(self, shell: MainWindow) -> None:
        self.view = view = SkinView(shell.display, shell.session, shell.selection)
        self.membrane, self.scale = view.membrane, view.scale
        self.panel = shell.panels.add(LIVE, ViewPanel())
        shell.display.centre.show_view(self.membrane)
        shell.display.centre.add_beside(self.scale)
        self.looking = Looking(shell.history, shell.requests, shell.display, view)
        self.looking.add_actions(shell.actions_by_name)
        self._follow(shell)
        self._offer_load(shell)

    def _follow(self, shell: MainWindow) -> None:
        view, selection = self.view, shell.selection
        shell.settings_shown.connect(guarded(view.show_settings))
        shell.display.unit_changed.connect(guarded(self.scale.show_unit))
        shell.display.unit_changed.connect(guarded(self._alarm))
        # Queued: the next look comes after the picture is out, and need not wait for the timer.
        self.membrane.drawn.connect(shell.session.tick, Qt.ConnectionType.QueuedConnection)
        self.membrane.drawn.connect(shell.display.drawn)
        self.membrane.pointing.moved.connect(selection.over)
        view.measuring.stepped.connect(
            guarded(lambda words, *places: shell.history.step(words, view.measuring.have, *places))
        )
        self.scale.lock_wanted.connect(guarded(self.looking.lock))
        self.membrane.pointing.clicked.connect(guarded(self._click))
        self._selection = selection
        shell.closed.connect(guarded(self.membrane.close_plotter))

    def _alarm(self, unit: float) -> None:
        """A picture that fills the screen says by itself why nothing comes in."""
        self.view.alarming = not unit

    def _click(self, x: float, y: float) -> None:
        if self.view.measuring.on:
            self.view.measuring.take(x, y)
        else:
            self._selection.clicked.emit(x, y)

    def _offer_load(self, shell: MainWindow) -> None:
        """Let the load that is drawn be dragged."""
        drag, load = self.membrane.drag, shell.selection.load
        drag.grabbed.connect(load.grabbed)
        drag.dragged.connect(load.dragged)
        drag.released.connect(load.released)
        drag.given_up.connect(load.given_up)
