"""The presenter, its object dragged along the rim for ten minutes: every object, both themes."""

import json
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

_START = runpy.run_path(str(Path(__file__).parents[2] / "packaging" / "start.py"))
_SECONDS = 600.0

_DRAGGED = """
import json, math, sys, time
import numpy as np
from kappaskin_app import guard
from kappaskin_app.features.membrane.camera import Projection
from kappaskin_app.launch import opened
from PySide6.QtCore import QPoint, QPointF, QTimer, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

LEFT = Qt.MouseButton.LeftButton


def wait_for_object(window, number):
    presenter, end = window.features["presenter"].presenter, time.monotonic() + 60
    objects = presenter.view.controls.objects
    while window.session.making or presenter.feedback is None or objects.checkedId() != number:
        assert time.monotonic() < end, "expected the object, prepared within 60 s"
        QTest.qWait(50)


def drag(window, seconds):
    presenter = window.features["presenter"].presenter
    view, skin = presenter.view, window.features["membrane"].membrane
    plotter, patch = skin.plotter, skin.skin.patch
    sides = np.array([patch.a, patch.b])
    end, moves, rim, painted = time.monotonic() + seconds, 0, 0, [0]
    draw = view.radius_view.draw
    view.radius_view.draw = lambda painter: (draw(painter), painted.append(painted.pop() + 1))
    while time.monotonic() < end:
        for button in view.controls.objects.buttons():
            QTest.mouseClick(button, LEFT)
            QTest.qWait(300)
            wait_for_object(window, view.controls.objects.id(button))
            shares = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)])
            points, _ = skin.skin.at_rest(sides * (0.01 + 0.98 * shares))
            screen = Projection(plotter).to_screen
            corners = [QPointF(*screen(point)) for point in points]
            QTest.mousePress(plotter, LEFT, pos=corners[0].toPoint())
            assert skin.drag.holding, "expected the object at the mouse"
            for begin, stop in zip(corners, corners[1:]):
                for step in range(41):
                    at = begin + step / 40 * (stop - begin)
                    # Half a wave across the rim: on it, outside, and a little inside.
                    at += QPointF(1, 1) * 8 * math.sin(moves / 3)
                    QTest.mouseMove(plotter, at.toPoint())
                    QTest.qWait(15)
                    moves += 1
                    found = presenter.feedback
                    rim += found is not None and found.near_rim
                    if moves % 50 == 0:
                        notch = QPoint(0, 120 if moves % 100 else -120)
                        there = QPointF(plotter.mapToGlobal(at.toPoint()))
                        turned = QWheelEvent(
                            at, there, QPoint(), notch, LEFT, Qt.KeyboardModifier.NoModifier,
                            Qt.ScrollPhase.NoScrollPhase, False,
                        )
                        QApplication.sendEvent(plotter, turned)
            QTest.mouseRelease(plotter, LEFT, pos=corners[-1].toPoint())
            if time.monotonic() > end:
                break
        QTest.keyClick(window, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    return moves, rim, painted[0]


def main():
    errors = []
    guard.on_failure(errors.append)
    application, window = opened("sim:demo")
    presenter = window.features["presenter"].presenter
    presenter.enter()
    wait_for_object(window, 0)
    found = drag(window, float(sys.argv[1]))
    window.close()
    print(json.dumps([*found, errors]))


if __name__ == "__main__":
    main()
"""


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no virtual display")
def test_the_object_is_dragged_along_the_rim_for_ten_minutes(tmp_path: Path) -> None:
    program = tmp_path / "dragged.py"
    program.write_text(_DRAGGED)
    command = [sys.executable, "-X", "faulthandler", str(program), str(_SECONDS)]
    with _START["virtual_display"](dict(os.environ)) as display:
        done = subprocess.run(command, env=display, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    moves, near_rim, painted, errors = json.loads(done.stdout.splitlines()[-1])
    print(
        f"{moves} moves, {near_rim} with a contact near the rim, {painted} pictures of the circle"
    )
    assert errors == []
    assert "Traceback" not in done.stderr
    assert "QPainter" not in done.stderr
    assert moves > 300
    assert near_rim > 0.02 * moves
    assert painted > 0.5 * moves
