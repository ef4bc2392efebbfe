"""The design panel: predicted at once, checked by a simulation, and saved as a scene."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QFileDialog, QLabel

from kappaskin import Plate, Scene, SensorLayout, load_scene, write_scene
from kappaskin.errors import Refusal
from kappaskin.mechanics import DiscLoad
from kappaskin.scenes import read_scene
from kappaskin.scenes.effects import GaussianNoise
from kappaskin.skin import MeshSkin
from kappaskin.studies import prospect
from kappaskin_app.features.design.panel import DesignForm, _place, _value_at, skin_map
from kappaskin_app.features.design.prediction import _checks, _prospect, design_of, scene_of
from kappaskin_app.shell.settings import Settings, form_field
from kappaskin_app.shell.settings.designed import DesignSettings
from kappaskin_app.shell.settings.form_fields import Range
from kappaskin_app.shell.settings.scene import SHAPES, Written
from kappaskin_app.shell.simulation import with_consequences
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import DARK, apply_look
from kappaskin_app.widgets.surface_map import SurfaceMap
from meshes import ellipsoid

RANGES = [n for n in DesignSettings.__dataclass_fields__ if isinstance(form_field(n), Range)]


def shaped(name: str) -> Settings:
    settings = Settings()
    return replace(settings, **with_consequences(settings, None, "design_shape", name))


@pytest.mark.cases("cap", "cylinder", "disk", "dome", "flat", "strip")
@pytest.mark.parametrize("name", SHAPES)
def test_every_outline_is_designed_with_its_usual_lengths(name: str):
    told = prospect(design_of(shaped(name)))

    assert 0 < told.rms < told.worst < 1e-3
    assert len(told.positions) == len(scene_of(shaped(name)).layout)


@pytest.mark.parametrize("name", SHAPES)
def test_every_outline_is_a_scene_that_opens_however_slow_its_converter_is(name: str):
    scene = scene_of(replace(shaped(name), design_conversion=form_field("design_conversion").most))

    assert read_scene(write_scene(scene), Path("a.toml")).rate == scene.rate


@pytest.mark.parametrize("name", [name for name in SHAPES if name != "cap"])
def test_a_design_that_reads_heights_and_slopes_is_a_scene_that_opens(name: str):
    settings = replace(shaped(name), design_reads=("height", "slope@0"))

    scene = read_scene(write_scene(scene_of(settings)), Path("a.toml"))

    assert scene.layout.each_reads == ["height", "slope@0"]
    assert dict(scene.transduction.noise) == {"height": 5e-6, "slope": 5e-4}
    assert scene.rate == SHAPES[name].rate


@pytest.mark.parametrize(
    ("pattern", "count"), [("grid", 80), ("rings", 60), ("spiral", 60)], ids=str
)
def test_elements_of_a_cap_are_in_the_selected_pattern(pattern: str, count: int) -> None:
    scene = scene_of(replace(shaped("cap"), design_pattern=pattern))

    assert len(scene.layout) == count
    away = scene.layout.positions - scene.plate.patch.a / 2
    at_pole = (np.hypot(*away.T) < 1e-9).sum()
    assert at_pole == (pattern == "rings")


def test_the_pattern_of_a_rectangle_is_a_grid() -> None:
    assert scene_of(replace(Settings(), design_pattern="spiral")).layout.shape == (10, 10)


@pytest.mark.parametrize(
    ("rings", "words"), [("1, six", "such as 1, 6, 13"), ("0, 4", "each ring")]
)
def test_rings_that_cannot_be_are_refused(rings: str, words: str) -> None:
    with pytest.raises(Refusal, match=words):
        scene_of(replace(shaped("cap"), design_pattern="rings", design_rings=rings))


def test_the_form_shows_what_applies_to_the_pattern(qtbot) -> None:
    form = DesignForm()
    qtbot.addWidget(form)
    form.show()
    rows = {"design_pattern", "design_count", "design_rings", "design_x", "design_y"}

    def shown(settings: Settings) -> set[str]:
        form.show_settings(settings)
        return {name for name in rows if form.editor(name).isVisible()}

    assert shown(Settings()) == {"design_x", "design_y"}
    assert shown(shaped("cap")) == {"design_pattern", "design_count"}
    rings = replace(shaped("cap"), design_pattern="rings")
    assert shown(rings) == {"design_pattern", "design_rings"}


def test_a_cap_that_reads_slopes_is_refused() -> None:
    with pytest.raises(Refusal, match="heights, curvature or twist of each element of a cap"):
        scene_of(replace(shaped("cap"), design_reads=("height", "slope@0")))


def test_the_error_bar_of_heights_is_that_of_their_noise():
    heights = replace(Settings(), design_reads=("height",), design_height_noise=2e-6)

    # Of 8 x 8 sines on 10 x 10 elements, at whose places they are orthogonal.
    assert prospect(design_of(heights)).rms == pytest.approx(2e-6 * 8 / 10, rel=1e-6)


@pytest.mark.parametrize("name", RANGES)
def test_an_arrow_key_moves_every_slider_to_another_value_both_ways(name, qtbot):
    form, how = DesignForm(), form_field(name)
    qtbot.addWidget(form)
    form.requested.connect(lambda n, v: form.show_settings(replace(Settings(), **{n: v})))
    form.show_settings(Settings())
    slider, said = form.sliders[name], []
    form.requested.connect(lambda _, value: said.append(value))

    for key in (Qt.Key.Key_Right, Qt.Key.Key_Left, Qt.Key.Key_Left):
        qtbot.keyClick(slider, key)

    assert how.least <= said[2] < said[1] < said[0] <= how.most


@pytest.mark.parametrize("name", RANGES)
def test_a_slider_reaches_both_ends_and_stands_where_its_value_is(name):
    how = form_field(name)

    assert _value_at(0, how) == pytest.approx(how.least)
    assert _value_at(200, how) == pytest.approx(how.most)
    for at in range(0, 201, 20):
        assert abs(_place(_value_at(at, how), how) - at) <= max(
            200 * how.step / (how.most - how.least), 4
        )


@pytest.mark.full
def test_a_design_is_predicted_checked_undone_and_saved(
    window: MainWindow, until, qtbot, tmp_path: Path, monkeypatch
):
    design, prediction = window.design, window.prediction
    window.docks.reveal("design")
    until(lambda: prediction.prospect is not None and not prediction.predicting)
    first = prediction.prospect.rms

    window.requests.set("design_noise", 0.46)
    until(lambda: prediction.prospect.rms > 1.5 * first and not prediction.predicting)
    assert prediction.prospect.rms == pytest.approx(2 * first)
    assert "elements" in design.words.text()
    window.history.stack.undo()
    until(lambda: prediction.prospect.rms == pytest.approx(first))

    design.simulate.click()
    assert design.simulate.text() == "Stop the check"
    until(lambda: prediction.check is not None and not prediction.checking, 60)
    assert [curve.name for curve in design.along.series] == ["predicted", "simulated"]
    assert "times the prediction" in design.words.text()

    window.requests.set("design_place", "clustered")
    until(lambda: prediction.check is None and not prediction.predicting)
    file = tmp_path / "mine.toml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(file), ""))
    design.save.click()
    np.testing.assert_allclose(
        load_scene(str(file)).layout.positions, prediction.prospect.positions, atol=1e-9
    )


def opened_pad() -> Settings:
    """The settings with a small mesh open that a disc presses."""
    mesh = MeshSkin(*ellipsoid(17, (9e-3, 7e-3, 6e-3), math.radians(70)), 1e-3)
    plate, layout = Plate(mesh, 1e-3), SensorLayout.spread(mesh, 20)
    scene = Scene("pad", plate, layout, effects=(GaussianNoise(0.3),), edge="clamped")
    scene = scene.touched_by(DiscLoad(mesh.a / 2, mesh.b / 2, 1e-3, 0.1))
    return replace(Settings(), written=Written(write_scene(scene), Path("pad.toml")))


OPENED = {"design_shape": "open", "design_functions_x": 4, "design_functions_y": 3}


def test_the_open_scene_is_designed_on_its_mesh_with_its_noise_and_load(qtbot) -> None:
    settings = replace(opened_pad(), **OPENED, design_map="contact", design_place="contact")

    placed, found = _prospect(settings)

    mesh = placed.scene.plate.patch
    assert found.sd.shape == (len(mesh.nodes),)
    assert (len(found.positions), found.load.radius) == (20, 1e-3)
    assert found.rms < prospect(design_of(replace(settings, design_place="scene")), "contact").rms
    shown = skin_map(placed, found, 31, 25)
    assert shown.values.shape == (25, 31)
    assert shown.tint.limits[0] <= np.nanmin(shown.values) < np.nanmax(shown.values)
    assert np.nanmax(shown.values) <= shown.tint.limits[1]
    assert (shown.tint.unit, shown.label) == ("mm", "RMS error of the place")
    pressed = next(_checks(placed, "contact"))
    checked = found.surface(mesh, 31, 25, pressed.sd)
    np.testing.assert_array_equal(np.isfinite(checked), np.isfinite(shown.values))
    written = read_scene(write_scene(placed.scene), Path("a.toml"))
    np.testing.assert_allclose(written.layout.positions, found.positions, atol=1e-9)
    form = DesignForm()
    qtbot.addWidget(form)
    form.show()
    form.show_settings(settings)
    rows = {name for name in DesignSettings.__dataclass_fields__ if form.has_row(name)}
    assert rows == {*OPENED, "design_map", "design_place"}


@pytest.mark.full
def test_the_map_of_the_open_scene_colours_the_skin_while_the_panel_is_visible(
    window: MainWindow, until
) -> None:
    prediction, selection = window.prediction, window.selection
    window.docks.reveal("design")
    window.history.change("pad", -1, written=opened_pad().written, design_map="force", **OPENED)
    until(lambda: selection.map is not None, 120)
    until(lambda: window.scale.bar.limits == selection.map.tint.limits)

    assert window.membrane.caption.input.startswith("Colours: RMS error of the force under 0.1 N")
    assert selection.map.tint.unit == window.design.predicted.unit == "%"
    assert "Functions, N =" in {label.text() for label in window.design.form.findChildren(QLabel)}
    np.testing.assert_array_equal(selection.map.positions, prediction.prospect.positions)
    window.design.on_skin.setChecked(False)
    assert selection.map is None
    window.design.on_skin.setChecked(True)
    assert selection.map is not None
    window.docks["design"].hide()
    until(lambda: selection.map is None)


@pytest.mark.full
def test_what_cannot_be_designed_is_told_and_mended(window: MainWindow, until):
    prediction = window.prediction
    window.docks.reveal("design")

    window.history.change("more", -1, design_functions_x=24, design_functions_y=24)
    until(lambda: bool(prediction.refusal))
    assert prediction.prospect is None
    assert not window.design.save.isEnabled()
    assert window.design.words.text()
    window.history.stack.undo()
    until(lambda: prediction.prospect is not None and not prediction.refusal)


@pytest.mark.full
def test_what_elements_read_is_selected_placed_checked_and_saved(
    window: MainWindow, until, tmp_path: Path
):
    form, prediction = window.design.form, window.prediction
    window.docks.reveal("design")

    chosen = {"design_reads": ("height", "slope@0"), "design_place": "clustered"}
    window.history.change("readings", -1, **chosen)
    until(lambda: prediction.prospect is not None and prediction.prospect.rate == math.inf)
    shown = {name for name in RANGES if form.editor(name).isVisible()}
    assert {"design_height_noise", "design_slope_noise"} < shown
    assert not {"design_noise", "design_conversion"} & shown
    assert "100 elements. Due to noise" in window.design.words.text()
    assert " mm RMS" in window.design.words.text()

    window.design.simulate.click()
    until(lambda: prediction.check is not None, 60)
    assert prediction.check.rms_sd == pytest.approx(prediction.prospect.rms, rel=0.1)

    prediction.write(tmp_path / "mine.toml")
    layout = load_scene(str(tmp_path / "mine.toml")).layout
    assert layout.each_reads == ["height", "slope@0"]
    np.testing.assert_allclose(layout.positions, prediction.prospect.positions, atol=1e-9)

    window.requests.set("design_reads", ())
    until(lambda: bool(prediction.refusal))
    assert "at least one reading" in window.design.words.text()


@pytest.mark.full
def test_errors_of_place_and_force_on_a_cap_are_mapped_and_checked(window: MainWindow, until):
    design, prediction = window.design, window.prediction
    window.docks.reveal("design")
    window.requests.set("design_shape", "cap")
    window.requests.set("design_map", "contact")
    until(lambda: prediction.prospect is not None and prediction.prospect.of == "contact", 60)
    assert "on a disc of 1.7 mm radius" in design.words.text()
    assert (design.predicted.unit, design.along.y_axis.unit) == ("mm", "mm")

    window.requests.set("design_map", "force")
    until(lambda: prediction.prospect.of == "force" and not prediction.predicting, 60)
    assert (design.predicted.unit, design.along.y_axis.unit) == ("%", "%")
    assert "% at worst" in design.words.text()
    design.simulate.click()
    until(lambda: prediction.check is not None, 60)
    assert "times the prediction" in design.words.text()
    design.simulate.click()
    until(lambda: not prediction.checking)


@pytest.mark.full
def test_placing_takes_a_while_and_can_be_ended(window: MainWindow, until):
    prediction = window.prediction
    window.docks.reveal("design")

    window.requests.set("design_place", "A")
    until(lambda: prediction.predicting)
    prediction.predicts.cancel()
    assert not prediction.predicting
    assert "Cancelled" in prediction.refusal


def test_what_lies_beside_a_round_skin_has_the_colour_of_the_window(qtbot) -> None:
    view = SurfaceMap("Predicted", "mm", "tip")
    qtbot.addWidget(view)
    view.resize(200, 200)
    view.show()  # a hidden one follows a theme later
    values = np.ones((20, 20))
    values[-1, 0] = np.nan
    view.show_surface(values, (0.0, 2.0), "sequential", np.full(2, np.nan), (1.0, 1.0))

    apply_look(DARK)
    QApplication.processEvents()

    image = view.map.grab().toImage()
    corner = view.map.area().topLeft().toPoint() + QPoint(2, 2)
    assert image.pixelColor(corner) == QColor(DARK.window)
