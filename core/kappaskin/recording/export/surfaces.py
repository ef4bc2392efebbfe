"""Exported meshes of the skin's surface: STL, VTP, PVD and GLB."""

import base64
import html
import json
import math
import struct
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin._text import printable
from kappaskin.bases import Basis
from kappaskin.contact import surface_geometry
from kappaskin.errors import Refusal
from kappaskin.frames import COMPONENTS, Array, Indices
from kappaskin.pipeline import SEQUENTIAL, Pipeline
from kappaskin.recording.export.request import ExportedFrame, ExportRequest, RecordingInfo
from kappaskin.skin import RestMesh

_AT_ONCE = 2**20  # values of functions that are worked out at once


@dataclass(frozen=True, eq=False)
class SkinSurface:
    """The skin: `points` (k, 3) in m with outward `normals`, and `triangles` (n, 3) of them.

    `displacement` (k,) in m, positive inward, `curvature` (k, 3) in 1/m, xx, yy and xy of the
    curvature form along x and across it.
    """

    points: Array
    normals: Array
    triangles: Indices
    displacement: Array
    curvature: Array


class SkinMesh:
    """The skin of a `basis` at nx x ny points; those outside its rim are moved onto it.

    That of a mesh at its nodes.
    """

    def __init__(self, basis: Basis, nx: int, ny: int) -> None:
        self._basis = basis
        self._rest = RestMesh(basis.patch, nx, ny)

    def depth(self, coefficients: Array) -> float:
        """The largest displacement in m, either way."""
        return float(np.abs(self._values @ coefficients.ravel()).max())

    @cached_property
    def _values(self) -> Array:
        return self._basis.at(self._rest.positions)

    def __call__(self, coefficients: Array) -> SkinSurface:
        """The surface with `coefficients` (Ni, Nj) in m."""
        rest, step = self._rest, max(_AT_ONCE // self._basis.size, 1)
        parts = [
            surface_geometry(self._basis, coefficients, rest.positions[n : n + step], _no_error)
            for n in range(0, len(rest.positions), step)
        ]
        points = np.concatenate([part.position for part in parts])
        K = np.concatenate([part.curvature_form for part in parts])
        displacement = np.einsum("pi,pi->p", rest.points - points, rest.normals)
        normals = np.concatenate([part.normal for part in parts])
        curvature = np.stack([K[:, 0, 0], K[:, 1, 1], K[:, 0, 1]], axis=-1)
        return SkinSurface(points, normals, rest.triangles, displacement, curvature)


def _no_error(rows: Array) -> Array:
    """The covariance (..., 6, 6) of the given shape."""
    return np.zeros((*rows.shape[:-1], rows.shape[-2]))


class SurfaceWriter(ABC):
    """Writer of surfaces; a format defines how one surface is written."""

    suffix: str

    def __init__(self, scratch: Path, request: ExportRequest, info: RecordingInfo) -> None:
        self.scratch, self.request, self.info = scratch, request, info
        self.times: dict[str, float] = {}
        """Times in s of the surfaces written, by file name."""
        self._made: tuple[Pipeline, SkinMesh] | None = None
        if request.folder is not None:
            (scratch / request.folder.name).mkdir()

    def take(self, frame: ExportedFrame) -> bool:
        coefficients = frame.estimate.coefficients
        if not np.isfinite(coefficients).all():
            if self.request.at is not None:
                raise Refusal(
                    f"the readings at {frame.at:.6g} s determine no shape; choose another time"
                )
            return False
        name = self.request.to.name
        if self.request.folder is not None:
            name = f"{self.request.folder.name}/{len(self.times):06d}{self.suffix}"
        self.write(self.scratch / name, frame, self._skin(frame.pipeline)(coefficients))
        self.times[name] = frame.at
        return True

    def _skin(self, pipeline: Pipeline) -> SkinMesh:
        if self._made is None or self._made[0] is not pipeline:
            setup = pipeline.setup
            self._made = pipeline, SkinMesh(pipeline.basis, setup.nx, setup.ny)
        return self._made[1]

    def description(self, frame: ExportedFrame) -> str:
        """Metadata of the surface of one frame, as JSON."""
        estimate = frame.estimate
        numbers = {"time": frame.at, "sequence": estimate.sequence, "setup": estimate.generation}
        force = estimate.contact.force
        return self.info.json(**numbers, force=force if math.isfinite(force) else None)

    @abstractmethod
    def write(self, path: Path, frame: ExportedFrame, surface: SkinSurface) -> None: ...

    @abstractmethod
    def finish(self) -> None: ...

    def close(self) -> None:
        """Release the skin; every file is closed once it is written."""
        self._made = None


class StlSurfaces(SurfaceWriter):
    """Binary STL in m; its metadata are in a JSON file of the same name."""

    suffix = ".stl"

    def write(self, path: Path, frame: ExportedFrame, surface: SkinSurface) -> None:
        facets = np.zeros(len(surface.triangles), _FACET)
        facets["corners"] = corners = surface.points[surface.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=-1, keepdims=True)
        facets["normal"] = normals / np.where(length > 0, length, 1.0)
        name = printable(self.info.sensor.name)
        head = f"{self.info.program}, {name}, {frame.at:.6f} s, in m"
        # Shorter than 80 bytes it is filled with zeros.
        with path.open("wb") as file:
            file.write(np.array(head.encode("ascii", "replace")[:80], "S80").tobytes())
            file.write(np.array(len(facets), "<u4").tobytes() + facets.tobytes())

    def finish(self) -> None:
        file = self.request.metadata_file
        if file is not None:
            text = self.info.json(times=self.times, lengths="m", time="s")
            (self.scratch / file.name).write_text(text, encoding="utf-8")


_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])


