"""Track fusion: one estimate out of several estimates of the same state.

Every rule takes one target, x (n,) and P (n, n), or an ensemble, x (n, M) and P (n, n, M); a common P (n, n) may go with x (n, M). Every rule returns the
fused x and the covariance that it believes x to have, which is the true one only where the rule's assumption holds: independence for the convex
combination, the right cross-covariance for Bar-Shalom–Campo and maximum likelihood, nothing at all for covariance intersection (it believes too little).

``angles=`` are the indices of the angular components, rad: all estimates are taken within half a turn of the first one, and the fused angle lies in [−π, π).
Units do not matter: what is singular is decided in units of the standard deviations.
"""

import numpy as np

from trackhelpers.angles import wrap_rows
from trackhelpers.arrays import cholesky, congruence, inverse, matmul, matvec, solve_lower, symmetrised, transpose
from trackhelpers.checks import all_finite, check_array, check_covariance, check_matrix, deviations
from trackhelpers.tracks import alike, check_cross, check_estimates, check_listed, check_tracks, check_tracks_and_covariances, runs_of

_ROUNDING = 1e-12  # of a variance, in units of what it is the difference of


def convex_combination(xs, Ps, angles=()):
    """Simple convex combination: P⁻¹ = Σ Pᵢ⁻¹, x = P Σ Pᵢ⁻¹ xᵢ (paper 2, section 2.3, its stray bracket removed).

    Parameters
    ----------
    xs : sequence of array_like, shape (n,) or (n, M)
        Estimates of N tracks whose errors are taken to be uncorrelated.
    Ps : sequence of array_like, shape (n, n) or (n, n, M)
        Their covariances, positive definite.
    angles : sequence of int

    Returns
    -------
    x, P : numpy.ndarray

    Raises
    ------
    ValueError
        No track, lists of different length, shapes that do not fit, a P that is not positive definite.
    """
    xs, Ps = check_tracks(*check_tracks_and_covariances("xs", xs, "Ps", Ps), angles)
    weights = [inverse(P) for P in Ps]
    P = inverse(sum(weights))
    x = matvec(P, sum(matvec(weight, x) for weight, x in zip(weights, xs, strict=True)))
    return wrap_rows(x, angles), symmetrised(P)


def bar_shalom_campo(x1, P1, x2, P2, P12, angles=()):
    """Bar-Shalom–Campo fusion of two correlated tracks (paper 2, section 2.3, with the minus sign that it prints as plus).

    W = (P₁ − P₁₂)(P₁ + P₂ − P₁₂ − P₂₁)⁻¹, x = x₁ + W(x₂ − x₁), P = P₁ − W(P₁ − P₂₁). Where the matrix in the bracket, the covariance of x₂ − x₁, is
    singular (a common prior that nobody has left yet) its pseudo-inverse is taken: along directions in which the tracks cannot differ there is
    nothing to choose.

    Parameters
    ----------
    x1, x2 : array_like, shape (n,) or (n, M)
    P1, P2 : array_like, shape (n, n) or (n, n, M)
        Positive semidefinite.
    P12 : array_like, shape (n, n) or (n, n, M)
        Cross-covariance E[e₁ e₂ᵀ]; P₂₁ is its transpose.
    angles : sequence of int

    Returns
    -------
    x, P : numpy.ndarray

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, or P12 so large that the joint covariance is indefinite.
    """
    (x1, x2), (P1, P2) = check_tracks([x1, x2], [P1, P2], ["x1", "x2"], ["P1", "P2"], angles, definite=False)
    P1, P2, P12 = alike(P1, P2, check_cross(P12, "P12", len(x1), runs_of([x1])))
    P21 = transpose(P12)
    joint = np.concatenate([np.concatenate([P1, P12], axis=1), np.concatenate([P21, P2], axis=1)])
    check_covariance(joint, "P12, with P1 and P2 as the joint covariance", len(joint), *joint.shape[2:])
    sigma = deviations(P1 + P2)
    S = symmetrised(P1 + P2 - P12 - P21) / sigma[:, None] / sigma
    W = matmul(P1 - P12, _pseudo_inverse(S) / sigma[:, None] / sigma)
    return wrap_rows(x1 + matvec(W, x2 - x1), angles), symmetrised(P1 - matmul(W, P1 - P21))


