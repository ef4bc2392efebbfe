"""The schema of a scene file: every key with its kind, default, limits, unit and label.

`PARTS` declares each table of a file once. Reading and writing, the app's forms and the tables of
the guide come from it.
"""

import math
from typing import Any

from kappaskin._schema import Key, Part, PartKind, Unit, Within, fields_of
from kappaskin._toml import REQUIRED
from kappaskin.bases import EDGES
from kappaskin.frames import COMPONENTS
from kappaskin.mechanics import (
    INPLANE,
    Block,
    Cylinder,
    DiscLoad,
    GaussianLoad,
    HeightMap,
    LineLoad,
    Mesh,
    Plate,
    PointLoad,
    Punch,
    RectangleLoad,
    Sphere,
    Wedge,
)
from kappaskin.scenes.cylinders import RADII
from kappaskin.scenes.effects import EFFECTS, Effect
from kappaskin.scenes.scene import EffectSelection, Scene
from kappaskin.scenes.stimulus import (
    EASES,
    HoldStep,
    Orbit,
    PressStep,
    ReleaseStep,
    SlideStep,
    TapStep,
    TurnStep,
)
from kappaskin.sensing import (
    Amplifier,
    Converter,
    DigitalReadings,
    HalfBridge,
    Multiplexer,
    SensorLayout,
)
from kappaskin.skin import UNITS, Cap, Disk, MeshSkin, Patch, Polygon

_SECOND = Unit.same("s")
_MM, _UM = Unit("m", "mm", 1e-3), Unit("m", "\N{MICRO SIGN}m", 1e-6)
_US, _DEGREE = Unit("s", "\N{MICRO SIGN}s", 1e-6), Unit("rad", "\N{DEGREE SIGN}", math.pi / 180)
_NEWTON, _VOLT = Unit.same("N"), Unit.same("V")
_OHM = Unit.same("ohm", "\N{GREEK CAPITAL LETTER OMEGA}")


def _choices(**words: str) -> tuple[tuple[str, str], ...]:
    return tuple(words.items())


FORMAT = 1

SCENE = Part(
    "Scene",
    {
        "format": Key("Format", "The format of the file: 1.", kind=int, offered=False),
        "title": Key(
            "Title",
            "The name in lists of scenes; the name of the file when left out.",
            example="A scene",
        ),
        "text": Key("Text", "Description of the scene.", offered=False),
        "rate": Key(
            "Frame rate",
            "Frames per second that the sensor sends.",
            Unit.same("frames/s"),
            limits=Within(1e-3, 1e6, "frames/s"),
        ),
        "seed": Key(
            "Seed",
            "Start of the random numbers; the same seed gives the same noise.",
            limits=Within(0, 2**64, whole=True),
        ),
        "accuracy": Key(
            "Accuracy",
            "Effects that change readings by less are omitted; as a share of the peak reading.",
            least=0.0,
            most=1.0,
        ),
        "reference": Key(
            "Functions",
            "Basis functions of the true shape along x and y. A strip has one along y.",
            least=1,
        ),
    },
    (Scene, EffectSelection),
)

