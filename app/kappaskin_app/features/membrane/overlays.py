"""Overlays on the skin: error band, principal directions, contact frame, objects."""

import math
import time
from typing import Any

import numpy as np
import pyvista as pv

from kappaskin.contact import ContactObject, placed_object
from kappaskin.frames import Array, Estimate, Indices
from kappaskin.mechanics import PlacedObject
from kappaskin.scenes import Indenter
from kappaskin_app.features.membrane.annotations import UNLIT, pixels
from kappaskin_app.features.membrane.loads import LOAD
from kappaskin_app.features.membrane.membrane import MembraneView
from kappaskin_app.shell.colouring import Colouring, SteadyRange
from kappaskin_app.shell.drawn_skin import MM, DrawnSkin
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.theme import CONTACT, DIVERGING
from kappaskin_app.widgets.text import Coverage

_COLOUR = "#8fd0ff"


class Band:
    """Band of the error bars on both sides of the surface."""

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter
        self._skin: DrawnSkin | None = None
        self._meshes: list[Any] = []
        self._actors: list[Any] = []

    def show(self, skin: DrawnSkin, sd: Array | None, times: float) -> None:
        """Draw it around `skin` for standard deviations `sd` (ny, nx) in m; hide it for None."""
        if sd is not None and skin is not self._skin:
            self._build(skin)
        for actor in self._actors:
            actor.visibility = sd is not None
        if sd is not None:
            wide = MM * times * np.nan_to_num(Coverage.now.of(sd)).ravel()
            for side, mesh in zip((-1, 1), self._meshes, strict=True):
                mesh.points[:] = skin.points(height=skin.height.ravel() + side * wide)

    def _build(self, skin: DrawnSkin) -> None:
        for actor in self._actors:
            self._plotter.remove_actor(actor, render=False)
        self._skin = skin
        faces = skin.faces().ravel()
        self._meshes = [pv.PolyData(skin.points(), faces=faces) for _ in range(2)]
        self._actors = [
            self._plotter.add_mesh(
                mesh,
                color=_COLOUR,
                opacity=0.3,
                **UNLIT,
            )
            for mesh in self._meshes
        ]


_STRIDE = 6  # points of the surface between two crosses
_SHARE = 0.9  # longest line, of the distance between two crosses
_HOLLOW, _CONVEX = DIVERGING[40], DIVERGING[215]


