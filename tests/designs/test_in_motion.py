"""Derivatives of motions against closed forms, and against a study of the step; tangents of several lines."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from derivative_scenes import scene_at_anchor
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.designs import in_motion as way
from hybrid.designs.in_motion import DIFFERENCES, TANGENTS, Motion, by_differences, by_tangents, in_motion
from hybrid.designs.numbers_and_results import changed_scene, number_of, parse_wanted, size_of
from hybrid.designs.replay import course_of, replay
from hybrid.designs.tangents import Unfollowed
from hybrid.kernels.step.line_step import TOLERANCE
from hybrid.scene.read import as_scene
from hybrid.scene.root import in_full
from tests.combinations.pairs import as_network
from tests.scenes import cable_scene, line_between, network_scene, pinned_at, span

G, A, PERIOD = 9.81, 1.0, 8.0
W = 2.0 * np.pi / PERIOD


def heaved(**more):
    """A stiff line with a weight below an end that heaves: its pull is that of the mass, whatever stretches."""
    section = {"length": 40.0, "mass": 5.0, "axial_stiffness": 1e8}
    heave = {"heave": {"amplitude": A, "period": PERIOD}, "ramp": 3.0 * PERIOD}
    return cable_scene(
        section, pinned_at(0, 0, 0, motion=heave), {"kind": "body", "mass": 60.0}, model="catenary", mesh=8,
        time=(36.0, 0.1, 0.5), output=(0.1, 9)
    ) | more  # fmt: skip


def test_the_pull_of_a_mass_that_is_heaved():
    """(m L + M)(g + A w^2), and its derivatives by mass, amplitude and gravity."""
    keys = ["cable.sections[0].mass", "ends.start.motion.heave.amplitude", "environment.gravity"]
    found = in_motion(hybrid.validate_scene(heaved()), ["max tension@start", "mean tension@start"], keys)
    mass, pull = 5.0 * 40.0 + 60.0, G + A * W**2
    assert found.values[0] == pytest.approx(mass * pull, rel=2e-3)
    assert found.derivatives[0] == pytest.approx([40.0 * pull, 40.0 * G], rel=5e-3)
    assert found.derivatives[1, 0] == pytest.approx(mass * W**2, rel=2e-2)
    assert found.derivatives[2] == pytest.approx([mass, mass], rel=1e-3)
    assert (found.errors < 1e-4 * np.maximum(np.abs(found.derivatives), 1.0)).all()


TIME = {"duration": 36.0}
OPEN = [
    {"time": TIME | {"tolerance": 1e-3}}, {"time": TIME, "accuracy": "1%"}, {"time": TIME, "accuracy": "1%", "mesh": None},
    {"time": TIME | {"step": 0.1}, "accuracy": "1%", "mesh": None},
]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(("more", "several"), [*((x, False) for x in OPEN), (OPEN[-1], True)])
def test_the_same_in_steps_and_cells_that_a_run_has_chosen(more, several):
    tables = {key: x for key, x in heaved(**more).items() if x is not None}
    key, of, amplitude = "cable.sections[0].mass", "tension@start", "ends.start.motion.heave.amplitude"
    if several:
        tables = as_network(tables)
        key, of, amplitude = (
            "lines.cable.sections[0].mass",
            "cable/tension@start",
            "points.start.motion.heave.amplitude",
        )
    found = in_motion(as_scene(tables), [f"max {of}", f"t=33.0 {of}"], [key, amplitude])
    mass, pull = 5.0 * 40.0 + 60.0, G + A * W**2
    assert found.values[0] == pytest.approx(mass * pull, rel=2e-3)
    assert found.derivatives[0, 0] == pytest.approx(40.0 * pull, rel=5e-3)
    assert found.derivatives[1, 0] == pytest.approx(mass * W**2, rel=3e-2)
    assert found.derivatives[1, 1] == pytest.approx(-mass * W**2 * np.sin(W * 33.0), rel=3e-2)
    assert (found.errors < 1e-4 * np.maximum(np.abs(found.derivatives), 1.0)).all()


def on_the_bed(model="catenary"):
    section = {
        "length": 250.0, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2e8, "bending_stiffness": 2e3,
        "torsional_stiffness": 2e3, "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    heave = {"heave": {"amplitude": 1.0, "period": 8.0}, "ramp": 4.0}
    return cable_scene(
        section, pinned_at(0, 0, -100.0), pinned_at(205.0, 0, 0, motion=heave), fluid={"density": 1025},
        seabed={"z": -100.0, "stiffness": 5e3, "damping": 500.0}, model=model, mesh=40, time=(8.0, 0.05),
        output=(0.2, 51)
    )  # fmt: skip


@pytest.fixture(scope="module")
def found():
    of = ["max tension@end", "std position.z@150", "last tension@end"]
    keys = ["cable.sections[0].drag.normal", "cable.sections[0].mass"]
    return of, keys, in_motion(hybrid.validate_scene(on_the_bed()), of, keys)


def test_a_study_of_the_step(found):
    """Of a touchdown that moves: differences by other steps agree to 1e-5, and no worse than the error figure says."""
    _, keys, ours = found
    scene = hybrid.validate_scene(on_the_bed())
    for i, key in enumerate(keys):
        by_part = []
        for part in (4e-4, 8e-4):
            with (
                hybrid.run(changed_scene(scene, key, number_of(scene, key) * (1 + part))) as more,
                hybrid.run(changed_scene(scene, key, number_of(scene, key) * (1 - part))) as less,
            ):
                peak = int(np.argmax(0.5 * (more.tension[:, -1] + less.tension[:, -1])))
                each = []
                for x in (more, less):
                    z = x.position[:, :, 2]
                    middle = np.array([np.interp(150.0, x.s, row) for row in z])
                    each.append(np.array([x.tension[peak, -1], middle.std(), x.tension[-1, -1]]))
                by_part.append((each[0] - each[1]) / (2.0 * part * number_of(scene, key)))
        theirs = (4.0 * by_part[0] - by_part[1]) / 3.0
        np.testing.assert_allclose(ours.derivatives[i], theirs, rtol=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("model", ["catenary", "rod", {"kind": "adaptive", "hold_time": 0.5}])
@pytest.mark.parametrize("mesh", [{"cells": 40}, None])
def test_a_replay_is_the_run_and_its_derivatives_those_of_short_steps(model, mesh):
    """Of a touchdown that moves, within what an accuracy of 1 % leaves; differences of runs as they come are 6 to 12 %

    off, because other numbers have other steps.
    """
    open_ = {"time": {"duration": 8.0}, "accuracy": "1%", "mesh": mesh}
    scene = hybrid.validate_scene({k: x for k, x in (on_the_bed(model) | open_).items() if x is not None})
    course = course_of(scene)._replace(tolerance=TOLERANCE)  # derivatives have steps that are solved further
    with hybrid.run(scene) as asked, replay(scene, course) as whole:
        again = whole.lines["cable"]
        np.testing.assert_array_equal(asked["steps/t"], again["steps/t"])
        assert np.abs(asked.position - again.position).max() < 1e-6
        assert np.abs(asked.tension - again.tension).max() < 1e-5 * asked.tension.max()
        tops = np.interp(5.03, asked.t, asked.tension[:, -1])
    of, key = ["std position.z@150", "last tension@end", "t=5.03 tension@end"], "cable.sections[0].drag.normal"
    ours = in_motion(scene, of, [key])
    assert ours.values[2] == pytest.approx(tops, rel=2e-3)
    short = on_the_bed("rod" if model == "rod" else "catenary") | {"time": {"duration": 8.0, "step": 0.0125}}
    theirs = in_motion(hybrid.validate_scene(short), of, [key])
    np.testing.assert_allclose(ours.derivatives, theirs.derivatives, rtol=0.05)
    assert (ours.errors < 1e-6 * np.abs(ours.derivatives)).all()


@pytest.mark.parametrize("form", [lambda scene: scene, in_full], ids=["cable", "named"])
def test_a_replay_has_the_model_that_was_chosen(form):
    """Of a scene that names none, with other numbers."""
    section = {"length": 40.0, "mass": 5.0, "axial_stiffness": 1e8, "bending_stiffness": 10.0}
    made = heaved(cable={"sections": [section]}, time={"duration": 0.2, "step": 0.1})
    course = course_of(form(hybrid.validate_scene(made)))
    del made["model"]
    (line,) = course.network(form(hybrid.validate_scene(made))).lines.values()
    assert line.chosen_model.kind == "catenary"


def test_peaks_of_a_named_line_are_those_of_all_its_nodes():
    """As of a cable: with three outputs along it the bend at the touchdown was none of them."""
    more = {"time": {"duration": 0.5, "step": 0.05}, "output": {"points": 3, "every": 0.1}}
    cable, found = hybrid.validate_scene(on_the_bed("rod") | more), []
    for scene, of in ((cable, "max curvature"), (in_full(cable), "max cable/curvature")):
        found.append(Motion(scene, [parse_wanted(scene, of, moves=True)], course_of(scene), smooth=True).values[0])
    assert found[1] == pytest.approx(found[0], rel=1e-9) and found[0] > 0.0


def test_cells_of_a_layer_are_those_of_the_run_that_laid_them():
    """A bend at a clamp whose cells a pre-run lays: the derivative by the stiffness, of every run on the same nodes."""
    scene = on_the_bed("rod") | {"resolution": {"cells_per_layer": 3}}
    del scene["mesh"]
    scene["ends"]["end"] |= {"kind": "clamped", "tangent": [0.5, 0, 0.9]}
    scene = hybrid.validate_scene(scene)
    course = course_of(scene)
    with hybrid.run(scene) as asked, replay(scene, course) as again:
        np.testing.assert_allclose(asked.mesh[0].s, again.lines["cable"].mesh[0].s, atol=1e-9)
    found = in_motion(scene, ["max curvature@end"], ["cable.sections[0].bending_stiffness"])
    assert found.derivatives[0, 0] * 2e3 / found.values[0] == pytest.approx(-0.5, abs=0.1)  # as sqrt(T/EI)
    assert found.errors[0, 0] < 1e-4 * abs(found.derivatives[0, 0])


def test_what_is_refused():
    scene = heaved()
    key = "cable.sections[0].mass"
    for of, words in (("tension@start", "max, min, mean, std, last or t=TIME"), ("max tensoin@0", "one of position"),
                      ("t=99 tension@end", "a time between 0 and"), ("t=one tension@end", "a time between 0 and"),
                      ("t=1 tension", "a place"),
                      ("std tension", "a place"), ("max tension.x@0", "no components"),
                      ("max reaction_end.z@end", "one value"), ("max tension@99", "between 0 and 40 m")):  # fmt: skip
        with pytest.raises(hybrid.SceneError, match=words):
            hybrid.sensitivity(scene, [of], [key], motion=True)


def test_steps_that_are_divided_are_no_neighbours(monkeypatch):
    """Runs whose steps are others give no derivative, but say which number did it."""
    from hybrid.designs import in_motion as room

    scene, plain = hybrid.validate_scene(heaved()), room.replay

    def shorter(asked, course, *more):
        part = 0.5 if asked.cable.sections[0].mass > 5.0 else 1.0
        lines = {key: replace(x, step=part * x.step) for key, x in course.lines.items()}
        return plain(asked, course._replace(lines=lines), *more)

    def unfollowed(*_):
        raise Unfollowed("nothing")

    monkeypatch.setattr(room, "replay", shorter)
    monkeypatch.setattr(room, "by_tangents", unfollowed)
    with pytest.raises(hybrid.ComputationError, match=r"cable.sections\[0\].mass: a step was divided"):
        in_motion(scene, ["max tension@start"], ["cable.sections[0].mass"])


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "line.yaml").write_text(hybrid.scene_text(hybrid.validate_scene(heaved())))
    asked = ["sensitivity", "line.yaml", "--motion", "--by", "environment.gravity", "--json"]
    told = CliRunner().invoke(app, asked)
    assert told.exit_code == 0, told.output
    rows = [x for x in map(json.loads, told.output.splitlines()) if "elasticity" in x]
    assert [x["of"] for x in rows] == ["max tension@start", "max tension@end"]
    assert rows[0]["derivative"] == pytest.approx(260.0, rel=1e-3)


def test_where_the_origin_is_does_not_matter():
    """A step is a part of the length, not of a coordinate: 5 km away both ends' derivatives are what they were."""
    keys = ["ends.start.position[0]", "ends.end.position[0]"]
    found = []
    for x in (0.0, 5000.0):
        scene = on_the_bed()
        for end in scene["ends"].values():
            end["position"][0] += x
        found.append(in_motion(hybrid.validate_scene(scene), ["max tension@end"], keys).derivatives[:, 0])
    assert found[1] == pytest.approx(found[0], rel=1e-5)
    assert found[0][0] == pytest.approx(-found[0][1], rel=2e-3)  # moved by both nothing changes


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 12, 15])
def test_forces_at_an_anchor_on_the_bed_against_full_runs(seed):
    """Where these say them to 1e-5; of 40 bench/test_bench_tangents.py tells."""
    _, tables, key = scene_at_anchor(seed)
    scene = hybrid.validate_scene(tables)
    number, d = number_of(scene, key), 1e-5 * (scene.length if key.endswith("]") else number_of(scene, key))
    (ours,) = in_motion(scene, ["last tension@start", "last reaction_start.z"], [key]).derivatives
    with (
        hybrid.run(changed_scene(scene, key, number + d)) as more,
        hybrid.run(changed_scene(scene, key, number - d)) as less,
    ):
        ends = [np.array([x.tension[-1, 0], x.reaction_start[-1, 2]]) for x in (more, less)]
    np.testing.assert_allclose(ours, (ends[0] - ends[1]) / (2.0 * d), rtol=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("seed", [13, 19, 25, 39])
def test_forces_at_an_anchor_on_the_bed_where_contact_has_kinks(seed):
    """Steps that Newton leaves at 1e-9 end on the wrong side of a kink: these were 2e-4 to 0.13 off.

    Against runs whose steps are solved to rounding; with friction (19, 39) of differences.
    """
    _, tables, key = scene_at_anchor(seed)
    scene, of = hybrid.validate_scene(tables), ["last tension@start", "last reaction_start.z", "last contact_force"]
    number, wanted, course = number_of(scene, key), [parse_wanted(scene, x, moves=True) for x in of], course_of(scene)
    more, less = (Motion(changed_scene(scene, key, number * x), wanted, course).values for x in (1 + 1e-6, 1 - 1e-6))
    ours, errors = (x[0] for x in in_motion(scene, of, [key])[1:3])
    theirs = (more - less) / (2e-6 * number)
    assert (np.abs(ours - theirs) <= np.maximum(1e-5 * np.abs(theirs), errors)).all()
    assert (errors <= 3e-3 * np.abs(theirs)).all()


@pytest.mark.long
def test_the_error_is_that_of_one_side():
    """Near the bed a force answers unevenly to the height of an anchor: tangents to either side differ by as much."""
    _, tables, key = scene_at_anchor(34)
    found = in_motion(hybrid.validate_scene(tables), ["last reaction_start.z"], [key])
    assert found.derivatives[0, 0] == pytest.approx(3050.66, rel=3e-5)  # of runs that are solved to round-off
    assert found.errors[0, 0] == pytest.approx(0.2, rel=0.5)


@pytest.mark.long
def test_a_run_that_is_pushed_out_of_its_plane_has_no_derivative():
    """Tangents stay in the plane, where the line would not: they were 0.3 to 0.8 % off the run, stated as 5e-7."""
    _, tables, key = scene_at_anchor(17)
    with pytest.raises(hybrid.ComputationError, match=r"leaves the plane(.|\n)*goes by that push"):
        in_motion(hybrid.validate_scene(tables), ["last tension@start"], [key])


@pytest.mark.parametrize("key", ["time.step", "time.duration", "mesh.cells"])
def test_how_a_scene_is_computed_is_no_number_of_it(key):
    with pytest.raises(hybrid.SceneError, match=r"a number of what is computed"):
        in_motion(hybrid.validate_scene(on_the_bed()), ["max tension@end"], [key])


# --- tangents along the steps of runs of several lines, against one cable and against differences of runs ---

SECTION = {
    "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2e7, "bending_stiffness": 2e3, "torsional_stiffness": 2e3,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip
HEAVE = {"heave": {"amplitude": 1.0, "period": 8.0}, "ramp": 4.0}
WAVES = {"kind": "jonswap", "significant_height": 3, "peak_period": 9, "seed": 1, "components": 12}
OUTPUT = {"time": {"duration": 5.0, "step": 0.05}, "output": {"every": 0.25, "points": 21}}


def water(waves: bool, bed: bool = False) -> dict[str, Any]:
    fluid = {"density": 1025, "surface": 10} | ({"waves": WAVES} if waves else {})
    return {"fluid": fluid} | ({"seabed": {"z": -60.0, "stiffness": 5e3, "damping": 500.0}} if bed else {})


def line(start: str, end: str, length: float, model: str) -> dict[str, Any]:
    sections = [SECTION | {"length": length}]
    return {"start": start, "end": end, "model": model, "mesh": {"cells": 12}, "sections": sections}


def at_a_point(model: str = "catenary", waves: bool = False) -> dict[str, Any]:
    """Three lines at a free point with mass and buoyancy, one of which is heaved at its end."""
    points = {
        "low": {"position": [0, 0, -60.0]}, "far": {"position": [60, 110, -60.0]},
        "top": {"position": [90, 0, -1.0], "motion": HEAVE},
        "mid": {"kind": "free", "initial_guess": [50, 30, -40], "mass": 100.0, "volume": 1.5},
    }  # fmt: skip
    lines = {
        "a": line("low", "mid", 70.0, model),
        "b": line("mid", "top", 70.0, model),
        "c": line("far", "mid", 100.0, "catenary"),
        "alone": line("low", "top", 120.0, "catenary"),
    }
    return {"environment": water(waves), "points": points, "lines": lines} | copy.deepcopy(OUTPUT)


def at_a_body(model: str = "catenary", waves: bool = False) -> dict[str, Any]:
    """The same with a buoy of six degrees of freedom in place of the point."""
    tables = at_a_point(model, waves)
    del tables["points"]["mid"], tables["lines"]["alone"]
    for k, place in enumerate(([-1, 0, -0.5], [1, 0.5, 0.5], [0, 1, -0.5])):
        tables["points"][f"f{k}"] = {"body": "buoy", "place": place}
    tables["lines"]["a"]["end"], tables["lines"]["b"]["start"], tables["lines"]["c"]["end"] = "f0", "f1", "f2"
    damping = [[500.0 * (i == k) for k in range(6)] for i in range(6)]
    tables["bodies"] = {
        "buoy": {
            "kind": "free", "initial_guess": [50, 30, -30], "mass": 4000.0, "inertia": [3000.0, 3500.0, 4000.0],
            "centre": [0, 0, -0.2], "volume": 5.0, "centre_of_buoyancy": [0, 0, 0.3], "damping": damping,
        }
    }  # fmt: skip
    return tables


def asked_of(tables: dict[str, Any], of: list[str], keys: list[str]) -> tuple[Any, ...]:
    scene = as_scene(tables)
    numbers = {key: number_of(scene, key) for key in keys}
    sizes = {key: size_of(scene, key, x) for key, x in numbers.items()}
    return scene, [parse_wanted(scene, x, moves=True) for x in of], course_of(scene), numbers, sizes


def agree(tables: dict[str, Any], of: list[str], keys: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """To 1e-5 of differences of runs, half of them to 1e-6, each by the best of some steps: waves make kinks in larger

    ones, rounding shows in smaller ones.  What answers less than a thousandth, in parts by parts, is compared with that.
    """
    asked = asked_of(tables, of, keys)
    ours, off = by_tangents(*asked), np.full((len(keys), len(of)), np.inf)
    floor = 1e-3 * np.abs(ours.values) / np.array(list(asked[-1].values()))[:, None]
    for part in (1e-3, 1e-5, 1e-6, 1e-4, 3e-4, 1e-7, 3e-5, 3e-6, 3e-7):
        monkeypatch.setattr(way, "STEP_PARTS", (part, 2.0 * part))
        theirs = by_differences(*asked)
        np.testing.assert_allclose(ours.values, theirs.values, rtol=1e-12)
        whole = np.maximum(np.abs(theirs.derivatives), floor)
        off = np.minimum(off, np.abs(ours.derivatives - theirs.derivatives) / whole)
        if (off < 1e-5).all():
            break
    print(np.sort(off.ravel())[[0, off.size // 2, -3, -2, -1]])
    assert (off < 1e-5).all() and np.median(off) < 1e-6, off
    assert (np.abs(ours.derivatives) > floor).mean() > 0.5  # else it would say nothing


NUMBERS = ["lines.a.sections[0].mass", "lines.b.sections[0].drag.normal", "lines.c.sections[0].length"]
NUMBERS += ["points.top.motion.heave.amplitude"]
RESULTS = [
    "max b/tension@end",
    "last a/tension@30",
    "std b/position.z@37",
    "last c/position.y@92",
    "t=3.31 c/tension@7",
]


@pytest.mark.long
@pytest.mark.parametrize("waves", [False, True])
@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_lines_at_a_point(model: str, waves: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = [*NUMBERS, "points.mid.mass", "points.mid.volume", *([] if waves else ["environment.gravity"])]
    agree(at_a_point(model, waves), [*RESULTS, "last alone/tension@55"], keys, monkeypatch)


@pytest.mark.long
@pytest.mark.parametrize("waves", [False, True])
@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_lines_at_a_body(model: str, waves: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    of_body = [f"bodies.buoy.{x}" for x in ("mass", "inertia[1]", "volume", "centre[2]", "damping[4][4]")]
    agree(at_a_body(model, waves), RESULTS, [*NUMBERS, *of_body, "points.f0.place[0]"], monkeypatch)


@pytest.mark.long  # two kernels of its own: 55 s
def test_what_is_not_followed_is_left_to_differences_and_said() -> None:
    tables, key, of = at_a_point(), "points.mid.mass", ["last a/tension@30"]
    tables["time"]["duration"] = 0.5
    assert in_motion(as_scene(tables), of, [key]).ways == (TANGENTS,)
    tables["environment"]["seabed"] = {"z": -60.0, "stiffness": 5e3, "friction": 0.5}
    assert in_motion(as_scene(tables), of, [key]).ways == (f"{DIFFERENCES}: friction of the bed",)


def test_errors_of_what_leaves_a_plane_are_not_those_of_rounding():
    scene = hybrid.validate_scene(span(time=(1.0, 0.05), output=(0.1, 21)))
    (found,) = hybrid.sensitivity(scene, ["last position.y@50"], ["ends.end.position[1]"], motion=True)
    assert found.error < 1e-3 * abs(found.derivative)


def test_the_derivative_of_an_angle_of_half_a_turn():
    section = {"length": 100, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    scene = hybrid.validate_scene(
        cable_scene(
            section,
            pinned_at(0, 0, 0),
            pinned_at(-80, 0, 0),
            model="catenary",
            mesh=20,
            time=(1.0, 0.05),
            output=(0.1, 21),
        )
    )
    (found,) = hybrid.sensitivity(scene, ["last phi@50"], ["ends.end.position[1]"], motion=True)
    assert found.derivative == pytest.approx(-1 / 80, rel=1e-5)


def test_lines_that_do_not_stretch_have_derivatives_in_motion():
    """As those that hardly do: what the corrections of the rest leave over of lengths is no acceleration."""
    found, by = [], ["ends.start.position[0]", "cable.sections[0].mass"]
    for more in ({}, {"axial_stiffness": 1e9}):
        end = pinned_at(80, 0, 0, motion={"heave": {"amplitude": 0.5, "period": 8}, "ramp": 16})
        tables = cable_scene({"length": 120, "mass": 10} | more, pinned_at(0, 0, -60), end, model="catenary", mesh=8,
                             time=(0.5, 0.1), output=(0.1, 11))  # fmt: skip
        slopes = hybrid.sensitivity(as_scene(tables), ["last tension@end", "last position.z@60"], by, motion=True)
        found.append([x.derivative for x in slopes])
    assert found[0] == pytest.approx(found[1], rel=3e-3, abs=1e-4)


def test_derivatives_by_coordinates_do_not_go_by_the_origin():
    def slopes(Y):
        section = {"mass": 10, "diameter": 0.05, "axial_stiffness": 1e7, "drag": {"normal": 1.2}}
        surge = {"surge": {"amplitude": 0.05, "period": 8}, "heave": {"amplitude": 0.05, "period": 8}, "ramp": 16}
        points = {
            "east": {"position": [150, Y, -100]}, "west": {"position": [-150, Y, -100]},
            "vessel": {"position": [60, Y, 20], "motion": surge},
            "buoy": {"initial_guess": [0, Y, 5], "mass": 1000, "volume": 20, "drag_area": 4, "added_mass": 5000},
        }  # fmt: skip
        legs = {name: line_between(name, "buoy", section | {"length": 185}, mesh=12) for name in ("east", "west")}
        lines = legs | {"hose": line_between("buoy", "vessel", section | {"length": 100}, mesh=12)}
        fluid = {"density": 1025, "surface": 30, "current": [0.3, 0.1, 0]}
        tables = network_scene(points, lines, fluid=fluid, time=(2, 0.1), output=(0.1, 11))
        wanted = ["last east/tension@end", "last hose/position.y@40"]
        return hybrid.sensitivity(as_scene(tables), wanted, ["points.vessel.position[1]"], motion=True)

    here, far = slopes(0.0), slopes(6e6)
    assert far[0].derivative == pytest.approx(here[0].derivative, rel=2e-5)
    assert far[1].error < 1e-2 * abs(far[1].derivative)
