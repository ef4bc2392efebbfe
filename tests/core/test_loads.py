"""What each basis function feels of a load."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import LineLoad, Patch, PointLoad, Refusal, SineBasis

PATCH = Patch(0.1, 0.05)
BASIS = SineBasis(PATCH, 15, 15)
xs, ys = st.floats(0, 0.1), st.floats(0, 0.05)
loads = st.one_of(
    st.builds(PointLoad, xs, ys, st.floats(-5, 5)),
    st.builds(LineLoad, xs, ys, xs, ys, st.floats(-5, 5)),
)


def points_along(line, shares, weights):
    """`line` as point loads at `shares` of its length, carrying `weights` of its force."""
    for s, weight in zip(shares, weights, strict=True):
        x, y = line.x0 + s * (line.x1 - line.x0), line.y0 + s * (line.y1 - line.y0)
        yield PointLoad(x, y, line.force * weight)


def test_a_point_load_is_felt_as_the_functions_value_there():
    modal = PointLoad(0.03, 0.02, 2.0).modal(BASIS)

    np.testing.assert_allclose(modal.ravel(), 2.0 * BASIS.at(np.array([[0.03, 0.02]]))[0])


def test_the_papers_line_load_agrees_with_20000_points():
    basis, line = SineBasis(Patch(0.1, 0.1), 15, 15), LineLoad(0.01, 0.09, 0.09, 0.01)
    s = (np.arange(20_000) + 0.5) / 20_000
    points = np.column_stack([0.01 + 0.08 * s, 0.09 - 0.08 * s])

    superposed = basis.at(points).mean(axis=0).reshape(basis.shape)

    np.testing.assert_allclose(line.modal(basis), superposed, rtol=0, atol=7e-9)


@given(xs, ys, xs, ys)
def test_a_line_load_is_the_superposition_of_its_points(x0, y0, x1, y1):
    line = LineLoad(x0, y0, x1, y1, 3.0)
    # 64 Gauss points integrate cos(t s) to rounding for turns up to t = 30 pi.
    nodes, weights = np.polynomial.legendre.leggauss(64)

    superposed = sum(p.modal(BASIS) for p in points_along(line, (nodes + 1) / 2, weights / 2))

    np.testing.assert_allclose(line.modal(BASIS), superposed, rtol=0, atol=1e-12)


def test_a_line_load_acts_at_its_middle():
    np.testing.assert_allclose(LineLoad(0.01, 0.02, 0.05, 0.04).centre(), [0.03, 0.03])


def test_a_line_load_of_no_length_is_a_point_load():
    line, point = LineLoad(0.03, 0.02, 0.03, 0.02, 2.0), PointLoad(0.03, 0.02, 2.0)

    np.testing.assert_allclose(line.modal(BASIS), point.modal(BASIS), rtol=0, atol=1e-14)


@given(loads, st.floats(-3, 3))
def test_what_is_felt_grows_with_the_force(load, factor):
    scaled = load.scaled(factor)

    assert scaled.force == pytest.approx(factor * load.force)
    np.testing.assert_allclose(scaled.modal(BASIS), factor * load.modal(BASIS), atol=1e-12)


@given(loads, st.floats(-0.01, 0.01), st.floats(-0.01, 0.01))
def test_a_shift_moves_the_centre_and_keeps_the_force(load, dx, dy):
    shifted = load.shifted(dx, dy)

    np.testing.assert_allclose(shifted.centre() - load.centre(), [dx, dy], atol=1e-15)
    assert shifted.force == load.force
    assert shifted.shifted(-dx, -dy).centre() == pytest.approx(load.centre())


def test_a_shift_keeps_the_line_as_long_and_as_steep():
    assert LineLoad(0.01, 0.02, 0.03, 0.05, 2.0).shifted(0.0, -0.01) == LineLoad(
        0.01, 0.01, 0.03, 0.04, 2.0
    )


@pytest.mark.parametrize(
    "load",
    [
        PointLoad(0.11, 0.02),
        PointLoad(0.02, -1e-6),
        PointLoad(math.nan, 0.02),
        LineLoad(0.01, 0.01, 0.09, 0.06),
        LineLoad(-0.01, 0.01, 0.09, 0.04),
    ],
)
def test_a_load_off_the_patch_is_refused_with_the_way_to_give_positions(load):
    with pytest.raises(Refusal, match=r"on the patch of 0\.1 x 0\.05 m, got .*Load\(.*in metres"):
        load.check(PATCH)


@pytest.mark.parametrize("force", [math.nan, math.inf])
def test_a_force_that_is_no_number_is_refused(force):
    with pytest.raises(Refusal, match=f"finite force in N, got {force}"):
        PointLoad(0.05, 0.02, force).check(PATCH)


def test_loads_on_the_edge_are_on_the_patch():
    LineLoad(0.0, 0.0, 0.1, 0.05).check(PATCH)
    PointLoad(0.1, 0.05).check(PATCH)
