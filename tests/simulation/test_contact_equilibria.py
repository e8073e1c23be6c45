"""Equilibria of lines that touch themselves: zones, runs from there; whether equilibria with contact would stay."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
import yaml

import hybrid
from hybrid.errors import ComputationError, Outcome
from hybrid.model.network import build_network
from hybrid.simulation import equilibrium
from hybrid.simulation.equilibrium import equilibrium_of
from hybrid.simulation.lines_contact import JUMP, gauss_integral, jumps, may_pass
from hybrid.solve.lines_at_rest import ContactStability, LinesAtRest, contact_stiffness
from hybrid.solve.search import PUSHED
from hybrid.solve.stepper import LineFailed
from tests.scenes import cable_scene, line_between, network_scene, pinned_at, system_of
from tests.validation.test_validation_lines_contact import crossing

WIDTH, LENGTH = 0.02, 8.0
LEGS = {"zones": [{"catenary": 3.0}, {"rod": 2.0}, {"catenary": 3.0}]}
MESH = {"mesh": {"cells": 160}}


def hanging(model: Any, **more: Any) -> dict[str, Any]:
    """A U with a weight, whose legs lie against each other below ends that are 0.9 diameters apart; it starts open."""
    section = {
        "length": LENGTH, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.02,
        "torsional_stiffness": 0.016, "damping": {"mass": 0.5},
    }  # fmt: skip
    y = 0.9 * WIDTH
    open_ = [[0, 0, 0], [-1, 0, -2], [0, 0.5 * y, -3.7], [1, y, -2], [0, y, 0]]
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(0, y, 0), attachments=[{"kind": "clump", "at": 4.0, "mass": 1.0}],
        model=model, contact={"self": True, "friction": 0.3}, initial={"kind": "equilibrium", "points": open_},
        time=(0.3, 0.01), output=(0.1, 81)
    ) | more  # fmt: skip


def twisted(model: Any) -> dict[str, Any]:
    """Three turns between clamps half the length apart."""
    section = {
        "length": 4.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.5,
        "torsional_stiffness": 0.4,
    }  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    return cable_scene(
        section, clamp | {"position": [0, 0, 0]}, clamp | {"position": [2.0, 0, 0], "turns": 3}, gravity=0.5,
        model=model, contact={"self": True}
    )  # fmt: skip


def apart(result: hybrid.Result) -> float:
    """Least distance of the line from itself, in diameters."""
    return float(result["self_distance/distance"]) / WIDTH


def stays(tables: dict[str, Any], static: hybrid.Result, within: float) -> None:
    """A run with friction begins in the equilibrium without, and stays."""
    result = hybrid.run(tables)
    assert np.abs(result["position"] - static["position"]).max() < within
    assert result["energy/self_contact"] == pytest.approx(float(static["energy/self_contact"][0]), rel=1e-5)
    assert any(e.kind == "static friction neglected" and "touches itself" in e.text for e in result.events)


@pytest.mark.slow
def test_zones_of_an_equilibrium_in_contact() -> None:
    """What touches is rod, what hangs free between is catenary, and it lies where rods on the same nodes lie."""
    mesh = {"mesh": {"cells": 200}}  # on the 100 of a scene that names none the bend at the weight holds the legs apart
    tables = hanging("adaptive", **mesh)
    result = hybrid.static(tables)
    rods = hybrid.static(hanging({"kind": "adaptive", "force_rod": [[0.0, LENGTH]]}, **mesh))
    assert {z.kind for z in rods.zones[0]} == {"rod"} and {z.kind for z in result.zones[0]} == {"rod", "catenary"}
    kinds = {e.kind for e in result.events}
    assert "line touches itself" in kinds and "stability not judged" not in kinds
    touching = result.s[result["self_contact"][0] > 0.0]
    assert touching.size and result["energy/self_contact"][0] > 0.0
    assert all(any(z.kind == "rod" and z.s_a <= s <= z.s_b for z in result.zones[0]) for s in touching)
    assert 0.94 < apart(result) < 1.0
    assert np.linalg.norm(result["position"] - rods["position"], axis=2).max() < 1e-4 * LENGTH
    assert result["energy/self_contact"][0] == pytest.approx(float(rods["energy/self_contact"][0]), rel=0.05)
    stays(tables, result, 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("more", [0.0, 1e-3, -1e-2])
def test_fixed_zones_in_contact(more: float) -> None:
    """The legs of the U are catenaries, which touch below the ends; the same as rods on the same nodes.

    more: part of its mass, by which it comes to rest on another way.
    """
    tables = hanging(LEGS, **MESH)
    tables["cable"]["sections"][0]["mass"] *= 1.0 + more
    result = hybrid.static(tables)
    rods = hybrid.static(tables | {"model": "rod"})
    assert 0.94 < apart(result) < 1.0 and result["energy/self_contact"][0] > 0.0
    assert np.linalg.norm(result["position"] - rods["position"], axis=2).max() < 1e-5 * LENGTH
    stays(tables, result, 1e-9)


def test_stretches_that_stay_catenary_touch() -> None:
    model = {"kind": "adaptive", "force_catenary": [[0.0, 1.5], [6.5, 8.0]]}
    result = hybrid.static(hanging(model))
    assert result.zones[0][0].kind == result.zones[0][-1].kind == "catenary"
    assert result.zones[0][0].s_b >= 1.5 and 0.94 < apart(result) < 1.05


@pytest.mark.long
def test_a_loop_in_zones_that_move_is_rod() -> None:
    """A torque that throws a loop asks for rods from end to end."""
    result = hybrid.static(twisted("adaptive"))
    assert {z.kind for z in result.zones[0]} == {"rod"} and 0.94 < apart(result) < 1.05
    assert result["turns/link"][0] == pytest.approx(3.0, abs=1e-9) and result["turns/writhe"][0] > 1.5
    assert result["envelope/self_contact_max"].max() >= result["self_contact"].max() > 0.0  # limits count at all nodes


@pytest.mark.long
def test_a_catenary_that_a_loop_presses_is_refused() -> None:
    """Between catenaries at both clamps the loop pushes; they cannot carry that, and the message says where."""
    with pytest.raises(hybrid.ComputationError, match=r"compression; a catenary cannot carry it \(s = "):
        hybrid.static(twisted({"zones": [{"catenary": 0.4}, {"rod": 3.2}, {"catenary": 0.4}]}))


def test_strands_that_are_too_close_along_the_line_for_contact() -> None:
    """Ends 0.9 diameters apart, legs that spread from there: what is nearer is beside both ends, which is no contact."""
    tables = hanging("rod", mesh={"cells": 80})
    tables["cable"]["sections"][0] |= {"length": 4.0}
    tables["cable"]["attachments"][0] |= {"at": 2.0, "mass": 2.0}
    tables["initial"]["points"] = [[0, 0, 0], [-0.5, 0, -1.0], [0, 0.009, -1.85], [0.5, 0.018, -1.0], [0, 0.018, 0]]
    result = hybrid.static(tables)
    assert result["energy/self_contact"][0] == 0.0 and apart(result) < 1.0
    assert "line touches itself" in {e.kind for e in result.events}


def knotted(**more: Any) -> dict[str, Any]:
    """A cord in a trefoil between two pins, apart from itself; its bends are short against the loops under its weight."""
    t = np.linspace(-2.05, 2.05, 60)
    p = np.column_stack([t**3 - 3 * t, 4 * t**2 - t**4, (t**5 - 10 * t) / 6]) * 0.05
    tails = [(a - b) / np.linalg.norm(a - b) for a, b in ((p[0], p[1]), (p[-1], p[-2]))]
    points = np.vstack([p[0] + 0.4 * tails[0], p, p[-1] + 0.4 * tails[1]])
    section = {
        "length": float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()), "mass": 0.1, "diameter": 0.012,
        "axial_stiffness": 2e4, "bending_stiffness": 1e-4,
    }  # fmt: skip
    return cable_scene(
        section, {"kind": "pinned", "position": points[0].tolist()},
        {"kind": "pinned", "position": points[-1].tolist()}, gravity=5.0, model="rod", mesh=280, contact={"self": True},
        initial={"kind": "equilibrium", "points": points.tolist()}
    ) | more  # fmt: skip


@pytest.mark.long
def test_a_knot_that_is_given_is_a_knot_at_rest() -> None:
    """Without contact the line is a catenary, which it reaches by passing through itself: a writhe of 0 for -3."""
    scene = knotted()
    given, free = np.array(scene["initial"]["points"]), hybrid.static(knotted(contact={"self": False})).position[0]
    assert gauss_integral(given, given) == pytest.approx(-3.15, abs=0.01)
    assert abs(gauss_integral(free, free)) < 0.01
    tight = hybrid.static(scene)
    assert gauss_integral(tight.position[0], tight.position[0]) == pytest.approx(-3.15, abs=0.1)
    assert apart(tight) * WIDTH > 0.94 * 0.012 and "line touches itself" in {e.kind for e in tight.events}


def test_lines_that_a_plane_parts_do_not_pass_through_each_other() -> None:
    """Random ways, every third of lines that are joined, or nearly flat: what passes is never left out."""
    random, passing, parted = np.random.default_rng(1), 0, 0
    for k in range(90):
        first = [np.cumsum(0.3 * random.standard_normal((n, 3)), axis=0) for n in random.integers(2, 12, 2)]
        a, b = (np.stack([x, x + 0.3 * random.standard_normal(x.shape)]) for x in first)
        a += random.standard_normal(3)
        a[1] += 0.5 * random.standard_normal(3)
        if k % 3 == 0:
            b[:, 0] = a[:, -1]
        elif k % 3 == 1:
            a[..., 2] *= 0.01
        may, does = may_pass(a, b), jumps(a, b) > JUMP
        assert may or not does
        passing, parted = passing + does, parted + (not may)
    assert passing > 3 and parted > 30


def test_no_two_legs_of_a_ring_are_looked_at_for_passages() -> None:
    """Their bounds overlap, and their ends are one point: a hundred legs took 220 s."""
    parts, legs = np.linspace(0.0, 1.0, 21), []
    for x in np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False):
        shapes = [(100 * np.cos(x) * parts, 100 * np.sin(x) * parts, -d * parts * (2.0 - parts)) for d in (40.0, 50.0)]
        legs.append(np.moveaxis(np.array(shapes), 1, 2))
    assert not any(may_pass(a, b) for a, b in combinations(legs, 2))


@pytest.mark.long
def test_a_line_that_loses_its_turns_without_contact_is_found_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing is asked of contact: the equilibrium, and whether it stays, are those of a line that asks for it."""

    def lost(*_: object) -> NoReturn:
        raise LineFailed(0, Outcome.TURNS_LOST, None, 0.0, "on all ways")

    tables = twisted("rod") | {"mesh": {"cells": 80}}
    asked = hybrid.static(tables)
    del tables["contact"]
    monkeypatch.setattr(equilibrium, "_without_contact", lost)
    found = hybrid.static(tables)
    np.testing.assert_allclose(found.position, asked.position, rtol=0.0, atol=1e-12)
    judged = ["stability not judged" in {e.kind for e in x.events} for x in (asked, found)]
    assert judged[0] == judged[1]


