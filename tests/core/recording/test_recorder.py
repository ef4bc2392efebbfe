"""What is live to a file and back: bit for bit, whatever happens to the process meanwhile."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Message as TheirMessage
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory

from kappaskin import Calibration, Refusal, Region, Setup, load_scene, write_scene
from kappaskin._processes import BackgroundProcess
from kappaskin.calibration import Tare
from kappaskin.calibration.calibration import fingerprint
from kappaskin.live import STREAMING, Engine, Status
from kappaskin.pipeline import setup_from_text
from kappaskin.recording import Recording, Verification
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import MessageLayout, decode
from kappaskin.recording.writing import part_of
from kappaskin.scenes.effects import SECOND_GENERATION_LOOPS, CorruptedFrames, Creep, DroppedFrames
from kappaskin.sources import open_source

pytestmark = pytest.mark.slow

CIRCLE = load_scene("circle")


def wait_for(ask: Callable[[], Any], within: float = 30.0) -> Any:
    """The first answer that is true, or the last one."""
    end = time.monotonic() + within
    while not (answer := ask()) and time.monotonic() < end:
        time.sleep(0.01)
    return answer


def verdict_of(path: Path) -> Verification:
    """As `kappaskin verify` finds it: in a process of one thread."""
    with BackgroundProcess[float | Verification]("verify", Verification.steps, path) as work:
        *_, verdict = work.wait()
    assert isinstance(verdict, Verification)
    return verdict


@pytest.fixture
def engine() -> Iterator[Engine]:
    with Engine() as made:
        yield made


def streaming(engine: Engine, frames: int = 50) -> Status:
    """Once so many frames have been computed with the setup that was asked for."""

    def ask() -> bool:
        status = engine.status()
        latest = engine.latest(status)
        return status.state == STREAMING and not status.computing and latest is not None

    assert wait_for(ask), engine.status()
    first, seen = engine.status().accounting.accepted, set[int]()

    def enough() -> bool:
        status = engine.status()
        latest = engine.latest(status)
        seen.update([latest.sequence] if latest is not None else [])
        return status.accounting.accepted >= first + frames and len(seen) > 10

    assert wait_for(enough, 30.0)
    return engine.status()


def ended(engine: Engine) -> Status:
    """Once what was recorded is whole."""
    engine.record(None)
    assert wait_for(lambda: not engine.status().recording.active)
    return engine.status()


def calibration() -> Calibration:
    """One with loops and creep in every channel."""
    sensor = CIRCLE.sensor()
    C = sensor.channels
    rng = np.random.default_rng(3)
    return Calibration(
        sensor.name,
        sensor.serial_number,
        sensor.firmware,
        fingerprint(sensor.layout),
        datetime.now(UTC),
        rng.uniform(0.9, 1.1, C),
        rng.normal(0, 0.1, C),
        np.full(C, 0.01),
        np.full(C, 0.01),
        SECOND_GENERATION_LOOPS.operator(C),
        Creep(0.05, 0.7).solid(C),
    )


def tare() -> Tare:
    sensor = CIRCLE.sensor()
    C, mark = sensor.channels, fingerprint(sensor.layout)
    offset = np.random.default_rng(4).normal(0, 0.1, C)
    known = sensor.name, sensor.serial_number, mark, datetime.now(UTC), 23.5
    return Tare(*known, 500, 1.0, offset, np.full(C, 0.01))


SETUPS = {
    "least squares": Setup(),
    "robust": Setup(method="robust", Ni=6),
    "tracking": Setup(method="tracking", Ni=6, Nj=6),
    "calibrated": Setup(calibration=calibration(), tare=tare()),
}


@pytest.mark.cases("calibrated")
@pytest.mark.parametrize("name", SETUPS)
def test_what_was_live_comes_out_of_its_bytes_again_bit_for_bit(name, engine, tmp_path) -> None:
    """Begun in the middle, with all that is remembered; then with other settings."""
    path, scene = tmp_path / "a.mcap", tmp_path / "circle.toml"
    # It takes in every frame, and of 500 a second it would never have done.
    rate = 100.0 if name == "tracking" else CIRCLE.rate
    scene.write_text(write_scene(replace(CIRCLE, rate=rate)))
    engine.set_up(SETUPS[name])
    engine.connect(f"sim:{scene}")
    streaming(engine, 200)
    engine.record(path)
    streaming(engine, 100)
    engine.set_up(replace(SETUPS[name], Nj=7, hold=0.2))
    assert wait_for(lambda: engine.status().setup.Nj == 7)
    streaming(engine, 100)
    ended(engine)

    verdict = verdict_of(path)
    assert verdict.same, verdict.words
    assert verdict.compared > 5
    assert verdict.frames >= 200
    with Recording(path) as recording:
        said = [decode(m.STRING, got.data)["data"] for got in recording.messages_on(m.SETUP)]
        setups = [setup_from_text(text, recording.attachment) for text in said]
    assert setups == [SETUPS[name], replace(SETUPS[name], Nj=7, hold=0.2)]


@pytest.mark.full
def test_so_does_a_part_of_the_skin_scanned_at_a_time(engine, tmp_path) -> None:
    path = tmp_path / "a.mcap"
    engine.connect("sim:circle")
    engine.scan(Region("skin", 0.025))
    streaming(engine, 200)
    engine.record(path)
    streaming(engine, 300)
    ended(engine)
    assert verdict_of(path).same


@pytest.mark.full
def test_so_does_a_scene_that_becomes_another_skin(engine, tmp_path) -> None:
    path = tmp_path / "a.mcap"
    engine.record(path)
    engine.connect("sim:centre")
    streaming(engine)
    engine.play(load_scene("calibration"))
    assert wait_for(lambda: engine.status().connections == 2)
    streaming(engine)
    engine.connect("sim:circle")
    assert wait_for(lambda: engine.status().connections == 3)
    streaming(engine)
    ended(engine)
    verdict = verdict_of(path)
    assert verdict.same, verdict.words
    with Recording(path) as recording:
        assert recording.attachments == ("scene-0.toml", "scene-1.toml", "scene-2.toml")
        assert recording.counts[m.DEVICE.name] == 3


@pytest.mark.cases("True")
@pytest.mark.parametrize("from_the_beginning", [True, False])
def test_so_does_a_device_on_a_bad_line(from_the_beginning, engine, tmp_path) -> None:
    pytest.importorskip("pty", reason="no pseudo-terminals on this system")
    from kappaskin.sources import PseudoDevice

    path = tmp_path / "a.mcap"
    bad = (DroppedFrames(0.05), CorruptedFrames(0.05))
    device = PseudoDevice(replace(CIRCLE, effects=(*CIRCLE.effects, *bad)))
    with serving(device):
        if from_the_beginning:
            engine.record(path)
        engine.connect(device.port)
        streaming(engine, 300)
        engine.record(path)
        if not from_the_beginning:
            streaming(engine, 600)
        status = ended(engine)
        engine.disconnect()
    verdict = verdict_of(path)
    assert verdict.same, verdict.words
    assert verdict.compared > 20
    assert status.accounting.lost > 0
    with Recording(path) as recording:
        taken = [decode(m.CONTACT, got.data)["taken"] for got in recording.messages_on(m.CONTACTS)]
    assert np.isfinite(taken[-1])


class serving:
    """A device that serves meanwhile."""

    def __init__(self, device: Any) -> None:
        import threading

        self._device, self._stop = device, threading.Event()
        self._thread = threading.Thread(target=device.serve, args=(self._stop.is_set,))

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(30.0)
        self._device.close()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """Half a second and more of a simulated skin, with a note."""
    path = tmp_path_factory.mktemp("recorder") / "circle.mcap"
    with Engine() as engine:
        engine.connect("sim:circle")
        streaming(engine)
        engine.record(path)
        streaming(engine)
        engine.note("the object is a ball")
        streaming(engine, 200)
        ended(engine)
    return path


def theirs(path: Path) -> dict[str, list[Any]]:
    """Every message of every topic, by the decoders of others."""
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message, decoded))
    return found


@pytest.mark.full
def test_every_channel_is_read_by_the_decoders_of_others(recorded) -> None:
    found = theirs(recorded)
    silent = {m.LEFT_OUTS.name, m.SECONDS.name}  # of a healthy skin, touched in one place
    assert set(found) == {topic.name for topic in m.TOPICS} - silent
    contacts = {got.sequence: got for _, got in found[m.CONTACTS.name]}
    for (_, pose), (_, cloud), (_, shape), (_, readings), (_, counts) in zip(
        *(found[t.name] for t in (m.POSES, m.SKIN, m.SHAPES, m.CURVATURES, m.COUNT)), strict=True
    ):
        contact = contacts[shape.sequence]
        assert contact.present
        where = pose.pose.position
        assert [where.x, where.y, where.z] == list(contact.point)
        turn = pose.pose.orientation
        assert [*normal_of(turn)] == pytest.approx(contact.frame[6:], abs=1e-12)
        assert shape.shape == [8, 8]
        assert len(shape.coefficients) == 64
        points = np.frombuffer(cloud.data, "<f4").reshape(cloud.width, -1)
        names = [field.name for field in cloud.fields]
        assert names == ["x", "y", "z", "displacement", "xx", "yy", "xy"]
        assert (cloud.point_step, cloud.row_step) == (28, 2800)
        np.testing.assert_allclose(points[:, 4:].T.ravel(), readings.curvature, rtol=1e-6)
        np.testing.assert_allclose(points[:, 2], -points[:, 3], atol=1e-9)
        assert counts.channels == list(range(300))
        assert len(counts.counts) == 300
    assert [got.msg for _, got in found[m.EVENTS.name]] == ["the object is a ball"]


def normal_of(q: Any) -> tuple[float, float, float]:
    """Where a unit quaternion turns z to."""
    x, y, z, w = q.x, q.y, q.z, q.w
    return 2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)


def test_times_are_those_of_the_wall_and_rates_are_bounded(recorded) -> None:
    found = theirs(recorded)
    for topic, most in ((m.CONTACTS, 1000.0), (m.COUNT, 50.0), (m.SKIN, 50.0)):
        messages = found[topic.name]
        stamps = np.array([message.log_time for message, _ in messages]) * 1e-9
        assert abs(stamps[-1] - time.time()) < 600
        assert len(stamps) <= most * (stamps[-1] - stamps[0]) + 6
        first = messages[0][1].header.stamp
        assert first.sec * 10**9 + first.nanosec == messages[0][0].log_time


def rewritten(path: Path, out: Path, change: Callable[[str, TheirMessage], bytes | None]) -> Path:
    """A copy of a recording with other messages: those of `change`, None for none."""
    with path.open("rb") as file, out.open("wb") as copy:
        writer = Writer(copy)
        writer.start("ros2", "kappaskin changed")
        numbers = {}
        for name, kind in m.TOPICS:
            schema = writer.register_schema(kind.name, "ros2msg", kind.definition)
            numbers[name] = writer.register_channel(name, "cdr", schema)
        reader = make_reader(file)
        for _, channel, message in reader.iter_messages(log_time_order=False):
            data = change(channel.topic, message)
            if data is not None:
                stamp, to = message.log_time, numbers[channel.topic]
                writer.add_message(to, stamp, data, stamp, message.sequence)
        writer.finish()
    return out


def test_the_first_difference_is_found(recorded, tmp_path) -> None:
    changed = list[int]()

    def harder(topic: str, message: TheirMessage) -> bytes:
        if topic != m.CONTACTS.name or message.sequence < 5:
            return message.data
        said = decode(m.CONTACT, message.data)
        changed.append(said["sequence"])
        said["force"] = np.nextafter(said["force"], np.inf)
        head = {"header.frame_id": said.pop("header.frame_id")}
        return MessageLayout(m.CONTACT, head)(said)

    verdict = verdict_of(rewritten(recorded, tmp_path / "changed.mcap", harder))
    assert not verdict.same
    assert verdict.different == len(changed)
    assert f"frame {changed[0]} at" in verdict.first
    assert "force was" in verdict.first
    assert 0 < verdict.largest < 1e-15


def test_estimates_of_which_the_bytes_are_gone_are_missed(recorded, tmp_path) -> None:
    def gone(topic: str, message: TheirMessage) -> bytes | None:
        return None if topic == m.LINES.name and message.sequence % 2 else message.data

    verdict = verdict_of(rewritten(recorded, tmp_path / "half.mcap", gone))
    assert not verdict.same
    assert verdict.missing > 0
    assert not verdict.different


def test_without_estimates_there_is_no_verdict(recorded, tmp_path) -> None:
    def bare(topic: str, message: TheirMessage) -> bytes | None:
        return message.data if topic in (m.LINES.name, m.DEVICE.name) else None

    verdict = verdict_of(rewritten(recorded, tmp_path / "bare.mcap", bare))
    assert not verdict.same
    assert "nothing to compare" in verdict.words


# What the process goes through


def test_killed_at_any_moment_half_a_second_is_lost_at_most(tmp_path) -> None:
    lost = list[float]()
    for n, recording_for in enumerate((0.3, 0.71, 1.13)):
        path = tmp_path / f"{n}.mcap"
        with Engine() as engine:
            engine.connect("sim:circle")
            streaming(engine)
            engine.record(path)
            assert wait_for(lambda engine=engine: engine.status().recording.messages > 50)
            time.sleep(recording_for)
            assert engine.pid is not None
            os.kill(engine.pid, signal.SIGKILL)
            killed = time.time()
        with Recording(part_of(path)) as recording:
            assert not recording.whole
            lost.append(killed - recording.last * 1e-9)
            assert recording.counts[m.LINES.name] > 0
    assert np.median(lost) < 0.5  # once a busy machine may have stood still


@pytest.mark.full
def test_after_it_died_it_goes_on_beside_what_it_had(engine, tmp_path) -> None:
    engine.connect("sim:circle")
    engine.record(tmp_path / "a.mcap")
    streaming(engine)
    os.kill(engine.pid, signal.SIGKILL)
    assert wait_for(lambda: not engine.alive)
    engine.revive()
    streaming(engine)
    status = ended(engine)
    assert status.recording.path == str(tmp_path / "a-2.mcap")
    assert sorted(os.listdir(tmp_path)) == ["a-2.mcap", "a.mcap.part"]
    assert verdict_of(tmp_path / "a-2.mcap").same


@pytest.mark.full
def test_one_whose_parent_is_gone_ends_its_file(tmp_path) -> None:
    path = tmp_path / "a.mcap"
    command = [sys.executable, "-m", "kappaskin", "record", "sim:circle", str(path)]
    with subprocess.Popen(command) as process:
        try:
            part = part_of(path)
            assert wait_for(lambda: part.exists() and part.stat().st_size > 50_000)
        finally:
            process.kill()
    assert wait_for(path.exists)
    with Recording(path) as recording:
        assert recording.whole


def test_closing_ends_the_file(tmp_path) -> None:
    with Engine() as engine:
        engine.connect("sim:circle")
        engine.record(tmp_path / "a.mcap")
        streaming(engine)
    assert verdict_of(tmp_path / "a.mcap").same


def test_where_no_file_can_be_the_session_goes_on(engine, tmp_path) -> None:
    engine.connect("sim:circle")
    engine.record(tmp_path / "no" / "a.mcap")
    assert wait_for(lambda: "cannot be written" in engine.status().recording.trouble)
    streaming(engine)
    part_of(tmp_path / "b.mcap").write_bytes(b"")
    engine.record(tmp_path / "b.mcap")
    assert wait_for(lambda: "already exists" in engine.status().recording.trouble)
    engine.record(tmp_path / "c.mcap")
    streaming(engine)
    part_of(tmp_path / "c.mcap").unlink()
    assert wait_for(lambda: "moved or removed" in engine.status().recording.trouble)
    status = streaming(engine)
    assert [event.kind for event in status.events] == ["recording"]
    assert not status.recording.active


def test_a_replay_is_not_recorded_again(engine, recorded, tmp_path) -> None:
    engine.connect(f"replay:{recorded}")
    wait_for(lambda: engine.status().state == STREAMING)
    engine.record(tmp_path / "b.mcap")
    assert wait_for(lambda: "got a recording; copy its file" in engine.status().recording.trouble)
    assert not list(tmp_path.iterdir())


def test_a_recording_goes_on_over_a_replay_of_which_it_has_nothing(
    engine, recorded, tmp_path
) -> None:
    path = tmp_path / "a.mcap"
    engine.connect("sim:centre")
    streaming(engine)
    engine.record(path)
    streaming(engine)
    engine.connect(f"replay:{recorded}")
    wait_for(lambda: engine.status().replay is not None)
    wait_for(lambda: engine.latest(engine.status()))
    engine.connect("sim:circle")
    streaming(engine)
    ended(engine)
    verdict = verdict_of(path)
    assert verdict.same, verdict.words


# Played again


def test_a_recording_is_a_source_like_any_other(recorded) -> None:
    with closing(open_source(f"replay:{recorded}")) as source:
        end, frames = time.monotonic() + 60, []
        while time.monotonic() < end and (not frames or source.replay.at < source.length):
            frames += source.read(0.05)
        while last := source.read(0.05):  # so many are given at once
            frames += last
        accounting = source.accounting()
        assert source.sensor is not None
        assert source.sensor.simulated
    with Recording(recorded) as recording:
        assert len(frames) == recording.counts[m.LINES.name]
    assert np.all(np.diff([frame.sequence for frame in frames]) >= 1)
    assert np.all(np.diff([frame.taken for frame in frames]) > 0)
    assert all(frame.truth is not None and frame.taken_sd == 0 for frame in frames)
    assert accounting.balanced
    assert accounting.accepted == len(frames)


def test_what_cannot_be_replayed_is_refused(recorded, tmp_path, engine) -> None:
    def bare(topic: str, message: TheirMessage) -> bytes | None:
        return None if topic == m.LINES.name else message.data

    empty = rewritten(recorded, tmp_path / "bare.mcap", bare)
    for path, why in ((tmp_path / "none.mcap", "cannot be read"), (empty, "got none in it")):
        with pytest.raises(Refusal, match=why):
            open_source(f"replay:{path}")
    engine.connect(f"replay:{tmp_path / 'none.mcap'}")
    assert wait_for(lambda: "cannot be read" in engine.status().message)
