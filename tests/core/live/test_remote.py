"""A window and the engines beside a hand, with a connection between them that may be bad."""

import hmac
import os
import random
import signal
import socket
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from kappaskin import Setup
from kappaskin._processes import BackgroundProcess
from kappaskin.errors import Refusal, SourceError
from kappaskin.live import (
    LOST,
    STREAMING,
    Engine,
    EngineServer,
    Fingers,
    RemoteEngine,
    RemoteFingers,
    Status,
    place_of,
    remote_engines,
)
from kappaskin.live import link as links
from kappaskin.live.codec import encoded
from kappaskin.live.link import (
    Answer,
    Change,
    Denied,
    EngineAddress,
    Greeting,
    MessageSocket,
    Report,
    Seen,
)
from kappaskin.recording import Recording, Verification
from kappaskin.recording.recompute import RecordedFrames
from kappaskin.sources import open_source

pytestmark = pytest.mark.slow

TOKEN = "only-for-this-test"
ONE = {"": "sim:circle"}


def wait_for(ask: Callable[[], Any], within: float = 60.0) -> Any:
    end = time.monotonic() + within
    while not (answer := ask()) and time.monotonic() < end:
        time.sleep(0.01)
    return answer


_REPAIR = 0.2  # s that a chunk is late which is lost once
_CHUNK = 2**16  # bytes


class BadLink:
    """Listens at a `port` of this machine, and carries all to another one, `delay` s late.

    A `loss` is the share of chunks that come 0.2 s later still, and all behind them, as TCP repairs
    losses. While it is `cut` nothing passes, of old connections and of new ones.
    """

    def __init__(self, to: int, delay: float = 0.0, loss: float = 0.0) -> None:
        self._to, self.delay, self.loss = to, delay, loss
        self.cut = threading.Event()
        self._over, self._random = threading.Event(), random.Random(1)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._open: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._run(self._accept)

    def _run(self, target, *about) -> None:
        self._threads.append(threading.Thread(target=target, args=about, daemon=True))
        self._threads[-1].start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                ours, _ = self._listener.accept()
                there = socket.create_connection(("127.0.0.1", self._to))
                for one in (ours, there):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._open += [ours, there]
                for way in ((ours, there), (there, ours)):
                    self._run(self._carry, *way)

    def _carry(self, begin: socket.socket, end: socket.socket) -> None:
        under_way: deque[tuple[float, bytes]] = deque()
        begin.settimeout(0.002)
        last, open_ = 0.0, True
        while (open_ or under_way) and not self._over.is_set():
            try:
                if open_ and (data := begin.recv(_CHUNK)):
                    late = self.delay + _REPAIR * (self._random.random() < self.loss)
                    last = max(last, time.monotonic() + late)
                    under_way.append((last, data))
                elif open_:
                    open_ = False
                else:
                    time.sleep(0.002)
            except TimeoutError:
                pass
            except OSError:
                open_ = False
            while under_way and under_way[0][0] <= time.monotonic() and not self.cut.is_set():
                try:
                    end.sendall(under_way.popleft()[1])
                except OSError:
                    open_ = False
                    under_way.clear()
        with suppress(OSError):
            end.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        self._over.set()
        self._listener.shutdown(socket.SHUT_RDWR)
        for one in (self._listener, *self._open):
            one.close()
        for thread in self._threads:
            thread.join()

    def __enter__(self) -> "BadLink":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Served:
    """Engines beside a hand, and a thread that serves them."""

    def __init__(self, folder: Path, sources: Mapping[str, str], port: int = 0) -> None:
        self.hand = Fingers(sources, Setup(quantities=()))
        self.hand.connect(sources)
        self.server = EngineServer(self.hand, sources, "127.0.0.1", port, TOKEN, folder)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.is_set():
            self.server.poll(0.05)
            self.hand.revive()

    @property
    def place(self) -> str:
        return f"engine:127.0.0.1:{self.server.port}"

    def stop(self) -> None:
        self._over.set()
        self._thread.join()
        self.server.close()
        self.hand.close()


@contextmanager
def serving(folder: Path, sources: Mapping[str, str] = ONE, port: int = 0) -> Iterator[Served]:
    served = Served(folder, sources, port)
    try:
        yield served
    finally:
        served.stop()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    with serving(tmp_path) as made:
        yield made


