"""Lines of other formats: bytes in, frames out, every byte accounted for."""

import json
import math
import struct
import zlib
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Refusal
from kappaskin.calibration import Calibration
from kappaskin.sources import load_description
from kappaskin.sources.description import description_of
from kappaskin.sources.wire import Samples

SKIN = """
format = 1
[skin]
size = [0.06, 0.04]
[elements]
grid = [3, 2]
"""
TEXT = """
[line]
kind = "text"
columns = ["time_ms", "", "xx:0..5", "xy:2"]
[readings]
scale = 0.5
offset = 1.0
"""
JSON = """
[line]
kind = "json"
fields = { t = "time", n = "sequence", "skin.k" = "xx:0..5" }
"""
BINARY = """
[line]
kind = "binary"
struct = ">HI6h"
sync = "aa55"
checksum = "crc32"
columns = ["sequence", "time_us", "yy:0..5"]
[readings]
scale = 0.01
"""
KINDS = {"text": TEXT, "json": JSON, "binary": BINARY}
LINE = b"1500,7,2,4,6,8,10,12,-2\r\n"


def described(line):
    return description_of(SKIN + line, "board.toml")


def decoder(line=TEXT, whole=True):
    return described(line).decoder(whole)


def curvature(samples, line=TEXT):
    """xx, yy and xy of the elements (18,) in 1/m; NaN where none was sent."""
    sensor, flat = described(line).sensor, np.full((3, 6), np.nan)
    number = {"curvature@0": 0, "curvature@90": 1, "twist": 2}
    kinds = [number.get(name, k) for k, name in enumerate(sensor.layout.kind_names)]
    kind, element = (each[samples.channels] for each in (sensor.layout.kind, sensor.layout.element))
    flat[np.array(kinds)[kind], element] = sensor.transduction.curvature(samples.counts)
    return flat.ravel()


def readings(samples, line):
    """The readings (n,) of a record in their units, in the order of the columns."""
    return described(line).sensor.transduction.curvature(samples.counts)


def test_a_line_is_a_frame():
    (samples,) = decoder().feed(LINE)

    assert samples.time == 1.5
    # Element k is i_x * 2 + i_y; in the layout x runs fastest: 0, 2, 4 and then 1, 3, 5.
    np.testing.assert_allclose(curvature(samples)[:6], [2.0, 4.0, 6.0, 3.0, 5.0, 7.0])
    np.testing.assert_allclose(curvature(samples)[12 + 1], 0.0)  # element 2 is i_x = 1, i_y = 0
    assert np.isnan(curvature(samples)[6:12]).all()


UNEVEN = """
[readings]
noise = 0.1
[readings.xy]
noise = 0.4
[readings.yy]
noise = 0.2
"""


def test_readings_of_one_unit_may_have_noises_of_their_own():
    line = '[line]\nkind = "text"\ncolumns = ["xx:0..5", "xy:0..5", "yy:0..5"]\n'

    sensor, even = (
        described(line + UNEVEN).sensor,
        described(line + "[readings]\nnoise = 0.1").sensor,
    )

    np.testing.assert_array_equal(sensor.sigma, np.repeat([0.1, 0.4, 0.2], 6))
    assert sensor.layout.kind_names == ["curvature@0", "curvature@90", "twist"]
    assert math.isnan(sensor.noise)
    assert sensor.noise_unit == (1.0, "times that stated")
    # Where they are alike it is a curvature sensor as before, whose readings are not weighed.
    assert (even.sigma, even.noise, even.layout.frame_shape) == (None, 0.1, (3, 6))
    assert even.noise_unit == (1.0, "1/m")


def test_heights_beside_curvatures_of_different_noise_are_weighed_by_each():
    line = '[line]\nkind = "text"\ncolumns = ["xx:0..5", "xy:0..5", "height:0..5"]\n'
    uneven = UNEVEN.replace("yy", "height").replace("0.2", "2e-5")

    sensor = described(line + uneven).sensor

    np.testing.assert_array_equal(sensor.sigma, np.repeat([0.1, 0.4, 2e-5], 6))


