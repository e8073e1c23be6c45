"""A winch that holds a tension, against closed forms; its limit, the end of its reel, resume and refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybrid
from hybrid.errors import ComputationError, Outcome, SceneError
from tests.combinations.pairs import as_network
from tests.scenes import cable_scene, line_between, network_scene, pinned_at
from tests.validation.obstacle_scenes import CENTRELINE
from tests.validation.test_validation_moving_obstacles import weights

G = 9.81


def vertical(
    step: float = 0.05, duration: float = 10.0, bob: float = 0.0, m: float = 2.0, **winch: Any
) -> dict[str, Any]:
    """40 m of a line that hangs from a winch, with a bob at its lower end."""
    held = {"tension": 600.0, "inertia": 100.0, **winch}
    end = {"kind": "pinned", "position": [0, 0, 0], "payout": {"longest": 90.0, "winch": held}}
    start: dict[str, Any] = {"kind": "body", "mass": bob, "volume": 0.0} if bob else {"kind": "free"}
    return cable_scene(
        {"length": 40.0, "mass": m}, start, end, model="catenary", mesh=20, time=(duration, step), output=0.5
    )


def sagging(model: str = "rod", duration: float = 20.0, step: float = 0.05) -> dict[str, Any]:
    """100 m over 80 m; the ship surges by 1 m in 7 s, and its winch holds 3 kN."""
    section = {"length": 100.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 2e6, "bending_stiffness": 2e4}
    end = {
        "kind": "pinned", "position": [80, 0, 0], "motion": {"surge": {"amplitude": 1.0, "period": 7.0}, "ramp": 7.0},
        "payout": {"longest": 150, "winch": {"tension": 3000.0, "inertia": 200.0, "damping": 100.0}},
    }  # fmt: skip
    return cable_scene(section, pinned_at(0, 0, 0), end, model=model, mesh=40, time=(duration, step), output=0.5)


def clamped(scene: dict[str, Any], tangent: list[float]) -> dict[str, Any]:
    """The same line as a rod, which leaves its winch along a direction."""
    for section in scene["cable"]["sections"]:
        section.setdefault("bending_stiffness", 100.0)
        section.setdefault("diameter", 0.03)
    scene["ends"]["end"] |= {"kind": "clamped", "tangent": tangent}
    return scene | {"model": "rod"}


def blend(t: float, first: float, then: float, begin: float, ramp: float) -> float:
    x = min(max((t - begin) / ramp, 0.0), 1.0)
    return first + x**3 * (10.0 - 15.0 * x + 6.0 * x * x) * (then - first)


@pytest.mark.parametrize("dimension", [None, 3])
def test_a_light_line_with_a_bob_answers_as_a_mass_does(dimension: int | None) -> None:
    """(I + M) dc/dt = M g - T(t), whose integral is a polynomial: order 2, through cells that enter and leave."""
    errors = []
    for step in (0.1, 0.05):
        scene = vertical(step, 12.0, bob=80.0, m=1e-6, ramp=4.0, begin=2.0, tension=700.0)
        result = hybrid.run(scene | ({"dimension": dimension} if dimension else {}))
        x = np.clip((result.t - 2.0) / 4.0, 0.0, 1.0)
        late = np.maximum(result.t - 6.0, 0.0)
        slope = (80.0 * G - 700.0) / 180.0
        rate = slope * (4.0 * (2.5 * x**4 - 3.0 * x**5 + x**6) + late)
        length = 40.0 + slope * (16.0 * (0.5 * x**5 - 0.5 * x**6 + x**7 / 7.0) + 4.0 * 0.5 * late + 0.5 * late**2)
        errors.append([np.abs(result["payout/rate"] - rate).max(), np.abs(result["payout/length"] - length).max()])
        assert np.ptp(result["payout/length"]) > 6.0
        assert (result["payout/rate"][result.t <= 2.0] == 0.0).all()
        steady = result.t > 7.0
        pull = 80.0 * (G - slope)
        assert np.abs(result["reaction_end"][steady, 2] / pull - 1.0).max() < 1e-5
    first, second = np.array(errors)
    assert (second < [1e-4, 5e-4]).all()
    assert (first > 3.3 * second).all()


@pytest.mark.parametrize("clamp", [False, True])
def test_a_heavy_line_that_runs_out(clamp: bool) -> None:
    """(I + m L) d2L/dt2 + d dL/dt = m g L - T(t) by another integrator; the pull is m L (g - d2L/dt2)."""

    def law(t: float, y: np.ndarray) -> list[float]:
        pull = blend(t, 80.0 * G, 600.0, 0.0, 5.0)
        return [y[1], (2.0 * G * y[0] - pull - 50.0 * y[1]) / (100.0 + 2.0 * y[0])]

    errors = []
    for step in (0.1, 0.05):
        scene = vertical(step, damping=50.0)
        result = hybrid.run(clamped(scene, [0, 0, 1]) if clamp else scene)
        exact = solve_ivp(law, (0.0, 10.0), [40.0, 0.0], rtol=1e-10, atol=1e-12, t_eval=result.t).y
        errors.append(np.abs(result["payout/length"] - exact[0]).max())
        pull = 2.0 * exact[0] * (G - np.array([law(t, y)[1] for t, y in zip(result.t, exact.T, strict=True)]))
        assert np.abs(result["reaction_end"][:, 2] / pull - 1.0).max() < 5e-2 * step
    assert errors[1] < 1.7e-3
    assert errors[0] > 3.7 * errors[1]


@pytest.mark.parametrize("model", ["catenary", "rod", "clamped"])
def test_at_rest_the_pull_is_the_tension_that_is_held(model: str) -> None:
    scene = sagging("rod" if model == "clamped" else model, 300.0, 0.1)
    scene = clamped(scene, [1.0, 0.0, 0.5]) if model == "clamped" else scene
    del scene["ends"]["end"]["motion"]
    scene["ends"]["end"]["payout"]["winch"]["damping"] = 300.0
    scene["cable"]["sections"][0]["damping"] = {"mass": 0.4}
    result = hybrid.run(scene)
    assert np.linalg.norm(result["reaction_end"][-1]) == pytest.approx(3000.0, rel=1e-5)
    assert abs(result["payout/length"][-1] - 100.0) > 1.0


def test_the_rate_is_limited() -> None:
    """1 % above it with half the tension held, and not before."""
    result = hybrid.run(vertical(duration=20.0, max_rate=1.0))
    rate, length = result["payout/rate"][-1], result["payout/length"][-1]
    assert 1.0 < rate < 1.015
    force = 2.0 * G * length - 600.0
    assert 600.0 * 100.0 * (rate - 1.005) == pytest.approx(force, rel=0.02)


def test_a_winch_keeps_the_pull_where_a_locked_one_does_not() -> None:
    moving = sagging(duration=35.0)
    held = hybrid.run(moving)
    moving["ends"]["end"]["payout"] = {"rate": 0.0}
    locked = hybrid.run(moving)
    late = held.t > 14.0
    one, other = (np.ptp(np.linalg.norm(x["reaction_end"], axis=1)[late]) for x in (held, locked))
    assert one < 0.4 * other


def test_the_end_of_the_reel_stops_the_run() -> None:
    with pytest.raises(ComputationError, match="no more line") as found:
        hybrid.run(vertical(duration=60.0))
    assert found.value.outcome == Outcome.WINCH_AT_END
    found.value.snapshot.unlink()
    with pytest.raises(ComputationError, match="none to take in") as found:
        hybrid.run(vertical(duration=60.0, tension=2000.0))
    found.value.snapshot.unlink()


@pytest.mark.parametrize(
    ("payout", "where"),
    [
        ({"winch": {"tension": 600.0, "inertia": 100.0}}, "payout.longest"),
        ({"winch": {"tension": 600.0}, "longest": 60}, "winch.inertia"),
        ({"winch": {"tension": -1.0, "inertia": 100.0}, "longest": 60}, "winch.tension"),
        ({"winch": {"tension": 600.0, "inertia": 1.0, "max_rate": 0.0}, "longest": 60}, "winch.max_rate"),
        ({"winch": {"tension": 600.0, "inertia": 1.0, "speed": 1.0}, "longest": 60}, "winch.speed"),
        ({"winch": {"tension": 600.0, "inertia": 1.0}, "longest": 60, "rate": 1.0, "ramp": 1.0}, "payout.winch"),
    ],
)
def test_a_winch_that_cannot_be_is_refused(payout: dict[str, Any], where: str) -> None:
    scene = vertical()
    scene["ends"]["end"]["payout"] = payout
    with pytest.raises(SceneError) as found:
        hybrid.run(scene)
    assert where in str(found.value)


# --- Winches that hold a tension, of lines with an end that moves by what pulls there: closed forms, and the cable
# ---

Tables = dict[str, Any]
STEP = 0.02
LINE = {
    "length": 60.0, "mass": 0.4, "diameter": 0.02, "axial_stiffness": 2e5, "bending_stiffness": 5.0,
    "torsional_stiffness": 4.0, "drag": {"normal": 1.2},
}  # fmt: skip
WINCH = {"longest": 80.0, "winch": {"tension": 150.0, "inertia": 20.0, "damping": 20.0, "ramp": 3.0}}
MOVES = {"heave": {"amplitude": 1.0, "period": 8.0}, "surge": {"amplitude": 1.0, "period": 6.0}, "ramp": 8.0}


def lowered(winch_first: bool = True, model: str = "catenary", clamp: bool = False) -> Tables:
    """A load in a current hangs on a line, whose winch heaves and surges; the winch is at its start or its end."""
    held = {"kind": "clamped", "tangent": [0, 0, -1 if winch_first else 1]} if clamp else {}
    a, b = ("start", "end") if winch_first else ("end", "start")
    line = {a: "top", b: "load", "model": model, "mesh": {"cells": 30}, "sections": [LINE]}
    return network_scene(
        {"top": {"position": [0, 0, 0], "motion": MOVES},
         "load": {"kind": "free", "mass": 10.0, "initial_guess": [5, 0, -59]}},
        {"one": line | {"connections": {a: held | {"payout": WINCH}}}}, fluid={"density": 1025, "current": [0.3, 0, 0]},
        time=(10.0, STEP), output=0.5
    )  # fmt: skip


def floating(*anchors: float, M: float = 40.0, lift: float = 1000.0) -> Tables:
    """A body that is lifted has a winch for each weightless line to an anchor at x; they hold as much as keeps it down."""
    hold = {"tension": (lift - M * G - 100.0) / len(anchors), "inertia": 30.0, "damping": 15.0, "ramp": 4.0}
    line = {"length": 50.0, "mass": 1e-6, "axial_stiffness": 1e8}
    payout = {"connections": {"start": {"payout": {"longest": 90.0, "winch": hold}}}}
    return network_scene(
        {"eye": {"body": "frame", "place": [0, 0, -0.5]},
         **{f"anchor {k}": {"position": [x, 0, -50.5]} for k, x in enumerate(anchors)}},
        {f"line {k}": payout | line_between("eye", f"anchor {k}", line, model="catenary", mesh=10,
             contact={"self": False}) for k in range(len(anchors))},
        bodies={"frame": {"mass": M, "inertia": [9, 9, 9], "initial_guess": [0, 0, 0], "force": [0, 0, lift]}},
        time=(10.0, STEP), output=0.5
    )  # fmt: skip


@pytest.mark.parametrize("anchors", [[0.0], [0.0, 0.0]], ids=["one winch", "two winches"])
def test_a_body_that_its_own_winches_let_rise(anchors: list[float]) -> None:
    """(M + n I) z'' + n B z' = F - M g - n T(t), by another integrator; and the pull of each line is I z'' + B z' + T."""
    scene, n = floating(*anchors), len(anchors)
    found = hybrid.run(scene)
    hold = scene["lines"]["line 0"]["connections"]["start"]["payout"]["winch"]
    first = (1000.0 - 40.0 * G) / n

    def held(t: float) -> float:
        return blend(t, first, hold["tension"], 0.0, 4.0)

    def law(t: float, y: np.ndarray) -> list[float]:
        return [y[1], (n * (first - held(t)) - 15.0 * n * y[1]) / (40.0 + 30.0 * n)]

    exact = solve_ivp(law, (0.0, 10.0), [0.0, 0.0], rtol=1e-10, atol=1e-12, t_eval=found.t).y
    assert exact[0, -1] > 5.0
    grown = found["bodies/frame/position"][:, 2] - found["bodies/frame/position"][0, 2]
    assert np.abs(grown - exact[0]).max() < 2e-4 * exact[0, -1]
    for line in found.lines.values():
        assert np.abs(line["payout/length"] - line["payout/length"][0] - exact[0]).max() < 2e-4 * exact[0, -1]
        pull = 30.0 * np.array([law(t, y)[1] for t, y in zip(found.t, exact.T, strict=True)]) + 15.0 * exact[1]
        pull += [held(t) for t in found.t]
        assert np.abs(np.linalg.norm(line["reaction_start"], axis=1) / pull - 1.0).max() < 1e-3


@pytest.mark.parametrize(
    ("model", "clamp"), [("catenary", False), ("rod", False), ("rod", True), ("adaptive", False)],
    ids=["catenary", "rod", "clamp", "zones"],
)  # fmt: skip
def test_lines_with_their_ends_exchanged(model: str, clamp: bool) -> None:
    one, other = (hybrid.run(lowered(x, model, clamp)).lines["one"] for x in (True, False))
    assert np.ptp(one["payout/length"]) > 1.0
    # A catenary alone has the winch of one cable, whose own length differs as much: 1.2e-7 of it.
    assert np.abs(one["payout/length"] - other["payout/length"]).max() < (
        1e-5 if model == "catenary" and not clamp else 1e-7
    )
    assert np.abs(one.position - other.position[:, ::-1]).max() < (1e-5 if model == "catenary" and not clamp else 1e-6)


def test_energy_is_balanced_to_second_order() -> None:
    left, put_in = [], 0.0
    for step in (0.04, 0.02):
        line = hybrid.run(lowered() | {"time": {"duration": 10.0, "step": step}}).lines["one"]
        left.append(np.abs(line["work/scheme"]).max())
        put_in = np.abs(line["work/start"]).max()
    assert left[1] < 1.5e-4 * put_in
    assert left[0] > 3.0 * left[1]


def over_a_sheave(inertia: float) -> Tables:
    """A rope over a sheave that turns, with 1 kg at one end, from a winch below the other one."""
    tables = weights(inertia)
    points = tables["initial"]["points"]
    hold = {"longest": 8.0, "winch": {"tension": 7.0, "inertia": 0.5, "begin": 1.0, "ramp": 0.2}}
    tables["ends"] = {
        "start": {"kind": "pinned", "position": points[0], "payout": hold},
        "end": {"kind": "free", "force": {"history": [[0, 0, 0, 0], [0.2, 0, 0, -10]]}},
    }  # fmt: skip
    tables["mesh"], tables["time"] = {"cells": 120}, {"duration": 1.6, "step": 0.002}
    return tables


@pytest.mark.long
@pytest.mark.parametrize("inertia", [0.01, 0.1])
def test_a_winch_lets_a_rope_run_over_a_sheave(inertia: float) -> None:
    """(m L + J/rho^2 + I) L'' = F - T(t) by another integrator; winch and sheave stand beside each other in Newton's method."""
    tables = over_a_sheave(inertia)
    scene = as_network(tables)
    found = hybrid.run(scene)
    line, late = found.lines["cable"], found.t > 1.2

    def law(t: float, y: np.ndarray) -> list[float]:
        return [y[1], (10.0 - blend(t, 10.0, 7.0, 1.0, 0.2)) / (0.1 * y[0] + inertia / CENTRELINE**2 + 0.5)]

    begin = [float(line["payout/length"][0]), 0.0]
    exact = solve_ivp(law, (1.0, 1.6), begin, rtol=1e-10, t_eval=found.t[late]).y
    assert np.abs(line["payout/rate"][late] - exact[1]).max() < 5e-3 * exact[1, -1]
    assert np.abs(line["payout/length"][late] - exact[0]).max() < 5e-3 * (exact[0, -1] - begin[0])


