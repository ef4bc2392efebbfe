"""Kappaskin: shape and contact from curvature-sensing tactile skins, live and with error bars.

A room is imported when a name of it is first asked for. What checks types sees the first list, what
runs the second: a `__getattr__` seen by both would let every misspelt name pass.
"""

from typing import TYPE_CHECKING

from kappaskin._lazy import lazy_names

if TYPE_CHECKING:
    from kappaskin._processes import BackgroundProcess as BackgroundProcess
    from kappaskin._processes import preload_library as preload_library
    from kappaskin.bases import EDGES as EDGES
    from kappaskin.bases import Basis as Basis
    from kappaskin.bases import CurvatureMap as CurvatureMap
    from kappaskin.bases import SineBasis as SineBasis
    from kappaskin.bases import ValueMap as ValueMap
    from kappaskin.bases import basis_for as basis_for
    from kappaskin.bases import edges_of as edges_of
    from kappaskin.calibration import Calibration as Calibration
    from kappaskin.calibration import CalibrationReport as CalibrationReport
    from kappaskin.calibration import ChannelLimits as ChannelLimits
    from kappaskin.calibration import Drift as Drift
    from kappaskin.calibration import MapVerdict as MapVerdict
    from kappaskin.calibration import PressPhase as PressPhase
    from kappaskin.calibration import PressTest as PressTest
    from kappaskin.calibration import Procedure as Procedure
    from kappaskin.calibration import Sweep as Sweep
    from kappaskin.calibration import Tare as Tare
    from kappaskin.calibration import TareStore as TareStore
    from kappaskin.calibration import calibrate as calibrate
    from kappaskin.calibration import elements_to_press as elements_to_press
    from kappaskin.calibration import load_calibration as load_calibration
    from kappaskin.calibration import save_calibration as save_calibration
    from kappaskin.calibration import tare_folder as tare_folder
    from kappaskin.cli.system import examine as examine
    from kappaskin.contact import NO_OBJECT as NO_OBJECT
    from kappaskin.contact import ContactObject as ContactObject
    from kappaskin.contact import ForceTorqueSensor as ForceTorqueSensor
    from kappaskin.contact import IntrinsicContact as IntrinsicContact
    from kappaskin.contact import IntrinsicTouch as IntrinsicTouch
    from kappaskin.contact import ObjectFinder as ObjectFinder
    from kappaskin.contact import PointContact as PointContact
    from kappaskin.contact import Wrench as Wrench
    from kappaskin.contact import local_geometry as local_geometry
    from kappaskin.contact import placed_object as placed_object
    from kappaskin.errors import Damaged as Damaged
    from kappaskin.errors import RankDeficient as RankDeficient
    from kappaskin.errors import Refusal as Refusal
    from kappaskin.errors import SourceError as SourceError
    from kappaskin.errors import lacking as lacking
    from kappaskin.estimation import FAULTS as FAULTS
    from kappaskin.estimation import METHODS as METHODS
    from kappaskin.estimation import PLACEMENTS as PLACEMENTS
    from kappaskin.estimation import AsPrinted as AsPrinted
    from kappaskin.estimation import Bayes as Bayes
    from kappaskin.estimation import Direct as Direct
    from kappaskin.estimation import Estimator as Estimator
    from kappaskin.estimation import Fast as Fast
    from kappaskin.estimation import FiniteSlopeLeastSquares as FiniteSlopeLeastSquares
    from kappaskin.estimation import Fit as Fit
    from kappaskin.estimation import LeastSquares as LeastSquares
    from kappaskin.estimation import Region as Region
    from kappaskin.estimation import Robust as Robust
    from kappaskin.estimation import Scanner as Scanner
    from kappaskin.estimation import ScanTradeoff as ScanTradeoff
    from kappaskin.estimation import Tracking as Tracking
    from kappaskin.estimation import amplitude_spectrum as amplitude_spectrum
    from kappaskin.estimation import contact_bound as contact_bound
    from kappaskin.estimation import estimator_for as estimator_for
    from kappaskin.estimation import place_elements as place_elements
    from kappaskin.estimation import predicted_sd as predicted_sd
    from kappaskin.estimation import scan_tradeoff as scan_tradeoff
    from kappaskin.estimation import singular_values as singular_values
    from kappaskin.frames import COMPONENTS as COMPONENTS
    from kappaskin.frames import OVERTAKEN as OVERTAKEN
    from kappaskin.frames import Estimate as Estimate
    from kappaskin.frames import Event as Event
    from kappaskin.frames import Frame as Frame
    from kappaskin.frames import LocalGeometry as LocalGeometry
    from kappaskin.frames import Touch as Touch
    from kappaskin.frames import Truth as Truth
    from kappaskin.health import Finding as Finding
    from kappaskin.health import Health as Health
    from kappaskin.health import HealthMonitor as HealthMonitor
    from kappaskin.live import LONGEST_NOTE as LONGEST_NOTE
    from kappaskin.live import Engine as Engine
    from kappaskin.live import PipelineStatus as PipelineStatus
    from kappaskin.live import ResumeInfo as ResumeInfo
    from kappaskin.live import Status as Status
    from kappaskin.live import resume_folder as resume_folder
    from kappaskin.mechanics import Compliance as Compliance
    from kappaskin.mechanics import DiscLoad as DiscLoad
    from kappaskin.mechanics import GaussianLoad as GaussianLoad
    from kappaskin.mechanics import LineLoad as LineLoad
    from kappaskin.mechanics import Load as Load
    from kappaskin.mechanics import PlacedObject as PlacedObject
    from kappaskin.mechanics import Plate as Plate
    from kappaskin.mechanics import PointLoad as PointLoad
    from kappaskin.mechanics import RectangleLoad as RectangleLoad
    from kappaskin.pipeline import QUANTITIES as QUANTITIES
    from kappaskin.pipeline import ErrorBars as ErrorBars
    from kappaskin.pipeline import Pipeline as Pipeline
    from kappaskin.pipeline import Quantities as Quantities
    from kappaskin.pipeline import Setup as Setup
    from kappaskin.pipeline import curvature_invariant as curvature_invariant
    from kappaskin.publish import Latency as Latency
    from kappaskin.publish import PublishStatus as PublishStatus
    from kappaskin.publish import Receiver as Receiver
    from kappaskin.publish import TargetStatus as TargetStatus
    from kappaskin.recording import Exported as Exported
    from kappaskin.recording import ExportRequest as ExportRequest
    from kappaskin.recording import ExportTask as ExportTask
    from kappaskin.recording import Recording as Recording
    from kappaskin.recording import RecordingStatus as RecordingStatus
    from kappaskin.recording import Repaired as Repaired
    from kappaskin.recording import RepairTask as RepairTask
    from kappaskin.recording import Replay as Replay
    from kappaskin.recording import is_written as is_written
    from kappaskin.recording import recorded_setups as recorded_setups
    from kappaskin.recording import setup_from_text as setup_from_text
    from kappaskin.recording import setup_to_text as setup_to_text
    from kappaskin.scenes import ADVICE as ADVICE
    from kappaskin.scenes import RADII as RADII
    from kappaskin.scenes import SCENES as SCENES
    from kappaskin.scenes import AppliedLoads as AppliedLoads
    from kappaskin.scenes import CylinderStep as CylinderStep
    from kappaskin.scenes import EffectSelection as EffectSelection
    from kappaskin.scenes import Indenter as Indenter
    from kappaskin.scenes import LoadingHistory as LoadingHistory
    from kappaskin.scenes import Orbit as Orbit
    from kappaskin.scenes import Presentation as Presentation
    from kappaskin.scenes import Scene as Scene
    from kappaskin.scenes import Simulator as Simulator
    from kappaskin.scenes import Stimulus as Stimulus
    from kappaskin.scenes import load_scene as load_scene
    from kappaskin.scenes import plan as plan
    from kappaskin.scenes import planned as planned
    from kappaskin.scenes import radii_for as radii_for
    from kappaskin.scenes import read_scene as read_scene
    from kappaskin.scenes import read_scene_text as read_scene_text
    from kappaskin.scenes import scene_file as scene_file
    from kappaskin.scenes import schedule as schedule
    from kappaskin.scenes import survey_times as survey_times
    from kappaskin.scenes import write_scene as write_scene
    from kappaskin.scenes.effects import EFFECTS as EFFECTS
    from kappaskin.scenes.effects import FIRST_GENERATION_LOOPS as FIRST_GENERATION_LOOPS
    from kappaskin.scenes.effects import SECOND_GENERATION_LOOPS as SECOND_GENERATION_LOOPS
    from kappaskin.scenes.effects import Creep as Creep
    from kappaskin.scenes.effects import GaussianNoise as GaussianNoise
    from kappaskin.scenes.effects import Hysteresis as Hysteresis
    from kappaskin.scenes.effects import Tolerance as Tolerance
    from kappaskin.scenes.effects import UniformNoise as UniformNoise
    from kappaskin.scenes.effects import parameters as parameters
    from kappaskin.sensing import FIRST_GENERATION as FIRST_GENERATION
    from kappaskin.sensing import SECOND_GENERATION as SECOND_GENERATION
    from kappaskin.sensing import Amplifier as Amplifier
    from kappaskin.sensing import Converter as Converter
    from kappaskin.sensing import HalfBridge as HalfBridge
    from kappaskin.sensing import Multiplexer as Multiplexer
    from kappaskin.sensing import Scan as Scan
    from kappaskin.sensing import Sensor as Sensor
    from kappaskin.sensing import SensorLayout as SensorLayout
    from kappaskin.sensing import Transduction as Transduction
    from kappaskin.skin import Disk as Disk
    from kappaskin.skin import Distances as Distances
    from kappaskin.skin import Patch as Patch
    from kappaskin.skin import Polygon as Polygon
    from kappaskin.skin import distances as distances
    from kappaskin.skin import snapped_to_rim as snapped_to_rim
    from kappaskin.sources import SCAN_LISTS_PER_SECOND as SCAN_LISTS_PER_SECOND
    from kappaskin.sources import Port as Port
    from kappaskin.sources import serial_ports as serial_ports
    from kappaskin.studies import FIGURES as FIGURES
    from kappaskin.studies import Check as Check
    from kappaskin.studies import Cost as Cost
    from kappaskin.studies import CostMeasurement as CostMeasurement
    from kappaskin.studies import Design as Design
    from kappaskin.studies import EffectCost as EffectCost
    from kappaskin.studies import EffectCosts as EffectCosts
    from kappaskin.studies import Prospect as Prospect
    from kappaskin.studies import Refused as Refused
    from kappaskin.studies import Setting as Setting
    from kappaskin.studies import cheapest as cheapest
    from kappaskin.studies import check as check
    from kappaskin.studies import costs as costs
    from kappaskin.studies import effect_costs as effect_costs
    from kappaskin.studies import frontier as frontier
    from kappaskin.studies import plan_updates as plan_updates
    from kappaskin.studies import prospect as prospect
    from kappaskin.studies import settings_to_try as settings_to_try
    from kappaskin.studies import write_figures as write_figures
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "_processes": "BackgroundProcess preload_library",
            "bases": "Basis CurvatureMap EDGES SineBasis ValueMap basis_for edges_of",
            "calibration": (
                "Calibration CalibrationReport ChannelLimits Drift MapVerdict PressPhase "
                "PressTest Procedure Sweep Tare TareStore calibrate elements_to_press "
                "load_calibration save_calibration tare_folder"
            ),
            "cli.system": "examine",
            "contact": (
                "ContactObject ForceTorqueSensor IntrinsicContact IntrinsicTouch NO_OBJECT "
                "ObjectFinder PointContact Wrench local_geometry placed_object"
            ),
            "errors": "Damaged RankDeficient Refusal SourceError lacking",
            "estimation": (
                "AsPrinted Bayes Direct Estimator FAULTS Fast FiniteSlopeLeastSquares Fit "
                "LeastSquares METHODS PLACEMENTS Region Robust ScanTradeoff Scanner Tracking "
                "amplitude_spectrum contact_bound estimator_for place_elements predicted_sd "
                "scan_tradeoff singular_values"
            ),
            "frames": "COMPONENTS Estimate Event Frame LocalGeometry OVERTAKEN Touch Truth",
            "health": "Finding Health HealthMonitor",
            "live": "PipelineStatus Engine LONGEST_NOTE ResumeInfo Status resume_folder",
            "mechanics": (
                "Compliance DiscLoad GaussianLoad LineLoad Load PlacedObject Plate PointLoad "
                "RectangleLoad"
            ),
            "pipeline": "ErrorBars Pipeline QUANTITIES Quantities Setup curvature_invariant",
            "publish": "Latency PublishStatus TargetStatus Receiver",
            "recording": (
                "Exported ExportTask Recording Repaired RepairTask Replay ExportRequest "
                "RecordingStatus is_written setup_to_text setup_from_text recorded_setups"
            ),
            "scenes": (
                "ADVICE AppliedLoads CylinderStep EffectSelection Indenter LoadingHistory Orbit "
                "Presentation RADII SCENES Scene Simulator Stimulus load_scene plan planned "
                "radii_for read_scene read_scene_text scene_file schedule survey_times "
                "write_scene"
            ),
            "scenes.effects": (
                "Creep EFFECTS FIRST_GENERATION_LOOPS GaussianNoise Hysteresis "
                "SECOND_GENERATION_LOOPS Tolerance UniformNoise parameters"
            ),
            "sensing": (
                "Amplifier Converter FIRST_GENERATION HalfBridge Multiplexer SECOND_GENERATION "
                "Scan Sensor SensorLayout Transduction"
            ),
            "skin": "Disk Distances Patch Polygon distances interpolated snapped_to_rim",
            "sources": "Port SCAN_LISTS_PER_SECOND serial_ports",
            "studies": (
                "Check Cost CostMeasurement Design EffectCost EffectCosts FIGURES Prospect Refused "
                "Setting cheapest check costs effect_costs frontier plan_updates prospect "
                "settings_to_try write_figures"
            ),
        },
    )
