import numpy as np
from kappaskin import Patch, SensorLayout, SineBasis, estimator_for
from kappaskin_ridge import RidgeEstimator


def test_readings_of_a_shape_give_the_shape():
    patch = Patch(0.1, 0.1)
    basis, layout = SineBasis(patch, 4, 4), SensorLayout.regular(patch, 10, 10)
    coefficients = np.zeros((4, 4))
    coefficients[0, 0] = 1e-3  # m

    fit = estimator_for("ridge", basis, layout)
    found = fit((layout.operator(basis) @ coefficients.ravel()).reshape(3, -1))

    assert isinstance(fit, RidgeEstimator)
    assert np.allclose(found.coefficients, coefficients, atol=1e-6)
