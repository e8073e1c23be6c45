"""How much of its capacity a line uses, by sections and by codes.

Of tension and curvature at once:

    symbol   meaning                                                      unit
    T, k     tension, curvature, at one time and place                    N, 1/m
    c_i      corners (T_i, k_i) of the capacity polygon                   N, 1/m
    u        part that is used: how far (T, k) is on the way from no load -
             to the polygon

Between the directions of two corners u = (p x e)/(c_i x e), with p = (T, k), e = c_{i+1} - c_i and x the cross product
in the plane.  Tension below zero counts as none where the polygon has no compression.

By codes, of a mooring line DNV-OS-E301, of a riser DNV-OS-F201:

    symbol        meaning                                                                unit
    T, M          effective tension, size of the bending moment                          N, N m
    T_F, M_F      their functional part: that of the equilibrium without waves, current  N, N m
    g_F, g_E      factors of the functional part and of the rest                         -
    g             product of the factors of safety class and material                    -
    T_k, M_k      plastic tension and moment of the wall                                 N, N m
    dp, p_b, p_c  pressure inside less that outside; at bursting; at collapse            Pa

Design values: X = g_F X_F + g_E (X - X_F), and no less than g_F X, which is more where X is below its functional part.
E301: u = T/strength.
F201, inside pressure larger: u = g ((M/M_k) sqrt(1 - (dp/p_b)^2) + (T/T_k)^2) + (dp/p_b)^2, else
u = g^2 ((M/M_k + (T/T_k)^2)^2 + (dp/p_c)^2); the root is 0 where dp alone bursts the wall.  Broken: u > 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.envelope import GROUP, SCALE, has_envelope
from hybrid.store.stored_result import StoredResult

Floats = np.ndarray
# The field of a result, in percent; its sections with their corners, rows (K, 4) of s from, s to (m), T (N), k (1/m).
NAME, CORNERS = "capacity_used", "capacity"
# Part of the length of a line within which a place is at a border of sections.
NEAR = 1e-9


def used(corners: Floats, T: Floats, k: Floats) -> Floats:
    """Part of the capacity that tensions (N) and curvatures (1/m) use, of any shape; corners: (n, 2)."""
    corners = np.asarray(corners, float)
    if corners[-1, 0] == 0.0:
        T = np.maximum(T, 0.0)
    k = np.abs(k)
    found = np.zeros(np.broadcast_shapes(np.shape(T), np.shape(k)))
    for i, (a, b) in enumerate(pairwise(corners)):
        e = b - a
        here = (a[0] * k - a[1] * T >= 0.0) & (b[0] * k - b[1] * T <= 0.0)
        if i == 0:  # below the first direction there is nothing
            here |= (k == 0.0) & (T >= 0.0)
        if i == len(corners) - 2:
            here |= (k == 0.0) & (T < 0.0)
        part = (T * e[1] - k * e[0]) / (a[0] * e[1] - a[1] * e[0])
        found = np.where(here, part, found)
    return np.where(np.isfinite(T) & np.isfinite(k), found, np.nan)


def most_used(corners: Floats, low: Floats, high: Floats, k: Floats) -> Floats:
    """The largest part that any tension from low to high (N) with any curvature up to k (1/m) uses.

    It is at a corner of that rectangle, or where the way to a corner of the polygon leaves it: to the first, without
    bending.
    """
    corners = np.asarray(corners, float)
    found = np.maximum(used(corners, low, k), used(corners, high, k))
    for T_i, k_i in corners:
        if k_i > 0.0:
            found = np.maximum(found, used(corners, np.clip(k * T_i / k_i, low, high), k))
        for T in (low, high):
            if T_i != 0.0:
                found = np.maximum(found, used(corners, T, np.clip(T * k_i / T_i, 0.0, k)))
    return found


class Stretch(NamedTuple):
    """A section that has a capacity: from a to b (m), corners (n, 2) N, 1/m."""

    a: float
    b: float
    corners: Floats


def stretches_of(result: StoredResult) -> list[Stretch]:
    """The sections of a result that have a capacity."""
    if CORNERS not in result:
        return []
    rows = np.asarray(result[CORNERS])
    places = sorted({(a, b) for a, b in rows[:, :2].tolist()})
    return [Stretch(a, b, rows[(rows[:, 0] == a) & (rows[:, 1] == b), 2:]) for a, b in places]


def inside_of(a: float, b: float, s: Floats) -> np.ndarray:
    """Which places (n,) m lie in a section from a to b (m); of a place that comes twice the first is the left one's."""
    near = NEAR * max(float(s[-1] - s[0]), 1.0)
    twice = np.diff(s) == 0.0
    first, second = np.append(twice, False), np.insert(twice, 0, False)
    late, early = first & (np.abs(s - a) <= near), second & (np.abs(s - b) <= near)
    return (s >= a - near) & (s <= b + near) & ~late & ~early


