"""What became of a drill, and what is made of it."""

import math
from dataclasses import dataclass


class NeedsSimulated(Exception):
    """The fault needs the process that plays a device."""


@dataclass(frozen=True)
class Outcome:
    """Figures of a drill: messages `sent`, `accepted` and `lost`, and bytes `discarded`.

    `wrong` counts frames that were accepted but never sent so. `recovered` is the time from the end
    of the fault to the first good frame sent after it in s, NaN where nothing had to recover.
    `failures` are the claims that did not hold.
    """

    sent: int = 0
    accepted: int = 0
    lost: int = 0
    discarded: int = 0
    wrong: int = 0
    recovered: float = math.nan
    failures: tuple[str, ...] = ()


def judged(outcome: Outcome, within: float) -> list[str]:
    """Why a drill failed: its own claims, a wrong frame, or no recovery `within` so many s."""
    reasons = list(outcome.failures)
    if outcome.wrong:
        reasons.append(f"{outcome.wrong} wrong frames were accepted")
    if within < math.inf and not outcome.recovered <= within:
        after = "at all" if math.isnan(outcome.recovered) else f"for {outcome.recovered:.2f} s"
        reasons.append(f"did not recover within {within:g} s; not {after}")
    return reasons
