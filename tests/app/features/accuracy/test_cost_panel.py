"""What accuracy costs, on one window that has measured all of it: points, slider, effects."""

import math
from dataclasses import replace

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt

from kappaskin.studies import Cost, EffectCost, Refused, Setting
from kappaskin_app.features.accuracy.cost_plot import CostPlot
from kappaskin_app.features.accuracy.measurement import setting_text
from kappaskin_app.shell.effects import effect_name
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.text import duration, length


@pytest.mark.full
def test_every_method_and_basis_is_measured_and_what_is_refused_is_not_drawn(
    measured: MainWindow, colours_in
) -> None:
    costs = measured.measurement.costs
    assert len(costs) == 2 * 3 * 2
    assert isinstance(costs[Setting("least-squares", (12, 12), (10, 10))], Refused)
    drawn = measured.cost.plot.frontier.costs
    assert drawn
    assert all(cost in drawn for cost in costs.values() if isinstance(cost, Cost))
    assert colours_in(measured, measured.cost.plot) > 20
    assert measured.cost.count.text() == "12 of 12"


def place_of(plot: CostPlot, cost: Cost) -> QPointF:
    return plot.place_of(cost.time_per_frame, cost.rms)


def _room(plot: CostPlot, cost: Cost) -> float:
    """Pixels to the next point; none around the present one, a click on which changes nothing."""
    here = place_of(plot, cost)
    others = [place_of(plot, other) - here for other in plot.frontier.costs if other != cost]
    # What is measured live has a cross of its own, which a click next to it means.
    (live,) = (each for each in plot.series if each.name == "in use, measured")
    others += [plot.place_of(*at) - here for at in zip(live.x, live.y, strict=True)]
    present = cost.setting == Setting("least-squares", (8, 8), (10, 10))
    return 0.0 if present else min(math.hypot(way.x(), way.y()) for way in others)


def test_a_click_on_a_point_switches_to_it_and_is_one_step_to_undo(
    measured: MainWindow, until, qtbot
) -> None:
    plot, was = measured.cost.plot, measured.history.settings
    qtbot.mouseMove(plot.canvas, QPoint(40, 40))
    # The range follows what is measured live: a slow frame presses the points together, and
    # any event may move them. From here to the click there is none.
    until(lambda: max(_room(plot, cost) for cost in plot.frontier.costs) > 15)
    cost = max(plot.frontier.costs, key=lambda cost: _room(plot, cost))
    at = place_of(plot, cost).toPoint()
    qtbot.mouseClick(plot.canvas, Qt.MouseButton.LeftButton, pos=at)
    s = measured.history.settings
    asked = (s.method, s.functions_x, s.functions_y, s.elements_x, s.elements_y)
    assert Setting(asked[0], asked[1:3], asked[3:]) == cost.setting
    until(lambda: measured.measurement.present == cost.setting)
    until(lambda: measured.measurement.predicted() in plot.frontier.costs)
    measured.history.stack.undo()
    assert measured.history.settings == was


def test_what_is_predicted_and_what_is_measured_stand_beside_each_other(
    measured: MainWindow, until
) -> None:
    figures = measured.cost.figures
    for row in ("Predicted", "Measured"):
        until(lambda row=row: figures[row, "RMS error"].text().endswith(" mm"))
        until(lambda row=row: figures[row, "time"].text().endswith("s"))
    assert measured.cost.setting.text().startswith("Least squares, 8")
    predicted = measured.measurement.predicted()
    assert isinstance(predicted, Cost)
    until(lambda: measured.measurement.measured()[0] == pytest.approx(predicted.rms, rel=0.7))
    assert 0 < measured.measurement.measured()[1] < 1
    until(lambda: measured.cost.computed.text().endswith(" frames/s"))
    assert measured.cost.each.text().endswith(" each")
    assert measured.cost.each.toolTip().count("\n") == 2
    assert measured.measurement.computed.each > measured.measurement.measured()[1]


@pytest.mark.cases("least-squares", "as-printed", "robust")
@pytest.mark.parametrize("method", METHOD_SHORT)
def test_any_setting_in_use_is_read_whole(measured: MainWindow, method: str) -> None:
    line = measured.cost.setting
    line.show_text(setting_text(Setting(method, (12, 12), (16, 16))))
    assert line.whole


