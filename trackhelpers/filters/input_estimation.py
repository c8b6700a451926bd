"""Input estimation: the acceleration is read from a window of innovations of a filter that does not know of it (paper 3's rival)."""

from collections import deque

from scipy import stats

from trackhelpers.filters.matrix_filter import MatrixKF
from trackhelpers.manoeuvre import OneAPrediction, check_input, check_probability, constant_input


class InputEstimationKF(OneAPrediction, MatrixKF):
    """Kalman filter with a piecewise constant input, whose changes it finds in its innovations.

    At every step the innovations of the last `window` steps give a least squares estimate of a change of the input at the window's beginning
    (`trackhelpers.manoeuvre.constant_input`). A significant one corrects the state and its covariance, goes into the input of the following predictions, and the
    window begins anew.

    Parameters
    ----------
    F, H, Q, R, x0, P0
        As for `MatrixKF`.
    G : array_like, shape (n, q)
        How the input reaches the state in a step.
    window : int
        Steps, ≥ 1, and enough of them to see the input.
    probability : float
        Of no detection in one window while there is no change.

    Attributes
    ----------
    u : numpy.ndarray, shape (q,)
        The input in force.
    changes : int
        How many changes were found so far.

    References
    ----------
    Y. T. Chan, A. G. C. Hu, J. B. Plant, IEEE Transactions on Aerospace and Electronic Systems AES-15 (1979) 237–244.
    """

    def __init__(self, F, G, H, Q, R, x0, P0, window=10, probability=0.9999):
        super().__init__(F, H, Q, R, x0, P0)
        self.B, self.window = check_input(self.F, G, self.H, window)
        self.limit = float(stats.chi2.ppf(check_probability(probability, "probability"), self.B.shape[1]))
        self.u, self.changes = self.B[0] * 0.0, 0
        self._past = deque(maxlen=self.window)

    def predict(self):
        """Predict with the input in force."""
        super().predict(u=self.u)
        self._predicted = True

    def update(self, z):
        """Correct by measurement `z`, shape (m,), and by a change of the input where the window shows one; None leaves the prediction and empties the window.

        One measurement a prediction: the window counts steps. RuntimeError for a second one.
        """
        if z is None:
            self._no_measurement()
            self._past.clear()
            return
        z = self._measurement(z)
        self._one_a_prediction()
        super().update(z)
        self._past.append((self.y, self.S, self.K))
        if len(self._past) < self.window:
            return
        change, covariance, shift, significance = constant_input(*zip(*self._past, strict=True), self.F, self.B, self.H)
        if significance > self.limit:
            self.u = self.u + change
            self.x = self.x + shift @ change
            self.P = self.P + shift @ covariance @ shift.T
            self.x_post, self.P_post = self.x.copy(), self.P.copy()
            self.changes += 1
            self._past.clear()
