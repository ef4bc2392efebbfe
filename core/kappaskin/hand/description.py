"""A hand: the sensors of its fingers, and where each skin is in the hand's frame."""

import math
import time
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from kappaskin._files import read_file
from kappaskin._schema import Key, Part, Unit, Within
from kappaskin._toml import TomlTable, json_table, parsed
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.hand.pose import IDENTITY, Placement, Triple, placement, rotation_about
from kappaskin.hand.simulated_hand import (
    SHAPES,
    HandCourse,
    Keyframe,
    SimulatedHand,
    SimulatedObject,
)
from kappaskin.scenes import Scene, Trust, load_scene, named_file
from kappaskin.sources import Datagrams, SimulatedSource, is_finger, register_scheme

FORMAT = 1
_LARGEST = 2**22  # bytes of a hand's file or of a URDF
_MOST_FINGERS = 64
_MOST_WAITING = 4096  # datagrams taken at a time: a second of them
_FIXED, _TURNS, _SLIDES = ("fixed",), ("revolute", "continuous"), ("prismatic",)

Angles = Mapping[str, float]


@dataclass(frozen=True)
class Finger:
    """A finger: the `source` of its frames, and where its skin's frame is.

    At `position` in m, turned by `rotation` in rad as `placement` has it, in the frame of the
    `link` of the hand's URDF, or of the hand where that is empty. These are uncertain by
    `position_sd` in m and `rotation_sd` in rad along and about each axis. The skin `conforms` where
    it takes the shape of what touches it, as a soft pad does: then its curvature at the contact is
    the object's.
    """

    name: str
    source: str
    position: Triple
    rotation: Triple = (0.0, 0.0, 0.0)
    link: str = ""
    position_sd: float = 0.0
    rotation_sd: float = 0.0
    conforms: bool = False


class Joint(NamedTuple):
    """A joint of a URDF, between the links `parent` and `child`, along or about `axis` (3,).

    Its value is `scale` times that of the joint `of`, plus `offset`: of itself, or of the one it
    mimics.
    """

    parent: str
    kind: str
    origin: Placement
    axis: Array
    limits: tuple[float, float]
    of: str
    scale: float
    offset: float

    def at(self, value: float) -> Placement:
        """The placement of the child in the parent at `value`, in rad or m."""
        if self.kind in _TURNS:
            return self.origin.of(Placement(rotation_about(self.axis, value), np.zeros(3)))
        return self.origin.of(Placement(np.eye(3), value * self.axis))


class Linkage:
    """The links and joints of the URDF `text`; meshes and inertias in it are not looked at.

    Of its joints fixed, revolute, continuous and prismatic ones are known, and what mimics them.
    """

    def __init__(self, text: str) -> None:
        if "<!DOCTYPE" in text.upper():
            raise Refusal("expected a URDF without a document type; remove the <!DOCTYPE> line")
        try:
            robot = ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise Refusal(f"expected a URDF, got XML with an error: {error}") from error
        links = {link.get("name", "") for link in robot.iter("link")}
        self._joints, names = dict[str, Joint](), dict[str, Joint]()
        for element in robot.findall("joint"):
            name, child, joint = _joint(element)
            if not {child, joint.parent} <= links or child in self._joints or name in names:
                raise Refusal(
                    f"expected each joint once, between links of the URDF, and one joint to each "
                    f"link; got joint {name!r} from {joint.parent!r} to {child!r}"
                )
            self._joints[child] = names[name] = joint
        if len(roots := links - self._joints.keys()) != 1:
            raise Refusal(f"expected a URDF whose links make one tree, got {len(roots)} roots")
        self.root = roots.pop()
        self.joints = {
            name: joint.limits
            for name, joint in names.items()
            if joint.kind not in _FIXED and joint.of == name
        }
        """The limits of each joint that has a value of its own, in rad or m."""
        for joint in names.values():
            if joint.kind not in _FIXED and joint.of not in self.joints:
                raise Refusal(f"expected a joint to mimic that moves, got {joint.of!r}")
        self._chains = {link: self._chain(link) for link in links}

    def _chain(self, link: str) -> list[Joint]:
        """The joints from the root to `link`."""
        chain = list[Joint]()
        while link != self.root:
            chain.append(self._joints[link])
            link = chain[-1].parent
            if len(chain) > len(self._joints):
                raise Refusal(f"expected a URDF whose links make one tree, got a ring at {link!r}")
        return chain[::-1]

    def __contains__(self, link: str) -> bool:
        return link in self._chains

    def at(self, link: str, angles: Angles) -> Placement:
        """The placement of `link` in the root link, for the value of each joint, in rad or m."""
        found = IDENTITY
        for joint in self._chains[link]:
            value = joint.offset
            if joint.kind not in _FIXED:
                if not math.isfinite(own := angles.get(joint.of, math.nan)):
                    needed = ", ".join(sorted({one.of for one in self._chains[link] if one.of}))
                    raise Refusal(
                        f"expected the values of the joints {needed} for the link {link!r}, got "
                        f"none of {joint.of!r}; send all of them in rad or m"
                    )
                value += joint.scale * own
            found = found.of(joint.at(value))
        return found


