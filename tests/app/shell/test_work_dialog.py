"""Work beside a dialog, which ends however it goes."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from kappaskin import Refusal
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.work_dialog import WorkDialog, with_ending, with_suffix


class Failing:
    """Work that fails whenever it is looked at."""

    def __init__(self, why: Exception) -> None:
        self.why, self.looks, self.closed, self.done = why, 0, False, False

    def poll(self) -> Sequence[object]:
        self.looks += 1
        raise self.why

    def close(self) -> None:
        self.closed = True


@pytest.mark.fails_inside
@pytest.mark.parametrize("why", [Refusal("the disk is full"), OSError("the disk is full")])
def test_work_that_fails_is_ended_once_and_told(qapp, qtbot, until, why: Exception) -> None:
    work = Failing(why)
    dialog = WorkDialog(Tasks(qapp), "Work", "Begin", "Working", lambda: work, str)
    qtbot.addWidget(dialog)
    dialog.begin_button.click()
    until(lambda: not dialog.busy)
    qtbot.wait(250)  # two more looks
    assert (work.looks, work.closed, dialog.words.text()) == (1, True, "the disk is full")


def test_only_a_file_chosen_by_its_whole_name_is_written_over(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    assert with_ending(str(tmp_path / "mine"), ".toml") == file
    file.touch()
    assert with_ending(str(file), ".toml") == file
    with pytest.raises(Refusal, match=r"mine\.toml exists already"):
        with_ending(str(tmp_path / "mine"), ".toml")


@pytest.mark.parametrize("name", ["mine", "mine.v2", "force 0.5 N"])
def test_a_name_that_has_a_point_in_it_is_kept_whole(name: str) -> None:
    assert with_ending(name, ".toml") == Path(f"{name}.toml")
    assert with_suffix(name, ".mcap") == Path(f"{name}.mcap")
