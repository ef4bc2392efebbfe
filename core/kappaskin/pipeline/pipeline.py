"""Pipeline: a frame of counts to an estimate of shape and contact, factored once per setup."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin._files import Budget, check_memory
from kappaskin._state import StateArrays, Stateful
from kappaskin.bases import Basis, ValueMap, basis_for
from kappaskin.calibration import Calibration, Corrector, DriftMonitor, Rest, Tare
from kappaskin.contact import (
    NO_CONTACT,
    NO_GEOMETRY,
    LargeDeflection,
    LoadDetector,
    contacts_of,
)
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.estimation import METHODS, Fit, check_method, estimator_for
from kappaskin.frames import OVERTAKEN, Array, Estimate, Frame, Mask, Truth
from kappaskin.health import Exclusion, exclude
from kappaskin.pipeline.setup import QUANTITIES, Setup
from kappaskin.sensing import Sensor

REVISION = 7
"""Of the estimates: `python tests/estimates.py` raises it where the same readings give others."""

_LOOSE = 100.0  # times the error bars with every reading: beyond it a shape is undetermined


# Numbers held, as measured: for each of a few hundred channels by the contact; and at most for each
# point of the surface, each product of a channel and a function, and each pair of functions, if it
# tracks them or not.
_PER_CHANNEL, _PER_POINT, _PER_PRODUCT, _PER_TRACKED, _PER_PAIR = 1_300, 6, 4, 24, 4


class FrameAssembly(Stateful):
    """Assembles partial scans: each channel keeps its last reading until that is `age` s old.

    Ages are on the device's clock. A channel that was scanned is never filled in: on a rail it has
    no reading, however recent the last one. A clock that went back, as of a device that restarted,
    keeps nothing from before.
    """

    STATE = ("_values", "_times")

    def __init__(self, channels: int, age: float) -> None:
        if not (math.isfinite(age) and age >= 0):
            raise Refusal(f"expected readings to be held for at least 0 s, got {age}")
        self._age = age
        self._values = np.full(channels, np.nan)
        self._times = np.full(channels, -np.inf)
        self._checked_list, self._list_is_whole = np.empty(0, np.intp), False

    def is_whole(self, frame: Frame) -> bool:
        """Whether every channel was read; counted once for the scans that share one list."""
        if frame.channels is not self._checked_list:
            counts = np.bincount(frame.channels, minlength=len(self._values))
            self._checked_list, self._list_is_whole = frame.channels, bool((counts == 1).all())
        return self._list_is_whole

    def __call__(self, frame: Frame, curvature: Array) -> tuple[Array, Mask]:
        """The readings `curvature` of `frame` with earlier ones, and which of them are new."""
        flat = curvature.ravel()
        if self.is_whole(frame):
            self._values[:] = flat
            self._times.fill(frame.device_time)
            return curvature, np.isfinite(curvature)
        self._times[self._times > frame.device_time + OVERTAKEN] = -np.inf
        self._values[frame.channels] = flat[frame.channels]
        self._times[frame.channels] = frame.device_time
        age = frame.device_time - self._times
        known = (age >= 0) & (age < self._age)
        held = np.where(known, self._values, flat)
        return held.reshape(curvature.shape), np.isfinite(curvature)


@dataclass(frozen=True)
class _Past:
    """The state that earlier frames left: of hysteresis and creep, and the last readings.

    `passed` are frames passed over whose readings are not in it yet.
    """

    correct: Corrector | None
    hold: FrameAssembly
    passed: list[Frame] = field(default_factory=list[Frame])


class Pipeline:
    """Counts to curvature, coefficients, surface and contact: `pipeline(frame)` is the estimate.

    Raises `RankDeficient` when made for a basis that the sensor's readings do not determine, and a
    `Refusal` for a setup too large for the memory, or for the `budget` of the file it is from. A
    frame that lacks too many readings for it gives an estimate whose shape is NaN.
    """

    def __init__(
        self,
        sensor: Sensor,
        setup: Setup,
        generation: int = 0,
        clock: Callable[[], float] = time.monotonic,
        budget: Budget | None = None,
    ) -> None:
        _check_quantities(setup.quantities)
        _check_size(sensor, setup, budget)
        self.wanted = frozenset(setup.quantities)
        """Those of `QUANTITIES` that are computed from the next frame on."""
        self.sensor, self.setup, self.generation, self._clock = sensor, setup, generation, clock
        self.past = _Past(
            self._corrector(setup.calibration), FrameAssembly(sensor.channels, setup.hold)
        )
        self._zero = self._shift(setup.tare)
        edge = setup.edge or sensor.edge
        across = 1 if sensor.layout.patch.strip else setup.Nj
        self.basis = basis_for(sensor.layout.patch, edge, setup.Ni, across)
        layout, rim_sd = sensor.layout, setup.rim_sd
        self.fit = estimator_for(setup.method, self.basis, layout, sensor.sigma, rim_sd)
        self._given_noise = sensor.noise
        self._read_at = sensor.scan().times  # of the first, the second ... channel of a scan
        self._whole = self.fit.at_rest()
        loosest = _LOOSE * float(np.linalg.norm(self._whole.unit_sd))
        self._loosest = math.inf if self.fit.has_prior else loosest
        self._judged, self._determined = self._whole.uncertainty, True
        self._x, self._y = sensor.layout.patch.grid(setup.nx, setup.ny)
        points = np.stack(np.meshgrid(self._x, self._y), axis=-1).reshape(-1, 2)
        on_skin = sensor.layout.patch.contains(points).reshape(setup.ny, setup.nx)
        self._skin = ... if on_skin.all() else on_skin
        self._surface = self.basis.on_grid(self._x, self._y)
        self.drift = None
        if setup.tare is not None:
            self.drift = DriftMonitor(LoadDetector(sensor, edge), self._surface)
        known = setup.calibration and setup.calibration.weights
        plate = known.plate(sensor.plate) if known else sensor.plate
        self._contacts = contacts_of(plate, sensor.layout, self.basis, edge, sensor.sigma)
        self._bounded = LargeDeflection(plate, edge, known.deepest if known else 0.0)
        self.left_out = Exclusion.none(sensor, self._whole, self._ideal())
        self._no_shape = np.full(self.basis.shape, np.nan)
        self._unknown = np.full((setup.ny, setup.nx), np.nan)
        self.fitted: Fit | None = None
        """The fit of the last estimate."""
        self._truths: dict[tuple[object, ...], tuple[Basis, ValueMap]] = {}

    def _ideal(self) -> Fit:
        """The fit to a skin at rest of which no channel is dead."""
        layout = self.sensor.layout
        if layout.lacking.any():
            whole = replace(layout, live=layout.live | layout.lacking)
            setup = self.setup
            sigma = self.sensor.sigma
            estimator = estimator_for(setup.method, self.basis, whole, sigma, setup.rim_sd)
            return estimator.at_rest()
        return self._whole

    def _corrector(self, calibration: Calibration | None) -> Corrector | None:
        if calibration is None:
            return None
        calibration.check(self.sensor)
        return calibration.start()

    def _shift(self, tare: Tare | None) -> Array | None:
        """What is subtracted from the readings (C,) in 1/m, so that rest reads as calibrated."""
        if tare is None:
            return None
        tare.check(self.sensor)
        calibration = self.setup.calibration
        if calibration is None:
            return tare.offset
        return tare.offset - np.nan_to_num(calibration.offset)

    def curvature(self, frame: Frame) -> Array:
        """Readings by the frame's shape; NaN where a channel is dead, unscanned or on a rail.

        With a calibration each frame is to be given once, in order: the loops have a memory.
        """
        return self._corrected(self.sensor.nominal(frame), frame.device_time)

    def _corrected(self, flat: Array, time: float) -> Array:
        if self._zero is not None:
            flat = flat - self._zero
        if self.past.correct is not None:
            flat = self.past.correct(flat, time)
        return flat.reshape(self.sensor.layout.frame_shape)

    def rest(self) -> Rest:
        """The expected readings of a skin that is straight now, without a new tare.

        By the tare in use, or the calibration, and the remanence of hysteresis and creep.
        """
        correct, calibration, tare = self.past.correct, self.setup.calibration, self.setup.tare
        zero = np.zeros(self.sensor.channels)
        if tare is not None:
            zero = tare.offset
        elif calibration is not None:
            zero = np.nan_to_num(calibration.offset)
        return Rest(zero, 0 * zero if correct is None else correct.remanence(), tare)

    def leave_out(self, kinds: NDArray[np.uint8], badness: Array) -> None:
        """Fit from now on without the channels of any of these `kinds` (C,), as many as it can.

        Numbers in `FAULTS`, 0 for a good channel; with the worst by `badness` (C,) goes the first.
        """
        self.left_out = exclude(self.left_out, self.fit, kinds, badness, self._loosest)

    def _followed(self, frame: Frame, curvature: Array, held: Array) -> Fit:
        if not self.fit.has_memory:
            return self.fit(held)
        times = np.full(curvature.size, np.nan)
        times[frame.channels] = frame.device_time + self._read_at[: len(frame.channels)]
        return self.fit.follow(curvature, times.reshape(curvature.shape), held)

    def _with_given_noise(self, fit: Fit) -> Fit:
        """The fit with the noise that the sensor's description gives, if it gives one."""
        noise = self._given_noise
        if math.isnan(noise) or fit.coefficients is self._no_shape:
            return fit
        return replace(fit, known_noise=np.array(noise), weights=np.array(1 / noise))

    def _fitted(self, frame: Frame, curvature: Array, held: Array) -> Fit:
        try:
            fit = self._followed(frame, curvature, held)
            if self._is_determined(fit):
                return fit
        except RankDeficient:
            pass
        unknown = np.full_like(held, np.nan)
        return Fit(
            self.fit, unknown, self._no_shape, self._whole.uncertainty, 0, np.array(math.nan)
        )

    def _is_determined(self, fit: Fit) -> bool:
        """Whether a shape is determined; fits to the same channels mostly share error bars."""
        if fit.uncertainty is not self._judged:
            self._judged, norm = fit.uncertainty, np.linalg.norm(fit.unit_sd)
            self._determined = bool(norm <= self._loosest)
        return self._determined

    def __call__(self, frame: Frame) -> Estimate:
        nominal = self.sensor.nominal(frame)
        scanned = self._corrected(nominal, frame.device_time)
        self._catch_up(frame)
        return self._estimate(frame, nominal, scanned, *self.past.hold(frame, scanned))

    def again(self, curvature: Array, time: float = 0.0) -> Estimate:
        """The estimate of corrected readings `curvature` (3, P) in 1/m, all scanned at `time` in s.

        NaN where missing. To be used by itself: an estimator with a memory gets them as the next.
        """
        frame = Frame(0, time, time, np.arange(self.sensor.channels), np.empty(0, np.int32))
        return self._estimate(frame, curvature, curvature, curvature, np.isfinite(curvature))

    def _estimate(
        self, frame: Frame, nominal: Array, scanned: Array, curvature: Array, fresh: Mask
    ) -> Estimate:
        out = self.left_out
        began = time.perf_counter()
        found = self._fitted(frame, out(scanned), out(curvature))
        fit_time = time.perf_counter() - began
        fit = self.fitted = self._with_given_noise(found)
        noise, wanted = float(fit.noise), self.wanted
        if self.drift is not None:
            self.drift.follow(frame.device_time, curvature, fit.coefficients, noise)
        contact, second, drift, geometry = NO_CONTACT, NO_CONTACT, 0.0, NO_GEOMETRY
        if "contact" in wanted and math.isfinite(noise):
            # By the residuals: a given noise lacks the error of too few functions.
            left = found if math.isfinite(float(found.noise)) else fit
            contact, second = map(self._bounded, self._contacts(fit.readings, left))
            if (drifted := self._contacts.drift) is not None:
                fit, drift = self._with_given_noise(drifted.fit), drifted.size
                self.fitted, noise = fit, float(fit.noise)
        if "geometry" in wanted:
            geometry = self._contacts.geometry(fit, contact)
        surface = self._surface(fit.coefficients) if "surface" in wanted else self._unknown
        return Estimate(
            self.generation,
            frame.sequence,
            frame.device_time,
            frame.host_time,
            frame.taken,
            frame.taken_sd,
            self._clock(),
            nominal.reshape(curvature.shape),
            curvature,
            fresh,
            fit.residual,
            fit.coefficients,
            surface,
            noise,
            out.words(fit.suspect),
            bool(fit.converged),
            fit_time,
            drift,
            contact,
            second,
            geometry,
            *self._compared(surface, fit.coefficients, frame.truth),
        )

    def shape_quantities(
        self, curvature: Array, coefficients: Array, of: Estimate
    ) -> dict[str, Any]:
        """The fields of the estimate `of` that follow from other readings and another shape."""
        surface = self._surface(coefficients)
        at_load = rms = math.nan
        if math.isfinite(of.error_rms):
            off = (surface - of.true_surface)[self._skin].ravel()
            rms = math.sqrt(float(off.dot(off)) / off.size)
        if math.isfinite(of.error_at_load):
            x, y = of.true_contact.tolist()
            at_load = of.error_at_load + self.basis.value(x, y, coefficients - of.coefficients)
        return {
            "residual": curvature - self.fit.predicted(coefficients),
            "surface": surface,
            "error_at_load": at_load,
            "error_rms": rms,
        }

    def continue_from(self, before: "Pipeline") -> None:
        """Continue from the state of `before`, if its readings are of the same sensor and kind."""
        now, was = self.setup, before.setup
        if before.sensor is not self.sensor or now.calibration != was.calibration:
            return
        if (now.tare, now.hold) != (was.tare, was.hold):
            # Another zero does not undo how the skin was bent.
            self.past = _Past(before.past.correct, self.past.hold)
            return
        self.past = before.past
        if _estimator_settings(self) == _estimator_settings(before):
            self.fit = before.fit

    def state(self) -> StateArrays:
        """The state by name, on which estimates depend besides their frames."""
        for earlier in self.past.passed:
            self.past.hold(earlier, self.curvature(earlier))
        self.past.passed.clear()
        found = self.past.hold.state("hold.")
        if self.past.correct is not None:
            found |= self.past.correct.state("correct.")
        if isinstance(self.fit, Stateful):
            found |= self.fit.state("fit.")
        return found

    def restore(self, state: StateArrays) -> None:
        """Continue from the `state` of another pipeline of the same sensor and setup."""
        self.past.hold.restore(state, "hold.")
        if self.past.correct is not None:
            self.past.correct.restore(state, "correct.")
        if isinstance(self.fit, Stateful):
            self.fit.restore(state, "fit.")

    def pass_over(self, frame: Frame) -> None:
        """Take the readings of a frame without an estimate."""
        if self.past.correct is None and not self.fit.has_memory:
            # Readings that a later scan of every channel replaces need never be computed.
            if self.past.hold.is_whole(frame):
                self.past.passed.clear()
            self.past.passed.append(frame)
            return
        self._catch_up(frame)
        curvature = self.curvature(frame)
        held, _ = self.past.hold(frame, curvature)
        if self.fit.has_memory:
            with suppress(RankDeficient):
                out = self.left_out
                self._followed(frame, out(curvature), out(held))

    def _catch_up(self, frame: Frame) -> None:
        """Take the readings of frames passed over, unless `frame` replaces all of them."""
        passed = self.past.passed
        if passed and not self.past.hold.is_whole(frame):
            for earlier in passed:
                self.past.hold(earlier, self.curvature(earlier))
        passed.clear()

    def _compared(
        self, surface: Array, coefficients: Array, truth: Truth | None
    ) -> tuple[Array, Array, float, float]:
        """True surface, true contact, error at the load and RMS; NaN without a truth."""
        if truth is None:
            return self._unknown, self._unknown[0, :2], math.nan, math.nan
        key = truth.edge, *truth.coefficients.shape
        if key not in self._truths:
            basis = basis_for(self.basis.patch, *key)
            self._truths[key] = basis, basis.on_grid(self._x, self._y)
        basis, true_map = self._truths[key]
        true_surface = true_map(truth.coefficients)
        off = (surface - true_surface)[self._skin].ravel()
        rms = math.sqrt(float(off.dot(off)) / off.size)
        x, y = truth.contact.tolist()
        at_load = self.basis.value(x, y, coefficients) - basis.value(x, y, truth.coefficients)
        return true_surface, truth.contact, at_load, rms


