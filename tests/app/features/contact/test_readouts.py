"""The numbers of the header have room, whatever the letters."""

from dataclasses import replace

import pytest

from kappaskin import Pipeline, Setup, Simulator, load_scene
from kappaskin_app.features.contact.readouts import FIELDS, Readouts


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


def test_a_force_that_leaves_out_a_stretch_is_shown_as_a_lower_bound(readouts: Readouts) -> None:
    scene = load_scene("centre")
    estimate = Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, lambda: 0.0))
    sure = replace(estimate, contact=replace(estimate.contact, force_is_lower_bound=False))

    readouts.show_estimate(sure)
    plain = readouts.text("force")
    readouts.show_estimate(estimate)

    assert readouts.text("force") == f"\N{GREATER-THAN OR EQUAL TO} {plain}"


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
