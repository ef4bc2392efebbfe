"""Estimators, each against the bare arithmetic that it cannot do without.

What takes milliseconds is measured in processor time: others on the machine interrupt it.
"""

import time
import tracemalloc

import numpy as np
import pytest
from scipy.fft import dct, dst
from scipy.sparse.linalg import svds

from kappaskin import Fast, LeastSquares, Patch, SensorLayout, SineBasis

PATCH = Patch(0.1, 0.1)
LARGE = SensorLayout.regular(PATCH, 256, 256)
READINGS = np.random.default_rng(0).normal(size=(3, 256**2))


def fast(layout=LARGE):
    return Fast(SineBasis(PATCH, 255, 255), layout)


def bare_transforms():
    """Sines of xx and yy and cosines of xy, along y and then along x."""
    channels = zip(READINGS.reshape(3, 256, 256), (dst, dst, dct), strict=True)
    return [f(f(K, 2, axis=0), 2, axis=1, overwrite_x=True) for K, f in channels]


def test_256_by_256_elements_take_less_than_two_times_three_bare_transforms(
    medians, figure, ratio
) -> None:
    fit = fast()

    ours, bare = medians(
        lambda: fit(READINGS).coefficients,
        bare_transforms,
        turns=100,
        calls=1,
        clock=time.thread_time,
    )

    figure(
        f"256 x 256 elements to 255 x 255 functions: {ours * 1e3:.2f} ms, {ours / bare:.2f} times "
        f"three bare transforms ({bare * 1e3:.2f} ms)"
    )
    ratio("255 x 255 functions, against three transforms", ours / bare, at_most=2)


@pytest.mark.parametrize("quantity", ["height", "slope"])
def test_heights_or_slopes_of_a_camera_take_less_than_two_times_their_bare_transforms(
    quantity, medians, figure, ratio
) -> None:
    m, n = 460, 345
    patch = Patch(0.0115, 0.0115 * n / m)
    layout, every = SensorLayout.regular(patch, m, n), np.arange(m * n)
    K = np.random.default_rng(0).normal(size=(1 if quantity == "height" else 2, n, m))
    directions = np.repeat([0, np.pi / 2][: len(K)], m * n)
    layout = layout.reading(np.tile(every, len(K)), quantity, directions)
    fit, flat = Fast(SineBasis(patch, m - 1, n - 1), layout), K.ravel()
    along = [(dst, dst)] if quantity == "height" else [(dst, dct), (dct, dst)]

    def bare():
        """Transforms along y and then along x, of every reading."""
        return [
            in_x(in_y(k, 2, axis=0), 2, axis=1, overwrite_x=True)
            for k, (in_y, in_x) in zip(K, along, strict=True)
        ]

    ours, theirs = medians(
        lambda: fit(flat).coefficients, bare, turns=60, calls=1, clock=time.thread_time
    )

    figure(
        f"{n} x {m} {quantity}s to {n - 1} x {m - 1} functions: {ours * 1e3:.2f} ms, "
        f"{ours / theirs:.2f} times their bare transforms ({theirs * 1e3:.2f} ms)"
    )
    ratio(f"{n} x {m} {quantity}s, against their transforms", ours / theirs, at_most=2)


def test_256_by_256_elements_take_less_memory_than_six_times_their_readings(figure, ratio) -> None:
    fast()(READINGS)
    tracemalloc.start()
    fit = fast()
    answer = fit(READINGS)
    to_coefficients = tracemalloc.get_traced_memory()[1] / READINGS.nbytes
    held = answer.residual, answer.sd
    peak = tracemalloc.get_traced_memory()[1] / READINGS.nbytes
    tracemalloc.stop()

    figure(
        f"256 x 256 elements to 255 x 255 functions: {to_coefficients:.1f} times the memory of "
        f"the readings, with the estimator; {peak:.1f} with residual and error bars"
    )
    assert len(held) == 2
    ratio("memory of 255 x 255 functions, against the readings", peak, at_most=6)


