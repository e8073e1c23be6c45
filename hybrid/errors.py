"""What can go wrong, and what to do about it.

Two families.  Errors that a *person* can mend before anything is computed are
`SceneError`: they carry file, line, column, the value, what was expected and the
likely fix.  What goes wrong *while computing* is first a value (`Outcome`, an
integer that a compiled kernel can return) and becomes a `ComputationError` only
at the edge, with time, place, cause, remedy and the snapshot that was left.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from enum import IntEnum
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn


class HybridError(Exception):
    """Base of every error this package raises on purpose."""


@dataclass(frozen=True)
class Complaint:
    """One thing that is wrong with a scene.

    `where` is the path of the key (``cable.sections[0].mass``); `line` and `column`
    count from 1 and are None for scenes built without a file.
    """

    where: str
    value: str
    expected: str
    fix: str = ""
    line: int | None = None
    column: int | None = None

    def text(self, file: str = "") -> str:
        place = file or "scene"
        if self.line is not None:
            place += f":{self.line}"
            if self.column is not None:
                place += f":{self.column}"
        lines = [f"{place}: {self.where}", f"    given:    {self.value}", f"    expected: {self.expected}"]
        if self.fix:
            lines.append(f"    try:      {self.fix}")
        return "\n".join(lines)


class SceneError(HybridError):
    """The scene is refused; `complaints` holds every reason that was found."""

    def __init__(self, complaints: list[Complaint], file: str = "") -> None:
        self.complaints = complaints
        self.file = file
        super().__init__("\n".join(c.text(file) for c in complaints))


def refuse_value(where: str, given: str, expected: str, fix: str) -> NoReturn:
    """Refuse one value of a scene: its key, what it is, what was expected, what to try."""
    raise SceneError([Complaint(where, given, expected, fix)])


class ResultError(HybridError):
    """A result file cannot be written, opened or understood."""


class ResultHeld(ResultError):
    """Another process is writing the result file."""


def command_for(extra: str) -> str:
    """The command that installs an extra (pyproject.toml) beside the package that is there."""
    return f'pip install "hybrid-cable[{extra}]"'


def optional_package(package: str, what: str, extra: str) -> Any:
    """A package of an extra; ResultError with the command that installs it where it cannot be imported."""
    try:
        return import_module(package)
    except ImportError as error:
        raise ResultError(
            f"{what} needs the package '{package}', which cannot be imported\n"
            f"    detail:   {error}\n    try:      {command_for(extra)}"
        ) from error


class Outcome(IntEnum):
    """How one time step (or one static solve) ended."""

    OK = 0
    NOT_CONVERGED = 1
    NOT_FINITE = 2
    SINGULAR = 3
    SLACK = 4
    TURNED_TOO_FAR = 5
    UNSTABLE = 6
    GAINS_ENERGY = 7
    TWISTED_TOO_FAR = 8
    BURIED = 10
    OVERSTRETCHED = 11
    TURNS_LOST = 12
    WINCH_AT_END = 13
    FOLDED = 14
    COLLAPSED = 15
    NOT_REACHED = 16
    LEFT_PLANE = 17
    STOPPED = 18

    @property
    def cause(self) -> str:
        return _CAUSE[self]

    @property
    def remedy(self) -> str:
        return _REMEDY[self]


# Kinds of events that call a result into question, the worst first; other kinds are information.
EVENTS_BY_WEIGHT = (
    "gains energy",
    "implausible",  # a wrong unit, from which everything else may follow
    "slack line as rods",  # with a bending stiffness that nobody gave
    "bend radius below limit",
    "tension above limit",
    "tension below limit",
    "contact force above limit",
    "unresolved bend",
    "unresolved slack bend",
    "accuracy missed",
    "no error figure",
    "error uncertain",
    "several equilibria",
    "not converged",
    "largest force uncertain",
    "windows uncertain",
    "irregular motion",
    "snaps",
    "costly accuracy",
    "finer run not kept",
    "end force between outputs",
    "line meets itself",
    "lines pass through each other",
    "contact given up",
    "steps collapse",
    "loop can form",
    "slack",
    "compression",
    "unstable",
    "out of plane",
    "unresolved twist",
    "unresolved change of section",
    "kink at joint",
    "deep in the seabed",
    "deep in an obstacle",
    "unresolved contact",
    "numerical dissipation",
    "vibrations damped",
    "snap",
    "coarse step",
    "iterations cut",
    "steps cut",
    "torque neglected",
    "ignored",
    "undamped",
    "model error not estimated",
    "stability not judged",
    "bending at clamp neglected",
    "bending at point load neglected",
    "zones fixed",
    "static friction neglected",
    "bodies overlap",
    "body out of water",
    "pulled under",
    "waves on body neglected",
    "end rotated in",
    "envelope incomplete",
    "other program",
    "laid one way",
    "events omitted",
)


# Limits of a section by their keys in the scene, and the kinds of events where they are broken.
LIMIT_EVENTS = {
    "min_bend_radius": "bend radius below limit",
    "max_tension": "tension above limit",
    "min_tension": "tension below limit",
    "max_contact_force": "contact force above limit",
}
# Changes of zones: part of a normal run.
ZONE_EVENTS = ("split", "grow", "merge", "shrink", "retry")
# All kinds that are part of a normal run: changes of zones, what `resume`, `release_at`, `ramp` or `contact` asks for.
EXPECTED = (*ZONE_EVENTS, "loads change", "end released", "motion blended in", "lines touch")
# Kinds that, noted at t = 0, are of the whole run and not of its start.
OF_THE_RUN = frozenset({"implausible", "accuracy missed", "no error figure", "error uncertain", "costly accuracy"})
OF_THE_RUN |= {"largest force uncertain", "windows uncertain", "finer run not kept", "model error not estimated"}
OF_THE_RUN |= {"several equilibria", "not converged", "irregular motion", "snaps", "laid one way"}
OF_THE_RUN |= {"torque neglected", "static friction neglected", "ignored", "undamped", "zones fixed"}
OF_THE_RUN |= {"numerical dissipation", "model chosen", "slack line as rods"}
# How an event "ignored" begins that is about what an end bends the line by.
OF_AN_END = "moment and tangent at ends."
# Of an event "kink at joint": bends are too sharp by it, and not too mild.
KINK_COUNTS = "counts as a bend"
# Of an event "out of plane": the motion is right, because it is one in space from there on.
IN_SPACE = "it goes on in space"
# And of one whose line is pushed there: its way goes by that.
PUSHED = f"{IN_SPACE}, pushed by"
# In the texts of "error uncertain" of named quantities, which an attribute of the result has as well.
AS_MUCH = "finer cells and steps change as much as coarser ones did"
# Kind of the event of a run that another program had begun.
OTHER_PROGRAM = "other program"
# Kind of the event that gives the number (value) of events of another kind (criterion) that were not written.
OMITTED = EVENTS_BY_WEIGHT[-1]


def is_of_the_run(kind: str, t: float) -> bool:
    """Whether an event holds for the whole run, so that its time, s, says nothing."""
    return t == 0.0 and kind in OF_THE_RUN


def weight_of_event(kind: str) -> int:
    """Rank of a kind of event: 0 is the worst, news come last."""
    return EVENTS_BY_WEIGHT.index(kind) if kind in EVENTS_BY_WEIGHT else len(EVENTS_BY_WEIGHT)


_CAUSE = {
    Outcome.OK: "done",
    Outcome.NOT_CONVERGED: "Newton's method did not converge",
    Outcome.NOT_FINITE: "a number stopped being finite (NaN or infinity)",
    Outcome.SINGULAR: "the equations have no unique solution: something can move without resistance",
    Outcome.SLACK: "the line goes into compression; a catenary cannot carry it",
    Outcome.TURNED_TOO_FAR: "a cell turned, or spun against the next, by more than a radian in a step, however small",
    Outcome.GAINS_ENERGY: "the computation creates energy: as much as all the work done on the cable so far",
    Outcome.TWISTED_TOO_FAR: "the twist from one cell to the next nears half a turn, and could be its opposite",
    Outcome.UNSTABLE: "the only equilibrium found is unstable: the cable would buckle out of it",
    Outcome.BURIED: "the only equilibrium found lies deep in the seabed or in an obstacle",
    Outcome.TURNS_LOST: "the equilibrium found is not twisted by the turns asked for",
    Outcome.WINCH_AT_END: "the winch has no more line to pay out, or none to take in",
    Outcome.FOLDED: "the only equilibrium found has a fold: a rod turns by more than 90 deg from one cell to the next, "
    "and stands on it",
    Outcome.COLLAPSED: "steps have become so short that the run would not end",
    Outcome.NOT_REACHED: "what is asked of the scene is not reached from where the search began",
    Outcome.LEFT_PLANE: "it leaves the plane in which it lies at first",
    Outcome.OVERSTRETCHED: "the cable is stretched, or compressed, beyond what a section bears",
    Outcome.STOPPED: "a part of the user's own ends the run",
}

_REMEDY = {
    Outcome.OK: "",
    Outcome.NOT_CONVERGED: "make time.step smaller (larger, if near round-off), or add cells where the cable bends",
    Outcome.NOT_FINITE: "check the motion and the forces at this time; make time.step smaller",
    Outcome.SINGULAR: "hold an end, or give weight, force or bending stiffness; a straight strut needs a small bow",
    Outcome.SLACK: "make this stretch a rod zone (it needs bending_stiffness), or keep it taut",
    Outcome.TURNED_TOO_FAR: "look for a jump of force at this time; add damping or bending stiffness, or add cells",
    Outcome.GAINS_ENERGY: "make time.step or rho_inf smaller, give axial_stiffness, add cells where the cable folds, "
    "or give less stiffness_per_tension",
    Outcome.TWISTED_TOO_FAR: "add cells: each can take a twist of a quarter of a turn",
    Outcome.BURIED: "another start (initial.points); check stiffness and place of the bed and of obstacles",
    Outcome.TURNS_LOST: "add cells, hold the cable tauter, or turn the end in time (ends.*.motion), with damping",
    Outcome.WINCH_AT_END: "another winch.tension, a longer payout.longest, more cells, or a shorter time.duration",
    Outcome.LEFT_PLANE: "write `dimension: 3`, or leave dimension out",
    Outcome.NOT_REACHED: "wider limits or bounds, more unknowns, or another start",
    Outcome.COLLAPSED: "what cuts the steps has to go: see what the message names, and where",
    Outcome.STOPPED: "another scene, in which the part lets the run go on; or a run without the part",
    Outcome.OVERSTRETCHED: "check axial_stiffness (N), mass (kg/m), lengths (m), loads (N); max_strain is the limit",
    Outcome.FOLDED: "add cells where it bends (mesh), or begin nearer to the shape at rest (initial_guess)",
    Outcome.UNSTABLE: "start from another shape (initial.points, initial.direction), or run the motion with damping",
}


class ComputationError(HybridError):
    """The computation stopped.

    `t` is the time in s (None in statics), `s` the arc length in m where it showed
    first, `snapshot` the file that holds the last good state (or None); `line_name` the
    line, by its name ("": of the short form, or a point).
    """

    def __init__(
        self,
        outcome: Outcome,
        t: float | None,
        s: float | None,
        detail: str = "",
        snapshot: Path | None = None,
        first: str = "",
        line_name: str = "",
    ) -> None:
        """first: to try before the remedy of the outcome."""
        self.line_name, self.first = line_name, first
        self.outcome, self.t, self.s, self.detail, self.snapshot = outcome, t, s, detail, snapshot
        place = [f"{name} = {x:.6g} {unit}" for name, x, unit in (("t", t, "s"), ("s", s, "m")) if x is not None]
        lines = [f"{outcome.cause} ({', '.join(place)})" if place else outcome.cause]
        if detail:
            lines.append(f"    detail:   {detail}")
        remedy = outcome.remedy
        if t is None and outcome in (Outcome.NOT_CONVERGED, Outcome.TURNED_TOO_FAR, Outcome.NOT_FINITE):
            remedy = (
                "start from another shape (initial.points, initial.direction), or run the motion with damping to rest"
            )
        lines.append(f"    try:      {first + '; else ' if first else ''}{remedy}")
        if snapshot is not None:
            lines.append(f"    snapshot: {snapshot}")
        super().__init__("\n".join(lines))


def renamed(old: str, new: str) -> Any:
    """A property under its former name, with a warning."""

    def value(self: Any) -> Any:
        warnings.warn(f"{old} is now {new}", DeprecationWarning, stacklevel=2)
        return getattr(self, new)

    return property(value)
