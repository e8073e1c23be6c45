"""A node that enters a line at its fairlead, or leaves it: the state on the new nodes, and what the new cells lack.

The material has a velocity and accelerations of its own at the fairlead: those of the last node less what comes from
the flow of material through it (docs/theory.md, 19).  A new node lies on the cubic through the last four.
Lines and states are those of `from_far_end`: the fairlead is their end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.kernels.axial_law import DYNAMIC, FIRST, LAST, PER_TENSION, STRAIN, TENSION
from hybrid.kernels.reel import Reel
from hybrid.kernels.state import Floats, Line, State, blank_state

# Steps over which new cells get their true lengths, at most and at least.
MOST_STEPS, FEWEST_STEPS = 40, 8


class Flow(NamedTuple):
    """How material flows through the fairlead, and steps that lead there."""

    t: float  # s
    dt: float  # s, of the last step
    rate: float  # m/s
    acceleration: float  # m/s2
    later: tuple[float, float]  # both of them when the algorithmic acceleration stands for
    cell: float  # m, length of a cell that has just entered
    tension: Floats  # (N,) N, before the last step


def from_far_end(state: State, side: int) -> State:
    """A state whose last node is that of the fairlead, end `side` of the line; and back."""
    if side:
        return state
    turned = {name: np.ascontiguousarray(x[::-1]) for name, x in state._asdict().items() if name != "turn"}
    turned["e"] *= -1.0
    turned["w"], turned["wa"], turned["wd"] = -turned["w"], -turned["wa"], -turned["wd"]
    return state._replace(**turned)


def line_from_far_end(line: Line, side: int, far: float) -> Line:
    """What of a line `enter` and `leave` ask for, counted from the far end, at the arc length far, m."""
    return line if side else line._replace(s=far - line.s[::-1], h=line.h[::-1], ck=line.ck[::-1], law=line.law[::-1])


def lack_at(reel: Reel, t: float) -> tuple[Floats, Floats]:
    """What cells lack (N,) m at t (s), and its rate (m/s)."""
    x = np.clip((t - reel.since) / reel.span, 0.0, 1.0)
    value = reel.lack * (1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x * x))
    value += reel.span * reel.rate * x * (1.0 - x) ** 3 * (1.0 + 3.0 * x)
    slope = -reel.lack / reel.span * 30.0 * x * x * (1.0 - x) ** 2
    slope += reel.rate * (1.0 - x) ** 2 * (1.0 + 2.0 * x - 15.0 * x * x)
    return value, slope


def _size(e: Floats) -> float:
    return float(np.sqrt(e @ e))


def _strain(line: Line, state: State, c: int) -> float:
    """Strain of cell c under its tension: by its compliance, or by its law (kernels.axial_law)."""
    T = float(state.T[c])
    if not line.law.size or line.law[c, LAST] == line.law[c, FIRST]:
        return float(line.ck[c]) * T
    row = line.law[c]
    mean = float(state.slow[c]) if row[DYNAMIC] > 0.0 else T
    x, y = line.law_table[int(row[FIRST]) : int(row[LAST]), [STRAIN, TENSION]].T
    j = min(max(int(np.searchsorted(y, mean, side="right")) - 1, 0), y.size - 2)
    strain = x[j] + (mean - y[j]) * (x[j + 1] - x[j]) / (y[j + 1] - y[j])
    return float(strain + ((T - mean) / (row[DYNAMIC] + row[PER_TENSION] * max(mean, 0.0)) if mean != T else 0.0))


def _lack(true: float, strain: float, e: Floats) -> float:
    """What a cell lacks of its true length, m, so that its law of length holds."""
    return true - _size(e) / (1.0 + strain)


def _mismatch(line: Line, state: State, flow: Flow, reel: Reel, c: int) -> float:
    """By how much, m/s, the rate of the chord of cell c misses that of its length."""
    e = state.e[c]
    along = float(e @ (state.v[c + 1] - state.v[c])) / _size(e)
    grows = (flow.rate if c == growing(line, reel) else 0.0) - float(lack_at(reel, flow.t)[1][c])
    ck, strain = float(line.ck[c]), _strain(line, state, c)
    return along - grows * (1.0 + strain) - float(line.h[c]) * ck * _tension_rate(state, flow, c)


def growing(line: Line, reel: Reel) -> int:
    """The cell that grows; the nodes behind it ride with the fairlead."""
    return line.h.size - reel.layer.size


def _tension_rate(state: State, flow: Flow, c: int) -> float:
    return float(state.T[c] - flow.tension[c]) / flow.dt if flow.dt > 0.0 else 0.0


def _rate(
    ck: float, strain: float, h: float, rises: float, e: Floats, e1: Floats, grows: float, mismatch: float
) -> float:
    """Rate, m/s, of what a cell lacks: its chord e has the rate e1, its true length grows; mismatch: it keeps."""
    along = float(e @ e1) / _size(e)
    return grows - (along - mismatch - h * ck * rises) / (1.0 + strain)


def _carried(a: Floats, e: Floats, to: Floats) -> Floats:
    """A first director carried from one chord to another by the smallest rotation."""
    d, f = e / _size(e), to / _size(to)
    out = a - (a @ f) / (1.0 + d @ f) * (d + f)
    size = _size(out)
    return np.asarray(out / size) if size > 0.0 else out


def _slope_at(line: Line, state: State, i: int) -> tuple[Floats, Floats]:
    """r' and r'' at node i (kernels.payout.slope_at)."""
    j = min(i, line.h.size - 1)
    ha, hb = line.h[j - 1], line.h[j]
    sa, sb = state.e[j - 1] / ha, state.e[j] / hb
    part = ha / (ha + hb) if i == j else 1.0 + hb / (ha + hb)
    return sa + part * (sb - sa), 2.0 / (ha + hb) * (sb - sa)