# --- Equilibria of networks with lines that touch themselves: beside each other, at a body, and runs that begin there
# ---

HOSE = {
    "length": 4.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.02,
    "torsional_stiffness": 0.016, "damping": {"mass": 0.5},
}  # fmt: skip
LINE = {
    "sections": [HOSE], "attachments": [{"kind": "clump", "at": 2.0, "mass": 2.0}], "mesh": {"cells": 160},
    "contact": {"self": True, "friction": 0.3},
}  # fmt: skip
Y = 0.9 * WIDTH  # m, between the ends of a U
OPEN = [[0, 0, 0], [-0.5, 0, -1.0], [0, 0.5 * Y, -1.85], [0.5, Y, -1.0], [0, Y, 0]]
COMMON = {"time": {"duration": 0.3, "step": 0.01}, "output": {"every": 0.1, "points": 81}}


def beside_each_other(*shifts: float) -> dict[str, Any]:
    """Us whose ends are 0.9 diameters apart, with a weight, y (m) apart; all have the first shape of the first."""
    points, lines = {}, {}
    for k, y in enumerate(shifts):
        points |= {f"a{k}": {"position": [0, y, 0]}, f"b{k}": {"position": [0, y + Y, 0]}}
        lines[f"line {k}"] = LINE | {"start": f"a{k}", "end": f"b{k}", "model": "adaptive", "initial": {"points": OPEN}}
    return COMMON | {"points": points, "lines": lines}


