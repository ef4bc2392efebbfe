"""The strip chart draws what is selected or dragged to it, live and of nothing else."""

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QMimeData, QPointF, Qt
from PySide6.QtGui import QDropEvent, QMouseEvent
from PySide6.QtWidgets import QApplication

from kappaskin_app.features.strip_chart.history import Span, StripHistory
from kappaskin_app.features.strip_chart.panel import (
    MIME,
    NOW,
    QUANTITIES,
    RADIUS,
    StripChart,
    StripMark,
)

LEFT, MIDDLE = Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton


@pytest.fixture
def panel(qtbot) -> StripChart:
    made = StripChart()
    qtbot.addWidget(made)
    made.resize(1200, 400)
    made.show_choice(("force", "displacement"), 60.0)
    made.show()
    return made


def test_each_selected_number_has_a_chart_in_its_unit(panel) -> None:
    assert list(panel.charts) == ["force", "displacement"]
    assert panel.charts["force"].y_axis.label == "Force, N"
    assert [box.text() for box in panel.boxes.values() if box.isChecked()] == ["Force", "Depth"]
    panel.show_choice((), 60.0)
    assert not panel.charts
    assert panel.hint.isVisible()


def test_the_lowest_chart_alone_has_times_which_are_in_minutes_where_it_is_long(panel) -> None:
    axes = [chart.x_axis for chart in panel.charts.values()]
    assert [axis.shows for axis in axes] == ["", "numbers"]
    assert {axis.label for axis in axes} == {"Time from now, s"}
    assert panel.when.text() == "Time from now in s; the last"
    panel.show_choice(("position_x",), 3600.0)
    axis = panel.charts["position_x"].x_axis
    assert (axis.label, axis.limits) == ("Time from now, min", (-60.0, 0.0))
    assert panel.span.currentText() == "1 h"


def test_a_click_selects_and_a_key_changes_the_time(panel, qtbot) -> None:
    toggled, spans = [], []
    panel.toggled.connect(toggled.append)
    panel.spanned.connect(spans.append)
    qtbot.mouseClick(panel.boxes["position_y"], LEFT)
    panel.span.setFocus()
    qtbot.keyClick(panel.span, Qt.Key.Key_Down)
    assert toggled == ["position_y"]
    assert spans == [600.0]


def test_what_is_dragged_here_is_shown_and_nothing_else_is_taken(panel) -> None:
    added: list[list[str]] = []
    panel.added.connect(added.append)
    what = QMimeData()
    what.setData(MIME, b"position_x nonsense \xff position_y")
    none, move = Qt.KeyboardModifier.NoModifier, Qt.DropAction.CopyAction
    panel.dropEvent(QDropEvent(QPointF(50, 50), move, what, LEFT, none))
    assert added == [["position_x", "position_y"]]


def test_a_curve_is_in_the_unit_of_the_screen_up_to_now_with_its_error_band(panel) -> None:
    times = np.arange(0, 20, 0.01)
    history = StripHistory(2)
    history.append(times, np.stack([0.1 + 0.01 * times, np.full(len(times), 0.002)], axis=1))
    spans = [history.span(column, 0.0, 600) for column in (0, 1)]
    panel.show_span("force", *spans, 20.0, ())
    curve, band = panel.charts["force"].series
    assert curve.x[0] == pytest.approx(-20, abs=0.05)
    assert curve.y[-1] == pytest.approx(0.3, abs=0.5e-3)
    np.testing.assert_allclose(band.band, 0.002, rtol=1e-4)
    panel.show_span("force", spans[0], None, 20.0, ())
    assert len(panel.charts["force"].series) == 1


def test_a_click_on_the_chart_of_a_recording_goes_there(panel, qtbot, until) -> None:
    sought: list[float] = []
    panel.sought.connect(sought.append)
    panel.show_choice(("force",), 60.0, 600.0)
    times = np.linspace(0, 600, 500)
    panel.show_span("force", Span(times, np.ones((3, 500))), None, 0.0, [StripMark(300.0, NOW)])
    chart = panel.charts["force"]
    assert (chart.x_axis.label, chart.x_axis.limits) == ("Time in the recording, min", (0.0, 10.0))
    assert not panel.span.isVisible()
    until(lambda: chart.place_of(10.0, 0.0).x() > 300)
    qtbot.mouseClick(chart.canvas, LEFT, pos=chart.place_of(7.5, 0.5).toPoint())
    assert sought == [pytest.approx(450, abs=2)]
    panel.show_choice(("force",), 60.0)
    panel.show_span("force", Span(times - 600, np.ones((3, 500))), None, 0.0, ())
    qtbot.mouseClick(chart.canvas, LEFT, pos=chart.place_of(-30.0, 0.5).toPoint())
    assert len(sought) == 1  # live there is no other time to go to


def drag(qtbot, widget, begin: QPointF, end: QPointF, button=LEFT) -> None:
    """Drag with the mouse, over places between."""
    start, by = begin.toPoint(), end.toPoint() - begin.toPoint()
    qtbot.mouseMove(widget, start)
    qtbot.mousePress(widget, button, pos=start)
    for share in (0.3, 0.6, 1.0):
        qtbot.wait(15)
        qtbot.mouseMove(widget, start + by * share)
    qtbot.mouseRelease(widget, button, pos=start + by)


