"""A skin in relief to a small picture of it."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QLinearGradient, QPainter, QPen, QPolygonF

from kappaskin_app.theme import DARK_INK, LIGHT_INK, SEQUENTIAL, Colours, Theme
from kappaskin_app.views.camera import FROM_THE_LEFT
from kappaskin_app.views.relief import Marks, Relief

Array = NDArray[np.float64]

_FAR = 3.0  # times the skin's extent from its middle to the eye
_LAMP = (-1.0, 0.4, 0.75)  # as in the view of the skin
_FINER = 2  # the surface is drawn so many times larger, and shrunk to smooth its edges
_ROUND = 5.0  # px: radius of the picture's corners
_MARGIN = 0.06  # of the picture's width
_TOUCH = "#e8543f"  # as in the view of the skin
_HEAD = 6.5  # px: length of an arrow's head


def picture(relief: Relief, theme: Theme, size: QSize, ratio: float) -> QImage:
    """`relief` on the ground of the theme's scene, `size` in px of which each is `ratio` dots.

    It may be painted in any thread.
    """
    image = _clear(size, ratio)
    image.setDevicePixelRatio(ratio)
    eye = _Eye(relief, size)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    _paint_ground(painter, theme, size)
    painter.drawImage(QRectF(0, 0, size.width(), size.height()), _skin(relief, theme, eye, ratio))
    _paint_marks(painter, relief, eye)
    painter.end()
    return image


def _clear(size: QSize, ratio: float) -> QImage:
    image = QImage(size * ratio, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    return image


class _Eye:
    """Where points in mm are seen in a picture of `size` px, the whole as large as fits."""

    def __init__(self, relief: Relief, size: QSize) -> None:
        self.size = size
        towards, up = np.array(FROM_THE_LEFT.towards), np.array(FROM_THE_LEFT.up)
        self.towards = towards / np.linalg.norm(towards)
        right = np.cross(up, self.towards)
        right /= np.linalg.norm(right)
        self._axes = np.array([right, -np.cross(self.towards, right)])
        whole = np.concatenate([relief.points, relief.arrows.reshape(-1, 3)])
        low, high = whole.min(axis=0), whole.max(axis=0)
        self._middle = (low + high) / 2
        self._far = _FAR * float(np.linalg.norm(high - low))
        self._scale, self._shift = 1.0, np.zeros(2)
        seen = self.sees(whole)
        low, high = seen.min(axis=0), seen.max(axis=0)
        sides = np.array([size.width(), size.height()])
        self._scale = float(np.min((sides - 2 * _MARGIN * size.width()) / (high - low)))
        self._shift = sides / 2 - self._scale * (low + high) / 2

    def away(self, points: Array) -> Array:
        """How far (...) in mm points (..., 3) are from the eye."""
        return self._far - (points - self._middle) @ self.towards

    def sees(self, points: Array) -> Array:
        """Where (..., 2) in px points (..., 3) in mm are seen."""
        flat = (points - self._middle) @ self._axes.T
        return self._shift + self._scale * flat / self.away(points)[..., None]

    def facing(self, marks: Marks) -> list[QPointF]:
        """Where those marks are seen that are on a side that faces it."""
        return _points(self.sees(marks.points)[marks.out @ self.towards > 0])


def _points(places: Array) -> list[QPointF]:
    return [QPointF(x, y) for x, y in places.tolist()]


def _skin(relief: Relief, theme: Theme, eye: _Eye, ratio: float) -> QImage:
    """The faces and the rim, those far away first, larger than they are to be.

    Without smooth edges, or the seams between neighbours would show.
    """
    finer = _FINER * ratio
    image = _clear(eye.size, finer)
    faces = relief.faces
    order = np.argsort(-eye.away(relief.points[faces].mean(axis=1)))
    corners = (finer * eye.sees(relief.points))[faces[order]].tolist()
    colours = _colours(relief, eye.towards)[order].tolist()
    rims = [np.flatnonzero(rim).tolist() for rim in _on_the_rim(relief)[order]]
    painter, rim_pen = QPainter(image), QPen(QColor(theme.faint), 1.2 * finer)
    painter.setPen(Qt.PenStyle.NoPen)
    for face, rgb, rim in zip(corners, colours, rims, strict=True):
        places = [QPointF(x, y) for x, y in face]
        painter.setBrush(QColor(*rgb))
        painter.drawConvexPolygon(places)
        if rim:
            painter.setPen(rim_pen)
            for side in rim:
                painter.drawLine(places[side], places[(side + 1) % 4])
            painter.setPen(Qt.PenStyle.NoPen)
    painter.end()
    return image


def _on_the_rim(relief: Relief) -> NDArray[np.bool_]:
    """Which sides (k, 4) of the faces no other face has."""
    faces = relief.faces
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)
    _, which, count = np.unique(
        sides.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
    )
    return (count[which] == 1).reshape(faces.shape)


def _colours(relief: Relief, towards: Array) -> Colours:
    """RGB (k, 3) of the faces: what they are pressed in by, lit by a lamp and from the eye."""
    share = relief.share[relief.faces].mean(axis=1)
    normals = relief.normals[relief.faces].mean(axis=1)
    lamp = np.array(_LAMP) / np.linalg.norm(_LAMP)
    light = 0.5 + 0.7 * np.maximum(normals @ lamp, 0) + 0.16 * np.maximum(normals @ towards, 0)
    rgb = SEQUENTIAL[np.rint(255 * share).astype(int)] * light[:, None]
    return np.clip(rgb, 0, 255).astype(np.uint8)


def _paint_ground(painter: QPainter, theme: Theme, size: QSize) -> None:
    ground = QLinearGradient(0, 0, 0, size.height())
    ground.setColorAt(0, QColor(theme.scene_top))
    ground.setColorAt(1, QColor(theme.scene))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(ground)
    painter.drawRoundedRect(QRectF(0, 0, size.width(), size.height()), _ROUND, _ROUND)


def _paint_marks(painter: QPainter, relief: Relief, eye: _Eye) -> None:
    _paint_dots(painter, eye.facing(relief.elements), _faded(LIGHT_INK, 0.75), 0.9)
    for path in relief.paths:
        _paint_line(painter, eye.sees(path.points), LIGHT_INK)
    for outline in relief.outlines:
        seen = eye.sees(outline.points)
        if np.allclose(seen[0], seen[-1]):
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(_faded(_TOUCH, 0.3))
            painter.drawPolygon(QPolygonF(_points(seen)))
        _paint_line(painter, seen, _TOUCH)
    _paint_dots(painter, eye.facing(relief.bearing), QColor(_TOUCH), 1.9)
    for arrow in relief.arrows:
        _paint_arrow(painter, eye.sees(arrow))


def _faded(colour: str, share: float) -> QColor:
    made = QColor(colour)
    made.setAlphaF(share)
    return made


def _paint_dots(painter: QPainter, places: list[QPointF], colour: QColor, radius: float) -> None:
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(colour)
    for place in places:
        painter.drawEllipse(place, radius, radius)


def _paint_line(painter: QPainter, places: Array, colour: str) -> None:
    style, caps, joins = Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for ink, width in ((_faded(DARK_INK, 0.45), 2.9), (QColor(colour), 1.6)):
        painter.setPen(QPen(ink, width, style, caps, joins))
        painter.drawPolyline(QPolygonF(_points(places)))


def _paint_arrow(painter: QPainter, places: Array) -> None:
    tail, tip = places
    along = (tip - tail) / max(math.hypot(*(tip - tail)), 1e-9)
    neck, aside = tip - _HEAD * along, 0.42 * _HEAD * np.array([-along[1], along[0]])
    _paint_line(painter, np.array([tail, neck]), _TOUCH)
    painter.setPen(QPen(_faded(DARK_INK, 0.45), 0.7))
    painter.setBrush(QColor(_TOUCH))
    painter.drawConvexPolygon(_points(np.array([tip, neck + aside, neck - aside])))
