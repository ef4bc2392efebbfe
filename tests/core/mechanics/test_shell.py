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
    answer = np.linalg.inv(K)[..., 0]
    if plate.fluid:
        volume = (1 - np.cos(k * a)) * (1 - np.cos(q * b)) / (k * q)
        gives = answer[..., 0] * volume
        load -= volume * np.sum(gives * load) / np.sum(gives * volume)
    F, V, U = np.moveaxis(answer * load[..., None], -1, 0)
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


@pytest.mark.cases(
    "False-place0-0.001", "True-place1-0.002", "True-place2-0.001", "False-place1-0.002"
)
@pytest.mark.parametrize("sd", [1e-3, 2e-3])
@pytest.mark.parametrize("place", [(0.3, 0.41), (0.5, 0.5), (0.9, 0.2)])
@pytest.mark.parametrize("fluid", [False, True])
def test_readings_between_diaphragms_are_those_of_the_closed_form(sd, place, fluid):
    """Over a fluid, the pressure on the whole skin has an edge that 2 mm do not resolve as well."""
    plate, layout = skin(inplane="diaphragm", fluid=fluid), SensorLayout.regular(SKIN, 10, 10)
    x0, y0 = place[0] * SKIN.a, place[1] * SKIN.b

    T, G = Shell(plate.sheet(), sd).readings_under(layout, np.array([x0]), np.array([y0]))

    expected, give = diaphragms(plate, layout.positions, x0, y0, sd)
    most = (2e-3 if sd == 2e-3 else 2e-4) if fluid else 2e-5
    np.testing.assert_allclose(T[0, 0], expected, rtol=0, atol=most * np.abs(expected).max())
    assert G[0, 0] == pytest.approx(give, rel=most / 10)


def test_readings_at_scattered_elements_are_those_of_the_closed_form():
    plate, places = skin(inplane="diaphragm"), np.random.default_rng(5).uniform(0.05, 0.95, (31, 2))
    layout = SensorLayout.scattered(SKIN, places * (SKIN.a, SKIN.b))

    T, _ = Shell(plate.sheet(), 2e-3).readings_under(
        layout, np.array([0.02]), np.array([0.017, 0.03])
    )

    expected, _ = diaphragms(plate, layout.positions, 0.02, 0.03, 2e-3)
    np.testing.assert_allclose(T[1, 0], expected, rtol=0, atol=5e-5 * np.abs(expected).max())


def test_a_gage_reads_the_mean_along_it():
    """By quadrature of the readings of gages without length along x, along y and diagonals."""
    L, middle = 3e-3, np.array([[0.3 * ARC, 0.011], [0.6 * ARC, 0.02]])
    t, w = np.polynomial.legendre.leggauss(16)
    shell, x, y = Shell(skin().sheet(), 2e-3), np.array([0.35 * ARC]), np.array([0.013])

    def mean(cos, sin):
        steps = L / 2 * np.multiply.outer(t, (cos, sin))
        places = SensorLayout.scattered(SKIN, (middle + steps[:, None]).reshape(-1, 2))
        xx, yy, xy = shell.readings_under(places, x, y)[0].reshape(3, 16, 2)
        return w / 2 @ (cos**2 * xx + sin**2 * yy + 2 * cos * sin * xy)

    d = math.sqrt(0.5)
    expected = np.stack([mean(1, 0), mean(0, 1), (mean(d, d) - mean(d, -d)) / 2])

    layout = replace(SensorLayout.scattered(SKIN, middle), gage_length=L)
    T, _ = shell.readings_under(layout, x, y)
    np.testing.assert_allclose(T.reshape(3, 2), expected, rtol=0, atol=1e-9 * np.abs(T).max())


def test_the_give_is_the_displacement_where_the_load_is():
    """Two loads that swap places: work is reciprocal, the give alone no matter of the layout."""
    shell = Shell(skin().sheet(), 2e-3)
    x, y = np.array([0.01, 0.02]), np.array([0.013, 0.02])

    one = shell.readings_under(SensorLayout.regular(SKIN, 3, 3), x, y)[1]
    other = shell.readings_under(SensorLayout.regular(SKIN, 4, 2), x[::-1], y[::-1])[1]

    np.testing.assert_allclose(one, other[::-1, ::-1], rtol=1e-12)


def test_less_held_is_softer():
    layout, x, y = SensorLayout.regular(SKIN, 3, 3), np.array([0.015]), np.array([0.013])

    gives = [
        Shell(skin(inplane=held).sheet(), 2e-3).readings_under(layout, x, y)[1][0, 0]
        for held in ("held", "hoop", "free")
    ]

    assert gives[0] < gives[1] < gives[2]


def test_sliding_edges_let_the_hoop_displacement_go():
    layout, x, y = SensorLayout.regular(SKIN, 3, 3), np.array([0.015]), np.array([0.013])

    slid = Shell(skin().sheet(sliding=True), 2e-3).readings_under(layout, x, y)
    free = Shell(skin(inplane="free").sheet(), 2e-3).readings_under(layout, x, y)

    np.testing.assert_array_equal(slid[0], free[0])


def test_a_load_too_small_to_resolve_is_refused():
    with pytest.raises(Refusal, match=r"at least 0\.000844 m on a patch"):
        Shell(skin().sheet(), 1e-4)


@pytest.mark.parametrize(
    "plate",
    [
        Plate(Patch(0.1, 0.1)),
        Plate(Patch(ARC, 0.02, R, strip=True)),
        Plate(SKIN, rigidity=0.0, tension=5.0),
    ],
    ids=["flat", "strip", "drum head"],
)
def test_a_skin_that_is_no_shell_is_refused(plate):
    with pytest.raises(Refusal, match="a bent skin with two sides and a rigidity above zero"):
        plate.sheet()
