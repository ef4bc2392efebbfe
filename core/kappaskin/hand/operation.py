"""Operation of a hand: targets, the messages that bring them, and limits on every one."""

import json
import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

from kappaskin.errors import Refusal
from kappaskin.hand.pose import Placement, Triple, placement

STALE = 0.1
"""Seconds after which a target is not followed any more, unless another one came."""

MESSAGE_VERSION = 1
"""Version of the message; it changes when the meaning of a key changes."""

_KIND = "hand_target"
_LARGEST = 2000  # bytes of a message
_LONGEST_STEP = 0.05  # s: a longer pause allows no longer step
_DRIFT = 2e-4  # of the clock of a sender against this one, at most
_MOST = 2**53  # of whole numbers, which JSON's readers have exactly
_LARGEST_ANGLE = 1e3  # rad
_UPRIGHT = 1e-7  # cosine of the pitch at which roll and yaw turn about one axis

Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class HandTarget:
    """Where an operator wants the hand: `position` in m, `rotation` in rad, `grip` in N.

    From where it was at first, its home, along and about the axes that it had there: roll, pitch
    and yaw as `placement` has them. Each finger presses with the grip. `time` is in s.
    """

    position: Triple = (0.0, 0.0, 0.0)
    rotation: Triple = (0.0, 0.0, 0.0)
    grip: float = 0.0
    time: float = 0.0

    @property
    def where(self) -> Placement:
        """The placement of the hand in its home."""
        return placement(self.position, self.rotation)

    def moved(self, shift: Triple, turn: Triple, grip: float) -> "HandTarget":
        """The target `shift` in m further on, turned by `turn` in rad, gripped by `grip` N more.

        It turns about the direction of `turn` (3,), fixed in the home frame.
        """
        x, y, z = (a + b for a, b in zip(self.position, shift, strict=True))
        rotation = self.rotation
        if any(turn):
            rotation = _angles(_product(_rotation_by(turn), _quaternion(rotation)))
        return replace(self, position=(x, y, z), rotation=rotation, grip=self.grip + grip)


@dataclass(frozen=True)
class OperatorLimits:
    """Limits of what an operator does to a hand.

    Its `speed` in m/s and `turn_rate` in rad/s, its `grip` in N, and how far it goes from its home
    along each axis, `reach` (3,) in m.
    """

    speed: float = 0.05
    turn_rate: float = 0.5
    grip: float = 3.0
    reach: Triple = (0.05, 0.05, 0.05)

    def __post_init__(self) -> None:
        each = self.speed, self.turn_rate, self.grip, *self.reach
        if not (len(self.reach) == 3 and all(0 < one < math.inf for one in each)):
            raise Refusal(f"expected limits above 0 m/s, rad/s, N and m, got {each}")

    def nearest(self, target: HandTarget) -> HandTarget:
        """The target within the workspace and the grip that is nearest to `target`."""
        pairs = zip(target.position, self.reach, strict=True)
        x, y, z = (min(max(at, -most), most) for at, most in pairs)
        return replace(target, position=(x, y, z), grip=min(max(target.grip, 0.0), self.grip))

    def check(self, target: HandTarget) -> None:
        """A `Refusal` for a target outside the workspace, or with a grip outside its limits."""
        for at, most in zip(target.position, self.reach, strict=True):
            if abs(at) > most:
                raise Refusal(
                    f"expected position_m within {_listed(self.reach)} m of home, got "
                    f"{_listed(target.position)}"
                )
        if not 0 <= target.grip <= self.grip:
            raise Refusal(f"expected grip_N from 0 to {self.grip:g}, got {target.grip:g}")


def _listed(numbers: Triple) -> str:
    return ", ".join(f"{one:.6g}" for one in numbers)


class TargetFilter:
    """Follows targets within `limits`; `target` is where the hand is to be now.

    Whatever is wanted, from one call to the next it moves at most as far as speed and turn rate
    allow in the time between, and 0.05 s at most. A hand outside the workspace, because that has
    become smaller, comes back at that speed.
    """

    def __init__(self, limits: OperatorLimits, start: HandTarget) -> None:
        self.limits, self.target = limits, start

    def follow(self, wanted: HandTarget | None, now: float) -> HandTarget:
        """The target at the time `now` in s, towards the `wanted` one; None holds still."""
        was, limits = self.target, self.limits
        seconds = min(max(now - was.time, 0.0), _LONGEST_STEP)
        # Time that goes back, as another clock's, allows no step; from then on it counts anew.
        self.target = replace(was, grip=min(was.grip, limits.grip), time=now)
        if wanted is not None:
            wanted = limits.nearest(wanted)
            self.target = HandTarget(
                _towards(was.position, wanted.position, limits.speed * seconds),
                _turned(was.rotation, wanted.rotation, limits.turn_rate * seconds),
                wanted.grip,
                now,
            )
        return self.target


