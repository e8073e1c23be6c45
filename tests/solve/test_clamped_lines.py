"""Lines that are clamped to points and bodies: a cut rod is the same rod, closed forms, moments on bodies, momentum."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from problems import at_rest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.step.line_step import TOLERANCE
from hybrid.model.bodies import frame_of
from hybrid.model.build import build
from hybrid.model.network import build_network
from hybrid.scene.read import one_line
from hybrid.scene.root import in_full
from hybrid.simulation.run import Run, new_run
from tests.scenes import cable_scene, clamped_at, line_between, network_scene

LENGTH, CELLS, A, B = 100.0, 40, [0.0, 0.0, 0.0], [70.0, 10.0, -20.0]
SECTION = {
    "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 200.0, "torsional_stiffness": 150.0,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1},
}  # fmt: skip
WATER = {"fluid": {"density": 1025, "current": [0.3, 0.2, 0]}}
START = {"tangent": [1, 0, 0], "normal": [0, 0, 1]}
TWISTED, UNTWISTED = [0.0, 1.0, 0.0], None  # normal at the end: with it a torque passes


def end_of(normal: list[float] | None) -> dict[str, Any]:
    return {"tangent": [1, 0.3, 0.2]} | ({"normal": normal} if normal else {"swivel": True})


def in_one_piece(normal: list[float] | None, motion: dict[str, Any] | None = None) -> dict[str, Any]:
    end = {"kind": "clamped", "position": B, **end_of(normal)} | ({"motion": motion} if motion else {})
    return cable_scene(
        SECTION | {"length": LENGTH}, {"kind": "clamped", "position": A, **START}, end, environment=WATER, model="rod",
        mesh=CELLS, output={"points": CELLS + 1}
    )  # fmt: skip


def in_pieces(
    cuts: Sequence[int], flips: Sequence[int], normal: list[float] | None, motion: dict[str, Any] | None = None
) -> dict[str, Any]:
    """The same line cut at nodes and joined by free points; flips: pieces that run the other way."""
    points: dict[str, Any] = {"a": {"position": A}, "b": {"position": B} | ({"motion": motion} if motion else {})}
    for c in cuts:
        guess = np.array(A) + (np.array(B) - A) * c / CELLS + [0, 0, -15]
        points[f"cut{c}"] = {"initial_guess": guess.tolist()}
    edges, names, lines = [0, *cuts, CELLS], ["a", *(f"cut{c}" for c in cuts), "b"], {}
    for i, flipped in enumerate(flips):
        ends: list[Any] = [START if i == 0 else "clamped", end_of(normal) if i == len(cuts) else "clamped"]
        at = names[i : i + 2]
        if flipped:
            at = at[::-1]
            ends = [x if x == "clamped" else x | {"tangent": [-c for c in x["tangent"]]} for x in ends[::-1]]
        cells = edges[i + 1] - edges[i]
        lines[f"line{i}"] = {
            "start": at[0], "end": at[1], "connections": {"start": ends[0], "end": ends[1]}, "model": "rod",
            "sections": [SECTION | {"length": LENGTH * cells / CELLS}], "mesh": {"cells": cells},
        }  # fmt: skip
    return {"environment": WATER, "points": points, "lines": lines, "output": {"points": 2}}


def equilibrium(tables: dict[str, Any]) -> Run:
    return new_run(hybrid.Scene.model_validate(tables), io.BytesIO(), "", moves=False)


def test_offsets_of_a_point_to_which_lines_are_clamped() -> None:
    """At its place nothing holds it, neither force nor moment; beside it the lines pull back, with the directions kept."""
    curve = hybrid.offsets(in_pieces([16], (0, 1), TWISTED), "point:cut16", [0.0, 0.5], heading=30.0)
    tension = max(float(x.max()) for x in curve.tension.values())
    assert curve.moment is not None and np.abs(curve.moment[0]).max() < 1e-6 * tension
    assert np.abs(curve.force[0]).max() < 1e-6 * tension < curve.restoring[1]
    assert np.abs(curve.moment[1]).max() > 1e-3


@pytest.mark.parametrize("normal", [TWISTED, UNTWISTED])
@pytest.mark.parametrize(("cuts", "flips"), [([16], (0, 0)), ([16], (1, 1)), ([8, 16, 30], (0, 1, 1, 0))])
def test_a_rod_cut_at_any_node_is_the_same_rod(cuts: list[int], flips: tuple[int, ...], normal: Any) -> None:
    """Points are first looked for 15 m and more beside their places; the axes of points are found as well."""
    model = build(one_line(hybrid.validate_scene(in_one_piece(normal))))
    whole = at_rest(model, np.inf).state.lines[0]
    found = equilibrium(in_pieces(cuts, flips, normal)).found
    assert found is not None and found.iterations <= 20 and len(found.path) == 1
    edges = [0, *cuts]
    for name, scale in (("r", LENGTH), ("T", np.abs(whole.T).max())):
        for i, state in enumerate(found.state.lines):
            mine, theirs = getattr(state, name), getattr(whole, name)[edges[i] :]
            apart = np.abs((mine[::-1] if flips[i] else mine) - theirs[: len(mine)]).max()
            # two elements of half a cell in series are one but for the square of bend times twist
            assert apart < (1e-9 if normal else 2e-11) * scale


@pytest.mark.parametrize("flips", [(0, 0), (1, 0)])
def test_a_cut_rod_moves_as_the_rod(flips: tuple[int, ...]) -> None:
    motion = {"sway": {"amplitude": 2.0, "period": 2.0}, "roll": {"amplitude": 40, "period": 2.0},
              "pitch": {"amplitude": 25, "period": 2.5}, "ramp": 2.0}  # fmt: skip
    time = {"time": {"duration": 4.0, "step": 0.05, "rho_inf": 0.8}}
    whole = hybrid.run(in_one_piece(TWISTED, motion) | time)
    pieces = hybrid.run(in_pieces([16], flips, TWISTED, motion) | time)
    joint = whole["position"][:, 16]
    assert np.abs(joint - joint[0]).max() > 0.3
    assert np.abs(pieces["points/cut16/position"] - joint).max() < 10 * TOLERANCE * LENGTH
    alone = hybrid.run(in_pieces([], (0,), TWISTED, motion) | time)
    for name in ("a/force", "a/moment", "b/force", "b/moment"):
        apart = np.abs(pieces[f"points/{name}"] - alone[f"points/{name}"]).max()
        assert apart < 1e-4 * np.abs(alone[f"points/{name}"]).max()
    steps = [np.mean(x["steps/iterations"]) for x in (whole, pieces.lines["line0"])]
    assert steps[1] < steps[0] + 0.2


# --- bodies ----------------------------------------------------------------------------------------------

STRIP = {"length": 10.0, "mass": 3.0, "diameter": 0.05, "bending_stiffness": 400.0, "axial_stiffness": 1e6}
MOTION = {"heave": {"amplitude": 0.3, "period": 2.0}, "pitch": {"amplitude": 20, "period": 3.0},
          "yaw": {"amplitude": 10, "period": 3.0}, "ramp": 3.0}  # fmt: skip


def test_a_cantilever_on_a_body_is_the_clamped_line() -> None:
    """Held, and moved and turned; the moment on the body is about its origin."""
    line = line_between("root", "tip", STRIP, connections={"start": {"tangent": [0, 1, 0]}}, mesh=20)
    tables: dict[str, Any] = {
        "points": {"tip": {"initial_guess": [9, 0, -3], "mass": 2.0}, "root": {"body": "body", "place": [0, 0, 0]}},
        "lines": {"line": line},
        # turned by -90 deg of yaw at rest, so that its own axis is another
        "bodies": {"body": {"position": [0, 0, 0], "rotation": [0, 0, -90]}},
    }
    clamp: dict[str, Any] = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]}
    one = cable_scene(STRIP, clamp, {"kind": "body", "mass": 2.0}, model="rod", mesh=20)
    alone, joined = hybrid.static(one), hybrid.static(tables)
    assert np.abs(joined.lines["line"]["position"] - alone["position"]).max() < 1e-9 * STRIP["length"]
    moment = joined["points/root/moment"][-1]
    assert np.abs(moment + alone["moment_start"][-1]).max() < 1e-9 * np.abs(moment).max()
    tables["points"]["root"]["place"] = [0, 2, 0]
    tables["bodies"]["body"]["position"] = [-2, 0, 0]
    moved = hybrid.static(tables)
    about = np.cross([2, 0, 0], moved["points/root/force"][-1]) + moment
    assert np.abs(moved["bodies/body/moment"][-1] - about).max() < 1e-8 * np.abs(about).max()
    tables["points"]["root"]["place"], tables["bodies"]["body"]["position"] = [0, 0, 0], [0, 0, 0]
    tables["bodies"]["body"]["motion"] = clamp["motion"] = MOTION
    time = {"time": {"duration": 2.0, "step": 0.02}, "output": {"every": 0.1}}
    alone, joined = hybrid.run(one | time), hybrid.run(tables | time)
    assert np.abs(alone["position"] - alone["position"][0]).max() > 0.15
    assert np.abs(joined.lines["line"]["position"] - alone["position"]).max() < 1e-7 * STRIP["length"]


WEIGHT, ARM, EI, SPAN = 30.0 * 9.81, 0.4, 400.0, 2.0


def hung(flipped: bool = False, **more: Any) -> dict[str, Any]:
    """A heavy body that hangs from a light rod which is clamped at both ends, with its centre beside it."""
    section = {"length": SPAN, "mass": 1e-3, "diameter": 0.008, "bending_stiffness": EI, "axial_stiffness": 1e7}
    section |= {"torsional_stiffness": 300.0} | more
    ends, along = ("lug", "top") if flipped else ("top", "lug"), [0, 0, 1 if flipped else -1]
    line = {
        "start": ends[0], "end": ends[1], "connections": {"start": {"tangent": along}, "end": {"tangent": along}},
        "sections": [section], "mesh": {"cells": 40}, "model": "rod",
    }  # fmt: skip
    body = {"initial_guess": [0, 0, -SPAN], "mass": 30.0, "centre": [ARM, 0, 0], "inertia": [20, 30, 25]}
    points = {"top": {"position": [0, 0, 0]}, "lug": {"body": "body", "place": [0, 0, 0]}}
    return {"points": points, "bodies": {"body": body}, "lines": {"line": line}}


def elastica() -> tuple[float, float, float]:
    """Shift and drop of the body and its pitch (rad) of an inextensible rod without weight: EI phi'' = W sin phi."""

    def path(bend: float) -> np.ndarray:
        def slope(_: float, y: np.ndarray) -> list[float]:
            return [y[1], WEIGHT * np.sin(y[0]) / EI, -np.sin(y[0]), -np.cos(y[0])]

        return np.asarray(solve_ivp(slope, (0, SPAN), [0, bend, 0, 0], rtol=1e-11, atol=1e-13).y[:, -1])

    def left(bend: float) -> float:
        y = path(bend)
        return float(EI * y[1] - WEIGHT * ARM * np.cos(y[0]))

    y = path(brentq(left, 0.0, 1.0, xtol=1e-14))
    return float(y[2]), float(y[3]), float(y[0])


@pytest.mark.parametrize("flipped", [False, True])
def test_a_body_on_a_clamped_rod_hangs_as_the_elastica(flipped: bool) -> None:
    x, z, pitch = elastica()
    errors = []
    for cells in (20, 40):
        tables = hung(flipped)
        tables["lines"]["line"]["mesh"]["cells"] = cells
        result = hybrid.static(tables)
        place, turned = result["bodies/body/position"][-1], result["bodies/body/rotation"][-1]
        errors.append([place[0] - x, place[2] - z, np.radians(turned[1]) - pitch])
        moment = result["points/lug/moment"][-1]
        assert abs(moment[1] + WEIGHT * ARM * np.cos(np.radians(turned[1]))) < 1e-6  # the body's own weight
        bend = result.lines["line"]["bending_moment"][-1][0 if flipped else -1]
        assert abs(bend - abs(moment[1])) < 1e-6
    assert np.abs(errors[1]).max() < 2e-4 * SPAN
    ratio = np.array(errors[0][:1] + errors[0][2:]) / (errors[1][:1] + errors[1][2:])
    assert (ratio > 3.5).all() and (ratio < 4.5).all()


def test_what_is_turned_altogether_stays_the_same() -> None:
    """Without weight, a force and a moment on the body: turned with all else, everything turns with them."""

    def found(turn: list[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        R, tables = frame_of((turn[0], turn[1], turn[2])), hung()
        tables["environment"] = {"gravity": 0.0}
        body, ends = tables["bodies"]["body"], tables["lines"]["line"]["connections"]
        body |= {"initial_guess": (R @ [0, 0, -SPAN]).tolist(), "initial_rotation": turn}
        body |= {"force": (R @ [30, 20, -90]).tolist(), "moment": (R @ [20, -30, 50]).tolist()}
        ends["start"] = {"tangent": (R @ [0, 0, -1]).tolist(), "normal": (R @ [1, 0, 0]).tolist()}
        ends["end"] = {"tangent": [0, 0, -1], "normal": [1, 0, 0]}
        result = hybrid.static(tables)
        moment = result["points/top/moment"][-1]
        return result["bodies/body/position"][-1] @ R, moment @ R, result.lines["line"]["torque"][-1]

    for mine, theirs in zip(found([0, 0, 0]), found([40, -25, 70]), strict=True):
        assert np.abs(mine).max() > 0.1
        assert np.abs(mine - theirs).max() < 1e-7 * np.abs(mine).max()


def momenta(step: float, flipped: bool, tau: float = 0.0) -> tuple[float, float, float, float]:
    """Errors of the balances of energy of body and line and of the angular momentum of both, and iterations a step."""
    tables = hung(flipped, mass=0.05, damping={"stiffness": tau})
    tables["environment"] = {"gravity": 0.0}
    tables["lines"]["line"]["mesh"]["cells"] = 20
    tables["bodies"]["body"]["moment"] = {"value": [30, 20, 60], "until": 0.2}
    tables["bodies"]["body"]["force"] = {"value": [0, 0, -60]}
    tables |= {"time": {"duration": 1.2, "step": step, "rho_inf": 0.9}, "output": {"every": step, "points": 21}}
    result = hybrid.run(tables)
    line, t, of = result.lines["line"], result.times, "bodies/body"
    kinetic = result[f"{of}/energy/kinetic"]
    works = sum(result[f"{of}/work/{x}"] for x in ("lines", "damping", "loads"))
    energy = kinetic + result[f"{of}/energy/potential"] - works
    passed = line["work/start" if flipped else "work/end"] + result[f"{of}/work/lines"]
    r, v, w = (result[f"{of}/{x}"] for x in ("position", "velocity", "angular_velocity"))
    L = np.zeros((t.size, 3))
    for k, (place, speed, spin, turn) in enumerate(zip(r, v, w, result[f"{of}/rotation"], strict=True)):
        R = frame_of(tuple(turn))
        arm = R @ [ARM, 0, 0]
        L[k] = np.cross(place + arm, 30.0 * (speed + np.cross(spin, arm))) + R @ (np.array([20, 30, 25]) * (spin @ R))
    mass = np.full(21, 0.05 * SPAN / 20)
    mass[[0, -1]] *= 0.5
    L += np.einsum("n,tni->ti", mass, np.cross(line["position"], line["velocity"]))
    after = t >= 0.2 - 1e-9  # the moment that is given has stopped, the force goes on
    rate = np.cross(r, [0, 0, -60.0]) - result["points/top/moment"]
    given = np.cumsum(0.5 * (rate[after][1:] + rate[after][:-1]) * np.diff(t[after])[:, None], axis=0)
    momentum = np.abs(L[after][1:] - L[after][0] - given).max() / np.abs(L).max()
    most = kinetic.max()
    return (
        float(np.abs(energy - energy[0]).max() / most), float(np.abs(passed).max() / most), float(momentum),
        float(line["steps/iterations"].mean()),
    )  # fmt: skip


@pytest.mark.parametrize("flipped", [False, True])
def test_moments_on_a_body_keep_energy_and_angular_momentum_to_second_order(flipped: bool) -> None:
    coarse, fine = momenta(0.02, flipped), momenta(0.01, flipped)
    assert coarse[3] < 3.0 and max(fine[:3]) < 1e-3
    assert fine[1] < 1e-6  # what the line does to the body, the body does to the line
    for a, b in ((coarse[0], fine[0]), (coarse[2], fine[2])):
        assert 3.2 < a / b < 5.0


def test_damping_of_a_clamp_has_its_exact_derivative() -> None:
    """Newton's method takes no more iterations with damping, and the energy that it takes is booked."""
    energy, passed, momentum, iterations = momenta(0.01, True, tau=0.05)
    assert iterations <= momenta(0.01, True)[3] + 0.1
    assert energy < 1e-3 and passed < 1e-3 and momentum < 1e-3


