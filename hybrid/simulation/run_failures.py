"""Lines of a system that break in mid-motion: when, what goes on, and the event.

Nothing is stored between a line that turns freely and its point, so no energy goes with it; what bends between the
end of a line and its clamp goes with the clamp, and the twist of catenary zones with the torque that passed through.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hybrid.kernels.junctions.bodies import DONE, SPRING, W
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.zone_torque import TURN, torsion_energy
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import FORCE_A
from hybrid.kernels.state.state import NO_TURN, State
from hybrid.model.build import Model
from hybrid.model.failure import Weakness, after_failure, weaknesses
from hybrid.simulation.parts import Part
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.joined import NetworkState
from hybrid.solve.network_steps import NetworkSteps

SAME_TIME = 1e-6  # of a step: a time so near is now


class Failures(Part):
    """What may break in a run, and what has."""

    name = "failures"  # a force may be too large after any step

    def __init__(self, run: RunOfLines) -> None:
        self._run = run
        self.all = weaknesses(run.system)
        self.broken: list[int] = []  # numbers in `all`, in the order in which they broke

    @property
    def breaks(self) -> list[float]:
        """Times (s) at which something breaks by itself."""
        return [x.time for k, x in enumerate(self.all) if np.isfinite(x.time) and k not in self.broken]

    def attach(self, loop: NetworkSteps) -> None:
        """Steps ask where something may break."""
        if self.all:
            loop.counts.asks |= b.ASK_STEPS

    def after_step(self) -> None:
        """Break what is to break now; the run goes on from there."""
        found, near = False, SAME_TIME * self._run.resolution.one.step
        for k, x in enumerate(self.all):
            if k in self.broken:
                continue
            if x.time <= self._run.t + near:
                self._break(k, f"at t = {self._run.t:.6g} s (break_at.time)")
                found = True
            elif np.isfinite(x.tension) and (force := self._force(x)) > x.tension:
                limit = f"above break_at.tension, {x.tension:g} N"
                why = f"after the first step in which its force, {force:.6g} N, is {limit}"
                self._break(k, why)
                found = True
        if found:
            self._go_on()

    def release(self, weakness: Weakness, why: str) -> None:
        """Break now what a program outside lets go; why: for the event."""
        self.all = (*self.all, weakness)
        self._break(len(self.all) - 1, why)
        self._go_on()

    def _go_on(self) -> None:
        """Accelerations jump, and there is room for the next state."""
        self._run.restart_steps()
        self._run.renew_other()

    def _force(self, x: Weakness) -> float:
        """Force of the ends on their point, N."""
        reports = [(self._run.solver.work[line].report, FORCE_A + 3 * k) for line, k in x.ends
                   if (line, k) not in self._run.model.loose]  # fmt: skip
        return float(np.linalg.norm(sum((r[f : f + 3] for r, f in reports), np.zeros(3))))

    def checkpoint(self) -> dict[str, Any]:
        """What broke."""
        return {"broken": [*self.broken]}

    def of_today(self, saved: Mapping[str, Any]) -> dict[str, Any]:
        """In files of an earlier program nothing broke."""
        return {"broken": saved.get("broken", [])}

    def restore_joints(self, saved: Mapping[str, Any]) -> bool:
        """Be as after what broke in an earlier part of the run.  ValueError: nothing of the kind may break."""
        broken = saved["broken"]
        if not isinstance(broken, list) or len(set(broken)) < len(broken):
            raise ValueError("broken: numbers of what has broken were expected")
        if not all(isinstance(k, int) and 0 <= k < len(self.all) for k in broken):
            raise ValueError("broken: numbers of what may break were expected")
        for k in broken:
            self._part(k)
        return False  # each has been given a solver

    def restore(self, saved: Mapping[str, Any]) -> None:
        """That alone is broken."""
        self.broken = [*saved["broken"]]

    def _break(self, k: int, why: str) -> None:
        run, x = self._run, self.all[k]
        line, end = x.ends[0]
        run.output_due()
        if run.payout is not None:
            run.payout.let_go(x.ends)
        before, states, energy = run.model.models, run.state.lines, 0.0
        self._part(k)
        for l, e in x.ends:
            old, new = before[l], run.model.models[l]
            if new is not old:
                lost = elastic(new, run.t, run.state.lines[l]) - elastic(old, run.t, states[l])
                run.lines[l].books.work[0, e] += lost
                energy += lost
        text = f"{x.name} {why}; what came loose is free from here on"
        s = float(run.model.models[line].line.s[-end])
        run.noted.event(run.t, s, s, "end released", text, energy=energy)

    def _part(self, k: int) -> None:
        """Take the ends off their point, in a solver of its own."""
        run = self._run
        run.model = after_failure(run.model, self.all[k], run.t)
        self.broken.append(k)
        for line, model in zip(run.lines, run.model.models, strict=True):
            line.follow(model)
        if run.zones is not None:
            run.zones.release(self.all[k].ends)
        states = [
            x if x.turn.size == 3 * len(model.line.torsion) else x._replace(turn=NO_TURN)
            for x, model in zip(run.state.lines, run.model.models, strict=True)
        ]
        for point in run.model.unheld:
            run.state.bodies[len(run.model.bodies) + point, W:] = 0.0
        run.state = NetworkState(states, run.state.bodies)
        done = run.solver.body_work[:, DONE:SPRING].copy()
        run.make_solver()
        run.solver.body_work[:, DONE:SPRING] = done


def elastic(model: Model, t: float, state: State) -> float:
    """Energy of bending and torsion, J, at t (s), with that of zones that a torque passes through."""
    cells, energy = model.cells, np.zeros(4)
    observed = Observed(np.zeros((cells + 1, 3)), np.zeros((cells + 1, 3)), energy)
    observe(model.line, model.ends.at(t), state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
    line = model.line
    twist = float(torsion_energy(line, state.turn[:, TURN], state.T)) if line.torsion.size else 0.0
    return float(energy[1] + energy[2]) + twist
