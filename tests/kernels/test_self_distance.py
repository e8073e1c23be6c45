"""The least clearance of a line to itself in a step, against all pairs of cells; lines that do not count; the cost."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.kernels import self_distance as k
from hybrid.kernels.binding import Table
from hybrid.kernels.books import CLOCK_SIZE, COUNT_SIZE
from hybrid.kernels.state import State, blank_line, blank_state, no_ends

WIDTH = 0.05


def state_at(r: np.ndarray) -> State:
    """The state of a line with nodes at r (N+1, 3) m."""
    state = blank_state(len(r) - 1)
    state.r[:], state.e[:] = r, np.diff(r, axis=0)
    return state


def look(before: np.ndarray, after: np.ndarray, held: bool = False, width: float = WIDTH) -> tuple[bool, np.ndarray]:
    """Whether surfaces have met in the step between two shapes (N+1, 3) m, and what was found."""
    n = len(after) - 1
    line = blank_line(n)
    line.h[:] = np.linalg.norm(np.diff(after, axis=0), axis=1)
    line.s[:] = np.append(0.0, np.cumsum(line.h))
    ends = no_ends()
    ends.held[:] = held
    itself = k.blank_itself(np.full(n, width))
    table = Table(k.blank_itself_job())
    counts = np.zeros(COUNT_SIZE, np.int64)
    table.bind(
        line=line, ends=ends, old=state_at(after), new=state_at(before), clock=np.zeros(CLOCK_SIZE), counts=counts,
        itself=itself,
    )  # fmt: skip
    return bool(k.watch_itself(table.numbers)), itself.found


def curve(seed: int, cells: int, length: float) -> np.ndarray:
    """A tangled curve with cells of very different lengths: its tangent is a Fourier series of random coefficients."""
    random = np.random.default_rng(seed)
    x = np.linspace(0.0, 2.0 * np.pi, cells)[:, None, None]
    waves = np.arange(1, 4)[None, :, None]
    a, b = random.normal(size=(2, 1, 3, 3))
    t = (a * np.cos(waves * x) + b * np.sin(waves * x)).sum(axis=1)
    t /= np.linalg.norm(t, axis=1)[:, None]
    h = np.exp(np.sin(np.linspace(0.0, 6.0, cells)))
    return np.vstack([np.zeros(3), np.cumsum(t * (h * length / h.sum())[:, None], axis=0)])


def least_of_all(r: np.ndarray, finely: int = 40) -> float:
    """The least distance (m) over points of all pairs of cells that count, by brute force."""
    n, least = len(r) - 1, np.inf
    h = np.linalg.norm(np.diff(r, axis=0), axis=1)
    s = np.append(0.0, np.cumsum(h))
    x = np.linspace(0.0, 1.0, finely)
    for i in range(n):
        for j in range(i + k.NEIGHBOURS + 1, n):
            p = r[i] + x[:, None] * (r[i + 1] - r[i])
            q = r[j] + x[:, None] * (r[j + 1] - r[j])
            d = np.linalg.norm(p[:, None] - q[None], axis=2)
            between = (s[j] + x * h[j])[None] - (s[i] + x * h[i])[:, None]
            a, b = np.unravel_index(np.argmin(d), d.shape)
            if d[a, b] < k.TURNED * between[a, b]:
                least = min(least, d[a, b])
    return least


@pytest.mark.parametrize("seed", range(8))
def test_least_distance_is_that_of_all_pairs(seed: int) -> None:
    r = curve(seed, 61, 6.0)
    _, found = look(r, r, width=0.6)  # within whose horizon all of the curve is
    expected = least_of_all(r)
    assert np.isfinite(expected)
    assert expected - 0.02 < found[k.DISTANCE] <= expected + 1e-12  # points of the brute force are 5 mm apart


def test_no_gentle_bend_counts() -> None:
    x = np.linspace(-1.0, 1.0, 201)
    arch = np.column_stack([x, np.zeros_like(x), 1.2 * x**2])  # steep: it turns by 134 deg
    for r in (arch, arch[::-1], 1e-2 * arch):
        meets, found = look(r, r)
        assert not meets and found[k.DISTANCE] == np.inf


def test_legs_that_pass_within_a_step_are_found() -> None:
    """A U whose one leg swings through the other, a hundred diameters in a step."""
    legs = np.linspace(0.0, 10.0, 101)
    up = np.column_stack([legs[::-1], np.zeros(101), np.zeros(101)])
    before = np.vstack([up, np.column_stack([legs, 0.4 * legs, np.full(101, 2.5)])])
    after = before.copy()
    after[101:, 2] = -2.5
    after[101:, 1] = before[101:, 1] = np.linspace(-2.0, 2.0, 101)
    assert look(before, before)[1][k.DISTANCE] == np.inf
    assert look(after, after)[1][k.DISTANCE] == np.inf
    meets, found = look(before, after)
    assert meets and found[k.DISTANCE] < 1e-9
    assert found[k.S] == pytest.approx(5.0, abs=1e-9)
    assert found[k.LEAST] == pytest.approx(-WIDTH, abs=1e-9)


def test_ends_held_at_one_place_are_no_contact() -> None:
    x = np.linspace(0.0, 2.0 * np.pi, 101)
    ring = np.column_stack([np.sin(x), np.zeros(101), np.cos(x)])
    assert look(ring, ring, held=False)[0]
    assert not look(ring, ring, held=True)[0]


def test_what_was_told_is_told_again_only_after_it_has_come_apart() -> None:
    found = np.zeros(k.FOUND)
    found[k.LEAST] = np.inf
    told = []
    for distance in (0.2, 0.04, 0.03, 0.06, 0.01, 0.08, 0.04):
        found[k.DISTANCE], found[k.CLEARANCE] = distance, distance - WIDTH
        told.append(bool(k.note_found.py_func(found, 1.0)))
    assert told == [False, True, False, False, False, False, True]
    assert found[k.LEAST_DISTANCE] == 0.01
