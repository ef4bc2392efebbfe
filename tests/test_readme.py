"""README tells the truth; what it shows is run by `test_guide.py`."""

import re
from pathlib import Path

import pytest

from kappaskin.cli import main

ROOT = Path(__file__).parents[1]
MOVING = ROOT / "resources/kappaskin_resources/guide/pictures/window.webp"
README = (ROOT / "README.md").read_text("utf-8")


def test_a_minute_is_enough_for_it() -> None:
    assert len(README.splitlines()) <= 130
    assert MOVING.stat().st_size < 1e6
    (snippet, *_) = re.findall(r"```python\n([^`]*)```", README)
    assert len(snippet.splitlines()) <= 5


@pytest.mark.parametrize(
    "name", sorted(set(re.findall(r"^kappaskin (\w+)", README, re.M)) | {"app", "doctor"})
)
def test_every_command_named_is_there(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    assert "Example" in capsys.readouterr().out


def test_every_measured_figure_names_what_measures_it() -> None:
    rows = re.findall(r"^\| .* \| `([^`]+)` \|$", README, re.M)
    assert len(rows) == README.split("## Measured")[1].split("\n## ")[0].count("\n| ") - 1
    for by in rows:
        measured = ROOT / "tests" / "benchmarks" / f"{by}.py"
        assert measured.is_file() or main([by.split()[1], "--help"]) == 0, by
