"""Zones change where it pays: a joint between long cells is no kink, and a rod stays until letting it go saves more."""

from __future__ import annotations

import numpy as np
import pytest
from adapt_cases import cable, hanging, layout, on, polygon, state_on, weighed

import hybrid
from hybrid.adapt.manager import FOLLOWING_PARTS, PAYS, DomainManager
from hybrid.kernels import zone_step as z
from hybrid.kernels.criteria import POINT

EI, T, TOL = 2.0, 50.0, 1e-2  # of `cable()`; N, m
LAYER = np.sqrt(EI / T)


def kink_found(state, zones) -> float:
    """Angle, rad, at the only joint, from the ratio of the criterion point: half of it times the layer over TOL."""
    return 2.0 * TOL * weighed(cable(12.0), zones, state, tolerance=TOL)[POINT].max() / LAYER


@pytest.mark.parametrize("flags", ["RRCCCC", "CCCCRR"])
def test_a_bend_of_long_cells_is_no_kink(flags: str) -> None:
    """On a smooth curve, where the smaller curvature beside the joint left 0.03 rad of the turn of the long cell."""
    zones = layout(np.linspace(0.0, 12.0, 7), 20, flags)
    line = on(cable(12.0), zones)
    shape, _, curvature = hanging(4.0, 0.0 if flags == "RRCCCC" else 12.0)
    state = state_on(line, shape, T)
    joint = int(np.flatnonzero(line.spin[1:] != line.spin[:-1])[0]) + 1
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    turn = np.linalg.norm(d[1:] - d[:-1], axis=1)
    smaller = min(turn[joint - 2] / line.hn[joint - 1], turn[joint] / line.hn[joint + 1])
    before = turn[joint - 1] - smaller * line.hn[joint]
    assert before > 0.02
    assert kink_found(state, zones) < before / 3.0
    assert kink_found(state, zones) < 0.5 * LAYER * curvature(line.s[joint])  # of a hinge in this curve


@pytest.mark.parametrize("flags", ["RRCCCC", "CCCCRR"])
def test_a_kink_at_a_joint_counts(flags: str) -> None:
    """On top of an even bend of long and short cells, the kink is found whole."""
    zones = layout(np.linspace(0.0, 12.0, 7), 20, flags)
    line = on(cable(12.0), zones)
    turns = 0.03 * line.hn[1:-1]
    turns[np.flatnonzero(line.spin[1:] != line.spin[:-1])] += 0.05
    state = state_on(line, polygon(line.h, turns), T)
    assert kink_found(state, zones) == pytest.approx(0.05, rel=2e-3)


@pytest.mark.parametrize(("share", "parts"), [(None, 4), (0.03, FOLLOWING_PARTS)])
def test_a_rod_waits_until_letting_it_go_pays(share: float | None, parts: int) -> None:
    """The longer a row of rods, the sooner; what is no rod waits for nothing."""
    zones = layout(np.linspace(0.0, 10.0, 11), 4, "RCCRRRCCRR")
    manager = DomainManager(cable(), zones, TOL, 0.5, np.zeros(10, int), 1.0, curvature_error=share)
    assert manager.waits == pytest.approx(np.ones(10)) and manager.pays == 0.0
    manager.pays = 60.0
    rods = np.array([1, 0, 0, 3, 3, 3, 0, 0, 2, 2])
    want = np.where(rods > 0, np.maximum(60.0 / (parts * np.maximum(rods, 1)), 1.0), 1.0)
    assert manager.waits == pytest.approx(want)
    manager.patience[3] = 100.0
    assert manager.waits[3] == 100.0 and manager.waits[4] == pytest.approx(want[4])
    assert (manager.zones.clock[z.SHARE] > 0.0) == (share is not None)


def test_a_hold_time_that_is_given_is_kept() -> None:
    """Without one, rods of few cells stay; with one they go after it."""
    section = {"length": 60, "diameter": 0.025, "mass": 0.65, "axial_stiffness": 1e6, "bending_stiffness": 10}
    scene = {
        "environment": {"fluid": {"density": 1025}},
        "cable": {"sections": [section | {"drag": {"normal": 1.2}}]},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [20, 0, -30]}},
        "initial": "equilibrium", "time": {"duration": 4.0, "step": 0.05}, "output": {"every": 1.0, "errors": False},
    }  # fmt: skip

    def asks(look: hybrid.NodeState) -> np.ndarray:
        return (look.t < 0.5) & (abs(look.s - 30.0) < 2.0)

    ends = {}
    for hold in (None, 0.5):
        model = {"kind": "adaptive"} | ({"hold_time": hold} if hold else {})
        result = hybrid.run(hybrid.validate_scene(scene | {"model": model}), criterion=asks)
        ends[hold] = [e.kind for e in result.events if e.kind in ("shrink", "merge")]
    assert ends[0.5] and not ends[None]
    assert PAYS > 80 * 4 * 4  # of all steps, and of the cells that are asked for
