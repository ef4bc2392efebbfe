"""What is predicted of a design is what simulating it gives, and what it must be."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Disk, Patch, Plate, PointLoad, Refusal, Scene, SensorLayout, predicted_sd
from kappaskin.bases import edges_of
from kappaskin.scenes.effects import GaussianNoise
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
