"""Contacts with analytic objects, and the noise of a given covariance on them.

Points, normals and curvatures are written for each object by itself, from what it is.
"""

from dataclasses import dataclass

import numpy as np

from kappaskin.hand import FingerContact, Placement

NOWHERE = Placement(np.eye(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Spot:
    """A point (3,) in m of an object, its outward normal (3,), and its curvature (3, 3) in 1/m."""

    point: np.ndarray
    normal: np.ndarray
    curvature: np.ndarray


def direction(rng):
    return (v := rng.normal(size=3)) / np.linalg.norm(v)


def across(n, rng):
    """Two unit vectors (2, 3) that are orthogonal to `n` and to each other."""
    t = np.cross(n, direction(rng))
    t /= np.linalg.norm(t)
    return np.array([t, np.cross(n, t)])


def on_plane(rng, count, size=0.05):
    n, at = direction(rng), 0.1 * rng.normal(size=3)
    E = across(n, rng)
    spots = [Spot(at + rng.uniform(-size, size, 2) @ E, n, np.zeros((3, 3))) for _ in range(count)]
    return spots, {"normal": n, "at": at}


def on_sphere(rng, count, radius, cone=np.pi):
    """Spots anywhere at most `cone` in rad from a direction."""
    c, pole = 0.1 * rng.normal(size=3), direction(rng)
    E, spots = across(pole, rng), []
    for _ in range(count):  # evenly over the cap
        fall, turn = rng.uniform(0, np.sin(cone / 2) ** 2), rng.uniform(0, 2 * np.pi)
        z, r = 1 - 2 * fall, 2 * np.sqrt(fall * (1 - fall))
        n = z * pole + r * np.array([np.cos(turn), np.sin(turn)]) @ E
        spots.append(Spot(c + radius * n, n, (np.eye(3) - np.outer(n, n)) / radius))
    return spots, {"centre": c, "radius": radius}


def on_cylinder(rng, count, radius, length=0.08, cone=np.pi):
    c, a = 0.1 * rng.normal(size=3), direction(rng)
    E = across(a, rng)
    spots = []
    for _ in range(count):
        turn = rng.uniform(-cone, cone)
        n = np.array([np.cos(turn), np.sin(turn)]) @ E
        at = c + rng.uniform(-length, length) / 2 * a + radius * n
        t = np.cross(a, n)
        spots.append(Spot(at, n, np.outer(t, t) / radius))
    return spots, {"at": c, "axis": a, "radius": radius}


def on_edge(rng, count, length=0.08):
    """Spots on the edge of a box, touched from anywhere between its faces."""
    c, a = 0.1 * rng.normal(size=3), direction(rng)
    E = across(a, rng)
    spots = []
    for _ in range(count):
        turn = rng.uniform(0, np.pi / 2)
        n = np.array([np.cos(turn), np.sin(turn)]) @ E
        spots.append(Spot(c + rng.uniform(-length, length) / 2 * a, n, np.zeros((3, 3))))
    return spots, {"at": c, "axis": a}


def on_ellipsoid(rng, count, axes):
    """Spots of an ellipsoid of half `axes` (3,) in m, at parameters evenly over the sphere."""
    spots, D = [], 1 / np.square(axes)
    for _ in range(count):
        p = np.array(axes) * direction(rng)
        g = D * p
        n = g / np.linalg.norm(g)
        P = np.eye(3) - np.outer(n, n)
        spots.append(Spot(p, n, P @ np.diag(D) @ P / np.linalg.norm(g)))
    return spots, {}


def on_box(rng, count, half):
    """Spots in the faces of a box of `half` (3,) sides in m, no two in one face."""
    spots = []
    for face in rng.permutation(6)[:count]:
        n = np.zeros(3)
        n[face // 2] = 1 - 2 * (face % 2)
        p = np.where(n, n, rng.uniform(-0.8, 0.8, 3)) * half
        spots.append(Spot(p, n, np.zeros((3, 3))))
    return spots, {}


def covariance(rng, position_sd, normal_sd, curvature_sd):
    """A covariance (8, 8) of these standard deviations, with correlations at random."""
    A = rng.normal(size=(8, 16))
    C = A @ A.T
    sd = np.repeat([position_sd, normal_sd, curvature_sd], [3, 2, 3]) * rng.uniform(0.5, 1.5, 8)
    d = sd / np.sqrt(np.diag(C))
    return C * np.outer(d, d)


def contact(spot, rng, name, sds, curved=False, force=1.0, noise=1.0):
    """What a finger would tell of the `spot`, with noise of a covariance of `sds` (3,)."""
    C = covariance(rng, *sds)
    off = noise * np.linalg.cholesky(C) @ rng.normal(size=8)
    n = -spot.normal
    E = across(n, rng)
    turned = n + off[3:5] @ E
    turned /= np.linalg.norm(turned)
    t = E[0] - (E[0] @ turned) * turned
    t /= np.linalg.norm(t)
    frame = np.array([t, np.cross(turned, t), turned])
    K = E @ spot.curvature @ E.T
    form = np.array([K[0, 0], K[1, 1], K[0, 1]]) + off[5:]
    if not curved:
        C[5:], C[:, 5:], form = np.nan, np.nan, np.full(3, np.nan)
    return FingerContact(
        name, spot.point + off[:3], frame, form, C, force, 0.1, NOWHERE, np.zeros((2, 2)), 0.0, 0.0
    )


def contacts(spots, rng, sds, curved=False):
    return [contact(spot, rng, f"finger {n}", sds, curved) for n, spot in enumerate(spots)]


def assert_covers(z):
    """That intervals of 90 and 95 % hold the truth as often, by errors `z` (T, k) in sd."""
    z = np.abs(np.asarray(z))
    at_90, at_95 = np.mean(z < 1.6449, axis=0), np.mean(z < 1.96, axis=0)
    assert (np.abs(at_90 - 0.90) < 0.05).all(), at_90
    assert ((at_95 > 0.92) & (at_95 < 0.98)).all(), at_95
