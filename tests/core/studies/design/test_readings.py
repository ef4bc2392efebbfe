"""Design studies and predictions of sensors that read heights and slopes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Patch, Plate, PointLoad, Refusal, Scene, SensorLayout
from kappaskin.scenes.effects import FlickerNoise
from kappaskin.sensing import DigitalReadings
from kappaskin.studies import Design, check, prospect
from kappaskin.studies.design.results import BlockTask, run_task, version

SIDE, HEIGHT, SLOPE = 0.1, 5e-6, 5e-4  # m, and m and rad of noise
K = np.pi * np.arange(1, 5) / SIDE
READS = {
    "height": ["height"],
    "slopes": ["slope@0", "slope@90"],
    "mixed": ["height", "slope@0", "slope@90"],
}
OF_EACH = pytest.mark.parametrize("read", READS)


def rms_by_hand(read: str, m: int) -> float:
    """RMS over the skin of 4 x 4 sines, due to the noise of m x m elements at tile centres."""
    # Sines and their slopes are orthogonal there, with a mean square of 1/4, each times k.
    of_height = 1 / HEIGHT**2 if read != "slopes" else 0.0
    of_slopes = np.add.outer(K**2, K**2) / SLOPE**2 if read != "height" else 0.0
    variance = np.broadcast_to(4 / m**2 / (of_height + of_slopes), (4, 4))
    return math.sqrt(variance.sum() / 4)


def designed(read: str, m: int = 8, by: str = "scene", effects=()) -> Design:
    patch = Patch(SIDE, SIDE)
    layout = SensorLayout.regular(patch, m, m).reading_each(READS[read])
    noise = {"height": HEIGHT, "slope": SLOPE}
    noise = {name: noise[name] for name in dict.fromkeys(name for name, _ in layout.kinds)}
    electronics = DigitalReadings(1e-9, tuple(noise.items()))
    scene = Scene("design", Plate(patch), layout, effects=effects, transduction=electronics)
    return Design(scene.touched_by(PointLoad(0.05, 0.05, 0.1)), (4, 4), by)


@OF_EACH
def test_the_predicted_rms_is_that_of_orthogonal_sines(read):
    found = prospect(designed(read))

    assert found.rms == pytest.approx(rms_by_hand(read, 8), rel=1e-9)
    assert found.rate == math.inf


@OF_EACH
@pytest.mark.parametrize("by", ["scene", "D"])
def test_a_simulation_varies_by_as_much_as_is_predicted(read, by):
    design = designed(read, by=by)
    found, *_, last = prospect(design), *check(design, 1500)

    assert last.rms_sd == pytest.approx(found.rms, rel=0.04)
    seen = found.sd > 0.2 * found.worst
    np.testing.assert_allclose(last.sd[seen] / found.sd[seen], 1, atol=0.09)


@OF_EACH
def test_optimal_places_are_better_than_a_grid(read):
    on_grid, best = (prospect(designed(read, 6, by)).rms for by in ("scene", "A"))

    assert best < on_grid


def test_other_noise_of_readings_of_several_units_is_refused():
    design = designed("mixed", effects=(FlickerNoise(5e-6),))

    with pytest.raises(
        Refusal, match=r"expected the same noise .* got 1\.41 in height, 1 in slope"
    ):
        prospect(design)


def test_readings_of_several_units_need_their_noise():
    design = designed("mixed")
    silent = replace(design.scene, transduction=DigitalReadings())

    with pytest.raises(Refusal, match="noise of readings that differ in unit, m or m/m"):
        prospect(replace(design, scene=silent))


# Studies

STATED = {
    "height": f"[readings]\nresolution = 1e-9\nnoise = {HEIGHT}",
    "slopes": f"[readings]\nresolution = 1e-9\nnoise = {SLOPE}",
    "mixed": "[readings]\nresolution = 1e-9\n"
    f"[readings.height]\nnoise = {HEIGHT}\n[readings.slope]\nnoise = {SLOPE}",
}
EXACT = "rate = 10.0", "rate = 10.0\nreference = [4, 4]"  # the fit can make all of the truth


def reading(read: str) -> list[tuple[str, str]]:
    """Changes of the small study to other readings."""
    return [
        ("grid = [6, 6]", f"grid = [8, 8]\nreads = {READS[read]}"),
        ("[effects.uniform-noise]\nrms = 0.2", STATED[read]),
    ]


def measured(study, *names, frames=400):
    told = ", ".join(f'"{name}"' for name in names)
    found = study('["rms"]\nframes = 5', f"[{told}]\nframes = {frames}")
    return run_task(BlockTask(next(found.points()).document, 0, version()))


@OF_EACH
@pytest.mark.parametrize("place", ["scene", "D"])
def test_a_study_measures_and_predicts_what_noise_does(study_of, read, place):
    places = "[fit]", f'[place]\nby = "{place}"\n\n[fit]'
    found = measured(
        lambda *more: study_of("", EXACT, *reading(read), places, more), "rms", "predicted", "rate"
    )

    rms = math.sqrt(found["rms"].mean ** 2 + found["rms"].squares / found["rms"].count)
    assert found["predicted"].mean == pytest.approx(rms, rel=0.04)
    if place == "scene":  # of 101 points along a side those on the edges are still
        assert found["predicted"].mean == pytest.approx(rms_by_hand(read, 8) * 100 / 101)
    assert found["rate"].count == 0


@OF_EACH
def test_a_study_finds_the_contact_by_its_readings(study_of, read):
    found = measured(
        lambda *more: study_of("", *reading(read), more), "contact", "force", "found", frames=5
    )

    assert found["found"].mean == 1.0
    assert found["contact"].mean < 5e-4
    assert found["force"].mean < 0.02


@pytest.mark.parametrize("read", ["height", "mixed"])
def test_a_skin_of_unknown_material_has_contacts_without_a_force(study_of, read):
    unknown = "size = [0.1, 0.1]", "size = [0.1, 0.1]\nunknown_material = true"
    found = measured(
        lambda *more: study_of("", *reading(read), unknown, more),
        *("contact", "force", "found"),
        frames=2,
    )

    assert found["found"].mean == 1.0
    assert found["contact"].mean < 5e-3
    assert found["force"].count == 0


@pytest.mark.parametrize("method", ["least-squares", "tracking"])
def test_the_radius_of_a_ball_is_estimated_from_heights_and_slopes(study_of, method):
    ball = 'what = "sphere"\nradius = 0.02\nx = 0.05\ny = 0.05\nforce = 0.6'
    found = measured(
        lambda *more: study_of(
            "",
            *reading("mixed"),
            ('what = "point"\nx = 0.05\ny = 0.03\nforce = 0.1', ball),
            ("functions = [4, 4]", f'method = "{method}"\nfunctions = [7, 7]'),
            more,
        ),
        "radius",
        frames=2,
    )

    assert found["radius"].mean < 0.5


def test_another_noise_is_another_point(study_of):
    """The estimator of one is not that of the other, which weighs its readings differently."""
    vary = '\n[[vary]]\n"readings.slope.noise" = [5e-6, 5e-2]\n'
    study = study_of(vary, EXACT, *reading("mixed"), ('["rms"]', '["predicted"]'))

    few, many = (
        run_task(BlockTask(point.document, 0, version()))["predicted"].mean
        for point in study.points()
    )

    assert few < 0.1 * many
    assert many == pytest.approx(rms_by_hand("height", 8) * 100 / 101, rel=1e-3)
