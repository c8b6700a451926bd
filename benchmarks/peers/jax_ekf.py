"""JAX: one filter written for one run, `vmap` over the runs and `scan` over the steps, compiled as a whole."""

import numpy as np


def jax_ekf(problem):
    """The EKF on CTRV with radar and lidar in turn, and its NEES; compiled before it is timed. An even number of steps."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    T, sigma_a, sigma_w = problem.T, *problem.model.sigmas
    R_radar, R_lidar = (jnp.asarray(sensor.R) for sensor in problem.sensors)

    def wrap(angle):
        return (angle + jnp.pi) % (2 * jnp.pi) - jnp.pi

    def f(x):
        px, py, v, heading, w = x
        h = 0.5 * w * T
        square = h * h
        j0 = 1 - square / 6 * (1 - square / 20 * (1 - square / 42))  # sin(h)/h
        return jnp.stack([px + v * T * jnp.cos(heading + h) * j0, py + v * T * jnp.sin(heading + h) * j0, v, heading + w * T, w])

    def radar(x):
        px, py, v, heading, _ = x
        rho = jnp.sqrt(px * px + py * py)
        return jnp.stack([rho, jnp.arctan2(py, px), v * (px * jnp.cos(heading) + py * jnp.sin(heading)) / rho])

    F_of, H_of = jax.jacfwd(f), jax.jacfwd(radar)
    H_lidar = jnp.eye(2, 5)

    def predict(x, P):
        F, c, s = F_of(x), T * T / 2 * jnp.cos(x[3]), T * T / 2 * jnp.sin(x[3])
        G = jnp.array([[c, 0], [s, 0], [T, 0], [0, T * T / 2], [0, T]]) * jnp.array([sigma_a, sigma_w])
        ahead = f(x)
        return ahead.at[3].set(wrap(ahead[3])), F @ P @ F.T + G @ G.T

    def correct(x, P, y, H, R):
        S = H @ P @ H.T + R
        K = jnp.linalg.solve(S, H @ P).T
        A = jnp.eye(5) - K @ H
        x = x + K @ y
        return x.at[3].set(wrap(x[3])), A @ P @ A.T + K @ R @ K.T

    def nees(x, P, truth):
        e = truth - x
        e = e.at[3].set(wrap(e[3]))
        return e @ jnp.linalg.solve(P, e)

    def two_steps(state, seen):
        z_radar, z_lidar, first, second = seen
        x, P = predict(*state)
        y = z_radar - radar(x)
        x, P = correct(x, P, y.at[1].set(wrap(y[1])), H_of(x), R_radar)
        one = nees(x, P, first)
        x, P = predict(x, P)
        x, P = correct(x, P, z_lidar - x[:2], H_lidar, R_lidar)
        return (x, P), jnp.stack([one, nees(x, P, second)])

    def single(x0, z_radar, z_lidar, truth):
        last, scores = jax.lax.scan(two_steps, (x0, P0), (z_radar, z_lidar, truth[::2], truth[1::2]))
        return *last, scores.ravel()

    P0 = jnp.asarray(problem.P0)
    whole = jax.jit(jax.vmap(single, in_axes=(0, 0, 0, None)))
    zs = [jnp.asarray(np.stack([z.T for z in problem.zs[k::2]], axis=1)) for k in (0, 1)]  # (M, N/2, m)
    given = jnp.asarray(problem.x0.T), *zs, jnp.asarray(problem.truth.T)
    jax.block_until_ready(whole(*given))

    def run():
        x, P, scores = jax.block_until_ready(whole(*given))
        return {"x": np.asarray(x).T, "P": np.moveaxis(np.asarray(P), 0, -1), "NEES": np.asarray(scores).mean(axis=0)}

    return run
