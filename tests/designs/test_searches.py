"""Searches end where they should: wherever the scene lies, whatever is 0 at first, and with a deviation of each number."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

FIXED = dict(model="catenary", initial="equilibrium", mesh={"cells": 20})


def hanging(X=0.0, F=60.0, fy=0.0, fz=0.0, **more):
    section = {"length": 20.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6} | more.pop("section", {})
    start = pinned_at(X, 0, 0, **more.pop("start", {}))
    return hybrid.validate_scene(
        cable_scene(section, start, {"kind": "free", "force": [F, fy, fz]}, model="catenary", mesh=20, **more)
    )


FORCE, LENGTH = "ends.end.force[0]", "cable.sections[0].length"


def test_a_number_that_is_seen_alone_has_its_own_deviation(tmp_path):
    """dm = dT m / T, whatever else is asked of other lines."""
    points, lines, masses = {}, {}, {"a": 1.0, "b": 3.0, "c": 9.0}
    for k, (n, m) in enumerate(masses.items()):
        points |= {f"{n}{i}": {"kind": "fixed", "position": [9.0 * i, 5.0 * k, 0]} for i in (0, 1)}
        section = {"length": 10, "mass": m, "diameter": 0.05, "axial_stiffness": 1e7}
        lines[n] = {"start": f"{n}0", "end": f"{n}1", "sections": [section], **FIXED}
    scene = hybrid.validate_scene({"points": points, "lines": lines})
    rest = hybrid.static(scene)
    T = {n: float(rest.lines[n].tension[-1, -1]) for n in masses}
    file = tmp_path / "three.csv"
    file.write_text("line,tension\n" + "".join(f"{n},{x:.9g}\n" for n, x in T.items()))
    keys = {f"{q[0]}{n}": {"key": f"lines.{n}.sections[0].{q}"} for n in "abc" for q in ("mass", "length")}
    found = hybrid.design(
        scene,
        unknowns={x: keys[x] for x in ("ma", "mb", "mc", "lb", "lc")},
        measured={"file": str(file), "at": "end", "deviation": 2.0},
    )
    assert found.estimates[0].deviation == pytest.approx(2.0 * masses["a"] / T["a"], rel=0.01)


def test_a_number_that_may_be_of_either_sign_is_told_apart_by_itself(tmp_path):
    x = float(hybrid.static(hanging(F=30.0, fz=-60.0)).position[-1, -1, 0])
    file = tmp_path / "x.csv"
    file.write_text(f"x\n{x:.9g}\n")
    found = hybrid.design(
        hanging(F=40.0, fz=-60.0),
        unknowns={"F": {"key": FORCE, "low": -200, "high": 200}, "m": {"key": "cable.sections[0].mass"}},
        measured={"file": str(file), "at": "end", "deviation": 0.001},
    )
    assert (
        all(np.isinf(x.deviation) for x in found.estimates) and "F and m: only their combination" in found.apart[0].text
    )


def test_what_nothing_shows_is_not_wanted_beyond_its_bound(tmp_path):
    file = tmp_path / "t.csv"
    file.write_text("tension\n200\n")
    fluid = {"fluid": {"density": 1025}, "section": {"drag": {"normal": 1.2}}}
    found = hybrid.design(
        hanging(**fluid),
        unknowns={"F": {"key": FORCE}, "cn": {"key": "cable.sections[0].drag.normal", "low": 1.2}},
        measured={"file": str(file), "at": "start", "deviation": 1.0},
    )
    assert not any("beyond" in x for x in found.notes)


def test_a_search_that_ends_before_it_is_done_says_so(tmp_path):
    file = tmp_path / "f.csv"
    scene = hanging(F=1.0, gravity=0)
    file.write_text("tension\n1e5\n")
    found = hybrid.design(
        scene, unknowns={"F": {"key": FORCE}}, measured={"file": str(file), "at": "start", "deviation": 0.5}
    )
    assert not found.settled and any("40 steps were not enough" in x for x in found.notes)
    found = hybrid.design(
        scene, unknowns={"F": {"key": FORCE}}, measured={"file": str(file), "at": "start", "deviation": 10.0}
    )
    assert any("times the stated deviation" in x for x in found.notes)  # no step was made


def test_what_has_to_be_0_may_be_0_at_first():
    lines = {
        n: {
            "start": n,
            "end": "buoy",
            "sections": [{"length": 60, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 1e6}],
            "model": "catenary",
            "mesh": {"cells": 15},
            "initial": "equilibrium",
        }
        for n in "ab"
    }
    points = {
        "a": {"kind": "fixed", "position": [-40, 0, -30]},
        "b": {"kind": "fixed", "position": [40, 0, -30]},
        "buoy": {"kind": "free", "mass": 50.0, "force": [0, 0, 6e3], "initial_guess": [0, 0, 5]},
    }
    found = hybrid.design(
        hybrid.validate_scene({"points": points, "lines": lines}),
        unknowns={n: {"key": f"lines.{n}.sections[0].length"} for n in "ab"},
        targets={
            "T": {"quantity": "tension", "line": "a", "at": "end", "value": 4000},
            "x": {"quantity": "position.x", "line": "a", "at": "end", "value": 0},
        },
    )
    assert found.numbers["a"] == pytest.approx(45.98771, rel=1e-6)


@pytest.mark.needs("simpleeval")
@pytest.mark.parametrize("X", [0.0, 5e5])
def test_designs_do_not_hang_on_where_the_scene_lies(X, tmp_path):
    move = {"start": {"motion": {"surge": {"amplitude": 0.5, "period": 4}, "ramp": 8}}}
    moved = hanging(
        X,
        time=(6, 0.1),
        output=(0.1, 11),
        fluid={"density": 1025, "surface": 50},
        section={"drag": {"normal": 1.2}},
        **move,
    )
    F = {"F": {"key": FORCE, "low": 1, "high": 200}}
    reach = {"quantity": "position.x", "at": "end", "over": "max", "largest": X + 8}
    (kept,) = hybrid.design(moved, unknowns=F, minimise="-F", limits={"reach": reach}).kept
    assert kept.value - X == pytest.approx(8.0, rel=2e-3)  # it was 17 m
    file = tmp_path / "x.csv"
    rest = hybrid.static(hanging(X))
    x = np.interp((5, 10, 15, 20), rest.s, rest.position[-1, :, 0]) + 0.002 * np.array([1, -1, -1, 1])
    file.write_text("s,x\n" + "".join(f"{s},{v:.12g}\n" for s, v in zip((5, 10, 15, 20), x, strict=True)))
    found = hybrid.design(hanging(X, 90.0), unknowns={"F": {"key": FORCE}}, measured={"file": str(file)})
    assert found.numbers["F"] == pytest.approx(60.0, rel=1e-4)  # it stayed 90
    section = {"length": 20.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    span = hybrid.validate_scene(
        cable_scene(section, pinned_at(X, 0, 0), pinned_at(X + 17, 0, 0), model="catenary", mesh=20)
    )
    found = hybrid.design(
        span,
        unknowns={"x": {"key": "ends.end.position[0]", "low": X + 15, "high": X + 19.5}},
        minimise="-x",
        limits={"top": {"quantity": "tension", "at": "end", "largest": 500}},
    )
    assert found.numbers["x"] - X == pytest.approx(19.4486, rel=1e-4)


@pytest.mark.parametrize("X", [0.0, 5e5])
def test_what_is_sought_does_not_hang_on_where_the_scene_lies(X):
    section = {"length": 250, "mass": 20, "diameter": 0.05, "axial_stiffness": 2e8}
    tables = cable_scene(
        section, pinned_at(X, 0, 0), pinned_at(X + 60, 0, 0), model="catenary", mesh=20, fluid={"density": 1025}
    )
    found = hybrid.seek(tables, {"tension@250": 60e3}, ["ends.end.position[0]"])
    assert found.numbers["ends.end.position[0]"] - X == pytest.approx(243.9913, rel=1e-5)


@pytest.mark.parametrize("several", [False, True])
def test_output_points_at_the_end_of_a_line_stay_there_when_its_length_is_sought(several):
    section = {"length": 250.0, "mass": 20, "axial_stiffness": 2e8}
    if several:
        points = {"a": {"position": [0, 0, 0]}, "b": {"position": [205, 0, 100]}}
        output = {"points": {"x": [0, 125, 250]}, "history": {"x": [250]}}
        tables = network_scene(points, {"x": line_between("a", "b", section, model="catenary", mesh=20)}, output=output)
        key, of = "lines.x.sections[0].length", "x/tension@end"
    else:
        output = {"points": [0, 125, 250], "history": [250]}
        ends = pinned_at(0, 0, 0), pinned_at(205, 0, 100)
        tables = cable_scene(section, *ends, model="catenary", mesh=20, output=output)
        key, of = "cable.sections[0].length", "tension@end"
    assert hybrid.seek(tables, {of: 60e3}, [key]).results[of] == pytest.approx(60e3)


def test_a_place_at_the_end_of_a_line_stays_there_when_its_length_is_sought():
    """Lines of other lengths are asked at their end, whether that is written as `end` or in m."""
    section = {"length": 20.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5}
    scene = cable_scene(section, pinned_at(0, 0, 0), pinned_at(15, 0, 0), model="catenary", mesh=20)
    for target in (222.0, 230.0):
        one, two = (hybrid.seek(scene, {of: target}, [LENGTH]) for of in ("tension@20", "tension@end"))
        assert one.numbers == two.numbers
    for at in (20, "end"):
        aim = {"top": {"quantity": "tension", "at": at, "value": 222.0}}
        found = hybrid.design(scene, unknowns={"L": {"key": LENGTH}}, targets=aim)
        assert found.numbers["L"] == pytest.approx(19.2378, abs=1e-4)
