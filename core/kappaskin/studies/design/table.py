"""What is known of a study's points to tables, for people and as CSV."""

import csv
import io
import math
from collections.abc import Sequence
from typing import Any, cast

from kappaskin.studies.design.known import Known, Mean
from kappaskin.studies.design.measures import MEASURES, Measure
from kappaskin.studies.design.study import Study

_LONGEST = 24  # characters of a value


def value_text(value: Any) -> str:
    """A value of what is varied, short: 9 x 9 for two whole numbers."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        many = cast("list[Any]", value)
        text = (" x " if len(many) == 2 else ", ").join(value_text(one) for one in many)
        return text if len(text) <= _LONGEST else f"{len(many)} values"
    return str(value).lower() if isinstance(value, bool) else str(value)


def mean_text(mean: Mean, measure: Measure) -> str:
    """A mean and its interval in the unit of the measure, to the digits that are known."""
    if not mean.count:
        return "-"
    value, half = measure.scale * mean.mean, measure.scale * mean.half
    if math.isnan(half):
        return f"{value:.4g} ± ?"
    # What rounding has left of an interval of nothing is none.
    if half <= 1e-9 * abs(value):
        return f"{value:.4g}"
    digits = max(1 - math.floor(math.log10(half)), 0)
    return f"{value:.{digits}f} ± {half:.{digits}f}"


def heads_of(study: Study) -> list[str]:
    """What stands above the columns of `rows_of`."""
    units = [f"{MEASURES[name].title} [{MEASURES[name].unit}]" for name in study.measures]
    return [*map(study.called, study.places), *units, "frames"]


def rows_of(study: Study, known: Sequence[Known]) -> list[list[str]]:
    """A line for every point: its values, each mean with its 95 % interval, how many frames."""
    rows: list[list[str]] = []
    for one in known:
        means = [mean_text(one.mean(name), MEASURES[name]) for name in study.measures]
        frames = str((one.done - len(one.failures)) * study.base.measure.frames)
        rows.append([*map(value_text, one.point.values.values()), *means, frames])
    return rows


def remarks_on(study: Study, known: Sequence[Known]) -> list[str]:
    """What a reader of the tables must know: what failed, what is missing, what is not exact."""
    remarks: list[str] = []
    for one in known:
        values = one.point.values.items()
        told = ", ".join(f"{study.called(place)} {value_text(value)}" for place, value in values)
        at = f"at {told}" if told else "everywhere"
        if failures := one.failures:
            failed = f"{len(failures)} of {one.done} blocks failed"
            remarks.append(f"{at}: {failed}: {failures[0]}")
        elif not one.complete:
            remarks.append(f"{at}: {one.done} of {one.wanted} blocks are computed by this version")
        elif not one.enough:
            what = ", ".join(study.stop.of)
            remarks.append(
                f"{at}: {what} not known to {100 * study.stop.within:g} % after the "
                f"{study.stop.most} blocks that are allowed"
            )
    return remarks


def table_text(study: Study, known: Sequence[Known]) -> str:
    """The table and the remarks on it, as text."""
    short = [*(place.rpartition(".")[2] for place in study.places)]
    short += [f"{name} [{MEASURES[name].unit}]" for name in study.measures] + ["frames"]
    rows = [short, *rows_of(study, known)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]
    title = f"{study.title}: means with their 95 % intervals"
    return "\n".join([title, "", *lines, *([""] if remarks_on(study, known) else []),
                      *remarks_on(study, known)])  # fmt: skip


def table_csv(study: Study, known: Sequence[Known]) -> str:
    """The same as CSV, with all digits: of each measure mean, half of the interval, sd, frames."""
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    parts = ("mean", "half of 95 % interval", "sd", "frames")
    write([*study.places, *(f"{name} {part}{_unit(name, part)}" for name in study.measures
                            for part in parts), "blocks", "blocks failed"])  # fmt: skip
    for one in known:
        values = [value if isinstance(value, str | float | int) else value_text(value)
                  for value in one.point.values.values()]  # fmt: skip
        told = list[Any]()
        for name in study.measures:
            mean, scale = one.mean(name), MEASURES[name].scale
            told += [scale * mean.mean, scale * mean.half, scale * mean.sd, mean.count]
        write([*values, *told, one.done, len(one.failures)])
    return text.getvalue()


def _unit(name: str, part: str) -> str:
    return "" if part == "frames" else f" [{MEASURES[name].unit}]"
