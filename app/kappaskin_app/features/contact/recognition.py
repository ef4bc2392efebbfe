"""Object recognition: description of the object in contact, computed in the background."""

import time
from dataclasses import replace

from PySide6.QtCore import QObject, Signal

from kappaskin._text import with_error
from kappaskin.bases import basis_for
from kappaskin.contact import (
    NO_OBJECT,
    ContactObject,
    ImprintObjects,
    ObjectFinder,
    as_one,
    object_finder,
)
from kappaskin.estimation import estimator_for
from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin.mechanics import Plate
from kappaskin.pipeline import Setup
from kappaskin.sensing import Sensor
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.widgets.parts import capital
from kappaskin_app.widgets.text import Coverage

_UNFIT = "; press it straight at one place: it may touch at several or with its rim"
_AT_EDGE = "shape unknown (contact at the edge)"
_SNAPS = "shape unknown (the skin snaps through)"
_AS_ONE = "as one object: "  # of two contacts
_DRIFTING = "no object is named while readings drift: tare at rest"
_PREPARING = "Computing the model readings of objects on this skin\N{HORIZONTAL ELLIPSIS}"


def curvature_text(estimate: Estimate) -> str:
    """The end of a text: principal curvatures of the skin at a contact; empty near the rim."""
    if not estimate.contact.present or estimate.contact.near_rim:
        return ""
    found = zip(estimate.geometry.principal, estimate.geometry.principal_sd, strict=True)
    bars = Coverage.now
    one, other = (with_error(value, bars.of(sd), "1/m", sign="+") for value, sd in found)
    return f"; principal curvatures {one} and {other} ({bars.label})"


def object_text(found: ContactObject, estimate: Estimate) -> str:
    """Text of the object that was found in an estimate."""
    as_one = _AS_ONE if estimate.second.present else ""
    return f"{as_one}{found.describe()}{'' if found.fits else _UNFIT}"


def age_text(recognised: Estimate | None, shown: Estimate) -> str | None:
    """How much older what was recognised is than the estimate shown; None if of another contact."""
    if recognised is None:
        return ""
    age = shown.host_time - recognised.host_time
    if recognised.contact.present != shown.contact.present or not 0 <= age < _OLD:
        return None
    return f" ({age:.1f} s ago)" if age > _LATE else ""


_LATE, _OLD = 0.7, 5.0  # s from which an age is shown, and nothing any more
_SETTLED, _KEPT = 0.9, 2.0  # s that a kind must be sure to be named, and may be unsure while named
_OF_NOW = ("position", "position_95", "force", "force_95")  # fields that are never of an older one


class SteadyObject:
    """The object as it is named: its kind is sure for a while first, and is kept for a while."""

    def __init__(self) -> None:
        self._kind, self._since = "", 0.0
        self._named, self._until = NO_OBJECT, 0.0

    def __call__(self, found: ContactObject, now: float) -> ContactObject:
        """What is named of an object `found` at `now` in s; without a sure kind it has none."""
        kind = found.kind if found.sure else ""
        if kind != self._kind:
            self._kind, self._since = kind, now
        if not found.probability:
            self._named = NO_OBJECT
        elif kind and (kind == self._named.kind or now - self._since >= _SETTLED):
            self._named, self._until = found, now + _KEPT
        elif now >= self._until:
            self._named = NO_OBJECT
        if not self._named.kind:
            return replace(found, kind="")
        return replace(self._named, **{name: getattr(found, name) for name in _OF_NOW})


class ObjectRecognition(QObject):
    """Recognises the object in contact in the background, one estimate at a time.

    `described` emits the text, its end that it may do without, and the estimate that it is of, None
    for a text that is not of one; `found` the object and the estimate that it was recognised in.
    Estimates that arrive meanwhile are skipped.
    """

    described = Signal(str, str, object)
    found = Signal(ContactObject, Estimate)

    def __init__(self, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        words = "Computing the readings of objects"
        self._preparation = BackgroundTask(tasks, words, self._set_finder, self._set_finder)
        self._recognition = BackgroundTask(tasks, "", self._finish)
        self._key: tuple[int, Plate, str, str, tuple[int, int]] | None = None
        self._finder: ObjectFinder | ImprintObjects | str = ""
        self._steady = SteadyObject()

    def start(self, status: Status, estimate: Estimate | None) -> None:
        """Recognise the object of an estimate, once the readings of objects are computed."""
        sensor = status.sensor
        if estimate is None or sensor is None:
            self._recognition.stop()
            self.described.emit("", "", None)
        elif self._key != (key := (status.connections, *_skin(sensor, status.setup))):
            self._key = key
            self._preparation.run(_finder, sensor, *key[1:])
        elif self._preparation.running:
            self.described.emit(_PREPARING, "", None)
        elif estimate.generation == status.generation and not self._recognition.running:
            self._recognition.run(_recognise, self._finder, estimate)

    def _set_finder(self, finder: ObjectFinder | ImprintObjects | Exception) -> None:
        """Store the finder, or the reason why there is none."""
        self._finder = str(finder) if isinstance(finder, Exception) else finder

    def _finish(self, recognised: tuple[str, ContactObject, Estimate]) -> None:
        what, found, estimate = recognised
        found = self._steady(found, time.monotonic())
        what = what or object_text(found, estimate)
        more = "".join(what.partition("; ")[1:])  # the second guess, or a cause
        self.described.emit(capital(what), more, estimate)
        self.found.emit(found, estimate)


def _skin(sensor: Sensor, setup: Setup) -> tuple[Plate, str, str, tuple[int, int]]:
    """The skin, its edge, the estimator and its functions, as the setup has them."""
    known = setup.calibration
    plate = known.plate(sensor.plate) if known else sensor.plate
    across = 1 if plate.patch.strip else setup.Nj
    return plate, setup.edge or sensor.edge, setup.method, (setup.Ni, across)


def _finder(
    sensor: Sensor, plate: Plate, edge: str, method: str, functions: tuple[int, int]
) -> ObjectFinder | ImprintObjects:
    basis, layout = basis_for(plate.patch, edge, *functions), sensor.layout
    return object_finder(plate, layout, edge, estimator_for(method, basis, layout, sensor.sigma))


def _recognise(
    finder: ObjectFinder | ImprintObjects | str, estimate: Estimate
) -> tuple[str, ContactObject, Estimate]:
    if isinstance(finder, str):
        found, what = NO_OBJECT, finder
    elif estimate.contact.no_force:
        found, what = NO_OBJECT, _AT_EDGE if estimate.contact.near_rim else _SNAPS
    elif estimate.drift:  # which is in the readings still
        found, what = NO_OBJECT, _DRIFTING
    else:
        whole = as_one(estimate.contact, estimate.second)
        found = finder(estimate.curvature, estimate.noise, whole)
        what = ""
    return what, found, estimate
