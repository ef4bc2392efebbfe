"""Exceptions in slots: logged and reported instead of passed to Qt."""

import functools
import logging
from collections.abc import Callable
from typing import Any

from kappaskin._text import printable

log = logging.getLogger("kappaskin")

# Not its docstring, which Qt would have to make for each of its own methods.
_NAMES = ("__module__", "__name__", "__qualname__")

_listeners: list[Callable[[str], None]] = []


class PrintableFormatter(logging.Formatter):
    """Lines of a log, with escapes for what cannot be seen in a message."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record), keep="\n")


def on_failure(listener: Callable[[str], None]) -> None:
    """Call `listener` with a text for every exception caught from now on."""
    _listeners.append(listener)


def forget(listener: Callable[[str], None]) -> None:
    if listener in _listeners:
        _listeners.remove(listener)


def failed(error: Exception, where: object) -> None:
    """Log an exception, and report it."""
    log.error("in %s", where, exc_info=error)
    for listener in list(_listeners):
        listener(f"Error in the program: {error or type(error).__name__}")


def guarded(slot: Callable[..., Any]) -> Callable[..., Any]:
    """`slot`, whose exceptions are logged and reported."""

    @functools.wraps(slot, assigned=_NAMES)
    def safe(*arguments: Any) -> Any:
        try:
            return slot(*arguments)
        except Exception as error:  # a slot has no caller that could handle it
            failed(error, getattr(slot, "__qualname__", slot))
            return None

    return safe
