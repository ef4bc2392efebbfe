"""How the skin is viewed: settings, and actions for colours, height and camera."""

from collections.abc import Callable
from functools import partial

from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QWidget

from kappaskin_app.features.membrane.camera import DIRECTIONS
from kappaskin_app.features.membrane.skin_view import SkinView
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import WITHIN, Actions
from kappaskin_app.shell.colouring import SHADES
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.history import History
from kappaskin_app.shell.requests import Requests
from kappaskin_app.shell.settings import ask_of
from kappaskin_app.shell.settings.shown import COLOURS


class ViewPanel(Form):
    """Asks for colours, height and what is drawn beside the skin."""

    purpose = "How the skin is drawn: its colours, its height and what is drawn over it."
    guide_page = "numbers"

    def __init__(self, parent: QWidget | None = None) -> None:
        names = (
            *("colour_by", "colour_from", "maps", "one_range"),
            *("exaggeration", "show_elements", "show_truth", "show_directions", "show_band"),
            *("show_frame", "show_object", "show_pressed", "from_x", "to_x", "from_y", "to_y"),
            *("from_z", "to_z", "theme", "letters", "show_start"),
        )
        super().__init__("View", names, parent)


_MENU = "Sk&in"
_COLOURS = f"{_MENU}{WITHIN}&Colour"
_LOOKS = (
    ("F6", "above", "The skin as a map: x to the right, y upward"),
    ("F7", "front", "The skin from its front edge: x to the right, displacement up and down"),
    ("F8", "side", "The skin from its side: y to the right, displacement up and down"),
    ("Shift+F6", "below", "The skin from the side that is not touched"),
    ("Shift+F7", "corner", "Lengths along x, y and the displacement drawn alike"),
)
_TOGGLES = (
    ("elements", "&elements", "Ctrl+E"),
    ("truth", "&true surface", "Ctrl+U"),
    ("directions", "principal &directions", "Ctrl+Alt+D"),
    ("band", "error &band", "Ctrl+Alt+B"),
    ("frame", "contact &frame", "Ctrl+Alt+F"),
    ("object", "object f&ound", "Ctrl+Alt+O"),
    ("pressed", "object &pressed", "Ctrl+Alt+P"),
)
_LOCK = "Keep what every colour means as it is now, or let it follow what is shown"
_HIGHER = "Draw the displacement one more time larger; the colours stay as they are"
_LOWER = "Draw the displacement one time less large; the colours stay as they are"
_CAMERA = "Look at the whole skin from where it is seen at first"
_MEASURE = "Measure between two places of the skin that you click; Escape ends"
_DIGITS = 9  # actions that may have a digit for a shortcut


class Looking:
    """Turns what a person asks of the `display` into requests, or moves the camera."""

    def __init__(
        self, history: History, requests: Requests, display: Display, view: SkinView
    ) -> None:
        self._history, self._requests = history, requests
        self._display, self._view = display, view

    def add_actions(self, actions: Actions) -> None:
        add, requests = actions.add, self._requests
        for number, (value, words) in enumerate(COLOURS, 1):
            colour = partial(requests.set, "colour_by", value)
            key = f"Ctrl+{number}" if number <= _DIGITS else ""
            words, tip = f"Colour by {words.lower()}", SHADES[value].tip
            add(f"colour-{value}", _COLOURS, words, colour, key, tip)
        add("lock-ranges", _MENU, "&Lock or free all ranges", self.lock_all, "Ctrl+Alt+L", _LOCK)
        add("higher", _MENU, "Draw &higher", partial(self.exaggerate, 1), "Ctrl++", _HIGHER)
        add("lower", _MENU, "Draw &lower", partial(self.exaggerate, -1), "Ctrl+-", _LOWER)
        for name, words, key in _TOGGLES:
            toggle = partial(requests.toggle, f"show_{name}")
            tip = ask_of(f"show_{name}").tip
            add(name, _MENU, f"Show or hide {words}", toggle, key, tip)
        camera = self._look("Reset camera", "left")
        add("camera", _MENU, "Reset &camera", camera, "Ctrl+R", _CAMERA)
        for key, look, tip in _LOOKS:
            words = f"Look {DIRECTIONS[look].words}"
            add(words.lower().replace(" ", "-"), _MENU, words, self._look(words, look), key, tip)
        self._view.membrane.gaze.turned.connect(guarded(self._turned))

        measuring = self._view.measuring
        self._measure = add("measure", _MENU, "&Measure", measuring.turn, "Ctrl+Alt+M", _MEASURE)
        self._measure.setCheckable(True)
        self._escape = QShortcut(QKeySequence("Esc"), self._view.membrane.window())
        self._escape.setEnabled(False)
        self._escape.activated.connect(guarded(measuring.end))
        measuring.changed.connect(guarded(self._show_measuring))

    def _show_measuring(self, on: bool) -> None:
        self._measure.setChecked(on)
        self._escape.setEnabled(on)

    def exaggerate(self, step: int) -> None:
        """Draw the displacement larger by so many times."""
        wanted = self._history.settings.exaggeration + step
        self._requests.set("exaggeration", float(min(max(wanted, 1), 50)))

    def _look(self, words: str, look: str) -> Callable[[], None]:
        return partial(self._history.change, words, -1, look=look, camera=())

    def _turned(self, camera: tuple[float, ...], dragged: bool) -> None:
        """Take note of how the camera was turned: a drag is one step, as are turns of the wheel."""
        if dragged:
            self._history.change("Turn the view", -1, camera=camera)
        else:
            self._history.wish("camera", camera=camera)

    def lock(self, locked: bool) -> None:
        """Keep the range of the skin's colours as it is, or let it follow what is shown."""
        limit = self._view.limit_shown() if locked else 0.0
        self._requests.set(f"range_{self._history.settings.colour_by}", limit)

    def lock_all(self) -> None:
        """Keep all ranges of colours that are shown as they are, or let them go if all are kept."""
        settings, ranges = self._history.settings, self._display.limits_shown()
        locked = all(getattr(settings, name) for name in ranges)
        words = "Free all ranges" if locked else "Lock all ranges"
        self._history.change(words, -1, **{n: 0.0 if locked else v for n, v in ranges.items()})