def test_stiffness_of_a_body_on_a_clamped_rod_is_that_of_differences() -> None:
    tables = hung()
    tables["lines"]["line"]["connections"]["start"]["normal"] = [1, 0, 0]
    tables["lines"]["line"]["connections"]["end"]["normal"] = [1, 0, 0]
    C = np.linalg.inv(hybrid.stiffness(hybrid.Scene.model_validate(tables), "body:body").matrix)
    for k, (key, size) in enumerate((("force", 0.05),) * 3 + (("moment", 0.05),) * 3):
        rows = []
        for sign in (1, -1):
            load = [sign * size * (i == k % 3) for i in range(3)]
            moved = dict(tables, bodies={"body": tables["bodies"]["body"] | {key: load}})
            result = hybrid.static(moved)
            rows.append(np.append(result["bodies/body/position"][-1], result["bodies/body/rotation"][-1]))
        change = (rows[0] - rows[1])[:3] / (2 * size)
        assert np.abs(change - C[:3, k]).max() < 2e-5 * np.abs(C[:3, k]).max() + 1e-9


# --- angular springs, torque -------------------------------------------------------------------------------


def sprung(spring: float | None, swivel: bool = True, **more: Any) -> dict[str, Any]:
    held: dict[str, Any] = {"tangent": [1, 0, 0], "swivel": swivel}
    held |= {} if spring is None else {"bend_stiffness": spring}
    section = {"length": 5.0, "mass": 1.0, "diameter": 0.02, "bending_stiffness": 400.0, "axial_stiffness": 1e8}
    line = {"start": "root", "end": "tip", "connections": {"start": held}, "sections": [section], "mesh": {"cells": 20}}
    points = {"root": {"position": [0, 0, 0]}, "tip": {"initial_guess": [5, 0, 0]} | more}
    return {"environment": {"gravity": 0.0}, "points": points, "lines": {"line": line}}


