"""Reading scene files: strict, and every refusal names its line."""

import math
from collections.abc import Callable, Collection
from dataclasses import fields, replace
from difflib import get_close_matches
from functools import partial
from importlib.resources import files
from os.path import isfile
from pathlib import Path
from typing import Any, cast, get_type_hints

import numpy as np

from kappaskin import _plugins
from kappaskin._files import read_file, why_unread
from kappaskin._schema import Within
from kappaskin._toml import TomlTable, parsed
from kappaskin.bases import basis_for
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.mechanics import HeightMap, Load, Mesh, Plate, RigidObject
from kappaskin.scenes.cylinders import Presentation, schedule
from kappaskin.scenes.effect_plan import effects_of
from kappaskin.scenes.effects import (
    EFFECTS,
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION_LOOPS,
    Effect,
    IntermittentElements,
    StrainLimit,
    StuckElements,
)
from kappaskin.scenes.scene import LINEAR, EffectSelection, Scene, scaled_to
from kappaskin.scenes.schema import (
    CYLINDERS,
    EFFECT,
    ELECTRONICS,
    ELEMENTS,
    FORMAT,
    LOADS,
    OBJECTS,
    READINGS,
    SCENE,
    SKIN,
    STEP,
    TOUCH,
)
from kappaskin.scenes.stimulus import (
    Indenter,
    Motion,
    MotionPath,
    MotionStep,
    Orbit,
    RecordedMotion,
    Stimulus,
)
from kappaskin.sensing import (
    FIRST_GENERATION,
    SECOND_GENERATION,
    DigitalReadings,
    SensorLayout,
    Transduction,
)
from kappaskin.skin import (
    UNITS,
    Cap,
    Disk,
    MeshSkin,
    Patch,
    Polygon,
    faults,
    held_edges,
    read_surface,
)

TABLE_1_NOISE = 0.40 / math.sqrt(3)
"""RMS of the noise of Table 1 in 1/m: uniform between -0.40 and 0.40."""

DEFAULT_SCENE = "circle"

_FOLDER = Path(str(files("kappaskin_resources"))) / "scenes"
_ENDING = ".toml"

SCENES = tuple(sorted(file.stem for file in _FOLDER.iterdir() if file.suffix == _ENDING))
"""Names of the ready scenes."""

CHAINS = {"modern": Transduction(), "second": SECOND_GENERATION, "first": FIRST_GENERATION}
LOOPS = {"second": SECOND_GENERATION_LOOPS, "first": FIRST_GENERATION_LOOPS}
"""Electronics and loops that a scene may say are like those of a prototype."""

Trust = bool | Collection[Path]
"""Whether a scene may name any file, or which ones outside its folder."""

_Find = Callable[[TomlTable, str], Path]  # the file that a table names at a key
_LARGEST_SCENE = 2**21  # bytes: more takes longer than a few seconds to read
_LARGEST_RECORD = 2**22  # bytes of a recorded motion

_SIDE = Within(1e-4, 10, "m")
_MOST_READINGS = 2**16
_MOST_ELEMENTS = _MOST_READINGS // 3  # with three readings, as many as the wire format can number
_MOST_VALUES = 2**25  # of functions at channels, a quarter of a gigabyte
_MOVED = 0.1  # of the distance of two elements: so far off the mesh is told
_LEVEL = 0.1  # of a direction, that is at least along the skin
_MOST_TOUCHES = 10_000  # some seconds to read
_MOST_FUNCTIONS, _MOST_THAT_MIX, _MOST_ON_CAP = 64**2, 20**2, 32**2  # seconds to make the skin of


def scene_file(name: str = "") -> Path:
    """The file of the ready scene `name`, of the default one when empty; or the TOML file named."""
    if name.endswith(_ENDING):
        return Path(name)
    name = name or DEFAULT_SCENE
    if name not in SCENES:
        raise Refusal(
            f"expected a scene among {', '.join(SCENES)}, or a file that ends in {_ENDING}; got "
            f"{name!r}"
        )
    return _FOLDER / f"{name}{_ENDING}"


def load_scene(name: str = "", trust: Trust = False) -> Scene:
    """The ready scene `name`, the default one when empty; or that in the TOML file of that name.

    `trust` as of `named_file`.
    """
    file = scene_file(name)
    return read_scene(read_scene_text(file), file, trust)


