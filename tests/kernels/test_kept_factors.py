"""Another right-hand side by kept factors: of some nodes alone, swept from the first of them, by both ways."""

from __future__ import annotations

import numpy as np
import pytest
from test_jacobian import CA, CV, ZONES, N, assembled, random_case
from test_planar import flat_case

from hybrid.kernels.algebra.block_elimination import ROW, SPAN, exchange
from hybrid.kernels.algebra.kept_factors import SWEEP, carry_given, prepare_sweep, solve_again, solve_backward, sweep
from hybrid.kernels.algebra.plane import TRIPLE
from hybrid.kernels.algebra.sparse_rows import add_rows, is_definite
from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.run.newton import assembly, workspace
from hybrid.model.mesh import Zone
from hybrid.outputs.observed_states import Grid


@kernel
def solve_given(X, W, M, given, x, begin, exactly):
    if exactly:
        carry_given(X, W, given, x, False, begin)
    else:
        prepare_sweep(X, W, M, begin, x.shape[0] - 1)
        sweep(X, W, M, given, x, False, begin)
    return solve_backward(X, x, begin)


@kernel
def exchanged(order, a, b):
    return exchange(order, a, b)


@pytest.mark.long
@pytest.mark.parametrize("exactly", [True, False])
@pytest.mark.parametrize("first", [0, 3, N])
@pytest.mark.parametrize("name", ZONES)
def test_right_hand_sides_of_some_nodes(name, first, exactly):
    """Against a dense solve of the assembled rows, from the first node on; what stood in x at others counts for nothing.

    Round-off: 1e-9 of the largest, at condition numbers near 1e4.
    """
    line, sea, ends, st = random_case(3, ZONES[name], 2047, (0, 0))
    J, _ = assembled(line, sea, ends, st, np.zeros_like(st.r))
    work = workspace(N, keep=True)
    assembly(line, sea, ends, st, CV, CA, work)
    random = np.random.default_rng(8)
    given = np.zeros(N + 1, np.int64)
    given[first::2] = 1
    b = random.normal(size=(N + 1, 5)) * given[:, None]
    b[:, 0] = 0.0
    b[:-1, 4] *= line.spin
    b[-1, 4] = 0.0
    x, M = np.where(given[:, None], b, random.normal(size=b.shape)), random.normal(size=(N + 1, SWEEP))
    M[0] = 0.0
    assert solve_given(work.X, work.W, M, given, x, first, exactly)
    expected = np.linalg.solve(J, b.ravel()).reshape(N + 1, 5)
    np.testing.assert_allclose(x[first:], expected[first:], rtol=0, atol=1e-9 * np.abs(expected).max())


def test_factors_are_those_of_pivot_blocks_with_their_rows_exchanged():
    """L U of a block is the pivot block, its rows in the order kept: what gave X_i gives it again."""
    line, sea, ends, st = random_case(3, ZONES["rod"], 2047)
    work = workspace(N, keep=True)
    assembly(line, sea, ends, st, CV, CA, work)
    X, kept = work.X[: (N + 1) * ROW].reshape(N + 1, 5, SPAN), work.X[(N + 1) * ROW :].reshape(N + 1, -1)
    orders = set()
    for i in range(1, N):
        LU, order = kept[i, 37:62].reshape(5, 5), int(kept[i, 63])
        rows = [order >> 3 * r & 7 for r in range(5)]
        assert sorted(rows) == [0, 1, 2, 3, 4]
        orders.add(tuple(rows))
        U = np.triu(LU, 1) + np.diag(1.0 / LU.diagonal())
        pivot = np.empty((5, 5))
        pivot[rows] = (np.tril(LU, -1) + np.eye(5)) @ U
        np.testing.assert_allclose(np.linalg.solve(pivot, kept[i, 64:69]), X[i, :, 8], rtol=1e-9, atol=1e-12)
    assert len(orders) > 1


def test_an_exchange_moves_two_rows():
    order = 0 | 1 << 3 | 2 << 6 | 3 << 9 | 4 << 12
    order = exchanged(order, 1, 4)
    assert [order >> 3 * r & 7 for r in range(5)] == [0, 4, 2, 3, 1]
    assert exchanged(order, 2, 2) == order


