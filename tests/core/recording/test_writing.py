"""The file of a recording: whole or up to where it breaks off, and what it may not be."""

import os
import struct

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from kappaskin import Refusal
from kappaskin.errors import Damaged
from kappaskin.recording import ExportRequest, Recording, Repaired, writing
from kappaskin.recording import messages as m
from kappaskin.recording import reading as records
from kappaskin.recording.writing import RecordingFile, part_of

LINE = m.pack_line(0.0, False, bytes(600))


def recorded(path, written_out, messages=200):
    """A recording of so many messages 1 ms after each other, with an event and a file."""
    file = RecordingFile(path)
    for n in range(messages):
        file.put(m.LINES, n * 1e-3, m.pack_line(n * 1e-3, False, bytes([n % 256]) * 600))
        if n % 50 == 25:
            written_out(file)
    file.attach("scene.toml", "application/toml", b"a = 1")
    file.close()
    return file


@pytest.fixture(scope="module")
def whole(tmp_path_factory, written_out):
    path = tmp_path_factory.mktemp("recording") / "whole.mcap"
    recorded(path, written_out)
    return path


def test_a_file_has_another_name_until_it_is_whole(tmp_path) -> None:
    path = tmp_path / "a.mcap"
    file = RecordingFile(path)
    assert part_of(path).exists()
    assert not path.exists()
    file.put(m.LINES, 1.0, LINE)
    file.close()
    assert path.exists()
    assert not part_of(path).exists()
    assert os.listdir(tmp_path) == ["a.mcap"]  # nothing that was kept in reserve
    assert (file.written.active, file.written.messages, file.written.trouble) == (False, 1, "")
    assert file.written.size > 0


def test_others_read_what_was_written_in_order(whole) -> None:
    with whole.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        messages = [message for _, _, message in reader.iter_messages()]
        attachments = list(reader.iter_attachments())
        header = reader.get_header()
    assert summary.statistics.message_count == len(messages) == 200
    assert [message.sequence for message in messages] == list(range(200))
    assert len(summary.chunk_indexes) > 3
    assert [(a.name, a.data) for a in attachments] == [("scene.toml", b"a = 1")]
    assert (header.profile, header.library.split()[0]) == ("ros2", "kappaskin")
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}


def test_so_do_we(whole) -> None:
    with Recording(whole) as recording:
        assert recording.whole
        assert recording.counts == {m.LINES.name: 200}
        messages = list(recording.messages())
        assert [m.unpack_line(got.data)[0] for got in messages] == [n * 1e-3 for n in range(200)]
        assert recording.attachments == ("scene.toml",)
        assert recording.attachment("scene.toml") == b"a = 1"
        assert recording.last - recording.first == pytest.approx(199e6, abs=2)
        assert list(recording.messages_on(m.EVENTS)) == []
        at = recording.first + 100_000_000
        before = recording.last_before(m.LINES, at)
        assert before is not None
        assert before.stamp == at
        assert recording.last_before(m.LINES, recording.first - 1) is None
        with pytest.raises(Refusal, match="no attachment 'none'"):
            recording.attachment("none")


