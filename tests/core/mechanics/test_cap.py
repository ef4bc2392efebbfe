"""Caps that bend and stretch: against closed forms, the flat disk and their own symmetry."""

import math
from itertools import pairwise

import numpy as np
import pytest

from kappaskin import Cap, DiscLoad, Disk, Plate, PointLoad, Refusal, SensorLayout, basis_for
from kappaskin.bases import curvature_at
from kappaskin.mechanics.cap import CapShell

R = 8e-3
HEMISPHERE, EGG = Cap(R), Cap(R, 1.4, 1.5)
CAPS = [HEMISPHERE, EGG]


def energy_under(plate, edge, Ni, Nj, load):
    """What the skin gives under a load of 1 N, in m per N."""
    basis = basis_for(plate.patch, edge, Ni, Nj)
    force = load.modal(basis)
    return float(np.vdot(force, plate.compliance(basis)(force)))


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
@pytest.mark.parametrize("cap", CAPS)
def test_ritz_converges_from_below(cap, edge):
    load = DiscLoad(cap.rim_radius + 3e-3, cap.rim_radius - 2e-3, 1.5e-3)
    given = [energy_under(Plate(cap), edge, n, 2 * n + 1, load) for n in (4, 8, 12, 16)]

    assert all(less < more for less, more in pairwise(given))
    assert given[-1] / given[-2] - 1 < 0.01
    assert given[0] / given[-1] < 0.8  # which the few do not reach


def test_a_point_load_at_the_pole_sinks_as_reissner_has_it():
    plate = Plate.of_material(HEMISPHERE, 2e6, 0.3, 0.25e-3)
    pole = PointLoad(HEMISPHERE.rim_radius, HEMISPHERE.rim_radius)
    # Shallow spherical shell: w = sqrt(12 (1 - nu^2)) P R / (8 E h^2).
    expected = math.sqrt(12 * (1 - 0.3**2)) * R / (8 * 2e6 * 0.25e-3**2)

    given = energy_under(plate, "clamped", 40, 1, pole)

    assert given == pytest.approx(expected, rel=0.03)


def test_uniform_pressure_stretches_a_hemisphere_away_from_its_rim_as_a_membrane():
    h, E, nu, p = 5e-5, 2e6, 0.3, 1e3
    plate = Plate.of_material(HEMISPHERE, E, nu, h)
    basis = basis_for(HEMISPHERE, "clamped", 30, 1)
    points, weights = basis.quadrature()
    c = plate.compliance(basis)((p * weights @ basis.at(points)).reshape(basis.shape)).ravel()

    near = HEMISPHERE.rim_radius + np.array([[0, 0], [2e-3, 0], [0, 5e-3]])
    angle = np.array([0, 2e-3, 5e-3]) / R
    # w = p R^2 (1 - nu) / (2 E h), and the whole moves along the axis by what the rim's bending is.
    along = basis.at(near) @ c - p * R**2 * (1 - nu) / (2 * E * h)
    np.testing.assert_allclose(along, along[0] * np.cos(angle), rtol=1e-3)
    assert 0 < along[0] < 0.1 * (basis.at(near) @ c)[0]


@pytest.mark.cases("clamped")
@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_a_wide_cap_gives_and_reads_as_a_disk(edge):
    cap, disk = Cap(1e6, 5e-8), Disk(0.05)
    load = DiscLoad(0.06, 0.045, 0.01)
    at = np.array([[0.05, 0.05], [0.07, 0.03], [0.055, 0.047]])
    found = []
    for plate, size in ((Plate(cap), (14, 9)), (Plate(disk), (30, 30))):
        basis = basis_for(plate.patch, edge, *size)
        c = plate.deflection([load], basis).ravel()
        found += [basis.at(at) @ c, plate.curvature(basis)(at) @ c]

    np.testing.assert_allclose(found[0], found[2], rtol=2e-4)
    np.testing.assert_allclose(found[1], found[3], atol=0.02 * np.abs(found[3]).max())


@pytest.mark.parametrize("cap", CAPS)
def test_a_load_turned_about_the_axis_gives_turned_readings(cap):
    basis, plate = basis_for(cap, "hinged", 6, 9), Plate(cap)
    compliance, read = plate.compliance(basis), plate.curvature(basis)

    def forms(angle):
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        at = cap.rim_radius + 1e-3 * np.array([[4, 1], [0, 0], [-2, 7], [1e-4, 0]]) @ turn.T
        load = cap.rim_radius + turn @ np.array([3e-3, 2e-3])
        xx, yy, xy = read(at) @ compliance.after(basis.at(load[None]))[0]
        return turn.T @ np.moveaxis(np.array([[xx, xy], [xy, yy]]), -1, 0) @ turn

    rest = forms(0.0)
    np.testing.assert_allclose(forms(1.1), rest, atol=1e-6 * np.abs(rest).max())


