"""Lines of several that are paid out or taken in: as one cable, to free points and from bodies, resumed, from outside."""

from __future__ import annotations

from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_payout import clamped, sagging

import hybrid
from hybrid.errors import ComputationError, Outcome, SceneError

G = 9.81
ROPE = {"dynamic_stiffness": {"constant": 4e6, "per_tension": 10.0, "relaxation_time": 4.0}}
TABLE = {"moment_curvature": [[0, 0], [0.004, 80.0], [0.012, 120.0], [0.05, 1500.0]], "bending_stiffness": None}
WINCH = {"winch": {"tension": 2200.0, "inertia": 200.0, "damping": 100.0, "ramp": 4.0}, "longest": 130.0}


def cable(section: dict[str, Any] | None = None, clamp: bool = False, **more: Any) -> dict[str, Any]:
    """100 m over 80 m, in space, in a current across it, from a winch that surges."""
    scene = sagging(duration=6.0, **more)
    scene = clamped(scene) if clamp else scene
    own = scene["cable"]["sections"][0]
    own |= {"drag": {"normal": 1.2}} | (section or {})
    scene["cable"]["sections"] = [{key: x for key, x in own.items() if x is not None}]
    scene["environment"] = {"fluid": {"density": 1025, "current": [0.2, 0.5, 0]}}
    return scene | {"contact": {"self": False}, "dimension": 3}


def as_system(scene: dict[str, Any]) -> dict[str, Any]:
    """The cable as the line `one` from point a to point b."""
    found = deepcopy(scene)
    ends, line = found.pop("ends"), found.pop("cable")
    line |= {key: found.pop(key) for key in ("model", "mesh", "contact")} | {
        "start": "a",
        "end": "b",
        "connections": {},
    }
    found.pop("dimension"), found.pop("initial")
    points = {}
    for name, (key, end) in zip("ab", ends.items(), strict=True):
        kind = end.pop("kind")
        held = {x: end.pop(x) for x in ("tangent", "payout") if x in end}
        if held:
            line["connections"][key] = {"kind": kind} | held
        points[name] = {"kind": "free" if kind == "body" else "fixed"} | end
    return found | {"points": points, "lines": {"one": line}}


def assert_same(one: hybrid.Result, other: hybrid.Result, most: float) -> None:
    """Two results of a line."""
    assert np.abs(np.diff(one["payout/length"])).sum() > 1.0
    for name in ("position", "tension", "reaction_end", "payout/length", "payout/power", "work/end", "work/zones"):
        assert np.abs(other[name] - one[name]).max() <= most * np.abs(one[name]).max(), name
    for name in ("envelope/tension_max", "envelope/displacement_max"):
        np.testing.assert_allclose(other[name], one[name], rtol=most)


# --- as one cable -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scene",
    [
        cable(),
        cable(model="rod", EA=2e6, EI=2e4, clamp=True),
        cable(model="rod", EI=2e4, rate=-0.8),
        cable(TABLE | ROPE, clamp=True, model="rod", EA=2e6, EI=2e4),
        cable({"damping": {"stiffness": 0.05}}, clamp=True, model="rod", EA=2e6, EI=2e4),
    ],
    ids=["catenary", "clamp", "rod, taken in", "tables", "damped"],
)
def test_a_system_of_one_line_is_the_cable(scene: dict[str, Any]) -> None:
    assert_same(hybrid.run(scene), hybrid.run(as_system(scene)).lines["one"], 1e-9)


def test_so_it_is_with_a_winch_that_holds_a_tension() -> None:
    scene = cable(EA=2e6)
    scene["ends"]["end"]["payout"] = WINCH
    assert_same(hybrid.run(scene), hybrid.run(as_system(scene)).lines["one"], 1e-9)


def lowered(clamp: bool = False, **more: Any) -> dict[str, Any]:
    """A body of 300 kg hangs from the winch."""
    scene = cable(clamp=clamp, **more)
    scene["ends"]["start"] = {"kind": "body", "mass": 300.0, "volume": 0.15, "initial_guess": [75, 0, -100]}
    if clamp:
        scene["ends"]["end"]["tangent"] = [0.3, 0, 1]
    return scene


