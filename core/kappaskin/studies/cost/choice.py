"""Costs to the settings that are worth their time, and to the cheapest that is accurate enough."""

import math
from collections.abc import Iterable

from kappaskin.errors import Refusal
from kappaskin.studies.cost.setting import Cost, Refused

ALIKE = 0.01
"""Errors that differ by a smaller share count as equal: who would wait for that?"""


def frontier(costs: Iterable[Cost | Refused], total: bool = False) -> tuple[Cost, ...]:
    """The costs that no other beats in both RMS error, with noise, and time; fastest first.

    The time is that of the arithmetic in a frame; with `total`, conversion counts too. A slower one
    must be better than the faster ones here by more than `ALIKE`. To say nothing beats what is
    further off than the shape.
    """
    known = [cost for cost in costs if isinstance(cost, Cost) and cost.rms < cost.shape_rms]
    kept: list[Cost] = []
    for cost in sorted(known, key=lambda cost: (_time(cost, total), cost.rms)):
        # Better than those kept, not than all: many small steps make a large one.
        if not kept or cost.rms < (1 - ALIKE) * kept[-1].rms:
            kept.append(cost)
    return tuple(kept)


def _time(cost: Cost, total: bool) -> float:
    return cost.total_time if total else cost.time_per_frame


def cheapest(costs: Iterable[Cost | Refused], within: float) -> Cost | None:
    """The cost with the least total time whose RMS error, with noise, is `within` m or less."""
    if not 0 < within < math.inf:
        raise Refusal(f"expected an accuracy above zero in m, got {within}")
    able = [cost for cost in costs if isinstance(cost, Cost) and cost.rms <= within]
    return min(able, key=lambda cost: (cost.total_time, cost.rms), default=None)
