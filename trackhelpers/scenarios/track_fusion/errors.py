"""What paper 2's filters and fusion rules do on the average, without sampling.

None of the gains depends on the data. The errors of the three filters are therefore one linear recursion (`exact_errors`), and a rule of fusion is one matrix of
weights a step (`fuse`), good for all runs and for the exact recursion alike.
"""

from typing import NamedTuple

import numpy as np

from trackhelpers import exact
from trackhelpers.arrays import check_covariance, check_scale, congruence, inverse
from trackhelpers.fusion import bar_shalom_campo, convex_combination, covariance_intersection, cross_covariance
from trackhelpers.motion import CV
from trackhelpers.scenarios.track_fusion.tracks import MODEL, T

_BACK = np.kron(
    np.eye(2), [[0, 0], [1 / T, -1]]
)  # error of (p(1) − p(0))/T as velocity at step 1, from the deviation d of the step from x(1) = F x(0)


class Design(NamedTuple):
    """What is known of the three filters before any measurement; 12 is 3 filters × 4 components, 4 is 2 sensors × 2 components where it stands for them."""

    first: int  # the step of the first estimate: 0 with a prior, 1 with two points
    model: CV
    pair: tuple
    P: np.ndarray  # (3, 4, 4, N) the filters' own covariances, NaN before `first`
    P12: np.ndarray  # (4, 4, N) the cross-covariance of filters 1 and 2 by the recursion with the model's Q
    A: np.ndarray  # (12, 12, N) I − KH of each filter, on the diagonal
    K: np.ndarray  # (12, 4, N) gains on the measurements of both sensors
    ahead: np.ndarray  # (12, 4) first estimates from the measurements at step 1, zero with a prior
    behind: np.ndarray  # (12, 4) and from those at step 0


class Fused(NamedTuple):
    """A rule of fusion over all steps: x = W [x₁; x₂; x_c], and the covariance it believes; NaN where the rule is not defined."""

    W: np.ndarray  # (4, 12, N)
    P: np.ndarray  # (4, 4, N)

    def estimate(self, x):
        """Fused estimates (4, N, M) from those of the filters (3, 4, N, M)."""
        return np.einsum("ijk,jkm->ikm", self.W, x.reshape(12, *x.shape[2:]))

    def error(self, bias, covariance):
        """Exact mean (4, N) and covariance (4, 4, N) of the fused error, from those of `exact_errors`."""
        return np.einsum("ijk,jk->ik", self.W, bias), congruence(self.W, covariance)


def two_points(R, Q):
    """Covariance of the two-point start, and the part of it that two sensors have in common.

    x̂(1) = (z(1), (z(1) − z(0))/T) an axis. The covariance is [[R, R/T], [R/T, 2R/T² + qT²/4]] an axis; only qT²/4 on the velocity, the process noise between the
    two points, is common.

    Parameters
    ----------
    R : array_like, shape (2, 2)
    Q : array_like, shape (4, 4)
        Process noise covariance of a step.

    Returns
    -------
    P, common : numpy.ndarray, shape (4, 4)
    """
    R, common = check_covariance(R, "R", 2), congruence(_BACK, check_covariance(Q, "Q", 4))
    return np.kron(R, [[1, 1 / T], [1 / T, 2 / T**2]]) + common, common


def design(pair, steps, start="two points", model=MODEL, P0=None):
    """Gains and covariances of the three filters over `steps` samples.

    Parameters
    ----------
    pair : two sensors
        Position sensors made for the state of the model.
    steps : int
        Number of samples N ≥ 2.
    start : {"two points", "prior"}
        "prior" is the source's: x̂(0|0) = E[x(0)] with covariance P0 in all three filters, so P12(0|0) = P0. "two points" starts at step 1 from the positions
        measured at steps 0 and 1, with the covariance of `two_points`, so P12(1|1) = diag(0, qT²/4) an axis.
    model : CV
        Two axes.
    P0 : array_like, shape (4, 4), optional
        Of the prior; default 0, which is what E[(x(0) − x̂)(x(0) − x̂)ᵀ] is on a track whose beginning is known.

    Returns
    -------
    Design
    """
    if start not in ("two points", "prior"):
        raise ValueError(f"start: expected 'two points' or 'prior', got {start!r}")
    if start == "two points" and P0 is not None:
        raise ValueError("P0: expected None with start='two points', whose covariance follows from the sensors")
    if not isinstance(steps, (int, np.integer)) or steps < 2:
        raise ValueError(f"steps: expected a whole number ≥ 2, got {steps!r}")
    F, Q, H, R1, R2, R = _matrices(pair, model)
    Rs = (R1, R2, inverse(inverse(R1) + inverse(R2)))
    P, P12 = np.full((3, 4, 4, steps), np.nan), np.full((4, 4, steps), np.nan)
    A, K, ahead, behind = np.zeros((12, 12, steps)), np.zeros((12, 4, steps)), np.zeros((12, 4)), np.zeros((12, 4))
    if start == "prior":
        first = 0
        P[..., 0] = P12[..., 0] = check_covariance(np.zeros((4, 4)) if P0 is None else P0, "P0", 4)
    else:
        first = 1
        P[..., 1], P12[..., 1] = [two_points(noise, Q)[0] for noise in Rs], two_points(R1, Q)[1]
        mean = np.vstack([np.eye(4), np.hstack([Rs[2] @ inverse(R1), Rs[2] @ inverse(R2)])])  # the third is the weighted mean of both
        ahead, behind = (np.kron(np.eye(6), [[1], [slope]]) @ mean for slope in (1 / T, -1 / T))
        behind[::2] = 0
    seen = ((H, R1, slice(0, 2)), (H, R2, slice(2, 4)), (np.vstack([H, H]), R, slice(0, 4)))
    for i, (rows, noise, columns) in enumerate(seen):
        mine, known = slice(4 * i, 4 * i + 4), exact.gains(F, rows, Q, noise, P[i, ..., first], steps - first - 1)
        A[mine, mine, first + 1 :], K[mine, columns, first + 1 :], P[i, ..., first:] = known.A, known.K, known.P
    for k in range(first + 1, steps):
        P12[..., k] = cross_covariance(P12[..., k - 1], F, Q, K[:4, :2, k], H, K[4:8, 2:, k], H)
    return Design(first, model, tuple(pair), P, P12, A, K, ahead, behind)


