"""Message types: those of ROS 2, our own of a recording with units, and a scene in 3-D."""

import struct
from collections.abc import Iterable
from typing import NamedTuple

from kappaskin.errors import Refusal
from kappaskin.frames import Event
from kappaskin.recording.cdr import MessageType, encode
from kappaskin.sources import is_finger

TIME = MessageType("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec")
HEADER = MessageType("std_msgs/msg/Header", "builtin_interfaces/Time stamp\nstring frame_id", TIME)
STRING = MessageType("std_msgs/msg/String", "string data")
LOG = MessageType(
    "rcl_interfaces/msg/Log",
    """
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
""",
    TIME,
)
_POINT = MessageType("geometry_msgs/msg/Point", "float64 x\nfloat64 y\nfloat64 z")
_QUATERNION = MessageType(
    "geometry_msgs/msg/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w"
)
_POSE = MessageType(
    "geometry_msgs/msg/Pose",
    "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    _POINT,
    _QUATERNION,
)
POSE = MessageType(
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/Header header\ngeometry_msgs/Pose pose",
    HEADER,
    _POSE,
)
_POINT_FIELD = MessageType(
    "sensor_msgs/msg/PointField",
    "string name\nuint32 offset\nuint8 datatype\nuint32 count",
)
POINT_CLOUD = MessageType(
    "sensor_msgs/msg/PointCloud2",
    """
std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
""",
    HEADER,
    _POINT_FIELD,
)

_DURATION = MessageType("builtin_interfaces/msg/Duration", "int32 sec\nuint32 nanosec")
_VECTOR = MessageType("geometry_msgs/msg/Vector3", "float64 x\nfloat64 y\nfloat64 z")
_COLOUR = MessageType("foxglove_msgs/msg/Color", "float64 r\nfloat64 g\nfloat64 b\nfloat64 a")
_PAIR = MessageType("foxglove_msgs/msg/KeyValuePair", "string key\nstring value")
_POSED, _COLOURED = "geometry_msgs/Pose pose\n", "foxglove_msgs/Color color\n"
_BOX = f"{_POSED}geometry_msgs/Vector3 size\n"
_VERTICES = (
    f"geometry_msgs/Point[] points\n{_COLOURED}foxglove_msgs/Color[] colors\nuint32[] indices"
)
_PRIMITIVES = {
    "Arrow": f"{_POSED}float64 shaft_length\nfloat64 shaft_diameter\n"
    f"float64 head_length\nfloat64 head_diameter\n{_COLOURED}",
    "Cube": _BOX + _COLOURED,
    "Sphere": _BOX + _COLOURED,
    "Cylinder": f"{_BOX}float64 bottom_scale\nfloat64 top_scale\n{_COLOURED}",
    "Line": f"uint8 type\n{_POSED}float64 thickness\nbool scale_invariant\n{_VERTICES}",
    "TriangleList": _POSED + _VERTICES,
    "Text": f"{_POSED}bool billboard\nfloat64 font_size\nbool scale_invariant\n"
    f"{_COLOURED}string text",
    "Model": f"{_POSED}geometry_msgs/Vector3 scale\n{_COLOURED}bool override_color\n"
    "string url\nstring media_type\nuint8[] data",
}
SCENE_UPDATE = MessageType(
    "foxglove_msgs/msg/SceneUpdate",
    "foxglove_msgs/SceneEntityDeletion[] deletions\nfoxglove_msgs/SceneEntity[] entities",
    MessageType(
        "foxglove_msgs/msg/SceneEntityDeletion",
        "builtin_interfaces/Time timestamp\nuint8 type\nstring id",
        TIME,
    ),
    MessageType(
        "foxglove_msgs/msg/SceneEntity",
        """
builtin_interfaces/Time timestamp
string frame_id
string id
builtin_interfaces/Duration lifetime
bool frame_locked
foxglove_msgs/KeyValuePair[] metadata
"""
        + "".join(
            f"foxglove_msgs/{name}Primitive[] {name.removesuffix('List').lower()}s\n"
            for name in _PRIMITIVES
        ),
        *(TIME, _DURATION, _PAIR),
        *(
            MessageType(f"foxglove_msgs/msg/{name}Primitive", text, _POSE, _POINT, _VECTOR, _COLOUR)
            for name, text in _PRIMITIVES.items()
        ),
    ),
)
"""Shapes in space, as viewers draw them."""