def _joint(element: ElementTree.Element) -> tuple[str, str, Joint]:
    """The name of the joint, the link that it moves, and the joint."""
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in (*_FIXED, *_TURNS, *_SLIDES):
        known = ", ".join((*_FIXED, *_TURNS, *_SLIDES))
        raise Refusal(f"expected joint {name!r} to be one of {known}, got {kind!r}")
    origin, axis = element.find("origin"), element.find("axis")
    mimic, limit = element.find("mimic"), element.find("limit")
    along = np.array(_numbers(axis, "xyz", name) if axis is not None else (1.0, 0.0, 0.0))
    length = float(np.linalg.norm(along))
    if kind not in _FIXED and not length > 0:
        raise Refusal(f"expected an axis of joint {name!r} that is not zero, got {along.tolist()}")
    bounds = (-math.inf, math.inf)
    if limit is not None and kind != "continuous":
        bounds = _number(limit, "lower", 0.0, name), _number(limit, "upper", 0.0, name)
    joint = Joint(
        _link(element, "parent"),
        kind,
        placement(_numbers(origin, "xyz", name), _numbers(origin, "rpy", name)),
        along if kind in _FIXED else along / length,
        bounds,
        "" if kind in _FIXED else name if mimic is None else mimic.get("joint", ""),
        1.0 if mimic is None else _number(mimic, "multiplier", 1.0, name),
        0.0 if mimic is None else _number(mimic, "offset", 0.0, name),
    )
    return name, _link(element, "child"), joint


def _link(element: ElementTree.Element, end: str) -> str:
    found = element.find(end)
    return "" if found is None else found.get("link", "")


def _number(element: ElementTree.Element, key: str, default: float, joint: str) -> float:
    return _values(element.get(key, f"{default}"), 1, key, joint)[0]


def _numbers(element: ElementTree.Element | None, key: str, joint: str) -> Triple:
    x, y, z = _values("0 0 0" if element is None else element.get(key, "0 0 0"), 3, key, joint)
    return x, y, z


def _values(text: str, count: int, key: str, joint: str) -> list[float]:
    try:
        found = [float(one) for one in text.split()]
    except ValueError:
        found = []
    if len(found) != count or not all(map(math.isfinite, found)):
        raise Refusal(f"expected {count} numbers at {key} of joint {joint!r}, got {text!r:.60}")
    return found


