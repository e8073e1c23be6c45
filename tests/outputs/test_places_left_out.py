"""Output points may leave places out: what is said of a line is that of all of it, or is not said."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

import hybrid
from hybrid.designs.in_motion import in_motion
from hybrid.errors import ResultError, SceneError
from hybrid.live.pictures import frames, heads
from hybrid.view.several_runs import _differences

SEC = {"length": 100, "mass": 20, "diameter": 0.1, "axial_stiffness": 5e7, "drag": {"normal": 1.2}}
HEAVE = {"heave": {"amplitude": 0.5, "period": 8}, "ramp": 8}


def mooring(points, toward=1.0, motion=HEAVE, **more):
    end = {"kind": "pinned", "position": [toward * 80, 5, -3], "motion": motion}
    scene = {"environment": {"fluid": {"density": 1030, "surface": 7}}, "cable": {"sections": [SEC]}}
    scene |= {"ends": {"start": {"kind": "pinned", "position": [0, 0, -40]}, "end": end}, "initial": "equilibrium"}
    scene |= {"model": "catenary", "mesh": {"cells": 20}, "time": {"duration": 10, "step": 0.2}}
    return hybrid.validate_scene(scene | {"output": {"every": 0.4, "points": points}} | more)


def test_derivatives_of_a_motion_at_places_that_output_points_leave_out():
    of, by = ["max tension@end", "last position.z@50"], ["cable.sections[0].mass"]
    a, b = (in_motion(mooring(points), of, by) for points in (11, [20, 40, 70]))
    assert b.values == pytest.approx(a.values, rel=1e-9) and b.derivatives == pytest.approx(a.derivatives, rel=1e-6)


@pytest.mark.parametrize("points", [[20, 40, 70], [50]])
def test_a_deck_is_not_made_of_output_points_without_ends(points, tmp_path):
    with pytest.raises(SceneError, match=r"output\.points"):
        hybrid.export_moordyn(hybrid.static(mooring(points)), tmp_path / "a.txt")


def test_anchors_of_a_deck_stand_where_they_are_with_a_winch_at_the_start(tmp_path):
    scene = mooring(101).model_dump(mode="json", exclude_none=True)
    scene["ends"]["start"]["payout"] = {"rate": 0.5, "ramp": 2}
    scene["ends"]["end"].pop("motion")
    scene["time"]["duration"], scene["mesh"] = 3.0, {"cells": 40}
    text = hybrid.export_moordyn(hybrid.run(scene), tmp_path / "a.txt").text
    assert "\n1 Fixed 0 0 -47 0 0 0 0\n" in text


@pytest.mark.needs("rainflow")
def test_cycles_of_an_end_force_are_not_those_of_another_place(tmp_path):
    made = hybrid.export(hybrid.run(mooring([20, 40, 70])), tmp_path / "a.csv", format="fatigue")
    rows = [x for x in csv.reader(made.files[0].read_text().splitlines()) if not x[0].startswith("#")]
    assert {x[2] for x in rows[1:]} == {"tension", "curvature"} and any("last output point" in x[0] for x in rows)


def test_one_output_point_is_not_any_place():
    run = hybrid.run(mooring([50]))
    assert run.statistics(["tension"], at=[50])["tension"].mean.shape == (1,)
    for ask in (
        lambda: run.statistics(["tension"], at=[10]),
        lambda: run.damage("studless chain T-N", strength=5e6, at=[10]),
    ):
        with pytest.raises(ResultError, match="outside"):
            ask()


def test_values_beside_such_that_are_not_known():
    scene = mooring(11).model_dump(mode="json", exclude_none=True)
    half = SEC | {"length": 50}
    scene["cable"]["sections"] = [half, half | {"pipe": {"wall": 0.01}}]
    run = hybrid.static(scene)
    s, stress = run.both_sides("von_mises")
    assert run.at(s=50, names=["von_mises"], side="right")["von_mises"][0] == stress[0, np.flatnonzero(s == 50)[1]]


def test_azimuth_of_a_line_along_minus_x():
    sway = {"sway": {"amplitude": 2.0, "period": 6.0}, "ramp": 3.0}
    one, other = (
        hybrid.run(
            mooring(
                21,
                x,
                sway,
                ends={
                    "start": {"kind": "pinned", "position": [0, 0, -40]},
                    "end": {"kind": "pinned", "position": [x * 80, 0, -3], "motion": sway},
                },
            )
        )
        for x in (1.0, -1.0)
    )
    a, b = (x.statistics(["phi"])["phi"].standard_deviation[1:] for x in (one, other))
    assert b == pytest.approx(a, rel=1e-6)
    t = 0.5 * (one.times[1:] + one.times[:-1])
    a, b = (x.at(t=t, names=["phi"])["phi"] for x in (one, other))
    assert np.cos(a + b).max() == pytest.approx(-1.0, abs=1e-6)


def test_pretension_at_places_that_are_not_there():
    run, rest = hybrid.run(mooring(11)), hybrid.static(mooring([50, 75, 100]))
    with pytest.raises(ResultError, match="pretension"):
        run.mooring(1e5, (2.0, 1.0), rest)


def test_the_same_motion_at_other_output_points_is_no_difference():
    panels = _differences({"a": hybrid.run(mooring(11)), "b": hybrid.run(mooring([20, 40, 70]))})
    assert max(float(np.abs(x.y).max()) for p in panels for x in p.items) < 1e-9


def test_the_live_view_draws_all_of_a_line():
    run = hybrid.static(mooring([20, 40, 70]))
    assert heads(run)[0]["length"] == 100.0 and not any("start" in x["name"] for x in frames(run, [0], 9)[0]["marks"])


def clamped(points, **more):
    section = SEC | {"bending_stiffness": 2e3, "max_tension": 14750.0, "min_bend_radius": 0.6}
    end = {"kind": "clamped", "position": [80, 5, -3], "tangent": [1, 0, 0.3]}
    ends = {"start": {"kind": "pinned", "position": [0, 0, -40]}, "end": end}
    return mooring(points, cable={"sections": [section]}, ends=ends, model="rod", **more)


def test_errors_of_extremes_are_those_of_the_whole_line():
    end = {
        "kind": "clamped",
        "position": [80, 5, -3],
        "tangent": [1, 0, 0.3],
        "motion": {"heave": {"amplitude": 1.5, "period": 5}, "ramp": 5},
    }
    ends = {"start": {"kind": "pinned", "position": [0, 0, -40]}, "end": end}
    found = []
    for points in (51, [20, 30, 40], [50]):
        scene = clamped(points).model_dump(mode="json", exclude_none=True) | {"ends": ends}
        scene["output"]["errors"] = True
        found.append(json.loads(hybrid.run(scene).attributes["accuracy_extremes"])["curvature"])
    assert found[1:] == pytest.approx([found[0]] * 2, rel=0.05) and found[0] > 0.0


@pytest.mark.parametrize("points", [[20, 30, 40], [50]])
def test_a_bend_radius_whose_error_no_output_point_has_is_not_verified(points):
    scene = clamped(points, mesh={"cells": 400}).model_dump(mode="json", exclude_none=True)
    scene["output"]["errors"] = True
    (limit,) = (x for x in hybrid.static(scene).verdicts().limits if x.limit == "min_bend_radius")
    assert limit.verdict == "not verified" and limit.used is None


@pytest.mark.parametrize("points", [[20, 30, 40], [50]])
def test_a_capacity_that_output_points_do_not_show_is_not_within(points):
    scene = clamped(points, mesh={"cells": 500}).model_dump(mode="json", exclude_none=True)
    scene["cable"]["sections"][0]["capacity"] = [[5e4, 0], [0, 0.8]]
    scene["output"]["errors"] = True
    (held,) = hybrid.static(scene).verdicts().quantities
    assert held.verdict == "not verified" and held.bound > 200.0


def test_the_error_of_a_clearance_is_not_that_of_a_place_beside():
    gap = {"kind": "clearance", "point": [0, 0, -52], "normal": [0, 0, 1], "smallest": 5.13}
    scene = mooring([1], mesh={"cells": 10}).model_dump(mode="json", exclude_none=True)
    scene["output"] |= {"errors": True, "quantities": {"gap": gap}}
    (held,) = hybrid.static(scene).verdicts().quantities
    assert held.verdict == "not verified"
