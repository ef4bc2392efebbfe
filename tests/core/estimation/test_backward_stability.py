"""Backward stability: each answer is the exact one for readings and an M a few roundings away.

That is asked of layouts, masks, sizes and scales as they come, however badly they decide a shape.
Everything is in the scaled unknowns g, of which each bends the skin alike: A g = K.
"""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin import LeastSquares, Patch, RankDeficient, Refusal, SensorLayout, SineBasis
from kappaskin.estimation import AsPrinted, Direct

METHODS = {"least-squares": LeastSquares, "direct": Direct}
every_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)

ROUNDINGS = 20
"""How many, times the square root of the readings, an answer may be away."""


class Problem:
    """A g = K of the live readings: A (R, F) with columns of unit length."""

    def __init__(self, basis, layout):
        self.basis, self.layout = basis, layout
        self.live = layout.live.ravel()
        self.W = np.eye(basis.size) if basis.free is None else basis.free
        A = layout.operator(basis)[self.live] @ self.W
        self.length = np.linalg.norm(A, axis=0)
        self.length[self.length <= 1e-15 * self.length.max()] = np.inf  # nothing but rounding
        self.A = A / self.length
        self.U, self.s, _ = np.linalg.svd(self.A, full_matrices=False)

    def some(self, seed, consistent):
        """Readings (R,), of a shape or of nothing at all."""
        rng = np.random.default_rng(seed)
        R, F = self.A.shape
        return self.A @ rng.normal(size=F) if consistent else rng.normal(size=R)

    def solved(self, fit, b):
        """g (F,) of the fit to readings b (R,)."""
        K = np.full(self.live.shape, np.nan)
        K[self.live] = b
        c = fit(K.reshape(3, -1)).coefficients.ravel()
        return self.length * np.linalg.lstsq(self.W, c.astype(float))[0]

    def backward_error(self, g, b):
        """How far A must be changed, relative to |A|, for g to be the least-squares answer.

        The estimate of Karlson and Walden (doi:10.1023/A:1022326611041), of which the true one is
        within a factor of two; at most the residual itself, changing A until nothing is left.
        """
        r = b - self.A @ g
        size = np.linalg.norm(g)
        if not size:
            return np.linalg.norm(self.A.T @ r) / (self.s[0] * max(np.linalg.norm(r), 1e-300))
        n = np.linalg.norm(r) / size
        spread = np.hypot(self.s, n)
        shares = np.divide(self.s, spread, where=spread > 0, out=np.zeros_like(spread))
        return min(np.linalg.norm(shares * (self.U.T @ r)) / size, n) / self.s[0]


def limit(problem, dtype=np.float64):
    return ROUNDINGS * math.sqrt(len(problem.A)) * float(np.finfo(dtype).eps)


@cache
def grid(n, side=0.1, beyond=0):
    """n x n functions on n + 1 - `beyond` elements a side."""
    patch = Patch(side, side)
    m = n + 1 - beyond
    return Problem(SineBasis(patch, n, n), SensorLayout.regular(patch, m, m))


def thin(n):
    patch = Patch(0.5, 0.02)
    return Problem(SineBasis(patch, n, 4), SensorLayout.regular(patch, n + 1, 5))


SIZES = {
    **{f"{n} x {n}": grid(n) for n in (1, 2, 8, 16)},
    "Ni = m": grid(10, beyond=1),
    "64 x 4": thin(64),
}


@every_method
@pytest.mark.parametrize("consistent", [True, False], ids=["a shape", "anything"])
@pytest.mark.parametrize("problem", SIZES.values(), ids=SIZES)
def test_an_answer_is_exact_for_readings_a_few_roundings_away(method, problem, consistent):
    b = problem.some(0, consistent)

    g = problem.solved(method(problem.basis, problem.layout), b)

    assert problem.backward_error(g, b) < limit(problem)


@every_method
@pytest.mark.parametrize("problem", SIZES.values(), ids=SIZES)
def test_the_residual_of_a_shape_is_rounding(method, problem):
    b = problem.some(1, consistent=True)

    g = problem.solved(method(problem.basis, problem.layout), b)

    size = problem.s[0] * np.linalg.norm(g) + np.linalg.norm(b)
    assert np.linalg.norm(b - problem.A @ g) < limit(problem) * size


