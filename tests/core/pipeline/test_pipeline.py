"""A frame of counts to an estimate of shape and contact."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from kappaskin import (
    Frame,
    Pipeline,
    PointLoad,
    RankDeficient,
    Refusal,
    Scene,
    Setup,
    Simulator,
    SineBasis,
    Transduction,
    load_scene,
)
from kappaskin.scenes.effects import Temperature
from kappaskin.sensing import Amplifier, Converter

SETUP = Setup(nx=33, ny=17, hold=0)
QUIET = replace(load_scene("off-centre"), effects=())
FINE = Transduction(converter=Converter(bits=24))


def frame_of(scene, n=0):
    return Simulator(scene).frame(n, lambda: 2.0)


@cache
def pipeline_of(scene, setup=SETUP, **kwargs):
    return Pipeline(scene.sensor(), setup, **kwargs)


def true_curvature(scene):
    operator = scene.layout.operator(scene.basis)
    return (operator @ scene.plate.deflection(scene.loads, scene.basis).ravel()).reshape(3, -1)


def only_these(frame, channels):
    """The frame when only `channels` were scanned."""
    return replace(frame, channels=channels, counts=frame.counts[channels])


def rows_of_ones(setup, basis):
    """Values of the functions on the setup's grid, (ny nx, N)."""
    x, y = basis.patch.grid(setup.nx, setup.ny)
    return basis.at(np.column_stack([np.tile(x, setup.ny), np.repeat(y, setup.nx)]))


