"""Tracking a skin that is touched again and again: it stays as sound as it began."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from kappaskin import Patch, Plate, PointLoad, SensorLayout, SineBasis
from kappaskin.estimation import Tracking
from kappaskin.frames import Array

pytestmark = pytest.mark.slow

PATCH = Patch(0.1, 0.1)
BASIS = SineBasis(PATCH, 4, 4)
LAYOUT = SensorLayout.regular(PATCH, 5, 5)
OPERATOR = LAYOUT.operator(BASIS)
COMPLIANCE = Plate(PATCH).compliance(BASIS)
CHANNELS, PER_FRAME = 75, 25  # in turn
INTERVAL = 20e-6  # s from one channel to the next
NOISE = 0.3  # 1/m
FORCE = 0.15  # N, about 5 mm
TURN, TOUCHED = 0.7, 0.5  # s for one turn of the contact, and how long of it it presses
BLOCKS, FRAMES = 10, 280  # the contact presses, goes round and lifts twice


def shape_at(time: float) -> Array:
    """Coefficients (N,) at `time` in s, under a contact that goes round, presses and lifts."""
    if time % TURN > TOUCHED:
        return np.zeros(BASIS.size)
    angle = 2 * math.pi * time / TURN
    x, y = 0.05 + 0.02 * math.cos(angle), 0.05 + 0.02 * math.sin(angle)
    return COMPLIANCE(PointLoad(x, y, FORCE).modal(BASIS)).ravel()


def scans(frames: int) -> Iterator[tuple[Array, Array, Array]]:
    """Readings (3, P), their times, and the shape at the last of them."""
    rng, steps = np.random.default_rng(0), np.arange(1, PER_FRAME + 1)
    before = shape_at(0.0)
    for n in range(frames):
        scanned = (n * PER_FRAME + np.arange(PER_FRAME)) % CHANNELS
        K, t = np.full(CHANNELS, np.nan), np.full(CHANNELS, np.nan)
        t[scanned] = (n * PER_FRAME + steps) * INTERVAL
        now = shape_at(float(t[scanned[-1]]))
        moved = np.multiply.outer(steps / PER_FRAME, now - before)
        K[scanned] = np.vecdot(OPERATOR[scanned], before + moved)
        K[scanned] += rng.normal(0.0, NOISE, PER_FRAME)
        yield K.reshape(3, -1), t.reshape(3, -1), now
        before = now


@pytest.mark.cases("float32")
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_it_is_as_good_at_the_end_of_a_run_as_at_its_start(dtype) -> None:
    fit, errors, sds, noises = Tracking(BASIS, LAYOUT, dtype=dtype), [], [], []
    places = np.array([0.02, 0.05, 0.08])
    rows = BASIS.at(np.stack(np.meshgrid(places, places), -1).reshape(-1, 2))

    for K, t, truth in scans(BLOCKS * FRAMES):
        found = fit.follow(K, t)
        errors.append(rows @ (found.coefficients.ravel() - truth))
        sds.append(found.sd_of(rows))
        noises.append(found.noise)

    # Not a number, or zero, where the covariance is no longer definite.
    assert np.min(sds) > 3e-6
    assert np.max(sds) < 0.5e-3
    assert np.mean(np.abs(errors) < 1.96 * np.array(sds)) == pytest.approx(0.95, abs=0.04)
    # A frame in which the contact lifts has readings from before and after.
    by_block = np.reshape(noises, (BLOCKS, -1)).mean(axis=1)
    assert by_block == pytest.approx(np.full(BLOCKS, NOISE), rel=0.15)
    rms = np.sqrt(np.mean(np.reshape(errors, (BLOCKS, -1)) ** 2, axis=1))
    assert rms[5:].mean() < 1.2 * rms[:5].mean()
