"""What touches the skin, in words, beside the picture."""

import threading
import time

import pytest

from kappaskin import Pipeline, PointLoad, Setup, Simulator, load_scene
from kappaskin_app.features.contact import recognition
from kappaskin_app.features.contact.recognition import curved


def _estimate(*loads):
    scene = load_scene("centre").touched_by(*loads)
    return Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, time.monotonic))


def test_the_curvature_at_a_contact_is_told_with_its_error_bars():
    words = curved(_estimate(PointLoad(0.05, 0.05, 0.15)))

    assert words.startswith("principal curvatures \N{MINUS SIGN}")
    assert words.endswith("1/m")
    assert words.count("\N{PLUS-MINUS SIGN}") == 2


def test_nothing_is_told_of_a_skin_that_nothing_touches():
    assert curved(_estimate()) == ""


def test_the_window_says_what_touches_the_skin(window, until):
    ends = {"x": 0.04, "y": 0.05, "x_end": 0.06, "y_end": 0.05}  # of a rigid blade
    window.history.change("Blade", -1, load_case="two-points", force=0.2, **ends)
    assert len(window.session.scene.loads) == 2

    until(lambda: window.display.foot.object.text().startswith("edge, 20 mm long, axis "))
    assert "principal curvatures" in window.display.foot.object.text()

    window.session.disconnect_from()
    until(lambda: not window.display.foot.object.text())


def test_what_is_not_yet_known_of_a_skin_is_said_to_be_computed(window, until, monkeypatch):
    until(lambda: "curvatures" in window.display.foot.object.text())
    made, seen = recognition.ObjectFinder, threading.Event()
    monkeypatch.setattr(recognition, "ObjectFinder", lambda *of: seen.wait(60) and made(*of))
    window.requests.set("shape", "cylinder")
    until(lambda: "computing what objects read like" in window.display.foot.object.text())
    seen.set()
    until(lambda: "curvatures" in window.display.foot.object.text())


def test_a_skin_that_objects_cannot_be_told_on_says_so(window, until):
    window.history.change("Elements", -1, elements_x=50, elements_y=50)

    until(lambda: "at most 2000 elements" in window.display.foot.object.text())


@pytest.mark.fails_inside
def test_what_fails_once_is_told_once_and_the_next_estimate_is_named(
    window, until, monkeypatch
) -> None:
    until(lambda: "curvatures" in window.display.foot.object.text())
    told: list[str] = []
    window.statusBar().messageChanged.connect(lambda text: text and told.append(text))

    def fail_once(estimate):
        monkeypatch.undo()
        raise ZeroDivisionError("once")

    monkeypatch.setattr("kappaskin_app.features.contact.recognition.curved", fail_once)
    until(lambda: told)
    named: list[str] = []
    window.naming.named.connect(named.append)
    until(lambda: named)

    assert told == ["Something went wrong: once"]
