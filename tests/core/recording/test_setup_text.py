"""A setup written as text is the same again, and what is no setup is refused with its reason."""

import json

import pytest

from kappaskin import Refusal, Setup
from kappaskin.recording import setup_to_text
from kappaskin.recording.setup_text import setup_from_text

SETUP = Setup(6, 7, method="bayes", edge="clamped", hold=0.25)
SAID = json.loads(setup_to_text(SETUP)[0])


def no_file(name: str) -> bytes:
    raise AssertionError(f"nothing was to be read, but {name}")


def test_a_setup_comes_back_from_its_text() -> None:
    text, files = setup_to_text(SETUP)

    assert files == {}
    assert setup_from_text(text, no_file) == SETUP


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (" " * 65537, "65537 characters"),
        ("[6, 7]", "no keys"),
        ("no json", "Expecting value"),
        (json.dumps({**SAID, "colour": "red"}), "unknown keys .'colour'"),
        (json.dumps({**SAID, "Ni": 0}), "Ni is 0"),
        (json.dumps({**SAID, "Nj": 4097}), "Nj is 4097"),
        (json.dumps({**SAID, "nx": 65.0}), "nx is 65.0"),
        (json.dumps({**SAID, "hold": "long"}), "could not convert"),
        (json.dumps({**SAID, "edge": 3}), "edge is 3"),
        (json.dumps({**SAID, "method": "guess"}), "method is 'guess', expected one of"),
        (json.dumps({name: SAID[name] for name in SAID if name != "Ni"}), "'Ni'"),
    ],
)
def test_what_is_no_setup_is_refused_with_its_reason(text: str, why: str) -> None:
    with pytest.raises(Refusal, match=f"expected a setup as it was recorded: .*{why}"):
        setup_from_text(text, no_file)
