"""What nodes remember of soil goes with them where zones move, cells follow the curvature, and line is paid out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, pinned_at

SOIL = {"shear_strength": 1500.0, "gradient": 1500.0}
FRICTION = {"axial": 0.3, "lateral": 0.5, "residual": [0.15, 0.2], "breakout": 0.05, "travel": 4e-3}
SECTION = {
    "length": 80.0, "mass": 60.0, "diameter": 0.15, "axial_stiffness": 5e7, "bending_stiffness": 2e5,
    "torsional_stiffness": 1e5, "damping": {"mass": 0.3, "stiffness": 0.01},
}  # fmt: skip


def laid(model: Any, **more: Any) -> dict[str, Any]:
    """A line of 80 m from the bed to 20 m above it, whose upper end heaves by 0.6 m and moves on by 1 m."""
    motion = {"heave": {"amplitude": 0.6, "period": 8.0}, "travel": {"by": [-1.0, 0.0, 0.0], "over": 12.0}, "ramp": 4.0}
    return cable_scene(
        SECTION, pinned_at(0, 0, 0), pinned_at(70.0, 0, 20.0, motion=motion), gravity=9.81,
        seabed={"z": 0, "soil": SOIL | {"lateral": {}}, "friction": FRICTION}, model=model, contact={"self": False},
        mesh=80, time=(16.0, 0.02), output=(0.5, 81)
    ) | more  # fmt: skip


def kinds(result: hybrid.Result) -> int:
    """How many divisions into zones a run has had at its outputs."""
    return len({tuple((x[0], x[1], x[2]) for x in zones) for zones in result.zones})


ADAPTIVE = {"kind": "adaptive", "hold_time": 1.0}
FOLLOWING = {"kind": "adaptive", "curvature_error": 0.02}


@pytest.mark.parametrize("dimension", [2, 3])
def test_zones_that_move_feel_the_soil_that_rods_feel(dimension: int) -> None:
    """Pressure under the line, suction at the touchdown and tension as of rods on the same cells; kinds change on the way."""
    rods = hybrid.run(laid("rod", dimension=dimension))
    zones = hybrid.run(laid(ADAPTIVE, dimension=dimension))
    scale = rods.contact.max()
    off = np.abs(zones.contact - rods.contact).max(axis=0) / scale
    tension = np.abs(zones.tension - rods.tension).max() / rods.tension.max()
    suction = rods.contact.min() / scale
    lost = float(rods["work/contact"][-1]), float(zones["work/contact"][-1])
    print(
        f"{kinds(zones)} divisions; pressure off by {off.max():.2g}, suction {suction:.2g}, tension by {tension:.2g}, {lost} J"
    )
    assert kinds(zones) > 2 and suction < -0.05
    assert off.max() < 0.05 and tension < 0.01
    assert lost[1] == pytest.approx(lost[0], rel=0.05)


def test_cells_that_follow_the_curvature_feel_the_same_soil() -> None:
    """Against equal cells of half the length: tension at the top, and what soil has taken."""
    motion = {"heave": {"amplitude": 0.6, "period": 8.0}, "travel": {"by": [-6.0, 0.0, 2.0], "over": 12.0}, "ramp": 4.0}
    fine, scene = (laid(x, mesh={"cells": n}, dimension=2) for x, n in (("rod", 160), (FOLLOWING, 80)))
    for tables in (fine, scene):
        tables["ends"]["end"]["motion"] = motion
    fine, follow = hybrid.run(fine), hybrid.run(scene)
    top = np.linalg.norm(fine.reaction_end, axis=1)
    off = np.abs(np.linalg.norm(follow.reaction_end, axis=1) - top).max() / top.max()
    lost = float(fine["work/contact"][-1]), float(follow["work/contact"][-1])
    cells = {x.s.size - 1 for x in follow.mesh}
    print(f"{cells} cells; pull off by {off:.2g}, {lost} J")
    assert len(cells) > 1 and off < 0.01 and lost[1] == pytest.approx(lost[0], rel=0.1)


def reeled(cells: int, step: float, **more: Any) -> dict[str, Any]:
    """3 m of the line come in within 8 s, and go out again."""
    tables = laid("rod", mesh={"cells": cells}, dimension=2, time={"duration": 16.0, "step": step}, **more)
    payout = {"lengths": [[0.0, 80.0], [8.0, 77.0], [16.0, 80.0]]}
    end = {"kind": "pinned", "position": [70.0, 0, 20.0], "payout": payout}
    return tables | {"ends": tables["ends"] | {"end": end}}


@pytest.mark.long
def test_line_that_is_taken_in_and_paid_out_comes_to_the_same_soil_on_finer_cells() -> None:
    """What soil takes of a line that leaves it and comes back, and the pull at the winch; nodes leave and enter."""
    coarse, fine = hybrid.run(reeled(80, 0.02)), hybrid.run(reeled(160, 0.01))
    pulls = [np.linalg.norm(x.reaction_end, axis=1) for x in (coarse, fine)]
    off = np.abs(pulls[0] - pulls[1]).max() / pulls[1].max()
    lost = [float(x["work/contact"][-1]) for x in (coarse, fine)]
    came = np.ptp(coarse["payout/length"])  # m, of cells of 1 m
    print(f"{came:.3g} m; pull off by {off:.2g}, {lost} J; suction {coarse.contact.min():.0f} N/m")
    assert came > 2.9 and off < 0.01 and lost[0] == pytest.approx(lost[1], rel=0.05) and lost[1] < 0.0


@pytest.mark.parametrize("side", ["start", "end"])
def test_what_lies_still_remembers_the_same_while_line_is_paid_out(side: str) -> None:
    """Nodes far from the touchdown, counted from the other end: their pressure does not change by what enters."""
    tables = reeled(80, 0.02)
    if side == "start":
        ends = tables["ends"]
        tables["ends"] = {"start": ends["end"], "end": ends["start"]}
    found = hybrid.run(tables)
    from_anchor = found.s if side == "end" else found.s[::-1]
    there = found.contact[:, (from_anchor > 5.0) & (from_anchor < 15.0)]
    assert there[0].min() > 500.0 and np.abs(there - there[0]).max() < 1e-3 * there[0].max()
