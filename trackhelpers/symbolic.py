"""The covariance algebra of `trackhelpers.ensemble.covariance` and `trackhelpers.arrays` once more, on matrices that are lists of rows of symbols: what `trackhelpers.fused` compiles."""

from trackhelpers.symbols import Symbol, choose, number, wrap


def propagated(P, difference, noise):
    """F P Fᵀ + Q; F − I and the lower half of Q by their entries."""
    n = len(P)
    half = [list(row) for row in P]
    for (i, k), value in difference.items():
        for j in range(n):
            half[i][j] = half[i][j] + value * P[k][j]
    whole = [list(row) for row in half]
    for (i, k), value in difference.items():
        for j in range(i, n):
            whole[j][i] = whole[j][i] + value * half[j][k]
    for (i, j), value in noise.items():
        whole[i][j] = whole[i][j] + value
    return mirrored(whole)


def corrected(P, H, R):
    """K, S and P of one update in Joseph's form, (I − KH) P (I − KH)ᵀ + K R Kᵀ = B − (B Hᵀ − K R) Kᵀ with B = P − K (P Hᵀ)ᵀ; H by its entries."""
    n, m = len(P), len(R)
    PHt = _times_transposed(P, H, m)
    S = [list(row) for row in R]
    for (a, j), value in H.items():
        for b in range(a + 1):
            S[a][b] = S[a][b] + value * PHt[j][b]
    S = mirrored(S)
    K = gain(PHt, S)
    B = [[P[i][j] - dot(K[i], PHt[j]) for j in range(n)] for i in range(n)]
    slack = _times_transposed(B, H, m)
    slack = [[slack[i][a] - dot(K[i], [row[a] for row in R]) for a in range(m)] for i in range(n)]
    return K, S, mirrored([[B[i][j] - dot(slack[i], K[j]) for j in range(i + 1)] for i in range(n)])


def gain(PHt, S):
    """K = P Hᵀ S⁻¹, a row at a time."""
    L, inverse = _factors(S)
    m, K = len(S), [list(row) for row in PHt]
    for k in K:
        for a in range(m):
            for b in range(a):
                k[a] = k[a] - L[a][b] * k[b]
        k[:] = [value * pivot for value, pivot in zip(k, inverse, strict=True)]
        for a in reversed(range(m)):
            for b in range(a + 1, m):
                k[a] = k[a] - L[b][a] * k[b]
    return K


def iterated(hooks, angles, x, P, z, R, iterations=1):
    """How far x moves by the measurement z, and P, y, S and K; hooks(x) are the rows of h and the entries of H, taken again where each iteration but the last has led."""
    step = None
    for _ in range(iterations):
        seen, H = hooks(x if step is None else Vector(a + b for a, b in zip(x, step, strict=True)))
        K, S, posterior = corrected(P, H, R)
        y = [wrap(z[a] - row) if a in angles else z[a] - row for a, row in enumerate(seen)]
        if step is not None:  # of the sensor linearised there: z − h(xᵢ) − Hᵢ (x⁻ − xᵢ)
            for (a, j), value in H.items():
                y[a] = y[a] + value * step[j]
        step = [dot(row, y) for row in K]
    return step, posterior, y, S, K


def mahalanobis(y, S):
    """yᵀS⁻¹y."""
    L, inverse = _factors(S)
    y, total = list(y), 0.0
    for j, pivot in enumerate(inverse):
        total = total + y[j] * y[j] * pivot
        for i in range(j + 1, len(y)):
            y[i] = y[i] - L[i][j] * y[j]
    return total


def _factors(S):
    """L below its diagonal, and the inverse of D, of S = L D Lᵀ; NaN from where a pivot is not positive."""
    m, rest = len(S), [list(row) for row in S]
    L, inverse = [[0.0] * m for _ in range(m)], []
    for j in range(m):
        inverse.append(choose(rest[j][j] > 0.0, 1.0 / rest[j][j], float("nan")))
        for i in range(j + 1, m):
            L[i][j] = rest[i][j] * inverse[j]
            for c in range(j + 1, i + 1):
                rest[i][c] = rest[i][c] - L[i][j] * rest[c][j]
    return L, inverse


def _times_transposed(A, H, m):
    """A Hᵀ."""
    product = [[number(0.0)] * m for _ in A]
    for (a, j), value in H.items():
        for i, row in enumerate(A):
            product[i][a] = product[i][a] + value * row[j]
    return product


def dot(a, b):
    return total([x * y for x, y in zip(a, b, strict=True)])


def total(values):
    found = number(0.0)
    for value in values:
        found = found + value
    return found


def mirrored(lower):
    return [[lower[max(i, j)][min(i, j)] for j in range(len(lower))] for i in range(len(lower))]


class Vector(list):
    """Symbols as a state (n, runs): what a hook indexes."""

    ndim = 2
    shape = property(lambda self: (len(self), 1))


def loads(array, *shape):
    """Symbols for the rows of the input with this number: a vector (n,), or a matrix (n, n) of which the lower half is read."""
    if len(shape) == 1:
        return Vector(Symbol("load", array, i) for i in range(shape[0]))
    return mirrored([[Symbol("load", array, i * shape[1] + j) for j in range(i + 1)] for i in range(shape[0])])


def flat(A):
    return [value for row in A for value in row]


def inverse_pivots(S):
    """The inverse of D in S = L D Lᵀ, whose product is 1/det S; NaN from where a pivot is not positive."""
    return _factors(S)[1]
