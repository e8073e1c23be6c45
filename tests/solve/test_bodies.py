"""Rigid bodies among lines: what nothing turns, periods of free decay, and equilibria against closed forms."""

from __future__ import annotations

import io
import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import Outcome, SceneError
from hybrid.kernels.junctions import bodies as k
from hybrid.model.bodies import angles_of, body_model, frame_of
from hybrid.scene.bodies import FreeBody
from hybrid.simulation.run import new_run
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import NetworkState
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

LEG = {"mass": 0.05, "diameter": 0.002, "axial_stiffness": 5e6}
MASS, ADDED, HEAVE = 5e5, (2e5, 2e5, 3e5, 2e6, 2e6, 1e6), 8e5


def moored(**body: Any) -> dict[str, Any]:
    """A cylinder that floats on three light, tight lines."""
    tables: dict[str, Any] = {"environment": {"fluid": {"density": 1025}}, "points": {}, "lines": {}}
    length = 0.99 * math.hypot(95, 56)
    for name, angle in (("a", 0.0), ("b", 2 * math.pi / 3), ("c", -2 * math.pi / 3)):
        x, y = math.cos(angle), math.sin(angle)
        tables["points"] |= {
            name: {"position": [100 * x, 100 * y, -60]},
            f"on_{name}": {"body": "buoy", "place": [5 * x, 5 * y, -4]},
        }
        ends = (f"on_{name}", name) if name == "b" else (name, f"on_{name}")
        tables["lines"][name] = line_between(ends[0], ends[1], LEG | {"length": length}, mesh=10)
    tables["bodies"] = {
        "buoy": {
            "initial_guess": [0, 0, 0], "mass": MASS, "inertia": [8e6, 8e6, 6e6], "added_mass": list(ADDED),
            "hydrostatics": {"heave": HEAVE, "roll": 2e7, "pitch": 2e7},
        } | body
    }  # fmt: skip
    return tables


def decay(axis: int, size: float, step: float, duration: float) -> tuple[hybrid.Result, float]:
    """A run after a load that is let go at once, and the stiffness (N/m) from equilibria beside it."""
    places = []
    for sign in (1.0, -1.0):
        load = [sign * size * (i == axis) for i in range(3)]
        places.append(hybrid.static(moored(force=load))["bodies/buoy/position"][-1, axis])
    load = {"value": [size * (i == axis) for i in range(3)], "until": step}
    time = {"time": {"duration": duration, "step": step, "rho_inf": 0.9}, "output": {"every": step}}
    return hybrid.run(moored(force=load) | time), 2.0 * size / (places[0] - places[1])


def period(result: hybrid.Result, axis: int) -> float:
    x = result["bodies/buoy/position"][:, axis]
    x, t = x - x.mean(), result.times
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    crossings = t[up] - x[up] * (t[up + 1] - t[up]) / (x[up + 1] - x[up])
    assert crossings.size > 4
    return float(np.diff(crossings).mean())


def energy_error(result: hybrid.Result) -> float:
    """Largest error of the balance of the body's energy against its largest kinetic energy."""
    part = {key: result[f"bodies/buoy/{key}"] for key in
            ("energy/kinetic", "energy/potential", "work/lines", "work/damping", "work/loads")}  # fmt: skip
    left = part["energy/kinetic"] + part["energy/potential"]
    left = left - part["work/lines"] - part["work/damping"] - part["work/loads"]
    return float(np.abs(left - left[0]).max() / part["energy/kinetic"].max())


@pytest.mark.long
def test_free_decay_in_heave_has_the_period_of_mass_and_stiffness_and_energy_of_order_two() -> None:
    errors, energies = [], []
    for step in (0.08, 0.04):
        result, stiffness = decay(2, 2e4, step, 32.0)
        assert stiffness > 1.02 * HEAVE  # the lines carry a part
        exact = 2.0 * math.pi * math.sqrt((MASS + ADDED[2]) / stiffness)
        errors.append(period(result, 2) / exact - 1.0)
        energies.append(energy_error(result))
    assert abs(errors[1]) < 2e-4 and 3.0 < errors[0] / errors[1] < 5.0
    assert energies[1] < 1e-4 and 3.0 < energies[0] / energies[1] < 5.0


