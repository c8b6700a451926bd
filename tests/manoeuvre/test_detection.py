"""The old name of a module can be imported for one release, and says what it is called now."""

import importlib
import sys

import pytest

from trackhelpers import manoeuvre


def test_the_old_name_warns_and_gives_the_same_functions():
    sys.modules.pop("trackhelpers.detection", None)
    with pytest.warns(DeprecationWarning, match=r"trackhelpers\.detection is called trackhelpers\.manoeuvre now") as caught:
        old = importlib.import_module("trackhelpers.detection")
    assert all(
        getattr(old, name) is getattr(manoeuvre, name) for name in ("fading_limit", "OneAPrediction", "constant_input", "manoeuvre_start")
    )
    assert len(caught) == 1
