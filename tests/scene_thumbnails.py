"""The gallery's thumbnails of the ready scenes, on a transparent ground for both themes.

Run `python tests/scene_thumbnails.py` when a scene changes: a thumbnail holds the digest of its
scene as text, which `tests/app/features/scene/test_thumbnails.py` compares.
"""

import hashlib
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, PngImagePlugin
from PySide6.QtCore import QPointF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPen, QPolygonF
from scipy.ndimage import map_coordinates

import kappaskin_resources
from kappaskin.frames import Array, Indices, Mask
from kappaskin.mechanics import shapes_under
from kappaskin.scenes import (
    SCENES,
    AppliedLoads,
    Indenter,
    LoadingHistory,
    Scene,
    Stimulus,
    load_scene,
    scene_file,
)
from kappaskin_app.shell.drawn_skin import FROM_THE_LEFT, DrawnSkin
from kappaskin_app.shell.loads import footprint
from kappaskin_app.theme import DARK_INK, LIGHT_INK, SEQUENTIAL, Colours

THUMBNAILS = Path(kappaskin_resources.__file__).parent / "scenes" / "thumbnails"
SIZE, RATIO = QSize(160, 101), 2
"""Size of a thumbnail in px, and its dots per px."""
DIGEST = "scene"
"""The text of a picture that is the digest of its scene."""
_COLOURS = 128

_POINTS = 49  # of the surface along each side
_OF_A_STRIP = (97, 25)  # along x and y: nothing changes along y
_DEPTH = 1.15  # times the root of its displacement, as shares of its size, a skin is drawn deep
_DEEPEST = 0.4  # of its size
_LIFT = 0.01  # of its size that dots and lines are drawn above it
_ARROW = 0.26  # of its size
_ALONG = 145  # moments of a path
_STILL = 1e-6  # m that a touch has to go to leave a path


@dataclass(frozen=True, eq=False)
class ReliefMarks:
    """Points (k, 3) in mm on the drawn skin, and its outward unit normals (k, 3) there."""

    points: Array
    out: Array


@dataclass(frozen=True, eq=False)
class Relief:
    """A skin as it is drawn: `points` (n, 3) in mm, their normals, and `faces` (k, 4) of them.

    `share` (n,) is the displacement over the largest one. `elements` are the positions of the
    elements, `bearing` the contact points of a rigid object. `paths` are the paths of the stimuli,
    divided where they are lifted; `outlines` are those of distributed loads and of long objects.
    `arrows` (k, 2, 3) in mm go from tail to tip.
    """

    points: Array
    normals: Array
    faces: Indices
    share: Array
    elements: ReliefMarks
    bearing: ReliefMarks
    paths: tuple[ReliefMarks, ...]
    outlines: tuple[ReliefMarks, ...]
    arrows: Array


def relief(scene: Scene) -> Relief:
    """The skin of `scene` at its largest force, drawn with vertical exaggeration."""
    patch = scene.plate.patch
    skin = DrawnSkin(patch, *(_OF_A_STRIP if patch.strip else (_POINTS, _POINTS)))
    surface, pressed = _hardest(scene, skin)
    surface = np.where(skin.on, surface, 0.0)
    share, skin.height = _drawn(skin, surface)
    loads = pressed.loads if pressed else ()
    rigid = scene.indenter is not None
    centres = [pressed.contact] if pressed and rigid else [load.centre() for load in loads]
    each = (footprint(load, patch) for load in loads)
    outlines = [line for line in each if line is not None]
    pieces = [piece for stimulus in scene.stimuli for piece in _path(stimulus, scene.duration)]
    bearing = _marks(skin, np.reshape([load.centre() for load in loads if rigid], (-1, 2)))
    return Relief(
        skin.points(),
        skin.shading(),
        skin.faces()[:, 1:],
        np.abs(skin.values(share)),
        _marks(skin, scene.layout.positions[scene.layout.alive]),
        bearing,
        tuple(_marks(skin, piece) for piece in pieces),
        tuple(_marks(skin, line) for line in outlines) + _rod(bearing),
        _arrows(skin, np.reshape(centres, (-1, 2)), any(load.force < 0 for load in loads)),
    )


