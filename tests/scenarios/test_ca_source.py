"""Section 4.1: the source's truth is the printed column and moves as the model says."""

import numpy as np
import pytest

from trackhelpers.motion import CA
from trackhelpers.published import published
from trackhelpers.scenarios.thesis import ca_source


def test_truth_is_the_printed_column_and_its_own_derivatives():
    s, v, a = ca_source.truth()
    np.testing.assert_allclose(s[:61:5], published("thesis", 3, numeric=True)["s_true"], atol=0.005 + 1e-9)
    model = CA(axes=1)
    np.testing.assert_allclose(model.f(np.stack([s, v, a])[:, :-1], ca_source.T), np.stack([s, v, a])[:, 1:], atol=1e-12)


def test_bad_steps_are_named():
    with pytest.raises(ValueError, match=r"^steps: expected"):
        ca_source.truth(0)
