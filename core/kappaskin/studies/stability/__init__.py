"""Stability: every hard case by every method that supports it, and the verdict on the answer.

The verdicts, in the order in which they are found:

- `refused`: the method raised a `Refusal`, whose text names the cause.
- `wrong`: it answered, and the truth is not covered: of all places on the skin and all frames less
  than 85 % lie within the 95 % error bar. An answer without an error bar covers nothing. Frames
  that the method itself flags as not converged are not counted. Where there is no noise the answer
  may instead be the truth to rounding.
- `exact`: covered, every coefficient is determined, no frame is flagged, and the coefficients are
  as near to the reference as rounding allows; see `Reference.allowed`. A bound that leaves less
  than two digits allows nothing, or it could not fail.
- `degraded`: covered, or flagged by the method itself, but not exact. An answer is flagged too
  where it says that the sigma it was given is wrong.

Eq. 6 as printed `breaks` where another method would be wrong. Methods that do not seek the
least-squares answer have no digits to lose: the truth and the error bar judge them, and in float32
their own answer in float64 is the reference.
"""

import math
import os
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import groupby, repeat
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin._processes import process_context
from kappaskin.contact import Contacts
from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS, Estimator, Fit
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.studies.accuracy import root_mean_square
from kappaskin.studies.stability.gallery import CaseKind, HardCase, gallery
from kappaskin.studies.stability.reference import Reference, reference_of

COVERED = 0.85
"""How much of the truth must lie in bars of 95 %: three standard errors less, over 40 frames."""

_PLACES = 9  # along each side, at the middles of so many cells
_BLOCK = 4000  # frames that are fitted together, and about as many of all are judged


@dataclass(frozen=True, eq=False)
class MethodAnswer:
    """What a method made of a case: the first frame's coefficients, and its shapes at places.

    `error` and `bar` (T, P) in m, the bar being the half width of 95 %; `flagged` (T,) frames that
    the method does not vouch for. Of a long sequence they are those of some frames, evenly spread.
    """

    coefficients: Array
    error: Array
    bar: Array
    flagged: NDArray[np.bool_]

    @classmethod
    def of(cls, case: HardCase, fit: Fit, frames: NDArray[np.intp]) -> "MethodAnswer":
        """The answer of a `fit` to these `frames`, at the middles of 9 x 9 cells on the skin."""
        x, y = case.layout.patch.cell_centres(_PLACES, 1 if case.layout.patch.strip else _PLACES)
        places = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        places = places[case.layout.patch.contains(places)]
        c = fit.coefficients.reshape(len(frames), -1).astype(float)
        truth = case.truth.reshape(-1, case.true_basis.size)
        truth = truth if len(truth) == 1 else truth[frames]
        error = c @ case.basis.at(places).T - truth @ case.true_basis.at(places).T
        known = bool(np.isfinite(c).all())
        bar = (
            _reach(fit)[:, None] * fit.surface_sd(places) if known else np.full_like(error, np.nan)
        )
        sure = np.asarray(fit.converged, bool) & (fit.sigma_ratio == 1)
        flagged = ~np.broadcast_to(sure, (len(frames),))
        return cls(c[0], error, bar, flagged)

    @property
    def covered(self) -> float | None:
        """The share of places and frames at which the truth lies within the bar, if any count."""
        counted = ~self.flagged
        within = np.abs(self.error[counted]) <= self.bar[counted]
        return float(np.mean(within)) if within.size else None


def _reach(fit: Fit) -> Array:
    """Half widths of 95 % in standard deviations, (T,): Student's t where noise is estimated."""
    frames = len(fit.readings)
    if fit.estimator.sigma is not None:
        return np.full(frames, scipy.special.ndtri(0.975))
    spare = np.broadcast_to(np.asarray(fit.spare, float), (frames,))
    return np.asarray(scipy.special.stdtrit(np.where(spare > 0, spare, np.nan), 0.975), float)


class _WithoutDrift:
    """Fits by an estimator, to readings from which an estimated drift is subtracted."""

    def __init__(self, estimator: Estimator) -> None:
        layout = estimator.layout
        self._estimator, self._contacts = estimator, Contacts(Plate(layout.patch), layout)

    def __call__(self, curvature: Array) -> Fit:
        return Fit.stacked([self._fitted(frame) for frame in curvature])

    def _fitted(self, frame: Array) -> Fit:
        fit = self._estimator(frame)
        self._contacts(frame, fit)
        drift = self._contacts.drift
        return fit if drift is None else drift.fit