@pytest.mark.parametrize("spring", [50.0, 3000.0])
def test_an_angular_spring_turns_by_its_moment(spring: float) -> None:
    """Of a cantilever under a small force: F L^2/k more at the tip; the line bends as the moment says."""
    force = 1e-3
    loose, rigid = (hybrid.static(sprung(x, force=[0, 0, -force])) for x in (spring, None))
    more = rigid["points/tip/position"][-1, 2] - loose["points/tip/position"][-1, 2]
    assert more == pytest.approx(force * 25.0 / spring, rel=1e-5)
    line = loose.lines["line"]
    assert line["bending_moment"][-1][0] == pytest.approx(5.0 * force, rel=1e-6)
    assert line["curvature"][-1][0] == pytest.approx(5.0 * force / 400.0, rel=1e-6)


def test_springs_go_from_a_pin_to_a_clamp() -> None:
    def between(connection: Any) -> Any:
        tables = sprung(None)
        tables["environment"] = {}
        tables["points"]["tip"] = {"position": [4.9, 0, 0.3]}
        tables["lines"]["line"]["connections"]["start"] = connection
        return hybrid.static(tables).lines["line"]["position"][-1]

    pinned, clamped = between("pinned"), between({"tangent": [1, 0, 0]})
    assert np.abs(pinned - clamped).max() > 1e-3
    assert np.abs(between({"tangent": [1, 0, 0], "bend_stiffness": 1e-7}) - pinned).max() < 5e-9
    assert np.abs(between({"tangent": [1, 0, 0], "bend_stiffness": 1e13}) - clamped).max() < 5e-9


