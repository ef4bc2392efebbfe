"""What tracking costs, against the time its readings take and against one multiplication."""

import time
from dataclasses import replace

import numpy as np

from kappaskin import LeastSquares, Simulator, SineBasis, Tracking, load_scene
from kappaskin.sensing import SECOND_GENERATION

SCENE = replace(load_scene("circle"), transduction=SECOND_GENERATION, rate=160.0)
SENSOR = SCENE.sensor()
BASIS = SineBasis(SCENE.plate.patch, 8, 8)
INTERVAL = SENSOR.scan().interval


class Played:
    """Scans of `count` channels in turn, read again and again."""

    def __init__(self, count, dtype=np.float64):
        self.fit, self._time = Tracking(BASIS, SCENE.layout, dtype=dtype), 0.0
        frame = Simulator(SCENE).frame(0, time.monotonic)
        self._whole, self._count, self._n = SENSOR.nominal(frame), count, 0
        self.duration = count * INTERVAL

    def __call__(self):
        scanned = (self._n + np.arange(self._count)) % 300
        K, t = np.full(300, np.nan), np.full(300, np.nan)
        K[scanned] = self._whole[scanned]
        t[scanned] = self._time + INTERVAL * np.arange(self._count)
        self._n, self._time = self._n + self._count, self._time + self.duration
        return self.fit.follow(K.reshape(3, -1), t.reshape(3, -1))

    def choose(self):
        return self.fit.choose(self._count, np.array([0.05, 0.05]), self.duration / 2)


def test_tracking_takes_no_longer_than_its_readings(medians, figure, ratio) -> None:
    part, whole, rough = Played(60), Played(300), Played(60, np.float32)
    plain, K = LeastSquares(BASIS, SCENE.layout), np.zeros((3, 100))
    square = np.random.default_rng(0).normal(size=(128, 128))

    of_part, of_whole, in_single, alone, product = medians(
        part, whole, rough, lambda: plain(K), lambda: square @ square
    )

    figure(
        f"tracking 60 of 300 channels with 64 functions takes {of_part * 1e3:.2f} ms, "
        f"{of_part / part.duration:.2f} of the scan, in float32 {in_single / part.duration:.2f}; "
        f"all 300 {of_whole / whole.duration:.2f}; that is {of_part / product:.0f} and "
        f"{of_whole / product:.0f} products of two 128 x 128 matrices "
        f"({product * 1e6:.0f} us), least squares {alone / product:.1f}"
    )
    ratio("tracking 60 of 300 channels, against a product", of_part / product, at_most=30)
    ratio("tracking 300 channels, against a product", of_whole / product, at_most=90)


def test_choosing_the_next_channels_takes_less_than_scanning_them(medians, figure, ratio) -> None:
    part = Played(60)
    for _ in range(10):
        part()
    square = np.random.default_rng(0).normal(size=(128, 128))

    choosing, product = medians(part.choose, lambda: square @ square)

    figure(
        f"choosing the next 60 of 300 channels takes {choosing * 1e3:.2f} ms, "
        f"{choosing / part.duration:.2f} of the scan, {choosing / product:.0f} products of two "
        "128 x 128 matrices"
    )
    ratio("choosing the next 60 channels, against a product", choosing / product, at_most=30)
