"""Tables of what runs amount to: statistics of a result, and what a ladder of runs has found.

Statistics are rows that `hybrid stats` prints and a report shows.  A ladder has rows of error and cost, which of them
are worth having, and the pages that say so.  Costs are seconds of processor time, errors are measured against the
reference; nothing here computes a cable.
docs/trade.md
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import ResultError, renamed
from hybrid.statistics.extremes import THREE_HOURS
from hybrid.statistics.moments import exceedance, summary
from hybrid.store.capacity import CODE_NAME as CODE_USED
from hybrid.store.capacity import NAME as CAPACITY_USED
from hybrid.store.envelope import extreme
from hybrid.store.histories import Window, components_of, extreme_of, history_of, lies_along, summary_of, usual_names
from hybrid.store.limits import at_every_step, capacity_of, code_of
from hybrid.store.reader import Result

# --- statistics of a result --------------------------------------------------------------------

# Part of the largest value at the outputs by which that of every step must be above it to be worth a note.
WORTH_A_NOTE = 0.01


def rows_of(
    result: Result,
    names: Sequence[str] | None = None,
    at: Sequence[float] | None = None,
    times: Window | None = None,
    duration: float = THREE_HOURS,
    above: float | None = None,
    below: float | None = None,
) -> list[dict[str, Any]]:
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
    by = {"tension": 1.0}
    if section is not None:
        by = {"tension": 1.0 / section[0], "curvature": 0.5 * section[2] * section[1]}
    for name, stress in by.items():
        if f"errors/total/{name}" not in result:
            return float("inf")
        figure, value = (np.array(result[x])[there, k] for x in (f"errors/total/{name}", name))
        error += stress * float(np.sqrt(np.mean(figure**2)))
        varies += (stress * float(value.std())) ** 2
    return error / max(float(np.sqrt(varies)), 1e-300)


def life_within(
    result: Result,
    facts: Mapping[str, Any],
    curve: Any,
    strength: float | None,
    section: Sequence[float] | None,
    times: Any,
) -> dict[str, Any]:
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


# --- error against cost ------------------------------------------------------------------------

OURS = "hybrid"
# What became of a run.  The reference, and the run that shows how converged it is, are rows like others, but no choice.
DONE = "done"
MISSED = "missed"
FAILED = "failed"
REFERENCE = "reference"
CHECK = "check"
# Of two runs, one asked for a third of the error of the other and both in proportion to what they were asked, the
# finer is wrong by half of their difference: e and 3e are 2e apart.
OF_DIFFERENCE = 0.5


@dataclass(frozen=True)
class Row:
    """One run.

    Errors are the largest over all outputs, lines and points (position) or both ends (end force); parts are of the
    length of each line and of its largest end force; estimates are the run's own.  None: there is no such figure.
    """

    code: str
    model: str
    asked: str  # the accuracy; of another program its settings
    status: str
    cause: str = ""
    position: float | None = None  # m
    position_part: float | None = None
    end_force: float | None = None  # N
    end_force_part: float | None = None
    estimate_position: float | None = None  # m
    estimate_end_force: float | None = None  # N
    cells: int | None = None
    steps: int | None = None
    runs: int | None = (
        None  # that went into it: coarser ones to compare with, and finer ones until it met what was asked
    )
    cpu: float | None = None  # s, of the whole process, from the scene to the result
    effort_cpu: float | None = None  # s, as the result says
    key: str = ""

    pull, pull_part = renamed("pull", "end_force"), renamed("pull_part", "end_force_part")
    estimate_pull = renamed("estimate_pull", "estimate_end_force")
    effectivity_pull = renamed("effectivity_pull", "effectivity_end_force")

    @property
    def effectivity_position(self) -> float | None:
        """The run's own estimate over the error."""
        return _over(self.estimate_position, self.position)

    @property
    def effectivity_end_force(self) -> float | None:
        """The run's own estimate over the error."""
        return _over(self.estimate_end_force, self.end_force)

    @property
    def is_choice(self) -> bool:
        """Whether it is a run that one could have made instead of another."""
        return self.status in (DONE, MISSED) and self.cpu is not None and self.position is not None

    @property
    def name(self) -> str:
        """Model and accuracy, or code and settings."""
        return f"{self.model if self.code == OURS else self.code} {self.asked}"


_NAMED = {"position": "position", "end_force": "end force"}
DERIVED = ("effectivity_position", "effectivity_end_force")
COLUMNS = (*(field.name for field in fields(Row)), *DERIVED)


def _over(a: float | None, b: float | None) -> float | None:
    return a / b if a is not None and b else None


