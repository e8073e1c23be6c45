"""A bed that remembers: soil with suction, resistance to the side, friction that breaks out; at rest, in motion, energy."""

from __future__ import annotations

from itertools import pairwise
from math import exp
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

import hybrid
from hybrid.errors import SceneError
from tests.scenes import cable_scene, pinned_at

Floats = NDArray[np.float64]
D, SU, RHO, STEEP, SUCTION = 0.2, 2000.0, 1500.0, 200.0, 0.6
SOIL = {"shear_strength": SU, "gradient": RHO}


def ultimate(z: float) -> float:
    """Pu, N/m."""
    x = z / D
    return (6.0 * x**0.25 if x > 0.1 else 6.0 * 0.1**0.25 * (10.0 * x) ** 0.5) * (SU + RHO * z) * D


def first(z: float) -> float:
    return ultimate(z) * z * STEEP / (D + z * STEEP)


def history(depths: Floats) -> Floats:
    """Force per length, N/m, at depths that are passed through one after the other."""
    P, way, z0, P0, out = 0.0, 0, 0.0, 0.0, []
    for last, z in pairwise([0.0, *depths.tolist()]):
        if z <= 0.0:
            P, way = 0.0, 0
        else:
            turns = 1 if z > last else -1
            if (way or 1) != turns and last > 0.0:
                way, z0, P0 = turns, last, P
            P = first(z)
            if way:
                x = ultimate(z0) * abs(z - z0) * STEEP / D
                Q = ultimate(z) - P0 if way > 0 else P0 + SUCTION * ultimate(z)
                branch = P0 + way * (Q * x / (Q + x) if Q > 0.0 else Q)
                P, way = (branch, way) if branch < P else (P, 0)
        out.append(P)
    return np.array(out)


