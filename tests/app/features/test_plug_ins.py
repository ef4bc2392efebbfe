"""A feature of a plug-in is installed after ours; a broken one leaves the window as it is."""

import pytest
from PySide6.QtWidgets import QLabel

from kappaskin import _plugins
from kappaskin_app import features
from kappaskin_app.features import PluggedFeature

CODE = """
from PySide6.QtWidgets import QLabel

class Peak:
    name = "peak"

    def install(self, shell):
        self.label = QLabel("none", objectName="peak")
        shell.docks.put_below("peak", "Force", self.label, "Ctrl+Alt+9", "The largest force")
        shell.session.estimated.connect(self.show)

    def show(self, estimate):
        self.label.setText(f"{estimate.contact.force:.3f} N")

class Odd:
    name = "odd"

    def install(self, shell):
        raise RuntimeError("no licence")

class Ended:
    name = "ended"

    def install(self, shell):
        raise SystemExit(1)

class Other:
    name = "other"
"""
POINTS = """[kappaskin.features]
peak = peak_plug:Peak
ended = peak_plug:Ended
odd = peak_plug:Odd
other = peak_plug:Other
"""


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    """The features of a plug-in that is installed for this test."""
    monkeypatch.setattr(_plugins, "_found", {})
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "peak_plug.py").write_text(CODE)
    there = tmp_path / "peak_plug-1.5.dist-info"
    there.mkdir()
    (there / "METADATA").write_text("Metadata-Version: 2.1\nName: peak_plug\nVersion: 1.5\n")
    (there / "entry_points.txt").write_text(POINTS)
    return [made for made in features.all_features() if isinstance(made, PluggedFeature)]


def test_it_is_installed_and_a_broken_one_is_named(
    plugged, qapp, window_class, until, caplog
) -> None:
    assert [feature.name for feature in plugged] == ["peak", "ended", "odd"]
    (left_out,) = [one for one in _plugins.found_plug_ins() if one.trouble]
    assert left_out.name == "other"

    ours = [feature for feature in features.FEATURES if feature.name in ("heatmaps", "log")]
    window = window_class("sim:", None, [*ours, *(lambda one=one: one for one in plugged)])
    window.show()
    (label,) = window.docks["peak"].findChildren(QLabel, "peak")
    until(lambda: label.text().endswith(" N"))
    notified = window.statusBar().currentMessage()
    window.close()
    window.deleteLater()

    assert notified == "Plug-in feature odd left out: RuntimeError: no licence."
    assert "no licence" in caplog.text
    assert "Plug-in feature ended left out: SystemExit: 1." in caplog.text
