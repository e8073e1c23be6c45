"""Error figures beside the truth, in scenes where they were once much too small.  docs/evidence/accuracy.md"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.accuracy.error_estimate import Estimate
from hybrid.model.build import twist_rate
from hybrid.model.material import material
from hybrid.model.resolution import Resolution
from hybrid.scene.read import one_line
from hybrid.simulation.run_sample import RunSample
from tests.scenes import cable_scene, clamped_at, pinned_at

# Estimated over true error, as asked of the project; where it is below, an event must say that it is uncertain.
SHARP = 0.7, 3.0
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def effectivity(result, truth, name="position"):
    """Largest estimated error of an output over the largest true one."""
    error = np.array(result[name]) - np.array(truth[name])
    true = np.linalg.norm(error, axis=-1) if error.ndim == 3 else np.abs(error)
    return float(np.max(result.errors[f"total/{name}"]) / true.max())


def at_outputs(result, truth, name="position"):
    """Largest estimated error of each output over the largest true one of it."""
    true = np.linalg.norm(np.atleast_3d(np.array(result[name]) - np.array(truth[name])), axis=2).max(axis=1)
    return result.errors[f"total/{name}"].max(axis=1)[true > 0.0] / true[true > 0.0]


def tether(model, accuracy):
    """A short tether, swayed, held by a clamp: zones of a coarse mesh are rod where those of a fine one need not be."""
    return cable_scene(
        {"length": 16.9236, "mass": 0.923006, "diameter": 0.0254979, "bending_stiffness": 11.6023,
         "drag": {"normal": 1.53475, "tangential": 0.0554847}, "added_mass": {"normal": 0.522405},
         "axial_stiffness": 1761290.0},
        pinned_at(0.0, 0.0, 0.0,
                  motion={"ramp": 14.1502, "sway": {"amplitude": 0.275069, "period": 10.1191, "phase": 104.756}}),
        clamped_at([3.41804, -5.11608, 0.0193178], [0.926661, -0.709372, 0.0865805]),
        fluid={"density": 1025, "current": [0.295773, 0.219286, 0.0]}, model=model, time={"duration": 12.6028},
        output=(0.630141, 201), accuracy=accuracy
    )  # fmt: skip


@pytest.mark.long  # 1.1 s
def test_zones_of_a_coarser_run_do_not_hide_what_those_of_the_result_leave_out():
    """The runs to compare with are all rod, the result is not: 0.26 where their model error was believed."""
    truth = hybrid.run(tether("rod", "0.1%"))
    result = hybrid.run(tether({"kind": "adaptive", "always_move": True}, {"position": "2%", "tension": "2%"}))
    kinds = {zone.kind for row in result.zones for zone in row}
    assert kinds == {"rod", "catenary"}
    assert SHARP[0] <= effectivity(result, truth) <= SHARP[1]
    assert SHARP[0] <= effectivity(result, truth, "tension") <= SHARP[1]
    assert result.errors["model/position"].max() > 0.5 * result.errors["total/position"].max()


@pytest.mark.long  # 0.9 s
def test_the_figure_of_a_tether_whose_model_is_left_open_is_sharp_at_every_output():
    """0.30 of the truth was estimated, once, with an accuracy of 1 %."""
    scene = tether("rod", "1%")
    del scene["model"]
    result, truth = hybrid.run(scene), hybrid.run(tether("rod", "0.1%"))
    for name in ("position", "tension"):
        found = at_outputs(result, truth, name)
        assert SHARP[0] <= found.min() and found.max() <= SHARP[1], (name, found)


@pytest.mark.slow  # seven seconds of processor time
def test_the_figure_of_a_swayed_line_with_a_clump_is_not_too_small():
    """A line of zones that move, clamped at its swayed end, in a current that veers: 0.10 was estimated, once.

    Where outputs are far below the largest error, the figure may be larger than three times the truth.  Just after
    zones have changed at the clamp the linear estimate of 1.0 said 0.32 of what the tension is off, and that it was not
    known; rods in its place say all of it.
    """
    scene = cable_scene(
        {"length": 170.512, "mass": 0.30553, "diameter": 0.0165355, "bending_stiffness": 2.31291,
         "drag": {"normal": 1.52742, "tangential": 0.0514878}, "added_mass": {"normal": 0.501979},
         "axial_stiffness": 603948.0, "damping": {"mass": 0.0128977, "stiffness": 0.000833792}},
        pinned_at(0.0, 0.0, 0.0),
        clamped_at([-79.3646, 16.0996, 28.8296], [-0.997574, 0.244729, 0.175252],
                   motion={"ramp": 8.64356, "sway": {"amplitude": 1.36513, "period": 4.69202, "phase": 78.9804},
                           "surge": {"amplitude": 1.28262, "period": 5.45903, "phase": 280.382}}),
        attachments=[{"kind": "clump", "at": 95.498, "mass": 0.61106, "volume": 0.0}],
        fluid={"density": 1025,
               "current": {"kind": "power_law", "velocity": [-0.0734406, -0.134609, 0.0], "top": 20.0, "bottom": -151.0,
                           "exponent": 0.376843, "veer": 45.63}},
        time={"duration": 8.0066}, output=(0.40033, 201)
    )  # fmt: skip
    truth = hybrid.run(scene | {"model": "rod", "accuracy": {"position": "0.1%", "tension": "0.1%"}})
    result = hybrid.run(
        scene | {"model": {"kind": "adaptive", "always_move": True}, "accuracy": {"position": "1%", "tension": "1%"}}
    )
    assert SHARP[0] <= effectivity(result, truth) <= SHARP[1]
    assert {"grow", "split"} & {event.kind for event in result.events}
    for name in ("position", "tension"):
        found = at_outputs(result, truth, name)
        assert found.size > 15 and found.min() >= SHARP[0], (name, found)


def test_the_figure_is_sharp_where_a_run_has_come_to_rest():
    """The suspension of Goyal and Perkins, let go from a straight line: at 20 s, 0.08 of the distance to rest, once.

    It rests from 15 s on; the truth is its equilibrium, on a fine mesh.
    """
    scene = cable_scene(
        {"length": 2.0, "diameter": 0.001, "mass": 0.0007853981633974482, "bending_stiffness": 0.00024543692606170255,
         "torsional_stiffness": 0.00019634954084936205, "drag": {"normal": 1.5, "tangential": 0.05}, "damping": 2.0},
        pinned_at(0, 0, 0),
        {"kind": "guided", "tangent": [0.8660254037844387, 0, 0.5], "force": [0.005, 0, -0.00866025403784]},
        gravity=9.8, fluid={"density": 1.0}, initial={"kind": "straight", "direction": [1, 0, 0]},
        time={"duration": 20.0}, output=0.5
    )  # fmt: skip
    result = hybrid.run(scene)
    rest = hybrid.static(scene | {"initial": "equilibrium", "model": "rod", "mesh": {"cells": 2000}})
    late = result.t >= 15.0
    assert late.sum() == 11
    true = np.linalg.norm(result["position"][late] - rest["position"][0], axis=2).max(axis=1)
    found = result.errors["total/position"][late].max(axis=1) / true
    assert SHARP[0] <= found.min() and found.max() <= SHARP[1], found


def test_the_force_at_a_held_end_of_a_line_let_go_is_of_order_one():
    """A level rod falls freely at first, and pulls at nothing; its end cell is held by half: m g h/2.

    At 3 % the force at t = 0 was 1.24 of what is asked, 0.69 of it estimated, and nothing was said.
    """
    given = ["accuracy=3%", "time.step=null", "mesh=null", "model=rod", "time.duration=1.5"]
    result = hybrid.run(hybrid.load_scene(EXAMPLES / "02_suspension.yaml", given))
    force = np.linalg.norm(result["reaction_start"], axis=1)
    assert force[0] == pytest.approx(7.853981634e-4 * 9.8 * 0.5 * result.mesh[0].s[1], rel=0.01)
    assert SHARP[0] <= result.errors["total/end_force_start"][0] / force[0] <= SHARP[1]
    assert force[0] <= 0.03 * force.max() or "accuracy missed" in {event.kind for event in result.events}


@pytest.mark.long
def test_zones_that_change_are_those_of_the_result():
    """Zones come and go with the tension; in a coarser run they did so at other times: 0.44 for the force at the start.

    What leaving bending out does is that of the result itself.
    """
    scene = cable_scene(
        {"length": 28.0759, "mass": 2.02593, "diameter": 0.0293229, "bending_stiffness": 25.9265,
         "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0}},
        pinned_at(0, 0, 0),
        pinned_at(24.6080, 0, 3.62212,
                  motion={"heave": {"amplitude": 0.997574, "period": 5.14669},
                          "surge": {"amplitude": 0.784406, "period": 6.6907}, "ramp": 10.2934}),
        fluid={"density": 1025, "current": [0.0178539, -0.0125168, 0]}, time={"duration": 25.7335},
        output=(0.643336, 51)
    )  # fmt: skip
    # One of 1142 cells and half the step, which an accuracy of 0.1 % comes to, changes no ratio below by 0.04.
    fine = {"model": "rod", "mesh": {"cells": 400}, "time": scene["time"] | {"step": 0.012}}
    truth = hybrid.run(scene | fine | {"output": scene["output"] | {"errors": False}})
    result = hybrid.run(scene | {"model": {"kind": "adaptive", "always_move": True}, "accuracy": "1%"})
    for name in ("position", "tension", "curvature", "bending_moment"):
        assert SHARP[0] <= effectivity(result, truth, name) <= SHARP[1], name
    for end in ("start", "end"):  # largest at one output, a snap, whose estimate is that of another: 0.69 and 1.03
        off = np.linalg.norm(np.array(result[f"reaction_{end}"]) - np.array(truth[f"reaction_{end}"]), axis=1).max()
        assert 0.65 <= np.max(result.errors[f"total/end_force_{end}"]) / off <= SHARP[1], end


@pytest.mark.parametrize("cells", [25, 100, 400])
def test_tension_beside_a_float_in_a_catenary(cells):
    """A rod's tension falls towards the float, by M^2/(2 EI): 16 % of the largest, of which 0.05 were estimated."""
    scene = cable_scene(
        {"length": 100, "diameter": 0.025, "mass": 1, "axial_stiffness": 1e6, "bending_stiffness": 2},
        pinned_at(0, 0, -10),
        pinned_at(90, 0, -10),
        attachments=[{"kind": "float", "at": 50, "buoyancy": 200}],
        fluid={"density": 1025},
        output={"points": 1001, "errors": True},
    )
    truth = hybrid.static(scene | {"model": "rod", "mesh": {"cells": 10000}})
    result = hybrid.static(scene | {"model": "catenary", "mesh": {"cells": cells}})
    for name in ("position", "tension", "curvature"):
        assert SHARP[0] <= effectivity(result, truth, name) <= SHARP[1], name