def test_free_decay_in_surge_has_the_period_of_the_stiffness_of_the_lines() -> None:
    result, stiffness = decay(0, 2e4, 0.1, 140.0)
    exact = 2.0 * math.pi * math.sqrt((MASS + ADDED[0]) / stiffness)
    assert abs(period(result, 0) / exact - 1.0) < 5e-4
    assert np.abs(result["bodies/buoy/rotation"][:, 1]).max() > 1e-3  # the lines pull below the centre
    assert energy_error(result) < 1e-3


def test_damping_takes_the_energy_that_it_says() -> None:
    """Critical damping of heave: the body comes back without passing its place."""
    damping = [0, 0, 2.0 * math.sqrt(HEAVE * (MASS + ADDED[2])), 0, 0, 0]
    load = {"value": [0, 0, 2e4], "until": 0.02}
    time = {"time": {"duration": 20.0, "step": 0.02}, "output": {"every": 0.1}}
    result = hybrid.run(moored(force=load, damping=damping) | time)
    z = result["bodies/buoy/position"][:, 2]
    still = hybrid.static(moored())["bodies/buoy/position"][-1, 2]
    assert z[0] - still > 0.02 and abs(z[-1] - still) < 1e-3 * (z[0] - still)
    assert z.min() > still - 1e-3 * (z[0] - still)
    assert result["bodies/buoy/work/damping"][-1] < 0.0 and energy_error(result) < 1e-3


# --- rotations -----------------------------------------------------------------------------------------


def spun(rho: float, steps: int) -> tuple[NetworkSolver, NetworkState, list[np.ndarray]]:
    """A torque-free body that tumbles about its middle axis, beside a line that it does not touch."""
    run = new_run(hybrid.Scene.model_validate(moored()), io.BytesIO(), "", moves=False)
    x = run.found.solver.lines[0]
    ends = x.ends._replace(held=np.ones(2, np.int8), position=run.found.state.lines[0].r[[0, -1]])
    held = x._replace(joints=(-1, -1), ends=ends)
    body = FreeBody(initial_guess=(0, 0, 0), mass=4.0, inertia=(1.0, 2.0, 3.0), centre=(0.2, 0.1, -0.3))
    solver = NetworkSolver([held], 0, body_model("stone", body, 0.0, 0.0).numbers[None])
    state = NetworkState([run.found.state.lines[0].copy()], run.found.state.bodies.copy())
    state.bodies[0, k.V : k.V + 3], state.bodies[0, k.W : k.W + 3] = [0.3, -0.2, 0.1], [0.2, 1.5, 0.1]
    assert solver.consistent_accelerations(state, [np.zeros((2, 3))]).outcome == Outcome.OK
    new, dt, before, momenta = state.copy(), 2.0 / steps, 0.0, []
    for _ in range(steps + 1):
        row = state.bodies[0]
        R, v, w = row[k.FRAME : k.V].reshape(3, 3), row[k.V : k.V + 3], row[k.W : k.W + 3]
        p = solver.bodies[0, k.MASS : k.MASS + 36].reshape(6, 6) @ np.concatenate([R.T @ v, w])
        r = row[k.PLACE : k.FRAME]
        energy = 0.5 * p @ np.concatenate([R.T @ v, w])
        momenta.append(np.concatenate([R @ p[:3], R @ p[3:] + np.cross(r, R @ p[:3]), [energy]]))
        assert solver.step(state, new, dt, rho, before, rho).outcome == Outcome.OK
        state, new, before = new, state, dt
    return solver, state, momenta


@pytest.mark.parametrize("rho", [1.0, 0.8])
def test_a_body_that_nothing_turns_keeps_momentum_and_energy_to_second_order(rho: float) -> None:
    errors = []
    for steps in (50, 100, 200):
        _, _, momenta = spun(rho, steps)
        drift = np.abs(np.array(momenta) - momenta[0]).max(axis=0)
        errors.append(drift)
    big = np.abs(momenta[0]).max()
    assert np.abs(errors[-1]).max() < 2e-3 * big
    for coarse, fine in pairwise(errors):
        assert 3.3 < coarse[3:6].max() / fine[3:6].max() < 4.7  # angular
        assert 3.3 < coarse[6] / fine[6] < 4.9  # energy