@pytest.mark.long
def test_an_accuracy_that_is_asked_holds() -> None:
    """Positions lie within their stated error of those of short fixed steps on twice the cells."""
    fine = lowered() | {"time": {"duration": 4.0, "step": 0.005}}
    fine["lines"]["one"]["mesh"] = {"cells": 60}
    true = hybrid.run(fine).lines["one"]
    asked = hybrid.run(lowered() | {"time": {"duration": 4.0}, "accuracy": "5%"})
    line, stated = asked.lines["one"], float(asked.attributes["error_total_position"])
    assert np.array_equal(line.times, true.times) and np.ptp(true["payout/length"]) > 0.2
    off = np.linalg.norm(line.position - true.position, axis=-1).max()
    assert 0.05 * stated < off < stated
    assert not [x for x in asked.events if x.kind == "accuracy missed"]


def pressed(friction: float, winch_first: bool = True, step: float = 0.01) -> Tables:
    """A winch hauls in a load, on a rope that it has moved against a bar of another line."""
    a, b = ("start", "end") if winch_first else ("end", "start")
    hold = {"tension": 70.0, "inertia": 5.0, "damping": 60.0, "begin": 0.5, "ramp": 0.5}
    rope = {"length": 2.0, "mass": 0.05, "diameter": 0.02, "axial_stiffness": 1e5}
    bar = {"length": 1.99, "mass": 20.0, "diameter": 0.1, "axial_stiffness": 2e7, "damping": {"mass": 5.0}}
    surge = {"surge": {"amplitude": 0.6, "period": 8.0}, "ramp": 0.5}
    return network_scene(
        {"winch": {"position": [0, 0, 0], "motion": surge}, "left": {"position": [0.08, -1, -0.8]},
         "right": {"position": [0.08, 1, -0.8]}, "load": {"kind": "free", "mass": 5.0, "initial_guess": [0, 0, -2]}},
        {"rope": {a: "winch", b: "load", "model": "catenary", "mesh": {"cells": 60}, "sections": [rope],
                  "connections": {a: {"payout": {"longest": 4.0, "winch": hold}}}},
         "bar": line_between("left", "right", bar, model="catenary", mesh=20)},
        contact={"friction": friction}, time=(2.5, step), output=(0.1, 81)
    )  # fmt: skip


