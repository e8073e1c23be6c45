"""Cells whose tension is no multiple of their strain: tables, static and dynamic stiffness of fibre ropes, polyester.

    symbol   meaning                                                                              unit
    T        tension; where the cell is damped, Te its elastic part                               N
    theta    mean tension, state.slow: T without what is faster than tau                          N
    tau      relaxation time: theta' = (T - theta)/tau                                            s
    s(T)     strain at rest, linear between the points of a table and beyond them                 -
    E        dynamic stiffness a + b theta; a = 0: none, and the strain is s(T)                   N
    eps      strain of the cell, s(theta) + (T - theta)/E                                         -
    U        energy per length, W(theta) + (Te^2 - theta^2)/(2 E) with W the integral of T ds     J/m
    peak     highest mean tension so far, state.peak, of ropes that remember it (Syrope)          N
    creep    strain that grows with time under load, c log10(1 + t/t0), t since the start         -

Of a rope that remembers it s is the table (the original curve) while theta is its peak; below it is a working curve from
the strain k1 s(peak), where there is no tension, to s(peak), of the shape that is given.  In a step theta is that of a tension which changes evenly (exact, whatever the step); at rest it is T.  The law of length
is linearised about the tension that an iteration has found: eps = SHIFT + ck T, both written here before every march.
Creep is a given strain beside eps, which stores nothing: what tension does on it is lost.  Line on a reel creeps as what
is out.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import dot, get3, sub
from hybrid.kernels.algebra.sparse_rows import interval_within
from hybrid.kernels.machine.compile import inner, linked_kernel
from hybrid.kernels.state.report import LOST_WORK, STRETCH_ENERGY
from hybrid.kernels.state.state import WORKING, blank_state, on_line

# Columns of Line.law: of a cell, its first row in Line.law_table and the row behind its last (equal: tension is a multiple
# of strain there); a, b and tau; the shape of working curves (0: there are none), its two numbers, the peak before the
# start (N); creep in a tenfold time, c, and t0 (s); then what is written: strain without tension of the linearised law;
# power lost, W; creep.
FIRST, LAST, DYNAMIC, PER_TENSION, RELAXATION = range(WORKING)
K1, K2, HIGHEST, CREEP, LOADED, SHIFT, LOSS, CREPT = range(WORKING + 1, WORKING + 9)
# Shapes of working curves: T/peak over the part of the way from the strain without tension to the peak.
LINEAR = 1.0
BY_STIFFNESS = 2.0  # straight, with k1 its stiffness, N
QUADRATIC = 3.0
EXPONENTIAL = 4.0
# Part of the peak below which a working curve goes on straight: that of a square has no stiffness without tension.
STRAIGHT = 1e-3
# Columns of Line.law_table: strain; tension, N; energy per length from the first point on, J/m.
STRAIN, TENSION, ENERGY = range(3)
# Part of a tension below which what is of damping is round-off beside a point of the table.
NO_DAMPING = 1e-9
# Below this part of the relaxation time a step takes the series of what would cancel.
SHORT = 1e-3


@inner
def strain_at(table, first, last, T):
    """Strain at rest under T, its derivative (1/N), and the energy per length."""
    j = interval_within(table[:, TENSION], first, last - 1, T)
    c = (table[j + 1, STRAIN] - table[j, STRAIN]) / (table[j + 1, TENSION] - table[j, TENSION])
    more = T - table[j, TENSION]
    return table[j, STRAIN] + c * more, c, table[j, ENERGY] + 0.5 * c * more * (T + table[j, TENSION])


@inner
def tension_at(table, first, last, strain):
    """Tension at rest at a strain."""
    j = interval_within(table[:, STRAIN], first, last - 1, strain)
    c = (table[j + 1, TENSION] - table[j, TENSION]) / (table[j + 1, STRAIN] - table[j, STRAIN])
    return table[j, TENSION] + c * (strain - table[j, STRAIN])


@inner
def shape_of(form, k, y):
    """Of a working curve where its tension is the part y of the peak: part of the way, its slope, area below in both."""
    if form == QUADRATIC:
        root = math.sqrt((1.0 - k) * (1.0 - k) + 4.0 * k * y)
        x = 2.0 * y / (1.0 - k + root)
        return x, 1.0 / root, x * x * (k * x / 3.0 + 0.5 * (1.0 - k))
    if form == EXPONENTIAL:
        grown = math.expm1(k)
        x = math.log1p(y * grown) / k
        return x, grown / (k * (1.0 + y * grown)), y / k - x / grown
    return y, 1.0, 0.5 * y * y


@inner
def working_shape(form, k, y):
    """As `shape_of`, straight below STRAIGHT."""
    x, slope, area = shape_of(form, k, STRAIGHT)
    if y < STRAIGHT:
        return x + slope * (y - STRAIGHT), slope, 0.5 * slope * y * y
    low = 0.5 * slope * STRAIGHT * STRAIGHT - area
    x, slope, area = shape_of(form, k, y)
    return x, slope, low + area


@inner
def working_way(law, i, peak, at):
    """Strain that the working curve of cell i covers below a peak (N), at which its strain is `at`."""
    return peak / law[i, K1] if law[i, WORKING] == BY_STIFFNESS else (1.0 - law[i, K1]) * at


@inner
def rest_at(law, table, i, mean, peak):
    """Of cell i at rest under a mean tension, once at `peak`: strain, its derivative (1/N), energy per length (J/m)."""
    first, last = int(law[i, FIRST]), int(law[i, LAST])
    if not law[i, WORKING] > 0.0:
        return strain_at(table, first, last, mean)
    top = max(mean, peak)
    at, c, _ = strain_at(table, first, last, top)
    way = working_way(law, i, top, at)
    x, slope, area = working_shape(law[i, WORKING], law[i, K2], mean / top)
    if mean < peak:
        at, c = at - way * (1.0 - x), way * slope / top
    return at, c, top * way * area


@inner
def lost_below(law, table, i, peak):
    """Work per length, J/m, that a cell has not stored when its mean tension has risen to `peak` for the first time."""
    at, _, taken = strain_at(table, int(law[i, FIRST]), int(law[i, LAST]), peak)
    _, _, area = working_shape(law[i, WORKING], law[i, K2], 1.0)
    return taken - peak * working_way(law, i, peak, at) * area


@inner
def strain_of(e, h):
    """Strain of a chord (m) of unstretched length h (m)."""
    square = dot(e, e)
    return (square - h * h) / ((math.sqrt(square) + h) * h)


@inner
def fast_of_chord(line, state, i, peak):
    """Tension, N, above the mean one that the chord of a cell has."""
    at, _, _ = rest_at(line.law, line.law_table, i, state.slow[i], peak)
    E, _ = stiffness_at(line.law, i, state.slow[i])
    return E * (strain_of(get3(state.e, i), line.h[i]) - at)


@inner
def rest_and_kept(line, state, i, peak, fast):
    """Strain at rest under the mean tension of a cell, and what the fast spring keeps of `fast`.

    fast: N, tension above the mean; kept: what is not given up when the mean tension grows, over the growth.
    """
    at, _, _ = rest_at(line.law, line.law_table, i, state.slow[i], peak)
    E, b = stiffness_at(line.law, i, state.slow[i])
    part = fast / E
    return at, part * (1.0 + 0.5 * part * b)


@inner
def lost_in_step(line, old, new, i, peak, fast_before, fast_after):
    """Work per length, J/m, that a cell which remembers its peak has lost in a step: its mean tensions are known.

    fast_before, fast_after: N, elastic tensions above them.  By way, not by power: that jumps where the peak is passed.
    """
    law, table = line.law, line.law_table
    lost = lost_below(law, table, i, max(peak, new.slow[i])) - lost_below(law, table, i, peak)
    before, kept_before = rest_and_kept(line, old, i, peak, fast_before)
    after, kept_after = rest_and_kept(line, new, i, peak, fast_after)
    lost += 0.5 * (fast_before + fast_after) * (after - before)
    return lost - 0.5 * (kept_before + kept_after) * (new.slow[i] - old.slow[i])


@inner
def peak_before(law, i, state):
    """The highest mean tension, N, that a cell has had."""
    return max(law[i, HIGHEST], state.peak[i]) if law[i, WORKING] > 0.0 else 0.0


@inner
def mean_part(x):
    """How the mean tension after a step of x relaxation times answers to the tension there and before, and to itself."""
    kept = math.exp(-x)
    there = 0.5 * x - x * x / 6.0 + x * x * x / 24.0 if x < SHORT else 1.0 + math.expm1(-x) / x
    return there, 1.0 - there - kept, kept


@inner
def stiffness_at(law, i, mean):
    """Dynamic stiffness under a mean tension, and its derivative."""
    b = law[i, PER_TENSION] if mean > 0.0 else 0.0
    return law[i, DYNAMIC] + b * mean, b


@inner
def crept(law, i, t):
    """Strain that cell i has crept by at the time t (s)."""
    return law[i, CREEP] * math.log10(1.0 + max(t, 0.0) / law[i, LOADED]) if law[i, CREEP] > 0.0 else 0.0


@inner
def sliding_power(line, state, i, fast):
    """Power per length, W/m, that a cell with a dynamic stiffness loses.

    Its mean tension follows its tension; fast: N, its elastic tension above the mean one.
    """
    mean = state.slow[i]
    _, c, _ = rest_at(line.law, line.law_table, i, mean, 0.0)
    E, b = stiffness_at(line.law, i, mean)
    return (state.T[i] - mean) / line.law[i, RELAXATION] * fast * (c - 1.0 / E - 0.5 * fast * b / (E * E))


@inner
def linearise_law(line, old, new, work, dt, t):
    """Linearise the laws of all cells about new.T, after a step of dt (s) from `old`.

    dt = 0: at rest, new.slow becomes T; dt < 0: new.slow stays as it is.  t: s, the time of `new`.  Writes line.ck, what
    is written of line.law, new.slow, new.peak, energy and work.
    """
    law, table, energy, lost = line.law, line.law_table, 0.0, 0.0
    for i in range(line.h.shape[0]):
        first, last = int(law[i, FIRST]), int(law[i, LAST])
        e, h, T = get3(new.e, i), line.h[i], new.T[i]
        l = math.sqrt(dot(e, e))
        law[i, CREPT] = creep = crept(law, i, t)
        strain = (l * l - h * h) / ((l + h) * h) - creep
        if dt > 0.0 and creep > 0.0:
            lost += 0.5 * h * (old.T[i] + T) * (creep - crept(law, i, t - dt))
        faster = dot(e, sub(get3(new.v, i + 1), get3(new.v, i))) / l
        if last == first:
            c = line.ck[i]
            law[i, SHIFT], law[i, LOSS], elastic = 0.0, 0.0, T
            if c > 0.0:
                elastic = strain / c
                energy += 0.5 * h * c * elastic * elastic
                law[i, LOSS] = (T - elastic) * faster
            continue
        if not law[i, DYNAMIC] > 0.0:
            at, c, _ = strain_at(table, first, last, T)
            elastic = tension_at(table, first, last, strain)
            _, _, stored = strain_at(table, first, last, elastic)
            line.ck[i], law[i, SHIFT], new.slow[i] = c, at - c * T + creep, T
            law[i, LOSS] = (T - elastic) * faster
            energy += h * stored
            continue
        mean, answers, peak = new.slow[i], 0.0, law[i, HIGHEST]
        if dt > 0.0:
            peak = peak_before(law, i, old)
            answers, before, kept = mean_part(dt / law[i, RELAXATION])
            mean = answers * T + before * old.T[i] + kept * old.slow[i]
        if dt == 0.0:
            mean, answers = T, 1.0
        if dt < 0.0:
            peak = peak_before(law, i, new)
        new.slow[i] = mean
        at, c, stored = rest_at(law, table, i, mean, peak)
        E, b = stiffness_at(law, i, mean)
        eps = at + (T - mean) / E
        line.ck[i] = answers * c + (1.0 - answers - answers * b * (T - mean) / E) / E
        law[i, SHIFT] = eps - line.ck[i] * T + creep
        elastic = T if dt == 0.0 else mean + E * (strain - at)
        fast = elastic - mean
        energy += h * (stored + 0.5 * (elastic * elastic - mean * mean) / E)
        law[i, LOSS] = (T - elastic) * faster
        if law[i, WORKING] > 0.0:
            new.peak[i] = max(peak, mean)
            if dt > 0.0:
                before, after = fast_of_chord(line, old, i, peak), fast_of_chord(line, new, i, peak)
                lost += h * lost_in_step(line, old, new, i, peak, before, after)
            continue
        law[i, LOSS] += h * sliding_power(line, new, i, fast)
    work.report[STRETCH_ENERGY] = energy
    work.report[LOST_WORK] = -lost


@inner
def has_law(line, i):
    """Whether the tension of cell i is no multiple of its strain."""
    return line.law.shape[0] > 0 and line.law[i, LAST] > line.law[i, FIRST]


@inner
def is_dynamic(line, i):
    """Whether a cell with a law has a dynamic stiffness."""
    return line.law[i, DYNAMIC] > 0.0


@inner
def strain_and_energy_at(line, state, i, T):
    """Strain of cell i under a tension T, N, of which nothing is of damping, and its energy per length, J/m."""
    if not has_law(line, i):
        return line.ck[i] * T, 0.5 * line.ck[i] * T * T
    return strain_of_law(line, state, i, T)


@linked_kernel(on_line(blank_state(1), 0, 0.0), (0.0, 0.0))
def strain_of_law(line, state, i, T):
    """The same of a cell with a law."""
    law, first, last = line.law, int(line.law[i, FIRST]), int(line.law[i, LAST])
    if not law[i, DYNAMIC] > 0.0:
        strain, _, stored = strain_at(line.law_table, first, last, T)
        return strain + law[i, CREPT], stored
    mean = state.slow[i]
    strain, _, stored = rest_at(law, line.law_table, i, mean, peak_before(law, i, state))
    E, _ = stiffness_at(law, i, mean)
    return strain + (T - mean) / E + law[i, CREPT], stored + 0.5 * (T * T - mean * mean) / E


@inner
def softness_of_damping(line, state, i, late):
    """Compliance of cell i, 1/N, over the strain `late` by which damping makes its tension more than elastic."""
    T = state.T[i]
    if not has_law(line, i):
        return line.ck[i]
    if line.law[i, DYNAMIC] > 0.0:
        E, _ = stiffness_at(line.law, i, state.slow[i])
        return 1.0 / E
    first, last = int(line.law[i, FIRST]), int(line.law[i, LAST])
    strain, c, _ = strain_at(line.law_table, first, last, T)
    elastic = tension_at(line.law_table, first, last, strain - late)
    one = interval_within(line.law_table[:, TENSION], first, last - 1, T) == interval_within(
        line.law_table[:, TENSION], first, last - 1, elastic
    )
    return c if one or not abs(T - elastic) > NO_DAMPING * abs(T) else late / (T - elastic)


@inner
def stretch_work(line, state, c):
    """Energy per length, N, that a cell takes up when its unstretched length grows and its ends stay."""
    strain, energy = strain_and_energy_at(line, state, c, state.T[c])
    return state.T[c] * (1.0 + strain) - energy


@linked_kernel(on_line(blank_state(1)), 0.0)
def stretch_energy(line, state):
    """Energy, J, of the stretch of a line without damping, from its tensions.

    Where tension makes a torque, that of torsion is not in it (docs/theory.md, 15).
    """
    total = 0.0
    for i in range(line.h.shape[0]):
        strain, stored = strain_and_energy_at(line, state, i, state.T[i])
        total += line.h[i] * stored
        if line.tension_twist.shape[0] > 0:
            total += energy_by_twist(line, state, i, strain)
    return total


@inner
def energy_by_twist(line, state, i, strain):
    """What the torque of tension adds to the energy of stretch of cell i, J; strain: that of its law."""
    e, h, T = get3(state.e, i), line.h[i], state.T[i]
    return T * (math.sqrt(dot(e, e)) - h * (1.0 + strain)) - line.tension_twist[i] * line.tension_torque[i] * T * T
