"""Several lines in motion: energies close, files hold every line, what is computed beside what."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_system_saving as saving
from test_system_saving import SEA, spar

import hybrid
from hybrid.errors import ResultError, SceneError
from hybrid.kernels.state import books
from hybrid.model.plan import SAME_STOP, falls_on
from hybrid.simulation import progress, run_line
from hybrid.simulation import run as run_module
from tests.inside import calls_of
from tests.scenes import line_between, network_scene

TIME = {"duration": 12.0, "step": 0.05}


def mooring(**tables: Any) -> dict[str, Any]:
    """Two legs from the seabed to a float, and a hose with bending from there to a vessel that heaves."""
    scene = saving.mooring(environment=SEA | {"seabed": {"z": -100, "stiffness": 5000}}, time=TIME)
    del scene["points"]["float"]["force"]
    for leg in ("west", "east"):
        scene["lines"][leg]["sections"] = [saving.LEG | {"added_mass": {"normal": 1.0}}]
    scene["lines"]["hose"]["sections"] = [saving.HOSE | {"drag": {"normal": 1.1}, "max_tension": 3000}]
    return scene | tables


@pytest.fixture(scope="module")
def moved() -> hybrid.Result:
    return hybrid.run(mooring())


def test_each_line_has_its_own_part_of_its_limits(moved: hybrid.Result) -> None:
    with pytest.raises(hybrid.ResultError, match=r"result\.lines\['\w+'\]\.utilisation\(\)"):
        moved.utilisation()


def test_every_line_and_point_is_in_the_result(moved: hybrid.Result) -> None:
    assert list(moved.lines) == ["west", "east", "hose"]
    at = moved["points/float/position"]
    for name, node in (("west", -1), ("east", 0), ("hose", 0)):
        line = moved.lines[name]
        assert line.status == "complete" and line.title == f"float, line {name}"
        assert np.abs(line.position[:, node] - at).max() < 1e-12
    hose = moved.lines["hose"]
    assert np.abs(hose.position[:, -1] - moved["points/vessel/position"]).max() < 1e-12
    assert np.abs(hose.reaction_end + moved["points/vessel/force"]).max() < 1e-9 * np.abs(hose.reaction_end).max()
    assert "bending_moment" in hose and "bending_moment" not in moved.lines["west"]
    assert not any(e.kind == "stability not judged" for e in moved.events)
    with pytest.raises(KeyError, match="west, east, hose"):
        moved.lines["north"]
    with pytest.raises(ResultError, match="several lines"):
        moved["tension"]


def test_a_force_on_a_knot_is_no_force_of_the_line_that_carries_it() -> None:
    rope = {"length": 10, "mass": 1.0, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 50}
    knot = {"initial_guess": [7, 0, -4], "force": {"value": [0, 0, -500]}}
    for more in ({}, {"mass": 0.1}):  # of a knot, and of one with a mass, whose forces are continued from the cells
        found = hybrid.static(
            {
                "points": {"a": {"position": [0, 0, 0]}, "b": {"position": [15, 0, 0]}, "knot": knot | more},
                "lines": {
                    "left": {"start": "a", "end": "knot", "sections": [rope], "model": "rod"},
                    "right": {"start": "knot", "end": "b", "sections": [rope], "model": "rod"},
                },
            }
        )
        left, right = found.lines["left"], found.lines["right"]
        pull = -left.reaction_end[0] - right.reaction_start[0]
        assert np.abs(pull - [0, 0, 500 + 9.81 * more.get("mass", 0.0)]).max() < 1e-3, pull
        assert np.isclose(left.tension[0, -1], right.tension[0, 0], rtol=1e-4)


def test_end_forces_at_a_free_point_are_those_of_the_lines_alone() -> None:
    """Together they bear weight, buoyancy, drag and inertia of the float, whichever line carries these."""
    calm = {"fluid": {"density": 1025, "current": [0.4, 0.1, 0], "surface": 0.0}, "gravity": 9.81}
    sea = calm | {"seabed": {"z": -100, "stiffness": 5000}}
    result = hybrid.run(mooring(environment=sea, time={"duration": 8.0, "step": 0.05}, output={"every": 0.05}))
    at = (("west", "end"), ("east", "start"), ("hose", "start"))
    total = sum(result.lines[x][f"reaction_{end}"] for x, end in at)
    v = result["points/float/velocity"]
    u = np.array([0.4, 0.1, 0.0]) - v
    loads = 0.5 * 1025 * 3 * np.linalg.norm(u, axis=1)[:, None] * u
    loads += [0, 0, (6 * 1025 - 900) * 9.81] - 900 * np.gradient(v, 0.05, axis=0)
    largest = max(np.abs(line.tension).max() for line in result.lines.values())
    left, swing = np.abs(total - loads), float(np.ptp(total, axis=0).max())
    assert left[0].max() < 2e-5 * largest and swing > 80.0
    assert left[1:-1].max() < 0.02 * swing
    for name, end in at:
        line = result.lines[name]
        force = np.linalg.norm(line[f"reaction_{end}"], axis=1)
        assert force == pytest.approx(line.tension[:, -1 if end == "end" else 0], rel=1e-3)
        assert line[f"steps/end_force_{end}"] == pytest.approx(force[1:], rel=1e-6)


def test_chains_on_the_seabed_bear_what_they_weigh() -> None:
    """A float on two chains: what the anchors and the bed bear is the weight less the lift of the float, to 1e-6."""
    chain = {"length": 190, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 1e7}
    tables = network_scene(
        {"west": {"position": [-150, 0, -100]}, "east": {"position": [150, 10, -100]},
         "float": {"kind": "free", "initial_guess": [10, 0, -20], "mass": 900, "volume": 3.5}},
        {"west": line_between("west", "float", chain, mesh=60), "east": line_between("float", "east", chain, mesh=60)},
        fluid={"density": 1025}, seabed={"z": -100, "stiffness": 5000}
    )  # fmt: skip
    result = hybrid.static(tables)
    assert all(line.grounded_length[-1] > 20.0 for line in result.lines.values())
    g = 9.81
    weight = 2 * 190 * g * (20.0 - 1025 * np.pi / 4 * 0.05**2) + g * (900 - 1025 * 3.5)
    borne = -sum(result[f"points/{x}/force"][-1, 2] for x in ("west", "east"))
    contact = sum(float(line.contact_force[-1]) for line in result.lines.values())
    assert abs(borne + contact - weight) < 1e-6 * weight
    level = [result[f"points/{x}/force"][-1, :2] for x in ("west", "east")]
    assert np.abs(level[0] + level[1]).max() < 1e-6 * np.abs(level[0]).max()


def test_a_force_on_a_point_that_is_let_go_ends_where_it_says() -> None:
    """A step ends where the force does; then the point accelerates by what held it."""
    tables = mooring(time={"duration": 3.0, "step": 0.05}, output={"every": 0.25})
    tables["points"]["float"] |= {"force": {"value": [0, 3000, 0], "until": 1.13}}
    result = hybrid.run(tables)
    assert np.abs(result.lines["west"]["steps/t"] - 1.13).min() < 1e-9
    side = result["points/float/position"][:, 1]
    assert side[0] > 1.0 and side[4] == pytest.approx(side[0], abs=0.1) and side[-1] < side[0] - 0.3


def test_end_forces_of_a_damped_rod_do_not_depend_on_which_line_carries_the_point() -> None:
    """Continued from the cells, where the rod carries the float, they have the moment of stiffness damping, too."""
    hose = {"length": 8, "mass": 5, "diameter": 0.1, "axial_stiffness": 1e6, "bending_stiffness": 2000}
    hose["damping"] = {"stiffness": 0.5}
    lines = {
        "rod": line_between("ship", "float", hose, model="rod", mesh=32),
        "leg": line_between(
            "anchor", "float", {"length": 8, "mass": 2, "axial_stiffness": 1e6}, model="catenary", mesh=8
        ),
    }
    moved = {"heave": {"amplitude": 0.5, "period": 2.0}, "ramp": 1.0}
    scene = {
        "points": {"ship": {"position": [0, 0, 0], "motion": moved}, "anchor": {"position": [12, 0, -4]},
                   "float": {"initial_guess": [6, 0, -3], "mass": 20}},
        "time": {"duration": 2.0, "step": 0.02}, "output": {"every": 0.02},
    }  # fmt: skip
    carried, alone = (hybrid.run(scene | {"lines": {x: lines[x] for x in order}}) for order in (lines, ("leg", "rod")))
    one, two = (x.lines["rod"]["reaction_end"] for x in (carried, alone))
    assert np.abs(one - two).max() < 0.01 * np.ptp(two, axis=0).max()


# --- Steps of several lines in compiled code: lines that meet nothing, and what is heard between calls ---

ROPE = {"mass": 20.0, "diameter": 0.06, "axial_stiffness": 2e7, "drag": {"normal": 1.2}}
HEAVE = {"heave": {"amplitude": 1.0, "period": 4.0}, "ramp": 4}
LEG = ROPE | {"length": 75}
MEETING = network_scene(
    {"west": {"position": [-60, 0, -50]}, "east": {"position": [60, 5, -50], "motion": HEAVE},
     "float": {"initial_guess": [0, 0, -10], "mass": 300, "volume": 1.2}},
    {"first": line_between("west", "float", LEG, mesh=12), "last": line_between("float", "east", LEG, mesh=12)},
)  # fmt: skip
# With a motion of its own that is gentler, and an anchor that moves too.
ALONE = network_scene(
    {"anchor": {"position": [0, 100, -50], "motion": {"sway": {"amplitude": 0.4, "period": 3.0}, "ramp": 3}},
     "ship": {"position": [40, 100, 0], "motion": HEAVE}},
    {"middle": line_between("anchor", "ship", ROPE | {"length": 70}, mesh=15)},
)  # fmt: skip


def scene(*parts: dict[str, Any], **tables: Any) -> dict[str, Any]:
    """Systems side by side in water; lines stand in the order of their names' places in `MEETING` and `ALONE`."""
    points = {name: point for part in parts for name, point in part["points"].items()}
    lines = {name: line for part in parts for name, line in part["lines"].items()}
    order = [name for name in ("first", "middle", "last") if name in lines]
    water = {"fluid": {"density": 1025, "current": [0.3, 0.1, 0]}}
    time = {"time": {"duration": 2.0, "step": 0.05}, "output": {"every": 0.1, "points": 7}}
    return {"environment": water, "points": points, "lines": {name: lines[name] for name in order}, **time} | tables


