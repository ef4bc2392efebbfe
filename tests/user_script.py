"""What users write, in strict mode: reading, fitting, a plug-in of each kind."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from PySide6.QtWidgets import QLabel

import kappaskin
from kappaskin import (
    Estimate,
    LeastSquares,
    ObjectFinder,
    Patch,
    Pipeline,
    Plate,
    PointLoad,
    Recording,
    Sensor,
    SensorLayout,
    Setup,
    Simulator,
    SineBasis,
    SourceError,
    estimator_for,
    load_calibration,
    load_scene,
)
from kappaskin.estimation import DenseUncertainty, Estimator, Fit
from kappaskin.hand import hand_file, load_hand
from kappaskin.scenes.effects import ReadingEffect, RunningEffect, Size, Survey
from kappaskin.sources import Input, SerialSource, Source, load_description
from kappaskin_app.shell.window import MainWindow

Floats = NDArray[np.float64]


def live() -> list[tuple[float, float]]:
    with kappaskin.feed("glove", sensor="board.toml") as feed:
        feed.push([0.1] * 108, time=time.time())
    with kappaskin.stream("feed:glove") as stream:
        found = [(estimate.contact.force, estimate.contact.force_sd) for estimate in stream]
    for estimates in kappaskin.stream({"thumb": "sim:", "index": "sim:"}):
        print(estimates)
    return found


def fitted() -> float:
    patch = Patch(0.1, 0.1)
    truth, basis = SineBasis(patch, 15, 15), SineBasis(patch, 8, 8)
    layout, grid = SensorLayout.regular(patch, 10, 10), patch.grid(101, 101)
    w = Plate(patch).deflection([PointLoad(0.05, 0.05)], truth)
    curvature = (layout.operator(truth) @ w.ravel()).reshape(3, -1)
    fit = LeastSquares(basis, layout)(curvature)
    other = estimator_for("robust", basis, layout)(curvature)
    error = basis.on_grid(*grid)(fit.coefficients) - truth.on_grid(*grid)(w)
    print(fit.sd, fit.residual, other.coefficients.shape)
    return float(np.sqrt(np.mean(error**2)))


def simulated() -> str:
    scene = load_scene("demo")
    sensor = scene.sensor()
    skin = load_calibration(Path("skin.toml"), sensor, datetime.now(UTC))
    estimate = Pipeline(sensor, Setup(calibration=skin))(Simulator(scene).frame(60, time.monotonic))
    find = ObjectFinder(sensor.plate, sensor.layout, sensor.edge)
    print(estimate.geometry.principal, skin.gain.min())
    return find(estimate.curvature, estimate.noise, estimate.contact).describe()


def recorded(file: Path) -> list[str]:
    recording = Recording(file)
    hand = load_hand(hand_file("hold")).simulated
    for finger, press in hand.at(3.0).presses.items() if hand else ():
        print(finger, press.force)
    return [f"{event.time:.1f} s: {event}" for event in recording.events()]


class Tilting(Input):
    def arriving(self) -> tuple[float, bytes]:
        return time.monotonic(), b"0,0,0\n"


def opened(url: str, sensor: Path | None) -> Source:
    if sensor is None:
        raise SourceError(f"expected --sensor FILE, which describes the readings of {url}")
    return SerialSource(url, description=load_description(sensor), opened=Tilting)


@dataclass(frozen=True)
class Lag(ReadingEffect):
    name = "lag"
    formula = "time constant times the fastest change, over the peak reading"
    example: ClassVar[Mapping[str, Any]] = {"time_constant": 0.05}

    time_constant: float

    def size(self, survey: Survey) -> Size:
        number = survey.share(self.time_constant * survey.rates)
        return Size(number, number)

    def start(self, shape: tuple[int, ...], rng: np.random.Generator) -> RunningEffect:
        last, value = math.inf, np.zeros(shape)

        def read(curvature: Floats, time: float) -> Floats:
            nonlocal last, value
            passed, last = max(time - last, 0.0), time
            value = curvature + math.exp(-passed / self.time_constant) * (value - curvature)
            return value.copy()

        return read


class Ridge(Estimator):
    def _set_up(self) -> None:
        self._mu = 1e-6 * float(np.linalg.norm(self.weight[:, None] * self.M, 2)) ** 2

    def _fit(self, flat: Floats, used: NDArray[np.bool_]) -> Fit:
        A = self.weight[used, None] * self.M[used]
        H = np.linalg.inv(A.T @ A + self._mu * np.eye(A.shape[1])) @ A.T
        c = (self.weight[used] * flat[..., used]) @ H.T
        return self._answer(flat, c, DenseUncertainty(lambda: H @ H.T), max(len(A) - len(H), 0))


class Peak:
    name = "peak"

    def install(self, shell: MainWindow) -> None:
        self.label, self.most = QLabel("no force yet"), 0.0
        about = "The largest contact force since the window opened"
        shell.docks.put_below("peak", "Largest force", self.label, "Ctrl+Alt+9", about)
        shell.session.estimated.connect(self.show)

    def show(self, estimate: Estimate) -> None:
        self.most = max(self.most, estimate.contact.force)


def known(sensor: Sensor) -> str:
    return f"{kappaskin.__version__} {sensor}"
