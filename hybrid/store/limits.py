"""Utilisation of the limits of quantities that a scene asks for.

Over the outputs, and over every accepted step where the file has its ranges.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from hybrid.store.capacity import CODE_NAME as CODE_USED
from hybrid.store.capacity import F201, NAME, bound_of_steps, code_of_steps, mooring_of_steps, rows_of, shows_ends
from hybrid.store.envelope import GROUP as GROUP_OF_NODES
from hybrid.store.envelope import (
    NOT_VERIFIED,
    SAME,
    SCALE,
    Arrays,
    extremes_of_outputs,
    has_envelope,
    not_verified,
    part_used,
)
from hybrid.store.stored_result import StoredResult

GROUP = "limits"
# Group of the smallest and the largest value of a quantity at any accepted step; t/ in it has times, s/ arc lengths.
EXTREMES = "extremes"


# Limits of sections, with what is held against them of the envelope; and quantities whose extremes are compared.
OF_SECTIONS = {
    "min_bend_radius": ("curvature_max",),
    "max_tension": ("tension_max",),
    "min_tension": ("tension_min",),
    "max_stress": ("von_mises_max",),
    "max_contact_force": ("contact_max", "self_contact_max", "obstacle_contact_max"),
}
RANGES = {
    "tension": ("tension_min", "tension_max"),
    "curvature": ("curvature_max",),
    "bending_moment": ("bending_moment_max",),
}


def extremes_about(values: Mapping[str, np.ndarray], s: np.ndarray) -> dict[str, np.ndarray]:
    """What limits are held against, of all steps, in arrays that do not depend on the mesh.

    values: the envelope of a run and its named quantities, by their names in a file.  Of limits of sections the part
    that is used about places s (ns,) m, each from the one before to the one behind; of a smallest tension by how much
    it is below its limit, N.  Of `RANGES` the extremes about these places; of named quantities both extremes.
    """
    found, nodes = dict[str, np.ndarray](), values.get(SCALE)
    if nodes is None:
        return found
    for limit, names in OF_SECTIONS.items():
        allowed = values.get(f"{GROUP_OF_NODES}/{limit}")
        known = [values[full] for x in names if (full := f"{GROUP_OF_NODES}/{x}") in values]
        if known and allowed is not None and np.isfinite(allowed).any():
            found[limit] = _about(nodes, np.fmax.reduce([part_used(limit, x, allowed) for x in known]), s)
    for quantity, names in RANGES.items():
        full_names = [f"{GROUP_OF_NODES}/{x}" for x in names]
        if all(x in values for x in full_names):
            found[quantity] = np.concatenate(
                [_about(nodes, -values[x] if x.endswith("_min") else values[x], s) for x in full_names]
            )
    for full, x in values.items():
        if full.startswith(f"{EXTREMES}/") and full.count("/") == 1 and np.isfinite(x).all():
            found[full] = np.array(x)
    return found


def _about(nodes: np.ndarray, x: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The largest of values x (n,) at nodes (m, increasing), straight between them, about places s (ns,) m."""
    known = np.isfinite(x)
    if not known.any():
        return np.zeros(s.size)
    at = np.concatenate([nodes[known], s])
    order = np.argsort(at, kind="stable")
    values = np.concatenate([x[known], np.interp(s, nodes[known], x[known])])[order]
    first, last = (np.searchsorted(at[order], s, side) for side in ("left", "right"))
    before, behind = np.append(0, first[:-1]), np.append(last[1:], values.size)  # about the last ones all that is there
    return np.array([values[a:b].max() for a, b in zip(before, behind, strict=True)])


# Attribute of a result: errors of its extremes over all steps, by name: of a limit of sections, as `part_used`; of
# `RANGES`, in their units; of a named quantity with its limit, "NAME smallest" or "NAME largest", in its unit.
EXTREME_ERRORS = "accuracy_extremes"


