"""What a program outside sets of the points of lines, and what it reads there: a part of `hybrid.Simulation`.

A scene in the short form (`cable`, `ends`) is a network of one line whose points are called as the ends are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import wraps
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.run import newton
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.report import FORCE_A, FORCE_B, MOMENT_A, MOMENT_B, PLANAR
from hybrid.kernels.state.state import Floats, State
from hybrid.kernels.step.step_control import before_fixed, weights
from hybrid.model.build import Model
from hybrid.model.ends import STILL, DrivenEnd, EndConditions, contradictions, rotation_vector
from hybrid.model.nearby import Weakness
from hybrid.model.network import NetworkModel
from hybrid.outputs.observed_states import Grid
from hybrid.scene.base import dotted
from hybrid.scene.ends import Fairlead
from hybrid.scene.network import Network
from hybrid.scene.root import ENDS, ShortForm
from hybrid.simulation.stepped import (
    CableState,
    Course,
    EndForces,
    SettableObstacles,
    one_thread,
    rotation_asked,
    triple,
    vector,
)
from hybrid.solve.stepper import LineFailed

# Of the largest component: what is out of a plane by no more is in it.
IN_PLANE = 1e-9
# Rows of three numbers that the report of a step begins with: the forces and the moments at both ends.
OF_ENDS = 4
assert (FORCE_A, FORCE_B, MOMENT_A, MOMENT_B) == (0, 3, 6, 9)
P = ParamSpec("P")
R = TypeVar("R")


class PointState(NamedTuple):
    """Where a point is (3,) m, how fast (3,) m/s, and what its lines do to it; all inertial.

    force: (3,) N; moment: (3,) N m, of lines that are clamped there; frame: (3, 3) columns a1, a2 and the tangent along
    increasing s of the only line there, whose direction the point holds, else NaN.
    """

    position: Floats
    velocity: Floats
    force: Floats
    moment: Floats
    frame: Floats


def of_line(method: Callable[Concatenate[Any, str, P], R]) -> Callable[..., R]:
    """A method that takes the name of a line first, which is left out where the line has none."""

    @wraps(method)
    def named(self: SteppedPoints, *args: Any, **options: Any) -> R:
        given: Any = args if all(self._form.names.values()) else (*self._form.names, *args)
        return method(self, *given, **options)

    return named


class SteppedPoints(SettableObstacles):
    """The points and lines of a scene that is stepped from outside."""

    _network: Network  # what is computed
    _form: ShortForm  # what points and lines are called in the scene
    _driven: dict[str, list[DrivenEnd]]  # of points that are set, for each end there
    _next: dict[str, Course]  # where points are to be at the end of the next step
    _wound: dict[int, tuple[float | None, float]]  # length and rate that are asked of lines
    _places: dict[str, list[tuple[int, int]]]  # of points: number of each line there, 0 or 1 for its start or end
    _driven_of: NetworkModel | None = None  # whose points those that are set were last looked for among
    _signed: NetworkModel | None = None  # of which the next are
    _report: Floats | None = None  # of the last step, of which the next are
    _reported: Floats  # (4, 3) forces and moments at both ends in it
    _signs: Floats  # (4, 3) what of the report of a step is a force or a moment on what holds an end, with its sign

    # --- points that are held -----------------------------------------------------------------------

    @one_thread
    def set_point(
        self,
        name: str,
        position: Sequence[float] | Floats | None,
        velocity: Sequence[float] | Floats | None = None,
        frame: Floats | None = None,
    ) -> None:
        """Where a held point is to be at the end of the next `step` or `advance`, which it reaches smoothly.

        position: (3,) m, inertial, None: where it is (of a guided one, which only turns); velocity: (3,) m/s there,
        None: in a step of the run that which the places imply, in what takes several at rest; one that contradicts the
        places is told as an event *implausible*.  frame: (3, 3), columns a1, a2 and the tangent along increasing s, of
        a point that holds the direction of one line.  A point that is not set again stays where it is.  ValueError: no
        such point, or it is free, on a body, has a motion in the scene, holds no direction, or would leave the plane
        of `dimension: 2`.
        """
        self._check_open()
        ends = self._driven.get(name) if isinstance(name, str) else None
        if ends is None or position is None or frame is not None:
            self._check_settable(name, position is not None, frame is not None)
        if ends is None:
            ends = self._driven[name] = [conditions.drive(k) for conditions, k in self._conditions_at(name)]
        where, turn = ends[0], STILL
        there = triple(where.at_time(self.t)[0] if position is None else position, "position")
        speed = None if velocity is None else triple(velocity, "velocity")
        if self.scene.dimension == 2:
            self._check_plane(name, "position", np.array(there) - where.at_time(self.t)[0])
        if frame is not None:
            now = where.at_time(self.t)[2]
            turn = triple(rotation_vector(now.T @ rotation_asked(frame, "frame")), "frame")
            self._check_plane(name, "turn of the frame", now @ turn, turns=True)
        self._next[name] = there, speed, turn

    def set_end(
        self,
        end: str,
        position: Sequence[float] | Floats | None,
        velocity: Sequence[float] | Floats | None = None,
        frame: Floats | None = None,
    ) -> None:
        """As `set_point`, of the point at an end of a cable, "start" or "end"."""
        self.set_point(end, position, velocity, frame)

    @one_thread
    def release(self, name: str) -> None:
        """Let a held point go now: it is free from here on, and `set_force` acts on it if one line ends there.

        name: "start" or "end" of a cable.  ValueError: it is not held.
        """
        self._check_open()
        ends = tuple(self._ends_at(name))
        if self._is_on_body(name) or not self._is_held(name):
            raise ValueError(f"{self._key_of(name)} is not held: there is nothing to release")
        weakness = Weakness(f"point {name} gives way", ends, math.inf, math.inf, False)
        try:
            self._run.let_go(weakness, "by Simulation.release")
        except LineFailed as failed:
            raise self._fail(failed) from None
        self._forget_released()

    def _fail(self, failed: LineFailed) -> ComputationError:
        """What the failure of a step becomes, after which `restore` leads on."""
        error = self._error_of(failed)
        self._failed = failed, error
        return error

    def _error_of(self, failed: LineFailed) -> ComputationError:
        """An error in the words of the scene, with a snapshot; velocities that contradict their places are told."""
        if failed.outcome == Outcome.GAINS_ENERGY and (text := contradictions(self._set_from_outside(), soon=True)):
            failed = LineFailed(failed.line, failed.outcome, failed.t, failed.s, failed.detail, first=text)
        return self._run.error_of(failed)

    def _ends_set(self) -> Iterator[DrivenEnd]:
        """What is set from outside."""
        for ends in self._driven.values():
            yield from ends[:1]
        for name in self._moved:
            yield self._obstacle_paths(name)[0]

    def _set_from_outside(self) -> dict[str, DrivenEnd]:
        names = [self._key_of(name) for name, ends in self._driven.items() if ends]
        return dict(zip([*names, *(f"obstacles.{name}" for name in self._moved)], self._ends_set(), strict=True))

    def _forget_released(self) -> None:
        """Points that are free now are no longer set."""
        if self._run.model is self._driven_of:
            return
        self._driven_of = self._run.model
        for name in [name for name, ends in self._driven.items() if ends and ends[0].held and not self._is_held(name)]:
            self._driven.pop(name)
            self._next.pop(name, None)

    def settable(self, name: str) -> frozenset[str]:
        """What may be set of a point: "position" and "frame" by `set_point`, "force" and "moment" by `set_force`.

        name: "start" or "end" of a cable.  A point with a motion in the scene, or on a body, has nothing of these, nor
        has one to which several lines are joined.
        """
        here = self._ends_at(name)
        if self._is_on_body(name) or self._is_moved(name):
            return frozenset()
        held = self._is_held(name)
        if not held and not self._is_free_end(name):
            return frozenset()
        names = {"position" if held else "force"}
        if self._turns_alone(name):
            names.add("frame")
        elif not held and self._is_of_rod(*here[0]):
            names.add("moment")
        return frozenset(names)

    def _check_settable(self, name: str, placed: bool, turned: bool) -> None:
        """ValueError where a point cannot be set; placed, turned: what is asked of it."""
        self._ends_at(name)
        held, said = self._is_held(name), self._key_of(name)
        if self._is_on_body(name) or not (held or self._is_free_end(name)):
            raise ValueError(f"{said} is free or on a body: only fixed points are set")
        if not held and (placed or not self._turns_alone(name)):
            raise ValueError(f"{said} is not held: set_force acts on it")
        if turned and not self._turns_alone(name):
            raise ValueError(f"{said} holds no direction of a line: it has no frame")
        if self._is_moved(name):
            raise ValueError(f"{said} has a motion in the scene: leave that out to set it from outside")

    def _check_plane(self, name: str, what: str, vector: Floats, turns: bool = False) -> None:
        """ValueError where a vector leaves the plane of `dimension: 2`; turns: or, an axial one, turns out of it."""
        normal = self._run.model.models[0].kept_in
        if normal is not None:
            across = float(vector @ normal)
            across = float(np.linalg.norm(vector - across * normal)) if turns else across
            if abs(across) > IN_PLANE * float(np.abs(vector).max(initial=1.0)):
                out = f"{'about an axis in' if turns else 'out of'} the plane that dimension: 2 keeps the cable in"
                raise ValueError(
                    f"{what} of {self._key_of(name)}: {across:.3g} {out}; leave dimension out of the scene"
                )

    # --- points that are free -----------------------------------------------------------------------

    @one_thread
    def set_force(
        self, name: str, force: Sequence[float] | Floats, moment: Sequence[float] | Floats | None = None
    ) -> None:
        """From the next step on this force (3,) N, and moment (3,) N m, act on a point that is free to move.

        name: "start" or "end" of a cable; the free end of one line.
        """
        here, said = self._ends_at(name), self._key_of(name)
        self._check_open()
        if self._is_held(name):
            raise ValueError(f"{said} is held: set_end moves it")
        if not self._is_free_end(name):
            raise ValueError(f"{said} is no free end of one line: give it a force over time in the scene")
        if moment is not None and not self._is_of_rod(*here[0]):
            raise ValueError(f"moment: the line is a catenary at {said}, which takes no moment")
        wanted, turning = vector(force, "force"), vector(STILL if moment is None else moment, "moment")
        self._check_plane(name, "force", wanted)
        self._check_plane(name, "moment", turning, turns=True)
        ((conditions, k),) = self._conditions_at(name)
        conditions.load("force", k, wanted, self.t)
        if moment is not None:
            conditions.load("moment", k, turning, self.t)

    def _is_of_rod(self, line: int, end: int) -> bool:
        """Whether an end is that of a rod."""
        return bool(self._run.model.models[line].line.spin[-end])

    # --- what a point is ------------------------------------------------------------------------------

    def _ends_at(self, name: Any) -> list[tuple[int, int]]:
        """Ends of lines at a point: number of the line, 0 or 1.  ValueError: there is no such point."""
        here = self._places.get(name) if isinstance(name, str) else None
        if here is not None:
            return here
        raise ValueError(f"name: expected {' or '.join(map(repr, self._places))}, found {name!r:.60}")

    def _conditions_at(self, name: str) -> list[tuple[EndConditions, int]]:
        return [(self._run.model.models[line].ends, k) for line, k in self._ends_at(name)]

    def _key_of(self, name: str) -> str:
        """A point, by its key in the scene."""
        return dotted(self._form.place(("points", name)))

    def _is_on_body(self, name: str) -> bool:
        return isinstance(self._network.points[name], Fairlead)

    def _is_moved(self, name: str) -> bool:
        """Whether a motion of the scene moves a point."""
        return any(k in x.motions and not isinstance(x.motions[k], DrivenEnd) for x, k in self._conditions_at(name))

    def _is_held(self, name: str) -> bool:
        """Whether a point is, with all of its lines that have not left it."""
        model = self._run.model
        here = [at for at in self._ends_at(name) if at not in model.loose]
        return all(model.joints[line][k] < 0 and model.models[line].ends.values.held[k] for line, k in here)

    def _is_free_end(self, name: str) -> bool:
        """Whether a point is the end of one line, which is joined to nothing there."""
        model, here = self._run.model, self._ends_at(name)
        return len(here) == 1 and model.joints[here[0][0]][here[0][1]] < 0

    def _turns_alone(self, name: str) -> bool:
        """Whether a point holds the direction of a rod, and of no other line."""
        (line, k), *others = self._ends_at(name)
        return not others and bool(self._run.model.models[line].line.element[-k])

    # --- lengths ----------------------------------------------------------------------------------------

    @property
    def length(self) -> float:
        """Unstretched length of the only line that is out now, m."""
        return float(np.ptp(self._only.line.s))

    @of_line
    @one_thread
    def set_length(self, name: str, length: float, rate: float = 0.0) -> None:
        """How long a line is to be at the end of the next `step` or `advance`, m, and its rate there, m/s.

        name: of the line, left out for a cable.  It reaches that smoothly, and keeps the rate until it is set again.
        ValueError: the line has no `payout`, or that gives the length itself; a length that cannot be.
        """
        self._wind(name, math.nan if length is None else length, rate)

    @of_line
    @one_thread
    def set_payout(self, name: str, rate: float) -> None:
        """At which rate, m/s, a line is to be paid out at the end of the next `step` or `advance`; negative: taken in.

        name: of the line, left out for a cable.  The rate changes evenly until then, and stays until it is set again.
        ValueError: as of `set_length`.
        """
        self._wind(name, None, rate)

    def _wind(self, name: str, length: float | None, rate: float) -> None:
        self._check_open()
        k, run = self._line(name), self._run
        paying = run.lines[k].paying
        if paying is None:
            key = dotted(self._form.place(("lines", name, "connections", "end", "payout")))
            where = self._form.text(f"line {name}")
            raise ValueError(f"{where} has no `payout`: there is no {key}, nor one at its start; its length stays")
        from hybrid.simulation.payout import length_asked

        side = ENDS[paying.plan.side]
        where = dotted(self._form.place(("lines", name, "connections", side, "payout")))
        self._wound[k] = length_asked(run.scenes[k], paying, length, rate, where)

    # --- what it is now ---------------------------------------------------------------------------

    @property
    def _only(self) -> Model:
        """The model of the only line.  ValueError: there are several."""
        models = self._run.model.models
        if len(models) > 1:
            raise ValueError("the scene has several lines: name one, as in line(name), forces(name), tension(name)")
        return models[0]

    @property
    def state(self) -> CableState:
        """Where the only line is now; arrays of one's own.  ValueError: there are several."""
        assert self._only is not None
        return self.line(self._run.model.names[0])

    @one_thread
    def line(self, name: str) -> CableState:
        """Where a line is now; arrays of one's own."""
        k = self._line(name)
        run, v = self._run, self._run.state.lines[k].v.copy()
        model, x, line = run.model.models[k], run.state.lines[k], run.lines[k]
        if line.paying is not None:  # of the material, which passes nodes that go along with the winch
            _, seen, _ = line.observe(line.state_now(run.t, run.solver.lines[k].ends, x, run.solver.work[k]))
            v = seen.on(Grid(model.line.s, model.zones, model.line.s, model.attached)).velocity[:, :, 0]
        return CableState(self.t, model.line.s.copy(), x.r.copy(), v, x.T.copy(), model.zones)

    @one_thread
    def point(self, name: str) -> PointState:
        """Where a point is, and what its lines do to it; of a free point without the loads on itself.

        ValueError: a step has failed.
        """
        self._check_sound()
        run, every, force, moment = self._run, self._ends_at(name), np.zeros(3), np.zeros(3)
        here = [at for at in every if at not in run.model.loose] or every  # what has broken there is elsewhere
        for line, k in here:
            report = run.solver.work[line].report
            force += report[FORCE_A + 3 * k : FORCE_A + 3 * k + 3]
            if run.model.models[line].line.element[-k]:
                moment += (1.0, -1.0)[k] * report[MOMENT_A + 3 * k : MOMENT_A + 3 * k + 3]
        state, frame = run.state.lines[line], np.full((3, 3), np.nan)
        if self._turns_alone(name):
            frame = run.model.models[line].ends.values.frame[k].reshape(3, 3).copy()
        return PointState(state.r[-k].copy(), state.v[-k].copy(), force, moment, frame)

    @of_line
    @one_thread
    def tension(self, name: str) -> Floats:
        """Tension (ns,) N of a line now at the points of the result, recovered between cells and at the ends as there.

        name: of the line, left out for a cable.  `state.tension`, or `line(name).tension`, is that of the cells, and
        costs less.  ValueError: a step has failed.
        """
        self._check_open()
        self._check_sound()
        k, run = self._line(name), self._run
        run.ends_of_now()
        line, state = run.lines[k], run.state.lines[k]
        _, seen, _ = line.observe(line.state_now(run.t, run.solver.lines[k].ends, state, run.solver.work[k]))
        return np.array(seen.tension[:, 0])

    def frames(self) -> Floats:
        """Frames (2, 3, 3) of the ends of the only line, inertial: columns a1, a2 and the tangent along increasing s.

        NaN where an end holds no direction.
        """
        model = self._only
        frames = model.ends.values.frame.reshape(2, 3, 3).copy()
        frames[[k for k in (0, 1) if not model.line.element[-k]]] = np.nan
        return frames

    @one_thread
    def forces(self, name: str | None = None) -> Any:
        """Forces and moments of the only line on what holds its ends, now, as `EndForces`; ValueError: a step failed.

        name: of a line of several: its forces (3,) N on the points at its start and at its end, in a tuple; inertial.
        """
        self._check_sound()
        run = self._run
        if name is not None:
            report = run.solver.work[self._line(name)].report[FORCE_A : FORCE_A + 6].copy()
            return report[:3], report[3:]
        if run.model is not self._signed:
            model = self._only
            held, turns = model.ends.values.held, [bool(model.line.element[-k]) for k in (0, 1)]
            parts = held[0], held[1], turns[0], -1.0 * turns[1]
            self._signed, self._signs = run.model, np.repeat(np.array(parts, float), 3).reshape(OF_ENDS, 3)
        report = run.solver.work[0].report
        if report is not self._report:
            self._report, self._reported = report, report[: 3 * OF_ENDS].reshape(OF_ENDS, 3)
        return EndForces(*(self._reported * self._signs))

    @one_thread
    def stiffness(self, name: str) -> Floats:
        """Interface stiffness (3, 3) N/m: the force it takes to shift a held point at the end of the last step.

        Inertial axes.  By minus that, times a shift of the place that was set, the force of the lines there changes
        where the step is taken again: Newton's method of an implicit coupling.  It has the inertia and the damping of
        the step in it (of its last part, where it was cut), and is not the static stiffness; directions that the point
        holds stay.  Before the first step: as of a step of time.step.  ValueError: the point is not held, a step has
        failed, a sheave turns freely, or a line there is joined to others at its other end.
        """
        self._check_open()
        self._check_sound()
        here, run = self._ends_at(name), self._run
        if any(run.state.lines[line].sheave.size for line, _ in here):
            raise ValueError("the stiffness of a line over a sheave that turns freely is not worked out")
        if not self._is_held(name):
            raise ValueError(f"{self._key_of(name)} is not held: it has no stiffness that is felt from outside")
        if any(max(run.model.joints[line]) >= 0 for line, _ in here):
            raise ValueError(f"a line at {self._key_of(name)} is joined to others: its stiffness is not worked out")
        return np.asarray(sum(self._stiffness_of(*at) for at in here))

    def _stiffness_of(self, line: int, k: int) -> Floats:
        """The same of an end of a line."""
        run = self._run
        run.ends_of_now()
        states = run.other.lines[line], run.state.lines[line]
        step = run.resolution.one.step
        taken = step_taken(run.lines[line].books.clock, run.last_step, step, run.loop.controlled)
        return interface_stiffness(run.model.models[line], k, states, taken, self.t)

    def _line(self, name: Any) -> int:
        names = self._run.model.names
        if not isinstance(name, str) or name not in names:
            raise ValueError(f"name: expected a line of the scene ({', '.join(names)}), found {name!r:.60}")
        return names.index(name)


