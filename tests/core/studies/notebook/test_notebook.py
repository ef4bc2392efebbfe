"""Values in a notebook: their tables say what the values are, their pictures need Matplotlib."""

import re
import sys
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, Recording, Refusal, SensorLayout, SineBasis, stream
from kappaskin.recording import contacts_in
from kappaskin.studies import load_study

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def no_windows(monkeypatch):
    """Pyplot draws in memory, and closes what a test opened."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def fit():
    """Readings of 0.01 and -0.01 1/m in turn on a plate whose functions are 1 x 1."""
    patch = Patch(0.1, 0.1)
    layout = SensorLayout.regular(patch, 10, 10)
    basis = SineBasis(patch, 1, 1)
    exact = layout.operator(basis) @ [2e-3]
    noise = 0.01 * (-1.0) ** np.arange(300)
    return LeastSquares(basis, layout)((exact + noise).reshape(3, -1))


@pytest.fixture(scope="module")
def estimate():
    with stream("sim:off-centre") as estimates:
        return next(iter(estimates))


def cells(value) -> dict[str, str]:
    """The cells of the value's table by the first in their row; its HTML is well formed."""
    page = ElementTree.fromstring(value._repr_html_())
    rows = [["".join(cell.itertext()) for cell in row] for row in page.iter("tr")]
    return {row[0]: row[1] for row in rows}


def test_a_fit_shows_its_largest_displacement_with_its_error_bar(fit):
    found = cells(fit)

    value, half = re.match(
        r"([\d.]+) ± ([\d.]+) mm \(95 %\), at 50.0 50.0 mm", found["largest displacement"]
    ).groups()
    assert float(value) == pytest.approx(2.0, abs=0.002)
    assert float(half) == pytest.approx(
        1.96e3 * fit.surface_sd(np.array([[0.05, 0.05]]))[0], rel=0.05
    )
    assert found["functions"] == "1 × 1"
    assert found["noise of a reading"] == "0.010 1/m"


def test_of_several_frames_a_fit_shows_how_many(fit):
    frames = fit.estimator(np.stack([fit.readings] * 3))

    assert cells(frames)["frames"] == "3; the first is drawn"


def test_an_estimate_shows_the_numbers_of_the_window(estimate):
    found = cells(estimate)

    value, half = re.fullmatch(r"(\S+) ± (\S+) N \(95 %\)", found["Force"]).groups()
    contact = estimate.contact
    assert float(value) == pytest.approx(contact.force, abs=0.06 * float(half))
    assert float(half) == pytest.approx(1.96 * contact.force_sd, rel=0.06)


def test_an_estimate_without_a_surface_has_a_table_and_nothing_to_draw(estimate):
    bare = replace(estimate, surface=np.full((3, 3), np.nan))

    assert "<img" not in bare._repr_html_()
    with pytest.raises(Refusal, match="something to draw"):
        bare.plot()


def test_a_recording_draws_the_force_of_every_contact(recording):
    with Recording(str(recording)) as opened:
        axes, found = opened.plot(), cells(opened)
        (_, _, of) = next(iter(contacts_in(recording)))

    drawn, (bars,) = axes.get_lines()[0].get_xydata(), axes.collections
    assert len(drawn) == opened.counts["/kappaskin/contact"]
    low, high = bars.get_segments()[0][:, 1]
    assert (high - low) / 2 == pytest.approx(1.96 * of["force_sd"][0], rel=1e-6)
    assert (high + low) / 2 == pytest.approx(of["force"][0])
    assert found["length"] == f"{opened.seconds(opened.last):.1f} s"


def test_a_study_shows_what_is_varied_and_where_its_elements_are():
    study = load_study("paper-elements")

    assert cells(study)["points"] == "28"
    assert cells(study)["varied: elements.grid"].startswith("9 x 9, 10 x 10")
    assert len(study.plot().get_lines()[0].get_xdata()) == 100


def test_what_comes_from_outside_is_escaped():
    hostile = replace(load_study("paper-elements"), title="<script>alert(1)</script>\x1b")

    assert "<script" not in hostile._repr_html_()
    assert r"&lt;script&gt;alert(1)&lt;/script&gt;\x1b" in hostile._repr_html_()


def test_without_matplotlib_there_is_the_table_alone(fit, monkeypatch):
    assert 'src="data:image/png;base64,' in fit._repr_html_()
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)

    assert "<img" not in fit._repr_html_()
    assert "<table>" in fit._repr_html_()
    with pytest.raises(Refusal, match="kappaskin\\[plots\\]"):
        fit.plot()
