"""The gallery of hard cases, and whether its judge can be trusted.

The judge is shown estimators that are bad on purpose: each must be found out.
"""

import json
import math
import re
from collections import Counter
from dataclasses import replace

import mpmath
import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, RankDeficient, SensorLayout, SineBasis, basis_for
from kappaskin.estimation import METHODS, AsPrinted, Fit, singular_values
from kappaskin.estimation.fit import DenseUncertainty
from kappaskin.studies import run_stability
from kappaskin.studies.stability import rows_of
from kappaskin.studies.stability.gallery import CaseKind, gallery
from kappaskin.studies.stability.reference import least_squares, reference_of

pytestmark = pytest.mark.slow

CASES = {case.name: case for case in gallery()}

SEEK_LEAST_SQUARES = ("least-squares", "direct")


@pytest.fixture(scope="module")
def rows():
    return run_stability()


def verdicts(rows, **wanted):
    """The verdicts of the rows that have what is `wanted`, in order."""
    return [r["verdict"] for r in rows if all(r[k] == v for k, v in wanted.items())]


# The gallery


@pytest.mark.full
def test_there_is_a_row_for_every_case_method_and_precision(rows):
    assert len(rows) >= 40
    assert max(Counter((r["case"], r["method"], r["precision"]) for r in rows).values()) == 1
    assert {r["method"] for r in rows} == set(METHODS)
    assert {r["precision"] for r in rows} == {"float64", "float32"}
    assert {r["case"] for r in rows} >= {
        n for n, c in CASES.items() if c.kind is not CaseKind.LARGE
    }


def test_no_method_of_ours_is_wrong(rows):
    assert not [(r["method"], r["case"]) for r in rows if r["verdict"] == "wrong"]


def test_least_squares_is_exact_wherever_nothing_is_announced(rows):
    plain = [r for r in rows if r["method"] in SEEK_LEAST_SQUARES and not r["announced"]]

    assert len(plain) > 100
    assert {r["verdict"] for r in plain} == {"exact"}


def test_eq_6_as_printed_breaks_where_it_must_and_nobody_else_does(rows):
    broken = {r["case"] for r in rows if r["verdict"] == "breaks"}

    assert {r["method"] for r in rows if r["verdict"] == "breaks"} == {"as-printed"}
    # Without an inverse of M'M, rounding decides whether the elimination of noise is noticed.
    assert broken - {"Ni > m, Nj > n"} == {
        "Ni > m, Nj > n, exact",
        "Ni = 2m, Nj = 2n",
        "heights, Ni > m",
        "pairs 1e-09 m apart",
        "pairs 1e-16 m apart",
    }


@pytest.mark.parametrize("case", ["paper", "paper, exact", "Ni = m", "1 mm patch", "1 m patch"])
def test_eq_6_as_printed_is_exact_where_columns_are_orthogonal(rows, case):
    assert verdicts(rows, case=case, method="as-printed") == ["exact", "exact"]


def test_eq_6_as_printed_loses_twice_the_digits_of_the_condition(rows):
    (row,) = [
        r
        for r in rows
        if (r["case"], r["method"], r["precision"])
        == ("dead quarter, 8 x 8", "as-printed", "float64")
    ]

    assert row["digits_lost"] == pytest.approx(2 * math.log10(row["condition_scaled"]), abs=1)


@pytest.mark.parametrize(
    ("case", "cause"),
    [
        (
            "Ni > m, Nj > n",
            "determine 140 of the 144 .* finer than the elements have the readings of coarser ones",
        ),
        ("Ni = 2m, Nj = 2n", "determine at most 300 of the 400 coefficients"),
        ("fingertip, free ends", "is a rigid motion without curvature"),
        ("all dead", "no readings are left"),
        ("all NaN", "frame 0: .* no readings are left"),
    ],
)
@pytest.mark.parametrize("method", SEEK_LEAST_SQUARES)
def test_a_refusal_names_its_cause(rows, method, case, cause):
    found = [r for r in rows if (r["case"], r["method"]) == (case, method)]

    assert [r["verdict"] for r in found] == ["refused", "refused"]
    for row in found:
        assert re.search(cause, row["reason"])


def test_a_refused_frame_is_counted_once(rows):
    assert not [r for r in rows if r["reason"].count("frame 0") > 1]


def test_readings_are_refused_only_where_it_is_announced(rows):
    refused = [r for r in rows if r["verdict"] == "refused" and not r["announced"]]

    # What is left is a method that does not take the skin, and says so.
    assert all(r["reason"].startswith("expected ") or r["method"] == "as-printed" for r in refused)
    assert {r["case"] for r in refused if r["method"] == "as-printed"} == {
        "fingertip",
        "fingertip, exact",
    }


