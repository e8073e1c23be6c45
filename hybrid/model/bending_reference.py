"""How a line would bend if all of it were rod: what an estimate of the model error asks for."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.material import Material, tension_floor

# Change of tension over tension (`Shift.share`) beyond which a linear estimate of what bending does may be half wrong.
HALF_WRONG = 0.5
# Where such an estimate knows least: t, s; m; share; m, the shift that it gives.
NO_DOUBT = (0.0, 0.0, 0.0, 0.0)


def full_bending(cable: Material, s: Floats, h: Floats, scale: float) -> tuple[Floats, Floats]:
    """Bending stiffness (N+1,) N m of full elements at nodes s, EI/hn, and the least tensions (N,) N that count.

    h: (N,) m, true lengths of the cells; scale: tension scale, N.
    """
    of = cable.piece(0.5 * (s[:-1] + s[1:]))
    EI = cable.mean_bending[of]
    gives = 0.5 * h / np.maximum(EI, 1e-300)
    with np.errstate(over="ignore"):
        ki = 1.0 / (np.append(gives, 0.0) + np.append(0.0, gives))
    ki[np.append(EI, EI[-1]) <= 0.0] = 0.0
    ki[np.append(EI[0], EI) <= 0.0] = 0.0
    return ki, tension_floor(EI, np.abs(cable.submerged_weight[of]), scale)
