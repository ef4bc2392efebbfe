"""The text of a scene file to the scene: strict, and every refusal names its line."""

import math
import re
import tomllib
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from pathlib import Path as FilePath
from typing import Any, cast, get_type_hints

from kappaskin.bases import EDGES, basis_for
from kappaskin.errors import Refusal
from kappaskin.mechanics import Plate
from kappaskin.scenes.choice import LINEAR, Choice
from kappaskin.scenes.cylinders import Presentation, schedule
from kappaskin.scenes.effects import EFFECTS
from kappaskin.scenes.effects.effect import Effect
from kappaskin.scenes.effects.failures import IntermittentElements, StuckElements
from kappaskin.scenes.effects.hysteresis import FIRST_GENERATION_LOOPS, SECOND_GENERATION_LOOPS
from kappaskin.scenes.effects.strain_limit import StrainLimit
from kappaskin.scenes.limits import (
    DWELL,
    HOLD,
    RADII,
    RATE,
    SEED,
    SKIN,
    check_elements,
    check_functions,
    check_sides,
)
from kappaskin.scenes.lines import Lines
from kappaskin.scenes.plan import effects_of
from kappaskin.scenes.read_stimulus import read_stimulus
from kappaskin.scenes.scene import Scene, scaled_to
from kappaskin.scenes.table import Table
from kappaskin.sensing import FIRST_GENERATION, SECOND_GENERATION, SensorLayout, Transduction
from kappaskin.skin import Disk, Patch, Polygon

FORMAT = 1
_LARGEST = 2**24  # bytes
_DEEP = re.compile(r"(?:\.[\w\"'-]+){64}")  # tables in tables, which take long to read

ELECTRONICS = {"modern": Transduction(), "second": SECOND_GENERATION, "first": FIRST_GENERATION}
ELSEWHERE = {
    "tension": "[skin] has the tension",
    "foam": "[skin] has the foundation",
    "fluid": "[skin] has the fluid",
    "dead": "[elements] has those that are dead",
    "gage-length": "[elements] has the gage_length",
    "finite-slope": "it has no numbers: name it in choose, on or off",
    "skew": "the converter's times make it",
    "saturation": "the amplifier and the converter make it",
    "quantisation": "the converter makes it",
}
"""Effects that follow from what a scene says elsewhere."""

LOOPS = {"second": SECOND_GENERATION_LOOPS, "first": FIRST_GENERATION_LOOPS}


def parsed(text: str, file: FilePath) -> dict[str, Any]:
    """What the TOML `text`, of `file`, says."""
    try:
        if _DEEP.search(text):
            raise RecursionError
        return tomllib.loads(text)
    except ValueError as error:  # a whole number of thousands of digits is one of these, too
        raise Refusal(f"{file}: expected a scene in TOML, got a mistake in it: {error}") from error
    except RecursionError as error:
        raise Refusal(f"{file}: expected a scene, got tables or lists nested too deep") from error


def read_scene(text: str, file: FilePath) -> Scene:
    """The scene that `text`, of `file`, describes; files that it names lie beside it."""
    return scene_of(Table(parsed(text, file), Lines(text), str(file)), file)


def scene_of(top: Table, file: FilePath) -> Scene:
    """The scene that a file says at its `top`, besides what somebody else has asked for there."""
    name, folder = file.stem.removesuffix(".scene"), file.parent
    if (version := top.get("format", int)) != FORMAT:
        raise top.refusal(
            f"expected a scene of format {FORMAT}, got {version}; get a newer kappaskin"
            if version > FORMAT
            else f"expected format = {FORMAT}, got {version}",
            "format",
        )
    plate, edge = _skin(top.table("skin"))
    layout = _elements(top.table("elements"), plate.patch)
    reference = top.get("reference", tuple[int, int], (15, 1 if plate.patch.strip else 15))
    basis = partial(basis_for, plate.patch, edge, *reference)
    with top.blamed("reference"):
        check_functions(plate.patch, edge, reference, len(layout))
        basis()
    stimuli = tuple(
        read_stimulus(table, plate, lambda load, by: scaled_to(plate, load, by, basis()), folder)
        for table in top.tables("touch")
    )
    electronics = _electronics(top.table("electronics"))
    choice, effects = _effects(top, electronics, layout)
    rate, seed = top.get("rate", float, 500.0, RATE), top.get("seed", int, 0, SEED)
    with top.blamed():
        scene = Scene(
            name,
            plate,
            layout,
            stimuli,
            effects,
            electronics,
            rate,
            seed,
            reference,
            edge,
            choice=choice,
            title=top.get("title", str, name),
            text=top.get("text", str, ""),
        )
        with top.blamed("rate"):
            scene.sensor()
        if "cylinders" in top:
            if stimuli:
                touch = top.tables("touch")[0]
                raise touch.refusal("expected none on a skin that lies on cylinders")
            scene = scene.laid_on(_cylinders(top.table("cylinders"), scene))
    top.done()
    if absent := sorted(_wanted(top.table("effects")) - effects_of(scene).keys()):
        raise top.table("effects").refusal(
            f"expected effects that there is something of in this scene, got {', '.join(absent)}; "
            "say how large they are, or leave them out"
        )
    return scene