@pytest.mark.parametrize(
    ("case", "scaled", "unscaled"),
    [
        ("paper", 1.0, 64.0),
        ("Ni > m", 10.0, None),
        ("Ni > m, Nj > n", None, None),
        ("1 mm patch", 1.0, 64.0),
    ],
)
def test_the_conditions_are_those_of_the_physics(rows, case, scaled, unscaled):
    for row in (r for r in rows if r["case"] == case):
        assert row["condition_scaled"] == (scaled and pytest.approx(scaled, abs=0.01))
        if scaled is None or unscaled is not None:
            assert row["condition_unscaled"] == (unscaled and pytest.approx(unscaled, rel=1e-9))


def test_finite_slopes_converge_in_float32_as_in_float64(rows):
    for case in ("only xx", "scattered", "slopes of 0.5"):
        assert verdicts(rows, case=case, method="finite-slope") == ["exact", "exact"]


@pytest.mark.parametrize(
    "case", ["no load, exact", "pairs 1e-09 m apart", "pairs 1e-16 m apart", "spikes", "all NaN"]
)
def test_the_hardest_cases_raise_no_warnings(rows, case):
    # Here, where warnings are errors; the gallery runs in processes of its own.
    again = rows_of(CASES[case])

    expected = [r for r in rows if r["case"] == case]
    assert [r["verdict"] for r in again] == [r["verdict"] for r in expected]


# The command


def test_the_command_prints_one_list_without_nan(rows, run, monkeypatch):
    monkeypatch.setattr("kappaskin.studies.run_stability", lambda long, told: rows)

    code, out, err = run("stability", "--json")

    assert (code, err) == (0, "")
    assert json.loads(out, parse_constant=pytest.fail) == rows


def test_the_table_has_every_case_with_what_is_hard_about_it(rows, run, monkeypatch):
    monkeypatch.setattr("kappaskin.studies.run_stability", lambda long, told: rows)

    code, out, _ = run("stability")

    assert code == 0
    joined = " ".join(out.split())
    for row in rows:
        assert row["case"] in joined
        assert row["hard"] in joined
    assert max(map(len, out.splitlines())) <= 132


# The judge


def judged(case, estimator, method="least-squares"):
    """The row of an estimator on a case, in float64."""
    return rows_of(case, {method: estimator})[0]


class WithoutBars(LeastSquares):
    def _fit(self, flat, used):
        N = self.basis.size
        return replace(
            super()._fit(flat, used), uncertainty=DenseUncertainty(lambda: np.zeros((N, N)))
        )


class BarsOfNothing(WithoutBars):
    def _fit(self, flat, used):
        N = self.basis.size
        nothing = DenseUncertainty(lambda: np.full((N, N), np.nan))
        return replace(super()._fit(flat, used), uncertainty=nothing)


class Pseudo(AsPrinted):
    """A pseudo-inverse that drops what curvature does not see, sure of what is left."""

    def _fit(self, flat, used):
        c = np.linalg.pinv(self.M[used], rcond=1e-9) @ flat[..., used].T
        bars = DenseUncertainty(lambda: np.linalg.pinv(self.M[used].T @ self.M[used], rcond=1e-15))
        return self._answer(flat, c.T, bars, int(used.sum()) - self.unknowns)


class Off(LeastSquares):
    by = 1e-9

    def _fit(self, flat, used):
        fit = super()._fit(flat, used)
        return replace(fit, coefficients=fit.coefficients * (1 + self.by))


class FarOff(Off):
    by = 0.5


class NoNumbers(Off):
    by = np.nan


class FlagsAll(FarOff):
    def _fit(self, flat, used):
        return replace(super()._fit(flat, used), converged=np.zeros(len(flat), bool))


class FlagsOne(Off):
    by = 0.0

    def _fit(self, flat, used):
        fit = super()._fit(flat, used)
        c = fit.coefficients.copy()
        c[3] *= 10
        return replace(fit, coefficients=c, converged=np.arange(len(flat)) != 3)


class Crashes(LeastSquares):
    def _fit(self, flat, used):
        raise ZeroDivisionError("a defect, not a refusal")


@pytest.mark.parametrize("case", ["paper", "load on an element", "spikes", "dead row"])
def test_an_answer_without_error_bars_is_wrong(case):
    assert judged(CASES[case], WithoutBars)["verdict"] == "wrong"
    assert judged(CASES[case], BarsOfNothing)["verdict"] == "wrong"


