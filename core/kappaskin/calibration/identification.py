"""Identification of a channel's line, hysteresis and creep from readings of known curvatures."""

from dataclasses import dataclass

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.frames import Array, Mask
from kappaskin.sensing import PrandtlIshlinskii, StandardLinearSolid

_HUGE = 1e100  # 1/m: of more, or of less than its inverse, no squares can be added up
_PLAYS = 10  # at most, up to half of the range
_MOST_STEPS = 12  # of Gauss-Newton at most, in log a
_LONGEST_STEP = 0.3  # step in log a
_CONVERGED = 1e-5  # step in log a
_DECISIVE = 0.5  # share of a reading that the fit leaves to others, below which it decides alone
_MOST_ASYMMETRY = np.log(4.0)  # log a: loops of one side at most four times as wide as the other's
_MOST_SHARE = 0.9
_SETTLING = 0.01  # share of a hold, after the skin was bent, that is left out


@dataclass(frozen=True, eq=False)
class LineFits:
    """Fits of reading = gain * curvature + offset for C channels, and how good they are.

    `gain` has no unit (1 is nominal), `offset` is in 1/m of reading; `gain_sd` and `offset_sd` are
    their standard errors. `rms` is the residual, and `left_out` that of a reading which was
    left out of the fit, both as curvature in 1/m.
    """

    gain: Array
    offset: Array
    gain_sd: Array
    offset_sd: Array
    rms: Array
    left_out: Array


def fit_lines(x: Array, y: Array) -> LineFits:
    """The least-squares line through readings `y` (S, C) on curvatures `x` (S,), both in 1/m.

    The reading is fitted to the curvature and the line then read backwards: the cylinders are
    known, the noise is in the reading, and least squares the other way would turn it into a gain
    too small. What is left of an unseen reading is e_i / (1 - h_i), h_i its leverage.
    """
    n = len(x)
    for values in (x, y):
        size = np.max(np.abs(values), initial=0.0, where=~np.isnan(values))
        if not (size == 0 or 1 / _HUGE <= size <= _HUGE):
            raise Refusal(
                f"expected curvatures and readings of 0, or {1 / _HUGE:g} to {_HUGE:g} 1/m, to fit "
                f"lines to, got {size:g}; check their unit"
            )
    d = x - x.mean()
    Sxx = float(d @ d) or np.nan  # never bent: no line
    gain = d @ y / Sxx
    offset = y.mean(axis=0) - gain * x.mean()
    e = y - offset - np.outer(x, gain)
    sigma = np.sqrt((e**2).sum(axis=0) / (n - 2))
    h = 1 / n + d**2 / Sxx
    scale = np.abs(np.where(gain == 0, np.nan, gain))  # a dead channel has no curvature to tell
    return LineFits(
        gain,
        offset,
        sigma / np.sqrt(Sxx),
        sigma * np.sqrt(1 / n + x.mean() ** 2 / Sxx),
        np.sqrt((e**2).mean(axis=0)) / scale,
        np.sqrt(((e / (1 - h[:, None])) ** 2).mean(axis=0)) / scale,
    )


def play_thresholds(x: Array, radii: int) -> Array:
    """Thresholds (J,) in 1/m that a sweep of so many `radii` over curvatures `x` (S,) tells apart.

    A play reverses over twice its threshold, so the loops on one face tell those up to half of its
    range, two for each radius. The way from one face to the other tells wider ones, badly: they are
    there so that the error bars know of them. Without them half of the offsets of twist gages,
    which are bent half as far, lay beyond two standard errors.
    """
    most = np.abs(x).max() or 1.0  # any will do for channels that were never bent
    count = min(2 * radii, _PLAYS)
    return most * np.array([*np.arange(1, count + 1) / (2 * count), 0.6, 0.75, 0.9])


