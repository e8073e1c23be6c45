"""Every hand-written derivative against differences of the residual, on random three-dimensional states.

Tolerance: the residual is smooth and of order one; a fourth-order central difference
with step 1e-4 has round-off near 1e-11, and is small enough to stay clear of the kinks of |ut| ut, so 1e-6 of the
largest entry catches any wrong term while a correct Jacobian passes with room to spare.
"""

import itertools

import numpy as np
import pytest

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.march import update
from hybrid.kernels.run.newton import assembly, block_rows, correction, workspace
from hybrid.kernels.state.report import (
    ADDED_MASS,
    BEGAN,
    BENDING_LAW,
    BODIES,
    BREAKOUT,
    CARRIED,
    DRAG,
    EACH,
    ENDED,
    FLOW,
    FRICTION,
    MASS_DAMPING,
    OBSTACLES,
    PLACE,
    ROTARY,
    SEABED,
    SOIL,
    SPEED,
    STIFFNESS_DAMPING,
    SURFACE,
    SWEEP,
    TURNING,
    VORTICES,
    WAVES,
)
from hybrid.kernels.state.state import NO_CARRIED, NO_GRIP, NO_MOVES, NO_ROOM, Ends, Line, Sea, blank_state
from hybrid.model.obstacles import surface_of
from hybrid.scene.obstacles import Mesh

N = 7
CV, CA = 3.0, 7.0
# A plane, a sphere, an endless cylinder, one with round ends, a box, a torus, a sheave and a mesh that the line of
# `random_case` runs through, each with the numbers of kernels.state.report.
X, UP, NO = [1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [0.0] * 6
OBSTACLES_THERE = np.array([
    [0, 0.0, 0.0, -3.0, *UP, *X, 0.1, 0.0, *NO, 0.1, 0.2, 2.0, 0.3, 40.0, 0.3],
    [1, 2.0, 1.0, 0.5, 0.0, 0.0, 1.0, *X, 2.0, 0.0, *NO, 0.1, 0.5, 3.0, 0.4, 50.0, 0.4],
    [1, 4.0, -1.0, 1.0, 0.0, 0.8, 0.6, *X, 1.5, np.inf, *NO, 0.1, 0.4, 4.0, 0.2, 50.0, 3.0],
    [1, 5.0, 2.0, -1.5, *UP, *X, 1.5, 1.0, *NO, 0.1, 0.0, 2.0, 0.5, 60.0, 0.2],
    [2, 5.0, 0.0, 0.0, *UP, 0.0, 1.0, 0.0, 0.6, 0.5, 0.4, 0.3, *NO[:4], 0.1, 0.4, 2.0, 0.4, 50.0, 0.3],
    [3, 3.0, 0.0, 0.0, *UP, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.5, 0.0, 0.0, 0.0, 0.1, 0.3, 3.0, 0.3, 50.0, 0.4],
    [4, 1.0, -2.0, 0.0, *UP, 0.0, 1.0, 0.0, 1.5, 0.0, 0.0, 0.0, 2.0, 0.8, 0.5, 0.0, 0.1, 0.2, 2.0, 0.2, 50.0, 0.3],
    [5, 4.5, 0.5, -0.5, *UP, 0.0, 1.0, 0.0, 0.5, 0.0, *NO, 0.1, 0.3, 2.0, 0.3, 50.0, 0.3],
])  # fmt: skip
HULL = surface_of(Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1.2, 0], [0, 0, 0.8]]),
                       np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])))  # fmt: skip
