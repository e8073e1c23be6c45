"""Lines of several that are paid out or taken in: to free points and from bodies, resumed, from outside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import resumed
from test_payout import clamped, sagging
from test_payout_zones import touching

import hybrid
from hybrid.errors import SceneError
from tests.combinations.pairs import as_network, scene_of
from tests.scenes import each_line, line_between, network_scene

G = 9.81


def cable(clamp: bool = False, **more: Any) -> dict[str, Any]:
    """100 m over 80 m, in space, in a current across it, from a winch that surges."""
    scene = sagging(duration=6.0, **more)
    scene = clamped(scene) if clamp else scene
    scene["cable"]["sections"][0]["drag"] = {"normal": 1.2}
    scene["environment"] = {"fluid": {"density": 1025, "current": [0.2, 0.5, 0]}}
    return scene | {"contact": {"self": False}, "dimension": 3}


def crane(law: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """A line from a winch that heaves carries two slings with a bar between them; another line is taken in."""
    wire = [{"length": 30.0, "mass": 3.0, "diameter": 0.03, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}]
    sling = {"sections": [wire[0] | {"length": 6.0}], "mesh": {"cells": 6}}
    heave = {"heave": {"amplitude": 0.5, "period": 6.0}, "ramp": 6.0}
    law = law or {"rate": 0.8, "ramp": 2.0}
    return (
        network_scene({"tip": {"position": [0, 0, 0], "motion": heave}, "shore": {"position": [40, 5, -20]},
                       "hook": {"kind": "free", "mass": 50.0, "volume": 0.01, "initial_guess": [0, 0, -30]},
                       "left": {"body": "bar", "place": [-3, 0, 0]}, "right": {"body": "bar", "place": [3, 0, 0]}},
                      {"wire": line_between("hook", "tip", wire, mesh=24, connections={"end": {"payout": law}}),
                       "a": {"start": "left", "end": "hook", **sling}, "b": {"start": "right", "end": "hook", **sling},
                       "tug": line_between("shore", "right", wire[0] | {"length": 50.0}, mesh=25,
                                           connections={"start": {"payout": {"rate": -0.5, "ramp": 2.0}}})},
                      fluid={"density": 1025, "current": [0.3, 0.1, 0]},
                      bodies={"bar": {"mass": 400.0, "volume": 0.1, "inertia": [100, 1200, 1200],
                                      "initial_guess": [0, 0, -35.2]}},
                      time=(6.0, 0.02), output=0.25) | more
    )  # fmt: skip


def test_a_load_goes_down_as_line_is_paid_out() -> None:
    """Lengths, cells and energy of all lines."""
    scene = crane()
    for name, end in (("wire", "end"), ("tug", "start")):
        scene["lines"][name]["connections"][end]["payout"]["longest"] = 60.0
    found = hybrid.run(scene)
    wire, tug = found.lines["wire"], found.lines["tug"]
    assert wire["payout/length"][-1] == pytest.approx(30.0 + 0.8 * 5.0, abs=1e-12)
    assert tug["payout/length"][-1] == pytest.approx(50.0 - 0.5 * 5.0, abs=1e-12)
    assert tug["s"][0] == pytest.approx(-10.0) and tug["s"][-1] == pytest.approx(50.0)
    assert wire.position[-1, 0, 2] < wire.position[0, 0, 2] - 2.0
    put_in = sum(np.abs(found.lines[x][f"work/{end}"]).max() for x, end in (("wire", "end"), ("tug", "start")))
    left = sum(np.abs(x["work/scheme"]).max() for x in found.lines.values())
    assert left < 1e-3 * put_in
    coarse = hybrid.run(crane(time={"duration": 6.0, "step": 0.04}))
    assert sum(np.abs(x["work/scheme"]).max() for x in coarse.lines.values()) > 2.5 * left


def test_from_outside_lengths_are_of_the_rates_that_are_set() -> None:
    """Stepped, with the rate set for every step."""
    scene = crane({"longest": 60.0})
    rates = np.interp(np.arange(0.0, 6.3, 0.25), [0, 2, 4, 6], [0, 0.8, 0.8, 0])
    with hybrid.Simulation(scene) as sim:
        with pytest.raises(ValueError, match=r"lines\.tug\.connections\.start\.payout gives the length"):
            sim.set_payout("tug", 1.0)
        with pytest.raises(ValueError, match=r"line a has no `payout`"):
            sim.set_length("a", 7.0)
        for k in range(20):
            sim.set_payout("wire", float(rates[k + 1]))
            sim.advance(0.25 * (k + 1))
        length = sim.result().lines["wire"]["payout/length"]
    trapezoids = 30.0 + np.concatenate([[0.0], np.cumsum(0.125 * (rates[:-1] + rates[1:]))])
    np.testing.assert_allclose(length, trapezoids[: len(length)], rtol=1e-12)


def test_a_rate_that_is_refused_takes_no_other_with_it() -> None:
    """What was set of the line before it holds when the step is made at last, and only what was wrong is to be set anew."""
    scene = crane({"longest": 60.0})
    scene["lines"]["tug"]["connections"]["start"]["payout"] = {"longest": 60.0}
    with hybrid.Simulation(scene) as sim:
        sim.set_payout("wire", 0.4)
        sim.set_payout("tug", 1e3)
        with pytest.raises(ValueError, match="the length that is out would be"):
            sim.advance(0.25)
        sim.advance(0.25)
        lengths = [sim.result().lines[x]["payout/length"][-1] for x in ("wire", "tug")]
    assert lengths == pytest.approx([30.0 + 0.5 * 0.4 * 0.25, 50.0], abs=1e-9)


def frame(sign: float) -> dict[str, Any]:
    """A body that hangs from a fixed point has a winch, from which 500 kg hang."""
    wire = {"mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e9}
    own = {"model": "catenary", "contact": {"self": False}}
    law = {"lengths": [[0, 30], [4, 30 + 3 * sign], [8, 30 + 6 * sign]]}
    return network_scene(
        {"top": {"position": [0, 0, 0]}, "eye": {"body": "frame", "place": [0, 0, 1.0]},
         "winch": {"body": "frame", "place": [0, 0, -1.0]},
         "load": {"kind": "free", "mass": 500.0, "initial_guess": [0, 0, -52]}},
        {"up": (line_between("eye", "top", wire | {"length": 20.0}, mesh=10) | own),
         "down": (line_between("load", "winch", wire | {"length": 30.0}, mesh=20,
                               connections={"end": {"payout": law}}) | own)},
        bodies={"frame": {"mass": 1000.0, "inertia": [100, 100, 100], "initial_guess": [0, 0, -21]}}, time=(8.0, 0.02),
        output=0.02
    )  # fmt: skip


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_winch_on_a_free_body_weighs_what_hangs_there_less_its_inertia(sign: float) -> None:
    """The pull is (M + m L)(g - dc/dt), and the body hands it on: beside the first and last steps to 2e-5."""
    found = hybrid.run(frame(sign))
    up, down = found.lines["up"], found.lines["down"]
    length, rate = down["payout/length"], down["payout/rate"]
    pull = (500.0 + 2.0 * length) * (G - np.gradient(rate, found.t))
    for force, exact in ((down["reaction_end"], pull), (up["reaction_start"], 1000.0 * G + pull)):
        off = np.abs(np.linalg.norm(force, axis=1) / exact - 1.0)
        assert np.median(off) < 2e-5  # half a cell, without the inertia of what passes: 1e-4
    assert np.abs(down["work/scheme"]).max() < 1e-5 * np.abs(down["work/end"]).max()


# --- with errors, and what is refused ---------------------------------------------------------------


def test_what_is_wrong_is_said_of_the_line() -> None:
    at = "lines.cable.connections.end.payout"
    held, free = as_network(cable()), as_network(scene_of("body"))
    held["lines"]["cable"]["connections"]["end"]["payout"]["longest"] = 90.0
    free["lines"]["cable"]["connections"] = {"end": {"payout": {"rate": 1.0, "ramp": 1.0}}}
    for scene, where in ((held, f"{at}.longest"), (free, at)):
        with pytest.raises(SceneError) as refused:
            hybrid.plan(scene)
        assert where in str(refused.value)


# --- zones that move ---

Tables = dict[str, Any]


def to_a_buoy(rate: float = 0.8) -> Tables:
    """The line from a winch that heaves to a buoy, which another line with zones that move holds."""
    scene = as_network(touching(rate))
    line = scene["lines"]["cable"]
    section = line["sections"][0]
    scene["environment"]["fluid"] = {"density": 1025, "current": [0.1, 0.2, 0]}
    scene["points"]["start"] = {"kind": "free", "initial_guess": [0, 0, -3], "mass": 50, "volume": 0.6}
    scene["points"]["ground"] = {"position": [-60, 0, -18]}
    scene["lines"]["stay"] = line_between("ground", "start", section | {"length": 64.0}, model=line["model"], mesh=26)
    return scene


def test_beside_a_buoy_they_move_as_rods() -> None:
    found, like = hybrid.run(to_a_buoy()), hybrid.run(each_line(to_a_buoy(), model="rod"))
    assert all(any(z.kind == "catenary" for z in x.zones[-1]) for x in found.lines.values())
    assert found.lines["cable"]["payout/length"][-1] > 104.0
    for name, line in like.lines.items():
        assert np.abs(found.lines[name].position - line.position).max() < 2e-3 * 100.0
        pulls = [np.linalg.norm(x["reaction_end"], axis=1) for x in (found.lines[name], line)]
        assert np.abs(pulls[0] - pulls[1]).max() < 0.02 * pulls[1].mean()


@pytest.mark.long
def test_loads_that_change_on_the_way(tmp_path: Path) -> None:
    """Another current from the middle on, as with rods."""
    pulls = []
    for k, scene in enumerate((to_a_buoy(), each_line(to_a_buoy(), model="rod"))):
        path = tmp_path / f"{k}.h5"
        hybrid.run(scene | {"time": {"duration": 4.0, "step": 0.05}}, output=path)
        found = hybrid.resume(path, until=8.0, settings=["environment.fluid.current=[0.1, 0.6, 0]"])
        pulls.append(np.linalg.norm(found.lines["cable"]["reaction_end"], axis=1))
    assert np.abs(pulls[0] - pulls[1]).max() < 0.02 * pulls[1].mean()


# --- at a body, by either end of the line ---------------------------------------------------------


def frame_goes_down(winch: str) -> dict[str, Any]:
    """A frame with a winch lets itself down from the air into the water."""
    section = {
        "length": 10,
        "mass": 10,
        "diameter": 0.1,
        "axial_stiffness": 1e6,
        "drag": {"normal": 1.5, "tangential": 0.3},
    }
    ends = ("top", "frame") if winch == "end" else ("frame", "top")
    law = {winch: {"payout": {"rate": 2.0, "ramp": 3}}}
    return network_scene(
        {"top": {"position": [0, 0, 12]}, "frame": {"body": "frame", "place": [0, 0, 0]}},
        {"line": line_between(*ends, section, mesh=10, model="catenary", connections=law)},
        bodies={"frame": {"initial_guess": [0, 0, 2], "mass": 100, "inertia": [50, 50, 50]}},
        fluid={"density": 1025, "surface": 0}, time=(8, 0.02), output=(1, 11)
    )  # fmt: skip


def test_a_winch_that_goes_down_is_in_the_water_at_either_end() -> None:
    """At the end of the line its water was that of where it was at t = 0."""
    one, other = (hybrid.run(frame_goes_down(x)).lines["line"] for x in ("end", "start"))
    np.testing.assert_allclose(one["reaction_end"], other["reaction_start"], rtol=1e-9, atol=1e-6)
    assert one["reaction_end"][-1, 2] == pytest.approx(-981.0, rel=5e-3)


@pytest.mark.parametrize("winch", ["end", "start"])
def test_a_run_with_winches_on_a_body_goes_on_to_the_bit(winch: str, tmp_path: Path) -> None:
    """Works and events, too; forces of nodes that ride are taken back to the last bit."""
    section = {"length": 66, "mass": 8, "diameter": 0.08, "axial_stiffness": 2e6, "bending_stiffness": 400,
               "drag": {"normal": 1.2, "tangential": 0.3}}  # fmt: skip
    points, lines = dict[str, Any](), {}
    for k, way in enumerate(([1.0, 0.0], [-0.5, 0.866], [-0.5, -0.866])):
        points |= {f"a{k}": {"position": [60 * way[0], 60 * way[1], -39]}}
        points |= {f"f{k}": {"body": "spar", "place": [3 * way[0], 3 * way[1], -4]}}
        ends = (f"a{k}", f"f{k}") if winch == "end" else (f"f{k}", f"a{k}")
        law = {winch: {"payout": {"rate": 2.0 * k, "ramp": 0.5, "longest": 90}}}
        lines[f"l{k}"] = line_between(*ends, section, mesh=30, model="rod", connections=law)
    spar = {"initial_guess": [0, 0, 0], "mass": 4e4, "inertia": [1e6, 1e6, 3e5], "damping": [2e3] * 3 + [1e5] * 3}
    spar |= {"hydrostatics": {"heave": 8e4, "roll": 6e5, "pitch": 6e5}, "added_mass": [3e4] * 3 + [1e6] * 3}
    scene = network_scene(
        points, lines, bodies={"spar": spar}, fluid={"density": 1025, "surface": 0, "current": [0.6, 0.1, 0]},
        seabed={"z": -40, "stiffness": 2e4}, contact={"between": []}, time=(1.0, 0.05), output=(0.25, 7)
    )  # fmt: skip
    resumed(scene, tmp_path, 0.5)


def over_a_ball(winch: str) -> dict[str, Any]:
    """A line from a winch at the top of a ball that hangs in springs, to a point beside it."""
    section = {"length": 6.4, "mass": 2.0, "diameter": 0.05, "axial_stiffness": 1e5, "bending_stiffness": 2.0,
               "torsional_stiffness": 2.0, "damping": {"mass": 3.0}}  # fmt: skip
    ends = ("far", "top") if winch == "end" else ("top", "far")
    law = {winch: {"payout": {"rate": 0.5, "ramp": 1, "until": 2.6}}}
    held = {"initial_guess": [0, 0, 0], "mass": 2e4, "inertia": [4e4] * 3, "damping": [1e4] * 6}
    held |= {"hydrostatics": {"heave": 1e6, "roll": 1e6, "pitch": 1e6}, "shape": {"kind": "sphere", "radius": 2.0}}
    points: dict[str, Any] = {"top": {"body": "ball", "place": [0, 0, 2.03]}, "far": {"position": [-6, 0, 2.2]}}
    lines = {"line": line_between(*ends, section, mesh=64, model="rod", connections=law, contact={"self": False})}
    for name, x, y in (("a", 1, 0), ("b", -1, 1), ("c", -1, -1)):
        points |= {name: {"body": "ball", "place": [2.5 * x, y, 0]}, f"far_{name}": {"position": [30 * x, 10 * y, 0]}}
        stay = {"length": 0.999 * np.hypot(27.5, 9 * y), "mass": 0.5, "diameter": 0.01, "axial_stiffness": 1e6}
        lines[name] = line_between(f"far_{name}", name, stay, model="catenary", mesh=4)
    return network_scene(
        points, lines, bodies={"ball": held}, fluid={"density": 1.2}, contact={"between": []}, time=(8, 0.02),
        output=(8, 31)
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("winch", ["end", "start"])
def test_what_is_paid_out_at_a_body_lies_on_it(winch: str) -> None:
    """It passed through the body, as what is within the way out of it."""
    found = hybrid.run(over_a_ball(winch))
    apart = np.linalg.norm(found.lines["line"].position[-1] - found["bodies/ball/position"][-1], axis=1)
    assert apart.min() > 2.0
