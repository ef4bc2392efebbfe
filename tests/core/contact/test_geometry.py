"""The skin's local geometry, against closed forms, finite differences and the laws of surfaces."""

import math
from dataclasses import dataclass, fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import (
    LeastSquares,
    Patch,
    Pipeline,
    Refusal,
    SensorLayout,
    Setup,
    Simulator,
    SineBasis,
    basis_for,
    load_scene,
    local_geometry,
)
from kappaskin.bases import ORDERS
from kappaskin.contact import CurvatureFormMap, surface_geometry
from kappaskin.estimation.fit import DenseUncertainty
from kappaskin.skin import Base, Cap
from navier import HingedPlate, Load

FLAT = Patch(0.1, 0.08)
BENT = Patch(0.1, 0.08, 0.045)
SADDLE = Patch(0.1, 0.08, (0.25, -0.3))
HERE = np.array([[0.031, 0.052], [0.07, 0.01], [0.05, 0.04], [0.0, 0.08]])


class Turned:
    """A patch with its coordinates turned by `angle` around its middle."""

    def __init__(self, patch, angle):
        self._patch, (c, s) = patch, (math.cos(angle), math.sin(angle))
        self._middle, self._turn = np.array([patch.a, patch.b]) / 2, np.array([[c, -s], [s, c]])

    def _turned(self, positions):
        return self._middle + (positions - self._middle) @ self._turn.T

    def at_rest(self, positions):
        return self._patch.at_rest(self._turned(positions))

    def base(self, x, y):
        base = self._patch.base(*np.moveaxis(self._turned(np.stack([x, y], axis=-1)), -1, 0))
        turn, (p, q, r) = self._turn, base.curvature
        (xx, xy), (_, yy) = turn.T @ np.array([[p, r], [r, q]]) @ turn
        axes = np.array(np.broadcast_arrays(*base.along, *base.across)).reshape(2, 3, *np.shape(x))
        along, across = np.tensordot(turn.T, axes, 1)
        return Base(base.point, tuple(along), tuple(across), base.normal, (xx, yy, xy))


TURNED = Turned(BENT, 0.4)
BALL = Cap(0.045, 1.2)
SIDES = np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])


@dataclass
class Surface:
    """One function on a patch, by its derivatives: f, f_x, f_y, f_xx, f_xy, f_yy."""

    patch: Patch
    values: object
    shape = (1, 1)

    def at(self, positions, dx=0, dy=0):
        found = self.values(*positions.T)[ORDERS.index((dx, dy))]
        return np.broadcast_to(found, len(positions))[:, None]

    def jet(self, x, y):
        return np.array(self.values(x, y))[:, None]

    def geometry(self, positions):
        return surface_geometry(
            self,
            np.ones((1, 1)),
            positions,
            DenseUncertainty(lambda: np.zeros((1, 1))).covariance_of,
        )


def polynomial(c, angle=0.0, patch=FLAT):
    """sum c_ij u^i v^j, u and v turned by `angle` around the middle of the patch."""
    P = np.polynomial.polynomial
    cos, sin = math.cos(angle), math.sin(angle)

    def jet(x, y):
        x, y = x - 0.05, y - 0.04
        u, v = cos * x + sin * y, -sin * x + cos * y
        f, u1, v1, uu, uv, vv = (
            P.polyval2d(u, v, P.polyder(P.polyder(c, i, axis=0), j, axis=1)) for i, j in ORDERS
        )
        xx = cos**2 * uu - 2 * cos * sin * uv + sin**2 * vv
        yy = sin**2 * uu + 2 * cos * sin * uv + cos**2 * vv
        xy = cos * sin * (uu - vv) + (cos**2 - sin**2) * uv
        return f, cos * u1 - sin * v1, sin * u1 + cos * v1, xx, xy, yy

    return Surface(patch, jet)


def steep(seed, patch=FLAT):
    """A random polynomial of fourth order with slopes up to about 1."""
    scale = 0.01 / 0.04 ** np.add.outer(np.arange(5), np.arange(5))
    return polynomial(scale * np.random.default_rng(seed).normal(size=(5, 5)), patch=patch)


def sine_surface(patch, seed=0):
    basis = SineBasis(patch, 4, 3)
    c = np.random.default_rng(seed).normal(0, 0.004, (4, 3)) / np.add.outer(range(1, 5), range(3))
    return basis, c


