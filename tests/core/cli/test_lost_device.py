"""Commands whose device is unplugged while they run: none says that it is done."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest

from kappaskin import load_scene
from kappaskin.cli import main
from kappaskin.cli.common import ProgressLine
from kappaskin.recording import Recording

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from kappaskin.sources import PseudoDevice

pytestmark = pytest.mark.slow


@pytest.fixture
def port(tmp_path_factory) -> Iterator[str]:
    """A device at rest that is unplugged soon after its first readings, unless it has a second.

    A link of its own: the number of a terminal that is gone is soon that of another.
    """
    link = tmp_path_factory.mktemp("device") / "port"
    device = PseudoDevice(replace(load_scene("centre"), stimuli=(), rate=100.0))
    over, begun = threading.Event(), list[float]()

    link.symlink_to(device.port)

    def serve() -> None:
        device.serve(lambda: over.is_set() or unplugged())
        link.unlink()
        device.close()

    def unplugged() -> bool:
        if device.spent - device.unsent > 30:
            begun.append(time.monotonic())
        return bool(begun) and time.monotonic() - begun[0] > 0.3

    thread = threading.Thread(target=serve)
    thread.start()
    yield str(link)
    over.set()
    thread.join()


def test_a_recording_shows_at_once_that_its_device_is_gone(port, tmp_path, monkeypatch) -> None:
    lines = list[str]()
    monkeypatch.setattr(ProgressLine, "__call__", lambda _, line: lines.append(line))
    assert main(["record", port, str(tmp_path / "x.mcap"), "--seconds", "3"]) == 1
    assert "not connected" not in lines[0]
    assert lines[-1].endswith("0 lost  not connected, retrying")


@pytest.mark.cases("record", "tare")
@pytest.mark.parametrize(
    ("command", "code", "why"),
    [
        ("record {port} {folder}/x.mcap --seconds 3", 1, "there is no such port"),
        ("publish {port} --udp 127.0.0.1:9 --seconds 3", 1, "there is no such port"),
        ("tare {port}", 2, "connection lost"),
        ("calibrate {port} --out {folder}/x.toml --dwell 9", 2, "connection lost"),
        ("press {port} --quick", 2, "connection lost"),
    ],
)
def test_a_command_whose_device_goes_says_so_and_is_no_success(
    port: str, command: str, code: int, why: str, tmp_path, capsys
) -> None:
    assert main(command.format(port=port, folder=tmp_path).split()) == code
    *_, said = capsys.readouterr().err.splitlines()
    assert said.startswith(f"kappaskin: {port}: ")
    assert why in said
    if command.startswith("record"):
        with Recording(tmp_path / "x.mcap") as recording:
            assert recording.whole
    else:
        assert not list(tmp_path.iterdir())
