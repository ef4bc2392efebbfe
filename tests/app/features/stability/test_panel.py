import math

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QSlider,
    QTabBar,
    QTableWidget,
)

from kappaskin import Refusal, SensorLayout, SineBasis
from kappaskin.estimation import singular_values
from kappaskin_app.features.stability.demonstrations import DEMONSTRATIONS
from kappaskin_app.features.stability.observability import MOST, Spectrum
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import scene_of
from kappaskin_app.shell.window import MainWindow


def of(**settings: object) -> Spectrum:
    """The spectrum of what the settings ask for."""
    s = Settings(**settings)  # type: ignore[arg-type]
    sensor = scene_of(s).sensor()
    across = 1 if sensor.layout.patch.strip else s.functions_y
    return Spectrum.of(sensor, s.fit_edge or sensor.edge, (s.functions_x, across))


def demonstration(title: str) -> dict:
    case = next(case for case in DEMONSTRATIONS if case.title.startswith(title))
    return case.changes() | dict(case.then)


def test_table_1s_functions_are_all_seen_alike() -> None:
    spectrum = of()
    assert spectrum.silent == 0
    assert spectrum.uniform
    assert "Condition number 1: of 64 modes all are equally observable." in spectrum.describe()


def test_twelve_by_twelve_from_ten_by_ten_leave_four_shapes_unseen() -> None:
    spectrum = of(**demonstration("12 x 12 functions"))
    assert spectrum.silent == 4
    assert "infinite: 4 of 144 modes are unobservable" in spectrum.describe()
    assert spectrum.mode_text(144).startswith("Unobservable")
    operator = spectrum.layout.operator(spectrum.basis)
    most = np.abs(operator @ spectrum.shapes[0].ravel()).max()
    assert np.abs(operator @ spectrum.shapes[-1].ravel()).max() < 1e-9 * most


def test_a_row_less_costs_twice_the_noise_and_a_quarter_thousands() -> None:
    assert "has 2 times the noise" in of(**demonstration("One row dead")).describe()
    assert "has 9\N{THIN SPACE}500 times" in of(**demonstration("A quarter dead")).describe()


def test_pinned_ends_decide_the_fingertips_silent_mode_and_sliding_ones_do_not() -> None:
    pinned = of(**demonstration("The fingertip\N{RIGHT SINGLE QUOTATION MARK}s silent mode"))
    sliding = of(**demonstration("The fingertip with sliding ends"))
    assert (len(pinned.values), pinned.silent) == (7, 0)
    assert (len(sliding.values), sliding.silent) == (8, 1)
    x = np.linspace(0, math.pi, 65)
    surface = sliding.surface(8, 65, 5)
    assert np.abs(np.abs(surface) - np.sin(x)).max() < 1e-6  # a translation, of either sign


def test_a_shape_is_drawn_with_its_largest_displacement_one() -> None:
    for settings in ({}, {"shape": "disk", "side_x": 0.1, "side_y": 0.1}):
        surface = of(**settings).surface(3, 41, 41)
        assert np.nanmax(np.abs(surface)) == 1
        assert np.nanmax(surface) == 1


def test_every_demonstration_is_a_scene_that_can_be() -> None:
    for case in DEMONSTRATIONS:
        settings = Settings(**case.changes() | dict(case.then))
        assert case.holds(settings)
        assert not case.holds(Settings(elements_x=9))
        scene_of(settings)
    titles = [case.title for case in DEMONSTRATIONS]
    assert len(set(titles)) == len(titles)


def test_dead_elements_read_nothing_and_are_refused_where_there_are_none() -> None:
    scene = scene_of(Settings(dead_elements=(3, 99)))
    assert np.flatnonzero(~scene.layout.live.any(axis=0)).tolist() == [3, 99]
    with pytest.raises(Refusal, match="between 0 and 24"):
        scene_of(Settings(elements_x=5, elements_y=5, dead_elements=(99,)))


@pytest.mark.full
def test_other_elements_or_another_shape_are_all_alive(window: MainWindow) -> None:
    for name, value in (("elements_x", 9), ("shape", "disk")):
        window.history.change("Dead", -1, dead_elements=(50,))
        window.requests.set(name, value)
        assert window.history.settings.dead_elements == ()


def _opened(window: MainWindow, until) -> MainWindow:
    window.actions_by_name["dock-stability"].trigger()
    until(lambda: window.observability.spectrum is not None)
    return window


