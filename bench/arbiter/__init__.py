"""The arbiter: the literal shooting of Goyal & Perkins, a small second solver for short lines.

It shares nothing with the production path but the scene, so that agreement means something.  Fields
v, f, k, w on rods and v, T, theta, phi on catenaries (fields.py), box rule along s, particular and
homogeneous solutions marched from s = 0 to L through the spherical joints, far end fitted (march.py),
Newton around it (newton.py), generalized-alpha in time (dynamics.py).  It loses a digit for every
2.3 lengths lambda = sqrt(EI/T) of taut rod, and dies near L/lambda = 35, and reports it.
"""

from .dynamics import ShootingRun, simulate
from .newton import ArbiterError, Outcome
from .state import ShootingState, at
from .statics import static

__all__ = ["ArbiterError", "Outcome", "ShootingRun", "ShootingState", "at", "simulate", "static"]
