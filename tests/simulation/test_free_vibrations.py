"""Free vibrations that ramps leave, and what steps make of them: what is foretold, and what a run says of it."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from hybrid.accuracy import free_vibrations as f
from hybrid.model.resolution import first_resolution
from hybrid.simulation.run_sample import RunSample


def cantilever(**more):
    """56 Hz, shaken with 20 Hz: the forced motion is of order 2, and hides what its ramp leaves."""
    motion = {"heave": {"amplitude": 0.01, "period": 0.05}, "ramp": 0.1}
    return {
        "cable": {"sections": [{"length": 1.0, "mass": 1.0, "bending_stiffness": 1e4}]},
        "ends": {
            "start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "motion": motion},
            "end": "free",
        },
        "initial": "equilibrium",
        "time": {"duration": 1.0},
        "output": {"every": 0.01, "points": 26},
    } | more


def taut(**more):
    """Of 10 m, pulled by 100 N, 1 kg/m: waves of 10 m/s."""
    travel = {"travel": {"by": [0, 0, 0.1], "over": 1.5, "begin": 0.2}}
    return {
        "environment": {"gravity": 0},
        "cable": {"sections": [{"length": 10.0 / 1.01, "mass": 1.01, "axial_stiffness": 1e4}]},
        "ends": {
            "start": {"kind": "pinned", "position": [0, 0, 0]},
            "end": {"kind": "pinned", "position": [10, 0, 0], "motion": travel},
        },
        "initial": "equilibrium",
        "model": "catenary",
        "time": {"duration": 10.0},
    } | more


def sample(scene, steps):
    """A run in equal steps, of which the first output is straight."""
    s = f.output_points(scene).s
    x = np.zeros((1, s.size, 3))
    x[0, :, 0] = s * (1.01 if scene.cable.sections[0].stiffness else 1.0)
    pull = np.full((1, s.size), 100.0 if scene.cable.sections[0].stiffness else 0.0)
    forces = np.zeros((steps, 3))
    forces[:, 0] = np.arange(1, steps + 1) * scene.time.duration / steps
    return RunSample(first_resolution(scene), {"position": x, "tension": pull}, 10, steps, 0.0, forces=forces)


def test_frequencies():
    scene = hybrid.validate_scene(cantilever())
    w, _, _ = f._modes(f.linear_line(scene, sample(scene, 10)))
    assert w[[0, 1]] == pytest.approx(3.516 * 100.0, rel=0.005)  # in both planes
    assert w[2] == pytest.approx(22.03 * 100.0, rel=0.005)
    scene = hybrid.validate_scene(taut())
    w, _, _ = f._modes(f.linear_line(scene, sample(scene, 10)))
    assert w[[0, 2, 4]] == pytest.approx(np.pi * np.array([1.0, 2.0, 3.0]), rel=0.01)


def test_what_a_move_leaves():
    """Against the same oscillators, integrated in short steps."""
    scene = hybrid.validate_scene(taut())
    line = f.linear_line(scene, sample(scene, 10))
    w, modes, rest = f._modes(line)
    drive = modes.T @ (line.mass[~line.held, None] * rest)
    motions = [end.prescribed_motion for end in scene.ends.both]
    found = f._amplitudes(scene, motions, w, drive, 1.7, 10.0)
    t = np.linspace(0.0, 1.7, 100_001)
    x = np.clip((t - 0.2) / 1.5, 0.0, 1.0)
    second = 0.1 / 1.5**2 * (60.0 * x - 180.0 * x**2 + 120.0 * x**3)  # of 10 x^3 - 15 x^4 + 6 x^5
    for k in (0, 1, 2, 3):
        inside = drive[k, 5] * second * np.exp(-1j * w[k] * t)  # the end, along z
        truth = abs(inside.sum() * (t[1] - t[0])) / w[k]
        assert found[k] == pytest.approx(truth, rel=1e-3, abs=1e-9)
    assert found.max() > 1e-3


def test_steps_of_the_trapezoidal_rule():
    """Its radius is 1: it loses nothing, and turns by 2 atan(w dt/2)."""
    angle = np.array([0.01, 0.1, 1.0, 3.0])
    found = f.Factors(1.0).of(angle)
    assert np.abs(found.real).max() < 1e-9
    assert found.imag == pytest.approx(2.0 * np.arctan(0.5 * angle) - angle, rel=1e-3)
    assert f.Factors(0.0).of(np.array([100.0])).real[0] < -3.0  # lost in a step


def test_long_runs_are_looked_at_in_parts(monkeypatch):
    w, t = np.array([1.0, 3.0]), np.cumsum(np.concatenate([[0.0], np.linspace(0.01, 0.1, 1000)]))
    whole, times = f.Factors(0.5).drift(w, t)
    assert np.array_equal(times, t)
    monkeypatch.setattr(f, "ROWS", 100)
    monkeypatch.setattr(f, "BLOCK", 7)
    some, times = f.Factors(0.5).drift(w, t)
    assert len(times) <= 102
    assert some == pytest.approx(whole[np.searchsorted(t, times)], rel=1e-9)


def test_a_vibration_that_all_runs_have_lost_is_said():
    """Asked for 2 % of the moment it was 8 % off and said 1.6 %."""
    result = hybrid.run(cantilever(accuracy={"bending_moment": "2%"}))
    (text,) = [e.text for e in result.events if e.kind == "error uncertain"]
    assert "bending moment" in text
    assert "0.018 s" in text
    step = float(text.split("time.step: ")[1].split()[0])
    shown = hybrid.run(
        cantilever(time={"duration": 1.0, "step": step}, output={"every": 0.01, "points": 26, "errors": True})
    )
    assert "error uncertain" not in {e.kind for e in shown.events}


def test_nothing_is_said_where_the_figure_shows_it():
    result = hybrid.run(taut(accuracy={"position": "0.3%"}))
    assert "error uncertain" not in {e.kind for e in result.events}


def test_water_damps_it():
    cable = {"sections": [{"length": 10.0 / 1.01, "mass": 1.01, "axial_stiffness": 1e4, "diameter": 0.03}]}
    scene = hybrid.validate_scene(taut(environment={"gravity": 0, "fluid": {"density": 1025}}, cable=cable))
    assert not f.lost_vibrations(scene, sample(scene, 10))
    scene = hybrid.validate_scene(taut())
    found = f.lost_vibrations(scene, sample(scene, 20))
    assert set(found) == {"position", "end_force_start", "end_force_end"}
    assert found["position"].error > 0.5 * found["position"].amplitude
    finer = f.lost_vibrations(scene, sample(scene, 4000))
    assert finer["position"].error < 0.1 * found["position"].error