def maximum_likelihood(xs, P_joint, angles=()):
    """Maximum-likelihood fusion of N correlated tracks: P = (Eᵀ 𝐏⁻¹ E)⁻¹, x = P Eᵀ 𝐏⁻¹ [x₁; …; x_N], E = 1 ⊗ I.

    It is found as the best linear unbiased combination, which exists for a singular 𝐏 too: minimise Wᵀ𝐏W subject to EᵀW = I.

    Parameters
    ----------
    xs : sequence of array_like, shape (n,) or (n, M)
        Estimates of N tracks.
    P_joint : array_like, shape (N n, N n)
        Joint covariance of their errors, track after track; positive semidefinite.
    angles : sequence of int

    Returns
    -------
    x : numpy.ndarray, shape (n,) or (n, M)
    P : numpy.ndarray, shape (n, n)

    Raises
    ------
    ValueError
        No track, shapes that do not fit, a joint covariance that is not one.
    """
    xs = check_listed(xs, "xs")
    xs = check_estimates(xs, [f"xs[{i}]" for i in range(len(xs))], angles)
    n, N = len(xs[0]), len(xs)
    joint = check_covariance(P_joint, "P_joint", n * N)
    variances = joint.diagonal().reshape(N, n)
    sigma = np.sqrt(
        np.where(variances > 0, variances, variances.max(axis=0)).ravel()
    )  # no variance: the unit of the other tracks' component
    sigma[sigma == 0] = 1
    E = np.tile(np.eye(n), (N, 1)) / sigma[:, None]
    unit = np.linalg.norm(E, axis=0)
    bordered = np.block([[joint / np.outer(sigma, sigma), E / unit], [(E / unit).T, np.zeros((n, n))]])
    weights = np.linalg.lstsq(bordered, np.vstack([np.zeros((n * N, n)), np.eye(n)]), rcond=_ROUNDING)[0][: n * N]
    weights /= np.outer(sigma, unit)
    x = np.einsum("ij,i...->j...", weights, np.concatenate(xs))
    return wrap_rows(x, angles), symmetrised(weights.T @ joint @ weights)


def covariance_intersection(x1, P1, x2, P2, angles=()):
    """Covariance intersection: P⁻¹ = ωP₁⁻¹ + (1−ω)P₂⁻¹ with the ω in [0, 1] that makes det P least. Never overconfident, whatever the correlation.

    With λ the eigenvalues of P₂P₁⁻¹ the determinant's logarithm is −Σ log(1 + ω(λ − 1)) up to a constant; it is convex, and the root of its derivative is
    found by bisection, for all runs at once. Where every ω is as good as any other, P₁ = P₂, it is ½.

    Parameters
    ----------
    x1, x2 : array_like, shape (n,) or (n, M)
    P1, P2 : array_like, shape (n, n) or (n, n, M)
        Positive definite.
    angles : sequence of int

    Returns
    -------
    x, P : numpy.ndarray

    Raises
    ------
    ValueError
        Shapes that do not fit, or a P that is not positive definite.
    """
    (x1, x2), (P1, P2) = check_tracks([x1, x2], [P1, P2], ["x1", "x2"], ["P1", "P2"], angles)
    first, second = inverse(P1), inverse(P2)
    ratios = np.linalg.svd(_last(solve_lower(cholesky(P1), cholesky(P2))), compute_uv=False) ** 2 - 1
    low, high = np.zeros(ratios.shape[:-1]), np.ones(ratios.shape[:-1])
    for _ in range(60):
        middle = 0.5 * (low + high)
        slope = np.sum(ratios / (1 + middle[..., None] * ratios), axis=-1)
        low, high = np.where(slope > 1e-9, middle, low), np.where(slope < -1e-9, middle, high)
    omega = 0.5 * (low + high)
    P = inverse(omega * first + (1 - omega) * second)
    x = matvec(P, matvec(omega * first, x1) + matvec((1 - omega) * second, x2))
    return wrap_rows(x, angles), symmetrised(P)