TOUCHDOWN = cable_scene(
    {"length": 37.520597, "mass": 1.0, "bending_stiffness": 4.0},
    pinned_at(0, 0, 0),
    pinned_at(33.371257775207795, 0, 10.0),
    gravity=10.0,
    seabed={"z": 0, "stiffness": 1e9},
    output={"points": 2001},
)


@pytest.mark.parametrize("model", [None, {"kind": "adaptive", "always_move": True}])
def test_curvature_asked_alone_is_met(model):
    """At rest on a hard bed curvature begins within sqrt(EI/T) = 0.15 m: catenaries lack all of it (25 %, once)."""
    truth = hybrid.static(TOUCHDOWN | {"model": "rod", "mesh": {"cells": 8000}})
    asked = TOUCHDOWN | {"accuracy": {"curvature": "1%"}} | ({"model": model} if model else {})
    result = hybrid.static(asked)
    assert not [e for e in result.events if e.kind == "accuracy missed"]
    error = np.abs(result["curvature"] - truth["curvature"]).max()
    assert error <= 0.01 * truth["curvature"].max()
    if model is None:
        assert SHARP[0] <= effectivity(result, truth, "curvature") <= SHARP[1]
    assert ("model chosen" in {e.kind for e in result.events}) == (model is None)
    assert any(zone.kind == "rod" for zone in result.zones[0])