@dataclass(frozen=True, eq=False)
class HandDescription:
    """A hand with `fingers`; with a `linkage`, their links move as its joints do.

    A hand that is `simulated` with an object closes its fingers on it. The values of the joints
    come by UDP to `angles_from`, as `udp://:PORT`, where that is not empty.
    """

    title: str
    fingers: tuple[Finger, ...]
    linkage: Linkage | None = None
    angles_from: str = ""
    simulated: SimulatedHand | None = None
    text: str = ""

    def __post_init__(self) -> None:
        names = [finger.name for finger in self.fingers]
        if not 0 < len(names) <= _MOST_FINGERS or len({*names}) != len(names):
            raise Refusal(
                f"expected 1 to {_MOST_FINGERS} fingers of different names, got {names!r:.200}"
            )
        for finger in self.fingers:
            if not is_finger(finger.name):
                raise Refusal(
                    "expected a finger's name to be a letter, then letters, digits and _, 32 at "
                    f"most, got {finger.name!r:.60}; change it"
                )
            if finger.link and (self.linkage is None or finger.link not in self.linkage):
                raise Refusal(
                    f"expected a link of the hand's URDF for finger {finger.name!r}, got "
                    f"{finger.link!r}; name the file at `urdf`, or leave the link out"
                )

    @property
    def sources(self) -> dict[str, str]:
        """The source of each finger by its name."""
        return {finger.name: finger.source for finger in self.fingers}

    @property
    def joints(self) -> dict[str, tuple[float, float]]:
        """The limits in rad or m of each joint whose value `placements` needs."""
        return {} if self.linkage is None else self.linkage.joints

    def placements(
        self, angles: Angles | None = None, now: float | None = None
    ) -> dict[str, Placement]:
        """Where each finger's skin is in the hand's frame, by name.

        `angles` has the value of each joint in rad or m. A simulated hand without them is where its
        course has it `now` on the monotonic clock in s, or where it was last moved to.
        """
        if self.simulated is not None and angles is None:
            return self.simulated.placements(time.monotonic() if now is None else now)
        found = dict[str, Placement]()
        for finger in self.fingers:
            own = placement(finger.position, finger.rotation)
            if self.linkage is not None and finger.link:
                own = self.linkage.at(finger.link, angles or {}).of(own)
            found[finger.name] = own
        return found


HAND = Part(
    "Hand",
    {
        "format": Key("Format", "The format of the file: 1.", kind=int, offered=False),
        "title": Key("Title", "The name of the hand.", kind=str, default=""),
        "text": Key("Text", "Description of the hand.", kind=str, default="", offered=False),
        "urdf": Key(
            "URDF",
            "A file with the hand's links and joints, beside this one.",
            kind=str,
            default="",
        ),
        "angles_from": Key(
            "Angles from",
            "Where the values of its joints come by UDP, as udp://:PORT.",
            kind=str,
            default="",
        ),
    },
)
_DEGREE = Unit("rad", "\N{DEGREE SIGN}", math.pi / 180)
FINGER = Part(
    "Finger",
    {
        "name": Key("Name", "The name of the finger.", example="thumb"),
        "source": Key("Source", "Where its frames come from.", example="sim:fingertip-cap"),
        "position": Key(
            "Position",
            "Place of the skin's frame in that of the link or hand.",
            Unit("m", "mm", 1e-3),
            limits=Within(-10, 10, "m"),
        ),
        "rotation": Key(
            "Rotation",
            "Roll, pitch and yaw of the skin's frame.",
            _DEGREE,
            limits=Within(-2 * math.pi, 2 * math.pi, "rad"),
        ),
        "link": Key("Link", "The link of the URDF that carries the skin."),
        "position_sd": Key(
            "Position uncertain by",
            "Standard deviation of the position along each axis.",
            Unit("m", "mm", 1e-3),
            limits=Within(0, 1, "m"),
        ),
        "rotation_sd": Key(
            "Rotation uncertain by",
            "Standard deviation of the rotation about each axis.",
            _DEGREE,
            limits=Within(0, 1, "rad"),
        ),
        "conforms": Key("Conforms", "Whether the skin takes the shape of what touches it."),
    },
    (Finger,),
)


