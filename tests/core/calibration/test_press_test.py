"""Elements pressed one by one: each answer is judged, and the map told from all of them."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from kappaskin import PointLoad, Refusal, SensorLayout, load_scene
from kappaskin.calibration import PressPhase, PressTest
from kappaskin.frames import COMPONENTS
from kappaskin.sources import SimulatedSource

pytestmark = pytest.mark.slow

SCENE = load_scene("centre")
SENSOR = SCENE.sensor()
M = SCENE.layout.operator(SCENE.basis)
NOISE = 0.2
STEP = 0.01  # s


@cache
def under_press_of(element, depth=2e-3):
    """What channels read (300,) while `element` is pressed by `depth` m."""
    x, y = SCENE.layout.positions[element]
    c = SCENE.plate.deflection([PointLoad(x, y, 1.0)], SCENE.basis)
    return M @ c.ravel() * depth / float(SCENE.basis.at(np.array([[x, y]]))[0] @ c.ravel())


class Finger:
    """Presses what a test asks for, on a skin whose channels are read in another `order`."""

    def __init__(self, test, order=None, seed=0):
        self.test, self.time = test, 0.0
        self.order = np.arange(300) if order is None else order
        self.rng = np.random.default_rng(seed)
        self.offset = self.rng.normal(0, 3, 300)

    def read(self, curvature, seconds):
        came = None
        for _ in range(round(seconds / STEP)):
            self.time += STEP
            noisy = curvature + self.offset + self.rng.normal(0, NOISE, 300)
            came = self.test.take(self.time, noisy[self.order]) or came
        return came

    def press(self, element):
        self.read(np.zeros(300), 0.6)
        self.read(under_press_of(element), 0.3)
        return self.read(np.zeros(300), 0.3)

    def press_all(self):
        while (asked := self.test.target) is not None:
            assert self.press(asked) is not None
        return self.test.verdict()


def moved(elements=None, components=None, at=None):
    """Where each channel's reading comes from when elements or components are exchanged."""
    order = np.arange(300).reshape(3, 100)
    if elements is not None:
        order = order[:, elements]
    if components is not None:
        order[:, slice(None) if at is None else at] = order[list(components)][
            :, slice(None) if at is None else at
        ]
    return order.ravel()


def pressed_through(order=None, quick=False):
    return Finger(
        PressTest(SENSOR, PressTest.choose_elements(SCENE.layout, quick)), order
    ).press_all()


@pytest.mark.parametrize("quick", [True, False])
def test_a_map_that_is_right_is_confirmed(quick):
    verdict = pressed_through(quick=quick)

    assert verdict.confirmed
    assert str(verdict).startswith(
        f"channel map confirmed: {20 if quick else 100} elements respond"
    )
    np.testing.assert_array_equal(verdict.order, np.arange(300))


GRID = np.arange(100).reshape(10, 10)  # rows of elements


def exchanged(a, b, axis):
    lines = np.arange(10)
    lines[[a, b]] = b, a
    return np.take(GRID, lines, axis).ravel()


@pytest.mark.cases("True-elements0", "True-elements4", "False-elements1", "False-elements5")
@pytest.mark.parametrize(
    ("elements", "words"),
    [
        (exchanged(3, 4, 0), "rows 3 and 4 are swapped"),
        (exchanged(0, 9, 1), "columns 0 and 9 are swapped"),
        (GRID[::-1].ravel(), "rows are mirrored"),
        (GRID[:, ::-1].ravel(), "columns are mirrored"),
        (GRID[::-1, ::-1].ravel(), "columns are mirrored; rows are mirrored"),
        (GRID.T.ravel(), "columns and rows are exchanged"),
    ],
)
@pytest.mark.parametrize("quick", [True, False])
def test_lines_that_are_exchanged_are_named_and_set_right(elements, words, quick):
    verdict = pressed_through(moved(elements), quick)

    assert not verdict.confirmed
    assert str(verdict) == words
    np.testing.assert_array_equal(moved(elements)[verdict.order], np.arange(300))


def test_two_elements_beside_each_other_that_are_swapped_are_named():
    elements = np.arange(100)
    elements[[12, 13]] = 13, 12

    verdict = pressed_through(moved(elements))

    assert str(verdict) == "elements 12 and 13 are swapped"
    np.testing.assert_array_equal(moved(elements)[verdict.order], np.arange(300))


