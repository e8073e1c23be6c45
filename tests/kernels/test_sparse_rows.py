"""Products of sparse rows, and whether a banded matrix is definite, against dense numpy."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.kernels.algebra.sparse_rows import add_rows, is_definite
from hybrid.model.mesh import Zone
from hybrid.outputs.observed_states import Grid


def test_product_of_sparse_rows():
    g = np.random.default_rng(1)
    dense = np.where(g.random((7, 5)) < 0.4, g.normal(size=(7, 5)), 0.0)
    dense[3] = 0.0
    begin = np.append(0, np.cumsum((dense != 0.0).sum(axis=1)))
    x, out = g.normal(size=(5, 4)), np.ones((7, 4))
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


@pytest.mark.parametrize("columns", [1, 3, 4])
def test_products_with_few_columns_are_those_with_many(columns):
    g = np.random.default_rng(2)
    dense = np.where(g.random((9, 6)) < 0.5, g.normal(size=(9, 6)), 0.0)
    begin = np.append(0, np.cumsum((dense != 0.0).sum(axis=1)))
    x, out = g.normal(size=(6, columns)), np.zeros((9, columns))
    add_rows(begin, np.nonzero(dense)[1], dense[dense != 0.0], x, out)
    np.testing.assert_allclose(out, dense @ x, rtol=0.0, atol=1e-14)


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
