from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import (
    DiscLoad,
    GaussianLoad,
    LineLoad,
    Plate,
    PointLoad,
    RectangleLoad,
    Refusal,
    Simulator,
    load_scene,
)
from kappaskin.bases import edges_of
from kappaskin.scenes import scene_file
from kappaskin_app.shell.loads import dragged
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import LOAD_CASES, SHAPES, SPREAD_CASES
from kappaskin_app.shell.simulation import (
    is_table_1,
    patch_of,
    plate_of,
    scene_of,
    with_consequences,
    written,
)

CASES = [case for case, _ in LOAD_CASES]
READY = ["circle", "centre", "off-centre", "line"]


def on(shape: str, **more: object) -> Settings:
    return replace(Settings(), **with_consequences(Settings(), load_scene(), "shape", shape) | more)


@pytest.mark.parametrize("case", READY)
def test_a_ready_case_on_the_first_skin_is_the_ready_scene_in_everything(case: str) -> None:
    scene, ready = scene_of(Settings(load_case=case)), load_scene(case)
    for field in fields(scene):
        if field.name not in ("layout", "effects", "title", "text"):
            assert getattr(scene, field.name) == getattr(ready, field.name), field.name
    assert scene.layout.shape == ready.layout.shape
    np.testing.assert_array_equal(scene.layout.positions, ready.layout.positions)
    assert scene.effects[0].rms == pytest.approx(ready.effects[0].rms, abs=5e-4)


def test_free_cases_press_where_they_are_told() -> None:
    settings = Settings(x=0.02, y=0.03, x_end=0.08, y_end=0.07, force=0.2)
    loads = {case: scene_of(replace(settings, load_case=case)).loads for case in CASES}
    assert loads["point"] == (PointLoad(0.02, 0.03, 0.2),)
    assert loads["two-points"] == (PointLoad(0.02, 0.03, 0.1), PointLoad(0.08, 0.07, 0.1))
    assert loads["free-line"] == (LineLoad(0.02, 0.03, 0.08, 0.07, 0.2),)
    assert loads["disc"] == (DiscLoad(0.02, 0.03, 0.005, 0.2),)
    assert loads["gaussian"] == (GaussianLoad(0.02, 0.03, 0.005, 0.2),)
    assert loads["rectangle"] == (RectangleLoad(0.02, 0.03, 0.005, 0.02, 0.2),)


def test_no_noise_means_no_effect() -> None:
    assert scene_of(Settings(noise_kind="none")).effects == ()
    assert scene_of(Settings(noise_rms=0.0)).effects == ()


def test_what_is_below_and_how_it_is_held_is_in_the_scene() -> None:
    scene = scene_of(Settings(tension=5.0, foam=2e4, fluid=True, edge="sliding"))
    plate = scene.plate
    assert (plate.tension, plate.foundation, plate.fluid) == (5.0, 2e4, True)
    assert (scene.edge, scene.sensor().edge) == ("sliding", "sliding")


def test_the_skin_stretches_as_the_panel_says() -> None:
    plate = scene_of(Settings(thickness=3e-4, poisson=0.4, inplane="free")).plate
    assert (plate.thickness, plate.poisson, plate.inplane) == (3e-4, 0.4, "free")
    assert scene_of(Settings()).plate.thickness is None
    scene = scene_of(Settings(inplane="free"))
    assert with_consequences(Settings(inplane="free"), scene, "shape", "strip")["inplane"] == ""


def test_a_bent_skin_is_an_even_sheet_as_thick_as_its_gages() -> None:
    plate = scene_of(on("cylinder")).plate
    sheet = Plate.of_material(plate.patch, plate.modulus(250e-6), plate.poisson, 250e-6)
    assert plate.membrane_stiffness == pytest.approx(sheet.membrane_stiffness)


def test_the_fingertip_is_half_a_circle_of_the_papers_radius() -> None:
    patch = scene_of(on("cylinder")).plate.patch
    assert (patch.radius, patch.b) == (0.0129, 0.04)
    assert patch.opening == pytest.approx(np.pi)


