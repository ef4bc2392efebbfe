import math
import time
from dataclasses import asdict

import numpy as np
import pytest
from numpy.typing import NDArray
from PySide6.QtCore import QTimer
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QLabel, QScrollBar, QWidget

from kappaskin import Engine, Estimate
from kappaskin.live import Status
from kappaskin_app.shell import badge
from kappaskin_app.shell import window as shell
from kappaskin_app.shell.badge import GAP, LIVE, LOST, OFF, REPLAY, SIM, STALE, WAITING, colour_of
from kappaskin_app.shell.settings import Settings, form_field
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import (
    ALERT,
    COLOUR_MAPS,
    DARK,
    FAINT,
    LIGHT,
    LIGHT_INK,
    OUT,
    SATURATED,
    SERIES,
    THEMES,
    Theme,
    apply_look,
    bar_palette,
    colour_map,
    current,
    follow_look,
)
from kappaskin_app.widgets.colour_bar import ColourBar
from kappaskin_app.widgets.tint import Tint

Array = NDArray[np.float64]

# Machado, Oliveira and Fernandes 2009 (doi:10.1109/TVCG.2009.113), severity 1, linear sRGB.
SEEN_BY = {
    "everybody": np.eye(3),
    "protanopes": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopes": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopes": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
WHITE = TO_XYZ.sum(axis=1)
_ROUNDING = 8  # of 255: less than any two colours of a theme differ


def linear(rgb: Array) -> Array:
    """Linear sRGB from 0 to 1 of (..., 3) from 0 to 255."""
    share = np.asarray(rgb, float) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def rgb_of(colour: str) -> Array:
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], float)


def lab(rgb: Array, seen: Array) -> Array:
    """CIELAB (..., 3) of what somebody sees of colours (..., 3) from 0 to 255."""
    shown = np.clip(linear(rgb) @ seen.T, 0, 1)
    t = shown @ TO_XYZ.T / WHITE
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def contrast(one: str, other: str) -> float:
    """WCAG 2's contrast ratio."""
    light, dark = sorted(linear(rgb_of(c)) @ TO_XYZ[1] + 0.05 for c in (one, other))[::-1]
    return float(light / dark)


@pytest.mark.parametrize("seen", SEEN_BY.values(), ids=SEEN_BY)
@pytest.mark.parametrize("name", COLOUR_MAPS)
class TestMapsSeenByAll:
    def test_brightness_alone_orders_the_map_of_one_sign(self, name: str, seen: Array) -> None:
        sequential, pulled, _ = colour_map(name)
        lightness = lab(sequential, seen)[:, 0]
        assert np.all(np.diff(lightness[::8]) > 0.5)
        assert lightness[-1] - lightness[0] > 60
        assert np.array_equal(pulled, sequential[::-1])

    def test_both_signs_are_further_from_zero_the_larger_and_alike(
        self, name: str, seen: Array
    ) -> None:
        lightness = lab(colour_map(name).diverging, seen)[:, 0]
        below, above = lightness[127::-8], lightness[128::8]
        darker = -1 if lightness[128] > lightness[0] else 1
        assert np.all(darker * np.diff(below) > 0)
        assert np.all(darker * np.diff(above) > 0)
        assert np.abs(below - above).max() < 20

    def test_the_two_signs_are_told_apart(self, name: str, seen: Array) -> None:
        colours = lab(colour_map(name).diverging, seen)
        below, above = colours[127 - 25 :: -1], colours[128 + 25 :]
        assert np.linalg.norm(below - above, axis=-1).min() > 10


@pytest.mark.parametrize("name", COLOUR_MAPS)
def test_marks_and_ink_stand_out_from_every_map(name: str) -> None:
    sequential, _, diverging = colour_map(name)
    seen = SEEN_BY["everybody"]
    for mark in (OUT, SATURATED):
        for colours in (sequential, diverging):
            away = lab(colours, seen) - lab(rgb_of(mark), seen)
            assert np.linalg.norm(away, axis=-1).min() > 20, mark
    lower_half = [f"#{bytes(rgb).hex()}" for rgb in sequential[:128:5]]
    assert min(contrast(LIGHT_INK, colour) for colour in lower_half) >= 3
    ink = Tint("diverging", (-1.0, 1.0), "", own=diverging).ink
    assert contrast(ink, f"#{bytes(diverging[128]).hex()}") >= 4.5


