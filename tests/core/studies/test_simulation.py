"""Simulated readings in a file are reconstructed to what the live pipeline finds."""

from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Cap, Disk, Patch, Plate, PointLoad, Refusal, Scene, SensorLayout, Simulator
from kappaskin.pipeline import Pipeline, Setup, reconstruct
from kappaskin.skin import Polygon
from kappaskin.studies import simulated_readings

_SKINS = {
    "disk": (Plate(Disk(0.05)), "clamped"),
    "polygon": (Plate(Polygon([[0, 0], [0.1, 0], [0.1, 0.06], [0.04, 0.1]])), "hinged"),
    "cap": (Plate(Cap(0.05, 1.2, 1.5), 1e-3, thickness=1e-3), "hinged"),
    "held dome": (Plate(Patch(0.1, 0.08, (0.5, 0.4)), inplane="held"), "hinged"),
    "arc": (Plate(Patch(0.1, 0.08, 0.2), axial_stiffness=3e4, poisson=0.4), "hinged"),
    "sheet": (Plate(Patch(0.1, 0.08), thickness=0.5e-3), "hinged"),
}


@pytest.mark.parametrize(
    "name",
    [name if name == "sheet" else pytest.param(name, marks=pytest.mark.full) for name in _SKINS],
)
def test_a_simulated_file_is_reconstructed_to_what_is_found_live(name, tmp_path) -> None:
    plate, edge = _SKINS[name]
    patch = plate.patch
    layout = SensorLayout.regular(patch, 9, 9)
    load = PointLoad(0.45 * patch.a, 0.55 * patch.b, 0.05)
    scene = Scene("", plate, layout, edge=edge).touched_by(load)
    np.savez(tmp_path / "in.npz", **simulated_readings(scene, 1))

    live = Pipeline(scene.sensor(), Setup(Ni=6, Nj=6))(Simulator(scene).frame(0, lambda: 0.0))
    found = reconstruct(tmp_path / "in.npz", (6, 6), edge=edge, contact=True)

    # They differ by the rounding of the live counts.
    c = live.coefficients
    np.testing.assert_allclose(found["coefficients"][0], c, rtol=0, atol=1e-3 * np.abs(c).max())
    assert found["contact"][0] == pytest.approx(live.contact.position, abs=1e-3 * patch.a)
    assert found["force"][0] == pytest.approx(live.contact.force, rel=0.01)
    assert found["force_sd"][0] == pytest.approx(live.contact.force_sd, rel=0.05)


@pytest.mark.parametrize(
    "patch",
    [Patch(0.1, 0.08), pytest.param(Cap(0.05, 1.0), marks=pytest.mark.full)],
    ids=["flat", "cap"],
)
def test_the_gages_of_a_simulated_file_are_as_long_when_reconstructed(patch, tmp_path) -> None:
    layout = SensorLayout.regular(patch, 7, 7)
    inside = layout.positions[patch.depth(layout.positions) > 0.006]
    layout = replace(SensorLayout.scattered(patch, inside), gage_length=0.012)
    scene = Scene("", Plate(patch), layout, edge="clamped")
    scene = scene.touched_by(PointLoad(0.45 * patch.a, 0.55 * patch.b, 0.05))
    readings = simulated_readings(scene, 1)
    for name, values in (("in", readings), ("short", readings | {"gage_length": np.array(0.0)})):
        np.savez(tmp_path / f"{name}.npz", **values)

    live = Pipeline(scene.sensor(), Setup(Ni=4, Nj=4))(Simulator(scene).frame(0, lambda: 0.0))
    found, short = (
        reconstruct(tmp_path / f"{name}.npz", (4, 4), edge="clamped")["coefficients"][0]
        for name in ("in", "short")
    )

    c = live.coefficients
    np.testing.assert_allclose(found, c, rtol=0, atol=1e-3 * np.abs(c).max())
    assert np.abs(short - c).max() > 0.01 * np.abs(c).max()


@pytest.mark.parametrize(("name", "values"), [("gage_length", [0.01, 0.01]), ("cell", 0.01)])
def test_the_wrong_number_of_sides_is_refused(name, values, tmp_path) -> None:
    readings = {"size": [0.1, 0.1], "positions": [[0.05, 0.05]], "curvature": np.zeros((3, 1))}
    np.savez(tmp_path / "in.npz", **readings, **{name: values})
    with pytest.raises(Refusal, match=f"expected {name} to be (one|two) numbers? in m"):
        reconstruct(tmp_path / "in.npz", (1, 1))


def test_a_simulated_disk_is_reconstructed_from_its_outline(tmp_path) -> None:
    disk = Disk(0.05)
    scene = Scene("", Plate(disk), SensorLayout.regular(disk, 9, 9), edge="clamped")
    scene = scene.touched_by(PointLoad(0.045, 0.055, 0.05))
    np.savez(tmp_path / "in.npz", **simulated_readings(scene, 1))

    found = reconstruct(tmp_path / "in.npz", (4, 4), (11, 11), edge="clamped")

    assert np.isnan(found["w"][0, 0, 0])  # off the disk
    assert found["w"][0, 5, 4] > 0.8 * np.nanmax(found["w"])