def window(place: str) -> Engine:
    found = remote_engines(place, TOKEN)
    assert isinstance(found, RemoteEngine)
    return found


def shows(engine: Engine, after: int = -1) -> bool:
    status = engine.status()
    estimate = engine.latest(status)
    return status.state == STREAMING and estimate is not None and estimate.sequence > after


def newest(engine: Engine) -> int:
    estimate = engine.latest(engine.status())
    return -1 if estimate is None else estimate.sequence


def age(engine: Engine) -> float:
    """How old the newest estimate is in s."""
    estimate = engine.latest(engine.status())
    return time.monotonic() - estimate.host_time if estimate else float("inf")


def verified(path: Path, finger: str = "") -> Verification:
    with BackgroundProcess[float | Verification](
        "verify", Verification.steps, path, finger
    ) as work:
        *_, verdict = work.wait()
    assert isinstance(verdict, Verification)
    return verdict


# Near.


def test_a_window_has_what_the_engine_computes(served: Served) -> None:
    with window(served.place) as engine:
        assert wait_for(lambda: shows(engine))
        status = engine.status()
        assert status.source == "sim:circle"
        assert status.sensor is not None
        assert status.link is not None
        assert wait_for(lambda: age(engine) < 0.1)
        assert wait_for(lambda: engine.status().link.round_trip < 0.05)
        assert wait_for(lambda: abs(time.monotonic() - engine.status().last_frame) < 0.5)
        first = newest(engine)
        assert wait_for(lambda: newest(engine) > first + 100)
        times, (forces,), count = engine.recent(engine.status(), 0, ["contact.force"])
        assert len(times) == len(forces) > 5 < count
    assert served.hand.status()[""].state == STREAMING  # closing leaves it


def test_settings_reach_the_engine_and_the_next_window(served: Served) -> None:
    with window(served.place) as engine:
        engine.set_up(Setup(Ni=6, Nj=5))
        engine.note("pressed")
        assert wait_for(lambda: engine.status().setup.Ni == 6)
        assert wait_for(lambda: engine.status().requested == engine.requested.number)
        assert [each.text for each in engine.status().events if each.kind == "note"] == ["pressed"]
        engine.store_window_state(b"as it was")
        assert wait_for(lambda: engine.status().requested == engine.requested.number)
    assert wait_for(lambda: not served.server.window)
    with window(served.place) as engine:
        assert engine.requested.setup == Setup(Ni=6, Nj=5)
        assert engine.resumed is not None
        assert engine.resumed.requested.window_state == b"as it was"
        assert engine.resumed.place == served.place.removeprefix("engine:")
        assert wait_for(lambda: shows(engine))
        engine.set_up(Setup(Ni=5, Nj=5))
        assert wait_for(lambda: engine.status().setup.Ni == 5)


def test_two_setups_are_compared_there(served: Served) -> None:
    with window(served.place) as engine:
        engine.compare(Setup(Ni=5, Nj=5))
        pair = wait_for(lambda: engine.pair(engine.status()))
        assert pair[0].sequence == pair[1].sequence
        assert pair[1].coefficients.shape == (5, 5)


def test_only_sources_that_are_served_are_read(served: Served) -> None:
    with window(served.place) as engine:
        assert wait_for(lambda: shows(engine))
        engine.connect("replay:/etc/passwd")
        assert "reads sim:circle only" in wait_for(lambda: engine.status().source_refusal)
        engine.withdraw()
        assert wait_for(lambda: not engine.status().source_refusal)
        assert engine.status().state == STREAMING
        engine.connect("sim:centre")
        assert wait_for(lambda: engine.status().source == "sim:centre")
        assert wait_for(lambda: shows(engine))


# Not let in.


def test_a_window_without_the_token_is_not_let_in(served: Served) -> None:
    with pytest.raises(Refusal, match="expected the token"):
        remote_engines(served.place, "another-token-of-20")
    assert any("token" in notice for notice in served.server.notices)


def test_an_engine_without_the_token_is_not_believed(served: Served, monkeypatch) -> None:
    monkeypatch.setattr(hmac, "compare_digest", lambda *_: True)  # as a server that lets all in
    monkeypatch.setattr("kappaskin.live.server.proof_of", lambda *_: b"guessed")
    monkeypatch.setattr(links.hmac, "compare_digest", lambda a, b: a == b)
    with pytest.raises(Refusal):
        remote_engines(served.place, TOKEN)


