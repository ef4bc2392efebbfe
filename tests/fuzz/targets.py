"""What is read from elsewhere: for each reader, how bytes are given to it, and some it likes."""

import base64
import io
import socket
import tomllib
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.writer import Writer

from kappaskin import (
    Calibration,
    Event,
    Frame,
    Pipeline,
    Recording,
    Refusal,
    SensorLayout,
    Setup,
    load_scene,
)
from kappaskin.calibration import Tare, TareStore
from kappaskin.calibration.calibration import digest, fingerprint
from kappaskin.hand import HandTarget, TargetMessage, operation
from kappaskin.live.codec import decoded, encoded
from kappaskin.live.link import Answer, Change, Message, Seen
from kappaskin.live.requests import Note, Requested, Seek
from kappaskin.live.resume import resume_process
from kappaskin.mechanics import HeightMap, Mesh
from kappaskin.pipeline import reconstruct, setup_from_text, setup_to_text
from kappaskin.publish import THIS_MACHINE
from kappaskin.publish.access import AccessCheck
from kappaskin.publish.foxglove import FoxgloveClient
from kappaskin.publish.foxglove_channels import CHANNELS
from kappaskin.recording import Recorder, Repaired, ReplayedSource, Verification
from kappaskin.recording.messages import TOPICS
from kappaskin.scenes import SCENES, read_scene
from kappaskin.scenes.effects import SECOND_GENERATION_LOOPS, Creep
from kappaskin.skin import MeshSkin
from kappaskin.sources import Decoder, SimulatedSource, information
from kappaskin.sources.decoder import FROM_DEVICE, FROM_HOST
from kappaskin.sources.wire import (
    Command,
    MessageKind,
    Operation,
    encode,
    encode_command,
    encode_information,
    encode_reply,
    encode_samples,
)
from kappaskin.studies.design.study import read_study
from kappaskin_app.features.lessons.lesson_file import READY, read_lesson
from kappaskin_app.shell.recovery import settings_in, settings_text
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window_file import WindowState, from_text, to_text

Read = Callable[[bytes, Path], object]


@dataclass(frozen=True)
class Target:
    """A reader: `read` is given bytes and a folder for files, and may raise a `Refusal` only.

    `seeds` are bytes that it reads, `words` what its formats are made of.
    """

    name: str
    read: Read
    seeds: tuple[bytes, ...] = field(repr=False)
    words: tuple[bytes, ...] = field(default=(), repr=False)


SENSOR = load_scene("centre").sensor()
SMALL = load_scene("calibration").sensor()
SCENE_FOLDER = Path(str(files("kappaskin_resources"))) / "scenes"
STUDIES = tuple(sorted((SCENE_FOLDER.parent / "studies").glob("*.toml")))

_NUMBERS = tuple(b"0 -1 1 2 0.5 -0.0 1e308 1e-308 nan inf 65535 4294967296 99999999999".split())
_TOML = (*_NUMBERS, b"true", b'""', b"[]", b"{}", b"[[", b"]]", b"=", b"\n", b'"""', b"2026-01-01")
_JSON = (*_NUMBERS, b"null", b"NaN", b"Infinity", b"{}", b"[]", b'""', b":", b",", b"\\ud800")


# A client of the WebSocket server

_HELLO = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)


def _text(words: bytes) -> bytes:
    """A masked frame of text."""
    return b"\x81" + bytes([0x80 | len(words)]) + bytes(4) + words


_ASKED = (
    _text(b'{"op":"subscribe","subscriptions":[{"id":7,"channelId":1}]}'),
    _text(b'{"op":"unsubscribe","subscriptionIds":[7]}'),
)


_CHECK = AccessCheck(THIS_MACHINE, "localhost", "127.0.0.1")


def _client(data: bytes, _: Path) -> None:
    """In pieces, as they come; messages are offered meanwhile."""
    ours, theirs = socket.socketpair()
    client = FoxgloveClient(ours, "somebody", _CHECK)
    with ours, theirs:
        theirs.setblocking(False)
        for at in range(0, len(data), 4096):
            with suppress(OSError):  # it hung up
                theirs.send(data[at : at + 4096])
            client.read()
            client.offer(CHANNELS[0], 1.8e9, b"{}")
            client.go_on()
            with suppress(OSError):
                theirs.recv(2**20)


