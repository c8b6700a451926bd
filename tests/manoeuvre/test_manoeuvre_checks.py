"""What the rules of manoeuvre detection take, and what they refuse."""

import numpy as np
import pytest

from trackhelpers.manoeuvre import check_step, check_switching, constant_input
from trackhelpers.manoeuvre_checks import check_spread


def test_a_step_is_longer_than_nothing():
    assert check_step(0.5) == 0.5
    with pytest.raises(ValueError, match="dt: expected a step > 0"):
        check_step(0)


def test_rows_of_the_transition_add_up_to_one():
    transition, mu = check_switching((0.98, 0.9), (0.7, 0.3))
    np.testing.assert_allclose(transition, [[0.98, 0.02], [0.1, 0.9]], rtol=1e-15)
    np.testing.assert_array_equal(mu, [0.7, 0.3])


def test_innovations_gains_and_covariances_have_the_same_runs():
    y, S, K, G = np.ones((1, 3)), np.ones((1, 1, 3)), np.ones((2, 1, 3)), np.ones((2, 1))
    F, H = np.eye(2), np.ones((1, 2))
    assert constant_input([y], [S], [K], [1], F, G, H)[0].shape == (1, 3)
    for wrong in ({"K": [K[..., 0]]}, {"K": [K[..., None]]}, {"S": [S[..., 0]]}, {"S": [S[..., None]]}):
        with pytest.raises(ValueError, match="expected shapes"):
            constant_input(**{"y": [y], "S": [S], "K": [K], "steps": [1], "F": F, "G": G, "H": H} | wrong)


def test_of_one_target_a_spread_is_a_covariance_and_of_many_it_may_have_diverged():
    with pytest.raises(ValueError, match="P: "):
        check_spread(-np.eye(2), "P", 2)
    diverged = -np.eye(2)[..., None]
    np.testing.assert_array_equal(check_spread(diverged, "P", 2), diverged)
