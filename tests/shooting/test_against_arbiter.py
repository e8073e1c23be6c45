"""The production solver against the arbiter: two methods that share nothing but the scene.

Both are of second order, with different constants; so their difference must fall by four
when mesh and step are halved, and its Richardson limit must vanish.  In statics the
extrapolated answers agree far better than either alone; in motion the difference itself
is bounded.
The lines are short: the arbiter loses a digit for every 2.3 lengths sqrt(EI/T) of rod, and says where it dies.
"""

import math

import arbiter
import numpy as np
import pytest
from arbiter import ArbiterError, Outcome

import hybrid
from hybrid.errors import SceneError
from tests.scenes import cable_scene, clamped_at, pinned_at

# Discretisation of fourth order at 80 and 160 cells on the sharpest bend here (the clamp).
PLACE, TENSION, MOMENT = 1e-7, 2e-4, 1e-6  # of the length, the applied force, the moment

ZONES = {
    "rod": [("rod", 1.0)],
    "catenary": [("catenary", 1.0)],
    "rod-catenary": [("rod", 0.4), ("catenary", 0.6)],
    "catenary-rod": [("catenary", 0.6), ("rod", 0.4)],
    "catenary-rod-catenary": [("catenary", 0.3), ("rod", 0.4), ("catenary", 0.3)],
    "rod-catenary-rod": [("rod", 0.3), ("catenary", 0.4), ("rod", 0.3)],
}
# What has a direction about the axis of a rod, which a clamp gives it.
UNEVEN = {"bending_stiffness": [0.5, 0.8], "rotary_inertia": [2e-4, 4e-4], "intrinsic_curvature": [0.3, -0.2, 0.4]}
AXIS = [0.0, 0.2, 0.3]


def scene(zones, cells, **changes):
    section = {
        "length": 1.0, "mass": 0.1, "diameter": 0.01, "axial_stiffness": 4e3, "bending_stiffness": 0.5,
        "torsional_stiffness": 0.4, "drag": {"normal": 1.2, "tangential": 0.05}, "damping": 0.5,
        "added_mass": {"normal": 1.0, "tangential": 0.3},
    } | (UNEVEN if zones[0][0] == "rod" else {})  # fmt: skip
    data = cable_scene(
        section,
        clamped_at([0, 0, 0], [1, 0.3, -0.2], normal=AXIS),
        {"kind": "free", "force": [20.0, 3.0, 2.0]},
        gravity=9.81,
        fluid={"density": 1000.0, "current": [0.0, 2.0, 0.5]},
        initial={"kind": "equilibrium", "direction": [1, 0.1, 0.1]},
        model={"kind": "zones", "zones": [{kind: x, "cells": max(2, round(x * cells))} for kind, x in zones]},
        output={"points": 11},
    )
    return hybrid.validate_scene(data | changes)


def limit(values):
    """Richardson's limit from values at h and h/2 of a second-order method."""
    coarse, fine = values
    return (4.0 * fine - coarse) / 3.0


@pytest.mark.parametrize("zones", ZONES)
def test_statics(zones):
    scenes = [scene(ZONES[zones], cells) for cells in (80, 160)]
    ours = [hybrid.static(x) for x in scenes]
    theirs = [arbiter.at(arbiter.static(x), ours[0].s) for x in scenes]
    for name, unit in (("position", 1.0), ("tension", 20.0)):
        a, b = limit([r[name][0] for r in ours]), limit([r[name] for r in theirs])
        inner = slice(None) if name == "position" else [i for i in range(11) if i not in joints(ZONES[zones])]
        apart = np.abs(a - b)[inner].max() / unit
        direct = np.abs(ours[1][name][0] - theirs[1][name])[inner].max() / unit
        print(f"{zones}: {name} apart by {direct:.1e} at 160 cells, {apart:.1e} extrapolated")
        assert apart < (PLACE if name == "position" else TENSION)
    if "rod" in zones:
        found = [[r.bending_moment[0] for r in ours], [r["bending_moment"] for r in theirs]]
        moments = [limit([np.linalg.norm(x[1:3]) for x in each]) for each in found]
        print(f"{zones}: moments {moments}")
        assert abs(moments[0] - moments[1]) <= MOMENT * max(moments[1], 1.0)


def joints(zones):
    """Output points that lie on a joint, where tension has two values."""
    bounds = np.cumsum([x for _, x in zones])[:-1]
    return [round(10 * x) for x in bounds]