def test_lines_that_meet_nothing_are_as_in_a_system_of_their_own() -> None:
    """Between two lines that are joined, in the order of the scene, with books, extremes and the log of steps."""
    both, meeting, alone = (hybrid.run(x) for x in (scene(MEETING, ALONE), scene(MEETING), scene(ALONE)))
    for name, line in both.lines.items():
        other = (alone if name == "middle" else meeting).lines[name]
        for key in (
            "position",
            "velocity",
            "tension",
            "energy/kinetic",
            "work/drag",
            "work/end",
            "steps/end_force_end",
        ):
            scale = np.abs(other[key]).max()
            assert scale > 0.0 and np.abs(line[key] - other[key]).max() <= 1e-9 * scale, (name, key)
        for key, values in other.envelope.items():
            scale = np.nanmax(np.abs(values))
            assert np.allclose(line.envelope[key], values, rtol=1e-9, atol=1e-9 * scale, equal_nan=True), (name, key)
        assert [x.kind for x in line.events] == [x.kind for x in other.events]


def test_a_line_that_meets_nothing_and_fails_is_named(tmp_path: Path) -> None:
    """A slack catenary between lines that go on: the line, the time and the place are those of it alone."""
    slack = scene(ALONE)["lines"]["middle"] | {"model": "catenary", "sections": [ROPE | {"length": 52}]}
    t = np.linspace(0.0, 3.0, 601)
    rows = np.column_stack([t, 10.0 + 0.0 * t, 100.0 + 0.0 * t, 12.0 * np.sin(2.0 * np.pi * t / 1.5) ** 3])
    np.savetxt(tmp_path / "plunge.csv", rows, delimiter=",", header="t,x,y,z", comments="")
    plunge = {"file": str(tmp_path / "plunge.csv")}
    points = ALONE["points"] | {"ship": {"position": [10, 100, 0], "motion": plunge}}
    part = {"points": points, "lines": {"middle": slack}}
    found = []
    for given in (scene(part), scene(MEETING, part)):
        with pytest.raises(hybrid.ComputationError) as failed:
            hybrid.run(given)
        assert "middle" in str(failed.value)
        found.append((failed.value.outcome, failed.value.t, failed.value.s))
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_progress_is_told_whenever_outputs_are_written_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """However few steps there are between two outputs, which may cost more than steps: Ctrl-C is heard there too."""
    monkeypatch.setattr(progress, "REPORT_EVERY", 0.0)
    monkeypatch.setattr(run_line, "WAITING", 4)
    told: list[float] = []
    every = scene(MEETING, output={"every": 0.05, "points": 7})
    hybrid.run(every, progress=lambda x: told.append(x.t)).close()
    assert np.diff([0.0, *np.unique(told)]).max() < 5.5 * 0.05 and max(told) == pytest.approx(2.0)