# How the force on an end of one cable changes with the place it is set to: the factors of the last step.
#
# With the balance of the end in place of its condition, the equations of the step are A x = b, where a force f on the
# end is b = -f in its rows; the end then gives way by the inverse of what it takes to shift it.  Inertia and damping of
# the step (dv'/dr' = cv, dvd'/dr' = ca, step.step_control) are in A, so that it is what an iteration over the
# same step needs, not the static stiffness.


class StepTaken(NamedTuple):
    """The last step of a line, as the weights of the scheme took it."""

    dt: float  # s; 0: none has been taken
    length: float  # s, the same, or that of the step to come where none has been taken
    before: float  # s, that of the step before
    rho: float  # spectral radii at infinity of both
    rho_before: float


def step_taken(clock: Clock, dt: float, step: float, controlled: bool) -> StepTaken:
    """The step of `dt` (s) that has led to the state of now; step: s, that of one to come where none has."""
    if not dt > 0.0:
        return StepTaken(0.0, step, 0.0 if controlled else step, float(clock.rho), float(clock.rho))
    before, rho_before = float(clock.step_before), float(clock.rho_before)
    if not controlled:
        before, rho_before = before_fixed.py_func(dt, before, rho_before, float(clock.rho))
    return StepTaken(dt, dt, before, float(clock.last_rho), rho_before)


