"""Text from outside is harmless where it leaves: nothing unseen, and nothing that is run."""

import csv
import json
import re
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin._text import cell, json_cells, printable

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