def test_progress_is_told_between_outputs_where_python_looks_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where something may break: every so many steps, though each of them returns."""
    monkeypatch.setattr(progress, "REPORT_EVERY", 0.0)
    told: list[int] = []
    part = MEETING | {"lines": {name: x | {"break_at": {"tension": 1e9}} for name, x in MEETING["lines"].items()}}
    hybrid.run(scene(part, output={"every": 2.0, "points": 7}), progress=lambda x: told.append(x.step)).close()
    inside = [x for x in np.unique(told) if 0 < x < 40]
    assert inside and np.diff([0, *inside, 40]).max() <= run_module.LOOK


# A ship that moves and turns, with a line that is clamped to it and one that turns freely, and a buoy that is loaded by
# a force that grows until it stops, and by a moment that follows a table.
TOWED = network_scene(
    {"foot": {"position": [-60, 0, -50]}, "bow": {"body": "ship", "place": [3, 1, -2]},
     "stern": {"body": "ship", "place": [-20, 0.5, -3]}, "top": {"body": "buoy", "place": [0, 0, 1]},
     "anchor": {"position": [-20, 10, -60]}},
    {"first": line_between("foot", "top", ROPE | {"length": 75}, mesh=8),
     "last": line_between("top", "bow", ROPE | {"length": 72}, mesh=8),
     "hose": line_between("anchor", "stern", ROPE | {"length": 85, "bending_stiffness": 2e4},
                          connections={"end": {"tangent": [0.6, 0, 0.8]}}, mesh=10)},
    fluid={"density": 1025, "current": [0.3, 0.1, 0]},
    bodies={"ship": {"position": [60, 5, 0], "rotation": [5, 0, 30],
                     "motion": {"heave": {"amplitude": 1.0, "period": 4.0}, "surge": {"amplitude": 0.4, "period": 5.0},
                                "pitch": {"amplitude": 3.0, "period": 4.5}, "yaw": {"amplitude": 5.0, "period": 6.0},
                                "ramp": 2}},
            "buoy": {"initial_guess": [0, 0, -10], "mass": 300, "volume": 1.2, "inertia": [200, 200, 200],
                     "force": {"value": [300, 200, 0], "ramp": 1.0, "until": 1.5},
                     "moment": {"history": [[0, 0, 0, 0], [0.7, 80, 20, 0], [3, -50, 0, 30]]}}},
    time=(2.0, 0.05), output=(0.1, 7)
)  # fmt: skip


def in_waves() -> dict[str, Any]:
    """A body with a member through the surface, which current and waves move."""
    scene = spar()
    waves = {"kind": "regular", "height": 3, "period": 8, "ramp": 2}
    scene["environment"]["fluid"] = scene["environment"]["fluid"] | {"waves": waves}
    return scene | {"time": {"duration": 4.0, "step": 0.1}}


@pytest.mark.long
@pytest.mark.parametrize("scene, body", [(TOWED, "buoy"), (in_waves(), "spar")])
def test_bodies_are_moved_and_loaded_in_compiled_steps(
    scene: dict[str, Any], body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where Python moves and loads them, and stirs the water around their members, before every try."""
    attach, prepared = run_module.Run._attach, calls_of(monkeypatch, run_module.Run, "_prepare")

    def ask(run: Any) -> None:
        attach(run)
        run.loop.counts.asks |= books.ASK_BEFORE

    compiled = hybrid.run(scene)
    assert not prepared
    monkeypatch.setattr(run_module.Run, "_attach", ask)
    asked = hybrid.run(scene)
    assert len(prepared) >= 40
    for key in ("position", "rotation"):
        here, there = (x[f"bodies/{body}/{key}"] for x in (compiled, asked))
        assert np.ptp(there, axis=0).max() > 0.01 and np.abs(here - there).max() <= 1e-9 * np.abs(there).max(), key
    for name, line in compiled.lines.items():
        for key in ("position", "velocity", "tension", "work/end"):
            other = asked.lines[name][key]
            assert np.abs(line[key] - other).max() <= 1e-9 * np.abs(other).max() > 0.0, (name, key)


