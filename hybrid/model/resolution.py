"""How finely a scene is computed: the requested accuracy becomes cells, steps and the tolerance of zones.

A scene's own step, mesh and model.tolerance stand; what it leaves open follows from the accuracy it asks for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt

from hybrid.model.mesh_grading import Grading
from hybrid.model.scales import tension_scale
from hybrid.model.start_vibration import start_vibrations
from hybrid.scene.accuracy import Accuracy, amount
from hybrid.scene.motion_checks import shortest_period
from hybrid.scene.schema import AdaptiveModel, JonswapWaves, Scene, ZonesModel

USUAL = "1%"  # of a scene that requests nothing and leaves its steps open
# Part of the requested error that neglecting bending in catenary zones may use; mesh and time step share the rest.
OF_ZONES = 0.1
ONE = 0.01  # the requested error that the guesses below are for
ZONES = 1e-3  # tolerance of zones of a scene that requests nothing, as a part of the length
# Fineness of the mesh for 1 % of tension at the ends, and for 1 % of the length; it grows as second order wants it.
# First guesses after runs of the examples, as are those of the step below: the error figure decides, not they.
FOR_TENSION, FOR_POSITION = 1.5, 0.27
# Fewer cells do not resolve the shape; more are not needed before the first error figure is known.
COARSEST, FINEST = 0.5, 20.0
# What a step may be wrong by, as a part of the length, for 1 % of tension and for 1 % of the length; of third order.
STEP_FOR_TENSION, STEP_FOR_POSITION = 3e-5, 1.5e-3
# Steps to the shortest period that the scene names: fewer cannot show it, whatever the error control thinks.
PER_PERIOD = 12
# A vibration that a ramp sets off is shown where its force is more than this part of what is asked (ordinary ramps:
# 4e-4 of it), in steps so many times as short: the coarsest of the runs that errors are estimated by, with steps four
# times as long, then has PER_PERIOD to the period.  Of runs of more than so many steps an event speaks of it.
OF_VIBRATION, SHOWN_WHEN_COARSE, MOST_VIBRATION_STEPS = 0.5, 4, 10_000
# An end may turn so far in a step (rad), in runs of longer steps twice as far: with LARGEST_TWIST of
# simulation.diagnostics, an element can then not pass half a turn, where its twist would be taken for the opposite one.
TURN, MOST_TURN = 1.0, 2.0
# Refinements that may follow the first result where an accuracy is asked; of an irregular motion, in which chance is
# soon more than cells and steps are; of an equilibrium, whose errors need not fall evenly.
MOST_REFINEMENTS, IRREGULAR_REFINEMENTS, REFINEMENTS_AT_REST = 3, 1, 6
# Part of the force, the moment and the curvature typical of a scene below which an error is one of round-off: parts of
# a force that is nothing are not asked for.
ROUND_OFF = 1e-12
# Least steps to a run, and the shortest step, as a part of the longest, before a step counts as failed.
LEAST_STEPS, SHORTEST = 10, 1e-6


@dataclass(frozen=True)
class RequestedAccuracy:
    """Requested errors, in m and N or as parts (of the length; of the largest end force); None: not requested."""

    position: float | None
    tension: float | None
    of_end_force: float | None
    of_curvature: float | None = None  # a part of the largest
    of_moment: float | None = None  # the same of the bending moment
    of_tension: float | None = None  # the same of the tension along the line
    instant: bool = False  # at every output, also where a motion is irregular
    force: float = 0.0  # N, typical of the scene (`tension_scale`); 0: not known
    length: float = 0.0  # m, of the line

    def round_off(self, unit: str) -> float:
        """Error of a quantity in N, N m or 1/m that numbers of this scene have by round-off alone."""
        scales = {"N": self.force, "N m": self.force * self.length, "1/m": 1.0 / self.length if self.length else 0.0}
        return ROUND_OFF * scales.get(unit, 0.0)

    def asks(self, name: str) -> bool:
        """Whether an output is asked for: position, tension (of the line), curvature, bending_moment, an end force."""
        asked = {
            "position": self.position, "curvature": self.of_curvature, "bending_moment": self.of_moment,
            "tension": self.of_tension,
        }  # fmt: skip
        return asked.get(name, self.tension or self.of_end_force) is not None

    @property
    def text(self) -> str:
        """In words."""
        parts = [f"{self.position:.3g} m of position"] if self.position is not None else []
        if self.tension is not None:
            parts.append(f"{self.tension:.3g} N of the end forces")
        if self.of_end_force is not None:
            parts.append(f"{100 * self.of_end_force:.3g} % of the end forces")
        along = (self.of_curvature, "curvature"), (self.of_moment, "bending moment"), (self.of_tension, "line tension")
        parts += [f"{100 * part:.3g} % of the {name}" for part, name in along if part is not None]
        return ", ".join(parts) + ", at every instant" * self.instant


@dataclass(frozen=True)
class Resolution:
    """How finely a scene is computed.

    fineness: number of cells, relative to the default mesh; grading: density of cells along the line, None: as the
    scene or the program places them; step: s, fixed, or the largest; local: m, error allowed per step, None: steps are
    fixed; zones: error that neglected bending may make, as a part of the length; every: outputs of the result to one
    of such a run; follow: whether the error of neglected bending is followed along the run.  later: s, the largest step
    where no vibration is there that a ramp has set off along the line with more than `still` (N); 0: all are alike.
    """

    fineness: float
    step: float
    local: float | None
    zones: float
    grading: Grading | None = None
    every: int = 1
    follow: bool = False
    later: float = 0.0
    still: float = 0.0

    def coarser(self, cells: float = 1.0, steps: float = 1.0) -> Resolution:
        """With cells and steps longer by these factors; the error of a step is of third order."""
        local = None if self.local is None else self.local * steps**3
        every = round(steps) if steps > 1.0 else 1
        step, later = self.step * steps, self.later * steps
        return replace(self, fineness=self.fineness / cells, step=step, local=local, every=every, later=later)

    @property
    def turn(self) -> float:
        """Angle, rad, through which an end may turn in a step."""
        return min(TURN * self.every, MOST_TURN)

    @property
    def shortest(self) -> float:
        """Step, s, below which a failing step ends the run."""
        return SHORTEST * self.step


def accuracy_of(scene: Scene) -> Accuracy | None:
    """The accuracy a scene requests; USUAL where it leaves its steps open."""
    if scene.accuracy is None and scene.time is not None and scene.time.controlled and scene.time.tolerance is None:
        return Accuracy(position=USUAL, tension=USUAL)
    return scene.accuracy


def requested_accuracy(scene: Scene) -> RequestedAccuracy | None:
    """The same in numbers; None if nothing is requested."""
    accuracy = accuracy_of(scene)
    if accuracy is None:
        return None
    position = tension = of_end_force = None
    if accuracy.position is not None:
        what, size = amount(accuracy.position)
        position = size * scene.length if what == "part" else size
    if accuracy.tension is not None:
        what, size = amount(accuracy.tension)
        tension, of_end_force = (None, size) if what == "part" else (size, None)
    curvature, moment, line_tension = (
        amount(x)[1] if x is not None else None
        for x in (accuracy.curvature, accuracy.bending_moment, accuracy.line_tension)
    )
    instant, force = accuracy.instant is not None, tension_scale(scene, scene.cable.sections, True)
    return RequestedAccuracy(
        position, tension, of_end_force, curvature, moment, line_tension, instant, force, scene.length
    )


def is_irregular(scene: Scene) -> bool:
    """Whether a scene moves irregularly: its extremes and standard deviations matter, not what is at an instant.

    It is not, where `accuracy: {instant: ...}` asks for that.
    """
    fluid, asked = scene.environment.fluid, requested_accuracy(scene)
    moves = scene.time is not None and fluid is not None and isinstance(fluid.waves, JonswapWaves)
    return moves and not (asked is not None and asked.instant)


def wants_errors(scene: Scene) -> bool:
    """Whether the error of the result is estimated."""
    if scene.output.errors is not None:
        return scene.output.errors
    return accuracy_of(scene) is not None


def predicted_runs(scene: Scene) -> tuple[int, int]:
    """Runs that a scene in motion takes before it has a first result with its errors, and at most, with refinements."""
    if not wants_errors(scene):
        return 1 + wants_survey(scene), 1 + wants_survey(scene)
    first = 4 + wants_survey(scene)  # three to compare with
    if requested_accuracy(scene) is None:
        return first, first
    assert scene.time is not None
    free = mesh_is_free(scene) or zones_are_free(scene) or (scene.time.controlled and scene.time.tolerance is None)
    return first, first + free * (IRREGULAR_REFINEMENTS if is_irregular(scene) else MOST_REFINEMENTS)


def mesh_is_free(scene: Scene) -> bool:
    """Whether the program places the cells."""
    zones = scene.model.zones if isinstance(scene.model, ZonesModel) else ()
    return scene.mesh is None and not any(zone.cells or zone.ratio for zone in zones)


def wants_survey(scene: Scene) -> bool:
    """Whether a coarse run comes first that shows where cells should be short; not where they follow the curvature."""
    wanted = requested_accuracy(scene) is not None or scene.resolution is not None
    return mesh_is_free(scene) and wanted and not follows_curvature(scene)


def follows_curvature(scene: Scene) -> bool:
    """Whether the cells of rods follow the curvature in a run."""
    wanted = scene.model.curvature_error if isinstance(scene.model, AdaptiveModel) else None
    return wanted is not None and scene.time is not None


def zones_are_free(scene: Scene) -> bool:
    """Whether the program chooses the tolerance of zones."""
    return isinstance(scene.model, AdaptiveModel) and scene.model.tolerance is None


def model_is_free(scene: Scene, moves: bool = True) -> bool:
    """Whether the program chooses the model of a cable that bends, whose scene names none, or `adaptive` alone.

    moves: in motion, by a pre-run; else an equilibrium.

    Where the scene gives steps and asks for no accuracy, places the cells, lets the line touch itself, wants criteria
    as fields, or says anything of its zones, zones move.
    """
    named = scene.model != AdaptiveModel()
    wants = (scene.time is not None or not moves) and requested_accuracy(scene) is not None and mesh_is_free(scene)
    plain = scene.solver == "elimination" and not scene.contact.self
    return wants and not named and not scene.output.criteria and plain


def first_resolution(scene: Scene) -> Resolution:
    """The resolution for a scene's accuracy, before anything is known of its errors."""
    want = requested_accuracy(scene)
    zones = scene.model.tolerance if isinstance(scene.model, AdaptiveModel) else None
    fineness, local, part = 1.0, 1.0, ZONES / OF_ZONES
    if want is not None:
        tension, position = want.of_end_force or ONE, (want.position or ONE * scene.length) / scene.length
        which = [(tension, FOR_TENSION, STEP_FOR_TENSION)] if want.of_end_force or want.tension else []
        along = (want.of_curvature, want.of_moment, want.of_tension)
        which += [(x, FOR_TENSION, STEP_FOR_TENSION) for x in along if x]
        which += [(position, FOR_POSITION, STEP_FOR_POSITION)] if want.position else []
        part = min(x for x, _, _ in which)
        local = min(step * (x / ONE) ** 1.5 for x, _, step in which) * scene.length
        if mesh_is_free(scene):
            fineness = min(max(max(cells * sqrt(ONE / x) for x, cells, _ in which), COARSEST), FINEST)
    part *= OF_ZONES
    time = scene.time
    if time is None:
        return Resolution(fineness, 0.0, None, zones or part)
    if not time.controlled:
        assert time.step is not None
        return Resolution(fineness, time.step, None, zones or part)
    step = min(time.step or time.duration / LEAST_STEPS, time.duration)
    step = min(step, shortest_period(scene.ends, scene.environment) / PER_PERIOD)
    found = Resolution(fineness, step, time.tolerance or local, zones or part)
    shown, still = vibration_step(scene, want)
    return replace(found, step=shown, later=step, still=still) if shown < step else found


def vibration_step(scene: Scene, want: RequestedAccuracy | None) -> tuple[float, float]:
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
