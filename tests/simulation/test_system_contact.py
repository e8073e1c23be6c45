"""Lines of a network that touch themselves: as one cable does, beside points that move, resumed, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

WIDTH, RUBS = 0.02, {"self": True, "friction": 0.3}
HOSE = {
    "length": 4.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.005,
    "torsional_stiffness": 0.004, "damping": {"mass": 0.5},
}  # fmt: skip
TAIL = HOSE | {"length": 0.5}
LOW, HIGH, CLOSER = [0, 0, 0], [1.2, 0, 0.45], {"travel": {"by": [1.22, 0.95 * WIDTH, 0.0], "over": 2.0}}
TIME, OUTPUT = {"duration": 1.7, "step": 0.01}, {"every": 0.02, "points": 81}


def network(**more: Any) -> dict[str, Any]:
    """A line hangs in a U between an end that is moved until its legs touch, and a tail; free: where they meet."""
    line = {"start": "low", "end": "free", "model": "rod", "mesh": {"cells": 80}, "sections": [HOSE], "contact": RUBS}
    tail = {"start": "free", "end": "high", "model": "catenary", "mesh": {"cells": 5}, "sections": [TAIL]}
    return network_scene(
        {"low": {"position": LOW, "motion": CLOSER}, "high": {"position": HIGH},
         "free": {"kind": "free", "initial_guess": [1.1, 0, 0]}},
        {"hose": line | more, "tail": tail}, time=TIME, output=OUTPUT
    )  # fmt: skip


def test_a_line_touches_itself_as_one_cable_does() -> None:
    """The same as a rod and a catenary of one cable, whose joint is the free point."""
    cells = [*np.linspace(0.0, 4.0, 81), 4.1, 4.2, 4.3, 4.4, 4.5]
    alone = hybrid.run(cable_scene(
        [HOSE, TAIL], pinned_at(*LOW, motion=CLOSER), pinned_at(*HIGH), contact=RUBS, time=TIME, dimension=3,
        model={"zones": [{"rod": 4.0}, {"catenary": 0.5}]}, mesh={"nodes": [float(x) for x in cells]},
        output=OUTPUT | {"points": 91}
    ), progress=False)  # fmt: skip
    with hybrid.run(network()) as result:
        hose = result.lines["hose"]
        assert {"line touches itself"} <= {event.kind for event in hose.events}
        assert "line meets itself" not in {event.kind for event in hose.events}
        assert float(hose["self_distance/distance"]) > 0.85 * WIDTH
        touches = hose["energy/self_contact"] > 0.0
        assert 2 <= touches.sum() < 20 and np.array_equal(touches, alone["energy/self_contact"] > 0.0)
        assert (hose["self_contact"].max(axis=1)[touches] > 0.0).all() and not hose["self_contact"][~touches].any()
        assert np.nanmax(hose["envelope/self_contact_max"]) >= hose["self_contact"].max()
        rubbed = float(alone["work/friction"][-1])
        assert rubbed < 0.0 and hose["work/friction"][-1] == pytest.approx(rubbed, rel=1e-3)
        put_in = np.abs(hose["work/start"]).max() + np.ptp(hose["energy/potential"])
        assert hose["work/scheme"].max() < 1e-3 * put_in
        assert np.linalg.norm(hose["position"] - alone["position"][:, :81], axis=2).max() < 1e-5


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"contact": {"self": False, "friction": 0.2}}, r"contact\.friction[\s\S]*without contact\.self"),
        ({"sections": [{k: x for k, x in HOSE.items() if k != "diameter"}]}, r"diameter"),
    ],
)
def test_what_is_not_computed_is_refused(more: dict[str, Any], says: str) -> None:
    with pytest.raises(hybrid.SceneError, match=says):
        hybrid.validate_scene(network(**more))


@pytest.mark.parametrize(
    ("more", "on", "why"),
    [
        ({}, True, "whatever its ends do"),
        ({"contact": {"self": False}}, False, "contact.self: false"),
        ({"model": "catenary"}, False, "catenaries that stay"),
        ({"start": "a", "end": "b"}, False, "of a loop"),
        ({"start": "a", "end": "b", "break_at": {"time": 1.0}}, True, "whatever its ends do"),
        ({"start": "a", "end": "weak"}, True, "whatever its ends do"),
    ],
)
def test_the_plan_says_which_lines_have_it(more: dict[str, Any], on: bool, why: str) -> None:
    """A line that cannot reach itself lies nearly straight between points that nothing moves."""
    scene = network(contact={})
    line = scene["lines"]["hose"] | more
    places = {"a": {"position": [0, 0, 0]}, "b": {"position": [3.99, 0, 0]}}
    places["weak"] = places["b"] | {"break_at": {"tension": 1e3}}
    scene["points"] |= {name: x for name, x in places.items() if name in (line["start"], line["end"])}
    plan = hybrid.plan(scene | {"lines": scene["lines"] | {"other": line}}).lines["other"]
    (entry,) = (x for x in plan.contents if x.what == "contact of the line with itself")
    assert entry.on is on and why in entry.why


def test_an_equilibrium_within_itself_is_refused() -> None:
    """A weight pulls the legs of a line straight, 0.8 diameters apart."""
    thin = HOSE | {"bending_stiffness": 0.02}
    clump = {"kind": "clump", "at": 2.0, "mass": 50.0}
    scene = network(sections=[thin], attachments=[clump], end="high", mesh={"cells": 800})  # which show the bend
    scene["points"] = {"low": {"position": [0, 0, 0]}, "high": {"position": [0, 0.8 * WIDTH, 0]}}
    del scene["lines"]["tail"]
    with pytest.raises(hybrid.SceneError, match=r"lines\.hose\.contact[\s\S]*s = .* m and s = .* m[\s\S]*initial"):
        hybrid.static(scene)
    with pytest.raises(hybrid.SceneError, match=r"lines\.hose\.contact[\s\S]*shape in which the line is apart"):
        hybrid.run(scene, progress=False)


# --- beside a body -------------------------------------------------------------------------------------


def beside_a_body(**contact: Any) -> dict[str, Any]:
    """An arm that is clamped to a body falls; far away two ropes fall onto each other."""
    rope = {
        "length": 0.92, "mass": 0.2, "diameter": 0.02, "axial_stiffness": 2e4, "bending_stiffness": 0.001,
        "torsional_stiffness": 0.001, "max_strain": 0.2, "damping": {"mass": 1.0},
    }  # fmt: skip
    arm = rope | {"length": 1.0, "bending_stiffness": 0.5, "torsional_stiffness": 0.4}
    ways = {
        "hang": [[0, 0, 1], [0, 0, 0.05]], "arm": [[0.05, 0, 0], [1.05, 0, 0]],
        "one": [[5, -0.45, 0], [5, -0.05, -0.083], [5, 0.05, -0.083], [5, 0.45, 0]],
        "two": [[4.55, 0, -0.05], [4.95, 0, -0.05], [5.05, 0, -0.05], [5.45, 0, -0.05]],
    }  # fmt: skip
    sections = {"hang": arm | {"length": 0.95}, "arm": arm, "one": rope, "two": rope}
    points: dict[str, Any] = {f"{line}{k}": {"position": way[k]} for line, way in ways.items() for k in (0, -1)}
    points |= {
        "hang-1": {"body": "body", "place": [0, 0, 0.05]}, "arm0": {"body": "body", "place": [0.05, 0, 0]},
        "arm-1": {"kind": "free", "initial_guess": ways["arm"][-1]},
    }  # fmt: skip
    lines: dict[str, Any] = {
        name: line_between(f"{name}0", f"{name}-1", sections[name], model="rod", mesh=40, contact={"self": False},
                           initial={"kind": "points", "points": way}) for name,
        way in ways.items()
    }  # fmt: skip
    lines["arm"]["connections"] = {"start": {"kind": "clamped", "tangent": [1, 0, 0]}}
    return {
        "bodies": {"body": {"kind": "free", "initial_guess": [0, 0, 0], "mass": 1.0, "inertia": [0.02, 0.02, 0.02]}},
        "points": points, "lines": lines, "contact": contact,
        "time": {"duration": 0.08, "step": 0.001, "rho_inf": 0.0}, "output": {"every": 0.02, "points": 41},
    }  # fmt: skip


def test_contact_elsewhere_leaves_alone_what_is_clamped_to_a_body() -> None:
    """The moment of the clamp counted twice while any lines touched: the arm was 17 mm off after 0.3 s."""
    touching, apart = (hybrid.run(beside_a_body(**x)).lines for x in ({}, {"between": []}))
    assert touching["one"]["self_contact"].max() > 10.0
    for name in ("arm", "hang"):
        assert np.abs(touching[name].position - apart[name].position).max() < 1e-10
        np.testing.assert_allclose(touching[name].tension, apart[name].tension, atol=1e-5)


# --- in other units ---

UNITS = (1.0, 1000.0, 0.001)  # lengths of a metre: m, mm, km; the density of the line is the same in all
WIDE = 0.02


def in_units(u: float, model: str) -> dict[str, Any]:
    """A U whose ends come together, on a tail whose far end heaves so that it goes slack."""
    hose = {
        "length": 4 * u, "mass": 0.4 * u**2, "diameter": WIDE * u, "axial_stiffness": 1e5 * u**4,
        "bending_stiffness": 0.005 * u**6, "torsional_stiffness": 0.004 * u**6, "damping": {"mass": 0.2},
    }  # fmt: skip
    closer = {"travel": {"by": [1.22 * u, 0.95 * WIDE * u, 0.0], "over": 1.2}}
    heave = {"heave": {"amplitude": 0.4 * u, "period": 1.0}, "ramp": 1.0}
    return network_scene(
        {"low": {"position": [0, 0, 0], "motion": closer},
         "high": {"position": [1.2 * u, 0, 0.45 * u], "motion": heave},
         "free": {"kind": "free", "initial_guess": [1.1 * u, 0, 0]}},
        {"hose": line_between("low", "free", hose, model="rod", mesh=64, contact={"friction": 0.3}),
         "tail": line_between("free", "high", hose | {"length": u}, model=model, mesh=16)},
        gravity=9.81 * u, time=(2.5, 2.0**-7), output=(0.125, 65)
    )  # fmt: skip


@pytest.mark.long
def test_the_same_motion_in_every_unit() -> None:
    """Round-off grows to 1e-12 m by the end."""
    first, *others = (hybrid.run(in_units(u, "rod"), progress=False) for u in UNITS)
    assert any(event.kind == "line touches itself" for event in first.events)
    kinds = [(event.t, event.kind) for event in first.events if event.kind != "implausible"]  # numbers of other units
    for u, other in zip(UNITS[1:], others, strict=True):
        for name, line in first.lines.items():
            assert np.abs(other.lines[name].position / u - line.position).max() < 1e-9
        assert [(event.t, event.kind) for event in other.events if event.kind != "implausible"] == kinds


def test_a_tail_that_goes_slack_stops_at_the_same_time_in_every_unit() -> None:
    stops = []
    for u in UNITS:
        with pytest.raises(hybrid.ComputationError, match="compression") as stopped:
            hybrid.run(in_units(u, "catenary"), progress=False)
        stops.append((stopped.value.t, stopped.value.s / u))
    assert stops == [pytest.approx(stops[0], rel=1e-6)] * len(UNITS)
