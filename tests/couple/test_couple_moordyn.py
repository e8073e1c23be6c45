"""A script for the package `moordyn` runs on hybrid: the same calls, forces on what the caller moves, wrong uses."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import hybrid
from hybrid.couple import moordyn

DECK = Path(__file__).parents[1] / "data" / "moordyn" / "three_lines.txt"
PLACES = [40.0, 0.0, -14.0, -20.0, 34.64, -14.0, -20.0, -34.64, -14.0]
STILL = [0.0] * 9


def surge(t: float) -> tuple[float, float]:
    """Displacement (m) and velocity (m/s): from rest, without a jump of the acceleration."""
    w, s, c = np.pi / 12.0, np.sin(np.pi * t / 12.0), np.cos(np.pi * t / 12.0)
    return 2.0 * s**4, 8.0 * w * s**3 * c


def on_a_body(path: Path) -> Path:
    """The deck with its coupled points on one coupled body at (0, 0, -14)."""
    text = DECK.read_text(encoding="utf-8")
    for k, (x, y) in enumerate(((40, 0), (-20, 34.64), (-20, -34.64)), 4):
        old = next(line for line in text.splitlines() if line.startswith(f"{k}    Coupled"))
        text = text.replace(old, f"{k}  Body1  {x} {y} 0  0 0 0 0")
    rows = [
        "---------------------- BODIES ---", "ID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG* I* Volume CdA* Ca*",
        "(#) (word) (m) (m) (m) (deg) (deg) (deg) (kg) (m) (kg-m^2) (m^3) (m^2) (-)",
        "1 Coupled 0 0 -14 0 0 0 0 0 0 0 0 0",
    ]  # fmt: skip
    mark = "---------------------- POINTS"
    path.write_text(text.replace(mark, "\n".join([*rows, mark])), encoding="utf-8")
    return path


def started(path: Path = DECK) -> moordyn.MoorDyn:
    network = moordyn.Create(str(path))
    x = PLACES if moordyn.NCoupledDOF(network) == 9 else [0.0, 0.0, -14.0, 0.0, 0.0, 0.0]
    assert moordyn.Init(network, x, [0.0] * len(x)) == 0
    return network


@pytest.mark.parametrize("what", ["point", "body", "point of a body"])
def test_loads_of_what_the_caller_moves_are_refused(what: str, tmp_path: Path) -> None:
    """MoorDyn adds their weight to the force it returns."""
    text = (DECK if what == "point" else on_a_body(tmp_path / "deck.txt")).read_text(encoding="utf-8")
    old, new = {
        "point": ("-14    0      0       0      0", "-14    5000   3       0      0"),
        "body": ("1 Coupled 0 0 -14 0 0 0 0 0 0 0", "1 Coupled 0 0 -14 0 0 0 0 0 5 0"),
        "point of a body": ("0  0 0 0 0", "0  0 3 0 0"),
    }[what]
    assert old in text
    (tmp_path / "deck.txt").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(hybrid.SceneError, match="no mass, volume or drag on what the caller moves"):
        moordyn.Create(str(tmp_path / "deck.txt"))


@pytest.mark.parametrize(("stiffness", "rods", "said"), [
    (0.0, ["1 light Body1 1 0 0 1 0 0 0 -"], ""),
    (5e6, ["1 light Body1 1 0 0 1 1 0 0 -"], "no rod that is coupled, has length or holds a line that bends"),
    (0.0, ["1 light Body1 1 0 0 1 1 0 2 -"], "has length"),
    (0.0, ["1 light Coupled 40 0 -14 40 1 -14 0 -"], "that is coupled"),
])  # fmt: skip
def test_rods_that_the_caller_would_turn_are_refused(
    stiffness: float, rods: list[str], said: str, tmp_path: Path
) -> None:
    """Their axes were taken for inertial ones, and their moments left out."""
    text = (
        on_a_body(tmp_path / "deck.txt").read_text(encoding="utf-8").replace("-1.0       0  ", f"-1.0  {stiffness}", 1)
    )
    table = ["--- ROD TYPES ---", "TypeName Diam Mass/m Cd Ca CdEnd CaEnd", "(-) (m) (kg/m) (-) (-) (-) (-)",
             "light 0.2 0 0 0 0 0", "--- RODS ---", "ID RodType Attachment Xa Ya Za Xb Yb Zb NumSegs Outputs",
             "(#) (-) (-) (m) (m) (m) (m) (m) (m) (-) (-)", *rods, "---------------------- POINTS"]  # fmt: skip
    text = text.replace("---------------------- POINTS", "\n".join(table)).replace("1        4  ", "1        R1A")
    (tmp_path / "deck.txt").write_text(text, encoding="utf-8")
    if not said:
        assert moordyn.NCoupledDOF(moordyn.Create(str(tmp_path / "deck.txt"))) == 6
        return
    with pytest.raises(hybrid.SceneError, match=said):
        moordyn.Create(str(tmp_path / "deck.txt"))


def test_a_point_that_holds_no_line_has_no_place(tmp_path: Path) -> None:
    row = "6    Coupled      -20    -34.64   -14    0      0       0      0\n"
    path = tmp_path / "deck.txt"
    path.write_text(DECK.read_text(encoding="utf-8").replace(row, f"{row}7 Fixed 1 1 -5 0 0 0 0\n"), encoding="utf-8")
    network = moordyn.Create(str(path))
    with pytest.raises(ValueError, match="point7: expected a point that holds a line"):
        moordyn.GetPointPos(moordyn.GetPoint(network, 7))


def test_it_starts_from_the_equilibrium_of_the_imported_scene() -> None:
    network = started()
    result = hybrid.static(next(iter(hybrid.import_moordyn(DECK).scenes.values())).scene)
    for k in (1, 2, 3):
        line = moordyn.GetLine(network, k)
        end = result.lines[f"line{k}"].reaction_end[0]
        point = moordyn.GetPoint(network, 3 + k)
        assert moordyn.GetPointForce(point) == pytest.approx(-end, rel=1e-6, abs=1e-3)
        assert moordyn.GetLineN(line) == moordyn.GetLineNumberNodes(line) - 1 == (20, 20, 10)[k - 1]
        assert moordyn.GetLineNodePos(line, moordyn.GetLineN(line)) == pytest.approx(PLACES[3 * k - 3 : 3 * k])
        assert moordyn.GetLineNodePos(line, 0) == moordyn.GetPointPos(moordyn.GetPoint(network, k))
    assert moordyn.GetLineUnstretchedLength(moordyn.GetLine(network, 1)) == pytest.approx(815.0)
    assert [moordyn.GetPointType(moordyn.GetPoint(network, k)) for k in (1, 4)] == [
        moordyn.POINT_TYPE_FIXED, moordyn.POINT_TYPE_COUPLED,
    ]  # fmt: skip
    assert moordyn.Close(network) == 0


def test_forces_of_a_motion_are_those_of_the_scene_that_has_it(tmp_path: Path) -> None:
    """The caller's places and velocities at the begin of its steps; the scene's motion from a file of its own."""
    dt, steps = 0.05, 80
    network = moordyn.Create(str(DECK))
    moordyn.SetDt(network, dt)
    moordyn.Init(network, PLACES, STILL)
    found = []
    for k in range(steps):
        (d0, _), (d1, _) = surge(k * dt), surge((k + 1) * dt)
        x = [p + (d0 if i == 0 else 0.0) for i, p in enumerate(PLACES)]
        v = [(d1 - d0) / dt if i == 0 else 0.0 for i in range(9)]
        found.append(moordyn.Step(network, x, v, 3.0 + k * dt, dt))
    moordyn.Close(network)

    rows = "\n".join(f"{t:.4f},{40 + surge(t)[0]:.12f},0,-14" for t in np.arange(0.0, steps * dt + 0.3, 0.05))
    (tmp_path / "surge.csv").write_text(f"t,x,y,z\n{rows}\n")
    data = next(iter(hybrid.import_moordyn(DECK).scenes.values())).scene.model_dump(exclude_none=True)
    data["points"]["point4"]["motion"] = {"file": str(tmp_path / "surge.csv")}
    data |= {"time": {"duration": steps * dt, "step": dt}, "output": {"every": dt}}
    result = hybrid.run(data)
    pull = result["points/point4/force"][1:]
    off = np.abs(np.array(found)[:, :3] - pull).max()
    assert off < 0.01 * np.abs(pull).max()  # the velocities at the ends of steps differ
    assert np.ptp(pull[:, 0]) > 0.05 * np.abs(pull[:, 0]).max()


@pytest.mark.long
def test_a_coupled_body_is_its_points(tmp_path: Path) -> None:
    body, points = started(on_a_body(tmp_path / "body.txt")), started()
    assert moordyn.NCoupledDOF(body) == 6
    yaw, dt = 0.002, 0.05
    for k in range(20):
        angle = yaw * k
        # the caller's points go to where the body takes them, with the velocities that it gives them
        c, s, rate = np.cos(angle + yaw), np.sin(angle + yaw), yaw / dt
        there = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        after = [there @ np.array([x, y, 0.0]) for x, y in ((40, 0), (-20, 34.64), (-20, -34.64))]
        v = np.concatenate([np.cross([0, 0, rate], a) for a in after])
        x = np.concatenate([a + np.array([0.0, 0.0, -14.0]) for a in after]) - dt * v
        one = moordyn.Step(body, [0, 0, -14, 0, 0, angle], [0, 0, 0, 0, 0, rate], k * dt, dt)
        three = np.array(moordyn.Step(points, x, v, k * dt, dt)).reshape(3, 3)
        assert one[:3] == pytest.approx(three.sum(axis=0), rel=1e-6, abs=1.0)
        moment = sum(np.cross(a, f) for a, f in zip(after, three, strict=True))
        assert one[3:] == pytest.approx(moment, rel=1e-6, abs=1e-6 * np.abs(three).max() * 40.0)


WRONG: list[Callable[[Any], Any]] = [
    lambda s: moordyn.Init(s, PLACES, STILL),
    lambda s: moordyn.Step(s, PLACES[:8], STILL, 0.0, 0.1),
    lambda s: moordyn.Step(s, PLACES, [nan] * 9, 0.0, 0.1),
    lambda s: moordyn.Step(s, PLACES, "abc", 0.0, 0.1),
    lambda s: moordyn.Step(s, PLACES, STILL, 0.0, 0.0),
    lambda s: moordyn.Step(s, PLACES, STILL, 0.0, -1.0),
    lambda s: moordyn.Step(s, PLACES, STILL, nan, 0.1),
    lambda s: moordyn.Step(s, PLACES, STILL, 0.0, inf),
    lambda s: moordyn.GetLine(s, 0),
    lambda s: moordyn.GetLine(s, 4),
    lambda s: moordyn.GetLine(s, "1"),
    lambda s: moordyn.GetPoint(s, 7),
    lambda s: moordyn.GetLineNodePos(moordyn.GetLine(s, 1), 21),
    lambda s: moordyn.GetLineNodeTen(moordyn.GetLine(s, 1), -1),
    lambda s: moordyn.GetFASTtens(s, 2),
    lambda s: moordyn.SetDt(s, 0.1),
]


def test_wrong_uses_are_errors_in_words_and_it_goes_on() -> None:
    network = started()
    for wrong in WRONG:
        with pytest.raises(ValueError, match=r"\w+.*(expected|already).*"):
            wrong(network)
    assert len(moordyn.Step(network, PLACES, STILL, 0.0, 0.1)) == 9
    with pytest.raises(ValueError, match="where the last step ended"):
        moordyn.Step(network, PLACES, STILL, 0.0, 0.1)
    assert moordyn.GetFASTtens(network, 3)[0][0] > moordyn.GetFASTtens(network, 3)[2][0] > 0.0
    assert moordyn.GetLineFairTen(moordyn.GetLine(network, 1)) == moordyn.GetLineMaxTen(moordyn.GetLine(network, 1))
    moordyn.Close(network)
    for after in (lambda: moordyn.Step(network, PLACES, STILL, 0.1, 0.1), lambda: moordyn.Close(network)):
        with pytest.raises(ValueError, match="not running"):
            after()


def test_a_deck_that_is_no_scene_is_refused_with_its_line() -> None:
    with pytest.raises(hybrid.SceneError, match=r"rods_and_bodies\.txt:\d+"):
        moordyn.Create(str(DECK.with_name("rods_and_bodies.txt")))


def test_points_of_a_system_are_set_by_name() -> None:
    data = next(iter(hybrid.import_moordyn(DECK).scenes.values())).scene.model_dump(exclude_none=True)
    data |= {"time": {"duration": 1.0, "step": 0.05}}
    with hybrid.Simulation(data) as network:
        before = network.point("point4").force
        network.set_point("point4", [40.02, 0, -14])
        for until in (0.3, 0.37, 1.0):
            assert network.advance(until) == pytest.approx(until)
        assert network.point("point4").position == pytest.approx([40.02, 0.0, -14.0])
        assert network.point("point4").force[0] != before[0]
        for wrong in (
            lambda: network.set_point("anchor", [0, 0, 0]), lambda: network.set_point("point4", [0, nan, 0]),
            lambda: network.advance(0.5), lambda: network.advance(2.0), lambda: network.line("x"),
        ):  # fmt: skip
            with pytest.raises(ValueError, match="expected"):
                wrong()
        result = network.result()
    assert result.status == "complete"
    assert result.lines["line1"].tension.shape[0] == result.times.size
    with pytest.raises(ValueError, match="over"):
        network.advance(1.0)


def test_scripts_that_ask_the_deck_where_things_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The calls of MoorDyn's example and of its smallest test: states before Init, names of older versions."""
    network = moordyn.Create(str(on_a_body(tmp_path / "body.txt")))
    assert moordyn.GetNumberBodies(network) == 1
    body = moordyn.GetBody(network, 1)
    assert moordyn.GetBodyID(body) == 1 and moordyn.GetBodyType(body) == moordyn.BODY_TYPE_COUPLED
    x, xd = (np.array(part) for part in moordyn.GetBodyState(body))
    assert x.tolist() == [0, 0, -14, 0, 0, 0] and not xd.any()
    moordyn.Init(network, x, xd)
    f = moordyn.Step(network, x, [0.1, 0, 0, 0, 0, 0], 0.0, 0.5)
    assert len(f) == 6
    state, rates = moordyn.GetBodyState(body)
    assert state == pytest.approx([0.05, 0, -14, 0, 0, 0]) and rates[0] == 0.1
    moordyn.Close(network)

    (tmp_path / "Mooring").mkdir()
    (tmp_path / "Mooring" / "lines.txt").write_text(DECK.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    network = moordyn.Create()
    places = [x for k in (4, 5, 6) for x in moordyn.GetConnectPos(moordyn.GetConnection(network, k))]
    assert places == PLACES
    assert not any(moordyn.GetPointForce(moordyn.GetPoint(network, 4)))
    assert moordyn.Init(network, places, STILL) == 0 and moordyn.Close(network) == 0
    with pytest.raises(RuntimeError, match="file"):
        moordyn.Create("file.invalid")
    with pytest.raises(hybrid.SceneError):
        moordyn.Create("file.invalid")


TURNED = """------ a body and three points
--- BODIES ---
ID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG* I* Volume CdA* Ca
(#) (-) (m) (m) (m) (deg) (deg) (deg) (kg) (m) (kg-m^2) (m^3) (m^2) (-)
1 coupled 0 0 0 0 0 0 0 0 0 0 0 0
--- POINTS ---
ID Type X Y Z M V CdA CA
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Body1 1 0 0 0 0 0 0
2 Body1 0 1 0 0 0 0 0
3 Body1 0 0 1 0 0 0 0
--- OPTIONS ---
0.0 g
100 WtrDpth
"""


def test_a_body_turns_as_moordyn_turns_it(tmp_path: Path) -> None:
    """Angles about x, the turned y, the turned z (R = Rx Ry Rz), as MoorDyn 2.7 has them; a deck needs no lines for it."""
    path = tmp_path / "turned.txt"
    path.write_text(TURNED, encoding="utf-8")
    network = moordyn.Create(str(path))
    points = [moordyn.GetPoint(network, k) for k in (1, 2, 3)]
    assert moordyn.Init(network, [0] * 6, [0] * 6) == 0
    assert np.array([moordyn.GetPointPos(x) for x in points]) == pytest.approx(np.eye(3))
    rates = np.radians([10.0, 20.0, 30.0])
    for k in range(2):
        r, _ = moordyn.GetBodyState(moordyn.GetBody(network, 1))
        assert moordyn.Step(network, r, [0, 0, 0, *rates], float(k), 1.0) == [0.0] * 6
    found = np.array([moordyn.GetPointPos(x) for x in points]).T
    expected = Rotation.from_euler("XYZ", [20, 40, 60], degrees=True)
    assert found == pytest.approx(expected.as_matrix(), abs=1e-12)
    spin = np.array([moordyn.GetPointVel(x) for x in points]).T @ found.T
    t = 1e-6
    later = Rotation.from_euler("XYZ", np.degrees([2 + t, 2 + t, 2 + t] * rates), degrees=True).as_matrix()
    assert spin == pytest.approx((later - found) @ found.T / t, abs=1e-5)
    with pytest.raises(ValueError, match="no line"):
        moordyn.GetLine(network, 1)
    moordyn.Close(network)


def test_nodes_of_moordyn_may_be_numbers_of_numpy():
    from hybrid.couple.moordyn import MoorDynLine

    assert MoorDynLine(None, 1, "line1", 0, 10).node(np.int64(3)) == 3
