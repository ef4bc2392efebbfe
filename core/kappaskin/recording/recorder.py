"""Recorder: bytes, frames, estimates and events of the engine to a recording."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from kappaskin._state import StateArrays, Stateful
from kappaskin._text import printable
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Estimate, Event, Frame, Truth
from kappaskin.pipeline import Pipeline, setup_to_text
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import MessageLayout, encode
from kappaskin.recording.disk import ReservedFile
from kappaskin.recording.writing import HandLine, HandPart, RecordingFile, RecordingStatus
from kappaskin.scenes import Scene, write_scene
from kappaskin.sources import ClockState

_CONTACTS = 1000.0  # a second at most
_HEAVY = 50.0  # a second at most, of what is as large as a frame
_BYTES = 4e6  # a second at most, of that
_BURST = 5  # that may come at once, as frames do
_FLOAT32 = 7  # what a point cloud calls it
_NO_TRUTH = Truth(np.empty((0, 0)), np.full(2, math.nan), "")
_COLUMNS = ("x", "y", "z", "displacement")


class Recorder:
    """Writes the recording `path`: bytes and events of a source, and the results of its frames.

    It may be the part of a finger in that of a hand. A `Refusal` where no file can be made. No call
    but `close` and `wait` waits for the disk. Times are in s since `zero`, in ns since 1970; by
    default on the monotonic clock.
    """

    def __init__(
        self,
        path: Path | HandPart,
        now: float,
        disk: Callable[[Path], ReservedFile] = ReservedFile,
        zero: int | None = None,
    ) -> None:
        hand = isinstance(path, HandPart)
        self._file = HandLine(path) if hand else RecordingFile(path, disk, zero)
        self._now = now  # host time in s of what came last
        # The one recorded last, and its layout.
        self._truth, self._truths = _NO_TRUTH, _truths_like(_NO_TRUTH)
        self._attached: set[str] = set()
        self._views: _Views | None = None
        self._contacts = _Throttle(_CONTACTS)

    @property
    def written(self) -> RecordingStatus:
        return self._file.written

    def wait(self) -> None:
        """Wait for the disk where much waits: for what comes faster than from a device."""
        self._file.wait()

    def end(self) -> None:
        """Begin to end the file, once all waiting messages are written."""
        self._file.end()

    def close(self) -> None:
        """End the file, and wait until it is on the disk."""
        self._file.close()

    def resume(self, now: float) -> None:
        """Continue at the time `now` in s, after a pause without a source."""
        self._now = now

    # Input of the source.

    def connected(self, information: str) -> None:
        self._file.put(m.DEVICE, self._now, encode(m.STRING, {"data": information}))

    def received(self, host_time: float, data: bytes) -> None:
        self._now = host_time
        self._file.put(m.LINES, host_time, m.pack_line(host_time, False, data))

    def sent(self, host_time: float, data: bytes) -> None:
        self._now = host_time
        self._file.put(m.LINES, host_time, m.pack_line(host_time, True, data))

    def disconnected(self, host_time: float) -> None:
        """Record a disconnection, as a message of no bytes."""
        self.received(host_time, b"")

    def clock(self, since: float, state: ClockState) -> None:
        at, offset, half, drift, spread, doubted = state.map
        fields = {
            "since": since,
            "at": at,
            "offset": offset,
            "half": half,
            "drift": drift,
            "spread": spread,
            "doubted": doubted,
            "wraps": state.wraps,
            "last": state.last,
        }
        self._file.put(m.CLOCKS, self._now, encode(m.CLOCK, fields))

    def simulated(self, frame: Frame) -> None:
        truth, was = frame.truth or _NO_TRUTH, self._truth
        if truth is was or _same(truth, was):
            return
        if (truth.edge, truth.coefficients.shape) != (was.edge, was.coefficients.shape):
            self._truths = _truths_like(truth)
        self._truth = truth
        fields: dict[str, object] = {
            "sequence": frame.sequence,
            "shape": truth.coefficients.shape,
            "contact": truth.contact,
        }
        if truth.coefficients.size:
            fields["coefficients"] = truth.coefficients.ravel()
        self._file.put(m.TRUTHS, frame.host_time, self._truths(fields))

    # Results.

    def plays(self, scene: Scene) -> None:
        """Record that this scene is simulated from now on."""
        name = f"scene-{len(self._attached)}.toml"
        self._attached.add(name)
        try:
            text = write_scene(scene)
        except Refusal as refusal:  # an object from a file of its own, say
            text = f"# {printable(f'{scene.name}: {refusal}')}\n"
        self._file.attach(name, "application/toml", text.encode())

    def set_up(self, pipeline: Pipeline) -> None:
        """Record that `pipeline` is in use from now on."""
        text, files = setup_to_text(pipeline.setup)
        for name in files.keys() - self._attached:
            self._attached.add(name)
            self._file.attach(name, "application/toml", files[name])
        self._file.put(m.SETUP, self._now, encode(m.STRING, {"data": text}))
        self._views = _Views(pipeline)

    def add_memory(self, memory: StateArrays) -> None:
        """Record the state from which the pipeline continues."""
        for name, values in memory.items():
            fields = {"name": name, "shape": values.shape, "values": values.ravel()}
            self._file.put(m.MEMORIES, self._now, encode(m.MEMORY, fields))

    def left_out(self, kinds: "np.ndarray[tuple[int], np.dtype[np.uint8]]", badness: Array) -> None:
        """Record that these channels are excluded from now on."""
        fields = {"kinds": kinds, "badness": badness}
        self._file.put(m.LEFT_OUTS, self._now, encode(m.LEFT_OUT, fields))

    def add_event(self, event: Event) -> None:
        self._file.put(m.EVENTS, event.time, m.pack_event(event, self._file.stamp(event.time)))

    def take(self, frame: Frame, estimate: Estimate) -> None:
        """Record the estimate of a frame, as often as the rate allows."""
        views, time = self._views, estimate.host_time
        if views is None or not (self._contacts(time) or views.every):
            return
        self._file.put(m.CONTACTS, time, _contact(estimate, self._file.stamp(time)))
        if estimate.second.present:
            self._file.put(m.SECONDS, time, _second(estimate, self._file.stamp(time)))
        if views.affordable(time):
            for topic, data in views.heavy(frame, estimate, self._file.stamp(time)):
                self._file.put(topic, time, data)


def _truths_like(truth: Truth) -> MessageLayout:
    return MessageLayout(m.TRUTH, {"edge": truth.edge, "coefficients": truth.coefficients.size})


def _same(a: Truth, b: Truth) -> bool:
    """Whether arrays are the same bit for bit: ten times as fast as comparing numbers."""
    if a.edge != b.edge or a.contact.tobytes() != b.contact.tobytes():
        return False
    shapes = a.coefficients.shape, b.coefficients.shape
    return shapes[0] == shapes[1] and a.coefficients.tobytes() == b.coefficients.tobytes()


class _Throttle:
    """Whether something may be recorded at a time: at a `rate` at most, but for short bursts."""

    def __init__(self, rate: float) -> None:
        self._period, self._next = 1 / rate, -math.inf

    def __call__(self, time: float) -> bool:
        if time < self._next:
            return False
        self._next = max(self._next, time - _BURST * self._period) + self._period
        return True


class _Views:
    """Estimates of one pipeline to messages."""

    def __init__(self, pipeline: Pipeline) -> None:
        layout = pipeline.sensor.layout
        self._patch, self._positions = layout.patch, layout.positions
        self._displacement = pipeline.basis.at(layout.positions)
        P, C, N = len(layout), pipeline.sensor.channels, pipeline.basis.shape
        head: dict[str, str | int] = {"header.frame_id": m.FRAME}
        self._pose = MessageLayout(m.POSE, head)
        self._curvature = MessageLayout(m.CURVATURE, head | {"curvature": C, "suspect": P})
        self._shape = MessageLayout(m.COEFFICIENTS, head | {"coefficients": math.prod(N)})
        self._functions = N
        self._scanned = 0  # channels in the frame recorded last
        self._counts = MessageLayout(m.COUNTS, head | {"channels": 0, "counts": 0})
        names, self._by_kind = (*_COLUMNS, *layout.kind_names), layout.by_kind
        step = 4 * len(names)
        cloud = head | {"fields": len(names), "data": P * step}
        for n, name in enumerate(names):
            cloud[f"fields.{n}.name"] = name
            cloud[f"fields.{n}.offset"] = 4 * n
            cloud[f"fields.{n}.datatype"] = _FLOAT32
            cloud[f"fields.{n}.count"] = 1
        self._cloud = MessageLayout(m.POINT_CLOUD, cloud)
        self._cloud_size = {"height": 1, "width": P, "point_step": step, "row_step": P * step}
        fit = pipeline.fit
        self.every = isinstance(fit, Stateful) and not fit.has_memory
        """Whether estimates depend on which frames were computed, so that all are recorded."""
        bytes_each = 4 * C + 4 * C + 8 * C + 8 * math.prod(N) + P * step
        self.affordable = _Throttle(min(_HEAVY, _BYTES / bytes_each))

    def heavy(self, frame: Frame, estimate: Estimate, stamp: int) -> list[tuple[m.Topic, bytes]]:
        """The messages that are as large as a frame."""
        head = {
            **_stamped(stamp),
            "sequence": estimate.sequence,
            "device_time": estimate.device_time,
        }
        curvature = estimate.curvature.reshape(-1)
        C = len(frame.counts)
        if self._scanned != C:
            fixed = {"header.frame_id": m.FRAME, "channels": C, "counts": C}
            self._scanned, self._counts = C, MessageLayout(m.COUNTS, fixed)
        counts = {**head, "channels": frame.channels, "counts": frame.counts} if C else head
        readings = {"curvature": curvature, "noise": estimate.noise, "suspect": estimate.suspect}
        shape = {"shape": self._functions, "coefficients": estimate.coefficients.ravel()}
        found = [
            (m.COUNT, self._counts(counts)),
            (m.CURVATURES, self._curvature(head | readings)),
            (m.SHAPES, self._shape(head | shape)),
            (m.SKIN, self._cloud(_stamped(stamp) | self._points(estimate))),
        ]
        if estimate.contact.present:
            found.append((m.POSES, self._pose(_stamped(stamp) | _pose(estimate))))
        return found

    def _points(self, estimate: Estimate) -> dict[str, object]:
        """The surface at the elements, with their readings."""
        f = self._displacement @ estimate.coefficients.ravel()
        rest, normal = self._patch.at_rest(self._positions)
        columns = [*(rest - normal * f[:, None]).T, f, *self._by_kind(estimate.curvature)]
        points = np.stack(columns, axis=1).astype("<f4")
        return {**self._cloud_size, "data": points.reshape(-1).view(np.uint8)}


def _contact(estimate: Estimate, stamp: int) -> bytes:
    contact, here = estimate.contact, estimate.geometry
    return m.pack_contact(
        stamp,
        estimate.sequence,
        (estimate.device_time, estimate.host_time, estimate.taken, estimate.taken_sd),
        (
            *(contact.present, contact.single, contact.near_rim, estimate.converged),
            *(contact.force_is_lower_bound, contact.force_is_upper_bound, contact.snaps_through),
        ),
        contact.spare,
        (
            estimate.noise,
            *contact.position.tolist(),
            *contact.position_sd.tolist(),
            contact.force,
            contact.force_sd,
            contact.displacement,
            contact.displacement_sd,
            *here.position.tolist(),
            *here.frame.ravel().tolist(),
            *here.metric.ravel().tolist(),
            *here.curvature_form.ravel().tolist(),
            *here.torsion_form.tolist(),
            *here.covariance.ravel().tolist(),
        ),
    )


_OF_SECOND = [field.name for field in m.SECOND_CONTACT.fields if "second_" in field.name]


def _second(estimate: Estimate, stamp: int) -> bytes:
    fields = {
        **_stamped(stamp),
        "header.frame_id": m.FRAME,
        "sequence": estimate.sequence,
        "device_time": estimate.device_time,
    }
    told = {name: getattr(estimate.second, name.removeprefix("second_")) for name in _OF_SECOND}
    return encode(m.SECOND_CONTACT, fields | told)


def _stamped(stamp: int) -> dict[str, int]:
    return {"header.stamp.sec": stamp // 10**9, "header.stamp.nanosec": stamp % 10**9}


def _pose(estimate: Estimate) -> dict[str, float]:
    """The contact as a pose: its x along the skin's, its z along the outward normal."""
    where, axes = estimate.geometry.position.tolist(), estimate.geometry.frame.T.tolist()
    fields = {f"pose.position.{name}": value for name, value in zip("xyz", where, strict=True)}
    turn = _quaternion(axes)
    return fields | {f"pose.orientation.{n}": q for n, q in zip("xyzw", turn, strict=True)}


def _quaternion(R: list[list[float]]) -> tuple[float, float, float, float]:
    """The unit quaternion x, y, z, w of a rotation matrix, by its largest component."""
    (a, b, c), (d, e, f), (g, h, i) = R
    squares = (1 + a - e - i, 1 - a + e - i, 1 - a - e + i, 1 + a + e + i)
    rows = (
        (squares[0], b + d, c + g, h - f),
        (b + d, squares[1], f + h, c - g),
        (c + g, f + h, squares[2], d - b),
        (h - f, c - g, d - b, squares[3]),
    )
    x, y, z, w = max(rows, key=lambda row: math.hypot(*row))
    length = math.hypot(x, y, z, w)
    return x / length, y / length, z / length, w / length
