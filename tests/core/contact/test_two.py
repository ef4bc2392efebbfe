"""Two contacts: told as two, and what is written and sent of both.

Readings are those of Navier's plate of 240 waves each way, which shares nothing with the estimator;
`tests/truths/test_coverage.py` has the rates of error.
"""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, Plate, SensorLayout, SineBasis
from kappaskin.contact import NO_CONTACT, Contacts, as_one, drift, two
from kappaskin.pipeline import reconstruct
from navier import HingedPlate, Load

SQUARE = Patch(0.1, 0.1)
TENS, PLATE = SensorLayout.regular(SQUARE, 10, 10), Plate(SQUARE)
FIT, CONTACTS = LeastSquares(SineBasis(SQUARE, 8, 8), TENS), Contacts(PLATE, TENS)
STRONG, WEAK = Load(0.07, 0.06, 0.1, 2e-3), Load(0.03, 0.03, 0.05, 2e-3)
NOISE = 0.231


def readings(*loads, noise=NOISE):
    clean = sum(HingedPlate().readings(load, TENS.positions) for load in loads)
    return clean + np.random.default_rng(0).normal(0, noise, (3, 100))


def told(K, contacts=CONTACTS):
    return contacts(K, FIT(K))


def test_the_guide_states_the_limits_in_use():
    page = (files("kappaskin_resources") / "guide" / "numbers.md").read_text("utf-8")
    limits = vars(two) | vars(drift) | {"single": 100 - 100 * vars(two)["_MISFIT"]}
    for words in (
        "more than {single:g} % of single ones",
        "two loads are better by \N{MINUS SIGN}2 ln \N{GREEK CAPITAL LETTER LAMDA} > {_SPREAD:g}",
        "> {_DISTINCT:g} against one load and > {_NO_LINE:g} against a line",
        "> {_EVIDENT:g} (one frame",
    ):
        told = words.format_map(limits)
        assert told in page, f"expected {told!r} in guide/numbers.md, as in two.py and drift.py"


def test_two_contacts_are_told_the_strongest_first():
    first, second = told(readings(WEAK, STRONG))

    for contact, load in ((first, STRONG), (second, WEAK)):
        assert contact.present
        assert not contact.single
        assert contact.spare == 292
        assert np.abs((contact.position - (load.x, load.y)) / contact.position_sd).max() < 4
        assert abs(contact.force - load.force) < 4 * contact.force_sd
        w = HingedPlate().displacement
        true = sum(w(one, np.array([[load.x, load.y]]))[0] for one in (STRONG, WEAK))
        assert contact.displacement == pytest.approx(true, abs=4 * contact.displacement_sd)


def test_beside_one_contact_there_is_no_second_one():
    first, second = told(readings(STRONG))

    assert first.single
    assert second is NO_CONTACT


def test_a_line_is_distributed():
    points = [replace(STRONG, x=x, force=0.15 / 40) for x in np.linspace(0.03, 0.07, 40)]

    first, second = told(readings(*points))

    assert not first.single
    assert not second.present


def test_a_push_and_a_pull_are_distributed():
    first, second = told(readings(STRONG, replace(WEAK, force=-0.08)))

    assert not first.single
    assert not second.present


def test_dead_elements_leave_two_contacts_two():
    K = readings(STRONG, WEAK)
    K[:, 40:45] = np.nan

    first, second = told(K)

    assert first.position == pytest.approx([STRONG.x, STRONG.y], abs=2e-3)
    assert second.position == pytest.approx([WEAK.x, WEAK.y], abs=2e-3)


def test_two_contacts_scale_with_readings_of_any_size():
    first, second = told(readings(STRONG, WEAK))
    tiny, other = told(1e-100 * readings(STRONG, WEAK))

    assert tiny.position == pytest.approx(first.position, rel=1e-6)
    assert other.force == pytest.approx(1e-100 * second.force, rel=1e-6)


def test_on_a_skin_of_known_thickness_two_contacts_are_distributed():
    first, second = told(readings(STRONG, WEAK), Contacts(Plate(SQUARE, thickness=1e-3), TENS))

    assert not first.single
    assert not second.present


def test_one_in_place_of_two_lies_between_them_and_has_the_force_of_both():
    pair = told(readings(STRONG, WEAK))

    whole = as_one(*pair)

    assert whole.force == pytest.approx(0.15, abs=5e-3)
    assert whole.position == pytest.approx([0.17 / 3, 0.05], abs=1e-3)
    assert as_one(pair[0], NO_CONTACT) is pair[0]


def test_reconstruct_gives_both_and_the_first_as_before(tmp_path):
    frames = np.stack([readings(STRONG, WEAK), readings(STRONG)])
    np.savez(tmp_path / "in.npz", size=[0.1, 0.1], positions=TENS.positions, curvature=frames,
             rigidity=PLATE.rigidity)  # fmt: skip

    found = reconstruct(tmp_path / "in.npz", (8, 8), contact=True)

    assert found["contacts"].shape == found["contacts_sd"].shape == (2, 2, 2)
    assert found["forces"].shape == found["forces_sd"].shape == (2, 2)
    np.testing.assert_array_equal(found["contacts"][:, 0], found["contact"])
    np.testing.assert_array_equal(found["forces"][:, 0], found["force"])
    np.testing.assert_allclose(found["contacts"][0, 1], [WEAK.x, WEAK.y], atol=2e-3)
    assert np.isnan(found["contacts"][1, 1]).all()
