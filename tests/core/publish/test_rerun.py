"""What Rerun's own library reads of a file and of what a viewer is sent is what was estimated."""

import json
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from kappaskin import Pipeline, Refusal, Scene, Setup, Simulator, load_scene
from kappaskin.pipeline import Reported
from kappaskin.publish.message import CONTACT, SWITCHES
from kappaskin.publish.publishing import opened, target_of
from kappaskin.recording import Exported, ExportRequest, Recorder, Recording, RerunStream
from kappaskin.recording.export.rerun_stream import scalars
from kappaskin.recording.export.writing import export_steps
from kappaskin.skin import RestMesh
from kappaskin.sources import SimulatedSource, VirtualClock

pytestmark = pytest.mark.slow

TAPS = load_scene("tapping")


class Read:
    """The entities of an .rrd file: their components, by name, row by row."""

    def __init__(self, path: Path) -> None:
        self.batches: dict[str, list[pa.RecordBatch]] = {}
        for chunk in RrdReader(str(path)).stream().to_chunks():
            self.batches.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())

    def rows(self, entity: str, component: str) -> dict[float, Any]:
        """Values by time in s; at NaN what holds for all times."""
        found: dict[float, Any] = {}
        for batch in self.batches[entity]:
            names = batch.schema.names
            if component not in names:
                continue
            times = [np.nan] * batch.num_rows
            if "time" in names:
                times = [1e-9 * t for t in batch["time"].cast(pa.int64()).to_pylist()]
            values = zip(times, batch[component].to_pylist(), strict=True)
            found |= {at: value for at, value in values if value is not None}
        return dict(sorted(found.items()))

    def always(self, entity: str, component: str) -> Any:
        (value,) = self.rows(entity, component).values()
        return value


def recorded(path: Path, scene: Scene = TAPS) -> list[tuple[float, Reported, Pipeline]]:
    """Record half a second of a scene; the arrival, estimate and pipeline of each frame."""
    clock, told = VirtualClock(1000.0), []
    source = SimulatedSource(replace(scene, rate=200.0), clock, clock.sleep)
    pipeline = Pipeline(source.sensor, Setup(Ni=6, Nj=6, nx=9, ny=9))
    recorder = Recorder(path, clock())
    source.record(recorder)
    recorder.set_up(pipeline)
    while clock.now < 1000.5:
        for frame in source.read(0.1):
            estimate = pipeline(frame)
            told.append((frame.host_time - 1000, Reported(estimate, pipeline.fitted), pipeline))
            recorder.take(frame, estimate)
    recorder.close()
    return told


@pytest.fixture(scope="module")
def taps(tmp_path_factory) -> tuple[Path, list[tuple[float, Reported, Pipeline]], Read]:
    folder = tmp_path_factory.mktemp("rerun")
    told = recorded(folder / "taps.mcap")
    *_, done = export_steps(ExportRequest(folder / "taps.mcap", folder / "taps.rrd"), folder)
    assert isinstance(done, Exported)
    assert done.written == len(told)
    return folder / "taps.mcap", told, Read(folder / "taps.rrd")


def test_a_file_has_the_scalars_of_every_frame_at_the_time_of_its_scan(taps) -> None:
    path, told, read = taps
    forces = read.rows("/contact/force", "Scalars:scalars")
    want = np.array([each.contact.force for _, each, _ in told])
    np.testing.assert_array_equal(np.ravel([*forces.values()]), want)
    assert np.isfinite(want).any()
    places = np.array([*read.rows("/contact/position", "Scalars:scalars").values()])
    np.testing.assert_array_equal(places, [each.contact.position for _, each, _ in told])
    with Recording(path) as recording:
        began = 1e-9 * recording.first
    taken = [
        at + each.estimate.taken - each.estimate.host_time
        if np.isfinite(each.estimate.taken)
        else at
        for at, each, _ in told
    ]
    np.testing.assert_allclose([*forces], began + np.array(taken), atol=2e-3)
    np.testing.assert_allclose(np.diff([*forces]), np.diff(taken), atol=2e-6)


