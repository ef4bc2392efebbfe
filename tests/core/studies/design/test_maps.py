"""How surely each place of a mesh is felt: by the command, and in its files."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Plate, Refusal, Scene, SensorLayout
from kappaskin.bases import basis_for
from kappaskin.cli import main
from kappaskin.contact import PointContact
from kappaskin.estimation import place_elements
from kappaskin.mechanics import DiscLoad
from kappaskin.scenes import Stimulus, write_scene
from kappaskin.scenes.effects import GaussianNoise
from kappaskin.skin import MeshSkin
from kappaskin.studies import Design, design_maps, prospect, write_maps
from meshes import ellipsoid


@pytest.fixture(scope="module")
def scene():
    mesh = MeshSkin(*ellipsoid(18, (9e-3, 7e-3, 6e-3), math.radians(70)), 1e-3)
    plate, layout = Plate(mesh, 9e-5), SensorLayout.spread(mesh, 30)
    scene = Scene("pad", plate, layout, effects=(GaussianNoise(0.3),), edge="clamped")
    return scene.touched_by(DiscLoad(mesh.a / 2, mesh.b / 2, 1e-3, 0.1))


@pytest.fixture(scope="module")
def maps(scene):
    return design_maps(scene, (6, 6), ("scene", "A"))


def test_a_map_of_a_mesh_has_a_value_at_each_node(scene, maps):
    mesh = scene.plate.patch
    for of, found in maps["scene"].items():
        assert found.sd.shape == (len(mesh.nodes),)
        near_rim = mesh.depth(mesh.places) < 1e-3
        assert np.isnan(found.sd[near_rim]).all() == (of != "displacement")
        assert np.isfinite(found.sd[mesh.depth(mesh.places) > 1.2e-3]).all()


def test_optimal_elements_are_nodes_apart_and_determine_the_shape_better(scene, maps):
    mesh, found = scene.plate.patch, maps["A"]["displacement"]
    points = mesh.at_rest(found.positions)[0]
    away = np.linalg.norm(points[:, None] - points, axis=-1) + np.eye(len(points))

    assert len(points) == 30
    assert away.min() > 0.35 * math.sqrt(mesh.areas.sum() / 30)
    assert found.rms < 0.9 * maps["scene"]["displacement"].rms


def test_the_error_falls_with_the_noise_but_not_by_as_much(scene, maps):
    once = maps["scene"]["contact"].median
    quiet = replace(scene, effects=(GaussianNoise(0.15),))
    # The share of the readings by which a mesh is inexact weighs more where there is less noise.
    assert 0.5 * once < prospect(Design(quiet, (6, 6)), "contact").median < 0.8 * once


def test_a_place_without_room_is_refused(scene):
    basis = basis_for(scene.plate.patch, "clamped", 6, 6)
    with pytest.raises(Refusal, match="spacing that leaves"):
        place_elements(scene.layout, basis, "D", 6e-3)


def test_a_coloured_mesh_has_its_nodes_and_the_errors(scene, maps, tmp_path):
    file, mesh = tmp_path / "felt.ply", scene.plate.patch
    write_maps(file, mesh, maps)
    head, body = file.read_text().split("end_header\n")
    rows = [line.split() for line in body.splitlines()]
    columns = [line.split()[-1] for line in head.splitlines() if line.startswith("property")]
    values = np.array(rows[: len(mesh.nodes)], float)

    assert np.allclose(values[:, :3], mesh.nodes, atol=1e-8)
    assert np.allclose(
        values[:, columns.index("force_A")], maps["A"]["force"].sd, rtol=1e-5, equal_nan=True
    )
    assert np.array(rows[len(mesh.nodes) :], int)[:, 1:].tolist() == mesh.triangles.tolist()
    worst, best = (int(of(maps["scene"]["contact"].sd)) for of in (np.nanargmax, np.nanargmin))
    assert values[worst, 3:6].tolist() == [253, 231, 37]
    assert values[best, 3:6].tolist() == [68, 1, 84]


@pytest.mark.parametrize("ending", ["csv", "npz"])
def test_the_command_prints_a_row_for_each_placement_and_writes_a_map(
    scene, tmp_path, capsys, ending
):
    written, out = tmp_path / "pad.scene.toml", tmp_path / f"felt.{ending}"
    written.write_text(write_scene(scene))
    options = ["--basis", "6x6", "--place", "scene", "A", "--json"]

    assert main(["design", str(written), *options, "--out", str(out)]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["placement"] for row in rows] == ["scene", "A"]
    assert all(0 < row["contact_median"] < row["contact_worst"] < 1e-3 for row in rows)
    n = len(scene.plate.patch.nodes)
    if ending == "csv":
        assert len(out.read_text().splitlines()) == 1 + n
    else:
        assert np.load(out)["force A"].shape == (n,)


def test_a_file_of_another_kind_or_no_noise_is_refused(scene, maps, tmp_path):
    with pytest.raises(Refusal, match="ends in"):
        write_maps(tmp_path / "felt.txt", scene.plate.patch, maps)
    with pytest.raises(Refusal, match="noise that counts"):
        design_maps(replace(scene, effects=()), (6, 6), ("scene",))


def test_elements_placed_for_contacts_determine_force_and_place_better(scene, maps):
    placed = design_maps(scene, (6, 6), ("contact",))["contact"]

    assert len(placed["contact"].positions) == 30
    left = {by: [placed[of].rms / maps[by][of].rms for of in ("contact", "force")] for by in maps}
    assert max(*left["A"], *left["scene"]) < 1
    assert np.sum(np.square(left["scene"])) < 2 * 0.92


def test_what_elements_tell_of_a_load_adds_up_to_its_covariance(scene):
    load, noise = scene.loads[0], 3.0  # so much that no reading is taken for inexact
    find = PointContact(scene.plate, scene.layout, scene.edge)
    about = load.x, load.y, load.radius**2, load.force, noise

    W = find.information(*about).sum(axis=0)
    W[-1, -1] += 1.0
    force = np.array([load.force, 1.0, 1.0])
    found = np.linalg.inv(W)[:3, :3] * np.multiply.outer(force, force)

    np.testing.assert_allclose(found, find.covariance(*about), rtol=1e-2, atol=1e-12)


def test_an_error_has_a_median_where_most_of_the_skin_is_near_its_rim(scene):
    wide = scene.touched_by(replace(scene.loads[0], radius=2.2e-3))
    found = prospect(Design(wide, (6, 6)), "contact")

    assert np.isfinite(found.sd).sum() < 0.4 * len(found.sd)
    assert np.nanmin(found.sd) < found.median < found.worst


def test_errors_on_a_grid_are_those_between_the_nodes(scene, maps):
    mesh, found = scene.plate.patch, maps["scene"]["contact"]
    linear = replace(found, sd=np.where(np.isfinite(found.sd), 1.0 + 50 * found.x, np.nan))

    grid = linear.surface(mesh, 41, 31)

    x, y = np.meshgrid(*mesh.grid(41, 31))
    known, depth = np.isfinite(grid), mesh.depth(np.stack([x, y], -1).reshape(-1, 2))
    inside = depth.reshape(x.shape) > 1.5e-3
    np.testing.assert_allclose(grid[inside], 1 + 50 * x[inside], rtol=1e-9)
    np.testing.assert_allclose(grid[known], 1 + 50 * x[known], atol=0.03)
    assert not known.ravel()[depth < 0.5e-3].any()


def test_a_scene_of_several_loads_alike_is_predicted_as_with_one(scene, maps):
    first = scene.loads[0]
    touches = (Stimulus(first), Stimulus(replace(first, x=first.x + 1e-3)))
    other = (touches[0], Stimulus(replace(first, force=0.2)))

    found = prospect(Design(replace(scene, stimuli=touches), (6, 6)), "force")
    assert found.rms == maps["scene"]["force"].rms
    with pytest.raises(Refusal, match="some alike"):
        prospect(Design(replace(scene, stimuli=other), (6, 6)), "force")
