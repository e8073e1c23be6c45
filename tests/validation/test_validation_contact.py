"""Loops whose strands touch, driven slowly, against closed solutions: snap, pop-out, ply (docs/loops.md).

EI = 1, L = 1, 320 cells, clamps along x.  Snap and pop-out are folds of the localised loop (store.capacity): it snaps
shut at the fold of its slack, and pops out when the distance of its strands is the diameter.  Strands begin to touch at
1.05 diameters (docs/theory.md, 16): pop-out is that of hard strands 1.03 to 1.05 diameters thick, on finer meshes and
slower ways, too.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
from hybrid.store import capacity
from hybrid.store.capacity import formation_tension
from tests.scenes import cable_scene

Floats = np.ndarray
D = 0.02


def smooth(t: Floats, begin: float, end: float) -> Floats:
    """From 0 to 1 with two derivatives."""
    x = np.clip((t - begin) / (end - begin), 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x * x))


def driven(turns: float, motion: dict[str, Any], duration: float, damping: float = 20.0, **section: float) -> Any:
    """The run of a rod that is twisted in its equilibrium with a slack of 0.03, and driven from there."""
    rod = {
        "length": 1.0, "mass": 1.0, "diameter": D, "bending_stiffness": 1.0, "torsional_stiffness": 0.8,
        "damping": {"mass": damping},
    }  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    end = clamp | {"position": [0.97, 0, 0], "turns": turns, "motion": motion}
    return hybrid.run(hybrid.validate_scene(cable_scene(
        rod | section, clamp | {"position": [0, 0, 0]}, end, gravity=0.0, contact={"self": True}, model="rod", mesh=320,
        time=(duration, 0.02), output=(0.05, 321)
    )))  # fmt: skip


def by_file(path: Path, t: Floats, slack: Floats, turn: Floats) -> dict[str, Any]:
    """A motion of the end to a slack, with a turn (rad) about x."""
    columns = np.column_stack([t, 1.0 - slack, 0 * t, 0 * t, np.degrees(turn), 0 * t, 0 * t])
    np.savetxt(path, columns, delimiter=",", header="t,x,y,z,rx,ry,rz", comments="", fmt="%.9g")
    return {"file": str(path)}


def slack_of(result: Any) -> Floats:
    return np.asarray(1.0 - result.position[:, -1, 0])


def in_contact(result: Any) -> tuple[int, int]:
    """First and last output with contact."""
    found = np.flatnonzero(result["energy/self_contact"] > 0.0)
    return int(found[0]), int(found[-1])


@pytest.mark.slow
def test_turns_snap_the_loop_shut(tmp_path: Path) -> None:
    """Slack 0.1: R = 100 m k + 4 acos m is largest, 53.18 rad, at m^2 = 0.48, T = 1600 k^2 = 832; then T is 1669.

    Wound on to 82 rad the loop keeps one site of contact: two stretches of the line on each other, and no third.
    """
    t = np.linspace(0.0, 55.0, 111)
    turns = math.radians(252) * smooth(t, 8, 40) + (82.0 - 16.0 * math.pi - math.radians(252)) * smooth(t, 40, 55)
    result = driven(8.0, by_file(tmp_path / "turns.csv", t, 0.03 + 0.07 * smooth(t, 0, 8), turns), 55.0)
    first, last = in_contact(result)
    turned = 2.0 * math.pi * result["turns/link"]
    assert turned[0] == pytest.approx(16.0 * math.pi, abs=1e-9)
    assert turned[first] == pytest.approx(53.18, rel=2e-3)
    force = result.reaction_end[:, 0]
    assert force[first - 2] == pytest.approx(832, rel=0.03) and force[first + 20] == pytest.approx(1669, rel=5e-3)
    assert turned[-1] == pytest.approx(82.0, abs=1e-6) and last == len(force) - 1 and result["turns/crossings"][-1] == 1
    pressed = np.diff(np.pad(result["self_contact"][first + 20 :] > 0.0, ((0, 0), (1, 1))).astype(int), axis=1)
    assert ((pressed == 1).sum(axis=1) == 2).all()
    assert result["turns/writhe"][: first - 1].max() < 0.7 < result["turns/writhe"][first + 20]


def popped(turns: int, GJ: float, width: float, contact: float) -> tuple[float, float]:
    """Tension and slack at which a loop of so many turns pops out whose strands leave each other `contact` widths apart."""

    def excess(m: float) -> float:
        torque = 2.0 * m * capacity.strand_distance(m) / (contact * width)
        return torque / GJ + 4.0 * math.acos(m) - 2.0 * math.pi * turns

    m = float(brentq(excess, 0.05, 0.58))
    tension = (capacity.strand_distance(m) / (contact * width)) ** 2
    return tension, 4.0 * math.sqrt((1.0 - m * m) / tension)


# Turns, GJ, D; the largest slack of the way; slack of the snap and of pop-out, tension before it (None: not known).
FOLDS = [
    (6, 0.8, 0.02, 0.16, 0.1449, 0.0975, 1488.0),
    (5, 0.8, 0.02, 0.19, None, 0.1104, 1190.0),
    (4, 0.8, 0.02, 0.24, None, 0.1289, 895.0),
    (8, 0.8, 0.03, 0.12, 0.1062, 0.0924, None),
    (9, 0.4, 0.02, 0.20, None, 0.1119, None),
]


@pytest.mark.slow
@pytest.mark.parametrize(("turns", "GJ", "width", "most", "snap", "pop", "tension"), FOLDS)
def test_slack_snaps_the_loop_shut_and_pulls_it_open(
    tmp_path: Path, turns: int, GJ: float, width: float, most: float, snap: float | None, pop: float,
    tension: float | None,
) -> None:  # fmt: skip
    t = np.linspace(0.0, 40.0, 81)
    slack = 0.03 + (most - 0.03) * smooth(t, 0, 12) - (most - 0.08) * smooth(t, 12, 40)
    motion = by_file(tmp_path / "way.csv", t, slack, 0.0 * t)
    result = driven(float(turns), motion, 40.0, torsional_stiffness=GJ, diameter=width)
    first, last = in_contact(result)
    there = slack_of(result)
    if snap is not None:
        assert there[first] == pytest.approx(snap, rel=0.01)
    hard, thicker, thickest = (popped(turns, GJ, width, contact) for contact in (1.0, 1.03, 1.05))
    assert hard[1] == pytest.approx(pop, rel=1e-3)
    assert thicker[1] < there[last] and there[last + 1] < thickest[1]  # it pops out between two outputs
    if tension is not None:
        force = result.reaction_end[:, 0]
        assert hard[0] == pytest.approx(tension, rel=1e-3)
        assert thickest[0] < force[last - 20 : last + 1].max() < thicker[0]
        assert force[last + 20] < 0.6 * tension
    np.testing.assert_allclose(result["turns/link"], float(turns), atol=1e-9)  # nothing passes through
    assert np.abs(result["turns/crossings"][last + 20]) < 1


def strand_distance(x: Floats, i: int, apart: int = 25) -> float:
    """Distance of node i from the cells of the other strand, at least `apart` cells along the line."""
    u = np.diff(x, axis=0)
    part = np.clip(np.einsum("ij,ij->i", x[i] - x[:-1], u) / np.einsum("ij,ij->i", u, u), 0.0, 1.0)
    d = np.linalg.norm(x[i] - x[:-1] - part[:, None] * u, axis=1)
    return float(d[np.abs(np.arange(len(u)) - i) >= apart].min())


@pytest.mark.slow
def test_the_ply_of_two_strands() -> None:
    """Two strands wound around each other at an angle a (Thompson, van der Heijden, Neukirch, Proc. R. Soc. A 458, 2002):

    M = 2 EI cos a sin^3 a/(r cos 2a) and T = EI sin^4 a (1/2 + 1/cos 2a)/r^2, less the energy of contact per length of
    strand, 2 % here, which hard strands would not have; r is half of their distance, sin^2 a = r times the curvature.
    They press on each other with p = EI sin^4 a/(r^3 cos 2a) per length.
    """
    result = driven(10.0, {"travel": {"by": [-0.47, 0, 0], "over": 30.0}}, 35.0, damping=40.0)
    x, torque, tension = result.position[-1], result.torque[-1].mean(), result.reaction_end[-1, 0]
    ply = np.flatnonzero(((result.s > 0.38) & (result.s < 0.44)) | ((result.s > 0.67) & (result.s < 0.73)))
    r = 0.5 * np.mean([strand_distance(x, int(i)) for i in ply])
    curvature = result.curvature[-1][ply]
    assert np.ptp(curvature) < 0.01 * curvature.mean()  # it is uniform there
    a = math.asin(math.sqrt(r * curvature.mean()))
    touching = np.array([strand_distance(x, i) for i in range(len(x))]) < 1.05 * D
    energy = float(result["energy/self_contact"][-1]) / (touching.sum() / 320.0)
    M = 2.0 * math.cos(a) * math.sin(a) ** 3 / (r * math.cos(2.0 * a))
    T = math.sin(a) ** 4 * (0.5 + 1.0 / math.cos(2.0 * a)) / r**2 - energy
    assert 0.94 < 2.0 * r / D < 1.0 and math.degrees(a) == pytest.approx(27.8, abs=0.3)
    assert result["turns/writhe"][-1] > 3.0  # two helical turns or more
    assert torque == pytest.approx(M, rel=0.01)
    assert tension == pytest.approx(T, rel=0.01)
    pressure = math.sin(a) ** 4 / (r**3 * math.cos(2.0 * a))
    pressed = result["self_contact"][-1][ply]
    assert pressed.mean() == pytest.approx(pressure, rel=0.01) and np.ptp(pressed) < 0.03 * pressure


# --- Clamped rods under thrust and torque, and the localised loop, against closed solutions (docs/loops.md) ---


def clamped(slack: float, turns: float) -> hybrid.Result:
    """The equilibrium of a rod whose clamps are nearer than its length by `slack`, and turned against each other."""
    section = {"length": 1.0, "mass": 1.0, "bending_stiffness": 1.0, "torsional_stiffness": 0.8}
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    return hybrid.static(
        hybrid.validate_scene(
            cable_scene(
                section,
                {**clamp, "position": [0, 0, 0]},
                {**clamp, "position": [1.0 - slack, 0, 0], "turns": turns},
                gravity=0.0,
                model="rod",
                mesh=320,
            )
        )
    )


@pytest.mark.parametrize("slack", [1e-3, 4e-3])
def test_euler_load_of_a_clamped_rod(slack):
    """4 pi^2 EI/L^2 = 39.478, and half of the slack more beyond it."""
    force = -clamped(slack, 0.0)["reaction_end"][0, 0]
    assert force == pytest.approx(4.0 * math.pi**2 * (1.0 + 0.5 * slack), rel=1e-3)


@pytest.mark.parametrize("slack", [1e-3, 4e-3])
def test_torque_alone_buckles_a_clamped_rod(slack):
    """The end force vanishes at M L/EI = 2 x 4.4934 = 8.9868, the first root of tan x = x, doubled."""
    turns = [1.78, 1.79]
    forces, torques = zip(
        *((r["reaction_end"][0, 0], r["torque"][0].mean()) for r in (clamped(slack, x) for x in turns)), strict=True
    )
    part = -forces[0] / (forces[1] - forces[0])
    assert abs(part) < 10.0
    assert torques[0] + part * (torques[1] - torques[0]) == pytest.approx(8.9868, rel=5e-3)


def test_the_localised_loop():
    """Eight turns and a slack of 0.0614: M = 39.180, T from slack = 4 sqrt(1 - m^2) sqrt(EI/T) (Coyne 1990)."""
    found = clamped(0.0614, 8.0)
    torque, tension = found["torque"][0].mean(), found["reaction_end"][0, 0]
    assert torque == pytest.approx(39.180, rel=5e-4)
    m = torque / (2.0 * math.sqrt(tension))
    assert 4.0 * math.sqrt(1.0 - m * m) / math.sqrt(tension) == pytest.approx(
        0.0614, rel=3e-2
    )  # sensitive: m is near 1
    assert torque / 0.8 + 4.0 * math.acos(m) == pytest.approx(16.0 * math.pi, rel=1e-3)
    needed = formation_tension(np.array([torque]), np.ones(1))[0]
    assert needed == pytest.approx(tension, rel=0.12) and needed < tension  # near the margin of forming


def test_no_turn_is_lost_whatever_the_cells():
    """Six turns of a nearly straight rod: Newton at once ends without them with 324 cells."""
    section = {"length": 4, "mass": 0.3, "diameter": 0.015, "bending_stiffness": 1.0, "torsional_stiffness": 0.7}
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    ends = {"start": clamp | {"position": [0, 0, 0]}, "end": clamp | {"position": [3.99, 0, 0], "turns": 6}}
    scene = {"environment": {"gravity": 0}, "cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium"}
    torques = []
    for cells in (316, 324):
        found = hybrid.static(hybrid.validate_scene(scene | {"model": "rod", "mesh": {"cells": cells}}))
        assert found["turns/link"][0] == pytest.approx(6.0, abs=1e-9)
        torques.append(found["torque"][0].mean())
    assert torques[1] == pytest.approx(torques[0], rel=1e-5)


@pytest.mark.parametrize(("slack", "turns"), [(0.0614, 8.0), (0.0614, -8.0), (0.004, 1.3)])
def test_link_is_the_turns_put_in(slack, turns):
    """Twist goes into writhe, and their sum stays; a closed polygon has no error of cells in it."""
    found = clamped(slack, turns)
    assert found["turns/link"][0] == pytest.approx(turns, abs=1e-9)
    assert found["turns/twist"][0] == pytest.approx(found["torque"][0].mean() / (0.8 * 2.0 * math.pi), rel=2e-3)
    if abs(turns) == 8.0:  # 4 acos m of the localised loop, in turns
        m = abs(found["torque"][0].mean()) / (2.0 * math.sqrt(found["reaction_end"][0, 0]))
        writhe = math.copysign(4.0 * math.acos(m) / (2.0 * math.pi), turns)
        assert found["turns/writhe"][0] == pytest.approx(writhe, rel=0.02)
