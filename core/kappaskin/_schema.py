"""Schemas: the declared keys of a file, of its tables, and of the kinds of tables.

A key that becomes a field of a class has that field's kind and default, and its range and unit
where the field is annotated with them.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from numbers import Integral, Real
from typing import Any, TypeVar, cast, get_args, get_type_hints

from kappaskin._toml import REQUIRED, TomlTable

_Made = TypeVar("_Made")


@dataclass(frozen=True)
class Within:
    """Finite numbers from `least` to `most` in `unit`; only `whole` ones, `or_zero`, if it says so.

    It annotates a field: `rise: Annotated[float, Within(-200, 200, "K")]`.
    """

    least: float
    most: float = math.inf
    unit: str = ""
    whole: bool = False
    or_zero: bool = False

    def __contains__(self, value: object) -> bool:
        if isinstance(value, bool) or not isinstance(value, Integral if self.whole else Real):
            return False
        try:
            number = float(value)
        except OverflowError:
            return False
        inside = self.least <= number <= self.most or (self.or_zero and not number)
        return math.isfinite(number) and inside

    def __str__(self) -> str:
        upward = math.isinf(self.most)
        text = f"at least {self.least:g}" if upward else f"{self.least:g} to {self.most:g}"
        return f"{text} {self.unit}".rstrip() + (", a whole number" if self.whole else "")


@cache
def parameters(made: type[Any]) -> dict[str, Within]:
    """What each number that a class is made from must be within, by its name."""
    hints = get_type_hints(made, include_extras=True)
    return {
        field.name: note
        for field in fields(made)
        for note in getattr(hints[field.name], "__metadata__", ())
        if isinstance(note, Within)
    }


@dataclass(frozen=True)
class Unit:
    """A unit `name` of a file; on the screen one of `shown` is `scale` of those."""

    name: str = ""
    shown: str = ""
    scale: float = 1.0

    @property
    def suffix(self) -> str:
        """The unit behind a number on the screen."""
        return self.shown if self.shown in ("", "\N{DEGREE SIGN}") else f" {self.shown}"

    @classmethod
    def same(cls, name: str, shown: str = "") -> "Unit":
        """A unit that the screen shows as the file has it, `shown` by another sign if need be."""
        return cls(name, shown or name)


NO_UNIT = Unit()


@dataclass(frozen=True)
class Key:
    """One key of a table: `label` and `tip` on the screen, and what its value may be.

    `kind` is float, int, bool, str or a tuple of them. The reader refuses what is not within
    `limits`; `least` and `most` bound an editor further, or alone where the class that is made
    refuses the rest.
    `choices` are names in the file with their words. An editor begins with the `example`, or the
    default; what is not `offered` it cannot add. Behind a written value stands its unit, unless
    there is a `comment`.
    """

    label: str
    tip: str = ""
    unit: Unit = NO_UNIT
    least: float = -math.inf
    most: float = math.inf
    kind: Any = None
    default: Any = REQUIRED
    example: Any = field(default=None, hash=False)
    limits: Within | None = None
    choices: tuple[tuple[str, str], ...] = ()
    comment: str | None = None
    offered: bool = True

    @property
    def beginning(self) -> Any:
        """The value that an editor puts in, as TOML has it."""
        value = self.default if self.example is None else self.example
        return [*cast("tuple[Any, ...]", value)] if isinstance(value, tuple) else value

    @property
    def real(self) -> bool:
        """Whether its numbers need not be whole."""
        return float in (self.kind, *get_args(self.kind))

    @property
    def listed(self) -> bool:
        """Whether it is a list of any length."""
        return get_args(self.kind)[1:] == (...,)

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the largest number that an editor offers, in the unit of the file."""
        if self.limits is None:
            return self.least, self.most
        least = 0.0 if self.limits.or_zero else self.limits.least
        return max(self.least, least), min(self.most, self.limits.most)

    @property
    def explained(self) -> str:
        """The tip with the unit and the range, as the screen shows them."""
        least, most = self.bounds
        low, high = (f"{bound / self.unit.scale:g}" for bound in (least, most))
        if math.isfinite(least) and math.isfinite(most):
            return f"{self.tip} From {low} to {high}{self.unit.suffix}."
        if math.isfinite(least):
            return f"{self.tip} At least {low}{self.unit.suffix}."
        return f"{self.tip} In {self.unit.shown}." if self.unit.shown else self.tip

    def of_field(self, made: type, name: str) -> "Key":
        """The same key with what the field `name` of a class says and the key does not."""
        if name not in (there := fields_of(made)):
            return self
        kind, default, within = there[name]
        key = replace(
            self,
            kind=kind if self.kind is None else self.kind,
            default=default if self.default is REQUIRED else self.default,
        )
        if within is None:
            return key
        unit = Unit.same(within.unit) if self.unit == NO_UNIT else self.unit
        return replace(key, least=within.least, most=within.most, unit=unit)


