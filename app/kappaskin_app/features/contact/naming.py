"""Estimates to words: what touches the skin, and how the skin curves there."""

from concurrent.futures import Future, ThreadPoolExecutor

from PySide6.QtCore import QObject, Signal

from kappaskin.contact import NO_OBJECT, ContactObject, ObjectFinder
from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin.live import Status
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
    """Names what touches the skin, at the rate of the display, in a thread of its own.

    `named` brings the words, `found` the object that they tell of and the estimate that it was
    found in. One estimate at a time: those that come meanwhile are passed over.
    """

    named = Signal(str)
    found = Signal(ContactObject, Estimate)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._thread = ThreadPoolExecutor(1, "object-naming")
        self._busy: Future[tuple[str, ContactObject, Estimate]] | None = None
        self._key: tuple[int, str] | None = None
        self._finder: ObjectFinder | str = ""
        self.learning = False

    def look(self, status: Status, estimate: Estimate | None) -> None:
        """Take up what was named, and the next estimate to be named."""
        if self._busy is not None:
            if not self._busy.done():
                if self.learning:
                    self.named.emit(_LEARNING)
                return
            # Forgotten first: what failed once is told once, and the next estimate is named.
            done, self._busy = self._busy, None
            words, *found = done.result()
            self.named.emit(words)
            self.found.emit(*found)
        if estimate is None or status.sensor is None:
            self.named.emit("")
        elif estimate.generation == status.generation:
            self._busy = self._thread.submit(self._look, status, estimate)

    def _look(self, status: Status, estimate: Estimate) -> tuple[str, ContactObject, Estimate]:
        self._meet(status)
        found, what = NO_OBJECT, self._finder
        if not isinstance(what, str):
            found = what(estimate.curvature, estimate.noise, estimate.contact)
            what = found.describe()
        return "; ".join(filter(None, [what, curved(estimate)])), found, estimate

    def _meet(self, status: Status) -> None:
        """Make what depends on the sensor and how its edge is held, or keep why it cannot be."""
        sensor = status.sensor
        if sensor is None:
            return
        key = status.meetings, status.setup.edge or sensor.edge
        if key != self._key:
            self._key, self.learning = key, True
            try:
                self._finder = ObjectFinder(sensor.plate, sensor.layout, key[1])
            except Refusal as refusal:
                self._finder = str(refusal)
            finally:
                self.learning = False

    def close(self) -> None:
        self._thread.shutdown(wait=True, cancel_futures=True)
