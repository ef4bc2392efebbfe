"""Publishing from the live process: off until asked, through its death, and by the commands."""

import json
import math
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.resources import as_file, files

import numpy as np
import psutil
import pytest
from websockets.exceptions import InvalidStatus, WebSocketException
from websockets.sync.client import connect

from kappaskin import Engine, Refusal, Setup
from kappaskin.publish import TargetStatus

pytestmark = pytest.mark.slow

RECEIVERS = files("kappaskin_resources") / "publishing"


@pytest.fixture
def port(receiver) -> int:
    return receiver.getsockname()[1]


@pytest.fixture
def engine() -> Iterator[Engine]:
    with Engine(Setup(4, 4)) as made:
        yield made


def free_port() -> int:
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        return made.getsockname()[1]


def heard(receiver: socket.socket, kind: str, **wanted: object) -> dict[str, object]:
    """The next message of a kind that says what is wanted."""
    end = time.monotonic() + 30
    while time.monotonic() < end:
        told = json.loads(receiver.recv(9999))
        if told["kind"] == kind and all(told[key] == value for key, value in wanted.items()):
            return told
    raise AssertionError(f"no {kind} with {wanted}")


def until(holds: Callable[[], object]) -> None:
    end = time.monotonic() + 30
    while not holds():
        assert time.monotonic() < end, "it never came to hold"
        time.sleep(0.02)


def target(engine: Engine, within: float = 30.0) -> TargetStatus:
    """How the first target is doing, once that is known of all."""
    end = time.monotonic() + within
    while time.monotonic() < end:
        engine.revive()
        told = engine.status().publishing.targets
        if told and not any(one.opening for one in told):
            return told[0]
        time.sleep(0.02)
    raise AssertionError(engine.status())


# The engine


@pytest.mark.full
def test_nothing_is_sent_before_it_is_asked_for_nor_after(engine, receiver, port) -> None:
    engine.connect("sim:centre")
    receiver.settimeout(1.0)
    with pytest.raises(TimeoutError):
        receiver.recv(9999)
    assert engine.status().publishing.targets == ()
    engine.publish([f"udp://127.0.0.1:{port}"])
    receiver.settimeout(30)
    told = heard(receiver, "contact", present=True)
    assert (told["source"], told["version"]) == ("sim", 1)
    assert told["x_m"] == pytest.approx(0.05, abs=1e-3)
    assert heard(receiver, "shape")["functions_x"] == 4
    engine.publish([])
    until(lambda: engine.status().publishing.targets == ())
    receiver.setblocking(False)
    with suppress(BlockingIOError):
        while receiver.recv(9999):
            pass  # what was sent before
    receiver.settimeout(0.5)
    with pytest.raises(TimeoutError):
        receiver.recv(9999)
    assert engine.status().publishing.targets == ()


def test_what_is_published_is_computed_and_no_surface(receiver, port) -> None:
    with Engine(Setup(4, 4, quantities=())) as engine:
        engine.connect("sim:centre")
        until(lambda: math.isfinite(engine.status().computed.each))
        assert engine.status().quantities == ()
        assert not engine.latest(engine.status()).contact.present

        engine.publish([f"udp://127.0.0.1:{port}"])

        told = heard(receiver, "contact", present=True)
        assert told["force_N"] == pytest.approx(0.2, abs=0.1)
        until(lambda: engine.status().quantities == ("contact", "geometry"))
        assert np.isnan(engine.latest(engine.status()).surface).all()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="priorities as Linux has them")
def test_while_it_publishes_it_comes_before_others_where_it_may(engine, port) -> None:
    process, allowed = psutil.Process(engine.pid), os.geteuid() == 0
    usual = process.nice()

    def is_at(nice: int) -> bool:
        end = time.monotonic() + 30
        while process.nice() != nice and time.monotonic() < end:
            time.sleep(0.02)
        return process.nice() == nice

    engine.publish([f"udp://127.0.0.1:{port}"])
    assert is_at(usual - 10 if allowed else usual)
    engine.publish([])
    assert is_at(usual)