def answer_of(case: HardCase, make: Callable[[], Estimator]) -> MethodAnswer | Refusal:
    """The answer of an estimator, or the reason for its refusal.

    One that remembers answers each frame after the one before it, and knows no others: of forty
    frames of a skin at rest its errors would be one error. Sequences it follows whole.
    """
    try:
        estimator = make()
        if estimator.has_memory and case.kind is not CaseKind.SEQUENCE:
            return _joined(list(_after_another(case, estimator, estimator.restart)))
        fitted = _WithoutDrift(estimator) if case.kind is CaseKind.DRIFT else estimator
        return _joined(list(_in_blocks(case, fitted)))
    except Refusal as refusal:
        return refusal


def _in_blocks(case: HardCase, estimator: Callable[[Array], Fit]) -> Iterator[MethodAnswer]:
    """One block of frames after the other."""
    every = max(1, len(case.curvature) // _BLOCK)
    for start in range(0, len(case.curvature), _BLOCK):
        fit = estimator(case.curvature[start : start + _BLOCK])
        chosen = np.arange(0, len(fit.readings), every)
        kept = fit if every == 1 else Fit.merged([fit], chosen)
        yield MethodAnswer.of(case, kept, start + chosen)


def _after_another(
    case: HardCase, estimator: Estimator, restart: Callable[[], None]
) -> Iterator[MethodAnswer]:
    for t in range(len(case.curvature)):
        restart()
        fit = estimator(case.curvature[[t - 1, t]])
        yield MethodAnswer.of(case, Fit.merged([fit], np.array([1])), np.array([t]))


def _joined(parts: list[MethodAnswer]) -> MethodAnswer:
    error, bar, flagged = zip(*((p.error, p.bar, p.flagged) for p in parts), strict=True)
    whole = np.concatenate(error), np.concatenate(bar), np.concatenate(flagged)
    return MethodAnswer(parts[0].coefficients, *whole)


def verdict_on(
    case: HardCase, reference: Reference, answer: MethodAnswer, eps: float, peer: Array | None
) -> tuple[str, str]:
    """The verdict on an answer in a precision of `eps`, and why.

    `peer` is what the first frame's coefficients should be to rounding: None when nothing is known.
    """
    if not np.isfinite(answer.coefficients).all():
        return "wrong", "the coefficients are NaN or infinite"
    at_truth, covered = _at_truth(case, reference, answer, eps), answer.covered
    if covered is not None and not (at_truth or covered >= COVERED):
        return "wrong", f"the 95 % bar covers {100 * covered:.0f} % of the truth"
    if flagged := int(answer.flagged.sum()):
        why = "not converged" if case.sigma is None else "the sigma is contradicted"
        return "degraded", f"{flagged} of {len(answer.flagged)} frames are flagged: {why}"
    if not np.isfinite(reference.condition):
        return "degraded", "some coefficients are undetermined; the bar covers the truth"
    if peer is not None and not reference.near(answer.coefficients, peer, eps):
        return "degraded", "rounding costs digits; the bar covers the truth"
    if at_truth or covered is None:
        return "exact", "to rounding"
    return "exact", f"the bar covers {100 * covered:.0f} %"


def _at_truth(case: HardCase, reference: Reference, answer: MethodAnswer, eps: float) -> bool:
    """Whether a single frame's answer is the truth to rounding."""
    if len(case.curvature) > 1 or not case.in_reach or not np.isfinite(reference.condition):
        return False
    return reference.near(answer.coefficients, case.truth.ravel(), eps)


_USUAL = frozenset({CaseKind.ANY, CaseKind.LINEAR, CaseKind.DENSE})
_CLAIMS: Mapping[str, frozenset[CaseKind]] = {
    "least-squares": _USUAL | {CaseKind.SEQUENCE, CaseKind.GIVEN, CaseKind.DRIFT},
    "bayes": _USUAL | {CaseKind.GIVEN},
    "fast": _USUAL | {CaseKind.SEQUENCE, CaseKind.LARGE, CaseKind.GIVEN},
    "finite-slope": frozenset({CaseKind.ANY, CaseKind.SLOPES}),
    "robust": _USUAL - {CaseKind.DENSE} | {CaseKind.OUTLIERS, CaseKind.GIVEN},
    "tracking": _USUAL - {CaseKind.DENSE} | {CaseKind.SEQUENCE},
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
    within the bar. `progress` gets the name of each case when it is done. Cases are shared among
    processes of one thread each: on matrices of this size more threads only wait for each other.
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


def rows_of(
    case: HardCase, methods: Mapping[str, type[Estimator]] = METHODS
) -> list[dict[str, Any]]:
    """The rows of one case, for those of `methods` that claim it."""
    claiming = [name for name in methods if case.kind in _CLAIMS.get(name, _USUAL)]
    if not claiming:
        return []
    reference, rows = reference_of(case), list[dict[str, Any]]()
    for method in claiming:
        peer = reference.answer if _seeks_least_squares(method, case) else None
        for precision in _PRECISIONS:
            make = partial(methods[method], case.basis, case.layout, case.sigma, dtype=precision)
            answer = answer_of(case, make)
            rows.append(_row(case, reference, method, precision, answer, peer))
            if peer is None and isinstance(answer, MethodAnswer):
                peer = answer.coefficients
    return rows


def _seeks_least_squares(method: str, case: HardCase) -> bool:
    return method in _SEEK_LEAST_SQUARES and case.kind is not CaseKind.DRIFT


def _row(
    case: HardCase,
    reference: Reference,
    method: str,
    precision: np.dtype[Any],
    answer: MethodAnswer | Refusal,
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
    found, why = verdict_on(case, reference, answer, eps, peer)
    if _seeks_least_squares(method, case):
        row["digits_lost"] = reference.digits_lost(answer.coefficients, eps)
    return row | {
        "error_mm": _number(1e3 * root_mean_square(answer.error)),
        "bar_mm": _number(1e3 * root_mean_square(answer.bar)),
        "covered": answer.covered,
        "verdict": "breaks" if found == "wrong" and method == _PRINTED else found,
        "reason": why,
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


_KEY = (
    "condition of M: columns scaled, and as Eq. 6 has it; lost: decimal digits; error and 95 % "
    "bar: RMS in mm; -: none"
)
_WIDTH = 116


def _of(value: float | None, width: int, form: str) -> str:
    return format("-" if value is None else format(value, form), f">{width}")


def _why(row: dict[str, Any]) -> str:
    """The cause that a refusal names, without what it counts; anything else whole."""
    reason = row["reason"]
    if row["verdict"] == "refused":
        reason = reason.partition("basis: ")[2] or reason
    return textwrap.shorten(reason, 52, placeholder=" ...")


def _line(row: dict[str, Any]) -> str:
    return (
        f"    {row['method']:<14}{row['precision']:<8}{_of(row['condition_scaled'], 8, '.2g')}"
        f"{_of(row['condition_unscaled'], 9, '.2g')}{_of(row['digits_lost'], 6, '.1f')}"
        f"{_of(row['error_mm'], 9, '.2g')}{_of(row['bar_mm'], 9, '.2g')}  {row['verdict']:<9}"
        f"{_why(row)}"
    )


def stability_text(rows: list[dict[str, Any]]) -> str:
    """Each case with what is hard about it and what every method made of it."""
    lines = [
        _KEY,
        f"    {'method':<14}{'in':<8}{'scaled':>8}{'as is':>9}{'lost':>6}{'error':>9}{'bar':>9}"
        "  verdict  why",
    ]
    for name, group in groupby(rows, lambda row: row["case"]):
        own = list(group)
        functions, elements = own[0]["functions"], own[0]["elements"]
        head = f"{name} ({functions} functions, {elements} elements): {own[0]['hard']}"
        lines += [*textwrap.wrap(head, _WIDTH, subsequent_indent="  "), *map(_line, own)]
    counts = Counter((row["method"], row["verdict"]) for row in rows)
    lines += [""] + [
        f"{method:<14}"
        + ", ".join(f"{n} {found}" for (one, found), n in counts.items() if one == method)
        for method in dict.fromkeys(row["method"] for row in rows)
    ]
    return "\n".join(lines)
