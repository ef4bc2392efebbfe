"""Drills: faults made on purpose. A run of a file's cases writes its row of the guide's table."""

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
    config = session.config
    if config.option.keyword or any("::" in argument for argument in config.args):
        return  # a row is of all cases of a file
    files = sorted(Path(__file__).parent.glob("drill_*.py"))
    page, head, table = PAGE.read_text("utf-8").partition(_HEAD)
    rows = {row.split(" | ")[0]: f"{row}\n" for row in table.splitlines()}
    rows |= {_name(file): _row(file) for file in _outcomes}
    kept = [rows[_name(file)] for file in files if _name(file) in rows]
    PAGE.write_text(page + head + "".join(kept), "utf-8")


def _name(file: Path) -> str:
    """The first cell of the row of a file."""
    name = (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").splitlines()[0]
    return f"| {name.rstrip('.')}"


def _row(file: Path) -> str:
    outcomes = _outcomes[file]
    said = ", ".join(f"{outcomes[word]} {word}" for word in ("failed", "skipped") if outcomes[word])
    return f"{_name(file)} | {outcomes.total()} | {said or 'all passed'} |\n"
