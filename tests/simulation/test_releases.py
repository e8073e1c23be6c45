"""Held ends that are let go in mid-motion: what is conserved from there on, events, resumed runs, steps taken back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import differences

import hybrid
from hybrid.errors import SceneError
from tests.problems import tables_with
from tests.scenes import cable_scene, clamped_at, line_between, network_scene, pinned_at

SECTION = {"length": 10.0, "mass": 1.0, "axial_stiffness": 1e5, "bending_stiffness": 5.0}
CLAMP = {"kind": "clamped", "position": [8, 0, 0], "tangent": [1, 0, 0]}
HEAVE = {"travel": {"by": [1.99, 0, 0], "over": 1.0}}


def scene(end: dict[str, Any], start: dict[str, Any] | None = None, **changes: Any) -> hybrid.Scene:
    data: dict[str, Any] = cable_scene(
        SECTION, start or pinned_at(0, 0, 0), end, model="rod", mesh=20, time=(1.5, 0.01), output=(0.1, 21)
    )
    return hybrid.validate_scene(data | changes)


def pinned(**release: Any) -> dict[str, Any]:
    return {"kind": "pinned", "position": [8, 0, 0], **release}


def masses(cells: int = 20, mass: float = 10.0) -> np.ndarray:
    out = np.full(cells + 1, mass / cells)
    out[[0, -1]] *= 0.5
    return out


def test_a_cable_whose_ends_are_both_let_go_falls_as_a_body() -> None:
    """Its centre of mass is on the parabola of free fall to round-off; its angular momentum stays to second order."""
    both = scene(pinned(release_at={"time": 0.5}), pinned_at(0, 0, 0, release_at={"time": 0.5}))
    with hybrid.run(both) as result:
        after = result.t > 0.5 + 1e-9
        t, r, v, m = result.t[after] - 0.5, result.position[after], result.velocity[after], masses()
        centre = np.einsum("i,tik->tk", m, r) / m.sum()
        begin = (m @ result.position[5]) / m.sum()
        np.testing.assert_allclose(centre[:, 2] - begin[2], -0.5 * 9.81 * t**2, rtol=0, atol=2e-6)
        assert [(e.kind, e.t, e.s_a) for e in result.events if e.kind == "end released"] == [
            ("end released", 0.5, 0.0), ("end released", 0.5, 10.0)]  # fmt: skip
        spin = np.einsum(
            "i,tik->tk", m, np.cross(r - centre[:, None], v - np.einsum("i,tik->tk", m, v)[:, None] / m.sum())
        )
        size = np.einsum("i,ti,ti->t", m, *2 * (np.linalg.norm(r - centre[:, None], axis=2),)).max()
        assert np.abs(spin - spin[0]).max() < 1e-4 * size


@pytest.mark.parametrize(("turns", "step"), [(0.125, 0.02), (3.0, 0.02), (0.125, 0.2)])
def test_a_twisted_rod_that_is_let_go_gains_no_energy(turns: float, step: float) -> None:
    """Its last cell would spin by half a turn and more against the next one in a step, unseen in their twist."""
    section = SECTION | {"diameter": 0.03, "axial_stiffness": 1e6, "torsional_stiffness": 150.0}
    down = {"kind": "clamped", "tangent": [0, 0, -1], "normal": [1, 0, 0]}
    end = down | {"position": [0, 0, -10.001], "turns": turns, "release_at": {"time": step}}
    time = {"duration": 50 * step, "step": step}
    hanging = scene(end, down | {"position": [0, 0, 0]}, time=time, cable={"sections": [section]}, dimension=3)
    result = hybrid.run(hanging.model_copy(update={"output": hanging.output.model_copy(update={"every": step})}))
    alive = result["energy/kinetic"] + result["energy/torsion"]
    assert result["energy/torsion"][0] == pytest.approx(0.5 * 150.0 * (2.0 * np.pi * turns) ** 2 / 10.0, rel=0.05)
    assert alive.max() <= 1.001 * alive[0]
    assert result["work/scheme"].max() < 1e-3 * alive[0]
    assert alive[2] > 0.01 * alive[0], "it spins, and is not only damped away"


@pytest.mark.parametrize("model", ["rod", {"kind": "adaptive", "tolerance": 1e-3}], ids=["rod", "adaptive"])
def test_a_clamp_goes_with_the_energy_of_its_bend(model: Any) -> None:
    """Bending at the end is zero from then on, the clamp's energy is in the event and in the work of the end."""
    made = scene(CLAMP | {"release_at": {"time": 0.5}}, model=model)
    with hybrid.run(made) as result:
        event = next(e for e in result.events if e.kind == "end released")
        assert event.energy < 0.0
        assert result.work["end"][-1] == pytest.approx(event.energy, abs=1e-12)
        assert np.abs(result.moment[result.t > 0.5 + 1e-9, -1]).max() < 1e-9 < np.abs(result.moment[5, -1]).max()


