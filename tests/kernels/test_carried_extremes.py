"""Extremes where cells change, against what every place of the finest mesh has seen."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.kernels.machine.compile import kernel
from hybrid.kernels.watch.extremes import carry_extremes, fold_extremes, fold_gone, match_nodes

FINEST = np.arange(65.0)
MARKED = (16, 48)  # places with a left and a right value
PLACES = np.insert(FINEST, MARKED, FINEST[list(MARKED)])


@kernel
def carry_all(old, new, stays, places, bounds):
    """What kernels.mesh.cell_changes.renew does with extremes, of nodes (s, rods, right, extremes)."""
    s, rods, right, now = old
    to_s, to_rods, to_right, out = new
    match_nodes(s, rods, to_s, to_rods, stays)
    fold_gone(s, now, right, stays, places, bounds)
    carry_extremes(stays, rods.shape[0], now.reshape(now.size), now.shape[2], to_right, to_rods.shape[0], out)


class Mesh:
    """Nodes at some places of the finest mesh, and the extremes there."""

    def __init__(self, places: np.ndarray, rods: np.ndarray) -> None:
        self.s, self.rods = FINEST[places], rods
        n = places.size
        marked = np.searchsorted(places, MARKED)
        self.right = np.arange(n)
        self.right[marked] = n + np.arange(marked.size)
        self.extremes = unknown(n + marked.size)

    def note(self, left: np.ndarray, right: np.ndarray, t: float) -> None:
        """Values (65,) of all places at time t, before and after marked ones."""
        at = self.s.astype(int)
        for column, value in (*enumerate(left[at]), *zip(self.right, right[at], strict=True)):
            for bound, better in ((0, np.less), (1, np.greater)):
                if better(value, self.extremes[bound, 0, column]):
                    self.extremes[bound, 0, column], self.extremes[2 + bound, 0, column] = value, t

    def fold(self, bounds: np.ndarray) -> None:
        order = np.sort(np.append(np.arange(self.s.size), np.searchsorted(self.s, FINEST[list(MARKED)])))
        second = np.append(False, order[1:] == order[:-1])
        columns = np.where(second, self.right[order], order)
        fold_extremes(self.s[order], PLACES, columns, self.extremes, bounds)

    def pass_on(self, other: Mesh, bounds: np.ndarray) -> None:
        stays = np.zeros(self.s.size, np.int64)
        old, new = ((x.s, x.rods, x.right, x.extremes) for x in (self, other))
        carry_all(old, new, stays, PLACES, bounds)


def unknown(columns: int) -> np.ndarray:
    """Extremes of one row that nothing has widened."""
    out = np.full((4, 1, columns), np.nan)
    out[0], out[1] = np.inf, -np.inf
    return out


def random_mesh(rng: np.random.Generator) -> Mesh:
    """Base nodes at every sixteenth place, and some of the others in two of the base cells; kinds of the latter vary."""
    here = np.zeros(65, bool)
    here[::16] = True
    for base in rng.choice(4, 2, replace=False):
        here[16 * base + rng.choice(np.arange(1, 16), rng.integers(0, 9), replace=False)] = True
    places = np.flatnonzero(here)
    kinds = rng.random(4) < 0.8
    return Mesh(places, kinds[places[:-1] // 16])


@pytest.mark.parametrize("seed", range(20))
def test_values_linear_along_the_line_are_kept_exactly(seed: int) -> None:
    """Where all nodes have their extremes at the same times, every place has those that it would have alone."""
    rng = np.random.default_rng(seed)
    mesh, bounds, seen = random_mesh(rng), unknown(PLACES.size), []
    for t in range(40):
        size = rng.normal()
        behind = [np.searchsorted(MARKED, FINEST, side) for side in ("left", "right")]  # how many marks are before
        before, here = (size * (1.0 + 0.01 * FINEST + np.array([0.0, 0.3, -0.4])[k]) for k in behind)
        mesh.note(before, here, float(t))
        values = np.insert(here, MARKED, before[list(MARKED)])
        seen.append(values)
        if rng.random() < 0.5:
            other = random_mesh(rng)
            mesh.pass_on(other, bounds)
            mesh = other
    mesh.fold(bounds)
    np.testing.assert_allclose(bounds[0, 0], np.min(seen, axis=0), rtol=1e-12)
    np.testing.assert_allclose(bounds[1, 0], np.max(seen, axis=0), rtol=1e-12)


def test_a_peak_on_short_cells_is_not_spread_over_the_long_ones_that_follow() -> None:
    """While node 4 has short cells beside it there is a peak; what its long cells have later does not reach it."""
    short = Mesh(np.array([0, 3, 4, 5, 16, 32, 48, 64]), np.ones(7, bool))
    long = Mesh(np.array([0, 4, 16, 32, 48, 64]), np.ones(5, bool))
    bounds, peak, flat = unknown(PLACES.size), np.where(FINEST == 4, 10.0, 1.0), np.ones(65)
    short.note(peak, peak, 0.0)
    short.pass_on(long, bounds)
    long.note(flat, flat, 1.0)
    long.fold(bounds)
    np.testing.assert_array_equal(bounds[1, 0], np.where(PLACES == 4, 10.0, 1.0))
    assert bounds[3, 0, 4] == 0.0


def test_cells_that_stay_keep_their_extremes_until_the_end() -> None:
    """What nodes of them have seen is on the next mesh, and nothing of it was interpolated yet."""
    one = Mesh(np.array([0, 16, 32, 40, 48, 64]), np.ones(5, bool))
    two = Mesh(np.array([0, 16, 32, 48, 64]), np.ones(4, bool))
    bounds = unknown(PLACES.size)
    one.note(FINEST, -FINEST, 3.0)
    one.pass_on(two, bounds)
    assert two.extremes[1, 0, 0] == 0.0 and two.extremes[1, 0, 1] == 16.0  # node 16, before its mark
    assert two.extremes[0, 0, two.right[1]] == -16.0 and two.extremes[2, 0, two.right[1]] == 3.0
    assert np.isinf(two.extremes[:2, 0, 2:4]).all() and np.isinf(bounds[:2, 0, 1:17]).all()
    assert bounds[1, 0, np.searchsorted(PLACES, 40.0)] == 40.0
