"""Table 1, against the checked numbers and against a calculation that shares no code with it."""

import numpy as np
import pytest

from kappaskin.studies.tables import DRAWS, table_1

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
        "paper"]  # fmt: skip


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
        assert list(row) == KEYS + ["e_max_sd_mm"] * noise
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
