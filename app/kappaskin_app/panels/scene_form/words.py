"""How each key of a scene is asked for: a label, a tip, the unit it is shown in and its range."""

import math
from dataclasses import dataclass, replace

from kappaskin.bases import EDGES
from kappaskin.scenes.effects import EFFECTS, parameters
from kappaskin_app.effects import explained

MM, UM, DEGREE = ("mm", 1e-3), ("\N{MICRO SIGN}m", 1e-6), ("\N{DEGREE SIGN}", math.pi / 180)
US = ("\N{MICRO SIGN}s", 1e-6)
_SECONDS, _NEWTON, _OHM, _VOLT = (
    ("s", 1.0),
    ("N", 1.0),
    ("\N{GREEK CAPITAL LETTER OMEGA}", 1.0),
    ("V", 1.0),
)
_NONE = ("", 1.0)


@dataclass(frozen=True)
class How:
    """Shown is the value over `scale`, in `unit`; the range is that of the value itself."""

    label: str
    tip: str = ""
    unit: str = ""
    scale: float = 1.0
    least: float = -math.inf
    most: float = math.inf
    listed: bool = False
    choices: tuple[tuple[str, str], ...] = ()

    @property
    def explained(self) -> str:
        """The tip with the unit and the range."""
        low, high = (f"{bound / self.scale:g}" for bound in (self.least, self.most))
        unit = "" if self.unit == DEGREE[0] else " " * bool(self.unit)
        unit += self.unit
        if math.isfinite(self.least) and math.isfinite(self.most):
            return f"{self.tip} From {low} to {high}{unit}."
        if math.isfinite(self.least):
            return f"{self.tip} At least {low}{unit}."
        return f"{self.tip} In {self.unit}." if unit.strip() else self.tip


def _how(
    label: str,
    tip: str,
    unit: tuple[str, float] = _NONE,
    least: float = -math.inf,
    most: float = math.inf,
) -> How:
    return How(label, tip, *unit, least, most)


def _list(label: str, tip: str, unit: tuple[str, float] = _NONE) -> How:
    return How(label, tip, *unit, listed=True)


def _choice(label: str, tip: str, **choices: str) -> How:
    return How(label, tip, choices=tuple(choices.items()))


