"""Lines of several that touch each other: ropes that cross, throws, a line that is cut, what is kept and what is said.

Forces of crossing ropes: cosseratbench 0.3.0 (recomputed); of crossing fibres: the closed form for small angles.
"""

from __future__ import annotations

import re
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.cli.tables import extremes_facts
from hybrid.errors import SceneError
from hybrid.kernels.contact.lines_distance import APART, HAVE_MET
from hybrid.kernels.state.books import Clock
from hybrid.model.network import build_network
from hybrid.simulation.equilibrium import joined_lines
from hybrid.simulation.lines_contact import LinesWatch
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import NetworkState
from hybrid.view.summary import facts_of
from tests.scenes import cable_scene, each_line, line_between, network_scene, pinned_at, system_of
from tests.simulation.test_system_contact import HOSE, network
from tests.validation.thrown_lines import WIDTH as D
from tests.validation.thrown_lines import Throw, straight, throw

Tables = dict[str, Any]

# --- ropes that cross at right angles ------------------------------------------------------------------

RADIUS, MODULUS, DENSITY = 0.005, 1e6, 1000.0
AREA = np.pi * RADIUS**2
ROPE = {
    "length": 1.0, "mass": DENSITY * AREA, "diameter": 2 * RADIUS, "axial_stiffness": MODULUS * AREA,
    "bending_stiffness": MODULUS * np.pi * RADIUS**4 / 4, "max_strain": 0.1, "damping": {"mass": 3.0},
}  # fmt: skip
WEIGHT = DENSITY * AREA * 9.81
FORCES = {0.05: 0.188161, 0.1: 0.266793, 0.2: 0.360215}  # N, by how much lower the pins of the upper rope are, m


def crossing(drop: float, **more: Any) -> Tables:
    """Two ropes of 1 m whose pins are 0.8 m apart, the upper one looked for from above the lower."""
    line = {"sections": [ROPE], "model": "rod", "mesh": {"cells": 80}, "contact": {"self": False}}
    above = {"points": [[-0.4, 0, -drop], [0, 0, 0.1], [0.4, 0, -drop]]}
    return network_scene(
        {"a": {"position": [-0.4, 0, -drop]}, "b": {"position": [0.4, 0, -drop]}, "c": {"position": [0, -0.4, 0]},
         "d": {"position": [0, 0.4, 0]}},
        {"upper": line | {"start": "a", "end": "b", "initial": above}, "lower": line | {"start": "c", "end": "d"}},
        contact={}, output={"points": 81}
    ) | more  # fmt: skip


def force_between(result: Any, row: int) -> tuple[float, float]:
    """By what the pins of the upper rope bear less than its weight, and those of the lower more, N."""
    upper, lower = (
        float(x.reaction_start[row, 2] + x.reaction_end[row, 2]) for x in (result.lines["upper"], result.lines["lower"])
    )
    return WEIGHT - upper, lower - WEIGHT


@pytest.mark.parametrize(("drop", "cells"), [(0.05, 80), (0.2, 80), *((0.1, n) for n in (80, 100, 120, 140, 160))])
def test_crossing_ropes_rest_on_each_other(drop: float, cells: int) -> None:
    """From the scene alone, the same on every mesh: without contact the upper rope would rest below the lower one."""
    result = hybrid.static(each_line(crossing(drop), mesh=cells))
    off, on = force_between(result, 0)
    assert off == pytest.approx(on, rel=1e-6)
    assert on == pytest.approx(FORCES[drop], rel=0.005 if drop == 0.1 else 0.01)
    upper, lower = (result.lines[x].position[0, 40] for x in ("upper", "lower"))
    assert upper[2] - lower[2] == pytest.approx(2 * RADIUS, rel=0.06)
    assert np.abs([upper[0], upper[1], lower[0], lower[1]]).max() < 0.2 * RADIUS
    if drop == 0.1:
        assert upper[2] == pytest.approx(-0.277915, abs=0.001)
        assert lower[2] == pytest.approx(-0.287915, abs=0.001)
    assert any(e.kind == "lines touch" for e in result.events)


def lowered(duration: float = 1.6) -> Tables:
    """The pins of the upper rope come down from above the lower one, askew, with friction."""
    tables = crossing(-0.05, contact={"friction": 0.3}, time={"duration": duration, "step": 0.01})
    del tables["lines"]["upper"]["initial"]
    tables["points"]["a"]["motion"] = {"travel": {"by": [0.05, 0.02, -0.15], "over": 1.0}}
    tables["points"]["b"]["motion"] = {"travel": {"by": [0, 0, -0.15], "over": 1.0}}
    tables["output"] = {"points": 81, "every": 0.1}
    return tables


