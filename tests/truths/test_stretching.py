"""The library's skins that stretch, against the truth by displacements in the plane."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, Plate, PointContact, PointLoad, SensorLayout, SineBasis
from kappaskin.contact import LargeDeflection
from kappaskin.mechanics import Stretching
from marguerre import ShallowShell
from navier import HingedPlate, Load
from von_karman import StretchingPlate

pytestmark = pytest.mark.truth

A, B, H = 0.1, 0.08, 0.25e-3


def both(inplane, sines):
    """The library's plate and the true one, each with so many sines, and the true loads."""
    plate = Plate(Patch(A, B), thickness=H, inplane=inplane)
    truth = StretchingPlate(A, B, inplane=inplane, sines=sines, polynomials=2 * sines + 8)
    return Stretching(plate, SineBasis(plate.patch, sines, sines)), truth


@pytest.mark.parametrize("inplane", ["held", "diaphragm", "free"])
@pytest.mark.parametrize("at", [(0.05, 0.04), (0.02, 0.06)])
@pytest.mark.parametrize("force", [0.02, 0.1, 0.4])
def test_the_deflection_is_that_of_the_truth(inplane, at, force):
    stretching, truth = both(inplane, 8)
    modal = HingedPlate(A, B, modes=8).forces(Load(*at, force, radius=3e-3))

    c, true = stretching(modal), truth.equilibrium(modal)

    np.testing.assert_allclose(c, true, rtol=0, atol=1e-3 * np.abs(true).max())


# Sze, Liu and Lo (2004), https://doi.org/10.1016/j.finel.2003.11.001: the panel of Sabir and Lock
# (1972), deflection of its middle in mm and force over 3 kN. Theirs is a shell that shears.
PUBLISHED = [
    *((0.693, 0.0877), (1.638, 0.1980), (3.087, 0.3473), (4.477, 0.4686), (5.802, 0.5647)),
    *((7.057, 0.6381), (8.237, 0.6908), (9.339, 0.7246), (10.358, 0.7412)),
]


def test_the_true_shell_snaps_through_as_the_published_panel():
    depths, shares = np.array(PUBLISHED).T
    panel = ShallowShell(
        0.508, 0.508, (1 / 2.54, 0), 12.7e-3, 3102.75e6, edges="panel", polynomials=7
    )

    forces = np.array([force for force, _ in panel.path(1e-3 * depths)])
    depth, limit = panel.limit(1e-3 * np.arange(1, 15, 0.25))

    np.testing.assert_allclose(forces, 3e3 * shares, rtol=0, atol=0.02 * limit)
    assert limit == pytest.approx(3e3 * shares.max(), rel=5e-3)
    assert depth == pytest.approx(10.6e-3, abs=0.3e-3)


SHALLOW = {
    "dome": ((5, 5), "diaphragm", 10),
    "steep dome": ((1, 1), "diaphragm", 14),
    "dome of two radii, held": ((3, 4), "held", 10),
    "saddle": ((1, -3), "diaphragm", 12),
}


@pytest.mark.parametrize(("radius", "inplane", "polynomials"), SHALLOW.values(), ids=SHALLOW)
def test_a_curved_skin_softens_as_the_truth_does(radius, inplane, polynomials):
    Rx, Ry = radius
    truth = ShallowShell(
        A, B, (1 / Rx, 1 / Ry), edges=inplane, radius=2e-3, polynomials=polynomials
    )
    plate = Plate(Patch(A, B, radius), inplane=inplane)
    basis = SineBasis(plate.patch, 9, 9)
    modal = PointLoad(A / 2, B / 2).modal(basis)
    gives = np.vdot(modal, plate.compliance(basis)(modal))

    depths = H * np.array([-1, -0.25, 0.25, 0.5, 0.75, 1, 1.25, 1.5])
    path = [list(Stretching(plate, basis).path(modal, d)) for d in (depths[1::-1], depths[2:])]
    found = np.array([force for force, _ in path[0][::-1] + path[1]])

    true = np.array([force for force, _ in truth.path(depths[: len(found)])])
    assert len(found) > 5
    share, true_share = found * gives / depths[: len(found)], true / truth.stiffness
    np.testing.assert_allclose(share, true_share / depths[: len(found)], rtol=0.03)


