"""Elements that are pointed at and picked: the same one in every view."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from kappaskin import Status, load_scene
from kappaskin.health import Health
from kappaskin.health.findings import Finding
from kappaskin_app.features.membrane.camera import Sight
from kappaskin_app.features.traces.selected_element import SECONDS, Past, facts
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.plots import Curve, CurvePlot


def pixel_of(window: MainWindow, element: int) -> QPoint:
    """Where an element is seen on the skin."""
    view = window.membrane
    position = window.session.status.sensor.layout.positions[element]
    points, _ = view.skin.place(position[None])
    return QPoint(*(round(v) for v in Sight(view.plotter).to_screen(points[0]).tolist()))


def read(*times: float, elements: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Readings that are as large as their times."""
    at = np.array(times, float)
    return at, np.tile(at[:, None, None], (1, 3, elements))


def test_the_past_reaches_ten_seconds_back_in_order() -> None:
    past = Past()
    for k in range(30):
        past.take(*read(*(0.02 * (50 * k + np.arange(50)))))
    times, values = past.of([1, 3])
    assert values.shape == (len(times), 3, 2)
    assert times[-1] == 0
    assert -SECONDS <= times[0] < -SECONDS + 0.05
    assert (np.diff(times) > 0).all()
    np.testing.assert_allclose(values[:, 2, 1], times + 0.02 * 1499, rtol=1e-6)


@pytest.mark.parametrize("other", [read(0.5), read(3.0, elements=7)], ids=["time", "sensor"])
def test_the_past_begins_anew_with_a_clock_or_a_sensor(other) -> None:
    past = Past()
    past.take(*read(1.0, 1.5, 2.0))
    past.take(*other)
    times, _ = past.of([0])
    assert times.tolist() == [0.0]


@pytest.mark.parametrize(("elements", "kept"), [(4, 500), (1024, 167)])
def test_all_of_500_frames_a_second_are_kept_or_as_many_as_there_is_memory_for(
    elements: int, kept: int
) -> None:
    past = Past()
    past.take(*read(*np.arange(1000) / 1000, elements=elements))
    assert len(past.of([0])[0]) == pytest.approx(kept, rel=0.03)


def test_a_card_tells_channel_calibration_and_health(centre_estimate) -> None:
    sensor, estimate = centre_estimate
    wired = np.arange(300)
    wired[[7, 107]] = wired[[107, 7]]
    finding = Finding(207, 7, "xy", "noisy", 0.0, "2 1/m of noise")
    status = Status(health=Health((finding,), 1))
    told = facts(7, replace(sensor, channel_map=wired), status, estimate)
    xx, yy, xy = told.split("<tr>")[2:]
    assert "<td>107&" in xx
    assert "<td>7&" in yy
    assert "1 (nominal)" in xx
    assert "well" in xx
    assert "noisy: 2 1/m of noise" in xy
    reading = f"{estimate.curvature[0, 7]:+.2f}".replace("-", "\N{MINUS SIGN}")
    assert reading in xx


@pytest.fixture(scope="module")
def centre_estimate():
    from kappaskin import Pipeline, Setup, Simulator

    scene = load_scene("centre")
    pipeline = Pipeline(scene.sensor(), Setup(6, 6, 9, 9))
    return pipeline.sensor, pipeline(Simulator(scene).frame(100, lambda: 1.0))


def test_a_curve_is_pointed_at_where_it_is_drawn_and_broken_where_nothing_is(
    qapp, until, points_at
) -> None:
    plot, told = CurvePlot("Curvature", "1/m", True, "tip"), []
    plot.resize(400, 200)
    plot.show()
    plot.pointed.connect(told.append)
    x = np.linspace(-10, 0, 11)
    low, high = np.full(11, -1.0), np.full(11, 1.0)
    high[4:7] = np.nan
    plot.show_curves(x, [Curve("3", 0, low, 3), Curve("9", 1, high, 9)], (-10, 0), "s")
    colours = {plot.grab().toImage().pixelColor(120, y).name() for y in range(20, 180)}
    assert len(colours) > 2
    points_at(plot, QPoint(120, 195 - plot.fontMetrics().height()))
    until(lambda: told[-1:] == [3])
    points_at(plot, QPoint(225, 100))
    until(lambda: told[-1:] == [-1])
    plot.close()


def test_pointing_at_an_element_marks_it_in_every_view(
    window: MainWindow, until, points_at
) -> None:
    seen = []
    window.selection.pointed.connect(seen.append)
    points_at(window.membrane.plotter, pixel_of(window, 17))
    points_at(window.membrane.plotter, pixel_of(window, 42))  # before the next look
    until(lambda: seen[-1:] == [42])
    assert all(marks.actor.visibility for marks in window.membrane.pointed)
    until(lambda: "at (25, 45) mm" in window.heatmaps["yy"].value.text())
    window.selection.point(-1)
    assert not any(marks.actor.visibility for marks in window.membrane.pointed)


def test_a_click_on_the_skin_opens_the_card_which_traces_the_element(
    window: MainWindow, until, qtbot
) -> None:
    left, card = Qt.MouseButton.LeftButton, window.picking.card
    assert not card.isVisible()
    qtbot.mouseClick(window.membrane.plotter, left, pos=pixel_of(window, 17))
    until(lambda: card.isVisible() and "Element 17" in card.title.text())
    until(lambda: len(card.pasts[0].curves) == 3 and len(card.spectrum.curves) == 3)
    until(lambda: "\N{PLUS-MINUS SIGN}" in card.title.text())  # its error bar
    card.button.click()
    assert window.history.settings.traced == (17,)
    window.actions_by_name["dock-traces"].trigger()
    until(lambda: [curve.name for curve in window.picking.traces.plots[0].curves] == ["17"])
    window.history.stack.undo()
    until(lambda: not window.picking.traces.plots[0].curves)
    window.heatmaps["xx"].chosen.emit(44)
    until(lambda: "Element 44" in card.title.text())


def test_while_elements_are_chosen_to_scan_a_click_in_a_heatmap_picks_none(
    window: MainWindow,
) -> None:
    window.history.change("Choose", -1, region="elements")
    window.heatmaps["xx"].chosen.emit(44)
    assert window.picking.element == -1
    assert window.history.settings.region_elements == (44,)


def test_another_skin_with_as_many_elements_has_no_past(window: MainWindow, until) -> None:
    session, past = window.session, window.picking._past  # noqa: SLF001
    until(lambda: len(past.of([0])[0]) > 100)
    met, kept = session.status.meetings, []

    def note(_: object) -> None:
        if session.status.meetings != met:
            kept.append(len(past.of([0])[0]))

    session.estimated.connect(note)
    window.requests.set("side_x", 0.15)
    until(lambda: kept)
    assert kept[0] < 100
