"""Simulator: the counts that a real device would send for a scene, and the truth."""

import math
import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kappaskin.bases import Basis, CurvatureMap, ProductBasis, SineBasis
from kappaskin.frames import COMPONENTS, Array, Frame, Truth
from kappaskin.mechanics import Load, Plate, deflection_of
from kappaskin.scenes.effect_plan import effects_of, kept_effects
from kappaskin.scenes.effects import (
    CorruptedFrames,
    DroppedFrames,
    Effect,
    FiniteSlopeEffect,
    GageLength,
    ReadingEffect,
    Skew,
    SkinEffect,
    Temperature,
)
from kappaskin.scenes.scene import AppliedLoads, LoadingHistory, Playback, Scene
from kappaskin.sensing import Scan, SensorLayout

_ROOM = 20.0  # degrees Celsius
_TOLD = 24  # functions along a side: finer waves move a skin by less than 0.3 % under a point load

_FROM_THE_BEGINNING = Playback()


class Simulator:
    """Makes the frames of a scene; they repeat with a seed if requested in the same order.

    Only the effects that the scene calls for are there. With skew, each channel is read at its own
    instant of the scan, on a skin that moves meanwhile; the truth that comes with a frame is that
    of its start. On a flat, hinged skin `frame` and `scanned` tell at most 24 x 24 functions of it,
    so that recordings stay small. Every effect draws from a random stream of its own.
    """

    def __init__(self, scene: Scene, playing: Playback = _FROM_THE_BEGINNING) -> None:
        self.scene, self.playing = scene, playing
        self._still: Truth | None = None
        self._kept = kept_effects(scene)
        self._take_skin()
        self._start_effects()

    def change(self, scene: Scene) -> None:
        """Continue with other loads, motion or effects; changed effects restart.

        Another list of them, another seed or another number of elements does.
        """
        was, self.scene, self._still = self.scene, scene, None
        before, self._kept = self._kept, kept_effects(scene)
        same_elements = _same_elements(scene.layout, was.layout)
        skin = (scene.plate, scene.edge, scene.reference, scene.layout.gage_length)
        same_skin = skin == (was.plate, was.edge, was.reference, was.layout.gage_length)
        if not (same_elements and same_skin and _of_skin(before) == _of_skin(self._kept)):
            self._take_skin()
        else:
            self._take_stimuli()
        same_size = scene.layout.channels == was.layout.channels
        reading = scene.seed, _of_readings(self._kept)
        if not same_size or reading != (was.seed, _of_readings(before)):
            self._start_effects()

    def play(self, playing: Playback) -> None:
        """Continue the scene at another time, or at another speed."""
        self.playing = playing

    def _pressed(self, time: float) -> AppliedLoads:
        """The loads at device `time` in s."""
        return self._pressing(self.playing.time(time))

    def _take_stimuli(self) -> None:
        """Compute what depends on what touches the skin, and which channels are dead."""
        self._pressing.take(self.scene)
        live = self.scene.layout.live.ravel()
        self._dead = None if live.all() else np.flatnonzero(~live)

    def _start_effects(self) -> None:
        P = len(self.scene.layout)
        shape = self._frame_shape = self.scene.layout.channels // P, P
        self._effects = [
            (effect.start(shape, _stream(self.scene.seed, effect.name)), effect.at_once)
            for effect in _of_readings(self._kept)
        ]
        self._link = [
            (effect.name, effect.start(_stream(self.scene.seed, effect.name)))
            for effect in self._kept
            if isinstance(effect, DroppedFrames | CorruptedFrames)
        ]

    def _take_skin(self) -> None:
        """Compute what depends on the skin alone."""
        scene, plate, layout = self.scene, self.scene.plate, self.scene.layout
        kinds = {type(effect) for effect in self._kept}
        for effect in effects_of(scene).values():
            if isinstance(effect, SkinEffect) and type(effect) not in kinds:
                plate = effect.off(plate)
        if GageLength not in kinds:
            layout = replace(layout, gage_length=0.0)
        self._basis = scene.basis
        self._pressing = LoadingHistory(scene, plate)
        self._deflection = deflection_of(plate, self._basis)
        self._take_stimuli()
        self._skewed = Skew in kinds
        self._scan = scene.sensor().scan()
        sloped = [effect for effect in self._kept if isinstance(effect, FiniteSlopeEffect)]
        if sloped:
            self._sensed = sloped[0].sensed(self._basis, layout, plate)
        else:
            self._sensed = _linear(layout, self._basis, plate)
        flat = isinstance(self._basis, SineBasis) and not any(self._basis.patch.curvatures)
        self._told = (slice(_TOLD), slice(_TOLD)) if flat else ()

    def _truth(self, time: float) -> Truth:
        if self._still is not None:
            return self._still
        pressed = self._pressed(time)
        truth = Truth(self._deflection(pressed.force), pressed.contact, self.scene.edge)
        if not self.scene.moves:
            self._still = truth
        return truth

    def loads(self, time: float) -> tuple[Load, ...]:
        """The loads at device `time` in s; a rigid object as its contact points."""
        return self._pressed(time).loads

    def _read(self, scan: Scan, time: float, truth: Truth) -> Array:
        """Readings (C,) of a scan begun at `time`; channels outside it as at the start."""
        scene, first = self.scene, self._sensed(truth.coefficients)
        if not (scene.moves and self._skewed):
            return first
        # The parabola through start, middle and end, at the share s of the scan.
        middle, last = (
            self._sensed(self._deflection(self._pressed(t).force))
            for t in (time + scan.duration / 2, time + scan.duration)
        )
        s = np.zeros(len(first))
        s[scan.channels] = scan.times / scan.duration
        return first + s * (4 * middle - 3 * first - last + s * 2 * (first + last - 2 * middle))

    def _true(self, scan: Scan, time: float) -> tuple[Truth | None, Array]:
        """The truth, None where coefficients cannot express it, and the readings (C,)."""
        if self.scene.laid is not None:
            laid = self.scene.laid.curvature(self.playing.time(time))
            return None, np.repeat(laid, len(self.scene.layout))
        truth = self._truth(time)
        return truth, self._read(scan, time, truth)

    def reading(self, scan: Scan, time: float) -> tuple[Truth | None, Array]:
        """The truth, and the readings (C,), in 1/m of curvature; dead channels read nothing."""
        truth, curvature = self._true(scan, time)
        curvature = curvature.reshape(self._frame_shape)
        for effect, _ in self._effects:
            curvature = effect(curvature, time)
        curvature = curvature.reshape(-1)
        if self._dead is not None:
            curvature[self._dead] = 0.0
        return truth, curvature

    def readings(self, scan: Scan, times: Array) -> tuple[list[Truth | None], Array]:
        """The truths, and the readings (T, C) of frames at `times` (T,).

        As `reading` gives them one after the other, each effect on all frames before the next. Of
        a skin that nothing moves on there is one truth.
        """
        moments = times.tolist() if self.scene.moves or self.scene.laid else times[:1].tolist()
        truths, each = zip(*(self._true(scan, time) for time in moments), strict=True)
        curvature = np.array(each) if len(each) == len(times) else np.tile(each, (len(times), 1))
        curvature = curvature.reshape(-1, *self._frame_shape)
        for effect, at_once in self._effects:
            if at_once:
                curvature = effect(curvature, math.nan)
            else:
                frames = zip(curvature, times.tolist(), strict=True)
                curvature = np.array([effect(frame, time) for frame, time in frames])
        curvature = curvature.reshape(len(times), -1)
        if self._dead is not None:
            curvature[:, self._dead] = 0.0
        return list(truths), curvature

    def temperature(self, time: float) -> float:
        """The skin's temperature in degrees Celsius at device `time`; NaN where none is simulated.

        It is `_ROOM` at rest.
        """
        warming = [effect for effect in self._kept if isinstance(effect, Temperature)]
        return _ROOM + warming[0].warmer(time) if warming else math.nan

    def failure(self, n: int) -> str:
        """The failure of frame `n` on the link by name; empty if it arrives."""
        return next((name for name, hits in self._link if hits(n)), "")

    def frame(self, n: int, clock: Callable[[], float]) -> Frame:
        """Frame `n` of all channels, begun at device time n / rate."""
        return self.scanned(self._scan, n, n / self.scene.rate, clock)

    def scanned(self, scan: Scan, n: int, time: float, clock: Callable[[], float]) -> Frame:
        """Frame `n` of what `scan` reads, begun at device `time`."""
        truth, curvature = self.reading(scan, time)
        counts = self.scene.transduction.counts(curvature[scan.channels])
        if truth is not None:
            truth = replace(truth, coefficients=truth.coefficients[self._told])
        return Frame(n & 0xFFFFFFFF, time, clock(), scan.channels, counts, truth)


