"""Setup of a pipeline: its schema, and a setup as text that names its calibration and tare."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from kappaskin._schema import Key, Part, Unit, Within
from kappaskin._toml import json_table
from kappaskin.bases import EDGES
from kappaskin.calibration import Calibration, Tare, TareStore
from kappaskin.errors import Refusal
from kappaskin.estimation import METHODS, Estimator
from kappaskin.sensing import Sensor

QUANTITIES = "surface", "contact", "geometry"
"""What a pipeline computes of a shape, each with its error bars; the geometry is at the contact."""


@dataclass(frozen=True)
class Setup:
    """Settings of a pipeline: Ni x Nj functions, a surface of nx x ny points.

    `edge` says which functions; empty, those for the edge that the sensor says it has. `method` is
    one of `METHODS`. A channel that a frame leaves out keeps its last reading until that is
    `hold` s old. Readings are relative to the zero of the `tare` and corrected by the
    `calibration`, both of which must be the sensor's own. A rim that gives is expected to move by
    `rim_sd` in m. Besides the shape those of `QUANTITIES` are computed that are named; the others
    are NaN, and no contact. What somebody publishes or records is computed too.
    """

    Ni: int = 8
    Nj: int = 8
    nx: int = 65
    ny: int = 65
    edge: str = ""
    method: str = next(iter(METHODS))
    hold: float = 0.1
    calibration: Calibration | None = None
    tare: Tare | None = None
    rim_sd: float = Estimator.RIM_SD
    quantities: tuple[str, ...] = QUANTITIES


_COUNT = Within(1, 4096, whole=True)
_SHOWN = 64  # functions along one side that an editor offers at most

_METHODS = {
    "least-squares": "Least squares",
    "as-printed": "As printed (Eq. 6)",
    "direct": "Direct, solved in each frame",
    "fast": "Fast, for regular grids",
    "tracking": "Tracking, from frame to frame",
    "bayes": "Bayes, with a plate's prior",
    "finite-slope": "Finite slope",
    "robust": "Robust, excludes faulty elements",
}  # on the screen, where that is not the name

SETUP = Part(
    "Setup",
    {
        "Ni": Key(
            "Basis functions in x",
            "Ni, the number of basis functions in x (Eq. 1). More follow finer shapes and more "
            "noise; with more than elements in both x and y, readings cannot determine them all.",
            most=_SHOWN,
            limits=_COUNT,
        ),
        "Nj": Key("Basis functions in y", "Nj, the same in y (Eq. 1).", most=_SHOWN, limits=_COUNT),
        "nx": Key("Points along x", "Points of the computed surface along x.", limits=_COUNT),
        "ny": Key("Points along y", "Points of the computed surface along y.", limits=_COUNT),
        "hold": Key(
            "Hold",
            "Time for which a channel that a frame omits keeps its last reading.",
            Unit.same("s"),
            limits=Within(0.0),
        ),
        "rim_sd": Key(
            "Rim movement",
            "Standard deviation expected of the movement of an elastic rim.",
            Unit("m", "mm", 1e-3),
            limits=Within(0.0),
        ),
        "edge": Key(
            "Boundary condition",
            "The boundary condition that the fit assumes. Another one shows the error that a "
            "wrong assumption causes.",
            choices=(("", "From sensor"), *((edge, edge.capitalize()) for edge in EDGES)),
        ),
        "method": Key(
            "Estimator",
            "Method that computes the shape from the readings. All report error bars; "
            "Cost of accuracy (F9) compares their errors and computing times.",
            choices=(
                *_METHODS.items(),
                *((name, name.capitalize()) for name in METHODS if name not in _METHODS),
            ),
        ),
        "calibration": Key("Calibration", "File of the calibration of the readings.", kind=str),
        "tare": Key("Tare", "File of the tare, the zero of the readings.", kind=str),
    },
    (Setup,),
)
"""The keys of a setup in text, where a calibration and a tare are the names of their files.

What is computed again of a recording does not depend on what was computed at the time.
"""

_LONGEST = 2**16  # characters of a setup


def setup_to_text(setup: Setup) -> tuple[str, dict[str, bytes]]:
    """The text, and by name the files that it names."""
    keys, files = {name: getattr(setup, name) for name in SETUP.keys}, dict[str, bytes]()
    for name, to_toml in (("calibration", Calibration.to_toml), ("tare", TareStore.to_toml)):
        if (made := keys.pop(name)) is not None:
            keys[name] = f"{name}-{made.digest[:16]}.toml"
            files[keys[name]] = to_toml(made).encode()
    return json.dumps(keys), files


def usual_setup(sensor: Sensor) -> Setup:
    """The default setup; of a real `sensor` with the tare that is saved and in use."""
    if sensor.simulated:
        return Setup()
    return Setup(tare=TareStore(TareStore.user_folder()).load(sensor.serial_number).fit_for(sensor))


def setup_from_text(text: str, file: Callable[[str], bytes]) -> Setup:
    """The setup in `text`; `file` returns the content of a named file.

    A `Refusal` when it is none.
    """
    try:
        if len(text) > _LONGEST:
            raise Refusal(f"expected at most {_LONGEST} characters, got {len(text)}")
        table = json_table(text)
        calibration, tare = (SETUP.value(table, name) for name in ("calibration", "tare"))
        given = {"calibration": None, "tare": None, "quantities": QUANTITIES}
        setup = SETUP.make(table, Setup, complete=True, **given)
        table.done()
    except Refusal as refusal:
        raise Refusal(f"expected a setup as it was recorded: {refusal}") from refusal
    return replace(
        setup,
        calibration=Calibration.from_toml(file(calibration), Path(calibration))
        if calibration
        else None,
        tare=TareStore.from_toml(file(tare), tare) if tare else None,
    )
