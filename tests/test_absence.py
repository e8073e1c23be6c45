"""What a scene does not ask for is not there: no bit, no number, no dataset, no import; and the plan says so."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import h5py
import numpy as np
import pytest

import hybrid
from hybrid.kernels.state.report import (
    ADDED_MASS,
    BODIES,
    BREAKOUT,
    DRAG,
    FLOW,
    FORCES,
    FRICTION,
    MASS_DAMPING,
    MAY_TOUCH,
    PLANAR,
    ROTARY,
    SEABED,
    SELF_CONTACT,
    SOIL,
    STIFFNESS_DAMPING,
    SURFACE,
    WAVES,
)
from hybrid.kernels.state.state import state_for
from hybrid.model.build import Model, build
from hybrid.scene.read import one_line
from hybrid.solve.line_jobs import JointJobs
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

BARE = {"length": 2.0, "mass": 0.1}
BENDS = BARE | {"bending_stiffness": 1.0e-2}
WET = {"environment": {"fluid": {"density": 1000.0}}}

# Optional parameters of the line, and the bit whose force reads them.
PARAMETERS = {
    "drag_n": DRAG,
    "drag_t": DRAG,
    "added_n": ADDED_MASS,
    "added_t": ADDED_MASS,
    "damp": MASS_DAMPING,
    "tau": STIFFNESS_DAMPING,
    "rotary": ROTARY,
    "polar": ROTARY,
    "buoy": SURFACE,
    "diameter": SURFACE,
    "displaced": WAVES,
    **dict.fromkeys(("point_drag", "point_added", "point_buoy", "point_displaced", "point_height"), BODIES),
}
SEA_PARAMETERS = {
    "surface": SURFACE,
    "offset": SEABED,
    "stiffness": SEABED,
    "damping": SEABED,
    "onset": SEABED,
    "slip_length": FRICTION,
    "friction": FRICTION,
    "depth": WAVES,
}


def wet(**more: Any) -> dict[str, Any]:
    return {"environment": {"fluid": {"density": 1000.0} | more}}


def bed(**more: Any) -> dict[str, Any]:
    return {"environment": {"seabed": {"z": -1.5, "stiffness": 100.0} | more}}


def on_it(**attachment: Any) -> dict[str, Any]:
    return {"cable": {"sections": [BARE | {"diameter": 0.01}], "attachments": [attachment]}}


def scene(section: dict[str, Any], model: Any = "catenary", **tables: Any) -> hybrid.Scene:
    """A cable that hangs from a pin."""
    return hybrid.validate_scene(
        cable_scene(section, pinned_at(0, 0, 0), "free", model=model, mesh=8, time=(0.05, 0.01)) | tables
    )


HYBRID = {"kind": "zones", "zones": [{"rod": 1.0, "cells": 4}, {"catenary": 1.0}]}
SCENES = {
    "bare catenary": (scene(BARE), 0),
    "bare rod": (scene(BENDS, "rod"), 0),
    "bare hybrid": (scene(BENDS, HYBRID), 0),
    "fluid, no coefficients": (scene(BARE | {"diameter": 0.01}, **WET), 0),
    "drag": (scene(BARE | {"diameter": 0.01, "drag": {"normal": 1.2}}, **WET), DRAG),
    "added mass": (scene(BARE | {"diameter": 0.01, "added_mass": {"normal": 1.0}}, **WET), ADDED_MASS),
    "mass damping": (scene(BARE | {"damping": 0.5}), MASS_DAMPING),
    "stiffness damping": (scene(BENDS | {"damping": {"stiffness": 0.01}}, "rod"), STIFFNESS_DAMPING),
    "rotary inertia": (scene(BENDS | {"rotary_inertia": 1e-5}, "rod"), ROTARY),
    "diameter of a rod": (scene(BENDS | {"diameter": 0.01}, "rod"), ROTARY | MAY_TOUCH),
    "no contact with itself": (scene(BENDS | {"diameter": 0.01}, "rod", contact={"self": False}), ROTARY),
    "diameter of a catenary": (scene(BARE | {"diameter": 0.01}), 0),
    "current without drag": (scene(BARE | {"diameter": 0.01}, **wet(current=[1, 0, 0])), FLOW),
    "surface": (scene(BARE | {"diameter": 0.005}, **wet(surface=1.0)), SURFACE),
    "waves": (
        scene(
            BARE | {"diameter": 0.005},
            **wet(surface=1.0, waves={"kind": "regular", "height": 0.1, "period": 3, "depth": 9}),
        ),
        SURFACE | WAVES,
    ),
    "seabed": (scene(BENDS, "rod", **bed()), SEABED),
    "friction": (scene(BENDS, "rod", **bed(friction=0.3)), SEABED | FRICTION),
    "soil": (
        scene(
            BENDS | {"diameter": 0.01}, "rod", environment={"seabed": {"z": -1.5, "soil": {"shear_strength": 500.0}}}
        ),
        SEABED | SOIL | ROTARY | MAY_TOUCH,
    ),
    "friction that breaks out": (
        scene(BENDS, "rod", **bed(friction={"axial": 0.3, "lateral": 0.3, "residual": [0.2, 0.2], "breakout": 0.1})),
        SEABED | FRICTION | BREAKOUT,
    ),
    "friction of zero": (scene(BENDS, "rod", **bed(friction=0)), SEABED),
    "clump": (scene(BARE, **WET, **on_it(kind="clump", at=1.0, mass=0.2)), 0),
    "clump with drag": (scene(BARE, **WET, **on_it(kind="clump", at=1.0, mass=0.2, drag_area=0.01)), BODIES),
    "modules": (scene(BARE, **WET, **on_it(kind="modules", range=[0.5, 1.0], buoyancy=0.1)), 0),
    "modules with drag": (
        scene(BARE, **WET, **on_it(kind="modules", range=[0.5, 1.0], buoyancy=0.1, drag_area=0.01)),
        DRAG,
    ),
    "damping of zero": (scene(BARE | {"damping": {"mass": 0.0, "stiffness": 0.0}}), 0),
    "everything": (
        scene(
            BENDS
            | {"diameter": 0.01, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}}
            | {"damping": {"mass": 0.5, "stiffness": 0.01}},
            HYBRID,
            **WET,
        ),
        DRAG | ADDED_MASS | MASS_DAMPING | STIFFNESS_DAMPING | ROTARY | MAY_TOUCH,
    ),
}
each_scene = pytest.mark.parametrize(("asked", "bits"), SCENES.values(), ids=SCENES.keys())


@each_scene
def test_only_what_is_asked_for_has_a_bit_and_numbers(asked: hybrid.Scene, bits: int) -> None:
    model = build(one_line(asked))
    line = model.line
    assert line.bits == bits
    for name, bit in SEA_PARAMETERS.items():
        value = getattr(model.sea.values, name)
        assert np.isnan(value).any() != bool(bits & bit), name
    assert bool(model.sea.values.waves.size) == bool(bits & WAVES)
    assert bool(line.bed_width.size) == bool(bits & SOIL)
    for memory in (model.sea.values.soil, state_for(line).soil):
        assert bool(memory.size) == bool(bits & (SOIL | BREAKOUT))
    for name, bit in PARAMETERS.items():
        value = getattr(line, name)
        assert (np.isfinite(value) if bits & bit else np.isnan(value)).all(), name


@pytest.mark.long
@each_scene
def test_the_contents_say_what_the_line_does(asked: hybrid.Scene, bits: int) -> None:
    plan = hybrid.plan(asked)
    said = {entry.what: entry for entry in plan.contents}
    for name, (bit, _) in FORCES.items():
        begins = bit == SELF_CONTACT and bool(bits & MAY_TOUCH)
        assert said[name].on == (bool(bits & bit) or begins), name
        assert said[name].why
    assert said["buoyancy"].on == (asked.environment.fluid is not None)
    kinds = {zone.kind for zone in plan.zones}
    assert said["rod cells: bending, torsion (12th order)"].on == ("rod" in kinds)
    assert said["catenary cells (6th order)"].on == ("catenary" in kinds)


@each_scene
def test_a_parameter_that_is_off_is_never_read(asked: hybrid.Scene, bits: int) -> None:
    """It is NaN: one read of it and no number of the result would be finite."""
    result = hybrid.run(asked)
    assert result.status == "complete"
    for name in result.names:
        # NaN where nothing touches or is near itself, and in events that are no change of zones
        if result[name].dtype.kind == "f" and not name.startswith(("touchdown", "events", "self_distance")):
            assert np.isfinite(result[name]).all(), name


def test_what_is_off_is_worked_by_nothing() -> None:
    work = hybrid.run(scene(BARE)).work
    for name in ("drag", "added_mass", "mass_damping", "stiffness_damping", "applied"):
        assert not work[name].any(), name


@pytest.mark.parametrize("kind", ["catenary", "rod"])
def test_elements_and_spins_are_where_the_rod_is(kind: str) -> None:
    line = build(one_line(scene(BENDS, kind))).line
    inner = line.element[1:-1]
    assert (inner == (kind == "rod")).all() and (line.spin == (kind == "rod")).all()
    assert not line.element[[0, -1]].any(), "pinned and free ends have no element"
    assert (line.kb[1:-1] > 0).all() == (kind == "rod")


def test_a_joint_is_a_node_without_an_element() -> None:
    model: Model = build(one_line(scene(BENDS, HYBRID)))
    joint = int(np.argmin(np.abs(model.line.s - 1.0)))
    assert model.line.element.tolist() == [0] + [1] * (joint - 1) + [0] * (model.cells - joint + 1)
    assert model.line.spin.tolist() == [1] * joint + [0] * (model.cells - joint)


def test_a_catenary_has_fewer_unknowns() -> None:
    assert hybrid.plan(scene(BENDS, dimension=3)).unknowns == 3 * 9 + 8
    assert hybrid.plan(scene(BENDS, "rod", dimension=3)).unknowns == 3 * 9 + 8 + 8
    assert hybrid.plan(scene(BENDS, HYBRID, dimension=3)).unknowns == 3 * 9 + 8 + 4


ROD_ONLY = {
    "twist", "bending_moment", "torque", "shear", "moment_start", "moment_end", "energy/bending", "energy/torsion",
}  # fmt: skip


def test_a_catenary_records_no_moments() -> None:
    names = set(hybrid.run(scene(BENDS)).names)
    assert not names & ROD_ONLY
    assert set(hybrid.run(scene(BENDS, "rod")).names) >= names | ROD_ONLY


BED_ONLY = {"contact", "contact_force", "grounded_length", "touchdown", "touchdown_position", "energy/contact"}


def test_no_seabed_no_touchdown() -> None:
    assert not BED_ONLY | {"seabed", "surface", "attached"} <= set(hybrid.run(scene(BENDS, "rod")).names)
    names = set(hybrid.run(scene(BENDS, "rod", **bed())).names)
    assert names >= BED_ONLY | {"seabed"} and not names & {"surface", "attached"}


def test_no_history_without_history(tmp_path: Any) -> None:
    hybrid.run(scene(BARE), output=tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as file:
        assert "history" not in file
        assert len(file["events/t"]) == 0


def test_static_results_have_no_steps_and_no_work() -> None:
    result = hybrid.static(scene(BARE))
    assert not [name for name in result.names if name.startswith(("steps/", "work/"))]
    assert isinstance(result, hybrid.Result) and len(result.times) == 1


def test_no_motion_no_reader_of_motion_files() -> None:
    """Splines are slow to import: a scene without a motion file does without them."""
    text = "cable: {sections: [{length: 1.0, mass: 1.0}]}\\ninitial: equilibrium\\nmodel: catenary\\n"
    text += "ends: {start: {kind: pinned, position: [0, 0, 0]}, end: free}"
    code = f"import sys, hybrid; hybrid.parse_scene('{text}'); assert 'scipy' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_results_kept_in_memory_write_no_file(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = hybrid.run(scene(BARE))
    assert result.tension.size and not list(tmp_path.iterdir())
    assert result.file is None


@pytest.mark.parametrize("command", ["schema", "--help", "--version"])
def test_words_need_no_compiler_and_no_plots(command: str) -> None:
    code = (
        "import sys\nfrom hybrid.cli.commands import main\ntry:\n    main(sys.argv[1:])\nexcept SystemExit as leave:\n"
    )
    code += "    assert not leave.code\nassert not {'numba', 'matplotlib', 'h5py', 'scipy'} & set(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code, command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


TORSION = {"torsional_stiffness": 1.0e-2}
PLANE = "computed in a plane (3 unknowns a node)"


@each_scene
def test_the_third_dimension_is_there_where_something_leaves_the_plane(asked: hybrid.Scene, bits: int) -> None:
    """All scenes above lie in a plane; with a guess along x and an end load along y none does."""
    said = {entry.what: entry for entry in hybrid.plan(asked).contents}
    assert said[PLANE].on and not said["torsion"].on
    assert hybrid.plan(asked).unknowns == 3 * build(one_line(asked)).cells + 2
    data = asked.model_dump(exclude_none=True)
    data["initial"] = {"kind": "equilibrium", "guess": "straight", "direction": [1, 0, -1]}
    data["ends"]["end"] = {"kind": "free", "force": [0.0, 0.1, 0.0]}
    plan = hybrid.plan(hybrid.validate_scene(data))
    said = {entry.what: entry for entry in plan.contents}
    assert not said[PLANE].on and "ends.end.force leaves" in said[PLANE].why
    assert said["torsion"].on == ("rod" in {zone.kind for zone in plan.zones})
    assert plan.unknowns > 3 * build(one_line(asked)).cells + 2


def test_a_plane_has_no_spins_no_torque_and_no_push_in_space() -> None:
    """Nothing across the plane is computed in it; nothing of a plane is there in space."""
    flat, space = (hybrid.run(scene(BENDS | TORSION, "rod", dimension=d)) for d in (2, 3))
    assert not flat.velocity[..., 1].any() and not flat.torque.any() and not space.torque.any()
    assert np.isnan(build(one_line(scene(BENDS, "rod", dimension=3))).line.plane).all()
    assert build(one_line(scene(BENDS, "rod", dimension=3))).line.bits == build(one_line(scene(BENDS, "rod"))).line.bits
    assert build(one_line(scene(BENDS, "rod", dimension=2))).line.bits == PLANAR


def test_the_contents_name_every_optional_part() -> None:
    """On or off, each with who asked or what would ask for it."""
    said = {entry.what: entry for entry in hybrid.plan(scene(BENDS, "rod")).contents}
    for what in (
        PLANE, "torsion", "zones that move", "bending that differs in two directions", "curvature without load",
        "attachments: 0", "axial compliance", "gravity", "buoyancy", *FORCES,
    ):  # fmt: skip
        assert said[what].why, what
    moving = {entry.what: entry for entry in hybrid.plan(scene(BENDS, "adaptive")).contents}
    assert not moving["criteria as fields"].on
    asked = {entry.what: entry for entry in hybrid.plan(scene(BENDS, "adaptive", output={"criteria": True})).contents}
    assert asked["criteria as fields"].on


HANGING = network_scene(
    {"a": {"position": [0, 0, 0]}, "b": {"position": [3, 0, 0]}, "middle": {"initial_guess": [1.5, 0, -1]}},
    {name: line_between(name, "middle", BARE | {"diameter": 0.01}, model="catenary", mesh=4,
                        contact={"self": False}) for name in "ab"}
)  # fmt: skip
BALL = {"mass": 1.0, "inertia": [1, 1, 1], "initial_guess": [1.5, 0, -3], "shape": {"kind": "sphere", "radius": 0.1}}


@pytest.mark.parametrize(
    ("tables", "borders"),
    [
        (HANGING, ["join_lines"]),
        (HANGING | {"bodies": {"ball": BALL}, "points": HANGING["points"] | {"middle": {"body": "ball", "place": [0, 0, 0.1]}}},
         ["join_lines", "meet_bodies"]),
    ],
    ids=["points", "a body with a shape"],
)  # fmt: skip
def test_newton_has_no_border_that_the_network_does_not_have(
    tables: dict[str, Any], borders: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No kernel, table or question for others; a line alone has none at all (tests/simulation/test_api.py)."""
    listed = list[list[str]]()
    march_by = JointJobs.march_by

    def noted(jobs: JointJobs, marcher: int) -> None:
        march_by(jobs, marcher)
        assert jobs.jobs[0]._bound["borders"].size == len(jobs._borders)
        listed.append([x.kernel.__name__ for x, _ in jobs._borders])

    monkeypatch.setattr(JointJobs, "march_by", noted)
    hybrid.static(tables)
    assert listed and all(x == borders for x in listed)