ZONES = {
    "rod": [1] * (N + 1),
    "catenary": [0] * (N + 1),
    "rod-catenary": [1, 1, 1, 0, 0, 0, 0, 0],
    "catenary-rod": [0, 0, 0, 0, 0, 1, 1, 1],
    "three": [0, 0, 1, 1, 0, 0, 1, 0],
}
LAND = DRAG | ADDED_MASS | MASS_DAMPING | STIFFNESS_DAMPING | ROTARY
BITS = [
    0, DRAG, ADDED_MASS, MASS_DAMPING, STIFFNESS_DAMPING, ROTARY, LAND, DRAG | FLOW, WAVES | ADDED_MASS | DRAG, SURFACE,
    BODIES | FLOW, SEABED, SEABED | FRICTION, 2047, OBSTACLES, OBSTACLES | SEABED | FRICTION,
]  # fmt: skip
# Scenes with obstacles are in space, without zones that move and without estimated errors (hybrid.scene.combinations):
# the march in the plane and the error of neglecting bending know no obstacles.
WITHOUT_OBSTACLES = [bits for bits in BITS if not bits & OBSTACLES]


def random_case(seed, element, bits, held=(0, 0)):
    """A line of N cells in a random, strongly bent and moving configuration with all parameters of order one."""
    g = np.random.default_rng(seed)
    h = g.uniform(0.5, 1.5, N)
    hn = np.zeros(N + 1)
    hn[:-1] += h / 2
    hn[1:] += h / 2
    element = np.array(element, np.int8)
    spin = np.array([element[i] or element[i + 1] for i in range(N)], np.int8)

    def p(*shape):
        return g.uniform(0.5, 1.5, shape)

    line = Line(
        s=np.concatenate([[0], np.cumsum(h)]), h=h, ck=0.3 * p(N), mass=p(N + 1), force=g.normal(size=(N + 1, 3)),
        element=element, spin=spin, kb=p(N + 1, 3), k0=0.2 * g.normal(size=(N + 1, 3)), hn=hn, rotary=p(N),
        polar=p(N), drag_n=p(N), drag_t=p(N), added_n=p(N), added_t=p(N), damp=p(N + 1), tau=0.2 * p(N),
        buoy=p(N), displaced=p(N), diameter=3.0 * p(N), point_mass=p(N + 1), point_drag=p(N + 1), point_added=p(N + 1),
        point_buoy=p(N + 1), point_displaced=p(N + 1), point_height=4.0 * p(N + 1), point_upright=np.arange(N + 1) % 2.0,
        footing=p(N + 1), point_lift=np.linspace(-1.0, 1.0, N + 1), point_floats=np.linspace(0.2, 0.9, N + 1), bits=bits,
    )  # fmt: skip
    sea = random_sea(g)
    frames = [np.linalg.qr(g.normal(size=(3, 3)))[0] for _ in range(2)]
    ends = Ends(
        np.array(held, np.int8), g.normal(size=(2, 3)),
        np.array([(f * np.sign(np.linalg.det(f))).ravel() for f in frames]),
        g.normal(size=(2, 3)), g.normal(size=(2, 3)), g.normal(size=(2, 3)),
    )  # fmt: skip
    st = blank_state(N)
    d = np.array([1.0, 0.3, -0.2]) + 0.35 * g.normal(size=(N, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    st.e[:] = d * h[:, None] * g.uniform(0.9, 1.1, N)[:, None]
    st.r[1:] = np.cumsum(st.e, axis=0)
    for x in (st.v, st.vd, st.w, st.wd, st.T):
        x[:] = g.normal(size=x.shape)
    a = np.cross(d, g.normal(size=(N, 3)))
    st.a1[:] = a / np.linalg.norm(a, axis=1)[:, None]
    return line, sea, ends, st


def random_sea(g):
    """Everything that can surround a line near the origin, with the surface and the seabed running through it."""
    normal = np.array([0.1, -0.2, 1.0])
    axis = g.normal(size=(N + 1, 3))
    normal /= np.linalg.norm(normal)
    axis -= np.outer(axis @ normal, normal)
    slip = 0.3 * g.normal(size=(N + 1, 3))  # some stick and some slide
    slip -= np.outer(slip @ normal, normal)
    return Sea(
        z=np.array([-9.0, 9.0]), current=g.normal(size=(2, 3)), waves=np.zeros((0, 6)), orbits=np.zeros(0), stretched=1.0,
        depth=np.inf, surface=0.3,
        now=np.array([0.0, 0.7, 1.0, 0.0]), ramps=np.zeros(2), normal=normal, offset=0.2,
            bed_x=np.zeros(0), bed_y=np.zeros(0), bed_heights=np.zeros((0, 4)), stiffness=3.0, damping=0.5, onset=50.0, obstacles=OBSTACLES_THERE,
        friction=np.array([0.3, 0.6]), slip_length=0.4, flow=0.1 * g.normal(size=(N + 1, 7)), lanes=np.zeros((10, 16)),
        axis=axis / np.linalg.norm(axis, axis=1)[:, None], slip=slip, slid=np.zeros((N + 1, 3)), bed=np.zeros((N + 1, 3)),
        courses=NO_MOVES, carried=NO_CARRIED, grip=NO_GRIP, rolling=NO_ROOM, boxes=HULL.boxes, facets=HULL.facets,
    )  # fmt: skip


def assembled(line, sea, ends, st, u, cv=CV, ca=CA):
    """Dense Jacobian and right-hand side of the rows that the march eliminates."""
    n = st.e.shape[0] + 1
    rows = block_rows(line)
    assembly(line, sea, ends, st, cv, ca, workspace(n - 1)._replace(rows=rows, u=u))
    J, b = np.zeros((5 * n, 5 * n + 25)), np.zeros(5 * n)
    for i in range(n):
        block = rows[i].reshape(SIZE, WIDTH)
        J[5 * i : 5 * i + 5, 5 * i : 5 * i + 20] = block[:, :20]
        J[5 * i : 5 * i + 5, 5 * i + 21 : 5 * i + 24] = block[:, 20:23]
        b[5 * i : 5 * i + 5] = block[:, 23]
    return J[:, 10 : 10 + 5 * n], b


def residual_at(line, sea, ends, st, x):
    """Right-hand side after the configuration is moved by x (shape (N+1, 5))."""
    s, work = st.copy(), workspace(N)._replace(x=np.ascontiguousarray(x))
    update(None, 1, line, s, CV, CA, 1.0, False, work)
    return assembled(line, sea, ends, s, work.u)[1]


def by_differences(line, sea, ends, st):
    """The Jacobian by differences of fourth order; rows of unknowns that are not there are replaced by the identity."""
    size, t = 5 * (N + 1), 1e-4
    numeric = np.zeros((size, size))
    for j in range(size):
        x = np.zeros(size)
        x[j] = t
        f = [residual_at(line, sea, ends, st, (k * x).reshape(-1, 5)) for k in (-2, -1, 1, 2)]
        numeric[:, j] = -(f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * t)
    identity = [0] + [5 * i + 4 for i in range(N + 1) if i == N or not line.spin[i]]
    numeric[identity, identity] = 1.0
    return numeric


def assert_exact(line, sea, ends, st):
    """The Jacobian, which is the derivative of the residual."""
    J, _ = assembled(line, sea, ends, st, np.zeros_like(st.r))
    assert np.abs(J - by_differences(line, sea, ends, st)).max() < 1e-6 * np.abs(J).max()
    return J


@pytest.mark.long
@pytest.mark.parametrize(("zones", "bits"), list(itertools.product(ZONES, BITS)))
def test_jacobian_is_the_derivative_of_the_residual(zones, bits):
    assert_exact(*random_case(3, ZONES[zones], bits))


def with_moving_obstacles(line, sea, st):
    """The same with obstacles that have moved and turned in the step, and go on, on nodes that have travels on them."""
    g = np.random.default_rng(6)
    carried = np.zeros((len(OBSTACLES_THERE), CARRIED))
    for k, row in enumerate(carried):
        R = np.linalg.qr(np.eye(3) + 0.05 * g.normal(size=(3, 3)))[0]
        row[SWEEP : SWEEP + 9] = (R * np.sign(np.diag(R))).ravel()
        row[ENDED : ENDED + 3] = OBSTACLES_THERE[k, PLACE : PLACE + 3]
        row[BEGAN : BEGAN + 3] = row[ENDED : ENDED + 3] + 0.02 * g.normal(size=3)
        row[SPEED : TURNING + 3] = 0.5 * g.normal(size=6)
    grip = 0.1 * g.normal(size=(N + 1, EACH * len(carried)))
    moved = np.ones(len(carried), np.int8)
    return line._replace(moved=moved), sea._replace(carried=carried, grip=grip), st._replace(grip=grip.copy())


@pytest.mark.parametrize("bits", [OBSTACLES, OBSTACLES | FRICTION, OBSTACLES | LAND])
@pytest.mark.parametrize("zones", ["rod", "catenary"])
def test_jacobian_of_obstacles_that_move(zones, bits):
    line, sea, ends, st = random_case(3, ZONES[zones], bits)
    at_rest, _ = assembled(line, sea, ends, st, np.zeros_like(st.r))
    line, sea, st = with_moving_obstacles(line, sea, st)
    J = assert_exact(line, sea, ends, st)
    assert np.abs(J - at_rest).max() > 1e-3 * np.abs(J).max()


def with_tables(line):
    """The line with two tables of moment, a spring at its start and, at one node, no twist: bends of 0.2 to 0.9 rad."""
    rows = np.array([[0, 0, 0], [0.2, 0.4, 0.04], [0.5, 0.5, 0.175], [0, 0, 0], [0.3, 0.15, 0.0225], [0.6, 1.2, 0.225]])
    law, half = np.zeros((N + 1, 7)), 0.5 * line.h
    law[1:, :3] = np.column_stack([np.full(N, 0), np.full(N, 3), half])
    law[:-1, 3:6] = np.column_stack([np.full(N, 3), np.full(N, 6), half])
    law[0, 6] = 0.3
    law[2, 3:5] = 0, 3
    law[5] = 0.0
    bend = law[:, 2] * 0.5 + law[:, 5] * np.where(law[:, 3] > 0, 2.0, 0.5) + law[:, 6]
    kb = line.kb.copy()
    kb[:, 0] = kb[:, 1] = 0.7 / np.where(bend > 0.0, bend, 1.0)  # on its way in: 0.7 of it
    kb[4, 2], line.k0[4, :2] = 0.0, 0.0
    return line._replace(kb=kb, bend_law=law, bend_table=rows, bits=line.bits | BENDING_LAW)


@pytest.mark.parametrize("bits", [0, STIFFNESS_DAMPING, LAND])
@pytest.mark.parametrize("seed", [3, 8])
def test_jacobian_of_tables_of_moment(seed, bits):
    """Between the points of the tables the derivative is exact."""
    line, sea, ends, st = random_case(seed, ZONES["rod"], bits)
    assert_exact(with_tables(line), sea, ends, st)


@pytest.mark.parametrize("bits", [0, DRAG | FLOW])
@pytest.mark.parametrize("zones", ["rod", "catenary"])
def test_jacobian_of_lift(zones, bits):
    """Of vortices with a phase that is given."""
    line, sea, ends, st = random_case(3, ZONES[zones], bits | VORTICES)
    g = np.random.default_rng(4)
    line = line._replace(wake_law=g.uniform(0.5, 1.5, (N + 1, 8)))
    st = st._replace(wake=g.uniform(-1.0, 1.0, (N + 1, 4)))
    assert_exact(line, sea, ends, st)


def in_soil(line, sea, st):
    """The same on soil that remembers: some nodes in it for the first time, some on their way up, some down again."""
    g = np.random.default_rng(2)
    soil = np.array([1.0, 0.3, 1.5, 0.25, 4.0, 0.6, 1.0, 0.5, 0.4, 0.6, 0.5, 0.7, 0.8])
    past = np.zeros((N + 1, 6))
    past[:, 0] = g.uniform(0.2, 1.5, N + 1)
    past[:, 2] = past[:, 0] + g.uniform(0.1, 0.5, N + 1)
    past[:, 4] = np.arange(N + 1) % 3 - 1.0
    past[:, 5] = g.uniform(0.0, 1.0, N + 1)
    line = line._replace(bed_width=g.uniform(1.0, 2.0, N + 1), bits=line.bits | SEABED | SOIL)
    return line, sea._replace(soil=soil, offset=1.0), st._replace(soil=past)


@pytest.mark.parametrize("bits", [0, FRICTION, FRICTION | BREAKOUT, LAND])
@pytest.mark.parametrize("zones", ["rod", "catenary"])
def test_jacobian_of_soil_that_remembers(zones, bits):
    """On each branch, sticking and sliding, with resistance to the side."""
    line, sea, ends, st = random_case(3, ZONES[zones], bits)
    bare = line._replace(bits=bits & ~BREAKOUT)
    without, _ = assembled(bare, sea, ends, st, np.zeros_like(st.r))
    line, sea, st = in_soil(line, sea, st)
    J = assert_exact(line, sea, ends, st)
    assert np.abs(J - without).max() > 1e-3 * np.abs(J).max()


@pytest.mark.parametrize("bits", [0, STIFFNESS_DAMPING, LAND])
@pytest.mark.parametrize("where", [0, 3, N])
def test_jacobian_of_swivels(where, bits):
    """A swivel bends and passes no torque, whatever the frames; its derivative is exact."""
    line, sea, ends, st = random_case(3, ZONES["rod"], bits)
    line.kb[where] = [0.7, 0.7, 0.0]
    line.k0[where] = 0.0
    assert_exact(line, sea, ends, st)


def test_a_swivel_passes_no_torque_however_its_sides_are_turned():
    line, _, ends, st = random_case(3, ZONES["rod"], 0)
    line.kb[3] = [0.7, 0.7, 0.0]
    line.k0[3] = 0.0
    M = np.zeros((2, N + 1, 3))
    for turned in range(2):
        d = st.e / np.linalg.norm(st.e, axis=1)[:, None]
        observed = Observed(M[turned], np.zeros((N + 1, 3)), np.zeros(5))
        observe(line, ends, st.e, st.v, st.a1, st.w, st.T, st.turn, observed)
        assert abs(M[turned, 3] @ d[2]) < 1e-15 and abs(M[turned, 3] @ d[3]) < 1e-15
        angle = np.arccos(d[2] @ d[3])
        np.testing.assert_allclose(np.linalg.norm(M[turned, 3]), 0.7 * angle, rtol=1e-12)
        st.a1[:3] = np.cross(d[:3], st.a1[:3])
    np.testing.assert_allclose(M[0, 3], M[1, 3], atol=1e-15)


@pytest.mark.parametrize("zones", ZONES)
@pytest.mark.parametrize("held", [(0, 0), (1, 0), (1, 1)])
@pytest.mark.parametrize("inextensible", [False, True])
def test_elimination_equals_a_dense_solve(zones, held, inextensible):
    """The march and the substitution back against LAPACK on the same rows; bound: condition number times round-off."""
    line, sea, ends, st = random_case(5, ZONES[zones], 2047, held)
    if inextensible:
        line = line._replace(ck=np.zeros(N))
    u = np.zeros_like(st.r)
    J, b = assembled(line, sea, ends, st, u)
    work = workspace(N)
    assert correction(line, sea, ends, st, CV, CA, work) == -1
    x = work.x
    assert np.abs(x.ravel() - np.linalg.solve(J, b)).max() < 1e-14 * np.linalg.cond(J) * np.abs(x).max()
