"""When a stretch must be a rod: the criteria, their thresholds, and the kernel that weighs them at every step.

Every criterion is a ratio, what is there over what a catenary can stand: at 1 a stretch becomes a
rod, and below the criterion's `off` it may become a catenary again.  Errors of position that leaving
bending out would make are lengths, and count against the tolerance (m) of the scene (docs/theory.md, 6).

    symbol   meaning                                          shape  unit
    EI       bending stiffness at a node                      -      N m2
    lam      sqrt(EI/T), over which bending fades             -      m
    kappa    curvature at a node                              -      1/m
    T, Ta    tension now and ahead                            -      N
    phi      angle between a clamp and the cable              -      rad
"""

from __future__ import annotations

import math

from hybrid.adapt.table import BEND, CLAMP, EDGE, POINT, SLACK, TORSION
from hybrid.compiled import inner, kernel
from hybrid.physics.cell import chord
from hybrid.physics.element import relative_rotation
from hybrid.physics.loads import SEABED
from hybrid.physics.rotations import dot, frame, log_rotation

# Angle of 1 rad per lambda is the sharpest that sqrt(EI/T) can speak of; slack stretches are judged by their floor.
MOST = 1e6
# Torque^2/(4 EI T) from which a straight cable is near to a loop: the Maxwell torque is 0.4 of the buckling one.
TWISTED = 0.5


@inner
def get3(A, i):
    return (A[i, 0], A[i, 1], A[i, 2])


@kernel
def weigh(line, sea, r, e, T, a1, before, a, EI, w, kink, floor, tolerance, clamps, base_of_cell, ratios):
    """Raise ratios (criteria, base cells) to those of a state: the largest of every criterion in each base cell.

    Returns the largest ratio among base cells that are catenary.

    before, a: tensions a step ago (N,), and horizon over step, for the tension ahead; EI, w, kink, floor: (N+1,)
    bending stiffness, weight per length, 1 where a point load or a jump of section sits, tension floor;
    clamps: (2, 3) tangents of clamped ends, zero where there is none.
    """
    n = e.shape[0]
    d0, _, _ = chord((e[0, 0], e[0, 1], e[0, 2]))
    for i in range(n + 1):
        ja = base_of_cell[i - 1] if i > 0 else base_of_cell[0]
        jb = base_of_cell[i] if i < n else base_of_cell[n - 1]
        tension = T[i] if i < n else T[n - 1]
        old = before[i] if i < n else before[n - 1]
        if i > 0:
            if T[i - 1] < tension:
                tension = T[i - 1]
            old = min(old, before[i - 1])
        ahead = min(tension, tension + a * (tension - old))
        ratio = min(floor[i] / ahead, MOST) if ahead > 0.0 else MOST
        ratios[SLACK, ja] = max(ratios[SLACK, ja], ratio)
        ratios[SLACK, jb] = max(ratios[SLACK, jb], ratio)
        T1 = max(tension, floor[i], 1e-300)
        turn, which = 0.0, BEND
        if 0 < i < n:
            d, _, _ = chord((e[i, 0], e[i, 1], e[i, 2]))
            c = max(-1.0, min(1.0, dot(d0, d)))
            turn = 2.0 * math.sqrt(max(0.0, 0.5 * (1.0 - c)))
            d0 = d
            if kink[i] or line.spin[i] != line.spin[i - 1]:  # a joint has a kink too
                which = POINT
        else:
            which = CLAMP
            t = (clamps[0 if i == 0 else 1, 0], clamps[0 if i == 0 else 1, 1], clamps[0 if i == 0 else 1, 2])
            if dot(t, t) > 0.0:
                c = max(-1.0, min(1.0, dot(d0, t)))
                turn = 2.0 * math.sqrt(max(0.0, 0.5 * (1.0 - c)))
        if which == BEND:
            ratio = EI[i] * turn / (line.hn[i] * T1 * tolerance)
        else:
            ratio = math.sqrt(EI[i] / T1) * turn / tolerance
        ratios[which, ja] = max(ratios[which, ja], ratio)
        ratios[which, jb] = max(ratios[which, jb], ratio)
        if line.bits & SEABED and 0 < i < n:
            p = (
                sea.offset
                + 0.5 * sea.onset
                - (sea.normal[0] * r[i, 0] + sea.normal[1] * r[i, 1] + sea.normal[2] * r[i, 2])
            )
            k = i + 1 if p > 0.0 else i - 1
            q = (
                sea.offset
                + 0.5 * sea.onset
                - (sea.normal[0] * r[k, 0] + sea.normal[1] * r[k, 1] + sea.normal[2] * r[k, 2])
            )
            if (p > 0.0) != (q > 0.0):
                ratio = EI[i] * w[i] / (T1 * T1 * tolerance)
                ratios[EDGE, ja] = max(ratios[EDGE, ja], ratio)
                ratios[EDGE, jb] = max(ratios[EDGE, jb], ratio)
        if line.element[i] and 0 < i < n:
            Ra, Rb = frame(get3(a1, i - 1), chord(get3(e, i - 1))[0]), frame(get3(a1, i), d0)
            torque = line.kb[i, 2] * (log_rotation(relative_rotation(Ra, Rb))[2] - line.k0[i, 2])
            ratio = torque * torque / (4.0 * EI[i] * T1 * TWISTED)
            ratios[TORSION, ja] = max(ratios[TORSION, ja], ratio)
            ratios[TORSION, jb] = max(ratios[TORSION, jb], ratio)
    loudest = 0.0
    for i in range(n):
        if not line.spin[i]:
            j = base_of_cell[i]
            for c in range(6):
                loudest = max(loudest, ratios[c, j])
    return loudest
