"""Statistics of a result as rows: what `hybrid stats` prints and a report shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.statistics.extremes import THREE_HOURS
from hybrid.statistics.moments import exceedance, summary
from hybrid.store.capacity import CODE_NAME as CODE_USED
from hybrid.store.capacity import NAME as CAPACITY_USED
from hybrid.store.envelope import extreme
from hybrid.store.histories import Window, components_of, extreme_of, history_of, lies_along, summary_of, usual_names
from hybrid.store.limits import at_every_step, capacity_of, code_of
from hybrid.store.reader import Result

# Part of the largest value at the outputs by which that of every step must be above it to be worth a note.
WORTH_A_NOTE = 0.01


def rows_of(
    result: Result, names: Sequence[str] | None = None, at: Sequence[float] | None = None, times: Window | None = None,
    duration: float = THREE_HOURS, above: float | None = None, below: float | None = None,
) -> list[dict[str, Any]]:  # fmt: skip
    """One row for each history: its summary, and the extreme of `duration` (s) or why there is none.

    names: None for the usual ones that are not zero throughout and are known at all outputs; at: arc lengths, m, None:
    where the quantity is largest; times: from and to, s; above, below: in the unit of the quantity, `exceedance`
    (`exceedance_below`) is the part of the time above (below) it.  A row with `beyond_outputs` says how far all nodes
    and steps went beyond what its outputs show.  A vector has a row for each of its components.
    """
    rows = []
    for name in _each(result, names):
        history = history_of(result, name, times, at if lies_along(result, name) else None)
        values = history.values.reshape(history.t.size, -1)
        known = np.isfinite(values).all(axis=0)
        if names is None and not (known.any() and values[:, known].any()):
            continue
        if history.s is None:
            picked: list[tuple[float | None, int]] = [(None, k) for k in range(values.shape[1])]
        elif at is None:
            k = int(np.where(known, values.max(axis=0), -np.inf).argmax())
            picked = [(float(history.s[k]), k)]
        else:
            picked = [(float(s), k) for k, s in enumerate(history.s)]
        for s, k in picked:
            found = summary_of(history._replace(values=values[:, k]))
            row: dict[str, Any] = {"quantity": name, "unit": history.unit, "s": s, "of": history.basis}
            row |= {key: _number(value) for key, value in found._asdict().items()}
            if above is not None:
                row["exceedance"] = float(exceedance(history.t, values[:, k], above))
            if below is not None:
                row["exceedance_below"] = float(exceedance(history.t, values[:, k], below=below))
            row["extreme"] = None
            try:
                row["extreme"] = extreme_of(result, name, history.unit, history.t, values[:, k], duration)._asdict()
            except ResultError as error:
                row["no_extreme"] = str(error).splitlines()[0]
            if at is None and (text := _beyond_outputs(result, name, history.t, found.maximum)):
                row["beyond_outputs"] = text
            rows.append(row)
    return rows


def values_of(
    result: Result, names: Sequence[str] | None = None, at: Sequence[float] | None = None
) -> list[dict[str, Any]]:
    """One row for each value of an equilibrium: quantity, unit, arc length s (m; None: it has none) and value.

    names, at: as of `rows_of`.
    """
    rows = []
    for name in _each(result, names):
        history = history_of(result, name, None, at if lies_along(result, name) else None)
        values = history.values.reshape(-1)
        if names is None and not np.nan_to_num(values).any():
            continue
        k = int(np.nan_to_num(values, nan=-np.inf).argmax())
        picked = range(values.size) if at is not None or history.s is None else [k]
        for i in picked:
            s = None if history.s is None else float(history.s[i])
            rows.append({"quantity": name, "unit": history.unit, "s": s, "value": _number(values[i] + 0.0)})
    return rows


def _each(result: Result, names: Sequence[str] | None) -> list[str]:
    """The names of quantities, the usual ones or those asked for, with those of components in place of vectors."""
    return [x for name in (usual_names(result) if names is None else names) for x in components_of(result, name)]


def _beyond_outputs(result: Result, name: str, t: np.ndarray, largest: Any) -> str:
    """What the envelope of all nodes and steps knows of the largest value in the times t (n,) s; "": nothing more."""
    found, named = extreme(result, name, "max"), at_every_step(result, name, "largest")
    if found is not None:
        value, when, where = found.value, found.t, f"s = {found.s:.5g} m, "
    elif named is not None:
        value, when, where = named[0], named[1], ""
    else:
        return _bound_of_steps(result, name, largest)
    if not (t[0] <= when <= t[-1] and value - largest > WORTH_A_NOTE * abs(largest)):
        return ""
    unit = result.units[name]
    of, more = ("all nodes and steps", " or more output.points") if where else ("all steps", "")
    shows = "show" if more else "shows"
    return (
        f"{name}: {value:.5g} {unit} at {where}t = {when:.5g} s, of {of}, {float(largest):.5g} {unit} at the outputs; "
        f"a shorter output.every{more} {shows} more of it"
    )


def _bound_of_steps(result: Result, name: str, largest: Any) -> str:
    """Of what several quantities decide at once, how large it may have been between the outputs; "": no larger."""
    held = {CAPACITY_USED: capacity_of, CODE_USED: code_of}.get(name, lambda _: None)(result)
    if held is None or held.bound is None or not held.bound - largest > WORTH_A_NOTE * abs(largest):
        return ""
    unit = held.unit
    return (
        f"{name}: {float(largest):.5g} {unit} at the outputs, between them at most {held.bound:.5g} {unit} by the "
        "ranges of all steps; a shorter output.every shows more of it"
    )


def _number(value: Any) -> float | None:
    x = float(value)
    return x if np.isfinite(x) else None


# How long a fatigue life may be by the errors of tension and curvature: ranges of stress follow what varies.

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
