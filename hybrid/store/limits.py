"""How near the quantities that a scene asks for came to their limits: over every step where a file knows them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hybrid.store.envelope import GROUP as GROUP_OF_NODES
from hybrid.store.envelope import has_envelope

if TYPE_CHECKING:
    from hybrid.store.reader import Result

GROUP = "limits"
# Group of the smallest and the largest value of a quantity at any accepted step; t/ in it has times, s/ arc lengths.
EXTREMES = "extremes"


class Held(NamedTuple):
    """A quantity against a limit of its own: its worst value, in `unit`, when (t, s) and where (s, m; None: no place).

    limit: key in the scene: smallest, largest, or max_stress.  by_outputs: whether steps between outputs are not known.
    value and t are NaN of a quantity that never had a value, as the touchdown of a line that touches nothing.
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

    @property
    def text(self) -> str:
        """What was reached, and what is allowed."""
        allowed = f"the {self.allowed:.4g} {self.unit} allowed"
        if np.isnan(self.value):
            bound = "least" if self.limit == "smallest" else "most"
            return f"{self.name} had no value at any time: not judged by {allowed} at {bound}"
        at = " at the outputs" * self.by_outputs
        below = ("not below", "below") if self.limit == "smallest" else ("within", "above")
        return f"{self.name} of {self.value:.4g} {self.unit}{at}, {below[self.broken]} {allowed}"

    @property
    def when(self) -> str:
        """Where and when, behind the text; "" of what had no value."""
        if np.isnan(self.value):
            return ""
        return f", t = {self.t:.5g} s" + (f", s = {self.s:.5g} m" if self.s is not None else "")


def at_every_step(result: Result, name: str, bound: str) -> tuple[float, float, float | None] | None:
    """The "smallest" or "largest" value of a quantity at any accepted step, its time (s), and arc length (m) if any.

    None: the file does not have it.
    """
    full, k = f"{EXTREMES}/{name}", ("smallest", "largest").index(bound)
    if full not in result or not np.isfinite(result[full][k]):
        return None
    place = f"{EXTREMES}/s/{name}"
    s = float(result[place][k]) if place in result else None
    return float(result[full][k]), float(result[f"{EXTREMES}/t/{name}"][k]), s


def stress_at_every_step(result: Result) -> Held | None:
    """The largest stress over every accepted step and node, as a part of what is allowed; None: it is not known."""
    if f"{GROUP_OF_NODES}/max_stress" not in result or not has_envelope(result):
        return None
    stress, allowed = result[f"{GROUP_OF_NODES}/von_mises_max"], result[f"{GROUP_OF_NODES}/max_stress"]
    used = stress / allowed
    if np.isnan(used).all():
        return None
    k = int(np.nanargmax(used))
    value, most = float(stress[k]), float(allowed[k])
    t, s = (float(result[f"{GROUP_OF_NODES}/{x}"][k]) for x in ("von_mises_t_max", "s"))
    return Held("von_mises", "max_stress", "Pa", value, most, value > most, t, s, False)


def held_of(result: Result) -> list[Held]:
    """Every limit of a quantity, at the step, or output, where it is nearest to be broken, or most broken."""
    found, moves = [], len(result.times) > 1
    for full in (name for name in result.names if name.startswith(f"{GROUP}/")):
        name = full.removeprefix(f"{GROUP}/")
        values, unit = result[name], result.units[name]
        for limit, allowed in zip(("smallest", "largest"), result[full].tolist(), strict=True):
            if np.isnan(allowed):
                continue
            known = at_every_step(result, name, limit)
            if known is None and np.isnan(values).all():
                found.append(Held(name, limit, unit, np.nan, allowed, False, np.nan, None, moves))
                continue
            if known is not None:
                value, t, where = known
            else:
                k = int(np.nanargmin(values) if limit == "smallest" else np.nanargmax(values))
                value, t, where = float(values[k]), float(result.times[k]), None
            broken = value < allowed if limit == "smallest" else value > allowed
            found.append(Held(name, limit, unit, value, allowed, broken, t, where, moves and known is None))
    if (stressed := stress_at_every_step(result)) is not None:
        found.append(stressed)
    elif "max_stress" in result and "von_mises" in result:
        s, stress = result.both_sides("von_mises")
        right = result["right/max_stress"] if "right/max_stress" in result else np.zeros(0)
        jumps = result["right/s"] if right.size else right
        allowed = np.insert(result["max_stress"], np.searchsorted(result["s"], jumps) + 1, right)
        used = stress / allowed
        if not np.isnan(used).all():
            n, k = divmod(int(np.nanargmax(used)), used.shape[1])
            value, most = float(stress[n, k]), float(allowed[k])
            where, value, most = float(s[k]), float(stress[n, k]), float(allowed[k])
            t, broken = float(result.times[n]), value > most
            found.append(Held("von_mises", "max_stress", "Pa", value, most, broken, t, where, moves))
    return found
