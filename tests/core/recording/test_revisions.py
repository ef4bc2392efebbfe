"""Recordings of another revision of the estimates: what `verify` and `info` report of them."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from kappaskin.cli import main
from kappaskin.errors import Refusal
from kappaskin.live import Engine
from kappaskin.pipeline import REVISION, Pipeline, Setup
from kappaskin.recording import Recording, Repaired, ReplayedSource, Verification
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import MessageLayout, decode

OLD = Path(__file__).parents[1] / "pipeline" / "before-revisions.mcap"


def verdict_of(path: Path) -> Verification:
    *_, verdict = Verification.steps(path)
    assert isinstance(verdict, Verification)
    return verdict


def rewritten(path: Path, out: Path, revision: int | None, **changes: Callable[[Any], Any]) -> Path:
    """A copy made by another `revision`, or none, with other numbers in its contacts."""
    with path.open("rb") as file, out.open("wb") as copy:
        writer, numbers = Writer(copy), dict[str, int]()
        writer.start("ros2", "kappaskin 9.8")
        if revision is not None:
            writer.add_metadata("kappaskin", {"format": "1", "revision": str(revision)})
        for name, kind in m.TOPICS:
            schema = writer.register_schema(kind.name, "ros2msg", kind.definition)
            numbers[name] = writer.register_channel(name, "cdr", schema)
        for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
            data = message.data
            if channel.topic == m.CONTACTS.name:
                fields = decode(m.CONTACT, data)
                fields |= {name: change(fields[name]) for name, change in changes.items()}
                data = MessageLayout(m.CONTACT, {"header.frame_id": m.FRAME})(
                    {name: value for name, value in fields.items() if name != "header.frame_id"}
                )
            stamp, to = message.log_time, numbers[channel.topic]
            writer.add_message(to, stamp, data, stamp, message.sequence)
        writer.finish()
    return out


def test_a_recording_says_who_made_it(recording: Path) -> None:
    with Recording(recording) as opened, Recording(OLD) as old:
        assert (opened.revision, old.revision) == (REVISION, 0)
        assert opened.made_by == f"{opened.library}, revision {REVISION}"
        assert old.made_by == "kappaskin 0.2.0, revision unknown"


def test_an_unfinished_and_a_repaired_recording_say_so_too(recording: Path, tmp_path: Path) -> None:
    cut, out = tmp_path / "cut.mcap.part", tmp_path / "cut.mcap"
    cut.write_bytes(recording.read_bytes()[: recording.stat().st_size // 2])
    assert isinstance([*Repaired.steps(cut, out)][-1], Repaired)
    for path in (cut, out):
        with Recording(path) as opened:
            assert opened.revision == REVISION


@pytest.mark.parametrize("text", ["", "-1", "x", "1" * 400, "\N{SUPERSCRIPT TWO}"])
def test_a_revision_that_is_none_is_read_without_an_error(text: str) -> None:
    from kappaskin.recording.reading import _number

    assert 0 <= _number({"revision": text}, "revision", 0) < 10**9


def test_results_of_the_same_revision_are_the_same_bit_for_bit(
    recording: Path, tmp_path: Path
) -> None:
    verdict = verdict_of(recording)
    assert verdict.same
    assert verdict.passed
    assert verdict.words.endswith(": the same bit for bit")
    changed = rewritten(recording, tmp_path / "a.mcap", REVISION, force=lambda f: f * (1 + 1e-15))
    verdict = verdict_of(changed)
    assert not verdict.passed
    assert "not the same" in verdict.words
    assert verdict.changed == ()


@pytest.mark.parametrize("revision", [None, 0, REVISION + 1])
def test_of_another_revision_the_largest_difference_of_each_quantity_is_reported(
    revision: int | None, recording: Path, tmp_path: Path
) -> None:
    def without(noise: float) -> float:
        return np.nan

    changes = {"force": lambda f: 1.25 * f, "single": lambda s: not s, "noise": without}
    other = rewritten(recording, tmp_path / "a.mcap", revision, **changes)
    verdict = verdict_of(other)
    assert verdict.another
    assert verdict.passed
    assert not verdict.same
    told = dict(line.split(": ", 1) for line in verdict.changed)
    assert told.keys() == {"force", "single", "noise"}
    assert " N at most, 0.2 of the largest recorded number (" in told["force"]
    count = verdict.different
    for name in ("single", "noise"):
        assert told[name] == (
            f"another value, or a number in one only, in {count:,} ({count:,} differ)"
        )
    assert "recomputed by another revision" in verdict.words
    assert f"recorded by kappaskin 9.8, revision {revision or 'unknown'}," in verdict.words
    assert f"revision {REVISION}" in verdict.words.partition("recomputed by kappaskin")[2]


def test_results_that_cannot_be_recomputed_are_a_failure_of_any_revision(recording: Path) -> None:
    verdict = replace(verdict_of(recording), another=True)
    assert verdict.passed
    assert not replace(verdict, missing=1).passed
    assert not replace(verdict, compared=0).passed


@pytest.fixture
def played(recording: Path, tmp_path: Path) -> Iterator[ReplayedSource]:
    """One whose forces another revision found twice as large, at rest at 0.3 s."""
    clock, other = [0.0], rewritten(recording, tmp_path / "a.mcap", None, force=lambda f: 2 * f)
    source = ReplayedSource(other, lambda: clock[0])
    source.seek(0.3, 0.0)
    yield source
    source.close()


def test_a_replay_shows_what_was_recorded_until_it_is_asked_to_recompute(
    played: ReplayedSource,
) -> None:
    (frame,) = played.read(0.0)
    pipeline = Pipeline(played.sensor, Setup())
    again = pipeline(frame)

    shown = played.as_recorded(again, pipeline)

    assert played.replay.shows_recorded
    assert played.replay.made_by == "kappaskin 9.8, revision unknown"
    assert shown.contact.force == pytest.approx(2 * again.contact.force, rel=1e-12)
    for name in ("coefficients", "curvature", "surface", "residual", "error_rms", "error_at_load"):
        now, was = getattr(shown, name), getattr(again, name)
        np.testing.assert_allclose(now, was, rtol=1e-9, atol=1e-12, err_msg=name)
    np.testing.assert_allclose(shown.geometry.frame, again.geometry.frame, atol=1e-12)
    played.recomputes = True
    assert played.as_recorded(again, pipeline) is again
    assert not played.replay.shows_recorded


def test_with_other_settings_than_recorded_a_replay_is_recomputed(played: ReplayedSource) -> None:
    (frame,) = played.read(0.0)
    for setup, recorded in ((Setup(6, 7), False), (Setup(nx=33, ny=17), True)):
        pipeline = Pipeline(played.sensor, setup)
        played.as_recorded(pipeline(frame), pipeline)
        assert played.replay.shows_recorded is recorded
    played.seek(0.9, 0.0)
    (frame,) = played.read(0.0)
    for setup, recorded in ((Setup(), False), (Setup(6, 7), True)):
        pipeline = Pipeline(played.sensor, setup)
        played.as_recorded(pipeline(frame), pipeline)
        assert played.replay.shows_recorded is recorded


@pytest.mark.slow
def test_the_engine_shows_what_was_recorded_until_it_is_asked_to_recompute(
    recording: Path, tmp_path: Path
) -> None:
    other = rewritten(recording, tmp_path / "a.mcap", None, force=lambda f: 2 * f)

    def force_once(recorded: bool) -> float:
        end = time.monotonic() + 60
        while time.monotonic() < end:
            status = engine.status()
            estimate = engine.latest(status)
            same = status.replay is not None and status.replay.shows_recorded == recorded
            if same and estimate is not None and estimate.contact.present:
                return estimate.contact.force
            time.sleep(0.02)
        raise AssertionError("it never showed that")

    with Engine(Setup()) as engine:
        engine.connect(f"replay:{other}")
        engine.seek(0.3, 0.0)
        recorded = force_once(recorded=True)
        engine.recompute(True)
        assert force_once(recorded=False) == pytest.approx(recorded / 2, rel=1e-9)
        engine.recompute(False)
        assert force_once(recorded=True) == recorded


@pytest.mark.slow
def test_the_command_reports_both_revisions_and_succeeds(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    other = rewritten(recording, tmp_path / "a.mcap", None, force=lambda f: 2 * f)
    assert main(["verify", str(other)]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert "recomputed by another revision: recorded by kappaskin 9.8, revision unknown" in first
    assert second.startswith("  force: ")
    assert main(["info", str(OLD)]) == 0
    assert "by kappaskin 0.2.0, revision unknown" in capsys.readouterr().out
    ours = rewritten(recording, tmp_path / "b.mcap", REVISION, force=lambda f: 2 * f)
    assert main(["verify", str(ours)]) == 1
    assert "not the same" in capsys.readouterr().out


def test_recordings_before_revisions_still_come_to_what_they_held() -> None:
    """As far as this revision reads them as that one did."""
    verdict = verdict_of(OLD)
    assert verdict.passed
    assert verdict.frames == 20
    assert verdict.compared == 60
    assert verdict.another
    shapes = {change.name: change for change in verdict.changes}
    assert shapes.keys().isdisjoint({"sequence", "device_time", "host_time", "curvature"})


def test_a_device_text_that_was_edited_wrongly_is_named(recording, tmp_path, capsys) -> None:
    edited = tmp_path / "edited.mcap"
    with recording.open("rb") as file, edited.open("wb") as copy:
        writer = Writer(copy, compression=CompressionType.NONE)
        writer.start("ros2", "kappaskin 9.8")
        numbers = {
            name: writer.register_channel(
                name, "cdr", writer.register_schema(kind.name, "ros2msg", kind.definition)
            )
            for name, kind in m.TOPICS
        }
        for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
            data = message.data.replace(b'"strip":false', b'"strip":12345')
            writer.add_message(numbers[channel.topic], message.log_time, data, message.log_time)
        writer.finish()

    assert main(["info", str(edited)]) == 0
    assert "strip: expected true or false, got 12345" in capsys.readouterr().out
    with pytest.raises(Refusal, match=r"edited\.mcap: .* strip: expected true or false, got 12345"):
        verdict_of(edited)
