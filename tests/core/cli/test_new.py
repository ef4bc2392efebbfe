"""New plug-ins: written, installed without a network, tested, and found."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from kappaskin.cli import REFUSED, main

KINDS = {
    "sensor": "",
    "effect": "from kappaskin.scenes.effects import EFFECTS as found",
    "estimator": "from kappaskin.estimation import METHODS as found",
    "feature": "from kappaskin_app.features import all_features; "
    "found = [feature.name for feature in all_features()]",
}


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def python(*words: str) -> str:
    both = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    done = subprocess.run([sys.executable, *words], text=True, check=False, timeout=300, **both)
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_new_one_is_installed_passes_its_test_and_is_found(here, monkeypatch, kind) -> None:
    if kind == "feature":
        pytest.importorskip("PySide6")
    monkeypatch.setenv("PYTHONPATH", str(here / "there"), prepend=os.pathsep)
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    alone = ("--no-index", "--no-deps", "--no-build-isolation", "-q", "--target", "there")

    assert main(["new", kind, "my-own"]) == 0
    python("-m", "pip", "install", *alone, "./kappaskin-my-own")

    assert " passed" in python("-m", "pytest", "-q", "-W", "error", "kappaskin-my-own")
    if kind == "sensor":
        record = ("-m", "kappaskin", "record", "my-own:desk", "out.mcap", "--seconds", "1")
        python(*record, "--sensor", "kappaskin-my-own/my-own.toml")
        assert "kappaskin_my_own.py" in python("-m", "kappaskin", "doctor")
    else:
        python("-c", f"{KINDS[kind]}; assert 'my-own' in found, found")


@pytest.mark.parametrize("name", ["", "Lag", "my_lag", "1st", "a--b", "lag-", "läg", "a" * 41])
def test_a_bad_name_is_refused(here, capsys, name) -> None:
    assert main(["new", "effect", name]) == REFUSED
    assert "expected a name of a letter, then letters, digits" in capsys.readouterr().err
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "name", "why"),
    [
        ("sensor", "sim", "sim is a scheme of a source of Kappaskin already"),
        ("effect", "hysteresis", "hysteresis is an effect of Kappaskin already"),
        ("estimator", "bayes", "bayes is an estimator of Kappaskin already"),
        ("feature", "heatmaps", "heatmaps is a feature of the app of Kappaskin already"),
        ("effect", "app", "the module kappaskin_app is installed already"),
    ],
)
def test_a_name_that_is_taken_is_refused(here, capsys, kind, name, why) -> None:
    assert main(["new", kind, name]) == REFUSED
    assert f"{why}; choose another name" in capsys.readouterr().err
    assert list(here.iterdir()) == []


def test_a_folder_that_is_there_stays(here, capsys) -> None:
    (here / "kappaskin-lag").mkdir()
    assert main(["new", "effect", "lag"]) == REFUSED
    assert "kappaskin-lag is here already; choose another name" in capsys.readouterr().err
    assert list((here / "kappaskin-lag").iterdir()) == []


def test_a_folder_that_cannot_be_written_is_refused(here, capsys, monkeypatch) -> None:
    def refuse(_: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refuse)
    assert main(["new", "effect", "lag"]) == REFUSED
    assert "kappaskin-lag cannot be written (Permission denied)" in capsys.readouterr().err
