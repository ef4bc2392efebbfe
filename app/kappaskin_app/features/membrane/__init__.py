"""Membrane: 3-D view of the skin with colours, loads, contact, overlays and legend."""

from kappaskin_app.features.membrane.skin_view import SkinView
from kappaskin_app.features.membrane.view_actions import ViewActions, ViewPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import MainWindow


class MembraneFeature:
    name = "membrane"

    def install(self, shell: MainWindow) -> None:
        self.view = view = SkinView(shell.display, shell.session, shell.selection)
        self.membrane, self.scale = view.membrane, view.scale
        self.panel = shell.panels.add(LIVE, ViewPanel())
        shell.display.centre.show_view(self.membrane)
        shell.display.centre.add_beside(self.scale)
        self.legend = view.legend
        shell.display.centre.add_below(self.legend)
        self.view_actions = ViewActions(shell.history, shell.requests, shell.display, view)
        self.view_actions.add_actions(shell.actions_by_name)
        self._connect(shell)
        self._connect_drag(shell)

    def _connect(self, shell: MainWindow) -> None:
        view, selection = self.view, shell.selection
        shell.settings_shown.connect(guarded(view.show_settings))
        shell.settings_shown.connect(guarded(self._show_colours))
        self.legend.toggled.connect(guarded(shell.requests.toggle))
        for part in (self.scale, self.legend, self.membrane):
            shell.display.unit_changed.connect(guarded(part.show_unit))
        shell.display.unit_changed.connect(guarded(self._enable_alarm))
        self.membrane.drawn.connect(shell.session.hurry)
        self.membrane.drawn.connect(shell.display.drawn)
        self.membrane.pointer.moved.connect(selection.over)
        self.scale.lock_wanted.connect(guarded(self.view_actions.lock))
        self.membrane.pointer.clicked.connect(guarded(self._click))
        self._selection, self._colouring = selection, shell.display.colouring
        shell.closed.connect(guarded(self.membrane.close_plotter))

    def _show_colours(self, settings: Settings) -> None:
        self.panel.show_colours(self._colouring, settings)
        self.view_actions.show_colours(self._colouring.shades)

    def _enable_alarm(self, unit: float) -> None:
        """In full screen the presenter shows the reason why no data arrives."""
        self.view.alarm_enabled = not unit

    def _click(self, x: float, y: float) -> None:
        if self.view.measurement.on:
            self.view.measurement.add_place(x, y)
        else:
            self._selection.clicked.emit(x, y)

    def _connect_drag(self, shell: MainWindow) -> None:
        """Connect the mouse and keys that move and press the drawn load."""
        drag, load = self.membrane.drag, shell.selection.load
        drag.grabbed.connect(load.grabbed)
        drag.grabbed.connect(guarded(lambda *_: self._selection.over.emit(None)))
        drag.dragged.connect(load.dragged)
        drag.pressed.connect(load.pressed)
        drag.released.connect(load.released)
        drag.cancelled.connect(load.cancelled)
        shell.closing.connect(guarded(drag.give_up))
        # A click measures then.
        self.view.measurement.changed.connect(lambda on: setattr(drag, "enabled", not on))
