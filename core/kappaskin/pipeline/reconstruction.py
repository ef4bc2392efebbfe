"""Reconstruction from a file of readings to arrays of shapes."""

import io
import math
import os
import zipfile
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin._files import ARCHIVE_DAMAGES, Budget, check_memory, open_file
from kappaskin.bases import Basis, basis_for
from kappaskin.contact import (
    KINDS,
    ContactObject,
    Contacts,
    Imprints,
    LargeDeflection,
    as_one,
    contacts_of,
    object_finder,
)
from kappaskin.errors import RankDeficient, Refusal
from kappaskin.estimation import (
    METHODS,
    Estimator,
    Fit,
    check_method,
    estimator_for,
    unobserved_function,
)
from kappaskin.frames import Array, Contact, LocalGeometry
from kappaskin.mechanics import Plate
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Cap, Disk, MeshSkin, Patch, Polygon

_NEEDED = (
    "size (2,) in m, positions (P, 2) in m and curvature (T, 3, P) or (3, P) in 1/m, or values "
    "(T, R) with element (R,) and quantity (R,)"
)

_SKIN = ("rigidity", "thickness", "poisson")
_AVERAGED = {"gage_length": 1, "cell": 2}  # what a reading is the mean over: sides in m
_READ = ("element", "quantity", "direction", "datum")  # what values are
_NAMES = (
    "size",
    "positions",
    "curvature",
    "values",
    *_READ,
    "sigma",
    "radius",
    "angle",
    "stretch",
    "outline",
    "mesh",
    *_AVERAGED,
    *_SKIN,
    "inplane",
)
_TEXTS = ("quantity", "datum", "inplane", "mesh")
_SIZES = ("size", "radius", "angle", "stretch", "outline")  # which a mesh has itself
_HEADER = 2**16  # bytes of a member that say what it holds
_READ_AS = 8  # bytes of each number in memory

_MOST = 2**27  # numbers in one array: 1 GiB
_NAMED = 2**18  # readings times functions: of more, none that is not determined is named


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    # Opened here: np.load leaves a file that it opened itself open when the archive is damaged.
    with open_file(path) as file:
        archive = np.load(file, allow_pickle=False)
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise ValueError("it holds a single array")
        with zipfile.ZipFile(file) as members:
            _check_declared(path, members, os.fstat(file.fileno()).st_size)
        return {name: archive[name] for name in _NAMES if name in archive}


def _check_declared(path: Path, archive: zipfile.ZipFile, size: int) -> None:
    """Refuse an archive of `size` bytes whose arrays would be too large, before one is read."""
    members, budget, total = set(archive.namelist()), Budget(path, size), 0
    if raw := [name for name in _NAMES if name in members]:
        raise ValueError(f"{', '.join(raw)}: not an array, as numpy.savez writes it")
    for name in _NAMES:
        if f"{name}.npy" in members:
            shape, bytes_each = _declared(archive, f"{name}.npy")
            count = math.prod(map(abs, shape)) * max(_READ_AS, bytes_each)
            budget.take(count, f"{name} of shape {shape}")
            total += count
    check_memory(total, f"the arrays of {path}")


def _declared(archive: zipfile.ZipFile, name: str) -> tuple[tuple[int, ...], int]:
    """The shape of the array in a member of an `archive`, and the bytes of each of its numbers."""
    with archive.open(name) as member:
        head = io.BytesIO(member.read(_HEADER))
    version = np.lib.format.read_magic(head)
    first = version == (1, 0)
    read = np.lib.format.read_array_header_1_0 if first else np.lib.format.read_array_header_2_0
    shape, _, kind = read(head)
    return shape, kind.itemsize