SKIN = Part(
    "Skin",
    {
        "shape": Key(
            "Shape",
            "The outline. A strip is held at its ends along x; its shape is constant along y.",
            kind=str,
            default="rectangle",
        ),
        "size": Key(
            "Size", "Lengths of the skin along x and y.", _MM, 0.0, kind=tuple[float, float]
        ),
        "rim_radius": Key("Radius", "Radius of the disk.", _MM, 0.0, kind=float),
        "outline": Key(
            "Corners",
            "x, y of each corner, in order.",
            _MM,
            kind=tuple[tuple[float, float], ...],
        ),
        "radius": Key(
            "Bent to radius",
            "Radius of the arc along x that the skin is at rest, or the two along x and y of a "
            "shallow skin: a dome, a saddle where their signs differ, a trough where one is inf.",
            _MM,
            example=0.05,
        ),
        "file": Key(
            "File",
            "STL, OBJ or PLY file of a skin of any shape, as triangles, in the folder of the file.",
            kind=str,
        ),
        "unit": Key(
            "Unit",
            "Unit of length of the mesh's file.",
            kind=str,
            choices=tuple((unit, unit) for unit in UNITS),
        ),
        "held": Key(
            "Held",
            "Of a mesh: which parts of its rim are held, two points for each: from the node "
            "nearest to the first, in the unit of its file, along the rim to that nearest to the "
            "second, counter-clockwise seen from outside. All of it if omitted.",
            kind=tuple[tuple[float, float, float], ...],
            default=None,
            example=[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]],
        ),
        "mesh": Key(
            "Mesh",
            "A mesh itself, as kappaskin writes it into a scene or a recording.",
            kind=str,
            default=None,
            offered=False,
        ),
        "angle": Key(
            "Angle",
            "Of a cap: angle from the pole to the rim, where its normal is turned by so much. A "
            "hemisphere has 90\N{DEGREE SIGN}.",
            _DEGREE,
            0.0,
            math.pi / 2,
            kind=float,
            default=math.pi / 2,
        ),
        "stretch": Key(
            "Stretch",
            "Of a cap: how many times longer than its radius its axis is; 1 is a sphere.",
            least=0.2,
            most=5.0,
            kind=float,
            default=1.0,
            example=1.2,
        ),
        "edge": Key(
            "Edge",
            "Boundary condition along the rim. Hinged: the skin rotates freely; sliding: the ends "
            "of a bent skin slide; clamped: no rotation; elastic: the rim rests on springs; "
            "cantilever: a flat strip, clamped at x = 0 and free at its other end.",
            choices=tuple((edge, edge.capitalize()) for edge in EDGES),
        ),
        "rigidity": Key(
            "Rigidity",
            "Bending stiffness of the skin.",
            Unit.same("N m"),
            limits=Within(1e-12, 1e6, "N m", or_zero=True),
        ),
        "unknown_material": Key(
            "Material unknown",
            "The sensor does not state what the skin is made of: contacts are found by its shape, "
            "without a force. The rigidity is that of the simulation.",
            example=True,
        ),
        "tension": Key(
            "Tension",
            "Tension of the skin, as of a drum head; 7 N/m double the stiffness of Table 1's "
            "patch.",
            Unit.same("N/m"),
            limits=Within(1e-9, 1e6, "N/m", or_zero=True),
            example=10.0,
        ),
        "foundation": Key(
            "Foam",
            "Foam below the skin: its pressure per displacement; 14 kN/m^3 double the stiffness of "
            "Table 1's patch.",
            Unit("N/m^3", "kN/m\N{SUPERSCRIPT THREE}", 1e3),
            limits=Within(1e-9, 1e12, "N/m^3", or_zero=True),
            example=1e4,
        ),
        "fluid": Key(
            "Fluid below",
            "A fluid of constant volume: pressed in at one point, the skin bulges elsewhere.",
            example=True,
        ),
        "poisson": Key("Poisson's ratio", "Matters for elastic edges and bent skins."),
        "rim_stiffness": Key(
            "Rim stiffness",
            "Stiffness of the springs below an elastic rim.",
            Unit.same("N/m^2", "N/m\N{SUPERSCRIPT TWO}"),
            limits=Within(1e-9, 1e12, "N/m^2", or_zero=True),
        ),
        "axial_stiffness": Key(
            "Axial stiffness",
            "Young's modulus times thickness, by which a bent skin without a thickness has one.",
            Unit.same("N/m"),
            limits=Within(1e-9, 1e12, "N/m", or_zero=True),
            example=1e4,
        ),
        "thickness": Key(
            "Thickness",
            "Thickness of a uniform sheet, by which it resists stretching. A flat skin without one "
            "does not stretch; a bent one is 0.25 mm thick, or as its axial stiffness has it.",
            _UM,
            limits=Within(1e-7, 0.1, "m"),
            example=2.5e-4,
        ),
        "inplane": Key(
            "Held in its plane",
            "Boundary condition in the plane of the skin. Held: no displacement; diaphragm: no "
            "force across the edge, no displacement along it; free: neither force nor shear; hoop, "
            "of a bent skin: the hoop displacement is held, the axial one free. Of a bent skin it "
            "is that of the straight edges. Held unless given, hoop for a bent skin, diaphragm for "
            "one of two radii. A cap is held, or below a hemisphere a diaphragm.",
            choices=tuple((one, one.capitalize()) for one in INPLANE),
            example="held",
        ),
    },
    (Plate, Scene, Patch),
    {
        "rectangle": PartKind("Rectangle", Patch, {"size": [0.1, 0.1]}, ("radius", "thickness")),
        "strip": PartKind("Strip", Patch, {"size": [0.1, 0.02]}, ("radius", "thickness")),
        "disk": PartKind("Disk", Disk, {"rim_radius": 0.05}, ("thickness",)),
        "cap": PartKind(
            "Cap",
            Cap,
            {"radius": 0.008},
            ("angle", "stretch", "thickness"),
            {"radius": Key("Radius", "Radius of the cap, of its equator.", _MM, 0.0, kind=float)},
        ),
        "mesh": PartKind(
            "Mesh",
            MeshSkin,
            {"file": "skin.stl", "unit": "mm", "thickness": 1e-3},
            ("held", "mesh"),
            never=("axial_stiffness", "fluid", "tension"),
        ),
        "polygon": PartKind(
            "Polygon",
            Polygon,
            {"outline": [[0.0, 0.0], [0.1, 0.0], [0.1, 0.06], [0.05, 0.1], [0.0, 0.06]]},
            ("thickness",),
        ),
    },
    "shape",
    (("file", "mesh"), ("unit", "mesh"), ("held", "mesh")),
)