def test_every_published_number_is_a_scalar_with_its_unit(taps) -> None:
    *_, read = taps
    keys = [key for columns in scalars().values() for _, key, _, _ in columns]
    head = {"timestamp", "number", "sequence", "generation", "age_s"}
    flags = set(SWITCHES) - {"shape_follows"}
    assert set(keys) == {number.key for number in CONTACT} - head | flags
    assert len(keys) == len(set(keys))
    for name, columns in scalars().items():
        assert read.always(f"/{name}", "SeriesLines:names") == [key for _, key, _, _ in columns]
        assert read.always(f"/{name}", "unit") == [unit for *_, unit, _ in columns]
    assert read.always("/contact/force_sd", "unit") == ["N"]
    assert read.always("/contact/principal", "unit") == ["1/m", "1/m"]


def test_the_skin_is_drawn_where_the_fit_has_it(taps) -> None:
    _, told, read = taps
    meshes = read.rows("/skin", "Mesh3D:vertex_positions")
    assert 12 <= len(meshes) <= 16  # 30 in a second, of half a second
    _, first, pipeline = told[0]
    rest = RestMesh(pipeline.basis.patch, 33, 33)
    depth = pipeline.basis.at(rest.positions) @ first.estimate.coefficients.ravel()
    want = rest.points - depth[:, None] * rest.normals
    at = next(iter(meshes))
    np.testing.assert_allclose(meshes[at], want, atol=1e-8)
    np.testing.assert_allclose(read.rows("/skin", "displacement_m")[at], depth, atol=1e-12)
    triangles = read.rows("/skin", "Mesh3D:triangle_indices")[at]
    np.testing.assert_array_equal(triangles, rest.triangles)
    assert len(read.rows("/skin", "Mesh3D:vertex_colors")[at]) == len(want)


def test_readings_are_tensors_along_y_and_x_whose_colours_are_of_one_range(taps) -> None:
    _, told, read = taps
    layout, first = told[0][2].sensor.layout, told[0][1].estimate
    for row, name in enumerate(("xx", "yy", "xy")):
        (tensor,) = next(iter(read.rows(f"/readings/{name}", "Tensor:data").values()))
        height, width = tensor["shape"]
        values = np.array(tensor["buffer"], "<f4").reshape(height, width)
        assert values.size == len(layout)
        for value, (x, y) in zip(first.curvature[row], layout.positions, strict=True):
            place = int(y / layout.patch.b * height), int(x / layout.patch.a * width)
            assert values[place] == np.float32(value)
        ranges = [each[0] for each in read.rows(f"/readings/{name}", "Tensor:value_range").values()]
        ends = np.array(ranges)[:, 1]
        np.testing.assert_array_equal(ranges, np.column_stack([-ends, ends]))
        assert (np.diff(ends) >= 0).all()  # of the largest so far
        largest = max(np.abs(each.estimate.curvature[row]).max() for _, each, _ in told)
        assert np.abs(first.curvature[row]).max() <= ends[-1] * (1 + 1e-12) <= largest * (1 + 1e-9)


def test_the_contact_has_its_frame_and_its_error_bars(taps) -> None:
    _, told, read = taps
    frames = read.rows("/contact/frame", "Transform3D:translation")
    radii = read.rows("/contact/uncertainty", "Ellipsoids3D:half_sizes")
    arrows = read.rows("/contact/normal", "Arrows3D:vectors")
    of_time = dict(zip(read.rows("/contact/force", "Scalars:scalars"), told, strict=True))
    pressed = [at for at in frames if frames[at]]
    assert pressed
    for at in pressed:
        _, reported, _ = of_time[at]
        np.testing.assert_allclose(frames[at][0], reported.geometry.position, atol=1e-8)
        np.testing.assert_allclose(radii[at][0], reported.in_space()[0], rtol=1e-6)
        arrow = np.array(arrows[at][0])
        np.testing.assert_allclose(
            arrow / np.linalg.norm(arrow), -reported.geometry.normal, atol=1e-6
        )
    lifted = [at for at, arrow in arrows.items() if not arrow]
    for at in lifted:
        assert not of_time[at][1].contact.present