@pytest.mark.cases("circle-flat-hinged", "off-centre-cylinder", "line-flat-sliding-fluid")
@pytest.mark.parametrize("fluid", [False, True], ids=["empty", "fluid"])
@pytest.mark.parametrize("edge", ["hinged", "sliding"])
@pytest.mark.parametrize("shape", ["flat", "cylinder"])
@pytest.mark.parametrize("case", READY)
def test_no_ready_case_drives_an_element_onto_a_rail_on_any_skin(
    case: str, shape: str, edge: str, fluid: bool
) -> None:
    scene = scene_of(on(shape, edge=edge, fluid=fluid, load_case=case))
    simulator, bent = Simulator(scene), []
    for n in range(0, 2000, 100):
        counts = simulator.frame(n, lambda: 0.0).counts
        bent.append(np.abs(scene.transduction.curvature(counts)))
    assert np.isfinite(bent).all()
    assert np.max(bent) > 3  # and every one stands out of the noise of Table 1


@pytest.mark.cases("hexagon")
@pytest.mark.parametrize("shape", ["disk", "hexagon"])
def test_every_ready_case_presses_a_tile_of_another_outline(shape: str) -> None:
    for case in READY:
        scene = scene_of(on(shape, load_case=case))
        for time in (0.0, 1.0, 2.0, 3.0):
            for load in scene.loads_at(time):
                load.check(scene.plate.patch)
    simulator = Simulator(scene)
    counts = simulator.frame(0, lambda: 0.0).counts
    assert 3 < np.abs(scene.transduction.curvature(counts)).max() < 38
    assert scene.sensor().rate == SHAPES[shape].rate


def test_a_tile_is_as_large_as_the_rectangle_around_it() -> None:
    for shape in ("disk", "hexagon"):
        settings = on(shape)
        settings = replace(
            settings, **with_consequences(settings, load_scene(), "rim_radius", 0.02)
        )
        patch = plate_of(settings).patch
        assert (patch.a, patch.b) == (settings.side_x, settings.side_y)
        assert patch.a == pytest.approx(0.04)
        assert settings.x == pytest.approx(patch.a / 2)  # where it was, as a share


@pytest.mark.parametrize("side", [0.02, 0.1, 1.0])
@pytest.mark.parametrize("case", READY)
def test_the_slopes_of_a_ready_case_do_not_grow_with_the_skin(case: str, side: float) -> None:
    scene, paper = scene_of(Settings(load_case=case, side_x=side, side_y=side)), load_scene(case)

    def moved(scene) -> float:
        c = scene.plate.deflection(scene.loads, scene.basis)
        return float(scene.basis.at(scene.loads[0].centre()[None])[0] @ c.ravel())

    assert 0 < moved(scene) / side <= moved(paper) / 0.1 * (1 + 1e-9)
    shares = scene.loads[0].centre() / side
    np.testing.assert_allclose(shares, paper.loads[0].centre() / 0.1)


def test_more_elements_than_can_be_scanned_in_time_are_scanned_slower() -> None:
    assert scene_of(Settings()).rate == 500
    scene = scene_of(Settings(elements_x=32, elements_y=32))
    assert scene.sensor().rate == 65


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"shape": "cylinder", "base_radius": 0.005}, "larger base radius"),
        ({"edge": "glued"}, "expected an edge"),
        ({"side_y": 0.0}, "two sides above zero"),
        ({"load_case": "point", "x": 0.2}, "got one that extends over the rim"),
    ],
)
def test_a_skin_that_cannot_be_is_refused(changed: dict[str, object], why: str) -> None:
    with pytest.raises(Refusal, match=why):
        scene_of(replace(Settings(), **changed))


def test_only_the_first_skin_is_table_1s() -> None:
    assert is_table_1(Settings())
    assert not is_table_1(Settings(side_y=0.08))
    assert not is_table_1(Settings(foam=1.0))
    assert not is_table_1(on("cylinder"))


