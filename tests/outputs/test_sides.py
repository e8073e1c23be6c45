"""Points where a quantity has two values: both are written, and nothing is interpolated across them."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from problems import order

import hybrid
from hybrid.errors import ResultError
from tests.scenes import cable_scene, clamped_at, line_between, network_scene, pinned_at

G, MASS, CLUMP = 9.81, 2.0, 5.0  # m/s2, kg/m, kg
AT, LENGTH = 4.1, 10.0  # m


def chain(**output: Any) -> dict[str, Any]:
    """A chain of 10 m that hangs straight down, with a clump at 4.1 m."""
    return cable_scene(
        {"length": LENGTH, "mass": MASS, "axial_stiffness": 1e6}, pinned_at(0, 0, 0), "free",
        attachments=[{"kind": "clump", "at": AT, "mass": CLUMP}], model="catenary", output={"points": 11, **output}
    )  # fmt: skip


def weight_below(s: float) -> float:
    return MASS * G * (LENGTH - s) + CLUMP * G * (s < AT)


@pytest.fixture(scope="module")
def hung() -> hybrid.Result:
    return hybrid.static(hybrid.validate_scene(chain()))


def test_a_load_is_a_point_of_the_grid_with_two_values(hung: hybrid.Result) -> None:
    assert hung.s.tolist() == sorted([*np.linspace(0.0, LENGTH, 11).tolist(), AT])
    assert hung["right/s"].tolist() == [AT]
    below = MASS * G * (LENGTH - AT)
    k = int(np.searchsorted(hung.s, AT))
    assert hung.tension[0, k] == pytest.approx(below + CLUMP * G, rel=1e-9)  # the solver's tolerance
    assert hung["right/tension"][0, 0] == pytest.approx(below, rel=1e-9)


def test_nothing_is_interpolated_across_it(hung: hybrid.Result) -> None:
    for s in (3.5, AT - 1e-3, AT + 1e-3, 4.5):
        assert hung.at(s=s, t=0.0)["tension"] == pytest.approx(weight_below(s), rel=1e-9), s
    both = [hung.at(s=[2.0, AT], t=0.0, names=["tension"], side=side)["tension"] for side in ("left", "right")]
    below = MASS * G * (LENGTH - AT)
    assert both[0] == pytest.approx([weight_below(2.0), below + CLUMP * G], rel=1e-9)
    assert both[1] == pytest.approx([weight_below(2.0), below], rel=1e-9)


def test_exactly_there_both_values_are_given(hung: hybrid.Result) -> None:
    found = hung.at(s=[1.5, AT], t=0.0, names=["tension"])
    below = MASS * G * (LENGTH - AT)
    assert found["tension"] == pytest.approx([weight_below(1.5), below + CLUMP * G], rel=1e-9)
    assert found["right/tension"] == pytest.approx([weight_below(1.5), below], rel=1e-9)
    assert set(hung.at(s=AT, names=["tension"], side="right")) == set(hung.at(s=1.5, names=["tension"])) == {"tension"}
    assert set(hung.at(s=AT, names=["position"])) == {"position"}
    with pytest.raises(ResultError, match=r"side = 'above'(?s:.*)'left' or 'right'"):
        hung.at(s=AT, side="above")


def test_both_sides_in_one_array(hung: hybrid.Result) -> None:
    s, tension = hung.both_sides("tension")
    assert s.tolist() == sorted([*hung.s.tolist(), AT])
    below = MASS * G * (LENGTH - AT)
    assert tension[0, s == AT] == pytest.approx([below + CLUMP * G, below], rel=1e-9)
    assert np.array_equal(tension[:, s != AT], hung.tension[:, hung.s != AT])
    s, position = hung.both_sides("position")
    assert np.array_equal(s, hung.s) and np.array_equal(position, hung.position)


@pytest.mark.parametrize("kinds", ["rod rod", "catenary catenary", "rod catenary"])
def test_only_a_joint_of_rod_and_catenary_is_a_jump(kinds: str) -> None:
    scene = chain() | {"model": {"kind": "zones", "zones": [{kind: 5.05} for kind in kinds.split()]}}
    scene["cable"] = {"sections": [{"length": 10.1, "mass": MASS, "axial_stiffness": 1e6, "bending_stiffness": 1.0}]}
    found = hybrid.static(hybrid.validate_scene(scene))
    if kinds == "rod catenary":
        assert found["right/s"].tolist() == [5.05] and 5.05 in found.s
    else:
        assert np.array_equal(found.s, np.linspace(0.0, 10.1, 11)) and "right/s" not in found


def test_a_csv_has_a_column_for_each_side(hung: hybrid.Result, tmp_path: Path) -> None:
    hybrid.export(hung, tmp_path / "chain.csv", at=[1.0, AT])
    lines = (line for line in (tmp_path / "chain.csv").read_text().splitlines() if not line.startswith("#"))
    (row,) = csv.DictReader(lines)
    before, after = (float(row[f"tension (N) at s = {AT} m {side}"]) for side in ("before", "after"))
    assert before - after == pytest.approx(CLUMP * G, rel=1e-9)
    assert float(row["tension (N) at s = 1 m"]) == pytest.approx(weight_below(1.0), rel=1e-9)


@pytest.mark.needs("xarray")
def test_in_xarray_both_are_variables(hung: hybrid.Result) -> None:
    found = hung.to_xarray()
    jump = found.tension.sel(s=AT) - found.right_tension.sel(right_s=AT)
    assert float(jump[0]) == pytest.approx(CLUMP * G, rel=1e-9)


@pytest.mark.parametrize("points", [11, [0.0, 2.5, 10.0]])
def test_points_of_the_history_are_points_of_the_grid(points: int | list[float]) -> None:
    found = hybrid.static(hybrid.validate_scene(chain(points=points, history=[0.0, 3.3, AT, 10.0])))
    usual = points if isinstance(points, list) else np.linspace(0.0, LENGTH, points).tolist()
    assert found.s.tolist() == sorted([*usual, 3.3, AT]) and found["right/s"].tolist() == [AT]


def test_a_smooth_cable_has_neither() -> None:
    scene = chain()
    scene["cable"]["attachments"] = []
    found = hybrid.static(hybrid.validate_scene(scene))
    assert np.array_equal(found.s, np.linspace(0.0, LENGTH, 11)) and not [x for x in found.names if "right" in x]


def test_errors_are_known_on_both_sides(tmp_path: Path) -> None:
    """A catenary with a clump: errors by mesh, step and neglected bending of both values."""
    scene = chain(errors=True, every=0.1) | {"time": {"duration": 0.5, "step": 0.02}, "mesh": {"cells": 20}}
    scene["cable"]["sections"][0]["bending_stiffness"] = 1.0
    heave = {"heave": {"amplitude": 0.1, "period": 2.0}, "ramp": 0.5}
    scene["ends"] = {"start": scene["ends"]["start"] | {"motion": heave}, "end": pinned_at(7, 0, 0)}
    scene["model"] = "catenary"
    found = hybrid.run(hybrid.validate_scene(scene))
    for cause in ("mesh", "time", "model", "total"):
        left, right = found[f"errors/{cause}/tension"], found[f"errors/{cause}/right_tension"]
        assert found.dims(f"errors/{cause}/right_tension") == ("t", "right/s") and right.shape == (6, 1)
        s, both = found.both_sides(f"errors/{cause}/tension")
        assert np.array_equal(both[:, s == AT], np.column_stack([left[:, found.s == AT], right]))
        assert 0.0 < right.max() < 0.2 * found.tension.max(), cause
    total = found.at(s=[AT, 5.0], names=["errors/total/tension"])
    assert np.array_equal(total["errors/total/right_tension"][:, 0], found["errors/total/right_tension"][:, 0])
    hybrid.export(found, tmp_path / "chain.csv", at=[AT])
    text = (tmp_path / "chain.csv").read_text()
    assert f"tension at s = {AT} m before: at most" in text and f"tension at s = {AT} m after: at most" in text


@pytest.mark.needs("rainflow")
def test_cycles_are_those_of_the_worse_side(tmp_path: Path) -> None:
    """A cantilever that is shaken: its softer half bends four times as much at the seam as the stiffer one."""
    section = {"length": 0.5, "mass": 0.05, "axial_stiffness": 1e5}
    shaken = {"heave": {"amplitude": 0.01, "period": 0.3}, "ramp": 0.2}
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "motion": shaken}
    scene = cable_scene(
        [section | {"bending_stiffness": EI} for EI in (2.0, 0.5)], clamp, "free", model="rod", mesh=20,
        time=(1.0, 0.01), output=(0.02, 10)
    )  # fmt: skip
    found = hybrid.run(hybrid.validate_scene(scene))
    table = hybrid.export(found, tmp_path / "cycles.csv", format="fatigue", at=[0.5]).files[1].read_text().splitlines()
    rows = list(csv.DictReader(line for line in table if not line.startswith("#")))
    t, bend = np.array([[float(row[x]) for x in ("t (s)", "curvature (1/m) at s = 0.5 m")] for row in rows]).T
    counted = np.abs(np.interp(found.times[1:], t, bend))  # at the outputs; the table has every step
    assert counted == pytest.approx(found["right/curvature"][1:, 0], rel=1e-6, abs=1e-9)
    assert counted.max() > 3.9 * found.curvature[:, found.s == 0.5].max()
    assert any("just after the point" in line for line in table if line.startswith("# curvature at s = 0.5 m"))


def test_curvature_jumps_with_the_stiffness_and_the_moment_does_not() -> None:
    """A cantilever of two sections under its weight: M = EI kappa on both sides, the same M."""
    stiff, soft = 400.0, 100.0
    section = {"mass": 0.05, "axial_stiffness": 1e7}
    parts = [
        section | {"length": 0.6, "bending_stiffness": stiff},
        section | {"length": 0.4, "bending_stiffness": soft},
    ]
    found = hybrid.static(
        hybrid.validate_scene(cable_scene(parts, clamped_at([0, 0, 0], [1, 0, 0]), "free", model="rod", mesh=100))
    )
    before, after = (found.at(s=0.6, t=0.0, side=side) for side in ("left", "right"))
    moment = 0.05 * G * 0.4**2 / 2  # N m, of a beam that bends little
    assert before["bending_moment"] == pytest.approx(moment, rel=2e-3)
    assert after["bending_moment"] == pytest.approx(before["bending_moment"], rel=1e-9)
    assert stiff * before["curvature"] == pytest.approx(before["bending_moment"], rel=1e-6)
    assert soft * after["curvature"] == pytest.approx(after["bending_moment"], rel=1e-6)


def test_tension_in_a_zone_of_one_cell_is_linear() -> None:
    """Of the three zones the first and the third, which is between joints, have one cell: 40 N/m, not 0, along it."""
    zones = [{"catenary": 2.0, "cells": 1}, {"rod": 3.0, "cells": 6}] * 2
    data = chain(points=41) | {"model": {"kind": "zones", "zones": zones}}
    data["cable"] = {"sections": [{"length": LENGTH, "mass": MASS, "axial_stiffness": 1e6, "bending_stiffness": 1.0}]}
    found = hybrid.static(hybrid.validate_scene(data))
    assert found.tension[0] == pytest.approx(MASS * G * (LENGTH - found.s), abs=1e-6 * MASS * G * LENGTH)


# --- Torque along a line in equilibrium: that of the moments at its nodes, also where output points lie on a seam or
# clamp ---

SECTION = {"length": 10, "mass": 3, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 200}


def hanging(sections: list[dict[str, Any]], attachments: list[dict[str, Any]]) -> hybrid.Result:
    """A rod with a round section between two pinned ends in a current that turns with depth: nothing twists it."""
    current = [{"z": -6, "velocity": [0.2, -1.0, 0]}, {"z": 0, "velocity": [0.3, 1.2, 0]}]
    scene = cable_scene(
        [x | {"drag": {"normal": 1.2}} for x in sections], pinned_at(0, 0, 0), pinned_at(6, 1, -1),
        attachments=attachments, fluid={"density": 1025, "current": current}, model="rod", mesh=50,
        output={"points": 201}
    )  # fmt: skip
    return hybrid.static(hybrid.validate_scene(scene))


@pytest.mark.parametrize(
    ("sections", "attachments"),
    [
        ([SECTION], [{"kind": "clump", "at": 4, "mass": 10}]),
        ([SECTION], [{"kind": "modules", "range": [4, 7], "buoyancy": 30}]),
        ([SECTION | {"length": 4}, SECTION | {"length": 6, "bending_stiffness": 800}], []),
    ],
    ids=["clump", "modules", "change of section"],
)
def test_no_torque_where_nothing_twists(sections: list[dict[str, Any]], attachments: list[dict[str, Any]]) -> None:
    result = hanging(sections, attachments)
    bending = float(result.bending_moment.max())
    assert bending > 10.0
    assert np.abs(result.torque).max() < 1e-8 * bending
    assert np.abs(result.right.torque).max() < 1e-8 * bending


def test_torque_at_clamps_is_that_of_their_moments() -> None:
    """A twisted line on a slope, in cells too long for its bend at the clamp: torque had the wrong sign there."""
    section = {
        "length": 130, "mass": 10, "diameter": 0.05, "axial_stiffness": 5e6, "bending_stiffness": 800,
        "torsional_stiffness": 600,
    }  # fmt: skip
    tangents = np.array([1.0, 0.0, 0.0]), np.array([0.3, 0.0, 1.0]) / np.hypot(0.3, 1.0)
    start = {"kind": "clamped", "position": [-10, 0, -40], "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    end = {"kind": "clamped", "position": [80, 0, 2], "tangent": [0.3, 0, 1], "normal": [1, 0, 0], "turns": 1.5}
    scene = cable_scene(
        section, start, end, fluid={"density": 1025, "surface": 0},
        seabed={"z": -40, "slope": [0.1, 0], "stiffness": 1e4}, model="rod", mesh=65, output={"points": 131}
    )  # fmt: skip
    result = hybrid.static(hybrid.validate_scene(scene))
    torque, moments = result.torque[-1], (result.moment_start[-1], result.moment_end[-1])
    assert torque[0] == pytest.approx(-moments[0] @ tangents[0], rel=1e-9)
    assert torque[-1] == pytest.approx(moments[1] @ tangents[1], rel=1e-9)
    assert torque == pytest.approx(np.median(torque), rel=0.04)
    bending = np.linalg.norm(moments[0] - (moments[0] @ tangents[0]) * tangents[0])
    assert result.bending_moment[-1, 0] == pytest.approx(bending, rel=1e-9)


# --- The curvature of outputs between nodes, where a line bends to one side before them and to the other side after
# them ---

SPAN = 20.0


def beam(cells: int, dimension: int) -> hybrid.Result:
    """A heavy rod clamped at both ends, level: it bends upwards in the middle and downwards beside both clamps."""
    section = {
        "length": SPAN,
        "mass": 2.0,
        "bending_stiffness": 2e4,
        "axial_stiffness": 1e8,
        "torsional_stiffness": 1e4,
    }
    held = {"kind": "clamped", "tangent": [1, 0, 0]}
    what: dict[str, Any] = cable_scene(
        section, held | {"position": [0, 0, 0]}, held | {"position": [19.995, 0, 0]}, model="rod", mesh=cells,
        output={"points": 1601, "errors": False}
    )  # fmt: skip
    return hybrid.static(what | {"dimension": dimension})


@pytest.mark.parametrize("dimension", [2, 3])
def test_curvature_is_interpolated_through_an_inflection(dimension: int) -> None:
    """Of second order there as elsewhere; its size alone, interpolated, would be of first order and never reach zero."""
    fine = beam(1600, dimension)
    k = fine.curvature[-1]
    inside = (fine.s > 2.0) & (fine.s < 8.0)
    assert k[inside].min() < 2e-3 * k.max()
    errors = []
    for cells in (17, 34, 68):
        found = beam(cells, dimension).curvature[-1]
        errors.append(np.abs(found - k)[inside].max() / k.max())
    assert order(errors)[-1] > 1.8 and errors[-1] < 2e-3, errors


def test_extremes_have_the_curvature_of_the_moment_and_of_the_unloaded_line_as_vectors() -> None:
    """0.3/m without load, and across them 0.4/m of a given moment make 0.5/m, behind the seam 0.2/m 0.36/m."""
    section = {"mass": 0.1, "axial_stiffness": 1e6, "torsional_stiffness": 1e3, "intrinsic_curvature": [0.3, 0.0, 0.0]}
    found = hybrid.run(cable_scene(
        [section | {"length": 0.1, "bending_stiffness": EI} for EI in (100.0, 200.0)],
        clamped_at([0, 0, 0], [1, 0, 0], normal=[0, 1, 0]), {"kind": "free", "moment": [0.0, 0.0, 40.0]},
        gravity=0.0, model="rod", mesh=20, time=(0.02, 0.01), output=(0.01, 3),
    ))  # fmt: skip
    high, shown = np.asarray(found["envelope"]["curvature_max"]), found.curvature[0]
    assert high == pytest.approx(np.repeat([0.5, np.hypot(0.3, 0.2)], 11), rel=2e-4)
    assert high[[0, 10, -1]] == pytest.approx(shown, rel=1e-12)
    assert high[11] == pytest.approx(found["right/curvature"][0, 0], rel=1e-12)


# --- Tension beside point loads, at ends of modules and at ends one cell away from a load: nothing is taken across a
# kink ---

HEAVY = {"length": 100, "mass": 2.0, "axial_stiffness": 1e7}


def hung_level(span: float, depth: float = 0.0, **cable: Any) -> dict[str, Any]:
    """A catenary in air between two points of one height."""
    pinned = {name: {"kind": "pinned", "position": [x, 0, depth]} for name, x in (("start", 0.0), ("end", span))}
    return {"cable": cable, "ends": pinned, "initial": "equilibrium", "model": "catenary"}


def test_the_largest_tension_is_that_on_each_side_of_modules() -> None:
    """T^2 = H^2 + V^2 at s = 45 m, where lifting modules begin: the largest of the line."""
    section = {"length": 100, "mass": 20, "diameter": 0.05, "axial_stiffness": 1e8, "max_tension": 11600}
    scene = hung_level(
        20.0, -60.0, sections=[section], attachments=[{"kind": "modules", "range": [45, 55], "buoyancy": 2500}]
    )
    result = hybrid.static(scene | {"environment": {"fluid": {"density": 1025}}})
    horizontal, vertical = np.abs(result["reaction_start"].reshape(3)[[0, 2]])
    weight = (20.0 - 1025 * np.pi / 4 * 0.05**2) * 9.81
    assert result["envelope/tension_max"].max() == pytest.approx(np.hypot(horizontal, vertical + 45 * weight), rel=1e-4)
    assert "tension above limit" in {event.kind for event in result.events}


@pytest.mark.parametrize("at", [1.0, 2.0])
def test_the_tension_of_an_end_beside_a_load(at: float) -> None:
    """Cells of 1 m: the load is one cell from the end, or two; the reaction knows the tension."""
    clumps = [{"kind": "clump", "at": x, "mass": 1500} for x in (at, 100.0 - at)]
    result = hybrid.static(hung_level(99.5, sections=[HEAVY], attachments=clumps) | {"mesh": {"cells": 100}})
    tension = np.ravel(result.tension)
    for k, reaction in ((0, "reaction_start"), (-1, "reaction_end")):
        assert tension[k] == pytest.approx(np.linalg.norm(result[reaction]), rel=2e-3)
    assert result["envelope/tension_max"].max() == pytest.approx(tension.max(), rel=2e-3)


def test_the_force_of_a_line_on_a_free_point_beside_a_load() -> None:
    """What two lines pull balances the weight of the point between them."""
    lines = {
        "one": line_between("a", "k", HEAVY, attachments=[{"kind": "clump", "at": 99, "mass": 1500}]),
        "two": line_between("k", "b", HEAVY),
    }
    result = hybrid.static({
        "points": {"a": {"position": [0, 0, 0]}, "b": {"position": [198.5, 0, 0]},
                   "k": {"kind": "free", "initial_guess": [99.5, 0, -3], "mass": 10}},
        "lines": {name: line | {"mesh": {"cells": 100}} for name, line in lines.items()},
    })  # fmt: skip
    pulled = result.lines["one"]["reaction_end"] + result.lines["two"]["reaction_start"]
    assert pulled.reshape(3) == pytest.approx([0.0, 0.0, -10 * 9.81], abs=0.003 * 5e4)


def test_the_largest_tension_at_an_offset_beside_a_load() -> None:
    """The clump is one cell of 10 m from the upper end, where the tension is largest: the pull there."""
    line = {"start": "a", "end": "k", "sections": [HEAVY], "mesh": {"cells": 10}}
    line["attachments"] = [{"kind": "clump", "at": 10, "mass": 150}]
    scene = network_scene(
        {"a": {"position": [0, 0, 0]}, "k": {"position": [80, 0, -30]}}, {"one": line | {"model": "catenary"}}
    )
    found = hybrid.offsets(scene, "point:k", [0.0])
    pull = np.linalg.norm(hybrid.static(scene).lines["one"]["reaction_start"])
    assert found.tension["one"][0] == pytest.approx(pull, rel=2e-3)


@pytest.mark.parametrize("asked", [{"line_tension": "1%"}, {"curvature": "5%"}])
def test_what_is_asked_along_a_cable_without_bending_stiffness(asked: dict[str, str]) -> None:
    result = hybrid.static(hung_level(80.0, sections=[HEAVY]) | {"accuracy": asked})
    assert not [event for event in result.events if event.kind == "accuracy missed"]
    assert len(result.mesh[0].s) < 2000


def test_places_that_are_nearly_one_have_one_side_each() -> None:
    """A clump 1e-8 m behind the end of a section shifted all moments behind it by a cell."""
    found = []
    for at in (66.66666667, 66.66666666):
        rod = {"length": 33.33333333, "mass": 3, "diameter": 0.05, "axial_stiffness": 1e6}
        sections = [rod | {"bending_stiffness": x} for x in (300, 600, 300)]
        scene = cable_scene(
            sections, pinned_at(0, 0, 0), clamped_at([90, 0, 0], [1, 0, -0.3]), model="rod", mesh=60,
            attachments=[{"kind": "clump", "at": at, "mass": 20}], output={"points": [0, 50, 70, 99]}
        )  # fmt: skip
        found.append(hybrid.static(scene).bending_moment[0])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-4)