def extreme_errors(result: StoredResult) -> dict[str, float]:
    """Those errors, of several lines those of all; empty: nobody estimated them."""
    runs = (result, *result.lines.values())
    return {name: x for run in runs for name, x in json.loads(str(run.attributes.get(EXTREME_ERRORS, "{}"))).items()}


SHOWS = 0.1  # part by which the value of an equilibrium differs at most where output points show it


class Held(NamedTuple):
    """A quantity against a limit of its own: its worst value, in `unit`, when (t, s) and where (s, m; None: no place).

    limit: key in the scene: smallest, largest, or max_stress.  by_outputs: whether steps between outputs are not known.
    bound: what is known not to be exceeded between outputs either; None: nothing, or value is over every step.
    value and t are NaN of a quantity that never had a value, as the touchdown of a line that touches nothing.
    verdict, why, remedy: as of `envelope.Judged`.
    """

    name: str
    limit: str
    unit: str
    value: float
    allowed: float
    broken: bool
    t: float
    s: float | None = None
    by_outputs: bool = True
    verdict: str = ""
    why: str = ""
    remedy: str = ""
    bound: float | None = None

    @property
    def text(self) -> str:
        """What was reached, and what is allowed."""
        allowed = f"the {self.allowed:.4g} {self.unit} allowed"
        bound = "least" if self.limit == "smallest" else "most"
        if np.isnan(self.value):
            return f"{self.name} had no value at any time: not judged by {allowed} at {bound}"
        at = " at the outputs" * self.by_outputs
        if self.verdict == NOT_VERIFIED:
            return f"{self.name} of {self.value:.4g} {self.unit}{at}, {allowed[4:]} at {bound}"
        below = ("not below", "below") if self.limit == "smallest" else ("within", "above")
        return f"{self.name} of {self.value:.4g} {self.unit}{at}, {below[self.broken]} {allowed}"

    @property
    def ending(self) -> str:
        """What stands behind text, place and time: that the limit is broken or not verified."""
        if self.verdict == NOT_VERIFIED:
            return f"; {not_verified(self.why, self.remedy)}"
        return "; BROKEN" * self.broken

    @property
    def when(self) -> str:
        """Where and when, behind the text; "" of what had no value."""
        if np.isnan(self.value):
            return ""
        return f", t = {self.t:.5g} s" + (f", s = {self.s:.5g} m" if self.s is not None else "")


def at_every_step(result: StoredResult, name: str, bound: str) -> tuple[float, float, float | None] | None:
    """The "smallest" or "largest" value of a quantity at any accepted step, its time (s), and arc length (m) if any.

    None: the file does not have it.
    """
    if name == CODE_USED and bound == "largest" and not needs_moments(result):
        found = mooring_of_steps(result)
        return None if found is None else (100.0 * found[0], *found[1:])
    full, k = f"{EXTREMES}/{name}", ("smallest", "largest").index(bound)
    if full not in result or not np.isfinite(result[full][k]):
        return None
    place = f"{EXTREMES}/s/{name}"
    s = float(result[place][k]) if place in result else None
    return float(result[full][k]), float(result[f"{EXTREMES}/t/{name}"][k]), s


def stress_of(result: StoredResult) -> Held | None:
    """The largest stress as a part of the allowed one.

    Over every accepted step and node, and over the outputs, which may lie between nodes; None: no limit, or no stress.
    """
    known = _most_stressed(result, False) if has_envelope(result) else None
    if "von_mises" not in result or "max_stress" not in result:
        return known
    by_outputs = known is None and len(result.times) > 1
    shown = _most_stressed(extremes_of_outputs(result, "von_mises"), by_outputs)
    if known is None or shown is None:
        return known or shown
    return shown if shown.value / shown.allowed > (1.0 + SAME) * known.value / known.allowed else known


