"""Names of targets, datagrams to those who receive and those who do not, and who listens."""

import errno
import json
import os
import socket
import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Refusal, load_scene
from kappaskin._text import ONE_SIGMA, with_error
from kappaskin.publish import Publishing, SourceState, UdpListener, targets_of
from kappaskin.publish import udp as transport
from kappaskin.publish.message import EstimateMessage
from kappaskin.publish.publishing import MOST_TARGETS, Target, opened, target_of
from kappaskin.publish.udp import Udp, _Heard

PRESSED = load_scene("off-centre")
STATE = SourceState("streaming", "", "", None, 0.0, 0.0)


def free_port(family: int = socket.AF_INET) -> int:
    with socket.socket(family, socket.SOCK_DGRAM) as made:
        made.bind(("::1" if family == socket.AF_INET6 else "127.0.0.1", 0))
        return made.getsockname()[1]


@pytest.fixture
def message(messages_of) -> EstimateMessage:
    (made,) = messages_of(PRESSED)
    return made


def to(receiver: socket.socket) -> Udp:
    return transport.opened(target_of(f"udp://127.0.0.1:{receiver.getsockname()[1]}"))


# Names


@pytest.mark.parametrize(
    ("text", "target"),
    [
        ("udp://127.0.0.1:9870", Target("udp", "127.0.0.1", 9870)),
        (" UDP://Robot.Local/ ", Target("udp", "robot.local", 9870)),
        ("udp://[ff02::1%eth0]:65535", Target("udp", "ff02::1%eth0", 65535)),
        ("foxglove://", Target("foxglove", "127.0.0.1", 8765)),
        ("foxglove://:9000", Target("foxglove", "127.0.0.1", 9000)),
        ("foxglove://0.0.0.0:1", Target("foxglove", "0.0.0.0", 1)),
        ("foxglove://[::]", Target("foxglove", "::", 8765)),
    ],
)
def test_a_target_is_known_by_its_name(text: str, target: Target) -> None:
    assert target_of(text) == target
    assert target_of(str(target)) == target


@pytest.mark.parametrize(
    "text",
    [
        *("", "udp", "127.0.0.1:9870", "tcp://127.0.0.1:1", "udp://", "udp://:9870"),
        *(
            "udp://a:0",
            "udp://a:65536",
            "udp://a:-1",
            "udp://a:9870x",
            "udp://a: 1",
            "udp://a:\u0661",
        ),
        *("udp://a:", "udp://[::1:9870", "udp://a/b", "udp://a\0b:1", f"udp://{'a' * 254}:1"),
    ],
)
def test_what_is_no_target_is_refused(text: str) -> None:
    with pytest.raises(Refusal, match=r"expected a (target|host|port)"):
        target_of(text)


@given(st.text() | st.from_regex(r"(udp|foxglove)://.{0,9}:?.{0,6}"))
def test_any_text_is_a_target_or_refused(text: str) -> None:
    with suppress(Refusal):
        target = target_of(text)
        assert target_of(str(target)) == target
        assert 0 < target.port < 65536


def test_targets_are_given_once_and_not_without_end() -> None:
    with pytest.raises(Refusal, match="twice"):
        targets_of(["udp://a:9870", "foxglove://", "udp://A"])
    with pytest.raises(Refusal, match=f"at most {MOST_TARGETS} targets"):
        targets_of([f"udp://a:{port}" for port in range(1, MOST_TARGETS + 2)])


# Datagrams


def test_a_receiver_gets_contact_and_shape_as_they_are(receiver, message: EstimateMessage) -> None:
    sender = to(receiver)
    sender.send(message)
    sender.report(STATE)
    assert receiver.recv(9999) == message.contact
    assert receiver.recv(9999) == message.shape
    assert json.loads(receiver.recv(9999))["kind"] == "status"
    assert sender.counts == (3, 0)
    sender.close()


def test_a_receiver_over_ipv6_gets_them(message: EstimateMessage) -> None:
    if not socket.has_ipv6:
        pytest.skip("no IPv6 on this system")
    with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as receiver:
        try:
            receiver.bind(("::1", 0))
        except OSError:
            pytest.skip("no IPv6 on this machine")
        receiver.settimeout(30)
        sender = transport.opened(target_of(f"udp://[::1]:{receiver.getsockname()[1]}"))
        sender.send(message)
        assert receiver.recv(9999) == message.contact
        sender.close()


def test_everybody_on_a_network_is_sent_to(message: EstimateMessage) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("", 0))
        receiver.settimeout(30)
        sender = transport.opened(target_of(f"udp://127.255.255.255:{receiver.getsockname()[1]}"))
        sender.send(message)
        assert receiver.recv(9999) == message.contact
        sender.close()