def play_positions(u: Array, slope: Array, r: Array) -> tuple[Array, Array]:
    """Positions (S, J, C) of plays of thresholds `r` (J,) along the paths `u` (S, C) from rest.

    And their derivatives, given those of u, `slope` (S, C): a play that is dragged moves with u.
    """
    at = np.zeros((len(r), u.shape[1]))
    turn = np.zeros_like(at)
    w, dw = np.empty((2, len(u), *at.shape))
    for k, v in enumerate(u):
        stayed = at
        at = np.minimum(np.maximum(at, v - r[:, None]), v + r[:, None])
        turn = np.where(at == stayed, turn, slope[k])
        w[k], dw[k] = at, turn
    return w, dw


def _columns(
    x: Array, y: Array, used: Mask, r: Array, log_a: Array, o: Array
) -> tuple[Array, Array]:
    """The regressors (U, J + 1, C) of readings `y` (S, C), and their derivative along log a.

    Of the U steps that are `used` (S,). reading = o + E(G_0 u + sum_j G_j w_j), u = E^-1(x). Since
    E(g z) = g E(z) for every gain g above zero, gain times weight is one number G_j; and the sign
    that E looks at is that of y - o.
    """
    a = np.exp(log_a)
    above = x[:, None] > 0
    u = np.where(above, x[:, None] / a, x[:, None])
    du = np.where(above, -u, 0.0)
    w, dw = play_positions(u, du, r)
    # A play that never moves is an offset, and its weight anything.
    moves = np.ptp(w[used], axis=0) > 0
    w, dw = w * moves, dw * moves
    E = np.where(y > o, a, 1.0)[:, None]
    dE = np.where(y > o, a, 0.0)[:, None]
    moved = np.concatenate([u[:, None], w], axis=1)
    turned = np.concatenate([du[:, None], dw], axis=1)
    return (E * moved)[used], (E * turned + dE * moved)[used]


@dataclass(frozen=True, eq=False)
class _Fitted:
    """One channel's fit to U readings: o, G (J + 1,), log a, columns A, residual e, slopes J.

    The columns of J (U, k) belong to the G above zero, to o and to log a.
    """

    o: float
    G: Array
    log_a: float
    A: Array
    e: Array
    J: Array

    @property
    def squares(self) -> float:
        return float(self.e @ self.e)


def _solved(A: Array, y: Array) -> tuple[Array, float]:
    """The G >= 0 and o that fit `y` (U,) best on the columns `A` (U, J + 1)."""
    from scipy.optimize import nnls  # takes a quarter of the time that all of kappaskin does

    one = np.ones((len(y), 1))
    found = nnls(np.hstack([A, one, -one]), y)[0]
    return found[:-2], float(found[-2] - found[-1])


def _fit_at(A: Array, dA: Array, y: Array, log_a: float) -> _Fitted:
    """The fit at one log a."""
    G, o = _solved(A, y)
    J = np.column_stack([A[:, G > 0], np.ones(len(y)), dA @ G])
    return _Fitted(o, G, log_a, A, y - o - A @ G, J)


def _fits(x: Array, y: Array, used: Mask, r: Array, offset: Array) -> list[_Fitted]:
    """The best fit of every channel: least squares in G and o, Gauss-Newton in log a."""
    C = y.shape[1]
    log_a, o = np.zeros(C), offset.copy()
    best: list[_Fitted | None] = [None] * C
    for _ in range(_MOST_STEPS if C else 0):
        A, dA = _columns(x, y, used, r, log_a, o)
        step = np.zeros(C)
        for c in range(C):
            fit = _fit_at(A[:, :, c], dA[:, :, c], y[used, c], float(log_a[c]))
            before = best[c]
            if before is None or fit.squares < before.squares:
                best[c] = fit
            o[c], step[c] = fit.o, np.linalg.lstsq(fit.J, fit.e)[0][-1]
        moved = np.clip(
            log_a + np.clip(step, -_LONGEST_STEP, _LONGEST_STEP), -_MOST_ASYMMETRY, _MOST_ASYMMETRY
        )
        if np.abs(moved - log_a).max() < _CONVERGED:
            break
        log_a = moved
    return [fit for fit in best if fit is not None]