def _drawn(skin: DrawnSkin, surface: Array) -> tuple[Array, Array]:
    """The share of the largest displacement, and the height in mm to draw it at, both (ny, nx).

    A dent four times as deep is drawn twice as deep: both are visible, and which is the deeper one.
    """
    most = float(np.max(np.abs(surface)))
    if not most:
        return surface, surface
    share = surface / most
    depth = min(_DEPTH * np.sqrt(1e3 * most / skin.size), _DEEPEST) * skin.size
    return share, skin.height_of(1e-3 * min(depth, skin.deepest) * share)


def _marks(skin: DrawnSkin, positions: Array) -> ReliefMarks:
    rest, out = skin.at_rest(positions)
    ny, nx = skin.height.shape
    x, y = (positions / (skin.patch.a, skin.patch.b) * (nx - 1, ny - 1)).T
    height = map_coordinates(skin.height, [y, x], order=1, mode="nearest") + _LIFT * skin.size
    return ReliefMarks(rest + out * height[:, None], skin.shading()[skin.nearest(positions)])


def _rod(bearing: ReliefMarks) -> tuple[ReliefMarks, ...]:
    """The straight line between the two most distant contact points of a rigid object."""
    if len(bearing.points) < 2:
        return ()
    distances = np.linalg.norm(bearing.points[:, None] - bearing.points, axis=-1)
    ends = np.array(np.unravel_index(np.argmax(distances), distances.shape))
    return (ReliefMarks(bearing.points[ends], bearing.out[ends]),)


def _arrows(skin: DrawnSkin, places: Array, pulled: bool) -> Array:
    places = places[np.isfinite(places).all(axis=1)]
    tips = _marks(skin, places).points
    tails = tips + _ARROW * skin.size * skin.at_rest(places)[1]
    return np.stack([tips, tails] if pulled else [tails, tips], axis=1)


def _hardest(scene: Scene, skin: DrawnSkin) -> tuple[Array, AppliedLoads | None]:
    """Inward displacement (ny, nx) in m at the largest work of the load, and the loads."""
    patch = scene.plate.patch
    ny, nx = skin.height.shape
    x, y = patch.grid(nx, ny)
    times = scene.survey_times
    if scene.laid is not None:
        bent = [scene.laid.curvature(t) for t in times]
        k_xx, k_yy, k_xy = max(bent, key=lambda k: float(np.abs(k).max()))
        u, v = np.meshgrid(x - x.mean(), y - y.mean())
        return (k_xx - patch.arc_curvature) * u**2 / 2 + k_yy * v**2 / 2 + k_xy * u * v, None
    pressing, basis = LoadingHistory(scene, scene.plate), scene.basis
    pressed = [pressing(t) for t in times]
    forces = np.array([moment.force.ravel() for moment in pressed])
    c = shapes_under(scene.plate, basis, forces)
    most = int(np.argmax(np.sum(forces * c, axis=1)))
    return basis.on_grid(x, y)(c[most].reshape(basis.shape)), pressed[most]


def _path(stimulus: Stimulus, duration: float) -> list[Array]:
    """Pieces (k, 2) in m of the path of the stimulus; none if it does not move."""
    what = stimulus.what
    place = (what.x, what.y) if isinstance(what, Indenter) else what.centre()
    poses = [stimulus.pose_at(t) for t in np.linspace(0, np.nextafter(duration, 0), _ALONG)]
    way = np.array([(pose.dx, pose.dy) for pose in poses])
    presses = np.array([pose.amount > 0 for pose in poses])
    ends = np.flatnonzero(np.diff(presses, prepend=False, append=False)).reshape(-1, 2)
    pieces = [way[begin:end] for begin, end in ends]
    return [place + piece for piece in pieces if np.ptp(piece, axis=0).max() > _STILL]


_FAR = 3.0  # times the skin's extent from its middle to the camera
_LAMP = (-1.0, 0.4, 0.75)  # as in the view of the skin
_FINER = 2  # the skin is drawn so many times larger, and shrunk to smooth its edges
_RIM, _RIM_COLOUR = 1.2, (126, 135, 146)  # px: width of the line along the rim; on either ground
_MARGIN = 0.06  # of the picture's width
_TOUCH = "#e8543f"  # as in the view of the skin
_HEAD = 6.5  # px: length of an arrow's head


