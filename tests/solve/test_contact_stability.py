"""Whether equilibria with contact would stay: the stiffness of contact, and lines that lie on top of others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError, Outcome
from hybrid.model.network import build_network
from hybrid.simulation.equilibrium import equilibrium_of
from hybrid.solve.lines_at_rest import ContactStability, LinesAtRest, contact_stiffness
from hybrid.solve.search import PUSHED
from tests.scenes import line_between, network_scene, system_of
from tests.validation.test_validation_lines_contact import crossing

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


def equilibrium(tables: Tables) -> LinesAtRest:
    network = system_of(tables)
    return equilibrium_of(network, build_network(network), np.inf)


def test_the_stiffness_of_contact_is_the_derivative_of_its_forces() -> None:
    found = equilibrium(crossing(0.1))
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
    found = equilibrium(on_top(joined))
    assert "would buckle" in found.path[0] or "unstable" in found.path[0]
    assert PUSHED in found.path[-1] and not found.unjudged
    lower, *upper = (x.r for x in found.state.lines)
    middle = upper[0][-1] if joined else upper[0][25]
    assert abs(middle[1] - lower[25, 1]) > 0.9 * D
    assert middle[2] < lower[25, 2] - D
    assert ContactStability(found.solver).holds(found.state)


@pytest.mark.long
def test_one_that_leans_to_a_side_needs_no_push() -> None:
    found, pushed = equilibrium(on_top(aside=0.002)), equilibrium(on_top())
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
