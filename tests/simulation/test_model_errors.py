"""What leaving bending out changes in a line: its figure, from a run with rods, against the truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from controlled import OneLine

import hybrid
from hybrid.accuracy.model_choice import leaves_bending_out
from hybrid.accuracy.refinement import Free
from hybrid.model.resolution import first_resolution
from hybrid.scene.read import as_scene, one_line
from hybrid.scene.root import LINE, in_full
from hybrid.simulation.run_sample import RunSample, restored_sample
from hybrid.store.integrity import pack, unpack
from hybrid.store.stored_rows import MissingRows
from tests.scenes import cable_scene, pinned_at


def span(EI: float, model: Any, **more: Any) -> hybrid.Scene:
    """A span of 20 m that sags by 1.5 m, its end driven; errors on."""
    return hybrid.validate_scene(
        cable_scene(
            {"length": 20.3, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": EI, "damping": 0.3},
            pinned_at(0, 0, 0),
            pinned_at(20, 0, 0, motion={"heave": {"amplitude": 0.3, "period": 2.5}, "ramp": 3}),
            model=model,
            mesh=80,
            time=(5.0, 0.02),
            output={"every": 0.1, "errors": True},
        )
        | more
    )


@pytest.mark.long
def test_estimate_is_the_distance_to_the_rod():
    """In proportion to EI; of curvature, whose layers at the pins results have, little is left, and no less is said."""
    found = []
    for EI in (2.0, 4.0):
        rod, catenary = hybrid.run(span(EI, "rod")), hybrid.run(span(EI, "catenary"))
        true = np.linalg.norm(rod["position"] - catenary["position"], axis=2).max(axis=1)
        estimate = catenary["errors/model/position"].max(axis=1)
        effectivity = estimate / true
        assert np.median(effectivity) == pytest.approx(1.0, abs=0.02)  # 0.999 when written
        assert effectivity.min() > 0.9 and effectivity.max() < 1.15
        found.append(np.median(true))
        for name in ("tension", "bending_moment"):
            was = np.abs(rod[name] - (0.0 if name == "bending_moment" else catenary[name])).max(axis=1)
            assert np.median(catenary[f"errors/model/{name}"].max(axis=1) / was) == pytest.approx(1.0, abs=0.05), name
    assert 1.8 < found[1] / found[0] < 2.1
    fine, plain = (hybrid.run(span(4.0, model, mesh={"cells": 2560})) for model in ("rod", "catenary"))
    left = np.median(np.abs(fine["curvature"] - plain["curvature"]).max(axis=1))
    assert left < 2e-3 * fine["curvature"].max()
    assert 0.7 < np.median(plain["errors/model/curvature"].max(axis=1)) / left < 3.0


@pytest.mark.long
def test_pull_of_the_ends_is_estimated():
    """The force that holds an end, as its magnitude; within a tenth in the median (0.99 when written)."""
    a, b = hybrid.run(span(4.0, "catenary")), hybrid.run(span(4.0, "rod"))
    for end in ("start", "end"):
        true = np.abs(np.diff([np.linalg.norm(x[f"reaction_{end}"], axis=1) for x in (a, b)], axis=0)[0])
        clear = true > 0.1 * true.max()
        ratio = a[f"errors/model/end_force_{end}"][clear] / true[clear]
        assert np.median(ratio) == pytest.approx(1.0, abs=0.1)


def suspension(model: Any) -> hybrid.Scene:
    """examples/02 at rest and for half a second."""
    what = hybrid.load_scene("examples/02_suspension.yaml").model_dump(exclude_none=True)
    what |= {"model": model, "initial": {"kind": "equilibrium"}, "time": {"duration": 0.1, "step": 0.01}}
    what["output"] = {"every": 0.1, "errors": True}
    return hybrid.validate_scene(what)


@pytest.mark.long
@pytest.mark.parametrize("joint", [0.2, 0.4, 1.0, 1.5, 1.7])
def test_joints_in_the_middle_of_a_sag_know_what_they_cost(joint):
    """The suspension, lambda a tenth of its length (shared/validation: 1.9 to 8 cm): 0.95 to 1.15 of the truth."""
    cells = round(50 * joint)
    zones = [{"catenary": joint, "cells": cells}, {"rod": 2.0 - joint, "cells": 100 - cells}]
    whole = hybrid.run(suspension({"kind": "zones", "zones": [{"rod": 2.0, "cells": 100}]}))
    a = hybrid.run(suspension({"kind": "zones", "zones": zones}))
    true = np.linalg.norm(whole["position"] - a["position"], axis=2)[0].max()
    assert 0.95 < a["errors/model/position"][0].max() / true < 1.15
    moment = np.abs(whole["bending_moment"] - a["bending_moment"])[0].max()
    assert a["errors/model/bending_moment"][0].max() / moment == pytest.approx(1.0, abs=0.05)


def test_one_way_only():
    """Bit for bit the same run with errors and without."""
    with_, without = span(4.0, "catenary"), span(4.0, "catenary", output={"every": 0.1})
    a, b = hybrid.run(with_), hybrid.run(without)
    for name in ("position", "velocity", "tension", "reaction_end"):
        np.testing.assert_array_equal(a[name], b[name])
    assert not [name for name in b.names if name.startswith("errors/model")]


# --- how runs are compared --------------------------------------------------------------------------


def made_up(resolution: Any = None, **more: Any) -> RunSample:
    x = first_resolution(one_line(span(2.0, "catenary"))) if resolution is None else resolution
    position = np.full((9, 4, 3), 0.01 / x.fineness)
    return RunSample(x, {"position": position}, round(100 * x.fineness), round(10 / x.step), 0.0, **more)


def test_a_line_that_was_rod_everywhere_at_some_time_leaves_bending_out_at_others() -> None:
    """Rods that come and go along the whole of it: it had no error of the model, and no word of that."""
    line = in_full(as_scene(span(2.0, {"kind": "adaptive"}, mesh=None))).lines[LINE]
    everywhere = ((0.0, 12.0), (10.0, 20.3))
    assert leaves_bending_out(line, made_up(rods=everywhere, catenary=np.array([0.0, 0.5, 0.4])))
    assert not leaves_bending_out(line, made_up(rods=everywhere, catenary=np.zeros(3)))
    assert not leaves_bending_out(line, made_up(rods=everywhere))  # of zones that stay
    assert leaves_bending_out(line, made_up(rods=everywhere[:1]))


def test_rods_are_computed_when_no_run_beside_reads_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """They stand in its place for a time: a run that began meanwhile in another thread would be of rods."""
    order: list[str] = []

    def made(resolution: Any) -> RunSample:
        order.append("run")
        return made_up(resolution)

    def as_rods(case: Any, runs: Any, costs: list[float]) -> Any:
        order.append("rods")
        return runs

    monkeypatch.setattr("hybrid.accuracy.error_control.with_model_errors", as_rods)
    control = OneLine(None, Free(False, False, False), made, made)
    control.start(made_up().resolution)
    assert order[:5] == ["run", "run", "run", "run", "rods"]  # the result, and those to compare with


def test_what_bending_changes_in_a_run_whose_outputs_are_in_a_file_is_computed_again(tmp_path: Any) -> None:
    """The error is in no file: without a word it was none after a resume."""
    run = made_up(model_error={"position": np.ones((9, 4))})
    scene, shape = span(2.0, "catenary"), (9, 4, 0)
    tree = unpack(pack(run.checkpoint()))
    assert restored_sample(tree, one_line(scene), shape).model_error["position"].shape == (9, 4)
    tree = unpack(pack(replace(run, rows={"kept": 1}, forces=np.ones((2, 3))).checkpoint()))
    with pytest.raises(MissingRows):
        restored_sample(tree, one_line(scene), shape, tmp_path / "run.h5")


def test_a_run_of_a_checkpoint_of_1_0_is_read() -> None:
    """It has what the estimate was bounded by and doubted for, and whether it was followed along the run."""
    tree = unpack(pack(made_up().checkpoint()))
    tree |= {"bound": 0.1, "doubt": np.zeros(4), "resolution": tree["resolution"] | {"follow": True}}
    assert restored_sample(tree, one_line(span(2.0, "catenary")), (9, 4, 0)).cells == made_up().cells


# --- where there is none -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "bending", "why"),
    [
        ("rod", 2.0, "rod everywhere"),
        ({"kind": "zones", "zones": [{"rod": 10.0}, {"rod": 10.3}]}, 2.0, "rod everywhere"),
        ("catenary", None, "no bending stiffness"),
    ],
)
def test_nothing_left_out_is_absent_and_says_why(model, bending, why):
    what = span(2.0, "catenary").model_dump(exclude_none=True)
    section = what["cable"]["sections"][0] | {"bending_stiffness": bending}
    what["cable"]["sections"] = [{k: x for k, x in section.items() if x is not None}]
    what["model"], what["time"] = model, {"duration": 0.1, "step": 0.02}
    scene = hybrid.validate_scene(what)
    entry = next(x for x in hybrid.plan(scene).contents if x.what.startswith("model error"))
    assert not entry.on and why in entry.why
    assert not [name for name in hybrid.run(scene).names if name.startswith("errors/model")]


@pytest.mark.parametrize("cells", [25, 100, 400])
def test_model_error_beside_a_float(cells):
    """A float in the middle of a catenary, cells of 2 to 35 lambda: the distance to a rod is 0.06 to 0.07 m.

    That of 25 cells is less than bending does, 0.072 m, because their own error, 0.035 m, has the other sign.
    """
    scene = cable_scene(
        {"length": 100, "mass": 1, "diameter": 0.025, "axial_stiffness": 1e6, "bending_stiffness": 2},
        pinned_at(0, 0, -10), pinned_at(90, 0, -10), attachments=[{"kind": "float", "at": 50, "buoyancy": 200}],
        fluid={"density": 1025}, mesh=cells, model="catenary", output={"errors": True, "points": 201}
    )  # fmt: skip
    rod = hybrid.static(scene | {"model": "rod", "mesh": {"cells": 3000}, "output": {"points": 201}})
    line = hybrid.static(scene)
    true = np.linalg.norm(line.position[0] - rod.position[0], axis=1)
    assert 0.7 < line.errors["total/position"][0].max() / true.max() < (1.6 if cells == 25 else 1.5)
    assert line.errors["model/position"][0].max() == pytest.approx(
        0.0716, rel=0.08
    )  # of catenaries and rods of 3000 cells
    if cells > 25:
        assert line.errors["total/position"][0].argmax() == true.argmax()


# --- beside a joint on a bed -------------------------------------------------------------------

LENGTH, H = 250.0, 0.5  # m, cells where the line touches down
NODES = [*np.arange(0.0, 80.0, 4.0), *np.arange(80.0, 106.0, H), *np.arange(106.0, LENGTH + 1.0, 4.0)]


def beginning(model: Any, errors: bool, across: float) -> hybrid.Result:
    """Two steps of a line that touches down at s = 90 m, on a bed over 1.7 m of which it comes to rest.

    across: m/s, of a current that leads it out of its plane.
    """
    return hybrid.run(cable_scene(
        {"length": LENGTH, "diameter": 0.05, "mass": 20, "axial_stiffness": 2e8, "bending_stiffness": 2e3,
         "drag": {"normal": 1.2, "tangential": 0.05}},
        pinned_at(0, 0, -100), pinned_at(205, 0, 0), fluid={"density": 1025, "current": [0.0, across, 0.0]},
        seabed={"z": -100, "stiffness": 5e3, "damping": 5e2}, contact={"self": False}, model=model,
        mesh={"nodes": [float(x) for x in NODES]}, time=(0.02, 0.01),
        output={"every": 0.02, "points": NODES, "errors": errors}
    ))  # fmt: skip


@pytest.mark.parametrize("across", [0.0, 0.5], ids=["plane", "space"])
@pytest.mark.parametrize("joint", [87.0, 89.0, 90.0])
def test_what_a_joint_does_on_a_bed_is_stated(joint: float, across: float) -> None:
    """0.9 to 1.25 of it where it is largest; nowhere beside the joint less than two thirds of what counts."""
    rods = beginning({"kind": "rod"}, False, across)
    zones = {"kind": "zones", "zones": [{"catenary": joint}, {"rod": 105.0 - joint}, {"catenary": LENGTH - 105.0}]}
    found = beginning(zones, True, across)
    same = [int(np.abs(rods.s - x).argmin()) for x in found.s]
    true, near = np.abs(found.curvature - rods.curvature[:, same])[-1], np.abs(found.s - joint) < 3.0
    stated = found["errors/model/curvature"][-1]
    assert 0.9 < stated[near].max() / true[near].max() < 1.25
    assert (stated[near] > true[near] / 1.5 - 0.002 * rods.curvature.max()).all()


@pytest.mark.long
def test_rods_take_the_very_steps_of_a_run() -> None:
    """Of others the difference is of steps: 68 N were said of a catenary that is off by less than 1 N for its bending."""
    found = hybrid.run(
        hybrid.load_scene("examples/touchdown.yaml", ["accuracy={tension: 0.3%}", "mesh=null", "time={duration: 7}"])
    )
    assert {x.kind for zones in found.zones for x in zones} == {"catenary"}
    assert 0.5 < found["errors/model/end_force_end"].max() < 1.5
