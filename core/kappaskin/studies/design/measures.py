"""A block of frames to what a study measures of it."""

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from kappaskin.errors import Refusal
from kappaskin.estimation import Estimator, predicted_sd
from kappaskin.frames import Array
from kappaskin.scenes import Indenter, Scene, kept_effects
from kappaskin.studies.cost.bench import points_on
from kappaskin.studies.design.block import Block

_CALLS = 21  # of a fit that is timed
_SIDE = 21  # points along each side at which error bars are judged, less those on the edges


@dataclass(frozen=True)
class Measure:
    """Something to measure: values (T,) of a block's frames, NaN where a frame tells none.

    `title` is what it is called, `unit` what it is shown in, `scale` how many of those the value's
    own unit has. Where there are no frames to average over, it is one value. A `share` is one of
    something, from nothing to all.
    """

    title: str
    unit: str
    scale: float
    of: Callable[[Block], Array]
    share: bool = False


def _at_load(block: Block) -> Array:
    at = block.estimator.basis.at(block.contact)
    true = np.vecdot(block.scene.basis.at(block.contact), block.true)
    return np.vecdot(at, block.coefficients) - true


def _contact(block: Block) -> Array:
    found = np.array([touch.position for touch in block.touches])
    return np.hypot(*(found - block.contact).T)


def _force(block: Block) -> Array:
    """As a share of the largest force in the block."""
    found, true = np.array([touch.force for touch in block.touches]), block.forces()
    largest = np.abs(true).max()
    return np.abs(found - true) / (largest if largest else np.nan)


def _found(block: Block) -> Array:
    return np.array([float(touch.present) for touch in block.touches])


def _radius_of(block: Block) -> float:
    stimulus = block.scene.indenter
    rigid = stimulus.what.rigid if stimulus and isinstance(stimulus.what, Indenter) else None
    if (radius := getattr(rigid, "radius", None)) is None:
        raise Refusal("expected a sphere or a cylinder that presses to tell errors of its radius")
    return radius


def _radius(block: Block) -> Array:
    true = _radius_of(block)
    off = np.array([abs(found.radius / true - 1) for found in block.objects()])
    return np.where(np.isfinite(off), off, np.nan)


def _covered(block: Block) -> Array:
    """The share of the skin that lies within the 95 % bands, (T,)."""
    patch = block.scene.plate.patch
    x, y = (along[1:-1] for along in patch.grid(_SIDE, 3 if patch.strip else _SIDE))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points = points[patch.contains(points)]
    reach = scipy.special.stdtrit(np.maximum(block.fit.spare, 1), 0.975)
    bands = np.reshape(reach, (-1, 1)) * block.fit.surface_sd(points)
    held = np.mean(np.abs(block.off(points)) <= bands, axis=1)
    return np.where(np.isnan(block.fit.noise), np.nan, held)  # which makes no bands


def noise_of(scene: Scene) -> float:
    """The standard deviation in 1/m of all noise there is that differs from reading to reading."""
    each = [getattr(effect, "rms", 0.0) for effect in kept_effects(scene)]
    return math.hypot(*each)


@lru_cache(8)
def _predicted_rms(estimator: Estimator, noise: float) -> float:
    sd = predicted_sd(estimator, noise, points_on(estimator.basis.patch))
    return float(np.sqrt(np.mean(sd**2)))


def _predicted(block: Block) -> Array:
    if block.estimator.has_prior:  # which counts on other skins than one at rest
        return np.array([np.nan])
    return np.array([_predicted_rms(block.estimator, noise_of(block.scene))])


def _rate(block: Block) -> Array:
    return np.array([block.scene.sensor().scan().rate])


def _time(block: Block) -> Array:
    taken, _ = list[float](), block.fit  # what remembers takes the frames in before
    for K in block.curvature[np.arange(_CALLS) % len(block.curvature)]:
        begun = time.perf_counter()
        block.estimator(K)
        taken.append(time.perf_counter() - begun)
    return np.array([statistics.median(taken)])


MEASURES = {
    "rms": Measure("RMS error of the shape", "mm", 1e3, Block.apart),
    "at-load": Measure("error at the load, signed", "mm", 1e3, _at_load),
    "contact": Measure("distance of the contact found", "mm", 1e3, _contact),
    "force": Measure("error of the force, of the largest", "%", 1e2, _force),
    "found": Measure("frames with a contact found", "%", 1e2, _found, share=True),
    "radius": Measure("error of the object's radius", "%", 1e2, _radius),
    "covered": Measure("skin within the 95 % bands", "%", 1e2, _covered, share=True),
    "predicted": Measure("RMS error by noise alone, predicted", "mm", 1e3, _predicted),
    "rate": Measure("frame rate that the conversions allow", "frames/s", 1.0, _rate),
    "time": Measure("time to fit a frame", "us", 1e6, _time),
}
"""What can be measured, by name; lengths in m, rates in 1/s, times in s, the others shares of 1.

All but `time` are the same wherever they are computed.
"""
