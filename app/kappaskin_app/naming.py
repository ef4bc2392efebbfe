"""Estimates to words: what touches the skin, and how the skin curves there."""

from concurrent.futures import Future, ThreadPoolExecutor

from PySide6.QtCore import QObject, Signal

from kappaskin import (
    NO_OBJECT,
    ContactObject,
    Estimate,
    Fit,
    LeastSquares,
    ObjectFinder,
    RankDeficient,
    Status,
    basis_for,
)

_Key = tuple[int, int]


class _Finder:
    """What depends on sensor and setup: made once, in the thread that names."""

    def __init__(self, status: Status) -> None:
        sensor, setup = status.sensor, status.setup
        if sensor is None:
            raise ValueError("expected a status with a sensor")
        layout, edge = sensor.layout, setup.edge or sensor.edge
        across = 1 if layout.patch.strip else setup.Nj
        self._fit = LeastSquares(basis_for(layout.patch, edge, setup.Ni, across), layout)
        self._find = ObjectFinder(sensor.plate, layout, edge)

    def __call__(self, estimate: Estimate) -> ContactObject:
        try:
            fit: Fit = self._fit(estimate.curvature)
        except RankDeficient:
            return NO_OBJECT
        return self._find(estimate.curvature, fit, estimate.touch)


def curved(estimate: Estimate) -> str:
    """How the skin curves at the contact, in words; empty without one."""
    geometry = estimate.geometry
    if not estimate.touch.present:
        return ""
    (one, other), (sd, other_sd) = geometry.principal, geometry.principal_sd
    words = (
        f"skin there curves by {one:+.1f} \N{PLUS-MINUS SIGN} {sd:.1f} and "
        f"{other:+.1f} \N{PLUS-MINUS SIGN} {other_sd:.1f} 1/m"
    )
    return words.replace("-", "\N{MINUS SIGN}")


class Naming(QObject):
    """Names what touches the skin, at the rate of the display, in a thread of its own.

    `named` brings the words. One estimate at a time: those that come meanwhile are passed over.
    """

    named = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._thread = ThreadPoolExecutor(1, "object-naming")
        self._busy: Future[str] | None = None
        self._key: _Key | None = None
        self._finder: _Finder | None = None

    def look(self, status: Status, estimate: Estimate | None) -> None:
        """Take up what was named, and the next estimate to be named."""
        if self._busy is not None:
            if not self._busy.done():
                return
            self.named.emit(self._busy.result())
            self._busy = None
        if estimate is None or status.sensor is None:
            self.named.emit("")
        elif estimate.generation == status.generation:
            self._busy = self._thread.submit(self._words, status, estimate)

    def _words(self, status: Status, estimate: Estimate) -> str:
        key = status.meetings, status.generation
        if self._finder is None or key != self._key:
            self._finder, self._key = _Finder(status), key
        found = self._finder(estimate)
        return "; ".join(filter(None, [found.describe(), curved(estimate)]))

    def close(self) -> None:
        self._thread.shutdown(wait=True, cancel_futures=True)