def read_scene_text(file: Path) -> str:
    """The text in `file`; raises `Refusal` for a file that cannot be read, or is no scene's."""
    try:
        text = read_file(file, _LARGEST_SCENE).decode("utf-8-sig")
        return text.replace("\r\n", "\n").replace("\r", "\n")
    except (OSError, ValueError) as error:  # undecodable, or a name that no file has
        raise Refusal(f"{file}: cannot be read as a scene ({error}); check its name") from error


def read_scene(text: str, file: Path, trust: Trust = False) -> Scene:
    """The scene in the `text` of `file`; `trust` as of `named_file`."""
    return scene_of(TomlTable(parsed(text, file), text, str(file)), file, trust)


def named_file(name: str, folder: Path, trust: Trust = False, of: str = "scene") -> Path:
    """The path, without links, of the file that a scene, or what it is `of`, in `folder` names.

    A `Refusal` where it is not in the folder, unless there is `trust`: `name` must be relative,
    without .., and no link may lead out.
    """
    try:
        path, inside = (folder / name).resolve(), folder.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a name that no file has, links in a ring
        raise Refusal(f"expected the name of a file, got {name!r:.200}") from error
    trusted = trust if isinstance(trust, bool) else path in trust
    plain = not Path(name).is_absolute() and ".." not in Path(name).parts
    if not (trusted or (plain and path.is_relative_to(inside))):
        raise Refusal(
            f"expected the name of a file in the folder of the {of}, without a link out of it, got "
            f"{name!r:.200}; copy the file there, or give --trust if you trust the {of}"
        )
    return path


def scene_of(top: TomlTable, file: Path, trust: Trust = False) -> Scene:
    """The scene in the table `top` of a file; keys of other readers are left unread.

    `trust` as of `named_file`.
    """
    name, find = file.stem.removesuffix(".scene"), partial(find_file, file.parent, trust)
    if (version := SCENE.value(top, "format")) != FORMAT:
        raise top.refusal(
            f"expected a scene of format {FORMAT}, got {version}; update kappaskin"
            if version > FORMAT
            else f"expected format = {FORMAT}, got {version}",
            "format",
        )
    plate, edge = read_skin(top.table("skin"), find)
    layout, moved = read_elements(top.table("elements"), plate.patch, find, top.table("skin"))
    reference = SCENE.value(top, "reference", default=usual_reference(plate.patch))
    basis = partial(basis_for, plate.patch, edge, *reference)
    with top.blamed("reference"):
        _check_functions(plate, edge, reference, len(layout))
        basis()
    if len(top.tables("touch")) > _MOST_TOUCHES:
        raise top.refusal(
            f"expected at most {_MOST_TOUCHES} touches, got {len(top.tables('touch'))}; take fewer",
            "touch",
        )
    stimuli = tuple(
        _stimulus(table, plate, lambda load, by: scaled_to(plate, load, by, basis()), find)
        for table in top.tables("touch")
    )
    electronics = _electronics(top, layout)
    choice, effects = _effects(top, electronics, layout)
    rate, seed = SCENE.value(top, "rate"), SCENE.value(top, "seed")
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
            title=SCENE.value(top, "title", default=name),
            text="\n".join(filter(None, (SCENE.value(top, "text"), moved))),
        )
        with top.blamed("rate"):
            scene.sensor()
        if "cylinders" in top:
            if stimuli:
                touch = top.tables("touch")[0]
                raise touch.refusal("expected no touch on a skin that lies on cylinders")
            scene = scene.laid_on(_cylinders(top.table("cylinders"), scene))
    top.done()
    if absent := sorted(_wanted(top.table("effects")) - effects_of(scene).keys()):
        raise top.table("effects").refusal(
            f"expected effects that occur in this scene, got {', '.join(absent)}; "
            "define their parameters, or omit them"
        )
    return scene


def read_skin(table: TomlTable, find: _Find) -> tuple[Plate, str]:
    """The skin in the table [skin] of a file, and its boundary condition.

    `find` gives the file that a key of the table names.
    """
    shape = SKIN.value(table, "shape")
    with table.blamed():
        patch = _mesh(table, find) if shape == "mesh" else _patch(table, shape)
        check_sides(patch)
    plate = SKIN.make(table, Plate, patch=patch)
    edge = SKIN.value(table, "edge")
    table.done()
    return plate, edge


