"""Products of sparse rows, and whether a banded matrix is definite, against dense numpy."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.kernels.sparse_rows import add_rows, is_definite


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