def shows_ends(result: StoredResult) -> bool:
    """Whether output points reach from end to end of the line."""
    if not len(result.zones):
        return True
    zones = result.zones[-1]
    near = NEAR * max(zones[-1].s_b, 1.0)
    return bool(result.s[0] <= zones[0].s_a + near and result.s[-1] >= zones[-1].s_b - near)


def bound_of_steps(result: StoredResult, errors: tuple[float, float] = (0.0, 0.0)) -> float | None:
    """Upper bound of the utilisation of capacity over all steps and nodes.

    By the ranges of tension and curvature over all of them, as if their extremes coincided; None: the result has no
    envelope.  errors: of these ranges, N and 1/m.
    """
    names = [f"{GROUP}/{x}" for x in ("tension_min", "tension_max", "curvature_max")]
    if not has_envelope(result) or any(name not in result for name in names):
        return None
    low, high, k = (np.asarray(result[x]) + e for x, e in zip(names, (-errors[0], *errors), strict=True))
    s = np.asarray(result[SCALE])
    return _largest(result, lambda x, at: most_used(x.corners, low[at], high[at], k[at]), s)


def bound_with_errors(result: StoredResult) -> float | None:
    """The part that no output exceeds, whatever the errors of tension and curvature; None: they are not known."""
    names = ("tension", "curvature", "errors/total/tension", "errors/total/curvature")
    if any(name not in result for name in names):
        return None
    s = result.both_sides("tension")[0]
    T, k, dT, dk = (result.both_sides(name)[1] for name in names)
    return _largest(result, lambda x, at: most_used(x.corners, (T - dT)[:, at], (T + dT)[:, at], (k + dk)[:, at]), s)


def _largest(result: StoredResult, part: Callable[[Stretch, np.ndarray], Floats], s: Floats) -> float | None:
    parts = (part(x, inside_of(x.a, x.b, s)) for x in stretches_of(result))
    values = [v for v in parts if v.size and np.isfinite(v).any()]
    return max((float(np.nanmax(v)) for v in values), default=None)


# --- mooring lines -------------------------------------------------------------------------------


def mooring_use(
    result: StoredResult, strength: float, factors: tuple[float, ...], pretension: float | StoredResult
) -> tuple[Floats, Floats, Floats]:
    """Utilisation of a mooring line by DNV-OS-E301, u = (T_pre g_pre + (T - T_pre) g_env)/S.

    Returns arc lengths (n,) m, u at the outputs (nt, n), and u of the largest tension of all steps and outputs (n,).
    strength: S, N; factors: g_pre, g_env; pretension: T_pre, N, or the result of an equilibrium under it.  July 2021,
    Ch.2 Sec.2, as the manual of SIMA 4.8 gives it.  ResultError: a pretension of another line.
    """
    if not (0.0 < strength < np.inf and len(factors) == 2 and all(0.0 < x < np.inf for x in factors)):
        raise ResultError("mooring\n    expected: a strength (N) above 0, and two factors above 0")
    s, T = result.both_sides("tension")
    if isinstance(pretension, int | float):
        if not 0.0 <= pretension < np.inf:
            raise ResultError("mooring\n    expected: a pretension in N, 0 or more, or the equilibrium that has it")
        before = np.full(s.shape, float(pretension))
    else:
        near = 1e-6 * float(result.s[-1] - result.s[0])
        if pretension.lines or abs(float(pretension.s[-1] - result.s[-1])) > near:
            raise ResultError("mooring\n    expected: the pretension of the same line, or a number in N")
        if float(pretension.s[0]) > max(float(result.s[0]), pretension.zones[-1][0].s_a) + near:
            raise ResultError("mooring\n    expected: a pretension at all output points of the result")
        there, tension = pretension.both_sides("tension")
        before = tension[0] if np.array_equal(there, s) else _along(s, there, tension[0])
    most = T.max(axis=0)
    if has_envelope(result) and f"{GROUP}/tension_max" in result:
        most = np.maximum(most, _along(s, result[SCALE], result[f"{GROUP}/tension_max"]))
    first, second = factors
    at_outputs, largest = ((before * first + (x - before) * second) / strength for x in (T, most))
    return s, at_outputs, largest


