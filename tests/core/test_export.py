"""What is exported is what was recorded, and any other program reads it."""

import csv
import json
import math
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
import pytest
import pyvista as pv
import trimesh

from kappaskin import Estimate, Frame, Pipeline, Refusal, Scene, Setup, Tare, load_scene
from kappaskin.calibration.calibration import fingerprint
from kappaskin.export import Exporting, Wanted
from kappaskin.export.writing import exported
from kappaskin.recorder import Recorder
from kappaskin.recording import messages as m
from kappaskin.recording.reading import Recording
from kappaskin.sources.simulated import SimulatedSource
from kappaskin.verify import verify

RATE = 100.0
SMALL = Setup(Ni=5, Nj=4, nx=9, ny=7)


@dataclass
class Told:
    """A frame of a recording and what was made of it then."""

    frame: Frame
    estimate: Estimate


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def recorded(
    path: Path,
    scene: Scene | None = None,
    steps: tuple[Setup | Scene, ...] = (SMALL,),
    seconds: float = 0.4,
) -> list[Told]:
    """Record a scene at `path`, so many `seconds` of each of the `steps`."""
    clock, told = Clock(), list[Told]()
    scene = replace(scene or load_scene("tapping"), rate=RATE)
    source = SimulatedSource(scene, clock, clock.sleep)
    pipeline: Pipeline | None = None
    with closing(Recorder(path, clock())) as recorder:
        source.record(recorder)
        for step in steps:
            if isinstance(step, Scene):
                source.play(replace(step, rate=RATE))
                setup = SMALL
            else:
                setup = step
            made = Pipeline(source.sensor, setup)
            if pipeline is not None and pipeline.sensor is source.sensor:
                made.go_on_from(pipeline)
            pipeline = made
            recorder.set_up(pipeline)
            end = clock.now + seconds
            while clock.now < end:
                for frame in source.read(0.1):
                    told.append(Told(frame, pipeline(frame)))
                    recorder.take(frame, told[-1].estimate)
    return told


def export(recording: Path, to: Path, **asked) -> None:
    with Exporting(Wanted(recording, to, **asked)) as exporting:
        shares = [now.share for now in exporting.wait()]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.fixture(scope="module")
def taps(tmp_path_factory) -> tuple[Path, list[Told]]:
    path = tmp_path_factory.mktemp("taps") / "taps.mcap"
    return path, recorded(path)


def about_in(path: Path) -> dict:
    """What a table says of itself, read as anybody would."""
    if path.suffix == ".npz":
        return json.loads(str(np.load(path)["about"]))
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            said = dict(file.attrs)
        return {k: v if v[:1] not in "[{tf" or k == "began" else json.loads(v) for k, v in said.items()}
    lines = [line[2:].split(": ", 1) for line in path.open() if line.startswith("#")]
    return {name: json.loads(value) for name, value in lines}


def columns_in(path: Path) -> dict[str, np.ndarray]:
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return {name: arrays[name] for name in arrays.files if name != "about"}
    with h5py.File(path) as file:
        return {name: file[name][:] for name in file}


OF_ESTIMATE: dict[str, Callable[[Estimate], object]] = {
    "nominal": lambda e: e.nominal,
    "curvature": lambda e: e.curvature,
    "fresh": lambda e: e.fresh,
    "residual": lambda e: e.residual,
    "suspect": lambda e: e.suspect,
    "coefficients": lambda e: e.coefficients,
    "noise": lambda e: e.noise,
    "converged": lambda e: e.converged,
    "present": lambda e: e.touch.present,
    "spare": lambda e: e.touch.spare,
    "position": lambda e: e.touch.position,
    "position_sd": lambda e: e.touch.position_sd,
    "position_95": lambda e: e.touch.position_95,
    "force": lambda e: e.touch.force,
    "force_sd": lambda e: e.touch.force_sd,
    "force_95": lambda e: e.touch.force_95,
    "displacement": lambda e: e.touch.displacement,
    "displacement_sd": lambda e: e.touch.displacement_sd,
    "point": lambda e: e.geometry.position,
    "frame": lambda e: e.geometry.frame,
    "metric": lambda e: e.geometry.metric,
    "curvature_form": lambda e: e.geometry.curvature_form,
    "torsion_form": lambda e: e.geometry.torsion_form,
    "covariance": lambda e: e.geometry.covariance,
    "principal": lambda e: e.geometry.principal,
    "principal_sd": lambda e: e.geometry.principal_sd,
    "angle": lambda e: e.geometry.angle,
    "device_time": lambda e: e.device_time,
    "host_time": lambda e: e.host_time,
    "taken": lambda e: e.taken,
    "taken_sd": lambda e: e.taken_sd,
    "sequence": lambda e: e.sequence,
}


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_a_table_has_every_frame_bit_for_bit_as_it_was_live(suffix: str, taps, tmp_path) -> None:
    recording, told = taps
    export(recording, tmp_path / f"out{suffix}")
    found = columns_in(tmp_path / f"out{suffix}")
    assert any(one.estimate.touch.present for one in told)
    for name, of in OF_ESTIMATE.items():
        was = np.array([of(one.estimate) for one in told])
        assert found[name].tobytes() == was.astype(found[name].dtype).tobytes(), name
    counts = np.array([one.frame.counts for one in told])
    np.testing.assert_array_equal(found["counts"].reshape(len(told), -1), counts)
    assert set(found) - set(OF_ESTIMATE) == {"counts", "time", "setup", "single", "near_rim"}
    np.testing.assert_allclose(found["time"], found["host_time"] - 1000.0, atol=1e-6)


def test_a_csv_has_the_same_numbers_as_an_npz(taps, tmp_path) -> None:
    recording, _ = taps
    export(recording, tmp_path / "out.csv")
    export(recording, tmp_path / "out.npz")
    with (tmp_path / "out.csv").open() as file:
        head, *rows = csv.reader(line for line in file if not line.startswith("#"))
    values = np.array(rows, float)
    found = columns_in(tmp_path / "out.npz")
    flat = np.concatenate([v.reshape(len(v), -1).astype(float) for v in found.values()], axis=1)
    assert values.tobytes() == flat.tobytes()
    assert head[0] == "time [s]"
    assert "curvature_xy_3 [1/m]" in head
    assert "coefficients_4_3 [m]" in head
    assert "covariance_yy_xy [1/m^2]" in head
    assert len(set(head)) == len(head)
