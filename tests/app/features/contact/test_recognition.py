"""Object recognition: its text in the status bar."""

import threading
import time
from dataclasses import replace

import pytest

from kappaskin import (
    ObjectFinder,
    Patch,
    Pipeline,
    PointLoad,
    SensorLayout,
    Setup,
    Simulator,
    load_scene,
)
from kappaskin.contact import ImprintObjects
from kappaskin.sensing import DigitalReadings
from kappaskin_app.features.contact import recognition
from kappaskin_app.features.contact.recognition import curvature_text
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import scene_of
from kappaskin_app.widgets.line import Line


def _estimate(*loads):
    scene = load_scene("centre").touched_by(*loads)
    return Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, time.monotonic))


def test_the_text_gives_the_principal_curvatures_with_error_bars():
    words = curvature_text(_estimate(PointLoad(0.05, 0.05, 0.15)))

    assert words.startswith("principal curvatures \N{MINUS SIGN}")
    assert words.endswith("1/m")
    assert words.count("\N{PLUS-MINUS SIGN}") == 2


def test_the_text_is_empty_without_a_contact():
    assert curvature_text(_estimate()) == ""


@pytest.mark.full
def test_the_window_describes_the_object_in_contact(window, until):
    ends = {"x": 0.04, "y": 0.05, "x_end": 0.06, "y_end": 0.05}  # of a rigid blade
    window.history.change("Blade", -1, load_case="two-points", force=0.2, **ends)
    assert len(window.session.scene.loads) == 2

    # Its ends are two contacts, which the blade makes if it is one object.
    said = "as one object: edge, 20 mm long, axis "
    until(lambda: window.display.status_bar.object.text().startswith(said))
    assert "principal curvatures" in window.display.status_bar.object.text()

    window.session.disconnect_from()
    until(lambda: not window.display.status_bar.object.text())


def test_what_fits_no_object_is_said_with_its_cause_and_what_to_do():
    scene = load_scene("centre")
    corners = [PointLoad(x, y, 0.15) for x, y in ((0.03, 0.03), (0.07, 0.04), (0.04, 0.075))]
    estimate = _estimate(*corners)
    finder = ObjectFinder(scene.sensor().plate, scene.sensor().layout)

    words, _, found, _ = recognition._recognise(finder, estimate)  # noqa: SLF001

    assert not found.fits
    assert not found.kind
    assert "unknown object, nearest " in words
    assert "press it straight at one place; it may bear at several or on its rim" in words


def test_simulated_point_loads_are_those_of_the_plate_that_objects_are_recognised_on():
    places = [(0.044, 0.056), (0.053, 0.045), (0.036, 0.064), (0.025, 0.075)]
    described = set()
    for x, y in places:
        scene = scene_of(Settings(load_case="point", x=x, y=y, force=0.4))
        estimate = Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, time.monotonic))
        words, *_ = recognition._recognise(  # noqa: SLF001
            ObjectFinder(scene.plate, scene.layout), estimate
        )
        described.add(words.partition(",")[0])

    assert described == {"sphere"}


def test_an_object_is_told_by_the_shape_from_readings_of_several_units():
    sensor = replace(
        scene_of(Settings()).sensor(),
        layout=SensorLayout.regular(Patch(0.1, 0.1), 8, 8).reading_each(["height", "slope@30"]),
        transduction=DigitalReadings(noise=(("height", 5e-6), ("slope", 5e-4))),
    )
    args = sensor.plate, "hinged", "least-squares", (6, 6)
    assert isinstance(recognition._finder(sensor, *args), ImprintObjects)  # noqa: SLF001


def test_the_line_does_without_what_is_spare_where_room_is_short(qapp):
    line, of = Line(), "sphere, radius below 30 mm"
    line.show_text(
        f"{of}; second guess edge 4 %; curvatures 7", "; curvatures 7", "; second guess edge 4 %"
    )

    def room(text):
        line.resize(line.fontMetrics().horizontalAdvance(text), line.height())
        return line.shown, line.whole

    assert room(line.text()) == (line.text(), True)
    assert room(f"{of}; second guess edge 4 %") == (f"{of}; second guess edge 4 %", True)
    assert room(of) == (of, True)
    assert room("sphere") == (of, False)


def test_no_object_is_named_while_readings_drift():
    estimate = replace(_estimate(PointLoad(0.05, 0.05, 0.15)), drift=0.5)

    words, curvatures, found, _ = recognition._recognise(None, estimate)  # noqa: SLF001

    assert found.probability == {}
    assert words == "no object is named while readings drift: tare at rest"
    assert curvatures.startswith("; principal")


@pytest.mark.full
def test_a_new_skin_shows_that_the_finder_is_being_computed(window, until, monkeypatch):
    until(lambda: "curvatures" in window.display.status_bar.object.text())
    made, seen = recognition.object_finder, threading.Event()
    monkeypatch.setattr(recognition, "object_finder", lambda *of: seen.wait(60) and made(*of))
    window.requests.set("shape", "cylinder")
    until(
        lambda: "computing the model readings of objects" in window.display.status_bar.object.text()
    )
    seen.set()
    until(lambda: "curvatures" in window.display.status_bar.object.text())


@pytest.mark.full
def test_a_skin_without_object_recognition_shows_the_reason(window, until):
    window.history.change("Elements", -1, elements_x=50, elements_y=50)

    until(lambda: "at most 2000 elements" in window.display.status_bar.object.text())


@pytest.mark.full
@pytest.mark.fails_inside
def test_a_failure_is_reported_once_and_the_next_estimate_is_described(
    window, until, monkeypatch
) -> None:
    until(lambda: "curvatures" in window.display.status_bar.object.text())
    told: list[str] = []
    window.statusBar().messageChanged.connect(lambda text: text and told.append(text))

    def fail_once(estimate):
        monkeypatch.undo()
        raise ZeroDivisionError("once")

    monkeypatch.setattr("kappaskin_app.features.contact.recognition.curvature_text", fail_once)
    until(lambda: told)
    described: list[str] = []
    window.recognition.described.connect(lambda text, *_: described.append(text))
    until(lambda: described)

    assert told == ["Error in the program: once"]