ELEMENTS = Part(
    "Elements",
    {
        "grid": Key(
            "Grid",
            "How many elements along x and along y.",
            least=1,
            kind=tuple[int, int],
            default=(10, 10),
            example=[10, 10],
        ),
        "positions": Key(
            "Positions",
            "x, y of each element.",
            _MM,
            kind=tuple[tuple[float, float], ...],
            example=[[0.03, 0.03], [0.07, 0.03], [0.03, 0.07], [0.07, 0.07]],
        ),
        "rings": Key(
            "Rings",
            "Of a disk or cap: number of elements on each ring from the middle outwards. The rings "
            "are evenly far apart; a first ring of 1 is in the middle.",
            least=1,
            kind=tuple[int, ...],
            example=[1, 6, 12, 18],
            offered=False,
        ),
        "spiral": Key(
            "Spiral",
            "Of a disk or cap: number of elements on a Fibonacci spiral, one to each equal area.",
            least=1,
            kind=int,
            example=60,
            offered=False,
        ),
        "spread": Key(
            "Spread",
            "Of a mesh: number of elements that are spread evenly over it.",
            least=1,
            kind=int,
            example=120,
            offered=False,
        ),
        "file": Key(
            "File",
            "Of a mesh: CSV file with the columns x, y and z of each element, in the coordinates "
            "and the unit of the mesh's file; elements are moved onto the mesh. Further columns "
            "dx, dy and dz: the direction of each element's axis.",
            kind=str,
            example="elements.csv",
            offered=False,
        ),
        "along": Key(
            "Along",
            "Of a mesh: the axis of each element is along the skin's x, or along its largest "
            "principal curvature: then an element reads curvature@0, curvature@90 and "
            "curvature@45 from there.",
            kind=str,
            default="x",
            choices=_choices(x="x", principal="Principal curvature"),
            offered=False,
        ),
        "turns": Key(
            "Turns",
            "Of a mesh: by how much the axis of each element is turned from the skin's x.",
            Unit.same("rad"),
            kind=tuple[float, ...],
            default=None,
            example=[0.1],
            offered=False,
        ),
        "dead": Key(
            "Dead",
            "Numbers of the elements without readings, from 0.",
            kind=tuple[int, ...],
            default=(),
            example=[0],
        ),
        "gage_length": Key(
            "Gage length",
            "A gage measures the mean curvature along this length.",
            _MM,
            0.0,
            example=0.001,
        ),
        "cell": Key(
            "Cell",
            "Sides of a rectangle over which an element averages heights and slopes.",
            _MM,
            0.0,
            example=[0.001, 0.001],
        ),
        "reads": Key(
            "Reads",
            "What every element reads: `height`, `slope@DEGREES` and `curvature@DEGREES` along a "
            "direction from x, `twist`, and `xx`, `yy`, `xy` for the curvature along x, along y "
            "and the twist. Noise and offsets are in the unit of what is read: m, m/m, 1/m.",
            kind=tuple[str, ...],
            default=COMPONENTS,
            example=["height"],
        ),
    },
    (SensorLayout,),
    either=(("grid", "positions", "rings", "spiral", "spread", "file"), ("along", "turns")),
)

