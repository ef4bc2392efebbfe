"""A setup is declared once; written as text it is the same again, or refused with its reason."""

import inspect
import json
from dataclasses import fields

import pytest

from kappaskin import Refusal, Setup
from kappaskin.bases import EDGES
from kappaskin.cli.record import reconstruct
from kappaskin.estimation import METHODS
from kappaskin.pipeline import SETUP, setup_from_text, setup_to_text

SENT = Setup(6, 7, method="bayes", edge="clamped", hold=0.25)
SAID = json.loads(setup_to_text(SENT)[0])


def no_file(name: str) -> bytes:
    raise AssertionError(f"nothing was to be read, but {name}")


def test_a_setup_comes_back_from_its_text() -> None:
    text, files = setup_to_text(SENT)

    assert files == {}
    assert setup_from_text(text, no_file) == SENT


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (" " * 65537, "at most 65536 characters, got 65537"),
        ("[6, 7]", "an object with keys, got"),
        ("no json", "Expecting value"),
        (json.dumps({**SAID, "colour": "red"}), "colour: expected no such key"),
        (json.dumps({**SAID, "Ni": 0}), "Ni: expected 1 to 4096, a whole number, got 0"),
        (json.dumps({**SAID, "Nj": 4097}), "Nj: expected 1 to 4096, a whole number, got 4097"),
        (json.dumps({**SAID, "nx": 65.0}), "nx: expected a whole number, got 65.0"),
        (json.dumps({**SAID, "hold": "long"}), "hold: expected a number, got 'long'"),
        (json.dumps({**SAID, "hold": float("nan")}), "expected a number, got NaN"),
        (json.dumps({**SAID, "rim_sd": -1e-3}), "rim_sd: expected at least 0, got -0.001"),
        (json.dumps({**SAID, "edge": 3}), "edge: expected a text, got 3"),
        (json.dumps({**SAID, "edge": "glued"}), "edge: expected one of .*, got 'glued'"),
        (json.dumps({**SAID, "method": "guess"}), "method: expected one of .*, got 'guess'"),
        (json.dumps({**SAID, "tare": 3}), "tare: expected a text, got 3"),
        *(
            (json.dumps({name: SAID[name] for name in SAID if name != missing}), f"{missing} = ")
            for missing in SAID
        ),
    ],
)
def test_what_is_no_setup_is_refused_with_its_reason(text: str, why: str) -> None:
    with pytest.raises(Refusal, match=f"expected a setup as it was recorded: .*{why}"):
        setup_from_text(text, no_file)


def test_every_field_of_a_setup_is_declared_with_words() -> None:
    assert SETUP.keys.keys() == {field.name for field in fields(Setup)} - {"quantities"}
    for name in SETUP.keys:
        assert SETUP.key(name).label
        assert SETUP.key(name).tip.endswith(".")


def test_every_estimator_and_edge_there_is_can_be_chosen() -> None:
    assert {name for name, _ in SETUP.key("method").choices} == METHODS.keys()
    assert [name for name, _ in SETUP.key("edge").choices] == ["", *EDGES]


def test_the_command_reconstruct_begins_with_a_setups_values_and_names_all_choices() -> None:
    options, usual = inspect.signature(reconstruct).parameters, Setup()
    assert options["method"].default == usual.method
    assert options["basis"].default == f"{usual.Ni}x{usual.Nj}"
    for name in (*METHODS, *EDGES):
        assert name in str(reconstruct.__doc__)
