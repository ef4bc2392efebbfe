"""What the benchmarks measured: a line for each test and run; as a table, a page and a plot."""

import ast
import json
import os
import platform
import subprocess
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from textwrap import shorten

import kappaskin_resources

FILE = Path(__file__).with_name("history.jsonl")
PAGE = Path(kappaskin_resources.__file__).parent / "guide" / "performance.md"
PLOT = Path(__file__).parents[2] / "bench-history.png"
_HEAD = "## What is measured\n"  # on the page; what follows is written by `write_page`
_COLUMNS = "| figure | asked | measured |\n|---|---|---|\n"


@dataclass(frozen=True)
class Ratio:
    """A figure of a test, and what is asked of it, as `at most 2`; nothing where that is empty."""

    figure: str
    value: float
    asked: str

    @property
    def excess(self) -> float:
        """By which factor it is worse than what is asked: 1 or less where that is reached."""
        word, bound = self.asked.rsplit(" ", 1)
        return self.value / float(bound) if word == "at most" else float(bound) / self.value

    @property
    def missed(self) -> bool:
        return bool(self.asked) and self.excess > 1

    @property
    def row(self) -> str:
        value = f"{self.value:g}"
        return f"| {self.figure} | {self.asked} | {f'**{value}**' if self.missed else value} |\n"


@dataclass
class Run:
    """What one run of a test measured: sentences and ratios."""

    test: str
    date: str = ""
    commit: str = ""
    machine: str = ""
    notes: list[str] = field(default_factory=list[str])
    ratios: list[Ratio] = field(default_factory=list[Ratio])

    @property
    def name(self) -> str:
        """The test's name without the case."""
        return self.test.partition("[")[0]


def kept() -> list[Run]:
    """All runs, the oldest first."""
    lines = map(json.loads, FILE.read_text("utf-8").splitlines())
    return [Run(**line | {"ratios": [Ratio(*each) for each in line["ratios"]]}) for line in lines]


def keep(runs: Iterable[Run]) -> None:
    """Add the runs to the file, with the moment, the commit and the machine."""
    ask = ["git", "describe", "--always", "--dirty=+", "--exclude=*"]
    commit = subprocess.run(ask, cwd=FILE.parent, capture_output=True, text=True, check=False)
    about = {
        "date": f"{datetime.now(UTC):%Y-%m-%d %H:%M}",
        "commit": commit.stdout.strip() or "unknown",
        "machine": f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}, Python "
        f"{platform.python_version()}",
    }
    with FILE.open("a", encoding="utf-8") as file:
        for run in runs:
            ratios = [list(asdict(ratio).values()) for ratio in run.ratios]
            file.write(json.dumps(asdict(run) | about | {"ratios": ratios}) + "\n")


def table(runs: Iterable[Run], before: Iterable[Run]) -> str:
    """The ratios of the runs, the missed ones first, each with that to its last value `before`."""
    last = {ratio.figure: ratio.value for run in before for ratio in run.ratios}
    rows = [("figure", "asked", "got", "of last", "")]
    ratios = (ratio for run in runs for ratio in run.ratios)
    for ratio in sorted(ratios, key=lambda ratio: not ratio.missed):
        old = last.get(ratio.figure)
        of_last = f"{ratio.value / old:.2f}" if old else ""
        missed = "missed" if ratio.missed else ""
        rows.append((ratio.figure, ratio.asked, f"{ratio.value:g}", of_last, missed))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)


def newest(runs: Iterable[Run]) -> list[Run]:
    """The newest run of each test that there still is, by file and place in it."""
    last = {run.test: run for run in runs}
    tests = [
        f"{path.name}::{node.name}"
        for path in sorted(FILE.parent.glob("bench_*.py"))
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.FunctionDef)
    ]
    places = {test: place for place, test in enumerate(tests)}
    there = (run for run in last.values() if run.name in places)
    return sorted(there, key=lambda run: places[run.name])


def page_text(runs: Iterable[Run]) -> str:
    """The part of the page that is written: what was missed, then each file's tests."""
    shown = newest(runs)
    every = [ratio for run in shown for ratio in run.ratios]
    missed = [ratio for ratio in every if ratio.missed]
    asked = sum(bool(ratio.asked) for ratio in every)
    are = "is" if len(missed) == 1 else "are"
    text = f"\nOf {asked} figures that are asked, {len(missed)} {are} missed.\n"
    if missed:
        text += "\n" + _COLUMNS + "".join(ratio.row for ratio in missed)
    for file, each in groupby(shown, lambda run: run.test.partition("::")[0]):
        of_file, source = list(each), FILE.with_name(file).read_text("utf-8")
        title = (ast.get_docstring(ast.parse(source)) or "").partition("\n")[0]
        measured = sorted({f"{run.date[:10]}, {run.machine}" for run in of_file})
        text += f"\n### {title.rstrip('.')}\n\n`{file[:-3]}`; {'; '.join(measured)}\n"
        if rows := [ratio.row for run in of_file for ratio in run.ratios]:
            text += "\n" + _COLUMNS + "".join(rows)
        notes = [note for run in of_file for note in run.notes]
        if sentences := [note.strip() for note in notes if not note.startswith("|")]:
            text += "\n" + "".join(f"- {note}\n" for note in sentences)
        text += "".join(f"\n{note}" for note in notes if note.startswith("|"))
    return text


def write_page() -> None:
    """Write the page's part anew, from all runs that are kept."""
    page, head, _ = PAGE.read_text("utf-8").partition(_HEAD)
    PAGE.write_text(page + head + page_text(kept()), "utf-8")


def plot() -> Path:
    """How each figure went, relative to what is asked of it: a picture, and where it is."""
    from matplotlib.figure import Figure  # slow to import

    by_figure: dict[str, list[float]] = {}
    for ratio in (ratio for run in kept() for ratio in run.ratios if ratio.asked):
        if ratio.value > 0:
            by_figure.setdefault(ratio.figure, []).append(ratio.excess)
    names = sorted(by_figure, key=lambda name: by_figure[name][-1])
    figure = Figure((12, 1 + 0.2 * len(names)), layout="constrained")
    axes = figure.subplots()
    for row, name in enumerate(names):
        *earlier, newest = by_figure[name]
        axes.plot(earlier, [row] * len(earlier), "|", color="grey")
        axes.plot(newest, row, "o", color="tab:red" if newest > 1 else "tab:green")
    axes.axvline(1, color="black", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), [shorten(name, 70) for name in names], fontsize=8)
    axes.set_ylim(-1, len(names))
    axes.set_xlabel(
        "times what is asked; over 1 it is missed. Dot: the newest value; bars: older ones"
    )
    axes.grid(axis="x", alpha=0.3)
    figure.savefig(PLOT, dpi=100)
    return PLOT