@pytest.mark.parametrize(
    "more",
    [{"EA": 2e6}, {"model": "rod", "EA": 2e6, "EI": 2e4, "clamp": True, "rate": -0.8}],
    ids=["catenary", "clamp"],
)
def test_a_free_point_is_lowered_as_the_body_of_a_cable(more: dict[str, Any]) -> None:
    """To Newton's tolerance: its unknown is one of the junctions, and not the last node of the line."""
    scene = lowered(**more)
    assert_same(hybrid.run(scene), hybrid.run(as_system(scene)).lines["one"], 1e-6)


def test_what_breaks_off_the_far_end_does_as_an_end_that_is_let_go() -> None:
    scene = cable(model="rod", EA=2e6, EI=2e4)
    other = as_system(scene)
    scene["ends"]["start"]["release_at"] = {"time": 3.0}
    other["lines"]["one"]["break_at"] = {"end": "start", "time": 3.0}
    one, two = hybrid.run(scene), hybrid.run(other).lines["one"]
    assert np.abs(one.position[-1, 0]).max() > 1.0
    assert np.abs(one.position - two.position).max() < 1e-6


@pytest.mark.long
def test_loads_change_as_of_one_cable(tmp_path: Path) -> None:
    """In mid-run, of a line that is longer then than at t = 0."""
    scene, found = cable(EA=2e6), []
    scene["ends"]["end"]["payout"]["longest"] = 120.0
    for k, each in enumerate((scene, as_system(scene))):
        path = tmp_path / f"{k}.h5"
        hybrid.run(each, output=path)
        changed = hybrid.resume(path, until=9.0, settings=["environment.fluid.current=[0, -0.6, 0]"])
        found.append(changed.lines["one"] if changed.lines else changed)
    assert_same(*found, 1e-9)


def test_it_touches_itself_as_one_cable() -> None:
    """Contact goes on over nodes that enter."""
    scene = cable(model="rod", EA=2e5, EI=20.0) | {"contact": {"self": True}}
    assert_same(hybrid.run(scene), hybrid.run(as_system(scene)).lines["one"], 1e-7)


# --- several ----------------------------------------------------------------------------------------


def crane(law: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """A line from a winch that heaves carries two slings with a bar between them; another line is taken in."""
    wire = [{"length": 30.0, "mass": 3.0, "diameter": 0.03, "axial_stiffness": 1e6, "drag": {"normal": 1.2}}]
    sling = {"sections": [wire[0] | {"length": 6.0}], "mesh": {"cells": 6}}
    heave = {"heave": {"amplitude": 0.5, "period": 6.0}, "ramp": 6.0}
    law = law or {"rate": 0.8, "ramp": 2.0}
    return {
        "environment": {"fluid": {"density": 1025, "current": [0.3, 0.1, 0]}},
        "points": {
            "tip": {"position": [0, 0, 0], "motion": heave}, "shore": {"position": [40, 5, -20]},
            "hook": {"kind": "free", "mass": 50.0, "volume": 0.01, "initial_guess": [0, 0, -30]},
            "left": {"body": "bar", "place": [-3, 0, 0]}, "right": {"body": "bar", "place": [3, 0, 0]},
        },
        "bodies": {
            "bar": {"mass": 400.0, "volume": 0.1, "inertia": [100, 1200, 1200], "initial_guess": [0, 0, -35.2]}
        },
        "lines": {
            "wire": {"start": "hook", "end": "tip", "sections": wire, "mesh": {"cells": 24},
                     "connections": {"end": {"payout": law}}},
            "a": {"start": "left", "end": "hook", **sling}, "b": {"start": "right", "end": "hook", **sling},
            "tug": {"start": "shore", "end": "right", "sections": [wire[0] | {"length": 50.0}], "mesh": {"cells": 25},
                    "connections": {"start": {"payout": {"rate": -0.5, "ramp": 2.0}}}},
        },
        "time": {"duration": 6.0, "step": 0.02}, "output": {"every": 0.25}, **more,
    }  # fmt: skip


NAMES = ("position", "tension", "reaction_end", "work/end", "work/zones", "work/scheme", "envelope/tension_max")


@cache
def raised() -> tuple[hybrid.Result, dict[str, Any]]:
    scene = crane()
    for name, end in (("wire", "end"), ("tug", "start")):
        scene["lines"][name]["connections"][end]["payout"]["longest"] = 60.0
    return hybrid.run(scene), scene


def test_a_load_goes_down_as_line_is_paid_out() -> None:
    """Lengths, cells and energy of all lines."""
    found, _ = raised()
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


def test_turned_it_is_the_same() -> None:
    """The scene rotated about the vertical."""
    c, s = np.cos(0.7), np.sin(0.7)
    M, turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), crane()
    for point in turned["points"].values():
        for key in ("position", "initial_guess"):
            if key in point:
                point[key] = (M @ point[key]).tolist()
    bar = turned["bodies"]["bar"]
    bar["initial_guess"] = (M @ bar["initial_guess"]).tolist()
    bar["initial_rotation"] = [0, 0, np.degrees(0.7)]
    turned["environment"]["fluid"]["current"] = (M @ turned["environment"]["fluid"]["current"]).tolist()
    one, other = raised()[0], hybrid.run(turned)
    for name in ("wire", "tug"):
        end = -1 if name == "wire" else 0
        there = one.lines[name].position[:, end] @ M.T
        np.testing.assert_allclose(other.lines[name].position[:, end], there, atol=1e-9)
        size = np.abs(one.lines[name]["reaction_end"]).max()
        assert np.abs(other.lines[name]["reaction_end"] - one.lines[name]["reaction_end"] @ M.T).max() < 1e-5 * size


