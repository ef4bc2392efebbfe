"""Names from outside reach a terminal and a table as text."""

import csv
import json
import time
from dataclasses import replace
from pathlib import Path

import pytest

from kappaskin import Event, Pipeline, Scene, Setup, load_scene
from kappaskin.recording import Recorder
from kappaskin.sources import SimulatedSource, sensor_from_json

pytestmark = pytest.mark.slow

NAME = 'N\x1b[31m\r\n<img src=x>,=HYPERLINK("http://x"),=1\u202egpj[bold]$x$\ud800`id`'


class NamedScene(Scene):
    """A scene whose device has such a name."""

    def sensor(self):
        return replace(super().sensor(), name=NAME, serial_number=f"S{NAME}", firmware=f"F{NAME}")


@pytest.fixture
def hostile(tmp_path) -> Path:
    path, now = tmp_path / "a\x1b[31m<b>\u202e.mcap", [time.monotonic()]
    recorder = Recorder(path, now[0])
    scene = NamedScene(**vars(replace(load_scene("circle"), rate=100.0)))
    source = SimulatedSource(scene, lambda: now[0])
    source.record(recorder)
    pipeline = Pipeline(source.sensor, Setup())
    recorder.set_up(pipeline)
    for _ in range(20):
        now[0] += 0.01
        for frame in source.read(0.0):
            recorder.take(frame, pipeline(frame))
    recorder.add_event(Event(now[0], "note", NAME))
    name = f"{NAME}.toml".replace("\ud800", "")
    recorder._file.attach(name, "text/plain", b"")  # noqa: SLF001
    recorder.close()
    return path


def test_no_command_prints_what_a_terminal_obeys(run, hostile, tmp_path) -> None:
    for words in (
        ("info", hostile),
        ("verify", hostile),
        ("repair", hostile, "--out", tmp_path / "b\x1b.mcap"),
        ("export", hostile, "--to", tmp_path / "b\x1b.csv"),
        ("info", tmp_path / "none\x1b.mcap"),
        ("plan", "a\x1b\u202e"),
    ):
        _, *printed = run(*words)
        text = "".join(printed)
        assert "\\x1b" in text
        assert "".join(text.split("\n")).isprintable(), words


def test_a_break_in_a_name_begins_no_line(run, hostile) -> None:
    _, printed, _ = run("info", hostile)
    assert "\n<img" not in printed
    assert r"\r\n<img src=x>" in printed


def test_no_text_of_an_exported_table_is_a_formula(run, hostile, tmp_path) -> None:
    words = ("export", hostile, "--to", tmp_path / "b.csv", "--preset", "everything")
    assert run(*words)[0] == 0
    lines = (tmp_path / "b.csv").read_text().splitlines()
    device = next(line for line in lines if line.startswith("# device: "))
    assert not [c for c in next(csv.reader([device])) if c.strip().startswith("=")]
    assert json.loads(device.removeprefix("# device: "))["name"].startswith("N\x1b[31m")
    assert any(",-" in line for line in lines)  # numbers are as they were


def test_half_a_pair_of_surrogates_in_a_name_is_an_escape() -> None:
    from kappaskin.sources.information import sensor_to_json

    sensor = sensor_from_json(sensor_to_json(load_scene("circle").sensor()).replace(
        "Simulated skin", "a\\ud800b"))  # fmt: skip
    assert sensor.name == "a\\ud800b"
