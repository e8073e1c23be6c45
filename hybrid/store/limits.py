"""How near the quantities that a scene asks for came to their limits, over the outputs of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from hybrid.store.reader import Result

GROUP = "limits"


class Held(NamedTuple):
    """A quantity against a limit of its own: its worst value, in `unit`, when (t, s) and where (s, m; None: no place).

    limit: key in the scene: smallest, largest, or max_stress.  by_outputs: whether steps between outputs are not known.
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
        at = " at the outputs" * self.by_outputs
        side = {"smallest": "below", "largest": "above", "max_stress": "above"}[self.limit] if self.broken else "within"
        return f"{self.name} of {self.value:.4g} {self.unit}{at}, {side} the {self.allowed:.4g} {self.unit} allowed"


def held_of(result: Result) -> list[Held]:
    """Every limit of a quantity, at the output where it is nearest to be broken, or most broken."""
    found, moves = [], len(result.times) > 1
    for full in (name for name in result.names if name.startswith(f"{GROUP}/")):
        name = full.removeprefix(f"{GROUP}/")
        values, unit = result[name], result.units[name]
        for limit, allowed in zip(("smallest", "largest"), result[full].tolist(), strict=True):
            if np.isnan(allowed) or np.isnan(values).all():
                continue
            k = int(np.nanargmin(values) if limit == "smallest" else np.nanargmax(values))
            value = float(values[k])
            broken = value < allowed if limit == "smallest" else value > allowed
            found.append(Held(name, limit, unit, value, allowed, broken, float(result.times[k]), None, moves))
    if "max_stress" in result and "von_mises" in result:
        s, stress = result.both_sides("von_mises")
        right = result["right/max_stress"] if "right/max_stress" in result else np.zeros(0)
        jumps = result["right/s"] if right.size else right
        allowed = np.insert(result["max_stress"], np.searchsorted(result["s"], jumps) + 1, right)
        used = stress / allowed
        if not np.isnan(used).all():
            n, k = divmod(int(np.nanargmax(used)), used.shape[1])
            value, most = float(stress[n, k]), float(allowed[k])
            when, where = float(result.times[n]), float(s[k])
            found.append(Held("von_mises", "max_stress", "Pa", value, most, value > most, when, where, moves))
    return found
