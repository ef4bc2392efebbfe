"""Contacts by the shape alone: what is found where, and where nothing is."""

import numpy as np
import pytest

from kappaskin import Patch, Plate, SensorLayout, basis_for, estimator_for
from kappaskin.contact import Contacts, ImprintObjects, as_one, contacts_of
from kappaskin.contact.imprint import CHANCE, Imprints, imprinted_object
from kappaskin.estimation import METHODS, Fit
from kappaskin.frames import LocalGeometry
from kappaskin.skin import Cap, Disk
from navier import HingedPlate, Load

SQUARE, OBLONG = Patch(0.1, 0.1), Patch(0.06, 0.04)
TENS, NOISE = SensorLayout.regular(SQUARE, 10, 10), 0.231
PRESS = Load(0.063, 0.041, 0.3, 3e-3)


def made(layout, functions=(8, 8), method="least-squares", edge="hinged"):
    plate = Plate(layout.patch, unknown_material=True)
    fit = estimator_for(method, basis_for(layout.patch, edge, *functions), layout)
    return fit, contacts_of(plate, layout, fit.basis, edge)


def heights(patch, m=30, n=20, free=()):
    layout = SensorLayout.regular(patch, m, n)
    return layout.reading(np.arange(len(layout)), "height", free=free)


def told(layout, readings, **how) -> tuple[Fit, Imprints, LocalGeometry]:
    fit, contacts = made(layout, **how)
    shape = fit(readings)
    contact, second = contacts(readings, shape)
    assert not second.present
    return contact, contacts.geometry(shape, contact), contacts


def cap(places, x, y, across, along, deepest=1e-3):
    """A dent that follows what has these curvatures in 1/m along x and y, as deep as it can."""
    u, v = (places - (x, y)).T
    return np.maximum(deepest - across * u**2 / 2 - along * v**2 / 2, 0.0)


# Nothing


@pytest.mark.parametrize("method", ["least-squares", "bayes"])
@pytest.mark.parametrize("layout", [TENS, heights(OBLONG)], ids=["curvature", "height"])
def test_no_more_than_the_stated_share_of_frames_is_noise_alone(layout, method):
    fit, contacts = made(layout, method=method)
    contacts._plate = None  # noqa: SLF001
    rng, chances, frames = np.random.default_rng(0), [], 1000
    for _ in range(frames):
        readings = rng.normal(0, 1e-3, layout.frame_shape)
        assert not contacts(readings, fit(readings))[0].present
        chances.append(contacts.chance)

    for share in (0.1, 0.01, 0.003):
        limit = share + 3 * np.sqrt(share / frames)
        assert np.mean(np.array(chances) < share) <= limit
    assert min(chances) > CHANCE


@pytest.mark.parametrize("method", sorted(METHODS))
def test_no_method_finds_a_contact_in_noise(method):
    fit, contacts = made(TENS, method=method)
    for seed in range(5):
        readings = np.random.default_rng(seed).normal(0, NOISE, (3, 100))
        assert not contacts(readings, fit(readings))[0].present


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_a_level_and_slopes_of_all_readings_are_no_contact(size):
    fit, contacts = made(TENS)
    contacts._plate = None  # noqa: SLF001
    u = np.column_stack([np.ones(100), (TENS.positions - 0.05) / 0.05])
    for seed in range(20):
        rng = np.random.default_rng(seed)
        readings = size * (u @ rng.normal(size=(3, 3))).T + rng.normal(0, NOISE, (3, 100))
        assert not contacts(readings, fit(readings))[0].present


def test_a_tilt_of_all_heights_is_no_contact():
    layout = heights(OBLONG)
    rng = np.random.default_rng(0)
    tilt = 1e-4 + 2e-3 * layout.positions @ [1.0, -0.5]

    assert not told(layout, tilt + rng.normal(0, 1e-5, 600))[0].present


def test_a_skin_that_is_pulled_out_has_no_contact():
    layout = heights(OBLONG)
    pulled = -cap(layout.positions, 0.03, 0.02, 60.0, 60.0)

    assert not told(layout, pulled + np.random.default_rng(0).normal(0, 1e-5, 600))[0].present


# Something


