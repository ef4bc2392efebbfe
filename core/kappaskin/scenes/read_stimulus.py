"""A table [[touch]] of a scene file to what touches the skin, and how it moves."""

from collections.abc import Callable
from pathlib import Path as FilePath

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.mechanics import (
    Block,
    Cylinder,
    DiscLoad,
    GaussianLoad,
    HeightMap,
    LineLoad,
    Load,
    Mesh,
    Plate,
    PointLoad,
    Punch,
    RectangleLoad,
    RigidObject,
    Sphere,
    Wedge,
)
from kappaskin.scenes.effects.parameters import Within
from kappaskin.scenes.motion import (
    Hold,
    Motion,
    Orbit,
    Path,
    Press,
    Recorded,
    Release,
    Slide,
    Step,
    Tap,
    Turn,
)
from kappaskin.scenes.stimulus import Indenter, Stimulus
from kappaskin.scenes.table import Table

STEPS: dict[str, type[Step]] = {
    "press": Press,
    "hold": Hold,
    "release": Release,
    "slide": Slide,
    "roll": Slide,
    "turn": Turn,
    "tap": Tap,
}
LOADS: dict[str, type[Load]] = {
    "point": PointLoad,
    "line": LineLoad,
    "disc": DiscLoad,
    "rectangle": RectangleLoad,
    "gaussian": GaussianLoad,
}
OBJECTS: dict[str, type[RigidObject]] = {
    "sphere": Sphere,
    "cylinder": Cylinder,
    "wedge": Wedge,
    "punch": Punch,
    "block": Block,
    "heights": HeightMap,
    "mesh": Mesh,
}

_LARGEST = 2**22  # bytes of a recorded motion
_FORCE = Within(-1e6, 1e6, "N")


def read_stimulus(
    table: Table, plate: Plate, moved: Callable[[Load, float], Load], folder: FilePath
) -> Stimulus:
    """What a [[touch]] of `plate` says; `moved` makes a load move its place so far in m."""
    what: Load | Indenter
    if (name := table.choose("what", {name: name for name in (*LOADS, *OBJECTS)})) in OBJECTS:
        what = table.make(Indenter, rigid=_object(table, OBJECTS[name], folder))
    else:
        what = table.make(LOADS[name])
        if "displacement" in table:
            if "force" in table:
                raise table.refusal("expected a force or a displacement, got both", "displacement")
            with table.blamed():
                what.check(plate.patch)
            with table.blamed("displacement"):
                what = moved(what, table.get("displacement", float))
    if what.force is not None and what.force not in _FORCE:
        raise table.refusal(f"expected a force of {_FORCE}, got {what.force:g}", "force")
    made = Stimulus(what, _motion(table, folder))
    table.done()
    with table.blamed():
        made.check(plate)
    return made


def _object(table: Table, kind: type[RigidObject], folder: FilePath) -> RigidObject:
    """The rigid object that the table describes, read from a file in `folder` if it has one."""
    with table.blamed():
        if kind is Mesh:
            return Mesh.read(_beside(table, "file", folder), table.get("unit", float, 1.0))
        if kind is HeightMap:
            sizes = (table.get(key, float) for key in ("length", "width", "relief"))
            return HeightMap.read(_beside(table, "file", folder), *sizes)
        return table.make(kind)


def _beside(table: Table, key: str, folder: FilePath) -> FilePath:
    """The file that the table names, which lies beside that of the scene."""
    file = folder / table.get(key, str)
    if not file.is_file():
        raise table.refusal(
            f"expected the name of a file beside that of the scene, got {str(file)!r:.200}, where "
            "there is none",
            key,
        )
    return file


def _motion(table: Table, folder: FilePath) -> Motion | None:
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
            return _recorded(_beside(table, "recorded", folder))
    steps = [_step(step) for step in table.tables("path")]
    with table.blamed("path"):
        return Path(tuple(steps)) if "path" in table else None


def _step(table: Table) -> Step:
    made = table.make(table.choose("step", STEPS))
    table.done()
    return made


def _recorded(file: FilePath) -> Recorded:
    """A motion from a CSV file with the columns time, dx, dy and amount."""
    try:
        if file.stat().st_size > _LARGEST:
            raise OSError(f"it has more than {_LARGEST} bytes; thin it out")
        heading, *lines = file.read_text(encoding="utf-8-sig").splitlines() or [""]
        rows = np.array([line.split(",") for line in lines if line.strip()], float)
    except (OSError, ValueError) as error:
        raise Refusal(
            f"{file}: expected a CSV of numbers time,dx,dy,amount in s, m, m and shares: {error}"
        ) from error
    if heading.replace(" ", "") != "time,dx,dy,amount":
        raise Refusal(f"{file}: expected a first line time,dx,dy,amount, got {heading!r:.80}")
    if rows.shape[1:] != (4,):
        raise Refusal(f"{file}: expected lines of four numbers, got those of {rows.shape}")
    return Recorded(rows[:, 0], rows[:, 1:])
