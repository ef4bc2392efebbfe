"""What benchmarks measured is kept, and told."""

import json
import runpy
from pathlib import Path

import pytest

_CONFTEST = Path(__file__).with_name("benchmarks") / "conftest.py"


@pytest.fixture
def bench(tmp_path: Path) -> dict:
    """What the benchmarks share, with a history of its own."""
    names = runpy.run_path(str(_CONFTEST))
    # A function that is run from a path keeps its own names.
    names["pytest_sessionfinish"].__globals__["HISTORY"] = tmp_path / "history.jsonl"
    return names


def lines(bench: dict) -> list[dict]:
    path = bench["pytest_sessionfinish"].__globals__["HISTORY"]
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def test_a_ratio_is_kept_with_its_commit_its_machine_and_what_is_asked(bench: dict) -> None:
    keep = bench["ratio"].__wrapped__()
    keep("ours, against theirs", 1.23456, at_most=2)
    keep("theirs, against ours", 0.81)
    bench["pytest_sessionfinish"]()

    first, second = lines(bench)
    assert (first["figure"], first["value"]) == ("ours, against theirs", 1.23)
    assert (first["asked"], second["asked"]) == ("at most 2", "")
    assert first.keys() == {"date", "commit", "machine", "figure", "value", "asked"}
    assert "cores" in first["machine"]


def test_a_history_is_extended_and_never_written_anew(bench: dict) -> None:
    for value in (1.0, 2.0):
        bench["_ratios"][:] = []
        bench["ratio"].__wrapped__()("one", value)
        bench["pytest_sessionfinish"]()

    assert [line["value"] for line in lines(bench)] == [1.0, 2.0]


@pytest.mark.parametrize("asked", [{"at_least": 2.1}, {"at_most": 1.9}])
def test_a_ratio_that_is_not_what_is_asked_fails_and_is_kept(bench: dict, asked: dict) -> None:
    with pytest.raises(AssertionError, match="one"):
        bench["ratio"].__wrapped__()("one", 2.0, **asked)
    bench["pytest_sessionfinish"]()

    assert [line["value"] for line in lines(bench)] == [2.0]


def test_where_nothing_was_measured_nothing_is_kept(bench: dict) -> None:
    bench["pytest_sessionfinish"]()

    assert not lines(bench)


def test_each_figure_is_told_with_its_newest_values_in_order(bench: dict) -> None:
    def line(figure: str, n: int) -> dict:
        return {"figure": figure, "value": float(n), "commit": f"c{n}", "asked": "at most 9"}

    text = bench["told"]([line(name, n) for n in range(10) for name in ("one", "two")])

    one, two = text.splitlines()
    assert one.startswith("one: 2.0 (c2), 3.0 (c3), ")
    assert two.endswith(", 9.0 (c9); at most 9")


def test_the_history_kept_is_readable_and_names_no_host() -> None:
    history = (_CONFTEST.parent / "history.jsonl").read_text("utf-8")
    kept = [json.loads(line) for line in history.splitlines()]

    assert kept
    assert all(" cores, " in line["machine"] for line in kept)
