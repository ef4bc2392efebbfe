"""An accuracy asked for to the cheapest setting that reaches it, or to what is missing."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from kappaskin.errors import Refusal
from kappaskin.scenes import Scene
from kappaskin.studies.cost.choice import cheapest
from kappaskin.studies.cost.setting import ALL, Cost, Refused, own_elements
from kappaskin.studies.cost.table import row

_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6}


def length_of(text: str) -> float:
    """Metres of a text such as 0.02mm, 20um or 2e-5m."""
    found = re.fullmatch(r"\s*([0-9.]+(?:e[-+]?[0-9]+)?)\s*(m|mm|[uµμ]m)\s*", text, re.ASCII | re.I)
    try:
        metres = float(found[1]) * _UNITS[found[2].lower()] if found else math.nan
    except ValueError:  # such as 1.2.3
        metres = math.nan
    if not 0 < metres < math.inf:
        raise Refusal(
            "expected an accuracy above zero with its unit, mm, um or m, such as 0.02mm; got "
            f"{text!r:.80}"
        )
    return metres


@dataclass(frozen=True)
class Verdict:
    """Whether an accuracy is `reached`, the setting's `cost` and what to say about it.

    `cost` is that of the cheapest setting that reaches it; when none does, that of the most
    accurate one.
    """

    reached: bool
    cost: Cost | None
    said: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The verdict as JSON values."""
        return {
            "reached": self.reached,
            "setting": None if self.cost is None else row(self.cost),
            "said": list(self.said),
        }


def verdict(scene: Scene, costs: Sequence[Cost | Refused], within: float) -> Verdict:
    """Which of the `costs` measured on `scene` reaches an RMS error of `within` m most cheaply.

    Cheapest is the one whose answer is there first: conversion and arithmetic together.
    """
    found = cheapest(costs, within)
    if found is not None:
        said = (f"{_mm(within)} is reached; with the least time by", *described(found))
        return Verdict(True, found, (*said, *_besides(scene, costs, within, found)))
    known = [cost for cost in costs if isinstance(cost, Cost)]
    if not known:
        return Verdict(False, None, ("No setting that was tried gives a shape.",))
    best = min(known, key=lambda cost: cost.rms)
    said = f"{_mm(within)} is reached by none of {len(known)} settings; nearest is"
    return Verdict(False, best, (said, *described(best), *_missing(scene, known, within)))


def _mm(length: float) -> str:
    return f"{1e3 * length:.3g} mm"


def _s(time: float) -> str:
    return f"{1e6 * time:.3g} us" if time < 1e-3 else f"{1e3 * time:.3g} ms"


def elements_text(cost: Cost) -> str:
    """The elements of a cost, as 10 x 10, or their number where they are the scene's own."""
    return "{} x {}".format(*cost.setting.elements) if cost.setting.elements else f"{cost.count}"


def described(cost: Cost) -> tuple[str, ...]:
    """A setting and its figures, in three lines."""
    s = cost.setting
    scanned = f"{'all' if s.scanned == ALL else s.scanned + ','} {cost.channels} channels scanned"
    return (
        f"  {s.method}, {s.functions[0]} x {s.functions[1]} functions, {s.precision}, "
        f"{elements_text(cost)} elements, {scanned}",
        f"  RMS error {_mm(cost.rms)}, {_mm(cost.rms_exact)} without noise; at the load "
        f"{1e3 * cost.e:+.3f} +- {1e3 * cost.e_sd:.3f} mm",
        f"  an answer after {_s(cost.total_time)}: {_s(cost.conversion_time)} of conversion, "
        f"{_s(cost.time_per_frame)} of arithmetic",
    )


def _besides(
    scene: Scene, costs: Sequence[Cost | Refused], within: float, found: Cost
) -> list[str]:
    """What else must be known of the setting `found`: other elements, a lower rate."""
    said: list[str] = []
    own = own_elements(scene)
    if found.setting.elements != own:
        mine = [c for c in costs if isinstance(c, Cost) and c.setting.elements == own]
        with_mine = cheapest(mine, within)
        nearest = min(mine, key=lambda cost: cost.rms, default=None)
        if with_mine is not None:
            said += ["That is another sensor; with the scene's own elements", *described(with_mine)]
        elif nearest is not None:
            said += ["The scene's own elements do not reach it; nearest is", *described(nearest)]
    slowest = max(found.conversion_time, found.time_per_frame)
    if slowest * scene.rate > 1 + 1e-9:
        what, remedy = "computing a frame", "a faster computer"
        if found.conversion_time > found.time_per_frame:
            each = 1e6 / scene.rate / found.channels
            what, remedy = "a scan", f"a converter that takes {each:.3g} us per channel"
        said.append(
            f"At the scene's {scene.rate:g} frames/s {what} may take {_s(1 / scene.rate)}, not "
            f"{_s(slowest)}: it needs {remedy}, or at most {1 / slowest:.0f} frames/s."
        )
    return said


def _missing(scene: Scene, known: Sequence[Cost], within: float) -> list[str]:
    """What it would take to reach `within`, which none of `known` does."""
    whole = [cost for cost in known if cost.setting.scanned == ALL] or known
    able = [cost for cost in whole if cost.rms_exact < within]
    if not able:
        least = min(whole, key=lambda cost: cost.rms_exact)
        Ni, Nj = least.setting.functions
        return [
            f"Missing are functions, and elements that tell them apart: without noise the error is "
            f"{_mm(least.rms_exact)}",
            f"at best, with {Ni} x {Nj} functions on {elements_text(least)} elements. Neither a "
            "faster conversion nor more time helps.",
        ]
    cost = min(able, key=lambda cost: math.ceil(_times(cost, within)) * cost.total_time)
    (Ni, Nj), times = cost.setting.functions, _times(cost, within)
    frames = math.ceil(times)
    return [
        f"Missing are readings: without noise {Ni} x {Nj} functions on {elements_text(cost)} "
        f"elements reach {_mm(cost.rms_exact)}. It takes {times:.2g} times as many:",
        f"  more elements: {_more_elements(scene, cost, times)}",
        f"  or more time: about {frames} frames averaged, {_s(frames * cost.total_time)} for an "
        "answer, while the load rests",
    ]


def _times(cost: Cost, within: float) -> float:
    """How many times the readings of `cost` bring its error down to `within`."""
    # Independent noise: its share of the error goes with 1 / sqrt(readings).
    return (cost.rms**2 - cost.rms_exact**2) / (within**2 - cost.rms_exact**2)


def _more_elements(scene: Scene, cost: Cost, times: float) -> str:
    if cost.setting.elements is None or scene.layout.patch.strip:
        count = math.ceil(cost.count * times)
        name = f"{count} elements"
    else:
        m, n = (math.ceil(along * math.sqrt(times)) for along in cost.setting.elements)
        count, name = m * n, f"{m} x {n} elements"
    allowed, now = 1 / scene.rate / (3 * count), scene.transduction.channel_time
    if allowed >= now:
        return f"about {name}, which the conversion allows at {scene.rate:g} frames/s"
    return (
        f"about {name}, at {scene.rate:g} frames/s with a conversion {now / allowed:.2g} times as "
        f"fast, {1e6 * allowed:.2g} us per channel"
    )
