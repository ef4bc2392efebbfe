"""Contacts on meshes: against shells that share nothing with the library."""

from dataclasses import dataclass, replace
from functools import cache
from math import pi, radians, sqrt

import numpy as np
import pytest

from kappaskin import GaussianLoad, Plate, SensorLayout, basis_for, load_scene
from kappaskin.contact.influence import influence_of
from kappaskin.skin import MeshSkin
from koiter import Panel
from meshes import disk, ellipsoid
from navier import Load
from revolution import RevolvedShell, sphere
from solid_shell import SolidShell, quadratic
from studies import Case, _even, coverage

pytestmark = pytest.mark.truth

R = 8e-3
FEW, ALL = 200, 1000


@dataclass(frozen=True, eq=False)
class MeshCase(Case):
    """A case on a mesh of a sphere, from the pole to an `angle`."""

    angle: float = 0.0

    @property
    def layout(self):
        k = np.arange(60)
        s, azimuth = R * _even((k + 0.5) / 60, self.angle), k * pi * (3 - sqrt(5))
        return SensorLayout.scattered(self.skin.patch, _on(self.skin.patch, s, azimuth))


def _on(mesh, s, azimuth):
    far = R * np.sin(s / R)
    return mesh.places[0] + np.stack([far * np.cos(azimuth), far * np.sin(azimuth)], -1)


def _polar(mesh, positions):
    x, y = (positions - mesh.places[0]).T
    return R * np.arcsin(np.hypot(x, y) / R), np.arctan2(y, x)


def _as_seen(read, s, azimuth):
    """Readings (3, P) along the meridian and the parallel, along x as it is seen from above."""
    t, zero = s / R, 0 * s
    along = [np.cos(t) * np.cos(azimuth), np.cos(t) * np.sin(azimuth), -np.sin(t)]
    around = [-np.sin(azimuth), np.cos(azimuth), zero]
    out = np.stack([np.sin(t) * np.cos(azimuth), np.sin(t) * np.sin(azimuth), np.cos(t)], -1)
    x = np.cross([0.0, 1.0, 0.0], out)
    x /= np.linalg.norm(x, axis=1)[:, None]
    c, z = np.vecdot(x, np.stack(along, -1)), np.vecdot(x, np.stack(around, -1))
    ss, tt, st = read
    xx, yy = c * c * ss + z * z * tt, z * z * ss + c * c * tt
    xy = c * z * (tt - ss) + (c * c - z * z) * st
    return np.stack([xx + 2 * c * z * st, yy - 2 * c * z * st, xy])


def _case(mm, force, thickness, rings, degrees=60):
    angle = radians(degrees)
    mesh = MeshSkin(*ellipsoid(rings, (R, R, R), angle), thickness)
    plate = Plate(mesh)
    shell = RevolvedShell(
        sphere(R), R * angle, rigidity=plate.rigidity, thickness=thickness, edge="clamped"
    )

    def truth(layout):
        s, azimuth = _polar(mesh, layout.positions)
        read = shell.reader(np.stack([s, azimuth], -1))

        def under(load):
            (far,), (turn,) = _polar(mesh, np.array([[load.x, load.y]]))
            there = replace(load, x=far * np.cos(turn), y=far * np.sin(turn))
            return _as_seen(read(there), s, azimuth)

        return under

    def load(share):
        far = R * _even(share[0], 0.75 * angle)
        return Load(*_on(mesh, far, 2 * pi * share[1]), force, radius=1e-3 * mm)

    return MeshCase(
        f"{1e3 * thickness:g} mm, disc of {mm} mm",
        plate,
        truth,
        load,
        edge="clamped",
        low=0,
        high=1,
        bound=False,
        angle=angle,
    )


@cache
def figures(mm, force, frames):
    return coverage(_case(mm, force, 0.25e-3, 50), frames)


@pytest.mark.full
@pytest.mark.parametrize("frames", [FEW, ALL])
@pytest.mark.parametrize(("mm", "force"), [(1, 2.1), (2, 4.4)])
def test_intervals_on_a_mesh_of_a_cap_cover_the_truth(mm, force, frames):
    found = figures(mm, force, frames)

    slack = 0.0 if frames >= ALL else 2 * sqrt(0.95 * 0.05 / frames)
    assert found.found == 1
    assert abs(found.bias) < 0.01
    for share in (found.x, found.y, found.force):
        assert 0.92 - slack <= share <= 0.98 + slack