@pytest.mark.long
def test_resumed_bit_for_bit(tmp_path: Path) -> None:
    whole, scene = raised()
    hybrid.run(scene | {"time": {"duration": 3.0, "step": 0.02}}, output=tmp_path / "part.h5")
    resumed = hybrid.resume(tmp_path / "part.h5", until=6.0)
    for line, found in whole.lines.items():
        for name in NAMES:
            assert np.array_equal(found[name], resumed.lines[line][name], equal_nan=True), (line, name)


def test_from_outside_it_is_the_same_and_goes_back() -> None:
    """Stepped, with the rate set for every step; taken back over nodes that enter and leave."""
    scene = crane({"longest": 60.0})
    law = crane({"rates": [[0, 0], [2, 0.8], [4, 0.8], [6, 0.0]]}, output={"every": 0.25, "exact": True})
    rates = np.interp(np.arange(0.0, 6.3, 0.25), [0, 2, 4, 6], [0, 0.8, 0.8, 0])
    del law["lines"]["wire"]["connections"]["end"]["payout"]["rates"]
    with hybrid.Simulation(scene) as sim:
        assert isinstance(sim, hybrid.Simulation)
        with pytest.raises(ValueError, match=r"lines\.tug\.connections\.start\.payout gives the length"):
            sim.set_payout("tug", 1.0)
        with pytest.raises(ValueError, match=r"lines\.a\.connections has no payout"):
            sim.set_length("a", 7.0)
        there, mark = [], sim.save()
        for k in range(20):
            if k == 8:
                mark = sim.save()
            sim.set_payout("wire", float(rates[k + 1]))
            sim.advance(0.25 * (k + 1))
            there.append(sim.line("wire").position)
        sim.restore(mark)
        again = []
        for k in range(8, 20):
            sim.set_payout("wire", float(rates[k + 1]))
            sim.advance(0.25 * (k + 1))
            again.append(sim.line("wire").position)
        assert len({len(x) for x in there}) > 2
        assert all(np.array_equal(x, y) for x, y in zip(there[8:], again, strict=True))
        length = sim.result().lines["wire"]["payout/length"]
    trapezoids = 30.0 + np.concatenate([[0.0], np.cumsum(0.125 * (rates[:-1] + rates[1:]))])
    np.testing.assert_allclose(length, trapezoids[: len(length)], rtol=1e-12)


