"""Torque through catenary zones, and by tension: derivatives and solves, against differences on random states."""

import numpy as np
import pytest
from kernels.test_jacobian import CA, CV, ZONES, N, random_case

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.march import update
from hybrid.kernels.march.zone_torque import REPORT, TORQUES, pass_torque
from hybrid.kernels.run.newton import assembly, block_rows, correction, workspace, workspace_of
from hybrid.kernels.state.report import AXIAL_LAW, MASS_DAMPING, ROTARY, STIFFNESS_DAMPING, STRETCH_ENERGY
from hybrid.kernels.state.state import NO_LAW, blank_state

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
    pass_torque(line, ends, st, work, TORQUES, 0.0)
    pass_torque(line, ends, st, work, REPORT, 0.0)
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
        pass_torque(line, e, s, moved, TORQUES, 0.0)
        pass_torque(line, e, s, moved, REPORT, 0.0)
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
    pass_torque(line, ends, st, work, TORQUES, 0.0)
    first = st.turn[0, 0]
    d = st.e[5] / np.linalg.norm(st.e[5])
    for _ in range(40):
        st.a1[5] = np.cross(d, st.a1[5])
        pass_torque(line, ends, st, work, TORQUES, 0.0)
    assert st.turn[0, 0] - first == pytest.approx(20.0 * np.pi, rel=1e-12)


# --- torque by tension: derivatives against differences on random states, energy, factors kept ---

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


def residual_of_rods(line, sea, ends, st, x):
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
                rhs.append(residual_of_rods(line._replace(k0=k0), sea, ends, st, np.zeros((N + 1, 5))))
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
    exact = folded(-differences(lambda x: residual_of_rods(line, sea, ends, st, x), 5 * (N + 1)), line, sea, ends, st)
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
    rhs, _ = residual(line, sea, ends, st, work, np.zeros((N + 1, 5)))
    J = folded(-differences(lambda x: residual(line, sea, ends, st, work, x)[0], 5 * (N + 1)), line, sea, ends, st)
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
