"""What is exported is what was recorded, and any other program reads it."""

import csv
import json
import math
import os
import re
import struct
import subprocess
import sys
from collections import deque
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from scipy.spatial import KDTree

from kappaskin import (
    Cap,
    Estimate,
    Frame,
    Patch,
    Pipeline,
    Refusal,
    Scene,
    Setup,
    Tare,
    basis_for,
    load_scene,
)
from kappaskin.bases import curvature_at
from kappaskin.calibration.calibration import fingerprint
from kappaskin.pipeline import Reported, getters
from kappaskin.recording import (
    Exported,
    ExportRequest,
    ExportTask,
    ForecastTask,
    Recorder,
    Recording,
    Verification,
)
from kappaskin.recording.cdr import decode
from kappaskin.recording.export.lerobot import LeRobotFolder, _rate
from kappaskin.recording.export.surfaces import SkinMesh, SkinSurface
from kappaskin.recording.export.writing import export_steps
from kappaskin.recording.messages import CONTACTS, SECOND_CONTACT, SECONDS, TOPICS
from kappaskin.sources import SimulatedSource, VirtualClock

pytestmark = pytest.mark.slow

RATE = 100.0
SMALL = Setup(Ni=5, Nj=4, nx=9, ny=7)


@dataclass
class Told:
    """A frame of a recording and what was made of it then."""

    frame: Frame
    estimate: Estimate


def recorded(
    path: Path,
    scene: Scene | None = None,
    steps: tuple[Setup | Scene, ...] = (SMALL,),
    seconds: float = 0.4,
) -> list[Told]:
    """Record a scene at `path`, so many `seconds` of each of the `steps`."""
    clock, told = VirtualClock(1000.0), list[Told]()
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
                made.continue_from(pipeline)
            pipeline = made
            recorder.set_up(pipeline)
            end = clock.now + seconds
            while clock.now < end:
                for frame in source.read(0.1):
                    told.append(Told(frame, pipeline(frame)))
                    recorder.take(frame, told[-1].estimate)
    return told


def export(recording: Path, to: Path, **asked) -> Exported:
    """Export everything in this process, which is sooner; into a folder that is made for it."""
    to.parent.mkdir(exist_ok=True)
    request = ExportRequest(recording, to, **({"preset": "everything"} | asked))
    *shares, done = export_steps(request, to.parent)
    assert isinstance(done, Exported)
    assert shares == sorted(shares)
    return done


@pytest.fixture(scope="module")
def taps(tmp_path_factory) -> tuple[Path, list[Told]]:
    path = tmp_path_factory.mktemp("taps") / "taps.mcap"
    return path, recorded(path)


def text_or_json(value: str) -> object:
    return json.loads(value) if value[:1] in "[{" or value in ("true", "false") else value


def about_in(path: Path) -> dict:
    """What a table says of itself, read as anybody would."""
    if path.suffix == ".npz":
        return json.loads(str(np.load(path)["about"]))
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            return {name: text_or_json(value) for name, value in file.attrs.items()}
    said = [line for line in path.read_text().splitlines() if line.startswith("#")]
    lines = [line[2:].split(": ", 1) for line in said]
    return {name: json.loads(value) for name, value in lines}


def columns_in(path: Path) -> dict[str, np.ndarray]:
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return {name: arrays[name] for name in arrays.files if name != "about"}
    with h5py.File(path) as file:
        return {name: each[:] for name, each in file.items() if "description" in each.attrs}


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_a_table_has_every_frame_bit_for_bit_as_it_was_live(suffix: str, taps, tmp_path) -> None:
    recording, told = taps
    export(recording, tmp_path / f"out{suffix}")
    found = columns_in(tmp_path / f"out{suffix}")
    assert any(one.estimate.contact.present for one in told)
    get = getters()
    for name in set(found) - {"counts", "time"}:
        was = np.array([get[name](Reported(one.estimate)) for one in told])
        assert found[name].tobytes() == was.astype(found[name].dtype).tobytes(), name
    counts = np.array([one.frame.counts for one in told])
    np.testing.assert_array_equal(found["counts"].reshape(len(told), -1), counts)
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


def test_a_verdict_finds_the_recording_the_same(taps) -> None:
    *_, verdict = Verification.steps(taps[0])
    assert isinstance(verdict, Verification)
    assert verdict.same
    assert verdict.compared > len(taps[1])


def test_rosbags_reads_every_contact_of_a_recording(taps) -> None:
    recording, told = taps
    with AnyReader([recording]) as reader:
        of = {each.topic: each for each in reader.connections}
        assert set(of) == {topic.name for topic in TOPICS}
        found = [
            reader.deserialize(raw, each.msgtype)
            for each, _, raw in reader.messages([of[CONTACTS.name]])
        ]
        poses = list(reader.messages([of["/kappaskin/pose"]]))
    assert [got.sequence for got in found] == [one.frame.sequence for one in told]
    want = [one.estimate.contact for one in told]
    np.testing.assert_array_equal([got.force for got in found], [one.force for one in want])
    np.testing.assert_array_equal([got.position for got in found], [one.position for one in want])
    assert {got.header.frame_id for got in found} == {"skin"}
    assert poses


