"""Effects at work on 300 channels, each against a bare copy and sum of 300 numbers."""

import numpy as np
import pytest

from kappaskin import Patch, SensorLayout, SineBasis, Transduction
from kappaskin.scenes.effects import (
    SECOND_GENERATION_LOOPS,
    Creep,
    DroppedFrames,
    FiniteSlopeEffect,
    GaussianNoise,
    IntermittentElements,
    Quantisation,
    Saturation,
    StrainLimit,
    StuckElements,
    Temperature,
    Tolerance,
    UniformNoise,
)
from kappaskin.scenes.effects.electronics import CrossTalk, FlickerNoise, MainsHum
from kappaskin.sensing import Amplifier, HalfBridge

READINGS, CHANNELS = (3, 100), 300
EFFECTS = [
    StrainLimit(Transduction(HalfBridge(substrate_thickness=1e-3)), 0.2),
    SECOND_GENERATION_LOOPS,
    Creep(0.03, 20.0),
    Temperature(15.0, 0.5, 0.3, spread=0.2, gain=2e-4),
    Tolerance(0.05, 3.0),
    IntermittentElements((0, 12, 77), on=0.2, off=0.1),
    MainsHum(0.3),
    CrossTalk(0.02),
    FlickerNoise(0.3),
    GaussianNoise(0.3),
    UniformNoise(0.3),
    Saturation(Transduction(amplifier=Amplifier(gain=400.0))),
    Quantisation(Transduction()),
    StuckElements((1, 40), since=0.3),
]
X = np.random.default_rng(0).normal(0, 30, READINGS)
Y = X[:, ::-1].copy()


def bare():
    return X.copy() + Y


def ticking(running):
    """The effect at work on a frame every 2 ms."""
    frames = iter(range(10**9))
    return lambda: running(X, next(frames) / 500)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_an_effect_takes_a_few_microseconds_a_frame(effect, medians, figure, ratio) -> None:
    work = ticking(effect.start(READINGS, np.random.default_rng(0)))

    ours, baseline = medians(work, bare, turns=60, calls=100)

    figure(
        f"{effect.name} on {CHANNELS} channels: {ours * 1e6:.1f} us, {ours / baseline:.1f} times a "
        f"bare copy and sum ({baseline * 1e6:.2f} us)"
    )
    ratio(f"{effect.name}, against a copy and sum", ours / baseline, at_most=60)


def test_finite_slopes_take_a_few_times_the_operator(medians, figure, ratio) -> None:
    patch = Patch(0.1, 0.1)
    basis, layout = SineBasis(patch, 15, 15), SensorLayout.regular(patch, 10, 10)
    c = np.random.default_rng(0).normal(0, 1e-4, (15, 15))
    M, sensed = layout.operator(basis), FiniteSlopeEffect().sensed(basis, layout)

    ours, baseline = medians(lambda: sensed(c), lambda: M @ c.ravel(), turns=60, calls=100)

    figure(
        f"finite-slope, 15 x 15 functions to 300 channels: {ours * 1e6:.1f} us, "
        f"{ours / baseline:.1f} times the bare operator ({baseline * 1e6:.1f} us)"
    )
    ratio("finite-slope, against the bare operator", ours / baseline, at_most=10)


def test_a_link_tells_of_a_frame_in_a_few_microseconds(medians, figure, ratio) -> None:
    hit, frames = DroppedFrames(0.1).start(np.random.default_rng(0)), iter(range(10**9))

    ours, baseline = medians(lambda: hit(next(frames)), bare, turns=60, calls=100)

    figure(
        f"dropped-frames: {ours * 1e6:.1f} us a frame, {ours / baseline:.1f} times a bare copy and "
        f"sum of {CHANNELS} numbers"
    )
    ratio("dropped-frames, against a copy and sum", ours / baseline, at_most=60)