READINGS = Part(
    "Readings",
    {
        "resolution": Key(
            "Resolution",
            "Step of a reading that is no curvature, in its unit: such readings come as numbers.",
            limits=Within(1e-12, 1e3),
        ),
        "noise": Key(
            "Noise",
            "Standard deviation of the readings in their unit; in `[readings.height]`, "
            "`[readings.slope]` and so on that of one quantity. Readings of several units need it: "
            "it weighs them.",
            kind=float,
            default=0.0,
            limits=Within(0.0, 1e4),
            example=1e-6,
        ),
    },
    (DigitalReadings,),
)

ELECTRONICS = Part(
    "Electronics",
    {
        "like": Key(
            "Electronics",
            "The electronics whose values apply unless given below.",
            kind=str,
            default="modern",
            choices=_choices(modern="Modern", second="Second prototype", first="First prototype"),
        )
    },
)

BRIDGE = Part(
    "Half-bridge",
    {
        "gage_factor": Key("Gage factor", "Change of a gage's resistance over its strain."),
        "substrate_thickness": Key("Substrate", "Thickness between the gages.", _UM, 0.0),
        "gage_thickness": Key("Gage thickness", "Thickness of a gage.", _UM, 0.0),
        "excitation": Key("Excitation", "Voltage across a half-bridge.", _VOLT, 0.0),
        "gage_resistance": Key("Gage", "Resistance of an unstrained gage.", _OHM, 0.0),
        "gage_mismatch": Key(
            "Mismatch",
            "Relative difference of the lower gage of a pair to the upper one.",
            least=-1.0,
            most=1.0,
            example=0.0001,
        ),
        "dummy_resistance": Key("Dummy", "Resistance of the dummy's lower arm.", _OHM, 0.0),
        "balance_voltage": Key(
            "Balance", "Voltage of the middle of the dummy.", _VOLT, 0.0, example=2.5
        ),
    },
    (HalfBridge,),
)

MULTIPLEXER = Part(
    "Multiplexer",
    {
        "settling_time": Key("Settling", "Wait before each conversion.", _US, 0.0, example=1e-6),
        "supply_resistance": Key(
            "Supply", "Resistance between the excitation and a half-bridge.", _OHM, 0.0
        ),
    },
    (Multiplexer,),
)

AMPLIFIER = Part(
    "Amplifier",
    {
        "gain": Key("Gain", "Output over input of the amplifier.", least=0.0),
        "rail": Key("Rail", "The output stays between minus and plus this.", _VOLT, 0.0),
    },
    (Amplifier,),
)

CONVERTER = Part(
    "Converter",
    {
        "bits": Key(
            "Resolution",
            "Bits of a reading; each halves its step.",
            Unit.same("bits"),
            8,
            24,
            comment="",
        ),
        "full_scale": Key("Full scale", "Input range, from minus to plus this.", _VOLT, 0.0),
        "offset": Key("Offset", "Reading at zero input.", _VOLT),
        "conversion_time": Key(
            "Conversion",
            "Conversion time of one channel; it limits the frame rate.",
            _US,
            0.0,
        ),
    },
    (Converter,),
)


def _length(label: str, tip: str, least: float = 0.0, **more: Any) -> Key:
    """A length of a touch, of which most are such: no comment behind it says so again."""
    return Key(label, tip, _MM, least, kind=float, comment="", **more)


_FORCE, _IN_THE_MIDDLE = {"force": 0.1}, {"x": 0.05, "y": 0.05}
_HARDER = {"force": 0.2}
_ALONG_X = {"width": _length("Width", "Along x.")}