@pytest.mark.parametrize(("joint", "passes"), [("hinge", True), ("swivel", False)])
def test_torque_passes_through_a_point_that_says_so(joint: str, passes: bool) -> None:
    """A taut line cut in its middle, its far end turned by a third of a turn: GJ times the twist, through a hinge too."""
    GJ, turn = 30.0, 2.0 * np.pi / 3.0
    section = {
        "mass": 1.0,
        "diameter": 0.02,
        "bending_stiffness": 40.0,
        "torsional_stiffness": GJ,
        "axial_stiffness": 1e6,
    }
    held = {"tangent": [1, 0, 0]} | ({"bend_stiffness": 0} if joint == "hinge" else {"swivel": True})
    far = {"tangent": [1, 0, 0], "normal": [0, -np.sin(turn), np.cos(turn)]}
    lines = {
        "one": {"start": "a", "end": "cut", "connections": {"start": {"tangent": [1, 0, 0], "normal": [0, 0, 1]},
                "end": {"tangent": [1, 0, 0]}}, "sections": [section | {"length": 4.0}], "mesh": {"cells": 16}},
        "two": {"start": "cut", "end": "b", "connections": {"start": held, "end": far},
                "sections": [section | {"length": 6.0}], "mesh": {"cells": 24}},
    }  # fmt: skip
    points = {"a": {"position": [0, 0, 0]}, "b": {"position": [10.02, 0, 0]}, "cut": {"initial_guess": [4, 0, 0]}}
    result = hybrid.static({"environment": {"gravity": 0.0}, "points": points, "lines": lines})
    torque = GJ * turn / 10.0 if passes else 0.0
    for name in ("one", "two"):
        assert np.abs(np.abs(result.lines[name]["torque"][-1]) - torque).max() < 1e-5
    points["cut"]["force"] = [0, 0, -40]
    result = hybrid.static({"environment": {"gravity": 0.0}, "points": points, "lines": lines})
    one, two = result.lines["one"], result.lines["two"]
    torques, moments = [[x[key][-1][k] for x, k in ((one, -1), (two, 0))] for key in ("torque", "bending_moment")]
    assert np.abs(np.abs(torques) - torque).max() < 1e-4
    before, after = (x["position"][-1][b] - x["position"][-1][a] for x, a, b in ((one, -2, -1), (two, 0, 1)))
    angle = np.arccos(before @ after / np.linalg.norm(before) / np.linalg.norm(after))
    if passes:  # as through a constant-velocity joint, along the bisector of both directions
        assert angle > 0.01 and moments == pytest.approx([torque * np.tan(angle / 2)] * 2, rel=0.05)