def test_status_tells_what_was_sent_and_how_late(engine, receiver, port) -> None:
    engine.connect("sim:centre")
    engine.publish([f"udp://127.0.0.1:{port}"])
    heard(receiver, "contact")

    def as_promised() -> bool:
        late = engine.status().publishing.latency
        return target(engine).sent > 50 and 0 < late.send < late.whole < 1 and 0 <= late.wait < 1

    until(as_promised)  # as it is without what a busy machine takes
    told = target(engine)
    assert told.target == f"udp://127.0.0.1:{port}"
    assert (told.dropped, told.refusal) == (0, "")


def test_a_target_that_is_none_is_refused_before_anything_changes(engine, receiver, port) -> None:
    engine.connect("sim:centre")
    engine.publish([f"udp://127.0.0.1:{port}"])
    heard(receiver, "contact")
    for wrong in (["udp://a:0"], ["carrier-pigeon://home"], ["udp://a", "udp://a:9870"]):
        with pytest.raises(Refusal):
            engine.publish(wrong)
    heard(receiver, "contact")
    assert len(engine.status().publishing.targets) == 1


def test_a_host_that_is_not_known_and_a_port_in_use_are_told_and_the_rest_goes_on(
    engine, receiver, port
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = f"foxglove://127.0.0.1:{other.getsockname()[1]}"
        engine.connect("sim:centre")
        engine.publish(["udp://nowhere.invalid:9870", taken, f"udp://127.0.0.1:{port}"])
        heard(receiver, "contact")
        target(engine)
        unknown, busy, fine = engine.status().publishing.targets
    # The second, where a network takes long to tell that.
    why = "nowhere.invalid is not known", "udp://nowhere.invalid:9870: its address was not found"
    assert any(words in unknown.refusal for words in why)
    assert "cannot be opened for listening" in busy.refusal
    assert fine.refusal == ""


def test_a_lost_source_is_told_to_the_receivers(engine, receiver, port) -> None:
    engine.connect("/dev/nowhere")
    engine.publish([f"udp://127.0.0.1:{port}"])
    told = heard(receiver, "status", state="lost")
    assert "no such port" in told["message"]


@pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX does")
def test_an_engine_that_takes_over_goes_on_publishing(engine, receiver, port) -> None:
    engine.connect("sim:centre")
    engine.publish([f"udp://127.0.0.1:{port}", f"foxglove://:{free_port()}"])
    heard(receiver, "contact", generation=1)
    os.kill(engine.pid, signal.SIGKILL)
    end = time.monotonic() + 30
    while "started again" not in str(engine.status().events) and time.monotonic() < end:
        engine.revive()
        time.sleep(0.02)
    heard(receiver, "contact", generation=2)
    target(engine)
    assert [told.refusal for told in engine.status().publishing.targets] == ["", ""]


# The commands


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts a command, or a file of Python; whatever happens, it does not stay."""
    running: list[subprocess.Popen[str]] = []

    def begin(*words: object) -> subprocess.Popen[str]:
        begun = [] if str(words[0]).endswith(".py") else ["-m", "kappaskin"]
        command = [sys.executable, "-u", *begun, *map(str, words)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        running.append(subprocess.Popen(command, **pipes))
        return running[-1]

    yield begin
    for process in running:
        if process.poll() is None:
            process.terminate()
            process.communicate(timeout=30)


def taken(port: int) -> bool:
    """Whether somebody listens to a UDP port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind(("", port))
        except OSError:
            return True
    return False


@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_publish_sends_what_listen_tells(start) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    listening = start("listen", "--udp", port)
    until(lambda: taken(port))
    publishing, lines = start("publish", "sim:centre", "--udp", f"127.0.0.1:{port}"), list[str]()
    until(lambda: lines.append(publishing.stdout.readline()) or " computed (" in lines[-1])
    publishing.terminate()
    said, warned = publishing.communicate(timeout=30)
    assert re.search(r"^kappaskin: slopes reach 0.1\d?: up to 0.\d % too flat;", warned)
    said = "".join(lines) + said
    assert publishing.returncode == 0
    computed = (
        r"streaming +\d+ frames/s +\d+ computed \(shape, contact, geometry\) in \d+\.\d\d ms each"
    )
    assert re.search(computed + r".* +udp://127.0.0.1:\d+: \d+ sent, \d+ dropped", said)
    assert "99 % within" in said
    listening.terminate()
    told, _ = listening.communicate(timeout=30)
    assert listening.returncode == 0
    assert "status    streaming  Simulated skin" in told
    assert re.search(r"contact +#\d+ +x [45]\d\.\d+ \u00b1 ", told)
    assert re.search(r"\d+ contacts received, \d+ lost", told.splitlines()[-1])


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_both_end_quietly_when_stopped(start, receiver, port) -> None:
    publishing = start("publish", "sim:centre", "--udp", f"127.0.0.1:{port}")
    heard(receiver, "contact")
    listening, there = start("listen", "--udp", (free := free_port())), ("127.0.0.1", free)
    while not select.select([listening.stdout], [], [], 0.05)[0]:
        receiver.sendto(b'{"kind":"contact","version":1,"number":1}', there)
    for process in (publishing, listening):
        process.send_signal(signal.SIGINT)
        _, complaint = process.communicate(timeout=30)
        warned = r"(kappaskin: slopes reach 0\.\d+: up to 0\.\d % too flat; use finite-slope\n)*"
        assert re.fullmatch(warned, complaint)
        assert process.returncode == 0


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["sim:"], "expected a receiver"),
        (["sim:nothing", "--udp", "127.0.0.1:1"], "nothing"),
        (["sim:", "--udp", "127.0.0.1:0"], "port from 1 to 65535"),
        (["sim:", "--udp", "127.0.0.1:many"], "port from 1 to 65535"),
        (["sim:", "--udp", ":9870"], "expected a host"),
        (["sim:", "--udp", "nowhere.invalid:9870"], "is not known"),
        (["sim:", "--foxglove", "nowhere.invalid:1"], "is not known"),
        (["sim:", "--udp", "a:1", "--udp", "A:1"], "twice"),
        (["sim:", "--foxglove", "--seconds", "0"], "above 0 s"),
        (["sim:", "--foxglove", "--allow-origin", "null"], "expected the origin of a web page"),
        (["sim:", "--udp", "a:1", "--allow-origin", "https://a"], "give --foxglove"),
    ],
)
def test_what_cannot_be_published_is_refused(run, words: list[str], reason: str) -> None:
    code, said, complaint = run("publish", *words)
    assert (code, said) == (2, "")
    assert reason in complaint