@pytest.mark.parametrize("percent", [1, 5])
def test_dead_elements_take_a_few_steps_of_two_fits_each(percent, medians, figure, ratio) -> None:
    dead = np.flatnonzero(np.random.default_rng(1).random(256**2) < percent / 100)
    whole, lacking = fast(), fast(LARGE.without(dead))

    complete, without = medians(
        lambda: whole(READINGS),
        lambda: lacking(READINGS),
        turns=15,
        calls=1,
        clock=time.thread_time,
    )

    steps = int(lacking(READINGS).steps)
    figure(
        f"{percent} % of 256 x 256 elements dead: {steps} steps, {without * 1e3:.0f} ms, "
        f"{without / complete:.0f} times the complete fit ({complete * 1e3:.2f} ms), "
        f"{without / complete / steps:.1f} times a step"
    )
    assert steps <= 40
    ratio(
        f"a step with {percent} % dead, against a complete fit",
        without / steps / complete,
        at_most=8,
    )


def test_100_000_frames_take_less_than_two_times_a_bare_matrix_product(
    medians, figure, ratio
) -> None:
    fit = LeastSquares(SineBasis(PATCH, 8, 8), SensorLayout.regular(PATCH, 10, 10))
    rng = np.random.default_rng(0)
    K, A = rng.normal(size=(100_000, 3, 100)), rng.normal(size=(300, 64))

    ours, bare = medians(
        lambda: fit(K).coefficients,
        lambda: K.reshape(-1, 300) @ A,
        turns=9,
        calls=1,
        clock=time.thread_time,
    )

    figure(
        f"100,000 frames of 10 x 10 elements to 8 x 8 functions: {ours * 1e3:.0f} ms "
        f"({0.1 / ours:.2f} million per second), {ours / bare:.2f} times a bare matrix product "
        f"({bare * 1e3:.0f} ms)"
    )
    ratio("100,000 frames, against a matrix product", ours / bare, at_most=2)


def test_one_frame_takes_a_few_times_a_bare_matrix_product(medians, figure, ratio) -> None:
    fit = LeastSquares(SineBasis(PATCH, 8, 8), SensorLayout.regular(PATCH, 10, 10))
    rng = np.random.default_rng(0)
    K, A = rng.normal(size=(3, 100)), rng.normal(size=(300, 64))
    flat = K.ravel()

    called, with_noise, bare = medians(lambda: fit(K), lambda: fit(K).noise, lambda: flat.dot(A))

    figure(
        f"one frame of 10 x 10 elements to 8 x 8 functions: {called * 1e6:.1f} us, "
        f"{with_noise * 1e6:.1f} us with its noise; {called / bare:.1f} and "
        f"{with_noise / bare:.1f} times a bare matrix product ({bare * 1e6:.1f} us)"
    )
    ratio("one frame with its noise, against a matrix product", with_noise / bare, at_most=20)


def test_4096_functions_are_solved_as_exactly_as_rounding_allows(request, figure) -> None:
    if not request.config.getoption("--long"):
        pytest.skip("takes minutes: --long")
    rng = np.random.default_rng(0)
    places = PATCH.cell_centres(65, 65)
    grid = np.stack(np.meshgrid(*places), -1).reshape(-1, 2)
    layout = SensorLayout.scattered(PATCH, grid + rng.uniform(-2e-4, 2e-4, grid.shape))
    basis = SineBasis(PATCH, 64, 64)
    start = time.thread_time()
    fit = LeastSquares(basis, layout)
    taken = time.thread_time() - start
    length = np.linalg.norm(fit.M, axis=0)
    A = fit.M / length
    most = float(svds(A, 1, return_singular_vectors=False)[0])

    def solved(b):
        g = length * fit(b.reshape(3, -1)).coefficients.ravel()
        return g, b - A @ g

    # Of readings of anything the residual r stands on every column, but for what A would have to
    # change by, -r r'A / r'r; of a shape's it is rounding.
    _, r = solved(rng.normal(size=len(A)))
    backward = np.linalg.norm(A.T @ r) / np.linalg.norm(r) / most
    g, r = solved(A @ rng.normal(size=basis.size))
    left = np.linalg.norm(r) / (2 * most * np.linalg.norm(g))
    eps = np.finfo(float).eps
    figure(
        f"64 x 64 functions of 65 x 65 scattered elements, factored in {taken:.0f} s: the exact "
        f"answer for an M {backward / eps:.1f} roundings away; of a shape's readings "
        f"{left / eps:.1f} roundings are left"
    )
    assert backward < 20 * np.sqrt(len(A)) * eps
    assert left < 20 * np.sqrt(len(A)) * eps
