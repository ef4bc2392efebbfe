"""A device with a line format of its own, on a pseudo-terminal, to frames and recordings."""

import os
import threading
import time
import tty
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Pipeline, Refusal, Setup, load_scene
from kappaskin.cli.common import of_sensor
from kappaskin.errors import SourceError
from kappaskin.frames import Frame
from kappaskin.live import Engine
from kappaskin.live.pipelines import NoiseCheck
from kappaskin.recording import Verification
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin.sources import (
    PseudoDevice,
    SerialSource,
    described_source,
    load_description,
    open_source,
)
from kappaskin.sources.description import description_of

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs pseudo-terminals"),
]
HEAD = """
format = 1
title = "A board"
[skin]
size = [0.1, 0.1]
rigidity = 3.7e-3
[elements]
grid = [6, 6]
"""
LINES = {
    "text": """
[line]
kind = "text"
columns = ["time_ms", "xx:0..35", "yy:0..35", "xy:0..35"]
""",
    "json": """
[line]
kind = "json"
fields = { "skin.t" = "time", xx = "xx:0..35", yy = "yy:0..35", xy = "xy:0..35" }
""",
    "binary": """
[line]
kind = "binary"
struct = "<HI108f"
sync = "aa55"
checksum = "crc16-ccitt"
columns = ["sequence", "time_us", "xx:0..35", "yy:0..35", "xy:0..35"]
""",
}
SCENE = load_scene("off-centre")
SCENE = replace(SCENE, layout=SensorLayout.regular(Patch(0.1, 0.1), 6, 6), rate=200.0)


def written(folder: Path, kind: str) -> Path:
    file = folder / f"{kind}.toml"
    file.write_text(HEAD + LINES[kind])
    return file


@contextmanager
def board(file, scene=SCENE):
    """The port of a board that plays the scene."""
    device, stopped = PseudoDevice(scene, description=load_description(file)), threading.Event()
    thread = threading.Thread(target=device.serve, args=(stopped.is_set,), daemon=True)
    thread.start()
    try:
        yield device.port
    finally:
        stopped.set()
        thread.join()
        device.close()


def frames_of(source, count, seconds=20.0):
    found, end = [], time.monotonic() + seconds
    while len(found) < count and time.monotonic() < end:
        found += source.read(0.05)
    return found


@pytest.mark.parametrize("kind", LINES)
def test_a_board_is_told_like_a_sensor_of_ours(tmp_path, kind):
    file = written(tmp_path, kind)
    with board(file) as port, closing(open_source(described_source(file, port))) as source:
        frames = frames_of(source, 20)
        pipeline = Pipeline(source.sensor, Setup(Ni=6, Nj=6))
        contacts = [pipeline(frame).contact for frame in frames]
        told = source.accounting()

    assert len(frames) >= 20
    assert told.balanced
    assert source.sensor.name == "A board"
    np.testing.assert_allclose(contacts[-1].position, [0.02, 0.08], atol=1.5e-3)
    device_times = [frame.device_time for frame in frames]
    assert np.all(np.diff(device_times) > 0)


def test_a_device_without_times_gets_those_of_arrival(tmp_path):
    file = tmp_path / "plain.toml"
    file.write_text(HEAD + '[line]\nkind = "text"\ncolumns = ["xx:0..35", "yy:0..35", "xy:0..35"]')
    with board(file) as port, closing(open_source(described_source(file, port))) as source:
        frames = frames_of(source, 20)

    times = [frame.device_time for frame in frames]
    assert np.all(np.diff(times) > 0)
    assert all(abs(frame.host_time - frame.device_time) < 0.5 for frame in frames)
    assert all(np.isinf(frame.taken_sd) for frame in frames)


