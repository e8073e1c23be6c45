"""Forces of contact by the name of what presses: of obstacles and of pairs of lines, against balances of forces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.cli.tables import extremes_facts
from hybrid.view.summary import facts_of
from tests.scenes import cable_scene, each_line, pinned_at
from tests.validation.test_validation_lines_contact import FORCES, ROPE, WEIGHT, crossing, force_between

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
