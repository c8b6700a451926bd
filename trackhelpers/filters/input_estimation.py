"""Input estimation: the acceleration is read from a window of innovations of a filter that does not know of it (paper 3's rival)."""

from scipy import stats

from trackhelpers.filters.base import atomic
from trackhelpers.filters.matrix_filter import AdaptiveKF
from trackhelpers.manoeuvre import OneAPrediction, check_input, check_probability, constant_input


class InputEstimationKF(OneAPrediction, AdaptiveKF):
    """Kalman filter with a piecewise constant input, whose changes it finds in its innovations.

    At every step the innovations of the last `window` measurements give a least squares estimate of a change of the input at the window's beginning
    (`trackhelpers.manoeuvre.constant_input`). A significant one corrects the state and its covariance, goes into the input of the following predictions, and the
    window begins anew. A missed scan is a step of the input without a measurement: the window keeps what it has.

    Parameters
    ----------
    F, H, Q, R, x0, P0
        As for `MatrixKF`.
    G : array_like, shape (n, q)
        How the input reaches the state in a step.
    window : int
        Measurements, ≥ 1, and enough of them to see the input.
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
        self._past = ()  # innovation, its covariance, gain and steps of each measurement in the window

    @atomic
    def predict(self):
        """Predict with the input in force."""
        super().predict(u=self.u)
        self._steps += 1

    def _update(self, z, R):
        """One measurement a prediction, for the window counts steps: RuntimeError for a second one."""
        self._one_a_prediction()
        super()._update(z, R)
        self._past, self._steps = (*self._past, (self.y, self.S, self.K, self._steps)), 0
        if len(self._past) < self.window:
            return
        change, covariance, shift, significance = constant_input(*zip(*self._past, strict=True), self.F, self.B, self.H)
        self._past = self._past[1:]
        if significance > self.limit:
            self.u = self.u + change
            self.x = self.x + shift @ change
            self.P = self.P + shift @ covariance @ shift.T
            self.x_post, self.P_post = self.x.copy(), self.P.copy()
            self.changes, self._past = self.changes + 1, ()
