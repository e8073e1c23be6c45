"""The suspension of 02 three ways, from Python: how far are catenary and hybrid from the rod?

Shows:    scenes built without a file, equilibria kept in memory, arrays read from results, a plot of one's own.
Physics:  the rod is the reference.  Leaving bending out moves the cable by (angle error) x (length it acts on), and a
          moment-free joint in a curved stretch leaves it out too: the angle there is wrong by about lambda kappa,
          lambda = sqrt(EI/T).  lambda is 0.2 m here.
Look at:  the hybrid with 0.5 m of rod is 5.4 cm from the rod, the catenary 28 cm.  More rod is better only where it
          takes the joint out of the sag: the printed table is the case for choosing zones with care.
          A cable a hundred times softer in bending is where a hybrid is at home: 0.7 mm against 2.3 cm.
Run time: 3 s, most of it imports and plotting (20 equilibria of 160 cells).
Source:   Goyal & Perkins, Table 1; lambda as in docs/zones.md.

    python examples/08_python_api.py [picture.png]
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import hybrid

LENGTH, DIAMETER, EI = 2.0, 1.0e-3, 5 * math.pi / 64 * 1e-3  # m, m, N m^2
NORMAL = (math.sin(math.pi / 6), 0.0, math.cos(math.pi / 6))


def suspension(model: dict[str, Any] | str, flexible_end: bool = False, softer: float = 1.0) -> hybrid.Scene:
    """Table 1 with a model and stiffness of our choice; a flexible end cannot be guided, so it is free there."""
    force = [0.01 * x for x in NORMAL]
    guided = {"kind": "guided", "tangent": [math.cos(math.pi / 6), 0, -0.5], "force": force}
    free = {"kind": "free", "force": force}
    section = {
        "length": LENGTH,
        "diameter": DIAMETER,
        "mass": math.pi / 4 * 1e-3,
        "bending_stiffness": EI / softer,
        "torsional_stiffness": 0.8 * EI / softer,
    }
    return hybrid.validate_scene(
        {
            "environment": {"gravity": 9.8, "fluid": {"density": 1.0}},
            "cable": {"sections": [section]},
            "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": free if flexible_end else guided},
            "initial": {"kind": "straight", "direction": [1, 0, 0]},
            "model": model,
            "mesh": {"cells": 160},
            "output": {"points": 401},
        }
    )


def with_rod(length: float, softer: float = 1.0) -> hybrid.Scene:
    """Catenary first, rod for the last `length` metres."""
    return suspension({"kind": "zones", "zones": [{"catenary": LENGTH - length}, {"rod": length}]}, softer=softer)


def distance(a: hybrid.Result, b: hybrid.Result) -> float:
    """Largest distance between two shapes at the same s (m)."""
    return float(np.linalg.norm(a.position[0] - b.position[0], axis=1).max())


def main(picture: str | None = None) -> dict[str, float]:
    """Print the distances to the rod, draw them if asked, and return them (m)."""
    rod = hybrid.static(suspension("rod"))
    half = hybrid.static(with_rod(0.5))
    catenary = hybrid.static(suspension("catenary", flexible_end=True))

    shapes = {"rod": rod, "hybrid, 0.5 m of rod": half, "catenary": catenary}
    for name, result in shapes.items():
        x, _, z = result.position[0, -1]
        print(f"{name:22} end at ({x:.4f}, {z:+.4f}) m, {100 * distance(result, rod):5.2f} cm from the rod")

    lengths = np.arange(0.1, 1.95, 0.1)
    distances = [distance(hybrid.static(with_rod(float(x))), rod) for x in lengths]
    print("\n  rod zone (m)   largest distance to the rod (cm)")
    for x, d in zip(lengths, distances, strict=True):
        print(f"  {x:8.1f}   {100 * d:14.2f}")

    print("\n  EI divided by   hybrid, 0.5 m of rod (cm)   catenary (cm)")
    for softer in (1.0, 10.0, 100.0):
        whole = hybrid.static(suspension("rod", softer=softer))
        part = hybrid.static(with_rod(0.5, softer))
        print(f"  {softer:8.0f}        {100 * distance(part, whole):12.3f}   {100 * distance(catenary, whole):24.3f}")

    if picture is not None:
        figure = Figure(figsize=(8, 5), layout="constrained")
        FigureCanvasAgg(figure)
        top, left, right = (figure.add_subplot(2, 2, k) for k in ((1, 2), 3, 4))
        for (name, result), style in zip(shapes.items(), ("-", "-", "--"), strict=True):
            top.plot(result.position[0, :, 0], result.position[0, :, 2], style, label=name)
            left.plot(result.s, 1e3 * result.tension[0], style)
        joint = half.at(t=0.0, s=LENGTH - 0.5)["position"]
        top.plot(joint[0], joint[2], "ko", markerfacecolor="white", label="joint")
        top.set(xlabel="x (m)", ylabel="z (m)", aspect="equal", title="equilibrium")
        top.legend(fontsize=8, frameon=False, loc="upper center")
        left.set(xlabel="s (m)", ylabel="tension (mN)")
        right.plot(lengths, 100 * np.array(distances), "ko-", markersize=3)
        right.set(xlabel="length of the rod zone (m)", ylabel="distance to the rod (cm)", ylim=(0, None))
        figure.savefig(picture, dpi=120)
    return {name: distance(result, rod) for name, result in shapes.items()}


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "08_python_api.png")