def test_angles_are_those_of_the_frame() -> None:
    angles = (20.0, -35.0, 110.0)
    R = frame_of(angles)
    assert np.abs(R.T @ R - np.eye(3)).max() < 1e-15 and np.linalg.det(R) > 0.0
    assert np.abs(angles_of(R) - angles).max() < 1e-12


# --- equilibria ----------------------------------------------------------------------------------------


def test_a_heavy_plate_hangs_on_two_lines_with_its_centre_below() -> None:
    """A body on one line hangs with its centre of mass under the fairlead; its weight is the tension of the line."""
    tables = {
        "points": {"up": {"position": [0, 0, 0]}, "eye": {"body": "plate", "place": [0.3, 0.1, 0.5]}},
        "lines": {"wire": {"start": "up", "end": "eye", "sections": [{"length": 10, "mass": 0.1}], "mesh": {"cells": 6}}},
        "bodies": {"plate": {"initial_guess": [1, 0.5, -9], "initial_rotation": [20, 10, 0], "mass": 50.0,
                             "inertia": [4, 5, 6], "centre": [-0.2, 0.1, 0.0]}},
    }  # fmt: skip
    result = hybrid.static(tables)
    R = frame_of(tuple(result["bodies/plate/rotation"][-1]))
    hanging = R @ (np.array([-0.2, 0.1, 0.0]) - [0.3, 0.1, 0.5])
    assert np.abs(hanging[:2]).max() < 1e-6 and hanging[2] < 0.0
    assert np.abs(result["points/eye/position"][-1] - [0, 0, -10]).max() < 1e-6
    weight = 9.81 * 50.0
    force = result["points/eye/force"][-1]
    assert abs(force[2] / weight - 1.0) < 2e-3 and np.abs(result["bodies/plate/force"][-1] - force).max() < 1e-9
    moment = np.cross(result["points/eye/position"][-1] - result["bodies/plate/position"][-1], force)
    assert np.abs(result["bodies/plate/moment"][-1] - moment).max() < 1e-9 * weight


def test_a_mooring_without_symmetry_balances_whatever_the_guess() -> None:
    """From guesses 20 m and 25 degrees apart: one equilibrium, to what Newton leaves."""
    found = []
    for guess, turns in (([0, 0, 0], [0, 0, 0]), ([12, -9, 6], [20, -10, 25])):
        result = hybrid.static(
            moored(initial_guess=guess, initial_rotation=turns, force=[5e4, 2e4, 0], moment=[0, 0, 5e4])
        )
        found.append(np.concatenate([result[f"bodies/buoy/{key}"][-1] for key in ("position", "rotation")]))
    assert np.abs(found[0][5]) > 0.1
    assert np.abs(found[0] - found[1]).max() < 1e-6


# --- stiffness -----------------------------------------------------------------------------------------


