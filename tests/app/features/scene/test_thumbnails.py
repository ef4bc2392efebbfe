"""The thumbnails of the ready scenes: of which they are, and what they show of the skin."""

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PySide6.QtCore import QSize

from kappaskin import Disk, PointLoad, Polygon, SensorLayout, load_scene
from kappaskin.scenes import SCENES, scene_file

SIZE = QSize(96, 60)
SCRIPT = Path(__file__).parents[3] / "scene_thumbnails.py"
_MADE = runpy.run_path(str(SCRIPT))
picture, relief, THUMBNAILS = _MADE["picture"], _MADE["relief"], _MADE["THUMBNAILS"]


@pytest.fixture(scope="module")
def reliefs():
    return {name: relief(load_scene(name)) for name in SCENES}


def dots(image) -> np.ndarray:
    rows = np.frombuffer(image.constBits(), np.uint8)
    return rows.reshape(image.height(), image.width(), 4).copy()


def test_every_ready_scene_has_a_thumbnail_of_what_its_file_is_now():
    assert {file.name for file in THUMBNAILS.iterdir()} == {f"{name}.png" for name in SCENES}
    stale = [name for name in SCENES if shipped(name).text["scene"] != _MADE["digest"](name)]
    assert stale == [], f"run {SCRIPT.name}"


def test_a_thumbnail_is_a_few_kilobytes_and_larger_than_a_card():
    for name in SCENES:
        assert 1_000 < (THUMBNAILS / f"{name}.png").stat().st_size < 16_000, name
        assert shipped(name).size == (320, 202), name


@pytest.mark.cases("sphere", "fingertip")
@pytest.mark.parametrize("name", SCENES)
def test_a_thumbnail_is_what_the_script_draws(name: str, reliefs, colours_of):
    drawn = dots(picture(reliefs[name])).astype(float)
    assert colours_of(drawn[..., :3].astype(np.uint8)) > 300
    kept = np.asarray(shipped(name).convert("RGBA"))[..., [2, 1, 0, 3]].astype(float)
    kept[..., :3] *= kept[..., 3:] / 255
    assert np.abs(drawn - kept).mean() < 3


def test_a_scene_has_another_digest_once_its_file_or_one_it_names_changes(tmp_path, monkeypatch):
    folder = scene_file("coin").parent
    for file in ("coin.toml", "coin.png", "bolt.ply"):
        (tmp_path / file).write_bytes((folder / file).read_bytes())
    digest = _MADE["digest"]
    monkeypatch.setitem(digest.__globals__, "scene_file", lambda name: tmp_path / f"{name}.toml")
    known = {digest("coin")}
    (tmp_path / "bolt.ply").write_bytes(b"another")
    assert {digest("coin")} == known
    for file in ("coin.toml", "coin.png"):
        (tmp_path / file).write_bytes((folder / file).read_bytes() + b"\n")
        assert digest("coin") not in known
        known.add(digest("coin"))


def shipped(name: str) -> Image.Image:
    with Image.open(THUMBNAILS / f"{name}.png") as image:
        image.load()
        return image


def test_scenes_that_press_differently_look_different(reliefs):
    names = ("sphere", "pencil", "tapping", "two-contacts", "fingertip", "circle", "calibration")
    pictures = [dots(picture(reliefs[name], SIZE, 1.0)) for name in names]
    for k, one in enumerate(pictures):
        for other in pictures[:k]:
            assert (one != other).any(axis=-1).mean() > 0.03


def test_a_finer_screen_gets_more_dots_of_the_same_picture(reliefs):
    coarse = picture(reliefs["sphere"], SIZE, 1.0)
    fine = picture(reliefs["sphere"], SIZE, 2.0)
    assert (fine.width(), fine.height(), fine.devicePixelRatio()) == (192, 120, 2.0)
    shrunk = dots(fine).reshape(60, 2, 96, 2, 4).mean(axis=(1, 3))
    assert np.abs(shrunk - dots(coarse)).mean() < 6
    assert picture(reliefs["sphere"], SIZE, 1.25).width() == 120


def test_a_skin_is_deepest_where_it_is_pressed(reliefs):
    made = reliefs["off-centre"]
    x, y, z = made.points[np.argmax(made.share)]
    assert np.hypot(x - 20, y - 80) < 15
    assert z == made.points[:, 2].min()
    assert made.share.max() == pytest.approx(1.0)
    np.testing.assert_allclose(made.arrows[0, :, :2], [(20, 80), (20, 80)], atol=1e-9)
    assert made.arrows[0, 0, 2] > made.arrows[0, 1, 2]  # it points inwards


def test_a_fingertip_is_drawn_bent(reliefs):
    assert np.ptp(reliefs["fingertip"].points[:, 2]) > 10  # mm: a half circle of 12.9 mm


def test_a_way_is_drawn_where_the_touch_goes(reliefs):
    (ring,) = reliefs["circle"].paths
    away = np.linalg.norm(ring.points[:, :2] - 50, axis=1)
    np.testing.assert_allclose(away, 22, atol=1e-6)
    assert not reliefs["tapping"].paths
    assert len(reliefs["two-contacts"].paths) == 1
    assert len(reliefs["two-contacts"].arrows) == 2


def test_an_object_is_seen_along_where_it_bears(reliefs):
    (rod,) = reliefs["pencil"].outlines
    assert np.ptp(rod.points[:, 0]) > 40  # mm
    assert not reliefs["sphere"].outlines


def test_dead_elements_are_left_out(reliefs):
    assert len(reliefs["failing-elements"].elements.points) == 98


@pytest.mark.parametrize(
    "patch",
    [
        Disk(0.05),
        Polygon([(0, 0), (0.1, 0), (0.1, 0.04), (0.04, 0.04), (0.04, 0.1), (0, 0.1)]),
    ],
    ids=["disk", "polygon"],
)
def test_a_skin_ends_at_its_outline(patch):
    scene = load_scene("centre")
    middle = (0.05, 0.05) if isinstance(patch, Disk) else (0.03, 0.03)
    layout = SensorLayout.scattered(patch, [middle])
    load = PointLoad(*middle, 0.1)
    scene = replace(
        scene.touched_by(), plate=replace(scene.plate, patch=patch), layout=layout, reference=(6, 6)
    )
    made = relief(scene.touched_by(load))
    used = np.unique(made.faces)
    assert patch.contains(made.points[used, :2] / 1e3).mean() > 0.99
    drawn = picture(made, SIZE, 1.0)
    assert not drawn.isNull()


def test_a_skin_that_nothing_touches_is_flat():
    made = relief(load_scene("centre").touched_by())
    assert np.ptp(made.points[:, 2]) == 0
    assert not made.share.any()
    assert not picture(made, SIZE, 1.0).isNull()


def test_a_pull_lifts_the_skin_and_its_arrow_points_outwards():
    made = relief(load_scene("centre").touched_by(PointLoad(0.05, 0.05, -0.1)))
    assert made.points[:, 2].max() > 5
    assert made.arrows[0, 0, 2] < made.arrows[0, 1, 2]