@pytest.fixture(scope="module")
def moved() -> Any:
    return hybrid.run(lowered())


def test_a_rope_is_let_down_on_another_one(moved: Any) -> None:
    """They stay a diameter apart, the force on the one is that on the other, and where they meet first is said."""
    upper, lower = moved.lines["upper"], moved.lines["lower"]
    apart = np.linalg.norm(upper.position[:, :, None] - lower.position[:, None], axis=3).min(axis=(1, 2))
    assert 0.94 * 2 * RADIUS < apart.min() < 1.1 * 2 * RADIUS
    met = [e for e in moved.events if e.kind == "lines touch"]
    assert len(met) == 1
    assert 0.2 < met[0].t < 0.5
    assert "line upper touches line lower" in met[0].text
    assert not upper["self_contact"][0].any() and upper["self_contact"][-1].max() > 0.0
    np.testing.assert_allclose(upper["energy/self_contact"], lower["energy/self_contact"], atol=1e-12)


def test_what_lines_do_to_each_other_is_booked(moved: Any) -> None:
    """What the one loses the other gets, but for what friction takes: 1e-3 of what the pins do is left."""
    upper, lower = moved.lines["upper"], moved.lines["lower"]
    done = [x["work/friction"][-1] for x in (upper, lower)]
    put_in = np.abs(upper["work/start"]).max() + np.ptp(upper["energy/potential"])
    assert done[0] < -0.005 < 0.005 < done[1]
    assert -0.1 * done[1] < sum(done) < 0.0
    assert max(np.abs(x["work/scheme"]).max() for x in (upper, lower)) < 2e-3 * put_in


def test_it_stays_where_it_rests_on_another() -> None:
    result = hybrid.run(crossing(0.1, time={"duration": 0.3, "step": 0.01}, output={"points": 81, "every": 0.1}))
    for line in result.lines.values():
        assert np.abs(line.position - line.position[0]).max() < 1e-9
        assert line["energy/self_contact"] == pytest.approx(float(line["energy/self_contact"][0]), rel=1e-6)
        assert line["energy/self_contact"][0] > 0.0


# --- fibres under tension ---------------------------------------------------------------------------------


@pytest.mark.long
def test_crossing_fibres_push_each_other_by_their_tension() -> None:
    """F = (d - e) T/(l - lam tanh(l/lam)), lam^2 = EI/T, with d the distance in contact; here e = 0 and 2 l the span."""
    half, width, pull, stiff = 1.0, 0.01, 100.0, 1.0
    fibre = {"length": 2 * half / 1.01, "mass": 0.1, "diameter": width, "axial_stiffness": pull / 0.01,
             "bending_stiffness": stiff, "max_strain": 0.1}  # fmt: skip
    line = {"sections": [fibre], "model": "rod", "mesh": {"cells": 200}, "contact": {"self": False}}
    above = {"points": [[-half, 0, 0], [0, 0, 0.03], [half, 0, 0]]}
    result = hybrid.static(network_scene(
        {"a": {"position": [-half, 0, 0]}, "b": {"position": [half, 0, 0]}, "c": {"position": [0, -half, 0]},
         "d": {"position": [0, half, 0]}},
        {"upper": line | {"start": "a", "end": "b", "initial": above}, "lower": line | {"start": "c", "end": "d"}},
        gravity=0, contact={}, output={"points": 201}
    ))  # fmt: skip
    upper, lower = result.lines["upper"], result.lines["lower"]
    apart = upper.position[0, 100, 2] - lower.position[0, 100, 2]
    T, lam = upper.tension[0, 0], np.sqrt(stiff / upper.tension[0, 0])
    force = apart * T / (half - lam * np.tanh(half / lam))
    assert lower.reaction_start[0, 2] + lower.reaction_end[0, 2] == pytest.approx(force, rel=0.01)
    assert 0.9 * width < apart < 1.05 * width


# --- throws -------------------------------------------------------------------------------------------------


def thrown(friction: float, speed: float, steps: float, duration: float, seed: int, kind: str = "rod") -> Throw:
    """A line flies across another one at rest; steps and duration in ways of a diameter at that speed."""
    random = np.random.default_rng(seed)
    a = straight(1.0, np.zeros(3), np.array([1.0, 0.0, 0.0]), 40)
    b = straight(1.0, np.array([0.03, 0.05, 3.0 * D]), np.array([0.3, 1.0, 0.0]), 40)
    va, vb = np.zeros_like(a), np.zeros_like(b)
    va += 0.05 * speed * random.normal(size=3)
    vb += 0.3 * speed * random.normal(size=3) * [1.0, 1.0, 0.0] - [0.0, 0.0, speed]
    return throw([a, b], [va, vb], steps * D / speed, duration * D / speed, friction, kind=kind)


