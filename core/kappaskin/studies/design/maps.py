"""Maps of a design: how surely each place of the skin is felt, by where the elements are."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin._files import write_whole
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.scenes import Scene
from kappaskin.skin import MeshSkin, Patch
from kappaskin.studies.design.measures import PREDICTIONS, Design, Prospect, prospect

Maps = dict[str, dict[str, Prospect]]
"""By the name of a placement, and of what the error is of."""

_SHOWN = {"contact": (1e6, "um"), "force": (1e2, "%"), "displacement": (1e6, "um")}
_ENDINGS = ".csv", ".npz", ".ply"
_COLOURS: Array = np.array(
    [(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)]
)
"""Of viridis (M. Nunez and others), evenly from the least to the largest."""


def design_maps(scene: Scene, functions: tuple[int, int], by: Sequence[str]) -> Maps:
    """What is predicted of a scene with its elements placed `by` each of some `PLACED_BY`."""
    found = Maps()
    for name in by:
        design = Design(scene, functions, name).placed()
        found[name] = {of: prospect(design, of) for of in PREDICTIONS}
    return found


def maps_rows(maps: Maps) -> list[dict[str, Any]]:
    """A row for each placement: error of the place in m, of the force as a share, of the shape."""
    return [
        {
            "placement": by,
            "elements": len(found["contact"].positions),
            **{
                f"{of}_{part}": getattr(one, part)
                for of, one in found.items()
                for part in ("rms", "median", "worst")
            },
        }
        for by, found in maps.items()
    ]


def maps_text(scene: Scene, maps: Maps) -> str:
    """The rows as a table, with what they are of."""
    head = ["placement"] + [
        f"{of} {part} [{_SHOWN[of][1]}]" for of in _SHOWN for part in ("median", "worst")
    ]
    rows = [head]
    for by, found in maps.items():
        values = [(of, part) for of in _SHOWN for part in ("median", "worst")]
        rows.append(
            [by] + [f"{_SHOWN[of][0] * getattr(found[of], part):.3g}" for of, part in values]
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(f"{cell:>{w}}" for cell, w in zip(row, widths, strict=True)) for row in rows]
    load = next(iter(maps.values()))["contact"].load
    force = "" if load is None else f" under {load.force:.3g} N"
    return "\n".join(
        [
            f"{scene.name}: errors due to noise{force} with {len(scene.layout)} elements, over all "
            "places of the skin",
            "contact: RMS error of the place along the skin; force: of the force; displacement: "
            "standard deviation of the shape",
            "",
            *lines,
        ]
    )


def check_maps_file(file: Path, patch: Patch) -> None:
    """Raise a `Refusal` for a file that maps cannot be written to."""
    if file.suffix not in _ENDINGS or (file.suffix == ".ply" and not isinstance(patch, MeshSkin)):
        raise Refusal(
            f"expected a file that ends in .csv or .npz, or on a mesh in .ply, got {file.name!r}"
        )


def write_maps(file: Path, patch: Patch, maps: Maps) -> None:
    """Write the errors at each place by each placement: CSV, NPZ, or a coloured mesh as PLY.

    The place in space is in m, on a mesh in the file's coordinates; errors are in m and shares. In
    a PLY colours go by the error of the contact's place by the first placement, from its least to
    its largest, grey where none is known.
    """
    check_maps_file(file, patch)
    first = next(iter(maps.values()))["contact"]
    columns = {
        f"{of} {by}": one.sd.ravel()
        for by, found in maps.items()
        for of, one in found.items()
        if one.sd.shape == first.sd.shape  # that of displacements is finer, but on a mesh
    }
    places, points = _places(patch, first)
    of_place = dict(zip("uv", places.T, strict=True)) | dict(zip("xyz", points.T, strict=True))
    if file.suffix == ".npz":
        arrays: dict[str, NDArray[Any]] = of_place | columns
        arrays |= {f"elements {by}": found["contact"].positions for by, found in maps.items()}
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
        write_whole(file, buffer.getvalue())
    elif file.suffix == ".csv":
        text = io.StringIO()
        write = csv.writer(text, lineterminator="\n").writerow
        write([*(f"{name} [m]" for name in of_place), *map(_headed, columns)])
        for row in np.column_stack([*of_place.values(), *columns.values()]).tolist():
            write([f"{value:.6g}" for value in row])
        write_whole(file, text.getvalue())
    elif isinstance(patch, MeshSkin):
        write_whole(file, _ply(patch, points, columns))


def _headed(name: str) -> str:
    return name if name.startswith("force") else f"{name} [m]"


def _places(patch: Patch, found: Prospect) -> tuple[Array, Array]:
    """Positions (G, 2) in m of a map, and its points (G, 3) in space; NaN off the skin."""
    if isinstance(patch, MeshSkin):
        return patch.places, patch.nodes
    places = np.stack(np.meshgrid(found.x, found.y), axis=-1).reshape(-1, 2)
    points, on = np.full((len(places), 3), np.nan), patch.contains(places)
    points[on] = patch.at_rest(places[on])[0]
    return places, points


def _ply(mesh: MeshSkin, points: Array, columns: dict[str, Array]) -> str:
    value = next(iter(columns[name] for name in columns if name.startswith("contact")))
    low, high = np.nanmin(value), np.nanmax(value)
    share = (value - low) / (high - low or 1.0)
    steps = np.linspace(0, 1, len(_COLOURS))
    each = [np.asarray(np.interp(share, steps, one), float) for one in _COLOURS.T]
    colours: Array = np.where(np.isnan(value)[:, None], 160.0, np.column_stack(each))
    names = [name.replace(" ", "_") for name in columns]
    head = [
        "ply",
        "format ascii 1.0",
        f"comment errors in m and shares of the force; colours: {next(iter(columns))}",
        f"element vertex {len(points)}",
        *(f"property float {axis}" for axis in "xyz"),
        *(f"property uchar {colour}" for colour in ("red", "green", "blue")),
        *(f"property float {name}" for name in names),
        f"element face {len(mesh.triangles)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    values = np.column_stack([points, np.rint(colours), *columns.values()])
    rows = [" ".join(f"{one:.6g}" for one in row) for row in values.tolist()]
    faces = [f"3 {a} {b} {c}" for a, b, c in mesh.triangles.tolist()]
    return "\n".join([*head, *rows, *faces, ""])