@pytest.mark.parametrize(("radius", "inplane"), [((1, -3), "diaphragm"), ((5, 5), "held")])
def test_a_curved_skin_snaps_through_where_the_truth_does(radius, inplane):
    Rx, Ry = radius
    truth = ShallowShell(A, A, (1 / Rx, 1 / Ry), edges=inplane, radius=2e-3, polynomials=11)
    plate = Plate(Patch(A, A, radius), inplane=inplane)
    basis = SineBasis(plate.patch, 9, 9)
    depths = H * np.arange(0.25, 3, 0.05)

    path = list(Stretching(plate, basis).path(PointLoad(A / 2, A / 2).modal(basis), depths))

    depth, force = truth.limit(depths)
    assert depths[len(path) - 1] == pytest.approx(depth, abs=0.11 * H)
    assert path[-1][0] == pytest.approx(force, rel=0.03)


class Domed:
    """An 8 x 8 fit on 10 x 10 elements of a shallow skin, and the true shell pressed on a disc."""

    def __init__(self, radius, polynomials):
        Rx, Ry = radius
        self.truth = ShallowShell(A, A, (1 / Rx, 1 / Ry), radius=4e-3, polynomials=polynomials)
        plate = Plate(Patch(A, A, radius))
        self.layout = SensorLayout.regular(plate.patch, 10, 10)
        self.fit = LeastSquares(SineBasis(plate.patch, 8, 8), self.layout)
        self.contact, self.bounded = (
            PointContact(plate, self.layout),
            LargeDeflection(plate, "hinged"),
        )

    def contacts(self, depths, noise=0.0):
        """At each of `depths` in m: true force, the linear shell's contact, and what is reported.

        The readings have no noise, the error bar of the force is that of a `noise` in 1/m. How well
        polynomials resolve them, to 2 % of the force, is seen under a vanishing load.
        """
        draw = np.random.default_rng(0).normal(0, noise, (3, len(self.layout)))
        (force, q), *path = self.truth.path([1e-3 * H, *depths])
        resolved = self._contact(q).force / force
        for force, q in path:
            linear = self._contact(q)
            linear = replace(linear, force=linear.force / resolved)
            linear = replace(linear, force_sd=self._contact(q, draw).force_sd)
            yield force, linear, self.bounded(linear)

    def _contact(self, q, noise=0.0):
        read = self.truth.curvature(q, self.layout.positions) + noise
        return self.contact(read, self.fit(read))


@pytest.mark.parametrize("radius", [(5, 5), (3, 3), (1, 1), (1, -3), (-5, -5)], ids=str)
def test_the_force_is_marked_before_a_linear_shell_errs_by_more_than_the_error_bar(radius):
    depths, marks = H * np.array([0.03, 0.1, 0.2, 0.3, 0.5, 0.75, 1, 1.5, 2]), []

    for true, linear, found in Domed(radius, 14).contacts(depths, noise=0.005):
        error = abs(linear.force - true)
        marked = found.force_is_lower_bound or found.force_is_upper_bound
        assert found.snaps_through or marked or error < 1.15 * linear.force_sd
        assert found.snaps_through or abs(found.force - true) < 1.15 * found.force_sd
        assert found.force_is_lower_bound <= (true > linear.force)
        assert found.force_is_upper_bound <= (true < linear.force)
        marks.append(marked or found.snaps_through)

    assert not marks[0]
    assert marks[-1]


def test_no_force_is_estimated_where_a_curved_skin_snaps_through():
    skin, depths = Domed((1, -3), 12), H * np.arange(0.25, 3.1, 0.25)
    limit, _ = skin.truth.limit(depths)

    for depth, (_, _, found) in zip(depths, skin.contacts(depths), strict=True):
        assert found.snaps_through or depth < limit + 0.3 * H
        assert not found.snaps_through or depth > limit - 0.8 * H
        assert found.snaps_through == math.isnan(found.force)
