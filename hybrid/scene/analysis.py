"""What is to be done with the cable: where it starts, model, mesh, how long, what is kept, how accurately."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from itertools import accumulate, pairwise
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AliasChoices, Discriminator, Field, Tag

from hybrid.errors import Complaint
from hybrid.scene.base import (
    After,
    Before,
    Direction,
    Finding,
    Findings,
    Kinds,
    NonNegative,
    NonNegativePair,
    Number,
    Pair,
    Positive,
    Renamed,
    Table,
    Truth,
    Vector,
    Whole,
    Words,
    decimal_comma,
    number_or_list,
    refuse,
    unwrap,
)
from hybrid.scene.quantities import Quantities

_RATIO = "length of the last cell over the length of the first, geometric grading; absent: 1 [-]"


def _increasing(values: tuple[float, ...]) -> bool:
    return all(a < b for a, b in pairwise(values))


def _doubled(points: tuple[tuple[float, float, float], ...]) -> list[Finding]:
    """The points of a polyline that repeat the one before."""
    total = sum(math.dist(a, b) for a, b in pairwise(points))
    same = [i for i, (a, b) in enumerate(pairwise(points), start=1) if math.dist(a, b) <= 1e-9 * total]
    return [Finding(("points", i), "a point other than the one before", "leave it out") for i in same]


def _disordered(s: tuple[float, ...], count: int) -> Iterator[Finding]:
    """Arc lengths of the corners of a polyline that are too few or many, or do not rise from 0."""
    if len(s) != count:
        yield Finding(
            ("arc_lengths",), f"{count} arc lengths (m), one for each point", "give one for each", f"{len(s)}"
        )
    elif s[0] != 0.0:
        yield Finding(("arc_lengths", 0), "0, the start of the cable", "write 0")
    else:
        bad = [i for i, (a, b) in enumerate(pairwise(s), start=1) if b <= a]
        yield from (Finding(("arc_lengths", i), f"more than {s[i - 1]:.8g} m", "sort them") for i in bad[:1])


# --- where the cable starts --------------------------------------------------------------------


class Straight(Table):
    """The cable starts straight and unstretched.

    It starts at a held start, or ends at a held end; without either, `origin` is where s = 0 is.
    """

    kind: Literal["straight"] = Field(default="straight", description="straight, unstretched")
    direction: Direction = Field(description="direction of increasing s, inertial frame; any length [-]")
    origin: Vector | None = Field(
        default=None, description="position of s = 0, inertial frame; needed only if no end is held [m]"
    )
    velocity: Vector | None = Field(
        default=None, description="velocity of the whole cable at t = 0, inertial frame; absent: at rest [m/s]"
    )


class Points(Table):
    """The cable starts along a polyline, at rest: spread evenly over it, or stretched as arc lengths say."""

    kind: Literal["points"] = Field(default="points", description="along a polyline")
    points: tuple[Vector, ...] = Field(
        min_length=2, description="corners of the polyline from s = 0 to s = length, inertial frame [m]"
    )
    arc_lengths: tuple[NonNegative, ...] | None = Field(
        default=None,
        description="unstretched arc lengths s of the corners, from 0 to the length of the cable, so that it starts "
        "stretched as it hangs; absent: in proportion to the polyline [m]",
    )

    def _check_corners_are_distinct(self) -> Findings:
        yield _doubled(self.points)
        if self.arc_lengths is not None:
            yield _disordered(self.arc_lengths, len(self.points))

    @property
    def knots(self) -> tuple[float, ...]:
        """Arc lengths of the corners (m), or what they are in proportion to."""
        return self.arc_lengths or (0.0, *accumulate(math.dist(a, b) for a, b in pairwise(self.points)))


class Equilibrium(Table):
    """The cable starts at rest in static equilibrium."""

    kind: Literal["equilibrium"] = Field(default="equilibrium", description="static equilibrium")
    guess: Literal["auto", "catenary", "arc", "straight", "span"] = Field(
        default="auto",
        description="shape to start the search from: catenary (hanging between the ends, with the seabed), arc, span "
        "(straight between the ends), straight in a direction, or auto (catenary between two ends, else straight)",
    )
    direction: Direction | None = Field(
        default=None, description="direction of increasing s of a straight guess, inertial frame; any length [-]"
    )
    points: tuple[Vector, ...] | None = Field(
        default=None,
        min_length=2,
        description="instead of guess: corners of a polyline from s = 0 to s = length to start from, "
        "inertial frame [m]",
    )

    friction: Annotated[Literal["neglected", "settled"] | None, Renamed({"left_out": "neglected"})] = Field(
        default=None,
        description="on a seabed and on obstacles with friction: neglected (the equilibrium without it, where there is "
        "one, which is one with it as well: of a line that was laid under tension), or settled (guess auto or "
        "catenary: laid there in still water without tension, then pulled tight against friction; a given shape, or "
        "where that fails: the line comes to rest from its first shape); absent: settled on a bed with guess auto "
        "or catenary, but neglected, with an event that says so, of a line that lies on obstacles, is paid out, may "
        "touch a line, a body or what moves, or is not found so",
    )

    def _check_one_guess(self) -> Findings:
        if self.points is not None:
            fix = "leave out either points or guess and direction"
            both = [name for name, given in (("guess", self.guess != "auto"), ("direction", self.direction)) if given]
            yield (Finding((name,), "nothing, because points already gives the shape", fix) for name in both)
            yield _doubled(self.points)
        elif self.direction is not None and self.guess not in ("auto", "straight"):
            expected = f"nothing, because a direction is for a straight guess and guess is {self.guess}"
            yield [Finding(("direction",), expected, "leave direction out, or use guess: straight")]


def without_friction(initial: Straight | Points | Equilibrium) -> Straight | Points | Equilibrium:
    """The same with friction neglected, unless the scene says how it settles."""
    if initial.kind != "equilibrium" or initial.friction is not None:
        return initial
    return initial.model_copy(update={"friction": "neglected"})


Initial = Annotated[Straight | Points | Equilibrium, Kinds(usual=("equilibrium",))]

# The same of a line of several, whose keys without a kind are of the search of the equilibrium.
_OF_SEARCH = tuple((key, "equilibrium") for key in ("points", "guess", "direction", "friction"))
LineInitial = Annotated[Straight | Points | Equilibrium, Kinds(usual=("equilibrium",), implied=_OF_SEARCH)]


# --- which model where -------------------------------------------------------------------------


class RodZone(Table):
    """A stretch with bending and torsion."""

    rod: Positive = Field(description="unstretched length of this rod zone [m]")
    cells: Whole | None = Field(default=None, ge=1, description="number of cells; absent: chosen [-]")
    ratio: Positive | None = Field(default=None, description=_RATIO)


class CatenaryZone(Table):
    """A stretch that carries tension only."""

    catenary: Positive = Field(description="unstretched length of this catenary zone [m]")
    cells: Whole | None = Field(default=None, ge=1, description="number of cells; absent: chosen [-]")
    ratio: Positive | None = Field(default=None, description=_RATIO)


_ZONES: dict[str, type[Table]] = {"rod": RodZone, "catenary": CatenaryZone}


def _zone_tag(value: Any) -> str:
    for kind, table in _ZONES.items():
        if kind in value if isinstance(value, Mapping) else isinstance(value, table):
            return f"<{kind} zone>"
    return "<catenary zone>"


def _one_zone_kind(value: Any) -> Any:
    """Every zone has one of the keys rod, catenary: the key is its kind and the value its length."""
    if isinstance(value, RodZone | CatenaryZone):
        return value
    fix = "write {rod: length} or {catenary: length}"
    if not isinstance(value, Mapping):
        refuse([Finding((), "a zone", fix)])
    kinds = [kind for kind in _ZONES if kind in value]
    if len(kinds) != 1:
        refuse([Finding((), "either rod or catenary, with the length of the zone in m", fix)])
    return value


Zone = Annotated[
    Annotated[RodZone, Tag("<rod zone>")] | Annotated[CatenaryZone, Tag("<catenary zone>")],
    Discriminator(_zone_tag),
    Before(_one_zone_kind),
]

Slack = Literal["stop", "warn"]
_SLACK = "what to do when a catenary zone loses its tension: stop, or warn and go on"


class RodModel(Table):
    """The whole cable is a Kirchhoff rod."""

    kind: Literal["rod"] = Field(default="rod", description="bending and torsion everywhere: a beam")


class CatenaryModel(Table):
    """The whole cable is perfectly flexible."""

    kind: Literal["catenary"] = Field(default="catenary", description="tension only: a string")
    slack: Slack = Field(default="stop", description=_SLACK)


class ZonesModel(Table):
    """Rod and catenary zones in a row, spherical joints between them."""

    kind: Literal["zones"] = Field(default="zones", description="rod and catenary zones: a hybrid")
    zones: tuple[Zone, ...] = Field(min_length=1, description="zones in order from s = 0 on; they fill the cable")
    slack: Slack = Field(default="stop", description=_SLACK)


def _are_stretches(value: Any) -> Any:
    if isinstance(value, list | tuple) and value and all(isinstance(unwrap(x), int | float) for x in value):
        pair = ", ".join(str(unwrap(x)) for x in value)
        refuse([Finding((), "a list of stretches [s_a, s_b], in m", f"write [[{pair}]]")])
    return value


Stretches = Annotated[tuple[NonNegativePair, ...], Field(min_length=1), Before(_are_stretches)]


class AdaptiveModel(Table):
    """Zones that follow the physics: rod where bending, torsion or slack ask for it, catenary elsewhere."""

    instead: ClassVar[Mapping[str, str]] = {
        "joint": "leave it out: a joint between rod and catenary passes no moment (spherical)",
        "correct": "leave it out: `output: {errors: true}` says what bending would change, a smaller tolerance makes "
        "more of the line rod",
    }
    asked_nothing: ClassVar[Mapping[str, Any]] = {"joint": "spherical", "correct": False}

    kind: Literal["adaptive"] = Field(default="adaptive", description="zones that move by themselves")
    tolerance: Positive | None = Field(
        default=None,
        le=0.1,
        description="error of position that leaving bending out may make, as a part of the length of the cable; "
        "absent: 1e-3, or what accuracy leaves for it [-]",
    )
    rod_cell: Positive | None = Field(
        default=None,
        description="with curvature_error: the shortest cells of rods; absent: an eighth of (EI/w)^(1/3), w the "
        "weight, or less for a curvature_error below 10 % [m]",
    )
    curvature_error: Positive | None = Field(
        default=None,
        le=0.5,
        description="part of the largest curvature that the length of rod cells may make it wrong by, anywhere: "
        "cells become shorter and longer during the run where they are needed; absent: they have one length [-]",
    )
    hold_time: Positive | None = Field(
        default=None,
        validation_alias=AliasChoices("hold_time", "dwell"),
        description="time for which criteria must stay below their limits before a rod becomes catenary; "
        "absent: chosen, and with curvature_error it stays a rod [s]",
    )
    force_rod: Stretches | None = Field(
        default=None,
        validation_alias=AliasChoices("force_rod", "always_rod"),
        description="stretches [s_a, s_b] that are always rod [m]",
    )
    force_catenary: Stretches | None = Field(
        default=None,
        validation_alias=AliasChoices("force_catenary", "always_catenary"),
        description="stretches [s_a, s_b] that are always catenary [m]",
    )
    always_move: Truth = Field(
        default=False,
        description="zones move even where rods or catenaries everywhere are predicted to cost less; any other key of "
        "this table asks for that too",
    )

    def _check_cells_follow(self) -> Findings:
        if self.rod_cell is not None and self.curvature_error is None:
            expected = "nothing, because rods and catenaries have the cells of one mesh, which stay"
            fix = "leave it out and give mesh.cells or mesh.nodes, or write curvature_error for cells that follow"
            yield [Finding(("rod_cell",), expected, fix)]


def usual_model(cable: Any, obstacles: Any = None) -> RodModel | CatenaryModel | AdaptiveModel:
    """The model of a scene that names none: zones that move, if the cable can bend; a rod, if they cannot hold it."""
    sections = getattr(cable, "sections", ())
    if not any(x.initial_bending is not None for x in sections):
        return CatenaryModel()
    stays = any(x.anisotropic or x.turns or x.curve is not None for x in sections)
    return RodModel() if stays or obstacles else AdaptiveModel()


Model = Annotated[
    RodModel | CatenaryModel | ZonesModel | Annotated[AdaptiveModel, Before(AdaptiveModel.without_former)],
    Kinds(
        usual=("adaptive", "rod", "catenary"),
        implied=(
            ("zones", "zones"),
            *((key, "adaptive") for key in (*AdaptiveModel.model_fields, *AdaptiveModel.former) if key != "kind"),
        ),
        gone=(("corrected", "write catenary: with `output: {errors: true}` it says what bending would change"),),
    ),
]


class Mesh(Table):
    """How the cable is cut into cells: `cells` with `ratio`, or `nodes`."""

    cells: Whole | None = Field(
        default=None, ge=2, description="number of cells (elements, segments); absent: chosen [-]"
    )
    ratio: Positive | None = Field(default=None, description=_RATIO)
    nodes: tuple[Number, ...] | None = Field(
        default=None, min_length=3, description="arc length of every node, from 0 to the length of the cable [m]"
    )

    def _check_one_recipe(self) -> Findings:
        if self.nodes is not None:
            fix = "leave out either nodes or cells and ratio"
            both = [name for name in ("cells", "ratio") if getattr(self, name) is not None]
            found = [Finding((name,), "nothing, because nodes already gives the mesh", fix) for name in both]
            if not _increasing(self.nodes):
                found.append(
                    Finding(("nodes",), "numbers that increase strictly, in m", "sort them and drop duplicates")
                )
            yield found


class Resolution(Table):
    """How fine a mesh is that the program places: for experts, beside `accuracy` or without."""

    cells_per_layer: Positive = Field(
        ge=1,
        le=50,
        description="rod cells to a length sqrt(EI/T), over which bending fades beside clamps, joints and point loads, "
        "in the first result; a coarse run before it shows T and where the cable bends; base cells, where cells follow "
        "the curvature; without this table 3 times the fineness of `accuracy`, which is 0.4 to 1.5 at 1% [-]",
    )


# --- how long, and what is kept ----------------------------------------------------------------


# Steps that change need some damping of what they do not resolve (tests/solve/test_time_control.py).
LEAST_DAMPED = 0.9


class Time(Table):
    """How long to compute, in which steps."""

    duration: Positive = Field(description="time at which the computation ends; it starts at 0 [s]")
    step: Positive | None = Field(
        default=None,
        description="fixed time step dt, shortened so that a whole number fits into the duration; with a tolerance, "
        "the largest; absent: steps follow the motion [s]",
    )
    tolerance: Positive | None = Field(
        default=None,
        description="error of position that one time step may make: steps follow it; absent: chosen for `accuracy`, "
        "if there is no step [m]",
    )
    rho_inf: Number = Field(
        default=0.5, ge=0, le=1, description="spectral radius of generalized-alpha at high frequency; 1: no damping [-]"
    )

    def _check_step_fits(self) -> Findings:
        if self.step is not None and self.step > self.duration:
            expected = f"at most the duration, {self.duration:.6g} s"
            yield [Finding(("step",), expected, "a smaller step or a longer duration")]
        if self.controlled and self.rho_inf > LEAST_DAMPED:
            expected = f"at most {LEAST_DAMPED:g} where steps follow the motion: above, steps that change are unstable"
            yield [Finding(("rho_inf",), expected, "0.5 is usual; or give a fixed step (time.step)")]

    @property
    def controlled(self) -> bool:
        """Whether steps follow the motion."""
        return self.step is None or self.tolerance is not None


OutputPoints = Annotated[
    Annotated[Whole, Field(ge=2, le=1_000_000), Tag("<number>")]  # a million points fill 160 MB at every output
    | Annotated[tuple[NonNegative, ...], Field(min_length=1), Tag("<list>")],
    Discriminator(number_or_list),
]


# Outputs of a run that does not say how often, at least; of the shortest period of its waves and motions, as of steps.
OUTPUTS, PER_PERIOD = 100, 6
# Numbers that a result has per point and output, some twenty, and the most bytes of a file that nobody has asked for.
VALUES, UNASKED_BYTES = 20, 2e8
EVERY = (
    f"time between outputs; absent: a hundredth of the duration, or a sixth of the shortest period of waves and "
    f"motions, as far as the file has less than {UNASKED_BYTES / 1e6:g} MB, but no more than one a step [s]"
)


def missing_time() -> Complaint:
    """The complaint of a consumer that computes motion and finds no `time` in the scene."""
    return Complaint(
        where="time",
        value="nothing",
        expected="a table with duration and step, in s, to compute motion",
        fix="add `time: {duration: ..., step: ...}`; for the equilibrium alone: hybrid static FILE, or "
        "hybrid.static(scene) in Python",
    )


class Output(Table):
    """What is kept."""

    every: Positive | None = Field(default=None, description=EVERY)
    points: OutputPoints = Field(
        default=101,
        description="number of output points, evenly spread, or a list of their arc lengths; points of `history`, "
        "point loads, changes of section and joints are added [m]",
    )
    history: tuple[NonNegative, ...] | None = Field(
        default=None, min_length=1, description="arc lengths that plots follow over time [m]"
    )

    elevation: tuple[Pair, ...] | None = Field(
        default=None, min_length=1, description="places [x, y] at which the elevation of the sea is recorded [m]"
    )
    quantities: Quantities = Field(
        default={},
        description="further quantities over time by name: forces and angles at ends, touchdown, layback, clearance",
    )
    exact: Truth = Field(
        default=False,
        description="steps end at outputs; else an output within a step is interpolated in time, to second order",
    )
    criteria: Truth = Field(
        default=False,
        description="also write the criteria of zones that move, as fields over time and arc length",
    )
    errors: Truth | None = Field(
        default=None,
        description="estimate how wrong the result is (mesh, time step, model) by coarser runs; absent: if accuracy is "
        "asked for, or steps follow the motion",
    )

    def _check_points_increase(self) -> Findings:
        places: Any = self.points
        lines = places.items() if isinstance(places, dict) else [("", places)]  # of several lines by name
        expected, fix = "arc lengths that increase strictly, in m", "sort them and drop duplicates"
        for name, x in lines:
            if isinstance(x, tuple) and not _increasing(x):
                yield [Finding(("points", name) if name else ("points",), expected, fix)]


# --- how accurately: a part (`1%`) or a size with its unit (`3 cm`, `50 N`), for named outputs ------------

# Units in which a size may be given, what they measure, and how much of the SI unit they are.
UNITS = {
    "%": ("part", 0.01),
    "mm": ("position", 1e-3),
    "cm": ("position", 1e-2),
    "m": ("position", 1.0),
    "N": ("tension", 1.0),
    "kN": ("tension", 1e3),
    "MN": ("tension", 1e6),
}
_AMOUNT = re.compile(r"\s*([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(%|[a-zA-Z]+)\s*")
# Beyond a tenth nothing is computed that deserves the name; below a millionth round-off of long runs begins to show.
ROUGHEST, FINEST = 0.1, 1e-6
USUAL = "1%"  # of a scene that requests nothing and leaves its steps open
# What may be asked as a part of its largest alone.
ALONG = "curvature", "bending_moment", "line_tension"
# Of curvature and line_tension: that it is not asked, where `all` would ask for it.
NOT_ASKED = "none"
_EXAMPLES = "a part or a size, such as 1%, 3 cm or 50 N"


def amount(text: str) -> tuple[str, float]:
    """What `text` measures ("part", "position" or "tension") and how much of it, SI."""
    found = _AMOUNT.fullmatch(text)
    if found is None or found[2] not in UNITS:
        refuse([Finding((), _EXAMPLES, _advice(text))])
        raise AssertionError
    what, unit = UNITS[found[2]]
    size = float(found[1]) * unit
    if not size > 0.0:
        refuse([Finding((), f"{_EXAMPLES}, more than zero", "1% is usual")])
    if what == "part" and not FINEST <= size <= ROUGHEST:
        refuse([Finding((), f"between {100 * FINEST:g}% and {100 * ROUGHEST:g}%", "1% is usual")])
    return what, size


def _advice(text: str) -> str:
    """What to write instead."""
    if re.fullmatch(r"\s*[0-9]+,[0-9]+\s*\S+\s*", text):
        return decimal_comma(text)
    return f"a number with a unit: {', '.join(UNITS)}; for two outputs {{position: 3 cm, tension: 50 N}}"


def _is_text(value: Any) -> Any:
    if isinstance(value, str):
        return value
    number = isinstance(value, int | float) and not isinstance(value, bool) and FINEST <= value <= ROUGHEST
    fix = f"write {100 * value:g}%, or a size with its unit" if number else "write 1%, or a size with its unit"
    refuse([Finding((), _EXAMPLES, fix)])
    raise AssertionError


def _checked(text: str) -> str:
    amount(text)
    return text.strip()


def _checked_or_none(text: str) -> str:
    return NOT_ASKED if text.strip() == NOT_ASKED else _checked(text)


Amount = Annotated[str, Before(_is_text), After(_checked), Words(_EXAMPLES)]
AmountOrNone = Annotated[str, Before(_is_text), After(_checked_or_none), Words(f"{_EXAMPLES}, or {NOT_ASKED}")]


class Accuracy(Table):
    """How wrong a result may be; step, mesh and the thresholds of zones follow from it, unless the scene gives them."""

    all: Amount | None = Field(
        default=None,
        description="what `accuracy: 2%` stands for, a part: of how far the line moves, for positions (at rest of its "
        "sag; never finer than half its diameter, never coarser than that part of its length); of the largest tension, "
        "for the tension along the line and the force at both ends; of the largest curvature where `model: rod` (but "
        "in jonswap waves) or pipe.max_stress names bending; what is named beside it takes precedence",
    )
    position: Amount | None = Field(
        default=None, description="of every output point: a part of the length of the cable, or mm, cm, m"
    )
    tension: Amount | None = Field(
        default=None,
        description="of the force at both ends: a part of the largest, or N, kN",
    )

    curvature: AmountOrNone | None = Field(
        default=None,
        description="of every output point: a part of the largest curvature, such as 5%; none: `all` does not ask it",
    )
    bending_moment: Amount | None = Field(
        default=None, description="of every output point: a part of the largest bending moment, such as 5%"
    )
    line_tension: AmountOrNone | None = Field(
        default=None,
        description="of the tension at every output point: a part of the largest, such as 2%; none: `all` does not "
        "ask it",
    )
    instant: Amount | None = Field(
        default=None,
        description="as `accuracy: 1%`, of every output also where the motion is irregular (jonswap waves, or values "
        "that do not converge); absent: extremes and standard deviations are judged there",
    )

    def _check_units_fit(self) -> Findings:
        found = []
        for name in ("position", "tension"):
            text = getattr(self, name)
            if text is not None and amount(text)[0] not in ("part", name):
                other = f"{amount(text)[0]}: {text}"
                found.append(Finding((name,), f"a part (%) or a size in {_units(name)}", f"write {other}"))
        for name in ("all", *ALONG):
            text = getattr(self, name)
            if text not in (None, NOT_ASKED) and amount(text)[0] != "part":
                what = "of what moves, of tensions" if name == "all" else f"of the largest {name.replace('_', ' ')}"
                found.append(Finding((name,), f"a part (%) {what}", "1%" if name == "all" else "5%"))
        if {getattr(self, name) for name in ("all", "position", "tension", *ALONG)} <= {None, NOT_ASKED}:
            names = f"all, position, tension, {', '.join(ALONG[:-1])} or {ALONG[-1]}"
            found.append(Finding((), names, "accuracy: 1% stands for {all: 1%}"))
        yield found


def of_length(text: str) -> str | dict[str, str]:
    """`1%` as a part of the length and of the end forces, by name; a size, and what is none, as it is."""
    found = _AMOUNT.fullmatch(text)
    return {"position": text, "tension": text} if found is not None and found[2] == "%" else text


def of_unnamed_model(accuracy: Accuracy, stressed: bool) -> Accuracy:
    """The same, of a line that is rod although its scene does not name a model.

    `all` asks for curvature where that is held against a stress, and else for none.
    """
    if accuracy.all is None or accuracy.curvature is not None:
        return accuracy
    return accuracy.model_copy(update={"curvature": accuracy.all if stressed else NOT_ASKED})


def _units(name: str) -> str:
    return ", ".join(unit for unit, (what, _) in UNITS.items() if what == name)


def expand(value: Any) -> Any:
    """`1%` for {all: 1%}; `3 cm` for a position and `50 N` for a tension; `instant` likewise."""
    if isinstance(value, Mapping):
        instant = value.get("instant")
        if not isinstance(instant, str) or (found := _AMOUNT.fullmatch(instant)) is None or found[2] not in UNITS:
            return value  # the table complains of it
        return {**_each(instant), **value}
    if value is None or isinstance(value, Accuracy):
        return value
    return _each(_is_text(value))


def _each(text: str) -> dict[str, str]:
    """The quantity that an amount stands for."""
    what, _ = amount(text)
    return {"all" if what == "part" else what: text}


AskedAccuracy = Annotated[Accuracy, Before(expand)]
