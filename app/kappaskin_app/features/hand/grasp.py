"""Grasp: what the fingers hold and the sum of their forces, computed in the background."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from PySide6.QtCore import QObject, Signal

from kappaskin._text import NONE, rounded
from kappaskin.bases import basis_for
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.estimation import Estimator, estimator_for
from kappaskin.frames import Array, Estimate
from kappaskin.hand import (
    Finger,
    FingerContact,
    Grasp,
    HeldObject,
    Placement,
    find_held_object,
    finger_contact,
)
from kappaskin.live import Status
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.widgets.text import Coverage


@dataclass(frozen=True, eq=False)
class FingerReading:
    """An estimate of a finger, the status that it came with, and where the skin was."""

    finger: Finger
    where: Placement
    status: Status
    estimate: Estimate


class GraspRecognition(QObject):
    """Recognises what is held; `found` brings the grasp and the object, one after the other."""

    found = Signal(Grasp, HeldObject)

    def __init__(self, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._task = BackgroundTask[tuple[Grasp, HeldObject]](
            tasks, "", lambda both: self.found.emit(*both)
        )
        self._estimators = dict[str, tuple[object, Estimator]]()

    def start(self, readings: list[FingerReading]) -> None:
        """Recognise what is held, unless that still runs."""
        if not self._task.running:
            self._task.run(self._recognise, readings)

    def _recognise(self, readings: list[FingerReading]) -> tuple[Grasp, HeldObject]:
        contacts = [one for one in map(self._contact, readings) if one is not None]
        return Grasp(contacts), find_held_object(contacts)

    def _contact(self, reading: FingerReading) -> FingerContact | None:
        estimate = reading.estimate
        try:
            estimator = self._estimator(reading.finger.name, reading.status, estimate)
            fit = estimator(np.where(np.isfinite(estimate.residual), estimate.curvature, np.nan))
        except (Refusal, RankDeficient):  # of another setup than the estimate, or too few readings
            return None
        noise = np.array(estimate.noise)
        fit = replace(fit, coefficients=estimate.coefficients, known_noise=noise)
        return finger_contact(reading.finger, reading.where, estimate, fit)

    def _estimator(self, finger: str, status: Status, estimate: Estimate) -> Estimator:
        """The estimator of the finger, made once for its sensor and setup."""
        sensor, setup, shape = status.sensor, status.setup, estimate.coefficients.shape
        if sensor is None:
            raise Refusal("expected a sensor; got none")
        edge = setup.edge or sensor.edge
        key = status.connections, setup.method, edge, setup.rim_sd, shape
        if self._estimators.get(finger, (None,))[0] != key:
            basis = basis_for(sensor.layout.patch, edge, *shape)
            made = estimator_for(setup.method, basis, sensor.layout, sensor.sigma, setup.rim_sd)
            self._estimators[finger] = key, made
        return self._estimators[finger][1]


def held_text(held: HeldObject) -> str:
    """What is held, in words."""
    return "unknown: two contacts or more tell it" if held.reason else held.describe()


def sums_of(grasp: Grasp) -> Mapping[str, str]:
    """The sum of the forces on what is held, and of their moments, with their error bars."""
    off = Coverage.now.of(np.sqrt(np.diag(grasp.covariance)))
    return {
        "Sum of forces": f"{_vector(grasp.force, off[:3])} N",
        "Sum of moments": f"{_vector(1e3 * grasp.moment, 1e3 * off[3:])} N mm",
    }


def _vector(values: Array, off: Array) -> str:
    parts = [rounded(value, sd) for value, sd in zip(values.tolist(), off.tolist(), strict=True)]
    if any(text == NONE for text, _ in parts):
        return NONE
    return ", ".join(
        f"{axis} {text} \N{PLUS-MINUS SIGN} {bar}"
        for axis, (text, bar) in zip("xyz", parts, strict=True)
    )
