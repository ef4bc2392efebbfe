"""What is predicted of a design is what simulating it gives, and what it must be."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import (
    Disk,
    LineLoad,
    Patch,
    Plate,
    PointLoad,
    Refusal,
    Scene,
    SensorLayout,
    predicted_sd,
)
from kappaskin.bases import edges_of
from kappaskin.mechanics import DiscLoad
from kappaskin.scenes.effects import GaussianNoise
from kappaskin.skin import Cap
from kappaskin.studies import Design, check, prospect

FLAT, DISK = Patch(0.1, 0.1), Disk(0.05)


def designed(patch: Patch = FLAT, noise: float = 0.3, m: int = 8, by: str = "scene") -> Design:
    scene = Scene(
        "design",
        Plate(patch),
        SensorLayout.regular(patch, m, m),
        effects=(GaussianNoise(noise),),
        edge=edges_of(patch)[0],
    )
    scene = scene.touched_by(PointLoad(patch.a / 2, patch.b / 2, 0.1))
    return Design(scene, (5, 5), by)


@pytest.mark.parametrize("patch", [FLAT, DISK, Patch(0.04, 0.04, 0.0129)], ids=str)
@pytest.mark.parametrize("by", ["scene", "clustered"])
def test_a_simulation_varies_by_as_much_as_is_predicted(patch, by):
    design = designed(patch, by=by)
    told, *_, last = prospect(design), *check(design, 2000)

    seen = told.sd > 0.2 * told.worst
    # Of 2000 frames a standard deviation is known to 1.6 %.
    np.testing.assert_allclose(last.sd[seen] / told.sd[seen], 1, atol=0.08)
    assert last.rms_sd == pytest.approx(told.rms, rel=0.03)
    assert last.frames == 2000


def test_the_error_bar_is_proportional_to_noise_and_to_one_over_the_root_of_elements():
    once = prospect(designed())

    assert prospect(designed(noise=0.6)).rms == pytest.approx(2 * once.rms)
    assert prospect(designed(m=16)).rms == pytest.approx(once.rms / 2, rel=0.02)


@pytest.mark.parametrize(("patch", "off"), [(FLAT, 1e-9), (DISK, 2e-3)], ids=str)
def test_the_rms_is_that_over_the_area(patch, off):
    design = designed(patch)
    estimator = design.estimator()
    points, weights = estimator.basis.quadrature()

    variance = predicted_sd(estimator, 0.3, points) ** 2

    assert prospect(design).rms == pytest.approx(
        math.sqrt(np.average(variance, weights=weights)), off
    )


@pytest.mark.parametrize("patch", [FLAT, Patch(0.03, 0.02, 0.0129, strip=True)], ids=str)
def test_the_rate_is_that_of_a_scan_by_the_sensor(patch):
    design = designed(patch)

    assert prospect(design).rate == pytest.approx(design.scene.sensor().scan().rate)


def test_the_rate_is_what_three_conversions_of_each_element_leave():
    design = designed()

    scan = design.scene.transduction.scan_time(3 * 64)

    assert prospect(design).rate == pytest.approx(1 / scan)


def test_off_the_skin_nothing_is_told():
    told = prospect(designed(DISK))
    x, y = np.meshgrid(told.x, told.y)

    off = np.hypot(x - 0.05, y - 0.05) > 0.05 * (1 + 1e-9)

    assert np.array_equal(np.isnan(told.sd), off)


def test_the_rms_of_a_check_holds_what_the_functions_cannot_make_too():
    quiet = designed(noise=1e-6)

    *_, last = check(quiet, 500)

    assert last.rms > 100 * prospect(quiet).rms


def test_blocks_add_up_to_what_all_frames_give_at_once():
    design = designed()
    each = list(check(design, 600))

    assert [one.frames for one in each] == [250, 500, 600]
    # Chan's sums against the plain ones, from the same noise.
    *_, again = check(design, 600)
    np.testing.assert_array_equal(each[-1].sd, again.sd)
    assert not math.isclose(each[0].sd[20, 20], each[-1].sd[20, 20], rel_tol=1e-9)


def test_placed_elements_are_as_many_and_tell_more_of_what_they_are_placed_for():
    told = {by: prospect(designed(m=6, by=by)) for by in ("scene", "A")}

    assert len(told["A"].positions) == 36
    assert told["A"].rms < told["scene"].rms


@pytest.mark.parametrize(
    ("change", "words"),
    [({"by": "best"}, "among"), ({"functions": (9, 9)}, "80 of the 81")],
)
def test_a_design_that_cannot_be_is_refused(change, words):
    with pytest.raises(Refusal, match=words):
        prospect(replace(designed(), **change))


CAP = Cap(8e-3, math.radians(75))


def pressed_cap(by: str = "scene", noise: float = 0.06, patch: Patch = CAP) -> Design:
    """60 elements on a cap, or 7 x 7 on another skin, under a disc of 1.5 mm."""
    round_ = isinstance(patch, Cap)
    layout = SensorLayout.in_spiral(patch, 60) if round_ else SensorLayout.regular(patch, 7, 7)
    load = DiscLoad(patch.a / 2, patch.b / 2, 1.5e-3, 0.1)
    plate = Plate(patch, rigidity=1e-3, thickness=1e-3)
    edge = edges_of(patch)[0] if not round_ else "clamped"
    scene = Scene("design", plate, layout, effects=(GaussianNoise(noise),), edge=edge)
    scene = replace(scene, reference=(14, 29) if round_ else (24, 24)).touched_by(load)
    return Design(scene, (5, 5), by)


def test_the_rms_is_that_over_the_true_area_of_a_cap():
    design = pressed_cap()
    estimator = design.estimator()
    points, weights = estimator.basis.quadrature()

    variance = predicted_sd(estimator, 0.06, points) ** 2

    assert prospect(design).rms == pytest.approx(
        math.sqrt(np.average(variance, weights=weights)), 2e-3
    )


DOME = Patch(0.03, 0.03, (0.08, 0.08))


@pytest.mark.parametrize(
    "patch", [DOME, pytest.param(CAP, marks=pytest.mark.full)], ids=["dome", "cap"]
)
@pytest.mark.parametrize("of", ["contact", "force"])
def test_presses_all_over_a_skin_err_by_about_what_is_predicted(patch, of):
    design = pressed_cap(patch=patch)
    predicted, found = prospect(design, of), next(check(design, 250, of))

    pressed = np.isfinite(found.sd)
    shares = found.sd[pressed] / predicted.sd[pressed]

    assert found.frames == np.count_nonzero(pressed) == 250
    # Of 250 normal errors the RMS is known to 6 %; a size that hardly shows takes the error of the
    # force below the prediction.
    assert 0.75 < np.sqrt(np.mean(shares**2)) < 1.2


def test_errors_of_contact_and_force_are_proportional_to_noise_over_force():
    once, twice, harder = (pressed_cap(patch=DOME, noise=noise) for noise in (50, 100, 100))
    load = harder.scene.loads[0].scaled(2)
    harder = replace(harder, scene=harder.scene.touched_by(load))

    for of in ("contact", "force"):
        error = prospect(once, of).median
        assert prospect(twice, of).median == pytest.approx(2 * error, 1e-3)
        assert prospect(harder, of).median == pytest.approx(error, 1e-3)


def test_half_of_the_skin_errs_by_less_than_the_median():
    found = prospect(pressed_cap(patch=DOME), "contact")

    less = found.sd < found.median
    known = np.isfinite(found.sd)
    assert found.shares[less].sum() == pytest.approx(found.shares[known].sum() / 2, rel=1e-2)
    assert found.median < found.rms < found.worst


def test_errors_of_contacts_are_predicted_of_a_point_or_a_disc_alone():
    design = pressed_cap()
    line = LineLoad(0.004, 0.004, 0.006, 0.006, 0.1)
    other = replace(design, scene=design.scene.touched_by(line))

    with pytest.raises(Refusal, match="one point or disc"):
        prospect(other, "contact")
    with pytest.raises(Refusal, match="displacement, contact, force"):
        prospect(design, "slip")


@pytest.mark.parametrize("by", ["D", "A"])
def test_elements_placed_on_a_cap_stand_apart_on_the_skin(by):
    design = pressed_cap(by)
    layout = design.estimator().layout
    places = layout.patch.at_rest(layout.positions)[0]

    away = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(60, 1)]
    mean = math.sqrt(2 * math.pi * 8e-3**2 * (1 - math.cos(math.radians(75))) / 60)
    assert len(places) == 60
    assert away.min() > 0.4 * mean * (1 - 1e-6)
    assert prospect(design).rms < 0.6 * prospect(pressed_cap()).rms


def test_presses_with_few_functions_err_as_predicted_for_the_check_sums_more():
    flat = designed(m=10)
    predicted, found = prospect(flat, "contact"), next(check(flat, 250, "contact"))

    assert flat.scene.reference == (15, 15)
    assert found.over(predicted) == pytest.approx(1, abs=0.15)


def test_a_place_on_a_strip_is_judged_along_it_alone():
    made = designed(Patch(0.1, 0.02, strip=True), m=10)
    strip = replace(made, scene=replace(made.scene, reference=(15, 1)), functions=(5, 1))

    assert next(check(strip, 250, "contact")).rms < 1e-3