def _read(path: Path) -> tuple[dict[str, Array], dict[str, NDArray[np.str_]]]:
    """The arrays of a readings file as numbers, and those of text; nothing is ever executed."""
    try:
        found = _arrays(path)
    except FileNotFoundError as error:
        raise Refusal(f"{path}: there is no such file; expected an NPZ with {_NEEDED}") from error
    except Refusal:
        raise
    except ARCHIVE_DAMAGES as error:
        # NumPy takes any other file for pickled objects, and advises to load them unsafely.
        why = "not an archive of numbers" if "allow_pickle" in str(error) else error
        raise Refusal(f"{path}: cannot be read as NPZ ({why}); expected {_NEEDED}") from error
    needed = ("values", "element", "quantity") if "values" in found else ("curvature",)
    needed = "positions", *needed
    if "mesh" not in found:
        needed = "size", *needed
    elif sizes := [name for name in _SIZES if name in found]:
        raise Refusal(f"{path}: expected the mesh alone, got {', '.join(sizes)} too; leave it out")
    for name in needed:
        if name not in found:
            raise Refusal(f"{path}: has no {name!r} (it has {sorted(found)}); expected {_NEEDED}")
    if other := [name for name in ("values", *_READ) if "curvature" in found and name in found]:
        raise Refusal(
            f"{path}: expected curvature, or values and what they are, got curvature and "
            f"{', '.join(other)}; write one of the two"
        )
    texts = {name: found.pop(name) for name in _TEXTS if name in found}
    for name, values in texts.items():
        single = name in ("inplane", "mesh")
        if values.dtype.kind != "U" or (single and values.size != 1):
            one = "one text" if single else "text"
            raise Refusal(f"{path}: expected {name} to be {one}, got {values.dtype}")
    for name, values in found.items():
        if values.dtype.kind not in "fiu":
            raise Refusal(f"{path}: expected {name} to be real numbers, got {values.dtype}")
    return {name: values.astype(float) for name, values in found.items()}, texts


def _plate(patch: Patch, found: dict[str, Array], inplane: str) -> Plate:
    """The skin by the numbers in the file; without a rigidity its material is unknown."""
    for name in _SKIN:
        if name in found and found[name].size != 1:
            raise Refusal(f"expected one {name}, got shape {found[name].shape}")
    known: dict[str, Any] = {"rigidity": 1.0, "inplane": inplane}
    known["unknown_material"] = "rigidity" not in found
    known |= {name: float(found[name].item()) for name in _SKIN if name in found}
    return Plate(patch, **known)


def _patch(path: Path, size: Array, radius: Array, outline: Array | None) -> Patch:
    """The skin of `size` (2,), or of size (1,) a strip, bent to one `radius` or two (2,).

    With an `outline`, (V, 2) in m or one number, it is a polygon, or a disk of that radius.
    """
    if outline is not None:
        skin = Disk(float(outline.item())) if outline.size == 1 else Polygon(outline)
        if (
            size.shape != (2,)
            or not np.allclose(size, (skin.a, skin.b))
            or np.any(radius != np.inf)
        ):
            raise Refusal(
                f"{path}: expected a flat skin of size {skin.a:g} x {skin.b:g} m, the box of its "
                f"outline, got size {size} and radius {radius}"
            )
        return skin
    if size.shape not in ((1,), (2,)):
        raise Refusal(
            f"{path}: expected size of shape (2,) in m, or (1,) for a strip, got {size.shape}"
        )
    if radius.size not in (1, 2):
        raise Refusal(f"{path}: expected one radius in m or two, got shape {radius.shape}")
    strip, (Rx, *Ry) = len(size) == 1, radius.ravel().tolist()
    bent = (Rx, Ry[0]) if Ry else Rx
    return Patch(float(size[0]), 1.0 if strip else float(size[1]), bent, strip)


def _cap(path: Path, found: dict[str, Array]) -> Cap:
    """The cap of one `radius`, `angle` and `stretch`, and of the `size` (2,) of its box."""
    sizes = [found.get(name, np.array(1.0)) for name in ("radius", "angle", "stretch")]
    if "radius" not in found or any(each.size != 1 for each in sizes) or "outline" in found:
        raise Refusal(f"{path}: expected one radius, angle and stretch of a cap, and no outline")
    cap, size = Cap(*(float(each.item()) for each in sizes)), found["size"]
    if size.shape != (2,) or not np.allclose(size, (cap.a, cap.b)):
        raise Refusal(
            f"{path}: expected size {cap.a:g} x {cap.b:g} m, twice from pole to rim along a "
            f"{cap.name}, got {size}"
        )
    return cap