def pressed(bed: dict[str, Any], over: float, step: float, motion: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A stiff rod of a metre, level, both ends of which follow one motion from 2 cm above the bed."""
    rod = {"length": 1.0, "mass": 20.0, "diameter": D, "axial_stiffness": 1e8, "bending_stiffness": 1e6, "damping": 2.0}
    return cable_scene(
        rod, *(pinned_at(x, 0, 0.02, motion={"ramp": 1.0} | motion) for x in (0.0, 1.0)), gravity=0, seabed={"z": 0} | bed,
        initial={"kind": "straight", "origin": [0, 0, 0.02], "direction": [1, 0, 0]}, model="rod", contact={"self": False},
        mesh=6, time=(over, step), output={"every": step, "points": 7, "exact": True},
    ) | more  # fmt: skip


HEAVE = [{"amplitude": 0.06, "period": 8.0, "phase": -90.0}, {"amplitude": 0.004, "period": 1.7}]


@pytest.mark.long
@pytest.mark.parametrize("dimension", [2, 3])
def test_penetration_suction_and_repenetration_follow_the_backbone(dimension: int) -> None:
    """In, up through suction until it breaks away, in again, with small loops on the way; energy per cycle."""
    found = hybrid.run(pressed({"soil": SOIL}, 20.0, 0.02, {"heave": HEAVE}, dimension=dimension))
    z = -found.position[:, :, 2]
    force, expected = found["contact_force"], np.array([history(x) for x in z.T])
    contact = found["contact"]
    off = np.abs(contact.T - expected).max() / 1700.0
    print(f"pressure off by {off:.1e}, from {contact.min():.1f} to {contact.max():.1f} N/m")
    assert contact.min() < -500.0 and contact.max() > 1500.0 and off < 1e-9
    np.testing.assert_allclose(force, np.trapezoid(contact, found.s, axis=1), rtol=1e-6, atol=1e-3)
    work = np.sum(0.5 * (expected[:, 1:] + expected[:, :-1]) * np.diff(z.T, axis=1), axis=1)
    taken = float(np.trapezoid(work, found.s))
    print(f"{-found['work/contact'][-1]:.3f} J booked, {taken:.3f} by force and way")
    assert float(found["work/contact"][-1]) == pytest.approx(-taken, rel=1e-6)
    assert abs(float(found["work/scheme"][-1])) < 1e-3 * taken


def test_a_rest_in_soil_bears_its_weight_at_the_depth_of_first_penetration() -> None:
    """A line from above onto the bed, as a rod and a catenary, with the depth in closed form."""
    section = {"length": 30.0, "mass": 100.0, "diameter": D, "axial_stiffness": 1e8, "bending_stiffness": 1e3}
    bed = {"gravity": 9.81, "seabed": {"z": 0, "soil": SOIL, "friction": 0.3}}
    depth, weight = float(brentq(lambda z: first(z) - 981.0, 1e-6, 1.0)), 981.0
    for model in ("rod", "catenary"):
        ends = pinned_at(0, 0, 0), pinned_at(24, 0, 8)
        found = hybrid.static(cable_scene(section, *ends, environment=bed, model=model, mesh=120))
        k = int(np.argmin(np.abs(found.s - 5.0)))
        assert found.contact[0, k] == pytest.approx(weight, rel=1e-3)
        assert -found.position[0, k, 2] == pytest.approx(depth, rel=5e-3)


@pytest.mark.long
@pytest.mark.parametrize("dimension", [2, 3])
def test_friction_breaks_out_and_falls_to_what_is_left(dimension: int) -> None:
    """A line that is drawn along a bed: mu N (r + (1 - r) exp(-w/l)), w the way behind the elastic travel."""
    mu, left, over, travel = 0.5, 0.2, 0.05, 0.002
    friction = {"axial": mu, "lateral": mu, "residual": [left, left], "breakout": over, "travel": travel}
    tables = cable_scene(
        {"length": 4.0, "mass": 10.0, "diameter": 0.05, "axial_stiffness": 1e8, "damping": 0.5},
        pinned_at(0, 0, 0, motion={"travel": {"by": [-0.2, 0, 0], "over": 20.0}}), "free",
        seabed={"z": 0, "stiffness": 1e5, "friction": friction},
        initial={"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0, 0]}, model="catenary",
        contact={"self": False}, mesh=20, dimension=dimension, time=(20.0, 0.02),
        output={"every": 0.02, "points": 21, "exact": True}
    )  # fmt: skip
    found = hybrid.run(tables)
    way = -found.position[:, 10, 0] + found.position[0, 10, 0]
    drawn = -found["reaction_start"][:, 0]
    slid = np.maximum(way - travel, 0.0)
    share = left / mu + (1.0 - left / mu) * np.exp(-np.concatenate([[0.0], slid[:-1]]) / over)
    total = float(np.trapezoid(found.contact[-1], found.s))
    k = int(np.argmax(drawn))
    print(f"break-out {drawn[k]:.2f} N at {way[k] * 1e3:.2f} mm, {drawn[-1]:.2f} N behind {way[-1]:.3f} m")
    sliding = (way > 2 * travel) & (found.t < 19.0)
    np.testing.assert_allclose(drawn[sliding], total * mu * share[sliding], rtol=2e-2)
    assert drawn[k] == pytest.approx(mu * total, rel=3e-2) and way[k] == pytest.approx(travel, rel=0.3)


def test_travel_of_friction_in_suction_is_the_same_in_a_plane_and_in_space() -> None:
    """Whatever resists beside the line: a node that soil holds from below lies in it."""
    surge = [{"amplitude": 2e-3, "period": 3.1}, {"amplitude": 3e-4, "period": 0.9}]
    heave = [HEAVE[0], {"amplitude": 0.01, "period": 1.0}]  # up through suction, and in again before it breaks away
    found = []
    for dimension, lateral in ((2, {}), (3, {}), (2, {"lateral": {}}), (3, {"lateral": {}})):
        bed = {"soil": SOIL | lateral, "friction": {"axial": 0.3, "lateral": 0.5, "travel": 1e-3}}
        found.append(hybrid.run(pressed(bed, 12.0, 0.02, {"heave": heave, "surge": surge}, dimension=dimension)))
    pull = [x["reaction_start"][:, 0] for x in found]
    assert np.ptp(pull[0][300:]) > 100.0
    for each in pull[1:]:
        np.testing.assert_allclose(each, pull[0], atol=1e-3 * np.ptp(pull[0]))


@pytest.mark.long
def test_soil_beside_a_line_resists_and_breaks_out() -> None:
    """A rod that is pressed in and then moved to the side: friction on its force, and API's clay on its depth."""
    travel, over, left = 0.004, 0.05, 0.4
    friction = {"axial": 0.0, "lateral": 0.5, "residual": [0.0, 0.5 * left], "breakout": over, "travel": travel}
    bed = {"soil": SOIL | {"lateral": {"unit_weight": 5000.0}}, "friction": friction}
    down = {"amplitude": 0.07, "period": 1e6, "phase": -90.0}
    found = hybrid.run(pressed(bed, 12.0, 0.01, {"heave": down, "sway": {"amplitude": 0.2, "period": 24.0}}))
    y, z = found.position[:, 3, 1], -found.position[:, 3, 2]
    force = -(found["reaction_start"][:, 1] + found["reaction_end"][:, 1])
    su = SU + RHO * z
    pu = np.minimum(3.0 * su + 5000.0 * z + 0.5 * su * z / D, 9.0 * su) * np.clip(z, 0.0, D)
    N, q, w, expected = found["contact_force"], 0.0, 0.0, []
    for k in range(y.size):
        held = (0.5 * max(N[k], 0.0) + pu[k]) * (left + (1.0 - left) * exp(-w / over))
        moved = q + (y[k] - y[k - 1] if k else 0.0)
        q = min(max(moved, -travel), travel)
        if z[k] <= 0.0:
            q = w = 0.0
        w += abs(moved - q) if z[k] > 0.0 else 0.0
        expected.append(held * q / travel)
    late = found.t > 1.5
    scale = float(np.abs(expected).max())
    print(f"{np.abs(force + expected)[late].max() / scale:.1e} of {scale:.0f} N; behind it {force[-300:].min():.0f} N")
    np.testing.assert_allclose(force[late], -np.array(expected)[late], atol=1e-2 * scale)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"cable": {"sections": [{"length": 1.0, "mass": 20.0, "bending_stiffness": 1.0}]}}, "needed for soil"),
        ({"environment": {"seabed": {"z": 0, "soil": SOIL, "stiffness": 1e4}}}, "soil says how the bed resists"),
        ({"environment": {"seabed": {"z": 0, "soil": SOIL | {"lateral": {}}}}}, "over which lateral resistance grows"),
        ({"environment": {"seabed": {"z": 0}}}, "in N/m per m"),
    ],
)
def test_what_is_refused(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        hybrid.validate_scene(pressed({"soil": SOIL}, 1.0, 0.1, {"heave": HEAVE}) | change)


# --- What nodes remember of soil goes with them where zones move, cells follow the curvature, and line is paid out
# ---

SOIL_REMESHED = {"shear_strength": 1500.0, "gradient": 1500.0}
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
        seabed={"z": 0, "soil": SOIL_REMESHED | {"lateral": {}}, "friction": FRICTION}, model=model, contact={"self": False},
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
