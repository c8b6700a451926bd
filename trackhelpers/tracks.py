"""What the rules of track fusion are given, checked: estimates of one state, their covariances, and what correlates them."""

import numpy as np

from trackhelpers.angles import wrap
from trackhelpers.checks import check_angles, check_array, check_covariance, check_matrix


def check_tracks_and_covariances(x_name, xs, P_name, Ps):
    """Lists of estimates and covariances, as many of the one as of the other, and their names in messages."""
    xs, Ps = check_listed(xs, x_name), check_listed(Ps, P_name)
    if len(Ps) != len(xs):
        raise ValueError(f"{P_name}: expected {len(xs)} covariances, one a track, got {len(Ps)}")
    return xs, Ps, [f"{x_name}[{i}]" for i in range(len(xs))], [f"{P_name}[{i}]" for i in range(len(xs))]


def check_listed(values, name):
    if not isinstance(values, (list, tuple, np.ndarray)):
        raise ValueError(f"{name}: expected a sequence, one a track, got {values!r}")
    return list(values)


def check_estimates(xs, names, angles):
    """Checked estimates, all (n,) or all (n, M), their angular components within half a turn of the first one's."""
    if not xs:
        raise ValueError("xs: expected at least one track, got an empty list")
    first = check_array(xs[0], names[0], None)
    xs = [first, *(check_array(x, name, len(first)) for x, name in zip(xs[1:], names[1:], strict=True))]
    if any(x.shape != first.shape or x.ndim > 2 for x in xs):
        raise ValueError(f"{', '.join(names)}: expected estimates that are all (n,) or all (n, M), got {[x.shape for x in xs]}")
    rows = list(check_angles(angles, len(first)))
    if rows:
        xs = [np.array(x) for x in xs]
        for x in xs[1:]:
            x[rows] = first[rows] + wrap(x[rows] - first[rows])
    return xs


def check_tracks(xs, Ps, x_names, P_names, angles, definite=True):
    """Checked estimates, as `check_estimates` returns them, and covariances."""
    xs = check_estimates(xs, x_names, angles)
    return xs, alike(*(check_covariance(P, name, len(xs[0]), runs_of(xs), definite) for P, name in zip(Ps, P_names, strict=True)))


def runs_of(xs):
    """Number of runs among the estimates, None for one target."""
    return xs[0].shape[1] if xs[0].ndim == 2 else None


def check_cross(value, name, n, runs):
    return check_matrix(value, name, (n, n) if runs is None or np.ndim(value) == 2 else (n, n, runs))


def alike(*matrices):
    """The matrices, all with a run axis if any has one."""
    dims = max(A.ndim for A in matrices)
    return np.broadcast_arrays(*[A if A.ndim == dims else A[..., None] for A in matrices])