def _along(s: Floats, there: Floats, x: Floats) -> Floats:
    """Values x at places `there` (n,) m, linear between them, at s (m,) m; of places that come twice on their side."""
    left, right = np.interp(-s, -there[::-1], x[::-1]), np.interp(s, there, x)
    return np.where(np.append(np.diff(s) == 0.0, False), left, right)


# How near a torque is to throwing a loop, and whether a loop pulled tight kinks before it pops out.
#
# A long rod of bending stiffness EI, N m2, under tension T, N, and torque M, N m, that leaves the straight line in one
# place has the shape (A. B. H. Coyne, IEEE J. Oceanic Eng. 15, 1990; lengths in sqrt(EI/T), m = M/(2 sqrt(EI T)),
# k = sqrt(1 - m^2))
#
#     z = s - 2 k tanh k s,   x + i y = 2 k sech k s exp(i m s).
#
# It is there for m < 1 alone: beyond, the straight rod buckles (Greenhill).  Pulled tighter the loop shrinks with
# sqrt(EI/T) until its two strands touch, and then lies on itself until it slips open: it pops out.  Friction,
# plasticity
# and the structure of the strands are not in it.

# Of the largest tension: a torque that asks for less of it is no torque that throws loops; a tension below is none.
PART_OF_TENSION, NO_TENSION = 1e-4, 1e-6


class PopOut(NamedTuple):
    """A loop of a cable of some diameter as it pops out: tension, N, and the bend radius at its crown, m."""

    tension: float
    radius: float


def formation_tension(torque: Floats, stiffness: Floats) -> Floats:
    """Tension, N, below which a loop can form: M^2/(4 EI); 0 without bending stiffness."""
    square = np.square(torque)
    return np.divide(square, 4.0 * stiffness, out=np.zeros_like(square), where=np.asarray(stiffness) > 0.0)


def formation_ratio(torque: Floats, tension: Floats, stiffness: Floats) -> Floats:
    """The tension below which a loop can form over the one there is, of torque (N m), tension (N) and EI (N m2).

    1 over the formation margin; 0 everywhere where no torque asks for a tension worth speaking of.
    """
    needed = formation_tension(torque, np.broadcast_to(stiffness, torque.shape))
    most = float(np.abs(tension).max())
    if not float(needed.max()) > PART_OF_TENSION * most or most == 0.0:  # without any tension: a start, no scale
        return np.zeros(needed.shape)
    none = NO_TENSION * most
    return np.where(needed > none, needed / np.maximum(tension, none), 0.0)


def strand_distance(m: float) -> float:
    """Least distance of the two strands of a loop, in sqrt(EI/T); NaN where the loop has no crossing of its own."""
    k = np.sqrt(1.0 - m * m)
    s = np.linspace(0.3, 4.0, 4001)
    d = np.hypot(2.0 * (s - 2.0 * k * np.tanh(k * s)), 4.0 * k / np.cosh(k * s) * np.sin(m * s))
    least = np.flatnonzero((d[1:-1] < d[:-2]) & (d[1:-1] <= d[2:])) + 1
    if not least.size:
        return float("nan")
    i = int(least[0])
    bend = d[i - 1] - 2.0 * d[i] + d[i + 1]  # to the foot of the parabola through three points
    return float(d[i] - (d[i + 1] - d[i - 1]) ** 2 / (8.0 * bend))


