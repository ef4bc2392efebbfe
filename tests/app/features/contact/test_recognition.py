"""Object recognition: its text in the status bar."""

import math
import re
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
from kappaskin.contact import NO_CONTACT, NO_OBJECT, ImprintObjects
from kappaskin.sensing import DigitalReadings
from kappaskin_app.features.contact import recognition
from kappaskin_app.features.contact.recognition import SteadyObject, curvature_text, object_text
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import scene_of
from kappaskin_app.widgets.line import Line


def _estimate(*loads):
    scene = load_scene("centre").touched_by(*loads)
    return Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, time.monotonic))


def test_the_text_gives_the_principal_curvatures_with_error_bars():
    words = curvature_text(_estimate(PointLoad(0.05, 0.05, 0.15)))

    assert words.startswith("; principal curvatures \N{MINUS SIGN}")
    assert words.endswith(" 1/m (\N{PLUS-MINUS SIGN}1 \u03c3)")
    assert words.count("\N{PLUS-MINUS SIGN} ") == 2


def test_the_text_is_empty_without_a_contact():
    assert curvature_text(_estimate()) == ""


@pytest.mark.full
def test_the_window_describes_the_object_in_contact(window, until):
    ends = {"x": 0.04, "y": 0.05, "x_end": 0.06, "y_end": 0.05}  # of a rigid blade
    window.history.change("Blade", -1, load_case="two-points", force=0.2, **ends)
    assert len(window.session.scene.loads) == 2

    # Its ends are two contacts, which the blade makes if it is one object.
    said = "As one object: edge, 20 mm long, axis "
    until(lambda: window.display.status_bar.object.text().startswith(said))
    assert "principal curvatures" in window.display.status_bar.object.text()

    window.session.disconnect_from()
    until(lambda: not window.display.status_bar.object.text())


def test_what_fits_no_object_is_said_with_its_cause_and_what_to_do():
    scene = load_scene("centre")
    corners = [PointLoad(x, y, 0.15) for x, y in ((0.03, 0.03), (0.07, 0.04), (0.04, 0.075))]
    estimate = _estimate(*corners)
    finder = ObjectFinder(scene.sensor().plate, scene.sensor().layout)

    _, found, _ = recognition._recognise(finder, estimate)  # noqa: SLF001
    words = object_text(found, estimate)

    assert not found.fits
    assert not found.kind
    assert "shape unknown: no object fits" in words
    assert "press it straight at one place: it may touch at several or with its rim" in words


def test_simulated_point_loads_are_those_of_the_plate_that_objects_are_recognised_on():
    places = [(0.044, 0.056), (0.053, 0.045), (0.036, 0.064), (0.025, 0.075)]
    described = set()
    for x, y in places:
        scene = scene_of(Settings(load_case="point", x=x, y=y, force=0.4))
        estimate = Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, time.monotonic))
        _, found, _ = recognition._recognise(  # noqa: SLF001
            ObjectFinder(scene.plate, scene.layout), estimate
        )
        described.add(re.sub(r"[\d.]+", "r", object_text(found, estimate)))

    assert described == {"shape unknown (a ball would be under r mm in radius)"}


def test_an_object_is_told_by_the_shape_from_readings_of_several_units():
    sensor = replace(
        scene_of(Settings()).sensor(),
        layout=SensorLayout.regular(Patch(0.1, 0.1), 8, 8).reading_each(["height", "slope@30"]),
        transduction=DigitalReadings(noise=(("height", 5e-6), ("slope", 5e-4))),
    )
    args = sensor.plate, "hinged", "least-squares", (6, 6)
    assert isinstance(recognition._finder(sensor, *args), ImprintObjects)  # noqa: SLF001


def test_no_object_and_no_curvature_is_named_near_the_rim():
    estimate = _estimate(PointLoad(0.05, 0.05, 0.15))
    rim = replace(estimate, contact=replace(estimate.contact, near_rim=True))

    words, found, _ = recognition._recognise(None, rim)  # noqa: SLF001

    assert words == "shape unknown (contact at the edge)"
    assert (curvature_text(rim), found.probability) == ("", {})


def test_no_object_is_named_where_the_skin_snaps_through():
    estimate = _estimate(PointLoad(0.05, 0.05, 0.15))
    contact = replace(estimate.contact, snaps_through=True, force=math.nan, force_sd=math.nan)

    words, found, _ = recognition._recognise(None, replace(estimate, contact=contact))  # noqa: SLF001

    assert words == "shape unknown (the skin snaps through)"
    assert found.probability == {}


