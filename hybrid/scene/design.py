"""The design file: a scene, the numbers of it that are sought, and what its equilibrium has to be."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.base import Finding, Number, Positive, Table, Text, Whole, Words, refuse
from hybrid.scene.read import Kind
from hybrid.scene.study import Names, Value

_NAME = re.compile(r"[A-Za-z_]\w*")
NAMED = "a name of letters and digits, of which an expression can speak"
# Names in expressions that are functions and numbers.
SPOKEN_FOR = ("pi", "sqrt", "exp", "log", "sin", "cos", "tan", "radians", "abs", "min", "max", "round")
MOTION = "over: max, for example: what of its history in a run"


def _place_kind(value: Any) -> str:
    return "<end>" if isinstance(value, str) else "<number>"


Where = Annotated[
    Annotated[Number, Tag("<number>")] | Annotated[Literal["start", "end"], Tag("<end>")], Discriminator(_place_kind)
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

    @model_validator(mode="after")
    def _bounds(self) -> Self:
        if self.key is not None and self.keys is not None:
            refuse([Finding(("keys",), "nothing, because key is given", "list it among the keys")])
        if self.low is not None and self.high is not None and not self.high > self.low:
            refuse([Finding(("high",), f"a number above low, {self.low:g}")])
        if self.start is not None:
            low, high = (x if x is not None else self.start for x in (self.low, self.high))
            if not low <= self.start <= high:
                refuse([Finding(("start",), f"a number from low to high, {low:g} to {high:g}")])
        return self

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

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if self.at is not None and self.section is not None:
            refuse([Finding(("section",), "nothing, because a place is given by at")])
        if self.section is not None and self.over not in (None, "max", "min"):
            refuse([Finding(("over",), "max or min along the section", "over: max")])
        if re.search(r"[@ /]", self.quantity):
            refuse([Finding(("quantity",), "a quantity alone, such as tension or position.z", "at and line say where")])
        return self


class OneResult(OfEquilibrium):
    """A number of an equilibrium that has to be something, or of which an expression speaks."""

    take: Literal["max", "min"] | None = Field(
        default=None, description="of what has no place given by `at`: the largest or the smallest along the line"
    )
    case: Text | None = Field(default=None, description="in which case, where there are several")

    @model_validator(mode="after")
    def _one_number(self) -> Self:
        if self.at is not None and self.take is not None:
            refuse([Finding(("take",), "nothing, because a place is given by at")])
        if self.over is not None and self.take is not None:
            refuse([Finding(("take",), "nothing: over says it, of the whole line where no place is given")])
        if self.section is not None and self.take is None and self.over is None:
            refuse([Finding(("take",), "max or min along the section", "take: max")])
        return self


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

    @model_validator(mode="after")
    def _a_limit(self) -> Self:
        if self.largest is None and self.smallest is None:
            refuse([Finding((), "largest, smallest, or both", "largest: 1.35e+5")])
        if self.largest is not None and self.smallest is not None and not self.largest > self.smallest:
            refuse([Finding(("largest",), f"a number above smallest, {self.smallest:g}")])
        return self


class Measured(Table):
    """What was measured of the equilibrium, or of the motion."""

    file: Text = Field(
        description="CSV file, relative to the design file: a column s (m), columns of quantities such as tension, or "
        "x, y, z of the position; of a motion a column t (s); where lines have names a column line, with several "
        "cases a column case"
    )  # fmt: skip
    at: Where | None = Field(
        default=None, description="in place of a column s: arc length, start or end, where all of it was measured [m]"
    )
    deviation: Positive | None = Field(
        default=None, description="standard deviation of what was measured, in its unit; absent: by how much it "
        "scatters about what is found",
    )  # fmt: skip
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

    @model_validator(mode="after")
    def _contradictions(self) -> Self:
        refuse(self._findings())
        return self

    def _findings(self) -> list[Finding]:
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
        return found

    def _cases_named(self) -> list[tuple[str, str, str]]:
        """Tables, entries, and the cases that they name."""
        single: list[tuple[str, Mapping[str, OneResult]]] = [("results", self.results), ("targets", self.targets)]
        named = [(table, name, x.case) for table, all_ in single for name, x in all_.items() if x.case is not None]
        return [*named, *(("limits", name, case) for name, x in self.limits.items() for case in x.cases or ())]


DESIGN = Kind(Design, "design", "what is sought in it", "design.md", ("scene", "measured.file"))
