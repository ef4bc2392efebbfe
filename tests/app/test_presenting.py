"""The operator's view in a real window: in and out, moved by a hand, lost, and read from afar."""

import math
import os
import subprocess
import sys
from importlib.resources import files

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QFontMetricsF
from PySide6.QtWidgets import QDockWidget

from kappaskin_app.cue import Cue, Roundness
from kappaskin_app.theme import THEMES
from kappaskin_app.views.badge import GAP, LIVE, LOST, OFF, SIM, STALE, WAITING
from kappaskin_app.views.banner import REMEDIES
from kappaskin_app.views.clock import Clock
from kappaskin_app.views.colour_bar import SkinScale
from kappaskin_app.views.lettering import CAPTION, PRIMARY
from kappaskin_app.views.pad import Hand
from kappaskin_app.views.stage import Stage
from kappaskin_app.views.strip import age_in_words

LEFT = Qt.MouseButton.LeftButton
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


@pytest.fixture
def demo(opened, until):
    """The window on the demonstration, presenting, once something is felt."""
    window = opened("sim:demo")
    until(lambda: window.badge.state == "SIM")
    window.presenting.enter()
    until(lambda: window.presenting.cue is not None)
    until(lambda: window.presenting.stage.operator.pad.height() > 100)
    return window


def stage_of(size, qtbot, theme="light"):
    stage = Stage(_Skin())
    qtbot.addWidget(stage)
    stage.show_theme(THEMES[theme])
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
from kappaskin_app.views.stage import Stage
from kappaskin_app.cue import Cue, Roundness
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
    from kappaskin_app.views.badge import colour_of

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


# In a window.


def _size(dock):
    return dock.size().toTuple() if dock.isVisible() else (0, 0)


def layout_of(window):
    docks = window.findChildren(QDockWidget)
    return (
        window.geometry(),
        window.windowState(),
        sorted((d.objectName(), not d.visibleRegion().isEmpty(), *_size(d)) for d in docks),
        [window.menuBar().isVisible(), window.statusBar().isVisible(), window.badge.isVisible()],
    )


def test_leaving_gives_the_window_back_as_it_was(window, until, qtbot) -> None:
    window.actions_by_name["dock-cost"].trigger()
    window.actions_by_name["dock-scene"].trigger()
    window.actions_by_name["dock-curvature"].trigger()
    qtbot.wait(300)
    was = layout_of(window)

    qtbot.keyClick(window, Qt.Key.Key_F11)
    until(lambda: window.presenting.on)
    window.resize(1600, 900)
    qtbot.wait(300)
    assert not any(dock.isVisible() for dock in window.findChildren(QDockWidget))
    assert not window.menuBar().isVisible()
    qtbot.keyClick(window, Qt.Key.Key_Escape)

    assert not window.presenting.on
    until(lambda: layout_of(window) == was)