@pytest.mark.parametrize("controlled", [False, True])
def test_an_end_is_let_go_by_its_force(controlled: bool) -> None:
    """After the first step above the limit, and free from then on."""
    time = {"duration": 1.5, "tolerance": 1e-5} if controlled else {"duration": 1.5, "step": 0.01}
    with hybrid.run(scene(pinned(motion=HEAVE, release_at={"tension": 150.0, "time": 1.4}), time=time)) as result:
        (event,) = (e for e in result.events if e.kind == "end released")
        t, force = result.steps["t"], result.steps["end_force_end"]
        first = int(np.argmax(force > 150.0))
        assert event.t == t[first] < 1.0 and "release_at.tension, 150 N" in event.text
        assert (force[:first] <= 150.0).all() and (force[first + 1 :] == 0.0).all()


def test_a_load_that_changes_after_a_release_leaves_it_free(tmp_path: Path) -> None:
    made = scene(pinned(release_at={"time": 0.5}))
    hybrid.run(made, tmp_path / "a.h5").close()
    with hybrid.resume(tmp_path / "a.h5", until=2.0, settings=["environment.fluid=null"]) as result:
        assert result.steps["end_force_end"][-1] == 0.0


@pytest.mark.parametrize("model", ["rod", {"kind": "adaptive", "tolerance": 1e-3}], ids=["rod", "adaptive"])
def test_a_simulation_releases_and_takes_it_back(model: Any) -> None:
    """Released, stepped and restored: as if nothing had been; then released for good it is the run with release_at."""
    with hybrid.run(scene(CLAMP | {"release_at": {"time": 0.5}}, model=model)) as expected:
        places = expected.position[()]
    with hybrid.Simulation(scene(CLAMP, model=model)) as simulation:
        simulation.advance(0.3)
        saved = simulation.save()
        simulation.release("end")
        simulation.set_force("end", [1.0, 0.0, 0.0])
        simulation.advance(0.4)
        simulation.restore(saved)
        assert simulation.forces().end.any()
        simulation.advance(0.5)
        simulation.release("end")
        assert not simulation.forces().end.any()
        with pytest.raises(ValueError, match=r"ends\.end is not held"):
            simulation.release("end")
        with pytest.raises(ValueError, match=r"ends\.end is not held: set_force acts on it"):
            simulation.set_end("end", [0, 0, 0])
        simulation.advance(1.5)
        result = simulation.result()
    assert [e.kind for e in result.events].count("end released") == 1
    np.testing.assert_allclose(result.position[()], places, rtol=0, atol=1e-9)


def test_outputs_before_a_release_are_of_an_end_that_was_held() -> None:
    """They wait until there are more of them."""
    found = []
    for lets_go in (False, True):
        with hybrid.Simulation(scene(CLAMP, model="rod")) as simulation:
            simulation.advance(0.31)
            simulation.advance(0.47)
            if lets_go:
                simulation.release("end")
            simulation.advance(0.6)
            result = simulation.result()
        found.append(result["reaction_end"][result.times < 0.47])
    assert len(found[0]) > 3 and found[0].any(axis=1).all() and np.array_equal(*found)