def test_two_contacts_are_recorded_and_verified(tmp_path) -> None:
    path = tmp_path / "two.mcap"
    told = recorded(path, load_scene("two-contacts"), (Setup(nx=9, ny=7),), 0.1)
    assert all(one.estimate.second.present for one in told)
    with Recording(path) as recording:
        seconds = [decode(SECOND_CONTACT, got.data) for got in recording.messages_on(SECONDS)]
    assert [got["second_force"] for got in seconds] == [one.estimate.second.force for one in told]
    *_, verdict = Verification.steps(path)
    assert isinstance(verdict, Verification)
    assert verdict.same


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".h5"])
def test_a_table_tells_where_it_is_from(suffix: str, tmp_path) -> None:
    scene = load_scene("fingertip")
    sensor = scene.sensor()
    zero = np.full(sensor.channels, 0.25)
    place, date = fingerprint(sensor.layout), datetime(2026, 1, 2, 3, tzinfo=UTC)
    about = (sensor.name, sensor.serial_number, place, date)
    tare = Tare(*about, 21.5, 100, 1.0, zero, 0 * zero + 0.01)
    told = recorded(tmp_path / "rec.mcap", scene, (replace(SMALL, tare=tare),), 0.1)
    export(tmp_path / "rec.mcap", tmp_path / f"out{suffix}")
    said = about_in(tmp_path / f"out{suffix}")
    assert said["recording"] == "rec.mcap"
    assert said["program"].startswith("kappaskin ")
    assert said["device"]["serial_number"] == sensor.serial_number
    assert said["settings"][0]["tare"]["digest"] == tare.digest
    assert said["settings"][0]["tare"]["date"] == date.isoformat()
    assert said["settings"][0]["calibration"] is None
    assert (said["settings"][0]["Ni"], said["settings"][0]["method"]) == (5, SMALL.method)
    began = datetime.fromisoformat(said["began"])
    assert abs((datetime.now(UTC) - began).total_seconds() - 1000) < math.inf
    np.testing.assert_array_equal(said["positions"], sensor.layout.positions)
    assert said["ended_properly"] is True
    assert len(told) > 5


