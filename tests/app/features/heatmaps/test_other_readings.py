"""A window on sensors that read heights and slopes."""

import pytest

from kappaskin_app.features.contact.numbers import head_of
from kappaskin_app.shell.window import MainWindow


def test_each_quantity_and_direction_has_a_heatmap_in_its_unit(opened, until) -> None:
    window: MainWindow = opened("sim:tilts")
    until(lambda: len(window.membrane.ages) > 2 and "slope@90" in window.heatmaps)
    maps = [window.heatmaps[name] for name in ("slope@0", "slope@90")]
    until(lambda: all(one.isVisible() and "mrad" in one.value.text() for one in maps))
    assert not any(window.heatmaps[name].isVisible() for name in ("xx", "yy", "xy"))
    assert [one.cells.accessibleName() for one in maps] == [
        "Heatmap of slope 0\N{DEGREE SIGN}",
        "Heatmap of slope 90\N{DEGREE SIGN}",
    ]
    pictures = window.actions_by_name
    until(lambda: "picture-of-the map of slope 90\N{DEGREE SIGN}" in pictures.entries)
    assert not pictures.why_not("picture-of-the map of slope 0\N{DEGREE SIGN}")
    assert "does not read" in pictures.why_not("picture-of-the map of curvature xx")
    plots = window.selected_element.traces.plots
    assert [plot.accessibleName() for plot in plots] == ["Reading slope@0", "Reading slope@90"]
    sensor = window.session.status.sensor
    assert head_of(sensor)[3:5] == ("slope@0 [m/m]", "slope@90 [m/m]")
    window.selected_element.select(17)
    until(lambda: "Element 17" in window.selected_element.panel.title.text())
    assert "mrad" in window.selected_element.panel.facts.text()


@pytest.mark.full
def test_another_skin_has_its_own_heatmaps_again(opened, until) -> None:
    window: MainWindow = opened("sim:camera")
    until(lambda: "height" in window.heatmaps and window.heatmaps["height"].isVisible())
    until(lambda: "\N{MICRO SIGN}m" in window.heatmaps["height"].value.text())
    window.history.change("Light", -1, theme="light")
    window.history.change("Maps", -1, maps=("xx", "health"))
    until(lambda: window.heatmaps["health"].isVisible())
    assert window.heatmaps["height"].isVisible()
    assert not window.heatmaps["xx"].isVisible()


@pytest.mark.full
def test_ranges_and_colours_of_readings_are_kept_while_another_sensor_is_shown(
    opened, until
) -> None:
    window: MainWindow = opened("sim:tilts")
    until(lambda: "slope@0" in window.heatmaps and window.heatmaps["slope@0"].isVisible())
    colour = window.features["membrane"].panel.editor("colour_by")
    colour.activated.emit(colour.findText("Slope 90\N{DEGREE SIGN}"))
    until(lambda: (window.scale.bar.limits[0] < 0) and "Slope 90" in window.scale.what.text())
    first, second = (window.heatmaps[name] for name in ("slope@0", "slope@90"))
    first.lock.click()
    locked = first.limit
    assert window.history.settings.ranges == {"slope@0": pytest.approx(locked)}
    assert (first.lock.isChecked(), second.lock.isChecked()) == (True, False)
    window.scale.lock.click()
    assert second.lock.isChecked()

    window.session.request_source("sim:circle")
    until(lambda: window.heatmaps["xx"].isVisible() and not first.isVisible())
    pictures = window.actions_by_name
    assert not pictures.why_not("picture-of-the map of curvature xx")
    assert "does not read" in pictures.why_not("picture-of-the map of slope 0\N{DEGREE SIGN}")
    assert (colour.currentText(), colour.findText("Slope 90\N{DEGREE SIGN}")) == (
        "Displacement",
        -1,
    )
    assert window.actions_by_name.why_not("colour-slope@90") == "this sensor does not read it"
    window.actions_by_name["lock-ranges"].trigger()
    assert window.history.settings.range_xx > 0

    window.session.request_source("sim:tilts")
    until(lambda: first.isVisible() and not window.heatmaps["xx"].isVisible())
    assert colour.currentText() == "Slope 90\N{DEGREE SIGN}"
    until(lambda: first.bar.limits == pytest.approx((-1e3 * locked, 1e3 * locked)))
    window.actions_by_name["lock-ranges"].trigger()
    assert window.history.settings.ranges == {}
