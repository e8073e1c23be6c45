"""Lines that a winch pays out, or takes in, over fixed obstacles: capstans, equilibria, energy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.state.report import OBSTACLE, PIECE_END, STIFFNESS, STRAND, THINNER
from hybrid.model.build import build
from hybrid.model.obstacles import obstacle_rows
from hybrid.scene.read import one_line
from tests.problems import tables_with
from tests.scenes import cable_scene, pinned_at
from tests.validation.obstacle_scenes import over_pipe, paid_over_drum

MU, ANGLE, PULL = 0.3, 2.0, 8.0


def pull(result: Any, winch: str = "end") -> Any:
    return np.linalg.norm(result[f"reaction_{winch}"], axis=1)


def kick(result: Any, y: Any) -> float:
    """The largest deviation from a parabola in time, over the mean, once the rate is steady."""
    t = np.array(result.t)
    y, t = y[t > 1.0], t[t > 1.0]
    return float(np.abs(y - np.polyval(np.polyfit(t, y, 2), t)).max() / y.mean())


# --- capstans: the winch stands clear of the drum, on it, and holds the line there ----------------

# m from the drum to the winch, clamp, rate (m/s): how far the exponent may be off.  What touches the drum at the winch
# itself presses on it, too, which is no tension.
CASES = {
    (0.3, False, 0.1): 0.003, (0.3, False, -0.1): 0.003, (0.3, True, 0.1): 0.003,
    (0.0, True, 0.1): 0.03, (0.0, True, -0.1): 0.04,
}  # fmt: skip


@pytest.fixture(scope="module", params=CASES, ids=lambda x: f"{x[0]:g} m, {'clamp' if x[1] else 'pin'}, {x[2]:g} m/s")
def paid(request: pytest.FixtureRequest) -> Any:
    clear, clamp, rate = request.param
    return hybrid.run(paid_over_drum(MU, rate, clear, clamp=clamp)), rate, CASES[request.param]


def test_pull_at_the_winch_is_that_of_a_capstan(paid: Any) -> None:
    """T_winch = T e^(-mu phi) where line is paid out, T e^(mu phi) where it is taken in.

    Friction is on the material, also where that flows past nodes that ride with the winch: without, those would stick.
    """
    result, rate, off = paid
    assert abs(result["payout/length"][-1] - result["payout/length"][0]) == pytest.approx(0.28)
    exponent = np.log(pull(result)[-1] / PULL) / (MU * ANGLE)
    assert -np.sign(rate) * exponent == pytest.approx(1.0, abs=off)


def test_a_node_that_enters_or_leaves_kicks_little(paid: Any) -> None:
    """Nine nodes, on the drum too: they have the friction that is there."""
    result, _, _ = paid
    assert 1e-5 < kick(result, pull(result)) < 4e-3


def test_the_winch_gives_what_friction_and_the_pull_take(paid: Any) -> None:
    """Work at the winch is the integral of its power but for what bends at it, and the scheme loses next to nothing."""
    result, rate, _ = paid
    rubbed, end = result["work/friction"][-1], result["work/end"][-1]
    assert rubbed < -0.9
    # What the free end does, a drum that it slides on takes, and the winch: 0.28 m against both tensions.
    by_tensions = 0.28 * PULL * abs(np.exp(-np.sign(rate) * MU * ANGLE) - 1.0)
    assert -rubbed == pytest.approx(by_tensions, rel=0.05)
    assert end == pytest.approx(float(np.trapezoid(result["payout/power"], result.t)), rel=0.015)
    assert abs(result["work/scheme"][-1]) < 1e-4 * abs(end)
    assert abs(result["work/zones"][-1]) < 2e-3 * abs(end)


def test_friction_of_what_rides_does_not_depend_on_the_mesh() -> None:
    """On the drum, clamped, where all nodes that touch near the winch ride with it."""
    found = [pull(hybrid.run(paid_over_drum(MU, 0.1, 0.1, clamp=True, h=h)))[-1] for h in (0.03, 0.015)]
    assert found[0] == pytest.approx(found[1], rel=2e-3)


def test_a_winch_holds_a_tension_between_those_at_which_the_line_slides() -> None:
    """Within e^(-mu phi) and e^(mu phi) it sticks to the drum, below it slides out; clamped, on nodes that ride, too."""
    out = {}
    for held in (7.0, 12.0, 4.0):
        scene = paid_over_drum(MU, 0.1, 0.1, clamp=True, time={"duration": 4.0, "step": 0.01})
        winch = {"tension": held, "inertia": 2.0, "damping": 1.0, "ramp": 1.5}
        scene["ends"]["end"]["payout"] = {"longest": 4.0, "winch": winch}
        out[held] = hybrid.run(scene)["payout/length"]
    assert abs(out[7.0][-1] - out[7.0][0]) < 1e-3 and abs(out[12.0][-1] - out[12.0][0]) < 1e-3
    assert out[4.0][-1] - out[4.0][0] > 0.05


@pytest.mark.parametrize(("rate", "clamp"), [(0.1, True), (-0.1, True), (0.1, False)])
def test_a_line_that_slides_on_the_bed_at_the_winch_pulls_by_its_weight(rate: float, clamp: bool) -> None:
    """T = F - mu w L where it is paid out, F + mu w L where it is taken in: behind a clamp nodes ride on the bed."""
    section = {"length": 3.0, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 2e4, "bending_stiffness": 0.02,
               "damping": {"mass": 0.2}}  # fmt: skip
    winch: dict[str, Any] = {"kind": "pinned", "position": [0, 0, 0], "payout": {"rate": rate, "ramp": 0.4}}
    if clamp:
        winch |= {"kind": "clamped", "tangent": [1, 0, 0]}
    result = hybrid.run({
        "environment": {"seabed": {"z": 0.002, "stiffness": 2e3, "friction": {"axial": 0.4, "lateral": 0.4}}},
        "cable": {"sections": [section]}, "ends": {"start": {"kind": "free", "force": [-10, 0, 0]}, "end": winch},
        "initial": {"kind": "equilibrium", "points": [[-3, 0, 0], [0, 0, 0]]}, "model": "rod", "mesh": {"cells": 60},
        "dimension": 3, "time": {"duration": 4.0, "step": 0.01}, "output": {"every": 0.1, "points": 31},
    })  # fmt: skip
    weight = 0.5 * 9.81 * result["payout/length"][-1]
    assert result.reaction_end[-1, 0] == pytest.approx(10.0 - np.sign(rate) * 0.4 * weight, rel=4e-3)
    assert abs(result["work/scheme"][-1]) < 1e-4 * abs(result["work/end"][-1])


# --- equilibria over a pipe -----------------------------------------------------------------------


def slow(length: float, model: str, rate: float = 0.0) -> dict[str, Any]:
    """A line over a pipe without friction, cells of 0.1 m, whose length changes by six seconds at `rate`, m/s."""
    scene = over_pipe(mesh={"cells": round(10 * length)}, model=model, output={"every": 0.5, "points": 61})
    pipe = scene["obstacles"]["pipe"]
    section, end = scene["cable"]["sections"][0], scene["ends"]["end"]
    pipe |= {"friction": 0.0, "axis": [0, 1, 0]}
    section |= {"length": length, "damping": {"mass": 3.0}}
    del end["motion"]
    if rate:
        end["payout"] = {"rate": rate, "ramp": 1.0, "until": 6.0}
    return scene | {"time": {"duration": 9.0, "step": 0.02}}


def rests_as(result: Any, there: dict[str, Any], off: float, of_pull: float) -> None:
    """A line that was paid out slowly is, within parts of length and pull, at rest as a scene of that length."""
    length, rest = (
        float(result["payout/length"][-1]),
        hybrid.static({x: y for x, y in there.items() if x not in ("time", "output")}),
    )
    on = np.array(result.s) <= length
    s, last = np.array(result.s)[on], result.position[-1, on]
    expected = np.stack([np.interp(s, rest.s, rest.position[0, :, k]) for k in range(3)], axis=1)
    assert np.abs(last - expected).max() < off * length  # by cells that lie elsewhere on the pipe
    assert pull(result)[-1] == pytest.approx(pull(rest)[0], rel=of_pull)
    assert abs(result["work/scheme"][-1]) < 1e-4 * abs(result["work/end"][-1])


@pytest.mark.long
@pytest.mark.parametrize(("model", "rate"), [("rod", 0.1), ("catenary", 0.1), ("rod", -0.05)])
def test_slow_payout_over_a_pipe_is_the_equilibrium_of_that_length(model: str, rate: float) -> None:
    result = hybrid.run(slow(12.0, model, rate))
    length = float(result["payout/length"][-1])
    last = result.position[-1, np.array(result.s) <= length]
    away = np.hypot(last[:, 0] - 4.0, last[:, 2] + 1.7) - 1.2 - 0.025
    assert -0.05 * 0.05 < away.min() < 1e-4 and (away < 1e-3).sum() >= 2  # it lies on the pipe
    rests_as(result, slow(length, model), 3e-4, 3e-5)


@pytest.mark.long
def test_zones_that_move_over_a_pipe_are_rods() -> None:
    """Nodes enter as rods, and what lies on the pipe is one."""
    rods = hybrid.run(slow(12.0, "rod", 0.1))
    zones = hybrid.run(slow(12.0, "rod", 0.1) | {"model": {"kind": "adaptive"}})
    assert np.abs(zones.position[-1] - rods.position[-1]).max() < 2e-3 * 12.0
    assert pull(zones)[-1] == pytest.approx(pull(rods)[-1], rel=5e-3)


# --- what comes off the reel ----------------------------------------------------------------------


@pytest.mark.parametrize("winch", ["end", "start"])
def test_a_thicker_section_from_the_reel_lies_at_its_own_radius(winch: str) -> None:
    """Without friction: the tension presses both at T/R, and the thick one holds the line further off the drum."""
    scene = paid_over_drum(0.0, 0.2, 0.05, "catenary", winch=winch, output={"every": 0.5, "points": 201},
                           time={"duration": 2.2, "step": 0.01})  # fmt: skip
    thick = scene["cable"]["sections"][0] | {"length": 2.0, "diameter": 0.03}
    scene["ends"][winch]["payout"]["reel"] = [thick]
    result = hybrid.run(scene)
    first = float(scene["cable"]["sections"][0]["length"])
    s, x = np.array(result.s), result.position[-1]
    off = np.hypot(x[:, 0], x[:, 2]) - 0.3
    on = (np.arctan2(x[:, 2], x[:, 0]) > 0.3) & (np.arctan2(x[:, 2], x[:, 0]) < 1.7)
    new = s > first + 0.04 if winch == "end" else s < -0.04
    old = s < first - 0.04 if winch == "end" else s > 0.04
    assert (on & new).sum() > 5 and (on & old).sum() > 5
    assert off[on & new].min() > 0.98 * 0.015 and off[on & new].max() < 1.02 * 0.015
    assert off[on & old].min() > 0.97 * 0.01 and off[on & old].max() < 1.05 * 0.01


def test_obstacles_are_as_hard_as_what_will_be_out_asks_for() -> None:
    """A heavy line of 12 m of which 60 m more will be out, in two sections: as if all of it were out."""
    scene = over_pipe()
    scene["ends"]["end"].pop("motion")
    section = scene["cable"]["sections"][0]
    reel = [section | {"length": 40.0}, section | {"length": 20.0, "diameter": 0.04}]
    whole = hybrid.validate_scene(tables_with(scene, {"cable.sections": [section, *reel]}))
    paid = tables_with(scene, {"ends.end.payout": {"rate": 10.0, "ramp": 0.1, "until": 6.0, "reel": reel,
                                                   "longest": 72.0}})  # fmt: skip
    (row,), (now,) = obstacle_rows(one_line(whole)), obstacle_rows(hybrid.validate_scene(scene))
    (found,) = obstacle_rows(one_line(hybrid.validate_scene(tables_with(paid, {"time.duration": 1.0}))))
    assert found[STRAND] == row[STRAND] == 0.025
    assert found[STIFFNESS] == pytest.approx(row[STIFFNESS], rel=0.2) and found[STIFFNESS] > 2.0 * now[STIFFNESS]
    pieces = found[OBSTACLE:].reshape(-1, 2)
    np.testing.assert_allclose(pieces[:3, PIECE_END], [12.0, 52.0, 72.0])
    np.testing.assert_allclose(pieces[:3, THINNER], [0.0, 0.0, 0.005])


def test_what_is_on_the_reel_needs_a_diameter() -> None:
    scene = paid_over_drum(0.0, 0.1)
    reel = {key: x for key, x in scene["cable"]["sections"][0].items() if key != "diameter"}
    scene["ends"]["end"]["payout"]["reel"] = [reel]
    with pytest.raises(SceneError, match=r"ends\.end\.payout\.reel\[0\]\.diameter"):
        build(one_line(hybrid.validate_scene(scene)))


# --- Line that is paid out from a ship: Zajac's straight line, and the example ---

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.long
def test_laid_at_the_speed_of_the_ship_a_cable_is_a_straight_line() -> None:
    """w cos a = 1/2 rho Cd d V^2 sin^2 a (Zajac 1957): the angle to 1e-3, the pull steady within 0.1 %.

    Seen from the ship it is the line of examples/laying: one that stands still in a current (`towed`).
    """
    speed, depth, length = 1.0, 40.0, 160.0
    section = {
        "length": length, "mass": 2.0, "diameter": 0.04, "axial_stiffness": 2e6, "bending_stiffness": 50.0,
        "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    ship = pinned_at(
        length - 10.6, 0, 0, motion={"velocity": [speed, 0, 0], "ramp": 20}, payout={"rate": speed, "ramp": 20}
    )
    friction = {"axial": 0.5, "lateral": 0.5}
    fluid, bed = {"density": 1025}, {"z": -depth, "stiffness": 2e3, "damping": 5e2}
    result = hybrid.run(cable_scene(
        section, pinned_at(0, 0, -depth), ship, fluid=fluid, seabed={**bed, "friction": friction}, model="rod",
        dimension=2, mesh=160, time=(420, 0.1), output=(1.0, 1201)
    ))  # fmt: skip
    w, k = (2.0 - 1025 * np.pi * 0.04**2 / 4) * 9.81, 0.5 * 1025 * 1.2 * 0.04 * speed**2
    cosine = (np.sqrt(w * w + 4 * k * k) - w) / (2 * k)
    angle = 0.5 * np.pi - result["theta"][-1]
    z = result["position"][-1, :, 2]
    between = (z > -25.0) & (z < -2.0) & (result["s"] < result["payout/length"][-1])
    assert np.abs(angle[between] / np.arccos(cosine) - 1.0).max() < 1e-3
    pull = np.linalg.norm(result["reaction_end"], axis=1)[-60:]
    assert np.ptp(pull) < 1e-3 * pull.mean()
    laid = (result["s"] > 170.0) & (result["s"] < 300.0)
    assert np.abs(result["velocity"][-1, laid]).max() < 1e-3
    towed = hybrid.static(cable_scene(
        section, "free", pinned_at(0, 0, 0), fluid={**fluid, "current": [-speed, 0, 0]}, seabed=bed, model="rod",
        dimension=2, mesh=160, output={"points": 641}
    ))  # fmt: skip
    out, back = result["payout/length"][-1], np.linspace(1.0, 100.0, 100)  # m, from the ship along the cable
    ship_now = result["position"][-1, result["s"] >= out][0]
    for k, axis in ((0, "x"), (2, "z")):
        paid = np.interp(out - back, result["s"], result["position"][-1, :, k] - ship_now[k])
        still = np.interp(length - back, towed["s"], towed["position"][-1, :, k])
        assert np.abs(paid - still)[back < 60.0].max() < 5e-4, axis  # m, above the bend
        assert np.abs(paid - still).max() < 1e-3 * depth, axis  # and at the touchdown, where cells of 1 m bend
    # what is laid runs through this shape: T - (m + added mass) c^2 stands for T
    moves = (2.0 + 1025 * np.pi * 0.04**2 / 4) * speed**2
    assert abs((pull[-1] - moves) / np.linalg.norm(towed["reaction_end"][-1]) - 1.0) < 5e-3


@pytest.mark.long
def test_a_vehicle_goes_down_on_a_tether_that_is_paid_out() -> None:
    """What the head of the example says."""
    result = hybrid.run(EXAMPLES / "rov_descent.yaml")
    assert abs(result["payout/length"][-1] - 998.0) < 1e-9
    pull = np.linalg.norm(result["reaction_end"], axis=1)
    for begin, mean in ((40, 2.26e3), (900, 3.89e3), (1000, 5.70e3)):
        assert abs(pull[begin : begin + 40].mean() / mean - 1.0) < 0.01
    assert abs(result["position"][-1, 0, 2] + 1001.8) < 1.0 and abs(result["position"][-1, 0, 0] - 42.3) < 1.0
    assert abs(result["payout/power"].min() + 6.05e3) < 100.0
