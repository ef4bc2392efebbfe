"""The history of the settings: every change but of the lasting ones is an undoable command."""

import time
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import partial
from typing import Any, TypeVar

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from kappaskin_app.shell.settings import SHARED, LastingSettings, Settings, change_text

_IN_A_ROW = 1.0  # s from one change of a setting to the next
_MOST = 500  # steps that can be undone: a scene's text may be a megabyte
_LASTING = {field.name for field in fields(LastingSettings)}
_Some = TypeVar("_Some")
_Pair = tuple[Settings, Mapping[str, Settings]]
Description = Callable[[_Some, _Some], str]


class _Step(QUndoCommand):
    """A change from one value to another by `apply`; those of one gesture merge."""

    def __init__(
        self,
        apply: Callable[[Any], object],
        before: Any,
        after: Any,
        describe: Description[Any],
        gesture: int,
    ) -> None:
        super().__init__()
        self._apply, self._describe, self._gesture = apply, describe, gesture
        self.before, self.after = before, after
        self._name()

    def _name(self) -> None:
        text = self._describe(self.before, self.after)
        self.setText(text[:1].lower() + text[1:])

    def id(self) -> int:
        return self._gesture

    def mergeWith(self, other: QUndoCommand) -> bool:
        if not isinstance(other, _Step):
            return False
        self.after = other.after
        self.setObsolete(self.after == self.before)
        self._name()
        return True

    def redo(self) -> None:
        self._apply(self.after)

    def undo(self) -> None:
        self._apply(self.before)


def _description_of_pair(
    describe: Description[Settings], more: str, before: _Pair, after: _Pair
) -> str:
    return describe(before[0], after[0]) + more


class History(QObject):
    """Holds the `settings`; `changed` reports new ones.

    What is undone or redone leaves the look of the window and the operator's settings as they are.
    Of a hand it has the settings of the `others`, the fingers that are not shown; `others_changed`
    reports new ones. While `of_all`, what is requested is of all fingers.
    """

    changed = Signal(Settings)
    others_changed = Signal(object)

    def __init__(self, settings: Settings, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.settings = settings
        self.others: Mapping[str, Settings] = {}
        self.of_all = False
        self.stack = QUndoStack(self)
        self.stack.setUndoLimit(_MOST)
        self._gesture = 0
        self._requested, self._requested_at, self._request_gesture = "", 0.0, -1

    def request(self, name: str, **values: Any) -> None:
        """Change the setting `name`, and others with it.

        Changes of the same one in a row are one step to undo.
        """
        now = time.monotonic()
        if name != self._requested or now - self._requested_at > _IN_A_ROW:
            self._request_gesture = self.new_gesture()
        self._change(partial(change_text, name), self._request_gesture, values, self.of_all)
        self._requested, self._requested_at = name, now

    def reset(self, text: str, **values: Any) -> None:
        """Set settings by name, as one command called `text`."""
        self._change(lambda *_: text, -1, values, self.of_all)

    def set_of_all(self, of_all: bool) -> None:
        """Let requests be of all fingers, or of the one that is shown."""
        self.of_all, self._requested = of_all, ""

    def show(self, finger: str, instead_of: str) -> None:
        """Make the settings of another finger the present ones; forget what could be undone."""
        others = {**self.others, instead_of: self.settings}
        settings = others.pop(finger)
        self.others = others
        self.apply(settings)
        self.stack.clear()

    def new_gesture(self) -> int:
        """A number under which changes merge into one command, as those of a drag."""
        self._gesture += 1
        return self._gesture

    def change(self, text: str, gesture: int = -1, /, **values: Any) -> None:
        """Change settings by name, as one command called `text`; equal values make none."""
        self._change(lambda *_: text, gesture, values)

    def _change(
        self,
        describe: Description[Settings],
        gesture: int,
        values: dict[str, Any],
        of_all: bool = False,
    ) -> None:
        lasting = {name: values.pop(name) for name in _LASTING & values.keys()}
        if (changed := replace(self.settings, **lasting)) != self.settings:
            self._take(changed)
        before, others = (self.settings, self.others), self.others
        if of_all:
            shared = {name: value for name, value in values.items() if name in SHARED}
            others = {name: replace(each, **shared) for name, each in others.items()}
        after = replace(self.settings, **values), others
        if after != before:
            more = ", all fingers" if others != self.others else ""
            words = partial(_description_of_pair, describe, more)
            self.stack.push(_Step(self._apply_all, before, after, words, gesture))

    def step(
        self, text: str, apply: Callable[[_Some], object], before: _Some, after: _Some
    ) -> None:
        """Apply a change of settings with more that belongs to it, as one command called `text`."""
        self.stack.push(_Step(apply, before, after, lambda *_: text, -1))

    def cancel(self, gesture: int) -> None:
        """Undo what was changed under `gesture`, without a redo."""
        top = self.stack.command(self.stack.index() - 1)
        if gesture > 0 and isinstance(top, _Step) and top.id() == gesture:
            before = top.before
            top.setObsolete(True)
            self.stack.undo()  # which only removes an obsolete command
            self._apply_all(before)

    def _apply_all(self, settings: _Pair) -> None:
        self.apply(settings[0])
        if (before := self.others) is not settings[1]:
            self.others = settings[1]
            self.others_changed.emit(before)

    def apply(self, settings: Settings) -> None:
        """For commands only: make `settings` the present ones, except for the lasting ones."""
        self._take(replace(settings, **{name: getattr(self.settings, name) for name in _LASTING}))

    def _take(self, settings: Settings) -> None:
        self._requested = ""  # an undo or redo ends a row of requests
        self.settings = settings
        self.changed.emit(settings)