def dome(R):
    """The top of a sphere of radius R around the middle of the patch."""

    def jet(x, y):
        x, y = x - 0.05, y - 0.04
        q = np.sqrt(R**2 - x**2 - y**2)
        xx, yy, xy = 1 / q + x**2 / q**3, 1 / q + y**2 / q**3, x * y / q**3
        return R - q, x / q, y / q, xx, xy, yy

    return Surface(FLAT, jet)


def trough(R, angle):
    """A cylinder of radius R pressed in, which bends along `angle` from x."""

    def jet(x, y):
        c, s = math.cos(angle), math.sin(angle)
        u = c * (x - 0.05) + s * (y - 0.04)
        q = np.sqrt(R**2 - u**2)
        slope, bend = -u / q, -(R**2) / q**3
        return q - R, c * slope, s * slope, c**2 * bend, c * s * bend, s**2 * bend

    return Surface(FLAT, jet)


def test_a_sphere_curves_alike_everywhere_in_every_direction():
    geometry = dome(0.09).geometry(HERE)

    np.testing.assert_allclose(geometry.principal, 1 / 0.09, rtol=1e-13)
    np.testing.assert_allclose(geometry.mean, 1 / 0.09, rtol=1e-13)
    np.testing.assert_allclose(geometry.gaussian, 1 / 0.09**2, rtol=1e-13)
    centre = np.array([0.05, 0.04, -0.09])
    np.testing.assert_allclose(geometry.normal, (geometry.position - centre) / 0.09, atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2, 2.5])
def test_a_trough_curves_across_its_axis_only_and_is_concave(angle):
    geometry = trough(0.09, angle).geometry(HERE)

    np.testing.assert_allclose(geometry.principal, [[0, -1 / 0.09]] * 4, atol=1e-12)
    axis = np.array([-math.sin(angle), math.cos(angle), 0.0])
    np.testing.assert_allclose(np.abs(geometry.directions[:, 0] @ axis), 1, rtol=1e-13)
    np.testing.assert_allclose(geometry.directions[:, 1] @ axis, 0, atol=1e-13)


def test_a_bent_skin_at_rest_has_the_curvature_of_its_base():
    geometry = polynomial(np.zeros((1, 1)), patch=BENT).geometry(HERE)

    np.testing.assert_allclose(geometry.curvature_form, [[[1 / 0.045, 0], [0, 0]]] * 4, atol=1e-13)
    np.testing.assert_allclose(geometry.metric, [np.eye(2)] * 4, atol=1e-15)
    np.testing.assert_allclose(geometry.torsion_form, 0, atol=1e-15)
    points, normals = BENT.at_rest(HERE)
    np.testing.assert_allclose(geometry.position, points, atol=1e-15)
    np.testing.assert_allclose(geometry.normal, normals, atol=1e-15)


def test_a_bent_skin_pressed_in_everywhere_is_a_narrower_cylinder():
    geometry = polynomial(np.full((1, 1), 0.005), patch=BENT).geometry(HERE)

    np.testing.assert_allclose(geometry.principal, [[1 / 0.040, 0]] * 4, atol=1e-12)
    np.testing.assert_allclose(geometry.metric[:, 0, 0], 40 / 45, rtol=1e-14)


def test_a_flat_skin_is_the_limit_of_a_bent_one():
    bent = steep(0, Patch(0.1, 0.08, 1e7)).geometry(HERE)
    flat = steep(0, FLAT).geometry(HERE)

    for field in fields(flat):
        np.testing.assert_allclose(
            getattr(bent, field.name), getattr(flat, field.name), rtol=1e-5, atol=1e-7
        )


def test_with_slight_slopes_the_curvature_form_is_that_of_equations_3_to_5():
    basis, c = sine_surface(FLAT)
    c = 1e-4 * c

    K = surface_geometry(
        basis, c, HERE, DenseUncertainty(lambda: np.zeros((12, 12))).covariance_of
    ).curvature_form

    for (i, j), order in {(0, 0): (2, 0), (1, 1): (0, 2), (0, 1): (1, 1), (1, 0): (1, 1)}.items():
        np.testing.assert_allclose(K[:, i, j], basis.at(HERE, *order) @ c.ravel(), atol=1e-8)