class VtpSurfaces(SurfaceWriter):
    """Points in m with `displacement` [m], `curvature` [1/m] and normals; `about` as field data."""

    suffix = ".vtp"

    def write(self, path: Path, frame: ExportedFrame, surface: SkinSurface) -> None:
        count, n = len(surface.points), len(surface.triangles)
        about = "".join(f"{byte} " for byte in self.description(frame).encode() + b"\0")
        names = "".join(f'ComponentName{n}="{c}" ' for n, c in enumerate(COMPONENTS))
        path.write_text(
            _HEAD.format("PolyData", "1.0")
            + "<PolyData><FieldData>"
            + _array("TimeValue", np.array([frame.at]), 'NumberOfTuples="1"')
            + '<Array type="String" Name="about" NumberOfTuples="1" format="ascii">'
            + f"{about}</Array></FieldData>"
            + f'<Piece NumberOfPoints="{count}" NumberOfVerts="0" NumberOfLines="0" '
            + f'NumberOfStrips="0" NumberOfPolys="{n}">'
            + '<PointData Scalars="displacement [m]" Normals="normals">'
            + _array("displacement [m]", surface.displacement)
            + _array("curvature [1/m]", surface.curvature, names)
            + _array("normals", surface.normals)
            + "</PointData><Points>"
            + _array("points [m]", surface.points)
            + "</Points><Polys>"
            + _array("connectivity", surface.triangles.ravel())
            + _array("offsets", 3 * np.arange(1, n + 1))
            + "</Polys></Piece></PolyData></VTKFile>\n",
            encoding="ascii",
        )

    def finish(self) -> None:
        if self.request.folder is None:
            return
        sets = "".join(
            f'<DataSet timestep="{at!r}" part="0" file="{html.escape(name)}"/>\n'
            for name, at in self.times.items()
        )
        (self.scratch / self.request.to.name).write_text(
            _HEAD.format("Collection", "0.1") + f"<Collection>\n{sets}</Collection></VTKFile>\n",
            encoding="utf-8",
        )


_HEAD = (
    '<?xml version="1.0"?>\n'
    '<VTKFile type="{}" version="{}" byte_order="LittleEndian" header_type="UInt64">\n'
)


def _array(name: str, values: "NDArray[Any]", more: str = "") -> str:
    kind, little = ("Int64", "<i8") if values.dtype.kind == "i" else ("Float64", "<f8")
    width = values.shape[1] if values.ndim > 1 else 1
    data = values.astype(little).tobytes()
    text = base64.b64encode(np.array(len(data), "<u8").tobytes() + data).decode()
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" {more} '
        f'format="binary">{text}</DataArray>\n'
    )


_FLOAT, _INTEGER = 5126, 5125  # as glTF numbers them: 32 bits each
_UPWARD = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # turns z up to y up, as glTF has it
_MOST_SHAPES = 500
_ANCHORS = np.array([[*bytes.fromhex(anchor[1:])] for anchor in SEQUENTIAL]) / 255


