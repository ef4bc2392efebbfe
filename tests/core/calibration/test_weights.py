"""Known weights on skins of the truths: rigidity, stiffening and an edge that gives."""

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from argyris import ArgyrisPlate
from kappaskin import Frame, Pipeline, Refusal, Setup, load_scene
from kappaskin.calibration import (
    Calibration,
    KnownWeights,
    Weighing,
    WeightFit,
    load_calibration,
    take_weights,
)
from kappaskin.calibration.weights import newtons
from kappaskin.mechanics import Plate
from kappaskin.sensing import DigitalReadings
from navier import HingedPlate, Load
from studies import WEIGHED as RIGIDITY
from studies import weighed
from von_karman import StretchingPlate

SENSOR = load_scene("centre").sensor()
MASSES = (5.0, 10.0, 20.0, 10.0, 20.0, 5.0)
NOISE = 0.023  # 1/m, of a second's mean
NOW = datetime(2026, 11, 1, tzinfo=UTC)
HINGED = HingedPlate(rigidity=RIGIDITY)


def readings(skin, masses=MASSES, **size):
    """Readings (n, 3, P) under each weight, with the noise of a second's mean."""
    return list(weighed(skin, masses, np.random.default_rng(0), **(size or {"radius": 4e-3})))


def found(masses=MASSES, skin=None, sensor=SENSOR) -> KnownWeights:
    return WeightFit(sensor)(newtons(masses), readings(skin or HINGED, masses))


@pytest.mark.full
@pytest.mark.truth
def test_the_rigidity_of_a_hinged_plate_is_found_within_its_standard_error() -> None:
    known = found()
    assert known.rigidity == pytest.approx(RIGIDITY, rel=0.005)
    assert abs(known.rigidity - RIGIDITY) < 3 * known.rigidity_sd
    assert known.thickness == 0
    assert known.passed
    assert np.allclose(known.told, newtons(MASSES), rtol=0.01)
    assert "no stiffening" in known.lines()[0]
    assert known.lines()[-1].startswith("passed")


@pytest.mark.cases("masses0")
@pytest.mark.truth
@pytest.mark.parametrize("masses", [(2, 5, 10, 4, 8, 12), (2, 5, 20, 4, 15, 30)])
def test_the_thickness_by_which_a_held_sheet_stiffens_is_found(masses) -> None:
    known = found(masses, StretchingPlate(rigidity=RIGIDITY, thickness=0.6e-3))
    assert known.rigidity == pytest.approx(RIGIDITY, rel=0.03)
    assert abs(known.rigidity - RIGIDITY) < 3 * known.rigidity_sd
    assert known.thickness == pytest.approx(0.6e-3, rel=0.05)
    assert known.passed
    assert f"stretches as a sheet of {1e3 * known.thickness:.3g} mm" in known.lines()[0]


@pytest.mark.truth
@pytest.mark.cases("500.0")
@pytest.mark.parametrize("springs", [500.0, 20000.0])
def test_of_an_edge_that_gives_the_rigidity_is_within_its_standard_error(springs) -> None:
    sensor = replace(SENSOR, edge="elastic")
    skin = ArgyrisPlate(rigidity=RIGIDITY, edge="springs", springs=springs)
    known = WeightFit(sensor)(newtons(MASSES), readings(skin, sd=3e-3))
    assert abs(known.rigidity - RIGIDITY) < 3 * known.rigidity_sd < 0.4 * RIGIDITY
    assert springs / 3 < known.rim_stiffness < 3 * springs
    assert "its edge gives" in known.lines()[0]
    assert known.passed


@pytest.mark.full
def test_a_weight_that_is_wrong_is_named() -> None:
    weights = list(newtons(MASSES))
    bent = readings(HINGED)
    weights[2] *= 1.1
    known = WeightFit(SENSOR)(weights, bent)
    assert not known.passed
    assert (
        "failed: the fit to the others estimates weight 3 with an error of -9." in known.lines()[-1]
    )


@pytest.mark.full
def test_a_wrong_boundary_condition_fails() -> None:
    masses = (10.0,) * 5
    clamped = ArgyrisPlate(rigidity=RIGIDITY, edge="clamped")
    places = [Load(x, y, newtons(masses)[0], sd=3e-3) for x, y in ((0.05, 0.05), (0.02, 0.05))]
    places += [Load(x, y, newtons(masses)[0], sd=3e-3) for x, y in ((0.05, 0.08), (0.06, 0.04))]
    places += [Load(0.02, 0.08, newtons(masses)[0], sd=3e-3)]
    bent = [clamped.readings(load, SENSOR.layout.positions) for load in places]
    assert not WeightFit(SENSOR)(newtons(masses), bent).passed
    assert WeightFit(SENSOR, "clamped")(newtons(masses), bent).passed


