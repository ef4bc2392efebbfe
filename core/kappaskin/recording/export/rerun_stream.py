"""Estimates as entities of Rerun: the skin, the contact, readings as tensors, and scalars."""

import importlib
import math
import tempfile
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from kappaskin.errors import optional
from kappaskin.frames import Array, Estimate
from kappaskin.pipeline import REPORTED, SEQUENTIAL, Pipeline, Reported, numbers_of
from kappaskin.recording.export.request import ExportedFrame, ExportRequest, RecordingInfo
from kappaskin.skin import RestMesh

PICTURE = 1 / 30
"""Seconds between two pictures of the skin, the readings and the contact at least."""

_SCALARS = 0.1  # s of scalars that are sent at once
_POINTS = 33  # of the skin along each of its sides
_PIXELS = 64  # of an image along each side, where elements are in no grid
_EYE: Array = np.array([0.3, -1.2, 0.8])  # from the middle of a skin whose longer side is 1
_ARROW = 0.2  # of the longer side: an arrow along the normal
_COLOURS: Array = np.array([[*bytes.fromhex(anchor[1:])] for anchor in SEQUENTIAL])
_PLACES = np.linspace(0, 1, len(_COLOURS))
_GREEN = (31, 209, 122)
_TRANSLUCENT = (255, 255, 255, 190)  # or the skin would hide the axes of a contact

_QUANTITIES = [q for q in REPORTED if q.group in ("frame", "fit", "contact") and q.published]
_numbers = numbers_of(_QUANTITIES)
_STARTS = np.cumsum([0, *(len(q.published) for q in _QUANTITIES)])


def scalars() -> dict[str, list[tuple[int, str, str, str]]]:
    """The scalars of each entity: column of all numbers, key, unit and meaning."""
    found: dict[str, list[tuple[int, str, str, str]]] = {}
    for start, quantity in zip(_STARTS.tolist(), _QUANTITIES, strict=False):
        for n, number in enumerate(quantity.published):
            name = f"{quantity.group}/{quantity.name}{'_sd' * ('_sd_' in number.key)}"
            unit = "rad" if number.key.endswith("_rad") else quantity.unit
            found.setdefault(name, []).append((start + n, number.key, unit, number.text))
    return found


