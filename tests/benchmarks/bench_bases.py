"""Modes of disks and polygons, against sine products: made once, and used in every frame."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import (
    Disk,
    LeastSquares,
    Patch,
    Pipeline,
    Plate,
    PointLoad,
    Polygon,
    SensorLayout,
    Setup,
    Simulator,
    basis_for,
    load_scene,
)
from kappaskin.bases.argyris import plate_modes
from kappaskin.bases.mesh import mesh_functions
from kappaskin.bases.modes import _disk_modes as disk_modes
from kappaskin.contact.influence import influence_of
from kappaskin.sensing import DigitalReadings, Sensor
from kappaskin.skin import MeshSkin
from meshes import ellipsoid

WIDE, TALL = np.array([0, 0.5, 1.5, 2, 1.5, 0.5]), np.array([1, 0, 0, 1, 2, 2]) * math.sqrt(3) / 2
SKINS = {
    "disk": Disk(0.05),
    "hexagon": Polygon(0.05 * np.column_stack([WIDE, TALL])),
    "L": Polygon(0.05 * np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])),
}
SCENE = load_scene("centre")


def estimator(patch, edge="hinged"):
    """The map from curvature to a surface of 65 x 65 points, by 8 x 8 functions."""
    basis = basis_for(patch, edge, 8, 8)
    fit = LeastSquares(basis, SensorLayout.regular(patch, 10, 10))
    surface = basis.on_grid(*patch.grid(65, 65))
    return fit, lambda curvature: surface(fit(curvature).coefficients)


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
@pytest.mark.parametrize("name", SKINS)
def test_64_modes_are_ready_within_2_seconds(name, edge, figure, ratio) -> None:
    taken = list[float]()
    for _ in range(5):
        plate_modes.cache_clear()
        disk_modes.cache_clear()
        start = time.perf_counter()
        estimator(SKINS[name], edge)
        taken.append(time.perf_counter() - start)

    figure(
        f"64 functions of a {edge} {name}, with the fit and the surface: made in "
        f"{min(taken) * 1e3:.0f} ms"
    )
    ratio(f"64 functions of a {edge} {name}, of the 2 s allowed", min(taken) / 2, at_most=1)


def estimate(patch, layout):
    """A frame of a touched skin to its estimate, as a device without a truth has it."""
    scene = replace(SCENE, plate=Plate(patch), layout=layout, stimuli=())
    scene = scene.touched_by(PointLoad(0.03, 0.04, 0.3))
    pipeline = Pipeline(scene.sensor(), Setup())
    frame = replace(Simulator(scene).frame(0, time.monotonic), truth=None)
    assert pipeline(frame).contact.force > 0.2
    return lambda: pipeline(frame)


@pytest.mark.parametrize("name", SKINS)
def test_a_frame_costs_what_it_costs_with_sine_products(name, medians, figure, ratio) -> None:
    rng, surfaces, estimates = np.random.default_rng(0), [], []
    for patch in (Patch(0.1, 0.1), SKINS[name]):
        fit, surface_of = estimator(patch)
        curvature = rng.normal(size=(3, len(fit.layout)))
        surfaces.append(lambda of=surface_of, K=curvature: of(K))
        estimates.append(estimate(patch, fit.layout))

    sines, modes = medians(*surfaces, calls=50)
    all_of_sines, all_of_modes = medians(*estimates)

    figure(
        f"curvature to 65 x 65 surface on a {name}: {modes * 1e6:.0f} us, {modes / sines:.1f} "
        f"times that of sine products ({sines * 1e6:.0f} us); whole estimate with contact "
        f"{all_of_modes * 1e6:.0f} us, {all_of_modes / all_of_sines:.1f} times"
    )
    ratio(f"surface of a {name}, against sine products", modes / sines, at_most=3)
    ratio(f"estimate of a {name}, against sine products", all_of_modes / all_of_sines, at_most=1.3)


def mesh_of(triangles: int) -> MeshSkin:
    """An ellipsoidal finger pad of about so many triangles."""
    rings = round(math.sqrt(triangles / 6))
    return MeshSkin(*ellipsoid(rings, (9e-3, 7e-3, 6e-3), math.radians(70)), 1e-3)


def pipeline_on(patch, layout):
    plate = Plate.of_material(patch, 1e6, 0.3, 1e-3)
    if isinstance(patch, Patch) and not any(patch.curvatures):
        plate = replace(plate, thickness=None)
    of_device = plate, "hinged", 100.0, "bench", "1", "1", True
    return Pipeline(Sensor(layout, DigitalReadings(), *of_device), Setup(Ni=10, Nj=10))


@pytest.mark.parametrize("triangles", [2_000, 20_000])
def test_a_mesh_is_set_up_and_followed_as_a_flat_skin(
    triangles, medians, figure, ratio, tmp_path, monkeypatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    mesh, taken = mesh_of(triangles), list[float]()
    for _ in range(2):
        mesh_functions.cache_clear()
        start = time.process_time()
        on_mesh = pipeline_on(mesh, SensorLayout.spread(mesh, 120))
        taken.append(time.process_time() - start)
    flat = Patch(0.02, 0.02)
    on_flat = pipeline_on(flat, SensorLayout.regular(flat, 12, 10))
    rng, calls = np.random.default_rng(0), []
    for pipeline in (on_flat, on_mesh):
        sensor, patch = pipeline.sensor, pipeline.sensor.layout.patch
        out = np.zeros((4, 360))
        influence = influence_of(sensor.plate, sensor.layout, "hinged", 15, out)
        influence.at(0.55 * patch.a, 0.45 * patch.b, 1e-6)
        read = 0.1 / influence.unit * out[0].reshape(3, -1)
        read = read + rng.normal(0, 0.003 * np.abs(read).max(), read.shape)
        assert pipeline.again(read).contact.single
        calls.append(lambda pipeline=pipeline, read=read: pipeline.again(read))
    a_flat, a_mesh = medians(*calls)
    of = f"a mesh of {len(mesh.triangles)} triangles with 120 elements"
    figure(f"{of}: set up in {taken[0]:.1f} s of processor time, again in {taken[1]:.1f} s")
    ratio(f"{of}, set up, of the 30 s allowed", taken[0] / 30, at_most=1)
    ratio(f"a frame on {of}, over a flat skin of as many", a_mesh / a_flat, at_most=1.5)
