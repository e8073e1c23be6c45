"""Changes of bending stiffness: the softer side bends more than a catenary, or cells too long, can show, which is said."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid

KIND = "unresolved change of section"
SOFT, STIFF, HALF, MASS, ACROSS = 2.0, 200.0, 30.0, 0.2, 60.02


def described(first: float = SOFT, second: float = STIFF, **more: Any) -> dict[str, Any]:
    """A taut line of two stiffnesses."""
    sections = [
        {"length": HALF, "mass": MASS, "diameter": 0.007, "bending_stiffness": EI, "axial_stiffness": 4e5}
        for EI in (first, second)
    ]
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [ACROSS, 0, 0]}}
    return {"cable": {"sections": sections}, "ends": ends, "initial": "equilibrium"} | more


def exact(tension: float) -> float:
    """Curvature, 1/m, of the softer side of the change: M'' = T (M/EI - kappa0), M and M' continuous."""
    kappa0 = MASS * 9.81 / tension
    soft, stiff = (np.sqrt(EI / tension) for EI in (SOFT, STIFF))
    return float(kappa0 * (SOFT * stiff + STIFF * soft) / (soft + stiff) / SOFT)


def graded(shortest: float) -> list[float]:
    """Nodes that are so close, m, at the change, and ever farther apart away from it."""
    steps = np.cumsum(np.minimum(shortest * 1.12 ** np.arange(200), 1.0))
    steps = np.append(steps[steps < HALF - 0.5], HALF)
    return [0.0, *(HALF - steps[-2::-1]).tolist(), HALF, *(HALF + steps).tolist()]


def shown(result: hybrid.Result, first: float = SOFT) -> float:
    name = "curvature" if first == SOFT else "right/curvature"
    at = np.argmin(np.abs(np.asarray(result["s" if first == SOFT else "right/s"]) - HALF))
    return float(np.asarray(result[name])[-1][at])


@pytest.mark.parametrize("first", [SOFT, STIFF])
@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_what_is_not_shown_is_said(model: str, first: float) -> None:
    """On long cells with any model, and of a catenary on any cells; what the text says is the exact curvature."""
    for mesh in ({"cells": 60}, {"nodes": graded(0.01)}):
        what = described(first, SOFT + STIFF - first, model=model, mesh=mesh)
        result = hybrid.static(what)
        true = exact(float(np.asarray(result.tension)[-1].mean()))
        said = [x.text for x in result.events if x.kind == KIND]
        right = shown(result, first) == pytest.approx(true, rel=0.1)
        assert right == (model != "catenary" and "nodes" in mesh), (shown(result, first), true)
        assert bool(said) != right
        if said:
            number = float(said[0].split("bends by about ")[1].split()[0])
            assert number == pytest.approx(true, rel=0.1) and "s = 30 m" in said[0]


def test_it_is_said_once_in_a_motion_and_not_of_one_stiffness() -> None:
    heave = {"heave": {"amplitude": 0.05, "period": 4.0}, "ramp": 4.0}
    for second, count in ((STIFF, 1), (SOFT, 0), (1.3 * SOFT, 0)):
        what = described(second=second, model="rod", mesh={"cells": 40}, time={"duration": 2.0, "step": 0.05})
        what["ends"]["start"]["motion"] = heave
        assert sum(x.kind == KIND for x in hybrid.run(what).events) == count
