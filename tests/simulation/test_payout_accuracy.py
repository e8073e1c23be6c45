"""Lines that are paid out: steps that follow the motion, and errors that are estimated; against finer runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_payout import G, clamped, hanging, sagging

import hybrid
from hybrid.model.build import build
from hybrid.model.payout import lengths_at
from hybrid.scene.read import one_line

FINE = 0.005  # s


def follows(tolerance: float, scene: dict[str, Any], duration: float = 12.0) -> dict[str, Any]:
    """The scene in steps that follow the motion."""
    return scene | {"time": {"duration": duration, "tolerance": tolerance}}


def short(*args: Any, **more: Any) -> dict[str, Any]:
    return sagging(*args, duration=12.0, **more)


@pytest.fixture(scope="module")
def fine() -> dict[str, hybrid.Result]:
    """A catenary and a rod behind a clamp in short fixed steps."""
    scenes = {"catenary": short(step=FINE), "clamp": clamped(short("rod", 2e6, 2e4, step=FINE))}
    return {name: hybrid.run(scene) for name, scene in scenes.items()}


def off(result: hybrid.Result, exact: hybrid.Result, name: str = "position") -> float:
    return float(np.linalg.norm(result[name] - exact[name], axis=-1).max())


def entries(scene: dict[str, Any], t: np.ndarray) -> np.ndarray:
    """Numbers of the steps after which a node enters."""
    plan = build(one_line(hybrid.validate_scene(scene))).payout
    assert plan is not None
    lengths, _ = lengths_at(plan.law, t)
    out = np.floor((lengths - plan.layer[0] - 0.85 * 2.5) / 2.5 + 1e-9)
    return np.flatnonzero(np.diff(out) > 0)


# --- steps ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["catenary", "clamp"])
def test_the_error_falls_with_the_tolerance(fine: dict[str, hybrid.Result], name: str) -> None:
    """Of third order in a step, and of second in all: a hundredth of the tolerance, 1/21 of the error."""
    scene = short() if name == "catenary" else clamped(short("rod", 2e6, 2e4))
    coarse, fine_ = (hybrid.run(follows(x, scene)) for x in (1e-3, 1e-5))
    errors = [off(x, fine[name]) for x in (coarse, fine_)]
    assert 12.0 < errors[0] / errors[1] < 35.0
    pulls = [off(x, fine[name], "reaction_end") for x in (coarse, fine_)]
    assert pulls[1] < 1.5e-3 * 3000.0 and pulls[1] < 0.5 * pulls[0]


@pytest.mark.parametrize("surges", [True, False])
def test_a_node_that_enters_is_no_error_of_the_step(surges: bool) -> None:
    """No step after it is repeated, and none is much shorter, also where nothing else moves."""
    scene = clamped(short("rod", 2e6, 2e4))
    if not surges:
        del scene["ends"]["end"]["motion"]
    scene = follows(1e-5, scene)
    result = hybrid.run(scene)
    enter = entries(scene, np.asarray(result["steps/t"]))
    assert enter.size >= 3
    dt, repeats = np.asarray(result["steps/dt"]), np.asarray(result["steps/repeats"])
    assert not repeats[enter + 1].any()
    assert (dt[enter + 1] / dt[enter]).min() > 0.6
    if surges:
        del scene["ends"]["end"]["payout"]
        assert 0.85 < len(dt) / len(hybrid.run(scene)["steps/t"]) < 1.15


def test_short_steps_kick_no_more_than_long_ones(fine: dict[str, hybrid.Result]) -> None:
    """New cells get their lengths in a time of the line, not of the steps: the pull kicked by 4 % in these."""
    result = hybrid.run(clamped(short("rod", 2e6, 2e4)))
    pulls = [np.linalg.norm(x["reaction_end"], axis=1) for x in (result, fine["clamp"])]
    assert np.abs(pulls[0] - pulls[1]).max() < 2e-3 * pulls[1].mean()


def test_payout_that_begins_late_is_not_stepped_over() -> None:
    """A line at rest would be stepped by seconds."""
    scene = hanging({"rate": 1.0, "begin": 20.0, "ramp": 0.5}, 24.0)
    result = hybrid.run(follows(1.0, scene, 24.0))
    t, dt = np.asarray(result["steps/t"]), np.asarray(result["steps/dt"])
    assert dt[t > 20.6].max() <= 2.0 / 8.0 * 1.001  # of a cell of 2 m in eight steps
    rate = result["payout/rate"][-1]
    assert rate == pytest.approx(1.0, abs=1e-9)
    assert result["reaction_end"][-1, 2] == pytest.approx(2.0 * G * result["payout/length"][-1], rel=1e-6)


def test_such_steps_are_taken_from_outside() -> None:
    """A rate that is set for the next second is not stepped over either."""
    scene = follows(1e-3, hanging({"longest": 60.0}, 8.0), 8.0)
    with hybrid.Simulation(scene) as sim:
        while sim.t < 7.9:
            sim.set_payout(0.2 * (sim.t + 1.0))
            sim.advance(sim.t + 1.0)
        assert sim.length == pytest.approx(40.0 + 0.1 * sim.t**2, abs=1e-9)
        assert sim.forces().end[2] == pytest.approx(-2.0 * sim.length * (G - 0.2), rel=1e-6)


# --- the direction of the pull ----------------------------------------------------------------------


def test_a_node_that_enters_does_not_turn_the_pull() -> None:
    """Of a rod that turns freely at the winch: the last cells are those that change, and the force was off by 1.2 %."""
    scene = short("rod", 2e6, 2e4, output={"every": 0.1})
    forces = [hybrid.run(scene | {"mesh": {"cells": n}})["reaction_end"] for n in (40, 80)]
    apart = np.linalg.norm(forces[0] - forces[1], axis=1)
    assert apart.max() < 2.5e-3 * np.linalg.norm(forces[1], axis=1).mean()


def test_outputs_within_steps_stretch_as_those_at_their_ends() -> None:
    """Long steps: the length that is out is no straight line in them, and energy was created by 40 J at such outputs."""
    scene = short("catenary", 2e6)
    del scene["ends"]["end"]["motion"]
    scene |= {"time": {"duration": 4.0, "step": 1.0 / 3.0}, "output": {"every": 1.0 / 9.0}, "mesh": {"cells": 80}}
    result = hybrid.run(scene)
    stretch = result["energy/stretch"]
    assert stretch.min() > 111.0
    assert stretch.max() < 119.0  # as at ends of steps; it was 140 between them
    assert np.abs(result["work/scheme"]).max() < 20.0  # work is a straight line in a step


# --- errors -----------------------------------------------------------------------------------------


def figures(scene: dict[str, Any], exact: dict[str, Any], *names: str) -> dict[str, float]:
    """Figures over true errors."""
    result, fine_ = hybrid.run(scene | {"output": {"every": 0.5, "errors": True}}), hybrid.run(exact)
    assert not {x.kind for x in result.events} & {"no error figure", "model error not estimated"}
    out = {}
    for name in names:
        own = name.replace("end_force", "reaction")
        apart = result[own] - fine_[own]
        true = off(result, fine_, own) if own != name or name == "position" else float(np.abs(apart).max())
        out[name] = float(np.max(result.errors[f"total/{name}"])) / true
    return out


ENDS = ("end_force_start", "end_force_end")
# A line, the same in shorter steps on more cells, and what is compared.
FINER = {
    **{f"rate {rate}": (short("catenary", 2e6, rate=rate),
                        short("catenary", 2e6, rate=rate, step=0.0125) | {"mesh": {"cells": 160}},
                        ("position", "tension", *ENDS)) for rate in (0.8, -0.8)},
    # Eight nodes ride, and runs to compare with have not that many cells: fewer ride in them.
    "few cells behind a clamp": (clamped(short("rod", 2e6, 2e4)) | {"mesh": {"cells": 24}},
                                 clamped(short("rod", 2e6, 2e4, step=0.0125)) | {"mesh": {"cells": 96}},
                                 ("position", "end_force_end")),
    # Beside pins, whose layers results have, the rods to compare with are further off.
    "neglected bending": (short("catenary", 2e6, 500.0), short("rod", 2e6, 500.0, step=0.0125) | {"mesh": {"cells": 160}},
                          ("position", "curvature", "end_force_end")),
}  # fmt: skip


@pytest.mark.parametrize("name", FINER)
def test_errors_are_those_of_a_finer_run(name: str) -> None:
    scene, finer, quantities = FINER[name]
    for quantity, ratio in figures(scene, finer, *quantities).items():
        assert 0.7 < ratio < (4.0 if quantity == "curvature" else 3.0), quantity


@pytest.mark.long
def test_an_accuracy_is_asked_and_met() -> None:
    """Without steps and cells it is 1 %, as of any line; the true error is below what is asked."""
    scene = {k: x for k, x in sagging("catenary", 2e6).items() if k != "mesh"} | {"time": {"duration": 20.0}}
    result = hybrid.run(scene)
    assert {x.verdict for x in result.verdicts().accuracy} == {"met"}
    finer = sagging("catenary", 2e6, step=0.0125) | {"mesh": {"cells": 160}}
    true = off(result, hybrid.run(finer))
    assert true < 0.14  # of 14 m that the line moves
    assert 0.7 < float(np.max(result.errors["total/position"])) / true < 3.0


def test_a_plan_tells_the_cells_of_the_longest_line_as_of_the_first() -> None:
    """Cells of a catenary are alike, and its plan has those that a pre-run has shown to be enough."""
    scene = {k: x for k, x in sagging("catenary", 2e6).items() if k != "mesh"} | {"time": {"duration": 20.0}}
    hybrid.run(scene)  # compiles
    plan = hybrid.plan(scene)
    assert plan.measured and plan.payout is not None
    assert plan.payout.cells / sum(plan.cells) == pytest.approx(plan.payout.longest / plan.payout.first, rel=0.15)