# The wire


def _balanced(decoder: Decoder, fed: int) -> None:
    seen = decoder.accounting()
    if not seen.balanced or seen.bytes_in != fed:
        raise RuntimeError(f"the accounting does not balance: {seen}")


def _wire(data: bytes, _: Path) -> None:
    """As they come, from either side, in pieces whose sizes the bytes themselves decide."""
    for kinds in (FROM_DEVICE, FROM_HOST):
        decoder, at = Decoder(kinds), 0
        while at < len(data):
            size = 1 + data[at] * 3
            decoder.feed(data[at : at + size])
            at += size
        _balanced(decoder, len(data))
        decoder.line_ended()
        _balanced(decoder, len(data))


def _content(data: bytes, _: Path) -> None:
    """As payloads of messages whose checks are right."""
    for kind in (*MessageKind, 0, 77):
        message = encode(kind, 1, 0.0, data)
        for kinds in (FROM_DEVICE, FROM_HOST):
            decoder = Decoder(kinds)
            for said in decoder.feed(message + message[:-1] + message):
                str(said)
            _balanced(decoder, 3 * len(message) - 1)


def _information(data: bytes, _: Path) -> None:
    sensor = information.sensor_from_json(data.decode(errors="replace"))
    information.sensor_from_json(information.sensor_to_json(sensor))


def _hand_target(data: bytes, _: Path) -> None:
    message = operation.decoded(data)
    if operation.decoded(message.encoded()) != message:
        raise RuntimeError("it came back as another")


_SCAN = encode_samples(7, 0.1, np.arange(300), np.arange(300, dtype=np.int32), 2)
_PIECES = (
    encode_information(0, 0.0, information.sensor_to_json(SENSOR)),
    _SCAN,
    encode_samples(8, 0.2, np.array([5, 6, 7, 90]), np.array([1, -2, 3, 2**20], np.int32), 4),
    encode_reply(9, 0.3, Command(1, Operation.PING, b""), 0, bytes(10)),
    encode_command(3, 0.4, Operation.SCAN_LIST, bytes([1, 0, 0, 44, 1])),
)


# Files


def _scene(data: bytes, _: Path) -> None:
    read_scene(data.decode(errors="replace"), SCENE_FOLDER / "a.toml")


def _lesson(data: bytes, folder: Path) -> object:
    file = folder / "lesson.md"
    file.write_bytes(data)
    return read_lesson(file)


def _study(data: bytes, _: Path) -> None:
    read_study(data.decode(errors="replace"), SCENE_FOLDER.parent / "studies" / "a.toml")


def _motion(data: bytes, folder: Path) -> None:
    """A recorded motion, named in a scene that is right."""
    (folder / "exploring.csv").write_bytes(data)
    text = (SCENE_FOLDER / "exploring.toml").read_text("utf-8")
    read_scene(text, folder / "exploring.toml")


def _setup(data: bytes, _: Path) -> None:
    setup_to_text(setup_from_text(data.decode(errors="replace"), lambda name: b"format = 1"))


def _readings(data: bytes, folder: Path) -> None:
    path = folder / "readings.npz"
    path.write_bytes(data)
    with np.errstate(all="ignore"):
        reconstruct(path, (2, 2), (5, 5), contact=True)


def _arrays(**changed: "np.ndarray") -> bytes:
    """A file of readings, packed as loosely as bytes can be changed in it."""
    rng, written = np.random.default_rng(0), io.BytesIO()
    arrays = {
        "size": np.array([0.1, 0.08]),
        "positions": rng.uniform(0.02, 0.06, (12, 2)),
        "curvature": rng.normal(size=(2, 3, 12)),
        "rigidity": np.array(0.1),
    }
    np.savez(written, **arrays | changed)
    return written.getvalue()


