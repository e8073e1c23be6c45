"""Study and design files: a scene, what varies, and what is kept or sought.

A study varies numbers of a scene and keeps results of each run; a design seeks numbers for what the equilibrium has to
be.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag

from hybrid.scene.base import (
    Before,
    Finding,
    Findings,
    Number,
    Positive,
    Table,
    Text,
    Truth,
    Whole,
    Words,
    refuse,
    table_or_list,
)
from hybrid.scene.read import Kind

# Cases of a study: each is a row in memory.
MOST_CASES = 1_000_000
# Columns of the table of cases that a variable must not be called.
TAKEN = ("case", "status", "reason", "events", "accuracy_verdict", "accuracy_used", "cpu", "steps", "s")

_NAME = re.compile(r"[A-Za-z_]\w*")


def _is_value(value: Any) -> Any:
    if isinstance(value, bool | int | float | str) or (
        isinstance(value, list | tuple | dict) and not isinstance(value, str)
    ):
        return value
    refuse([Finding((), "a value that the key can have", "a number, a word, a list or a table")])
    raise AssertionError


Value = Annotated[Any, Before(_is_value), Words("a value that the key can have")]
Values = Annotated[tuple[Value, ...], Field(min_length=1)]
Names = Annotated[tuple[Text, ...], Field(min_length=1)]


class Range(Table):
    """Values of a key of the scene.

    A list, evenly spaced from one to another, or between two bounds in a sample; none where a table of cases has them.
    """

    key: Text | None = Field(
        default=None, description="key of the scene, such as cable.sections[0].mass; absent: the name of the variable"
    )
    keys: Names | None = Field(default=None, description="several keys that get the same value")
    values: Values | None = Field(default=None, description="its values, one after the other")
    begin: Number | None = Field(default=None, alias="from", description="first of evenly spaced values")
    end: Number | None = Field(default=None, alias="to", description="last of evenly spaced values")
    step: Positive | None = Field(default=None, description="distance of evenly spaced values")
    count: Annotated[Whole, Field(ge=1, le=MOST_CASES)] | None = Field(
        default=None, description="number of evenly spaced values"
    )
    low: Number | None = Field(default=None, description="of a sample: lowest value")
    high: Number | None = Field(default=None, description="of a sample: highest value")
    unit: Text | None = Field(default=None, description="its unit, for tables and axes")

    def _check_one_way(self) -> Findings:
        ways = {
            "values": self.values is not None,
            "from, to": self.begin is not None or self.end is not None,
            "low, high": self.low is not None or self.high is not None,
        }
        given = [name for name, there in ways.items() if there]
        if len(given) > 1:
            yield [Finding((), f"one of {', '.join(ways)}; not {' and '.join(given)}", "values: [1, 2, 3]")]
        if "from, to" in given:
            if self.begin is None or self.end is None or (self.step is None) == (self.count is None):
                yield [Finding((), "from, to, and one of step and count", "{from: 8, to: 14, step: 2}")]
            elif not self.end >= self.begin:
                yield [Finding(("to",), f"a number >= from, {self.begin:g}")]
            elif self.count == 1 and self.end > self.begin:
                yield [Finding(("count",), "2 or more, from one number to another")]
        elif self.step is not None or self.count is not None:
            yield [Finding(("step" if self.step is not None else "count",), "nothing, without from and to")]
        if "low, high" in given and (self.low is None or self.high is None or not self.high > self.low):
            yield [Finding(("high",), "low and high, the second above the first", "{low: 1, high: 3}")]
        if self.key is not None and self.keys is not None:
            yield [Finding(("keys",), "nothing, because key is given", "list it among the keys")]

    def listed(self) -> list[Any] | None:
        """Its values; None: of a sample, or of a table of cases."""
        if self.values is not None:
            return list(self.values)
        if self.begin is None or self.end is None:
            return None
        if self.count is not None:
            width = (self.end - self.begin) / max(self.count - 1, 1)
            found = [self.begin + k * width for k in range(self.count)]
        else:
            assert self.step is not None
            number = int((self.end - self.begin) / self.step + 1e-9) + 1
            found = [self.begin + k * self.step for k in range(number)]
        whole = all(float(x).is_integer() for x in (self.begin, self.end, *found))
        return [int(x) if whole else float(f"{x:.12g}") for x in found]


class Sample(Table):
    """A sample of variables between bounds."""

    method: Literal["sobol", "latin_hypercube", "saltelli", "morris"] = Field(
        description="how the sample fills the space of its variables; saltelli and morris are designs for sensitivity: "
        "indices of Sobol, and elementary effects"
    )
    count: Annotated[Whole, Field(ge=1, le=MOST_CASES)] = Field(
        description="number of cases; of sobol and saltelli a power of two; saltelli has (variables + 2) times as many "
        "cases, morris (variables + 1) times"
    )
    seed: Annotated[Whole, Field(ge=0)] = Field(default=0, description="seed of its random numbers")

    def _check_power_of_two(self) -> Findings:
        if self.method in ("sobol", "saltelli") and self.count & (self.count - 1):
            near = 1 << (self.count.bit_length() - 1)
            yield [Finding(("count",), f"a power of two, for {self.method}", f"{near} or {2 * near}")]


MOMENTS = "max", "min", "mean", "median", "deviation", "skewness", "period", "significant"
TAKES = (*MOMENTS, "extreme", "fractile", "damage", "exceedance", "utilisation", "history", "profile")


# Limits of sections that quantities are held against in `utilisation`.
LIMIT_OF = {"tension": "max_tension", "curvature": "min_bend_radius"}


class Kept(Table):
    """What is kept of one quantity of each run."""

    quantity: Text = Field(description="a quantity of the result, such as tension or end_force_end")
    line: Text | None = Field(
        default=None, description="of which line, by its name; absent: of what stands beside the lines"
    )
    at: (
        Annotated[
            Annotated[Number, Tag("<table>")] | Annotated[tuple[Number, ...], Field(min_length=1), Tag("<list>")],
            Discriminator(table_or_list),
        ]
        | None
    ) = Field(default=None, description="arc length, or several; absent: the worst along the line [m]")
    take: Annotated[tuple[Literal[TAKES], ...], Field(min_length=1)] = Field(  # type: ignore[valid-type]
        default=("max",),
        description="what of its history: max, min, mean, median, deviation (standard deviation), "
        "skewness, period, significant, extreme (most probable maximum, MPM, in `hours`), fractile (P90 of that "
        "maximum), damage, exceedance (part of the time above `above`, or below `below`), utilisation (part of "
        "max_tension or of min_bend_radius that is used), history, profile (max along s)",
    )
    times: tuple[Number, Number] | None = Field(default=None, description="only from one time to another [s]")
    hours: Positive = Field(default=3.0, description="of extreme and fractile [h]")
    above: Number | None = Field(default=None, description="of exceedance: the value, in the unit of the quantity")
    below: Number | None = Field(default=None, description="of exceedance: the value below which it is, or above")
    curve: Text | None = Field(default=None, description="of damage: a curve of fatigue")
    strength: Positive | None = Field(default=None, description="of damage by a T-N curve: reference strength [N]")
    section: tuple[Positive, Positive, Positive] | None = Field(
        default=None, description="of damage by an S-N curve: area m2, outer diameter m, Young's modulus Pa"
    )

    def _check_of_limits(self) -> Findings:
        if int("exceedance" in self.take) != sum(x is not None for x in (self.above, self.below)):
            expected = "a value with take: [exceedance], above or below, and nothing without"
            yield [Finding(("above",), expected, "above: 5.0e+4")]
        if "utilisation" in self.take:
            if self.quantity not in LIMIT_OF:
                expected = "tension or curvature, which sections have limits of"
                yield [Finding(("quantity",), expected, "quantity: tension")]
            if self.at is not None or self.times is not None:
                key = "at" if self.at is not None else "times"
                yield [Finding((key,), "nothing: utilisation is the largest of all places and steps")]

    def _check_of_damage(self) -> Findings:
        if ("damage" in self.take) != (self.curve is not None):
            yield [Finding(("curve",), "a curve of fatigue with take: [damage], and nothing without", "D sea")]
        if self.curve is not None and self.quantity != "tension":
            yield [Finding(("quantity",), "tension, of which damage is (with bending, where a section is given)")]
        if self.curve is None and (self.strength or self.section):
            yield [Finding(("strength" if self.strength else "section",), "nothing, without take: [damage]")]


class Study(Table):
    """A scene, what is varied in it, and what is kept of each run."""

    title: Text = Field(default="", description="one line that names it")
    scene: Text = Field(description="the scene file, relative to the study file")
    static: Truth = Field(default=False, description="equilibria alone, no motion")
    vary: dict[str, Range] = Field(default_factory=dict, description="variables by name: which key, which values")
    combine: Literal["grid", "zip"] = Field(
        default="grid", description="grid: every value with every other; zip: first with first, second with second"
    )
    sample: Sample | None = Field(default=None, description="a sample of the variables that have low and high")
    cases: Text | None = Field(
        default=None,
        description="CSV file of cases, relative to the study file; its columns are keys of the scene or "
        "names of variables in `vary` without values",
    )
    carry: tuple[Text, ...] = Field(
        default=(),
        description="columns of the table of cases that are no keys, such as probabilities: kept beside the results",
    )
    only_if: Text | None = Field(
        default=None, description="condition on variables; other cases are left out, such as Hs < 0.1 * Tp**2"
    )
    derive: dict[str, Text] = Field(default_factory=dict, description="columns computed from variables, by name")
    collect: dict[str, Kept] | None = Field(
        default=None, description="what is kept of each run, by name; absent: largest tension, end forces, curvature"
    )
    files: Truth = Field(
        default=False, description="keep the whole result of every case, too: STUDY.files/case-000000.h5 and so on"
    )

    def _check_contradictions(self) -> Findings:
        found = []
        for name in (*self.derive, *(self.collect or ())):
            if not _NAME.fullmatch(name) or name in TAKEN:
                table = "derive" if name in self.derive else "collect"
                found.append(Finding((table, name), "a name of letters and digits, none of " + ", ".join(TAKEN)))
        for name, each in self.vary.items():
            if each.key is None and each.keys is None:
                continue
            if not _NAME.fullmatch(name) or name in TAKEN:
                found.append(Finding(("vary", name), "a name of letters and digits, none of " + ", ".join(TAKEN)))
        sampled = [name for name, each in self.vary.items() if each.low is not None]
        empty = [name for name, x in self.vary.items() if x.low is None and x.listed() is None]
        if empty and self.cases is None:
            expected = "values; from and to; or low and high; or a table of cases with a column of this name"
            found += [Finding(("vary", name), expected, "values: [1, 2, 3]") for name in empty]
        if sampled and self.sample is None:
            fix = "sample: {method: latin_hypercube, count: 50}"
            found.append(Finding(("sample",), f"a sample, because {', '.join(sampled)} has low and high", fix))
        if self.sample is not None and not sampled:
            found.append(Finding(("sample",), "variables with low and high", "vary: {EI: {key: .., low: 1, high: 3}}"))
        if self.carry and self.cases is None:
            found.append(
                Finding(("carry",), "a table of cases, of which columns are carried along", "cases: cases.csv")
            )
        if not self.vary and self.cases is None:
            found.append(Finding(("vary",), "variables, or a table of cases", "vary: {Hs: {key: .., values: [2, 4]}}"))
        lengths = {name: len(each.listed() or ()) for name, each in self.vary.items() if each.listed() is not None}
        if self.combine == "zip" and len(set(lengths.values())) > 1:
            sizes = ", ".join(f"{name} {n}" for name, n in lengths.items())
            found.append(Finding(("combine",), f"lists of equal length to zip ({sizes})", "combine: grid"))
        yield found


def _wrapped(data: Any) -> Any:
    """The same with lists of values in `vary` as tables: `seed: [1, 2]` is `seed: {values: [1, 2]}`."""
    vary = data.get("vary") if isinstance(data, Mapping) else None
    if not isinstance(vary, Mapping):
        return data
    return {**data, "vary": {k: {"values": x} if isinstance(x, list | tuple) else x for k, x in vary.items()}}


STUDY = Kind(Study, "study", "what is varied", "studies.md", ("scene", "cases"), _wrapped)


def read_study(path: str | Path) -> Study:
    """Read a study file; paths in it become absolute.  SceneError with every complaint, with line and column."""
    return STUDY.read(path).asked


def study_from(data: Mapping[str, Any], folder: str | Path = ".") -> Study:
    """A study from Python data; files in it are relative to `folder`."""
    return STUDY.of_data(data, folder).asked


NAMED = "a name of letters and digits, of which an expression can speak"
# Names in expressions that are functions and numbers.
SPOKEN_FOR = ("pi", "sqrt", "exp", "log", "sin", "cos", "tan", "radians", "abs", "min", "max", "round")
MOTION = "over: max, for example: what of its history in a run"


Where = Annotated[
    Annotated[Number, Tag("<number>")] | Annotated[Literal["start", "end"], Tag("<end>")],
    Discriminator(lambda x: "<end>" if isinstance(x, str) else "<number>"),
]


class Unknown(Table):
    """A number of the scene that is sought."""

    usual: ClassVar[tuple[str, ...]] = ("key", "low", "high")

    key: Text | None = Field(
        default=None, description="key of the scene, such as cable.sections[0].length; absent: the name of the unknown"
    )
    keys: Names | None = Field(default=None, description="several keys that get the same value")
    low: Number | None = Field(default=None, description="its lower bound; absent: it keeps its sign")
    high: Number | None = Field(default=None, description="its upper bound")
    start: Number | None = Field(default=None, description="where the search begins; absent: the number of the scene")

    def _check_bounds(self) -> Findings:
        if self.key is not None and self.keys is not None:
            yield [Finding(("keys",), "nothing, because key is given", "list it among the keys")]
        if self.low is not None and self.high is not None and not self.high > self.low:
            yield [Finding(("high",), f"a number above low, {self.low:g}")]
        if self.start is not None:
            low, high = (x if x is not None else self.start for x in (self.low, self.high))
            if not low <= self.start <= high:
                yield [Finding(("start",), f"a number from low to high, {low:g} to {high:g}")]

    def keys_of(self, name: str) -> tuple[str, ...]:
        """The keys that it sets; name: its own."""
        return self.keys or (self.key or name,)


class OfEquilibrium(Table):
    """A number of an equilibrium."""

    usual: ClassVar[tuple[str, ...]] = ("quantity",)
    instead: ClassVar[dict[str, str]] = {"in": MOTION, "range": "section: 0, for example, or at: 120"}

    quantity: Text = Field(
        description="what: all that `hybrid static` records, such as tension, curvature, position.z, reaction_end.x"
    )
    line: Text | None = Field(default=None, description="which line, by its name")
    at: Where | None = Field(default=None, description="arc length, start or end; absent: the most along the line [m]")
    section: Annotated[Whole, Field(ge=0)] | None = Field(
        default=None, description="only along this section, counted from 0"
    )
    over: Literal["max", "min", "mean", "std", "last"] | None = Field(
        default=None, description="of the motion: what of its outputs; absent: of the equilibrium"
    )

    def _check_one_place(self) -> Findings:
        if self.at is not None and self.section is not None:
            yield [Finding(("section",), "nothing, because a place is given by at")]
        if self.section is not None and self.over not in (None, "max", "min"):
            yield [Finding(("over",), "max or min along the section", "over: max")]
        if re.search(r"[@ /]", self.quantity):
            yield [Finding(("quantity",), "a quantity alone, such as tension or position.z", "at and line say where")]


class OneResult(OfEquilibrium):
    """A number of an equilibrium that has to be something, or of which an expression speaks."""

    take: Literal["max", "min"] | None = Field(
        default=None, description="of what has no place given by `at`: the largest or the smallest along the line"
    )
    case: Text | None = Field(default=None, description="in which case, where there are several")

    def _check_one_number(self) -> Findings:
        if self.at is not None and self.take is not None:
            yield [Finding(("take",), "nothing, because a place is given by at")]
        if self.over is not None and self.take is not None:
            yield [Finding(("take",), "nothing: over says it, of the whole line where no place is given")]
        if self.section is not None and self.take is None and self.over is None:
            yield [Finding(("take",), "max or min along the section", "take: max")]


class Aim(OneResult):
    """What a number of an equilibrium has to be."""

    usual: ClassVar[tuple[str, ...]] = ("quantity", "at", "value")

    value: Number = Field(description="what it is to be, in the unit of the quantity")


class Limit(OfEquilibrium):
    """Between what a number of an equilibrium has to stay."""

    usual: ClassVar[tuple[str, ...]] = ("quantity", "largest")

    largest: Number | None = Field(default=None, description="what it may be at most, in the unit of the quantity")
    smallest: Number | None = Field(default=None, description="what it may be at least, in the unit of the quantity")
    cases: Names | None = Field(default=None, description="in which cases; absent: in all of them")

    def _check_a_limit(self) -> Findings:
        if self.largest is None and self.smallest is None:
            yield [Finding((), "largest, smallest, or both", "largest: 1.35e+5")]
        if self.largest is not None and self.smallest is not None and not self.largest > self.smallest:
            yield [Finding(("largest",), f"a number above smallest, {self.smallest:g}")]


class Measured(Table):
    """What was measured of the equilibrium, or of the motion."""

    file: Text = Field(
        description="CSV file, relative to the design file: a column s (m), columns of quantities such as tension, or "
        "x, y, z of the position; of a motion a column t (s); where lines have names a column line, with several "
        "cases a column case"
    )
    at: Where | None = Field(
        default=None, description="in place of a column s: arc length, start or end, where all of it was measured [m]"
    )
    deviation: Positive | None = Field(
        default=None,
        description="standard deviation of what was measured, in its unit; absent: by how much it "
        "scatters about what is found",
    )
    deviations: dict[str, Positive] = Field(
        default_factory=dict, description="the same of columns, by name, where they have others"
    )


Changes = Annotated[dict[str, Value], Words("a table of keys of the scene and their values")]


class Design(Table):
    """A scene, the numbers of it that are sought, and what its equilibrium has to be."""

    title: Text = Field(default="", description="one line that names it")
    scene: Text = Field(description="the scene file, relative to the design file")
    unknowns: dict[str, Unknown] = Field(min_length=1, description="the numbers that are sought, by name")
    cases: dict[str, Changes] = Field(
        default_factory=dict, description="what else the scene is, by name: keys and their values; limits hold in all"
    )
    results: dict[str, OneResult] = Field(
        default_factory=dict, description="numbers of equilibria of which `minimise` speaks, by name"
    )
    targets: dict[str, Aim] = Field(default_factory=dict, description="what numbers have to be, by name")
    limits: dict[str, Limit] = Field(default_factory=dict, description="between what numbers have to stay, by name")
    minimise: Text | None = Field(
        default=None, description="arithmetic of unknowns and results that is to be as small as can be"
    )
    measured: Measured | None = Field(
        default=None, description="instead of all these: what was measured, from which unknowns are found"
    )

    def _check_contradictions(self) -> Findings:
        found, taken = [], [*SPOKEN_FOR]
        for table in ("unknowns", "results"):
            for name in getattr(self, table):
                spoken = _NAME.fullmatch(name) is not None
                if name in taken:
                    found.append(Finding((table, name), f"a name of its own, none of {', '.join(taken)}"))
                elif not spoken and (table == "results" or self.unknowns[name].key or self.unknowns[name].keys):
                    found.append(Finding((table, name), NAMED))
                taken.append(name)
        given = [x for x in ("results", "targets", "limits", "minimise") if getattr(self, x)]
        if self.measured is not None:
            found += [Finding((x,), "nothing, because unknowns are found from what was measured") for x in given]
        elif not {*given} - {"results"}:
            fix = "minimise: ..., targets: ..., limits: ... or measured: ..."
            found.append(Finding((), "what is asked of the scene", fix, given="nothing to reach"))
        elif self.minimise is None and self.results:
            found.append(Finding(("results",), "minimise, which speaks of them", "targets have values of their own"))
        for table, name, case in self._cases_named():
            if case not in self.cases:
                known = f"one of: {', '.join(self.cases)}" if self.cases else "nothing, because there are no cases"
                found.append(Finding((table, name, "case" if table != "limits" else "cases"), known))
        if len(self.cases) > 1:
            for table in ("results", "targets"):
                for name, each in getattr(self, table).items():
                    if each.case is None:
                        expected = f"the case in which it is meant, one of: {', '.join(self.cases)}"
                        found.append(Finding((table, name, "case"), expected))
        yield found

    def _cases_named(self) -> list[tuple[str, str, str]]:
        """Tables, entries, and the cases that they name."""
        single: list[tuple[str, Mapping[str, OneResult]]] = [("results", self.results), ("targets", self.targets)]
        named = [(table, name, x.case) for table, all_ in single for name, x in all_.items() if x.case is not None]
        return [*named, *(("limits", name, case) for name, x in self.limits.items() for case in x.cases or ())]


DESIGN = Kind(Design, "design", "what is sought in it", "design.md", ("scene", "measured.file"))