def at_a_body(y: float = -0.01) -> dict[str, Any]:
    """One leg hangs on a body that two ropes, which end at y (m), pull against the other leg; nothing holds its yaw."""
    rope = {"sections": [{"length": 1.1, "mass": 0.1, "axial_stiffness": 1e5}], "model": "catenary", "start": "free"}
    first = [[0, 0, 0], [-0.3, -0.3, -1.0], [0, 0, -1.8], [0.3, 0.3, -1], [0, 0.3, 0.1]]
    return COMMON | network_scene(
        {"a": {"position": [0, 0, 0]}, "left": {"position": [-0.6, y, 0.75]}, "right": {"position": [0.6, y, 0.75]},
         "free": {"kind": "fairlead", "body": "pod", "place": [0, 0, -0.05]}},
        {"hose": LINE | {"start": "a", "end": "free", "model": "rod", "initial": {"points": first}},
         "left": rope | {"end": "left", "mesh": {"cells": 5}}, "right": rope | {"end": "right", "mesh": {"cells": 5}}},
        bodies={"pod": {"kind": "free", "mass": 1.0, "inertia": [0.1] * 3, "initial_guess": [0, 0.3, 0.15]}}
    )  # fmt: skip


def stays_beside_body(scene: dict[str, Any], static: hybrid.Result, name: str) -> None:
    """A run with friction begins in the equilibrium without, and stays."""
    run = hybrid.run(scene, progress=False).lines[name]
    assert np.abs(run.position - static.lines[name].position).max() < 1e-9
    energy = float(static.lines[name]["energy/self_contact"][0])
    assert run["energy/self_contact"] == pytest.approx(energy, rel=1e-5)


