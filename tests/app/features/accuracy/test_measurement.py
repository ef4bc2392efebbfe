"""When costs are measured, and of what: the setting in use, this skin, a real sensor's."""

import math
import multiprocessing
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt

from kappaskin import Patch, SensorLayout
from kappaskin.scenes.effect_plan import kept_effects
from kappaskin.scenes.effects import StatedNoise
from kappaskin.sensing import DigitalReadings
from kappaskin.studies import Setting
from kappaskin_app.features.accuracy.measurement import setting_text
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import scene_of, scene_of_sensor
from kappaskin_app.shell.window import MainWindow

from .conftest import all_measured

pytestmark = pytest.mark.usefixtures("few")


def _processes() -> list[str]:
    names = [child.name for child in multiprocessing.active_children()]
    return [name for name in names if name == "kappaskin-cost_steps"]


@pytest.mark.full
def test_the_panel_is_hidden_until_f9_and_then_measures_by_itself(
    window: MainWindow, until, qtbot
) -> None:
    assert not window.cost.isVisible()
    until(lambda: window.session.status.sensor is not None)
    assert not _processes()
    qtbot.keyClick(window, Qt.Key.Key_F9)
    assert window.cost.isVisible()
    until(lambda: _processes() == ["kappaskin-cost_steps"])
    until(lambda: window.cost.bar.isVisible())
    until(lambda: window.measurement.progress[0] > 0, 60.0)
    assert window.measurement.left > 0
    until(lambda: " left" in window.cost.count.text())
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 2)


@pytest.mark.full
def test_nobody_looking_ends_the_measuring_and_a_look_takes_it_up_again(
    window: MainWindow, until
) -> None:
    dock = window.actions_by_name["dock-cost"]
    dock.trigger()
    until(lambda: window.measurement.progress[0] > 0, 60.0)
    dock.trigger()
    assert not window.measurement.running
    assert not _processes()
    kept = dict(window.measurement.costs)
    dock.trigger()
    until(lambda: all_measured(window), 60.0)
    assert all(window.measurement.costs[setting] is cost for setting, cost in kept.items())


@pytest.mark.full
def test_the_setting_in_use_is_measured_first(window: MainWindow, until) -> None:
    window.history.change("Odd", -1, method="bayes", functions_x=7, functions_y=5)
    until(lambda: window.session.status.setup.Ni == 7)
    window.actions_by_name["dock-cost"].trigger()
    until(lambda: window.measurement.progress[0] > 0, 60.0)
    assert next(iter(window.measurement.costs)) == Setting("bayes", (7, 5), (10, 10))


def test_how_many_elements_there_are_is_told_once_it_is_known() -> None:
    setting = Setting("bayes", (8, 8), None)
    assert setting_text(setting).endswith("functions")
    assert setting_text(setting, 92).endswith("functions, 92 elements")


@pytest.mark.full
def test_a_skin_without_a_load_is_refused_in_words(window: MainWindow, until) -> None:
    window.session.scene = scene_of(Settings(load_case="point", force=0.0))
    window.actions_by_name["dock-cost"].trigger()
    until(lambda: window.measurement.refusal != "", 60.0)
    until(lambda: window.cost.message.isVisible())
    assert "load" in window.cost.message.text()
    assert not window.measurement.running


@pytest.mark.full
def test_a_real_sensor_has_no_effects_to_leave_out(window: MainWindow, until) -> None:
    window.session.source = "/dev/real"
    window.actions_by_name["dock-cost"].trigger()
    until(lambda: window.cost.no_effects.isVisible(), 60.0)
    assert window.cost.no_effects.text() == (
        "The readings of a real sensor include all effects: none can be omitted."
    )
    until(lambda: window.measurement.progress[0] > 0, 60.0)
    assert not window.measurement.effects
    assert not window.cost.effects.isVisible()


def test_a_real_sensor_is_reckoned_with_its_own_skin_and_noise() -> None:
    sensor = scene_of(Settings(elements_x=7, dead_elements=(3,), edge="clamped")).sensor()
    scene = scene_of_sensor(sensor, 0.3)
    assert (scene.plate, scene.layout, scene.edge) == (sensor.plate, sensor.layout, "clamped")
    assert [effect.rms for effect in scene.effects] == [0.3]
    (load,) = scene.loads
    assert load.centre().tolist() == pytest.approx([0.05, 0.05])


def test_a_sensor_of_several_units_is_reckoned_with_its_noise_over_that_stated() -> None:
    noise = (("height", 5e-6), ("slope", 5e-4))
    sensor = replace(
        scene_of(Settings()).sensor(),
        layout=SensorLayout.regular(Patch(0.1, 0.1), 6, 6).reading(
            np.repeat(np.arange(36)[::-1], 2), ["slope", "height"] * 36, math.radians(30)
        ),
        transduction=DigitalReadings(noise=noise),
    )
    scene = scene_of_sensor(sensor, 2.0)
    assert scene.layout.each_reads == ["height", "slope@30"]
    assert dict(scene.transduction.noise) == pytest.approx({"height": 1e-5, "slope": 1e-3})
    assert scene.effects == ()


def test_a_sensor_whose_noises_differ_in_one_unit_is_reckoned_with_each() -> None:
    noise = (("curvature@0", 0.1), ("curvature@90", 0.2), ("twist", 0.4))
    sensor = replace(
        scene_of(Settings()).sensor(),
        layout=SensorLayout.regular(Patch(0.1, 0.1), 6, 6).reading(
            np.tile(np.arange(36), 3),
            np.repeat(["curvature", "curvature", "twist"], 36),
            np.repeat([0.0, math.pi / 2, 0.0], 36),
        ),
        transduction=DigitalReadings(noise=noise),
    )
    scene = scene_of_sensor(sensor, 2.0)
    (stated,) = (effect for effect in kept_effects(scene) if isinstance(effect, StatedNoise))
    assert dict(zip(scene.layout.each_reads, stated.each, strict=True)) == pytest.approx(
        {name: 2 * each for name, each in noise}
    )
