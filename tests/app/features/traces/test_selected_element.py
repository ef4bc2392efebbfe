"""Selected element: the same one in every view, with its history and facts."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QToolTip

from kappaskin import Status, load_scene
from kappaskin.health import Health
from kappaskin.health.findings import Finding
from kappaskin_app.features.membrane.camera import Projection
from kappaskin_app.features.traces.element_panel import SECONDS, Traces
from kappaskin_app.features.traces.selected_element import ReadingBuffer, facts
from kappaskin_app.shell.window import MainWindow


def pixel_of(window: MainWindow, element: int) -> QPoint:
    """Where an element is seen on the skin."""
    view = window.membrane
    position = window.session.status.sensor.layout.positions[element]
    points, _ = view.skin.place(position[None])
    return QPoint(*(round(v) for v in Projection(view.plotter).to_screen(points[0]).tolist()))


def read(*times: float, elements: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Readings that are as large as their times."""
    at = np.array(times, float)
    return at, np.tile(at[:, None, None], (1, 3, elements))


def test_the_buffer_holds_the_last_ten_seconds_in_order() -> None:
    buffer = ReadingBuffer()
    for k in range(30):
        buffer.append(*read(*(0.02 * (50 * k + np.arange(50)))))
    times, values = buffer.of([1, 3])
    assert values.shape == (len(times), 3, 2)
    assert times[-1] == 0
    assert -SECONDS <= times[0] < -SECONDS + 0.05
    assert (np.diff(times) > 0).all()
    np.testing.assert_allclose(values[:, 2, 1], times + 0.02 * 1499, rtol=1e-6)


@pytest.mark.parametrize("other", [read(0.5), read(3.0, elements=7)], ids=["time", "sensor"])
def test_the_buffer_is_cleared_for_another_clock_or_sensor(other) -> None:
    buffer = ReadingBuffer()
    buffer.append(*read(1.0, 1.5, 2.0))
    buffer.append(*other)
    times, _ = buffer.of([0])
    assert times.tolist() == [0.0]


def test_a_curve_does_not_cross_a_gap_as_where_a_replay_goes_elsewhere() -> None:
    buffer = ReadingBuffer()
    buffer.append(*read(1.0, 1.1, 5.0, 5.1))
    times, values = buffer.of([0])
    np.testing.assert_allclose(times, [-4.1, -4.0, -2.05, -0.1, 0.0])
    assert np.isnan(values[2]).all()
    assert np.isfinite(np.delete(values, 2, axis=0)).all()


@pytest.mark.slow
def test_nothing_of_another_source_stays(window: MainWindow, until) -> None:
    shown = window.features["traces"].selected_element
    window.docks.reveal("element")
    shown.select(44)
    until(lambda: shown.panel.histories[0].series and not shown.panel.histories[0].is_empty)
    window.session.connect_to("sim:")
    assert all(plot.is_empty for plot in (*shown.panel.histories, *shown.traces.plots))
    assert "Click an element" in shown.panel.title.text()


@pytest.mark.parametrize(("elements", "kept"), [(4, 500), (1024, 167)])
def test_500_frames_per_second_are_stored_or_as_many_as_memory_allows(
    elements: int, kept: int
) -> None:
    buffer = ReadingBuffer()
    buffer.append(*read(*np.arange(1000) / 1000, elements=elements))
    assert len(buffer.of([0])[0]) == pytest.approx(kept, rel=0.03)


def test_the_table_lists_channel_calibration_and_health(centre_estimate) -> None:
    sensor, estimate = centre_estimate
    wired = np.arange(300)
    wired[[7, 107]] = wired[[107, 7]]
    finding = Finding(207, 7, "xy", "noisy", 0.0, "2 1/m of noise")
    status = Status(health=Health((finding,), 1))
    table = facts(7, replace(sensor, channel_map=wired), status, estimate)
    xx, yy, xy = table.split("<tr>")[2:]
    assert "<td>107&" in xx
    assert "<td>7&" in yy
    assert "1 (nominal)" in xx
    assert "OK" in xx
    assert "noisy: 2 1/m of noise" in xy
    reading = f"{estimate.curvature[0, 7]:+.2f}".replace("-", "\N{MINUS SIGN}")
    assert reading in xx


