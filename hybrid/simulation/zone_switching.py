"""Zones that move: carries out what the domain manager proposes on a model, its state and its books."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybrid.adapt.manager import REJECT_RATIO, Change, DomainManager
from hybrid.adapt.moment_joints import Joints
from hybrid.adapt.state_transfer import Clamp, Remapped, remap
from hybrid.errors import Outcome
from hybrid.kernels.energies import observe
from hybrid.kernels.forces import FRICTION, PLANAR, SEABED
from hybrid.kernels.seabed import stored
from hybrid.kernels.state import Ends, Floats, Line, Sea, State
from hybrid.kernels.stiffness_ramp import freed, length_defect, soften
from hybrid.kernels.zone_criteria import twist_of_rods
from hybrid.model.build import Model
from hybrid.model.layout import Layout
from hybrid.model.line import line_on
from hybrid.model.plane import planar, untwist
from hybrid.solve.run import Tried
from hybrid.store.named_arrays import matched

# A stretch that has become chords, or arcs, is let go to its true length over this many paces.
LETTING_GO = 1.0
# Times the tension floor above which tension, not bending, says where new nodes are in balance.
TAUT = 2.0
NONE, NO_STRAIN = np.zeros(0, int), np.zeros((0, 3))
# Repetitions of one step with more rod.
MOST_RESCUES = 20


@dataclass
class Relaxing:
    """Cells on their way to their true length: what they lacked (N,) m, its rate (N,) m/s, when it began (N,) s.

    Cells of catenaries keep (N,) what they lack: it is what the chord of an arc is shorter by.
    """

    lack: Floats
    rate: Floats
    since: Floats
    keeps: np.ndarray

    def speed(self, t: float, duration: float) -> Floats:
        """Rate (N,) m/s at which what they lack grows."""
        x = np.clip((t - self.since) / duration, 0.0, 1.0)
        value = np.where(self.keeps, 0.0, -30.0 * x * x * (1.0 - x) ** 2)
        slope = (1.0 - x) ** 2 * (1.0 + 2.0 * x - 15.0 * x * x)
        return np.asarray(self.lack * value / duration + self.rate * slope)


def on_layout(model: Model, layout: Layout) -> Model:
    """The same model with other zones; its start is not touched."""
    more = model.line.bits & (SEABED | FRICTION)
    line = line_on(model.cable, layout.nodes, layout.rod_cells, more, sections_turn=False)
    if model.line.bits & PLANAR:
        line = planar(line, model.line.plane)
    return replace(model, line=line, zones=layout.zones, layout=layout, sea=model.sea.on(line.h.size))


class ZoneSwitching:
    """The zones of one motion."""

    def __init__(self, model: Model, manager: DomainManager, loaded: bool = False) -> None:
        """loaded: whether joints carry the moment of the catenary's curvature."""
        self.model, self.manager = model, manager
        self.stiff = model.line.kb.copy()  # N m, with all bending
        self.true = model.line.h.copy()
        self.lengths = self.true.copy()  # m, at the end of the last step
        self.relaxing: Relaxing | None = None
        self.letting_go = False
        self.strain = NO_STRAIN  # of the last step, while bending is being blended
        self.joints = Joints(model.line) if loaded else None

    def torque(self) -> float:
        """Torque, N m, of the whole line as far as its rods do not carry it, when the criteria were weighed last."""
        return self.manager.torque

    def checkpoint(self) -> dict[str, Any]:
        """What is under way: bending, lengths, moments at joints, and what the manager remembers."""
        line, x = self.model.line, self.relaxing
        return {
            "manager": self.manager.checkpoint(), "h": line.h, "kb": line.kb, "force": line.force,
            "strain": self.strain, "joints": self.joints and self.joints.checkpoint(),
            "relaxing": x and {"lack": x.lack, "rate": x.rate, "since": x.since, "keeps": x.keeps},
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
        if relaxing is not None:
            cells = np.zeros(line.h.size)
            template = {"lack": cells, "rate": cells, "since": cells - np.inf, "keeps": cells > 0.0}
            self.relaxing = Relaxing(**matched(relaxing, template, "relaxing"))
        line.h[:], line.kb[:], line.force[:] = saved["h"], saved["kb"], saved["force"]
        self.lengths, self.strain = line.h.copy(), strain

    def begin(self, ends: Ends, state: State) -> None:
        """Weigh the criteria of the first state."""
        self.manager.reset()
        self.evaluate_criteria(0.0, 0.0, ends, state)

    @property
    def prepares(self) -> bool:
        """Whether something has to be done before a step: lengths or bending on their way, moments at joints."""
        return self.relaxing is not None or self.manager.ramping or self.joints is not None

    def prepare_step(self, end: float, dt: float, state: State) -> None:
        """Before a step of dt to `end`: lengths, bending and moments at joints as they will be then."""
        line = self.model.line
        if self.relaxing is not None:
            x = self.relaxing
            self.letting_go = length_defect(
                x.lack, x.rate, x.since, x.keeps, end, LETTING_GO * self.manager.pace, self.true, line.h
            )
        if self.manager.ramping:
            soften(self.manager.stiffness_shares(dt), self.stiff, line.kb)
        if self.joints is not None:
            self.joints.load(line, state, self.manager.EI, self.manager.stiffness_shares(dt), dt / self.manager.pace)

    def evaluate_criteria(self, t: float, dt: float, ends: Ends, state: State) -> np.ndarray:
        """Weigh the criteria after a step of dt to t; catenary cells that are beyond their hard bound."""
        loudest = self.manager.evaluate_criteria(self.model.line, self.model.sea.values, ends, state, dt, t)
        return self.manager.cells_to_reject if loudest > REJECT_RATIO else NONE

    def rescue(self, how: Tried, end: float, dt: float, tried: State, rescues: int) -> Change | None:
        """More rod for a step of dt to `end` that failed or took a catenary too far; None: as it is.

        tried: the state that the step led to; rescues: of this step, so far.
        """
        line, most = self.model.line, MOST_RESCUES
        if how.outcome == Outcome.OK:
            cells = self.evaluate_criteria(end, dt, self.model.ends.values, tried)
            why = "a step would have left it a catenary far beyond its criterion; the step is repeated"
        elif how.outcome == Outcome.SLACK:
            cells = np.flatnonzero((line.spin == 0) & (self.model.slack_floor >= tried.T))
            why = "a step would have left it a catenary without tension; the step is repeated"
        else:
            cells = self.manager.cells_near_threshold(min(max(how.where, 0), self.model.cells - 1))
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

    def book_step(self, t: float, dt: float, ends: Ends, before: State, state: State) -> tuple[float, Change | None]:
        """After an accepted step: energy (J) that lengths, bending and joints put in, and what should change."""
        manager, line = self.manager, self.model.line
        booked = 0.0
        if self.relaxing is not None:
            booked -= 0.5 * float((before.T + state.T) @ (line.h - self.lengths))
            self.lengths[:] = line.h
            if not self.letting_go:
                self.relaxing = None
        if manager.ramping:
            if self.strain.shape != line.kb.shape:
                self.strain = _strain(line, ends, before)
            now = _strain(line, ends, state)
            booked += freed(line.kb, manager.stiffness_shares(), self.stiff, self.strain, now)
            self.strain = now
            manager.advance_ramp(dt)
        else:
            self.strain = NO_STRAIN
        if self.joints is not None:
            booked += self.joints.unload(line, state.r - before.r)
        manager.store_past(state)
        return booked, manager.review(t, state) if manager.review_due(t) else None

    def switch(self, change: Change, t: float, ends: Ends, state: State, sea: Sea) -> tuple[Model, State, float]:
        """The model and the state with other zones, and the energy (J) that the switch puts in."""
        old, manager, model = self.manager.layout, self.manager, self.model
        new = old._replace(rod=change.rod)
        line = model.line
        if self.joints is not None:
            self.joints.unload(line, np.zeros_like(state.r))
        soften(manager.stiffness_shares(), self.stiff, line.kb)  # a step that was refused has left others
        line.h[:] = self.lengths
        was = _energy(line, sea, ends, state)
        changed = on_layout(model, new)
        target = changed.line
        carried = self._carried(old, new, line, target, ends, state)
        if target.bits & PLANAR:
            untwist(target, ends, model.cable.held_tangent, carried.state)
        manager.adopt_layout(new, change, t)
        self.stiff, self.true = target.kb.copy(), target.h.copy()
        soften(manager.stiffness_shares(), self.stiff, target.kb)
        target.h[:] = carried.lengths
        self.lengths = carried.lengths.copy()
        # new cells go on with the length, and the change of length, that their ends and tension imply, but for what
        # tension makes of it
        kept_now, kept_then = (np.repeat(old.rod == new.rod, x.counts) for x in (new, old))
        shares = target.h / np.diff(new.base)[new.base_of_cell]
        elastic = _lengthening(state)
        if self.relaxing is not None:
            elastic += (1.0 + line.ck * state.T) * self.relaxing.speed(t, LETTING_GO * manager.pace)
        elastic = np.add.reduceat(elastic, old.first[:-1])[new.base_of_cell] * shares
        rate = (elastic - _lengthening(carried.state)) / (1.0 + target.ck * carried.state.T)
        lack, since = self.true - carried.lengths, np.full(target.h.size, t)
        rate[kept_now], since[kept_now] = 0.0, -np.inf
        if self.relaxing is not None:  # what was on its way goes on
            for mine, its in ((lack, self.relaxing.lack), (rate, self.relaxing.rate), (since, self.relaxing.since)):
                mine[kept_now] = its[kept_then]
        self.relaxing = Relaxing(lack, rate, since, ~new.rod_cells)
        self.model, self.strain = changed, NO_STRAIN
        if self.joints is not None:
            self.joints = self.joints.on(target)
        return changed, carried.state, _energy(target, changed.sea.values, ends, carried.state) - was

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


def _strain(line: Line, ends: Ends, state: State) -> Floats:
    """Strains (N+1, 3) rad of all elements, from what has no stress."""
    return (_observed(line, ends, state)[0] - line.k0) * line.element[:, None]


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