def _most_stressed(values: Arrays, by_outputs: bool) -> Held | None:
    names = [f"{GROUP_OF_NODES}/{x}" for x in ("von_mises_max", "max_stress", "von_mises_t_max", "s")]
    if any(name not in values for name in names):
        return None
    stress, allowed, t, s = (values[name] for name in names)
    used = stress / allowed
    if np.isnan(used).all():
        return None
    k = int(np.nanargmax(used))
    value, most = float(stress[k]), float(allowed[k])
    return Held("von_mises", "max_stress", "Pa", value, most, value > most, float(t[k]), float(s[k]), by_outputs)


def held_of(result: StoredResult) -> list[Held]:
    """Every limit of a quantity, at the step or output where it is nearest to be broken, or most broken."""
    found, moves = [], len(result.times) > 1
    for full in (name for name in result.names if name.startswith(f"{GROUP}/")):
        name = full.removeprefix(f"{GROUP}/")
        values, unit = result[name], result.units[name]
        for limit, allowed in zip(("smallest", "largest"), result[full].tolist(), strict=True):
            if np.isnan(allowed):
                continue
            known = at_every_step(result, name, limit)
            if np.isfinite(values).any():
                k = int(np.nanargmin(values) if limit == "smallest" else np.nanargmax(values))
                value, t, where = float(values[k]), float(result.times[k]), None
                sign = 1.0 if limit == "smallest" else -1.0
                if known is not None and not sign * value < sign * known[0] - SAME * abs(known[0]):
                    value, t, where = known
            elif known is not None:
                value, t, where = known
            else:
                found.append(Held(name, limit, unit, np.nan, allowed, False, np.nan, None, moves))
                continue
            broken = value < allowed if limit == "smallest" else value > allowed
            found.append(Held(name, limit, unit, value, allowed, broken, t, where, moves and known is None))
    return found + [x for x in (stress_of(result), capacity_of(result), code_of(result)) if x is not None]


def capacity_of(result: StoredResult) -> Held | None:
    """The largest part of the capacity of sections that tension and curvature use, over the outputs; None: none given.

    Between outputs it is known to stay within where their ranges over all steps do, as if they came at once.
    """
    return _part_of(result, NAME, "capacity", bound_of_steps)


def code_of(result: StoredResult) -> Held | None:
    """The largest part that codes of sections let it use, likewise; of mooring lines over every step."""
    found, steps = _part_of(result, CODE_USED, "code", code_of_steps), mooring_of_steps(result)
    if found is None or steps is None:
        return found
    if not needs_moments(result):
        found = found._replace(by_outputs=False, bound=None)
    value = 100.0 * steps[0]
    if value > (1.0 + SAME) * found.value:
        unknown = found.by_outputs and found.bound is None
        found = found._replace(value=value, t=steps[1], s=steps[2], broken=value > found.allowed, by_outputs=unknown)
    return found


def needs_moments(result: StoredResult) -> bool:
    """Whether a code takes tension and moment at once, which no step but those of outputs is known by."""
    return any(row.kind == F201 for row in rows_of(result))


def _part_of(
    result: StoredResult, name: str, limit: str, bound_of: Callable[[StoredResult], float | None]
) -> Held | None:
    if name not in result:
        return None
    most = extremes_of_outputs(result, name)
    value, t, s = (most[f"{GROUP_OF_NODES}/{x}"] for x in (f"{name}_max", f"{name}_t_max", "s"))
    if np.isnan(value).all():
        return None
    k, bound = int(np.nanargmax(value)), bound_of(result)
    beyond = bound is None or bound > 1.0
    if len(result.times) == 1:  # nodes alone are between outputs
        hidden = bound is not None and 100.0 * bound > (1.0 + SHOWS) * float(value[k])  # their errors are not known
        beyond = not value[k] > 100.0 and (not shows_ends(result) if bound is None else beyond or hidden)
    at_most = 100.0 * bound if beyond and bound is not None else None
    worst = float(value[k])
    return Held(name, limit, "%", worst, 100.0, worst > 100.0, float(t[k]), float(s[k]), beyond, bound=at_most)