@cache
def _loops() -> tuple[Floats, Floats]:
    """m of loops that touch themselves, rising, and M D/EI = 2 m delta(m) of each."""
    m = np.linspace(0.0, 0.6, 601)[1:]
    q = 2.0 * m * np.array([strand_distance(float(x)) for x in m])
    there = np.isfinite(q)
    return m[there], q[there]


def pop_out(torque: float, stiffness: float, diameter: float) -> PopOut | None:
    """The loop of a cable of a diameter, m, under a torque, N m, as it pops out; None: none is trapped by its strands.

    Without torque there is no loop; of a torque above about 1.65 EI/D strands do not hold each other.
    """
    m, q = _loops()
    asked = abs(torque) * diameter / stiffness if stiffness > 0.0 else np.inf
    if not q[0] <= asked <= q[-1]:
        if not 0.0 < asked < q[0]:
            return None
        at = float(m[0] * np.sqrt(asked / q[0]))  # delta is m times a constant there
    else:
        at = float(np.interp(np.sqrt(asked), np.sqrt(q), m))
    tension = torque * torque / (4.0 * stiffness * at * at)
    radius = 0.5 * np.sqrt(stiffness / (tension * (1.0 - at * at)))
    return PopOut(float(tension), float(radius))


def kink_torque(stiffness: float, diameter: float, radius: float) -> float:
    """Torque, N m, from which on a loop is bent below the allowed radius, m, before it pops out; inf: none is."""
    m, q = _loops()
    delta = 0.5 * q / m
    crown = diameter / (2.0 * delta * np.sqrt(1.0 - m * m))  # m, falls as m grows, but for the last loops
    low = np.flatnonzero(crown < radius)
    if not low.size:
        return float("inf")
    i = int(low[0])
    if i == 0:
        return float(q[0] * (crown[0] / radius) ** 2 * stiffness / diameter)
    part = (crown[i - 1] - radius) / (crown[i - 1] - crown[i])
    return float((q[i - 1] + part * (q[i] - q[i - 1])) * stiffness / diameter)


# The field of a result, in percent; its sections with the numbers of their codes, rows of `Row`.
CODE_NAME, ROWS = "code_used", "code"
NOT_PRINTED = "as public sources give it, not compared with the printed standard"
CLAUSES = {
    "E301": f"DNV-OS-E301 (July 2021), Ch.2 Sec.2, {NOT_PRINTED}",
    "F201": f"DNV-OS-F201 (October 2010), Sec.5 D, combined loading, {NOT_PRINTED}",
}
E301, F201 = 0.0, 1.0  # kinds in a row
# Of DNV-OS-F201, Sec.5 D: alpha_c = 1 - beta + beta f_u/f_y.
MOST_HARDENING = 1.2  # largest alpha_c
THICK = 15.0  # D/t up to which beta is BETA + q_h,
THIN = 60.0  # and from which it is 0; linear between
BETA = 0.4  # beta of thick pipes without pressure
POISSON = 0.3  # Poisson's ratio, of steel, in the elastic collapse pressure


class Row(NamedTuple):
    """The code of a section from `first` to `last` (m), as a row of the file; pressures at heights as of a pipe.

    strength: N, of E301; of F201 0.  outer, wall: m.  safety: g.  ovality: of the wall; fabrication: alpha_fab.
    stiffness: N m2, of bending; natural: 1/m, curvature without load; sleeved: 1 where a sleeve bears a part of the
    moment; files of 1.0.0 have none of these.
    """

    first: float
    last: float
    kind: float
    functional: float
    environment: float
    tension: float
    moment: float
    strength: float
    safety: float
    outer: float
    wall: float
    modulus: float
    yields: float
    breaks: float
    ovality: float
    fabrication: float
    inside: float
    inside_z: float
    content: float
    water: float
    surface: float
    stiffness: float = 0.0
    natural: float = 0.0
    sleeved: float = 0.0