def test_the_colour_maps_are_those_that_can_be_selected() -> None:
    field = form_field("colour_map")
    assert [name for name, _ in field.options] == list(COLOUR_MAPS)
    assert len(COLOUR_MAPS) == 5


def test_another_colour_map_repaints_what_is_shown(qtbot) -> None:
    bar = ColourBar()
    qtbot.addWidget(bar)
    apply_look(THEMES["dark"])
    bar.show_tint(Tint("sequential", (0.0, 1.0), "mm"))
    bar.resize(60, 200)
    bar.show()
    qtbot.waitExposed(bar)
    painted: list[int] = []
    for name in ("viridis", "standard"):
        apply_look(THEMES["dark"], colours=name)
        top = bar.grab().toImage().pixelColor(10, 30).getRgb()[:3]
        near = np.abs(colour_map(name).sequential[-20:].astype(int) - top).sum(axis=1).min()
        painted.append(int(near))
    assert max(painted) < 12


@pytest.mark.parametrize("seen", SEEN_BY.values(), ids=SEEN_BY)
class TestSeenByAll:
    @pytest.mark.parametrize("ground", [0, 1], ids=["light", "dark"])
    def test_curves_are_told_apart(self, seen: Array, ground: int) -> None:
        colours = lab(np.array([rgb_of(pair[ground]) for pair in SERIES[:4]]), seen)
        apart = np.linalg.norm(colours[:, None] - colours, axis=-1)
        assert apart[~np.eye(4, dtype=bool)].min() > 10


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
class TestContrast:
    def test_all_text_stands_out_from_every_ground(self, theme: Theme) -> None:
        colours = asdict(theme)
        for ink in ("text", "faint", "alert"):
            for ground in ("window", "base"):
                assert contrast(colours[ink], colours[ground]) >= 4.5, (ink, ground)

    def test_what_is_written_on_the_skins_ground_stands_out(self, theme: Theme) -> None:
        for ground in (theme.scene, theme.scene_top):
            assert contrast(theme.text, ground) >= 4.5
            assert contrast(theme.alert, ground) >= 4.5

    def test_white_stands_out_from_every_state(self, theme: Theme) -> None:
        for state in (LIVE, SIM, REPLAY, WAITING, STALE, LOST, OFF, GAP):
            assert contrast("#ffffff", colour_of(state, theme)) >= 4.5, state


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_what_is_chosen_and_links_stand_out(theme: Theme) -> None:
    assert contrast(theme.on_accent, theme.accent) >= 5
    assert contrast(theme.accent, theme.base) >= 4.5
    assert contrast(theme.accent, theme.window) >= 4.5


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_the_handle_of_a_scroll_bar_is_lighter_than_its_groove(
    qapp: QApplication, theme: Theme
) -> None:
    qapp.setStyle("Fusion")
    bar = QScrollBar()
    bar.resize(16, 300)
    bar.setRange(0, 100)
    bar.setPageStep(50)
    bar.setPalette(bar_palette(theme))
    seen = bar.grab().toImage()
    assert seen.pixelColor(8, 60).lightness() > seen.pixelColor(8, 250).lightness() + 10


def test_the_palette_tells_which_theme_is_in_use(qapp: QApplication) -> None:
    for theme in THEMES.values():
        apply_look(theme)
        assert current() is theme


@pytest.mark.parametrize("role", [FAINT, ALERT])
def test_a_label_of_a_role_has_its_colour_in_each_theme(qapp: QApplication, role: object) -> None:
    label = QLabel("Some words")
    label.setForegroundRole(role)
    for theme in THEMES.values():
        apply_look(theme)
        qapp.processEvents()
        wanted = theme.faint if role is FAINT else theme.alert
        assert label.palette().color(label.foregroundRole()).name() == wanted


def test_what_follows_the_look_is_called_at_once_and_at_each_change(
    qapp: QApplication, until
) -> None:
    seen: list[Theme] = []
    widget = QWidget()
    follow_look(widget, lambda: seen.append(current()))
    assert seen == [current()]
    widget.show()
    for theme in THEMES.values():
        apply_look(theme)
        qapp.processEvents()
        assert seen[-1] is theme
    apply_look(seen[-1], 150)
    count = len(seen)
    qapp.processEvents()
    assert len(seen) == count + 1
    widget.hide()
    apply_look(DARK if seen[-1] is LIGHT else LIGHT)
    qapp.processEvents()
    assert len(seen) == count + 1
    widget.show()
    assert seen[count + 1 :] == [current()]
    widget.close()
    apply_look(seen[count])
    until(lambda: seen[count + 2 :] == [current()])