def _towards(was: Triple, wanted: Triple, most: float) -> Triple:
    """The place on the line from `was` to `wanted` that is `most` m further on, or its end."""
    distance = math.dist(was, wanted)
    if distance <= most:
        return wanted
    x, y, z = (a + (b - a) * most / distance for a, b in zip(was, wanted, strict=True))
    return x, y, z


def _turned(was: Triple, wanted: Triple, most: float) -> Triple:
    """The rotation between two that is `most` rad from the first, or the second."""
    if was == wanted:
        return was
    first = _quaternion(was)
    w, x, y, z = _product(_quaternion(wanted), _conjugate(first))
    sine = math.hypot(x, y, z)
    if 2 * math.atan2(sine, abs(w)) <= most:
        return wanted
    way = math.copysign(most / sine, w)  # the shorter one
    return _angles(_product(_rotation_by((way * x, way * y, way * z)), first))


# Quaternions (w, x, y, z) of unit length: a thousand a second, which as matrices take ten times as
# long.


def _quaternion(angles: Triple) -> Quaternion:
    """The rotation by roll, pitch and yaw in rad, as `placement` has it."""
    a, b, c = (math.cos(angle / 2) for angle in angles)
    d, e, f = (math.sin(angle / 2) for angle in angles)
    return (
        a * b * c + d * e * f,
        d * b * c - a * e * f,
        a * e * c + d * b * f,
        a * b * f - d * e * c,
    )


def _rotation_by(turn: Triple) -> Quaternion:
    """The rotation about the direction of `turn` (3,) by its length in rad."""
    if not (angle := math.hypot(*turn)):
        return 1.0, 0.0, 0.0, 0.0
    share = math.sin(angle / 2) / angle
    x, y, z = turn
    return math.cos(angle / 2), share * x, share * y, share * z


def _conjugate(q: Quaternion) -> Quaternion:
    w, x, y, z = q
    return w, -x, -y, -z


def _product(p: Quaternion, q: Quaternion) -> Quaternion:
    """The rotation by `q`, then by `p`."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def _angles(q: Quaternion) -> Triple:
    """Roll, pitch and yaw in rad, as `placement` has them; roll alone where both have one axis."""
    w, x, y, z = q
    along, across = 1 - 2 * (y * y + z * z), 2 * (x * y + w * z)
    level = math.hypot(along, across)
    pitch = math.atan2(2 * (w * y - x * z), level)
    if level < _UPRIGHT:
        return math.atan2(2 * (w * x - y * z), 1 - 2 * (x * x + z * z)), pitch, 0.0
    roll = math.atan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    return roll, pitch, math.atan2(across, along)


class TargetMessage(NamedTuple):
    """A target in a datagram; the operator holds still where it is not `enabled`.

    `sequence` counts the messages of a `session`, which has another number whenever the sender
    starts.
    """

    target: HandTarget
    enabled: bool
    session: int
    sequence: int

    def encoded(self) -> bytes:
        """The message as JSON; the guide's page *Hands and telemanipulation* lists its keys."""
        target = self.target
        message = {
            "kind": _KIND,
            "version": MESSAGE_VERSION,
            "session": self.session,
            "sequence": self.sequence,
            "time_s": target.time,
            "enabled": self.enabled,
            "position_m": target.position,
            "rotation_rad": target.rotation,
            "grip_N": target.grip,
        }
        return json.dumps(message, allow_nan=False, separators=(",", ":")).encode()


