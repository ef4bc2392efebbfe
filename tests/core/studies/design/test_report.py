"""What a study found, as text, CSV, figures and a page."""

import csv
import io
import re
from html.parser import HTMLParser

import pytest

from kappaskin.cli import FAILED
from kappaskin.studies import StudyFolder, table_text
from kappaskin.studies.design.measures import MEASURES
from kappaskin.studies.design.report import mean_text, value_text
from kappaskin.studies.design.results import Mean, stored_results

from .conftest import TEXT

VARIED = """
[[vary]]
"elements.grid" = [[4, 4], [6, 6]]

[[vary]]
"effects.uniform-noise.rms" = [0.1, 0.4]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study of four points, of which two fail, computed by the command and reported on."""
    from kappaskin.cli import main

    place = tmp_path_factory.mktemp("study")
    text = 'title = "Small & simple"\n' + TEXT.replace("[4, 4]", "[5, 5]")
    (place / "small.toml").write_text(text.replace("least = 2", "least = 3") + VARIED)
    code = main(["study", str(place / "small.toml"), "--workers", "1", "--out", str(place / "out")])
    assert code == FAILED
    main(["report", str(place / "out")])
    return place / "out"


class Structure(HTMLParser):
    """What a page is made of."""

    def __init__(self, page):
        super().__init__()
        self.open, self.seen, self.links = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        self.links += [value for name, value in attrs if name in ("src", "href") and value]
        if tag != "meta":
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.links += [value for name, value in attrs if "href" in name and value]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_is_whole_and_needs_no_network(folder):
    page = (folder / "report.html").read_text("utf-8")

    structure = Structure(page)

    assert not structure.open
    assert structure.seen.count("svg") == 1
    assert "<?xml" not in page
    assert structure.seen.count("tr") == 5
    assert all(link.startswith("#") for link in structure.links)
    assert not re.search(r"@import|url\((?!#)", page)


def test_the_page_says_all_that_repeats_it(folder):
    page = (folder / "report.html").read_text("utf-8")

    assert "Small &amp; simple" in page
    assert "&quot;elements.grid&quot; = [[4, 4], [6, 6]]" in page
    assert "kappaskin study small.toml" in page


def test_failures_are_told_with_their_parameters(folder):
    page = (folder / "report.html").read_text("utf-8")

    assert "at elements.grid 4 x 4, effects.uniform-noise.rms 0.1: 3 of 3 blocks failed" in page
    assert "use at most 4 x 4 functions" in page


def test_the_csv_has_all_digits_of_every_point(folder):
    rows = list(csv.DictReader(io.StringIO((folder / "report.csv").read_text("utf-8"))))

    assert [row["elements.grid"] for row in rows] == ["4 x 4", "4 x 4", "6 x 6", "6 x 6"]
    low, high = (float(row["rms mean [mm]"]) for row in rows[2:])
    assert 1.5 < high / low < 4
    assert [row["blocks failed"] for row in rows] == ["3", "3", "0", "0"]


def test_blocks_that_failed_have_no_frames(folder):
    page = (folder / "report.html").read_text("utf-8")

    assert page.count("<td>0</td></tr>") == 2
    assert page.count("<td>20</td></tr>") == 2


def test_figures_stand_beside_the_page(folder):
    svg = (folder / "rms.svg").read_text("utf-8")

    assert "RMS error of the shape [mm]" in svg
    assert "6 x 6" in svg


def test_what_is_not_computed_yet_is_said_to_be_missing(study_of, tmp_path):
    study = study_of(VARIED)

    told = table_text(study, stored_results(study, StudyFolder.opened(tmp_path, study)))

    assert told.count("0 of 2 blocks are computed by this version") == 4
    assert "6 x 6  0.1         -       0" in told


def test_no_folder_of_a_study_is_refused(run, tmp_path):
    code, _, told = run("report", tmp_path)

    assert code == 2
    assert "expected a folder made by kappaskin study" in told


def test_workers_and_a_scheduler_are_one_or_the_other(run):
    code, _, told = run("study", "placement", "--workers", 2, "--scheduler", "tcp://x:1")

    assert code == 2
    assert "expected --workers or --scheduler" in told


@pytest.mark.parametrize(
    ("mean", "half", "told"),
    [
        (12.3456e-3, 0.123e-3, "12.35 ± 0.12"),
        (1.0e-3, 2.0e-3, "1.0 ± 2.0"),
        (123.456e-3, 34.5e-3, "123 ± 34"),
        (1e-3, 1e-16, "1.000 exact"),
        (1e-3, float("nan"), "1 ± ?"),
        (0.0, 0.0, "0.000 exact"),
    ],
)
def test_a_mean_has_the_digits_that_are_known(mean, half, told):
    assert mean_text(Mean(mean, half, 1.0, 10), MEASURES["rms"]) == told


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ([6, 8], "6 x 8"),
        (0.1 + 0.2, "0.3"),
        ("D", "D"),
        (True, "true"),
        ([1] * 40, "40 values"),
        (["slope@0", "slope@90"], "slope@0, slope@90"),
        (
            {"height": {"noise": 5e-6}, "slope": {"noise": 5e-4}},
            "height noise 5e-06, slope noise 0.0005",
        ),
    ],
)
def test_values_are_told_briefly(value, told):
    assert value_text(value) == told


def test_a_notebook_shows_the_results_as_the_report_does(folder):
    results = StudyFolder(folder)
    shown, study = results._repr_html_(), results.study()

    assert shown.count("<tr>") == 1 + study.count
    assert MEASURES[study.measures[0]].title in shown
    assert "data:image/png" in shown
