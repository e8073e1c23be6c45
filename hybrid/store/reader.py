"""Read what a run has written: `open_result("run.h5")` gives a `Result`.

Arrays are those of `StoredResult`, read when they are asked for, once; what follows from them is computed here.
"""

from __future__ import annotations

import html
import io
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.statistics import extremes, fatigue, moments
from hybrid.store.capacity import mooring_use
from hybrid.store.envelope import Judged, Pressed, contacts_of
from hybrid.store.format import MemoryTarget
from hybrid.store.hdf5_file import is_held
from hybrid.store.histories import (
    FIBRES,
    Section,
    Window,
    bends_at,
    extreme_of,
    history_of,
    lies_along,
    one_history,
    summary_of,
    usual_names,
)
from hybrid.store.stored_result import StoredResult
from hybrid.store.verdicts import Verdicts, section_limits, verdicts_of
from hybrid.store.whole_file import LateFile

if TYPE_CHECKING:
    import xarray

Floats = np.ndarray


class Result(StoredResult):
    """The recorded answer of one run.

    Arrays have the output times first: `position` is (nt, ns, 3).  `units`, `describe` and `dims` say what each
    is.  Use `refresh` to see what a running computation has added since.
    """

    def contacts(self) -> list[Pressed]:
        """What presses on the line by name, or which of several lines press on each other: largest forces at outputs.

        Of each its `partner`, `force` (N, over all places) at `t_force` (s), `contact` (N/m) at `t_contact` (s), and
        the `group` in which the result has these over time.
        """
        return contacts_of(self)

    def statistics(
        self, names: Sequence[str] | None = None, *, times: Window | None = None, at: Any = None
    ) -> dict[str, moments.Summary]:
        """Summaries of histories, each of the shape of the quantity at one time.

        Mean, standard deviation, skewness, extremes with their times, period between up-crossings of the mean,
        significant range, number of cycles.
        names: None for end forces, tension, curvature, bending moment, torque, contact force, and what the scene asks
        for, where the result has them at all outputs; times: from and to, s; at: arc lengths, m, None: all output
        points.  A quantity along the line has a value at each place of `both_sides(name)[0]`: where it jumps, one
        before and one after.
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
        self, name: str, *, at: float | None = None, duration: float = extremes.THREE_HOURS,
        threshold: float | None = None, times: Window | None = None, smallest: bool = False,
        probability: float = extremes.FRACTILE,
    ) -> extremes.Extreme:  # fmt: skip
        """The largest (or smallest) value that a time of `duration` (s) brings, by peaks over a threshold of a history.

        at: arc length (m), of a quantity along the line; threshold: in the unit of the quantity, None: nine tenths of
        the peaks are below it.  ResultError with too few peaks, of what is round-off, and where the law leads beyond
        what an angle can be.
        """
        history = one_history(history_of(self, name, times, at))
        return extreme_of(
            self, name, history.unit, history.t, history.values, duration,
            threshold=threshold, smallest=smallest, probability=probability,
        )  # fmt: skip

    def exceedance(
        self, name: str, above: float | None = None, *, below: float | None = None, at: Any = None,
        times: Window | None = None,
    ) -> Floats:  # fmt: skip
        """Part of the time for which a history is above a value, or below one.

        above, below: one of them, in the unit of the quantity; at, times: as of `statistics`.  The answer has the shape
        of the quantity at one time.  ResultError: both or none is given, or no number.
        """
        if (above is None) is (below is None):
            raise ResultError("exceedance\n    expected: one of above and below, in the unit of the quantity")
        value = above if below is None else below
        if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
            key = "above" if below is None else "below"
            raise ResultError(f"{key}: expected a number in the unit of {name!r}, found {value!r:.60}")
        history = history_of(self, name, times, at)
        return moments.exceedance(history.t, history.values, above, below)

    def utilisation(self) -> dict[str, Judged]:
        """Utilisation of each limit of the line's sections over all steps and outputs, by key.

        `used` is the part of max_tension or min_bend_radius that was used, None of min_tension and of what is not
        verified; `verdict` is within, broken or not verified, with `why` and `remedy`; at s (m) and t (s).
        ResultError of a result of several lines: each has its own.
        """
        if self.lines:
            first = next(iter(self.lines))
            raise ResultError(
                f"utilisation of a result with the lines {', '.join(self.lines)}\n"
                f"    expected: that of one line\n    try:      result.lines[{first!r}].utilisation()"
            )
        return {found.limit: found for found in section_limits(self)}

    def mooring(self, strength: float, factors: tuple[float, ...], pretension: Any) -> tuple[Floats, Floats, Floats]:
        """Utilisation of a mooring line by DNV-OS-E301 (July 2021), (T_pre g_pre + (T - T_pre) g_env)/S.

        Returns arc lengths (n,) m, the utilisation at the outputs (nt, n), and that of the largest tension over all
        steps and outputs (n,).
        strength: S, N; factors: g_pre, g_env, by class and limit state, without default; pretension: T_pre, N, or the
        result of an equilibrium under it, `hybrid.static` without current.  ResultError: of another line.
        """
        return mooring_use(self, strength, factors, pretension)

    def verdicts(self) -> Verdicts:
        """Verdicts on limits and on the accuracy, each with its reason and remedy.

        Limits of sections and of quantities are within or broken, an accuracy that was asked for is met or missed, or
        they are not verified.  Of several lines each has its own, and the result those of quantities of all.
        """
        return verdicts_of(self)

    def spectrum(
        self, name: str, *, at: Any = None, times: Window | None = None, segment: float | None = None
    ) -> moments.Spectrum:
        """The spectrum of a history by Welch's method; segment: s, None: an eighth of the record."""
        history = history_of(self, name, times, at)
        return moments.welch(history.t, history.values, segment)

    def damage(
        self, curve: str | Mapping[str, Any] | fatigue.Curve, *, strength: float | None = None,
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
        bends = bends_at(self, times, at)
        found = []
        for k in range(FIBRES):
            angle = 2.0 * np.pi * k / FIBRES
            about = np.cos(angle) * bends[..., 0] + np.sin(angle) * bends[..., 1]
            stress = fatigue.stress_of(tension.values, about, *Section(*section))
            found.append(fatigue.damage(stress, law, concentration))
        return np.asarray(tension.s), np.max(found, axis=0)

    def to_xarray(
        self,
        *,
        names: Sequence[str] | None = None,
        times: tuple[float | None, float | None] | None = None,
        at: Any = None,
    ) -> xarray.Dataset:
        """Everything as one Dataset of xarray: over t and s, with units; a slash in a name becomes an underscore.

        names: fields or groups, None for all; times: from and to, s; at: arc lengths, m, in place of the output grid.
        """
        from hybrid.store.selection import dataset, part_of

        return dataset(part_of(self, names, times, at))

    def _ipython_display_(self) -> None:
        """Show the card and the cable in space in a notebook; elsewhere IPython takes one of the other ways."""
        import_module("hybrid.view.report").show(self)  # by name: the store imports no view

    def _repr_html_(self) -> str:
        """What a notebook shows; of a result that cannot be drawn, what a terminal shows."""
        try:
            return str(import_module("hybrid.view.report").card(self))  # by name: the store imports no view
        except Exception:  # a cell must never fail because its result is closed, empty or odd
            try:
                return f"<pre>{html.escape(repr(self))}</pre>"
            except Exception:
                return "<pre>a result that can no longer be read</pre>"


def open_result(source: str | Path | bytes | io.BytesIO) -> Result:
    """Open a result file, or one in memory.

    A file that another process is writing, or that was left by a killed one, opens too,
    with the outputs that were complete.  ResultError when it is not a result.
    """
    source = io.BytesIO(source) if isinstance(source, bytes) else source
    if isinstance(source, io.BytesIO):
        return Result(source)
    path = Path(source).expanduser().resolve()
    is_held(path)  # which removes the lock that a killed process has left
    return Result(path)


def written_result(source: Path | io.BytesIO | MemoryTarget, late: LateFile | None = None) -> Result:
    """Open a result that this process has written just now, without holding its bytes against their sum.

    late: the last file that was written in one go: where that is the source, its arrays are in memory.
    """
    if late is None or late.path != source or not late.may_stay():
        return Result(source, summed=False)
    return Result(source, contents=late.contents)
