"""Errors are averaged over the true area of a skin."""

import math

import numpy as np
import pytest

from kappaskin.bases import basis_for
from kappaskin.skin import Cap, Disk, Patch
from kappaskin.studies.accuracy import points_on, rms_distance, shares_of


@pytest.mark.parametrize("stretch", [1.0, 1.5])
def test_an_error_at_the_rim_of_a_cap_counts_by_its_true_area(stretch):
    cap = Cap(8e-3, math.radians(75), stretch)
    basis = basis_for(cap, "clamped", 5, 5)
    error = np.eye(basis.size)[-3:]  # of three functions that are largest far from the pole
    points, weights = basis.quadrature()

    found = rms_distance(basis, error, basis, np.zeros_like(error))

    squares = basis.at(points).T[-3:] ** 2
    np.testing.assert_allclose(found, np.sqrt(np.average(squares, axis=1, weights=weights)), 5e-3)


def test_the_pole_of_a_hemisphere_is_as_large_as_its_map_and_its_rim_smaller():
    cap = Cap(8e-3)
    area = cap.area(np.array([[cap.rim_radius, cap.rim_radius], [cap.a, cap.rim_radius]]))

    np.testing.assert_allclose(area, [1, 2 / math.pi], rtol=1e-9)


@pytest.mark.parametrize("patch", [Patch(0.1, 0.05), Disk(0.05)], ids=str)
def test_all_points_of_a_flat_skin_count_alike(patch):
    points = points_on(patch)

    np.testing.assert_allclose(shares_of(patch, points), 1 / len(points), rtol=1e-12)
