"""A bent skin that stretches: against its closed form, its full energy, and quadrature."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Patch, Plate, Refusal, SensorLayout
from kappaskin.mechanics import Shell

R = 12.9e-3
ARC = math.pi * R
SHEET = {"E": 2.8e9, "nu": 0.3, "h": 0.25e-3}
SKIN = Patch(ARC, 0.04, R)


def diaphragms(plate, positions, x0, y0, sd, waves=200):
    """Readings (3 P,) and give of a panel with diaphragms all round: sines, one by one; no library.

    f = F sin sin, v = V cos sin, u = U sin cos meet those edges and do not mix.
    """
    (a, b), H, nu, h = (plate.patch.a, plate.patch.b), 1 / plate.patch.radius, 0.3, SHEET["h"]
    D = plate.rigidity
    C = 12 * D / h**2
    k, q = np.meshgrid(*(np.arange(1, waves + 1) * np.pi / side for side in (a, b)), indexing="ij")
    nil = 0 * k
    ex, ey, g = (nil - H, -k, nil), (nil, nil, -q), (nil, q, k)
    xx, yy, xy = (-(k**2), -H * k, nil), (-(q**2), nil, nil), (k * q, 3 / 4 * H * q, -H / 4 * k)
    K = np.empty((*k.shape, 3, 3))
    for i in range(3):
        for j in range(3):
            K[..., i, j] = C * (ex[i] * ex[j] + ey[i] * ey[j] + (1 - nu) / 2 * g[i] * g[j])
            K[..., i, j] += C * nu * (ex[i] * ey[j] + ey[i] * ex[j])
            K[..., i, j] += D * (xx[i] * xx[j] + yy[i] * yy[j] + 2 * (1 - nu) * xy[i] * xy[j])
            K[..., i, j] += D * nu * (xx[i] * yy[j] + yy[i] * xx[j])
    load = 4 / (a * b) * np.sin(k * x0) * np.sin(q * y0) * np.exp(-(k**2 + q**2) * sd**2 / 2)
    F, V, U = np.moveaxis(np.linalg.inv(K)[..., 0] * load[..., None], -1, 0)
    X, Y = np.outer(positions[:, 0], k[:, 0]), np.outer(positions[:, 1], q[0])
    # Gages on either face: the strains over the length of their own line.
    gages = [H**2 - k**2, nil, nil], yy, [k * q, H * q / 2, -H * k / 2]
    read = [
        np.einsum("pi,ij,pj->p", of_x(X), row[0] * F + row[1] * V + row[2] * U, of_y(Y))
        for row, of_x, of_y in zip(
            gages, (np.sin, np.sin, np.cos), (np.sin, np.sin, np.cos), strict=True
        )
    ]
    return np.concatenate(read), float(np.sum(F * np.sin(k * x0) * np.sin(q * y0)))


def skin(**changes):
    return replace(Plate.of_material(SKIN, **SHEET), **changes)


@pytest.mark.parametrize("sd", [1e-3, 2e-3])
@pytest.mark.parametrize("place", [(0.3, 0.41), (0.5, 0.5), (0.9, 0.2)])
def test_readings_between_diaphragms_are_those_of_the_closed_form(sd, place):
    plate, layout = skin(inplane="diaphragm"), SensorLayout.regular(SKIN, 10, 10)
    x0, y0 = place[0] * SKIN.a, place[1] * SKIN.b

    T, G = Shell(plate).readings_under(layout, np.array([x0]), np.array([y0]), sd)

    expected, give = diaphragms(plate, layout.positions, x0, y0, sd)
    near = 1e-5 if sd == 1e-3 else 1e-9  # what Legendre polynomials resolve
    np.testing.assert_allclose(T[0, 0, 0], expected, rtol=0, atol=near * np.abs(expected).max())
    assert G[0, 0] == pytest.approx(give, rel=near)


def test_readings_at_scattered_elements_are_those_of_the_closed_form():
    plate, places = skin(inplane="diaphragm"), np.random.default_rng(5).uniform(0.05, 0.95, (31, 2))
    layout = SensorLayout.scattered(SKIN, places * (SKIN.a, SKIN.b))

    T, _ = Shell(plate).readings_under(layout, np.array([0.02]), np.array([0.017, 0.03]), 2e-3)

    expected, _ = diaphragms(plate, layout.positions, 0.02, 0.03, 2e-3)
    np.testing.assert_allclose(T[0, 1, 0], expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("inplane", ["hoop", "diaphragm"])
def test_the_second_readings_are_the_laplacian_by_the_loads_place(inplane):
    shell, layout = Shell(skin(inplane=inplane)), SensorLayout.regular(SKIN, 6, 5)
    x0, y0, e = 0.4 * SKIN.a, 0.3 * SKIN.b, 2e-5
    steps = np.array([-e, 0.0, e])

    T, _ = shell.readings_under(layout, x0 + steps, y0 + steps, 2e-3)

    K = T[0]
    by_steps = (K[1, 0] + K[1, 2] + K[0, 1] + K[2, 1] - 4 * K[1, 1]) / e**2
    scale = np.abs(by_steps).max()
    np.testing.assert_allclose(T[1, 1, 1], by_steps, rtol=0, atol=1e-4 * scale)


def test_a_gage_reads_the_mean_along_it():
    """By quadrature of the readings of gages without length along x, along y and diagonals."""
    L, middle = 3e-3, np.array([[0.3 * ARC, 0.011], [0.6 * ARC, 0.02]])
    t, w = np.polynomial.legendre.leggauss(16)
    shell, x, y = Shell(skin()), np.array([0.35 * ARC]), np.array([0.013])

    def mean(cos, sin):
        steps = L / 2 * np.multiply.outer(t, (cos, sin))
        places = SensorLayout.scattered(SKIN, (middle + steps[:, None]).reshape(-1, 2))
        xx, yy, xy = shell.readings_under(places, x, y, 2e-3)[0][0].reshape(3, 16, 2)
        return w / 2 @ (cos**2 * xx + sin**2 * yy + 2 * cos * sin * xy)

    d = math.sqrt(0.5)
    expected = np.stack([mean(1, 0), mean(0, 1), (mean(d, d) - mean(d, -d)) / 2])

    layout = replace(SensorLayout.scattered(SKIN, middle), gage_length=L)
    T, _ = shell.readings_under(layout, x, y, 2e-3)
    np.testing.assert_allclose(T[0].reshape(3, 2), expected, rtol=0, atol=1e-9 * np.abs(T).max())


def test_the_give_is_the_displacement_where_the_load_is():
    """Two loads that swap places: work is reciprocal, the give alone no matter of the layout."""
    shell = Shell(skin())
    x, y = np.array([0.01, 0.02]), np.array([0.013, 0.02])

    one = shell.readings_under(SensorLayout.regular(SKIN, 3, 3), x, y, 2e-3)[1]
    other = shell.readings_under(SensorLayout.regular(SKIN, 4, 2), x[::-1], y[::-1], 2e-3)[1]

    np.testing.assert_allclose(one, other[::-1, ::-1], rtol=1e-12)


def test_less_held_is_softer():
    layout, x, y = SensorLayout.regular(SKIN, 3, 3), np.array([0.015]), np.array([0.013])

    gives = [
        Shell(skin(inplane=held)).readings_under(layout, x, y, 2e-3)[1][0, 0]
        for held in ("held", "hoop", "free")
    ]

    assert gives[0] < gives[1] < gives[2]


def test_sliding_edges_let_the_hoop_displacement_go():
    layout, x, y = SensorLayout.regular(SKIN, 3, 3), np.array([0.015]), np.array([0.013])

    slid = Shell(skin(), sliding=True).readings_under(layout, x, y, 2e-3)
    free = Shell(skin(inplane="free")).readings_under(layout, x, y, 2e-3)

    np.testing.assert_array_equal(slid[0], free[0])


def test_a_load_too_small_to_resolve_is_refused():
    with pytest.raises(Refusal, match=r"at least 0\.000844 m on a patch"):
        Shell(skin(), finest=1e-4)
    with pytest.raises(Refusal, match=r"at least 0\.001 m, got 0\.0005"):
        Shell(skin()).readings_under(
            SensorLayout.regular(SKIN, 2, 2), np.array([0.01]), np.array([0.01]), 5e-4
        )


@pytest.mark.parametrize("patch", [Patch(0.1, 0.1), Patch(ARC, 0.02, R, strip=True)])
def test_a_skin_that_is_no_shell_is_refused(patch):
    with pytest.raises(Refusal, match="expected a skin that is bent, with two sides"):
        Shell(Plate(patch))
