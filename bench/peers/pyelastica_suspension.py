"""The suspension in PyElastica: Cosserat elements in space, the position Verlet scheme, an exact linear damper."""

from __future__ import annotations

import importlib.util
import math
import time

import numpy as np

from peers import suspension

STABLE = 0.7  # of the longest stable step: 2 over the highest frequency


def available() -> bool:
    """Whether the package is installed."""
    return importlib.util.find_spec("elastica") is not None


def run(
    elements: int, axial_stiffness: float | None = None, duration: float = suspension.DURATION
) -> tuple[float, float]:
    """CPU time (s) of its own time loop, and the largest distance (m) to the truth at the end.

    axial_stiffness: N, of a rod that is softer against stretch and shear than its bending stiffness implies, so that
    steps may be longer; None: as it implies, 3.9 kN.
    """
    import elastica

    class Simulator(
        elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing, elastica.Damping
    ):  # fmt: skip
        pass

    simulator = Simulator()
    tx, tz = suspension.TANGENT
    modulus = suspension.BENDING_STIFFNESS / (math.pi * suspension.DIAMETER**4 / 64.0)
    rod = elastica.CosseratRod.straight_rod(
        elements,
        start=np.zeros(3),
        direction=np.array([tx, 0.0, tz]),
        normal=np.array([0.0, 1.0, 0.0]),
        base_length=suspension.LENGTH,
        base_radius=0.5 * suspension.DIAMETER,
        density=suspension.MASS / suspension.AREA,
        youngs_modulus=modulus,
        shear_modulus=0.4 * modulus,
    )
    natural = modulus * suspension.AREA
    if axial_stiffness is not None:
        rod.shear_matrix *= axial_stiffness / natural
    simulator.append(rod)
    # The highest frequencies: of stretch along an element, and of an element that turns against its shear.
    speed = math.sqrt((axial_stiffness or natural) / suspension.MASS)
    turning = rod.shear_matrix[0, 0, 0] / (rod.mass_second_moment_of_inertia[0, 0, 0] * elements / suspension.LENGTH)
    highest = math.hypot(2.0 * speed * elements / suspension.LENGTH, math.sqrt(turning))
    steps = math.ceil(duration / (STABLE * 2.0 / highest))
    dt = duration / steps
    simulator.constrain(rod).using(
        elastica.GeneralConstraint,
        constrained_position_idx=(0,),
        translational_constraint_selector=np.array([True, True, True]),
    )
    simulator.constrain(rod).using(
        elastica.GeneralConstraint,
        constrained_director_idx=(-1,),
        rotational_constraint_selector=np.array([True, True, True]),
    )
    pull = np.array([0.0, 0.0, -suspension.WEIGHT / suspension.MASS])
    simulator.add_forcing_to(rod).using(elastica.GravityForces, acc_gravity=pull)
    force = np.array([suspension.FORCE[0], 0.0, suspension.FORCE[1]])
    simulator.add_forcing_to(rod).using(elastica.EndpointForces, np.zeros(3), force, ramp_up_time=dt)
    simulator.dampen(rod).using(
        elastica.AnalyticalLinearDamper, uniform_damping_constant=suspension.DAMPING, time_step=dt
    )
    simulator.finalize()
    stepper = elastica.PositionVerlet()
    elastica.integrate(stepper, simulator, dt, 1, progress_bar=False)  # compiles
    begin = time.process_time()
    elastica.integrate(stepper, simulator, duration, steps, progress_bar=False)
    cpu = time.process_time() - begin
    s = np.linspace(0.0, suspension.LENGTH, elements + 1)
    x, _, z = np.asarray(rod.position_collection)
    return cpu, suspension.distance(s, x, z)
