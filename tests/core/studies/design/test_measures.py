"""What is measured of a block, against what must come of it."""

import numpy as np
import pytest

from kappaskin import Refusal
from kappaskin.estimation import METHODS
from kappaskin.skin import Cap
from kappaskin.studies.design.measures import _distance
from kappaskin.studies.design.results import BlockTask, run_task, version

POINT = 'what = "point"\nx = 0.05\ny = 0.03\nforce = 0.1'
SPHERE = 'what = "sphere"\nradius = 0.02\nx = 0.05\ny = 0.05\nforce = 0.6'
EXACT = "rate = 10.0", "rate = 10.0\nreference = [4, 4]"  # the fit can make all of the truth
QUIET = "rms = 0.2", "rms = 0.0"


def measured(study, block=0):
    return run_task(BlockTask(next(study.points()).document, block, version()))


def measuring(*names, frames=5):
    told = ", ".join(f'"{name}"' for name in names)
    return '["rms"]\nframes = 5', f"[{told}]\nframes = {frames}"


def test_without_noise_and_with_all_functions_nothing_is_off(study_of):
    found = measured(study_of("", EXACT, QUIET, measuring("rms", "at-load", "predicted")))

    # What is left are the steps of the converter.
    assert found["rms"].mean < 2e-8
    assert abs(found["at-load"].mean) < 5e-8
    assert found["predicted"].mean == 0.0


def test_what_is_predicted_is_what_noise_does(study_of):
    found = measured(study_of("", EXACT, measuring("rms", "predicted", frames=2000)))

    rms = found["rms"]
    root_mean_square = np.sqrt(rms.mean**2 + rms.squares / rms.count)
    np.testing.assert_allclose(found["predicted"].mean, root_mean_square, rtol=0.03)
    assert found["predicted"].count == 1


def test_bands_hold_as_much_of_the_skin_as_they_promise(study_of):
    found = measured(study_of("", EXACT, measuring("covered", frames=1000)))

    assert abs(found["covered"].mean - 0.95) < 0.01


def test_the_contact_is_found_where_it_is_and_as_hard(study_of):
    names = "contact", "force", "found", "rate"
    found = measured(study_of("", QUIET, measuring(*names)))

    assert found["found"].mean == 1.0
    assert found["contact"].mean < 2e-4
    assert found["force"].mean < 0.01
    np.testing.assert_allclose(found["rate"].mean, 1 / (108 * 5e-6))


def path_of(seconds):
    """In and out, so many seconds each."""
    steps = (
        f'[[touch.path]]\nstep = "{step}"\nseconds = {seconds}' for step in ("press", "release")
    )
    return "\n".join(["", *steps])


def test_frames_in_which_nothing_presses_tell_no_contact(study_of):
    found = measured(
        study_of("", (POINT, POINT + path_of(0.2)), QUIET, measuring("found", "at-load", frames=4))
    )

    assert found["found"].mean == 0.75
    assert found["at-load"].count == 3


def test_loads_that_cancel_have_no_share_of_a_force(study_of):
    pushed = POINT.replace("0.05", "0.02").replace("0.1", "-0.1")

    found = measured(study_of("", (POINT, f"{POINT}\n[[touch]]\n{pushed}"), measuring("force")))

    assert found["force"].count == 0


def test_bands_hold_all_of_a_shape_that_is_exact(study_of):
    resting = POINT, POINT.replace("force = 0.1", "force = 0.0")

    assert measured(study_of("", resting, QUIET, measuring("covered")))["covered"].mean == 1.0


def test_without_spare_readings_there_are_no_bands(study_of):
    strip = "size = [0.1, 0.1]", 'shape = "strip"\nsize = [0.1, 0.1]'
    six = ("[6, 6]", "[6, 1]"), ("functions = [4, 4]", "functions = [6, 1]")

    assert measured(study_of("", strip, *six, measuring("covered")))["covered"].count == 0