@pytest.mark.long
def test_a_line_that_a_body_presses_against_itself() -> None:
    scene = at_a_body()
    result = hybrid.static(scene)
    hose = result.lines["hose"]
    assert hose["energy/self_contact"][0] > 0.0 and 0.94 < float(hose["self_distance/distance"]) / WIDTH < 1.05
    assert result.attributes["static_residual"] < 1e-9
    without = at_a_body()
    without["lines"]["hose"]["contact"] = {"self": False}
    there = hybrid.static(without)["bodies/pod/position"][0]
    assert np.linalg.norm(result["bodies/pod/position"][0] - there) > 1e-4  # the contact holds it off
    stays_beside_body(scene, result, "hose")


@pytest.mark.long
@pytest.mark.parametrize("y", [-0.005, -0.02])
def test_the_stiffness_of_a_body_in_contact(y: float) -> None:
    """That of the forces on the body held on both sides, with the contact of the node at its fairlead; yaw is free."""
    scene = at_a_body(y)
    K = hybrid.stiffness(scene, "body:pod").matrix
    assert np.abs(K - K.T).max() < 1e-4 * np.abs(K).max()
    assert np.abs(K[5]).max() < 1e-5 * np.abs(K[3:5]).max()
    for k, heading in enumerate((0.0, 90.0)):
        held = hybrid.offsets(scene, "body:pod", [-2e-5, 2e-5], heading=heading)
        for found, there in ((K[:3, k], held.force), (K[3:, k], held.moment)):
            assert found == pytest.approx((there[0] - there[1]) / 4e-5, rel=3e-3, abs=1e-4 * np.abs(found).max())


@pytest.mark.long
def test_without_a_seabed_no_friction_settles() -> None:
    """What settles is friction on the bed: a line that has none rests where it rests without."""
    scene = beside_each_other(0.0)
    neglected = hybrid.static(scene).lines["line 0"]
    scene["lines"]["line 0"] |= {"initial": {"points": OPEN, "friction": "settled"}}
    assert np.array_equal(hybrid.static(scene).lines["line 0"].position, neglected.position)


# --- Ways over unstable equilibria. A column beyond Greenhill's load falls to a side that nothing chooses, which is
# said; below it stands ---

DEFECTS = Path(__file__).parents[1] / "data" / "defects"

GREENHILL = 7.8373  # w L^3/EI at which a column that is clamped at its foot buckles under its own weight


@pytest.mark.parametrize(("load", "cells", "falls"), [(0.9, 20, False), (1.5, 20, True), (1.5, 300, True)])
def test_the_side_that_nothing_chooses(load: float, cells: int, falls: bool) -> None:
    section = {"length": 1.0, "mass": load * GREENHILL / 9.81, "diameter": 0.01, "bending_stiffness": 1.0}
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, 1]}
    what = cable_scene(section, clamp, {"kind": "free"}, gravity=9.81, model="rod", mesh=cells)
    result = hybrid.static(what)
    said = [x.text for x in result.events if x.kind == "several equilibria"]
    assert bool(said) == falls == (result.position[-1, -1, 2] < 0.9)
    assert all("initial.points" in text for text in said)