def test_shortcuts_work_while_presenting(demo, qtbot, until) -> None:
    theme = demo.history.settings.theme
    qtbot.keyClick(demo, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    assert demo.history.settings.theme != theme
    assert demo.presenting.stage.force.theme is THEMES[demo.history.settings.theme]
    qtbot.keyClick(demo, Qt.Key.Key_F11)
    until(lambda: not demo.presenting.on)


def test_escape_during_a_drag_gives_it_up_and_stays(demo, qtbot) -> None:
    pad = demo.presenting.stage.operator.pad
    qtbot.mousePress(pad, LEFT, pos=pad.seen_at(0.06, 0.06).toPoint())
    qtbot.keyClick(pad, Qt.Key.Key_Escape)
    assert demo.presenting.on
    qtbot.mouseRelease(pad, LEFT)
    qtbot.keyClick(pad, Qt.Key.Key_Escape)
    assert not demo.presenting.on


def test_a_drag_on_the_pad_moves_the_contact_and_the_cue_follows(demo, until, qtbot) -> None:
    pad, count = demo.presenting.stage.operator.pad, demo.history.stack.count()
    until(lambda: abs(demo.presenting.cue.position[0] - 0.05) < 0.002)
    start, end = pad.seen_at(0.05, 0.05).toPoint(), pad.seen_at(0.065, 0.04).toPoint()
    qtbot.mousePress(pad, LEFT, pos=start)
    for step in range(1, 9):
        qtbot.mouseMove(pad, start + (end - start) * step / 8)
        qtbot.wait(20)
    until(lambda: abs(demo.session.scene.stimuli[0].what.x - 0.065) < 0.001)
    # The skin is inclined there: the ball touches it further out than where the hand is.
    until(lambda: math.dist(demo.presenting.cue.position, (0.0708, 0.0372)) < 0.0015)
    assert math.dist(demo.session.estimate.true_contact, (0.0708, 0.0372)) < 0.001
    qtbot.mouseRelease(pad, LEFT, pos=end)
    until(lambda: demo.history.stack.count() == count + 1)
    until(lambda: abs(demo.session.scene.stimuli[0].what.x - 0.065) < 0.001)
    demo.history.stack.undo()
    until(lambda: abs(demo.presenting.cue.position[0] - 0.05) < 0.002)


def test_pressing_harder_is_felt(demo, until, qtbot) -> None:
    presenting = demo.presenting
    pad, force = presenting.stage.operator.pad, lambda: presenting.cue.force
    until(lambda: abs(force() - 0.5) < 0.02)
    for _ in range(4):
        qtbot.keyClick(pad, Qt.Key.Key_PageDown)
    lighter = 0.5 / 1.08**4
    until(lambda: abs(force() - lighter) < 0.02)
    until(lambda: f"{lighter:.2f} N" in presenting.stage.operator.told.words()[0].text)
    until(lambda: not pad.holding)
    assert f"force = {lighter:.4g}" in demo.history.settings.written.text
    assert presenting.stage.force.value.endswith(" N")


def test_no_hand_presses_the_skin_out_of_the_picture(demo, until, qtbot) -> None:
    pad = demo.presenting.stage.operator.pad
    for _ in range(60):
        qtbot.keyClick(pad, Qt.Key.Key_PageUp)
    until(lambda: not pad.holding)
    assert 0.5 < demo.session.scene.stimuli[0].what.force < 0.8
    until(lambda: demo.badge.state == "SIM")
    until(lambda: demo.presenting.cue and 0.5 < demo.presenting.cue.force < 0.8)


def test_another_object_is_chosen_and_felt_at_the_same_place(demo, until, qtbot) -> None:
    stage = demo.presenting.stage
    things = stage.operator.things
    until(lambda: things.checkedId() == 0)
    until(lambda: stage.radius.name == "Radius of the ball")
    qtbot.mouseClick(things.button(2), LEFT)
    until(lambda: things.checkedId() == 2)
    until(lambda: abs((demo.presenting.cue.roundness or NONE).radius - 0.08) < 0.006)
    qtbot.mouseClick(things.button(4), LEFT)
    until(lambda: stage.radius.value == "edge")
    for _ in range(2):
        demo.history.stack.undo()
    until(lambda: things.checkedId() == 0)


NONE = Roundness("", math.nan, (0.0, math.inf))


def test_the_estimate_drives_the_cue_and_not_the_truth(demo, until) -> None:
    fewer = demo.history.settings.functions_x - 3
    demo.history.change("Fewer", -1, functions_x=fewer, functions_y=fewer)
    until(lambda: demo.session.estimate.coefficients.shape == (fewer, fewer))
    demo.presenting.cue = None
    until(lambda: demo.presenting.cue is not None)
    deepest = 1e-3 * float(demo.presenting.stage.displacement.value.removesuffix(" mm"))
    until(lambda: demo.presenting.stage.displacement.value != "\N{EN DASH}")
    assert deepest == pytest.approx(demo.session.estimate.surface.max(), rel=0.05)


def test_a_lost_line_says_what_to_do_and_what_is_felt_comes_back(demo, until) -> None:
    stage = demo.presenting.stage
    demo.session.connect_to("/dev/ttyNOWHERE")
    until(lambda: stage.strip.state == LOST)
    assert stage.pages.currentWidget() is stage.banner
    assert "there is no such port" in stage.banner.why
    assert "Check the cable" in stage.banner.remedy
    assert demo.presenting.cue is None
    assert not stage.operator.isVisible()
    until(lambda: stage.banner.since.endswith(" s"))
    demo.session.connect_to("sim:demo")
    until(lambda: stage.strip.state == SIM and stage.pages.currentWidget() is not stage.banner)
    until(lambda: demo.presenting.cue is not None)


def test_a_recording_that_stands_is_felt_where_it_stands(opened, recording, until) -> None:
    window = opened(f"replay:{recording}")
    until(lambda: window.badge.state == "REPLAY")
    window.replaying.go(False)
    window.replaying.seek(0.3)
    until(lambda: window.session.status.replay.at == 0.3)
    until(lambda: window.session.estimate and 28 < window.session.estimate.sequence < 33)
    window.presenting.enter()
    stage = window.presenting.stage
    until(lambda: stage.force.value.endswith(" N"))
    window.replaying.seek(1.4)
    until(lambda: stage.strip.state == GAP)
    until(lambda: (stage.force.value, stage.force.note) == ("\N{EN DASH}", "no reading"))
    assert (stage.strip.age, stage.radius.name) == ("", "Radius of what touches")


def test_nothing_that_touches_is_said_to_be_nothing(demo, until) -> None:
    text = demo.history.settings.written.text
    demo.wishes.write(text[: text.index("[[touch]]")])
    until(lambda: demo.presenting.stage.force.note == "nothing felt")
    assert not demo.presenting.stage.operator.isVisible()


def test_a_moving_simulation_of_the_panels_is_held_and_pressed_too(window, until, qtbot) -> None:
    window.presenting.enter()
    stage = window.presenting.stage
    pad = stage.operator.pad
    until(lambda: pad.hand is not None and pad.height() > 100)
    assert not stage.operator.things.button(0).isVisible()
    qtbot.mousePress(pad, LEFT, pos=pad.seen_at(0.04, 0.06).toPoint())
    qtbot.mouseRelease(pad, LEFT)
    settings = window.history.settings
    assert (settings.load_case, settings.x) == ("point", pytest.approx(0.04, abs=0.001))
    force = settings.force
    qtbot.keyClick(pad, Qt.Key.Key_PageUp)
    until(lambda: window.history.settings.force == pytest.approx(1.08 * force))
    until(lambda: not pad.holding)


def test_the_3d_arrow_is_still_dragged_while_presenting(demo, until, qtbot) -> None:
    until(lambda: len(demo.membrane.drag.handles) == 1)
    view = demo.membrane
    start = view.drag.on_screen().toPoint() - QPoint(0, 8)
    qtbot.mousePress(view.plotter, LEFT, pos=start)
    qtbot.mouseMove(view.plotter, start + QPoint(30, 0))
    until(lambda: demo.session.scene.stimuli[0].what.x > 0.052)
    qtbot.keyClick(view.plotter, Qt.Key.Key_Escape)
    assert demo.presenting.on
    until(lambda: demo.session.scene.stimuli[0].what.x == 0.05)
    qtbot.mouseRelease(view.plotter, LEFT, pos=start)


def test_a_scene_that_is_refused_says_so_beside_the_pad_until_it_is_taken_back(
    demo, until, qtbot
) -> None:
    told, things = demo.presenting.stage.operator.told, demo.presenting.stage.operator.things
    until(lambda: things.button(0).isVisible())
    demo.wishes.write(demo.history.settings.written.text.replace("radius", "radios"))
    until(lambda: "expected radius" in told.words()[1].text)
    assert "Ctrl+Z" in told.words()[1].text
    assert told.words()[1].fits
    assert not things.button(0).isVisible()
    qtbot.keyClick(demo, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(lambda: "expected" not in told.words()[1].text)


def test_two_points_pressed_harder_keep_their_share(window, until, qtbot) -> None:
    window.history.change("Two", -1, load_case="two-points", force=0.1)
    window.presenting.enter()
    pad = window.presenting.stage.operator.pad
    until(lambda: pad.hand is not None and pad.hand.force == pytest.approx(0.05))
    qtbot.keyClick(pad, Qt.Key.Key_PageUp)
    until(lambda: window.history.settings.force == pytest.approx(0.108))
    until(lambda: not pad.holding)


def test_the_page_on_the_demonstration_names_what_is_there(demo) -> None:
    page = (files("kappaskin_resources") / "demonstration" / "demonstration.md").read_text("utf-8")
    for button in demo.presenting.stage.operator.things.buttons():
        assert button.text() in page
    assert demo.actions_by_name["present"].shortcut().toString() == "F11"
    assert demo.actions_by_name["sound"].shortcut().toString() == "F12"
