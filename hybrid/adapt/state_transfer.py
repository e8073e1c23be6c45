"""From the old zones to the new ones: nothing that stays moves, and nothing is lost.

Base nodes keep their positions to the last bit.  Nodes that appear lie on a cubic through the base
nodes, so that a rod begins without kinks; nodes that go are dropped.  Mass is exact by construction, linear momentum
by a small shift of the velocities of the nodes concerned, stretch by stretch.  The length that a chord gains or
loses when an arc becomes chords (or chords an arc) is kept: every new cell is given the unstretched length that
makes its tension what it was, and is let go to its true length slowly (`Relaxing`).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.state import Floats, Line, State, blank_state
from hybrid.model.layout import Layout, edges

Clamp = tuple[Floats, Floats]  # first director and tangent
FARTHEST = 0.2  # cells that `balance` may move a node by
ROUND = 1e-9  # of the length: places so close are one


class Remapped(NamedTuple):
    """A state on new nodes, and the lengths (N,) m that its cells have now; their true ones are in the line."""

    state: State
    lengths: Floats


def remap(
    old: Layout,
    new: Layout,
    line: Line,
    target: Line,
    state: State,
    kinks: np.ndarray,
    twist: Floats,
    clamps: Sequence[Clamp | None] = (None, None),
) -> Remapped:
    """Carry a state from one layout to another of the same base.

    line, target: the old and the new line; kinks: (n+1,) bool, base nodes where tangent and tension may jump (point
    loads); twist: (n,) 1/m, twist to give to the frames of base cells that become rod; clamps: first director and
    tangent of what holds the twist of the two ends, None: nothing does.
    """
    out = blank_state(target.h.size, len(target.torsion))
    now, then = old.first, new.first
    place = then[:-1]
    changed = old.rod != new.rod
    # what stays, to the last bit
    kept_old, kept_new = (np.flatnonzero(np.repeat(~changed, x.counts)) for x in (old, new))
    for a, b in zip(_nodal(state), _nodal(out), strict=True):
        b[place], b[-1] = a[now[:-1]], a[-1]
        b[kept_new] = a[kept_old]
    for a, b in ((state.e, out.e), (state.T, out.T), (state.a1, out.a1), (state.w, out.w)):
        b[kept_new] = a[kept_old]
    out.wa[kept_new], out.wd[kept_new] = state.wa[kept_old], state.wd[kept_old]
    new_cells = np.repeat(changed, new.counts)
    middles = 0.5 * (target.s[:-1] + target.s[1:])
    out.T[new_cells] = _tension(middles[new_cells], line.s, state.T, old.base[kinks])
    _interpolate(old, new, line, target, state, out, kinks)
    chords = np.diff(out.r, axis=0)
    out.e[new_cells] = chords[new_cells]
    _momentum(old, new, line, target, state, out, changed)
    _frames(new, changed, out, target, twist, clamps)
    lengths = line_lengths(out, target, new_cells, line, kept_old, kept_new)
    return Remapped(out, lengths)


def _interpolate(
    old: Layout, new: Layout, line: Line, target: Line, state: State, out: State, kinks: np.ndarray
) -> None:
    """What lives on nodes that are new: on cubics through the base nodes; friction's travel linearly."""
    here = np.flatnonzero(new.rod & ~old.rod)
    inner = np.concatenate([np.arange(new.first[j] + 1, new.first[j + 1]) for j in here] or [np.zeros(0, int)])
    if not inner.size:
        return
    j = np.repeat(here, new.parts[here] - 1)
    a, b = old.first[j], old.first[j + 1]
    H = new.base[j + 1] - new.base[j]
    x = (target.s[inner] - new.base[j]) / H
    nodes = np.hstack(_nodal(state)[:4])
    before, after = _slopes(nodes, line.s, old.first, kinks)
    values = _hermite(x, nodes[a], nodes[b], H[:, None] * after[j], H[:, None] * before[j + 1])
    for k, field in enumerate(_nodal(out)[:4]):
        field[inner] = values[:, 3 * k : 3 * k + 3]
    out.slip[inner] = (1 - x)[:, None] * state.slip[a] + x[:, None] * state.slip[b]


def _nodal(state: State) -> tuple[Floats, ...]:
    """What lives on nodes: first what is smooth."""
    return state.r, state.v, state.a, state.vd, state.slip


def line_lengths(
    state: State, target: Line, new_cells: np.ndarray, line: Line, kept_old: np.ndarray, kept_new: np.ndarray
) -> Floats:
    """Unstretched lengths (N,) m with which the new cells have their tension, and the old ones what they had."""
    lengths = target.h.copy()
    lengths[kept_new] = line.h[kept_old]
    chord = np.linalg.norm(state.e[new_cells], axis=1)
    lengths[new_cells] = chord / (1.0 + target.ck[new_cells] * state.T[new_cells])
    return lengths


def _slopes(x: Floats, s: Floats, at: np.ndarray, kinks: np.ndarray) -> tuple[Floats, Floats]:
    """Derivative (n+1, 3) of x before and after every base node: of the parabola, one-sided at kinks and ends."""
    step, h = np.diff(x, axis=0), np.diff(s)
    d = step / h[:, None]
    n = h.size
    before, after = np.clip(at - 1, 0, n - 1), np.clip(at, 0, n - 1)
    ha, hb = h[before][:, None], h[after][:, None]
    middle = (hb * d[before] + ha * d[after]) / (ha + hb)
    single = kinks.copy()
    single[[0, -1]] = True

    def one_sided(near: np.ndarray, far: np.ndarray) -> Floats:
        far = np.clip(far, 0, n - 1)
        hn, hf = h[near][:, None], h[far][:, None]
        return d[near] + (d[near] - d[far]) * hn / (hn + hf)

    left = np.where(single[:, None], one_sided(before, before - 1), middle)
    right = np.where(single[:, None], one_sided(after, after + 1), middle)
    return left, right


