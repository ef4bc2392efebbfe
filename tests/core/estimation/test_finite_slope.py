"""Gages on a slope: the true normal curvature, and the shape that explains it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from deflected import DeflectedSkin, ShallowSkin, sines
from kappaskin import (
    Cap,
    Disk,
    LeastSquares,
    Patch,
    Plate,
    PointLoad,
    Polygon,
    RankDeficient,
    SensorLayout,
    SineBasis,
    basis_for,
    estimator_for,
    load_scene,
    local_geometry,
)
from kappaskin.estimation import METHODS, FiniteSlopeLeastSquares, slope_warning
from kappaskin.sensing import NormalCurvature

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
EIGHT = SineBasis(SQUARE, 8, 8)


def on_a_slope(basis, c, layout=TENS):
    """The true normal curvature (3, P) along the gages, written out once more (PHYSICS 3)."""
    f = {order: basis.at(layout.positions, *order) @ c.ravel() for order in
         [(1, 0), (0, 1), (2, 0), (0, 2), (1, 1)]}  # fmt: skip
    fx, fy = f[1, 0], f[0, 1]
    W = np.sqrt(1 + fx**2 + fy**2)
    return np.stack(
        [
            f[2, 0] / (W * (1 + fx**2)),
            f[0, 2] / (W * (1 + fy**2)),
            f[1, 1] / (W * np.sqrt((1 + fx**2) * (1 + fy**2))),
        ]
    )


class Case:
    """One of Table 1's load cases, whose gages sense the bent surface's curvature."""

    def __init__(self, name):
        scene = load_scene(name)
        self.basis, self.load = scene.basis, scene.loads[0].centre()
        self.truth = scene.plate.deflection(scene.loads, scene.basis)
        self.K = on_a_slope(scene.basis, self.truth)

    def errors(self, answer):
        """E at the load and RMS in mm."""
        grid, at = SQUARE.grid(101, 101), self.load[None]
        w = EIGHT.on_grid(*grid)(answer.coefficients) - self.basis.on_grid(*grid)(self.truth)
        e = (
            EIGHT.at(at)[0] @ answer.coefficients.ravel()
            - self.basis.at(at)[0] @ self.truth.ravel()
        )
        return 1e3 * e, 1e3 * np.sqrt(np.mean(w**2))


@pytest.mark.parametrize(
    ("name", "linear", "finite"),
    [
        ("centre", (-0.076, 0.0143), (-0.0481, 0.0041)),
        ("off-centre", (-0.257, 0.0499), (-0.1210, 0.0104)),
        ("line", (-0.031, 0.0180), (-0.0000, 0.0008)),
    ],
)
def test_few_steps_take_away_what_slopes_cost(name, linear, finite):
    case = Case(name)

    answer, plain = FiniteSlopeLeastSquares(EIGHT, TENS)(case.K), LeastSquares(EIGHT, TENS)(case.K)

    assert case.errors(plain) == pytest.approx(linear, abs=6e-4)
    assert case.errors(answer) == pytest.approx(finite, abs=6e-5)
    assert answer.converged
    assert answer.steps <= 3
    start = plain.coefficients.ravel()
    best = least_squares(
        lambda c: (case.K - on_a_slope(EIGHT, c)).ravel(),
        start, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale=np.abs(start).max() / np.arange(1, 65),
    )  # fmt: skip
    scale = np.abs(best.x).max()
    np.testing.assert_allclose(answer.coefficients.ravel(), best.x, rtol=0, atol=1e-6 * scale)


def test_the_fixed_operator_of_first_order_ends_beside_the_least_squares():
    case, M = Case("off-centre"), TENS.operator(EIGHT)
    c = np.zeros(64)
    for _ in range(20):
        c = c + np.linalg.pinv(M) @ (case.K - on_a_slope(EIGHT, c)).ravel()

    there = LeastSquares(EIGHT, TENS)(case.K)
    object.__setattr__(there, "coefficients", c.reshape(8, 8))
    assert case.errors(there) == pytest.approx((-0.1186, 0.0102), abs=6e-5)


def test_the_prediction_is_the_true_normal_curvature():
    answer = LeastSquares(EIGHT, TENS)(Case("off-centre").K)

    predicted = FiniteSlopeLeastSquares(EIGHT, TENS).predicted(answer.coefficients)

    np.testing.assert_allclose(predicted, on_a_slope(EIGHT, answer.coefficients), rtol=1e-12)
    # The Gauss frame's first vector is along x: an independent way to kappa_xx.
    form = local_geometry(answer, TENS.positions).curvature_form
    np.testing.assert_allclose(predicted[0], form[:, 0, 0], rtol=1e-9, atol=1e-9)


def test_flat_enough_it_is_least_squares():
    K = 1e-4 * Case("centre").K

    answer, plain = FiniteSlopeLeastSquares(EIGHT, TENS)(K), LeastSquares(EIGHT, TENS)(K)

    scale = np.abs(plain.coefficients).max()
    np.testing.assert_allclose(answer.coefficients, plain.coefficients, rtol=0, atol=1e-7 * scale)


ARC = Patch(np.pi * 12.9e-3, 0.03, 12.9e-3)
SKINS = {
    "flat": (SQUARE, "hinged", 8, 8),
    "flat, clamped": (SQUARE, "clamped", 8, 8),
    "long": (Patch(0.1, 0.02), "hinged", 9, 4),
    "elastic rim": (SQUARE, "elastic", 6, 6),
    "disk": (Disk(0.05), "hinged", 4, 4),
    "disk, clamped": (Disk(0.05), "clamped", 4, 4),
    "polygon": (Polygon([[0, 0], [0.09, 0], [0.07, 0.08], [0.0, 0.06]]), "clamped", 4, 4),
    "strip": (Patch(0.1, 1.0, strip=True), "hinged", 8, 1),
    "half round": (ARC, "hinged", 6, 6),
    "half round, clamped": (ARC, "clamped", 6, 6),
    "slightly bent": (Patch(0.04, 0.03, 0.03), "hinged", 6, 6),
    "slightly bent, sliding": (Patch(0.04, 0.03, 0.03), "sliding", 6, 6),
    "dome": (Patch(0.04, 0.03, (0.09, 0.12)), "hinged", 6, 6),
    "saddle, clamped": (Patch(0.04, 0.03, (0.09, -0.12)), "clamped", 6, 6),
    "arc": (Patch(np.pi * 12.9e-3, 1.0, 12.9e-3, strip=True), "hinged", 8, 1),
}


def skin_of(name):
    patch, edge, Ni, Nj = SKINS[name]
    layout = SensorLayout.regular(patch, 14, 1 if patch.strip else 12)
    return basis_for(patch, edge, Ni, Nj), layout


def smooth_shape(basis, slope, seed=0):
    """Coefficients of a smooth shape that the edges allow, whose largest slope is this."""
    patch, (Ni, Nj) = basis.patch, basis.shape
    i, j = np.arange(1, Ni + 1)[:, None] / patch.a, np.arange(1, Nj + 1) / patch.b
    c = np.random.default_rng(seed).normal(size=basis.shape) / (i**2 + j**2) ** 1.8
    if basis.free is not None:
        c = (basis.free @ np.linalg.lstsq(basis.free, c.ravel(), rcond=None)[0]).reshape(c.shape)
    if basis.unobservable is not None:
        c[:2, :2] = 0
        c = (basis.free @ np.linalg.lstsq(basis.free, c.ravel(), rcond=None)[0]).reshape(c.shape)
    x, y = (np.linspace(0, side, 61) for side in (patch.a, patch.b))
    places = np.column_stack([np.tile(x, 61), np.repeat(y, 61)])
    places = places[patch.contains(places)]
    p, q = (basis.at(places, *order) @ c.ravel() for order in ((1, 0), (0, 1)))
    if H := patch.arc_curvature:
        p = p + H**2 * basis.at(places, -1, 0) @ c.ravel()
    return c * slope / np.sqrt(p**2 + q**2).max()


def dent_at(fit, place, slope):
    """Coefficients of the dent of a load at a place in shares of the sides, as the edges allow."""
    basis = fit.basis
    c = Plate(basis.patch).deflection([PointLoad(*(place * (basis.patch.a, basis.patch.b)))], basis)
    if basis.free is not None:
        c = (basis.free @ np.linalg.lstsq(basis.free, c.ravel(), rcond=None)[0]).reshape(c.shape)
    return c * slope / fit.slope(c)


def in_space(basis, c):
    """The skin with coefficients `c` as a surface in space."""
    patch = basis.patch
    if isinstance(basis, SineBasis) and not (patch.strip or patch.is_shallow):
        return DeflectedSkin(patch.a, sines(patch.a, patch.b, c), patch.radius)

    def f(x, y, dx=0, dy=0):
        return basis.at(np.column_stack([x, y]), dx, dy) @ c.ravel()

    if patch.is_shallow:
        return ShallowSkin(patch.a, f, radii=patch.radii)
    return DeflectedSkin(patch.a, f, patch.radius)


def readings_of(basis, layout, c):
    """What the gages on the skin in space read, (3, P), and nothing where there are none."""
    return np.where(layout.live, in_space(basis, c).readings(*layout.positions.T), np.nan)


def peak_error(basis, found, truth):
    """Largest error of the displacement over the largest displacement, on a fine grid."""
    w = basis.on_grid(*basis.patch.grid(41, 41))
    return np.nanmax(np.abs(w(found) - w(truth))) / np.nanmax(np.abs(w(truth)))


@pytest.mark.parametrize("slope", [0.2, 0.6, 1.0, 1.4])
@pytest.mark.parametrize("name", SKINS)
def test_steep_skins_come_back_to_a_hundred_thousandth_in_six_steps(name, slope):
    basis, layout = skin_of(name)
    c = smooth_shape(basis, slope)

    answer = FiniteSlopeLeastSquares(basis, layout)(readings_of(basis, layout, c))

    assert answer.converged
    assert 1 <= answer.steps <= 6
    assert peak_error(basis, answer.coefficients, c) < 1e-5


@pytest.mark.parametrize("name", ["flat", "half round", "slightly bent", "dome"])
def test_dents_of_contacts_come_back_wherever_they_are(name):
    basis, layout = skin_of(name)
    fit = FiniteSlopeLeastSquares(basis, layout)
    for place in np.random.default_rng(1).uniform(0.2, 0.8, (20, 2)):
        c = dent_at(fit, place, 1.4)

        answer = fit(readings_of(basis, layout, c))

        assert answer.converged
        assert peak_error(basis, answer.coefficients, c) < 1e-5


@pytest.mark.parametrize("name", ["flat", "half round, clamped", "arc", "dome", "saddle, clamped"])
def test_the_prediction_is_what_gages_read_of_the_surface_in_space(name):
    basis, layout = skin_of(name)
    c = smooth_shape(basis, 0.8)

    predicted = FiniteSlopeLeastSquares(basis, layout).predicted(c)

    expected = readings_of(basis, layout, c)
    np.testing.assert_allclose(predicted[layout.live], expected[layout.live], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["flat", "disk, clamped", "half round", "saddle, clamped"])
@pytest.mark.parametrize("slope", [0.05, 1.0])
def test_the_covariance_is_that_of_the_problem_linearised_at_the_solution(name, slope):
    basis, layout = skin_of(name)
    W = np.eye(basis.size) if basis.free is None else basis.free
    sigma = np.random.default_rng(2).uniform(0.1, 0.4, layout.live.shape)
    c, h = smooth_shape(basis, slope), 1e-6 * 0.01

    answer = FiniteSlopeLeastSquares(basis, layout, sigma)(readings_of(basis, layout, c))

    def weighted(g):
        at = answer.coefficients + (W @ g).reshape(basis.shape)
        return (readings_of(basis, layout, at) / sigma).ravel()

    J = np.stack([weighted(h * g) - weighted(-h * g) for g in np.eye(W.shape[1])], axis=1) / (2 * h)
    expected = W @ np.linalg.inv(J.T @ J) @ W.T
    scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    np.testing.assert_allclose(answer.covariance / scale, expected / scale, rtol=0, atol=1e-5)


@pytest.mark.parametrize("name", ["flat", "half round"])
def test_error_bars_are_the_spread_of_answers_to_steep_shapes_of_the_functions(name):
    basis, layout = skin_of(name)
    c, rng = smooth_shape(basis, 1.2), np.random.default_rng(3)
    K = readings_of(basis, layout, c) + rng.normal(0, 0.231, (150, *layout.live.shape))
    points = rng.uniform(0.1, 0.9, (40, 2)) * (basis.patch.a, basis.patch.b)

    answer = FiniteSlopeLeastSquares(basis, layout)(K)

    rows = basis.at(points)
    off = (answer.coefficients - c).reshape(len(K), -1) @ rows.T
    assert answer.converged.all()
    assert (answer.steps <= 6).all()
    assert 0.93 <= np.mean(np.abs(off) < 1.96 * answer.sd_of(rows)) <= 0.97
    assert np.mean(answer.noise) == pytest.approx(0.231, rel=0.03)


@pytest.mark.parametrize("name", ["flat", "half round"])
def test_missing_readings_and_dead_elements_cost_no_exactness(name):
    basis, layout = skin_of(name)
    c = smooth_shape(basis, 1.4)
    K = readings_of(basis, layout, c)
    K[:, 20:30], K[1, 70], K[2, 100] = np.nan, np.inf, 1e90

    missing = FiniteSlopeLeastSquares(basis, layout)(K)
    dead = FiniteSlopeLeastSquares(basis, layout.without(range(20, 30)))(np.nan_to_num(K, nan=7.0))

    for answer in (missing, dead):
        assert answer.converged
        assert peak_error(basis, answer.coefficients, c) < 1e-5
    assert (missing.sd > 0).all()


def test_one_channel_kind_may_be_enough():
    basis, layout = skin_of("flat")
    c = smooth_shape(basis, 1.0)
    K = readings_of(basis, layout, c)
    K[1:] = np.nan

    answer = FiniteSlopeLeastSquares(basis, layout)(K)

    assert answer.converged
    assert peak_error(basis, answer.coefficients, c) < 1e-5


def test_what_readings_do_not_determine_is_refused_as_by_least_squares():
    basis, layout = skin_of("half round")
    K = readings_of(basis, layout, smooth_shape(basis, 1.0))
    K[:, 4:] = np.nan
    messages = []
    for kind in (LeastSquares, FiniteSlopeLeastSquares):
        with pytest.raises(RankDeficient) as refused:
            kind(basis, layout)(K)
        messages.append(str(refused.value))
        with pytest.raises(RankDeficient):
            kind(basis_for(basis.patch, "hinged", 30, 30), layout)

    assert messages[0] == messages[1]


@pytest.mark.parametrize("told", [1e-60, 1e-8, 1e8, 1e60])
def test_a_told_noise_of_any_size_changes_the_error_bars_alone(told):
    basis, layout = skin_of("half round")
    K = readings_of(basis, layout, smooth_shape(basis, 1.2))
    K += np.random.default_rng(4).normal(0, 0.231, K.shape)

    answer, one = (FiniteSlopeLeastSquares(basis, layout, s)(K) for s in (told, 1.0))

    scale = np.abs(one.coefficients).max()
    np.testing.assert_allclose(answer.coefficients, one.coefficients, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(answer.sd, told * one.sd, rtol=1e-6)


@pytest.mark.parametrize("signal", [1e-300, 1e-30, 1e-9])
@pytest.mark.parametrize("name", ["flat", "half round"])
def test_next_to_no_signal_is_least_squares(name, signal):
    basis, layout = skin_of(name)
    K = signal * np.random.default_rng(5).normal(size=layout.live.shape)

    answer, plain = FiniteSlopeLeastSquares(basis, layout)(K), LeastSquares(basis, layout)(K)

    # On a bent skin readings are known to the rounding of its curvature at rest.
    rounding = 1e-14 * basis.patch.arc_curvature * np.abs(plain.unit_sd).max()
    scale = np.abs(plain.coefficients).max()
    np.testing.assert_allclose(
        answer.coefficients, plain.coefficients, rtol=0, atol=1e-6 * scale + 10 * rounding
    )


@pytest.mark.parametrize("steepness", [1, 2, 3, 4, 6, 10, 30])
def test_steep_skins_are_solved_or_the_linear_answer_is_given_and_said_to_be(steepness):
    basis = SineBasis(SQUARE, 4, 4)
    c = np.zeros((4, 4))
    c[0, 0], c[1, 2] = 4.7e-3 * steepness, 1e-3 * steepness
    K = on_a_slope(basis, c)

    answer, plain = FiniteSlopeLeastSquares(basis, TENS)(K), LeastSquares(basis, TENS)(K)

    off = np.abs(answer.coefficients - c).max() / np.abs(c).max()
    if answer.converged:
        assert off < 1e-5
    else:
        np.testing.assert_array_equal(answer.coefficients, plain.coefficients)
        assert steepness >= 10


def test_noise_ten_times_the_signal_does_not_run_away():
    rng = np.random.default_rng(0)
    K = Case("centre").K + rng.normal(0, 22.0, (200, 3, 100))

    answer, plain = FiniteSlopeLeastSquares(EIGHT, TENS)(K), LeastSquares(EIGHT, TENS)(K)

    assert np.abs(answer.coefficients).max() < 2 * np.abs(plain.coefficients).max()
    gave_up = ~answer.converged
    np.testing.assert_array_equal(answer.coefficients[gave_up], plain.coefficients[gave_up])


@pytest.mark.parametrize("name", ["flat", "half round", "arc"])
@pytest.mark.parametrize("size", [1e3, 1e6, 1e30, 1e70])
def test_readings_of_no_surface_are_answered_as_by_least_squares_and_said_to_be(name, size):
    basis, layout = skin_of(name)
    K = size * np.random.default_rng(6).normal(size=(5, *layout.live.shape))

    answer, plain = FiniteSlopeLeastSquares(basis, layout)(K), LeastSquares(basis, layout)(K)

    lost = ~answer.converged
    assert lost.all()
    assert (answer.steps == 6).all()
    np.testing.assert_array_equal(answer.coefficients, plain.coefficients)
    np.testing.assert_array_equal(answer.unit_sd, plain.unit_sd)
    assert (answer.noise > 0.5 * plain.noise).all()
    assert answer.warnings == ("no convergence in 5 of 5 frames; least squares shown",)


# Other readings than xx, yy and xy of every element.

ROSETTE = ["curvature@0", "curvature@60", "curvature@120"]
OTHERS = {
    "rosettes": lambda layout: layout.reading_each(ROSETTE),
    "oblique gages and twist": lambda layout: layout.reading_each(["curvature@30", "twist"]),
    "one gage": lambda layout: layout.reading_each(["curvature@20"]),
    "a mix": lambda layout: layout.reading_each(["height", "slope@40", "curvature@-50", "twist"]),
    "heights and slopes": lambda layout: layout.reading_each(["slope@0", "slope@90", "height"]),
    "anything anywhere": lambda layout: layout.reading(
        np.random.default_rng(8).integers(0, len(layout), 400),
        np.random.default_rng(9).choice(["height", "slope", "curvature", "twist"], 400),
        np.random.default_rng(10).uniform(-4, 9, 400),
    ),
}
SD = {"height": 1e-5, "slope": 1e-3, "curvature": 0.2, "twist": 0.2}
BENT = ["flat", "flat, clamped", "half round, clamped", "slightly bent", "saddle, clamped"]
every_other = pytest.mark.parametrize("kind", OTHERS)


def other_skin(name, kind):
    basis, layout = skin_of(name)
    return basis, OTHERS[kind](layout)


def read_of(basis, layout, c):
    """The readings (R,) of the skin in space, and their standard deviations."""
    skin, reads = in_space(basis, c), layout.reads
    x, y = layout.positions[reads.element].T
    each = {q: skin.read(q, x, y, reads.direction) for q in set(reads.quantity.tolist())}
    return (
        np.array([each[q][r] for r, q in enumerate(reads.quantity)]),
        np.array([SD[q] for q in reads.quantity]),
    )


CAPS = {"sphere": Cap(0.016, 1.2), "spheroid": Cap(0.016, 1.2, 1.5)}


@pytest.mark.parametrize("kind", ["rosettes", "one gage", "xx, yy and xy"])
@pytest.mark.parametrize("name", CAPS)
def test_readings_of_a_cap_change_as_its_jacobian_has_it_and_give_the_shape_back(name, kind):
    basis = basis_for(CAPS[name], "hinged", 4, 5)
    layout = SensorLayout.regular(CAPS[name], 14, 12)
    layout = OTHERS[kind](layout) if kind in OTHERS else layout
    c = np.random.default_rng(1).normal(size=basis.shape) * 2e-4
    fit, sensed = FiniteSlopeLeastSquares(basis, layout), NormalCurvature(basis, layout)
    steps = 1e-7 * np.eye(basis.size).reshape(-1, *basis.shape)
    by_differences = (sensed(c + steps) - sensed(c - steps)).reshape(basis.size, -1) / 2e-7

    jacobian = np.einsum("qr,qrn->nr", sensed.surface(c.ravel()).jacobian(), sensed.maps)

    assert 0.3 < np.max(sensed.surface(c.ravel()).slope) < 1.4
    np.testing.assert_allclose(jacobian, by_differences, atol=1e-6 * np.abs(jacobian).max())
    first = layout.operator(basis) @ c.ravel()
    small = sensed(1e-5 * c).ravel()
    np.testing.assert_allclose(small, 1e-5 * first, atol=1e-9 * np.abs(first).max())
    answer = fit(sensed(c))
    assert answer.converged
    assert peak_error(basis, answer.coefficients, c) < 1e-5


@every_other
@pytest.mark.parametrize("name", BENT)
def test_any_readings_are_predicted_as_the_surface_in_space_has_them(name, kind):
    basis, layout = other_skin(name, kind)
    c = smooth_shape(basis, 0.8)
    expected, sigma = read_of(basis, layout, c)

    predicted = FiniteSlopeLeastSquares(basis, layout, sigma).predicted(c)

    np.testing.assert_allclose(predicted / sigma, expected / sigma, rtol=1e-9, atol=1e-7)


@every_other
@pytest.mark.parametrize("slope", [0.3, 1.0])
@pytest.mark.parametrize("name", BENT)
def test_steep_skins_come_back_from_any_readings(name, slope, kind):
    basis, layout = other_skin(name, kind)
    c = smooth_shape(basis, slope)
    K, sigma = read_of(basis, layout, c)
    K[[3, 77]] = np.nan

    answer = FiniteSlopeLeastSquares(basis, layout, sigma)(K)

    assert answer.converged
    assert peak_error(basis, answer.coefficients, c) < 1e-5
    assert np.array_equal(np.isnan(answer.residual), np.isnan(K))
    plain = LeastSquares(basis, layout, sigma)(K)
    wrong = peak_error(basis, plain.coefficients, c)
    assert wrong < 1e-9 if kind == "heights and slopes" else wrong > 1e-3


@pytest.mark.cases(
    "flat-a mix",
    "saddle, clamped-anything",
    "half round, clamped-oblique",
    "flat-rosettes",
    "half round, clamped-one",
    "saddle, clamped-heights",
)
@every_other
@pytest.mark.parametrize("name", ["flat", "half round, clamped", "saddle, clamped"])
def test_the_covariance_of_any_readings_is_that_of_the_linearised_problem(name, kind):
    basis, layout = other_skin(name, kind)
    W = np.eye(basis.size) if basis.free is None else basis.free
    c, h = smooth_shape(basis, 0.8), 1e-8
    K, sigma = read_of(basis, layout, c)

    answer = FiniteSlopeLeastSquares(basis, layout, sigma)(K)

    def weighted(g):
        return read_of(basis, layout, answer.coefficients + (W @ g).reshape(basis.shape))[0] / sigma

    J = np.stack([weighted(h * g) - weighted(-h * g) for g in np.eye(W.shape[1])], axis=1) / (2 * h)
    expected = W @ np.linalg.inv(J.T @ J) @ W.T
    scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    np.testing.assert_allclose(answer.covariance / scale, expected / scale, rtol=0, atol=1e-5)


@pytest.mark.cases("flat-a mix", "half round, clamped-anything")
@pytest.mark.parametrize("kind", ["rosettes", "a mix", "anything anywhere"])
@pytest.mark.parametrize("name", ["flat", "half round, clamped"])
def test_error_bars_of_any_readings_hold_95_percent_and_so_with_a_free_datum(name, kind):
    basis, layout = other_skin(name, kind)
    c, rng = smooth_shape(basis, 1.0), np.random.default_rng(11)
    K, sigma = read_of(basis, layout, c)
    K = K + rng.normal(size=(150, K.size)) * sigma
    quantity = "curvature" if kind == "rosettes" else "height"
    layout = replace(layout, reads=replace(layout.reads, free=(quantity,)))
    moved = K + 5 * sigma * (layout.reads.quantity == quantity)

    answer, other = (FiniteSlopeLeastSquares(basis, layout, sigma)(each) for each in (K, moved))

    off = (answer.coefficients - c)[:, *np.nonzero(np.abs(c))] / answer.sd[
        :, *np.nonzero(np.abs(c))
    ]
    assert answer.converged.all()
    assert 0.93 <= np.mean(np.abs(off) < 1.96) <= 0.97
    scale = np.abs(c).max()
    np.testing.assert_allclose(other.coefficients, answer.coefficients, rtol=0, atol=1e-3 * scale)
    chi = np.sum((answer.residual / sigma) ** 2, axis=1) / answer.spare
    assert np.mean(chi) == pytest.approx(1, abs=0.03)


# What a method that neglects slopes says.

LINEAR = [name for name, method in METHODS.items() if method.linear]
NOISE = 0.02


def dent(slope, seed=0):
    """Coefficients of a dent on the flat skin with this largest slope, and its noisy readings."""
    rng = np.random.default_rng(seed)
    c = Plate(SQUARE).deflection([PointLoad(*rng.uniform(0.03, 0.07, 2))], EIGHT)
    c *= slope / LeastSquares(EIGHT, TENS).slope(c)
    return c, on_a_slope(EIGHT, c) + rng.normal(0, NOISE, (3, 100))


def test_all_methods_but_one_neglect_slopes():
    assert [name for name in METHODS if name not in LINEAR] == ["finite-slope"]


@pytest.mark.parametrize("method", LINEAR)
def test_linear_methods_say_what_steep_skins_lose(method):
    _, K = dent(0.43)

    answer = estimator_for(method, EIGHT, TENS)(K)

    (words,) = answer.warnings
    assert re.fullmatch(
        r"slopes reach 0\.(39|4|41): up to [89] % too flat; use finite-slope", words
    )
    assert 0.385 < answer.neglected_slope < 0.415


def test_a_method_that_knows_slopes_says_nothing_of_them():
    answer = FiniteSlopeLeastSquares(EIGHT, TENS)(dent(1.4)[1])

    assert (answer.warnings, answer.neglected_slope) == ((), 0.0)


@pytest.mark.parametrize(
    ("slope", "words"),
    [
        (0.0, ""),
        (0.02, "slopes reach 0.02: up to 0.02 % too flat; use finite-slope"),
        (0.1, "slopes reach 0.1: up to 0.5 % too flat; use finite-slope"),
        (0.3, "slopes reach 0.3: up to 5 % too flat; use finite-slope"),
        (0.4, "slopes reach 0.4: up to 8 % too flat; use finite-slope"),
        (0.8, "slopes reach 0.8: up to 40 % too flat; use finite-slope"),
        (3.0, "slopes reach 3: up to 100 % too flat; use finite-slope"),
    ],
)
def test_the_share_is_by_how_much_a_sine_is_less_than_its_tangent(slope, words):
    assert slope_warning(slope) == words


@pytest.mark.parametrize("name", ["flat", "half round", "slightly bent", "strip"])
@pytest.mark.parametrize("slope", [0.3, 0.5, 0.8])
def test_no_dent_loses_more_than_is_said(name, slope):
    basis, layout = skin_of(name)
    fit = LeastSquares(basis, layout)
    w, lost = basis.on_grid(*basis.patch.grid(41, 41)), []
    for place in np.random.default_rng(7).uniform(0.25, 0.75, (20, 2)):
        c = dent_at(fit, place, slope)

        answer = fit(readings_of(basis, layout, c))

        top = np.argmax(np.abs(w(c)))
        said = 1 - np.sqrt(1 - fit.slope(answer.coefficients) ** 2)
        lost.append((1 - w(answer.coefficients).flat[top] / w(c).flat[top]) / said)
    assert max(lost) < 1
    assert np.median(lost) > 0.2


def test_slopes_matter_from_three_tenths_on_or_where_their_square_exceeds_the_error_bar():
    fit = LeastSquares(EIGHT, TENS)
    for slope in (0.02, 0.05, 0.1, 0.2, 0.28, 0.35):
        _, K = dent(slope)
        for sigma in (1e-4, 0.02, 0.5, 10.0):
            exact = LeastSquares(EIGHT, TENS, sigma)(K)
            error = np.linalg.norm(exact.sd) / np.linalg.norm(exact.coefficients)
            steepest = fit.slope(exact.coefficients)

            said = exact.neglected_slope

            assert said in (0.0, pytest.approx(steepest))
            assert bool(said) == (steepest >= 0.3 or steepest**2 > error)
    assert fit(1e-3 * dent(0.1)[1]).warnings == ()  # of a slope of 1e-4


@pytest.mark.parametrize("name", SKINS)
def test_the_largest_slope_is_found(name):
    basis, layout = skin_of(name)
    fit = LeastSquares(basis, layout)

    assert fit.slope(smooth_shape(basis, 0.7)) == pytest.approx(0.7, rel=0.05)
    assert fit.slope(np.full(basis.shape, np.nan)) == 0
    assert fit.slope(np.zeros(basis.shape)) == 0


def test_of_many_frames_it_is_the_steepest_that_matters():
    frames = np.stack([dent(slope, seed=3)[1] for slope in (0.01, 0.5, 0.3)])
    frames[2, :, 40] = np.nan

    fits = LeastSquares(EIGHT, TENS)
    assert fits(frames).neglected_slope == pytest.approx(fits(frames[1]).neglected_slope)
    assert fits(frames[:0]).warnings == ()


def test_readings_of_any_size_are_warned_of_without_a_hitch():
    for size in (0.0, 1e-90, 1e-30, 1e30, 1e70):
        for method in LINEAR:
            answer = estimator_for(method, EIGHT, TENS)(size * dent(0.4)[1])
            assert len(answer.warnings) == int(size > 1) + int(not answer.converged)
