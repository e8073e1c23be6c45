"""Use of sections by the formulas of codes: a mooring line by DNV-OS-E301, a riser by DNV-OS-F201.

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
from typing import NamedTuple

import numpy as np

from hybrid.store.envelope import GROUP, SCALE, has_envelope
from hybrid.store.stored_result import StoredResult

Floats = np.ndarray
# The field of a result, in percent; its sections with the numbers of their codes, rows of `Row`.
NAME, ROWS = "code_used", "code"
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
BETA = 0.4
POISSON = 0.3


class Row(NamedTuple):
    """The code of a section from `first` to `last` (m), as a row of the file; pressures at heights as of a pipe.

    strength: N, of E301; of F201 0.  outer, wall: m.  safety: g.  ovality: of the wall; fabrication: alpha_fab.
    stiffness: N m2, of bending; natural: 1/m, curvature without load; files of 1.0.0 have neither.
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


def inside_of(row: Row, s: Floats) -> np.ndarray:
    """Which places (n,) m lie in a section; of a place that comes twice the first belongs to the left one."""
    near = 1e-9 * max(float(s[-1] - s[0]), 1.0)
    twice = np.diff(s) == 0.0
    first, second = np.append(twice, False), np.insert(twice, 0, False)
    late, early = first & (np.abs(s - row.first) <= near), second & (np.abs(s - row.last) <= near)
    return (s >= row.first - near) & (s <= row.last + near) & ~late & ~early


def mooring_of_steps(result: StoredResult) -> tuple[float, float, float] | None:
    """The largest part that E301 lets a line use at any step and node, its time (s) and arc length (m).

    It goes by tension alone, of which each node has its largest.  None: there is no such section, or no step is known.
    """
    names = [f"{GROUP}/{x}" for x in ("tension_max", "tension_t_max")]
    if not has_envelope(result) or any(name not in result for name in names):
        return None
    s, (T, t), most = np.asarray(result[SCALE]), (np.asarray(result[name]) for name in names), None
    for row in rows_of(result):
        at = np.flatnonzero(inside_of(row, s) & np.isfinite(T))
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
    s, low, high = np.asarray(result[SCALE]), result[names[0]] - error("tension"), result[names[1]] + error("tension")
    z = result.position[:, :, 2]
    each = [(T, np.interp(s, result.s, h)) for T in (low, high) for h in (z.min(axis=0), z.max(axis=0))]
    return _largest(result, s, lambda x, at: np.max([use(x, T[at], moment(x)[at], h[at]) for T, h in each], axis=0))


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
    return _largest(
        result,
        s,
        lambda x, at: np.max([use(x, t[:, at], moment(x)[:, at], z[:, at]) for t in (T - dT, T + dT)], axis=0),
    )


def _moments(result: StoredResult, name: str, read: Callable[[str], Floats]) -> Callable[[Row], Floats] | None:
    """What has the moments (N m) of a row, from `name` of moment and curvature; None: the result has not all of them.

    A line that is a catenary somewhere, at some time, may have those of its curvature; a mooring line needs none.
    """
    if not any(row.kind == F201 for row in rows_of(result)):
        return lambda row: np.zeros_like(read(name % "tension"))
    kinds = set(result["zones"]["kind"].tolist())
    needs = {"bending_moment": "rod" in kinds, "curvature": kinds != {"rod"}}
    if any(needed and name % x not in result for x, needed in needs.items()):
        return None
    known = {x: read(name % x) for x, needed in needs.items() if needed}
    rods, curvature = known.get("bending_moment", np.zeros(1)), known.get("curvature")
    return lambda row: rods if curvature is None else np.maximum(rods, moment_of(row, curvature))


def _largest(result: StoredResult, s: Floats, part: Callable[[Row, np.ndarray], Floats]) -> float | None:
    values = [v for x in rows_of(result) if (v := part(x, inside_of(x, s))).size]
    return None if not values or any(np.isnan(v).any() for v in values) else max(float(v.max()) for v in values)