_MM = Unit("m", "mm", 1e-3)
OBJECT = Part(
    "Object",
    {
        "shape": Key("Shape", "Its shape.", choices=tuple((one, one) for one in SHAPES)),
        "radius": Key("Radius", "Of a ball or a cylinder.", _MM),
        "length": Key("Length", "Of a cylinder, along its x.", _MM),
        "sides": Key("Sides", "Of a box, along its x, y and z.", _MM),
        "mass": Key("Mass", "What the fingers lift.", Unit.same("kg")),
        "friction": Key("Friction", "Coefficient of friction on the skins."),
        "held": Key("Held", "Whether the fingers bear it; else it stands on something."),
    },
    (SimulatedObject,),
)
KEYFRAME = Part(
    "Keyframe",
    {
        "time": Key("Time", "Time from the beginning of the course.", Unit.same("s")),
        "position": Key(
            "Position", "Place of the object's middle.", _MM, limits=Within(-1, 1, "m")
        ),
        "rotation": Key("Rotation", "Roll, pitch and yaw of the object.", _DEGREE),
        "grip": Key("Grip", "Mean normal force of the fingers that touch.", Unit.same("N")),
    },
    (Keyframe,),
)

SCHEME = "hand:"
"""Begins the names of fingers of simulated hands: `hand:NAME#FINGER`, or `hand:FILE#FINGER`."""

_FOLDER = Path(str(files("kappaskin_resources"))) / "hands"
_ENDING = ".toml"
HANDS = tuple(sorted(file.stem for file in _FOLDER.iterdir() if file.suffix == _ENDING))
"""Names of the ready hands."""


def hand_file(name: str) -> Path:
    """The file of the ready hand `name`, or the TOML file named."""
    if name.endswith(_ENDING):
        return Path(name)
    if name not in HANDS:
        raise Refusal(
            f"expected a hand among {', '.join(HANDS)}, or a file that ends in {_ENDING}; got "
            f"{name!r}"
        )
    return _FOLDER / f"{name}{_ENDING}"


def load_hand(file: Path, trust: Trust = False) -> HandDescription:
    """The hand that the TOML `file` describes; `trust` as of `kappaskin.scenes.named_file`.

    With an [object] it is simulated: each finger's source is then its part of that, on the skin
    that the file has for it.
    """
    text = _text(file, "a hand")
    top = TomlTable(parsed(text, file, "a hand"), text, str(file))
    if (version := HAND.value(top, "format")) != FORMAT:
        raise top.refusal(f"expected format = {FORMAT}, got {version}", "format")
    linkage = None
    if name := HAND.value(top, "urdf"):
        with top.blamed("urdf"):
            linkage = Linkage(_text(named_file(name, file.parent, trust, "hand"), "a URDF"))
    fingers = list[Finger]()
    for one in top.tables("finger"):
        fingers.append(FINGER.make(one, Finger))
        one.done()
    title = HAND.value(top, "title") or file.stem
    with top.blamed():
        angles_from, text = HAND.value(top, "angles_from"), HAND.value(top, "text")
        hand = HandDescription(title, tuple(fingers), linkage, angles_from, text=text)
        if "object" in top or "course" in top:
            hand = _simulated(hand, top, file, trust)
    top.done()
    return hand


def _simulated(hand: HandDescription, top: TomlTable, file: Path, trust: Trust) -> HandDescription:
    """The `hand` around the [object] in its file, on the skins of its fingers."""
    table, keyframes = top.table("object"), list[Keyframe]()
    what = OBJECT.make(table, SimulatedObject)
    table.done()
    for one in top.tables("course"):
        moved = one.table("fingers")
        by = {name: moved.get(name, Triple, within=Within(-1, 1, "m")) for name in moved}
        keyframes.append(KEYFRAME.make(one, Keyframe, fingers=by))
        one.done()
    skins, where = dict[str, tuple[Placement, Scene]](), hand.placements()
    for one, finger in zip(top.tables("finger"), hand.fingers, strict=True):
        with one.blamed("source"):
            skins[finger.name] = where[finger.name], _skin(finger, file, trust)
    course = None
    if keyframes:
        with top.blamed("course"):
            course = HandCourse(tuple(keyframes))
    name = file.stem if file.parent == _FOLDER else str(file)
    fingers = tuple(replace(one, source=f"{SCHEME}{name}#{one.name}") for one in hand.fingers)
    return replace(hand, fingers=fingers, simulated=SimulatedHand(skins, what, course))


