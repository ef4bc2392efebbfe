"""The features: one folder for each thing a person does.

Each is a class with one method, `install(shell)`, and its parts as attributes. They never import
each other. Removing a line of `FEATURES` leaves an app without that feature. They stand in the
order in which their panels, docks and actions do.
"""

import logging
from collections.abc import Callable

from kappaskin._plugins import FEATURES as GROUP
from kappaskin._plugins import check_feature, error_text, plug_ins
from kappaskin_app.features.accuracy import AccuracyFeature
from kappaskin_app.features.calibration import CalibrationFeature
from kappaskin_app.features.compare import CompareFeature
from kappaskin_app.features.connection import ConnectionFeature
from kappaskin_app.features.contact import ContactFeature
from kappaskin_app.features.design import DesignFeature
from kappaskin_app.features.estimator import EstimatorFeature
from kappaskin_app.features.export import ExportFeature
from kappaskin_app.features.guide import GuideFeature
from kappaskin_app.features.hand import HandFeature
from kappaskin_app.features.health import HealthFeature
from kappaskin_app.features.heatmaps import HeatmapsFeature
from kappaskin_app.features.lessons import LessonsFeature
from kappaskin_app.features.log import LogFeature
from kappaskin_app.features.membrane import MembraneFeature
from kappaskin_app.features.operator import OperatorFeature
from kappaskin_app.features.presenter import PresenterFeature
from kappaskin_app.features.publish import PublishFeature
from kappaskin_app.features.recording import RecordingFeature
from kappaskin_app.features.scene import SceneFeature
from kappaskin_app.features.sensor import SensorFeature
from kappaskin_app.features.stability import StabilityFeature
from kappaskin_app.features.strip_chart import StripChartFeature
from kappaskin_app.features.traces import TracesFeature
from kappaskin_app.shell.window import Feature, MainWindow

log = logging.getLogger("kappaskin")

FEATURES: tuple[Callable[[], Feature], ...] = (
    ConnectionFeature,
    RecordingFeature,
    CalibrationFeature,
    SceneFeature,
    EstimatorFeature,
    MembraneFeature,
    PublishFeature,
    SensorFeature,
    LessonsFeature,
    HeatmapsFeature,
    AccuracyFeature,
    StabilityFeature,
    HealthFeature,
    ContactFeature,
    HandFeature,
    OperatorFeature,
    LogFeature,
    CompareFeature,
    DesignFeature,
    StripChartFeature,
    TracesFeature,
    GuideFeature,
    PresenterFeature,
    ExportFeature,
)


class PluggedFeature:
    """A feature of a plug-in; where it cannot be installed the window goes on without it."""

    def __init__(self, name: str, made: Callable[[], Feature]) -> None:
        self.name, self._made = name, made

    def install(self, shell: MainWindow) -> None:
        try:
            self.feature = self._made()  # kept: Qt holds none of the slots of a Python object
            self.feature.install(shell)
        except BaseException as error:  # a plug-in may raise anything
            text = f"Plug-in feature {self.name} left out: {error_text(error)}."
            log.warning(text, exc_info=error)
            shell.notify(text)


def all_features() -> list[Feature]:
    """Every feature, those of plug-ins last."""
    ours = [made() for made in FEATURES]
    plugged = plug_ins(GROUP, check_feature, {feature.name for feature in ours})
    return [*ours, *(PluggedFeature(name, made) for name, made in plugged.items())]
