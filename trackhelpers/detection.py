"""The old name of `trackhelpers.manoeuvre`, kept for one release."""

import warnings

from trackhelpers.manoeuvre import *  # noqa: F403

warnings.warn(
    "trackhelpers.detection is called trackhelpers.manoeuvre now; the old name goes with the next release", DeprecationWarning, stacklevel=2
)
