"""README tells the truth."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from kappaskin.cli import main

README = (Path(__file__).parents[1] / "README.md").read_text()


def test_the_snippet_reproduces_the_centred_case_in_twelve_lines(tmp_path: Path) -> None:
    (snippet,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    script = tmp_path / "snippet.py"
    script.write_text(snippet)
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=60
    )
    assert len(snippet.splitlines()) <= 12
    assert done.stdout == "at the load -0.048 mm, RMS 0.0041 mm\n"
    assert f"`{done.stdout.strip()}`" in README


@pytest.mark.parametrize(
    "name", sorted(set(re.findall(r"`kappaskin (\w+)", README)) | {"app", "doctor"})
)
def test_every_command_named_is_there(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    assert "Example" in capsys.readouterr().out


def test_every_file_named_is_there() -> None:
    for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README):
        assert (Path(__file__).parents[1] / name).is_file()