def interface_stiffness(model: Model, k: int, states: tuple[State, State], taken: StepTaken, t: float) -> Floats:
    """(3, 3) N/m, inertial: the force it takes to shift end k (0 or 1) at the end of the last step.

    states: before the last step and now, at t (s).  Directions that are held stay; contact of the line with itself is
    left out.  ComputationError: the end moves without resistance.
    """
    am, af, ga, be, _ = weights.py_func(taken.rho, taken.rho_before, taken.before / taken.length)
    cv, ca = ga / (be * taken.length), (1.0 - am) / ((1.0 - af) * be * taken.length**2)
    line = model.line._replace(bits=model.line.bits & ~PLANAR)
    ends = model.ends.values
    held = ends.held.copy()
    held[k] = 0
    work = newton.workspace_of(line, keep=True)
    old, new = states
    work.u[:] = new.r - old.r if taken.dt > 0.0 else 0.0
    bad = newton.assembly_of_step(line, model.sea.values, ends._replace(held=held), old, new, cv, ca, work)
    give, n = np.zeros((3, 3)), line.h.size
    x, load = np.zeros((n + 1, SIZE)), np.zeros((n + 1, SIZE))
    for axis in range(3):
        load[:] = 0.0
        load[-k, 1 + axis] = 1.0
        if bad >= 0 or not solve_again(work.X, work.W, load, x):
            raise ComputationError(Outcome.SINGULAR, t, float(line.s[-k]), "this end moves without resistance")
        give[:, axis] = x[-k, 1:4]
    return np.asarray(-np.linalg.inv(give))
