"""The strip chart draws what is selected or dragged to it, live and of nothing else."""

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QMimeData, QPointF, Qt
from PySide6.QtGui import QDropEvent, QMouseEvent
from PySide6.QtWidgets import QApplication

from kappaskin_app.features.strip_chart.history import Span, StripHistory
from kappaskin_app.features.strip_chart.panel import MIME, QUANTITIES, RADIUS, StripChart

LEFT = Qt.MouseButton.LeftButton


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


def test_the_lowest_chart_alone_names_the_time_in_minutes_where_it_is_long(panel) -> None:
    titles = [chart.x_axis.label for chart in panel.charts.values()]
    assert titles == [", s", "Time from now, s"]
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
    panel.show_span("force", *spans, 20.0, {})
    curve, band = panel.charts["force"].series
    assert curve.x[0] == pytest.approx(-20, abs=0.05)
    assert curve.y[-1] == pytest.approx(0.3, abs=0.5e-3)
    np.testing.assert_allclose(band.band, 0.002, rtol=1e-4)
    panel.show_span("force", spans[0], None, 20.0, {})
    assert len(panel.charts["force"].series) == 1


def test_a_click_on_the_chart_of_a_recording_goes_there(panel, qtbot, until) -> None:
    sought: list[float] = []
    panel.sought.connect(sought.append)
    panel.show_choice(("force",), 60.0, 600.0)
    times = np.linspace(0, 600, 500)
    panel.show_span("force", Span(times, np.ones((3, 500))), None, 0.0, {300.0: "accent"})
    chart = panel.charts["force"]
    assert (chart.x_axis.label, chart.x_axis.limits) == ("Time in the recording, min", (0.0, 10.0))
    assert not panel.span.isVisible()
    until(lambda: chart.place_of(10.0, 0.0).x() > 300)
    qtbot.mouseClick(chart.canvas, LEFT, pos=chart.place_of(7.5, 0.5).toPoint())
    assert sought == [pytest.approx(450, abs=2)]
    panel.show_choice(("force",), 60.0)
    panel.show_span("force", Span(times - 600, np.ones((3, 500))), None, 0.0, {})
    qtbot.mouseClick(chart.canvas, LEFT, pos=chart.place_of(-30.0, 0.5).toPoint())
    assert len(sought) == 1  # live there is no other time to go to


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
    until(lambda: chart.x_axis.title == "" and chart.x_axis.limits[0] == 0)
    length = window.session.status.replay.length
    until(lambda: chart.series and len(chart.series[0].x))
    until(lambda: chart.series[0].x.max() > 0.9 * length)
    until(lambda: chart.place_of(length, 0.0).x() > 200)
    window.playback.go(False)
    place = chart.place_of(length / 2, float(np.nanmax(chart.series[0].y)) / 2)
    qtbot.mouseClick(chart.canvas, LEFT, pos=place.toPoint())
    until(lambda: window.session.status.replay.at == pytest.approx(length / 2, rel=0.05))
