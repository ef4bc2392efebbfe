"""Recordings that declare far more than they hold are refused before that is taken."""

import runpy
from collections.abc import Callable
from pathlib import Path

import pytest

from kappaskin import Recording, Refusal
from kappaskin._files import LIMIT
from kappaskin.cli import main
from kappaskin.recording import Repaired, Verification

HOSTILE = runpy.run_path(str(Path(__file__).parents[2] / "hostile_files.py"))
READ, REPAIRED, COMPUTED = (HOSTILE[name] for name in ("READ", "REPAIRED", "COMPUTED"))
REFUSED = "to take at most 256 MB, but .* would take .*; `--limit`"

pytestmark = pytest.mark.slow


def _file(folder: Path, make: Callable[[], bytes]) -> Path:
    file = folder / "hostile.mcap"
    file.write_bytes(make())
    return file


def _read_all(file: Path) -> None:
    with Recording(file) as recording:
        for _ in recording.messages():
            pass


@pytest.mark.cases("many-messages", "one-chunk-often", "one-metadata-often")
@pytest.mark.parametrize("kind", READ)
def test_it_is_not_read(kind: str, tmp_path: Path) -> None:
    with pytest.raises(Refusal, match=REFUSED):
        _read_all(_file(tmp_path, READ[kind]))


@pytest.mark.cases("nested-chunks")
@pytest.mark.parametrize("kind", REPAIRED)
def test_it_is_not_repaired(kind: str, tmp_path: Path) -> None:
    file = _file(tmp_path, REPAIRED[kind])
    with pytest.raises(Refusal, match=REFUSED):
        list(Repaired.steps(file, tmp_path / "out.mcap"))
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("kind", COMPUTED)
def test_its_settings_are_not_used(kind: str, tmp_path: Path) -> None:
    with pytest.raises(Refusal, match=r"to take at most .* would take .*; "):
        list(Verification.steps(_file(tmp_path, COMPUTED[kind])))


def test_a_limit_allows_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setenv(LIMIT, "")
    file = str(_file(tmp_path, READ["long-names"]))
    assert main(["info", file]) == 2
    assert "`--limit`" in capsys.readouterr().err
    assert main(["info", file, "--limit", "20GB"]) == 0
    assert main(["info", file, "--limit", "much"]) == 2
    assert "expected a limit such as 500MB or 2GB, got 'much'" in capsys.readouterr().err


def test_reading_a_recording_again_and_again_takes_no_more(tmp_path: Path, monkeypatch) -> None:
    file = _file(tmp_path, HOSTILE["_set_up"])
    with Recording(file) as recording:
        list(recording.messages())
        taken = recording.budget.taken
        for _ in range(50):
            next(recording.messages())
            list(recording.setups())
        assert recording.budget.taken == taken
