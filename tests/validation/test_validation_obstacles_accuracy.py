"""Errors, steps that follow the motion and cells of lines on obstacles, beside runs on fine cells in fine fixed steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.model.resolution import first_resolution
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at
from tests.validation.obstacle_scenes import over_pipe

Tables = dict[str, Any]
# Estimated over true error, as asked of the project; the upper bound is wider where the result is far better than asked.
LOW, HIGH = 0.7, 3.0
# Parts of the largest value that are asked; below a third of that figures may be larger than HIGH.
ASKED, FAR_BELOW = 0.02, 1.0 / 3.0
PIPE = over_pipe()["obstacles"]["pipe"] | {"at": [4, 0, -2.1]}
NAMES = ("position", "tension", "curvature")


def scene(of_end: Tables | None, duration: float, **pipe: Any) -> Tables:
    """The rope over a pipe, which it lies on from the start, with cells and steps that are left open.

    of_end: motion of its upper end; None: that rests.  pipe: more keys of the pipe.
    """
    tables = over_pipe(
        time={"duration": duration}, obstacles={"pipe": PIPE | pipe}, output={"every": 0.1, "points": 49}
    )
    del tables["ends"]["end"]["motion"]
    tables["ends"]["end"] |= {"motion": of_end} if of_end else {}
    del tables["mesh"]
    return tables


HEAVE = scene({"heave": {"amplitude": 0.5, "period": 3.0}, "ramp": 3.0}, 6.0)  # it lifts off and comes down again
DRAGGED = scene({"travel": {"by": [0.6, 0.5, 0.4], "over": 3.0}}, 4.0)  # it slides over the pipe
BEAM = {"kind": "box", "at": [4, 0, -2.1], "size": [2.0, 3.0, 2.2], "rounding": 1.0, "rotation": [5, -10, 15],
        "friction": 0.3}  # fmt: skip
ON_BEAM = DRAGGED | {"obstacles": {"beam": BEAM}}
MOVES = scene(None, 3.0, motion={"heave": {"amplitude": 0.2, "period": 2.0}, "ramp": 2.0})


def parts(result: Any, truth: Any) -> dict[str, tuple[float, float]]:
    """By name the largest estimated error and the largest true one, as parts of the largest value."""
    found = {}
    for name in NAMES:
        value, error = np.array(truth[name]), np.array(result[name]) - np.array(truth[name])
        true = np.linalg.norm(error, axis=2) if error.ndim == 3 else np.abs(error)
        size = 12.0 if name == "position" else float(np.abs(value).max())
        found[name] = float(result.errors[f"total/{name}"].max()) / size, float(true.max()) / size
    return found


FINE = {"mesh": {"cells": 600}, "time": {"duration": 6.0, "step": 0.005}}


@pytest.fixture(scope="module")
def heaved() -> Any:
    return hybrid.run(HEAVE | FINE)


@pytest.mark.long
@pytest.mark.parametrize("tables", [HEAVE, DRAGGED, MOVES, ON_BEAM], ids=["heave", "dragged", "pipe moves", "beam"])
def test_figures_are_those_of_a_fine_run_and_steps_meet_what_is_asked(tables: Tables, heaved: Any) -> None:
    """Contact opens and closes, and friction holds and slides: none of three figures is below the truth."""
    duration = tables["time"]["duration"]
    truth = heaved if tables is HEAVE else hybrid.run(tables | FINE | {"time": {"duration": duration, "step": 0.005}})
    result = hybrid.run(tables | {"accuracy": "2%"})
    assert "accuracy missed" not in {x.kind for x in result.events}
    steps = np.diff(np.array(result["steps/t"]))
    assert steps.max() > 2.0 * steps.min()
    for name, (said, true) in parts(result, truth).items():
        assert true < ASKED, (name, said, true)
        assert said > LOW * true, (name, said, true)
        assert said < HIGH * max(true, FAR_BELOW * ASKED), (name, said, true)


@pytest.mark.long
def test_figures_of_given_cells_and_steps(heaved: Any) -> None:
    """Both-sided, of tension too, whose slope jumps where friction begins: of order 1."""
    given = HEAVE | {
        "mesh": {"cells": 128}, "time": {"duration": 6.0, "step": 0.05}, "output": HEAVE["output"] | {"errors": True}
    }  # fmt: skip
    for name, (said, true) in parts(hybrid.run(given), heaved).items():
        assert LOW * true < said < HIGH * true, (name, said, true)


@pytest.mark.long
@pytest.mark.parametrize("model", ["catenary", "rod"])
@pytest.mark.parametrize("cells", [16, 25, 100, 400])
def test_a_rope_lies_over_the_pipe_on_any_cells(model: str, cells: int) -> None:
    """Not round it, stretched by 17 %, where its catenary hangs through the pipe; of order 2 from 25 cells on."""
    at_rest = scene(None, 1.0) | {"model": model, "mesh": {"cells": cells}}
    place = hybrid.static(at_rest).position[-1]
    top = np.interp(PIPE["at"][0], place[:, 0], place[:, 2])
    assert top == pytest.approx(-0.878, abs=0.05 if cells < 25 else 0.01)


def test_steps_resolve_the_motion_of_an_obstacle() -> None:
    """A twelfth of its period, of a ramp and of a turn of three radians, as of the motions of ends."""
    for pipe, longest in (
        ({}, 0.6), ({"motion": {"heave": {"amplitude": 0.1, "period": 1.2}, "ramp": 3.0}}, 0.1),
        ({"spin": {"rate": -5.0, "ramp": 3.0}}, 0.05), ({"spin": {"rate": 0.1, "ramp": 1.5}}, 0.125),
        ({"motion": {"travel": {"by": [0, 0, 0.1], "over": 2.4}}}, 0.2),
    ):  # fmt: skip
        assert first_resolution(one_line(hybrid.validate_scene(scene(None, 6.0, **pipe)))).step == pytest.approx(
            longest, rel=1e-9
        )


def test_layers_of_a_line_over_a_pipe() -> None:
    """Cells to a layer beside a clamp show the curvature there, the better the more there are."""
    tables = scene({"travel": {"by": [0.2, 0.2, 0.1], "over": 1.0}}, 1.0)
    tables["time"]["step"] = 0.02
    tables["ends"]["start"] = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -0.9]}
    truth = np.array(hybrid.run(tables | {"mesh": {"cells": 800}})["curvature"])[:, 0]
    found, cells = [], []
    for count in (2, 8):
        result = hybrid.run(tables | {"resolution": {"cells_per_layer": count}})
        found.append(float(np.abs(np.array(result["curvature"])[:, 0] / truth - 1.0).max()))
        cells.append(int(result.attributes["cells"]))
    assert cells[1] > cells[0]
    assert found[1] < 0.8 * found[0] < 0.04


@pytest.mark.long
def test_the_equilibrium_of_a_line_over_a_sheave_is_that_over_a_pipe_at_rest() -> None:
    """On cells on which it takes a damped motion to rest, in which the sheave is held."""
    own: Tables = {"at": [4, 0, -1.7], "axis": [0, 1, 0]}
    held, turning = (
        [
            hybrid.static(
                {k: x for k, x in scene(None, 1.0, **own, **more).items() if k != "time"} | {"mesh": {"cells": n}}
            )
            for n in (33, 40)
        ]
        for more in ({}, {"bearing": {"inertia": 3.0}})
    )
    for a, b in zip(held, turning, strict=True):
        np.testing.assert_allclose(b.position, a.position, atol=1e-7)


def under_pipe(cells: int, x: float = 5.0, **more: Any) -> dict[str, Any]:
    """11 m over 10 m, whose catenary hangs through a pipe: on top of it 53 N, round it from below 10 kN."""
    section = {"length": 11, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 2.0}
    return (
        cable_scene(section, pinned_at(0, 0, 0), pinned_at(10, 0, 0),
                    obstacles={"pipe": {"kind": "cylinder", "at": [x, 0, -1.9], "axis": [0, 1, 0], "radius": 0.5}},
                    model="rod", mesh=cells) | more
    )  # fmt: skip


@pytest.mark.parametrize(("cells", "x"), [(40, 5.0), (100, 5.0), (101, 5.0), (100, 4.9), (100, 5.01), (200, 5.0)])
def test_a_line_that_hangs_through_a_pipe_lies_on_it_on_any_mesh(cells: int, x: float) -> None:
    """On most of these meshes it was found round the pipe from below, stretched by 1 %, within what it bears."""
    found = hybrid.static(hybrid.validate_scene(under_pipe(cells, x)))
    assert found.tension.max() == pytest.approx(53.0, rel=0.01)
    assert not any(event.kind == "several equilibria" for event in found.events)


def test_a_line_that_is_found_behind_a_pipe_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no way leads to the other side: stretched round the pipe, here without the ways that do."""
    monkeypatch.setattr("hybrid.simulation.equilibrium.behind_obstacles", lambda *_: iter(()))
    found = hybrid.static(under_pipe(100))
    (said,) = [x for x in found.events if x.kind == "several equilibria"]
    assert found.tension.max() > 1e4 and "obstacle pipe" in said.text


