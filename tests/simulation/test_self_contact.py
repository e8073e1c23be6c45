"""Lines that touch themselves: nothing passes through, no energy comes from nothing, momentum is kept, runs resume."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from problems import momenta
from random_scenes import random_scene

import hybrid
from hybrid.kernels.state.books import FRICTION
from hybrid.kernels.step.line_step import NEAR
from hybrid.solve.stepper import NetworkState
from hybrid.view.summary import facts_of
from tests.inside import OnlyLine
from tests.said import kinds, work_put_in
from tests.scenes import cable_scene, pinned_at
from tests.validation import thrown_lines

WIDTH = thrown_lines.WIDTH


def hairpin(angle: float, gap: float, chord: float = 0.025) -> np.ndarray:
    """Nodes (N+1, 3) m of a line whose two straight legs cross at an angle (deg), a gap (m) apart, and a bow."""
    a, x = np.radians(angle), np.linspace(-0.5, 0.5, 25)
    first = np.column_stack([x, 0.0 * x, 0.0 * x])
    second = np.column_stack([-x * np.cos(a), -x * np.sin(a), 0.0 * x + gap])
    leave, arrive = (p / np.linalg.norm(p) for p in (first[1] - first[0], second[1] - second[0]))
    u = np.linspace(0.0, 1.0, 60)[1:-1, None]
    way = 3.0 * np.linalg.norm(second[0] - first[-1]) + 1.2
    bow = (2 * u**3 - 3 * u**2 + 1) * first[-1] + (3 * u**2 - 2 * u**3) * second[0]
    bow += way * ((u**3 - 2 * u**2 + u) * leave + (u**3 - u**2) * arrive)
    r = np.vstack([first, bow, second])
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
    at = np.linspace(0.0, s[-1], round(s[-1] / chord) + 1)
    return np.column_stack([np.interp(at, s, r[:, k]) for k in range(3)])


def flying(r: np.ndarray, step: float, duration: float, width: float = WIDTH, **contact: Any) -> hybrid.Simulation:
    """A line with nodes at r, m, that nothing holds."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
    return hybrid.Simulation(cable_scene(
        thrown_lines.section(float(s[-1]), width), {"kind": "free"}, {"kind": "free"}, gravity=1e-15, contact={"self": True} | contact, model="rod",
        mesh={"nodes": s.tolist()}, initial={"kind": "points", "points": r.tolist()}, dimension=3,
        time=(duration, step, 0.9), output=(2.0 * duration, 5)
    ))  # fmt: skip


def energy(line: OnlyLine) -> float:
    """Kinetic, elastic and contact energy, J."""
    return thrown_lines.energy([line.model], NetworkState([line.state]), line.contact, [None], [])


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("steps", [1.0, 10.0], ids=["pass-through step", "ten times that"])
def test_a_throw(seed: int, steps: float) -> None:
    """One leg is thrown at the other at 4 to 20 m/s, with steps in which it could pass a diameter, or ten.

    The least distance is that of polygons along straight ways within steps: the spline between them is up to 0.2
    diameters away, so 0.5 is no passage, which would have 0.
    """
    random = np.random.default_rng(seed)
    speed, gap = float(np.exp(random.uniform(np.log(4.0), np.log(20.0)))), 3.0 * WIDTH
    step, r = steps * WIDTH / speed, hairpin(random.uniform(20.0, 90.0), gap)
    duration = 60.0 * WIDTH / speed * max(1.0, 0.5 * steps)
    simulation = flying(r, step, duration)
    line = OnlyLine(simulation)
    s = np.linspace(-1.0, 1.0, len(r))
    line.state.v[:, 2] = -0.5 * speed * (1.0 + np.tanh(s / 0.15))
    line.state.v[:] += 0.05 * speed * random.normal(size=3)
    line.begin_again()
    mass = line.model.line.mass[:, None]
    (momentum, _), first, most, touched = momenta(line.model, line.state), energy(line), 0.0, False
    while simulation.t < duration * (1.0 - 1e-9):
        simulation.advance(min(simulation.t + step, duration))
        most = max(most, energy(line))
        touched |= line.contact.contact.counts[0] > 0
    assert touched
    assert most < 1.001 * first
    assert line.line.envelope.itself.itself.found.least_distance > 0.5 * WIDTH
    assert np.abs(momenta(line.model, line.state)[0] - momentum).max() < 1e-13 * mass.sum() * speed