# Gages of some length: the mean of the shell's curvature along great circles


def _along_circles(mesh, positions, turns, far):
    """Places and unit vectors along the sphere (P, 2) so far along great circles, as turned."""
    x, y = (positions - mesh.places[0]).T / R
    out = np.column_stack([x, y, np.sqrt(1 - x * x - y * y)])

    def frame(out):
        e_x = np.cross([0.0, 1.0, 0.0], out)
        e_x /= np.linalg.norm(e_x, axis=1)[:, None]
        return e_x, np.cross(out, e_x)

    e_x, e_y = frame(out)
    way = np.cos(turns)[:, None] * e_x + np.sin(turns)[:, None] * e_y
    c, s = np.cos(far / R), np.sin(far / R)
    there, onward = c * out + s * way, c * way - s * out
    ways = np.stack([np.vecdot(onward, each) for each in frame(there)], axis=-1)
    return mesh.places[0] + R * there[:, :2], ways


@pytest.mark.full
def test_gages_on_a_mesh_read_the_mean_along_them():
    length, case, count = 2e-3, _case(1, 1.0, 1e-3, 24), 12
    mesh, k = case.skin.patch, np.arange(count)
    turns = np.random.default_rng(0).uniform(-pi, pi, count)
    places = _on(mesh, R * _even((k + 0.5) / count, 0.8 * case.angle), k * pi * (3 - sqrt(5)))
    layout = SensorLayout.scattered(mesh, places).reading(k, "curvature").turned(turns)
    out = np.zeros((4, count))
    influence = influence_of(case.skin, replace(layout, gage_length=length), "clamped", 15, out)
    steps = length * np.linspace(-0.5, 0.5, 9)
    weights = np.array([1, *[4, 2] * 3, 4, 1]) / 24  # Simpson's rule

    for share in (0.1, 0.5):
        load = case.load((share, 0.2))

        def read(far, load=load):
            at, ways = _along_circles(mesh, places, turns, far)
            xx, yy, xy = case.truth(SensorLayout.scattered(mesh, at))(load)
            c, s = ways.T
            return c * c * xx + 2 * c * s * xy + s * s * yy

        mean = sum(w * read(far) for w, far in zip(weights, steps, strict=True))
        influence.at(load.x, load.y, load.radius**2)

        scale = np.linalg.norm(mean)
        assert np.linalg.norm(out[0] / influence.unit - mean) < 0.02 * scale
        assert np.linalg.norm(read(0.0) - mean) > 0.1 * scale


# An ellipsoid, on two meshes of which none has the nodes of the other

AXES, ANGLE, H, D = (9e-3, 7e-3, 6e-3), radians(60), 1e-3, 3.7e-3


def _solid(rings, axes=AXES, angle=ANGLE, rigidity=D, held=pi):
    """Held where the turn of the rim is at most `held`."""
    places, triangles = disk(rings, (held, -held) if held < pi else ())
    corners = len(places)
    places, triangles = quadratic(places, triangles)
    rim = np.hypot(*places[:corners].T) > 1 - 1e-9
    far, turn = np.hypot(*places.T), np.arctan2(*places.T[::-1])
    ends = rim[triangles[:, :3]]
    on = np.concatenate([rim, np.zeros(len(places) - len(rim), bool)])
    on[triangles[:, 3:][ends & np.roll(ends, -1, axis=1)]] = True
    t = angle * np.where(on, 1.0, far)
    unit = np.column_stack([np.sin(t) * np.cos(turn), np.sin(t) * np.sin(turn), np.cos(t)])
    normals = unit / axes
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    on &= np.abs(turn) < held + 1e-9
    return SolidShell(unit * axes, normals, triangles, np.flatnonzero(on), rigidity, H)


