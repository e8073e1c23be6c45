"""Means over the lengths of output points: they keep the integral and miss nothing between the points."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.outputs.observed_states import means_beside


@pytest.mark.parametrize("points", [5, 37, 400], ids=["coarser", "about as fine", "finer"])
def test_the_integral_is_kept(points: int) -> None:
    random = np.random.default_rng(points)
    nodes = np.append(0.0, np.cumsum(random.uniform(0.5, 1.5, 40)))
    values = np.zeros((3, nodes.size))
    values[:, 17:19] = random.uniform(1.0, 2.0, (3, 2))
    s = np.linspace(0.0, nodes[-1], points)
    found = means_beside(s, nodes, values)
    edges = np.concatenate([[0.0], 0.5 * (s[1:] + s[:-1]), [nodes[-1]]])
    integral = (0.5 * np.diff(nodes) * (values[:, 1:] + values[:, :-1])).sum(axis=1)
    np.testing.assert_allclose((found * np.diff(edges)[:, None]).sum(axis=0), integral, rtol=1e-13)
    assert (found >= -1e-12).all() and (found.max(axis=0) > 0.0).all()
    if points == 400:
        np.testing.assert_allclose(found[:, 0], np.interp(s, nodes, values[0]), atol=0.1)


def test_what_is_linear_stays_so_inside() -> None:
    nodes, s = np.linspace(0.0, 7.0, 15), np.linspace(1.0, 6.0, 11)
    np.testing.assert_allclose(means_beside(s, nodes, 2.0 * nodes[None])[:, 0], 2.0 * s, rtol=1e-13)
