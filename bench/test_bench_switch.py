"""What a review that changes zones and the switch that follows cost, on the touchdown line in space.

    pytest bench/test_bench_switch.py -m bench -n 0 -s

Times by the wall clock, us: the smallest and the median of all switches of three runs, which other programs on the
machine lengthen, and the first switch of a run, which makes the tables.  Of several lines processor time.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter, process_time
from typing import Any

import numpy as np
import pytest
from test_bench_zones import MESHES, SHARE, Text, per_step, riser, run, touchdown

import hybrid
from hybrid.errors import ZONE_EVENTS
from hybrid.kernels.mesh.cell_errors import CURVATURE
from hybrid.simulation.run import Run
from hybrid.simulation.run_line import RunLine
from hybrid.simulation.run_zones import RunZones
from hybrid.zones import change as zone_changes
from hybrid.zones.manager import DomainManager

pytestmark = pytest.mark.bench
ROUNDS = 3


def timed(call: Callable[..., Any], into: list[float], clock: Callable[[], float] = perf_counter) -> Callable[..., Any]:
    """The same, with the time (us) that it takes at the end of a list; calls with an empty list are not counted."""

    def with_time(*given: Any) -> Any:
        begin = clock()
        found = call(*given)
        if [] not in given:
            into.append(1e6 * (clock() - begin))
        return found

    return with_time


@pytest.mark.parametrize("mesh", MESHES)
def test_switch(mesh: str, monkeypatch: pytest.MonkeyPatch) -> None:
    reviews, switches, first = list[float](), list[float](), list[float]()
    monkeypatch.setattr(DomainManager, "review", timed(DomainManager.review, reviews))
    monkeypatch.setattr(RunZones, "_change", timed(RunZones._change, switches))
    text = touchdown(True)
    for _ in range(ROUNDS + 1):  # the first compiles
        begin = len(switches)
        run(text, MESHES[mesh], {"kind": "adaptive"}, SHARE)
        first.append(switches.pop(begin))
    print(f"\n{mesh}: us, smallest and median; a review that changes zones or may, a switch; the first of a run")
    for name, x in (("review", reviews), ("switch", switches), ("first switch", first[1:])):
        print(f"  {name:14s} {np.min(x):6.0f} {np.median(x):6.0f}  of {len(x)}")


@pytest.mark.parametrize("cells", [100, 400, 2000])
def test_quiet_watching(cells: int) -> None:
    """A riser in a current that stays catenary: a step of zones that move less one of catenaries, the smallest of ROUNDS."""
    text = riser()
    text["environment"]["fluid"].pop("waves")
    text["time"] = {"duration": 100.0, "step": 0.1}
    text["output"] = {"every": 50.0, "points": 11}
    times: dict[str, list[float]] = {"catenary": [], "adaptive": []}
    for _ in range(ROUNDS + 1):  # the first compiles
        for kind, spent in times.items():
            result = run(text, {"cells": cells}, {"kind": kind})
            assert not any((mesh.kinds == "rod").any() for mesh in result.mesh)
            spent.append(per_step(result))
    catenary, adaptive = (min(x[1:]) for x in times.values())
    print(
        f"\n{cells} cells: {adaptive:.0f} us a step of zones that move, {catenary:.0f} of catenaries: {adaptive - catenary:.0f} "
        f"for watching, where {10.0 + 0.1 * cells:.0f} are aimed at"
    )


def four_lines() -> Text:
    """Touchdown lines in the four directions from fairleads that heave alike, in a current, and 60 s of it."""
    one, points, lines = touchdown(True), Text(), Text()
    heave = {"heave": {"amplitude": 2.0, "period": 8.0}, "ramp": 16.0}
    for k, (x, y) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1))):
        points[f"anchor{k}"] = {"position": [205.0 * x, 205.0 * y, -100.0]}
        points[f"fairlead{k}"] = {"position": [0.0, 0.0, 0.0], "motion": heave}
        lines[f"line{k}"] = {
            "sections": one["cable"]["sections"], "start": f"anchor{k}", "end": f"fairlead{k}",
            "mesh": MESHES["graded, 120 cells"], "contact": {"self": False}, "model": {"kind": "adaptive"},
        }  # fmt: skip
    return {
        "environment": one["environment"], "points": points, "lines": lines, "contact": {"between": []},
        "time": {"duration": 60.0, "step": 0.1}, "output": {"every": 1.0, "points": 201},
    }  # fmt: skip


def test_switch_of_several_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each line that changes, what follows for all of them included; the outputs that it has to write before apart."""
    monkeypatch.setattr(zone_changes, "shares_asked", lambda *_: {CURVATURE: SHARE})
    written, changing, attaching, change = list[float](), list[float](), list[float](), RunZones.after_step

    def without_outputs(zones: RunZones) -> None:
        begin, before = process_time(), sum(written)
        change(zones)
        changing.append(1e6 * (process_time() - begin) - (sum(written) - before))
        outputs.append(sum(written) - before)

    outputs, changed = list[float](), 0
    hybrid.run(four_lines())  # the first compiles
    monkeypatch.setattr(RunZones, "after_step", without_outputs)
    monkeypatch.setattr(Run, "_attach", timed(Run._attach, attaching, process_time))
    monkeypatch.setattr(RunLine, "write_down", timed(RunLine.write_down, written, process_time))
    for _ in range(ROUNDS):
        result = hybrid.run(four_lines())
        for line in result.lines.values():
            changed += len({e.t for e in line.events if e.kind in ZONE_EVENTS and e.t > 0.0})
    print(
        f"\nfour lines of 120 cells, us of processor time for each of {changed // ROUNDS} changes of a line in a run: "
        f"{(sum(changing) + sum(attaching)) / changed:.0f}, and {sum(outputs) / changed:.0f} for outputs of the zones before"
    )
