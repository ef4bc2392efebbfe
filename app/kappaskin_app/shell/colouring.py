"""An estimate to the numbers that the skin and the heatmaps show, in the units of the screen."""

import time
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kappaskin.bases import basis_for
from kappaskin.errors import RankDeficient
from kappaskin.estimation import Estimator, estimator_for
from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin.pipeline import ErrorBars, Quantities
from kappaskin_app.shell.shades import SHADES

Array = NDArray[np.float64]

_AGAIN = 0.5  # s after which error bars that depend on the readings themselves are made anew


class _Made(NamedTuple):
    """Error bars of one setup and one set of readings; None where these decide no shape."""

    key: tuple[object, ...]
    bars: ErrorBars | None
    at: float


class Colouring:
    """Makes what a quantity takes when it is first asked for, error bars in a thread of its own."""

    def __init__(self) -> None:
        self._status = Status()
        self._key: tuple[object, ...] = ()
        self._quantities: Quantities | None = None
        self._thread = ThreadPoolExecutor(1, "error-bars")
        self._job: Future[_Made] | None = None
        self._made = _Made((), None, 0.0)
        self._estimator: tuple[object, Estimator] | None = None

    def follow(self, status: Status) -> None:
        """Take up which sensor and setup the next estimates are of."""
        self._status = status

    def quantities(self, estimate: Estimate) -> Quantities | None:
        """What tells the numbers of `estimate`; None while it is of another sensor."""
        sensor, setup = self._status.sensor, self._status.setup
        if sensor is None or estimate.curvature.shape[1] != len(sensor.layout):
            return None
        shapes = estimate.coefficients.shape, estimate.surface.shape
        key = (self._status.meetings, estimate.generation, *shapes)
        if key != self._key:
            basis = basis_for(sensor.layout.patch, setup.edge or sensor.edge, *shapes[0])
            ny, nx = shapes[1]
            self._key, self._quantities = key, Quantities(sensor.layout, basis, nx, ny)
        return self._quantities

    def on_surface(self, name: str, estimate: Estimate) -> Array:
        """The values (ny, nx) of a quantity that there is at every point of the skin."""
        found = self._asked(name, estimate)
        if found is None:
            return np.full(estimate.surface.shape, np.nan)
        return SHADES[name].scale * found.on_surface(name, estimate)

    def of_elements(self, name: str, estimate: Estimate) -> Array:
        """The values (P,) of a quantity."""
        found = self._asked(name, estimate)
        if found is None:
            return np.full(estimate.curvature.shape[1], np.nan)
        return SHADES[name].scale * found.of_elements(name, estimate)

    def at_rest(self, name: str, estimate: Estimate) -> float:
        """What a skin at rest has of a quantity."""
        found = self.quantities(estimate)
        return 0.0 if found is None else SHADES[name].scale * found.at_rest(name)

    def _asked(self, name: str, estimate: Estimate) -> Quantities | None:
        found = self.quantities(estimate)
        if found is not None and name == "error_bar":
            found.error_bars = self.error_bars(estimate)
        return found

    # Error bars: a moment for each set of readings, longer with many functions.

    def error_bars(self, estimate: Estimate) -> ErrorBars | None:
        """Those of the setup of `estimate`, as soon as they are known."""
        if self._job is not None and self._job.done():
            job, self._job = self._job, None
            self._made = job.result()
        found = self.quantities(estimate)
        if found is None or not np.isfinite(estimate.noise):
            return None
        used = np.isfinite(estimate.residual)
        key = (*self._key, used.tobytes())
        made, now = self._made, time.monotonic()
        anew = self._estimator is not None and self._estimator[1].has_prior
        if self._job is None and (made.key != key or (anew and now - made.at > _AGAIN)):
            readings = np.where(used, estimate.curvature, np.nan)
            self._job = self._thread.submit(self._make, key, found, self._status, readings)
        return made.bars if made.key[:-1] == self._key else None

    def _make(
        self, key: tuple[object, ...], found: Quantities, status: Status, readings: Array
    ) -> _Made:
        setup = status.setup
        if self._estimator is None or self._estimator[0] is not found:
            layout = found.layout
            how = estimator_for(setup.method, found.basis, layout, rim_sd=setup.rim_sd)
            self._estimator = found, how
        try:
            bars = ErrorBars(self._estimator[1], readings, *found.grid)
        except (RankDeficient, MemoryError):
            bars = None
        return _Made(key, bars, time.monotonic())

    def close(self) -> None:
        self._thread.shutdown(wait=True, cancel_futures=True)