def _layout(path: Path, patch: Patch, positions: Array) -> SensorLayout:
    across = 1 if patch.strip else 2
    if positions.ndim == 1 and patch.strip:
        positions = positions[:, None]
    if positions.ndim != 2 or positions.shape[1] != across:
        raise Refusal(
            f"{path}: expected positions of shape (P, {across}) in m, got {positions.shape}"
        )
    if patch.strip:
        positions = np.column_stack([positions, np.full(len(positions), patch.b / 2)])
    return SensorLayout.scattered(patch, positions)


def _averaged(path: Path, found: dict[str, Array]) -> dict[str, Any]:
    """What the readings in the file are the mean over, as a layout has it."""
    given = {name: found[name] for name in _AVERAGED if name in found}
    for name, values in given.items():
        if values.size != _AVERAGED[name]:
            sides = "one number" if _AVERAGED[name] == 1 else "two numbers"
            raise Refusal(f"{path}: expected {name} to be {sides} in m, got shape {values.shape}")
    return {
        name: tuple(values.tolist()) if values.size > 1 else values.item()
        for name, values in given.items()
    }


def _reading(
    path: Path, layout: SensorLayout, found: dict[str, Array], texts: dict[str, NDArray[np.str_]]
) -> SensorLayout:
    """The `layout` that reads what the file says: `element`, `quantity`, `direction`, `datum`."""
    element, quantity = found["element"], texts["quantity"]
    if not np.array_equal(element, np.rint(element)):
        raise Refusal(f"{path}: expected element to be whole numbers from 0, got {element!s:.80}")
    direction = found.get("direction")
    if direction is None:
        if undirected := set(quantity.ravel().tolist()) & {"slope", "curvature"}:
            raise Refusal(
                f"{path}: has no 'direction', which a {min(undirected)} needs; expected direction "
                f"(R,) in rad from x, any number where a height or twist needs none"
            )
        direction = np.zeros(element.shape)
    datum = texts.get("datum", np.array([], str)).ravel().tolist()
    try:
        return layout.reading(element.astype(np.intp), quantity, direction, datum)
    except Refusal as error:
        raise Refusal(f"{path}: {error}") from error


def _frames(path: Path, name: str, readings: Array, layout: SensorLayout) -> Array:
    """The readings of all T frames, from those of one frame or more."""
    one = layout.frame_shape
    frames = readings[None] if readings.ndim == len(one) else readings
    if frames.ndim != len(one) + 1 or frames.shape[1:] != one or not len(frames):
        raise Refusal(
            f"{path}: expected {name} of shape (T, {', '.join(map(str, one))}) or {one} for "
            f"{len(layout)} positions, got {readings.shape}"
        )
    return frames


def _shapes(
    method: str, basis: Basis, layout: SensorLayout, readings: Array, sigma: Array | None
) -> Fit:
    """The fit of all T frames; `sigma` may be of each of them."""
    if sigma is None or sigma.ndim <= len(layout.frame_shape):
        return estimator_for(method, basis, layout, sigma)(readings)
    frames: list[Fit] = []
    for number, own in enumerate(sigma):
        try:
            frames.append(estimator_for(method, basis, layout, own)(readings[number]))
        except Refusal as error:
            raise type(error)(f"frame {number}: {error}") from error
    return Fit.stacked(frames)


def _check_sizes(basis: Basis, layout: SensorLayout, surface: int, method: type[Estimator]) -> None:
    """Refuse what would exhaust the memory before anything is computed."""
    (Ni, Nj), N, readings = basis.shape, basis.size, int(layout.live.sum())
    if readings < N and not method.has_prior:
        unobserved = ""
        if readings * N <= _NAMED:
            M = layout.operator(basis)
            unobserved = unobserved_function(basis, layout, M, layout.live.ravel())
        raise RankDeficient(
            f"expected at most {readings} functions for {readings} readings per frame, got "
            f"{Ni} x {Nj} = {N}; use a smaller basis, more elements, or a "
            f"prior (bayes){unobserved}"
        )
    operator = readings * N if method.has_matrix else N
    if max(operator, surface) > _MOST:
        raise Refusal(
            f"expected at most {_MOST} numbers in one array, got {operator} in the operator "
            f"of the {Ni} x {Nj} basis and {surface} in the surfaces; use a smaller basis, a "
            "coarser grid or fewer frames"
        )