def held_by_friction(found: hybrid.Result) -> tuple[float, float]:
    """ln(T1/T2) over the angle by which the rope turns at the bar, and that angle, rad, at 2 s.

    T1, T2: tensions of both ends, less the weight of the rope between each and the bar.
    """
    rope, weight, height = found.lines["rope"], 0.05 * G, -0.8
    x = rope.position[20]
    upper, lower = (
        x[0] - x[np.linalg.norm(x - x[0], axis=1) > 0.3][0],
        x[np.linalg.norm(x - x[-1], axis=1) > 0.3][-1] - x[-1],
    )
    angle = np.arccos(upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower))
    T = rope.tension[20, 0] - weight * (x[0, 2] - height), rope.tension[20, -1] + weight * (height - x[-1, 2])
    return float(np.log(T[0] / T[1]) / angle), float(angle)


@pytest.mark.long
def test_a_rope_that_another_line_holds_by_friction() -> None:
    """Without friction the load feels the winch; with it less, and what slides takes energy.

    It acts on the surface of the bar, of 5 cm, and not on the axis of the rope, 6 cm from that of the bar: e^(5/6 mu theta).
    """
    ratios, hauled = {}, {}
    for friction in (0.0, 0.3):
        found = hybrid.run(pressed(friction))
        rope, bar = found.lines["rope"], found.lines["bar"]
        ratios[friction], angle = held_by_friction(found)
        hauled[friction] = 2.0 - rope["payout/length"][-1]
        assert angle > 0.6 and found["contacts/rope/bar/contact_force"][20] > 25.0
        work = {name: rope[name][-1] + bar[name][-1] for name in rope.names if name.startswith("work/")}
        assert abs(work["work/scheme"]) < 5e-4 * work["work/start"]
        assert (work["work/friction"] < -2.0) == (friction > 0.0) and work["work/friction"] < 1e-3
    assert abs(ratios[0.0]) < 0.03 and ratios[0.3] == pytest.approx(0.3 * 5 / 6, abs=0.02)
    assert 0.3 < hauled[0.3] < 0.8 * hauled[0.0]