@given(st.integers(0, 10**6))
def test_mean_and_gaussian_curvature_are_those_of_a_graph(seed):
    surface = steep(seed)
    geometry = surface.geometry(HERE)

    _, fx, fy, fxx, fxy, fyy = surface.values(*HERE.T)
    W = np.sqrt(1 + fx**2 + fy**2)
    mean = ((1 + fy**2) * fxx - 2 * fx * fy * fxy + (1 + fx**2) * fyy) / (2 * W**3)
    scale = np.abs(geometry.principal).max() + 1
    np.testing.assert_allclose(geometry.mean, mean, atol=1e-12 * scale)
    np.testing.assert_allclose(
        geometry.gaussian, (fxx * fyy - fxy**2) / W**4, atol=1e-12 * scale**2
    )
    np.testing.assert_allclose(geometry.principal.mean(axis=1), geometry.mean, rtol=1e-12)
    np.testing.assert_allclose(
        geometry.principal.prod(axis=1), geometry.gaussian, atol=1e-12 * scale**2
    )


def by_differences(surface, x, y, h=2e-5):
    """Frame, metric, K and T at a point from positions alone, by central differences."""

    def position(x, y):
        point, normal = surface.patch.at_rest(np.array([x, y]))
        return point - float(surface.values(x, y)[0]) * normal

    def frame(x, y):
        rx = (position(x + h, y) - position(x - h, y)) / (2 * h)
        ry = (position(x, y + h) - position(x, y - h)) / (2 * h)
        n = np.cross(rx, ry) / np.linalg.norm(np.cross(rx, ry))
        first = rx
        if isinstance(surface.patch, Cap):  # along the axis that elements read by
            rest = [surface.patch.at_rest(np.array([x, y]) + h * e)[0] for e in SIDES]
            steps = np.stack([rest[0] - rest[1], rest[2] - rest[3]], axis=1) / (2 * h)
            axis = surface.patch.base(x, y).frame[0]
            first = np.column_stack([rx, ry]) @ np.linalg.lstsq(steps, axis)[0]
        first = first / np.linalg.norm(first)
        return np.array([first, np.cross(n, first), n]), np.column_stack([rx, ry])

    E, r = frame(x, y)
    metric = E[:2] @ r
    along_x = (frame(x + h, y)[0] - frame(x - h, y)[0]) / (2 * h)
    along_y = (frame(x, y + h)[0] - frame(x, y - h)[0]) / (2 * h)
    K = E[:2] @ np.column_stack([along_x[2], along_y[2]]) @ np.linalg.inv(metric)
    T = E[1] @ np.column_stack([along_x[0], along_y[0]]) @ np.linalg.inv(metric)
    return E, metric, K, T


@pytest.mark.parametrize(
    ("patch", "place"),
    [
        (FLAT, (0.061, 0.033)),
        (BENT, (0.061, 0.033)),
        (TURNED, (0.061, 0.033)),
        (SADDLE, (0.05, 0.04)),
        (Turned(SADDLE, 0.4), (0.05, 0.04)),
        (BALL, (0.071, 0.033)),
        (BALL, (0.054, 0.054)),
    ],
    ids=["flat", "bent", "askew", "saddle", "saddle askew", "cap", "pole"],
)
@pytest.mark.parametrize("seed", range(5))
def test_frame_metric_and_forms_are_what_montana_defines(patch, place, seed):
    surface, (x, y) = steep(seed, patch), place

    ours = surface.geometry(np.array([x, y]))

    E, metric, K, T = by_differences(surface, x, y)
    size = np.abs(K).max()
    np.testing.assert_allclose(ours.frame, E, atol=1e-5)
    np.testing.assert_allclose(ours.metric, metric, atol=1e-5)
    np.testing.assert_allclose(ours.curvature_form, K, atol=1e-4 * size)
    np.testing.assert_allclose(ours.torsion_form, T, atol=1e-4 * size)
    assert np.linalg.det(ours.frame) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("patch", [FLAT, BENT], ids=["flat", "bent"])
def test_the_fundamental_forms_are_those_of_the_derivatives(patch):
    surface = steep(3, patch)
    geometry = surface.geometry(HERE)

    _, metric, K, _ = by_differences(surface, *HERE[0])
    np.testing.assert_allclose(geometry.first_form[0], metric.T @ metric, atol=1e-5)
    np.testing.assert_allclose(
        geometry.second_form[0], metric.T @ K @ metric, atol=1e-4 * np.abs(K).max()
    )
    np.testing.assert_allclose(geometry.second_form, geometry.second_form.swapaxes(1, 2))


