"""Files that a scene names, in the window: selected, trusted, and saved beside the scene."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtWidgets import QFileDialog

from kappaskin import load_scene
from kappaskin.mechanics import Mesh
from kappaskin.scenes import scene_file
from kappaskin_app.features.scene.scene_text import named
from kappaskin_app.shell.recovery import settings_in, settings_text
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import Written

from .conftest import plays

BOLT = scene_file("bolt").with_name("bolt.ply")


@pytest.fixture
def mesh(tmp_path) -> Path:
    (tmp_path / "meshes").mkdir()
    return Path(shutil.copy(BOLT, tmp_path / "meshes" / "my bolt.ply"))


@pytest.fixture
def dropped(window, panel, until, mesh):
    """A window in which the mesh was dropped on a scene whose object stands still."""
    panel.gallery.chosen.emit("demo")
    until(lambda: plays(window, "demo"))
    window.opening.open(mesh)
    until(lambda: presses_a_mesh(window))
    return window


def presses_a_mesh(window) -> bool:
    return isinstance(getattr(window.session.scene.stimuli[0].what, "rigid", None), Mesh)


def save(window, file: Path, monkeypatch) -> str:
    file.parent.mkdir(exist_ok=True)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    window.actions_by_name["save-scene"].trigger()
    return window.statusBar().currentMessage()


@pytest.mark.full
def test_a_mesh_that_was_dropped_is_copied_beside_the_scene_that_is_saved(
    dropped, until, monkeypatch, mesh, tmp_path
) -> None:
    file = tmp_path / "out" / "a.toml"
    assert save(dropped, file, monkeypatch) == f"Saved {file}"

    assert [name for _, name in named(file.read_text())] == [mesh.name]
    assert (file.parent / mesh.name).read_bytes() == mesh.read_bytes()
    assert load_scene(str(file)).indenter  # without trust
    until(lambda: plays(dropped, "a"))
    assert presses_a_mesh(dropped)
    assert save(dropped, file, monkeypatch) == f"Saved {file}"  # over itself, copies and all


@pytest.mark.full
def test_a_scene_that_is_saved_above_its_mesh_names_it_there(
    dropped, monkeypatch, mesh, tmp_path
) -> None:
    save(dropped, tmp_path / "a.toml", monkeypatch)

    text = (tmp_path / "a.toml").read_text()
    assert [name for _, name in named(text)] == [f"meshes/{mesh.name}"]
    assert [path.name for path in tmp_path.iterdir()] != [mesh.name]
    assert not (tmp_path / mesh.name).exists()


@pytest.mark.full
def test_no_other_file_is_overwritten_by_a_copy(dropped, monkeypatch, mesh, tmp_path) -> None:
    file = tmp_path / "out" / "a.toml"
    file.parent.mkdir()
    (file.parent / mesh.name).write_text("mine")

    assert "expected no other file of the name" in save(dropped, file, monkeypatch)
    assert not file.exists()
    assert (file.parent / mesh.name).read_text() == "mine"


@pytest.mark.full
def test_a_ready_scene_is_saved_with_its_mesh(window, panel, until, monkeypatch, tmp_path) -> None:
    panel.gallery.chosen.emit("bolt")
    until(lambda: plays(window, "bolt"))
    save(window, tmp_path / "a.toml", monkeypatch)

    assert (tmp_path / "a.toml").read_text() == scene_file("bolt").read_text()
    assert load_scene(str(tmp_path / "a.toml")).indenter
    assert (tmp_path / "bolt.ply").exists()


def hostile(tmp_path: Path) -> Path:
    """A scene that names a file elsewhere."""
    (tmp_path / "in").mkdir()
    file = tmp_path / "in" / "a.toml"
    file.write_text(scene_file("bolt").read_text().replace("bolt.ply", "../meshes/my bolt.ply"))
    return file


@pytest.mark.full
def test_a_scene_names_files_elsewhere_only_if_it_is_trusted(
    window, panel, until, monkeypatch, mesh, tmp_path
) -> None:
    file = hostile(tmp_path)
    window.opening.open(file)
    until(lambda: "give --trust" in window.session.refusal)
    assert not presses_a_mesh(window)

    save(window, tmp_path / "out" / "a.toml", monkeypatch)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.toml"]  # no copy of it

    window.session.trusted = frozenset({file})
    window.opening.open(file)
    until(lambda: presses_a_mesh(window))
    window.session.request_source(f"sim:{file}")
    until(lambda: window.session.engine.requested.trust)
    until(lambda: window.session.status.state == "streaming" and presses_a_mesh(window))


def test_what_is_dropped_on_a_scene_makes_trusted_nothing_else(window, panel, mesh) -> None:
    other = Written("[[touch]]\nwhat = 'point'\n", Path("a.toml"))
    window.history.apply(replace(window.history.settings, written=other))
    window.editing.replace_object({"what": "mesh", "file": str(mesh)}, 0.0, 0.0, 1.0, mesh)
    assert window.history.settings.written.trust == {mesh}


def test_trust_is_restored_after_a_crash_and_a_handover(mesh) -> None:
    for trust in (False, True, frozenset({mesh, mesh.parent})):
        made = Settings(written=Written("", Path("a.toml"), trust))
        assert settings_in(settings_text(made)) == made