def test_another_version_is_refused_at_both_ends(served: Served, monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.live.server.VERSION", "0.0.1")
    with pytest.raises(Refusal, match=r"0\.0\.1 of the engine"):
        remote_engines(served.place, TOKEN)
    line = raw(served)
    assert isinstance(line.expect(time.monotonic() + 5), Greeting)
    line.send(Answer("0.0.1", b"", b"", "w", "there", None))
    answer = line.expect(time.monotonic() + 5)
    assert isinstance(answer, Denied)
    assert "0.0.1 of the window" in answer.reason
    line.close()


def test_the_second_window_is_told_who_has_the_first(served: Served) -> None:
    with window(served.place) as engine:
        assert wait_for(lambda: shows(engine))
        with pytest.raises(Refusal, match=r"in use by the window on .* \(127\.0\.0\.1\)"):
            remote_engines(served.place, TOKEN)
        assert shows(engine)
    assert wait_for(lambda: not served.server.window)
    with window(served.place) as engine:
        assert wait_for(lambda: shows(engine))


def raw(served: Served) -> MessageSocket:
    return MessageSocket(socket.create_connection(("127.0.0.1", served.server.port)))


@pytest.mark.parametrize(
    "sent", [b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 100, b"\x04\0\0\0abcd", b"\0" * 8]
)
def test_garbage_ends_its_own_connection_alone(served: Served, sent: bytes) -> None:
    with window(served.place) as engine:
        assert wait_for(lambda: shows(engine))
        line = socket.create_connection(("127.0.0.1", served.server.port))
        line.settimeout(5)
        line.sendall(sent)
        while line.recv(4096):
            pass
        line.close()
        assert wait_for(lambda: shows(engine, newest(engine)))


def test_who_says_nothing_is_left_after_a_while(served: Served, monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.live.server._SILENT", 0.3)
    lines = [socket.create_connection(("127.0.0.1", served.server.port)) for _ in range(40)]
    for line in lines:
        line.settimeout(10)
        while line.recv(4096):
            pass
        line.close()
    with window(served.place) as engine:
        assert wait_for(lambda: shows(engine))


def let_in(served: Served, finger: str = "", who: str = "w" * 32) -> MessageSocket:
    address = EngineAddress("127.0.0.1", served.server.port, TOKEN, who)
    line, _ = address.connect(finger, 5.0)
    return line


def test_a_window_that_falls_silent_makes_room(served: Served, monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.live.server._SILENT", 0.5)
    line = let_in(served)  # its cable is pulled: nothing is read, sent or closed
    assert wait_for(lambda: served.server.window)
    assert wait_for(lambda: not served.server.window, 10)
    with window(served.place) as engine:
        assert wait_for(lambda: shows(engine))
    line.close()


@pytest.mark.parametrize(
    "settings",
    [
        {"recording": Path("../outside.mcap")},
        {"recording": Path("/outside.mcap")},
        {"recording": Path("..")},
        {"recording": Path(".hidden")},
        {"recording": 3},
        {"trust": True},
        {"finger": "thumb"},
        {"setup": 3},
        {"targets": ("udp://:1", 3)},
    ],
)
def test_what_a_window_may_not_ends_its_connection(
    served: Served, settings: dict[str, Any], tmp_path: Path
) -> None:
    line = let_in(served)
    before = served.hand.engines[""].requested
    line.send(Change(1, {name: encoded(value) for name, value in settings.items()}))
    end = time.monotonic() + 10
    while not isinstance(message := line.expect(end), Denied):
        pass
    assert "expected" in message.reason
    line.close()
    assert served.hand.engines[""].requested == before
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("lab", ("lab", 9871)),
        ("10.0.0.2:99", ("10.0.0.2", 99)),
        ("[::1]", ("::1", 9871)),
        ("[::1]:5", ("::1", 5)),
    ],
)
def test_places_have_a_host_and_a_port(text: str, place: tuple[str, int]) -> None:
    assert place_of(text) == place


@pytest.mark.parametrize("text", ["", ":", ":80", "a:b", "::1", "[::1", "lab:70000", "lab:"])
def test_other_places_are_refused(text: str) -> None:
    with pytest.raises(Refusal):
        place_of(text)


def test_an_engine_is_no_source_of_readings() -> None:
    with pytest.raises(Refusal, match="kappaskin app --source engine:lab"):
        open_source("engine:lab")


def test_without_an_engine_there_the_refusal_says_what_to_start() -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(SourceError, match="kappaskin serve"):
        remote_engines(f"engine:127.0.0.1:{port}", TOKEN)


# Another room.


def told(engine: Engine) -> tuple[float, float, float]:
    link = engine.status().link
    assert link is not None
    return link.round_trip, link.age, link.shown


def ages_on_arrival(engine: Engine, seconds: float) -> list[float]:
    ages, seen, end = list[float](), newest(engine), time.monotonic() + seconds
    while time.monotonic() < end:
        if (now := newest(engine)) != seen:
            seen = now
            ages.append(age(engine))
        time.sleep(0.001)
    return ages


def test_the_delay_of_the_connection_is_told(served: Served) -> None:
    with BadLink(served.server.port, 0.05) as link, window(f"engine:127.0.0.1:{link.port}") as far:

        def tells() -> bool:
            ages = ages_on_arrival(far, 2.0)
            round_trip, told_age, shown = told(far)
            assert not round_trip < 0.1
            known = told_age == pytest.approx(statistics.median(ages), rel=0.2)
            return known and round_trip < 0.12 and told_age < 0.1 and 0.02 < shown <= 1.0

        assert wait_for(lambda: shows(far))
        assert wait_for(tells), told(far)  # a machine that is busy adds delays of its own


@pytest.mark.parametrize("cut", [3.0, pytest.param(10.0, marks=pytest.mark.full)])
def test_a_cut_is_told_and_leaves_no_hole_in_the_recording(
    served: Served, tmp_path: Path, cut: float
) -> None:
    with (
        BadLink(served.server.port, 0.05, 0.05) as link,
        window(f"engine:127.0.0.1:{link.port}") as far,
    ):
        assert wait_for(lambda: shows(far))
        far.record(Path("/elsewhere/press.mcap"))
        assert wait_for(lambda: far.status().recording.active)
        assert far.status().recording.path == str(tmp_path / "press.mcap")
        time.sleep(1.0)
        link.cut.set()
        began = time.monotonic()
        assert wait_for(lambda: far.status().state == LOST, 3.0)
        assert time.monotonic() - began < 2.0
        assert "connecting again by itself" in far.status().message
        far.note("while it was cut")
        time.sleep(cut - (time.monotonic() - began))
        last = newest(far)
        link.cut.clear()
        began = time.monotonic()
        assert wait_for(lambda: age(far) < 0.2, 1.0), age(far)
        assert newest(far) > last + 100 * cut
        assert wait_for(lambda: far.status().state == STREAMING, 1.0)
        assert far.status().link.cuts == 1
        texts = [each.text for each in far.status().events]
        assert any("is back after" in text for text in texts)
        assert wait_for(lambda: "while it was cut" in [e.text for e in far.status().events])
        time.sleep(1.0)
        far.record(None)
        assert wait_for(lambda: not far.status().recording.active)
    verdict = verified(tmp_path / "press.mcap")
    assert verdict.passed
    with Recording(tmp_path / "press.mcap") as recording:
        assert recording.whole
        assert recording.seconds(recording.last) > cut + 2
        reenact = RecordedFrames("press")
        numbers = [f.sequence for said in recording.messages() for f in reenact(said)]
        assert numbers == list(range(numbers[0], numbers[-1] + 1))


def test_nothing_queues_on_a_connection_that_takes_little(served: Served) -> None:
    with (
        BadLink(served.server.port, 0.05, 0.3) as link,
        window(f"engine:127.0.0.1:{link.port}") as far,
    ):
        assert wait_for(lambda: shows(far))
        time.sleep(5.0)
        ages = [age(far) for _ in range(100) if not time.sleep(0.02)]
        assert statistics.median(ages) < 1.0


def test_what_the_window_has_is_not_sent_again_after_a_cut(served: Served) -> None:
    assert wait_for(lambda: served.hand.status()[""].slot is not None)
    line = let_in(served)
    first = reports(line, 3)
    assert set(first[0].fields) == {each.name for each in fields(Status)}
    line.close()
    address = EngineAddress("127.0.0.1", served.server.port, TOKEN, "w" * 32)
    line, welcome = address.connect("", 5.0, first[1].number)  # the last one was lost
    again = reports(line, 1)[0]
    assert (welcome.fingers, again.number > first[-1].number) == ({}, True)
    assert first[-1].fields.keys() <= again.fields.keys()
    assert not {"sensor", "slot"} & again.fields.keys()
    line.close()


def reports(line: MessageSocket, count: int) -> list[Report]:
    """So many reports."""
    found: list[Report] = []
    while len(found) < count:
        message = line.expect(time.monotonic() + 10)
        if isinstance(message, Report):
            found.append(message)
            line.send(Seen(message.number))
    return found


# What ends.


@pytest.mark.skipif(os.name == "nt", reason="by a signal")
def test_an_engine_that_is_killed_is_told_and_comes_back(served: Served) -> None:
    with window(served.place) as far:
        assert wait_for(lambda: shows(far))
        was = served.hand.engines[""].pid
        os.kill(was or 0, signal.SIGKILL)
        assert wait_for(lambda: any(e.kind == "engine" for e in far.status().events))
        assert wait_for(lambda: shows(far))
        assert served.hand.engines[""].pid != was


@pytest.mark.skipif(os.name == "nt", reason="by a signal")
def test_a_window_that_is_killed_leaves_recording_and_receivers(
    served: Served, tmp_path: Path
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        far = window(served.place)
        far.publish([f"udp://127.0.0.1:{receiver.getsockname()[1]}"])
        far.record(Path("going-on.mcap"))
        assert wait_for(lambda: far.status().recording.active)
        os.kill(far.pid or 0, signal.SIGKILL)  # the process that has the connection
        assert wait_for(lambda: not served.server.window)
        receiver.setblocking(False)
        with suppress(BlockingIOError):  # what came before
            while receiver.recv(65536):
                pass
        receiver.settimeout(10)
        assert receiver.recv(65536)
        assert served.hand.status()[""].recording.active
        far.revive()  # the window itself was alive: it goes on too
        assert wait_for(lambda: shows(far))
        assert far.status().recording.active
        far.close()
    assert wait_for(lambda: not served.server.window)
    with window(served.place) as far:
        assert far.requested.recording == Path("going-on.mcap")
        assert wait_for(lambda: far.status().recording.active)
        far.record(None)
        assert wait_for(lambda: not far.status().recording.active)
    with Recording(tmp_path / "going-on.mcap") as recording:
        assert recording.whole


def test_a_server_that_is_started_again_gets_the_settings_of_the_window(tmp_path: Path) -> None:
    with serving(tmp_path) as first:
        place, port = first.place, first.server.port
        far = window(place)
        far.set_up(Setup(Ni=6, Nj=5))
        assert wait_for(lambda: shows(far))
        assert wait_for(lambda: far.status().setup.Ni == 6)
        connections = far.status().connections
    assert wait_for(lambda: far.status().state == LOST)
    with serving(tmp_path, port=port) as again, far:
        assert wait_for(lambda: shows(far))
        assert wait_for(lambda: far.status().setup == Setup(Ni=6, Nj=5))
        assert again.hand.engines[""].requested.setup == Setup(Ni=6, Nj=5)
        assert far.status().connections > connections


# A hand.

HAND = {"thumb": "sim:circle", "index": "sim:centre"}


def test_a_hand_is_served_and_recorded_to_one_file(tmp_path: Path) -> None:
    with serving(tmp_path, HAND) as served:
        hand = remote_engines(served.place, TOKEN)
        assert isinstance(hand, RemoteFingers)
        with hand:
            assert tuple(hand.engines) == ("thumb", "index")
            assert wait_for(lambda: all(map(shows, hand.engines.values())))
            assert [each.source for each in hand.status().values()] == list(HAND.values())
            assert wait_for(lambda: len(hand.aligned(hand.status())) == 2)
            taken = [each.taken for each in hand.aligned(hand.status()).values()]
            assert abs(taken[0] - taken[1]) < 0.5
            hand.record(Path("hand.mcap"))
            assert wait_for(lambda: hand.recording.active)
            time.sleep(1.0)
            hand.stop_recording()
            assert wait_for(lambda: not hand.recording.active)
        assert served.hand.status()["index"].state == STREAMING
    for finger in HAND:
        assert verified(tmp_path / "hand.mcap", finger).passed
