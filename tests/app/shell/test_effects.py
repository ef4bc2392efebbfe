"""What effects are called and what is told of them."""

import pytest

from kappaskin.scenes.effects import EFFECTS
from kappaskin_app.shell.effects import effect_description, effect_name


def test_effects_have_names_of_their_own_in_words() -> None:
    names = [effect_name(effect) for effect in EFFECTS]

    assert len(set(names)) == len(names)
    assert all(name[0].isupper() and "-" not in name for name in names)
    assert {"Finite slope", "Dead elements"} <= set(names)


@pytest.mark.parametrize("effect", EFFECTS)
def test_each_effect_says_in_sentences_what_it_does(effect: str) -> None:
    words = effect_description(effect)

    assert words.endswith(".")
    assert not set("`\n") & set(words)


def test_of_an_effect_that_is_not_known_its_name_is_told_and_no_more() -> None:
    assert effect_name("un-known") == "Un known"
    assert effect_description("un-known") == ""
