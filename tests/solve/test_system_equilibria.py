"""What is no equilibrium of several lines although all forces balance: compressed catenaries, folds, rods that buckle.

Scenes in which release 0.6.0 was wrong are in tests/data/defects.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from random_scenes import random_network
from scipy.spatial.transform import Rotation

import hybrid
from hybrid.errors import ComputationError, Outcome
from hybrid.simulation import equilibrium
from hybrid.solve.stepper import LineFailed
from tests.combinations.pairs import seen_by
from tests.scenes import each_line, line_between, network_scene

DEFECTS = Path(__file__).parents[1] / "data" / "defects"
LEG = {"length": 10.0, "mass": 1e-3, "axial_stiffness": 1e6, "bending_stiffness": 100.0}


def tables_of(name: str) -> dict[str, Any]:
    return dict(yaml.safe_load((DEFECTS / f"{name}.yaml").read_text()))


def turned(tables: dict[str, Any], heading: float) -> dict[str, Any]:
    """The same scene turned about the vertical."""
    return seen_by(Rotation.from_euler("z", heading).as_matrix(), tables)


def folds(result: hybrid.Result) -> float:
    """The largest turn of a chord to the next, rad, of all lines."""
    largest = 0.0
    for line in result.lines.values():
        d = np.diff(np.asarray(line.position)[-1], axis=0)
        d /= np.linalg.norm(d, axis=1)[:, None]
        largest = max(largest, float(np.arccos(np.clip((d[1:] * d[:-1]).sum(axis=1), -1.0, 1.0)).max()))
    return largest


@pytest.mark.parametrize("heading", [0.0, 0.5, 2.0, 4.4])
def test_a_line_of_a_system_rests_as_the_cable_does(heading: float) -> None:
    """0.6.0 found -455 to -44 N along the line, with 111 deg between two cells; the cable has 477.4 N at its end."""
    found = hybrid.static(turned(tables_of("line_of_a_system_in_compression"), heading))
    assert np.linalg.norm(found["points/end/force"]) == pytest.approx(477.43, abs=0.05)
    assert np.ravel(found.lines["a"].tension).min() > 0.0
    assert "stability not judged" not in {event.kind for event in found.events}


def test_a_motion_of_a_system_starts_from_what_is_an_equilibrium() -> None:
    tables = tables_of("line_of_a_system_in_compression") | {"time": {"duration": 0.1, "step": 0.05}}
    begun = hybrid.run(tables)
    assert np.linalg.norm(begun["points/end/force"][0]) == pytest.approx(477.43, abs=0.05)


@pytest.mark.parametrize(
    ("name", "tension"), [("buoy_with_folded_legs", 2022.6), ("buoy_catenaries_compressed", 4162.8)]
)
def test_legs_of_a_mooring_are_neither_folded_nor_compressed(name: str, tension: float) -> None:
    """0.6.0: -384 N and 178 deg between two cells; -1524 N, and 4847 N at the buoy, in catenaries with `slack: warn`."""
    found = hybrid.static(tables_of(name))
    assert np.ravel(found.lines["l0"].tension).max() == pytest.approx(tension, rel=1e-4)
    assert all(np.ravel(line.tension).min() > 0.0 for line in found.lines.values())
    assert folds(found) < 0.5 * np.pi
    assert not {event.kind for event in found.events} & {"slack", "unresolved bend"}


def tripod(load: float) -> dict[str, Any]:
    """A head that is pressed down on three straight legs: each bears load / (3 cos), and pi^2 EI/L^2 = 9.87 N at most."""
    places = {"a": [-6.0, 0.0, 0.0], "b": [3.0, 5.196152423, 0.0], "c": [3.0, -5.196152423, 0.0]}
    leg = {"sections": [LEG], "model": "rod", "mesh": {"cells": 20}, "end": "head"}
    return network_scene(
        {"head": {"initial_guess": [0.0, 0.0, 8.0], "force": [0, 0, -load]}} | {name: {"position": place} for name, place in places.items()},
        {f"leg_{name}": leg | {"start": name} for name in places}, gravity=1e-6
    )  # fmt: skip


@pytest.mark.parametrize(("load", "height"), [(20.0, 8.0), (30.0, -8.0)])
def test_a_rod_that_would_buckle_is_no_equilibrium_of_a_system(load: float, height: float) -> None:
    """Straight legs balance any load; they stand below that of Euler alone, 3 * 0.8 * 9.87 = 23.7 N, and hang beyond."""
    found = hybrid.static(tripod(load))
    assert found["points/head/position"][-1, 2] == pytest.approx(height, abs=0.01)


def test_a_slack_catenary_is_said_where_nothing_else_is_found() -> None:
    """A mooring with a leg that lies without tension on a slope, which `slack: warn` lets pass."""
    found = hybrid.static(slack_mooring())
    assert np.ravel(found.lines["l1"].tension).min() < 0.0
    (said,) = [event for event in found.events if event.kind == "slack"]
    assert "line l1" in said.text


def slack_mooring() -> dict[str, Any]:
    """Mooring 69 of bench/test_bench_system_statics.py."""
    section = {"length": 146.074, "mass": 8.0, "diameter": 0.05, "axial_stiffness": 5e6, "drag": {"normal": 1.2}}
    leg = {"sections": [section], "model": {"kind": "catenary", "slack": "warn"}, "mesh": {"cells": 40}, "end": "buoy"}
    anchors = [[-33.5025, -96.2728, -65.215], [100.689, 15.8936, -55.7141], [-71.8795, 72.2787, -66.1411]]
    buoy = {"mass": 800.0, "volume": 6.0, "drag_area": 2.0, "initial_guess": [0, 0, -2]}
    return network_scene(
        {"buoy": buoy} | {f"a{k}": {"position": place} for k, place in enumerate(anchors)},
        {f"l{k}": leg | {"start": f"a{k}"} for k in range(3)},
        fluid={"density": 1025, "surface": 0.0, "current": [0.6, 0.0, 0.0]},
        seabed={"z": -62.2335, "stiffness": 3000.0, "slope": [0.0633392, 0.00892696]},
    )


def test_a_leg_that_lies_slack_hangs_down_from_its_buoy() -> None:
    """A leg 10 m longer than along the bed and up to the buoy that a taut one holds: it lies without tension."""
    section = {"mass": 8.0, "diameter": 0.05, "axial_stiffness": 5e6}
    leg = {"model": "catenary", "mesh": {"cells": 20}, "end": "buoy"}
    scene = network_scene(
        {"a": {"position": [0, 0, -30]}, "b": {"position": [20, 0, -30]},
         "buoy": {"mass": 100.0, "volume": 1.0, "initial_guess": [0, 0, -10]}},
        {"taut": leg | {"start": "a", "sections": [section | {"length": 20.0}]},
         "long": leg | {"start": "b", "sections": [section | {"length": 50.0}]}},
        fluid={"density": 1025, "surface": 0.0}, seabed={"z": -30.0, "stiffness": 3000.0}
    )  # fmt: skip
    result = hybrid.static(scene)
    w, long = 9.80665 * (8.0 - 1025.0 * 0.25 * math.pi * 0.05**2), result.lines["long"]
    assert abs(long.tension[-1][-1] - 20.0 * w) <= 0.5 * 2.5 * w, "half a cell"
    lies = (long.s > 2.5) & (long.s < 27.0)  # at the anchor the force on the support has a part along the line
    assert np.abs(long.tension[-1][lies]).max() < 1e-9 * long.tension.max()
    assert [x.s_b for x in long.events if x.kind == "slack"] == [30.0]


def test_a_start_of_many_cells_is_sought_from_on_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no first place leads to an equilibrium others are tried: a state of the lines' cells, not of fewer ones."""
    cells = []

    def fails(asked: Any, group: Any, start: Any = None, quick: bool = False) -> Any:
        states = next(asked.starts())[1].lines
        cells.append([(x.line.h.size, state.T.size) for x, state in zip(group.lines, states, strict=True)])
        raise LineFailed(0, Outcome.NOT_CONVERGED, None, None)

    monkeypatch.setattr(equilibrium, "_on_its_side", fails)
    with pytest.raises(ComputationError):
        hybrid.static(each_line(slack_mooring(), mesh=120))
    assert len(cells) > 5 and {a == b for pairs in cells for a, b in pairs} == {True}
    assert {a for pairs in cells for a, _ in pairs} > {120}  # fewer ones, from the first places


