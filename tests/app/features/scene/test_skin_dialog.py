"""Open skin: what is asked, shown, mended and made of a mesh file."""

import time
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QLabel, QPushButton

from kappaskin import Refusal, read_scene
from kappaskin.scenes import scene_file
from kappaskin.skin import MeshSkin, read_surface
from kappaskin_app.features.scene.scene_text import named
from kappaskin_app.features.scene.skin_dialog import SkinDialog, new_scene
from kappaskin_app.shell.background import Tasks
from meshes import ellipsoid, obj

LEFT = Qt.MouseButton.LeftButton
PAD = ellipsoid(16, (9.0, 7.0, 6.0), 1.2)
KIND = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl(file, nodes, triangles):
    rows = np.zeros(len(triangles), KIND)
    rows["corners"] = nodes[triangles]
    file.write_bytes(bytes(80) + np.array(len(rows), "<u4").tobytes() + rows.tobytes())
    return file


@pytest.fixture
def pad(tmp_path):
    """A mesh without faults, in mm."""
    return stl(tmp_path / "pad.stl", *PAD)


@pytest.fixture
def broken(tmp_path):
    """The same with triangles that face inward, and a second part."""
    nodes, triangles = PAD
    inward = nodes[triangles][:, :, 0].mean(axis=1) > 5
    triangles = np.where(inward[:, None], triangles[:, ::-1], triangles)
    more, other = ellipsoid(3, (1.0, 1.0, 1.0), 1.0)
    both = np.concatenate([nodes, more + np.array([12.0, 0, 0])])
    return stl(tmp_path / "broken.stl", both, np.concatenate([triangles, other + len(nodes)]))


@pytest.fixture
def dialog(qtbot, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path))
    tasks = Tasks()
    dialog = SkinDialog(tasks)
    qtbot.addWidget(dialog)
    yield dialog
    tasks.close()


def opened(dialog, until, qtbot, file, unit="mm"):
    dialog.begin(file)
    until(lambda: dialog.unit.count() > 1)
    qtbot.keyClicks(dialog.unit, unit)
    until(lambda: dialog.begin_button.isEnabled() or repairs(dialog))


def repairs(dialog):
    return [
        b
        for b in dialog.findChildren(QPushButton, None)
        if b.objectName()[:7] == "repair-" and b.isVisible()
    ]


def test_the_unit_is_asked_for_with_the_size_in_each(dialog, until, qtbot, pad) -> None:
    dialog.begin(pad)
    until(lambda: dialog.unit.count() > 1)

    texts = [dialog.unit.itemText(k) for k in range(dialog.unit.count())]
    assert texts[1:] == [
        "m: the skin is 16,800 x 13,000 x 3,830 mm",
        "cm: the skin is 168 x 130 x 38.3 mm",
        "mm: the skin is 16.8 x 13 x 3.83 mm",
        "inch: the skin is 426 x 331 x 97.2 mm",
    ]
    assert dialog.unit.currentData() == ""
    assert not dialog.begin_button.isEnabled()
    assert dialog.message.text() == "Select the unit of length of the file."


def test_another_unit_than_the_skins_is_a_fault(dialog, until, qtbot, pad) -> None:
    dialog.begin(pad)
    until(lambda: dialog.unit.count() > 1)
    qtbot.keyClicks(dialog.unit, "m:")
    until(lambda: "Repair" in dialog.message.text())
    assert not dialog.begin_button.isEnabled()
    assert not repairs(dialog)


def test_repairs_are_made_one_by_one_when_clicked(dialog, until, qtbot, broken) -> None:
    opened(dialog, until, qtbot, broken)
    content = broken.read_bytes()
    assert [b.text() for b in repairs(dialog)] == ["&Orient triangles", "&Keep the largest part"]
    assert not dialog.begin_button.isEnabled()
    assert len(dialog.preview.places) > 50

    qtbot.mouseClick(repairs(dialog)[0], LEFT)
    until(lambda: [b.text() for b in repairs(dialog)] == ["&Keep the largest part"])
    qtbot.mouseClick(repairs(dialog)[0], LEFT)
    until(dialog.begin_button.isEnabled)

    assert not repairs(dialog)
    assert dialog.unit.currentText() == "mm: the skin is 16.8 x 13 x 3.83 mm"
    assert broken.read_bytes() == content


