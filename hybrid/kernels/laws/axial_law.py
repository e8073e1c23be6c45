"""Cells whose tension is no multiple of their strain: a table, and the static and dynamic stiffness of fibre ropes.

    symbol   meaning                                                                              unit
    T        tension; where the cell is damped, Te its elastic part                               N
    theta    mean tension, state.slow: T without what is faster than tau                          N
    tau      relaxation time: theta' = (T - theta)/tau                                            s
    s(T)     strain at rest, linear between the points of a table and beyond them                 -
    E        dynamic stiffness a + b theta; a = 0: none, and the strain is s(T)                   N
    eps      strain of the cell, s(theta) + (T - theta)/E                                         -
    U        energy per length, W(theta) + (Te^2 - theta^2)/(2 E) with W the integral of T ds     J/m

In a step theta is that of a tension which changes evenly (exact, whatever the step); at rest it is T.  The law of length
is linearised about the tension that an iteration has found: eps = SHIFT + ck T, both written here before every march.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import dot, get3, sub
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.report import STRETCH_ENERGY

# Columns of Line.law: of a cell, its first row in Line.law_table and the row behind its last (equal: tension is a multiple
# of strain there); a, b and tau; then what is written: strain without tension of the linearised law; power lost, W.
FIRST, LAST, DYNAMIC, PER_TENSION, RELAXATION, SHIFT, LOSS = range(7)
# Columns of Line.law_table: strain; tension, N; energy per length from the first point on, J/m.
STRAIN, TENSION, ENERGY = range(3)
# Below this part of the relaxation time a step takes the series of what would cancel.
SHORT = 1e-3


@inner
def piece_of(table, first, last, column, x):
    """The row of a table at which the piece begins that x lies in, or next to."""
    low, high = first, last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle, column] <= x:
            low = middle
        else:
            high = middle
    return low


@inner
def strain_at(table, first, last, T):
    """Strain at rest under T, its derivative (1/N), and the energy per length."""
    j = piece_of(table, first, last, TENSION, T)
    c = (table[j + 1, STRAIN] - table[j, STRAIN]) / (table[j + 1, TENSION] - table[j, TENSION])
    more = T - table[j, TENSION]
    return table[j, STRAIN] + c * more, c, table[j, ENERGY] + 0.5 * c * more * (T + table[j, TENSION])


@inner
def tension_at(table, first, last, strain):
    """Tension at rest at a strain."""
    j = piece_of(table, first, last, STRAIN, strain)
    c = (table[j + 1, TENSION] - table[j, TENSION]) / (table[j + 1, STRAIN] - table[j, STRAIN])
    return table[j, TENSION] + c * (strain - table[j, STRAIN])


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


@kernel
def follow_law(line, old, new, work, dt, _):
    """Linearise the laws of all cells about new.T, after a step of dt (s) from `old`; dt = 0: at rest, new.slow becomes T;

    dt < 0: new.slow stays as it is.  Writes line.ck, SHIFT and LOSS of line.law, new.slow, and the energy.
    """
    law, table, energy = line.law, line.law_table, 0.0
    for i in range(line.h.shape[0]):
        first, last = int(law[i, FIRST]), int(law[i, LAST])
        e, h, T = get3(new.e, i), line.h[i], new.T[i]
        l = math.sqrt(dot(e, e))
        strain = (l * l - h * h) / ((l + h) * h)
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
            line.ck[i], law[i, SHIFT], new.slow[i] = c, at - c * T, T
            law[i, LOSS] = (T - elastic) * faster
            energy += h * stored
            continue
        mean, answers = new.slow[i], 0.0
        if dt > 0.0:
            answers, before, kept = mean_part(dt / law[i, RELAXATION])
            mean = answers * T + before * old.T[i] + kept * old.slow[i]
        if dt == 0.0:
            mean, answers = T, 1.0
        new.slow[i] = mean
        at, c, stored = strain_at(table, first, last, mean)
        E, b = stiffness_at(law, i, mean)
        eps = at + (T - mean) / E
        line.ck[i] = answers * c + (1.0 - answers - answers * b * (T - mean) / E) / E
        law[i, SHIFT] = eps - line.ck[i] * T
        elastic = T if dt == 0.0 else mean + E * (strain - at)
        fast = elastic - mean
        energy += h * (stored + 0.5 * (elastic * elastic - mean * mean) / E)
        slides = (T - mean) / law[i, RELAXATION] * fast * (c - 1.0 / E - 0.5 * fast * b / (E * E))
        law[i, LOSS] = (T - elastic) * faster + h * slides
    work.report[STRETCH_ENERGY] = energy
    return 0


@inner
def has_law(line, i):
    """Whether the tension of cell i is no multiple of its strain."""
    return line.law.shape[0] > 0 and line.law[i, LAST] > line.law[i, FIRST]


@inner
def strain_and_energy(line, state, i):
    """Strain of cell i under its tension, of which nothing is of damping, and its energy per length, J/m."""
    T = state.T[i]
    if not has_law(line, i):
        return line.ck[i] * T, 0.5 * line.ck[i] * T * T
    law, first, last = line.law, int(line.law[i, FIRST]), int(line.law[i, LAST])
    if not law[i, DYNAMIC] > 0.0:
        strain, _, stored = strain_at(line.law_table, first, last, T)
        return strain, stored
    mean = state.slow[i]
    strain, _, stored = strain_at(line.law_table, first, last, mean)
    E, _ = stiffness_at(law, i, mean)
    return strain + (T - mean) / E, stored + 0.5 * (T * T - mean * mean) / E


@inner
def stretch_work(line, state, c):
    """Energy per length, N, that a cell takes up when its unstretched length grows and its ends stay."""
    strain, energy = strain_and_energy(line, state, c)
    return state.T[c] * (1.0 + strain) - energy


@kernel
def stretch_energy(line, state):
    """Energy, J, of the stretch of a line without damping, from its tensions."""
    total = 0.0
    for i in range(line.h.shape[0]):
        total += line.h[i] * strain_and_energy(line, state, i)[1]
    return total