@pytest.fixture(scope="module")
def centre_estimate():
    from kappaskin import Pipeline, Setup, Simulator

    scene = load_scene("centre")
    pipeline = Pipeline(scene.sensor(), Setup(6, 6, 9, 9))
    return pipeline.sensor, pipeline(Simulator(scene).frame(100, lambda: 1.0))


def test_a_trace_is_pointed_at_where_it_is_drawn_and_bold_while_it_is_marked(
    qtbot, until, points_at
) -> None:
    traces, table = Traces(), []
    qtbot.addWidget(traces)
    traces.resize(1500, 240)
    traces.pointed.connect(table.append)
    times = np.linspace(-10, 0, 11)
    values = np.ones((11, 6, 2)) * [-1.0, 1.0]
    values[4:7, 0, 1] = np.nan
    traces.show_history([3, 9], times, values)
    traces.show()
    plot = traces.plots[0]
    until(lambda: plot.place_of(0.0, 0.0).x() > 100)
    plain = plot.grab().toImage()
    points_at(plot.canvas, plot.place_of(-7.5, -1.0).toPoint())
    assert table[-1:] == [3]
    traces.mark(3)
    assert plot.grab().toImage() != plain
    points_at(plot.canvas, plot.place_of(-5.0, 1.0).toPoint())
    assert table[-1:] == [-1]
    traces.mark(-1)
    assert plot.grab().toImage() == plain
    until(lambda: not QToolTip.isVisible())


@pytest.mark.full
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


@pytest.mark.full
def test_a_click_on_the_skin_opens_the_panel_which_plots_the_element(
    window: MainWindow, until, qtbot
) -> None:
    left, panel = Qt.MouseButton.LeftButton, window.selected_element.panel
    assert not panel.isVisible()
    qtbot.mouseClick(window.membrane.plotter, left, pos=pixel_of(window, 17))
    until(lambda: panel.isVisible() and "Element 17" in panel.title.text())
    until(lambda: len(panel.histories[0].series) == 3 and len(panel.spectrum.series) == 3)
    until(lambda: "\N{PLUS-MINUS SIGN}" in panel.title.text())  # its error bar
    panel.button.click()
    assert window.history.settings.traced == (17,)
    window.actions_by_name["dock-traces"].trigger()
    until(
        lambda: [curve.name for curve in window.selected_element.traces.plots[0].series] == ["17"]
    )
    window.history.stack.undo()
    until(lambda: not window.selected_element.traces.plots[0].series)
    window.heatmaps["xx"].chosen.emit(44)
    until(lambda: "Element 44" in panel.title.text())


@pytest.mark.full
def test_a_click_in_a_heatmap_selects_no_element_while_it_sets_the_scan_region(
    window: MainWindow,
) -> None:
    window.history.change("Choose", -1, region="elements")
    window.heatmaps["xx"].chosen.emit(44)
    assert window.selected_element.element == -1
    assert window.history.settings.region_elements == (44,)


@pytest.mark.full
def test_another_sensor_of_as_many_elements_starts_with_an_empty_buffer(
    window: MainWindow, until
) -> None:
    session, buffer = window.session, window.selected_element._buffer  # noqa: SLF001
    until(lambda: len(buffer.of([0])[0]) > 100)
    met, kept = session.status.connections, []

    def note(_: object) -> None:
        if session.status.connections != met:
            kept.append(len(buffer.of([0])[0]))

    session.estimated.connect(note)
    window.requests.set("side_x", 0.15)
    until(lambda: kept)
    assert kept[0] < 100
