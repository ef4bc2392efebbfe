"""Files that other libraries wrote, imported: recordings with the same numbers, or refused."""

import csv
import errno
import io
import json
import os
import runpy
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer as RosWriter

from kappaskin import Recording, Refusal
from kappaskin.recording import (
    ExportRequest,
    FileLines,
    Imported,
    ImportRequest,
    ImportTask,
    ReplayedSource,
    Verification,
    is_foreign,
)
from kappaskin.recording.cdr import encode
from kappaskin.recording.disk import ReservedFile
from kappaskin.recording.export.writing import export_steps
from kappaskin.recording.importing import import_steps
from kappaskin.recording.messages import STRING

HOSTILE = runpy.run_path(str(Path(__file__).parents[2] / "hostile_files.py"))
T, P, STEP = 60, 9, 1e-6  # rows, elements, and the step of counts of curvatures in 1/m
rng = np.random.default_rng(1)
K = rng.normal(scale=3.0, size=(T, 3 * P))
TIMES = 5.0 + 0.01 * np.arange(T)
BEGAN = 1_700_000_000 * 10**9  # ns
HEAD = """
format = 1
[skin]
size = [0.1, 0.1]
rigidity = 3.7e-3
[elements]
grid = [3, 3]
[line]
"""
READ = '"xx:0..8", "yy:0..8", "xy:0..8"'
LINES = {
    "text": f'kind = "text"\ncolumns = ["time", {READ}]',
    "milliseconds": f'kind = "text"\ncolumns = ["sequence", "time_ms", "", {READ}]',
    "untimed": f'kind = "text"\ncolumns = [{READ}]',
    "rate": f'kind = "text"\nrate = 100\ncolumns = [{READ}]',
    "json": 'kind = "json"\nfields = { "skin.t" = "time", xx = "xx:0..8", yy = "yy:0..8", '
    'xy = "xy:0..8" }',
    "binary": 'kind = "binary"\nstruct = "<d27d"\nsync = "aa55"\nchecksum = "crc32"\n'
    f'columns = ["time", {READ}]',
    "halves": f'kind = "binary"\nstruct = "<d27h"\ncolumns = ["time", {READ}]',
}
ARRAY = """std_msgs/MultiArrayLayout layout
float64[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""


def _spreadsheet(file: Path) -> None:
    text = io.StringIO(newline="")
    writer = csv.writer(text, quoting=csv.QUOTE_ALL, lineterminator="\r\n")
    writer.writerow(["seconds", *(f"element {n}" for n in range(3 * P))])
    for n, row in enumerate(K.tolist()):
        writer.writerow([TIMES[n], *row])
        text.write("\r\n# a comment\r\n" if n == 3 else "")
    file.write_bytes(b"\xef\xbb\xbf" + text.getvalue().removesuffix("\r\n").encode())


def _numbered(file: Path) -> None:
    """As pandas writes a table without names."""
    with file.open("w", newline="") as opened:
        writer = csv.writer(opened, delimiter=";")
        writer.writerows([range(3 * P + 1), *np.column_stack([TIMES, K]).tolist()])


def _indexed(file: Path) -> None:
    """As pandas writes a table with an index of time."""
    with file.open("w", newline="") as opened:
        writer = csv.writer(opened)
        writer.writerows([["time", *range(3 * P)], *np.column_stack([TIMES, K]).tolist()])


def _npz(file: Path) -> None:
    np.savez_compressed(file, values=np.asfortranarray(K), time=TIMES)


def _npz_columns(file: Path) -> None:
    names = [f"{what}:{n}" for what in ("xx", "yy", "xy") for n in range(P)]
    np.savez(
        file, time=TIMES, other=np.eye(2), **dict(zip(reversed(names), K.T[::-1], strict=True))
    )


def _npz_whole(file: Path) -> None:
    np.savez(file, values=np.column_stack([TIMES, K]).astype(">f8"))


def _parquet(file: Path) -> None:
    arrow = pytest.importorskip("pyarrow")
    dates = (BEGAN + np.rint(TIMES * 1e9)).astype("M8[ns]")
    columns = {"time": dates, **{f"c{n}": values for n, values in enumerate(K.T)}}
    pytest.importorskip("pyarrow.parquet").write_table(arrow.table(columns), file)


def _ros(file: Path, others: bool = False) -> None:
    with file.open("wb") as opened:
        writer = RosWriter(opened, chunk_size=4096)
        array = writer.register_msgdef("std_msgs/msg/Float64MultiArray", ARRAY)
        text = writer.register_msgdef("std_msgs/msg/String", "string data")
        for time, row in zip((BEGAN + np.rint(TIMES * 1e9)).astype(int), K, strict=True):
            layout = {"dim": [{"label": "k", "size": 27, "stride": 27}], "data_offset": 0}
            message = {"layout": layout, "data": row.tolist()}
            for name in ("/skin", "/other") if others else ("/skin",):
                writer.write_message(name, array, message, log_time=time, publish_time=time)
            writer.write_message("/text", text, {"data": "hello"}, log_time=time, publish_time=time)
        writer.finish()


def _json(file: Path) -> None:
    with file.open("wb") as opened:
        writer = McapWriter(opened)
        writer.start()
        channel = writer.register_channel("/j", "json", writer.register_schema("k", "", b""))
        for n, row in enumerate(K.reshape(T, 3, P).tolist()):
            record = {"skin": {"t": TIMES[n]}} | dict(zip(("xx", "yy", "xy"), row, strict=True))
            stamp = BEGAN + n * 10**7
            writer.add_message(channel, stamp, json.dumps(record, indent=1).encode(), stamp)
        writer.finish()


def _bag(folder: Path, plugin: str) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kind = "std_msgs/msg/Float64MultiArray"
    layout = store.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    plugins = rosbag2.StoragePlugin
    with rosbag2.Writer(folder, version=9, storage_plugin=plugins[plugin]) as writer:
        connection = writer.add_connection("/skin", kind, typestore=store)
        for n, row in enumerate(K):
            data = store.serialize_cdr(store.types[kind](layout, row), kind)
            writer.write(connection, BEGAN + round(TIMES[n] * 1e9), data)


def _folder_of_mcap(folder: Path) -> None:
    folder.mkdir()
    _ros(folder / "bag_0.mcap")


FILES: dict[str, tuple[str, str, Callable[[Path], None]]] = {
    "spreadsheet": ("a.csv", "text", _spreadsheet),
    "numbered columns": ("a.txt", "text", _numbered),
    "numbered columns, index": ("a.csv", "text", _indexed),
    "arrays": ("a.npz", "text", _npz),
    "arrays, numbered records": ("a.npz", "milliseconds", _npz),
    "arrays without a column of time": ("a.npz", "untimed", _npz),
    "arrays as JSON": ("a.npz", "json", _npz),
    "arrays as binary": ("a.npz", "binary", _npz),
    "columns": ("a.npz", "text", _npz_columns),
    "all in one array": ("a.npz", "text", _npz_whole),
    "parquet": ("a.parquet", "text", _parquet),
    "mcap": ("a.mcap", "text", _ros),
    "mcap, untimed": ("a.mcap", "untimed", _ros),
    "folder": ("bag", "text", _folder_of_mcap),
    "rosbags, mcap": ("bag", "binary", lambda file: _bag(file, "MCAP")),
    "rosbags, sqlite": ("bag", "untimed", lambda file: _bag(file, "SQLITE3")),
    "json": ("a.mcap", "json", _json),
}


MESSAGES = ("mcap", "folder", "rosbags, mcap", "rosbags, sqlite", "json")


@pytest.mark.parametrize("name", MESSAGES)
def test_the_first_messages_of_a_bag_are_lines_with_its_numbers(tmp_path, name) -> None:
    file, _, make = FILES[name]
    make(tmp_path / file)
    lines = FileLines(tmp_path / file)
    found = lines.recogniser.found()

    assert is_foreign(tmp_path / file)
    assert (lines.trouble, lines.topics, lines.timed) == ("", [lines.topic], True)
    assert found.rate == pytest.approx(100.0, rel=1e-6)
    readings = [n for n, label in enumerate(found.labels) if label != "skin.t"]
    count = min(len(K), len(found.numbers))
    np.testing.assert_allclose(found.numbers[-count:, readings], K[-count:], rtol=1e-12)


def test_the_topic_of_a_bag_is_chosen(tmp_path) -> None:
    _ros(tmp_path / "a.mcap", others=True)

    assert FileLines(tmp_path / "a.mcap").topics == ["/other", "/skin"]
    assert FileLines(tmp_path / "a.mcap", "/skin").topic == "/skin"
    assert "/skin (std_msgs/msg/Float64" in FileLines(tmp_path / "a.mcap", "/none").trouble


def test_what_is_no_bag_of_another_program(tmp_path) -> None:
    (tmp_path / "empty").mkdir()
    _npz(tmp_path / "a.npz")
    _imported(tmp_path, tmp_path / "a.npz")
    own = (tmp_path / "out.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(own[: len(own) // 2])
    (tmp_path / "text.mcap").write_bytes(b"1,2,3")

    for name in ("empty", "a.npz", "out.mcap", "cut.mcap", "none.db3"):
        assert not is_foreign(tmp_path / name), name
    assert "expected a ROS 2 bag" in FileLines(tmp_path / "empty").trouble
    assert "expected .mcap contents" in FileLines(tmp_path / "text.mcap").trouble


def _sensor(folder: Path, kind: str) -> Path:
    file = folder / "board.toml"
    file.write_text(HEAD + LINES[kind])
    return file


def _imported(folder: Path, file: Path, kind: str = "text", topic: str = "") -> Imported:
    """What came of importing a file to `out.mcap`."""
    request = ImportRequest(file, folder / "out.mcap", _sensor(folder, kind), topic)
    *_, done = import_steps(request, folder)
    return done


def _exported(folder: Path) -> dict[str, Any]:
    request = ExportRequest(folder / "out.mcap", folder / "out.npz", preset="everything")
    *_, _ = export_steps(request, folder)
    with np.load(folder / "out.npz") as found:
        return dict(found)


def _verified(folder: Path) -> Verification:
    *_, verdict = Verification.steps(folder / "out.mcap")
    return verdict


@pytest.mark.parametrize("name", FILES)
def test_numbers_and_times_are_the_same_to_the_last_bit(name: str, tmp_path: Path) -> None:
    called, kind, make = FILES[name]
    make(file := tmp_path / called)

    done = _imported(tmp_path, file, kind)

    assert (done.rows, done.frames, done.bad) == (T, T, ())
    found, verdict = _exported(tmp_path), _verified(tmp_path)
    # In the description y runs fastest, in exported files x.
    expected = (np.rint(K / STEP) * STEP).reshape(T, 3, 3, 3).swapaxes(2, 3).reshape(T, 3, P)
    assert found["nominal"].tobytes() == expected.tobytes()
    step = 2 * np.spacing(BEGAN * 1e-9) if file.suffix in ("", ".mcap", ".parquet") else 2e-9
    np.testing.assert_allclose(found["time"] - found["time"][0], TIMES - TIMES[0], 0, step)
    assert verdict.passed
    assert verdict.frames == T


def test_a_recording_is_of_the_date_of_its_messages(tmp_path: Path) -> None:
    _ros(tmp_path / "a.mcap")
    _imported(tmp_path, tmp_path / "a.mcap")
    with Recording(tmp_path / "out.mcap") as recording:
        assert abs(recording.first - (BEGAN + 5 * 10**9)) < 1000


def _rows(rows: list[str]) -> bytes:
    return "".join(f"{row}\n" for row in rows).encode()


GOOD = [",".join(map(repr, row)) for row in np.column_stack([TIMES, K]).tolist()]


def test_bad_rows_are_counted_and_named_and_all_bytes_recorded(tmp_path: Path) -> None:
    rows = [*GOOD[:10], "6,boot", GOOD[10].replace(".", ":"), "7,8", *GOOD[11:], "8," * 10**5]
    (tmp_path / "a.csv").write_bytes(_rows(rows))

    done = _imported(tmp_path, tmp_path / "a.csv")

    assert {(bad.reason, bad.count, bad.number) for bad in done.bad} == {
        ("wrong number of columns", 2, 11),
        ("no number", 1, 12),
        ("too long", 1, len(rows)),
    }
    assert done.frames + 4 == done.rows == len(rows)
    with Recording(tmp_path / "out.mcap") as recording:
        lines = b"".join(data for _, _, data in recording.lines())
    assert lines == b"\n" + _rows(rows[:-1])
    assert _verified(tmp_path).passed


def test_time_that_goes_back_continues_and_duplicates_are_kept(tmp_path: Path) -> None:
    same = [f"{TIMES[19]},{row.partition(',')[2]}" for row in GOOD[30:33]]
    rows = GOOD[:20] + GOOD[:20] + same
    (tmp_path / "a.csv").write_bytes(_rows(rows))

    done = _imported(tmp_path, tmp_path / "a.csv")

    assert (done.frames, done.back) == (43, 1)
    found = _exported(tmp_path)
    assert np.all(np.diff(found["time"]) >= 0)
    np.testing.assert_array_equal(found["device_time"][20:40], TIMES[:20])
    assert _verified(tmp_path).passed


def test_lost_and_repeated_numbers_are_counted(tmp_path: Path) -> None:
    rows = [f"{n},{10 * n},0,{','.join(map(repr, K[n].tolist()))}" for n in (0, 1, 4, 5, 5, 6)]
    (tmp_path / "a.csv").write_bytes(_rows(rows))
    done = _imported(tmp_path, tmp_path / "a.csv", "milliseconds")
    assert (done.frames, done.lost) == (5, 2)
    assert [(bad.reason, bad.count, bad.number) for bad in done.bad] == [("duplicate", 1, 5)]
    assert _verified(tmp_path).passed


def test_without_times_the_rate_is_that_of_the_description(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(_rows([row.partition(",")[2] for row in GOOD]))
    _imported(tmp_path, tmp_path / "a.csv", "rate")
    np.testing.assert_allclose(_exported(tmp_path)["time"], 0.01 * np.arange(T), atol=1e-8)
    (tmp_path / "out.mcap").unlink()
    with pytest.raises(Refusal, match="give a column of time, or rate = 100"):
        _imported(tmp_path, tmp_path / "a.csv", "untimed")


def test_later_estimates_are_recorded_now_and_then(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.recording.importing._EVERY", 10)
    monkeypatch.setattr("kappaskin.recording.importing._THEN", 25)
    (tmp_path / "a.csv").write_bytes(_rows(GOOD))
    _imported(tmp_path, tmp_path / "a.csv")
    with Recording(tmp_path / "out.mcap") as recording:
        assert recording.counts["/kappaskin/contact"] == 12
    verdict = _verified(tmp_path)
    assert verdict.passed
    assert verdict.frames == T


def test_it_replays_as_a_recording_of_ours(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(_rows(GOOD))
    _imported(tmp_path, tmp_path / "a.csv")
    now = [0.0]
    replayed = ReplayedSource(tmp_path / "out.mcap", lambda: now[0], lambda _: None)
    now[0] = 60.0
    frames = replayed.read(0.0)
    assert len(frames) == T
    assert [frame.device_time for frame in frames] == TIMES.tolist()
    assert np.all(np.isfinite([frame.taken for frame in frames]))
    replayed.close()


def _logged_bag(folder: Path) -> sqlite3.Connection:
    """A bag that is being written: 20 rows in `w.db3`, and 40 in its write-ahead log."""
    database = sqlite3.connect(folder / "w.db3", isolation_level=None)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute(
        "CREATE TABLE topics (id INTEGER PRIMARY KEY, name, type, serialization_format)"
    )
    database.execute("CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
    database.execute("INSERT INTO topics VALUES (1, '/skin', ?, 'cdr')", [STRING.name])
    rows = [(1, BEGAN + n * 10**7, encode(STRING, {"data": row})) for n, row in enumerate(GOOD)]
    insert = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)"
    database.executemany(insert, rows[:20])
    database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    database.execute("PRAGMA wal_autocheckpoint = 0")
    database.executemany(insert, rows[20:])
    return database


@pytest.mark.parametrize("left", [("db3", "db3-wal"), ("db3", "db3-wal", "db3-shm")])
def test_a_bag_is_imported_with_its_write_ahead_log(left: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "out").mkdir()
    with closing(_logged_bag(tmp_path)):
        for end in left:  # as when the program was ended by force
            shutil.copy(tmp_path / f"w.{end}", tmp_path / "bag")
        kept = [file for file in (tmp_path / "bag").iterdir() if not file.name.endswith("-shm")]
        before = [file.read_bytes() for file in kept]
        (tmp_path / "bag").chmod(0o555)

        assert _imported(tmp_path / "out", tmp_path / "bag" / "w.db3").frames == T

        assert {file.name for file in (tmp_path / "bag").iterdir()} == {f"w.{end}" for end in left}
        assert [file.read_bytes() for file in kept] == before
    assert is_foreign(tmp_path / "bag")
    (tmp_path / "bag").chmod(0o755)


def test_a_bag_that_is_being_written_is_imported_up_to_now(tmp_path: Path) -> None:
    with closing(_logged_bag(tmp_path)) as database:
        assert _imported(tmp_path, tmp_path / "w.db3").frames == T
        database.execute("DELETE FROM messages")  # nobody else holds it
    (tmp_path / "out.mcap").unlink()
    with pytest.raises(Refusal, match="got no topic"):
        _imported(tmp_path, tmp_path / "w.db3")


@pytest.mark.parametrize(("first", "step"), [(2.2e9, 0.01), (4.2e9, 0.01), (2.1e9, 1e5), (0, 1e6)])
def test_times_before_2038_are_dates_and_others_count_from_any_beginning(
    first: float, step: float, tmp_path: Path
) -> None:
    times = first + step * np.arange(T)
    np.savez(tmp_path / "a.npz", values=K, time=times)
    assert _imported(tmp_path, tmp_path / "a.npz").frames == T
    found = _exported(tmp_path)["time"]
    np.testing.assert_allclose(found - found[0], times - first, atol=1e-6)


@pytest.mark.parametrize(("first", "step"), [(0, 1e7), (2.1e9, 1e6), (1.7e18, 1e7), (0, 5e8)])
def test_times_that_pass_2038_are_refused_by_their_unit(
    first: float, step: float, tmp_path: Path
) -> None:
    np.savez(tmp_path / "a.npz", values=K, time=first + step * np.arange(T))
    with pytest.raises(Refusal, match=r"a.npz: row \d+: expected a time before 2038.*its unit"):
        _imported(tmp_path, tmp_path / "a.npz")


def test_a_clock_that_is_set_continues(tmp_path: Path) -> None:
    times = np.r_[TIMES[:20], 1.7e9 + TIMES[20:40], 9e15, 1.7e9 + TIMES[41:]]
    np.savez(tmp_path / "a.npz", values=K, time=times)
    assert _imported(tmp_path, tmp_path / "a.npz").back == 3


def _full(at: int, once: bool) -> Callable[[ReservedFile, bytes], None]:
    """A disk that is full once a file has so many bytes; for good, if not `once`."""
    put, failed = ReservedFile.put, list[bool]()

    def write(self: ReservedFile, data: bytes) -> None:
        if self.tell() + len(data) > at and not (once and failed):
            failed.append(True)
            raise OSError(errno.ENOSPC, "No space left on device")
        put(self, data)

    return write


def _no_room(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


FULL = {
    "for its beginning": (ReservedFile, "put", _full(0, once=False), "cannot be written (%s)"),
    "but for its end": (ReservedFile, "put", _full(10_000, once=True), "%s"),
    "for its end": (ReservedFile, "put", _full(10_000, once=False), "%s"),
    "for a reserve": (ReservedFile, "reserve", _no_room, "expected room for 1 MiB at least (%s)"),
    "for its arrays": (zipfile.ZipFile, "extract", _no_room, "%s"),
}


@pytest.mark.parametrize("name", FULL)
def test_a_disk_without_room_is_named_by_the_file_to_be_made(name, tmp_path, monkeypatch) -> None:
    where, what, instead, why = FULL[name]
    monkeypatch.setattr(where, what, instead)
    np.savez(tmp_path / "a.npz", values=K, time=TIMES)
    request = ImportRequest(tmp_path / "a.npz", tmp_path / "r.mcap", _sensor(tmp_path, "text"))
    (tmp_path / ".scratch").mkdir()
    with pytest.raises(Refusal) as refusal:
        list(import_steps(request, tmp_path / ".scratch"))
    said = f"{request.to}: {why % 'No space left on device'}; free space, or choose another folder"
    assert str(refusal.value) == said


@pytest.mark.parametrize("kind", ["text", "binary"])
def test_a_file_that_shrinks_meanwhile_is_refused(kind: str, tmp_path: Path) -> None:
    row = (b"\xaa\x55" + bytes(228)) if kind == "binary" else f"{GOOD[0]}\n".encode()
    (tmp_path / "a.csv").write_bytes(row * 1000)
    request = ImportRequest(tmp_path / "a.csv", tmp_path / "r.mcap", _sensor(tmp_path, kind))
    (tmp_path / "scratch").mkdir()
    steps = import_steps(request, tmp_path / "scratch")
    next(steps)
    os.truncate(tmp_path / "a.csv", len(row) * 300 + 100)
    with pytest.raises(Refusal, match=rf"a.csv: expected {len(row) * 1000:,} bytes.*shorter"):
        list(steps)


def _saved(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def _two_topics() -> bytes:
    return _made(lambda file: _ros(file, others=True))


def _made(make: Callable[[Path], None]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        make(Path(folder) / "file")
        return (Path(folder) / "file").read_bytes()


def _endless(file: Path) -> None:
    """A bag whose messages are a query that never ends."""
    database = sqlite3.connect(file)
    database.execute("CREATE TABLE topics (id, name, type, serialization_format)")
    database.execute(
        "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) "
        "SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM n"
    )
    database.commit()
    database.close()


def _bomb(shape: tuple[int, ...], zeros: bool) -> bytes:
    return HOSTILE["_npz"]("values", shape, zeros=zeros)


REFUSED: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "picture.csv": ("text", lambda: b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 40, "row 2: "),
    "comma.csv": (
        "text",
        lambda: _rows([row.replace(",", ";").replace(".", ",") for row in GOOD]),
        r"row 1: .*decimal point, not a comma",
    ),
    "columns.csv": (
        "text",
        lambda: _rows([f"{row},1" for row in GOOD]),
        r"row 1: .*29 fields.*expected 28 numbers .* but 60 of 60 rows",
    ),
    "half.csv": ("text", lambda: _rows(GOOD[:20] + ["1,2"] * 21), "row 21: .* but 21 of 41 rows"),
    "empty.csv": ("text", lambda: b"", "expected rows with numbers, got none"),
    "wide.csv": ("text", lambda: _rows(GOOD).decode().encode("utf-16"), "UTF-16; save it as UTF-8"),
    "endless.csv": ("text", lambda: b"x," * 10**6, "row 1: too long"),
    "old.bag": ("text", lambda: b"#ROSBAG V2.0\n" + bytes(100), "got one of ROS 1"),
    "table.npz": ("text", lambda: _rows(GOOD), "expected .npz contents, got others"),
    "bag.mcap": ("text", lambda: _saved(values=K), "expected .mcap contents, got .npz"),
    "cut.npz": (
        "text",
        lambda: _saved(values=K)[:3000],
        "cannot be read .*; check its name, and that it is whole",
    ),
    "pickled.npz": (
        "text",
        lambda: _saved(values=np.array([{}, 1])),
        "cannot be read .*Python objects",
    ),
    "texts.npz": ("untimed", lambda: _saved(values=K.astype(str), time=TIMES), "expected numbers"),
    "untimed.npz": ("text", lambda: _saved(values=K), "expected times in s .* or rate = 100"),
    "short.npz": ("text", lambda: _saved(values=K, time=TIMES[1:]), "a row for each time"),
    "narrow.npz": ("text", lambda: _saved(values=K[:, 1:], time=TIMES), "27 columns.* got 26"),
    "others.npz": ("text", lambda: _saved(a=K, b=TIMES), "expected arrays values .* got a, b"),
    "rounded.npz": (
        "halves",
        lambda: _saved(values=K, time=TIMES),
        "row 1: .* it would be rounded",
    ),
    "many.npz": ("text", lambda: _bomb((1_500_000, 28), zeros=True), "to take at most 256 MB"),
    "nothing.npz": ("text", lambda: _bomb((10**9, 28), zeros=False), "cannot be read"),
    "header.npz": ("text", lambda: _long_header(), "cannot be read"),
    "topics.mcap": ("text", _two_topics, "expected one topic, got /other .*, /skin .* --topic"),
    "json.mcap": ("text", lambda: _made(_json), "expected a topic of .* got /j"),
    "cut.mcap": ("text", lambda: _made(_ros)[:2000], "is damaged from here on.*kappaskin repair"),
    "many.mcap": ("text", HOSTILE["READ"]["many-messages"], "to take at most 256 MB"),
    "names.mcap": ("text", HOSTILE["READ"]["long-names"], "to take at most 256 MB"),
    "nested.mcap": ("text", HOSTILE["REPAIRED"]["nested-chunks"], "damaged|expected a topic"),
    "endless.db3": ("text", lambda: _made(_endless), "expected tables topics and messages"),
    "damaged.db3": ("text", lambda: _made(_endless)[:5000], "cannot be read|expected tables"),
}


def _long_header() -> bytes:
    made = io.BytesIO(HOSTILE["NPZ"]["long-header"]())
    with zipfile.ZipFile(made) as archive, zipfile.ZipFile(out := io.BytesIO(), "w") as other:
        other.writestr("values.npy", archive.open("size.npy").read(2**17))
    return out.getvalue()


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_what_it_says_is_refused(name: str, tmp_path: Path) -> None:
    kind, make, why = REFUSED[name]
    (tmp_path / name).write_bytes(make())
    with pytest.raises(Refusal, match=why) as refusal:
        _imported(tmp_path, tmp_path / name, kind)
    assert str(refusal.value).startswith(str(tmp_path / name))


def test_a_damaged_parquet_is_refused(tmp_path: Path) -> None:
    _parquet(file := tmp_path / "a.parquet")
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(Refusal, match="cannot be read"):
        _imported(tmp_path, file)


def test_a_parquet_that_declares_far_more_than_it_holds_is_refused(tmp_path: Path) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    zeros = arrow.array(np.zeros(2_000_000))
    table = arrow.table({"time": zeros} | {f"c{n}": zeros for n in range(3 * P)})
    parquet.write_table(table, tmp_path / "a.parquet")
    with pytest.raises(Refusal, match="to take at most 256 MB"):
        _imported(tmp_path, tmp_path / "a.parquet")


def test_a_parquet_names_the_extra_that_reads_it(tmp_path: Path, monkeypatch) -> None:
    for name in ("pyarrow", "pyarrow.parquet"):
        monkeypatch.setitem(sys.modules, name, None)
    (tmp_path / "a.parquet").write_bytes(b"PAR1" + bytes(100))
    with pytest.raises(Refusal, match=r"pip install 'kappaskin\[parquet\]'"):
        _imported(tmp_path, tmp_path / "a.parquet")


def test_a_bag_is_read_up_to_where_it_is_damaged(tmp_path: Path) -> None:
    whole = _made(_ros)
    (tmp_path / "a.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    done = _imported(tmp_path, tmp_path / "a.mcap", topic="/skin")
    assert T // 4 < done.frames < T
    assert [bad.reason for bad in done.bad] == ["damaged from here on"]


def test_a_topic_is_chosen_by_name(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(_two_topics())
    assert _imported(tmp_path, tmp_path / "a.mcap", topic="/other").frames == T


@pytest.mark.slow
def test_the_command_imports_counts_and_never_replaces(run, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(_rows(["t,x", *GOOD, "boot"]))
    out, sensor = tmp_path / "r.mcap", _sensor(tmp_path, "text")
    words = ("import", tmp_path / "a.csv", "--sensor", sensor, "--out", out)

    code, printed, told = run(*words)

    assert code == 1
    assert f"{out}: 60 of 61 rows, 0.59 s; headings, comments, empty lines: 1" in printed
    assert "1 row: wrong number of columns, first row 62: 'boot'" in told
    assert run("verify", out)[0] == 0
    code, _, told = run(*words)
    assert code == 2
    assert "already exists" in told


@pytest.mark.slow
def test_a_task_that_is_closed_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(_rows(GOOD * 200))
    sensor = _sensor(tmp_path, "text")
    with ImportTask(ImportRequest(tmp_path / "a.csv", tmp_path / "r.mcap", sensor)) as task:
        next(task.wait())
    assert {file.name for file in tmp_path.iterdir()} == {"a.csv", "board.toml"}


@pytest.mark.slow
def test_a_name_that_fits_is_used(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(_rows(GOOD))
    out = tmp_path / f"{'r' * 245}.mcap"
    with ImportTask(ImportRequest(tmp_path / "a.csv", out, _sensor(tmp_path, "text"))) as task:
        *_, done = task.wait()
    assert isinstance(done, Imported)
    assert {file.name for file in tmp_path.iterdir()} == {"a.csv", "board.toml", out.name}


_IMPORTING = """
import sys
from pathlib import Path
from kappaskin.recording import ImportRequest, ImportTask