# --- points to which several lines are clamped ----------------------------------------------------------------


def test_three_rods_that_meet_rigidly_balance_their_moments() -> None:
    points: dict[str, Any] = {"knot": {"initial_guess": [1, 0, -8]}}
    lines = {}
    for k, name in enumerate("abc"):
        x, y = np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)
        points[name] = {"position": [15 * x, 15 * y, 0]}
        held = {"start": {"tangent": [x, y, 0.0]}}
        lines[name] = line_between("knot", name, SECTION | {"length": 20.0}, connections=held, mesh=20)
    tables = {"environment": {"fluid": {"density": 1025}}, "points": points, "lines": lines}
    result = hybrid.static(tables)
    moments = [result.lines[x]["moment_start"][-1] for x in "abc"]
    assert np.abs(moments[0]).max() > 1.0
    assert np.abs(sum(moments)).max() < 1e-6 * np.abs(moments[0]).max()
    place, turned = result["points/knot/position"][-1], result["points/knot/rotation"][-1]
    assert np.abs(place[:2]).max() < 1e-6 and np.abs(turned[:2]).max() < 1e-4  # symmetric
    point = hybrid.stiffness(hybrid.Scene.model_validate(tables), "point:knot").matrix
    tables["points"]["knot"]["force"] = [0.1, 0, 0]
    moved = hybrid.static(tables)["points/knot/position"][-1] - place
    assert moved[0] == pytest.approx(0.1 * np.linalg.inv(point)[0, 0], rel=1e-3)


