"""Error figures of vibrations that last: taut lines and cantilevers in vacuum and air.  docs/evidence/accuracy.md"""

from __future__ import annotations

from functools import cache
from time import process_time

import numpy as np
import pytest

import hybrid

pytestmark = pytest.mark.bench
SAID = {"accuracy missed", "error uncertain", "irregular motion"}
ASKED = ("1%", "0.3%", {"position": "0.1%"}, {"line_tension": "1%"}, {"bending_moment": "2%"})


def scene(section, start, end, duration, every, **more):
    return {
        "environment": {"gravity": more.pop("gravity", 9.81)} | more,
        "cable": {"sections": [section]},
        "ends": {"start": start, "end": end},
        "initial": "equilibrium",
        "time": {"duration": duration},
        "output": {"every": every, "points": 26},
    }


def cantilever(length, stiffness, amplitude, period, duration, of="heave"):
    motion = {of: {"amplitude": amplitude, "period": period}, "ramp": 2.0 * period}
    start = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "motion": motion}
    section = {"length": length, "mass": 1.0, "bending_stiffness": stiffness}
    return scene(section, start, "free", duration, duration / 100.0)


def taut(duration, periods, ramp=1.0, air=False):
    """Pulled with 2000 N; periods: of its lowest vibration to one of its end."""
    length = 50.0 * 1.02
    period = 2.0 * length / np.sqrt(2000.0 / (0.5 * 1.02)) * periods
    motion = {"heave": {"amplitude": 0.5, "period": float(period)}, "ramp": float(ramp * period)}
    section = {"length": 50.0, "mass": 0.5, "axial_stiffness": 1.0e5, "max_strain": 0.2}
    section |= {"diameter": 0.02, "drag": {"normal": 1.2}} if air else {}
    start = {"kind": "pinned", "position": [0, 0, 0]}
    end = {"kind": "pinned", "position": [length, 0, 0], "motion": motion}
    more = {"fluid": {"density": 1.2}} if air else {}
    return scene(section, start, end, duration, 0.25, gravity=0, **more) | {"model": "catenary"}


SCENES = {  # with cells and steps of what they are compared with
    "beam, 56 Hz, shaken with 20 Hz": (cantilever(1, 1e4, 0.01, 0.05, 1.0), 200, 20_000),
    "the same, 2 s": (cantilever(1, 1e4, 0.01, 0.05, 2.0), 200, 40_000),
    "the same, 5 Hz": (cantilever(1, 1e4, 0.01, 0.2, 2.0), 200, 30_000),
    "beam, 0.4 Hz, 1 Hz": (cantilever(2, 10, 0.05, 1.0, 10.0), 200, 20_000),
    "the same, pitched": (cantilever(2, 10, 20.0, 1.5, 15.0, "pitch"), 200, 20_000),
    "beam, 5.6 Hz, 3.3 Hz": (cantilever(1, 100, 0.02, 0.3, 6.0), 200, 30_000),
    "taut, 20 s": (taut(20.0, 1.3), 300, 8_000),
    "taut, 100 s": (taut(100.0, 1.3), 300, 40_000),
    "taut, slower": (taut(60.0, 2.4), 300, 24_000),
    "taut, faster": (taut(60.0, 0.7), 300, 24_000),
    "taut, in air": (taut(100.0, 1.3, air=True), 300, 40_000),
    "taut, long ramp": (taut(60.0, 1.3, ramp=4.0), 300, 24_000),
}


@cache
def truth(name):
    data, cells, steps = SCENES[name]
    duration = data["time"]["duration"]
    return hybrid.run(data | {"mesh": {"cells": cells}, "time": {"duration": duration, "step": duration / steps}})


def figures(name, asked):
    """Of one run: true error over what is asked, figure over true error, of all that is asked; whether it says so."""
    result = hybrid.run(SCENES[name][0] | {"accuracy": asked})
    return judged(result, truth(name), asked)


def judged(result, fine, asked):
    """The same of a result, against one in fine cells and steps."""
    found = []
    for quantity, percent in ({"position": asked, "tension": asked} if isinstance(asked, str) else asked).items():
        part, size = 0.01 * float(percent.removesuffix("%")), float(result.s[-1])
        fields = {"tension": ("reaction_start", "reaction_end"), "line_tension": ("tension",)}.get(
            quantity, (quantity,)
        )
        wrong = [np.asarray(result[x]) - np.asarray(fine[x]) for x in fields]
        vectors = quantity in ("position", "tension")
        off = max(float((np.linalg.norm(x, axis=-1) if vectors else np.abs(x)).max()) for x in wrong)
        if quantity != "position":
            size = max(float((np.linalg.norm(fine[x], axis=-1) if vectors else np.abs(fine[x])).max()) for x in fields)
        names = [x.replace("reaction", "end_force") for x in fields]
        shown = max(float(result.errors[f"total/{x}"].max()) for x in names)
        found.append((off / (part * size), shown / off))
    return found, bool(SAID & {e.kind for e in result.events})