def exact_errors(plan, truth, sigma_a=0.0):
    """Mean and joint covariance of the three filters' errors x̂ − x on one track: what Monte Carlo would converge to.

    With a true step x_k = F x_{k−1} + d_k + G a_k, e_k = (I − KH)(F e_{k−1} − d_k − G a_k) + K v_k: the mean carries what the model gets wrong, the covariance
    the measurement noise v and, where the truth is random, its noise a, common to all filters. A prior is taken to be right, x̂(0|0) = x(0).

    Parameters
    ----------
    plan : Design
    truth : array_like, shape (4, N)
        The track without process noise.
    sigma_a : float
        *True* standard deviation of the random acceleration, m/s², as in `simulate`.

    Returns
    -------
    bias : numpy.ndarray, shape (12, N), NaN before the first estimate
    covariance : numpy.ndarray, shape (12, 12, N)
    """
    truth, steps = np.asarray(truth, dtype=float), plan.P.shape[-1]
    if truth.shape != (4, steps):
        raise ValueError(f"truth: expected shape (4, {steps}), got {truth.shape}")
    F, *_, R = _matrices(plan.pair, plan.model)
    first, E, d = plan.first, np.tile(np.eye(4), (3, 1)), truth[:, 1:] - F @ truth[:, :-1]
    Q = check_scale(sigma_a, "sigma_a") ** 2 * congruence(plan.model.G(np.zeros(4), T), np.eye(2))
    start = np.zeros(12), np.zeros((12, 12))
    if first == 1:
        start = E @ _BACK @ d[:, 0], congruence(plan.ahead, R) + congruence(plan.behind, R) + congruence(E @ _BACK, Q)
    bias, covariance = np.full((12, steps), np.nan), np.full((12, 12, steps), np.nan)
    later = slice(first + 1, None)
    joint = exact.errors(np.kron(np.eye(3), F), plan.A[..., later], plan.K[..., later], R, E @ d[:, first:], congruence(E, Q), *start)
    bias[:, first:], covariance[..., first:] = joint
    return bias, covariance


def fuse(plan):
    """Every rule of fusion as weights: rule -> `Fused`, for "sensor 1", "sensor 2", "convex", "BSC", "CI" and "centralised".

    The rules are linear in the estimates, so fusing the columns of [I 0] and [0 I] gives the weights. The first three need definite covariances and are NaN
    where those are singular (after a prior with P0 = 0 for two steps); the centralised filter and the sensors have weights of 0 and 1.
    """
    steps = plan.P.shape[-1]
    rules = {name: Fused(np.full((4, 12, steps), np.nan), np.full((4, 4, steps), np.nan)) for name in ("convex", "BSC", "CI")}
    x1, x2 = np.eye(4, 8), np.eye(4, 8, 4)
    for k in range(plan.first, steps):
        P1, P2 = plan.P[0, ..., k], plan.P[1, ..., k]
        if min(np.linalg.eigvalsh(P)[0] / max(np.trace(P), np.finfo(float).tiny) for P in (P1, P2)) < 1e-12:
            continue
        fused = {
            "convex": convex_combination([x1, x2], [P1, P2]),
            "BSC": bar_shalom_campo(x1, P1, x2, P2, plan.P12[..., k]),
            "CI": covariance_intersection(x1, P1, x2, P2),
        }
        for name, (weights, P) in fused.items():
            rules[name].W[..., k], rules[name].P[..., k] = np.hstack([weights, np.zeros((4, 4))]), P
    own = [Fused(np.repeat(np.eye(4, 12, 4 * i)[..., None], steps, axis=2), plan.P[i]) for i in range(3)]
    return {"sensor 1": own[0], "sensor 2": own[1], **rules, "centralised": own[2]}


def rms(bias, covariance):
    """Exact root mean square error of each component, (n, N), from mean (n, N) and covariance (n, n, N)."""
    return np.sqrt(np.square(bias) + np.einsum("iik->ik", covariance))


def expected_nees(bias, covariance, P):
    """Exact mean of NEES, tr P⁻¹(C + bbᵀ), shape (N,); NaN where the believed P (n, n, N) is missing or singular."""
    second = covariance + np.einsum("ik,jk->ijk", bias, bias)
    return np.einsum("ijk,ijk->k", inverse(P), second)


def _matrices(pair, model):
    """F, Q, H, R₁, R₂ and R of both sensors together."""
    if not isinstance(model, CV) or model.axes != 2:
        raise ValueError(f"model: expected a CV with two axes, got {model!r}")
    pair = tuple(pair)
    if len(pair) != 2 or any(getattr(sensor, "state", None) != model.state for sensor in pair):
        raise ValueError(f"pair: expected two sensors made with state={model.state}, got {pair!r}")
    F, Q, H, R1, R2 = model.F(np.zeros(4), T), model.Q(np.zeros(4), T), pair[0].H(np.zeros(4)), pair[0].R, pair[1].R
    return F, Q, H, R1, R2, np.block([[R1, np.zeros((2, 2))], [np.zeros((2, 2)), R2]])