def beam(moment: Any, **more: Any) -> dict[str, Any]:
    """A straight weightless rod of 2 m, clamped at both ends, in two pieces; the moment acts where they meet."""
    piece = {"mass": 1.0, "diameter": 0.03, "axial_stiffness": 1e7, "bending_stiffness": 200.0, "length": 1.0}
    ends = {"a": {"tangent": [1, 0, 0]}, "b": {"tangent": [1, 0, 0]}}
    line = {"model": "rod", "mesh": {"cells": 40}, "sections": [piece]}
    return network_scene(
        {"a": {"position": [0, 0, 0]}, "b": {"position": [2, 0, 0]},
         "middle": {"initial_guess": [1, 0, 0], "moment": moment}},
        {"one": line | {"start": "a", "end": "middle", "connections": {"start": ends["a"], "end": "clamped"}},
         "two": line | {"start": "middle", "end": "b", "connections": {"start": "clamped", "end": ends["b"]}}},
        gravity=0, output={"points": 2}
    ) | more  # fmt: skip


def test_a_moment_on_a_point_turns_it() -> None:
    """M L/(16 EI) in the middle of a clamped beam, whose ends bear -M/4 each; as a history, too."""
    still = hybrid.static(beam([0, 1.0, 0]))
    assert np.radians(still["points/middle/rotation"][-1][1]) == pytest.approx(1.0 * 2.0 / (16 * 200.0), rel=2e-3)
    for end in ("a", "b"):
        assert still[f"points/{end}/moment"][-1] == pytest.approx([0, -0.25, 0], abs=1e-3)
    history = {"history": [[0, 0, 0, 0], [2, 0, 1, 0], [4, 0, 1, 0]]}
    times = {"time": {"duration": 3.0, "step": 0.02}, "output": {"points": 2, "every": 0.5}}
    moved = hybrid.run(beam(history, **times))
    slow = np.radians(moved["points/middle/rotation"][:, 1]) * 16 * 200.0 / 2.0
    assert np.abs(slow - np.minimum(moved.times / 2.0, 1.0)).max() < 0.02  # it follows, and hardly swings
    stopped = hybrid.run(beam({"value": [0, 1.0, 0], "until": 0.5}, **times))["points/middle/rotation"][:, 1]
    assert abs(stopped[-3:]).max() < 1.1 * stopped[0] and stopped[0] > 0.03


def test_a_moment_needs_lines_that_are_clamped() -> None:
    tables = beam([0, 1.0, 0])
    for line in tables["lines"].values():
        line["connections"] = {key: x for key, x in line["connections"].items() if x != "clamped"}
    with pytest.raises(SceneError, match=r"points\.middle\.moment(.|\n)*turn freely(.|\n)*clamp two lines"):
        hybrid.static(tables)


