"""Sensors on meshes: what devices send of them, and descriptions beside the file of a mesh."""

import math

import numpy as np
import pytest

from kappaskin import Plate, Refusal, SensorLayout
from kappaskin.errors import SourceError
from kappaskin.sensing import DigitalReadings, Sensor
from kappaskin.skin import MeshSkin
from kappaskin.sources import load_description, sensor_from_json, sensor_to_json
from kappaskin.sources.description import description_of, of_values
from kappaskin.sources.wire import LONGEST
from meshes import ellipsoid, obj

AXES = 9e-3, 7e-3, 6e-3
ANGLE = math.radians(70)
SKIN = """format = 1
[skin]
shape = "mesh"
file = "pad.obj"
unit = "mm"
thickness = 0.001
rigidity = 9e-5
[elements]
spread = 12
[line]
kind = "text"
id = "mine"
columns = ["xx:0..11", "yy:0..11"]
"""


def sensor_on(mesh):
    layout = SensorLayout.spread(mesh, 12).without([3])
    return Sensor(
        *(layout, DigitalReadings(), Plate(mesh, 9e-5), "clamped", 100.0, "pad", "1", "1", True)
    )


def test_a_device_sends_its_mesh():
    sensor = sensor_on(MeshSkin(*ellipsoid(18, AXES, ANGLE), 1e-3, np.arange(930, 980)))
    text = sensor_to_json(sensor)
    back = sensor_from_json(text)
    assert back.plate == sensor.plate
    assert np.array_equal(back.plate.patch.held, sensor.plate.patch.held)
    assert np.array_equal(back.plate.patch.points, sensor.plate.patch.points)
    assert np.array_equal(back.layout.live, sensor.layout.live)
    assert sensor_to_json(back) == text


def test_the_largest_mesh_fits_in_the_information(tmp_path):
    nodes, triangles = ellipsoid(57, AXES, ANGLE)
    assert 19_000 < len(triangles) <= 20_000
    draws = np.random.default_rng(0)
    order = draws.permutation(len(nodes))
    triangles = draws.permutation(np.argsort(order)[triangles])
    (tmp_path / "pad.obj").write_text(obj(1e3 * nodes[order], triangles))
    (tmp_path / "board.toml").write_text(SKIN)
    assert len(load_description(tmp_path / "board.toml").sensor.description) < 0.6 * LONGEST


def test_a_text_of_no_mesh_is_refused_by_the_device_and_its_description():
    text = sensor_to_json(sensor_on(MeshSkin(*ellipsoid(18, AXES, ANGLE), 1e-3)))
    begin = text.index('"mesh":"') + 8
    with pytest.raises(SourceError, match="expected the text of a mesh"):
        sensor_from_json(text[:begin] + text[begin + 40 :])


@pytest.fixture
def file(tmp_path):
    (tmp_path / "pad.obj").write_text(obj(1e3 * ellipsoid(18, AXES, ANGLE)[0], TRIANGLES))
    (tmp_path / "board.toml").write_text(SKIN)
    return tmp_path / "board.toml"


TRIANGLES = ellipsoid(18, AXES, ANGLE)[1]


def test_a_description_is_kept_with_its_mesh(file):
    found = load_description(file)
    (file.parent / "pad.obj").unlink()  # a recording is elsewhere

    sensor = found.sensor
    assert sensor.plate.patch.a == pytest.approx(2 * AXES[0] * math.sin(ANGLE))
    assert (sensor.serial_number, len(sensor.layout)) == ("mine", 12)
    assert sensor.layout.each_reads == ["curvature@0", "curvature@90"]
    for back in (
        sensor_from_json(sensor_to_json(sensor)),
        description_of(sensor.description, "board").sensor,
        of_values(found).sensor,
    ):
        assert back.plate == sensor.plate
        assert np.array_equal(back.layout.positions, sensor.layout.positions)


def test_a_description_is_kept_with_the_places_of_its_elements(file):
    rows = np.column_stack([1e3 * ellipsoid(18, AXES, ANGLE)[0][:12], np.tile([1, 1, 0], (12, 1))])
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    (file.parent / "elements.csv").write_text("\n".join(["x,y,z,dx,dy,dz", *lines]))
    names = '"curvature@0:0..11", "curvature@90:0..11"'
    text = SKIN.replace("spread = 12", 'file = "elements.csv"')
    file.write_text(text.replace('"xx:0..11", "yy:0..11"', names))
    found = load_description(file)
    (file.parent / "elements.csv").unlink()

    layout = found.sensor.layout
    assert layout.turns == pytest.approx(np.full(12, np.pi / 4), abs=0.05)
    assert layout.each_reads == ["curvature@0", "curvature@90"]
    back = sensor_from_json(sensor_to_json(found.sensor)).layout
    assert np.array_equal(back.reads.direction, layout.reads.direction)
    assert np.array_equal(back.positions, layout.positions)


@pytest.mark.parametrize(
    ("was", "now", "match"),
    [
        ("pad.obj", "../pad.obj", "line 4: skin.file: .*in the folder"),
        ("pad.obj", "pod.obj", "line 4: skin.file: .*does not exist"),
        ('unit = "mm"\n', "", "line 4: skin.file: .*expected its unit"),
        ("[line]", "[kept]\nelements = 1\n[line]", "kept.elements: expected"),
        ("[line]", "[kept.more]\n[line]", "kept.more: expected no such key"),
    ],
)
def test_a_description_of_no_mesh_is_refused(file, was, now, match):
    file.write_text(SKIN.replace(was, now))
    with pytest.raises(Refusal, match=match):
        load_description(file)


def test_a_description_without_its_mesh_is_refused():
    with pytest.raises(Refusal, match=r"line 4: skin.file: expected a description with its mesh"):
        description_of(SKIN, "board.toml")