def test_a_file_says_where_it_is_from(taps) -> None:
    path, _, read = taps
    facts = json.loads(read.always("/about", "TextDocument:text")[0])
    assert facts["recording"] == path.name
    assert facts["device"]["name"] == "Simulated skin"


@pytest.mark.filterwarnings("ignore:RRD file has no footer")  # the viewer is ended while it saves
def test_a_viewer_gets_every_estimate_and_none_is_needed(tmp_path, messages_of, request) -> None:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    publisher = opened(target_of(f"rerun://:{port}"))
    request.addfinalizer(publisher.close)
    messages = messages_of(load_scene("off-centre"), 40)
    for message in messages:
        publisher.send(message)
    assert publisher.counts == (0, 40)
    assert "no viewer listens there" in until(lambda: "no viewer" in trouble(publisher), publisher)
    # It is the viewer without its window: it saves what it is sent.
    saved = tmp_path / "live.rrd"
    command = [sys.executable, "-m", "rerun", "--port", str(port), "--save", str(saved)]
    viewer = subprocess.Popen(
        [*command, "--bind", "127.0.0.1"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        until(lambda: not trouble(publisher), publisher)
        for message in messages:
            publisher.send(message)
        until(lambda: publisher.counts[0] == 40, publisher)
        publisher.close()
        until(lambda: saved.exists() and saved.stat().st_size > 10000, publisher)
        time.sleep(1.0)  # for the rest
    finally:
        viewer.terminate()
        viewer.wait()
    forces = np.ravel([*Read(saved).rows("/contact/force", "Scalars:scalars").values()])
    np.testing.assert_array_equal(forces, [m.estimate.contact.force for m in messages])


def trouble(publisher) -> str:
    return publisher.receivers[0].trouble


def until(holds, publisher) -> str:
    end = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < end, publisher.receivers
        time.sleep(0.02)
    return trouble(publisher)


def test_a_finger_has_its_name_before_its_entities(tmp_path) -> None:
    out = RerunStream("a test", "hand", "thumb")
    out.stream.save(tmp_path / "hand.rrd")
    pipeline = Pipeline(TAPS.sensor(), Setup(Ni=6, Nj=6))
    estimate = pipeline(Simulator(TAPS).frame(0, time.monotonic))
    out.take(1e9, Reported(estimate, pipeline.fitted), pipeline)
    out.flush(10)
    out.stream.disconnect()
    entities = set(Read(tmp_path / "hand.rrd").batches) - {"/", "/__properties"}
    assert all(name.startswith("/thumb/") for name in entities)


def test_an_element_that_is_not_known_has_the_colour_of_zero(tmp_path) -> None:
    out = RerunStream("a test", "")
    out.stream.save(tmp_path / "out.rrd")
    pipeline = Pipeline(TAPS.sensor(), Setup(Ni=6, Nj=6))
    estimate = pipeline(Simulator(TAPS).frame(0, time.monotonic))
    curvature = estimate.curvature.copy()
    curvature[0, 3] = np.nan
    out.take(1e9, Reported(replace(estimate, curvature=curvature), pipeline.fitted), pipeline)
    out.flush(10)
    out.stream.disconnect()
    read = Read(tmp_path / "out.rrd")
    (tensor,) = read.always("/readings/xx", "Tensor:data")
    np.testing.assert_array_equal(
        np.array(tensor["buffer"], "<f4"), np.nan_to_num(curvature[0]).astype("<f4")
    )
    low, high = read.always("/readings/xx", "Tensor:value_range")[0]
    assert high == -low == np.nanmax(np.abs(curvature[0]))


def test_without_its_package_what_installs_it_is_said(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(Refusal, match=r"needs rerun: pip install 'kappaskin\[rerun\]'"):
        opened(target_of("rerun://"))
