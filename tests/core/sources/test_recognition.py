"""What unknown lines are: separator, columns, time and count; never wrong about a decimal comma."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin import Refusal, SourceError
from kappaskin.sources import (
    READS,
    NewSensor,
    RawLines,
    Recogniser,
    by_rows,
    columns_of,
    description_text,
)
from kappaskin.sources.description import description_of

RATE = 100.0


def recognised(lines, end="\n", rate=RATE):
    found = Recogniser()
    found.feed(0.0, b"half of a li" + end.encode())
    for n, line in enumerate(lines):
        found.feed(n / rate, f"{line}{end}".encode())
    return found.found()


def rows(count=100, columns=9, seed=0):
    return np.random.default_rng(seed).normal(0, 100, (count, columns)).round(2)


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_separator_columns_rate_and_numbers_are_recognised(separator, end) -> None:
    values = rows()
    found = recognised([separator.join(map(str, row)) for row in values.tolist()], end)

    assert (found.kind, found.separator, len(found.labels)) == (
        "text",
        separator.strip(" ") or " ",
        9,
    )
    assert found.rate == pytest.approx(RATE)
    np.testing.assert_array_equal(found.numbers, values)
    assert found.roles == (None,) * 9


@pytest.mark.parametrize(("unit", "role"), [(1.0, "time"), (1e3, "time_ms"), (1e6, "time_us")])
def test_time_sequence_and_constants_are_found_by_their_course(unit, role) -> None:
    lines = [
        f"{7.5 * unit + n / RATE * unit:.6f},{n + 1000},{5},{','.join(map(str, row))}"
        for n, row in enumerate(rows().tolist())
    ]
    found = recognised(lines)

    assert found.roles[:4] == (role, "sequence", "", None)
    assert "column 0 is the time" in found.text
    assert "column 1 counts the lines" in found.text


def test_boot_messages_and_headings_are_no_numbers_and_a_heading_names_columns() -> None:
    lines = ["ESP-ROM:esp32", "t,h0,h1", *(f"{n},{n % 7},{n % 5}" for n in range(60))]

    assert recognised(lines).labels == ("t", "h0", "h1")


def test_json_is_recognised_by_its_paths() -> None:
    lines = [
        json.dumps({"n": n, "skin": {"k": row[:4], "t": None}, "name": "x"})
        for n, row in enumerate(rows().tolist())
    ]
    found = recognised(lines)

    assert found.paths == (("n", 1), ("skin.k", 4), ("skin.t", 1))
    assert found.labels[1] == "skin.k[0]"
    assert found.roles == ("sequence", None, None, None, None, "")


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_a_decimal_comma_is_refused(separator) -> None:
    lines = [separator.join(f"{v:.2f}".replace(".", ",") for v in row) for row in rows()]

    found = recognised(lines)
    assert found.kind == ""
    assert "decimal comma" in found.trouble


def test_what_is_no_text_or_no_numbers_says_so() -> None:
    binary = Recogniser()
    binary.feed(0.0, bytes(range(256)) * 8)
    assert binary.garbled
    assert "no text" in binary.found().text
    assert "no numbers" in recognised([f"A:{n} B:{n}" for n in range(50)]).trouble
    assert recognised(["1,2"]).text == "Waiting for lines."


@settings(max_examples=60)
@given(st.lists(st.binary(max_size=200), max_size=20))
def test_hostile_bytes_never_raise(parts) -> None:
    found = Recogniser()
    for n, part in enumerate(parts):
        found.feed(n * 0.1, part)
        assert found.found().text


@settings(max_examples=40)
@given(st.integers(1, 40), st.sampled_from([",", ";", "\t", " "]), st.integers(0, 2**31))
def test_whatever_numbers_are_sent_are_found_or_nothing_is(columns, separator, seed) -> None:
    values = rows(30, columns, seed)
    found = recognised([separator.join(map(repr, row)) for row in values.tolist()])

    assert found.kind == "text"
    np.testing.assert_array_equal(found.numbers, values)


@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize("name", READS)
def test_what_is_described_reads_what_was_sent(name, interleaved) -> None:
    reads = READS[name]
    values = rows(100, 6 * len(reads))
    lines = [f"{n * 10},{','.join(map(str, row))}" for n, row in enumerate(values.tolist())]
    found = recognised(lines)
    columns = columns_of(found, reads, interleaved)
    text = description_text(found, NewSensor("Board", (0.03, 0.02), (3, 2), columns, scale=1e-3))

    description = description_of(text, "board.toml")
    decoder = description.decoder(whole=True)
    samples = decoder.feed("".join(f"{line}\n" for line in lines).encode())
    assert len(samples) == 100
    assert samples[50].time == pytest.approx(0.5)
    sent = 1e-3 * values[50].reshape((6, -1) if interleaved else (-1, 6))
    first = sent[0] if interleaved else sent[:, 0]  # of element 0
    step = description.sensor.transduction.resolution
    got = samples[50].counts * step
    assert all(np.isclose(got, one, atol=1e-6).any() for one in first)
    assert columns[0] == "time_ms"
    assert description.sensor.plate.unknown_material


@pytest.mark.parametrize("key", ["h", "a key of 3 words", "\N{GREEK SMALL LETTER KAPPA}"])
def test_json_is_described_by_fields_and_a_mix_in_one_field_is_refused(key) -> None:
    lines = [json.dumps({"n": n, "skin": {key: row[:4]}}) for n, row in enumerate(rows().tolist())]
    found = recognised(lines)
    columns = columns_of(found, ("height",), False)
    text = description_text(found, NewSensor("Board", (0.02, 0.02), (2, 2), columns, 1e-3, 0.01))

    assert '"n" = "sequence"' in text or 'n = "sequence"' in text
    assert len(description_of(text, "b").decoder(whole=True).feed(f"{lines[5]}\n".encode())) == 1
    mixed = (*columns[:4], "slope@0:3")
    with pytest.raises(Refusal, match="one kind in skin"):
        description_text(found, NewSensor("Board", (0.02, 0.02), (2, 2), mixed))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"grid": (2, 2)}, "elements from 0 to 3"),
        ({"size": (0.0, 0.02)}, "two sides above zero"),
        ({"columns": ("", "", "", "", "", "", "")}, "expected columns with readings"),
        ({"scale": 0.0}, "scale other than 0"),
    ],
)
def test_what_cannot_be_is_refused_by_name(change, why) -> None:
    found = recognised([f"{n},{','.join(map(str, row))}" for n, row in enumerate(rows(100, 6))])
    given_ = {
        "title": "B",
        "size": (0.03, 0.02),
        "grid": (3, 2),
        "columns": columns_of(found, ("height",), False),
    }
    with pytest.raises(Refusal, match=why):
        description_text(found, NewSensor(**given_ | change))


class Wire:
    """A port whose board prints at 9600 baud; at another rate its bytes are garbled."""

    lost, empty = False, True

    def __init__(self, url, clock, baud, opened) -> None:
        self.baud, self._clock, self._n = baud, clock, 0

    def take(self, timeout):
        self._n += 1
        text = f"{self._n},{self._n % 7},{self._n % 5}\n".encode()
        data = text if self.baud == 9600 else bytes(255 - byte for byte in text)
        return [(self._clock(), data)]

    def set_baud_rate(self, baud) -> None:
        self.baud = baud

    def close(self) -> None:
        """Nothing to close."""


def test_the_baud_rate_is_found_by_trying(monkeypatch) -> None:
    monkeypatch.setattr("kappaskin.sources.recognition.SerialConnection", Wire)
    now = 0.0
    lines = RawLines("/dev/ttyX", lambda: now)
    rates = []
    for _ in range(200):
        lines.poll()
        rates.append(lines.baud)
        now += 0.05

    assert list(dict.fromkeys(rates)) == [115_200, 9600]
    assert len(lines.recogniser.found().labels) == 3
    lines.close()


def test_a_port_that_is_absent_is_tried_again(monkeypatch) -> None:
    def absent(*_):
        raise SourceError("/dev/ttyX: there is no such port")

    now = 0.0
    monkeypatch.setattr("kappaskin.sources.recognition.SerialConnection", absent)
    lines = RawLines("/dev/ttyX", lambda: now)
    lines.poll()
    assert lines.trouble == "/dev/ttyX: there is no such port; retrying."
    monkeypatch.setattr("kappaskin.sources.recognition.SerialConnection", Wire)
    lines.poll()
    assert lines.trouble
    now = 1.1
    lines.poll()
    assert lines.trouble == ""


@pytest.mark.parametrize("rate", [20.0, 700.0, 2000.0])
def test_times_are_found_at_any_rate(rate) -> None:
    lines = [f"{n * 1e3 / rate:.1f},{n},{n % 7}" for n in range(round(2 * rate))]

    assert recognised(lines, rate=rate).roles == ("time_ms", "sequence", None)


def test_elements_at_rest_are_readings() -> None:
    lines = [f"{n * 10}," + ",".join(["0"] * 12) for n in range(100)]
    assert recognised(lines).roles == ("time_ms", *[None] * 12)
    pressed = [f"{n * 10}," + ",".join(["0"] * 5 + [str(n % 9)] + ["0"] * 6) for n in range(100)]
    assert recognised(pressed).roles == ("time_ms", *[None] * 12)


@pytest.mark.parametrize("separator", [", ", ",", ";", "\t"])
@pytest.mark.parametrize("count", [1, 2, 4])
def test_no_decimal_comma_is_taken_for_a_separator(separator, count) -> None:
    lines = [separator.join(f"{v:.2f}".replace(".", ",") for v in row) for row in rows(99, count)]

    assert "decimal comma" in recognised(lines).trouble


@pytest.mark.parametrize("separator", [",", ", "])
def test_whole_numbers_are_no_decimal_commas(separator) -> None:
    whole = np.random.default_rng(2).integers(10, 1024, (99, 4))

    assert len(recognised([separator.join(map(str, row)) for row in whole]).labels) == 4


def test_elements_counted_along_x_first_are_placed_along_y_first() -> None:
    columns = ("time_ms", *(f"height:{k}" for k in range(6)))  # 3 in x, 2 in y

    assert by_rows(columns, (3, 2)) == (
        "time_ms",
        *("height:0", "height:2", "height:4", "height:1", "height:3", "height:5"),
    )
