"""Torque by tension: its derivatives against differences on random states, its energy, its factors kept."""

import numpy as np
import pytest
from kernels.test_jacobian import CA, CV, ZONES, N, random_case
from kernels.test_zone_torque import LINES, differences, twisted_case
from kernels.test_zone_torque import residual as zone_residual

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.march import update
from hybrid.kernels.run.newton import assembly, block_rows, correction, workspace_of
from hybrid.kernels.state.report import AXIAL_LAW, ROTARY, STIFFNESS_DAMPING, STRETCH_ENERGY
from hybrid.kernels.state.state import NO_LAW, blank_state

LAST = [5 * i + 4 for i in range(N + 1)]


def with_torque(line, seed=5):
    """The same, of sections in which tension makes a torque; the fourth cell's has none."""
    g = np.random.default_rng(seed)
    c, twist = g.uniform(-0.4, 0.8, (2, N))
    c[3] = twist[3] = 0.0
    return line._replace(tension_torque=c, tension_twist=np.abs(twist) * np.sign(c))


def with_law(line, st):
    """The same, of which all cells but the second have a table of tension over strain; its state."""
    strain, tension = np.array([[-0.4, -1.1], [-0.1, -0.3], [0.1, 0.2], [0.5, 2.0]]).T
    energy = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(strain) * (tension[1:] + tension[:-1]))])
    law = np.zeros((N, NO_LAW.shape[1]))
    law[:, 1] = 4.0
    law[1] = 0.0
    line = line._replace(bits=line.bits | AXIAL_LAW, law=law, law_table=np.column_stack([strain, tension, energy]))
    return line, st._replace(slow=np.zeros(N))


def residual(line, sea, ends, st, x):
    work = workspace_of(line)
    moved, s = work._replace(x=np.ascontiguousarray(x), rows=block_rows(line)), st.copy()
    update(None, 1, line, s, CV, CA, 1.0, False, moved)
    assembly(line, sea, ends, s, CV, CA, moved)
    return moved.rows.reshape(N + 1, SIZE, WIDTH)[:, :, 23].ravel()


def folded(J, line, sea, ends, st):
    """The matrix that the march has: of an element's twist by tension all goes to the cell before it, but in lengths."""
    J = J.copy()
    for j in range(1, N):
        if line.element[j]:
            rhs = []
            for t in (-1e-4, 1e-4):
                k0 = line.k0.copy()
                k0[j, 2] -= t
                rhs.append(residual(line._replace(k0=k0), sea, ends, st, np.zeros((N + 1, 5))))
            by_twist = line.tension_twist[j] * (rhs[0] - rhs[1]) / 2e-4
            by_twist[::5] = 0.0
            J[:, 5 * j] += by_twist
            J[:, 5 * j + 5] -= by_twist
    return J


def march_of(line, sea, ends, st):
    """Dense matrix of the block rows."""
    work = workspace_of(line)._replace(rows=block_rows(line))
    assembly(line, sea, ends, st, CV, CA, work)
    J = np.zeros((5 * (N + 1), 5 * (N + 1) + 25))
    for i in range(N + 1):
        block = work.rows[i].reshape(SIZE, WIDTH)
        J[5 * i : 5 * i + 5, 5 * i : 5 * i + 20] = block[:, :20]
        J[5 * i : 5 * i + 5, 5 * i + 21 : 5 * i + 24] = block[:, 20:23]
    return J[:, 10 : 10 + 5 * (N + 1)]


@pytest.mark.parametrize("bits", [0, ROTARY, STIFFNESS_DAMPING | ROTARY])
@pytest.mark.parametrize("law", [False, True], ids=["stiffness", "law"])
@pytest.mark.parametrize("zones", ["rod", "rod-catenary", "catenary"])
def test_the_matrix_is_the_derivative_of_the_residual(zones, law, bits):
    line, sea, ends, st = random_case(3, ZONES[zones], bits)
    line = with_torque(line)
    if law:
        line, st = with_law(line, st)
    J = march_of(line, sea, ends, st)
    exact = folded(-differences(lambda x: residual(line, sea, ends, st, x), 5 * (N + 1)), line, sea, ends, st)
    missing = [0] + [k for i, k in enumerate(LAST) if i == N or not line.spin[i]]
    exact[missing, missing] = 1.0
    # of the twist of a damped element the turn of its axis is left out of the length, where the axis is that of the
    # element
    close = 1e-6 if not bits & STIFFNESS_DAMPING else 0.03
    assert np.abs(J - exact).max() < close * np.abs(J).max()
    plain = march_of(line._replace(tension_torque=np.zeros(0), tension_twist=np.zeros(0)), sea, ends, st)
    assert np.abs(J - plain).max() > 1e-3 * np.abs(J).max()


