"""Estimates to words: what touches the skin, and how the skin curves there."""

from PySide6.QtCore import QObject, Signal

from kappaskin.contact import NO_OBJECT, ContactObject, ObjectFinder
from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.widgets.parts import with_error

_LEARNING = "computing what objects read like on this skin\N{HORIZONTAL ELLIPSIS}"


def curved(estimate: Estimate) -> str:
    """The principal curvatures of the skin at the contact, in words; empty without one."""
    if not estimate.contact.present:
        return ""
    found = zip(estimate.geometry.principal, estimate.geometry.principal_sd, strict=True)
    one, other = (with_error(value, sd, 1, sign="+") for value, sd in found)
    return f"principal curvatures {one} and {other} 1/m"


class Naming(QObject):
    """Names what touches the skin, at the rate of the display, in the background.

    `named` brings the words, `found` the object that they tell of and the estimate that it was
    found in. One estimate at a time: those that come meanwhile are passed over.
    """

    named = Signal(str)
    found = Signal(ContactObject, Estimate)

    def __init__(self, tasks: Tasks, parent: QObject | None = None) -> None:
        super().__init__(parent)
        words = "Learning what objects read like"
        self._learning = BackgroundTask(tasks, words, self._learn, self._learn)
        self._naming = BackgroundTask(tasks, "", self._take)
        self._key: tuple[int, str] | None = None
        self._finder: ObjectFinder | str = ""

    def look(self, status: Status, estimate: Estimate | None) -> None:
        """Take up the next estimate to be named, once it is known what objects read like."""
        sensor = status.sensor
        if estimate is None or sensor is None:
            self._naming.stop()
            self.named.emit("")
        elif self._key != (key := (status.meetings, status.setup.edge or sensor.edge)):
            self._key = key
            self._learning.run(ObjectFinder, sensor.plate, sensor.layout, key[1])
        elif self._learning.running:
            self.named.emit(_LEARNING)
        elif estimate.generation == status.generation and not self._naming.running:
            self._naming.run(_named, self._finder, estimate)

    def _learn(self, finder: ObjectFinder | Exception) -> None:
        """Know what objects read like, or keep why that cannot be."""
        self._finder = str(finder) if isinstance(finder, Exception) else finder

    def _take(self, named: tuple[str, ContactObject, Estimate]) -> None:
        words, *found = named
        self.named.emit(words)
        self.found.emit(*found)


def _named(finder: ObjectFinder | str, estimate: Estimate) -> tuple[str, ContactObject, Estimate]:
    if isinstance(finder, str):
        found, what = NO_OBJECT, finder
    else:
        found = finder(estimate.curvature, estimate.noise, estimate.contact)
        what = found.describe()
    return "; ".join(filter(None, [what, curved(estimate)])), found, estimate
