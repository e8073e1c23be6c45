"""The march in the plane against the one in space, its Jacobian, and the push out of the plane.

Tolerances: what the two marches solve is the same up to round-off, so steps and equilibria agree to Newton's
tolerance, 1e-9 of the length and of the largest tension; derivatives as in test_jacobian.
"""

import itertools

import numpy as np
import pytest
from test_jacobian import CA, CV, WITHOUT_OBSTACLES, ZONES, assembled, in_soil, random_case, with_tables

from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.algebra.plane import KEPT, TRIPLE, solve_again_planar
from hybrid.kernels.laws.out_of_plane import BAND, REACH, step_out_of_plane, wrong_pivots_at_rest
from hybrid.kernels.run.newton import assembly, block_rows, correction, workspace
from hybrid.kernels.state import report
from hybrid.kernels.state.report import PLANAR, RESIDUAL, RESIDUAL_NODE
from hybrid.kernels.state.state import State
from hybrid.kernels.step.step_control import Scheme

N = 7


def axes(seed, vertical):
    """A random plane (3, 3), rows p, q, normal; where buoyancy changes at the surface it has to be vertical."""
    g = np.random.default_rng(seed)
    if vertical:
        x, y = np.cos(seed + 0.3), np.sin(seed + 0.3)
        return np.array([[x, y, 0.0], [0.0, 0.0, 1.0], [y, -x, 0.0]])
    q = np.linalg.qr(g.normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def flat_case(seed, element, bits, held=(0, 0), anisotropic=False):
    """The random line of test_jacobian, moved into a random plane with all that acts on it."""
    line, sea, ends, st = random_case(seed, element, bits, held)
    g = np.random.default_rng(seed + 100)
    plane = axes(seed, bits & report.SURFACE)
    inside = plane[:2].T @ plane[:2]
    n = plane[2]

    def put(x):
        return np.ascontiguousarray(x @ inside)

    e = put(st.e)
    e *= (np.linalg.norm(st.e, axis=1) / np.linalg.norm(e, axis=1))[:, None]
    d = e / np.linalg.norm(e, axis=1)[:, None]
    m = np.cross(n, d)
    angle = 0.5 * np.pi * g.integers(0, 4) if anisotropic else g.uniform(0, 6)
    a1 = np.cos(angle) * n + np.sin(angle) * m
    r = np.vstack([np.zeros(3), np.cumsum(e, axis=0)])
    st = State(
        r,
        put(st.v),
        put(st.a),
        put(st.vd),
        e,
        st.T,
        a1,
        *(0 * x for x in (st.w, st.wa, st.wd)),
        put(st.slip),
        0 * st.bed,
    )
    kb = line.kb.copy()
    k0 = 0.0 * line.k0
    if anisotropic:  # bent about the normal
        k0[:, 0], k0[:, 1] = 0.2 * np.cos(angle), 0.2 * np.sin(angle)
        k0[np.abs(k0) < 1e-9] = 0.0
    else:
        kb[:, 1] = kb[:, 0]
    line = line._replace(force=put(line.force), kb=kb, k0=k0, bits=bits | PLANAR, plane=plane)
    frames = []
    for f in ends.frame.reshape(2, 3, 3):
        t = put(f[:, 2])
        t /= np.linalg.norm(t)
        a = np.cos(angle) * n + np.sin(angle) * np.cross(n, t)
        frames.append(np.column_stack([a, np.cross(t, a), t]).ravel())
    along = np.outer(n, n)
    ends = ends._replace(
        position=put(ends.position), force=put(ends.force), moment=ends.moment @ along, spin=ends.spin @ along,
        frame=np.array(frames),
    )  # fmt: skip
    normal = put(sea.normal)
    normal /= np.linalg.norm(normal)
    axis = np.cross(n, normal) * g.choice([-1.0, 1.0], (N + 1, 1))
    slip = axis * np.einsum("ij,ij->i", axis, sea.slip)[:, None]
    flow = np.column_stack([put(sea.flow[:, :3]), put(sea.flow[:, 3:6]), sea.flow[:, 6]])
    sea = sea._replace(current=put(sea.current), normal=normal, axis=axis, slip=slip, flow=flow)
    return line, sea, ends, st


def solved(line, sea, ends, st, u, cv=CV, ca=CA):
    """Rows, correction (None where a block is singular) and report of the march."""
    work = workspace(N)._replace(rows=block_rows(line), u=u)
    good = correction(line, sea, ends, st, cv, ca, work) < 0
    return work.rows, work.x if good else None, work.report


def in_space(line, *rest):
    return solved(line._replace(bits=line.bits & ~PLANAR), *rest)


def in_plane(line, *rest):
    return solved(line, *rest)


def assert_same(line, *case):
    """Both marches give the same correction, nothing across the plane, and the same forces, moments and powers."""
    u = np.zeros((N + 1, 3))
    _, x, told = in_space(line, *case, u)
    _, y, said = in_plane(line, *case, u)
    assert x is not None and y is not None
    assert np.abs(x[:, 1:4] @ line.plane[2]).max() < 1e-9 * np.abs(x).max()
    assert np.abs(x[:, :4] - y[:, :4]).max() < 1e-8 * np.abs(x).max()
    largest = slice(RESIDUAL, RESIDUAL_NODE + 1)  # the largest component of a force depends on the axes
    told[largest] = said[largest]
    assert np.abs(told - said)[:22].max() < 1e-9 * np.abs(told).max()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("held", [(0, 0), (1, 0), (1, 1)])
@pytest.mark.parametrize(("zones", "bits"), list(itertools.product(ZONES, WITHOUT_OBSTACLES)))
def test_both_marches_give_the_same_correction(zones, bits, held, seed):
    """So that what is solved in the plane has the derivatives of that in space (test_jacobian)."""
    assert_same(*flat_case(seed, ZONES[zones], bits, held, anisotropic=seed == 1))


@pytest.mark.parametrize("bits", [0, report.STIFFNESS_DAMPING])
@pytest.mark.parametrize("seed", range(3))
def test_both_marches_bend_by_the_same_tables(bits, seed):
    line, *rest = flat_case(seed, ZONES["rod"], bits, (1, 0))
    line = with_tables(line)
    line.kb[4, 2] = 0.8
    assert_same(line, *rest)


@pytest.mark.parametrize("bits", [0, report.FRICTION, report.FRICTION | report.BREAKOUT])
@pytest.mark.parametrize("seed", range(3))
def test_both_marches_lie_in_the_same_soil(bits, seed):
    line, sea, ends, st = flat_case(seed, ZONES["rod"], bits, (1, 0))
    line, sea, st = in_soil(line, sea, st)
    assert_same(line, sea, ends, st)


@pytest.mark.parametrize("held", [(0, 0), (1, 1), (1, 0)])
@pytest.mark.parametrize("zones", ZONES)
def test_kept_factors_solve_any_right_hand_side(zones, held):
    """In the plane as in space, where the right-hand side lies in it; round-off of both."""
    line, sea, ends, st = flat_case(3, ZONES[zones], 2047, held)
    b = np.random.default_rng(8).normal(size=(N + 1, 5))
    b[0, 0] = b[:, 4] = 0.0  # there is no cell before the start, and nothing turns about its axis
    b[:, 1:4] = b[:, 1:4] @ line.plane[:2].T @ line.plane[:2]
    for k, node in ((0, 0), (1, N)):
        if held[k]:
            b[node, 1:4] = 0.0
    found = []
    for bits in (line.bits, line.bits & ~PLANAR):
        work, x = workspace(N, keep=True), np.full((N + 1, 5), np.nan)
        assembly(line._replace(bits=bits), sea, ends, st, CV, CA, work)
        if bits & PLANAR:
            assert solve_again_planar(line.plane, work.X, b, x)
        else:
            assert solve_again(work.X, work.W, b, x)
        found.append(x)
    plane, space = found
    np.testing.assert_allclose(plane, space, rtol=0, atol=1e-8 * np.abs(space).max())


def test_a_singular_block_is_named():
    line, sea, ends, st = flat_case(2, ZONES["catenary"], 0)
    line = line._replace(mass=np.zeros(N + 1), ck=np.zeros(N))
    st.T[:] = 0.0
    assert in_plane(line, sea, ends, st, np.zeros_like(st.r))[1] is None


@pytest.mark.long
@pytest.mark.parametrize("zones", ZONES)
@pytest.mark.parametrize("seed", range(4))
def test_the_push_obeys_the_jacobian_across_the_plane(zones, seed):
    """One step of the push equals the linear answer of the march in space to it, frames and spins included."""
    bits = sum(getattr(report, name) for name in ("DRAG", "ADDED_MASS", "MASS_DAMPING", "FLOW", "BODIES"))
    line, sea, ends, st = flat_case(seed, ZONES[zones], bits, (1, 0), anisotropic=seed > 1)
    if zones == "rod" and seed == 1:
        line = with_tables(line)
        line.kb[4, 2] = 0.8
    st.vd[0] = st.v[0] = 0.0
    n, dt, rho = line.plane[2], 0.2, 0.5
    g = np.random.default_rng(seed)
    was, now, A = np.zeros((N + 1, 4)), np.zeros((N + 1, 4)), np.zeros(45 * (N + 1))
    was[1:, 1] = g.normal(size=N)
    am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    ga = 0.5 - am + af
    be = 0.25 * (ga + 0.5) ** 2
    cv, ca = ga / (be * dt), (1 - am) / ((1 - af) * be * dt * dt)
    step_out_of_plane(line, sea, ends, st, Scheme(dt, am, af, ga, be, cv, ca), was, now, A)
    # the same step in space: J x = b, once as it is and once with the push's prediction in rates and accelerations
    small = 1e-6
    pushed = st._replace(
        v=st.v + small * np.outer(was[:, 1] - cv * dt * was[:, 1], n), vd=st.vd - small * ca * dt * np.outer(was[:, 1], n)
    )  # fmt: skip
    line, still = line._replace(bits=line.bits & ~PLANAR), np.zeros_like(st.r)
    J, b0 = assembled(line, sea, ends, st, still, cv, ca)
    _, b1 = assembled(line, sea, ends, pushed, still, cv, ca)
    x = np.linalg.solve(J, b1 - b0).reshape(-1, 5) / small
    w = x[:, 1:4] @ n
    assert np.abs(w - now[:, 0]).max() < 1e-5 * np.abs(w).max()
    assert np.abs(now[:, 1] - (was[:, 1] + cv * (now[:, 0] - dt * was[:, 1]))).max() < 1e-9 * np.abs(now[:, 1]).max()


def test_band_of_the_push_fits_its_work_array():
    assert workspace(N).X.size >= (2 * (N + 1) + 4) * BAND
    assert workspace(1).X.size >= (2 * 2 + 4) * BAND
    for n in (1, N):  # also behind factors that are kept
        assert workspace(n, keep=True).X[(n + 1) * (TRIPLE + KEPT) :].size >= (2 * (n + 1) + 4) * BAND


@pytest.mark.parametrize("zones", ["rod", "rod-catenary", "three"])
@pytest.mark.parametrize("pressed", [0.0, -0.3, -3.0, -30.0])
def test_stiffness_across_the_plane_is_definite_when_that_in_space_is(zones, pressed):
    """Pivots of the one against a Cholesky factor of the other, both with springs that hold what is free."""
    line, sea, ends, st = flat_case(4, ZONES[zones], report.ADDED_MASS, (1, 1))
    st.T[:] = 2.0 + pressed
    st.v[:] = st.vd[:] = 0.0
    n, soft = line.plane[2], 1e-3
    J = -assembled(line._replace(bits=line.bits & ~PLANAR), sea, ends, st, np.zeros_like(st.r), 0.0, soft)[0]
    across = np.zeros((5 * (N + 1), 2 * (N + 1)))
    for i in range(N + 1):
        across[5 * i + 1 : 5 * i + 4, 2 * i], across[5 * i + 4, 2 * i + 1] = n, 1.0
    keep = [2 * i for i in range(1, N)] + [2 * i + 1 for i in range(N) if line.spin[i]]
    K = (across.T @ J @ across)[np.ix_(keep, keep)]
    lowest = np.linalg.eigvalsh(0.5 * (K + K.T))[0]
    A = np.zeros((2 * (N + 1) + REACH) * BAND)
    assert abs(lowest) > 1e-6
    assert (wrong_pivots_at_rest(line, sea, ends, st, soft, A) == 0) == (lowest > 0.0)