def _saved_settings(data: bytes, _: Path) -> None:
    settings_text(settings_in(data.decode(errors="replace")))


def _window(data: bytes, _: Path) -> None:
    to_text(from_text(data.decode(errors="replace")))


def _resealed(data: bytes) -> bytes:
    """The file with the hash that belongs to it, as one who means harm would write it."""
    lines = [line for line in data.splitlines() if not line.startswith(b"sha256")]
    said: object = None
    with suppress(ValueError, RecursionError, TypeError, AttributeError):
        said = tomllib.loads(b"\n".join(lines).decode())
        said.pop("format", None)
        lines.insert(1, b'sha256 = "' + digest(said).encode() + b'"')
    return b"\n".join(lines)


def _calibration(data: bytes, folder: Path) -> None:
    path = folder / "a.toml"
    path.write_bytes(_resealed(data))
    Calibration.read(path).check(SMALL)


def _tares(data: bytes, folder: Path) -> None:
    tares = TareStore(folder)
    tares.path(SMALL.serial_number).write_bytes(_resealed(data))
    if (tare := tares.load(SMALL.serial_number).fit_for(SMALL)) is not None:
        str(datetime.now().astimezone() - tare.date)


def _mesh(kind: str) -> Read:
    def read(data: bytes, folder: Path) -> None:
        path = folder / f"a.{kind}"
        path.write_bytes(data)
        Mesh.read(path, 1e-3).height(np.zeros((1, 2)))

    return read


