"""Kappaskin: shape and contact from curvature-sensing tactile skins, live and with error bars.

A room is imported when a name of it is first asked for. What checks types sees the first list, what
runs the second: a `__getattr__` seen by both would let every misspelt name pass.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kappaskin.adoption import Left as Left
    from kappaskin.adoption import orphans_folder as orphans_folder
    from kappaskin.apart import Distances as Distances
    from kappaskin.apart import between as between
    from kappaskin.apart import distances as distances
    from kappaskin.bases import EDGES as EDGES
    from kappaskin.bases import Basis as Basis
    from kappaskin.bases import CurvatureMap as CurvatureMap
    from kappaskin.bases import SineBasis as SineBasis
    from kappaskin.bases import ValueMap as ValueMap
    from kappaskin.bases import basis_for as basis_for
    from kappaskin.bases import edges_of as edges_of
    from kappaskin.calibration import ADVICE as ADVICE
    from kappaskin.calibration import RADII as RADII
    from kappaskin.calibration import Calibration as Calibration
    from kappaskin.calibration import CalibrationReport as CalibrationReport
    from kappaskin.calibration import Limits as Limits
    from kappaskin.calibration import Presentation as Presentation
    from kappaskin.calibration import Procedure as Procedure
    from kappaskin.calibration import Step as Step
    from kappaskin.calibration import Sweep as Sweep
    from kappaskin.calibration import Tare as Tare
    from kappaskin.calibration import Tares as Tares
    from kappaskin.calibration import calibrate as calibrate
    from kappaskin.calibration import data_folder as data_folder
    from kappaskin.calibration import load_calibration as load_calibration
    from kappaskin.calibration import radii_for as radii_for
    from kappaskin.calibration import save_calibration as save_calibration
    from kappaskin.calibration import schedule as schedule
    from kappaskin.doctor import examine as examine
    from kappaskin.effects import EFFECTS as EFFECTS
    from kappaskin.effects import FIRST_GENERATION_LOOPS as FIRST_GENERATION_LOOPS
    from kappaskin.effects import SECOND_GENERATION_LOOPS as SECOND_GENERATION_LOOPS
    from kappaskin.effects import Creep as Creep
    from kappaskin.effects import GaussianNoise as GaussianNoise
    from kappaskin.effects import Hysteresis as Hysteresis
    from kappaskin.effects import Tolerance as Tolerance
    from kappaskin.effects import UniformNoise as UniformNoise
    from kappaskin.effects import parameters as parameters
    from kappaskin.engine import LONGEST_NOTE as LONGEST_NOTE
    from kappaskin.engine import Engine as Engine
    from kappaskin.errors import Damaged as Damaged
    from kappaskin.errors import RankDeficient as RankDeficient
    from kappaskin.errors import Refusal as Refusal
    from kappaskin.errors import SourceError as SourceError
    from kappaskin.errors import lacking as lacking
    from kappaskin.export import Exported as Exported
    from kappaskin.export import Exporting as Exporting
    from kappaskin.export import Repairing as Repairing
    from kappaskin.export import Wanted as Wanted
    from kappaskin.figures import FIGURES as FIGURES
    from kappaskin.figures import write_figures as write_figures
    from kappaskin.fit import METHODS as METHODS
    from kappaskin.fit import WHY as WHY
    from kappaskin.fit import AsPrinted as AsPrinted
    from kappaskin.fit import Bayes as Bayes
    from kappaskin.fit import Direct as Direct
    from kappaskin.fit import Estimator as Estimator
    from kappaskin.fit import Fast as Fast
    from kappaskin.fit import FiniteSlope as FiniteSlope
    from kappaskin.fit import Fit as Fit
    from kappaskin.fit import LeastSquares as LeastSquares
    from kappaskin.fit import Robust as Robust
    from kappaskin.fit import Tracking as Tracking
    from kappaskin.fit import estimator_for as estimator_for
    from kappaskin.fit import singular_values as singular_values
    from kappaskin.frames import COMPONENTS as COMPONENTS
    from kappaskin.frames import OVERTAKEN as OVERTAKEN
    from kappaskin.frames import Estimate as Estimate
    from kappaskin.frames import Event as Event
    from kappaskin.frames import Frame as Frame
    from kappaskin.frames import LocalGeometry as LocalGeometry
    from kappaskin.frames import Touch as Touch
    from kappaskin.frames import Truth as Truth
    from kappaskin.geometry import local_geometry as local_geometry
    from kappaskin.health import Finding as Finding
    from kappaskin.health import Health as Health
    from kappaskin.health import Monitor as Monitor
    from kappaskin.intrinsic import ForceTorqueSensor as ForceTorqueSensor
    from kappaskin.intrinsic import IntrinsicContact as IntrinsicContact
    from kappaskin.intrinsic import IntrinsicTouch as IntrinsicTouch
    from kappaskin.intrinsic import Wrench as Wrench
    from kappaskin.layout import SensorLayout as SensorLayout
    from kappaskin.mechanics import Compliance as Compliance
    from kappaskin.mechanics import DiscLoad as DiscLoad
    from kappaskin.mechanics import GaussianLoad as GaussianLoad
    from kappaskin.mechanics import LineLoad as LineLoad
    from kappaskin.mechanics import Load as Load
    from kappaskin.mechanics import Placed as Placed
    from kappaskin.mechanics import Plate as Plate
    from kappaskin.mechanics import PointLoad as PointLoad
    from kappaskin.mechanics import RectangleLoad as RectangleLoad
    from kappaskin.patch import Disk as Disk
    from kappaskin.patch import Patch as Patch
    from kappaskin.patch import Polygon as Polygon
    from kappaskin.pipeline import Pipeline as Pipeline
    from kappaskin.pipeline import Setup as Setup
    from kappaskin.placement import PLACEMENTS as PLACEMENTS
    from kappaskin.placement import elements_placed as elements_placed
    from kappaskin.placement import predicted_sd as predicted_sd
    from kappaskin.press import Phase as Phase
    from kappaskin.press import PressTest as PressTest
    from kappaskin.press import Verdict as Verdict
    from kappaskin.press import elements_to_press as elements_to_press
    from kappaskin.processes import load_beside as load_beside
    from kappaskin.publish import Latency as Latency
    from kappaskin.publish import Published as Published
    from kappaskin.publish import PublishNews as PublishNews
    from kappaskin.publish import Receiver as Receiver
    from kappaskin.quantities import QUANTITIES as QUANTITIES
    from kappaskin.quantities import ErrorBars as ErrorBars
    from kappaskin.quantities import Quantities as Quantities
    from kappaskin.quantities import of_form as of_form
    from kappaskin.recording.disk import is_written as is_written
    from kappaskin.recording.reading import Recording as Recording
    from kappaskin.recording.repair import Repaired as Repaired
    from kappaskin.recording.writing import Written as Written
    from kappaskin.region import Bargain as Bargain
    from kappaskin.region import Region as Region
    from kappaskin.region import Scanner as Scanner
    from kappaskin.region import bargain as bargain
    from kappaskin.region import contact_bound as contact_bound
    from kappaskin.rim import onto_rim as onto_rim
    from kappaskin.scan import Scan as Scan
    from kappaskin.scene import SCENES as SCENES
    from kappaskin.scene import Choice as Choice
    from kappaskin.scene import Indenter as Indenter
    from kappaskin.scene import Orbit as Orbit
    from kappaskin.scene import Pressed as Pressed
    from kappaskin.scene import Pressing as Pressing
    from kappaskin.scene import Scene as Scene
    from kappaskin.scene import Stimulus as Stimulus
    from kappaskin.scene import load_scene as load_scene
    from kappaskin.scene import moments_of as moments_of
    from kappaskin.scene import plan as plan
    from kappaskin.scene import planned as planned
    from kappaskin.scene import read_scene as read_scene
    from kappaskin.scene import read_scene_text as read_scene_text
    from kappaskin.scene import scene_file as scene_file
    from kappaskin.scene import write_scene as write_scene
    from kappaskin.sensor import Sensor as Sensor
    from kappaskin.setup_text import said_of_setup as said_of_setup
    from kappaskin.setup_text import setup_from as setup_from
    from kappaskin.setup_text import setups_of as setups_of
    from kappaskin.side import Computed as Computed
    from kappaskin.simulate import Simulator as Simulator
    from kappaskin.sources.ports import Port as Port
    from kappaskin.sources.ports import serial_ports as serial_ports
    from kappaskin.sources.replayed import Replay as Replay
    from kappaskin.sources.scanning import LISTS as LISTS
    from kappaskin.spectrum import amplitudes as amplitudes
    from kappaskin.status import Status as Status
    from kappaskin.studies.beside import Beside as Beside
    from kappaskin.studies.cost import Cost as Cost
    from kappaskin.studies.cost import EffectCost as EffectCost
    from kappaskin.studies.cost import Effects as Effects
    from kappaskin.studies.cost import Measuring as Measuring
    from kappaskin.studies.cost import Refused as Refused
    from kappaskin.studies.cost import Setting as Setting
    from kappaskin.studies.cost import cheapest as cheapest
    from kappaskin.studies.cost import costs as costs
    from kappaskin.studies.cost import effect_costs as effect_costs
    from kappaskin.studies.cost import frontier as frontier
    from kappaskin.studies.cost import settings_to_try as settings_to_try
    from kappaskin.studies.design import Check as Check
    from kappaskin.studies.design import Design as Design
    from kappaskin.studies.design import Prospect as Prospect
    from kappaskin.studies.design import check as check
    from kappaskin.studies.design import prospect as prospect
    from kappaskin.studies.plan import plan_told as plan_told
    from kappaskin.taring import Drift as Drift
    from kappaskin.touch import NO_OBJECT as NO_OBJECT
    from kappaskin.touch import ContactObject as ContactObject
    from kappaskin.touch import ObjectFinder as ObjectFinder
    from kappaskin.touch import PointContact as PointContact
    from kappaskin.touch import placed as placed
    from kappaskin.transduction import FIRST_GENERATION as FIRST_GENERATION
    from kappaskin.transduction import SECOND_GENERATION as SECOND_GENERATION
    from kappaskin.transduction import Amplifier as Amplifier
    from kappaskin.transduction import Converter as Converter
    from kappaskin.transduction import HalfBridge as HalfBridge
    from kappaskin.transduction import Multiplexer as Multiplexer
    from kappaskin.transduction import Transduction as Transduction
else:
    _OF_ROOMS = {
        "adoption": "Left orphans_folder",
        "apart": "Distances between distances",
        "bases": "EDGES Basis CurvatureMap SineBasis ValueMap basis_for edges_of",
        "calibration": (
            "ADVICE RADII Calibration CalibrationReport Limits Presentation Procedure Step Sweep "
            "Tare Tares calibrate data_folder load_calibration radii_for save_calibration schedule"
        ),
        "doctor": "examine",
        "effects": (
            "EFFECTS FIRST_GENERATION_LOOPS SECOND_GENERATION_LOOPS Creep GaussianNoise Hysteresis "
            "Tolerance UniformNoise parameters"
        ),
        "engine": "LONGEST_NOTE Engine",
        "errors": "Damaged RankDeficient Refusal SourceError lacking",
        "export": "Exported Exporting Repairing Wanted",
        "figures": "FIGURES write_figures",
        "fit": (
            "METHODS WHY AsPrinted Bayes Direct Estimator Fast FiniteSlope Fit LeastSquares Robust "
            "Tracking estimator_for singular_values"
        ),
        "frames": "COMPONENTS OVERTAKEN Estimate Event Frame LocalGeometry Touch Truth",
        "geometry": "local_geometry",
        "health": "Finding Health Monitor",
        "intrinsic": "ForceTorqueSensor IntrinsicContact IntrinsicTouch Wrench",
        "layout": "SensorLayout",
        "mechanics": (
            "Compliance DiscLoad GaussianLoad LineLoad Load Placed Plate PointLoad RectangleLoad"
        ),
        "patch": "Disk Patch Polygon",
        "pipeline": "Pipeline Setup",
        "placement": "PLACEMENTS elements_placed predicted_sd",
        "press": "Phase PressTest Verdict elements_to_press",
        "processes": "load_beside",
        "publish": "Latency Published PublishNews Receiver",
        "quantities": "QUANTITIES ErrorBars Quantities of_form",
        "recording.disk": "is_written",
        "recording.reading": "Recording",
        "recording.repair": "Repaired",
        "recording.writing": "Written",
        "region": "Bargain Region Scanner bargain contact_bound",
        "rim": "onto_rim",
        "scan": "Scan",
        "scene": (
            "SCENES Choice Indenter Orbit Pressed Pressing Scene Stimulus load_scene moments_of "
            "plan planned read_scene read_scene_text scene_file write_scene"
        ),
        "sensor": "Sensor",
        "setup_text": "said_of_setup setup_from setups_of",
        "side": "Computed",
        "simulate": "Simulator",
        "sources.replayed": "Replay",
        "sources.ports": "Port serial_ports",
        "sources.scanning": "LISTS",
        "spectrum": "amplitudes",
        "status": "Status",
        "studies.beside": "Beside",
        "studies.cost": (
            "Cost EffectCost Effects Measuring Refused Setting cheapest costs effect_costs "
            "frontier settings_to_try"
        ),
        "studies.design": "Check Design Prospect check prospect",
        "studies.plan": "plan_told",
        "taring": "Drift",
        "touch": "NO_OBJECT ContactObject ObjectFinder PointContact placed",
        "transduction": (
            "FIRST_GENERATION SECOND_GENERATION Amplifier Converter HalfBridge Multiplexer "
            "Transduction"
        ),
    }
    _ROOM = {name: room for room, names in _OF_ROOMS.items() for name in names.split()}
    __all__ = list(_ROOM)

    def __getattr__(name):
        """A name that is exported, from its room; found without this from then on."""
        if name not in _ROOM:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = globals()[name] = getattr(import_module(f"{__name__}.{_ROOM[name]}"), name)
        return found

    def __dir__():
        return sorted({*globals(), *_ROOM})