def zones_that_touch(diameter: float) -> Tables:
    """`pressed`, with zones that move in both lines, 12 cm of diameters; the bar is clamped, else it would turn."""
    scene = pressed(0.3)
    for name, width, stiffness in (("rope", 0.12 - diameter, 1e-2), ("bar", diameter, 200.0)):
        line = scene["lines"][name]
        more = {"diameter": width, "bending_stiffness": stiffness, "torsional_stiffness": stiffness}
        line["sections"] = [line["sections"][0] | more]
        line["model"] = {"kind": "adaptive", "always_move": True}
    clamp = {"kind": "clamped", "tangent": [0, 1, 0]}
    scene["lines"]["bar"]["connections"] = {"start": clamp, "end": clamp}
    return scene


@pytest.mark.long
@pytest.mark.parametrize("diameter", [0.1, 0.11])
def test_friction_acts_where_surfaces_of_zones_that_move_touch(diameter: float) -> None:
    """e^(mu theta R/(R + r)) of a bar of R and a rope of r: R + r = 6 cm from axis to axis in both."""
    found = hybrid.run(zones_that_touch(diameter))
    rope, bar = found.lines["rope"], found.lines["bar"]
    for line in (rope, bar):  # they have become rods where they touch
        assert any(event.kind in ("grow", "split") and event.criterion == "contact" for event in line.events)
        assert {zone.kind for zone in line.zones[20]} == {"rod", "catenary"}
    ratio, angle = held_by_friction(found)
    assert angle > 0.6 and ratio == pytest.approx(0.3 * diameter / 0.12, abs=0.01)
    work = {name: rope[name][-1] + bar[name][-1] for name in ("work/scheme", "work/start", "work/friction")}
    assert abs(work["work/scheme"]) < 5e-4 * work["work/start"] and work["work/friction"] < -2.0