def test_one_that_breaks_off_anywhere_is_read_up_to_there(whole, tmp_path) -> None:
    data, path, seen = whole.read_bytes(), tmp_path / "cut.mcap", set()
    for size in [*range(60, len(data), len(data) // 60), len(data) - 1]:
        path.write_bytes(data[:size])
        try:
            with Recording(path) as recording:
                found = [got.data for got in recording.messages()]
                assert not recording.whole
        except Refusal:
            assert size < 6000  # before the channels
            continue
        assert [m.unpack_line(d)[0] for d in found] == [n * 1e-3 for n in range(len(found))]
        seen.add(len(found))
    assert len(seen) > 3


def test_nothing_else_is_taken_for_a_recording(tmp_path) -> None:
    path = tmp_path / "x.mcap"
    with pytest.raises(Refusal, match="cannot be read"):
        Recording(path)
    with pytest.raises(Refusal, match="cannot be read"):
        Recording(tmp_path)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        for read in (Recording, lambda pipe: list(Repaired.steps(pipe, path))):
            with pytest.raises(Refusal, match="it is not a file"):
                read(tmp_path / "pipe")
    for data in (b"", b"\x89PNG\r\n\x1a\n" + bytes(100), records.MAGIC, records.MAGIC * 20):
        path.write_bytes(data)
        with pytest.raises(Refusal, match="recording"):
            Recording(path)
    with path.open("wb") as file:
        other = Writer(file)
        other.start("", "another")
        schema = other.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = other.register_channel("/chatter", "cdr", schema)
        other.add_message(channel, 0, b"", 0)
        other.finish()
    with pytest.raises(Refusal, match="got an MCAP file of 'another'"):
        Recording(path)


@pytest.mark.parametrize("later", [3, 10**12])
def test_one_of_a_later_version_is_refused(later, tmp_path, monkeypatch, written_out) -> None:
    monkeypatch.setattr(writing, "FORMAT", later)
    recorded(tmp_path / "later.mcap", written_out, 3)
    with pytest.raises(Refusal, match=r"format 2, got [13].*update this program"):
        Recording(tmp_path / "later.mcap")


def test_a_header_that_is_cut_off_is_said_to_be(tmp_path) -> None:
    path = tmp_path / "broken.mcap"
    path.write_bytes(records.MAGIC + struct.pack("<BQI", 1, 7, 2**32 - 1) + b"abc")
    with pytest.raises(Damaged, match=r"a header cannot be read \(it is cut off\)"):
        Recording(path)


def test_our_own_that_breaks_off_at_once_is_not_called_anothers(whole, tmp_path) -> None:
    path = tmp_path / "broken.mcap"
    with Recording(whole) as recording:
        path.write_bytes(whole.read_bytes()[: recording.chunks[0].at + 20])
    with pytest.raises(Damaged, match="none before the damaged part"):
        Recording(path)


def spoilt(whole, path, change):
    """A copy of which the first chunk is changed by a function of its record."""
    with whole.open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True).records)
    chunk = next(record for record in records if isinstance(record, Chunk))
    data, packed = whole.read_bytes(), chunk.data
    at = data.index(packed)
    path.write_bytes(change(data, at, packed))


def test_a_bomb_takes_no_memory(whole, tmp_path) -> None:
    """A chunk of some kB that says it holds little, and holds twice what may be in one."""
    bomb, path = zstandard.compress(bytes(2**27)), tmp_path / "bomb.mcap"

    def chunk(size):
        body = struct.pack("<QQQII4sQ", 0, 1, size, 0, 4, b"zstd", len(bomb)) + bomb
        return (
            records.MAGIC
            + b"\1"
            + struct.pack("<QII", 8, 0, 0)
            + b"\6"
            + struct.pack("<Q", len(body))
            + body
        )

    for size in (2**27, 1000):
        path.write_bytes(chunk(size))
        with pytest.raises(Refusal):
            Recording(path)
    body = chunk(1000)
    for size in (2**27, 1000):
        with pytest.raises(records.CorruptRecord):
            records.unpacked(chunk(size)[len(body) - len(bomb) - 44 :])


def test_no_size_that_a_file_claims_is_believed(whole, tmp_path) -> None:
    data, path = whole.read_bytes(), tmp_path / "claims.mcap"
    for at in range(9, len(data) - 8, 997):
        for claim in (2**63, 2**40, 2**32 - 1, 0):
            path.write_bytes(data[:at] + struct.pack("<Q", claim) + data[at + 8 :])
            try:
                with Recording(path) as recording:
                    for _ in recording.messages():
                        pass
            except Refusal:
                continue


def test_a_damaged_chunk_is_said_to_be_one(whole, tmp_path) -> None:
    path = tmp_path / "flipped.mcap"
    spoilt(whole, path, lambda data, at, _: data[:at] + b"\xff" + data[at + 1 :])
    with Recording(path) as recording, pytest.raises(Refusal, match=r"damaged at byte.*repair"):
        list(recording.messages())


@pytest.mark.parametrize(
    "use",
    [
        RecordingFile,
        Recording,
        lambda path: list(Repaired.steps(path, path)),
        lambda path: ExportRequest(path, path),
    ],
    ids=["record", "read", "repair", "export"],
)
def test_a_name_that_no_file_can_have_is_refused(use, tmp_path) -> None:
    with pytest.raises(Refusal, match=r"cannot be (accessed|read) \(File name too long\)"):
        use(tmp_path / f"{'x' * 300}.csv")