def reconstruct(
    readings: Path,
    basis: tuple[int, int],
    grid: tuple[int, int] | None = None,
    edge: str = "hinged",
    method: str = next(iter(METHODS)),
    contact: bool = False,
    objects: bool = False,
    warn: Callable[[str], object] = str,
) -> dict[str, NDArray[Any]]:
    """What `kappaskin reconstruct` writes: `coefficients`, `sd`, `residual` and the surface.

    `coefficients` and `sd` (T, Ni, Nj) in m, `residual` (T, 3, P) in 1/m, or (T, R) of `values` in
    their units, less their offset where its datum is free; with a `grid` of nx x ny
    points also `grid_x` (nx,), `grid_y` (ny,) and `w` (T, ny, nx) in m. `edge` is one of `EDGES`,
    `method` one of `METHODS`. With `contact` also what `_contacts` and `_pairs` give, with
    `objects` what `_objects` gives besides. Without a rigidity contacts are found by the shape,
    without a force. What the shapes neglect goes to `warn`, in words.
    """
    found, texts = _read(readings)
    name, sigma = "values" if "values" in found else "curvature", found.get("sigma")
    radius = found.get("radius", np.array(np.inf))
    if "mesh" in texts:
        patch = MeshSkin.of_text(str(texts["mesh"].item()))
    elif "angle" in found:
        patch = _cap(readings, found)
    else:
        patch = _patch(readings, found["size"], radius, found.get("outline"))
    layout = _layout(readings, patch, found["positions"])
    if name == "values":
        layout = _reading(readings, layout, found, texts)
    layout = replace(layout, **_averaged(readings, found))
    frames = _frames(readings, name, found[name], layout)
    one = layout.frame_shape
    if sigma is not None and sigma.ndim > len(one) and sigma.shape != frames.shape:
        raise Refusal(
            f"{readings}: expected sigma of shape {frames.shape} as {name} has, or {one}, or one "
            f"number; got {sigma.shape}"
        )
    functions = basis_for(patch, edge, *basis)
    check_method(method)
    points = 0 if grid is None else len(frames) * grid[0] * grid[1]
    _check_sizes(functions, layout, points, METHODS[method])
    fit = _shapes(method, functions, layout, frames, sigma)
    for text in fit.warnings:
        warn(text)
    out = {"coefficients": fit.coefficients, "sd": fit.sd, "residual": fit.residual}
    if grid is not None:
        x, y = patch.grid(*grid)
        out |= {"grid_x": x, "grid_y": y, "w": functions.on_grid(x, y)(out["coefficients"])}
    if not (contact or objects):
        return out
    plate = _plate(patch, found, str(texts.get("inplane", np.array("")).item()))
    bounded = LargeDeflection(plate, edge)
    fits = _fits(method, functions, layout, frames, sigma if layout.reads else None)
    read = [each.readings for each in fits]
    pairs, drifts = list[tuple[Contact, Contact]](), np.zeros(len(fits))
    contacts, there = list[Contact](), list[LocalGeometry]()

    @lru_cache(1)
    def finder(estimator: Estimator) -> Contacts | Imprints:
        own = None if estimator.sigma is None else 1 / estimator.weight
        return contacts_of(plate, layout, functions, edge, own)

    for frame, each in enumerate(fits):
        contacts_in = finder(each.estimator)
        pairs.append(contacts_in(each.readings, each))
        if (drift := contacts_in.drift) is not None:
            fits[frame], read[frame], drifts[frame] = drift.fit, drift.readings, drift.size
        contacts.append(bounded(pairs[-1][0]))
        there.append(contacts_in.geometry(fits[frame], contacts[-1]))
    out["drift"] = drifts
    out |= _contacts(there, contacts, forces="rigidity" in found)
    both = [(bounded(one), bounded(other)) for one, other in pairs]
    out |= _pairs(both, forces="rigidity" in found)
    if objects:
        whole = [as_one(*pair) for pair in pairs]
        out |= _objects(_found_objects(plate, layout, edge, fits, read, whole))
    return out


