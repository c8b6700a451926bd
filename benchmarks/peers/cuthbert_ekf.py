"""cuthbert: its extended Kalman filter, which has the roots of the covariances, on means and roots that are given as functions; `vmap` over the runs."""

import numpy as np

from benchmarks.peers.jax_ekf import called, ctrv_parts


def cuthbert_ekf(problem):
    """The EKF on CTRV with radar and lidar in turn, and its NEES."""
    import jax
    import jax.numpy as jnp
    from cuthbert.filtering import filter as filtered
    from cuthbert.gaussian.moments import build_filter

    ctrv = ctrv_parts(problem)
    P0, radar, lidar = (np.linalg.cholesky(matrix) for matrix in (problem.P0, *(sensor.R for sensor in problem.sensors)))
    padded = np.eye(3)  # the lidar's third component is NaN, which says that it is missing
    padded[:2, :2] = lidar
    roots = jnp.asarray(np.stack([radar, padded]))

    def dynamics(state, inputs):
        return lambda x: (ctrv.f(x), jnp.pad(ctrv.G(x), ((0, 0), (0, 3)))), state.mean

    def observation(state, inputs):
        z, by_lidar = inputs

        def seen(x):
            return jnp.where(by_lidar, jnp.pad(x[:2], (0, 1)), ctrv.radar(x)), roots[by_lidar]

        # differences are taken as they are, so that a bearing has to be given by whole turns nearest to what is expected
        bearing = seen(state.mean)[0][1]
        return seen, state.mean, jnp.where(by_lidar, z, z.at[1].set(bearing + ctrv.wrap(z[1] - bearing)))

    def single(x0, z):
        ekf = build_filter(x0, jnp.asarray(P0), dynamics, observation)
        states = filtered(ekf, (z, jnp.arange(problem.steps) % 2), ekf.init_prepare())
        x, root = states.mean[1:], states.chol_cov[1:]
        P = root @ jnp.swapaxes(root, 1, 2)
        return x[-1].at[3].set(ctrv.wrap(x[-1, 3])), P[-1], jax.vmap(ctrv.nees)(x, P, jnp.asarray(problem.truth.T))

    zs = np.full((problem.runs, problem.steps, 3), np.nan)
    for k, z in enumerate(problem.zs):
        zs[:, k, : len(z)] = z.T
    return called(jax.vmap(single), jnp.asarray(problem.x0.T), jnp.asarray(zs))
