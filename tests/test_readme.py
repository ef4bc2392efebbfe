"""README tells the truth; what it shows is run by `test_guide.py`."""

import re
from pathlib import Path

import pytest

from kappaskin.cli import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text("utf-8")


def test_the_example_of_the_library_has_twelve_lines_and_tells_what_it_prints() -> None:
    ((snippet, said),) = re.findall(r"```python\n([^`]*)```\s*```text\n(.*?)```", README, re.DOTALL)
    assert len(snippet.splitlines()) <= 12
    assert said == "at the load -0.048 mm, RMS 0.0041 mm\n"


@pytest.mark.parametrize(
    "name", sorted(set(re.findall(r"^kappaskin (\w+)", README, re.M)) | {"app", "doctor"})
)
def test_every_command_named_is_there(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    assert "Example" in capsys.readouterr().out


def test_every_measured_figure_names_what_measures_it() -> None:
    rows = re.findall(r"^\| .* \| `([^`]+)` \|$", README, re.M)
    assert len(rows) == README.split("## Measured")[1].split("And by tests")[0].count("\n| ") - 1
    for by in rows:
        measured = ROOT / "tests" / "benchmarks" / f"{by}.py"
        assert measured.is_file() or main([by.split()[1], "--help"]) == 0, by