def pareto(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Of points (cost, error), which are on the front: no other is as good in both and better in one."""
    return [not any(c <= cost and e <= error and (c < cost or e < error) for c, e in points) for cost, error in points]


@dataclass(frozen=True)
class TradeTable:
    """What was asked, what it is compared with, and the rows.

    bound_position (m), bound_end_force (N): what `target` comes to, None: it does not ask for that; of a part, for the
    longest line and the largest end force.
    """

    title: str
    target: str
    length: float  # m, of the longest line
    largest_end_force: float | None  # N, at the ends, of the reference
    bound_position: float | None
    bound_end_force: float | None
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()  # machine, date, versions, command
    missing: int = 0  # runs that an interruption has left undone

    asked_for, bound_pull = renamed("asked_for", "target"), renamed("bound_pull", "bound_end_force")
    largest_pull = renamed("largest_pull", "largest_end_force")

    @property
    def reference(self) -> Row:
        """The run that all others are compared with."""
        return next(row for row in self.rows if row.status == REFERENCE)

    @property
    def check(self) -> Row | None:
        """The same model, asked for three times the error."""
        return next((row for row in self.rows if row.status == CHECK), None)

    @property
    def choices(self) -> list[Row]:
        """Runs that came to an end and can be compared."""
        return [row for row in self.rows if row.is_choice]

    def doubt(self, name: str) -> float:
        """Error of the reference, "position" (m) or "end_force" (N): its own figure, or the check's if that is more."""
        check = getattr(self.check, name) if self.check else None
        return max(getattr(self.reference, f"estimate_{name}") or 0.0, OF_DIFFERENCE * (check or 0.0))

    def held_error(self, row: Row, name: str, asked: str) -> float | None:
        """Error (m or N) to hold against a bound; where a part is asked, the largest part of all lines."""
        error, part = getattr(row, name), getattr(row, f"{name}_part")
        whole = self.length if name == "position" else self.largest_end_force
        return part * whole if asked.strip().endswith("%") and part is not None and whole else error

    def score(self, row: Row) -> float:
        """Error over what is asked for, of the quantity where that is largest: at 1 or less it is met."""
        bounds = {"position": self.bound_position, "end_force": self.bound_end_force}
        pairs = ((self.held_error(row, name, self.target), bound) for name, bound in bounds.items())
        return max((error / bound for error, bound in pairs if error is not None and bound), default=0.0)

    def front(self) -> list[Row]:
        """Rows of which no other is cheaper and nearer to what is asked for, the cheapest first."""
        rows = self.choices
        on = pareto([(row.cpu or 0.0, self.score(row)) for row in rows])
        return sorted((row for row, good in zip(rows, on, strict=True) if good), key=lambda row: row.cpu or 0.0)

    @property
    def recommended(self) -> Row | None:
        """Of our rows that met what is asked for the cheapest; None: none did."""
        good = [row for row in self.choices if row.code == OURS and self.score(row) <= 1.0]
        return min(good, key=lambda row: (row.cpu or 0.0, self.score(row)), default=None)

    @property
    def recommendation(self) -> str:
        """The same in a sentence."""
        best, left = self.recommended, f" ({self.missing} runs are missing)" if self.missing else ""
        if best is None:
            near = min((row for row in self.choices if row.code == OURS), key=self.score, default=None)
            nearest = f"; {near.name} comes nearest, with {self.score(near):.3g} times this error" if near else ""
            return f"No run met {self.target}{nearest}{left}."
        cpu = best.cpu or 0.0
        asked = f"{{position: {best.asked}, tension: {best.asked}}}" if best.asked.endswith("%") else best.asked
        text = f"For {self.target} use model {best.model} with accuracy {asked}: {cpu:.3g} s of CPU time"
        rods = [r for r in self.choices if (r.code, r.model) == (OURS, "rod") and self.score(r) <= 1.0]
        rod = min(rods, key=lambda row: row.cpu or 0.0, default=None)
        if rod is not None and rod != best:
            text += f", {(rod.cpu or 0.0) / cpu:.2g} times less than a rod everywhere (accuracy {rod.asked})"
        wrong = [f"{best.position:.3g} m"] if best.position is not None else []
        wrong += [f"{best.end_force:.3g} N"] if best.end_force is not None else []
        return f"{text}, error {' and '.join(wrong)}{left}."

    # ---- pages ------------------------------------------------------------------------------------

    def csv(self) -> str:
        """All rows, a column for every figure, SI units."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow([*COLUMNS, "score", "pareto", "recommended"])
        front, best = self.front(), self.recommended
        for row in self.rows:
            figures = [_plain(getattr(row, name)) for name in COLUMNS]
            score = _plain(self.score(row)) if row.is_choice else ""
            writer.writerow([*figures, score, int(row in front), int(row == best)])
        return out.getvalue()

    def markdown(self, picture: str = "", level: int = 1) -> str:
        """The page: how it was measured, what to take, the table, notes; picture: its name, for a link."""
        lines = [f"{'#' * level} {self.title or 'A cable'}", "", f"**{self.recommendation}**", ""]
        if picture:
            lines += [f"![error against CPU time]({picture})", ""]
        lines += [*self._table(), "", self._converged(), ""]
        lines += [*(f"- {note}" for note in self.notes), ""] if self.notes else []
        lines += ["| measured with | |", "|---|---|", *(f"| {what} | {_cell(said)} |" for what, said in self.facts), ""]
        return "\n".join(lines)

    def _table(self) -> list[str]:
        head = ["run", "status", "position", "of length", "estimate", "end force", "of largest", "estimate"]
        head += ["cells", "steps", "runs", "CPU", ""]
        lines = ["| " + " | ".join(head) + " |", "|---|---|" + "---:|" * 10 + "---|"]
        front, best = self.front(), self.recommended
        for row in self.rows:
            mark = "**recommended**" if row == best else "Pareto front" if row in front else ""
            status = row.status + (f": {row.cause}" if row.cause else "")
            cells = [row.name, status]
            for name, unit in (("position", "m"), ("end_force", "N")):
                cells += self._error(row, name, unit)
            cells += [_count(row.cells), _count(row.steps), _count(row.runs), _unit(row.cpu, "s"), mark]
            lines.append("| " + " | ".join(_cell(x) for x in cells) + " |")
        return lines

    def _error(self, row: Row, name: str, unit: str) -> list[str]:
        """Error, its part, and the run's estimate with its effectivity; ≲: no more than the error of the reference."""
        error, part = getattr(row, name), getattr(row, f"{name}_part")
        estimate, ratio = getattr(row, f"estimate_{name}"), getattr(row, f"effectivity_{name}")
        vague = error is not None and error < self.doubt(name)
        said = _unit(estimate, unit) + (f" (× {ratio:.2g})" if ratio and not vague else "")
        about = "≲ " if vague else ""
        return [about + _unit(error, unit), about + (f"{100 * part:.2g} %" if part is not None else ""), said]

    def _converged(self) -> str:
        """How right the reference is."""
        row, check = self.reference, self.check
        text = f"Reference: {row.name}, {_count(row.cells)} cells, {_count(row.steps)} steps"
        own = [_unit(x, u) for x, u in ((row.estimate_position, "m"), (row.estimate_end_force, "N")) if x is not None]
        text += f"; its own error estimate is {' and '.join(own)}" if own else "; it has no error estimate"
        if check is not None and check.position is not None:
            apart = [_unit(x, u) for x, u in ((check.position, "m"), (check.end_force, "N")) if x is not None]
            text += f"; {check.name} differs from it by {' and '.join(apart)}"
        if row.cause:
            text += f". It missed its accuracy: {row.cause}"
        return text + ". Errors marked ≲ are below the error of the reference: they are upper bounds."

    def write(self, folder: Path, picture: str = "") -> list[Path]:
        """trade.csv and trade.md in the folder."""
        table, page = folder / "trade.csv", folder / "trade.md"
        table.write_text(self.csv(), encoding="utf-8")
        page.write_text(self.markdown(picture), encoding="utf-8")
        return [table, page]


def judged(table: TradeTable, bounds: Sequence[tuple[float | None, float | None]]) -> TradeTable:
    """Runs whose errors exceed what each was asked for, (m, N), become "missed", and say by how much.

    What the reference itself may be wrong by counts for them: a run is blamed only for what is its own.
    """
    rows = []
    for row, bounds_of_row in zip(table.rows, bounds, strict=True):
        over = []
        for name, most in zip(_NAMED, bounds_of_row, strict=True):
            x, error = table.held_error(row, name, row.asked), getattr(row, name)
            if x and error and most and x - table.doubt(name) * (x / error) > most:
                over.append((x / most, name))
        worst, name = max(over, default=(0.0, ""))
        if row.status == DONE and over:
            estimate = getattr(row, f"estimate_{name}")
            knew = f", estimated {estimate:.2g}" if estimate is not None else ""
            row = replace(
                row, status=MISSED, cause=row.cause or f"{_NAMED[name]} error {worst:.2g} times the accuracy{knew}"
            )
        rows.append(row)
    return replace(table, rows=tuple(rows))


def _plain(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _unit(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.3g} {unit}"


def _count(value: int | None) -> str:
    return "" if value is None else str(value)


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").split())
