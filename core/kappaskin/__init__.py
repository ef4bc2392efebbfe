"""Kappaskin: shape and contact from curvature-sensing tactile skins, live and with error bars.

A room is imported when a name of it is first asked for. What checks types sees the first list, what
runs the second: a `__getattr__` seen by both would let every misspelt name pass.
"""

from typing import TYPE_CHECKING

from kappaskin._lazy import lazy_names

if TYPE_CHECKING:
    from kappaskin._background import Beside as Beside
    from kappaskin._processes import load_beside as load_beside
    from kappaskin.bases import EDGES as EDGES
    from kappaskin.bases import Basis as Basis
    from kappaskin.bases import CurvatureMap as CurvatureMap
    from kappaskin.bases import SineBasis as SineBasis
    from kappaskin.bases import ValueMap as ValueMap
    from kappaskin.bases import basis_for as basis_for
    from kappaskin.bases import edges_of as edges_of
    from kappaskin.calibration import Calibration as Calibration
    from kappaskin.calibration import CalibrationReport as CalibrationReport
    from kappaskin.calibration import Drift as Drift
    from kappaskin.calibration import Limits as Limits
    from kappaskin.calibration import Phase as Phase
    from kappaskin.calibration import PressTest as PressTest
    from kappaskin.calibration import Procedure as Procedure
    from kappaskin.calibration import Sweep as Sweep
    from kappaskin.calibration import Tare as Tare
    from kappaskin.calibration import Tares as Tares
    from kappaskin.calibration import Verdict as Verdict
    from kappaskin.calibration import calibrate as calibrate
    from kappaskin.calibration import data_folder as data_folder
    from kappaskin.calibration import elements_to_press as elements_to_press
    from kappaskin.calibration import load_calibration as load_calibration
    from kappaskin.calibration import save_calibration as save_calibration
    from kappaskin.cli.machine import examine as examine
    from kappaskin.contact import NO_OBJECT as NO_OBJECT
    from kappaskin.contact import ContactObject as ContactObject
    from kappaskin.contact import ForceTorqueSensor as ForceTorqueSensor
    from kappaskin.contact import IntrinsicContact as IntrinsicContact
    from kappaskin.contact import IntrinsicTouch as IntrinsicTouch
    from kappaskin.contact import ObjectFinder as ObjectFinder
    from kappaskin.contact import PointContact as PointContact
    from kappaskin.contact import Wrench as Wrench
    from kappaskin.contact import local_geometry as local_geometry
    from kappaskin.contact import placed as placed
    from kappaskin.errors import Damaged as Damaged
    from kappaskin.errors import RankDeficient as RankDeficient
    from kappaskin.errors import Refusal as Refusal
    from kappaskin.errors import SourceError as SourceError
    from kappaskin.errors import lacking as lacking
    from kappaskin.estimation import METHODS as METHODS
    from kappaskin.estimation import PLACEMENTS as PLACEMENTS
    from kappaskin.estimation import WHY as WHY
    from kappaskin.estimation import AsPrinted as AsPrinted
    from kappaskin.estimation import Bargain as Bargain
    from kappaskin.estimation import Bayes as Bayes
    from kappaskin.estimation import Direct as Direct
    from kappaskin.estimation import Estimator as Estimator
    from kappaskin.estimation import Fast as Fast
    from kappaskin.estimation import FiniteSlope as FiniteSlope
    from kappaskin.estimation import Fit as Fit
    from kappaskin.estimation import LeastSquares as LeastSquares
    from kappaskin.estimation import Region as Region
    from kappaskin.estimation import Robust as Robust
    from kappaskin.estimation import Scanner as Scanner
    from kappaskin.estimation import Tracking as Tracking
    from kappaskin.estimation import amplitudes as amplitudes
    from kappaskin.estimation import bargain as bargain
    from kappaskin.estimation import contact_bound as contact_bound
    from kappaskin.estimation import elements_placed as elements_placed
    from kappaskin.estimation import estimator_for as estimator_for
    from kappaskin.estimation import predicted_sd as predicted_sd
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
    from kappaskin.health import Monitor as Monitor
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
    from kappaskin.mechanics import Placed as Placed
    from kappaskin.mechanics import Plate as Plate
    from kappaskin.mechanics import PointLoad as PointLoad
    from kappaskin.mechanics import RectangleLoad as RectangleLoad
    from kappaskin.pipeline import QUANTITIES as QUANTITIES
    from kappaskin.pipeline import ErrorBars as ErrorBars
    from kappaskin.pipeline import Pipeline as Pipeline
    from kappaskin.pipeline import Quantities as Quantities
    from kappaskin.pipeline import Setup as Setup
    from kappaskin.pipeline import of_form as of_form
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
    from kappaskin.scenes import EFFECTS as EFFECTS
    from kappaskin.scenes import FIRST_GENERATION_LOOPS as FIRST_GENERATION_LOOPS
    from kappaskin.scenes import RADII as RADII
    from kappaskin.scenes import SCENES as SCENES
    from kappaskin.scenes import SECOND_GENERATION_LOOPS as SECOND_GENERATION_LOOPS
    from kappaskin.scenes import Choice as Choice
    from kappaskin.scenes import Creep as Creep
    from kappaskin.scenes import GaussianNoise as GaussianNoise
    from kappaskin.scenes import Hysteresis as Hysteresis
    from kappaskin.scenes import Indenter as Indenter
    from kappaskin.scenes import Orbit as Orbit
    from kappaskin.scenes import Presentation as Presentation
    from kappaskin.scenes import Pressed as Pressed
    from kappaskin.scenes import Pressing as Pressing
    from kappaskin.scenes import Scene as Scene
    from kappaskin.scenes import Simulator as Simulator
    from kappaskin.scenes import Step as Step
    from kappaskin.scenes import Stimulus as Stimulus
    from kappaskin.scenes import Tolerance as Tolerance
    from kappaskin.scenes import UniformNoise as UniformNoise
    from kappaskin.scenes import load_scene as load_scene
    from kappaskin.scenes import moments_of as moments_of
    from kappaskin.scenes import parameters as parameters
    from kappaskin.scenes import plan as plan
    from kappaskin.scenes import planned as planned
    from kappaskin.scenes import radii_for as radii_for
    from kappaskin.scenes import read_scene as read_scene
    from kappaskin.scenes import read_scene_text as read_scene_text
    from kappaskin.scenes import scene_file as scene_file
    from kappaskin.scenes import schedule as schedule
    from kappaskin.scenes import write_scene as write_scene
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
    from kappaskin.skin import between as between
    from kappaskin.skin import distances as distances
    from kappaskin.skin import onto_rim as onto_rim
    from kappaskin.sources import LISTS as LISTS
    from kappaskin.sources import Port as Port
    from kappaskin.sources import serial_ports as serial_ports
    from kappaskin.studies import FIGURES as FIGURES
    from kappaskin.studies import Check as Check
    from kappaskin.studies import Cost as Cost
    from kappaskin.studies import Design as Design
    from kappaskin.studies import EffectCost as EffectCost
    from kappaskin.studies import Effects as Effects
    from kappaskin.studies import Measuring as Measuring
    from kappaskin.studies import Prospect as Prospect
    from kappaskin.studies import Refused as Refused
    from kappaskin.studies import Setting as Setting
    from kappaskin.studies import cheapest as cheapest
    from kappaskin.studies import check as check
    from kappaskin.studies import costs as costs
    from kappaskin.studies import effect_costs as effect_costs
    from kappaskin.studies import frontier as frontier
    from kappaskin.studies import plan_told as plan_told
    from kappaskin.studies import prospect as prospect
    from kappaskin.studies import settings_to_try as settings_to_try
    from kappaskin.studies import write_figures as write_figures
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "_background": "Beside",
            "_processes": "load_beside",
            "bases": "Basis CurvatureMap EDGES SineBasis ValueMap basis_for edges_of",
            "calibration": (
                "Calibration CalibrationReport Drift Limits Phase PressTest Procedure Sweep "
                "Tare Tares Verdict calibrate data_folder elements_to_press load_calibration "
                "save_calibration"
            ),
            "cli.machine": "examine",
            "contact": (
                "ContactObject ForceTorqueSensor IntrinsicContact IntrinsicTouch NO_OBJECT "
                "ObjectFinder PointContact Wrench local_geometry placed"
            ),
            "errors": "Damaged RankDeficient Refusal SourceError lacking",
            "estimation": (
                "AsPrinted Bargain Bayes Direct Estimator Fast FiniteSlope Fit LeastSquares "
                "METHODS PLACEMENTS Region Robust Scanner Tracking WHY amplitudes bargain "
                "contact_bound elements_placed estimator_for predicted_sd singular_values"
            ),
            "frames": "COMPONENTS Estimate Event Frame LocalGeometry OVERTAKEN Touch Truth",
            "health": "Finding Health Monitor",
            "live": "PipelineStatus Engine LONGEST_NOTE ResumeInfo Status resume_folder",
            "mechanics": (
                "Compliance DiscLoad GaussianLoad LineLoad Load Placed Plate PointLoad "
                "RectangleLoad"
            ),
            "pipeline": "ErrorBars Pipeline QUANTITIES Quantities Setup of_form",
            "publish": "Latency PublishStatus TargetStatus Receiver",
            "recording": (
                "Exported ExportTask Recording Repaired RepairTask Replay ExportRequest "
                "RecordingStatus is_written setup_to_text setup_from_text recorded_setups"
            ),
            "scenes": (
                "ADVICE Choice Creep EFFECTS FIRST_GENERATION_LOOPS GaussianNoise Hysteresis "
                "Indenter Orbit Presentation Pressed Pressing RADII SCENES "
                "SECOND_GENERATION_LOOPS Scene Simulator Step Stimulus Tolerance UniformNoise "
                "load_scene moments_of parameters plan planned radii_for read_scene "
                "read_scene_text scene_file schedule write_scene"
            ),
            "sensing": (
                "Amplifier Converter FIRST_GENERATION HalfBridge Multiplexer SECOND_GENERATION "
                "Scan Sensor SensorLayout Transduction"
            ),
            "skin": "Disk Distances Patch Polygon between distances onto_rim",
            "sources": "LISTS Port serial_ports",
            "studies": (
                "Check Cost Design EffectCost Effects FIGURES Measuring Prospect Refused "
                "Setting cheapest check costs effect_costs frontier plan_told prospect "
                "settings_to_try write_figures"
            ),
        },
    )
