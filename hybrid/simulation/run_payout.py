"""Lines of several that are paid out or taken in: lengths in compiled steps, nodes that enter and leave between them.

Each of them has a reel (simulation.payout): steps follow the lengths, and where a node is due at
a winch Python changes the line, and the network gets another solver.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.laws.water import PHASE
from hybrid.kernels.mesh.zone_step import Zones
from hybrid.kernels.reel.payout import iterate, iterate_with_others, limit_next_step, pay_out, stand_among, stand_still
from hybrid.kernels.reel.reel import MovingZones, ReelJob, zones_that_stay
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import FORCE_A, FORCE_B
from hybrid.kernels.state.state import Floats, State, state_for
from hybrid.model.build import Model
from hybrid.model.mesh import Layout
from hybrid.model.network import NetworkModel
from hybrid.model.payout import FEWEST_CELLS
from hybrid.scene.schema import LineScene
from hybrid.simulation.parts import Accelerations, Part
from hybrid.simulation.payout import PayingOut
from hybrid.simulation.payout_nodes import NodeChanges
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import LineFailed, NetworkState, NetworkTaken
from hybrid.zones.change import ZoneSwitching, rods_at_winch
from hybrid.zones.manager import Change, DomainManager, Reason

# Nodes by which cells are merged before the one leaves at which they must be whole: merged then, where the reel still
# brings lengths to their true ones, they kicked the pull by 0.14 % of its mean, a node before by 0.09 %.
MERGED_AHEAD = 2


class PaidZones:
    """The zones of one line that is paid out."""

    def __init__(
        self, scene: LineScene, paying: PayingOut, switching: ZoneSwitching, turning: Sequence[bool] = (False, False)
    ) -> None:
        """turning: whether the ends are clamped to what turns, beside which a line stays rod."""
        self.scene, self.paying, self.switching, self._turning = scene, paying, switching, turning

    @property
    def manager(self) -> DomainManager:
        return self.switching.manager

    def before_change(self) -> tuple[Change, np.ndarray | None] | None:
        """What must change before a node enters or leaves: rods, and places of nodes on the finest mesh (K+1,) bool.

        Rods where a node leaves, and no cells there that are shorter than those near a winch may be; None: so it is.
        """
        paying, layout = self.paying, self.manager.layout
        near, none = paying.plan.at_winch(paying.count, 0.0), np.zeros_like(layout.rod)
        change, here = self.manager.same_zones(), None
        if not layout.rod[near].all():
            a, b = np.flatnonzero(near)[[0, -1]]
            why = Reason(int(a), int(b) + 1, "grow", "it is about to be taken in")
            change = Change(layout.rod | near, (why,), near, none)
        if paying.plan.follows:
            here = layout.node_flags
            if not paying.enters:
                here &= self._may_stay(layout)
        stays = here is None or bool((here == layout.node_flags).all())
        return None if change.same and stays else (change, here)

    def _may_stay(self, layout: Layout) -> np.ndarray:
        """(K+1,) bool, places on the finest mesh of nodes that there may be when MERGED_AHEAD less are out."""
        plan, count = self.paying.plan, self.paying.count
        fewer, whole = plan.parts_of(count - MERGED_AHEAD), np.ones(MERGED_AHEAD, int)
        fewer = np.concatenate([fewer, whole] if plan.side else [whole, fewer])
        step = np.repeat(layout.parts // np.minimum(fewer, layout.parts), layout.parts)
        return np.append((np.arange(step.size) - np.repeat(layout.starts[:-1], layout.parts)) % step == 0, True)

    def hand_over(self, t: float, state: State) -> None:
        """At t (s): cells whose lengths the reel has brought to their true ones are those of zones from now on.

        Where cells follow the curvature these are as long as makes chords of arcs, and go there within a ramp time.
        """
        paying, switching, zones = self.paying, self.switching, self.switching.zones
        reel, line = paying.reel, switching.model.line
        at = np.arange(reel.since.size)
        let = (reel.since > -np.inf) & (at < paying.material - 1)
        if paying.plan.follows:
            let &= at < paying.material - 1 - FEWEST_CELLS
        else:
            let &= reel.since + reel.span <= t
        if not let.any():
            return
        own = np.flatnonzero(let)
        lack, rate = paying.lengths_now(own, t)
        cells = own if paying.plan.side else reel.since.size - 1 - own
        true = np.diff(line.s)[cells]
        if paying.plan.follows:
            less = switching.arcs_less_chords(state)[cells]
            true, lack = true - less, lack - less
        zones.true[cells], zones.lack[cells], zones.rate[cells], zones.since[cells] = true, lack, rate, t
        zones.lengths[cells], zones.keeps[cells], zones.counts.relaxing = line.h[cells], False, 1
        paying.release(own)

    def as_now(self, model: Model, t: float, state: State) -> Model:
        """Before zones change at t (s): the model with its nodes where they are now."""
        self.hand_over(t, state)
        model, switching, zones = self.paying.as_now(model), self.switching, self.switching.zones
        switching.model = model
        manager = self.manager
        manager.layout, manager.on_base = model.zoned, model.line_maker
        manager.measure(model.zoned)
        changing = self.paying.changing
        zones.lengths[changing] = model.line.h[changing]
        zones.true[changing] = model.line.h[changing]
        return model

    @property
    def zones(self) -> Zones:
        """What the compiled run knows of them."""
        return self.switching.zones

    def use_base(self, model: Model, source: np.ndarray) -> None:
        """A node enters or leaves: the base cells are those of a model, whose line is still to be made.

        source: (n,) which base cells they were.
        """
        paying, manager = self.paying, self.manager
        paying.foreseen = paying.fastest
        self._use_base(model, source)
        near = paying.plan.at_winch(source.size - paying.rides, 0.0)
        manager.grown[near], manager.leaving[near] = 1.0, False

    def resume(self, model: Model) -> None:
        """Go on with the cells of a checkpoint, from which all else follows (ZoneSwitching.restore)."""
        n = self.manager.layout.rod.size
        self._use_base(model, np.minimum(np.arange(model.zoned.rod.size), n - 1), anew=True)
        self.switching.use_base(model)
        self.switching.set_cells(model.line)

    def _use_base(self, model: Model, source: np.ndarray, anew: bool = False) -> None:
        paying, manager, count = self.paying, self.manager, source.size - self.paying.rides
        given = rods_at_winch(self.scene, paying.plan, model, count, manager.ramp_time, paying.foreseen)
        given[[0, -1]] = np.where(self._turning, 1, given[[0, -1]])
        manager.cable = paying.plan.held_as(model.cable)
        manager.use_base(model.zoned, model.line_maker, source, given, anew)


class RunPayout(Part):
    """The lengths of all lines of a run that are paid out."""

    name = "payout"  # a winch may come to its end after any step

    def __init__(self, run: RunOfLines) -> None:
        """Of a run whose model is that of t = 0; it gets lines with the nodes that a winch makes."""
        self._run = run
        self.zones: dict[int, PaidZones] = {}  # of those whose zones move
        self.lines = {k: PayingOut(x) for k, x in enumerate(run.model.models) if x.payout is not None}
        each = ((k, x, run.model.models[k]) for k, x in self.lines.items())
        run.model = run.model.with_lines({k: x.on(model, model.length) for k, x, model in each})
        for k, x in self.lines.items():  # vortices begin once round along the line
            wake = run.state.lines[k].wake
            wake[:, PHASE] = 2.0 * np.pi * run.model.models[k].line.s[: len(wake)] / x.plan.first
        self._rows = np.array([x.table.numbers for x in self.lines.values()])
        for row, x in zip(self._rows, self.lines.values(), strict=True):
            x.table.move(row)
        self._nodes: dict[int, NodeChanges] = {}  # what lets nodes enter and leave without Python

    # --- steps ------------------------------------------------------------------------------------

    def use_solver(self, model: NetworkModel, solver: NetworkSolver) -> None:
        """A solver finds forces with the lengths of now, of the state of now."""
        for k, x in self.lines.items():
            x.layout = model.models[k].layout
            x.table.bind(**self._job(solver, k))
            numbers = x.table.numbers
            joined = solver.lines[k].joints[x.plan.side] >= 0
            asked = iterate.address(numbers) if joined or x.asks(solver.lines[k].line) else 0
            with_others = iterate_with_others.address(numbers) if asked else 0
            solver.wind(k, asked, reel=stand_among.address(numbers), reel_table=numbers, iterated=with_others)

    def _job(self, solver: NetworkSolver, k: int) -> dict[str, Any]:
        """What changes the length of a line, whose state of now is that before a step and after it."""
        run, paying, x = self._run, self.lines[k], solver.lines[k]
        books, work, state = run.lines[k].books, solver.work[k], run.state.lines[k]
        zones = self.zones[k].switching.zones if k in self.zones else None
        moving = zones_that_stay() if zones is None else MovingZones(zones.lengths, zones.stiff)
        given = run.loop.clock, run.loop.counts, books.work, books.velocity, work.report, paying.reel
        job = ReelJob(x.line, x.sea, x.ends, state, state, *given, work.X, work.W, moving)
        return job._asdict()

    def attach(self, loop: NetworkSteps) -> None:
        """Let the steps of a loop follow the lengths from now on."""
        even, odd = loop.turns
        for k, x in self.lines.items():
            x.table.bind(old=even.lines[k], new=odd.lines[k])
            self._change_by_itself(k)
        loop.pay(self._rows, pay_out.address(self._rows[0]))
        loop.change_nodes([self._nodes[k].job if k in self._nodes else None for k in self.lines])

    def _change_by_itself(self, k: int) -> None:
        """Let nodes of line k enter and leave without Python from now on, where that can be."""
        run, nodes = self._run, self._nodes.get(k)
        if nodes is None or not nodes.fits:
            self._nodes.pop(k, None)
            if not run.loop.counts.samples and NodeChanges.may_change(run, k):
                self._nodes[k] = NodeChanges(run, k)
                self._nodes[k].adopt()
            if k not in self.zones:
                run.lines[k].cells = self._nodes.get(k)

    def find_accelerations(self, solve: Accelerations) -> Accelerations:
        """With what acts because lengths change, and with winches that hold a tension."""

        def among_lengths(lengthening: Mapping[int, Floats]) -> NetworkTaken:
            with ExitStack() as stack:
                for x in self.lines.values():
                    stand_still(x.table.numbers)
                for x in self.lines.values():
                    stack.enter_context(x.forces_on())
                return solve({**lengthening, **{k: x.lengthening for k, x in self.lines.items()}})

        def with_rotors(lengthening: Mapping[int, Floats]) -> NetworkTaken:
            self._accelerate_rotors(partial(among_lengths, lengthening))
            return among_lengths(lengthening)

        return with_rotors

    def _accelerate_rotors(self, solve: Callable[[], NetworkTaken]) -> None:
        """Winches that hold a tension: what is left of the balance of each is linear in the accelerations of all."""
        run = self._run
        free = {k: x for k, x in self.lines.items() if x.holds_tension and run.t > x.winch.begin}
        if not free:
            return

        def out_of_balance() -> Floats:  # N
            solve()
            at = {k: FORCE_B if x.plan.side else FORCE_A for k, x in free.items()}
            pulls = {k: np.linalg.norm(run.solver.work[k].report[i : i + 3]) for k, i in at.items()}
            return np.array([pulls[k] - x.resistance(run.t) for k, x in free.items()])

        for line in run.lines:
            line.books.counts.repeats = 1  # no extremes of what is tried
        try:
            first, answers = out_of_balance(), []
            for x in free.values():
                x.accelerate(1.0)
                answers.append(out_of_balance() - first)
                x.accelerate(-1.0)
        finally:
            for line in run.lines:
                line.books.counts.repeats = 0
        for x, more in zip(free.values(), np.linalg.solve(np.array(answers).T, -first), strict=True):
            x.accelerate(float(more))

    def after_step(self) -> None:
        """Nodes enter and leave.  LineFailed: a winch has come to its end."""
        run, changed = self._run, []
        for k, x in self.lines.items():
            if x.at_its_end:
                least, most = x.plan.shortest, x.plan.longest
                text = f"{x.length:.6g} m are out, of {least:.6g} m at least and {most:.6g} m (longest) at most"
                raise LineFailed(k, Outcome.WINCH_AT_END, run.t, float(run.model.models[k].line.s[-1]), text)
            if x.due and k in self._nodes and self._nodes[k].fits:
                self._nodes[k].change()
            elif x.due:
                self._change(k, x)
                changed.append(k)
        if changed:
            run.go_on_changed(self._touched(changed), "where a node enters or leaves at a winch")

    def stop(self, number: int, over: float) -> None:
        """The winch of a line stops, over a time (s), between two steps; ValueError: it cannot."""
        run, paying = self._run, self.lines[number]
        run.output_due()
        run.lines[number].write_down()  # with the law as it is
        held = paying.holds_tension
        paying.stop(run.t, over)
        if held:  # iterations ask nothing of the winch any more
            run.go_on_changed(self._touched([number]), "where a winch is stopped")

    def _touched(self, changed: Iterable[int]) -> set[int]:
        """These lines, and those that share contact."""
        shared = self._run.solver.shared
        return {*changed, *(() if shared is None else shared.lines)}

    def _change(self, k: int, paying: PayingOut) -> None:
        """A node enters at the winch of a line, or leaves it."""
        run, line, states = self._run, self._run.lines[k], [*self._run.state.lines]
        line.write_down()  # with the reel as it is
        zones = self.zones.get(k)
        first = zones.before_change() if zones is not None else None
        if first is not None:
            assert line.zones is not None
            line.zones.switch(*first)
            states = [*run.state.lines]
        if zones is not None:
            zones.hand_over(run.t, states[k])
        model, states[k], books, booked = NodeChanges(run, k, once=True).change_once(zones)
        if zones is not None:
            zones.switching.use_base(model)
        if line.contact is not None or line.shares:  # whose forces kernels.reel.paid_length does not know
            paying.leave_unbalanced()
        line.books.work[0, b.ZONES] += booked
        run.model = run.model.with_lines({k: model})
        run.state = NetworkState(states, run.state.bodies)
        line.use_cells(model, books)

    def begin_leg(self) -> None:
        """The next step is no longer than the laws of the lengths allow."""
        for x in self.lines.values() if self._run.loop.controlled else ():
            limit_next_step(x.table.numbers)

    # --- checkpoints ------------------------------------------------------------------------------

    def checkpoint(self) -> dict[str, Any]:
        """What the next steps depend on, by line."""
        return {"payout": {self._run.lines[k].name: x.checkpoint() for k, x in self.lines.items()}}

    def restore_lines(self, saved: Mapping[str, Any]) -> bool:
        """Give lines the cells and the reels of a checkpoint.  ValueError: they are none of them."""
        run, states, saved = self._run, [*self._run.state.lines], saved["payout"]
        for k, x in self.lines.items():
            model = x.restore(saved[run.lines[k].name], run.model.models[k])
            if k in self.zones:
                self.zones[k].resume(model)
            run.model = run.model.with_lines({k: model})
            states[k] = state_for(model.line)
            run.lines[k].begin_cells(model)
        run.state = NetworkState(states, run.state.bodies)
        return True

    def restore(self, saved: Mapping[str, Any]) -> None:
        """The lines are as long as at the time of the run."""
        for x in self.lines.values():
            x.lengthen()
