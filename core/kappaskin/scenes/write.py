"""Writing scene files: a scene to the text that `read_scene` reads as the same scene."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any, cast, get_args, get_origin, get_type_hints

import numpy as np

from kappaskin._schema import PartKind
from kappaskin._toml import table
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import Load, RigidObject
from kappaskin.scenes.cylinders import RADII, Presentation, schedule
from kappaskin.scenes.effect_plan import effects_of
from kappaskin.scenes.effects import EFFECTS, Effect, StrainLimit
from kappaskin.scenes.read import CHAINS, LOOPS, read_scene, usual_reference
from kappaskin.scenes.scene import Scene
from kappaskin.scenes.schema import (
    CYLINDERS,
    EFFECT,
    ELECTRONICS,
    ELEMENTS,
    FORMAT,
    LOADS,
    OBJECTS,
    PARTS,
    READINGS,
    SCENE,
    SKIN,
    STEP,
    TOUCH,
)
from kappaskin.scenes.stimulus import Indenter, Motion, MotionPath, MotionStep, Orbit, Stimulus
from kappaskin.sensing import DigitalReadings, SensorLayout, Transduction
from kappaskin.skin import Cap, Disk, MeshSkin, Patch, Polygon

_MOST_CELLS = 2**20  # of a grid that is looked for


def write_scene(scene: Scene) -> str:
    """The text of a file of `scene`, whose name is the file's.

    `on` of effects that the scene lacks has no effect, and is left out. What no file can
    say is refused: objects and motions that came from files of their own, or 20 m of skin.
    """
    scene.sensor()  # as when reading, an impossible rate is refused
    tables = [
        table("", _top(scene), SCENE.comments()),
        table("[skin]", _skin(scene), SKIN.comments()),
        table("[elements]", _elements(scene.layout), ELEMENTS.comments()),
        *_electronics(scene.transduction),
    ]
    if scene.laid is not None:
        tables.append(
            table("[cylinders]", _cylinders(scene.laid, scene.plate.patch), CYLINDERS.comments())
        )
    tables += _effects(scene)
    tables += [table("[[touch]]", _touch(each), TOUCH.comments()) for each in scene.stimuli]
    text = "\n".join(tables)
    read_scene(text, Path(f"{scene.name}.toml"))  # it refuses what is beyond the limits of a file
    return text


def _top(scene: Scene) -> dict[str, Any]:
    usual = {key: SCENE.key(key).default for key in SCENE.keys}
    usual |= {"title": scene.name, "reference": usual_reference(scene.plate.patch)}
    written = {
        "format": FORMAT,
        "title": scene.title or scene.name,
        "text": scene.text,
        "rate": float(scene.rate),
        "seed": int(scene.seed),
        "reference": tuple(int(count) for count in scene.reference),
        "accuracy": float(scene.choice.accuracy),
    }
    changes = {key: value for key, value in written.items() if value != usual[key]}
    return {key: [*value] if isinstance(value, tuple) else value for key, value in changes.items()}


def _skin(scene: Scene) -> dict[str, Any]:
    held = {} if scene.edge == SKIN.key("edge").default else {"edge": scene.edge}
    return {**_patch(scene.plate.patch), **_fields(scene.plate, without=("patch",)), **held}


def _patch(patch: Patch) -> dict[str, Any]:
    match patch:
        case Cap():
            each = {key: float(getattr(patch, key)) for key in ("angle", "stretch")}
            more = {key: value for key, value in each.items() if value != SKIN.key(key).default}
            return {"shape": "cap", "radius": float(patch.equator), **more}
        case Disk():
            return {"shape": "disk", "rim_radius": float(patch.rim_radius)}
        case MeshSkin():
            return {"shape": "mesh", "mesh": patch.text}
        case Polygon():
            return {"shape": "polygon", "outline": [list(corner) for corner in patch.vertices]}
        case _:
            shape = {"shape": "strip"} if patch.strip else {}
            size = {"size": [float(patch.a), float(patch.b)]}
            return {**shape, **size, **_fields(patch, without=("a", "b", "strip"))}


def _elements(layout: SensorLayout) -> dict[str, Any]:
    grid = _grid(layout)
    made = SensorLayout.scattered(layout.patch, layout.positions) if grid is None else grid[1]
    made, dead, turns = made.reading_each(layout.each_reads), layout.dead, layout.turns
    made = made if turns is None else made.turned(turns)
    if made.shape != layout.shape or (made.without(dead).live != layout.live).any():
        raise Refusal(
            "expected elements that a scene file can describe, got a grid that is not regular, or "
            "elements with some dead channels; all channels of a dead element must be dead"
        )
    placed = {"positions": layout.positions.tolist()} if grid is None else {"grid": list(grid[0])}
    gages = _fields(layout, without=("patch", "positions", "live", "shape", "reads"))
    reads = {"reads": layout.each_reads} if layout.reads else {}
    ways = {} if turns is None else {"turns": turns.tolist()}
    return {**placed, **({"dead": dead} if dead else {}), **gages, **reads, **ways}


def _grid(layout: SensorLayout) -> tuple[tuple[int, int], SensorLayout] | None:
    """The numbers of a regular grid and its elements, if the layout's are those."""
    patch, places = layout.patch, layout.positions
    m, n = layout.shape or (_cells(places[:, 0], patch.a), _cells(places[:, 1], patch.b))
    if m * n > _MOST_CELLS:
        return None
    with suppress(Refusal):  # of cells whose centres are all off a polygon
        made = SensorLayout.regular(patch, m, n)
        if made.shape == layout.shape and np.array_equal(made.positions, places):
            return (m, n), made
    return None


