"""How finely a scene is computed: the requested accuracy becomes cells, steps and the tolerance of zones.

A scene's own step, mesh and model.tolerance stand; what it leaves open follows from the accuracy it asks for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb, hypot, inf, pi, radians, sin, sqrt, tan
from typing import NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.mesh import Grading
from hybrid.model.sections import limits_along, output_points, tension_scale, weakest_bending
from hybrid.scene.analysis import (
    NOT_ASKED,
    ROUGHEST,
    USUAL,
    Accuracy,
    AdaptiveModel,
    CatenaryZone,
    RodModel,
    ZonesModel,
    amount,
)
from hybrid.scene.cable import Cable, Section
from hybrid.scene.motion_checks import shortest_period
from hybrid.scene.motion_tables import SHIFTS, Motion
from hybrid.scene.schema import LineScene, reachable_obstacles
from hybrid.scene.waves import PeriodicWaves

# Part of the requested error that neglecting bending in catenary zones may use; mesh and time step share the rest.
OF_ZONES = 0.1
ONE = 0.01  # the requested error that the guesses below are for
ZONES = 1e-3  # tolerance of zones of a scene that requests nothing, as a part of the length
# Fineness of the mesh for 1 % of tension at the ends, and for 1 % of the length; it grows as second order wants it.
# First guesses after runs of the examples, as are those of the step below: the error figure decides, not they.
FOR_TENSION, FOR_POSITION = 1.5, 0.27
# Fewer cells do not resolve the shape; more are not needed before the first error figure is known.
COARSEST, FINEST = 0.5, 20.0
# Where a line lies on round obstacles the coarsest of the runs that errors are estimated by, with cells four times as
# long, then has cells that turn through 0.2 rad there: with fewer, contact at its nodes is no order of convergence.
ON_OBSTACLES = 2.0
# What a step may be wrong by, as a part of the length, for 1 % of tension and for 1 % of the length; of third order.
STEP_FOR_TENSION, STEP_FOR_POSITION = 3e-5, 1.5e-3
# What a step may be wrong by, as a part of the position that is asked where the line moves so far.
STEP_OF_POSITION = 0.05
# Steps to the shortest period that the scene names: fewer cannot show it, whatever the error control thinks.
PER_PERIOD = 12
# A vibration that a ramp sets off is shown where its force is more than this part of what is asked (ordinary ramps:
# 4e-4 of it).
OF_VIBRATION = 0.5
# Its steps are so many times as short: the coarsest of the runs that errors are estimated by, with steps four times as
# long, then has PER_PERIOD to the period.
SHOWN_WHEN_COARSE = 4
# Of runs of more steps an event names it instead.
MOST_VIBRATION_STEPS = 10_000
# An end may turn so far in a step (rad), in runs of longer steps twice as far: with LARGEST_TWIST of
# simulation.diagnostics, an element can then not pass half a turn, where its twist would be taken for the opposite one.
TURN, MOST_TURN = 1.0, 2.0
# Refinements that may follow the first result where an accuracy is asked.
MOST_REFINEMENTS = 3
IRREGULAR_REFINEMENTS = 1  # of an irregular motion, in which chance is soon more than cells and steps are
REFINEMENTS_AT_REST = 6  # of an equilibrium, whose errors need not fall evenly
# Parts below which an error is one of round-off: parts of a force that is nothing are not asked for.
ROUND_OFF = 1e-12  # of the force, the moment and the curvature typical of a scene
OF_STRETCH = 1e-15  # of the tension that would stretch a line by its length
OF_LENGTH = 2.5e-16  # of a length that inertia must account for in a step ..
MOST_NOISE = 1e-3  # .. but at most this part of the force: a step with more does not converge (kernels.step.line_step)
# Half the diameter of a line that gives none, as a part of its length: no position is asked finer by a part of motion.
SLENDER = 1e-4
# Least steps to a run, and the shortest step, as a part of the longest, before a step counts as failed.
LEAST_STEPS, SHORTEST = 10, 1e-6


class Limited(NamedTuple):
    """Limits of sections whose verdict asks for an accuracy of its own: that which settles it.

    allowed: (ns,) of the quantity at output points, just before them where it jumps, and (jumps,) just after; NaN:
    none.  finest: part of a limit below which no error is asked for.
    """

    limit: str  # its key in the scene
    quantity: str
    allowed: Floats
    allowed_right: Floats
    finest: float

    def at_points(self, places: np.ndarray) -> Limited:
        """The same at some of the output points, by their numbers; none: at all of them."""
        return self._replace(allowed=self.allowed[places]) if places.size else self

    def part(self, used: float) -> float:
        """Error, as a part of a limit of which so much is used, by which it is known whether it is broken."""
        left = abs(1.0 - used)
        return max(left if used > 1.0 else min(left, ROUGHEST), self.finest)


class Reach(NamedTuple):
    """How far the points of a line go from where they were first, and lie from the line between its ends, m."""

    moved: float
    sag: float

    def size(self, least: float) -> tuple[float, str]:
        """What a position is held against, m, and what that is: of a line that moves by less than `least` its sag."""
        return (self.moved, "moved") if self.moved >= least else (self.sag, "of sag")


@dataclass(frozen=True)
class RequestedAccuracy:
    """Requested errors, in m and N or as parts (of the length; of the largest end force); None: not requested."""

    position: float | None  # of a part of what moves: the most
    tension: float | None
    of_end_force: float | None
    of_curvature: float | None = None  # a part of the largest
    of_moment: float | None = None  # the same of the bending moment
    of_tension: float | None = None  # the same of the tension along the line
    instant: bool = False  # at every output, also where a motion is irregular
    force: float = 0.0  # N, typical of the scene (`tension_scale`); 0: not known
    length: float = 0.0  # m, of the line
    every: float | None = None  # the part that is asked of all that no name asks
    of_motion: float | None = None  # a part of how far the line moves, at rest of its sag
    least: float = 0.0  # m, the finest position that this part asks for
    along: bool = False  # whether values along the line are asked by name, which cells and zones follow
    why: str = ""  # why curvature is asked that is not named
    limits: tuple[Limited, ...] = ()
    stiffness: float = 0.0  # N, the largest axial stiffness; 0: nothing stretches, or not known
    mass: float = 0.0  # kg, of the line; 0: not known

    def sized(self, reach: Reach) -> RequestedAccuracy:
        """The same with the position in m, by how far the line moves."""
        if self.of_motion is None or self.position is None:
            return self
        size, _ = reach.size(self.least)
        return replace(self, position=min(max(self.of_motion * size, self.least), self.position), of_motion=None)

    @property
    def coarsest_part(self) -> float:
        """The part beyond which an error that nobody asks for is worth a word."""
        return self.every or ROUGHEST

    def round_off(self, unit: str, step: float = 0.0) -> float:
        """Error of a quantity in N, N m or 1/m that numbers of this scene have by round-off alone.

        step: s, of a run; 0: of an equilibrium.
        """
        scales = {"N": self.force, "N m": self.force * self.length, "1/m": 1.0 / self.length if self.length else 0.0}
        least = ROUND_OFF * scales.get(unit, 0.0)
        if unit != "N":
            return least
        by_step = OF_LENGTH * self.length * self.mass * (2.0 / step) ** 2 if step else 0.0
        return max(least, OF_STRETCH * self.stiffness, min(by_step, MOST_NOISE * self.force))

    def asks(self, name: str) -> bool:
        """Whether an output is asked for: position, tension (of the line), curvature, bending_moment, an end force."""
        asked = {
            "position": self.position,
            "curvature": self.of_curvature,
            "bending_moment": self.of_moment,
            "tension": self.of_tension,
        }
        return asked.get(name, self.tension or self.of_end_force) is not None

    def describe(self, reach: Reach | None = None, used: Mapping[str, float] | None = None, rests: bool = False) -> str:
        """In words; reach: how far the line moves; used: how much of the limits, by name; None: not known.

        rests: it is to be an equilibrium.
        """
        parts = [self._position(reach, rests)] if self.position is not None else []
        if self.tension is not None:
            parts.append(f"{self.tension:.3g} N of the end forces")
        both = self.of_end_force is not None and self.of_tension == self.of_end_force
        if self.of_end_force is not None:
            what = "tension along the line and at the ends" if both else "end forces"
            parts.append(f"{100 * self.of_end_force:.3g} % of the {what}")
        because = f"curvature ({self.why})" if self.why else "curvature"
        along = [(self.of_curvature, because), (self.of_moment, "bending moment")]
        along += [] if both else [(self.of_tension, "line tension")]
        parts += [f"{100 * part:.3g} % of the {name}" for part, name in along if part is not None]
        for x in self.limits:
            size = f"{100 * x.finest:.3g} to {100 * ROUGHEST:.3g}" if used is None else ""
            if used is not None and x.limit in used:
                size = f"{100 * x.part(used[x.limit]):.2g}"
            parts += [f"{size} % of {x.limit}, as its verdict needs"] if size else []
        return ", ".join(parts) + ", at every instant" * self.instant

    def _position(self, reach: Reach | None, rests: bool) -> str:
        assert self.position is not None
        if self.of_motion is None:
            return f"{self.position:.3g} m of position"
        part = f"{100 * self.of_motion:.3g} % of"
        if reach is None:
            what = "the sag" if rests else "how far the line moves"
            return f"{part} {what} ({min(self.least, self.position):.2g} to {self.position:.3g} m of position)"
        size, what = reach.size(self.least)
        found, wanted = self.sized(reach).position, self.of_motion * size
        why = f"{part} {size:.3g} m {what}"
        if wanted < self.least:
            why = f"half the diameter; {why} is less"
        if wanted > self.position or self.least > self.position:
            why = f"{part} the length"
        return f"{found:.2g} m of position ({why})"


@dataclass(frozen=True)
class Resolution:
    """How finely a scene is computed.

    fineness: number of cells, relative to the default mesh; grading: density of cells along the line, None: as the
    scene or the program places them; step: s, fixed, or the largest; local: m, error allowed per step, None: steps are
    fixed; zones: error that neglected bending may make, as a part of the length; every: outputs of the result to one
    of such a run; later: s, the largest step
    where no vibration is there that a ramp has set off along the line with more than `still` (N); 0: all are alike.
    bends: error of curvature that is asked, as a part of the largest that a pre-run has shown; infinite: none is.
    rods: stretches (from, to, m; the lack over what is allowed) of which a pre-run has shown that catenaries will lack
    what is asked along the line: zones that move begin with rods there.
    parts: of every cell of a mesh that the scene gives.  places: of nodes among the places where nodes have to be, the
    k-th of these at k: cells go along with their sections; empty: as the scene or the program places them.  ends: s,
    when the steps end, those of another run; empty: they are as `step` and `local` say.
    """

    fineness: float
    step: float
    local: float | None
    zones: float
    grading: Grading | None = None
    every: int = 1
    later: float = 0.0
    still: float = 0.0
    bends: float = inf
    rods: tuple[tuple[float, float, float], ...] = ()
    parts: int = 1
    places: tuple[float, ...] = ()
    ends: tuple[float, ...] = ()

    def halved(self) -> Resolution:
        """With cells half as long, also those of a mesh that the scene gives."""
        return replace(self, fineness=2.0 * self.fineness, parts=2 * self.parts)

    def of_cells(self, times: float) -> Resolution:
        """With cells longer by a factor, 2 or more, or half as long (0.5)."""
        return self if times == 1.0 else self.halved() if times == 0.5 else self.coarser(cells=times)

    def coarser(self, cells: float = 1.0, steps: float = 1.0) -> Resolution:
        """With cells and steps longer by these factors; the error of a step is of third order."""
        local = None if self.local is None else self.local * steps**3
        every = round(steps) if steps > 1.0 else 1
        step, later = self.step * steps, self.later * steps
        fineness = self.fineness / cells
        return replace(self, fineness=fineness, step=step, local=local, every=every, later=later, places=(), ends=())

    @property
    def turn(self) -> float:
        """Angle, rad, through which an end may turn in a step."""
        return min(TURN * self.every, MOST_TURN)

    @property
    def shortest(self) -> float:
        """Step, s, below which a failing step ends the run."""
        return SHORTEST * self.step


def accuracy_of(scene: LineScene) -> Accuracy | None:
    """The accuracy a scene requests; USUAL where it leaves its steps open."""
    if scene.accuracy is None and scene.time is not None and scene.time.controlled and scene.time.tolerance is None:
        return Accuracy(all=USUAL)
    return scene.accuracy


def requested_accuracy(scene: LineScene) -> RequestedAccuracy | None:
    """The same in numbers; None if nothing is requested."""
    accuracy = accuracy_of(scene)
    if accuracy is None:
        return None
    every = _part(accuracy.all)
    position, of_motion, least = (every and every * scene.length), every, 0.0
    if accuracy.position is not None:
        what, size = amount(accuracy.position)
        position, of_motion = size * scene.length if what == "part" else size, None
    elif every is not None:
        diameters = [x.diameter for x in scene.cable.sections if x.diameter is not None]
        least = 0.5 * max(diameters, default=2.0 * SLENDER * scene.length)
    tension, of_end_force = None, every
    if accuracy.tension is not None:
        what, size = amount(accuracy.tension)
        tension, of_end_force = (None, size) if what == "part" else (size, None)
    named = [_part(x) for x in (accuracy.curvature, accuracy.bending_moment, accuracy.line_tension)]
    curvature, moment, line_tension = named
    why = "" if every is None or accuracy.curvature is not None else _why_curvature(scene, accuracy)
    if why:
        curvature = every
    if accuracy.line_tension is None and accuracy.tension is None:
        line_tension = every
    along = why != "" or any(x is not None for x in named)
    parts = [x for x in (every, of_end_force, *named) if x is not None]
    sizes = accuracy.instant is not None, tension_scale(scene, scene.cable.sections, True), scene.length
    asked = RequestedAccuracy(position, tension, of_end_force, curvature, moment, line_tension, *sizes)
    asked = replace(asked, every=every, of_motion=of_motion, least=least, along=along, why=why)
    stiffness = max(x.stiffness or 0.0 for x in scene.cable.sections)
    mass = sum(x.mass * x.length for x in scene.cable.sections)
    return replace(asked, limits=_limits(scene, min(parts, default=ONE)), stiffness=stiffness, mass=mass)


def _part(text: str | None) -> float | None:
    return None if text in (None, NOT_ASKED) else amount(text)[1]


def _why_curvature(scene: LineScene, accuracy: Accuracy) -> str:
    """Why an accuracy that names no quantity asks for curvature: something rests on it; empty: nothing does."""
    bends = all(x.weakest_bending for x in scene.cable.sections)
    if not bends or not shows_bends(scene):
        return ""
    if isinstance(scene.model, RodModel) and (accuracy.instant is not None or not _waves_are_irregular(scene)):
        return "model: rod"  # in an irregular sea the largest curvature is that of one snap
    return "pipe.max_stress" if holds_stress(scene.cable.sections) else ""


def holds_stress(sections: Sequence[Section]) -> bool:
    """Whether a stress that bending makes is held against a limit."""
    return any(x.pipe is not None and x.pipe.max_stress is not None for x in sections)


def shows_bends(scene: LineScene) -> bool:
    """Whether a line is, or may become, rod somewhere: what a catenary lacks at clamps never converges."""
    if isinstance(scene.model, ZonesModel):
        return not all(isinstance(zone, CatenaryZone) for zone in scene.model.zones)
    return isinstance(scene.model, RodModel | AdaptiveModel)


def judges_bends(scene: LineScene) -> bool:
    """Whether errors of its bend count: they are asked for, or nothing is and all are estimated."""
    if not any(x.weakest_bending for x in scene.cable.sections) or not shows_bends(scene):
        return False
    asked = requested_accuracy(scene)
    if asked is None:
        return True
    named = asked.asks("curvature") or asked.asks("bending_moment")
    return named or any(x.quantity == "curvature" for x in asked.limits)


def _limits(scene: LineScene, finest: float) -> tuple[Limited, ...]:
    """The limits of sections that ask for an accuracy; finest: the finest part that the scene asks for."""
    given = {name for name in ("min_bend_radius", "max_tension") for x in scene.cable.sections if getattr(x, name)}
    if not given:
        return ()
    points, near = output_points(scene), 1e-6 * scene.length
    sides = points.s - near, points.jumps + near  # what is just before a point belongs to the section before it
    found = []
    if "min_bend_radius" in given and shows_bends(scene):
        radii = [limits_along(scene, s)["min_bend_radius"] for s in sides]
        bends = [np.where(weakest_bending(scene, s) > 0.0, 1.0 / r, np.nan) for s, r in zip(sides, radii, strict=True)]
        if any(np.isfinite(x).any() for x in bends):
            found.append(Limited("min_bend_radius", "curvature", bends[0], bends[1], finest))
    if "max_tension" in given:
        most = [limits_along(scene, s)["max_tension"] for s in sides]
        found.append(Limited("max_tension", "tension", most[0], most[1], finest))
    return tuple(found)


def has_limits(scene: LineScene) -> bool:
    """Whether anything of a scene is held against a limit: of a section, a code, a pipe, a named quantity."""
    names = ("min_bend_radius", "max_tension", "min_tension", "max_contact_force", "capacity", "code")
    sections = scene.cable.sections
    quantities = scene.output.quantities.values()
    return (
        any(getattr(x, name) is not None for x in sections for name in names)
        or any(x.pipe is not None and x.pipe.max_stress is not None for x in sections)
        or any(x.smallest is not None or x.largest is not None for x in quantities)
    )


def is_irregular(scene: LineScene) -> bool:
    """Whether a scene moves irregularly: its extremes and standard deviations matter, not what is at an instant.

    It is not, where `accuracy: {instant: ...}` asks for that.
    """
    asked = requested_accuracy(scene)
    return _waves_are_irregular(scene) and not (asked is not None and asked.instant)


def _waves_are_irregular(scene: LineScene) -> bool:
    return scene.time is not None and not isinstance(scene.environment.waves, PeriodicWaves | None)


def rubs_on_obstacles(scene: LineScene) -> bool:
    """Whether a line may rub on obstacles: its tension then jumps where contact begins."""
    return any(x.friction for x in reachable_obstacles(scene).values())


def may_be_held(scene: LineScene) -> bool:
    """Whether friction of a bed or an obstacle may hold a line here or there."""
    bed = scene.environment.seabed
    return rubs_on_obstacles(scene) or (bed is not None and bool(bed.friction or bed.soil))


def wants_errors(scene: LineScene) -> bool:
    """Whether the error of the result is estimated."""
    if scene.output.errors is not None:
        return scene.output.errors
    return accuracy_of(scene) is not None


def predicted_runs(scene: LineScene) -> tuple[int, int]:
    """Runs that a scene in motion takes before it has a first result with its errors, and at most, with refinements."""
    if not wants_errors(scene):
        return 1 + wants_survey(scene), 1 + wants_survey(scene)
    first = 4 + wants_survey(scene)  # three to compare with
    if requested_accuracy(scene) is None:
        return first, first
    assert scene.time is not None
    free = mesh_is_free(scene) or zones_are_free(scene) or (scene.time.controlled and scene.time.tolerance is None)
    return first, first + free * (IRREGULAR_REFINEMENTS if is_irregular(scene) else MOST_REFINEMENTS)


def mesh_is_free(scene: LineScene) -> bool:
    """Whether the program places the cells."""
    zones = scene.model.zones if isinstance(scene.model, ZonesModel) else ()
    return scene.mesh is None and not any(zone.cells or zone.ratio for zone in zones)


def wants_survey(scene: LineScene) -> bool:
    """Whether a coarse run comes first that shows where cells should be short.

    Where cells follow the curvature it is for their base, and comes if the scene gives a number of cells to a layer.
    """
    wanted = requested_accuracy(scene) is not None and not follows_curvature(scene)
    return mesh_is_free(scene) and (wanted or scene.resolution is not None)


def follows_curvature(scene: LineScene) -> bool:
    """Whether the cells of rods follow the curvature in a run."""
    wanted = scene.model.curvature_error if isinstance(scene.model, AdaptiveModel) else None
    return wanted is not None and scene.time is not None


def zones_are_free(scene: LineScene) -> bool:
    """Whether the program chooses the tolerance of zones."""
    return isinstance(scene.model, AdaptiveModel) and scene.model.tolerance is None


def model_is_free(scene: LineScene, moves: bool = True) -> bool:
    """Whether the program chooses the model of a cable that bends, whose scene names none, or `adaptive` alone.

    moves: in motion, by a pre-run; else an equilibrium.

    Where the scene gives steps and asks for no accuracy, places the cells, lets the line touch itself or obstacles,
    wants criteria as fields, or says anything of its zones, zones move.
    """
    named = scene.model != AdaptiveModel()
    wants = (scene.time is not None or not moves) and requested_accuracy(scene) is not None and mesh_is_free(scene)
    return wants and not (named or scene.output.criteria or scene.contact.self or reachable_obstacles(scene))


def first_resolution(scene: LineScene) -> Resolution:
    """The resolution for a scene's accuracy, before anything is known of its errors."""
    want = requested_accuracy(scene)
    zones = scene.model.tolerance if isinstance(scene.model, AdaptiveModel) else None
    fineness, local, part = 1.0, 1.0, ZONES / OF_ZONES
    if want is not None:
        tension, position = want.of_end_force or ONE, (want.position or ONE * scene.length) / scene.length
        which = [(tension, FOR_TENSION, STEP_FOR_TENSION)] if want.of_end_force or want.tension else []
        along = (want.of_curvature, want.of_moment, want.of_tension)  # that of a bare part asks as end forces do
        which += [(x, FOR_TENSION, STEP_FOR_TENSION) for x in along if x]
        which += [(position, FOR_POSITION, STEP_FOR_POSITION)] if want.position else []
        part = min(x for x, _, _ in which)
        local = min(step * (x / ONE) ** 1.5 for x, _, step in which) * scene.length
        if mesh_is_free(scene):
            least = ON_OBSTACLES if reachable_obstacles(scene) else COARSEST
            fineness = min(max(max(cells * sqrt(ONE / x) for x, cells, _ in which), least), FINEST)
    part *= OF_ZONES
    time = scene.time
    if time is None:
        return Resolution(fineness, 0.0, None, zones or part)
    if not time.controlled:
        assert time.step is not None
        return Resolution(fineness, time.step, None, zones or part)
    step = min(time.step or time.duration / LEAST_STEPS, time.duration)
    step = min(step, shortest_period(scene.ends, scene.environment, reachable_obstacles(scene)) / PER_PERIOD)
    found = Resolution(fineness, step, time.tolerance or local, zones or part)
    shown, still = vibration_step(scene, want)
    return replace(found, step=shown, later=step, still=still) if shown < step else found