class GlbSurfaces(SurfaceWriter):
    """Binary glTF in m: the skin at a moment, at its deepest, or as it moves (morph targets).

    Coloured by the largest displacement that each point has.
    """

    suffix = ".glb"

    def __init__(self, scratch: Path, request: ExportRequest, info: RecordingInfo) -> None:
        super().__init__(scratch, request, info)
        self._shapes: list[tuple[float, SkinSurface]] = []
        self._about, self._deepest = "", -1.0
        self._parts: list[bytes] = []
        self._accessors: list[dict[str, Any]] = []

    def take(self, frame: ExportedFrame) -> bool:
        c, skin = frame.estimate.coefficients, self._skin(frame.pipeline)
        known = self._shapes and not self.request.every
        return bool(known and skin.depth(c) <= self._deepest) or super().take(frame)

    def write(self, path: Path, frame: ExportedFrame, surface: SkinSurface) -> None:
        deep = float(np.abs(surface.displacement).max())
        if not self.request.every:
            self._shapes = []
        if deep > self._deepest or not self._shapes:
            self._about, self._deepest = self.description(frame), deep
        self._shapes.append((frame.at, surface))
        if len(self._shapes) > _MOST_SHAPES:
            raise Refusal(
                f"expected at most {_MOST_SHAPES} shapes in a .glb, got more; choose a longer time "
                "between two, or a shorter span"
            )
        if len(surface.points) != len(self._shapes[0][1].points):
            raise Refusal(
                f"expected one grid of the skin in a .glb, got another at {frame.at:.6g} s, when "
                "the settings changed; export the time before or after that"
            )

    def finish(self) -> None:
        times, shapes = zip(*self._shapes, strict=True)
        first = shapes[0]
        deep = np.max([np.abs(each.displacement) for each in shapes], axis=0)
        share, places = deep / (self._deepest or 1.0), np.linspace(0, 1, len(_ANCHORS))
        # Of colours glTF has the light, not the values on a screen.
        light: list[Array] = [np.interp(share, places, of) ** 2.2 for of in _ANCHORS.T]
        attributes = {
            "POSITION": self._add(first.points),
            "NORMAL": self._add(first.normals),
            "COLOR_0": self._add(np.column_stack(light)),
        }
        skin = {"attributes": attributes, "indices": self._add(first.triangles), "material": 0}
        targets = [
            {
                "POSITION": self._add(each.points - first.points),
                "NORMAL": self._add(each.normals - first.normals),
            }
            for each in shapes[1:]
        ]
        moving: dict[str, Any] = {}
        if targets:
            at, weights = np.array(times) - times[0], np.eye(len(times))[:, 1:]
            moved = {"input": self._add(at), "output": self._add(weights.ravel())}
            channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
            moving["animations"] = [{"samplers": [moved], "channels": [channel]}]
        many = {"primitives": [skin | {"targets": targets}], "weights": [0.0] * len(targets)}
        look = {"metallicFactor": 0.0, "roughnessFactor": 0.6}
        about = json.loads(self._about) | {"brightest [m]": self._deepest}
        sizes = [len(part) for part in self._parts]
        made = moving | {
            "asset": {"version": "2.0", "generator": self.info.program, "extras": about},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "skin", "rotation": _UPWARD}],
            "meshes": [many if targets else {"primitives": [skin]}],
            "materials": [{"doubleSided": True, "pbrMetallicRoughness": look}],
            "accessors": self._accessors,
            "bufferViews": [
                {"buffer": 0, "byteOffset": sum(sizes[:k]), "byteLength": size}
                for k, size in enumerate(sizes)
            ],
            "buffers": [{"byteLength": sum(sizes)}],
        }
        text, data = json.dumps(made).encode(), b"".join(self._parts)
        text += b" " * (-len(text) % 4)
        head = struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text + data), len(text), b"JSON")
        content = head + text + struct.pack("<I4s", len(data), b"BIN\0") + data
        (self.scratch / self.request.to.name).write_bytes(content)

    def _add(self, values: NDArray[Any]) -> int:
        """The number of the accessor of some values: points (n, 3), triangles or numbers."""
        whole = values.dtype.kind == "i"
        width, kind = (3, "VEC3") if values.ndim == 2 and not whole else (1, "SCALAR")
        data = values.astype("<u4" if whole else "<f4")
        rows = data.reshape(-1, width)
        bounds = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        number = {"componentType": _INTEGER if whole else _FLOAT, "count": len(rows), "type": kind}
        self._accessors.append(number | bounds | {"bufferView": len(self._parts)})
        self._parts.append(data.tobytes())
        return len(self._parts) - 1
