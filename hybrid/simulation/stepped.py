"""What `hybrid.Simulation` gives out and takes in, and states to come back to.

It gives out and takes in states, forces, vectors that are checked and obstacles that are set.  States are kept in
memory for steps that are computed several times over.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from math import isfinite
from time import monotonic
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.state.report import SEEN_FORCE, SEEN_MOMENT, SEEN_TURN
from hybrid.kernels.state.state import Floats, State, obstacles_now
from hybrid.kernels.step.step_control import decimal_time
from hybrid.model.ends import STILL, DrivenEnd, rotation_vector
from hybrid.model.mesh import Zone
from hybrid.model.network import NetworkModel
from hybrid.model.sea import Surroundings
from hybrid.scene.network import SomeScene
from hybrid.simulation.run import Run
from hybrid.simulation.run_record import checkpoint, set_state
from hybrid.solve.stepper import LineFailed, NetworkState
from hybrid.store.recorder import Mark, Rows
from hybrid.store.writer import Recorder


class CableState(NamedTuple):
    """Where the cable is; arrays of one's own."""

    t: float  # s
    s: Floats  # (N+1,) m, unstretched arc length of the nodes
    position: Floats  # (N+1, 3) m, inertial
    velocity: Floats  # (N+1, 3) m/s
    tension: Floats  # (N,) N, of the cells between
    zones: tuple[Zone, ...]


class EndForces(NamedTuple):
    """Forces (3,) N and moments (3,) N m of the cable on what holds its ends, inertial; zero where nothing holds it."""

    start: Floats
    end: Floats
    moment_start: Floats
    moment_end: Floats


Triple = tuple[float, float, float]
P = ParamSpec("P")
R = TypeVar("R")


def one_thread(method: Callable[Concatenate[Any, P], R]) -> Callable[Concatenate[Any, P], R]:
    """A method that refuses with ValueError while another thread is in one of its object's methods."""

    @wraps(method)
    def alone(self: Any, *args: P.args, **options: P.kwargs) -> R:
        if not self.lock.acquire(False):
            raise ValueError("another thread is using this Simulation: one at a time, or a Simulation for each")
        try:
            return method(self, *args, **options)
        finally:
            self.lock.release()

    return alone


# Of a step: a step so short is round-off of the times of others.
SLIVER = 1e-6


def end_of_step(now: float, step: float | None, duration: float) -> float:
    """Time (s) at which the next step of the scene's length ends; ValueError: steps follow the motion."""
    if step is None:
        raise ValueError("steps follow the motion: use advance(until), or give time.step")
    taken, until = round(now / step), now + step
    if abs(taken * step - now) < SLIVER * step:
        until = decimal_time.py_func((taken + 1) * step)  # where steps of a run end, without round-off that adds up
    return until if duration - until > SLIVER * step else duration


Given = Sequence[float] | Floats | None


def vector(x: Sequence[float] | Floats, name: str) -> Floats:
    value = numbers(x, name)
    if value.shape != (3,) or not all(map(isfinite, value.tolist())):
        raise ValueError(f"{name}: expected three finite numbers, found {x!r:.60}")
    return value


def triple(x: Sequence[float] | Floats, name: str) -> Triple:
    """As `vector`, for what is set at every step: a tuple or list of floats is not made an array first."""
    if type(x) in (tuple, list) and len(x) == 3:
        a, b, c = x
        if type(a) is type(b) is type(c) is float and isfinite(a) and isfinite(b) and isfinite(c):
            return a, b, c
    a, b, c = vector(x, name).tolist()
    return a, b, c