def use(row: Row, T: Floats, M: Floats, z: Floats) -> Floats:
    """Part that is used under tensions (N), moments (N m) at heights z (m), of any shape."""
    T = _design(row, T, row.tension)
    if row.kind == E301:
        return np.asarray(T / row.strength)
    M = _design(row, np.abs(M), row.moment)
    outside = row.water * np.maximum(row.surface - z, 0.0)
    inside = np.maximum(row.inside + row.content * (row.inside_z - z), 0.0)
    return of_riser(row, T, M, inside - outside)


def _design(row: Row, x: Floats, functional: float) -> Floats:
    """Design value of a tension or moment."""
    both = row.functional * functional + row.environment * (x - functional)
    return np.where(x < 0.0, both, np.maximum(both, row.functional * x))


def moment_of(row: Row, curvature: Floats) -> Floats:
    """Bending moment, N m, of a catenary, which has the curvature (1/m) of a line that is not stiff.

    It does not know which way its sections are curved without load.
    """
    return np.asarray(row.stiffness * (curvature + row.natural))


def of_riser(row: Row, T: Floats, M: Floats, dp: Floats) -> Floats:
    """F201 under design tension (N) and moment (N m), and pressure inside less that outside (Pa); 1: all of it."""
    D, t, fy, fu = row.outer, row.wall, row.yields, row.breaks
    burst = 2.0 / np.sqrt(3.0) * 2.0 * t / (D - t) * min(fy, fu / 1.15)
    q = np.where(dp > 0.0, 2.0 / np.sqrt(3.0) * dp / burst, 0.0)
    beta = np.clip((BETA + q) * np.clip((THIN - D / t) / (THIN - THICK), 0.0, 1.0), 0.0, None)
    hardening = np.minimum(1.0 - beta + beta * fu / fy, MOST_HARDENING)
    M_k, T_k = fy * hardening * (D - t) ** 2 * t, fy * hardening * np.pi * (D - t) * t
    bent, pulled = M / M_k, (T / T_k) ** 2
    within = row.safety * (bent * np.sqrt(np.maximum(1.0 - (dp / burst) ** 2, 0.0)) + pulled) + (dp / burst) ** 2
    pressed = row.safety**2 * ((bent + pulled) ** 2 + (dp / collapse(row)) ** 2)
    return np.asarray(np.where(dp >= 0.0, within, pressed))


def collapse(row: Row) -> float:
    """Pressure, Pa: (p_c - p_el)(p_c^2 - p_p^2) = p_c p_el p_p f_0 D/t, p_c below p_el and p_p."""
    D, t = row.outer, row.wall
    elastic = 2.0 * row.modulus * (t / D) ** 3 / (1.0 - POISSON**2)
    plastic = 2.0 * t / D * row.yields * row.fabrication
    roots = np.roots([1.0, -elastic, -(plastic**2) - elastic * plastic * row.ovality * D / t, elastic * plastic**2])
    real = roots[np.abs(roots.imag) < 1e-9 * np.abs(roots).max()].real
    return float(real[real > 0.0].min())


def rows_of(result: StoredResult) -> list[Row]:
    """Sections of a result that have a code."""
    return [Row(*x) for x in np.asarray(result[ROWS])] if ROWS in result else []


def clauses_of(result: StoredResult) -> str:
    """The codes of a result, with clause and edition."""
    kinds = {row.kind for row in rows_of(result)}
    return "; ".join(text for kind, text in zip((E301, F201), CLAUSES.values(), strict=True) if kind in kinds)


def mooring_of_steps(result: StoredResult) -> tuple[float, float, float] | None:
    """The largest part that E301 lets a line use at any step and node, its time (s) and arc length (m).

    It goes by tension alone, of which each node has its largest.  None: there is no such section, or no step is known.
    """
    names = [f"{GROUP}/{x}" for x in ("tension_max", "tension_t_max")]
    if not has_envelope(result) or any(name not in result for name in names):
        return None
    s, (T, t), most = np.asarray(result[SCALE]), (np.asarray(result[name]) for name in names), None
    for row in rows_of(result):
        at = np.flatnonzero(inside_of(row.first, row.last, s) & np.isfinite(T))
        if row.kind == E301 and at.size:
            used = use(row, T[at], np.zeros(at.size), np.zeros(at.size))
            k = int(used.argmax())
            if most is None or used[k] > most[0]:
                most = float(used[k]), float(t[at[k]]), float(s[at[k]])
    return most