def test_channels_that_no_column_has_are_dead():
    line = TEXT.replace('"xy:2"', '"xy:2", "yy:0..5"')
    live = described(line).sensor.layout.live

    assert live.tolist() == [[True] * 6, [True] * 6, [False, True, False, False, False, False]]


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "  "])
def test_the_separator_is_recognised(separator):
    line = LINE.replace(b",", separator.encode())

    (samples,) = decoder().feed(line)

    assert samples.time == 1.5


def test_a_decimal_comma_is_no_number():
    lines = decoder(TEXT.replace("[line]", '[line]\nseparator = ";"'))

    assert lines.feed(b"1500;7;2,5;4;6;8;10;12;-2\n") == []
    assert dict(lines.accounting().discarded) == {"no number": 26}
    assert "2,5" in lines.last


def test_the_first_line_may_be_half_a_line_and_is_no_frame():
    lines = decoder(whole=False)

    assert lines.feed(LINE[2:]) == []
    assert len(lines.feed(LINE)) == 1
    assert dict(lines.accounting().discarded) == {"half a line": len(LINE) - 2}


def test_a_decoder_that_goes_on_where_another_was_discards_nothing():
    lines, other = decoder(whole=True), decoder(whole=False)
    lines.feed(LINE + LINE[:4])

    assert len(other.feed(lines.held + LINE[4:])) == 1
    assert not other.accounting().discarded


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (b"Booting v1.2\r\n", "no separator"),
        (b"1500,7,2,4,6\n", "wrong number of columns"),
        (b"1500,7,2,4,6,8,10,12,x\n", "no number"),
        (b"1_500,7,2,4,6,8,10,12,1\n", "no number"),
        (b"nan,7,2,4,6,8,10,12,1\n", "time or sequence"),
        (b"-3,7,2,4,6,8,10,12,1\n", "time or sequence"),
        (b"\xff\xfe\x00\n", "no separator"),
        (b"\n", "no separator"),
    ],
)
def test_what_is_no_record_is_counted_by_its_reason(bad, reason):
    lines = decoder()
    if reason != "no separator":  # it is known after a good line
        assert len(lines.feed(LINE)) == 1

    assert lines.feed(bad) == []
    assert dict(lines.accounting().discarded) == {reason: len(bad)}
    assert len(lines.feed(LINE)) == 1
    assert lines.accounting().balanced


def test_missing_and_infinite_readings_are_missing_in_the_frame():
    (samples,) = decoder().feed(b"1500,7,nan,,inf,8,10,12,-2\n")

    np.testing.assert_array_equal(np.isnan(curvature(samples)[:6]), [1, 1, 0, 1, 0, 0])


def test_a_line_without_end_takes_no_memory():
    lines = decoder()
    for _ in range(100):
        lines.feed(b"1" * 10_000)

    assert len(lines.held) < 2**17
    assert lines.accounting().balanced


def test_sequence_numbers_tell_losses_and_duplicates():
    lines = decoder(JSON)

    def send(n):
        return lines.feed(json.dumps({"t": n, "n": n, "skin": {"k": [0.0] * 6}}).encode() + b"\n")

    assert [len(send(n)) for n in (0, 1, 1, 4)] == [1, 1, 0, 1]
    found = lines.accounting()
    assert (found.lost, found.duplicate, found.balanced) == (2, 1, True)