def for_motion(resolution: Resolution, scene: LineScene, reach: Reach) -> Resolution:
    """As fine as a part of what moves asks for at first, where a pre-run has shown how far the line does."""
    want = requested_accuracy(scene)
    if want is None or want.of_motion is None or reach.size(want.least)[0] < want.least:
        return resolution  # a line that lies straight and does not move shows its place on any cells
    position, fineness, local = want.sized(reach).position, resolution.fineness, resolution.local
    assert position is not None
    if mesh_is_free(scene) and scene.resolution is None:  # which says what the first result has
        fineness = max(fineness, min(FOR_POSITION * sqrt(ONE * scene.length / position), FINEST))
    if local is not None and scene.time is not None and scene.time.tolerance is None:
        local = min(local, STEP_OF_POSITION * position)
    return replace(resolution, fineness=fineness, local=local)


def vibration_step(scene: LineScene, want: RequestedAccuracy | None) -> tuple[float, float]:
    """The longest step, s, that shows what ramps set off along the line, and its force, N, from which on it counts.

    Infinity for the step where nothing asks for it.
    """
    if want is None or scene.time is None or not (want.tension or want.of_end_force):
        return inf, 0.0
    still = want.tension or (want.of_end_force or 0.0) * tension_scale(scene, scene.cable.sections, True)
    still *= OF_VIBRATION
    duration = scene.time.duration
    found = [x.period for x in start_vibrations(scene) if x.force > still and x.t < duration]
    step = min(found, default=inf) / (PER_PERIOD * SHOWN_WHEN_COARSE)
    return step if duration <= MOST_VIBRATION_STEPS * step else inf, still