def thrown(seed: int) -> tuple[hybrid.Simulation, OnlyLine, float, float]:
    """A throw of the bench, its step and its duration, s."""
    random = np.random.default_rng(seed)
    width, speed = random.uniform(0.01, 0.04), float(np.exp(random.uniform(np.log(2.0), np.log(20.0))))
    steps, friction = random.uniform(1.0, 10.0), random.uniform(0.05, 0.8)
    r = hairpin(random.uniform(15.0, 90.0), 3.0 * width)
    step, duration = steps * width / speed, 30.0 * width / speed * steps
    simulation = flying(r, step, duration, width, friction=friction)
    line = OnlyLine(simulation)
    line.state.v[:, 2] = -0.5 * speed * (1.0 + np.tanh(np.linspace(-1.0, 1.0, len(r)) / 0.15))
    line.state.v[:] += 0.05 * speed * random.normal(size=3)
    line.begin_again()
    return simulation, line, step, duration


@pytest.mark.parametrize("seed", [17, 163])
def test_free_flight_after_contact_gains_no_energy(seed: int) -> None:
    """Throws of the bench that had 1.28 and 1.39 of their energy in free flight when only contact itself was damped."""
    simulation, line, step, duration = thrown(seed)
    first, most, near = energy(line), 0.0, 0
    while simulation.t < duration * (1.0 - 1e-9):
        simulation.advance(min(simulation.t + step, duration))
        most, near = max(most, energy(line)), near + int(line.contact.call[NEAR])
    assert 0 < near < 20  # of 30
    assert most < 1.001 * first


def test_steps_of_a_line_that_has_not_come_near_itself_are_not_judged_by_contact() -> None:
    """A line of 100 m that a float folds to 126 deg, and whose end goes up and down by 5 m, in steps of an 80th period.

    A step's reach makes it one that may touch itself, 77 diameters apart.  The work at its end is known to second order
    in the step alone: what that misses was taken for energy that contact puts in, and halved steps, of which tension
    then jumped, again and again, until Newton failed.
    """
    scene = random_scene(13)[1] | {"model": "rod"}
    with hybrid.run(scene) as result:
        steps = np.diff(result["steps/t"], prepend=0.0)
        assert steps.min() > 0.99 * scene["time"]["step"] and steps.size == 400
        assert "steps cut" not in kinds(result)


@pytest.mark.long
def test_steps_that_would_create_energy_are_repeated() -> None:
    """A throw of the bench that stopped at 2.3 times its energy: steps of 5 ms, in which a strand could pass 9 diameters."""
    simulation, line, step, duration = thrown(901)
    first, most = energy(line), 0.0
    while simulation.t < duration * (1.0 - 1e-9):
        simulation.advance(min(simulation.t + step, duration))
        most = max(most, energy(line))
    assert line.contact.given_up > 0
    assert most < 1.001 * first
    (text,) = (x.text for x in simulation.result().events if x.kind == "steps cut")
    assert f"{line.contact.given_up} tries" in text and "energy" in text


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.6])
def test_friction_keeps_momentum_and_angular_momentum(friction: float) -> None:
    """In steps that resolve the collision; in longer ones the time scheme loses angular momentum, with friction or without."""
    speed = 6.0
    step, duration, random = 0.01 * WIDTH / speed, 8.0 * WIDTH / speed, np.random.default_rng(1)
    simulation = flying(hairpin(56.0, 3.0 * WIDTH), step, duration, friction=friction)
    line = OnlyLine(simulation)
    s = np.linspace(-1.0, 1.0, line.model.line.s.size)
    line.state.v[:, 2] = -0.5 * speed * (1.0 + np.tanh(s / 0.15))
    line.state.v[:] += 0.05 * speed * random.normal(size=3)
    line.begin_again()
    mass = line.model.line.mass[:, None]
    size = (np.linalg.norm(line.state.r, axis=1)[:, None] * mass * np.abs(line.state.v)).sum()
    (momentum, turning), first = momenta(line.model, line.state), energy(line)
    simulation.advance(duration)
    left, turns = momenta(line.model, line.state)
    assert np.abs(left - momentum).max() < 1e-13 * mass.sum() * speed and np.abs(turns - turning).max() < 1e-6 * size
    lost = -float(line.books.work[0, FRICTION]) / first
    assert 3e-4 < lost < 0.1 if friction else lost == 0.0
    assert energy(line) < first * (1.0001 - lost)


