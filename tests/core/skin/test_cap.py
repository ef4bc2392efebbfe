"""Caps of spheres and spheroids: their geometry against finite differences in space."""

import math

import numpy as np
import pytest

from kappaskin import Cap, Refusal
from kappaskin.skin import Disk, Patch

R = 8e-3
HEMISPHERE = Cap(R)
CAPS = [HEMISPHERE, Cap(R, 1.0), Cap(R, stretch=1.5), Cap(R, 1.2, 0.6)]
STEP = 1e-3 * R


def places(cap, count=40, most=0.97):
    """Places (count, 2) all over a cap; the first is the pole, the second very near it."""
    rng = np.random.default_rng(1)
    s = most * cap.rim_radius * np.sqrt(rng.random(count))
    s[:2] = 0, 1e-7 * cap.rim_radius
    angle = 2 * np.pi * rng.random(count)
    return cap.rim_radius + s[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def f(points):
    """A smooth function of places in space."""
    x, y, z = np.moveaxis(points / R, -1, 0)
    return np.sin(1.3 * x + 0.4) * np.cos(0.9 * y - 0.2) + 0.5 * z * x


def differences(g, at, step):
    """Value, first and second derivatives (6, P) of `g` at `at` (P, 2), of fourth order."""
    ex, ey = step * np.eye(2)

    def first(h, e):
        return lambda p: (8 * (h(p + e) - h(p - e)) - h(p + 2 * e) + h(p - 2 * e)) / (12 * step)

    gx, gy = first(g, ex), first(g, ey)
    each = (g, gx, gy, first(gx, ex), first(gx, ey), first(gy, ey))
    return np.stack([one(at) for one in each])


@pytest.mark.parametrize("cap", CAPS)
def test_a_place_lies_as_far_from_the_pole_as_along_the_meridian(cap):
    s = np.linspace(0, cap.rim_radius, 4001)
    angle = 0.7
    line = cap.rim_radius + s[:, None] * np.array([math.cos(angle), math.sin(angle)])

    points, normals = cap.at_rest(line)

    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(lengths.sum(), cap.rim_radius, rtol=1e-6)
    np.testing.assert_allclose(np.arccos(normals[-1, 2]), cap.angle, rtol=1e-6)
    x, y, z = (points - [cap.a / 2, cap.b / 2, 0]).T
    of_spheroid = (x**2 + y**2) / R**2 + (z / (R * cap.stretch) + 1) ** 2
    np.testing.assert_allclose(of_spheroid, 1, rtol=1e-12)
    np.testing.assert_allclose(-z[-1], cap.rise, rtol=1e-12)


@pytest.mark.parametrize("cap", CAPS)
def test_the_frame_and_the_curvature_are_those_of_the_surface_in_space(cap):
    at = places(cap)
    ex, ey = 1e-5 * R * np.eye(2)
    r_x, r_y, n_x, n_y = (
        (cap.at_rest(at + e)[k] - cap.at_rest(at - e)[k]) / 2e-5 / R
        for k in (0, 1)
        for e in (ex, ey)
    )
    local, (_, normals) = cap.base(*at.T), cap.at_rest(at)

    e_x, e_y = np.moveaxis(local.frame, 1, 0)

    np.testing.assert_allclose(np.cross(e_x, e_y), normals, atol=1e-12)
    np.testing.assert_allclose(
        local.frame @ np.swapaxes(local.frame, 1, 2) - np.eye(2), 0, atol=1e-12
    )
    # The normal's change along a tangent is the form times it: n_t = K t with t in the frame.
    K = np.moveaxis(local.form[[0, 2, 2, 1]].reshape(2, 2, -1), -1, 0)
    for r_t, n_t in ((r_x, n_x), (r_y, n_y)):
        along, change = (np.einsum("pki,pi->pk", local.frame, t) for t in (r_t, n_t))
        np.testing.assert_allclose(change, np.einsum("pij,pj->pi", K, along), atol=1e-6 / R)


@pytest.mark.parametrize("cap", CAPS)
def test_covariant_derivatives_are_those_of_a_function_in_space(cap):
    at = places(cap)
    jet = differences(lambda p: f(cap.at_rest(p)[0]), at, STEP)
    local, (points, normals) = cap.base(*at.T), cap.at_rest(at)

    value, f_x, f_y, xx, xy, yy = np.einsum("pij,jp->ip", local.covariant, jet)

    # The gradient and the Hessian along the surface are those in space, projected; the Hessian
    # less the slope along the normal times the curvature, of the normal outward.
    h = 1e-3 * R
    axes = h * np.eye(3)
    grad = np.stack([(f(points + e) - f(points - e)) / (2 * h) for e in axes], -1)
    hess = np.stack(
        [
            np.stack(
                [
                    (f(points + e + d) - f(points + e - d) - f(points - e + d) + f(points - e - d))
                    / (4 * h**2)
                    for d in axes
                ],
                -1,
            )
            for e in axes
        ],
        -1,
    )
    slopes = np.einsum("pki,pi->pk", local.frame, grad)
    second = local.frame @ hess @ np.swapaxes(local.frame, 1, 2)
    outward = np.einsum("pi,pi->p", normals, grad)
    k_xx, k_yy, k_xy = local.form
    np.testing.assert_allclose(value, f(points), rtol=1e-12)
    np.testing.assert_allclose([f_x, f_y], slopes.T, atol=1e-5 / R)
    np.testing.assert_allclose(xx, second[:, 0, 0] - k_xx * outward, atol=1e-4 / R**2)
    np.testing.assert_allclose(yy, second[:, 1, 1] - k_yy * outward, atol=1e-4 / R**2)
    np.testing.assert_allclose(xy, second[:, 0, 1] - k_xy * outward, atol=1e-4 / R**2)


@pytest.mark.parametrize("cap", CAPS)
def test_the_meridian_changes_as_its_derivatives_have_it(cap):
    s, step = np.linspace(0.02, 0.98, 30) * cap.rim_radius, 1e-4 * R
    here, less, more = (cap.meridian(s + d) for d in (0, -step, step))

    np.testing.assert_allclose(here.slope, (more.radius - less.radius) / (2 * step), atol=1e-7)
    change = (more.curvatures - less.curvatures) / (2 * step)
    np.testing.assert_allclose(here.changes, change, atol=1e-6 / R**2)
    # Codazzi
    k1, k2 = here.curvatures
    np.testing.assert_allclose(
        here.changes[1], here.slope / here.radius * (k1 - k2), atol=1e-9 / R**2
    )


@pytest.mark.parametrize("cap", CAPS)
def test_places_are_the_inverse_of_points_at_rest(cap):
    at = places(cap)
    np.testing.assert_allclose(cap.places(cap.at_rest(at)[0]), at, atol=1e-14)


@pytest.mark.parametrize("cap", CAPS)
def test_offsets_lie_as_far_away_along_the_skin(cap):
    offsets = 0.2 * R * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.6, -0.8]])
    x, y = cap.rim_radius + 0.5 * cap.rim_radius * np.array([0.6, 0.8])

    there = cap.around(x, y, offsets)

    (points, _), (point, _) = cap.at_rest(there), cap.at_rest(np.array([[x, y]]))
    frame = cap.base(x, y).frame
    np.testing.assert_allclose(there[0], [x, y], atol=1e-15)
    sphere = cap.stretch == 1
    chord = 2 * R * math.sin(0.1) if sphere else 0.2 * R
    found = np.linalg.norm(points - point, axis=1)[1:]
    np.testing.assert_allclose(found, chord, rtol=1e-12 if sphere else 0.02)
    ahead = (points - point) @ frame.T
    np.testing.assert_allclose(
        ahead[1:] / np.linalg.norm(ahead[1:], axis=1)[:, None], offsets[1:] / 0.2 / R, atol=0.02
    )


