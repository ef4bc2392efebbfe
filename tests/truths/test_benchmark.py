"""The benchmark: its data are the truths', its scorer needs NumPy alone and scores what is told."""

import runpy
import subprocess
import sys

import numpy as np
import pytest

import benchmark

SCORE = runpy.run_path(str(benchmark.FOLDER / "score.py"))
OPEN, HELD_OUT = (SCORE["load"](benchmark.FOLDER / f"{name}.npz") for name in ("open", "held-out"))


def results(**changes):
    answers = {name: OPEN[name] for name in ("count", "place", "force", "depth")}
    sds = {f"{name}_sd": 0.01 * np.abs(answers[name]) for name in ("place", "force", "depth")}
    return answers | sds | changes


def scores(**changes):
    """The words of the last line: presses, count, found, place, 90 %, force, depth, covered."""
    return SCORE["table"](results(**changes), OPEN).splitlines()[-1].split()[1:]


@pytest.mark.truth
def test_the_open_half_is_what_the_truths_make():
    listed = list(benchmark.presses())
    np.random.default_rng(benchmark.OPEN_SEED).shuffle(listed)
    first = {each[1:]: (i, each) for i, each in reversed(list(enumerate(listed)))}
    assert len(first) == len(benchmark.GROUPS)
    for i, each in first.values():
        curvature, noise, contacts = benchmark.press(benchmark.OPEN_SEED, *each)
        contacts = contacts[np.argsort(-contacts[:, 2])]
        count = OPEN["count"][i]
        assert (OPEN["skin"][i], OPEN["kind"][i]) == (each[1].name, each[2])
        assert (OPEN["noise"][i], count) == (noise, len(contacts))
        np.testing.assert_allclose(OPEN["curvature"][i], curvature, rtol=1e-5, atol=1e-5)
        told = np.column_stack([OPEN["place"][i], OPEN["force"][i], OPEN["depth"][i]])[:count]
        np.testing.assert_allclose(told, contacts, rtol=1e-6)


def test_both_halves_are_small_and_alike_but_for_the_answers():
    assert set(OPEN) - set(HELD_OUT) == set(benchmark.ANSWERS)
    assert sum(file.stat().st_size for file in benchmark.FOLDER.iterdir()) < 1.5e6
    for name in ("skin", "noise"):
        assert sorted(OPEN[name]) == sorted(HELD_OUT[name])
    assert (OPEN["skin"] != HELD_OUT["skin"]).any()
    assert not np.isclose(OPEN["curvature"][0], HELD_OUT["curvature"][:]).all((1, 2)).any()


def scored(file, code=""):
    """What the script prints, run without the project's modules, and its exit code."""
    ran = "import runpy, sys; sys.argv = sys.argv[1:]; "
    ran += f"runpy.run_path(sys.argv[0], run_name='__main__'); {code}"
    words = ["-I", "-c", ran, str(benchmark.FOLDER / "score.py"), str(file)]
    done = subprocess.run([sys.executable, *words], text=True, capture_output=True, check=False)
    return done.stdout + done.stderr, done.returncode


def test_the_scorer_needs_numpy_alone(tmp_path):
    np.savez(tmp_path / "results.npz", count=OPEN["count"], place=OPEN["place"])
    code = "assert not {'scipy', 'kappaskin'} & set(sys.modules)"
    printed, failed = scored(tmp_path / "results.npz", code)
    assert not failed, printed
    last = printed.splitlines()[-1].split()
    assert last == ["all", "100", "100", "100", "0.00", "0.00", "-", "-", "-", "-", "-"]


def test_results_of_other_shapes_are_refused(tmp_path):
    np.savez(tmp_path / "results.npz", count=OPEN["count"][:7], place=OPEN["place"][:7])
    printed, failed = scored(tmp_path / "results.npz")
    assert failed
    assert "expected count (100,) and place (100, 2, 2), one row for each press" in printed


def test_the_truth_has_full_marks():
    assert scores() == ["100", "100", "100", "0.00", "0.00", "0.0", "0.0", "100", "100", "100"]


def test_the_order_of_two_contacts_does_not_matter():
    turned, two = results(), OPEN["count"] == 2
    for name in set(turned) - {"count"}:
        turned[name] = turned[name].copy()
        turned[name][two] = turned[name][two][:, ::-1]
    assert scores(**turned) == scores()


def test_what_is_wrong_is_told():
    off = scores(place=OPEN["place"] + (3e-3, 4e-3 - 1e-9), force=1.1 * OPEN["force"])
    assert off[2:5] == ["100", "5.00", "5.00"]
    assert off[5:] == ["10.0", "0.0", "0", "0", "100"]
    assert scores(place=OPEN["place"] + 4e-3)[2] == "0"
    one = scores(count=np.ones(100, int))
    two = np.mean(OPEN["count"] == 2)
    assert one[1:3] == [f"{100 * (1 - two):.0f}", f"{100 / (1 + two):.0f}"]