@given(st.integers(0, 10**6), st.floats(-math.pi, math.pi))
def test_turning_the_coordinates_turns_the_directions_and_nothing_else(seed, angle):
    c = np.random.default_rng(seed).normal(size=(4, 4)) * 0.01
    c /= 0.04 ** np.add.outer(np.arange(4), np.arange(4))
    middle, out = np.array([0.05, 0.04]), np.array([[0.012, -0.007], [-0.02, 0.01]])
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])

    plain = polynomial(c).geometry(middle + out)
    turned = polynomial(c, angle).geometry(middle + out @ turn.T)

    scale = np.abs(plain.principal).max()
    np.testing.assert_allclose(turned.principal, plain.principal, atol=1e-10 * scale)
    np.testing.assert_allclose(turned.mean, plain.mean, atol=1e-10 * scale)
    np.testing.assert_allclose(turned.gaussian, plain.gaussian, atol=1e-10 * scale**2)
    in_space = np.block([[turn, np.zeros((2, 1))], [np.zeros((1, 2)), np.eye(1)]])
    apart = (plain.principal[:, 0] - plain.principal[:, 1]) > 1e-3 * scale
    along = np.einsum("pki,pki->pk", turned.directions, plain.directions @ in_space.T)
    np.testing.assert_allclose(np.abs(along[apart]), 1, atol=1e-6)


@given(st.integers(0, 10**6))
def test_along_a_principal_direction_the_normal_turns_in_that_direction(seed):
    geometry = steep(seed).geometry(HERE)

    in_plane = np.einsum("pki,pji->pkj", geometry.directions, geometry.frame[:, :2])
    turned = np.einsum("pij,pkj->pki", geometry.curvature_form, in_plane)

    scale = np.abs(geometry.principal).max() + 1
    expected = geometry.principal[:, :, None] * in_plane
    np.testing.assert_allclose(turned, expected, atol=1e-10 * scale)


@pytest.mark.parametrize("patch", [FLAT, BENT], ids=["flat", "bent"])
def test_the_curl_of_the_torsion_is_the_gaussian_curvature(patch):
    basis, c = sine_surface(patch)
    zero = np.zeros((12, 12))

    def turning(x, y):  # T metric: how the frame spins per step in x and in y
        g = surface_geometry(
            basis, c, np.array([[x, y]]), DenseUncertainty(lambda: zero).covariance_of
        )
        return (g.torsion_form[:, None] @ g.metric)[0, 0]

    h = 1e-5
    for x, y in [(0.031, 0.052), (0.07, 0.015), (0.02, 0.03)]:
        curl = (turning(x + h, y)[1] - turning(x - h, y)[1]) / (2 * h)
        curl -= (turning(x, y + h)[0] - turning(x, y - h)[0]) / (2 * h)
        g = surface_geometry(
            basis, c, np.array([x, y]), DenseUncertainty(lambda: zero).covariance_of
        )
        # Gauss's Theorema Egregium: bending from inside, without a normal.
        assert -curl == pytest.approx(g.gaussian * np.linalg.det(g.metric), rel=1e-4)


@pytest.mark.parametrize("patch", [FLAT, BENT], ids=["flat", "bent"])
def test_gauss_and_bonnet_hold_around_a_rectangle(patch):
    basis, c = sine_surface(patch, 1)
    t, w = np.polynomial.legendre.leggauss(40)
    (x0, x1), (y0, y1) = (0.013, 0.078), (0.009, 0.069)
    x, wx = x0 + (t + 1) / 2 * (x1 - x0), w / 2 * (x1 - x0)
    y, wy = y0 + (t + 1) / 2 * (y1 - y0), w / 2 * (y1 - y0)

    def at(x, y):
        positions = np.stack(np.broadcast_arrays(x, y), axis=-1).reshape(-1, 2)
        return surface_geometry(
            basis, c, positions, DenseUncertainty(lambda: np.zeros((12, 12))).covariance_of
        )

    def spin(geometry, axis):
        return np.einsum("pi,pi->p", geometry.torsion_form, geometry.metric[:, :, axis])

    around = wx @ (spin(at(x, y0), 0) - spin(at(x, y1), 0))
    around += wy @ (spin(at(x1, y), 1) - spin(at(x0, y), 1))

    inside = at(*np.meshgrid(x, y, indexing="ij"))
    total = np.multiply.outer(wx, wy).ravel() @ (inside.gaussian * np.linalg.det(inside.metric))
    assert -around == pytest.approx(total, rel=1e-9)
    assert abs(total) > 0.005


