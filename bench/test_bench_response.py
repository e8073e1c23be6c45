"""Response by frequency against hours in time: standard deviations of tension and curvature, and the cost of both.

pytest bench/test_bench_response.py -m bench -n 0 -s

Of each scene six hours, each of its own seed; errors are of the mean of them, at five places, of curvature as parts of
the largest there.  CPU time.
"""

from __future__ import annotations

import time as clock

import numpy as np
import pytest

import hybrid

pytestmark = pytest.mark.bench
HOUR, SEEDS = 3600.0, range(1, 7)
LINE = {
    "mass": 30.0, "diameter": 0.1, "axial_stiffness": 5e6, "bending_stiffness": 2e3, "torsional_stiffness": 1e3,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip


def scene(length, start, end, height, period, model="catenary", cells=60, bed=None, current=None, direction=30):
    waves = {
        "kind": "jonswap", "significant_height": height, "peak_period": period, "direction": direction, "ramp": 10,
    }  # fmt: skip
    fluid = {"density": 1025, "surface": 0, "waves": waves if bed else waves | {"depth": 100.0}}
    if current:
        fluid["current"] = current
    return {
        "environment": {"fluid": fluid} | ({"seabed": bed} if bed else {}),
        "cable": {"sections": [LINE | {"length": length}]},
        "ends": {"start": {"kind": "pinned", "position": start}, "end": {"kind": "pinned", "position": end}},
        "initial": "equilibrium",
        "model": model,
        "mesh": {"cells": cells},
    }


BED = {"z": -60, "stiffness": 5e4}
SCENES = {
    "hung, 2 m": scene(60.0, [0, 0, -65], [6, 0, -5.15], 2.0, 8.0),
    "hung, 4 m": scene(60.0, [0, 0, -65], [6, 0, -5.15], 4.0, 12.0),
    "hung, rods": scene(60.0, [0, 0, -65], [6, 0, -5.15], 2.0, 8.0, model="rod"),
    "hung, current": scene(60.0, [0, 0, -65], [6, 0, -5.15], 2.0, 8.0, current=[0.6, 0, 0]),
    "sagging": scene(70.0, [0, 0, -20], [60, 0, -15], 2.0, 9.0, direction=60),
    "touchdown": scene(200.0, [0, 0, -60], [170, 0, -5], 2.0, 8.0, bed=BED, cells=80),
    "touchdown, 4 m": scene(200.0, [0, 0, -60], [170, 0, -5], 4.0, 12.0, bed=BED, cells=80),
}


@pytest.mark.parametrize("name", SCENES)
def test_against_hours(name):
    tables = SCENES[name]
    hybrid.response(tables)
    begin = clock.process_time()
    found = hybrid.response(tables)
    cost, line = clock.process_time() - begin, found.lines["cable"]
    length = float(line.s[-1])
    places = [round(part * length, 3) for part in (0.05, 0.25, 0.5, 0.75, 0.95)]
    there: dict[str, list] = {"tension": [], "curvature": []}
    begin = clock.process_time()
    for seed in SEEDS:
        data = tables | {"time": {"duration": HOUR, "step": 0.15}, "output": {"every": 0.25, "points": places}}
        fluid = tables["environment"]["fluid"]
        waves = fluid["waves"] | {"seed": seed}
        data["environment"] = tables["environment"] | {"fluid": fluid | {"waves": waves}}
        result = hybrid.run(data)
        for what, values in there.items():
            values.append(np.asarray(getattr(result, what))[result.times > 100.0].std(axis=0))
    hours = clock.process_time() - begin
    tension, curvature = (np.mean(there[x], axis=0) for x in ("tension", "curvature"))
    ours = np.interp(places, line.middle, line.deviation("tension"))
    bent = np.interp(places, line.s, line.deviation("curvature"))
    off = 100.0 * np.abs(ours / tension - 1.0).max()
    off_bent = 100.0 * np.abs(bent - curvature).max() / curvature.max()
    print(
        f"\n{name}: tension {off:.1f} %, curvature {off_bent:.1f} % of the largest; {cost:.2f} s of CPU for "
        f"{hours / len(SEEDS):.1f} s an hour, {10.0 * hours / len(SEEDS) / cost:.0f} times cheaper than ten; "
        f"{'valid' if found.valid else '; '.join(found.notes)}"
    )
    assert not found.valid_for("tension") or off < 10.0
    assert not found.valid_for("curvature") or off_bent < 10.0
