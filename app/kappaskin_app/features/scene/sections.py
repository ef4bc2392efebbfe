"""Sections of a scene's forms: rows of values, and possible additions."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from kappaskin._schema import Key
from kappaskin.scenes import PARTS
from kappaskin_app.features.scene import scene_text
from kappaskin_app.features.scene.scene_text import Place
from kappaskin_app.shell.effects import effect_description, effect_name

MOST_WHOLE = 2**31 - 1  # largest value of a box for whole numbers
MOST = 1e12  # of any number shown in a box


def kind_of(value: Any, key: Key) -> str:
    """The kind of editor of a value that is declared by `key`.

    One of choice, text, texts, literal, switch, number, whole, numbers, wholes and pairs; or a
    count of numbers or whole ones, as in "2 number".
    """
    if isinstance(value, str):
        plain = "literal" if "\n" in value else "text"
        return "choice" if key.choices else plain
    if isinstance(value, bool):
        return "switch"
    if isinstance(value, list):
        return _kind_of_list(value, key)
    return _kind_of_number(value, key.real) if _is_number(value) else "literal"


def _is_number(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(value)


def _kind_of_number(value: float, real: bool) -> str:
    if isinstance(value, int) and not real:
        return "whole" if abs(value) <= MOST_WHOLE else "literal"
    return "number" if abs(value) <= MOST else "literal"


def _kind_of_list(value: list[Any], key: Key) -> str:
    """The kind of its numbers with their count, unless they are many or their count varies."""
    if value and all(isinstance(one, list) and all(map(_is_number, one)) for one in value):
        return "pairs"
    if value and all(isinstance(one, str) for one in value):
        return "texts"
    if not all(map(_is_number, value)):
        return "literal"
    if key.listed or len(value) not in (2, 3):
        return "numbers" if key.real else "wholes"
    each = {_kind_of_number(one, key.real) for one in value}
    return f"{len(value)} {each.pop()}" if len(each) == 1 else "numbers"


Change = Callable[[str], str]
"""A function from a text to the changed text."""


@dataclass(frozen=True)
class Row:
    """One value at a `place`, with the `kind` of its editor and its `usual` value.

    With a `part`, the value is the kind of that part.
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
            return scene_text.change_kind(text, self.place, self.part, value)
        return scene_text.put(text, self.place, value)


@dataclass(frozen=True)
class Addition:
    """A possible addition to the scene, or a menu of those `inside`."""

    words: str
    tip: str
    change: Change = str
    inside: "tuple[Addition, ...]" = ()


@dataclass(frozen=True)
class Section:
    """A titled part of a scene: rows, then sections, and possible additions.

    `offers` are further rows, `more` further parts, in the menu of a button with the text
    `adding`. A step is shown in one line.
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
        """All but the values, from which the editors are made."""
        return (
            *(self.title, self.place, self.adding),
            tuple((row.place, row.kind, row.key) for row in self.rows),
            tuple(section.structure for section in self.sections),
            tuple(offer.words for offer in (*self.offers, *self.more)),
        )

    def all_rows(self) -> tuple[Row, ...]:
        """Its own rows, then those of its sections."""
        return (*self.rows, *(row for section in self.sections for row in section.all_rows()))


_ELECTRONICS = ("bridge", "multiplexer", "amplifier", "converter")
_ORDER = ("step", "seconds", "by", "to", "times", "ease")

Values = Mapping[str, Any]


def sections_of(values: Values) -> tuple[Section, ...]:
    """The sections of a scene's TOML, in the order of the forms."""
    touches = _tables(values, "touch", ())
    found = [
        _section("Scene", "scene", "", values, ()),
        _skin(_table(values, "skin")),
        _section("Elements", "elements", "", _table(values, "elements"), ("elements",)),
        *_readings(values),
        _electronics(_table(values, "electronics")),
        *(_touch(f"Touch {n}", *touch) for n, touch in enumerate(touches, 1)),
    ]
    if "cylinders" not in values:
        found.append(_more_touches([str(touch.get("what")) for _, touch in touches]))
    found.append(_effects(_table(values, "effects")))
    if "cylinders" in values:
        table, place = _table(values, "cylinders"), ("cylinders",)
        found.append(_section("Cylinders", "cylinders", "", table, place, removable=True))
    return tuple(found)


def _section(
    title: str, part: str, kind: str, values: Values, place: Place, **more: Any
) -> Section:
    """The section of a table."""
    rows = _rows(part, kind, values, place)
    offers = (*_offers(part, kind, values, place), *more.pop("offers", ()))
    return Section(title, place, rows, offers=offers, **more)


def _skin(values: Values) -> Section:
    return _section("Skin", "skin", str(values.get("shape", "rectangle")), values, ("skin",))


def _readings(values: Values) -> list[Section]:
    """The section of the readings, with one for each quantity, if elements say what they read."""
    table, place = _table(values, "readings"), ("readings",)
    if not (table or "reads" in _table(values, "elements")):
        return []
    sections = tuple(
        _section(f"Readings of {name}", "readings", "", each, (*place, name), removable=True)
        for name, each in table.items()
        if isinstance(each, Mapping)
    )
    own = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    return [_section("Readings", "readings", "", own, place, sections=sections)]


def _electronics(values: Values) -> Section:
    sections, offers = list[Section](), list[Addition]()
    for part in _ELECTRONICS:
        place = ("electronics", part)
        section = _section(PARTS[part].label, part, "", _table(values, part), place)
        if part in values:
            sections.append(section)
        else:
            offers.append(Addition(section.title, "", inside=section.offers))
    return _section(
        *("Electronics", "electronics", "", values, ("electronics",)),
        sections=tuple(sections),
        offers=offers,
    )


