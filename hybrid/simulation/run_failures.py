"""What fails in a run: lines that break in mid-motion, and steps that are cut or do not lead on.

Nothing is stored between a line that turns freely and its point, so no energy goes with it; what bends between the
end of a line and its clamp goes with the clamp, and the twist of catenary zones with the torque that passed through.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import DONE, SPRING, W
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.zone_torque import TURN, torsion_energy
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import FORCE_A
from hybrid.kernels.state.state import NO_TURN, State
from hybrid.kernels.step.accept import MANY
from hybrid.model.build import Model
from hybrid.model.failure import Weakness, after_failure, weaknesses
from hybrid.simulation.events import (
    COLLAPSE,
    CUTS,
    GIVE_UP,
    TOUCH_EACH_OTHER,
    TOUCHES_ITSELF,
    collapse_text,
    count_iterations,
    energy_gains_text,
    note_cut,
    note_iterations,
    note_slack,
)
from hybrid.simulation.failure import Stopped, explanation, first_remedy, touch_text
from hybrid.simulation.parts import Part
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.contact import SharedContact
from hybrid.solve.network_steps import NetworkSteps, Tried
from hybrid.solve.stepper import LineFailed, NetworkState, NetworkTaken

SAME_TIME = 1e-6  # of a step: a time so near is now


class Failures(Part):
    """What may break in a run, and what has."""

    name = "failures"  # a force may be too large after any step

    def __init__(self, run: RunOfLines) -> None:
        self._run = run
        self.all = weaknesses(run.network)
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
            self._renew()

    def break_now(self, weakness: Weakness, why: str) -> None:
        """Break now what a program outside lets go."""
        self.all = (*self.all, weakness)
        self._break(len(self.all) - 1, why)
        self._renew()

    def _renew(self) -> None:
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
        for part in run.parts:
            part.let_go(x.ends)
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
            line.use_model(model)
        for part in run.parts:
            part.release(self.all[k].ends)
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
    observe(model.line, model.ends.at_time(t), state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
    line = model.line
    twist = float(torsion_energy(line, state.turn[:, TURN], state.T)) if line.torsion.size else 0.0
    return float(energy[1] + energy[2]) + twist


# --- steps that are cut, that have become very short, or of which none leads on -----------------------


class TouchingLines(Protocol):
    """Contact of the lines of a run."""

    shared: SharedContact | None  # with each other


class Cuts(Part):
    """Steps that are cut, and those after which there is no other."""

    name, wants = "cuts", b.COLLAPSES | b.STEPS_CUT | b.STEPS_SLACK | b.ITERATIONS_CUT

    def __init__(self, run: RunOfLines, contact: TouchingLines, compared: bool) -> None:
        """contact: of its lines; compared: whether the run is only to be compared with."""
        self._run, self._contact, self._compared = run, contact, compared

    def after_step(self) -> None:
        """Events of steps that were cut."""
        run = self._run
        loop, clock, flags = run.loop, run.loop.clock, int(run.loop.counts.notices)
        if flags & b.COLLAPSES:
            self._note_collapse()
        if flags & b.STEPS_CUT:
            turned = run.lines[loop.turned_line]
            note_cut(clock, float(clock.most_turn), turned.model.length, turned.events, loop.controlled)
        if flags & b.STEPS_SLACK:
            slack = run.lines[loop.slack_line]
            s = float(slack.model.line.s[int(loop.counts.slack_cell)])
            note_slack(clock, float(slack.books.clock.wave_step), s, slack.events)
        if flags & b.ITERATIONS_CUT:
            note_iterations(clock, loop.counts, run.span[1], run.noted)

    def finish(self, status: str) -> None:
        """How many steps were taken before they had converged, and how many tries contact cost."""
        run, shared = self._run, self._contact.shared
        if status == "complete":
            count_iterations(run.loop.clock, run.loop.counts, run.span[1], run.noted)
        if shared is not None and (tries := shared.given_up):
            run.note("steps cut", energy_gains_text(tries))

    @property
    def _touching(self) -> str:
        """What touches now, a line itself or another one, for the text of a failure; empty: nothing."""
        shared = self._contact.shared
        pairs = shared.points_between() if shared is not None else []
        if any(a != c for (a, _), (c, _) in pairs):
            return TOUCH_EACH_OTHER
        own = (line.contact for line in self._run.lines)
        return TOUCHES_ITSELF if pairs or any(x is not None and x.touches for x in own) else ""

    def _note_collapse(self) -> None:
        """Steps have become so short that the run may not end: an event; one to be compared with stops."""
        run = self._run
        count, clock = run.loop.counts, run.loop.clock
        number, where = run.loop.last_cut
        line = run.lines[max(number, 0)]
        s = float(line.model.line.s[min(max(where, 0), line.model.line.s.size - 1)]) if number >= 0 else 0.0
        cuts, tiny = {cause: int(getattr(count, name)) for cause, name in CUTS.items()}, int(count.tiny_steps)
        text = collapse_text(tiny, run.last_step, float(clock.longest), cuts, s, self._touching)
        if tiny == MANY:
            line.events.event(run.t, s, s, COLLAPSE, text, value=run.last_step)
        if self._compared and tiny >= GIVE_UP:
            raise LineFailed(line.number, Outcome.COLLAPSED, run.t, s, text)

    def explains(self, taken: NetworkTaken, dt: float) -> LineFailed:
        """Why no step of dt (s) leads on; 0: why there are no accelerations."""
        run, solver = self._run, self._run.solver
        if taken.line < 0:
            detail = f"smallest step tried {dt:.3g} s; {taken.iterations} Newton iterations in the last try"
            if dt == 0.0:
                detail = "no accelerations are consistent with the shape and the loads"
            return LineFailed(-1, taken.outcome, run.t, None, detail + self._touching)
        k, tried = taken.line, Tried(taken.outcome, taken.iterations, taken.correction, taken.where)
        line, model, now = run.lines[k], run.model.models[k], run.state.lines[k]
        x = Stopped(
            model, now, run.other.lines[k] if dt else now, run.loop.clock, run.loop.counts, tried, dt,
            float(line.books.clock.wave_step), line.manager is not None, max(solver.joints[k]) < 0,
            touch_text(line.contact, model) or self._touching,
        )  # fmt: skip
        s = float(model.line.s[x.node])
        return LineFailed(k, taken.outcome, run.t, s, explanation(x), first=first_remedy(x))