def _hermite(x: Floats, a: Floats, b: Floats, ma: Floats, mb: Floats) -> Floats:
    """Cubic through a and b with slopes ma and mb over the unit interval, at x (k,)."""
    x = x[:, None]
    return np.asarray(
        (1 + 2 * x) * (1 - x) ** 2 * a + x * (1 - x) ** 2 * ma + x * x * (3 - 2 * x) * b + x * x * (x - 1) * mb
    )


def _tension(at: Floats, s: Floats, T: Floats, kinks: Floats) -> Floats:
    """Tension at places, m, from that of cells: linear between their middles and to where it may jump."""
    out = np.empty(at.size)
    bounds = np.unique(np.searchsorted(s, np.concatenate([s[:1], kinks, s[-1:]]) - ROUND * s[-1]))
    for a, b in pairwise(bounds):
        x, y = 0.5 * (s[a:b] + s[a + 1 : b + 1]), T[a:b]
        if b - a > 1:
            first = y[0] - (y[1] - y[0]) / (x[1] - x[0]) * (x[0] - s[a])
            last = y[-1] + (y[-1] - y[-2]) / (x[-1] - x[-2]) * (s[b] - x[-1])
            first, last = (
                v if v * w > 0.0 else w for v, w in ((first, y[0]), (last, y[-1]))
            )  # no slack out of nothing
            x, y = np.concatenate([s[a : a + 1], x, s[b : b + 1]]), np.concatenate([[first], y, [last]])
        here = (at > s[a]) & (at < s[b])
        out[here] = np.interp(at[here], x, y)
    return out


def _momentum(
    old: Layout, new: Layout, line: Line, target: Line, state: State, out: State, changed: np.ndarray
) -> None:
    """Make the linear momentum of every changed stretch what it was, by one shift of velocity of its inner nodes.

    Nodes at the edge of a stretch are left alone, or cells beyond it would be pulled at their length; what is
    then missing (of a stretch without inner nodes) is a shift of the whole line.
    """
    missing = np.zeros(3)
    for a, b in pairwise(edges(changed)):
        if changed[a]:
            was, now = (slice(int(x.first[a]), int(x.first[b]) + 1) for x in (old, new))
            less = line.mass[was] @ state.v[was] - target.mass[now] @ out.v[now]
            inner = slice(now.start + 1, now.stop - 1)
            if inner.stop > inner.start:
                out.v[inner] += less / target.mass[inner].sum()
            else:
                missing += less
    if missing.any():
        out.v[1:-1] += missing / target.mass[1:-1].sum()


def _frames(
    new: Layout, changed: np.ndarray, out: State, target: Line, twist: Floats, clamps: Sequence[Clamp | None]
) -> None:
    """First directors of rod cells that are new: carried on from those that were there, and from clamps."""
    rod, fresh, base = new.rod_cells, np.repeat(changed, new.counts), new.base_of_cell
    d = out.e / np.linalg.norm(out.e, axis=1)[:, None]
    step = twist[base] * target.h  # from cell to cell, rad

    for p, q in pairwise(edges(2 * rod + (rod & fresh))):
        if not (rod[p] and fresh[p]):
            continue
        left = (out.a1[p - 1], d[p - 1]) if p > 0 and rod[p - 1] else clamps[0] if p == 0 else None
        right = (out.a1[q], d[q]) if q < rod.size and rod[q] else clamps[1] if q == rod.size else None
        if left is None and right is not None:
            director, tangent = right
            for c in range(q - 1, p - 1, -1):
                director, tangent = _turned(_carried(director, tangent, d[c]), d[c], -step[c]), d[c]
                out.a1[c] = director
            continue
        if left is None:
            out.a1[p] = _across(d[p])
        director, tangent = left or (out.a1[p], d[p])
        for c in range(p if left else p + 1, q):
            turn = step[c] * (0.5 if c == 0 else 1.0)  # a clamp is half a cell from its neighbour
            director, tangent = _turned(_carried(director, tangent, d[c]), d[c], turn), d[c]
            out.a1[c] = director
        if left and right:  # what is left of the twist is spread
            closing = _carried(director, tangent, right[1])
            angle = np.arctan2(np.cross(closing, right[0]) @ right[1], closing @ right[0])
            for k, c in enumerate(range(p, q), start=1):
                out.a1[c] = _turned(out.a1[c], d[c], angle * k / (q - p + 1))


def _across(d: Floats) -> Floats:
    a = np.eye(3)[int(np.argmin(np.abs(d)))]
    a = a - (a @ d) * d
    return np.asarray(a / np.linalg.norm(a))


def _carried(a: Floats, d: Floats, to: Floats) -> Floats:
    """A director carried from one chord to the next by the smallest rotation."""
    c = 1.0 + d @ to
    b = a - (a @ to) / c * (d + to) if c > 1e-12 else a
    b = b - (b @ to) * to
    return np.asarray(b / np.linalg.norm(b))


def _all_carried(a: Floats, d: Floats, to: Floats) -> Floats:
    """The same for many (k, 3) that turn by less than half a turn."""

    def dot(x: Floats, y: Floats) -> Floats:
        return np.asarray(np.einsum("ij,ij->i", x, y)[:, None])

    b = a - dot(a, to) / (1.0 + dot(d, to)) * (d + to)
    b = b - dot(b, to) * to
    return np.asarray(b / np.linalg.norm(b, axis=1)[:, None])


def _turned(a: Floats, d: Floats, angle: Any) -> Floats:
    return np.asarray(np.cos(angle) * a + np.sin(angle) * np.cross(d, a)) if angle else a