def picture(relief: Relief, size: QSize = SIZE, ratio: float = RATIO) -> QImage:
    """`relief`, `size` in px of which each is `ratio` dots."""
    image = QImage(size * ratio, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    camera = _Camera(relief, size)
    skin = _skin(relief, camera, image.width(), image.height())
    image.setDevicePixelRatio(ratio)
    skin.setDevicePixelRatio(ratio)
    with QPainter(image) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.drawImage(QPointF(0, 0), skin)
        _paint_marks(painter, relief, camera)
    return image


class _Camera:
    """Projection of points in mm into a picture of `size` px, as large as fits."""

    def __init__(self, relief: Relief, size: QSize) -> None:
        self.size = size
        towards, up = np.array(FROM_THE_LEFT.towards), np.array(FROM_THE_LEFT.up)
        self.towards = towards / np.linalg.norm(towards)
        right = np.cross(up, self.towards)
        right /= np.linalg.norm(right)
        self._axes = np.array([right, -np.cross(self.towards, right)])
        drawn = relief.points[np.unique(relief.faces)]
        whole = np.concatenate([drawn, relief.arrows.reshape(-1, 3)])
        low, high = whole.min(axis=0), whole.max(axis=0)
        self._middle = (low + high) / 2
        self._far = _FAR * float(np.linalg.norm(high - low))
        self._scale, self._shift = 1.0, np.zeros(2)
        projected = self.project(whole)
        low, high = projected.min(axis=0), projected.max(axis=0)
        sides = np.array([size.width(), size.height()])
        self._scale = float(np.min((sides - 2 * _MARGIN * size.width()) / (high - low)))
        self._shift = sides / 2 - self._scale * (low + high) / 2

    def away(self, points: Array) -> Array:
        """Distance (...) in mm of points (..., 3) from the camera."""
        return self._far - (points - self._middle) @ self.towards

    def project(self, points: Array) -> Array:
        """Projection (..., 2) in px of points (..., 3) in mm."""
        flat = (points - self._middle) @ self._axes.T
        return self._shift + self._scale * flat / self.away(points)[..., None]

    def facing(self, marks: ReliefMarks) -> list[QPointF]:
        """Projection of the marks on the sides that face the camera."""
        return _points(self.project(marks.points)[marks.out @ self.towards > 0])


def _points(places: Array) -> list[QPointF]:
    return [QPointF(x, y) for x, y in places.tolist()]


def _skin(relief: Relief, camera: _Camera, width: int, height: int) -> QImage:
    """The faces and the rim, the farthest first, in a picture of `width` by `height` dots."""
    finer = _FINER * width / camera.size.width()
    points, faces = finer * camera.project(relief.points), relief.faces
    away = camera.away(relief.points[faces].mean(axis=1))
    face, side = np.nonzero(_on_the_rim(relief))
    rim = _widened(points[faces[face, side]], points[faces[face, (side + 1) % 4]], _RIM * finer)
    turned = np.roll(rim, 1, axis=1)
    rim = np.where((side % 2 == 1)[:, None, None], turned, rim)  # long the way that its face is
    faint = np.array(_RIM_COLOUR, np.uint8)
    colours = np.concatenate([_colours(relief, camera.towards), np.tile(faint, (len(rim), 1))])
    # A face nearer, or its neighbours would lie over half of it.
    nearer = np.linalg.norm(np.ptp(relief.points[faces[face]], axis=1), axis=1)
    order = np.argsort(-np.concatenate([away, away[face] - nearer]), kind="stable")
    corners = np.concatenate([points[faces], rim])[order]
    fine = _filled(corners, colours[order], _FINER * width, _FINER * height)
    total = np.zeros((height, width, 4), np.uint16)
    for k, m in np.ndindex(_FINER, _FINER):
        total += fine[k::_FINER, m::_FINER]
    rgba = (total // _FINER**2).astype(np.uint8).tobytes()
    form = QImage.Format.Format_RGBA8888_Premultiplied
    return QImage(rgba, width, height, 4 * width, form).copy()


def _widened(begin: Array, end: Array, width: float) -> Array:
    """Corners (k, 4, 2) of lines of a `width` from `begin` to `end`, (k, 2) each."""
    along = end - begin
    length = np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    aside = width / 2 * np.stack([-along[:, 1], along[:, 0]], axis=1) / length
    return np.stack([begin - aside, end - aside, end + aside, begin + aside], axis=1)


def _filled(corners: Array, colours: Colours, width: int, height: int) -> Colours:
    """Dots (height, width, 4) of faces with `corners` (k, 4, 2) in `colours` (k, 3).

    Later ones lie over earlier ones. Each is filled by as many samples as the longest ones need.
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
    made[at.ravel()] = np.repeat(rgba, at.shape[1])  # in order, so that the last one is on top
    return made.view(np.uint8).reshape(height, width, 4)


def _on_the_rim(relief: Relief) -> Mask:
    """Whether the sides (k, 4) of the faces are on the rim."""
    faces = relief.faces
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)
    _, which, count = np.unique(
        sides.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
    )
    return (count[which] == 1).reshape(faces.shape)


def _colours(relief: Relief, towards: Array) -> Colours:
    """RGB (k, 3) of the faces: their displacement, shaded by a lamp and the camera's light."""
    share = relief.share[relief.faces].mean(axis=1)
    normals = relief.normals[relief.faces].mean(axis=1)
    lamp = np.array(_LAMP) / np.linalg.norm(_LAMP)
    light = 0.5 + 0.7 * np.maximum(normals @ lamp, 0) + 0.16 * np.maximum(normals @ towards, 0)
    rgb = SEQUENTIAL[np.rint(255 * share).astype(int)] * light[:, None]
    return np.minimum(rgb, 255).astype(np.uint8)


def _paint_marks(painter: QPainter, relief: Relief, camera: _Camera) -> None:
    _paint_dots(painter, camera.facing(relief.elements), _faded(LIGHT_INK, 0.75), 0.9)
    for path in relief.paths:
        _paint_line(painter, camera.project(path.points), LIGHT_INK)
    for outline in relief.outlines:
        projected = camera.project(outline.points)
        if np.allclose(projected[0], projected[-1]):
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(_faded(_TOUCH, 0.3))
            painter.drawPolygon(QPolygonF(_points(projected)))
        _paint_line(painter, projected, _TOUCH)
    _paint_dots(painter, camera.facing(relief.bearing), QColor(_TOUCH), 1.9)
    for arrow in relief.arrows:
        _paint_arrow(painter, camera.project(arrow))


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


def digest(name: str) -> str:
    """Of the file of a ready scene, and of the files beside it that it names."""
    file = scene_file(name)
    text, made = file.read_text("utf-8"), hashlib.sha256()
    for part in [file, *sorted(file.parent.iterdir())]:
        if part == file or f'"{part.name}"' in text:
            made.update(part.read_bytes().replace(b"\r\n", b"\n"))
    return made.hexdigest()


def packed(image: QImage, of_scene: str) -> bytes:
    """A PNG of few colours, with the digest of the scene."""
    straight = image.convertToFormat(QImage.Format.Format_RGBA8888)
    size = straight.width(), straight.height()
    colours = Image.frombytes("RGBA", size, bytes(straight.constBits()))
    few = colours.quantize(_COLOURS, Image.Quantize.FASTOCTREE)
    note, file = PngImagePlugin.PngInfo(), io.BytesIO()
    note.add_text(DIGEST, of_scene)
    few.save(file, "PNG", optimize=True, pnginfo=note)
    return file.getvalue()


def main() -> None:
    THUMBNAILS.mkdir(exist_ok=True)
    for orphan in {*THUMBNAILS.iterdir()} - {THUMBNAILS / f"{name}.png" for name in SCENES}:
        orphan.unlink()
    for name in SCENES:
        made = packed(picture(relief(load_scene(name))), digest(name))
        (THUMBNAILS / f"{name}.png").write_bytes(made)


if __name__ == "__main__":
    main()
