"""Ends that move, or are held, farther from each other than what joins them reaches: length, distance and time are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError, SceneError
from hybrid.model.network import build_network
from hybrid.model.plausibility import implausible
from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_tables import Harmonic, Motion, Travel, farthest, shift
from hybrid.scene.read import one_line
from hybrid.scene.schema import longest_stretched, reachable_obstacles
from tests.scenes import cable_scene, network_scene, pinned_at

ROPE = {"length": 105.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 1e7}
CHAIN = {"length": 105.0, "mass": 100.0, "diameter": 0.076, "axial_stiffness": 5e8}
SURGE = {"surge": {"amplitude": 15.0, "period": 10.0}, "ramp": 10.0}


def moved(section: dict[str, Any], motion: dict[str, Any], **end: Any) -> hybrid.Scene:
    """A line to an end 100 m away that moves."""
    there = {"kind": "pinned", "position": [100, 0, 0], "motion": motion} | end
    return hybrid.validate_scene(cable_scene(section, pinned_at(0, 0, 0), there, model="catenary", time=(20.0, 0.02)))


def test_the_way_of_an_end_is_that_of_its_motion() -> None:
    motion = Motion(
        surge=(Harmonic(amplitude=2, period=7, phase=30), Harmonic(amplitude=0.5, period=3)),
        heave=Harmonic(amplitude=1, period=5), travel=Travel(by=(3, 1, 0), over=4, begin=2), ramp=6,
    )  # fmt: skip
    exact = EndMotion(motion, [0.0, 0.0, 0.0])
    for t in (0.0, 1.7, 5.0, 13.1):
        np.testing.assert_allclose(shift(motion, t), exact.at_time(t)[0], atol=1e-12)


def test_the_largest_distance_is_found_and_when() -> None:
    heave = Motion(heave=Harmonic(amplitude=3, period=9), ramp=9)
    distance, t = farthest(((0, 0, 0), (0, 0, 50)), (None, heave), 60.0)
    assert distance == pytest.approx(53.0, abs=0.02) and t % 9.0 == pytest.approx(2.25, abs=0.2)


@pytest.mark.parametrize(("amplitude", "told"), [(15.0, True), (9.5, False)])
def test_a_harmonic_motion_beyond_reach_is_refused_with_length_distance_and_time(amplitude: float, told: bool) -> None:
    """At 9.5 m the rope stretches by 4.3 %, which it bears."""
    motion = SURGE | {"surge": {"amplitude": amplitude, "period": 10.0}}
    if not told:
        moved(ROPE, motion)
        return
    with pytest.raises(SceneError, match=r"ends\.end\.motion\.surge") as refused:
        moved(ROPE, motion)
    for words in ("at t = 12.4", "114.99", "the cable, 105 m long, is too short", "a smaller amplitude of surge"):
        assert words in str(refused.value)


def test_an_end_that_is_let_go_or_paid_out_may_go_anywhere() -> None:
    moved(ROPE, SURGE, release_at={"time": 3.0})
    moved(ROPE, SURGE, payout={"rate": 1.0, "ramp": 1.0, "longest": 140.0})


def test_a_chain_that_its_motion_would_break_is_implausible() -> None:
    """2.4 % at 107.5 m, below the 5 % that no check refuses."""
    (note,) = [x for x in implausible(one_line(moved(CHAIN, SURGE | {"surge": {"amplitude": 7.5, "period": 10.0}})))]
    assert "ends that are 107.498 m apart at t = 12.46 s" in note.what and "by 2.38%" in note.what


def meeting(apart: float, **motion: Any) -> dict[str, Any]:
    """Two lines of 150 m between held points, joined at a free one."""
    section = ROPE | {"length": 150.0}
    line = {"sections": [section], "model": "catenary"}
    return network_scene(
        {"a": {"position": [0, 0, 0]}, "b": {"position": [apart, 0, 0], **motion},
         "m": {"mass": 100.0, "initial_guess": [150, 0, -30]}},
        {"x": {"start": "a", "end": "m"} | line, "y": {"start": "m", "end": "b"} | line}, time=(30.0, 0.02)
    )  # fmt: skip


def test_two_lines_that_cannot_meet_are_refused_with_length_and_distance() -> None:
    for scene in (meeting(320.0), {k: x for k, x in meeting(320.0).items() if k != "time"}):
        with pytest.raises(
            SceneError,
            match=r"points\.b[^.](?s:.*)320 m from point a(?s:.*)at most 315 m from point a, as far as lines x, y of 300 m",
        ):
            hybrid.static(scene)


def test_two_lines_that_a_motion_draws_apart_are_refused_with_the_time() -> None:
    motion = {"surge": {"amplitude": 40.0, "period": 20.0}, "ramp": 20.0}
    with pytest.raises(SceneError, match=r"points\.b\.motion\.surge(?s:.*)at t = 24\.9\d* s, 329\.99"):
        hybrid.run(meeting(290.0, motion=motion))


def test_a_run_that_a_record_tears_says_how_far_its_ends_are_apart(tmp_path: Path) -> None:
    """What a file does is not followed before the run: it stops, and names both lengths."""
    t = np.linspace(0.0, 20.0, 401)
    rows = np.column_stack([t, 100.0 + 15.0 * np.sin(t / 5.0) ** 3, 0.0 * t, 0.0 * t])
    np.savetxt(tmp_path / "move.csv", rows, delimiter=",", header="t,x,y,z", comments="")
    scene = moved(ROPE, {"file": str(tmp_path / "move.csv")})
    with pytest.raises(ComputationError, match=r"its ends are 110\.\d* m apart, and it is 105 m long: too short"):
        hybrid.run(scene)


# --- Which obstacles a line can reach: an upper bound, and no bound where nobody knows one ---

Tables = dict[str, Any]
SECTION = {"length": 110.0, "mass": 2.0, "diameter": 0.04, "axial_stiffness": 2e6, "max_strain": 0.02}
STILL = {"time": {"duration": 1.0, "step": 0.05}}
SPINS = {"spin": {"rate": 1.0, "ramp": 1.0}}


def scene(distance: float = 30.0, *, start: Tables | None = None, end: Tables | None = None, **obstacle: Any) -> Any:
    """A line of 110 m, 112.2 m at most, over 100 m, and a ball of 1 m that is so far (m) from the middle of its span."""
    first, last = {"kind": "pinned", "position": [0, 0, 0]}, {"kind": "pinned", "position": [100, 0, 0]}
    ball = {"at": [50, 0, distance]} | ({"kind": "sphere", "radius": 1.0} if "kind" not in obstacle else {}) | obstacle
    tables = {"cable": {"sections": [SECTION]}, "ends": {"start": first | (start or {}), "end": last | (end or {})}}
    tables |= {"model": "catenary", "initial": "equilibrium", "obstacles": {"ball": ball}}
    return hybrid.validate_scene(tables | STILL)


def reaches(asked: Any) -> bool:
    (name,) = asked.lines
    return bool(reachable_obstacles(asked.scene_of(name)))


HALF_WAY = np.sqrt(56.1**2 - 50.0**2)  # m, as far as the middle of the line comes from its span


def test_a_line_reaches_as_far_as_it_may_be_stretched() -> None:
    """Its ellipse, with less than 2 m to spare, its own thickness, and how far ends and obstacles move."""
    assert longest_stretched(scene().asked_scene("")) == pytest.approx(112.2)
    assert reaches(scene(HALF_WAY + 1.0))
    assert not reaches(scene(HALF_WAY + 3.0))
    heave = {"motion": {"heave": {"amplitude": 4.0, "period": 9.0}, "ramp": 9.0}}
    assert reaches(scene(HALF_WAY + 4.0, **heave))
    assert not reaches(scene(HALF_WAY + 7.0, **heave))
    assert reaches(scene(HALF_WAY + 5.0, end=heave))
    assert not reaches(scene(200.0, end=heave, **heave))
    for turns in (SPINS, {"bearing": {"inertia": 1.0}}):
        assert not reaches(scene(200.0, kind="cylinder", axis=[0, 1, 0], radius=1, length=5, **turns))
    assert reaches(scene(-20.0, kind="plane", normal=[0, 0, 1]))
    assert not reaches(scene(-40.0, kind="plane", normal=[0, 0, 1]))


def test_points_of_a_stretched_line_are_within_its_reach() -> None:
    """A ball at any place of an ellipse around the ends is reached."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        way = rng.uniform(0.0, 2.0 * np.pi)
        x, y = 50.0 + 56.1 * np.cos(way), HALF_WAY * np.sin(way)
        assert reaches(scene(at=[x, y, 0.0], radius=1e-3)), (x, y)


