"""What benchmarks measured is kept, and shown on the guide's page."""

import json
import runpy
from pathlib import Path
from types import SimpleNamespace

import history
import pytest
from history import Ratio, Run


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A history of its own, of two tests in one file."""
    monkeypatch.setattr(history, "FILE", tmp_path / "history.jsonl")
    history.FILE.write_text("")
    source = '"""Ours, against theirs.\n\nMore of it."""\n'
    source += "def test_b(): ...\ndef test_a(): ...\n"
    (tmp_path / "bench_one.py").write_text(source)
    return history.FILE


def run(test: str, *values: float, note: str = "", asked: str = "at most 2") -> Run:
    ratios = [Ratio(f"{test} {place}", value, asked) for place, value in enumerate(values)]
    return Run(f"bench_one.py::{test}", notes=[note] if note else [], ratios=ratios)


def test_a_run_is_kept_with_its_commit_and_machine_after_those_before(own: Path) -> None:
    history.keep([run("test_a", 1.0, note="a sentence")])
    history.keep([run("test_a", 3.0)])

    first, second = map(json.loads, own.read_text().splitlines())
    assert first["ratios"] == [["test_a 0", 1.0, "at most 2"]]
    assert "cores" in first["machine"]
    assert first["commit"]
    assert [each.ratios for each in history.kept()] == [run("test_a", n).ratios for n in (1.0, 3.0)]
    assert second["notes"] == []


@pytest.mark.parametrize(
    ("value", "asked", "missed"),
    [
        (2.0, "at most 2", False),
        (2.1, "at most 2", True),
        (2.0, "at least 2", False),
        (1.9, "at least 2", True),
        (9.0, "", False),
    ],
)
def test_a_figure_is_missed_where_it_is_not_what_is_asked(value, asked, missed) -> None:
    assert Ratio("one", value, asked).missed is missed


def test_the_table_has_missed_figures_first_and_the_ratio_to_the_last_value() -> None:
    text = history.table([run("test_a", 1.0, 3.0)], [run("test_a", 4.0, 4.0), run("test_a", 2.0)])

    head, first, second = text.splitlines()
    assert head.split() == ["figure", "asked", "got", "of", "last"]
    assert first.split()[-3:] == ["3", "0.75", "missed"]
    assert second.split()[-2:] == ["1", "0.50"]


def test_the_page_has_the_newest_run_of_each_test_that_there_is(own: Path) -> None:
    runs = [run("test_a", 1.0, note="old"), run("test_gone", 1.0), run("test_a", 3.0, note="new")]
    text = history.page_text([*runs, run("test_b[case]", 0.5)])

    assert "Of 2 figures that are asked, 1 is missed.\n" in text
    assert text.count("| test_a 0 | at most 2 | **3** |") == 2  # among the missed, and in its place
    assert "### Ours, against theirs\n" in text
    assert "- new\n" in text
    assert "old" not in text
    assert "test_gone" not in text
    assert text.index("test_b[case] 0") < text.rindex("test_a 0")


def test_figures_are_plotted(own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "PLOT", tmp_path / "plot.png")
    history.keep([run("test_a", 1.0, 3.0, 0.0)])

    assert history.plot().stat().st_size > 1000


@pytest.mark.parametrize(("value", "failed"), [(2.0, 0), (2.1, 1)])
def test_a_session_fails_where_a_figure_is_missed(
    own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: float, failed: int
) -> None:
    monkeypatch.setattr(history, "PAGE", tmp_path / "page.md")
    history.PAGE.write_text("# Performance\n\n## What is measured\n")
    names = runpy.run_path(str(Path(__file__).with_name("benchmarks") / "conftest.py"))
    request = SimpleNamespace(node=SimpleNamespace(nodeid="tests/bench_one.py::test_a"))
    names["ratio"].__wrapped__(request)("one", value, at_most=2)
    session = SimpleNamespace(exitstatus=0, config=SimpleNamespace(stash={}))

    names["pytest_sessionfinish"](session)

    assert session.exitstatus == failed
    assert history.kept()[-1].ratios == [Ratio("one", value, "at most 2")]
    assert "| one | at most 2 |" in history.PAGE.read_text()


def test_the_guides_page_shows_the_history_that_is_kept() -> None:
    assert history.PAGE.read_text("utf-8").endswith(history.page_text(history.kept()))


def test_the_history_kept_is_readable_and_names_no_host() -> None:
    kept = history.kept()

    assert kept
    assert all(" cores, " in run.machine for run in kept)
