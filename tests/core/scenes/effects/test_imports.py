"""What is left out of a scene is not imported."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

# A plate, a load on it, and what a scene does with every known effect before it starts any.
SIZED = """
import sys
import numpy as np
import kappaskin
from kappaskin import *
from kappaskin.scenes.effects import *
from kappaskin._schema import parameters
from kappaskin.scenes.effects import EFFECTS

patch = Patch(0.1, 0.1)
plate, layout = Plate(patch, tension=5.0), SensorLayout.regular(patch, 4, 4)
basis, load = SineBasis(patch, 5, 5), PointLoad(0.04, 0.05, 1.0)
force = load.modal(basis)
c = plate.compliance(basis)(force)
K = layout.operator(basis) @ c.ravel()
survey = Survey(
    plate, basis, layout, Transduction(), np.zeros(1), force.reshape(1, -1), c.reshape(1, -1),
    K.reshape(1, 3, -1), np.zeros(48), 1.0, np.zeros(48),
)
every = [
    Tension(5.0), Foam(1e5), Fluid(), StretchingEffect(2e-4), FiniteSlopeEffect(),
    GageLength(3e-3), DeadElements((1,)),
    StrainLimit(Transduction(), 0.1), SECOND_GENERATION_LOOPS, Creep(0.1, 1.0),
    Temperature(5.0, 1.0, 0.1), Tolerance(0.1, 0.1), IntermittentElements((1,)), MainsHum(0.1),
    Skew(), CrossTalk(0.1), FlickerNoise(0.1), GaussianNoise(0.1), UniformNoise(0.1),
    Saturation(Transduction()), Quantisation(Transduction()), StuckElements((1,)),
    DroppedFrames(0.1), CorruptedFrames(0.1),
]
for effect in every:
    effect.size(survey), str(effect), effect.formula, parameters(type(effect))
assert len(every) == len(EFFECTS)
plate, layout = every[0].of(plate), every[5].of(layout)

def at_work():
    room = "kappaskin.scenes.effects.at_work."
    return sorted(name[len(room):] for name in sys.modules if name.startswith(room))

print(*at_work())
"""

STARTED = """
ran = set()

def note(frame, event, _):
    code = frame.f_code
    if event == "call" and "at_work" in code.co_filename and code.co_name != "<module>":
        ran.add(code.co_qualname.split(".")[0])

sys.setprofile(note)
effect = {effect.name: effect for effect in every}[sys.argv[1]]
if isinstance(effect, FiniteSlopeEffect):
    effect.sensed(basis, layout)(c)
elif isinstance(effect, ReadingEffect):
    effect.start((3, 16), np.random.default_rng(0))(K.reshape(3, 16), 0.0)
else:
    effect.start(np.random.default_rng(0))(0)
sys.setprofile(None)
print(*at_work(), *sorted(ran))
"""


def modules(code, *arguments):
    """What was imported, and run, of effects at work by the end of each print."""
    ran = [sys.executable, "-c", code, *arguments]
    lines = subprocess.run(ran, capture_output=True, text=True, check=True).stdout.splitlines()
    return [line.split() for line in lines]


def test_describing_and_sizing_every_effect_imports_none_at_work():
    assert modules(SIZED) == [[]]


@pytest.mark.cases("cross-talk", "quantisation")
@pytest.mark.parametrize(
    ("name", "room", "own"),
    [
        ("finite-slope", "gages", "finite_slope"),
        ("cross-talk", "electronics", "cross_talk"),
        ("flicker-noise", "electronics", "flicker"),
        ("stuck", "failures", "stuck"),
        ("quantisation", "electronics", "quantisation"),
        ("dropped-frames", "failures", "hits"),
    ],
)
def test_starting_an_effect_imports_and_runs_its_own_work_and_no_other(name, room, own):
    assert modules(SIZED + STARTED, name) == [[], [room, own]]
