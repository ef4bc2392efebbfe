"""Errors: refusals of requests, and missing optional packages."""

import importlib
import sys
from typing import Any


class Refusal(ValueError):
    """A question that cannot be answered as put.

    The text says what was expected, what came and what to do; the command line prints it and
    exits with 2, the app shows it in the panel that asked.
    """


class RankDeficient(Refusal):
    """The readings do not determine the coefficients asked for."""


class SourceError(Refusal):
    """A source cannot be opened, stopped answering, or speaks something else."""


class EndedSource(Refusal):
    """A source has come to its end: a file, or standard input."""


class Damaged(Refusal):
    """A file is not whole, and a repair may save what is."""


def optional(module: str, extra: str, purpose: str) -> Any:
    """The `module` that an optional `extra` installs; a `Refusal` says so where it is missing."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise lacking(extra, purpose, error) from error


def lacking(extra: str, purpose: str, error: ImportError) -> Refusal:
    """What to say where a package of an optional `extra` is missing, which a `purpose` needs."""
    return missing(f"kappaskin[{extra}]", purpose, error)


def missing(package: str, purpose: str, error: ImportError) -> Refusal:
    """What to say where a `package` is not installed that a `purpose` needs."""
    where = ", which is not in this bundle; in your own Python" if hasattr(sys, "frozen") else ""
    what = error.name or error
    return Refusal(f"{purpose} needs {what}{where}: pip install '{package}'")