def knocks(port: int, origin: str | None, query: str = "") -> str:
    """The first message of a server of Foxglove, or the text of its refusal."""
    url = f"ws://127.0.0.1:{port}/{query}"
    try:
        with connect(url, subprotocols=["foxglove.sdk.v1"], origin=origin) as one:
            return str(one.recv(30))
    except InvalidStatus as error:
        return (error.response.body or b"").decode()
    except (WebSocketException, OSError):  # it is being opened again
        return ""


def serving(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0


@pytest.mark.full
def test_a_web_page_reads_with_the_option_that_its_refusal_names(start) -> None:
    page, port = "https://app.foxglove.dev", free_port()
    words = ("publish", "sim:centre", "--foxglove", f"127.0.0.1:{port}")
    publishing = start(*words)
    until(lambda: serving(port))
    assert "serverInfo" in knocks(port, None)
    for _ in range(3):
        assert "serverInfo" not in knocks(port, page)
    line = publishing.stderr.readline()
    assert line.startswith(f"kappaskin: foxglove://127.0.0.1:{port}: refused a web page of {page};")
    option = re.search(r"--allow-origin \S+", line)[0].split()
    publishing.terminate()
    assert publishing.communicate(timeout=30)[1] == ""  # once
    start(*words, *option)
    until(lambda: serving(port))
    assert "serverInfo" in knocks(port, page)
    assert "serverInfo" not in knocks(port, "https://evil.example")


@pytest.mark.cases("0123456789abcdef")
@pytest.mark.parametrize("token", ["0123456789abcdef", ""])
def test_publish_to_other_machines_prints_the_url_with_the_token(start, monkeypatch, token) -> None:
    monkeypatch.setenv("KAPPASKIN_TOKEN", token)
    port = free_port()
    publishing = start("publish", "sim:centre", "--foxglove", f"0.0.0.0:{port}")
    line = publishing.stderr.readline()
    printed = re.search(rf"other machines can connect, .*:{port}/\?token=(\S+)\n", line)[1]
    assert printed == token or (not token and len(printed) >= 22)
    assert "?token=" in knocks(port, None)
    assert "serverInfo" in knocks(port, None, f"?token={printed}")
    assert not any(printed in word for word in psutil.Process(publishing.pid).cmdline())


@pytest.mark.full
def test_a_token_that_is_too_short_is_refused(start, monkeypatch) -> None:
    monkeypatch.setenv("KAPPASKIN_TOKEN", "secret")
    publishing = start("publish", "sim:", "--foxglove", f"0.0.0.0:{free_port()}")
    said, complaint = publishing.communicate(timeout=30)
    assert (publishing.returncode, said) == (2, "")
    assert "expected a token of 16 to 128" in complaint
    assert "secret" not in complaint


def test_other_origins_open_the_server_again_and_leave_the_rest(engine, receiver, port) -> None:
    served = free_port()
    targets = [f"udp://127.0.0.1:{port}", f"foxglove://127.0.0.1:{served}"]
    engine.connect("sim:centre")
    engine.publish(targets)
    until(lambda: serving(served))
    heard(receiver, "contact")
    before = target(engine)
    assert "--allow-origin https://a" in knocks(served, "https://a")
    engine.publish(targets, ["https://a"])
    until(lambda: "serverInfo" in knocks(served, "https://a"))
    assert target(engine).sent > before.sent
    engine.publish(targets)
    until(lambda: "--allow-origin" in knocks(served, "https://a"))


@pytest.mark.full
def test_publish_fails_where_there_is_nothing_to_send(run, port) -> None:
    code, said, _ = run("publish", "/dev/nowhere", "--udp", f"127.0.0.1:{port}", "--seconds", 3)
    assert code == 1
    assert "no such port" in said


def test_listen_refuses_what_is_no_port_or_no_time(run) -> None:
    assert run("listen", "--udp", 0)[0] == 2
    assert run("listen", "--seconds", "nan")[0] == 2


@pytest.mark.full
def test_listen_fails_where_nothing_came_and_prints_json_if_asked(run, start) -> None:
    port = free_port()
    assert run("listen", "--udp", port, "--seconds", 0.2)[0] == 1
    listening = start("listen", "--udp", port, "--seconds", 5, "--json")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while listening.poll() is None:
            sender.sendto(b'{"kind":"contact","version":1,"number":1}', ("127.0.0.1", port))
            time.sleep(0.05)
    said, _ = listening.communicate()
    assert json.loads(said.splitlines()[0]) == {"kind": "contact", "version": 1, "number": 1}


# The receivers that are given away


@pytest.mark.parametrize("name", ["receive_udp.py", "receive_foxglove.py"])
def test_a_receiver_of_twenty_lines_prints_contacts(engine, start, name: str) -> None:
    port = free_port()
    engine.connect("sim:centre")
    scheme, where = ("udp", port) if "udp" in name else ("foxglove", f"ws://127.0.0.1:{port}")
    engine.publish([f"{scheme}://127.0.0.1:{port}"])
    assert target(engine).refusal == ""
    with as_file(RECEIVERS / name) as path:
        process = start(path, where)
    line = process.stdout.readline()
    process.terminate()
    _, complaint = process.communicate()
    assert re.match(r"0\.0\d+ m 0\.0\d+ m 0\.\d+ \+- 0\.\d+ N", line), complaint
    assert len((RECEIVERS / name).read_text("utf-8").splitlines()) == 20
