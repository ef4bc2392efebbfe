"""Surfaces to VTK's XML files, which ParaView and PyVista read, and the list of a series."""

import base64
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import COMPONENTS
from kappaskin.recording.export.moment import Moment
from kappaskin.recording.export.skin import Surface
from kappaskin.recording.export.surfaces import Surfaces


class VtpSurfaces(Surfaces):
    """Points in m with `displacement` [m], `curvature` [1/m] and normals; `about` as field data."""

    suffix = ".vtp"

    def write(self, path: Path, moment: Moment, surface: Surface) -> None:
        count, n = len(surface.points), len(surface.triangles)
        told = "".join(f"{byte} " for byte in self.said(moment).encode() + b"\0")
        names = "".join(f'ComponentName{n}="{c}" ' for n, c in enumerate(COMPONENTS))
        path.write_text(
            _HEAD.format("PolyData", "1.0")
            + "<PolyData><FieldData>"
            + _array("TimeValue", np.array([moment.at]), 'NumberOfTuples="1"')
            + '<Array type="String" Name="about" NumberOfTuples="1" format="ascii">'
            + f"{told}</Array></FieldData>"
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
        if self.wanted.folder is None:
            return
        sets = "".join(
            f'<DataSet timestep="{at!r}" part="0" file={quoteattr(name)}/>\n'
            for name, at in self.times.items()
        )
        (self.room / self.wanted.to.name).write_text(
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
    told = base64.b64encode(np.array(len(data), "<u8").tobytes() + data).decode()
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" {more} '
        f'format="binary">{told}</DataArray>\n'
    )
