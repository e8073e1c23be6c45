"""Histories of a result, and what they amount to: statistics, spectra, extremes, fatigue damage.

An end force is known at every step, and its statistics are those of the steps; all else is known at the outputs.
Extremes of a time longer than a result are those of a law of its peaks: not of round-off, nor beyond a bound.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.statistics import extremes, moments
from hybrid.statistics.moments import STEADY, mean_over_time
from hybrid.store.records import ALIASES
from hybrid.store.stored_result import TURNS, StoredResult

Floats = np.ndarray
Window = tuple[float | None, float | None]

# What is looked at when nothing is asked for, where the result has it; and all that its scene asks for by name.
USUAL: tuple[str, ...] = ("end_force_start", "end_force_end", "tension", "curvature", "bending_moment", "torque")
USUAL += ("contact", "wall_tension", "von_mises", "capacity_used", "code_used")
# Histories of one value that every result may have, and no scene asks for.
NOT_ASKED_FOR = ("t", "contact_force", "grounded_length")
# Components of a vector.
AXES = ("x", "y", "z")
# Fibres around a section at which its stress is counted.
FIBRES = 8
# Forces F and lengths L of a line are computed with 1e-16 of themselves in each of some thousand operations: what
# ranges over less than this part of them is round-off.
ROUND_OFF = 1e-12
# What an angle between two directions cannot exceed, by its unit.
HALF_TURN = {"deg": 180.0, "rad": math.pi}
# Largest peaks are alike where their median exceeds the least of them by less than this part of its height over the
# mean: of a regular motion by some 0.001, of the largest tenth of the peaks of a random sea by 0.14.
ALIKE = 0.02
# Angles that are counted on through full turns.
COUNTED_ON = "rotation"


class History(NamedTuple):
    """A quantity over time: values (nt,) or (nt, n), at arc lengths s (n,) m if it lies along the line."""

    name: str
    unit: str
    t: Floats
    values: Floats
    s: Floats | None
    basis: str


class Section(NamedTuple):
    """A section for stresses: area of the material (m2), outer diameter (m), Young's modulus (Pa)."""

    area: float
    outer_diameter: float
    modulus: float


def usual_names(result: StoredResult) -> list[str]:
    """The quantities of USUAL that a result has, and those that its scene asks for."""
    asked = [x for x in result.names if "/" not in x and x not in NOT_ASKED_FOR and result.dims(x) == ("t",)]
    return [name for name in USUAL if name in result or f"steps/{name}" in result] + asked


def history_of(result: StoredResult, name: str, times: Window | None = None, at: Any = None) -> History:
    """A history of a result.  times: from and to (s); at: arc lengths (m), None: all output points.

    name: of a quantity, a vector included; NAME.x, NAME.y, NAME.z of one of its components; x, y, z of the position.
    A place where the quantity jumps comes twice, with the value before and after it.

    ResultError for what is no history of numbers, a window with no value in it, or a place outside.
    """
    whole, component = component_of(result, name)
    stored = f"steps/{whole}" if f"steps/{whole}" in result and whole not in result else ALIASES.get(whole, whole)
    values = result[stored]
    if isinstance(values, Mapping):
        raise ResultError(f"'{name}' is a group; ask for one of {', '.join(f'{name}/{key}' for key in values)}")
    dims = result.dims(stored)
    if not dims or dims[0] not in ("t", "steps/t") or not np.issubdtype(np.asarray(values).dtype, np.number):
        raise ResultError(f"'{name}' is no history: its dimensions are ({', '.join(dims)})\n    try:      tension")
    t, s = np.asarray(result[dims[0]]), None
    if t.size < 2 and result.status != "complete":
        raise ResultError(_nothing_yet(result))
    if dims[1:2] == ("s",):
        s, values = result.both_sides(stored)
        if at is not None:
            s, values = _at_places(result, stored, s, values, np.atleast_1d(np.asarray(at, float)))
    elif at is not None:
        raise ResultError(f"'{name}' has no value at an arc length: its dimensions are ({', '.join(dims)})")
    a, b = _window(times)
    inside = (t >= a) & (t <= b)
    if not inside.any():
        over = f"{t[0]:.6g} to {t[-1]:.6g} s" if t.size else "none"
        raise ResultError(f"no value of '{name}' lies between t = {a:g} and {b:g} s\n    expected: a window in {over}")
    basis = "every step" if dims[0] == "steps/t" else "every output"
    values = np.asarray(values)[inside]
    if component is not None:
        values = values[..., component]
    if stored in TURNS:
        values = np.unwrap(values, axis=0)
    return History(name, result.units[stored], t[inside], values, s, basis)


def component_of(result: StoredResult, name: str) -> tuple[str, int | None]:
    """The quantity that a name is of, and which component of it; None: all of it, or it is no vector."""
    whole, _, axis = ("position", ".", name) if name in AXES and name not in result else name.rpartition(".")
    if whole and axis in AXES and name not in result and whole in result and result.dims(whole)[-1:] == ("xyz",):
        return whole, AXES.index(axis)
    return name, None


