"""What colours a skin, against eigenvalues, scatter and the geometry of single points."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import (
    Cap,
    Disk,
    Estimate,
    LeastSquares,
    Patch,
    Pipeline,
    Polygon,
    Refusal,
    Scene,
    SensorLayout,
    Setup,
    Simulator,
    basis_for,
    load_scene,
    local_geometry,
)
from kappaskin.bases import ORDERS
from kappaskin.frames import COMPONENTS
from kappaskin.pipeline import ErrorBars, Quantities, curvature_invariant, skin_colours

FLAT, BENT = Patch(0.1, 0.06), Patch(0.04, 0.03, 12.9e-3)
SETUP = Setup(6, 5, 25, 17)
curvatures = st.floats(-100, 100)


def estimated(scene: Scene) -> tuple[Pipeline, Estimate]:
    pipeline = Pipeline(scene.sensor(), SETUP)
    return pipeline, pipeline(Simulator(scene).frame(100, lambda: 1.0))


def quantities_of(pipeline: Pipeline) -> Quantities:
    setup = pipeline.setup
    return Quantities(pipeline.sensor.layout, pipeline.basis, setup.nx, setup.ny)


@pytest.fixture(scope="module")
def centre() -> tuple[Pipeline, Estimate]:
    return estimated(load_scene("centre"))


@given(curvatures, curvatures, curvatures)
def test_principal_curvatures_are_eigenvalues_and_the_others_their_mean_and_product(
    xx: float, yy: float, xy: float
) -> None:
    form = np.array([xx, yy, xy])
    second, first = np.linalg.eigvalsh([[xx, xy], [xy, yy]])
    expected = {
        "first": first,
        "second": second,
        "mean": (first + second) / 2,
        "gaussian": first * second,
    }
    size = max(abs(xx), abs(yy), abs(xy))
    for name, value in expected.items():
        close = 1e-12 * (size**2 if name == "gaussian" else size)
        assert curvature_invariant(name, form) == pytest.approx(value, abs=close)


@pytest.mark.parametrize("scene", ["centre", "fingertip"])
def test_the_surface_curves_as_each_of_its_points_does(scene: str) -> None:
    pipeline, estimate = estimated(load_scene(scene))
    quantities = quantities_of(pipeline)
    points = np.stack(np.meshgrid(*quantities.grid), axis=-1).reshape(-1, 2)
    geometry = local_geometry(pipeline.fitted, points)
    expected = {
        "first": geometry.principal[:, 0],
        "second": geometry.principal[:, 1],
        "mean": geometry.mean,
        "gaussian": geometry.gaussian,
    }
    for name, values in expected.items():
        found = quantities.on_surface(name, estimate).ravel()
        np.testing.assert_allclose(found, values, atol=1e-9 * np.abs(values).max())


def test_the_surface_curves_along_its_directions_by_its_principal_curvatures(centre) -> None:
    pipeline, estimate = centre
    quantities = quantities_of(pipeline)
    points = np.stack(np.meshgrid(*quantities.grid), axis=-1).reshape(-1, 2)
    K = local_geometry(pipeline.fitted, points).curvature_form
    first, second, angle = quantities.directions(estimate).reshape(3, -1)
    c, s = np.cos(angle), np.sin(angle)
    for along, curvature in (([c, s], first), ([-s, c], second)):
        found = np.einsum("ip,pij,jp->p", along, K, along)
        np.testing.assert_allclose(found, curvature, atol=1e-9 * np.abs(first).max())


def test_a_bent_skin_at_rest_keeps_its_bend() -> None:
    layout = SensorLayout.regular(BENT, 4, 4)
    quantities = Quantities(layout, basis_for(BENT, "hinged", 3, 3), 5, 5)
    H = 1 / 12.9e-3
    at_rest = [quantities.at_rest(name) for name in ("first", "second", "mean", "gaussian", "xx")]
    assert at_rest == pytest.approx([H, 0.0, H / 2, 0.0, 0.0])


def test_a_saddle_at_rest_keeps_both_its_bends_on_the_surface_and_at_the_elements(centre) -> None:
    saddle = Patch(0.04, 0.03, (0.1, -0.2))
    quantities = Quantities(
        SensorLayout.regular(saddle, 4, 4), basis_for(saddle, "hinged", 3, 3), 5, 5
    )
    still = replace(centre[1], coefficients=np.zeros((3, 3)), curvature=np.zeros((3, 16)))
    for name, expected in {"first": 10, "second": -5, "mean": 2.5, "gaussian": -50}.items():
        assert quantities.at_rest(name) == pytest.approx(expected)
        on_surface = quantities.on_surface(name, still)
        assert on_surface[2, 2] == pytest.approx(expected)  # in the middle
        turned = 0.03 * max(abs(expected), 10)  # by its slope elsewhere
        np.testing.assert_allclose(on_surface, expected, atol=turned)
        np.testing.assert_allclose(quantities.of_elements(name, still), expected)


def test_a_spheroid_at_rest_keeps_its_bends_and_its_slopes_lie_along_its_axes(centre) -> None:
    cap = Cap(0.016, 1.2, 1.5)
    layout, basis = SensorLayout.regular(cap, 8, 8), basis_for(cap, "hinged", 4, 5)
    quantities = Quantities(layout, basis, 9, 9)
    still = replace(centre[1], coefficients=np.zeros((4, 5)), curvature=np.zeros((3, len(layout))))
    form = cap.base(*layout.positions.T).form
    for name in ("first", "second", "gaussian"):
        found = quantities.of_elements(name, still)
        np.testing.assert_allclose(found, curvature_invariant(name, form), rtol=1e-6)
    x, y = quantities.grid
    on = cap.contains(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)).reshape(9, 9)
    assert (np.isfinite(quantities.on_surface("mean", still)) == on).all()

    fit = LeastSquares(basis, layout)
    c = np.random.default_rng(0).normal(0, 1e-4, (4, 5))
    places = np.stack(np.meshgrid(*cap.grid(81, 81)), -1).reshape(-1, 2)
    places = places[cap.contains(places)]
    slopes = np.einsum("pij,jp->ip", cap.base(*places.T).covariant, [
        basis.at(places, *order) @ c.ravel() for order in ORDERS])[1:3]  # fmt: skip
    assert fit.slope(c) == pytest.approx(np.hypot(*slopes).max(), rel=0.02)
    bars = ErrorBars(fit, np.zeros((3, len(layout))), x, y)
    place = places[200]
    rows = cap.base(*place).covariant @ basis.jet(*place.tolist())
    covariance = fit(np.zeros((3, len(layout)))).uncertainty.covariance_of(rows[1:3])
    expected = 0.3 * np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(bars.of_slopes(place, 0.3), expected, rtol=1e-9)


def test_elements_tell_what_they_read_and_what_the_fit_left_of_it(centre) -> None:
    pipeline, estimate = centre
    quantities = quantities_of(pipeline)
    for row, name in enumerate(COMPONENTS):
        read = quantities.of_elements(name, estimate)
        fitted = pipeline.fit.predicted(estimate.coefficients)[row]
        np.testing.assert_array_equal(read, estimate.curvature[row])
        left = quantities.of_elements(f"residual_{name}", estimate)
        np.testing.assert_allclose(left, read - fitted, atol=1e-12)
    product = quantities.of_elements("first", estimate) * quantities.of_elements("second", estimate)
    np.testing.assert_allclose(
        product, quantities.of_elements("gaussian", estimate), atol=1e-9 * np.abs(product).max()
    )


def test_on_a_strip_only_the_bend_along_it_counts(centre) -> None:
    strip = Patch(0.1, 0.02, strip=True)
    layout = SensorLayout.regular(strip, 6, 1)
    quantities = Quantities(layout, basis_for(strip, "hinged", 3, 1), 5, 5)
    curvature = np.full((3, 6), np.nan)
    curvature[0] = [-1.0, 2.0, np.nan, 3.0, 0.0, -4.0]
    found = quantities.of_elements("mean", replace(centre[1], curvature=curvature))
    np.testing.assert_array_equal(found, curvature[0] / 2)


@pytest.mark.parametrize(
    "patch",
    [FLAT, Disk(0.05), Polygon([(0, 0), (0.1, 0), (0.05, 0.08)])],
    ids=["flat", "disk", "triangle"],
)
def test_a_surface_is_read_at_the_elements_between_its_points(patch: Patch, centre) -> None:
    layout = SensorLayout.regular(patch, 9, 9)
    quantities = Quantities(layout, basis_for(patch, "hinged", 3, 3), 65, 65)
    x, y = np.meshgrid(*quantities.grid)
    on = patch.contains(np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(x.shape)
    surface = np.where(on, 1e-3 + 0.02 * x - 0.03 * y, np.nan)
    estimate = replace(centre[1], surface=surface)
    px, py = layout.positions.T
    found = quantities.of_elements("displacement", estimate)
    expected = 1e-3 + 0.02 * px - 0.03 * py
    inside = patch.depth(layout.positions) > 0.002
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-12)
    np.testing.assert_allclose(found, expected, atol=3e-5)  # half a cell next to the rim


def test_an_element_in_a_corner_narrower_than_the_grid_shows_the_nearest_point(centre) -> None:
    patch = Polygon([(0, 0.02), (0.1, 0), (0.1, 0.04)])
    layout = SensorLayout.scattered(patch, [[0.012, 0.02]])
    quantities = Quantities(layout, basis_for(patch, "hinged", 2, 2), 6, 4)
    x, y = np.meshgrid(*quantities.grid)
    on = patch.contains(np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(x.shape)
    surface = np.where(on, x, np.nan)
    found = quantities.of_elements("displacement", replace(centre[1], surface=surface))
    assert found == pytest.approx([0.04])


def test_the_difference_is_none_where_no_simulation_knows_the_truth(centre) -> None:
    pipeline, estimate = centre
    quantities = quantities_of(pipeline)
    difference = quantities.on_surface("difference", estimate)
    assert math.sqrt(np.mean(difference**2)) == pytest.approx(estimate.error_rms)
    real = replace(estimate, true_surface=np.full(estimate.surface.shape, np.nan))
    assert np.isnan(quantities.on_surface("difference", real)).all()


def test_error_bars_of_surface_and_slope_are_the_scatter_of_noisy_shapes() -> None:
    layout, basis = SensorLayout.regular(FLAT, 8, 8), basis_for(FLAT, "hinged", 4, 4)
    fit, noise = LeastSquares(basis, layout), 0.3
    draws = np.random.default_rng(5).normal(0.0, noise, (1500, 3, 64))
    draws[:, 1, 7] = np.nan
    x, y = FLAT.grid(7, 5)
    bars = ErrorBars(fit, draws[0], x, y)
    shapes = fit(draws).coefficients
    scatter = basis.on_grid(x, y)(shapes).std(axis=0)
    np.testing.assert_allclose(bars.on_surface(noise), scatter, rtol=0.1, atol=1e-9)
    place = np.array([0.03, 0.02])
    slopes = basis.jet(*place)[1:3] @ shapes.reshape(len(shapes), -1).T
    np.testing.assert_allclose(bars.of_slopes(place, noise), slopes.std(axis=1), rtol=0.1)


def test_an_elastic_rim_adds_what_no_reading_sees() -> None:
    layout, basis = SensorLayout.regular(FLAT, 8, 8), basis_for(FLAT, "elastic", 5, 5)
    fit = LeastSquares(basis, layout, rim_sd=1e-4)
    bars = ErrorBars(fit, np.zeros((3, 64)), *FLAT.grid(7, 5))
    rim = bars.on_surface(0.0)
    assert 0.3e-4 < rim[0].max() < 3e-4
    assert (bars.on_surface(0.2) >= rim).all()


def test_an_error_bar_is_not_known_until_it_is_given(centre) -> None:
    pipeline, estimate = centre
    quantities = quantities_of(pipeline)
    assert np.isnan(quantities.of_elements("error_bar", estimate)).all()
    quantities.error_bars = ErrorBars(pipeline.fit, estimate.curvature, *quantities.grid)
    assert (quantities.of_elements("error_bar", estimate) > 0).all()


def test_every_quantity_has_a_unit_and_a_value_at_every_element(centre) -> None:
    pipeline, estimate = centre
    quantities = quantities_of(pipeline)
    for name in skin_colours():
        assert quantities.of_elements(name, estimate).shape == (100,)
    with pytest.raises(Refusal, match="residual_xx"):
        quantities.on_surface("residual_xx", estimate)
