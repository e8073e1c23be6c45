"""Swivels in a line: force and bending moment pass, torque does not, in statics and motion, rods and zones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, clamped_at

LENGTH, GJ = 20.0, 8.0
MODELS: dict[str, Any] = {
    "rod": "rod", "adaptive": "adaptive",
    "zones": {"kind": "zones", "zones": [{"rod": 6.0}, {"catenary": 3.0}, {"rod": 11.0}]},
    "swivel in a catenary": {"kind": "zones", "zones": [{"rod": 8.0}, {"catenary": 8.0}, {"rod": 4.0}]},
}  # fmt: skip


def line(swivel: bool, normal: tuple[float, float, float] = (0.0, 1.0, 0.0), model: Any = "rod") -> dict[str, Any]:
    """A sagging line between clamps; normal: of the second one."""
    section = {"length": LENGTH, "mass": 1.0, "diameter": 0.03, "bending_stiffness": 10.0, "torsional_stiffness": GJ,
               "damping": {"mass": 2.0, "stiffness": 0.01}}  # fmt: skip
    return cable_scene(
        section, clamped_at([0.0] * 3, [1.0, 0.0, 0.0], normal=[0.0, 1.0, 0.0]),
        clamped_at([16.0, 0.0, 2.0], [1.0, 0.0, 1.0], normal=normal),
        attachments=[{"kind": "swivel", "at": 12.0}] if swivel else [], model=model, mesh=80, output={"points": 41}
    )  # fmt: skip


def turning(turns: float, folder: Path, swivel: bool = True, model: Any = "rod") -> hybrid.Result:
    """The first clamp turns about its tangent within 8 s, then rests for 4 s."""
    t = np.linspace(0.0, 12.0, 49)
    x = np.clip(t / 8.0, 0.0, 1.0)
    angle = 360.0 * turns * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    path = folder / "turns.csv"
    np.savetxt(path, np.column_stack([t, angle, 0 * t, 0 * t]), delimiter=",", header="t,rx,ry,rz", comments="")
    scene = line(swivel, model=model) | {"time": {"duration": 12.0, "step": 0.02}}
    scene["output"] = {"every": 0.5, "points": 41}
    scene["ends"]["start"]["motion"] = {"file": str(path)}
    return hybrid.run(hybrid.validate_scene(scene))


def test_a_line_in_a_plane_hangs_with_a_swivel_as_without() -> None:
    with_one, without = (hybrid.static(hybrid.validate_scene(line(x))) for x in (True, False))
    np.testing.assert_allclose(with_one.position, without.position, atol=1e-9 * LENGTH)
    np.testing.assert_allclose(with_one.bending_moment, without.bending_moment, atol=1e-8)


def test_clamps_turned_against_each_other_twist_a_line_without_a_swivel_only() -> None:
    """A quarter turn between the normals of both clamps."""
    with_one, without = (hybrid.static(hybrid.validate_scene(line(x, (1.0, 0.0, -1.0)))) for x in (True, False))
    assert np.abs(with_one.torque).max() < 1e-9
    np.testing.assert_allclose(np.abs(without.torque), GJ * 0.5 * np.pi / LENGTH, rtol=0.02)  # its bend takes a part
    level = hybrid.static(hybrid.validate_scene(line(True)))
    np.testing.assert_allclose(with_one.position, level.position, atol=1e-9 * LENGTH)


@pytest.mark.parametrize("model", MODELS)
def test_turns_of_a_clamp_pass_a_swivel(model: str, tmp_path: Path) -> None:
    """Ten turns of a clamp about its tangent change nothing in the end; without a swivel the line holds them."""
    still, turned = (turning(n, tmp_path, model=MODELS[model]) for n in (0.0, 10.0))
    assert np.abs(turned.torque[-1]).max() < 1e-3 * GJ * 20.0 * np.pi / LENGTH
    moved = np.abs(turned.position[-1] - still.position[-1]).max()
    assert moved < (1e-3 if model == "adaptive" else 1e-4) * LENGTH  # zones that move are where they were of use
    assert "turns/link" not in turned.names
    assert not {"unresolved twist", "steps cut", "loop can form"} & {event.kind for event in turned.events}


def test_without_a_swivel_turns_of_a_clamp_are_held(tmp_path: Path) -> None:
    held = turning(1.0, tmp_path, swivel=False)
    np.testing.assert_allclose(np.abs(held.torque[-1]), GJ * 2.0 * np.pi / LENGTH, rtol=0.02)


def test_both_sides_of_a_swivel_bear_no_torque_at_it(tmp_path: Path) -> None:
    """While the clamp turns, damping of the bend makes a torque; at the swivel there is none."""
    result = turning(10.0, tmp_path)
    at = int(np.argmin(np.abs(result.s - 12.0)))
    largest = np.abs(result.torque).max()
    assert largest > 1e-4
    assert np.abs(result.at(s=12.0)["torque"]).max() < 0.05 * largest, at


@pytest.mark.parametrize("turns", [0.45, 0.6, 2.0])
def test_a_swivel_end_that_bends_the_line_feels_no_turns(turns: float, tmp_path: Path) -> None:
    """A rod bent by an askew clamp with a swivel: turned by its other end, it lies as before, whatever the turns."""
    results = []
    for n in (0.0, turns):
        t = np.linspace(0.0, 10.0, 21)
        x = np.clip(t / 8.0, 0.0, 1.0)
        path, angle = tmp_path / "turns.csv", 360.0 * n * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        np.savetxt(path, np.column_stack([t, angle, 0 * t, 0 * t]), delimiter=",", header="t,rx,ry,rz", comments="")
        scene = cable_scene(
            {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0, "torsional_stiffness": 0.8,
             "damping": {"mass": 20.0}},
            clamped_at([0.0] * 3, [1.0, 0.0, 0.0], normal=[0.0, 0.0, 1.0], motion={"file": str(path)}),
            clamped_at([0.8, 0.0, 0.0], [0.8, 0.6, 0.0], swivel=True), gravity=0.0, model="rod", mesh=40,
            time=(10.0, 0.02), output=(1.0, 21)
        )  # fmt: skip
        results.append(hybrid.run(hybrid.validate_scene(scene)))
    still, turned = results
    np.testing.assert_allclose(turned.position[-1], still.position[-1], atol=1e-4)
    np.testing.assert_allclose(turned.bending_moment[-1], still.bending_moment[-1], rtol=1e-3)
    assert np.abs(turned.torque[-1]).max() < 1e-3


def test_a_swivel_of_mass_hangs_as_a_clump_does() -> None:
    swivel, clump = line(True), line(True)
    swivel["cable"]["attachments"][0]["mass"] = 3.0
    clump["cable"]["attachments"] = [{"kind": "clump", "at": 12.0, "mass": 3.0}]
    a, b = (hybrid.static(hybrid.validate_scene(x)) for x in (swivel, clump))
    np.testing.assert_allclose(a.position, b.position, atol=1e-9 * LENGTH)


def test_a_swivel_is_idle_in_a_plane() -> None:
    """A line that moves in a plane is the same in it as in space."""
    scene = line(True) | {"time": {"duration": 1.0, "step": 0.02}}
    scene["ends"]["end"]["motion"] = {"heave": {"amplitude": 0.3, "period": 2.0}, "ramp": 1.0}
    plane, space = (hybrid.run(hybrid.validate_scene(scene | {"dimension": k})) for k in (2, 3))
    np.testing.assert_allclose(plane.position, space.position, atol=1e-9 * LENGTH)
    np.testing.assert_allclose(plane.tension, space.tension, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"cable": {"attachments": [{"kind": "swivel", "at": 20.0}]}}, "ends.end.swivel: true"),
        ({"cable": {"attachments": [{"kind": "swivel", "at": -1.0}]}}, "at"),
    ],
)
def test_a_swivel_is_refused_where_it_cannot_be(change: dict[str, Any], says: str) -> None:
    scene = line(True)
    scene["cable"]["attachments"] = change["cable"]["attachments"]
    with pytest.raises(hybrid.SceneError, match=says):
        hybrid.validate_scene(scene)
