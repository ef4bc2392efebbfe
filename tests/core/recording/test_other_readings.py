"""Recordings of sensors that read heights and slopes: verified, replayed and exported."""

import csv
import json
from contextlib import closing
from pathlib import Path

import h5py
import numpy as np
import pytest

from kappaskin import Pipeline, Setup
from kappaskin.recording import (
    Exported,
    ExportRequest,
    Recorder,
    Recording,
    ReplayedSource,
    Verification,
)
from kappaskin.recording.cdr import decode
from kappaskin.recording.export.writing import export_steps
from kappaskin.recording.messages import CURVATURES, POINT_CLOUD, SKIN
from kappaskin.scenes import read_scene
from kappaskin.sources import SimulatedSource, VirtualClock, sensor_from_json, sensor_to_json

TEXT = """
format = 1
rate = 100.0

[skin]
size = [0.06, 0.06]

[elements]
grid = [6, 5]
reads = ["slope@20", "height"]
dead = [4]
cell = [0.001, 0.002]

[readings]
resolution = 1e-7

[readings.height]
noise = 2e-6

[readings.slope]
noise = 3e-4

[[touch]]
what = "point"
x = 0.03
y = 0.024
force = 0.1
path = [{ step = "tap", seconds = 0.3 }]
"""
SETUP = Setup(Ni=5, Nj=5, nx=9, ny=7)
SCENE = read_scene(TEXT, Path("scene.toml"))
R = SCENE.layout.channels


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The path of a recording, and the estimates that were made then."""
    path = tmp_path_factory.mktemp("others") / "others.mcap"
    clock = VirtualClock(1000.0)
    source = SimulatedSource(SCENE, clock, clock.sleep)
    pipeline, made = Pipeline(source.sensor, SETUP), []
    with closing(Recorder(path, clock())) as recorder:
        source.record(recorder)
        recorder.set_up(pipeline)
        while clock.now < 1000.5:
            for frame in source.read(0.1):
                made.append(pipeline(frame))
                recorder.take(frame, made[-1])
    return path, made


def test_a_description_reads_back():
    sensor = SCENE.sensor()
    again = sensor_from_json(sensor_to_json(sensor))
    layout = again.layout
    assert layout.each_reads == ["slope@20", "height"]
    assert (layout.dead, layout.cell) == ([4], (0.001, 0.002))
    assert again.transduction == sensor.transduction
    np.testing.assert_array_equal(again.sigma, sensor.sigma)


def test_a_recording_is_verified_bit_for_bit(recorded):
    *_, verdict = Verification.steps(recorded[0])
    assert verdict.same
    assert verdict.compared > 20


def test_messages_have_one_number_for_each_reading(recorded):
    path, made = recorded
    with Recording(path) as recording:
        messages = [m for m in recording.messages() if m.topic in (CURVATURES.name, SKIN.name)]
    read = decode(CURVATURES.kind, next(m.data for m in messages if m.topic == CURVATURES.name))
    np.testing.assert_array_equal(read["curvature"], made[0].curvature)
    assert len(read["suspect"]) == 30
    cloud = next(m.data for m in messages if m.topic == SKIN.name)
    fields = decode(POINT_CLOUD, cloud)
    assert fields["point_step"] == 4 * 6
    points = np.frombuffer(bytes(fields["data"]), "<f4").reshape(30, 6)
    expected = SCENE.layout.by_kind(made[0].curvature)  # height, then slope
    np.testing.assert_array_equal(points[:, 4:].T, expected.astype("<f4"))


def test_a_replay_shows_what_was_recorded(recorded):
    path, made = recorded
    clock = VirtualClock(0.0)
    with closing(ReplayedSource(path, clock, clock.sleep)) as source:
        frames = source.read(0.1)
        assert source.sensor is not None
        assert source.sensor.layout.kinds == SCENE.layout.kinds
        again = Pipeline(source.sensor, SETUP)(frames[0])
    np.testing.assert_array_equal(again.curvature, made[0].curvature)
    np.testing.assert_array_equal(again.coefficients, made[0].coefficients)


def exported(path, to):
    *_, done = export_steps(ExportRequest(path, to, preset="everything"), to.parent)
    assert isinstance(done, Exported)
    return to


def test_tables_name_each_reading_with_its_unit(recorded, tmp_path):
    path, made = recorded
    lines = exported(path, tmp_path / "a.csv").read_text().splitlines()
    facts = dict(line[2:].split(": ", 1) for line in lines if line.startswith("#"))
    assert "readings height in m, slope@20 in m/m" in json.loads(facts["units"])
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert not any(name.startswith("curvature_") and "form" not in name for name in rows[0])
    for channel in (0, 29, 30, 59):
        name, element = ("slope@20", "height")[channel // 30], channel % 30
        unit = {"height": "m", "slope@20": "m/m"}[name]
        read = float(rows[3][f"reading_{name}_{element} [{unit}]"])
        assert read == made[3].curvature[channel]
    assert "noise" in rows[0]  # in units of what the sensor states


@pytest.mark.parametrize("suffix", ["npz", "h5"])
def test_arrays_have_one_axis_of_readings(recorded, tmp_path, suffix):
    path, made = recorded
    to = exported(path, tmp_path / f"a.{suffix}")
    with np.load(to) if suffix == "npz" else h5py.File(to) as file:
        for name in ("counts", "nominal", "reading", "residual", "fresh"):
            assert file[name].shape == (len(made), R)
        np.testing.assert_array_equal(file["reading"][5], made[5].curvature)