def test_a_moment_asked_of_a_catenary_is_refused():
    with pytest.raises(hybrid.SceneError, match="no bending moment"):
        hybrid.static(TOUCHDOWN | {"accuracy": {"bending_moment": "1%"}, "model": "catenary"})


def test_cells_to_a_layer():
    """As many cells as asked to sqrt(EI/T) beside a clamp, whatever the accuracy."""
    T, EI = 1000.0, 10.0
    scene = cable_scene(
        {"length": 10, "mass": 1, "bending_stiffness": EI}, clamped_at([0, 0, 0], [1, 0, 0.2]),
        {"kind": "free", "force": [T, 0, 0]}, model="rod"
    )  # fmt: skip
    layer = np.sqrt(EI / T)
    for cells in (2.0, 8.0):
        for more in ({}, {"accuracy": {"all": "1%", "curvature": "none"}}):
            result = hybrid.static(scene | {"resolution": {"cells_per_layer": cells}} | more)
            first = int((result.mesh[0].s <= layer).sum()) - 1
            assert 0.7 * cells <= first <= 1.5 * cells + 1, (cells, more)


def test_cells_show_a_twist_by_a_moment():
    """A moment on the end of a shaft twists it by 40 rad: no more than 2 rad to a cell, which stops a run."""
    result = hybrid.static(cable_scene(
        {"length": 20, "mass": 1, "bending_stiffness": 1, "torsional_stiffness": 1}, clamped_at([0, 0, 0], [1, 0, 0]),
        {"kind": "free", "moment": [2.0, 0, 0], "force": [2000.0, 0, 0]}, model="rod", gravity=0.0
    ))  # fmt: skip
    assert result.attributes["cells"] >= 160
    np.testing.assert_allclose(result["twist"][0], 2.0, rtol=1e-3)


