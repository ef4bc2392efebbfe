"""Sentences from texts of the library."""

import pytest

from kappaskin_app.widgets.parts import sentence


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("expected a port, got none", "Expected a port, got none."),
        ("resources/x.mcap: cannot be read", "resources/x.mcap: cannot be read."),
        ("feed:glove: connection lost", "feed:glove: connection lost."),
        ("/dev/ttyACM0: busy", "/dev/ttyACM0: busy."),
        ("slopes: too large!", "Slopes: too large!"),
        ("", ""),
    ],
)
def test_a_text_becomes_a_sentence_and_a_name_stays_as_it_is(text: str, words: str) -> None:
    assert sentence(text) == words
