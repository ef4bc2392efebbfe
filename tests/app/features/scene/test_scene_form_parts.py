"""Parts of a scene, added and removed in its forms: what comes of it is a scene."""

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QComboBox, QToolButton

from kappaskin.scenes import PARTS, read_scene
from kappaskin.scenes.effects import EFFECTS
from kappaskin_app.features.scene import scene_text
from kappaskin_app.features.scene.scene_form import SceneForm
from kappaskin_app.features.scene.sections import Addition, Section, sections_of
from meshes import ellipsoid

from .conftest import TEXTS, TOUCHED, said_by

_PLAIN = """format = 1

[skin]
size = [0.1, 0.1]
"""


def _offers(section: Section) -> list[Addition]:
    each = [*section.offers, *section.more]
    found = [inner for offer in each for inner in (offer.inside or (offer,))]
    return found + [offer for part in section.sections for offer in _offers(part)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where the files are that parts name."""
    np.save(tmp_path / "heights.npy", np.add.outer(np.arange(8.0), np.arange(8.0)))
    (tmp_path / "motion.csv").write_text("time,dx,dy,amount\n0,0,0,0\n1,0,0,1\n2,0,0,0\n")
    corners = [(0, 0, 0), (0.15, 0, 0.1), (0, 0.15, 0.1), (0.15, 0.15, 0.2)]
    faces = [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corners[c]) for c in face)
        + "endloop\nendfacet\n"
        for face in faces
    )
    (tmp_path / "mesh.stl").write_text(f"solid a\n{facets}endsolid a\n")
    # In mm, with a rim from (0, 0, 0) to (10, 0, 0) and back.
    nodes, triangles = ellipsoid(20, (5 / math.sin(1.2), 5.0, 4.0), 1.2)
    nodes += (5, 0, -4 * math.cos(1.2))
    trimesh.Trimesh(nodes, triangles, process=False).export(tmp_path / "skin.stl")
    return tmp_path / "scene.toml"


_KINDS = [
    *[("touch", kind) for kind in PARTS["touch"].kinds],
    *[("effects", kind) for kind in PARTS["effects"].kinds],
    *[("step", kind) for kind in PARTS["step"].kinds],
    *[("skin", kind) for kind in PARTS["skin"].kinds],
]


def _with(part: str, kind: str) -> str:
    """A scene with one part of this kind."""
    if part == "touch":
        return scene_text.add_touch(_PLAIN, kind)
    if part == "effects":
        return scene_text.add_table(_PLAIN, ("effects", kind), PARTS["effects"].needed(kind))
    if part == "skin":
        named = scene_text.put_in(_PLAIN, ("skin",), "shape", "rectangle")
        return scene_text.change_kind(named, ("skin", "shape"), "skin", kind)
    touched = scene_text.add_touch(_PLAIN, "disc")
    path = scene_text.put_in(touched, ("touch", 0), "path", PARTS["touch"].optional()["path"])
    return scene_text.add_step(path, ("touch", 0, "path"), kind)


@pytest.mark.parametrize(("part", "kind"), _KINDS)
def test_every_part_makes_a_valid_scene_and_so_does_whatever_it_may_have(
    part: str, kind: str, folder: Path
) -> None:
    text = _with(part, kind)
    read_scene(text, folder)
    title = {"skin": "Skin", "effects": "Effects"}.get(part, "Touch 1")
    section = next(s for s in sections_of(tomllib.loads(text)) if s.title == title)
    sections = section.sections if part == "effects" else (section,)
    for offer in (offer for one in sections for offer in _offers(one)):
        added = offer.change(text)
        assert tomllib.loads(added) != tomllib.loads(text)
        read_scene(added, folder)


def test_whatever_a_plain_scene_may_have_besides_makes_a_valid_one(folder: Path) -> None:
    offers = [o for s in sections_of(tomllib.loads(_PLAIN)) for o in _offers(s)]
    assert len(offers) > 40
    for offer in offers:
        read_scene(offer.change(_PLAIN), folder)


def test_every_effect_that_has_numbers_of_its_own_can_be_added() -> None:
    follow = {"tension", "foam", "fluid", "dead", "gage-length", "finite-slope"}
    follow |= {"skew", "saturation", "quantisation", "stretching"}
    assert set(PARTS["effects"].kinds) == set(EFFECTS) - follow


def test_what_a_menu_adds_is_said_once_and_removed_again_by_its_button(
    shown: Callable[[str], SceneForm], qtbot: Any
) -> None:
    text = TEXTS["hot-room"]
    form = shown(text)
    said = said_by(form)
    _action(form, "Creep").trigger()
    assert len(said) == 1
    assert tomllib.loads(said[0])["effects"]["creep"] == PARTS["effects"].needed("creep")
    assert "\n\n[effects.creep]\nshare = 0.1\ntime_constant = 8.0\n\n[[touch]]" in said[0]
    box = next(b for b in form.boxes if ("effects", "creep", "share") in b.editors)
    crosses = [b for b in box.findChildren(QToolButton) if b.text() == "\N{MULTIPLICATION SIGN}"]
    qtbot.mouseClick(crosses[-1], Qt.MouseButton.LeftButton)
    assert said[1:] == [text]


def _action(form: SceneForm, words: str) -> QAction:
    return next(a for a in form.findChildren(QAction) if a.text() == words)


def test_a_step_is_added_and_removed_in_its_line(shown: Callable[[str], SceneForm]) -> None:
    form = shown(TEXTS["pencil"])
    said = said_by(form)
    _action(form, "Tap").trigger()
    assert '    { step = "tap", times = 3, seconds = 1.0 },\n]' in said[0]
    assert scene_text.remove(said[0], ("touch", 0, "path", 4)) == TEXTS["pencil"]


def test_a_step_that_presses_comes_before_the_release(folder: Path) -> None:
    text = scene_text.add_step(TEXTS["pencil"], ("touch", 0, "path"), "hold")
    hold, release = (
        '    { step = "hold", seconds = 1.0 },',
        '    { step = "release", seconds = 0.5 },',
    )
    assert f"\n{hold}\n{release}\n]" in text
    assert text.replace(f"{hold}\n", "") == TEXTS["pencil"]
    read_scene(text, folder)


def test_what_cannot_press_beside_what_is_there_is_not_offered(
    shown: Callable[[str], SceneForm],
) -> None:
    def offered(name: str) -> set[str]:
        sections = sections_of(tomllib.loads(name))
        return {o.words for s in sections if s.adding == "Add touch" for o in s.more}

    assert {"Ball", "Point load", "Cylinders"} <= offered(_PLAIN)
    assert not offered(TEXTS["pencil"])
    assert "Point load" in offered(TEXTS["circle"])
    assert not {"Ball", "Cylinders"} & offered(TEXTS["circle"])
    assert not offered(TEXTS["calibration"])


def test_the_last_step_takes_its_path_and_the_last_touch_its_array_along() -> None:
    text = TOUCHED
    for _ in range(2):
        text = scene_text.remove(text, ("touch", 0, "path", 0))
    assert "path" not in tomllib.loads(text)["touch"][0]
    assert "touch" not in tomllib.loads(scene_text.remove(text, ("touch", 0)))


def test_an_effect_that_goes_is_named_no_longer(folder: Path) -> None:
    text = scene_text.remove(TEXTS["hum"], ("effects", "mains-hum"))
    assert tomllib.loads(text)["effects"] == {"choose": []}
    read_scene(text, folder)


def test_another_kind_of_touch_keeps_what_it_knows_and_gets_what_it_needs(
    shown: Callable[[str], SceneForm],
) -> None:
    form = shown(TOUCHED)
    said, box = said_by(form), form.editor("touch", 0, "what")
    box.setFocus()
    assert isinstance(box, QComboBox)
    box.setCurrentIndex(box.findData("block"))
    box.activated.emit(box.currentIndex())
    before, after = (tomllib.loads(text)["touch"][0] for text in (TOUCHED, said[0]))
    kept = {"x", "y", "force", "path"}
    assert after == {k: before[k] for k in kept} | {"what": "block", "length": 0.03, "width": 0.02}
    assert "# Of a cork." in said[0]
    assert "# slowly" in said[0]
    assert "# a ball" in said[0]
    assert form.editor("touch", 0, "what").hasFocus()


def test_a_slide_that_becomes_a_turn_gets_an_angle() -> None:
    place = ("touch", 0, "path", 1, "step")
    text = scene_text.change_kind(TEXTS["pencil"], place, "step", "turn")
    assert tomllib.loads(text)["touch"][0]["path"][1] == {
        "step": "turn",
        "seconds": 1.0,
        "by": pytest.approx(math.pi / 2),
    }
    assert [line for line in text.splitlines() if line not in TEXTS["pencil"]] == [
        '    { step = "turn", seconds = 1.0, by = 1.5707963 },'
    ]


def test_a_displacement_comes_instead_of_a_force_and_a_path_of_an_orbit() -> None:
    text = scene_text.put_in(TEXTS["two-contacts"], ("touch", 1), "displacement", 0.002)
    text = scene_text.put_in(text, ("touch", 1), "path", PARTS["touch"].optional()["path"])
    touch = tomllib.loads(text)["touch"][1]
    assert {"displacement", "path"} <= set(touch)
    assert not {"force", "orbit"} & set(touch)


def test_a_touch_is_put_in_the_middle_of_the_skin_that_is_there(folder: Path) -> None:
    text = scene_text.add_touch(TEXTS["on-foam"].replace("[0.1, 0.1]", "[0.2, 0.3]"), "punch")
    touch = tomllib.loads(text)["touch"][-1]
    assert (touch["x"], touch["y"]) == (0.1, 0.15)


def test_headings_keep_an_empty_line_before_them_and_others_their_own() -> None:
    text = scene_text.put_in(TOUCHED, ("electronics", "amplifier"), "gain", 50.0)
    assert text == TOUCHED + "\n[electronics.amplifier]\ngain = 50.0\n"