LINE = MessageType(
    "kappaskin_msgs/msg/Line",
    """
# Bytes as they came over the line of a device, or were sent to it.
float64 host_time  # s, monotonic clock of the host
bool sent          # to the device
uint8[] data
""",
)
CLOCK = MessageType(
    "kappaskin_msgs/msg/Clock",
    """
# From the scan of device time `since` on: host time = t + offset + drift (t - at), and lies within
# half + spread |t - at| of that, for the device time t after `wraps` wraps of its counter.
float64 since   # s, as the device says it
float64 at      # s
float64 offset  # s
float64 half    # s
float64 drift   # s/s
float64 spread  # s/s
bool doubted    # nothing is known until the next
int32 wraps
float64 last    # s, device time of the scan before, as the device says it
""",
)
LEFT_OUT = MessageType(
    "kappaskin_msgs/msg/LeftOut",
    """
# Channels (component by component) that are left out of the fit from the next frame on.
uint8[] kinds      # why, 0 for a good channel
float64[] badness  # those with the largest are left out first
""",
)
MEMORY = MessageType(
    "kappaskin_msgs/msg/Memory",
    """
# What the pipeline remembered of frames before the recording began.
string name
uint32[] shape
float64[] values
""",
)
TRUTH = MessageType(
    "kappaskin_msgs/msg/Truth",
    """
# What the simulation knows of the frames from the next on.
uint64 sequence
string edge            # of the functions that the coefficients belong to
uint32[2] shape
float64[2] contact     # m
float64[] coefficients  # m
""",
)
COUNTS = MessageType(
    "kappaskin_msgs/msg/Counts",
    """
std_msgs/Header header
uint64 sequence
float64 device_time  # s
uint32[] channels    # component by component: xx, yy, xy
int32[] counts
""",
    HEADER,
)
CURVATURE = MessageType(
    "kappaskin_msgs/msg/Curvature",
    """
std_msgs/Header header
uint64 sequence
float64 device_time   # s
float64 noise         # 1/m, standard deviation of a reading
float64[] curvature   # 1/m, component by component: xx, yy, xy; NaN where a reading is missing
uint8[] suspect       # why an element is left out, 0 if it is not
""",
    HEADER,
)
COEFFICIENTS = MessageType(
    "kappaskin_msgs/msg/Coefficients",
    """
std_msgs/Header header
uint64 sequence
float64 device_time      # s
uint32[2] shape          # functions along x and y
float64[] coefficients   # m
""",
    HEADER,
)
CONTACT = MessageType(
    "kappaskin_msgs/msg/Contact",
    """
std_msgs/Header header
uint64 sequence
float64 device_time        # s, on the device's clock, when the scan began
float64 host_time          # s, on the host's monotonic clock, when it came
float64 taken              # s, on the host's monotonic clock, when the scan began
float64 taken_sd           # s
bool present               # whether there is a contact; every number is NaN without one
bool single                # whether one point load explains the readings
bool near_rim              # too near a held edge for place and force to be trusted
bool converged
bool force_is_lower_bound  # the skin may stretch and need more force
bool force_is_upper_bound  # the skin softens and needs less force
bool snaps_through         # where the skin snaps through there is no force
int64 spare                # readings more than a point load needs
float64 noise              # 1/m, standard deviation of a reading
float64[2] position        # m, on the skin
float64[2] position_sd     # m
float64 force              # N
float64 force_sd           # N
float64 displacement       # m
float64 displacement_sd    # m
float64[3] point           # m, in space
float64[9] frame           # rows: along x, across it, outward normal
float64[4] metric
float64[4] curvature_form  # 1/m, in that frame
float64[2] torsion_form    # 1/m
float64[9] covariance      # 1/m^2, of xx, yy, xy of the curvature form
""",
    HEADER,
)
SECOND_CONTACT = MessageType(
    "kappaskin_msgs/msg/SecondContact",
    """
std_msgs/Header header
uint64 sequence
float64 device_time               # s, on the device's clock, when the scan began
bool second_near_rim              # too near a held edge for place and force to be trusted
bool second_force_is_lower_bound  # the skin may stretch and need more force
bool second_force_is_upper_bound  # the skin softens and needs less force
bool second_snaps_through         # where the skin snaps through there is no force
int64 second_spare                # readings more than two loads need
float64[2] second_position        # m, on the skin
float64[2] second_position_sd     # m
float64 second_force              # N
float64 second_force_sd           # N
float64 second_displacement       # m
float64 second_displacement_sd    # m
float64 second_size               # m^2, squared radius of the disc that the load is spread over
float64 second_size_sd            # m^2
""",
    HEADER,
)