def test_two_clicks_on_the_rim_hold_the_part_between_them(dialog, until, qtbot, pad) -> None:
    opened(dialog, until, qtbot, pad)
    dialog.resize(900, 600)
    assert len(dialog.preview.held) == 96
    for place in ((5.0, -5.0), (5.0, 5.0)):
        surface = dialog.preview.surface
        nodes = np.unique(surface.rim)
        away = np.linalg.norm(1e3 * surface.nodes[nodes, :2] - place, axis=1)
        x, y, _ = dialog.preview.seen(surface.nodes[nodes[[away.argmin()]]])[0]
        qtbot.mouseClick(dialog.preview, LEFT, pos=QPoint(round(x), round(y)))

    held = dialog.preview.held
    assert 10 < len(held) < 48
    assert surface.nodes[held][..., 0].min() > 3e-3
    assert dialog.begin_button.isEnabled()
    dialog.ends[1].selectAll()
    qtbot.keyClicks(dialog.ends[1], "0, 0, 100")
    assert not dialog.begin_button.isEnabled()
    assert "on the rim" in dialog.message.text()


def test_a_drag_turns_the_mesh_and_picks_nothing(dialog, until, qtbot, pad) -> None:
    opened(dialog, until, qtbot, pad)
    preview = dialog.preview
    before = preview.grab().toImage()
    node = preview.surface.nodes[preview.surface.rim[0, :1]]
    x, y, _ = preview.seen(node)[0]
    at = QPoint(round(x), round(y))
    qtbot.mousePress(preview, LEFT, pos=at)
    qtbot.mouseMove(preview, at + QPoint(60, 20))
    qtbot.mouseRelease(preview, LEFT, pos=at + QPoint(60, 20))

    assert np.linalg.norm(preview.seen(node)[0, :2] - (x, y)) > 5
    assert preview.grab().toImage() != before
    assert dialog.held.currentIndex() == 0


def test_what_is_no_mesh_is_refused_in_the_dialog(dialog, until, tmp_path) -> None:
    file = tmp_path / "none.stl"
    file.write_text("nothing")
    dialog.begin(file)
    until(lambda: "none.stl" in dialog.message.text())
    assert not dialog.begin_button.isEnabled()


def test_a_mesh_without_finite_nodes_is_a_fault(dialog, until, qtbot, tmp_path) -> None:
    dialog.begin(stl(tmp_path / "none.stl", np.nan * PAD[0], PAD[1]))
    until(lambda: dialog.unit.count() > 1)
    qtbot.keyClicks(dialog.unit, "mm")
    until(lambda: "Repair" in dialog.message.text())
    assert not dialog.begin_button.isEnabled()


def test_enter_in_a_line_repairs_nothing(dialog, until, qtbot, broken) -> None:
    opened(dialog, until, qtbot, broken)
    dialog.held.setCurrentIndex(1)
    qtbot.keyClicks(dialog.ends[0], "0, 0, 0")
    qtbot.keyClick(dialog.ends[0], Qt.Key.Key_Return)
    qtbot.wait(100)
    assert len(repairs(dialog)) == 2
    assert dialog.isVisible()


def test_computing_can_be_cancelled(dialog, until, qtbot, pad) -> None:
    opened(dialog, until, qtbot, pad)
    made = []
    dialog.made.connect(made.append)
    qtbot.mouseClick(dialog.begin_button, LEFT)
    assert dialog.cancel_button.text() == "&Cancel"
    assert not dialog.unit.isEnabled()
    assert not dialog.bar.isHidden()
    assert (dialog.bar.value(), dialog.bar.maximum()) == (0, 100)
    begin = time.monotonic()
    qtbot.mouseClick(dialog.cancel_button, LEFT)

    assert time.monotonic() - begin < 1
    assert dialog.message.text() == "Cancelled; nothing is simulated."
    assert dialog.begin_button.isEnabled()
    assert dialog.isVisible()
    assert not made


def test_the_scene_of_a_mesh_presses_its_middle(pad, tmp_path, monkeypatch) -> None:
    skin = {"shape": "mesh", "file": str(pad), "unit": "mm", "thickness": 1e-3, "rigidity": 3e-4}
    *shares, written = new_scene("My pad", pad, skin, 40)

    assert shares == sorted(shares)
    assert len(shares) > 10
    assert (shares[0], shares[-1] > 0.9) == (0.0, True)

    scene = read_scene(written.text, written.file, written.trust)
    assert scene.title == "My pad"
    assert len(scene.layout) == 40
    assert isinstance(scene.plate.patch, MeshSkin)
    (load,) = scene.loads_at(1.0)
    assert load.centre() == pytest.approx(
        [scene.plate.patch.a / 2, scene.plate.patch.b / 2], rel=0.1
    )
    c = scene.plate.deflection((load,), scene.basis)
    moved = scene.basis.at(load.centre()[None])[0] @ c.ravel()
    assert moved == pytest.approx(0.3e-3, rel=1e-2)


def test_the_mesh_of_a_skin_is_a_file_that_its_scene_names() -> None:
    text = scene_file("thumb-pad").read_text()
    assert named(text) == [(("skin", "file"), "thumb-pad.stl")]


