"""Drills to rows: each done on the device, and judged."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from kappaskin.errors import SourceError
from kappaskin.studies.drills import bytes_spoilt, devices, disks, processes, recordings
from kappaskin.studies.drills.drill import Drill
from kappaskin.studies.drills.outcome import NeedsSimulated, Outcome, judged
from kappaskin.studies.drills.stand import Device, Stand, opened

DRILLS: tuple[Drill, ...] = (
    *bytes_spoilt.DRILLS,
    *devices.DRILLS,
    *processes.DRILLS,
    *disks.DRILLS,
    *recordings.DRILLS,
)

_SEED = 6


def run_drills(
    source: str | None = None,
    long: bool = False,
    progress: Callable[[str], object] = lambda _: None,
    chosen: Sequence[Drill] = DRILLS,
) -> list[dict[str, Any]]:
    """One row for each drill, done on the device at `source`, or a simulated one.

    `sent`, `accepted` and `lost` in messages, `discarded` in bytes, `recovered_s` None where
    nothing had to recover; `verdict` is held, failed or skipped. `progress` is told each drill
    before it is done.
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


def _done(drill: Drill, device: Device, long: bool) -> tuple[Outcome, list[str], str]:
    stand = Stand(device, long)
    try:
        outcome = drill.run(stand)
    except NeedsSimulated:
        return Outcome(), ["needs the simulated device"], "skipped"
    except SourceError as error:
        return Outcome(), [str(error)], "failed"
    finally:
        stand.close()
    reasons = judged(outcome, drill.within)
    return outcome, reasons, "failed" if reasons else "held"