@pytest.mark.long
@pytest.mark.parametrize(("name", "cells", "orcaflex"), [("lazy_s", 200, 59640.7), ("lazy_wave", 400, 24172.9)])
def test_a_line_is_pushed_off_each_unstable_equilibrium_that_is_met(name: str, cells: int, orcaflex: float) -> None:
    """0.6.0 refused both, unless the scene said `guess: arc` or `guess: span`."""
    scene = hybrid.load_scene(DEFECTS / f"equilibrium_refused_{name}.yaml", [f"mesh.cells={cells}"])
    found = hybrid.static(scene)
    assert np.linalg.norm(found.reaction_start[-1]) == pytest.approx(orcaflex, rel=1e-3)
    assert "several equilibria" in {event.kind for event in found.events}


# --- equilibria that are wound up ---

PAGE = (Path(__file__).parents[2] / "docs" / "points.md").read_text(encoding="utf-8")
SCENE = next(x.partition("```")[0] for x in PAGE.split("```yaml\n")[1:] if x.startswith("# cantilever.yaml"))


@pytest.mark.parametrize(("guess", "wound"), [((7.9, -2.2, -21), ["lower", "upper"]), ((0, 0, -30), [])])
def test_a_line_that_rests_wound_up_is_noted(guess: tuple[float, ...], wound: list[str]) -> None:
    """The network is symmetric about y = 0; from the first guess it is found wound up about its lines."""
    given = "tee: {initial_guess: [0, 0, -30]}"
    assert given in SCENE
    network = yaml.safe_load(SCENE.replace(given, f"tee: {{initial_guess: {list(guess)}}}"))
    result = hybrid.static(network)
    assert [n for n, x in result.lines.items() if any(e.kind == "several equilibria" for e in x.events)] == wound
    twisted = abs(result.lines["lower"].torque[-1]).max() > 1e-3 * abs(result.lines["lower"].bending_moment[-1]).max()
    assert twisted == bool(wound)


def test_a_twist_that_a_moment_makes_is_no_news() -> None:
    line = {"mass": 1, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 100, "torsional_stiffness": 50}
    ends = {"start": {"tangent": [1, 0, 0]}, "end": {"tangent": [1, 0, 0]}}
    common = {"connections": ends, "sections": [{"length": 5, **line}], "mesh": {"cells": 10}}
    network = network_scene(
        {"low": {"position": [0, 0, 0]}, "high": {"position": [10.01, 0, 0]},
         "middle": {"kind": "free", "initial_guess": [5, 0, 0], "moment": [60, 0, 0]}},
        {"a": {"start": "low", "end": "middle", **common}, "b": {"start": "middle", "end": "high", **common}}, gravity=0
    )  # fmt: skip
    result = hybrid.static(network)
    for name, torque in (("a", 30.0), ("b", -30.0)):  # 3 rad between its ends
        assert result.lines[name].torque[-1] == pytest.approx(torque, rel=1e-6)
        assert all(e.kind != "several equilibria" for e in result.lines[name].events)


# --- Whether equilibria with contact would stay: the stiffness of contact, and lines that lie on top of others ---

Tables = dict[str, Any]
D = 0.01  # m
TAUT = {"length": 0.99, "mass": 0.1, "diameter": D, "axial_stiffness": 2e3, "bending_stiffness": 1e-3,
        "max_strain": 0.1, "damping": {"mass": 3.0}}  # fmt: skip
SLACK = TAUT | {"length": 1.01, "axial_stiffness": 1e4}


def on_top(joined: bool = False, aside: float = 0.0) -> Tables:
    """A slack line laid on a taut one along it, both in a plane x-z; joined: of two, which meet at its middle.

    aside: m, how far beside the taut line the pins of the slack one are.
    """
    base = {"model": "rod", "contact": {"self": False}}
    a, b, middle = [-0.5, aside, 0.012], [0.5, aside, 0.012], [0.0, aside, 0.06]
    tables: Tables = network_scene(
        {"a": {"position": a}, "b": {"position": b}, "c": {"position": [-0.5, 0, 0]}, "d": {"position": [0.5, 0, 0]}},
        {"lower": base | line_between("c", "d", TAUT, mesh=50),
         "upper": base | line_between("a", "b", SLACK, mesh=50, initial={"points": [a, middle, b]})},
        contact={"between": [["lower", "upper"]]}, output={"points": 51}
    )  # fmt: skip
    if joined:
        upper = tables["lines"].pop("upper") | {"sections": [SLACK | {"length": 0.505}], "mesh": {"cells": 25}}
        tables["points"]["m"] = {"kind": "free", "initial_guess": middle}
        tables["lines"]["left"] = upper | {"start": "a", "end": "m", "initial": {"points": [a, middle]}}
        tables["lines"]["right"] = upper | {"start": "m", "end": "b", "initial": {"points": [middle, b]}}
        tables["contact"] = {"between": [["lower", "left"], ["lower", "right"]]}
    return tables


