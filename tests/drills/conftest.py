"""Drills: faults made on purpose. A run of all of them writes the table of the guide."""

import ast
from collections import Counter
from pathlib import Path

import pytest

import kappaskin_resources

PAGE = Path(kappaskin_resources.__file__).parent / "guide" / "validation.md"
_HEAD = "| drill | cases | result |\n|---|---|---|\n"

_outcomes: dict[Path, Counter[str]] = {}


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    outcome = "failed" if report.when != "call" and report.failed else report.outcome
    if report.when == "call" or outcome != "passed":
        file = Path(report.location[0])
        _outcomes.setdefault(Path(__file__).with_name(file.name), Counter())[outcome] += 1


def pytest_sessionfinish(session: pytest.Session) -> None:
    files = sorted(Path(__file__).parent.glob("drill_*.py"))
    if session.config.option.keyword or set(files) - set(_outcomes):
        return  # the table is of a whole run
    page, _, _ = PAGE.read_text("utf-8").partition(_HEAD)
    PAGE.write_text(page + _HEAD + "".join(map(_row, files)), "utf-8")


def _row(file: Path) -> str:
    name = (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").splitlines()[0]
    outcomes = _outcomes[file]
    said = ", ".join(f"{outcomes[word]} {word}" for word in ("failed", "skipped") if outcomes[word])
    return f"| {name.rstrip('.')} | {outcomes.total()} | {said or 'all passed'} |\n"
