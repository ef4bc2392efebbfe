"""What a window keeps in a file between two starts, and files that cannot be used."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Refusal
from kappaskin_app.shell.arrangement import Layout, Place
from kappaskin_app.shell.window_file import WindowFile, WindowState, from_text, to_text

HOSTILE = (
    "",
    "format = 2",
    "format = '1'",
    "format = 1\nwindow = 3",
    "format = 1\n[window]\ntheme = 'neon'",
    "format = 1\n[window]\nplace = [0, 0, 0, 5]",
    "format = 1\n[window]\nplace = [0, 0, 9999999999, 5]",
    "format = 1\n[window]\nplace = [0, 0, 'a', true]",
    "format = 1\n[window]\nfiles = [1]",
    "format = 1\n[layout]\npage = -1",
    "format = 1\n[layout]\ncost = 'left'",
    "format = 1\n[layout]\ncost = { area = 'inside' }",
    "format = 1\n[layout]\ncost = { area = 'left', share = nan }",
    "format = 1\n[layout]\ncost = { area = 'left', shown = 1 }",
    "format = 1\n[layouts]\nA = 3",
    "format = 1\n[shortcuts]\npicture = ['Ctrl+S']",
    "a = " + 5000 * "[" + 5000 * "]",
    "a = " + 5000 * "9",
    f"format = 1\n[layout]\ncost = {{ area = 'left', share = {400 * '9'} }}",
    "\x00",
    "format = 1\n" + "\n".join(f"[layouts.a{n}]" for n in range(200)),
)

STUDY = Layout(
    0,
    (
        ("lesson", Place("left", shown=False)),
        ("settings", Place("left", share=0.25)),
        ("curvature", Place("right", share=0.22)),
        ("cost", Place("bottom", share=0.36)),
        ("scene", Place("bottom", shown=False)),
    ),
)
TEACH = Layout(0, (("lesson", Place("left", share=0.25)), *STUDY.docks[1:]))


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_a_file_that_cannot_be_used_is_told_and_put_aside(tmp_path: Path, text: str) -> None:
    path = tmp_path / "window.toml"
    path.write_text(text)
    kept, told = WindowFile(path).read()
    assert kept == WindowState()
    assert "window.toml.1.aside" in told
    assert (tmp_path / "window.toml.1.aside").read_text() == text
    assert not path.exists()


@given(st.text() | st.binary())
def test_no_text_at_all_ends_the_start(tmp_path_factory, text: str | bytes) -> None:
    path = tmp_path_factory.mktemp("kept") / "window.toml"
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    path.write_bytes(data)
    kept, told = WindowFile(path).read()
    assert kept == WindowState()
    assert told


def test_a_file_that_is_not_there_is_no_news_and_one_that_cannot_be_written_is(
    tmp_path: Path,
) -> None:
    assert WindowFile(tmp_path / "none.toml").read() == (WindowState(), "")
    (tmp_path / "file").touch()
    assert "cannot be written" in WindowFile(tmp_path / "file" / "window.toml").write(WindowState())


def test_an_earlier_one_put_aside_stays(tmp_path: Path) -> None:
    path = tmp_path / "window.toml"
    for text in ("first", "second"):
        path.write_text(text)
        WindowFile(path).read()
    aside = [(tmp_path / f"window.toml.{number}.aside").read_text() for number in (1, 2)]
    assert aside == ["first", "second"]


def test_two_windows_that_write_at_once_leave_one_whole_file_and_no_other(tmp_path: Path) -> None:
    path = tmp_path / "window.toml"
    kept = [WindowState(theme="dark"), WindowState(theme="light", files=("a",) * 50)]

    def write(which: WindowState) -> set[str]:
        return {WindowFile(path).write(which) for _ in range(40)}

    with ThreadPoolExecutor(2) as windows:
        assert set().union(*windows.map(write, kept)) == {""}
    assert WindowFile(path).read() in [(each, "") for each in kept]
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_was_cut_anywhere_is_read_or_told(tmp_path: Path) -> None:
    text, path = to_text(WindowState(theme="dark", now=STUDY)), tmp_path / "window.toml"
    for end in range(0, len(text), 97):
        path.write_text(text[:end])
        kept, told = WindowFile(path).read()
        assert told == "" or (kept == WindowState() and not path.exists())


def test_the_text_is_read_by_a_person() -> None:
    text = to_text(WindowState(theme="dark", keys={"picture": "F12"}, now=STUDY))
    assert 'theme = "dark"' in text
    assert 'picture = "F12"' in text
    assert 'settings = {area = "left", shown = true, share = 0.25}' in text


def test_of_two_windows_each_keeps_what_it_changed_and_what_it_forgot(tmp_path: Path) -> None:
    file, mine = WindowFile(tmp_path / "window.toml"), STUDY
    begun = WindowState(
        theme="light", keys={"picture": "F12", "tare": "F9"}, own={"A": mine, "B": mine}
    )
    assert file.merge(begun, WindowState()) == ""
    one = replace(begun, theme="dark", own={"A": mine, "B": mine, "One": mine})
    other = replace(begun, letters=150.0, keys={"picture": "F8"}, own={"B": TEACH})
    for window in (one, other):
        assert file.merge(window, begun) == ""
    assert file.read()[0] == WindowState(
        theme="dark",
        letters=150.0,
        keys={"picture": "F8"},
        own={"B": TEACH, "One": mine},
    )
    assert [path.name for path in tmp_path.iterdir()] == ["window.toml"]


def test_what_a_window_did_not_touch_is_as_the_other_left_it_at_its_second_writing_too(
    tmp_path: Path,
) -> None:
    file, begun = WindowFile(tmp_path / "window.toml"), WindowState(theme="light")
    file.merge(begun, WindowState())
    file.merge(replace(begun, theme="dark"), begun)
    mine = replace(begun, files=("a",))
    file.merge(mine, begun)
    file.merge(replace(mine, done=("theme",)), mine)
    assert file.read()[0] == WindowState(theme="dark", files=("a",), done=("theme",))


def test_letters_are_kept_and_those_that_no_form_offers_are_refused(tmp_path: Path) -> None:
    assert from_text(to_text(WindowState(letters=150.0))).letters == 150.0
    for bad in ("1000", "nan", "true", "'large'"):
        with pytest.raises(Refusal, match="a text size from 80 to 200"):
            from_text(f"format = 1\n[window]\nletters = {bad}")


def test_progress_of_lessons_comes_back_and_what_is_no_progress_is_dropped() -> None:
    kept = WindowState(lessons={f"{n:02}.md": "[1, 2, []]" for n in range(41)})
    assert list(from_text(to_text(kept)).lessons) == [f"{n:02}.md" for n in range(1, 41)]
    assert from_text("format = 1\n[lessons]\na = 3\nb = '[0, 0, []]'").lessons == {
        "b": "[0, 0, []]"
    }
