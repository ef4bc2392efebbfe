"""Caps of the library against a shell of revolution that shares nothing with it."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from kappaskin import Cap, Plate, SensorLayout, basis_for
from kappaskin.mechanics import DiscLoad
from navier import Load
from revolution import RevolvedShell, Spheroid
from studies import along_x

pytestmark = pytest.mark.truth

CAPS = {
    "fingertip, clamped": (Cap(8e-3), "clamped"),
    "fingertip, hinged": (Cap(8e-3), "hinged"),
    "shallow": (Cap(20e-3, 0.6), "clamped"),
    "long": (Cap(8e-3, stretch=1.4), "clamped"),
    "blunt": (Cap(8e-3, 1.2, 0.7), "hinged"),
}
each_cap = pytest.mark.parametrize("name", CAPS)
each_place = pytest.mark.parametrize("far", [0.0, 0.4, 0.7], ids=["pole", "middle", "near the rim"])
PLACES = np.random.default_rng(0).uniform((0.15, 0), (0.97, 2 * np.pi), (30, 2))


@cache
def known(name):
    """Displacement and readings (1 + 3, P) of the library and of the truth by a load."""
    cap, edge = CAPS[name]
    s, azimuth = PLACES.T * [[cap.rim_radius], [1.0]]
    positions = cap.rim_radius + np.stack([s * np.cos(azimuth), s * np.sin(azimuth)], -1)
    basis, plate = basis_for(cap, edge, 36, 75), Plate(cap)
    compliance = plate.compliance(basis)
    M = np.vstack(
        [basis.at(positions), SensorLayout.scattered(cap, positions).operator(basis, plate)]
    )
    shell = RevolvedShell(Spheroid(cap.radius, cap.stretch * cap.radius), cap.rim_radius, edge=edge)
    moved, read = shell.mover(np.stack([s, azimuth], -1)), shell.reader(np.stack([s, azimuth], -1))

    def ours(load):
        x, y = cap.rim_radius + np.array([load.x, load.y])
        modal = DiscLoad(x, y, load.radius, load.force).modal(basis)
        return (M @ compliance(modal).ravel()).reshape(4, -1)

    return ours, lambda load: np.vstack([moved(load)[None], along_x(read(load), azimuth)])


@pytest.mark.cases(
    "0.001-pole-fingertip, clamped",
    "0.001-middle-long",
    "0.002-middle-fingertip, clamped",
    "0.002-near the rim-long",
)
@each_cap
@each_place
@pytest.mark.parametrize("radius", [1e-3, 2e-3])
def test_a_cap_bends_under_a_disc_as_a_shell_of_revolution_does(name, far, radius):
    ours, truth = known(name)
    away = far * CAPS[name][0].rim_radius
    load = Load(away * np.cos(0.7), away * np.sin(0.7), 1.0, radius=radius)

    (w, *read), (w_true, *read_true) = ours(load), truth(load)

    assert np.abs(w - w_true).max() < 0.01 * np.abs(w_true).max()
    # Of an element under the load so many functions follow the curvature to some percent.
    error, true = np.linalg.norm(np.array(read) - read_true), np.linalg.norm(read_true)
    assert error < 0.04 * true


def _gages(places, turns, R, length):
    """Places (P, Q, 2) along arcs of great circles, and their angle from the meridian there."""
    at, share = np.polynomial.legendre.leggauss(5)
    s, azimuth = places.T[..., None]
    t, far = s / R, length / 2 * at / R
    way = turns - azimuth  # from the meridian
    out = np.stack([np.sin(t) * np.cos(azimuth), np.sin(t) * np.sin(azimuth), np.cos(t)], -1)
    along = np.stack([np.cos(t) * np.cos(azimuth), np.cos(t) * np.sin(azimuth), -np.sin(t)], -1)
    around = np.stack([-np.sin(azimuth), np.cos(azimuth), 0 * t], -1)
    ahead = np.cos(way)[..., None] * along + np.sin(way)[..., None] * around
    point = np.cos(far)[:, None] * out + np.sin(far)[:, None] * ahead
    onward = np.cos(far)[:, None] * ahead - np.sin(far)[:, None] * out
    x, y, z = np.moveaxis(point, -1, 0)
    there, up = np.arctan2(y, x), np.arccos(z)
    meridian = np.stack([np.cos(up) * np.cos(there), np.cos(up) * np.sin(there), -np.sin(up)], -1)
    parallel = np.stack([-np.sin(there), np.cos(there), 0 * up], -1)
    ways = np.arctan2(np.vecdot(onward, parallel), np.vecdot(onward, meridian))
    return np.stack([R * up, there], -1), ways, share / 2


@pytest.mark.full
def test_a_gage_reads_the_mean_along_the_skin():
    cap, edge, length, R = Cap(8e-3), "clamped", 2e-3, 8e-3
    places = np.array([[0.35, 0.3], [0.6, 2.0], [0.8, 4.4]]) * [cap.rim_radius, 1.0]
    s, azimuth = places.T
    positions = cap.rim_radius + s[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    basis, plate = basis_for(cap, edge, 36, 75), Plate(cap)
    layout = SensorLayout.scattered(cap, positions)
    x, y = 0.45 * cap.rim_radius * np.array([np.cos(0.7), np.sin(0.7)])
    load, of = Load(x, y, 1.0, radius=2e-3), partial(replace, layout)
    modal = DiscLoad(cap.rim_radius + x, cap.rim_radius + y, 2e-3, 1.0).modal(basis)
    c = plate.compliance(basis)(modal).ravel()
    read, at_a_point = (of(gage_length=L).operator(basis, plate) @ c for L in (length, 0.0))

    shell = RevolvedShell(Spheroid(R, R), cap.rim_radius, edge=edge)
    means = []
    for turn in (0.0, np.pi / 2, np.pi / 4, -np.pi / 4):
        along, ways, share = _gages(places, turn, R, length)
        ss, tt, st = shell.reader(along.reshape(-1, 2))(load).reshape(3, *ways.shape)
        c, z = np.cos(ways), np.sin(ways)
        means.append((c * c * ss + z * z * tt + 2 * c * z * st) @ share)
    xx, yy, rising, falling = means
    true = np.concatenate([xx, yy, (rising - falling) / 2])
    assert np.linalg.norm(read - true) < 0.02 * np.linalg.norm(true)
    assert np.linalg.norm(at_a_point - true) > 0.2 * np.linalg.norm(true)
