"""How the skin is looked at: actions for its colours, its height and the camera."""

from collections.abc import Callable
from functools import partial

from PySide6.QtGui import QKeySequence, QShortcut

from kappaskin_app.actions import Actions
from kappaskin_app.display import Display
from kappaskin_app.guard import guarded
from kappaskin_app.history import History
from kappaskin_app.settings import COLOURS
from kappaskin_app.views.camera import (
    ABOVE,
    BELOW,
    FROM_THE_LEFT,
    FRONT,
    ISOMETRIC,
    SIDE,
    Direction,
)
from kappaskin_app.wishes import Wishes

_MENU = "Sk&in"
_LOOKS = (
    *(("F6", ABOVE), ("F7", FRONT), ("F8", SIDE)),
    *(("Shift+F6", BELOW), ("Shift+F7", ISOMETRIC)),
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
_TIP = "Measure between two places of the skin that you click; Escape ends"
_DIGITS = 9  # actions that may have a digit for a shortcut


class Looking:
    """Turns what a person asks of the `display` into wishes, or moves the camera."""

    def __init__(self, history: History, wishes: Wishes, display: Display) -> None:
        self._history, self._wishes, self._display = history, wishes, display

    def add_actions(self, actions: Actions) -> None:
        add, wishes = actions.add, self._wishes
        for number, (value, words) in enumerate(COLOURS, 1):
            colour = partial(wishes.wish, "colour_by", value)
            key = f"Ctrl+{number}" if number <= _DIGITS else ""
            add(f"colour-{value}", _MENU, f"Colour by {words.lower()}", colour, key)
        add("lock-ranges", _MENU, "&Lock or free all ranges", self.lock_all, "Ctrl+Alt+L")
        add("higher", _MENU, "Draw &higher", partial(wishes.exaggerate, 1), "Ctrl++")
        add("lower", _MENU, "Draw &lower", partial(wishes.exaggerate, -1), "Ctrl+-")
        for name, words, key in _TOGGLES:
            toggle = partial(wishes.toggle, f"show_{name}")
            add(name, _MENU, f"Show or hide {words}", toggle, key)
        add("camera", _MENU, "Reset &camera", self._look(FROM_THE_LEFT), "Ctrl+R")
        for key, direction in _LOOKS:
            words = f"Look {direction.words}"
            add(words.lower().replace(" ", "-"), _MENU, words, self._look(direction), key)

        measuring = self._display.measuring
        self._measure = add("measure", _MENU, "&Measure", measuring.turn, "Ctrl+Alt+M", _TIP)
        self._measure.setCheckable(True)
        self._escape = QShortcut(QKeySequence("Esc"), self._display.membrane.window())
        self._escape.setEnabled(False)
        self._escape.activated.connect(guarded(measuring.end))
        measuring.changed.connect(guarded(self._show_measuring))
        self._display.membrane.pointing.clicked.connect(guarded(self._click))

    def _show_measuring(self, on: bool) -> None:
        self._measure.setChecked(on)
        self._escape.setEnabled(on)

    def _click(self, x: float, y: float) -> None:
        if self._display.measuring.on:
            self._display.measuring.take(x, y)

    def _look(self, direction: Direction) -> Callable[[], None]:
        return partial(self._display.membrane.look_from, direction)

    def lock(self, locked: bool) -> None:
        """Keep the range of the skin's colours as it is, or let it follow what is shown."""
        limit = self._display.limit_shown() if locked else 0.0
        self._wishes.wish(f"range_{self._history.settings.colour_by}", limit)

    def lock_all(self) -> None:
        """Keep all ranges of colours that are shown as they are, or let them go if all are kept."""
        settings, ranges = self._history.settings, self._display.limits_shown()
        locked = all(getattr(settings, name) for name in ranges)
        words = "Free all ranges" if locked else "Lock all ranges"
        self._history.change(words, -1, **{n: 0.0 if locked else v for n, v in ranges.items()})