def _same_elements(layout: SensorLayout, other: SensorLayout) -> bool:
    """Whether the same is read at the same places."""
    (kinds, kind), (others, other_kind) = layout.directed, other.directed
    if kinds != others or not np.array_equal(layout.positions, other.positions):
        return False
    return np.array_equal(kind, other_kind) and np.array_equal(layout.element, other.element)


def _linear(layout: SensorLayout, basis: Basis, plate: Plate) -> Callable[[Array], Array]:
    """Coefficients (Ni, Nj) to readings (C,) of the elements; on a grid along x, then y."""
    product = isinstance(basis, ProductBasis) and not basis.patch.arc_curvature
    averaged = layout.gage_length or any(layout.cell)
    if product and layout.shape and not (layout.reads or averaged):
        x, y = layout.positions[: layout.shape[0], 0], layout.positions[:: layout.shape[0], 1]
        maps = [CurvatureMap(basis, component, x, y) for component in COMPONENTS]
        return lambda coefficients: np.concatenate([each(coefficients).ravel() for each in maps])
    operator = layout.operator(basis, plate)
    return lambda coefficients: operator @ coefficients.ravel()


def _of_readings(effects: tuple[Effect, ...]) -> list[ReadingEffect]:
    return [effect for effect in effects if isinstance(effect, ReadingEffect)]


def _of_skin(effects: tuple[Effect, ...]) -> list[Effect]:
    return [effect for effect in effects if not isinstance(effect, ReadingEffect)]


def _stream(seed: int, name: str) -> np.random.Generator:
    """The random stream of one effect, the same whatever others there are."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])
