"""The library's plate that stretches, against the truth by displacements in the plane."""

import numpy as np
import pytest

from kappaskin import Patch, Plate, SineBasis
from kappaskin.mechanics import Stretching
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