ZONES = {"kind": "zones", "zones": [{"rod": 2.0, "cells": 6}, {"catenary": 6.0, "cells": 12}, {"rod": 2.0, "cells": 6}]}


@pytest.mark.long
@pytest.mark.parametrize("model", ["zones", "adaptive"])
def test_a_twisted_catenary_is_let_go_with_its_twist(model: str, tmp_path: Path) -> None:
    """Its torque is gone, its energy in the event, and it is resumed."""
    GJ, turns = 3.0, 1.5
    tables: dict[str, Any] = cable_scene(
        {"length": 10.0, "mass": 1.0, "diameter": 0.03, "axial_stiffness": 1e5, "bending_stiffness": 5.0,
         "torsional_stiffness": GJ, "damping": {"mass": 1.0}},
        clamped_at([0, 0, 0], [0, 0, -1], normal=[0, 1, 0]),
        clamped_at([0.4, 0, -9.99], [0, 0, -1], normal=[0, 1, 0], turns=turns, release_at={"time": 0.5}),
        attachments=[{"kind": "clump", "at": 9.0, "mass": 15.0}], gravity=9.81, contact={"self": False},
        model=ZONES if model == "zones" else {"kind": "adaptive", "hold_time": 0.1, "force_rod": [[0, 2], [8, 10]]},
        time=(1.0, 1 / 128), output={"every": 0.125, "exact": True, "points": 21}
    )  # fmt: skip
    if model == "adaptive":
        tables["mesh"] = {"cells": 30}
    with hybrid.run(tables, tmp_path / "run.h5") as result:
        (event,) = (x for x in result.events if x.kind == "end released")
        held, position, torque = result.t < 0.5 - 1e-9, np.array(result.position), np.array(result["torque"])
        assert np.abs(torque[held]).max() == pytest.approx(GJ * 2.0 * np.pi * turns / 10.0, rel=0.02)
        if model == "zones":  # rods beside it swing about their axis
            within = (result.s > 2.0 + 1e-9) & (result.s < 8.0 - 1e-9)
            assert (torque[~held][1:][:, within] == 0.0).all()
        if model == "zones":  # with half a cell of the rods on either side
            catenary = (6.0 + 2.0 / 6.0) * 0.5 * GJ * (2.0 * np.pi * turns / 10.0) ** 2
            assert event.energy == pytest.approx(-catenary, rel=0.1)
            assert result.work["end"][-1] == pytest.approx(event.energy, rel=1e-6)
    short = tmp_path / "short.h5"
    hybrid.run(tables_with(tables, {"time.duration": 0.75}), short).close()
    with hybrid.resume(short, until=1.0) as more:
        assert np.array_equal(more.position, position)
    assert differences(tmp_path / "run.h5", short) == []


def test_the_plan_says_that_a_release_comes_after_the_run() -> None:
    plan = hybrid.plan(scene(pinned(release_at={"time": 4.0})))
    assert any(x.what == "ends.end: pinned, let go at 4 s, after the end of this run, 1.5 s" for x in plan.contents)


def test_a_release_needs_a_time_or_a_tension() -> None:
    with pytest.raises(hybrid.SceneError, match="time or tension"):
        scene(pinned(release_at={}))


# --- Lines that break from a point, and points that give way, in mid-motion ---

SECTION_BREAK = {"length": 12.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5, "bending_stiffness": 20.0}


def scene_break(
    lines: dict[str, Any] | None = None, points: dict[str, Any] | None = None, **more: Any
) -> dict[str, Any]:
    """A weight on two lines."""
    at = {
        "left": {"position": [-8, 0, 0]}, "right": {"position": [8, 0, 0]},
        "weight": {"initial_guess": [0, 0, -8], "mass": 30.0},
    }  # fmt: skip
    both = {"a": {"start": "left", "end": "weight"}, "b": {"start": "weight", "end": "right"}}
    for name, line in both.items():
        line.update({"sections": [SECTION_BREAK], "mesh": {"cells": 12}, **(lines or {}).get(name, {})})  # type: ignore[arg-type]
    for name, keys in (points or {}).items():
        at[name].update(keys)  # type: ignore[attr-defined]
    time = {"duration": 1.5, "step": 0.01}
    return {"points": at, "lines": both, "time": time, "output": {"every": 0.05, "points": 13}} | more


