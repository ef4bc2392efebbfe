"""What the window requests of the engine, and how it gets there whatever a line does."""

import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Region, Setup, load_scene
from kappaskin.live import Engine
from kappaskin.live.requests import (
    SETTINGS,
    Action,
    Note,
    Requested,
    RequestSender,
    Seek,
    StepFrames,
    TakeTare,
    Update,
)

SCENE = load_scene("line")
SETUPS = [Setup(n, n) for n in (3, 4, 5)]


class BadLine:
    """A line to an engine that drops some messages, delivers others twice, and some too late."""

    def __init__(
        self,
        chance: random.Random,
        deliver: Callable[[Update], None],
        close: Callable[[], None] = lambda: None,
    ) -> None:
        self._chance, self._deliver, self.close = chance, deliver, close
        self._late: list[Update] = []
        self.broken = True

    def send(self, update: Update) -> None:
        if not self.broken:
            self._deliver(update)
            return
        self._late += [update] * self._chance.choice((0, 1, 1, 2))
        self._chance.shuffle(self._late)
        while self._late and self._chance.random() < 0.5:
            self._deliver(self._late.pop())

    def mend(self) -> None:
        """Deliver what is late, in any order, and everything at once from now on."""
        self.broken = False
        while self._late:
            self._deliver(self._late.pop())


class EngineSide:
    """Follows what is requested, and writes down what it did."""

    def __init__(self) -> None:
        self.requested = Requested()
        self.running: dict[str, Any] = {name: getattr(self.requested, name) for name in SETTINGS}
        self.done: list[Action] = []

    def take(self, update: Update) -> None:
        before, self.requested = self.requested.number, self.requested.updated(update)
        for each in self.requested.since(before):
            if isinstance(each, str):
                self.running[each] = getattr(self.requested, each)
            else:
                self.done.append(each)


CHANGES = st.one_of(
    st.sampled_from(SETUPS).map(lambda setup: {"setup": setup}),
    st.sampled_from([None, *SETUPS]).map(lambda setup: {"compared": setup}),
    st.sampled_from([Region(), Region("skin")]).map(lambda region: {"region": region}),
    st.sampled_from(["sim:", "sim:line", None]).map(
        lambda source: {"source": source, "scene": None, "speed": 1.0, "looped": False}
    ),
    st.just({"scene": SCENE}),
    st.sampled_from([Path("a"), Path("b"), None]).map(lambda path: {"recording": path}),
    st.sampled_from([(), ("udp://a:1",)]).map(lambda targets: {"targets": targets}),
    st.integers().map(lambda n: Note(str(n))),
    st.integers(-3, 3).map(StepFrames),
    st.just(TakeTare()),
)
"""A setting that is requested, or an action."""


@given(st.lists(st.tuples(CHANGES, st.booleans()), max_size=30), st.randoms(use_true_random=False))
def test_whatever_a_line_drops_doubles_or_delays_the_engine_is_as_requested(
    changes: list[tuple[Any, bool]], chance: random.Random
) -> None:
    engine, now = EngineSide(), [0.0]
    line = BadLine(chance, engine.take)
    sender = RequestSender(Requested(), lambda: now[0])
    sender.connect(line)  # pyright: ignore[reportArgumentType]
    actions: list[Action] = []
    for change, reports in changes:
        now[0] += 0.1
        if isinstance(change, dict):
            sender.change(**change)
        else:
            actions.append(change)
            sender.act(change)
        if reports:
            sender.acknowledge(engine.requested.number, now[0])

    line.mend()
    for _ in range(2):
        now[0] += 1.0
        sender.acknowledge(engine.requested.number, now[0])

    assert engine.requested.number == sender.requested.number
    for name in SETTINGS:
        assert engine.running[name] == getattr(sender.requested, name)
        assert getattr(engine.requested, name) == getattr(sender.requested, name)
    assert engine.done == actions  # each once, in order


def test_what_the_engine_has_is_not_sent_again() -> None:
    sent: list[Update] = []
    line, now = BadLine(random.Random(0), sent.append), [0.0]
    line.broken = False
    sender = RequestSender(Requested().changing(setup=SETUPS[0]), lambda: now[0])
    sender.connect(line)  # pyright: ignore[reportArgumentType]
    sender.acknowledge(1, 0.1)
    sender.change(region=Region("skin"))
    sender.acknowledge(2, 9.0)
    assert [set(update.values) for update in sent] == [{"setup"}, {"region"}]