def test_an_umbilic_point_has_directions_and_error_bars():
    basis = SineBasis(FLAT, 3, 3)
    flat = surface_geometry(
        basis, np.zeros((3, 3)), HERE[:3], DenseUncertainty(lambda: np.eye(9)).covariance_of
    )

    for values in (flat.principal, flat.principal_sd, flat.directions, flat.angle, flat.mean_sd):
        assert np.isfinite(values).all()
    assert (flat.principal_sd > 0).all()
    np.testing.assert_allclose(flat.directions @ flat.directions.swapaxes(1, 2), [np.eye(2)] * 3)


@pytest.mark.parametrize("patch", [BENT, BALL], ids=["bent", "cap"])
def test_one_point_and_many_points_are_answered_alike(patch):
    basis, c = sine_surface(BENT)
    if patch is BALL:
        basis = basis_for(BALL, "hinged", 4, 3)
    covariance = np.diag(np.linspace(1, 2, 12)) * 1e-8

    places = HERE[:3]
    many = surface_geometry(basis, c, places, DenseUncertainty(lambda: covariance).covariance_of)

    for p, here in enumerate(places):
        one = surface_geometry(basis, c, here, DenseUncertainty(lambda: covariance).covariance_of)
        for field in fields(one):
            ours, theirs = getattr(one, field.name), getattr(many, field.name)[p]
            assert ours.shape == theirs.shape
            np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12)


def noisy_fits(curvature, layout, draws, noise=0.231):
    fit = LeastSquares(SineBasis(layout.patch, 8, 8), layout)
    rng = np.random.default_rng(0)
    return [fit(curvature + rng.normal(0, noise, curvature.shape)) for _ in range(draws)]


@pytest.mark.parametrize("name", ["mean", "gaussian", "principal"])
def test_the_error_bars_are_the_scatter_of_noisy_shapes(name):
    layout, here = SensorLayout.regular(Patch(0.1, 0.1), 10, 10), np.array([0.066, 0.047])
    K = HingedPlate().readings(Load(0.06, 0.045, 0.2), layout.positions)

    fits = noisy_fits(K, layout, 2500)

    all_of = [local_geometry(fit, here) for fit in fits]

    values = np.array([getattr(g, name) for g in all_of])
    # What 8 x 8 functions leave of the shape counts as noise: bars are for as much as was found.
    share = [0.231 / fit.noise for fit in fits]
    told = np.array([getattr(g, f"{name}_sd") for g in all_of]).T @ share / len(fits)
    # The standard error of a standard deviation over 2500 draws is 1.4 %.
    np.testing.assert_allclose(values.std(axis=0), told, rtol=0.05)
    without_noise = getattr(local_geometry(*noisy_fits(K, layout, 1, noise=0.0), here), name)
    np.testing.assert_allclose(values.mean(axis=0), without_noise, atol=0.1 * told.min())


@pytest.mark.parametrize("patch", [FLAT, BENT, SADDLE], ids=["flat", "bent", "saddle"])
def test_the_error_bars_are_those_of_how_the_curvature_changes_with_each_coefficient(patch):
    basis, c = sine_surface(patch)
    step = 1e-7

    def form(shape):
        unsure = DenseUncertainty(lambda: np.zeros((12, 12))).covariance_of
        K = surface_geometry(basis, shape, HERE[:3], unsure).curvature_form
        return np.stack([K[:, 0, 0], K[:, 1, 1], K[:, 0, 1]], axis=-1)

    changes = [
        (form(c + step * one.reshape(4, 3)) - form(c - step * one.reshape(4, 3))) / (2 * step)
        for one in np.eye(12)
    ]
    told = surface_geometry(
        basis, c, HERE[:3], DenseUncertainty(lambda: np.eye(12)).covariance_of
    ).covariance

    expected = np.einsum("npi,npj->pij", changes, changes)
    np.testing.assert_allclose(told, expected, rtol=1e-6, atol=1e-6 * expected.max())
    assert np.abs(form(c)).max() > 10  # steep enough for every term to count