def test_elements_that_go_round_are_told_in_their_order():
    elements = np.arange(100)
    elements[[12, 45, 77]] = 45, 77, 12

    verdict = pressed_through(moved(elements))

    assert str(verdict).startswith("elements are exchanged: 12 reads as ")
    np.testing.assert_array_equal(moved(elements)[verdict.order], np.arange(300))


def told_of(components):
    first, second = (COMPONENTS[c] for c in range(3) if components[c] != c)
    return f"{first} and {second} are swapped"


@pytest.mark.cases("True-components0", "False-components3")
@pytest.mark.parametrize("components", [(1, 0, 2), (2, 1, 0), (0, 2, 1), (1, 2, 0)])
@pytest.mark.parametrize("quick", [True, False])
def test_components_that_are_exchanged_are_told_and_set_right(components, quick):
    order = moved(components=components)
    test = PressTest(SENSOR, PressTest.choose_elements(SCENE.layout, quick))
    finger = Finger(test, order)

    verdict = finger.press_all()

    assert not verdict.confirmed
    assert str(verdict).startswith(
        "components are exchanged: xx reads as " if components == (1, 2, 0) else told_of(components)
    )
    np.testing.assert_array_equal(order[verdict.order], np.arange(300))


def test_components_of_one_element_that_are_swapped_are_told():
    order = moved(components=(1, 0, 2), at=34)

    verdict = pressed_through(order)

    assert str(verdict) == "xx and yy are swapped of element 34"
    np.testing.assert_array_equal(order[verdict.order], np.arange(300))


def test_rows_and_components_may_be_exchanged_at_once():
    order = moved(exchanged(2, 7, 0), components=(1, 0, 2))

    verdict = pressed_through(order, quick=True)

    assert str(verdict) == "rows 2 and 7 are swapped; xx and yy are swapped"
    np.testing.assert_array_equal(order[verdict.order], np.arange(300))


def test_what_is_skipped_or_silent_confirms_no_map():
    test = PressTest(SENSOR, (5, 6, 7))
    finger = Finger(test)
    test.skip()
    test.nothing_came()
    finger.press(7)

    verdict = test.verdict()

    assert not verdict.confirmed
    assert verdict.words == (
        "no error was found: 1 element responds where pressed",
        "element 5 was not pressed",
        "element 6 does not respond, and no other does",
    )


def test_two_fingers_are_not_clear():
    test = PressTest(SENSOR, (22,))
    finger = Finger(test)
    finger.read(np.zeros(300), 0.6)
    finger.read(under_press_of(22) + under_press_of(77), 0.3)

    came = finger.read(np.zeros(300), 0.3)

    assert came.verdict == "unclear"
    assert "22 and 77 respond equally" in str(came) or "77 and 22 respond equally" in str(came)


def test_a_press_between_two_elements_counts_for_the_one_asked_for():
    test = PressTest(SENSOR, (45,))
    finger = Finger(test)
    finger.read(np.zeros(300), 0.6)
    finger.read((under_press_of(44) + under_press_of(45)) / 2 * 0.99, 0.3)

    assert finger.read(np.zeros(300), 0.3).verdict == "ok"


def test_noise_drift_and_a_finger_that_lies_on_already_are_no_press():
    test = PressTest(SENSOR, (45,))
    finger = Finger(test)
    assert finger.read(np.zeros(300), 20.0) is None
    assert test.phase is PressPhase.PRESS

    held = PressTest(SENSOR, (45,))
    finger = Finger(held)
    finger.read(under_press_of(45), 1.0)
    assert finger.read(np.zeros(300), 0.3) is None
    assert held.phase is PressPhase.REST
    assert finger.press(45).verdict == "ok"


def test_a_finger_that_moves_on_without_being_lifted_presses_one_after_the_other():
    test = PressTest(SENSOR, (22, 45, 77, 32))
    finger = Finger(test)
    before = under_press_of(54)
    finger.read(before, 1.0)
    for element in test.elements:
        came, there = None, under_press_of(element)
        for share in np.linspace(0, 1, 12):
            came = finger.read(before + (there - before) * share, 0.02) or came
        came = finger.read(there, 1.5) or came
        assert came.verdict == "ok"
        before = there

    assert test.over


