"""What filterpy's filters share when they are driven by a model and any number of sensors.

    kf = MotionEKF(model, x0, P0)
    kf.predict(dt)
    kf.update(z, sensor)        # z is None: no measurement, the prediction stands

The model and the sensor are arguments; x, P, K, y, S stay public as in filterpy, x and y as vectors (n,) and (m,). Angles among the state are kept in
[−π, π), components with bounds within them. A call that raises leaves the filter as it was.
"""

from trackhelpers.arrays import check_array, check_covariance
from trackhelpers.checks import check_vector
from trackhelpers.consistency import nees
from trackhelpers.filters.base import OneTarget

REFUSED = {  # of filterpy's methods, on every filter that takes a model and a step
    "batch_filter": "trackhelpers.follow.follow",
    "rts_smoother": "trackhelpers.follow.smooth(history)",
}


class OnModel(OneTarget):
    """The arguments and the bookkeeping that the three filters share."""

    smoothable = True

    def _start(self, model, x0, P0):
        self.model, self._angles = model, model.angles
        self.x = model.normalise(check_array(x0, "x0", model.n, ()))
        self.P = check_covariance(P0, "P0", model.n)
        self.x_prior, self.P_prior = self.x.copy(), self.P.copy()
        self._known = None, None  # the last sensor that was found to fit, and the model that it fits
        self._no_measurement()

    def nees(self, truth, fold=False):
        """Normalised estimation error squared against `truth`, shape (n,), angles the short way round.

        With `fold` a motion that the filter takes for one backwards counts as the same motion: see `trackhelpers.motion.base.MotionModel.fold`.
        """
        truth = check_array(truth, "truth", self.model.n, ())
        return nees(self.model.fold(truth, near=self.x) if fold else truth, self.x, self.P, self._angles)

    def _measurement(self, z, sensor, R):
        """The checked measurement vector and covariance; the sensor must have been made for the model's state."""
        if self._known[0] is not sensor or self._known[1] is not self.model:
            check_fit(sensor, self.model)
            self._known = sensor, self.model
        z = check_vector(z, "z", sensor.m)
        return z, sensor.R if R is None else check_covariance(R, "R", sensor.m)

    def _normalise_posterior(self):
        for x in (self.x, self.x_post):  # new arrays of filterpy's
            self.model._normalise(x)


def check_fit(sensor, model):
    """ValueError unless the sensor was made for the model's state, and takes for angles what the model takes for angles."""
    if getattr(sensor, "state", None) != model.state:
        raise ValueError(f"sensor: expected one made with state={model.state}, got {sensor!r}")
    picks = getattr(sensor, "picks", None)
    if picks is not None:
        unwrapped = [i for i in range(sensor.m) if i not in sensor.angles and picks(i, model.angles)]
        if unwrapped:
            raise ValueError(
                f"sensor: expected angles={tuple(unwrapped)} among those it is told, for these rows of H pick an angle of the model, got {sensor!r}"
            )
