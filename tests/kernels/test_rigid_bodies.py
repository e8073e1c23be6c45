"""Rigid bodies: derivatives by differences, and steps of a body that nothing turns."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.kernels.junctions import bodies as k
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.step.step_control import scheme as k_scheme


@kernel
def rotation_of(n, out):
    k.put_matrix(out, 0, k.rotation((n[0], n[1], n[2])))


@kernel
def change(bodies, old, new, work, x, cv, ca, out):
    """The change of the forces by a correction x (6,)."""
    F, M = k.own_change(bodies[0], new[0], work[0], (x[0], x[1], x[2]), (x[3], x[4], x[5]), cv, ca)
    k.put(out, 0, F)
    k.put(out, 3, M)


@kernel
def force_after(bodies, old, new, work, cv, ca):
    """Forces after the corrections in `work`."""
    k.move_bodies(new, work, cv, ca, 1.0)
    k.own_force(bodies[0], old[0], new[0], work[0])


@kernel
def predict(old, new, work, dt):
    k.predict_bodies(old, new, work, k_scheme(0.8, dt, 0.8, dt))


def random_body(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of a body with all there is, and a state in which all moves."""
    body, state = rng.uniform(-1.0, 1.0, (1, k.NUMBERS)), rng.uniform(-1.0, 1.0, (1, k.STATE))
    for at in (k.MASS, k.DAMPING):
        half = rng.uniform(-1.0, 1.0, (6, 6))
        body[0, at : at + 36] = (half @ half.T + np.eye(6)).ravel()
    state[0, k.FRAME : k.V] = np.linalg.qr(rng.uniform(-1.0, 1.0, (3, 3)))[0].ravel()
    state[0, k.FRAME : k.V] *= np.sign(np.linalg.det(state[0, k.FRAME : k.V].reshape(3, 3)))
    return body, state


def test_a_rotation_is_the_exponential_of_its_vector() -> None:
    from scipy.linalg import expm

    for size in (1e-9, 1e-4, 0.3, 3.0):
        n, out = size * np.array([0.6, -0.48, 0.64]), np.zeros(9)
        rotation_of(n, out)
        K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
        assert np.abs(out.reshape(3, 3) - expm(K)).max() < 1e-14


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_the_change_of_the_forces_of_a_body_against_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body, old = random_body(rng)
    new, work, dt, cv, ca = old.copy(), np.zeros((1, k.WORK)), 0.4, 3.0, 7.0
    predict(old, new, work, dt)
    x = rng.uniform(-1.0, 1.0, 6)
    exact = np.zeros(6)
    change(body, old, new, work, x, cv, ca, exact)
    step, sides = 1e-6, []
    for sign in (-1.0, 1.0):
        there, room = new.copy(), work.copy()
        room[0, k.X : k.X + 6] = sign * step * x
        force_after(body, old, there, room, cv, ca)
        sides.append(room[0, k.OWN : k.OWN + 6].copy())
    by_differences = (sides[1] - sides[0]) / (2.0 * step)
    assert np.abs(exact).max() > 1.0
    assert np.abs(by_differences - exact).max() < 1e-8 * np.abs(exact).max()
