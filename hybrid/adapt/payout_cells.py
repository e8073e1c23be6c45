"""A node that enters a line at its fairlead, or leaves it: the state on the new nodes, and what the new cells lack.

The material has a velocity and accelerations of its own at the fairlead: those of the last node less what comes from
the flow of material through it (docs/theory.md, 19).  A new node lies on the cubic through the last four.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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


def _lack(true: float, ck: float, T: float, e: Floats) -> float:
    """What a cell lacks of its true length, m, so that its law of length holds."""
    return true - _size(e) / (1.0 + ck * T)


def _mismatch(line: Line, state: State, flow: Flow, reel: Reel, c: int) -> float:
    """By how much, m/s, the rate of the chord of cell c misses that of its length."""
    e, n = state.e[c], line.h.size
    along = float(e @ (state.v[c + 1] - state.v[c])) / _size(e)
    grows = (flow.rate if c == n - 1 else 0.0) - float(lack_at(reel, flow.t)[1][c])
    ck, T = float(line.ck[c]), float(state.T[c])
    return along - grows * (1.0 + ck * T) - float(line.h[c]) * ck * _tension_rate(state, flow, c)


def _tension_rate(state: State, flow: Flow, c: int) -> float:
    return float(state.T[c] - flow.tension[c]) / flow.dt if flow.dt > 0.0 else 0.0


def _rate(ck: float, T: float, h: float, rises: float, e: Floats, e1: Floats, grows: float, mismatch: float) -> float:
    """Rate, m/s, of what a cell lacks: its chord e has the rate e1, its true length grows; mismatch: it keeps."""
    along = float(e @ e1) / _size(e)
    return grows - (along - mismatch - h * ck * rises) / (1.0 + ck * T)


def _carried(a: Floats, e: Floats, to: Floats) -> Floats:
    """A first director carried from one chord to another by the smallest rotation."""
    d, f = e / _size(e), to / _size(to)
    out = a - (a @ f) / (1.0 + d @ f) * (d + f)
    size = _size(out)
    return np.asarray(out / size) if size > 0.0 else out


def material_at_fairlead(line: Line, state: State, flow: Flow) -> tuple[Floats, Floats, Floats]:
    """Velocity, algorithmic and true acceleration of the material at the fairlead (kernels.payout.at_fairlead)."""
    ha, hb = line.h[-2:]
    sa, sb = state.e[-2] / ha, state.e[-1] / hb
    beyond = hb / (ha + hb)
    slope, bend = sb + beyond * (sb - sa), 2.0 / (ha + hb) * (sb - sa)
    v = state.v[-1] - flow.rate * slope
    va, vb = (state.v[-2] - state.v[-3]) / ha, (v - state.v[-2]) / hb
    turns = vb + beyond * (vb - va)

    def excess(rate: float, acceleration: float) -> Floats:
        return np.asarray(2.0 * rate * turns + rate * rate * bend + acceleration * slope)

    return v, state.a[-1] - excess(*flow.later), state.vd[-1] - excess(flow.rate, flow.acceleration)


def _weights(x: Floats, at: float) -> Floats:
    """Lagrange's weights of nodes x at a place."""
    w = np.ones(x.size)
    for i in range(x.size):
        for j in range(x.size):
            if i != j:
                w[i] *= (at - x[j]) / (x[i] - x[j])
    return w


