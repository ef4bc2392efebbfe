from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PySide6.QtCore import QRect
from PySide6.QtWidgets import QLabel, QMainWindow, QTabWidget

from kappaskin import Refusal
from kappaskin_app.shell.arrangement import (
    AREAS,
    FLOATING,
    Layout,
    Place,
    arrange,
    layout_of,
    ready_layout,
)
from kappaskin_app.shell.docks import Docks
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.shell.window_file import WindowState, clamped, from_text, to_text

BELOW = (
    *("cost", "stability", "scene", "health", "compare", "design"),
    *("element", "strip_chart", "traces", "numbers", "log", "guide"),
)
DOCKS = ("lesson", "settings", "curvature", *BELOW)
SHARES = st.integers(50, 600).map(lambda share: share / 1000)
RECTANGLES = st.tuples(*[st.integers(0, 400)] * 2, *[st.integers(120, 500)] * 2)


def _place(name: str) -> st.SearchStrategy[Place]:
    areas = ("top", "bottom", FLOATING) if name in BELOW else AREAS
    made = st.builds(
        Place,
        st.sampled_from(areas),
        st.booleans(),
        st.booleans(),
        st.booleans(),
        st.booleans(),
        SHARES,
        SHARES,
        RECTANGLES,
    )
    return made.map(lambda place: place if place.area == FLOATING else replace(place, at=None))


LAYOUTS = st.builds(
    lambda page, order, places: Layout(page, tuple((name, places[name]) for name in order)),
    st.integers(0, 3),
    st.permutations(DOCKS),
    st.fixed_dictionaries({name: _place(name) for name in DOCKS}),
)
NAMES = st.text(min_size=1, max_size=20)
KEPT = st.builds(
    WindowState,
    st.sampled_from(["", "light", "dark"]),
    st.none() | RECTANGLES,
    st.booleans(),
    st.dictionaries(NAMES, NAMES, max_size=4),
    st.lists(NAMES, max_size=4).map(tuple),
    st.lists(NAMES, max_size=4).map(tuple),
    LAYOUTS,
    st.dictionaries(NAMES, LAYOUTS, max_size=2),
)


@pytest.mark.full
@given(KEPT)
def test_whatever_is_kept_comes_back_from_its_text(kept: WindowState) -> None:
    assert from_text(to_text(kept)) == kept


@pytest.fixture(scope="module")
def bare() -> Iterator[tuple[QMainWindow, Docks, QTabWidget]]:
    """A window with the docks of the real one, and nothing in them."""
    window, pages = QMainWindow(), QTabWidget()
    window.setCentralWidget(QLabel("skin"))
    for page in range(4):
        pages.addTab(QLabel(), str(page))
    docks = Docks(window)
    docks.put_left("settings", "Settings", pages, "", 0.25)
    docks.put_above("lesson", "Lessons", QLabel(), "settings", "", "", {"Teach": 0.25})
    docks.put_right("curvature", "Maps", QLabel(), "", 0.22)
    for name in BELOW:
        docks.put_below(name, name, QLabel(), "", "", layouts={"Study": 0.36 * (name == "cost")})
    window.resize(1400, 900)
    yield window, docks, pages
    window.close()
    window.deleteLater()


def _words(layout: Layout) -> dict[str, tuple[object, ...]]:
    """What can be said of each dock without px."""
    return {name: (p.area, p.shown, p.tabbed, p.front, p.beside, p.at) for name, p in layout.docks}


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(LAYOUTS)
def test_any_layout_goes_through_text_and_window_and_back(bare, qapp, layout: Layout) -> None:
    window, docks, pages = bare
    window.show()
    arrange(window, docks.by_name(), pages, layout)
    qapp.processEvents()
    once = layout_of(window, docks.by_name(), pages)
    wished = {name: (p.area if p.shown else "", p.shown) for name, p in layout.docks}
    assert {n: (p.area if p.shown else "", p.shown) for n, p in once.docks} == wished
    assert once.page == layout.page
    arrange(window, docks.by_name(), pages, ready_layout(docks, "Live", 0))
    qapp.processEvents()
    again = from_text(to_text(WindowState(now=once))).now
    arrange(window, docks.by_name(), pages, again)
    qapp.processEvents()
    twice = layout_of(window, docks.by_name(), pages)
    arrange(
        window, docks.by_name(), pages, ready_layout(docks, "Live", 0)
    )  # or what floats would stay
    window.hide()
    assert list(_words(twice).items()) == list(_words(once).items())  # in their order too
    shares = dict(once.docks)
    for name, place in twice.docks:
        assert place.share == pytest.approx(shares[name].share, abs=0.004)
        assert place.along == pytest.approx(shares[name].along, abs=0.004)


def test_tabs_keep_their_order_and_docks_that_share_a_column_their_sizes(bare, qapp) -> None:
    window, docks, pages = bare
    window.show()
    tabs = [
        (name, Place("bottom", tabbed=name != "traces")) for name in ("traces", "cost", "scene")
    ]
    beside = [
        ("settings", Place("left", share=0.2, along=0.9)),
        ("curvature", Place("left", beside=True, share=0.3, along=0.9)),
    ]
    wanted = Layout(0, (*beside, *tabs))
    found = []
    for _ in range(2):
        arrange(window, docks.by_name(), pages, wanted)
        qapp.processEvents()
        wanted = layout_of(window, docks.by_name(), pages)
        arrange(window, docks.by_name(), pages, ready_layout(docks, "Live", 0))
        qapp.processEvents()
        found.append([(n, p.beside, round(p.share, 2)) for n, p in wanted.docks if p.shown])
    window.hide()
    assert [name for name, *_ in found[0]] == ["settings", "curvature", "traces", "cost", "scene"]
    assert found[0][:2] == [("settings", False, 0.2), ("curvature", True, 0.3)]
    assert found[1] == found[0]