def test_an_engine_that_is_busy_is_not_sent_the_same_again() -> None:
    sent: list[Update] = []
    line, now = BadLine(random.Random(0), sent.append), [5.0]
    line.broken = False
    sender = RequestSender(Requested(), lambda: now[0])
    sender.connect(line)  # pyright: ignore[reportArgumentType]
    sender.change(setup=SETUPS[0])
    now[0] = 60.0
    sender.acknowledge(0, 4.9)  # what it reported last was before
    assert len(sent) == 1
    sender.acknowledge(0, 6.0)
    assert len(sent) == 2


def test_another_engine_is_sent_every_setting_and_no_action() -> None:
    sent: list[Update] = []
    line = BadLine(random.Random(0), sent.append)
    line.broken = False
    sender = RequestSender(Requested())
    sender.connect(line)  # pyright: ignore[reportArgumentType]
    sender.change(setup=SETUPS[1])
    sender.act(Note("once"))
    sender.change(region=Region("skin"))
    sender.connect(line)  # pyright: ignore[reportArgumentType]
    fresh = Requested().updated(sent[-1])
    assert fresh.since(0) == ["setup", "region"]
    assert (fresh.setup, fresh.region) == (SETUPS[1], Region("skin"))


def told(*each: dict[str, Any] | Action) -> Requested:
    """What is requested once these are, in order."""
    requested = Requested()
    for one in each:
        requested = requested.changing(**one) if isinstance(one, dict) else requested.doing(one)
    return requested


CONNECT = {"source": "x", "scene": None, "speed": 1.0, "looped": False}


@pytest.mark.parametrize(
    ("each", "found"),
    [
        (({"source": "x"}, {"scene": SCENE}), ["source", "scene"]),
        (({"scene": SCENE}, CONNECT), ["source", "scene"]),
        (({"recording": None}, CONNECT, Note("n")), ["recording", "source", "scene", Note("n")]),
        ((Seek(1.0, 0.0), Seek(2.0, 0.0), {"region": Region()}), [Seek(2.0, 0.0), "region"]),
        ((Seek(1.0, 0.0), Seek(None, 2.0)), [Seek(1.0, 0.0), Seek(None, 2.0)]),
        ((Seek(1.0, 1.0, True), Seek(2.0, 1.0)), [Seek(1.0, 1.0, True), Seek(2.0, 1.0)]),
        ((Seek(1.0, 1.0, True), Seek(2.0, 1.0, False)), [Seek(2.0, 1.0, False)]),
        ((StepFrames(1), StepFrames(1)), [StepFrames(1), StepFrames(1)]),
        (({"window_state": b"mine"},), []),
    ],
)
def test_the_engine_does_the_difference_in_the_order_of_the_requests(
    each: tuple[Any, ...], found: list[Any]
) -> None:
    assert told(*each).since(0) == found


@pytest.mark.slow
def test_an_engine_behind_a_bad_line_ends_up_as_requested(tmp_path, monkeypatch) -> None:
    lines: list[BadLine] = []
    connect = RequestSender.connect

    def badly(sender: RequestSender, line: Any, known: int = 0) -> None:
        lines.append(BadLine(random.Random(3), line.send, line.close))
        connect(sender, lines[-1], known)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(RequestSender, "connect", badly)

    def wait_for(ask: Callable[[], Any]) -> Any:
        end = time.monotonic() + 30.0
        while not (answer := ask()) and time.monotonic() < end:
            time.sleep(0.02)
        return answer

    with Engine() as engine:
        for name in ("sim:centre", "sim:circle", "sim:line"):
            engine.connect(name)
            engine.note(f"at {name}")
            engine.set_up(Setup(4, 4))
            engine.set_up(Setup(5, 6))
            engine.record(tmp_path / f"{name[4:]}.mcap")
        lines[-1].mend()

        assert wait_for(lambda: engine.status().setup == Setup(5, 6) and engine.status().slot)
        status = wait_for(lambda: (s := engine.status()).recording.path.endswith("line.mcap") and s)
        assert status.source == "sim:line"
        assert status.recording.active
        notes = [event.text for event in status.events if event.kind == "note"]
        assert notes == ["at sim:centre", "at sim:circle", "at sim:line"]
