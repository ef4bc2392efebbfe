"""What tests of studies share: a small one, to which more is added."""

from collections.abc import Callable
from pathlib import Path

import pytest

from kappaskin.studies.design.study import Study, read_study

TEXT = """
format = 1
rate = 10.0

[skin]
size = [0.1, 0.1]

[elements]
grid = [6, 6]

[effects]
choose = "linear"

[effects.uniform-noise]
rms = 0.2

[[touch]]
what = "point"
x = 0.05
y = 0.03
force = 0.1

[fit]
functions = [4, 4]

[measure]
what = ["rms"]
frames = 5

[stop]
least = 2
most = 4
"""


@pytest.fixture
def study_of() -> Callable[..., Study]:
    """Makes the small study with `more` at its end and each (old, new) of its text replaced."""

    def made(more: str = "", *changes: tuple[str, str]) -> Study:
        text = TEXT
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        return read_study(text + more, Path("small.toml"))

    return made