@pytest.mark.parametrize(
    "start, more, twisted",
    [
        ({"kind": "pinned", "position": [0, 0, 0]}, {}, False),
        ({"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "swivel": True}, {}, False),
        ({"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]}, {}, True),
        ({"kind": "free", "moment": [0, -2.0, 0]}, {}, True),
        ({"kind": "pinned", "position": [0, 0, 0]}, {"bending_stiffness": [1, 2]}, True),
        ({"kind": "pinned", "position": [0, 0, 0]}, {"diameter": 0.02}, True),
    ],
)
def test_a_moment_twists_only_what_takes_its_torque(start, more, twisted):
    """Torque is uniform along round sections without inertia: an end that turns freely makes it 0."""
    section = {"length": 20, "mass": 1, "bending_stiffness": 1, "torsional_stiffness": 1} | more
    straight = {"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0, 0]}
    scene = hybrid.validate_scene(cable_scene(
        section, start, {"kind": "free", "moment": [0, 2.0, 0]}, model="rod", time=(1.0, 0.1),
        initial="equilibrium" if "position" in start else straight
    ))  # fmt: skip
    rate = twist_rate(one_line(scene), material(one_line(scene)), np.array([10.0]))
    assert rate[0] == pytest.approx((4.0 if "moment" in start else 2.0) if twisted else 0.0)


def free_to_turn(cells=None):
    """Half of it is curved without load, and the other half, without torsional stiffness, lets it turn as it likes."""
    half = {"length": 10, "mass": 0.8, "diameter": 0.025, "axial_stiffness": 2e6, "drag": {"normal": 1.2}}
    curved = half | {"bending_stiffness": 10, "intrinsic_curvature": [0, 0.5, 0], "torsional_stiffness": 8}
    return cable_scene(
        [curved, half | {"bending_stiffness": 1}], pinned_at(0, 0, 0), clamped_at([12, 0, 0], [1, 0, 1]),
        fluid={"density": 1025, "current": [0.3, 0.2, 0]}, output={"points": 41}
    ) | ({"model": "rod", "mesh": {"cells": cells}} if cells else {})  # fmt: skip


@pytest.mark.long
def test_equilibria_that_depend_on_the_mesh_are_noticed():
    """Meshes of 60 and 120 cells find other solutions, 6 cm apart; one of three is reported as met, once."""
    shapes = [hybrid.static(free_to_turn(cells)).position[0] for cells in (60, 120)]
    assert np.linalg.norm(shapes[1] - shapes[0], axis=1).max() > 0.03
    kinds = {e.kind for e in hybrid.static(free_to_turn() | {"accuracy": {"tension": "1%"}}).events}
    assert "several equilibria" in kinds
    hanging = free_to_turn() | {
        "cable": {"sections": [{"length": 20, "mass": 0.8, "diameter": 0.025, "bending_stiffness": 10}]}
    }
    kinds = {e.kind for e in hybrid.static(hanging | {"accuracy": "1%"}).events}
    assert "several equilibria" not in kinds


def example(name, model, **more):
    scene = hybrid.load_scene(EXAMPLES / f"{name}.yaml").model_dump(mode="json", exclude_unset=True)
    return scene | {"model": {"kind": model}, "time": {"duration": 20.0}, "accuracy": "1%"} | more


@pytest.mark.parametrize("name", ["s_tether", "rov_tether"])
def test_what_bending_shifts_where_tension_or_direction_change_by_much(name):
    """An arch that loses its tension, and a kink of 100 degrees at a float: no linear estimate knows the first."""
    result, truth = (hybrid.run(example(name, model)) for model in ("catenary", "rod"))
    assert SHARP[0] <= effectivity(result, truth) <= SHARP[1]
    assert "error uncertain" not in {event.kind for event in result.events}


def growing(cells, steps, k):
    """Off by k of cells^-2 and of steps^-2, which the runs to compare with do not show as it is."""
    t = np.linspace(0.0, 1.0, 9)
    z = np.sin(t) * (1.0 + 10.0 * cells**-2.0 + 10.0 * k * steps**-2.0)
    position = np.zeros((9, 4, 3))
    position[..., 2] = z[:, None]
    resolution = Resolution(cells / 100, 1.0 / steps, None, 1e-3)
    return RunSample(resolution, {"position": position}, cells, steps, 0.0)


def test_a_finer_run_that_changes_more_than_was_foretold_takes_nothing_apart():
    """A body that falls until its line is taut, asked for 3 %: steps were to blame, cells were made shorter.

    Off by 2.6 times what is asked, figure 0.26 of that; of positions 0.12.
    """
    runs = [growing(*x) for x in ((100, 100, 1.0), (50, 50, 1.0), (50, 25, 1.0), (25, 25, 1.0))]
    as_foretold, more = Estimate(*runs), Estimate(*runs)
    as_foretold.update(growing(300, 120, 1.0))
    assert not as_foretold.shares_mixed
    first, finer = runs[0], growing(300, 120, -3.0)
    change = np.abs(finer.values["position"] - first.values["position"]).max()
    foretold = more.errors.largest("total", "position")
    assert change > 1.2 * foretold
    more.update(finer)
    assert more.shares_mixed == {"position"}
    assert more.errors.largest("total", "position") > change


def misled(by_cells, by_steps, cells, steps):
    """Off by so much of a sine and of a cosine; of the runs to compare with, too coarse to show what steps do."""
    t = np.linspace(0.0, 1.0, 33)
    reaction = np.zeros((33, 3))
    reaction[:, 0] = 100.0 + by_cells * np.sin(40.0 * t) + by_steps * np.cos(40.0 * t)
    return RunSample(Resolution(cells / 100, 1.0 / steps, None, 1e-3), {"reaction_end": reaction}, cells, steps, 0.0)


def test_a_finer_run_that_changes_as_much_as_was_foretold_takes_nothing_back():
    runs = (1.0, 0.0, 100, 100), (4.0, 3.0, 50, 50), (4.0, 28.0, 50, 25), (9.0, 3.0, 25, 25)
    estimate = Estimate(*(misled(*x) for x in runs))
    estimate.update(misled(-3.0, 0.0, 300, 300))
    assert estimate.errors.largest("time", "end_force_end") > 1.0
