"""The name that a scene file has for an effect to words: what it is called, and what it does."""

import inspect

from kappaskin.scenes.effects import EFFECTS

_CALLED = {"dead": "Dead elements", "stuck": "Stuck elements", "intermittent": "Loose elements"}


def called(effect: str) -> str:
    """What people call an effect, also one that is not known."""
    return _CALLED.get(effect, effect.replace("-", " ").capitalize())


def explained(effect: str) -> str:
    """What an effect does, in sentences; nothing of one that is not known."""
    kind = EFFECTS.get(effect)
    return " ".join(inspect.cleandoc(kind.__doc__ or "").split()).replace("`", "") if kind else ""