# Vibrations along a line that prescribed motions of its ends set off where they begin, and where their ramps end.
#
# A ramp 10 x^3 - 15 x^4 + 6 x^5 (scene/motion.py) has third and higher derivatives that jump at its ends.  Of a bar of
# stiffness k and frequency w whose end moves by u(t), jumps J_n of the n-th derivatives leave a free vibration of
# k |sum J_n (i/w)^n|: the solution u - u''/w^2 + u''''/w^4 - .. of q''/w^2 + q = u has to be met in value and rate.
# A small motion is a large force there: steps that follow the motion in metres damp it, and so do the longer steps of
# the runs that errors are estimated by.

# Derivatives of the ramp by x where it begins and where it ends, by their order, and the highest that counts.  Of a
# ramp that is shorter than the period the sum may be too large, which makes steps shorter than they need to be.
AT_BEGIN = {3: 60.0, 4: -360.0, 5: 720.0}
AT_END = {3: 60.0, 4: 360.0, 5: 720.0}
HIGHEST = 6


class Vibration(NamedTuple):
    """Of the force along a line, from t (s) on: its amplitude (N) and its period (s)."""

    t: float
    force: float
    period: float


def strain_travel(cable: Cable) -> float | None:
    """Time, s, in which strain runs along a cable; None: some of it does not stretch."""
    if any(x.stiffness is None for x in cable.sections):
        return None
    return sum(x.length * sqrt(x.mass / x.stiffness) for x in cable.sections if x.stiffness)