def _cells(places: Array, side: float) -> int:
    """How many cells of a `side` have centres as near one another as `places` (P,) are."""
    return round(side / float(np.diff(np.unique(places)).min(initial=side)))


def _readings(digital: DigitalReadings) -> list[str]:
    """The tables of digital readings."""
    noise = {name: float(each) for name, each in digital.noise}
    alike = len(set(noise.values())) == 1
    top = _fields(digital, without=("noise",)) | ({"noise": min(noise.values())} if alike else {})
    tables = [table("[readings]", top, READINGS.comments())] if top else []
    each = {} if alike else noise
    return tables + [table(f"[readings.{name}]", {"noise": each[name]}, {}) for name in each]


def _electronics(electronics: Transduction | DigitalReadings) -> list[str]:
    """The tables of what differs from the chain that the electronics are most like."""
    if isinstance(electronics, DigitalReadings):
        return _readings(electronics)
    each = {name: _changes(electronics, chain) for name, chain in CHAINS.items()}
    like = min(each, key=lambda name: sum(map(len, each[name].values())))
    usual = ELECTRONICS.key("like").default
    tables = [] if like == usual else [table("[electronics]", {"like": like})]
    parts = {name: values for name, values in each[like].items() if values}
    return tables + [
        table(f"[electronics.{name}]", parts[name], PARTS[name].comments()) for name in parts
    ]


def _changes(electronics: Transduction, chain: Transduction) -> dict[str, dict[str, Any]]:
    """The keys of each part that differ from `chain`."""
    names = [field.name for field in fields(chain)]
    return {name: _fields(getattr(electronics, name), getattr(chain, name)) for name in names}


def _cylinders(laid: Presentation, patch: Patch) -> dict[str, Any]:
    radii = tuple(sorted({s.radius for s in laid.steps if not s.flat}, reverse=True))
    hold = max(step.hold for step in laid.steps)
    usual = ()
    with suppress(Refusal):  # of radii that no schedule has
        usual = schedule(radii, hold, patch.strip)
    if laid.steps != usual:
        raise Refusal(
            "expected cylinders in the order of a schedule, as in a scene file, "
            f"got {len(laid.steps)} other steps; take those of kappaskin.scenes.schedule"
        )
    values = {"radii": list(radii)} if radii != RADII else {}
    return {**({"hold": float(hold)} if hold else {}), **values, "dwell": float(laid.dwell)}


def _effects(scene: Scene) -> list[str]:
    names = [effect.name for effect in scene.effects]
    if names != (ordered := [name for name in EFFECTS if name in names]):
        raise Refusal(
            "expected known effects in the order in which they act, which is that of a "
            f"scene file, {', '.join(ordered)}; got {', '.join(names)}"
        )
    choice = _choice(scene)
    tables = [table("[effects]", choice)] if choice else []
    return tables + [
        table(f"[effects.{effect.name}]", _effect(effect, scene), EFFECT.comments(effect.name))
        for effect in scene.effects
    ]