def test_an_hdf5_column_has_its_unit(taps, tmp_path) -> None:
    export(taps[0], tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["curvature"].attrs["unit"] == "1/m"
        assert "force [N]: " in file["README"].asstr()[()]
        np.testing.assert_array_equal(file["curvature"].dims[0]["time"][:], file["time"][:])
        assert [*file["curvature"].dims[1]["component"].asstr()[:]] == ["xx", "yy", "xy"]
        elements = file["curvature"].dims[2]["element"][:]
        np.testing.assert_array_equal(elements, np.arange(file["curvature"].shape[2]))
        assert file["coefficients"].dims[1].label == "along"
        assert file["force"].attrs["unit"] == "N"
        scales = {scale for each in file.values() for dim in each.dims for scale in dim.values()}
        assert {scale.parent for scale in scales} == {file}  # where NetCDF looks for them
        columns = [each for each in file.values() if "unit" in each.attrs]
        assert len(columns) > 10
        assert all(each.attrs["description"] for each in columns)


def test_settings_that_change_are_told_of_and_each_frame_says_which_it_had(tmp_path) -> None:
    other = replace(SMALL, Ni=4, Nj=6, method="bayes")
    told = recorded(tmp_path / "rec.mcap", steps=(SMALL, other), seconds=0.2)
    export(tmp_path / "rec.mcap", tmp_path / "out.npz")
    found, said = columns_in(tmp_path / "out.npz"), about_in(tmp_path / "out.npz")
    assert [setup["number"] for setup in said["settings"]] == [0, 1]
    assert said["settings"][1]["method"] == "bayes"
    assert sorted(set(found["setup"])) == [0, 1]
    assert found["coefficients"].shape == (len(told), 5, 6)
    for one, setup, c in zip(told, found["setup"], found["coefficients"], strict=True):
        Ni, Nj = one.estimate.coefficients.shape
        assert (Ni, Nj) == ((5, 4), (4, 6))[setup]
        np.testing.assert_array_equal(c[:Ni, :Nj], one.estimate.coefficients)
        assert np.isnan(c[Ni:]).all()
        assert np.isnan(c[:, Nj:]).all()


def test_a_span_has_its_own_frames_with_the_memory_of_those_before(tmp_path) -> None:
    setup = replace(SMALL, method="tracking")
    told = recorded(tmp_path / "rec.mcap", steps=(setup,), seconds=0.5)
    export(tmp_path / "rec.mcap", tmp_path / "out.npz", begin=0.195, end=0.305)
    found = columns_in(tmp_path / "out.npz")
    within = [one for one in told if 0.195 <= one.frame.host_time - 1000 <= 0.305]
    assert len(within) >= 10
    np.testing.assert_array_equal(found["sequence"], [one.frame.sequence for one in within])
    was = np.array([one.estimate.coefficients for one in within])
    assert found["coefficients"].tobytes() == was.tobytes()


def test_every_so_many_seconds_one_row_is_written(taps, tmp_path) -> None:
    export(taps[0], tmp_path / "out.npz", every=0.1)
    times = columns_in(tmp_path / "out.npz")["time"]
    assert len(times) == 5
    assert (np.abs(np.diff(times) - 0.1) < 1.5 / RATE).all()


def test_other_settings_give_what_a_pipeline_of_those_gives(taps, tmp_path) -> None:
    recording, told = taps
    other = replace(SMALL, Ni=6, Nj=3)
    export(recording, tmp_path / "out.npz", setup=other)
    found, said = columns_in(tmp_path / "out.npz"), about_in(tmp_path / "out.npz")
    scene = replace(load_scene("tapping"), rate=RATE)
    pipeline = Pipeline(SimulatedSource(scene).sensor, other)
    was = np.array([pipeline(one.frame).coefficients for one in told])
    assert found["coefficients"].tobytes() == was.tobytes()
    assert [setup["Ni"] for setup in said["settings"]] == [6]


def test_another_skin_in_between_is_refused_and_each_of_the_two_is_not(tmp_path) -> None:
    told = recorded(tmp_path / "rec.mcap", steps=(SMALL, load_scene("fingertip")), seconds=0.2)
    with pytest.raises(Refusal, match="another device, or another skin, came at") as refusal:
        export(tmp_path / "rec.mcap", tmp_path / "all" / "out.csv")
    before, after = (float(t) for t in re.findall(r"(?:until|from) ([\d.]+) s", str(refusal.value)))
    export(tmp_path / "rec.mcap", tmp_path / "a" / "out.npz", end=before)
    export(tmp_path / "rec.mcap", tmp_path / "b" / "out.npz", begin=after)
    first, second = (columns_in(tmp_path / which / "out.npz") for which in "ab")
    shapes = {one.estimate.curvature.shape for one in told}
    assert {first["curvature"].shape[1:], second["curvature"].shape[1:]} == shapes
    assert len(first["time"]) + len(second["time"]) >= len(told) - 2


# The surface.


def shape_on(held_skin, scale: float = 1e-5) -> tuple[SkinSurface, np.ndarray]:
    """A surface of 25 x 25 points, and its coefficients in m."""
    basis = held_skin.basis()
    c = scale * np.random.default_rng(0).standard_normal(basis.shape)
    return SkinMesh(basis, 25, 25)(c), c


def test_the_surface_goes_through_the_skin_moved_along_its_normals(held_skin) -> None:
    surface, c = shape_on(held_skin)
    basis, patch = held_skin.basis(), held_skin.patch
    x, y = patch.grid(25, 25)
    f = basis.on_grid(x, y)(c).ravel()
    rest, out = patch.at_rest(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    on = np.isfinite(f)
    far, which = KDTree(surface.points).query((rest - out * f[:, None])[on])
    assert far.max() < 1e-10
    np.testing.assert_allclose(surface.displacement[which], f[on], atol=1e-10)


def test_the_surface_is_as_large_as_the_skin_and_faces_outwards(held_skin) -> None:
    surface, _ = shape_on(held_skin, 1e-6)
    mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
    _, weights = held_skin.basis().quadrature()
    assert mesh.area == pytest.approx(weights.sum(), rel=0.01)
    # Three points of the rim of a cap lie in one plane across it: slivers that look up.
    there = mesh.area_faces > mesh.area_faces.mean() / 30
    outwards = surface.normals[surface.triangles].mean(axis=1)
    assert (np.einsum("pi,pi->p", mesh.face_normals, outwards)[there] > 0.99).all()
    assert len(np.unique(surface.triangles)) == len(surface.points)


def test_a_skin_at_rest_has_its_base_curvature_everywhere(held_skin) -> None:
    (surface, _), patch = shape_on(held_skin, 0.0), held_skin.patch
    at_rest = np.broadcast_to((*patch.curvatures, 0.0), surface.curvature.shape)
    if isinstance(patch, Cap):  # a spheroid's curvature is another at each place
        at_rest = patch.base(*patch.places(surface.points).T).form.T
    elif patch.is_shallow:  # the arcs along x and y lean towards the corners
        away = surface.points[:, :2] - (patch.a / 2, patch.b / 2)
        x, y = (np.arcsin(H * u) / H for H, u in zip(patch.curvatures, away.T, strict=True))
        at_rest = patch.base(x + patch.a / 2, y + patch.b / 2).form.T
    np.testing.assert_allclose(surface.curvature, at_rest, atol=1e-9)


def test_the_curvature_of_a_flat_skin_is_that_of_equations_3_to_5() -> None:
    basis = basis_for(Patch(0.1, 0.08), "hinged", 4, 3)
    c = 1e-8 * np.arange(12.0).reshape(4, 3)
    surface = SkinMesh(basis, 11, 9)(c)
    exact = curvature_at(basis, surface.points[:, :2]) @ c.ravel()
    np.testing.assert_allclose(surface.curvature, exact.T, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ["tapping", "fingertip"])
def test_a_vtp_opens_in_pyvista_with_all_that_is_known_of_it(name: str, tmp_path) -> None:
    pv = pytest.importorskip("pyvista")
    setup = replace(SMALL, nx=33, ny=21)
    told = recorded(tmp_path / "rec.mcap", load_scene(name), (setup,), 0.2)
    export(tmp_path / "rec.mcap", tmp_path / "skin.vtp", at=0.1)
    mesh = pv.read(tmp_path / "skin.vtp")
    at = float(mesh.field_data["TimeValue"][0])
    one = min(told, key=lambda one: abs(one.frame.host_time - 1000 - at))
    assert 0.1 <= at < 0.1 + 1.5 / RATE
    said = json.loads(mesh.field_data["about"][0])
    assert said["sequence"] == one.frame.sequence
    assert said["settings"][0]["nx"] == 33
    assert mesh.is_all_triangles
    assert mesh.n_cells == 2 * 32 * 20
    np.testing.assert_allclose(mesh["displacement [m]"], one.estimate.surface.ravel(), atol=1e-12)
    assert mesh["curvature [1/m]"].shape == (33 * 21, 3)
    assert mesh.point_data.active_normals_name == "normals"


def test_an_stl_is_the_same_surface_as_the_vtp(taps, tmp_path) -> None:
    pv = pytest.importorskip("pyvista")
    export(taps[0], tmp_path / "skin.vtp", at=0.2)
    export(taps[0], tmp_path / "skin.stl", at=0.2)
    one, other = pv.read(tmp_path / "skin.vtp"), trimesh.load(tmp_path / "skin.stl")
    assert len(other.faces) == one.n_cells
    assert other.area == pytest.approx(one.area, rel=1e-5)
    corners = one.points[one.regular_faces]
    np.testing.assert_allclose(np.asarray(other.triangles), corners, rtol=1e-6, atol=1e-9)
    head = (tmp_path / "skin.stl").read_bytes()[:80]
    assert b"kappaskin" in head
    assert not head.startswith(b"solid")
    said = json.loads((tmp_path / "skin.json").read_text())
    assert said["lengths"] == "m"
    assert said["device"]["name"] == "Simulated skin"
    assert list(said["times"]) == ["skin.stl"]


def test_a_series_is_one_surface_each_so_many_seconds(taps, tmp_path) -> None:
    pv = pytest.importorskip("pyvista")
    export(taps[0], tmp_path / "skin.pvd", every=0.1)
    reader = pv.get_reader(tmp_path / "skin.pvd")
    times = reader.time_values
    assert len(times) == 5
    assert (np.abs(np.diff(times) - 0.1) < 1.5 / RATE).all()
    reader.set_active_time_value(times[-1])
    last = reader.read()[0]
    assert last.field_data["TimeValue"][0] == times[-1]
    export(taps[0], tmp_path / "s" / "skin.stl", every=0.1)
    said = json.loads((tmp_path / "s" / "skin.json").read_text())
    assert list(said["times"].values()) == times
    assert all((tmp_path / "s" / name).exists() for name in said["times"])
    assert not (tmp_path / "s" / "skin.stl").exists()


def glb(path: Path) -> tuple[dict, Callable[[int], np.ndarray]]:
    """What a .glb says of itself, and its accessors' values by number."""
    data = path.read_bytes()
    assert struct.unpack("<4sII", data[:12]) == (b"glTF", 2, len(data))
    size, kind = struct.unpack("<I4s", data[12:20])
    said, rest = json.loads(data[20 : 20 + size]), data[28 + size :]
    assert (kind, data[24 + size : 28 + size]) == (b"JSON", b"BIN\0")
    assert len(rest) == said["buffers"][0]["byteLength"]

    def values(number: int) -> np.ndarray:
        one = said["accessors"][number]
        view = said["bufferViews"][one["bufferView"]]
        found = np.frombuffer(rest, {5125: "<u4", 5126: "<f4"}[one["componentType"]])
        found = found[view["byteOffset"] // 4 :][: view["byteLength"] // 4]
        assert found.size == one["count"] * {"SCALAR": 1, "VEC3": 3}[one["type"]]
        return found.reshape(one["count"], -1)

    return said, values


def test_a_glb_is_the_same_surface_as_the_vtp(taps, tmp_path) -> None:
    pv = pytest.importorskip("pyvista")
    export(taps[0], tmp_path / "skin.vtp", at=0.2)
    export(taps[0], tmp_path / "skin.glb", at=0.2)
    one, other = pv.read(tmp_path / "skin.vtp"), trimesh.load(tmp_path / "skin.glb", force="mesh")
    assert np.array_equal(other.faces, one.regular_faces)
    turned = other.vertices[:, [0, 2, 1]] * (1, -1, 1)  # y is up in glTF
    np.testing.assert_allclose(turned, one.points, rtol=1e-6, atol=1e-9)
    said, values = glb(tmp_path / "skin.glb")
    deep = np.abs(one["displacement [m]"])
    assert said["asset"]["extras"]["brightest [m]"] == pytest.approx(deep.max())
    assert said["asset"]["extras"]["device"]["name"] == "Simulated skin"
    colours = values(said["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
    assert np.ptp(colours, axis=0).min() > 0.1
    assert colours.sum(axis=1).argmax() == deep.argmax()


def test_a_glb_moves_as_the_skin_did(taps, tmp_path) -> None:
    export(taps[0], tmp_path / "skin.glb", every=0.1)
    export(taps[0], tmp_path / "skin.pvd", every=0.1)
    pv = pytest.importorskip("pyvista")
    said, values = glb(tmp_path / "skin.glb")
    (animation,), mesh = said["animations"], said["meshes"][0]
    (sampler,), skin = animation["samplers"], mesh["primitives"][0]
    reader = pv.get_reader(tmp_path / "skin.pvd")
    times = values(sampler["input"])[:, 0]
    np.testing.assert_allclose(times, np.array(reader.time_values) - reader.time_values[0])
    weights = values(sampler["output"]).reshape(len(times), len(mesh["weights"]))
    first = values(skin["attributes"]["POSITION"])
    moves = [values(target["POSITION"]) for target in skin["targets"]]
    for at, weight in zip(reader.time_values, weights, strict=True):
        reader.set_active_time_value(at)
        points = first + np.tensordot(weight, moves, 1)
        np.testing.assert_allclose(points, reader.read()[0].points, atol=1e-8)
    assert np.abs(moves).max() > 1e-5


def test_a_glb_without_times_is_the_skin_at_its_deepest(taps, tmp_path) -> None:
    recording, told = taps
    export(recording, tmp_path / "skin.glb")
    said, values = glb(tmp_path / "skin.glb")
    deepest = max(told, key=lambda one: np.abs(one.estimate.surface).max())
    assert said["asset"]["extras"]["sequence"] == deepest.frame.sequence
    z = values(said["meshes"][0]["primitives"][0]["attributes"]["POSITION"])[:, 2]
    assert z.min() == pytest.approx(-deepest.estimate.surface.max(), rel=1e-6)


# What is refused, and what is left of it.


def test_a_process_of_its_own_leaves_the_file_alone(taps, tmp_path) -> None:
    with ExportTask(ExportRequest(taps[0], tmp_path / "out.npz")) as exporting:
        assert len(list(tmp_path.iterdir())) == 1
        *shares, done = exporting.wait()
    assert shares == sorted(shares)
    assert isinstance(done, Exported)
    assert done.written == len(taps[1])
    assert list(tmp_path.iterdir()) == [tmp_path / "out.npz"]


def test_the_steepest_shape_is_warned_of(tmp_path) -> None:
    steep = load_scene("steep")
    recorded(tmp_path / "steep.mcap", steep, (SMALL, replace(SMALL, method="finite-slope")), 1.0)

    done = export(tmp_path / "steep.mcap", tmp_path / "one" / "out.csv")
    known = export(tmp_path / "steep.mcap", tmp_path / "two" / "out.csv", begin=1.05)

    assert 0.2 < done.slope < 0.5
    assert re.search(r"; slopes reach 0\.\d+: up to \d+ % too flat; use finite-slope$", done.words)
    assert known.slope == 0
    assert re.fullmatch(r"\d+ frames", known.words)


def test_a_cancelled_export_leaves_nothing(taps, tmp_path) -> None:
    with ExportTask(ExportRequest(taps[0], tmp_path / "skin.pvd", every=0.001)) as exporting:
        next(exporting.wait())
    assert not list(tmp_path.iterdir())


def test_an_export_that_nobody_waits_for_any_more_clears_up(taps, tmp_path) -> None:
    room = tmp_path / "room"
    room.mkdir()
    work = export_steps(ExportRequest(taps[0], tmp_path / "out.csv"), room)
    next(work)
    assert list(room.iterdir())
    work.close()
    assert not room.exists()


def test_a_file_that_appears_meanwhile_stays_as_it_is(taps, tmp_path) -> None:
    with ExportTask(ExportRequest(taps[0], tmp_path / "skin.stl", at=0.1)) as exporting:
        (tmp_path / "skin.json").write_text("mine")
        with pytest.raises(Refusal, match="has been created meanwhile"):
            deque(exporting.wait(), 0)
    assert list(tmp_path.iterdir()) == [tmp_path / "skin.json"]
    assert (tmp_path / "skin.json").read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "asked", "why"),
    [
        ("out.txt", {}, r"ends in one of \.parquet, \.csv"),
        ("out", {}, r"ends in one of \.parquet, \.csv"),
        ("out.csv", {"preset": "all"}, "one of contact, readings, everything; got 'all'"),
        ("out.csv", {"at": 0.1}, "a row for each frame"),
        ("out.lerobot", {"at": 0.1}, "a row for each frame"),
        (
            "out.lerobot",
            {"every": 0.03},
            r"a whole number of rows a second, .* got one every 0.03 s",
        ),
        ("out.lerobot", {"every": 3.0}, "a whole number of rows a second"),
        ("out.lerobot", {"every": 1e-320}, "a whole number of rows a second"),
        ("out.vtp", {}, r"\(at, in s\), .* \(every, in s\)"),
        ("out.vtp", {"every": 0.1}, "to a .pvd"),
        ("out.pvd", {}, r"two surfaces \(every, in s\)"),
        ("out.stl", {}, r"at one moment, .* \(at, in s\)"),
        ("out.stl", {"at": 0.1, "every": 0.1}, "got both"),
        ("out.csv", {"begin": math.nan}, "times in s"),
        ("out.csv", {"begin": -1.0}, "times in s"),
        ("out.csv", {"begin": math.inf}, "times in s"),
        ("out.csv", {"begin": 2.0, "end": 1.0}, "times in s"),
        ("out.csv", {"end": math.nan}, "times in s"),
        ("out.csv", {"every": -0.1}, "times in s"),
        ("out.csv", {"every": math.nan}, "times in s"),
        ("out.stl", {"at": math.nan}, "times in s"),
        ("out.csv", {"begin": 100.0}, "from 100 s on; the last one came at"),
        ("out.stl", {"at": 100.0}, "from 100 s on; the last one came at"),
        ("out.csv", {"begin": 0.1001, "end": 0.1002}, "until 0.1002 s; the next one came at"),
        ("no/out.csv", {}, "cannot be written"),
    ],
)
def test_what_makes_no_file_is_refused(name: str, asked: dict, why: str, taps, tmp_path) -> None:
    with (
        pytest.raises(Refusal, match=why) as refused,
        ExportTask(ExportRequest(taps[0], tmp_path / name, **asked)) as work,
    ):
        deque(work.wait(), 0)
    assert "--" not in str(refused.value)  # it is told in the window too
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("there", ["out.stl", "out.json", "out.pvd", "out"])
def test_what_is_there_already_is_not_written_over(there: str, taps, tmp_path) -> None:
    (tmp_path / there).write_text("mine")
    asked = {"at": 0.1} if there in ("out.stl", "out.json") else {"every": 0.1}
    with pytest.raises(Refusal, match="already exists"):
        ExportRequest(taps[0], tmp_path / ("out.stl" if "at" in asked else "out.pvd"), **asked)
    assert (tmp_path / there).read_text() == "mine"


def test_a_recording_that_is_none_is_refused(tmp_path) -> None:
    (tmp_path / "rec.mcap").write_bytes(b"no recording")
    for path in (tmp_path / "rec.mcap", tmp_path / "nowhere.mcap"):
        with pytest.raises(Refusal, match="expected a recording"):
            export(path, tmp_path / "out.csv")


def test_a_recording_without_settings_is_refused(tmp_path) -> None:
    recorded(tmp_path / "rec.mcap", steps=())
    with pytest.raises(Refusal, match="without settings, so no frame was computed; record for lon"):
        export(tmp_path / "rec.mcap", tmp_path / "out.csv")


def test_damage_in_the_middle_is_refused_and_leaves_nothing(taps, tmp_path) -> None:
    with Recording(taps[0]) as recording:
        at = recording.chunks[len(recording.chunks) // 2].at
    data = bytearray(taps[0].read_bytes())
    data[at + 200] ^= 0xFF
    (tmp_path / "rec.mcap").write_bytes(data)
    with (
        pytest.raises(Refusal, match=r"is damaged at byte \d+ .*repair"),
        ExportTask(ExportRequest(tmp_path / "rec.mcap", tmp_path / "out.npz")) as work,
    ):
        deque(work.wait(), 0)
    assert [path.name for path in tmp_path.iterdir()] == ["rec.mcap"]


def test_a_recording_that_breaks_off_is_exported_up_to_there(taps, tmp_path) -> None:
    with Recording(taps[0]) as recording:
        messages = list(recording.messages())
    with (tmp_path / "rec.mcap").open("wb") as file:  # the first half, and no end
        writer = Writer(file)
        writer.start("ros2", recording.library)
        numbers = {}
        for name, kind in TOPICS:
            schema = writer.register_schema(kind.name, "ros2msg", kind.definition)
            numbers[name] = writer.register_channel(name, "cdr", schema)
        for got in messages[: len(messages) // 2]:
            writer.add_message(numbers[got.topic], got.stamp, got.data, got.stamp)
        writer.flush()
        file.write(b"\x06 the next chunk, cut off")
    done = export(tmp_path / "rec.mcap", tmp_path / "out.npz")
    assert not done.whole
    assert 0 < done.written < len(taps[1])
    assert about_in(tmp_path / "out.npz")["ended_properly"] is False


def test_a_full_disk_is_told_of(taps, tmp_path) -> None:
    script = (
        "import resource, sys; from pathlib import Path; from kappaskin import Refusal\n"
        "from kappaskin.recording import ExportRequest\n"
        "from kappaskin.recording.export.writing import export_steps\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))\n"
        "recording, *places = map(Path, sys.argv[1:])\n"
        "for to in places:\n"
        "    at = 0.1 if to.suffix in ('.vtp', '.stl') else None\n"
        "    try: list(export_steps(ExportRequest(recording, to, at=at), to.parent))\n"
        "    except Refusal as refusal: print(refusal)\n"
    )
    suffixes = (".csv", ".npz", ".h5", ".vtp", ".stl")
    suffixes += (".parquet", ".lerobot") * bool(find_spec("pyarrow"))
    suffixes += (".rrd",) * bool(find_spec("rerun"))
    places = [tmp_path / f"out{suffix}" for suffix in suffixes]
    command = [sys.executable, "-c", script, *map(str, [taps[0], *places])]
    # What coverage measures would find no room either.
    env = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE")}
    found = subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=False, env=env
    )
    why = "cannot be written (File too large); choose another place"
    assert found.stdout.splitlines() == [f"{place}: {why}" for place in places], found.stderr
    # Rerun's own log, of its modules re_..., goes there too.
    errors = [line for line in found.stderr.splitlines() if "re_" not in line]
    assert (found.returncode, errors) == (0, [])


@pytest.mark.parametrize(
    ("suffix", "module", "extra"),
    [
        (".h5", "h5py", "hdf5"),
        (".parquet", "pyarrow", "parquet"),
        (".lerobot", "pyarrow", "parquet"),
        (".rrd", "rerun", "rerun"),
    ],
)
def test_without_its_package_the_line_that_installs_it_is_told(
    suffix: str, module: str, extra: str, taps, tmp_path, monkeypatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(Refusal, match=rf"needs {module}: pip install 'kappaskin\[{extra}\]'"):
        export(taps[0], tmp_path / f"out{suffix}")


# Presets, and what is known before.


CONTACT = [
    *("time [s]", "present", "single", "near_rim", "position_x [m]", "position_y [m]"),
    *("position_sd_x [m]", "position_sd_y [m]", "force [N]", "force_sd [N]"),
    *("displacement [m]", "displacement_sd [m]"),
]


def test_by_default_a_table_has_contact_and_force_in_12_columns(taps, tmp_path) -> None:
    recording, told = taps
    export_steps_done = [*export_steps(ExportRequest(recording, tmp_path / "a.csv"), tmp_path)]
    assert export_steps_done[-1].written == len(told)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    head, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    assert head == CONTACT
    found = np.array(rows, float)
    force = np.array([one.estimate.contact.force for one in told])
    assert np.isfinite(force).any()
    np.testing.assert_array_equal(found[:, 8].astype("<f4"), force.astype("<f4"))
    np.testing.assert_allclose(found[:, 8], force, rtol=2**-24)
    np.testing.assert_array_equal(found[:, 1], [one.estimate.contact.present for one in told])
    times = np.array([one.frame.host_time for one in told]) - 1000.0
    np.testing.assert_allclose(found[:, 0], times, atol=1e-9)


@pytest.mark.parametrize("preset", ["contact", "readings", "everything"])
def test_parquet_has_the_columns_numbers_and_metadata_of_a_csv(preset: str, taps, tmp_path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    export(taps[0], tmp_path / "a.csv", preset=preset)
    export(taps[0], tmp_path / "b" / "a.parquet", preset=preset)
    table = parquet.read_table(tmp_path / "b" / "a.parquet")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    head, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    assert table.column_names == head
    assert "counts_xx_0" in head or preset == "contact"
    assert table.num_rows == len(taps[1])
    found = np.array([column.to_numpy().astype(float) for column in table.columns]).T
    single = [str(kind) == "float" for kind in table.schema.types]
    read = np.array(rows, float)
    read[:, single] = read[:, single].astype("<f4")
    np.testing.assert_array_equal(found, read)
    said = {name.decode(): value.decode() for name, value in table.schema.metadata.items()}
    assert json.loads(said["device"]) == about_in(tmp_path / "a.csv")["device"]
    assert json.loads(said["columns"])["time"] == "arrival time since the recording began"


STATE = {
    "present": [""],
    "position": ["m", "m"],
    "position_sd": ["m", "m"],
    "force": ["N"],
    "force_sd": ["N"],
    "displacement": ["m"],
    "displacement_sd": ["m"],
}
"""Numbers of a contact in a data set, with the units of each."""


def read_lerobot(folder: Path) -> tuple[dict[str, np.ndarray], dict, dict]:
    """Columns of the episode, `info.json` and statistics, checked against each other."""
    parquet, arrow = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow")
    info, statistics = (
        json.loads((folder / "meta" / name).read_text(), parse_constant=pytest.fail)  # NaN: no JSON
        for name in ("info.json", "stats.json")
    )
    assert info["codebase_version"] == "v3.0"
    first = {"chunk_index": 0, "file_index": 0}
    files = [folder / info["data_path"].format(**first)]
    assert list((folder / "data").rglob("*.parquet")) == files
    tasks = parquet.read_table(folder / "meta" / "tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    (task,) = tasks.to_pylist()
    episodes = list((folder / "meta" / "episodes").rglob("*.parquet"))
    assert [path.name for path in episodes] == ["file-000.parquet"]
    (episode,) = parquet.read_table(episodes[0]).to_pylist()
    table = parquet.read_table(files[0])
    assert table.column_names == [*info["features"]] == [*statistics]
    found = {}
    for name, feature in info["features"].items():
        (count,) = feature["shape"]
        kind = arrow.from_numpy_dtype(np.dtype(feature["dtype"]))
        assert table.schema.field(name).type == (kind if count == 1 else arrow.list_(kind, count))
        assert feature["names"] is None or len(feature["names"]) == count
        found[name] = each = np.array(table[name].to_pylist()).reshape(-1, count)
        said = statistics[name]
        assert {key: episode.pop(f"stats/{name}/{key}") for key in said} == said
        for what in ("min", "max", "mean", "std"):
            of = getattr(each.astype(float), what)(axis=0)
            np.testing.assert_allclose(said[what], of, rtol=1e-9, atol=1e-12)
        assert said["count"] == [table.num_rows]
    rows = np.arange(info["total_frames"])[:, None]
    count = table.num_rows
    assert episode == {
        **{"episode_index": 0, "tasks": [task["task"]], "length": count},
        **{"dataset_from_index": 0, "dataset_to_index": count},
        **{f"{of}/{name}": n for of in ("data", "meta/episodes") for name, n in first.items()},
    }
    assert (info["total_episodes"], info["total_tasks"], task["task_index"]) == (1, 1, 0)
    for name in ("frame_index", "index"):
        np.testing.assert_array_equal(found[name], rows)
    assert not found["episode_index"].any()
    assert not found["task_index"].any()
    np.testing.assert_allclose(found["timestamp"], rows / info["fps"], rtol=1e-6)
    return found, info, statistics


@pytest.mark.parametrize(
    ("every", "begin", "fps"), [(0.0, 0.0, 100), (0.04, 0.013, 25), (0.004, 0.0, 250)]
)
def test_a_lerobot_row_has_the_newest_estimate_by_then(every, begin, fps, taps, tmp_path) -> None:
    recording, told = taps
    done = export(recording, tmp_path / "out.lerobot", every=every, begin=begin)
    found, info, _ = read_lerobot(tmp_path / "out.lerobot")
    came = np.array([one.frame.host_time - 1000.0 for one in told])
    taken = [one for one, at in zip(told, came, strict=True) if at >= begin - 1e-9]
    came = came[-len(taken) :]
    assert (info["fps"], done.written) == (fps, len(taken))
    assert info["total_frames"] == math.floor((came[-1] - came[0]) * fps + 1e-3) + 1
    rows = came[0] + np.arange(info["total_frames"]) / fps
    newest = [int(np.flatnonzero(came <= at + 1e-8)[-1]) for at in rows]
    np.testing.assert_allclose(found["recorded_time"][:, 0], came[newest], atol=1e-6)
    want = [
        np.hstack([np.ravel(getattr(taken[n].estimate.contact, name)) for name in STATE])
        for n in newest
    ]
    known = np.isfinite(want)
    assert known.all(axis=1).any()
    assert not known.all()  # of no contact there is no place
    np.testing.assert_array_equal(found["known.state"], known)
    state = np.where(known, want, 0).astype("<f4")
    np.testing.assert_array_equal(found["observation.state"], state)
    features = info["features"]
    assert features["observation.state"]["units"] == [u for units in STATE.values() for u in units]
    assert features["observation.state"]["names"][:3] == ["present", "position_x", "position_y"]
    readings = np.array([taken[n].estimate.curvature.ravel() for n in newest]).astype("<f4")
    np.testing.assert_array_equal(found["observation.readings"], readings)
    assert found["known.readings"].all()
    assert features["observation.readings"]["names"][1] == "curvature_xx_1"
    assert set(features["observation.readings"]["units"]) == {"1/m"}
    about = json.loads((tmp_path / "out.lerobot" / "meta" / "kappaskin.json").read_text())
    assert about["recording"] == "taps.mcap"
    assert "newest frame" in about["resampled"]
    with pytest.raises(Refusal, match="already exists"):
        ExportRequest(recording, tmp_path / "out.lerobot")


def test_a_lerobot_data_set_is_the_same_in_any_blocks(taps, tmp_path, monkeypatch) -> None:
    for folder, size in (("a", LeRobotFolder.block), ("b", 1), ("c", 2**14)):
        monkeypatch.setattr(LeRobotFolder, "block", size)
        export(taps[0], tmp_path / folder / "out.lerobot", every=0.004)
    a, b, c = (read_lerobot(tmp_path / folder / "out.lerobot")[0] for folder in "abc")
    for name, values in a.items():
        np.testing.assert_array_equal(values, b[name])
        np.testing.assert_array_equal(values, c[name])


def test_frames_that_come_in_bursts_have_their_median_rate() -> None:
    at = np.arange(2000) // 10 * 0.01  # ten at once
    assert _rate(at) == 1000
    assert _rate(np.concatenate([at, at + 60.0])) == 1000  # a minute's pause
    assert _rate(at[:1]) == _rate(at[:2]) == 1


def test_readings_are_counts_and_corrected_readings(taps, tmp_path) -> None:
    export(taps[0], tmp_path / "a.npz", preset="readings")
    found = columns_in(tmp_path / "a.npz")
    assert set(found) == {"time", "sequence", "device_time", "counts", "curvature"}
    was = np.array([one.estimate.curvature for one in taps[1]])
    np.testing.assert_array_equal(found["curvature"], was.astype("<f4"))
    device = [one.estimate.device_time for one in taps[1]]
    np.testing.assert_array_equal(found["device_time"], device)  # in double precision, as times are


@pytest.fixture(scope="module")
def long(tmp_path_factory) -> Path:
    """Some 2,400 frames, more than a forecast looks at."""
    path = tmp_path_factory.mktemp("long") / "long.mcap"
    recorded(path, seconds=24.0)
    return path


@pytest.mark.cases("csv-asked1", "csv-asked2", "npz", "pvd", "vtp")
@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("a.csv", {}),
        ("a.csv", {"begin": 12.0}),
        ("a.csv", {"every": 0.05}),
        ("a.npz", {"preset": "everything"}),
        ("a.pvd", {"every": 1.0}),
        ("a.vtp", {"at": 1.0}),
    ],
)
def test_size_and_frames_are_known_before(name: str, asked: dict, long, tmp_path) -> None:
    request = ExportRequest(long, tmp_path / name, **asked)
    with ForecastTask(request) as task:
        *_, forecast = task.wait()
    assert not list(tmp_path.iterdir())
    with ExportTask(request) as exporting:
        *_, done = exporting.wait()
    files = [file for file in tmp_path.rglob("*") if file.is_file()]
    size = sum(file.stat().st_size for file in files)
    assert forecast.frames == pytest.approx(done.written, rel=0.03, abs=1)
    assert forecast.size == pytest.approx(size, rel=0.25)
    assert forecast.seconds > 0


def test_a_period_of_five_frames_takes_every_fifth(long, tmp_path) -> None:
    export(long, tmp_path / "a.npz", every=0.05, preset="contact")
    times = columns_in(tmp_path / "a.npz")["time"]
    np.testing.assert_allclose(np.diff(times), 0.05, atol=1e-6)


def test_a_forecast_of_what_cannot_be_written_is_refused(taps, tmp_path) -> None:
    with (
        pytest.raises(Refusal, match="cannot be written"),
        ForecastTask(ExportRequest(taps[0], tmp_path / "no" / "a.csv")) as task,
    ):
        deque(task.wait(), 0)


# The command.


def test_the_command_names_what_it_wrote(taps, run, tmp_path) -> None:
    span = ("--from", 0.1, "--until", 0.2)
    code, out, err = run("export", taps[0], "--to", tmp_path / "out.csv", *span)
    assert code == 0
    assert out.split() == [str(tmp_path / "out.csv")]
    assert re.fullmatch(r"1\d frames\n", err)
    code, out, _ = run("export", taps[0], "--to", tmp_path / "skin.stl", "--every", 0.2)
    assert out.split() == [str(tmp_path / "skin"), str(tmp_path / "skin.json")]


def test_the_command_refuses_with_its_own_code(taps, run, tmp_path) -> None:
    code, out, err = run("export", taps[0], "--to", tmp_path / "out.txt")
    assert (code, out) == (2, "")
    assert "ends in one of" in err


def test_ctrl_c_stops_the_command_and_leaves_nothing(taps, run, tmp_path, monkeypatch) -> None:
    def interrupted(self: ExportTask):
        yield 0.5
        raise KeyboardInterrupt

    monkeypatch.setattr(ExportTask, "wait", interrupted)
    code, _, err = run("export", taps[0], "--to", tmp_path / "out.csv")
    assert code == 2
    assert "nothing was written" in err
    assert not list(tmp_path.iterdir())


def test_ctrl_c_while_it_begins_leaves_nothing(taps, tmp_path, monkeypatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("kappaskin._processes.BackgroundProcess.__init__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        ExportTask(ExportRequest(taps[0], tmp_path / "out.csv"))
    assert not list(tmp_path.iterdir())