def test_rods_that_may_all_spin_find_their_equilibrium_at_once() -> None:
    """Two rods through a point, pinned at their far ends: nothing holds them against spinning about themselves."""
    tables = in_pieces([16], (0, 0), UNTWISTED)
    tables["lines"]["line0"]["connections"]["start"] = "pinned"
    tables["lines"]["line1"]["connections"]["end"] = "pinned"
    found = equilibrium(tables).found
    assert found is not None and len(found.path) == 1 and found.iterations <= 12


# --- what is refused ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("where", "change", "expected"),
    [
        ("lines.line0.connections.start.tangent", lambda t: t["lines"]["line0"]["connections"].update(start="clamped"), "direction"),
        ("lines.line1.connections.start", lambda t: t["lines"]["line0"]["connections"].update(end="pinned"), "another line"),
        ("lines.line0.connections.end.tangent", lambda t: t["lines"]["line1"]["connections"].update(start={"tangent": [1, 0, 0]}), "axes of point"),
        ("lines.line0.connections.start.swivel", lambda t: t["lines"]["line0"]["connections"].update(
            start={"tangent": [1, 0, 0], "swivel": True, "bend_stiffness": 0}), "nothing is left"),
        ("lines.line0.connections.start.normal", lambda t: t["lines"]["line0"]["connections"].update(
            start={"tangent": [1, 0, 0], "normal": [2, 0, 0]}), "across"),
        ("lines.line0.connections.start.tangent", lambda t: t["lines"]["line0"]["connections"].update(
            start={"normal": [2, 0, 0]}), "direction"),
    ],
)  # fmt: skip
def test_connections_that_make_no_sense_are_refused(where: str, change: Any, expected: str) -> None:
    tables = in_pieces([16], (0, 0), UNTWISTED) | {"time": {"duration": 4.0, "step": 0.05}}
    change(tables)
    with pytest.raises(SceneError) as refused:
        hybrid.plan(tables)
    assert where in str(refused.value) and expected in str(refused.value)


def test_a_point_that_turns_must_turn_something() -> None:
    turning = {"pitch": {"amplitude": 5, "period": 4}, "ramp": 8}
    tables = in_pieces([16], (0, 0), UNTWISTED, turning) | {"time": {"duration": 4.0, "step": 0.05}}
    hybrid.plan(tables)
    tables["lines"]["line1"]["connections"]["end"] = "pinned"
    with pytest.raises(SceneError, match="lines turn freely at a point"):
        hybrid.plan(tables)


@pytest.mark.parametrize("points", [{}, {"points": [[0, 0, 0], [0, 3, 2], [5, 5, 3], [7, 0, 2]]}])
def test_between_held_points_the_first_shape_carries_the_frame(points: dict[str, Any]) -> None:
    """Clamps without a normal twist nothing along the first shape, as in the short form before it was a network."""
    scene = hybrid.validate_scene(
        cable_scene(
            {"length": 14, "mass": 1, "bending_stiffness": 20, "torsional_stiffness": 10},
            clamped_at([0, 0, 0], [0.3, 1, 0.5]),
            clamped_at([7, 0, 2], [0.5, 0.2, -1]),
            initial={"kind": "equilibrium"} | points,
            model="rod",
        )
    )
    alone, joined = build(one_line(scene)), build_network(in_full(scene)).models[0]
    assert np.allclose(joined.ends.values.frame, alone.ends.values.frame, rtol=0, atol=1e-12)


PIPE = {"length": 60, "mass": 10, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 2e4}
DOWN, FAR = clamped_at([0, 0, 0], [1, 0, -1]), clamped_at([40, 3, 5], [1, 0.3, 1])
ALIKE: dict[str, Any] = {"mesh": 20, "fluid": {"density": 1025}}
HELD: dict[str, Any] = {
    "body:B": network_scene(
        {"b": {"position": [60, 5, -40]}, "fb": {"body": "B", "place": [1, 0, -1]}},
        {"m": line_between("fb", "b", PIPE, mesh=20, connections={
            "start": {"tangent": [0.6, 0, -0.8]}, "end": {"tangent": [0.3, 0, -0.9]}})},
        bodies={"B": {"position": [30, 0, 0], "rotation": [3, 4, 5]}}, fluid={"density": 1025}),
    "point:end": cable_scene(PIPE, DOWN, FAR, **ALIKE),
    "point:end, turned": cable_scene(PIPE | {"torsional_stiffness": 1.5e4}, DOWN, FAR | {"turns": 0.3}, **ALIKE),
    "point:end, guided": cable_scene(
        PIPE, DOWN, {"kind": "guided", "tangent": [1, 0.3, 1], "force": [500, 200, 3000]}, **ALIKE),
}  # fmt: skip