LOADS = {
    "point": PartKind("Point load", PointLoad, _IN_THE_MIDDLE | _FORCE, ("displacement",)),
    "line": PartKind(
        "Line load",
        LineLoad,
        {"x0": 0.03, "y0": 0.05, "x1": 0.07, "y1": 0.05} | _FORCE,
        ("displacement",),
    ),
    "disc": PartKind(
        "Disc load", DiscLoad, _IN_THE_MIDDLE | {"radius": 0.005} | _FORCE, ("displacement",)
    ),
    "rectangle": PartKind(
        "Rectangle load",
        RectangleLoad,
        _IN_THE_MIDDLE | {"width": 0.01, "height": 0.006} | _FORCE,
        ("displacement",),
        _ALONG_X,
    ),
    "gaussian": PartKind(
        "Gaussian load", GaussianLoad, _IN_THE_MIDDLE | {"sd": 0.003} | _FORCE, ("displacement",)
    ),
}
OBJECTS = {
    "sphere": PartKind("Ball", Sphere, _IN_THE_MIDDLE | {"radius": 0.02} | _HARDER, ("depth",)),
    "cylinder": PartKind(
        "Cylinder",
        Cylinder,
        _IN_THE_MIDDLE | {"radius": 0.01, "length": 0.05} | _HARDER,
        ("depth", "turn"),
    ),
    "wedge": PartKind(
        "Edge",
        Wedge,
        _IN_THE_MIDDLE | {"angle": 1.5707963, "length": 0.04, "width": 0.02} | _HARDER,
        ("depth", "turn", "tip_radius"),
    ),
    "punch": PartKind(
        "Flat punch", Punch, _IN_THE_MIDDLE | {"radius": 0.005} | _HARDER, ("depth",)
    ),
    "block": PartKind(
        "Block",
        Block,
        _IN_THE_MIDDLE | {"length": 0.03, "width": 0.02} | _HARDER,
        ("depth", "turn"),
    ),
    "heights": PartKind(
        "Relief from a file",
        HeightMap,
        {"file": "heights.npy"}
        | _IN_THE_MIDDLE
        | {"length": 0.03, "width": 0.03, "relief": 0.002}
        | _HARDER,
        ("depth", "turn"),
    ),
    "mesh": PartKind(
        "Mesh from a file",
        Mesh,
        {"file": "mesh.stl"} | _IN_THE_MIDDLE | _HARDER,
        ("depth", "turn", "unit"),
    ),
}

TOUCH = Part(
    "Touch",
    {
        "what": Key(
            "Kind",
            "Kind of load or object. For a load the pressure is given; for a rigid object it is "
            "computed.",
            kind=str,
            offered=False,
        ),
        "x": _length("x", "From the corner x = y = 0, along the skin.", -math.inf),
        "y": _length("y", "From the corner x = y = 0, across the skin.", -math.inf),
        "x0": _length("x of one end", "From the corner x = y = 0.", -math.inf),
        "y0": _length("y of one end", "From the corner x = y = 0.", -math.inf),
        "x1": _length("x of the other end", "From the corner x = y = 0.", -math.inf),
        "y1": _length("y of the other end", "From the corner x = y = 0.", -math.inf),
        "force": Key(
            "Force",
            "Largest force.",
            _NEWTON,
            kind=float,
            limits=Within(-1e6, 1e6, "N"),
        ),
        "displacement": _length(
            "Displacement",
            "Displacement of the skin below the load, instead of a force.",
            -math.inf,
            example=0.002,
        ),
        "depth": Key(
            *("Depth", "Depth of indentation, instead of a force.", _MM, 0.0),
            kind=float,
            example=0.002,
        ),
        "radius": _length("Radius", "Radius of the load or object."),
        "sd": _length("Standard deviation", "Of the force about its centre."),
        "length": _length("Length", "Along x, before rotation."),
        "width": _length("Width", "Along y, before rotation."),
        "height": _length("Height", "Along y."),
        "angle": Key("Angle", "Angle between the flanks of the edge.", _DEGREE, 0.0, math.pi),
        "tip_radius": _length("Tip radius", "Radius of the rounded edge.", example=0.001),
        "turn": Key(
            "Rotation",
            "About the skin's normal, from x to y.",
            _DEGREE,
            kind=float,
            default=0.0,
            example=0.7853982,
        ),
        "relief": _length("Relief", "Height from the lowest to the highest point."),
        "file": Key("File", "Name of the file, in the folder of the scene.", kind=str),
        "unit": Key(
            "Unit of length",
            "Length of one unit of the file in metres.",
            least=0.0,
            kind=float,
            default=1.0,
            example=1e-3,
        ),
        "orbit": Key(
            "Motion in a circle",
            "Moves on a circle around the position under constant load.",
            example={"radius": 0.01, "period": 4.0},
        ),
        "path": Key(
            "Motion in steps",
            "Presses, holds, slides and so on, repeatedly.",
            example=[
                {"step": "press", "seconds": 0.5},
                {"step": "hold", "seconds": 1.0},
                {"step": "release", "seconds": 0.5},
            ],
        ),
        "recorded": Key(
            "Recorded motion",
            "A CSV with time, dx, dy and amount, in the folder of the scene.",
            kind=str,
            example="motion.csv",
        ),
    },
    kinds=LOADS | OBJECTS,
    chosen_by="what",
    either=(("force", "displacement"), ("force", "depth"), ("orbit", "path", "recorded")),
)

