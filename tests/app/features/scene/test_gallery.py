"""A real gallery on a (virtual) display."""

import time

import pytest
from PySide6.QtCore import Qt

from kappaskin import load_scene
from kappaskin.scenes import SCENES
from kappaskin_app.features.scene.gallery import ORDER, PICTURE, PLAYING, GalleryPanel, in_order
from kappaskin_app.shell.background import Tasks
from kappaskin_app.theme import DARK, apply_look


@pytest.fixture
def gallery(qtbot):
    tasks = Tasks()
    gallery = GalleryPanel(tasks)
    qtbot.addWidget(gallery)
    gallery.resize(640, 240)
    gallery.names = []
    gallery.chosen.connect(gallery.names.append)
    yield gallery
    gallery.close()
    tasks.close()


def pictures(gallery) -> list:
    return [item.data(PICTURE) for item in gallery.items.values()]


def test_every_ready_scene_is_there_and_a_new_one_comes_last():
    assert sorted(ORDER) == sorted(SCENES)
    assert in_order(("b-new", "hum", "a-new", "sphere")) == ["sphere", "hum", "b-new", "a-new"]


@pytest.mark.full
def test_names_are_there_at_once_and_titles_and_pictures_come(gallery, until):
    assert gallery.items["two-contacts"].text() == "Two contacts"
    assert gallery.items["sphere"].text() == "Sphere"
    assert not any(pictures(gallery))  # nothing is made where nobody sees it
    gallery.show()
    until(lambda: gallery.items["sphere"].text() == load_scene("sphere").title)
    assert gallery.text.text() == load_scene("sphere").text.strip()
    assert gallery.file.text() == "sphere.toml"
    until(lambda: all(pictures(gallery)))


def test_a_card_a_key_and_the_button_choose(gallery, qtbot, until):
    gallery.show()
    gallery.cards.setCurrentItem(gallery.items["tapping"])
    qtbot.keyClick(gallery.cards, Qt.Key.Key_Return)
    gallery.cards.setCurrentItem(gallery.items["pencil"])
    gallery.play.click()
    place = gallery.cards.visualItemRect(gallery.items["sphere"]).center()
    view = gallery.cards.viewport()
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=place)
    assert gallery.names == ["tapping", "pencil"]
    qtbot.mouseDClick(view, Qt.MouseButton.LeftButton, pos=place)
    qtbot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=place)
    assert gallery.names == ["tapping", "pencil", "sphere"]


def test_a_file_is_asked_for(gallery, qtbot):
    with qtbot.waitSignal(gallery.open_wanted, timeout=1000):
        gallery.open.click()


def test_the_scene_that_is_played_is_marked(gallery):
    gallery.show_playing("sphere")
    assert gallery.items["sphere"].data(PLAYING)
    assert gallery.file.text() == "sphere.toml, simulated now"
    gallery.show_playing("elsewhere/mine.toml")
    assert not any(item.data(PLAYING) for item in gallery.items.values())
    assert gallery.file.text() == "sphere.toml"


@pytest.mark.full
def test_another_theme_makes_other_pictures(gallery, until):
    gallery.show()
    first = gallery.items["sphere"]
    until(lambda: first.data(PICTURE) is not None)
    light = first.data(PICTURE).toImage()
    apply_look(DARK)
    until(lambda: first.data(PICTURE).toImage() != light)


@pytest.mark.parametrize("width", [500, 640, 1280, 1500])
def test_the_cards_fill_the_width(gallery, width):
    gallery.resize(width, 300)
    gallery.show()
    rectangles = [gallery.cards.visualItemRect(item) for item in gallery.items.values()]
    first = [r for r in rectangles if r.top() == rectangles[0].top()]
    assert len(first) > 1
    assert max(r.right() for r in rectangles) < gallery.cards.viewport().width()
    left_over = gallery.cards.width() - first[-1].right()
    assert left_over < 30
    assert gallery.width() == width


@pytest.mark.full
def test_it_closes_while_it_works(gallery, until):
    gallery.show()
    until(lambda: gallery.items["sphere"].data(PICTURE) is not None)
    began = time.monotonic()
    gallery.close()
    assert time.monotonic() - began < 5
    assert not all(pictures(gallery))
    gallery.show()  # and does not begin again
    apply_look(DARK)
    gallery.resize(700, 300)
    gallery.close()
