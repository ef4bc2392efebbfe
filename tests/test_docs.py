"""The site: it has every page, its links lead somewhere, and reading it needs no network."""

import importlib.util
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SITE = runpy.run_path(str(ROOT / "packaging" / "docs" / "build.py"), run_name="site_builder")


def test_the_reference_has_what_a_room_has_and_nothing_of_others():
    names = SITE["names_of"]("kappaskin.estimation")

    assert {"LeastSquares", "Fit", "predicted_sd"} <= set(names)
    assert "Refusal" not in names


def test_every_page_of_the_guide_stands_in_the_site(tmp_path):
    SITE["write_pages"](tmp_path / "source")

    index = (tmp_path / "source" / "index.md").read_text("utf-8").splitlines()
    for folder, kind in ("guide", "md"), ("lessons", "md"), ("notebooks", "ipynb"):
        for page in (ROOT / "resources" / "kappaskin_resources" / folder).glob(f"*.{kind}"):
            assert f"{folder}/{page.name}" in index
    assert "reference/estimation.md" in index


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ('<script src="https://cdn.example/x.js"></script>', 1),
        ('<link rel="stylesheet" href="//cdn.example/x.css">', 1),
        ("body { background: url(https://cdn.example/x.png) }", 1),
        ('<a href="https://example.org">a link to follow</a> <img src="x.png">', 0),
    ],
)
def test_what_a_page_would_load_from_a_network_is_found(tmp_path, text, count):
    (tmp_path / "page.html").write_text(text)

    assert len(SITE["loaded_from_network"](tmp_path)) == count


@pytest.mark.full
@pytest.mark.skipif(
    importlib.util.find_spec("myst_nb") is None, reason="start.py docs installs what it needs"
)
def test_the_site_is_built_without_a_warning(capfd):
    assert SITE["main"]() == 0

    assert (SITE["OUT"] / "searchindex.js").exists()
    assert "dist/docs/index.html" in capfd.readouterr().out


def test_a_lesson_has_its_title_and_questions_without_settings_and_answers(tmp_path):
    SITE["write_pages"](tmp_path / "source")

    lesson = (tmp_path / "source" / "lessons" / "01-curvature-gage.md").read_text("utf-8")
    assert lesson.startswith("# What a curvature gage measures\n")
    assert "+++" not in lesson
    assert "**Where is the upper map, for bending along x, darkest?**\n\n- Along the edge" in lesson
    assert "```toml" not in lesson
    assert "right = " not in lesson
