"""Camera: direction of view, and projection between skin and screen."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from PySide6.QtCore import QObject, QPointF, Signal
from pyvistaqt import QtInteractor

from kappaskin.frames import Array
from kappaskin_app.features.membrane.annotations import Sides
from kappaskin_app.shell.drawn_skin import FROM_THE_LEFT, MM, NO_SKIN, Direction, DrawnSkin

_LOW = 0.2  # of the shorter side: depth of view below the skin at rest
_MARGIN = 0.06  # of the longer side: room for labels and arrow


DIRECTIONS = {
    "left": FROM_THE_LEFT,
    "above": Direction("from above", (0.0, 0.0, 1.6), (0.0, 1.0, 0.0)),
    "front": Direction("along y", (0.0, -1.6, 0.0)),
    "side": Direction("along x", (1.6, 0.0, 0.0)),
    "below": Direction("from below", (0.0, 0.0, -1.6), (0.0, 1.0, 0.0)),
    "corner": Direction("from a corner, isometric", (-1.0, -1.0, 1.0)),
}
_NUMBERS = 12  # of a camera


def fit_camera(renderer: Any, skin: DrawnSkin, direction: Direction, label: float) -> None:
    """View the whole `skin` from `direction`.

    With room for a label right of it and, around a corner or before a curved side, left of it; a
    label takes the share `label` of the width.
    """
    camera = renderer.GetActiveCamera()
    body = _around(skin, 0.0)
    least, most = body.min(axis=0), body.max(axis=0)
    middle = (least + most) / 2
    camera.SetFocalPoint(*middle)
    camera.SetPosition(*(middle + skin.side * np.array(direction.towards)))
    camera.SetViewUp(*direction.up)
    camera.SetViewAngle(30.0)
    renderer.ResetCamera(*np.column_stack([least, most]).ravel())
    camera.SetWindowCenter(0.0, 0.0)
    seen = np.array([_in_view(renderer, *point) for point in _around(skin, _MARGIN)])
    least, most = seen.min(axis=0), seen.max(axis=0)
    across = [_in_view(renderer, *point)[0] for point in body]
    before = label * (2.0 if any(skin.patch.curvatures) else 1.2)
    after = 2.2 * label
    beside = (2.0 - before - after) / float(np.ptp(across))
    zoom = min(1.94 / float(np.max(most - least)), beside)
    least, most = zoom * least, zoom * most
    least[0] = min(least[0], zoom * min(across) - before)
    most[0] = max(most[0], zoom * max(across) + after)
    camera.Zoom(zoom)
    camera.SetWindowCenter(*((least + most) / 2))
    renderer.ResetCameraClippingRange()


def camera_of(renderer: Any, skin: DrawnSkin) -> tuple[float, ...]:
    """Numbers of the camera: focal point, position, view-up, angle and shift.

    Relative to the middle of `skin` in units of its longer side, so that they suit other skins.
    """
    camera, middle = renderer.GetActiveCamera(), _middle(skin)
    places = (camera.GetFocalPoint(), camera.GetPosition())
    seen = [(np.array(place) - middle) / skin.side for place in places]
    rest = (*camera.GetViewUp(), camera.GetViewAngle(), *camera.GetWindowCenter())
    return tuple(float(value) for value in (*seen[0], *seen[1], *rest))


def place_camera(renderer: Any, skin: DrawnSkin, numbers: Sequence[float]) -> None:
    """Place the camera by the numbers of `camera_of`; ignore others."""
    if len(numbers) != _NUMBERS:
        return
    camera, middle = renderer.GetActiveCamera(), _middle(skin)
    at, position, up = (np.array(numbers[n : n + 3]) for n in (0, 3, 6))
    camera.SetFocalPoint(*(middle + skin.side * at))
    camera.SetPosition(*(middle + skin.side * position))
    camera.SetViewUp(*up)
    camera.SetViewAngle(numbers[9])
    camera.SetWindowCenter(*numbers[10:])
    renderer.ResetCameraClippingRange()


def _middle(skin: DrawnSkin) -> Array:
    """Middle (3,) of a skin at rest, in mm."""
    body = _around(skin, 0.0)
    return (body.min(axis=0) + body.max(axis=0)) / 2


def _around(skin: DrawnSkin, share: float) -> Array:
    """Points (k, 3) in mm around the skin with a margin of this share."""
    a, b = skin.patch.a, skin.patch.b
    margin = share * skin.side
    curved = zip((a, b), skin.patch.curvatures, strict=True)
    x, y = (np.linspace(0, length, 9 if H else 2) for length, H in curved)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    if len(skin.rim):
        places = np.concatenate([places[skin.patch.contains(places)], skin.rim])
    points, out = skin.at_rest(places)
    low, high = -_LOW * MM * min(a, b), 2 * margin
    corners = [(dx, dy, 0.0) for dx in (-margin, 2.5 * margin) for dy in (-margin, margin)]
    return np.concatenate([points + z * out + at for z in (low, high) for at in corners])


def _in_view(renderer: Any, x: float, y: float, z: float) -> Array:
    """View coordinates (2,) of a point in mm, from -1 to 1."""
    renderer.SetWorldPoint(x, y, z, 1.0)
    renderer.WorldToView()
    return np.array(renderer.GetViewPoint()[:2])


class Projection:
    """Projection between points (3,) in mm and pixels of the widget."""

    def __init__(self, plotter: QtInteractor) -> None:
        self._plotter = plotter

    def to_screen(self, point: Array) -> Array:
        """Widget pixels (2,) of a point."""
        renderer, ratio = self._plotter.renderer, self._plotter.devicePixelRatioF()
        renderer.SetWorldPoint(*point, 1.0)
        renderer.WorldToDisplay()
        x, y, _ = renderer.GetDisplayPoint()
        return np.array([x / ratio, self._plotter.height() - y / ratio])

    def line(self, at: QPointF) -> tuple[Array, Array]:
        """The nearest and the farthest point under a pixel."""
        renderer, ratio = self._plotter.renderer, self._plotter.devicePixelRatioF()
        ends: list[Array] = []
        for depth in (0.0, 1.0):
            y_up = self._plotter.height() - at.y()
            renderer.SetDisplayPoint(at.x() * ratio, y_up * ratio, depth)
            renderer.DisplayToWorld()
            x, y, z, w = renderer.GetWorldPoint()
            ends.append(np.array([x, y, z]) / w)
        return ends[0], ends[1]


class CameraControl(QObject):
    """Places the camera of a `plotter` and labels the `sides` of the `skin`.

    `turned` emits the camera's numbers after the mouse has moved it: dragged, or else by the wheel.
    """

    turned = Signal(tuple, bool)

    def __init__(self, plotter: QtInteractor, sides: Sides) -> None:
        super().__init__(plotter)
        self._plotter, self._sides, self.skin = plotter, sides, NO_SKIN
        self._look, self._camera = "left", ()
        self._start: tuple[float, ...] = ()  # the camera before a drag
        self._dragged = False
        for event, note in (
            ("StartInteractionEvent", self._begin),
            ("InteractionEvent", self._drag),
            ("EndInteractionEvent", self._end),
        ):
            plotter.iren.interactor.AddObserver(event, note)

    def _begin(self, *_: object) -> None:
        self._start, self._dragged = camera_of(self._plotter.renderer, self.skin), False

    def _drag(self, *_: object) -> None:
        self._dragged = True
        self._sides.show_from(None)

    def _end(self, *_: object) -> None:
        position = camera_of(self._plotter.renderer, self.skin)
        if position != self._start:
            self._camera = position
            self._sides.show_from(None)
            self.turned.emit(position, self._dragged)

    def show(self, look: str, camera: tuple[float, ...]) -> None:
        """View the whole skin from a direction, or with the numbers of a `camera`."""
        if (look, camera) != (self._look, self._camera):
            self._look, self._camera = look, camera
            self.place()

    def fit(self) -> None:
        """Fit the skin to the view after a change of size, unless the user moved the camera."""
        if self._camera:
            self._sides.fit(self._plotter)
        else:
            self.place()

    def place(self) -> None:
        """Place the camera as requested, for the present skin."""
        renderer, direction = self._plotter.renderer, DIRECTIONS.get(self._look, FROM_THE_LEFT)
        label = self._sides.fit(self._plotter)
        if self._camera:
            place_camera(renderer, self.skin, self._camera)
        else:
            fit_camera(renderer, self.skin, direction, label)
        self._sides.show_from(None if self._camera else direction)
        self._plotter.update()