def test_a_line_that_breaks_from_its_anchor_leaves_what_it_carried_to_the_others() -> None:
    """The weight swings on the line that is left; nothing pulls at the broken end, and the anchor stays."""
    with hybrid.run(scene_break(lines={"b": {"break_at": {"time": 0.5}}})) as result:
        event = next(x for x in result.events if x.kind == "end released")
        assert event.t == 0.5 and "line b breaks from point right" in event.text and event.energy == 0.0
        after = result.t > 0.5 + 1e-9
        assert np.abs(result["points/right/force"][after]).max() == 0.0
        assert result["points/right/position"][-1].tolist() == [8, 0, 0]
        loose = result.lines["b"].position[-1, -1]
        assert np.linalg.norm(loose - [8, 0, 0]) > 2.0
        joint = result.lines["a"].position[:, -1] - result.lines["b"].position[:, 0]
        assert np.abs(joint).max() < 1e-9


@pytest.mark.parametrize("end", ["start", "end"])
def test_lines_that_break_from_all_fall_as_bodies(end: str) -> None:
    """Both come loose from both of their ends: the centre of mass is on the parabola of free fall."""
    points = {"left": {"break_at": {"time": 0.3}}, "right": {"break_at": {"time": 0.3}}}
    lines = {"b" if end == "start" else "a": {"break_at": {"time": 0.3, "end": end}}}
    with hybrid.run(scene_break(lines, points)) as result:
        t = result.t[result.t > 0.3 + 1e-9] - 0.3
        name = next(iter(lines))
        r = result.lines[name].position
        centre = np.einsum("i,tik->tk", masses(12, 24.0), r) / 24.0
        np.testing.assert_allclose(centre[7:, 2] - centre[6, 2], -0.5 * 9.81 * t**2, rtol=0, atol=2e-5)
        np.testing.assert_allclose(centre[7:, 0], centre[6, 0], rtol=0, atol=2e-5)
        r = result.lines["a" if name == "b" else "b"].position
        m = np.append(masses(12, 24.0), 30.0)
        with_weight = np.concatenate([r, result["points/weight/position"][:, None]], axis=1)
        centre = np.einsum("i,tik->tk", m, with_weight) / m.sum()
        np.testing.assert_allclose(centre[7:, 2] - centre[6, 2], -0.5 * 9.81 * t**2, rtol=0, atol=2e-5)


def test_the_pull_of_an_end_that_came_loose_has_no_direction() -> None:
    """Its force is what Newton leaves: from then on angles are unknown, and ranges are those of before."""
    kinds = ("azimuth", "declination", "end_angle", "vertical_force")
    asked = {kind: {"kind": kind, "line": "b", "end": "end"} for kind in kinds}
    asked["end_angle"]["direction"] = [0, 0, 1]
    output = {"every": 0.01, "points": 13, "quantities": asked}
    breaking = hybrid.run(scene_break(lines={"b": {"break_at": {"time": 0.5}}}, output=output))
    with breaking as result, hybrid.run(scene_break(output=output)) as whole:
        after = result.t > 0.5 + 1e-9  # an output at the break is of the moment before
        for kind in kinds:
            known = whole[kind][whole.t < 0.5 + 1e-9]
            assert np.isfinite(known).all()
            np.testing.assert_array_equal(result[kind][~after], known)
            if kind == "vertical_force":
                assert (result[kind][after] == 0.0).all()
                known = np.append(known, 0.0)
            else:
                assert np.isnan(result[kind][after]).all()
            np.testing.assert_allclose(result[f"extremes/{kind}"], [known.min(), known.max()], rtol=1e-9)


