"""Where a touch is in the course of time, and how hard it presses."""

import math

import numpy as np
import pytest

from kappaskin import Refusal
from kappaskin.scenes import Orbit
from kappaskin.scenes.stimulus import (
    EASES,
    HoldStep,
    MotionPath,
    MotionStep,
    Pose,
    PressStep,
    RecordedMotion,
    ReleaseStep,
    SlideStep,
    TapStep,
    TurnStep,
)

SOMEWHERE = Pose(0.01, -0.02, 0.7, 0.3)
STEPS = {
    "press": (PressStep(0.4, to=0.5), Pose(0.01, -0.02, 0.5, 0.3)),
    "hold": (HoldStep(0.4), SOMEWHERE),
    "release": (ReleaseStep(0.4), Pose(0.01, -0.02, 0.0, 0.3)),
    "slide": (SlideStep(0.4, by=(0.03, 0.01)), Pose(0.04, -0.01, 0.7, 0.3)),
    "turn": (TurnStep(0.4, by=-0.5), Pose(0.01, -0.02, 0.7, -0.2)),
    "linear": (SlideStep(0.4, "linear", (0.03, 0.01)), Pose(0.04, -0.01, 0.7, 0.3)),
}
every_step = pytest.mark.parametrize(("step", "end"), STEPS.values(), ids=STEPS)


def numbers(pose: Pose) -> np.ndarray:
    return np.array([pose.dx, pose.dy, pose.amount, pose.turn])


@every_step
def test_a_step_leads_from_where_it_begins_to_its_end_and_stays_between(
    step: MotionStep, end
) -> None:
    begin, last = numbers(SOMEWHERE), numbers(end)

    way = np.array([numbers(step.at(SOMEWHERE, t)) for t in np.linspace(0, step.seconds, 21)])

    np.testing.assert_allclose(numbers(step.end(SOMEWHERE)), last, atol=1e-15)
    np.testing.assert_allclose(way[[0, -1]], [begin, last], atol=1e-15)
    np.testing.assert_allclose(way[10], (begin + last) / 2, atol=1e-15)  # eases are symmetric
    assert (np.diff(way, axis=0) * np.sign(last - begin) >= 0).all()


@every_step
def test_before_and_after_its_time_a_step_stands_still(step: MotionStep, end) -> None:
    for early, late in ((-1.0, 0.0), (9.0, step.seconds)):
        assert step.at(SOMEWHERE, early) == step.at(SOMEWHERE, late)


def test_a_smooth_step_begins_and_ends_without_speed_and_without_a_jerk() -> None:
    s = np.polynomial.Polynomial.fit(
        x := np.linspace(0, 1, 9), [EASES["smooth"](v) for v in x], 5, domain=[0, 1], window=[0, 1]
    )
    for derivative in (s.deriv(1), s.deriv(2)):
        np.testing.assert_allclose(derivative(np.array([0.0, 1.0])), 0, atol=1e-9)
    assert (s(0.0), s(1.0)) == pytest.approx((0, 1), abs=1e-12)


@pytest.mark.parametrize("ease", EASES)
def test_no_step_goes_beyond_its_end_by_rounding(ease: str) -> None:
    late = 1 - 2.0**-53 * np.arange(5000)
    assert max(EASES[ease](s) for s in late.tolist()) == 1
    path = MotionPath((PressStep(0.3, ease), ReleaseStep(0.1, ease)))
    assert min(path.at(n / 60).amount for n in range(600)) == 0


@pytest.mark.parametrize("times", [1, 2, 5])
def test_taps_press_so_many_times_and_rest_as_long_in_between(times: int) -> None:
    tap = TapStep(2.0, times=times)
    at = (np.arange(9000) + 0.5) * tap.seconds / 9000

    amount = np.array([tap.at(SOMEWHERE, t).amount for t in at])

    pressing = amount > 0
    assert np.sum(np.diff(pressing.astype(int)) == -1) == times - 1  # it is pressing at the end
    assert pressing.mean() == pytest.approx(times / (2 * times - 1), abs=1e-3)
    peaks = [amount[part].max() for part in np.split(np.arange(9000), 2 * times - 1)[::2]]
    assert peaks == pytest.approx([1.0] * times, abs=1e-5)
    assert amount[pressing].mean() == pytest.approx(0.5, abs=1e-3)  # of a squared sine
    assert numbers(tap.at(SOMEWHERE, 0.7))[[0, 1, 3]].tolist() == [0.01, -0.02, 0.3]
    for t in (-1.0, 0.0, 2.0, 3.0):
        assert tap.at(SOMEWHERE, t).amount == pytest.approx(0.0, abs=1e-15)
    assert tap.end(SOMEWHERE).amount == 0
    path = MotionPath((HoldStep(1.0), tap))
    assert path.moments == [0.0, 1.0, pytest.approx(1.0 + 1.0 / (2 * times - 1)), 3.0]
    assert path.at(path.moments[2]).amount == pytest.approx(1.0)


