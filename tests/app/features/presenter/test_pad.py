"""The pad by itself: what a hand does there, in words of signals."""

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QApplication

from kappaskin import Disk, Patch
from kappaskin_app.features.presenter.pad import Hand, Pad

LEFT = Qt.MouseButton.LeftButton
SHIFT = Qt.KeyboardModifier.ShiftModifier


@pytest.fixture
def pad(qtbot):
    pad = Pad()
    qtbot.addWidget(pad)
    pad.resize(220, 220)
    pad.show_skin(Patch(0.1, 0.1))
    pad.show_hand(Hand(0.05, 0.05, 0.5))
    pad.said = []
    for name in ("grabbed", "dragged", "pressed", "released", "cancelled"):
        getattr(pad, name).connect(lambda *said, name=name: pad.said.append((name, *said)))
    pad.show()
    yield pad
    pad.close()


def notch(pad, times, buttons=Qt.MouseButton.NoButton):
    here = QPointF(pad.rect().center())
    event = QWheelEvent(
        here,
        QPointF(pad.mapToGlobal(here.toPoint())),
        QPoint(0, 0),
        QPoint(0, 120 * times),
        buttons,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(pad, event)


def at(pad, x, y):
    return pad.to_pixel(x, y).toPoint()


def test_a_drag_grabs_moves_and_lets_go(pad, qtbot) -> None:
    qtbot.mousePress(pad, LEFT, pos=at(pad, 0.03, 0.06))
    qtbot.mouseMove(pad, at(pad, 0.07, 0.02))
    qtbot.mouseRelease(pad, LEFT, pos=at(pad, 0.07, 0.02))

    assert [said[0] for said in pad.said] == ["grabbed", "dragged", "dragged", "released"]
    assert pad.said[0] == ("grabbed", 0.05, 0.05)
    assert pad.said[1][1:] == pytest.approx((0.03, 0.06), abs=5e-4)
    assert pad.said[2][1:] == pytest.approx((0.07, 0.02), abs=5e-4)


def test_a_drag_beside_the_skin_stays_on_it(pad, qtbot) -> None:
    qtbot.mousePress(pad, LEFT, pos=QPoint(1, 1))
    assert pad.said[1] == ("dragged", 0.0, 0.1)
    qtbot.mouseRelease(pad, LEFT)


def test_shift_and_drag_presses_and_leaves_the_place(pad, qtbot) -> None:
    qtbot.mousePress(pad, LEFT, SHIFT, QPoint(110, 110))
    for y in (60.0, 110.0):
        here = QPointF(110.0, y)
        there = QPointF(pad.mapToGlobal(here.toPoint()))
        kind = QEvent.Type.MouseMove
        QApplication.sendEvent(pad, QMouseEvent(kind, here, there, LEFT, LEFT, SHIFT))
    qtbot.mouseRelease(pad, LEFT, SHIFT)

    (grabbed, _, _), (up, harder), (back, again), released = pad.said
    assert (grabbed, up, back, *released) == ("grabbed", "pressed", "pressed", "released")
    assert harder == pytest.approx(1.01**50)
    assert again == pytest.approx(1.0)


def test_the_wheel_presses_in_one_hold_and_lets_go_by_itself(pad, until) -> None:
    for _ in range(3):
        notch(pad, 1)
    notch(pad, -1)
    assert [said[0] for said in pad.said] == ["grabbed", *["pressed"] * 4]
    times = [said[1] for said in pad.said[1:]]
    assert times == [*sorted(times[:3]), pytest.approx(times[1])]
    assert times[0] > 1
    until(lambda: pad.said[-1] == ("released",))


def test_keys_move_and_press(pad, qtbot, until) -> None:
    for key in (Qt.Key.Key_Right, Qt.Key.Key_Right, Qt.Key.Key_Down, Qt.Key.Key_PageUp):
        qtbot.keyClick(pad, key)
    names = [said[0] for said in pad.said]
    assert names == ["grabbed", "dragged", "dragged", "dragged", "pressed"]
    assert pad.said[2][1:] == pytest.approx((0.052, 0.05))
    assert pad.said[3][1:] == pytest.approx((0.052, 0.049))
    assert pad.said[4][1] > 1
    until(lambda: pad.said[-1] == ("released",))


def test_escape_gives_up_what_is_held_and_else_is_anothers(pad, qtbot) -> None:
    qtbot.keyClick(pad, Qt.Key.Key_Left)
    qtbot.keyClick(pad, Qt.Key.Key_Escape)
    assert pad.said[-1] == ("cancelled",)
    pad.said.clear()
    qtbot.keyClick(pad, Qt.Key.Key_Escape)
    qtbot.wait(500)
    assert not pad.said


def test_a_hand_that_is_not_there_does_nothing(pad, qtbot) -> None:
    pad.show_hand(None)
    qtbot.mousePress(pad, LEFT, pos=QPoint(100, 100))
    qtbot.mouseMove(pad, QPoint(50, 50))
    notch(pad, 1)
    qtbot.keyClick(pad, Qt.Key.Key_Left)
    qtbot.mouseRelease(pad, LEFT)
    assert not pad.said


def test_losing_the_focus_lets_go(pad, qtbot) -> None:
    qtbot.keyClick(pad, Qt.Key.Key_Left)
    pad.clearFocus()
    pad.release()
    assert pad.said[-1] == ("released",)
    assert not pad.holding


@pytest.mark.parametrize("patch", [Patch(0.04, 0.02), Patch(0.02, 0.2), Disk(0.05)])
def test_places_are_seen_where_they_are_pointed_at(pad, patch) -> None:
    pad.show_skin(patch)
    for share in (0.1, 0.5, 0.8):
        x, y = share * patch.a, (1 - share) * patch.b
        assert pad.to_skin(pad.to_pixel(x, y)) == pytest.approx((x, y))
    assert pad.rect().toRectF().contains(pad.skin)
