"""The ensemble's covariance step without the compiled one, which stands in for it where numba is there and the runs are many."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from trackhelpers.ensemble import covariance
from trackhelpers.sensors import Radar


@pytest.mark.parametrize("common_R", [True, False])
def test_a_correction_in_numpy_is_the_textbooks_run_by_run(monkeypatch, common_R):
    monkeypatch.setattr(covariance.fused, "correct", lambda *args: None)
    rng, M, radar = np.random.default_rng(0), 4, Radar()
    x = rng.normal(size=(5, M)) + np.array([30, 20, 3, 0, 0])[:, None]
    A = rng.normal(size=(5, 5, M))
    P = np.einsum("ikm,jkm->ijm", A, A) + np.eye(5)[..., None]
    R = radar.R if common_R else radar.R[..., None] * np.arange(1.0, M + 1)
    K, S, corrected = covariance.correct(P.copy(), radar.linearised(x)[1], R)
    for m in range(M):
        H, noise = radar.H(x[:, m]), radar.R * (1 if common_R else m + 1)
        innovation = H @ P[..., m] @ H.T + noise
        gain = P[..., m] @ H.T @ np.linalg.inv(innovation)
        np.testing.assert_allclose(S[..., m], innovation, rtol=1e-10)
        np.testing.assert_allclose(K[..., m], gain, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(corrected[..., m], (np.eye(5) - gain @ H) @ P[..., m], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_log_density_is_scipys_run_by_run_up_to_its_constant(monkeypatch, compiled):
    if not compiled:
        monkeypatch.setattr(covariance.fused, "binding", None)
    rng, M = np.random.default_rng(2), 9
    y, A = rng.normal(size=(2, M)), rng.normal(size=(2, 2, M))
    S = np.einsum("ikm,jkm->ijm", A, A) + np.eye(2)[..., None]
    S[..., 4] = -S[..., 4]
    found = covariance.log_density(y, S)
    for m in (0, 3, 8):
        expected = multivariate_normal(np.zeros(2), S[..., m]).logpdf(y[:, m]) + np.log(2 * np.pi)
        np.testing.assert_allclose(found[m], expected, rtol=1e-12)
    assert np.isnan(found[4]) and np.isfinite(np.delete(found, 4)).all()
