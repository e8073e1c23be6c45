"""Lines on fixed obstacles: heavy capstans, blows, several diameters, what is said and what is refused.

Friction acts on the centreline (docs/theory.md), so that exponents are those of the angle alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.model.build import build
from hybrid.scene.read import one_line
from tests.scenes import cable_scene, pinned_at
from tests.validation.obstacle_scenes import Tables, heavy_capstan, over_pipe

# --- capstans ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
def test_a_heavy_rope_slides_where_its_weight_says(friction: float) -> None:
    """The heavy side that slides over a light one of height h: e^(mu pi) h + 2 mu R (e^(mu pi) + 1)/(1 + mu^2).

    The pull of what holds the light end counts as height, T/w.
    """
    result = hybrid.run(heavy_capstan(friction))
    r, R = result.position[-1], 0.051
    light = -r[0, 2] + result.tension[-1, 0] / (0.01 * 9.81)
    more = np.exp(friction * np.pi)
    held = more * light + 2.0 * friction * R * (more + 1.0) / (1.0 + friction**2)
    assert -r[-1, 2] == pytest.approx(held, rel=0.01)


# --- blows, and what is said ---------------------------------------------------------------------------


def falling(step: float, speed: float = 0.0, **more: Any) -> dict[str, Any]:
    """A rope that falls on a thin pipe across it, its ends free."""
    pipe = {"kind": "cylinder", "at": [0, 0, 0], "axis": [0, 1, 0], "radius": 0.1, "friction": 0.5}
    section = {"length": 2.0, "mass": 0.2, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.02,
               "damping": {"mass": 0.2}}  # fmt: skip
    return cable_scene(
        section, "free", "free", obstacles={"pipe": pipe},
        initial={"kind": "straight", "direction": [1, 0, 0], "origin": [-1.0, 0.3, 0.5], "velocity": [0, 0, -speed]},
        model="rod", mesh=100, contact={"self": False}, time=(0.6, step), output=(0.02, 101)
    ) | more  # fmt: skip


def test_cells_that_do_not_follow_a_radius_are_said() -> None:
    result = hybrid.run(falling(0.01, mesh={"cells": 20}))
    said = [e for e in result.events if e.kind == "unresolved bend" and "obstacle pipe" in e.text]
    assert said
    assert "cells of 0.028 m" in said[0].text


def test_a_line_that_sinks_into_a_soft_obstacle_is_said() -> None:
    tables = falling(0.01)
    tables["obstacles"]["pipe"]["stiffness"] = 50.0
    said = [e for e in hybrid.run(tables).events if e.kind == "deep in an obstacle"]
    assert said
    assert "obstacles.pipe.stiffness" in said[0].text


def test_the_program_places_cells_that_follow_a_radius() -> None:
    tables = falling(0.01)
    del tables["mesh"]
    model = build(one_line(hybrid.validate_scene(tables)))
    assert model.line.h.max() <= 0.25 * (0.1 + 0.01)
    assert any(x.what.startswith("obstacle pipe: cylinder") and x.on for x in model.contents)


@pytest.mark.parametrize(
    ("change", "where", "says"),
    [
        ({"ends": {"start": {"kind": "pinned", "position": [0, 0, 0.05]}, "end": "free"}}, "ends.start.position", "obstacles.pipe"),
        ({"obstacles": {"pipe": {"kind": "cylinder", "at": [0, 0, 0], "radius": 1}}}, "obstacles.pipe.axis", ""),
        ({"cable": {"sections": [{"length": 1.0, "mass": 1.0, "axial_stiffness": 1e5}]}}, "cable.sections[0].diameter", "touches obstacles"),
    ],
)  # fmt: skip
def test_what_does_not_go_with_obstacles_is_refused(change: dict[str, Any], where: str, says: str) -> None:
    tables = falling(0.01) | change
    if "ends" in change:
        tables["initial"] = "equilibrium"
    with pytest.raises(SceneError) as refused:
        hybrid.run(hybrid.validate_scene(tables))
    assert any(x.where == where and says in str(refused.value) for x in refused.value.complaints), refused.value


def test_an_equilibrium_within_an_obstacle_is_refused() -> None:
    """A line between two points on both sides of a wall that it cannot go round."""
    tables = over_pipe(obstacles={"wall": {"kind": "sphere", "at": [5, 0, 1.5], "radius": 4.5}})
    del tables["time"]
    tables["cable"]["sections"][0]["length"] = 10.5
    with pytest.raises(hybrid.ComputationError):
        hybrid.static(hybrid.validate_scene(tables))


@pytest.mark.parametrize(("cells", "said"), [(31, True), (120, False)])
def test_a_thin_pipe_that_may_pass_between_nodes_is_said(cells: int, said: bool) -> None:
    """It goes through 31 cells of 0.32 m untouched, at a node in none of 16 outputs; 120 cells of 0.08 m stop it."""
    cable = {"length": 10.02, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 1.0}
    travel = {"travel": {"by": [0, 0, -1.0], "over": 1.0}}
    result = hybrid.run(cable_scene(
        cable | {"damping": {"mass": 0.5}}, pinned_at(0, 0, 0), pinned_at(10, 0, 0),
        obstacles={"p": {"kind": "cylinder", "at": [5.0, 0, 0.3], "axis": [0, 1, 0], "radius": 0.05, "motion": travel}},
        model="rod", mesh=cells, time=(1.5, 0.01), output=0.1
    ))  # fmt: skip
    assert (result.position[-1, :, 2].min() > -0.7) == said  # it is in the way of the line, or above it
    found = [x for x in result.events if x.kind == "unresolved contact"]
    assert bool(found) == said
    assert all("cells of 0.12 m would meet it" in x.text for x in found)


@pytest.mark.parametrize("several", [False, True], ids=["cable", "lines"])
@pytest.mark.parametrize("z", [0.0, 0.15])  # along the axis of the pipe, where its normal is not known, and within it
def test_a_start_in_an_obstacle_is_refused(several: bool, z: float) -> None:
    section = {"length": 2.0, "mass": 0.3, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.02}
    straight = {"kind": "straight", "direction": [1, 0, 0]}
    common: dict[str, Any] = {
        "obstacles": {"pipe": {"kind": "cylinder", "at": [0, 0, 0], "axis": [1, 0, 0], "radius": 0.2}},
        "time": {"duration": 0.1, "step": 0.01},
    }
    line = {"sections": [section], "model": "rod", "mesh": {"cells": 20}}
    if several:
        points = {"a": {"initial_guess": [-1, 0, z]}, "b": {"initial_guess": [1, 0, z]}}
        scene = common | {"points": points, "lines": {"l": line | {"start": "a", "end": "b", "initial": straight}}}
    else:
        scene = (
            common | cable_scene(line.pop("sections"), "free", "free", initial=straight | {"origin": [-1, 0, z]}) | line
        )
    with pytest.raises(SceneError, match=r"outside of obstacles\.pipe" if several else "in obstacle pipe"):
        hybrid.run(scene)


# --- blows at the speed that a scene gives: how deep a line goes, and how fast it comes back ---

WIDTH, SPEED, MASS = 0.02, 10.0, 0.4


def thrown(obstacle: dict[str, Any], height: float, duration: float, speed: float = SPEED) -> hybrid.Result:
    """A rope of 1 m that flies level and down, without gravity."""
    section = {"length": 1.0, "mass": MASS, "diameter": WIDTH, "axial_stiffness": 2e5, "bending_stiffness": 0.1}
    start = {"kind": "straight", "origin": [-0.5, 0, height], "direction": [1, 0, 0], "velocity": [0, 0, -speed]}
    return hybrid.run(cable_scene(
        section, "free", "free", gravity=0, obstacles={"it": obstacle}, initial=start, model="rod", mesh=100,
        time=(duration, duration / 400), output=(duration / 400, 101)
    ))  # fmt: skip


@pytest.mark.parametrize("speed", [3.0, 10.0])
def test_a_rope_that_is_stopped_as_a_whole_goes_an_eighth_of_its_diameter_deep(speed: float) -> None:
    floor = {"kind": "plane", "at": [0, 0, 0], "normal": [0, 0, 1]}
    result = thrown(floor, 0.6 * WIDTH, 8.0 * 0.125 * WIDTH / speed, speed)
    deep = 0.5 * WIDTH - result.position[:, :, 2].min()
    # p = v sqrt(m/k) = D/8; less than that by half of the onset of contact, 0.01 D, over which the force grows
    assert deep == pytest.approx(WIDTH / 8, rel=0.06)
    np.testing.assert_allclose(result.velocity[-1, :, 2], speed, rtol=1e-2)
    assert not [e for e in result.events if e.kind == "deep in an obstacle"]


def test_a_rope_that_is_stopped_at_a_point_goes_about_as_deep() -> None:
    pipe = {"kind": "cylinder", "at": [0, 0, -0.05], "axis": [0, 1, 0], "radius": 0.05}
    result = thrown(pipe, 0.6 * WIDTH, 0.005)
    deep = (0.05 + 0.5 * WIDTH - np.hypot(result.position[:, :, 0], result.position[:, :, 2] + 0.05)).max()
    assert WIDTH / 16 < deep < WIDTH / 4  # D/8 where it is pressed on slowly, twice that at once
    assert result.position[-1, 0, 2] < -1.5 * WIDTH < 0.9 * WIDTH / 2 < result.position[-1, 50, 2]
    assert not [e for e in result.events if e.kind == "deep in an obstacle"]


# --- lines of several diameters: what lies on obstacles, and what a line has that is as thick throughout ---

STIFFNESS = 4e4


def cut(tables: Tables, lengths: list[float], diameters: list[float]) -> Tables:
    """The scene with its section cut in pieces of these lengths and diameters, m."""
    section = tables["cable"]["sections"][0]
    pieces = [section | {"length": x, "diameter": d} for x, d in zip(lengths, diameters, strict=True)]
    return tables | {"cable": {"sections": pieces}}


def test_each_section_rests_at_its_own_radius() -> None:
    """A limp rope on a floor: its axis is as high as its radius there, less the depth of the law of contact."""
    floor = {"kind": "plane", "at": [0, 0, 0], "normal": [0, 0, 1], "stiffness": STIFFNESS, "friction": 0.5}
    section = {"length": 12.0, "mass": 2.0, "diameter": 0.1, "axial_stiffness": 1e4, "bending_stiffness": 1e-4,
               "damping": {"mass": 5.0}}  # fmt: skip
    tables: Tables = cut(
        cable_scene(section, pinned_at(0, 0, 0.05), pinned_at(12, 0, 0.02), obstacles={"floor": floor}, model="rod",
                    mesh=120, contact={"self": False}, output={"points": 121}),
        [6.0, 6.0], [0.1, 0.04]
    )  # fmt: skip
    rest = hybrid.static(tables)
    z, weight, onset = rest.position[-1][:, 2], 2.0 * 9.81, 0.01 * 0.04
    p = np.sqrt(2.0 * onset * weight / STIFFNESS)
    p = p if p < onset else weight / STIFFNESS + 0.5 * onset
    assert z[10:50] == pytest.approx(0.05 + 0.5 * onset - p, abs=1e-7)
    assert z[70:110] == pytest.approx(0.02 + 0.5 * onset - p, abs=1e-7)
    force = -sum(rest[f"reaction_{x}"][-1][2] for x in ("start", "end")) + 12.0 * weight  # what the floor bears
    assert force == pytest.approx(float(np.trapezoid(np.full(120, weight), dx=0.1)), rel=0.02)


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_thick_sections_beside_the_pipe_change_nothing_on_it(model: str) -> None:
    """Where the thin section alone comes to the pipe all is as of a thin line, at rest and sliding over it."""
    tables = over_pipe(model=model)
    pipe = tables["obstacles"]["pipe"] | {"stiffness": 3e5, "at": [4, 0, -2.1]}
    tables["obstacles"] = {"pipe": pipe}
    tables["cable"]["sections"][0]["rotary_inertia"] = 1e-3  # else it goes by the diameter
    thin, thick = (hybrid.run(cut(tables, [1.125, 7.125, 3.75], x)) for x in ([0.05, 0.05, 0.05], [0.2, 0.05, 0.3]))
    assert np.abs(thin["work/friction"][-1]) > 0.1
    np.testing.assert_allclose(thick.position, thin.position, atol=1e-10)
    s = np.array(thin.s)
    within = np.abs(s - 1.125) + np.abs(s - 8.25) < 7.0  # not where sections meet, at which outputs know both
    np.testing.assert_allclose(thick["tension"][:, within], thin["tension"][:, within], rtol=1e-8)
    np.testing.assert_allclose(thick["energy/contact"], thin["energy/contact"], rtol=1e-7)


def test_a_step_of_diameter_that_rubs_on_a_pipe() -> None:
    """The thick side lies at its radius, the thin one no nearer than at its own, and the energy is what works have put in.

    Outputs are at ends of steps.
    """
    tables = cut(over_pipe(output={"every": 0.05, "points": 97, "exact": True}), [4.125, 7.875], [0.05, 0.09])
    pipe = tables["obstacles"]["pipe"] | {"at": [4, 0, -2.1]}
    result = hybrid.run(tables | {
        "obstacles": {"pipe": pipe}, "mesh": {"cells": 192}, "time": {"duration": 1.0, "step": 0.005}
    })  # fmt: skip
    axis, s = np.array(pipe["axis"]) / np.linalg.norm(pipe["axis"]), np.array(result.s)
    w = result.position - np.array(pipe["at"])
    gap = np.linalg.norm(w - (w @ axis)[..., None] * axis, axis=2) - pipe["radius"]
    assert gap[:, s > 4.12].min(axis=1) == pytest.approx(0.045, abs=0.002)
    assert gap[:, s < 4.12].min() > 0.025
    energy = sum(
        np.array(result[f"energy/{x}"]) for x in ("bending", "contact", "kinetic", "potential", "stretch", "torsion")
    )
    work = sum(np.array(result[f"work/{x}"]) for x in ("start", "end", "contact", "friction", "mass_damping", "scheme"))
    assert -result["work/friction"][-1] > 0.2
    np.testing.assert_allclose(energy - energy[0], work, atol=2e-3 * float(np.abs(result["work/end"]).max()))