@pytest.mark.long
def test_a_rope_under_friction_with_its_ends_exchanged() -> None:
    one, other = (hybrid.run(pressed(0.3, first)).lines["rope"] for first in (True, False))
    assert np.abs(one["payout/length"] - other["payout/length"]).max() < 1e-6
    assert np.abs(one.position - other.position[:, ::-1]).max() < 1e-5


def let_go(payout, thrust, until, mass=1e-6, duration=4.0, step=0.1, every=0.5):
    """80 kg on 40 m of line from a winch at its end, under a thrust (N) down that ends at a time (s)."""
    body = {"kind": "body", "mass": 80.0, "volume": 0.0, "thrust": {"value": [0, 0, -thrust], "until": until}}
    winch = pinned_at(0, 0, 0, payout=payout)
    section = {"length": 40.0, "mass": mass}
    return cable_scene(section, body, winch, model="catenary", mesh=20, time=(duration, step), output={"every": every})


@pytest.mark.parametrize("step", [0.1, 0.05])
def test_a_winch_goes_on_with_the_pull_behind_a_jump_of_load(step):
    """(I + M) dc/dt = M g - T from when the thrust ends on."""
    winch = {"tension": 80.0 * 9.81 + 200.0, "inertia": 100.0, "ramp": 1.0}
    result = hybrid.run(let_go({"longest": 90.0, "winch": winch}, 200.0, 3.0, duration=6.0, step=step))
    late = np.maximum(result.t - 3.0, 0.0)
    assert np.abs(result["payout/rate"] + 200.0 / 180.0 * late).max() < 1e-4
    assert np.abs(result["payout/length"] - 40.0 + 100.0 / 180.0 * late**2).max() < 5e-4


def test_a_run_that_is_resumed_where_a_load_jumps_is_the_same(tmp_path):
    payout = {"longest": 120.0, "winch": {"tension": 80.0 * 9.81, "inertia": 100.0, "ramp": 1.0}}
    hybrid.run(let_go(payout, 600.0, 3.0, duration=3.0), output=tmp_path / "part.h5")
    one, other = hybrid.run(let_go(payout, 600.0, 3.0)), hybrid.resume(tmp_path / "part.h5", until=4.0)
    assert np.abs(one["payout/rate"] - other["payout/rate"]).max() < 1e-9


@pytest.mark.parametrize(
    "payout",
    [{"longest": 120.0, "winch": {"tension": 2746.8, "inertia": 100.0, "ramp": 1.0}}, {"rate": 2.0, "ramp": 1.0}],
)
def test_a_node_that_enters_behind_a_jump_of_load_leaves_the_pull_at_the_winch(payout):
    found = hybrid.run(let_go(payout, 600.0, 2.0, mass=5.0, every=0.1))
    assert np.linalg.norm(found["reaction_end"], axis=1).min() > 2000.0
