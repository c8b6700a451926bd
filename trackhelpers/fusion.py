"""Track fusion: one estimate out of several estimates of the same state.

Every rule takes one target, x (n,) and P (n, n), or an ensemble, x (n, M) and P (n, n, M); a common P (n, n) may go with x (n, M). Every rule returns the
fused x and the covariance that it believes x to have, which is the true one only where the rule's assumption holds: independence for the convex
combination, the right cross-covariance for Bar-Shalom–Campo and maximum likelihood, nothing at all for covariance intersection (it believes too little).
"""

import numpy as np

from trackhelpers.arrays import check_array, check_covariance, congruence, inverse, matmul, matvec, symmetrised, transpose


def convex_combination(xs, Ps):
    """Simple convex combination: P⁻¹ = Σ Pᵢ⁻¹, x = P Σ Pᵢ⁻¹ xᵢ (paper 2, section 2.3, its stray bracket removed).

    Parameters
    ----------
    xs : sequence of array_like, shape (n,) or (n, M)
        Estimates of N tracks whose errors are taken to be uncorrelated.
    Ps : sequence of array_like, shape (n, n) or (n, n, M)
        Their covariances, positive definite.

    Returns
    -------
    x, P : numpy.ndarray

    Raises
    ------
    ValueError
        No track, lists of different length, shapes that do not fit, a P that is not positive definite.
    """
    xs, Ps = _tracks(xs, Ps)
    weights = [inverse(P) for P in Ps]
    P = inverse(sum(weights))
    return matvec(P, sum(matvec(weight, x) for weight, x in zip(weights, xs, strict=True))), symmetrised(P)


def bar_shalom_campo(x1, P1, x2, P2, P12):
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

    Returns
    -------
    x, P : numpy.ndarray

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, or P12 so large that the joint covariance is indefinite.
    """
    x1, P1, x2, P2, runs = _pair(x1, P1, x2, P2)
    P1, P2, P12 = _alike(P1, P2, _cross(P12, "P12", len(x1), runs))
    _check_joint(np.block([[_last(P1), _last(P12)], [_last(transpose(P12)), _last(P2)]]), "P12")
    S = symmetrised(P1 + P2 - P12 - transpose(P12))
    W = matmul(P1 - P12, _pseudo_inverse(S))
    return x1 + matvec(W, x2 - x1), symmetrised(P1 - matmul(W, P1 - transpose(P12)))


def maximum_likelihood(xs, P_joint):
    """Maximum-likelihood fusion of N correlated tracks: P = (Eᵀ 𝐏⁻¹ E)⁻¹, x = P Eᵀ 𝐏⁻¹ [x₁; …; x_N], E = 1 ⊗ I.

    It is found as the best linear unbiased combination, which exists for a singular 𝐏 too: minimise Wᵀ𝐏W subject to EᵀW = I.

    Parameters
    ----------
    xs : sequence of array_like, shape (n,) or (n, M)
        Estimates of N tracks.
    P_joint : array_like, shape (N n, N n)
        Joint covariance of their errors, track after track; positive semidefinite.

    Returns
    -------
    x : numpy.ndarray, shape (n,) or (n, M)
    P : numpy.ndarray, shape (n, n)

    Raises
    ------
    ValueError
        No track, shapes that do not fit, a joint covariance that is not one.
    """
    xs = _estimates(xs)
    n, N = len(xs[0]), len(xs)
    joint = check_covariance(P_joint, "P_joint", n * N)
    E = np.tile(np.eye(n), (N, 1))
    scale = np.trace(joint) / len(joint) or 1.0
    bordered = np.block([[joint / scale, E], [E.T, np.zeros((n, n))]])
    weights = np.linalg.lstsq(bordered, np.vstack([np.zeros((n * N, n)), np.eye(n)]), rcond=None)[0][: n * N]
    x = np.einsum("ij,i...->j...", weights, np.concatenate(np.broadcast_arrays(*xs)))
    return x, symmetrised(weights.T @ joint @ weights)


def covariance_intersection(x1, P1, x2, P2):
    """Covariance intersection: P⁻¹ = ωP₁⁻¹ + (1−ω)P₂⁻¹ with the ω in [0, 1] that makes det P least. Never overconfident, whatever the correlation.

    With λ the eigenvalues of P₂P₁⁻¹ the determinant's logarithm is −Σ log(1 + ω(λ − 1)) up to a constant; it is convex, and the root of its derivative is
    found by bisection, for all runs at once. Where every ω is as good as any other, P₁ = P₂, it is ½.

    Parameters
    ----------
    x1, x2 : array_like, shape (n,) or (n, M)
    P1, P2 : array_like, shape (n, n) or (n, n, M)
        Positive definite.

    Returns
    -------
    x, P : numpy.ndarray

    Raises
    ------
    ValueError
        Shapes that do not fit, or a P that is not positive definite.
    """
    x1, P1, x2, P2, _ = _pair(x1, P1, x2, P2, definite=True)
    P1, P2 = _alike(P1, P2)
    first, second = inverse(P1), inverse(P2)
    ratios = np.linalg.eigvals(np.moveaxis(matmul(P2, first), (0, 1), (-2, -1))).real - 1
    low, high = np.zeros(ratios.shape[:-1]), np.ones(ratios.shape[:-1])
    for _ in range(60):
        middle = 0.5 * (low + high)
        slope = np.sum(ratios / (1 + middle[..., None] * ratios), axis=-1)
        low, high = np.where(slope > 1e-9, middle, low), np.where(slope < -1e-9, middle, high)
    omega = 0.5 * (low + high)
    P = inverse(omega * first + (1 - omega) * second)
    return matvec(P, matvec(omega * first, x1) + matvec((1 - omega) * second, x2)), symmetrised(P)


def information_fusion(x_prior, P_prior, xs, Ps, x_priors, P_priors):
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

    Returns
    -------
    x, P : numpy.ndarray

    Raises
    ------
    ValueError
        As for `convex_combination`.
    """
    (x_bar,), (P_bar,) = _tracks([x_prior], [P_prior], "x_prior", "P_prior")
    xs, Ps = _tracks(xs, Ps)
    x_priors, P_priors = _tracks(x_priors, P_priors, "x_priors", "P_priors")
    if len(x_priors) != len(xs) or len(xs[0]) != len(x_bar):
        raise ValueError(f"x_priors: expected {len(xs)} tracks of {len(x_bar)} components, got {len(x_priors)} of {len(x_priors[0])}")
    information = inverse(P_bar)
    state = matvec(information, x_bar)
    for x, P, x_i, P_i in zip(xs, Ps, x_priors, P_priors, strict=True):
        after, before = inverse(P), inverse(P_i)
        information = information + after - before
        state = state + matvec(after, x) - matvec(before, x_i)
    P = inverse(information)
    return matvec(P, state), symmetrised(P)


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
    P12 = np.asarray(P12, dtype=float)
    n = len(np.atleast_1d(P12))
    P12, F, Q = _cross(P12, "P12", n, None), _cross(F, "F", n, None), check_covariance(Q, "Q", n)
    gains = []
    for name, K, H in (("1", K1, H1), ("2", K2, H2)):
        K, H = np.asarray(K, dtype=float), np.asarray(H, dtype=float)
        if (
            K.ndim != 2
            or H.ndim != 2
            or K.shape != (n, H.shape[0])
            or H.shape[1] != n
            or not (np.isfinite(K).all() and np.isfinite(H).all())
        ):
            raise ValueError(f"K{name}, H{name}: expected finite shapes ({n}, m) and (m, {n}), got {K.shape} and {H.shape}")
        gains.append(np.eye(n) - K @ H)
    return gains[0] @ (congruence(F, P12) + Q) @ gains[1].T


