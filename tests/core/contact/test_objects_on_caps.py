"""Objects on caps: what the shell of the library itself reads under rigid objects."""

from functools import cache

import numpy as np
import pytest

from kappaskin import Cap, DiscLoad, LeastSquares, ObjectFinder, Plate, SensorLayout, basis_for
from kappaskin.contact import Contacts, as_one
from kappaskin.mechanics import Block, Cylinder, IndentationSolver, Sphere

pytestmark = pytest.mark.slow
NOISE, PLACE, TURN = 0.1, (0.0125, 0.0105), 0.4


class Fingertip:
    """As of the scene fingertip-cap, pressed by rigid objects through the contact solver."""

    def __init__(self, stretch=1.0):
        cap = Cap(0.008, 1.3, stretch)
        self.plate, layout = Plate(cap, 1e-3, thickness=1e-3), SensorLayout.in_spiral(cap, 60)
        self.basis = basis_for(cap, "clamped", 20, 51)
        self._press = IndentationSolver(self.plate, self.basis)
        self._M = layout.operator(self.basis, self.plate)
        self._fit = LeastSquares(basis_for(cap, "clamped", 8, 13), layout)
        self._contacts = Contacts(self.plate, layout, "clamped")
        self._find = ObjectFinder(self.plate, layout, "clamped")

    def found(self, deflection):
        K = (self._M @ deflection.ravel()).reshape(3, -1)
        for seed in range(4):
            noisy = K + np.random.default_rng(seed).normal(0, NOISE, K.shape)
            yield self._find(noisy, NOISE, as_one(*self._contacts(noisy, self._fit(noisy))))

    def under(self, rigid, force):
        return self.found(self._press(rigid, *PLACE, TURN, force=force).coefficients)


@cache
def fingertip(stretch=1.0):
    return Fingertip(stretch)


@pytest.mark.parametrize("stretch", [1.0, pytest.param(1.2, marks=pytest.mark.full)])
@pytest.mark.parametrize("radius", [0.006, pytest.param(0.003, marks=pytest.mark.full)])
def test_a_ball_has_its_own_radius_on_a_fingertip(stretch, radius):
    found = [one for one in fingertip(stretch).under(Sphere(radius), 3.0) if one.sure]
    assert len(found) >= 3
    for one in found:
        assert one.kind == "sphere"
        assert one.radius_95[0] < radius < one.radius_95[1]
        np.testing.assert_allclose(one.position, PLACE, atol=1e-4)
        assert one.force == pytest.approx(3.0, rel=0.02)


@pytest.mark.full
def test_a_rod_on_a_fingertip_is_one_or_an_edge():
    for one in fingertip().under(Cylinder(0.004, 0.03), 3.0):
        assert one.sure
        assert one.kind in ("edge", "cylinder")
        assert one.radius_95[0] < 0.004 < one.radius_95[1]
        assert one.axis == pytest.approx(TURN, abs=0.05)


@pytest.mark.full
@pytest.mark.parametrize("rigid", [Block(0.04, 0.04), Sphere(0.006)])
def test_a_light_touch_of_a_fingertip_has_no_name(rigid):
    assert not any(one.sure for one in fingertip().under(rigid, 0.1))


@pytest.mark.full
def test_a_mould_of_a_fingertip_is_none_of_the_objects():
    mould = DiscLoad(*PLACE, 0.0025, 1.0)

    for one in fingertip().found(fingertip().plate.deflection([mould], fingertip().basis)):
        assert not one.sure
