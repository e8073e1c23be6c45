"""Twist of rods whose sections have no inertia: a balance at every step, not a motion of its own."""

from __future__ import annotations

import numpy as np
import pytest
from problems import clamped, motion, pinned, scene

GJ, LENGTH = 0.8, 1.0


def wire(**end):
    """A taut wire without a diameter: no rotary inertia."""
    return scene(
        {"length": LENGTH, "mass": 1.0, "bending_stiffness": 1.0, "torsional_stiffness": GJ, "axial_stiffness": 1e5},
        clamped(), end or pinned(1.001, 0, 0), cells=10, time={"duration": 1.0, "step": 0.02},
    )  # fmt: skip


def turned(angle):
    """Turn all sections by an angle about the tangent, against the clamp."""

    def kick(state, model):
        d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
        state.a1[:] = np.cos(angle) * state.a1 + np.sin(angle) * np.cross(d, state.a1)

    return kick


@pytest.mark.parametrize("angle", [0.3, -2.0, 3.1])
def test_a_wire_let_go_unwinds_once(angle):
    """It is straight in a step, and its spin dies as the scheme damps it; it does not pass through turn after turn."""
    states = [(t, s.copy()) for t, s in motion(wire(), turned(angle))]
    first = states[0][1].a1[0]
    for t, state in states[1:]:
        assert np.abs(state.a1 - state.a1[0]).max() < 1e-9, t
        assert abs(state.a1[0] @ first - np.cos(angle)) < 1e-9, t
    spins = [np.abs(s.w).max() for _, s in states]
    assert max(spins) < 10 * np.pi / 0.02
    assert spins[-1] < 1e-6 * max(spins)


def test_a_spin_that_nothing_holds_does_not_go_on():
    """Pinned at both ends, all cells spinning and speeding up: there is no inertia, so the scheme's damping ends it."""

    def kick(state, model):
        state.w[:], state.wa[:], state.wd[:] = 3.0, 50.0, 50.0

    what = wire().model_dump(exclude_none=True)
    what["ends"]["start"] = pinned()
    states = [s.copy() for _, s in motion(type(wire()).model_validate(what), kick)]
    assert np.abs(states[-1].w).max() < 1e-6
    assert np.abs(states[-1].a1 - states[-5].a1).max() < 1e-6
