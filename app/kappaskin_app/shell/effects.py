"""Names and descriptions of effects."""

import inspect

from kappaskin.scenes.effects import EFFECTS


def called(effect: str) -> str:
    """What people call an effect, also one that is not known."""
    kind = EFFECTS.get(effect)
    return kind.called() if kind else effect.replace("-", " ").capitalize()


def explained(effect: str) -> str:
    """What an effect does, in sentences; nothing of one that is not known."""
    kind = EFFECTS.get(effect)
    return " ".join(inspect.cleandoc(kind.__doc__ or "").split()).replace("`", "") if kind else ""
