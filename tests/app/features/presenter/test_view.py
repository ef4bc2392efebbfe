"""The operator's view by itself: every text fits, and is read from three metres."""

import math
import os
import subprocess
import sys

import pytest
from PySide6.QtGui import QFontMetricsF

from kappaskin_app.features.presenter.feedback import Cue, Roundness
from kappaskin_app.features.presenter.indicators import REMEDIES, age_in_words
from kappaskin_app.features.presenter.pad import Hand
from kappaskin_app.features.presenter.view import Stage
from kappaskin_app.shell.badge import GAP, LIVE, LOST, OFF, SIM, STALE, WAITING
from kappaskin_app.theme import THEMES, apply_look
from kappaskin_app.widgets.colour_bar import SkinScale
from kappaskin_app.widgets.lettering import CAPTION, PRIMARY
from kappaskin_app.widgets.timeline import Clock

CAPITAL = 55  # px: 15 mm on a screen of 24 inches, to be read from three metres
LONGEST = Cue(
    *(-12.345, 0.123, 0.03456, 0.00123, (0.1234, 0.1234), 0.00012, "cylinder", 0.06),
    Roundness("cylinder", 0.1234, (0.1121, 0.1345)),
    near_rim=False,
)
WHY = (
    "/dev/serial/by-id/usb-Kappaskin_SIM-0001: nothing has come for 2 s; is the cable plugged in, "
    "and is no other program using the port? (kappaskin doctor lists the ports found)"
)


def stage_of(size, qtbot, theme="light"):
    stage = Stage(_Skin())
    qtbot.addWidget(stage)
    apply_look(THEMES[theme])
    stage.resize(*size)
    stage.present(True)
    stage.show()
    return stage


def _Skin():
    from PySide6.QtWidgets import QWidget

    skin = QWidget()
    skin.setMinimumSize(320, 240)
    return skin


def boards(stage):
    return [board for board in stage.boards if board.isVisible()] + [stage.operator.told]


def test_the_scale_of_the_colours_is_read_from_afar_and_asks_for_nothing(qtbot) -> None:
    stage, scale, clock = Stage(_Skin()), SkinScale(), Clock("Time")
    for widget in (stage, scale, clock):
        qtbot.addWidget(widget)
    clock.show_text("0.50 s of 4.00 s", "0.00 s of 4.00 s")
    for part in (scale, clock):
        stage.fitted.connect(part.show_unit)
    usual = [QFontMetricsF(part.font()).capHeight() for part in (scale.bar, clock)]
    widths = scale.bar.width(), clock.width()
    stage.resize(1920, 1080)
    stage.present(True)
    heights = [QFontMetricsF(part.font()).capHeight() for part in (scale.bar, clock)]
    assert min(heights) >= CAPTION - 1
    assert not scale.lock.isVisibleTo(scale)
    assert scale.bar.width() > widths[0]
    assert clock.width() > widths[1]
    stage.present(False)
    assert [QFontMetricsF(part.font()).capHeight() for part in (scale.bar, clock)] == usual
    assert (scale.bar.width(), clock.width()) == widths
    assert scale.lock.isVisibleTo(scale)


SIZES = [(1280, 720), (1280, 800), (1920, 1080), (2560, 1440), (1024, 768)]


@pytest.mark.parametrize("size", SIZES)
def test_every_text_fits_and_is_not_made_smaller(size, qtbot) -> None:
    stage = stage_of(size, qtbot)
    stage.operator.show_hand(Hand(0.123, 0.123, 12.34))
    stage.show_cue(LONGEST)
    stage.show_felt(LONGEST, 0.0)
    stage.strip.show_state(LIVE, "Second-generation fingertip, left hand", "1000 ms old")
    for board in boards(stage):
        for words in board.words():
            assert words.fits, words.text
            assert board.rect().toRectF().adjusted(-1, -1, 1, 1).contains(words.place), words.text
    for figure in (stage.force, stage.displacement, stage.place, stage.radius):
        value = next(words for words in figure.words() if words.text == figure.value)
        assert value.font.pixelSize() == figure.letters(PRIMARY, bold=True).pixelSize()
    for button in stage.operator.things.buttons():
        needed = QFontMetricsF(button.font()).horizontalAdvance(button.text())
        assert needed + 8 < button.width()
    stage.close()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("state", [LOST, STALE, WAITING, OFF, GAP])
def test_what_to_do_fits_whole(size, state, qtbot) -> None:
    stage = stage_of(size, qtbot)
    stage.show_trouble(state, "1234 s", WHY)
    assert stage.pages.currentWidget() is stage.banner
    words = stage.banner.words()
    assert [said.text for said in words] == [f"{state} 1234 s", WHY, REMEDIES[state]]
    assert all(said.fits for said in words)
    tops = [said.place.top() for said in words]
    assert tops == sorted(tops)
    stage.close()


