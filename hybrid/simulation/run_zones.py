"""Zones that move: each line has a domain manager of its own.

Stiffness and lengths of lines whose zones change follow the step that is tried; after it criteria are weighed, and a
line that needs more rod gets it before the step is repeated.  After an accepted step, and its outputs, what the manager
proposes is carried out: the line has other cells then, and the network another solver.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import KINK_COUNTS, Outcome
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.mesh.zone_step import LOOKAHEAD, advance_zones
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Counts
from hybrid.kernels.state.state import Ends, Line, State, state_for
from hybrid.model.build import Model
from hybrid.model.mesh import Layout
from hybrid.model.network import NetworkModel
from hybrid.simulation.cell_changes import CellChanges
from hybrid.simulation.events import EventLog
from hybrid.simulation.parts import Part
from hybrid.simulation.restart import zoning_of_today
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.store.integrity import matched
from hybrid.zones.change import LETTING_GO, LONGEST_IN_RAMP, READY, ZoneSwitching, on_layout
from hybrid.zones.manager import Change, DomainManager

if TYPE_CHECKING:
    from hybrid.simulation.run_payout import PaidZones, RunPayout


HELD = (
    "zones stay rod: in equilibrium, catenary where the criteria allow it is further from the rod than the tolerance; "
    "more mesh.cells, or a larger model.tolerance, let them move"
)


AFTER_CHANGE = "after a change of zones"


def note_change(events: EventLog, manager: DomainManager, t: float, change: Change, booked: float) -> None:
    """Events of a change of zones at t (s) that the manager has adopted; booked: J, that it puts in."""
    base = manager.layout.base
    for k, why in enumerate(change.reasons):
        energy = booked if k == 0 else 0.0  # of all that change now
        more: dict[str, Any] = {"criterion": why.criterion, "value": why.value, "threshold": why.threshold}
        events.event(t, float(base[why.a]), float(base[why.b]), why.kind, why.text, energy=energy, **more)
    cause = "" if manager.kinked else manager.cable.kinks_count
    if cause and (at := manager.joint_passed(change)) is not None:
        manager.kinked = True
        text = (
            f"at s = {at:.4g} m a rod has grown past its joint: while its stiffness comes in, the kink of the joint "
            f"{KINK_COUNTS} there, and of every joint that is passed from now on, because the line has {cause}; the "
            f"smallest bend radius may be a third of the true one; model: rod, or model.force_rod where the line bends"
        )
        events.event(t, float(base[0]), float(base[-1]), "kink at joint", text)


def _saved_layout(layout: Layout, saved: Mapping[str, Any]) -> Layout:
    """The layout of a checkpoint, of the same base cells.  ValueError: it is none."""
    here = saved["here"]
    if here is not None and not (here.dtype == bool and here.shape == (layout.parts.sum() + 1,)):
        raise ValueError("cells that no line has")
    return layout._replace(rod=saved["rod"], here=here)


class _LineZones:
    """What moves the zones of one line, with the numbers of a compiled run (kernels.mesh.zone_step)."""

    def __init__(self, run: RunOfLines, number: int, model: Model, manager: DomainManager) -> None:
        self.number, self.full, self.switching = number, model, ZoneSwitching(model, manager)
        self._run = run
        self.clock, self.counts = b.Clock(), Counts()
        longest, clock = LONGEST_IN_RAMP * manager.ramp_time * run.resolution.one.every, manager.zones.clock
        clock.ramp_step, clock.steady_step = longest, longest * READY
        clock.letting_go = LETTING_GO * manager.ramp_time
        self.pending: Change | None = None
        self.paid: PaidZones | None = None  # of a line that is paid out
        self.cells: CellChanges | None = None  # what changes its cells in arrays of their own

    def do_phase(self, phase: int, t: float, end: float, old: State, new: State) -> None:
        """Before, after a try from t to `end` (s), or, with the states exchanged, after an accepted step."""
        self.counts.phase, self.clock.now, self.clock.try_end = phase, t, end
        advance_zones(self._bind(old, new, self.clock, self.counts, review=0).numbers)

    @property
    def remeshes(self) -> bool:
        """Whether cells follow the curvature: nodes come and go."""
        return bool(self.switching.zones.clock.share > 0.0)

    def switch(self, change: Change, here: NDArray[np.bool_] | None = None) -> None:
        """Other zones, whose solver has still to follow: nothing moves, and what changes energy is booked.

        here: as of `CellChanges.change_once`.
        """
        run, k, line = self._run, self.number, self._run.lines[self.number]
        line.write_down()  # of the zones before, and with the reel as it is
        if self.paid is not None:
            run.model = run.model.with_lines({k: self.paid.as_now(run.model.models[k], run.t, run.state.lines[k])})
        at, risen = run.model.models[k].line.s, run.state.lines[k].T - line.books.tension[0]
        model, state, books, booked = CellChanges(run, k, self.switching, once=True).change_once(change, here)
        if self.paid is not None:
            self.paid.paying.fit(model, run.t)
        states = [*run.state.lines]
        states[k] = state
        run.model, run.state = run.model.with_lines({k: model}), run.state._replace(lines=states)
        line.use_cells(model, books)
        if self.paid is not None:  # a node that comes or goes now asks for rates of tensions, as of the old cells
            middle, old = (0.5 * (s[:-1] + s[1:]) for s in (model.line.s, at))
            line.books.tension[0] = state.T - np.interp(middle, old, risen)
        line.books.work[0, b.ZONES] += booked
        note_change(line.events, self.switching.manager, run.t, change, booked)

    def change_line(self, change: Callable[[Line], Line]) -> None:
        """The line is changed on the same cells: it touches itself from now on, or no longer."""
        self.full = replace(self.full, line=change(self.full.line))
        model = self.switching.model
        self.switching.model = replace(model, line=change(model.line))

    def release(self, end: int, model: Model) -> None:
        """An end, 0 or 1, has come loose: nothing holds its direction and its twist any longer."""
        self.switching.release(end, model)
        self._use_full(model)

    def use_loads(self, model: Model) -> None:
        """Go on with a model whose loads and motions are others on the same cells."""
        self._use_full(model)
        self.switching.model = model
        self.switching.manager.load(model.ends.moments)

    def _use_full(self, model: Model) -> None:
        """Other loads, or other ends, on the cells that the line began with; those of one at a winch change."""
        if self.paid is None:
            self.full = on_layout(model, self.full.zoned)

    def bind(self, loop: NetworkSteps) -> Table:
        """What follows the zones within the compiled steps of a loop."""
        even, odd = (turn.lines[self.number] for turn in loop.turns)
        self._bind(even, odd, loop.clock, loop.counts)
        self.switching.let_review()
        return self.switching.table

    def _bind(self, old: State, new: State, clock: b.Clock, counts: Counts, **more: int) -> Table:
        switching, model = self.switching, self.switching.model
        switching.table.bind(line=model.line, sea=model.sea.values, ends=model.ends.values, old=old, new=new, **more)
        switching.table.bind(clock=clock, counts=counts, work=self._run.lines[self.number].books.work)
        switching.table.bind(zones=switching.zones, near=switching.manager.near)
        return switching.table


class RunZones(Part):
    """The zones of all lines of a run whose zones move.

    Steps follow them compiled, and Python looks at them where something is due; a criterion of the user's own is asked
    around every try, contact after every step, and outputs of criteria are written before the next one.
    """

    name = "zones"  # which follow every step

    def __init__(self, run: RunOfLines, managers: Mapping[int, DomainManager], payout: RunPayout | None = None) -> None:
        self._run, run.contact_energy = run, np.zeros(len(run.lines))
        self.lines = [_LineZones(run, k, run.model.models[k], x) for k, x in managers.items()]
        for x in self.lines:
            run.lines[x.number].manager, run.lines[x.number].zones = x.switching.manager, x
        if payout is not None:
            self._pay(payout)
        self._rescues, self._rescued = 0, 0  # of the step that is tried, after so many
        self._compiled = all(x.switching.compiled for x in self.lines)

    def _pay(self, payout: RunPayout) -> None:
        """Zones know of the winches of their lines, and these of them."""
        from hybrid.simulation.run_payout import PaidZones

        run = self._run
        for x in self.lines:
            paying = payout.lines.get(x.number)
            if paying is not None:
                turning = run.model.seats[x.number, :, TURNS] != 0.0
                x.paid = PaidZones(run.scenes[x.number], paying, x.switching, turning.tolist())
                payout.zones[x.number] = x.paid

    def attach(self, loop: NetworkSteps) -> None:
        """Let the steps of a loop follow the zones from now on, or ask for what they do."""
        run = self._run
        loop.clock.allowed = self.longest
        if not self._compiled:
            loop.bind_zones([])
            loop.counts.asks |= b.ASK_BEFORE | b.ASK_TRIES | b.ASK_STEPS
            return
        loop.hold_zones([x.switching.table for x in self.lines])
        loop.bind_zones([x.bind(loop) for x in self.lines])
        mine = [run.lines[x.number] for x in self.lines]
        if run.solver.shared is not None or any(x.contact is not None for x in mine):
            loop.counts.asks |= b.ASK_STEPS
        if any(x.observer.writes_criteria for x in mine):
            loop.counts.asks |= b.ASK_BEFORE | b.ASK_STEPS
        changes = [self._cells_of(x) for x in self.lines]
        alone = not loop.counts.asks & b.ASK_BEFORE  # else outputs are made in Python before cells change
        loop.change_cells([x.job if x is not None and x.in_steps and alone else None for x in changes])

    def _cells_of(self, x: _LineZones) -> CellChanges | None:
        """What changes cells of a line in arrays of their own, with the solver that has it now; None: nothing does."""
        if x.cells is not None and not x.cells.fits_zones(x.switching):
            x.cells = self._run.lines[x.number].cells = None
        return x.cells

    def _give_cells(self, x: _LineZones) -> None:
        """Let cells of a line, which are to change now, do so in arrays of their own, where that can be."""
        run, (now, then) = self._run, self._run.loop.states
        attached = now is run.state and then is run.other  # else steps are still to begin from what is there now
        if self._cells_of(x) is None and attached and CellChanges.may_change(run, x.number, x.switching):
            run.lines[x.number].write_down()
            run.lines[x.number].cells = x.cells = CellChanges(run, x.number, x.switching)
            x.cells.adopt()

    def use_solver(self, model: NetworkModel, solver: NetworkSolver) -> None:
        """Criteria know how near lines come to themselves and each other, by the contact that the solver has now."""
        run = self._run
        horizons = {x.number: LOOKAHEAD * x.switching.manager.ramp_time for x in self.lines}
        shared = solver.shared
        near = {} if shared is None else shared.watch_nearness(max(horizons.values()))
        for x in self.lines:
            contact = run.lines[x.number].contact
            if contact is not None:
                near[x.number] = contact.watch_nearness(horizons[x.number])
            x.switching.manager.near = near.get(x.number, np.zeros(0))

    def begin(self) -> None:
        """Weigh the criteria of the first state."""
        self._run.note_contact()
        for x in self.lines:
            x.switching.begin(self._ends(x), self._run.state.lines[x.number])
            if x.switching.manager.held:
                length = self._run.model.models[x.number].length
                self._run.lines[x.number].events.event(0.0, 0.0, length, "zones fixed", HELD)

    def _ends(self, x: _LineZones) -> Ends:
        return self._run.model.models[x.number].ends.at_time(self._run.t)

    @property
    def longest(self) -> float:
        """Longest step (s) that what is ramped allows."""
        return min(
            float(x.ramp_step if ramps else x.steady_step)
            for x, ramps in ((x.switching.zones.clock, x.switching.manager.ramping) for x in self.lines)
        )

    # --- checkpoints ------------------------------------------------------------------------------

    def checkpoint(self) -> dict[str, Any]:
        """Base cells that are rod, and what is under way, of each line by name; between two steps."""
        found = {}
        for x in self.lines:
            layout, switching = x.switching.manager.layout, x.switching.checkpoint()
            name = self._run.lines[x.number].name
            here = layout.here if x.paid is None else None  # a winch keeps the cells of its line
            found[name] = {"rod": layout.rod.copy(), "here": here, "switching": switching}
        return {"zones": found}

    def restore_lines(self, saved: Mapping[str, Any]) -> bool:
        """Give lines the zones of a checkpoint, in which nothing is under way yet.  ValueError: they are none of them.

        Contact with itself is that of the model of the run.
        """
        run = self._run
        kept = matched(saved["zones"], {run.lines[x.number].name: None for x in self.lines}, "zones")
        models, states = dict[int, Model](), [*run.state.lines]
        for x in self.lines:
            k, layout, manager = x.number, x.full.zoned, x.switching.manager
            mine, template = kept[run.lines[k].name], {"rod": manager.layout.rod, "here": None, "switching": None}
            if isinstance(mine, dict):
                mine = {"here": None} | mine  # files of 1.0 do not say where there are nodes
            matched(mine, template, "zones")
            if x.paid is not None:  # its winch has given the line the cells of then
                continue
            model = on_layout(run.model.models[k], _saved_layout(layout, mine))
            manager.set_layout(model.zoned)
            x.switching, x.pending = ZoneSwitching(model, manager), None
            x.full = replace(x.full, line=x.full.line._replace(bits=model.line.bits))
            models[k], states[k] = model, state_for(model.line)
            run.lines[k].begin_cells(model)
        run.model, run.state = run.model.with_lines(models), run.state._replace(lines=states)
        return True

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has written, of lines that have those zones.  ValueError: that cannot be."""
        for x in self.lines:
            line = self._run.lines[x.number]
            x.switching.manager.reset()
            mine = zoning_of_today(saved["zones"][line.name]["switching"])
            x.switching.restore(matched(mine, x.switching.checkpoint(), f"zones/{line.name}"))
            if line.books.strains.size:  # outputs within the next step begin with the stiffness of now
                line.books.strains[:, b.BENDS] = x.switching.model.line.kb[:, 0]
        self._run.note_contact()

    # --- steps ------------------------------------------------------------------------------------

    def judge_try(self, code: int) -> bool:
        """Lines are as at the end of a try; after it those that need more rod get it."""
        run, end = self._run, float(self._run.loop.clock.try_end)
        if code == b.TRYING:
            for x in self.lines if not self._compiled else ():
                x.do_phase(b.SOLVE, run.t, end, run.state.lines[x.number], run.other.lines[x.number])
        return code == b.TRIED and self._rescue()

    def _rescue(self) -> bool:
        """Whether lines have got more rod, with which the step is to be repeated."""
        run, changes, step = self._run, list[tuple[_LineZones, Change]](), int(self._run.loop.counts.steps)
        taken, clock = run.loop.tried, run.loop.clock
        end, last = float(clock.try_end), bool(0.5 * clock.tried_dt < clock.shortest)  # the last: no shorter is left
        if step != self._rescued:
            self._rescues, self._rescued = 0, step
        used_up = 0 < run.loop.counts.most_iterations <= run.loop.counts.taken  # another try would have no iteration
        for x in self.lines:
            k = x.number
            old, new = run.state.lines[k], run.other.lines[k]
            if taken.outcome != Outcome.OK and taken.line not in (k, -1):
                continue
            if taken.outcome == Outcome.OK and not self._compiled:
                x.do_phase(b.JUDGE, run.t, end, old, new)
            change = x.switching.rescue(taken, end, new, self._rescues)
            if change is None and last:
                change = x.switching.all_rod(taken)
            if change is not None and not used_up:
                changes.append((x, change))
        self._rescues += bool(changes)
        self._change(changes)
        return bool(changes)

    def note_step(self) -> None:
        """With the states exchanged: energy, and what should change."""
        run = self._run
        run.note_contact()
        for x in self.lines:
            k = x.number
            state, before = run.state.lines[k], run.other.lines[k]
            if not self._compiled:
                x.clock.last_dt, x.clock.last_rho = run.last_step, run.last_rho
                x.do_phase(b.END_STEP, run.t, run.t, state, before)
            x.pending = x.switching.book_step(run.t, state)

    def after_step(self) -> None:
        """Carry out what is pending."""
        changes = [(x, x.pending) for x in self.lines if x.pending is not None]
        for x in self.lines:
            x.pending = None
        self._change(changes)
        if changes and all(x.cells is not None for x, _ in changes):
            self._run.loop.renew_pulls()

    def _change(self, changes: Sequence[tuple[_LineZones, Change]]) -> None:
        """Carry out changes of lines, in their arrays where that can be."""
        run, rest = self._run, list[tuple[_LineZones, Change]]()
        for x, change in changes:
            self._give_cells(x)
            if x.cells is None:
                rest.append((x, change))
                continue
            if not x.cells.in_steps:
                run.lines[x.number].write_down()  # of the zones before
            booked = x.cells.change() if change.same else x.cells.change_zones(change)
            x.cells.sync()
            note_change(run.lines[x.number].events, x.switching.manager, run.t, change, booked)
        for x, change in rest:
            x.switch(change)
        if rest:
            run.go_on_changed((), AFTER_CHANGE)