ORBIT = Part(
    "Motion in a circle",
    {
        "radius": Key("Radius", "Radius of the circle.", _MM, 0.0, example=0.01),
        "period": Key("Period", "Time of one revolution.", _SECOND, 0.0, example=4.0),
    },
    (Orbit,),
)

STEP = Part(
    "Step",
    {
        "step": Key(
            "Step",
            "Press until the force or depth is reached; hold; release; slide or roll under "
            "constant load; turn about the skin's normal; tap, and lift at the end.",
            kind=str,
            offered=False,
        ),
        "seconds": Key("Duration", "Duration of the step.", _SECOND, 0.0),
        "by": Key("Distance", "Distance along x and y.", _MM),
        "to": Key(
            "Final share",
            "Final share of the force or depth.",
            Unit("", "of full"),
            0.0,
        ),
        "times": Key("Taps", "Number of taps.", Unit("", "times"), 1, 1000),
        "ease": Key(
            "Ease",
            "Smooth: the motion starts and ends at rest, without a step in acceleration.",
            kind=str,
            default=next(iter(EASES)),
            example="linear",
            choices=_choices(smooth="Smooth", linear="Steady"),
        ),
    },
    kinds={
        "press": PartKind("Press", PressStep, {"seconds": 0.5}, ("to",)),
        "hold": PartKind("Hold", HoldStep, {"seconds": 1.0}),
        "release": PartKind("Release", ReleaseStep, {"seconds": 0.5}),
        "slide": PartKind("Slide", SlideStep, {"by": [0.01, 0.0], "seconds": 1.0}),
        "roll": PartKind("Roll", SlideStep, {"by": [0.01, 0.0], "seconds": 1.0}),
        "turn": PartKind(
            "Turn",
            TurnStep,
            {"by": 1.5707963, "seconds": 1.0},
            keys={"by": Key("Angle", "About the skin's normal, from x to y.", _DEGREE)},
        ),
        "tap": PartKind("Tap", TapStep, {"times": 3, "seconds": 1.0}),
    },
    chosen_by="step",
)

CYLINDERS = Part(
    "Cylinders",
    {
        "dwell": Key(
            "Dwell time",
            "Time on each cylinder.",
            _SECOND,
            kind=float,
            default=1.0,
            limits=Within(1e-3, 1e6, "s"),
            comment="s on each",
        ),
        "radii": Key(
            "Radii",
            "Radii of the cylinders; eight from 100 to 13 mm when left out.",
            _MM,
            kind=tuple[float, ...],
            default=(),
            example=list(RADII),
            limits=Within(1e-4, 1e3, "m"),
        ),
        "hold": Key(
            "Initial hold",
            "Time on the smallest cylinder at the start, to measure creep.",
            _SECOND,
            kind=float,
            default=0.0,
            example=10.0,
            limits=Within(0, 1e6, "s"),
        ),
    },
)


