"""Lines that touch free bodies: rest by string theory, momentum of a body that is struck, heavy bodies, equivalences."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.junctions.bodies import PLACE, W
from hybrid.kernels.state.report import STIFFNESS
from hybrid.model.network import build_network
from hybrid.scene.bodies import turned
from hybrid.simulation.equilibrium import joined_lines
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import NetworkState
from tests.combinations.pairs import seen_by
from tests.scenes import line_between, network_scene, system_of

RADIUS, STRAND, SPAN, APART, MASS = 0.6, 0.01, 10.0, 0.2, 20.0
Tables = dict[str, Any]


def on_two_lines(**body: Any) -> Tables:
    """A ball on two taut lines side by side, at the middle of their span."""
    section = {"length": 9.9, "mass": 0.05, "diameter": 2 * STRAND, "axial_stiffness": 1e6, "bending_stiffness": 1e-3,
               "damping": {"mass": 0.5}}  # fmt: skip
    line = {"sections": [section], "contact": {"self": False}, "model": "rod", "mesh": {"cells": 80}}
    points = {
        f"{x}{side}": {"position": [x, y, 0]} for x in (0, 10) for side, y in (("left", APART), ("right", -APART))
    }
    ball = {"initial_guess": [5.0, 0.0, 0.58], "mass": MASS, "inertia": [3.0, 3.0, 3.0],
            "shape": {"kind": "sphere", "radius": RADIUS}}  # fmt: skip
    return network_scene(
        points, {side: {"start": f"0{side}", "end": f"10{side}", **line} for side in ("left", "right")},
        bodies={"ball": ball | body}, time=(0.2, 0.01), output=(0.05, 41)
    )  # fmt: skip


# --- at rest ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rest() -> Any:
    return hybrid.static(on_two_lines())


def test_a_ball_rests_on_two_taut_lines_as_on_strings(rest: Any) -> None:
    """A string of tension T under F at its middle gives way by F l/(2 T), l half its span: down by half of the weight,

    and aside, as the normal at the place of contact leans.
    """
    left, half = rest.lines["left"], 0.5 * MASS * 9.81
    place, T = left.position[-1][20], float(left.tension[-1].mean())
    assert "stability not judged" in {x.kind for x in rest.events}
    force = -left["obstacles/ball/force"][-1]  # on the line
    np.testing.assert_allclose(rest["bodies/ball/force"][-1], [0, 0, MASS * 9.81], atol=1e-6)
    assert force[2] == pytest.approx(-half, rel=1e-6)
    lean = place[1] / (RADIUS + STRAND)
    assert force[1] == pytest.approx(half * lean / np.sqrt(1 - lean**2), rel=0.005)
    own = left["position"][-1][20][2] + half * 0.25 * SPAN / T
    assert own == pytest.approx(-0.05 * 9.81 * SPAN**2 / (8 * T), rel=0.2)  # its weight, from what is small
    assert place[1] - APART == pytest.approx(force[1] * 0.25 * SPAN / T, rel=0.02)
    height = float(rest["bodies/ball/position"][-1][2] - place[2])
    assert np.hypot(place[1], height) == pytest.approx(RADIUS + STRAND, abs=0.05 * 2 * STRAND)


def test_what_rests_stays_and_an_obstacle_there_holds_the_lines_the_same(rest: Any) -> None:
    moved = hybrid.run(on_two_lines())
    np.testing.assert_allclose(moved["bodies/ball/position"], rest["bodies/ball/position"][[-1] * 5], atol=1e-8)
    tables = on_two_lines()
    del tables["bodies"], tables["time"]
    at = rest["bodies/ball/position"][-1].tolist()
    stiffness = float(_rows(on_two_lines())[0, STIFFNESS])
    tables["obstacles"] = {"ball": {"kind": "sphere", "at": at, "radius": RADIUS, "stiffness": stiffness}}
    held = hybrid.static(tables)
    for side in ("left", "right"):
        np.testing.assert_allclose(held.lines[side].position, rest.lines[side].position, atol=1e-9)


def _rows(tables: Tables) -> Any:
    return build_network(system_of(tables)).models[0].sea.values.obstacles


@pytest.mark.long
def test_stiffness_of_a_ball_on_two_lines_is_that_of_equilibria_under_forces() -> None:
    """Across the lines and upwards; about its middle nothing holds it."""
    found = hybrid.stiffness(on_two_lines(), "body:ball")
    size = np.abs(found.matrix[1:3, 1:3]).max()
    for axis, force in ((1, 0.5), (2, 1.0)):
        ways = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        ways[0][axis], ways[1][axis] = force, -force
        there, back = (hybrid.static(on_two_lines(force=x))["bodies/ball/position"][-1] for x in ways)
        assert found.matrix[axis, axis] == pytest.approx(2.0 * force / (there - back)[axis], rel=2e-4)
    np.testing.assert_allclose(found.matrix[3:], 0.0, atol=1e-6 * size)
    np.testing.assert_allclose(found.lines, found.matrix, atol=1e-9 * size)


def tied_down(knot: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Tables:
    """The ball on two lines, with a stay from its lowest place over a free point to the ground."""
    tables = on_two_lines()
    tables["points"] |= {
        "low": {"body": "ball", "place": [0, 0, -0.3]}, "ground": {"position": [5.3, 0.05, -3.0]},
        "knot": {"kind": "free", "initial_guess": [5.1, 0.02, -1.3], "mass": 0.5, "force": list(knot)},
    }  # fmt: skip
    section = {"length": 1.6, "mass": 0.05, "diameter": 2 * STRAND, "axial_stiffness": 1e5}
    stay = {"sections": [section], "contact": {"self": False}, "mesh": {"cells": 8}}
    tables["lines"] |= {
        "upper": {"start": "low", "end": "knot"} | stay,
        "lower": {"start": "knot", "end": "ground"} | stay,
    }
    return tables


@pytest.mark.long
def test_stiffness_and_offsets_of_points_beside_a_body_that_lines_touch() -> None:
    """The ball gives way with its lines: of a free point by forces on it, of one that is held by shifts."""
    found, force = hybrid.stiffness(tied_down(), "point:knot").matrix, np.array([0.03, 0.01, 0.05])
    there, back = (hybrid.static(tied_down(tuple(x))).lines["upper"].position[-1][-1] for x in (force, -force))
    np.testing.assert_allclose(found @ (there - back) / 2.0, force, rtol=1e-4)
    held = hybrid.stiffness(tied_down(), "point:ground").matrix
    shifted = hybrid.offsets(tied_down(), "point:ground", [-1e-4, 1e-4]).force
    np.testing.assert_allclose((shifted[0] - shifted[1]) / 2e-4, held[:, 0], rtol=5e-5)


@pytest.mark.long
@pytest.mark.parametrize("heading", [0.0, 90.0])
@pytest.mark.parametrize("tables", [on_two_lines(), tied_down()], ids=["alone", "tied"])
def test_a_body_that_is_held_bears_what_lines_that_touch_it_do(tables: Tables, heading: float) -> None:
    """Where it rests its weight, with no moment; beside that the stiffness, of equilibria under forces on a free body;

    and a free body under the opposite of the force far away rests there, where the lines' contact is of second order.
    """
    K, k = hybrid.stiffness(tables, "body:ball").matrix, int(heading == 90.0)
    held = hybrid.offsets(tables, "body:ball", [0.0, -1e-4, 1e-4, 0.05], heading=heading)
    assert held.moment is not None
    np.testing.assert_allclose(held.force[0], [0, 0, MASS * 9.81], atol=1e-6)
    np.testing.assert_allclose(held.moment[0], 0.0, atol=1e-8)
    for found, there in ((K[:3, k], held.force), (K[3:, k], held.moment)):
        np.testing.assert_allclose((there[1] - there[2]) / 2e-4, found, rtol=1e-3, atol=1e-4 * np.abs(K[:, k]).max())
    assert held.restoring == pytest.approx(-held.force[:, k], abs=1e-9)
    if k == 0:  # along the lines it would roll away
        return
    rest = hybrid.static(tables)["bodies/ball/position"][-1]
    there = rest + 0.05 * np.eye(3)[k]
    under = -held.force[3] - [0, 0, -MASS * 9.81]
    body = tables["bodies"]["ball"] | {"force": under.tolist(), "moment": (-held.moment[3]).tolist()}
    body |= {"initial_guess": there.tolist()}
    moved = hybrid.static(tables | {"bodies": {"ball": body}})
    np.testing.assert_allclose(moved["bodies/ball/position"][-1], there, atol=2e-7)
    assert {x: float(held.tension[x][3]) for x in held.tension} == pytest.approx(
        {x: float(line["max_tension"].max()) if "max_tension" in line.names else float(line.tension.max())
         for x, line in moved.lines.items()}, rel=2e-3
    )  # fmt: skip


# --- in motion --------------------------------------------------------------------------------------


def pushed(**shape: Any) -> Tables:
    """The ball falls askew on the lines, spins, and drags them along by friction."""
    tables = on_two_lines(initial_guess=[4.2, 0.02, 0.7], initial_rotation=[20, 10, 30], moment=[5.0, 40.0, 3.0])
    tables["bodies"]["ball"]["shape"] |= {"friction": 0.4} | shape
    for side, y in (("left", APART), ("right", -APART)):
        tables["lines"][side]["initial"] = {"kind": "straight", "direction": [1, 0, 0]}
        tables["lines"][side]["sections"] = [tables["lines"][side]["sections"][0] | {"length": 10.0}]
        tables["points"][f"0{side}"]["position"][1] = y
    return tables | {"time": {"duration": 0.5, "step": 0.005}, "output": {"every": 0.05, "points": 21}}


def pushed_box() -> Tables:
    """A box in place of the ball."""
    tables = pushed()
    box = {"kind": "box", "size": [0.9, 1.3, 0.8], "rounding": 0.15, "rotation": [10, 20, 5], "friction": 0.4}
    tables["bodies"]["ball"] |= {"shape": box, "initial_guess": [4.2, 0.02, 0.9]}
    return tables


@cache
def fell(make: Callable[[], Tables] = pushed) -> Any:
    return hybrid.run(make())


both_shapes = pytest.mark.parametrize(
    "make", [pushed, pytest.param(pushed_box, marks=pytest.mark.long)], ids=["ball", "box"]
)


@both_shapes
def test_work_of_lines_on_a_body_is_that_of_the_body_on_the_lines(make: Callable[[], Tables]) -> None:
    """Booked on both sides, by power here and by way there; the energy of the body is what is done on it."""
    fallen = fell(make)
    done = fallen["bodies/ball/work/lines"]
    by_lines = sum(x["work/obstacles"] for x in fallen.lines.values())
    assert np.abs(done).max() > 1.0
    np.testing.assert_allclose(done, -by_lines, atol=0.02 * np.abs(done).max())
    total = sum(fallen[f"bodies/ball/energy/{x}"] for x in ("kinetic", "potential"))
    given = sum(fallen[f"bodies/ball/work/{x}"] for x in ("lines", "loads"))
    np.testing.assert_allclose(total - total[0], given, atol=0.01 * np.abs(done).max())
    force = sum(x["obstacles/ball/force"] for x in fallen.lines.values())
    touches = np.linalg.norm(force, axis=1) > 0.0
    assert touches.any() and not touches.all()
    np.testing.assert_allclose(force, fallen["bodies/ball/force"], atol=1e-3 * np.abs(force).max())
    assert not any(x.kind in ("deep in an obstacle", "gains energy") for x in fallen.events)
    assert np.abs(fallen["bodies/ball/rotation"] - fallen["bodies/ball/rotation"][0]).max() > 1.0


def turns_with_its_scene(tables: Tables, fallen: Any, atol: float) -> None:
    """What a scene that is turned about the vertical has is turned; fallen: as it stands."""
    angle = np.radians(40.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    tables = seen_by(turn, tables)
    ball = tables["bodies"]["ball"]
    ball["moment"] = (turn @ ball["moment"]).tolist()
    ball["initial_rotation"][2] += 40.0
    result = hybrid.run(tables)
    np.testing.assert_allclose(result["bodies/ball/position"], fallen["bodies/ball/position"] @ turn.T, atol=atol)
    for side, x in fallen.lines.items():
        np.testing.assert_allclose(result.lines[side].position, x.position @ turn.T, atol=atol)


@both_shapes
def test_a_turned_scene_moves_the_same(make: Callable[[], Tables]) -> None:
    turns_with_its_scene(make(), fell(make), 1e-9)


def test_where_the_origin_of_a_body_is_changes_nothing() -> None:
    """Origin elsewhere in the body, its middle and its mass where they were: to what steps make of the way of another

    point, a hundred-thousandth of the way.
    """
    tables, fallen, place = pushed(), fell(), (0.1, -0.2, 0.15)
    ball = tables["bodies"]["ball"]
    ball["shape"]["place"] = ball["centre"] = list(place)
    ball["initial_guess"] = np.subtract(ball["initial_guess"], turned((20, 10, 30), place)).tolist()
    result = hybrid.run(tables)
    for side, x in fallen.lines.items():
        a, b = result.lines[side], x
        np.testing.assert_allclose(a.position, b.position, atol=5e-5)
        np.testing.assert_allclose(a["obstacles/ball/position"], fallen["bodies/ball/position"], atol=5e-5)
        most = np.abs(b["obstacles/ball/moment"]).max()
        assert most > 0.5
        np.testing.assert_allclose(a["obstacles/ball/moment"], b["obstacles/ball/moment"], atol=0.02 * most)


@pytest.mark.parametrize("kind", ["sphere", "cylinder", "box"])
def test_a_very_heavy_body_is_an_obstacle(kind: str) -> None:
    """Of a cylinder across the lines, too, whose axis its body turns there, and of a box that is turned in its body."""
    tables = pushed(stiffness=1e5)
    tables["environment"] = {"gravity": 0}
    heavy = {"initial_guess": [4.2, 0.02, 0.62], "mass": 1e12, "inertia": [1e12, 1e12, 1e12],
             "shape": tables["bodies"]["ball"]["shape"]}  # fmt: skip
    obstacle = heavy["shape"] | {"at": heavy["initial_guess"]}
    if kind == "cylinder":
        heavy["shape"] |= {"kind": "cylinder", "axis": [2, 0, 0], "length": 3.0, "place": [0.5, 0, 0]}
        heavy |= {"initial_rotation": [0, 0, 80], "initial_guess": [4.2 - 0.5 * np.cos(np.radians(80)), -0.48, 0.62]}
        axis = [np.cos(np.radians(80)), np.sin(np.radians(80)), 0]
        obstacle |= {"kind": "cylinder", "axis": axis, "length": 3.0,
                     "at": [4.2, -0.48 + 0.5 * np.sin(np.radians(80)), 0.62]}  # fmt: skip
    if (
        kind == "box"
    ):  # turned by 10 deg about its length, by 50 deg with its body and by 30 deg more about the vertical
        size = {"kind": "box", "size": [3.0, 1.2, 1.2], "rounding": 0.4, "friction": 0.4, "stiffness": 1e5}
        heavy["shape"] = size | {"rotation": [10, 0, 30], "place": [0.5, 0, 0]}
        heavy |= {"initial_rotation": [0, 0, 50], "initial_guess": [4.2 - 0.5 * np.cos(np.radians(50)), -0.38, 0.65]}
        obstacle = size | {"rotation": [10, 0, 80], "at": [4.2, -0.38 + 0.5 * np.sin(np.radians(50)), 0.65]}
    tables["bodies"] = {"ball": heavy}
    for side in ("left", "right"):
        for end in (0, 10):
            up = {"travel": {"by": [0, 0, 0.05], "over": 0.3}}
            tables["points"][f"{end}{side}"]["motion"] = up
    other = deepcopy(tables)
    del other["bodies"]
    other["obstacles"] = {"ball": obstacle}
    by_body, by_obstacle = hybrid.run(tables), hybrid.run(other)
    lifted = by_obstacle.lines["left"].position[-1][:, 2]
    assert lifted.min() < 0.045 < lifted.max()  # it is held back
    for side in ("left", "right"):
        a, b = by_body.lines[side], by_obstacle.lines[side]
        np.testing.assert_allclose(a.position, b.position, atol=1e-6)
        left = 3e-3 if kind == "box" else 1e-3  # N: Newton's method leaves more where curvature jumps at edges
        np.testing.assert_allclose(a.tension, b.tension, rtol=1e-6, atol=left)


@pytest.mark.parametrize(
    ("shape", "where", "says"),
    [
        ({"kind": "box", "radius": 0.5, "size": [1, 1, 1], "rounding": 0.1}, "radius", "nothing, because the kind is box"),
        ({"kind": "box", "size": [1, 1, 1]}, "rounding", "the rounding of the box"),
        ({"kind": "box", "size": [1, 1, 1], "rounding": 0.6}, "rounding", "at most half of the smallest"),
        ({"kind": "sphere"}, "radius", "the radius of the sphere"),
        ({"kind": "sphere", "radius": 0.5, "rotation": [0, 0, 9]}, "rotation", "nothing, because the kind is sphere"),
        ({"kind": "sphere", "radius": 0.5, "axis": [0, 0, 1]}, "axis", "nothing, because the kind is sphere"),
    ],
)  # fmt: skip
def test_shapes_have_what_their_kind_has(shape: Tables, where: str, says: str) -> None:
    with pytest.raises(SceneError, match=says) as refused:
        hybrid.static(on_two_lines(shape=shape))
    assert [x.where for x in refused.value.complaints] == [f"bodies.ball.shape.{where}"]


def test_lines_that_end_at_another_body_run_either_way_and_as_catenaries() -> None:
    """Both ends of a line may be unknown where it touches: its start at what moves, or its end."""

    def between_bodies(reversed_: bool, model: str) -> Any:
        tables = pushed()
        for name, y in (("left", APART), ("right", -APART)):
            line, section = tables["lines"][name], tables["lines"][name]["sections"][0]
            tables["points"][f"10{name}"] = {"body": "bar", "place": [0, y, 0]}
            if reversed_:
                line["start"], line["end"], line["initial"]["direction"] = line["end"], line["start"], [-1, 0, 0]
            bends = {"bending_stiffness": section["bending_stiffness"]} if model == "rod" else {}
            line["sections"] = [{k: x for k, x in section.items() if k != "bending_stiffness"} | bends]
            line["model"] = model
        pull = [2000.0, 0, 500.0 * 9.81]
        tables["bodies"]["bar"] = {"initial_guess": [10, 0, 0], "mass": 500, "inertia": [99, 99, 99], "force": pull}
        return hybrid.run(tables | {"time": {"duration": 0.35, "step": 0.005}})

    result = between_bodies(False, "rod")
    assert np.abs(result["bodies/ball/force"]).max() > 100.0
    back, soft = between_bodies(True, "rod"), between_bodies(False, "catenary")
    for body in ("ball", "bar"):
        place = result[f"bodies/{body}/position"]
        np.testing.assert_allclose(back[f"bodies/{body}/position"], place, atol=1e-9)
        np.testing.assert_allclose(soft[f"bodies/{body}/position"], place, atol=1e-5)
    np.testing.assert_allclose(back.lines["left"].position[:, ::-1], result.lines["left"].position, atol=1e-9)


def test_a_line_ignores_the_body_that_it_is_fixed_to_until_it_has_left_it() -> None:
    """A buoy on its mooring, fixed to its bottom or to its middle: as without a shape; laid over the buoy it is not."""
    section = {"length": 12.0, "mass": 1.0, "diameter": 0.04, "axial_stiffness": 1e6, "bending_stiffness": 1.0}
    for place in ([0, 0, -0.5], [0, 0, 0]):
        tables: Tables = network_scene(
            {"anchor": {"position": [0, 0, -12]}, "eye": {"body": "buoy", "place": place}},
            {"leg": line_between("anchor", "eye", section, model="rod", contact={"self": False}, mesh=60)},
            fluid={"density": 1025},
            bodies={"buoy": {"initial_guess": [0.2, 0, 0.5], "mass": 300.0, "inertia": [40.0, 40.0, 40.0],
                             "volume": 0.5, "centre_of_buoyancy": [0, 0, 0.1]}}
        )  # fmt: skip
        bare = hybrid.static(tables)
        tables["bodies"]["buoy"]["shape"] = {"kind": "sphere", "radius": 0.5, "friction": 0.2}
        shaped = hybrid.static(tables)
        np.testing.assert_allclose(shaped.lines["leg"].position, bare.lines["leg"].position, atol=1e-9)
        assert not shaped.lines["leg"]["obstacles/buoy/force"].any()


# --- Newton's method --------------------------------------------------------------------------------


def test_newtons_method_converges_quadratically() -> None:
    """A step of a spinning ball pressed on lines, with friction: what is left falls by squares once contact is found."""
    model = build_network(system_of(pushed()))
    solver = NetworkSolver(joined_lines(model, 0.0), 0, model.body_numbers(0.0))
    start = NetworkState([x.start for x in model.models], model.body_places).copy()
    start.bodies[0, PLACE + 2] = 0.574  # 2 mm deep
    start.bodies[0, W : W + 3] = (1.0, -3.0, 2.0)
    left = []
    for most in (4, 5, 6):
        for x in solver.lines:
            x.sea.now[0] = 0.002
        left.append(solver.step(start, start.copy(), 0.002, 0.9, 0.0, 0.9, 0.002, most=most).residual)
    print(f"\nforces out of balance, N: {', '.join(f'{x:.2g}' for x in left)}")
    assert left[0] < 10.0 and left[1] < 0.02 * left[0] and left[2] < 1e-3 * left[1]


# --- what is refused --------------------------------------------------------------------------------


def test_a_shape_has_the_name_of_no_obstacle() -> None:
    tables = on_two_lines()
    tables["obstacles"] = {"ball": {"kind": "sphere", "at": [0, 0, 9], "radius": 1}}
    with pytest.raises(SceneError, match="no obstacle has"):
        hybrid.static(tables)


@pytest.mark.long
def test_bodies_that_are_in_each_other_or_in_what_is_around_are_told(tmp_path: Path) -> None:
    def body(x: float, z: float, shape: dict[str, Any]) -> dict[str, Any]:
        return {"initial_guess": [x, 5.0, z], "mass": 2, "inertia": [0.1] * 3, "shape": shape}

    ball, bar = {"kind": "sphere", "radius": 0.3}, {"kind": "cylinder", "axis": [1, 0, 0], "length": 1.0, "radius": 0.1}
    crate = {"kind": "box", "size": [0.4, 0.4, 0.4], "rounding": 0.05}
    section = {"length": 2.0, "mass": 0.2, "diameter": 0.02, "axial_stiffness": 1e4, "bending_stiffness": 0.02}
    scene = network_scene(
        {"a": {"position": [0, 0, 2]}, "b": {"position": [2, 0, 2]}},
        {"l": line_between("a", "b", section, model="rod", mesh=20,
                           initial={"kind": "straight", "direction": [1, 0, 0]})},
        seabed={"z": -1.0, "stiffness": 1e4},
        obstacles={"pile": {"kind": "cylinder", "at": [9, 5, 0], "axis": [0, 0, 1], "radius": 0.2}},
        bodies={"one": body(0.0, 0.0, ball), "two": body(0.5, 0.0, ball), "apart": body(2.0, 0.0, ball),
                "bar": body(8.5, 0.0, bar), "low": body(4.0, -0.85, crate), "high": body(6.0, -0.5, crate)},
        time=(0.02, 0.01)
    )  # fmt: skip
    expected = {
        "body one is 0.1 m deep in body two", "body low is 0.05 m deep in the seabed",
        "body bar is 0.3 m deep in obstacle pile",
    }  # fmt: skip
    first, whole = tmp_path / "first.h5", tmp_path / "whole.h5"
    hybrid.run(scene | {"time": {"duration": 0.01, "step": 0.01}}, first).close()
    for result in (hybrid.run(scene, whole), hybrid.resume(first, until=0.02)):  # which says it no second time
        told = [x.text.partition(":")[0] for x in result.events if x.kind == "bodies overlap"]
        assert sorted(told) == sorted(expected)
