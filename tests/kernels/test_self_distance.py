"""The least clearance of a line to itself in a step, against all pairs of cells; lines that do not count; the cost."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.kernels.contact import self_distance as k
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.state import State, blank_line, blank_state, no_ends

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
    counts = Counts()
    table.bind(
        line=line, ends=ends, old=state_at(after), new=state_at(before), clock=Clock(), counts=counts,
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
    assert expected - 0.02 < found.distance <= expected + 1e-12  # points of the brute force are 5 mm apart


def test_no_gentle_bend_counts() -> None:
    x = np.linspace(-1.0, 1.0, 201)
    arch = np.column_stack([x, np.zeros_like(x), 1.2 * x**2])  # steep: it turns by 134 deg
    for r in (arch, arch[::-1], 1e-2 * arch):
        meets, found = look(r, r)
        assert not meets and found.distance == np.inf


def test_legs_that_pass_within_a_step_are_found() -> None:
    """A U whose one leg swings through the other, a hundred diameters in a step."""
    legs = np.linspace(0.0, 10.0, 101)
    up = np.column_stack([legs[::-1], np.zeros(101), np.zeros(101)])
    before = np.vstack([up, np.column_stack([legs, 0.4 * legs, np.full(101, 2.5)])])
    after = before.copy()
    after[101:, 2] = -2.5
    after[101:, 1] = before[101:, 1] = np.linspace(-2.0, 2.0, 101)
    assert look(before, before)[1].distance == np.inf
    assert look(after, after)[1].distance == np.inf
    meets, found = look(before, after)
    assert meets and found.distance < 1e-9
    assert found.s == pytest.approx(5.0, abs=1e-9)
    assert found.least == pytest.approx(-WIDTH, abs=1e-9)


def test_ends_held_at_one_place_are_no_contact() -> None:
    x = np.linspace(0.0, 2.0 * np.pi, 101)
    ring = np.column_stack([np.sin(x), np.zeros(101), np.cos(x)])
    assert look(ring, ring, held=False)[0]
    assert not look(ring, ring, held=True)[0]


def test_what_was_told_is_told_again_only_after_it_has_come_apart() -> None:
    found = k.Nearest()
    found.least = np.inf
    told = []
    for distance in (0.2, 0.04, 0.03, 0.06, 0.01, 0.08, 0.04):
        found.distance, found.clearance = distance, distance - WIDTH
        told.append(bool(k.note_found.py_func(found, 1.0)))
    assert told == [False, True, False, False, False, False, True]
    assert found.least_distance == 0.01


# --- whether contact has to begin, or may end -----------------------------------------------------------------


class Asked:
    """A line whose steps are asked about contact, as of `look`."""

    def __init__(self, after: np.ndarray, what: float = 1.0) -> None:
        n = len(after) - 1
        line = blank_line(n)
        line.h[:] = np.linalg.norm(np.diff(after, axis=0), axis=1)
        line.s[:] = np.append(0.0, np.cumsum(line.h))
        self.itself, self._table = k.blank_itself(np.full(n, WIDTH)), Table(k.blank_itself_job())
        self.itself.ahead.asked = what
        self._bound = {
            "line": line, "ends": no_ends(), "clock": Clock(), "counts": Counts(),
            "itself": self.itself,
        }  # fmt: skip

    def step(self, before: np.ndarray, after: np.ndarray) -> int:
        """Bits but for MEETS after a step from one shape to another."""
        self._table.bind(old=state_at(after), new=state_at(before), **self._bound)
        return int(k.watch_itself(self._table.numbers)) & ~k.MEETS


def two_legs(apart: float, slant: float = 0.4) -> np.ndarray:
    """A leg of 10 m along x, and one on its way back, `apart` (m) above it and slanting away by ten times `slant` (m)."""
    legs = np.linspace(0.0, 10.0, 101)
    back = np.column_stack([legs, slant * legs, np.full(101, apart)])
    return np.vstack([np.column_stack([legs[::-1], np.zeros(101), np.zeros(101)]), back])


def test_contact_begins_by_the_approach_of_two_cells_not_of_the_line() -> None:
    before = two_legs(2.5)
    after = before.copy()
    far = np.clip(np.linspace(-5.0, 5.0, 101), 0.0, None)
    after[101:, 2] += 0.2 * far  # far from the other leg: three such steps of it would close 2.5 m elsewhere
    assert Asked(after).step(before, after) == 0
    assert Asked(after).step(two_legs(2.5), two_legs(1.6)) == k.NEARS
    assert Asked(after).step(two_legs(1.6), two_legs(1.6)) == 0


def test_a_look_ahead_from_velocities_is_that_of_a_step() -> None:
    shape = two_legs(1.6)
    asked, state = Asked(shape), state_at(shape)
    state.v[101:, 2] = -0.9
    asked.itself.ahead.seconds = 1.0
    asked._table.bind(old=state, new=state_at(shape), **asked._bound)
    assert int(k.watch_itself(asked._table.numbers)) == k.NEARS


def fold(angle: float) -> np.ndarray:
    """Two legs of 4 m from one node, which are an angle (rad) apart."""
    legs = np.linspace(4.0, 0.0, 41)
    other = legs[-2::-1]
    return np.vstack([
        np.column_stack([legs, 0.0 * legs, 0.0 * legs]),
        np.column_stack([other * np.cos(angle), other * np.sin(angle), 0.0 * other]),
    ])  # fmt: skip


def test_a_fold_without_a_shape_hides_what_is_beside_it_and_is_told_once() -> None:
    asked, r = Asked(fold(0.2)), fold(0.2)
    assert [asked.step(r, r) for _ in range(3)] == [k.HIDES, 0, 0]
    assert int(asked.itself.ahead.sharp) == 40
    apart = two_legs(5.0)[: len(r)]
    assert [asked.step(apart, apart) for _ in range(k.ENDS)] == [0] * k.ENDS
    assert asked.step(r, r) == k.HIDES


def test_a_fold_hides_nothing_that_is_far_from_it() -> None:
    """Legs that come as near to each other as a diameter and a half, far from the fold, where they are apart."""
    x = np.linspace(0.0, 4.0, 41)
    y = np.interp(x, [0.0, 1.0, 4.0], [0.0, 0.3, 0.08])
    r = np.vstack([np.column_stack([x[::-1], 0.0 * x, 0.0 * x]), np.column_stack([x, y, 0.0 * x])[1:]])
    assert Asked(r).step(r, r) == k.NEARS


def test_contact_ends_after_so_many_steps_apart() -> None:
    near, far = two_legs(0.12), two_legs(2.5)
    asked = Asked(near, k.WIDER)
    assert [asked.step(near, near) for _ in range(2 * k.ENDS)] == [0] * 2 * k.ENDS
    assert [asked.step(far, far) for _ in range(k.ENDS - 1)] == [0] * (k.ENDS - 1)
    assert asked.step(near, near) == 0
    assert [asked.step(far, far) for _ in range(k.ENDS)] == [0] * (k.ENDS - 1) + [k.PARTS]


def test_contact_that_was_given_up_begins_when_surfaces_have_come_apart() -> None:
    near = two_legs(0.07, 0.0)
    asked = Asked(near)
    asked.itself.found.waits = 1.0
    assert asked.step(near, near) == 0
    apart = two_legs(0.09, 0.0)  # by 0.8 diameters, and near
    assert asked.step(apart, apart) == k.NEARS