def test_readings_of_a_spheroid_are_half_of_what_strains_back_to_back_differ_by():
    cap, h = Cap(R, stretch=1.6), 2e-5
    basis = basis_for(cap, "hinged", 4, 5)
    shell, c = CapShell(basis, 1.0, 1e6, 0.3), np.random.default_rng(0).normal(size=20) * 1e-7
    at = cap.rim_radius + 1e-3 * np.array([[5, 1], [-2, 4], [1, -8], [0.3, 0]])

    def moved(p, share):
        rest, normals = cap.at_rest(p)
        s, angle = shell._polar(p)  # noqa: SLF001
        (U, _), (V, _) = shell._tangential_waves(s)  # noqa: SLF001
        cos, sin = shell._turned(angle)  # noqa: SLF001
        u = shell._by_function(U * cos, U * sin) @ c  # noqa: SLF001
        v = shell._by_function(V * sin, -V * cos) @ c  # noqa: SLF001
        turned = (u + 1j * v) * np.exp(1j * angle)  # from along the meridian to the frame
        u = np.stack([turned.real, turned.imag])
        along = np.einsum("kp,pki->pi", u, cap.base(*p.T).frame)
        return rest + share * (along - normals * (basis.at(p) @ c)[:, None])

    def first(g, e):
        return lambda p: (8 * (g(p + e) - g(p - e)) - g(p + 2 * e) + g(p - 2 * e)) / (12 * h)

    def forms(share):
        """The first two fundamental forms, in the frame at rest, and the tangents."""
        each = [first(lambda p: moved(p, share), e) for e in h * np.eye(2)]
        second = [[first(one, e)(at) for e in h * np.eye(2)] for one in each]
        tangents = np.stack([one(at) for one in each], 1)
        normal = np.cross(*np.moveaxis(tangents, 1, 0))
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return (
            tangents @ np.swapaxes(tangents, 1, 2),
            -np.einsum("abpi,pi->pab", second, normal),
            tangents,
        )

    rest, (more, less) = forms(0), (forms(0.5), forms(-0.5))
    to_frame = np.linalg.inv(rest[2] @ np.swapaxes(cap.base(*at.T).frame, 1, 2))

    def in_frame(form):
        return to_frame @ form @ np.swapaxes(to_frame, 1, 2)

    strain, change = in_frame(more[0] - less[0]) / 2, in_frame(more[1] - less[1])
    K = in_frame(rest[1])
    expected = change - K @ strain - strain @ K

    read = shell.curvature_at(at) @ c

    tolerance = 1e-4 * np.abs(expected).max()
    np.testing.assert_allclose(read, expected[:, [0, 1, 0], [0, 1, 1]].T, atol=tolerance)
    without = curvature_at(basis, at) @ c
    assert np.abs(without - read).max() > 100 * tolerance  # what u and v make of it


def test_readings_are_smooth_through_the_pole():
    basis, plate = basis_for(EGG, "clamped", 6, 7), Plate(EGG)
    line = EGG.rim_radius + np.linspace(-1, 1, 41)[:, None] * np.array([1e-4, 5e-5])
    read = plate.curvature(basis)(line)
    third = np.diff(read, 3, axis=1)
    assert np.abs(third).max() < 1e-4 * np.abs(np.diff(read, axis=1)).max()


def test_a_rim_that_lets_a_cap_move_is_refused():
    for cap, inplane in ((HEMISPHERE, "free"), (HEMISPHERE, "diaphragm"), (EGG, "free")):
        with pytest.raises(Refusal, match="without stretching"):
            Plate(cap, inplane=inplane)
    with pytest.raises(Refusal, match="rigidity above zero"):
        Plate(HEMISPHERE, rigidity=0.0, tension=1.0)


def test_a_rim_that_slides_along_the_meridian_gives_more():
    cap = Cap(R, 0.6)
    load = PointLoad(cap.rim_radius + 2e-3, cap.rim_radius)
    held, slides = (
        energy_under(Plate(cap, inplane=of), "hinged", 8, 9, load) for of in ("held", "diaphragm")
    )
    assert slides > 1.5 * held


def test_slopes_on_a_cap_are_refused():
    layout = SensorLayout.scattered(HEMISPHERE, [[R, R], [1.2 * R, R]])
    with pytest.raises(Refusal, match="got slopes"):
        layout.reading_each(["slope@0"])