def _ball(radius=0.04, **changes):
    ball = replace(
        NO_OBJECT,
        kind="sphere",
        probability={"sphere": 0.99, "edge": 0.01},
        radius=radius,
        radius_95=(0.9 * radius, 1.1 * radius),
    )
    return replace(ball, **changes)


UNSURE = _ball(radius_95=(0.0, 0.08))
EDGE = _ball(kind="edge", probability={"edge": 0.95, "cylinder": 0.0}, length=0.02, length_95=1e-3)


def test_a_name_comes_after_a_second_of_being_sure():
    steady = SteadyObject()
    named = [steady(_ball(), t).kind for t in (0.0, 0.5, 1.0)]
    assert named == ["", "", "sphere"]


def test_a_name_stays_through_a_moment_of_doubt_and_goes_after_two_seconds():
    steady = SteadyObject()
    for t in (0.0, 1.0):
        steady(_ball(), t)
    seen = [steady(what, t).kind for what, t in ((UNSURE, 1.5), (_ball(), 2.0), (UNSURE, 3.9))]
    assert seen == ["sphere"] * 3
    assert steady(UNSURE, 4.1).kind == ""
    assert steady(_ball(), 4.2).kind == ""  # it has to be sure anew


def test_a_name_in_doubt_has_the_force_of_now_and_the_radius_of_when_it_was_sure():
    steady = SteadyObject()
    for t in (0.0, 1.0):
        steady(_ball(0.04), t)
    kept = steady(replace(UNSURE, force=2.0), 1.5)
    assert (kept.radius, kept.force) == (0.04, 2.0)


def test_two_kinds_that_alternate_do_not_change_the_name():
    steady = SteadyObject()
    for t in (0.0, 1.0):
        steady(_ball(), t)
    seen = {steady((EDGE, _ball())[n % 2], 1.0 + 0.5 * n).kind for n in range(20)}
    assert EDGE.sure
    assert seen == {"sphere"}


def test_a_lost_contact_takes_the_name_at_once():
    steady = SteadyObject()
    for t in (0.0, 1.0):
        steady(_ball(), t)
    assert steady(NO_OBJECT, 1.1).describe() == "no contact"
    assert steady(_ball(), 1.2).kind == ""


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

    words, found, _ = recognition._recognise(None, estimate)  # noqa: SLF001

    assert found.probability == {}
    assert words == "no object is named while readings drift: tare at rest"
    assert curvature_text(estimate).startswith("; principal")


@pytest.mark.full
def test_a_new_skin_shows_that_the_finder_is_being_computed(window, until, monkeypatch):
    until(lambda: "curvatures" in window.display.status_bar.object.text())
    made, seen = recognition.object_finder, threading.Event()
    monkeypatch.setattr(recognition, "object_finder", lambda *of: seen.wait(60) and made(*of))
    window.requests.set("shape", "cylinder")
    until(
        lambda: "Computing the model readings of objects" in window.display.status_bar.object.text()
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

    def fail_once(*_):
        monkeypatch.undo()
        raise ZeroDivisionError("once")

    monkeypatch.setattr("kappaskin_app.features.contact.recognition.object_text", fail_once)
    until(lambda: told)
    described: list[str] = []
    window.recognition.described.connect(lambda text, *_: described.append(text))
    until(lambda: described)

    assert told == ["Error in the program: once"]


def test_an_object_that_lags_shows_its_age_or_nothing(window, until) -> None:
    line = window.display.status_bar.object
    until(lambda: line.text().startswith("Shape unknown") and "principal" in line.text())
    estimate = window.session.estimate
    window.session.timer.stop()
    show = window.features["contact"]._show_object  # noqa: SLF001
    window.features["contact"]._describe("A ball; or a pipe", "; or a pipe", estimate)  # noqa: SLF001
    later = replace(estimate, host_time=estimate.host_time + 1.2)
    show(later)
    assert line.text().startswith("A ball (1.2 s ago); or a pipe; principal curvatures")
    show(replace(estimate, host_time=estimate.host_time + 60.0))
    assert line.text().startswith("Principal curvatures")
    show(replace(estimate, host_time=estimate.host_time - 1.0))  # earlier in a recording
    assert line.text().startswith("Principal curvatures")
    show(replace(later, contact=NO_CONTACT))
    assert line.text() == ""