def test_a_line_breaks_after_the_step_in_which_its_force_is_too_large() -> None:
    with hybrid.run(scene_break()) as still:
        pull = float(np.linalg.norm(still["points/right/force"][0]))
    moves = {"right": {"motion": {"heave": {"amplitude": 0.5, "period": 0.6}, "ramp": 0.6}}}
    with hybrid.run(scene_break({"b": {"break_at": {"tension": 1.5 * pull}}}, moves, output={"every": 0.01})) as result:
        event = next(x for x in result.events if x.kind == "end released")
        force = np.linalg.norm(result["points/right/force"], axis=1)
        before, after = result.t < event.t - 1e-9, result.t > event.t + 1e-9
        assert 0.1 < event.t < 1.4 and force[before].max() <= 1.5 * pull and force[after].max() < 1e-6
        assert force[~before & ~after] > 1.5 * pull  # as of one cable, an output there is of the moment before
        moved = result["points/right/position"][-1] - [8, 0, 0]  # the support goes on moving
        assert moved[2] == pytest.approx(0.5 * np.sin(2 * np.pi * 1.5 / 0.6), abs=1e-9)


def test_energy_after_a_break_is_kept_to_second_order() -> None:
    lost = []
    for step in (0.01, 0.0025):
        made = scene_break({"b": {"break_at": {"time": 0.5}}}, time={"duration": 1.5, "step": step})
        with hybrid.run(made) as result:
            lost.append(max(float(np.abs(line.work["scheme"]).max()) for line in result.lines.values()))
    assert lost[1] < 0.4 * lost[0] < 0.02 * 30 * 9.81 * 5, lost


def test_a_clamped_line_breaks_from_a_body_as_from_a_point() -> None:
    """Shape, end forces and energies, the energy of the clamp that is lost included."""
    rod = SECTION_BREAK | {"length": 4.0, "axial_stiffness": 1e4, "bending_stiffness": 200.0}
    line = {"start": "a", "end": "b", "sections": [rod], "mesh": {"cells": 8}, "break_at": {"time": 0.2},
            "connections": {"start": {"tangent": [1, 0, 0]}, "end": {"tangent": [0, 0, -1]}}}  # fmt: skip
    more = {"time": {"duration": 0.6, "step": 0.01}, "output": {"every": 0.05, "points": 9}, "lines": {"l": line}}
    at = {"a": {"position": [0, 0, 0]}}
    body = {
        "bodies": {"hull": {"position": [2.5, 0, 0]}},
        "points": at | {"b": {"body": "hull", "place": [0, 0, -2.5]}},
    }
    both = [hybrid.run(more | x) for x in ({"points": at | {"b": {"position": [2.5, 0, -2.5]}}}, body)]
    one, two = (x.lines["l"] for x in both)
    lost, also = (next(x.energy for x in r.events if x.kind == "end released") for r in both)
    assert lost < -0.1 and also == pytest.approx(lost, rel=1e-6)
    assert np.linalg.norm(one.position[-1, -1] - one.position[0, -1]) > 0.1
    assert np.abs(one.position - two.position).max() < 1e-7
    assert two.bending_moment[5, -1] == 0.0 < one.bending_moment[4, -1]  # at the break: of the moment before
    assert np.abs(one.bending_moment - two.bending_moment).max() < 1e-9 * one.bending_moment.max()
    assert np.abs(one["energy/kinetic"] - two["energy/kinetic"]).max() < 1e-9 * one["energy/kinetic"].max()
    assert np.abs(one["work/end"] - two["work/end"]).max() < 1e-9 * one["energy/kinetic"].max()
    for x in both:
        assert np.abs(x["points/b/moment"][-1]).max() == 0.0 < np.abs(x["points/b/moment"][0]).max()