@pytest.mark.long
@pytest.mark.parametrize("friction", [0.0, 0.6])
def test_momentum_and_angular_momentum_are_kept(friction: float) -> None:
    """In steps that resolve the collision, as of a line that touches itself."""
    found = thrown(friction, 6.0, 0.01, 6.0, 1)
    assert found.shared.met()
    assert np.abs(np.diff(found.momentum, axis=0)).max() < 1e-12
    assert np.abs(np.diff(found.turning, axis=0)).max() < 1e-6 * found.size
    assert max(found.energies) < 1.001 * found.energies[0]
    assert found.least > 0.9 * D


@pytest.mark.long
@pytest.mark.parametrize("kind", ["rod", "catenary"])
@pytest.mark.parametrize("steps", [1.0, 10.0], ids=["pass-through step", "ten times that"])
def test_no_step_carries_a_line_through_another(steps: float, kind: str) -> None:
    for seed in range(2):
        found = thrown(0.3, 12.0, steps, 40.0 * max(1.0, 0.5 * steps), seed, kind)
        assert found.shared.met()
        assert found.least > 0.8 * D  # of polygons: the spline between them is up to 0.2 diameters away
        assert max(found.energies) < 1.001 * found.energies[0]


# --- a line that is cut ---------------------------------------------------------------------------------------


def cut() -> Tables:
    """The hose of tests/simulation/test_system_contact.py in two halves, clamped to each other, which touch."""
    tables = network()
    base = {"model": "rod", "mesh": {"cells": 40}, "sections": [HOSE | {"length": 2.0}], "contact": {"self": False}}
    tables["points"]["cut"] = {"kind": "free", "initial_guess": [0.55, 0, -1.7]}
    clamped = {"kind": "clamped"}
    tables["lines"] = {
        "one": base | {"start": "low", "end": "cut", "connections": {"end": clamped}},
        "two": base | {"start": "cut", "end": "free", "connections": {"start": clamped}},
        "tail": tables["lines"]["tail"],
    }
    return tables | {
        "contact": {"friction": 0.3, "between": [["one", "two"]]}, "output": {"every": 0.02, "points": 41},
    }  # fmt: skip


@pytest.fixture(scope="module")
def hose() -> Any:
    return hybrid.run(network(), progress=False).lines["hose"]


def test_halves_of_a_line_touch_each_other_as_it_touches_itself(hose: Any) -> None:
    """One law and one solve: the same motion, neighbours along the network being those along the line."""
    result = hybrid.run(cut(), progress=False)
    one, two = result.lines["one"], result.lines["two"]
    both = np.concatenate([one.position, two.position[:, 1:]], axis=1)
    assert np.linalg.norm(both - hose.position, axis=2).max() < 1e-6
    energy = one["energy/self_contact"] + two["energy/self_contact"]
    np.testing.assert_allclose(energy, hose["energy/self_contact"], atol=1e-4 * energy.max())
    assert one["work/friction"][-1] + two["work/friction"][-1] == pytest.approx(hose["work/friction"][-1], rel=0.1)


# --- lines that pass through each other -------------------------------------------------------------------------

PASSAGE = "lines pass through each other"


def without_contact(**more: Any) -> Tables:
    return lowered(0.8) | {"contact": {"between": []}} | more


@pytest.mark.long
def test_lines_without_contact_do_not_pass_through_each_other_in_silence(moved: Any, tmp_path: Path) -> None:
    """One event, when and where contact would have begun; a run that goes on says it no second time."""
    hybrid.run(without_contact(), tmp_path / "half.h5")
    told = [e for e in hybrid.resume(tmp_path / "half.h5", until=1.2).events if e.kind == PASSAGE]
    met = next(e for e in moved.events if e.kind == "lines touch")
    assert len(told) == 1
    assert told[0].t == pytest.approx(met.t, abs=0.011)
    assert re.search(r"lines upper and lower .* s = 0\.4\d* m of upper and s = 0\.5\d* m of lower", told[0].text)
    assert "between: [[upper, lower]]" in told[0].text