@pytest.mark.parametrize("case", ["fingertip, exact", "fingertip"])
def test_a_pseudo_inverse_that_drops_the_rigid_motion_is_wrong(case):
    row = judged(CASES[case], Pseudo)

    assert row["verdict"] == "wrong"
    assert row["error_mm"] > 0.1


def test_a_pseudo_inverse_that_drops_what_aliases_is_wrong_without_noise():
    assert judged(CASES["Ni > m, Nj > n, exact"], Pseudo)["verdict"] == "wrong"


def test_the_same_answer_breaks_when_it_is_eq_6():
    assert judged(CASES["fingertip, exact"], Pseudo, "as-printed")["verdict"] == "breaks"


def test_a_shape_beyond_its_bars_is_wrong():
    assert judged(CASES["paper"], FarOff)["verdict"] == "wrong"


def test_coefficients_that_are_no_numbers_are_wrong():
    row = judged(CASES["paper"], NoNumbers)

    assert row["verdict"] == "wrong"
    json.dumps(row, allow_nan=False)


def test_a_covered_answer_that_loses_digits_is_degraded_by_so_many():
    row = judged(CASES["paper"], Off)

    assert row["verdict"] == "degraded"
    assert row["digits_lost"] == pytest.approx(math.log10(1e-9 / np.finfo(float).eps), abs=0.01)


def test_digits_lost_without_noise_and_beyond_the_bars_are_wrong():
    assert judged(CASES["paper, exact"], Off)["verdict"] == "wrong"


def test_frames_that_the_method_flags_degrade_the_others_and_no_more():
    row = judged(CASES["paper"], FlagsOne)

    assert (row["verdict"], row["reason"][:18]) == ("degraded", "1 of 40 frames are")
    assert judged(CASES["paper"], FlagsAll)["verdict"] == "degraded"


def test_a_defect_is_no_refusal():
    with pytest.raises(ZeroDivisionError):
        judged(CASES["paper"], Crashes)


def test_a_bound_that_leaves_less_than_two_digits_lets_nothing_be_exact():
    case = CASES["pairs 1e-09 m apart"]
    reference = reference_of(case)
    c = reference.answer

    assert reference.near(c, c, np.finfo(float).eps)
    assert not reference.near(c, c, np.finfo(np.float32).eps)


# The reference


@pytest.mark.parametrize("gap", [1.0, 1e-4, 1e-8, 1e-12])
def test_double_double_is_least_squares_to_more_digits_than_float64_has(gap):
    rng = np.random.default_rng(1)
    A = rng.normal(size=(12, 5))
    A[:, 4] = A[:, 3] + gap * A[:, 4]
    b = rng.normal(size=12)

    found = least_squares(A, None, b).unknowns

    assert off_by(found, mpmath.matrix(A.tolist()), b) < 1e-19


def off_by(found, A, b):
    """The largest error of a pair, relative to the largest number, by Eq. 6 to 80 digits."""
    with mpmath.workdps(80):
        expected = mpmath.lu_solve(A.T * A, A.T * mpmath.matrix(b.tolist()))
        pairs = zip(found.high.tolist(), found.low.tolist(), expected, strict=True)
        off = max(abs(mpmath.mpf(high) + mpmath.mpf(low) - x) for high, low, x in pairs)
        return float(off / max(abs(x) for x in expected))


def test_double_double_knows_what_the_edges_decide():
    case = CASES["fingertip, exact"]
    W, b = case.basis.free, case.curvature[0, 0]
    A = case.layout.operator(case.basis)[:10]

    found = least_squares(A, W, b).unknowns

    with mpmath.workdps(80):
        product = mpmath.matrix(A.tolist()) * mpmath.matrix(W.tolist())
    assert off_by(found, product, b) < 1e-25


@pytest.mark.full
def test_a_wrong_sigma_is_wrong_unless_the_answer_says_so(monkeypatch):
    case = CASES["sigma half the noise"]
    methods = {name: METHODS[name] for name in ("least-squares", "fast", "bayes", "robust")}

    assert {row["verdict"] for row in rows_of(case, methods)} == {"degraded"}
    monkeypatch.setattr(Fit, "sigma_ratio", 1.0)
    assert {row["verdict"] for row in rows_of(case, methods)} == {"wrong"}


def test_a_drift_that_is_left_in_the_readings_is_found_out(monkeypatch):
    only = {"least-squares": LeastSquares}

    assert {row["verdict"] for row in rows_of(CASES["drift"], only)} == {"exact"}
    monkeypatch.setattr("kappaskin.studies.stability._WithoutDrift", lambda estimator: estimator)
    assert {row["verdict"] for row in rows_of(CASES["drift"], only)} == {"wrong"}


