"""Tares are kept per sensor, whole or not at all, whatever its number and whoever damages them."""

import tomllib
from dataclasses import replace
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Refusal, Tare, load_scene
from kappaskin.calibration import TareStore
from kappaskin.calibration.calibration import digest, fingerprint
from kappaskin.calibration.tare_store import MOST_SAVED

SENSOR = replace(load_scene("centre").sensor(), serial_number="KS-7", simulated=False)
DATE = datetime(2026, 11, 22, 1, 2, 3, 400_000, tzinfo=timezone(timedelta(hours=2)))
C = SENSOR.channels


def tare_of(level=1.5, **changes):
    offset = np.linspace(-level, level, C)
    offset[3] = np.nan
    layout = fingerprint(SENSOR.layout)
    tare = Tare("Skin", "KS-7", layout, DATE, 21.25, 480, 1.0, offset, np.where(offset, 0.01, 0))
    return replace(tare, **changes)


@pytest.fixture
def tares(tmp_path) -> TareStore:
    return TareStore(tmp_path / "not" / "there yet")


def test_a_tare_comes_back_as_it_was(tares):
    tares.add(tare_of())

    kept = tares.load("KS-7")

    assert kept.tares == (tare_of(),)
    assert kept.used == tare_of()
    assert kept.used.date.utcoffset() == timedelta(hours=2)
    assert np.array_equal(kept.used.offset, tare_of().offset, equal_nan=True)


def test_a_temperature_that_is_not_known_stays_so(tares):
    tares.add(tare_of(temperature=None))
    assert tares.load("KS-7").used.temperature is None


def test_nothing_is_kept_of_a_sensor_never_tared(tares):
    assert tares.load("KS-7").tares == ()
    assert tares.load("KS-7").used is None


def test_the_last_ten_are_kept(tares):
    for n in range(MOST_SAVED + 3):
        tares.add(tare_of(float(n + 1)))

    kept = tares.load("KS-7")

    assert kept.tares == tuple(tare_of(float(n + 1)) for n in range(3, MOST_SAVED + 3))
    assert kept.used == tare_of(float(MOST_SAVED + 3))


def test_an_undone_tare_stays_undone(tares):
    tares.add(tare_of(1.0))
    tares.add(tare_of(2.0))

    tares.use("KS-7", tare_of(1.0))
    assert tares.load("KS-7").used == tare_of(1.0)
    tares.use("KS-7", None)
    kept = tares.load("KS-7")

    assert kept.used is None
    assert kept.tares == (tare_of(1.0), tare_of(2.0))


def test_a_tare_that_is_used_but_not_kept_is_kept(tares):
    tares.use("KS-7", tare_of())
    assert tares.load("KS-7").used == tare_of()


def test_using_what_is_used_writes_nothing(tares):
    tares.use("KS-7", None)
    assert not tares.folder.exists()


def test_a_tare_of_elements_elsewhere_is_not_used(tares):
    tares.add(tare_of())

    assert tares.load("KS-7").fit_for(SENSOR) == tare_of()
    assert tares.load("KS-7").fit_for(load_scene("fingertip").sensor()) is None


NASTY = [
    "",
    ".",
    "..",
    "../../etc/passwd",
    "a/b",
    "a\\b",
    "C:",
    "nul",
    "x" * 5000,
    "\0",
    "é\n",
    "\ud800",
]


@pytest.mark.parametrize("serial_number", NASTY)
def test_any_serial_number_is_a_file_in_the_folder(tares, serial_number):
    path = tares.path(serial_number)

    assert path.parent == tares.folder
    assert len(path.name) < 100
    assert path.name.isascii()


@given(st.text(), st.text())
def test_sensors_share_no_file(one, other):
    tares = TareStore(TareStore.user_folder())
    assert (tares.path(one) == tares.path(other)) == (one == other)


@pytest.mark.parametrize("serial_number", [n for n in NASTY if n != "\ud800"])
def test_any_serial_number_comes_back(tares, serial_number):
    tare = tare_of(serial_number=serial_number)
    tares.add(tare)
    assert tares.load(serial_number).used == tare


def test_a_serial_number_that_is_no_text_is_refused_and_leaves_nothing(tares):
    with pytest.raises(Refusal, match="cannot be written"):
        tares.add(tare_of(serial_number="\ud800"))
    assert list(tares.folder.iterdir()) == []


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ("format = 1", "format = 2"),
        ("temperature = 21.25", "temperature = 22.25"),
        ("[[tare]]", "[[tares]]"),
        ("frames = 480", "frames = \n"),
        ('used = "', 'used = "0'),
        ('name = "Skin"', 'name = "Skin"\nname = "Other"'),
    ],
)
def test_a_file_that_was_edited_is_refused(tares, was, becomes):
    tares.add(tare_of())
    path = tares.path("KS-7")
    text = path.read_text()
    assert text.count(was) == 1
    path.write_text(text.replace(was, becomes))

    with pytest.raises(Refusal, match=r"contains no valid tares .* delete it") as told:
        tares.load("KS-7")
    assert str(told.value).startswith(str(path))


def test_a_file_edited_by_one_who_knows_its_hash_is_refused_too(tares):
    tares.add(tare_of())
    path = tares.path("KS-7")
    text = path.read_text().replace("frames = 480", "frames = inf")
    said = tomllib.loads(text)
    content = {"used": said["used"], "tare": said["tare"]}
    path.write_text(text.replace(said["sha256"], digest(content)))

    with pytest.raises(Refusal, match="contains no valid tares"):
        tares.load("KS-7")


@given(st.integers(0, 2**32), st.binary(max_size=3))
def test_bytes_that_changed_are_refused_or_change_nothing(tmp_path_factory, at, other):
    tares = TareStore(tmp_path_factory.mktemp("tares"))
    tares.add(tare_of())
    path = tares.path("KS-7")
    data = path.read_bytes()
    at %= len(data)
    path.write_bytes(data[:at] + other + data[at + 2 :])

    try:
        kept = tares.load("KS-7")
    except Refusal:
        return
    assert kept.used == tare_of()


@pytest.mark.parametrize("data", [b"", b"\xff\xfe", b"[" * 10_000, b"format = 1", b"a = 1\n" * 9])
def test_garbage_is_refused_and_makes_room_for_the_next(tares, data):
    tares.folder.mkdir(parents=True)
    tares.path("KS-7").write_bytes(data)
    with pytest.raises(Refusal, match="contains no valid tares"):
        tares.load("KS-7")

    tares.add(tare_of())

    assert tares.load("KS-7").used == tare_of()


def test_the_file_of_another_sensor_is_refused(tares):
    tares.add(tare_of())
    tares.path("KS-7").rename(tares.path("KS-8"))
    with pytest.raises(Refusal, match="belongs to another sensor"):
        tares.load("KS-8")


def test_what_cannot_be_written_is_refused_and_leaves_what_was(tares, monkeypatch):
    tares.add(tare_of())

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(Refusal, match=r"cannot be written \(.*No space left.*free disk space"):
        tares.add(tare_of(2.0))

    assert tares.load("KS-7").used == tare_of()
    assert len(list(tares.folder.iterdir())) == 1


def test_a_folder_in_the_way_is_refused(tares):
    tares.path("KS-7").mkdir(parents=True)
    with pytest.raises(Refusal, match="cannot be read"):
        tares.load("KS-7")
