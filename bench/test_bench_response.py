"""Response by frequency against hours in time: standard deviations of tension and curvature, and the cost of both.

pytest bench/test_bench_response.py -m bench -n 0 -s
HYBRID_HOURS=3 pytest bench/test_bench_response.py -m bench -n 0 -s -k "taut or spread"

Of each of twenty scenes ten hours (HYBRID_HOURS: fewer), each of its own seed; errors are of the mean of them, at five
places (in brackets: at nineteen), of curvature where it is resolved as parts of the largest there, with the standard
error of that mean.  Places whose curvature is not resolved (`LineResponse.resolved`, and `hybrid response` says so) are
printed apart.  CPU time; of responses the median of three.
"""

from __future__ import annotations

import json
import os
import time as clock

import numpy as np
import pytest

import hybrid

pytestmark = pytest.mark.bench
PLACES, FIVE = np.linspace(0.05, 0.95, 19), [0, 4, 9, 14, 18]
HOUR, SEEDS = 3600.0, range(1, 1 + int(os.environ.get("HYBRID_HOURS", "10")))
LINE = {
    "mass": 30.0, "diameter": 0.1, "axial_stiffness": 5e6, "bending_stiffness": 2e3, "torsional_stiffness": 1e3,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip
SEA = {"kind": "jonswap", "significant_height": 2.0, "peak_period": 8.0, "direction": 30.0, "ramp": 10.0}


def scene(
    length, first, last, waves, model="catenary", cells=60, bed=None, current=None, section=None, items=(), **ends
):
    """A line between two places, in waves that are those of SEA but for what is given."""
    waves = (waves if "kind" in waves else SEA | waves) | {"ramp": 10.0}
    fluid = {"density": 1025, "surface": 0, "waves": waves if bed else waves | {"depth": 100.0}}
    if current:
        fluid["current"] = current
    line = LINE | {"length": length} | (section or {})
    held = {name: {"kind": "pinned", "position": place} for name, place in (("start", first), ("end", last))}
    return {
        "environment": {"fluid": fluid} | ({"seabed": bed} if bed else {}),
        "cable": {"sections": [line], "attachments": list(items)},
        "ends": {name: held[name] | ends.get(name, {}) for name in held},
        "initial": "equilibrium",
        "model": model,
        "mesh": {"cells": cells},
    }


def hung(waves, **more):
    """60 m from 65 m down to 5 m down."""
    return scene(60.0, [0, 0, -65], [6, 0, -5.15], waves, **more)


def taut(waves, **more):
    """A leg of fibre rope, 0.6 % stretched."""
    rope = {"mass": 6.0, "diameter": 0.08, "axial_stiffness": 2e6, "bending_stiffness": 0.0, "torsional_stiffness": 0.0}
    return scene(133.7, [0, 0, -95], [100, 0, -5], waves, section=rope, **more)


def on_vessel(folder):
    """A catenary mooring line whose fairlead heaves and surges with a vessel."""
    rows = [
        f"{w:.4f},{heading},{0.6 / (1 + (w / 0.6) ** 4):.5f},{0.5 / (1 + (w / 0.7) ** 4):.5f},-90,0"
        for w in np.linspace(0.1, 4.0, 80)
        for heading in (-180, 0, 180)
    ]
    path = folder / "rao.csv"
    path.write_text("\n".join(["frequency,heading,surge,heave,surge_phase,heave_phase", *rows]))
    held = {"motion": {"vessel": {"rao": str(path), "origin": [170.0, 0.0, -5.0]}}}
    return scene(200.0, [0, 0, -60], [170, 0, -5], {"significant_height": 1.5}, bed=BED, cells=80, end=held)


def spar(_folder):
    """A spar of members on three chains."""
    places = {"east": (1.0, 0.0), "north": (-0.5, 0.87), "south": (-0.5, -0.87)}
    points = {x: {"position": [150.0 * a, 150.0 * b, -100]} for x, (a, b) in places.items()}
    points |= {f"at_{x}": {"body": "hull", "place": [a, b, -3]} for x, (a, b) in places.items()}
    section = {"length": 182.0, "mass": 10.0, "diameter": 0.05, "axial_stiffness": 1e7, "drag": {"normal": 1.2}}
    hull = {
        "mass": 4e4, "inertia": [3e6, 3e6, 3e4], "centre": [0, 0, -1.5], "initial_guess": [0, 0, -12],
        "hydrostatics": {"level": -9.0, "heave": 1.78e4, "roll": 1.5e6, "pitch": 1.5e6},
        "members": [{"start": [0, 0, -15], "end": [0, 0, 15], "diameter": 1.5, "drag": 1.0, "added_mass": 1.0}],
    }  # fmt: skip
    return {
        "environment": {"fluid": {"density": 1025, "surface": 0.0, "waves": SEA | {"significant_height": 1.0}},
                        "seabed": {"z": -100.0, "stiffness": 1e4}},
        "points": points, "bodies": {"hull": hull},
        "lines": {x: {"start": x, "end": f"at_{x}", "sections": [section], "mesh": {"cells": 16}} for x in places},
    }  # fmt: skip


BED = {"z": -60, "stiffness": 5e4}
BUOY = {"kind": "float", "at": 30.0, "buoyancy": 2000.0, "mass": 100.0, "drag_area": 0.6, "added_mass": 150.0}
MODULES = {"kind": "modules", "range": [90.0, 130.0], "buoyancy": 500.0, "mass": 40.0, "drag_area": 0.5,
           "added_mass": 60.0}  # fmt: skip
PARTS = [{"significant_height": 1.5, "peak_period": 13.0, "shape": 3.0},
         {"significant_height": 1.2, "peak_period": 6.0, "shape": 1.2}]  # fmt: skip
TOUCHDOWN = (200.0, [0, 0, -60], [170, 0, -5])
SCENES = {
    "hung, 2 m": hung({}),
    "hung, 4 m": hung({"significant_height": 4.0, "peak_period": 12.0}),
    "hung, rods": hung({}, model="rod"),
    "hung, current": hung({}, current=[0.6, 0, 0]),
    "sagging": scene(70.0, [0, 0, -20], [60, 0, -15], {"peak_period": 9.0, "direction": 60.0}),
    "touchdown": scene(*TOUCHDOWN, {}, bed=BED, cells=80),
    "touchdown, 4 m": scene(*TOUCHDOWN, {"significant_height": 4.0, "peak_period": 12.0}, bed=BED, cells=80),
    "hung, spread sea": hung({"spreading": {"exponent": 8}}),
    "hung, Torsethaugen": hung({"kind": "torsethaugen", "significant_height": 2.5, "peak_period": 12.0}),
    "hung, two peaks": hung({"kind": "ochi_hubble", "parts": PARTS, "direction": 70.0}),
    "hung, across": hung({"direction": 90.0}),
    "hung, short waves": hung({"significant_height": 1.0, "peak_period": 5.0}),
    "hung, stiff rod": hung({}, model="rod", section={"bending_stiffness": 2e5, "damping": 0.1},
                            start={"kind": "clamped", "tangent": [0, 0, 1]}),
    "hung, float": hung({}, items=[BUOY]),
    "hung, storm": hung({"significant_height": 8.0, "peak_period": 13.0}),
    "taut leg": taut({}),
    "taut leg, 5 m": taut({"significant_height": 5.0, "peak_period": 12.0}),
    "lazy wave": scene(*TOUCHDOWN, {"significant_height": 1.0}, bed=BED, cells=80, items=[MODULES]),
    "fairlead on a vessel": on_vessel,
    "spar on three chains": spar,
}  # fmt: skip


def seeded(tables, seed):
    """An hour of another realisation."""
    data = json.loads(json.dumps(tables))
    data["environment"]["fluid"]["waves"]["seed"] = seed
    return data | {"time": {"duration": HOUR, "step": 0.15}}


@pytest.mark.parametrize("name", SCENES)
def test_against_hours(name, tmp_path):
    tables = SCENES[name](tmp_path) if callable(SCENES[name]) else SCENES[name]
    hybrid.response(tables)
    costs = []
    for _ in range(3):
        begin = clock.process_time()
        found = hybrid.response(tables)
        costs.append(clock.process_time() - begin)
    cost = float(np.median(costs))
    line_name, line = next(iter(found.lines.items()))
    places = [round(part * float(line.s[-1]), 3) for part in PLACES.tolist()]
    there: dict[str, list] = {"tension": [], "curvature": []}
    bends = bool(line.mean_curvature.max() > 0.0)
    begin = clock.process_time()
    for seed in SEEDS:
        several = len(found.lines) > 1
        output = {"every": 0.25, "points": 101 if several else places}
        with hybrid.run(seeded(tables, seed) | {"output": output}) as result:
            one = result.lines[line_name] if several else result
            columns = [int(np.abs(one.s - x).argmin()) for x in places]
            for what, values in there.items():
                values.append(np.asarray(getattr(one, what))[result.times > 100.0][:, columns].std(axis=0))
            at = one.s[columns]
    hours = (clock.process_time() - begin) / len(SEEDS)
    tension, curvature = (np.mean(there[x], axis=0) for x in ("tension", "curvature"))
    scatter = [np.std(x, axis=0, ddof=1).max() / np.sqrt(len(x)) if len(x) > 1 else np.nan for x in there.values()]
    ours = np.interp(at, line.middle, line.deviation("tension"))
    bent = np.interp(at, line.s, line.deviation("curvature"))
    off_tension = 100.0 * np.abs(ours / tension - 1.0)
    off = off_tension[FIVE].max()
    added = 100.0 * line.left_out["tension"].max()
    known = line.resolved("curvature")[[int(np.abs(line.s - x).argmin()) for x in at]]
    offs = 100.0 * np.abs(bent - curvature) / (curvature.max() if bends else 1.0)
    five = np.isin(np.arange(PLACES.size), FIVE)
    off_bent = offs[known & five].max(initial=0.0)
    words = ["tension" if found.valid_for("tension") else "", "curvature" if found.valid_for("curvature") else ""]
    print(
        f"\n{name}: tension {off:.1f} % ({off_tension.max():.1f}; +-{100.0 * scatter[0] / tension.max():.1f}; "
        f"{added:.1f} % are left out), curvature {off_bent:.1f} % ({offs[known].max(initial=0.0):.1f}; "
        f"+-{100.0 * scatter[1] / max(curvature.max(), 1e-300):.1f}; {(~known).sum()} of {len(at)} places are not "
        f"resolved, {offs[~known].max(initial=0.0):.1f} % there) of the largest; {cost:.3f} s of CPU for "
        f"{hours:.1f} s an hour, {10.0 * hours / cost:.0f} times cheaper than ten; valid for "
        f"{', '.join(x for x in words if x) or 'nothing'}{'; ' if found.notes else ''}{'; '.join(found.notes)}"
    )
    assert not found.valid_for("tension") or off_tension.max() < 10.0
    assert not found.valid_for("curvature") or offs[known].max(initial=0.0) < 10.0