# What is so that nobody knows how far the line, or the obstacle, comes.
UNKNOWN: dict[str, Tables] = {
    "a tow": {x: {"motion": {"velocity": [1, 0, 0], "ramp": 1.0}} for x in ("start", "end")},
    "a release": {"end": {"release_at": {"time": 0.5}}, "start": {"release_at": {"time": 0.5}}},
    "payout": {"end": {"payout": {"rate": 1.0, "ramp": 1.0, "longest": 120}}},
    "set from outside": {"from_outside": True},
    "a tow of the obstacle": {"motion": {"velocity": [1, 0, 0], "ramp": 1.0}},
    "it turns": {"kind": "box", "size": [1, 1, 1], "rounding": 0.1,
                 "motion": {"yaw": {"amplitude": 4.0, "period": 9.0}, "ramp": 9.0}},
}  # fmt: skip


@pytest.mark.parametrize("what", UNKNOWN)
def test_where_no_bound_is_known_every_obstacle_is_reached(what: str) -> None:
    assert reaches(scene(at=[5000, 0, 0], **UNKNOWN[what]))


def test_an_end_that_holds_bounds_a_line_by_its_length() -> None:
    """Let go at the other one."""
    free = {"release_at": {"time": 0.5}}
    assert reaches(scene(at=[-112.0, 0, 0], end=free))
    assert not reaches(scene(at=[-114.0, 0, 0], end=free))