@pytest.mark.full
def test_readings_on_an_ellipsoid_are_those_of_a_solid_shell():
    solid, mesh = _solid(24), MeshSkin(*ellipsoid(30, AXES, ANGLE), H)
    elements = np.arange(0, len(solid.triangles), len(solid.triangles) // 50)
    to_mesh = mesh.places[0] - mesh.nodes[0, :2]
    at = solid.places(elements)[:, :2] + to_mesh
    inside = mesh.depth(at) > 0.1 * mesh.a
    layout, out = SensorLayout.scattered(mesh, at[inside]), np.zeros((4, 3 * inside.sum()))
    influence = influence_of(Plate(mesh, D), layout, "clamped", 15, out)
    read, s = solid.reader(elements[inside]), (1.6e-3) ** 2

    for t, turn in ((0.05, 0.0), (0.3, 0.7), (0.5, 2.6)):
        c = np.array([np.sin(t) * np.cos(turn), np.sin(t) * np.sin(turn), np.cos(t)]) * AXES
        forces = solid.spread(lambda x, c=c: np.exp(-2 * np.sum((x - c) ** 2, -1) / s))
        true = read(forces / forces.sum()).ravel()
        influence.at(*(c[:2] + to_mesh).tolist(), s)
        # As wide and of a Gaussian's profile.
        ours = (out[0] + influence.profile(s)[0]) / influence.unit

        assert np.linalg.norm(ours - true) < 0.02 * np.linalg.norm(true)
        assert ours @ true == pytest.approx(true @ true, rel=0.01)


# The scene thumb-pad, an ellipsoid of which a third of the rim is held

PAD = load_scene("thumb-pad")
PAD_ANGLE = radians(75)
PAD_AXES = np.array([9e-3, 7e-3, 6e-3]) / [
    np.sin(PAD_ANGLE),
    np.sin(PAD_ANGLE),
    1 - np.cos(PAD_ANGLE),
]


class _HeldInPart:
    """An ellipsoid whose rim is held `half` a turn in rad to both sides of the axis x.

    Of elements in the middle of the truth's triangles, those nearest to the ones of a `layout`.
    """

    def __init__(self, plate, layout, axes, angle, half, force, rings=18):
        self.plate, self.axes, self.angle, self.force = plate, axes, angle, force
        mesh = plate.patch
        self.top = mesh.places[mesh.points[:, 2].argmax()]
        self.solid = _solid(rings, axes, angle, plate.rigidity, half)
        at = self.solid.places(np.arange(len(self.solid.triangles)))[:, :2] + self.top
        near = np.linalg.norm(at[:, None] - layout.positions, axis=2)
        elements = np.unique(near.argmin(axis=0))
        self.layout = SensorLayout.scattered(mesh, at[elements])
        self.read = self.solid.reader(elements)

    def forces(self, load):
        x, y = (np.array([load.x, load.y]) - self.top) / self.axes[:2]
        middle = np.array([x, y, sqrt(1 - x**2 - y**2)]) * self.axes
        forces = self.solid.spread(
            lambda at: np.exp(-np.sum((at - middle) ** 2, -1) / (2 * load.sd**2))
        )
        return load.force * forces / forces.sum()

    def load(self, share, sd=0.8e-3):
        t, turn = 0.85 * self.angle * sqrt(share[0]), 2 * pi * share[1]
        way = np.array([np.cos(turn), np.sin(turn)])
        return Load(*(self.top + np.sin(t) * way * self.axes[:2]), self.force, sd=sd)


@cache
def _held_in_part(name):
    if name == "thumb-pad":
        return _HeldInPart(PAD.plate, PAD.layout, PAD_AXES, PAD_ANGLE, pi / 3, 0.06)
    # Nothing was chosen by these.
    half, angle, axes = {"third": pi / 3, "half": pi / 2}[name], radians(60), np.full(3, R)
    nodes, triangles = ellipsoid(24, axes, angle)
    rim = MeshSkin(nodes, triangles, H).rim
    turn = np.arctan2(nodes[rim, 1], nodes[rim, 0])
    mesh = MeshSkin(nodes, triangles, H, held=rim[np.abs(turn) < half + 1e-6])
    return _HeldInPart(Plate(mesh), SensorLayout.spread(mesh, 60), axes, angle, half, 0.15)


@pytest.mark.full
def test_a_pad_held_along_a_third_of_its_rim_moves_and_bends_as_a_solid_shell():
    truth, mesh = _held_in_part("thumb-pad"), PAD.plate.patch
    layout, out = truth.layout, np.zeros((4, truth.layout.channels))
    influence = influence_of(PAD.plate, layout, "clamped", 15, out)
    basis = basis_for(mesh, "clamped", 15, 15)
    inside = np.tile(mesh.depth(layout.positions) > 0.1 * mesh.a, 3)
    places = truth.solid.points[:, :2] + truth.top
    on = mesh.contains(places)

    for share in ((0.01, 0.0), (0.3, 0.1), (0.6, 0.4), (0.3, 0.95), (0.3, 0.5)):
        load = truth.load(share)
        forces = truth.forces(load)
        true, w = truth.read(forces).ravel(), truth.solid.displacement(forces)[on]
        influence.at(load.x, load.y, 4 * load.sd**2)
        ours = load.force * (out[0] + influence.profile(4 * load.sd**2)[0]) / influence.unit
        c = PAD.plate.deflection([GaussianLoad(load.x, load.y, load.sd, load.force)], basis)
        moved = basis.at(places[on]) @ c.ravel()

        assert np.linalg.norm(moved - w) < 0.025 * np.linalg.norm(w)
        assert np.linalg.norm((ours - true)[inside]) < 0.05 * np.linalg.norm(true[inside])
        assert np.linalg.norm(ours - true) < 0.1 * np.linalg.norm(true)
        assert ours @ true == pytest.approx(true @ true, rel=0.03)


@dataclass(frozen=True, eq=False)
class HeldCase(Case):
    @property
    def layout(self):
        return _held_in_part(self.name).layout


@pytest.mark.full
@pytest.mark.parametrize("name", ["thumb-pad", "third", "half"])
def test_intervals_on_a_mesh_held_in_part_cover_the_truth(name):
    truth = _held_in_part(name)
    case = HeldCase(
        name,
        truth.plate,
        lambda layout: lambda load: truth.read(truth.forces(load)),
        truth.load,
        edge="clamped",
        low=0,
        high=1,
        noise=0.1 * sqrt(3),
        bound=False,
    )

    found = coverage(case, FEW)

    slack = 2 * sqrt(0.95 * 0.05 / FEW)
    assert found.found == 1
    assert abs(found.bias) < 0.02
    for share in (found.x, found.y, found.force):
        assert 0.92 - slack <= share <= 0.98 + slack


# A shallow dome, held all around

SIDE, RADIUS, THIN = 40e-3, 0.1, 0.4e-3


def _dome(count):
    """A mesh of the dome, of `count` nodes each way, even along its arcs."""
    line = np.linspace(-SIDE / 2, SIDE / 2, count)
    u, v = (each.ravel() for each in np.meshgrid(line, line))
    height = RADIUS * (np.cos(u / RADIUS) + np.cos(v / RADIUS))
    nodes = np.column_stack([RADIUS * np.sin(u / RADIUS), RADIUS * np.sin(v / RADIUS), height])
    corner = np.arange(count**2).reshape(count, count)
    below, above = corner[:-1], corner[1:]
    a, b, c, d = (
        each.ravel() for each in (below[:, :-1], below[:, 1:], above[:, 1:], above[:, :-1])
    )
    return MeshSkin(nodes, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]), THIN)