def test_noise_that_is_left_out_is_not_predicted(study_of):
    off = 'choose = "linear"', 'choose = "linear"\noff = ["uniform-noise"]'

    assert measured(study_of("", off, measuring("predicted")))["predicted"].mean == 0.0


@pytest.mark.parametrize("method", ["bayes", "tracking"])
def test_of_a_prior_nothing_is_predicted(study_of, method):
    found = measured(study_of("", ("[fit]", f'[fit]\nmethod = "{method}"'), measuring("predicted")))

    assert found["predicted"].count == 0


def test_a_fit_takes_time(study_of):
    assert 1e-6 < measured(study_of("", measuring("time")))["time"].mean < 1.0


def test_the_radius_of_a_ball_is_told(study_of):
    grid = "grid = [6, 6]", "grid = [12, 12]"
    found = measured(
        study_of("", (POINT, SPHERE), grid, QUIET, measuring("radius", "force", frames=1))
    )

    assert found["radius"].mean < 0.3
    assert found["force"].mean < 0.1


def test_a_point_has_no_radius(study_of):
    with pytest.raises(Refusal, match="expected a sphere or a cylinder"):
        measured(study_of("", measuring("radius")))


LOOPS = """
[effects.hysteresis]
thresholds = [0.5, 1.0, 2.0]
weights = [0.1, 0.1, 0.1]
asymmetry = 1.5

[[touch]]"""


def test_loops_that_are_undone_cost_nothing(study_of):
    path = POINT + path_of(1.0)

    def rms(*changes):
        choice = 'choose = "linear"', 'choose = "all"\noff = ["finite-slope", "quantisation"]'
        study = study_of("", (POINT, path), choice, QUIET, measuring("rms", frames=20), *changes)
        return measured(study)["rms"].mean

    hysteresis, undone = ("[[touch]]", LOOPS), ("[fit]", "[fit]\ncompensate = true")

    np.testing.assert_allclose(rms(hysteresis, undone), rms(), rtol=1e-9)
    assert rms(hysteresis) > 2 * rms()
    with pytest.raises(Refusal, match="expected a scene with hysteresis to compensate"):
        rms(undone)


def test_a_method_that_remembers_begins_every_block_anew(study_of):
    study = study_of("", ("[fit]", '[fit]\nmethod = "tracking"'))

    first = measured(study)
    measured(study, block=1)

    assert measured(study) == first


@pytest.mark.parametrize("method", METHODS)
def test_nothing_changes_by_what_is_measured_before(study_of, method):
    def rms(*before):
        names = measuring(*before, "rms")
        return measured(study_of("", ("[fit]", f'[fit]\nmethod = "{method}"'), names))["rms"]

    assert rms("contact", "time") == rms("time") == rms()


def test_errors_of_contact_and_force_are_what_is_predicted_of_noise(study_of):
    disc = 'what = "disc"\nx = 0.06\ny = 0.035\nradius = 0.006\nforce = 0.5'
    names = "contact", "force", "predicted-contact", "predicted-force"
    of_disc = 'what = "point"\nx = 0.05\ny = 0.03\nforce = 0.1', disc
    fine = "rate = 10.0", "rate = 10.0\nreference = [24, 24]"

    found = measured(study_of("", fine, of_disc, measuring(*names, frames=400)))

    for name in ("contact", "force"):
        assert found[name].mean == pytest.approx(found[f"predicted-{name}"].mean, rel=0.15)
        assert found[f"predicted-{name}"].count == 1


def test_errors_of_the_contact_are_measured_along_a_cap():
    cap, pole = Cap(8e-3), 8e-3 * np.pi / 2
    at_equator = np.array([[pole + 0.99 * pole, pole]])
    turned = pole + 0.99 * pole * np.array([[np.cos(0.1), np.sin(0.1)]])

    # A tenth of a radian around, where the radius is nearly that of the sphere.
    assert _distance(cap, turned, at_equator)[0] == pytest.approx(0.1 * 8e-3, rel=2e-3)
    assert np.isnan(_distance(cap, np.full((1, 2), np.nan), at_equator)).all()
