"""The pad by itself: what keys, mouse and wheel want, and when they want nothing."""

import math

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QFocusEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from kappaskin.hand import HandTarget, OperatorLimits
from kappaskin_app.features.operator.pad import Pad

LIMITS = OperatorLimits(speed=0.1, turn_rate=0.5, grip=4.0, reach=(0.05, 0.05, 0.05))
SHIFT = Qt.KeyboardModifier.ShiftModifier
HERE = HandTarget((0.01, 0.0, 0.0), grip=1.0)


@pytest.fixture
def pad(qtbot) -> Pad:
    made = Pad()
    qtbot.addWidget(made)
    made.setMouseTracking(True)
    made.resize(224, 202)
    made.show_target(HERE, LIMITS, moving=False)
    return made


def wanted(pad: Pad, seconds: float = 0.01) -> HandTarget | None:
    return pad.wanted(HERE, LIMITS, seconds)


@pytest.mark.parametrize(
    ("key", "way"),
    [
        (Qt.Key.Key_Left, (-1, 0, 0)),
        (Qt.Key.Key_D, (1, 0, 0)),
        (Qt.Key.Key_Up, (0, 1, 0)),
        (Qt.Key.Key_S, (0, -1, 0)),
        (Qt.Key.Key_PageUp, (0, 0, 1)),
        (Qt.Key.Key_Q, (0, 0, -1)),
    ],
)
def test_a_key_moves_the_hand_at_the_largest_speed_while_it_is_held(pad, key, way) -> None:
    assert wanted(pad) is None
    QTest.keyPress(pad, key)
    assert wanted(pad).position == pytest.approx(
        (0.01 + 1e-3 * way[0], *(1e-3 * w for w in way[1:]))
    )
    QTest.keyRelease(pad, key)
    assert wanted(pad) is None


@pytest.mark.parametrize(
    ("key", "turn"),
    [
        (Qt.Key.Key_Right, (0, 1, 0)),
        (Qt.Key.Key_W, (-1, 0, 0)),
        (Qt.Key.Key_E, (0, 0, 1)),
    ],
)
def test_with_shift_a_key_rolls_the_hand_that_way(pad, key, turn) -> None:
    QTest.keyPress(pad, key, SHIFT)
    assert wanted(pad).rotation == pytest.approx([0.005 * each for each in turn])
    assert wanted(pad).position == HERE.position
    QTest.keyRelease(pad, key, SHIFT)
    assert wanted(pad) is None


def test_plus_and_minus_close_and_open(pad) -> None:
    QTest.keyPress(pad, Qt.Key.Key_Plus, SHIFT)
    assert wanted(pad).grip == pytest.approx(1.04)
    QTest.keyRelease(pad, Qt.Key.Key_Equal)  # Shift was let go of first
    assert wanted(pad) is None
    QTest.keyPress(pad, Qt.Key.Key_Minus)
    assert wanted(pad).grip == pytest.approx(0.96)


def test_a_drag_moves_the_hand_by_as_much_of_the_workspace(pad, points_at) -> None:
    QTest.mousePress(pad, Qt.MouseButton.LeftButton, pos=QPoint(100, 100))
    points_at(pad, QPoint(120, 90))
    assert wanted(pad).position == pytest.approx((0.02, 0.005, 0.0))
    assert wanted(pad).rotation == HERE.rotation
    gripped = HandTarget(HERE.position, grip=3.0)  # meanwhile, by the slider
    assert pad.wanted(gripped, LIMITS, 0.01).grip == 3.0
    QTest.mouseRelease(pad, Qt.MouseButton.LeftButton, pos=QPoint(120, 90))
    assert wanted(pad) is None


def test_with_shift_a_drag_rolls_it(pad, points_at) -> None:
    QTest.mousePress(pad, Qt.MouseButton.LeftButton, SHIFT, QPoint(100, 100))
    points_at(pad, QPoint(120, 100))
    roll, pitch, yaw = wanted(pad).rotation
    assert (roll, yaw) == pytest.approx((0.0, 0.0))
    assert pitch == pytest.approx(0.1)
    assert wanted(pad).position == HERE.position
    QTest.mouseRelease(pad, Qt.MouseButton.LeftButton, pos=QPoint(120, 100))


def turn_wheel(pad: Pad, notches: int, modifiers=Qt.KeyboardModifier.NoModifier) -> None:
    at = QPointF(100, 100)
    way = QPoint(0, 120 * notches)
    none, phase = Qt.MouseButton.NoButton, Qt.ScrollPhase.NoScrollPhase
    event = QWheelEvent(at, at, QPoint(), way, none, modifiers, phase, False)
    QApplication.sendEvent(pad, event)


def test_the_wheel_moves_it_up_and_down_and_ends_there(pad) -> None:
    turn_wheel(pad, 2)
    assert wanted(pad).position == pytest.approx((0.01, 0.0, 2e-3))
    assert pad.wanted(wanted(pad), LIMITS, 0.01) is None
    turn_wheel(pad, -1, SHIFT)
    assert wanted(pad).rotation == pytest.approx((0.0, 0.0, -0.05))


@pytest.mark.parametrize("lose", ["focus", "hidden"])
def test_a_pad_that_loses_the_focus_wants_nothing(pad, lose) -> None:
    pad.show()
    QTest.keyPress(pad, Qt.Key.Key_Right)
    QTest.mousePress(pad, Qt.MouseButton.LeftButton)
    assert wanted(pad) is not None
    if lose == "focus":
        QApplication.sendEvent(pad, QFocusEvent(QFocusEvent.Type.FocusOut))
    else:
        pad.hide()
    assert wanted(pad) is None
    QTest.mouseRelease(pad, Qt.MouseButton.LeftButton)


def test_escape_lets_go_and_stops(pad, qtbot) -> None:
    QTest.keyPress(pad, Qt.Key.Key_Right)
    with qtbot.waitSignal(pad.stopped):
        QTest.keyPress(pad, Qt.Key.Key_Escape)
    assert wanted(pad) is None


def test_keys_of_the_window_are_left_to_it(pad) -> None:
    QTest.keyPress(pad, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    assert wanted(pad) is None


def test_turns_add_up(pad) -> None:
    target = HERE
    QTest.keyPress(pad, Qt.Key.Key_PageUp, SHIFT)
    for _ in range(100):
        target = pad.wanted(target, LIMITS, 0.01)
    assert target.rotation == pytest.approx((0.0, 0.0, 0.5))
    assert math.dist(target.position, HERE.position) == 0
