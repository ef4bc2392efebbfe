"""Numbers have the digits that their errors leave; text from outside is harmless."""

import csv
import json
import math
import re
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin._text import NONE, cell, json_cells, printable, rounded, with_error

ANY = st.text(st.characters(codec=None), max_size=30)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[2J", r"\x1b[2J"),
        ("a\r\nb\tc\0\x07\x7f", r"a\r\nb\tc\x00\x07\x7f"),
        ("\x85\x9b31m", r"\x85\x9b31m"),
        ("gpj\u202efdp\u2066\u200f", r"gpj\u202efdp\u2066\u200f"),
        ("a\u2028b\u2029", r"a\u2028b\u2029"),
        ("\ud800\udfff", r"\ud800\udfff"),
        ("\u200b\ufeff\U000e0041", r"\u200b\ufeff\U000e0041"),
        ("\uffff", r"\uffff"),
    ],
)
def test_what_cannot_be_seen_is_written_out(text: str, shown: str) -> None:
    assert printable(text) == shown
    assert printable(shown) == shown


@pytest.mark.parametrize(
    "text", ["", "Haut № 7, 皮膚", "5 µm – é \N{NO-BREAK SPACE} 🙂", r"C:\x1b"]
)
def test_other_text_stays(text: str) -> None:
    assert printable(text) == text


@given(ANY)
def test_only_what_is_kept_is_left(text: str) -> None:
    lines = printable(text, keep="\n")
    assert lines.count("\n") == text.count("\n")
    for shown in (printable(text), lines.replace("\n", "")):
        assert not {unicodedata.category(c) for c in shown} & {"Cc", "Cf", "Cs", "Cn", "Zl", "Zp"}
        shown.encode()  # which surrogates cannot be


@pytest.mark.parametrize("sign", ["=", "+", "-", "@", " =", "\xa0="])
def test_a_formula_becomes_text_in_a_cell(sign: str) -> None:
    assert cell(f"{sign}HYPERLINK(1)") == f"'{sign}HYPERLINK(1)"
    assert cell(f"a{sign}b") == f"a{sign}b"
    assert cell("\t=1") == r"\t=1"


_NUMBER = re.compile(r"-?[\d.]+(e[+-]?\d+)?[\]}]*$")


@pytest.mark.full
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False)
        | st.text('=+-@,;" \\\t\n1ab') | st.text(),
        lambda inside: st.lists(inside) | st.dictionaries(st.text('=+-@,;" ab'), inside),
    )
)  # fmt: skip
def test_no_text_in_json_begins_a_cell_with_a_formula(value: object) -> None:
    text = json_cells(value)
    assert json.loads(text) == value
    for row in (csv.reader([text]), csv.reader([text], delimiter=";"), [re.split("[,;]", text)]):
        for found in next(iter(row))[1:]:
            begins = found.strip(' "[{')
            assert begins[:1] not in ("=", "+", "@"), found
            assert begins[:1] != "-" or _NUMBER.match(begins), found


VALUES = st.floats(-1e8, 1e8)


def _decimals(text: str) -> int:
    return len(text.partition(".")[2])


@given(VALUES, st.floats(1e-6, 1e8))
def test_an_error_has_two_digits_and_its_value_ends_at_the_same_place(value, error) -> None:
    text, bar = rounded(value, error)
    if bar == "exact":  # less than rounding leaves of the value
        assert error <= 1e-9 * max(1.0, abs(value))
        return
    assert len(bar.replace(".", "").lstrip("0").rstrip("0")) <= 2
    if error < 99.4:
        assert len(bar.replace(".", "").lstrip("0")) == 2
    assert _decimals(text) == _decimals(bar)
    unit = 10.0 ** (math.floor(math.log10(float(bar))) - 1)  # of the second digit
    shown = float(text.replace("\N{MINUS SIGN}", "-"))
    assert abs(float(bar) - error) <= 0.51 * unit
    assert abs(shown - value) <= 0.51 * unit
    assert abs(shown / unit - round(shown / unit)) < 1e-4  # nothing below that place


@given(VALUES, st.sampled_from(["mm", "N", "1/m"]))
def test_an_error_of_nothing_is_exact_and_never_a_bar(value, unit) -> None:
    text = with_error(value, 0.0, unit)
    assert text.endswith(f" {unit} exact")
    assert "\N{PLUS-MINUS SIGN}" not in text


@given(VALUES, st.integers(0, 6))
def test_a_value_of_unknown_error_has_the_digits_asked_for_and_no_bar(value, digits) -> None:
    text = with_error(value, math.nan, "N", digits)
    assert text.endswith(" N")
    assert _decimals(text.removesuffix(" N")) == digits
    assert "\N{PLUS-MINUS SIGN}" not in text


@given(
    st.sampled_from([(math.nan, 1.0), (1.0, math.inf), (1.0, 1e12), (math.inf, 1.0), (-1e10, 1.0)])
)
def test_what_is_unknown_or_known_to_nothing_is_a_dash_without_a_unit(of) -> None:
    assert with_error(*of, "N") == NONE


@given(st.floats() | st.integers(-(10**6), 10**6), st.floats(min_value=0.0) | st.just(math.nan))
def test_no_number_is_written_as_nan_or_with_a_minus_before_a_zero(value, error) -> None:
    text = with_error(value, error, "N")
    assert "nan" not in text
    assert "inf" not in text
    assert not re.match(r"\N{MINUS SIGN}[0.]+( |$)", text)


@pytest.mark.parametrize(
    ("value", "error", "sign", "text"),
    [
        (0.14881, 0.00104, "", "0.1488 \N{PLUS-MINUS SIGN} 0.0010 N"),
        (0.5, 0.0996, "+", "+0.50 \N{PLUS-MINUS SIGN} 0.10 N"),
        (1153.772, 1482.331, "", "1200 \N{PLUS-MINUS SIGN} 1500 N"),
        (-0.0001, 0.012, "+", "+0.000 \N{PLUS-MINUS SIGN} 0.012 N"),
        (-3.0, 0.28, "", "\N{MINUS SIGN}3.00 \N{PLUS-MINUS SIGN} 0.28 N"),
        (60.0, 1e-12, "", "60.000 N exact"),
    ],
)
def test_numbers_are_written_as_an_instrument_writes_them(value, error, sign, text) -> None:
    assert with_error(value, error, "N", sign=sign) == text
