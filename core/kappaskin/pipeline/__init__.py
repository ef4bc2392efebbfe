"""Pipeline: frames to estimates, and files of readings to files of shapes."""

from kappaskin.pipeline.pipeline import Pipeline as Pipeline
from kappaskin.pipeline.pipeline import Setup as Setup
from kappaskin.pipeline.quantities import ErrorBars as ErrorBars
from kappaskin.pipeline.quantities import Quantities as Quantities
from kappaskin.pipeline.reconstruction import reconstruct as reconstruct
from kappaskin.pipeline.reported import ACROSS as ACROSS
from kappaskin.pipeline.reported import ALONG as ALONG
from kappaskin.pipeline.reported import COLUMN as COLUMN
from kappaskin.pipeline.reported import ELEMENT as ELEMENT
from kappaskin.pipeline.reported import REPORTED as REPORTED
from kappaskin.pipeline.reported import ROW as ROW
from kappaskin.pipeline.reported import Getter as Getter
from kappaskin.pipeline.reported import Number as Number
from kappaskin.pipeline.reported import Readout as Readout
from kappaskin.pipeline.reported import Reported as Reported
from kappaskin.pipeline.reported import ReportedQuantity as ReportedQuantity
from kappaskin.pipeline.reported import SkinColour as SkinColour
from kappaskin.pipeline.reported import curvature_invariant as curvature_invariant
from kappaskin.pipeline.reported import getters as getters
from kappaskin.pipeline.reported import numbers_of as numbers_of
from kappaskin.pipeline.reported import readouts as readouts
from kappaskin.pipeline.reported import readouts_of as readouts_of
from kappaskin.pipeline.reported import skin_colours as skin_colours
from kappaskin.pipeline.reported import stored as stored