def at_rest(tables: Tables) -> LinesAtRest:
    network = system_of(tables)
    return equilibrium_of(network, build_network(network), np.inf)


def test_the_stiffness_of_contact_is_the_derivative_of_its_forces() -> None:
    found = at_rest(crossing(0.1))
    ((contact, lines),) = found.solver.contacts_at(found.state)
    nodes, H = contact_stiffness(contact)
    assert lines == (0, 1) and nodes.shape == (len(H), 6) and len(H) > 3
    np.testing.assert_allclose(H, H.transpose(0, 2, 1), atol=1e-12 * np.abs(H).max())
    ways = np.random.default_rng(1).standard_normal((contact.of.size, 3))
    change = np.zeros_like(ways)
    for these, K in zip(nodes, H, strict=True):
        change[these] += (K @ ways[these].ravel()).reshape(-1, 3)
    forces, small = [], 1e-9
    for sign in (1.0, -1.0):
        moved = found.state.copy()
        for state, way in zip(moved.lines, np.split(ways, [found.state.lines[0].r.shape[0]]), strict=True):
            state.r[:] += sign * small * way
        found.solver.contacts_at(moved)
        assert found.solver.shared is not None
        forces.append(np.concatenate(list(found.solver.shared.forces().values())))
    np.testing.assert_allclose((forces[1] - forces[0]) / (2.0 * small), change, atol=1e-6 * np.abs(change).max())


@pytest.mark.long
@pytest.mark.parametrize("joined", [False, True], ids=["one line", "two that meet at a point"])
def test_a_line_on_top_of_another_one_falls_off(joined: bool) -> None:
    """Its scene lies in a plane, in which it balances; that would not stay, and the rest found does."""
    found = at_rest(on_top(joined))
    assert "would buckle" in found.path[0] or "unstable" in found.path[0]
    assert PUSHED in found.path[-1] and not found.unjudged
    lower, *upper = (x.r for x in found.state.lines)
    middle = upper[0][-1] if joined else upper[0][25]
    assert abs(middle[1] - lower[25, 1]) > 0.9 * D
    assert middle[2] < lower[25, 2] - D
    assert ContactStability(found.solver).holds(found.state)


@pytest.mark.long
def test_one_that_leans_to_a_side_needs_no_push() -> None:
    found, pushed = at_rest(on_top(aside=0.002)), at_rest(on_top())
    assert len(found.path) == 1 and PUSHED not in found.path[0]
    for a, b in zip(found.state.lines, pushed.state.lines, strict=True):
        assert abs(abs(a.r[25, 1]) - abs(b.r[25, 1])) < 0.002


@pytest.mark.parametrize(("drop", "slides"), [(0.05, False), (0.1, True), (0.2, True)])
def test_what_rests_between_sample_points_alone_is_said_to(drop: float, slides: bool) -> None:
    """Two ropes that cross: in the middle the upper one stays by itself where it is lifted little, and not beyond.

    The lowest eigenvalue in sine series of 24 terms with the exact distance, which are neither cells nor sample points
    (bench/test_bench_crossing.py): 10.7, -9.3 and -15 /s2.
    """
    result = hybrid.static(crossing(drop))
    told = [x.text for x in result.events if x.kind == "stability not judged"]
    assert len(told) == (2 if slides else 0)  # of each line; what was judged, and would stay, is not told
    assert all("it would slide but for" in x for x in told)


@pytest.mark.long
def test_a_slack_chain_over_a_taut_rope_is_refused_because_it_is_slack() -> None:
    """Its legs snap from fold to fold in steps of microseconds, so that the motion does not come to rest."""
    chain = {"length": 2.0, "mass": 0.3, "diameter": D, "axial_stiffness": 1e5, "bending_stiffness": 0}
    a, b = [0, -0.3, 0.02], [0, 0.3, 0.02]
    tables = on_top()
    tables["points"] |= {"a": {"position": a}, "b": {"position": b}}
    tables["lines"]["upper"] = line_between(
        "a", "b", chain, mesh=40, contact={"self": False}, initial={"points": [a, [0, 0, 0.95], b]}
    )
    with pytest.raises(ComputationError, match="are compressed") as failed:
        hybrid.static(tables)
    assert failed.value.outcome == Outcome.SLACK
