"""Tooltips of actions: what they do, and the shortcuts of now."""

import re
from collections.abc import Mapping

from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QWidget

from kappaskin_app.shell.colouring import SHADES
from kappaskin_app.shell.settings import Settings, ask_of
from kappaskin_app.shell.settings.shown import COLOURS

_TIPS: Mapping[str, str] = {
    "open-scene": "Simulate what a scene file (.toml) says; it may also be dropped on the window",
    "save-scene": "Write the scene that plays, as text that can be edited and opened again",
    "picture": "Save the whole window as a PNG in the folder the program was started in",
    "quit": "End the program; a recording that goes on is asked about first",
    "undo": "Take back the last change of a setting, scene or layout; what comes in goes on",
    "redo": "Make the change again that was taken back last",
    "reset": "Every setting as at first, but for calibration, tare and what is published",
    "simulate": "Read the skin that the panels describe, in place of a sensor or a recording",
    "connect": "Take readings from the source that is named under Connection",
    "disconnect": "Take no more readings; the last ones stay, marked as old",
    "tare": "Let what every element reads now be its zero: \u03ba = reading \u2212 zero",
    "ports": "Look again which serial ports there are; they come and go by themselves too",
    "event_log": "When a device came, went, lost messages or began anew, newest first",
    "replay-forward": "Pause, and show the next frame of the recording",
    "replay-back": "Pause, and show the frame before in the recording",
    "replay-next": "Go to the next note, gap or change of settings in the recording",
    "replay-previous": "Go to the note, gap or change of settings before in the recording",
    "replay-faster": "Play the recording at the next higher speed",
    "replay-slower": "Play the recording at the next lower speed",
    "replay-loop": "Play the recording again and again, or once",
    "replay-settings": "Fit with the settings that were in use when this frame was recorded",
    "lock-ranges": "Keep what every colour means as it is now, or let it follow what is shown",
    "higher": "Draw the displacement one more time larger; the colours stay as they are",
    "lower": "Draw the displacement one time less large; the colours stay as they are",
    "camera": "Look at the whole skin from where it is seen at first",
    "look-from-above": "The skin as a map: x to the right, y upward",
    "look-along-y": "The skin from its front edge: x to the right, displacement up and down",
    "look-along-x": "The skin from its side: y to the right, displacement up and down",
    "look-from-below": "The skin from the side that is not touched",
    "look-from-a-corner,-all-sides-alike": "Lengths along x, y and the displacement drawn alike",
    "calibrate": "The page that guides through cylinders of known radius R, where \u03ba = 1 / R",
    "take-step": "Take the mean of what comes in now for the cylinder that is asked for",
    "pause": "Let a scene or a recording stand; what a sensor sends goes on",
    "theme": "Dark letters on a light ground, or light ones on a dark ground",
    "next-panels": "Turn to the next page of Settings: Live, Skin, Sensor, Calibrate",
    "last-panels": "Turn to the page of Settings before",
    "export": "Write readings, estimates or surfaces of a recording as files for other programs",
    "film": "Write what the skin looks like to an MP4 from now on, until this is chosen again",
    "initial-curvature": "Section 6.2 of the paper from a run of our own, in a window beside",
}
_FIGURE = "This figure of the paper from a run of our own, in a window beside; to be saved there"
_PICTURE = "Write {what} as it is shown now, with time and settings below it; it must be visible"


def tip_of(name: str, text: str) -> str:
    """What the action called `name`, of this `text`, does; its text where nobody says more."""
    if name in _TIPS:
        return _TIPS[name]
    if f"show_{name}" in Settings.__dataclass_fields__:
        return ask_of(f"show_{name}").tip
    if (colour := name.removeprefix("colour-")) in dict(COLOURS):
        return SHADES[colour].tip
    if name.startswith("fig"):
        return _FIGURE
    what = name.removeprefix("picture-of-")
    return text if what == name else _PICTURE.format(what=what)


_OWN, _SHOWN = "own-tip", "shown-tip"  # properties of a widget: its tooltip, and as it was retold
_NONE = "no shortcut"


class KeyTips(QObject):
    """Has the tooltips of a `window` name its keys as they are now."""

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._keys: Mapping[str, str] = {}

    def retell(self, keys: Mapping[str, str]) -> None:
        """Name each of the `keys` as it is now, in what tooltips say next too."""
        if not keys and not self._keys:
            return  # of a window whose keys are its own no event is looked at
        self._keys = keys
        for widget in self._window.findChildren(QWidget):
            if widget.toolTip():
                self._retell(widget)
                widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTipChange and isinstance(watched, QWidget):
            self._retell(watched)
        return False

    def _retell(self, widget: QWidget) -> None:
        tip = widget.toolTip()
        own = widget.property(_OWN) if tip == widget.property(_SHOWN) else tip
        told = in_words(str(own), self._keys)
        if told != tip:
            widget.setProperty(_OWN, own)
            widget.setProperty(_SHOWN, told)
            widget.setToolTip(told)


def in_words(text: str, keys: Mapping[str, str]) -> str:
    """A text with each of the `keys` that it names as it is now."""
    named = sorted(filter(None, keys), key=len, reverse=True)
    if not named:
        return text
    any_of = "|".join(map(re.escape, named))
    return re.sub(rf"(?<![\w+])({any_of})(?!\w)", lambda found: keys[found[1]] or _NONE, text)
