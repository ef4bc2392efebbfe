"""Region scanning: errors on a moving contact, compared with full scans."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.estimation import Region, ScanTradeoff
from kappaskin.frames import Array, Estimate
from kappaskin.live import track_region
from kappaskin.mechanics import PointLoad
from kappaskin.pipeline import Pipeline, Setup
from kappaskin.scenes import TABLE_1_NOISE, Orbit, Scene, load_scene
from kappaskin.sensing import SECOND_GENERATION
from kappaskin.sources import SimulatedSource, VirtualClock
from kappaskin.studies.accuracy import root_mean_square

PERIODS = (4.0, 1.0, 0.25)
"""Seconds per turn of the contact: 35, 138 and 553 mm/s on a circle of 22 mm."""

_FASTEST = 1e6  # frames/s asked for: as many as the scan allows
REGIONS = (
    Region(Region.OFF),
    *(Region(Region.SKIN, radius=radius, rate=_FASTEST) for radius in (0.015, 0.025, 0.035)),
    *(Region(Region.SKIN, radius=0.025, share=share, rate=_FASTEST) for share in (0.05, 0.2)),
)
TRACKED = (
    Region(Region.OFF),
    Region(Region.SKIN, radius=0.0195, rate=_FASTEST),  # a fifth of the channels
    Region(Region.TURNS, share=0.2, rate=_FASTEST),
    Region(Region.ADAPTIVE, share=0.2, rate=_FASTEST),
)
ROWS = (
    *((region, "least-squares") for region in REGIONS),
    *((region, "tracking") for region in TRACKED),
)
"""Regions, each with the method that the shape is fitted by."""
_POINTS = 33  # of the surface, along each side
_SETTLED = 0.1  # s, left out of the measurement
_SECONDS = 1.0  # of each row


def scene_of(period: float) -> Scene:
    """Table 1's centred load going round every `period` s, read at the paper's 20 us."""
    circle = load_scene("circle")
    orbit = Orbit(0.022, period)
    full_rate = 1 / SECOND_GENERATION.scan_time(3 * len(circle.layout))
    moving = circle.touched_by(*circle.loads, motion=orbit)
    return replace(moving, transduction=SECOND_GENERATION, rate=full_rate)


@dataclass(frozen=True, eq=False)
class _TimedEstimate:
    """An estimate, with when its scan began and ended in s and how many channels that read."""

    estimate: Estimate
    began: float
    ended: float
    channels: int


def _answers(scene: Scene, region: Region, seconds: float, method: str) -> list[_TimedEstimate]:
    """The estimates of the closed loop: each contact moves the region that the next frame scans."""
    clock = VirtualClock()
    source = SimulatedSource(scene, clock, clock.sleep)
    pipeline = Pipeline(source.sensor, Setup(nx=_POINTS, ny=_POINTS, method=method), clock=clock)
    steering = track_region(source, region)
    answers: list[_TimedEstimate] = []
    while clock.now < seconds:
        for frame in source.read(seconds):
            estimate = pipeline(frame)
            duration = scene.transduction.scan_time(len(frame.channels))
            began = frame.device_time
            answers.append(_TimedEstimate(estimate, began, began + duration, len(frame.channels)))
            if steering is not None:
                steering(estimate.contact, pipeline.fit)
    return [answer for answer in answers if answer.began >= _SETTLED]


class _TruthErrors:
    """Errors of estimates against the truth at any time, in mm."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._basis = scene, scene.basis
        self._compliance = scene.plate.compliance(self._basis)
        self._surface = self._basis.on_grid(*scene.plate.patch.grid(_POINTS, _POINTS))

    def __call__(self, estimate: Estimate, time: float) -> tuple[float, float]:
        """Distance of the contact and RMS of the shape from the truth at `time`."""
        (load,) = self._scene.loads_at(time)
        off = estimate.contact.position - load.centre()
        w = self._surface(self._compliance(load.modal(self._basis)))
        return 1e3 * math.hypot(*off), 1e3 * root_mean_square(estimate.surface - w)


