"""Friction of lines against closed forms: a trefoil that is pulled, and a rope over a bar of another line.

The law of elastic knots: F h^2/EI = e^4/2 + 0.492 mu e^3, e = (h/R)^(1/2).

B. Audoly, N. Clauvelin and S. Neukirch, Elastic knots, Phys. Rev. Lett. 99 (2007) 164301; h the radius of the cord, mu its
friction, + where the knot is being tightened.  The law is of thin cords (e small), whose loop is a circle of radius R;
here R is 1 over the mean curvature of the loop, where curvature is above half of its largest.
`pytest bench/test_bench_knots.py -m bench -n 0 -s`
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from test_winch import held_by_friction, pressed

import hybrid

pytestmark = pytest.mark.bench

H, EI = 2.25e-3, 1e-3  # m, N m^2


def pulled(force: float, friction: float, tail: float, duration: float, damping: float) -> dict[str, Any]:
    """A long trefoil with straight tails (m), whose free end is pulled along x by a force (N)."""
    t = np.linspace(-2.05, 2.05, 400)
    p = np.column_stack([t**3 - 3 * t, -(t**4 - 4 * t**2), (t**5 - 10 * t) / 20]) * 0.05
    out = [(a - b) / np.linalg.norm(a - b) for a, b in ((p[0], p[1]), (p[-1], p[-2]))]
    points = np.vstack([p[0] + tail * out[0], p, p[-1] + tail * out[1]])
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    cord = {"length": length, "mass": 0.02, "diameter": 2 * H, "axial_stiffness": 2e3, "bending_stiffness": EI}
    return {
        "environment": {"gravity": 0.0}, "model": "rod", "mesh": {"cells": int(length / (1.2 * H))},
        "cable": {"sections": [cord | {"damping": damping}]}, "contact": {"self": True, "friction": friction},
        "ends": {"start": {"kind": "pinned", "position": points[0].tolist()},
                 "end": {"kind": "free", "force": {"value": [force, 0, 0], "ramp": 0.5}}},
        "initial": {"kind": "points", "points": points.tolist()},
        "time": {"duration": duration, "step": 0.005}, "output": {"every": 0.1, "points": 801},
    }  # fmt: skip


def test_a_trefoil_holds_the_pull_of_the_law() -> None:
    """With friction any pull between those at which it slips tighter and slacker is held."""
    print("\n   F, N   mu       e   F h^2/EI          law of both ways   without friction above    CPU, s")
    for force, friction, duration in ((0.05, 0.0, 14.0), (0.2, 0.0, 10.0), (0.05, 0.1, 10.0)):
        begin = time.process_time()
        result = hybrid.run(pulled(force, friction, 0.45, duration, 5.0))
        cpu = time.process_time() - begin
        k = result.curvature[-1]
        k = np.linalg.norm(k, axis=-1) if k.ndim == 2 else k
        loop = k > 0.5 * k.max()
        e = float(np.sqrt(H * k[loop].mean()))
        pull, smooth, rub = force * H**2 / EI, 0.5 * e**4, 0.492 * friction * e**3
        still = float(np.linalg.norm(result.position[-1] - result.position[-11], axis=1).max())
        above = f"{100 * (pull / smooth - 1):+5.1f} %" if not friction else ""
        print(f"{force:7.3f}  {friction:3.1f}  {e:6.4f}  {pull:9.3e}  {smooth - rub:9.3e} to {smooth + rub:9.3e}  {above:>10}"
              f"  {cpu:6.1f}   moves by {1e3 * still:.2g} mm in the last second")  # fmt: skip
        assert 0.85 * (smooth - rub) < pull < 1.3 * (smooth + rub)


def test_a_rope_is_held_by_a_bar_of_another_line() -> None:
    """Exponent of the capstan, ln(T1/T2) over the angle: mu R/(R + r) of a bar of R, 5 cm, and a rope of r, 1 cm."""
    print("\ncells of the rope   exponent   angle, rad     (exponent 0.25)")
    for cells in (60, 240):
        scene = pressed(0.3)
        scene["lines"]["rope"]["mesh"] = {"cells": cells}
        exponent, angle = held_by_friction(hybrid.run(scene))
        print(f"{cells:17d}  {exponent:9.3f}  {angle:11.3f}")
        assert abs(exponent - 0.3 * 5 / 6) < 0.01