@pytest.mark.parametrize(("cells", "left"), [(30, True), (60, False)])
def test_a_line_that_has_left_the_obstacle_of_its_points_says_so(cells: int, left: bool) -> None:
    """Laid over a sheave, a weight at its end: on coarse cells the only equilibrium found hangs straight down."""
    common = {"length": 8, "axial_stiffness": 1e5, "bending_stiffness": 2.0, "damping": {"mass": 0.2}}
    sections = [common | {"mass": 1.0, "diameter": 0.03}, common | {"mass": 1.5, "diameter": 0.02}]
    over = [[0, 0, -5], [3.6, 0, -0.6], [4, 0, -0.45], [4.4, 0, -0.6], [4.52, 0, -1], [4.52, 0, -10]]
    sheave = {"kind": "cylinder", "at": [4, 0, -1], "axis": [0, 1, 0], "radius": 0.5, "friction": 0.3}
    found = hybrid.static(cable_scene(
        sections, pinned_at(0, 0, -5), {"kind": "body", "mass": 30}, initial={"kind": "equilibrium", "points": over},
        obstacles={"sheave": sheave | {"bearing": {"inertia": 2.0, "damping": 0.5}}}, mesh=cells, model="rod"
    ))  # fmt: skip
    assert (found.position[0, -1, 0] < 1.0) == left
    said = [x for x in found.events if x.kind == "several equilibria"]
    assert bool(said) == left
    assert all("lies on obstacle sheave" in x.text for x in said)