@pytest.mark.full
def test_the_panel_is_hidden_until_f10_and_then_shows_what_is_asked_for(
    window: MainWindow, until, qtbot, colours_in
) -> None:
    assert not window.stability.isVisible()
    qtbot.keyClick(window, Qt.Key.Key_F10)
    assert window.stability.isVisible()
    until(lambda: "of 64 modes" in window.stability.words.text())
    assert colours_in(window, window.stability.plot) > 5
    assert colours_in(window, window.stability.map) > 20
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 3)


@pytest.mark.full
def test_what_the_sensor_refuses_is_shown_all_the_same(window: MainWindow, until) -> None:
    panel = _opened(window, until).stability
    panel.buttons[3].click()
    until(lambda: "4 of 144" in panel.words.text())
    until(lambda: "determine 140 of the 144" in panel.refused.text())
    assert panel.refused.isVisible()
    until(lambda: window.session.estimate.coefficients.shape != (12, 12))
    assert panel.explanation.text() == DEMONSTRATIONS[3].text
    panel.buttons[4].click()
    until(lambda: window.session.estimate.coefficients.shape == (12, 12))
    until(lambda: not panel.refused.text())


@pytest.mark.full
def test_a_demonstration_is_one_step_and_back_undoes_it(window: MainWindow, until) -> None:
    panel, was = _opened(window, until).stability, window.history.settings
    assert not panel.undo.isEnabled()
    for button in panel.buttons[:6]:
        button.click()
    assert window.history.settings.shape == "strip"
    until(lambda: window.membrane.skin.patch.strip)
    assert "dead" not in window.connection.device.text()  # of xx, which it has
    until(lambda: window.session.estimate is not None)
    for _ in range(6):
        panel.undo.click()
    assert window.history.settings == was
    assert not panel.undo.isEnabled()


@pytest.mark.full
def test_sliding_ends_are_refused_of_a_fingertip_that_is_seen_and_all_of_it_is_one_step(
    window: MainWindow, until
) -> None:
    panel, was = _opened(window, until).stability, window.history.settings
    panel.buttons[6].click()
    until(lambda: window.history.settings.fit_edge == "sliding")
    until(lambda: "is a rigid motion without curvature" in panel.refused.text())
    assert panel.refused.text().startswith("In use: Least squares, 8 x 1 functions. 10")
    until(lambda: window.session.estimate is not None and window.display.badge.state == "SIM")
    until(lambda: "infinite: 1 of 8 modes is unobservable" in panel.words.text())
    panel.undo.click()
    assert window.history.settings == was


@pytest.mark.full
def test_a_demonstration_that_is_overtaken_does_not_go_on(window: MainWindow, until) -> None:
    panel = _opened(window, until).stability
    panel.buttons[6].click()
    window.history.stack.undo()
    until(lambda: window.session.status.sensor is not None and not window.session.status.computing)
    for _ in range(3):
        window.demonstrator.follow(window.session.status)
    assert window.history.settings.fit_edge == ""


@pytest.mark.full
def test_how_things_are_shown_stays_through_a_demonstration(window: MainWindow, until) -> None:
    window.history.change("Look", -1, theme="light", exaggeration=3.0, colour_by="xx")
    _opened(window, until).stability.buttons[0].click()
    s = window.history.settings
    assert (s.theme, s.exaggeration, s.colour_by) == ("light", 3.0, "xx")


@pytest.mark.full
def test_the_worst_seen_shape_colours_the_skin_while_it_is_looked_at(
    window: MainWindow, until
) -> None:
    bar, caption = window.scale.bar, window.membrane.caption
    panel = _opened(window, until).stability
    assert not caption.input  # all are equally observable
    panel.buttons[1].click()
    until(lambda: caption.input == "Colours: mode 64 of 64, no measurement")
    until(lambda: bar.limits == (-1.0, 1.0))
    assert not window.scale.lock.isEnabled()
    values = window.membrane.surface.mesh.point_data["value"]
    until(lambda: np.abs(values).max() == pytest.approx(1.0))
    panel.on_skin.click()
    until(lambda: bar.limits != (-1.0, 1.0))
    assert not caption.input
    panel.on_skin.click()
    assert caption.input
    window.actions_by_name["dock-stability"].trigger()
    assert not caption.input
    assert window.scale.lock.isEnabled()
    until(lambda: bar.limits != (-1.0, 1.0))