def test_a_body_that_turns_swings_the_end_of_a_line() -> None:
    """Farther than its own motion says."""
    for motion in ({"motion": {"roll": {"amplitude": 30.0, "period": 9.0}, "ramp": 9.0}}, {}):
        tables = STILL | {
            "bodies": {"hull": {"kind": "fixed", "position": [0, 0, -50]} | motion},
            "obstacles": {"ball": {"kind": "sphere", "at": [30, 45, 0], "radius": 1.0}},
            "points": {"a": {"body": "hull", "place": [0, 0, 50]}, "b": {"position": [100, 0, 0]}},
            "lines": {"line": {"start": "a", "end": "b", "sections": [SECTION], "model": "catenary"}},
        }  # fmt: skip
        assert reaches(hybrid.validate_scene(tables)) == bool(motion)


def lines(apart: float, **second: Any) -> hybrid.Scene:
    """Two lines that reach HALF_WAY from their spans, which lie so far (m) apart, and touch if they can."""
    points = {f"{x}{k}": {"position": [at, k * apart, 0.0]} for x, at in (("a", 0.0), ("b", 100.0)) for k in (0, 1)}
    points["b1"] |= second
    section = {"sections": [SECTION], "model": "catenary"}
    each = {f"line{k}": section | {"start": f"a{k}", "end": f"b{k}"} for k in (0, 1)}
    return hybrid.validate_scene(STILL | {"points": points, "lines": each, "contact": {}})


@pytest.mark.parametrize(
    ("second", "meet"),
    [
        ({}, False),
        ({"motion": {"sway": {"amplitude": 9.0, "period": 9.0}, "ramp": 9.0}}, True),
        ({"motion": {"velocity": [1, 0, 0], "ramp": 1.0}}, True),
        ({"break_at": {"time": 0.5}}, True),
    ],
)
def test_lines_that_cannot_reach_each_other_are_no_pair(second: dict[str, Any], meet: bool) -> None:
    """Of all lines; a pair that is named stays one, and where no bound is known, as of a tow, they may meet."""
    near, far = lines(2.0 * HALF_WAY + 1.0), lines(2.0 * HALF_WAY + 5.0, **second)
    assert near.meeting_pairs == [("line0", "line1")]
    assert bool(far.meeting_pairs) == meet
    assert (build_network(far).touching is not None) == meet
    named = hybrid.validate_scene(far.model_dump(exclude_none=True) | {"contact": {"between": [["line0", "line1"]]}})
    assert named.meeting_pairs == [("line0", "line1")]


def test_a_change_that_brings_lines_into_reach_is_refused(tmp_path: Path) -> None:
    """Contact between them is not computed by the run that goes on."""
    hybrid.run(lines(2.0 * HALF_WAY + 5.0), tmp_path / "run.h5").close()
    nearer = "points.b1.motion={travel: {by: [0, -9, 0], over: 3, begin: 1}}"
    with pytest.raises(SceneError, match="line0 and line1, which reach each other then"):
        hybrid.resume(tmp_path / "run.h5", until=5.0, start=1.0, settings=[nearer])
