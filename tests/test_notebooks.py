"""The notebooks run, in seconds each, and their numbers are right; they have no outputs stored."""

import ast
import json
import math
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

pyplot = pytest.importorskip("matplotlib.pyplot")
NOTEBOOKS = Path(str(files("kappaskin_resources"))) / "notebooks"
MOST = 10  # cells

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def no_windows():
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


def run(name: str) -> dict[str, object]:
    """The names after all cells of a notebook; what a cell ends with is shown as Jupyter does."""
    names: dict[str, object] = {"__name__": "__main__"}
    for cell in json.loads((NOTEBOOKS / f"{name}.ipynb").read_text("utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]))
        last = tree.body[-1]
        exec(compile(ast.Module(tree.body, []), name, "exec"), names)
        if isinstance(last, ast.Expr) and isinstance(last.value, ast.Name):
            assert "<table>" in names[last.value.id]._repr_html_()
    return names


@pytest.mark.parametrize("file", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda file: file.stem)
def test_a_notebook_is_short_and_has_no_outputs(file):
    cells = json.loads(file.read_text("utf-8"))["cells"]

    assert len(cells) <= MOST
    assert [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")] == []


def test_the_tables_of_the_paper_come_out_as_computed_by_hand():
    found = run("paper-tables")

    centre = found["rows"][0]
    assert found["at_load"] == pytest.approx(-0.048, abs=5e-4)
    assert found["rms"] == pytest.approx(0.0041, abs=5e-5)
    assert (centre["e_max_mm"], centre["rms_mm"]) == pytest.approx(
        (found["at_load"], found["rms"]), abs=1e-4
    )
    # 0.0284 mm by theory; 200 draws tell a standard deviation to 5 %.
    assert found["noisy_at_load"].std() == pytest.approx(0.0284, rel=0.15)


def test_a_costlier_setting_is_on_the_frontier_only_where_it_is_better():
    found = run("accuracy-cost")

    errors = [one.rms for one in found["best"]]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] == pytest.approx(min(one.rms for one in found["measured"]), rel=0.02)
    assert found["found"].errors.rms <= 0.03e-3


def test_a_live_force_scatters_as_its_interval_says():
    found = run("live")

    assert len(found["taken"]) == 50
    assert found["force"].std() == pytest.approx(found["half"].mean() / 1.97, rel=0.4)
    assert not found["serving"].is_alive()


def test_heights_of_a_csv_come_back_as_a_shape():
    found = run("own-sensor")

    assert len(found["middle"]) == 200
    np.testing.assert_allclose(found["middle"], found["depth"], atol=0.05)


def test_a_design_scatters_as_predicted():
    found = run("design")

    assert found["largest"][8] / found["largest"][16] == pytest.approx(2.0, rel=0.05)
    assert found["means"]["placed"] < found["means"]["regular"]
    assert found["simulated"] == pytest.approx(found["means"]["placed"], rel=0.03)


def test_intervals_hold_a_truth_that_shares_nothing_with_the_fit():
    found = run("truth")

    assert found["factor"] == pytest.approx(0.0116008, rel=1e-3)
    spread = math.sqrt(0.95 * 0.05 / 300)
    assert np.all(np.abs(found["inside"] - 0.95) < 3 * spread)
