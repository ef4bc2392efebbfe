"""Pipeline: frames to estimates, and files of readings to files of shapes."""

from kappaskin.pipeline.pipeline import Pipeline as Pipeline
from kappaskin.pipeline.pipeline import Setup as Setup
from kappaskin.pipeline.quantities import QUANTITIES as QUANTITIES
from kappaskin.pipeline.quantities import ErrorBars as ErrorBars
from kappaskin.pipeline.quantities import Quantities as Quantities
from kappaskin.pipeline.quantities import curvature_invariant as curvature_invariant
from kappaskin.pipeline.reconstruct import reconstruct as reconstruct