def _mesh(table: TomlTable, find: _Find) -> MeshSkin:
    unit, thickness, held, text = (
        SKIN.value(table, key, default=None) for key in ("unit", "thickness", "held", "mesh")
    )
    if text is not None:
        if "file" in table:
            raise table.refusal("expected a file or the mesh itself, got both", "file")
        with table.blamed("mesh"):
            return MeshSkin.of_text(text)
    if thickness is None:
        raise table.refusal("expected a thickness in m, got none; give that of the skin")
    file = find(table, "file")
    with table.blamed("file"):
        surface = read_surface(file, unit or "")
        if found := faults(surface):
            raise Refusal(f"{file}: {found[0].message}")
    with table.blamed("held"):
        edges = None if held is None else held_edges(surface, UNITS[unit] * np.array(held))
        order = np.lexsort(surface.nodes.T)  # the text of the mesh is half as long
        number = np.argsort(order)
        triangles, held = number[surface.triangles], None if edges is None else number[edges]
        first = triangles.min(axis=1).argsort()
        return MeshSkin(surface.nodes[order], triangles[first], thickness, held)


def _patch(table: TomlTable, shape: str) -> Patch:
    if shape == "disk":
        return Disk(SKIN.value(table, "rim_radius"))
    if shape == "cap":
        radius = table.get("radius", float)
        return Cap(radius, *(SKIN.value(table, key) for key in ("angle", "stretch")))
    if shape == "polygon":
        return Polygon(SKIN.value(table, "outline"))
    a, b = SKIN.value(table, "size")
    return Patch(a, b, SKIN.value(table, "radius"), shape == "strip")


def read_elements(
    table: TomlTable, patch: Patch, find: _Find, skin: TomlTable
) -> tuple[SensorLayout, str]:
    """The elements in the table [elements] of a file, and by how much they had to be moved.

    In words, empty where that is little. `find` gives the file that a key of the table names,
    `skin` is the table [skin], which has the unit of the mesh's file.
    """
    moved, turns = "", None
    with table.blamed():
        given = [key for key in ("positions", "rings", "spiral", "spread", "file") if key in table]
        if len(given) > 1:
            raise table.refusal(f"expected one pattern, got {' and '.join(given)}", given[1])
        if "positions" in table:
            layout = SensorLayout.scattered(patch, ELEMENTS.value(table, "positions"))
        elif "rings" in table:
            check_elements(sum(rings := ELEMENTS.value(table, "rings")))
            layout = SensorLayout.on_rings(patch, rings)
        elif "spiral" in table:
            check_elements(count := ELEMENTS.value(table, "spiral"))
            layout = SensorLayout.in_spiral(patch, count)
        elif "spread" in table:
            check_elements(count := ELEMENTS.value(table, "spread"))
            layout = SensorLayout.spread(patch, count)
        elif "file" in table:
            file = find(table, "file")
            with table.blamed("file"):
                layout, turns, moved = _in_space(file, patch, SKIN.value(skin, "unit", default=""))
        else:
            grid = ELEMENTS.value(table, "grid")
            check_elements(*grid)
            layout = SensorLayout.regular(patch, *grid)
        check_elements(len(layout))
        averaged = {key: ELEMENTS.value(table, key) for key in ("gage_length", "cell")}
        layout = replace(layout, **averaged)
        with table.blamed("reads"):
            layout = layout.reading_each(ELEMENTS.value(table, "reads"))
            layout = _turned(layout, table, turns)
            if layout.channels > _MOST_READINGS:
                raise Refusal(
                    f"expected at most {_MOST_READINGS} readings of all elements, got "
                    f"{layout.channels}; take fewer"
                )
        layout = layout.without(ELEMENTS.value(table, "dead"))
    table.done()
    return layout, moved


def _turned(layout: SensorLayout, table: TomlTable, turns: Array | None) -> SensorLayout:
    """The elements with their axes turned as the table, or else `turns` (P,) has it."""
    given, along = ELEMENTS.value(table, "turns"), ELEMENTS.value(table, "along")
    if (given is not None) + (along != "x") + (turns is not None) > 1:
        raise table.refusal("expected one of turns, along and directions in the file, got more")
    if along == "principal":
        xx, yy, xy = layout.patch.read_at_rest(layout.positions)
        turns = np.arctan2(2 * xy, xx - yy) / 2
    turns = turns if given is None else np.array(given)
    return layout if turns is None else layout.turned(turns)