def test_a_mooring_of_a_body_breaks() -> None:
    """A body on two lines keeps the momentum that the other line gives it, and its fairlead goes on with it."""
    bodies = {"float": {"initial_guess": [0, 0, -8], "mass": 40.0, "inertia": [4.0, 4.0, 4.0]}}
    points = {
        "left": {"position": [-8, 0, 0]}, "right": {"position": [8, 0, 0]},
        "port": {"body": "float", "place": [-0.3, 0, 0.2], "break_at": {"time": 0.5}},
        "starboard": {"body": "float", "place": [0.3, 0, 0.2]},
    }  # fmt: skip
    lines = {
        "a": line_between("left", "port", SECTION_BREAK, mesh=12),
        "b": line_between("starboard", "right", SECTION_BREAK, mesh=12, break_at={"time": 0.8, "end": "start"}),
    }
    time = {"duration": 1.2, "step": 0.01}
    made = {"points": points, "bodies": bodies, "lines": lines, "time": time}
    with hybrid.run(made) as result:
        force = result["bodies/float/force"]
        assert np.abs(force[result.t > 0.8 + 1e-9]).max() < 1e-9
        v = result["bodies/float/velocity"]
        fall = v[-1, 2] - v[np.argmin(np.abs(result.t - 0.9)), 2]
        assert fall == pytest.approx(-9.81 * (result.t[-1] - 0.9), abs=1e-9)
        arm = result["points/starboard/position"][-1] - result["bodies/float/position"][-1]
        assert np.linalg.norm(arm) == pytest.approx(np.hypot(0.3, 0.2), abs=1e-9)
        assert [x.t for x in result.events if x.kind == "end released"] == [0.5, 0.8]


@pytest.mark.long
@pytest.mark.parametrize("times", [(0.625, 0.75), (0.6267, 0.7567)])  # between two steps of 1/64 s, too
def test_a_line_breaks_after_the_end_of_a_run_that_is_continued(tmp_path: Path, times: tuple[float, float]) -> None:
    """Lines and points that break at times behind the end of a run, which goes on as the longer run, bit for bit."""
    short, whole = tmp_path / "short.h5", tmp_path / "whole.h5"
    breaks = {"b": {"break_at": {"time": times[0]}}}, {"left": {"break_at": {"time": times[1]}}}
    more: dict[str, Any] = {"output": {"every": 0.25}}
    hybrid.run(scene_break(*breaks, time={"duration": 1.0, "step": 1 / 64}, **more), whole).close()
    hybrid.run(scene_break(*breaks, time={"duration": 0.5, "step": 1 / 64}, **more), short).close()
    hybrid.resume(short, until=1.0).close()
    assert [x for x in differences(whole, short) if not x.endswith("/scene")] == []  # each says its duration
    with hybrid.open(short) as result:
        assert [x.t for x in result.events if x.kind == "end released"] == [*times]


@pytest.mark.parametrize(
    ("lines", "points", "words"),
    [
        ({"a": {"break_at": {}}}, {}, "time or tension"),
        ({"a": {"break_at": {"time": 1.0}}, "b": {"break_at": {"time": 1.0, "end": "start"}}}, {}, "carries what is left"),
        ({}, {"weight": {"break_at": {"time": 1.0}}}, "break_at"),
    ],
)  # fmt: skip
def test_what_cannot_break_is_refused(lines: dict[str, Any], points: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError) as refused:
        hybrid.run(scene_break(lines, points))
    assert words in str(refused.value)


def test_a_point_is_where_it_was_after_a_line_has_left_it() -> None:
    """Stepped from outside: `point` had the place of the end that fell."""
    rod = {"length": 5.5, "mass": 1.0, "axial_stiffness": 1e5, "bending_stiffness": 5.0}
    line = {"sections": [rod], "model": "rod", "mesh": {"cells": 10}}
    scene = {
        "points": {"A": {"position": [0, 0, 0]}, "B": {"position": [5, 0, 0]}, "G": {"position": [-5, 0, 0]}},
        "lines": {
            "p": line | {"start": "A", "end": "B"},
            "v": line | {"start": "G", "end": "A", "break_at": {"time": 0.1, "end": "end"}},
        },
        "time": {"duration": 0.4, "step": 0.02},
    }
    with hybrid.Simulation(scene) as sim:
        sim.advance(0.4)
        assert np.abs(sim.line("v").position[-1]).max() > 0.1
        assert not np.concatenate(sim.point("A")[:2]).any()