def test_docks_that_there_are_not_are_passed_over(bare, qapp) -> None:
    window, docks, pages = bare
    window.show()
    text = to_text(WindowState(now=ready_layout(docks, "Study", 0))).replace(
        "curvature = ", "holograms = "
    )
    arrange(window, docks.by_name(), pages, from_text(text).now)
    qapp.processEvents()
    assert docks["curvature"].isHidden()
    assert not docks["cost"].isHidden()
    arrange(window, docks.by_name(), pages, ready_layout(docks, "Live", 0))
    window.hide()


@pytest.mark.parametrize(
    ("place", "seen"),
    [
        ((10, 20, 300, 200), (10, 20, 300, 200)),
        ((-50, -60, 300, 200), (0, 0, 300, 200)),
        ((900, 700, 300, 200), (700, 600, 300, 200)),
        ((5000, 5000, 300, 200), (700, 600, 300, 200)),
        ((0, 0, 4000, 3000), (0, 0, 1000, 800)),
        ((1500, 100, 300, 200), (1500, 100, 300, 200)),
    ],
)
def test_a_window_comes_back_on_a_screen_that_is_there(place, seen) -> None:
    screens = [QRect(0, 0, 1000, 800), QRect(1000, 0, 1000, 800)]
    if place[0] in (900, 5000):
        screens = screens[:1]
    assert clamped(QRect(*place), screens) == QRect(*seen)


@pytest.mark.full
def test_a_window_is_kept_and_comes_back(opened, until, tmp_path: Path, qapp) -> None:
    path = tmp_path / "deep" / "window.toml"
    window = opened("sim:")
    window.saver.begin(path)
    window.requests.set("theme", "light")
    window.layouts.choose("Study")
    assert window.cost.isVisible()
    window.layouts.save("Mine")
    window.actions_by_name.change_key("theme", "Ctrl+J")
    window.opening.note(tmp_path / "a.toml")
    window.menus.finder.recent = ["action:tare"]
    window.panels.setCurrentIndex(2)
    left = window.layouts.now
    window.close()
    other = opened("sim:")
    qapp.processEvents()
    other.saver.begin(path)
    for _ in range(3):
        qapp.processEvents()
    assert other.history.settings.theme == "light"
    assert _words(other.layouts.now) == _words(left)
    assert other.panels.currentIndex() == 2
    assert list(other.layouts.own) == ["Mine"]
    assert other.actions_by_name.key("theme") == "Ctrl+J"
    assert other.opening.recent == [tmp_path / "a.toml"]
    assert other.menus.finder.recent == ["action:tare"]
    other.layouts.rename("Mine", "Ours")
    other.layouts.rename("Ours", "Live")
    assert list(other.layouts.own) == ["Ours"]
    other.layouts.reset()
    assert not other.cost.isVisible()
    other.layouts.choose("Ours")
    assert other.cost.isVisible()
    other.layouts.delete("Ours")
    other.saver.finish()
    assert from_text(path.read_text()).own == {}


def test_a_dock_of_another_version_is_passed_over(bare) -> None:
    window, docks, pages = bare
    text = "format = 1\n[layout]\nholograms = { area = 'left' }\ncost = { area = 'top' }"
    arrange(window, docks.by_name(), pages, from_text(text).now)
    seen = [name for name, dock in docks.by_name().items() if not dock.isHidden()]
    assert seen == ["cost"]


@pytest.mark.full
def test_a_window_that_was_not_asked_to_keeps_nothing(window: MainWindow, tmp_path: Path) -> None:
    window.layouts.save("Mine")
    window.saver.finish()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.full
def test_each_ready_layout_shows_its_panels_and_a_bad_name_is_refused(window: MainWindow) -> None:
    assert set(window.docks.by_name()) == set(DOCKS)
    assert not window.presenter.on
    for name, shown in (("Study", window.cost), ("Calibrate", window.health), ("Live", None)):
        window.layouts.choose(name)
        seen = [dock for dock in window.docks.below if not dock.isHidden()]
        assert [window.docks.widget(dock.objectName()) for dock in seen] == (
            [shown] if shown else []
        )
    window.layouts.choose("Teach")
    assert window.lesson.isVisible()
    window.layouts.choose("Presenter")
    assert window.presenter.on
    window.layouts.save("Live")
    assert "Expected a name" in window.statusBar().currentMessage()
    assert window.layouts.own == {}
    window.layouts.choose("Live")
    assert not window.presenter.on


@pytest.mark.full
def test_the_skin_is_not_drawn_while_the_window_is_arranged(window: MainWindow) -> None:
    assert not window.presenter.on
    drawn = []
    window.membrane.drawn.connect(lambda: drawn.append(None))

    for name in ("Live", "Teach", "Calibrate", "Study", "Presenter", "Live"):
        window.layouts.choose(name)

    assert not drawn
    assert window.membrane.updatesEnabled()


def test_what_refuses_says_what_was_expected() -> None:
    with pytest.raises(Refusal, match="expected format 1, got 7: written by another version"):
        from_text("format = 7")
