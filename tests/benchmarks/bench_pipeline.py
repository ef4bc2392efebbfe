"""Counts to coefficients to surface, against lstsq per frame and direct summation."""

import time

import numpy as np

from kappaskin import Pipeline, Setup, Simulator, load_scene


def test_a_frame_is_fifty_times_faster_than_lstsq_and_summation(medians, figure) -> None:
    scene = load_scene("centre")
    frame = Simulator(scene).frame(0, time.monotonic)
    pipeline = Pipeline(scene.sensor(), Setup())
    surface_of = pipeline.basis.on_grid(*scene.plate.patch.grid(65, 65))
    M = scene.layout.curvature_operator(pipeline.basis)
    x, y = scene.plate.patch.grid(65, 65)
    a, b = scene.plate.patch.a, scene.plate.patch.b

    def ours() -> np.ndarray:
        return surface_of(pipeline.fit(pipeline.curvature(frame)).coefficients)

    def baseline() -> np.ndarray:
        curvature = scene.transduction.curvature(frame.counts)
        c = np.linalg.lstsq(M, curvature)[0].reshape(8, 8)
        w = np.zeros((65, 65))
        for i in range(8):
            for j in range(8):
                w += c[i, j] * np.outer(
                    np.sin((j + 1) * np.pi * y / b), np.sin((i + 1) * np.pi * x / a)
                )
        return w

    assert np.allclose(ours(), baseline())
    fast, slow, whole = medians(ours, baseline, lambda: pipeline(frame))
    figure(
        f"counts to 65 x 65 surface: {fast * 1e6:.1f} us, {slow / fast:.0f} times faster than "
        f"lstsq and summation ({slow * 1e6:.0f} us); whole estimate with contact and truth "
        f"{whole * 1e6:.0f} us"
    )
    assert slow / fast >= 50
    assert fast < 60e-6
