"""A cable and the network that is made of it are the same computation: every dataset, and every event."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
from hybrid.cli.tables import equilibrium_facts
from hybrid.errors import ComputationError, SceneError
from hybrid.scene.read import as_scene
from hybrid.scene.root import in_full
from hybrid.store.reader import open_result
from tests.combinations.networks import both, differences, events_differ
from tests.combinations.pairs import FEATURES, scene_of
from tests.problems import tables_with
from tests.said import line_of
from tests.scenes import cable_scene, network_scene, pinned_at

# What is asked of a cable without a name, and of a line of a network by its name: outputs, cells, steps and zones.
SCENES: dict[str, dict[str, Any]] = {
    "arc lengths of outputs": {"output.points": [0.0, 3.1, 12.0], "output.history": [5.0]},
    "cells to a layer beside a clump": FEATURES["clump"][0] | FEATURES["layers"][0],
    "let go, with steps that follow": FEATURES["release"][0] | FEATURES["chosen steps"][0] | {"time.duration": 0.3},
    "zones that move": {"model": {"kind": "adaptive", "hold_time": 0.1, "force_rod": [[4, 8]]}},
}


@pytest.mark.parametrize("name", SCENES)
def test_a_cable_is_a_network_of_one_line(name: str) -> None:
    tables = tables_with(scene_of(), SCENES[name])
    cable, network = both(tables)
    assert [str(x) for x in differences(cable, network)] == []
    assert events_differ(cable, network) == []


def test_obstacles_at_rest_carry_what_they_do_as_a_run_begins() -> None:
    tables = tables_with(scene_of("sheave"), {"initial": "equilibrium"})
    rest, moves = hybrid.static(tables), hybrid.run(tables)
    for name in (x for x in rest.names if x.startswith("obstacles/")):
        np.testing.assert_allclose(rest[name][0], moves[name][0], rtol=1e-9, atol=1e-9, err_msg=name)
    assert rest["obstacles/pipe/force"][0, 2] < -20.0  # N


def test_a_winch_at_rest_holds_its_line() -> None:
    """With a free end: nothing but springs without force holds the network that is made of it."""
    section = {"length": 60.0, "mass": 2.0, "axial_stiffness": 1e7}
    winch = {"kind": "pinned", "position": [0, 0, 0], "payout": {"rate": 0.5, "ramp": 2.0}}
    tables = cable_scene(section, {"kind": "free"}, winch, mesh=30, model="catenary", time=(5.0, 0.1))
    assert hybrid.static(tables).tension.max() == pytest.approx(60.0 * 2.0 * GRAVITY, rel=0.02)


@pytest.mark.parametrize("network", [False, True])
def test_a_start_from_which_no_step_leads_on_is_in_the_file(network: bool, tmp_path: Path) -> None:
    scene = as_scene(scene_of("obstacle") | {"dimension": 2})
    with pytest.raises(ComputationError, match="leaves the plane"):
        hybrid.run(in_full(scene) if network else scene, tmp_path / "run.h5")
    with open_result(tmp_path / "run.h5") as result:
        assert result.status == "failed"
        assert result.times.tolist() == [0.0]
        assert np.isfinite(line_of(result)["tension"]).all()


# --- Several lines that start straight or along polylines, at rest where the scene has them, and not in equilibrium
# ---

EA, LENGTH, MASS, GRAVITY = 4e4, 4.0, 60.0, 9.81
SECTION = {"length": LENGTH, "mass": 0.01, "axial_stiffness": EA, "bending_stiffness": 1e3, "diameter": 0.02}
DOWN = {"kind": "straight", "direction": [0, 0, -1]}


def between_springs(**changes: Any) -> dict[str, Any]:
    """A weight between two light rods, one above it and one below, both straight and without tension at first."""
    line = {"sections": [SECTION], "initial": DOWN, "mesh": {"cells": 2}, "model": "rod"}
    scene = network_scene(
        {"top": {"position": [0, 0, 0]}, "foot": {"position": [0, 0, -2 * LENGTH]},
         "weight": {"initial_guess": [0, 0, -LENGTH], "mass": MASS}},
        {"upper": {"start": "top", "end": "weight"} | line, "lower": {"start": "weight", "end": "foot"} | line},
        gravity=GRAVITY, time=(0.6, 0.002, 1.0), output=0.02
    )  # fmt: skip
    return dict(tables_with(scene, changes))


def test_a_weight_let_go_between_two_springs_oscillates_about_its_rest() -> None:
    """z = -g/w^2 (1 - cos w t), w^2 = 2 EA/(L m); the rods have 1e-3 of its mass, a third of which moves with it."""
    result = hybrid.run(between_springs())
    w = np.sqrt(2.0 * EA / (LENGTH * (MASS + 2.0 * LENGTH * SECTION["mass"] / 3.0)))
    sink = GRAVITY / w**2 * (1.0 - np.cos(w * result.times))
    moved = result["points/weight/position"][:, 2] + LENGTH
    assert 1.2 < w * result.times[-1] / (2.0 * np.pi) < 3.0
    assert np.abs(moved + sink).max() < 2e-3 * sink.max()
    assert np.abs(result.lines["upper"]["tension"][:, 0] - EA * sink / LENGTH).max() < 5e-3 * EA * sink.max() / LENGTH
    assert not {"static_path", "static_residual"} & {*result.attributes}


FLOOR = {"obstacles": {"floor": {"kind": "plane", "at": [0, 0, -9], "normal": [0, 0, 1]}}}
BALL = {"mass": 1.0, "inertia": [1, 1, 1], "shape": {"kind": "sphere", "radius": 0.3}}


@pytest.mark.parametrize("more", [FLOOR, {"bodies": {"ball": BALL | {"initial_guess": [0, 0, -5]}}}, {"dimension": 2}])
def test_a_straight_line_that_nothing_holds_begins_where_its_first_point_is(more: dict[str, Any]) -> None:
    """Beside an obstacle, a body with a shape and in a plane: pydantic missed the origin of s = 0, with a traceback."""
    line = {"start": "a", "end": "b", "sections": [SECTION], "initial": DOWN, "mesh": {"cells": 4}, "model": "rod"}
    result = hybrid.run({
        "points": {"a": {"initial_guess": [0.5, 0, 1]}, "b": {"initial_guess": [0.5, 0, 1 - LENGTH]}},
        "lines": {"one": line}, "time": {"duration": 0.2, "step": 0.02},
    } | more)  # fmt: skip
    fallen = result.lines["one"]["position"][-1] - result.lines["one"]["position"][0]
    np.testing.assert_allclose(result.lines["one"]["position"][0, 0], [0.5, 0, 1])
    np.testing.assert_allclose(fallen, np.tile([0, 0, -0.5 * GRAVITY * 0.2**2], (len(fallen), 1)), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"lines.lower.initial": None}, "line upper starts so"),
        ({"lines.upper.initial": DOWN | {"velocity": [1, 0, 0]}}, "that of the other lines that meet at point weight"),
        ({"lines.upper.initial": {"kind": "straight", "direction": [1, 0, 0]}}, "lines.upper.initial.direction"),
        ({"lines.lower.initial": {"kind": "points", "points": [[0, 0, -4], [0, 0, -7.9]]}}, "lines.lower.initial"),
    ],
)
def test_what_contradicts_is_refused_at_its_key(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        hybrid.run(between_springs(**changes))


def test_such_a_start_is_where_the_search_of_a_rest_begins() -> None:
    """Of the same scene the equilibrium alone: the weight hangs from two strings, 2 T cos(angle) = m g."""
    away, down = 2.0, np.sqrt(LENGTH**2 - 2.0**2)
    section = SECTION | {"bending_stiffness": None}
    line = {"sections": [section], "mesh": {"cells": 2}, "model": "catenary"}
    lines = {
        name: line | {"start": name, "end": "weight", "initial": {"kind": "straight", "direction": [side * away, 0, -down]}}
        for name, side in (("west", 1), ("east", -1))
    }  # fmt: skip
    result = hybrid.static(network_scene(
        {"west": {"position": [-away, 0, 0]}, "east": {"position": [away, 0, 0]},
         "weight": {"initial_guess": [0, 0, -down], "mass": MASS}},
        lines, gravity=GRAVITY
    ))  # fmt: skip

    def missing(z: float) -> float:
        long = np.hypot(away, z)
        return 2.0 * EA * (long / LENGTH - 1.0) * z / long - (MASS + LENGTH * SECTION["mass"]) * GRAVITY

    found = -result["points/weight/position"][-1, 2]
    assert found == pytest.approx(brentq(missing, down, 2.0 * down, xtol=1e-12), rel=1e-6)
    assert found > down + 1e-2


HANG = {"length": 2.0, "mass": 0.5, "diameter": 0.02, "axial_stiffness": 2e3}
PULL = 20.0


def hanging(model: str, cells: int, **initial: Any) -> dict[str, Any]:
    """A soft line that hangs from a pin, pulled down: u = (F s + w (L s - s^2/2))/EA, in corners that are not even."""
    w = HANG["mass"] * GRAVITY
    s = 2.0 * np.linspace(0.0, 1.0, 9) ** 1.3
    depth = s + (PULL * s + w * (2.0 * s - 0.5 * s**2)) / HANG["axial_stiffness"]
    corners = np.column_stack([0.0 * s, 0.0 * s, -depth])
    return cable_scene(
        HANG | {"bending_stiffness": 0.1}, pinned_at(0, 0, 0), {"kind": "free", "force": [0, 0, -PULL]},
        gravity=GRAVITY, mesh=cells, model=model, time=(0.5, 0.005), output=0.01,
        initial={"kind": "points", "points": corners.tolist(), **initial}, dimension=3
    ) | ({"s": s.tolist()} if not initial else {})  # fmt: skip


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_a_line_that_starts_stretched_as_it_hangs_stays_there(model: str) -> None:
    """Spread evenly over the same polyline it bounces along its length by a third of what it is stretched."""
    scene = hanging(model, 40)
    s = scene.pop("s")
    stretch = HANG["mass"] * GRAVITY * 2.0 / HANG["axial_stiffness"]  # u at the end, m

    def moves(initial: dict[str, Any]) -> float:
        x = hybrid.run(hanging(model, 40, **initial))["position"][:, :, 2]
        return float(np.abs(x - x[0]).max())

    assert moves({"arc_lengths": s}) < 0.02 * stretch
    del scene["initial"]["points"][1:-1]
    x = hybrid.run(scene)["position"][:, :, 2]
    assert np.abs(x - x[0]).max() > 0.1 * stretch


def test_lines_that_nothing_holds_fall_and_have_no_equilibrium() -> None:
    """Two lines that meet at a free point: their middle falls by g t^2/2; at rest they are refused."""
    line = {"sections": [SECTION | {"length": 2.0}], "mesh": {"cells": 4}, "model": "rod"}
    scene = network_scene(
        {x: {"kind": "free", "initial_guess": [k, 0, 0]} for x, k in (("a", 0), ("b", 2), ("c", 4))},
        {"left": {"start": "a", "end": "b", "initial": {"kind": "straight", "direction": [1, 0, 0]}} | line,
         "right": {"start": "b", "end": "c", "initial": {"kind": "straight", "direction": [1, 0, 0]}} | line},
        gravity=GRAVITY, time=(0.5, 0.01)
    )  # fmt: skip
    result = hybrid.run(scene, progress=None)
    for name in scene["lines"]:
        fallen = result.lines[name]["position"][:, :, 2]
        assert np.abs(fallen + 0.5 * GRAVITY * result.times[:, None] ** 2).max() < 1e-9
    with pytest.raises(SceneError, match="nothing holds it"):
        hybrid.static(scene)


# --- Lines that are longer than along a level bed and straight up: they hang straight down, the rest lies slack ---
# The pull at an end above the bed is unique, w d, of the submerged weight w per length over the depth d; what lies carries
# nothing.  On cells of length h it is known to w h/2, which an event says.

SECTION_SLACK = {"length": 300.0, "mass": 100.0, "diameter": 0.1, "axial_stiffness": 8e8}
W = 9.80665 * (100.0 - 1025.0 * 0.25 * math.pi * 0.1**2)  # N/m


def around(depth: float, **bed: Any) -> dict[str, Any]:
    """Sea water over a bed."""
    fluid = {"density": 1025.0, "surface": 0.0}
    return {"gravity": 9.80665, "fluid": fluid, "seabed": {"z": -depth, "stiffness": 3e5, "damping": 3e4} | bed}


def slack(depth: float = 50.0, start: tuple[float, ...] = (), bed: Any = None, **more: Any) -> dict[str, Any]:
    """A chain from an anchor to a fairlead 200 m beside it, too long for them."""
    return (
        cable_scene(SECTION_SLACK, {"kind": "pinned", "position": start or (-200.0, 0.0, -depth)}, pinned_at(0.0, 0.0, 0.0),
                    environment=around(depth, **(bed or {})), model="catenary", mesh=30) | more
    )  # fmt: skip


def forces_of(result: hybrid.Result) -> dict[str, list[float]]:
    return equilibrium_facts(result)["force"]


@pytest.mark.parametrize("depth", [50.0, 47.0])
def test_the_pull_of_a_slack_line_is_the_weight_that_hangs(depth: float) -> None:
    result = hybrid.static(slack(depth))
    x, y, z = forces_of(result)["end"]
    assert abs(z - W * depth) <= 0.5 * W * 10.0 and math.hypot(x, y) < 1e-6 * z
    (event,) = [x for x in result.events if x.kind == "slack"]
    assert f"known to {0.5 * W * 10.0:.3g} N" in event.text and event.s_a == 0.0
    # In the cell at the anchor the force on the support has a part along the line, which sinks a little from there.
    lies = result.tension[-1][(result.s >= 10.0) & (result.s < 300.0 - depth - 10.0)]
    assert np.abs(lies).max() < 1e-9 * z, "what lies carries nothing"


def test_both_ends_may_hang_and_shorter_cells_come_to_the_weight() -> None:
    asked = {"mesh": {"cells": 600}}
    found = forces_of(hybrid.static(slack(start=(-200.0, 30.0, -20.0)) | asked))
    assert found["start"][2] == pytest.approx(30.0 * W, rel=0.01)
    assert found["end"][2] == pytest.approx(50.0 * W, rel=0.01)


def test_an_accuracy_that_is_asked_is_met() -> None:
    asked = {key: value for key, value in slack().items() if key != "mesh"} | {"accuracy": "1%"}
    result = hybrid.static(asked)
    assert forces_of(result)["end"][2] == pytest.approx(50.0 * W, rel=0.01)


def test_lines_of_a_network_lie_slack_as_well() -> None:
    line = {"end": "b", "model": "catenary", "mesh": {"cells": 60}}
    result = hybrid.static(network_scene(
        {"a": {"position": (-200, 0, -50)}, "b": {"position": (0, 0, 0)}, "c": {"position": (200, 0, -50)}},
        {"slack": line | {"start": "a", "sections": [SECTION_SLACK]},
         "taut": line | {"start": "c", "sections": [SECTION_SLACK | {"length": 212.0}]}},
        environment=around(50.0)
    ))  # fmt: skip
    of = {name: [x for x in line.events if x.kind == "slack"] for name, line in result.lines.items()}
    assert len(of["slack"]) == 1 and not of["taut"]
    assert result.lines["slack"].tension[-1].max() == pytest.approx(50.0 * W, rel=0.05)


def test_a_run_begins_there_and_stays() -> None:
    result = hybrid.run(slack(time={"duration": 1.0, "step": 0.05}))
    assert np.ptp(result.tension[:, -1]) < 1e-6 * 50.0 * W


@pytest.mark.parametrize("why", [{"bed": {"slope": (0.02, 0.0)}}, {"dimension": 2}])
def test_what_has_no_such_shape_is_refused_with_what_a_bending_stiffness_does_to_it(why: Any) -> None:
    with pytest.raises(ComputationError, match=r"changes forces by up to 1\.2e\+04 N"):
        hybrid.static(slack(start=(-200.0, 0.0, -45.0), **why))


@pytest.mark.parametrize("direction", [None, (0.0, 1.0, -1.0)])
def test_which_way_a_free_end_was_laid_is_told_where_nothing_says_so(direction: Any) -> None:
    scene = slack(20.0, initial={"kind": "equilibrium", "direction": direction} if direction else "equilibrium")
    section = {"length": 60.0, "mass": 5.0, "diameter": 0.05, "bending_stiffness": 100.0}
    scene |= {"cable": {"sections": [section]}, "model": "rod"}
    scene["ends"] = {"start": {"kind": "pinned", "position": (0, 0, 0)}, "end": "free"}
    result = hybrid.static(scene)
    told = [x.text for x in result.events if x.kind == "laid one way"]
    assert len(told) == (direction is None)
    assert result.position[-1, -1, 1 if direction else 0] > 30.0
    assert all("the end lies free on the seabed at [4" in text for text in told)


# --- Intermittent contact of ends with a fixed plane, a deck or the bed: against motion in closed form, and to rest
# ---

LENGTH_DROPPED, MASS_DROPPED, STIFFNESS, HEIGHT, GRAVITY_DROPPED = (
    6.0,
    4.0,
    5e4,
    0.4,
    9.81,
)  # m, kg/m, N/m per m, m, m/s2


def bouncing(t: np.ndarray) -> np.ndarray:
    """Height (m) above the plane of what falls from HEIGHT at rest on a spring that gives everything back."""
    fall, speed = np.sqrt(2.0 * HEIGHT / GRAVITY_DROPPED), np.sqrt(2.0 * GRAVITY_DROPPED * HEIGHT)
    w, sunk = np.sqrt(STIFFNESS / MASS_DROPPED), GRAVITY_DROPPED * MASS_DROPPED / STIFFNESS
    contact = 2.0 * (np.pi - np.arctan(speed / (w * sunk))) / w  # s, from touching to leaving
    t = (np.asarray(t) + fall) % (2.0 * fall + contact) - fall  # t = 0: at the top
    in_contact = t - fall
    depth = sunk * (np.cos(w * in_contact) - 1.0) - speed / w * np.sin(w * in_contact)
    return np.where(t <= fall, HEIGHT - 0.5 * GRAVITY_DROPPED * t * t, depth)


def scene(**tables: Any) -> dict[str, Any]:
    section = {
        "length": LENGTH_DROPPED,
        "mass": MASS_DROPPED,
        "axial_stiffness": 1e6,
        "bending_stiffness": 80.0,
        "diameter": 0.05,
    }
    return cable_scene(
        section | {"torsional_stiffness": 60.0}, "free", "free", seabed={"z": 2.0, "stiffness": STIFFNESS},
        initial={"kind": "straight", "direction": [1, 0, 0], "origin": [0, 0, 2.0 + HEIGHT]}, model="rod", mesh=12,
        time=(1.9, 5e-4), output=0.01
    ) | tables  # fmt: skip


@pytest.mark.parametrize("step", [1e-3, 5e-4])
def test_a_line_that_falls_flat_on_a_deck_bounces_as_a_mass_on_a_spring(step: float) -> None:
    """Three bounces without damping: the ends as all other points; the error is that of the time at which it touches."""
    result = hybrid.run(scene(time={"duration": 1.9, "step": step, "rho_inf": 1.0}))
    height = result.position[:, :, 2] - 2.0
    expected = bouncing(result.times)
    assert (expected < 0.0).any() and (np.diff(np.sign(expected)) != 0).sum() >= 6
    off = np.abs(height - expected[:, None]).max()
    print(f"step {step:g} s: {off:.2e} m off")
    assert off < 0.005 * HEIGHT
    assert np.ptp(height, axis=1).max() < 1e-6 * HEIGHT  # ends as the middle


def test_an_end_that_is_released_over_a_deck_comes_to_rest_on_it() -> None:
    damped = {"z": 0.0, "stiffness": 1e5, "damping": 2e3, "friction": 0.4}
    section = {"length": 20.0, "diameter": 0.05, "mass": 5.0, "axial_stiffness": 1e6, "bending_stiffness": 50.0,
               "torsional_stiffness": 40.0, "damping": {"stiffness": 0.02, "mass": 0.3}}  # fmt: skip
    result = hybrid.run(scene(
        cable={"sections": [section]}, environment={"seabed": damped}, initial="equilibrium", mesh={"cells": 40},
        ends={"start": pinned_at(0, 0, 8), "end": pinned_at(12, 0, 3, release_at={"time": 0.5})},
        time={"duration": 20.0, "step": 0.01}, output={"every": 0.05}
    ))  # fmt: skip
    assert "end released" in {e.kind for e in result.events}
    height = result.position[:, -1, 2]
    touched = np.flatnonzero(height < 0.0)
    assert height[0] == pytest.approx(3.0) and touched.size and result.times[touched[0]] > 0.8
    assert height.min() > -0.1  # it does not go through
    assert -2e-3 < height[-1] < 1e-3 and np.abs(result.velocity[-1]).max() < 0.05
    carried = result.reaction_start[-1, 2]  # what is not on the deck hangs at the start
    lifted = result.position[-1, :, 2] > 0.0
    assert carried == pytest.approx(5.0 * 9.81 * 20.0 * lifted.mean(), rel=0.1)
