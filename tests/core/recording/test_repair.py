"""What is saved of a recording that was damaged, and that it is said what was not."""

import multiprocessing
import random
import time

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from kappaskin import Refusal
from kappaskin.recording import Recording, Repaired, RepairTask
from kappaskin.recording import messages as m
from kappaskin.recording.writing import part_of

CHUNKS, EACH = 12, 40


def content(n):
    """Bytes that do not compress to nothing, a different lot for each message."""
    return random.Random(n).randbytes(300)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A recording in chunks of its own size, so that each can be damaged by itself."""
    path = tmp_path_factory.mktemp("repair") / "whole.mcap"
    with path.open("wb") as out:
        writer = Writer(out, 2**20)
        writer.start("ros2", "kappaskin test")
        numbers = {}
        for name, kind in m.TOPICS:
            schema = writer.register_schema(kind.name, "ros2msg", kind.definition)
            numbers[name] = writer.register_channel(name, "cdr", schema)
        writer.add_attachment(0, 0, "scene.toml", "application/toml", b"a = 1")
        writer.add_metadata("kappaskin", {"format": "1"})
        for chunk in range(CHUNKS):
            for n in range(EACH):
                k = chunk * EACH + n
                data = m.pack_line(k * 1e-3, False, content(k))
                writer.add_message(numbers[m.LINES.name], k, data, k, k)
            writer.flush()
        writer.finish()
    return path


@pytest.fixture
def places(whole):
    """Where the packed bytes of each chunk are."""
    with whole.open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True).records)
    data = whole.read_bytes()
    chunks = [record for record in records if isinstance(record, Chunk)]
    return [(data.index(chunk.data), len(chunk.data)) for chunk in chunks]


def repair(path, out) -> Repaired:
    *_, done = Repaired.steps(path, out)
    return done


@pytest.fixture
def saved(tmp_path):
    """Repairs bytes: what is said, and the numbers of the messages in the new file."""

    def run(data):
        path, out = tmp_path / "damaged.mcap", tmp_path / "out.mcap"
        path.write_bytes(data)
        out.unlink(missing_ok=True)
        done = repair(path, out)
        assert path.read_bytes() == data
        assert set(tmp_path.iterdir()) <= {path, out}
        if not done.total:
            return done, []
        with Recording(out) as recording:
            assert recording.whole
            found = [m.unpack_line(got.data) for got in recording.messages()]
        numbers = [round(time * 1e3) for time, _, _ in found]
        assert all(data == content(n) for n, (_, _, data) in zip(numbers, found, strict=True))
        with out.open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary.statistics.message_count == done.total == len(numbers)
        return done, numbers

    return run


ALL = list(range(CHUNKS * EACH))


def test_of_a_whole_file_nothing_is_lost(whole, saved) -> None:
    done, numbers = saved(whole.read_bytes())
    assert (done.lost, done.attachments, done.ended, numbers) == (0, 1, True, ALL)


def test_one_that_was_never_ended_is(whole, saved, places) -> None:
    at, size = places[-1]
    done, numbers = saved(whole.read_bytes()[: at + size])
    assert (done.lost, done.attachments, done.ended, numbers) == (0, 1, False, ALL)


def test_of_a_chunk_that_is_cut_off_what_comes_before_is_saved_if_it_can_be(
    whole, saved, places
) -> None:
    data = whole.read_bytes()
    at, size = places[5]
    for cut in (at - 20, at, at + 10, at + size - 1):
        done, numbers = saved(data[:cut])
        assert numbers[: 5 * EACH] == ALL[: 5 * EACH]
        assert numbers == ALL[: len(numbers)]
        assert len(numbers) < 6 * EACH
        assert done.lost > 0


def test_a_damaged_chunk_costs_no_other(whole, saved, places) -> None:
    data = bytearray(whole.read_bytes())
    at, size = places[4]
    data[at + size // 2] ^= 1
    done, numbers = saved(bytes(data))
    assert numbers == [n for n in ALL if n // EACH != 4]
    assert 0 < done.lost <= size + 200
    assert done.ended


def test_zeros_holes_and_what_does_not_belong_there_cost_what_they_hit(
    whole, saved, places
) -> None:
    data = whole.read_bytes()
    at, size = places[2]
    last, _ = places[5]
    for spoilt, kept in (
        (data[:at] + bytes(last - at) + data[last:], {0, 1, 6, 7, 8, 9, 10, 11}),
        (data[: at + 5] + data[at + size - 5 :], set(range(CHUNKS)) - {2}),
        (data[: at - 60] + b"what is this" * 50 + data[at - 60 :], set(range(CHUNKS))),
    ):
        done, numbers = saved(spoilt)
        lost_chunks = {n // EACH for n in set(ALL) - set(numbers)}
        assert lost_chunks <= (set(range(CHUNKS)) - kept) | {2, 3}
        assert {n // EACH for n in numbers} >= kept - {2, 3}
        assert done.lost > 0


def test_the_first_chunk_which_tells_of_the_channels_may_be_gone(whole, saved, places) -> None:
    data = whole.read_bytes()
    at, size = places[0]
    for end in (len(data), places[-1][0] + places[-1][1]):  # with the summary, and without
        _, numbers = saved(data[: at + 3] + bytes(size - 6) + data[at + size - 3 : end])
        assert numbers == ALL[EACH:]


def test_the_beginning_may_be_gone(whole, saved) -> None:
    data = whole.read_bytes()
    done, numbers = saved(bytes(20) + data[20:])
    assert numbers == ALL
    assert done.lost > 0


def test_nothing_that_was_not_there_is_ever_saved(whole, saved) -> None:
    rng, data = random.Random(7), whole.read_bytes()
    for _ in range(60):
        spoilt = bytearray(data)
        for _ in range(rng.choice((1, 3, 30))):
            at, size = rng.randrange(len(data)), rng.choice((1, 8, 500))
            spoilt[at : at + size] = rng.randbytes(rng.choice((0, size)))
        try:
            done, numbers = saved(bytes(spoilt))
        except Refusal:
            continue
        assert sorted(set(numbers)) == numbers
        assert done.total == len(numbers)


def test_of_nothing_nothing_is_saved(saved, tmp_path) -> None:
    for data in (b"", b"\x89PNG\r\n\x1a\n" + bytes(500), bytes(5000)):
        with pytest.raises(Refusal, match=r"is empty|expected a recording"):
            saved(data)
    with pytest.raises(Refusal, match="cannot be read"):
        repair(tmp_path / "none.mcap", tmp_path / "x.mcap")
    assert list(tmp_path.glob("*out*")) == list(tmp_path.glob("x*")) == []


def test_a_file_that_is_there_is_not_written_over(whole, tmp_path) -> None:
    out = tmp_path / "there.mcap"
    out.write_bytes(b"mine")
    with pytest.raises(Refusal, match="already exists"):
        repair(whole, out)
    assert out.read_bytes() == b"mine"
    with pytest.raises(Refusal, match="cannot be written"):
        repair(whole, tmp_path / "no" / "folder.mcap")


def test_a_file_of_others_is_repaired_too(tmp_path) -> None:
    path, out = tmp_path / "other.mcap", tmp_path / "out.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start("x", "another")
        channel = writer.register_channel("/a", "json", 0, {"k": "v"})
        for n in range(5):
            writer.add_message(channel, n, b"{}", n + 1, n)
        writer.add_metadata("about", {"a": "b"})
    done = repair(path, out)
    assert (done.messages, done.lost, done.ended) == ({"/a": 5}, 0, False)
    with out.open("rb") as file:
        reader = make_reader(file)
        [(_, channel, message), *_] = list(reader.iter_messages())
        assert (channel.metadata, message.publish_time) == ({"k": "v"}, 1)
        assert [record.metadata for record in reader.iter_metadata()] == [{"a": "b"}]


def test_the_share_that_is_done_is_told(whole, tmp_path) -> None:
    *shares, _ = Repaired.steps(whole, tmp_path / "out.mcap")
    assert shares == sorted(shares)
    assert 0 <= shares[0] < 0.1
    assert shares[-1] > 0.9


@pytest.mark.slow
def test_a_process_of_its_own_saves_as_much(whole, tmp_path) -> None:
    out, told = tmp_path / "out.mcap", list[float | Repaired]()
    work = RepairTask(whole, out)
    while not (told and isinstance(told[-1], Repaired)):
        told += work.poll()
    work.close()
    *_, alone = Repaired.steps(whole, tmp_path / "alone.mcap")
    assert told[-1] == alone
    assert out.exists()


class Far:
    """A file that takes a minute to be found, by a process of its own."""

    def __reduce__(self):
        return time.sleep, (60.0,)


@pytest.mark.slow
def test_one_given_up_leaves_nothing(tmp_path) -> None:
    out = tmp_path / "out.mcap"
    work = RepairTask(Far(), out)
    work.part.write_bytes(b"as far as it is")
    work.close()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_one_whose_process_died_leaves_nothing(tmp_path) -> None:
    out = tmp_path / "out.mcap"
    work = RepairTask(Far(), out)
    (child,) = (p for p in multiprocessing.active_children() if p.name == "kappaskin-repair")
    child.kill()
    work.part.write_bytes(b"as far as it was")
    with pytest.raises(Refusal, match="ended unexpectedly"):
        list(iter(work.poll, None))
    work.close()
    assert not list(tmp_path.iterdir())


def test_what_another_writes_is_left_alone(whole, tmp_path) -> None:
    part_of(tmp_path / "out.mcap").write_bytes(b"another's")
    with pytest.raises(Refusal, match="already exists"):
        RepairTask(whole, tmp_path / "out.mcap")
    assert part_of(tmp_path / "out.mcap").read_bytes() == b"another's"


def test_an_unfinished_recording_is_repaired_to_its_own_name(whole, tmp_path) -> None:
    out = tmp_path / "press.mcap"
    part_of(out).write_bytes(data := whole.read_bytes()[:-1000])
    assert repair(part_of(out), out).total
    assert part_of(out).read_bytes() == data
    with Recording(out) as recording:
        assert recording.whole
    assert set(tmp_path.iterdir()) == {out, part_of(out)}