def test_the_legend_and_the_points_have_room_in_a_low_dock(measured: MainWindow, until) -> None:
    plot, dock = measured.cost.plot, measured.docks["cost"]
    was = dock.height()
    measured.resizeDocks([dock], [1], Qt.Orientation.Vertical)
    until(lambda: dock.height() < was)
    line = plot.fontMetrics().height()
    assert plot.heading.height() >= plot.heading.heightForWidth(plot.heading.width())
    assert plot.canvas.height() >= 6 * line
    measured.resizeDocks([dock], [was], Qt.Orientation.Vertical)


def test_the_slider_takes_the_cheapest_setting_that_is_accurate_enough(
    measured: MainWindow, qtbot
) -> None:
    slider, best = measured.cost.required, measured.measurement.frontier().best
    assert slider.isEnabled()
    slider.setFocus()
    qtbot.keyClick(slider, Qt.Key.Key_Home)
    qtbot.keyClick(slider, Qt.Key.Key_End)
    assert measured.measurement.present is not None
    s = measured.history.settings
    chosen = Setting(s.method, (s.functions_x, s.functions_y), (s.elements_x, s.elements_y))
    assert chosen == best[0].setting
    assert setting_text(chosen) in measured.cost.cheapest.text()
    qtbot.keyClick(slider, Qt.Key.Key_Home)
    s = measured.history.settings
    chosen = Setting(s.method, (s.functions_x, s.functions_y), (s.elements_x, s.elements_y))
    assert chosen == measured.measurement.frontier().best[-1].setting


def test_a_slider_held_by_the_mouse_switches_when_it_is_let_go(measured: MainWindow) -> None:
    # Bayes takes longer than least squares: whatever the times, it is not the cheapest.
    measured.history.change("Bayes", -1, method="bayes")
    slider, was = measured.cost.required, measured.history.settings
    slider.setSliderDown(True)
    slider.setValue(slider.maximum())
    assert measured.history.settings == was
    assert measured.cost.cheapest.text().startswith("Fastest")
    slider.setSliderDown(False)
    assert measured.history.settings != was


def test_a_region_is_said_not_to_be_in_what_is_predicted(measured: MainWindow, until) -> None:
    message = measured.cost.message
    assert not message.isVisible()
    measured.history.change("Region", -1, region="adaptive")
    until(lambda: message.text().endswith("without the region of interest."))
    measured.history.stack.undo()
    until(lambda: not message.isVisible())


def _rows(window: MainWindow) -> dict[str, list[str]]:
    """What the table of effects says, by effect."""
    table = window.cost.effects
    return {
        table.item(row, 0).text(): [table.item(row, n).text() for n in range(1, 5)]
        for row in range(table.rowCount())
    }


def test_each_effect_of_the_scene_is_told_with_and_without_it(measured: MainWindow, until) -> None:
    until(lambda: "Uniform noise" in _rows(measured))
    found = {effect_name(cost.name): cost for cost in measured.measurement.effect_costs()}
    rows = _rows(measured)
    assert list(rows) == list(found)
    for name, (kept, time, with_it, without) in rows.items():
        cost = found[name]
        assert kept == ("yes" if cost.kept else "no")
        assert time == duration(cost.time_per_frame)
        assert (with_it, without) == (length(cost.rms_with), length(cost.rms_without))
    assert rows["Finite slope"][0] == "no"
    # What remains are the waves of the load that the setting's functions do not have.
    assert found["Uniform noise"].rms_without < 0.7 * found["Uniform noise"].rms_with
    assert not measured.cost.no_effects.isVisible()


def test_the_error_that_is_had_now_is_bold(measured: MainWindow, until) -> None:
    until(lambda: "Uniform noise" in _rows(measured))
    table = measured.cost.effects
    for row in range(table.rowCount()):
        kept = table.item(row, 1).text() == "yes"
        assert [table.item(row, n).font().bold() for n in range(1, 5)] == [
            *(False, False, kept, not kept)
        ]


