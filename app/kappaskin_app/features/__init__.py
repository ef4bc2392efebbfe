"""The features: one folder for each thing a person does.

Each is a class with one method, `install(shell)`, and its parts as attributes. They never import
each other. Taking a line out of `FEATURES` leaves an app without that feature. They stand in the
order in which their panels, docks and actions do.
"""

from collections.abc import Callable

from kappaskin_app.features.accuracy import Accuracy
from kappaskin_app.features.calibration import Calibration
from kappaskin_app.features.compare import Compare
from kappaskin_app.features.connection import Connection
from kappaskin_app.features.contact import Contact
from kappaskin_app.features.design import Design
from kappaskin_app.features.estimator import Estimator
from kappaskin_app.features.export import Export
from kappaskin_app.features.guide import Guide
from kappaskin_app.features.health import Health
from kappaskin_app.features.heatmaps import Heatmaps
from kappaskin_app.features.lessons import Lessons
from kappaskin_app.features.log import Log
from kappaskin_app.features.membrane import Membrane
from kappaskin_app.features.presenter import Presenter
from kappaskin_app.features.publish import Publish
from kappaskin_app.features.recording import Recording
from kappaskin_app.features.scene import Scene
from kappaskin_app.features.sensor import Sensor
from kappaskin_app.features.stability import Stability
from kappaskin_app.features.traces import Traces
from kappaskin_app.shell.window import Feature

FEATURES: tuple[Callable[[], Feature], ...] = (
    Connection,
    Recording,
    Calibration,
    Scene,
    Estimator,
    Membrane,
    Publish,
    Sensor,
    Lessons,
    Heatmaps,
    Accuracy,
    Stability,
    Health,
    Contact,
    Log,
    Compare,
    Design,
    Traces,
    Guide,
    Presenter,
    Export,
)
