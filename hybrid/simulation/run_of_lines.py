"""A run between two steps: its arrays, and how they change; with the parts that change loads and listen.

Parts name this, and not the run whose steps they are asked in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import DONE, SPRING
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import SELF_CONTACT, SELF_CONTACT_ENERGY
from hybrid.kernels.state.state import Floats, Line, Moves, Work
from hybrid.model.build import Model
from hybrid.model.contents import touching
from hybrid.model.ends import table_of_loads
from hybrid.model.nearby import unclamped, without_hold
from hybrid.model.network import NetworkModel, NetworkResolution, build_network
from hybrid.model.plan import SAME_STOP
from hybrid.scene.base import Table
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.diagnostics import LineStep
from hybrid.simulation.equilibrium import joined_lines
from hybrid.simulation.events import Sink
from hybrid.simulation.parts import Part, Parts, Sampled
from hybrid.simulation.progress import ProgressReporter
from hybrid.simulation.restart import LoadChange
from hybrid.simulation.run_line import MOST_WAITING, RunLine
from hybrid.simulation.run_quantities import RunQuantities
from hybrid.solve.contact import SelfContact, SharedContact
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import MOST_SAMPLED, NetworkSteps
from hybrid.solve.stepper import LineFailed, NetworkState, NetworkTaken
from hybrid.store.format import Target
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.whole_file import digest_of
from hybrid.store.writer import Recorder
from hybrid.zones.change import on_layout
from hybrid.zones.manager import UserCriterion

if TYPE_CHECKING:  # what a run without winches does not load
    from hybrid.simulation.payout import PayingOut

AnyRecorder = Recorder | ComparisonRecorder


class FileOfRun(Protocol):
    """The file of a run, as the run that grows in it needs it."""

    quantities: RunQuantities

    @property
    def span(self) -> tuple[float, float]: ...

    @property
    def noted(self) -> Sink: ...

    def gather(self) -> None: ...


class RunOfLines:
    """A run between two steps; what stands here parts change, and the solver follows (`make_solver`)."""

    network: Network
    model: NetworkModel
    state: NetworkState
    other: NetworkState  # after the next step
    solver: NetworkSolver
    loop: NetworkSteps
    lines: list[RunLine]
    scenes: list[LineScene]
    resolution: NetworkResolution
    parts: Parts
    file: FileOfRun
    recorder: AnyRecorder
    target: Target | None  # None: it is only to be compared with
    criterion: UserCriterion | None  # one more for zones that move
    times: Sequence[float]  # s, of outputs after the first
    moves: bool  # whether it is no equilibrium
    changes: Sequence[LoadChange[Network]] = ()  # of loads
    rest: Floats  # bodies when the motion began
    found: LinesAtRest | None  # from which it starts
    touching: tuple[list[SelfContact | None], SharedContact | None]  # contact of each line with itself, and of all
    contact_energy: Floats | None = None  # (L,) J, of each line, after the last accepted step; None: tries change none
    loaded = 0.0  # s, loads that have stopped by then act no more
    leg = (0.0, 0)  # where equal steps to a stop began (s), and how many are done
    cpu = 0.0  # s, of the processor, in earlier parts of the run
    _moved: Sequence[Moves] = ()  # by which ends move in compiled steps
    _loaded = np.nan  # `loaded`, of the loads that act on bodies in compiled steps

    # --- what it is -----------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return float(self.loop.clock.now)

    @property
    def steps(self) -> int:
        """Steps so far."""
        return int(self.loop.counts.steps)

    @property
    def last_step(self) -> float:
        """Length, s, of the step that led to the state; 0: it is a start."""
        return float(self.loop.clock.last_dt)

    @property
    def last_rho(self) -> float:
        """Its spectral radius."""
        return float(self.loop.clock.last_rho)

    @property
    def interval(self) -> float:
        """What the step took (s) that led to the state, of which outputs within the next are made, too; 0: unknown."""
        return float(self.loop.clock.now - self.loop.clock.previous)

    @property
    def touches(self) -> bool:
        """Whether contact of a line with itself is computed."""
        return any(model.line.bits & SELF_CONTACT for model in self.model.models)

    @property
    def turned(self) -> bool:
        """Whether moments are given at points."""
        return any(getattr(point, "moment", None) is not None for point in self.network.points.values())

    @property
    def files(self) -> dict[str, str]:
        """Digests of the files of motions and loads, by path, of all that holds at some time."""
        found = files_of(self.network)
        for x in self.changes:
            found |= files_of(x.scene)
        return found

    @property
    def span(self) -> tuple[float, float]:
        """Arc lengths (m) of its events."""
        return self.file.span

    @property
    def noted(self) -> Sink:
        """What notes events of the whole run."""
        return self.file.noted

    def note(self, kind: str, text: str, **more: float) -> None:
        """Note an event of the whole run, now."""
        self.noted.event(self.t, *self.span, kind, text, **more)

    # --- solver and steps -------------------------------------------------------------------------------

    def start_from(self, bodies: Floats) -> None:
        """Take the added mass of members of bodies that were at rest (B, STATE) when the motion began."""
        self.rest = bodies.copy()
        for body, row in zip(self.model.bodies, bodies, strict=False):
            body.set_added_mass(row)

    def make_solver(self) -> None:
        """A solver for the model as it is."""
        for fit_lines in self.parts.fit_lines:
            fit_lines()
        lines, bodies = joined_lines(self.model, 0.0), self.model.body_numbers(0.0)
        for line, x in zip(self.lines, lines, strict=True):
            line.held = x.ends.held
        self.solver = NetworkSolver(lines, len(self.model.free), bodies, *self.touching, self.resolution.tolerance)
        self._make_room(self.solver)
        self.solver.keep_books([line.books for line in self.lines])
        for use_solver in self.parts.use_solver:
            use_solver(self.model, self.solver)
        if self.loop.controlled:
            self.solver.allowed[:] = self.resolution.allowed
        self.loop.bind_members(self.model.members_of(self.solver.bodies))
        self._moved, self._loaded = [], np.nan

    def _make_room(self, solver: NetworkSolver) -> None:
        """Room for samples of the lines and bodies as they are."""
        size = sum(line.sample_size for line in self.lines)
        rows = max(1, min(MOST_SAMPLED // size, *(line.together for line in self.lines)))
        for line in self.lines:
            line.make_room(rows, MOST_WAITING // size)
        self.loop.make_room(rows, len(solver.body_work))

    @property
    def asks_quantities(self) -> bool:
        """Whether quantities by name are among the outputs, which are found of one mesh at a time."""
        return bool(self.file.quantities.fields)

    def adopt_cells(self, number: int, model: Model, work: Work) -> None:
        """Go on with other cells of a line, which steps have changed to."""
        line, self.model = self.lines[number], self.model.with_lines({number: model})
        self.solver.adopt_cells(number, model.line, model.sea.values, work, line.books)
        line.adopt_cells(model)

    def end_step(self) -> None:
        """Nothing of the step that led here is left to do, of which a checkpoint would not know."""
        if self.loop.is_open:
            self._attach()
            self.loop.end_step()

    def renew_other(self) -> None:
        """Room for the state after the next step, of lines as they are now."""
        self.other = self.state.copy()

    def place_ends(self, t: float) -> None:
        """Ends, seas and loads on bodies are as at t (s), wherever a try has moved them on to."""
        for line, model in zip(self.lines, self.model.models, strict=True):
            model.ends.at_time(t)
            model.sea.at_time(t)
            line.books.velocity[:] = model.ends.velocity
        self.model.load_bodies(t, self.solver.bodies, self.loaded)

    def ends_of_now(self) -> None:
        """Let ends and sea be as they are now: compiled steps have moved them without Python."""
        if not self.loop.counts.asks & b.ASK_BEFORE:
            for model in self.model.models:
                model.ends.at_time(self.t)
                model.sea.at_time(self.t)

    def _attach(self) -> None:
        """Steps lead from the state of now, with ends that move as they do now."""
        loop, solver = self.loop, self.solver
        loop.counts.asks = 0
        if loop.attach(solver, self.state, self.other):
            for line, old, new in zip(self.lines, self.state.lines, self.other.lines, strict=True):
                line.attach(solver, (old, new), loop.clock, loop.counts)
        for attach in self.parts.attach:
            attach(loop)
        moves = [model.ends.moves() for model in self.model.models]
        if len(moves) != len(self._moved) or any(x is not y for x, y in zip(moves, self._moved, strict=True)):
            self._moved = moves
            loop.move(solver, [model.ends.moves_from_here() for model in self.model.models])
        if self._loaded != self.loaded:
            self._loaded = self.loaded
            loop.load(*table_of_loads(self.model.growing_loads(self.loaded)))

    def restart_steps(self) -> None:
        """Loads, or what holds the lines, are others now: accelerations jump."""
        self.balance()
        self.loop.restart()

    def balance(self) -> None:
        """Accelerations and tensions that are consistent with positions, velocities and loads.  LineFailed."""
        step, solver = self.resolution.one.step if self.moves else 1.0, self.solver
        accelerations = [model.ends.acceleration(self.t, 1e-3 * step) for model in self.model.models]
        self.place_ends(self.t)
        self.model.update_water(self.t, self.state.bodies, 0.0, solver.bodies)

        def solve(lengthening: Mapping[int, Floats]) -> NetworkTaken:
            return solver.consistent_accelerations(self.state, accelerations, self.t, lengthening)

        for find_accelerations in self.parts.find_accelerations:
            solve = find_accelerations(solve)
        solve({})

    # --- other lines in mid-motion --------------------------------------------------------------------

    def renew_solver(self, after: str) -> None:
        """Another solver in mid-motion, for lines that have changed; after: what, for the text of a failure."""
        self.gather_events()  # in the order in which they happen
        bodies, work = self.solver.bodies.copy(), self.solver.body_work.copy()
        self.make_solver()
        self.solver.bodies[:], self.solver.body_work[:] = bodies, work
        self.renew_other()
        self.evaluate_forces(after)

    def change_lines(self, changes: Mapping[int, Callable[[Line], Line]]) -> None:
        """These lines, by number, are changed so on the same cells; the solver has still to follow."""
        models = {k: replace(x := self.model.models[k], line=change(x.line)) for k, change in changes.items()}
        for k, change in changes.items():
            self.lines[k].change_line(models[k], change)
        self.model = self.model.with_lines(models)

    def go_on_changed(self, numbers: Iterable[int], after: str) -> None:
        """Another solver, for lines of these numbers that have changed, and that share contact with those.

        What that changes of the energy of contact is booked: of all lines, where that of the last step is known.
        """
        known = self.contact_energy
        of = range(len(self.lines)) if known is not None else numbers
        before = {k: float(self.solver.work[k].report[SELF_CONTACT_ENERGY] if known is None else known[k]) for k in of}
        self.renew_solver(after)
        for k, energy in before.items():
            more = float(self.solver.work[k].report[SELF_CONTACT_ENERGY]) - energy
            self.lines[k].books.work[0, b.ZONES] += more

    def evaluate_forces(self, after: str) -> None:
        """The forces of the state of now; after: as of `renew_solver`.  LineFailed: there are none."""
        self.place_ends(self.t)
        taken = self.solver.forces_in_motion(self.state, self.t)
        if taken.outcome != Outcome.OK:
            raise LineFailed(taken.line, taken.outcome, self.t, None, after)
        self.note_contact()

    def note_contact(self) -> None:
        """Keep the energy of contact of the state, before other cells change it."""
        if self.contact_energy is not None:
            self.contact_energy[:] = [work.report[SELF_CONTACT_ENERGY] for work in self.solver.work]

    # --- outputs ----------------------------------------------------------------------------------------

    def output_due(self) -> None:
        """Make the output that is due now, if one is: before loads, or what holds lines, become others."""
        if self.loop.due:
            self._attach()
            self._output()

    def gather_events(self) -> None:
        """Record the events of the lines, in the result of the network with their names, as they happened."""
        self.file.gather()

    def _output(self) -> None:
        """Record points, bodies and lines as they are, where an output is due."""
        while not self.loop.sample():
            self.record_samples()
        self.record_samples()

    def record_samples(self) -> None:
        """Record what has been sampled of points, bodies and lines."""
        count = int(self.loop.counts.samples)
        if not count:
            return
        self.loop.counts.samples = 0
        states = [line.sampled(count) for line in self.lines]
        seen = Sampled(states, self.loop.body_samples[:count])
        for at_output in self.parts.at_output:
            at_output(seen)


class Heard(NamedTuple):
    """Who hears of a run, and whether it is to end."""

    reporter: ProgressReporter
    interrupted: Callable[[], bool]


class WatchedLines(Part):
    """What steps have flagged of lines: how near they are to themselves, and what is doubtful about them."""

    name = "lines"

    def __init__(self, run: RunOfLines) -> None:
        self._run = run

    def note_step(self) -> None:
        """Look at it.  LineFailed where going on would make no sense."""
        run, solver = self._run, self._run.solver
        for line, new, old, work in zip(run.lines, run.state.lines, run.other.lines, solver.work, strict=True):
            if seen := int(run.loop.seen[line.number]):
                line.note_nearness(solver, seen, run.t, run.last_step, new)
            if line.books.counts.notices:
                line.watch(LineStep(run.t, new, old, work.report, line.books))


class FirstStates(Part):
    """What is doubtful about the first state of each line, and beyond which values steps are to flag it later."""

    name = "diagnostics"

    def __init__(self, run: RunOfLines) -> None:
        self._run = run

    def begin(self) -> None:
        """Note it of a start, or of an equilibrium that is the result."""
        if not self._run.moves:
            for line, x in zip(self._run.lines, self._run.solver.lines, strict=True):
                line.held = x.ends.held
            self._note(None)
            return
        self._note(0.0)
        for line in self._run.lines:
            line.diagnostics.scheme(self._run.network.require_time().rho_inf)
            line.diagnostics.watch(line.books.clock)

    def _note(self, t: float | None) -> None:
        """t: s, where a motion starts, None: there is none."""
        run, turned = self._run, self._run.turned
        for line, x, state in zip(run.lines, run.solver.lines, run.state.lines, strict=True):
            if run.found is not None:
                line.note_equilibrium(x, state, t, run.found, turned)
            else:
                line.note_start(x, state, t)


# Other loads and other motions of points and bodies from some time of a run of several lines on.

# Tables of a network in which loads and motions stand.
LOADED = ("environment", "points", "bodies")
NO_WINCH: Mapping[int, PayingOut] = MappingProxyType({})


def with_loads_of(network: Network, other: Network) -> Network:
    """A network with the loads and motions of another one, which has the same lines."""
    return network.model_copy(update={name: getattr(other, name) for name in LOADED})


def loaded_as(
    model: NetworkModel, network: Network, t: float, paid: Mapping[int, PayingOut] = NO_WINCH
) -> NetworkModel:
    """The same network from t (s) on with the loads and motions of a network; what is joined or loose stays so.

    paid: of lines that are paid out, by number, which keep the cells of now in place of those of t = 0.
    """
    other = build_network(network, model.resolution, model)
    on_now = {k: replace(other.models[k], layout=model.models[k].layout) for k in paid}
    other = other.with_lines({k: x.on(on_now[k], x.length) for k, x in paid.items()})
    models = tuple(_line_as(*each, network, t) for each in zip(model.names, model.models, other.models, strict=True))
    touching = model.touching
    if touching is not None:
        models = tuple(
            replace(x, line=touching.bits(x.line)) if k in touching.lines else x for k, x in enumerate(models)
        )
    supports = {(line, k): other.models[line].ends for line, k in model.supports}
    given = {name: getattr(other, name) for name in ("bodies", "known", "scenes", "moments")}
    return replace(model, models=models, supports=supports, **given)


def _line_as(name: str, now: Model, later: Model, network: Network, t: float) -> Model:
    """The model of a line with other loads, on its cells of now, with what has come off it."""
    for k in (0, 1):
        if now.ends.released[k]:
            later = without_hold(later, k, t)
        elif later.cable.held_tangent[k] and not now.cable.held_tangent[k]:  # it has broken off
            later = unclamped(later, k)
    if now.layout is not None:
        later = on_layout(later, now.layout)
    line = later.line
    for values in ("h", "kb", "k0", "hn", "element", "spin"):
        getattr(line, values)[:] = getattr(now.line, values)  # what is on its way goes on
    line = line._replace(torsion=now.line.torsion)
    if now.line.bits & SELF_CONTACT:
        line = touching(line, network.lines[name].contact.friction)
    later.sea.values.obstacles[:] = now.sea.values.obstacles  # as stiff as they were
    later.ends.go_on_from(now.ends, t)
    return replace(later, line=line)


class LoadChanges(Part):
    """Other loads, and other motions of points and bodies, from some times on."""

    name, older = "loads", MappingProxyType({"changes": 0})

    def __init__(self, run: RunOfLines, changes: Sequence[LoadChange[Network]], made: int) -> None:
        """changes: in their order; made: how many of them already hold."""
        self._run, self._changes, self._made = run, changes, made

    @property
    def due(self) -> float:
        """When the next one begins to hold (s)."""
        return min((x.t for x in self._changes[self._made :]), default=math.inf)

    def begin_leg(self) -> None:
        """Those hold from now on whose time has come."""
        while self.due <= self._run.t + SAME_STOP * self._run.resolution.one.step:
            self._change()

    def _change(self) -> None:
        """The next one holds from now on: lines stay what they are and where they are."""
        run, network = self._run, self._changes[self._made].scene
        run.ends_of_now()
        for line in run.lines:
            line.write_down()
        run.gather_events()  # in the order in which they happen
        paid = {line.number: line.paying for line in run.lines if line.paying is not None}
        run.network, run.model = network, loaded_as(run.model, network, run.t, paid)
        run.loaded = run.t  # loads that end now, or would have ended before, act no more
        run.start_from(run.rest)
        for line, model in zip(run.lines, run.model.models, strict=True):
            line.use_loads(model)
        done = run.solver.body_work[:, DONE:SPRING].copy()
        run.make_solver()
        run.solver.body_work[:, DONE:SPRING] = done
        run.renew_other()
        run.restart_steps()
        others = "other loads act, or points and bodies move otherwise"
        run.note("loads change", f"from t = {run.t:.6g} s on {others}, as `hybrid resume` was asked to")
        self._made += 1

    def checkpoint(self) -> dict[str, Any]:
        """How many hold."""
        return {"changes": self._made}


class ProgressOfRun(Part):
    """Who listens hears how far a run is, and may end it."""

    name = "progress"

    def __init__(self, run: RunOfLines, heard: Heard) -> None:
        self._run, self._heard = run, heard

    def at_pause(self, finished: bool) -> None:
        """Report; KeyboardInterrupt: the run is to end."""
        run, heard = self._run, self._heard
        iterations = int(run.loop.counts.iterations)
        heard.reporter(run.t, run.steps, iterations, run.model.models[0].zones, finished, run.touches)
        if not finished and heard.interrupted():
            raise KeyboardInterrupt


def files_of(scene: Table) -> dict[str, str]:
    """Digests of the files that a scene reads, by path."""
    return {path: digest_of(Path(path)) for path in scene.named_files()}
