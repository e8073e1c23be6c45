"""Torque through catenary zones: its derivatives and its bordered solve, against differences on random states."""

import numpy as np
import pytest
from kernels.test_jacobian import CA, CV, N, random_case

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.march.march import update
from hybrid.kernels.march.zone_torque import AFTER_STEP, BEFORE_MARCH, pass_torque
from hybrid.kernels.run.newton import assembly, block_rows, correction, workspace, workspace_of
from hybrid.kernels.state.report import MASS_DAMPING, ROTARY, STIFFNESS_DAMPING

# Elements at nodes 0 to N, and the zones that follow.
LINES = {
    "between rods": ([1, 1, 1, 0, 0, 0, 1, 1], [(3, 5)]),
    "at the start": ([0, 0, 0, 0, 1, 1, 1, 1], [(0, 3)]),
    "at the end": ([1, 1, 1, 1, 0, 0, 0, 0], [(4, 7)]),
    "two, and a rod between them": ([1, 1, 0, 0, 1, 0, 0, 1], [(2, 3), (5, 6)]),
    "both ends": ([0, 0, 0, 1, 1, 0, 0, 0], [(0, 2), (5, 7)]),
    "all of the line": ([0] * 8, [(0, 7)]),
}
BITS = [0, ROTARY, MASS_DAMPING | ROTARY, STIFFNESS_DAMPING]


def twisted_case(name, bits, seed=3):
    """A random case with zones of random compliance, and its workspace."""
    element, zones = LINES[name]
    line, sea, ends, st = random_case(seed, element, bits)
    g = np.random.default_rng(seed + 7)
    rows = [(a, b, g.uniform(0.5, 2.0), 0.1, 0.0) for a, b in zones]
    line = line._replace(torsion=np.array(rows))
    st = st._replace(turn=np.zeros((len(zones), 3)))
    return line, sea, ends, st, workspace_of(line)


def residual(line, sea, ends, st, work, x):
    """Right-hand side (5 (N+1),) after the configuration is moved by x."""
    s = st.copy()
    moved = work._replace(x=np.ascontiguousarray(x), u=np.zeros((N + 1, 3)), rows=block_rows(line))
    update(None, 1, line, s, CV, CA, 1.0, False, moved)
    assembly(line, sea, ends, s, CV, CA, moved)
    return moved.rows.reshape(N + 1, SIZE, WIDTH)[:, :, 23].ravel(), s.turn[:, 0].copy()


def differences(function, n, t=1e-4):
    columns = []
    for j in range(n):
        x = np.zeros(n)
        x[j] = t
        f = [function((k * x).reshape(-1, 5)) for k in (-2, -1, 1, 2)]
        columns.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * t))
    return np.array(columns).T


@pytest.mark.parametrize("bits", BITS)
@pytest.mark.parametrize("name", LINES)
def test_the_corrected_solution_solves_the_derivative_of_the_residual(name, bits):
    """Newton's direction of the march and the dense system is that of differences of the residual with torque in it."""
    line, sea, ends, st, work = twisted_case(name, bits)
    rhs, _ = residual(line, sea, ends, st, work, np.zeros((N + 1, 5)))
    J = -differences(lambda x: residual(line, sea, ends, st, work, x)[0], 5 * (N + 1))
    missing = [0] + [5 * i + 4 for i in range(N + 1) if i == N or not line.spin[i]]
    J[missing, missing] = 1.0
    first = st.copy()
    assert correction(line, sea, ends, st, CV, CA, work) == -1
    x = np.linalg.solve(J, rhs)
    np.testing.assert_allclose(work.x.ravel(), x, atol=2e-6 * np.abs(x).max())
    # and the turns that it foresees are those of the configuration, to first order
    t = 1e-4
    turns = [residual(line, sea, ends, first, work, k * t * work.x)[1] for k in (-1, 1)]
    if name != "all of the line":  # found after a step
        before = residual(line, sea, ends, first, work, 0.0 * work.x)[1]
        scale = np.abs(x).max()
        np.testing.assert_allclose(st.turn[:, 0] - before, (turns[1] - turns[0]) / (2.0 * t), atol=1e-4 * scale)
    if name != "all of the line":  # and the torque is what makes it so
        other = workspace(N, keep=True)
        line, st = line._replace(torsion=np.zeros((0, 5))), st._replace(turn=np.zeros((0, 3)))
        assert correction(line, sea, ends, st, CV, CA, other) == -1
        assert np.abs(other.x.ravel() - x).max() > 1e-3 * np.abs(x).max()


@pytest.mark.parametrize("name", LINES)
def test_rate_of_the_turn(name):
    """By spins and by chords, against the difference of the turn over a short time in which all moves and ends turn."""
    line, _, ends, st, work = twisted_case(name, 0)
    pass_torque(line, ends, st, work, BEFORE_MARCH, 0.0)
    pass_torque(line, ends, st, work, AFTER_STEP, 0.0)
    torque, power = st.turn[:, 1].copy(), st.turn[:, 2].copy()
    np.testing.assert_allclose(torque * line.torsion[:, 2], st.turn[:, 0] - 0.1, rtol=1e-12)

    def turn_at(t):
        s, e = st.copy(), ends._replace(frame=ends.frame.copy())
        moved = work._replace(x=np.zeros((N + 1, 5)), u=np.zeros((N + 1, 3)))
        moved.x[:, 1:4], moved.x[:-1, 4] = t * st.v, t * st.w
        update(None, 1, line, s, 0.0, 0.0, 1.0, False, moved)
        for k in range(2):
            q = t * ends.spin[k]
            size = np.linalg.norm(q)
            K = np.cross(q / size, np.eye(3)).T if size else np.zeros((3, 3))
            turn = np.eye(3) + np.sin(size) * K + (1 - np.cos(size)) * K @ K
            e.frame[k] = (turn @ ends.frame[k].reshape(3, 3)).ravel()
        pass_torque(line, e, s, moved, BEFORE_MARCH, 0.0)
        pass_torque(line, e, s, moved, AFTER_STEP, 0.0)
        return s.turn[:, 0]

    t = 1e-3
    rate = (turn_at(-2 * t) - 8 * turn_at(-t) + 8 * turn_at(t) - turn_at(2 * t)) / (12 * t)
    spins = np.array([
        (st.w[int(b)] if b < N else ends.spin[1] @ ends.frame[1, 2::3])
        - (st.w[int(a) - 1] if a > 0 else ends.spin[0] @ ends.frame[0, 2::3])
        for a, b in line.torsion[:, :2]
    ])  # fmt: skip
    np.testing.assert_allclose(rate - spins, power / torque, atol=1e-8)


def test_turns_are_counted_on():
    """A frame that goes round and round, a quarter at a time, ten times."""
    line, _, ends, st, work = twisted_case("between rods", 0)
    pass_torque(line, ends, st, work, BEFORE_MARCH, 0.0)
    first = st.turn[0, 0]
    d = st.e[5] / np.linalg.norm(st.e[5])
    for _ in range(40):
        st.a1[5] = np.cross(d, st.a1[5])
        pass_torque(line, ends, st, work, BEFORE_MARCH, 0.0)
    assert st.turn[0, 0] - first == pytest.approx(20.0 * np.pi, rel=1e-12)
