"""What is estimated from fixed readings, kept beside the revision of the estimates.

Run `python tests/estimates.py` when an estimate of the same readings has changed: it raises
`REVISION` of the pipeline, and writes the new estimates, and their scores in the guide's benchmark.
"""

import json
import os
import re
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the engine; more take far longer

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS
from kappaskin.frames import Frame
from kappaskin.pipeline import REVISION, Pipeline, Reported, Setup, getters
from kappaskin.recording import Recording
from kappaskin.recording.recompute import RecordedFrames
from kappaskin.sensing import Sensor
from kappaskin_resources.benchmark import methods, score

_HERE = Path(__file__).parent / "core" / "pipeline"
RECORDING = _HERE / "before-revisions.mcap"
"""Flat skins, the arc of a fingertip, faulty elements and a bent skin: older than revisions."""

ESTIMATES = _HERE / "estimates.json"
_ROOT = Path(__file__).parents[1]
_SOURCE = _ROOT / "core" / "kappaskin" / "pipeline" / "pipeline.py"
PAGE = _ROOT / "resources" / "kappaskin_resources" / "guide" / "benchmark.md"
_PRESSES = "presses of the benchmark"

_QUANTITIES = (
    *("noise", "present", "single", "near_rim", "converged", "spare", "suspect"),
    *("position", "position_sd", "force", "force_sd"),
    *("displacement", "displacement_sd", "curvature_form"),
)
_CLOSE = 1e-5
"""Of the largest number in a row: a thousand times what rounding changes, and less than is seen."""

Rows = dict[str, list[list[float]]]


def computed() -> dict[str, Rows]:
    """By device and method, and quantity, a row for each frame of the fixed recording.

    And one for each press of the benchmark: pairs, a bent skin and a dome, rigid objects.
    """
    devices: list[tuple[Sensor, list[Frame]]] = []
    with Recording(RECORDING) as recording:
        frames = RecordedFrames(RECORDING.name)
        for message in recording.messages():
            for frame in frames(message):
                if not devices or devices[-1][0] is not frames.sensor:
                    devices.append((frames.sensor, []))
                devices[-1][1].append(frame)
    found = {
        f"device {n}, {method}": _rows(sensor, frames, method)
        for n, (sensor, frames) in enumerate(devices)
        for method in METHODS
    }
    return found | {_PRESSES: {name: [*map(_row, told)] for name, told in _pressed().items()}}


def _pressed() -> dict[str, Any]:
    """What is told of the presses of the benchmark; NaN on the rim, where rounding decides it."""
    presses = methods.load(methods.OPEN)
    told = methods.kappaskin(presses)
    sides = np.array([presses[f"{skin}_sides"] for skin in presses["skin"]])[:, None]
    on_rim = (np.abs(told["place"] - sides / 2) > 0.49 * sides).any(axis=-1)
    for name in set(told) - {"count"}:
        told[name][on_rim] = np.nan
    return told


def _row(value: Any) -> list[float]:
    return [float(f"{number:.8g}") for number in np.asarray(value, float).ravel()]


def _rows(sensor: Sensor, frames: list[Frame], method: str) -> Rows:
    get, rows = getters(), Rows()
    try:
        pipeline = Pipeline(sensor, Setup(method=method))
    except Refusal:
        return {"refused": [[1.0]]}
    for frame in frames:
        estimate = pipeline(frame)
        reported, c = Reported(estimate), estimate.coefficients.ravel()
        found: dict[str, Any] = {name: get[name](reported) for name in _QUANTITIES}
        found["coefficients"] = [np.linalg.norm(c), *c[:3]]
        found["coefficients_sd"] = pipeline.fitted.sd.ravel()[:3]
        for name, value in found.items():
            rows.setdefault(name, []).append(_row(value))
    return rows


def changed(now: dict[str, Rows], was: dict[str, Rows]) -> list[str]:
    """The quantities that differ by more than rounding explains, each with its method."""
    return [
        f"{method}: {name}"
        for method in now | was
        for name in now.get(method, {}) | was.get(method, {})
        if not _close(now.get(method, {}).get(name), was.get(method, {}).get(name))
    ]


def _close(now: list[list[float]] | None, was: list[list[float]] | None) -> bool:
    if now is None or was is None or [*map(len, now)] != [*map(len, was)]:
        return False
    for a, b in zip(map(np.array, now), map(np.array, was), strict=True):
        scale = float(np.nanmax(np.abs(b), initial=0.0))
        if not np.allclose(a, b, rtol=0.0, atol=_CLOSE * scale, equal_nan=True):
            return False
    return True


def kept() -> tuple[int, dict[str, Rows]]:
    """The revision that the estimates kept are of, and those."""
    found = json.loads(ESTIMATES.read_text(encoding="utf-8"))
    return found["revision"], found["estimates"]


def scored(page: str, estimates: dict[str, Rows]) -> str:
    """The guide's page of the benchmark with the scores of some estimates."""
    answers = methods.load(methods.OPEN)
    empty, rows = methods.blank(len(answers["count"])), estimates[_PRESSES]
    results = {
        name: np.reshape(rows[name], of.shape).astype(of.dtype) for name, of in empty.items()
    }
    before, after = page.split("score results.npz\n```\n\n```text\n", 1)
    _, after = after.split("```", 1)
    table = score.table(results, answers)
    return f"{before}score results.npz\n```\n\n```text\n{table}\n```{after}"


def renew() -> str:
    """Keep the present estimates, under a raised `REVISION` if they changed; what was done."""
    now, (revision, was) = computed(), kept() if ESTIMATES.exists() else (REVISION, {})
    page = scored(PAGE.read_text(encoding="utf-8"), now)
    PAGE.write_text(page, encoding="utf-8", newline="\n")
    different = changed(now, was)
    if not different and revision == REVISION:
        return f"revision {revision}: the estimates are the same"
    new = max(revision + bool(was and different), REVISION)
    source = _SOURCE.read_text(encoding="utf-8")
    raised = re.sub(r"^REVISION = \d+$", f"REVISION = {new}", source, flags=re.MULTILINE)
    _SOURCE.write_text(raised, encoding="utf-8", newline="\n")
    text = json.dumps({"revision": new, "estimates": now}, separators=(",", ":"))
    ESTIMATES.write_text(text.replace('],"', '],\n"') + "\n", encoding="utf-8", newline="\n")
    return f"revision {new}: {len(different)} rows changed: {', '.join(different[:8])}"


if __name__ == "__main__":
    print(renew())