@pytest.mark.parametrize(("code", "count"), [("B", 2**8), ("H", 2**16), ("I", 2**32)])
def test_numbers_of_any_size_go_on_where_they_begin_again(code, count):
    lines = decoder(BINARY.replace(">HI6h", f">{code}I6h"))

    def send(n):
        body = struct.pack(f">{code}I6h", n % count, n % count, *range(6))
        return lines.feed(b"\xaa\x55" + body + struct.pack(">I", zlib.crc32(body)))

    first = count - 3
    found = [samples.sequence for n in (0, 1, 2, 3, 3, 6) for samples in send(first + n)]

    assert found == [(first + n) % 2**32 for n in (0, 1, 2, 3, 6)]
    told = lines.accounting()
    assert (told.lost, told.duplicate, told.restarts) == (2, 1, 0)


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (b"{", "no JSON"),
        (b"[" * 5000, "no JSON"),
        (b'{"t": 1, "n": 1}', "no skin.k"),
        (b'{"t": 1, "n": 1, "skin": 3}', "no skin.k"),
        (b'{"t": 1, "n": 1, "skin": {"k": [1, 2]}}', "wrong number of columns"),
        (b'{"t": 1, "n": 1, "skin": {"k": [1, 2, 3, 4, 5, "6"]}}', "no number"),
        (b'{"t": 1, "n": 1, "skin": {"k": [1, 2, 3, 4, 5, true]}}', "no number"),
        (b'{"t": 1, "n": 1e30, "skin": {"k": [1, 2, 3, 4, 5, 6]}}', "time or sequence"),
        (b'{"t": Infinity, "n": 1, "skin": {"k": [1, 2, 3, 4, 5, 6]}}', "time or sequence"),
        (
            b'{"t": %s, "n": 1, "skin": {"k": [1, 2, 3, 4, 5, 6]}}' % (b"9" * 400),
            "time or sequence",
        ),
    ],
)
def test_json_that_is_no_record_is_counted_by_its_reason(bad, reason):
    lines = decoder(JSON)

    assert lines.feed(bad + b"\n") == []
    assert dict(lines.accounting().discarded) == {reason: len(bad) + 1}


def test_a_json_null_is_a_missing_reading():
    (samples,) = decoder(JSON).feed(b'{"t": 1, "n": 1, "skin": {"k": [1, null, 3, 4, 5, 6]}}\n')

    assert np.isnan(curvature(samples)[:6]).tolist() == [False] * 3 + [True] + [False] * 2


def binary(sequence, values, time=1_500_000):
    body = struct.pack(">HI6h", sequence, time, *values)
    return b"\xaa\x55" + body + struct.pack(">I", zlib.crc32(body))


def test_binary_records_are_found_between_other_bytes():
    lines = decoder(BINARY)
    first, second = binary(1, range(6)), binary(2, [0xAA55 - 2**16] * 6)

    found = lines.feed(b"noise\xaa" + first + b"\xaa\x55" + second[:9])
    found += lines.feed(second[9:] + b"\x00" * 30)

    assert [samples.sequence for samples in found] == [1, 2]
    assert found[0].time == 1.5
    assert lines.accounting().balanced


def test_a_record_with_a_wrong_checksum_is_no_frame():
    lines, spoilt = decoder(BINARY), bytearray(binary(1, range(6)))
    spoilt[12] ^= 1

    assert lines.feed(bytes(spoilt) + binary(2, range(6)))[0].sequence == 2
    assert "checksum" in dict(lines.accounting().discarded)


@pytest.mark.parametrize("checksum", ["none", "sum8", "crc16-ccitt", "crc32"])
@pytest.mark.parametrize("order", "<>")
def test_every_checksum_is_read_as_it_is_written(checksum, order):
    line = BINARY.replace("crc32", checksum).replace('">', f'"{order}')
    lines = decoder(line)

    (samples,) = decoder(line).feed(lines.encoded(7, 2.5, np.arange(6.0)))

    assert (samples.sequence, samples.time) == (7, 2.5)
    np.testing.assert_allclose(readings(samples, line), np.arange(6.0))