@pytest.mark.full
def test_effects_are_judged_with_the_setting_in_use(measured: MainWindow, until) -> None:
    until(lambda: measured.measurement.effect_costs() is not None)
    was = measured.measurement.effect_costs()
    measured.history.change("Fewer", -1, functions_x=4, functions_y=4)
    until(lambda: measured.measurement.effect_costs() not in (None, was), 60.0)
    before, noise = (
        next(cost for cost in each if cost.name == "uniform-noise")
        for each in (was, measured.measurement.effect_costs())
    )
    # Four functions follow the load less well, noise or not.
    assert noise.rms_without > 1.8 * before.rms_without
    until(lambda: _rows(measured).get("Uniform noise", [])[3:] == [length(noise.rms_without)])
    measured.history.stack.undo()
    until(lambda: measured.measurement.effect_costs() == was)
    until(lambda: _rows(measured)["Uniform noise"][3] == length(before.rms_without))


def test_a_setting_that_cannot_judge_effects_says_why(
    measured: MainWindow, until, monkeypatch
) -> None:
    own = replace(measured.measurement.present, elements=None)
    monkeypatch.setitem(
        measured.measurement.effects, own, Refused(own, "too few elements are left")
    )
    until(lambda: measured.cost.no_effects.isVisible())
    assert measured.cost.no_effects.text() == "Too few elements are left."
    assert not measured.cost.effects.isVisible()
    monkeypatch.undo()
    until(lambda: measured.cost.effects.isVisible())


def test_effects_have_room_in_a_small_window(measured: MainWindow, until, monkeypatch) -> None:
    names = ["gaussian-noise", "corrupted-frames", "tolerance"]
    costs = tuple(EffectCost(name, True, 9.95e-4, 0.1, 8.8e-6, 8.8e-6) for name in names)
    table = measured.cost.effects
    own = replace(measured.measurement.present, elements=None)
    monkeypatch.setitem(
        measured.measurement.effects, own, costs * 5
    )  # so many that they are scrolled
    assert (measured.width(), measured.height()) == (1280, 800)
    assert measured.minimumSizeHint().width() <= 1280
    header = table.horizontalHeader()
    until(lambda: table.verticalScrollBar().isVisible())
    assert header.length() <= table.viewport().width()
    for column in range(table.columnCount()):
        assert table.columnWidth(column) >= table.sizeHintForColumn(column)
    assert measured.rect().contains(table.mapTo(measured, table.rect().bottomRight()))


def test_every_row_and_column_of_effects_explains_itself(measured: MainWindow, until) -> None:
    until(lambda: "Finite slope" in _rows(measured))
    table = measured.cost.effects
    for column in range(table.columnCount()):
        assert table.horizontalHeaderItem(column).toolTip()
    tips = {table.item(row, 0).text(): table.item(row, 0).toolTip() for row in range(3)}
    assert "% of the peak. It is omitted." in tips["Finite slope"]


@pytest.mark.full
def test_measuring_anew_forgets_what_was_wanted_of_the_skin_before(
    measured: MainWindow, until, qtbot
) -> None:
    panel = measured.cost
    qtbot.keyClick(panel.required, Qt.Key.Key_Home)
    until(lambda: panel.required.value() == 0)
    assert panel.cheapest.text()
    panel.again.click()
    assert not panel.required.isEnabled()
    assert (panel.required_text.text(), panel.cheapest.text()) == ("", "")
    until(
        lambda: panel.required_text.text() == panel.figures["Predicted", "RMS error"].text(), 60.0
    )


# The last on the shared window, which it leaves measured on another skin.
@pytest.mark.full
def test_another_basis_is_measured_too_and_another_skin_only_when_asked(
    measured: MainWindow, until
) -> None:
    message = measured.cost.message
    measured.history.change("Odd", -1, functions_x=7, functions_y=5)
    odd = Setting("least-squares", (7, 5), (10, 10))
    until(lambda: odd in measured.measurement.costs, 60.0)
    measured.history.change("Noise", -1, noise_rms=1.0)
    until(lambda: message.text() == "Measured with other noise: measure again.")
    measured.history.change("Creep", -1, creep=0.1)
    until(lambda: message.text() == "Measured with other effects: measure again.")
    was = measured.measurement.costs[odd]
    measured.history.change("Edge", -1, edge="clamped")
    until(lambda: "on another skin" in message.text())
    measured.cost.again.click()
    until(lambda: odd in measured.measurement.costs, 60.0)
    assert measured.measurement.costs[odd] is not was
    until(lambda: not message.isVisible())
    measured.history.change("Load", -1, load_case="centre")
    until(lambda: "under another load" in message.text())
    measured.history.change("Bits", -1, bits=12)
    until(lambda: "with other electronics" in message.text())