def information_fusion(x_prior, P_prior, xs, Ps, x_priors, P_priors, angles=()):
    """Fusion of what each track has learnt since its own prediction: P⁻¹ = P̄⁻¹ + Σ(Pᵢ⁻¹ − P̄ᵢ⁻¹), and so for P⁻¹x.

    Done at every step it equals the centralised filter. Without feedback each track keeps its own prediction (x̄ᵢ, P̄ᵢ); with feedback all of them predict from
    the fused estimate, and (x̄ᵢ, P̄ᵢ) is (x̄, P̄).

    Parameters
    ----------
    x_prior, P_prior : array_like, shapes (n,) or (n, M), and (n, n) or (n, n, M)
        The fused estimate, predicted to this step.
    xs, Ps : sequences
        The tracks after their measurements.
    x_priors, P_priors : sequences
        The tracks before their measurements.
    angles : sequence of int

    Returns
    -------
    x, P : numpy.ndarray

    Raises
    ------
    ValueError
        As for `convex_combination`, and where the tracks' predictions are so sure that less than nothing would be left.
    """
    after, before = (
        check_tracks_and_covariances("xs", xs, "Ps", Ps),
        check_tracks_and_covariances("x_priors", x_priors, "P_priors", P_priors),
    )
    N = len(after[0])
    if len(before[0]) != N:
        raise ValueError(f"x_priors: expected {N} tracks, as in xs, got {len(before[0])}")
    fused = [x_prior], [P_prior], ["x_prior"], ["P_prior"]
    xs, Ps = check_tracks(*(a + b + c for a, b, c in zip(fused, after, before, strict=True)), angles)
    weights = [inverse(P) for P in Ps]
    states = [matvec(weight, x) for weight, x in zip(weights, xs, strict=True)]
    information, state = weights[0], states[0]
    for i in range(1, N + 1):
        information = information + weights[i] - weights[N + i]
        state = state + states[i] - states[N + i]
    P = inverse(information)
    if not all_finite(P):
        raise ValueError(
            "P_priors: expected predictions no surer than what became of them, Ps, got ones of which more information is taken away than there is"
        )
    return wrap_rows(matvec(P, state), angles), symmetrised(P)


def cross_covariance(P12, F, Q, K1, H1, K2, H2):
    """One step of the cross-covariance of two filters on the same target: (I − K₁H₁)(F P₁₂ Fᵀ + Q)(I − K₂H₂)ᵀ.

    Parameters
    ----------
    P12 : array_like, shape (n, n)
        After the last step; at the start the covariance of what both filters were told, 0 if they started apart.
    F, Q : array_like, shape (n, n)
        Transition and process noise, which both tracks share.
    K1, K2 : array_like, shape (n, m₁), (n, m₂)
        *This* step's gains, read after `update`; a gain with no column is a missing measurement.
    H1, H2 : array_like, shape (m₁, n), (m₂, n)

    Returns
    -------
    numpy.ndarray, shape (n, n)

    Raises
    ------
    ValueError
        Shapes that do not fit, or numbers that are not finite.
    """
    n = len(check_array(P12, "P12", None))
    P12 = check_matrix(P12, "P12", (n, n))
    F, Q = check_matrix(F, "F", (n, n)), check_covariance(Q, "Q", n)
    kept = []
    for name, K, H in (("1", K1, H1), ("2", K2, H2)):
        H = check_matrix(H, f"H{name}", (None, n))
        kept.append(np.eye(n) - check_matrix(K, f"K{name}", (n, len(H))) @ H)
    return kept[0] @ (congruence(F, P12) + Q) @ kept[1].T


def _last(A):
    return np.moveaxis(A, (0, 1), (-2, -1))


def _pseudo_inverse(S):
    """Of symmetric S (n, n, ...) in units in which rounding is about 1e-16."""
    values, vectors = np.linalg.eigh(_last(S))
    inverted = np.where(values > _ROUNDING, 1 / np.where(values > _ROUNDING, values, 1), 0)
    return np.einsum("...ik,...k,...jk->ij...", vectors, inverted, vectors)
