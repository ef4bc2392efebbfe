"""A scene to its skin in space as it is when it is pressed hardest, without Qt."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kappaskin.scenes import AppliedLoads, Indenter, LoadingHistory, Scene, Stimulus, survey_times
from kappaskin_app.shell.drawn_skin import DrawnSkin, Indices
from kappaskin_app.shell.footprint import footprint

Array = NDArray[np.float64]

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
    """Places (k, 3) in mm on the drawn skin, and its outward unit normals (k, 3) there."""

    points: Array
    out: Array


@dataclass(frozen=True, eq=False)
class Relief:
    """A skin as it is drawn: `points` (n, 3) in mm, their normals, and `faces` (k, 4) of them.

    `share` (n,) is the displacement over the largest one. `elements` are where they sense,
    `bearing` where a rigid object does. `paths` are the ways of what touches, in pieces wherever it
    is lifted; `outlines` are those of spread loads, and along an object from end to end. `arrows`
    (k, 2, 3) in mm go from tail to tip.
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
    """The skin of `scene` when it is pressed hardest, drawn deep enough to be seen."""
    patch = scene.plate.patch
    skin = DrawnSkin(patch, *(_OF_A_STRIP if patch.strip else (_POINTS, _POINTS)))
    surface, pressed = _hardest(scene, skin)
    surface = np.where(skin.on, surface, 0.0)
    share, skin.height = _drawn(skin, surface)
    loads = pressed.loads if pressed else ()
    rigid = scene.indenter is not None
    centres = [pressed.contact] if pressed and rigid else [load.centre() for load in loads]
    outlines = [line for line in map(footprint, loads) if line is not None]
    pieces = [piece for stimulus in scene.stimuli for piece in _path(stimulus, scene.duration)]
    bearing = _marks(skin, np.reshape([load.centre() for load in loads if rigid], (-1, 2)))
    return Relief(
        skin.points(),
        skin.shading(),
        skin.faces()[:, 1:],
        np.abs(skin.values(share)),
        _marks(skin, scene.layout.positions[scene.layout.live.any(axis=0)]),
        bearing,
        tuple(_marks(skin, piece) for piece in pieces),
        tuple(_marks(skin, line) for line in outlines) + _rod(bearing),
        _arrows(skin, np.reshape(centres, (-1, 2)), any(load.force < 0 for load in loads)),
    )


def _drawn(skin: DrawnSkin, surface: Array) -> tuple[Array, Array]:
    """The share of the largest displacement, and the height in mm to draw it at, both (ny, nx).

    A dent four times as deep is drawn twice as deep: each is seen, and which is the deeper one.
    """
    most = float(np.max(np.abs(surface)))
    if not most:
        return surface, surface
    share = surface / most
    depth = min(_DEPTH * np.sqrt(1e3 * most / skin.size), _DEEPEST) * skin.size
    return share, -min(depth, skin.deepest) * share


def _marks(skin: DrawnSkin, positions: Array) -> ReliefMarks:
    from scipy.ndimage import map_coordinates  # a tenth of a second that the first picture has not

    rest, out = skin.at_rest(positions)
    ny, nx = skin.height.shape
    x, y = (positions / (skin.patch.a, skin.patch.b) * (nx - 1, ny - 1)).T
    height = map_coordinates(skin.height, [y, x], order=1, mode="nearest") + _LIFT * skin.size
    return ReliefMarks(rest + out * height[:, None], skin.shading()[skin.nearest(positions)])


def _rod(bearing: ReliefMarks) -> tuple[ReliefMarks, ...]:
    """The straight line between the two places farthest apart where a rigid object bears."""
    if len(bearing.points) < 2:
        return ()
    apart = np.linalg.norm(bearing.points[:, None] - bearing.points, axis=-1)
    ends = np.array(np.unravel_index(np.argmax(apart), apart.shape))
    return (ReliefMarks(bearing.points[ends], bearing.out[ends]),)


def _arrows(skin: DrawnSkin, places: Array, pulled: bool) -> Array:
    places = places[np.isfinite(places).all(axis=1)]
    tips = _marks(skin, places).points
    tails = tips + _ARROW * skin.size * skin.at_rest(places)[1]
    return np.stack([tips, tails] if pulled else [tails, tips], axis=1)


def _hardest(scene: Scene, skin: DrawnSkin) -> tuple[Array, AppliedLoads | None]:
    """Displacement (ny, nx) in m, inward, when the load has done most work, and what presses."""
    patch = scene.plate.patch
    ny, nx = skin.height.shape
    x, y = patch.grid(nx, ny)
    times = survey_times(scene)
    if scene.laid is not None:
        bent = [scene.laid.curvature(t) for t in times]
        k_xx, k_yy, k_xy = max(bent, key=lambda k: float(np.abs(k).max()))
        u, v = np.meshgrid(x - x.mean(), y - y.mean())
        return (k_xx - patch.base_curvature) * u**2 / 2 + k_yy * v**2 / 2 + k_xy * u * v, None
    pressing, basis = LoadingHistory(scene, scene.plate), scene.basis
    pressed = [pressing(t) for t in times]
    forces = np.array([moment.force.ravel() for moment in pressed])
    c = scene.plate.compliance(basis).after(forces)
    most = int(np.argmax(np.sum(forces * c, axis=1)))
    return basis.on_grid(x, y)(c[most].reshape(basis.shape)), pressed[most]


def _path(stimulus: Stimulus, duration: float) -> list[Array]:
    """Pieces (k, 2) in m of the way along which it presses; none of what stays where it is."""
    what = stimulus.what
    place = (what.x, what.y) if isinstance(what, Indenter) else what.centre()
    poses = [stimulus.pose_at(t) for t in np.linspace(0, np.nextafter(duration, 0), _ALONG)]
    way = np.array([(pose.dx, pose.dy) for pose in poses])
    presses = np.array([pose.amount > 0 for pose in poses])
    ends = np.flatnonzero(np.diff(presses, prepend=False, append=False)).reshape(-1, 2)
    pieces = [way[begin:end] for begin, end in ends]
    return [place + piece for piece in pieces if np.ptp(piece, axis=0).max() > _STILL]
