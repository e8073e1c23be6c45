"""Order in time: two for positions and tensions, for rod, catenary and hybrid.

Self-convergence of a sagging line whose end moves smoothly in three dimensions, in water.
Norm: root mean square over outputs and arc length.  Two-sided: an order of three would mean
that the test measures something else.
"""

from itertools import pairwise

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at

MODELS = {
    "rod": {"kind": "zones", "zones": [{"rod": 2.0, "cells": 40}]},
    "catenary": {"kind": "zones", "zones": [{"catenary": 2.0, "cells": 40}]},
    "hybrid": {
        "kind": "zones",
        "zones": [{"catenary": 0.7, "cells": 14}, {"rod": 0.6, "cells": 12}, {"catenary": 0.7, "cells": 14}],
    },
}


def scene(model, step, rho):
    section = {
        "length": 2.0, "mass": 0.5, "diameter": 0.02, "bending_stiffness": 0.002, "torsional_stiffness": 0.0016,
        "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    motion = {
        "heave": {"amplitude": 0.1, "period": 2.5},
        "sway": {"amplitude": 0.1, "period": 3.1, "phase": 40},
        "ramp": 2.0,
    }
    return hybrid.validate_scene(
        cable_scene(
            section,
            pinned_at(0, 0, 0),
            pinned_at(1.2, 0.3, 0.2, motion=motion),
            gravity=9.81,
            fluid={"density": 1000.0},
            model=MODELS[model],
            time=(2.0, step, rho),
            output=0.1,
        )
    )


@pytest.mark.parametrize("rho", [0.5, 0.8])
@pytest.mark.parametrize("model", MODELS)
def test_second_order(model, rho):
    results = [hybrid.run(scene(model, step, rho)) for step in (0.02, 0.01, 0.005, 0.0025)]
    orders = {}
    for name in ("position", "tension"):
        change = [np.sqrt(np.mean((a[name] - b[name]) ** 2)) for a, b in pairwise(results)]
        orders[name] = [float(np.log2(a / b)) for a, b in pairwise(change)]
    print(f"{model}, rho_inf {rho}: order {orders}")
    assert np.abs(np.array(orders["position"]) - 2.0).max() < 0.2
    assert min(orders["tension"]) >= 1.8
    assert max(orders["tension"]) < 2.5
