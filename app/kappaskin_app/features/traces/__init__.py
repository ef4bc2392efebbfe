"""One element in detail, and traces of several over time."""

from kappaskin_app.features.traces.selected_element import Picking
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_ELEMENT = "All about the element clicked: its last seconds, spectrum, calibration and health"

_TRACES = "The last seconds of the elements chosen, in one plot each for xx, yy and xy"


class TracesFeature:
    name = "traces"

    def install(self, shell: MainWindow) -> None:
        self.picking = Picking(shell.history, shell.session, shell.display, shell.selection)
        shell.docks.put_below("element", "Element", self.picking.card, "Ctrl+Alt+E", _ELEMENT)
        shell.docks.put_below("traces", "Traces", self.picking.traces, "Ctrl+Alt+T", _TRACES)
        self.picking.picked.connect(guarded(lambda *_: self._show_element(shell)))

    def _show_element(self, shell: MainWindow) -> None:
        shell.docks.reveal("element")
        shell.layouts.note()  # a step of its own, before that of the element