def test_the_crc_is_that_of_the_catalogue():
    """Of "123456789", as the catalogue of CRC algorithms has it: CRC-16/IBM-3740."""
    from kappaskin.sources.lines import CHECKSUMS

    assert CHECKSUMS["crc16-ccitt"][1](b"123456789") == 0x29B1
    assert CHECKSUMS["crc32"][1](b"123456789") == 0xCBF43926


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_device_would_send_is_what_is_read(kind):
    channels = described(KINDS[kind]).sensor.channels
    K = np.round(np.random.default_rng(1).normal(0, 5, channels), 2)

    (samples,) = decoder(KINDS[kind]).feed(decoder(KINDS[kind]).encoded(12, 3.25, K))

    assert samples.time == 3.25
    assert sorted(samples.channels) == list(range(channels))
    np.testing.assert_allclose(readings(samples, KINDS[kind]), K[samples.channels], atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
@given(data=st.lists(st.binary(max_size=60), max_size=8))
def test_any_bytes_are_accounted_for(kind, data):
    lines = decoder(KINDS[kind], whole=False)
    valid = lines.encoded(3, 1.0, np.zeros(18))

    for part in [*data, valid, *data]:
        for samples in lines.feed(part):
            assert isinstance(samples, Samples)
    lines.line_ended()

    assert lines.accounting().balanced
    assert lines.accounting().buffered == 0


@pytest.mark.parametrize("kind", KINDS)
@given(cut=st.integers(0, 200))
def test_where_the_bytes_are_cut_changes_nothing(kind, cut):
    whole, parts = decoder(KINDS[kind]), decoder(KINDS[kind])
    data = b"".join(whole.encoded(n, n / 8, np.full(18, n / 4)) for n in range(5))

    expected = whole.feed(data)
    found = parts.feed(data[:cut]) + parts.feed(data[cut:])

    assert [s.time for s in found] == [s.time for s in expected] == [0, 0.125, 0.25, 0.375, 0.5]
    assert all(np.array_equal(a.counts, b.counts) for a, b in zip(found, expected, strict=True))


def test_another_decoder_goes_on_from_the_bytes_held():
    lines = decoder(whole=False)
    lines.feed(b"half\n" + LINE + LINE[:10])

    other = decoder(whole=False)
    found = other.feed(lines.held) + other.feed(LINE[10:])

    assert len(found) == 1


# Descriptions


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("format = 1", "format = 2", "format = 1"),
        ('kind = "text"', 'kind = "csv"', "text, json, binary"),
        ('"xx:0..5"', '"xx:0..6"', "elements from 0 to 5"),
        ('"xx:0..5"', '"xx:5..0"', "goes up"),
        ('"xx:0..5"', '"xz:0..5"', "line 10: line.columns: expected a reading among xx, yy"),
        ('"xx:0..5"', '"xx"', "expected time"),
        ('"xx:0..5"', '"xx:0-5"', "expected time"),
        ('"xx:0..5"', '"slope:0"', "slope@DEGREES"),
        ('"xx:0..5"', '"slope@north:0"', "slope@DEGREES"),
        ('"xx:0..5"', '"height@10:0"', "slope@DEGREES"),
        ('"xx:0..5"', '"xx:0..5", "xx:3"', "each reading once, got xx:3 and xx:3"),
        ('"xx:0..5"', '"xx:0..5", "curvature@360:3"', "got xx:3 and curvature@360:3"),
        ('"time_ms"', '"time_ms", "time"', "one column of time"),
        ('"time_ms"', '"sequence", "sequence"', "one column sequence"),
        ('"xx:0..5", "xy:2"', '"sequence"', "with readings"),
        ("scale = 0.5", "scale = 0", "other than 0"),
        ("scale = 0.5", "scale = nan", "expected"),
        ("scale = 0.5", "noises = 0.5", "no such key; did you mean noise"),
        ("scale = 0.5", "noise = -1.0", "expected"),
        ("scale = 0.5", 'datum = "loose"', "fixed, free"),
        ("scale = 0.5", "[readings.height]\nscale = 2.0", "a quantity that a column reads"),
        ("scale = 0.5", "[readings.xx]\nnoise = 0.1", r"got 0\.1 of xx, 0 of xy"),
        (
            'xy:2"]\n[readings]',
            'xy:2", "twist:3"]\n[readings]\nnoise = 0.2\n[readings.xy]\nnoise = 0.1\n[readings.xx]',
            r"got 0\.2 of xx, 0\.1 of xy, 0\.2 of twist",
        ),
        ('"xx:0..5"', '"height:0..5"', "noise of readings that differ in unit"),
        (
            "grid = [3, 2]",
            'grid = [3, 2]\nreads = ["height"]',
            "the columns determine what is read",
        ),
        ('columns = ["time_ms", "", "xx:0..5", "xy:2"]', "", "columns"),
        ("[line]", "[line]\nbaud = 12.5", "whole number"),
        ("[line]", "[lines]", "kind"),
    ],
)
def test_a_wrong_description_is_refused_with_what_was_expected(old, new, words):
    assert old in SKIN + TEXT
    with pytest.raises(Refusal, match=words):
        description_of((SKIN + TEXT).replace(old, new), "board.toml")


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        ("HI6h", "< or >"),
        (">HI5h", "7 values"),
        (">HI6s", "3 values|numbers only"),
        (">HIq?", "numbers only"),
        (">what", "expected the format of a struct"),
        ("", "expected the format of a struct|< or >"),
    ],
)
def test_a_wrong_struct_is_refused(layout, words):
    with pytest.raises(Refusal, match=words):
        described(BINARY.replace(">HI6h", layout))


