"""The square-root unscented Kalman filter on any model."""

from trackhelpers.filters.motion_ukf import MotionUKF
from trackhelpers.filters.square_root_ukf import SquareRootUKF, check_form


class MotionSquareRootUKF(MotionUKF, SquareRootUKF):
    """`MotionUKF` on a factor of P: the same estimates to rounding, where P is too ill-conditioned for the plain one it goes on.

    Parameters
    ----------
    model, x0, P0, alpha, beta, kappa : as for `MotionUKF`
    form : {"qr", "cholupdate"}
        As for `SquareRootUKF`.

    Attributes
    ----------
    factor : numpy.ndarray, shape (n, n)
        L with L Lᵀ = P, lower triangular.

    Raises
    ------
    ValueError
        As for the two.
    """

    def __init__(self, model, x0, P0, alpha=1.0, beta=2.0, kappa=0.0, form="qr"):
        super().__init__(model, x0, P0, alpha, beta, kappa)
        self.form = check_form(form)

    _points = SquareRootUKF._points

    def _predict(self, dt):
        self.compute_process_sigmas(dt)
        self._predict_factor()

    def _update(self, z):
        self.sigmas_f = self._points()
        self._correct(z, self.R, self._seen())