def test_a_wide_cap_is_a_disk():
    cap, disk = Cap(1e6, 5e-8), Disk(0.05)
    np.testing.assert_allclose([cap.a, cap.b], [disk.a, disk.b], rtol=1e-12)
    at = places(cap)
    local = cap.base(*at.T)
    np.testing.assert_allclose(local.covariant, disk.base(*at.T).covariant, atol=1e-8)
    np.testing.assert_allclose(local.frame, disk.base(*at.T).frame, atol=1e-6)


@pytest.mark.parametrize("radius", [0.5, (math.inf, 0.5)], ids=["arc", "trough"])
def test_skins_bent_one_way_have_constant_forms_and_plain_derivatives(radius):
    patch = Patch(0.1, 0.08, radius)
    at = np.array([[0.02, 0.03], [0.07, 0.07]])
    local = patch.base(*at.T)
    np.testing.assert_array_equal(local.form.T, [[*patch.curvatures, 0.0]] * 2)
    np.testing.assert_array_equal(local.covariant, np.stack([np.eye(6)] * 2))


@pytest.mark.parametrize("radii", [(0.2, 0.2), (0.3, -0.2), (-0.2, 1.0)], ids=str)
def test_the_frame_of_a_dome_and_a_saddle_is_that_of_their_surface(radii):
    patch, h = Patch(0.1, 0.08, radii), 1e-4
    place, (e, n) = np.array([0.093, 0.006]), h * np.eye(2)

    def r(*steps):
        return patch.at_rest(place + sum(steps, np.zeros(2)))[0]

    base = patch.base(*place.tolist())
    (e_x, e_y), normal, (xx, yy, xy) = base.frame, np.array(base.normal), base.form

    jet = [
        r(),
        (r(e) - r(-e)) / (2 * h),
        (r(n) - r(-n)) / (2 * h),
        (r(e) - 2 * r() + r(-e)) / h**2,
        (r(e, n) - r(e, -n) - r(-e, n) + r(-e, -n)) / (4 * h**2),
        (r(n) - 2 * r() + r(-n)) / h**2,
    ]
    # Of the point in space the second covariant derivatives are -b_ij n (Gauss).
    bends = [-b * normal for b in (xx, xy, yy)]
    found = base.covariant @ np.array(jet)
    np.testing.assert_allclose(found, [r(), e_x, e_y, *bends], atol=2e-7)
    assert np.abs(jet[1] @ jet[2]) > 2e-3  # no right angle
    turned = [(patch.base(*(place + s)).frame[0] - e_x) @ e_y / h for s in (e, n)]
    np.testing.assert_allclose(base.turning, base.slopes @ np.array(turned), atol=1e-3)
    step = np.array([2e-5, 1e-5])
    away = patch.at_rest(patch.around(*place.tolist(), step[None])[0])[0] - r()
    np.testing.assert_allclose(base.frame @ away, step, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.0,), "radius above zero"),
        ((R, 1.6), "hemisphere"),
        ((R, 0.0), "above zero"),
        ((R, 1.0, 9.0), "stretch from 0.2 to 5"),
        ((math.nan,), "radius"),
    ],
)
def test_a_cap_that_cannot_be_is_refused(arguments, words):
    with pytest.raises(Refusal, match=words):
        Cap(*arguments)
