import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from kappaskin.scenes import scene_file
from kappaskin_app.shell.finder import Finder, FinderEntry, entries_in, score
from kappaskin_app.shell.window import MainWindow

WORDS = st.text("abc- ", min_size=1, max_size=12)


@given(WORDS, WORDS)
def test_a_text_is_found_exactly_if_each_word_is_part_of_it_or_how_its_words_begin(
    query: str, text: str
) -> None:
    def has(word: str) -> bool:
        begin = "(?<![a-z0-9])"
        first, *rest = map(re.escape, word)
        beginnings = begin + first + "".join(f"(?:{one}|.*{begin}{one})" for one in rest)
        return word in text or re.search(beginnings, text) is not None

    assert (score(query, text) > 0) == all(has(word) for word in query.split())


@pytest.mark.parametrize(
    ("query", "better", "worse"),
    [
        ("tare", "Tare", "Start a recording"),
        ("ng", "Noise: Gaussian", "Sending"),
        ("noise gau", "Noise: Gaussian", "Noise: None"),
        ("gau noise", "Noise: Gaussian", "Noise: None"),
        ("rec", "Record", "Draw the truth circle"),
        ("save", "Save picture", "Save scene as something else"),
    ],
)
def test_what_begins_a_word_or_stands_together_ranks_first(
    query: str, better: str, worse: str
) -> None:
    assert score(query, better) > score(query, worse)


@pytest.mark.parametrize(
    ("query", "found"),
    [
        ("screenshot", "Save picture"),
        ("csv", "Export the recording"),
        ("baud", "Connection panel"),
        ("port", "Connection panel"),
        ("zero", "Tare now"),
        ("plot", "Strip chart"),
        ("zoom", "Reset camera"),
    ],
)
def test_what_others_call_it_is_found(query: str, found: str) -> None:
    assert score(query, found) > 0


@pytest.mark.parametrize("text", ["Size of the error bars", "Azure topography", "Noise: Gaussian"])
def test_letters_scattered_over_a_text_are_no_match(text: str) -> None:
    assert score("zero", text) == 0


def test_a_name_ranks_before_a_place() -> None:
    assert score("load", "Load: Force") > score("load", "Force", "Live page, Load") > 0


Find = Callable[[str], list[str]]


@pytest.fixture
def finder(qtbot) -> Finder:
    parent = QWidget()
    qtbot.addWidget(parent)
    parent.resize(800, 600)
    done: list[str] = []
    things = [
        FinderEntry("a", "Tare", "Source menu", lambda: done.append("a"), "Ctrl+0"),
        FinderEntry("b", "Record", "Recording menu", lambda: done.append("b")),
        FinderEntry(
            "c", "Faster", "Recording menu", lambda: done.append("c"), "", "no recording is played"
        ),
    ]
    finder = Finder(lambda: things, parent)
    finder.done_so_far = done  # type: ignore[attr-defined]
    finder.open_empty()
    yield finder
    finder.close()


def test_the_keyboard_alone_finds_and_does(finder: Finder, qtbot) -> None:
    assert [thing.name for thing in finder.found()] == ["a", "b", "c"]
    qtbot.keyClick(finder.line, Qt.Key.Key_Down)
    qtbot.keyClick(finder.line, Qt.Key.Key_Return)
    assert finder.done_so_far == ["b"]
    assert not finder.isVisible()


def test_what_was_done_last_comes_first(finder: Finder, qtbot) -> None:
    finder.recent = ["b"]
    assert [thing.name for thing in finder.found()] == ["b", "a", "c"]
    qtbot.keyClicks(finder.line, "r")
    assert finder.found()[0].name == "b"


def test_what_cannot_be_done_says_why_and_is_not_done(finder: Finder, qtbot) -> None:
    qtbot.keyClicks(finder.line, "faster")
    assert finder.list.topLevelItem(0).text(1) == "no recording is played"
    qtbot.keyClick(finder.line, Qt.Key.Key_Return)
    assert finder.isVisible()
    assert finder.hint.text() == "Faster: no recording is played."
    assert finder.done_so_far == []


def test_a_click_does_and_escape_leaves(finder: Finder, qtbot) -> None:
    where = finder.list.visualItemRect(finder.list.topLevelItem(0)).center()
    qtbot.mouseClick(finder.list.viewport(), Qt.MouseButton.LeftButton, pos=where)
    assert finder.done_so_far == ["a"]
    finder.open_empty()
    qtbot.keyClick(finder.line, Qt.Key.Key_Escape)
    assert not finder.isVisible()


def test_nothing_found_says_so(finder: Finder, qtbot) -> None:
    qtbot.keyClicks(finder.line, "zzz")
    assert "fewer letters" in finder.hint.text()


@pytest.mark.full
def test_ctrl_k_finds_every_kind_of_thing_in_the_window(
    window: MainWindow, until, qtbot, tmp_path: Path
) -> None:
    settings = window.history.settings
    box = window.basis.editor("functions_x")
    box.setFocus()
    qtbot.keyClick(box, Qt.Key.Key_K, Qt.KeyboardModifier.ControlModifier)
    finder = window.menus.finder
    until(finder.isVisible)

    def do(letters: str) -> None:
        finder.open_empty()
        qtbot.keyClicks(finder.line, letters)
        qtbot.keyClick(finder.line, Qt.Key.Key_Return)

    do("noise gaussian")
    assert window.history.settings.noise_kind == "gaussian"
    window.history.stack.undo()
    assert window.history.settings == settings
    do("foam")
    assert window.focusWidget() is window.support.editor("foam")
    do("noise of curvatures")  # whose row has a slider beside the editor
    until(lambda: window.focusWidget() is window.design.form.editor("design_noise"))
    do("scene effects")
    assert window.scene.effects.isVisible()
    do("disconnect")
    until(lambda: window.display.badge.state == "OFF")
    file = tmp_path / "my own fingertip.toml"
    file.write_text(scene_file("demo").read_text(encoding="utf-8"), encoding="utf-8")
    window.opening.note(tmp_path / "gone.mcap")
    window.opening.note(file)
    (gone,) = [
        thing
        for thing in entries_in(window, window.menus.entry_sources)
        if thing.title == "Open gone.mcap"
    ]
    assert gone.why_not == "moved or deleted"
    do("own fing")
    until(lambda: getattr(window.history.settings.written, "file", None) == file)
    do("play scene coin")
    until(lambda: window.session.source == "sim:" and window.display.badge.state == "SIM")
    assert window.history.settings.written.file.stem == "coin"
    names = [thing.name for thing in entries_in(window, window.menus.entry_sources)]
    assert len(set(names)) == len(names)
    entries = window.actions_by_name.entries.values()
    asked = {f"action:{entry.name}" for entry in entries if entry.action.menu() is None}
    assert asked < set(names)
