"""A body on a spring that carries the end of a cable: order in time, and the energy of both together."""

from __future__ import annotations

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
    """Height of the body at multiples of 0.1 s (m), and what body and cable gain together over the spring's energy."""

    height: np.ndarray
    imbalance: float


def couple(step: float, duration: float, agreed: bool) -> Coupled:
    """The body by the trapezoidal rule; agreed: steps are repeated until both forces agree, else each is one behind."""
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
                if abs(found - wanted) < 1e-10:
                    break
                wanted = found
            z, v, a = next_z, next_v, found
            heights.append(z)
        work = cable.result().work["end"][-1]
    body = 0.5 * MASS * v * v + 0.5 * SPRING * (z * z - LIFTED**2) + rest * (z - LIFTED)
    every = round(0.1 / step)
    return Coupled(np.array(heights[every - 1 :: every]), (body + work) / (0.5 * SPRING * LIFTED**2))


@pytest.mark.parametrize(("agreed", "order"), [(True, 2.0), (False, 1.0)])
def test_steps_that_are_repeated_are_of_order_two_and_staggered_ones_of_order_one(agreed: bool, order: float) -> None:
    coarse, middle, fine, finest = (couple(step, 12.0, agreed).height for step in (0.1, 0.05, 0.025, 0.0125))
    ratios = np.log2(
        [abs(coarse - middle).max() / abs(middle - fine).max(), abs(middle - fine).max() / abs(fine - finest).max()]
    )
    assert ratios[1] == pytest.approx(order, abs=0.25)


def test_the_energy_of_body_and_cable_is_balanced() -> None:
    assert abs(couple(0.05, 60.0, agreed=True).imbalance) < 1e-4


@pytest.mark.slow
def test_the_energy_does_not_drift_over_a_hundred_periods() -> None:
    assert abs(couple(0.05, 100 * PERIOD, agreed=True).imbalance) < 1e-4