_HOW = {
    "scene.title": _how("Title", "What lists of scenes call it."),
    "scene.rate": _how("Frame rate", "How many frames the sensor sends.", ("frames/s", 1.0), 0.0),
    "scene.seed": _how(
        "Seed", "Another number draws other noise; the same one draws the same again.", _NONE, 0
    ),
    "scene.accuracy": _how(
        "Accuracy",
        "Effects that change readings by less are left out: a share of the peak curvature.",
        *(_NONE, 0.0, 1.0),
    ),
    "scene.reference": _how(
        "Functions", "Along x and along y: of what the true shape is made.", _NONE, 1
    ),
    "skin.shape": _choice(
        "Shape",
        "The outline. A strip is held at its two ends along x and alike all along y.",
        rectangle="Rectangle",
        strip="Strip",
        disk="Disk",
        polygon="Polygon",
    ),
    "size": _how("Size", "Lengths of the skin along x and y.", MM, 0.0),
    "rim_radius": _how("Radius", "Radius of the disk.", MM, 0.0),
    "outline": _list("Corners", "x, y of one corner after the other, with ; in between.", MM),
    "skin.radius": _how("Bent to radius", "The skin at rest is an arc along x.", MM, 0.0),
    "edge": How(
        "Edge",
        "How the skin is held along its rim. Hinged: it turns freely there; sliding: the ends of "
        "a bent one slide; clamped: it cannot turn; elastic: the rim gives.",
        choices=tuple((edge, edge.capitalize()) for edge in EDGES),
    ),
    "rigidity": _how("Rigidity", "How stiff the skin is against bending.", ("N m", 1.0), 0.0),
    "tension": _how(
        "Tension", "How strongly it is stretched, like a drum head.", ("N/m", 1.0), 0.0
    ),
    "foundation": _how(
        "Foam", "Foam below: its pressure per displacement.", ("N/m\u00b3", 1.0), 0.0
    ),
    "fluid": _how("Fluid below", "It keeps its volume: pressed in here, the skin bulges there."),
    "poisson": _how("Poisson's ratio", "Matters where an edge gives or the skin is bent."),
    "rim_stiffness": _how(
        "Rim stiffness", "Of the springs below an elastic rim.", ("N/m\u00b2", 1.0), 0.0
    ),
    "axial_stiffness": _how(
        "Axial stiffness", "Of a bent skin that stretches along its axis.", ("N/m", 1.0), 0.0
    ),
    "grid": _how("Grid", "How many elements along x and along y.", _NONE, 1),
    "positions": _list("Places", "x, y of one element after the other, with ; in between.", MM),
    "dead": _list("Dead", "Numbers of the elements that never read anything, from 0."),
    "gage_length": _how("Gage length", "A gage reads the mean along so much.", MM, 0.0),
    "electronics.like": _choice(
        "Built like",
        "The electronics that all the rest differs from.",
        modern="Modern",
        second="Second prototype",
        first="First prototype",
    ),
    "bridge": How("Half-bridge"),
    "gage_factor": _how("Gage factor", "Change of a gage's resistance over its strain."),
    "substrate_thickness": _how("Substrate", "Thickness between the gages.", UM, 0.0),
    "gage_thickness": _how("Gage thickness", "Thickness of a gage.", UM, 0.0),
    "excitation": _how("Excitation", "Voltage across a half-bridge.", _VOLT, 0.0),
    "gage_resistance": _how("Gage", "Resistance of a gage that is not bent.", _OHM, 0.0),
    "gage_mismatch": _how(
        "Mismatch", "By what share the lower gage of a pair exceeds the upper one.", _NONE, -1, 1
    ),
    "dummy_resistance": _how("Dummy", "Lower arm of the dummy half-bridge.", _OHM, 0.0),
    "balance_voltage": _how("Balance", "Where the middle of the dummy stands.", _VOLT, 0.0),
    "settling_time": _how("Settling", "Wait before each conversion.", US, 0.0),
    "supply_resistance": _how(
        "Supply", "Resistance between the excitation and a half-bridge.", _OHM, 0.0
    ),
    "amplifier.gain": _how("Gain", "Output over input of the amplifier.", _NONE, 0.0),
    "rail": _how("Rail", "The output stays between minus and plus this.", _VOLT, 0.0),
    "bits": _how("Resolution", "Bits of a reading.", ("bits", 1.0), 8, 24),
    "full_scale": _how("Full scale", "Reads between minus and plus this.", _VOLT, 0.0),
    "converter.offset": _how("Offset", "What it reads of no voltage.", _VOLT),
    "conversion_time": _how("Conversion", "Time that it takes for one channel.", US, 0.0),
    "what": _choice(
        "What",
        "What presses: a load is given, of a rigid object the skin finds how it lies against it.",
        point="Point load",
        line="Line load",
        disc="Disc load",
        rectangle="Rectangle load",
        gaussian="Soft round load",
        sphere="Ball",
        cylinder="Cylinder",
        wedge="Edge",
        punch="Flat punch",
        block="Block",
        heights="Relief from a file",
        mesh="Mesh from a file",
    ),
    "x": _how("x", "From the corner x = y = 0, along the skin.", MM),
    "y": _how("y", "From the corner x = y = 0, across the skin.", MM),
    "x0": _how("x of one end", "From the corner x = y = 0.", MM),
    "y0": _how("y of one end", "From the corner x = y = 0.", MM),
    "x1": _how("x of the other", "From the corner x = y = 0.", MM),
    "y1": _how("y of the other", "From the corner x = y = 0.", MM),
    "force": _how("Force", "How hard it presses at most.", _NEWTON),
    "displacement": _how("Displacement", "As hard as moves the skin below it so far.", MM),
    "depth": _how("Depth", "How deep it is pressed in, however hard that is.", MM, 0.0),
    "radius": _how("Radius", "Radius of what presses.", MM, 0.0),
    "sd": _how("Spread", "Standard deviation of the force about its centre.", MM, 0.0),
    "length": _how("Length", "Along x, before it is turned.", MM, 0.0),
    "width": _how("Width", "Along y, before it is turned.", MM, 0.0),
    "rectangle.width": _how("Width", "Along x.", MM, 0.0),
    "height": _how("Height", "Along y.", MM, 0.0),
    "angle": _how("Angle", "Between the flanks of the edge.", DEGREE, 0.0, math.pi),
    "tip_radius": _how("Tip radius", "To which the edge is rounded.", MM, 0.0),
    "turn": _how("Turned by", "About the skin's normal, from x to y.", DEGREE),
    "relief": _how("Relief", "From its lowest to its highest place.", MM, 0.0),
    "file": _how("File", "Its name, in the folder of the scene."),
    "unit": _how("Unit of length", "How many metres one unit of the file is.", _NONE, 0.0),
    "orbit": _how("Motion in a circle", "It goes round its place, pressing all the time."),
    "path": _how("Motion in steps", "It presses, holds, slides and so on, again and again."),
    "recorded": _how(
        "Recorded motion", "A CSV with time, dx, dy and amount, in the folder of the scene."
    ),
    "orbit.radius": _how("Radius", "Of the circle that it goes round.", MM, 0.0),
    "period": _how("Once in", "Time of one round.", _SECONDS, 0.0),
    "step": _choice(
        "Step",
        "Press until the force or depth is reached; hold; release; slide or roll aside, pressing "
        "as before; turn about the skin's normal; tap, ending lifted.",
        press="Press",
        hold="Hold",
        release="Release",
        slide="Slide",
        roll="Roll",
        turn="Turn",
        tap="Tap",
    ),
    "seconds": _how("Takes", "How long the step takes.", _SECONDS, 0.0),
    "by": _how("By", "How far along x and along y.", MM),
    "turn.by": _how("By", "About the skin's normal, from x to y.", DEGREE),
    "to": _how(
        "To share", "The share of the force or depth that it presses to.", ("of full", 1.0), 0.0
    ),
    "times": _how("Times", "How many taps.", ("times", 1.0), 1, 1000),
    "ease": _choice(
        "Ease",
        "Smooth: it begins and ends at rest without a jerk.",
        smooth="Smooth",
        linear="Steady",
    ),
    "dwell": _how("On each for", "How long the skin lies on each cylinder.", _SECONDS, 0.0),
    "radii": _list("Radii", "Of the cylinders it is laid on.", MM),
    "hold": _how("First stay for", "On the smallest cylinder, to see its creep.", _SECONDS, 0.0),
    "hysteresis.like": _choice(
        "Loops of", "Of which prototype.", second="Second prototype", first="First prototype"
    ),
    "elements": _list("Elements", "Their numbers, from 0."),
    "thresholds": _list("Thresholds", "Of the plays, in 1/m."),
    "weights": _list("Weights", "Of the plays."),
    "asymmetry": _how("Asymmetry", "How many times wider loops are on positive curvature."),
    "rms": _how("RMS", "Root mean square of the noise.", ("1/m", 1.0)),
    "time_constant": _how("Time constant", "Time to within a third of the end.", _SECONDS),
    "gain_sd": _how("Gain spread", "Standard deviation of the gains about 1."),
    "offset_sd": _how("Offset spread", "Standard deviation of the offsets about 0."),
    "temperature.spread": _how("Offset spread", "Of the offsets, as a share of their mean."),
    "intermittent.on": _how("There for", "On average, at a time."),
    "intermittent.off": _how("Away for", "On average, at a time."),
    "since": _how("Since", "Stuck from then on."),
    "low": _how("From frequency", "Where the band of the noise begins."),
    "high": _how("To frequency", "Where the band of the noise ends."),
    "creep.share": _how("Share", "Of a reading that goes in time."),
    "cross-talk.share": _how("Share", "That a channel keeps of the one before."),
    "strain-limit.share": _how("Share", "Of what goes beyond that stays."),
    "share": _how("Share", "Of all frames."),
}


def named(part: str) -> str:
    """A part of the electronics, a motion or a key in words."""
    return _HOW[part].label if part in _HOW else part.replace("_", " ").capitalize()


def how_of(part: str, kind: str, key: str) -> How:
    """How `key` is asked for in a `part` of this `kind`."""
    names = (f"{kind}.{key}", f"{part}.{key}", key)
    found = next((_HOW[name] for name in names if name in _HOW), How(named(key)))
    if part != "effects":
        return found
    tip = f"{found.tip} {explained(kind)}".strip()
    if within := parameters(EFFECTS[kind]).get(key) if kind in EFFECTS else None:
        return replace(
            found, tip=tip, unit=within.unit, scale=1.0, least=within.least, most=within.most
        )
    return replace(found, tip=tip)


def words_of(part: str, key: str, name: str) -> str:
    """What the choice `name` for `key` of a `part` is called."""
    return dict(how_of(part, "", key).choices).get(name, name)
