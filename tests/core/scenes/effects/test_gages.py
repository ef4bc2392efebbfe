"""What gages sense: the mean over their length, on the slope where they lie, on a held skin."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from deflected import DeflectedSkin, sines
from kappaskin import (
    Cap,
    Disk,
    Fast,
    LeastSquares,
    Patch,
    Plate,
    PointLoad,
    Polygon,
    Refusal,
    Sensor,
    SensorLayout,
    SineBasis,
    SourceError,
    Transduction,
    basis_for,
)
from kappaskin.bases import curvature_at
from kappaskin.scenes.effects import (
    FiniteSlopeEffect,
    Fluid,
    Foam,
    GageLength,
    StretchingEffect,
    Tension,
)
from kappaskin.sources import sensor_from_json, sensor_to_json

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
EIGHT = SineBasis(SQUARE, 8, 8)
DIAGONAL = np.array([1.0, 1.0]) / math.sqrt(2)
LINES = {"x": (1.0, 0.0), "y": (0.0, 1.0), "up": DIAGONAL, "down": DIAGONAL * (1, -1)}


def long_gages(held_skin, share=0.8):
    """Elements on a skin whose gages are a `share` as long as they could be."""
    patch = held_skin.patch
    layout = SensorLayout.regular(patch, 4, 1 if patch.strip else 4)
    return replace(layout, gage_length=2 * share * float(patch.depth(layout.positions).min()))


def live(layout, operator):
    return operator.reshape(*layout.live.shape, -1)[layout.live]


def twist_of(means):
    return np.stack([means["x"], means["y"], (means["up"] - means["down"]) / 2])


@pytest.mark.where(which=lambda held: not isinstance(held.patch, Polygon | Cap))
def test_a_gage_reads_the_mean_of_many_short_ones(held_skin):
    basis, layout = held_skin.basis(), long_gages(held_skin)
    steps = (np.arange(400) + 0.5) / 400 - 0.5

    def mean(direction):
        x, y = direction
        places = (
            layout.positions + np.multiply.outer(steps * layout.gage_length, direction)[:, None]
        )
        xx, yy, xy = curvature_at(basis, places.reshape(-1, 2))
        normal = x * x * xx + y * y * yy + 2 * x * y * xy
        return normal.reshape(400, len(layout), -1).mean(axis=0)

    expected = twist_of({name: mean(direction) for name, direction in LINES.items()})
    M = live(layout, layout.operator(basis))
    scale = np.abs(M).max()
    np.testing.assert_allclose(M, live(layout, expected), rtol=0, atol=1e-4 * scale)
    short = live(layout, replace(layout, gage_length=0.0).operator(basis))
    assert np.abs(M - short).max() > 0.03 * scale


# Their modes' curvature jumps from triangle to triangle: enough short gages even it out.
@pytest.mark.where(which=lambda held: isinstance(held.patch, Polygon))
def test_a_gage_on_a_polygon_reads_the_mean_of_very_many_short_ones(held_skin):
    basis, layout = held_skin.basis(), long_gages(held_skin)
    xx = curvature_mean_along_x(basis, layout)
    M = layout.operator(basis).reshape(3, len(layout), -1)[0]
    np.testing.assert_allclose(M, xx, rtol=0, atol=5e-4 * np.abs(M).max())


def curvature_mean_along_x(basis, layout, count=2000):
    steps = ((np.arange(count) + 0.5) / count - 0.5) * layout.gage_length
    places = layout.positions + np.multiply.outer(steps, (1.0, 0.0))[:, None]
    every = basis.at(places.reshape(-1, 2), 2, 0)
    return every.reshape(count, len(layout), -1).mean(axis=0)


def test_sines_are_read_by_one_multiplier_per_mode_and_channel():
    L, k = 8e-3, np.pi / 0.1
    point = TENS.operator(EIGHT).reshape(3, 100, 8, 8)

    M = replace(TENS, gage_length=L).operator(EIGHT).reshape(3, 100, 8, 8)

    i, j = np.meshgrid(np.arange(1, 9), np.arange(1, 9), indexing="ij")
    kx, ky, h = i * k, j * k, L / math.sqrt(8)
    # The two diagonals: waves of k + l and k - l, each averaged by its own sinc.
    long, short = ((n * k) ** 2 * np.sinc(n * k * h / np.pi) for n in (i + j, i - j))
    expected = np.sin(kx * L / 2) / (kx * L / 2), np.sin(ky * L / 2) / (ky * L / 2)
    for read, pointlike, share in zip(
        M, point, (*expected, (long - short) / 4 / kx / ky), strict=True
    ):
        np.testing.assert_allclose(read, pointlike * share, rtol=0, atol=1e-9)
        assert 0.5 < share.min() < 0.95


@pytest.mark.where(which=lambda held: held.name in ("flat", "arc", "disk"))
def test_short_gages_tend_to_points_with_the_square_of_their_length(held_skin):
    basis, layout = held_skin.basis(), long_gages(held_skin, 0.2)
    point = replace(layout, gage_length=0.0).operator(basis)

    lengths = layout.gage_length / np.array([1, 2, 4])
    off = [
        np.abs(live(layout, replace(layout, gage_length=L).operator(basis) - point)).max()
        for L in lengths
    ]

    assert np.log2(np.array(off[:-1]) / off[1:]) == pytest.approx([2.0, 2.0], abs=0.06)


@pytest.mark.where(which=lambda held: not isinstance(held.patch, Cap))  # whose gages are short
def test_gages_may_end_on_the_rim_and_not_beyond(held_skin):
    layout = long_gages(held_skin, 1.0)
    with pytest.raises(
        Refusal, match=r"over the rim of the .*: element \d+ is .* m inside; .*at most"
    ):
        replace(layout, gage_length=layout.gage_length * 1.001)


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_gages_that_reach_over_a_round_rim_by_rounding_alone_read_numbers(edge):
    disk = Disk(0.05)
    layout = SensorLayout.regular(disk, 10, 10)  # whose outermost lie on the diagonals
    longest = 2 * float(disk.depth(layout.positions).min())

    typed = replace(layout, gage_length=float(f"{longest:.10g}"))

    assert typed.gage_length > longest
    assert np.isfinite(typed.operator(basis_for(disk, edge, 4, 4))).all()


@pytest.mark.parametrize("patch", [SQUARE, Patch(0.1, 0.07), Disk(0.05), Disk(0.03)])
def test_gages_of_the_length_that_a_refusal_asks_for_are_taken(patch):
    for m in range(3, 14):
        layout = SensorLayout.regular(patch, m, m)
        with pytest.raises(Refusal) as refused:
            replace(layout, gage_length=0.1)
        said = re.search(r"at most ([\d.e-]+) m", str(refused.value))
        longest = 2 * float(patch.depth(layout.positions).min())

        assert said is not None
        assert replace(layout, gage_length=float(said[1])).gage_length > 0.998 * longest


def test_ten_by_ten_gages_may_be_as_long_as_they_are_apart():
    assert replace(TENS, gage_length=0.01).gage_length == 0.01


@pytest.mark.parametrize("length", [-1e-3, 1e-9, math.nan, math.inf])
def test_a_gage_length_that_is_none_is_refused(length):
    with pytest.raises(Refusal, match=f"gage length of 0 m, or 1e-06 m and more, got {length}"):
        replace(TENS, gage_length=length)


def test_the_effect_makes_the_layout():
    assert GageLength(6e-3).of(TENS).gage_length == 6e-3
    assert GageLength(6e-3).of(TENS).without([3]).gage_length == 6e-3
    with pytest.raises(Refusal, match="over the rim"):
        GageLength(11e-3).of(TENS)


# The fit knows what its elements average.

TRUTH = np.random.default_rng(0).normal(size=(8, 8)) / EIGHT.laplacian


@pytest.mark.parametrize("method", [LeastSquares, Fast])
@pytest.mark.parametrize("dead", [(), (3, 44, 71)])
def test_a_fit_gives_back_the_shape_that_long_gages_read(method, dead):
    layout = GageLength(9e-3).of(TENS).without(dead)
    K = (layout.operator(EIGHT) @ TRUTH.ravel()).reshape(3, -1)

    answer = method(EIGHT, layout)(K)

    np.testing.assert_allclose(answer.coefficients, TRUTH, atol=1e-10 * np.abs(TRUTH).max())
    assert answer.noise < 1e-9
    unaware = method(EIGHT, TENS.without(dead))(K)
    assert np.abs(unaware.coefficients - TRUTH).max() > 0.01 * np.abs(TRUTH).max()


def test_fast_transforms_and_the_matrix_agree_on_error_bars_of_long_gages():
    layout = GageLength(9e-3).of(TENS).without([5])
    K = np.random.default_rng(1).normal(size=(3, 100))

    fast, dense = (method(EIGHT, layout)(K) for method in (Fast, LeastSquares))

    np.testing.assert_allclose(fast.coefficients, dense.coefficients, rtol=1e-9, atol=1e-16)
    np.testing.assert_allclose(fast.sd, dense.sd, rtol=1e-9)
    np.testing.assert_allclose(fast.residual, dense.residual, atol=1e-11)


def sensor(layout):
    return Sensor(
        layout, Transduction(), Plate(SQUARE), "hinged", 10.0, "skin", "A", "1", simulated=True
    )


def test_the_gage_length_travels_with_what_a_device_says():
    said = json.loads(sensor_to_json(sensor(GageLength(6.1e-3).of(TENS))))
    assert sensor_from_json(json.dumps(said)).layout.gage_length == 6.1e-3

    del said["gage_length"]
    assert sensor_from_json(json.dumps(said)).layout.gage_length == 0


@pytest.mark.parametrize("length", [-1e-3, 0.02, "6 mm", None, True, [0.006]])
def test_a_gage_length_that_cannot_be_is_refused_of_a_device(length):
    said = json.loads(sensor_to_json(sensor(TENS)))
    with pytest.raises(SourceError, match=r"gage.length|rim"):
        sensor_from_json(json.dumps({**said, "gage_length": length}))


# Slopes


def test_on_a_slope_the_true_normal_curvature_is_sensed():
    c = np.zeros((8, 8))
    c[0, 0], c[1, 2] = 8e-3, 2e-3
    f = {
        order: EIGHT.at(TENS.positions, *order) @ c.ravel()
        for order in ((1, 0), (0, 1), (2, 0), (0, 2), (1, 1))
    }
    fx, fy = f[1, 0], f[0, 1]
    W = np.sqrt(1 + fx**2 + fy**2)

    xx, yy, xy = FiniteSlopeEffect().sensed(EIGHT, TENS)(c).reshape(3, -1)

    np.testing.assert_allclose(xx, f[2, 0] / (W * (1 + fx**2)), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(yy, f[0, 2] / (W * (1 + fy**2)), rtol=1e-12, atol=1e-12)
    twist = f[1, 1] / (W * np.sqrt((1 + fx**2) * (1 + fy**2)))
    np.testing.assert_allclose(xy, twist, rtol=1e-12, atol=1e-12)


def test_on_a_bent_skin_it_is_the_surface_in_space_that_is_sensed():
    patch = Patch(0.04, 0.03, 12.9e-3)
    basis, layout = SineBasis(patch, 4, 4), SensorLayout.regular(patch, 8, 8)
    c = np.zeros((4, 4))
    c[1], c[3, 0] = [3e-3, -1e-3, 0.0, 4e-4], -5e-4
    skin = DeflectedSkin(patch.a, sines(patch.a, patch.b, c), patch.radius)

    sensed = FiniteSlopeEffect().sensed(basis, layout)(c).reshape(3, -1)

    expected = skin.readings(*layout.positions.T)
    first_order = (layout.operator(basis) @ c.ravel()).reshape(3, -1)
    np.testing.assert_allclose(sensed, expected, rtol=1e-10, atol=1e-10)
    assert np.abs(expected - first_order).max() > 0.05 * np.abs(first_order).max()


def test_on_slight_slopes_a_loaded_skin_is_sensed_as_the_shell_that_it_is():
    plate = Plate(Patch(0.04, 0.03, 12.9e-3))
    basis, layout = SineBasis(plate.patch, 12, 12), SensorLayout.regular(plate.patch, 8, 8)
    c = plate.deflection([PointLoad(0.02, 0.012, 1e-4)], basis)

    sensed = FiniteSlopeEffect().sensed(basis, layout, plate)(c)

    shell, bent = (layout.operator(basis, of) @ c.ravel() for of in (plate, None))
    peak = np.abs(shell).max()
    np.testing.assert_allclose(sensed, shell, rtol=0, atol=1e-4 * peak)
    assert np.abs(shell - bent).max() > 3e-3 * peak


# What holds the skin


def test_effects_on_the_skin_add_up_to_a_plate_and_come_off_it_one_by_one():
    bare = Plate(SQUARE, poisson=0.4)
    effects = (Tension(60.0), Foam(3e5), Fluid(), StretchingEffect(3e-4))
    plate = bare
    for effect in effects:
        plate = effect.of(plate)

    held = {"tension": 60.0, "foundation": 3e5, "fluid": True}
    assert plate == Plate(SQUARE, **held, poisson=0.4, thickness=3e-4)
    assert effects[0].off(plate) == replace(plate, tension=0.0)
    for effect in effects:
        plate = effect.off(plate)
    assert plate == bare