def frame(sign: float) -> dict[str, Any]:
    """A body that hangs from a fixed point has a winch, from which 500 kg hang."""
    wire = {"mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e9}
    own = {"model": "catenary", "contact": {"self": False}}
    law = {"lengths": [[0, 30], [4, 30 + 3 * sign], [8, 30 + 6 * sign]]}
    return {
        "points": {
            "top": {"position": [0, 0, 0]}, "eye": {"body": "frame", "place": [0, 0, 1.0]},
            "winch": {"body": "frame", "place": [0, 0, -1.0]},
            "load": {"kind": "free", "mass": 500.0, "initial_guess": [0, 0, -52]},
        },
        "bodies": {"frame": {"mass": 1000.0, "inertia": [100, 100, 100], "initial_guess": [0, 0, -21]}},
        "lines": {
            "up": {"start": "eye", "end": "top", "sections": [wire | {"length": 20.0}], "mesh": {"cells": 10}, **own},
            "down": {"start": "load", "end": "winch", "sections": [wire | {"length": 30.0}], "mesh": {"cells": 20},
                     "connections": {"end": {"payout": law}}, **own},
        },
        "time": {"duration": 8.0, "step": 0.02}, "output": {"every": 0.02},
    }  # fmt: skip


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


def test_an_accuracy_is_met_and_errors_are_those_of_the_cable() -> None:
    scene = cable(EA=2e6) | {"accuracy": "1%"}
    del scene["mesh"], scene["time"]["step"]
    other = as_system(scene | {"mesh": None})
    del other["lines"]["one"]["mesh"]
    one, two = hybrid.run(scene), hybrid.run(other).lines["one"]
    mine, its = (x["errors/total/position"][1:].max() for x in (one, two))
    assert 0.3 * mine < its < 3.0 * mine
    assert np.abs(one.position - two.position).max() < 3.0 * (mine + its)


def test_errors_of_fixed_steps_are_estimated() -> None:
    """Within 0.5 to 4 of the true one; and of a line that has too few cells for a coarser run an event says so."""
    scene = as_system(cable(EA=2e6)) | {"time": {"duration": 6.0, "step": 0.1}}
    found = hybrid.run(scene | {"output": {"every": 0.5, "errors": True}}).lines["one"]
    scene["lines"]["one"]["mesh"], scene["time"]["step"] = {"cells": 160}, 0.025
    true = np.linalg.norm(hybrid.run(scene).lines["one"].position - found.position, axis=2).max()
    assert 0.5 * true < found["errors/total/position"].max() < 4.0 * true
    few = as_system(cable(model="rod", EA=2e6, EI=2e4, clamp=True)) | {"output": {"every": 0.5, "errors": True}}
    few["lines"]["one"]["mesh"] = {"cells": 16}
    told = [x.text for x in hybrid.run(few).events if x.kind == "no error figure"]
    assert told and "line one has too few cells" in told[0]


def test_a_winch_without_more_line_says_so() -> None:
    scene = as_system(cable(EA=2e6))
    payout = WINCH | {"winch": WINCH["winch"] | {"tension": 1500.0}, "longest": 101.0}
    scene["lines"]["one"]["connections"]["end"]["payout"] = payout
    with pytest.raises(ComputationError) as stopped:
        hybrid.run(scene | {"time": {"duration": 20.0, "step": 0.05}})
    assert stopped.value.outcome == Outcome.WINCH_AT_END and "line one" in str(stopped.value)


def test_what_is_wrong_is_said_of_the_line() -> None:
    at = "lines.one.connections.end.payout"
    held = as_system(cable())
    held["lines"]["one"]["connections"]["end"]["payout"]["longest"] = 90.0
    free = as_system(lowered())
    free["lines"]["one"]["connections"] = {"start": {"payout": {"rate": 1.0, "ramp": 1.0}}}
    for scene, where in ((held, f"{at}.longest"), (free, "lines.one.connections.start.payout")):
        with pytest.raises(SceneError) as refused:
            hybrid.plan(scene)
        assert where in str(refused.value)