def test_what_nobody_receives_is_counted_until_somebody_does(message: EstimateMessage) -> None:
    port = free_port()
    sender = transport.opened(target_of(f"udp://127.0.0.1:{port}"))
    for _ in range(50):
        sender.send(message)
    sent, dropped = sender.counts
    assert sent + dropped == 100
    assert sent <= 1  # that the last went nowhere is not told yet
    assert sender.receivers[0].trouble == "nobody receives there"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", port))
        receiver.settimeout(30)
        sender.send(message)
        assert receiver.recv(9999) == message.contact
    sender.close()


class Failing:
    """A socket on which the system cannot send for this reason."""

    def __init__(self, number: int) -> None:
        self.number, self.connected = number, 0

    def send(self, data: bytes) -> int:
        raise OSError(self.number, os.strerror(self.number))

    def connect(self, address: object) -> None:
        self.connected += 1
        raise OSError(errno.ENETUNREACH, "")

    def close(self) -> None: ...


@pytest.mark.parametrize("number", [errno.EAGAIN, errno.ENETUNREACH, errno.EPERM, errno.EHOSTDOWN])
def test_whatever_the_system_says_the_session_goes_on(
    number: int, message: EstimateMessage
) -> None:
    failing = Failing(number)
    sender = Udp("udp://somewhere:1", failing, ("somewhere", 1))
    for _ in range(20):
        sender.send(message)
    assert sender.counts == (0, 40)
    assert sender.receivers[0].trouble
    assert failing.connected == (number != errno.EAGAIN)  # once a second


def test_what_no_datagram_holds_is_dropped_and_counted(receiver, message: EstimateMessage) -> None:
    sender = to(receiver)
    message.contact = b"x" * 2001
    sender.send(message)
    assert receiver.recv(9999) == message.shape
    assert sender.counts == (1, 1)
    sender.close()


@pytest.mark.parametrize("host", ["nowhere.invalid", "x" * 64 + ".org", "a..b", "256.1.1.1"])
def test_a_host_that_does_not_resolve_is_refused(host: str) -> None:
    with pytest.raises(Refusal, match="is not known"):
        opened(target_of(f"udp://{host}:9870"))


# Opening, beside the frames


def settled(publishing: Publishing) -> None:
    end = time.monotonic() + 30
    while any(target.opening for target in publishing.status.targets) and time.monotonic() < end:
        publishing.report(STATE)
        time.sleep(0.005)


class Slow:
    """Opens nothing until it is let to, as a look for a name may take."""

    def __init__(self) -> None:
        self.go, self.closed = threading.Event(), threading.Event()

    def __call__(self, target: Target) -> "Slow":
        self.go.wait(10)
        return self

    def close(self) -> None:
        self.closed.set()


def test_a_look_for_a_host_that_takes_long_holds_nothing_up_and_ends_in_a_refusal() -> None:
    slow, now = Slow(), [0.0]
    publishing = Publishing(slow, lambda: now[0])
    began = time.monotonic()
    publishing.request(["udp://slow:1"])
    publishing.report(STATE)
    assert time.monotonic() - began < 5.0  # where the look takes 10 s
    assert publishing.status.targets[0].opening
    now[0] = 6.0
    publishing.report(STATE)
    (told,) = publishing.status.targets
    assert "not found within 5 s" in told.refusal
    slow.go.set()
    assert slow.closed.wait(30)  # come too late
    publishing.close()


def test_what_is_not_wanted_any_more_when_it_opens_is_closed() -> None:
    slow = Slow()
    publishing = Publishing(slow)
    publishing.request(["udp://slow:1"])
    publishing.request([])
    slow.go.set()
    assert slow.closed.wait(30)


def test_a_target_that_stays_is_not_opened_again_and_a_refused_one_is(
    receiver, monkeypatch
) -> None:
    find = socket.getaddrinfo

    def found(host: str, *args: Any, **kwargs: Any) -> list[Any]:
        if host == "nowhere.invalid":  # which takes long to be told where a network is slow
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return find(host, *args, **kwargs)

    monkeypatch.setattr(socket, "getaddrinfo", found)
    name = f"udp://127.0.0.1:{receiver.getsockname()[1]}"
    publishing = Publishing()
    publishing.request([name, "udp://nowhere.invalid:1"])
    settled(publishing)
    publishing.report(STATE)
    stays, refused = publishing.status.targets
    assert (stays.target, stays.refusal) == (name, "")
    assert stays.sent > 0
    assert "not known" in refused.refusal
    publishing.request(["udp://nowhere.invalid:1", name])
    again, same = publishing.status.targets
    assert again.opening
    assert same.sent >= stays.sent
    settled(publishing)
    publishing.close()
    assert publishing.status.targets == ()


# Who listens