@every_method
@pytest.mark.parametrize("problem", [SIZES["8 x 8"], SIZES["64 x 4"]], ids=["8 x 8", "64 x 4"])
def test_in_float32_they_are_roundings_of_float32(method, problem):
    b = problem.some(2, consistent=True)

    g = problem.solved(method(problem.basis, problem.layout, dtype=np.float32), b)

    error = problem.backward_error(g, b)
    assert 1e-12 < error < limit(problem, np.float32)


@every_method
@given(st.floats(-3, 0), st.integers(2, 12), st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_from_a_millimetre_to_a_metre_only_the_unit_changes(method, power, n, seed):
    side = 10**power
    small, unit = grid(n, side), grid(n, 1.0)
    b = unit.some(seed, consistent=False)

    g = small.solved(method(small.basis, small.layout), b)
    h = unit.solved(method(unit.basis, unit.layout), b)

    np.testing.assert_allclose(g, h, rtol=0, atol=limit(unit) * np.linalg.norm(b))
    assert small.backward_error(g, b) < limit(small)


@st.composite
def skins(draw):
    """A basis and a layout of any shape, size and mask that decides it, well or badly."""
    a = 10 ** draw(st.floats(-3, 0))
    patch = Patch(a, a * 10 ** draw(st.floats(-2, 2)))
    functions = draw(st.tuples(st.integers(1, 7), st.integers(1, 7)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    if draw(st.booleans()):
        m, n = draw(st.tuples(st.integers(1, 9), st.integers(1, 9)))
        layout = SensorLayout.regular(patch, m, n)
    else:
        count, heaps = draw(st.tuples(st.integers(1, 60), st.integers(1, 8)))
        width = 10 ** draw(st.floats(-9, 0))
        middles = rng.uniform(0, 1, (heaps, 2))[rng.integers(heaps, size=count)]
        at = np.clip(middles + width * rng.normal(size=(count, 2)), 0, 1)
        layout = SensorLayout.scattered(patch, at * (patch.a, patch.b))
    live = layout.live & (rng.random(layout.live.shape) > draw(st.sampled_from([0.0, 0.1, 0.5])))
    return SineBasis(patch, *functions), SensorLayout(patch, layout.positions, live, layout.shape)


@every_method
@given(skins(), st.booleans(), st.integers(0, 2**32 - 1))
@settings(max_examples=150, deadline=None)
def test_any_skin_is_answered_as_exactly_or_refused(method, skin, consistent, seed):
    basis, layout = skin
    problem = Problem(basis, layout) if layout.live.any() else None
    try:
        fit = method(basis, layout)
        b = problem.some(seed, consistent) if problem else np.empty(0)
        g = problem.solved(fit, b) if problem else fit(np.zeros((3, len(layout))))
    except RankDeficient:
        R, F = problem.A.shape if problem else (0, 1)
        assert R < F or not problem.s[-1] > 4 * max(R, F) * np.finfo(float).eps * problem.s[0]
    else:
        assert problem.backward_error(g, b) < limit(problem)


@given(skins())
@settings(max_examples=60, deadline=None)
def test_both_methods_refuse_the_same_skins(skin):
    said = []
    for method in METHODS.values():
        try:
            method(*skin)(np.ones((3, len(skin[1]))))
        except Refusal:
            said.append("refused")
        else:
            said.append("answered")
    if said[0] != said[1]:  # only where rounding decides
        s = Problem(*skin).s
        assert 1e-2 < s[-1] / (s[0] * max(Problem(*skin).A.shape) * np.finfo(float).eps) < 1e2


def test_eq_6_as_printed_is_not_backward_stable():
    case = clustered()

    b = case.some(3, consistent=True)
    g = case.solved(AsPrinted(case.basis, case.layout), b)

    assert case.backward_error(g, b) > 1e3 * limit(case)


@every_method
def test_badly_seen_shapes_leave_no_larger_residual(method):
    case = clustered()
    b = case.some(3, consistent=True)

    g = case.solved(method(case.basis, case.layout), b)

    assert case.s[0] / case.s[-1] > 1e6
    assert case.backward_error(g, b) < limit(case)


def clustered():
    """Four functions of nine elements in one heap of some nanometres."""
    patch = Patch(0.1, 0.1)
    at = 0.03 + 1e-9 * np.random.default_rng(0).normal(size=(9, 2))
    return Problem(SineBasis(patch, 2, 2), SensorLayout.scattered(patch, at))
