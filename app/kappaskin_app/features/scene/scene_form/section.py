"""Sections of a scene form: rows of values, parts of their own, and what may be added."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from kappaskin.scenes import Key
from kappaskin_app.features.scene.scene_text import changes
from kappaskin_app.features.scene.scene_text.changes import Place

Change = Callable[[str], str]
"""A text to a text."""


@dataclass(frozen=True)
class Row:
    """One value at a `place`; `kind` says by what it is edited, `usual` how large it often is.

    The value of one of a `part` says of which kind that part is.
    """

    place: Place
    kind: str
    key: Key
    value: Any
    usual: Any = None
    part: str = ""

    def changed(self, text: str, value: Any) -> str:
        """The text with another value here."""
        if self.part:
            return changes.change_kind(text, self.place, self.part, value)
        return changes.put(text, self.place, value)


@dataclass(frozen=True)
class Addition:
    """Something that may be put in, in words; or others `inside`."""

    words: str
    tip: str
    change: Change = str
    inside: "tuple[Addition, ...]" = ()


@dataclass(frozen=True)
class Section:
    """A titled part of a scene: rows, then parts of its own, and what may be added or removed.

    `offers` are further rows, `more` further parts, which a button called `adding` offers. A step
    is shown in one line.
    """

    title: str
    place: Place
    rows: tuple[Row, ...] = ()
    sections: "tuple[Section, ...]" = ()
    offers: tuple[Addition, ...] = ()
    adding: str = ""
    more: tuple[Addition, ...] = ()
    removable: bool = False
    step: bool = False
    tip: str = ""

    @property
    def structure(self) -> tuple[Any, ...]:
        """All but the values: what its editors are made from."""
        return (
            *(self.title, self.place, self.adding),
            tuple((row.place, row.kind, row.key) for row in self.rows),
            tuple(section.structure for section in self.sections),
            tuple(offer.words for offer in (*self.offers, *self.more)),
        )

    def all_rows(self) -> tuple[Row, ...]:
        """Its own rows, then those of its parts."""
        return (*self.rows, *(row for section in self.sections for row in section.all_rows()))
