"""The smoother that goes back over what `trackhelpers.follow.follow` kept."""

from typing import NamedTuple

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.arrays import divide

__all__ = ["Smoothed", "smooth"]


class Smoothed(NamedTuple):
    """Estimates given all measurements: x (n, N) and P (n, n, N)."""

    x: np.ndarray
    P: np.ndarray


class Step(NamedTuple):
    """What smoothing needs of a step: moments before and after the measurement, and the covariance of the state before the step with that after it."""

    x_prior: np.ndarray
    P_prior: np.ndarray
    cross: np.ndarray
    x: np.ndarray
    P: np.ndarray


def smooth(history):
    """The Rauch–Tung–Striebel smoother over what `follow` kept: the estimate of each step given all measurements.

    Going back, x̂ₖ|N = x̂ₖ + G (x̂ₖ₊₁|N − x̂ₖ₊₁|ₖ) and Pₖ|N = Pₖ + G (Pₖ₊₁|N − Pₖ₊₁|ₖ) Gᵀ with G = Cov(xₖ, xₖ₊₁) Pₖ₊₁|ₖ⁻¹, where the covariance is P Fᵀ for the Kalman filter and
    the extended one, and that of the sigma points for the unscented one. Steps of any length, missed scans, and several sensors at one instant are all right.

    Parameters
    ----------
    history : History
        Of one target.

    Returns
    -------
    Smoothed
        Of the filter's state, (n, N) and (n, n, N).

    Raises
    ------
    ValueError
        The history of an ensemble, or of a filter whose covariance is not that of a model (adaptive and switching ones).

    References
    ----------
    H. E. Rauch, F. Tung, C. T. Striebel, AIAA Journal 3 (1965) 1445–1450; S. Särkkä, IEEE Transactions on Automatic Control 53 (2008) 845–849, for the unscented one.
    """
    if getattr(history, "_steps", None) is None:
        kind = type(getattr(history, "filter", history)).__name__
        raise ValueError(
            f"history: expected that of one target's MotionKF, MotionEKF, MotionUKF or filter on constant matrices, got {kind}"
        )
    steps, wrap = history._steps, history.filter._angles
    xs, Ps = [steps[-1].x], [steps[-1].P]
    if len(steps) > 1:
        gains = divide(np.stack([step.cross for step in steps[1:]], axis=-1), np.stack([step.P_prior for step in steps[1:]], axis=-1))
    for k in range(len(steps) - 2, -1, -1):
        now, ahead, G = steps[k], steps[k + 1], gains[..., k]
        xs.append(_angles.wrap_components(now.x + G @ _angles.residual(xs[-1], ahead.x_prior, wrap), wrap))
        P = now.P + G @ (Ps[-1] - ahead.P_prior) @ G.T
        Ps.append((P + P.T) / 2)
    return Smoothed(np.stack(xs[::-1], axis=-1), np.stack(Ps[::-1], axis=-1))
