"""Turns of an end are counted: in statics by `turns`, in motion whatever the steps and the outputs are."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.model.build import build
from hybrid.model.network import build_network
from hybrid.scene.read import one_line
from hybrid.scene.root import in_full
from hybrid.simulation import equilibrium
from tests.said import kinds, line_of, said
from tests.scenes import cable_scene, clamped_at, pinned_at

GJ, LENGTH = 0.789, 100.0
SECTION = {"length": LENGTH, "mass": 1.0, "axial_stiffness": 1e4, "bending_stiffness": 1.345,
           "torsional_stiffness": GJ, "damping": {"mass": 0.1}}  # fmt: skip
X, Z = [1, 0, 0], [0, 0, 1]


def clamped(place, **more):
    return {"kind": "clamped", "position": place, "tangent": X, "normal": Z, **more}


def taut(first=None, second=None, section=None, **more) -> hybrid.Scene:
    """A rod along x without weight, pulled by 5 N; first, second: more of its ends."""
    ends = clamped([0, 0, 0], **(first or {})), clamped([100.05, 0, 0], **(second or {}))
    return hybrid.validate_scene(cable_scene(SECTION | (section or {}), *ends, gravity=0.0, model="rod") | more)


def torque_of(turns: float) -> float:
    return GJ * 2.0 * math.pi * turns / LENGTH


# --- statics -------------------------------------------------------------------------------------


@pytest.mark.parametrize("turns", [27, -3.25, 0.5, 1])
def test_torque_of_a_rod_twisted_by_turns(turns):
    """G J 2 pi n / L, exact; the mesh is left to the program, so it must resolve the twist: no event."""
    result = hybrid.static(taut(second={"turns": turns}))
    np.testing.assert_allclose(result["torque"][0], torque_of(turns), rtol=1e-9)
    assert not result.events
    other = hybrid.static(taut(first={"turns": -turns}))
    np.testing.assert_allclose(other["torque"][0], torque_of(turns), rtol=1e-9)
    both = hybrid.static(taut(first={"turns": 0.75}, second={"turns": turns + 0.75}))
    np.testing.assert_allclose(both["torque"][0], torque_of(turns), rtol=1e-9)


def test_turns_count_from_the_normal():
    """A normal a quarter of a turn further and a quarter of a turn less are the same rod."""
    turned = hybrid.static(taut(second={"turns": 2.75, "normal": [0, -1, 0]}))
    np.testing.assert_allclose(turned["torque"][0], torque_of(3.0), rtol=1e-9)


def test_turns_of_a_clamp_without_a_normal():
    result = hybrid.static(taut(first={"normal": None}, second={"normal": None, "turns": 4}))
    np.testing.assert_allclose(result["torque"][0], torque_of(4.0), rtol=1e-9)


def test_too_few_cells_for_the_turns_are_refused():
    with pytest.raises(hybrid.ComputationError, match=r"(?s)s = 100 m.*ends.end.turns: 27; 20 cells.*at least 170"):
        hybrid.static(taut(second={"turns": 27}, mesh={"cells": 20}))


def test_an_equilibrium_that_has_lost_a_turn_is_refused(monkeypatch):
    model = build_network(in_full(taut(second={"turns": 3})))
    lost = build(one_line(taut(second={"turns": 2}))).start
    (state,) = (x.start for x in model.models)
    text, s = equilibrium.lost_turns(model, 0.0, 0, state._replace(a1=lost.a1))
    assert s == 100.0 and re.search(r"connections.end.turns: 3;.*start with 3 turns.*have 2$", text)
    assert equilibrium.lost_turns(model, 0.0, 0, state)[0] == ""


REFUSED = {
    "swivel": ({"first": {"swivel": True}}, r"ends.start turns freely"),
    "free": ({"ends": {"start": pinned_at(0, 0, 0), "end": clamped([100, 0, 0], turns=2)}}, r"ends.start turns freely"),
    "torsion": ({"section": {"torsional_stiffness": None}}, r"torsional_stiffness(?s:.*)ends.end.turns"),
    "plane": ({"dimension": 2}, r"ends.end.turns(?s:.*)dimension"),
    "nan": ({"second": {"turns": math.nan}}, r"ends.end.turns"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_turns_that_mean_nothing_are_refused(name):
    more, text = REFUSED[name]
    with pytest.raises(hybrid.SceneError, match=text):
        taut(**{"second": {"turns": 2}, **more})


ROD_AND_CATENARY = {"kind": "zones", "zones": [{"rod": 50}, {"catenary": 50}]}


@pytest.mark.parametrize("model", ["catenary", ROD_AND_CATENARY, {"kind": "adaptive", "tolerance": 1e-2}])
def test_turns_pass_through_catenary_zones(model):
    """G J 2 pi n / L, exact, and nothing is said to be neglected."""
    result = hybrid.static(taut(second={"turns": 3}, model=model))
    np.testing.assert_allclose(result["torque"][0], torque_of(3.0), rtol=1e-9)
    np.testing.assert_allclose(result["moment_end"][0], [torque_of(3.0), 0.0, 0.0], rtol=1e-9, atol=1e-12)
    assert "torque neglected" not in kinds(result)


def test_a_run_starts_with_the_turns():
    time = {"duration": 0.5, "step": 0.05}
    result = hybrid.run(taut(second={"turns": 5}, time=time))
    np.testing.assert_allclose(result["torque"][:], torque_of(5.0), rtol=1e-7)
    straight = {"kind": "straight", "direction": X}
    end = {"turns": 5, "position": [100, 0, 0]}
    result = hybrid.run(taut(second=end, time=time, initial=straight))
    np.testing.assert_allclose(result["torque"][0], torque_of(5.0), rtol=1e-9)


# --- motion --------------------------------------------------------------------------------------


def wound(folder: Path, turns: float, over: float, until: float, every: float = 2.0) -> dict:
    """Motion of an end that is turned about its tangent."""
    t = np.arange(0.0, until + 0.5 * every, every)
    x = np.clip(t / over, 0.0, 1.0)
    angle = 360.0 * turns * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    table = np.column_stack([t, angle, 0 * t, 0 * t])
    np.savetxt(folder / "turns.csv", table, delimiter=",", header="t,rx,ry,rz", comments="", fmt="%.10g")
    return {"motion": {"file": str(folder / "turns.csv")}}


@pytest.mark.long
@pytest.mark.parametrize(("every", "step"), [(25.0, 25.0), (25.0, 5.0), (1.0, 1.0), (25.0, None), (1.0, None)])
def test_turns_beyond_outputs(tmp_path, every, step):
    """27 turns in 1000 s: 1.3385 N m, however long steps and outputs are; only steps that are cut are an event."""
    time = {"duration": 1100.0} | ({"step": step} if step else {"tolerance": 1e-3})
    scene = taut(second=wound(tmp_path, 27, 1000, 1100), time=time, output={"every": every})
    result = hybrid.run(scene)
    np.testing.assert_allclose(result["torque"][-1], 1.3385, rtol=1e-4)
    assert ("steps cut" in kinds(result)) == (step is not None and step > 4.0)
    assert not {"unresolved twist", "gains energy"} & kinds(result)


def test_steps_in_which_an_end_turns_far_are_cut(tmp_path):
    """Two turns in 50 s, in steps of 10 s: they are cut so that none turns by more than a radian, and it is said."""
    time = {"duration": 60.0, "step": 10.0}
    scene = taut(second=wound(tmp_path, 2, 50, 60), time=time, output={"every": 10.0}, mesh={"cells": 8})
    result = line_of(hybrid.run(said(scene, network=True)))
    np.testing.assert_allclose(result["torque"][-1], torque_of(2.0), rtol=1e-2)
    (cut,) = [e for e in result.events if e.kind == "steps cut"]
    assert "an end turns by" in cut.text and 15 < len(result["steps/t"]) < 30


@pytest.mark.parametrize(("every", "step"), [(25.0, 5.0), (25.0, 0.5), (1.0, 1.0), (25.0, None), (1.0, None)])
def test_two_turns_of_yaw(every, step):
    """15 N m2 / 100 m times the angle, 4 pi at the peak, also at outputs that lie within long steps."""
    section = {"axial_stiffness": 1e6, "bending_stiffness": 20.0, "torsional_stiffness": 15.0}
    end = {"kind": "clamped", "tangent": [0, 0, -1], "normal": X}
    yaw = {"ramp": 60.0, "yaw": {"amplitude": 720.0, "period": 60.0}}
    ends = {"start": end | {"position": [0, 0, 0], "motion": yaw}, "end": end | {"position": [0, 0, -100.05]}}
    time = {"duration": 75.0} | ({"step": step} if step else {})
    result = hybrid.run(taut(section=section, ends=ends, time=time, mesh={"cells": 200}, output={"every": every}))
    swung = result.times > 60.0  # outputs within long steps, too, where nothing is seen to move
    truth = 0.6 * math.pi * np.sin(2.0 * math.pi * result.times[swung] / 60.0)
    assert np.abs(np.abs(result.torque[swung]) - truth[:, None]).max() < 1e-3 * 0.6 * math.pi


FOLLOWS = {"kind": "adaptive", "curvature_error": 0.1}


def test_cells_that_follow_take_the_twist_of_the_ends():
    """A slack cable whose ends come nearer: no cell near half a turn, and none that is said to be twisted too far."""
    turns = 12
    section = {"length": 10.0, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 2.0,
               "torsional_stiffness": 1.5, "damping": {"mass": 0.5, "stiffness": 0.01}}  # fmt: skip
    travel = {"travel": {"by": [-1.5, 0, 0], "over": 20.0}}
    end = clamped([9.95, 0, 0], turns=turns, motion=travel)
    scene = cable_scene(section, clamped([0, 0, 0]), end, fluid={"density": 1025.0}, model=FOLLOWS, time=(0.4, 0.02))
    result = hybrid.run(scene)
    assert "unresolved twist" not in kinds(result)
    assert abs(result["torque"][-1]).max() == pytest.approx(1.5 * 2.0 * math.pi * turns / 10.0, rel=0.02)


def test_turns_of_sections_that_resist_torsion_differently() -> None:
    """Zones take the torque of the rods: turns begin as one torque spreads them, so that none is lost on the way."""
    stiff = {"mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": 10.0}
    sections = [stiff | {"length": l, "torsional_stiffness": gj} for l, gj in ((20, 8.0), (15, 3.0), (25, 12.0))]
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -0.5]}
    far = clamp | {"position": [50, 3, 0], "tangent": [1, 0, 0.5], "turns": 8}
    scene = {"cable": {"sections": sections}, "mesh": {"cells": 240}, "ends": {"start": clamp, "end": far}}
    torque = [
        hybrid.static(scene | {"initial": "equilibrium", "model": model})["torque"][0]
        for model in ("rod", {"zones": [{"rod": 12}, {"catenary": 36}, {"rod": 12}]})
    ]
    compliance = sum(x["length"] / x["torsional_stiffness"] for x in sections)
    assert torque[0].mean() == pytest.approx(16.0 * np.pi / compliance, rel=0.01)  # less what the shape takes as writhe
    assert np.abs(torque[1] - torque[0].mean()).max() < 1e-4 * torque[0].mean()


# --- Swivels in a line: force and bending moment pass, torque does not, in statics and motion, rods and zones ---

LENGTH_SWIVEL, GJ_SWIVEL = 20.0, 8.0
MODELS: dict[str, Any] = {
    "rod": "rod", "adaptive": "adaptive",
    "zones": {"kind": "zones", "zones": [{"rod": 6.0}, {"catenary": 3.0}, {"rod": 11.0}]},
    "swivel in a catenary": {"kind": "zones", "zones": [{"rod": 8.0}, {"catenary": 8.0}, {"rod": 4.0}]},
}  # fmt: skip


def line(swivel: bool, normal: tuple[float, float, float] = (0.0, 1.0, 0.0), model: Any = "rod") -> dict[str, Any]:
    """A sagging line between clamps; normal: of the second one."""
    section = {"length": LENGTH_SWIVEL, "mass": 1.0, "diameter": 0.03, "bending_stiffness": 10.0, "torsional_stiffness": GJ_SWIVEL,
               "damping": {"mass": 2.0, "stiffness": 0.01}}  # fmt: skip
    return cable_scene(
        section, clamped_at([0.0] * 3, [1.0, 0.0, 0.0], normal=[0.0, 1.0, 0.0]),
        clamped_at([16.0, 0.0, 2.0], [1.0, 0.0, 1.0], normal=normal),
        attachments=[{"kind": "swivel", "at": 12.0}] if swivel else [], model=model, mesh=80, output={"points": 41}
    )  # fmt: skip


def turning(turns: float, folder: Path, swivel: bool = True, model: Any = "rod") -> hybrid.Result:
    """The first clamp turns about its tangent within 8 s, then rests for 4 s."""
    scene = line(swivel, model=model) | {"time": {"duration": 12.0, "step": 0.02}}
    scene["output"] = {"every": 0.5, "points": 41}
    scene["ends"]["start"] |= wound(folder, turns, 8.0, 12.0, 0.25)
    return hybrid.run(scene)


@pytest.mark.parametrize("model", MODELS)
def test_turns_of_a_clamp_pass_a_swivel(model: str, tmp_path: Path) -> None:
    """Ten turns of a clamp about its tangent change nothing in the end; without a swivel the line holds them."""
    still, turned = (turning(n, tmp_path, model=MODELS[model]) for n in (0.0, 10.0))
    assert np.abs(turned.torque[-1]).max() < 1e-3 * GJ_SWIVEL * 20.0 * np.pi / LENGTH_SWIVEL
    moved = np.abs(turned.position[-1] - still.position[-1]).max()
    assert moved < (1e-3 if model == "adaptive" else 1e-4) * LENGTH_SWIVEL  # zones that move are where they were of use
    assert "turns/link" not in turned.names
    assert not {"unresolved twist", "steps cut", "loop can form"} & kinds(turned)


def test_both_sides_of_a_swivel_bear_no_torque_at_it(tmp_path: Path) -> None:
    """While the clamp turns, damping of the bend makes a torque; at the swivel there is none."""
    result = turning(10.0, tmp_path)
    at = int(np.argmin(np.abs(result.s - 12.0)))
    largest = np.abs(result.torque).max()
    assert largest > 1e-4
    assert np.abs(result.at(s=12.0)["torque"]).max() < 0.05 * largest, at


@pytest.mark.parametrize("turns", [0.45, 0.6, 2.0])
def test_a_swivel_end_that_bends_the_line_feels_no_turns(turns: float, tmp_path: Path) -> None:
    """A rod bent by an askew clamp with a swivel: turned by its other end, it lies as before, whatever the turns."""
    results = []
    for n in (0.0, turns):
        scene = cable_scene(
            {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0, "torsional_stiffness": 0.8,
             "damping": {"mass": 20.0}},
            clamped_at([0.0] * 3, [1.0, 0.0, 0.0], normal=[0.0, 0.0, 1.0], **wound(tmp_path, n, 8.0, 10.0, 0.5)),
            clamped_at([0.8, 0.0, 0.0], [0.8, 0.6, 0.0], swivel=True), gravity=0.0, model="rod", mesh=40,
            time=(10.0, 0.02), output=(1.0, 21)
        )  # fmt: skip
        results.append(hybrid.run(scene))
    still, turned = results
    np.testing.assert_allclose(turned.position[-1], still.position[-1], atol=1e-4)
    np.testing.assert_allclose(turned.bending_moment[-1], still.bending_moment[-1], rtol=1e-3)
    assert np.abs(turned.torque[-1]).max() < 1e-3


def test_a_swivel_of_mass_hangs_as_a_clump_does() -> None:
    swivel, clump = line(True), line(True)
    swivel["cable"]["attachments"][0]["mass"] = 3.0
    clump["cable"]["attachments"] = [{"kind": "clump", "at": 12.0, "mass": 3.0}]
    a, b = (hybrid.static(x) for x in (swivel, clump))
    np.testing.assert_allclose(a.position, b.position, atol=1e-9 * LENGTH_SWIVEL)


def test_a_swivel_is_idle_in_a_plane() -> None:
    """A line that moves in a plane is the same in it as in space."""
    scene = line(True) | {"time": {"duration": 1.0, "step": 0.02}}
    scene["ends"]["end"]["motion"] = {"heave": {"amplitude": 0.3, "period": 2.0}, "ramp": 1.0}
    plane, space = (hybrid.run(scene | {"dimension": k}) for k in (2, 3))
    np.testing.assert_allclose(plane.position, space.position, atol=1e-9 * LENGTH_SWIVEL)
    np.testing.assert_allclose(plane.tension, space.tension, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"cable": {"attachments": [{"kind": "swivel", "at": 20.0}]}}, "ends.end.swivel: true"),
        ({"cable": {"attachments": [{"kind": "swivel", "at": -1.0}]}}, "at"),
    ],
)
def test_a_swivel_is_refused_where_it_cannot_be(change: dict[str, Any], says: str) -> None:
    scene = line(True)
    scene["cable"]["attachments"] = change["cable"]["attachments"]
    with pytest.raises(hybrid.SceneError, match=says):
        hybrid.validate_scene(scene)
