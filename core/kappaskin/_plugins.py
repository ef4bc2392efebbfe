"""Plug-ins: what other packages add by entry points in groups of ours."""

import sys
from collections.abc import Callable, Container
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from typing import Any

SOURCES, EFFECTS, ESTIMATORS, FEATURES = GROUPS = (
    "kappaskin.sources",
    "kappaskin.effects",
    "kappaskin.estimators",
    "kappaskin.features",
)
"""Groups of entry points."""


@dataclass(frozen=True)
class PlugIn:
    """What a `package` of this `version` adds to a `group` by `name`, in a `file`.

    It is not used where there is `trouble` with it.
    """

    group: str
    name: str
    package: str
    version: str
    file: str
    trouble: str = ""

    @property
    def text(self) -> str:
        """What it is and where from, with its trouble."""
        kind = self.group.rpartition(".")[2].removesuffix("s")
        trouble = f", left out: {self.trouble}" if self.trouble else ""
        return (
            f"{kind} {self.name} of {self.package} {self.version or '(unknown version)'}{trouble}"
        )


_found: dict[tuple[str, str, str], PlugIn] = {}


def error_text(error: BaseException) -> str:
    """The type and text of an error of a plug-in; a `KeyboardInterrupt` is raised again."""
    if isinstance(error, KeyboardInterrupt):
        raise error
    try:
        return f"{type(error).__name__}: {error}"
    except Exception:  # its text is the plug-in's, too
        return type(error).__name__


def _metadata_of(point: metadata.EntryPoint) -> dict[str, Any]:
    """The metadata of the package of an entry point; empty where it has none.

    The package importlib_metadata, once it is imported, raises for missing metadata.
    """
    with suppress(FileNotFoundError):
        return point.dist.metadata.json if point.dist else {}
    return {}


def plug_ins(
    group: str, check: Callable[[str, Any], None], ours: Container[str] = ()
) -> dict[str, Any]:
    """What plug-ins add to a `group`, by name, loaded.

    One that cannot be loaded, that the `check` of name and object raises for, or whose name is one
    of `ours` or taken is left out; `found_plug_ins` tells why.
    """
    loaded: dict[str, Any] = {}
    for point in metadata.entry_points(group=group):
        package, version, trouble = "an unknown package", "", ""
        try:
            known = _metadata_of(point)
            package, version = known.get("name") or package, known.get("version") or ""
            if point.name in ours or point.name in loaded:
                raise ValueError("the name is taken")
            if not point.pattern.match(point.value):
                raise ValueError(f"expected MODULE:OBJECT, got {point.value!r:.60}")
            check(point.name, made := point.load())
            loaded[point.name] = made
        except BaseException as error:  # a plug-in may raise anything
            trouble = error_text(error)
        module = sys.modules.get(point.value.partition(":")[0].strip())
        file = getattr(module, "__file__", None) or ""
        _found[group, point.name, package] = PlugIn(
            group, point.name, package, version, file, trouble
        )
    return loaded


def check_feature(name: str, made: Any) -> None:
    """Raise a `TypeError` for what is no feature of the app of this `name`."""
    if not callable(getattr(made, "install", None)) or getattr(made, "name", "") != name:
        raise TypeError(f"expected a class with the name {name!r} and install, got {made!r:.60}")


def found_plug_ins() -> list[PlugIn]:
    """Every plug-in that was looked for so far in this process."""
    return list(_found.values())


def left_out(group: str, name: str) -> str:
    """Which plug-in `name` fails, or why it is not there, for the end of a refusal."""
    here = (one for one in _found.values() if (one.group, one.name) == (group, name))
    found = next(here, None)
    return f"; plug-in {found.text}" if found else "; a plug-in may be missing"
