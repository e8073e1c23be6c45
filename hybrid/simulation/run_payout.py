"""Lines of several that are paid out or taken in: lengths in compiled steps, nodes that enter and leave between them.

As of one cable (simulation.payout), whose reel each of them has: steps follow the lengths, and where a node is due at
a winch Python changes the line, and the system gets another solver.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.reel.payout import iterate, iterate_with_others, pay_out, stand_among
from hybrid.kernels.reel.reel import ReelJob
from hybrid.kernels.run.payout_run import ask_node, change_node
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import SELF_CONTACT_ENERGY
from hybrid.kernels.state.state import Floats, state_for
from hybrid.model.build import Model
from hybrid.model.network import NetworkModel
from hybrid.simulation.failure import winch_text
from hybrid.simulation.parts import Part
from hybrid.simulation.payout import Before, PayingOut
from hybrid.simulation.payout_nodes import NodeChanges
from hybrid.simulation.payout_zones import PaidZones, moving_zones
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.joined import LineFailed, NetworkState

if TYPE_CHECKING:
    from hybrid.solve.network_solver import NetworkSolver
    from hybrid.solve.network_steps import NetworkSteps


class RunPayout(Part):
    """The lengths of all lines of a run that are paid out."""

    name = "payout"  # a winch may come to its end after any step

    def __init__(self, run: RunOfLines) -> None:
        """Of a run whose model is that of t = 0; it gets lines with the nodes that a winch makes."""
        self._run = run
        self.zones: dict[int, PaidZones] = {}  # of those whose zones move
        self.lines = {k: PayingOut(x) for k, x in enumerate(run.model.models) if x.payout is not None}
        self._take({k: x.on(run.model.models[k], run.model.models[k].length) for k, x in self.lines.items()})
        for k, x in self.lines.items():
            x.begin_phases(run.model.models[k].line, run.state.lines[k])
        self._rows = np.array([x.table.numbers for x in self.lines.values()])
        for row, x in zip(self._rows, self.lines.values(), strict=True):
            x.table.move(row)
        self._nodes: dict[int, NodeChanges] = {}  # what lets nodes enter and leave without Python

    def _take(self, models: Mapping[int, Model]) -> None:
        run = self._run
        found = tuple(models.get(k, x) for k, x in enumerate(run.model.models))
        run.model = replace(run.model, models=found)

    @property
    def remeshes(self) -> bool:
        """Nodes enter and leave at a winch."""
        return True

    @property
    def changed(self) -> Collection[int]:
        """Numbers of the lines."""
        return self.lines.keys()

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
        job = ReelJob(
            x.line, x.sea, x.ends, state, state, run.loop.clock, run.loop.counts, books.work,
            books.velocity, work.report, paying.reel, work.X, work.W, moving_zones(self.zones.get(k)),
        )  # fmt: skip
        return job._asdict()

    def attach(self, loop: NetworkSteps) -> None:
        """Let the steps of a loop follow the lengths from now on."""
        even, odd = loop.turns
        for k, x in self.lines.items():
            x.table.bind(old=even.lines[k], new=odd.lines[k])
            self._change_by_itself(k)
        loop.pay(self._rows, pay_out.address(self._rows[0]))
        jobs = [self._nodes[k].job if k in self._nodes else None for k in self.lines]
        one = next((x for x in jobs if x is not None), None)
        loop.change_nodes(jobs, *(() if one is None else (ask_node.address(one), change_node.address(one))))

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

    def sync(self) -> None:
        """Python knows of the nodes of now."""
        for x in self._nodes.values():
            x.sync()

    @contextmanager
    def forces_on(self) -> Iterator[dict[int, Floats]]:
        """While accelerations are found: lines with what acts because their lengths change.

        It gives second rates (N,) m/s2 of the lengths of cells, by line.
        """
        with ExitStack() as stack:
            for x in self.lines.values():
                x.stand_still()
            for x in self.lines.values():
                stack.enter_context(x.forces_on())
            yield {k: x.lengthening for k, x in self.lines.items()}

    def after_step(self) -> None:
        """Nodes enter and leave.  LineFailed: a winch has come to its end."""
        run, changed = self._run, []
        for k, x in self.lines.items():
            if x.at_its_end:
                text = winch_text(x)
                raise LineFailed(k, Outcome.WINCH_AT_END, run.t, float(run.model.models[k].line.s[-1]), text)
            if x.due and k in self._nodes and self._nodes[k].fits:
                self._nodes[k].change()
            elif x.due:
                self._change(k, x)
                changed.append(k)
        if changed and run.zones is not None:
            run.zones.go_on("where a node enters or leaves at a winch")
        elif changed:
            touching = () if run.contact.shared is None else run.contact.shared.lines
            before = {k: float(run.solver.work[k].report[SELF_CONTACT_ENERGY]) for k in {*changed, *touching}}
            run.renew_solver("where a node enters or leaves at a winch")
            for k, energy in before.items():
                run.lines[k].books.work[0, b.ZONES] += float(run.solver.work[k].report[SELF_CONTACT_ENERGY]) - energy

    def _change(self, k: int, paying: PayingOut) -> None:
        """A node enters at the winch of a line, or leaves it."""
        run, line, states = self._run, self._run.lines[k], [*self._run.state.lines]
        line.write_down()  # with the reel as it is
        zones = self.zones.get(k)
        first = zones.before_change() if zones is not None else None
        if first is not None and run.zones is not None:
            run.zones.switch(k, *first)
            states = [*run.state.lines]
        if zones is not None:
            zones.hand_over(run.t, states[k])
        before = Before(states[k], run.t, run.loop.clock, line.books.tension)
        model, states[k], booked = paying.change(
            before, run.model.models[k], zones.carry if zones is not None else None
        )
        if line.contact is not None or line.shares:  # whose forces kernels.reel.payout_balance does not know
            paying.leave_unbalanced()
        line.books.work[0, b.ZONES] += booked
        self._take({k: model})
        run.state = NetworkState(states, run.state.bodies)
        line.take_cells(model)

    def let_go(self, ends: Iterable[tuple[int, int]]) -> None:
        """Ends (line, 0 or 1) come loose: at a winch no more line comes."""
        run = self._run
        for k, end in ends:
            if k in self.lines and self.lines[k].plan.side == end:
                run.lines[k].write_down()  # with the law as it is
                model, books = run.model.models[k], run.lines[k].books
                before = Before(run.state.lines[k], run.t, run.loop.clock, books.tension)
                books.work[0, b.ZONES] += self.lines[k].end(before, model.line, model.ends.at(run.t))

    def begin_leg(self) -> None:
        """The next step is no longer than the laws of the lengths allow."""
        for x in self.lines.values():
            x.limit_step()

    def fit_models(self, model: NetworkModel) -> NetworkModel:
        """A model with other loads on the cells of t = 0, with the cells of now."""
        found = [*model.models]
        for k, x in self.lines.items():
            found[k] = x.on(replace(found[k], layout=self._run.model.models[k].layout), x.length)
        return replace(model, models=tuple(found))

    # --- checkpoints ------------------------------------------------------------------------------

    def checkpoint(self) -> dict[str, Any]:
        """What the next steps depend on, by line."""
        return {"payout": {self._run.lines[k].name: x.checkpoint() for k, x in self.lines.items()}}

    def restore_cells(self, saved: Mapping[str, Any]) -> bool:
        """Give lines the cells and the reels of a checkpoint.  ValueError: they are none of them."""
        run, states, saved = self._run, [*self._run.state.lines], saved["payout"]
        for k, x in self.lines.items():
            model = x.restore(saved[run.lines[k].name], run.model.models[k])
            if k in self.zones:
                self.zones[k].resume(model)
            self._take({k: model})
            states[k] = state_for(model.line)
            run.lines[k].take_cells(model, extremes=False)
        run.state = NetworkState(states, run.state.bodies)
        return True

    def restore(self, saved: Mapping[str, Any]) -> None:
        """The lines are as long as at the time of the run."""
        for x in self.lines.values():
            x.lengthen()
