"""Error figures of shocks: lines let go straight, ends let go in mid-motion, bodies that fall.  docs/evidence/accuracy.md"""

from __future__ import annotations

import numpy as np
import pytest

import hybrid

pytestmark = pytest.mark.bench
SAID = {"accuracy missed", "error uncertain", "irregular motion", "no error figure", "not converged"}
SAID |= {"vibrations damped"}  # with what is damped, which the figure does not see
SEEDS = (3, 6, 7, 8, 16, 17, 18, 21, 22, 23, 26, 27, 28, 31, 32, 33, 36, 37, 38, 47, 48, 52, 53, 56, 58, 61, 63)


def section(r, fluid, length):
    found = {"length": length, "mass": float(r.uniform(0.3, 2)), "diameter": float(r.uniform(0.01, 0.04))}
    found |= {"bending_stiffness": float(10 ** r.uniform(-1, 1.5)), "drag": {"normal": 1.2}}
    if r.random() < 0.6:
        found["axial_stiffness"] = float(10 ** r.uniform(4, 6))
    if fluid == "water":
        found["added_mass"] = {"normal": 1.0}
        found["mass"] = max(found["mass"], 1.6 * 1025 * np.pi / 4 * found["diameter"] ** 2)
    return found


def shock(seed):
    """A scene and what is asked; kinds 1: let go straight, 2: an end is let go at a time, 3: a body falls."""
    r, kind = np.random.default_rng(7000 + seed), seed % 5
    fluid = ("water", "air", "none")[seed % 3] if kind != 1 else ("air", "water")[seed % 2]
    environment = {"gravity": 9.81}
    if fluid != "none":
        environment["fluid"] = {"density": 1025 if fluid == "water" else 1.2}
    length = float(r.uniform(5, 20))
    line = section(r, fluid, length)
    start = {"kind": "pinned", "position": [0, 0, 0]}
    if kind == 1:
        slope = float(r.uniform(-0.8, 0.8))
        end = "free" if seed % 2 else {"kind": "body", "mass": float(r.uniform(1, 5))}
        initial = {"kind": "straight", "direction": [np.cos(slope), 0, np.sin(slope)]}
        duration = float(r.uniform(1, 4))
    elif kind == 2:
        let_go = {"time": float(r.uniform(0.3, 1))}
        end = {"kind": "pinned", "position": [0.8 * length, 0, 0], "release_at": let_go}
        initial, duration = "equilibrium", float(r.uniform(1.5, 3))
    else:
        r.uniform()
        end = {"kind": "body", "mass": float(r.uniform(3, 20))}
        initial = {"kind": "straight", "direction": [1, 0, float(r.uniform(-0.3, 0.3))]}
        duration = float(r.uniform(1, 3))
    if fluid == "none":
        del line["drag"]
    data = {"environment": environment, "cable": {"sections": [line]}, "model": "rod", "initial": initial}
    data |= {"ends": {"start": start, "end": end}, "time": {"duration": duration}}
    return data | {"output": {"every": duration / 100, "points": 21}}, ("1%", "3%", "0.3%")[(seed // 5) % 3]


def test_figures_of_shocks():
    """Against three times as many cells and five times as many steps, and 200 and 8000 at least."""
    rows = []
    for seed in SEEDS:
        data, asked = shock(seed)
        result = hybrid.run(data | {"accuracy": asked})
        duration, steps = data["time"]["duration"], max(8000, 5 * len(result.steps["t"]))
        cells = max(200, 3 * result.mesh[-1].kinds.size)
        fine = hybrid.run(data | {"mesh": {"cells": cells}, "time": {"duration": duration, "step": duration / steps}})
        said = sorted(SAID & {e.kind for e in result.events})
        part, length = 0.01 * float(asked.removesuffix("%")), float(result.s[-1])
        for fields in (("position",), ("reaction_start", "reaction_end")):
            off = max(np.linalg.norm(np.asarray(result[x]) - np.asarray(fine[x]), axis=-1).max() for x in fields)
            size = max(np.linalg.norm(fine[x], axis=-1).max() for x in fields) if len(fields) > 1 else length
            shown = max(result.errors[f"total/{x.replace('reaction', 'end_force')}"].max() for x in fields)
            rows.append(
                (seed, asked, fields[0], round(float(off / part / size), 2), round(float(shown / off), 2), said)
            )
    r = np.array([x[4] for x in rows])
    silent = [x for x in rows if x[3] > 1.0 and not x[5]]
    low = [x for x in rows if x[4] < 0.5 and not x[5]]
    print(f"\n{r.size} figures: within 0.7 to 3 {np.mean((r > 0.7) & (r < 3)):.0%}, below 0.7 {np.sum(r < 0.7)}, median "
          f"{np.median(r):.2f}; missed in silence {len(silent)}, below 0.5 in silence {len(low)}")  # fmt: skip
    print(*silent, "", *low, sep="\n")
    assert len(silent) <= 3
    assert not [x for x in low if x[4] < 0.45 or x[3] > 1.0]