PATH = MotionPath(
    (
        PressStep(0.5),
        SlideStep(1.0, by=(0.02, 0.0)),
        TurnStep(0.25, by=0.4),
        HoldStep(0.25),
        ReleaseStep(1.0),
    )
)


def test_a_path_goes_through_its_steps_and_begins_anew() -> None:
    ends = [
        Pose(amount=0.0),
        Pose(),
        Pose(0.02),
        Pose(0.02, turn=0.4),
        Pose(0.02, turn=0.4),
    ]

    assert PATH.duration == 3.0
    assert PATH.moments == [0.0, 0.5, 1.5, 1.75, 2.0, 3.0]
    assert [PATH.at(t) for t in PATH.moments[:-1]] == ends
    assert PATH.at(1.0) == Pose(0.01)
    assert PATH.at(2.5).amount == pytest.approx(0.5)
    for t in (0.3, 1.2, 2.9):
        assert numbers(PATH.at(t + 2 * PATH.duration)) == pytest.approx(numbers(PATH.at(t)))


def test_nothing_jumps_along_a_path() -> None:
    fine = np.array([numbers(PATH.at(t)) for t in np.arange(0, 2.9999, 1e-3)])
    assert np.abs(np.diff(fine, axis=0)).max() < 5e-3


def test_a_path_that_ends_where_it_began_need_not_be_lifted() -> None:
    there_and_back = (PressStep(1.0), PressStep(1.0, to=0.0), SlideStep(1.0, by=(0.1, 0.0)))
    assert MotionPath(there_and_back).at(2.9).dx > 0.09
    with pytest.raises(Refusal, match=r"0\.1 and 0 m away with 1 of the load"):
        MotionPath((PressStep(1.0), SlideStep(1.0, by=(0.1, 0.0))))


def test_a_record_is_straight_between_its_times_and_begins_anew() -> None:
    record = RecordedMotion(
        np.array([0.0, 1.0, 3.0]), np.array([[0, 0, 0], [0.01, 0.02, 1.0], [0.03, 0.0, 0.5]])
    )

    assert record.duration == 3.0
    assert record.moments == pytest.approx([0.0, 1.0, 3.0])
    assert numbers(record.at(record.moments[-1])) == pytest.approx([0.03, 0.0, 0.5, 0])
    assert numbers(record.at(0.25)) == pytest.approx([0.0025, 0.005, 0.25, 0])
    assert numbers(record.at(2.0)) == pytest.approx([0.02, 0.01, 0.75, 0])
    assert numbers(record.at(3.25)) == pytest.approx(numbers(record.at(0.25)))


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: Orbit(-0.01, 2.0), "a radius >= 0 m"),
        (lambda: HoldStep(0.0), "a step that takes"),
        (lambda: PressStep(1.0, to=1000.5), "share of 0 to 1000 to press to, got 1000.5"),
        (lambda: PressStep(1.0, to=-0.1), "share of 0 to 1000"),
        (lambda: HoldStep(1.0, "sudden"), "ease among smooth, linear, got 'sudden'"),
        (lambda: SlideStep(1.0, by=(0.0, math.inf)), "a finite distance \\(dx, dy\\)"),
        (lambda: TurnStep(1.0, by=math.nan), "finite angle"),
        (lambda: TapStep(1.0, times=0), "1 to 1000 taps, got 0"),
        (lambda: TapStep(1.0, times=1001), "1 to 1000 taps, got 1001"),
        (lambda: RecordedMotion(np.zeros(1), np.zeros((1, 3))), "at least two times"),
        (lambda: RecordedMotion(np.arange(3.0), np.zeros((3, 2))), "poses \\(T, 3\\)"),
        (lambda: RecordedMotion(np.array([0.5, 1.0]), np.zeros((2, 3))), "begin with 0"),
        (
            lambda: RecordedMotion(np.array([0.0, 1.0, 1.0]), np.zeros((3, 3))),
            "at increasing times",
        ),
        (lambda: RecordedMotion(np.array([0.0, 2e9]), np.zeros((2, 3))), "a record of"),
        (lambda: RecordedMotion(np.array([0.0, 1e-9]), np.zeros((2, 3))), "a record of 1e-06 to"),
        (
            lambda: RecordedMotion(np.arange(2.0), np.array([[0, 0, -0.1], [0, 0, 1]])),
            "got -0.1 to 1",
        ),
    ],
)
def test_what_no_touch_can_do_is_refused(make, why: str) -> None:
    with pytest.raises(Refusal, match=why):
        make()


def test_the_extremes_that_a_touch_can_do_are_allowed() -> None:
    assert PressStep(1e-6, to=1000.0).end(Pose()).amount == 1000
    assert TapStep(1.0, times=1000).times == 1000
    assert Orbit(0.0, 1e9).at(2.5e8) == Pose(0.0, 0.0)
    least = RecordedMotion(np.array([0.0, 1e-6]), np.array([[0, 0, 0], [0, 0, 1000.0]]))
    assert least.duration == 1e-6