def _skin(finger: Finger, file: Path, trust: Trust) -> Scene:
    """The scene that a finger of a simulated hand has as its source, without its stimuli."""
    if not finger.source.startswith(SimulatedSource.SCHEME):
        raise Refusal(
            f"expected a scene for each finger around an [object], such as sim:fingertip-cap, got "
            f"{finger.source!r:.80}"
        )
    name = finger.source.removeprefix(SimulatedSource.SCHEME)
    if name.endswith(_ENDING):
        name = str(named_file(name, file.parent, trust, "hand"))
    return replace(load_scene(name, trust), stimuli=())


def _open(name: str, trust: bool) -> SimulatedSource:
    """The source of a finger, NAME#FINGER or FILE#FINGER."""
    hand, _, finger = name.rpartition("#")
    simulated = load_hand(hand_file(hand), trust).simulated if hand else None
    if simulated is None or finger not in simulated.skins:
        one = "" if simulated is None else f" with a finger among {', '.join(simulated.skins)}"
        raise Refusal(
            f"expected {SCHEME}NAME#FINGER of a hand with an [object]{one}, got {SCHEME}{name}"
        )
    return SimulatedSource(simulated.course_scenes[finger], follows_clock=True)


register_scheme(SCHEME, _open)


def is_hand(file: Path) -> bool:
    """Whether a TOML file describes a hand: it has a table [[finger]]."""
    try:
        return "finger" in tomllib.loads(read_file(file, _LARGEST).decode("utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return False


def named_hand(source: str, trust: Trust = False) -> HandDescription | None:
    """The hand that a `source` names: `hand:NAME` is a ready one, FILE.toml one of your own.

    None for any other source, as for `hand:NAME#FINGER`, which is that of one finger.
    """
    name = source.removeprefix(SCHEME)
    if name == source:
        mine = source.endswith(_ENDING) and is_hand(Path(source))
        return load_hand(Path(source), trust) if mine else None
    return None if "#" in name else load_hand(hand_file(name), trust)


def _text(file: Path, what: str) -> str:
    try:
        return read_file(file, _LARGEST).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        raise Refusal(f"{file}: cannot be read as {what} ({error}); check its name") from error


class JointReceiver:
    """Takes the values of joints that come by UDP to a `url` such as `udp://:9880`.

    Each datagram is a JSON object that `angles_from_json` reads. Joints that it does not name keep
    their values. `refused` counts what is none, and `refusal` says why the last one was.
    """

    def __init__(self, url: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._datagrams, self._at = Datagrams(url, clock), -math.inf
        self._clock, self._angles = clock, dict[str, float]()
        self.refused, self.refusal = 0, ""

    @property
    def angles(self) -> dict[str, float]:
        """The newest value of each joint, in rad or m."""
        for _ in range(_MOST_WAITING):
            at, data = self._datagrams.arriving(within=0.0)
            if not data:
                break
            try:
                self._angles |= angles_from_json(data.decode("utf-8"))
                self._at = at
            except (Refusal, UnicodeDecodeError) as error:
                self.refused += 1
                self.refusal = str(error)
        return dict(self._angles)

    @property
    def age(self) -> float:
        """How long ago in s the last values came; infinity if none ever did."""
        return self._clock() - self._at

    def close(self) -> None:
        self._datagrams.close()


def angles_from_json(text: str) -> dict[str, float]:
    """The value of each joint, in rad or m, from a JSON object `{"joint": value}`."""
    table: Any = json_table(text)
    return {name: table.get(name, float) for name in table}