# --- stops, and what is due at them ---

STEP = 0.05


class Counted(list[float]):
    """Times that count how often one is read."""

    reads = 0

    def __getitem__(self, k):
        self.reads += 1
        return super().__getitem__(k)

    def __iter__(self):
        for k in range(len(self)):
            yield self[k]


def test_a_stop_is_a_time_but_for_round_off() -> None:
    times, near = [0.1, 0.2, 0.3], SAME_STOP * STEP
    assert all(falls_on(x + d, times, STEP) for x in times for d in (0.0, 0.9 * near, -0.9 * near))
    assert not any(falls_on(x + d, times, STEP) for x in times for d in (1.1 * near, -1.1 * near, 0.05))
    assert not falls_on(0.1, [], STEP)


def test_many_times_are_not_all_read_at_every_stop() -> None:
    """A run of hours has 100 000 outputs: what it does at each must not grow with their number."""
    times = Counted([0.1 * k for k in range(100_000)])
    assert falls_on(7654.3, times, STEP) and times.reads < 30


FLYING = {"kind": "straight", "direction": [1, 0, 0], "velocity": [1.0, 2.0, 0.5]}
LIGHT = {"length": 5.0, "mass": 1.0, "bending_stiffness": 10.0, "axial_stiffness": 1e5}
JOINED_IN_FLIGHT = network_scene(
    {name: {"kind": "free", "initial_guess": [x, 0, 0]} for name, x in (("a", 0), ("knot", 5), ("b", 10))},
    {name: line_between(*ends, LIGHT, initial=FLYING, mesh=10)
     for name, ends in {"one": ("a", "knot"), "two": ("knot", "b")}.items()},
    gravity=9.81, time=(1.0, 0.01),
)  # fmt: skip