@pytest.mark.parametrize("free", [(), ("height",)])
@pytest.mark.parametrize("missing", [0, 60])
def test_a_dent_has_its_place_depth_and_curvatures_and_no_force(free, missing):
    layout, rng = heights(OBLONG, free=free), np.random.default_rng(0)
    readings = cap(layout.positions, 0.033, 0.019, 40.0, 40.0) + 2e-4 * bool(free)
    readings = readings + rng.normal(0, 1e-5, 600)
    readings[rng.choice(600, missing, replace=False)] = np.nan

    contact, there, contacts = told(layout, readings, functions=(18, 12))

    assert contact.present
    assert contact.single
    assert np.isnan([contact.force, contact.force_sd, contact.force_95]).all()
    assert contact.position == pytest.approx((0.033, 0.019), abs=5e-4)
    assert abs(contact.displacement - 1e-3) <= contact.displacement_95
    assert (np.abs(there.principal + 40.0) <= 2 * there.principal_sd).all()
    assert contacts.chance < CHANCE


def test_noise_makes_errors_larger():
    layout = heights(OBLONG)
    dent, rng = cap(layout.positions, 0.033, 0.019, 40.0, 40.0), np.random.default_rng(0)
    quiet, noisy = (
        told(layout, dent + rng.normal(0, sd, 600), functions=(18, 12))[:2] for sd in (1e-6, 1e-4)
    )

    assert (noisy[0].position_sd > quiet[0].position_sd).all()
    assert noisy[0].displacement_sd > quiet[0].displacement_sd
    assert noisy[1].mean_sd > quiet[1].mean_sd


def test_a_skin_turned_by_a_quarter_has_the_same_contact():
    layout, turned = heights(OBLONG, 30, 20), heights(Patch(0.04, 0.06), 20, 30)
    there = told(layout, cap(layout.positions, 0.033, 0.019, 40.0, 60.0), functions=(18, 12))
    here = told(turned, cap(turned.positions, 0.019, 0.033, 60.0, 40.0), functions=(12, 18))

    np.testing.assert_allclose(here[0].position[::-1], there[0].position, rtol=1e-9)
    np.testing.assert_allclose(here[0].size, there[0].size, rtol=1e-9)
    # The frame in which curvatures are averaged lies along x, on slopes of 0.2 too.
    np.testing.assert_allclose(here[1].principal, there[1].principal, rtol=3e-3)


DOMED = {
    "dome": (Patch(0.04, 0.03, (0.1, 0.08)), (14, 12)),
    "saddle": (Patch(0.04, 0.03, (0.1, -0.08)), (14, 12)),
    "cap": (Cap(0.02, 1.3), (9, 17)),
    "spheroid": (Cap(0.02, 1.3, 1.4), (9, 17)),
}


@pytest.mark.parametrize("share", [0.5, 0.6])
@pytest.mark.parametrize(("patch", "functions"), DOMED.values(), ids=DOMED)
def test_a_dent_lies_as_far_along_a_domed_skin_and_is_as_wide_as_on_a_flat_one(
    patch, functions, share
):
    layout, x, y = heights(patch, 28, 28), share * patch.a, patch.b / 2
    points = patch.at_rest(np.vstack([[x, y], layout.positions]))[0]
    squares = np.sum((points[1:] - points[0]) ** 2, axis=1)
    noise = np.random.default_rng(0).normal(0, 2e-6, len(layout))

    contact, there, _ = told(
        layout, 5e-4 * np.exp(-squares / 2 / 0.0035**2) + noise, functions=functions
    )

    np.testing.assert_allclose(contact.position, [x, y], atol=2e-4)
    assert contact.single
    # sqrt(2) / 2 of where a flat skin turns over, 3.5 mm; a dome is convex again sooner.
    assert np.sqrt(contact.size) == pytest.approx(2.4e-3, rel=0.15)
    at, normal = patch.at_rest(contact.position)
    np.testing.assert_allclose(there.position, at - contact.displacement * normal, atol=1e-9)


def test_two_dents_are_no_single_contact():
    layout = heights(OBLONG)
    both = [cap(layout.positions, x, 0.02, 80.0, 80.0) for x in (0.017, 0.043)]

    contact, _, _ = told(layout, sum(both), functions=(18, 12))

    assert contact.present
    assert not contact.single


def test_a_plate_of_unknown_rigidity_has_its_own_place_without_a_force():
    readings = HingedPlate().readings(PRESS, TENS.positions)
    readings = readings + np.random.default_rng(0).normal(0, NOISE, (3, 100))
    fit, contacts = made(TENS)
    shape = fit(readings)
    found, _ = contacts(readings, shape)
    expected, _ = Contacts(Plate(SQUARE), TENS)(readings, shape)

    np.testing.assert_array_equal(found.position, expected.position)
    np.testing.assert_array_equal(found.position_sd, expected.position_sd)
    assert (found.displacement, found.size) == (expected.displacement, expected.size)
    assert found.present
    assert np.isnan(found.force)
    assert contacts.loads[0].force == pytest.approx(PRESS.force, rel=0.03)