@pytest.mark.parametrize("columns", ['"xx:0..35"', '"time_ms", "xx:0..35"'])
def test_a_recording_begun_amid_unnumbered_lines_verifies(tmp_path, columns):
    file, recording = tmp_path / "plain.toml", tmp_path / "plain.mcap"
    file.write_text(f'{HEAD}[line]\nkind = "text"\ncolumns = [{columns}, "yy:0..35", "xy:0..35"]')
    with board(file) as port, Engine() as engine:
        engine.set_up(Setup(Ni=6, Nj=6))
        engine.connect(described_source(file, port))
        for begun, path in ((False, recording), (True, None)):
            before, end = engine.latest(engine.status()), time.monotonic() + 20
            while engine.latest(engine.status()) is before and time.monotonic() < end:
                time.sleep(0.05)
            time.sleep(0.5)
            engine.record(path)
            while engine.status().recording.active == begun and time.monotonic() < end:
                time.sleep(0.05)

    *_, verdict = Verification.steps(recording)
    assert verdict.compared > 0
    assert not verdict.missing


@pytest.mark.full
def test_a_board_of_other_numbers_is_said_to_be(tmp_path):
    file = written(tmp_path, "text")
    other = tmp_path / "other.toml"
    other.write_text((HEAD + LINES["text"]).replace('"time_ms"', '"time_ms", ""'))
    with board(file) as port, closing(open_source(described_source(other, port))) as source:
        end = time.monotonic() + 20
        while not source.trouble and time.monotonic() < end:
            assert source.read(0.05) == []

    assert "no record as described" in source.trouble
    assert "no separator" in source.trouble


def test_an_unplugged_board_is_back_when_it_is_plugged_in(tmp_path):
    file, master_slave = written(tmp_path, "text"), os.openpty()
    tty.setraw(master_slave[1])
    port = tmp_path / "port"
    port.symlink_to(os.ttyname(master_slave[1]))
    lines = load_description(file).decoder()
    line = lines.encoded(0, 1.0, np.zeros(108))
    with closing(open_source(described_source(file, str(port)))) as source:
        os.write(master_slave[0], line * 3)
        assert len(frames_of(source, 2)) == 2
        for end in master_slave:
            os.close(end)
        end = time.monotonic() + 20
        while "connection lost" not in source.trouble and time.monotonic() < end:
            source.read(0.05)
        master, slave = os.openpty()
        tty.setraw(slave)
        port.unlink()
        port.symlink_to(os.ttyname(slave))
        while source.trouble and time.monotonic() < end:
            source.read(0.05)
        os.write(master, line * 3)
        found = frames_of(source, 2)
        events = [event.kind for event in source.events()]
        os.close(master)
        os.close(slave)

    assert len(found) == 2
    assert {"met", "gone", "back"} <= set(events)
    assert source.accounting().balanced


def test_a_board_is_not_silent_while_what_it_sent_waits(tmp_path):
    now, (master, slave) = [100.0], os.openpty()
    tty.setraw(slave)
    description = load_description(written(tmp_path, "text"))
    line = description.decoder().encoded(0, 1.0, np.zeros(108))
    port = os.ttyname(slave)
    with closing(SerialSource(port, lambda: now[0], description=description)) as source:
        for _ in range(600):  # 130 KB, twice as much as is read at once
            os.write(master, line)
        now[0] = 104.0  # after a computation
        assert source.read(0.1)
        assert source.trouble == ""
        while source.read(0.1):
            pass
        now[0] = 108.0
        assert "silent for more than 3 s" in source.trouble
    os.close(master)
    os.close(slave)


def test_a_scene_on_another_skin_is_refused(tmp_path):
    file = written(tmp_path, "text")
    file.write_text(file.read_text().replace("[0.1, 0.1]", "[0.1, 0.08]"))
    with pytest.raises(Refusal, match=r"0.1 x 0.08 m, got one on a .* of 0.1 x 0.1 m"):
        PseudoDevice(load_scene("off-centre"), description=load_description(file))


READ = {
    "heights": ('"height:0..35"', "scale = 1e-6\nnoise = 1e-6"),
    "free heights": ('"height:0..35"', 'scale = 1e-6\nnoise = 1e-6\ndatum = "free"'),
    "slopes": ('"slope@0:0..35", "slope@90:0..35"', "scale = 1e-3\nnoise = 1e-4"),
    "mixed": (
        '"height:0..35", "slope@45:3..20", "xx:0..35", "curvature@60:0..35"',
        "noise = 0.1\n[readings.height]\nnoise = 1e-6\n[readings.slope]\nnoise = 1e-4",
    ),
    "curvatures": ('"curvature@0:0..35", "curvature@60:0..35", "curvature@120:0..35"', ""),
}


