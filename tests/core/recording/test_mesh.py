"""Recordings of a skin on a mesh: verified, repaired, replayed and exported without its file."""

import json
from contextlib import closing

import h5py
import numpy as np
import pytest
import trimesh

from kappaskin import Pipeline, Setup
from kappaskin.recording import (
    ExportRequest,
    Recorder,
    Recording,
    Repaired,
    ReplayedSource,
    Verification,
)
from kappaskin.recording.export.writing import export_steps
from kappaskin.scenes import read_scene
from kappaskin.sources import SimulatedSource, VirtualClock
from meshes import ellipsoid, obj

pytestmark = pytest.mark.slow

TEXT = """
format = 1
rate = 100.0

[skin]
shape = "mesh"
file = "pad.obj"
unit = "mm"
thickness = 1e-3
rigidity = 9e-5
edge = "clamped"

[elements]
spread = 30

[[touch]]
what = "disc"
x = 9e-3
y = 7e-3
radius = 1e-3
force = 0.1
path = [
    { step = "press", seconds = 0.1 },
    { step = "hold", seconds = 1.0 },
    { step = "release", seconds = 0.1 },
]
"""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record(tmp_path_factory.mktemp("mesh"), TEXT)


def record(folder, text):
    """The path of a recording, its scene, and the estimates that were made then."""
    file = folder / "pad.obj"
    nodes, triangles = ellipsoid(18, (9e-3, 7e-3, 6e-3), 1.2)
    file.write_text(obj(1e3 * nodes, triangles))
    scene = read_scene(text, folder / "scene.toml")
    file.unlink()
    clock = VirtualClock(1000.0)
    source = SimulatedSource(scene, clock, clock.sleep)
    pipeline, made = Pipeline(source.sensor, Setup(Ni=6, Nj=6, nx=17, ny=17)), []
    with closing(Recorder(folder / "pad.mcap", clock())) as recorder:
        source.record(recorder)
        recorder.set_up(pipeline)
        while clock.now < 1000.2:
            for frame in source.read(0.1):
                made.append(pipeline(frame))
                recorder.take(frame, made[-1])
    return folder / "pad.mcap", scene, made


def test_a_contact_on_the_mesh_is_found_and_verified(recorded):
    path, _, made = recorded
    assert made[-1].contact.force == pytest.approx(0.1, rel=0.1)
    assert np.abs(made[-1].contact.position - (9e-3, 7e-3)).max() < 3e-4
    *_, verdict = Verification.steps(path)
    assert verdict.same
    assert verdict.compared > len(made)


def test_gages_of_other_directions_find_the_same_contact(recorded, tmp_path):
    text = TEXT.replace("spread = 30", 'spread = 30\nalong = "principal"')
    path, scene, made = record(tmp_path, text)
    assert np.ptp(scene.layout.turns) > 1
    one, other = made[-1].contact, recorded[2][-1].contact
    assert one.force == pytest.approx(other.force, rel=0.02)
    assert np.abs(one.position - other.position).max() < 5e-5
    *_, verdict = Verification.steps(path)
    assert verdict.same


def test_a_repaired_recording_has_the_mesh(recorded, tmp_path):
    path, scene, _ = recorded
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:-3000])
    *_, done = Repaired.steps(tmp_path / "cut.mcap", tmp_path / "whole.mcap")
    assert done.total
    with (
        Recording(tmp_path / "whole.mcap"),
        closing(ReplayedSource(tmp_path / "whole.mcap")) as source,
    ):
        source.read(0.1)
        assert source.sensor.plate == scene.plate


def test_a_replay_is_on_the_mesh(recorded):
    path, scene, made = recorded
    clock = VirtualClock(0.0)
    with closing(ReplayedSource(path, clock, clock.sleep)) as source:
        frames = source.read(0.1)
        assert source.sensor.plate == scene.plate
        again = Pipeline(source.sensor, Setup(Ni=6, Nj=6, nx=17, ny=17))(frames[0])
    np.testing.assert_array_equal(again.coefficients, made[0].coefficients)


def exported(path, to, **asked):
    *_, _ = export_steps(ExportRequest(path, to, **asked), to.parent)
    return to


@pytest.mark.parametrize("suffix", ["csv", "npz", "h5", "parquet"])
def test_tables_have_a_row_for_each_frame(recorded, tmp_path, suffix):
    pytest.importorskip({"parquet": "pyarrow"}.get(suffix, "numpy"))
    path, scene, made = recorded
    to = exported(path, tmp_path / f"a.{suffix}")
    force = [one.contact.force for one in made]
    if suffix == "npz":
        with np.load(to) as file:
            assert file["force"] == pytest.approx(force, nan_ok=True)
            device = json.loads(str(file["about"]))["device"]
    elif suffix == "h5":
        with h5py.File(to) as file:
            assert file["force"][:] == pytest.approx(force, nan_ok=True)
            device = json.loads(file.attrs["device"])
    elif suffix == "csv":
        (line,) = (line for line in to.read_text().splitlines() if line.startswith("# device: "))
        device = json.loads(line.removeprefix("# device: "))
    else:
        assert scene.plate.patch.text.encode() in to.read_bytes()
        return
    assert device["mesh"] == scene.plate.patch.text


def test_surfaces_have_the_triangles_of_the_mesh(recorded, tmp_path):
    pv = pytest.importorskip("pyvista")
    path, scene, made = recorded
    mesh = scene.plate.patch
    surface = pv.read(exported(path, tmp_path / "a.vtp", at=0.15))
    assert np.array_equal(surface.regular_faces, mesh.triangles)
    deepest = surface["displacement [m]"].argmax()
    contact = made[-1].contact
    step = np.sqrt(mesh.areas.mean())
    assert np.abs(mesh.places[deepest] - contact.position).max() < 2 * step
    assert surface["displacement [m]"][deepest] == pytest.approx(contact.displacement, rel=0.2)
    glb = trimesh.load(exported(path, tmp_path / "a.glb"), force="mesh")
    assert np.array_equal(glb.faces, mesh.triangles)
    assert np.abs(glb.vertices[:, [0, 2, 1]] * (1, -1, 1) - surface.points).max() < 1e-4