@pytest.mark.parametrize("order", ["ab", "ba"])
def test_lines_that_bear_too_much_after_one_step_break_after_it(order: str) -> None:
    """A weight on two like ropes and a slack one: the first named broke alone, and swung the weight to its other side."""
    rope = SECTION | {"length": 50.2, "mass": 2.0, "axial_stiffness": 1e6, "bending_stiffness": 100.0}
    lines = {x: line_between(x, "m", rope, mesh=10, model="rod", break_at={"tension": 4000}) for x in order}
    pull = {"history": [[0, 0, 0, 0], [1, 0, 0, -8000]]}
    found = hybrid.run(network_scene(
        {"a": {"position": [-30, 0, 0]}, "b": {"position": [30, 0, 0]}, "c": {"position": [0, 0, 5]},
         "m": {"kind": "free", "initial_guess": [0, 0, -40], "mass": 200, "force": pull}},
        lines | {"c": line_between("c", "m", rope | {"length": 80.0}, mesh=10, model="rod")},
        contact={"between": []}, time=(0.6, 0.02), output=(0.1, 11)
    ))  # fmt: skip
    (when,) = {x.t for x in found.events if x.kind == "end released"}
    assert 0.3 < when < 0.6 and np.abs(found.lines["c"].position[-1, -1, 0]) < 1e-9


def falling(breaks: bool) -> dict[str, Any]:
    """A line that falls on another one with its free end, which a point has held or not."""
    bar = {"length": 2.0, "mass": 1.0, "diameter": 0.05, "axial_stiffness": 1e5, "bending_stiffness": 5.0}
    tip: dict[str, Any] = {"kind": "free", "initial_guess": [0.3, 0.1, 0.3]}
    if breaks:
        tip = {"position": [0.3, 0.1, 0.3], "break_at": {"time": 0.001}}
    ways: dict[str, Any] = {"A": [[0.3, -1.9, 0.3], [0.3, 0.1, 0.3]], "B": [[0, 0, 0], [2, 0, 0]]}
    lines = {
        name: line_between(*ends, bar | {"length": length}, mesh=10, initial={"kind": "points", "points": ways[name]})
        for name, ends, length in (("A", "ab", 2.0), ("B", "cd", 1.99))
    }
    points = {"a": {"position": ways["A"][0]}, "b": tip} | {
        x: {"position": y} for x, y in zip("cd", ways["B"], strict=True)
    }
    return network_scene(points, lines, contact={}, time=(0.35, 0.001), output=0.05)


@pytest.mark.long
def test_a_loose_end_touches_beside_where_others_are_held() -> None:
    """It went through, as one that is held there."""
    loose, free = (hybrid.run(falling(x)) for x in (True, False))
    assert [x.kind for x in loose.events] == ["end released", "lines touch"]
    assert loose.lines["A"].position[-1, -1, 2] == pytest.approx(free.lines["A"].position[-1, -1, 2], abs=0.01)


def test_layers_of_a_clamp_that_lets_go_do_no_work_any_more() -> None:
    """They slipped back to nothing: 1.4 J of loss, which the scheme was said to create."""
    rod = SECTION | {"mass": 3, "axial_stiffness": 1e6, "bending_stiffness": 300, "torsional_stiffness": 200,
                     "bending_slip": [{"stiffness": 500, "moment": 20}]}  # fmt: skip
    end = clamped_at([8, 0, 0], [1, 0, 0.4], bend_stiffness=200, release_at={"time": 0.1})
    start = clamped_at([0, 0, 0], [1, 0, -0.5])
    found = hybrid.run(cable_scene(rod, start, end, model="rod", mesh=40, time=(0.14, 0.0005), output={"every": 0.02}))
    assert np.abs(found["work/scheme"]).max() < 0.02
