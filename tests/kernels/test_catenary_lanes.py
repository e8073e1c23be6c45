"""Nodes between catenary cells: several assembled at a time, and tensions eliminated before the march.

Against the rows that the march assembles node by node when they are kept, solved densely, and against the march that
keeps its factors, in which every tension is an unknown.
"""

import numpy as np
import pytest

from hybrid.kernels.algebra.block_elimination import ROW, SPAN
from hybrid.kernels.run.newton import assembly, block_rows, correction, workspace
from hybrid.kernels.state.report import (
    ADDED_MASS,
    ADDED_MASS_POWER,
    BODIES,
    CONTACT_FORCE,
    DRAG,
    DRAG_POWER,
    FLOW,
    FRICTION,
    MASS_DAMPING,
    MASS_DAMPING_POWER,
    OBSTACLES,
    RESIDUAL,
    RESIDUAL_NODE,
    SEABED,
    SURFACE,
    WAVE_POWER,
    WAVES,
)
from tests.kernels import test_jacobian
from tests.kernels.test_jacobian import CA, CV, assembled, random_case

SOME_FORCE = 1 << 40  # that lanes know nothing of
POWERS = (DRAG_POWER, ADDED_MASS_POWER, WAVE_POWER, MASS_DAMPING_POWER, CONTACT_FORCE, RESIDUAL, RESIDUAL_NODE)
WET = DRAG | ADDED_MASS | MASS_DAMPING | FLOW | WAVES
BITS = [
    0, DRAG, ADDED_MASS, MASS_DAMPING, DRAG | FLOW, WET, WET | SURFACE, WET | BODIES, WET | SURFACE | BODIES,
    SEABED, SEABED | FRICTION, WET | SURFACE | SEABED | FRICTION | OBSTACLES,
]  # fmt: skip


@pytest.fixture
def cells(monkeypatch):
    """Lines of so many cells: two times all lanes, and some."""
    monkeypatch.setattr(test_jacobian, "N", 21)
    return 21


@pytest.mark.parametrize("held", [(0, 0), (1, 1)])
@pytest.mark.parametrize("bits", BITS)
def test_lanes_solve_what_is_assembled_node_by_node(cells, bits, held):
    """Against LAPACK; bound: condition number times round-off.  What the march reports is the same."""
    line, sea, ends, st = random_case(3, [0] * (cells + 1), bits, held)
    st.r[:, 2] += np.linspace(-8.0, 8.0, cells + 1)  # cells in water, in air and in the surface
    st.e[:] = np.diff(st.r, axis=0)
    for parameter in (line.point_drag, line.point_added, line.point_displaced, line.point_height):
        parameter[::3], parameter[4:7] = 0.0, 0.0  # nodes without a body
    J, b = assembled(line, sea, ends, st, np.zeros_like(st.r))
    by_node = workspace(cells)._replace(rows=block_rows(line))
    assembly(line, sea, ends, st, CV, CA, by_node)
    for more in (0, SOME_FORCE):
        work = workspace(cells)
        assert correction(line._replace(bits=bits | more), sea, ends, st, CV, CA, work) == -1
        assert np.abs(work.x.ravel() - np.linalg.solve(J, b)).max() < 1e-14 * np.linalg.cond(J) * np.abs(work.x).max()
        for k in POWERS:
            np.testing.assert_allclose(work.report[k], by_node.report[k], rtol=1e-12, atol=1e-12)