@pytest.mark.parametrize("name", ZONES)
@pytest.mark.parametrize("held", [(0, 0), (1, 1), (1, 0)])
def test_kept_factors_solve_any_right_hand_side(name, held):
    """Against a dense solve of the assembled rows.  Round-off: 1e-9 of the largest, at condition numbers near 1e4."""
    line, sea, ends, st = random_case(3, ZONES[name], 2047, held)
    u = np.zeros_like(st.r)
    J, _ = assembled(line, sea, ends, st, u)
    work = workspace(N, keep=True)
    assembly(line, sea, ends, st, CV, CA, work)
    b = np.random.default_rng(8).normal(size=(N + 1, 5))
    b[0, 0] = 0.0  # there is no cell before the start
    b[:-1, 4] *= line.spin
    b[-1, 4] = 0.0
    for k, node in ((0, 0), (1, N)):
        if held[k]:
            b[node, 1:4] = 0.0
    x = np.zeros((N + 1, 5))
    assert solve_again(work.X, work.W, b, x)
    expected = np.linalg.solve(J, b.ravel()).reshape(N + 1, 5)
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(("case", "size"), [(random_case, 45), (flat_case, TRIPLE)], ids=["space", "plane"])
def test_keeping_factors_changes_nothing(case, size):
    """Bit for bit: what is kept is a copy."""
    line, sea, ends, st = case(5, ZONES["three"], 2047)
    found = []
    for keep in (False, True):
        work = workspace(N, keep)
        assembly(line, sea, ends, st, CV, CA, work)
        found.append((work.X[: (N + 1) * size].copy(), work.report.copy()))
    np.testing.assert_array_equal(found[0][0], found[1][0])
    np.testing.assert_array_equal(found[0][1], found[1][1])


# --- Products of sparse rows, and whether a banded matrix is definite, against dense numpy ---


@pytest.mark.parametrize("columns", [1, 3, 4])
def test_product_of_sparse_rows(columns):
    g = np.random.default_rng(1)
    dense = np.where(g.random((7, 5)) < 0.4, g.normal(size=(7, 5)), 0.0)
    dense[3] = 0.0
    begin = np.append(0, np.cumsum((dense != 0.0).sum(axis=1)))
    x, out = g.normal(size=(5, columns)), np.ones((7, columns))
    add_rows(begin, np.nonzero(dense)[1], dense[dense != 0.0], x, out)
    np.testing.assert_allclose(out, 1.0 + dense @ x, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("below", [0, 1, 4])
@pytest.mark.parametrize("seed", range(10))
def test_definite_where_the_lowest_eigenvalue_is_positive(below, seed):
    """Random bands shifted to either side of zero, by more than round-off."""
    n, g = 9, np.random.default_rng(seed)
    A = np.zeros((n, n))
    for k in range(below + 1):
        A += np.diag(g.normal(size=n - k), -k)
    A = A + A.T
    for shift in (-1e-6, 1e-6):
        B = A + (shift - np.linalg.eigvalsh(A)[0]) * np.eye(n)
        band = np.zeros((below + 1, n))
        for k in range(below + 1):
            band[k, : n - k] = np.diag(B, -k)
        assert is_definite(band) == (shift > 0.0)
        if shift > 0.0:
            for k in range(below + 1):  # the factor takes its place
                np.testing.assert_allclose(band[k, : n - k], np.diag(np.linalg.cholesky(B), -k), rtol=0, atol=1e-6)


def test_not_a_number_is_not_definite():
    assert not is_definite(np.array([[1.0, np.nan, 1.0]]))


def interpolated(grid_of, x, at, value):
    """Values at places by the rows of a grid, in whatever order these are asked for."""
    zones = (Zone("rod", 0.0, 3.0), Zone("catenary", 3.0, 10.0))
    return grid_of(Grid(x, zones, at)) @ value


def test_rows_do_not_depend_on_the_order_of_places():
    """The search for the cell of a place begins at that of the place before, which may lie anywhere."""
    g = np.random.default_rng(3)
    x = np.sort(np.concatenate([[0.0, 3.0, 10.0], g.uniform(0.0, 10.0, 20)]))
    at, mixed = np.linspace(0.0, 10.0, 101), g.permutation(101)
    for grid_of, count in ((lambda o: o.nodes, x.size), (lambda o: o.cells, x.size - 1), (lambda o: o.chords, x.size)):
        value = g.normal(size=(count, 2))
        np.testing.assert_array_equal(
            interpolated(grid_of, x, at, value)[mixed], interpolated(grid_of, x, at[mixed], value)
        )


def test_nodes_interpolate_parabolas_exactly_but_not_across_a_joint():
    """Cubics with the slopes of parabolas: one parabola on either side of the joint at 3 m, extrapolated to its ends."""
    x = np.array([0.0, 0.5, 1.7, 3.0, 4.0, 6.5, 7.0, 10.0])
    at = np.linspace(0.0, 10.0, 41)

    def shape(s):
        return np.where(s <= 3.0, s * s - s, 6.0 - 4.0 * (s - 3.0) - 0.3 * (s - 3.0) ** 2)

    np.testing.assert_allclose(interpolated(lambda o: o.nodes, x, at, shape(x)[:, None])[:, 0], shape(at), atol=1e-12)
