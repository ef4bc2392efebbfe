"""Drift: told as drift, and contacts beside it; the drifts are written out here."""

import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, Plate, SensorLayout, SineBasis, load_scene
from kappaskin.contact import Contacts
from kappaskin.estimation import METHODS
from kappaskin.scenes import Simulator
from navier import HingedPlate, Load

SQUARE = Patch(0.1, 0.1)
TENS, PLATE = SensorLayout.regular(SQUARE, 10, 10), Plate(SQUARE)
BASIS, CONTACTS = SineBasis(SQUARE, 8, 8), Contacts(PLATE, TENS)
NOISE, PRESS = 0.231, Load(0.063, 0.041, 0.06, 2e-3)
X, Y = (TENS.positions - 0.05).T / 0.05


def warm(size, seed=0):
    """A drift of this RMS in 1/m: a level and two slopes in each component."""
    a = np.random.default_rng(seed).normal(size=(3, 3))
    field = np.stack([level + along * X + across * Y for level, along, across in a])
    return size * field / np.sqrt(np.mean(field**2))


def readings(*loads, size=0.0, seed=0):
    noise = np.random.default_rng(seed).normal(0, NOISE, (3, 100))
    return noise + warm(size, seed) + sum(HingedPlate().readings(l, TENS.positions) for l in loads)


def told(K, method="least-squares", contacts=CONTACTS):
    return pressed(K, METHODS[method](BASIS, TENS)(K), contacts)


def pressed(K, fit, contacts):
    found = contacts(K, fit)
    return found[0], contacts.drift.size if contacts.drift else 0.0


@pytest.mark.parametrize("size", [0.5, 1.0, 1.4])
def test_a_drift_is_no_contact_and_has_its_size(size):
    contact, drift = told(readings(size=size))

    assert not contact.present
    assert drift == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize("method", ["least-squares", "fast", "bayes", "robust", "finite-slope"])
def test_a_contact_is_found_beside_a_drift(method):
    contact, drift = told(readings(PRESS, size=1.0), method)

    assert drift == pytest.approx(1.0, rel=0.1)
    assert contact.single
    assert np.all(np.abs(contact.position - (PRESS.x, PRESS.y)) < 4 * contact.position_sd)
    assert abs(contact.force - PRESS.force) < 4 * contact.force_sd


@pytest.mark.parametrize("method", ["least-squares", "fast", "bayes", "robust", "finite-slope"])
@pytest.mark.parametrize("loads", [(), (PRESS,)], ids=["at rest", "pressed"])
def test_the_surface_beside_a_drift_is_within_its_bands(method, loads):
    places = np.stack(np.meshgrid(*[np.linspace(0.01, 0.09, 9)] * 2), -1).reshape(-1, 2)
    estimator, held = METHODS[method](BASIS, TENS), []
    true = sum(HingedPlate().displacement(load, places) for load in loads)
    for seed in range(12):
        K = readings(*loads, size=1.0, seed=seed)
        CONTACTS(K, estimator(K))
        fit = CONTACTS.drift.fit
        off = BASIS.at(places) @ fit.coefficients.ravel() - true
        held.append(np.abs(off) < 1.96 * fit.surface_sd(places))

    assert np.mean(held) > 0.85


def test_a_surface_by_a_method_with_memory_keeps_the_drift():
    K = readings(PRESS, size=1.0)
    fit = METHODS["tracking"](BASIS, TENS)(K)
    CONTACTS(K, fit)

    assert CONTACTS.drift.fit is fit
    off = CONTACTS.drift.readings - (K - warm(1.0))
    assert np.sqrt(np.mean(off**2)) < 0.1


def test_without_a_drift_none_is_told():
    assert told(readings(PRESS))[1] == 0
    assert told(readings())[1] == 0


def test_missing_readings_do_not_hide_a_drift():
    K = readings(PRESS, size=1.0)
    K.ravel()[np.random.default_rng(3).permutation(300)[:60]] = np.nan

    contact, drift = told(K)

    assert drift == pytest.approx(1.0, rel=0.2)
    assert abs(contact.force - PRESS.force) < 4 * contact.force_sd


def test_too_few_readings_for_a_drift_tell_none():
    K = np.full((3, 100), np.nan)
    K[:, 40:62] = warm(5.0)[:, 40:62]

    contact, drift = pressed(K, LeastSquares(SineBasis(SQUARE, 2, 2), TENS)(K), CONTACTS)

    assert np.isfinite(drift)
    assert contact.present in (True, False)


@pytest.mark.parametrize("scale", [1e-150, 1e-9, 1e9, 1e60])
def test_a_drift_of_any_size_is_told_alike(scale):
    contact, drift = told(scale * readings(PRESS, size=1.0))

    assert drift == pytest.approx(scale * 1.0, rel=0.1)
    assert contact.present


@pytest.mark.parametrize("skin", ["strip", "bent", "disk"])
def test_a_drift_is_told_on_other_skins(skin):
    patch = {
        "strip": Patch(0.1, 0.01, strip=True),
        "bent": Patch(0.06, 0.06, radius=0.05),
        "disk": Patch(0.06, 0.06),
    }[skin]
    layout = SensorLayout.regular(patch, *((30, 1) if skin == "strip" else (10, 10)))
    basis = SineBasis(patch, *((6, 1) if skin == "strip" else (6, 6)))
    contacts, rng = Contacts(Plate(patch), layout), np.random.default_rng(5)
    K = rng.normal(0, 0.1, (3, len(layout))) + 1.0
    contact, drift = pressed(K, LeastSquares(basis, layout)(K), contacts)

    assert drift == pytest.approx(1.0, rel=0.1)
    assert not contact.present


def test_a_room_that_warms_one_side_is_a_drift(tmp_path):
    text = """
    format = 1
    [skin]
    size = [0.1, 0.1]
    [elements]
    grid = [10, 10]
    [effects.temperature]
    rise = 10.0
    time_constant = 1.0
    offset = 0.05
    gradient_x = 10.0
    gradient_y = -5.0
    [effects.gaussian-noise]
    rms = 0.1
    """
    (tmp_path / "warm.toml").write_text(text)
    scene = load_scene(str(tmp_path / "warm.toml"))
    simulator, scan = Simulator(scene), scene.sensor().scan()
    _, K = simulator.reading(scan, 10.0)
    expected = 0.5 * (1 + 10 * 0.05 * X - 5 * 0.05 * Y)  # 10 K of 0.05 1/m, more on one side
    np.testing.assert_allclose(K.reshape(3, 100).mean(axis=0), expected, atol=0.25)

    contact, drift = told(K.reshape(3, 100))

    assert not contact.present
    assert drift == pytest.approx(np.sqrt(np.mean(expected**2)), rel=0.1)
