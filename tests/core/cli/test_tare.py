"""Taking a tare from a source: told, kept for the device, refused with its reason."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from kappaskin import PointLoad, Recording, Scene, load_scene
from kappaskin.calibration import TareStore
from kappaskin.cli import main

pytest.importorskip("pty", reason="no pseudo-terminals on this system")
from kappaskin.sources import PseudoDevice, load_description


class RealScene(Scene):
    """A scene whose device does not say that it is simulated."""

    def sensor(self):
        return replace(super().sensor(), serial_number="KS/../7", simulated=False)


AT_REST = RealScene(**{**vars(replace(load_scene("centre"), stimuli=(), rate=100.0))})


@contextmanager
def device_of(scene) -> Iterator[str]:
    device, stopped = PseudoDevice(scene), threading.Event()
    thread = threading.Thread(target=device.serve, args=(stopped.is_set,))
    thread.start()
    try:
        yield device.port
    finally:
        stopped.set()
        thread.join()
        device.close()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr("kappaskin.calibration.TareStore.user_folder", lambda: tmp_path / "tares")
    return tmp_path / "tares"


@pytest.mark.full
@pytest.mark.slow
@pytest.mark.usefixtures("folder")
def test_a_recording_has_its_settings_before_and_with_the_tare_once_each(tmp_path) -> None:
    out = tmp_path / "a.mcap"
    with device_of(AT_REST) as port:
        assert main(["tare", port]) == 0
        assert main(["record", port, str(out), "--seconds", "3"]) == 0

    with Recording(out) as recording:
        setups = [json.loads(text).get("tare") for _, text in recording.setups()]
    assert len(setups) <= 2
    assert setups[-1]


@pytest.mark.full
def test_a_tare_is_told_and_kept_and_undone(folder, capsys):
    with device_of(AT_REST) as port:
        assert main(["tare", port]) == 0
        first = capsys.readouterr().out
        assert main(["tare", port]) == 0
        second = capsys.readouterr().out
        kept = TareStore(folder).load("KS/../7")
        assert main(["tare", port, "--undo"]) == 0

    assert "Simulated skin KS/../7: 300 of 300 channels tared, offsets of" in first
    assert f"saved in {TareStore(folder).path('KS/../7')}" in first
    assert "1/m (RMS) from the tare of" in second
    assert len(kept.tares) == 2
    assert kept.used == kept.tares[-1]
    assert TareStore(folder).load("KS/../7").used is None
    assert "no tare is in use" in capsys.readouterr().out


def test_a_loaded_skin_is_refused_with_the_reason_and_nothing_is_kept(folder, capsys):
    pressed = RealScene(**vars(AT_REST.touched_by(PointLoad(0.05, 0.05, 0.1))))
    with device_of(pressed) as port:
        code = main(["tare", port])

    assert code == 2
    assert "kappaskin: the skin is loaded: " in capsys.readouterr().err
    assert not folder.exists()


@pytest.mark.full
def test_a_simulated_sensor_s_is_only_told(folder, capsys):
    code = main(["tare", "sim:centre"])
    assert code == 2
    assert "loaded" in capsys.readouterr().err

    with device_of(replace(load_scene("centre"), stimuli=(), rate=100.0)) as port:
        assert main(["tare", port]) == 0

    assert "not saved: the sensor is simulated" in capsys.readouterr().out
    assert not folder.exists()


def test_a_source_that_cannot_be_opened_is_refused(folder, capsys):
    assert main(["tare", "/dev/no-such-port"]) == 2
    assert "there is no such port" in capsys.readouterr().err


BOARD = """
format = 1
title = "Bench"
[skin]
size = [0.1, 0.1]
[elements]
grid = [10, 10]
[line]
kind = "text"
columns = ["time_ms", "xx:0..99", "yy:0..99", "xy:0..99"]
id = "bench-1"
"""


@pytest.mark.slow
def test_a_described_sensor_keeps_its_tare_by_its_identifier(run, folder, tmp_path):
    file = tmp_path / "board.toml"
    file.write_text(BOARD)
    device, stopped = PseudoDevice(AT_REST, description=load_description(file)), threading.Event()
    thread = threading.Thread(target=device.serve, args=(stopped.is_set,))
    thread.start()
    try:
        code, printed, _ = run("tare", device.port, "--sensor", file)
    finally:
        stopped.set()
        thread.join()
        device.close()

    assert code == 0
    assert printed.startswith("Bench bench-1: 300 of 300 channels tared")
    assert TareStore(folder).load("bench-1").used is not None


@pytest.mark.parametrize("command", ["tare", "record", "calibrate", "publish"])
def test_a_wrong_description_is_refused_before_anything_is_opened(run, tmp_path, command):
    file = tmp_path / "board.toml"
    file.write_text(BOARD.replace("xx:0..99", "xx:0..100"))
    more = {
        "record": [tmp_path / "r.mcap"],
        "calibrate": ["--out", tmp_path / "c.toml"],
        "publish": ["--udp", "127.0.0.1:9"],
    }

    code, _, said = run(command, "/dev/none", *more.get(command, []), "--sensor", file)

    assert code == 2
    assert "line 10: line.columns: expected elements from 0 to 99, got xx:100" in said
