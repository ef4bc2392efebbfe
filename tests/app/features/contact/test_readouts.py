"""The numbers of the header have room, whatever the letters."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Pipeline, Setup, Simulator, load_scene
from kappaskin_app.features.contact.numbers import FACTS, csv_of, facts_of
from kappaskin_app.features.contact.readouts import FIELDS, Readouts
from kappaskin_app.theme import FAINT
from kappaskin_app.widgets.text import ERROR_BARS


@pytest.fixture
def readouts(qtbot) -> Readouts:
    made = Readouts()
    qtbot.addWidget(made)
    made.resize(1180, 60)
    made.show()
    made.show_health(500.0, 42.0, 0.0123, 0.0004, lost=1234, skipped=5678)
    return made


def rows(readouts: Readouts) -> int:
    return len({number.y() for number, _ in readouts.parts.values()})


def test_numbers_too_wide_for_one_row_stand_in_two_and_come_back(readouts: Readouts, qtbot) -> None:
    seen = []
    for width in (1180, 560, 1180):
        readouts.resize(width, 100)
        qtbot.wait(1)
        seen.append(rows(readouts))

    assert seen == [1, 2, 1]
    assert list(readouts.parts) == list(FIELDS)


def test_larger_letters_stand_in_two_rows_and_are_read_whole(readouts: Readouts, qtbot) -> None:
    font = readouts.font()
    font.setPointSizeF(1.8 * font.pointSizeF())

    for number, name in readouts.parts.values():
        number.setFont(font)
        name.setFont(font)
    readouts.setFont(font)
    qtbot.wait(1)

    assert rows(readouts) == 2
    assert all(number.whole for number, _ in readouts.parts.values())


@pytest.mark.parametrize("width", [920, 1170, 1590])  # in windows of 1024, 1280 and 1700 px
def test_the_places_of_two_contacts_are_read_whole(readouts: Readouts, qtbot, width) -> None:
    estimate = _centre()
    places = np.array([0.0164, 0.0907]), np.array([0.0943, 0.0104])
    sd = np.full(2, 3.8e-5)
    contacts = [replace(estimate.contact, position=place, position_sd=sd) for place in places]
    readouts.resize(width, 60)
    qtbot.wait(1)
    readouts.show_estimate(replace(estimate, contact=contacts[0], second=contacts[1]))
    assert readouts.text("contact") == "(16.4, 90.7), (94.3, 10.4) mm"
    assert readouts.parts["contact"][0].whole


def test_a_force_that_leaves_out_a_stretch_is_shown_as_a_lower_bound(readouts: Readouts) -> None:
    scene = load_scene("centre")
    estimate = Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, lambda: 0.0))
    sure = replace(estimate, contact=replace(estimate.contact, force_is_lower_bound=False))

    readouts.show_estimate(sure)
    plain = readouts.text("force")
    readouts.show_estimate(estimate)

    assert readouts.text("force") == f"\N{GREATER-THAN OR EQUAL TO} {plain}"


def test_the_force_of_a_skin_that_softens_is_an_upper_bound_and_none_where_it_snaps(
    readouts: Readouts,
) -> None:
    estimate = _centre()
    soft = replace(
        estimate.contact, force_is_lower_bound=False, force_is_upper_bound=True, snaps_through=False
    )
    snaps = replace(soft, force_is_upper_bound=False, force=math.nan, snaps_through=True)

    readouts.show_estimate(replace(estimate, contact=soft))
    assert readouts.text("force").startswith("\N{LESS-THAN OR EQUAL TO} ")
    assert readouts.text("force").endswith(" N")
    readouts.show_estimate(replace(estimate, contact=snaps))
    assert readouts.text("force") == "snaps through: no force"
    assert "mm" in readouts.text("depth")
    readouts.show_estimate(replace(estimate, contact=soft, second=snaps))
    assert readouts.text("force").endswith(", snaps through N")


def _centre():
    scene = load_scene("centre")
    return Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, lambda: 0.0))


def test_a_contact_near_the_rim_has_a_grey_place_and_no_numbers(readouts: Readouts) -> None:
    estimate = _centre()
    rim = replace(estimate, contact=replace(estimate.contact, near_rim=True))
    number, _ = readouts.parts["contact"]

    readouts.show_estimate(estimate)
    plain = number.grab().toImage()
    readouts.show_estimate(rim)

    assert readouts.text("contact").endswith("near rim")
    assert readouts.text("force") == "edge: no force"
    assert readouts.text("depth") == "edge: no depth"
    assert number.foregroundRole() == FAINT
    assert number.grab().toImage() != plain
    readouts.show_estimate(estimate)
    assert number.foregroundRole() != FAINT
    assert " N" in readouts.text("force")


def test_of_two_contacts_the_one_near_the_rim_has_no_force(readouts: Readouts) -> None:
    estimate = _centre()
    second = replace(estimate.contact, near_rim=True, force=1482.331)

    readouts.show_estimate(replace(estimate, second=second))

    assert readouts.text("force").endswith(", edge N")


def test_the_error_bar_has_two_digits_and_without_noise_the_place_is_exact(readouts) -> None:
    estimate = _centre()
    at = replace(estimate.contact, position=np.array([0.05, 0.0302]))

    def shown(sd: float) -> str:
        contact = replace(at, position_sd=np.full(2, sd))
        readouts.show_estimate(replace(estimate, contact=contact))
        return readouts.text("contact")

    assert shown(1.37e-4) == "(50.00, 30.20) \N{PLUS-MINUS SIGN} 0.14 mm"
    assert shown(1.7e-6) == "(50.0000, 30.2000) \N{PLUS-MINUS SIGN} 0.0017 mm"
    assert shown(0.0) == "(50.0, 30.2) mm exact"


def test_an_unknown_force_is_a_dash_and_never_nan(readouts: Readouts) -> None:
    scene = load_scene("centre")
    scene = replace(scene, plate=replace(scene.plate, unknown_material=True))
    estimate = Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, lambda: 0.0))
    assert estimate.contact.present

    readouts.show_estimate(estimate)

    assert readouts.text("force") == "\N{EN DASH}"
    assert "mm" in readouts.text("contact")
    readouts.show_estimate(replace(estimate, second=estimate.contact))
    assert readouts.text("force") == "\N{EN DASH}"


def test_the_table_near_the_rim_has_words_and_its_copy_numbers_that_programs_read() -> None:
    estimate = _centre()
    rim = replace(estimate, contact=replace(estimate.contact, near_rim=True))
    facts = {row[0]: row[1:] for row in facts_of(rim, "", ERROR_BARS["sigma"])}
    assert facts["Force"] == ("edge: no force", "", "")
    assert facts["Contact x"] == ("edge: unreliable", "", "")
    assert facts["Larger \N{GREEK SMALL LETTER KAPPA}"][0].startswith("\N{MINUS SIGN}")
    copied = csv_of((FACTS, facts_of(rim, "", ERROR_BARS["sigma"])))
    assert "\N{MINUS SIGN}" not in copied
    assert "-" in copied
