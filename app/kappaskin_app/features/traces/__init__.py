"""Traces: details of the selected element, and readings of several elements over time."""

from kappaskin_app.features.traces.selected_element import SelectedElement
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow

_DOCK = "element"
_ELEMENT = "The element clicked: last 10 s, spectrum, calibration and health"

_TRACES = (
    "The last 10 s of selected elements, one plot each for what they read: xx, yy and xy, or others"
)


class TracesFeature:
    name = "traces"

    def install(self, shell: MainWindow) -> None:
        self.selected_element = shown = SelectedElement(
            shell.history, shell.session, shell.display, shell.selection
        )
        shell.docks.put_below(_DOCK, "Element", shown.panel, "Ctrl+Alt+E", _ELEMENT)
        shell.docks.put_below("traces", "Traces", shown.traces, "Ctrl+Alt+T", _TRACES)
        shown.selected.connect(guarded(lambda *_: shell.docks.reveal(_DOCK)))
