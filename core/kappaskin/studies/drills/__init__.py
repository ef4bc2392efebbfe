"""Fault drills: the list of them, their run and the table of results."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from kappaskin.errors import SourceError
from kappaskin.studies.drills.host import CALIBRATION_DRILLS, PROCESS_DRILLS, RECORDING_DRILLS
from kappaskin.studies.drills.line import BYTE_DRILLS, DEVICE_DRILLS
from kappaskin.studies.drills.stand import (
    Device,
    Drill,
    DrillOutcome,
    NeedsSimulatedDevice,
    Stand,
    judged,
    opened,
)

DRILLS: tuple[Drill, ...] = (
    *BYTE_DRILLS,
    *DEVICE_DRILLS,
    *PROCESS_DRILLS,
    *CALIBRATION_DRILLS,
    *RECORDING_DRILLS,
)

_SEED = 6


def run_drills(
    source: str | None = None,
    long: bool = False,
    progress: Callable[[str], object] = lambda _: None,
    chosen: Sequence[Drill] = DRILLS,
) -> list[dict[str, Any]]:
    """One row for each drill, run on the device at `source`, or a simulated one.

    `sent`, `accepted` and `lost` in messages, `discarded` in bytes, `recovered_s` None where
    nothing had to recover; `verdict` is held, failed or skipped. `progress` gets the name of
    each drill before it is run.
    """
    rows: list[dict[str, Any]] = []
    with opened(source, _SEED) as device:
        for drill in chosen:
            progress(drill.name)
            rows.append(row_of(drill, device, long))
    return rows


def row_of(drill: Drill, device: Device, long: bool = False) -> dict[str, Any]:
    """One drill, done and judged: a row as `run_drills` gives."""
    outcome, reasons, verdict = _done(drill, device, long)
    return {
        "drill": drill.name,
        "does": drill.does,
        "sent": outcome.sent,
        "accepted": outcome.accepted,
        "lost": outcome.lost,
        "discarded": outcome.discarded,
        "wrong": outcome.wrong,
        "recovered_s": None if math.isnan(outcome.recovered) else outcome.recovered,
        "within_s": drill.within if drill.within < math.inf else None,
        "verdict": verdict,
        "reasons": reasons,
    }


def _done(drill: Drill, device: Device, long: bool) -> tuple[DrillOutcome, list[str], str]:
    stand = Stand(device, long)
    try:
        outcome = drill.run(stand)
    except NeedsSimulatedDevice:
        return DrillOutcome(), ["needs the simulated device"], "skipped"
    except SourceError as error:
        return DrillOutcome(), [str(error)], "failed"
    finally:
        stand.close()
    reasons = judged(outcome, drill.within)
    return outcome, reasons, "failed" if reasons else "held"


def drills_text(rows: list[dict[str, Any]]) -> str:
    """A table with a line for each drill, and the reasons of those that failed."""
    lines = [
        f"{'drill':<20}{'sent':>8}{'accepted':>10}{'lost':>8}{'discarded':>11}{'wrong':>7}"
        f"{'recovered after':>17}  verdict"
    ]
    for row in rows:
        after = "-" if row["recovered_s"] is None else f"{row['recovered_s']:.3f} s"
        lines.append(
            f"{row['drill']:<20}{row['sent']:>8}{row['accepted']:>10}{row['lost']:>8}"
            f"{row['discarded']:>11}{row['wrong']:>7}{after:>17}  {row['verdict']}"
        )
        lines += [f"    {reason}" for reason in row["reasons"]]
    failed = sum(row["verdict"] == "failed" for row in rows)
    return "\n".join([*lines, f"{len(rows)} drills, {failed or 'none'} failed"])
