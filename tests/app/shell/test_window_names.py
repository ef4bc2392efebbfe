"""Names in the window's file stay: changed shortcuts, layouts and settings are found by them.

Add to `tests/app/window_names.json` what is new; a name that goes is lost to who has saved it.
"""

import json
from dataclasses import fields
from pathlib import Path

import pytest

from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import MainWindow

STORED = json.loads(Path(__file__).parents[1].joinpath("window_names.json").read_text("utf-8"))


@pytest.mark.full
def test_names_in_the_windows_file_are_those_that_were_promised(
    window: MainWindow, pytestconfig
) -> None:
    if pytestconfig.getoption("--without"):
        pytest.skip("the names of one feature are left out")
    assert set(STORED["actions"]) <= set(window.actions_by_name.entries)
    assert set(STORED["docks"]) <= set(window.docks.by_name())


def test_names_of_settings_are_those_that_were_promised() -> None:
    assert set(STORED["settings"]) <= {field.name for field in fields(Settings)}
