"""A case and a method to a row of numbers and a verdict.

The verdicts, in the order in which they are found:

- `refused`: the method raised a `Refusal`, whose text names the cause.
- `wrong`: it answered, and the truth is not covered: of all places on the skin and all frames less
  than 85 % lie within the 95 % error bar. An answer without an error bar covers nothing. Frames
  that the method itself flags as not converged are not counted. Where there is no noise the answer
  may instead be the truth to rounding.
- `exact`: covered, every coefficient is determined, no frame is flagged, and the coefficients are
  as near to the reference as rounding allows; see `Reference.allowed`. A bound that leaves less
  than two digits allows nothing, or it could not fail.
- `degraded`: covered, or flagged by the method itself, but not exact.

Eq. 6 as printed `breaks` where another method would be wrong. Methods that do not seek the
least-squares answer have no digits to lose: the truth and the error bar judge them, and in float32
their own answer in float64 is the reference.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import scipy
from numpy.typing import NDArray

from kappaskin.errors import Refusal
from kappaskin.estimation import Estimator, Fit, merged_fits
from kappaskin.frames import Array
from kappaskin.studies.stability.case import Case, Kind
from kappaskin.studies.stability.reference import Reference

COVERED = 0.85
"""How much of the truth must lie in bars of 95 %: three standard errors less, over 40 frames."""

_PLACES = 9  # along each side, at the middles of so many cells
_BLOCK = 4000  # frames that are fitted together, and about as many of all are judged


@dataclass(frozen=True, eq=False)
class Answer:
    """What a method made of a case: the first frame's coefficients, and its shapes at places.

    `error` and `bar` (T, P) in m, the bar being the half width of 95 %; `flagged` (T,) frames that
    the method does not vouch for. Of a long sequence they are those of some frames, evenly spread.
    """

    coefficients: Array
    error: Array
    bar: Array
    flagged: NDArray[np.bool_]

    @classmethod
    def of(cls, case: Case, fit: Fit, frames: NDArray[np.intp]) -> "Answer":
        """What `fit` says of these `frames` of a case at the middles of 9 x 9 cells."""
        x, y = case.layout.patch.cell_centres(_PLACES, 1 if case.layout.patch.strip else _PLACES)
        places = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        c = fit.coefficients.reshape(len(frames), -1).astype(float)
        truth = case.truth.reshape(-1, case.true_basis.size)
        truth = truth if len(truth) == 1 else truth[frames]
        error = c @ case.basis.at(places).T - truth @ case.true_basis.at(places).T
        known = bool(np.isfinite(c).all())
        bar = (
            _reach(fit)[:, None] * fit.surface_sd(places) if known else np.full_like(error, np.nan)
        )
        flagged = ~np.broadcast_to(np.asarray(fit.converged, bool), (len(frames),))
        return cls(c[0], error, bar, flagged)

    @property
    def covered(self) -> float | None:
        """The share of places and frames at which the truth lies within the bar, if any count."""
        counted = ~self.flagged
        within = np.abs(self.error[counted]) <= self.bar[counted]
        return float(np.mean(within)) if within.size else None


def _reach(fit: Fit) -> Array:
    """Half widths of 95 % in standard deviations, (T,): Student's t where noise is estimated."""
    frames = len(fit.curvature)
    if fit.estimator.sigma is not None:
        return np.full(frames, scipy.special.ndtri(0.975))
    spare = np.broadcast_to(np.asarray(fit.spare, float), (frames,))
    return np.asarray(scipy.special.stdtrit(np.where(spare > 0, spare, np.nan), 0.975), float)


@runtime_checkable
class Remembers(Protocol):
    """An estimator whose answers depend on earlier frames, until it is restarted."""

    def restart(self) -> None:
        """Forget every frame."""
        ...


def answered(case: Case, make: Callable[[], Estimator]) -> Answer | Refusal:
    """What an estimator answers, or why it does not.

    One that remembers answers each frame after the one before it, and knows no others: of forty
    frames of a skin at rest its errors would be one error. Sequences it follows whole.
    """
    try:
        estimator = make()
        if isinstance(estimator, Remembers) and case.kind is not Kind.SEQUENCE:
            return _joined(list(_after_another(case, estimator, estimator.restart)))
        return _joined(list(_in_blocks(case, estimator)))
    except Refusal as refusal:
        return refusal


def _in_blocks(case: Case, estimator: Estimator) -> Iterator[Answer]:
    """One block of frames after the other."""
    every = max(1, len(case.curvature) // _BLOCK)
    for start in range(0, len(case.curvature), _BLOCK):
        fit = estimator(case.curvature[start : start + _BLOCK])
        chosen = np.arange(0, len(fit.curvature), every)
        kept = fit if every == 1 else merged_fits([fit], chosen)
        yield Answer.of(case, kept, start + chosen)


def _after_another(
    case: Case, estimator: Estimator, restart: Callable[[], None]
) -> Iterator[Answer]:
    for t in range(len(case.curvature)):
        restart()
        fit = estimator(case.curvature[[t - 1, t]])
        yield Answer.of(case, merged_fits([fit], np.array([1])), np.array([t]))


def _joined(parts: list[Answer]) -> Answer:
    error, bar, flagged = zip(*((p.error, p.bar, p.flagged) for p in parts), strict=True)
    whole = np.concatenate(error), np.concatenate(bar), np.concatenate(flagged)
    return Answer(parts[0].coefficients, *whole)


def verdict(
    case: Case, reference: Reference, answer: Answer, eps: float, peer: Array | None
) -> tuple[str, str]:
    """The verdict on an answer in a precision of `eps`, and why.

    `peer` is what the first frame's coefficients should be to rounding: None when nothing is known.
    """
    if not np.isfinite(answer.coefficients).all():
        return "wrong", "the coefficients are no numbers"
    at_truth, covered = _at_truth(case, reference, answer, eps), answer.covered
    if covered is not None and not (at_truth or covered >= COVERED):
        return "wrong", f"the 95 % bar covers {100 * covered:.0f} % of the truth"
    if flagged := int(answer.flagged.sum()):
        return "degraded", f"{flagged} of {len(answer.flagged)} frames are flagged: not converged"
    if not np.isfinite(reference.condition):
        return "degraded", "not all is determined; the bar covers the truth"
    if peer is not None and not reference.near(answer.coefficients, peer, eps):
        return "degraded", "rounding costs digits; the bar covers the truth"
    if at_truth or covered is None:
        return "exact", "to rounding"
    return "exact", f"the bar covers {100 * covered:.0f} %"


def _at_truth(case: Case, reference: Reference, answer: Answer, eps: float) -> bool:
    """Whether a single frame's answer is the truth to rounding."""
    if len(case.curvature) > 1 or not case.in_reach or not np.isfinite(reference.condition):
        return False
    return reference.near(answer.coefficients, case.truth.ravel(), eps)
