"""Motion models: the transition f, its Jacobian F, and the process noise Q.

Cartesian CV, CA and Singer; the thesis's polar CV and CA; the turn-rate models CTRV and CTRA; the curvature models CSAV, CCA and CSAA. Each takes one target,
x of shape (n,), or any trailing axes behind the state (runs, sigma points), with the same functions.
"""

from trackhelpers.model import Model
from trackhelpers.motion.arc import turn_integrals
from trackhelpers.motion.curvature import CCA, CSAA, CSAV
from trackhelpers.motion.given import LinearModel
from trackhelpers.motion.singer import Singer
from trackhelpers.motion.straight import CA, CV, PolarCA, PolarCV
from trackhelpers.motion.turn import CTRA, CTRV

__all__ = ["CA", "CCA", "CSAA", "CSAV", "CTRA", "CTRV", "CV", "LinearModel", "Model", "PolarCA", "PolarCV", "Singer", "turn_integrals"]