def _touch(title: str, place: Place, values: Values) -> Section:
    return _section(
        *(title, "touch", str(values.get("what")), values, place),
        sections=_motion(place, values),
        removable=True,
    )


def _motion(place: Place, values: Values) -> tuple[Section, ...]:
    found = list[Section]()
    if "orbit" in values:
        orbit, at = _table(values, "orbit"), (*place, "orbit")
        found.append(_section(PARTS["orbit"].label, "orbit", "", orbit, at, removable=True))
    if "path" in values:
        at = (*place, "path")
        found.append(
            Section(
                *(PARTS["touch"].key("path").label, at),
                sections=tuple(_step(*step) for step in _tables(values, "path", place)),
                adding="Add step",
                more=_offers_of_kinds("step", lambda kind: _adding_step(at, kind)),
                removable=True,
            )
        )
    return tuple(found)


def _step(place: Place, values: Values) -> Section:
    ordered = {key: values[key] for key in sorted(values, key=_turn)}
    return _section("", "step", str(values.get("step")), ordered, place, step=True, removable=True)


def _turn(key: str) -> int:
    return _ORDER.index(key) if key in _ORDER else len(_ORDER)


def _more_touches(there: list[str]) -> Section:
    """The button that adds a touch: several loads, or one rigid object, or cylinders."""
    touch = PARTS["touch"]
    rigid = {kind for kind in touch.kinds if "depth" in touch.known(kind)}
    offers = _offers_of_kinds("touch", lambda kind: lambda text: scene_text.add_touch(text, kind))
    if rigid & set(there):
        offers = ()
    elif there:
        offers = tuple(o for o, kind in zip(offers, touch.kinds, strict=True) if kind not in rigid)
    else:
        values = {"dwell": PARTS["cylinders"].key("dwell").beginning}
        laid = Addition(
            "Cylinders",
            "Calibration cylinders, on which the skin is laid one after the other.",
            lambda text: scene_text.add_table(text, ("cylinders",), values),
        )
        offers = (*offers, laid)
    tip = (
        ""
        if offers
        else "A rigid object must be the only touch: remove it first, or change its kind."
    )
    return Section("", ("touch", "more"), adding="Add touch", more=offers, tip=tip)


def _effects(values: Values) -> Section:
    there = [name for name, table in values.items() if isinstance(table, Mapping)]
    blocks = tuple(
        _section(
            *(effect_name(name), "effects", name, values[name], ("effects", name)),
            removable=True,
            tip=effect_description(name),
        )
        for name in there
    )
    more = tuple(
        Addition(effect_name(name), effect_description(name), _adding_effect(name))
        for name in PARTS["effects"].kinds
        if name not in there
    )
    return Section("Effects", ("effects",), sections=blocks, adding="Add effect", more=more)


def _adding_effect(name: str) -> Change:
    return lambda text: scene_text.add_table(text, ("effects", name), PARTS["effects"].needed(name))


def _adding_step(place: Place, kind: str) -> Change:
    return lambda text: scene_text.add_step(text, place, kind)


def _offers_of_kinds(part: str, adding: Callable[[str], Change]) -> tuple[Addition, ...]:
    kinds = PARTS[part].kinds
    return tuple(Addition(one.label, "", adding(name)) for name, one in kinds.items())


def _table(values: Values, key: str) -> Values:
    found = values.get(key)
    return found if isinstance(found, Mapping) else {}


def _tables(values: Values, key: str, place: Place) -> list[tuple[Place, Values]]:
    """The tables of an array with their places; a table by itself is an array of one."""
    found = values.get(key)
    if isinstance(found, Mapping):
        return [((*place, key), found)]
    many = enumerate(found) if isinstance(found, list) else ()
    return [((*place, key, n), one) for n, one in many if isinstance(one, Mapping)]


def _rows(part: str, kind: str, values: Values, place: Place) -> tuple[Row, ...]:
    may, found = PARTS[part].known(kind), list[Row]()
    for name, value in values.items():
        if isinstance(value, Mapping) or name == "path" or (part == "scene" and name not in may):
            continue
        key = _key(part, kind, name)
        chooses = part if name == PARTS[part].chosen_by else ""
        found.append(Row((*place, name), kind_of(value, key), key, value, may.get(name), chooses))
    return tuple(found)


def _key(part: str, kind: str, name: str) -> Key:
    """The declaration of a key, with the description of the effect for a key of one."""
    key = PARTS[part].key(name, kind)
    return (
        replace(key, tip=f"{key.tip} {effect_description(kind)}".strip())
        if part == "effects"
        else key
    )


def _offers(part: str, kind: str, values: Values, place: Place) -> tuple[Addition, ...]:
    """The keys that can be added to a table."""
    found = list[Addition]()
    for name, value in PARTS[part].known(kind).items():
        if name in values:
            continue
        key = _key(part, kind, name)
        instead = sorted(PARTS[part].instead_of(name) & set(values))
        words = key.label + "".join(
            f" instead of {_key(part, kind, other).label.lower()}" for other in instead
        )
        found.append(Addition(words, key.explained, _putting_in(place, name, value)))
    return () if part == "effects" and "like" in values else tuple(found)


def _putting_in(place: Place, key: str, value: Any) -> Change:
    return lambda text: scene_text.put_in(text, place, key, value)