def _in_space(file: Path, patch: Patch, unit: str) -> tuple[SensorLayout, Array | None, str]:
    """Elements at the places in a CSV `file`, how their axes are turned, and how far they moved."""
    if not isinstance(patch, MeshSkin) or not unit:
        raise Refusal(
            "expected places of elements on a mesh with the unit of its file in [skin], got "
            f"a {patch.name}; give positions instead"
        )
    try:
        heading, *lines = read_file(file, _LARGEST_RECORD).decode("utf-8-sig").splitlines() or [""]
        rows = np.array([line.split(",") for line in lines if line.strip()], float)
    except (OSError, ValueError) as error:
        raise Refusal(
            f"{file}: expected a CSV of numbers x,y,z, or x,y,z,dx,dy,dz{why_unread(error)}"
        ) from error
    names = heading.replace(" ", "").split(",")
    directed = names == [*"xyz", "dx", "dy", "dz"]
    known = (directed or names == [*"xyz"]) and rows.shape[1:] == (len(names),)
    if not (known and np.isfinite(rows).all()):
        raise Refusal(
            f"{file}: expected a first line x,y,z or x,y,z,dx,dy,dz and lines of so many finite "
            "numbers, got others"
        )
    positions, away = patch.projected(UNITS[unit] * rows[:, :3])
    layout = SensorLayout.scattered(patch, positions)
    far, k = float(away.max()), int(away.argmax())
    if far > max(patch.a, patch.b) / 2:
        raise Refusal(
            f"{file}: expected elements on the mesh, in its coordinates in {unit}, got element "
            f"{k} {1e3 * far:.3g} mm away"
        )
    words = f"Elements were moved onto the mesh, element {k} by {1e3 * far:.2g} mm."
    moved = words if far > _MOVED * math.sqrt(patch.areas.sum() / len(rows)) else ""
    if not directed:
        return layout, None, moved
    ways = np.einsum("pix,px->pi", patch.base(*positions.T).frame, rows[:, 3:] @ patch.frame.T)
    if not (np.linalg.norm(ways, axis=1) > _LEVEL * np.linalg.norm(rows[:, 3:], axis=1)).all():
        raise Refusal(f"{file}: expected directions along the skin, got one across it")
    return layout, np.arctan2(*ways.T[::-1]), moved


def _electronics(top: TomlTable, layout: SensorLayout) -> Transduction | DigitalReadings:
    table, digital = top.table("electronics"), top.table("readings")
    if layout.senses_curvature_only:
        if "readings" in top:
            raise top.refusal(
                "expected [electronics] of elements that read curvature, got [readings]", "readings"
            )
        return _bridge(table)
    if "electronics" in top:
        raise top.refusal(
            f"expected no strain gages in elements that read {', '.join(layout.each_reads)}, got "
            "[electronics]; give [readings] instead",
            "electronics",
        )
    return _digital(digital, layout)


def _digital(table: TomlTable, layout: SensorLayout) -> DigitalReadings:
    """Digital readings, with the noise of each quantity that is read."""
    names = list(dict.fromkeys(name for name, _ in layout.kinds))
    noise = {name: READINGS.value(table, "noise") for name in names}
    for name in names:
        own = table.table(name)
        noise[name] = READINGS.value(own, "noise", default=noise[name])
        own.done()
    stated = tuple(noise.items()) if any(noise.values()) else ()
    made = READINGS.make(table, DigitalReadings, noise=stated)
    table.done(*names)
    return made


def _bridge(table: TomlTable) -> Transduction:
    chain = CHAINS[ELECTRONICS.value(table, "like")]
    parts = {
        name: _changed(table.table(name), getattr(chain, name))
        for name in ("bridge", "multiplexer", "amplifier", "converter")
    }
    table.done()
    with table.blamed():
        return replace(chain, **parts)


def _changed(table: TomlTable, part: Any) -> Any:
    """The `part` of the electronics with the values in the table."""
    hints = get_type_hints(cast("type[Any]", type(part)))
    changes = {f.name: table.get(f.name, hints[f.name]) for f in fields(part) if f.name in table}
    table.done()
    with table.blamed():
        return replace(part, **changes)