@pytest.mark.parametrize(
    "patch", [TURNED, Turned(SADDLE, 0.4), BALL], ids=["bent", "saddle", "cap"]
)
def test_the_error_bars_hold_along_axes_that_are_not_those_of_the_base(patch):
    surface, step = steep(3, patch), np.array([1e-6, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3])
    jet = np.array(surface.values(0.061, 0.033))

    def form(jet):
        return Surface(patch, lambda x, y: jet).geometry(np.array([0.061, 0.033])).curvature_form

    changes = [(form(jet + d) - form(jet - d)).ravel()[[0, 3, 1]] / 2 for d in np.diag(step)]
    told = surface_geometry(
        surface, np.ones((1, 1)), np.array([0.061, 0.033]), lambda rows: np.diag(step**2)
    ).covariance

    expected = np.transpose(changes) @ changes
    np.testing.assert_allclose(told, expected, rtol=1e-6, atol=1e-6 * expected.max())


def test_a_dome_at_rest_has_its_own_curvature_and_pressed_in_evenly_a_greater_one():
    dome = Patch(0.1, 0.08, (0.25, 0.4))
    pressed = polynomial(np.full((1, 1), 0.005), patch=dome).geometry(HERE)
    rest = polynomial(np.zeros((1, 1)), patch=dome).geometry(HERE)

    flat = Surface(dome, lambda x, y: np.zeros(6))
    forms = [by_differences(flat, *place)[2] for place in HERE]
    np.testing.assert_allclose(rest.curvature_form, forms, atol=1e-6)
    np.testing.assert_allclose(forms[2], np.diag([4, 2.5]), atol=1e-6)  # in the middle
    points, normals = dome.at_rest(HERE)
    np.testing.assert_allclose(rest.position, points, atol=1e-15)
    np.testing.assert_allclose(rest.normal, normals, atol=1e-15)
    np.testing.assert_allclose(pressed.curvature_form[2], np.diag([1 / 0.245, 1 / 0.395]))
    np.testing.assert_allclose(pressed.position, points - 0.005 * normals, atol=1e-15)


def test_a_cap_at_rest_has_its_own_curvature_and_pressed_in_evenly_a_greater_one():
    rest = polynomial(np.zeros((1, 1)), patch=BALL).geometry(HERE[:3])
    pressed = polynomial(np.full((1, 1), 0.005), patch=BALL).geometry(HERE[:3])

    np.testing.assert_allclose(rest.curvature_form, [np.eye(2) / 0.045] * 3, atol=1e-12)
    np.testing.assert_allclose(pressed.curvature_form, [np.eye(2) / 0.040] * 3, atol=1e-12)
    points, normals = BALL.at_rest(HERE[:3])
    np.testing.assert_allclose(pressed.position, points - 0.005 * normals, atol=1e-15)
    np.testing.assert_allclose(pressed.normal, normals, atol=1e-15)
    # Of the sphere: the lengths of the coordinates, which are azimuthal equidistant.
    area = np.linalg.det(rest.metric)
    s = np.linalg.norm(HERE[:3] - BALL.rim_radius, axis=1) / 0.045
    np.testing.assert_allclose(area, np.sin(s) / s, rtol=1e-12)


EGG, STEEPEST = Cap(0.045, 1.2, 1.5), Patch(0.1, 0.08, (0.2, 0.2))


@pytest.mark.parametrize(
    ("patch", "place"),
    [
        (EGG, (EGG.rim_radius + 0.017, EGG.rim_radius - 0.021)),
        (Cap(0.045, 1.2, 0.6), (0.0634, 0.0254)),
        (STEEPEST, (0.097, 0.078)),
        (Patch(0.1, 0.08, (0.25, -0.3)), (0.004, 0.075)),
    ],
    ids=["long", "blunt", "dome", "saddle"],
)
def test_a_skin_pressed_in_slightly_has_the_forms_of_its_surface(patch, place):
    steeper = steep(1, patch)
    surface = Surface(patch, lambda x, y: [0.01 * each for each in steeper.values(x, y)])
    x, y = place

    ours = surface.geometry(np.array([x, y]))

    # Its own curvature changes from place to place, of which the forms neglect f times the change.
    E, metric, K, T = by_differences(surface, x, y)
    np.testing.assert_allclose(ours.frame, E, atol=1e-6)
    np.testing.assert_allclose(ours.metric, metric, atol=1e-6)
    np.testing.assert_allclose(ours.curvature_form, K, atol=1e-4 * np.abs(K).max())
    np.testing.assert_allclose(ours.torsion_form, T, atol=1e-3 * np.abs(K).max())


