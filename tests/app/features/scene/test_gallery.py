"""A real gallery on a (virtual) display."""

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QImage
from PySide6.QtWidgets import QApplication

from kappaskin import load_scene
from kappaskin.scenes import SCENES
from kappaskin_app.features.scene.gallery import (
    ORDER,
    PLAYING,
    GalleryPanel,
    in_order,
    picture_size,
)
from kappaskin_app.theme import DARK, LIGHT, apply_look


@pytest.fixture
def gallery(qtbot):
    gallery = GalleryPanel()
    qtbot.addWidget(gallery)
    gallery.resize(640, 240)
    gallery.names = []
    gallery.chosen.connect(gallery.names.append)
    return gallery


def test_every_ready_scene_is_there_and_a_new_one_comes_last():
    assert sorted(ORDER) == sorted(SCENES)
    assert in_order(("b-new", "hum", "a-new", "sphere")) == ["sphere", "hum", "b-new", "a-new"]


def test_a_card_has_the_title_of_its_scene_and_the_selected_one_its_text(gallery):
    gallery.show()
    for name, item in gallery.items.items():
        assert item.text() == load_scene(name).title
    assert gallery.text.text() == load_scene("sphere").text.strip()
    assert gallery.file.text() == "sphere.toml"


@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_each_card_shows_the_thumbnail_of_its_scene_on_the_ground_of_the_theme(
    gallery, theme, colours_of
):
    apply_look(theme)
    gallery.resize(1280, 1500)
    gallery.show()
    QApplication.processEvents()
    seen = gallery.cards.viewport().grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    wide = seen.bytesPerLine()
    rows = np.frombuffer(seen.constBits(), np.uint8).reshape(seen.height(), wide)
    whole = rows[:, : 3 * seen.width()].reshape(seen.height(), seen.width(), 3)
    size = picture_size(gallery.cards.painter.cell)
    for name, item in gallery.items.items():
        place = gallery.cards.visualItemRect(item)
        dots = whole[place.top() + 12 :, place.left() + 12 :][: size.height(), : size.width()]
        assert colours_of(dots) > 300, name
        red, green, blue, _ = QColor(theme.scene).getRgb()
        assert np.abs(dots[-6, 5].astype(int) - (red, green, blue)).max() < 8, name


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
