"""Held ends that are let go in mid-motion: what is conserved from there on, events, resumed runs, steps taken back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences, went_on

import hybrid
from tests.problems import tables_with
from tests.scenes import cable_scene, clamped_at, pinned_at

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


def masses() -> np.ndarray:
    out = np.full(21, 10.0 / 20)
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


CASES = {
    "tension": (pinned(motion=HEAVE, release_at={"tension": 150.0}), {}),
    "clamp, adaptive": (CLAMP | {"release_at": {"time": 0.55}}, {"model": "adaptive"}),
    "errors": (pinned(release_at={"time": 0.5}), {"output": {"every": 0.1, "errors": True}}),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_a_stopped_run_goes_on_bit_for_bit(name: str, tmp_path: Path, monkeypatch) -> None:
    """Stopped before, near and after the release."""
    end, changes = CASES[name]
    made, stopping = scene(end, **changes), Stopping(monkeypatch)
    with hybrid.run(made, tmp_path / "whole.h5", progress=stopping) as result:
        t = next(e.t for e in result.events if e.kind == "end released")
        at = int(np.searchsorted(result.steps["t"], t))
    stops = np.diff([0, at // 2, at, at + 1, at + 2, at + 30]).tolist()
    assert went_on(made, tmp_path / "run.h5", stopping, stops) == len(stops)
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


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