@pytest.mark.parametrize(
    ("masses", "reason"),
    [
        ((10, 20), "at least 3 weights"),
        ((0.01, 0.02, -0.01), "in grams"),
        ((10, 20, math.nan), "in grams"),
        ((10, 20, math.inf), "in grams"),
        ((10, 20, 2e5), "in grams"),
    ],
)
def test_masses_that_cannot_be_are_refused(masses, reason) -> None:
    with pytest.raises(Refusal, match=reason):
        newtons(masses)


def test_weights_at_one_place_are_refused() -> None:
    at, rng = SENSOR.layout.positions, np.random.default_rng(0)
    bent = [
        HINGED.readings(Load(0.05, 0.05, w, radius=4e-3), at) + rng.normal(0, NOISE, (3, 100))
        for w in newtons(MASSES[:3])
    ]
    with pytest.raises(Refusal, match="at one place"):
        WeightFit(SENSOR)(newtons(MASSES[:3]), bent)


def test_the_last_weight_at_the_same_place_as_all_others_is_laid_elsewhere() -> None:
    weighing, at = Weighing(SENSOR, (10, 10, 10)), SENSOR.layout.positions
    rng, (w, *_) = np.random.default_rng(0), newtons((10, 10, 10))

    def take(x) -> str:
        load = HINGED.readings(Load(x, 0.05, w, radius=4e-3), at) if x else np.zeros((3, 100))
        return weighing.take((load + rng.normal(0, NOISE, (3, 100))).reshape(1, -1))

    for x in (None, 0.05, 0.05):
        take(x)
    with pytest.raises(Refusal, match="lay this one elsewhere"):
        take(0.05)
    assert not weighing.done
    assert "a contact at" in take(0.03)
    assert weighing.done


def test_masses_in_kilograms_are_noticed_at_the_first_weight() -> None:
    weighing, at = Weighing(SENSOR, (0.05, 0.1, 0.2)), SENSOR.layout.positions
    (heavy, *_), rest = newtons((50, 100, 200)), np.zeros((1, SENSOR.channels))
    weighing.take(rest)
    with pytest.raises(Refusal, match=r"to about .* g, where 0\.05 g were expected"):
        weighing.take(HINGED.readings(Load(0.05, 0.05, heavy, radius=4e-3), at).reshape(1, -1))


@pytest.mark.full
def test_weights_make_measured_gains_no_younger() -> None:
    later, known = NOW + timedelta(days=170), found()
    nominal = Calibration.nominal(SENSOR, NOW)
    measured = replace(nominal, gain_sd=np.full(SENSOR.channels, 1e-3))
    assert measured.with_weights(known, later).date == NOW
    assert nominal.with_weights(known, later).date == later


def test_a_drum_head_is_refused() -> None:
    drum = replace(SENSOR, plate=Plate(SENSOR.plate.patch, rigidity=0.0, tension=20.0))
    with pytest.raises(Refusal, match="drum head"):
        WeightFit(drum)


@pytest.mark.full
def test_each_step_says_what_it_found_and_can_be_repeated() -> None:
    weighing, bent = Weighing(SENSOR, MASSES), readings(HINGED)

    def take(kappa):
        return weighing.take(np.tile(kappa.ravel(), (3, 1)))

    rest = np.random.default_rng(3).normal(0, 5.0, bent[0].shape)  # offsets
    assert weighing.what == "take everything off the skin"
    assert take(rest) == "the skin without a weight"
    assert weighing.what == "lay 5 g on the skin"
    with pytest.raises(Refusal, match="no contact was found"):
        take(rest + np.random.default_rng(4).normal(0, NOISE, rest.shape))
    with pytest.raises(Refusal, match="bend outward"):
        take(rest - bent[0])
    with pytest.raises(Refusal, match="missing"):
        take(np.where(np.arange(100) < 70, np.nan, rest))
    at_edge = HINGED.readings(Load(0.004, 0.05, 0.3, radius=1e-3), SENSOR.layout.positions)
    with pytest.raises(Refusal, match="too near the edge"):
        take(rest + at_edge)
    assert "contact at (50." in take(rest + bent[0])
    weighing.redo()
    assert (weighing.step, weighing.contacts) == (1, [])
    for each in bent:
        take(rest + each)
    assert weighing.done
    assert len(weighing.contacts) == 6
    known = weighing.fit(weighing.weights, weighing.bent)
    assert known.rigidity == pytest.approx(RIGIDITY, rel=0.005)