_EFFECT_KEYS: dict[str, dict[str, Key]] = {
    "strain-limit": {"share": Key("Share", "Share of the excess strain that remains.")},
    "hysteresis": {
        "like": Key(
            "Prototype",
            "The prototype that has this hysteresis.",
            kind=str,
            choices=_choices(second="Second prototype", first="First prototype"),
        ),
        "thresholds": Key("Thresholds", "Thresholds of the play operators.", Unit.same("1/m")),
        "weights": Key("Weights", "Weights of the play operators."),
    },
    "creep": {"share": Key("Share", "Share of a reading that relaxes.")},
    "intermittent": {
        "on": Key("Time on", "Mean duration with readings."),
        "off": Key("Time off", "Mean duration without readings."),
    },
    "cross-talk": {"share": Key("Share", "Share of the previous channel in a reading.")},
}
"""Keys whose meaning differs between effects."""


def _kind_of(effect: type[Effect]) -> PartKind:
    """The kind of table of an effect; keys with a default are optional."""
    may = (name for name, (_, default, _) in fields_of(effect).items() if default is not REQUIRED)
    keys = _EFFECT_KEYS.get(effect.name, {})
    return PartKind(effect.called(), effect, effect.example, tuple(may), keys)


def _named(label: str, tip: str) -> Key:
    """A list of effects by name."""
    return Key(label, tip, kind=tuple[str, ...], default=(), offered=False)


EFFECT = Part(
    "Effects",
    {
        "choose": Key(
            "Selection",
            "Which effects are simulated: auto, all, linear or a list.",
            kind=str | tuple[str, ...],
            default="auto",
            offered=False,
        ),
        "on": _named("On", "Effects that are simulated in any case."),
        "off": _named("Off", "Effects that are omitted in any case."),
        "time_constant": Key("Time constant", "Time to 63 % of the change.", _SECOND),
        "elements": Key("Elements", "Numbers of the elements, from 0."),
        "rms": Key("RMS", "Root mean square of the noise."),
        "share": Key("Share", "Share of all frames."),
        "rise": Key("Rise", "Rise of the skin's temperature."),
        "offset": Key("Offset", "Error of a reading for each kelvin."),
        "gradient_x": Key("Gradient in x", "Share by which each metre along x warms more."),
        "gradient_y": Key("Gradient in y", "Share by which each metre along y warms more."),
        "spread": Key(
            "Offset spread",
            "Standard deviation of the offsets, as a share of their mean.",
            example=0.3,
        ),
        "gain": Key("Gain", "Change of the gage factor for each kelvin.", example=1e-4),
        "seed": Key("Seed", "Start of the skin's random numbers; another seed gives another skin."),
        "gain_sd": Key("Gain spread", "Standard deviation of the gains about 1."),
        "offset_sd": Key("Offset spread", "Standard deviation of the offsets about 0."),
        "amplitude": Key("Amplitude", "Amplitude of the hum."),
        "frequency": Key("Frequency", "Frequency of the mains."),
        "asymmetry": Key(
            "Asymmetry", "Ratio of the loop widths at positive and negative curvature."
        ),
        "low": Key("Lowest frequency", "Lower limit of the noise band."),
        "high": Key("Highest frequency", "Upper limit of the noise band."),
        "since": Key("Failure time", "Time of the failure.", example=1.0),
    },
    kinds={effect.name: _kind_of(effect) for effect in EFFECTS.values() if effect.example},
)

PARTS = {
    "scene": SCENE,
    "skin": SKIN,
    "elements": ELEMENTS,
    "readings": READINGS,
    "electronics": ELECTRONICS,
    "bridge": BRIDGE,
    "multiplexer": MULTIPLEXER,
    "amplifier": AMPLIFIER,
    "converter": CONVERTER,
    "touch": TOUCH,
    "orbit": ORBIT,
    "step": STEP,
    "cylinders": CYLINDERS,
    "effects": EFFECT,
}
"""Every table of a scene file: the four after the electronics are parts of those, an orbit and the
steps of a path those of a touch."""
