"""Faults inflicted on a line and a process, each with figures of what became of it."""

from kappaskin.studies.drills.run import DRILLS as DRILLS
from kappaskin.studies.drills.run import run_drills as run_drills
from kappaskin.studies.drills.text import drills_text as drills_text
