"""Caps of the library against a shell of revolution that shares nothing with it."""

from functools import cache

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