def test_lines_that_overlap_at_rest_are_said_to() -> None:
    """Two ropes held straight across each other, half a diameter apart; and one and a half."""
    line = {"sections": [ROPE | {"length": 0.79}], "model": "catenary", "mesh": {"cells": 40}}
    tables = {"environment": {"gravity": 0}} | crossing(-RADIUS)
    del tables["contact"], tables["lines"]["upper"]["initial"]
    for name in tables["lines"]:
        tables["lines"][name] = {x: tables["lines"][name][x] for x in ("start", "end")} | line
    (event,) = (e for e in hybrid.static(tables).events if e.kind == PASSAGE)
    assert event.t == 0.0
    assert "s = 0.395 m of upper and s = 0.395 m of lower" in event.text
    for name in ("a", "b"):
        tables["points"][name]["position"][2] = 3.0 * RADIUS
    assert PASSAGE not in {e.kind for e in hybrid.static(tables).events}


def bridle(half: float, fall: float = 0.0, **leg: Any) -> Tables:
    """Two legs that leave a knot by a narrow angle, half of it by half (m) over 0.8 m, and may swing together."""
    leg = {"sections": [ROPE | {"length": 0.81}], "mesh": {"cells": 80}, "contact": {"self": False}} | leg
    move = {"travel": {"by": [0, fall, 0], "over": 0.3}}
    return {
        "environment": {"gravity": 9.81}, "time": {"duration": 0.4, "step": 0.01}, "output": {"points": 21, "every": 0.1},
        "points": {"a": {"position": [0, -half, 0]}, "b": {"position": [0, half, 0]} | ({"motion": move} if fall else {}),
                   "c": {"position": [1.6, 0, 0]}, "knot": {"kind": "free", "initial_guess": [0.8, 0, 0]}},
        "lines": {"left": leg | {"start": "a", "end": "knot"}, "right": leg | {"start": "b", "end": "knot"},
                  "tow": leg | {"start": "knot", "end": "c"}},
    }  # fmt: skip


def test_legs_of_a_bridle_are_no_passage() -> None:
    """Two legs that meet at a point by 14 degrees: they overlap on the first four diameters alone."""
    tables = bridle(0.1, model="catenary", sections=[ROPE | {"length": 0.79}])
    tables |= {"environment": {"gravity": 0}, "time": {"duration": 0.1, "step": 0.02}}
    assert PASSAGE not in {e.kind for e in hybrid.run(tables).events}
    model = build_network(system_of(tables))
    watch, solver = LinesWatch(system_of(tables), model, set(), Clock()), NetworkSolver(joined_lines(model, 0.0), 1)
    watch.attach(solver.line_tables)
    solver.join_states(NetworkState([x.start for x in model.models], model.body_places))
    assert not watch.begin(system_of(tables))  # they are looked at beyond the joint


def test_a_passage_within_a_step_is_seen() -> None:
    """Pins that come down by 20 diameters in three steps, of which no output falls on the passage."""
    tables = without_contact(time={"duration": 0.4, "step": 0.05}, output={"points": 81, "every": 0.4})
    tables["points"]["a"]["motion"] = tables["points"]["b"]["motion"] = {"travel": {"by": [0, 0, -0.2], "over": 0.15}}
    events = [e for e in hybrid.run(tables).events if e.kind == PASSAGE]
    assert len(events) == 1
    assert 0.0 < events[0].t < 0.3


def test_a_passage_that_is_taken_back_is_not_said() -> None:
    """Stepped from outside: pins that went down through the lower rope go up instead, and then down after all."""
    tables = without_contact()
    places = {name: tables["points"][name]["position"] for name in ("a", "b")}
    for name in places:
        tables["points"][name].pop("motion")
    with hybrid.Simulation(tables) as run:

        def advance(by: float, until: float) -> None:
            for name, (x, y, z) in places.items():
                run.set_point(name, [x, y, z + by])
            run.advance(until)

        saved = run.save()
        advance(-0.2, 0.2)
        run.restore(saved)
        advance(0.05, 0.2)
        run.save()
        advance(-0.2, 0.5)
        events = [e for e in run.result().events if e.kind == PASSAGE]
    assert len(events) == 1
    assert 0.2 < events[0].t < 0.5


def test_lines_that_stay_apart_or_have_contact_are_not_said_to_pass(moved: Any) -> None:
    apart = without_contact(time={"duration": 0.1, "step": 0.02})
    for events in (hybrid.run(apart).events, moved.events):
        assert PASSAGE not in {e.kind for e in events}


