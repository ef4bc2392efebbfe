"""The errors of differences between two setups are those that fresh noise makes."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from kappaskin import Estimate, Frame, Pipeline, Setup, Simulator, load_scene
from kappaskin.calibration import Calibration
from kappaskin.live import DifferenceErrors, compared_readouts, reading_noise
from kappaskin.scenes import Scene
from kappaskin.sensing import PrandtlIshlinskii

SCENE = load_scene("off-centre")
QUIET = replace(SCENE, stimuli=())
SENSOR = SCENE.sensor()
COUNT = 300
LIMIT = 0.2  # four standard deviations of the ratio of two spreads, each of so many frames


def calibrated(spread: float, loops: bool = False) -> Calibration:
    rng = np.random.default_rng(3)
    made = Calibration.nominal(SENSOR, datetime(2026, 1, 1, tzinfo=UTC))
    C = SENSOR.channels
    gain = 1 + spread * rng.uniform(-1, 1, C)
    weights, one = np.full((1, C), 0.1), np.ones(C)
    play = PrandtlIshlinskii(np.full((1, C), 50.0), weights, 0.7 * one, one) if loops else None
    return replace(made, gain=gain, hysteresis=play)


def frames(scene: Scene, seed: int, count: int) -> list[Frame]:
    simulator = Simulator(replace(scene, seed=seed))
    return [simulator.frame(n, lambda: 0.0) for n in range(count)]


def differences(a: Setup, b: Setup, count: int, length: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Differences (count, n) of B and A, and the hypot (n,) of their errors, with other noise.

    Each of the last of `length` frames.
    """
    found, naive = [], []
    pipelines = [Pipeline(SENSOR, each) for each in (a, b)]
    at_rest = [pipeline.state() for pipeline in pipelines]
    for seed in range(1, count + 1):
        read = frames(SCENE, seed, length)
        last = []
        for pipeline, state in zip(pipelines, at_rest, strict=True):
            pipeline.fit.restart()
            if not pipeline.fit.has_memory:
                pipeline.restore(state)
            for frame in read[:-1]:
                pipeline.pass_over(frame)
            last.append(compared_readouts(pipeline(read[-1])))
        found.append([other.value - one.value for one, other in zip(*last, strict=True)])
        naive.append([np.hypot(one.sd, other.sd) for one, other in zip(*last, strict=True)])
    return np.array(found), np.mean(naive, axis=0)


def predicted(a: Setup, b: Setup, count: int, length: int = 1) -> np.ndarray:
    read = frames(SCENE, 10_000, 60)
    times = np.array([frame.device_time for frame in read])
    nominal = np.array([SENSOR.nominal(frame).reshape(3, -1) for frame in read])
    pair = list[Estimate]()
    for setup in (a, b):
        pipeline = Pipeline(SENSOR, setup)
        for frame in read[: length - 1]:
            pipeline.pass_over(frame)
        pair.append(pipeline(read[length - 1]))
    noise = reading_noise(times, nominal, None)
    return DifferenceErrors(SENSOR, a, b)(pair[0], pair[1], noise, count, 60.0)


@pytest.mark.cases("a0-b0", "a4-b4")
@pytest.mark.parametrize(
    ("a", "b", "length"),
    [
        (Setup(), Setup(6, 6), 1),
        (Setup(), Setup(method="bayes"), 1),
        (Setup(), Setup(calibration=calibrated(0.2)), 1),
        (Setup(calibration=calibrated(0.1)), Setup(6, 6, calibration=calibrated(0.3)), 1),
        (Setup(), Setup(calibration=calibrated(0.1, loops=True)), 5),
        pytest.param(Setup(), Setup(6, 6, method="finite-slope"), 1, marks=pytest.mark.full),
        pytest.param(Setup(method="robust"), Setup(7, 7), 1, marks=pytest.mark.full),
        pytest.param(Setup(), Setup(method="tracking"), 20, marks=pytest.mark.full),
    ],
)
def test_the_spread_of_differences_is_as_predicted_and_not_the_hypot_of_errors(
    a: Setup, b: Setup, length: int
) -> None:
    made, naive = differences(a, b, COUNT, length)
    spread = made.std(axis=0, ddof=1)
    # Of a filtered contact, place and force hardly differ, and less exactly known.
    changed = (spread > 1e-9) & (np.arange(len(spread)) > 2 * (b.method == "tracking"))
    assert changed[3:].all()  # depth and curvatures
    ratios = predicted(a, b, COUNT, length)[changed] / spread[changed]
    np.testing.assert_allclose(ratios, 1.0, atol=LIMIT)
    assert (naive[changed] / spread[changed] > 1 + LIMIT).all()


def test_equal_setups_do_not_differ() -> None:
    assert not predicted(Setup(), Setup(), 20).any()


def test_nothing_is_known_without_a_contact() -> None:
    frame, a, b = frames(QUIET, 1, 1)[0], Setup(), Setup(6, 6)
    one, other = (Pipeline(SENSOR, each)(frame) for each in (a, b))
    assert np.isnan(DifferenceErrors(SENSOR, a, b)(one, other)).all()


def test_noise_is_measured_though_the_skin_moves_and_not_across_a_gap() -> None:
    rng, times = np.random.default_rng(1), np.arange(60) / 500
    nominal = 30 * times[:, None, None] + 0.2 * rng.standard_normal((60, 3, 100))
    sigma = np.full((3, 100), 0.1)
    assert reading_noise(times, nominal, None) == pytest.approx(0.2, rel=0.05)
    assert reading_noise(times, nominal, sigma) == pytest.approx(2.0, rel=0.05)
    jumped = nominal + 50 * (times > times[29])[:, None, None]
    apart = times + (times > times[29])
    assert reading_noise(apart, jumped, None) == pytest.approx(0.2, rel=0.05)
    assert np.isnan(reading_noise(times[:20], nominal[:20], None))
    assert np.isnan(reading_noise(60 * times, nominal, None))


def test_without_a_measured_noise_it_is_the_least_that_a_fit_leaves() -> None:
    a, b = Setup(), Setup(4, 4)
    frame = frames(SCENE, 1, 1)[0]
    one, other = (Pipeline(SENSOR, each)(frame) for each in (a, b))
    assert one.noise < other.noise
    errors = DifferenceErrors(SENSOR, a, b)
    known = errors(one, other, one.noise, 20)
    assert np.array_equal(errors(one, other, count=20), known)
    assert known[3:].all()
