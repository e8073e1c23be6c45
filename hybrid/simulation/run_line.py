"""One line of a run: its outputs, its extremes, and what is doubtful about it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.contact.self_contact_law import OUTER
from hybrid.kernels.contact.self_distance import HIDES, MEETS, NEARS, PARTS
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.march.link import holds_twist
from hybrid.kernels.march.zone_torque import answers_of
from hybrid.kernels.mesh.zone_criteria import CRITERIA, twist_of_rods
from hybrid.kernels.run.newton import sharpest
from hybrid.kernels.state.books import (
    HIDES_ITSELF,
    IS_BENT,
    JUMPED,
    LOG,
    MEETS_ITSELF,
    NEARS_ITSELF,
    PARTS_ITSELF,
    STRAINS,
    STRETCHED,
    ZONES,
    Books,
    Clock,
    Counts,
    blank_books,
    sample_size,
)
from hybrid.kernels.state.report import MAY_TOUCH, REMEMBERS, SEABED, SELF_CONTACT, SELF_FRICTION
from hybrid.kernels.state.state import (
    Batch,
    Ends,
    Floats,
    Line,
    State,
    Work,
    batch_of_one,
    copied,
    sampled_size,
    slip_size,
)
from hybrid.model.build import Model, as_begun, planar
from hybrid.model.mesh import Zone
from hybrid.model.resolution import follows_curvature, wants_errors
from hybrid.model.sections import SAME_PLACE, OutputPoints, output_points, section_changes, wave_step
from hybrid.outputs.observation import Observation, Output, outputs_in
from hybrid.outputs.probes import Features, Observer, Recorded
from hybrid.outputs.quantities import quantities_of
from hybrid.scene.schema import LineScene
from hybrid.simulation.diagnostics import Diagnostics, LineStep, Stop
from hybrid.simulation.events import FASTEST, EventLog, borne_strain, energy_gains_text, note_laid, stretch_text
from hybrid.simulation.lines_contact import LinesWatch, diameters, least_bending
from hybrid.simulation.remesh import HasPlane
from hybrid.simulation.result_file import Envelope, marked_places, marks_on
from hybrid.simulation.run_sample import COMPARED
from hybrid.solve.contact import SelfContact
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import batch_of_rows, no_extremes
from hybrid.solve.stability import slack_cell
from hybrid.solve.stepper import JoinedLine, LineFailed
from hybrid.store.recorder import Rows
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.zones.manager import Change, DomainManager

if TYPE_CHECKING:
    from hybrid.simulation.cell_changes import CellChanges
    from hybrid.simulation.payout import PayingOut
    from hybrid.simulation.payout_nodes import NodeChanges

# Columns of the step log that runs to compare with keep: time, forces at both ends.
FORCE_COLUMNS = [LOG.index(name) for name in ("t", "end_force_start", "end_force_end")]
# Outputs of a line that wait for one another, because quantities of all of them are computed together: at most so many,
# of so many numbers, 2 MB, which a processor keeps: with 64 of 100 cells a run takes 5 % more, with 256 3 %.
WAITING, TOGETHER = 512, 250_000
MOST_WAITING = 4_000_000  # numbers of those of all lines that wait, 32 MB: quantities of fewer outputs take as long
MOST_ASIDE = 20_000  # nodes of outputs that are put aside
# Flags of a step (kernels.state.books), and bits of kernels.contact.self_distance.
WATCHED = {MEETS_ITSELF: MEETS, NEARS_ITSELF: NEARS, PARTS_ITSELF: PARTS, HIDES_ITSELF: HIDES}
# Turns of twist at rest, made by no moment, from which on it is said: searches by way of upright shapes have left 0.4.
WOUND = 0.25


def twist_at_rest(x: JoinedLine, state: State) -> float:
    """Turns between the cells of a line that holds its twist and is clamped to what may turn; 0 for others."""
    line = x.line
    if not (holds_twist(line) and line.element.any() and x.seats[:, TURNS].any()) or line.tension_torque.size:
        return 0.0
    within = line.element.copy()
    within[[0, -1]] = 0  # the frames of its ends are known to the points and bodies alone
    twist = twist_of_rods(line._replace(element=within), np.zeros((2, 9)), state.e, state.a1)
    return float(twist) / (2.0 * np.pi)


class Wanted(NamedTuple):
    """What is wanted of the outputs of a line beside what its scene says."""

    # what makes the recorder of a line that starts from an equilibrium or not, with so many outputs after the first;
    # None: it is only to be compared with
    record: Callable[[RunLine, LinesAtRest | None, int], Rows] | None
    points: OutputPoints | None  # None: those of the scene


def observer_of(
    scene: LineScene, model: Model, moves: bool, only: Sequence[str] | None = None, points: OutputPoints | None = None
) -> Observer:
    """What records the outputs of a line at points (None: those of its scene).

    moves: whether it does, or is in equilibrium; only: quantities, None: all.
    """
    if points is None and moves and model.payout is not None:
        points = output_points(scene, model.payout.longest, not model.payout.side)
    points = points or output_points(scene)
    zones_move = moves and model.layout is not None
    kinds = {"rod", "catenary"} if zones_move else None
    criteria = [(x.name, x.ratio) for x in CRITERIA] if scene.output.criteria and zones_move and only is None else ()
    paid, obstacles = model.payout, () if only else model.sea.names
    rides = 0 if paid is None else paid.layer.size * (1 if paid.side else -1)
    changing = only is None and (rides or (zones_move and follows_curvature(scene)))
    finest = model.finest_nodes if changing else None
    of_cells = kinds, finest, rides if finest is not None else 0, moves * rides
    features = Features(model.attached, section_changes(scene), model.hinges, *of_cells, obstacles)
    edges = moves and only is None and wants_errors(scene) and bool(model.line.bits & SEABED)
    gauges, asked = () if only else scene.output.elevation or (), None if only else quantities_of(scene)
    recorded = Recorded(moves and only is None, only, criteria, edges, gauges, asked)
    line = model.line if model.plane is None else planar(model.line, model.plane)
    line = as_begun(line, model.held, scene.dimension)
    observer = Observer(line, model.sea.values, model.zones, points, features, recorded)
    observer.line = model.line
    return observer


class ZonesOfLine(Protocol):
    """What moves the zones of a line (simulation.run_zones)."""

    @property
    def remeshes(self) -> bool: ...
    def change_line(self, change: Callable[[Line], Line]) -> None: ...
    def use_loads(self, model: Model) -> None: ...
    def release(self, end: int, model: Model) -> None: ...
    def switch(self, change: Change, here: NDArray[np.bool_] | None) -> None: ...


class Waiting(NamedTuple):
    """What waits to be recorded of a line."""

    outputs: Sequence[Batch]
    ratios: Sequence[Floats]  # of criteria, of these
    aside: Sequence[tuple[Model, Output]]  # outputs of other cells
    log: Sequence[Floats]  # rows of steps
    first_energy: float | None  # J, that the balance counts from


class RunLine:
    """What is recorded of one line."""

    cells: CellChanges | NodeChanges | None = None  # what changes cells, or lets nodes enter and leave, without Python
    _at_rest: tuple[Sequence[float], State]  # the sharpest bend and twist of an equilibrium, and its state
    lets_touch = True  # whether contact begins by itself where the line comes near itself
    nears_itself = parts_itself = False  # whether contact with itself has to begin, or to end
    has_neared_itself = False  # whether that was so at some time
    watched_by: LinesWatch | None = None  # whether it meets others, between which no contact is computed
    plane: HasPlane | None = None  # of a line alone
    contact: SelfContact | None = None
    shares = False  # whether its contact is computed with that of other lines
    manager: DomainManager | None = None  # of zones that move
    zones: ZonesOfLine | None = None  # what moves them
    shown: Callable[[Batch], None] | None = None  # what looks at outputs beside the recorder
    _most = 1  # outputs that may wait
    _sampled: Sequence[Output] = ()  # of several meshes, of which `output` is still to be told

    def __init__(
        self,
        number: int,
        name: str,
        scene: LineScene,
        model: Model,
        found: LinesAtRest | None,
        state: State,
        outputs: int,
        wanted: Wanted,
        paying: PayingOut | None,
    ) -> None:
        """number: of the line in its network; found: the equilibrium that it starts from, or None.

        state: from which displacements count; outputs: after the first, 0 of an equilibrium; paying: the length of a
        line that is paid out.
        """
        self.number, self.name, self.model, self.scene = number, name, model, scene
        self.events, self.paying = EventLog(), paying
        self.held = np.ones(2, np.int8)  # (2,) ends that count as held in outputs: all but free ones, by their points
        self.diagnostics = Diagnostics(model, self.events)
        self._moves = outputs > 0
        only = COMPARED if wanted.record is None else None
        self.observer = observer_of(scene, model, self._moves, only, wanted.points)
        self.envelope = Envelope(scene, model, self._moves, found is not None and found.settled)
        self.marked = marked_places(scene, model)
        self.envelope.itself.on &= wanted.record is not None or bool(model.line.bits & MAY_TOUCH)
        self.envelope.itself.renew(model)
        self.recorder: Rows | ComparisonRecorder
        record = wanted.record
        self.recorder = ComparisonRecorder(FORCE_COLUMNS) if record is None else record(self, found, outputs)
        self.envelope.count_from(model, state.r)
        self.books = self._blank_books(state.r)
        if self.envelope.quantities:
            self.books = self.envelope.quantities.given_to(self.books)
        self._touching = model  # for whose cells that is
        self._waiting: list[Batch] = []
        self._ratios: list[Floats] = []  # of criteria, where they are written
        self._aside: list[tuple[Model, Output]] = []  # that wait, each of a line of its own
        self._log: list[Floats] = []

    def _blank_books(self, begin: Floats) -> Books:
        """Books that keep the extremes of all steps, for the cells of now.

        begin: (N+1, 3) m, from where displacements count.
        """
        line, marks = self.model.line, marks_on(self.model.line.s, self.marked)
        nodes, marked = line.s.size, np.flatnonzero(marks)
        right = np.arange(nodes)
        right[marked] = nodes + np.arange(marked.size)
        books, base = blank_books(line.h.size), self.model.always.astype(np.int64)
        books.loaded[:] = self.model.loaded_ends
        books.clock.least_peak, books.clock.largest_peak = np.inf, -np.inf
        books.counts.stiff, books.counts.varies = self.model.inextensible, self.model.layout is not None
        books.clock.rho = self.scene.time.rho_inf if self.scene.time is not None else 0.0
        books.clock.wave_step = wave_step(line, self.model.tension_scale)
        extremes, strains = no_extremes(nodes + marked.size), np.zeros((nodes, STRAINS))
        books = books._replace(strains=strains, extremes=extremes, touch=self._blank_touch(), hinges=self.model.hinges)
        books = books._replace(marks=marks, right=right, borne=1.0 + borne_strain(self.model))
        return books._replace(start=begin.copy(), base=base, placed=begin[base])

    @property
    def sample_size(self) -> int:
        """Numbers of an output of the line, of the most cells that it may have."""
        return self._sample_size(self.model.most_cells)

    def _sample_size(self, cells: int) -> int:
        line, touches = self.model.line, self.books.touch.size > 0
        more = len(line.torsion), touches, line.moved.size, sampled_size(line)
        return sample_size(cells, self.model.layout is not None, *more)

    @property
    def together(self) -> int:
        """How many of its outputs are to wait for one another."""
        return max(1, min(WAITING, TOGETHER // self._sample_size(self.model.line.h.size)))

    def make_room(self, rows: int, waiting: int) -> None:
        """Room for so many samples of the line as it is; what is there is gone.  waiting: how many may wait."""
        shape, self._most = (rows, self.sample_size), min(self.together, waiting)
        if self.books.samples.shape != shape:
            self.books = self.books._replace(samples=np.zeros(shape))

    def _blank_touch(self) -> Floats:
        return np.zeros((3, self.model.line.s.size if self.touches else 0))

    @property
    def touches(self) -> bool:
        """Whether contact of the line with itself is computed."""
        return bool(self.model.line.bits & SELF_CONTACT)

    @property
    def _touched(self) -> str:
        """What an event says of contact at rest."""
        return "lines touch each other" if self.shares else "the line touches itself"

    def touch_itself(self, t: float) -> SelfContact | None:
        """Contact of the line as it is from t (s) on, which goes on with what there was; None: there is none."""
        if not self.touches or self.shares:
            self.contact = None
            return None
        before, model, other = self.contact, self.model, self._touching.layout is not self.model.layout
        other |= self.paying is not None
        self.contact = SelfContact(
            model.line, diameters(model), least_bending(model), model.tension_scale, self.scene.contact.friction
        )
        places = [x.held_position for x in self.scene.ends.both if x.held_position is not None]
        if model.held is not None and len(places) == 2:  # ends that lay in each other go on as neighbours
            near = math.dist(places[0], places[1]) <= OUTER * float(diameters(model).max())
            self.contact.contact.joined[:] = 0 if near else -1
        if before is not None:
            self.contact.restore(before.checkpoint(t), t, remeshed=other)
        self._touching = model
        return self.contact

    def note_equilibrium(
        self, x: JoinedLine, state: State, t: float | None, found: LinesAtRest, turned: bool = False
    ) -> None:
        """What an equilibrium leaves open; t: s, where a motion starts from it, None: it is the result.

        turned: whether the network has moments at points.
        """
        line = self.model.line
        self.diagnostics.note_at_rest(found.pushed, slack_cell(x, state), state)
        self.diagnostics.within_plane(state, self.number in found.with_friction)
        if self.number not in found.with_friction:
            self.diagnostics.friction_neglected(
                state, f"lines.{self.name}.initial", self.shares, found.not_settled.get(self.number, "")
            )
        touches = found.settled and bool(self.books.touch[:1].any())
        if line.bits & SELF_FRICTION and touches:
            text = f"this equilibrium is the one without friction where {self._touched}"
            where = f"{text}: a run with damping that comes to rest in contact has it"
            self.events.event(0.0, 0.0, self.model.length, "static friction neglected", where)
        why = "round-off of the bending of so short cells hides it" if self.number in found.blurred else ""
        if turned and line.element.any():
            why = "a moment at a point is not conservative"
        if found.unjudged and (line.element.any() or touches):
            why = f"{self._touched}; {found.unjudged}" if touches else found.unjudged
        if found.presses_bodies:
            why = "lines touch a body that is free"
        if why:
            text = f"the stability of this equilibrium is not judged, because {why}"
            self.events.event(0.0, 0.0, self.model.length, "stability not judged", text)
        turns = 0.0 if turned else twist_at_rest(x, state)
        if abs(turns) > WOUND:
            text = f"the line rests with a twist of {turns:+.2g} turns, and what it is clamped to may turn back"
            where = f"{text}: begin nearer to rest (initial_guess, initial_rotation), unless it is meant"
            self.events.event(0.0, 0.0, self.model.length, "several equilibria", where)
        if max(x.joints) < 0:  # else other lines say where a knot lies
            note_laid(self.scene, self.model, state, self.events)
        self.note_start(x, state, t)

    def note_start(self, x: JoinedLine, state: State, t: float | None) -> None:
        """What a first state leaves open, be it an equilibrium or not."""
        self.judge(t, sharpest(x.line, x.ends, state), state)
        if self.envelope.itself.check(t or 0.0, state, self.events.event) & NEARS:
            self.meets_itself(t or 0.0, 0.0)

    def meets_itself(self, t: float, dt: float) -> None:
        """An event, unless there was one, where contact could not begin after the step of dt (s) to t (s)."""
        self.envelope.itself.report_meeting(t, dt, self.events.event)

    @property
    def outputs_join(self) -> bool:
        """Whether outputs wait though the cells that they are of change, by the curvature or at a winch."""
        change = follows_curvature(self.scene) if self.paying is None else self.model.layout is None
        change = change and self._moves and not self.touches and self.shown is None
        # all that is written has to follow from the states
        line, of_states = self.model.line, not self.observer.writes_criteria and self.observer.quantities is None
        laws = line.law, line.bend_law, line.slip_law, line.torsion, line.tension_twist
        return change and of_states and not any(x.size for x in laws)

    def use_model(self, model: Model, other_cells: bool = False) -> None:
        """Go on with another model, after what waits has been recorded.

        other_cells: of other cells, for which outputs that may wait all the same go on to do so.
        """
        if model is self.model:
            return
        if not (other_cells and self.outputs_join):
            self.write_down()
        self.model = model
        self.observer = self.observer.on(model.line, model.sea.values, model.zones, model.hinges)
        self.books.hinges[:] = model.hinges
        self.diagnostics.use_model(model)
        self.envelope.itself.renew(model)
        if self.touches != bool(self.books.touch.size):
            self.books = self.books._replace(touch=self._blank_touch())

    def use_cells(self, model: Model, books: Books) -> None:
        """Go on with other cells, and books that go with them."""
        self.use_model(model, other_cells=True)
        self.books = books._replace(touch=self._blank_touch())

    def begin_cells(self, model: Model) -> None:
        """Begin anew with other cells, of which a checkpoint will say what there is to know."""
        self.use_model(model, other_cells=True)
        before, blank = self.books, self._blank_books(self.envelope.start_of(model.nodes))
        before.clock.wave_step = blank.clock.wave_step
        names = "asked", "reached", "path", "radii", "walls", "clock", "counts", "worst", "placed", "work", "power"
        self.books = blank._replace(velocity=before.velocity, **{name: getattr(before, name) for name in names})

    def adopt_cells(self, model: Model) -> None:
        """Go on with other cells, which steps have changed to with the books, of which some outputs may wait."""
        self.model = model
        self.diagnostics.use_model(model)
        self.envelope.itself.adopt_cells(model)
        if self.plane is not None:  # steps have carried the push to them
            self.plane.use_cells_of(model.line)

    @property
    def changes_cells(self) -> bool:
        """Whether other cells come: its zones move, or it is paid out."""
        return self.zones is not None or self.paying is not None

    @property
    def remeshes(self) -> bool:
        """Whether its nodes come and go: cells follow the curvature, or it is paid out."""
        return self.paying is not None or (self.zones is not None and self.zones.remeshes)

    def change_line(self, model: Model, change: Callable[[Line], Line]) -> None:
        """Go on with a model whose line is changed so on the same cells."""
        self.use_model(model)
        if self.zones is not None:
            self.zones.change_line(change)

    def use_loads(self, model: Model) -> None:
        """Go on with a model of other loads and motions on the same cells."""
        self.use_model(model)
        if self.zones is not None:
            self.zones.use_loads(model)

    def let_go(self, end: int, t: float, model: Model, state: State) -> None:
        """An end, 0 or 1, is to come loose at t (s): at a winch no more line comes."""
        if self.paying is not None and self.paying.plan.side == end:
            self.write_down()  # with the law as it is
            self.books.work[0, ZONES] += self.paying.end(state, t, model)

    @property
    def watch_table(self) -> Table | None:
        """Of what looks how near the line comes to itself in steps; None: nothing does."""
        return self.envelope.itself.running

    # --- steps and outputs --------------------------------------------------------------------------

    def attach(self, solver: NetworkSolver, states: tuple[State, State], clock: Clock, counts: Counts) -> None:
        """Steps of a solver go on with the line, between two states in turn; clock, counts: of the run."""
        solver.bind_line(self.number, **self.envelope.itself.attach(states, clock, counts))

    def log(self, rows: Floats) -> None:
        """Log steps (n, len(LOG) + 1), the last column the time of the processor, s."""
        self._log.append(rows)

    def note_nearness(self, solver: NetworkSolver, seen: int, t: float, dt: float, state: State) -> None:
        """What the step of dt (s) to t (s) has seen (bits of kernels.state.books) of how near the line is to itself."""
        if seen & IS_BENT:
            found, bound = self.envelope.itself.bends()
            solver.bind_line(self.number, **bound)
        else:
            found = sum(bit for flag, bit in WATCHED.items() if seen & flag)
        hides = bool(found & HIDES) and not self.lets_touch
        found = self.envelope.itself.judge(found, t, dt, state, self.events.event) | (NEARS if hides else 0)
        self.nears_itself, self.parts_itself = bool(found & NEARS), bool(found & PARTS)

    def watch(self, step: LineStep) -> None:
        """Look at what a step has flagged; the stretch of a run to compare with is not its matter.

        LineFailed where going on would make no sense.
        """
        flags, step.books.counts.notices = int(step.books.counts.notices), 0
        if isinstance(self.recorder, ComparisonRecorder):
            flags &= ~(STRETCHED | JUMPED)
        if flags & (STRETCHED | JUMPED):
            self.write_down()  # what stopped the run before comes first
        self._stop_if(self.diagnostics.judge(step, flags), step.t, step.state)

    def _stop_if(self, stop: Stop, t: float | None, state: State | None = None) -> None:
        """LineFailed where going on after t (s) would make no sense; state: then, where it says more."""
        if stop is None:
            return
        outcome, node = stop
        detail = FASTEST if outcome == Outcome.GAINS_ENERGY else ""
        if outcome == Outcome.TWISTED_TOO_FAR:
            detail = f"{self.model.cells} cells"
        elif outcome == Outcome.OVERSTRETCHED and state is not None:
            detail = stretch_text(self.model, state)
        raise LineFailed(self.number, outcome, t, float(self.model.line.s[node]), detail)

    def sampled(self, count: int) -> Batch:
        """The outputs that steps have sampled, as many as there are in the buffer; in arrays of their own.

        Of several meshes: their ends alone; `output` has the rest.
        """
        rows = self.books.samples[:count].copy()
        if self.cells is not None and self.cells.waits:
            self._sampled, ends = self.cells.outputs(rows)
            return ends
        return self.batch_of(rows, self.model.cells)

    def batch_of(self, rows: Floats, cells: int) -> Batch:
        """Rows (n, size) of samples of the line on so many cells, as views."""
        line, varies = self.model.line, self.model.layout is not None
        sizes = cells, self.held, varies, len(line.torsion), self.books.touch.shape[1], line.moved.size
        return batch_of_rows(rows, *sizes, slip_size(line), bool(line.bits & REMEMBERS))

    def state_now(self, t: float, ends: Ends, state: State, work: Work) -> Batch:
        """The state at t (s), now, as an output that is made of it."""
        held = ends._replace(held=self.held, position=state.r[[0, -1]])
        touch = self.books.touch[0] if self.books.touch.size else None
        return batch_of_one(t, held, state, work.report, self.books.work[0], self.model.sea.values, touch)

    def output(self, batch: Batch) -> None:
        """Record states."""
        if self.shown is not None:
            self.shown(batch)
        if self._sampled:
            self._aside += [(self.model, x) for x in self._sampled]
            self._sampled = ()
        elif self.outputs_join:
            line, paying = self.model.line, self.paying
            own = outputs_in(batch, line, self.model.zones) if paying is None else paying.outputs_of_now(line, batch)
            self._aside += [(self.model, x) for x in own]
        else:
            self._waiting.append(batch)
            if self.observer.writes_criteria and self.manager is not None:
                now = self.manager.largest_ratios(self.observer.grid.s)
                self._ratios.append(np.repeat(now[None], len(batch.t), axis=0))
        full = sum(len(x.t) for x in self._waiting) >= self._most
        full |= sum(x.line.s.size for _, x in self._aside) > MOST_ASIDE
        if self.cells is not None and self.cells.in_steps:  # which change, and these with them
            full |= bool(self._waiting)
        if full or not self._moves:
            self.write_down()

    def write_down(self) -> None:
        """Record the outputs that wait.  LineFailed where going on would make no sense."""
        if self._log:
            self.recorder.log_rows(np.concatenate(self._log))
            self._log.clear()
        if self._aside:
            self._record_aside()
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        known, self._ratios = self._ratios, []
        batch = waiting[0]
        if len(waiting) > 1:
            batch = Batch(*(np.concatenate(x) for x in zip(*waiting, strict=True)))
        there, seen, more = self.observe(batch)
        ratios = np.concatenate(known) if known else None
        values = there.values_of(seen, ratios)
        self.observer.first_energy = there.first_energy
        if not self._moves:
            self._judge_rest(seen, values)
        own, *beside = [there.rows_of(zones) for zones in (there.zones, *more)]
        self.recorder.save_batch(batch.t.copy(), values, own, beside)
        if not self._moves:
            return
        stop = None
        if not isinstance(self.recorder, ComparisonRecorder):  # which has too little to be judged
            stop = self.diagnostics.outputs(seen, values)
        self._stop_if(stop, float(batch.t[-1]))

    def _record_aside(self) -> None:
        """Record together the outputs that wait of other cells in each, and look at them."""
        aside, self._aside = self._aside, []
        outputs, stop = [x for _, x in aside], None
        there, seen = self.observer.joined_observation(outputs)
        values = there.values_of(seen)
        self.observer.first_energy = there.first_energy
        zones = [self.observer.rows_of(x.zones) for x in outputs]
        self.recorder.save_batch(seen.batch.t.copy(), values, zones[0], zones[1:])
        if not isinstance(self.recorder, ComparisonRecorder):
            stop = self.diagnostics.joined_outputs(seen, values, aside)
        self.diagnostics.use_model(self.model)
        self._stop_if(stop, float(outputs[-1].batch.t[-1]))

    def observe(self, batch: Batch) -> tuple[Observer, Observation, list[tuple[Zone, ...]]]:
        """What makes values of outputs, these as computed, and the zones of all but the first where they differ."""
        if self.paying is not None:
            return self.paying.observe(self.observer, self.model, batch)
        if self.observer.zones is not self.model.zones:  # kinds have changed
            model = self.model
            self.observer = self.observer.on(model.line, model.sea.values, model.zones, self.books.hinges)
        return self.observer, self.observer.observation(batch), []

    def paid_out(self, batch: Batch) -> tuple[Floats, Floats]:
        """Arc lengths (nb, N+1) and lengths of cells (nb, N), m, of outputs."""
        assert self.paying is not None
        varied, _ = self.paying.varied(copied(self.model.line), self.model, batch)
        return varied["s"], varied["h"]

    def judge(self, t: float | None, sharp: Sequence[float], state: State) -> None:
        """Look at a state for what its mesh does not resolve (an event) and for strain beyond what a section bears."""
        watch = self.diagnostics
        if t is None:  # its shape is judged behind its mesh
            self._at_rest = sharp, state
            return
        self._stop_if(watch.stretch(state) or watch.left_plane(state.r) or watch.shape(t, sharp, state), t, state)

    def _judge_rest(self, seen: Observation, values: Mapping[str, Floats]) -> None:
        """The same of an equilibrium, as it is computed for its output.

        One to compare with may be too coarse to be a result: what it differs by is what is asked of it.
        """
        watch, (sharp, state) = self.diagnostics, self._at_rest
        compared = isinstance(self.recorder, ComparisonRecorder)
        if not compared:
            watch.mesh(seen)
        stop = watch.stretch(state) or watch.left_plane(state.r)
        self._stop_if(stop or (None if compared else watch.shape(0.0, sharp, state)), None, state)
        if not compared:
            watch.loops(seen.batch.t, values, seen.grid.s)

    def waiting(self) -> Waiting:
        """Outputs and steps that wait, to come back to."""
        aside, log = [*self._aside], [*self._log]
        return Waiting([*self._waiting], [*self._ratios], aside, log, self.observer.first_energy)

    def wait_again(self, kept: Waiting) -> None:
        """Let that wait which `waiting` has returned, and nothing else."""
        self._waiting, self._aside, self._log = [*kept.outputs], [*kept.aside], [*kept.log]
        self._ratios = [*kept.ratios]
        self.observer.first_energy = kept.first_energy

    def impose_now(self) -> None:
        """Outputs within the next step begin with what the ends impose now."""
        ends = self.model.ends.values
        self.books.imposed[0] = np.hstack([ends.position, ends.frame, ends.spin, ends.force, ends.moment])

    # --- the file -----------------------------------------------------------------------------------

    def write_envelope(self, t: float) -> None:
        """Extremes up to t (s), for the file."""
        self.recorder.replace(self.envelope.values(self.model.nodes, self.books.extremes, t))

    def finish(self, t: float, status: str) -> None:
        """Write the envelope up to t (s), and note what is to be said of all of it; status: of the run."""
        if status == "complete" and self._moves and not isinstance(self.recorder, ComparisonRecorder):
            self.diagnostics.finish(self.books)
        elif status == "failed":
            self.diagnostics.of_scheme.finish()
        values = self.envelope.values(self.model.nodes, self.books.extremes, t)
        self.recorder.replace(values)
        self.envelope.note_broken(values, self.recorder.recorded(), self.events.event)
        if self.contact is not None and (tries := self.contact.given_up):
            self.events.event(t, 0.0, self.model.length, "steps cut", energy_gains_text(tries), value=float(tries))
        self.envelope.itself.report_too_near(self.model, self.events.event)

    def checkpoint(self, work: Work, t: float) -> dict[str, Any]:
        """What the rest of the run depends on beside the state at t (s), between two steps, with no output waiting."""
        books, contact = self.books, self.contact
        found = self._kept(work) | {"stored": float(books.clock.stored), "ends": self.model.ends.checkpoint()}
        found |= {"envelope": self.envelope.checkpoint(books.extremes), "noted": self.diagnostics.checkpoint(books)}
        found |= {} if contact is None else {"self_contact": contact.checkpoint(t)}
        return found | {"first_energy": self.observer.first_energy or 0.0}

    def _kept(self, work: Work) -> dict[str, Any]:
        """Arrays of the line that a checkpoint keeps as they are; `before`: of what outputs in a step are made, too."""
        books, answers, asked = self.books, answers_of(work.torsion), self.observer.quantities
        before = {"imposed": books.imposed[0], "report": books.report[1], "tension": books.tension[0]}
        before |= {"twist": books.twist[0], "touch": books.touch[:1]}
        # from where excursions, m, and from which azimuths, deg, count that are recorded with the line
        places = {} if asked is None else {"first_places": asked.first, "first_turns": asked.turns}
        found: dict[str, Any] = {"work": books.work[0], "power": books.power[0], "report": work.report}
        found |= {"before": before} | ({"torsion": answers} if answers else {})
        return found | {name: x for name, x in places.items() if x.size}

    def restore(self, saved: Mapping[str, Any], work: Work, t: float, joints: Sequence[int]) -> None:
        """Go on at t (s) as `checkpoint` has written; joints: as of `JoinedLine`.  ValueError: that cannot be."""
        books, model = self.books, self.model
        _put_back(self._kept(work), saved)
        books.report[0], books.clock.stored = work.report, saved["stored"]
        if saved["envelope"] is not None:
            self.envelope.restore(saved["envelope"], books.extremes)
        else:
            self.envelope.begin_at(t, model, saved["state"]["r"], self.events.event)
        books.start[:] = self.envelope.start_of(model.nodes)
        books.placed[:] = self.diagnostics.restore(saved["noted"], books, books.start)
        self.observer.first_energy = saved["first_energy"]
        if self.contact is not None:
            self.contact.restore(saved["self_contact"], t)
        ends = saved["ends"] | {"released": model.ends.released}  # as what broke says: files of 1.0 have none released
        model.ends.restore(ends, t)
        apart = np.abs(saved["ends"]["position"] - model.ends.values.position).max(axis=1)
        for k in (0, 1):
            if joints[k] < 0 and apart[k] > SAME_PLACE * model.length:
                raise ValueError(f"an end of line {self.name} is {apart[k]:.3g} m from where it was: other files?")


def _put_back(arrays: Mapping[str, Any], saved: Mapping[str, Any]) -> None:
    """Arrays by name become those that are saved."""
    for name, x in arrays.items():
        if isinstance(x, Mapping):
            _put_back(x, saved[name])
        else:
            x[:] = saved[name]
