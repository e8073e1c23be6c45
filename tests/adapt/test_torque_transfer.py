"""Torque when zones change in a motion: no turn is lost, whichever way."""

import numpy as np
import pytest

import hybrid


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
