"""Lines that meet at points: a line that is cut is the same line, and closed forms of bridles and moorings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from problems import at_rest
from scipy.optimize import root

import hybrid
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.step.line_step import TOLERANCE
from hybrid.model.build import Model, build
from hybrid.scene.read import one_line
from hybrid.simulation.run import Run, new_run
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import JoinedLine, NetworkState, joined_ends
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

LENGTH, CELLS = 100.0, 40
A, B = np.zeros(3), np.array([70.0, 10.0, -20.0])
SECTION = {"mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "drag": {"normal": 1.2}, "added_mass": {"normal": 1}}
WATER = {"fluid": {"density": 1025, "current": [0.3, 0.2, 0]}}


def piece(kind: str, length: float, a: np.ndarray, b: np.ndarray, cells: int) -> Model:
    section = SECTION | {"length": length} | ({"bending_stiffness": 20.0} if kind == "rod" else {})
    tables = cable_scene(
        section, pinned_at(*a.tolist()), pinned_at(*b.tolist()), model=kind, mesh=cells, environment=WATER
    )
    return build(one_line(hybrid.validate_scene(tables)))


class Cut:
    """A line in one piece with hinges, and the same line cut at them, pieces in any orientation."""

    def __init__(self, kind: str, cuts: Sequence[int], flips: Sequence[int]) -> None:
        self.whole = piece(kind, LENGTH, A, B, CELLS)
        element = self.whole.line.element.copy()
        element[list(cuts)] = 0
        self.line, self.flips = self.whole.line._replace(element=element), flips
        self.edges = [0, *cuts, CELLS]
        self.sea, self.ends = self.whole.sea.at_time(np.inf), self.whole.ends.at_time(np.inf)
        self.state = at_rest(replace(self.whole, line=self.line), np.inf).state.lines[0]
        off = np.random.default_rng(1).uniform(-0.6, 0.6, (len(cuts), 3))
        places = [A, *(self.state.r[list(cuts)] + off), B]
        lines, self.start = [], []
        for i, flipped in enumerate(flips):
            ends, joints = (places[i], places[i + 1]), (i - 1, i if i < len(cuts) else -1)
            if flipped:
                ends, joints = ends[::-1], joints[::-1]
            n = self.edges[i + 1] - self.edges[i]
            model = piece(kind, LENGTH * n / CELLS, *ends, n)
            held, scale = joined_ends(model.ends.at_time(np.inf), joints), model.tension_scale
            lines.append(JoinedLine(model.line, model.sea.at_time(np.inf), held, model.length, scale, -np.inf, joints))
            self.start.append(model.start)
        self.solver = NetworkSolver(lines, len(cuts))
        whole = JoinedLine(self.line, self.sea, self.ends, LENGTH, self.whole.tension_scale, -np.inf, (-1, -1))
        self.in_one = NetworkSolver([whole], 0)
        self.accelerations = self.in_one.consistent_accelerations

    def apart(self, states: Sequence[Any], name: str, state: Any) -> float:
        """Largest difference of an array of nodes or cells from that of the line in one piece."""
        whole, worst = getattr(state, name), 0.0
        for i, each in enumerate(states):
            mine = getattr(each, name)[::-1] if self.flips[i] else getattr(each, name)
            worst = max(worst, float(np.abs(mine - whole[self.edges[i] :][: len(mine)]).max()))
        return worst

    def move(self, position: np.ndarray) -> None:
        """Move the end of the line, in one piece and in pieces."""
        self.ends.position[1] = position
        self.solver.lines[-1].ends.position[0 if self.flips[-1] else 1] = position


@pytest.mark.parametrize("kind", ["catenary", "rod"])
@pytest.mark.parametrize(
    ("cuts", "flips"), [([16], (0, 0)), ([16], (1, 1)), ([8, 16, 30], (0, 1, 1, 1)), ([8, 12, 20, 32], (1, 0, 1, 0, 1))]
)
def test_a_line_cut_at_any_node_is_the_same_line(kind: str, cuts: list[int], flips: tuple[int, ...]) -> None:
    """Statics to 1e-9 of the length, Newton from places 0.6 m off; a step in motion to Newton's tolerance."""
    cut = Cut(kind, cuts, flips)
    taken, found = cut.solver.newton(NetworkState(cut.start))
    states = found.lines
    assert taken.outcome == Outcome.OK and taken.iterations <= 12
    assert taken.residual < 1e-9 * np.abs(cut.state.T).max()
    assert cut.apart(states, "r", cut.state) < 1e-9 * LENGTH
    assert cut.apart(states, "T", cut.state) < 1e-9 * cut.state.T.max()

    old, others = cut.state.copy(), found.copy()
    assert cut.accelerations(NetworkState([old]), [np.zeros((2, 3))]).outcome == Outcome.OK
    assert cut.solver.consistent_accelerations(found, [np.zeros((2, 3))] * len(flips)).outcome == Outcome.OK
    new, dt, before, iterations = old.copy(), 0.05, 0.0, [0, 0]
    for k in range(1, 81):
        cut.move(B + np.array([0.1, 0.0, 0.3]) * (1.0 - np.cos(2.0 * np.pi * k * dt / 3.0)))
        one = cut.in_one.step(NetworkState([old]), NetworkState([new]), dt, 0.8, before, 0.8)
        many = cut.solver.step(found, others, dt, 0.8, before, 0.8)
        assert one.outcome == many.outcome == Outcome.OK
        old, new, found, others, before = new, old, others, found, dt
        iterations = [iterations[0] + one.iterations, iterations[1] + many.iterations]
    assert iterations[1] <= iterations[0] + 8  # pieces are smaller: the same shift is a larger part of them
    # what Newton leaves in a step, in 80 steps
    states = found.lines
    assert cut.apart(states, "r", old) < 10 * TOLERANCE * LENGTH
    assert cut.apart(states, "T", old) < 100 * TOLERANCE * old.T.max()


