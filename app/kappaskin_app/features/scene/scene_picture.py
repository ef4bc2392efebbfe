"""A skin in relief to a small picture of it."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QLinearGradient, QPainter, QPen, QPolygonF

from kappaskin_app.features.scene.relief import Relief, ReliefMarks
from kappaskin_app.shell.drawn_skin import FROM_THE_LEFT
from kappaskin_app.theme import DARK_INK, LIGHT_INK, SEQUENTIAL, Colours, Theme

Array = NDArray[np.float64]

_FAR = 3.0  # times the skin's extent from its middle to the eye
_LAMP = (-1.0, 0.4, 0.75)  # as in the view of the skin
_FINER = 2  # the skin is drawn so many times larger, and shrunk to smooth its edges
_RIM = 1.2  # px: width of the line along the rim
_ROUND = 5.0  # px: radius of the picture's corners
_MARGIN = 0.06  # of the picture's width
_TOUCH = "#e8543f"  # as in the view of the skin
_HEAD = 6.5  # px: length of an arrow's head


def picture(relief: Relief, theme: Theme, size: QSize, ratio: float) -> QImage:
    """`relief` on the ground of the theme's scene, `size` in px of which each is `ratio` dots.

    It may be painted in any thread.
    """
    image = QImage(size * ratio, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    eye = _Eye(relief, size)
    skin = _skin(relief, theme, eye, image.width(), image.height())
    image.setDevicePixelRatio(ratio)
    skin.setDevicePixelRatio(ratio)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _paint_ground(painter, theme, size)
    painter.drawImage(QPointF(0, 0), skin)
    _paint_marks(painter, relief, eye)
    painter.end()
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

    def facing(self, marks: ReliefMarks) -> list[QPointF]:
        """Where those marks are seen that are on a side that faces it."""
        return _points(self.sees(marks.points)[marks.out @ self.towards > 0])


def _points(places: Array) -> list[QPointF]:
    return [QPointF(x, y) for x, y in places.tolist()]


def _skin(relief: Relief, theme: Theme, eye: _Eye, width: int, height: int) -> QImage:
    """The faces and the rim, those far away first, in a picture of so many dots."""
    finer = _FINER * width / eye.size.width()
    seen, faces = finer * eye.sees(relief.points), relief.faces
    away = eye.away(relief.points[faces].mean(axis=1))
    face, side = np.nonzero(_on_the_rim(relief))
    rim = _widened(seen[faces[face, side]], seen[faces[face, (side + 1) % 4]], _RIM * finer)
    turned = np.roll(rim, 1, axis=1)
    rim = np.where((side % 2 == 1)[:, None, None], turned, rim)  # long the way that its face is
    ink = QColor(theme.faint)
    faint = np.array([ink.red(), ink.green(), ink.blue()], np.uint8)
    colours = np.concatenate([_colours(relief, eye.towards), np.tile(faint, (len(rim), 1))])
    # A face nearer, or its neighbours would lie over half of it.
    nearer = np.linalg.norm(np.ptp(relief.points[faces[face]], axis=1), axis=1)
    order = np.argsort(-np.concatenate([away, away[face] - nearer]), kind="stable")
    corners = np.concatenate([seen[faces], rim])[order]
    fine = _filled(corners, colours[order], _FINER * width, _FINER * height)
    total = np.zeros((height, width, 4), np.uint16)
    for k, m in np.ndindex(_FINER, _FINER):
        total += fine[k::_FINER, m::_FINER]
    rgba = (total // _FINER**2).astype(np.uint8).tobytes()
    form = QImage.Format.Format_RGBA8888_Premultiplied
    return QImage(rgba, width, height, 4 * width, form).copy()


def _widened(begin: Array, end: Array, width: float) -> Array:
    """Corners (k, 4, 2) of lines from `begin` to `end`, (k, 2) each, that are so wide."""
    along = end - begin
    length = np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    aside = width / 2 * np.stack([-along[:, 1], along[:, 0]], axis=1) / length
    return np.stack([begin - aside, end - aside, end + aside, begin + aside], axis=1)


def _filled(corners: Array, colours: Colours, width: int, height: int) -> Colours:
    """Dots (height, width, 4) of faces with `corners` (k, 4, 2) in `colours` (k, 3).

    Later ones lie over earlier ones. Each is filled by as many samples as the longest ones need:
    one call of Qt's for each face would take seconds in a thread that has to wait for its turn.
    """
    sides = np.hypot(*np.moveaxis(np.roll(corners, -1, axis=1) - corners, -1, 0))
    across, along = (math.ceil(1.2 * sides[:, k::2].max()) + 1 for k in (0, 1))
    u, v = np.meshgrid((np.arange(across) + 0.5) / across, (np.arange(along) + 0.5) / along)
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1)
    weights = weights.reshape(-1, 4).astype(np.float32)
    x, y = (corners[..., k].astype(np.float32) @ weights.T for k in (0, 1))
    at = np.clip(y, 0, height - 1).astype(np.int32) * width + np.clip(x, 0, width - 1).astype(int)
    rgba = np.column_stack([colours, np.full(len(colours), 255, np.uint8)]).view(np.uint32)
    made = np.zeros(height * width, np.uint32)
    made[at.ravel()] = np.repeat(rgba, at.shape[1])  # in order, so that the last one is seen
    return made.view(np.uint8).reshape(height, width, 4)


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
    return np.minimum(rgb, 255).astype(np.uint8)


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
    style, caps = Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap
    painter.setPen(QPen(colour, 2 * radius, style, caps))
    painter.drawPoints(QPolygonF(places))


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
