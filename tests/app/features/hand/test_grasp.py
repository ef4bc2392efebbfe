"""What is held, of the estimates of all fingers."""

import numpy as np
import pytest

from kappaskin import Pipeline, Simulator, load_scene
from kappaskin.hand import Finger, Grasp, finger_contact, placement
from kappaskin.live import Status
from kappaskin.pipeline import usual_setup
from kappaskin_app.features.hand.grasp import (
    FingerReading,
    GraspRecognition,
    held_text,
    sums_of,
)
from kappaskin_app.shell.background import Tasks


@pytest.fixture(scope="module")
def readings():
    """Two readings of one flat skin, and the contacts that the pipeline's own fit has."""
    scene = load_scene("centre")
    setup = usual_setup(scene.sensor())
    pipeline, found, contacts = Pipeline(scene.sensor(), setup), [], []
    for n, name in enumerate(("left", "right")):
        finger = Finger(name, "sim:", (0.1 * n, 0.0, 0.0), position_sd=1e-4)
        where = placement(finger.position, finger.rotation)
        estimate = pipeline(Simulator(scene).frame(n, lambda: 0.0))
        status = Status(sensor=scene.sensor(), setup=setup, connections=n)
        found.append(FingerReading(finger, where, status, estimate))
        contacts.append(finger_contact(finger, where, estimate, pipeline.fitted))
    return found, contacts


def test_the_contacts_are_those_of_the_pipeline(qapp, until, readings):
    tasks, told = Tasks(), []
    recognition = GraspRecognition(tasks)
    recognition.found.connect(lambda *both: told.append(both))
    recognition.start(readings[0])
    until(lambda: told != [])
    tasks.close()
    grasp, held = told[0]
    for found, expected in zip(grasp.contacts, readings[1], strict=True):
        np.testing.assert_allclose(found.position, expected.position, rtol=1e-9)
        np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-6)
    assert held.reason == ""


def test_a_finger_whose_setup_has_changed_meanwhile_is_left_out(qapp, until, readings):
    (first, second), tasks, told = readings[0], Tasks(), []
    recognition = GraspRecognition(tasks)
    recognition.found.connect(lambda *both: told.append(both))
    gone = FingerReading(second.finger, second.where, Status(), second.estimate)
    recognition.start([first, gone])
    until(lambda: told != [])
    tasks.close()
    assert [one.finger for one in told[0][0].contacts] == ["left"]
    assert held_text(told[0][1]) == "unknown: two contacts or more tell it"


def test_sums_have_their_error_bars_and_are_unknown_with_an_unknown_force(readings):
    first, second = readings[1]
    texts = sums_of(Grasp([first, second]))
    assert texts["Sum of forces"].startswith("x ")
    assert texts["Sum of forces"].count("\N{PLUS-MINUS SIGN}") == 3
    assert texts["Sum of forces"].endswith(" N")
    assert texts["Sum of moments"].endswith(" N mm")
    object.__setattr__(second, "force", float("nan"))
    assert sums_of(Grasp([first, second]))["Sum of forces"] == "\N{EN DASH} N"