@pytest.mark.full
def test_a_shallow_dome_bends_as_in_closed_form():
    mesh, panel = _dome(61), Panel(SIDE, SIDE, RADIUS, RADIUS, thickness=THIN, inplane="held")
    wide, load = 3e-3, Load(0.42 * SIDE, 0.55 * SIDE, 1.0, radius=3e-3)
    away = wide * np.array([(-2, 0), (-1, 1), (1, 0.5), (2, 0), (0, -1.5), (0, 2)])
    places = np.array([load.x, load.y]) + away

    def seen(along):
        half = mesh.a / 2
        return half + RADIUS * np.sin((along - SIDE / 2) / RADIUS)

    layout, out = SensorLayout.scattered(mesh, seen(places)), np.zeros((4, 18))
    influence = influence_of(Plate(mesh), layout, "hinged", 15, out)
    influence.at(*seen(np.array([load.x, load.y])).tolist(), wide**2)
    curvature = panel.reader(places)(load).ravel()
    assert np.abs(out[0] / influence.unit - curvature).max() < 0.03 * np.abs(curvature).max()

    at = seen(np.array([load.x, load.y])).tolist()
    point = replace(load, radius=0.0)
    w = panel.displacement(point, np.array([[load.x, load.y]]))[2, 0]
    assert influence.gives(*at) == pytest.approx(w, rel=0.01)
