"""The explanations of mutations can be read, and are of files that there are."""

import tomllib
from pathlib import Path

EXPLAINED = Path(__file__).with_name("explained.toml")
CORE = Path(__file__).parents[2] / "core" / "kappaskin"


def test_every_explanation_is_of_a_file_of_the_core():
    explained = tomllib.loads(EXPLAINED.read_text("utf-8"))
    assert explained
    assert [file for file in explained if not (CORE / file).is_file()] == []