def _estimates(xs, name="xs"):
    xs = list(xs)
    if not xs:
        raise ValueError(f"{name}: expected at least one track, got an empty list")
    n = len(np.atleast_1d(xs[0]))
    return [check_array(x, f"{name}[{i}]", n) for i, x in enumerate(xs)]


def _tracks(xs, Ps, x_name="xs", P_name="Ps"):
    """Checked lists of estimates and definite covariances."""
    xs, Ps = _estimates(xs, x_name), list(Ps)
    if len(Ps) != len(xs):
        raise ValueError(f"{P_name}: expected {len(xs)} covariances, one a track, got {len(Ps)}")
    n, runs = len(xs[0]), _runs(*xs)
    return xs, [check_covariance(P, f"{P_name}[{i}]", n, runs, definite=True) for i, P in enumerate(Ps)]


def _pair(x1, P1, x2, P2, definite=False):
    """Two checked tracks, and the number of runs."""
    n = len(np.atleast_1d(x1))
    x1, x2 = check_array(x1, "x1", n), check_array(x2, "x2", n)
    runs = _runs(x1, x2)
    return x1, check_covariance(P1, "P1", n, runs, definite), x2, check_covariance(P2, "P2", n, runs, definite), runs


def _runs(*xs):
    """Number of runs among the estimates, None for one target; they must agree."""
    shapes = {x.shape[1:] for x in xs}
    if len(shapes) > 1 or any(len(shape) > 1 for shape in shapes):
        raise ValueError(f"xs: expected estimates that are all (n,) or all (n, M), got {[x.shape for x in xs]}")
    (shape,) = shapes
    return shape[0] if shape else None


def _cross(value, name, n, runs):
    A = np.asarray(value, dtype=float)
    shapes = [(n, n)] if runs is None else [(n, n), (n, n, runs)]
    if A.shape not in shapes or not np.all(np.isfinite(A)):
        raise ValueError(f"{name}: expected finite numbers of shape {' or '.join(map(str, shapes))}, got shape {A.shape}")
    return A


def _alike(*matrices):
    """The matrices, all with a run axis if any has one."""
    dims = max(A.ndim for A in matrices)
    return np.broadcast_arrays(*[A if A.ndim == dims else A[..., None] for A in matrices])


def _last(A):
    return np.moveaxis(A, (0, 1), (-2, -1))


def _check_joint(joint, name):
    smallest = np.linalg.eigvalsh(joint)[..., 0]
    if np.any(smallest < -1e-9 * np.max(np.abs(joint))):
        raise ValueError(
            f"{name}: expected a cross-covariance that P1 and P2 allow, got a joint covariance of smallest eigenvalue {np.min(smallest):.3g}"
        )


def _pseudo_inverse(S):
    return np.moveaxis(np.linalg.pinv(_last(S), hermitian=True, rcond=1e-12), (-2, -1), (0, 1))