@pytest.mark.parametrize("name", HELD)
def test_forces_at_offsets_change_as_the_stiffness_says(name: str) -> None:
    """Lines that both ends hold against twist were twisted anew at every offset: a fourth of a column."""
    at, step = name.split(",")[0], 1e-3
    stiffness = hybrid.stiffness(HELD[name], at).lines
    for k, heading in enumerate((0.0, 90.0)):
        found = hybrid.offsets(HELD[name], at, [-step, step], heading)
        both = found.force if found.moment is None else np.hstack([found.force, found.moment])
        expected = stiffness[:, k]
        assert (both[0] - both[1]) / (2 * step) == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


# --- at a point that a line carries: of those at a free point the first ----------------------------

LEFT_RIGHT = (("l", "a", 0.7), ("r", "b", -0.7))


def mirrored(mass: float, **more: Any) -> list[hybrid.Result]:
    """Two lines that mirror each other, clamped to a free point."""
    rod = {
        "mass": 3.0,
        "diameter": 0.05,
        "axial_stiffness": 1e6,
        "bending_stiffness": 300.0,
        "torsional_stiffness": 200.0,
    }
    given = {x: more.pop(x) for x in ("mesh",) if x in more}
    lines = {
        name: line_between(
            start, "m", rod | {"length": 30.0}, model="rod", connections={"end": {"tangent": [x, 0, -0.7]}}, **given
        )
        for name, start, x in LEFT_RIGHT
    }
    points: dict[str, Any] = {"a": {"position": [-27, 0, 0]}, "b": {"position": [27, 0, 0]}}
    points["m"] = {"initial_guess": [0, 0, -10]} | ({"mass": mass} if mass else {})
    return [*hybrid.static(network_scene(points, lines, **more)).lines.values()]


def test_tension_at_a_clamp_of_a_free_point_is_that_of_either_line() -> None:
    """The first had what its cells lead to, which changes within less than a cell: 817 for 758 N."""
    one, other = (x.tension[0, -1] for x in mirrored(50, mesh=50))
    assert one == pytest.approx(other, rel=1e-6)


@pytest.mark.parametrize("mass", [0, 50])
def test_cells_beside_a_clamp_at_a_free_point_are_those_of_either_line(mass: float) -> None:
    one, other = (x["mesh/s"] for x in mirrored(mass, accuracy="1%", fluid={"density": 1025}))
    assert one == pytest.approx(other)


def test_a_clump_of_a_milligram_at_a_guided_end_changes_no_tension() -> None:
    end = {"kind": "guided", "tangent": [1, 0, 0.2], "force": [300, 0, 600]}
    start, section = (
        {"kind": "pinned", "position": [0, 0, 0]},
        PIPE | {"length": 30, "mass": 3.0, "bending_stiffness": 300.0},
    )
    found = [
        hybrid.static(cable_scene(section, start, end, attachments=x, model="rod", mesh=50)).tension[0, -1]
        for x in (None, [{"kind": "clump", "at": 30, "mass": 1e-6}])
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_layers_at_a_clamp_of_a_free_point() -> None:
    """Layers that stick are a bending stiffness: the line that carries the point had none of them there."""

    def moment(**laws: Any) -> np.ndarray:
        rod = {"length": 5, "mass": 3, "diameter": 0.05, "axial_stiffness": 1e6, "torsional_stiffness": 200} | laws
        held: dict[str, Any] = {"l": {"start": {"tangent": [1, 0, 0]}, "end": "clamped"}}
        held["m"] = {"start": "clamped", "end": {"tangent": [1, 0, 0.3]}}
        lines = {
            x: line_between(*y, rod, model="rod", mesh=20, connections=held[x]) for x, y in (("l", "am"), ("m", "mb"))
        }
        points = {
            "a": {"position": [0, 0, 0]},
            "b": {"position": [9, 0, 0]},
            "m": {"kind": "free", "initial_guess": [4.5, 0, -2]},
        }
        found: np.ndarray = hybrid.static(network_scene(points, lines)).lines["l"].bending_moment[0]
        return found

    layers = moment(bending_stiffness=300, bending_slip=[{"stiffness": 500, "moment": 4000}])
    np.testing.assert_allclose(layers, moment(bending_stiffness=800), rtol=1e-9)