@pytest.mark.parametrize("name", ["centre", "off-centre", "line", "circle"])
def test_the_errors_are_those_of_an_independent_calculation(name):
    scene = load_scene(name)
    frame = frame_of(scene, n=123)

    estimate = pipeline_of(scene)(frame)

    basis = SineBasis(scene.plate.patch, 8, 8)
    K = frame.counts * (2.5 / 2**15) / 0.065625
    c = np.linalg.lstsq(scene.layout.operator(basis), K)[0]
    w = rows_of_ones(SETUP, basis) @ c
    told = SineBasis(scene.plate.patch, *frame.truth.coefficients.shape)
    true_w = rows_of_ones(SETUP, told) @ frame.truth.coefficients.ravel()
    contact = frame.truth.contact[None]
    true_at_load = told.at(contact)[0] @ frame.truth.coefficients.ravel()
    at_load = basis.at(contact)[0] @ c - true_at_load
    assert estimate.error_rms == pytest.approx(np.sqrt(np.mean((w - true_w) ** 2)), rel=1e-9)
    assert estimate.error_at_load == pytest.approx(at_load, rel=1e-9)
    np.testing.assert_allclose(estimate.surface.ravel(), w, rtol=0, atol=1e-14)
    np.testing.assert_allclose(estimate.true_surface.ravel(), true_w, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(estimate.true_contact, frame.truth.contact)


def test_table_1s_error_shows_in_the_live_estimate():
    estimate = pipeline_of(replace(QUIET, transduction=FINE), Setup(nx=101, ny=101))(
        frame_of(replace(QUIET, transduction=FINE))
    )

    assert 1e3 * estimate.error_at_load == pytest.approx(-0.111, abs=5e-4)
    assert 1e3 * estimate.error_rms == pytest.approx(0.0100, abs=5e-5)


def test_curvature_is_the_true_one_within_half_a_count():
    estimate = pipeline_of(QUIET)(frame_of(QUIET))

    error = np.abs(estimate.curvature - true_curvature(QUIET))

    assert error.max() <= QUIET.transduction.resolution * (0.5 + 1e-6)


def test_the_residual_is_the_curvature_the_shape_does_not_explain():
    estimate = pipeline_of(QUIET)(frame_of(QUIET))

    M = QUIET.layout.operator(SineBasis(QUIET.plate.patch, 8, 8))
    expected = estimate.curvature - (M @ estimate.coefficients.ravel()).reshape(3, -1)
    np.testing.assert_allclose(estimate.residual, expected, atol=1e-12)
    assert estimate.noise == pytest.approx(np.sqrt(np.sum(expected**2) / (300 - 64)), rel=1e-9)


def test_the_contact_is_found_in_the_noise_of_table_1():
    estimate = pipeline_of(load_scene("centre"))(frame_of(load_scene("centre")))

    assert estimate.contact.present
    np.testing.assert_allclose(estimate.contact.position, [0.05, 0.05], atol=1e-3)
    assert estimate.contact.displacement == pytest.approx(4.65e-3, abs=0.15e-3)


def test_a_warm_side_does_not_show_in_the_surface():
    warmth = Temperature(rise=10.0, time_constant=0.1, offset=0.1, gradient_x=8.0)
    cold = load_scene("centre")
    warm = replace(cold, effects=(*cold.effects, warmth))

    before, after = (pipeline_of(scene)(frame_of(scene, n=900)) for scene in (cold, warm))

    assert after.drift == pytest.approx(1.0, rel=0.2)
    assert after.error_rms < 3 * before.error_rms
    assert np.abs(after.error_at_load) < 3 * after.contact.displacement_sd


def test_the_generation_times_and_number_are_carried():
    pipeline = pipeline_of(QUIET, generation=7, clock=lambda: 2.25)

    estimate = pipeline(frame_of(QUIET, n=50))

    assert (estimate.generation, estimate.sequence) == (7, 50)
    assert (estimate.device_time, estimate.host_time, estimate.ready_time) == (0.1, 2.0, 2.25)


def test_the_surface_has_a_row_for_every_y():
    assert pipeline_of(QUIET)(frame_of(QUIET)).surface.shape == (17, 33)


def test_readings_on_a_rail_are_left_out_and_the_shape_still_follows():
    # Full scale a third above the noise-free channels' root mean square clips the peak.
    peak = np.abs(true_curvature(QUIET)).max()
    gain = 2.5 / (Transduction().sensitivity / 100 * 0.7 * peak)
    scene = replace(QUIET, transduction=Transduction(amplifier=Amplifier(gain)))

    estimate = pipeline_of(scene)(frame_of(scene))

    railed = np.abs(true_curvature(QUIET)) > 0.7 * peak
    assert 0 < railed.sum() < 30
    np.testing.assert_array_equal(np.isnan(estimate.curvature), railed)
    np.testing.assert_array_equal(np.isnan(estimate.residual), railed)
    assert estimate.error_rms < 0.1e-3  # of 5.53 mm


def test_dead_elements_are_left_out_and_the_shape_still_follows():
    dead = [12, 13, 22, 23, 87]
    scene = replace(QUIET, layout=QUIET.layout.without(dead))

    estimate = pipeline_of(scene)(frame_of(scene))

    gone = np.isnan(estimate.curvature)
    assert gone[:, dead].all()
    assert gone.sum() == 15
    assert estimate.error_rms < 0.05e-3


def test_a_channel_that_died_later_spoils_nothing_once_the_layout_knows():
    scene = replace(QUIET, layout=QUIET.layout.without([12]))
    frame = frame_of(QUIET)
    frame.counts[[12, 112, 212]] = 20_000

    estimate = pipeline_of(scene)(frame)

    assert estimate.error_rms < 0.05e-3


def test_a_partial_frame_gives_the_shape_of_its_readings():
    scanned = np.random.default_rng(0).permutation(300)[:200]

    estimate = pipeline_of(QUIET)(only_these(frame_of(QUIET), scanned))

    there = np.isin(np.arange(300), scanned).reshape(3, 100)
    np.testing.assert_array_equal(np.isfinite(estimate.curvature), there)
    c = np.linalg.lstsq(
        QUIET.layout.operator(SineBasis(QUIET.plate.patch, 8, 8))[there.ravel()],
        estimate.curvature[there],
    )[0]
    np.testing.assert_allclose(estimate.coefficients.ravel(), c, rtol=0, atol=1e-9 * abs(c).max())


def test_a_partial_frame_answers_like_the_same_channels_in_another_order():
    frame, some = frame_of(QUIET), np.random.default_rng(0).permutation(300)[:200]

    mixed, sorted_ = (pipeline_of(QUIET)(only_these(frame, s)) for s in (some, np.sort(some)))

    np.testing.assert_array_equal(mixed.curvature, sorted_.curvature)
    np.testing.assert_array_equal(mixed.surface, sorted_.surface)


@pytest.mark.parametrize("count", [0, 1, 63])
def test_too_few_readings_give_no_shape_and_no_contact(count):
    estimate = pipeline_of(QUIET)(only_these(frame_of(QUIET), np.arange(count)))

    assert np.isnan(estimate.surface).all()
    assert np.isnan(estimate.coefficients).all()
    assert np.isnan([estimate.noise, estimate.error_rms, estimate.error_at_load]).all()
    assert not estimate.contact.present
    assert np.isfinite(estimate.curvature).sum() == count


def test_after_a_frame_with_too_few_readings_the_next_one_has_a_shape():
    pipeline = pipeline_of(QUIET)
    pipeline(only_these(frame_of(QUIET), np.arange(5)))

    assert pipeline(frame_of(QUIET)).error_rms < 0.05e-3


def test_every_channel_on_a_rail_gives_no_shape():
    frame = replace(frame_of(QUIET), counts=np.full(300, 2**15 - 1, np.int32))

    estimate = pipeline_of(QUIET)(frame)

    assert np.isnan(estimate.curvature).all()
    assert np.isnan(estimate.surface).all()


def test_the_truth_may_have_more_functions_from_one_frame_to_the_next():
    rougher = replace(QUIET, reference=(20, 18))
    pipeline = pipeline_of(QUIET)
    pipeline(frame_of(QUIET))

    estimate = pipeline(frame_of(rougher))

    expected = pipeline_of(rougher)(frame_of(rougher))
    np.testing.assert_array_equal(estimate.true_surface, expected.true_surface)
    assert estimate.error_at_load == expected.error_at_load


def test_without_a_truth_there_is_no_error():
    estimate = pipeline_of(QUIET)(replace(frame_of(QUIET), truth=None))

    assert np.isnan(estimate.true_surface).all()
    assert np.isnan([*estimate.true_contact, estimate.error_at_load, estimate.error_rms]).all()
    assert np.isfinite(estimate.surface).all()


def test_an_unloaded_skin_is_flat_and_untouched():
    scene = QUIET.touched_by()

    estimate = pipeline_of(scene)(frame_of(scene))

    assert not estimate.surface.any()
    assert not estimate.contact.present
    assert estimate.error_rms == 0
    assert math.isnan(estimate.error_at_load)


def test_the_noise_of_an_untouched_skin_is_no_contact():
    scene = load_scene("centre").touched_by()
    simulator, pipeline = Simulator(scene), pipeline_of(scene)

    touches = [pipeline(simulator.frame(n, lambda: 0.0)).contact for n in range(500)]

    assert not any(touch.present for touch in touches)


def test_more_functions_than_the_elements_determine_are_refused_at_once():
    with pytest.raises(RankDeficient, match="determine 140 of"):
        pipeline_of(QUIET, Setup(Ni=12, Nj=12))


def test_a_converter_with_an_offset_gives_the_same_shape():
    shifted = Transduction(converter=Converter(bits=24, offset=0.3))
    plain, offset = (replace(QUIET, transduction=t) for t in (FINE, shifted))

    expected = pipeline_of(plain)(frame_of(plain)).surface

    np.testing.assert_allclose(
        pipeline_of(offset)(frame_of(offset)).surface, expected, rtol=0, atol=1e-8
    )


def test_the_frame_is_left_as_it_came():
    frame = frame_of(QUIET)
    kept = frame.counts.copy()

    pipeline_of(QUIET)(frame)

    np.testing.assert_array_equal(frame.counts, kept)
    assert isinstance(frame, Frame)


def test_the_force_follows_the_rigidity_of_the_skin():
    plate = replace(QUIET.plate, rigidity=2 * QUIET.plate.rigidity)
    stiff = replace(QUIET, plate=plate).touched_by(QUIET.loads[0].scaled(2))

    soft_touch, stiff_touch = (pipeline_of(s)(frame_of(s)).contact for s in (QUIET, stiff))

    assert stiff_touch.force == pytest.approx(2 * soft_touch.force, rel=1e-6)
    assert isinstance(stiff, Scene)
    assert isinstance(stiff.loads[0], PointLoad)


def unknown(scene):
    return replace(scene, plate=replace(scene.plate, unknown_material=True))


def test_a_skin_of_unknown_material_has_all_of_a_contact_but_its_force():
    frame = frame_of(load_scene("off-centre"), n=3)
    known = pipeline_of(load_scene("off-centre"))(frame)

    found = pipeline_of(unknown(load_scene("off-centre")))(frame)

    assert found.contact.present
    assert np.isnan([found.contact.force, found.contact.force_sd]).all()
    np.testing.assert_array_equal(found.contact.position, known.contact.position)
    assert found.contact.displacement == known.contact.displacement
    np.testing.assert_array_equal(found.geometry.curvature_form, known.geometry.curvature_form)
    assert (found.geometry.principal_sd > known.geometry.principal_sd).all()


def test_no_contact_is_found_on_a_skin_of_unknown_material_at_rest():
    scene = unknown(replace(load_scene("off-centre").touched_by(), effects=()))

    assert not pipeline_of(scene)(frame_of(scene)).contact.present


# Only what a setup names


def test_what_a_setup_leaves_out_is_unknown_and_the_rest_is_the_same() -> None:
    scene = load_scene("circle")
    frame, whole = frame_of(scene, n=123), pipeline_of(scene)(frame_of(scene, n=123))
    shape = Pipeline(scene.sensor(), replace(SETUP, quantities=()))(frame)
    contact = Pipeline(scene.sensor(), replace(SETUP, quantities=("contact",)))(frame)
    surface = Pipeline(scene.sensor(), replace(SETUP, quantities=("surface",)))(frame)

    assert whole.contact.present
    assert np.isfinite(whole.geometry.frame).all()
    for part in (shape, contact, surface):
        assert np.array_equal(part.coefficients, whole.coefficients)
        assert np.isnan(part.geometry.frame).all()
    assert not shape.contact.present
    assert not surface.contact.present
    assert contact.contact.force == whole.contact.force
    assert np.isnan(shape.surface).all()
    assert np.isnan(contact.surface).all()
    assert math.isnan(contact.error_rms)
    assert np.array_equal(surface.surface, whole.surface)


@pytest.mark.parametrize("quantities", [("force",), ("geometry",), ("surface", "geometry")])
def test_quantities_that_cannot_be_computed_are_refused(quantities) -> None:
    with pytest.raises(Refusal, match="expected quantities among surface, contact, geometry, and"):
        Pipeline(QUIET.sensor(), replace(SETUP, quantities=quantities))