@pytest.mark.cases("stretching")
@pytest.mark.parametrize("skin", ["stretching", "on-foam", "sphere"])
def test_a_simulation_lays_the_weights_on_itself(skin) -> None:
    told: list[str] = []
    sensor, known = take_weights(f"sim:{skin}", (2, 5, 10, 5, 2), input, told.append)
    assert known.passed
    assert len(told) == 7
    # The scene sums 15 x 15 functions, which give it 1 to 3 % more curvature than the truth.
    assert known.rigidity == pytest.approx(sensor.plate.rigidity, rel=0.04)


@pytest.mark.full
def test_the_force_then_needs_no_modulus() -> None:
    """The sensor tells a rigidity that is 27 % too low, and its forces are as much too low."""
    known = found()
    nominal = replace(Calibration.nominal(SENSOR, NOW), weights=known)
    true = 0.15
    kappa = HINGED.readings(Load(0.045, 0.055, true, radius=4e-3), SENSOR.layout.positions)
    counts = SENSOR.transduction.counts(kappa.ravel())
    frame = Frame(0, 0.0, 0.0, np.arange(SENSOR.channels), counts)
    force = [
        Pipeline(SENSOR, Setup(calibration=each))(frame).contact.force for each in (None, nominal)
    ]
    assert force == pytest.approx([true / 1.37, true], rel=0.01)


@pytest.mark.full
def test_what_weights_found_is_kept_in_the_file(tmp_path) -> None:
    known = found()
    nominal = replace(Calibration.nominal(SENSOR, NOW), weights=known)
    nominal.save(tmp_path / "skin.toml")
    again = load_calibration(tmp_path / "skin.toml", SENSOR, NOW + timedelta(days=1))
    assert again.weights == known
    assert again.digest == nominal.digest
    assert again.plate(SENSOR.plate).rigidity == known.rigidity
    assert replace(nominal, weights=None).plate(SENSOR.plate) == SENSOR.plate


@pytest.mark.full
def test_all_that_resists_grows_by_the_same_share() -> None:
    known = replace(found(), thickness=0.0)
    told = Plate(SENSOR.plate.patch, rigidity=RIGIDITY / 2, tension=10.0, foundation=1e5)
    plate = known.plate(told)
    ratio = known.rigidity / told.rigidity
    assert (plate.tension, plate.foundation) == (10.0 * ratio, 1e5 * ratio)


@pytest.mark.parametrize(
    "change",
    [
        {"rigidity": 0.0},
        {"rigidity": math.nan},
        {"thickness": -1.0},
        {"told": (1.0,)},
        {"weights": (), "told": (), "left_out": ()},
    ],
)
def test_what_no_weights_can_find_is_refused(change) -> None:
    known = KnownWeights(RIGIDITY, 1e-5, 0.0, 0.0, (0.1,) * 3, (0.1,) * 3, (0.0,) * 3, 1e-4)
    with pytest.raises(Refusal, match="expected"):
        replace(known, **change)


@pytest.mark.full
@pytest.mark.truth
def test_weights_on_heights_and_slopes_of_an_unknown_zero_give_the_rigidity() -> None:
    layout = SENSOR.layout.reading_each(["height", "slope@0", "slope@90"])
    layout = replace(layout, reads=replace(layout.reads, free=("height", "slope")))
    noise, rng = {"height": 1e-5, "slope": 1e-3}, np.random.default_rng(5)
    digital = DigitalReadings(1e-9, tuple(noise.items()))
    sensor = replace(SENSOR, layout=layout, transduction=digital)
    places = rng.uniform(0.03, 0.07, (len(MASSES), 2))
    sigma, offsets = sensor.sigma, layout.offsets
    bent = []
    for place, weight in zip(places, newtons(MASSES), strict=True):
        modes = HINGED.coefficients(Load(*place, weight, radius=4e-3))
        read = [HINGED.read(modes, layout.positions, name) for name in layout.each_reads]
        bent.append(np.concatenate(read) + rng.normal(size=layout.channels) * sigma / 10)
        bent[-1] += offsets @ rng.normal(0, 0.1, offsets.shape[1])
    known = WeightFit(sensor)(newtons(MASSES), bent)
    assert abs(known.rigidity - RIGIDITY) < 3 * known.rigidity_sd < 0.03 * RIGIDITY
    assert known.passed