def test_the_curl_of_the_torsion_of_a_cap_is_the_gaussian_curvature():
    surface, h, (x, y) = steep(1, BALL), 1e-5, (0.071, 0.033)

    def turning(x, y):
        g = surface.geometry(np.array([x, y]))
        return g.torsion_form @ g.metric

    curl = turning(x + h, y)[1] - turning(x - h, y)[1] - turning(x, y + h)[0] + turning(x, y - h)[0]
    g = surface.geometry(np.array([x, y]))
    assert -curl / (2 * h) == pytest.approx(g.gaussian * np.linalg.det(g.metric), rel=1e-4)


@pytest.mark.parametrize("cap", [BALL, Cap(0.045, 1.2, 1.5)], ids=["sphere", "spheroid"])
def test_the_curvature_on_a_grid_of_a_cap_is_that_of_each_of_its_places(cap):
    basis = basis_for(cap, "hinged", 5, 5)
    c = np.random.default_rng(0).normal(0, 3e-4, (5, 5))
    x, y = cap.grid(9, 8)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    on = cap.contains(places)

    form = CurvatureFormMap(basis, x, y)(c).reshape(3, -1)

    told = surface_geometry(basis, c, places[on], lambda rows: np.zeros((len(rows), 6, 6)))
    K = told.curvature_form[:, [0, 1, 0], [0, 1, 1]].T
    np.testing.assert_allclose(form[:, on], K, atol=1e-4 * np.abs(K).max())
    assert np.isnan(form[:, ~on]).all()


def test_readings_that_are_missing_widen_the_error_bars():
    patch = Patch(0.1, 0.1)
    layout = SensorLayout.regular(patch, 10, 10)
    fit = LeastSquares(SineBasis(patch, 8, 8), layout, sigma=0.231)
    K = np.random.default_rng(0).normal(0, 0.231, (3, 100))
    missing = K.copy()
    missing[:, [44, 45, 54, 55]] = np.nan

    here = np.array([0.05, 0.05])

    assert local_geometry(fit(missing), here).mean_sd > 1.1 * local_geometry(fit(K), here).mean_sd


def test_what_is_not_one_frame_or_not_places_is_refused():
    layout = SensorLayout.regular(FLAT, 4, 4)
    fit = LeastSquares(SineBasis(FLAT, 3, 3), layout)

    with pytest.raises(Refusal, match=r"fit of one frame, got .* \(2, 3, 3\)"):
        local_geometry(fit(np.zeros((2, 3, 16))), HERE)
    with pytest.raises(Refusal, match=r"\(P, 2\) in m, got \(3, 3\) and \(3,\)"):
        local_geometry(fit(np.zeros((3, 16))), np.zeros(3))


def test_an_estimate_tells_the_geometry_at_its_contact():
    scene = load_scene("centre")
    pipeline = Pipeline(scene.sensor(), Setup())
    estimate = pipeline(Simulator(scene).frame(0, lambda: 0.0))

    here = local_geometry(pipeline.fit(estimate.curvature), estimate.contact.position)

    np.testing.assert_array_equal(estimate.geometry.curvature_form, here.curvature_form)
    # A push dents the skin: concave as seen from where it comes.
    assert (estimate.geometry.principal < -5).all()
    assert estimate.geometry.position[2] == pytest.approx(-4.65e-3, abs=0.15e-3)
    assert (estimate.geometry.principal_sd < 0.3).all()
    np.testing.assert_allclose(estimate.geometry.normal, [0, 0, 1], atol=0.01)


def test_without_a_contact_there_is_no_geometry():
    scene = load_scene("centre")
    pipeline = Pipeline(scene.sensor(), Setup())
    frame = Simulator(type(scene)("idle", scene.plate, scene.layout)).frame(0, lambda: 0.0)

    geometry = pipeline(frame).geometry

    assert all(np.isnan(getattr(geometry, field.name)).all() for field in fields(geometry))
    assert np.isnan(geometry.principal).all()
    assert np.isnan(geometry.principal_sd).all()