class RerunStream:
    """Sends estimates to `stream`, a recording stream of Rerun, on the time line `time`.

    That is when the scan began by the device's clock, or when it was read where that is not known,
    in s since 1970 by this machine's. Scalars are those of every estimate; the skin, its readings
    and the contact are drawn each `PICTURE` s at most. Entities of a `finger` begin with its name.
    `about` has facts as JSON.
    """

    def __init__(self, purpose: str, name: str, finger: str = "", about: str = "") -> None:
        self._rr = optional("rerun", "rerun", purpose)
        self.stream = self._rr.RecordingStream("kappaskin", recording_id=name or None)
        self._root, self._about = f"/{finger}" if finger else "", about
        self._skin: _Skin | None = None
        self._times: list[float] = []
        self._rows: list[list[float]] = []
        self._next_picture = -math.inf
        self._is_drawn = False

    def _begin(self, skin: "_Skin") -> None:
        """Send what holds for all times, and how a viewer arranges it."""
        rr = self._rr
        self._static("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for name, columns in scalars().items():
            keys = [key for _, key, _, _ in columns]
            self._static(name, rr.SeriesLines(names=keys))
            units, meanings = ([each[n] for each in columns] for n in (2, 3))
            self._static(name, rr.AnyValues(unit=units, description=meanings))
        if self._about:
            self._static("about", rr.TextDocument(self._about, media_type="application/json"))
        blueprint: Any = importlib.import_module("rerun.blueprint")
        root = self._root or "/"
        plots = [
            blueprint.TimeSeriesView(name=title, contents=[f"{self._root}/{name}"])
            for title, name in (
                ("Force in N", "contact/force"),
                ("Place in m", "contact/position"),
                ("Curvature in 1/m", "contact/principal"),
            )
        ]
        layout = skin.pipeline.sensor.layout
        images = [
            blueprint.TensorView(
                name=f"{name} in {unit}",
                origin=f"{self._root}/readings/{name}",
                slice_selection=blueprint.TensorSliceSelection(
                    width=1, height=rr.TensorDimensionSelection(dimension=0, invert=True)
                ),
                scalar_mapping=blueprint.TensorScalarMapping(
                    colormap="CyanToYellow", mag_filter="Nearest"
                ),
            )
            for name, unit in zip(layout.kind_names, layout.kind_units, strict=True)
        ]
        middle = skin.rest.points.mean(axis=0)
        views = blueprint.Horizontal(
            blueprint.Spatial3DView(
                name="Skin, in m",
                origin=root,
                contents=["$origin/skin", "$origin/contact/**"],
                eye_controls=blueprint.EyeControls3D(
                    position=middle + skin.side * _EYE, look_target=middle
                ),
            ),
            blueprint.Vertical(blueprint.Horizontal(*images), *plots),
        )
        self.stream.send_blueprint(blueprint.Blueprint(views, collapse_panels=True))

    def _static(self, entity: str, *what: object) -> None:
        path = entity if entity == "/" else f"{self._root}/{entity}"
        self.stream.log(path, *what, static=True)

    def take(self, time: float, reported: Reported, pipeline: Pipeline) -> None:
        """Take the estimate of a scan that began at `time` in s since 1970."""
        self._times.append(time)
        self._rows.append(_numbers(reported))
        if time - self._times[0] >= _SCALARS or time < self._times[0]:
            self.send_scalars()
        if not time - self._next_picture < 0 or time < self._next_picture - 2 * PICTURE:
            self._next_picture = time + PICTURE
            self._draw(time, reported, pipeline)

    def send_scalars(self) -> None:
        """Send the scalars that were taken."""
        if not self._rows:
            return
        when = [self._rr.TimeColumn("time", timestamp=self._times)]
        rows = np.array(self._rows, float)
        for name, columns in scalars().items():
            values = rows[:, [n for n, *_ in columns]]
            made = self._rr.Scalars.columns(scalars=values.ravel())
            made = made.partition([len(columns)] * len(rows))
            self.stream.send_columns(f"{self._root}/{name}", when, made)
        self._times, self._rows = [], []

    def _log(self, entity: str, *what: object) -> None:
        self.stream.log(f"{self._root}/{entity}", *what)

    def _draw(self, time: float, reported: Reported, pipeline: Pipeline) -> None:
        rr, estimate = self._rr, reported.estimate
        if self._skin is None or self._skin.pipeline is not pipeline:
            self._skin = _Skin(pipeline)
            self._begin(self._skin)
        skin = self._skin
        self.stream.set_time("time", timestamp=time)
        if np.isfinite(estimate.coefficients).all():
            displacement = skin.displacement(estimate)
            self._log(
                "skin",
                rr.Mesh3D(
                    vertex_positions=skin.rest.displaced(displacement),
                    triangle_indices=skin.rest.triangles,
                    vertex_colors=skin.colours(displacement),
                    albedo_factor=_TRANSLUCENT,
                ),
                rr.AnyValues(displacement_m=displacement),
            )
        layout = pipeline.sensor.layout
        kinds = zip(layout.kind_names, layout.kind_units, strict=True)
        readings = layout.by_kind(estimate.curvature)
        for (name, unit), values in zip(kinds, readings, strict=True):
            image, largest = skin.image(values), skin.largest(name, values)
            image = rr.Tensor(image, dim_names=("y", "x"), value_range=(-largest, largest))
            self._log(f"readings/{name}", image, rr.AnyValues(unit=unit))
        if estimate.contact.present:
            self._draw_contact(reported, skin.side)
        elif self._is_drawn:
            for entity in ("normal", "uncertainty", "frame"):
                self._log(f"contact/{entity}", rr.Clear(recursive=False))
        self._is_drawn = estimate.contact.present

    def _draw_contact(self, reported: Reported, side: float) -> None:
        """The frame at the contact, its inward normal as an arrow, and one standard deviation."""
        rr, geometry = self._rr, reported.geometry
        place, frame, length = geometry.position, geometry.frame, _ARROW * side
        turn = rr.Quaternion(xyzw=Rotation.from_matrix(frame.T).as_quat())
        pose = rr.Transform3D(translation=place, quaternion=turn)
        self._log("contact/frame", pose, rr.TransformAxes3D(length))
        force, sd = reported.contact.force, reported.contact.force_sd
        label = f"{force:.3g} ± {sd:.1g} N" if math.isfinite(force) else ""
        arrow = length * geometry.normal
        self._log(
            "contact/normal",
            rr.Arrows3D(vectors=[-arrow], origins=[place + arrow], colors=[_GREEN], labels=[label]),
        )
        spread, _ = reported.in_space()
        if np.isfinite(spread).all():
            self._log(
                "contact/uncertainty",
                rr.Ellipsoids3D(half_sizes=[spread], centers=[place], colors=[_GREEN]),
            )

    def flush(self, seconds: float) -> None:
        """Send all that was taken, within so many `seconds`; an `OSError` where that fails."""
        self.send_scalars()
        try:
            self.stream.flush(timeout_sec=seconds)
        except (RuntimeError, ValueError) as error:
            raise OSError(str(error)) from error


class _Skin:
    """The points of a skin, and the elements that pixels show; made once per setup."""

    def __init__(self, pipeline: Pipeline) -> None:
        layout, basis = pipeline.sensor.layout, pipeline.basis
        self.pipeline, patch = pipeline, basis.patch
        self.side = max(patch.a, patch.b)
        self.rest = RestMesh(patch, _POINTS, _POINTS)
        self._values = basis.at(self.rest.positions)
        self._deepest = 1e-4 * self.side
        self._largest: dict[str, float] = {}
        x, y = (np.unique(of.round(9)) for of in layout.positions.T)
        if len(x) * len(y) != len(layout):
            x, y = ((np.arange(_PIXELS) + 0.5) / _PIXELS * length for length in (patch.a, patch.b))
        pixels = np.stack(np.meshgrid(x, y), axis=-1)
        self._element = KDTree(layout.positions).query(pixels)[1]
        self._off = ~patch.contains(pixels.reshape(-1, 2)).reshape(pixels.shape[:2])

    def displacement(self, estimate: Estimate) -> Array:
        """Displacement (k,) of the points in m, positive inward."""
        return self._values @ estimate.coefficients.ravel()

    def colours(self, displacement: Array) -> "np.ndarray[Any, np.dtype[np.uint8]]":
        """Colours (k, 3) from 0 to the largest displacement so far, without its sign."""
        deep = np.abs(displacement)
        self._deepest = max(self._deepest, float(deep.max()))
        share = deep / self._deepest
        columns: list[Array] = [np.interp(share, _PLACES, of) for of in _COLOURS.T]
        return np.column_stack(columns).astype(np.uint8)

    def largest(self, kind: str, values: Array) -> float:
        """The largest of the readings of a `kind` so far, without its sign."""
        before = self._largest.get(kind, np.finfo(float).tiny)
        self._largest[kind] = float(np.fmax.reduce(np.abs(values), initial=before))
        return self._largest[kind]

    def image(self, values: Array) -> "np.ndarray[Any, np.dtype[np.float32]]":
        """Values (P,) of the elements along y and x, both upward; 0 off the skin or not known.

        A viewer of tensors draws NaN as the least value.
        """
        found = np.where(self._off, 0.0, values[self._element])
        return np.nan_to_num(found).astype(np.float32)


_PATIENCE = 60.0  # s until all is on the disk


class RrdFile:
    """A file of Rerun: what `RerunStream` sends, and the facts of the recording as `about`."""

    def __init__(self, scratch: Path, request: ExportRequest, info: RecordingInfo) -> None:
        name, finger = info.facts["recording"], request.finger or ""
        self._out = RerunStream("an .rrd file", name, finger, info.json())
        self._file = scratch / request.to.name
        self._out.stream.save(self._file)
        self._began = datetime.fromisoformat(info.facts["began"]).timestamp()

    def take(self, frame: ExportedFrame) -> bool:
        estimate = frame.estimate
        before = estimate.taken - estimate.host_time
        at = self._began + frame.at + (before if math.isfinite(before) else 0.0)
        self._out.take(at, frame.reported, frame.pipeline)
        return True

    def finish(self) -> None:
        try:
            self._out.flush(_PATIENCE)
        except OSError:
            # Rerun tells its log alone why, such as a full disk, which this meets too.
            with tempfile.TemporaryFile(dir=self._file.parent) as file:
                file.write(bytes(2**20))
            raise

    def close(self) -> None:
        self._out.stream.disconnect()
