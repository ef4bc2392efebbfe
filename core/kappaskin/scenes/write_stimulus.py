"""What touches the skin, and how it moves, to what a table [[touch]] of a scene file says."""

from typing import Any

from kappaskin.errors import Refusal
from kappaskin.mechanics import Load, RigidObject
from kappaskin.scenes.motion import Motion, Orbit, Path, Step
from kappaskin.scenes.read_stimulus import LOADS, OBJECTS, STEPS
from kappaskin.scenes.said import said_of
from kappaskin.scenes.stimulus import Indenter, Stimulus

TOUCH_UNITS = {"angle": "rad", "force": "N", "depth": "m", "turn": "rad"}


def touch_of(stimulus: Stimulus) -> dict[str, Any]:
    """What a [[touch]] says of the stimulus; what came from another file is refused."""
    what = stimulus.what
    said = _pressed(what) if isinstance(what, Indenter) else _load(what)
    return {**said, **_motion(stimulus.motion)}


def _name(among: dict[str, type[Any]], one: object) -> str:
    """What a file calls `one`; the first of two names for the same."""
    for name, kind in among.items():
        if type(one) is kind:
            return name
    raise Refusal(f"expected one of {', '.join(among)} to write in a scene file, got {one!r:.80}")


def _load(load: Load) -> dict[str, Any]:
    said = said_of(load, without=("force",))
    return {"what": _name(LOADS, load), **said, "force": float(load.force)}


def _pressed(what: Indenter) -> dict[str, Any]:
    return {"what": _object(what.rigid), **said_of(what.rigid), **said_of(what, without=("rigid",))}


def _object(rigid: RigidObject) -> str:
    name = _name(OBJECTS, rigid)
    if name in ("mesh", "heights"):
        raise Refusal(
            f"expected an object that a scene file describes, got a {type(rigid).__name__}, which "
            f"does not tell its file any more; write [[touch]] with what = {name!r} and the file "
            "by hand"
        )
    return name


def _motion(motion: Motion | None) -> dict[str, Any]:
    match motion:
        case None:
            return {}
        case Orbit():
            return {"orbit": said_of(motion)}
        case Path():
            return {"path": [_step(step) for step in motion.steps]}
        case _:
            raise Refusal(
                f"expected an orbit or a path to write in a scene file, got a "
                f"{type(motion).__name__} motion, which does not tell its file any more; write "
                "[[touch]] with recorded = the file by hand"
            )


def _step(step: Step) -> dict[str, Any]:
    time = ("seconds", "ease")
    said = said_of(step)
    last = {key: said.pop(key) for key in time if key in said}
    return {"step": _name(STEPS, step), **said, **last}
