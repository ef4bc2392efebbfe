"""Tables 1 and 2, against checked numbers and calculations that share no code with them."""

import json
import math

import numpy as np
import pytest

from kappaskin.errors import Refusal
from kappaskin.studies import misprints, misprints_text, paper_tables, tables_text
from kappaskin.studies.paper import DRAWS, fingertip_scene, table_1, table_2

CASES = ("centre", "off-centre", "line")
CHECKED = {
    # W_applied, E_max, RMS in mm of a linear fit without noise, then the standard deviation of E
    # and the root mean square of RMS with it (analytic).
    "centre": (4.70, -0.048, 0.0041, 0.0284, 0.0174),
    "off-centre": (4.89, -0.111, 0.0100, 0.0161, 0.0196),
    "line": (4.68, -0.000, 0.0008, 0.0284, 0.0169),
}
PRINTED = {
    ("centre", False): (4.59, -0.11, 0.067),
    ("centre", True): (4.98, -0.12, 0.083),
    ("off-centre", False): (4.58, -0.31, 0.316),
    ("off-centre", True): (4.56, 0.34, 0.317),
    ("line", False): (4.63, -0.05, 0.193),
    ("line", True): (4.62, -0.06, 0.191),
}
KEYS = ["table", "case", "noise", "method", "w_applied_mm", "w_max_mm", "e_max_mm", "rms_mm",
        "paper", "functions"]  # fmt: skip
SUMMED = ["summed_e_max_mm", "summed_rms_mm"]  # of Table 1
BESIDES = {True: ["e_max_sd_mm", "covered_95"], False: ["slopes_e_max_mm", "slopes_rms_mm"]}


@pytest.fixture(scope="module")
def rows():
    return {(row["case"], row["noise"]): row for row in table_1()}


class Independent:
    """One load case on a unit square, in mm, from the printed equations; no code of the library."""

    def __init__(self, case):
        place = (0.2, 0.8) if case == "off-centre" else (0.5, 0.5)
        points = np.array([place])
        if case == "line":
            t = (np.arange(2000) + 0.5) / 2000
            points = np.column_stack([0.1 + 0.8 * t, 0.9 - 0.8 * t])
        i = np.arange(1, 16)
        load = np.einsum("pi,pj->ij", *(np.sin(np.pi * np.outer(x, i)) for x in points.T))
        true = load / np.add.outer(i**2, i**2) ** 2
        at_load = self.functions(*np.array([place]).T, 15)
        true = true.ravel() * CHECKED[case][0] / (at_load[0] @ true.ravel())
        x, y = (side.ravel() for side in np.meshgrid(*[(np.arange(10) + 0.5) / 10] * 2))
        self.K = self.curvature(x, y, 15) @ true
        self.fit = np.linalg.pinv(self.curvature(x, y, 8))
        grid = [side.ravel() for side in np.meshgrid(*[np.linspace(0, 1, 101)] * 2)]
        self.skin, self.at = self.functions(*grid, 8), self.functions(*np.array([place]).T, 8)[0]
        self.true_skin, self.true_at = self.functions(*grid, 15) @ true, (at_load @ true)[0]

    @staticmethod
    def functions(x, y, N):
        k = np.pi * np.arange(1, N + 1)
        X, Y = np.sin(np.outer(x, k)), np.sin(np.outer(y, k))
        return np.einsum("pi,pj->pij", X, Y).reshape(len(x), -1)

    @classmethod
    def curvature(cls, x, y, N):
        k = np.pi * np.arange(1, N + 1)
        cosines = np.einsum("pi,pj->pij", np.cos(np.outer(x, k)) * k, np.cos(np.outer(y, k)) * k)
        w = cls.functions(x, y, N)
        return np.vstack([-w * np.repeat(k**2, N), -w * np.tile(k**2, N),
                          cosines.reshape(len(x), -1)])  # fmt: skip

    def errors(self, noise):
        """Error at the load and RMS for `noise` (T, 300), in mm and, for noise, mm per (side)^2."""
        c = (self.K + noise) @ self.fit.T
        left = c @ self.skin.T - self.true_skin
        return c @ self.at - self.true_at, np.sqrt(np.mean(left**2, axis=1))


def test_the_rows_come_in_the_papers_order():
    assert [(row["case"], row["noise"]) for row in table_1()] == list(PRINTED)


def test_every_row_has_exactly_the_promised_keys(rows):
    for (_, noise), row in rows.items():
        assert list(row) == KEYS + SUMMED + BESIDES[noise]
        assert (row["table"], row["method"]) == (1, "least-squares")


