"""The same line on fewer nodes, and back: an equilibrium on a coarse mesh is a start for a fine one."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from hybrid.kernels.march.zone_torque import COMPLIANCE, FREE
from hybrid.kernels.state.report import FRICTION, PLANAR, ROTARY, TOUCHES
from hybrid.kernels.state.state import Floats, Line, State, state_for
from hybrid.model.build import Model
from hybrid.model.ends import first_director
from hybrid.model.line import NO_INERTIA, WITH_SECTIONS, line_on
from hybrid.model.plane import planar

FEWER = 4  # cells that become one
MANY = 1000  # cells of a line from which on the equilibrium of a coarser mesh is sought first
FEWEST = 80  # cells below which a line is coarse enough
FOLDED = -1.0 + 1e-6  # cosine of the turn of a chord that is turned right back


def coarser(model: Model) -> Model | None:
    """The model with a quarter of its cells and with its own start; None: there is none.

    It has few cells already, all of its nodes must stay, or it folds in that start.  Zones, sections and point loads
    keep their nodes.
    """
    line, cable = model.line, model.cable
    if model.cells <= FEWEST:
        return None
    kept = np.zeros(line.s.size, bool)
    kinds = np.flatnonzero(line.spin[1:] != line.spin[:-1]) + 1
    places = np.searchsorted(line.s, np.concatenate([cable.bounds, cable.at]) - 1e-9 * line.s[-1])
    fixed = np.unique(np.concatenate([[0], kinds, places, [line.s.size - 1]]))
    for a, b in pairwise(fixed):
        kept[np.linspace(a, b, max(2, round((b - a) / FEWER)) + 1).astype(int) if b - a > 1 else [a, b]] = True
    at = np.flatnonzero(kept)
    rod = line.spin[at[:-1]] == 1
    bits, inertia = line.bits & (TOUCHES | FRICTION), WITH_SECTIONS if line.bits & ROTARY else NO_INERTIA
    if at.size == line.s.size:  # every node stays, as beside so many point loads
        return None
    new = line_on(cable, line.s[at], rod, bits, inertia)
    if line.bits & PLANAR:
        new = planar(new, line.plane)
    start = picked(new, model.start, at, _turns(line, new, model.start))
    if start is None:
        return None
    spare = ((name, picked(new, x, at, _turns(line, new, x))) for name, x in model.other_starts)
    others = tuple((name, x) for name, x in spare if x is not None)
    return replace(model, line=new, sea=model.sea.on(rod.size), start=start, other_starts=others, layout=None)


def refined(state: State, coarse: Line, line: Line) -> State:
    """A state of a coarse line on a finer one: its nodes on parabolas, joined, so that a rod begins without kinks."""
    out = state_for(line)
    out.turn[:, 0] = _turns(coarse, line, state)
    out.r[:] = _smooth(state.r, coarse.s, line.s)
    out.e[:] = np.diff(out.r, axis=0)
    middle = 0.5 * (line.s[:-1] + line.s[1:])
    out.T[:] = np.interp(middle, 0.5 * (coarse.s[:-1] + coarse.s[1:]), state.T)
    of = np.clip(np.searchsorted(coarse.s, middle) - 1, 0, coarse.h.size - 1)
    _carry_directors(line, state.e[of], state.a1[of], out)
    return out


def _turns(line: Line, other: Line, state: State) -> Floats:
    """Turns (K,) rad of zones of the other line that make their torques those of a state of the line."""
    torque = (state.turn[:, 0] - line.torsion[:, FREE]) / line.torsion[:, COMPLIANCE]
    return np.asarray(torque * other.torsion[:, COMPLIANCE] + other.torsion[:, FREE])


def picked(line: Line, state: State, at: np.ndarray, turns: Floats | None = None) -> State | None:
    """The state at some of its nodes, those of `line`; None: two of them lie at the same place.

    turns: (K,) rad, of zones of the line that a torque passes through.
    """
    out = state_for(line)
    if turns is not None:
        out.turn[:, 0] = turns
    out.r[:], out.v[:] = state.r[at], state.v[at]
    out.e[:] = np.add.reduceat(state.e, at[:-1], axis=0)
    if not out.e.any(axis=1).all():
        return None
    out.T[:] = np.add.reduceat(state.T, at[:-1]) / np.diff(at)
    _carry_directors(line, state.e[at[:-1]], state.a1[at[:-1]], out)
    return out


def _carry_directors(line: Line, chords: Floats, a: Floats, state: State) -> None:
    """First directors of a state: those (N, 3) of other chords (N, 3), which turn to its chords without spin.

    In a plane they turn about its normal, however far; in space they are made normal to chords that turn by less than
    60 degrees, and turned with the others by the smallest rotation: made normal, one would come out on the other side.
    """
    d, new = (e / np.linalg.norm(e, axis=1)[:, None] for e in (chords, state.e))
    if line.bits & PLANAR:
        n = line.plane[2]
        x, y = a @ n, np.einsum("ij,ij->i", a, np.cross(n, d))
        state.a1[:] = x[:, None] * n + y[:, None] * np.cross(n, new)
        return
    cosine = np.einsum("ij,ij->i", d, new)
    far = (cosine < 0.5) & (cosine > FOLDED)
    s = np.einsum("ij,ij->i", a[far], new[far]) / (1.0 + cosine[far])
    a = a.copy()
    a[far] -= s[:, None] * (d[far] + new[far])
    a -= np.einsum("ij,ij->i", a, new)[:, None] * new
    for i in np.flatnonzero((np.linalg.norm(a, axis=1) < 1e-3) | (cosine <= FOLDED)):  # any will do
        a[i] = first_director(new[i])
    state.a1[:] = a / np.linalg.norm(a, axis=1)[:, None]


def _smooth(r: Floats, s: Floats, at: Floats) -> Floats:
    """Cubics through the nodes with the slopes of parabolas."""
    h, d = np.diff(s), np.diff(r, axis=0) / np.diff(s)[:, None]
    slope = np.empty_like(r)
    slope[1:-1] = (h[1:, None] * d[:-1] + h[:-1, None] * d[1:]) / (h[:-1] + h[1:])[:, None]
    slope[0], slope[-1] = 2.0 * d[0] - slope[1], 2.0 * d[-1] - slope[-2]
    j = np.clip(np.searchsorted(s, at, side="right") - 1, 0, h.size - 1)
    x, H = ((at - s[j]) / h[j])[:, None], h[j][:, None]
    a, b = r[j], r[j + 1]
    out = (1 + 2 * x) * (1 - x) ** 2 * a + x * (1 - x) ** 2 * H * slope[j]
    return np.asarray(out + x * x * (3 - 2 * x) * b + x * x * (x - 1) * H * slope[j + 1])
