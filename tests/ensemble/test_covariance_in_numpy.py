"""The ensemble's covariance step without the compiled one, which stands in for it where numba is there and the runs are many."""

import numpy as np
import pytest

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