def test_figures_are_read_from_three_metres(qtbot) -> None:
    stage = stage_of((1920, 1080), qtbot)
    stage.show_cue(LONGEST)
    stage.strip.show_state(SIM, "Simulated skin", "12 ms old")
    large = [stage.force, stage.displacement, stage.place, stage.radius]
    texts = {figure.value for figure in large} | {SIM, "12 ms old"}
    for board in (*large, stage.strip):
        for words in board.words():
            if words.text in texts:
                assert QFontMetricsF(words.font).capHeight() >= CAPITAL, words.text
                texts.remove(words.text)
    assert not texts
    stage.show_trouble(LOST, "3 s", WHY)
    head, why, remedy = stage.banner.words()
    assert QFontMetricsF(head.font).capHeight() >= CAPITAL
    assert min(QFontMetricsF(w.font).capHeight() for w in (why, remedy)) >= CAPITAL / 2
    stage.close()


_AT_150 = """
from PySide6.QtWidgets import QApplication, QWidget
app = QApplication([]); app.setStyle("Fusion")
import sys; sys.path[:0] = [{here!r}]
from kappaskin_app.features.presenter.view import Stage
from kappaskin_app.features.presenter.feedback import Cue, Roundness
stage = Stage(QWidget()); stage.resize(1280, 720); stage.present(True); stage.show()
assert stage.devicePixelRatioF() == 1.5
stage.show_cue(Cue(-12.345, 0.123, 0.03456, 0.00123, (0.1234, 0.1234), 0.00012, "cylinder", 0.06,
                   Roundness("cylinder", 0.1234, (0.1121, 0.1345)), False))
stage.strip.show_state("LIVE", "Second-generation fingertip, left hand", "1000 ms old")
app.processEvents()
print([w.text for b in stage.boards if b.isVisible() for w in b.words() if not w.fits])
"""


def test_every_text_fits_at_150_per_cent() -> None:
    scaled = {**os.environ, "QT_SCALE_FACTOR": "1.5"}
    code = _AT_150.format(here=os.path.dirname(__file__))
    done = subprocess.run(
        [sys.executable, "-c", code], env=scaled, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr


def luminance(colour: str) -> float:
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    lit = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return sum(w * p for w, p in zip((0.2126, 0.7152, 0.0722), lit, strict=True))


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_letters_stand_out_from_their_ground_without_any_colour(theme, qtbot) -> None:
    from kappaskin_app.shell.badge import colour_of

    stage, colours = stage_of((1280, 720), qtbot, theme), THEMES[theme]
    stage.show_cue(LONGEST)
    for board in boards(stage):
        for words in board.words():
            ground = colours.window
            if board is stage.strip and words.text == stage.strip.state:
                ground = colour_of(words.text, colours)
            assert contrast(board.ink(words), ground) >= 4.5, words.text
    for state in (LIVE, SIM, LOST, STALE, WAITING, OFF):
        assert contrast("#ffffff", colour_of(state, colours)) >= 4.5
    assert contrast(colours.accent, colours.base) >= 3  # the bar
    stage.close()


def test_the_band_holds_the_end_of_the_bar_and_never_vanishes(qtbot) -> None:
    stage = stage_of((1280, 720), qtbot)
    bar = stage.bar
    bar.show_force(0.5, 0.05, 0.0)
    low, high = bar.band()
    assert (low, high) == pytest.approx((bar.at(0.45), bar.at(0.55)))
    bar.show_force(0.5, 1e-9, 0.0)
    low, high = bar.band()
    assert high - low == pytest.approx(3.0)
    assert low < bar.at(0.5) < high
    bar.show_force(0.5, math.nan, 0.0)
    assert bar.band()[1] - bar.band()[0] == pytest.approx(3.0)
    stage.close()


def test_the_circle_is_to_the_scale_of_its_scale_bar(qtbot) -> None:
    stage = stage_of((1280, 720), qtbot)
    view = stage.round
    view.show_roundness(Roundness("sphere", 0.04, (0.038, 0.042)), False, 0.0)
    assert view.circle(0.04).height() == pytest.approx(2 * 0.04 * view.per_metre)
    assert view.bar * view.per_metre <= 0.3 * view.width()
    assert view.circle(0.042).top() >= 0
    assert view.circle(0.042).bottom() == pytest.approx(view.foot.y())
    stage.close()


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.0123, "12 ms old"),
        (12.4, "12 s old"),
        (600.0, "10 min old"),
        (9000.0, "2 h old"),
        (math.nan, ""),
        (math.inf, ""),
    ],
)
def test_an_age_is_told_at_a_glance(seconds, words) -> None:
    assert age_in_words(seconds) == words


def test_an_age_that_is_only_the_least_says_so() -> None:
    assert age_in_words(0.012, True) == "\N{GREATER-THAN OR EQUAL TO}\N{THIN SPACE}12 ms old"