def test_choosing_a_shape_brings_its_size_and_choosing_the_first_again_all_of_it() -> None:
    settings, first = Settings(), Settings()
    for shape in ("cylinder", "flat"):
        settings = replace(settings, **with_consequences(settings, load_scene(), "shape", shape))
        for name, value in {**SHAPES[shape].lengths, **SHAPES[shape].defaults}.items():
            assert getattr(settings, name) == value
    assert (settings.force, settings.exaggeration) == (first.force, first.exaggeration)
    assert scene_of(settings).plate == load_scene().plate


def test_loads_keep_their_share_of_a_skin_that_grows() -> None:
    settings = Settings(x=0.02, x_end=0.08, y=0.03)
    changed = with_consequences(settings, load_scene(), "side_x", 0.2)
    places = {"x": pytest.approx(0.04), "x_end": pytest.approx(0.16), "size": pytest.approx(0.01)}
    assert changed == {"side_x": 0.2, **places}
    alone = with_consequences(settings, load_scene(), "theme", "light")
    assert alone == {"theme": "light"}


def test_a_free_load_presses_as_the_one_did_that_it_follows() -> None:
    for shape in ("flat", "cylinder", "disk"):
        settings = on(shape, load_case="off-centre")
        was = scene_of(settings)
        settings = replace(settings, **with_consequences(settings, was, "load_case", "point"))
        assert scene_of(settings).loads[0].force == was.loads[0].force
        other = with_consequences(settings, scene_of(settings), "load_case", "free-line")
        assert other == {"load_case": "free-line"}


def test_a_free_load_presses_every_shape_so_that_it_shows() -> None:
    for shape in SHAPES:
        scene = scene_of(on(shape, load_case="point"))
        counts = Simulator(scene).frame(0, lambda: 0.0).counts
        assert 3 < np.abs(scene.transduction.curvature(counts)).max() < 38


@pytest.mark.full
@given(
    st.sampled_from([case for case in CASES if case not in SPREAD_CASES]),
    st.sampled_from(list(SHAPES)),
    st.tuples(*[st.floats(-1, 1)] * 2),
    st.tuples(*[st.floats(0.016, 0.028)] * 4),
    st.booleans(),
)
def test_a_dragged_load_stays_on_the_skin(
    case: str, shape: str, to: tuple[float, float], ends: tuple[float, ...], end: bool
) -> None:
    x, y, x_end, y_end = (end * (0.5 if shape == "cap" else 1.0) for end in ends)
    settings = on(shape, load_case=case, x=x, y=y, x_end=x_end, y_end=y_end)
    scene = scene_of(settings)
    scene = scene_of(replace(settings, **dragged(settings, scene, *to, end)))
    for load in scene.loads:
        load.check(scene.plate.patch)


@pytest.mark.parametrize("case", ["circle", "off-centre", "point"])
def test_a_dragged_point_is_where_it_was_dragged_to_and_as_strong_as_it_was(case: str) -> None:
    settings = Settings(load_case=case)
    was = scene_of(settings)
    (load,) = scene_of(replace(settings, **dragged(settings, was, 0.031, 0.062, False))).loads
    assert np.allclose(load.centre(), [0.031, 0.062])
    assert load.force == was.loads[0].force


def test_a_dragged_line_keeps_its_length() -> None:
    settings = on("cylinder", load_case="line")
    was = scene_of(settings)
    (load,) = scene_of(replace(settings, **dragged(settings, was, 0.02, 0.02, False))).loads
    assert isinstance(load, LineLoad)
    ends = np.array([load.x1 - load.x0, load.y1 - load.y0])
    old = was.loads[0]
    np.testing.assert_allclose(ends, [old.x1 - old.x0, old.y1 - old.y0])


