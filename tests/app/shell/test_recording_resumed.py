"""A window that takes over a recording which the last one left."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from kappaskin import Engine, Setup, Status
from kappaskin.live import ResumeInfo
from kappaskin.live.requests import Requested
from kappaskin.recording import RecordingStatus
from kappaskin_app.shell.history import History
from kappaskin_app.shell.recovery import (
    SettingsHandover,
    resume_text,
    settings_in,
    settings_left,
    settings_text,
)
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import MainWindow

BEFORE = Settings(
    functions_x=6, functions_y=7, load_case="point", x=0.03, y=0.07, theme="dark", colour_by="xx"
)


def left(source: str | None, window_state: bytes = b"") -> ResumeInfo:
    asked = Requested(source=source, recording=Path("press.mcap"), window_state=window_state)
    return ResumeInfo(asked, ("", ""), 1, 5.0)


@pytest.fixture
def folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as place:
        yield Path(place)


@pytest.mark.full
def test_the_next_window_goes_on_as_the_last_one_was(
    opened, abandoned, folder: Path, tmp_path: Path, until, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kappaskin.live.resume._ANSWER", 30.0)  # s, or a busy one passes for stuck
    alone = abandoned(folder, tmp_path / "press.mcap", window_state=settings_text(BEFORE).encode())
    until(lambda: bool(list(folder.glob("*.note"))))
    window: MainWindow = opened("/dev/ttyABSENT7", Engine(resume_from=folder))
    until(lambda: window.display.badge.state == "SIM" and window.recorder.recording)
    status = window.session.status
    assert (status.generation, status.setup) == (alone.generation, Setup(6, 7))
    assert window.history.settings == BEFORE
    assert not window.history.stack.canUndo()
    text = window.recording.message.text()
    assert text.startswith("The recording press.mcap of the simulated skin continued for ")
    assert text.endswith(
        "You requested /dev/ttyABSENT7: Connect opens it, and the recording continues with it."
    )
    assert window.connection.source() == "/dev/ttyABSENT7"
    until(lambda: window.session.estimate.true_contact.tolist() == [0.03, 0.07])
    assert window.session.scene.loads[0].centre().tolist() == [0.03, 0.07]
    window.actions_by_name["record"].trigger()
    until(lambda: not window.recorder.recording)
    assert window.session.status.recording.trouble == ""
    window.close()
    until(lambda: alone.gone)
    assert (tmp_path / "press.mcap").exists()


@pytest.mark.parametrize("data", [b"", b"garbage", b"{}", b"\xff"])
def test_settings_that_cannot_be_read_are_those_of_the_source(data: bytes) -> None:
    assert settings_left(left("sim:line", data)).load_case == "line"
    assert settings_left(left("/dev/ttyACM0", data)) == Settings()


def test_what_is_said_names_file_and_source_and_what_was_asked_for_if_it_is_another() -> None:
    told = f"The recording press.mcap of the simulated skin {left('').lasted}."
    assert resume_text(left("sim:"), "sim:") == told
    assert "press.mcap of COM7 continued" in resume_text(left("COM7"), "COM7")
    assert resume_text(left(None), "sim:") == f"The recording press.mcap {left('').lasted}."
    assert resume_text(left("sim:"), "COM3") == (
        f"{told} You requested COM3: Connect opens it, and the recording continues with it."
    )


class Trusted:
    """Stands in for an engine, to see what it is given to store."""

    def __init__(self) -> None:
        self.data: list[bytes] = []

    def store_window_state(self, data: bytes) -> None:
        self.data.append(data)


def test_settings_are_stored_once_each_and_only_while_it_records(qapp) -> None:
    history, engine = History(Settings()), Trusted()
    handover = SettingsHandover(history, cast(Any, SimpleNamespace(engine=engine)))
    recording = Status(recording=RecordingStatus("x.mcap", active=True))
    handover.follow(Status())
    assert engine.data == []
    for status in (recording, recording, Status()):
        handover.follow(status)
    history.change("x", -1, functions_x=6)
    handover.follow(recording)
    assert [settings_in(data.decode()).functions_x for data in engine.data] == [8, 6]
