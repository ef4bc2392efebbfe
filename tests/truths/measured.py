"""Readings that others measured: lines and sensor descriptions that come with the program."""

from importlib.resources import files
from pathlib import Path

import numpy as np

from kappaskin.sources import load_description

FOLDER = Path(str(files("kappaskin_resources"))) / "measured"


def measured(name):
    """The layout of a described sensor, and the readings (R,) in its line, (T, R) in T lines."""
    sensor = load_description(FOLDER / f"{name}.toml")
    columns, layout = sensor.columns, sensor.sensor.layout
    numbers = np.loadtxt(FOLDER / f"{name}.csv", delimiter=",")
    readings = np.empty((*numbers.shape[:-1], layout.channels))
    readings[..., columns.channels] = columns.scale * numbers[..., columns.places] + columns.offset
    return layout, readings
