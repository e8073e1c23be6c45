"""Equilibria of networks of lines by MoorPy: networks as JSON on the input, end tensions and places and CPU times on the output.

Run by a Python that has MoorPy; it shares nothing with hybrid but the numbers of the networks.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import moorpy
import numpy as np

DENSITY, GRAVITY, DEPTH = 1025.0, 9.80665, 100.0


def equilibrium(given: dict[str, Any]) -> dict[str, Any]:
    """The equilibrium of one network: a free point or a free body on lines from anchors on the seabed."""
    begin = time.process_time()
    network = moorpy.System(depth=DEPTH, rho=DENSITY, g=GRAVITY)
    what, body = given["float"], None
    if what["kind"] == "body":
        body = network.addBody(0, np.array([*what["guess"], 0.0, 0.0, 0.0]), m=what["mass"], v=what["volume"],
                              rCG=np.array(what["centre"]), rM=np.array(what["buoyancy"]))  # fmt: skip
    else:
        network.addPoint(0, what["guess"], m=what["mass"], v=what["volume"])
    for number, line in enumerate(given["lines"]):
        area = 0.25 * np.pi * line["diameter"] ** 2
        network.lineTypes[f"t{number}"] = {
            "name": f"t{number}", "material": "line", "d_vol": line["diameter"], "m": line["mass"], "EA": line["EA"],
            "w": (line["mass"] - DENSITY * area) * GRAVITY,
        }  # fmt: skip
        network.addPoint(1, line["anchor"])
        anchor = len(network.pointList)
        end = 1
        if body is not None:
            network.addPoint(1, [0.0, 0.0, 0.0])
            end = len(network.pointList)
            body.attachPoint(end, line["fairlead"])
        network.addLine(line["length"], f"t{number}", pointA=anchor, pointB=end)
    network.initialize()
    if not network.solveEquilibrium(DOFtype="free", tol=1e-5, maxIter=5000):
        raise SystemExit("MoorPy found no equilibrium")
    place = body.r6 if body is not None else network.pointList[0].r
    spent = time.process_time() - begin
    tensions = [[float(x.TA), float(x.TB)] for x in network.lineList]
    return {"place": list(map(float, place)), "tensions": tensions, "cpu": spent}


if __name__ == "__main__":
    json.dump([equilibrium(each) for each in json.load(sys.stdin)], sys.stdout)
