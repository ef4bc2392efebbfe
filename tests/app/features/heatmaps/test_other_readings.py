"""A window on sensors that read heights and slopes."""

from kappaskin_app.features.contact.numbers import head_of
from kappaskin_app.shell.window import MainWindow


def test_each_quantity_and_direction_has_a_heatmap_in_its_unit(opened, until) -> None:
    window: MainWindow = opened("sim:tilts")
    until(lambda: len(window.membrane.ages) > 2 and "reading_1" in window.heatmaps)
    maps = [window.heatmaps[f"reading_{n}"] for n in range(2)]
    until(lambda: all(one.isVisible() and "mrad" in one.value.text() for one in maps))
    assert not any(window.heatmaps[name].isVisible() for name in ("xx", "yy", "xy"))
    assert [one.cells.accessibleName() for one in maps] == [
        "Heatmap of slope 0\N{DEGREE SIGN}",
        "Heatmap of slope 90\N{DEGREE SIGN}",
    ]
    plots = window.selected_element.traces.plots
    assert [plot.accessibleName() for plot in plots] == ["Reading slope@0", "Reading slope@90"]
    sensor = window.session.status.sensor
    assert head_of(sensor)[3:5] == ("slope@0 [m/m]", "slope@90 [m/m]")
    window.selected_element.select(17)
    until(lambda: "Element 17" in window.selected_element.panel.title.text())
    assert "mrad" in window.selected_element.panel.facts.text()


def test_another_skin_has_its_own_heatmaps_again(opened, until) -> None:
    window: MainWindow = opened("sim:camera")
    until(lambda: "reading_0" in window.heatmaps and window.heatmaps["reading_0"].isVisible())
    until(lambda: "\N{MICRO SIGN}m" in window.heatmaps["reading_0"].value.text())
    window.history.change("Light", -1, theme="light")
    window.history.change("Maps", -1, maps=("xx", "health"))
    until(lambda: window.heatmaps["health"].isVisible())
    assert window.heatmaps["reading_0"].isVisible()
    assert not window.heatmaps["xx"].isVisible()