def looped(**more: Any) -> dict[str, Any]:
    """A rod with three turns whose ends approach: it throws a loop, whose strands meet."""
    section = {
        "length": 4.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.5,
        "damping": {"mass": 0.5}, "torsional_stiffness": 0.4,
    }  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    away = {"travel": {"by": [-1.9, 0, 0], "over": 8.0}}
    return cable_scene(
        section, clamp | {"position": [0, 0, 0]}, clamp | {"position": [3.9, 0, 0], "turns": 3, "motion": away},
        gravity=0.5, model="rod", mesh=100, contact={"self": True}, time=(9.0, 0.01), output=(0.1, 41)
    ) | more  # fmt: skip


@pytest.mark.long
def test_strands_of_a_loop_stay_a_diameter_apart() -> None:
    free = hybrid.run(looped(contact={"self": False}))
    assert "line meets itself" in kinds(free)
    result = hybrid.run(looped())
    assert "line meets itself" not in kinds(result) and "line touches itself" in kinds(result)
    assert float(result["self_distance/distance"]) > 0.85 * WIDTH
    touches = result["energy/self_contact"] > 0.0
    assert touches.any()
    force = result["self_contact"]  # N/m; of strands that are 0.94 to 1.02 D apart
    assert (force.max(axis=1)[touches] > 0.0).all() and not force[~touches].any() and (force >= -1e-12).all()
    assert np.nanmax(result["envelope/self_contact_max"]) >= force.max()
    assert np.nanmin(result["envelope/self_contact_min"]) == 0.0
    found = {fact.key: fact for fact in facts_of(result)}["itself"]
    assert found.values["force"] == np.nanmax(result["envelope/self_contact_max"])
    apart = np.linalg.norm(result["position"] - free["position"], axis=2).max()
    assert apart > WIDTH
    assert result["work/scheme"].max() < 1e-3 * work_put_in(result)


@pytest.mark.long
def test_what_is_at_rest_does_not_depend_on_the_speed_of_the_collision() -> None:
    """The law that a collision has made stiff fades."""
    found = []
    for speed in (0.0, 30.0):
        simulation = hybrid.Simulation(looped())
        simulation.advance(8.2)
        line = OnlyLine(simulation)
        contact = line.contact.contact
        assert contact.counts.points > 0
        contact.numbers.speed = max(speed, contact.numbers.speed)
        simulation.advance(9.0)
        found.append((float(line.state.T[-1]), line.contact.least_distance))
        assert contact.numbers.speed < 1.0
    (tension, distance), (other, apart) = found
    assert other == pytest.approx(tension, rel=2e-3)
    assert apart == pytest.approx(distance, rel=2e-3)


@pytest.mark.long
def test_friction_holds_a_loop_and_its_work_is_booked() -> None:
    smooth = hybrid.run(looped())
    rough = hybrid.run(looped(contact={"self": True, "friction": 0.3}))
    assert not smooth["work/friction"].any()
    assert rough["work/friction"][-1] < 0.0
    assert rough["steps/repeats"].sum() < 100  # 45; 363 where shifts went to and fro in Newton's method
    assert np.linalg.norm(rough["position"] - smooth["position"], axis=2).max() > 0.1 * WIDTH
    assert rough["work/scheme"].max() < 1e-3 * work_put_in(rough)


def closing(model: Any, **more: Any) -> dict[str, Any]:
    """A line hangs in a U; its ends approach until its legs touch."""
    section = {
        "length": 8.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.02,
        "torsional_stiffness": 0.016, "damping": {"mass": 0.5},
    }  # fmt: skip
    closer = {"travel": {"by": [-2.5, 0.95 * WIDTH, 0.0], "over": 5.0}}
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(2.5, 0, 0, motion=closer), model=model,
        contact={"self": True, "friction": 0.3}, time=(6.0, 0.01), output=(0.1, 81)
    ) | more  # fmt: skip