def _needed(fit: _Fitted, line_squares: float, least: float) -> bool:
    """Whether the loops explain more than a line, by the Bayesian information criterion."""
    n, k = fit.J.shape
    floor = n * least**2

    def criterion(squares: float, parameters: int) -> float:
        return n * np.log(max(squares, floor)) + parameters * np.log(n)

    curved = fit.G[0] > 0 and bool(fit.G[1:].any()) and n > k
    return curved and criterion(fit.squares, k) < criterion(line_squares, 2)


def _left_out(fit: _Fitted, h: Array) -> Array:
    """The residual (U,) of each reading if it had not been fitted, by the leverages `h` (U,).

    e / (1 - h) holds while the same G stay above zero; without a reading that decides one of them
    by itself others take its place, and the fit is done again.
    """
    y = fit.e + fit.o + fit.A @ fit.G
    out = fit.e / np.maximum(1 - h, _DECISIVE)
    for k in np.flatnonzero(1 - h < _DECISIVE):
        G, o = _solved(np.delete(fit.A, k, axis=0), np.delete(y, k))
        out[k] = y[k] - o - fit.A[k] @ G
    return out


def _errors(fit: _Fitted) -> tuple[float, float]:
    """Standard errors of the gain and of o.

    A weight that came out zero is not known to be zero: the columns of all plays that move count,
    for the same reason as wide `thresholds` do. Nine in ten errors are within two of these or more.
    """
    n, k = fit.J.shape
    moving = fit.A[:, np.abs(fit.A).max(axis=0) > 0]
    R = np.linalg.qr(np.column_stack([moving, fit.J[:, -2:]]))[1]
    spread = np.sqrt(fit.squares / (n - k)) * np.linalg.pinv(R)
    of_gain, of_o = spread[:-2].sum(axis=0), spread[-2]
    return float(np.linalg.norm(of_gain)), float(np.linalg.norm(of_o))


def _numbers(fit: _Fitted) -> tuple[float, ...]:
    """The fields of `LineFits` for one channel: its gain is that of a long way, the sum of G."""
    gain = float(fit.G.sum())
    leverage = (np.linalg.qr(fit.J)[0] ** 2).sum(axis=1)
    left = np.stack([fit.e, _left_out(fit, leverage)])
    rms, left_out = np.sqrt((left**2).mean(axis=1)) / gain
    return gain, fit.o, *_errors(fit), float(rms), float(left_out)


def identify_hysteresis(
    x: Array, y: Array, used: Mask, r: Array, line: LineFits, least: float
) -> tuple[LineFits, PrandtlIshlinskii]:
    """The hysteresis in readings `y` (S, C) on curvatures `x` (S,) in 1/m, and the quality of fit.

    The channels share nothing but the thresholds `r` (J,) in 1/m. Glue and bonding differ from gage
    to gage, which the paper blames for the loops and their asymmetry, and a sweep of n radii tells
    each channel some 4 n to 8 n readings, good to a hundredth of a loop's width, for at most 16
    numbers. A channel that a line explains as well keeps its `line`. Steps that are not `used` (S,)
    only move the plays. No reading is known better than to `least` in 1/m.
    """
    C = y.shape[1]
    p, q, a = np.zeros((len(r), C)), np.ones(C), np.ones(C)
    numbers = np.stack(
        [line.gain, line.offset, line.gain_sd, line.offset_sd, line.rms, line.left_out]
    )
    known = np.flatnonzero(np.isfinite(line.rms))
    for c, fit in zip(known, _fits(x, y[:, known], used, r, line.offset[known]), strict=True):
        straight = used.sum() * (line.rms[c] * line.gain[c]) ** 2
        if _needed(fit, float(straight), least):
            numbers[:, c] = _numbers(fit)
            shares = fit.G / fit.G.sum()
            q[c], p[:, c], a[c] = shares[0], shares[1:], np.exp(fit.log_a)
    return LineFits(*numbers), PrandtlIshlinskii(np.tile(r[:, None], C), p, q, a)