def test_a_drag_over_a_part_zooms_into_all_charts_and_a_double_click_shows_all(
    panel, qtbot, until
) -> None:
    panel.show_choice(("force", "displacement"), 60.0, 60.0)
    times = np.linspace(0, 60, 500)
    values = np.where(times < 30, 1.0, 5.0)

    def show() -> None:
        for name in panel.charts:
            panel.show_span(name, Span(times, np.stack([values] * 3)), None, 0.0, ())

    show()
    one, other = panel.charts.values()
    until(lambda: one.place_of(10.0, 0.0).x() > 100)
    sought: list[float] = []
    panel.sought.connect(sought.append)
    drag(qtbot, one.canvas, one.place_of(10, 2), one.place_of(20, 2))
    assert panel.part == (pytest.approx(10, abs=0.3), pytest.approx(20, abs=0.3))
    show()
    for name, chart in panel.charts.items():
        left, right = chart.place_of(10, 0).x(), chart.place_of(20, 0).x()
        assert right - left > 0.7 * chart.canvas.width()
        # The height is that of this part too.
        foot, top = (chart.place_of(15, y * QUANTITIES[name].scale).y() for y in (0.0, 1.0))
        assert foot - top > 0.4 * chart.canvas.height()
    drag(qtbot, one.canvas, one.place_of(15, 0.5), one.place_of(12, 0.5), MIDDLE)
    assert panel.part == (pytest.approx(13, abs=0.4), pytest.approx(23, abs=0.4))
    assert other.place_of(13, 0).x() == pytest.approx(left, abs=8)
    at = other.place_of(15, 0.5).toPoint()
    qtbot.mouseDClick(other.canvas, LEFT, pos=at)
    qtbot.mouseRelease(other.canvas, LEFT, pos=at)  # Qt's own ends with the second press
    assert panel.part is None
    show()
    assert one.place_of(60, 0).x() - one.place_of(0, 0).x() > 0.7 * one.canvas.width()
    assert not sought


def test_each_finger_has_a_curve_with_its_name_on_one_clock(panel) -> None:
    times = np.linspace(-60, 0, 300)
    sd = Span(times, np.full((3, 300), 0.1))
    # The second finger's device was switched on 100 s earlier.
    spans = {
        "thumb": (Span(times, np.ones((3, 300))), 0.0),
        "index": (Span(times + 100, np.full((3, 300), 2.0)), 100.0),
    }
    panel.show_fingers("force", spans, "index", sd, ())
    thumb, index, band = panel.charts["force"].series
    assert [(each.name, each.colour) for each in (thumb, index)] == [("thumb", 0), ("index", 1)]
    np.testing.assert_allclose(thumb.x, index.x, atol=1e-9)
    assert (thumb.y[0], index.y[0], band.colour) == (1.0, 2.0, 1)


def test_marks_are_lines_whose_texts_are_shown_at_their_foot(panel, until) -> None:
    times = np.linspace(-60, 0, 300)
    marks = [StripMark(-30.0, "note", "lifted"), StripMark(-20.0, "event", "5 messages lost")]
    panel.show_span("force", Span(times, np.ones((3, 300))), None, 0.0, marks)
    chart = panel.charts["force"]
    until(lambda: chart.place_of(-30.0, 0.0).x() > 100)
    tips = [chart.point_text(chart.nearest(chart.place_of(at, 0.0))) for at in (-30.0, -20.0)]
    assert tips == ["lifted", "5 messages lost"]


def test_an_element_is_drawn_in_the_units_and_with_the_names_of_what_it_reads(
    panel, qtbot, until
) -> None:
    toggled: list[str] = []
    panel.toggled.connect(toggled.append)
    panel.show_readings(("height", "slope"), np.array([1e3, 1.0]), "mm, 1")
    panel.show_choice(("force",), 60.0, element=7)
    until(lambda: panel.boxes["element-7"].isVisible() and panel.boxes["element-7"].x() > 0)
    qtbot.mouseClick(panel.boxes["element-7"], LEFT)
    assert toggled == ["element-7"]
    panel.show_choice(("force", "element-7"), 60.0)
    assert panel.boxes["element-7"].isChecked()
    times = np.linspace(-60, 0, 300)
    panel.show_element("element-7", [Span(times, np.full((3, 300), 2.0))] * 2, 0.0, ())
    chart = panel.charts["element-7"]
    assert chart.y_axis.label == "Element 7, mm, 1"
    assert [(each.name, each.y[0]) for each in chart.series] == [("height", 2000.0), ("slope", 2.0)]
    panel.show_choice(("force",), 60.0)
    assert "element-7" not in panel.boxes


