"""The checks of what the filters for manoeuvring targets take: windows, factors, pairs of models, inputs. `manoeuvre` re-exports them."""

import numpy as np

from trackhelpers.arrays import check_array, check_covariance, check_dt, check_matrix, check_scale
from trackhelpers.checks import check_count, check_numbers
from trackhelpers.model import check_model


def check_window(value, name="window", least=1):
    """`value` as an int; ValueError unless it is a whole number ≥ `least`."""
    return check_count(value, name, least)


def check_forgetting(value, name="rho"):
    """`value` as a float; ValueError unless 0 < value ≤ 1."""
    number = check_scale(value, name)
    if not 0 < number <= 1:
        raise ValueError(f"{name}: expected a forgetting factor in (0, 1], got {value!r}")
    return number


def check_inflation(value):
    """`value` as a float; ValueError unless it is a finite number ≥ 1."""
    number = check_scale(value, "inflation")
    if number < 1:
        raise ValueError(f"inflation: expected a factor ≥ 1, got {value!r}")
    return number


def check_step(dt):
    """`dt` as a float, s; ValueError unless it is a finite number > 0."""
    dt = check_dt(dt)
    if dt == 0:
        raise ValueError("dt: expected a step > 0 s, got 0")
    return dt


def check_pair(quiet, manoeuvring):
    """ValueError unless `quiet` is a Cartesian model such as CV and `manoeuvring` one with the same axes and accelerations, such as CA."""
    check_model(quiet, "quiet")
    check_model(manoeuvring, "manoeuvring")
    wanted = tuple(name for name in manoeuvring.state if not name.startswith("a"))
    if not (quiet.linear and manoeuvring.linear) or quiet.state != wanted or len(manoeuvring.state) * 2 != len(quiet.state) * 3:
        raise ValueError(
            f"quiet, manoeuvring: expected linear models with states such as (x, vx) and (x, vx, ax), got {quiet.state} and {manoeuvring.state}"
        )


def check_switching(stay, mu):
    """The transition matrix, [i, j] from model i to model j, and the first probabilities (2,); ValueError unless all lie strictly between 0 and 1."""
    stay, mu = check_array(stay, "stay", 2, ()), check_array(mu, "mu", 2, ())
    for name, value in (("stay", stay), ("mu", mu)):
        if np.any((value <= 0) | (value >= 1)):
            raise ValueError(f"{name}: expected two probabilities between 0 and 1, got {value}")
    if abs(mu.sum() - 1) > 1e-9:
        raise ValueError(f"mu: expected probabilities that sum to 1, got {mu}")
    return np.array([[stay[0], 1 - stay[0]], [1 - stay[1], stay[1]]]), mu


def check_input(F, G, H, window):
    """G (n, q) and `window`; ValueError unless the measurements of so many steps can tell every constant input from none."""
    n, m = len(F), len(H)
    G = np.array(check_numbers(G, "G"))
    if G.ndim != 2 or G.shape[0] != n or G.shape[1] == 0 or not np.all(np.isfinite(G)):
        raise ValueError(f"G: expected finite numbers of shape ({n}, q), one column an input, got shape {G.shape}")
    window, moved, seen = check_window(window), np.zeros_like(G), []
    for _ in range(window):
        moved = F @ moved + G
        seen.append(H @ moved)
    if np.linalg.matrix_rank(np.concatenate(seen)) < G.shape[1]:
        raise ValueError(f"window: expected enough steps to see {G.shape[1]} inputs in {m} measured components, got {window}")
    return G, window


def check_innovations(y, S, K, steps, F, G, H):
    """The checked arguments of `constant_input`."""
    given = {"y": y, "S": S, "K": K, "steps": steps}
    if (
        not all(isinstance(value, (list, tuple)) for value in given.values())
        or len({len(value) for value in given.values()}) > 1
        or not len(y)
    ):
        raise ValueError(
            f"y, S, K, steps: expected sequences, one entry a measurement, got {', '.join(type(v).__name__ for v in given.values())}"
        )
    G = check_numbers(G, "G")
    if G.ndim != 2 or 0 in G.shape or not np.isfinite(G).all():
        raise ValueError(f"G: expected finite numbers of shape (n, q), one column an input, got shape {G.shape}")
    n = len(G)
    F, H = check_matrix(F, "F", (n, n)), check_matrix(H, "H", (None, n))
    m = len(H)
    for k in range(len(y)):
        runs = check_array(y[k], f"y[{k}]", m).shape[1:]
        S_k, K_k = check_array(S[k], f"S[{k}]", m), check_array(K[k], f"K[{k}]", n)
        if S_k.shape[1:2] != (m,) or K_k.shape[1:2] != (m,) or len(S_k.shape) != 2 + len(runs) or len(K_k.shape) != 2 + len(runs):
            raise ValueError(
                f"S[{k}], K[{k}]: expected shapes ({m}, {m}, ...) and ({n}, {m}, ...) as y has runs, got {S_k.shape} and {K_k.shape}"
            )
        count = np.asarray(steps[k])
        if count.dtype.kind not in "iu" or count.shape not in ((), (1,), *([runs] if runs else [])) or not np.all(count >= 1):
            raise ValueError(f"steps[{k}]: expected whole numbers ≥ 1, got {steps[k]!r}")
    arrays = [[np.asarray(each, dtype=float) for each in value] for value in (y, S, K)]
    return *arrays, steps, F, G, H


def check_spread(value, name, n):
    """`value` as a covariance (n, n), or of many runs, (n, n, M), of which some may have diverged."""
    value = check_array(value, name, n)
    return check_covariance(value, name, n) if value.ndim < 3 else value


def check_probabilities(value, name, shape):
    """Probabilities of this shape that sum to one along the last axis, a copy; ValueError otherwise."""
    p = check_array(value, name, shape[0], shape[1:])
    if not np.all(np.isfinite(p)) or np.any(p < 0) or np.any(np.abs(p.sum(axis=-1) - 1) > 1e-9):
        raise ValueError(f"{name}: expected probabilities that sum to 1, got {p.tolist()}")
    return p.copy()