def test_a_press_waits_for_rest():
    test = PressTest(SENSOR, (45,))
    finger = Finger(test)
    for n in range(40):  # goes on moving
        finger.read(under_press_of(45) * (n % 7) / 7, 0.03)
    assert test.phase is PressPhase.REST


def test_back_asks_for_the_last_one_again():
    test = PressTest(SENSOR, (5, 6))
    finger = Finger(test)
    finger.press(77)
    assert [p.verdict for p in test.done] == ["elsewhere"]
    assert str(test.done[0]) == "element 77 responds in place of element 5"

    test.back()

    assert test.target == 5
    assert finger.press(5).verdict == "ok"
    assert test.target == 6


def test_a_strip_has_elements_to_press_but_no_components_to_exchange():
    scene = replace(load_scene("fingertip"), reference=(15, 1))
    test = PressTest(scene.sensor(), PressTest.choose_elements(scene.layout, quick=True))
    operator = scene.layout.operator(scene.basis)
    rng, time = np.random.default_rng(0), 0.0
    for element in (0, 1, 2, 4, 3, 5, 6, 7, 8, 9):
        x, y = scene.layout.positions[element]
        c = scene.plate.deflection([PointLoad(x, y, 1.0)], scene.basis).ravel()
        pressed = operator @ c * scene.layout.live.ravel()
        pressed *= 40 / np.abs(pressed).max()
        for curvature in [0 * pressed] * 60 + [pressed] * 30 + [0 * pressed] * 30:
            time += STEP
            test.take(time, curvature + rng.normal(0, 1.0, 30))

    assert test.over
    assert str(test.verdict()) == "elements 3 and 4 are swapped"


def test_what_cannot_be_pressed_is_refused():
    with pytest.raises(Refusal, match="from 0 to 99"):
        PressTest(SENSOR, (100,))
    with pytest.raises(Refusal, match="from 0 to 99"):
        PressTest(SENSOR, ())
    with pytest.raises(Refusal, match="1 to 400 elements"):
        PressTest.choose_elements(SensorLayout.regular(SCENE.plate.patch, 30, 30), quick=False)
    with pytest.raises(Refusal, match="a test of the channel map: xx, yy and xy"):
        PressTest.choose_elements(SCENE.layout.reading_each(["slope@0", "slope@90"]), quick=True)
    with pytest.raises(Refusal, match=r"readings \(300,\)"):
        PressTest(SENSOR, (1,)).take(0.0, np.zeros(3))


def test_dead_elements_are_not_asked_for():
    layout = SCENE.layout.without([0, 11, 45])

    assert not {0, 11, 45} & set(PressTest.choose_elements(layout, quick=False))
    assert not {0, 11, 45} & set(PressTest.choose_elements(layout, quick=True))


def test_the_command_presses_a_simulation_by_itself_and_confirms_its_map(run):
    code, out, err = run("press", "sim:circle", "--quick")

    assert (code, out) == (0, "channel map confirmed: 20 elements respond where pressed\n")
    assert err.startswith("1/20  press element 0, at (5.0, 5.0) mm, and release it\n    element 0")


def test_the_command_fails_where_the_map_is_not_confirmed(run, monkeypatch):
    read = SimulatedSource.read
    order = moved(exchanged(3, 4, 0))

    def crossed(self, timeout):
        return [replace(f, counts=f.counts[order]) for f in read(self, timeout)]

    monkeypatch.setattr(SimulatedSource, "read", crossed)

    code, out, _ = run("press", "sim:circle", "--quick", "--json")

    told = json.loads(out)
    assert code == 1
    assert told["words"] == ["rows 3 and 4 are swapped"]
    assert order[told["order"]].tolist() == list(range(300))
    assert {p["verdict"] for p in told["pressed"]} == {"ok", "elsewhere"}


def test_the_command_refuses_a_patience_of_nothing(run):
    code, _, err = run("press", "sim:circle", "--patience", "0")

    assert (code, "expected a waiting time above zero" in err) == (2, True)
