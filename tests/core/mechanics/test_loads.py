"""What each basis function feels of a load."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import (
    Cap,
    DiscLoad,
    GaussianLoad,
    LineLoad,
    Patch,
    PointLoad,
    RectangleLoad,
    Refusal,
    SineBasis,
    basis_for,
)

PATCH = Patch(0.1, 0.05)
BASIS = SineBasis(PATCH, 15, 15)
xs, ys = st.floats(0, 0.1), st.floats(0, 0.05)
loads = st.one_of(
    st.builds(PointLoad, xs, ys, st.floats(-5, 5)),
    st.builds(LineLoad, xs, ys, xs, ys, st.floats(-5, 5)),
    st.builds(DiscLoad, xs, ys, st.floats(1e-4, 0.02), st.floats(-5, 5)),
    st.builds(RectangleLoad, xs, ys, st.floats(1e-4, 0.1), st.floats(1e-4, 0.05), st.floats(-5, 5)),
    st.builds(GaussianLoad, xs, ys, st.floats(1e-4, 0.01), st.floats(-5, 5)),
)
SPREAD = [
    DiscLoad(0.06, 0.02, 0.015, 2.0),
    RectangleLoad(0.06, 0.02, 0.07, 0.03, 2.0),
    GaussianLoad(0.06, 0.02, 0.004, 2.0),
]
spread = pytest.mark.parametrize("load", SPREAD, ids=lambda load: type(load).__name__)


class AnyBasis:
    """Sines that a load does not know to be sines."""

    def __init__(self, basis):
        self.patch, self.shape, self.at = basis.patch, basis.shape, basis.at


def density(load, x, y):
    """The pressure of `load`, written out, in Pa at the points x, y."""
    dx, dy = x - load.x, y - load.y
    if isinstance(load, DiscLoad):
        return (dx**2 + dy**2 < load.radius**2) / (math.pi * load.radius**2)
    if isinstance(load, RectangleLoad):
        inside = (abs(dx) < load.width / 2) & (abs(dy) < load.height / 2)
        return inside / (load.width * load.height)
    return np.exp(-(dx**2 + dy**2) / (2 * load.sd**2)) / (2 * math.pi * load.sd**2)


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


# Loads spread over an area


@spread
def test_a_spread_load_is_the_integral_of_its_pressure(load):
    # Sums over 800 x 400 cells; the rims of disc and rectangle pass through some of them.
    x, y = (np.arange(800) + 0.5) * 0.1 / 800, (np.arange(400) + 0.5) * 0.05 / 400
    pressure = load.force * density(load, x[:, None], y[None, :])
    k, l = BASIS.wavenumbers

    summed = np.sin(np.outer(k, x)) @ pressure @ np.sin(np.outer(y, l)) * (0.1 / 800) ** 2

    np.testing.assert_allclose(load.modal(BASIS), summed, rtol=0, atol=2e-3 * load.force)


@spread
def test_by_quadrature_any_basis_feels_what_sines_feel_in_closed_form(load):
    closed, summed = load.modal(BASIS), load.modal(AnyBasis(BASIS))

    # Beyond four standard deviations lies exp(-8) of a Gaussian, which quadrature leaves out.
    beyond = math.exp(-8) * load.force if isinstance(load, GaussianLoad) else 0.0
    np.testing.assert_allclose(closed, summed, rtol=0, atol=1.1 * beyond + 1e-13)


@spread
@pytest.mark.parametrize("functions", [1, 40])
def test_quadrature_follows_as_many_functions_as_the_basis_has(load, functions):
    basis = SineBasis(PATCH, functions, functions)

    beyond = math.exp(-8) * load.force if isinstance(load, GaussianLoad) else 0.0
    np.testing.assert_allclose(
        load.modal(basis), load.modal(AnyBasis(basis)), rtol=0, atol=1.1 * beyond + 1e-13
    )


@spread
def test_on_a_strip_a_spread_load_is_felt_along_x_alone(load):
    basis = SineBasis(Patch(0.1, 0.05, strip=True), 15, 1)
    x = (np.arange(2000) + 0.5) * 0.1 / 2000
    y = (np.arange(1000) + 0.5) * 0.05 / 1000
    along = load.force * density(load, x[:, None], y).sum(axis=1) * (0.05 / 1000)

    felt = load.modal(basis)

    summed = np.sin(np.outer(basis.wavenumbers[0], x)) @ along * (0.1 / 2000)
    np.testing.assert_allclose(felt.ravel(), summed, rtol=0, atol=1e-3 * load.force)
    any_basis = load.modal(AnyBasis(basis))
    np.testing.assert_allclose(felt, any_basis, rtol=0, atol=4e-4 * load.force)


@pytest.mark.parametrize(
    ("small", "mean_square"),
    [
        (lambda size: DiscLoad(0.031, 0.021, size), 1 / 2),
        (lambda size: RectangleLoad(0.031, 0.021, size, size), 1 / 6),
        (lambda size: GaussianLoad(0.031, 0.021, size), 2.0),
    ],
    ids=["disc", "rectangle", "gaussian"],
)
def test_spread_loads_tend_to_a_point_as_the_square_of_their_size(small, mean_square):
    # The mean of x^2 + y^2 under each is in sizes squared; of a wave, a quarter of that times its
    # wave number squared is lost.
    lost = 1 - small(1e-4).modal(BASIS) / PointLoad(0.031, 0.021).modal(BASIS)

    np.testing.assert_allclose(lost, mean_square * 1e-8 * BASIS.laplacian / 4, rtol=5e-3)


def test_a_rectangle_of_no_height_to_speak_of_is_a_line():
    line = LineLoad(0.02, 0.02, 0.08, 0.02, 2.0)

    np.testing.assert_allclose(
        RectangleLoad(0.05, 0.02, 0.06, 1e-8, 2.0).modal(BASIS), line.modal(BASIS), atol=1e-12
    )


@pytest.mark.parametrize(
    "load",
    [
        DiscLoad(0.02, 0.02, 0.02),
        DiscLoad(0.05, 0.03, 0.02),
        RectangleLoad(0.05, 0.025, 0.1, 0.05),
        RectangleLoad(0.07, 0.04, 0.06, 0.02),
        GaussianLoad(0.02, 0.02, 0.005),
    ],
)
def test_a_load_that_touches_the_edge_lies_on_the_patch(load):
    load.check(PATCH)


@pytest.mark.parametrize(
    "load",
    [
        DiscLoad(0.02, 0.02, 0.0201),
        DiscLoad(0.05, 0.025, 0.03),
        DiscLoad(0.095, 0.045, 0.006),
        RectangleLoad(0.05, 0.025, 0.1001, 0.02),
        RectangleLoad(0.05, 0.025, 0.02, 0.0501),
        GaussianLoad(0.02, 0.02, 0.0051),
        DiscLoad(math.nan, 0.02, 0.001),
        GaussianLoad(0.05, math.inf, 0.001),
    ],
)
def test_a_load_that_spills_over_the_edge_is_refused(load):
    with pytest.raises(Refusal, match=r"on the patch of 0\.1 x 0\.05 m, got .*Load\("):
        load.check(PATCH)


@spread
def test_a_load_over_a_notch_in_the_skin_is_refused(load):
    class Notched(AnyBasis):
        def __init__(self):
            super().__init__(BASIS)
            self.at = lambda p: np.where(abs(p[:, :1] - load.x) < 1e-3, np.nan, BASIS.at(p))

    with pytest.raises(Refusal, match="expected a load completely on the skin"):
        load.modal(Notched())


@pytest.mark.parametrize("size", [0.0, -0.01, math.nan, math.inf])
@pytest.mark.parametrize("kind", [DiscLoad, GaussianLoad])
def test_a_load_of_no_size_is_refused_with_what_to_take_instead(kind, size):
    with pytest.raises(Refusal, match=f"size above zero in metres, got {kind.__name__}.*a point"):
        kind(0.05, 0.02, size)


@pytest.mark.parametrize("sides", [(0.0, 0.01), (0.01, -0.01), (math.nan, 0.01)])
def test_a_rectangle_with_a_side_of_no_length_is_refused(sides):
    with pytest.raises(Refusal, match="size above zero in metres, got RectangleLoad"):
        RectangleLoad(0.05, 0.02, *sides)


@pytest.mark.cases("6-disc", "7-Gaussian")
@pytest.mark.parametrize("kind", [(DiscLoad, 2e-3), (GaussianLoad, 5e-4)], ids=["disc", "Gaussian"])
@pytest.mark.parametrize("Nj", [6, 7])
@given(st.floats(0, 1), st.floats(0, 7))
def test_a_round_load_is_felt_all_over_a_cap_as_by_quadrature(kind, Nj, share, turn):
    made, size = kind
    cap = Cap(8e-3, 1.4, 1.2)
    basis = basis_for(cap, "clamped", 5, Nj)
    far = share * (cap.rim_radius - (2e-3 if made is DiscLoad else 4 * size))
    x, y = cap.rim_radius + far * np.cos(turn), cap.rim_radius + far * np.sin(turn)
    load = made(x, y, size, 0.3)

    felt = load.modal(basis)

    points, weights = load.quadrature(12)
    expected = 0.3 * weights @ basis.at(cap.around(x, y, points))
    scale = np.abs(expected).max()
    np.testing.assert_allclose(felt.ravel(), expected, rtol=0, atol=1e-9 * scale)


def test_a_disc_that_touches_the_rim_of_a_cap_is_felt_at_no_cost_per_frame(monkeypatch):
    """As the mouse drags it there: between the points of its rim that are checked, 2 um over."""
    cap = Cap(8e-3, np.radians(75))
    basis = basis_for(cap, "clamped", 5, 7)
    load = DiscLoad(2.5800646314697254e-3, 9.329945612915037e-3, 2.5e-3)
    load.check(cap)
    points, weights = load.quadrature(12)
    expected = weights @ basis.at(cap.around(load.x, load.y, points))
    load.modal(basis)
    monkeypatch.setattr(type(basis), "at", None)

    felt = load.modal(basis).ravel()

    np.testing.assert_allclose(felt, expected, rtol=0, atol=5e-3 * np.abs(expected).max())


def test_a_round_load_over_the_rim_of_a_cap_is_refused():
    basis = basis_for(Cap(8e-3), "clamped", 5, 6)

    with pytest.raises(Refusal, match="expected a load completely on the skin"):
        DiscLoad(0.001, 0.0126, 2e-3).modal(basis)


@pytest.mark.parametrize("x", [0.03, 0.219])  # at 0.219 m the angle from the pole is a full turn
def test_a_disc_beyond_the_rim_of_a_cap_is_refused(x):
    with pytest.raises(Refusal, match="expected a load on the cap"):
        DiscLoad(x, 0.0121, 2.5e-3).check(Cap(8e-3, 1.309))
