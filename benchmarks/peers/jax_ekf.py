"""JAX: one filter written for one run, `vmap` over the runs and `scan` over the steps, compiled as a whole."""

from types import SimpleNamespace

import numpy as np


def ctrv_parts(problem):
    """CTRV and the radar in JAX for one run, and what an EKF on them needs: wrap, solved, f, G, radar, nees."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    T, sigmas = problem.T, jnp.asarray(problem.model.sigmas)

    def wrap(angle):
        return (angle + jnp.pi) % (2 * jnp.pi) - jnp.pi

    def solved(S, B):
        """S⁻¹B by elimination written out, S positive definite: on matrices as small as these LAPACK, called once a run, takes several times as long."""
        rows = list(jnp.concatenate([S, B.reshape(len(S), -1)], axis=1))
        for j in range(len(rows)):
            rows[j] = rows[j] / rows[j][j]
            rows = [row if i == j else row - row[j] * rows[j] for i, row in enumerate(rows)]
        return jnp.stack(rows)[:, len(S) :].reshape(B.shape)

    def f(x):
        px, py, v, heading, w = x
        h = 0.5 * w * T
        square = h * h
        j0 = 1 - square / 6 * (1 - square / 20 * (1 - square / 42))  # sin(h)/h
        return jnp.stack([px + v * T * jnp.cos(heading + h) * j0, py + v * T * jnp.sin(heading + h) * j0, v, heading + w * T, w])

    def G(x):
        c, s = T * T / 2 * jnp.cos(x[3]), T * T / 2 * jnp.sin(x[3])
        return jnp.array([[c, 0], [s, 0], [T, 0], [0, T * T / 2], [0, T]]) * sigmas

    def radar(x):
        px, py, v, heading, _ = x
        rho = jnp.sqrt(px * px + py * py)
        return jnp.stack([rho, jnp.arctan2(py, px), v * (px * jnp.cos(heading) + py * jnp.sin(heading)) / rho])

    def nees(x, P, truth):
        e = truth - x
        e = e.at[3].set(wrap(e[3]))
        return e @ solved(P, e)

    return SimpleNamespace(wrap=wrap, solved=solved, f=f, G=G, radar=radar, nees=nees)


def jax_ekf(problem):
    """The EKF on CTRV with radar and lidar in turn, and its NEES. An even number of steps."""
    import jax
    import jax.numpy as jnp

    ctrv = ctrv_parts(problem)
    R_radar, R_lidar = (jnp.asarray(sensor.R) for sensor in problem.sensors)
    F_of, H_of, H_lidar = jax.jacfwd(ctrv.f), jax.jacfwd(ctrv.radar), jnp.eye(2, 5)

    def predict(x, P):
        F, G, ahead = F_of(x), ctrv.G(x), ctrv.f(x)
        return ahead.at[3].set(ctrv.wrap(ahead[3])), F @ P @ F.T + G @ G.T

    def correct(x, P, y, H, R):
        S = H @ P @ H.T + R
        K = ctrv.solved(S, H @ P).T
        A = jnp.eye(5) - K @ H
        x = x + K @ y
        return x.at[3].set(ctrv.wrap(x[3])), A @ P @ A.T + K @ R @ K.T

    def two_steps(state, seen):
        z_radar, z_lidar, first, second = seen
        x, P = predict(*state)
        y = z_radar - ctrv.radar(x)
        x, P = correct(x, P, y.at[1].set(ctrv.wrap(y[1])), H_of(x), R_radar)
        one = ctrv.nees(x, P, first)
        x, P = predict(x, P)
        x, P = correct(x, P, z_lidar - x[:2], H_lidar, R_lidar)
        return (x, P), jnp.stack([one, ctrv.nees(x, P, second)])

    def single(x0, z_radar, z_lidar, truth):
        last, scores = jax.lax.scan(two_steps, (x0, P0), (z_radar, z_lidar, truth[::2], truth[1::2]))
        return *last, scores.ravel()

    P0 = jnp.asarray(problem.P0)
    zs = [jnp.asarray(np.stack([z.T for z in problem.zs[k::2]], axis=1)) for k in (0, 1)]  # (M, N/2, m)
    return called(jax.vmap(single, in_axes=(0, 0, 0, None)), jnp.asarray(problem.x0.T), *zs, jnp.asarray(problem.truth.T))


def called(filters, *given):
    """A function without arguments: x (M, n), P (M, n, n) and NEES (M, N) of the filters of all runs as an ensemble's; compiled before it is timed."""
    import jax

    whole = jax.jit(filters)
    jax.block_until_ready(whole(*given))

    def run():
        x, P, scores = jax.block_until_ready(whole(*given))
        return {"x": np.asarray(x).T, "P": np.moveaxis(np.asarray(P), 0, -1), "NEES": np.asarray(scores).mean(axis=0)}

    return run