def longest_period(cable: Cable) -> float | None:
    """The longest period, s, of strain along a cable; None: nothing of it stretches.

    That of a bar which is held at one end, 4 L/c, with what does not stretch as a mass M at the other: frequencies are
    x c/L with x tan x = m/M, m the mass of the bar.
    """
    stretches = [x for x in cable.sections if x.stiffness]
    if not stretches:
        return None
    travel = sum(x.length * sqrt(x.mass / x.stiffness) for x in stretches if x.stiffness)
    bar, rigid = (sum(x.length * x.mass for x in cable.sections if bool(x.stiffness) == y) for y in (True, False))
    low, high = 0.0, 0.5 * pi
    while rigid and high - low > 1e-9:
        x = 0.5 * (low + high)
        low, high = (x, high) if x * tan(x) * rigid < bar else (low, x)
    return 2.0 * pi * travel / high


def start_vibrations(scene: LineScene) -> list[Vibration]:
    """What harmonic motions with a ramp, and moves to another place, set off; none in a line that does not stretch."""
    period = longest_period(scene.cable)
    if period is None:
        return []
    w, k = 2.0 * pi / period, 1.0 / sum(x.length / x.stiffness for x in scene.cable.sections if x.stiffness)
    found = []
    for motion in (end.prescribed_motion for end in scene.ends.both):
        if motion is None:
            continue
        if motion.ramp:
            found += [Vibration(t, k * _left(motion, motion.ramp, t, w), period) for t in (0.0, motion.ramp)]
        if motion.travel is not None:
            over, begin = motion.travel.over, motion.travel.begin
            left = hypot(*motion.travel.by) * abs(_jump(over, AT_BEGIN, w, [1.0]))
            found += [Vibration(t, k * left, period) for t in (begin, begin + over)]
    return found


def _left(motion: Motion, ramp: float, t: float, w: float) -> float:
    """Amplitude, m, that the begin or the end t of a ramp leaves at frequency w."""
    jumps, ends = [], AT_END if t > 0.0 else AT_BEGIN
    for listed in (found for name, found in motion.harmonics().items() if name in SHIFTS):
        left = 0j
        for h in listed:
            o, phase = 2.0 * pi / h.period, 2.0 * pi * t / h.period + radians(h.phase)
            left += _jump(ramp, ends, w, [h.amplitude * o**n * sin(phase + 0.5 * n * pi) for n in range(HIGHEST + 1)])
        jumps.append(abs(left))
    return hypot(*jumps)


def _jump(ramp: float, ends: Mapping[int, float], w: float, derivatives: Sequence[float]) -> complex:
    """Sum of J_n (i/w)^n where a ramp, with derivatives `ends` there, multiplies a function with these."""
    left = 0j
    for n in range(min(ends), HIGHEST + 1):
        each = [(k, n - k) for k in ends if 0 <= n - k < len(derivatives)]
        left += sum(comb(n, k) * ends[k] / ramp**k * derivatives[m] for k, m in each) * (1j / w) ** n
    return left
