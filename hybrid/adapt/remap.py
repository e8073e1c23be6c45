"""From the old zones to the new ones: nothing that stays moves, and nothing is lost.

Base nodes keep their positions to the last bit.  Nodes that appear lie on a cubic through the base
nodes, so that a rod begins without kinks; nodes that go are dropped.  Mass is exact by construction, linear momentum
by a small shift of the velocities of the nodes concerned, region by region.  The length that a chord gains or
loses when an arc becomes chords (or chords an arc) is kept: every new cell is given the unstretched length that
makes its tension what it was, and is let go to its true length slowly (`Relaxing`).
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hybrid.model.layout import Layout, edges
from hybrid.model.state import Floats, Line, State, blank_state


class Remapped(NamedTuple):
    """A state on new nodes, and the lengths (N,) m that its cells have now; their true ones are in the line."""

    state: State
    lengths: Floats


def remap(
    old: Layout, new: Layout, line: Line, target: Line, state: State, kinks: np.ndarray, twist: Floats
) -> Remapped:
    """Carry a state from one layout to another of the same base.

    line, target: the old and the new line; kinks: (n+1,) bool, base nodes where the tangent may jump (point loads);
    twist: (n,) 1/m, twist to give to the frames of base cells that become rod.
    """
    out = blank_state(target.h.size)
    now, then = old.first, new.first
    place = then[:-1]
    changed = old.rod != new.rod
    # what stays, to the last bit
    kept_old = np.concatenate([np.arange(now[j], now[j + 1]) for j in np.flatnonzero(~changed)] or [np.zeros(0, int)])
    kept_new = np.concatenate([np.arange(then[j], then[j + 1]) for j in np.flatnonzero(~changed)] or [np.zeros(0, int)])
    for a, b in zip(_nodal(state), _nodal(out), strict=True):
        b[place], b[-1] = a[now[:-1]], a[-1]
        b[kept_new] = a[kept_old]
    for a, b in ((state.e, out.e), (state.T, out.T), (state.a1, out.a1), (state.w, out.w)):
        b[kept_new] = a[kept_old]
    out.wa[kept_new], out.wd[kept_new] = state.wa[kept_old], state.wd[kept_old]
    # tension where cells are new, from the middles of the old ones
    new_cells = np.repeat(changed, new.counts)
    middles, new_middles = 0.5 * (line.s[:-1] + line.s[1:]), 0.5 * (target.s[:-1] + target.s[1:])
    out.T[new_cells] = np.interp(new_middles[new_cells], middles, state.T)
    # new nodes on a cubic
    smooth = [(a, b, _slopes(a, line.s, now, kinks)) for a, b in zip(_nodal(state)[:4], _nodal(out)[:4], strict=True)]
    for j in np.flatnonzero(changed & new.rod):
        inner = np.arange(then[j] + 1, then[j + 1])
        H = new.base[j + 1] - new.base[j]
        x = (target.s[inner] - new.base[j]) / H
        for nodes, values, slopes in smooth:
            values[inner] = _hermite(x, nodes[now[j]], nodes[now[j + 1]], H * slopes[1][j], H * slopes[0][j + 1])
        out.slip[inner] = (1 - x)[:, None] * state.slip[now[j]] + x[:, None] * state.slip[now[j + 1]]
    chords = np.diff(out.r, axis=0)
    out.e[new_cells] = chords[new_cells]
    _momentum(new, line, target, state, out, changed)
    _frames(new, changed, out, target, twist)
    lengths = line_lengths(out, target, new_cells, line, kept_old, kept_new)
    return Remapped(out, lengths)


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


def _momentum(new: Layout, line: Line, target: Line, state: State, out: State, changed: np.ndarray) -> None:
    """Make the linear momentum what it was: one shift of velocity for the inner nodes of every changed stretch.

    Nodes at the edge of a stretch are left alone, or cells beyond it would be pulled at their length; what is
    then missing (a stretch without inner nodes) is a shift of the whole line.
    """
    missing = line.mass @ state.v - target.mass @ out.v
    inner = np.zeros(target.mass.size, bool)
    bounds = edges(changed)
    for a, b in pairwise(bounds):
        if changed[a]:
            inner[int(new.first[a]) + 1 : int(new.first[b])] = True
    if inner.any():
        out.v[inner] += missing / target.mass[inner].sum()
    else:
        out.v[1:-1] += missing / target.mass[1:-1].sum()


def _frames(new: Layout, changed: np.ndarray, out: State, target: Line, twist: Floats) -> None:
    """First directors of rod cells that are new: carried on without twist from those that were there."""
    rod, fresh, base = new.rod_cells, np.repeat(changed, new.counts), new.base_of_cell
    d = out.e / np.linalg.norm(out.e, axis=1)[:, None]
    for a, b in pairwise(edges(rod)):
        if not rod[a]:
            continue
        known = [c for c in range(a, b) if not fresh[c]]
        if not known:
            out.a1[a] = _across(d[a])
            known = [a]
        for c in range(known[0] - 1, a - 1, -1):
            out.a1[c] = _turned(_carried(out.a1[c + 1], d[c + 1], d[c]), d[c], -twist[base[c]] * target.h[c])
        for left, right in zip(known, [*known[1:], b], strict=True):
            for c in range(left + 1, min(right, b)):
                out.a1[c] = _turned(_carried(out.a1[c - 1], d[c - 1], d[c]), d[c], twist[base[c]] * target.h[c])
            if right < b and right > left + 1:  # two old rods meet: spread what is left of the twist between them
                closing = _carried(out.a1[right - 1], d[right - 1], d[right])
                angle = np.arctan2(np.cross(closing, out.a1[right]) @ d[right], closing @ out.a1[right])
                gap = right - left
                for k, c in enumerate(range(left + 1, right), start=1):
                    out.a1[c] = _turned(out.a1[c], d[c], angle * k / gap)


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


def _turned(a: Floats, d: Floats, angle: float) -> Floats:
    return np.asarray(np.cos(angle) * a + np.sin(angle) * np.cross(d, a)) if angle else a
