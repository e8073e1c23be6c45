"""Error figures beside the truth, in scenes where they were once much too small.  docs/accuracy.md"""

from __future__ import annotations

import numpy as np
import pytest

import hybrid

# Estimated over true error, as asked of the project; where it is below, an event must say that it is uncertain.
SHARP = 0.7, 3.0


def effectivity(result, truth, name="position"):
    """Largest estimated error of an output over the largest true one."""
    error = np.array(result[name]) - np.array(truth[name])
    true = np.linalg.norm(error, axis=-1) if error.ndim == 3 else np.abs(error)
    return float(np.max(result.errors[f"total/{name}"]) / true.max())


def tether(model, accuracy):
    """A short tether, swayed, held by a clamp: zones of a coarse mesh are rod where those of a fine one need not be."""
    return {
        "environment": {"fluid": {"density": 1025, "current": [0.295773, 0.219286, 0.0]}},
        "cable": {"sections": [{
            "length": 16.9236, "mass": 0.923006, "diameter": 0.0254979, "bending_stiffness": 11.6023,
            "drag": {"normal": 1.53475, "tangential": 0.0554847}, "added_mass": {"normal": 0.522405},
            "axial_stiffness": 1761290.0,
        }]},
        "ends": {
            "start": {"kind": "pinned", "position": [0.0, 0.0, 0.0],
                      "motion": {"ramp": 14.1502, "sway": {"amplitude": 0.275069, "period": 10.1191, "phase": 104.756}}},
            "end": {"kind": "clamped", "position": [3.41804, -5.11608, 0.0193178],
                    "tangent": [0.926661, -0.709372, 0.0865805]},
        },
        "initial": "equilibrium", "model": model, "time": {"duration": 12.6028},
        "output": {"every": 0.630141, "points": 201}, "accuracy": accuracy,
    }  # fmt: skip


def test_zones_of_a_coarser_run_do_not_hide_what_those_of_the_result_leave_out():
    """The runs to compare with are all rod, the result is not: 0.26 where their model error was believed."""
    truth = hybrid.run(tether("rod", "0.1%"))
    result = hybrid.run(tether("adaptive", "1%"))
    kinds = {zone.kind for row in result.zones for zone in row}
    assert kinds == {"rod", "catenary"}
    assert SHARP[0] <= effectivity(result, truth) <= SHARP[1]
    assert SHARP[0] <= effectivity(result, truth, "tension") <= SHARP[1]
    assert result.errors["model/position"].max() > 0.5 * result.errors["total/position"].max()


@pytest.mark.parametrize("cells", [25, 100, 400])
def test_tension_beside_a_float_in_a_catenary(cells):
    """A rod's tension falls towards the float, by M^2/(2 EI): 16 % of the largest, of which 0.05 were estimated."""
    scene = {
        "environment": {"fluid": {"density": 1025}},
        "cable": {
            "sections": [{"length": 100, "diameter": 0.025, "mass": 1, "axial_stiffness": 1e6, "bending_stiffness": 2}],
            "attachments": [{"kind": "float", "at": 50, "buoyancy": 200}],
        },
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, -10]},
            "end": {"kind": "pinned", "position": [90, 0, -10]},
        },
        "initial": "equilibrium",
        "output": {"points": 1001, "errors": True},
    }
    truth = hybrid.static(scene | {"model": "rod", "mesh": {"cells": 10000}})
    result = hybrid.static(scene | {"model": "catenary", "mesh": {"cells": cells}})
    for name in ("position", "tension", "curvature"):
        assert SHARP[0] <= effectivity(result, truth, name) <= SHARP[1], name
    corrected = hybrid.static(scene | {"model": "corrected", "mesh": {"cells": 1600}})
    worst = [float(np.abs(x["tension"] - truth["tension"]).max()) for x in (result, corrected)]
    assert worst[1] < 0.5 * worst[0]