@pytest.mark.long
def test_catenaries_that_come_near_themselves_become_rods() -> None:
    rods = hybrid.run(closing("rod", mesh={"cells": 160}))
    watched = closing("adaptive")
    watched["output"]["criteria"] = True
    result = hybrid.run(watched)
    assert {"grow", "line touches itself"} <= kinds(result)
    assert "contact" in {event.criterion for event in result.events}
    assert float(result["self_distance/distance"]) > 0.85 * WIDTH
    for zones, x, near in zip(result.zones, result["position"], result["criteria/contact"], strict=True):
        apart = np.linalg.norm(x[:, None] - x[None], axis=2)
        between = np.abs(result.s[:, None] - result.s[None])
        apart[(between < 1.0) | (8.0 - between < 1.0)] = np.inf
        touching = result.s[apart.min(axis=1) < 1.5 * WIDTH]
        assert all(any(z.kind == "rod" and z.s_a <= s <= z.s_b for z in zones) for s in touching)
        assert (near[apart.min(axis=1) < 1.5 * WIDTH] > 1.0).all()
    assert any(any(z.kind == "catenary" for z in zones) for zones in result.zones)
    assert np.linalg.norm(result["position"] - rods["position"], axis=2).max() < 1e-3 * 8.0


LEGS = {"zones": [{"catenary": 3.0}, {"rod": 2.0}, {"catenary": 3.0}]}


@pytest.mark.long
@pytest.mark.parametrize("asked", [True, None])
def test_fixed_zones_touch_each_other(asked: bool | None) -> None:
    """The legs of a U, catenaries whose bend between them is rod; against rods."""
    contact = {"friction": 0.3} | ({"self": True} if asked else {})
    result = hybrid.run(closing(LEGS, mesh={"cells": 160}, contact=contact))
    assert "line meets itself" not in kinds(result) and "line touches itself" in kinds(result)
    assert result["energy/self_contact"].any() and float(result["self_distance/distance"]) > 0.85 * WIDTH
    put_in = np.abs(result["work/end"]).max() + np.ptp(result["energy/potential"])
    assert result["work/scheme"].max() < 1e-3 * put_in
    if not asked:
        return
    rods = hybrid.run(closing("rod", mesh={"cells": 160}))
    assert np.linalg.norm(result["position"] - rods["position"], axis=2).max() < 1e-3 * 8.0
    assert result["energy/self_contact"].max() == pytest.approx(rods["energy/self_contact"].max(), rel=0.3)


@pytest.fixture(scope="module")
def resting() -> tuple[dict[str, Any], hybrid.Result]:
    """A rod with three turns whose clamps are half its length apart: tables of its scene, and its equilibrium."""
    tables = looped(contact={"self": True, "friction": 0.2}, time={"duration": 0.2, "step": 0.01})
    del tables["ends"]["end"]["motion"]
    tables["ends"]["end"]["position"] = [2.0, 0, 0]
    return tables, hybrid.static(tables)


def test_an_equilibrium_in_contact(resting: tuple[dict[str, Any], hybrid.Result]) -> None:
    """No turn of the clamps is lost, strands are apart, and what is left over shows that it is an equilibrium."""
    result = resting[1]
    assert result.status == "complete" and "damped motion with contact" in result.message
    assert "line touches itself" in kinds(result) and not kinds(result) & {"stability not judged", "unstable"}
    assert any(e.kind == "static friction neglected" and "touches itself" in e.text for e in result.events)
    assert result["turns/link"][0] == pytest.approx(3.0, abs=1e-9)
    assert result["turns/writhe"][0] > 1.5
    assert 0.94 * WIDTH < float(result["self_distance/distance"]) < 1.05 * WIDTH
    assert result["energy/self_contact"][0] > 0.0 and result["self_contact"].max() > 0.0
    assert float(result.message.split("residual force ")[1].split()[0]) < 1e-6  # N, of a tension of 10


