"""View settings of the skin, and actions for colours, exaggeration and camera."""

from collections.abc import Callable, Mapping
from functools import partial

from PySide6.QtGui import QKeySequence, QShortcut

from kappaskin_app.features.membrane.camera import DIRECTIONS
from kappaskin_app.features.membrane.skin_view import SkinView
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import WITHIN, Actions
from kappaskin_app.shell.colouring import SHADES, Colouring, Shade
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.history import History
from kappaskin_app.shell.requests import Requests
from kappaskin_app.shell.settings import Settings, form_field, locked_at, locking


class ViewPanel(Form):
    """Settings of colours, exaggeration and overlays."""

    purpose = "How the skin is drawn: colours, vertical exaggeration and overlays."
    guide_page = "numbers"

    def __init__(self) -> None:
        names = (
            *("colour_by", "colour_from", "colour_map", "maps", "one_range"),
            *(
                "exaggeration",
                "show_fit",
                "show_elements",
                "show_truth",
                "show_contact",
                "show_load",
            ),
            *("show_directions", "show_band"),
            *("show_frame", "show_object", "show_pressed", "from_x", "to_x", "from_y", "to_y"),
            *("from_z", "to_z", "theme", "letters", "show_start"),
        )
        super().__init__("View", names)

    def show_colours(self, colouring: Colouring, settings: Settings) -> None:
        """Offer what may be shown of the sensor, and show what is."""
        options = {name: shade.label for name, shade in colouring.shades.items()}
        maps = tuple((name, options[name]) for name in colouring.maps)
        self.show_options("colour_by", tuple(options.items()), settings.colour_by)
        self.show_options("maps", maps, settings.maps)


_MENU = "Sk&in"
_COLOURS = f"{_MENU}{WITHIN}&Colour"
# The key, and the name by which a file of settings knows a changed one.
_DIRECTIONS = (
    ("F6", "look-from-above", "above", "From above: x to the right, y upward"),
    ("F7", "look-along-y", "front", "From the front edge: x to the right, displacement vertical"),
    ("F8", "look-along-x", "side", "From the side: y to the right, displacement vertical"),
    ("Shift+F6", "look-from-below", "below", "From the side opposite the contact"),
    (
        "Shift+F7",
        "look-from-a-corner,-all-sides-alike",
        "corner",
        "Isometric: the same scale along x, y and the displacement",
    ),
)
_TOGGLES = (
    ("fit", "&fitted surface", ""),
    ("contact", "&contact", ""),
    ("load", "&load", ""),
    ("elements", "&elements", "Ctrl+E"),
    ("truth", "&true surface", "Ctrl+U"),
    ("directions", "principal &directions", "Ctrl+Alt+D"),
    ("band", "error &band", "Ctrl+Alt+B"),
    ("frame", "contact &frame", "Ctrl+Alt+F"),
    ("object", "estimated &object", "Ctrl+Alt+O"),
    ("pressed", "true ob&ject", "Ctrl+Alt+P"),
)
_LOCK = "Fix all colour ranges at their present values, or let them follow the data"
_HIGHER = "Increase the vertical exaggeration by 1; colours do not change"
_LOWER = "Decrease the vertical exaggeration by 1; colours do not change"
_CAMERA = "View the whole skin from the initial direction"
_MEASURE = "Measure the distance between two places that you click; Esc ends"
_COLOUR = "colour-"  # begins the name of an action
_DIGITS = 9  # actions that may have a digit for a shortcut


class ViewActions:
    """Actions of the view: requests of settings, camera and measurement."""

    def __init__(
        self, history: History, requests: Requests, display: Display, view: SkinView
    ) -> None:
        self._history, self._requests = history, requests
        self._display, self._view = display, view

    def add_actions(self, actions: Actions) -> None:
        add, requests = actions.add, self._requests
        self._actions = actions
        for number, shade in enumerate(SHADES.values(), 1):
            self._add_colour(shade, f"Ctrl+{number}" if number <= _DIGITS else "")
        add("lock-ranges", _MENU, "Fixed or a&utomatic ranges", self.lock_all, "Ctrl+Alt+L", _LOCK)
        add("higher", _MENU, "&Higher exaggeration", partial(self.exaggerate, 1), "Ctrl++", _HIGHER)
        add("lower", _MENU, "&Lower exaggeration", partial(self.exaggerate, -1), "Ctrl+-", _LOWER)
        for name, words, key in _TOGGLES:
            toggle = partial(requests.toggle, f"show_{name}")
            tip = form_field(f"show_{name}").tip
            add(name, _MENU, f"Show or hide {words}", toggle, key, tip)
        camera = self._view_from("Reset camera", "left")
        add("camera", _MENU, "Reset &camera", camera, "Ctrl+Shift+R", _CAMERA)
        for key, name, look, tip in _DIRECTIONS:
            words = f"View {DIRECTIONS[look].words}"
            add(name, _MENU, words, self._view_from(words, look), key, tip)
        self._view.membrane.camera_control.turned.connect(guarded(self._store_camera))

        measurement = self._view.measurement
        self._measure = add(
            "measure", _MENU, "&Measure", measurement.toggle, "Ctrl+Alt+M", _MEASURE
        )
        self._measure.setCheckable(True)
        self._escape = QShortcut(QKeySequence("Esc"), self._view.membrane.window())
        self._escape.setEnabled(False)
        self._escape.activated.connect(guarded(measurement.end))
        measurement.changed.connect(guarded(self._show_measuring))

    def _add_colour(self, shade: Shade, key: str = "") -> None:
        words = f"Colour by {shade.label.lower()}"
        act = partial(self._requests.set, "colour_by", shade.name)
        self._actions.add(f"{_COLOUR}{shade.name}", _COLOURS, words, act, key, shade.tip)

    def show_colours(self, shades: Mapping[str, Shade]) -> None:
        """Allow the colours of these quantities only."""
        entries = self._actions.entries
        for name, shade in shades.items():
            if f"{_COLOUR}{name}" not in entries:
                self._add_colour(shade)
        for name in entries:
            if name.startswith(_COLOUR):
                there = name.removeprefix(_COLOUR) in shades
                self._actions.allow(name, "" if there else "this sensor does not read it")

    def _show_measuring(self, on: bool) -> None:
        self._measure.setChecked(on)
        self._escape.setEnabled(on)

    def exaggerate(self, step: int) -> None:
        """Change the vertical exaggeration by `step`, within 1 to 50."""
        wanted = self._history.settings.exaggeration + step
        self._requests.set("exaggeration", float(min(max(wanted, 1), 50)))

    def _view_from(self, words: str, look: str) -> Callable[[], None]:
        return partial(self._history.change, words, -1, look=look, camera=())

    def _store_camera(self, camera: tuple[float, ...], dragged: bool) -> None:
        """Store the camera: each drag is a step of the history, successive wheel turns are one."""
        if dragged:
            self._history.change("Move the camera", -1, camera=camera)
        else:
            self._history.request("camera", camera=camera)

    def lock(self, locked: bool) -> None:
        """Fix the colour range of the skin at its present limit, or let it follow the data."""
        limit = self._view.limit_shown() if locked else 0.0
        self._requests.lock(self._display.settings.colour_by, limit)

    def lock_all(self) -> None:
        """Fix all visible colour ranges, or make them automatic if all are fixed."""
        settings, ranges = self._history.settings, self._display.limits_shown()
        locked = all(locked_at(name, settings) for name in ranges)
        words = "Automatic ranges" if locked else "Fixed ranges"
        limits = {name: 0.0 if locked else limit for name, limit in ranges.items()}
        self._history.change(words, -1, **locking(limits, settings))
