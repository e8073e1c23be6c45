"""What a ladder of runs has found: rows of error and cost, which of them are worth having, and the pages that say so.

Costs are seconds of processor time, errors are measured against the reference; nothing here computes a cable.
docs/trade.md
"""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

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


# What rows and tables were called in 0.5.
_FORMER = {
    name: name.replace("pull", "end_force")
    for name in ("pull", "pull_part", "estimate_pull", "effectivity_pull", "largest_pull", "bound_pull")
} | {"asked_for": "target"}


class _Renamed:
    """Attributes under their former names, with a warning."""

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name not in _FORMER or not hasattr(self, _FORMER[name]):
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            warnings.warn(f"{name} is now {_FORMER[name]}", DeprecationWarning, stacklevel=2)
            return getattr(self, _FORMER[name])


@dataclass(frozen=True)
class Row(_Renamed):
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
class TradeTable(_Renamed):
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
