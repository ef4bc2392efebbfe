"""Exported meshes of the skin's surface: STL, VTP and PVD."""

import base64
import html
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin._text import printable
from kappaskin.bases import Basis
from kappaskin.contact import surface_geometry
from kappaskin.errors import Refusal
from kappaskin.frames import COMPONENTS, Array, Indices
from kappaskin.pipeline import Pipeline
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
    """The skin of a `basis` at nx x ny points; those outside its rim are moved onto it."""

    def __init__(self, basis: Basis, nx: int, ny: int) -> None:
        self._basis = basis
        self._rest = RestMesh(basis.patch, nx, ny)

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
