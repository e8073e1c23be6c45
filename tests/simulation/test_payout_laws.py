"""Lines that are paid out with torque of tension, polyester, creep, vortices, and whose end at the winch is let go."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import resumed
from test_payout import G, clamped, hanging, sagging

import hybrid
from hybrid.kernels.laws.water import LIFT_A, LIFT_B, PHASE
from hybrid.model.build import build
from hybrid.scene.read import as_scene, one_line
from hybrid.simulation.payout import PayingOut
from tests.inside import OnlyLine

TORQUE = {"tension_torque": 2e-3, "torsional_stiffness": 2e4}
CURVE = [[0, 0], [0.01, 1500], [0.02, 4000], [0.06, 20000]]
POLYESTER = {
    "syrope": {"curve": CURVE, "working": "linear", "k1": 0.4, "highest_tension": 1800.0},
    "dynamic_stiffness": {"constant": 8e5, "per_tension": 10.0, "relaxation_time": 2.0},
    "axial_stiffness": None,
}
SHEDS = {"vortices": {"ramp": 2.0}, "drag": {"normal": 1.2}}
SEA = {"fluid": {"density": 1025, "current": [0.0, 0.6, 0]}}


def paid(section: dict[str, Any], clamp: bool = True, step: float = 0.05, **more: Any) -> dict[str, Any]:
    scene = sagging(step=step, duration=8.0, **more)
    own = scene["cable"]["sections"][0] | section
    scene["cable"]["sections"] = [{key: x for key, x in own.items() if x is not None}]
    if clamp:
        scene = clamped(scene)
        scene["ends"]["start"] = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -0.5]}
    return scene


def twisting(step: float = 0.05) -> dict[str, Any]:
    return paid(TORQUE, step=step, model="rod", EA=2e6, EI=2e4)


def armour(step: float = 0.05) -> dict[str, Any]:
    """By a table, with as much stretch by its twist as a third of that by its tension."""
    law = {"tension_strain": CURVE, "axial_stiffness": None, "tension_torque": 0.04, "torsional_stiffness": 2e3}
    return paid(law, step=step, model="rod", EA=2e6, EI=2e4)


def polyester(step: float = 0.05) -> dict[str, Any]:
    return paid(POLYESTER, False, step)


def shedding(step: float = 0.02) -> dict[str, Any]:
    return paid(SHEDS, step=step, model="rod", EA=2e6, EI=2e4) | {"environment": SEA}


def creeping(step: float = 0.05) -> dict[str, Any]:
    return paid({"axial_stiffness": 2e6, "creep": {"per_decade": 2e-3, "loaded": 1.0}}, False, step)


SCENES = {"creep": creeping, "torque": twisting, "armour": armour, "polyester": polyester, "vortices": shedding}


def test_a_torque_of_tension_is_that_of_a_line_of_the_final_length() -> None:
    """Slowly out, hanging straight between clamps: link stays, so Q = GJ tau + c T along it with the twist over L."""
    c, GJ, EA, w = 5e-3, 60.0, 1e5, 4.0 * G
    up = {"tangent": [0, 0, 1], "normal": [1, 0, 0]}
    section = {"length": 10.0, "mass": 4.0, "axial_stiffness": EA, "bending_stiffness": 200, "torsional_stiffness": GJ,
               "tension_torque": c, "damping": {"mass": 2.0}}  # fmt: skip
    scene = hanging({"lengths": [[0, 10], [10, 13], [20, 16]]}, 30.0, model="rod", mesh={"cells": 20})
    scene["cable"]["sections"], scene["output"] = [section], {"every": 30.0, "points": 17}
    scene["ends"]["start"] = {"kind": "guided", **up, "force": [0, 0, -800]}
    scene["ends"]["end"] |= {"kind": "clamped", **up}
    found = hybrid.run(scene)
    length = found["payout/length"][-1]
    assert length == pytest.approx(16.0)
    mean = 800.0 + 0.5 * w * length
    torque = c * mean  # twist against the frames of both clamps stays 0: all of the mean is torque
    assert np.abs(found["torque"][-1] / torque - 1.0).max() < 2e-3
    # eps = T/EA - c tau/... with GJ tau = Q - c T, which has no mean
    assert found.position[-1, 0, 2] == pytest.approx(-length * (1.0 + mean / EA), rel=2e-5)


def test_a_rope_creeps_as_it_is_paid_out() -> None:
    """Under a constant pull, what has just come from the reel too: its end is at L(t) (1 + F/EA + c log10(1 + t/t0))."""
    pull, EA, c, loaded = 2e4, 1e6, 4e-3, 5.0
    section = {"length": 10.0, "mass": 1.0, "axial_stiffness": EA, "damping": {"mass": 2.0},
               "creep": {"per_decade": c, "loaded": loaded}}  # fmt: skip
    scene = hanging({"lengths": [[0, 10], [20, 12], [60, 12]]}, 60.0, mesh={"cells": 20}, environment={"gravity": 0})
    scene["cable"]["sections"] = [section]
    scene["ends"]["start"] = {"kind": "free", "force": [0, 0, -pull]}
    found = hybrid.run(scene)
    stretch = 1.0 + pull / EA + c * np.log10(1.0 + found.t / loaded)
    assert found["payout/length"][-1] == pytest.approx(12.0)
    assert np.abs(-found.position[:, 0, 2] / found["payout/length"] / stretch - 1.0)[1:].max() < 2e-5
    lost, out = -found["work/hysteresis"], found["payout/length"]
    rates = c / np.log(10.0) / (found.t + loaded) * pull * out  # W, by what is out then
    done = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(found.t) * (rates[1:] + rates[:-1]))])
    assert np.abs(lost - done).max() < 0.01 * done[-1]


def test_polyester_that_stays_below_its_highest_tension_is_a_longer_rope() -> None:
    """A straight working curve from e0 on, strain = e0 + f T: a rope (1 + e0) times as long, of stiffness (1 + e0)/f."""
    highest, at, k1, E = 4000.0, 0.02, 0.5, 9e5
    e0 = k1 * at
    f, grown = (at - e0) / highest, 1.0 + k1 * at
    law = {"syrope": {"curve": [[0, 0], [at, highest], [0.1, 6000]], "working": "linear", "k1": k1,
                      "highest_tension": highest},
           "dynamic_stiffness": {"constant": E, "relaxation_time": 2.0}, "axial_stiffness": None}  # fmt: skip
    same = {"tension_strain": [[0, 0], [f * highest / grown, highest]],
            "dynamic_stiffness": {"constant": E * grown, "relaxation_time": 2.0}}  # fmt: skip
    one = paid(law, False)
    other = paid(same, False)
    section = other["cable"]["sections"][0]
    section["length"], section["mass"] = 100.0 * grown, 5.0 / grown
    other["ends"]["end"]["payout"]["rate"] = 0.8 * grown
    a, b = hybrid.run(one), hybrid.run(other)
    assert np.abs(a.position - b.position).max() < 1e-6 * 100.0
    assert np.abs(a["reaction_end"] - b["reaction_end"]).max() < 1e-6 * np.abs(a["reaction_end"]).max()


def test_lift_grows_with_the_length_that_is_out() -> None:
    """A node that enters takes lift from its neighbours and has their phase: of what is out all sheds, and no more."""
    scene = as_scene(shedding())
    model = build(one_line(scene))
    paying = PayingOut(model)
    line = paying.on(model, 107.3).line
    paying.reel.numbers[0] = 107.3
    paying._fit(line, paying.reel, 107.3, 0.0)
    total = line.wake_law[:, LIFT_A].sum() + line.wake_law[:, LIFT_B].sum()
    assert total == pytest.approx(107.3 * 0.5 * 1025 * 0.05 * 1.2, rel=1e-12)
    with hybrid.Simulation(shedding()) as sim:
        before = []
        while sim.t < 6.0:
            sim.step()
            wake = OnlyLine(sim).state.wake
            if before and len(wake) > len(before[-1]):
                grown = len(wake) - len(before[-1])
                assert grown == 1
                apart = np.abs(np.diff(wake[:, PHASE])).max()
                assert apart < np.abs(np.diff(before[-1][:, PHASE])).max() + 0.2
            before.append(wake.copy())
    assert len(before[-1]) > len(before[0])


# --- the end at the winch is let go -----------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("clamp", [False, True])
@pytest.mark.parametrize("rate", [1.0, -0.8])
def test_what_is_out_falls_as_it_moves(rate: float, clamp: bool) -> None:
    """A straight line that comes out steadily, and is let go: all of it falls freely with the rate that it had."""
    scene = hanging({"rate": rate, "ramp": 1.0}, 4.0, model="rod", output={"every": 0.25})
    scene["cable"]["sections"][0] |= {"bending_stiffness": 50.0, "torsional_stiffness": 50.0}
    scene["ends"]["end"]["release_at"] = {"time": 3.0}
    if clamp:
        scene = clamped(scene, [0.0, 0.0, 1.0])
    found = hybrid.run(scene)
    at = int(np.abs(found.t - 3.0).argmin())
    assert found["payout/rate"][at + 1 :] == pytest.approx(0.0)
    assert np.ptp(found["payout/length"][at:]) < 1e-12
    out = found["s"] <= found["payout/length"][at] + 1e-9
    z0 = found.position[at, out, 2]
    for k in range(at, len(found.t)):
        t = found.t[k] - 3.0
        assert np.abs(found.position[k, out, 2] - (z0 - rate * t - 0.5 * G * t * t)).max() < 1e-7 * 40.0
    assert np.abs(found["tension"][at + 1 :, out]).max() < 1e-6 * 2.0 * G * 40.0


def released(step: float = 0.05) -> dict[str, Any]:
    scene = clamped(sagging("rod", 2e6, 2e4, step=step, duration=6.0))
    scene["ends"]["end"]["release_at"] = {"time": 4.0}
    return scene


@pytest.mark.long
def test_a_release_is_resumed_bit_for_bit_and_balanced(tmp_path: Path) -> None:
    scene = released()
    scene["ends"]["end"]["payout"]["longest"] = 110.0
    for until in (3.0, 5.0):
        whole = resumed(scene, tmp_path, until)
    # Accelerations jump, so that it is of first order, as of a line of a fixed length.
    left, finer = (np.abs(x["work/scheme"]).max() for x in (whole, hybrid.run(released(0.025))))
    assert left < 1e-2 * whole["energy/kinetic"].max() and finer < 0.6 * left


def test_it_is_released_from_outside() -> None:
    scene = released()
    whole = hybrid.run(scene)
    del scene["ends"]["end"]["release_at"]
    with hybrid.Simulation(scene) as sim:
        while sim.t < 3.99:
            sim.step()
        sim.release("end")
        while sim.t < 5.99:
            sim.step()
        found = sim.result()
    assert np.abs(found.position[-1] - whole.position[-1]).max() < 1e-6
    rate = whole["payout/rate"]  # at the release it is that of the moment before
    assert rate[8] == pytest.approx(0.8) and not rate[9:].any()


# --- tables and fibre ropes ---

STIFF = 2e5
SAME = {"tension_strain": [[0, 0], [0.005, 0.005 * STIFF], [0.1, 0.1 * STIFF]]}
# Close to a constant stiffness, whatever its time.
NEAR = {"axial_stiffness": STIFF, "dynamic_stiffness": {"constant": 1.00001 * STIFF, "relaxation_time": 2.0}}
TABLE = {"tension_strain": [[0, 0], [0.008, 800], [0.012, 1800], [0.05, 20000]]}
ROPE = TABLE | {"dynamic_stiffness": {"constant": 6e5, "per_tension": 10.0, "relaxation_time": 4.0}}


def stretched(
    section: dict[str, Any], rate: float = 0.8, step: float = 0.05, duration: float = 12.0, **more: Any
) -> dict[str, Any]:
    scene = sagging(rate=rate, step=step, duration=duration, **more)
    scene["cable"]["sections"][0] |= section
    return scene


def test_a_winch_holds_its_tension_on_a_rope() -> None:
    """The length is an unknown beside a tension that is no multiple of strain: what remains at rest is what is held."""
    winch = {"tension": 2200.0, "inertia": 200.0, "damping": 100.0, "ramp": 4.0}
    scene = stretched(ROPE, duration=40.0, step=0.2)
    scene["ends"]["end"] |= {"payout": {"winch": winch, "longest": 130.0}, "motion": None}
    scene["environment"] = {"fluid": {"density": 1025}}
    scene["cable"]["sections"][0]["drag"] = {"normal": 1.2}
    found = hybrid.run(scene)
    pull = np.linalg.norm(found["reaction_end"], axis=1)
    assert pull[-1] == pytest.approx(2200.0, rel=5e-3) and pull[0] < 1900.0
