"""Frequency differences of arrival at satellites, as differences of range rates in m/s."""

import numpy as np

from trackhelpers.sensors.tdoa import StationDifferences, check_stations

_STEP = 40.0  # m, of the central difference that tells how the chart turns: eps^(1/3) times the Earth's radius


class FDOA(StationDifferences):
    """Differences of range rates ḋ_i = û_i·(v − v_i) − û_0·(v − v_0), m/s, û_i = (p − s_i)/r_i: −c/f times what the frequencies differ.

    The derivative by the chart's coordinates q has three parts, for p = p(q) and v = D q̇ with D = ∂p/∂q: ∂ḋ/∂p D, ∂ḋ/∂v ∂(D q̇)/∂q, the chart's own turning, and by
    the rates ∂ḋ/∂v D, where ∂ḋ_i/∂p = (w_i − û_i (û_i·w_i))/r_i − (the same of S0), w_i = v − v_i, and ∂ḋ_i/∂v = û_i − û_0.

    Parameters
    ----------
    sigma, satellites, chart, state, rows, R
        As for `StationDifferences`, sigma in m/s; the components are ḋ1, ḋ2, …, and the state holds x, y and their rates vx, vy.
    velocities : array_like (3, S), or a function t -> (3, S)
        Of the satellites, m/s.
    """

    letter = "ḋ"

    def __init__(self, sigma=None, satellites=None, velocities=None, chart=None, state=("x", "y", "vx", "vy"), rows=(1, 2), R=None):
        self.velocities = velocities if callable(velocities) else check_stations(velocities, "velocities").copy()
        super().__init__(sigma, satellites, chart, state, rows, R)
        self._rates = self._column("vx"), self._column("vy")

    def _prepared(self, t):
        if callable(self.velocities) and t is None:
            raise ValueError("velocities: expected an array (3, S) where the satellites are one, got a function")
        moving = self.velocities(t) if callable(self.velocities) else self.velocities
        first, baselines = super()._prepared(t)
        v = check_stations(moving, "velocities")
        if v.ndim > 2 or v.shape[1] <= max(self._taken) + 1:
            raise ValueError(f"velocities: expected shape (3, S) with S > {max(self._taken) + 1}, got {v.shape}")
        return first, baselines, v[:, 0].tolist(), [v[:, i + 1].tolist() for i in self._taken]

    def _parts(self, x):
        q, u, r0, rows = self._seen(x)
        q = np.stack(q)
        rate = np.stack([x[i] for i in self._rates])
        v = self.chart.velocity(q, rate)
        first, others = self._stations[2:]
        w0 = [a - b for a, b in zip(v, first, strict=True)]
        w = [[a - b for a, b in zip(v, other, strict=True)] for other in others]
        sides = [(i, [uk + bk for uk, bk in zip(u, b, strict=True)], r, wi) for (i, b, r, _), wi in zip(rows, w, strict=True)]
        return q, rate, (u, r0, w0), sides

    def _h(self, x, parts):
        _, _, (u, r0, w0), sides = parts
        rows, along = [None] * len(self.components), _dot(u, w0) / r0
        for i, ui, r, wi in sides:
            rows[i] = _dot(ui, wi) / r - along
        return rows

    def _H(self, x, parts):
        q, rate, zeroth, sides = parts
        D, turning = self.chart.jacobian(q), self._turning(q, rate)
        g0, e0 = _gradients(*zeroth)
        entries = {}
        for i, u, r, w in sides:
            gi, ei = _gradients(u, r, w)
            by_p, by_v = [a - b for a, b in zip(gi, g0, strict=True)], [a - b for a, b in zip(ei, e0, strict=True)]
            for k in (0, 1):
                entries[i, self._place[k]] = _dot(by_p, D[:, k]) + _dot(by_v, turning[k])
                entries[i, self._rates[k]] = _dot(by_v, D[:, k])
        return entries

    def _turning(self, q, rate):
        """∂(D q̇)/∂q: for each coordinate (3, ...)."""
        found = []
        for k in (0, 1):
            step = np.zeros_like(q)
            step[k] = _STEP
            found.append((self.chart.velocity(q + step, rate) - self.chart.velocity(q - step, rate)) / (2 * _STEP))
        return found


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _gradients(u, r, w):
    """Of the range rate û·w: by the position and by the velocity."""
    e = [uk / r for uk in u]
    along = _dot(e, w)
    return [(wk - ek * along) / r for wk, ek in zip(w, e, strict=True)], e
