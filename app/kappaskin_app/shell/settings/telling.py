"""A change of a setting to the words that name it, wherever it is undone."""

from dataclasses import fields
from typing import Any

from kappaskin_app.shell.settings.asks import Ask, Choice, Range, Switch, Text
from kappaskin_app.shell.settings.compared import Compared
from kappaskin_app.shell.settings.load import LoadSettings, Noise
from kappaskin_app.shell.settings.publishing import Sending
from kappaskin_app.shell.settings.sensor import Scanning

_ARROW = "\N{RIGHTWARDS ARROW}"
_PANELS = {
    LoadSettings: "load",
    Noise: "noise",
    Scanning: "scan",
    Sending: "publish",
    Compared: "B",
}
"""Where a label says too little without its panel."""
_LONGEST = 30  # characters of a text


def told(name: str, ask: Ask | None, before: Any, after: Any) -> str:
    """The setting `name`, asked for by `ask`, with both its values: "noise RMS 1.000 to 2.000"."""
    if ask is None:
        return "colour range" if name.startswith("range_") else name
    panel = next((w for kind, w in _PANELS.items() if name in {f.name for f in fields(kind)}), "")
    label = ask.label if ask.label.isupper() else ask.label[:1].lower() + ask.label[1:]
    words = f"{panel} {label}" if panel and panel != label else label
    if isinstance(ask, Switch):
        return f"{words} {'on' if after else 'off'}"
    if isinstance(ask, Range | Choice | Text):
        unit = f" {ask.unit}" if isinstance(ask, Range) and ask.unit else ""
        return f"{words} {_value(ask, before)} {_ARROW} {_value(ask, after)}{unit}"
    return words


def _value(ask: Range | Choice | Text, value: Any) -> str:
    """A value as its editor shows it."""
    if isinstance(ask, Range):
        return f"{value * ask.scale:.{ask.decimals}f}"
    words = dict(ask.options)[value] if isinstance(ask, Choice) else value or "nothing"
    return words if len(words) <= _LONGEST else f"{words[: _LONGEST - 1]}\N{HORIZONTAL ELLIPSIS}"
