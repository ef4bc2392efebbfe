"""The guide in the window: from link to link and back, in both themes, found by its headings."""

from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QColor, QFont, QImage
from PySide6.QtWidgets import QApplication

from kappaskin_app.features.guide.panel import FOLDER, GuidePanel, page_called, pages
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import DARK, LIGHT, apply_look


@pytest.fixture(scope="module")
def panel(qapp: QApplication) -> Iterator[GuidePanel]:
    made = GuidePanel()
    made.resize(1270, 400)
    yield made
    made.close()
    made.deleteLater()


@pytest.fixture
def shown(panel: GuidePanel) -> Iterator[GuidePanel]:
    panel.show()
    panel.read(pages()[0])
    yield panel
    panel.hide()


def test_every_page_is_listed_under_its_own_title() -> None:
    assert pages()[0].file.name == "README.md"
    assert {page.file for page in pages()} == set(FOLDER.glob("*.md"))
    for page in pages()[1:]:
        assert page.file.read_text("utf-8").startswith(f"# {page.title}\n")
        assert page.headings


def test_a_link_leads_on_and_back_leads_back(shown: GuidePanel) -> None:
    shown.text.setSource(shown.text.source().resolved(QUrl("calibrate.md")))
    assert shown.contents.currentText() == "Calibrate"
    assert "Remaining errors" in shown.text.toPlainText()
    assert shown.back.isEnabled()
    shown.back.click()
    assert shown.contents.currentText() == "Contents"
    assert shown.forward.isEnabled()


def test_a_page_that_is_none_of_the_guides_is_marked_as_none(shown: GuidePanel) -> None:
    shown.text.setSource(QUrl.fromLocalFile(str(FOLDER.parent / "wire" / "wire.md")))
    assert "wire format" in shown.text.toPlainText()
    assert shown.contents.currentIndex() == -1


def _top(panel: GuidePanel) -> tuple[str, str]:
    """The uppermost two paragraphs that are seen."""
    block = panel.text.cursorForPosition(panel.text.viewport().rect().topLeft()).block()
    return block.text(), block.next().text()


@pytest.mark.parametrize("page", ["record", "scenes"])
def test_a_heading_is_brought_to_the_top(shown: GuidePanel, qtbot, page: str) -> None:
    heading = {"record": "Feed a robot", "scenes": "Every key"}[page]
    shown.read(page_called(page), heading)
    qtbot.waitUntil(lambda: heading in _top(shown))
    assert shown.text.viewport().updatesEnabled()


def test_back_and_another_theme_leave_a_page_where_it_was_read(shown: GuidePanel, qtbot) -> None:
    shown.read(page_called("teach"), "11 Break it and mend it")
    qtbot.waitUntil(lambda: "11 Break it and mend it" in _top(shown))
    qtbot.keyClick(shown.text, Qt.Key.Key_PageDown)
    at, bar = _top(shown), shown.text.verticalScrollBar()
    qtbot.mouseClick(shown.back, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: shown.contents.currentText() == "Contents" and bar.value() == 0)
    qtbot.mouseClick(shown.forward, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: _top(shown) == at)
    with qtbot.waitSignal(shown.text.sourceChanged):
        apply_look(DARK)
    qtbot.waitUntil(lambda: _top(shown) == at)
    assert shown.text.viewport().updatesEnabled()


@pytest.mark.full
def test_pages_fit_into_the_window_and_pictures_into_their_lines(shown: GuidePanel) -> None:
    for page in pages():
        shown.read(page)
        assert shown.text.document().size().width() <= shown.text.viewport().width(), page.title
    url = QUrl.fromLocalFile(str(FOLDER / "pictures" / "app.png"))
    shown.resize(500, 400)
    kind = shown.text.document().ResourceType.ImageResource
    assert 0 < shown.text.loadResource(kind, url).width() < 500
    shown.resize(1270, 400)


def test_code_is_as_large_as_the_letters_around_it(shown: GuidePanel, qtbot) -> None:
    shown.read(page_called("connect"))
    before, larger = shown.font(), QFont(shown.font())
    larger.setPointSizeF(1.5 * before.pointSizeF())
    with qtbot.waitSignal(shown.text.sourceChanged):
        shown.setFont(larger)
    for words in ("kappaskin doctor", "Ctrl+0"):
        code = shown.text.document().find(words)
        assert code.charFormat().fontPointSize() == larger.pointSizeF()
    box = shown.contents
    assert box.width() >= box.minimumSizeHint().width()
    shown.setFont(before)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_a_page_has_the_colours_of_the_theme(shown: GuidePanel, qapp: QApplication, theme) -> None:
    apply_look(theme)
    shown.read(page_called("connect"))
    qapp.processEvents()
    picture = shown.text.viewport().grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    rows = range(0, picture.height(), 2)
    colours = {picture.pixelColor(x, y).name() for x in range(0, 600, 2) for y in rows}
    assert {theme.base, theme.window, QColor(theme.text).name()} <= colours


@pytest.mark.full
def test_a_heading_is_found_and_read_in_the_window(window: MainWindow, until) -> None:
    finder = window.menus.finder
    finder.open_empty()
    finder.line.setText("feed a robot")
    assert finder.found()[0].name == "guide:record#Feed a robot"
    finder.line.returnPressed.emit()
    until(lambda: window.guide.isVisible())
    assert window.guide.contents.currentText() == "Record and publish"
    (help_menu,) = [a.menu() for a in window.menuBar().actions() if a.text() == "&Help"]
    assert window.actions_by_name["dock-guide"] in help_menu.actions()