_PREFIX = "/kappaskin/"


class Topic(NamedTuple):
    """A channel of the file."""

    name: str
    kind: MessageType

    def of(self, finger: str) -> "Topic":
        """The same of one `finger` of a hand; itself for the finger without a name."""
        name = f"{_PREFIX}{finger}/{self.name.removeprefix(_PREFIX)}"
        return self._replace(name=name) if finger else self


def finger_of(name: str) -> tuple[str, str]:
    """The finger in the name of a channel, empty without one, and the name of its topic."""
    finger, found, topic = name.removeprefix(_PREFIX).partition("/")
    return (finger, _PREFIX + topic) if found and is_finger(finger) else ("", name)


DEVICE = Topic("/kappaskin/device", STRING)
SETUP = Topic("/kappaskin/setup", STRING)
EVENTS = Topic("/kappaskin/events", LOG)
LINES = Topic("/kappaskin/line", LINE)
CLOCKS = Topic("/kappaskin/clock", CLOCK)
LEFT_OUTS = Topic("/kappaskin/left_out", LEFT_OUT)
MEMORIES = Topic("/kappaskin/memory", MEMORY)
TRUTHS = Topic("/kappaskin/truth", TRUTH)
CONTACTS = Topic("/kappaskin/contact", CONTACT)
SECONDS = Topic("/kappaskin/second_contact", SECOND_CONTACT)
COUNT = Topic("/kappaskin/counts", COUNTS)
CURVATURES = Topic("/kappaskin/curvature", CURVATURE)
SHAPES = Topic("/kappaskin/coefficients", COEFFICIENTS)
POSES = Topic("/kappaskin/pose", POSE)
SKIN = Topic("/kappaskin/skin", POINT_CLOUD)
TOPICS = (
    DEVICE,
    SETUP,
    EVENTS,
    LINES,
    CLOCKS,
    LEFT_OUTS,
    MEMORIES,
    TRUTHS,
    CONTACTS,
    SECONDS,
    COUNT,
    CURVATURES,
    SHAPES,
    POSES,
    SKIN,
)
"""Every channel of a recording, or of one of its fingers."""

FRAME = "skin"
"""The coordinate frame of all messages that have one."""

_LINE = struct.Struct("<4sd?3xI")
_CONTACT = struct.Struct("<4siII5s7xQ4d7?xq40d")
_HEAD = b"\0\1\0\0"
_INFO = 20  # what a log calls what is no warning


def pack_line(host_time: float, sent: bool, data: bytes) -> bytes:
    """The message `LINE`: as `cdr.encode` makes it, at a twentieth of the cost."""
    return _LINE.pack(_HEAD, host_time, sent, len(data)) + data


def pack_event(event: Event, stamp: int) -> bytes:
    """The message `LOG` of an event at `stamp` in ns since 1970."""
    fields = {
        "stamp.sec": stamp // 10**9,
        "stamp.nanosec": stamp % 10**9,
        "level": _INFO,
        "name": event.kind,
        "msg": event.text,
        "file": "",
        "function": "",
        "line": 0,
    }
    return encode(LOG, fields)


def pack_contact(
    stamp: int,
    sequence: int,
    times: Iterable[float],
    flags: Iterable[bool],
    spare: int,
    numbers: Iterable[float],
) -> bytes:
    """The message `CONTACT` of the frame `FRAME`: as `cdr.encode` makes it, at a third of the cost.

    Its fields in their order: four `times`, seven `flags`, and from the noise on 40 `numbers`.
    """
    name = FRAME.encode() + b"\0"
    head = _HEAD, *divmod(stamp, 10**9), len(name), name
    return _CONTACT.pack(*head, sequence, *times, *flags, spare, *numbers)


def unpack_line(message: bytes) -> tuple[float, bool, bytes]:
    """Host time in s, whether they were sent, and the bytes of a message `LINE`."""
    if len(message) >= _LINE.size:
        head, host_time, sent, length = _LINE.unpack_from(message)
        if head == _HEAD and len(message) == _LINE.size + length:
            return host_time, sent, message[_LINE.size :]
    raise Refusal(f"expected a message {LINE.name}, got {message[:20]!r}")