@pytest.mark.cases("rectangle")
@pytest.mark.parametrize("case", SPREAD_CASES)
@given(
    st.sampled_from(list(SHAPES)),
    st.tuples(*[st.floats(-0.1, 0.2)] * 2),
    st.sampled_from([0.001, 0.004, 0.009]),
)
def test_a_spread_load_dragged_anywhere_stays_whole_on_the_skin_and_as_large_as_it_was(
    case: str, shape: str, to: tuple[float, float], size: float
) -> None:
    settings = on(shape, load_case=case)
    size *= settings.side_y / 0.1
    settings = replace(settings, size=size, size_y=3 * size)
    scene = scene_of(settings)
    changed = dragged(settings, scene, *to, False)
    (load,) = scene_of(replace(settings, **changed)).loads
    load.check(scene.plate.patch)
    assert changed.keys() == {"x", "y"}


@pytest.mark.parametrize("case", SPREAD_CASES)
def test_a_spread_load_is_where_it_was_dragged_to_inside_and_at_the_rim_outside(case: str) -> None:
    settings = Settings(load_case=case)
    was = scene_of(settings)
    assert dragged(settings, was, 0.031, 0.062, False) == pytest.approx({"x": 0.031, "y": 0.062})
    aside = dragged(settings, was, -1.0, 0.062, False)
    half = {"disc": 0.005, "rectangle": 0.003, "gaussian": 0.02}[case]  # or the margin of a drag
    assert aside == pytest.approx({"x": half, "y": 0.062})


def test_a_load_that_grows_over_the_rim_moves_inwards() -> None:
    settings = Settings(load_case="point", x=0.01, y=0.05)
    changed = with_consequences(settings, scene_of(settings), "load_case", "gaussian")
    assert (changed["x"], changed["y"]) == pytest.approx((0.02, 0.05))
    settings = replace(settings, **changed)
    wider = with_consequences(settings, scene_of(settings), "size", 0.01)
    assert (wider["x"], wider["y"]) == pytest.approx((0.04, 0.05))
    with pytest.raises(Refusal, match="make it smaller"):
        scene_of(replace(settings, size=0.02))


@pytest.mark.parametrize("case", ["point", "two-points", "free-line", *SPREAD_CASES])
def test_a_free_load_in_a_corner_stays_on_a_skin_that_has_none(case: str) -> None:
    settings = Settings(load_case=case, x=0.004, y=0.004, x_end=0.099, y_end=0.001, size=0.001)
    for shape in ("disk", "hexagon", "cylinder"):
        changed = with_consequences(settings, load_scene(), "shape", shape)
        scene = scene_of(replace(settings, **changed))
        for load in scene.loads:
            load.check(scene.plate.patch)


def test_a_small_spread_load_presses_as_a_point_does() -> None:
    settings = Settings(load_case="point", x=0.03, y=0.06)
    point = scene_of(settings)
    c = point.plate.deflection(point.loads, point.basis)
    for case in SPREAD_CASES:
        spread = scene_of(replace(settings, load_case=case, size=5e-4, size_y=5e-4))
        d = spread.plate.deflection(spread.loads, spread.basis)
        np.testing.assert_allclose(d, c, atol=2e-3 * np.abs(c).max())
        wide = scene_of(replace(settings, load_case=case))
        d = wide.plate.deflection(wide.loads, wide.basis)
        assert np.abs(d - c).max() > 2e-3 * np.abs(c).max()


def test_every_edge_can_be_simulated_on_the_first_skin() -> None:
    for edge in edges_of(patch_of(Settings())):
        assert scene_of(Settings(edge=edge)).edge == edge


def test_a_file_is_opened_in_the_app_as_the_library_reads_it(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_bytes(b"\xef\xbb\xbf" + scene_file("centre").read_bytes())  # as some editors save it
    scene = scene_of(Settings(written=written(file)))
    assert scene.stimuli == load_scene(str(file)).stimuli
    with pytest.raises(Refusal, match=r"cannot be read as a scene \(.*Is a directory"):
        written(tmp_path)
    with pytest.raises(Refusal, match="cannot be read as a scene"):
        written(tmp_path / "none.toml")
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(Refusal, match="cannot be read as a scene"):
        written(file)