def test_what_consistent_accelerations_are() -> None:
    """A heavy point let go: cut and uncut lines accelerate alike, on both sides of the cut."""
    cut = Cut("catenary", [16], (0, 0))
    _, found = cut.solver.newton(NetworkState(cut.start))
    states = found.lines
    state = cut.state.copy()
    state.v[:, 2] = np.sin(np.pi * cut.whole.line.s / LENGTH)
    for i, each in enumerate(states):  # the same to the last digit: lengths make tension
        nodes = slice(cut.edges[i], cut.edges[i + 1] + 1)
        each.r[:], each.v[:] = state.r[nodes], state.v[nodes]
        each.e[:], each.T[:] = state.e[nodes][: each.T.size], state.T[nodes][: each.T.size]
    cut.accelerations(NetworkState([state]), [np.zeros((2, 3))])
    cut.solver.consistent_accelerations(found, [np.zeros((2, 3))] * 2)
    assert np.abs(state.vd).max() > 0.1
    assert cut.apart(states, "vd", state) < 1e-9 * np.abs(state.vd).max()


# --- closed forms --------------------------------------------------------------------------------------


def equilibrium(tables: dict[str, Any]) -> Run:
    """The equilibrium of a network, not yet written."""
    import io

    return new_run(hybrid.Scene.model_validate(tables), io.BytesIO(), "", moves=False)


