"""Which obstacles a line can reach: an upper bound, and no bound where nobody knows one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.scene.schema import longest_stretched, reachable_obstacles

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