@pytest.mark.parametrize("law", [False, True], ids=["stiffness", "law"])
@pytest.mark.parametrize("name", LINES)
def test_zones_pass_it(name, law):
    """The corrected solution is that of the differences, with the torque of zones in the lengths of their cells."""
    line, sea, ends, st, _ = twisted_case(name, 0)
    line = with_torque(line)
    if law:
        line, st = with_law(line, st)
    work = workspace_of(line)
    rhs, _ = zone_residual(line, sea, ends, st, work, np.zeros((N + 1, 5)))
    J = folded(-differences(lambda x: zone_residual(line, sea, ends, st, work, x)[0], 5 * (N + 1)), line, sea, ends, st)
    missing = [0] + [k for i, k in enumerate(LAST) if i == N or not line.spin[i]]
    J[missing, missing] = 1.0
    assert correction(line, sea, ends, st, CV, CA, work) == -1
    x = np.linalg.solve(J, rhs)
    np.testing.assert_allclose(work.x.ravel(), x, atol=5e-6 * np.abs(x).max())


def test_kept_factors_solve_for_another_right_hand_side():
    line, sea, ends, st = random_case(3, ZONES["rod"], 0)
    line = with_torque(line)
    work = workspace_of(line, keep=True)
    assert correction(line, sea, ends, st, CV, CA, work) == -1
    b, x = np.random.default_rng(1).normal(size=(2, N + 1, 5))
    b[0, 0] = b[N, 4] = 0.0
    assert solve_again(work.X, work.W, b, x)
    np.testing.assert_allclose(march_of(line, sea, ends, st) @ x.ravel(), b.ravel(), atol=1e-9)


def energy_of(line, sea, ends, st):
    found, room, work = np.zeros(5), np.zeros((2, N + 1, 3)), workspace_of(line)
    observe(line, ends, st.e, st.v, st.a1, st.w, st.T, st.turn, Observed(*room, found))
    assembly(line, sea, ends, st, 0.0, 0.0, work)
    return found[1:4].sum() + work.report[STRETCH_ENERGY]


@pytest.mark.parametrize("law", [False, True], ids=["stiffness", "law"])
def test_forces_and_torques_follow_from_the_energy(law):
    """Of tensions that the lengths and twists ask for, forces are the derivatives of the energy by nodes and spins."""
    line, sea, ends, st = random_case(3, ZONES["rod"], 0)
    line = with_torque(line)._replace(mass=np.zeros(N + 1), force=np.zeros((N + 1, 3)))
    if law:
        line, st = with_law(line, st)
    ends.force[:], ends.moment[:] = 0.0, 0.0
    st.v[:], st.vd[:] = 0.0, 0.0

    def settled(x):
        """The state moved by x (N+1, 5), with the tensions of its lengths; what is out of balance in it."""
        s, work = st.copy(), workspace_of(line)
        work = work._replace(x=np.ascontiguousarray(x), rows=block_rows(line))
        update(None, 1, line, s, 0.0, 0.0, 1.0, False, work)
        for _ in range(60):
            assembly(line, sea, ends, s, 0.0, 0.0, work)
            rows = work.rows.reshape(N + 1, SIZE, WIDTH)
            s.T[:] += rows[1:, 0, 23] / rows[1:, 0, 10]
        return s, rows[:, :, 23]

    _, left = settled(np.zeros((N + 1, 5)))
    assert np.abs(left[1:, 0]).max() < 1e-12
    for i, k in [(0, 1), (3, 2), (4, 3), (N, 1), (0, 4), (3, 4), (4, 4)]:
        t, E = 1e-5, []
        for sign in (-1.0, 1.0):
            x = np.zeros((N + 1, 5))
            x[i, k] = sign * t
            E.append(energy_of(line, sea, ends, settled(x)[0]))
        assert left[i, k] == pytest.approx((E[1] - E[0]) / (2.0 * t), rel=1e-6, abs=1e-6)


def test_a_state_of_a_plain_line_has_empty_arrays():
    line, *_ = random_case(3, ZONES["rod"], 0)
    assert line.tension_twist.size == 0 and workspace_of(line).couple.shape[0] == 0 and blank_state(N).turn.size == 0