def test_a_bridle_without_weight_against_its_force_polygon() -> None:
    """Three elastic legs without weight: their lengths and the force polygon are six equations, solved apart."""
    EA, legs, force = 2e5, (12.0, 15.0, 8.0), np.array([300.0, 80.0, -900.0])
    a, b = np.array([-8.0, 0.0, 0.0]), np.array([9.0, 2.0, 1.0])

    def line(start: str, end: str, length: float) -> dict[str, Any]:
        sections = [{"length": length, "mass": 0.5, "axial_stiffness": EA}]
        return {"start": start, "end": end, "sections": sections, "mesh": {"cells": 4}}

    found = equilibrium(network_scene(
        {"a": {"position": a.tolist()}, "b": {"position": b.tolist()},
         "knot": {"kind": "free", "initial_guess": [1, 0, -9]},
         "load": {"kind": "free", "initial_guess": [2, 1, -17], "force": force.tolist()}},
        {"left": line("a", "knot", legs[0]), "right": line("knot", "b", legs[1]), "down": line("knot", "load", legs[2])},
        gravity=0.0
    ))  # fmt: skip

    def pull(span: np.ndarray, length: float) -> np.ndarray:
        distance = np.linalg.norm(span)
        return EA * (distance / length - 1.0) * span / distance

    def balance(x: np.ndarray) -> np.ndarray:
        knot, load = x[:3], x[3:]
        down = pull(load - knot, legs[2])
        return np.concatenate([pull(a - knot, legs[0]) + pull(b - knot, legs[1]) + down, force - down]) / 1e3

    exact = root(balance, np.array([1.0, 0, -9, 2, 1, -17]), tol=1e-14).x
    left, _, down = found.found.state.lines
    assert np.abs(left.r[-1] - exact[:3]).max() < 1e-9 * legs[1]
    assert np.abs(down.r[-1] - exact[3:]).max() < 1e-9 * legs[1]
    assert np.abs(down.T - np.linalg.norm(force)).max() < 1e-9 * np.linalg.norm(force)


@pytest.mark.parametrize("flipped", [0, 1])
def test_a_symmetric_mooring_of_three_lines_against_one_of_them(flipped: int) -> None:
    """By symmetry the buoy stands in the middle, and a third of its lift ends in each line: a chain of links, exactly."""
    n, length, mass, EA, g, lift = 30, 60.0, 8.0, 1e7, 9.81, 9000.0
    radius, depth = 40.0, 50.0
    points: dict[str, Any] = {
        f"anchor{k}": {"position": [radius * np.cos(x), radius * np.sin(x), -depth]}
        for k, x in enumerate(2.0 * np.pi * np.arange(3) / 3.0)
    }
    points["buoy"] = {"kind": "free", "initial_guess": [3, -2, -6], "force": [0, 0, lift]}
    sections = [{"length": length, "mass": mass, "axial_stiffness": EA}]
    lines = {}
    for k in range(3):
        ends = ("buoy", f"anchor{k}") if flipped and k == 1 else (f"anchor{k}", "buoy")
        lines[f"line{k}"] = {"start": ends[0], "end": ends[1], "sections": sections, "mesh": {"cells": n}}
    states = equilibrium({"points": points, "lines": lines}).found.state.lines

    h, w = length / n, mass * length / n * g

    def reached(level: float) -> np.ndarray:
        up = lift / 3.0 - 0.5 * w - w * np.arange(n)  # vertical force in the links from the buoy down
        T = np.hypot(level, up)
        return h * (1.0 + T / EA) * np.array([level / T, up / T])

    level = root(lambda x: reached(x[0])[0].sum() - radius, np.array([3000.0]), tol=1e-14).x[0]
    top = -depth + reached(level)[1].sum()
    for k, state in enumerate(states):
        buoy = state.r[0] if flipped and k == 1 else state.r[-1]
        assert np.abs(buoy - [0.0, 0.0, top]).max() < 1e-9 * length
        T = np.hypot(level, lift / 3.0 - 0.5 * w - w * np.arange(n))
        mine = state.T if flipped and k == 1 else state.T[::-1]
        assert np.abs(mine - T).max() < 1e-9 * T.max()