@pytest.fixture
def listener() -> Iterator[UdpListener]:
    made = UdpListener(free_port())
    yield made
    made.close()


def send(listener: UdpListener, *datagrams: bytes) -> str:
    port = listener._socket.getsockname()[1]  # noqa: SLF001
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for datagram in datagrams:
            sender.sendto(datagram, ("127.0.0.1", port))
        came = []
        while messages := listener.read(0.1):
            came += [line for told in messages for line in listener.lines(told)]
    return "\n".join(came)


def numbered(number: object, **more: object) -> bytes:
    return json.dumps({"kind": "contact", "version": 1, "number": number} | more).encode()


def test_a_contact_is_told_with_its_error_bars_and_age(listener, message: EstimateMessage) -> None:
    said, touch = send(listener, message.contact, message.shape), message.estimate.contact
    assert f"x {with_error(1e3 * touch.position[0], 1e3 * touch.position_sd[0], 'mm')}  " in said
    assert f"force {with_error(touch.force, touch.force_sd, 'N')}  " in said
    assert touch.force_is_lower_bound
    assert "force is a lower bound" in said
    assert "age" in said
    assert listener.summary == f"1 contacts received, 0 lost; error bars: {ONE_SIGMA}"


def test_the_force_of_a_contact_near_the_rim_is_not_told(listener, message) -> None:
    rim = json.loads(message.contact) | {"near_rim": True}
    said = send(listener, json.dumps(rim).encode())
    assert "edge: no force" in said
    assert " N" not in said


def test_a_force_that_a_curved_skin_softens_is_an_upper_bound_until_it_snaps(
    listener, message
) -> None:
    soft = json.loads(message.contact) | {"force_is_lower_bound": False}
    said = send(listener, json.dumps(soft | {"force_is_upper_bound": True}).encode())
    assert "force is an upper bound" in said
    assert "lower bound" not in said
    said = send(listener, json.dumps(soft | {"snaps_through": True, "force_N": None}).encode())
    assert "snaps through: no force" in said
    assert " N" not in said


def test_losses_are_told_by_gaps(listener) -> None:
    said = send(listener, *(numbered(n) for n in (5, 6, 9, 10, 0, 1)))
    assert said.count("2 messages lost") == 1
    assert "the sender restarted" in said
    assert listener.summary == f"6 contacts received, 2 lost; error bars: {ONE_SIGMA}"


def test_a_state_is_told_once_and_cannot_speak_to_the_terminal(listener) -> None:
    state = SourceState("lost", "live", "unplugged\x1b[2J\n", None, 0.0, 0.0).encoded()
    said = send(listener, state, state)
    assert said.count("unplugged") == 1
    assert said.isprintable()


def test_what_is_none_of_ours_is_counted(listener) -> None:
    nested = b"[" * 20000
    send(listener, b"", b"\xff", b"[1]", b"{}", nested, b'{"kind":"contact","version":2}')
    assert (listener.foreign, listener.contacts) == (6, 0)


@given(
    st.dictionaries(st.sampled_from(["number", "present", "x_m", "age_s", "force_N"]), st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.just(10**400) | st.text(),
        lambda inner: st.lists(inner, max_size=2), max_leaves=3,
    ))
)  # fmt: skip
def test_whatever_a_contact_says_can_be_told(told: dict[str, object]) -> None:
    made = UdpListener.__new__(UdpListener)
    made.__dict__ |= {"_clock": time.monotonic, "_began": 0.0}
    made.__dict__ |= {"_heard": defaultdict(_Heard), "contacts": 0, "lost": 0}
    assert all(line.isprintable() for line in made.lines({"kind": "contact", **told}))


def test_a_port_that_is_taken_or_none_is_refused(receiver) -> None:
    for port in (0, -1, 65536):
        with pytest.raises(Refusal, match="1 to 65535"):
            UdpListener(port)
    with pytest.raises(Refusal, match="choose another"):
        UdpListener(receiver.getsockname()[1])


def test_each_finger_counts_for_itself(receiver, monkeypatch) -> None:
    listener = UdpListener.__new__(UdpListener)
    listener.__dict__ |= {"_began": 0.0, "_heard": defaultdict(_Heard), "contacts": 0, "lost": 0}
    for number in (1, 2, 4):
        for finger in ("thumb", "index"):
            message = {"kind": "contact", "finger": finger, "number": number}
            lines = listener.lines(message)
    assert (listener.contacts, listener.lost) == (6, 2)
    assert [line.split("s  ", 1)[1] for line in lines] == ["index  gap       1 messages lost"]
    for n in range(1000):  # whoever invents fingers takes no memory
        listener.lines({"kind": "contact", "finger": f"f{n}", "number": n})
    assert len(listener._heard) <= 65  # noqa: SLF001
