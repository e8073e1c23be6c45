"""Obstacles that move, turn and are set from outside: capstans, running ropes, conveyors, frames of reference, energy.

Friction acts on the centreline (docs/theory.md), so that exponents are those of the angle alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from tests.scenes import cable_scene, pinned_at
from tests.validation.obstacle_scenes import CENTRELINE, STRAND, Tables, capstan, half_turn

MU = 0.3


# --- drums that turn, ropes that run -------------------------------------------------------------------


@pytest.fixture(scope="module", params=["catenary", "rod"])
def driven(request: pytest.FixtureRequest) -> Any:
    """A drum turns under a rope that is held at one end and pulled at the other by 10 N."""
    tables = capstan(MU, 10.0, request.param)
    tables["ends"]["end"]["force"] = [0, 0, -10.0]
    tables["obstacles"]["drum"]["spin"] = {"rate": -1.0, "ramp": 0.3}
    tables["time"]["duration"] = 1.0
    return hybrid.run(tables)


def test_a_driven_drum_pulls_by_the_exponential_of_the_angle(driven: Any) -> None:
    """T2/T1 = e^(mu phi) against the way in which the drum turns; on the drum acts their difference, at its radius."""
    T = driven.tension[-1]
    assert np.log(T[0] / T[-1]) / (MU * np.pi) == pytest.approx(-1.0, abs=0.01)
    assert T[-1] == pytest.approx(10.0, rel=1e-3)
    moment = driven["obstacles/drum/moment"][-1]
    assert moment[1] == pytest.approx((T[-1] - T[0]) * CENTRELINE, rel=2e-3)
    assert driven["obstacles/drum/force"][-1, 2] == pytest.approx(-(T[-1] + T[0]), rel=2e-3)
    np.testing.assert_allclose(moment[[0, 2]], 0.0, atol=1e-6)


def test_the_work_of_a_driven_drum_is_booked(driven: Any) -> None:
    """Its moment times its turn, all of which friction takes; a thousandth is left to the elastic travel."""
    moment, done = -driven["obstacles/drum/moment"][:, 1], driven["work/obstacles"]
    late = driven.times > 0.6
    power = np.gradient(done[late], driven.times[late])
    np.testing.assert_allclose(power, moment[late] * -1.0, rtol=2e-3)
    assert driven["work/friction"][-1] == pytest.approx(-done[-1], rel=0.05)
    assert np.abs(driven["work/scheme"]).max() < 1e-4 * done[-1]


def running(v: float, spin: float = 0.0) -> Tables:
    """A rope that is pulled over half a drum at v, m/s, its other end under 10 N."""
    tables = capstan(MU, 10.0)
    section = tables["cable"]["sections"][0]
    section |= {"length": 4.0 + np.pi * CENTRELINE, "damping": {"stiffness": 1e-3}}
    tables["ends"] = {
        "start": pinned_at(-CENTRELINE, 0, -0.5, motion={"velocity": [0, 0, -v], "ramp": 0.3}),
        "end": {"kind": "free", "force": [0, 0, -10.0]},
    }
    tables["initial"] = {"kind": "equilibrium", "points": half_turn(CENTRELINE, 0.5, 3.5)}
    if spin:
        tables["obstacles"]["drum"]["spin"] = {"rate": spin, "ramp": 0.3}
    tables["mesh"], tables["time"] = {"cells": 240}, {"duration": 0.8, "step": 0.005}
    tables["output"] = {"every": 0.01, "points": 101}
    return tables


@pytest.mark.parametrize("spin", [0.0, 3.0])
def test_a_rope_that_runs_over_a_drum_carries_its_centrifugal_tension(spin: float) -> None:
    """(T2 - m v^2)/(T1 - m v^2) = e^(mu phi), the drum at rest or turning against the rope."""
    v, m = 5.0, 0.1
    result = hybrid.run(running(v, spin))
    late = result.times > 0.5  # it has swung along itself since it began to run
    light, heavy = result.tension[late, -1].mean(), result.tension[late, 0].mean()
    over = (heavy - m * v**2) / (light - m * v**2)
    assert np.log(over) / (MU * np.pi) == pytest.approx(1.0, abs=0.01)
    assert heavy / light < 0.87 * np.exp(MU * np.pi)  # which it would be of a rope that does not run


def conveyor(**more: Any) -> Tables:
    """A rope at rest on a floor that begins to move along itself."""
    floor = {"kind": "plane", "at": [0, 0, 0], "normal": [0, 0, 1], "friction": MU, "damping": 100.0,
             "motion": {"velocity": [1.0, 0.5, 0], "ramp": 0.05}}  # fmt: skip
    section = {"length": 1.0, "mass": 0.2, "diameter": 0.02, "axial_stiffness": 1e3, "bending_stiffness": 0.02}
    return cable_scene(
        section, "free", "free", obstacles={"floor": floor},
        initial={"kind": "straight", "direction": [1, 0, 0], "origin": [0, 0, 0.01]}, model="rod", mesh=20,
        contact={"self": False}, time=(0.6, 0.002), output=(0.02, 21)
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def carried() -> Any:
    return hybrid.run(conveyor())


def test_a_floor_that_moves_carries_a_rope_along(carried: Any) -> None:
    """By mu g until it is as fast as the floor; from then on it stays where it is on it."""
    speed = np.linalg.norm(carried.velocity[:, 10, :2], axis=1)
    t, full = carried.times, np.hypot(1.0, 0.5)
    slides = (t > 0.1) & (t < 0.3)
    np.testing.assert_allclose(np.diff(speed[slides]) / np.diff(t[slides]), MU * 9.81, rtol=0.02)
    late = t > 0.45  # it swings by the elastic travel of its friction, sl = D/100: by sqrt(mu g sl)
    assert speed[late].mean() == pytest.approx(full, rel=5e-3)
    assert np.abs(speed[late] - full).max() < np.sqrt(MU * 9.81 * 2e-4)
    along = carried.velocity[t > 0.1, 10, :2]
    np.testing.assert_allclose(along[:, 1] / along[:, 0], 0.5, rtol=0.01)
    assert carried["obstacles/floor/force"][-1, 2] == pytest.approx(-0.2 * 9.81, rel=1e-3)


def test_the_work_of_a_floor_that_moves_is_booked(carried: Any) -> None:
    """Force times way of the floor: as much again as the rope has got goes into friction."""
    got = 0.5 * 0.2 * 1.25
    assert carried["energy/kinetic"][carried.times > 0.45].mean() == pytest.approx(got, rel=0.01)
    assert carried["work/obstacles"][-1] == pytest.approx(2.0 * got, rel=0.05)
    assert carried["work/friction"][-1] == pytest.approx(-got, rel=0.1)
    assert np.abs(carried["work/scheme"]).max() < 0.01 * got


def test_each_obstacle_has_its_own_travel() -> None:
    """A rope between a floor at rest and a belt that rolls over it: each pulls by mu times what presses on it."""
    tables = conveyor()
    floor = tables["obstacles"].pop("floor")
    belt = {"kind": "plane", "at": [0, 0, 0.0199], "normal": [0, 0, -1], "friction": 0.1, "damping": 100.0,
            "motion": floor["motion"]}  # fmt: skip
    tables["obstacles"] = {"floor": {k: x for k, x in floor.items() if k != "motion"}, "belt": belt}
    tables["time"]["duration"] = 0.2
    result = hybrid.run(tables)
    below, above = (result[f"obstacles/{x}/force"][-1] for x in ("floor", "belt"))
    assert np.abs(result.position[:, :, :2] - result.position[0, :, :2]).max() < 4e-4  # the floor holds it: 2 sl
    assert np.linalg.norm(above[:2]) == pytest.approx(0.1 * abs(above[2]), rel=1e-3)
    np.testing.assert_allclose(above[:2] / np.linalg.norm(above[:2]), -np.array([2.0, 1.0]) / np.sqrt(5.0), atol=0.01)
    belows = np.linalg.norm(result["obstacles/floor/force"][:, :2], axis=1)
    assert belows[3:].mean() == pytest.approx(np.linalg.norm(above[:2]), rel=0.25)  # it swings on the floor
    assert below[2] + above[2] == pytest.approx(-0.2 * 9.81, rel=0.02)


# --- sheaves that turn freely ----------------------------------------------------------------------------


def weights(inertia: float, damping: float = 0.0, **more: Any) -> Tables:
    """A weightless rope over a sheave, pulled at both ends by 10 N, then at one by 14 N."""
    R = CENTRELINE + 5e-5
    over = [[R * np.cos(x), 0.0, R * np.sin(x)] for x in np.linspace(np.pi, 0.0, 129)]
    points = [[-R, 0.0, -1.5], *over, [R, 0.0, -1.5]]
    tables = capstan(0.5, 10.0, "rod")
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    tables["cable"]["sections"][0] |= {"length": length, "damping": {"stiffness": 2e-3}}
    tables["obstacles"]["drum"]["bearing"] = {"inertia": inertia, "damping": damping}
    light, heavy = (
        [[0, 0, 0, 0], [0.2, 0, 0, -10]],
        [[0, 0, 0, 0], [0.2, 0, 0, -10], [0.3, 0, 0, -10], [0.5, 0, 0, -14]],
    )
    tables["ends"] = {
        "start": {"kind": "free", "force": {"history": light}}, "end": {"kind": "free", "force": {"history": heavy}}
    }  # fmt: skip
    tables["initial"] = {"kind": "points", "points": points}
    tables["time"], tables["output"] = {"duration": 0.9, "step": 0.002}, {"every": 0.02, "points": 101}
    return tables | more


@pytest.fixture(scope="module")
def rolled() -> Any:
    return hybrid.run(weights(0.1))


def speeds(result: Any) -> Any:
    return -result.velocity[:, -1, 2]


@pytest.mark.long
@pytest.mark.parametrize("inertia", [0.01, 0.1])
def test_two_weights_over_a_free_sheave(inertia: float, rolled: Any) -> None:
    """a = (F2 - F1)/(m + I/rho^2)."""
    result = rolled if inertia == 0.1 else hybrid.run(weights(inertia))
    late = result.times > 0.6
    found = np.polyfit(result.times[late], speeds(result)[late], 1)[0]
    assert found == pytest.approx(4.0 / (0.1 * result.s[-1] + inertia / CENTRELINE**2), rel=2e-3)


def test_a_free_sheave_has_the_energy_that_the_line_has_given(rolled: Any) -> None:
    """I w^2/2, with w = v/rho where the rope does not slide; and turns as far as the rope has run."""
    way = -(rolled.position[-1, -1, 2] - rolled.position[0, -1, 2])
    axis = rolled["obstacles/drum/rotation"][-1]
    turned = way / CENTRELINE
    assert np.cos(np.radians(axis[1])) * (1 if abs(axis[0]) < 90 else -1) == pytest.approx(np.cos(turned), abs=5e-3)
    assert rolled["work/obstacles"][-1] == pytest.approx(-0.05 * (speeds(rolled)[-1] / CENTRELINE) ** 2, rel=5e-3)
    assert np.abs(rolled["work/scheme"]).max() < 1e-3 * rolled["work/applied"][-1]


def test_a_bearing_holds_a_sheave_back() -> None:
    """(F2 - F1) rho = c w in the end; friction holds the rope on the sheave."""
    result = hybrid.run(weights(0.01, damping=1.0))
    assert speeds(result)[-1] == pytest.approx(4.0 * CENTRELINE**2, rel=0.01)


@pytest.mark.long
def test_a_sheave_that_turns_is_seen_from_outside(rolled: Any) -> None:
    with hybrid.Simulation(weights(0.1)) as simulation:
        simulation.advance(0.4)
        with pytest.raises(ValueError, match="not worked out"):
            simulation.stiffness("end")
        simulation.advance(0.9)
        drum = simulation.obstacle("drum")
    np.testing.assert_allclose(drum.moment, rolled["obstacles/drum/moment"][-1], atol=1e-9)
    turned = np.radians(rolled["obstacles/drum/rotation"][-1, 1])  # about y, beyond a quarter turn with roll and yaw
    assert abs(drum.rotation[0, 0]) == pytest.approx(np.cos(turned), abs=1e-9)


def test_a_sheave_has_no_spin_that_is_given() -> None:
    tables = weights(0.1)
    tables["obstacles"]["drum"]["spin"] = {"rate": 1.0, "ramp": 1.0}
    with pytest.raises(SceneError, match="because the spin is given"):
        hybrid.validate_scene(tables)


# --- frames of reference --------------------------------------------------------------------------------

V = np.array([0.5, -0.3, -3.0])  # m/s


def falling(moves: bool, step: float = 0.004, **more: Any) -> Tables:
    """A rope that meets a pipe across it at V: it flies at V, or the pipe does at -V, once that has begun to move."""
    ramp, at = 0.05, np.array([0.0, 0.0, 0.0])
    pipe = {"kind": "cylinder", "at": at.tolist(), "axis": [0.2, 1, 0.1], "radius": 0.1, "friction": 0.5,
            "damping": 20.0}  # fmt: skip
    pipe["stiffness"] = 2.4525e5  # what is chosen follows the velocity at which the line starts
    if moves:
        pipe |= {"at": (at - 0.5 * ramp * V).tolist(), "motion": {"velocity": (-V).tolist(), "ramp": ramp}}
    section = {"length": 2.0, "mass": 0.2, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.02,
               "damping": {"stiffness": 1e-3}}  # fmt: skip
    return cable_scene(
        section, "free", "free", obstacles={"pipe": pipe},
        initial={"kind": "straight", "direction": [1, 0, 0], "origin": [-1.0, 0.3, 0.5],
                 "velocity": [0, 0, 0] if moves else V.tolist()},
        model="rod", mesh=80, contact={"self": False}, time=(0.3, step), output=(0.02, 81)
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def met() -> Any:
    return hybrid.run(falling(True))


def test_a_pipe_that_meets_a_rope_is_a_rope_that_meets_a_pipe(met: Any) -> None:
    """Shapes, tensions and forces do not know which of both moves."""
    still = hybrid.run(falling(False))
    way = V * still.times[:, None, None]
    np.testing.assert_allclose(met.position + way, still.position, atol=2e-7)
    np.testing.assert_allclose(met.tension, still.tension, atol=1e-4 * np.abs(still.tension).max())
    assert np.abs(met["obstacles/pipe/force"]).max() > 5.0
    assert met.steps.iterations.sum() <= 1.05 * still.steps.iterations.sum()  # derivatives are as exact


def test_a_blow_of_an_obstacle_is_booked(met: Any) -> None:
    """What the pipe does on the rope is motion, or lost in the blow and by friction."""
    assert met["work/obstacles"][-1] > 0.1
    assert np.abs(met["work/scheme"]).max() < 0.02 * met["work/obstacles"][-1]
    force, way = -met["obstacles/pipe/force"], -V
    push = np.trapezoid(force @ way, met.times)
    assert met["work/obstacles"][-1] == pytest.approx(push, rel=0.1)  # of forces at outputs


def test_no_step_carries_a_pipe_through_a_rope() -> None:
    """Steps of 0.02 s in which it moves by the diameter of a pipe."""
    tables = falling(True, step=0.01)
    tables["obstacles"]["pipe"]["motion"] = {"velocity": [0, 0, 20.0], "ramp": 0.03}
    tables["obstacles"]["pipe"]["at"] = [0, 0, -0.5]
    tables["time"]["duration"] = 0.12
    result = hybrid.run(tables)
    place = result["obstacles/pipe/position"]
    assert place[-1, 2] - place[0, 2] == pytest.approx(20.0 * (0.12 - 0.015), rel=1e-9)
    w, axis = result.position - place[:, None], np.array([0.2, 1.0, 0.1]) / np.linalg.norm([0.2, 1.0, 0.1])
    away = np.linalg.norm(w - (w @ axis)[..., None] * axis, axis=2)
    assert away.min() > 0.095
    assert (w[-1, 38:43, 2] > 0.0).all()  # its middle has been carried along


# --- several lines, checkpoints, from outside -------------------------------------------------------------


def pushed(**more: Any) -> Tables:
    """A rope between two points that a bar pushes aside, which turns while it does."""
    motion = {"travel": {"by": [0.2, 0.6, 0.1], "over": 0.6}, "pitch": {"amplitude": 40.0, "period": 0.8}, "ramp": 0.3}
    bar = {"kind": "cylinder", "at": [1.0, -0.4, 0], "axis": [0.3, 0.1, 1], "length": 0.6, "radius": 0.15,
           "friction": 0.4, "motion": motion}  # fmt: skip
    section = {"length": 2.2, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.05}
    return cable_scene(
        section, pinned_at(0, 0, 0.2), pinned_at(2, 0, 0.2), obstacles={"bar": bar}, model="rod", mesh=60,
        contact={"self": False}, time=(0.8, 0.005), output=(0.05, 61)
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def aside() -> Any:
    return hybrid.run(pushed())


def test_an_obstacle_moves_as_its_motion_says(aside: Any) -> None:
    place, rotation = aside["obstacles/bar/position"], aside["obstacles/bar/rotation"]
    np.testing.assert_allclose(place[-1] - place[0], [0.2, 0.6, 0.1], atol=1e-12)
    late = aside.times >= 0.3
    np.testing.assert_allclose(rotation[late, 1], 40.0 * np.sin(2 * np.pi * aside.times[late] / 0.8), atol=1e-6)
    assert np.abs(aside["obstacles/bar/force"]).max() > 1.0
    assert aside.position[-1, 20:40, 1].max() > 0.2
    done = aside["work/obstacles"][-1]  # waves of tension are damped by the scheme, and never fed
    assert -0.1 * done < aside["work/scheme"].min() <= aside["work/scheme"].max() < 1e-3 * done


def test_a_smooth_obstacle_does_no_work_of_friction() -> None:
    tables = pushed()
    tables["obstacles"]["bar"] |= {"friction": 0.0}
    result = hybrid.run(tables)
    done = result["work/obstacles"][-1]
    assert np.abs(result["work/friction"]).max() < 1e-4 * done
    assert -0.06 * done < result["work/contact"][-1] < 0.0  # of blows in long steps
    assert -0.1 * done < result["work/scheme"].min() <= result["work/scheme"].max() < 1e-3 * done


def from_outside(tables: Tables) -> Tables:
    del tables["obstacles"]["bar"]["motion"]
    tables["obstacles"]["bar"]["from_outside"] = True
    return tables


def course(t: float) -> tuple[Any, Any, Any]:
    """Place, velocity and rotation of the bar in `pushed` at t (s)."""
    x, by = min(t / 0.6, 1.0), np.array([0.2, 0.6, 0.1])
    grown, rate = x**3 * (10 - 15 * x + 6 * x * x), 30 * x * x * (1 - x) ** 2 / 0.6
    y = min(t / 0.3, 1.0)
    angle = np.radians(40.0) * y**3 * (10 - 15 * y + 6 * y * y) * np.sin(2 * np.pi * t / 0.8)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return np.array([1.0, -0.4, 0]) + grown * by, rate * by, turn


def stepped(tables: Tables, again: bool) -> Any:
    """Set step by step along the same course; again: every step after one that leads elsewhere, which is taken back."""
    with hybrid.Simulation(tables) as simulation:
        for k in range(160):
            saved = simulation.save() if again else None
            if again and k % 20 == 7:
                elsewhere = course(0.005 * k)[0] + [0.0, 0.002, 0.003]
                simulation.set_obstacle("bar", elsewhere, rotation=np.eye(3))
                simulation.advance(0.005 * (k + 1))
                simulation.restore(saved)
            place, speed, turn = course(0.005 * (k + 1))
            simulation.set_obstacle("bar", place, speed, turn)
            simulation.advance(0.005 * (k + 1))
        bar = simulation.obstacle("bar")
        result = simulation.result()
    return bar, result


def test_an_obstacle_that_is_set_from_outside_moves_as_by_a_motion(aside: Any) -> None:
    bar, rope = stepped(from_outside(pushed()), False)
    np.testing.assert_allclose(rope.position, aside.position, atol=1e-4)
    np.testing.assert_allclose(bar.force, aside["obstacles/bar/force"][-1], atol=0.02)
    np.testing.assert_allclose(bar.moment, rope["obstacles/bar/moment"][-1], atol=1e-9)
    np.testing.assert_allclose(bar.position, course(0.8)[0], atol=1e-12)
    np.testing.assert_allclose(bar.rotation, course(0.8)[2], atol=1e-9)
    again, other = stepped(from_outside(pushed()), True)
    np.testing.assert_array_equal(other.position, rope.position)
    np.testing.assert_array_equal(again.moment, bar.moment)


def test_what_cannot_be_set_is_refused() -> None:
    with hybrid.Simulation(from_outside(pushed())) as simulation:
        with pytest.raises(ValueError, match="obstacle of the scene \\(bar\\) that has from_outside"):
            simulation.set_obstacle("pipe", (0, 0, 0))
        with pytest.raises(ValueError, match="rotation matrix"):
            simulation.set_obstacle("bar", rotation=np.zeros((3, 3)))
    with hybrid.Simulation(pushed()) as simulation, pytest.raises(ValueError, match="from_outside"):
        simulation.set_obstacle("bar", (0, 0, 0))


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"motion": {"heave": {"amplitude": 0.1, "period": 2.0}}}, "obstacles.bar.motion"),
        ({"motion": {"heave": {"amplitude": 0.1, "period": 0.02}, "ramp": 1.0}}, "time.step"),
        ({"spin": {"rate": 300.0, "ramp": 1.0}}, "time.step"),
        ({"spin": {"rate": 3.0, "ramp": 0.001}}, "obstacles.bar.spin.ramp"),
        ({"from_outside": True}, "obstacles.bar.motion"),
        ({"inertia": 2.0}, "obstacles.bar.inertia"),
    ],
)
def test_motions_that_cannot_be_computed_are_refused(change: Tables, where: str) -> None:
    tables = pushed()
    tables["obstacles"]["bar"] |= change
    with pytest.raises(SceneError) as refused:
        hybrid.validate_scene(tables)
    assert [x.where for x in refused.value.complaints] == [where]


def test_obstacles_at_rest_write_nothing_more() -> None:
    """Absence is absence."""
    tables = conveyor(time={"duration": 0.02, "step": 0.002})
    del tables["obstacles"]["floor"]["motion"]
    result = hybrid.run(tables)
    keys = ("contact", "contact_force", "energy", "normal_force", "shape")
    assert sorted(x for x in result.names if "obstacles" in x) == [f"obstacles/floor/{key}" for key in keys]


# --- Boxes, rings, sheaves and meshes beside what else a scene may have: motions, places that are set from outside,
# accuracy ---

DATA = Path(__file__).parents[1] / "data"
SHAPES: dict[str, Tables] = {
    "box": {"kind": "box", "size": [0.3, 0.24, 0.6], "rounding": 0.06, "rotation": [10, 20, 30]},
    "torus": {"kind": "torus", "axis": [0.3, 0.1, 1], "ring": 0.12, "radius": 0.06},
    "sheave": {"kind": "sheave", "axis": [0.3, 0.1, 1], "radius": 0.12, "groove": 0.04, "rim": 0.03},
    "mesh": {"kind": "mesh", "file": str(DATA / "block.obj"), "scale": 0.1, "rotation": [10, 20, 30]},
}


def by(kind: str, **more: Any) -> Tables:
    """The rope that a bar pushes by_shape, by a box, ring or sheave that moves and turns as the bar."""
    tables = pushed(**more)
    for end in tables["ends"].values():
        end["position"][2] = 0.35  # so that its middle is as high as what pushes it
    bar = tables["obstacles"]["bar"]
    tables["obstacles"]["bar"] = SHAPES[kind] | {key: bar[key] for key in ("at", "friction", "motion")}
    return tables


@pytest.fixture(scope="module", params=SHAPES)
def by_shape(request: pytest.FixtureRequest) -> Any:
    return hybrid.run(by(request.param)), request.param


def test_a_line_lies_on_what_has_moved_and_turned(by_shape: Any) -> None:
    """Gaps by the closed forms of the scene, in axes of the obstacle: none is deeper than the radius, contact is there."""
    result, kind = by_shape
    solid = hybrid.validate_scene(by(kind)).obstacles["bar"]
    still, gaps = np.array(solid.at), []
    for k, x in enumerate(result.position):
        place, vector = result["obstacles/bar/position"][k], np.radians(result["obstacles/bar/rotation"][k])
        angle = vector[1]  # it turns about the y axis alone
        assert np.abs(vector[[0, 2]]).max() < 1e-9
        c, s = np.cos(angle), np.sin(angle)
        local = (x - place) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) + still
        gaps.append(min(solid.distance(tuple(p)) for p in local) - STRAND)
    assert min(gaps) > -STRAND
    deep = 0.4 if kind == "mesh" else 0.2  # a sharp edge is pressed on at a point
    pressed = np.linalg.norm(result["obstacles/bar/force"], axis=1) > 0.5
    assert pressed.any() and np.abs(np.array(gaps)[pressed]).max() < deep * STRAND
    assert result.position[:, 15:45, 1].max() > 0.05


def test_what_a_moving_shape_does_is_booked(by_shape: Any) -> None:
    result, _ = by_shape
    done = result["work/obstacles"][-1]
    assert done > 0.0
    assert -0.1 * done < result["work/scheme"].min() <= result["work/scheme"].max() < 1e-3 * done


def test_a_shape_that_is_set_from_outside_moves_as_by_a_motion(by_shape: Any) -> None:
    result, kind = by_shape
    _, other = stepped(from_outside(by(kind)), False)
    np.testing.assert_allclose(other.position, result.position, atol=1e-3)