def test_every_number_follows_from_what_an_estimate_stores() -> None:
    assert {"force", "displacement", "position_x", "position_y", RADIUS} <= set(QUANTITIES)
    form = np.array([[[3.0, 4.0], [4.0, -3.0]], [[np.nan] * 2] * 2])
    for name, value in (("principal_1", 5.0), ("principal_2", -5.0)):
        of = QUANTITIES[name]
        assert of.of(of.by(form))[0] == pytest.approx(value)
        assert np.isnan(of.of(of.by(form))[1])


@pytest.mark.slow
def test_the_window_draws_force_and_depth_and_a_readout_dragged_down(window, until, qtbot) -> None:
    window.actions_by_name["dock-strip_chart"].trigger()
    strips = window.features["strip_chart"].strips
    until(lambda: all(chart.series for chart in strips.panel.charts.values()))
    until(lambda: len(strips.panel.charts["force"].series[0].x) > 20)
    force = window.session.estimate.contact.force
    drawn = strips.panel.charts["force"].series[0].y
    assert np.nanmedian(drawn) == pytest.approx(force, rel=0.1)

    qtbot.mouseClick(strips.panel.boxes["force"], LEFT)
    until(lambda: list(strips.panel.charts) == ["displacement"])
    dropped: list[str] = []

    class Drag:
        def __init__(self, widget) -> None:
            self.widget = widget

        def setMimeData(self, what) -> None:
            dropped.append(bytes(what.data(MIME).data()).decode())

        def setPixmap(self, _) -> None: ...
        def exec(self, _) -> None: ...

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("kappaskin_app.features.strip_chart.strips.QDrag", Drag)
        number = window.display.places["readout-contact"][0]
        middle = number.rect().center()
        qtbot.mousePress(number, LEFT, pos=middle)
        far = QApplication.startDragDistance()
        there, none = QPointF(middle.x() + far + 1, middle.y()), Qt.KeyboardModifier.NoModifier
        over = QPointF(number.mapToGlobal(there.toPoint()))
        QApplication.sendEvent(
            number, QMouseEvent(QEvent.Type.MouseMove, there, over, LEFT, LEFT, none)
        )
        qtbot.mouseRelease(number, LEFT)
    assert dropped == ["position_x position_y"]

    strips.panel.added.emit(dropped[0].split())
    until(lambda: "position_y" in strips.panel.charts)
    window.actions_by_name["undo"].trigger()
    until(lambda: list(strips.panel.charts) == ["displacement"])


@pytest.mark.slow
def test_a_recording_is_drawn_whole_and_a_click_goes_there(opened, recording, until, qtbot) -> None:
    window = opened(f"replay:{recording}")
    window.actions_by_name["dock-strip_chart"].trigger()
    chart = window.features["strip_chart"].strips.panel.charts["force"]
    until(lambda: chart.x_axis.title == "Time in the recording")
    length = window.session.status.replay.length
    until(lambda: chart.series and len(chart.series[0].x))
    until(lambda: chart.series[0].x.max() > 0.9 * length)
    until(lambda: chart.place_of(length, 0.0).x() > 200)
    window.playback.go(False)
    place = chart.place_of(length / 2, float(np.nanmax(chart.series[0].y)) / 2)
    qtbot.mouseClick(chart.canvas, LEFT, pos=place.toPoint())
    until(lambda: window.session.status.replay.at == pytest.approx(length / 2, rel=0.05))


@pytest.mark.slow
def test_an_element_clicked_in_a_heatmap_is_drawn_and_notes_are_marked(
    window, until, qtbot
) -> None:
    window.actions_by_name["dock-strip_chart"].trigger()
    strips = window.features["strip_chart"].strips
    until(lambda: window.session.status.sensor is not None and window.session.estimate is not None)
    cells = window.heatmaps["xx"].cells
    until(lambda: cells.area_of_patch().width() > 20)
    qtbot.mouseClick(cells, LEFT, pos=cells.area_of_patch().center().toPoint())
    until(lambda: any(name.startswith("element-") for name in strips.panel.boxes))
    (name,) = (each for each in strips.panel.boxes if each.startswith("element-"))
    element = int(name.removeprefix("element-"))
    until(lambda: strips.panel.boxes[name].x() > 0)
    qtbot.mouseClick(strips.panel.boxes[name], LEFT)
    until(lambda: name in strips.panel.charts)
    chart = strips.panel.charts[name]
    until(lambda: len(chart.series) == 3 and np.isfinite(chart.series[0].y).sum() > 20)
    read = window.session.estimate.curvature[:, element]
    noise = window.session.estimate.noise
    for each, value in zip(chart.series, read, strict=True):
        assert np.nanmedian(each.y) == pytest.approx(value, abs=8 * noise)
    assert [each.name for each in chart.series] == ["xx", "yy", "xy"]

    window.session.engine.note("pressed harder")
    until(lambda: any("pressed harder" in each.tips for each in chart.series))
    (marked,) = (each for each in chart.series if "pressed harder" in each.tips)
    assert marked.name == "Note"
    assert -30 < marked.x[marked.tips.index("pressed harder")] <= 1
    window.actions_by_name["undo"].trigger()
    until(lambda: name not in strips.panel.charts)