def turn_between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Small turn (3,) rad from roll, pitch and yaw (deg) to others."""
    E = frame_of(tuple(after)) @ frame_of(tuple(before)).T
    return 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])


def test_stiffness_of_a_free_body_against_differences_of_equilibria() -> None:
    """K times what a small load moves is that load, for each of six, about an equilibrium without symmetry."""
    load, size = np.array([5e4, 2e4, -1e4, 1e5, -8e4, 5e4]), np.array([2e2, 2e2, 2e2, 2e3, 2e3, 2e3])

    def scene(loads: np.ndarray) -> dict[str, Any]:
        return moored(force=loads[:3].tolist(), moment=loads[3:].tolist())

    found = hybrid.stiffness(scene(load), "body:buoy")
    assert found.rotation is not None and np.abs(found.rotation).max() > 0.1
    for i in range(6):
        there = []
        for sign in (1.0, -1.0):
            result = hybrid.static(scene(load + sign * size[i] * (np.arange(6) == i)))
            there.append([result[f"bodies/buoy/{key}"][-1] for key in ("position", "rotation")])
        moved = np.concatenate([there[0][0] - there[1][0], turn_between(there[1][1], there[0][1])])
        needed = found.matrix @ moved
        assert np.abs(needed[:3] - 2.0 * size[i] * (np.arange(3) == i)).max() < 1e-4 * 2e3
        assert np.abs(needed[3:] - 2.0 * size[i] * (np.arange(3, 6) == i)).max() < 1e-4 * 2e4
    own = found.matrix - found.lines
    assert abs(own[2, 2] - HEAVE) < 1.0 and abs(own[3, 3] / 2e7 - 1.0) < 1e-2


@pytest.mark.parametrize("at", ["point:a", "body:buoy", "point:knot"])
def test_stiffness_of_what_is_held_or_joined_against_differences(at: str) -> None:
    tables = moored()
    tables["points"]["knot"] = {"initial_guess": [60, 5, -20], "mass": 30}
    section = LEG | {"length": 70, "mass": 2.0, "diameter": 0.02}
    tables["lines"]["tie"] = {"start": "a", "end": "knot", "sections": [section], "mesh": {"cells": 8}}
    tables["lines"]["tail"] = {"start": "knot", "end": "on_a", "sections": [section], "mesh": {"cells": 8}}
    if at == "body:buoy":
        tables["bodies"]["buoy"] = {"position": [1.0, 0.5, 0.2], "rotation": [2, 3, 10]}
    found = hybrid.stiffness(tables, at)
    name, size, step = at.partition(":")[2], found.matrix.shape[0], 1e-3
    if at == "point:knot":  # by forces on it
        C = np.zeros((3, 3))
        for i in range(3):
            there = []
            for sign in (1.0, -1.0):
                tables["points"]["knot"]["force"] = (sign * (np.arange(3) == i)).tolist()
                there.append(hybrid.static(tables)["points/knot/position"][-1])
            C[:, i] = 0.5 * (there[0] - there[1])
        assert np.abs(found.matrix @ C - np.eye(3)).max() < 1e-4
        return
    table = tables["points" if size == 3 else "bodies"][name]
    place = np.array(table["position"], float)
    for i in range(3):  # by shifts, and what the lines then do
        there = []
        for sign in (1.0, -1.0):
            table["position"] = (place + sign * step * (np.arange(3) == i)).tolist()
            result = hybrid.static(tables)
            keys = ("force",) if size == 3 else ("force", "moment")
            group = "points" if size == 3 else "bodies"
            there.append(np.concatenate([result[f"{group}/{name}/{key}"][-1] for key in keys]))
        change = -(there[0] - there[1]) / (2.0 * step)
        assert np.abs(found.matrix[:, i] - change).max() < 1e-4 * np.abs(found.matrix).max()


def test_offsets_are_equilibria_beside_the_place() -> None:
    curve = hybrid.offsets(moored(), "body:buoy", [-1.0, 0.0, 1.0], heading=0.0)
    stiff = hybrid.stiffness(moored(), "body:buoy").lines
    assert abs(curve.restoring[1]) < 1e-3 and curve.restoring[2] > 0.0 > curve.restoring[0]
    slope = (curve.restoring[2] - curve.restoring[0]) / 2.0
    assert abs(slope / stiff[0, 0] - 1.0) < 0.02
    assert set(curve.tension) == {"a", "b", "c"} and curve.tension["a"][0] > curve.tension["a"][2]
    there = hybrid.static(moored())  # the largest tension is that of an end, above that of any cell
    for name in curve.tension:
        assert curve.tension[name][1] == pytest.approx(there.lines[name].tension[-1].max(), rel=1e-9)
    assert curve.moment is not None and curve.moment.shape == (3, 3)
    with pytest.raises(SceneError, match="body:buoy"):
        hybrid.stiffness(moored(), "body:boy")
    with pytest.raises(SceneError, match="write body:buoy"):
        hybrid.offsets(moored(), "point:on_a", [1.0])


def test_an_end_of_a_cable_is_a_point() -> None:
    """Its stiffness is the slope of the force at offsets, of an end that is held; it is in a plane."""
    tables = cable_scene(
        {"length": 12.0, "mass": 2.0, "axial_stiffness": 1e4}, pinned_at(0, 0, 0), pinned_at(9, 0, 2), model="catenary",
        mesh=40
    )  # fmt: skip
    curve, found = hybrid.offsets(tables, "point:end", [-1e-3, 1e-3]), hybrid.stiffness(tables, "point:end").matrix
    assert (curve.restoring[1] - curve.restoring[0]) / 2e-3 == pytest.approx(found[0, 0], rel=1e-6)
    assert curve.tension["cable"][1] == pytest.approx(154.45, abs=0.01) and found[1, 1] > 0.0
    with pytest.raises(SceneError, match="point:start, point:end"):
        hybrid.offsets(tables, "body:buoy", [1.0])


# --- bodies whose motion is known ----------------------------------------------------------------------


def test_fairleads_of_a_body_that_turns_move_with_it() -> None:
    tables = moored()
    motion = {"pitch": {"amplitude": 4, "period": 9}, "heave": {"amplitude": 1, "period": 9, "phase": 40}, "ramp": 9}
    tables["bodies"]["buoy"] = {"position": [0, 0, 0], "rotation": [0, 0, 10], "motion": motion}
    tables |= {"time": {"duration": 12, "step": 0.1}, "output": {"every": 1.0}}
    result = hybrid.run(tables)
    for name, place in (("on_a", [5, 0, -4]), ("on_b", tables["points"]["on_b"]["place"])):
        for row in range(len(result.times)):
            R = frame_of(tuple(result["bodies/buoy/rotation"][row]))
            expected = result["bodies/buoy/position"][row] + R @ place
            assert np.abs(result[f"points/{name}/position"][row] - expected).max() < 1e-9
    assert np.abs(result["bodies/buoy/rotation"][:, 1]).max() > 2.0
    total = sum(result[f"points/on_{x}/force"] for x in "abc")
    assert np.abs(result["bodies/buoy/force"] - total).max() < 1e-9 * np.abs(total).max()


def test_waves_leave_an_event_of_bodies_on_which_they_do_not_act() -> None:
    tables = moored()
    waves = {"kind": "regular", "height": 1.0, "period": 7.0, "ramp": 2.0}
    tables["environment"]["fluid"] |= {"surface": 0.0, "waves": waves}
    result = hybrid.run(tables | {"time": {"duration": 1.0, "step": 0.1}})
    assert [e.text for e in result.events if e.kind == "waves on body neglected"]


@pytest.mark.parametrize(
    ("change", "where", "says"),
    [
        ({"hydrostatics": {"heave": -1}}, "bodies.buoy.hydrostatics.heave", ">= 0"),
        ({"volume": 3.0}, "bodies.buoy.volume", "hydrostatics holds"),
        ({"inertia": [1, 2]}, "bodies.buoy.inertia", "three numbers"),
        ({"added_mass": [1, 2, 3]}, "bodies.buoy.added_mass", "six"),
        ({"added_mass": [-6e5, 0, 0, 0, 0, 0]}, "bodies.buoy.added_mass", "inertia to every motion"),
        ({"damping": [-1, 0, 0, 0, 0, 0]}, "bodies.buoy.damping", "takes energy"),
        ({"initial_gues": [0, 0, 0]}, "bodies.buoy.initial_gues", "did you mean initial_guess"),
        ({"force": {"value": [0, 0, 1], "until": -1}}, "bodies.buoy.force.until", "> 0"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_body_is_refused_in_its_place(change: dict[str, Any], where: str, says: str) -> None:
    with pytest.raises(SceneError) as refused:
        hybrid.static(moored(**change))
    found = {x.where: x.text() for x in refused.value.complaints}
    assert where in found and says in found[where], str(refused.value)


def test_bodies_and_fairleads_that_do_not_fit_are_refused() -> None:
    tables = moored()
    tables["points"]["on_a"]["body"] = "bouy"
    with pytest.raises(SceneError, match=r"points\.on_a\.body[\s\S]*did you mean buoy"):
        hybrid.static(tables)
    tables = moored()
    tables["bodies"]["ship"] = {"position": [0, 0, 0]}
    with pytest.raises(SceneError, match=r"bodies\.ship[\s\S]*fairlead"):
        hybrid.static(tables)
    tables = moored()
    tables["environment"] = {}
    with pytest.raises(SceneError, match="a fluid, because body buoy has hydrostatics"):
        hybrid.static(tables)
    tables = moored()
    motion = {"roll": {"amplitude": 4, "period": 9}}
    tables["bodies"]["buoy"] = {"position": [0, 0, 0], "motion": motion}
    with pytest.raises(SceneError, match=r"bodies\.buoy\.motion[\s\S]*ramp"):
        hybrid.static(tables)


def test_a_submerged_body_that_rises_out_of_the_water_is_noted() -> None:
    """All of its buoyancy acts wherever it is: 10 m3 of 2 t are above the surface at the equilibrium."""
    line = {"sections": [{"length": 60, "mass": 10, "diameter": 0.05, "axial_stiffness": 1e7}]}
    scene = network_scene(
        {"a": {"position": [20, 0, -40]}, "b": {"position": [-20, 0, -40]},
         "to_a": {"body": "buoy", "place": [1, 0, 0]}, "to_b": {"body": "buoy", "place": [-1, 0, 0]}},
        {"one": {"start": "a", "end": "to_a"} | line, "two": {"start": "b", "end": "to_b"} | line},
        fluid={"density": 1025, "surface": 0},
        bodies={"buoy": {"initial_guess": [0, 0, 0], "mass": 2000, "inertia": [1e3, 1e3, 1e3], "volume": 10}}
    )  # fmt: skip
    result = hybrid.static(scene)
    assert result["bodies/buoy/position"][0, 2] > 0.0
    (event,) = [x for x in result.events if x.kind == "body out of water"]
    assert "buoyancy" in event.text


def hull_on_lines(step: float, turned: bool, at: list[float]) -> dict:
    """Lines are written to the hull, or turned, from it; at: m, where the origin of the scene lies."""
    hull = {"kind": "free", "initial_guess": [38, -8, -5], "mass": 900.0, "inertia": [350, 400, 380], "volume": 2.6}
    hull |= {"centre": [0, 0, -0.4], "centre_of_buoyancy": [0, 0, 0.4], "added_mass": [500, 550, 600, 60, 80, 40]}
    points = {"A": {"position": [0, 0, -40]}, "B": {"position": [75, 12, -40]}, "C": {"position": [35, -50, -38]}}
    points["A"]["motion"] = {"surge": {"amplitude": 0.3, "period": 5.0}, "ramp": 2.0}
    places = {"U": [0.5, 0.3, -0.6], "V": [-0.5, 0.3, -0.6], "W": [0, -0.6, -0.5]}
    points |= {name: {"body": "hull", "place": x} for name, x in places.items()}
    lines = {}
    for name, a, b, length in (("a", "A", "U", 55.0), ("b", "B", "V", 54.0), ("c", "C", "W", 58.0)):
        section = {"mass": 4.0, "diameter": 0.05, "length": length}
        a, b = (b, a) if turned else (a, b)
        lines[name] = {"start": a, "end": b, "sections": [section], "mesh": {"cells": 20}, "model": "catenary"}
    for place in (
        x
        for table in (points["A"], points["B"], points["C"], hull)
        for x in (table.get("position"), table.get("initial_guess"))
    ):
        if place:
            place[:] = [x + y for x, y in zip(place, at, strict=True)]
    time, output = {"duration": 20 * step, "step": step}, {"every": 5 * step, "points": 9}
    around = {"fluid": {"density": 1025.0}}
    return {
        "environment": around,
        "points": points,
        "bodies": {"hull": hull},
        "lines": lines,
        "time": time,
        "output": output,
    }


@pytest.mark.parametrize("turned", [False, True])
def test_short_steps_of_a_body_on_lines_in_map_coordinates(turned):
    here, there = (hybrid.run(hull_on_lines(2e-3, turned, x)) for x in ([0, 0, 0], [5e5, 6e6, 0]))
    for name in "abc":
        a, b = (float(x.lines[name].envelope["tension_max"].max()) for x in (here, there))
        assert b == pytest.approx(a, rel=5e-4)