def test_figures_of_vibrations_that_last():
    silent, ratios, cpu = [], [], 0.0
    for name in SCENES:
        truth(name)
        for asked in ASKED:
            if name.startswith("taut") and "bending_moment" in asked:
                continue
            begin = process_time()
            found, said = figures(name, asked)
            cpu += process_time() - begin
            ratios += [x[1] for x in found]
            times = max(x[0] for x in found)
            silent += [(name, asked, round(times, 2))] if times > 1.0 and not said else []
    r = np.array(ratios)
    print(f"\nmissed in silence: {len(silent)}; figures below 0.5 of the truth {np.sum(r < 0.5)}, below 0.7 "
          f"{np.sum(r < 0.7)}, of {r.size}, median {np.median(r):.2f}; {cpu:.0f} s of CPU")  # fmt: skip
    print(*silent, sep="\n")
    assert len(silent) <= 4


def random_line(seed):
    """A cantilever, a taut line, a line that sags between pins of which one moves, or one that hangs with a weight."""
    r, kind = np.random.default_rng(1000 + seed), seed % 4
    if kind == 0:
        stiffness = 10.0 ** r.uniform(0, 3)
        period = 2.0 * np.pi / (3.516 * np.sqrt(stiffness)) * 10.0 ** r.uniform(-0.3, 0.7)
        data = cantilever(1.0, stiffness, 0.02, period, period * r.uniform(8, 25))
        data["ends"]["start"]["motion"]["ramp"] = period * r.uniform(0.5, 3)
    elif kind == 1:
        data = taut(r.uniform(10, 60), 10.0 ** r.uniform(-0.3, 0.5), ramp=r.uniform(0.5, 2))
    elif kind == 2:
        over, duration = r.uniform(1, 4), r.uniform(15, 30)
        section = {"length": 12.0, "mass": 2.0, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 5.0}
        end = {"kind": "pinned", "position": [10, 0, r.uniform(-2, 2)]}
        end["motion"] = {"travel": {"by": [0, 0.3, r.uniform(-0.3, 0.3)], "over": over}}
        start = {"kind": "pinned", "position": [0, 0, 0]}
        data = scene(section, start, end, duration, duration / 120) | {"model": "rod"}
    else:
        period = r.uniform(1, 5)
        duration = period * r.uniform(6, 15)
        section = {"length": 10.0, "mass": 0.5, "diameter": 0.01, "bending_stiffness": 1.0}
        surge = {"surge": {"amplitude": 0.3, "period": period}, "ramp": period * r.uniform(0.5, 2)}
        start = {"kind": "pinned", "position": [0, 0, 0], "motion": surge}
        data = scene(section, start, {"kind": "body", "mass": 10.0}, duration, duration / 120) | {"model": "rod"}
    last = {"bending_moment": "2%"} if kind != 1 else {"position": "0.1%"}
    return data, ("1%", "0.3%", last)[(seed // 4) % 3]


def test_figures_of_random_lines():
    """Of 48 in vacuum, against 2.5 times as many cells and six times as many steps, and 100 and 4000 at least."""
    rows, uncertain = [], 0
    for seed in range(48):
        data, asked = random_line(seed)
        result = hybrid.run(data | {"accuracy": asked})
        duration = data["time"]["duration"]
        steps = max(4000, 6 * len(result.steps["t"]))
        cells = max(100, int(2.5 * result.mesh[-1].kinds.size))
        fine = hybrid.run(data | {"mesh": {"cells": cells}, "time": {"duration": duration, "step": duration / steps}})
        found, said = judged(result, fine, asked)
        rows += [(seed, asked, round(times, 2), round(ratio, 2), said) for times, ratio in found]
        texts = [e.text for e in result.events if e.kind == "error uncertain" and "free vibration with" in e.text]
        uncertain += bool(texts)
        if texts:
            print(seed, asked, [tuple(round(x, 2) for x in y) for y in found], texts[0])
    r = np.array([x[3] for x in rows])
    print(f"\n{r.size} figures: below 0.5 of the truth {np.sum(r < 0.5)}, below 0.7 {np.sum(r < 0.7)}, above 3 "
          f"{np.sum(r > 3.0)}, median {np.median(r):.2f}; free vibrations said of {uncertain} lines")  # fmt: skip
    print(*(x for x in rows if x[3] < 0.7 or (x[2] > 1.0 and not x[4])), sep="\n")
    assert not [x for x in rows if x[3] < 0.5 and not x[4]]