def material_at(line: Line, state: State, reel: Reel, flow: Flow) -> tuple[Floats, Floats, Floats]:
    """Velocity, algorithmic and true acceleration of the material at the first node that rides (kernels.payout)."""
    g = growing(line, reel)
    i, j = g + 1, min(g + 1, line.h.size - 1)
    ha, hb = line.h[j - 1], line.h[j]
    slope, bend = _slope_at(line, state, i)

    def velocity(node: int) -> Floats:
        return np.asarray(state.v[node] - (flow.rate * _slope_at(line, state, node)[0] if node > g else 0.0))

    va, vb = (velocity(j) - velocity(j - 1)) / ha, (velocity(j + 1) - velocity(j)) / hb
    turns = va + (ha / (ha + hb) if i == j else 1.0 + hb / (ha + hb)) * (vb - va)

    def excess(rate: float, acceleration: float) -> Floats:
        return np.asarray(2.0 * rate * turns + rate * rate * bend + acceleration * slope)

    return velocity(i), state.a[i] - excess(*flow.later), state.vd[i] - excess(flow.rate, flow.acceleration)


def _weights(x: Floats, at: float) -> Floats:
    """Lagrange's weights of nodes x at a place."""
    w = np.ones(x.size)
    for i in range(x.size):
        for j in range(x.size):
            if i != j:
                w[i] *= (at - x[j]) / (x[i] - x[j])
    return w


def _means(line: Line) -> tuple[str, ...]:
    """What cells have beside other lines' where tension is no multiple of strain: mean tensions."""
    return ("slow",) if line.law.size else ()