def _skin(table: Table) -> tuple[Plate, str]:
    shapes: dict[str, Callable[[], Patch]] = {
        "rectangle": lambda: _rectangle(table, strip=False),
        "strip": lambda: _rectangle(table, strip=True),
        "disk": lambda: Disk(table.get("rim_radius", float)),
        "polygon": lambda: Polygon(table.get("outline", tuple[tuple[float, float], ...])),
    }
    make = table.choose("shape", shapes, "rectangle")
    with table.blamed():
        patch = make()
        check_sides(patch)
    for name, within in SKIN.items():
        if table.get(name, float, 0.0):  # with no tension at all, say, it is none
            table.get(name, float, within=within)
    plate = table.make(Plate, patch=patch)
    edge = table.choose("edge", {edge: edge for edge in EDGES}, "hinged")
    table.done()
    return plate, edge


def _rectangle(table: Table, strip: bool) -> Patch:
    a, b = table.get("size", tuple[float, float])
    return Patch(a, b, table.get("radius", float, math.inf), strip)


def _elements(table: Table, patch: Patch) -> SensorLayout:
    with table.blamed():
        if "positions" in table:
            layout = SensorLayout.scattered(
                patch, table.get("positions", tuple[tuple[float, float], ...])
            )
        else:
            grid = table.get("grid", tuple[int, int], (10, 10))
            check_elements(*grid)
            layout = SensorLayout.regular(patch, *grid)
        check_elements(len(layout))
        layout = layout.without(table.get("dead", tuple[int, ...], ()))
        layout = replace(layout, gage_length=table.get("gage_length", float, 0.0))
    table.done()
    return layout


def _electronics(table: Table) -> Transduction:
    chain = table.choose("like", ELECTRONICS, "modern")
    parts = {
        name: _changed(table.table(name), getattr(chain, name))
        for name in ("bridge", "multiplexer", "amplifier", "converter")
    }
    table.done()
    with table.blamed():
        return replace(chain, **parts)


def _changed(table: Table, part: Any) -> Any:
    """The `part` of the electronics with what the table says of it."""
    hints = get_type_hints(cast("type[Any]", type(part)))
    said = {f.name: table.get(f.name, hints[f.name]) for f in fields(part) if f.name in table}
    table.done()
    with table.blamed():
        return replace(part, **said)


def _cylinders(table: Table, scene: Scene) -> Presentation:
    hold = table.get("hold", float, 0.0, HOLD)
    radii = table.get("radii", tuple[float, ...], (), RADII)
    with table.blamed():
        strip = scene.plate.patch.strip
        steps = schedule(radii, hold, strip) if radii else schedule(hold=hold, strip=strip)
        made = Presentation(steps, table.get("dwell", float, 1.0, DWELL))
    table.done()
    return made


def _effects(
    top: Table, electronics: Transduction, layout: SensorLayout
) -> tuple[Choice, tuple[Effect, ...]]:
    """Which effects the file chooses, and those that it says the parameters of."""
    table = top.table("effects")
    found = list[Effect]()
    for name, kind in EFFECTS.items():
        if name in table:
            said = table.table(name)
            if name in ELSEWHERE:
                raise said.refusal(f"expected no such table; {ELSEWHERE[name]}")
            if name == "hysteresis" and "like" in said:
                found.append(said.choose("like", LOOPS))
            elif kind is StrainLimit:
                found.append(said.make(kind, transduction=electronics))
            else:
                found.append(said.make(kind))
            said.done()
            if isinstance(effect := found[-1], StuckElements | IntermittentElements):
                with said.blamed("elements"):
                    effect.channels((3 * len(layout),))
    accuracy = top.get("accuracy", float, 0.01)
    with top.blamed("accuracy"):
        Choice(accuracy=accuracy)
    with table.blamed("choose"):
        choice = _choice(table, accuracy)
    table.done(*EFFECTS)
    return choice, tuple(found)


def _choice(table: Table, accuracy: float) -> Choice:
    """`choose` is auto, all, linear or a list of names; `on` and `off` force some."""
    on, off = (frozenset(table.get(key, tuple[str, ...], ())) for key in ("on", "off"))
    if not isinstance(named := table.get("choose", str | tuple[str, ...], "auto"), str):
        if on or off:
            raise Refusal("expected either a list of effects, or some on and off, got both")
        listed = Choice(False, accuracy, on=frozenset(named))
        return replace(listed, off=frozenset(EFFECTS) - listed.on)
    choices = {"auto": Choice(auto=True), "all": Choice(), "linear": LINEAR}
    if named not in choices:
        raise Refusal(f"expected auto, all, linear or a list of effects, got {named!r}")
    chosen = choices[named]
    return Choice(chosen.auto, accuracy, on, (chosen.off - on) | off)


def _wanted(table: Table) -> set[str]:
    """The effects that a file asks for by name."""
    named = table.get("choose", str | tuple[str, ...], "auto")
    return {*table.get("on", tuple[str, ...], ()), *(() if isinstance(named, str) else named)}


def read_scene_text(file: FilePath) -> str:
    """The text in `file`; raises `Refusal` for a file that cannot be read, or is no scene's."""
    try:
        if file.exists() and not file.is_file():
            raise Refusal(f"{file}: expected a file with a scene, got a folder or a device")
        if file.stat().st_size > _LARGEST:
            raise Refusal(f"{file}: expected a scene of at most {_LARGEST} bytes, got more")
        return file.read_text(encoding="utf-8-sig")
    except Refusal:
        raise
    except (OSError, ValueError) as error:  # undecodable, or a name that no file has
        raise Refusal(f"{file}: cannot be read as a scene ({error}); check its name") from error
