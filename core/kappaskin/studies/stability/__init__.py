"""Hard cases, each run through every method that claims it, with a verdict on each answer."""

from kappaskin.studies.stability.run import run_stability as run_stability
from kappaskin.studies.stability.text import stability_text as stability_text