def _cylinders(table: TomlTable, scene: Scene) -> Presentation:
    hold, radii = CYLINDERS.value(table, "hold"), CYLINDERS.value(table, "radii")
    with table.blamed():
        strip = scene.plate.patch.strip
        steps = schedule(radii, hold, strip) if radii else schedule(hold=hold, strip=strip)
        made = Presentation(steps, CYLINDERS.value(table, "dwell"))
    table.done()
    return made


def _effects(
    top: TomlTable, electronics: Transduction | DigitalReadings, layout: SensorLayout
) -> tuple[EffectSelection, tuple[Effect, ...]]:
    """The selection of effects in the file, and the effects with parameters."""
    table = top.table("effects")
    found = list[Effect]()
    for name, kind in EFFECTS.items():
        if name in table:
            own = table.table(name)
            if kind.elsewhere:
                raise own.refusal(f"expected no table for this effect; {kind.elsewhere}")
            if kind.of_gages and isinstance(electronics, DigitalReadings):
                raise own.refusal(
                    f"expected no {name} of elements that read {', '.join(layout.each_reads)}: "
                    f"{kind.of_gages}"
                )
            if name == "hysteresis" and "like" in own:
                found.append(own.choose("like", LOOPS))
            elif kind is StrainLimit:
                found.append(own.make(kind, transduction=electronics))
            else:
                found.append(own.make(kind))
            own.done()
            if isinstance(effect := found[-1], StuckElements | IntermittentElements):
                with own.blamed("elements"):
                    effect.channels((layout.channels // len(layout), len(layout)))
    accuracy = SCENE.value(top, "accuracy")
    with top.blamed("accuracy"):
        EffectSelection(accuracy=accuracy)
    with table.blamed("choose"):
        choice = _choice(table, accuracy)
    for name in table:
        if table.is_table(name) and not get_close_matches(name, EFFECTS):
            why = _plugins.left_out(_plugins.EFFECTS, name)
            raise table.refusal(f"expected effects among {', '.join(EFFECTS)}{why}", name)
    table.done(*EFFECTS)
    return choice, tuple(found)


def _choice(table: TomlTable, accuracy: float) -> EffectSelection:
    """`choose` is auto, all, linear or a list of names; `on` and `off` force some."""
    on, off = (frozenset(EFFECT.value(table, key)) for key in ("on", "off"))
    if not isinstance(named := EFFECT.value(table, "choose"), str):
        if on or off:
            raise Refusal("expected either a list of effects, or some on and off, got both")
        listed = EffectSelection(False, accuracy, on=frozenset(named))
        return replace(listed, off=frozenset(EFFECTS) - listed.on)
    choices = {"auto": EffectSelection(auto=True), "all": EffectSelection(), "linear": LINEAR}
    if named not in choices:
        raise Refusal(f"expected auto, all, linear or a list of effects, got {named!r}")
    chosen = choices[named]
    return EffectSelection(chosen.auto, accuracy, on, (chosen.off - on) | off)


def _wanted(table: TomlTable) -> set[str]:
    """The effects that a file names."""
    named = EFFECT.value(table, "choose")
    return {*EFFECT.value(table, "on"), *(() if isinstance(named, str) else named)}


def _stimulus(
    table: TomlTable, plate: Plate, moved: Callable[[Load, float], Load], find: _Find
) -> Stimulus:
    """The stimulus of a [[touch]] table; `moved` gives a load a displacement in m."""
    what: Load | Indenter
    if (name := TOUCH.value(table, "what")) in OBJECTS:
        what = table.make(Indenter, rigid=_object(table, OBJECTS[name].made, find))
    else:
        what = load = table.make(cast("type[Load]", LOADS[name].made))
        if "displacement" in table:
            if "force" in table:
                raise table.refusal("expected a force or a displacement, got both", "displacement")
            with table.blamed():
                load.check(plate.patch)
            with table.blamed("displacement"):
                what = moved(load, TOUCH.value(table, "displacement"))
    force = TOUCH.limits["force"]
    if what.force is not None and what.force not in force:
        raise table.refusal(f"expected a force of {force}, got {what.force:g}", "force")
    made = Stimulus(what, _motion(table, find))
    table.done()
    with table.blamed():
        made.check(plate)
    return made


def _object(table: TomlTable, kind: type[RigidObject], find: _Find) -> RigidObject:
    """The rigid object that the table describes, read from a file if it has one."""
    with table.blamed():
        if kind is Mesh:
            return Mesh.read(find(table, "file"), TOUCH.value(table, "unit"))
        if kind is HeightMap:
            sizes = (TOUCH.value(table, key) for key in ("length", "width", "relief"))
            return HeightMap.read(find(table, "file"), *sizes)
        return table.make(kind)


def find_file(folder: Path, trust: Trust, table: TomlTable, key: str) -> Path:
    """The file that the table names at `key`; `trust` as of `named_file`."""
    name = TOUCH.value(table, key)
    with table.blamed(key):
        file = named_file(name, folder, trust)
        if not isfile(file):  # which raises nothing, whatever the name
            raise Refusal(
                f"expected the name of a file in the folder of the scene, "
                f"got {str(folder / name)!r:.200}, which does not exist"
            )
    return file


def _motion(table: TomlTable, find: _Find) -> Motion | None:
    given = [key for key in ("path", "orbit", "recorded") if key in table]
    if len(given) > 1:
        raise table.refusal(f"expected one motion, got {' and '.join(given)}", given[1])
    if "orbit" in table:
        orbit = table.table("orbit")
        made = orbit.make(Orbit)
        orbit.done()
        return made
    if "recorded" in table:
        with table.blamed("recorded"):
            return _recorded(find(table, "recorded"))
    steps = [_step(step) for step in table.tables("path")]
    with table.blamed("path"):
        return MotionPath(tuple(steps)) if "path" in table else None


def _step(table: TomlTable) -> MotionStep:
    made = table.make(STEP.kinds[STEP.value(table, "step")].made)
    table.done()
    return made


def _recorded(file: Path) -> RecordedMotion:
    """A motion from a CSV file with the columns time, dx, dy and amount."""
    try:
        text = read_file(file, _LARGEST_RECORD).decode("utf-8-sig")
        heading, *lines = text.splitlines() or [""]
        rows = np.array([line.split(",") for line in lines if line.strip()], float)
    except (OSError, ValueError) as error:
        raise Refusal(
            f"{file}: expected a CSV of numbers time,dx,dy,amount in s, m, m and shares"
            f"{why_unread(error)}; correct it, or keep fewer lines"
        ) from error
    if heading.replace(" ", "") != "time,dx,dy,amount":
        raise Refusal(f"{file}: expected a first line time,dx,dy,amount, got another one")
    if rows.shape[1:] != (4,):
        raise Refusal(f"{file}: expected lines of four numbers, got an array of {rows.shape}")
    return RecordedMotion(rows[:, 0], rows[:, 1:])


def check_sides(patch: Patch) -> None:
    """Refuse a skin of unrealistic size."""
    if patch.a not in _SIDE or patch.b not in _SIDE:
        raise Refusal(
            f"expected sides of {_SIDE}, got {patch.a:g} x {patch.b:g} m; lengths are in metres"
        )


def check_elements(m: int, n: int = 1) -> None:
    """Refuse more elements than a device could send the readings of."""
    if m * n > _MOST_ELEMENTS:
        raise Refusal(f"expected at most {_MOST_ELEMENTS} elements, got {m} x {n}; take fewer")


def _check_functions(plate: Plate, edge: str, counts: tuple[int, int], elements: int) -> None:
    """Refuse more functions of the true shape than can be computed in a few seconds."""
    whole = isinstance(plate.patch, Disk | Polygon)
    mix = whole or plate.mixes_sines or edge != "hinged"
    most = _MOST_THAT_MIX if mix else _MOST_FUNCTIONS
    if isinstance(plate.patch, Cap):
        most = _MOST_ON_CAP
    most = min(most, _MOST_VALUES // (3 * elements))
    if min(counts) > 0 and counts[0] * counts[1] > most:
        raise Refusal(
            f"expected at most {most} functions in all of the true shape of this skin with "
            f"{elements} elements, got {counts[0]} x {counts[1]}; take fewer"
        )


def usual_reference(patch: Patch) -> tuple[int, int]:
    """The default number of functions of the true shape."""
    if isinstance(patch, Cap):  # a shell bends close around a load
        return 16, 33
    return (15, 1 if patch.strip else 15)
