"""Objects on a cap are named right, or not named, on a shell that owes the library nothing."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from kappaskin import Cap, LeastSquares, ObjectFinder, Plate, SensorLayout, basis_for
from kappaskin.contact import Contacts, as_one
from navier import Load
from revolution import RevolvedShell, sphere
from studies import along_x

pytestmark = [pytest.mark.truth, pytest.mark.slow, pytest.mark.full]

R, D, H, ANGLE = 8e-3, 1e-3, 1e-3, np.radians(75)  # as of the scene fingertip-cap
NOISE, STEP, ACROSS = 0.1, 0.2e-3, 10
PLACES = {"pole": (0.0, 0.0), "beside": (0.42 * R * ANGLE, 0.8)}  # along the meridian, azimuth
AXIS = 0.4  # rad from x


@dataclass(frozen=True)
class Shape:
    """What presses: a `kind`, curved by 1 / `radius` along both or across its axis."""

    kind: str
    radius: float = np.inf

    def height(self, u, v):
        """Height in m above its lowest point, u along its axis and v across it."""
        if self.kind == "edge":
            return np.where(np.abs(v) < 1e-9, 0.0, 1.0)
        away = np.hypot(u, v) if self.kind == "sphere" else np.abs(v)
        return away**2 / (2 * self.radius) if self.kind != "plane" else 0 * u


SHAPES = [
    Shape("plane"),
    *(Shape("sphere", r) for r in (3e-3, 6e-3, 12e-3, 25e-3)),
    *(Shape("cylinder", r) for r in (2e-3, 6e-3, 12e-3)),
    Shape("edge"),
]


class Pressed:
    """A shell pressed around a place: nodes, what they give of each other, and what is read."""

    def __init__(self, far, azimuth, elements):
        shell = RevolvedShell(sphere(R), R * ANGLE, rigidity=D, thickness=H, edge="clamped")
        line = STEP * np.arange(-ACROSS, ACROSS + 1)
        u, v = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2).T
        self.nodes, self.fall = np.stack([u, v]), R * (1 - np.cos(np.hypot(u, v) / R))
        t, way = np.hypot(u, v) / R, np.arctan2(v, u) + AXIS - azimuth  # from the meridian
        up = far / R
        out = np.array([np.sin(up), 0.0, np.cos(up)])
        along, around = np.array([np.cos(up), 0.0, -np.sin(up)]), np.array([0.0, 1.0, 0.0])
        ahead = np.multiply.outer(np.cos(way), along) + np.multiply.outer(np.sin(way), around)
        x, y, z = (np.cos(t)[:, None] * out + np.sin(t)[:, None] * ahead).T
        s = np.round(R * np.arccos(np.clip(z, -1, 1)), 9)
        places = np.stack([s, np.arctan2(y, x) + azimuth], -1)
        moved, read = shell.mover(places), shell.reader(elements)
        loads = [Load(s * np.cos(t), s * np.sin(t), 1.0, radius=STEP / 2) for s, t in places]
        G = np.array([moved(load) for load in loads])
        layer = H**4 / (12 * (1 - 0.3**2) * D)  # the thickness over Young's modulus
        self.gives = (G + G.T) / 2 + layer / STEP**2 * np.eye(len(G))
        self.reads = np.array([along_x(read(load), elements[:, 1]).ravel() for load in loads])

    def under(self, shape, force):
        """Curvature (3, P) in 1/m under a `shape`, and the forces in N."""
        gap = shape.height(*self.nodes) + self.fall
        on = gap < 0.5
        G, gap = self.gives[np.ix_(on, on)], gap[on]
        L, heavy = np.linalg.cholesky(G), 1e3 * np.sqrt(G.max())
        A = np.vstack([L.T, np.full(len(gap), heavy)])
        F, _ = nnls(A, np.append(solve_triangular(L, -gap, lower=True), heavy * force))
        return (F @ self.reads[on]).reshape(3, -1), F


class Skin:
    def __init__(self):
        cap = Cap(R, ANGLE)
        plate, self.layout = Plate(cap, rigidity=D, thickness=H), SensorLayout.in_spiral(cap, 60)
        self.fit = LeastSquares(basis_for(cap, "clamped", 8, 13), self.layout)
        self.contacts = Contacts(plate, self.layout, "clamped")
        self.find = ObjectFinder(plate, self.layout, "clamped")
        x, y = (self.layout.positions - cap.rim_radius).T
        self.elements = np.stack([np.hypot(x, y), np.arctan2(y, x)], -1)

    def finds(self, curvature, draws):
        rng = np.random.default_rng(draws)
        for _ in range(draws):
            K = curvature + rng.normal(0, NOISE, curvature.shape)
            yield self.find(K, NOISE, as_one(*self.contacts(K, self.fit(K))))


@cache
def skin():
    return Skin()


@cache
def pressed(name):
    return Pressed(*PLACES[name], skin().elements)


@pytest.mark.parametrize("place", PLACES)
def test_no_sure_name_is_wrong_and_radii_and_forces_are_covered(place):
    right = named = covered = radii = forces = frames = 0
    for shape in SHAPES:
        for force in (0.1, 0.5, 1.0, 2.0, 3.0, 4.0):
            curvature, _ = pressed(place).under(shape, force)
            for found in skin().finds(curvature, 3):
                frames += 1
                forces += abs(found.force - force) <= max(found.force_95, 0.02 * force)
                if not found.sure:
                    continue
                named += 1
                low, high = found.radius_95
                within = low <= (0.0 if shape.kind == "edge" else shape.radius) <= high
                alike = {found.kind, shape.kind} <= {"edge", "cylinder"} and within
                right += found.kind == shape.kind or alike
                if found.kind in ("sphere", "cylinder"):
                    radii += 1
                    covered += within
    assert right == named
    assert named > 0.3 * frames
    assert covered >= 0.9 * radii
    assert forces >= 0.9 * frames


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("shape", SHAPES[:5], ids=lambda one: f"{one.kind} {1e3 * one.radius} mm")
def test_a_light_touch_has_no_name(place, shape):
    curvature, _ = pressed(place).under(shape, 0.1)

    assert not any(found.sure for found in skin().finds(curvature, 20))


@pytest.mark.parametrize("place", PLACES)
def test_each_kind_is_named_where_it_shows(place):
    for shape, force in (
        (Shape("plane"), 2.0),
        (Shape("sphere", 6e-3), 4.0),
        (Shape("cylinder", 12e-3), 4.0),
        (Shape("edge"), 3.0),
    ):
        curvature, _ = pressed(place).under(shape, force)
        kinds = [found.kind for found in skin().finds(curvature, 10) if found.sure]
        assert kinds.count(shape.kind) >= 8, (shape, kinds)