def _fits(
    method: str, basis: Basis, layout: SensorLayout, readings: Array, sigma: Array | None
) -> list[Fit]:
    """The fit of each frame by itself; `sigma` may be of each of them."""
    if sigma is None or sigma.ndim <= len(layout.frame_shape):
        fitter = estimator_for(method, basis, layout, sigma)
        return [fitter(frame) for frame in readings]
    each = zip(sigma, readings, strict=True)
    return [estimator_for(method, basis, layout, own)(frame) for own, frame in each]


def _found_objects(
    plate: Plate,
    layout: SensorLayout,
    edge: str,
    fits: list[Fit],
    read: list[Array],
    contacts: list[Contact],
) -> list[ContactObject]:
    """The object in each frame, by the fit of its readings and the contact in it."""
    makers = {id(fit.estimator): fit.estimator for fit in fits}
    finders = {
        key: object_finder(plate, layout, edge, estimator) for key, estimator in makers.items()
    }
    return [
        finders[id(fit.estimator)](readings, float(fit.noise), contact)
        for fit, readings, contact in zip(fits, read, contacts, strict=True)
    ]


def _contacts(
    there: list[LocalGeometry], contacts: list[Contact], forces: bool
) -> dict[str, NDArray[Any]]:
    """The contact of each frame and the skin's geometry there; NaN where there is none.

    `contact` and `contact_sd` (T, 2) in m, `displacement` and `displacement_sd` (T,) in m,
    `load_radius` (T,) and the ends of its 95 % interval `load_radius_95` (T, 2) in m; `normal`
    (T, 3), `curvature_form` (T, 2, 2), `torsion_form` (T, 2) and `principal` (T, 2) in 1/m; with
    `forces` also `force` and `force_sd` (T,) in N. `single`, `near_rim` and, with `forces`,
    `force_is_lower_bound`, `force_is_upper_bound` and `snaps_through` (T,) say whether to trust
    them (`Contact`). All readings weigh the same.
    """
    names = ["displacement", "displacement_sd", "single", "near_rim"]
    names += ["load_radius", "load_radius_95"]
    bounds = ["force_is_lower_bound", "force_is_upper_bound", "snaps_through"]
    names += ["force", "force_sd", *bounds] if forces else []
    out = {
        "contact": np.stack([contact.position for contact in contacts]),
        "contact_sd": np.stack([contact.position_sd for contact in contacts]),
    }
    out |= {name: np.array([getattr(contact, name) for contact in contacts]) for name in names}
    for name in ("normal", "curvature_form", "torsion_form", "principal"):
        out[name] = np.stack([getattr(geometry, name) for geometry in there])
    return out


def _pairs(pairs: list[tuple[Contact, Contact]], forces: bool) -> dict[str, NDArray[Any]]:
    """Both contacts of each frame, the stronger one first; NaN where there is none.

    `contacts` and `contacts_sd` (T, 2, 2) in m; with `forces` also `forces` and `forces_sd` (T, 2)
    in N.
    """
    names = {"contacts": "position", "contacts_sd": "position_sd"}
    names |= {"forces": "force", "forces_sd": "force_sd"} if forces else {}
    return {
        name: np.array([[getattr(one, of) for one in pair] for pair in pairs])
        for name, of in names.items()
    }


def _objects(found: list[ContactObject]) -> dict[str, NDArray[Any]]:
    """The object in contact in each frame (`ContactObject`); without a contact NaN and "".

    `object` (T,) is one of `KINDS` or "", `object_probability` (T, 4) of each of them;
    `object_radius` (T,) and `object_radius_95` (T, 2) in m; `object_axis` and `object_axis_95` (T,)
    in rad, `object_length` and `object_length_95` (T,) in m.
    """
    return {
        "object": np.array([one.kind for one in found], dtype="U8"),
        "object_probability": np.array(
            [[one.probability.get(kind, np.nan) for kind in KINDS] for one in found]
        ),
        **{
            f"object_{name}": np.array([getattr(one, name) for one in found])
            for name in ("radius", "radius_95", "axis", "axis_95", "length", "length_95")
        },
    }
