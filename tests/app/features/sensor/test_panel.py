"""Electronics, gages and the region to scan: from settings to the scene and to what is told."""

import numpy as np
import pytest

from kappaskin import PointLoad, Region, Status
from kappaskin.estimation import ScanTradeoff
from kappaskin.scenes.effects import SECOND_GENERATION_LOOPS, Creep, Tolerance, UniformNoise
from kappaskin.sensing import SECOND_GENERATION
from kappaskin_app.features.sensor.panel import RegionPanel, StretchingPanel
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import SHAPES
from kappaskin_app.shell.simulation import region_of, scene_of, with_consequences


def test_the_default_gages_spoil_nothing_but_the_noise():
    assert scene_of(Settings()).effects == (UniformNoise(0.231),)


def test_effects_stand_in_the_order_in_which_they_come_about():
    settings = Settings(loops="second", creep=0.1, tolerance=0.05)

    effects = scene_of(settings).effects

    assert effects[0] is SECOND_GENERATION_LOOPS
    assert effects[1:3] == (Creep(0.1, 5.0), Tolerance(0.05, 0.5))


def test_a_prototype_brings_its_converter_and_its_frame_rate():
    changed = with_consequences(Settings(), scene_of(Settings()), "electronics", "second")
    settings = Settings(**changed)

    scene = scene_of(settings)

    assert scene.transduction == SECOND_GENERATION
    assert scene.rate == 166  # 300 channels of 20 us


def test_other_elements_are_no_longer_those_chosen():
    settings = Settings(region_elements=(99,))

    changed = with_consequences(settings, scene_of(settings), "elements_x", 5)

    assert changed == {"elements_x": 5, "region_elements": (), "dead_elements": ()}


def test_until_elements_are_chosen_all_are_scanned():
    assert region_of(Settings(region="elements")) == Region()
    assert region_of(Settings(region="elements", region_elements=(3,))).elements == (3,)


@pytest.mark.full
def test_a_click_chooses_an_element_and_another_lets_it_go(window):
    window.requests.set("region", "elements")
    for _ in range(3):
        window.heatmaps["xx"].chosen.emit(44)

    assert window.history.settings.region_elements == (44,)

    window.history.stack.undo()
    assert window.history.settings.region_elements == ()


@pytest.mark.full
def test_a_click_chooses_nothing_while_no_elements_are_asked_for(window):
    window.heatmaps["yy"].chosen.emit(44)

    assert window.history.settings.region_elements == ()


@pytest.mark.full
def test_a_region_shows_its_frame_rate_and_accuracy(window, until):
    window.requests.set("electronics", "second")
    window.requests.set("region", "skin")

    until(lambda: "instead of 166 frames/s" in window.region.message.text())
    assert "Contact position from one frame, at best" in window.region.message.text()
    until(lambda: window.session.estimate is not None and not window.session.estimate.fresh.all())


@pytest.mark.parametrize(
    ("electronics", "gain"),
    [
        ("modern", "Frame rate: 500 frames/s, as with all channels (possible:"),
        ("second", "Frame rate: 500 instead of 166 frames/s, 3.0 times as many (possible:"),
        ("first", "Frame rate: 500 instead of 166 frames/s, 3.0 times as many (possible:"),
    ],
)
def test_the_tradeoff_is_of_the_frames_that_really_come(qapp, electronics, gain):
    settings = Settings(
        region="skin",
        **with_consequences(Settings(), scene_of(Settings()), "electronics", electronics),
    )
    sensor, region = scene_of(settings).sensor(), region_of(settings)
    panel = RegionPanel()
    panel.show_settings(settings)
    panel.show_status(Status(sensor=sensor, region=region), simulating=True)
    panel.show_tradeoff(ScanTradeoff.of(sensor, region, PointLoad(0.05, 0.05, 0.15), 0.231))
    panel.show_status(Status(sensor=sensor, region=region), simulating=True)

    assert gain in panel.message.text()
    assert "Contact position from one frame" in panel.message.text()
    assert "mm with all channels" in panel.message.text()


@pytest.mark.cases("tolerance")
@pytest.mark.parametrize("name", ["creep", "tolerance", "region_share"])
def test_a_share_is_shown_in_per_cent(window, name):
    window.requests.set(name, 0.15)

    panel = window.region if name == "region_share" else window.gages
    assert panel.editor(name).text() == "15 %"


@pytest.mark.full
def test_elements_bent_beyond_their_limit_are_crossed_out(window, until):
    until(lambda: window.session.estimate is not None)
    estimate = window.session.estimate
    limit = window.session.status.sensor.transduction.strain_limit_curvature
    curvature = np.zeros_like(estimate.curvature)
    curvature[0, 7] = 1.1 * limit

    assert np.flatnonzero(window.display.marks(curvature)[0]).tolist() == [7]


def test_a_strip_tells_where_the_contact_is_along_it_alone(qapp) -> None:
    sensor = scene_of(Settings(shape="strip", **SHAPES["strip"].lengths)).sensor()
    region = Region(around="adaptive", share=0.2)
    panel = RegionPanel()
    panel.show_settings(Settings(region="adaptive"))
    panel.show_tradeoff(ScanTradeoff.of(sensor, region, PointLoad(0.02, 0.02, 0.5), 0.2))
    panel.show_status(Status(state="streaming", sensor=sensor, region=region), True)
    bars = "\N{PLUS-MINUS SIGN}1 \u03c3"
    assert f"at best: \N{PLUS-MINUS SIGN} 0.04 mm ({bars}), " in panel.message.text()
    assert "\N{PLUS-MINUS SIGN} 0.02 mm with all channels." in panel.message.text()


@pytest.mark.parametrize(("shape", "possible"), [("flat", False), ("cylinder", True)])
def test_a_hoop_is_held_on_a_bent_skin_alone(qapp, shape, possible) -> None:
    panel = StretchingPanel()

    panel.show_settings(Settings(shape=shape, **SHAPES[shape].lengths))

    box = panel.editor("inplane")
    enabled = {box.itemData(k): box.model().item(k).isEnabled() for k in range(box.count())}
    assert enabled == {"": True, "held": True, "diaphragm": True, "free": True, "hoop": possible}