def test_lines_that_go_slack_are_refused_with_their_name() -> None:
    """A point that is pulled along one line leaves the other, too long for it, without tension."""
    section = {"mass": 1.0, "axial_stiffness": 1e6}
    tables = network_scene(
        {"a": {"position": [0, 0, 0]}, "b": {"position": [10, 0, 0]},
         "knot": {"kind": "free", "initial_guess": [5, 0, -1], "force": [-100, 0, 0]}},
        {"short": line_between("a", "knot", section | {"length": 6}, mesh=4),
         "long": line_between("knot", "b", section | {"length": 18}, mesh=4)},
        gravity=0.0
    )  # fmt: skip
    with pytest.raises(ComputationError) as refused:
        equilibrium(tables)
    assert refused.value.outcome in (Outcome.SLACK, Outcome.SINGULAR, Outcome.NOT_CONVERGED)
    assert "line " in str(refused.value) or "the points" in str(refused.value)


@pytest.mark.parametrize("ship", [False, True])
def test_a_first_place_that_is_forgotten_at_the_origin_is_named(ship: bool) -> None:
    """Anchors in coordinates of a map, and `initial_guess` left at zero: shapes of `initial` were said to help."""
    place = {"initial_guess": [0, 0, 0], "mass": 500.0, "volume": 2.0}
    section = {"length": 70.0, "mass": 3.0, "diameter": 0.03, "axial_stiffness": 1e6}
    tables: dict[str, Any] = network_scene(
        {
            "west": {"position": [500_000, 6.7e6, -40]},
            "east": {"position": [500_100, 6.7e6, -40]},
            "buoy": {"body": "ship", "place": [0, 0, 0]} if ship else place,
        },
        {name: line_between(name, "buoy", section, mesh=20) for name in ("west", "east")},
        fluid={"density": 1025.0},
    )
    if ship:
        tables["bodies"] = {"ship": place | {"inertia": [500.0, 500.0, 500.0]}}
    with pytest.raises(ComputationError) as refused:
        hybrid.static(tables)
    key = "bodies.ship" if ship else "points.buoy"
    assert f"try:      {key}.initial_guess nearer: 6.71864e+06 m from points.east" in str(refused.value)
    assert "is 70 m long; else " in str(refused.value)


@pytest.mark.parametrize("below", [False, True])
def test_a_straight_wire_pulls_alike_whichever_way_it_is_written(below):
    pulls = []
    for ends in (("top", "load"), ("load", "top")):
        section = {"length": 40.0, "mass": 1.0, "diameter": 0.02, "bending_stiffness": 10.0}
        line = {"sections": [section], "mesh": {"cells": 20}, "model": "rod"}
        points = {
            "top": {"position": [0, 0, 0], "motion": {"heave": {"amplitude": 0.5, "period": 3.0}, "ramp": 3.0}},
            "load": {"kind": "free", "mass": 80.0, "volume": 0.0, "initial_guess": [0, 0, -40]},
        }
        lines = {"wire": {**line, "start": ends[0], "end": ends[1]}}
        if below:
            points["low"] = {"kind": "free", "mass": 20.0, "volume": 0.0, "initial_guess": [0, 0, -50]}
            lines["below"] = {**line, "sections": [section | {"length": 10.0}], "mesh": {"cells": 5},
                              "start": "load", "end": "low"}  # fmt: skip
        else:
            points["load"] = {"body": "box", "place": [0, 0, 0.5]}
        scene = {"points": points, "lines": lines, "time": {"duration": 2.0, "step": 0.05}, "output": {"every": 0.25}}
        if not below:
            scene["bodies"] = {
                "box": {"mass": 2000.0, "volume": 0.0, "inertia": [300] * 3, "initial_guess": [0, 0, -40.5]}
            }
        wire = hybrid.run(scene).lines["wire"]
        pulls.append(wire["reaction_start" if ends[0] == "top" else "reaction_end"])
    assert np.abs(pulls[0] - pulls[1]).max() < 1e-6 * np.abs(pulls[0]).max()