def _mesh_text(data: bytes, _: Path) -> None:
    """The text of a mesh, also of one with any nodes (n, 3) and any numbers after them."""
    n = 12 * (data[0] if data else 0)
    nodes = np.frombuffer(data[1 : n + 1].ljust(n, b"\0"), "<f4").reshape(-1, 3)
    rest = data[n + 1 :]
    steps = np.frombuffer(rest[: len(rest) // 4 * 4], "<i4")
    written = io.BytesIO()
    np.savez(written, nodes=nodes, steps=steps, held=steps[:3], thickness=np.array(1e-3))
    for text in (data, base64.b85encode(written.getvalue())):
        with suppress(Refusal):
            MeshSkin.of_text(text.decode(errors="replace"))


def _map(kind: str) -> Read:
    def read(data: bytes, folder: Path) -> None:
        path = folder / f"a.{kind}"
        path.write_bytes(data)
        HeightMap.read(path, 0.02, 0.01, 1e-3).height(np.zeros((1, 2)))

    return read


def _npy(values: "np.ndarray") -> bytes:
    written = io.BytesIO()
    np.save(written, values)
    return written.getvalue()


def _calibrated(channels: int) -> bytes:
    ones = np.ones(channels)
    return Calibration.to_toml(
        Calibration(
            "skin", "1", "2", "layout", datetime(2026, 1, 1, tzinfo=UTC), ones, 0 * ones, 0 * ones,
            0 * ones, SECOND_GENERATION_LOOPS.operator(channels), Creep(0.03, 20.0).solid(channels),
        )
    ).encode()  # fmt: skip


def _tared() -> bytes:
    """A file of two tares, as it is kept."""
    name, number, layout = SMALL.name, SMALL.serial_number, fingerprint(SMALL.layout)
    offset = np.linspace(-1.0, 1.0, SMALL.channels)
    with TemporaryDirectory() as folder:
        tares = TareStore(Path(folder))
        for hour, temperature in ((1, None), (2, 21.5)):
            date = datetime(2026, 1, 1, hour, tzinfo=UTC)
            tares.add(Tare(name, number, layout, date, temperature, 50, 1.0, offset, offset**2))
        return tares.path(number).read_bytes()


_PLY = (SCENE_FOLDER / "bolt.ply").read_bytes()
_OBJ = b"v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
_ASCII = (
    b"solid a\n" + b"facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 9 0 0\nvertex 0 9 0\n"
    b"endloop\nendfacet\n" * 4 + b"endsolid a\n"
)
_FLAT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4") / 100
_FACES = np.array([[0, 1, 2], [0, 2, 3]])
_SQUARE = b"\x04" + _FLAT.tobytes() + np.diff(_FACES.ravel(), prepend=0).astype("<i4").tobytes()
_MESH_TEXT = MeshSkin(_FLAT, _FACES, 1e-3).text
_BINARY = bytes(80) + (4).to_bytes(4, "little") + bytes(4 * 50)

# Recordings


def _recording(data: bytes, folder: Path) -> None:
    """A file: told of, played, verified and repaired."""
    path, out = folder / "read.mcap", folder / "repaired.mcap"
    path.write_bytes(data)
    out.unlink(missing_ok=True)
    with suppress(Refusal):
        list(Repaired.steps(path, out))
    for place in (path, out):
        if place.exists():
            with suppress(Refusal):
                _played(place)


def _played(path: Path) -> None:
    with Recording(path) as recording:
        for name in recording.attachments:
            with suppress(Refusal):
                recording.attachment(name)
    with suppress(Refusal):
        *_, verdict = Verification.steps(path)
        if not isinstance(verdict, Verification):
            raise TypeError(f"expected a verdict, got {verdict}")
    with closing(ReplayedSource(path, sleep=lambda seconds: None)) as source:
        for at in (source.length, 0.0):
            source.seek(at, 10.0)
            source.read(0.0)
            source.step(-1)
            source.read(0.0)


def _messages(data: bytes, folder: Path) -> None:
    """Messages of any topic, in a file of which everything else is right."""
    path = folder / "messages.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "kappaskin")
        numbers = []
        for name, kind in TOPICS:
            schema = writer.register_schema(kind.name, "ros2msg", kind.definition)
            numbers.append(writer.register_channel(name, "cdr", schema))
        at, stamp = 0, 0
        while at + 3 <= len(data):
            topic, size = data[at] % len(TOPICS), int.from_bytes(data[at + 1 : at + 3], "little")
            stamp += 10**6
            writer.add_message(numbers[topic], stamp, data[at + 3 : at + 3 + size], stamp)
            at += 3 + size
        writer.finish()
    _played(path)


def _recorded() -> tuple[bytes, bytes]:
    """A file of a few frames of a small skin, and its messages one after the other."""
    scene = load_scene("centre")
    scene = replace(scene, layout=SensorLayout.regular(scene.plate.patch, 3, 3))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        source, recorder = SimulatedSource(scene), Recorder(path, 0.0)
        source.record(recorder)
        recorder.plays(scene)
        pipeline = Pipeline(source.sensor, Setup(Ni=3, Nj=3, nx=5, ny=5))
        recorder.set_up(pipeline)
        recorder.add_memory(pipeline.state())
        recorder.add_event(Event(0.0, "note", "seed"))
        frames: list[Frame] = []
        while len(frames) < 4:
            frames += source.read(0.1)
        recorder.left_out(np.zeros(27, np.uint8), np.zeros(27))
        for frame in frames:
            recorder.take(frame, pipeline(frame))
        recorder.close()
        names = [topic.name for topic in TOPICS]
        with Recording(path) as recording:
            messages = [
                bytes([names.index(got.topic)]) + len(got.data).to_bytes(2, "little") + got.data
                for got in recording.messages()
            ]
        return path.read_bytes(), b"".join(messages)


def _note(data: bytes, folder: Path) -> None:
    """What an engine that was left alone leaves where the next one looks."""
    (folder / "x.note").write_bytes(data)
    if resume_process(folder) is not None:
        raise RuntimeError("nobody is there")


def _link(data: bytes, _: Path) -> None:
    """What a window and an engine in another room tell each other."""
    decoded(data, Message, 10**6)


_REQUESTED = Requested(source="sim:").doing(Seek(1.0, 2.0))
_LINK = (
    encoded(Answer("0.2.0", b"proof", b"challenge", "window", "machine", None)),
    encoded(Change(1, {"setup": encoded(_REQUESTED.setup)}, (Note("pressed"), Seek(1.0, 1.0)))),
    encoded(Seen(3)),
)
_FILE, _MESSAGES = _recorded()

TARGETS = (
    Target(
        "client",
        _client,
        (_HELLO, _HELLO + b"".join(_ASKED)),
        (*_JSON, *_ASKED, _HELLO, b"\x89\x80" + bytes(4), b"\x88\x80" + bytes(4), b"\x81\xff"),
    ),
    Target("wire", _wire, (b"".join(_PIECES), _SCAN * 3), (b"\x4b\xa7", _SCAN[:22], _SCAN)),
    Target(
        "content",
        _content,
        tuple(piece[22:-4] for piece in _PIECES),
        (bytes([2, 1, 0, 0, 255, 255]), bytes([4, 255]), b"\xff\xff"),
    ),
    Target(
        "hand target",
        _hand_target,
        (TargetMessage(HandTarget((0.01, -0.02, 0.03), grip=1.0), True, 7, 3).encoded(),),
        (*_JSON, b"NaN", b"-0.0"),
    ),
    Target("information", _information, (_PIECES[0][22:-4],), _JSON),
    Target(
        "scene", _scene, tuple((SCENE_FOLDER / f"{n}.toml").read_bytes() for n in SCENES), _TOML
    ),
    Target(
        "lesson",
        _lesson,
        tuple(file.read_bytes() for file in READY),
        (*_TOML, b"+++\n", b"\n## ", b"\n```toml\n", b"\n```\n", b" and ", b"(", b")", b"force"),
    ),
    Target("study", _study, tuple(file.read_bytes() for file in STUDIES), _TOML),
    Target(
        "motion",
        _motion,
        ((SCENE_FOLDER / "exploring.csv").read_bytes(),),
        (*_NUMBERS, b",", b"\n"),
    ),
    Target("setup", _setup, (setup_to_text(Setup())[0].encode(),), _JSON),
    Target(
        "readings",
        _readings,
        (
            _arrays(),
            _arrays(radius=np.array(0.05)),
            _arrays(size=np.array([0.08, 0.08]), outline=np.array(0.04)),
        ),
        (*_NUMBERS, b"'<f8'", b"(2,)", b"True", b"PK\x03\x04", b"PK\x01\x02"),
    ),
    Target("settings", _saved_settings, (settings_text(Settings()).encode(),), _JSON),
    Target("window", _window, (to_text(WindowState()).encode(),), _TOML),
    Target("calibration", _calibration, (_calibrated(3), _calibrated(1)), _TOML),
    Target("tares", _tares, (_tared(),), _TOML),
    Target("link", _link, _LINK, (b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\xf0", *_JSON)),
    Target("note", _note, (b"0.1.0 " + b"5c" * 32,), (b" ", b"\xc3\xa9", b"zz")),
    Target("recording", _recording, (_FILE,), (b"\x06", b"\x04\0\0\0lz4", b"\xff" * 8)),
    Target("messages", _messages, (_MESSAGES,), (b"\0\1\0\0", b"\xff" * 4, *_JSON)),
    Target("ply", _mesh("ply"), (_PLY[:4000], _PLY), (*_NUMBERS, b"element face ", b"\nproperty ")),
    Target(
        "obj", _mesh("obj"), (_OBJ,), (*_NUMBERS, b"\nf ", b"\nv ", b"\nvn ", b"//", b"\nmtllib ")
    ),
    Target(
        "stl", _mesh("stl"), (_ASCII, _BINARY), (*_NUMBERS, b"\nfacet ", b"\nvertex ", b"\xff" * 4)
    ),
    Target("mesh text", _mesh_text, (_SQUARE, _MESH_TEXT.encode()), _NUMBERS),
    Target(
        "npy",
        _map("npy"),
        (_npy(np.eye(5)), _npy(np.eye(3, dtype="i2"))),
        (*_NUMBERS, b"'O'", b"True"),
    ),
    Target(
        "png",
        _map("png"),
        ((SCENE_FOLDER / "coin.png").read_bytes(),),
        (b"IHDR", b"IDAT", b"\xff" * 4),
    ),
)