@pytest.mark.parametrize("what", READ)
def test_any_scene_plays_a_board_that_reads_other_quantities(tmp_path, what):
    columns, readings = READ[what]
    file = tmp_path / "other.toml"
    line = f'[line]\nkind = "text"\ncolumns = ["sequence", "time_us", {columns}]\n[readings]\n'
    file.write_text(HEAD + line + readings)
    scene = replace(load_scene("off-centre"), rate=100.0)
    with board(file, scene) as port, closing(open_source(described_source(file, port))) as source:
        frames = frames_of(source, 20)
        pipeline = Pipeline(source.sensor, Setup(Ni=4, Nj=4))
        estimates = [pipeline(frame) for frame in frames]

    assert source.accounting().balanced
    np.testing.assert_allclose(estimates[-1].contact.position, [0.02, 0.08], atol=4e-3)


def test_a_simulated_skin_has_no_description(tmp_path):
    with pytest.raises(Refusal, match="a port or URL with a sensor's description, got sim:"):
        of_sensor("sim:", written(tmp_path, "text"))


def scattered(noise, told):
    """50 fits to readings of such a noise in 1/m, of a sensor that tells another or none."""
    readings = f"[readings]\nnoise = {told}\n" if told else ""
    found = description_of(HEAD + LINES["json"] + readings, "board.toml")
    pipeline, rng = Pipeline(found.sensor, Setup(Ni=4, Nj=4)), np.random.default_rng(3)
    lines, told = found.decoder(whole=True), []
    for n in range(50):
        (record,) = lines.feed(lines.encoded(n, n / 100, rng.normal(0, noise, 108)))
        at = record.time
        pipeline(Frame(record.sequence, at, at, record.channels, record.counts, None, at, 0.0))
        told.append(pipeline.fitted)
    return told


def test_a_noise_that_is_told_is_that_of_the_error_bars():
    told, estimated = scattered(0.2, told=0.2), scattered(0.2, told=None)

    assert {float(fit.noise) for fit in told} == {0.2}
    np.testing.assert_allclose(told[0].sd, estimated[0].sd * 0.2 / estimated[0].noise)


@pytest.mark.parametrize(("told", "words"), [(0.2, ""), (0.05, "too small"), (0.9, "too large")])
def test_a_noise_that_is_told_wrong_is_said_once(told, words):
    check = NoiseCheck()
    said = [text for fit in scattered(0.2, told) for text in (check(fit), check(fit)) if text]

    assert [words in text for text in said] == [True] * bool(words)


def test_a_noise_that_is_not_told_is_not_judged():
    assert not any(map(NoiseCheck(), scattered(0.2, told=None)))


@pytest.mark.parametrize("what", ["heights", "curvatures"])
def test_without_a_rigidity_no_force_is_told(tmp_path, what):
    columns, readings = READ[what]
    line = f'[line]\nkind = "text"\ncolumns = ["sequence", "time_us", {columns}]\n[readings]\n'
    file = tmp_path / "gel.toml"
    file.write_text(HEAD.replace("rigidity = 3.7e-3\n", "") + line + readings)
    scene = replace(load_scene("off-centre"), rate=100.0)
    with board(file, scene) as port, closing(open_source(described_source(file, port))) as source:
        frames = frames_of(source, 20)
        pipeline = Pipeline(source.sensor, Setup(Ni=4, Nj=4))
        contacts = [pipeline(frame).contact for frame in frames]

    assert source.sensor.plate.unknown_material
    assert contacts[-1].present
    np.testing.assert_allclose(contacts[-1].position, [0.02, 0.08], atol=15e-3)
    assert all(np.isnan(contact.force) for contact in contacts)


def test_a_name_without_a_port_is_refused(tmp_path):
    with pytest.raises(SourceError, match="sensor:FILE"):
        open_source(f"sensor:{written(tmp_path, 'text')}")