with ImportTask(ImportRequest(*map(Path, sys.argv[1:]))) as task:
    for _ in task.wait():
        print("begun", flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="nothing tells whose folder it is")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGKILL"])
def test_what_a_task_left_that_was_ended_is_removed_by_the_next(name: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(_rows(GOOD * 2000))
    sensor = _sensor(tmp_path, "text")
    words = [sys.executable, "-c", _IMPORTING, tmp_path / "a.csv", tmp_path / "r.mcap", sensor]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as ended:
        assert ended.stdout is not None
        ended.stdout.readline()
        ended.send_signal(signal.Signals[name])
    (left,) = set(tmp_path.iterdir()) - {tmp_path / "a.csv", sensor}
    (tmp_path / ".kappaskin-own").mkdir()  # not marked

    (tmp_path / "b.csv").write_bytes(_rows(GOOD))
    with ImportTask(ImportRequest(tmp_path / "b.csv", tmp_path / "r.mcap", sensor)) as task:
        assert not left.exists()
        (used,) = set(tmp_path.glob(".kappaskin-*")) - {tmp_path / ".kappaskin-own"}
        request = ImportRequest(tmp_path / "b.csv", tmp_path / "s.mcap", sensor)
        with ImportTask(request):
            assert used.exists()
        list(task.wait())
    assert {file.name for file in tmp_path.glob(".*")} == {".kappaskin-own"}
    assert (tmp_path / "r.mcap").exists()


@pytest.mark.slow
def test_ctrl_c_stops_the_command_and_leaves_nothing(run, tmp_path: Path, monkeypatch) -> None:
    def interrupted(self: ImportTask):
        yield 0.5
        raise KeyboardInterrupt

    (tmp_path / "a.csv").write_bytes(_rows(GOOD))
    sensor = _sensor(tmp_path, "text")
    monkeypatch.setattr(ImportTask, "wait", interrupted)
    code, _, told = run(
        "import", tmp_path / "a.csv", "--sensor", sensor, "--out", tmp_path / "r.mcap"
    )
    assert code == 2
    assert "nothing was written" in told
    assert {file.name for file in tmp_path.iterdir()} == {"a.csv", "board.toml"}


def test_a_bag_that_is_opened_as_a_recording_names_the_command(tmp_path: Path) -> None:
    _ros(tmp_path / "a.mcap")

    with pytest.raises(Refusal, match="`kappaskin import` makes one of it"):
        Recording(tmp_path / "a.mcap")