@pytest.mark.full
def test_a_mesh_that_is_dropped_is_opened_as_a_skin_and_simulated(
    window, until, qtbot, broken
) -> None:
    window.opening.open(broken)
    (dialog,) = (one for one in window.findChildren(SkinDialog) if one.isVisible())
    until(lambda: dialog.unit.count() > 1)
    qtbot.keyClicks(dialog.unit, "mm")
    for count in (2, 1):
        until(lambda count=count: len(repairs(dialog)) == count)
        qtbot.mouseClick(repairs(dialog)[0], LEFT)
    until(dialog.begin_button.isEnabled)
    qtbot.mouseClick(dialog.begin_button, LEFT)
    until(lambda: window.session.scene.title == "broken" and not window.session.making, 120.0)
    until(lambda: window.session.estimate.contact.present, 120.0)
    assert not dialog.isVisible()
    patch = window.session.scene.plate.patch
    np.testing.assert_allclose([patch.a, patch.b], [16.78e-3, 13.05e-3], rtol=1e-3)
    (name,) = (name for _, name in named(window.history.settings.written.text))
    repaired = read_surface(Path(name), "mm")
    assert Path(name) != broken
    assert len(repaired.triangles) == len(PAD[1])


def test_triangles_too_large_to_find_contacts_are_refused_before_the_scene(tmp_path) -> None:
    coarse = stl(tmp_path / "coarse.stl", *ellipsoid(10, (9.0, 7.0, 6.0), 1.2))
    skin = {"shape": "mesh", "file": str(coarse), "unit": "mm", "thickness": 1e-3}
    with pytest.raises(Refusal, match=r"too thin for its radii .* or use smaller triangles"):
        list(new_scene("Coarse", coarse, skin | {"rigidity": 3e-4}, 40))


@pytest.fixture
def fine(tmp_path):
    """A mesh of 130,000 triangles, more than a skin may have."""
    n = 256
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = (k.ravel() for k in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    nodes = np.column_stack([9 * x.ravel(), 7 * y.ravel(), 2 - (x**2 + y**2).ravel()])
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return stl(tmp_path / "fine.stl", nodes, triangles)


def test_a_repair_of_many_triangles_is_begun_once_and_leaves_the_window_its_time(
    dialog, until, qtbot, fine
) -> None:
    opened(dialog, until, qtbot, fine)
    assert [b.text() for b in repairs(dialog)] == ["&Decimate"]
    qtbot.mouseClick(repairs(dialog)[0], LEFT)
    until(lambda: bool(repairs(dialog)))
    assert not repairs(dialog)[0].isEnabled()
    assert dialog.message.text() == "Repairing\N{HORIZONTAL ELLIPSIS}"
    begin = time.monotonic()
    dialog.reject()
    assert time.monotonic() - begin < 1
    assert fine.stat().st_size > 6_000_000


def test_a_letter_named_as_a_mesh_is_told_by_its_first_words(dialog, until, tmp_path) -> None:
    file = tmp_path / "letter.stl"
    file.write_text("Dear all,\nthis is a letter.\n" * 50)
    dialog.begin(file)
    until(lambda: "got another text" in dialog.message.text())


@pytest.mark.parametrize("scale", [1.0, 1 / 25.4], ids=["mm", "inch"])
@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_other_files_have_the_size_of_their_unit(dialog, until, tmp_path, kind, scale) -> None:
    nodes, triangles = PAD[0] * scale, PAD[1]
    file = tmp_path / f"pad.{kind}"
    text = obj(nodes, triangles)
    if kind == "ply":
        lines = [f"{len(nodes)}", *("property float " + axis for axis in "xyz")]
        head = ["ply", "format ascii 1.0", f"element vertex {lines[0]}", *lines[1:]]
        head += [f"element face {len(triangles)}", "property list uchar int vertex_indices"]
        rows = [f"{x} {y} {z}" for x, y, z in nodes.tolist()]
        rows += [f"3 {a} {b} {c}" for a, b, c in triangles.tolist()]
        text = "\n".join([*head, "end_header", *rows, ""])
    file.write_text(text)
    dialog.begin(file)
    until(lambda: dialog.unit.count() > 1)
    texts = [dialog.unit.itemText(k) for k in range(dialog.unit.count())]
    assert texts[3 if scale == 1 else 4].endswith("the skin is 16.8 x 13 x 3.83 mm")


def test_a_mesh_with_a_hole_has_no_repair(dialog, until, qtbot, tmp_path) -> None:
    nodes, triangles = PAD
    away = np.linalg.norm(nodes[triangles].mean(axis=1)[:, :2] - (2, 1), axis=1)
    dialog.begin(stl(tmp_path / "hole.stl", nodes, triangles[away > 1.2]))
    until(lambda: dialog.unit.count() > 1)
    qtbot.keyClicks(dialog.unit, "mm")
    until(lambda: "Repair the faults" in dialog.message.text())
    assert not repairs(dialog)
    assert not dialog.begin_button.isEnabled()
    assert any("fill the holes" in label.text() for label in dialog.findChildren(QLabel))
