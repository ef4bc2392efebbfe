"""A quantity added to the table of what an estimate reports is found everywhere on the screen."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]

FOUND = """
import json

import numpy as np
from PySide6.QtWidgets import QApplication

from kappaskin import Pipeline, Setup, Simulator, Status, load_scene
from kappaskin._text import with_error
from kappaskin_app.features.contact.numbers import ELEMENTS, elements_of, facts_of
from kappaskin_app.features.contact.readouts import Readouts
from kappaskin_app.features.heatmaps.heatmap import HeatmapGrid
from kappaskin_app.features.lessons.lesson_file import READOUTS
from kappaskin_app.features.traces.element_panel import ElementPanel, Traces
from kappaskin_app.features.traces.selected_element import facts
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.colouring import SHADES, Colouring
from kappaskin_app.shell.settings import COLOURS, Settings
from kappaskin_app.widgets.text import ERROR_BARS

app = QApplication([])
scene = load_scene("off-centre")
sensor, setup = scene.sensor(), Setup(4, 3, 9, 7)
estimate = Pipeline(sensor, setup)(Simulator(scene).frame(0, lambda: 1.0))
status = Status(sensor=sensor, setup=setup)
found, twice = {}, 2 * estimate.curvature

readouts = Readouts()
readouts.show_estimate(estimate)
force, sd = estimate.contact.force, estimate.contact.force_sd
found["header"] = readouts.text("twice") == with_error(2 * force, 2 * sd, "N")
found["lessons"] = "readout-twice" in READOUTS
rows = facts_of(estimate, "", ERROR_BARS["sigma"])
found["facts"] = ("Twice", f"{2 * force:.4f}") in [row[:2] for row in rows]
at = ELEMENTS.index("twice xy [1/m]")
found["elements"] = elements_of(estimate, sensor)[7][at] == with_error(twice[2, 7])
found["panel"] = "reads twice [1/m]" in facts(7, sensor, status, estimate)

panel, traces = ElementPanel(), Traces()
values = np.arange(12.0).reshape(2, 6)
panel.show_history(np.array([-1.0, 0.0]), values)
traces.show_history([3], np.array([-1.0, 0.0]), values[:, :, None])
found["panel's history"] = panel.histories[1].series[2].y.tolist() == [5.0, 11.0]
found["traces"] = traces.plots[5].series[0].y.tolist() == [5.0, 11.0]

tasks = Tasks()
colouring = Colouring(tasks)
colouring.follow(status)
found["colours"] = np.array_equal(colouring.of_elements("twice_xy", estimate), twice[2])
tasks.close()
found["menu"] = dict(COLOURS)["twice_xy"] == "Twice xy" and SHADES["twice_xy"].on_surface is None
found["range"] = Settings(range_twice_xy=3.0).range_twice_xy == 3.0
found["heatmaps"] = "twice_xy" in HeatmapGrid().heatmaps
print(json.dumps({name: bool(whether) for name, whether in found.items()}))
"""


@pytest.mark.slow
def test_quantities_added_to_the_table_are_in_every_view() -> None:
    code = (TESTS / "added_quantities.py").read_text("utf-8") + FOUND
    environment = os.environ | {"QT_QPA_PLATFORM": "offscreen"}

    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=180, env=environment
    )

    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found == dict.fromkeys(found, True)
    assert len(found) == 11
