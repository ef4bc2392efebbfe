from dataclasses import asdict

import numpy as np
import pytest
from numpy.typing import NDArray
from PySide6.QtWidgets import QApplication, QScrollBar

from kappaskin_app.shell.badge import GAP, LIVE, LOST, OFF, REPLAY, SIM, STALE, WAITING, colour_of
from kappaskin_app.theme import (
    DARK_INK,
    DIVERGING,
    LIGHT_INK,
    PULLED,
    SEQUENTIAL,
    SERIES,
    THEMES,
    Theme,
    bar_palette,
)

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
class TestSeenByAll:
    def test_brightness_alone_orders_the_map_of_one_sign(self, seen: Array) -> None:
        for colours, sign in ((SEQUENTIAL, 1), (PULLED, -1)):
            lightness = lab(colours, seen)[:, 0]
            assert np.all(sign * np.diff(lightness[::8]) > 0.5)
            assert abs(lightness[-1] - lightness[0]) > 60

    def test_both_signs_are_darker_the_larger_and_alike(self, seen: Array) -> None:
        lightness = lab(DIVERGING, seen)[:, 0]
        below, above = lightness[127::-8], lightness[128::8]
        assert np.all(np.diff(below) < 0)
        assert np.all(np.diff(above) < 0)
        assert np.abs(below - above).max() < 20

    def test_the_two_signs_are_told_apart(self, seen: Array) -> None:
        colours = lab(DIVERGING, seen)
        below, above = colours[127 - 25 :: -1], colours[128 + 25 :]
        assert np.linalg.norm(below - above, axis=-1).min() > 10

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


def test_ink_on_the_maps_stands_out_where_it_is_used() -> None:
    lower_half = [f"#{bytes(rgb).hex()}" for rgb in SEQUENTIAL[:128:5]]
    assert min(contrast(LIGHT_INK, colour) for colour in lower_half) >= 3
    assert contrast(DARK_INK, f"#{bytes(DIVERGING[128]).hex()}") >= 4.5


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_what_is_chosen_and_links_stand_out(theme: Theme) -> None:
    assert contrast(theme.base, theme.accent) >= 4.5
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
