"""Figures for print: names to files, each drawn from a run of its own."""

from kappaskin.studies.figures.registry import FIGURES as FIGURES
from kappaskin.studies.figures.registry import write_figures as write_figures