def _rms(errors: list[tuple[float, float]]) -> Array:
    return np.sqrt(np.nanmean(np.square(errors), axis=0))


def measured(
    period: float, region: Region, seconds: float, method: str = "least-squares"
) -> dict[str, Any]:
    """One row of `run_regions`: a contact that goes round every `period` s, for `seconds`.

    `method` names the estimator, one of `METHODS`.
    """
    if not _SETTLED + 0.1 <= seconds < math.inf:
        raise Refusal(f"expected at least {_SETTLED + 0.1} s to measure over, got {seconds}")
    scene = scene_of(period)
    answers, error = _answers(scene, region, seconds, method), _TruthErrors(scene)
    own = _rms([error(a.estimate, (a.began + a.ended) / 2) for a in answers])
    # An answer is the newest from its own end to that of the next.
    newest = _rms([error(a.estimate, (a.ended + b.ended) / 2) for a, b in pairwise(answers)])
    (load,) = scene.loads_at(0.0)
    x, y = (float(along) for along in load.centre())
    bounds = ScanTradeoff.of(scene.sensor(), region, PointLoad(x, y, load.force), TABLE_1_NOISE)
    return {
        "speed_mm_s": 1e3 * 2 * math.pi * 0.022 / period,
        "method": method,
        "around": region.around,
        "radius_mm": 1e3 * region.radius if region.around == Region.SKIN else None,
        "share": None if region.around == Region.OFF else region.share,
        "channels": float(np.mean([a.channels for a in answers])),
        "rate": (len(answers) - 1) / (answers[-1].began - answers[0].began),
        "found": float(np.mean([a.estimate.contact.present for a in answers])),
        "bound_mm": 1e3 * math.hypot(*bounds.bound[:2]),
        "contact_mm": float(own[0]),
        "shape_mm": float(own[1]),
        "newest_contact_mm": float(newest[0]),
        "newest_shape_mm": float(newest[1]),
    }


def run_regions() -> list[dict[str, Any]]:
    """Contact and shape errors, RMS in mm, of full scans and of regions around the contact.

    Each row is a closed loop of one second, on a skin that moves while a frame is read:
    `contact_mm` and `shape_mm` against the truth in the middle of the frame's own scan,
    `newest_...` against the truth while the estimate is the newest there is, as a controller sees
    it. `bound_mm` is how well one frame can locate the contact where the circle begins (see
    `contact_bound`); readings held from earlier frames add to that. `found` is the share of frames
    with a contact.
    """
    return [
        measured(period, region, _SECONDS, method) for period in PERIODS for region, method in ROWS
    ]


def regions_text(rows: list[dict[str, Any]]) -> str:
    """The rows of `run_regions` under a heading."""
    lines = [
        "A contact on a circle, 20 us per channel; RMS errors of contact and shape in mm,",
        "of each frame in the middle of its scan, and while it is the newest estimate",
        f"{'mm/s':>6}  {'method':<14}{'around':<10}{'radius':>6}{'share':>7}{'channels':>10}"
        f"{'frames/s':>10}{'contact':>9}{'newest':>8}{'shape':>8}{'newest':>8}",
    ]
    for row in rows:
        radius = "" if row["radius_mm"] is None else format(row["radius_mm"], ".1f")
        share = "" if row["share"] is None else format(row["share"], ".0%")
        lines.append(
            f"{row['speed_mm_s']:>6.0f}  {row['method']:<14}{row['around']:<10}{radius:>6}"
            f"{share:>7}{row['channels']:>10.0f}{row['rate']:>10.0f}{row['contact_mm']:>9.3f}"
            f"{row['newest_contact_mm']:>8.3f}{row['shape_mm']:>8.3f}"
            f"{row['newest_shape_mm']:>8.3f}"
        )
    return "\n".join(lines)
