"""The revision of the estimates: raised whenever the same readings give others."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

import estimates

from kappaskin.pipeline import REVISION


@pytest.mark.slow
def test_the_revision_is_raised_where_an_estimate_of_the_same_readings_changed() -> None:
    revision, kept = estimates.kept()
    found = revision, estimates.changed(estimates.computed(), kept)
    assert found == (REVISION, []), (
        "the same readings give other estimates; if that is meant, run `python tests/estimates.py` "
        "and go on as under *Change an estimator* in CONTRIBUTING.md"
    )


def test_the_guide_has_the_scores_of_the_estimates_kept() -> None:
    page = estimates.PAGE.read_text("utf-8")
    assert page == estimates.scored(page, estimates.kept()[1]), "run `python tests/estimates.py`"


@pytest.mark.parametrize(("factor", "notices"), [(1 + 1e-9, False), (1 + 1e-4, True)])
def test_a_change_is_told_from_rounding(factor: float, notices: bool) -> None:
    _, kept = estimates.kept()
    method = next(iter(kept))
    rows = [[factor * number for number in row] for row in kept[method]["force"]]
    now = kept | {method: kept[method] | {"force": rows}}
    assert estimates.changed(now, kept) == [f"{method}: force"] * notices


def test_the_command_raises_the_revision_and_keeps_the_new_estimates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, now = tmp_path / "pipeline.py", {"method": {"force": [[1.0]]}}
    source.write_text(f"a = 1\nREVISION = {REVISION}\n")
    monkeypatch.setattr(estimates, "_SOURCE", source)
    monkeypatch.setattr(estimates, "ESTIMATES", tmp_path / "estimates.json")
    monkeypatch.setattr(estimates, "PAGE", tmp_path / "benchmark.md")
    monkeypatch.setattr(estimates, "scored", lambda page, now: f"scores of {now}")
    (tmp_path / "benchmark.md").write_text("scores")
    monkeypatch.setattr(estimates, "computed", lambda: now)
    estimates.renew()
    assert estimates.kept() == (REVISION, now)
    assert estimates.renew() == f"revision {REVISION}: the estimates are the same"
    now["method"]["force"] = [[1.1]]
    assert estimates.renew() == f"revision {REVISION + 1}: 1 rows changed: method: force"
    assert estimates.kept() == (REVISION + 1, now)
    assert estimates.PAGE.read_text() == f"scores of {now}"
    assert source.read_text() == f"a = 1\nREVISION = {REVISION + 1}\n"