def test_joined_lines_that_begin_with_one_velocity_fly_together() -> None:
    scene = copy.deepcopy(JOINED_IN_FLIGHT)
    scene["points"]["knot"]["mass"] = 2.0
    result = hybrid.run(scene)
    for line in result.lines.values():
        gone = line.position[-1] - line.position[0]
        assert gone == pytest.approx(np.broadcast_to([1.0, 2.0, 0.5 - 0.5 * 9.81], gone.shape), abs=1e-12)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"kind": "straight", "direction": [1, 0, 0]}, "that of the other lines that meet at point knot"),
        ({**FLYING, "velocity": [1.0, 2.0, 0.6]}, "that of the other lines that meet at point knot"),
    ],
)
def test_a_line_does_not_leave_the_lines_that_it_is_joined_to(change: dict[str, Any], expected: str) -> None:
    scene = copy.deepcopy(JOINED_IN_FLIGHT)
    scene["lines"]["two"]["initial"] = change
    with pytest.raises(SceneError, match=expected):
        hybrid.validate_scene(scene)


def test_what_turns_starts_at_rest() -> None:
    scene = copy.deepcopy(JOINED_IN_FLIGHT)
    for line, key in (("one", "end"), ("two", "start")):
        scene["lines"][line]["connections"] = {key: {"kind": "clamped", "tangent": [1, 0, 0]}}
    with pytest.raises(SceneError, match="point knot turns and starts at rest"):
        hybrid.validate_scene(scene)
