"""Kappaskin: shape and contact from curvature-sensing tactile skins, live and with error bars.

A room is imported when one of its names is first used. Type checkers see the first list, what
runs uses the second: a `__getattr__` visible to both would hide every misspelt name.
"""

from typing import TYPE_CHECKING

from kappaskin._lazy import lazy_names

if TYPE_CHECKING:
    from kappaskin.bases import SineBasis as SineBasis
    from kappaskin.bases import basis_for as basis_for
    from kappaskin.calibration import Calibration as Calibration
    from kappaskin.calibration import Tare as Tare
    from kappaskin.calibration import load_calibration as load_calibration
    from kappaskin.contact import IntrinsicContact as IntrinsicContact
    from kappaskin.contact import ObjectFinder as ObjectFinder
    from kappaskin.contact import PointContact as PointContact
    from kappaskin.contact import local_geometry as local_geometry
    from kappaskin.errors import RankDeficient as RankDeficient
    from kappaskin.errors import Refusal as Refusal
    from kappaskin.errors import SourceError as SourceError
    from kappaskin.estimation import Bayes as Bayes
    from kappaskin.estimation import Fast as Fast
    from kappaskin.estimation import FiniteSlopeLeastSquares as FiniteSlopeLeastSquares
    from kappaskin.estimation import LeastSquares as LeastSquares
    from kappaskin.estimation import Region as Region
    from kappaskin.estimation import Robust as Robust
    from kappaskin.estimation import Tracking as Tracking
    from kappaskin.estimation import estimator_for as estimator_for
    from kappaskin.estimation import place_elements as place_elements
    from kappaskin.estimation import predicted_sd as predicted_sd
    from kappaskin.frames import Contact as Contact
    from kappaskin.frames import Estimate as Estimate
    from kappaskin.frames import Event as Event
    from kappaskin.frames import Frame as Frame
    from kappaskin.live import Engine as Engine
    from kappaskin.live import Status as Status
    from kappaskin.live import stream as stream
    from kappaskin.mechanics import DiscLoad as DiscLoad
    from kappaskin.mechanics import GaussianLoad as GaussianLoad
    from kappaskin.mechanics import LineLoad as LineLoad
    from kappaskin.mechanics import Plate as Plate
    from kappaskin.mechanics import PointLoad as PointLoad
    from kappaskin.mechanics import RectangleLoad as RectangleLoad
    from kappaskin.pipeline import Pipeline as Pipeline
    from kappaskin.pipeline import Setup as Setup
    from kappaskin.pipeline import setup_from_text as setup_from_text
    from kappaskin.recording import Recording as Recording
    from kappaskin.scenes import Scene as Scene
    from kappaskin.scenes import Simulator as Simulator
    from kappaskin.scenes import Stimulus as Stimulus
    from kappaskin.scenes import load_scene as load_scene
    from kappaskin.scenes import planned as planned
    from kappaskin.scenes import read_scene as read_scene
    from kappaskin.scenes import write_scene as write_scene
    from kappaskin.sensing import Sensor as Sensor
    from kappaskin.sensing import SensorLayout as SensorLayout
    from kappaskin.sensing import Transduction as Transduction
    from kappaskin.skin import Cap as Cap
    from kappaskin.skin import Disk as Disk
    from kappaskin.skin import Patch as Patch
    from kappaskin.skin import Polygon as Polygon
    from kappaskin.sources import feed as feed

    __version__: str
else:
    _room_name, __dir__, __all__ = lazy_names(
        __name__,
        ("bases", "SineBasis basis_for"),
        ("calibration", "Calibration Tare load_calibration"),
        ("contact", "IntrinsicContact ObjectFinder PointContact local_geometry"),
        ("errors", "RankDeficient Refusal SourceError"),
        (
            "estimation",
            "Bayes Fast FiniteSlopeLeastSquares LeastSquares Region Robust Tracking "
            "estimator_for place_elements predicted_sd",
        ),
        ("frames", "Contact Estimate Event Frame"),
        ("live", "Engine Status stream"),
        ("mechanics", "DiscLoad GaussianLoad LineLoad Plate PointLoad RectangleLoad"),
        ("pipeline", "Pipeline Setup setup_from_text"),
        ("recording", "Recording"),
        ("scenes", "Scene Simulator Stimulus load_scene planned read_scene write_scene"),
        ("sensing", "Sensor SensorLayout Transduction"),
        ("skin", "Cap Disk Patch Polygon"),
        ("sources", "feed"),
    )

    def __getattr__(name):
        if name != "__version__":
            return _room_name(name)
        from importlib import metadata  # 40 ms that few need

        return metadata.version(__name__)