def test_there_is_no_reference_where_the_readings_decide_nothing():
    assert least_squares(np.ones((5, 2)), None, np.arange(5.0)) is None
    assert least_squares(np.eye(2, 3), None, np.ones(2)) is None
    assert reference_of(CASES["Ni > m, Nj > n"]).answer is None


def test_the_reference_by_transforms_is_that_by_double_double():
    case = replace(CASES["paper"], kind=CaseKind.LARGE)
    dense, fast = reference_of(CASES["paper"]), reference_of(case)

    g, h = dense.scaled(fast.answer), dense.scaled(dense.answer)
    np.testing.assert_allclose(g, h, rtol=0, atol=1e-14 * np.linalg.norm(h))
    np.testing.assert_allclose(fast.length, dense.length, rtol=1e-12)
    for name in ("condition", "unscaled", "norm", "readings", "left", "count"):
        assert getattr(fast, name) == pytest.approx(getattr(dense, name), rel=1e-10)


# What the elements see


@pytest.mark.parametrize("name", ["paper", "Ni > m", "dead quarter, 8 x 8", "fingertip", "1:100"])
def test_singular_values_are_those_of_the_condition(name):
    case = CASES[name]

    values, shapes = singular_values(case.basis, case.layout)

    condition = LeastSquares(case.basis, case.layout).condition
    assert values[0] / values[-1] == pytest.approx(condition, rel=1e-6)
    assert np.all(np.diff(values) <= 0)
    np.testing.assert_allclose(np.sum(shapes**2, axis=(1, 2)), 1)


@pytest.mark.parametrize("name", ["paper", "Ni > m", "scattered"])
def test_shapes_leave_readings_that_are_orthogonal(name):
    case = CASES[name]

    _, shapes = singular_values(case.basis, case.layout)

    K = case.layout.operator(case.basis) @ shapes.reshape(len(shapes), -1).T
    K /= np.linalg.norm(K, axis=0)
    np.testing.assert_allclose(K.T @ K, np.eye(len(shapes)), atol=1e-12)


def test_four_mixtures_of_12_by_12_functions_change_no_reading():
    case = CASES["Ni > m, Nj > n"]

    values, shapes = singular_values(case.basis, case.layout)

    assert np.sum(values < 1e-12) == 4
    K = case.layout.operator(case.basis) @ shapes[-4:].reshape(4, -1).T
    np.testing.assert_allclose(K, 0, atol=1e-8)
    assert np.linalg.matrix_rank(shapes[-4:].reshape(4, -1)) == 4


def test_functions_for_which_there_are_no_readings_have_singular_values_of_zero():
    case = CASES["Ni = 2m, Nj = 2n"]

    values, shapes = singular_values(case.basis, case.layout)

    assert len(values) == len(shapes) == 400
    assert np.sum(values < 1e-12) >= 100


def test_an_arc_with_free_ends_does_not_see_its_first_function():
    case = CASES["fingertip, free ends"]

    values, shapes = singular_values(case.basis, case.layout)

    assert values[-1] == 0
    np.testing.assert_allclose(np.abs(shapes[-1].ravel()), np.eye(8)[0], atol=1e-12)


def test_the_rigid_motions_of_a_rim_that_gives_are_among_the_unseen():
    patch = Patch(0.1, 0.08)
    basis = basis_for(patch, "elastic", 6, 5)

    values, shapes = singular_values(basis, SensorLayout.regular(patch, 8, 8))

    q = basis.unobservable.shape[1]
    assert np.all(values[-q:] == 0)
    assert np.all(values[:-q] > 1e-3)
    np.testing.assert_allclose(
        shapes[-q:].reshape(q, -1).T,
        basis.unobservable / np.linalg.norm(basis.unobservable, axis=0),
    )


def test_nothing_is_seen_where_every_element_is_dead():
    case = CASES["all dead"]

    values, shapes = singular_values(case.basis, case.layout)

    assert np.all(values == 0)
    assert np.linalg.matrix_rank(shapes.reshape(64, 64)) == 64


def test_a_strip_misses_only_the_readings_that_it_has():
    patch = Patch(0.1, 0.02, strip=True)
    layout = SensorLayout.regular(patch, 10, 1).without([0, 1, 2])

    with pytest.raises(RankDeficient, match="3 of 10 readings are missing"):
        LeastSquares(SineBasis(patch, 8, 1), layout)
