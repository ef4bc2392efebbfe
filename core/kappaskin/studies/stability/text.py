"""The rows of `stability` as text for people."""

import textwrap
from collections import Counter
from itertools import groupby
from typing import Any

_KEY = (
    "condition of M: columns scaled, and as Eq. 6 has it; lost: decimal digits; error and 95 % "
    "bar: RMS in mm; -: none"
)
_WIDTH = 116


def _of(value: float | None, width: int, form: str) -> str:
    return format("-" if value is None else format(value, form), f">{width}")


def _why(row: dict[str, Any]) -> str:
    """The cause that a refusal names, without what it counts; anything else whole."""
    reason = row["reason"]
    if row["verdict"] == "refused":
        reason = reason.partition("basis: ")[2] or reason
    return textwrap.shorten(reason, 52, placeholder=" ...")


def _line(row: dict[str, Any]) -> str:
    return (
        f"    {row['method']:<14}{row['precision']:<8}{_of(row['condition_scaled'], 8, '.2g')}"
        f"{_of(row['condition_unscaled'], 9, '.2g')}{_of(row['digits_lost'], 6, '.1f')}"
        f"{_of(row['error_mm'], 9, '.2g')}{_of(row['bar_mm'], 9, '.2g')}  {row['verdict']:<9}"
        f"{_why(row)}"
    )


def stability_text(rows: list[dict[str, Any]]) -> str:
    """Each case with what is hard about it and what every method made of it."""
    lines = [
        _KEY,
        f"    {'method':<14}{'in':<8}{'scaled':>8}{'as is':>9}{'lost':>6}{'error':>9}{'bar':>9}"
        "  verdict  why",
    ]
    for name, group in groupby(rows, lambda row: row["case"]):
        own = list(group)
        functions, elements = own[0]["functions"], own[0]["elements"]
        head = f"{name} ({functions} functions, {elements} elements): {own[0]['hard']}"
        lines += [*textwrap.wrap(head, _WIDTH, subsequent_indent="  "), *map(_line, own)]
    counts = Counter((row["method"], row["verdict"]) for row in rows)
    lines += [""] + [
        f"{method:<14}"
        + ", ".join(f"{n} {found}" for (one, found), n in counts.items() if one == method)
        for method in dict.fromkeys(row["method"] for row in rows)
    ]
    return "\n".join(lines)