@pytest.mark.long
def test_the_distance_of_lines_is_that_of_their_cells() -> None:
    """Against all pairs of cells, of random polygons at rest."""
    random = np.random.default_rng(5)
    tables = without_contact()
    model = build_network(system_of(tables))
    watch = LinesWatch(system_of(tables), model, set(), Clock())
    solver = NetworkSolver(joined_lines(model, 0.0), 0)
    watch.attach(solver.line_tables)
    for _ in range(5):
        states = NetworkState([x.start.copy() for x in model.models], model.body_places)
        for x in states.lines:
            x.r[:] += 0.05 * random.normal(size=3) + 0.01 * random.normal(size=x.r.shape)
            x.r[:, 2] *= 0.3
        watch._room[0, APART] = 0.0  # of another shape
        solver.join_states(states)
        watch.begin(system_of(tables))
        apart = float(watch._room[0, APART])
        p, q = (x.r for x in states.lines)
        a, b = (np.concatenate([(1 - x) * r[:-1] + x * r[1:] for x in np.linspace(0, 1, 21)]) for r in (p, q))
        least = np.sqrt(((a[:, None] - b[None]) ** 2).sum(axis=2)).min() - 2 * RADIUS
        if apart > 0.0:  # else they have met, and are looked at no longer; sides are sampled every 0.6 mm
            assert apart == pytest.approx(least, abs=3e-4)
            assert apart <= least + 1e-12
        else:
            assert least < 0.0 or apart == 0.0
        watch._pairs[0, HAVE_MET] = 0


# --- what is refused --------------------------------------------------------------------------------------------


def bare(tables: Tables, name: str) -> None:
    del tables["lines"][name]["sections"][0]["diameter"]


@pytest.mark.parametrize(
    ("change", "where", "says"),
    [
        (lambda x: x["contact"].update(between=[["upper", "lowest"]]), "contact.between[0][1]", "name of a line"),
        (lambda x: x["contact"].update(between=[["upper", "upper"]]), "contact.between[0]", "lines.NAME.contact"),
        (lambda x: bare(x, "lower"), "lines.lower.sections[0].diameter", "touch each other"),
        (lambda x: x.update(accuracy="3%"), "accuracy", "a fifth of the truth"),
        (lambda x: x["output"].update(errors=True), "output.errors", "a fifth of the truth"),
    ],
)  # fmt: skip
def test_what_does_not_go_with_contact_between_lines_is_refused(change: Any, where: str, says: str) -> None:
    tables = deepcopy(lowered())
    change(tables)
    with pytest.raises(SceneError) as refused:
        hybrid.run(tables)
    assert any(x.where == where and says in x.expected for x in refused.value.complaints), refused.value


def test_contact_of_one_line_with_others_is_refused() -> None:
    tables = crossing(0.1)
    del tables["lines"]["upper"], tables["points"]["a"], tables["points"]["b"]
    with pytest.raises(SceneError, match="there is one line"):
        hybrid.static(tables)


def test_lines_that_are_within_each_other_wherever_they_begin_are_refused() -> None:
    """Straight under tension, their pins in one plane: nothing says which is above."""
    line = {"sections": [ROPE | {"length": 0.79}], "model": "rod", "mesh": {"cells": 40}, "contact": {"self": False}}
    tables = crossing(0.0)
    tables["lines"] = {"upper": line | {"start": "a", "end": "b"}, "lower": line | {"start": "c", "end": "d"}}
    tables["environment"] = {"gravity": 0}
    with pytest.raises(SceneError, match=r"contact[\s\S]*lines upper and lower are .* apart"):
        hybrid.static(tables)


# --- a current that drives a line against another one ----------------------------------------------------


