"""A sensor that is described in a file, opened in the window."""

import os

import pytest

from kappaskin.sources import Port

TEXT = """
format = 1
[skin]
size = [0.1, 0.1]
[elements]
grid = [6, 6]
[line]
kind = "text"
columns = ["xx:0..35"]
"""


@pytest.fixture
def described(tmp_path):
    file = tmp_path / "board.toml"
    file.write_text(TEXT)
    return file


@pytest.mark.full
def test_a_description_is_opened_at_the_only_port(window, described):
    panel = window.connection
    panel.show_ports([Port("/dev/ttyACM7")])

    window.opening.open(described)

    assert panel.source() == f"sensor:{described}:/dev/ttyACM7"
    assert window.opening.recent[0] == described


def test_without_a_port_the_person_types_one(window, described):
    panel = window.connection
    panel.show_ports([])

    window.opening.open(described)

    assert panel.source() == f"sensor:{described}:"
    assert "port" in window.statusBar().currentMessage()


def test_another_description_keeps_the_port(window, described, tmp_path):
    other = tmp_path / "other.toml"
    other.write_text(TEXT)
    panel = window.connection
    panel.show_source(f"sensor:{described}:{os.devnull}")

    window.opening.open(other)

    assert panel.source() == f"sensor:{other}:{os.devnull}"


@pytest.mark.full
def test_a_wrong_description_is_reported_with_its_line(window, described):
    described.write_text(TEXT.replace("xx:0..35", "xx:0..36"))

    window.opening.open(described)

    assert "line 9" in window.statusBar().currentMessage()


@pytest.mark.full
def test_a_scene_is_still_a_scene(window, tmp_path):
    scene = tmp_path / "own.toml"
    scene.write_text(TEXT.partition("[line]")[0])

    window.opening.open(scene)

    assert "sensor:" not in window.connection.source()
