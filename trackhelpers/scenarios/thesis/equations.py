"""Random linear systems to check a printed equation on, and the largest difference from an independent derivation."""

from typing import NamedTuple

import numpy as np


class System(NamedTuple):
    """A linear system (2.8) with one value of each of its vectors: n states, m measured components, l inputs."""

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, l)
    H: np.ndarray  # (m, n)
    P: np.ndarray  # (n, n), prior covariance
    Q: np.ndarray  # (n, n)
    R: np.ndarray  # (m, m)
    x: np.ndarray  # (n,)
    u: np.ndarray  # (l,)
    w: np.ndarray  # (n,)
    v: np.ndarray  # (m,)

    @property
    def z(self):
        """The measurement Hx + v, shape (m,)."""
        return self.H @ self.x + self.v


def random_systems(rng, count=25, n=None, m=None):
    """Random linear systems, well conditioned, with full matrices.

    Parameters
    ----------
    rng : numpy.random.Generator
    count : int
        How many.
    n, m : int, optional
        Numbers of states and of measured components; without them each system draws its own, n from 1 to 4 and m from 1 to 3.

    Returns
    -------
    list of System

    Raises
    ------
    ValueError
        For a `count`, `n` or `m` that is not a whole number ≥ 1.
    """
    for name, value in (("count", count), ("n", n), ("m", m)):
        if value is not None and (value != int(value) or value < 1):
            raise ValueError(f"{name}: expected a whole number ≥ 1, got {value!r}")
    systems = []
    for _ in range(count):
        states = n or int(rng.integers(1, 5))
        components = m or int(rng.integers(1, 4))
        inputs = int(rng.integers(1, 3))
        A, B = rng.normal(size=(states, states)), rng.normal(size=(states, inputs))
        H = rng.normal(size=(components, states))
        P, Q, R = (_random_covariance(rng, size) for size in (states, states, components))
        vectors = [rng.normal(size=size) for size in (states, inputs, states, components)]
        systems.append(System(A, B, H, P, Q, R, *vectors))
    return systems


def _random_covariance(rng, size):
    root = rng.normal(size=(size, size))
    return root @ root.T / size + 0.2 * np.eye(size)


def largest_difference(points, printed, derived):
    """Residual of an equation: the largest entry by which the two forms differ over `points`.

    Parameters
    ----------
    points : sequence
        20 or more random points, each whatever the two functions take.
    printed, derived : callable
        Point -> number or array.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        For fewer than 20 points, or two forms whose results differ in shape, which broadcasting would hide.
    """
    if len(points) < 20:
        raise ValueError(f"points: expected 20 or more, got {len(points)}")
    differences = []
    for point in points:
        one, other = np.asarray(printed(point), dtype=float), np.asarray(derived(point), dtype=float)
        if one.shape != other.shape:
            raise ValueError(f"printed, derived: expected results of one shape, got {one.shape} and {other.shape}")
        differences.append(np.max(np.abs(one - other)))
    return float(np.max(differences))  # NaN where a form gives NaN


def gradient(J, K):
    """Derivative of a real function J by the matrix K, by the complex step: exact to rounding, with the shape of K.

    `J` must be built of analytic operations: products and traces, no conjugates and no absolute values.
    """
    K = np.asarray(K, dtype=float)
    slope = np.empty_like(K)
    for index in np.ndindex(K.shape):
        step = np.zeros(K.shape, dtype=complex)
        step[index] = 1e-30j
        slope[index] = np.imag(J(K + step)) / 1e-30
    return slope


def minimise_quadratic(J, shape):
    """The matrix of `shape` at which a convex quadratic function J is least; where many are, the one of least norm.

    Returns
    -------
    K : numpy.ndarray, shape `shape`
    curvature : numpy.ndarray, shape (r, r) with r the number of entries
        Second derivatives of J, entries in row order; positive definite where the minimiser is the only one.
    """
    size = int(np.prod(shape))
    start = gradient(J, np.zeros(shape)).ravel()
    units = np.eye(size).reshape(size, *shape)
    curvature = np.array([gradient(J, unit).ravel() - start for unit in units])
    return np.linalg.lstsq(curvature, -start, rcond=1e-10)[0].reshape(shape), curvature