def code_of_steps(result: StoredResult, errors: Mapping[str, float] | None = None) -> float | None:
    """Upper bound of the code check over all steps and nodes, at the heights of the outputs.

    By the ranges of tension and moment over all of them, as if their extremes coincided; None: the result has not all
    of them.  errors: of these ranges, by quantity, N, N m and 1/m; one that is missing is not known.
    """
    names = [f"{GROUP}/{x}" for x in ("tension_min", "tension_max")]

    def error(quantity: str) -> float:
        return 0.0 if errors is None else errors.get(quantity, np.nan)

    moment = _moments(
        result, f"{GROUP}/%s_max", lambda x: result[x] + error(x.removeprefix(f"{GROUP}/").removesuffix("_max"))
    )
    if moment is None or not has_envelope(result) or any(name not in result for name in names):
        return None
    if not shows_ends(result):  # beyond them heights are not known
        return None
    s, low, high = np.asarray(result[SCALE]), result[names[0]] - error("tension"), result[names[1]] + error("tension")
    z = result.position[:, :, 2]
    each = [(T, np.interp(s, result.s, h)) for T in (low, high) for h in (z.min(axis=0), z.max(axis=0))]
    return _largest_by_code(
        result, s, lambda x, at: np.max([use(x, T[at], moment(x)[at], h[at]) for T, h in each], axis=0)
    )


def code_with_errors(result: StoredResult) -> float | None:
    """The part that no output exceeds, whatever the errors of tension and moment; None: they are not known."""
    group = "errors/total/"
    moment = _moments(
        result, f"{group}%s", lambda x: result.both_sides(x.removeprefix(group))[1] + result.both_sides(x)[1]
    )
    if moment is None or "tension" not in result or f"{group}tension" not in result:
        return None
    s, T = result.both_sides("tension")
    dT = result.both_sides(f"{group}tension")[1]
    z = np.array([np.interp(s, result.s, x) for x in result.position[:, :, 2]])
    return _largest_by_code(
        result,
        s,
        lambda x, at: np.max([use(x, t[:, at], moment(x)[:, at], z[:, at]) for t in (T - dT, T + dT)], axis=0),
    )


def _moments(result: StoredResult, name: str, read: Callable[[str], Floats]) -> Callable[[Row], Floats] | None:
    """What has the moments (N m) of a row, from `name` of moment and curvature; None: the result has not all of them.

    A line that is a catenary somewhere, at some time, may have those of its curvature, and in a sleeve no line has
    more; a mooring line needs none.
    """
    if not any(row.kind == F201 for row in rows_of(result)):
        return lambda row: np.zeros_like(read(name % "tension"))
    kinds = set(result["zones"]["kind"].tolist())
    needs = {"bending_moment": "rod" in kinds, "curvature": kinds != {"rod"}}
    if any(needed and name % x not in result for x, needed in needs.items()):
        return None
    rods = read(name % "bending_moment") if needs["bending_moment"] else np.zeros(1)
    curvature = read(name % "curvature") if name % "curvature" in result else None

    def moment(row: Row) -> Floats:
        if curvature is None:
            return rods
        own = moment_of(row, curvature)
        M = np.fmin(rods, own) if row.sleeved else rods
        return np.maximum(M, own) if needs["curvature"] else M

    return moment


def _largest_by_code(result: StoredResult, s: Floats, part: Callable[[Row, np.ndarray], Floats]) -> float | None:
    values = [v for x in rows_of(result) if (v := part(x, inside_of(x.first, x.last, s))).size]
    return None if not values or any(np.isnan(v).any() for v in values) else max(float(v.max()) for v in values)