def enter(line: Line, target: Line, state: State, reel: Reel, new: Reel, flow: Flow, place: float) -> State:
    """The state with one more node at `place`, m, in the cell that grows; what new cells lack goes into `new`."""
    g = growing(line, reel)
    i = g + 1  # the new node; the one that was there is the next
    out = blank_state(line.h.size + 1, len(line.torsion), line.law.size > 0)
    out.turn[:] = state.turn
    for name in ("r", "v", "a", "vd", "slip", "bed"):
        x, y = getattr(state, name), getattr(out, name)
        y[:i], y[i + 1 :] = x[:i], x[i:]
    for name in ("e", "T", "a1", "w", "wa", "wd", *_means(line)):
        x, y = getattr(state, name), getattr(out, name)
        y[:i], y[i:] = x[:i], x[g:]
    first = max(i - 3, 0)
    w = _weights(line.s[[*range(first, i), i]], place)
    from_last = np.concatenate([-np.cumsum(state.e[first:g][::-1], axis=0)[::-1], np.zeros((1, 3)), state.e[g:i]])
    v, a, vd = material_at(line, state, reel, flow)
    out.e[g] = w @ from_last
    out.e[i] = state.e[g] - out.e[g]
    out.r[i] = state.r[g] + out.e[g]
    for name, value in (("v", v), ("a", a), ("vd", vd)):
        getattr(out, name)[i] = w @ np.vstack([getattr(state, name)[first:i], value])
    part = (place - line.s[g]) / (line.s[i] - line.s[g])
    out.slip[i] = (1.0 - part) * state.slip[g] + part * state.slip[i]
    h = float(line.s[i] - line.s[g])
    slope = (state.T[g] - state.T[g - 1]) / (0.5 * (line.h[g - 1] + h))
    trues = (place - line.s[g], line.s[i] - place)
    mismatch, rises = _mismatch(line, state, flow, reel, g), _tension_rate(state, flow, g)
    _keep_lacks(reel, new, g)
    for c, true, at in ((g, trues[0], 0.5 * trues[0] - 0.5 * h), (i, trues[1], 0.5 * h - 0.5 * trues[1])):
        out.T[c] = state.T[g] + slope * at
        out.a1[c] = _carried(state.a1[g], state.e[g], out.e[c])
        if line.law.size:
            out.slow[c] = state.slow[g] + slope * at
        strain, grows = _strain(target, out, c), flow.rate if c == i else 0.0
        e1 = out.v[c + 1] - out.v[c]
        rate = _rate(float(target.ck[c]), strain, true, rises, out.e[c], e1, grows, mismatch * true / h)
        _lacks(new, c, float(_lack(true, strain, out.e[c])), rate, flow)
    return out


def leave(line: Line, target: Line, state: State, reel: Reel, new: Reel, flow: Flow) -> State:
    """The state without the last material node; what the cell that two become lacks goes into `new`."""
    g = growing(line, reel)
    c = g - 1
    out = blank_state(line.h.size - 1, len(line.torsion), line.law.size > 0)
    out.turn[:] = state.turn
    for name in ("r", "v", "a", "vd", "slip", "bed"):
        x, y = getattr(state, name), getattr(out, name)
        y[:g], y[g:] = x[:g], x[g + 1 :]
    for name in ("e", "T", "a1", "w", "wa", "wd", *_means(line)):
        x, y = getattr(state, name), getattr(out, name)
        y[:g], y[g:] = x[:g], x[g + 1 :]
    ha, hb = line.h[c], line.h[g]
    out.e[c] = state.e[c] + state.e[g]
    for name in ("T", "w", "wa", "wd", *_means(line)):
        x = getattr(state, name)
        getattr(out, name)[c] = (ha * x[c] + hb * x[g]) / (ha + hb)
    out.a1[c] = _carried(state.a1[c], state.e[c], out.e[c])
    mismatch = _mismatch(line, state, flow, reel, c) + _mismatch(line, state, flow, reel, g)
    rises = (ha * _tension_rate(state, flow, c) + hb * _tension_rate(state, flow, g)) / (ha + hb)
    true, strain = float(line.s[g + 1] - line.s[c]), _strain(target, out, c)
    _keep_lacks(reel, new, c)
    e1 = out.v[c + 1] - out.v[c]
    rate = _rate(float(target.ck[c]), strain, true, rises, out.e[c], e1, flow.rate, mismatch)
    _lacks(new, c, _lack(true, strain, out.e[c]), rate, flow)
    return out


def _keep_lacks(reel: Reel, new: Reel, count: int) -> None:
    """Cells that stay are on their way as they were."""
    for name in ("lack", "rate", "since", "span"):
        getattr(new, name)[:count] = getattr(reel, name)[:count]


def _lacks(reel: Reel, c: int, lack: float, rate: float, flow: Flow) -> None:
    span = min(MOST_STEPS * flow.dt, 0.5 * flow.cell / max(abs(flow.rate), 1e-12))
    reel.lack[c], reel.rate[c], reel.since[c] = lack, rate, flow.t
    reel.span[c] = max(span, FEWEST_STEPS * flow.dt, 1e-9)
