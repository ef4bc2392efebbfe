"""What the comparison with others prints: each way is right, and the guide's table is its own."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import kappaskin.studies
import kappaskin_resources
from kappaskin import GaussianLoad, Patch, Plate, SineBasis, load_scene
from kappaskin.cli import REFUSED, main
from kappaskin.studies import compared, compared_text
from kappaskin.studies.compare import (
    WITHIN,
    errors_text,
    lsqr_solver,
    lstsq_solver,
    pinv_solver,
    plate_solver,
    slopes_solver,
)
from kappaskin.studies.paper import LoadCase, table_1

pytestmark = pytest.mark.slow

PAGE = Path(kappaskin_resources.__file__).parent / "guide" / "validation.md"
OURS = "Kappaskin, least squares"


@pytest.fixture(scope="module")
def rows():
    return compared()


def of(rows, work):
    """The rows of the works whose name begins so, by who did them."""
    return {row.by: row for row in rows if row.work.startswith(work)}


@pytest.mark.full
def test_the_guides_table_has_the_errors_of_a_fresh_run(rows, same_but_for_the_last_digit):
    page = PAGE.read_text("utf-8").splitlines()
    table = [line[4:] for line in page if line.startswith("    ")]

    ways, works = {row.by for row in rows}, [row.work for row in rows]
    width = len(errors_text(rows[0]))
    told = [line[:width] for line in table if line[:26].rstrip() in ways]
    fresh = [errors_text(row) for row in rows]
    assert same_but_for_the_last_digit("\n".join(told), "\n".join(fresh))
    assert [line for line in table if line in works] == list(dict.fromkeys(works))


@pytest.mark.parametrize("name", ["centre", "off-centre"])
def test_our_rows_are_table_1s(rows, name):
    ours = of(rows, f"Table 1, {name}")[OURS]

    exact, noisy = (row for row in table_1() if row["case"] == name)
    assert ours.e_exact_mm == pytest.approx(exact["e_max_mm"], rel=1e-9)
    assert ours.rms_exact_mm == pytest.approx(exact["rms_mm"], rel=1e-9)
    assert ours.e_mm == pytest.approx(noisy["e_max_mm"], rel=1e-9)
    assert ours.e_sd_mm == pytest.approx(noisy["e_max_sd_mm"], rel=1e-9)
    assert ours.rms_mm == pytest.approx(noisy["rms_mm"], rel=1e-9)


@pytest.mark.parametrize("make", [lstsq_solver, pinv_solver, lsqr_solver])
def test_others_have_our_coefficients_where_readings_decide_them(make):
    case = LoadCase.of(load_scene("centre"), "least-squares", (8, 8))
    noisy = case.noisy()[:3]

    one, many = (make(case).solve(readings) for readings in (noisy[0], noisy))

    mine = case.fit(noisy).coefficients.reshape(3, 64)
    np.testing.assert_allclose(many, mine, atol=1e-6 * np.abs(mine).max())
    np.testing.assert_allclose(one, many[0], atol=1e-15)


def test_others_leave_out_of_a_bent_skin_what_bends_nothing(rows):
    its = of(rows, "Table 2")

    assert its[OURS].rms_exact_mm < 1e-9
    for by in ("numpy.linalg.lstsq", "numpy.linalg.pinv, once", "scipy.sparse.linalg.lsqr"):
        # a0 sin(theta), with a0 a quarter of the 0.63 mm, and half a circle's mean square
        assert its[by].rms_exact_mm == pytest.approx(0.63 / 4 / np.sqrt(2), rel=0.01)
        assert its[by].e_exact_mm == pytest.approx(-0.63 / 4, rel=1e-6)


def test_slopes_are_integrated_to_the_surface_they_belong_to():
    scene = load_scene("centre")
    case = LoadCase.of(scene, "least-squares", (8, 8))
    basis = SineBasis(scene.plate.patch, 3, 2)
    c = np.array([[1.0, -0.4], [0.3, 0.2], [-0.1, 0.15]])
    readings = (scene.layout.operator(basis) @ c.ravel()).reshape(3, -1)
    points = np.random.default_rng(0).uniform(0, 0.1, (50, 2))

    way = slopes_solver(case)

    np.testing.assert_allclose(
        way.at(points) @ way.solve(readings), basis.at(points) @ c.ravel(), atol=2e-3
    )


def test_finite_elements_bend_a_plate_as_the_series_does():
    plate, load = Plate(Patch(0.1, 0.07), 0.5), GaussianLoad(0.04, 0.036, 7e-3, 3.0)
    basis, points = SineBasis(plate.patch, 40, 40), np.array([[0.04, 0.036], [0.07, 0.02]])

    mine = basis.at(points) @ plate.deflection([load], basis).ravel()

    for element, cells, off in (("Argyris", 6, 2e-4), ("Morley", 24, 2e-2)):
        way = plate_solver(plate, element, cells)
        np.testing.assert_allclose(way.at(points) @ way.solve(load), mine, rtol=off)


def test_each_plate_comes_as_near_as_is_asked(rows):
    its = of(rows, "A plate")

    assert len(its) == 3
    for row in its.values():
        assert 0 < row.rms_exact_mm < WITHIN  # of a shape of 1 mm at its highest
        assert row.e_mm is row.error_bars is None


def test_times_are_over_those_of_our_first_way(rows):
    for row in rows:
        ours = next(iter(of(rows, row.work).values()))
        assert row.ratio == pytest.approx(row.frame_s / ours.frame_s)
        assert min(row.setup_s, row.frame_s, row.memory_bytes) > 0


def test_without_scikit_fem_it_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "skfem", None)

    assert main(["compare"]) == REFUSED

    assert "pip install 'scikit-fem'" in capsys.readouterr().err


def test_the_command_prints_the_table_or_its_rows(rows, monkeypatch, capsys):
    monkeypatch.setattr(kappaskin.studies, "compared", lambda: rows)

    assert main(["compare"]) == 0
    assert capsys.readouterr().out == compared_text(rows) + "\n"
    assert main(["compare", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["by"] for row in told] == [row.by for row in rows]
    assert told[0]["rms_exact_mm"] == rows[0].rms_exact_mm