def components_of(result: StoredResult, name: str) -> list[str]:
    """The names of the components of a vector; of what is none its own."""
    whole, component = component_of(result, name)
    if component is None and whole in result and result.dims(whole)[-1:] == ("xyz",):
        return [f"{name}.{axis}" for axis in AXES]
    return [name]


def _nothing_yet(result: StoredResult) -> str:
    """That a run was stopped before there was a history, and what to do."""
    name = result.file.name if result.file else "the file"
    fix = f"`hybrid resume {name}` goes on" if len(result.times) else "`hybrid run` of its scene, from its start"
    return (
        f"the run was stopped before its first output, or still runs: there is no history yet ({result.status_text})\n"
        f"    try:      {fix}; a shorter output.every keeps more of a run that is stopped"
    )


def summary_of(history: History) -> moments.Summary:
    """Its summary; ResultError with its name where there is none."""
    try:
        return moments.summary(history.t, history.values)
    except ResultError as error:
        raise ResultError(f"'{history.name}': {error}") from None


def _window(times: Window | None) -> tuple[float, float]:
    """From and to, s; ResultError for what is no window."""
    if times is None:
        return -np.inf, np.inf
    if len(times) != 2:
        raise ResultError(f"times = {times!r} is no window\n    expected: (from, to), in s; None for no limit")
    first, last = times
    return -np.inf if first is None else float(first), np.inf if last is None else float(last)


def _at_places(result: StoredResult, name: str, s: Floats, values: Floats, at: Floats) -> tuple[Floats, Floats]:
    """Arc lengths and values (nt, n, ...) at places, of which those where the quantity jumps come twice."""
    columns, places = [], []
    for x in at:
        exact = np.flatnonzero(np.abs(s - x) <= 1e-9 * np.ptp(s))
        found = values[:, exact] if exact.size else np.asarray(result.at(s=[x], names=[name], side="left")[name])
        columns.append(found)
        places += [x] * found.shape[1]
    return np.array(places), np.concatenate(columns, axis=1)


def bends_at(result: StoredResult, times: Window | None, at: Any) -> Floats:
    """Curvature (nt, n, 2) 1/m about two axes across the mean tangent at the places of `history_of`."""
    a, b = _window(times)
    found = bends_of(result, (result["t"] >= a) & (result["t"] <= b))
    return (found if at is None else found.interpolated(at)).across()


def lies_along(result: StoredResult, name: str) -> bool:
    """Whether a quantity has a value at every arc length."""
    whole, _ = component_of(result, name)
    known = ALIASES.get(whole, whole)
    return known in result and result.dims(known)[1:2] == ("s",)


def one_history(history: History) -> History:
    """The same as one history, of two values at one place the one that ranges more; ResultError if it is several."""
    values = history.values.reshape(history.values.shape[0], -1)
    if history.s is not None and values.shape[1] == 2 and history.s[0] == history.s[1]:
        return history._replace(values=values[:, int(np.ptp(values, axis=0).argmax())])
    if values.shape[1] != 1:
        fix = "at=..., an arc length in m" if history.s is not None else "a quantity with one value"
        fix = f"{history.name}.x, a component" if values.shape[1] == len(AXES) else fix
        raise ResultError(f"'{history.name}' has {values.shape[1]} values at a time\n    try:      {fix}")
    return history._replace(values=values[:, 0])


# --- bends ---------------------------------------------------------------------------------------


class Bends(NamedTuple):
    """Bends (nt, n, 3) 1/m, inertial, and mean tangents (n, 3), at s (n,) m; twice where it jumps."""

    s: Floats
    vectors: Floats
    tangents: Floats

    def interpolated(self, places: Floats) -> Bends:
        """The same at arc lengths (m), those where curvature jumps twice; between output points linear."""
        s, vectors, tangents = [], [], []
        for x in np.atleast_1d(np.asarray(places, float)).tolist():
            exact = np.flatnonzero(np.abs(self.s - x) <= 1e-9 * np.ptp(self.s))
            if not exact.size:
                k = int(np.clip(np.searchsorted(self.s, x) - 1, 0, len(self.s) - 2))
                w = (x - self.s[k]) / (self.s[k + 1] - self.s[k])
                vectors.append((1.0 - w) * self.vectors[:, [k]] + w * self.vectors[:, [k + 1]])
                tangents.append((1.0 - w) * self.tangents[[k]] + w * self.tangents[[k + 1]])
            else:
                vectors.append(self.vectors[:, exact])
                tangents.append(self.tangents[exact])
            s += [x] * tangents[-1].shape[0]
        return Bends(np.array(s), np.concatenate(vectors, axis=1), np.concatenate(tangents))

    def across(self) -> Floats:
        """Components (nt, n, 2) 1/m about two axes across the mean tangents."""
        mean = self.tangents
        one = np.cross(mean, np.eye(3)[np.abs(mean).argmin(axis=1)])
        one /= np.linalg.norm(one, axis=1, keepdims=True)
        two = np.cross(mean, one)
        two /= np.linalg.norm(two, axis=1, keepdims=True)
        return np.stack([(self.vectors * one).sum(axis=2), (self.vectors * two).sum(axis=2)], axis=2)