@pytest.mark.long
def test_lines_in_a_row_are_found_from_other_places_of_their_knots() -> None:
    """No way from the first places of the knots, or from those that balance, leads to lines under tension."""
    found = hybrid.static(tables_of("lines_in_a_row"))
    assert "between other places" in found.attributes["static_path"]
    assert lowest_tension(found) > 0.0


@pytest.mark.long
def test_a_riser_is_found_from_its_equilibrium_without_bending() -> None:
    """Random network 959: every other way leaves its tether in compression, here but by what friction holds."""
    found = hybrid.static(random_network(959)[1])
    assert "from the equilibrium without bending, slack or not" in found.attributes["static_path"]
    assert lowest_tension(found) > -2e-4


def lowest_tension(found: hybrid.Result) -> float:
    """Lowest tension of all lines, which are in balance; a part of the largest."""
    largest = max(float(line.tension.max()) for line in found.lines.values())
    assert float(found.attributes["static_residual"]) < 1e-6 * largest
    return min(float(line.tension.min()) for line in found.lines.values()) / largest


def knot(first):
    sec = {"length": 60, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    lines = {x: line_between(x.upper(), "K", sec, model="catenary", mesh=12) for x in "ab"}
    points = {"A": {"position": [0, 0, 0]}, "B": {"position": [80, 0, 0]}}
    points["K"] = {"kind": "free", "mass": 20, "initial_guess": [40, 0, -40]}
    return network_scene(points, dict(sorted(lines.items(), reverse=first == "b")))


def test_tension_at_a_free_point_does_not_depend_on_the_order_of_lines():
    one, other = (hybrid.static(knot(x)).lines["a"]["tension"][0, -1] for x in "ab")
    assert one == pytest.approx(other, rel=1e-9)
    one, other = (hybrid.sensitivity(knot(x), ["a/tension@end"], ["lines.a.sections[0].mass"])[0] for x in "ab")
    assert one.derivative == pytest.approx(other.derivative, rel=1e-6)


@pytest.mark.parametrize("EA, down", [(1e9, [0.3, 0.2, -0.9]), (6e9, [0.4, -0.1, -1.0])])
@pytest.mark.parametrize("turned", [False, True])
def test_a_motion_begins_with_the_tension_of_its_equilibrium(EA, down, turned):
    section = {"length": 9.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": EA, "bending_stiffness": 1e3}
    ends = [{"kind": "pinned", "position": [0, 0, 0]}, {"kind": "body", "mass": 200.0}]
    way = -np.array(down) if turned else np.array(down)
    scene = {
        "cable": {"sections": [section]},
        "ends": dict(zip(("start", "end"), ends[::-1] if turned else ends, strict=True)),
    }
    scene |= {"mesh": {"cells": 10}, "model": "rod", "dimension": 3, "time": {"duration": 0.2, "step": 0.05}}
    scene["initial"] = {"kind": "equilibrium", "guess": "straight", "direction": way.tolist()}
    result = hybrid.run(scene)
    force = result.reaction_end if turned else result.reaction_start
    assert force[0, 2] == pytest.approx((9.0 * 5.0 + 200.0) * 9.81, rel=5e-6)