@pytest.mark.long
def test_a_run_stays_where_it_touches_itself_at_rest(resting: tuple[dict[str, Any], hybrid.Result]) -> None:
    tables, static = resting
    result = hybrid.run(tables)
    assert np.abs(result["position"] - static["position"]).max() < 1e-9
    assert result["tension"] == pytest.approx(np.broadcast_to(static["tension"], result["tension"].shape), abs=1e-5)
    assert result["energy/self_contact"] == pytest.approx(float(static["energy/self_contact"][0]), rel=1e-6)
    assert "unstable" not in kinds(result)


def test_ends_that_are_led_through_each_other_are_told() -> None:
    """No contact is computed beside ends that are held: what passes through the line there is said at the end."""
    through = {"travel": {"by": [-2.4, 0.3 * WIDTH, 0], "over": 3.0}}
    scene = closing("adaptive", mesh={"cells": 80}, time={"duration": 2.4, "step": 0.02}, output={"every": 0.2})
    scene["ends"]["end"] |= {"position": [2, 0, 0], "motion": through}
    scene["cable"]["attachments"] = [{"kind": "clump", "at": 4.0, "mass": 1.0}]
    line = hybrid.run(scene)
    (told,) = (event for event in line.events if event.kind == "line meets itself")
    assert "ends that are held" in told.text and told.value == float(line["self_distance/distance"]) < 0.85 * WIDTH
    assert told.s_a < 0.3 and told.s_b > 7.7 and told.t == float(line["self_distance/time"])


def test_an_equilibrium_that_touches_itself_from_a_start_within_itself_is_refused() -> None:
    """A weight pulls the legs of a line straight, 0.95 diameters apart."""
    ends = {"start": pinned_at(0, 0, 0), "end": pinned_at(0, 0.95 * WIDTH, 0)}
    for model in ("rod", LEGS):
        weighted = closing(model, ends=ends)
        weighted["cable"]["sections"][0]["bending_stiffness"] = 1e-4
        weighted["cable"]["attachments"] = [{"kind": "clump", "at": 4.0, "mass": 10.0}]
        pattern = r"without contact the centrelines of s = .* m and s = .* m[\s\S]*in this one the centrelines of s = [\s\S]*hybrid run"
        with pytest.raises(hybrid.SceneError, match=pattern):
            hybrid.static(weighted)
    apart = hybrid.static(closing("rod"))
    assert apart.status == "complete" and not apart["self_contact"].any()


def test_a_strand_lies_on_another_on_a_seabed() -> None:
    """One end of a line on the bed is led across the other leg and lies on it there: the bed bears both."""
    shut = {"travel": {"by": [0.4, -0.8, 0.0], "over": 2.5}}
    r = np.array(
        [[0, 0.25, 0], [1, 0.25, 0], [1.1, 0.2, 0], [1.15, 0, 0], [1.1, -0.2, 0], [1, -0.25, 0], [0, -0.25, 0.0]]
    )
    scene = closing(
        "rod", mesh={"cells": 110},
        environment={"seabed": {"z": -0.05, "stiffness": 2e4, "damping": 200.0, "friction": 0.3}},
        initial={"kind": "points", "points": r.tolist()},
        ends={
            "start": {"kind": "pinned", "position": r[0].tolist(), "motion": shut},
            "end": {"kind": "pinned", "position": r[-1].tolist()},
        },
    )  # fmt: skip
    scene["cable"]["sections"][0]["length"] = float(np.linalg.norm(np.diff(r, axis=0), axis=1).sum())
    scene["time"] = {"duration": 3.5, "step": 0.01}
    result = hybrid.run(scene)
    both = (result["self_contact"] > 0.0) & (result["contact"] > 0.0)
    assert both[-1].any(), "contact with the bed and with the line at the same place"
    assert result["contact"][-1][both[-1]].max() > 3.0 * 0.4 * 9.81
    assert float(result["self_distance/distance"]) > 0.85 * WIDTH
    assert result["position"][:, :, 2].min() > -0.05 - 0.5 * WIDTH
    put_in = np.abs(result["work/end"]).max() + np.abs(result["work/start"]).max() + np.ptp(result["energy/potential"])
    assert result["work/scheme"].max() < 1e-2 * put_in