def enter(line: Line, target: Line, state: State, reel: Reel, new: Reel, flow: Flow, place: float) -> State:
    """The state with one more node at `place`, m, before the fairlead; what new cells lack goes into `new`."""
    n = line.h.size
    out = blank_state(n + 1, len(line.torsion))
    out.turn[:] = state.turn
    for name in ("r", "v", "a", "vd", "slip", "bed"):
        x, y = getattr(state, name), getattr(out, name)
        y[:n], y[-1] = x[:n], x[n]
    for name in ("e", "T", "a1", "w", "wa", "wd"):
        getattr(out, name)[:n] = getattr(state, name)
        getattr(out, name)[n] = getattr(state, name)[n - 1]
    first = max(n - 3, 0)
    w = _weights(np.append(line.s[first:n], line.s[n]), place)
    from_last = np.concatenate([-np.cumsum(state.e[first : n - 1][::-1], axis=0)[::-1], np.zeros((1, 3)), state.e[-1:]])
    v, a, vd = material_at_fairlead(line, state, flow)
    out.e[n - 1] = w @ from_last
    out.e[n] = state.e[n - 1] - out.e[n - 1]
    out.r[n] = state.r[n - 1] + out.e[n - 1]
    for name, value in (("v", v), ("a", a), ("vd", vd)):
        getattr(out, name)[n] = w @ np.vstack([getattr(state, name)[first:n], value])
    part = (place - line.s[n - 1]) / (line.s[n] - line.s[n - 1])
    out.slip[n] = (1.0 - part) * state.slip[n - 1] + part * state.slip[n]
    h = float(line.s[n] - line.s[n - 1])
    slope = (state.T[n - 1] - state.T[n - 2]) / (0.5 * (line.h[n - 2] + h))
    trues = (place - line.s[n - 1], line.s[n] - place)
    mismatch, rises = _mismatch(line, state, flow, reel, n - 1), _tension_rate(state, flow, n - 1)
    _keep_lacks(reel, new, n - 1)
    for c, true, at in ((n - 1, trues[0], 0.5 * trues[0] - 0.5 * h), (n, trues[1], 0.5 * h - 0.5 * trues[1])):
        out.T[c] = state.T[n - 1] + slope * at
        out.a1[c] = _carried(state.a1[n - 1], state.e[n - 1], out.e[c])
        ck, T, grows = float(target.ck[c]), float(out.T[c]), flow.rate if c == n else 0.0
        rate = _rate(ck, T, true, rises, out.e[c], out.v[c + 1] - out.v[c], grows, mismatch * true / h)
        _lacks(new, c, float(_lack(true, ck, T, out.e[c])), rate, flow)
    return out


def leave(line: Line, target: Line, state: State, reel: Reel, new: Reel, flow: Flow) -> State:
    """The state without the last material node; what the cell that two become lacks goes into `new`."""
    n = line.h.size
    out = blank_state(n - 1, len(line.torsion))
    out.turn[:] = state.turn
    for name in ("r", "v", "a", "vd", "slip", "bed"):
        x, y = getattr(state, name), getattr(out, name)
        y[: n - 1], y[-1] = x[: n - 1], x[n]
    for name in ("e", "T", "a1", "w", "wa", "wd"):
        getattr(out, name)[:] = getattr(state, name)[: n - 1]
    c, (ha, hb) = n - 2, line.h[-2:]
    out.e[c] = state.e[n - 2] + state.e[n - 1]
    for name in ("T", "w", "wa", "wd"):
        x = getattr(state, name)
        getattr(out, name)[c] = (ha * x[n - 2] + hb * x[n - 1]) / (ha + hb)
    out.a1[c] = _carried(state.a1[n - 2], state.e[n - 2], out.e[c])
    mismatch = _mismatch(line, state, flow, reel, n - 2) + _mismatch(line, state, flow, reel, n - 1)
    rises = (ha * _tension_rate(state, flow, n - 2) + hb * _tension_rate(state, flow, n - 1)) / (ha + hb)
    true, ck, T = float(line.s[n] - line.s[n - 2]), float(target.ck[c]), float(out.T[c])
    _keep_lacks(reel, new, n - 2)
    rate = _rate(ck, T, true, rises, out.e[c], out.v[c + 1] - out.v[c], flow.rate, mismatch)
    _lacks(new, c, _lack(true, ck, T, out.e[c]), rate, flow)
    return out


def _keep_lacks(reel: Reel, new: Reel, count: int) -> None:
    """Cells that stay are on their way as they were."""
    for name in ("lack", "rate", "since", "span"):
        getattr(new, name)[:count] = getattr(reel, name)[:count]


def _lacks(reel: Reel, c: int, lack: float, rate: float, flow: Flow) -> None:
    span = min(MOST_STEPS * flow.dt, 0.5 * flow.cell / max(abs(flow.rate), 1e-12))
    reel.lack[c], reel.rate[c], reel.since[c] = lack, rate, flow.t
    reel.span[c] = max(span, FEWEST_STEPS * flow.dt, 1e-9)