def bends_of(result: StoredResult, rows: slice | Floats) -> Bends:
    """The bends of outputs: `curvature` about the axis t x dt/ds of the tangents."""
    s, size = result.both_sides("curvature")
    theta, phi = (result.both_sides(name)[1][rows] for name in ("theta", "phi"))
    t = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=2)
    axes = np.cross(t, slopes(s, t))
    length = np.linalg.norm(axes, axis=2, keepdims=True)
    axes = np.divide(axes, length, out=np.zeros_like(axes), where=length > 0.0)
    return Bends(s, size[rows][..., None] * axes, t.mean(axis=0))


def slopes(s: Floats, x: Floats) -> Floats:
    """Derivatives of x (nt, n, 3) along s (n,), of second order, at ends too.

    No difference crosses an arc length that stands twice.
    """
    out = np.zeros_like(x)
    edges = [0, *(np.flatnonzero(np.diff(s) <= 0.0) + 1).tolist(), s.size]
    for a, b in pairwise(edges):
        if b - a > 1:
            out[:, a:b] = np.gradient(x[:, a:b], s[a:b], axis=1, edge_order=2 if b - a > 2 else 1)
    return out


# --- extremes of a longer time -------------------------------------------------------------------


def extreme_of(
    result: StoredResult,
    name: str,
    unit: str,
    t: Floats,
    x: Floats,
    duration: float = extremes.THREE_HOURS,
    threshold: float | None = None,
    smallest: bool = False,
    probability: float = extremes.FRACTILE,
) -> extremes.Extreme:
    """The largest (or smallest) value that a time of `duration` (s) brings of a history x (nt,) at times t (nt,) s.

    threshold: in the unit of x.  ResultError where there are too few peaks, where the history is round-off, where the
    largest peaks are alike, as of a regular motion, and where the law leads beyond what an angle can be.
    """
    sign = -1.0 if smallest else 1.0
    extremes.check(duration, probability)
    _refuse_round_off(result, unit, x)
    _refuse_regular(t, sign * x)
    found = extremes.of_record(t, sign * x, duration, None if threshold is None else sign * threshold, probability)
    most = HALF_TURN.get(unit)
    if most is not None and not name.endswith(COUNTED_ON):
        bound = most if not smallest else 0.0 if x.min() >= 0.0 else -most
        reached = sign * found.fractile_interval[1]
        if sign * reached > sign * bound:
            raise ResultError(
                f"the law of its peaks leads to {reached:.4g} {unit}, and the angle is bounded by {bound:.4g} {unit}\n"
                "    try:      the force whose direction it is, or a longer run"
            )
    return found if not smallest else _negated(found)


def _refuse_round_off(result: StoredResult, unit: str, x: Floats) -> None:
    """ResultError for a history that ranges over no more than round-off of its own size, or of forces and lengths."""
    spread, size = float(np.ptp(x)), float(np.abs(x).max())
    least, of = STEADY * size, f"{size:.3g} {unit}, its size"
    scale = _scale(result, unit)
    if scale is not None and ROUND_OFF * scale > least:
        least, of = ROUND_OFF * scale, f"{scale:.3g} {unit}, the scale of the line"
    if spread <= least:
        raise ResultError(f"it ranges over {spread:.2g} {unit}: round-off of {of}\n    try:      another quantity")


def _refuse_regular(t: Floats, x: Floats) -> None:
    """ResultError for a motion whose largest peaks are alike: a longer time brings no larger ones."""
    peaks = np.sort(extremes.peaks_of(t, x))
    most = max(extremes.LEAST_PEAKS, math.ceil((1.0 - extremes.USUAL_THRESHOLD) * peaks.size))
    largest, mean = peaks[-most:], float(mean_over_time(t, x))
    if peaks.size >= extremes.LEAST_PEAKS and np.median(largest) - largest[0] < ALIKE * (largest[0] - mean):
        raise ResultError("its largest peaks are alike, as of a regular motion: no longer time brings larger ones")


def _scale(result: StoredResult, unit: str) -> float | None:
    """Of a unit, what the largest force F (N) and the length L (m) of a line make of it; None: not known."""
    length = float(np.ptp(result.s)) if not result.lines and "tension" in result and len(result.s) else 0.0
    if not length:
        return None
    force = float(np.nanmax(np.abs(result["tension"]), initial=0.0))
    scales = {"N": force, "N m": force * length, "1/m": 1.0 / length, "m": length, "N/m": force / length}
    return scales.get(unit)


def _negated(found: extremes.Extreme) -> extremes.Extreme:
    """What was found of the negative values, of the values."""

    def turned(interval: tuple[float, float]) -> tuple[float, float]:
        return -interval[1], -interval[0]

    changed: dict[str, Any] = {x: -getattr(found, x) for x in ("most_probable", "median", "fractile")}
    changed |= {f"{x}_interval": turned(getattr(found, f"{x}_interval")) for x in changed}
    return found._replace(**changed, fitted=f"of the negative values: {found.fitted}")
