"""That nobody gets in: no open ports, no code from elsewhere, no memory for what is only said."""

import ast
import os
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

import kappaskin
import kappaskin_app
import kappaskin_resources
from kappaskin import load_scene
from kappaskin.live import Engine
from kappaskin.sources import Decoder, information
from kappaskin.sources.wire import LONGEST, MessageKind, encode, encode_information, encode_samples

pytestmark = pytest.mark.slow

SENSOR = load_scene("centre").sensor()
SOURCES = [
    file
    for package in (kappaskin, kappaskin_app, kappaskin_resources)
    for file in sorted(Path(package.__path__[0]).rglob("*.py"))
]
BANNED_MODULES = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "yaml", "code"}
BANNED_CALLS = {"eval", "exec", "compile", "__import__", "system", "popen", "breakpoint"}


@pytest.fixture
def port() -> Iterator[str]:
    """A pseudo-terminal that says what it is, and one scan."""
    tty = pytest.importorskip("tty", reason="no pseudo-terminals on this system")
    master, slave = os.openpty()
    tty.setraw(slave)
    scan = encode_samples(1, 0.0, np.arange(300), np.zeros(300, np.int32), 2)
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)
    del scan


def listening() -> list[object]:
    own = psutil.Process()
    return [
        connection
        for process in (own, *own.children(recursive=True))
        for connection in process.net_connections(kind="inet")
        if connection.status == psutil.CONN_LISTEN or not connection.raddr
    ]


@pytest.mark.parametrize("kind", ["simulated", "serial"])
def test_a_running_engine_listens_on_no_network(kind, request) -> None:
    before = listening()
    source = "sim:" if kind == "simulated" else request.getfixturevalue("port")
    with Engine() as engine:
        engine.connect(source)
        end = time.monotonic() + 30.0
        while engine.status().source != source and time.monotonic() < end:
            time.sleep(0.02)
        time.sleep(0.3)
        assert engine.status().source == source, engine.status().message
        assert listening() == before


def test_a_listening_socket_would_be_found() -> None:
    import socket

    before = len(listening())
    with socket.create_server(("127.0.0.1", 0)):
        assert len(listening()) == before + 1


def harm(tree: ast.AST) -> Iterator[str]:
    """What of a module runs code that comes from elsewhere, or could."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.split(".")[0] in BANNED_MODULES)
        elif isinstance(node, ast.ImportFrom) and (node.module or "") in BANNED_MODULES:
            yield node.module or ""
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "id", "") or getattr(node.func, "attr", "")
            plain = isinstance(node.func, ast.Name) or name in ("system", "popen")
            owner = getattr(getattr(node.func, "value", None), "id", "")
            if name in BANNED_CALLS and plain and owner in ("", "os"):
                yield name
            for keyword in node.keywords:
                true = isinstance(keyword.value, ast.Constant) and keyword.value.value is True
                if keyword.arg in ("allow_pickle", "shell") and true:
                    yield keyword.arg


@pytest.mark.full
def test_nothing_that_comes_from_elsewhere_is_run() -> None:
    found = {
        (file.name, what)
        for file in SOURCES
        for what in harm(ast.parse(file.read_text(encoding="utf-8")))
    }
    # The ring is shared memory of our own processes, that only this user may open.
    # In memory that this user alone may open, and after both sides have shown the same key.
    assert found == {("ring.py", "pickle"), ("resume.py", "pickle")}


@pytest.mark.parametrize(
    "code",
    ["eval(text)", "import pickle", "from yaml import load", "os.system(x)", "exec(x)",
     "np.load(file, allow_pickle=True)", "run(x, shell=True)"],
)  # fmt: skip
def test_code_that_would_run_what_comes_from_elsewhere_is_found(code) -> None:
    assert len(list(harm(ast.parse(code)))) == 1


def peak(decoder: Decoder, data: bytes) -> int:
    """The most memory that decoding takes beside the bytes themselves."""
    tracemalloc.start()
    decoder.feed(data)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


def test_a_length_that_is_only_said_takes_no_memory() -> None:
    longest = encode(MessageKind.SAMPLES, 0, 0.0, bytes(LONGEST))
    assert peak(Decoder(), longest[:22]) < 10_000


def test_a_length_beyond_the_longest_is_garbage_at_once() -> None:
    header = bytearray(encode(MessageKind.SAMPLES, 0, 0.0, b"")[:20])
    header[4:8] = (LONGEST + 1).to_bytes(4, "little")
    import binascii

    header += binascii.crc_hqx(bytes(header), 0).to_bytes(2, "little")
    decoder = Decoder()
    decoder.feed(bytes(header))
    assert dict(decoder.accounting().discarded) == {"garbage": 22}


def test_runs_of_channels_that_are_only_said_take_no_memory() -> None:
    runs = bytes([2, 255]) + b"\x00\x00\xff\xff" * 255
    message = encode(MessageKind.SAMPLES, 0, 0.0, runs)
    decoder = Decoder()
    assert peak(decoder, message) < 100_000
    assert dict(decoder.accounting().discarded) == {"content": len(message)}


def test_lists_of_channels_that_are_remembered_are_few() -> None:
    decoder, counts = Decoder(), np.zeros(1, np.int32)
    for channel in range(2000):
        decoder.feed(encode_samples(channel, 0.0, np.array([channel]), counts, 2))
    grown = peak(
        decoder,
        b"".join(encode_samples(q, 0.0, np.array([q]), counts, 2) for q in range(2000, 4000)),
    )
    assert decoder.accounting().accepted == 4000
    assert grown < 3_000_000


def test_information_of_a_skin_without_end_takes_no_memory() -> None:
    text = information.sensor_to_json(SENSOR).replace("[10,10]", "[65535,65535]")
    assert "65535" in text
    tracemalloc.start()
    with pytest.raises(kappaskin.SourceError, match="at most 21845 elements"):
        information.sensor_from_json(text)
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
    assert len(Decoder().feed(encode_information(0, 0.0, text))) == 1
