"""Histories of a result, and what they amount to: statistics, spectra, extremes, fatigue damage.

An end force is known at every step, and its statistics are those of the steps; all else is known at the outputs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError
from hybrid.statistics import extremes, fatigue, moments, spectrum
from hybrid.store.bends import bends_of
from hybrid.store.capacity import mooring_use
from hybrid.store.envelope import Judged
from hybrid.store.extrapolation import extreme_of
from hybrid.store.names import ALIASES
from hybrid.store.partners import Pressed, contacts_of
from hybrid.store.verdicts import Verdicts, section_limits, verdicts_of

if TYPE_CHECKING:
    from hybrid.store.reader import Result

Floats = np.ndarray
Window = tuple[float | None, float | None]

# What is looked at when nothing is asked for, where the result has it; and all that its scene asks for by name.
USUAL = (
    "end_force_start", "end_force_end", "tension", "curvature", "bending_moment", "torque", "contact", "wall_tension",
    "von_mises", "capacity_used", "code_used",
)  # fmt: skip
# Histories of one value that every result may have, and no scene asks for.
NOT_ASKED_FOR = ("t", "contact_force", "grounded_length")
# Components of a vector.
AXES = ("x", "y", "z")
# Fibres around a section at which its stress is counted.
FIBRES = 8


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


def usual_names(result: Result) -> list[str]:
    """The quantities of USUAL that a result has, and those that its scene asks for."""
    asked = [x for x in result.names if "/" not in x and x not in NOT_ASKED_FOR and result.dims(x) == ("t",)]
    return [name for name in USUAL if name in result or f"steps/{name}" in result] + asked


def history_of(result: Result, name: str, times: Window | None = None, at: Any = None) -> History:
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
    return History(name, result.units[stored], t[inside], values, s, basis)


def component_of(result: Result, name: str) -> tuple[str, int | None]:
    """The quantity that a name is of, and which component of it; None: all of it, or it is no vector."""
    whole, _, axis = ("position", ".", name) if name in AXES and name not in result else name.rpartition(".")
    if whole and axis in AXES and name not in result and whole in result and result.dims(whole)[-1:] == ("xyz",):
        return whole, AXES.index(axis)
    return name, None


def components_of(result: Result, name: str) -> list[str]:
    """The names of the components of a vector; of what is none its own."""
    whole, component = component_of(result, name)
    if component is None and whole in result and result.dims(whole)[-1:] == ("xyz",):
        return [f"{name}.{axis}" for axis in AXES]
    return [name]


def _nothing_yet(result: Result) -> str:
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


def _at_places(result: Result, name: str, s: Floats, values: Floats, at: Floats) -> tuple[Floats, Floats]:
    """Arc lengths and values (nt, n, ...) at places, of which those where the quantity jumps come twice."""
    columns, places = [], []
    for x in at:
        exact = np.flatnonzero(np.abs(s - x) <= 1e-9 * np.ptp(s)) if np.ptp(s) > 0.0 else np.zeros(1, int)
        found = values[:, exact] if exact.size else np.asarray(result.at(s=[x], names=[name], side="left")[name])
        columns.append(found)
        places += [x] * found.shape[1]
    return np.array(places), np.concatenate(columns, axis=1)


class Histories:
    """What a result can tell of its histories."""

    def contacts(self: Any) -> list[Pressed]:
        """What presses on the line by name, or which of several lines press on each other: largest forces at outputs.

        Of each its `partner`, `force` (N, over all places) at `t_force` (s), `contact` (N/m) at `t_contact` (s), and
        the `group` in which the result has these over time.
        """
        return contacts_of(self)

    def statistics(
        self: Any, names: Sequence[str] | None = None, *, times: Window | None = None, at: Any = None
    ) -> dict[str, moments.Summary]:
        """Summaries of histories, each of the shape of the quantity at one time: mean, standard deviation, skewness,
        extremes with their times, period between up-crossings of the mean, significant range, number of cycles.

        names: None for end forces, tension, curvature, bending moment, torque, contact force, and what the scene asks
        for, where the result has them at all outputs; times: from and to, s; at: arc lengths, m, None: all output
        points.  A quantity along the line has a value
        at each place of `both_sides(name)[0]`: where it jumps, one before and one after.
        """
        found = {}
        asked = usual_names(self) if names is None else [names] if isinstance(names, str) else names
        for name in asked:
            history = history_of(self, name, times, at if lies_along(self, name) else None)
            if names is None and not np.isfinite(history.values).all():
                continue
            found[name] = summary_of(history)
        return found

    def extreme(
        self: Any, name: str, *, at: float | None = None, duration: float = extremes.THREE_HOURS,
        threshold: float | None = None, times: Window | None = None, smallest: bool = False,
        probability: float = extremes.FRACTILE,
    ) -> extremes.Extreme:  # fmt: skip
        """The largest (or smallest) value that a time of `duration` (s) brings, by peaks over a threshold of a history.

        at: arc length (m), of a quantity along the line; threshold: in the unit of the quantity, None: nine tenths of
        the peaks are below it.  ResultError with too few peaks, of what is round-off, and where the law leads beyond
        what an angle can be.
        """
        history = _one(history_of(self, name, times, at))
        return extreme_of(
            self, name, history.unit, history.t, history.values, duration,
            threshold=threshold, smallest=smallest, probability=probability,
        )  # fmt: skip

    def exceedance(
        self: Any, name: str, above: float | None = None, *, below: float | None = None, at: Any = None,
        times: Window | None = None,
    ) -> Floats:  # fmt: skip
        """The part of the time for which a history is above a value, or below one, in the unit of its quantity; of the
        shape of the quantity at one time; at, times: as of `statistics`.  ResultError: not one number of the two."""
        if (above is None) is (below is None):
            raise ResultError("exceedance\n    expected: one of above and below, in the unit of the quantity")
        value = above if below is None else below
        if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
            key = "above" if below is None else "below"
            raise ResultError(f"{key}: expected a number in the unit of {name!r}, found {value!r:.60}")
        history = history_of(self, name, times, at)
        return moments.exceedance(history.t, history.values, above, below)

    def utilisation(self: Any) -> dict[str, Judged]:
        """How near the line came to each limit of its sections over all steps and outputs, by the key of the limit:
        `used` is the part of max_tension or min_bend_radius that was used, None of min_tension and of what is not
        verified; `verdict` is within, broken or not verified, with `why` and `remedy`; at s (m) and t (s).

        ResultError of a result of several lines: each has its own."""
        if self.lines:
            first = next(iter(self.lines))
            raise ResultError(
                f"utilisation of a result with the lines {', '.join(self.lines)}\n"
                f"    expected: that of one line\n    try:      result.lines[{first!r}].utilisation()"
            )
        return {found.limit: found for found in section_limits(self)}

    def mooring(
        self: Any, strength: float, factors: tuple[float, ...], pretension: Any
    ) -> tuple[Floats, Floats, Floats]:
        """Utilisation of a mooring line by DNV-OS-E301 (July 2021), (T_pre g_pre + (T - T_pre) g_env)/S: arc lengths
        (n,) m, at the outputs (nt, n), and of the largest tension over all steps and outputs (n,).

        strength: S, N; factors: g_pre, g_env, by class and limit state, without default; pretension: T_pre, N, or the
        result of an equilibrium under it, `hybrid.static` without current.  ResultError: of another line."""
        return mooring_use(self, strength, factors, pretension)

    def verdicts(self: Any) -> Verdicts:
        """What may be said of the result: limits of sections and of quantities are within or broken, an accuracy that
        was asked for is met or missed, or it is not verified, with the reason and the one thing to do.

        Of several lines each has its own, and the result those of quantities of all."""
        return verdicts_of(self)

    def spectrum(
        self: Any, name: str, *, at: Any = None, times: Window | None = None, segment: float | None = None
    ) -> spectrum.Spectrum:
        """The spectrum of a history by Welch's method; segment: s, None: an eighth of the record."""
        history = history_of(self, name, times, at)
        return spectrum.welch(history.t, history.values, segment)

    def damage(
        self: Any, curve: str | Mapping[str, Any] | fatigue.Curve, *, strength: float | None = None,
        section: Section | Sequence[float] | None = None, concentration: float = 1.0, times: Window | None = None,
        at: Any = None,
    ) -> tuple[Floats, Floats]:  # fmt: skip
        """Arc lengths (n,) m and the damage (n,) that the outputs of the run do there, by a curve of fatigue.

        curve: a name of hybrid/statistics/fatigue_curves.csv, or kind, log_a, m (log_a2, m2, knee) of one's own.
        strength: N, reference strength, for a T-N curve.  section: (area m2, outer diameter m, Young's modulus Pa) for
        an S-N curve; the stress is that of tension and bending at the worst of FIBRES fibres, times `concentration`.
        The damage is that of the time of the outputs; divide by it for a rate.
        """
        law = fatigue.curve_of(curve)
        tension = history_of(self, "tension", times, at)
        if law.kind == "T-N":
            if strength is None or section is not None or not 0.0 < strength < np.inf:
                expected = "strength=... (--strength N), in N, above 0, and no section"
                raise ResultError(f"the curve '{law.name}' is of ranges of tension\n    expected: {expected}")
            return np.asarray(tension.s), fatigue.damage(tension.values, law, concentration / strength)
        if section is None or strength is not None or len(section) != 3 or not all(0.0 < x < np.inf for x in section):
            fix = "section=(area m2, outer diameter m, Young's modulus Pa), --section A,D,E, and no strength"
            raise ResultError(f"the curve '{law.name}' is of ranges of stress\n    try:      {fix}")
        bends = _bends(self, times, at)
        found = []
        for k in range(FIBRES):
            angle = 2.0 * np.pi * k / FIBRES
            about = np.cos(angle) * bends[..., 0] + np.sin(angle) * bends[..., 1]
            stress = fatigue.stress_of(tension.values, about, *Section(*section))
            found.append(fatigue.damage(stress, law, concentration))
        return np.asarray(tension.s), np.max(found, axis=0)


