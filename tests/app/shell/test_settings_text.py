from dataclasses import fields, replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kappaskin import Refusal
from kappaskin_app.shell.recovery import OF_SENSORS, settings_in, settings_text
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import Written

_OF = {
    bool: st.booleans(),
    int: st.integers(-(2**40), 2**40),
    float: st.floats(allow_nan=False),
    str: st.text(),
    tuple: st.lists(st.integers(0, 999)).map(tuple),
    dict: st.dictionaries(st.text(), st.floats(allow_nan=False)),
    type(None): st.none() | st.builds(Written, st.text(), st.just(Path("/there/own.toml"))),
}
_ANY = {
    f.name: _OF[type(getattr(Settings(), f.name))]
    for f in fields(Settings)
    if f.name not in OF_SENSORS
}


@settings(max_examples=25)
@given(st.fixed_dictionaries({}, optional=_ANY))
def test_settings_survive_their_text(changed: dict[str, object]) -> None:
    made = replace(Settings(), **changed)
    assert settings_in(settings_text(made)) == made


def test_what_a_text_does_not_say_is_as_at_the_beginning() -> None:
    said = '{"version": 1, "settings": {"functions_x": 5, "of_another_time": 3}}'
    assert settings_in(said) == Settings(functions_x=5)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[]", "settings as JSON"),
        ("{", "settings as JSON"),
        ('{"version": 2, "settings": {}}', "version 1, got 2"),
        ('{"version": 1, "settings": {"functions_x": "many"}}', "functions_x: expected int"),
        ('{"version": 1, "settings": {"written": 5}}', "written: expected text and file"),
        ('{"version": 1, "settings": {"written": {"text": ""}}}', "expected text and file"),
        ('{"version": 1, "settings": {"show_truth": 1}}', "show_truth: expected bool"),
        ('{"version": 1, "settings": {"ranges": {"height": "low"}}}', "ranges: expected dict"),
    ],
)
def test_a_text_that_says_no_settings_is_refused(text: str, why: str) -> None:
    with pytest.raises(Refusal, match=why):
        settings_in(text)