class Directions:
    """Crosses of the principal directions, with lengths by curvature.

    Blue is concave and orange convex, seen from outside.
    """

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter
        self._skin: DrawnSkin | None = None
        self._nodes: Indices = np.empty(0, np.intp)
        self._lines: Any = None
        self.actor: Any = None

    def show(
        self, skin: DrawnSkin, found: Array | None, most: float = 1.0, lift: float = 0.0
    ) -> None:
        """Draw curvatures and angle `found` (3, ny, nx), `lift` mm above the skin; hide for None.

        A curvature of `most` in 1/m has the longest line.
        """
        if found is not None and skin is not self._skin:
            self._build(skin)
        if self.actor is not None:
            self.actor.visibility = found is not None
        if found is None or not len(self._nodes):
            return
        first, second, angle = found.reshape(3, -1)[:, self._nodes]
        curvature = np.concatenate([first, second])
        turned = np.concatenate([angle, angle + np.pi / 2])
        half = _SHARE * self._apart / 2 * np.minimum(np.abs(curvature) / most, 1.0)
        step = half * np.stack([np.cos(turned), np.sin(turned)])
        self._lines.points[:] = np.nan_to_num(self._ends(skin, step, lift))
        colours = np.where((curvature < 0)[:, None], _HOLLOW, _CONVEX)
        self._lines.cell_data["rgb"][:] = colours

    def _ends(self, skin: DrawnSkin, step: Array, lift: float) -> Array:
        """Both ends (4 G, 3) in mm of each line, `step` (2, 2 G) in mm from its node."""
        h_y, h_x = np.gradient(skin.height, skin.cell[1] * MM, skin.cell[0] * MM)
        nodes = np.tile(self._nodes, 2)
        moved = np.einsum("ik,kij->kj", step, self._ways)
        slope = moved[:, 0] * h_x.ravel()[nodes] + moved[:, 1] * h_y.ravel()[nodes]
        height = skin.height.ravel()[nodes] + lift
        ends: list[Array] = []
        for side in (-1, 1):
            rest, out = skin.at_rest(self._positions + side * moved / MM)
            ends.append(rest + out * (height + side * slope)[:, None])
        return np.stack(ends, axis=1).reshape(-1, 3)

    def _build(self, skin: DrawnSkin) -> None:
        self._skin = skin
        stride = _STRIDE * max(1, skin.on.shape[1] // 64)
        chosen = np.zeros(skin.on.shape, bool)
        chosen[stride // 2 :: stride, stride // 2 :: stride] = True
        self._nodes = np.flatnonzero(chosen & skin.on)
        self._positions = np.tile(skin.shares[self._nodes] * (skin.patch.a, skin.patch.b), (2, 1))
        # From steps along the skin's frames to steps of its coordinates.
        self._ways = skin.patch.base(*self._positions.T).covariant[:, 1:3, 1:3]
        self._apart = stride * MM * float(skin.cell.min())
        if self.actor is not None:
            self._plotter.remove_actor(self.actor, render=False)
        count = 2 * len(self._nodes)
        cells = np.column_stack([np.full(count, 2), np.arange(2 * count).reshape(-1, 2)])
        self._lines = pv.PolyData(np.zeros((2 * count, 3)), lines=cells.ravel())
        self._lines.cell_data["rgb"] = np.zeros((count, 3), np.uint8)
        self.actor = self._plotter.add_mesh(
            self._lines,
            scalars="rgb",
            rgb=True,
            line_width=pixels(self._plotter, 3),
            **UNLIT,
        )


_LONG = 0.2  # of the skin's size
_POINTS = 9  # of a line
_RIM = 32  # points of the cone's rim
_NORMAL = (31, 209, 122)  # as the contact's own mark
_COLOURS = np.array([_NORMAL, DIVERGING[215], DIVERGING[40], _NORMAL], np.uint8)
_AROUND, _OUT, _FINE = 48, 14, 32  # points around, outward, and to find the extent
_WAYS = 2 * np.pi * np.arange(_AROUND) / _AROUND
_SIDES = np.stack([np.cos(_WAYS), np.sin(_WAYS)], axis=-1)


class ContactFrame:
    """Axes of the contact frame, a cone of the normal's and an ellipse of the place's error bar."""

    def __init__(self, plotter: Any) -> None:
        points = np.arange(3 * _POINTS + _AROUND)
        axes, ellipse = points[: 3 * _POINTS].reshape(3, -1), points[3 * _POINTS :]
        lines = np.insert(axes, 0, _POINTS, axis=1).ravel()
        lines = np.r_[lines, _AROUND + 1, ellipse, ellipse[0]]
        self._lines: Any = pv.PolyData(np.zeros((len(points), 3)), lines=lines)
        self._lines.cell_data["rgb"] = _COLOURS
        rim = 1 + np.arange(_RIM)
        faces = np.column_stack([np.full(_RIM, 3), np.zeros(_RIM, int), rim, 1 + rim % _RIM])
        self._cone: Any = pv.PolyData(np.zeros((1 + _RIM, 3)), faces=faces.ravel())
        self.actor = plotter.add_mesh(
            self._lines, scalars="rgb", rgb=True, line_width=pixels(plotter, 5), **UNLIT
        )
        self.cone = plotter.add_mesh(
            self._cone, color=np.array(_NORMAL) / 255, opacity=0.35, **UNLIT
        )
        self.hide()

    def hide(self) -> None:
        self.actor.visibility = self.cone.visibility = False

    def show(
        self,
        skin: DrawnSkin,
        position: Array,
        angle: float,
        slope_sd: Array | None,
        reach: Array,
        lift: float = 0.0,
    ) -> None:
        """Draw it at `position` (2,) in m, the first direction `angle` rad from x.

        Directions and ellipse lie on the skin, `lift` mm above it. `slope_sd` (2,) are the standard
        deviations of the drawn slopes, None if unknown; `reach` (2,) in m is the error bar of the
        position.
        """
        (origin,), _ = skin.place(position[None])
        x0, y0 = position.tolist()
        x, y = skin.tangents(position)
        normal = np.cross(x, y)
        normal /= np.linalg.norm(normal)
        length = _LONG * skin.size
        lines = [origin + length * np.linspace(0, 1, _POINTS)[:, None] * normal]
        for turn in (angle, angle + np.pi / 2):
            # Along the skin: straight lines would be hidden where it is concave.
            along = length / MM * np.linspace(-0.5, 0.5, _POINTS)[:, None]
            there = skin.patch.around(x0, y0, along * (np.cos(turn), np.sin(turn)))
            lines.append(skin.place(there, lift)[0])
        ellipse = skin.patch.around(x0, y0, np.nan_to_num(reach) * _SIDES)
        lines.append(skin.place(ellipse, lift)[0])
        self._lines.points[:] = np.concatenate(lines)
        self.actor.visibility = True
        self.cone.visibility = slope_sd is not None
        if slope_sd is not None:
            around = 2 * np.pi * np.arange(_RIM) / _RIM
            off = Coverage.now.of(slope_sd)[:, None] * np.stack([np.cos(around), np.sin(around)])
            rim = normal + off[0, :, None] * x + off[1, :, None] * y
            rim *= length / np.linalg.norm(rim, axis=1, keepdims=True)
            self._cone.points[:] = np.vstack([origin, origin + rim])


_ABOVE = 0.35  # of the skin's size: the highest part drawn


class ObjectMesh:
    """Translucent lit mesh of an object, exaggerated as the skin is unless on a cap or mesh."""

    def __init__(self, plotter: Any, colour: str) -> None:
        self._mesh: Any = pv.PolyData(np.zeros((_OUT * _AROUND, 3)), faces=_faces())
        self._mesh.point_data.active_normals = np.zeros((_OUT * _AROUND, 3))
        self.actor = plotter.add_mesh(
            self._mesh,
            color=colour,
            opacity=0.45,
            ambient=0.6,
            diffuse=0.5,
            specular=0.25,
            **UNLIT | {"lighting": True},
        )
        self.actor.prop.interpolation = "Gouraud"
        self.actor.visibility = False

    def show(self, stands: PlacedObject | None, skin: DrawnSkin, times: float) -> None:
        """Draw a placed object resting on the `skin`; hide it for None."""
        points = None if stands is None else underside(stands, skin, times)
        self.actor.visibility = points is not None
        if points is not None:
            self._mesh.points[:] = points
            self._mesh.point_data.active_normals[:] = _normals(points)


def _normals(points: Array) -> Array:
    """Unit normals (k, 3) of the rings of `points` (k, 3), towards the inside of the object."""
    rings = points.reshape(_OUT, _AROUND, 3)
    around = np.roll(rings, -1, axis=1) - np.roll(rings, 1, axis=1)
    around[0] = around[1]  # the first ring is a point
    normals = np.cross(np.gradient(rings, axis=0), around).reshape(-1, 3)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def underside(stands: PlacedObject, skin: DrawnSkin, times: float) -> Array | None:
    """Points (k, 3) in mm of the underside in contact with the drawn skin.

    None where the object is nowhere above the skin. On a cap or mesh it has its true shape.
    """
    if len(skin.rim):
        times = 1.0  # else the skin's own fall would be exaggerated with it, to a funnel
    reach, (x, y) = (
        min(float(np.hypot(*stands.object_.extent)), skin.side / MM),
        stands.place.tolist(),
    )
    shares = np.linspace(0.0, 1.0, _FINE)
    offsets = (reach * shares[:, None, None] * _SIDES).reshape(-1, 2)
    places = skin.patch.around(x, y, offsets)
    height = stands.over(skin.patch, places)[0].reshape(_FINE, _AROUND)
    depth = _depth(skin, places, height.ravel(), times)
    if not np.isfinite(depth):
        return None
    near = np.isfinite(height) & (times * MM * (height - depth) < _ABOVE * skin.size)
    outermost = np.where(near.all(axis=0), _FINE, near.argmin(axis=0)) - 1
    if outermost.max() <= 0:
        return None
    far = reach * shares[np.maximum(outermost, 0)]
    offsets = np.linspace(0, 1, _OUT)[:, None, None] * far[:, None] * _SIDES
    places = skin.patch.around(x, y, offsets.reshape(-1, 2))
    rise = np.nan_to_num(stands.over(skin.patch, places)[0] - depth, posinf=0.0)
    up = np.array(skin.patch.base(x, y).normal)
    return skin.at_rest(places)[0] + np.multiply.outer(times * MM * rise, up)


def _depth(skin: DrawnSkin, places: Array, height: Array, times: float) -> float:
    """Depth in m of the lowest point when the object touches the skin without entering it."""
    over = np.isfinite(height) & skin.patch.contains(places)
    if not over.any():
        return float("nan")
    moved = -skin.height_at(places[over]) / (MM * times)
    return float(np.min(moved + height[over]))


def _faces() -> Indices:
    """Faces between the rings, in VTK's format."""
    index = np.arange(_OUT * _AROUND).reshape(_OUT, _AROUND)
    beside = np.roll(index, -1, axis=1)
    corners = np.stack([index[:-1], beside[:-1], beside[1:], index[1:]], axis=-1).reshape(-1, 4)
    return np.insert(corners, 0, 4, axis=1).ravel()


_LEAST = 2.0  # 1/m of the longest line at least, so that noise stays short
_OLD = 2.0  # s after which a recognised object is discarded


class Overlays:
    """Principal directions, error band, contact frame and objects on a `membrane`."""

    def __init__(self, membrane: MembraneView, colouring: Colouring, session: Session) -> None:
        self._membrane, self._colouring, self._session = membrane, colouring, session
        plotter = membrane.plotter
        self.directions, self.frame = Directions(plotter), ContactFrame(plotter)
        self.band = Band(plotter)
        self.found, self.pressed = ObjectMesh(plotter, CONTACT), ObjectMesh(plotter, LOAD)
        self._longest = SteadyRange(_LEAST)
        self._object: ContactObject | None = None
        self._object_time = -math.inf

    def set_object(self, what: ContactObject) -> None:
        """Store the recognised object."""
        self._object, self._object_time = what, time.monotonic()

    def show(self, estimate: Estimate, settings: Settings, times: float) -> None:
        """Draw the selected overlays on a skin exaggerated by `times`."""
        self._show_directions(estimate, settings)
        self._show_band(estimate, settings, times)
        self._show_frame(estimate, settings, times)
        skin = self._membrane.skin
        found = self._recognised_object(estimate) if settings.show_object else None
        stands = self._pressed_object(estimate) if settings.show_pressed else None
        self.found.show(found, skin, times)
        self.pressed.show(stands, skin, times)
        # Two translucent surfaces at one place could not be told apart.
        self.found.actor.prop.style = "surface" if stands is None else "wireframe"

    def hide(self) -> None:
        """Hide all overlays."""
        skin = self._membrane.skin
        self.directions.show(skin, None)
        self.band.show(skin, None, 1.0)
        self.frame.hide()
        for sheet in (self.found, self.pressed):
            sheet.show(None, skin, 1.0)

    def _show_directions(self, estimate: Estimate, settings: Settings) -> None:
        quantities = self._colouring.quantities(estimate) if settings.show_directions else None
        known = quantities is not None and bool(np.isfinite(estimate.coefficients).all())
        found, most = None, 1.0
        if quantities is not None and known:
            found = quantities.directions(estimate)
            most = self._longest.follow(float(np.nanmax(np.abs(found[:2]))), time.monotonic())
        self.directions.show(self._membrane.skin, found, most, self._membrane.lift)

    def _show_band(self, estimate: Estimate, settings: Settings, times: float) -> None:
        bars = self._colouring.error_bars(estimate) if settings.show_band else None
        sd = None if bars is None else bars.on_surface(estimate.noise)
        self.band.show(self._membrane.skin, sd, times)

    def _show_frame(self, estimate: Estimate, settings: Settings, times: float) -> None:
        contact = estimate.contact
        if not (settings.show_frame and contact.present):
            self.frame.hide()
            return
        bars, slopes = self._colouring.error_bars(estimate), None
        if bars is not None:
            slopes = times * bars.of_slopes(contact.position, estimate.noise)
        angle, membrane = float(estimate.geometry.angle), self._membrane
        half_widths = zip(contact.position_sd, contact.position_95, strict=True)
        reach = np.array([Coverage.now.of(sd, half) for sd, half in half_widths])
        self.frame.show(membrane.skin, contact.position, angle, slopes, reach, membrane.lift)

    def _recognised_object(self, estimate: Estimate) -> PlacedObject | None:
        """The recently recognised object at the present contact."""
        what, contact = self._object, estimate.contact
        if what is None or not contact.present or time.monotonic() - self._object_time > _OLD:
            return None
        if what.kind in ("sphere", "cylinder") and not math.isfinite(what.radius):
            return None  # a bound is no size
        patch = self._membrane.skin.patch
        return placed_object(what, contact.position, max(patch.a, patch.b))

    def _pressed_object(self, estimate: Estimate) -> PlacedObject | None:
        """The rigid object of the playing scene at its present place."""
        session = self._session
        if not session.inside:
            return None
        at = session.status.playing.time(estimate.device_time)
        for stimulus in session.scene.stimuli:
            what, pose = stimulus.what, stimulus.pose_at(at)
            if isinstance(what, Indenter) and pose.amount:
                place = np.array([what.x + pose.dx, what.y + pose.dy])
                return PlacedObject(what.rigid, place, what.turn + pose.turn)
        return None
