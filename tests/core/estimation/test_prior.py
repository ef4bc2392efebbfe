"""The covariance of shapes before any reading: that of a plate under a white load."""

from itertools import product

import numpy as np
import pytest
import scipy

from kappaskin import Patch, Plate, SineBasis
from kappaskin.bases import covariant_at
from kappaskin.estimation.bayes import prior_root


def test_the_displacement_is_1_m_rms_over_the_skin(held_skin):
    basis = held_skin.basis()
    points, weights = basis.quadrature()

    variance = np.sum((basis.at(points) @ prior_root(basis)) ** 2, axis=1)

    assert weights @ variance / weights.sum() == pytest.approx(1, rel=1e-12)


def test_the_root_spans_what_the_edges_leave_free(held_skin):
    basis = held_skin.basis()
    W = np.eye(basis.size) if basis.free is None else basis.free

    L = prior_root(basis)

    assert L.shape == W.shape
    np.testing.assert_allclose(W @ np.linalg.lstsq(W, L)[0], L, atol=1e-12 * np.abs(L).max())
    assert np.linalg.matrix_rank(L, tol=1e-9 * np.linalg.norm(L, 2)) == W.shape[1]


def test_it_is_how_plates_answer_to_many_loads_at_random_places(held_skin):
    # What no reading sees of an answer is taken out, as a fit takes it out.
    basis = held_skin.basis()
    patch = basis.patch
    points, weights = basis.quadrature()
    V = np.eye(basis.size) if basis.free is None else basis.free
    kept = np.hstack([V, basis.unobservable]) if basis.unobservable is not None else V
    loads = [np.sqrt(weights)[:, None] * basis.at(points)]  # independent, one at each point
    plates, mean_square = [Plate(patch)], loads[0].T @ loads[0]
    if all(patch.curvatures):  # of unknown thickness, under loads of unknown width
        plates = [Plate(patch, thickness=h) for h in (0.25e-3, 1e-3, 4e-3)]
        loads.append(loads[0] @ smoothed(basis, 0.15 * min(patch.a, patch.b)))

    covariance = np.zeros((basis.size, basis.size))
    for plate, load in product(plates, loads):
        answers = plate.compliance(basis).after(load)
        answers = np.linalg.lstsq(kept, answers.T)[0][: V.shape[1]].T @ V.T
        one = answers.T @ answers
        covariance += one / np.sum(one * mean_square)

    L = prior_root(basis)

    scale = np.trace(covariance) / np.trace(L @ L.T)
    np.testing.assert_allclose(L @ L.T, covariance / scale, atol=1e-12 * np.trace(L @ L.T))


def smoothed(basis, width):
    """(1 - width^2 times the Laplacian)^-2, on the functions."""
    points, weights = basis.quadrature()
    values = np.sqrt(weights)[:, None] * basis.at(points)
    slopes = np.sqrt(weights)[:, None] * covariant_at(basis, points)[1:3]
    k2, waves = scipy.linalg.eigh(np.einsum("kpi,kpj->ij", slopes, slopes), values.T @ values)
    return waves / (1 + width**2 * k2) ** 2 @ waves.T @ values.T @ values


@pytest.mark.parametrize("patch", [Patch(0.12, 0.05), Patch(0.12, 0.05, strip=True)])
def test_of_flat_sines_it_is_the_closed_form(patch):
    basis = SineBasis(patch, 5, 1 if patch.strip else 4)

    L = prior_root(basis)

    sd = np.diag(L)
    np.testing.assert_array_equal(L, np.diag(sd))
    k2 = basis.laplacian.ravel()
    np.testing.assert_allclose(sd / sd[0], (k2[0] / k2) ** 2, rtol=1e-12)
