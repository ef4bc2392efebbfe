import numpy as np
from kappaskin.estimation import DenseUncertainty, Estimator


class RidgeEstimator(Estimator):
    """Least squares with a small penalty on large coefficients."""

    def _set_up(self):
        self._mu = 1e-6 * float(np.linalg.norm(self.weight[:, None] * self.M, 2)) ** 2

    def _fit(self, flat, used):
        A = self.weight[used, None] * self.M[used]
        H = np.linalg.inv(A.T @ A + self._mu * np.eye(A.shape[1])) @ A.T
        c = (self.weight[used] * flat[..., used]) @ H.T
        return self._answer(flat, c, DenseUncertainty(lambda: H @ H.T), max(len(A) - len(H), 0))