def test_two_contacts_of_unknown_force_are_as_one_in_their_middle():
    two = [Load(0.03, 0.03, 0.3, 2e-3), Load(0.07, 0.065, 0.3, 2e-3)]
    readings = sum(HingedPlate().readings(load, TENS.positions) for load in two)
    readings = readings + np.random.default_rng(0).normal(0, 0.05, (3, 100))
    fit, contacts = made(TENS)
    pair = contacts(readings, fit(readings))

    assert all(one.present and np.isnan(one.force) for one in pair)
    assert as_one(*pair).position == pytest.approx((0.05, 0.0475), abs=1e-3)


SKINS = {
    "strip": (SensorLayout.regular(Patch(0.1, 0.02, strip=True), 24, 1), (10, 1)),
    "disk": (SensorLayout.regular(Disk(0.05), 12, 12), (8, 8)),
    "bent": (SensorLayout.regular(Patch(0.06, 0.05, radius=0.03), 12, 10), (8, 8)),
}


@pytest.mark.parametrize("name", SKINS)
def test_every_skin_has_contacts_by_its_shape(name):
    layout, functions = SKINS[name]
    patch = layout.patch
    fit, contacts = made(layout, functions, edge="hinged")
    contacts._plate = None  # noqa: SLF001
    load = fit.basis.at(np.array([[0.55 * patch.a, 0.5 * patch.b]]))[0]
    c = Plate(patch).compliance(fit.basis)(load.reshape(fit.basis.shape)) * 0.3
    readings = fit.predicted(c)
    readings = readings + np.random.default_rng(0).normal(0, 0.05, readings.shape)
    shape = fit(np.where(layout.live, readings, np.nan))

    contact, _ = contacts(shape.readings, shape)
    there = contacts.geometry(shape, contact)

    assert contact.present
    assert abs(contact.position[0] - 0.55 * patch.a) <= contact.position_95[0]
    assert np.isfinite(there.principal).all()
    assert np.isfinite([contact.displacement, contact.displacement_sd, contact.size_sd]).all()


# Objects


def named(across, along, turn=0.0, functions=(30, 20)):
    layout = heights(OBLONG, 60, 40)
    c, s = np.cos(turn), np.sin(turn)
    places = (layout.positions - (0.03, 0.02)) @ [[c, -s], [s, c]]
    readings = cap(places, 0.0, 0.0, across, along)
    readings = readings + np.random.default_rng(0).normal(0, 2e-6, readings.shape)
    fit, contacts = made(layout, functions, "fast")
    shape = fit(readings)
    contact, _ = contacts(readings, shape)
    plate = Plate(OBLONG, unknown_material=True)
    found = ImprintObjects(plate, fit, "hinged")(readings, float(shape.noise), contact)
    again = imprinted_object(contact, contacts.geometry(shape, contact))
    assert (found.kind, found.radius) == (again.kind, again.radius)
    return found


def test_a_sphere_is_named_with_its_radius():
    found = named(60.0, 60.0)

    assert found.kind == "sphere"
    assert found.radius_95[0] <= 1 / 60 <= found.radius_95[1]
    assert np.isnan([found.force, found.force_95]).all()
    assert "nan" not in found.describe()


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
def test_a_cylinder_is_named_with_its_radius_and_axis(turn):
    found = named(100.0, 5.0, turn)

    assert found.kind == "cylinder"
    assert found.radius_95[0] <= 1 / 100 <= found.radius_95[1]
    # The axis lies across what curves most.
    off = abs(np.remainder(found.axis - turn, np.pi) - np.pi / 2)
    assert off <= found.axis_95 < 0.3
    assert "nan" not in found.describe()


def test_an_egg_is_not_named():
    assert named(100.0, 40.0).kind == ""


def test_no_object_is_named_without_a_contact():
    layout = heights(OBLONG)
    fit, contacts = made(layout)
    shape = fit(np.zeros(600))
    contact, _ = contacts(shape.readings, shape)

    assert not contact.present
    assert imprinted_object(contact, contacts.geometry(shape, contact)).kind == ""