@cache
def fields_of(made: type[Any]) -> dict[str, tuple[Any, Any, Within | None]]:
    """Kind, default and range of every field of a class."""
    hints, ranges = get_type_hints(made), parameters(made)
    defaults = {one.name: one.default for one in fields(made)}
    return {
        name: (hints[name], REQUIRED if default is MISSING else default, ranges.get(name))
        for name, default in defaults.items()
    }


@dataclass(frozen=True)
class PartKind:
    """One kind of a part, of this name on the screen, that becomes one of a class `made`.

    It `needs` keys, here with examples, and may have those named in `may` besides those that every
    kind may have, but for those in `never`. `keys` are those that mean something else than in other
    kinds.
    """

    label: str
    made: type[Any]
    needs: Mapping[str, Any] = field(default_factory=dict[str, Any])
    may: tuple[str, ...] = ()
    keys: Mapping[str, Key] = field(default_factory=dict[str, Key])
    never: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Part:
    """One table of a file: its keys, the classes that they are fields of, and its kinds.

    The key `chosen_by` says of which kind a table is; of the keys in one of `either` only one may
    stand there.
    """

    label: str
    keys: Mapping[str, Key]
    made: tuple[type[Any], ...] = ()
    kinds: Mapping[str, PartKind] = field(default_factory=dict[str, PartKind])
    chosen_by: str = ""
    either: tuple[tuple[str, ...], ...] = ()

    def key(self, name: str, kind: str = "") -> Key:
        """What is declared of a key in a table of this `kind`; of an unknown key, its name."""
        of = self.kinds.get(kind)
        found = self.keys.get(name) or Key(name.replace("_", " ").capitalize())
        if of is not None:
            found = of.keys.get(name, found).of_field(of.made, name)
        for made in self.made:
            found = found.of_field(made, name)
        if name == self.chosen_by:
            found = replace(found, choices=tuple((n, one.label) for n, one in self.kinds.items()))
        return found

    def needed(self, kind: str = "") -> dict[str, Any]:
        """What a table of this kind cannot do without, with examples."""
        return dict(self.kinds[kind].needs) if kind in self.kinds else {}

    def optional(self, kind: str = "") -> dict[str, Any]:
        """What a table of this kind may have besides, with examples."""
        own = {name for one in self.kinds.values() for name in (*one.needs, *one.may)}
        common = [name for name in self.keys if name not in own]
        more = self.kinds[kind].may if kind in self.kinds else ()
        never = self.kinds[kind].never if kind in self.kinds else ()
        keys = {name: self.key(name, kind) for name in (*common, *more) if name not in never}
        return {name: key.beginning for name, key in keys.items() if key.offered}

    def known(self, kind: str = "") -> dict[str, Any]:
        """All that a table of this kind may say, with examples."""
        return self.needed(kind) | self.optional(kind)

    def instead_of(self, name: str) -> set[str]:
        """The keys that cannot stand beside the one of this name."""
        return {other for group in self.either if name in group for other in group} - {name}

    def missing(self, kind: str, there: Collection[str]) -> dict[str, Any]:
        """What a table of this kind needs and lacks, nothing else being `there` in its stead."""
        return {
            name: example
            for name, example in self.needed(kind).items()
            if name not in there and not self.instead_of(name) & set(there)
        }

    @property
    def limits(self) -> dict[str, Within]:
        """What its numbers must be within, by key."""
        return {name: key.limits for name, key in self.keys.items() if key.limits is not None}

    def comments(self, kind: str = "") -> dict[str, str]:
        """What stands behind a value that is written, by key."""
        own = self.kinds[kind].keys if kind else ()
        keys = {name: self.key(name, kind) for name in (*self.keys, *own)}
        return {
            name: key.unit.name if key.comment is None else key.comment
            for name, key in keys.items()
        }

    def value(self, table: TomlTable, name: str, default: Any = REQUIRED) -> Any:
        """The value of a key in `table`, or its default, unless another `default` is given."""
        key = self.key(name)
        usual = key.default if default is REQUIRED else default
        if key.choices and name in table:  # no default need be among them
            return table.choose(name, {choice: choice for choice, _ in key.choices})
        return table.get(name, key.kind, usual, key.limits)

    def make(
        self, table: TomlTable, made: type[_Made], complete: bool = False, **given: Any
    ) -> _Made:
        """What `table` says as an instance of a class, of which some fields are `given`.

        A `complete` table leaves out no field.
        """
        for name in fields_of(made).keys() & self.keys.keys():
            if name in table and name not in given and self.key(name).choices:
                given[name] = self.value(table, name)
        return table.make(made, self.limits, complete, **given)