def taut(cells, stiffness, tension=1.0, lengths=None, **more):
    """A line near x in tension of a stiffness; tests change what they like of it."""
    line, sea, ends, st = random_case(5, [0] * (cells + 1), more.get("bits", DRAG | ADDED_MASS), (1, 1))
    g = np.random.default_rng(6)
    h = np.ones(cells) if lengths is None else lengths
    node = np.zeros(cells + 1)
    node[:-1] += 0.5 * h
    node[1:] += 0.5 * h
    T = tension * g.uniform(0.9, 1.1, cells)
    line = line._replace(
        h=h, ck=np.full(cells, 1.0 / stiffness), mass=node.copy(), s=np.concatenate([[0], np.cumsum(h)])
    )
    for x in (line.drag_n, line.drag_t, line.added_n, line.added_t):
        x[:] = 0.2 * h
    d = np.array([1.0, 0.0, 0.0]) + 0.1 * g.normal(size=(cells, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    st.T[:] = T
    st.e[:] = d * (h * (1.0 + line.ck * T) * (1.0 + 1e-3 / stiffness * g.normal(size=cells)))[:, None]
    st.r[1:] = st.r[0] + np.cumsum(st.e, axis=0)
    ends.position[:] = st.r[[0, -1]]
    return line, sea, ends, st


def both_ways(case, cv, ca, cells):
    """Corrections with tensions eliminated, and with all of them unknowns; the nodes whose tension has been."""
    short, long = workspace(cells), workspace(cells, keep=True)
    found = correction(*case, cv, ca, short), correction(*case, cv, ca, long)
    rows = short.X.reshape(-1, ROW)
    return found, short.x, long.x, rows[:, SPAN] == 0.0


@pytest.mark.parametrize("motion", [(3.0, 7.0), (300.0, 6e4), (0.0, 1e-6)])
@pytest.mark.parametrize(
    ("stiffness", "tension"),
    [(1e2, 1.0), (1e4, 1.0), (1e6, 1.0), (1e8, 1.0), (1e12, 1.0), (np.inf, 1.0), (1e4, 0.0), (1e4, -0.1), (1e6, -1e-3)],
)
def test_tensions_eliminated_change_no_correction(cells, stiffness, tension, motion):
    """To 1e-9 of the largest shift and of tension; where the line is stiff, and at rest, they stay unknowns."""
    case = taut(cells, stiffness, tension)
    found, short, long, eliminated = both_ways(case, *motion, cells)
    assert found == (-1, -1)
    for k in (slice(0, 1), slice(1, 4)):
        assert np.abs(short[:, k] - long[:, k]).max() < 1e-9 * np.abs(long[:, k]).max()
    if motion[0] == 0.0 or (stiffness >= 1e12 and motion[1] < 10.0):  # inertia is stiffness too
        assert not eliminated[1:cells].any()
    elif stiffness <= 1e4 and tension == 1.0:
        assert eliminated[1 : cells - 1].all()


@pytest.mark.parametrize("ratio", [1e2, 1e4])
def test_cells_of_lengths_that_differ(cells, ratio):
    lengths = np.where(np.arange(cells) % 3 == 0, 1.0 / ratio, 1.0)
    lengths[8:14] = np.geomspace(1.0, ratio, 6)
    found, short, long, _ = both_ways(taut(cells, 1e4, lengths=lengths), 30.0, 600.0, cells)
    assert found == (-1, -1)
    for k in (slice(0, 1), slice(1, 4)):
        assert np.abs(short[:, k] - long[:, k]).max() < 1e-9 * np.abs(long[:, k]).max()


@pytest.mark.parametrize("motion", [(30.0, 600.0), (0.0, 1e-3)])
def test_ten_thousand_cells(monkeypatch, motion):
    monkeypatch.setattr(test_jacobian, "N", 10_000)
    found, short, long, eliminated = both_ways(taut(10_000, 1e4), *motion, 10_000)
    assert found == (-1, -1) and eliminated[1:-2].all() == (motion[0] > 0.0)
    for k in (slice(0, 1), slice(1, 4)):
        assert np.abs(short[:, k] - long[:, k]).max() < 1e-9 * np.abs(long[:, k]).max()


def test_stiff_cells_among_soft_ones_and_rods(cells):
    """Tensions are eliminated in parts of a line, between rods, inextensible cells and cells that no digit is lost of."""
    element = [0] * (cells + 1)
    element[9:11] = [1, 1]
    line, sea, ends, st = random_case(3, element, WET | SEABED | FRICTION)
    line.ck[[4, 15]] = 0.0
    line.ck[17] = 1e-12
    found, short, long, eliminated = both_ways((line, sea, ends, st), CV, CA, cells)
    assert found == (-1, -1) and 4 < eliminated[1:cells].sum() < cells - 8, eliminated
    assert np.abs(short - long).max() < 1e-9 * np.abs(long).max()
    gaps = 1e-3 * np.arange(cells)
    asked = workspace(cells)._replace(gaps=gaps), workspace(cells, keep=True)._replace(gaps=gaps)
    for work in asked:
        assert correction(line, sea, ends, st, CV, CA, work) == -1
    assert np.abs(asked[0].x - asked[1].x).max() < 1e-9 * np.abs(asked[1].x).max()


def test_a_block_that_is_singular_is_the_same(cells):
    """Nodes without mass between cells without tension: of both marches it is the first of them."""
    line, sea, ends, st = taut(cells, 1e4, 1.0, bits=0)
    st.e[:] = [1.0, 0.0, 0.0]
    st.r[1:] = st.r[0] + np.cumsum(st.e, axis=0)
    ends.position[:] = st.r[[0, -1]]
    line.mass[11:15] = 0.0
    st.T[10:16] = 0.0
    found, _, _, _ = both_ways((line, sea, ends, st), 0.0, 0.0, cells)
    assert found[0] == found[1] and 10 <= found[0] <= 15