def _estimator_settings(pipeline: Pipeline) -> tuple[object, ...]:
    """The settings that the estimator depends on, besides the sensor."""
    setup = pipeline.setup
    return setup.method, pipeline.basis.shape, setup.edge or pipeline.sensor.edge, setup.rim_sd


def pipeline_for(
    sensor: Sensor, setup: Setup, generation: int = 0, smaller: bool = False
) -> tuple[Pipeline, str]:
    """The pipeline of a `setup`; with `smaller`, of as many of its functions as the sensor allows.

    And why it has fewer, empty where it has all. Raises a `Refusal` where there is none.
    """
    refusal, most = "", max(setup.Ni, setup.Nj)
    for limit in range(most, 0 if smaller else most - 1, -1):
        limited = replace(setup, Ni=min(setup.Ni, limit), Nj=min(setup.Nj, limit))
        try:
            return Pipeline(sensor, limited, generation), refusal
        except Refusal as reason:
            refusal = refusal or str(reason)
        except MemoryError:
            refusal = refusal or (
                f"{setup.Ni} x {setup.Nj} functions for {sensor.layout} do not fit in memory; use "
                "fewer"
            )
    raise Refusal(refusal)


def _check_quantities(quantities: tuple[str, ...]) -> None:
    unknown = [name for name in quantities if name not in QUANTITIES]
    if unknown or ("geometry" in quantities and "contact" not in quantities):
        raise Refusal(
            f"expected quantities among {', '.join(QUANTITIES)}, and the contact where the "
            f"geometry is that of, got {', '.join(map(str, quantities))}"
        )


def _check_size(sensor: Sensor, setup: Setup, budget: Budget | None) -> None:
    check_method(setup.method)
    method, numbers = METHODS[setup.method], _PER_POINT * setup.nx * setup.ny
    numbers += _PER_CHANNEL * sensor.channels
    if method.has_matrix:
        N = setup.Ni * (1 if sensor.layout.patch.strip else setup.Nj)
        pairs = _PER_TRACKED if method.has_memory else _PER_PAIR
        numbers += _PER_PRODUCT * sensor.channels * N + pairs * N * N
    part = f"{setup.Ni} x {setup.Nj} functions and {setup.nx} x {setup.ny} points, {setup.method},"
    check_memory(8 * numbers, part)
    if budget is not None:
        budget.take(8 * numbers, part)
