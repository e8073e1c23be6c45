"""Lines in zones that move whose ends leave the spin free: damping of their bend turns them no faster than a rod."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid


def hanging(random: np.random.Generator) -> dict[str, Any]:
    """A cable that hangs from a moving pin in a current that turns with depth; SI units."""
    length, mass = random.uniform(15.0, 60.0), random.uniform(0.3, 2.0)
    width = np.sqrt(4.0 * random.uniform(0.2, 0.7) * mass / (1025.0 * np.pi))
    period = random.uniform(5.0, 14.0)
    top = random.uniform(-0.25, 0.25, size=2)
    duration = 1.7 * period
    section = {
        "length": length, "mass": mass, "diameter": float(width), "axial_stiffness": 3e5,
        "bending_stiffness": float(np.exp(random.uniform(np.log(0.5), np.log(50.0)))),
        "drag": {"normal": 1.1, "tangential": 0.02}, "added_mass": {"normal": 1.0},
        "damping": {"mass": 0.05, "stiffness": 3e-4},
    }  # fmt: skip
    profile = [{"z": 0.0, "velocity": [*top, 0.0]}, {"z": -length, "velocity": [*(0.3 * top[::-1]), 0.0]}]
    surge = {"amplitude": random.uniform(0.1, 0.6), "period": period, "phase": random.uniform(0.0, 360.0)}
    return {
        "environment": {"fluid": {"density": 1025, "current": profile}}, "cable": {"sections": [section]},
        "ends": {
            "start": {"kind": "pinned", "position": [0.0, 0.0, 0.0], "motion": {"ramp": 1.8 * period, "surge": surge}},
            "end": {"kind": "free"},
        },
        "initial": "equilibrium", "mesh": {"cells": 80, "ratio": 0.1},
        "time": {"duration": duration, "step": duration / 200.0}, "output": {"every": duration / 20.0, "points": 41},
    }  # fmt: skip


@pytest.mark.long  # 1.8 s
def test_forty_one_lines_with_free_ends_take_no_more_steps_than_asked() -> None:
    random = np.random.default_rng(41)
    for number in range(41):
        scene = hanging(random)
        result = hybrid.run(hybrid.validate_scene(scene | {"model": "adaptive"}))
        assert len(result["steps/t"]) <= 201 and not result["steps/repeats"][:].any(), f"line {number}"
        assert any(zone.kind == "rod" for zones in result.zones for zone in zones), f"line {number}"


def defect(force: float, length: float, time: float) -> dict[str, Any]:
    """The line that went through half a turn at once where its bend went through zero, in other units.

    force, length, time: size of the new unit of each.
    """
    mass = force * time**2 / length
    profile = [(0.0, 0.17324, 0.0584537), (-31.312, 0.051972, 0.0149872)]
    section = {
        "length": 31.312 * length, "mass": 0.648869 * mass / length, "diameter": 0.0183625 * length,
        "bending_stiffness": 6.61467 * force * length**2, "axial_stiffness": 257186.0 * force,
        "drag": {"normal": 1.0342, "tangential": 0.0192986}, "added_mass": {"normal": 0.538673},
        "damping": {"mass": 0.048755 / time, "stiffness": 0.000302503 * time},
    }  # fmt: skip
    surge = {"amplitude": 0.429689 * length, "period": 8.30559 * time, "phase": 33.4594}
    current = [{"z": z * length, "velocity": [x * length / time, y * length / time, 0.0]} for z, x, y in profile]
    return {
        "environment": {
            "fluid": {"density": 1025.0 * mass / length**3, "current": current},
            "gravity": 9.80665 * length / time**2,
        },
        "cable": {"sections": [section]},
        "ends": {
            "start": {"kind": "pinned", "position": [0.0] * 3, "motion": {"ramp": 15.1943 * time, "surge": surge}},
            "end": {"kind": "free"},
        },
        "initial": "equilibrium", "mesh": {"cells": 80, "ratio": 0.1}, "model": "adaptive",
        "time": {"duration": 13.8593 * time, "step": 0.0692965 * time},
        "output": {"every": 0.692963 * time, "points": 201},
    }  # fmt: skip


def test_the_units_of_a_line_with_a_free_end_do_not_matter() -> None:
    here, there = (
        hybrid.run(hybrid.validate_scene(defect(*units))) for units in ((1.0, 1.0, 1.0), (94.9, 8.36, 1.8784))
    )
    assert len(here["steps/t"]) == len(there["steps/t"]) <= 201
    assert not here["steps/repeats"][:].any()
    np.testing.assert_allclose(there.position / 8.36, here.position, atol=1e-6 * 31.312)


# --- torque where zones change ---


def line(folder, turns, model, swing, span=12.0):
    """20 m of slack cable between clamps, one of which is turned by so many turns and swings along x by `swing`, m."""
    t = np.linspace(0.0, 14.0, 281)
    x, y = np.clip((t - 1.0) / 6.0, 0.0, 1.0), np.clip(t / 6.0, 0.0, 1.0)
    angle = 360.0 * turns * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    shift = span + swing * np.sin(0.9 * t) * y**3 * (10.0 - 15.0 * y + 6.0 * y**2)
    path = folder / "end.csv"
    table = np.column_stack([t, shift, 0.0 * t, 0.0 * t, angle, 0.0 * t, 0.0 * t])
    np.savetxt(path, table, delimiter=",", header="t,x,y,z,rx,ry,rz", comments="")
    section = {
        "length": 20.0, "mass": 0.1, "diameter": 0.02, "bending_stiffness": 2.0, "axial_stiffness": 1e5,
        "damping": {"mass": 0.5},
    }  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    return hybrid.run(
        hybrid.validate_scene(
            {
                "cable": {"sections": [section]},
                "ends": {
                    "start": {**clamp, "position": [0, 0, 0]},
                    "end": {**clamp, "position": [span, 0, 0], "motion": {"file": str(path)}},
                },
                "initial": "equilibrium",
                "mesh": {"cells": 80},
                "model": model,
                "time": {"duration": 14.0, "step": 0.02},
                "output": {"every": 0.5},
            }
        )
    )


@pytest.mark.parametrize(("turns", "swing"), [(2.0, 0.0), (-2.6, 3.0), (1.3, 5.0)])
def test_torque_of_zones_that_move(tmp_path, turns, swing):
    """Within 1e-3 of the largest torque of all rod, however often rods come and go; a turn is more than 0.1 of it."""
    adaptive = {"kind": "adaptive", "tolerance": 0.004, "hold_time": 0.5}
    rod, mixed = (line(tmp_path, turns, model, swing) for model in ("rod", adaptive))
    torque = rod["torque"][:].mean(axis=1)
    assert len(mixed.events) >= 2
    assert "torque neglected" not in {event.kind for event in mixed.events}
    np.testing.assert_allclose(mixed["torque"][:].mean(axis=1), torque, atol=1e-3 * np.abs(torque).max())


@pytest.mark.slow
def test_no_turn_is_lost_in_sixty_motions(tmp_path):
    """Turns and swings at random: what the clamp turns by is the link of the line, in rods, zones and between them."""
    adaptive, random = {"kind": "adaptive", "tolerance": 0.004, "hold_time": 0.5}, np.random.default_rng(60)
    changes = 0
    for _ in range(60):
        turns, swing = random.uniform(-3.0, 3.0), random.uniform(0.0, 5.0)
        result = line(tmp_path, turns, adaptive, swing)
        kinds = {event.kind for event in result.events}
        changes += len(kinds & {"split", "grow", "merge", "shrink"}) > 0
        lost = turns - result["turns/link"][result.times > 7.5]  # two at a time where it passes through itself
        through = 2.0 * np.round(0.5 * lost) if "line meets itself" in kinds else 0.0
        np.testing.assert_allclose(lost, through, atol=1e-6, err_msg=f"{turns} turns, swing {swing} m")
    assert changes >= 50
