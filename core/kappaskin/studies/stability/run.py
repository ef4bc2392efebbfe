"""The gallery to rows: every case through every method that claims it, in both precisions."""

import math
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import repeat
from typing import Any

import numpy as np

from kappaskin._processes import process_context
from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS, Estimator
from kappaskin.frames import Array
from kappaskin.studies.stability.case import Case, Kind
from kappaskin.studies.stability.gallery import gallery
from kappaskin.studies.stability.judge import Answer, answered, verdict
from kappaskin.studies.stability.reference import Reference, reference_of

_USUAL = frozenset({Kind.ANY, Kind.LINEAR, Kind.DENSE})
_CLAIMS: Mapping[str, frozenset[Kind]] = {
    "least-squares": _USUAL | {Kind.SEQUENCE},
    "fast": _USUAL | {Kind.SEQUENCE, Kind.LARGE},
    "finite-slope": frozenset({Kind.ANY, Kind.SLOPES}),
    "robust": _USUAL - {Kind.DENSE},
    "tracking": _USUAL - {Kind.DENSE} | {Kind.SEQUENCE},
}
"""Which cases a method claims; any other claims the usual ones."""

_SEEK_LEAST_SQUARES = frozenset({"least-squares", "as-printed", "direct", "fast"})
_PRINTED = "as-printed"
_PRECISIONS = np.dtype(np.float64), np.dtype(np.float32)


def run_stability(
    long: bool = False, progress: Callable[[str], object] = lambda _: None
) -> list[dict[str, Any]]:
    """One row for each case of the gallery, method that claims it, and precision.

    `condition_scaled` is that of `LeastSquares.condition`, `condition_unscaled` that of M as Eq. 6
    has it, None where a coefficient is not determined. `digits_lost` of the first frame, None where
    the least-squares answer is not sought or does not exist. `error_mm` and `bar_mm` (95 %) are
    root mean squares over the skin and all frames; `covered` is the share of the truth that lies
    within the bar. `progress` is told each case when it is done. Cases are shared among processes
    of one thread each: on matrices of this size more threads only wait for each other.
    """
    names, rows = [case.name for case in gallery(long)], list[dict[str, Any]]()
    with (
        process_context() as context,
        ProcessPoolExecutor(os.cpu_count(), context) as pool,
    ):
        found = pool.map(_rows_of_the, names, repeat(long))
        for name, its_own in zip(names, found, strict=True):
            progress(name)
            rows += its_own
    return rows


def _rows_of_the(name: str, long: bool) -> list[dict[str, Any]]:
    """The rows of the case of this name."""
    return rows_of(next(case for case in gallery(long) if case.name == name))


def rows_of(case: Case, methods: Mapping[str, type[Estimator]] = METHODS) -> list[dict[str, Any]]:
    """The rows of one case, for those of `methods` that claim it."""
    claiming = [name for name in methods if case.kind in _CLAIMS.get(name, _USUAL)]
    if not claiming:
        return []
    reference, rows = reference_of(case), list[dict[str, Any]]()
    for method in claiming:
        peer = reference.answer if method in _SEEK_LEAST_SQUARES else None
        for precision in _PRECISIONS:
            make = partial(methods[method], case.basis, case.layout, dtype=precision)
            answer = answered(case, make)
            rows.append(_row(case, reference, method, precision, answer, peer))
            if peer is None and isinstance(answer, Answer):
                peer = answer.coefficients
    return rows


def _row(
    case: Case,
    reference: Reference,
    method: str,
    precision: np.dtype[Any],
    answer: Answer | Refusal,
    peer: Array | None,
) -> dict[str, Any]:
    eps, (Ni, Nj) = float(np.finfo(precision).eps), case.basis.shape
    row: dict[str, Any] = {
        "case": case.name,
        "hard": case.hard,
        "functions": f"{Ni} x {Nj}",
        "elements": str(case.layout).removesuffix(" elements"),
        "frames": len(case.curvature),
        "method": method,
        "precision": precision.name,
        "condition_scaled": _number(reference.condition),
        "condition_unscaled": _number(reference.unscaled),
        "digits_lost": None,
        "error_mm": None,
        "bar_mm": None,
        "covered": None,
        "announced": case.announced or None,
    }
    if isinstance(answer, Refusal):
        return row | {"verdict": "refused", "reason": str(answer)}
    found, why = verdict(case, reference, answer, eps, peer)
    if method in _SEEK_LEAST_SQUARES:
        row["digits_lost"] = reference.digits_lost(answer.coefficients, eps)
    return row | {
        "error_mm": _number(_rms_mm(answer.error)),
        "bar_mm": _number(_rms_mm(answer.bar)),
        "covered": answer.covered,
        "verdict": "breaks" if found == "wrong" and method == _PRINTED else found,
        "reason": why,
    }


def _rms_mm(values: Array) -> float:
    return 1e3 * float(np.sqrt(np.mean(values**2)))


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
