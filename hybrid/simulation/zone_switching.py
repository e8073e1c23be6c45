"""Zones that move: carries out what the domain manager proposes on a model, its state and its books."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid.adapt.manager import Change, DomainManager
from hybrid.adapt.moment_joints import Joints
from hybrid.adapt.state_transfer import Clamp, Remapped, remap
from hybrid.errors import Outcome
from hybrid.kernels import books as b
from hybrid.kernels import zone_step as z
from hybrid.kernels.binding import Table
from hybrid.kernels.energies import observe
from hybrid.kernels.forces import FRICTION, PLANAR, SEABED
from hybrid.kernels.generalized_alpha import STEEPEST
from hybrid.kernels.seabed import stored
from hybrid.kernels.state import Ends, Floats, Line, Sea, State
from hybrid.kernels.stiffness_ramp import soften
from hybrid.kernels.zone_criteria import twist_of_rods
from hybrid.kernels.zone_step import REJECT_RATIO, Zones, blank_zone_job, follow_zones
from hybrid.model.build import Model
from hybrid.model.layout import Layout
from hybrid.model.line import line_on
from hybrid.model.plane import planar, untwist
from hybrid.solve.run import CompiledRun, Tried
from hybrid.store.named_arrays import matched

# A stretch that has become chords, or arcs, is let go to its true length over this many paces.
LETTING_GO = 1.0
# Times the tension floor above which tension, not bending, says where new nodes are in balance.
TAUT = 2.0
NONE, NO_STRAIN = np.zeros(0, int), np.zeros((0, 3))
LONGEST_IN_PACE = 0.1  # of the time in which bending comes and goes: a step may not be longer meanwhile
READY = STEEPEST  # times as long may it be before: a change must not shorten it by more than the scheme's weights carry
# What a checkpoint holds of cells on their way to true lengths.
RELAXING = ("lack", "rate", "since", "keeps")
# Repetitions of one step with more rod.
MOST_RESCUES = 20


def on_layout(model: Model, layout: Layout) -> Model:
    """The same model with other zones; its start is not touched."""
    more = model.line.bits & (SEABED | FRICTION)
    line = line_on(model.cable, layout.nodes, layout.rod_cells, more, sections_turn=False, passes_torque=False)
    if model.line.bits & PLANAR:
        line = planar(line, model.line.plane)
    return replace(model, line=line, zones=layout.zones, layout=layout, sea=model.sea.on(line.h.size))


class ZoneSwitching:
    """The zones of one motion."""

    def __init__(self, model: Model, manager: DomainManager, loaded: bool = False) -> None:
        """loaded: whether joints carry the moment of the catenary's curvature."""
        self.model, self.manager = model, manager
        self.joints = Joints(model.line) if loaded else None
        self.table = Table(blank_zone_job())  # of the compiled run
        self._take_line(model.line, model.line.h)

    def _take_line(self, line: Line, lengths: Floats) -> None:
        """A line with all of its stiffness and its true lengths; lengths: (N,) m, that its cells have now."""
        zones = self.zones
        zones.stiff[:], zones.true[:], zones.lengths[:] = line.kb, line.h, lengths

    @property
    def zones(self) -> Zones:
        """What the compiled run knows of the zones."""
        return self.manager.zones

    @property
    def compiled(self) -> bool:
        """Whether the compiled run does all that zones ask of a step; else it asks Python at every step."""
        return self.joints is None and self.manager.user is None

    def attach(self, run: CompiledRun, every: int) -> None:
        """Let a run follow the zones of its line from now on; every: outputs of the result to one of this run."""
        manager, longest = self.manager, LONGEST_IN_PACE * self.manager.pace * every
        clock = self.zones.clock
        clock[z.RAMP_STEP], clock[z.CALM_STEP] = longest, longest * READY
        clock[z.LETTING_GO] = LETTING_GO * manager.pace
        run.clock[b.ALLOWED] = longest * (1.0 if manager.ramping else READY)
        line, sea, ends = self.model.line, self.model.sea.values, self.model.ends.values
        self.table.bind(
            line=line, sea=sea, ends=ends, old=run.states[0], new=run.states[1], clock=run.clock, counts=run.count,
            work=run.books.work, zones=self.zones,
        )  # fmt: skip
        run.follow(self.table, self.compiled)

    def torque(self) -> float:
        """Torque, N m, of the whole line as far as its rods do not carry it, when the criteria were weighed last."""
        return float(self.manager.torque)

    def checkpoint(self) -> dict[str, Any]:
        """What is under way: bending, lengths, moments at joints, and what the manager remembers."""
        line, zones = self.model.line, self.zones
        relaxing = {name: getattr(zones, name) for name in RELAXING} if zones.counts[z.RELAXING] else None
        return {
            "manager": self.manager.checkpoint(), "h": line.h, "kb": line.kb, "force": line.force,
            "strain": zones.strain[1] if zones.counts[z.STRAINED] else NO_STRAIN,
            "joints": self.joints and self.joints.checkpoint(), "relaxing": relaxing,
        }  # fmt: skip

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has said; ValueError or ResultError where that cannot be."""
        line, relaxing, strain = self.model.line, saved["relaxing"], saved["strain"]
        self.manager.restore(saved["manager"])
        if self.joints is not None:
            self.joints.restore(saved["joints"])
        if not (
            saved["h"].min() > 0.0 and saved["kb"].min() >= 0.0 and strain.shape in (NO_STRAIN.shape, line.kb.shape)
        ):
            raise ValueError("lengths, stiffness or strains that no line has")
        zones = self.zones
        if relaxing is not None:
            cells = np.zeros(line.h.size)
            template = {"lack": cells, "rate": cells, "since": cells - np.inf, "keeps": cells > 0.0}
            for name, x in matched(relaxing, template, "relaxing").items():
                getattr(zones, name)[:] = x
            zones.counts[z.RELAXING] = 1
        line.h[:], line.kb[:], line.force[:] = saved["h"], saved["kb"], saved["force"]
        zones.lengths[:] = line.h
        if strain.size:
            zones.strain[1], zones.counts[z.STRAINED] = strain, 1

    def begin(self, ends: Ends, state: State) -> None:
        """Weigh the criteria of the first state."""
        self.manager.reset()
        self.evaluate_criteria(0.0, 0.0, ends, state)

    def prepare_step(self, dt: float, state: State) -> None:
        """Before a step of dt: lengths, bending and moments at joints as they will be then; of zones not compiled."""
        follow_zones(self.table.numbers)
        if self.joints is not None:
            line, manager = self.model.line, self.manager
            self.joints.load(line, state, manager.EI, manager.stiffness_shares(dt), dt / manager.pace)

    def evaluate_criteria(self, t: float, dt: float, ends: Ends, state: State) -> None:
        """Weigh the criteria of a state at t, dt after the last one."""
        self.manager.evaluate_criteria(self.model.line, self.model.sea.values, ends, state, dt, t)

    def rescue(self, how: Tried, end: float, dt: float, tried: State, rescues: int) -> Change | None:
        """More rod for a step of dt to `end` that failed or took a catenary too far; None: as it is.

        tried: the state that the step led to; rescues: of this step, so far.
        """
        line, manager, most = self.model.line, self.manager, MOST_RESCUES
        if how.outcome == Outcome.OK:
            if not self.compiled:
                follow_zones(self.table.numbers)
                if manager.user is not None:
                    manager.ask_user(line, tried, end)
            cells = manager.cells_to_reject if manager.loudest > REJECT_RATIO else NONE
            why = "a step would have left it a catenary far beyond its criterion; the step is repeated"
        elif how.outcome == Outcome.SLACK:
            cells = np.flatnonzero((line.spin == 0) & (self.model.slack_floor >= tried.T))
            why = "a step would have left it a catenary without tension; the step is repeated"
        else:
            cells = manager.cells_near_threshold(min(max(how.where, 0), self.model.cells - 1))
            why = f"a step failed here ({how.outcome.cause}); it is repeated"
            most = 1  # after that, a smaller step
        return self._force_rod(cells, why) if rescues < most and cells.size else None

    def all_rod(self, how: Tried) -> Change | None:
        """The last resort of a step that fails however small: rod wherever the scene lets it be; None: it is."""
        why = f"steps fail here, however small ({how.outcome.cause}); repeated with rods everywhere"
        return self._force_rod(np.arange(self.model.cells), why)

    def _force_rod(self, cells: np.ndarray, why: str) -> Change | None:
        """Cells to be rod, with all of their stiffness; None: they are."""
        change = self.manager.force_rods(cells, why)
        return None if (change.rod == self.manager.layout.rod).all() and not change.stiff.any() else change

    def book_step(self, t: float, before: State, state: State) -> tuple[float, Change | None]:
        """After an accepted step: energy (J) that joints put in, and what should change."""
        manager, booked = self.manager, 0.0
        if not self.compiled:
            follow_zones(self.table.numbers)
        if self.joints is not None:
            booked = self.joints.unload(self.model.line, state.r - before.r)
        return booked, manager.review(t, state) if manager.review_due(t) else None

    def switch(self, change: Change, t: float, ends: Ends, state: State, sea: Sea) -> tuple[Model, State, float]:
        """The model and the state with other zones, and the energy (J) that the switch puts in."""
        old, manager, model = self.manager.layout, self.manager, self.model
        new = old._replace(rod=change.rod)
        line = model.line
        if self.joints is not None:
            self.joints.unload(line, np.zeros_like(state.r))
        zones, relaxing = self.zones, bool(self.zones.counts[z.RELAXING])
        soften(manager.stiffness_shares(), zones.stiff, line.kb)  # a step that was refused has left others
        line.h[:] = zones.lengths
        was = _energy(line, sea, ends, state)
        changed = on_layout(model, new)
        target = changed.line
        carried = self._carried(old, new, line, target, ends, state)
        if target.bits & PLANAR:
            untwist(target, ends, model.cable.held_tangent, carried.state)
        manager.adopt_layout(new, change, t)
        self._take_line(target, carried.lengths)
        soften(manager.stiffness_shares(), self.zones.stiff, target.kb)
        target.h[:] = carried.lengths
        self._relax(zones if relaxing else None, old, new, line, t, state, carried)
        self.model = changed
        if self.joints is not None:
            self.joints = self.joints.on(target)
        return changed, carried.state, _energy(target, changed.sea.values, ends, carried.state) - was

    def _relax(
        self, before: Zones | None, old: Layout, new: Layout, line: Line, t: float, state: State, carried: Remapped
    ) -> None:
        """Lengths on their way to true ones from t on; before: the zones of the old line, if its lengths were.

        New cells go on with the length, and the change of length, that their ends and tension imply, but for what
        tension makes of it.
        """
        zones, h = self.zones, carried.lengths
        kept_now, kept_then = (np.repeat(old.rod == new.rod, x.counts) for x in (new, old))
        elastic = _lengthening(state)
        if before is not None:
            elastic += (1.0 + line.ck * state.T) * _speed(before, t, LETTING_GO * self.manager.pace)
        parts = h / np.diff(new.base)[new.base_of_cell]
        elastic = np.add.reduceat(elastic, old.first[:-1])[new.base_of_cell] * parts
        ck = self.manager.cable.ck[self.manager.cable.piece(0.5 * (new.nodes[:-1] + new.nodes[1:]))]
        zones.lack[:], zones.since[:], zones.keeps[:] = zones.true - h, t, ~new.rod_cells
        zones.rate[:] = (elastic - _lengthening(carried.state)) / (1.0 + ck * carried.state.T)
        zones.rate[kept_now], zones.since[kept_now] = 0.0, -np.inf
        if before is not None:  # what was on its way goes on
            for name in ("lack", "rate", "since"):
                getattr(zones, name)[kept_now] = getattr(before, name)[kept_then]
        zones.counts[z.RELAXING] = 1

    def release_joints(self, state: State) -> None:
        """Take what joints carry off the line, for another line to be put in its place."""
        if self.joints is not None:
            self.joints.unload(self.model.line, np.zeros_like(state.r))

    def _carried(self, old: Layout, new: Layout, line: Line, target: Line, ends: Ends, state: State) -> Remapped:
        """The state on the new nodes, with the twist that the cable has had since its ends lost each other."""
        manager, cable = self.manager, self.model.cable
        kinks = np.zeros(new.rod.size + 1, bool)
        kinks[cable.point_nodes(new.base)] = True
        frames = ends.frame.reshape(2, 3, 3)
        clamps: list[Clamp | None] = [
            (frames[k][:, 0], frames[k][:, 2]) if cable.held_twist[k] and cable.held_tangent[k] else None
            for k in (0, 1)
        ]
        twist = np.zeros(new.rod.size)
        carried = remap(old, new, line, target, state, kinks, twist, clamps)
        fresh = new.rod & ~old.rod
        if not (manager.twisted and new.rod.all() and fresh.any()):
            return carried
        length = float(np.diff(new.base)[fresh].sum())
        for _ in range(2):  # in whole turns; what is between them the clamps say
            missing = manager.total_twist - twist_of_rods(target, ends.frame, carried.state.e, carried.state.a1)
            twist[fresh] += 2.0 * np.pi * np.round(missing / (2.0 * np.pi)) / length
            carried = remap(old, new, line, target, state, kinks, twist, clamps)
        return carried


def _lengthening(state: State) -> Floats:
    """Rate (N,) m/s at which cells grow longer."""
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    return np.asarray(np.einsum("ij,ij->i", d, np.diff(state.v, axis=0)))


def _speed(zones: Zones, t: float, duration: float) -> Floats:
    """Rate (N,) m/s at which what cells on their way to true lengths lack grows."""
    x = np.clip((t - zones.since) / duration, 0.0, 1.0)
    value = np.where(zones.keeps, 0.0, -30.0 * x * x * (1.0 - x) ** 2)
    slope = (1.0 - x) ** 2 * (1.0 + 2.0 * x - 15.0 * x * x)
    return np.asarray(zones.lack * value / duration + zones.rate * slope)


def _observed(line: Line, ends: Ends, state: State) -> tuple[Floats, Floats]:
    """Log strains (N+1, 3) rad of all elements, and energies (4,) J."""
    n = line.h.size
    M, strain, energy = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros(4)
    observe(line, ends, state.e, state.v, state.a1, state.w, M, strain, energy)
    return strain, energy


def _energy(line: Line, sea: Sea, ends: Ends, state: State) -> float:
    """All energy of a state, J."""
    contact = stored(line, sea, state.r) if line.bits & SEABED else 0.0
    return float(_observed(line, ends, state)[1].sum() - np.sum(line.force * state.r) + contact)