def _effect(effect: Effect, scene: Scene) -> dict[str, Any]:
    if type(effect) is not EFFECTS[effect.name] or effect.elsewhere:
        why = effect.elsewhere or "it is not a known effect"
        raise Refusal(f"expected no {effect!r:.80} among the effects of a scene file: {why}")
    for name, loops in LOOPS.items():
        if effect == loops:
            return {"like": name}
    if isinstance(effect, StrainLimit) and effect.transduction != scene.transduction:
        raise Refusal("expected a strain limit of the scene's own electronics, got another one")
    return _fields(effect, without=("transduction",))


def _choice(scene: Scene) -> dict[str, Any]:
    """The keys `choose`, `on` and `off` of the file."""
    choice, off = scene.choice, scene.choice.off
    on = choice.on & effects_of(scene).keys()
    named: dict[str, Any] = {}
    if not choice.auto and choice.on | off == EFFECTS.keys():
        return {"choose": [name for name in EFFECTS if name in on]}
    if not choice.auto:
        linear = "finite-slope" in off
        off = off - {"finite-slope"}
        named = {"choose": "linear" if linear else "all"}
    forced = {"on": on, "off": off}
    lists = {key: [name for name in EFFECTS if name in forced[key]] for key in forced}
    return named | {key: names for key, names in lists.items() if names}


def _touch(stimulus: Stimulus) -> dict[str, Any]:
    """The [[touch]] table of the stimulus; one that was read from another file is refused."""
    what = stimulus.what
    values = _pressed(what) if isinstance(what, Indenter) else _load(what)
    return {**values, **_motion(stimulus.motion)}


def _name(among: Mapping[str, PartKind], one: object) -> str:
    """The name of `one` in a file; the first of two names."""
    for name, kind in among.items():
        if type(one) is kind.made:
            return name
    raise Refusal(f"expected one of {', '.join(among)} to write in a scene file, got {one!r:.80}")


def _load(load: Load) -> dict[str, Any]:
    values = _fields(load, without=("force",))
    return {"what": _name(LOADS, load), **values, "force": float(load.force)}


def _pressed(what: Indenter) -> dict[str, Any]:
    return {
        "what": _object(what.rigid),
        **_fields(what.rigid),
        **_fields(what, without=("rigid",)),
    }


_FROM_FILES = {"mesh": "an object from a mesh file", "heights": "an object from a height map"}


def _object(rigid: RigidObject) -> str:
    name = _name(OBJECTS, rigid)
    if name in _FROM_FILES:
        raise Refusal(
            f"expected an object that a scene file describes, got {_FROM_FILES[name]}, which "
            f"has no record of its file; write [[touch]] with what = {name!r} and the file "
            "by hand"
        )
    return name


def _motion(motion: Motion | None) -> dict[str, Any]:
    match motion:
        case None:
            return {}
        case Orbit():
            return {"orbit": _fields(motion)}
        case MotionPath():
            return {"path": [_step(step) for step in motion.steps]}
        case _:
            raise Refusal(
                "expected an orbit or a path to write in a scene file, got a recorded motion, "
                "which has no record of its file; write [[touch]] with recorded = the file by hand"
            )


def _step(step: MotionStep) -> dict[str, Any]:
    time = ("seconds", "ease")
    values = _fields(step)
    last = {key: values.pop(key) for key in time if key in values}
    return {"step": _name(STEP.kinds, step), **values, **last}


def _fields(owner: object, usual: object = None, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """The fields of a dataclass that are not as `usual`, their defaults when left out."""
    hints = get_type_hints(type(owner))
    values = dict[str, Any]()
    for field in fields(cast("Any", owner)):
        value = getattr(owner, field.name)
        expected = field.default if usual is None else getattr(usual, field.name)
        if field.init and field.name not in without and value != expected:
            values[field.name] = _toml(value, hints[field.name])
    return values


def _toml(value: Any, kind: Any) -> Any:
    """The `value` as TOML has it: a number where `kind` is float is one, however it came."""
    if isinstance(value, tuple):
        each = next(get_args(one)[0] for one in (kind, *get_args(kind)) if get_origin(one) is tuple)
        return [_toml(one, each) for one in cast("tuple[Any, ...]", value)]
    if isinstance(value, bool | str):
        return value
    return float(value) if kind is float or float in get_args(kind) else int(value)
