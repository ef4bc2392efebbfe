import os
from importlib.metadata import entry_points
from types import SimpleNamespace
from unittest.mock import MagicMock

from kappaskin_peak import PeakFeature

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")  # no screen is needed
from PySide6.QtWidgets import QApplication


def test_the_largest_force_stays():
    application = QApplication.instance() or QApplication([])
    feature, shell = PeakFeature(), MagicMock()

    feature.install(shell)
    for force in (0.2, 0.5, 0.1):
        feature.show(SimpleNamespace(contact=SimpleNamespace(force=force)))

    assert application
    shell.session.estimated.connect.assert_called_once_with(feature.show)
    assert feature.label.text() == "0.500 N"


def test_the_app_finds_it():
    (point,) = entry_points(group="kappaskin.features", name="peak")

    assert point.load() is PeakFeature