@pytest.mark.long
@pytest.mark.parametrize("zones", ZONES)
def test_motion(zones):
    """From equilibrium, with a start that heaves: mesh and step halved together."""
    motion = {"heave": {"amplitude": 0.05, "period": 0.4}, "sway": {"amplitude": 0.03, "period": 0.5}, "ramp": 0.4}
    kind = "clamped" if zones.startswith("rod") else "pinned"
    start = {"kind": kind, "position": [0, 0, 0], "motion": motion}
    if kind == "clamped":
        start |= {"tangent": [1, 0.3, -0.2], "normal": AXIS}
    ends = {"start": start, "end": {"kind": "free", "force": [20.0, 3.0, 2.0]}}
    apart = []
    for cells, step in ((20, 0.02), (40, 0.01)):
        time, output = {"duration": 0.6, "step": step}, {"every": 0.2, "points": 11}
        moving = scene(ZONES[zones], cells, ends=ends, time=time, output=output)
        ours, states = hybrid.run(moving), []
        arbiter.simulate(moving, states.append)
        theirs = states[:: round(0.2 / step)]
        assert np.abs(ours.times - [x.t for x in theirs]).max() < 1e-9
        off = [ours.position[k] - arbiter.at(x, ours.s)["position"] for k, x in enumerate(theirs)]
        apart.append(np.abs(off).max())
    print(f"{zones}: apart by {apart[0]:.1e} and {apart[1]:.1e} m, ratio {apart[0] / apart[1]:.2f}")
    assert apart[1] < 2e-3
    assert 2.5 < apart[0] / apart[1] < 7.0


# --- where it dies ---------------------------------------------------------------------------------


def plain(section, start, end, model, cells=40, **more):
    section = {"length": 1.0, "mass": 1.0} | section
    return hybrid.validate_scene(cable_scene(section, start, end, model=model, mesh=cells, **more))


def taut(ratio):
    """A rod under tension 1 N whose end slopes differ by 1e-3, L/lambda = ratio."""
    guided = {"kind": "guided", "tangent": [1, 0, 0], "force": [1, 0, 0]}
    return plain(
        {"bending_stiffness": ratio**-2.0}, clamped_at([0, 0, 0], [1, 0, 1e-3]), guided, "rod", 400, gravity=0.0
    )


def test_a_taut_rod_may_be_too_long():
    """L/lambda = 20: the linear beam, whose slope fades along it; discretisation, (h/lambda)^2/12 = 2e-4."""
    state = arbiter.static(taut(20.0))
    slope = 1e-3 * np.sinh(20.0 - 20.0 * state.s) / math.sinh(20.0)
    assert np.abs(state.tangent[:, 2] - slope).max() < 2e-7 and state.growth > 1e8 and state.residual < 1e-12
    for ratio in (60.0, 200.0, 1000.0):
        with pytest.raises(ArbiterError, match="literal shooting") as caught:
            arbiter.static(taut(ratio))
        assert caught.value.outcome is Outcome.ILL_CONDITIONED


def test_what_has_no_answer_is_said():
    """A rod adrift, and a chain that is folded between two ends at one point, have no equilibrium with tension."""
    straight = {"kind": "straight", "direction": [1, 0, 0], "origin": [0, 0, 0]}
    with pytest.raises(ArbiterError) as caught:
        arbiter.static(plain({"bending_stiffness": 1.0}, "free", "free", "rod", 20, initial=straight))
    assert caught.value.outcome is Outcome.ILL_CONDITIONED
    with pytest.raises(ArbiterError):
        arbiter.static(plain({"length": 4.0}, pinned_at(0, 0, 0), pinned_at(0, 0, 0), "catenary"))
    damped = {"bending_stiffness": 1.0, "damping": {"stiffness": 0.1}}
    with pytest.raises(SceneError, match=r"damping\.stiffness"):
        arbiter.static(plain(damped, clamped_at([0, 0, 0], [1, 0, 0]), "free", "rod"))
    with pytest.raises(SceneError, match="time"):
        arbiter.ShootingRun(plain({"bending_stiffness": 1.0}, clamped_at([0, 0, 0], [1, 0, 0]), "free", "rod"))


def test_steps_of_a_chain_that_are_too_small_are_said():
    """Waves cross it in 40 steps, exp(75) is too much growth to shoot through."""
    aside = {"kind": "straight", "direction": [1e-3, 0, -1]}
    swings = plain({}, pinned_at(0, 0, 0), "free", "catenary", initial=aside, time=(0.5, 0.0167))
    with pytest.raises(ArbiterError) as caught:
        arbiter.simulate(swings, lambda state: None)
    assert caught.value.outcome is Outcome.ILL_CONDITIONED and caught.value.t is not None