def decoded(data: bytes) -> TargetMessage:
    """The message in a datagram; a `Refusal` for what is none."""
    if len(data) > _LARGEST:
        raise Refusal(f"expected at most {_LARGEST} bytes, got {len(data)}")
    try:
        found = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise Refusal(f"expected JSON, got {data[:40]!r}") from error
    if not isinstance(found, dict):
        raise Refusal(f"expected a JSON object, got {data[:40]!r}")
    message = cast("dict[str, Any]", found)
    head = message.get("kind"), message.get("version")
    if head != (_KIND, MESSAGE_VERSION):
        raise Refusal(
            f"expected kind {_KIND} of version {MESSAGE_VERSION}, got {head[0]!r:.40} of version "
            f"{head[1]!r:.20}"
        )
    if not isinstance(enabled := message.get("enabled"), bool):
        raise Refusal(f"expected enabled to be true or false, got {enabled!r:.40}")
    rotation = _three(message, "rotation_rad")
    if max(map(abs, rotation)) > _LARGEST_ANGLE:
        raise Refusal(f"expected rotation_rad within {_LARGEST_ANGLE:g}, got {_listed(rotation)}")
    target = HandTarget(
        _three(message, "position_m"),
        rotation,
        _number("grip_N", message.get("grip_N")),
        _number("time_s", message.get("time_s")),
    )
    return TargetMessage(target, enabled, _whole(message, "session"), _whole(message, "sequence"))


def _number(key: str, value: object) -> float:
    # Not a whole number of hundreds of digits either, which no float can be.
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _MOST:
        return float(value)
    raise Refusal(f"expected {key} to be numbers, got {value!r:.40}")


def _three(message: dict[str, Any], key: str) -> Triple:
    values = message.get(key)
    if not isinstance(values, list) or len(cast("list[Any]", values)) != 3:
        raise Refusal(f"expected {key} to be three numbers, got {values!r:.40}")
    x, y, z = (_number(key, value) for value in cast("list[Any]", values))
    return x, y, z


def _whole(message: dict[str, Any], key: str) -> int:
    value = message.get(key)
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < _MOST:
        return value
    raise Refusal(f"expected {key} to be a whole number from 0, got {value!r:.40}")


OFF, WAITING, STALE_TARGET, RELEASED, FOLLOWING = "off", "waiting", "stale", "released", "following"
"""What an operator does: switched off, without a target yet, with a stale one, with the dead man's
switch released, or moving the hand."""


class TargetReceiver:
    """Takes messages of one sender, and has the newest target while it may be followed.

    `received` counts those that were taken, `late` those that are older than the newest or came
    0.1 s later than the fastest, `refused` all others: `refusal` says why the last one was. Another
    sender, or another session, is heard once the target is stale.
    """

    def __init__(self) -> None:
        self.received = self.late = self.refused = 0
        self.refusal = ""
        self._of: tuple[object, int] | None = None
        self._newest: TargetMessage | None = None
        self._seen = (-1, -math.inf)  # sequence and time of the newest, late ones included
        self._at, self._lag, self._lag_at = -math.inf, math.inf, 0.0

    def take(self, data: bytes, sender: object, now: float, limits: OperatorLimits) -> bool:
        """Whether the message in `data`, which came at the time `now` in s, may be followed."""
        try:
            message = decoded(data)
            limits.check(message.target)
            self._hear(sender, message.session, now)
        except Refusal as refusal:
            self.refused += 1
            self.refusal = str(refusal)
            return False
        if self._is_late(message, now):
            self.late += 1
            return False
        self.received += 1
        self._newest, self._at = message, now
        return True

    def _hear(self, sender: object, session: int, now: float) -> None:
        if self._of == (sender, session):
            return
        if now - self._at <= STALE:
            raise Refusal("expected one sender in one session; stop the other one")
        self._of, self._seen, self._lag = (sender, session), (-1, -math.inf), math.inf

    def _is_late(self, message: TargetMessage, now: float) -> bool:
        number, time = self._seen
        if message.sequence <= number or message.target.time <= time:
            return True
        self._seen = message.sequence, message.target.time
        # The clocks differ by what nobody knows; the fastest message differs by the least.
        lag = now - message.target.time
        self._lag = min(lag, self._lag + _DRIFT * (now - self._lag_at))
        self._lag_at = now
        return lag > self._lag + STALE

    def state(self, now: float) -> str:
        """What the sender does at the time `now` in s."""
        if self._newest is None:
            return WAITING
        if now - self._at > STALE:
            return STALE_TARGET
        return FOLLOWING if self._newest.enabled else RELEASED

    def wanted(self, now: float) -> HandTarget | None:
        """The target to follow at the time `now` in s; None where the hand is to hold still."""
        if self._newest is None or self.state(now) != FOLLOWING:
            return None
        return self._newest.target
