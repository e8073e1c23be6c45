"""Extremes and limits of a result: over every accepted step where the file has its envelope, else over its outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from hybrid.store.reader import Result

# Names in the file: the group, its places (m), and the times (s) between which all accepted steps count.
GROUP = "envelope"
SCALE, BEGIN, END = f"{GROUP}/s", f"{GROUP}/begin", f"{GROUP}/end"
# What limits are held against.
_HELD = {"min_bend_radius": ("curvature", "max"), "max_tension": ("tension", "max"), "min_tension": ("tension", "min")}
# Of the largest tension: what is below is what the solver's tolerance leaves of a force of zero, as at a free end.
NOTHING = 1e-6


class Arrays(Protocol):
    """Arrays by name: a result, or what is about to be written."""

    def __contains__(self, name: object, /) -> bool: ...

    def __getitem__(self, name: str, /) -> np.ndarray: ...


class Extreme(NamedTuple):
    """A value, where (s, m) and when (t, s); side: -1 or 1, before or after a place with two values, else 0."""

    value: float
    s: float
    t: float
    side: int


class Judged(NamedTuple):
    """How near the cable came to a limit of its sections: where its limit was broken most, or nearly.

    limit: its key in the scene; value, allowed: m or N; used: part of what is allowed, None for a smallest tension;
    s: m; t: s.
    """

    limit: str
    value: float
    allowed: float
    used: float | None
    broken: bool
    s: float
    t: float

    @property
    def margin(self) -> float:
        """What is left of what is allowed: a part of it, of a smallest tension in N; negative where it is broken."""
        return self.value - self.allowed if self.used is None else 1.0 - self.used

    @property
    def text(self) -> str:
        """What was reached, and what is allowed."""
        unit = "m" if self.limit == "min_bend_radius" else "N"
        what = "bend radius" if unit == "m" else "tension"
        side = "above" if self.limit == "max_tension" else "below"
        if not self.broken:
            side = "within"
        return f"{what} of {self.value:.4g} {unit}, {side} the {self.allowed:.4g} {unit} allowed ({self.limit})"


def has_envelope(result: Result) -> bool:
    """Whether a result has its envelope: files of 0.6 and of the shooting solver do not, nor have runs killed early."""
    return END in result and bool(np.isfinite(result[END]))


def extreme(values: Arrays, name: str, bound: str) -> Extreme | None:
    """The lowest ("min") or highest ("max") value of a quantity of the envelope over all places; None: it has none."""
    full = f"{GROUP}/{name}_{bound}"
    if full not in values or not np.isfinite(values[full]).any():
        return None
    x = values[full]
    k = int(np.nanargmin(x) if bound == "min" else np.nanargmax(x))
    s = values[SCALE]
    side = int(k > 0 and s[k - 1] == s[k]) - int(k + 1 < len(s) and s[k + 1] == s[k])
    return Extreme(float(x[k]), float(s[k]), float(values[f"{GROUP}/{name}_t_{bound}"][k]), side)


def judged(values: Arrays) -> list[Judged]:
    """Every limit that the sections have, at the place of the envelope where the cable is worst off.

    A place without a value, on a reel to the end, is not judged; nor is a limit without any place that has one.
    """
    found = []
    for limit, (name, bound) in _HELD.items():
        full = f"{GROUP}/{name}_{bound}"
        if f"{GROUP}/{limit}" not in values or full not in values:
            continue
        allowed, x, t = values[f"{GROUP}/{limit}"], values[full], values[f"{GROUP}/{name}_t_{bound}"]
        x = np.where(np.isfinite(x), x, np.nan)
        if np.isnan(allowed + x).all():
            continue
        if limit == "min_tension":
            worse, most = allowed - x, NOTHING * float(np.nanmax(np.abs(x)))
        else:
            worse, most = x * allowed if limit == "min_bend_radius" else x / allowed, 1.0
        k = int(np.nanargmax(worse))
        value, used = float(x[k]), None if limit == "min_tension" else float(worse[k])
        if limit == "min_bend_radius":
            value = 1.0 / value if value > 0.0 else np.inf
        broken = bool(worse[k] > most)
        found.append(Judged(limit, value, float(allowed[k]), used, broken, float(values[SCALE][k]), float(t[k])))
    return found
