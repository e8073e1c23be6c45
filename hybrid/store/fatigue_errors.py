"""How long a fatigue life may be by the errors of tension and curvature: ranges of stress follow what varies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.statistics.moments import summary
from hybrid.store.histories import history_of
from hybrid.store.reader import Result

AS_LARGE = "not verified: the error of what varies may be as large as that; try: a smaller accuracy of curvature"

# Outputs between up-crossings of the mean, fewer of which miss the crests: of a sine, ranges are 4.5 % too small at 6.
LEAST_OF_CYCLE = 6.0


def too_far_apart(result: Result, s: float, times: Any) -> str:
    """Why outputs are too far apart for cycles of tension at s (m); "": they are not.  times: as of `Result.damage`."""
    history = history_of(result, "tension", times, np.array([s]))
    period = float(summary(history.t, history.values).crossing_period.ravel()[0])
    many = period / float(np.diff(history.t).mean())
    if not many < LEAST_OF_CYCLE:
        return ""
    every = period / 10.0
    return f"not verified: {many:.2g} outputs to a cycle of tension miss its crests; try: output.every: {every:.2g}"


def part_off(result: Result, s: float, times: Any, section: Sequence[float] | None) -> float:
    """By which part the ranges at s (m) may be off: root mean square of the error figure over the standard deviation.

    Of tension, or with a section (area, diameter, modulus) of the stress T/A + E D/2 kappa, so that each counts by its
    stress; infinite where an error is not estimated.  times: as of `Result.damage`.
    """
    t = history_of(result, "tension", times).t
    there = (result.times >= t[0]) & (result.times <= t[-1])
    k, error, varies = int(np.abs(result.s - s).argmin()), 0.0, 0.0
    by = {"tension": 1.0} if section is None else {
        "tension": 1.0 / section[0], "curvature": 0.5 * section[2] * section[1],
    }  # fmt: skip
    for name, stress in by.items():
        if f"errors/total/{name}" not in result:
            return float("inf")
        figure, value = (np.array(result[x])[there, k] for x in (f"errors/total/{name}", name))
        error += stress * float(np.sqrt(np.mean(figure**2)))
        varies += (stress * float(value.std())) ** 2
    return error / max(float(np.sqrt(varies)), 1e-300)


def life_within(
    result: Result, facts: Mapping[str, Any], curve: Any, strength: float | None, section: Sequence[float] | None,
    times: Any,
) -> dict[str, Any]:  # fmt: skip
    """Shortest and longest life, years, of all ranges larger or smaller by `part_off`; None: unlimited.

    facts: s (m), damage and life (years) there; the rest as of `Result.damage`.  Where ranges may be off by all that
    varies, or outputs are too far apart to count cycles, there is no life.
    """
    if few := too_far_apart(result, facts["s"], times):
        return {"life": None, "life_not_verified": few}
    part = part_off(result, facts["s"], times, section)
    if not part < 1.0:
        return {"life": None, "life_not_verified": AS_LARGE}
    lives = []
    for scale in (1.0 + part, 1.0 - part):
        weaker = None if strength is None else strength / scale
        other = None if section is None else (section[0] / scale, section[1], section[2] * scale)
        _, damage = result.damage(curve, strength=weaker, section=other, times=times, at=[facts["s"]])
        most = float(np.max(damage))
        lives.append(facts["life"] * facts["damage"] / most if most > 0.0 else None)
    return {"life_least": lives[0], "life_most": lives[1]}