def clash(speed: float) -> Tables:
    """An umbilical whose lower end is beyond a chain, in a current along both."""
    umbilical = {"length": 130, "mass": 18, "diameter": 0.12, "axial_stiffness": 2e8, "bending_stiffness": 5e3,
                 "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}  # fmt: skip
    chain = {"length": 210, "mass": 60, "diameter": 0.1, "axial_stiffness": 3e8, "bending_stiffness": 0,
             "drag": {"normal": 2.0, "tangential": 0.3}, "added_mass": {"normal": 1.0}}  # fmt: skip
    places = {"anchor": [180, 30, -90], "unit": [60, 10, -90], "fairlead": [12, -3, 0], "hangoff": [0, 0, -5]}
    return network_scene(
        {name: {"position": place} for name, place in places.items()},
        {"umbilical": line_between("unit", "hangoff", umbilical, mesh=65),
         "mooring": line_between("anchor", "fairlead", chain, mesh=75)},
        fluid={"density": 1025, "surface": 0, "current": [speed, 0, 0]}, seabed={"z": -90, "stiffness": 1e4},
        contact={"between": [["umbilical", "mooring"]]},
        output={"points": 76, "quantities": {"gap": {"kind": "clearance", "line": "umbilical", "other": "mooring"}}}
    )  # fmt: skip


@pytest.mark.long
def test_a_current_does_not_drive_a_line_through_another_one() -> None:
    """It lies against the chain, on the side on which it hangs in still water; without contact it is beyond it."""
    free, held, weak = (
        hybrid.static(clash(1.5) | {"contact": None}),
        hybrid.static(clash(1.5)),
        hybrid.static(clash(0.5)),
    )
    assert any(e.kind == "lines touch" for e in held.events)
    assert float(held["gap"][-1]) < 0.02 < 0.5 < float(free["gap"][-1])
    pressed = [float(np.trapezoid(x["self_contact"][0], x.s)) for x in held.lines.values()]
    assert pressed[0] == pytest.approx(pressed[1], rel=0.1) and pressed[0] > 100.0  # N, by means between outputs
    assert not any(e.kind == "lines touch" for e in weak.events) and float(weak["gap"][-1]) > 1.0


# --- Two ropes hooked through each other and pulled apart: the equilibrium from the scene, against the balance of
# each bight ---

WIDTH_OF_HOOKED, RISE, HALF, STRETCH = (
    0.02,
    0.4,
    0.02,
    0.01,
)  # m, half the distance of the ends of a bight; strain if it were taut
HOOKED = {
    "mass": 0.3,
    "diameter": WIDTH_OF_HOOKED,
    "axial_stiffness": 1e4,
    "bending_stiffness": 0.02,
    "max_strain": 0.1,
}


def bight(across: int, up: float, gap: float) -> list[list[float]]:
    """A U in a plane through z, its ends at z = up RISE, its bottom gap below that of the other, hooked through it."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
    bow = [(HALF * np.sin(x), -0.5 * gap + HALF * (1.0 - np.cos(x))) for x in turn]
    points = np.zeros((len(bow) + 2, 3))
    points[:, across], points[:, 2] = zip((-HALF, RISE), *bow, (HALF, RISE), strict=True)
    points[:, 2] *= up
    return [[float(x) for x in row] for row in points]


def clasp(turn: float = 0.0, **more: Any) -> dict[str, Any]:
    """Both bights, at right angles; turn: rad, of everything about x."""
    taut = (
        2.0 * (RISE - 0.5 * WIDTH_OF_HOOKED) + np.pi * WIDTH_OF_HOOKED
    )  # around the axis of the other rope, at a distance WIDTH_OF_HOOKED
    s = np.unique(np.concatenate([np.linspace(0, 0.5, 20), np.linspace(0.36, 0.5, 36), 1.0 - np.linspace(0.36, 0.5, 36),
                                  np.linspace(0.5, 1.0, 20)]).round(9))  # fmt: skip
    length = taut / (1.0 + STRETCH)
    c, d = np.cos(turn), np.sin(turn)
    R = np.array([[1, 0, 0], [0, c, -d], [0, d, c]])
    points: dict[str, Any] = {}
    lines: dict[str, Any] = {}
    for name, across, up in (("upper", 0, 1.0), ("lower", 1, -1.0)):
        shape = (np.array(bight(across, up, 1.2 * WIDTH_OF_HOOKED)) @ R.T).tolist()
        points |= {f"{name}_{end}": {"position": at} for end, at in (("a", shape[0]), ("b", shape[-1]))}
        lines[name] = {
            "start": f"{name}_a", "end": f"{name}_b", "sections": [HOOKED | {"length": length}], "model": "rod",
            "mesh": {"nodes": (length * s).tolist()}, "initial": {"points": shape}, "contact": {"self": False},
        }  # fmt: skip
    tables = {"environment": {"gravity": 0}, "points": points, "lines": lines, "contact": {}, "output": {"points": 201}}
    return tables | more


@pytest.fixture(scope="module")
def pulled() -> hybrid.Result:
    return hybrid.static(clasp())


@pytest.mark.long
def test_bights_press_on_each_other_by_the_pull_of_both_arms(pulled: hybrid.Result) -> None:
    """What their ends bear, and twice the tension but for what the arms lean: 2 T cos(lean)."""
    upper, lower = pulled.lines["upper"], pulled.lines["lower"]
    force = pulled["contacts/upper/lower/force"][0]
    on_upper = upper.reaction_start[0] + upper.reaction_end[0]
    on_lower = lower.reaction_start[0] + lower.reaction_end[0]
    np.testing.assert_allclose(on_upper, -on_lower, atol=1e-6 * on_upper[2])
    np.testing.assert_allclose(-force, on_upper, atol=2e-3 * on_upper[2])
    arm = np.argmin(np.abs(upper.s - 0.25 * upper.s[-1]))
    pull = 2.0 * float(upper.tension[0, arm])
    assert pull > 50.0
    assert -force[2] == pytest.approx(pull * abs(np.cos(upper.theta[0, arm])), rel=5e-3)
    assert -force[2] == pytest.approx(pull, rel=0.02)


def test_they_stay_hooked_a_diameter_apart(pulled: hybrid.Result) -> None:
    upper, lower = (x.position[0] for x in (pulled.lines["upper"], pulled.lines["lower"]))
    apart = np.linalg.norm(upper[:, None] - lower[None], axis=2).min()
    assert 0.88 * WIDTH_OF_HOOKED < apart < 1.05 * WIDTH_OF_HOOKED
    assert upper[:, 2].min() < lower[:, 2].max() - 0.85 * WIDTH_OF_HOOKED


def test_both_bights_have_the_same_shape(pulled: hybrid.Result) -> None:
    """A quarter turn with a mirror leads from one to the other."""
    upper, lower = (pulled.lines[x].position[0] for x in ("upper", "lower"))
    np.testing.assert_allclose(upper[:, [1, 0, 2]] * [1, 1, -1], lower, atol=1e-5)


def test_a_scene_turned_has_that_result(pulled: hybrid.Result) -> None:
    force = hybrid.static(clasp(turn=0.7))["contacts/upper/lower/force"][0]
    np.testing.assert_allclose(
        np.linalg.norm(force), np.linalg.norm(pulled["contacts/upper/lower/force"][0]), rtol=1e-4
    )


# --- forces by the name of what presses: of obstacles and of pairs of lines, against balances of forces ---

G, MASS, LENGTH = 9.81, 0.5, 4.0
CORD = {"length": LENGTH, "mass": MASS, "diameter": 0.02, "axial_stiffness": 1e5}
PIPES = {
    "left": {"kind": "cylinder", "at": [-0.8, 0, -0.75], "axis": [0, 1, 0], "radius": 0.4},
    "right": {"kind": "cylinder", "at": [0.7, 0, -0.9], "axis": [0, 1, 0], "radius": 0.35},
}


# --- obstacles --------------------------------------------------------------------------------------------


def laid(**more: Any) -> dict[str, Any]:
    """A cord whose ends are held, over two pipes of different size."""
    return cable_scene(
        CORD, pinned_at(-1.6, 0, 0.0), pinned_at(1.5, 0, -0.1), obstacles=PIPES, model="catenary", mesh=400,
        output={"points": 401}
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def over_pipes() -> hybrid.Result:
    return hybrid.static(laid())


def test_what_pipes_and_ends_bear_is_the_weight(over_pipes: hybrid.Result) -> None:
    forces = [over_pipes[f"obstacles/{x}/normal_force"][0] for x in PIPES]
    ends = over_pipes.reaction_start[0] + over_pipes.reaction_end[0]
    np.testing.assert_allclose(ends - sum(forces), [0, 0, MASS * G * LENGTH], atol=1e-6 * MASS * G * LENGTH)
    assert all(x[2] < -0.2 * MASS * G * LENGTH for x in forces)
    for name, force in zip(PIPES, forces, strict=True):
        total, most = (float(over_pipes[f"obstacles/{name}/{x}"][0]) for x in ("contact_force", "contact"))
        assert np.linalg.norm(force) < total < 1.5 * np.linalg.norm(force)
        assert total / most < np.pi * 0.41  # it lies on less than half of its way around


def test_each_pipe_bears_its_part(over_pipes: hybrid.Result) -> None:
    """What is left of a place between both is in balance without the right one."""
    k = int(np.abs(over_pipes.position[0, :, 0] + 0.1).argmin())
    theta, phi = over_pipes.theta[0, k], over_pipes.phi[0, k]
    tangent = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    weight = MASS * G * over_pipes.s[k] * np.array([0, 0, 1.0])
    left = over_pipes.reaction_start[0] + over_pipes.tension[0, k] * tangent - weight
    np.testing.assert_allclose(left, over_pipes["obstacles/left/normal_force"][0], atol=2e-4 * np.linalg.norm(left))


def test_the_energy_of_contact_is_that_of_its_partners(over_pipes: hybrid.Result) -> None:
    each = [float(over_pipes[f"obstacles/{x}/energy"][0]) for x in PIPES]
    assert min(each) > 0.0
    assert sum(each) == pytest.approx(float(over_pipes["energy/contact"][0]), rel=1e-9)


def test_facts_and_tables_name_the_pipe(over_pipes: hybrid.Result) -> None:
    first = over_pipes.contacts()[0]
    most = max(PIPES, key=lambda x: float(over_pipes[f"obstacles/{x}/contact"][0]))
    assert first.force == max(float(over_pipes[f"obstacles/{x}/contact_force"][0]) for x in PIPES)
    assert extremes_facts(over_pipes)["contact_max"]["partner"] == f"obstacle {most}"
    (fact,) = [x for x in facts_of(over_pipes) if x.key == "obstacles"]
    assert all(f"obstacle {x} bears at most" in fact.text for x in PIPES)


def test_a_floor_that_moves_bears_what_its_force_is() -> None:
    """Without friction and damping the normal force is all that the line does to it; in a plane, too."""
    motion = {"heave": {"amplitude": 0.05, "period": 1.0}, "ramp": 0.5}
    floor = {"kind": "plane", "at": [0, 0, 0], "normal": [0.1, 0, 1], "motion": motion}
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0.4]}, "end": {"kind": "pinned", "position": [3.7, 0, 0.5]}}
    cord = CORD | {"bending_stiffness": 0.5, "damping": {"mass": 2.0}}
    tables = laid(obstacles={"floor": floor}, ends=ends, model="rod", time={"duration": 0.6, "step": 0.005})
    tables |= {"cable": {"sections": [cord]}, "mesh": {"cells": 80}, "output": {"points": 11, "every": 0.1}}
    for dimension in (2, 3):
        result = hybrid.run(tables | {"dimension": dimension})
        force = result["obstacles/floor/force"]
        assert np.abs(force[:, 2]).min() > 1.0 and np.ptp(force[:, 2]) > 0.5
        np.testing.assert_allclose(result["obstacles/floor/normal_force"], force, atol=1e-6 * np.abs(force).max())


# --- lines ------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_crossing_ropes_press_by_the_force_of_the_reference() -> None:
    """In N, whatever the cells are: what the one rope does to the other is what their pins lack."""
    for cells in (60, 100):
        result = hybrid.static(each_line(crossing(0.1), mesh=cells))
        force = result["contacts/upper/lower/force"][0]
        off, on = force_between(result, 0)
        assert force[2] == pytest.approx(off, rel=1e-3) and force[2] == pytest.approx(on, rel=1e-3)
        assert force[2] == pytest.approx(FORCES[0.1], rel=0.01)
        assert result["contacts/upper/lower/contact_force"][0] == pytest.approx(np.linalg.norm(force), rel=0.01)
        assert extremes_facts(result.lines["upper"])["contact_max"]["partner"] == "line lower"
        (pair,) = result.contacts()
        assert pair.partner == "lines upper and lower" and pair.force == result[f"{pair.group}/contact_force"][0]


def test_a_rope_across_two_others_presses_on_each_by_its_own_force() -> None:
    """Each pair by the balance of the lower rope alone."""
    line = {"sections": [ROPE], "model": "rod", "mesh": {"cells": 80}, "contact": {"self": False}}
    points = {"a": [-0.4, 0, -0.15], "b": [0.4, 0, -0.15], "c": [-0.1, -0.4, 0], "d": [-0.1, 0.4, 0],
              "e": [0.15, -0.4, 0.02], "f": [0.15, 0.4, 0.02]}  # fmt: skip
    above = {"points": [[-0.4, 0, -0.15], [0, 0, 0.15], [0.4, 0, -0.15]]}
    result = hybrid.static({
        "points": {name: {"position": at} for name, at in points.items()},
        "lines": {"one": line | {"start": "c", "end": "d"}, "over": line | {"start": "a", "end": "b", "initial": above},
                  "two": line | {"start": "e", "end": "f"}},
        "contact": {"between": [["one", "over"], ["over", "two"]]}, "output": {"points": 81},
    })  # fmt: skip
    for name, pair, sign in (("one", "one/over", -1.0), ("two", "over/two", 1.0)):
        lower = result.lines[name]
        on = float(lower.reaction_start[0, 2] + lower.reaction_end[0, 2]) - WEIGHT
        assert on > 0.05 and sign * result[f"contacts/{pair}/force"][0, 2] == pytest.approx(on, rel=2e-3)
    assert "contacts/one/two/force" not in result


@pytest.mark.long
def test_the_largest_force_at_rest_is_that_of_nodes_whatever_the_output_points_are() -> None:
    """On the pair, from which of both lines it is looked at; five output points have the crossing, sixteen do not."""
    largest = []
    for points in (5, 16):
        result = hybrid.static(crossing(0.1) | {"output": {"points": points}})
        (pair,) = result.contacts()
        each = [extremes_facts(x)["contact_max"]["value"] for x in result.lines.values()]
        assert max(each) == pytest.approx(pair.contact, rel=1e-6)
        largest.append(each)
    assert largest[0] == pytest.approx(largest[1], rel=1e-12)
