"""A body on a spring that carries the end of a cable: order in time, and the energy of both together."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import hybrid

SCENE = """
cable: {{sections: [{{length: 60.0, mass: 3.0, axial_stiffness: 2e6, diameter: 0.02, damping: {{stiffness: 0.01}}}}]}}
ends: {{start: {{kind: pinned, position: [0, 0, 0]}}, end: {{kind: pinned, position: [50, 0, 0]}}}}
initial: equilibrium
model: catenary
mesh: {{cells: 20}}
time: {{duration: {duration}, step: {step}}}
output: {{every: 1}}
"""
MASS, PERIOD, LIFTED = 2000.0, 6.0, 0.5  # kg, s, m
SPRING = MASS * (2.0 * np.pi / PERIOD) ** 2  # N/m


class Coupled(NamedTuple):
    """Height of the body at multiples of 0.1 s (m), what body and cable gain together over the spring's energy, and
    tries of a step on average."""

    height: np.ndarray
    imbalance: float
    tries: float


def couple(step: float, duration: float, agreed: bool, newton: bool = False) -> Coupled:
    """The body by the trapezoidal rule; agreed: steps are repeated until both forces agree, else each is one behind.

    newton: the next acceleration is guessed with the interface stiffness of the cable, else it is the one found.
    """
    tries = 0
    with hybrid.Simulation(hybrid.parse_scene(SCENE.format(duration=duration, step=step))) as cable:
        rest = cable.forces().end[2]
        z, v, a, heights = LIFTED, 0.0, -SPRING * LIFTED / MASS, []
        for _ in range(round(duration / step)):
            before, wanted = cable.save(), a
            for _ in range(50 if agreed else 1):
                next_v = v + 0.5 * step * (a + wanted)
                next_z = z + 0.5 * step * (v + next_v)
                cable.restore(before)
                cable.set_end("end", [50.0, 0.0, next_z - LIFTED], [0.0, 0.0, next_v])
                cable.step()
                found = (cable.forces().end[2] - rest - SPRING * next_z) / MASS
                tries += 1
                if abs(found - wanted) < 1e-10:
                    break
                give = 0.0
                if newton:  # d found / d wanted, by the place that is reached
                    give = -0.25 * step * step * (cable.stiffness("end")[2, 2] + SPRING) / MASS
                wanted += (found - wanted) / (1.0 - give)
            z, v, a = next_z, next_v, found
            heights.append(z)
        work = cable.result().work["end"][-1]
    body = 0.5 * MASS * v * v + 0.5 * SPRING * (z * z - LIFTED**2) + rest * (z - LIFTED)
    every = round(0.1 / step)
    energy = 0.5 * SPRING * LIFTED**2
    return Coupled(np.array(heights[every - 1 :: every]), (body + work) / energy, tries * step / duration)


@pytest.mark.long
@pytest.mark.parametrize(("agreed", "order"), [(True, 2.0), (False, 1.0)])
def test_steps_that_are_repeated_are_of_order_two_and_staggered_ones_of_order_one(agreed: bool, order: float) -> None:
    coarse, middle, fine = (couple(step, 6.0, agreed).height for step in (0.05, 0.025, 0.0125))
    assert np.log2(abs(coarse - middle).max() / abs(middle - fine).max()) == pytest.approx(order, abs=0.25)


@pytest.mark.long  # 0.9 s
def test_the_energy_of_body_and_cable_is_balanced() -> None:
    assert abs(couple(0.05, 30.0, agreed=True).imbalance) < 1e-4


def test_newton_with_the_interface_stiffness_takes_fewer_tries_to_the_same_motion() -> None:
    plain, newton = (couple(0.05, 12.0, True, way) for way in (False, True))
    print(f"{plain.tries:.2f} tries of a step by plain repetition, {newton.tries:.2f} by Newton's method")
    assert newton.height == pytest.approx(plain.height, abs=1e-8)
    assert newton.tries < 3.2 < plain.tries
    assert abs(newton.imbalance) < 1e-4


@pytest.mark.slow
def test_the_energy_does_not_drift() -> None:
    """By less than 5e-5 in a hundred periods, of which twenty are enough once the first ten are over."""
    early, late = (couple(0.05, n * PERIOD, True, newton=True).imbalance for n in (10, 30))
    assert abs(late - early) < 1e-5 and abs(late) < 1e-4


# examples/contact/mujoco_vehicle.py: what its header says, where MuJoCo is installed.


EXAMPLE = Path(__file__).parents[2] / "examples" / "contact" / "mujoco_vehicle.py"


@pytest.mark.needs("mujoco")
def test_a_tether_in_mujocos_loop_pulls_the_vehicle_and_the_pile() -> None:
    script = runpy.run_path(str(EXAMPLE))
    found = script["main"](21.0)
    result, stiffness, mu = found.result, 2000.0, script["FRICTION"]
    assert not {x.kind for x in result.events} - {"static friction neglected"}
    # both programs have the same places, output for output
    at = np.searchsorted(script["STEP"] * np.arange(1, len(found.vehicle) + 1), result.times[1:] - 1e-9)
    np.testing.assert_allclose(result.position[1:, -1], found.vehicle[at], atol=1e-9)
    np.testing.assert_allclose(result["obstacles/pile/position"][1:], found.pile[at], atol=1e-9)
    # slow as it is, the pile stands where its springs bear what the tether does to it
    push = result["obstacles/pile/force"][-1]
    np.testing.assert_allclose(stiffness * (found.pile[-1] - script["PILE"])[:2], push[:2], rtol=0.05, atol=1.0)
    # the friction that the tether needs to slide: no more than all of it, round the angle between both ends' pulls
    first, last = found.tension[-1]
    x = result.position[-1]
    out, back = x[0] - x[5], x[-1] - x[-6]
    bend = np.pi - np.arccos(out @ back / (np.linalg.norm(out) * np.linalg.norm(back)))
    angle = bend if x[-1, 1] > 0.0 else 2.0 * np.pi - bend
    assert 1.2 * first < last < 1.05 * first * np.exp(mu * angle)
    assert np.linalg.norm(found.pile[-1] - script["PILE"]) > 0.01