def unseen_error(
    x: Array,
    y: Array,
    used: Mask,
    parts: Array,
    r: Array,
    fitted: LineFits,
    loops: PrandtlIshlinskii,
) -> Array:
    """RMS error (C,) in 1/m of curvature on parts of a sweep that are left out of the fit.

    Each of the `parts` (S,) from 0 on is left out in turn, as a whole: where real loops are not
    plays, what the fit leaves is alike along a way, and leaving out one reading between its
    neighbours does not show it. The asymmetry stays as `fitted`.
    """
    X, Y, part = x[used], y[used], parts[used]
    A = _columns(x, y, used, r, np.log(loops.stretch), fitted.offset)[0]
    looped = np.flatnonzero(np.isfinite(fitted.rms) & (loops.weights != 0).any(axis=0))
    off = np.full(Y.shape, np.nan)
    for number in np.unique(part[part >= 0]):
        out = part == number
        line = fit_lines(X[~out], Y[~out])
        off[out] = Y[out] - line.offset - np.outer(X[out], line.gain)
        for c in looped:
            # A play that moves only where it is left out would be an offset of any size.
            moving = np.ptp(A[~out, :, c], axis=0) > 0
            G, o = _solved(A[~out][:, moving, c], Y[~out, c])
            off[out, c] = Y[out, c] - o - A[out][:, moving, c] @ G
    with np.errstate(divide="ignore", invalid="ignore"):  # a stuck or never bent one, which fails
        squares = (off[part >= 0] ** 2).sum(axis=0) / (part >= 0).sum()
        return np.sqrt(squares) / np.abs(fitted.gain)


def _bent_at(course: Array) -> int:
    """The first moment at which the channels are together more than half as far as at the end."""
    far = course @ np.sign(course[-1])
    return int(np.argmax(far > far[-1] / 2))


def identify_creep(moments: Array, course: Array, least: float) -> StandardLinearSolid | None:
    """The creep in `course` (T, C) in 1/m, read at `moments` (T,) in s; None where there is none.

    The skin was at rest, reading zero, until it was bent, early in the course, and then held. What
    is read from then on is A + B e^(-t/tau), of which the share phi = B / (A + B) goes. The
    channels share tau, a property of the one glue between them that a channel which hardly creeps
    cannot tell; each has its own phi. Channels of NaN creep not at all. No reading is known better
    than `least` in 1/m.
    """
    from scipy.optimize import minimize_scalar  # slow to import, and seldom needed

    known = np.isfinite(course).all(axis=0)
    if not known.any():
        raise Refusal("every channel was saturated during the hold; lower the amplifier's gain")
    bent = _bent_at(course[:, known])
    t = moments - moments[bent]
    length = float(t[-1])
    held = t > _SETTLING * length
    t, y = t[held], course[held][:, known]
    n, C = y.shape
    if n < 10:
        raise Refusal(
            f"expected a hold spent mostly on the cylinder, got {n} readings after the skin was "
            "bent; start the hold, then bend the skin at once"
        )

    def solved(log_tau: float) -> tuple[Array, Array]:
        """A and B (2, C), and the squares (C,) that they leave."""
        basis = np.column_stack([np.ones(n), np.exp(-t / np.exp(log_tau))])
        found: Array = np.linalg.lstsq(basis, y)[0].astype(float)
        return found, ((y - basis @ found) ** 2).sum(axis=0)

    bounds = float(np.log(length / 100)), float(np.log(length))
    best = minimize_scalar(lambda v: solved(v)[1].sum(), bounds=bounds, method="bounded")
    (A, B), squares = solved(float(best.x))
    still = float(((y - y.mean(axis=0)) ** 2).sum())
    floor = n * C * least**2
    gained = n * C * np.log(max(still, floor) / max(float(squares.sum()), floor))
    if gained < (C + 1) * np.log(n * C):
        return None  # by the Bayesian information criterion no reading moved
    tau = float(np.exp(best.x))
    if tau > 0.95 * length:
        raise Refusal(
            f"the hold of {length:.3g} s is too short for the creep, whose time constant is not "
            "shorter; use a longer hold, or none"
        )
    share = np.zeros(course.shape[1])
    at_once = np.where(A + B == 0, 1.0, A + B)
    share[known] = np.clip(B / at_once, 0.0, _MOST_SHARE)
    return StandardLinearSolid(share, tau)
