"""A rigid object dragged over the skin, against put there anew and against one bare product."""

import itertools
import statistics
import time

import numpy as np
import pytest

from kappaskin import Patch, Plate, basis_for
from kappaskin.mechanics import Block, Cylinder, HeightMap, IndentationSolver, Punch, Sphere, Wedge

PATCH = Patch(0.1, 0.1)
STAMP = HeightMap(np.random.default_rng(0).uniform(0, 2e-4, (64, 64)), 0.03, 0.03)
OBJECTS = (
    (Sphere(0.01), {"depth": 4e-3}),
    (Sphere(0.05), {"depth": 4e-3}),
    (Sphere(0.2), {"depth": 4e-3}),
    (Sphere(0.1), {"force": 5.0}),
    (Cylinder(0.02, 0.04), {"depth": 4e-3}),
    (Wedge(1.5, 0.04, 0.02), {"force": 1.0}),
    (Punch(0.015), {"depth": 2e-3}),
    (Block(0.04, 0.02), {"force": 1.0}),
    (STAMP, {"depth": 2e-3}),
)


def path():
    """Places along a loop over the skin, a millimetre or so apart, turning on the way."""
    for step in itertools.count():
        angle = 0.05 * step
        yield 0.05 + 0.02 * np.cos(angle), 0.05 + 0.015 * np.sin(2 * angle), 0.3 * angle


def _words(object_, depth: float = 0.0, force: float = 0.0) -> str:
    name = type(object_).__name__
    if isinstance(object_, Sphere):
        name += f" of {1e3 * object_.radius:g} mm"
    return f"{name}, {f'{1e3 * depth:g} mm deep' if depth else f'by {force:g} N'},"


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_a_dragged_object_takes_less_than_fifty_products(edge, figure, ratio) -> None:
    basis = basis_for(PATCH, edge, 15, 15)
    press = IndentationSolver(Plate(PATCH), basis)
    felt = basis.at(np.random.default_rng(0).uniform(0, 0.1, (4096, 2)))
    for object_, asked in OBJECTS:
        dragged, put, product, steps = [], [], [], []
        answer = press(object_, *next(path()), **asked)
        for place in itertools.islice(path(), 1, 60):
            start = time.perf_counter()
            answer = press(object_, *place, **asked, after=answer)
            dragged.append(time.perf_counter() - start)
            start = time.perf_counter()
            alone = press(object_, *place, **asked)
            put.append(time.perf_counter() - start)
            start = time.perf_counter()
            felt @ answer.coefficients.ravel()
            product.append(time.perf_counter() - start)
            steps.append(answer.steps)
            assert np.allclose(answer.coefficients, alone.coefficients, rtol=1e-5, atol=1e-9)
            assert answer.residual < 1e-6
        dragged_s, put_s, product_s = map(statistics.median, (dragged, put, product))
        name = f"{edge}, {_words(object_, **asked)}"
        figure(
            f"{name} dragged {dragged_s * 1e3:.1f} ms "
            f"({statistics.median(steps):g} steps, at most {max(dragged) * 1e3:.1f} ms), put there "
            f"anew {put_s * 1e3:.1f} ms, {dragged_s / product_s:.0f} products of all nodes with "
            f"all functions ({product_s * 1e3:.2f} ms)"
        )
        ratio(
            f"{name} dragged, against a product",
            dragged_s / product_s,
            at_most=50,
        )
