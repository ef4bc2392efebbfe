"""Contacts on meshes of caps: against the theory of shells of revolution, which has no elements."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CloughTocher2DInterpolator

from kappaskin.contact.influence import influence_of
from kappaskin.errors import Refusal
from kappaskin.mechanics import Plate
from kappaskin.pipeline import Pipeline, Setup
from kappaskin.sensing import DigitalReadings, Sensor, SensorLayout
from kappaskin.skin import Cap, MeshSkin
from meshes import ellipsoid

R, H = 8e-3, 1e-3
ELEMENTS = 60


class Both:
    """A mesh and the cap that it follows, with elements at the same places."""

    def __init__(self, edge, degrees):
        angle, self.edge = math.radians(degrees), edge
        self.cap, self.mesh = Cap(R, angle), MeshSkin(*ellipsoid(24, (R, R, R), angle), H)
        x, y, z = self.mesh.nodes.T
        far = np.arctan2(np.hypot(x, y), z) * R / np.maximum(np.hypot(x, y), 1e-9)
        on_cap = self.cap.rim_radius + np.column_stack([x, y]) * far[:, None]
        self._places = CloughTocher2DInterpolator(on_cap, self.mesh.places)
        on_cap = SensorLayout.in_spiral(self.cap, ELEMENTS)
        layout = SensorLayout.scattered(self.mesh, self.on_mesh(on_cap.positions))
        self.layout, self.plates = layout, [Plate.of_material(p, 1e6, 0.3, H) for p in self.patches]
        # The frames of the two are turned about the normal.
        frames = [self.mesh.base(*layout.positions.T), self.cap.base(*on_cap.positions.T)]
        self._turn = np.einsum("pak,pbk->pab", *(base.frame for base in frames))
        self.rows = [np.zeros((4, 3 * ELEMENTS)) for _ in range(2)]
        layouts = layout, on_cap
        self.influences = [
            influence_of(plate, one, edge, 15, out)
            for plate, one, out in zip(self.plates, layouts, self.rows, strict=True)
        ]

    @property
    def patches(self):
        return self.mesh, self.cap

    def on_mesh(self, places):
        """Where places (P, 2) of the cap are on the mesh."""
        return self._places(places)

    def turned(self, read):
        xx, yy, xy = read.reshape(3, -1)
        K = np.moveaxis(np.array([[xx, xy], [xy, yy]]), 2, 0)
        K = self._turn @ K @ np.swapaxes(self._turn, 1, 2)
        return np.concatenate([K[:, 0, 0], K[:, 1, 1], K[:, 0, 1]])

    def under(self, place, radius):
        """Readings (2, C) under a disc, 1 N over the unit: of the mesh, and of the cap."""
        (x, y), (u, v) = self.on_mesh(np.array([place]))[0].tolist(), place
        self.influences[0].at(x, y, radius**2)
        self.influences[1].at(u, v, radius**2)
        return self.rows[0][0].copy(), self.turned(self.rows[1][0])


# That of 85 degrees is flattened, the others are projected.
@pytest.fixture(scope="module", params=[("hinged", 60), ("clamped", 60), ("clamped", 85)])
def both(request):
    return Both(*request.param)


# Smaller loads the cap's own table does not follow; larger ones are spread otherwise on its waves.
@pytest.mark.parametrize("triangles", [2.5, 5.0])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.6])
def test_readings_are_those_of_the_shell(both, triangles, share):
    pole, mesh = both.cap.rim_radius, both.mesh
    radius = triangles * math.sqrt(mesh.areas.sum() / len(mesh.points))
    mesh, cap = both.under([pole * (1 + share), pole * (1 - share / 3)], radius)

    assert np.abs(mesh - cap).max() < 0.035 * np.abs(cap).max()
    assert mesh @ cap == pytest.approx(cap @ cap, rel=0.02)


def test_the_derivatives_are_those_of_the_readings(both):
    x, y, s = both.mesh.a * 0.6, both.mesh.b * 0.45, 1e-6
    influence, out = both.influences[0], both.rows[0]

    def read(x, y, s):
        influence.at(x, y, s)
        return out[0].copy()

    d = 1e-7
    differences = [
        (read(x + d, y, s) - read(x - d, y, s)) / (2 * d),
        (read(x, y + d, s) - read(x, y - d, s)) / (2 * d),
        (read(x, y, s * 1.001) - read(x, y, s * 0.999)) / (2e-3 * s),
    ]
    influence.at(x, y, s)
    for found, expected in zip(out[1:], differences, strict=True):
        assert np.allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def test_contacts_are_where_and_as_hard_as_they_are(both):
    sensor = Sensor(
        *(both.layout, DigitalReadings(), both.plates[0], both.edge, 100.0, "mesh", "1", "1", True)
    )
    pipeline = Pipeline(sensor, Setup(Ni=8, Nj=8))
    draws, off, pole = np.random.default_rng(3), [], both.cap.rim_radius
    for _ in range(60):
        turn, far = draws.uniform(0, 2 * np.pi), 0.7 * pole * math.sqrt(draws.uniform())
        place = [pole + far * math.cos(turn), pole + far * math.sin(turn)]
        read = both.under(place, 1e-3)[1] * 0.1 / both.influences[1].unit
        read = read.reshape(3, -1) + draws.normal(0, 0.3, (3, ELEMENTS))
        contact = pipeline.again(read).contact
        true = both.on_mesh(np.array([place]))[0]
        off.append([*(contact.position - true) / contact.position_sd, contact.force / 0.1 - 1])
    off = np.array(off)

    assert np.abs(off[:, 2].mean()) < 0.012
    assert np.mean(np.abs(off[:, :2]) < 1.96) > 0.88


def test_a_skin_too_thin_for_its_triangles_is_refused():
    mesh = MeshSkin(*ellipsoid(24, (R, R, R), math.radians(60)), 2e-5)
    layout = SensorLayout.spread(mesh, 20)
    plate = Plate.of_material(mesh, 1e6, 0.3, 2e-5)
    with pytest.raises(Refusal, match="too thin for its radii"):
        influence_of(plate, layout, "hinged", 15, np.zeros((4, 60)))


def test_heights_on_a_mesh_are_followed_by_as_many_functions_as_it_has_nodes_for():
    mesh = MeshSkin(*ellipsoid(16, (R, R, R), math.radians(60)), H)
    plate, out = Plate.of_material(mesh, 1e6, 0.3, H), np.zeros((4, 20))
    layout = SensorLayout.spread(mesh, 20).reading_each(["height"])

    influence = influence_of(plate, layout, "clamped", 15, out)
    x, y = layout.positions[3].tolist()
    influence.at(x, y, 1e-6)

    assert out[0].argmax() == 3
    assert out[0, 3] == pytest.approx(influence.gives(x, y) * influence.unit, rel=0.3)


def test_readings_along_gages_are_those_of_gages_along_x_and_y():
    mesh = MeshSkin(*ellipsoid(16, (R, R, R), math.radians(60)), H)
    plate = Plate.of_material(mesh, 1e6, 0.3, H)
    inside = np.linalg.norm(mesh.places - mesh.places[0], axis=1) < 0.6 * R
    plain = SensorLayout.scattered(mesh, mesh.places[inside][::12])
    plain = replace(plain, gage_length=1e-3)
    named = plain.reading_each(["twist", "curvature@0", "curvature@90"])
    found = []
    for layout in (plain, named):
        out = np.zeros((4, layout.channels))
        influence_of(plate, layout, "clamped", 15, out).at(mesh.a * 0.6, mesh.b * 0.45, 1e-6)
        found.append(layout.by_kind(out))
    xx, yy, xy = np.moveaxis(found[0].reshape(4, 3, -1), 1, 0)
    by_name = dict(zip(named.kind_names, np.moveaxis(found[1], 1, 0), strict=True))

    for name, expected in {"curvature@0": xx, "curvature@90": yy, "twist": xy}.items():
        assert np.allclose(
            by_name[name], expected, atol=2e-4 * np.abs(expected).max(axis=-1)[:, None]
        )