def numbers(x: Any, name: str) -> Floats:
    try:
        return np.array(x, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers, found {x!r:.60}") from None


def rotation_asked(matrix: Any, name: str) -> Floats:
    """A rotation matrix (3, 3) that is set from outside.  ValueError: it is none."""
    wanted = numbers(matrix, name)
    proper = wanted.shape == (3, 3) and np.allclose(wanted.T @ wanted, np.eye(3), atol=1e-6)
    if not (proper and np.linalg.det(wanted) > 0.0):
        raise ValueError(f"{name}: expected a rotation matrix (3, 3), right-handed")
    return wanted


def in_space(scene: SomeScene) -> SomeScene:
    return scene if scene.dimension is not None else scene.model_copy(update={"dimension": 3})


def iterations_allowed(most: Any) -> int:
    """Newton iterations that a step may take; 0: no bound."""
    if most is None:
        return 0
    if isinstance(most, bool) or not isinstance(most, int | np.integer) or most < 1:
        raise ValueError(f"most_iterations: expected a whole number of at least 1, found {most!r:.60}")
    return int(most)


# Obstacles that a program outside moves, and what it reads there.

# Of a step: what is set for so long at most is set for one step.
ONE_STEP = 1.5
Course = tuple[Triple, Triple | None, Triple]  # where an obstacle is to be, how fast, and how far it turns on the way


def set_out(ends: Sequence[DrivenEnd], course: Course | None, now: float, until: float, one_step: bool) -> None:
    """What is set is on its way from `now` to `until` (s), None: it stays; one_step: whether in one step."""
    for end in ends:
        if course is None:
            end.stay(now, until, one_step)
        else:
            end.set(now, until, *course, one_step)


class ObstacleState(NamedTuple):
    """Place (3,) m of an obstacle, its rotation (3, 3) since t = 0, and the load of all lines.

    Inertial: force (3,) N, and moment (3,) N m about its place.
    """

    position: Floats
    rotation: Floats
    force: Floats
    moment: Floats


class SettableObstacles:
    """The obstacles of a scene that is stepped from outside."""

    lock: Any
    scene: Any
    _run: Run
    _closed = False
    _failed: tuple[LineFailed, ComputationError] | None = None  # of the last step, until `restore`
    _courses: dict[str, Course]  # of those that are set for the next step
    _moved: dict[str, None]  # those that have been set at all, in order

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return self._run.t

    def _check_open(self) -> None:
        if self._closed:
            raise ValueError("the simulation is over: its result has been written")

    def _check_sound(self) -> None:
        """Of what belongs to the last step: after one that failed there is none until `restore`."""
        if self._failed is not None:
            reason = str(self._failed[1]).splitlines()[0]
            raise ValueError(f"a step has failed ({reason}): restore() what save() returned, or close()")

    def _states(self) -> list[tuple[Surroundings, State]]:
        """The sea around each line, and the state of that."""
        return [(x.sea, state) for x, state in zip(self._run.model.models, self._run.state.lines, strict=True)]

    @one_thread
    def set_obstacle(
        self, name: str, position: Given = None, velocity: Given = None, rotation: Floats | None = None
    ) -> None:
        """Where an obstacle is to be at the end of the next step or `advance`, which it reaches smoothly.

        name: of one with `from_outside`; position: (3,) m of its place `at`, inertial, None: where it is; velocity:
        (3,) m/s there, None: as of `set_end`; rotation: (3, 3), about that place, since t = 0, None: as it is; less
        than half a turn on the way.  One that is not set again stays where it is.  ValueError: there is no such one.
        """
        self._check_open()
        now = self._obstacle_paths(name)[0].at_time(self.t)
        there = triple(now[0] if position is None else position, "position")
        speed, turn = None if velocity is None else triple(velocity, "velocity"), STILL
        if rotation is not None:
            turn = triple(rotation_vector(now[2].T @ rotation_asked(rotation, "rotation")), "rotation")
        self._courses[name], self._moved[name] = (there, speed, turn), None

    @one_thread
    def obstacle(self, name: str) -> ObstacleState:
        """Where an obstacle is now, and what the lines do to it.  ValueError: there is no such, or none moves."""
        if name not in self.scene.obstacles:
            raise ValueError(f"name: expected {_one_of(self.scene.obstacles)}, found {name!r:.60}")
        if not any(x.moves for x in self.scene.obstacles.values()):
            raise ValueError("no obstacle of the scene moves: write `from_outside: true` at one to read them")
        k, found = list(self.scene.obstacles).index(name), []
        for around, state in self._states():
            around.roll_as(state)
            found.append(obstacles_now(around.at_time(self.t), state)[k])
        first, acting = found[0], np.sum(found, axis=0)
        rotation = first[SEEN_TURN:SEEN_FORCE].reshape(3, 3).copy()
        return ObstacleState(
            first[:SEEN_TURN].copy(), rotation, acting[SEEN_FORCE:SEEN_MOMENT].copy(), acting[SEEN_MOMENT:].copy()
        )

    def _obstacle_paths(self, name: str) -> list[DrivenEnd]:
        """An obstacle that is set from outside, as each line knows it."""
        found = [around.driven[name] for around, _ in self._states() if name in around.driven]
        if not found:
            known = [x for x, obstacle in self.scene.obstacles.items() if obstacle.from_outside]
            raise ValueError(f"name: expected {_one_of(known)} that has from_outside, found {name!r:.60}")
        return found


def _one_of(names: Any) -> str:
    return f"an obstacle of the scene ({', '.join(names) or 'there is none'})"


# Outputs and events, of which no more may be taken back: they are in memory.
MOST_WAITING = 1000


class Saved(NamedTuple):
    """What `Simulation.save` returns."""

    owner: object  # what tells one simulation from another
    number: int  # of the state that was final then
    run: Mapping[str, Any]  # arrays and plain values, as of a checkpoint
    model: NetworkModel  # with what had broken by then
    waiting: tuple[Any, ...]  # rows of each line that are not recorded yet
    marks: tuple[Mark, ...]  # of the recorders
    before: NetworkState  # the state before the last step
    stood: tuple[tuple[Floats, Floats], ...]  # positions (2, 3) m and frames (2, 9) of the ends of each line
    loads: tuple[Any, ...]  # of these ends
    asked: Mapping[str, Any]  # what was set from outside, and the stops to come: as of `stepping.ASKED`
    paths: Mapping[str, list[Floats]]  # on which points that are set from outside are, for each end there
    obstacles: Mapping[str, Floats]  # the same of obstacles


def recorders(run: Run) -> list[Rows]:
    """Those of the network and of its lines."""
    found = dict.fromkeys((run.recorder, *(line.recorder for line in run.lines)))  # that of a cable is the only one
    return [x for x in found if isinstance(x, Rows)]


def marks_of(run: Run) -> tuple[Mark, ...]:
    """Where all recorders stand."""
    return tuple(x.mark() for x in recorders(run))


def is_full(run: Run, marks: Sequence[Mark]) -> bool:
    """Whether too much came after these marks."""
    return any(x.since(mark) > MOST_WAITING for x, mark in zip(recorders(run), marks, strict=True))


def commit(run: Run) -> None:
    """What has been recorded until now is final; it is written where that is due.

    LineFailed where an output says that going on would make no sense.
    """
    assert isinstance(run.recorder, Recorder)
    due, begin = run.recorder.due, monotonic()
    run.record_samples()
    run.write_log()
    if due:
        for line in run.lines:
            line.write_down()
            line.write_envelope(run.t)
        run.recorder.replace(run.file.quantities.range_values())
    run.gather_events()
    if due:
        run.recorder.flush(monotonic() - begin)


def kept(run: Run) -> dict[str, Any]:
    """What a run depends on, in copies: fields of `Saved`."""
    run.record_samples()
    run.write_log()
    run.ends_of_now()
    run.gather_events()
    run.end_step()
    models = run.model.models
    found = {"run": copied(checkpoint(run)), "model": run.model, "marks": marks_of(run), "before": run.other.copy()}
    found |= {"stood": tuple((x.ends.values.position.copy(), x.ends.values.frame.copy()) for x in models)}
    found |= {"loads": tuple(x.ends.keep_loads() for x in models)}
    return found | {"waiting": tuple(line.waiting() for line in run.lines)}


def bring_back(run: Run, saved: Saved) -> None:
    """Be as when `kept` was called; ends that are set from outside must be on their paths of then."""
    run.write_log()  # parts have seen all steps, and what they say of them is taken back
    run.gather_events()
    for recorder, mark in zip(recorders(run), saved.marks, strict=True):
        recorder.back_to(mark)
    # Something has broken since, or contact has begun, or zones or lengths have changed, or what changes is under way.
    moving = {line.number for line in run.lines if line.changes_cells}
    if run.model is not saved.model or moving:
        run.model = saved.model
        for k, (line, model, rows) in enumerate(zip(run.lines, saved.model.models, saved.waiting, strict=True)):
            line.wait_again(rows._replace(outputs=(), ratios=(), aside=(), log=()))
            if k not in moving:
                line.use_model(model)
        for part in reversed(run.parts):
            part.restore_lines(saved.run)
        if moving:
            run.renew_other()
        run.make_solver()
    for model, loads in zip(run.model.models, saved.loads, strict=True):
        model.ends.bring_back_loads(loads, saved.run["t"])
    set_state(run, saved.run)
    for old, then in zip(run.other.lines, saved.before.lines, strict=True):
        for x, value in zip(old, then, strict=True):
            x[:] = value
    for line, rows in zip(run.lines, saved.waiting, strict=True):
        line.wait_again(rows)
        line.model.sea.at_time(run.t)
    run.model.load_bodies(run.t, run.solver.bodies, run.loaded)


def copied(x: Any) -> Any:
    """Named arrays and plain values, as they are once they have been in a file."""
    if isinstance(x, np.ndarray):
        return x.copy()
    if isinstance(x, dict):
        return {name: copied(value) for name, value in x.items()}
    if isinstance(x, list | tuple):
        return [copied(value) for value in x]
    return x.item() if isinstance(x, np.generic) else x
