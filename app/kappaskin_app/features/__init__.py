"""The features: one folder for each thing a person does.

Each is a class with one method, `install(shell)`, and its parts as attributes. They never import
each other. Removing a line of `FEATURES` leaves an app without that feature. They stand in the
order in which their panels, docks and actions do.
"""

from collections.abc import Callable

from kappaskin_app.features.accuracy import AccuracyFeature
from kappaskin_app.features.calibration import CalibrationFeature
from kappaskin_app.features.compare import CompareFeature
from kappaskin_app.features.connection import ConnectionFeature
from kappaskin_app.features.contact import ContactFeature
from kappaskin_app.features.design import DesignFeature
from kappaskin_app.features.estimator import EstimatorFeature
from kappaskin_app.features.export import ExportFeature
from kappaskin_app.features.guide import GuideFeature
from kappaskin_app.features.health import HealthFeature
from kappaskin_app.features.heatmaps import HeatmapsFeature
from kappaskin_app.features.lessons import LessonsFeature
from kappaskin_app.features.log import LogFeature
from kappaskin_app.features.membrane import MembraneFeature
from kappaskin_app.features.presenter import PresenterFeature
from kappaskin_app.features.publish import PublishFeature
from kappaskin_app.features.recording import RecordingFeature
from kappaskin_app.features.scene import SceneFeature
from kappaskin_app.features.sensor import SensorFeature
from kappaskin_app.features.stability import StabilityFeature
from kappaskin_app.features.traces import TracesFeature
from kappaskin_app.shell.window import Feature

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
    LogFeature,
    CompareFeature,
    DesignFeature,
    TracesFeature,
    GuideFeature,
    PresenterFeature,
    ExportFeature,
)