def test_sync_bytes_are_in_hex():
    with pytest.raises(Refusal, match="hex"):
        described(BINARY.replace("aa55", "xy"))


def test_a_line_of_other_columns_is_told_by_their_number():
    found = decoder()
    assert not found.feed(LINE.replace(b"1500", b"1500,3"))
    assert found.last.endswith("12,-2' (10 fields, expected 9)")
    found.feed(LINE.replace(b",", b";").replace(b"2;", b"2,5;"))
    assert found.last.endswith("(numbers have a decimal point, not a comma)")


def test_a_description_that_cannot_be_read_is_refused(tmp_path):
    with pytest.raises(Refusal, match=r"description \(No such file"):
        load_description(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(Refusal, match="cannot be read"):
        load_description(tmp_path / "binary.toml")


def test_a_component_may_have_a_scale_of_its_own():
    line = TEXT + "[readings.xy]\nscale = 2.0\n"
    (samples,) = decoder(line).feed(LINE)

    assert curvature(samples)[0] == pytest.approx(2.0)
    assert curvature(samples)[13] == pytest.approx(-3.0)


MIXED = """
[line]
kind = "text"
columns = ["height:0..5", "slope@30:4", "slope@90:0..1", "curvature@45:5", "xx:5"]
[readings]
noise = 0.1
[readings.height]
scale = 1e-3
noise = 1e-6
datum = "free"
[readings.slope]
scale = 2.0
offset = 1.0
noise = 1e-3
"""


def test_columns_may_read_any_mix_of_quantities():
    layout = described(MIXED).sensor.layout
    (samples,) = decoder(MIXED).feed(b"0,1,2,3,4,5,6,7,8,9,10\n")

    names = [layout.kind_names[k] for k in layout.kind]
    assert names == ["height"] * 6 + ["slope@30"] + ["slope@90"] * 2 + [
        "curvature@45",
        "curvature@0",
    ]
    np.testing.assert_allclose(layout.positions[layout.element[6]], [0.05, 0.01])
    np.testing.assert_allclose(
        readings(samples, MIXED), [0, 1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 13, 15, 17, 9, 10], atol=1e-7
    )


def test_each_quantity_has_the_noise_and_the_datum_of_its_table():
    sensor = described(MIXED).sensor

    assert sensor.layout.reads.free == ("height",)
    assert sensor.sigma.tolist() == [1e-6] * 6 + [1e-3] * 3 + [0.1] * 2
    assert math.isnan(sensor.noise)


def test_one_noise_of_all_readings_is_that_of_the_sensor():
    curved = TEXT.replace('"xy:2"', '"yy:0..5", "xy:0..5"')

    assert described(curved).sensor.layout.reads is None
    assert math.isnan(described(curved).sensor.noise)
    assert described(curved + "noise = 0.2").sensor.noise == 0.2


def calibrated(folder, text, **changed):
    """The description in a file, with a calibration of it, of gain 2, offset 1, and one failed."""
    file = folder / "board.toml"
    file.write_text(text)
    sensor = load_description(file).sensor
    C = sensor.channels
    made = Calibration.nominal(sensor, datetime.now(UTC))
    gain, zero = np.where(np.arange(C) == 3, np.nan, 2.0), np.ones(C)
    failed = replace(made, gain=gain, offset=zero, failures=((3, "noisy"),), **changed)
    failed.save(folder / "bench.toml")
    file.write_text(text.replace("[readings]", '[readings]\ncalibration = "bench.toml"'))
    return file


CURVED = TEXT.replace('"xy:2"', '"yy:0..5", "xy:0..5"').replace("[line]", '[line]\nid = "bench"')


def test_a_calibration_is_taken_off_the_readings(tmp_path):
    found = load_description(calibrated(tmp_path, SKIN + CURVED))
    line = ",".join(["0", "0", *["3"] * 18]).encode() + b"\n"
    (samples,) = found.decoder(whole=True).feed(line)

    # scale 0.5 and offset 1: 2.5, less 1, by 2
    told = found.sensor.transduction.curvature(samples.counts)[samples.channels != 3]
    assert told.tolist() == [0.75] * 17
    assert np.flatnonzero(~found.sensor.layout.live.ravel()).tolist() == [3]


def test_a_description_keeps_the_calibration_that_it_names(tmp_path):
    found = load_description(calibrated(tmp_path, SKIN + CURVED))
    (tmp_path / "bench.toml").unlink()

    again = description_of(found.text, "board.toml")

    np.testing.assert_array_equal(again.columns.scale, found.columns.scale)


def test_a_calibration_of_another_sensor_or_none_is_refused(tmp_path):
    file = calibrated(tmp_path, SKIN + CURVED.replace('id = "bench"', ""))
    with pytest.raises(Refusal, match="give id in"):
        load_description(file)
    (tmp_path / "bench.toml").write_text("gain = 3")
    with pytest.raises(Refusal, match="cannot be read as a calibration"):
        load_description(file)
    (tmp_path / "bench.toml").unlink()
    with pytest.raises(Refusal, match="cannot be read as a calibration"):
        load_description(file)


def test_dead_elements_are_dead_in_any_reading():
    text = (SKIN + MIXED).replace("grid = [3, 2]", "grid = [3, 2]\ndead = [3]")
    layout = description_of(text, "x").sensor.layout

    assert layout.element[~layout.live].tolist() == [3, 3]


def test_heights_of_a_micrometre_are_not_rounded():
    line = '[line]\nkind = "text"\ncolumns = ["height:0..5"]\n[readings]\nscale = 1e-6'
    (samples,) = decoder(line).feed(b"0.1,0.2,0.3,-0.4,0.5,1e6\n")

    expected = [1e-7, 2e-7, 3e-7, -4e-7, 5e-7, 1.0]
    np.testing.assert_allclose(readings(samples, line), expected, atol=5e-9)


def test_elements_by_position_count_as_they_are_listed():
    skin = SKIN.replace("grid = [3, 2]", "positions = [[0.01, 0.01], [0.05, 0.03], [0.03, 0.02]]")
    line = TEXT.replace('"xx:0..5", "xy:2"', '"xx:2", "xx:0..1"')
    found = description_of(skin + line, "x.toml")
    (samples,) = found.decoder(whole=True).feed(b"0,0,1,2,3\n")

    assert found.sensor.layout.element[samples.channels].tolist() == [2, 0, 1]


def test_the_identifier_is_the_given_one_else_the_ports_else_of_the_text():
    text = SKIN + TEXT
    named = text.replace("[line]", '[line]\nid = "bench"')

    assert description_of(named, "x", "USB7").sensor.serial_number == "bench"
    assert description_of(text, "x", "USB7").sensor.serial_number == "USB7"
    first, second = (description_of(t, "x").sensor.serial_number for t in (text, text + "# a\n"))
    assert first != second
    assert math.isfinite(int(first, 16))


def test_json_and_binary_records_may_have_any_readings():
    json_line = '[line]\nkind = "json"\nfields = { "cam.h" = "height:0..2", tilt = "slope@30:4" }\n'
    binary = '[line]\nkind = "binary"\nstruct = "<4h"\ncolumns = ["height:0..2", "slope@30:4"]\n'
    noise = "[readings.height]\nnoise = 1e-5\nscale = 1e-3\n[readings.slope]\nnoise = 1e-3\n"
    record = b'{"cam": {"h": [1, 2, null]}, "tilt": -4}\n'

    (told,) = decoder(json_line + noise).feed(record)
    (packed,) = decoder(binary + noise).feed(struct.pack("<4h", 1, 2, 3, -4))

    np.testing.assert_allclose(readings(told, json_line + noise), [1e-3, 2e-3, np.nan, -4])
    np.testing.assert_allclose(readings(packed, binary + noise), [1e-3, 2e-3, 3e-3, -4])