def _bends(result: Result, times: Window | None, at: Any) -> Floats:
    """Curvature (nt, n, 2) 1/m about two axes across the mean tangent at the places of `history_of`."""
    a, b = _window(times)
    found = bends_of(result, (result["t"] >= a) & (result["t"] <= b))
    return (found if at is None else found.at(at)).across()


def lies_along(result: Result, name: str) -> bool:
    """Whether a quantity has a value at every arc length."""
    whole, _ = component_of(result, name)
    known = ALIASES.get(whole, whole)
    return known in result and result.dims(known)[1:2] == ("s",)


def _one(history: History) -> History:
    """The same as one history, of two values at one place the one that ranges more; ResultError if it is several."""
    values = history.values.reshape(history.values.shape[0], -1)
    if history.s is not None and values.shape[1] == 2 and history.s[0] == history.s[1]:
        return history._replace(values=values[:, int(np.ptp(values, axis=0).argmax())])
    if values.shape[1] != 1:
        fix = "at=..., an arc length in m" if history.s is not None else "a quantity with one value"
        fix = f"{history.name}.x, a component" if values.shape[1] == len(AXES) else fix
        raise ResultError(f"'{history.name}' has {values.shape[1]} values at a time\n    try:      {fix}")
    return history._replace(values=values[:, 0])