def test_the_papers_numbers_stand_beside_ours_as_printed(rows):
    for key, row in rows.items():
        expected = dict(zip(("w_max_mm", "e_max_mm", "rms_mm"), PRINTED[key], strict=True))
        assert row["paper"] == expected


@pytest.mark.parametrize("case", CASES)
def test_without_noise_the_linear_fit_has_the_checked_errors_to_the_digit(rows, case):
    w_applied, e_max, rms, *_ = CHECKED[case]
    row = rows[case, False]

    assert row["w_applied_mm"] == pytest.approx(w_applied, rel=1e-12)
    assert round(row["e_max_mm"], 3) == e_max
    assert round(row["rms_mm"], 4) == rms
    assert row["w_max_mm"] == pytest.approx(row["w_applied_mm"] + row["e_max_mm"], rel=1e-12)


@pytest.mark.parametrize("case", CASES)
def test_without_noise_an_independent_calculation_agrees(rows, case):
    e, rms = Independent(case).errors(np.zeros((1, 300)))

    assert rows[case, False]["e_max_mm"] == pytest.approx(e[0], abs=1e-6)
    assert rows[case, False]["rms_mm"] == pytest.approx(rms[0], abs=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_noise_leaves_the_mean_error_and_spreads_it_as_analysis_says(rows, case):
    *_, sd, _ = CHECKED[case]
    row = rows[case, True]

    error = row["e_max_mm"] - rows[case, False]["e_max_mm"]
    assert abs(error) < 3 * sd / np.sqrt(DRAWS)
    assert row["e_max_sd_mm"] == pytest.approx(sd, abs=3 * sd / np.sqrt(2 * DRAWS))
    assert row["w_max_mm"] == pytest.approx(row["w_applied_mm"] + row["e_max_mm"], rel=1e-12)


@pytest.mark.parametrize("case", CASES)
def test_with_noise_an_independent_simulation_agrees(rows, case):
    *_, sd, root_mean_square = CHECKED[case]
    # Curvature is in mm per (side)^2 here: 1 1/m on a side of 100 mm is 10.
    noise = np.random.default_rng(1).uniform(-4.0, 4.0, (1000, 300))

    e, rms = Independent(case).errors(noise)

    assert e.std() == pytest.approx(sd, abs=3 * sd / np.sqrt(2000))
    spread = np.std(rms**2) / np.sqrt(1000)
    assert np.mean(rms**2) == pytest.approx(root_mean_square**2, abs=3 * spread)
    mine = 3 * rms.std() * np.sqrt(1 / 1000 + 1 / DRAWS)
    assert rows[case, True]["rms_mm"] == pytest.approx(rms.mean(), abs=mine)


def test_the_table_is_the_same_every_time(rows):
    assert table_1() == list(rows.values())


# Table 2


R0 = 12.9e-3
PRINTED_2 = {
    # simulation (w_max, e_max, rms), experiment (w_max, e_max), in mm
    "0.63": ((0.69, 0.06, 0.178), (1.13, 0.49)),
    "1.27": ((1.37, 0.10, 0.160), (1.53, 0.26)),
    "1.90": ((1.83, -0.07, 0.115), (1.79, -0.11)),
}


@pytest.fixture(scope="module")
def rows_2():
    return {(row["case"], row["noise"]): row for row in table_2()}


class IndependentArc:
    """Half a circle in mm from Eqs. 10 and 11 as corrected; no code of the library."""

    def __init__(self, applied):
        k, R = np.arange(1, 9), 12.9
        at, self.theta = math.pi * (np.arange(10) + 0.5) / 10, np.linspace(0, math.pi, 101)
        self.a0 = -applied / 4
        change = -24 * self.a0 * np.sin(3 * at) / R**2
        M = (1 - k**2) * np.sin(np.outer(at, k)) / R**2
        # Pinned and inextensible: c_1 = -(c_3/3 + c_5/5 + c_7/7).
        W = np.vstack([np.where(k[1:] % 2, -1 / k[1:], 0), np.eye(7)])
        self.K, self.fit = change, W @ np.linalg.pinv(M @ W)
        self.S = np.sin(np.outer(self.theta, k))

    def errors(self, noise):
        """Error at the load and RMS, in mm, for `noise` (T, 10) in 1/m."""
        truth = self.a0 * (3 * np.sin(3 * self.theta) - np.sin(self.theta))
        left = (self.K + noise / 1e3) @ self.fit.T @ self.S.T - truth
        return left[:, 50], np.sqrt(np.mean(left**2, axis=1))


def test_table_2_has_six_rows_in_the_papers_order_with_table_1s_keys(rows_2):
    assert [(row["case"], row["noise"]) for row in table_2()] == [
        (case, noise) for case in PRINTED_2 for noise in (False, True)
    ]
    for (case, noise), row in rows_2.items():
        assert list(row) == KEYS + (BESIDES[True] if noise else [])
        assert (row["table"], row["method"]) == (2, "least-squares")
        assert row["w_applied_mm"] == pytest.approx(float(case), rel=1e-12)
        assert row["w_max_mm"] == pytest.approx(row["w_applied_mm"] + row["e_max_mm"], rel=1e-12)


def test_table_2s_printed_numbers_stand_beside_ours_and_null_where_there_is_none(rows_2):
    names = ("w_max_mm", "e_max_mm", "rms_mm")
    for (case, noise), row in rows_2.items():
        simulated, experiment = PRINTED_2[case]
        expected = dict(zip(names, simulated if noise else (None,) * 3, strict=True))
        measured = zip(("experiment_w_max_mm", "experiment_e_max_mm"), experiment, strict=True)
        assert row["paper"] == expected | dict(measured)


def test_the_true_arc_is_equation_10_as_it_must_read():
    scene = fingertip_scene(1.27)

    c = scene.plate.deflection(scene.loads, scene.basis).ravel()

    a0 = -1.27e-3 / 4
    np.testing.assert_allclose(c, [-a0, 0, 3 * a0], atol=1e-17)


def test_without_noise_the_arc_comes_back_exactly(rows_2):
    for case in PRINTED_2:
        assert rows_2[case, False]["rms_mm"] < 1e-12
        assert abs(rows_2[case, False]["e_max_mm"]) < 1e-12


def test_with_the_papers_noise_the_arcs_mean_rms_stays_below_eight_hundredths(rows_2):
    for case in PRINTED_2:
        assert rows_2[case, True]["rms_mm"] <= 0.080


@pytest.mark.parametrize("case", PRINTED_2)
def test_with_noise_an_independent_simulation_of_the_arc_agrees(rows_2, case):
    limit = 4.5 * math.sqrt(3)
    noise = np.random.default_rng(5).uniform(-limit, limit, (4000, 10))

    e, rms = IndependentArc(float(case)).errors(noise)

    # The checked numbers: sd 0.057 mm at the load, mean RMS 0.077, root mean square 0.087 mm.
    assert e.std() == pytest.approx(0.057, abs=0.001)
    assert rms.mean() == pytest.approx(0.077, abs=0.0015)
    assert np.sqrt(np.mean(rms**2)) == pytest.approx(0.087, abs=0.0015)
    row = rows_2[case, True]
    assert row["e_max_sd_mm"] == pytest.approx(e.std(), abs=3 * e.std() / np.sqrt(2 * DRAWS))
    assert abs(row["e_max_mm"]) < 3 * e.std() / np.sqrt(DRAWS)
    assert row["rms_mm"] == pytest.approx(rms.mean(), abs=3 * rms.std() / np.sqrt(DRAWS))


def test_the_flat_strip_is_the_same_study_with_another_patch():
    flat = {(row["case"], row["noise"]): row for row in table_2(math.inf)}

    # Hinged and flat, k^2 c_k is read at once: the covariance by hand, at the same ten places.
    k, a = np.arange(1, 9), math.pi * R0
    x = (np.arange(10) + 0.5) / 10
    A = np.linalg.pinv(-((k * math.pi / a) ** 2) * np.sin(math.pi * np.outer(x, k)))
    S = np.sin(math.pi * np.outer(np.linspace(0, 1, 101), k))
    square = np.mean(np.sum((S @ A) ** 2, axis=1)) * (4.5e3) ** 2
    for case in PRINTED_2:
        assert flat[case, False]["rms_mm"] < 1e-12
        assert flat[case, False]["w_applied_mm"] == pytest.approx(float(case), rel=1e-12)
        assert set(flat[case, True]["paper"].values()) == {None}
        assert 0.7 * math.sqrt(square) < flat[case, True]["rms_mm"] < math.sqrt(square)


def test_table_2_is_the_same_every_time(rows_2):
    assert table_2() == list(rows_2.values())


def test_the_text_has_every_row_and_the_papers_numbers(rows, rows_2):
    lines = tables_text([*rows.values(), *rows_2.values()]).splitlines()

    assert (
        sum(line.startswith(("centre", "off-centre", "line", *PRINTED_2)) for line in lines) == 12
    )
    (noisy,) = (line for line in lines if line.startswith("0.63        yes"))
    assert all(number in noisy for number in ("(0.69)", "(+0.06)", "(0.178)", "1.13"))


# As printed


@pytest.fixture(scope="module")
def misprint():
    return {row["where"]: row for row in misprints()}


def given(row, start):
    (value,) = (value for what, value in row["gives"].items() if what.startswith(start))
    return value


def test_equation_10_as_printed_moves_the_ends_and_bends_nothing(misprint):
    row = misprint["Eq. 10"]

    assert given(row, "u at theta = 0") == pytest.approx(3 * 0.63)
    assert given(row, "u at theta = pi") == pytest.approx(-3 * 0.63)
    assert abs(given(row, "largest change")) < 1e-9
    assert given(row, "RMS") > 0.5


def test_equation_11_as_printed_depends_on_the_unit_of_length(misprint):
    row = misprint["Eq. 11"]

    metres, millimetres = given(row, "at the load"), given(row, "the same computed")
    assert metres == pytest.approx(-4.41e-3 / R0**2 + 0.63e-3 / R0)
    assert millimetres == pytest.approx(1e3 * (-4.41 / 12.9**2 + 0.63 / 12.9))
    assert given(row, "what is meant") == pytest.approx(-6 * 0.63e-3 / R0**2)


def test_equation_6_as_printed_has_a_column_of_zeros_on_the_fingertip(misprint):
    row = misprint["Eq. 6 on the fingertip"]

    assert given(row, "rank") == 7
    assert given(row, "length") < 1e-12
    # The part of sin(theta) that is dropped: a0 over the square root of two.
    assert given(row, "RMS") == pytest.approx(0.63 / 4 / math.sqrt(2), rel=0.01)


def test_the_rigidity_as_printed_is_that_of_less_than_a_beam(misprint):
    row = misprint["Eq. 9"]

    assert given(row, "D as printed over D") == pytest.approx(0.91 / 1.09)
    assert given(row, "D as printed over that of beams") < 1


def test_table_1s_slips_do_not_add_up(misprint):
    assert misprint["Table 1, centred load with noise"]["meant"] == "w_max 4.58 mm"
    assert "-0.33 mm" in misprint["Table 1, off-centre load with noise"]["meant"]


def test_misprints_are_told_to_people_and_to_programs(misprint):
    text = misprints_text(list(misprint.values()))

    assert all(where in text for where in misprint)
    assert max(map(len, text.splitlines())) <= 96
    assert json.loads(json.dumps(list(misprint.values()))) == list(misprint.values())


# Other methods, and gages that sense the bent surface's own curvature.

ON_SLOPES = {
    # E_max and RMS in mm, of a linear fit and of one that knows the slopes.
    "centre": ((-0.076, 0.0143), (-0.0481, 0.0041)),
    "off-centre": ((-0.257, 0.0499), (-0.1210, 0.0104)),
    "line": ((-0.031, 0.0180), (-0.0000, 0.0008)),
}


@pytest.mark.cases("line")
@pytest.mark.parametrize("case", CASES)
def test_finite_slopes_explain_most_of_the_papers_error_and_can_be_undone(rows, case):
    linear, known = ON_SLOPES[case]
    row = rows[case, False]
    finite = {r["case"]: r for r in table_1("finite-slope") if not r["noise"]}[case]

    assert (row["slopes_e_max_mm"], row["slopes_rms_mm"]) == pytest.approx(linear, abs=6e-4)
    given = finite["slopes_e_max_mm"], finite["slopes_rms_mm"]
    assert given == pytest.approx(known, abs=6e-5)
    assert 0.6 < abs(linear[0] / PRINTED[case, False][1]) < 0.85


def test_a_priors_rows_are_within_what_is_asked_and_tell_what_their_bands_cover():
    most = {"centre": 0.001, "off-centre": 0.0015, "line": 0.0006}

    for row in table_1("bayes", (15, 15)):
        assert row["method"] == "bayes"
        assert row["functions"] == [15, 15]
        assert row["rms_mm"] <= (0.021 if row["noise"] else most[row["case"]])
        if row["noise"]:
            assert 0.9 < row["covered_95"] < 1


def test_a_table_that_a_method_refuses_says_why_and_both_are_an_error():
    rows = paper_tables("fast")

    assert [row["table"] for row in rows] == [1] * 6 + [2]
    assert "expected a flat skin" in rows[-1]["refused"]
    assert "refused: expected a flat skin" in tables_text(rows)
    with pytest.raises(Refusal, match="140 of the 144"):
        paper_tables("least-squares", (12, 12))