@pytest.fixture(scope="module")
def felt() -> tuple[Status, Estimate]:
    """What a window is told of a simulated skin."""
    engine = Engine()
    engine.connect("sim:centre")
    while (estimate := engine.latest(engine.status())) is None:
        time.sleep(0.01)
    status = engine.status()
    engine.close()
    return status, estimate


def parts_of(window: MainWindow) -> dict[str, QWidget]:
    """All that a window shows, by name."""
    docks = {name: window.docks.widget(name) for name in window.docks.by_name()}
    panels = {panel.title(): panel for panel in window.panels.all()}
    frame = {"header": window.display.header, "foot": window.display.status_bar}
    centre = {"skin": window.membrane, "scale": window.scale, "timeline": window.timeline}
    view = {"transport": window.transport, "controls": window.presenter_view.controls}
    view |= {
        f"indicator {number}": indicator
        for number, indicator in enumerate(window.presenter_view.indicators)
    }
    return {**docks, **panels, **frame, **centre, **view}


def know_noise(window: MainWindow, status: Status, estimate: Estimate, qtbot) -> None:
    """Wait for the noise of the displacement, which is computed in the background."""
    colouring = window.display.colouring
    window.session.blockSignals(True)
    colouring.follow(status)
    qtbot.waitUntil(lambda: colouring.noise("displacement", estimate) > 0)
    window.session.blockSignals(False)


def show_much(window: MainWindow, status: Status, estimate: Estimate) -> None:
    """Show what is felt, and nothing that comes later."""
    window.session.status, window.session.estimate = status, estimate
    window.session.reported.emit(status)
    window.display.show_estimate(estimate)
    window.session.blockSignals(True)  # so that nothing else is shown
    window.session.engine.status = lambda: status  # nor the loads of a later time
    window.timeline.show_time(1.0, True)
    say_much(window)


def say_much(window: MainWindow) -> None:
    """Say in each panel what it is for, and a warning or a hint."""
    window.display.notice.show_warning("Too near the rim")
    for number, panel in enumerate(window.panels.all()):
        panel.help.setChecked(True)
        panel.show_message("A message", hint=number % 2 == 0)


def all_followed(window: MainWindow) -> bool:
    """Whether the hidden widgets of a window, which follow later, show its look."""
    timers = window.findChildren(QTimer)
    return not any(t.isActive() for t in timers if type(t).__name__ == "_LookFollower")


def alike(one: QImage, other: QImage) -> bool:
    """Whether two pictures are equal but for how Qt rounds the edges of large letters."""
    if one == other or one.size() != other.size():
        return one == other
    pixels = [
        np.frombuffer(image.convertToFormat(QImage.Format.Format_RGB32).constBits(), np.uint8)
        for image in (one, other)
    ]
    return bool(np.max(np.abs(pixels[0].astype(int) - pixels[1])) <= _ROUNDING)


@pytest.mark.cases("dark")
@pytest.mark.slow
@pytest.mark.parametrize("theme", THEMES)
def test_a_window_that_is_switched_is_as_one_that_began_so(
    opened, felt, qtbot, monkeypatch: pytest.MonkeyPatch, theme: str
) -> None:
    def pictures() -> dict[str, QImage]:
        return {name: part.grab().toImage() for name, part in parts_of(window).items()}

    def settled() -> dict[str, QImage]:
        """Pictures once no more scroll bars come or go, as grabbing a hidden part lays it out."""
        before, now = {}, pictures()
        while now != before:
            qtbot.wait(20)
            before, now = now, pictures()
        return now

    monkeypatch.setattr(badge, "_STALE_AFTER", math.inf)  # however long a picture takes
    found = list[dict[str, QImage]]()
    for begun in THEMES:
        monkeypatch.setattr(shell, "settings_for", lambda *_, begun=begun: Settings(theme=begun))
        window = opened("sim:")
        know_noise(window, *felt, qtbot)
        show_much(window, *felt)
        qtbot.wait(100)
        window.display.ages = list  # how many were drawn in a second depends on the computer
        window.history.change("Theme", -1, theme=theme)
        say_much(window)  # as one or the other panel says something else with other settings
        qtbot.waitUntil(lambda window=window: all_followed(window))
        found.append(settled())
        window.close()
    one, other = found
    assert [name for name in one if not alike(one[name], other[name])] == []
