"""Packages whose names are imported when they are first used."""

import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, *modules: tuple[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of `package`.

    Each of the `modules` comes with its names, separated by spaces. A name that was asked for once
    is found without this from then on.
    """
    module_of = {name: module for module, names in modules for name in names.split()}

    def find(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        found = getattr(import_module(f"{package}.{module_of[name]}"), name)
        setattr(sys.modules[package], name, found)
        return found

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *module_of})

    return find, names, list(module_of)


class Displayed:
    """A value that a notebook shows as a table, with a picture where Matplotlib is installed."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return import_module("kappaskin.studies.notebook").html_of(self)

    def plot(self) -> Any:
        """Draw it as a new figure of pyplot: the `matplotlib.axes.Axes`.

        Raises a `Refusal` without Matplotlib, and where there is nothing to draw.
        """
        return import_module("kappaskin.studies.notebook").plotted(self)
