"""What a step of each filter of paper 3's introduction costs, in additions, multiplications and divisions of dense matrices.

A count, and not a time: it does not depend on the machine, and nobody's clever use of zeros is in it. The product of an (a, b) with a (b, c) matrix takes a c (2b − 1) operations;
the inverse of an m × m matrix is counted as 2m³. Exponentials, logarithms and comparisons count one each.
"""


def product(a, b, c):
    """(a, b) times (b, c)."""
    return a * c * (2 * b - 1)


def inverse(m):
    """Of an m × m matrix."""
    return 2 * m**3


def predict(n):
    """F x and F P Fᵀ + Q."""
    return product(n, n, 1) + 2 * product(n, n, n) + n * n


def correct(n, m=2):
    """Innovation, gain, and Joseph's form of the covariance, as filterpy computes them."""
    gain = product(n, n, m) + product(m, n, m) + m * m + inverse(m) + product(n, m, m)
    state = product(m, n, 1) + m + product(n, m, 1) + n
    joseph = product(n, m, n) + n * n + 2 * product(n, n, n) + product(n, m, m) + product(n, m, n) + n * n
    return gain + state + joseph


def kalman(n, m=2):
    """A step of a Kalman filter."""
    return predict(n) + correct(n, m)


def nis(m=2):
    """yᵀ S⁻¹ y, S⁻¹ being known."""
    return product(1, m, m) + product(1, m, 1)


def strong_tracking(n=4, m=2):
    """The Kalman filter, V, N, M, λ, and λ F P Fᵀ + Q."""
    V = m * m + 3 * m * m
    N = product(m, n, n) + product(m, n, m) + 3 * m * m
    M = product(m, n, n) + product(m, n, m)
    return kalman(n, m) + V + N + M + 2 * (m - 1) + 2 + 2 * n * n


def inflation(n=4, m=2):
    """The Kalman filter, the covariance of the quiet one beside it, the fading sum, and the inflation."""
    state = product(n, n, 1) + product(m, n, 1) + m + product(n, m, 1) + n  # what the second recursion does without
    return 2 * kalman(n, m) - state + nis(m) + 3 + 2 * n * n


def variable_dimension(quiet=4, large=6, m=2, window=5):
    """At rest, in a manoeuvre, and at the step that detects one: the larger filter over its whole window."""
    rest = kalman(quiet, m) + nis(m) + 3
    manoeuvre = kalman(large, m) + inverse(large - quiet) + nis(large - quiet) + window
    start = (
        product(large, m, 1)
        + product(large, quiet, 1)
        + large
        + 2 * product(large, quiet, quiet)
        + product(large, m, large)
        + large * large
    )
    return rest, manoeuvre, rest + start + window * kalman(large, m)


def mixture(n, models=2):
    """Mean and covariance of a mixture."""
    return models * (2 * n + n + 4 * n * n)


def interacting(n=6, m=2, models=2):
    """Mixing for each model, a Kalman filter and a likelihood each, the probabilities, and the mixture that is shown."""
    weights = product(models, models, 1) + 2 * models * models + 3 * models
    likelihood = nis(m) + m**3 + 3
    return models * (mixture(n, models) + kalman(n, m) + likelihood) + weights + mixture(n, models)


def input_estimation(n=4, m=2, q=2, window=10):
    """The Kalman filter, and least squares over the whole window at every step."""
    step = (
        product(n, n, q)
        + n * q
        + product(m, n, q)
        + product(m, m, q)
        + product(q, m, q)
        + q * q
        + product(q, m, 1)
        + q
        + product(n, m, q)
        + n * q
    )
    return kalman(n, m) + 2 * n + window * (step + inverse(m)) + inverse(q) + product(q, q, 1) + product(1, q, 1)


def augmented(n=8, m=2):
    """The Kalman filter on the doubled state, and the sum of its halves, (23)."""
    return kalman(n, m) + n // 2


def table():
    """Name -> operations of a step: (at rest, in a manoeuvre)."""
    rest, manoeuvre, _ = variable_dimension()
    same = {
        "SKF": kalman(4),
        "CA": kalman(6),
        "Singer": kalman(6),
        "IMM": interacting(),
        "inflation": inflation(),
        "STKF": strong_tracking(),
        "IE": input_estimation(),
        "IE, N = 4": input_estimation(window=4),
        "ABMA": augmented(),
    }
    return {name: (count, count) for name, count in same.items()} | {"VDF": (rest, manoeuvre)}
