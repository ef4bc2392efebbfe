"""Each feature can be taken out: the rest starts, draws, changes a setting and closes."""

import ast
import math
from pathlib import Path

import pytest

import kappaskin_app
from kappaskin import Engine
from kappaskin_app.features import FEATURES
from kappaskin_app.features.membrane import MembraneFeature

APP = Path(kappaskin_app.__file__).parent


@pytest.fixture(scope="module")
def engine():
    """One engine for all windows, idle until a test connects a source."""
    made = Engine()
    yield made
    made.close()


@pytest.fixture
def without(left_out, engine, qapp, window_class, monkeypatch):
    """A window without a feature."""
    monkeypatch.setattr(engine, "close", lambda: None)
    rest = [made for made in FEATURES if made is not left_out]
    window = window_class("sim:", engine, rest)
    yield window
    window.close()
    window.deleteLater()
    qapp.processEvents()


def _imports(folder: Path) -> set[str]:
    """What the modules in a folder import of the app."""
    return {
        node.module
        for file in folder.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module
    }


@pytest.mark.parametrize("left_out", FEATURES, ids=lambda feature: feature.name)
def test_the_app_starts_and_changes_a_setting_without(left_out, without, qapp) -> None:
    without.requests.set("functions_x", 5)
    without.session.tick()
    qapp.processEvents()
    assert without.display.settings.functions_x == 5
    assert set(without.features) == {made.name for made in FEATURES if made is not left_out}


@pytest.mark.cases("heatmaps", "membrane")
@pytest.mark.parametrize("left_out", FEATURES, ids=lambda feature: feature.name)
def test_the_app_draws_without(left_out, without, until) -> None:
    without.session.connect_to("sim:")
    without.show()
    if left_out is MembraneFeature:
        until(lambda: without.session.estimate is not None)
    else:
        until(lambda: any(math.isfinite(age) for age in without.display.ages()))
    before = without.session.estimate.generation
    without.requests.set("functions_x", 5)
    without.requests.set("theme", "light")
    until(lambda: without.session.estimate.generation > before)
    assert without.session.estimate.coefficients.shape[-2:] == (5, 8)


@pytest.mark.parametrize("feature", FEATURES, ids=lambda feature: feature.name)
def test_a_feature_imports_no_other(feature) -> None:
    own = f"kappaskin_app.features.{feature.name}"
    others = {name for name in _imports(APP / "features" / feature.name) if ".features" in name}
    assert {name for name in others if name != own and not name.startswith(f"{own}.")} == set()


def test_every_folder_is_a_feature_and_the_shell_knows_none(pytestconfig) -> None:
    folders = {file.parent.name for file in (APP / "features").glob("*/__init__.py")}
    assert folders - {pytestconfig.getoption("--without")} == {made.name for made in FEATURES}
    for part in ("shell", "widgets"):
        assert not {name for name in _imports(APP / part) if ".features" in name}
    assert not {name for name in _imports(APP / "widgets") if ".shell" in name}