@pytest.mark.full
def test_a_shape_is_chosen_by_a_click_the_arrows_or_its_number(
    window: MainWindow, until, qtbot
) -> None:
    panel = _opened(window, until).stability
    assert window.observability.number == 64
    value = float(window.observability.spectrum.values[9])
    until(lambda: panel.plot.place_of(10.0, value).x() > 50)
    place = panel.plot.place_of(10.0, value).toPoint()
    qtbot.mouseClick(panel.plot.canvas, Qt.MouseButton.LeftButton, pos=place + QPoint(0, -5))
    assert panel.plot.hasFocus()
    assert window.observability.number == 10
    assert panel.number.value() == 10
    qtbot.keyClick(panel.plot, Qt.Key.Key_Right)
    assert window.observability.number == 11
    panel.number.setFocus()
    qtbot.keyClick(panel.number, Qt.Key.Key_Down)
    assert window.observability.number == 10
    assert "mode 10 of 64" in window.membrane.caption.input  # it was selected


@pytest.mark.full
def test_very_many_functions_are_not_waited_for(window: MainWindow, until) -> None:
    panel = _opened(window, until).stability
    window.history.change("Many", -1, functions_x=64, functions_y=64)
    until(lambda: str(MOST) in window.observability.refusal)
    assert window.observability.spectrum is None
    assert not panel.number.isEnabled()
    window.history.stack.undo()
    until(lambda: window.observability.spectrum is not None)


@pytest.mark.full
def test_a_real_sensor_leaves_the_demonstrations_to_the_simulation(
    window: MainWindow, until
) -> None:
    panel = _opened(window, until).stability
    window.session.source = "/dev/real"
    until(lambda: not panel.buttons[0].isEnabled())
    assert "Ctrl+M" in panel.explanation.text()


@pytest.mark.full
def test_both_panels_below_the_skin_share_a_place_and_fit_a_small_window(
    window: MainWindow, until
) -> None:
    cost, stability = (window.actions_by_name[name] for name in ("dock-cost", "dock-stability"))

    def seen() -> tuple[bool, bool]:
        return tuple(not p.visibleRegion().isEmpty() for p in (window.cost, window.stability))

    cost.trigger()
    until(lambda: window.measurement.running)
    stability.trigger()
    until(lambda: seen() == (False, True))
    assert not window.measurement.running
    assert (cost.isChecked(), stability.isChecked()) == (False, True)
    assert (window.width(), window.height()) == (1280, 800)
    assert window.minimumSizeHint().height() <= 800
    for button in window.stability.buttons:
        assert button.width() >= button.sizeHint().width()
    cost.trigger()
    until(lambda: seen() == (True, False))  # brought to the front, not hidden
    cost.trigger()
    until(lambda: seen() == (False, True))


@pytest.mark.full
def test_everything_below_the_skin_explains_itself(window: MainWindow) -> None:
    own = (QTabBar, QTableWidget)  # have buttons of their own, which are never seen
    for panel in (window.cost, window.stability, window.scene):
        for kind in (QAbstractSpinBox, QAbstractButton, QSlider):
            for widget in panel.findChildren(kind):
                assert widget.toolTip() or isinstance(widget.parent(), own), widget


@pytest.mark.full
def test_the_shortcuts_are_on_the_cheat_sheet_and_meant_once(window: MainWindow) -> None:
    window.actions_by_name["shortcuts"].trigger()
    listed = window.menus.shortcuts.list
    shown = [listed.topLevelItem(row).text(2) for row in range(listed.topLevelItemCount())]
    assert {"F9", "F10"} <= set(shown)
    window.menus.shortcuts.close()
    keys = [entry.action.shortcut().toString() for entry in window.actions_by_name.entries.values()]
    keys = [key for key in keys if key]
    assert len(set(keys)) == len(keys)


def test_singular_values_are_those_of_the_scaled_operator() -> None:
    spectrum = of(dead_elements=(0, 17))
    layout = SensorLayout.regular(spectrum.basis.patch, 10, 10).without([0, 17])
    values, _ = singular_values(SineBasis(layout.patch, 8, 8), layout)
    assert spectrum.values == pytest.approx(values)


@pytest.mark.full
def test_the_panels_below_the_skin_cannot_be_dropped_into_a_column(window: MainWindow) -> None:
    beside = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.RightDockWidgetArea
    for dock in (window.docks["cost"], window.docks["stability"]):
        assert dock.isAreaAllowed(Qt.DockWidgetArea.BottomDockWidgetArea)
        assert not any(dock.isAreaAllowed(area) for area in beside)


@pytest.mark.full
def test_what_is_in_use_is_said_where_the_method_is_refused(window: MainWindow, until) -> None:
    window.history.change("Fast", -1, method="fast", functions_x=12, functions_y=12)
    message = window.basis.message
    until(lambda: message.text().startswith("In use: Least squares, 8 x 8 functions. Expected"))
